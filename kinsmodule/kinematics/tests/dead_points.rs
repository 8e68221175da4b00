// SPDX-License-Identifier: GPL-2.0-or-later
//! Poses in which a rod is perpendicular to the motion of its lower end, or does not reach: refused
//! with the leg's number, by inverse and by forward.

use crate::common::machines::{declared, geometry, linear_delta, ring_pentapod, rotary_delta};
use crate::common::reference::{along_ring, rod};
use crate::common::{Case, NO_OFFSET, NO_TOOL, direction, rng};
use kinematics::leg::CrankGeometry;
use kinematics::{Cause, Fault, LEAST_DRIVE, LegGeometry, LegKind, Machine, Pose, Solver, Vector3};

/// Returns the cosine between a rod and its lower end's motion, of `leg` and the smallest of all.
fn drives(case: &Case, pose: &Pose, leg: usize) -> (f64, f64) {
    let segments = *case.machine.at(pose, &NO_TOOL).unwrap().segments();
    let joints = case.joints(pose);
    let drive = |i: usize| match case.geometry.legs()[i].kind {
        LegKind::Strut(_) | LegKind::Ring(_) => f64::INFINITY,
        _ => {
            let along = (segments[i].platform - segments[i].base).normalize();
            along.dot(&rod(&case.geometry.legs()[i], joints[i]).onwards)
        }
    };
    let all = (0..case.geometry.legs().len()).map(drive);
    (drive(leg), all.fold(f64::INFINITY, f64::min))
}

fn moved(from: &Pose, along: &Vector3<f64>, by: f64) -> Pose {
    Pose { position: from.position + along * by, ..*from }
}

/// Moves away from home in one direction. Returns the last pose that inverse accepts, the first refusal, and the refusal
/// far beyond; `None` if inverse refuses nothing there.
fn walk(case: &Case, along: &Vector3<f64>) -> Option<(Pose, Fault, Fault)> {
    let mut by = 0.0;
    let mut refused = None;
    for step in [1e-2, 1e-4].map(|share| share * case.machine.size()) {
        loop {
            match case.machine.inverse(&moved(&case.home, along, by + step), &NO_TOOL) {
                Ok(_) => by += step,
                Err(fault) => break refused = Some(fault),
            }
            if by > 20.0 * case.machine.size() {
                return None;
            }
        }
    }
    let first = refused?;
    let far = moved(&case.home, along, by + 20.0 * case.machine.size());
    let beyond = case.machine.inverse(&far, &NO_TOOL).err()?;
    Some((moved(&case.home, along, by), first, beyond))
}

#[test]
fn a_platform_that_walks_away_meets_the_dead_point_of_the_rod_that_is_nearest_to_it() {
    let mut rng = rng(70);
    let mut dead = 0;
    for case in declared() {
        let of_legs = |k: usize| {
            let letter = kinematics::Letter::ALL[k];
            f64::from(u8::from(case.machine.layout().coordinates().contains(letter)))
        };
        for _ in 0..50 {
            let d = direction(&mut rng);
            let along = Vector3::from_fn(|k, _| d[k] * of_legs(k));
            if along.norm() < 0.3 {
                continue;
            }
            let Some((last, first, beyond)) = walk(&case, &along) else { continue };
            if !matches!(first.cause, Cause::DeadPoint | Cause::OutOfReach) {
                continue;
            }
            let leg = usize::from(first.number().unwrap());
            let (drive, least) = drives(&case, &last, leg);
            // Equal in symmetric poses; one step of the walk changes them by less than 0.02.
            assert!(drive < least + 0.02, "{}: {drive} {least} {first}", case.name);
            assert_eq!(first.cause, Cause::DeadPoint, "{}: {first}", case.name);
            assert!(
                first.value < LEAST_DRIVE && drive >= LEAST_DRIVE,
                "{}: {drive} {first}",
                case.name
            );
            assert_eq!(beyond.cause, Cause::OutOfReach, "{}: {beyond}", case.name);
            assert!(beyond.number().is_some() && beyond.value > 0.0, "{}: {beyond}", case.name);
            dead += 1;
        }
    }
    assert!(dead > 100, "{dead} walks met a dead point");
}

/// Computes the carriage position or arm angle at a platform anchor, however near the dead point, by
/// Newton's method on the rod's length.
fn native(case: &Case, i: usize, pose: &Pose, from: f64) -> f64 {
    let leg = &case.geometry.legs()[i];
    let p = pose.position + pose.rotation() * Vector3::from(leg.platform);
    let mut q = from;
    for _ in 0..60 {
        let at = rod(leg, q);
        let off = |q: f64| (p - rod(leg, q).anchor).norm() - at.length;
        let h = 1e-6;
        q -= off(q) * 2.0 * h / (off(q + h) - off(q - h));
    }
    q
}

#[test]
fn forward_names_the_rod_at_its_dead_point() {
    let mut rng = rng(71);
    let mut named = 0;
    for case in [linear_delta(), rotary_delta()] {
        for _ in 0..50 {
            let along = direction(&mut rng);
            let Some((last, first, _)) = walk(&case, &along) else { continue };
            // Slightly further on the rod still reaches, with a cosine of 0.03 to 0.05.
            let pose = moved(&last, &along, 4e-4 * case.machine.size());
            let from = case.joints(&last);
            let mut joints = from;
            for i in 0..3 {
                joints[i] = native(&case, i, &pose, from[i]);
            }
            let leg = &case.geometry.legs()[usize::from(first.number().unwrap())];
            let p = pose.position + Vector3::from(leg.platform);
            let at = rod(leg, joints[usize::from(first.number().unwrap())]);
            let drive = (p - at.anchor).normalize().dot(&at.onwards);
            if !(0.02..0.0499).contains(&drive) {
                continue;
            }
            let solver = Solver::default();
            let fault = case.machine.forward(&joints, &last, &NO_TOOL, &solver).unwrap_err();
            // Near its end a rod may also make the certificate fail first.
            if fault.cause == Cause::DeadPoint {
                assert_eq!(fault.number(), first.number(), "{}: {fault}", case.name);
                assert!(fault.value < LEAST_DRIVE, "{fault}");
                named += 1;
            }
        }
    }
    assert!(named >= 20, "{named}");
}

#[test]
fn a_seed_beyond_reach_is_refused_with_its_leg() {
    for case in [linear_delta(), rotary_delta()] {
        let joints = case.joints(&case.home);
        let far = moved(&case.home, &Vector3::x(), 20.0 * case.machine.size());
        let solver = Solver::default();
        let fault = case.machine.forward(&joints, &far, &NO_TOOL, &solver).unwrap_err();
        assert_eq!(
            (fault.cause, fault.number().is_some()),
            (Cause::SeedOutOfReach, true),
            "{fault}"
        );
        assert!(fault.value > 0.0, "{fault}");
    }
}

/// Tests an arm of 100 and a rod of 300, which reach from 200 to 400; 30 beside the arm's plane slightly
/// less far.
#[test]
fn a_crank_out_of_reach_reports_how_much_its_rod_is_too_short_or_too_long() {
    for beside in [0.0, 30.0] {
        let crank = CrankGeometry {
            axis: [0.0, 1.0, 0.0],
            arm: [100.0, -beside, 0.0],
            rod: 300.0,
            side: 1,
        };
        let leg = LegGeometry { base: [0.0; 3], platform: [0.0; 3], kind: LegKind::Crank(crank) };
        let home = Some([0.0, 0.0, -300.0, 0.0, 0.0, 0.0]);
        let machine = Machine::freeze(&geometry(&[leg], "Z", "", home), &NO_OFFSET).unwrap();
        for (z, nearest) in [(-405.0, 305.0), (-1000.0, 900.0), (-150.0, 250.0), (-10.0, 110.0)] {
            let pose = Pose::from_degrees([0.0, 0.0, z, 0.0, 0.0, 0.0]);
            let fault = machine.inverse(&pose, &NO_TOOL).unwrap_err();
            assert_eq!((fault.cause, fault.number()), (Cause::OutOfReach, Some(0)));
            let end = if nearest > 300.0 { nearest } else { -z + 100.0 };
            let lacks = end.hypot(beside) - 300.0;
            // A few rounding errors of lengths of some hundred.
            assert!((fault.value - lacks).abs() < 1e-12 * 300.0, "{z}: {fault} {lacks}");
        }
    }
}

/// Moves the tool axis through the base anchor of leg 2, by its own numbers: at A = 0 its distance
/// from there is 500 − y.
#[test]
fn a_ring_is_refused_from_where_its_axis_is_nearer_to_the_base_anchor_than_its_radius() {
    let case = ring_pentapod();
    let radius = case.geometry.legs()[2].kind.ring_radius();
    let at = |distance: f64| Pose::from_degrees([0.0, 500.0 - distance, 0.0, 0.0, 0.0, 0.0]);
    let joints = case.machine.inverse(&at(radius + 1e-6), &NO_TOOL).expect("beside the cylinder");
    // On the ring's edge the strut is upright.
    assert!((joints[2] - 450.5).abs() < 1e-9, "{joints:?}");
    for distance in [radius - 1e-6, 40.0, 1e-9, 0.0, -1e-9, -40.0] {
        let faults = [
            case.machine.inverse(&at(distance), &NO_TOOL).unwrap_err(),
            case.machine.at(&at(distance), &NO_TOOL).err().expect("refused"),
            case.machine.side(&at(distance), &NO_TOOL).unwrap_err(),
            case.machine.forward(&joints, &at(distance), &NO_TOOL, &Solver::default()).unwrap_err(),
        ];
        for fault in faults {
            assert_eq!((fault.cause, fault.number()), (Cause::AxisAtAnchor, Some(2)), "{distance}");
            // Some rounding errors of a difference of hundreds.
            assert!((fault.value - distance.abs()).abs() < 1e-12, "{distance}: {fault}");
        }
    }
}

/// Tests that only the refusal excludes poses within the cylinder: their joints satisfy the equation
/// there.
#[test]
fn forward_answers_no_pose_whose_axis_is_within_the_ring_of_a_base_anchor() {
    let case = ring_pentapod();
    let beside = Pose::from_degrees([0.0, 416.0, 0.0, 0.0, 0.0, 0.0]);
    let mut refused = 0;
    for within in 1..40 {
        let y = 500.0 - 80.3 + 0.05 * f64::from(within);
        let pose = Pose::from_degrees([0.0, y, 0.0, 0.0, 0.0, 0.0]);
        let joints: [f64; 11] = std::array::from_fn(|i| match case.geometry.legs().get(i) {
            Some(leg) => {
                let centre = pose.position + Vector3::from(leg.platform);
                let end = centre + along_ring(leg, &centre, &pose.rotation());
                (end - Vector3::from(leg.base)).norm()
            }
            None => 0.0,
        });
        let found = case.machine.forward(&joints, &beside, &NO_TOOL, &Solver::default());
        if let Ok(found) = &found {
            assert!(case.machine.inverse(&found.pose, &NO_TOOL).is_ok(), "{y}: {found:?}");
        }
        refused += u32::from(found.is_err_and(|fault| fault.cause == Cause::AxisAtAnchor));
    }
    assert!(refused > 30, "{refused}");
}
