// SPDX-License-Identifier: GPL-2.0-or-later
//! Paths of LinuxCNC on this computer, as in Debian's packages, and its search paths.

use std::env;
use std::path::{Path, PathBuf};

/// Files that come with LinuxCNC: programs, subroutines, HAL files.
pub const SHARE: &str = "/usr/share/linuxcnc";
/// HAL files that every machine may use: `LIB:` in an INI file.
pub const HALLIB: &str = "/usr/share/linuxcnc/hallib";
/// Modules of the real-time part.
pub const MODULES: &str = "/usr/lib/linuxcnc/modules";
/// Programs.
pub const BIN: &str = "/usr/bin";
/// Default file of parameters, including work offsets, in the folder of the INI file.
pub const PARAMETERS: &str = "rs274ngc.var";

/// Keys of the INI file that name folders; several are separated by colons.
const FOLDERS: [(&str, &str); 4] = [
    ("DISPLAY", "PROGRAM_PREFIX"),
    ("RS274NGC", "SUBROUTINE_PATH"),
    ("RS274NGC", "USER_M_PATH"),
    ("WIZARD", "WIZARD_ROOT"),
];

/// Why a section of [`is_of_tcl`] is refused.
pub const OF_TCL: &str =
    "the section would overwrite a variable of Tcl, which runs the HAL files; rename it";

/// Returns whether a section has the name of one of Tcl's own variables, such as `env`. LinuxCNC creates a variable for
/// each section before it runs HAL files of Tcl, which would then misbehave.
pub fn is_of_tcl(section: &str) -> bool {
    let own = ["auto_", "tcl_", "unknown_", "argv", "error"];
    own.iter().any(|start| section.starts_with(start)) || ["env", "argc"].contains(&section)
}

/// Returns the folders of a key with absolute paths, for a process with another current directory; `None` for a key
/// without folders. `ini` is the absolute path of the file.
pub fn folders(ini: &Path, section: &str, key: &str, value: &str) -> Option<String> {
    let from_root = |name: &str| named(ini, name.trim()).display().to_string();
    let whole = || value.split(':').map(from_root).collect::<Vec<_>>().join(":");
    FOLDERS.contains(&(section, key)).then(whole)
}

/// Returns the text of an INI file with the folders of [`folders`].
pub fn with_folders(ini: &Path, text: &str) -> String {
    let mut section = String::new();
    let line = |line: &str| {
        if let Some((name, _)) = line.trim().strip_prefix('[').and_then(|l| l.split_once(']')) {
            section = name.into();
        }
        let found = line.split_once('=').and_then(|(key, value)| {
            let folders = folders(ini, &section, key.trim(), value.trim())?;
            Some(format!("{} = {folders}", key.trim()))
        });
        found.unwrap_or_else(|| line.into()) + "\n"
    };
    text.lines().map(line).collect()
}

/// Resolves a file name in an INI file: relative to the INI file's folder, or `~/` in the user's home.
pub fn named(ini: &Path, name: &str) -> PathBuf {
    match (name.strip_prefix("~/"), env::var_os("HOME")) {
        (Some(rest), Some(home)) => PathBuf::from(home).join(rest),
        _ => ini.parent().unwrap_or(Path::new("")).join(name),
    }
}
