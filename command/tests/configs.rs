// SPDX-License-Identifier: GPL-2.0-or-later
//! Every shipped configuration agrees with itself.

use kinematics::Cones;
use std::path::{Path, PathBuf};
use workbench::read::machine::MachineConfig;

/// Agreement of [JOINT_N]HOME with inverse([TRAJ]HOME): the printed digits of the INI file, in
/// mm, inches or degrees.
const HOME_TOLERANCE: f64 = 1e-9;

/// Every machine is meant to stand clear of its cone limits at home.
const HOME_CONE_DEG: f64 = 1e-6;

fn folders() -> Vec<PathBuf> {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    let mut folders: Vec<PathBuf> =
        std::fs::read_dir(configs).unwrap().map(|entry| entry.unwrap().path()).collect();
    folders.retain(|path| path.is_dir());
    folders.sort();
    assert!(folders.len() >= 8, "{folders:?}");
    folders
}

fn name(folder: &Path) -> &str {
    folder.file_name().unwrap().to_str().unwrap()
}

fn config(folder: &Path) -> MachineConfig {
    MachineConfig::read(&folder.join(format!("{}.ini", name(folder)))).unwrap()
}

#[test]
fn joint_home_is_inverse_of_the_machine_home() {
    let mut wrong = vec![];
    for folder in folders() {
        for config in config(&folder).mechanisms() {
            let joints = config.machine.inverse(&config.home_pose(), &config.spindle).unwrap();
            for (i, (joint, limits)) in joints.iter().zip(&config.joints).enumerate() {
                let off = (joint - limits.home).abs();
                if !(off <= HOME_TOLERANCE) {
                    let number = config.place.first_joint + i;
                    wrong.push(format!("{}: [JOINT_{number}]HOME = {joint}", name(&folder)));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "expected\n{}", wrong.join("\n"));
}

#[test]
fn home_is_inside_the_limits_and_the_middle_of_the_cones() {
    for folder in folders() {
        for config in config(&folder).mechanisms() {
            for (i, joint) in config.joints.iter().enumerate() {
                assert!(
                    (joint.min..=joint.max).contains(&joint.home),
                    "{}: joint {i}",
                    name(&folder)
                );
            }
            for (axis, home) in config.axes.iter().zip(config.home) {
                assert!((axis.min..=axis.max).contains(&home), "{}: {home}", name(&folder));
            }
            let Cones { base, platform } =
                config.machine.at(&config.home_pose(), &config.spindle).unwrap().cones();
            for i in 0..config.legs() {
                assert!(base[i].max(platform[i]) < HOME_CONE_DEG, "{}: leg {i}", name(&folder));
                assert!(config.base_cone[i].is_some(), "{}: [LEG_{i}]BASE_CONE", name(&folder));
            }
        }
    }
}

#[test]
fn every_machine_has_programs_and_names_them_in_the_readme() {
    for folder in folders() {
        let readme = std::fs::read_to_string(folder.join("README.md"))
            .unwrap_or_else(|error| panic!("{}/README.md: {error}", name(&folder)));
        let mut programs = std::fs::read_dir(folder.join("programs")).unwrap().peekable();
        assert!(programs.peek().is_some(), "{}: no program", name(&folder));
        for program in programs {
            let program = program.unwrap().file_name().into_string().unwrap();
            assert!(readme.contains(&program), "{}/README.md: {program}", name(&folder));
        }
    }
}
