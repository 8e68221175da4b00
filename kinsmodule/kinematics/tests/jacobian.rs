// SPDX-License-Identifier: GPL-2.0-or-later
//! Jacobians against central differences of inverse.

use crate::common::machines::{changed_legs, declared, hexapods, letters, paper_004, strut};
use crate::common::random::{RECIPES, draw};
use crate::common::tolerances::CENTRAL_DIFFERENCE;
use crate::common::{Case, NO_OFFSET, cases, rng, uniform};
use kinematics::leg::StrutGeometry;
use kinematics::{Geometry, Jacobian, LegGeometry, LegKind, Letter, Machine, Pose, Vector3};
use nalgebra::Rotation3;
use rand_pcg::Pcg64;

/// Step of the differences, in thousandths of the size and in degrees; taken twice, with
/// twice the step, so that the error term in step² cancels.
const STEP: f64 = 1e-4;

/// Returns the same machine with all angles free, in addition to its own letters: legs are added for
/// the letters to fit, which changes no row of the existing legs. Differences of
/// inverse then exist for held angles too.
fn with_angles_free(given: &Geometry) -> Machine {
    let layout = given.layout();
    let mut coordinates = String::from("ABC");
    for letter in [Letter::X, Letter::Y, Letter::Z] {
        if layout.coordinates().contains(letter) {
            coordinates.push(letter.name());
        }
    }
    let mut legs = given.legs().to_vec();
    while legs.len() < coordinates.len() {
        let (mut base, mut platform) = (given.legs()[0].base, given.legs()[0].platform);
        let size = base.iter().fold(1.0, |m: f64, v| m.max(v.abs()));
        platform[(legs.len() + 1) % 3] += 0.2 * size;
        base[2] -= size;
        legs.push(strut(base, platform));
    }
    let mut free = Geometry::new(&legs, letters(&coordinates), *layout.table()).unwrap();
    free.centre = given.centre;
    // Screws are folded as at home; without screws the added legs need not constrain the platform.
    free.home = given.home.filter(|_| legs.iter().any(is_screw));
    Machine::freeze(&free, &NO_OFFSET).unwrap()
}

fn is_screw(leg: &LegGeometry) -> bool {
    matches!(leg.kind, LegKind::Strut(strut) if strut.lead != 0.0)
}

/// Returns the largest error of a Jacobian against differences of inverse along `change`, all lengths
/// in thousandths of the size and angles in degrees; for rows with elements above 1 as a
/// fraction of the largest: near a dead point joints are fast, and their curvature is as large. `None` if
/// the legs do not reach the neighbors of the pose.
fn largest_difference(
    case: &Case,
    free: &Machine,
    pose: &Pose,
    tool: &Vector3<f64>,
    jacobian: &Jacobian,
    change: impl Fn(&Pose, usize, f64) -> Pose,
) -> Option<f64> {
    let layout = case.machine.layout();
    let length = case.machine.size() / 1000.0;
    let mut largest = 0.0_f64;
    for i in 0..layout.joints() {
        // Legs of `free` beyond those of the machine precede its table axes.
        let j = if i < layout.legs() { i } else { i + free.layout().legs() - layout.legs() };
        let joint = if case.is_angle(i) { 1.0 } else { length };
        let (mut error, mut fast) = (0.0_f64, 1.0_f64);
        for k in 0..6 {
            let coordinate = if k < 3 { length } else { 1.0 };
            // A held X, Y or Z does not affect the legs: there is nothing to take differences of.
            let difference = if k < 3 && layout.is_held(Letter::ALL[k]) {
                0.0
            } else {
                let at = |by: f64| Some(free.inverse(&change(pose, k, by), tool).ok()?[j]);
                let slope = |step: f64| Some((at(step)? - at(-step)?) / (2.0 * step));
                let step = STEP * coordinate;
                (4.0 * slope(step)? - slope(2.0 * step)?) / 3.0
            };
            let unit = joint / coordinate;
            error = error.max((difference - jacobian[(i, k)]).abs() / unit);
            fast = fast.max(jacobian[(i, k)].abs() / unit);
        }
        largest = largest.max(error / fast);
    }
    Some(largest)
}

/// Changes a pose coordinate by a length or by degrees.
fn coordinate(pose: &Pose, k: usize, by: f64) -> Pose {
    let mut v = pose.to_degrees();
    v[k] += by;
    Pose::from_degrees(v)
}

/// Moves the platform along, or rotates it about, an axis of base through the control point.
fn twisted(pose: &Pose, k: usize, by: f64) -> Pose {
    if k < 3 {
        return coordinate(pose, k, by);
    }
    let mut axis = Vector3::zeros();
    axis[k - 3] = by.to_radians();
    let r = Rotation3::new(axis).matrix() * pose.rotation();
    let b = (-r[(2, 0)]).atan2(r[(0, 0)].hypot(r[(1, 0)]));
    let angles = Vector3::new(r[(2, 1)].atan2(r[(2, 2)]), b, r[(1, 0)].atan2(r[(0, 0)]));
    Pose { angles, ..*pose }
}

impl Case {
    fn is_angle(&self, joint: usize) -> bool {
        self.geometry.legs().get(joint).is_some_and(|leg| leg.kind.is_angular())
    }
}

/// Returns a tool of some tenths of the size, off the axis.
fn tool_of(case: &Case) -> Vector3<f64> {
    Vector3::new(0.02, -0.012, 0.14) * case.machine.size()
}

/// Checks both Jacobians of a machine at a pose, if the pose and its neighbors are reached.
fn check(case: &Case, free: &Machine, pose: &Pose) -> Option<f64> {
    let tool = tool_of(case);
    let at = case.machine.at(pose, &tool).ok()?;
    let (of_pose, of_twist) = (at.pose_jacobian().ok()?, at.inverse_jacobian().unwrap());
    let mut per_degree = of_twist;
    per_degree.fixed_columns_mut::<3>(3).scale_mut(1.0_f64.to_radians());
    let a = largest_difference(case, free, pose, &tool, &of_pose, coordinate)?;
    let b = largest_difference(case, free, pose, &tool, &per_degree, twisted)?;
    Some(a.max(b))
}

#[test]
fn both_jacobians_match_central_differences_on_every_machine_with_tool_and_centre() {
    for case in declared() {
        let free = with_angles_free(&case.geometry);
        let mut rng = rng(4);
        let mut worst = 0.0_f64;
        let mut checked = 0;
        for _ in 0..cases(1000) {
            let pose = (case.sample)(&mut rng);
            if let Some(difference) = check(&case, &free, &pose) {
                worst = worst.max(difference);
                checked += 1;
            }
        }
        println!("{}: {worst:.1e} over {checked}", case.name);
        assert!(worst < CENTRAL_DIFFERENCE, "{}: {worst:e}", case.name);
        // The long tool moves some poses of the rods' machines out of reach.
        assert!(checked * 2 > cases(1000), "{}: only {checked} were reached", case.name);
    }
}

#[test]
fn both_jacobians_match_central_differences_on_random_machines_of_every_kind() {
    let mut rng = rng(40);
    for recipe in RECIPES {
        let mut worst = 0.0_f64;
        let mut checked = 0;
        for _ in 0..cases(200) {
            let case = draw(&mut rng, recipe);
            let free = with_angles_free(&case.geometry);
            let pose = (case.sample)(&mut rng);
            if let Some(difference) = check(&case, &free, &pose) {
                worst = worst.max(difference);
                checked += 1;
            }
        }
        println!("{}: {worst:.1e} over {checked}", recipe.name);
        assert!(worst < CENTRAL_DIFFERENCE, "{}: {worst:e}", recipe.name);
        assert!(checked * 2 > cases(200), "{}: only {checked} were reached", recipe.name);
    }
}

#[test]
fn table_rows_and_columns_are_those_of_a_slide_under_the_work() {
    let case = crate::common::machines::pyramid();
    let mut rng = rng(41);
    for _ in 0..200 {
        let pose = (case.sample)(&mut rng);
        let j = case.machine.at(&pose, &Vector3::zeros()).unwrap().pose_jacobian().unwrap();
        // X and Y move their slide one to one, and no leg.
        for row in 0..4 {
            assert_eq!((j[(row, 0)], j[(row, 1)]), (0.0, 0.0));
        }
        assert_eq!((j[(4, 0)], j[(4, 1)], j[(4, 2)]), (1.0, 0.0, 0.0));
        assert_eq!((j[(5, 0)], j[(5, 1)], j[(5, 2)]), (0.0, 1.0, 0.0));
        // Rows beyond the joints are empty.
        assert!(j.rows(6, 5).iter().all(|v| *v == 0.0));
    }
}

/// Returns paper 004 with axes in random directions and struts of different leads and hands.
fn random_screws(rng: &mut Pcg64) -> ([StrutGeometry; 6], Case) {
    let struts: [_; 6] = std::array::from_fn(|_| StrutGeometry {
        base_axis: std::array::from_fn(|_| uniform(rng, -1.0, 1.0)),
        platform_axis: std::array::from_fn(|_| uniform(rng, -1.0, 1.0)),
        lead: uniform(rng, -20.0, 20.0),
    });
    let mut given = changed_legs(&paper_004(0.0), |i, leg| leg.kind = LegKind::Strut(struts[i]));
    given.home = None;
    let machine = Machine::freeze(&given, &NO_OFFSET).unwrap();
    let [hexapod, _] = hexapods();
    (struts, Case { geometry: given, machine, ..hexapod })
}

/// Returns whether differences of this step are meaningful: no strut near one of its joint axes,
/// no torsion near the quarter turn where the arcsin folds.
fn is_smooth(struts: &[StrutGeometry; 6], machine: &Machine, pose: &Pose) -> bool {
    let Ok(segments) = machine.at(pose, &Vector3::zeros()).map(|at| *at.segments()) else {
        return false;
    };
    struts.iter().zip(segments).all(|(strut, segment)| {
        let n = (segment.platform - segment.base).normalize();
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
    let tool = Vector3::zeros();
    let mut checked = 0;
    for _ in 0..cases(1000) {
        let (struts, case) = random_screws(&mut rng);
        let pose = (case.sample)(&mut rng);
        if is_smooth(&struts, &case.machine, &pose) {
            let jacobian = case.machine.at(&pose, &tool).unwrap().pose_jacobian().unwrap();
            let machine = &case.machine;
            let difference =
                largest_difference(&case, machine, &pose, &tool, &jacobian, coordinate).unwrap();
            assert!(difference < CENTRAL_DIFFERENCE, "{struts:?} {pose:?}: {difference:e}");
            checked += 1;
        }
    }
    assert!(checked * 2 > cases(1000), "only {checked} were smooth");
}

#[test]
fn the_twist_jacobian_is_the_pose_jacobian_at_a_level_pose_without_turns() {
    for case in declared() {
        let at = case.machine.at(&case.home, &Vector3::zeros()).unwrap();
        let (of_twist, of_pose) = (at.inverse_jacobian().unwrap(), at.pose_jacobian().unwrap());
        for i in 0..case.machine.layout().joints() {
            for k in 0..6 {
                let unit = if k < 3 { 1.0 } else { 1.0_f64.to_radians() };
                // 1e-13: a few rounding errors of numbers below 200.
                assert!((of_twist[(i, k)] * unit - of_pose[(i, k)]).abs() < 1e-13);
            }
        }
    }
}

#[test]
fn a_speed_ratio_is_the_largest_rate_that_a_unit_velocity_gives_a_joint() {
    let mut rng = rng(29);
    for case in declared() {
        let at = case.machine.at(&(case.sample)(&mut rng), &Vector3::zeros()).unwrap();
        let (ratios, jacobian) = (at.speed_ratios().unwrap(), at.inverse_jacobian().unwrap());
        for (i, ratio) in ratios.iter().enumerate() {
            // 1e-13: a few rounding errors of numbers below 200.
            let expected = jacobian.fixed_view::<1, 3>(i, 0).norm();
            assert!((ratio - expected).abs() < 1e-13, "{}: {ratio} {expected}", case.name);
        }
    }
}
