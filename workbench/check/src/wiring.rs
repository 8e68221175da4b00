// SPDX-License-Identifier: GPL-2.0-or-later
//! Missing protection in the files around a machine: homing, HAL files that exist and are in
//! order, the module's monitor, and the connection of its feed scale to motion.

use crate::cautions::words;
use machine::files;
use machine::read::diagnostic::Severity;
use machine::read::ini::{Entry, Ini, IniError};
use machine::read::places::{self, HALLIB};
use std::path::{Path, PathBuf};

/// Keys that name a file without which LinuxCNC, or AXIS, does not start.
const FILES: [(&str, &str); 4] =
    [("HAL", "HALFILE"), ("HAL", "POSTGUI_HALFILE"), ("HAL", "SHUTDOWN"), ("DISPLAY", "PYVCP")];

/// The motion controller, for finding the file that loads it.
const CONTROLLER: &str = "motmod";

/// The file that wires everything.
const OWN: &str = "pkmkins.tcl";

/// Returns everything that a user should check.
///
/// # Errors
/// A value that is not a number.
pub(crate) fn check(ini: &Ini) -> Result<Vec<(Severity, IniError)>, IniError> {
    let mut found: Vec<_> = absent(ini)
        .chain(too_early(ini))
        .chain(twice(ini))
        .map(|error| (Severity::Error, error))
        .collect();
    found.extend(cautions(ini)?.into_iter().map(|error| (Severity::Warning, error)));
    Ok(found)
}

/// Reports HAL files that LinuxCNC does not find, at which its start ends.
fn absent(ini: &Ini) -> impl Iterator<Item = IniError> {
    let entries = FILES.iter().flat_map(|(section, key)| ini.all(section, key));
    entries.filter_map(|entry| {
        let tried = places(ini, entry)?;
        let is_there = tried.iter().any(|file| file.is_file());
        // Without LinuxCNC on this computer its library is not here.
        let is_judged = !entry.value.starts_with("LIB:") || Path::new(HALLIB).is_dir();
        (!is_there && is_judged && !is_own(entry)).then(|| {
            let way_out = if is_panel(ini, entry) {
                format!("run pkm panel {} to write it", ini.file().display())
            } else {
                let tried: Vec<_> = tried.iter().map(|file| file.display().to_string()).collect();
                format!("expected {}", tried.join(" or "))
            };
            let text = format!("there is no such file, so LinuxCNC fails to start: {way_out}");
            ini.refuse(entry, &text)
        })
    })
}

/// Reports pkmkins.tcl before the file that loads module and motion controller: the pins that it sets do not exist yet.
fn too_early(ini: &Ini) -> Option<IniError> {
    if ini.first("HAL", "TWOPASS").is_some() {
        return None;
    }
    let files = ini.all("HAL", "HALFILE");
    let own = files.iter().position(|entry| is_own(entry))?;
    let loads = |entry: &&&Entry| {
        text(ini, entry)
            .is_some_and(|text| text.contains(CONTROLLER) || text.contains("KINEMATICS"))
    };
    let loading = files.iter().skip(own + 1).find(loads);
    if files[..own].iter().any(|entry| loads(&entry)) || (loading.is_none() && own > 0) {
        return None;
    }
    let after = loading
        .map_or("the file that loads the drives, the kinematics and motmod".into(), |entry| {
            format!("{}, which loads them", entry.value)
        });
    let text = format!(
        "it runs before the module and the motion controller are loaded, and sets pins that do not exist yet: \
         move it after {after}"
    );
    Some(ini.refuse(files[own], &text))
}

/// Reports files of pkmkins if LinuxCNC runs every file twice.
fn twice(ini: &Ini) -> Option<IniError> {
    let entry = ini.first("HAL", "TWOPASS").filter(|entry| !entry.value.is_empty())?;
    let files = ini.all("HAL", "HALFILE");
    let own = files.iter().find(|entry| {
        let name = entry.value.split_whitespace().next().unwrap_or_default();
        name.rsplit(['/', ':'])
            .next()
            .is_some_and(|name| name.starts_with("pkmkins") && name.ends_with(".tcl"))
    })?;
    let text = format!(
        "with this key LinuxCNC runs every HAL file twice and fails to start at the second run of {}: remove the \
         line",
        own.value
    );
    Some(ini.refuse(entry, &text))
}

/// Returns possible mistakes.
fn cautions(ini: &Ini) -> Result<Vec<IniError>, IniError> {
    let mut found = vec![];
    if ini.number_or("TRAJ", "NO_FORCE_HOMING", 0.0)? != 0.0 {
        let text = "programs may run before homing, from an unknown pose; remove the line";
        found.push(at_key(ini, "TRAJ", "NO_FORCE_HOMING", text));
    }
    found.extend(hal(ini));
    if let Some(entry) = ini.first("RS274NGC", "RS274NGC_STARTUP_CODE")
        && words(&entry.value).iter().any(|word| word == "M52")
    {
        let text = format!(
            "LinuxCNC {} loses M52 in the startup code: start every program with M52 P1",
            crate::linuxcnc()
        );
        found.push(ini.refuse(entry, &text));
    }
    Ok(found)
}

fn hal(ini: &Ini) -> Option<IniError> {
    let files = ini.all("HAL", "HALFILE");
    let texts: Vec<(&Entry, String)> =
        files.iter().map(|entry| (*entry, text(ini, entry).unwrap_or_default())).collect();
    let first = |what: &str| texts.iter().find(|(_, text)| text.contains(what));
    let adaptive = first("motion.adaptive-feed");
    let scale = first("pkmkins.feed-scale");
    if files.iter().any(|entry| is_own(entry)) {
        // pkmkins.tcl does not change a feed that is already in use.
        let (entry, _) = adaptive.filter(|_| scale.is_none())?;
        let text = "this file nets motion.adaptive-feed, so pkmkins.feed-scale has no effect: multiply \
                    both, or leave it to pkmkins.tcl";
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
            "expected a line HALFILE = LIB:pkmkins.tcl: it passes the geometry to the module and adds \
             its monitor, which reports errors",
        ));
    }
    if scale.is_none() || adaptive.is_none() {
        return Some(last(
            "no HAL file nets pkmkins.feed-scale to motion.adaptive-feed, so the guard cannot slow \
             the feed: add this net, or HALFILE = LIB:pkmkins.tcl",
        ));
    }
    None
}

fn is_own(entry: &Entry) -> bool {
    entry.value.split_whitespace().next().is_some_and(|name| name.ends_with(OWN))
}

/// Returns whether a file has the name that `pkm panel` would give it.
fn is_panel(ini: &Ini, entry: &Entry) -> bool {
    let stem = ini.file().file_stem().unwrap_or_default().to_string_lossy();
    ["xml", "tcl"].iter().any(|end| entry.value.trim() == format!("{stem}-panel.{end}"))
}

/// Returns the paths at which LinuxCNC searches for a file, in order; `None` without a name.
fn places(ini: &Ini, entry: &Entry) -> Option<Vec<PathBuf>> {
    let name = entry.value.split_whitespace().next()?;
    if let Some(name) = name.strip_prefix("LIB:") {
        return Some(vec![Path::new(HALLIB).join(name)]);
    }
    let file = places::named(ini.file(), name);
    let is_whole = name.starts_with("~/") || Path::new(name).is_absolute();
    Some(if is_whole { vec![file] } else { vec![file, Path::new(HALLIB).join(name)] })
}

/// Returns a HAL file without its comments; none for pkmkins.tcl, or for one of Debian's that is not installed.
fn text(ini: &Ini, entry: &Entry) -> Option<String> {
    if is_own(entry) {
        return None;
    }
    let bytes = places(ini, entry)?.iter().find_map(|file| files::read(file).ok())?;
    let text = String::from_utf8_lossy(&bytes);
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default());
    Some(lines.collect::<Vec<_>>().join("\n"))
}

/// Returns the error at a key, or its absence.
pub fn at_key(ini: &Ini, section: &str, key: &str, text: &str) -> IniError {
    match ini.first(section, key) {
        Some(entry) => ini.refuse(entry, text),
        None => ini.error(section, key, None, text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reported(hal: &[(&str, &str)], more: &str) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        let mut ini = String::from("[HAL]\n");
        for (name, text) in hal {
            std::fs::write(folder.path().join(name), text).unwrap();
            ini += &format!("HALFILE = {name}\n");
        }
        let ini = Ini::parse(&folder.path().join("m.ini"), &(ini + more)).unwrap();
        check(&ini).unwrap().iter().map(|(_, error)| error.0.message()).collect()
    }

    #[test]
    fn missing_files_and_files_too_early_are_reported() {
        let load = "loadrt [KINS]KINEMATICS\nloadrt motmod servo_period_nsec=1000000\n";
        let all =
            reported(&[("drives.hal", load), ("pkmkins.tcl", "")], "POSTGUI_HALFILE = panel.hal\n");
        assert!(all.len() == 1 && all[0].contains("panel.hal: there is no such file"), "{all:?}");
        let all =
            reported(&[("drives.hal", load), ("pkmkins.tcl", "")], "POSTGUI_HALFILE = m-panel.tcl");
        assert!(all.len() == 1 && all[0].contains("m.ini to write it"), "{all:?}");
        let all = reported(&[("pkmkins.tcl", ""), ("drives.hal", load)], "");
        assert!(all.len() == 1 && all[0].contains("move it after drives.hal"), "{all:?}");
        let all = reported(&[("pkmkins.tcl", ""), ("drives.hal", load)], "TWOPASS = on\n");
        assert!(all.len() == 1 && all[0].contains("twice"), "{all:?}");
        // Files sourced by another file are not read.
        assert_eq!(reported(&[("own.tcl", "source drives.tcl"), ("pkmkins.tcl", "")], ""), [""; 0]);
    }

    #[test]
    fn hal_files_are_read_for_the_monitor_and_its_feed_scale() {
        let monitor = "addf pkmkins.monitor servo-thread\n";
        let feed = "net slow pkmkins.feed-scale => motion.adaptive-feed\n";
        let load = "loadrt motmod\n";
        assert_eq!(reported(&[("drives.hal", load), ("pkmkins.tcl", "")], ""), [""; 0]);
        assert_eq!(reported(&[("own.hal", &format!("{monitor}{feed}"))], ""), [""; 0]);
        let all = reported(&[("own.hal", &format!("# {monitor}{feed}"))], "");
        assert!(all.len() == 1 && all[0].contains("LIB:pkmkins.tcl"), "{all:?}");
        let all = reported(&[("own.hal", &format!("{monitor}#{feed}"))], "");
        assert!(all.len() == 1 && all[0].contains("cannot slow"), "{all:?}");
        let other = "net plasma plasmac.feed motion.adaptive-feed\n";
        let all = reported(
            &[("own.hal", other), ("drives.hal", "loadrt motmod"), ("pkmkins.tcl", "")],
            "",
        );
        assert!(all.len() == 1 && all[0].contains("= own.hal: this file nets"), "{all:?}");
    }

    #[test]
    fn m52_in_the_startup_code_is_reported() {
        let hal = [("drives.hal", "loadrt motmod"), ("pkmkins.tcl", "")];
        let all = reported(&hal, "[RS274NGC]\nRS274NGC_STARTUP_CODE = G21 G64 P0.1 m52 p1\n");
        assert!(all.len() == 1 && all[0].contains("every program"), "{all:?}");
    }
}
