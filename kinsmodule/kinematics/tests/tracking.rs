// SPDX-License-Identifier: GPL-2.0-or-later
//! Certified tracking against the reference tracker: never another pose as success.

use crate::common::machines::{declared, genhexkins_case, hexapods, wild, with_legs};
use crate::common::outcome::{Outcome, judged};
use crate::common::random::{RECIPES, coin, draw};
use crate::common::reference::Tracker;
use crate::common::{Case, NO_OFFSET, NO_TOOL, cases, rng, uniform};
use kinematics::{Cause, LegKind, Machine, Solver};
use rand_pcg::Pcg64;

#[test]
fn between_far_poses_a_result_is_right_or_refused() {
    let genhexkins = genhexkins_case();
    for case in declared().iter().chain([&genhexkins]) {
        let tracker = Tracker::new(&case.geometry);
        let mut rng = rng(21);
        let mut outcome = Outcome::default();
        for _ in 0..cases(1000) {
            let (seed, pose) = ((case.sample)(&mut rng), (case.sample)(&mut rng));
            outcome += judged(case, &tracker, &case.joints(&pose), &seed);
        }
        println!("{}: {outcome:?}", case.name);
        assert_eq!(outcome.wrong, 0, "{}: {outcome:?}", case.name);
        assert!(outcome.right * 100 >= cases(1000) * 95, "{}: {outcome:?}", case.name);
    }
}

#[test]
fn a_pose_behind_a_singular_one_is_refused_and_never_replaced_by_another() {
    let genhexkins = genhexkins_case();
    for case in declared().iter().chain([&genhexkins]) {
        let (tracker, sample) = (Tracker::new(&case.geometry), wild(case, 0.4, 75.0));
        let mut rng = rng(22);
        let mut outcome = Outcome::default();
        let mut behind = 0;
        let at_home = tracker.handedness(&case.home, &case.joints(&case.home));
        for _ in 0..cases(1000) {
            let pose = case.without_held(&sample(&mut rng));
            let Ok(joints) = case.machine.inverse(&pose, &NO_TOOL) else { continue };
            behind += usize::from(tracker.handedness(&pose, &joints) != at_home);
            outcome += judged(case, &tracker, &joints, &case.home);
        }
        println!("{}: {outcome:?}, {behind} behind a singular pose", case.name);
        assert_eq!(outcome.wrong, 0, "{}: {outcome:?}", case.name);
        assert!(outcome.right > 0, "{}: {outcome:?}", case.name);
        let six_struts = case.geometry.legs().len() == 6
            && case.geometry.legs().iter().all(|leg| matches!(leg.kind, LegKind::Strut(_)));
        assert!(behind > 0 || !six_struts, "{}: the test must reach beyond", case.name);
    }
}

/// Returns the same machine with the rods of some legs on their other side.
fn mirrored(rng: &mut Pcg64, case: &Case) -> Option<Machine> {
    let mut turned = false;
    let mut legs = case.geometry.legs().to_vec();
    for leg in &mut legs {
        if !coin(rng) {
            continue;
        }
        match &mut leg.kind {
            LegKind::Strut(_) | LegKind::Ring(_) => continue,
            LegKind::Slider(slider) => slider.side = -slider.side,
            LegKind::Crank(crank) => crank.side = -crank.side,
        }
        turned = true;
    }
    let mut other = with_legs(&case.geometry, &legs);
    other.home = None;
    turned.then(|| Machine::freeze(&other, &NO_OFFSET).expect("any side will do"))
}

#[test]
fn joints_of_the_other_side_of_a_dead_point_are_never_answered_by_a_pose_of_this_side() {
    let mut rng = rng(24);
    let mut across = 0;
    for recipe in RECIPES {
        let mut outcome = Outcome::default();
        for _ in 0..cases(60) {
            let case = draw(&mut rng, recipe);
            let Some(mirror) = mirrored(&mut rng, &case) else { continue };
            let (tracker, sample) = (Tracker::new(&case.geometry), wild(&case, 0.1, 25.0));
            for _ in 0..20 {
                let pose = case.without_held(&sample(&mut rng));
                let Ok(joints) = mirror.inverse(&pose, &NO_TOOL) else { continue };
                outcome += judged(&case, &tracker, &joints, &case.home);
                across += 1;
            }
        }
        println!("{}: {outcome:?}", recipe.name);
        assert_eq!(outcome.wrong, 0, "{}: {outcome:?}", recipe.name);
    }
    assert!(across > cases(1000), "{across} joint paths lead across dead points");
}

#[test]
fn joints_drawn_at_random_are_answered_by_the_connected_pose_or_not_at_all() {
    let mut rng = rng(25);
    for recipe in RECIPES {
        let mut outcome = Outcome::default();
        for _ in 0..cases(60) {
            let case = draw(&mut rng, recipe);
            if case.machine.layout().is_redundant() {
                continue;
            }
            let tracker = Tracker::new(&case.geometry);
            let home = case.joints(&case.home);
            for _ in 0..20 {
                let spread = uniform(&mut rng, 5.0, 200.0);
                let joints = home.map(|q| q + uniform(&mut rng, -spread, spread));
                outcome += judged(&case, &tracker, &joints, &case.home);
            }
        }
        println!("{}: {outcome:?}", recipe.name);
        assert_eq!(outcome.wrong, 0, "{}: {outcome:?}", recipe.name);
    }
}

#[test]
fn the_way_out_of_the_workspace_ends_with_the_cause_of_a_stalled_path() {
    let [case, _] = hexapods();
    let joints = case.machine.inverse(&case.home, &NO_TOOL).unwrap();
    let mut torn = joints;
    torn[2] += 600.0;
    let fault = case.machine.forward(&torn, &case.home, &NO_TOOL, &Solver::default()).unwrap_err();
    assert_eq!(fault.cause, Cause::PathStalled, "{fault}");
    assert!(fault.value > 0.0 && fault.value < 1.0, "the share of the path covered: {fault}");
}
