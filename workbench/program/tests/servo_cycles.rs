// SPDX-License-Identifier: GPL-2.0-or-later
//! Ranges that the servo cycles of a run use.

use kinematics::Letter;
use linuxcnc::row::{Flags, Row};
use program::servo_cycles::Cycles;
use program::two_mechanisms::Flights;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use test_support::control::standing;
use test_support::shipped::{MACHINES, whole};

/// Poses and joints are random, so that each has another range. Preflight adds the ranges of cycles to those of moves,
/// one by one.
#[test]
fn ranges_of_cycles_are_those_of_each_mechanisms_own_axes_and_joints() {
    let mut rng = Pcg64::seed_from_u64(12);
    for machine in MACHINES {
        let config = whole(machine);
        let mut cycles = Cycles::new(&config).unwrap();
        let mut expected: Vec<(String, [f64; 2])> = vec![];
        for cycle in 0..20 {
            let mut value = |_| rng.random_range(-500.0..500.0);
            let mut row = Row { cycle, ..standing(config.first()) };
            row.pose = std::array::from_fn(&mut value);
            row.second.pose = std::array::from_fn(&mut value);
            row.joints = std::array::from_fn(&mut value);
            row.extra.positions = std::array::from_fn(&mut value);
            // A pose without drives does not count.
            row.flags = Flags { on: cycle % 3 > 0, ..row.flags };
            cycles.see(&row);
            if !row.flags.on {
                continue;
            }
            let mut values = vec![];
            let mut joints = row.joints.into_iter();
            for (mechanism, pose) in config.mechanisms.iter().zip([row.pose, row.second.pose]) {
                let layout = mechanism.machine.layout();
                for letter in Letter::ALL.into_iter().filter(|letter| !layout.is_held(*letter)) {
                    let name = format!("axis {}", mechanism.place.letter(letter));
                    values.push((name, pose[letter.index()]));
                }
                let names = mechanism.joints.iter().map(|joint| joint.name.clone());
                values.extend(names.zip(&mut joints));
                let extra = mechanism.extra.iter().map(|axis| axis.joint.name.clone());
                values.extend(extra.zip(row.extra.positions));
            }
            if expected.is_empty() {
                expected = values.iter().map(|(name, value)| (name.clone(), [*value; 2])).collect();
            }
            for ((_, range), (_, value)) in expected.iter_mut().zip(values) {
                *range = [range[0].min(value), range[1].max(value)];
            }
        }
        let (names, ranges): (Vec<String>, Vec<[f64; 2]>) = expected.into_iter().unzip();
        assert_eq!(cycles.used(), ranges, "{machine}: {names:?}");
        let of_moves = Flights::new(&config.mechanisms).unwrap().finish().unwrap().ranges;
        let of_moves: Vec<String> = of_moves.into_iter().map(|range| range.part).collect();
        assert_eq!(of_moves, names, "{machine}");
    }
}
