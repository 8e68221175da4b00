// SPDX-License-Identifier: GPL-2.0-or-later
//! Margins of a pose: which limits are visited, with which values, and which of them is violated.

use crate::common::machines::{declared, paper_004};
use crate::common::{NO_TOOL, cases, rng};
use kinematics::{At, Cause, Fault, Limit, Limits, MAX_LEGS, Machine, Margin, Part, Pose, Vector3};
use rand::Rng;
use std::ops::ControlFlow;

fn margins(at: &At<'_>, limits: &Limits) -> Vec<Margin> {
    let mut all = vec![];
    let _ = at.margins(limits, |margin| {
        all.push(margin);
        ControlFlow::<()>::Continue(())
    });
    all
}

/// Limits everything, with nothing near a limit.
const WIDE: Limits = Limits {
    base_cone: [180.0; MAX_LEGS],
    platform_cone: [180.0; MAX_LEGS],
    tilt: 180.0,
    conditioning: 1e-9,
    clearance: 1e-9,
    ..Limits::NONE
};

#[test]
fn every_limit_that_is_set_is_visited_in_the_order_of_the_list_and_no_other() {
    for case in declared() {
        let mut rng = rng(91);
        let (legs, joints) = (case.machine.layout().legs(), case.machine.layout().joints());
        for _ in 0..cases(20).max(5) {
            let pose = (case.sample)(&mut rng);
            let at = case.machine.at(&pose, &NO_TOOL).expect("a pose");
            let all = margins(&at, &WIDE);
            assert!(all.is_sorted_by_key(|margin| margin.limit), "{all:?}");
            let count = |limit| all.iter().filter(|margin| margin.limit == limit).count();
            let rods = (0..legs).filter(|leg| at.drive(*leg).is_some()).count();
            let near = usize::from(at.nearest().is_some());
            for (limit, expected) in [
                (Limit::Axis, 6),
                (Limit::JointRange, joints),
                (Limit::DeadPoint, rods),
                (Limit::BaseCone, legs),
                (Limit::PlatformCone, legs),
                (Limit::Tilt, 1),
                (Limit::Clearance, near),
                (Limit::Conditioning, 1),
            ] {
                assert_eq!(count(limit), expected, "{}: {}", case.name, limit.name());
            }
            assert!(all.iter().all(|margin| margin.is_kept() && margin.room() >= 0.0), "{all:?}");
            let unset = margins(&at, &Limits::NONE);
            assert_eq!(unset.len(), 6 + joints + rods);
        }
    }
}

#[test]
fn a_check_finds_the_first_margin_that_is_not_kept_in_memory_used_before_as_well() {
    let mut found = [0; Limit::ALL.len()];
    let mut kept = 0;
    for case in declared() {
        let mut rng = rng(92);
        let mut moved = case.machine.nowhere();
        for _ in 0..cases(100).max(100) {
            let pose = (case.sample)(&mut rng);
            let at = case.machine.at(&pose, &NO_TOOL).expect("a pose");
            moved.move_to(&pose, &NO_TOOL).expect("a pose");
            let mut near =
                |value: f64, sign: f64| value * (1.0 + sign * rng.random_range(-0.05..0.3));
            let cones = at.cones();
            let limits = Limits {
                base_cone: cones.base.map(|angle| near(angle, 1.0)),
                platform_cone: cones.platform.map(|angle| near(angle, 1.0)),
                tilt: near(at.tilt(), 1.0),
                conditioning: near(at.smallest_singular_value(), -1.0),
                clearance: near(at.nearest().map_or(0.0, |nearest| nearest.distance), -1.0),
                ..Limits::NONE
            };
            let first = margins(&at, &limits).into_iter().find(|margin| !margin.is_kept());
            assert_eq!(moved.check(&limits), first.map_or(Ok(()), Err), "{}", case.name);
            match first {
                Some(margin) => found[margin.limit.index()] += 1,
                None => kept += 1,
            }
        }
    }
    for limit in [Limit::BaseCone, Limit::PlatformCone, Limit::Clearance, Limit::Conditioning] {
        assert!(found[limit.index()] > 10, "{}: {found:?}", limit.name());
    }
    assert!(kept > 10, "{kept}");
}

#[test]
fn joints_turn_about_the_axes_that_are_named_for_them_and_nothing_else_changes() {
    let near = |one: f64, other: f64| one == other || (one.is_nan() && other.is_nan());
    for case in declared() {
        let axes: Vec<[f64; 3]> = (0..MAX_LEGS).map(|i| [1.0, 0.5, -0.25 * i as f64]).collect();
        let named = case.machine.clone().with_joint_axes([&axes, &[]]);
        let pose = (case.sample)(&mut rng(93));
        let [one, other] =
            [&case.machine, &named].map(|machine| machine.at(&pose, &NO_TOOL).expect("a pose"));
        assert_eq!((one.joints(), one.corrections()), (other.joints(), other.corrections()));
        let ([_, own], [base, platform]) = (one.turns(), other.turns());
        for i in 0..case.machine.layout().legs() {
            let (axis, leg) = (Vector3::from(axes[i]).normalize(), one.segments()[i].span());
            let across = axis.dot(&leg.normalize()).asin().to_degrees();
            // Degrees: some ten rounding errors.
            assert!((base.across[i] - across).abs() < 1e-11, "{}: {i}", case.name);
            assert!(base.about[i].is_finite() && near(platform.about[i], own.about[i]));
        }
    }
}

#[test]
fn the_tilt_is_the_angle_of_the_tool_axis_to_z_for_all_turns_about_it() {
    let case = &declared()[0];
    for (pose, tilt) in [
        ([0.0, 0.0, 250.0, 0.0, 0.0, 30.0], 0.0),
        ([0.0, 0.0, 250.0, -12.0, 0.0, 5.0], 12.0),
        ([0.0, 0.0, 250.0, 0.0, 9.0, -7.0], 9.0),
    ] {
        let at = case.machine.at(&Pose::from_degrees(pose), &NO_TOOL).expect("a pose");
        // Degrees: some rounding errors.
        assert!((at.tilt() - tilt).abs() < 1e-12, "{}", at.tilt());
        if tilt > 0.0 {
            let here = |most: f64| {
                let limits = Limits { tilt: most, ..Limits::NONE };
                case.machine.nowhere().here(&NO_TOOL, &limits, &Pose::from_degrees(pose))
            };
            assert_eq!(here(tilt + 1e-9), None);
            let fault = here(tilt - 1e-9).expect("beyond");
            assert_eq!((fault.cause, fault.number()), (Cause::TiltAhead, None));
        }
    }
}

#[test]
fn a_leg_beyond_its_pyramid_is_named_with_its_turn_and_one_without_an_axis_keeps_none() {
    let geometry = paper_004(0.0);
    let machine = Machine::freeze(&geometry, &[0.0; MAX_LEGS]).expect("a machine");
    let pose = Pose::from_degrees([60.0, -40.0, 260.0, 8.0, -6.0, 10.0]);
    let at = machine.at(&pose, &NO_TOOL).expect("a pose");
    let home = Pose::from_degrees(geometry.home.expect("a reference pose"));
    let then = *machine.at(&home, &NO_TOOL).expect("home").segments();
    for (end, cause) in
        [Cause::BasePyramidAhead, Cause::PlatformPyramidAhead].into_iter().enumerate()
    {
        for (leg, given) in geometry.legs().iter().enumerate() {
            let kinematics::LegKind::Strut(strut) = given.kind else { panic!("a strut") };
            let axis = Vector3::from([strut.base_axis, strut.platform_axis][end]).normalize();
            let back =
                if end == 0 { nalgebra::Matrix3::identity() } else { at.rotation().transpose() };
            let now = back * at.segments()[leg].span();
            let across = (axis.dot(&now) / now.norm()).asin().to_degrees();
            let flat = |v: Vector3<f64>| v - axis * axis.dot(&v);
            let (a, b) = (flat(then[leg].span()), flat(now));
            let about = axis.dot(&a.cross(&b)).atan2(a.dot(&b)).to_degrees();
            for (way, turn) in [about, across].into_iter().enumerate() {
                let here = |most: f64| {
                    let mut limits = Limits::NONE;
                    let pyramids = [&mut limits.base_pyramid, &mut limits.platform_pyramid];
                    pyramids.into_iter().nth(end).expect("two ends")[leg][way] = most;
                    machine.nowhere().here(&NO_TOOL, &limits, &pose)
                };
                assert_eq!(here(turn.abs() * 1.001), None);
                let fault = here(turn.abs() * 0.999).expect("beyond");
                assert_eq!((fault.cause, fault.number()), (cause, Some(leg as u8)));
                // Degrees: some ten rounding errors.
                assert!((fault.value - turn).abs() < 1e-11, "{fault:?} {turn}");
            }
        }
    }
    let mut without = geometry;
    without.home = None;
    let machine = Machine::freeze(&without, &[0.0; MAX_LEGS]).expect("a machine");
    let limits = Limits { base_pyramid: [[90.0; 2]; MAX_LEGS], ..Limits::NONE };
    let fault = machine.nowhere().here(&NO_TOOL, &limits, &pose).expect("no direction at home");
    assert!(fault.cause == Cause::BasePyramidAhead && fault.value.is_nan());
}

#[test]
fn a_margin_is_the_room_to_the_nearer_end_and_nan_is_never_kept() {
    let margin = |value: f64, range: [f64; 2]| Margin {
        limit: Limit::JointRange,
        part: Part::Joint(0),
        value,
        range,
    };
    for (value, room) in [(3.0, 2.0), (9.0, 1.0), (0.5, -0.5), (12.0, -2.0), (1.0, 0.0)] {
        let margin = margin(value, [1.0, 10.0]);
        assert_eq!((margin.room(), margin.is_kept()), (room, room >= 0.0));
    }
    for [value, low, high] in [[f64::NAN, 1.0, 2.0], [1.0, f64::NAN, 2.0], [1.0, 0.0, f64::NAN]] {
        let margin = margin(value, [low, high]);
        assert!(margin.room().is_nan() && !margin.is_kept(), "{margin:?}");
    }
    let far = Margin::of_fault(&Fault::of_leg(Cause::OutOfReach, 2, 7.0));
    assert_eq!((far.limit, far.part, far.room()), (Limit::Reach, Part::Leg(2), -7.0));
    let dead = Margin::of_fault(&Fault::of_leg(Cause::DeadPoint, 1, 0.03));
    assert!(dead.limit == Limit::DeadPoint && !dead.is_kept() && dead.room() > -0.03);
    assert!(!Margin::of_fault(&Cause::PoseNotFinite.into()).is_kept());
}
