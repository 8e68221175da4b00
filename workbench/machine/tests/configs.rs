// SPDX-License-Identifier: GPL-2.0-or-later
//! Consistency of every shipped configuration.

use kinematics::Cones;
use test_support::shipped::{CONSTRAINED, MACHINES, configs, folder, whole};

/// Tolerance between [JOINT_N]HOME and inverse([TRAJ]HOME): the printed digits of the INI file, in
/// mm, inches or degrees.
const HOME_TOLERANCE: f64 = 1e-9;

/// Largest cone angle at home: every shipped machine is at the center of its cones there.
const HOME_CONE_DEG: f64 = 1e-6;

#[test]
fn all_machines_are_tested() {
    let found = std::fs::read_dir(configs()).unwrap().map(|entry| entry.unwrap().file_name());
    let mut found: Vec<_> = found.map(|name| name.into_string().unwrap()).collect();
    found.sort();
    let mut known: Vec<_> = MACHINES.into_iter().chain(CONSTRAINED).collect();
    known.sort_unstable();
    assert_eq!(found, known);
    for name in known {
        let layout = *whole(name).first().machine.layout();
        assert_eq!(layout.constraints() > 0, CONSTRAINED.contains(&name), "{name}");
    }
}

#[test]
fn joint_home_is_inverse_of_the_machine_home() {
    let mut wrong = vec![];
    for name in MACHINES.into_iter().chain(CONSTRAINED) {
        for config in whole(name).mechanisms {
            let joints = config.machine.inverse(&config.home_pose(), &config.spindle).unwrap();
            for (i, (joint, limits)) in joints.iter().zip(&config.joints).enumerate() {
                let off = (joint - limits.home).abs();
                if !(off <= HOME_TOLERANCE) {
                    let number = config.place.first_joint + i;
                    wrong.push(format!("{}: [JOINT_{number}]HOME = {joint}", name));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "expected\n{}", wrong.join("\n"));
}

#[test]
fn home_is_inside_the_limits_and_the_middle_of_the_cones() {
    for name in MACHINES.into_iter().chain(CONSTRAINED) {
        for config in whole(name).mechanisms {
            for (i, joint) in config.joints.iter().enumerate() {
                assert!((joint.min..=joint.max).contains(&joint.home), "{}: joint {i}", name);
            }
            for (axis, home) in config.axes.iter().zip(config.home) {
                assert!((axis.min..=axis.max).contains(&home), "{}: {home}", name);
            }
            let Cones { base, platform } =
                config.machine.at(&config.home_pose(), &config.spindle).unwrap().cones();
            for i in 0..config.legs() {
                assert!(base[i].max(platform[i]) < HOME_CONE_DEG, "{}: leg {i}", name);
                assert!(config.angles[i].cones[0].is_some(), "{}: [LEG_{i}]BASE_CONE", name);
            }
        }
    }
}

#[test]
fn every_machine_has_programs_and_names_them_in_the_readme() {
    for name in MACHINES {
        let folder = folder(name);
        let readme = std::fs::read_to_string(folder.join("README.md"))
            .unwrap_or_else(|error| panic!("{name}/README.md: {error}"));
        let mut programs = std::fs::read_dir(folder.join("programs")).unwrap().peekable();
        assert!(programs.peek().is_some(), "{}: no program", name);
        for program in programs {
            let program = program.unwrap().file_name().into_string().unwrap();
            assert!(readme.contains(&program), "{}/README.md: {program}", name);
        }
    }
}
