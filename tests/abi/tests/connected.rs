// SPDX-License-Identifier: GPL-2.0-or-later
//! No other pose: what forward returns is the pose connected with the seed, also
//! where a machine is tilted until it has singular poses, and else it fails.

use abi_tests::geometry::distance;
use abi_tests::machines::{Hexapod, genhexkins_default, tilted};
use abi_tests::module::{Module, Pose};
use abi_tests::random::{Random, cases};
use abi_tests::tolerances::WRONG_REL;
use abi_tests::tracker::connected_pose;

const HOME: Pose = [0.0, 0.0, 20.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

#[derive(Default, Debug)]
struct Count {
    right: u32,
    refused: u32,
    refused_though_connected: u32,
    wrong: u32,
}

impl Count {
    fn add(&mut self, found: Result<Pose, i32>, right: Option<&Pose>, machine: &Hexapod) {
        let same = |found: &Pose, right: &Pose| {
            distance(found, right, machine.radius()) <= WRONG_REL * machine.size()
        };
        match (found, right) {
            (Err(_), None) => self.refused += 1,
            (Err(_), Some(_)) => self.refused_though_connected += 1,
            (Ok(found), Some(right)) if same(&found, right) => self.right += 1,
            (Ok(_), _) => self.wrong += 1,
        }
    }
}

/// genhexkins' default geometry (inches), its platform turned and tilted far.
fn pose(random: &mut Random, tilt: f64) -> Pose {
    let (a, b) = tilted(random.between(0.0, tilt), random.within(180.0));
    let (x, y, z) = (random.within(8.0), random.within(8.0), random.between(12.0, 28.0));
    [x, y, z, a, b, random.within(tilt), 0.0, 0.0, 0.0]
}

#[test]
fn forward_from_home_returns_the_connected_pose_or_fails() {
    let theirs = Module::genhexkins();
    let machine = Hexapod { home: Some(HOME), ..genhexkins_default(&theirs) };
    let ours = machine.module();
    let mut random = Random::new(14);
    for tilt in [20.0, 50.0, 80.0] {
        let (mut our_count, mut their_count) = (Count::default(), Count::default());
        for _ in 0..cases(400) {
            let pose = pose(&mut random, tilt);
            let joints = ours.inverse(&pose).expect("struts of some length");
            let right = connected_pose(&ours, &joints, &HOME, machine.size());
            let found = ours.forward(&joints, &HOME);
            let wrong = our_count.wrong;
            our_count.add(found, right.as_ref(), &machine);
            assert_eq!(our_count.wrong, wrong, "from home to {pose:?}: {found:?}, not {right:?}");
            their_count.add(theirs.forward(&joints, &HOME), right.as_ref(), &machine);
        }
        println!("to {tilt}°: pkmkins {our_count:?}\n        genhexkins {their_count:?}");
        assert!(our_count.right > 0);
    }
}
