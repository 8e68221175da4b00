// SPDX-License-Identifier: GPL-2.0-or-later
//! Machines, declared workspaces and random numbers that the tests of the core share.
#![allow(dead_code)]

pub mod machines;
pub mod outcome;
pub mod random;
pub mod reference;
pub mod solutions;
pub mod tolerances;

use self::tolerances::ROUNDED_JOINT;
use kinematics::{At, Geometry, Joints, Letter, Machine, PerLeg, Pose, Vector3};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

pub const NO_TOOL: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

pub const NO_OFFSET: PerLeg = [0.0; 8];

pub type Sample = Box<dyn Fn(&mut Pcg64) -> Pose>;

/// A machine with the region of poses it is declared for.
pub struct Case {
    pub name: &'static str,
    pub geometry: Geometry,
    pub machine: Machine,
    pub home: Pose,
    pub sample: Sample,
    /// 0.5 mm in the machine's unit: 0.5 m/s over a servo period of 1 ms.
    pub step: f64,
}

impl Case {
    /// Freezes the machine of `geometry`, which has a reference pose.
    pub fn new(name: &'static str, geometry: Geometry, sample: Sample, step: f64) -> Self {
        let machine = Machine::freeze(&geometry, &NO_OFFSET);
        Self {
            name,
            geometry,
            machine: machine.unwrap_or_else(|e| panic!("{name}: {e}")),
            home: Pose::from_degrees(geometry.home.expect("a case has a reference pose")),
            sample,
            step,
        }
    }

    /// Returns the distance of two poses relative to the machine's size.
    pub fn apart(&self, one: &Pose, other: &Pose) -> f64 {
        one.distance(other, self.machine.radius()) / self.machine.size()
    }

    /// Returns the joints of a pose that the machine reaches.
    pub fn joints(&self, pose: &Pose) -> Joints {
        let joints = self.machine.inverse(pose, &NO_TOOL);
        joints.unwrap_or_else(|e| panic!("{}: {pose:?}: {e}", self.name))
    }

    /// Compares joints with those at a pose: where three spheres meet, `at` subtracts the tool and adds it
    /// again, and inverse does not.
    pub fn assert_joints_at(&self, at: &At, joints: &Joints) {
        let ratios = at.speed_ratios().expect("no dead point");
        let most = ROUNDED_JOINT * self.machine.size();
        for ((own, other), ratio) in joints.iter().zip(at.joints()).zip(ratios) {
            let apart = (own - other).abs();
            assert!(apart <= most * ratio.max(1.0), "{}: {apart:e}, {joints:?}", self.name);
        }
    }

    /// Returns a pose one servo step away in every coordinate that moves: up to 0.5 m/s and 60°/s.
    pub fn servo_step(&self, rng: &mut Pcg64, from: &Pose) -> Pose {
        let moved = Pose {
            position: from.position + direction(rng) * self.step,
            angles: from.angles + direction(rng) * 0.06_f64.to_radians(),
        };
        self.without_held(&moved)
    }

    /// Returns the pose with its held coordinates at 0.
    pub fn without_held(&self, pose: &Pose) -> Pose {
        let mut pose = *pose;
        for letter in Letter::ALL {
            if self.machine.layout().is_held(letter) {
                match letter.index() {
                    k @ 0..3 => pose.position[k] = 0.0,
                    k => pose.angles[k - 3] = 0.0,
                }
            }
        }
        pose
    }
}

pub fn rng(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

/// Returns the number of cases: `base` in CI, multiplied by PKMKINS_CASES: more than 1 in the long tier, less
/// where the tests run many times.
pub fn cases(base: usize) -> usize {
    let factor: f64 = std::env::var("PKMKINS_CASES")
        .map_or(1.0, |v| v.parse().expect("PKMKINS_CASES: a positive number"));
    assert!(factor > 0.0, "PKMKINS_CASES: a positive number, not {factor}");
    ((base as f64 * factor) as usize).max(1)
}

pub fn uniform(rng: &mut Pcg64, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

/// Returns a uniformly distributed direction.
pub fn direction(rng: &mut Pcg64) -> Vector3<f64> {
    loop {
        let v = Vector3::from_fn(|_, _| uniform(rng, -1.0, 1.0));
        if (0.01..1.0).contains(&v.norm_squared()) {
            return v.normalize();
        }
    }
}

/// Samples poses of a box, machine units and degrees.
pub fn within(low: [f64; 6], high: [f64; 6]) -> Sample {
    Box::new(move |rng| Pose::from_degrees(std::array::from_fn(|k| uniform(rng, low[k], high[k]))))
}
