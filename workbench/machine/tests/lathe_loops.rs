// SPDX-License-Identifier: GPL-2.0-or-later
//! Equations 4 and 5 of paper 003, compared with the core: the positions of the carriages in the loop of two rods,
//! and the point where a rod meets its guide.

use kinematics::{LegKind, Pose, Vector3};
use machine::proof::axis_box;
use nalgebra::{Rotation3, Unit};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use test_support::shipped::{cases, config};

/// Some ten roundings of lengths near 1000 mm, over a sine of 0.3 at least.
const TOLERANCE_MM: f64 = 1e-9;

const NO_TOOL: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

/// Equation 4: in the loop of two rods, the platform between them and their common guide, the
/// carriages are d = P ± √(P² − H) apart, P = l₁ cos φ₁ + l₂ cos φ₄ and
/// H = l₁² + l₂² − g² + 2 l₁ l₂ cos(φ₁ + φ₄). The paper's loop is planar: the platform rotates only in
/// the plane of guide and joints, which is possible for the six-rod lathe.
#[test]
fn carriages_of_a_planar_loop_are_as_far_apart_as_paper_003_says() {
    let config = config("six-rod-lathe");
    let legs = config.geometry.legs();
    let mut rng = Pcg64::seed_from_u64(3);
    for _ in 0..cases(1000) {
        // A a b B and A' a' b' B', by the numbers of their legs.
        for [first, second] in [[0, 1], [3, 4]] {
            let (a, b) =
                (Vector3::from(legs[first].platform), Vector3::from(legs[second].platform));
            let [LegKind::Slider(one), LegKind::Slider(two)] =
                [legs[first].kind, legs[second].kind]
            else {
                panic!("carriages")
            };
            assert_eq!((legs[first].base, one.guide), (legs[second].base, two.guide));
            let guide = Vector3::from(legs[first].base);
            let mut range = |from: f64, to: f64| rng.random_range(from..to);
            let wanted =
                Vector3::new(range(-80.0, 80.0), range(410.0, 500.0), range(600.0, 1400.0));
            let middle = wanted + (a + b) / 2.0;
            let away = Vector3::new(middle.x - guide.x, middle.y - guide.y, 0.0);
            let normal = Unit::new_normalize(Vector3::z().cross(&away));
            let turn = Rotation3::from_axis_angle(&normal, range(-0.2, 0.2));
            let (roll, pitch, yaw) = turn.euler_angles();
            let position = middle - turn * (a + b) / 2.0;
            let pose = Pose { position, angles: Vector3::new(roll, pitch, yaw) };
            let joints = config.machine.inverse(&pose, &NO_TOOL).unwrap();
            // Each rod's angle to the guide, within the loop, from the distance of its joint.
            let angle = |joint: Vector3<f64>, rod: f64| {
                let from_guide = position + turn * joint - guide;
                (from_guide.xy().norm() / rod).asin()
            };
            let (phi_1, phi_4, g) = (angle(a, one.rod), angle(b, two.rod), (b - a).norm());
            let p = one.rod * phi_1.cos() + two.rod * phi_4.cos();
            let product = one.rod * two.rod * (phi_1 + phi_4).cos();
            let h = one.rod.powi(2) + two.rod.powi(2) - g * g + 2.0 * product;
            // b is above a: the rods do not cross.
            let d = p + (p * p - h).sqrt();
            let found = joints[second] - joints[first];
            assert!((found - d).abs() < TOLERANCE_MM, "{first} {pose:?}: {found} {d}");
        }
    }
}

/// Returns the solutions of equation 5: a line through `on` along the unit vector τ meets the sphere of radius R about
/// `centre` at centre + τ × (Δr × τ) ± √(R² − |Δr × τ|²) τ, Δr = on − centre (the paper's note swaps
/// the names of line and direction).
fn met(
    on: Vector3<f64>,
    tau: Vector3<f64>,
    centre: Vector3<f64>,
    radius: f64,
    side: i8,
) -> Vector3<f64> {
    let across = (on - centre).cross(&tau);
    let root = (radius * radius - across.norm_squared()).sqrt();
    centre + tau.cross(&across) + f64::from(side) * root * tau
}

#[test]
fn carriages_stand_where_guide_and_sphere_of_paper_003_meet() {
    for machine in ["four-rod-lathe", "six-rod-lathe", "pyramid", "linear-delta"] {
        let config = config(machine);
        let range = axis_box::range(&config);
        let mut rng = Pcg64::seed_from_u64(5);
        for _ in 0..cases(1000) {
            let pose = Pose::from_degrees(range.at(std::array::from_fn(|_| rng.random())));
            let joints = config.machine.inverse(&pose, &NO_TOOL).unwrap();
            let segments = *config.machine.at(&pose, &NO_TOOL).unwrap().segments();
            for (i, leg) in config.geometry.legs().iter().enumerate() {
                let LegKind::Slider(slider) = leg.kind else { panic!("a slider") };
                let (base, tau) =
                    (Vector3::from(leg.base), Vector3::from(slider.guide).normalize());
                let expected = met(base, tau, segments[i].platform, slider.rod, slider.side as i8);
                let found = base + joints[i] * tau;
                assert!((found - expected).norm() < TOLERANCE_MM, "{machine} {i} {pose:?}");
            }
        }
    }
}
