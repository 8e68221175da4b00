// SPDX-License-Identifier: GPL-2.0-or-later
//! The files of the core form floors: each uses only those on floors below its own.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Files and folders, lowest floor first; those of one floor do not know each other.
const FLOORS: [&[&str]; 13] = [
    &["corner", "lanes", "letters", "load_error", "segment", "text"],
    &["fault", "placed", "pseudo_inverse", "singular", "trig"],
    &["layout", "leg", "pose"],
    &["extra", "geometry", "nut", "rings", "second"],
    &["chain", "mechanism", "watch"],
    &["target"],
    &["certificate", "inverse", "spheres"],
    &["forward", "freeze", "legs_at"],
    &["jacobian"],
    &["at"],
    &["between", "limits", "machine"],
    &["ahead", "boxes", "side"],
    &["lib", "load"],
];

/// Names of the crate's own modules that a file uses outside its tests; those of its own folder
/// aside.
fn used(text: &str) -> Vec<String> {
    let own = text.split("#[cfg(test)]").next().unwrap_or_default();
    own.lines()
        .filter_map(|line| line.trim_start().strip_prefix("use crate::"))
        .map(|rest| rest.split([':', ';', '{']).next().unwrap_or_default().to_string())
        .collect()
}

/// Every file below `src`, with the module at the top that it belongs to.
fn files() -> Vec<(String, String)> {
    let mut files = vec![];
    let mut folders = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("src")];
    let top = folders[0].clone();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder of sources") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let inside = path.strip_prefix(&top).expect("below src").with_extension("");
            let module = inside.iter().next().expect("a name").to_string_lossy().into_owned();
            files.push((module, fs::read_to_string(path).expect("a source file")));
        }
    }
    files
}

#[test]
fn every_file_uses_only_files_below_its_own_floor() {
    let floors: BTreeMap<&str, usize> = FLOORS
        .iter()
        .enumerate()
        .flat_map(|(floor, names)| names.iter().map(move |name| (*name, floor)))
        .collect();
    let files = files();
    assert!(files.len() > 25, "only {} files found", files.len());
    for (module, text) in &files {
        let own = floors.get(module.as_str()).unwrap_or_else(|| panic!("{module} has no floor"));
        for other in used(text).iter().filter(|other| *other != module) {
            let below = floors.get(other.as_str());
            let below = below.unwrap_or_else(|| panic!("{module} uses crate::{other}"));
            assert!(below < own, "{module} uses {other}, which is not below it");
        }
    }
}

#[test]
fn what_a_file_uses_is_read_up_to_its_tests_and_in_either_form() {
    let text = "use crate::at::{self, At};\nuse libm::sqrt;\n    use crate::leg::Leg;\n\
                #[cfg(test)]\nmod tests {\n    use crate::machine::Machine;\n}\n";
    assert_eq!(used(text), ["at", "leg"]);
}
