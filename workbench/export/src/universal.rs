// SPDX-License-Identifier: GPL-2.0-or-later
//! Universal joints: two hinges with perpendicular axes through one point.

use kinematics::{Matrix3, Vector3};
use nalgebra::{Rotation3, Unit};

/// Sine of the angle between a rod and a joint axis below which the axis does not suit the joint.
const LEAST_SINE: f64 = 0.05;

/// A universal joint: the first axis is fixed in the part that carries it, the second in the rod.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Universal {
    pub first: Vector3<f64>,
    pub second: Vector3<f64>,
    /// Normal to both; the rod is in its half space at home.
    third: Vector3<f64>,
    /// Angle of the rod at home from the third axis toward the first.
    lean: f64,
}

impl Universal {
    /// Creates the joint of a rod with this direction at home; `wanted` is its first axis, unless it is zero or (nearly)
    /// along the rod: then a normal of the rod.
    pub fn new(wanted: &Vector3<f64>, rod: &Vector3<f64>) -> Self {
        let rod = rod.normalize();
        let suits = |axis: &Vector3<f64>| axis.cross(&rod).norm() > LEAST_SINE;
        let first = wanted.try_normalize(0.0).filter(suits).unwrap_or_else(|| normal(&rod));
        let third = (rod - first * first.dot(&rod)).normalize();
        let lean = first.dot(&rod).atan2(third.dot(&rod));
        Self { first, second: third.cross(&first), third, lean }
    }

    /// Returns the angles about both axes that turn the rod from its direction at home to this one.
    pub fn angles(&self, rod: &Vector3<f64>) -> [f64; 2] {
        let [along, second, third] =
            [self.first, self.second, self.third].map(|axis| axis.dot(rod));
        let across = along.atan2(second.hypot(third)) - self.lean;
        [(-second).atan2(third), across]
    }

    /// Returns the rotation by angles about both axes.
    pub fn rotation(&self, [first, second]: [f64; 2]) -> Matrix3<f64> {
        turn(&self.first, first) * turn(&self.second, second)
    }
}

/// Returns the rotation about a unit vector.
pub fn turn(axis: &Vector3<f64>, angle: f64) -> Matrix3<f64> {
    *Rotation3::from_axis_angle(&Unit::new_unchecked(*axis), angle).matrix()
}

/// Returns the angle about a unit vector by which a rotation about it turns.
pub fn angle_about(axis: &Vector3<f64>, rotation: &Matrix3<f64>) -> f64 {
    let sine = Vector3::new(
        rotation[(2, 1)] - rotation[(1, 2)],
        rotation[(0, 2)] - rotation[(2, 0)],
        rotation[(1, 0)] - rotation[(0, 1)],
    );
    axis.dot(&sine).atan2(rotation.trace() - 1.0)
}

/// Returns a unit vector normal to another: in the plane of the two axes from which it is farthest.
pub fn normal(rod: &Vector3<f64>) -> Vector3<f64> {
    rod.cross(&Vector3::ith(rod.iamin(), 1.0)).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A few roundings of numbers near 1.
    const ROUNDING: f64 = 1e-14;

    #[test]
    fn the_angles_turn_the_rod_to_its_direction() {
        let home = Vector3::new(0.2, -0.3, 0.9).normalize();
        for wanted in [Vector3::new(1.0, 0.2, -0.4), Vector3::zeros(), home, Vector3::x()] {
            let joint = Universal::new(&wanted, &home);
            assert!(joint.first.dot(&joint.second).abs() < ROUNDING);
            assert!(joint.angles(&home).into_iter().all(|angle| angle.abs() < ROUNDING));
            for rod in [Vector3::new(0.5, 0.1, 0.8), Vector3::new(-0.6, 0.7, -0.2)] {
                let rod = rod.normalize();
                let turned = joint.rotation(joint.angles(&rod)) * home;
                assert!((turned - rod).norm() < ROUNDING, "{wanted}: {turned}");
            }
        }
    }

    #[test]
    fn an_angle_about_an_axis_is_the_one_of_the_rotation() {
        let axis = Vector3::new(2.0, -1.0, 0.5).normalize();
        for angle in [-3.0, -0.4, 0.0, 1e-9, 2.0] {
            assert!((angle_about(&axis, &turn(&axis, angle)) - angle).abs() < ROUNDING);
        }
    }
}
