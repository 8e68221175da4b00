// SPDX-License-Identifier: GPL-2.0-or-later
//! The shipped configurations.

use machine::proof::axis_box::AxisBox;
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use machine::read::mechanism::Mechanism;
use rand::Rng;
use rand_pcg::Pcg64;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

pub const MACHINES: [&str; 18] = [
    "four-rod-lathe",
    "hexaglide",
    "hexapod",
    "hexapod-rotary-table",
    "lab-hexapod",
    "lathe-counter-spindle",
    "lathe-mirrored",
    "lathe-two-turrets",
    "lathe-work-on-platform",
    "linapod",
    "linear-delta",
    "pentapod",
    "pyramid",
    "pyramid-cross",
    "rotary-delta",
    "six-rod-lathe",
    "triaglide",
    "tripod",
];

/// Those with constraints of the platform.
pub const CONSTRAINED: [&str; 3] = ["exechon", "tricept", "z3-head"];

/// Returns those whose own pose is that of programs: no axis carries workpiece, tool or legs.
pub fn unchained() -> Vec<&'static str> {
    MACHINES.into_iter().filter(|machine| config(machine).chain.is_empty()).collect()
}

/// Returns `usual` cases, times PKMKINS_CASES if it is set.
pub fn cases(usual: usize) -> usize {
    let factor = std::env::var("PKMKINS_CASES").map_or(1.0, |text| text.parse().unwrap());
    (usual as f64 * factor).ceil() as usize
}

/// Returns the folder of the sources.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Returns the folder `configs`. Panics if a generated file in it is missing.
pub fn configs() -> &'static Path {
    static CONFIGS: LazyLock<PathBuf> = LazyLock::new(|| {
        let sums = std::fs::read_to_string(root().join("tests/cases/generated.sha256")).unwrap();
        for name in sums.lines().filter_map(|line| line.split_whitespace().nth(1)) {
            assert!(root().join(name).exists(), "{name} is missing: `make generated` writes it");
        }
        root().join("configs")
    });
    &CONFIGS
}

pub fn folder(machine: &str) -> PathBuf {
    configs().join(machine)
}

/// Copies the programs of a machine beside a copy of its files.
pub fn with_programs(machine: &str, copy: &Path) {
    let programs = folder(machine).join("programs").canonicalize().unwrap();
    std::os::unix::fs::symlink(programs, copy.join("programs")).unwrap();
}

/// Returns the cases of a file in tests/cases, which has them as `[[case]]`.
pub fn cases_of<T: serde::de::DeserializeOwned>(file: &str) -> Vec<T> {
    let file = root().join("tests/cases").join(file);
    let mut all: BTreeMap<String, Vec<T>> =
        toml::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
    all.remove("case").unwrap()
}

/// Returns a copy of a machine's files, with its programs beside them.
pub fn copied(machine: &str) -> tempfile::TempDir {
    let copy = tempfile::tempdir().unwrap();
    let files = std::fs::read_dir(folder(machine)).unwrap().map(|entry| entry.unwrap().path());
    for file in files.filter(|path| path.is_file()) {
        std::fs::copy(&file, copy.path().join(file.file_name().unwrap())).unwrap();
    }
    with_programs(machine, copy.path());
    copy
}

pub fn ini(machine: &str) -> PathBuf {
    folder(machine).join(format!("{machine}.ini"))
}

/// Returns a machine with all its mechanisms.
pub fn whole(machine: &str) -> MachineConfig {
    read(&ini(machine))
}

/// Returns the machine of a file, constraints included.
fn read(file: &Path) -> MachineConfig {
    MachineConfig::leniently(&Ini::read(file).unwrap(), Some(Lenient::Constraints)).unwrap()
}

/// Returns the first mechanism of a machine.
pub fn config(machine: &str) -> Mechanism {
    first_of(&ini(machine))
}

/// Returns the first mechanism of a file.
pub fn first_of(file: &Path) -> Mechanism {
    read(file).mechanism(1).unwrap()
}

/// Returns the machine of a text.
pub fn machine_of(file: &Path, text: &str) -> MachineConfig {
    MachineConfig::from_ini(&Ini::parse(file, text).unwrap()).unwrap()
}

/// Samples a pose from a box. Every third value is at an end, where bounds are tightest.
pub fn drawn(rng: &mut Pcg64, part: &AxisBox) -> [f64; 6] {
    part.at(std::array::from_fn(|_| match rng.random_range(0..3) {
        0 => f64::from(rng.random_range(0..2_u8)),
        _ => rng.random(),
    }))
}
