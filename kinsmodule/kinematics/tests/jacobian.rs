// SPDX-License-Identifier: GPL-2.0-or-later
//! Jacobians against central differences of inverse.

mod common;

use common::tolerances::CENTRAL_DIFFERENCE;
use common::{cases, geometry, paper_004, rng, shipped, uniform};
use kinematics::leg::StrutGeometry;
use kinematics::{Machine, Pose, Vector3};
use rand_pcg::Pcg64;

const STEP: f64 = 1e-4;

/// Largest difference between the pose Jacobian and central differences, mm per mm and degree.
fn largest_difference(machine: &Machine<6>, pose: &Pose, tool: &Vector3<f64>) -> f64 {
    let jacobian = machine.pose_jacobian(pose, tool).unwrap();
    let at = |k: usize, h: f64| {
        let mut v = pose.to_degrees();
        v[k] += h;
        machine.inverse(&Pose::from_degrees(v), tool).unwrap()
    };
    let mut largest = 0.0_f64;
    for k in 0..6 {
        let (plus, minus) = (at(k, STEP), at(k, -STEP));
        for i in 0..6 {
            let difference = (plus[i] - minus[i]) / (2.0 * STEP);
            largest = largest.max((difference - jacobian[(i, k)]).abs());
        }
    }
    largest
}

#[test]
fn pose_jacobian_matches_central_differences_with_lead_and_tilted_tool() {
    let tool = Vector3::new(12.0, -7.0, 80.0);
    for case in shipped() {
        let mut rng = rng(4);
        for _ in 0..cases(1000) {
            let pose = (case.sample)(&mut rng);
            let difference = largest_difference(&case.machine, &pose, &tool);
            assert!(difference < CENTRAL_DIFFERENCE, "{}: {pose:?}: {difference:e}", case.name);
        }
    }
}

/// Paper 004 with axes in random directions and struts of different leads and hands.
fn random_screws(rng: &mut Pcg64) -> ([StrutGeometry; 6], Machine<6>) {
    let plain = paper_004(0.0);
    let struts = std::array::from_fn(|_| StrutGeometry {
        base_axis: std::array::from_fn(|_| uniform(rng, -1.0, 1.0)),
        platform_axis: std::array::from_fn(|_| uniform(rng, -1.0, 1.0)),
        lead: uniform(rng, -20.0, 20.0),
    });
    let given = geometry(plain.legs.map(|l| l.base), plain.legs.map(|l| l.platform), struts, None);
    (struts, Machine::freeze(&given, &[0.0; 6]).unwrap())
}

/// Whether differences of this step say anything: no strut near one of its joint axes,
/// no twist near the quarter turn where the arcsin folds.
fn is_smooth(struts: &[StrutGeometry; 6], machine: &Machine<6>, pose: &Pose) -> bool {
    let Ok(directions) = machine.directions(pose, &Vector3::zeros()) else { return false };
    struts.iter().zip(directions).all(|(strut, n)| {
        let a = Vector3::from(strut.base_axis).normalize();
        let b = (pose.rotation() * Vector3::from(strut.platform_axis)).normalize();
        let (alpha, beta) = (a.dot(&n), b.dot(&n));
        let (sine, cosine) = (n.dot(&a.cross(&b)), a.dot(&b) - alpha * beta);
        alpha.abs() < 0.97 && beta.abs() < 0.97 && cosine.abs() > 0.02 * sine.hypot(cosine)
    })
}

#[test]
fn the_nut_gradient_is_exact_for_any_axes_leads_and_hands() {
    let mut rng = rng(5);
    let [hexapod, _] = shipped();
    let tool = Vector3::zeros();
    let mut checked = 0;
    for _ in 0..cases(1000) {
        let (struts, machine) = random_screws(&mut rng);
        let pose = (hexapod.sample)(&mut rng);
        if is_smooth(&struts, &machine, &pose) {
            let difference = largest_difference(&machine, &pose, &tool);
            assert!(difference < CENTRAL_DIFFERENCE, "{struts:?} {pose:?}: {difference:e}");
            checked += 1;
        }
    }
    assert!(checked * 2 > cases(1000), "only {checked} were smooth");
}

#[test]
fn the_twist_jacobian_is_the_pose_jacobian_at_a_level_pose_without_turns() {
    let [hexapod, _] = shipped();
    let of_twist = hexapod.machine.inverse_jacobian(&hexapod.home, &Vector3::zeros()).unwrap();
    let of_pose = hexapod.machine.pose_jacobian(&hexapod.home, &Vector3::zeros()).unwrap();
    for i in 0..6 {
        for k in 0..6 {
            let unit = if k < 3 { 1.0 } else { 1.0_f64.to_radians() };
            // 1e-13: a few roundings of numbers below 200.
            assert!((of_twist[(i, k)] * unit - of_pose[(i, k)]).abs() < 1e-13);
        }
    }
}
