// SPDX-License-Identifier: GPL-2.0-or-later
//! With a chain or a second mechanism, forward has the result of the reference tracker, or fails:
//! far from the seed, and along sequences in which every call begins at the last result.

use crate::connected::{Count, is_square};
use abi_tests::carrying::carrying;
use abi_tests::module::{Joints, Pose};
use abi_tests::pair::{Two, pairs};
use abi_tests::parallel::Parallel;
use abi_tests::random::{Random, cases};
use abi_tests::subjects::{Subject, pose, subjects};
use abi_tests::tracker::connected_pose;

/// Returns a pose near one of the workspace, or up to three times as far from home.
fn near_or_far(subject: &Subject, from: &Pose, random: &mut Random) -> Pose {
    let (home, inside) = (subject.home(), (subject.sample)(random));
    let (begin, share) = match random.between(0.0, 1.0) < 0.3 {
        true => (*from, random.between(0.0, 0.05)),
        false => (home, random.between(1.0, 3.0)),
    };
    std::array::from_fn(|k| begin[k] + share * (inside[k] - begin[k]))
}

#[test]
fn through_a_chain_forward_returns_the_connected_pose_or_fails() {
    let mut random = Random::new(195);
    let all = subjects();
    for subject in all.iter().filter(|s| is_square(&s.machine) && s.machine.tool == [0.0; 3]) {
        let carrying = carrying(subject, &mut random);
        let (chain, module) = (carrying.chain(), carrying.module());
        let (machine, tool) = (&subject.machine, carrying.tool());
        let plain = machine.module();
        let mut count = Count::default();
        let home = carrying.world(&subject.home(), &chain, &mut random);
        let mut seed = home;
        for _ in 0..cases(100) {
            let from = pose(chain.to_machine(&seed, &tool).unwrap());
            let own = near_or_far(subject, &from, &mut random);
            let world = carrying.world(&own, &chain, &mut random);
            let Ok(joints) = module.inverse(&world) else { continue };
            let right = connected_pose(&plain, machine, &joints, &from);
            let found = module.forward(&joints, &seed);
            let found_own = found.map(|world| pose(chain.to_machine(&world, &tool).unwrap()));
            count.add(found_own, right.as_ref(), machine);
            let name = subject.name;
            assert_eq!(count.wrong, 0, "{name}: {from:?} to {own:?}: {found_own:?}, not {right:?}");
            seed = found.unwrap_or(home);
        }
        println!("{}: {count:?}", subject.name);
        assert!(count.right > 0, "{}: {count:?}", subject.name);
    }
}

/// Returns the poses of both connected with these, or none: a module returns no partial result.
fn connected_both(two: &Two, joints: &[Joints; 2], from: &[Pose; 2]) -> Option<[Pose; 2]> {
    let machines: [&Parallel; 2] = [&two.first.machine, &two.second.machine];
    let of = |i: usize| connected_pose(&machines[i].module(), machines[i], &joints[i], &from[i]);
    Some([of(0)?, of(1)?])
}

#[test]
fn behind_two_mechanisms_forward_returns_both_connected_poses_or_fails() {
    let mut random = Random::new(196);
    let square = |two: &Two| is_square(&two.first.machine) && is_square(&two.second.machine);
    for two in pairs().into_iter().filter(square) {
        let module = two.module();
        let subjects = [&two.first, &two.second];
        let alone = subjects.map(|subject| subject.machine.module());
        let mut counts = [Count::default(), Count::default()];
        let mut seed = two.homes();
        for _ in 0..cases(100) {
            let mut from = [seed, two.second_of(&seed)];
            // Letters of the other one.
            let own = |k: usize, i: usize| subjects[i].machine.moves(k);
            (0..2).for_each(|i| {
                (0..9).filter(|k| *k > 5 || !own(*k, i)).for_each(|k| from[i][k] = 0.0)
            });
            let targets = [0, 1].map(|i: usize| near_or_far(subjects[i], &from[i], &mut random));
            let Ok(joints) = module.inverse(&two.world(&targets[0], &targets[1])) else { continue };
            let of_each = [0, 1].map(|i: usize| alone[i].inverse(&targets[i]).expect("as in both"));
            let right = connected_both(&two, &of_each, &from);
            let found = module.forward(&joints, &seed);
            for i in 0..2 {
                let own = found.map(|world| [world, two.second_of(&world)][i]);
                let own = own.map(|mut pose| {
                    (0..9)
                        .filter(|k| *k > 5 || !subjects[i].machine.moves(*k))
                        .for_each(|k| pose[k] = 0.0);
                    pose
                });
                let right = right.as_ref().map(|poses| &poses[i]);
                counts[i].add(own, right, &subjects[i].machine);
                let name = subjects[i].name;
                assert_eq!(
                    counts[i].wrong, 0,
                    "{name}: {:?} to {:?}: {own:?}, not {right:?}",
                    from[i], targets[i]
                );
            }
            seed = found.unwrap_or(two.homes());
        }
        println!("{} and {}: {counts:?}", two.first.name, two.second.name);
        assert!(counts.iter().all(|count| count.right > 0), "{counts:?}");
    }
}
