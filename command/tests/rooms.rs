// SPDX-License-Identifier: GPL-2.0-or-later
//! Which room of the workbench may use which, and that no file uses itself by way of others, read from the sources.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Every room, and those that it may use. Reading knows no proof, a proof no program, and nobody
/// knows who draws.
const ROOMS: [(&str, &[&str]); 20] = [
    ("dense", &[]),
    ("files", &[]),
    ("read", &["files"]),
    ("limits", &["read"]),
    ("rows", &["read"]),
    ("scene", &["read"]),
    ("panel", &["read"]),
    ("proof", &["limits", "read"]),
    ("check", &["files", "limits", "proof", "read", "rows"]),
    ("new", &["check", "files", "limits", "panel", "proof", "read"]),
    ("control", &["files", "read"]),
    ("program", &["check", "control", "files", "limits", "proof", "read"]),
    ("study", &["files", "limits", "proof", "read", "rows"]),
    ("curve", &["files", "limits", "program", "proof", "read", "study"]),
    ("dynamics", &["dense", "read", "rows", "study"]),
    ("stability", &["dense", "dynamics", "read", "study"]),
    ("cut", &["control", "dynamics", "files", "program", "read", "stability", "study"]),
    ("calibrate", &["files", "limits", "proof", "read"]),
    ("view", &["control", "files", "limits", "program", "read", "scene"]),
    ("draw", &["curve", "cut", "dynamics", "files", "program", "read", "stability", "study"]),
];

/// The files that list the rooms: each is a library of its own.
const LIBRARIES: [&str; 2] = ["lib", "machine"];

/// The room that is a library above all others, with a folder of its own.
const DRAW: &str = "draw";

/// The command, whose files are one room; a folder in it is a file above those in it.
const COMMAND: &str = "command";

/// A file, by its room and its name; files of the library's own folder are rooms without names.
type File = (String, String);

/// What each file of the library uses of the others.
fn uses() -> BTreeMap<File, BTreeSet<File>> {
    let workbench = Path::new(env!("CARGO_MANIFEST_DIR")).join("../workbench");
    let mut uses = BTreeMap::new();
    let drawing = folder(&workbench.join("draw/src")).into_iter();
    for file in drawing.filter(|file| !LIBRARIES.contains(&stem(file).as_str())) {
        uses.insert((DRAW.into(), stem(&file)), named(&file, DRAW));
    }
    for entry in folder(&workbench.join("src")) {
        let room = stem(&entry);
        if entry.is_dir() {
            for file in folder(&entry).into_iter().filter(|file| stem(file) != "mod") {
                let own = (room.clone(), stem(&file));
                uses.insert(own.clone(), named(&file, &own.0));
            }
        } else if entry.is_file() && !LIBRARIES.contains(&room.as_str()) {
            let own = (room, String::new());
            uses.insert(own.clone(), named(&entry, &own.0));
        }
    }
    uses
}

/// Returns what each file of the command uses of the others. What `main` and a `mod` give to all files below them is left out.
fn uses_of_command() -> BTreeMap<File, BTreeSet<File>> {
    let mut uses = BTreeMap::new();
    for entry in folder(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src")) {
        let own = (COMMAND.to_string(), stem(&entry));
        if own.1 == "main" {
            continue;
        }
        if !entry.is_dir() {
            uses.insert(own, named(&entry, COMMAND));
            continue;
        }
        let mut used = named(&entry.join("mod.rs"), COMMAND);
        for file in folder(&entry).into_iter().filter(|file| stem(file) != "mod") {
            used.insert((own.1.clone(), stem(&file)));
            uses.insert((own.1.clone(), stem(&file)), named(&file, &own.1));
        }
        uses.insert(own, used);
    }
    uses
}

fn folder(folder: &Path) -> Vec<PathBuf> {
    std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
}

fn stem(file: &Path) -> String {
    file.file_stem().unwrap().to_str().unwrap().into()
}

/// The files that a file names in its code; its tests may name what they like.
fn named(file: &Path, room: &str) -> BTreeSet<File> {
    let text = std::fs::read_to_string(file).unwrap();
    let code = text.split("#[cfg(test)]").next().unwrap();
    let lines = code.lines().filter(|line| !line.trim_start().starts_with("//"));
    let mut words: String = lines.collect::<Vec<_>>().join("\n");
    // As its files would name rooms from within the workbench.
    if room == DRAW {
        words = words.replace("crate::", "crate::draw::").replace("workbench::", "crate::");
    }
    words = words.replace("super::super::", "crate::command::");
    if room == COMMAND {
        words = words.replace("super::", "crate::command::");
    }
    assert!(!words.contains("crate::{"), "{}: one `use` a room", file.display());
    let part = |path: &str| -> String {
        path.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
    };
    let parts = |path: &str| -> Vec<String> {
        match path.strip_prefix('{').and_then(|list| list.split('}').next()) {
            Some(list) => list.split(',').map(|path| part(path.trim())).collect(),
            None => vec![part(path)],
        }
    };
    let mut used = BTreeSet::new();
    for path in words.split("crate::").skip(1) {
        let room = part(path);
        let names = path[room.len()..].strip_prefix("::").map_or(vec![String::new()], parts);
        used.extend(names.into_iter().map(|name| (room.clone(), name)));
    }
    for path in words.split("super::").skip(1) {
        used.extend(parts(path).into_iter().map(|name| (room.to_string(), name)));
    }
    used
}

#[test]
fn a_room_uses_only_those_below_it() {
    let uses = uses();
    let rooms: BTreeSet<&str> = uses.keys().map(|(room, _)| room.as_str()).collect();
    assert_eq!(rooms, ROOMS.iter().map(|(room, _)| *room).collect());
    for (room, below) in ROOMS {
        let own = uses.iter().filter(|((own, _), _)| own == room);
        let used: BTreeSet<&str> =
            own.flat_map(|(_, used)| used).map(|(r, _)| r.as_str()).collect();
        let others: BTreeSet<&str> = used.into_iter().filter(|other| *other != room).collect();
        assert_eq!(others, below.iter().copied().collect(), "{room} uses and may use");
    }
    // Rooms stand above all that they use: there is no circle.
    for (k, (room, below)) in ROOMS.iter().enumerate() {
        let lower = |other: &str| ROOMS[..k].iter().any(|(room, _)| *room == other);
        assert!(below.iter().all(|other| lower(other)), "{room} stands too low");
    }
}

#[test]
fn no_file_uses_itself_by_way_of_others() {
    let mut uses: BTreeMap<_, _> = uses().into_iter().chain(uses_of_command()).collect();
    // A file that uses none of those left is taken away, until none is left or all are in circles.
    while let Some(free) = {
        let is_left = |file: &File| uses.contains_key(file);
        uses.iter().find(|(_, used)| !used.iter().any(is_left)).map(|(file, _)| file.clone())
    } {
        uses.remove(&free);
    }
    assert!(uses.is_empty(), "in a circle, or above one: {:?}", uses.keys());
}
