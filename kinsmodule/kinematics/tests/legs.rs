// SPDX-License-Identifier: GPL-2.0-or-later
//! The equations of the legs against independent formulas.

use crate::common::machines::{
    declared, four_rod_lathe, geometry, linear_delta, pyramid, six_rod_lathe, slider,
};
use crate::common::random::{Draw, RECIPES, Recipe, draw};
use crate::common::reference::{along_ring, rod};
use crate::common::tolerances::GOLDEN_JOINT;
use crate::common::{Case, NO_OFFSET, NO_TOOL, cases, rng};
use kinematics::leg::{CrankGeometry, SliderGeometry};
use kinematics::{LEAST_DRIVE, LegGeometry, LegKind, Machine, Pose, Solver, Vector3};

/// A few rounding errors of lengths of the machine's size.
const LENGTH: f64 = 1e-13;

/// Checks that every leg of a reached pose joins the points given by its joint, on its side.
fn check(case: &Case, pose: &Pose, tool: &Vector3<f64>) -> Option<()> {
    let joints = case.machine.inverse(pose, tool).ok()?;
    let at = case.machine.at(pose, tool).unwrap();
    let (segments, corrections) = (at.segments(), at.corrections());
    let layout = case.machine.layout();
    // D = t − o + R (o + center); table and held letters do not affect the legs.
    let centre = Vector3::from(case.geometry.centre);
    let r = pose.rotation();
    let d = pose.position - tool + r * (tool + centre);
    let mut of_legs = d;
    for letter in &kinematics::Letter::ALL[..3] {
        if !layout.coordinates().contains(*letter) {
            of_legs[letter.index()] = 0.0;
        }
    }
    let most = LENGTH * case.machine.size();
    for (i, leg) in case.geometry.legs().iter().enumerate() {
        let p = of_legs + r * (Vector3::from(leg.platform) - centre);
        let p = p + along_ring(leg, &p, &r);
        assert!((segments[i].platform - p).norm() < 10.0 * most, "{}: {i}", case.name);
        let native = joints[i] - corrections[i];
        let at = rod(leg, native);
        assert!((segments[i].base - at.anchor).norm() < 10.0 * most, "{}: {i}", case.name);
        let span = p - at.anchor;
        // A rod's position on its guide is exact to rounding over the cosine to its motion.
        assert!((span.norm() - at.length).abs() < 100.0 * most, "{}: leg {i} {span:?}", case.name);
        if !leg.kind.stands() {
            let drive = span.normalize().dot(&at.onwards);
            // Minus rounding: nearer to the dead point inverse refuses.
            assert!(
                drive > 0.998 * LEAST_DRIVE,
                "{}: leg {i} stands on its other side: {drive}",
                case.name
            );
        }
    }
    for (i, letter) in layout.table().as_slice().iter().enumerate() {
        let joint = joints[layout.legs() + i];
        assert!((joint - d[letter.index()]).abs() < 10.0 * most, "{}", case.name);
    }
    assert!(joints[layout.joints()..].iter().all(|q| *q == 0.0));
    Some(())
}

#[test]
fn every_leg_joins_the_points_that_its_joint_says_on_its_own_side() {
    let mut rng = rng(30);
    for case in declared() {
        let tool = Vector3::new(0.02, -0.012, 0.1) * case.machine.size();
        let mut reached = 0;
        for _ in 0..cases(10_000) {
            let pose = (case.sample)(&mut rng);
            check(&case, &pose, &NO_TOOL).expect("the declared workspace is reached");
            reached += usize::from(check(&case, &pose, &tool).is_some());
        }
        assert!(reached * 2 > cases(10_000), "{}: {reached} with a tool", case.name);
    }
    for recipe in RECIPES {
        let mut reached = 0;
        for _ in 0..cases(300) {
            let case = draw(&mut rng, recipe);
            let pose = (case.sample)(&mut rng);
            reached += usize::from(check(&case, &pose, &Vector3::new(9.0, -7.0, 80.0)).is_some());
        }
        assert!(reached * 2 > cases(300), "{}: {reached}", recipe.name);
    }
}

fn slider_of(leg: &LegGeometry) -> SliderGeometry {
    let LegKind::Slider(slider) = leg.kind else { panic!("a slider") };
    slider
}

/// Returns the platform anchors of a machine without table or held X, Y, Z.
fn platform_anchor(leg: &LegGeometry, pose: &Pose) -> Vector3<f64> {
    pose.position + pose.rotation() * Vector3::from(leg.platform)
}

/// Tests paper 003, equation 13 with l²: guides along z.
#[test]
fn carriages_on_guides_along_z_stand_where_paper_003_says() {
    let mut rng = rng(31);
    for case in [four_rod_lathe(), six_rod_lathe(), linear_delta()] {
        for _ in 0..cases(1000) {
            let pose = (case.sample)(&mut rng);
            let joints = case.joints(&pose);
            for (i, leg) in case.geometry.legs().iter().enumerate() {
                let slider = slider_of(leg);
                let p = platform_anchor(leg, &pose);
                let (x, y) = (p.x - leg.base[0], p.y - leg.base[1]);
                let root = (slider.rod * slider.rod - x * x - y * y).sqrt();
                let expected = p.z + f64::from(slider.side) * root - leg.base[2];
                assert!((joints[i] - expected).abs() < GOLDEN_JOINT, "{}: {pose:?}", case.name);
            }
        }
    }
}

/// Tests paper 003, equations 7 to 9 (corrected): guide x = t z + d, y = k z + b.
#[test]
fn carriages_on_any_guide_stand_where_paper_003_says() {
    let recipe =
        Recipe { name: "guides", kinds: &[Draw::Slider; 6], coordinates: "XYZABC", table: "" };
    let mut rng = rng(32);
    let mut checked = 0;
    for _ in 0..cases(300) {
        let case = draw(&mut rng, &recipe);
        let pose = (case.sample)(&mut rng);
        let Ok(joints) = case.machine.inverse(&pose, &NO_TOOL) else { continue };
        for (i, leg) in case.geometry.legs().iter().enumerate() {
            let slider = slider_of(leg);
            let e = Vector3::from(slider.guide).normalize();
            if e.z.abs() < 0.2 {
                continue;
            }
            let p = platform_anchor(leg, &pose);
            let (t, k) = (e.x / e.z, e.y / e.z);
            let (d, b) = (leg.base[0] - t * leg.base[2], leg.base[1] - k * leg.base[2]);
            let a = 1.0 + k * k + t * t;
            let half = p.z + k * (p.y - b) + t * (p.x - d);
            let c = p.z * p.z + (p.y - b).powi(2) + (p.x - d).powi(2) - slider.rod * slider.rod;
            let sign = f64::from(slider.side) * e.z.signum();
            let z = (half + sign * (half * half - a * c).sqrt()) / a;
            let expected = (z - leg.base[2]) / e.z;
            // The printed form cancels squares of some thousands of mm, over 0.2 and the root.
            assert!((joints[i] - expected).abs() < 100.0 * GOLDEN_JOINT, "{leg:?} {pose:?}");
            checked += 1;
        }
    }
    assert!(checked > cases(300), "{checked}");
}

/// Tests paper 000, equations 7 and 8 (corrected), for the pair of guides in XZ while A = 0.
#[test]
fn carriages_of_the_pyramid_stand_where_paper_000_says() {
    let case = pyramid();
    let mut rng = rng(33);
    for _ in 0..cases(1000) {
        let mut pose = (case.sample)(&mut rng);
        pose.angles.x = 0.0;
        let joints = case.joints(&pose);
        let (sin_b, cos_b) = pose.angles.y.sin_cos();
        // The center is 150 above the tip; its X and Y are the table's.
        let height = pose.position.z + 150.0 * cos_b;
        for (i, sign) in [(0, 1.0), (2, -1.0)] {
            let (x0, z0) = (sign * 120.0 * cos_b, height - sign * 120.0 * sin_b);
            let (k, x1, z1, l) = (-0.5 * sign, 700.0 * sign, 200.0, 550.0);
            let s1 = 1.0 + k * k;
            let s2 = 2.0 * k * x1 - 2.0 * k * x0 - 2.0 * k * k * z1 - 2.0 * z0;
            let s3 = x1 * x1 + x0 * x0 + k * k * z1 * z1 - 2.0 * k * z1 * x1 + 2.0 * k * z1 * x0
                - 2.0 * x0 * x1
                + z0 * z0
                - l * l;
            let z = (-s2 + (s2 * s2 - 4.0 * s1 * s3).sqrt()) / (2.0 * s1);
            let expected = (z - z1) * s1.sqrt();
            assert!((joints[i] - expected).abs() < GOLDEN_JOINT, "{pose:?}");
        }
        let table = [pose.position.x + 150.0 * sin_b, pose.position.y];
        assert!((joints[4] - table[0]).abs() < GOLDEN_JOINT);
        assert!((joints[5] - table[1]).abs() < GOLDEN_JOINT);
    }
}

/// Tests guides along X, Y, Z that cross in the origin, and rods that end in one point: the only
/// lengths of the machine are its rods. The same with a single crank.
#[test]
fn a_machine_may_have_all_its_anchors_in_the_origin() {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let orthoglide = axes.map(|guide| slider([0.0; 3], [0.0; 3], guide, 300.0, -1));
    let crank = CrankGeometry { axis: axes[1], arm: [400.0, 0.0, 0.0], rod: 300.0, side: 1 };
    let crank = LegGeometry { base: [0.0; 3], platform: [0.0; 3], kind: LegKind::Crank(crank) };
    let at = |v: [f64; 3]| Pose::from_degrees([v[0], v[1], v[2], 0.0, 0.0, 0.0]);
    for (legs, coordinates, size, home, other) in [
        (&orthoglide[..], "XYZ", 300.0, [0.0; 3], [20.0, 30.0, -40.0]),
        (&[crank], "Z", 400.0, [0.0, 0.0, -450.0], [0.0, 0.0, -500.0]),
    ] {
        let home = at(home);
        let given = geometry(legs, coordinates, "", Some(home.to_degrees()));
        let machine = Machine::freeze(&given, &NO_OFFSET).unwrap();
        assert_eq!(machine.size(), size);
        let joints = machine.inverse(&at(other), &NO_TOOL).unwrap();
        for (leg, joint) in legs.iter().zip(joints) {
            let span = Vector3::from(other) - rod(leg, joint).anchor;
            assert!((span.norm() - 300.0).abs() < LENGTH * size, "{joints:?}");
        }
        let found = machine.forward(&joints, &home, &NO_TOOL, &Solver::default()).unwrap();
        let apart = found.pose.distance(&at(other), machine.radius());
        // The guarantee of README for forward(inverse(pose)).
        assert!(apart <= 1e-10 * size, "{found:?}");
    }
}
