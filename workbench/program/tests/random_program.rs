// SPDX-License-Identifier: GPL-2.0-or-later
//! Random programs: read by LinuxCNC's interpreter and replayed, they stay within all limits.

use program::motion;
use program::random_program::random_program;
use program::replay::replay;
use test_support::shipped::{MACHINES, config, whole};

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
