// SPDX-License-Identifier: GPL-2.0-or-later
//! The programs that LinuxCNC starts with a machine, and the files and folders that its user interface opens.

use crate::wiring::at_key;
use machine::read::diagnostic::Severity;
use machine::read::ini::{Entry, Ini, IniError};
use machine::read::near;
use machine::read::places::{self, BIN, HALLIB, MODULES, PARAMETERS, SHARE};
use std::env;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// Names that LinuxCNC does not use as program names.
const NAMED: [&str; 4] = ["tkemc", "tklinuxcnc", "dummy", "emctask"];

/// Keys that name a program that LinuxCNC's start needs, whether the key is required, and its usual
/// values.
const PROGRAMS: [(&str, &str, bool, &[&str]); 4] = [
    (
        "DISPLAY",
        "DISPLAY",
        true,
        &["axis", "gmoccapy", "touchy", "gscreen", "qtvcp", "mdro", "linuxcncrsh", "tklinuxcnc"],
    ),
    ("TASK", "TASK", true, &["milltask"]),
    ("EMCIO", "EMCIO", false, &["io", "iov2"]),
    ("HAL", "HALUI", false, &["halui"]),
];

/// Programs that come with pkmkins, which may not be installed on a computer that checks a machine.
const OWN: [&str; 4] = ["pkm", "pkm-live", "pkmkins-panel", "pkmkins-vismach"];

/// Key that names the file of parameters.
const PARAMETER_FILE: [&str; 2] = ["RS274NGC", "PARAMETER_FILE"];

/// The user interface whose start is known to end at some values; for others this is unknown.
const AXIS: &str = "axis";

/// Returns whether the machine uses AXIS.
pub(super) fn is_axis(ini: &Ini) -> bool {
    named(ini, "DISPLAY", "DISPLAY").is_some_and(|(_, name)| name == AXIS)
}

/// Checks programs, modules, files and folders that the INI file names; without LinuxCNC on this computer, only files
/// and folders.
pub(super) fn check(ini: &Ini) -> Vec<(Severity, IniError)> {
    let mut found: Vec<_> = parameters(ini).into_iter().collect();
    found.extend(opened(ini).map(|error| (Severity::Warning, error)));
    if !is_installed() {
        let text = "LinuxCNC is not installed here, so programs to start and files of LinuxCNC are not judged";
        found.push((Severity::Warning, at_key(ini, "DISPLAY", "DISPLAY", text)));
        return found;
    }
    // LinuxCNC 2.10 has no such program: milltask does its work, and the key is not read.
    let is_read = |key: &str| key != "EMCIO" || is_program(ini, "io");
    let programs = PROGRAMS.iter().filter(|(_, key, ..)| is_read(key));
    let programs = programs.filter_map(|(section, key, is_needed, known)| {
        program(ini, section, key, *is_needed, known)
    });
    found.extend(
        programs
            .chain(modules(ini))
            .chain(buffers(ini))
            .chain(tools(ini))
            .map(|error| (Severity::Error, error)),
    );
    found.extend(beside(ini).map(|error| (Severity::Warning, error)));
    found
}

/// Reports a missing name of the file of parameters.
fn parameters(ini: &Ini) -> Option<(Severity, IniError)> {
    let [section, key] = PARAMETER_FILE;
    if file(ini, section, key).is_some() {
        return None;
    }
    let expected = "expected a file for this machine only, which LinuxCNC creates";
    // LinuxCNC ignores a key without a value.
    let is_given = ini.first(section, key).is_some_and(|entry| !entry.value.trim().is_empty());
    let ends = is_axis(ini) && !is_given;
    let (severity, text) = match ends {
        true => (Severity::Error, format!("AXIS fails to start, and LinuxCNC with it: {expected}")),
        false => (
            Severity::Warning,
            format!(
                "work offsets go to {PARAMETERS}, shared by every machine in this folder: {expected}"
            ),
        ),
    };
    Some((severity, at_key(ini, section, key, &text)))
}

fn program(
    ini: &Ini,
    section: &str,
    key: &str,
    is_needed: bool,
    known: &[&str],
) -> Option<IniError> {
    let Some((entry, name)) = named(ini, section, key) else {
        let text = format!("LinuxCNC fails to start: expected {}", known[0]);
        return is_needed.then(|| at_key(ini, section, key, &text));
    };
    let is_there = NAMED.contains(&name) || is_program(ini, name);
    (!is_there).then(|| absent(ini, entry, "there is no such program", name, known))
}

/// Reports missing real-time modules: motion controller, planner and homing.
fn modules(ini: &Ini) -> impl Iterator<Item = IniError> {
    let all = [
        ("EMCMOT", "EMCMOT", "motmod"),
        ("TRAJ", "TPMOD", "tpmod"),
        ("EMCMOT", "HOMEMOD", "homemod"),
    ];
    all.into_iter().filter_map(|(section, key, usual)| {
        let (entry, name) = named(ini, section, key)?;
        let is_there = Path::new(MODULES).join(format!("{name}.so")).is_file();
        (!is_there).then(|| absent(ini, entry, "LinuxCNC has no such module", name, &[usual]))
    })
}

/// Reports a missing file of the NML buffers by which LinuxCNC's programs communicate.
fn buffers(ini: &Ini) -> Option<IniError> {
    let (entry, file) = [("LINUXCNC", "NML_FILE"), ("EMC", "NML_FILE")]
        .into_iter()
        .find_map(|(section, key)| file(ini, section, key))?;
    (!file.is_file()).then(|| {
        let text = "there is no such file, so LinuxCNC fails to start: remove the key";
        ini.refuse(entry, text)
    })
}

/// Reports a missing program that replaces the tool table. LinuxCNC searches for it only in its current folder, which
/// is that of the INI file.
fn tools(ini: &Ini) -> Option<IniError> {
    let (entry, name) = named(ini, "EMCIO", "DB_PROGRAM")?;
    let name = if name.contains('/') { name.into() } else { format!("./{name}") };
    (!is_program(ini, &name)).then(|| {
        let text = "there is no such executable beside the INI file, so LinuxCNC starts without tools: \
                    name one, such as ./tools.py, or remove the key";
        ini.refuse(entry, text)
    })
}

fn absent(ini: &Ini, entry: &Entry, what: &str, name: &str, known: &[&str]) -> IniError {
    let meant = near::among(name, known.iter().copied()).unwrap_or(known[0]);
    ini.refuse(entry, &format!("{what}, so LinuxCNC fails to start: use, for example, {meant}"))
}

/// Returns whether LinuxCNC is on this computer.
pub(super) fn is_installed() -> bool {
    Path::new(HALLIB).is_dir()
}

/// Returns whether a name belongs to a file or folder that comes with LinuxCNC, which may not be on this computer.
fn comes_with_linuxcnc(ini: &Ini, name: &str) -> bool {
    !is_installed() && places::named(ini.file(), name).starts_with(SHARE)
}

/// Reports a missing program of the user interface, and missing folders.
fn opened(ini: &Ini) -> impl Iterator<Item = IniError> {
    let open = file(ini, "DISPLAY", "OPEN_FILE")
        .filter(|(entry, file)| !file.is_file() && !comes_with_linuxcnc(ini, entry.value.trim()));
    let open = open.map(|(entry, file)| {
        let path = file
            .parent()
            .zip(file.file_stem())
            .map(|(folder, stem)| folder.with_file_name("paths").join(stem).with_extension("toml"));
        let way_out = match path.filter(|path| path.is_file()) {
            Some(path) => format!(
                "run pkm path {} {} --output {} to write it",
                ini.file().display(),
                path.display(),
                file.display()
            ),
            None => "create it, or remove the key".into(),
        };
        let text = format!("there is no such file for the GUI to open: {way_out}");
        ini.refuse(entry, &text)
    });
    let folders = [
        ("DISPLAY", "PROGRAM_PREFIX"),
        ("RS274NGC", "SUBROUTINE_PATH"),
        ("RS274NGC", "USER_M_PATH"),
    ];
    let folders = folders.into_iter().filter_map(move |(section, key)| {
        let entry = ini.first(section, key)?;
        let is_absent = |name: &&str| {
            !places::named(ini.file(), name).is_dir() && !comes_with_linuxcnc(ini, name)
        };
        let name = entry.value.split(':').map(str::trim).find(is_absent)?;
        let text = format!("there is no folder {name}: create it, or remove the key");
        Some(ini.refuse(entry, &text))
    });
    let subroutines = subroutines(ini).chain(shown(ini));
    open.into_iter().chain(folders).chain(kept(ini)).chain(compensations(ini)).chain(subroutines)
}

/// Reports missing subroutines of remapped codes, and those that LinuxCNC calls when it stops a program.
fn subroutines(ini: &Ini) -> impl Iterator<Item = IniError> {
    let folders = [("DISPLAY", "PROGRAM_PREFIX"), ("RS274NGC", "SUBROUTINE_PATH")];
    let of = |(section, key)| {
        let names = ini.first(section, key).map_or("", |entry| entry.value.as_str());
        names.split(':').map(|name| places::named(ini.file(), name.trim()))
    };
    let folders: Vec<PathBuf> = folders.into_iter().flat_map(of).collect();
    let named = |entry: &Entry| -> Option<String> {
        match entry.key.as_str() {
            "REMAP" => {
                let word = entry.value.split_whitespace().find_map(|w| w.strip_prefix("ngc="))?;
                Some(word.trim_end_matches(".ngc").into())
            }
            "ON_ABORT_COMMAND" => {
                let (_, behind) = entry.value.split_once('<')?;
                Some(behind.split_once('>')?.0.into())
            }
            _ => None,
        }
    };
    ini.entries().filter(|entry| entry.section == "RS274NGC").filter_map(move |entry| {
        let file = format!("{}.ngc", named(entry)?);
        // LinuxCNC has some of its own, in its folders.
        let is_there = folders.iter().any(|folder| folder.join(&file).is_file());
        let is_elsewhere =
            !is_installed() && folders.iter().any(|folder| folder.starts_with(SHARE));
        (!is_there && !is_elsewhere).then(|| {
            let text = format!(
                "there is no {file} in [DISPLAY]PROGRAM_PREFIX or [RS274NGC]SUBROUTINE_PATH, where LinuxCNC looks: put it there"
            );
            ini.refuse(entry, &text)
        })
    })
}

/// Reports missing files of panels and commands of the user interface.
fn shown(ini: &Ini) -> impl Iterator<Item = IniError> {
    const ENDS: [&str; 5] = [".ui", ".glade", ".py", ".xml", ".hal"];
    const KEYS: [&str; 3] = ["GLADEVCP", "EMBED_TAB_COMMAND", "USER_COMMAND_FILE"];
    let of_files =
        |entry: &&Entry| entry.section == "DISPLAY" && KEYS.contains(&entry.key.as_str());
    ini.entries().filter(of_files).filter_map(|entry| {
        let is_absent = |word: &&str| {
            ENDS.iter().any(|end| word.ends_with(end))
                && !places::named(ini.file(), word).exists()
                && !comes_with_linuxcnc(ini, word)
        };
        let name = entry.value.split_whitespace().find(is_absent)?;
        Some(ini.refuse(entry, &format!("there is no file {name}: create it, or remove the key")))
    })
}

/// Reports missing folders of the files of parameters and joint positions, which LinuxCNC writes when it ends: the
/// files themselves may be missing.
fn kept(ini: &Ini) -> impl Iterator<Item = IniError> {
    [PARAMETER_FILE, ["TRAJ", "POSITION_FILE"]].into_iter().filter_map(|[section, key]| {
        let (entry, file) = file(ini, section, key)?;
        let folder =
            file.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.is_dir())?;
        Some(ini.refuse(entry, &format!("there is no folder {}: create it", folder.display())))
    })
}

/// Reports missing programs next to the user interface, which LinuxCNC's start does not need, and missing filters.
fn beside(ini: &Ini) -> impl Iterator<Item = IniError> {
    let apps = ini.entries().filter(|entry| entry.section == "APPLICATIONS" && entry.key == "APP");
    let filters =
        ini.entries().filter(|entry| entry.section == "FILTER" && entry.key != "PROGRAM_EXTENSION");
    apps.filter_map(|entry| app(ini, entry)).chain(filters.filter_map(|entry| filter(ini, entry)))
}

/// Checks a program that displays the machine, and its argument, the machine's file.
fn app(ini: &Ini, entry: &Entry) -> Option<IniError> {
    let mut words = entry.value.split_whitespace();
    let name = words.next()?;
    let is_own = OWN.contains(&name);
    if !is_own && !is_program(ini, name) && !is_program(ini, &format!("./{name}")) {
        let meant = near::among(name, OWN).unwrap_or("the name of a program");
        let text =
            format!("there is no such program, so LinuxCNC starts without it: expected {meant}");
        return Some(ini.refuse(entry, &text));
    }
    let of_machine = words.find(|word| is_own && word.ends_with(".ini"))?;
    (!places::named(ini.file(), of_machine).is_file()).then(|| {
        let text = format!("there is no file {of_machine}: name this machine's INI file");
        ini.refuse(entry, &text)
    })
}

fn filter(ini: &Ini, entry: &Entry) -> Option<IniError> {
    let name = entry.value.split_whitespace().next()?;
    (!OWN.contains(&name) && !is_program(ini, name)).then(|| {
        let meant = near::among(name, OWN).unwrap_or("the name of a program");
        let text = format!(
            "there is no such program, so the GUI opens no file that ends in .{}: expected {meant}",
            entry.key
        );
        ini.refuse(entry, &text)
    })
}

/// Reports missing tables of screw errors.
fn compensations(ini: &Ini) -> impl Iterator<Item = IniError> {
    let tables = ini.entries().filter(|entry| entry.section.starts_with("JOINT_"));
    tables
        .filter(|entry| {
            entry.key == "COMP_FILE" && !places::named(ini.file(), &entry.value).is_file()
        })
        .map(|entry| {
            ini.refuse(
                entry,
                "there is no such file: name the table of the screw's errors, or remove the key",
            )
        })
}

/// Returns the program that a key names, without its arguments.
fn named<'a>(ini: &'a Ini, section: &str, key: &str) -> Option<(&'a Entry, &'a str)> {
    let entry = ini.first(section, key)?;
    Some((entry, entry.value.split_whitespace().next()?))
}

/// Returns the file that a key names, including blanks; none without a name or with only quotes.
fn file<'a>(ini: &'a Ini, section: &str, key: &str) -> Option<(&'a Entry, PathBuf)> {
    let entry = ini.first(section, key)?;
    let name = entry.value.trim();
    (!name.trim_matches('"').is_empty()).then(|| (entry, places::named(ini.file(), name)))
}

pub(super) fn is_program(ini: &Ini, name: &str) -> bool {
    let is_run = |file: PathBuf| {
        file.metadata().is_ok_and(|it| it.is_file() && it.permissions().mode() & 0o111 != 0)
    };
    if name.contains('/') {
        return is_run(places::named(ini.file(), name));
    }
    let home = env::var_os("HOME").map(|home| PathBuf::from(home).join(".local/bin"));
    let path = env::var_os("PATH").unwrap_or_default();
    let folders = [BIN.into()].into_iter().chain(home).chain(env::split_paths(&path));
    folders.map(|folder| folder.join(name)).any(is_run)
}
