// SPDX-License-Identifier: GPL-2.0-or-later
//! Public names: no released name vanishes unnoticed.
//!
//! `docs/reference/names.txt` has a line for each: its first version, its kind, and the name with its other fixed
//! properties. `cargo xtask names` writes it. A line whose version is in CHANGELOG.md is released.

use abi_tests::module::Module;
use keys::{Key, chain, constraint, joint, leg, machine, second, workspace_box};
use kinematics::CAUSES;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// The file, and the environment variable by which `cargo xtask names` requests writing it.
const FILE: &str = "docs/reference/names.txt";
const WRITE: &str = "PKMKINS_WRITE_NAMES";

/// Machines that together have all pins.
const MACHINES: &[&[(&str, &str)]] = &[
    &[],
    &[
        ("legs", "strut:3,slider:2,crank:2,ring:1"),
        ("coordinates", "ABC"),
        ("table", "XYZ"),
        ("boxes", "1"),
    ],
    &[("legs", "slider:4"), ("coordinates", "XYZB"), ("axes", "CW")],
    &[
        ("legs", "slider:4"),
        ("coordinates", "XYZB"),
        ("second", "slider:4"),
        ("second_coordinates", "XYZB"),
        ("second_angles", "A"),
        ("boxes", "1"),
        ("second_boxes", "1"),
    ],
    &[("legs", "strut:3"), ("coordinates", "XYZ"), ("constraints", "3")],
    &[("legs", "slider:3"), ("coordinates", "ZAB"), ("table", "XY"), ("constraints", "3")],
];

fn text(file: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../..");
    fs::read_to_string(root.join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// Returns a pin with N for the number of a leg, a joint, a box.
fn pin(name: &str) -> String {
    let words = name.split('.').map(|word| if word.parse::<u8>().is_ok() { "N" } else { word });
    words.collect::<Vec<_>>().join(".")
}

fn pins() -> impl Iterator<Item = String> {
    let of = |parameters: &&[(&str, &str)]| Module::pkmkins(parameters).pins();
    let text = |name: &str, kind: String| format!("pin {} {}", pin(name), kind.to_lowercase());
    MACHINES
        .iter()
        .flat_map(of)
        .map(move |found| text(&found.name, format!("{:?} {:?}", found.kind, found.dir)))
}

/// Returns the module's load parameters, as in the manual's synopsis.
fn parameters() -> Vec<String> {
    let manual = text("docs/reference/pkmkins.9");
    let synopsis = manual.split(".PP").next().unwrap();
    let words = synopsis.split(|c: char| !(c.is_ascii_lowercase() || c == '_' || c == '='));
    words.filter_map(|word| Some(format!("parameter {}", word.strip_suffix('=')?))).collect()
}

fn keys() -> impl Iterator<Item = String> {
    let sections: [(&str, &[&Key]); 7] = [
        ("PKM", machine::ALL),
        ("SECOND", second::ALL),
        ("LEG_N", leg::ALL),
        ("CONSTRAINT_N", constraint::ALL),
        ("CHAIN_L", chain::ALL),
        ("JOINT_N", joint::ALL),
        ("BOX_K", workspace_box::ALL),
    ];
    sections.into_iter().flat_map(|(section, all)| {
        all.iter().map(move |key| format!("key [{section}]{}", key.name))
    })
}

fn codes() -> impl Iterator<Item = String> {
    CAUSES.iter().map(|cause| format!("code {} {}", cause.code(), cause.name()))
}

/// Returns functions and types of the C header.
fn header() -> Vec<String> {
    let header = text("include/pkmkins.h");
    let lines = header.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_alphabetic()));
    let word = |line: &str| {
        let name = match line.strip_prefix("struct ").or_else(|| line.strip_prefix("enum ")) {
            Some(rest) => rest.split([' ', '{']).next()?,
            None => line.split_once('(')?.0.rsplit([' ', '*']).next()?,
        };
        Some(format!("c {name}"))
    };
    lines.filter_map(word).collect()
}

/// Returns the JSON fields of every subcommand, from the page that a test compares with the command.
fn fields() -> Vec<String> {
    let (page, mut command, mut found) =
        (text("docs/reference/json.md"), String::new(), Vec::new());
    for line in page.lines() {
        if let Some(heading) = line.strip_prefix("## ") {
            command = heading.replace(' ', "-").to_lowercase();
        }
        let Some(cell) = line.strip_prefix("| `") else { continue };
        let cell = cell.split(" | ").next().unwrap();
        found.extend(cell.split('`').step_by(2).map(|field| format!("json {command} {field}")));
    }
    found.retain(|name| !name.ends_with(' '));
    found
}

fn now() -> BTreeSet<String> {
    let lists = [parameters(), header(), fields()];
    lists.into_iter().flatten().chain(pins()).chain(keys()).chain(codes()).collect()
}

/// Returns every name of the file, with its version.
fn recorded() -> BTreeMap<String, String> {
    let lines = text(FILE);
    let line = |line: &str| {
        let (version, name) = line.split_once(' ').expect("a version and a name");
        (name.to_owned(), version.to_owned())
    };
    lines.lines().filter(|line| !line.starts_with('#')).map(line).collect()
}

#[test]
fn no_released_name_vanishes_and_every_name_is_recorded() {
    let (now, recorded, changelog) = (now(), recorded(), text("CHANGELOG.md"));
    let released = |version: &str| changelog.contains(&format!("\n## [{version}]"));
    let gone: Vec<String> = recorded
        .iter()
        .filter(|(name, version)| !now.contains(*name) && released(version))
        .map(|(name, version)| format!("{name} (since {version})"))
        .collect();
    assert!(
        gone.is_empty(),
        "released names are gone: bring them back, or, for a new major version, take their lines out of \
         {FILE} and name them in docs/reference/promises.md:\n{}",
        gone.join("\n")
    );
    if std::env::var_os(WRITE).is_some() {
        let kept = recorded.into_iter().filter(|(_, version)| released(version)).collect();
        let version = env!("CARGO_PKG_VERSION");
        return write(&now, &kept, if released(version) { "next" } else { version });
    }
    let listed: BTreeSet<String> = recorded.into_keys().collect();
    let differences: Vec<_> = now.symmetric_difference(&listed).collect();
    assert!(differences.is_empty(), "cargo xtask names writes {FILE} again: {differences:#?}");
}

/// Writes the list. A new name gets the version of the crates, or `next` if that is already released:
/// `cargo xtask names` must run again when the version is raised.
fn write(now: &BTreeSet<String>, released: &BTreeMap<String, String>, coming: &str) {
    let mut file = String::from(
        "# Names that people depend on, each with the version that brought it. `cargo xtask names` writes this file.\n",
    );
    for name in now {
        let version = released.get(name).map_or(coming, String::as_str);
        file += &format!("{version} {name}\n");
    }
    let place = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../..").join(FILE);
    fs::write(place, file).expect("the file of names");
}
