// SPDX-License-Identifier: GPL-2.0-or-later
//! The nut-rotation correction: sign, continuity, and the published arcsin.

use crate::common::machines::{changed_legs, hexapod, hexapods, paper_004};
use crate::common::tolerances::GOLDEN_JOINT;
use crate::common::{NO_OFFSET, NO_TOOL, rng};
use kinematics::leg::StrutGeometry;
use kinematics::{Cause, Geometry, LegKind, Machine, Pose, Vector3};

fn machine(geometry: &Geometry) -> Machine {
    Machine::freeze(geometry, &NO_OFFSET).unwrap()
}

fn struts(geometry: &Geometry) -> [StrutGeometry; 6] {
    std::array::from_fn(|i| match geometry.legs()[i].kind {
        LegKind::Strut(strut) => strut,
        _ => panic!("a hexapod has struts only"),
    })
}

fn with_struts(given: &Geometry, struts: [StrutGeometry; 6]) -> Geometry {
    changed_legs(given, |i, leg| leg.kind = LegKind::Strut(struts[i]))
}

/// Returns the same machine without a reference pose.
fn without_home(given: &Geometry) -> Geometry {
    let mut other = *given;
    other.home = None;
    other
}

/// Returns unit vectors along the struts, base to platform.
fn directions(machine: &Machine, pose: &Pose) -> [Vector3<f64>; 6] {
    let segments = *machine.at(pose, &NO_TOOL).unwrap().segments();
    std::array::from_fn(|i| (segments[i].platform - segments[i].base).normalize())
}

/// Computes paper 004, equation 1, as printed: l + (t/2π) asin of a scalar product.
fn printed(strut: &StrutGeometry, n: &Vector3<f64>, pose: &Pose) -> f64 {
    let a1 = Vector3::from(strut.base_axis);
    let b = pose.rotation() * Vector3::from(strut.platform_axis);
    let a2 = a1.cross(n);
    let sine = n.cross(&a2).normalize().dot(&b.cross(n).normalize());
    strut.lead / std::f64::consts::TAU * sine.asin()
}

/// Tests inverse, which computes the correction in a different form, without divisions.
#[test]
fn joints_are_lengths_and_corrections_with_and_without_reference_pose() {
    // One leg without a screw among the others, because it shares their vector registers.
    let mut mixed = struts(&paper_004(10.0));
    mixed[3].lead = 0.0;
    let given = with_struts(&paper_004(10.0), mixed);
    let [hexapod, _] = hexapods();
    let mut rng = rng(7);
    for machine in [machine(&given), machine(&without_home(&given))] {
        for _ in 0..2000 {
            let pose = (hexapod.sample)(&mut rng);
            let joints = machine.inverse(&pose, &NO_TOOL).unwrap();
            let at = machine.at(&pose, &NO_TOOL).unwrap();
            let (segments, corrections) = (at.segments(), at.corrections());
            assert_eq!(corrections[3], 0.0);
            for i in 0..6 {
                let length = (segments[i].platform - segments[i].base).norm();
                let off = joints[i] - length - corrections[i];
                // 1e-11: some tens of rounding errors of lengths near 1000 mm.
                assert!(off.abs() < 1e-11, "{i}: {off:e} at {pose:?}");
            }
        }
    }
}

#[test]
fn correction_equals_the_printed_arcsin_within_its_range_with_and_without_reference_pose() {
    let given = paper_004(10.0);
    let literal = machine(&without_home(&given));
    let folded = machine(&given);
    let struts = struts(&given);
    let [hexapod, _] = hexapods();
    let mut rng = rng(6);
    for _ in 0..2000 {
        let pose = (hexapod.sample)(&mut rng);
        let n = directions(&folded, &pose);
        let a = literal.at(&pose, &NO_TOOL).unwrap().corrections();
        let b = folded.at(&pose, &NO_TOOL).unwrap().corrections();
        for i in 0..6 {
            let expected = printed(&struts[i], &n[i], &pose);
            assert!((a[i] - expected).abs() < GOLDEN_JOINT, "{pose:?}");
            assert!((b[i] - expected).abs() < GOLDEN_JOINT, "{pose:?}");
        }
    }
}

#[test]
fn correction_is_continuous_beyond_a_quarter_turn_where_the_arcsin_folds() {
    let given = paper_004(10.0);
    let (folded, literal) = (machine(&given), machine(&without_home(&given)));
    let at = |m: &Machine, c: f64| {
        m.at(&Pose::from_degrees([0.0, 0.0, 250.0, 0.0, 0.0, c]), &NO_TOOL).unwrap().corrections()
            [0]
    };
    let step = 0.5;
    let (mut largest, mut folds) = (0.0_f64, false);
    for k in 0..320 {
        let (c, d) = (f64::from(k) * step, f64::from(k + 1) * step);
        largest = largest.max((at(&folded, d) - at(&folded, c)).abs());
        folds |= (at(&literal, d) - at(&literal, c)) * (at(&folded, d) - at(&folded, c)) < 0.0;
    }
    // A screw of 10 mm lead gains about 10/360 mm per degree of torsion; the torsion of a
    // strut is at most a few times the rotation of the platform.
    assert!(largest < 10.0 * 10.0 / 360.0 * step, "{largest}");
    assert!(folds, "the arcsin does fold in this range");
}

/// Tests rotations about the vertical that rotate each strut through half a turn.
#[test]
fn a_correction_never_jumps_by_a_lead_without_a_refusal_in_between() {
    let folded = machine(&paper_004(10.0));
    let step = 0.05;
    let (mut refused, mut jumps) = (0, 0);
    let mut last: Option<[f64; 8]> = None;
    let mut before = [0.0; 8];
    for k in 0..7200 {
        let c = f64::from(k) * step;
        let pose = Pose::from_degrees([20.0, -30.0, 250.0, 5.0, 3.0, c]);
        match folded.at(&pose, &NO_TOOL).map(|at| at.corrections()) {
            Ok(here) => {
                let change = |from: [f64; 8]| (0..6).map(move |i| (here[i] - from[i]).abs());
                // 10/360 mm per degree of torsion, which is at most a few times the rotation.
                let most = 10.0 * 10.0 / 360.0 * step;
                assert!(last.is_none_or(|last| change(last).all(|c| c <= most)), "{c}");
                // A lead minus the correction of the degrees between them, some 33.
                jumps += u32::from(change(before).any(|c| c > 8.5));
                (last, before) = (Some(here), here);
            }
            Err(fault) => {
                assert_eq!(fault.cause, Cause::TorsionTooLarge, "{c}");
                assert!(fault.value.abs() > 170.0 && fault.value.abs() <= 180.0, "{fault:?}");
                let joints = folded.inverse(&pose, &NO_TOOL);
                assert_eq!(joints, Err(fault));
                refused += 1;
                last = None;
            }
        }
    }
    assert!(refused > 0 && jumps > 0, "{refused} refused, {jumps} jumps");
}

#[test]
fn a_right_hand_screw_gets_shorter_when_the_platform_turns_with_the_strut_direction() {
    // One strut straight up: rotating the platform by +c about n unscrews a right-hand
    // nut by c/360 of the lead, so the motor must compensate that length.
    let given = paper_004(10.0);
    let mut base: [_; 6] = std::array::from_fn(|i| given.legs()[i].base);
    let mut platform: [_; 6] = std::array::from_fn(|i| given.legs()[i].platform);
    base[0] = [0.0, 0.0, 0.0];
    platform[0] = [0.0, 0.0, 0.0];
    let mut struts = struts(&given);
    struts[0] =
        StrutGeometry { base_axis: [1.0, 0.0, 0.0], platform_axis: [-1.0, 0.0, 0.0], lead: 10.0 };
    let m = machine(&hexapod(base, platform, struts, given.home));
    let turned = Pose::from_degrees([0.0, 0.0, 250.0, 0.0, 0.0, 36.0]);
    assert!((m.at(&turned, &NO_TOOL).unwrap().corrections()[0] + 1.0).abs() < 1e-12);
    assert!((m.inverse(&turned, &NO_TOOL).unwrap()[0] - 249.0).abs() < 1e-12);
}

#[test]
fn equal_senses_and_a_negative_lead_are_the_same_screw_as_opposed_senses() {
    let given = paper_004(10.0);
    let other = with_struts(
        &given,
        struts(&given).map(|s| StrutGeometry {
            platform_axis: s.platform_axis.map(|v| -v),
            lead: -s.lead,
            ..s
        }),
    );
    let pose = Pose::from_degrees([50.0, 100.0, 120.0, -15.0, 12.0, 8.0]);
    let a = machine(&given).inverse(&pose, &NO_TOOL).unwrap();
    let b = machine(&other).inverse(&pose, &NO_TOOL).unwrap();
    for i in 0..6 {
        assert!((a[i] - b[i]).abs() < GOLDEN_JOINT);
    }
}

#[test]
fn pure_translation_of_parallel_axes_needs_no_correction() {
    let given = paper_004(10.0);
    let corrections = machine(&given)
        .at(&Pose::from_degrees([100.0, -50.0, 150.0, 0.0, 0.0, 0.0]), &NO_TOOL)
        .unwrap()
        .corrections();
    assert!(corrections.iter().all(|c| c.abs() < 1e-12), "{corrections:?}");
}

#[test]
fn axes_of_any_length_give_the_same_joints() {
    let given = paper_004(10.0);
    let longer = with_struts(
        &given,
        struts(&given).map(|s| StrutGeometry {
            base_axis: s.base_axis.map(|v| 1e200 * v),
            platform_axis: s.platform_axis.map(|v| 1e-200 * v),
            ..s
        }),
    );
    let pose = Pose::from_degrees([50.0, 100.0, 120.0, -15.0, 12.0, 8.0]);
    let a = machine(&given).inverse(&pose, &NO_TOOL).unwrap();
    let b = machine(&longer).inverse(&pose, &NO_TOOL).unwrap();
    for i in 0..6 {
        assert!((a[i] - b[i]).abs() < GOLDEN_JOINT);
    }
}

#[test]
fn a_reference_pose_near_a_quarter_turn_is_refused() {
    let given = paper_004(10.0);
    let turned = with_struts(
        &given,
        struts(&given).map(|s| StrutGeometry {
            platform_axis: [-s.platform_axis[1], s.platform_axis[0], s.platform_axis[2]],
            ..s
        }),
    );
    let fault = Machine::freeze(&turned, &NO_OFFSET).unwrap_err();
    assert_eq!((fault.cause, fault.number()), (Cause::FoldUndefined, Some(0)));
}

#[test]
fn a_strut_along_its_joint_axis_is_refused_with_its_number() {
    let given = paper_004(10.0);
    let home = Pose::from_degrees(given.home.unwrap());
    let n = directions(&machine(&given), &home);
    let mut screws = struts(&given);
    screws[3].base_axis = n[3].into();
    let m = machine(&without_home(&with_struts(&given, screws)));
    let fault = m.inverse(&home, &NO_TOOL).unwrap_err();
    assert_eq!((fault.cause, fault.number()), (Cause::StrutAlongAxis, Some(3)));
}
