// SPDX-License-Identifier: GPL-2.0-or-later
//! Random programs: read by LinuxCNC's interpreter and replayed, they stay within all limits.

use kinematics::{MAX_EXTRA, Pose, Vector3};
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use program::motion;
use program::random_program::random_program;
use program::replay::replay;
use test_support::shipped::{MACHINES, config, root, whole};

#[test]
fn a_random_program_stays_within_the_limits_of_its_machine() {
    let folder = tempfile::tempdir().unwrap();
    for whole in MACHINES.map(whole) {
        let config = whole.first();
        let name = config.file.display();
        let text = random_program(config, 7, 60.0).unwrap();
        let program = folder.path().join("random.ngc");
        std::fs::write(&program, &text).unwrap();
        let moves = motion::moves(&whole, &program, None).unwrap();
        let replay = replay(config, &moves, 0.01).unwrap_or_else(|fault| panic!("{name}: {fault}"));
        assert_eq!(replay.violations(config), [""; 0], "{name}");
        assert!(replay.time >= 60.0 && replay.moves > 10, "{name}: {} moves", replay.moves);
        let changed = moves.iter().filter(|step| step.tool != [0.0; 3]).count();
        assert!(changed > 0, "{name}: no tool change");
    }
}

#[test]
fn a_seed_makes_the_same_program_again_and_another_seed_another() {
    let config = &config(MACHINES[0]);
    let text = |seed| random_program(config, seed, 10.0).unwrap();
    assert_eq!(text(1), text(1));
    assert_ne!(text(1), text(2));
}

/// The tool offset changes where no joint moves, because the module refuses it elsewhere.
#[test]
fn a_random_program_of_a_wrist_beside_constraints_changes_no_tool_at_a_tilt() {
    let file = root().join("tests/cases/ini/constraints/tricept-wrist.ini");
    let text = std::fs::read_to_string(&file).unwrap();
    let read = Ini::parse(&file, &text).unwrap();
    let whole = MachineConfig::leniently(&read, Some(Lenient::Constraints)).unwrap();
    let config = whole.first();
    for seed in 0..20 {
        let text = random_program(config, seed, 60.0).unwrap();
        let (mut pose, mut tool) =
            (config.world(&config.start, &[0.0; MAX_EXTRA]), Vector3::zeros());
        for line in text.lines() {
            let words: Vec<(char, f64)> = line
                .split_whitespace()
                .filter_map(|word| Some((word.chars().next()?, word.get(1..)?.parse().ok()?)))
                .collect();
            let is_change = line.starts_with("G43.1") || line == "G49";
            let mut next = Vector3::zeros();
            for (letter, value) in words {
                match "XYZABC".find(letter) {
                    Some(i) if is_change => next[i] = value,
                    Some(i) => pose[i] = value + if i < 3 { tool[i] } else { 0.0 },
                    None => {}
                }
            }
            if is_change {
                let joints = |tool: &Vector3<f64>| {
                    let own = config.machine.pose_of_world(&config.chain, &pose, tool).unwrap();
                    let tool = config.chain.machine_tool(tool);
                    config.machine.inverse(&Pose::from_degrees(own), &tool).unwrap()
                };
                let (from, to) = (joints(&tool), joints(&next));
                // Rounding of positions of a machine of about a meter.
                assert!(from.iter().zip(&to).all(|(a, b)| (a - b).abs() < 1e-9), "{seed}: {line}");
                tool = next;
            }
        }
    }
}
