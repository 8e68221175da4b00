// SPDX-License-Identifier: GPL-2.0-or-later
//! Properties of any machine: tool offset, joint offsets, units, hash.

use crate::common::machines::{
    changed_legs, declared, genhexkins_case, hexapods, letters, linear_delta, mixed, paper_004,
    pyramid, tripod, with_legs,
};
use crate::common::random::{RECIPES, draw};
use crate::common::tolerances::{EXACT, GOLDEN_JOINT, ROUND_TRIP};
use crate::common::{Case, NO_OFFSET, NO_TOOL, cases, rng};
use kinematics::leg::StrutGeometry;
use kinematics::{
    Cause, Fault, Geometry, LEAST_DRIVE, LegGeometry, LegKind, Machine, Pose, Solver, Vector3,
};

#[test]
fn a_tool_changes_no_joint_of_a_level_platform_and_moves_the_tip_of_a_tilted_one() {
    let [case, _] = hexapods();
    let tool = Vector3::new(5.0, -3.0, 120.0);
    let level = Pose::from_degrees([40.0, -20.0, 200.0, 0.0, 0.0, 0.0]);
    let without = case.machine.inverse(&level, &NO_TOOL).unwrap();
    let with = case.machine.inverse(&level, &tool).unwrap();
    for i in 0..6 {
        assert!((without[i] - with[i]).abs() < GOLDEN_JOINT);
    }
    let tilted = Pose::from_degrees([40.0, -20.0, 200.0, 15.0, -10.0, 5.0]);
    let joints = case.machine.inverse(&tilted, &tool).unwrap();
    let found = case.machine.forward(&joints, &tilted, &NO_TOOL, &Solver::default()).unwrap();
    // P = t − o + R o: without its tool the control point is at t + (R − 1) o.
    let expected = tilted.position + tilted.rotation() * tool - tool;
    assert!((found.pose.position - expected).norm() < GOLDEN_JOINT);
}

#[test]
fn a_long_tool_keeps_the_servo_step_certified() {
    for case in declared() {
        // 300 mm on the hexapod of paper 004, 100 mm on the lathe of four rods.
        let farthest = |most: f64, anchor: [f64; 3]| most.max(Vector3::from(anchor).norm());
        let anchors = case.geometry.legs().iter().flat_map(|leg| [leg.base, leg.platform]);
        let tool = Vector3::new(0.0, 0.0, 0.22) * anchors.fold(0.0, farthest);
        let mut rng = rng(7);
        let mut reached = 0;
        for _ in 0..cases(2000) {
            let pose = (case.sample)(&mut rng);
            let seed = case.servo_step(&mut rng, &pose);
            // The tool moves some poses of the rods' machines out of reach.
            let Ok(joints) = case.machine.inverse(&pose, &tool) else { continue };
            if case.machine.inverse(&seed, &tool).is_err() {
                continue;
            }
            let found = case.machine.forward(&joints, &seed, &tool, &Solver::default()).unwrap();
            assert_eq!(found.sub_steps, 1, "{}", case.name);
            assert!(case.apart(&found.pose, &pose) <= ROUND_TRIP, "{}", case.name);
            reached += 1;
        }
        assert!(reached * 2 > cases(2000), "{}: {reached}", case.name);
    }
}

#[test]
fn a_joint_offset_is_taken_from_the_joint_and_given_back_by_forward() {
    // Forward has a separate branch for struts whose offsets are all positive.
    let offsets =
        [[1.0, -2.0, 3.0, 0.0, 5.5, -600.0, 7.0, -8.0], [1.0, 2.0, 3.0, 0.5, 5.5, 600.0, 7.0, 8.0]];
    for (case, offset) in offsets.iter().flat_map(|o| declared().into_iter().map(move |c| (c, *o)))
    {
        let shifted = Machine::freeze(&case.geometry, &offset).unwrap();
        let mut rng = rng(10);
        for _ in 0..50 {
            let pose = (case.sample)(&mut rng);
            let a = case.joints(&pose);
            let b = shifted.inverse(&pose, &NO_TOOL).unwrap();
            let legs = case.machine.layout().legs();
            for i in 0..legs {
                assert!((a[i] - b[i] - offset[i]).abs() < GOLDEN_JOINT, "{}", case.name);
            }
            // A table axis has no offset.
            assert_eq!(a[legs..], b[legs..]);
            let found = shifted.forward(&b, &case.home, &NO_TOOL, &Solver::default()).unwrap();
            assert!(case.apart(&found.pose, &pose) <= ROUND_TRIP, "{}", case.name);
            let jacobians = [&case.machine, &shifted]
                .map(|m| m.at(&pose, &NO_TOOL).unwrap().pose_jacobian().unwrap());
            // Joints of 1e3 lose 1e-13 to the offset; near a dead point rows amplify it by 1e2.
            assert!((jacobians[0] - jacobians[1]).amax() < 1e-9, "{}", case.name);
        }
    }
}

/// Returns the same machine with every length multiplied.
fn scaled(given: &Geometry, by: f64) -> Geometry {
    let scale = |v: [f64; 3]| v.map(|x| x * by);
    let mut other = changed_legs(given, |_, leg| {
        leg.base = scale(leg.base);
        leg.platform = scale(leg.platform);
        match &mut leg.kind {
            LegKind::Strut(strut) => strut.lead *= by,
            LegKind::Slider(slider) => slider.rod *= by,
            LegKind::Crank(crank) => {
                crank.rod *= by;
                crank.arm = scale(crank.arm);
            }
            LegKind::Ring(ring) => ring.radius *= by,
        }
    });
    other.centre = scale(given.centre);
    other.home = given.home.map(|h| [h[0] * by, h[1] * by, h[2] * by, h[3], h[4], h[5]]);
    other
}

/// Returns the factor of joint `i`: angles of cranks keep their value.
fn joint_scale(case: &Case, i: usize, by: f64) -> f64 {
    match case.geometry.legs().get(i) {
        Some(leg) if leg.kind.is_angular() => 1.0,
        _ => by,
    }
}

/// Returns every declared machine, and one of each recipe.
fn all_machines() -> Vec<Case> {
    let mut rng = rng(11);
    let mut all = declared();
    all.extend(RECIPES.iter().map(|recipe| draw(&mut rng, recipe)));
    all
}

#[test]
fn a_machine_scaled_by_a_power_of_two_gives_the_same_bits() {
    let mut compared = 0;
    for case in all_machines() {
        for by in [2.0_f64.powi(-10), 2.0_f64.powi(7)] {
            let other = Machine::freeze(&scaled(&case.geometry, by), &NO_OFFSET).unwrap();
            let solver = Solver { convergence_criterion: 1e-9 * by, ..Solver::default() };
            let mut rng = rng(8);
            for _ in 0..100 {
                let pose = (case.sample)(&mut rng);
                let near = |p: &Pose| Pose { position: p.position * by, ..*p };
                let Ok(joints) = case.machine.inverse(&pose, &NO_TOOL) else { continue };
                let others = other.inverse(&near(&pose), &NO_TOOL).unwrap();
                for i in 0..11 {
                    let same = joints[i] * joint_scale(&case, i, by);
                    assert!((same - others[i]).abs() <= EXACT, "{} {i}", case.name);
                }
                let home = near(&case.home);
                let a = case.machine.forward(&joints, &case.home, &NO_TOOL, &Solver::default());
                let b = other.forward(&others, &home, &NO_TOOL, &solver);
                let (Ok(a), Ok(b)) = (a, b) else {
                    assert_eq!(a.map_err(|e| e.cause).err(), b.map_err(|e| e.cause).err());
                    continue;
                };
                assert_eq!((a.iterations, a.sub_steps), (b.iterations, b.sub_steps));
                assert_eq!(near(&a.pose), b.pose, "{}", case.name);
                assert!((a.residual * by - b.residual).abs() <= EXACT, "{}", case.name);
                compared += 1;
            }
        }
    }
    assert!(compared > 3000, "{compared}");
}

#[test]
fn a_machine_in_inches_or_meters_behaves_as_in_millimeters() {
    for case in declared() {
        for by in [1.0 / 25.4, 1e-3] {
            let other = Machine::freeze(&scaled(&case.geometry, by), &NO_OFFSET).unwrap();
            let mut rng = rng(9);
            for _ in 0..500 {
                let pose = (case.sample)(&mut rng);
                let plain = case.joints(&pose);
                let pose = Pose { position: pose.position * by, ..pose };
                let home = Pose { position: case.home.position * by, ..case.home };
                let joints = other.inverse(&pose, &NO_TOOL).unwrap();
                for i in 0..11 {
                    let same = plain[i] * joint_scale(&case, i, by);
                    // Some rounding errors; over 0.05 near a dead point.
                    let most = 1e-11 * case.machine.size().max(1.0) * joint_scale(&case, i, by);
                    assert!((joints[i] - same).abs() <= most, "{} {i}", case.name);
                }
                let found = other.forward(&joints, &home, &NO_TOOL, &Solver::default()).unwrap();
                let apart = found.pose.distance(&pose, other.radius());
                assert!(apart <= ROUND_TRIP * other.size(), "{}", case.name);
            }
        }
    }
}

#[test]
fn the_hash_follows_every_value_that_enters_the_joints_and_no_other() {
    let given = paper_004(10.0);
    let hash = given.hash();
    let differs = |change: &dyn Fn(&mut Geometry)| {
        let mut other = given;
        change(&mut other);
        other.hash() != hash
    };
    assert!(differs(&|g| g.home.as_mut().unwrap()[2] += 1e-9));
    assert!(differs(&|g| g.home = None));
    assert!(differs(&|g| g.centre[1] = 1e-9));
    let layout = |coordinates: &str| {
        let mut other =
            Geometry::new(given.legs(), letters(coordinates), *given.layout().table()).unwrap();
        other.home = given.home;
        other.hash()
    };
    assert_eq!(layout("XYZABC"), hash);
    assert_ne!(layout("XYZCBA"), hash);
    assert_ne!(layout("XYZAB"), hash);
    // A letter of the table is not a letter of the platform.
    let with_table = |coordinates: &str, table: &str| {
        Geometry::new(given.legs(), letters(coordinates), letters(table)).unwrap().hash()
    };
    assert_ne!(with_table("ZAB", "XY"), with_table("ZAB", "YX"));
    assert_ne!(with_table("ZAB", "X"), with_table("ZAB", ""));
    // Without a lead the axes have no effect.
    let plain = paper_004(0.0);
    let turned = changed_legs(&plain, |i, leg| {
        if i == 0 {
            let axes = StrutGeometry { base_axis: [1.0, 2.0, 3.0], ..StrutGeometry::default() };
            *leg = LegGeometry::strut(leg.base, leg.platform, axes);
        }
    });
    assert_eq!(plain.hash(), turned.hash());
}

/// Visits every number of a leg that affects a joint, in order.
fn each_value(leg: &mut LegGeometry, mut see: impl FnMut(&mut f64)) {
    leg.base.iter_mut().for_each(&mut see);
    leg.platform.iter_mut().for_each(&mut see);
    match &mut leg.kind {
        LegKind::Strut(strut) => {
            // Without a lead the axes affect no joint.
            if strut.lead != 0.0 {
                strut.base_axis.iter_mut().for_each(&mut see);
                strut.platform_axis.iter_mut().for_each(&mut see);
            }
            see(&mut strut.lead);
        }
        LegKind::Slider(slider) => {
            slider.guide.iter_mut().for_each(&mut see);
            see(&mut slider.rod);
        }
        LegKind::Crank(crank) => {
            crank.axis.iter_mut().for_each(&mut see);
            crank.arm.iter_mut().for_each(&mut see);
            see(&mut crank.rod);
        }
        LegKind::Ring(ring) => see(&mut ring.radius),
    }
}

#[test]
fn the_hash_follows_every_value_of_every_kind_the_order_of_legs_and_not_the_sign_of_0() {
    let mut rng = rng(12);
    for recipe in RECIPES {
        let case = draw(&mut rng, recipe);
        let mut seen = vec![case.geometry.hash()];
        for i in 0..case.geometry.legs().len() {
            let mut count = 0;
            each_value(&mut case.geometry.legs()[i].clone(), |_| count += 1);
            for which in 0..count {
                // Set to a different number, and to either zero.
                let set = |to: f64| {
                    changed_legs(&case.geometry, |k, leg| {
                        let mut n = 0;
                        each_value(leg, |value| {
                            if k == i && n == which {
                                *value = to;
                            }
                            n += 1;
                        });
                    })
                    .hash()
                };
                assert_eq!(set(0.0), set(-0.0));
                seen.push(set(0.12345));
            }
            let sides = changed_legs(&case.geometry, |k, leg| match &mut leg.kind {
                LegKind::Slider(slider) if k == i => slider.side = -slider.side,
                LegKind::Crank(crank) if k == i => crank.side = -crank.side,
                _ => {}
            });
            if !case.geometry.legs()[i].kind.stands() {
                seen.push(sides.hash());
            }
        }
        let mut legs = case.geometry.legs().to_vec();
        legs.swap(0, 1);
        seen.push(with_legs(&case.geometry, &legs).hash());
        let all = seen.len();
        seen.sort_unstable();
        seen.dedup();
        // Some 100 numbers of 32 bits collide once in a million such tests.
        assert_eq!(seen.len(), all, "{}", recipe.name);
    }
}

#[test]
fn angles_keep_whole_turns_of_the_seed() {
    let [case, _] = hexapods();
    let pose = Pose::from_degrees([10.0, 0.0, 250.0, 5.0, -4.0, 725.0]);
    let seed = Pose::from_degrees([10.1, 0.0, 250.1, 5.1, -4.1, 725.2]);
    let joints = case.machine.inverse(&pose, &NO_TOOL).unwrap();
    let found = case.machine.forward(&joints, &seed, &NO_TOOL, &Solver::default()).unwrap();
    for (a, b) in found.pose.to_degrees().iter().zip(pose.to_degrees()) {
        assert!((a - b).abs() < 1e-9);
    }
}

#[test]
fn a_machine_returns_its_radius_and_the_largest_residual_that_forward_may_return() {
    for case in declared() {
        let legs = case.geometry.legs();
        let anchors = legs.iter().map(|leg| Vector3::from(leg.platform));
        let middle = anchors.clone().sum::<Vector3<f64>>() / legs.len() as f64;
        let centres: f64 = anchors.map(|anchor| (anchor - middle).norm_squared()).sum();
        let ring = |leg: &LegGeometry| {
            let radius = leg.kind.ring_radius();
            radius * (radius + Vector3::from(leg.base).norm())
        };
        let rings: f64 = legs.iter().map(ring).sum();
        let squares = centres + rings;
        let radius = (squares / legs.len() as f64).sqrt();
        // If all anchors are one point and nothing rotates, the size replaces it.
        let expected = if radius > 0.0 { radius } else { case.machine.size() };
        // Some rounding errors of sums of eight.
        assert!((case.machine.radius() - expected).abs() <= 1e-14 * expected, "{}", case.name);
    }
    let [hexapod, _] = hexapods();
    let solver = Solver { convergence_criterion: 1e-7, ..Solver::default() };
    assert_eq!(hexapod.machine.largest_residual(&solver), 1e-7);
    // No length is computed more accurately than to 16 rounding errors of the largest.
    let rounding = 16.0 * f64::EPSILON * hexapod.machine.size();
    let finest = Solver { convergence_criterion: 1e-300, ..solver };
    assert_eq!(hexapod.machine.largest_residual(&finest), rounding);
    // At the edge of the dead point, a rod's length is twenty times less sensitive to its joint.
    assert_eq!(linear_delta().machine.largest_residual(&solver), 1e-7 / LEAST_DRIVE);
    // Four rods that constrain three coordinates may be inconsistent.
    let redundant = pyramid().machine;
    assert_eq!(redundant.largest_residual(&solver), 5e-3 * redundant.radius());
    let limited = Solver { residual_limit: 0.25, ..solver };
    assert_eq!(redundant.largest_residual(&limited), 0.25);
    assert_eq!(hexapod.machine.largest_residual(&limited), 1e-7);
}

#[test]
fn a_strut_is_too_short_at_a_millionth_of_the_machine_and_not_before() {
    let [hexapod, _] = hexapods();
    for case in [tripod(), mixed(), hexapod, genhexkins_case()] {
        let short = 1e-6 * case.machine.size();
        let legs = case.geometry.legs().iter().enumerate();
        for (i, leg) in legs.filter(|(_, leg)| matches!(leg.kind, LegKind::Strut(_))) {
            let anchor = Vector3::from(leg.base) - Vector3::from(leg.platform);
            for (length, is_refused) in [(0.99 * short, true), (1.01 * short, false)] {
                let position = anchor + Vector3::new(0.0, 0.0, length);
                let pose = Pose { position, angles: Vector3::zeros() };
                let expected = Some((Cause::StrutTooShort, Some(i as u8)));
                let cause_of =
                    |fault: Option<Fault>| fault.map(|fault| (fault.cause, fault.number()));
                let refused = cause_of(case.machine.inverse(&pose, &NO_TOOL).err());
                assert_eq!(refused == expected, is_refused, "{}: {i}", case.name);
                // The same as a seed, from which forward starts.
                let joints = case.joints(&case.home);
                let found = case.machine.forward(&joints, &pose, &NO_TOOL, &Solver::default());
                assert_eq!(cause_of(found.err()) == expected, is_refused, "{}: {i}", case.name);
            }
        }
    }
}
