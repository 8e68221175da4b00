// SPDX-License-Identifier: GPL-2.0-or-later
//! Where LinuxCNC is on this computer, as Debian's packages have it, and where it looks for files.

use std::env;
use std::path::{Path, PathBuf};

/// HAL files that every machine may use: `LIB:` in an INI file.
pub const HALLIB: &str = "/usr/share/linuxcnc/hallib";
/// Modules of the real-time part.
pub const MODULES: &str = "/usr/lib/linuxcnc/modules";
/// Programs.
pub const BIN: &str = "/usr/bin";
/// Parameters of programs, work offsets among them, where an INI file names no file: beside it.
pub const PARAMETERS: &str = "rs274ngc.var";

/// The file that a name in an INI file means: LinuxCNC runs in the folder of this, and `~/` is the user's.
pub fn named(ini: &Path, name: &str) -> PathBuf {
    match (name.strip_prefix("~/"), env::var_os("HOME")) {
        (Some(rest), Some(home)) => PathBuf::from(home).join(rest),
        _ => ini.parent().unwrap_or(Path::new("")).join(name),
    }
}
