// SPDX-License-Identifier: GPL-2.0-or-later
//! What the files around a machine leave out that keeps it from harm: homing, the module's
//! monitor, and the way of its feed scale into motion.

use crate::check::cautions::words;
use crate::read::ini::{Entry, Ini, IniError};
use std::fs;
use std::path::{Path, PathBuf};

/// Where LinuxCNC looks for `LIB:` files, as Debian's package has it.
const HALLIB: &str = "/usr/share/linuxcnc/hallib";

/// The file that wires everything.
const OWN: &str = "pkmkins.tcl";

/// Everything that a user should look at.
///
/// # Errors
/// A value that is no number.
pub(crate) fn check(ini: &Ini) -> Result<Vec<IniError>, IniError> {
    let mut found = vec![];
    if ini.number_or("TRAJ", "NO_FORCE_HOMING", 0.0)? != 0.0 {
        let text =
            "programs may run before homing, from a pose that nobody knows; take the line out";
        found.push(at_key(ini, "TRAJ", "NO_FORCE_HOMING", text));
    }
    found.extend(hal(ini));
    if let Some(entry) = ini.first("RS274NGC", "RS274NGC_STARTUP_CODE")
        && words(&entry.value).iter().any(|word| word == "M52")
    {
        let text = "LinuxCNC 2.9 loses M52 in the startup code: begin every program with M52 P1";
        found.push(ini.refuse(entry, text));
    }
    Ok(found)
}

/// Of the HAL files.
fn hal(ini: &Ini) -> Option<IniError> {
    let files = ini.all("HAL", "HALFILE");
    let texts: Vec<(&Entry, String)> =
        files.iter().map(|entry| (*entry, text(ini, entry).unwrap_or_default())).collect();
    let first = |what: &str| texts.iter().find(|(_, text)| text.contains(what));
    let adaptive = first("motion.adaptive-feed");
    let scale = first("pkmkins.feed-scale");
    if files.iter().any(|entry| is_own(entry)) {
        // pkmkins.tcl leaves a feed that is taken alone.
        let (entry, _) = adaptive.filter(|_| scale.is_none())?;
        let text = "this file takes motion.adaptive-feed, on which pkmkins.feed-scale then does not \
                    act: multiply both, or leave it to pkmkins.tcl";
        return Some(ini.refuse(entry, text));
    }
    let last = |text: &str| match files.last() {
        Some(entry) => ini.refuse(entry, text),
        None => ini.error("HAL", "HALFILE", None, text),
    };
    let monitored = |text: &str| {
        text.lines().any(|line| line.contains("addf") && line.contains("pkmkins.monitor"))
    };
    if !texts.iter().any(|(_, text)| monitored(text)) {
        return Some(last(
            "expected a line HALFILE = LIB:pkmkins.tcl: it gives the geometry to the module and adds \
             its monitor, which tells what is wrong",
        ));
    }
    if scale.is_none() || adaptive.is_none() {
        return Some(last(
            "no HAL file nets pkmkins.feed-scale to motion.adaptive-feed, so that the guard cannot \
             slow the feed down",
        ));
    }
    None
}

fn is_own(entry: &Entry) -> bool {
    entry.value.split_whitespace().next().is_some_and(|name| name.ends_with(OWN))
}

/// A HAL file without its comments, and without those of Debian's that are not installed.
fn text(ini: &Ini, entry: &Entry) -> Option<String> {
    let name = entry.value.split_whitespace().next()?;
    if is_own(entry) {
        return None;
    }
    let folder = ini.file().parent().unwrap_or(Path::new(""));
    let file: PathBuf = match name.strip_prefix("LIB:") {
        Some(name) => Path::new(HALLIB).join(name),
        None => folder.join(name),
    };
    let bytes = fs::read(file).ok()?;
    let text = String::from_utf8_lossy(&bytes);
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default());
    Some(lines.collect::<Vec<_>>().join("\n"))
}

/// The error at a key, or that it is missing.
pub(crate) fn at_key(ini: &Ini, section: &str, key: &str, text: &str) -> IniError {
    match ini.first(section, key) {
        Some(entry) => ini.refuse(entry, text),
        None => ini.error(section, key, None, text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(hal: &[(&str, &str)], more: &str) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        let mut ini = String::from("[HAL]\n");
        for (name, text) in hal {
            fs::write(folder.path().join(name), text).unwrap();
            ini += &format!("HALFILE = {name}\n");
        }
        let ini = Ini::parse(&folder.path().join("m.ini"), &(ini + more)).unwrap();
        check(&ini).unwrap().iter().map(|error| error.0.message()).collect()
    }

    #[test]
    fn hal_files_are_read_for_the_monitor_and_its_feed_scale() {
        let monitor = "addf pkmkins.monitor servo-thread\n";
        let feed = "net slow pkmkins.feed-scale => motion.adaptive-feed\n";
        assert_eq!(told(&[("pkmkins.tcl", "")], ""), [""; 0]);
        assert_eq!(told(&[("own.hal", &format!("{monitor}{feed}"))], ""), [""; 0]);
        let all = told(&[("own.hal", &format!("# {monitor}{feed}"))], "");
        assert!(all.len() == 1 && all[0].contains("LIB:pkmkins.tcl"), "{all:?}");
        let all = told(&[("own.hal", &format!("{monitor}#{feed}"))], "");
        assert!(all.len() == 1 && all[0].contains("cannot slow"), "{all:?}");
        let other = "net plasma plasmac.feed motion.adaptive-feed\n";
        let all = told(&[("own.hal", other), ("pkmkins.tcl", "")], "");
        assert!(all.len() == 1 && all[0].contains("= own.hal: this file takes"), "{all:?}");
    }

    #[test]
    fn m52_in_the_startup_code_is_told() {
        let hal = [("pkmkins.tcl", "")];
        let all = told(&hal, "[RS274NGC]\nRS274NGC_STARTUP_CODE = G21 G64 P0.1 m52 p1\n");
        assert!(all.len() == 1 && all[0].contains("every program"), "{all:?}");
    }
}
