// SPDX-License-Identifier: GPL-2.0-or-later
//! No other pose: forward returns only the pose connected with the seed, even
//! if a machine is tilted so far that it has singular poses; otherwise it fails.

use abi_tests::geometry::distance;
use abi_tests::machines::{Hexapod, genhexkins_default, tilted};
use abi_tests::module::{Module, Pose};
use abi_tests::parallel::Parallel;
use abi_tests::random::{Random, cases};
use abi_tests::subjects::subjects;
use abi_tests::tolerances::WRONG_REL;
use abi_tests::tracker::connected_pose;

const HOME: Pose = [0.0, 0.0, 20.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

#[derive(Default, Debug)]
pub struct Count {
    pub right: u32,
    refused: u32,
    refused_though_connected: u32,
    pub wrong: u32,
}

impl Count {
    pub fn add(&mut self, found: Result<Pose, i32>, right: Option<&Pose>, machine: &Parallel) {
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

/// Returns a random pose of genhexkins' default geometry (inches), its platform rotated and tilted far.
fn pose(random: &mut Random, tilt: f64) -> Pose {
    let (a, b) = tilted(random.between(0.0, tilt), random.within(180.0));
    let (x, y, z) = (random.within(8.0), random.within(8.0), random.between(12.0, 28.0));
    [x, y, z, a, b, random.within(tilt), 0.0, 0.0, 0.0]
}

#[test]
fn forward_from_home_returns_the_connected_pose_or_fails() {
    let theirs = Module::genhexkins();
    let machine = Parallel::from(Hexapod { home: Some(HOME), ..genhexkins_default(&theirs) });
    let ours = machine.module();
    let mut random = Random::new(14);
    for tilt in [20.0, 50.0, 80.0] {
        let (mut our_count, mut their_count) = (Count::default(), Count::default());
        for _ in 0..cases(400) {
            let pose = pose(&mut random, tilt);
            let joints = ours.inverse(&pose).expect("struts of some length");
            let right = connected_pose(&ours, &machine, &joints, &HOME);
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

/// Returns whether a machine has as many legs as coordinates, and no table.
pub fn is_square(machine: &Parallel) -> bool {
    machine.table.is_empty() && machine.coordinates.len() == machine.legs.len()
}

/// Joints of poses up to three times as far from home as the workspace extends, of every
/// machine with as many legs as coordinates.
#[test]
fn rods_and_cranks_too_return_the_connected_pose_or_fail() {
    for subject in subjects().iter().filter(|s| is_square(&s.machine) && s.machine.tool == [0.0; 3])
    {
        let (machine, home) = (&subject.machine, subject.home());
        let module = machine.module();
        let mut random = Random::new(16);
        let mut count = Count::default();
        for _ in 0..cases(150) {
            let inside = (subject.sample)(&mut random);
            let far = random.between(1.0, 3.0);
            let pose: Pose = std::array::from_fn(|c| home[c] + far * (inside[c] - home[c]));
            let Ok(joints) = module.inverse(&pose) else { continue };
            let right = connected_pose(&module, machine, &joints, &home);
            let found = module.forward(&joints, &home);
            let wrong = count.wrong;
            count.add(found, right.as_ref(), machine);
            let what = format!("{}: home to {pose:?}", subject.name);
            assert_eq!(count.wrong, wrong, "{what}: {found:?}, not {right:?}");
        }
        println!("{}: {count:?}", subject.name);
        assert!(count.right > 0, "{}: {count:?}", subject.name);
    }
}
