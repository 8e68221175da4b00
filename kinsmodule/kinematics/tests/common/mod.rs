// SPDX-License-Identifier: GPL-2.0-or-later
//! Machines, declared workspaces and random numbers that the tests of the core share.
#![allow(dead_code)]

pub mod reference;
pub mod tolerances;

use kinematics::leg::StrutGeometry;
use kinematics::{Coordinates, Geometry, LegGeometry, Machine, Pose, Vector3};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

pub const NO_TOOL: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

/// A machine with the region of poses it is declared for.
pub struct Case {
    pub name: &'static str,
    pub machine: Machine<6>,
    pub home: Pose,
    pub sample: fn(&mut Pcg64) -> Pose,
}

pub fn rng(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

/// Number of cases: `base` in CI, multiplied by PKMKINS_CASES in the long tier.
pub fn cases(base: usize) -> usize {
    let factor = std::env::var("PKMKINS_CASES")
        .ok()
        .map_or(1, |v| v.parse().expect("PKMKINS_CASES: a whole number"));
    base * factor
}

pub fn uniform(rng: &mut Pcg64, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

fn on_circle(radius: f64, degrees: f64, z: f64) -> [f64; 3] {
    let angle = degrees.to_radians();
    [radius * angle.cos(), radius * angle.sin(), z]
}

/// Geometry from anchors, and from axes and lead where the struts are screws.
pub fn geometry(
    base: [[f64; 3]; 6],
    platform: [[f64; 3]; 6],
    struts: [StrutGeometry; 6],
    home: Option<[f64; 6]>,
) -> Geometry<6> {
    Geometry {
        legs: std::array::from_fn(|i| LegGeometry::strut(base[i], platform[i], struts[i])),
        home,
        coordinates: Coordinates::XYZABC,
    }
}

/// The machine of paper 004 (machine a of the configurations): inverted, lead 10 mm.
pub fn paper_004(lead: f64) -> Geometry<6> {
    let base = [-15.0, 15.0, 105.0, 135.0, 225.0, 255.0].map(|t| on_circle(560.0, t, 1250.0));
    let platform = [-45.0, 45.0, 75.0, 165.0, 195.0, 285.0].map(|t| on_circle(200.0, t, 150.0));
    let home = [0.0, 0.0, 250.0, 0.0, 0.0, 0.0];
    let struts = std::array::from_fn(|i| {
        let n = Vector3::from(platform[i]) + Vector3::new(0.0, 0.0, 250.0) - Vector3::from(base[i]);
        let axis = Vector3::z().cross(&n).normalize();
        StrutGeometry { base_axis: axis.into(), platform_axis: (-axis).into(), lead }
    });
    geometry(base, platform, struts, Some(home))
}

fn paper_004_pose(rng: &mut Pcg64) -> Pose {
    let radius = 150.0 * rng.random::<f64>().sqrt();
    let around = uniform(rng, 0.0, std::f64::consts::TAU);
    let tilt = (30.0 * rng.random::<f64>().sqrt()).to_radians();
    let azimuth = uniform(rng, 0.0, std::f64::consts::TAU);
    let z = [tilt.sin() * azimuth.cos(), tilt.sin() * azimuth.sin(), tilt.cos()];
    Pose {
        position: Vector3::new(
            radius * around.cos(),
            radius * around.sin(),
            uniform(rng, 100.0, 400.0),
        ),
        angles: Vector3::new(-z[1].asin(), z[0].atan2(z[2]), 0.0),
    }
}

/// The laboratory machine of paper 001: platform on top, no lead.
pub fn paper_001() -> Geometry<6> {
    let base = [
        (400.0, 78.0),
        (400.0, 102.0),
        (372.0, 198.0),
        (372.0, 222.0),
        (372.0, 318.0),
        (372.0, 342.0),
    ]
    .map(|(r, t)| on_circle(r, t, 0.0));
    let platform = [42.0, 138.0, 162.0, 258.0, 282.0, 378.0].map(|t| on_circle(140.0, t, 0.0));
    geometry(base, platform, [StrutGeometry::default(); 6], Some([0.0, 0.0, 640.0, 0.0, 0.0, 0.0]))
}

fn paper_001_pose(rng: &mut Pcg64) -> Pose {
    Pose::from_degrees([
        uniform(rng, -60.0, 60.0),
        uniform(rng, -60.0, 60.0),
        uniform(rng, 520.0, 800.0),
        uniform(rng, -15.0, 15.0),
        uniform(rng, -15.0, 15.0),
        uniform(rng, -15.0, 15.0),
    ])
}

/// The default geometry of LinuxCNC's genhexkins (inches), axes included.
#[allow(clippy::approx_constant, reason = "genhexkins' own rounding")]
pub fn genhexkins_default(lead: f64) -> Geometry<6> {
    let (x, y) = (22.95, 13.25);
    let base = [
        [-x, y, 0.0],
        [x, y, 0.0],
        [x, y, 0.0],
        [0.0, -26.5, 0.0],
        [0.0, -26.5, 0.0],
        [-x, y, 0.0],
    ];
    let platform = [
        [-1.0, 11.5, 0.0],
        [1.0, 11.5, 0.0],
        [10.459, -4.884, 0.0],
        [9.459, -6.616, 0.0],
        [-9.459, -6.616, 0.0],
        [-10.459, -4.884, 0.0],
    ];
    let d = 0.707107;
    let base_axis =
        [[d, 0.0, d], [0.0, -d, d], [-d, 0.0, d], [-d, 0.0, d], [0.0, d, d], [d, 0.0, d]];
    let (p, q) = (0.866025, 0.5);
    let platform_axis =
        [[-1.0, 0.0, 0.0], [p, q, 0.0], [p, q, 0.0], [p, -q, 0.0], [p, -q, 0.0], [-1.0, 0.0, 0.0]];
    let struts = std::array::from_fn(|i| StrutGeometry {
        base_axis: base_axis[i],
        platform_axis: platform_axis[i],
        lead,
    });
    geometry(base, platform, struts, None)
}

fn genhexkins_pose(rng: &mut Pcg64, tilt: f64) -> Pose {
    Pose::from_degrees([
        uniform(rng, -5.0, 5.0),
        uniform(rng, -5.0, 5.0),
        uniform(rng, 15.0, 25.0),
        uniform(rng, -tilt, tilt),
        uniform(rng, -tilt, tilt),
        uniform(rng, -tilt, tilt),
    ])
}

/// The two shipped machines over their declared workspaces.
pub fn shipped() -> [Case; 2] {
    let case = |name, geometry: Geometry<6>, sample| Case {
        name,
        machine: Machine::freeze(&geometry, &[0.0; 6]).expect("shipped geometry"),
        home: Pose::from_degrees(geometry.home.expect("shipped geometries have a reference pose")),
        sample,
    };
    [
        case("hexapod (paper 004)", paper_004(10.0), paper_004_pose as fn(&mut Pcg64) -> Pose),
        case("lab-hexapod (paper 001)", paper_001(), paper_001_pose),
    ]
}

/// genhexkins' default geometry with ±20° in every angle.
pub fn genhexkins_case() -> Case {
    Case {
        name: "genhexkins default, ±20°",
        machine: Machine::freeze(&genhexkins_default(0.0), &[0.0; 6]).expect("genhexkins default"),
        home: Pose::from_degrees([0.0, 0.0, 20.0, 0.0, 0.0, 0.0]),
        sample: |rng| genhexkins_pose(rng, 20.0),
    }
}

/// A pose one servo step away: up to 0.5 m/s and 60°/s over 1 ms.
pub fn servo_step(rng: &mut Pcg64, from: &Pose, length: f64) -> Pose {
    let direction = |rng: &mut Pcg64| loop {
        let v = Vector3::from_fn(|_, _| uniform(rng, -1.0, 1.0));
        if (0.01..1.0).contains(&v.norm_squared()) {
            return v.normalize();
        }
    };
    Pose {
        position: from.position + direction(rng) * length,
        angles: from.angles + direction(rng) * 0.06_f64.to_radians(),
    }
}
