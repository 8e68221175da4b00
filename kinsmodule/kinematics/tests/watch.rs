// SPDX-License-Identifier: GPL-2.0-or-later
//! Monitored values at a pose, compared with those computed from the ends of the legs alone.

use crate::common::machines::{declared, on_circle, paper_004, strut, with_legs};
use crate::common::{Case, NO_TOOL, cases, rng, uniform};
use kinematics::{Cause, Limits, MAX_LEGS, Machine, Pose, Segment, Vector3, Watch};
use nalgebra::SMatrix;
use rand_pcg::Pcg64;

/// Rounding of angles in degrees: acos of a number near 1 loses half of the digits.
const ANGLE: f64 = 2e-6;

fn each_pose(seed: u64, mut check: impl FnMut(&Case, &Watch, &Pose, &[Segment; 8], &mut Pcg64)) {
    for case in declared() {
        let mut rng = rng(seed);
        let watch = case.machine.watch();
        for _ in 0..cases(100).max(10) {
            let pose = (case.sample)(&mut rng);
            let legs =
                *case.machine.at(&pose, &NO_TOOL).expect("a pose of the workspace").segments();
            check(&case, watch, &pose, &legs, &mut rng);
        }
    }
}

/// Returns whether two legs of a machine meet in a common anchor.
fn meet(case: &Case, i: usize, j: usize) -> bool {
    let legs = case.geometry.legs();
    let stand = [i, j].iter().all(|k| legs[*k].kind.stands());
    legs[i].platform == legs[j].platform || (stand && legs[i].base == legs[j].base)
}

#[test]
fn the_nearest_pair_is_the_one_that_the_distances_of_all_that_do_not_meet_say() {
    let (mut found, mut none) = (0, 0);
    each_pose(81, |case, watch, _, legs, _| {
        let count = case.geometry.legs().len();
        let mut least = f64::INFINITY;
        for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
            assert_eq!(
                watch.is_watched([i, j]),
                i < j && !meet(case, i, j),
                "{} {i} {j}",
                case.name
            );
            if i < j && !meet(case, i, j) {
                least = least.min(legs[i].distance(&legs[j]));
            }
        }
        assert!(!watch.is_watched([0, MAX_LEGS]) && !watch.is_watched([count, count]));
        match watch.nearest(legs) {
            Some(nearest) => {
                let [i, j] = nearest.pair;
                assert!(watch.is_watched([i, j]));
                assert_eq!(nearest.distance, legs[i].distance(&legs[j]));
                assert_eq!(nearest.distance, least);
                found += 1;
            }
            None => {
                assert_eq!(least, f64::INFINITY, "{}", case.name);
                none += 1;
            }
        }
    });
    assert!(found > 0 && none > 0, "{found} {none}");
}

#[test]
fn struts_that_meet_in_base_or_platform_are_not_watched() {
    let at = |degrees: f64, z: f64| on_circle(300.0, degrees, z);
    let legs = [
        strut(at(0.0, 0.0), at(60.0, 0.0)),
        strut(at(0.0, 0.0), at(-60.0, 0.0)),
        strut(at(120.0, 0.0), at(60.0, 0.0)),
        strut(at(120.0, 0.0), at(180.0, 0.0)),
        strut(at(240.0, 0.0), at(180.0, 0.0)),
        strut(at(240.0, 0.0), at(-60.0, 0.0)),
    ];
    let geometry = with_legs(&paper_004(0.0), &legs);
    let machine = Machine::freeze(&geometry, &[0.0; MAX_LEGS]).expect("an octahedron");
    let watch = machine.watch();
    let watched = |i: usize| (0..6).filter(|j| watch.is_watched([i, *j])).collect::<Vec<_>>();
    let found: Vec<_> = (0..6).map(watched).collect();
    assert_eq!(found, [vec![3, 4, 5], vec![2, 3, 4], vec![4, 5], vec![5], vec![], vec![]]);
}

fn degrees_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    (a.dot(b) / (a.norm() * b.norm())).clamp(-1.0, 1.0).acos().to_degrees()
}

#[test]
fn cones_are_the_angles_to_the_direction_at_home_in_base_and_platform() {
    each_pose(82, |case, watch, pose, legs, _| {
        let home = Pose::from_degrees(case.geometry.home.expect("a reference pose"));
        let then = *case.machine.at(&home, &NO_TOOL).expect("a pose").segments();
        let cones = watch.cones(&pose.rotation(), legs);
        for i in 0..case.geometry.legs().len() {
            let (now, then) = (legs[i].platform - legs[i].base, then[i].platform - then[i].base);
            let in_platform = pose.rotation().transpose() * now;
            let expected = [degrees_between(&now, &then), degrees_between(&in_platform, &then)];
            for (found, expected) in [cones.base[i], cones.platform[i]].iter().zip(expected) {
                assert!((found - expected).abs() < ANGLE, "{}: {found} {expected}", case.name);
            }
        }
    });
}

/// Tests that the platform joints measure the legs from the platform, whatever its orientation at the reference pose.
#[test]
fn with_a_tilted_reference_pose_cones_are_0_there_and_stay_so_while_all_of_it_turns() {
    let mut geometry = paper_004(0.0);
    geometry.home = Some([30.0, -20.0, 260.0, 12.0, -9.0, 7.0]);
    let machine = Machine::freeze(&geometry, &[0.0; MAX_LEGS]).expect("a machine");
    let watch = machine.watch();
    let home = Pose::from_degrees(geometry.home.expect("just given"));
    let legs = *machine.at(&home, &NO_TOOL).expect("a pose").segments();
    let there = watch.cones(&home.rotation(), &legs);
    assert!(there.base.iter().chain(&there.platform).all(|angle| *angle < ANGLE), "{there:?}");
    // If legs rotate with the platform only the base joints are affected.
    let by = Pose::from_degrees([0.0, 0.0, 0.0, 0.0, 0.0, 25.0]).rotation();
    let turned = legs.map(|leg| Segment { base: by * leg.base, platform: by * leg.platform });
    let cones = watch.cones(&(by * home.rotation()), &turned);
    assert!(cones.platform.iter().all(|angle| *angle < ANGLE), "{cones:?}");
    assert!(cones.base[..6].iter().all(|angle| *angle > 5.0), "{cones:?}");
}

#[test]
fn without_a_reference_pose_there_are_no_cones() {
    let mut geometry = paper_004(0.0);
    let home = Pose::from_degrees(geometry.home.expect("a reference pose"));
    geometry.home = None;
    let machine = Machine::freeze(&geometry, &[0.0; MAX_LEGS]).expect("a machine");
    let legs = *machine.at(&home, &NO_TOOL).expect("a pose").segments();
    let cones = machine.watch().cones(&home.rotation(), &legs);
    assert_eq!((cones.base, cones.platform), ([0.0; MAX_LEGS], [0.0; MAX_LEGS]));
}

#[test]
fn conditioning_is_the_smallest_singular_value_of_the_legs_as_unit_forces() {
    for case in declared() {
        let active = |k: usize| {
            case.machine.layout().coordinates().as_slice().iter().any(|l| l.index() == k)
        };
        // With one or two angles the columns are those of the angles; if the legs do not move
        // all of X, Y, Z the moments are about another point.
        let plain = (3..6).all(active) || !(3..6).any(active);
        if !plain || !(0..3).all(active) {
            continue;
        }
        let mut rng = rng(83);
        let count = case.geometry.legs().len();
        for _ in 0..cases(50).max(5) {
            let pose = (case.sample)(&mut rng);
            let legs = *case.machine.at(&pose, &NO_TOOL).expect("a pose").segments();
            let middle = (0..count).map(|i| legs[i].platform).sum::<Vector3<f64>>() / count as f64;
            let rows = SMatrix::<f64, 8, 6>::from_fn(|i, k| {
                if i >= count || !active(k) {
                    return 0.0;
                }
                let u = (legs[i].platform - legs[i].base).normalize();
                let moment = (legs[i].platform - middle).cross(&u) / case.machine.radius();
                if k < 3 { u[k] } else { moment[k - 3] }
            });
            let size = (0..6).filter(|k| active(*k)).count();
            let mut values: Vec<f64> = rows.singular_values().iter().copied().collect();
            values.sort_by(|a, b| b.total_cmp(a));
            let found = case.machine.at(&pose, &NO_TOOL).expect("a pose").smallest_singular_value();
            // Rounding of numbers of size 1, in some rotations each.
            assert!((found - values[size - 1]).abs() < 1e-12, "{}: {found} {values:?}", case.name);
        }
    }
}

#[test]
fn a_leg_beyond_its_cone_and_legs_too_near_are_reported_at_standstill() {
    let mut counted = [0; 3];
    each_pose(84, |case, watch, pose, legs, rng| {
        let at = |limits: &Limits| case.machine.nowhere().here(&NO_TOOL, limits, pose);
        assert_eq!(at(&Limits::NONE), None, "{}", case.name);
        let cones = watch.cones(&pose.rotation(), legs);
        let leg = uniform(rng, 0.0, case.geometry.legs().len() as f64) as usize;
        for (k, (angle, cause)) in [
            (cones.base[leg], Cause::BaseConeAhead),
            (cones.platform[leg], Cause::PlatformConeAhead),
        ]
        .into_iter()
        .enumerate()
        {
            let limited = |limit: f64| {
                let mut limits = Limits::NONE;
                let cone = if k == 0 { &mut limits.base_cone } else { &mut limits.platform_cone };
                cone[leg] = limit;
                at(&limits)
            };
            if angle > 0.1 {
                assert_eq!(limited(angle * 1.001), None);
                let fault = limited(angle * 0.999).expect("beyond the cone");
                assert_eq!(
                    (fault.cause, fault.number(), fault.value),
                    (cause, Some(leg as u8), angle)
                );
                counted[k] += 1;
            }
        }
        let near = |clearance: f64| at(&Limits { clearance, ..Limits::NONE });
        if let Some(nearest) = watch.nearest(legs).filter(|n| n.distance > 0.0) {
            assert_eq!(near(nearest.distance), None);
            let fault = near(nearest.distance * 1.001).expect("too near");
            let found = (fault.cause, fault.number(), fault.value);
            assert_eq!(found, (Cause::LegsNear, Some(nearest.pair[0] as u8), nearest.distance));
            counted[2] += 1;
        } else {
            assert_eq!(near(1e9), None);
        }
    });
    assert!(counted.iter().all(|count| *count > 0), "{counted:?}");
}

#[test]
fn an_invalid_pose_is_refused_with_its_own_cause() {
    let case = &declared()[0];
    let mut far = case.home;
    far.position.x = f64::INFINITY;
    let fault = case.machine.nowhere().here(&NO_TOOL, &Limits::NONE, &far).expect("no pose");
    assert_eq!(fault.cause, Cause::PoseNotFinite);
}
