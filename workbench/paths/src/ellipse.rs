// SPDX-License-Identifier: GPL-2.0-or-later
//! Arcs of circles and ellipses in space.

use machine::proof::jet::Taylor;
use nalgebra::Vector3;

/// center + cos φ · first + sin φ · second, where φ goes from one angle to the other while t goes
/// over a range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipse {
    /// Center, mm.
    pub centre: Vector3<f64>,
    /// Two conjugate half-diameters, mm; those of a circle are perpendicular and equally long.
    pub halves: [Vector3<f64>; 2],
    /// First and last φ, radians.
    pub angles: [f64; 2],
    /// First and last t.
    pub over: [f64; 2],
}

impl Ellipse {
    /// Creates an arc with t from 0 to 1.
    pub fn new(centre: Vector3<f64>, halves: [Vector3<f64>; 2], angles: [f64; 2]) -> Self {
        Self { centre, halves, angles, over: [0.0, 1.0] }
    }

    /// Evaluates the coordinates at a parameter.
    pub fn at(&self, t: Taylor) -> [Taylor; 3] {
        let ([from, to], [first, last]) = (self.angles, self.over);
        let share = (t - Taylor::constant(first)) * (1.0 / (last - first));
        let angle = Taylor::constant(from) + share * (to - from);
        let (sin, cos) = (angle.sin(), angle.cos());
        let [u, v] = self.halves;
        std::array::from_fn(|k| Taylor::constant(self.centre[k]) + cos * u[k] + sin * v[k])
    }

    fn place(&self, angle: f64) -> Vector3<f64> {
        let (sin, cos) = angle.sin_cos();
        self.centre + self.halves[0] * cos + self.halves[1] * sin
    }

    /// Returns the first and last point.
    pub fn ends(&self) -> [Vector3<f64>; 2] {
        self.angles.map(|angle| self.place(angle))
    }

    /// Reverses the direction.
    pub fn reversed(self) -> Self {
        let [from, to] = self.angles;
        Self { angles: [to, from], ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use machine::proof::interval::Interval;
    use std::f64::consts::TAU;

    #[test]
    fn a_whole_ellipse_keeps_its_equation_and_comes_back() {
        let (centre, halves) = (
            Vector3::new(1.0, 2.0, 3.0),
            [Vector3::new(5.0, 0.0, 0.0), Vector3::new(0.0, 3.0, 0.0)],
        );
        let ellipse = Ellipse { over: [4.0, 5.0], ..Ellipse::new(centre, halves, [0.0, TAU]) };
        for k in 0..=8 {
            let at = ellipse.at(Taylor::variable(Interval::point(4.0 + f64::from(k) / 8.0), 0));
            let [x, y, z] = at.map(|x| x.value.middle());
            // Some ten roundings of numbers up to 10.
            let off = ((x - 1.0) / 5.0).powi(2) + ((y - 2.0) / 3.0).powi(2) - 1.0;
            assert!(off.abs() < 1e-14 && z == 3.0, "{off} {z}");
        }
        let [start, end] = ellipse.ends();
        assert!((start - end).norm() < 1e-14);
        assert_eq!(ellipse.reversed().ends(), [end, start]);
    }
}
