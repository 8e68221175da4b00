// SPDX-License-Identifier: GPL-2.0-or-later
//! Deviation of a leg over a cell from a linear motion: bounds of second derivatives, see
//! [`crate::proof::cell`] for V and A.
//!
//! Rods: with u the unit vector along the rod (length L), s = L u = p − c(q), c(q) its moving end, g = |u · ∂c/∂q|
//!
//! ```text
//! |q'| ≤ V/g = Q,  |s'| ≤ V/d = S,  |q''| ≤ (S²/L + A + |u · ∂²c| Q²)/g,  |s''| ≤ (S²/L + A + |∂²c| Q²)/d,
//! ```
//!
//! from the derivatives of s · s = L², with d = g/|∂c|: s' is p' projected along ∂c onto the plane normal to u, and the norm
//! of this oblique projection is 1/d. The end of a crank turns about its axis, so ∂²c is normal to ∂c, and
//! |u · ∂²c| ≤ |∂²c| √(1 − d²). Nut correction: the bound of the core's
//! certificate, with V/l for n' and Ω for 1/r.

use crate::proof::reach::{LegMiddle, Middle, RADIANS, Reach, Ring, Spread};
use kinematics::{LEAST_DRIVE, LEAST_SINE_TO_AXIS, LegKind, Vector3};
use std::f64::consts::PI;

/// Least cosine of the angle between a strut and the plane normal to a cardan axis, 80 degrees. It
/// is a choice of this proof: the correction is defined beyond it, up to the core's
/// [`LEAST_SINE_TO_AXIS`], but changes so fast there that no useful cell is proved.
const LEAST_COSINE: f64 = 0.17;

// The cosine of the angle to the plane is the sine of that to the axis.
const _: () = assert!(LEAST_COSINE > LEAST_SINE_TO_AXIS);

/// One leg over a cell.
pub(super) struct SecondDerivatives {
    /// Bound of the second derivative of the joint value, joint units.
    pub(super) joint: f64,
    /// Bounds of the second derivative of the leg's direction, and of its first derivative.
    pub(super) direction: [f64; 2],
    /// Smallest length.
    pub(super) length: f64,
    /// Bounds of the second derivatives of the ends, at the base and at the platform.
    pub(super) ends: [f64; 2],
    /// Bound of the motion of both ends.
    pub(super) farthest: f64,
    /// Bounds of the first and second derivative of the platform anchor's position along its ring.
    pub(super) slide: [f64; 2],
}

impl Reach<'_> {
    /// Returns the largest distance of the platform anchor of leg `i` from the platform's center of rotation.
    fn arm(&self, i: usize) -> f64 {
        let radius = self.config.geometry.legs()[i].kind.ring_radius();
        self.arms[i].iter().map(|arm| arm.norm()).sum::<f64>() + radius
    }

    /// Computes the bounds of one leg; `None` if the cell is too large.
    pub(super) fn second_derivatives(
        &self,
        i: usize,
        middle: &Middle,
        spread: &Spread,
    ) -> Option<SecondDerivatives> {
        let segment = &middle.legs[i].segment;
        let (travel, second) = spread.of_anchor(self.arm(i));
        let span = segment.platform - segment.base;
        let leg = &self.config.geometry.legs()[i];
        match leg.kind {
            LegKind::Strut(strut) => {
                let length = span.norm() - travel;
                (length > 0.0).then_some(())?;
                let direction = [travel / length, second_of_direction(travel, second, length)];
                let nut = self.nut_second_derivative(i, middle, spread, &direction, strut.lead)?;
                let joint = travel * travel / length + second + nut;
                Some(SecondDerivatives {
                    joint,
                    direction,
                    length,
                    ends: [0.0, second],
                    farthest: travel,
                    slide: [0.0; 2],
                })
            }
            LegKind::Ring(_) => self.ring_bend(i, middle, spread, travel, second),
            LegKind::Slider(slider) => {
                let guide = Vector3::from(slider.guide).normalize();
                let from_base = segment.platform - Vector3::from(leg.base);
                let farthest = from_base.cross(&guide).norm() + travel;
                let gain =
                    (slider.rod * slider.rod - farthest * farthest).max(0.0).sqrt() / slider.rod;
                rod_bend(gain, 1.0, 0.0, travel, second, slider.rod, 1.0)
            }
            LegKind::Crank(crank) => {
                let axis = Vector3::from(crank.axis).normalize();
                let arm = Vector3::from(crank.arm);
                let (along, across) = (axis.dot(&arm), axis.cross(&arm).norm());
                let from_base = segment.platform - Vector3::from(leg.base);
                let apart = (from_base - axis * along).norm();
                let squares = |d: f64| (d * d + across * across - crank.rod * crank.rod) / 2.0;
                let (least, most) = (squares((apart - travel).max(0.0)), squares(apart + travel));
                let reach = across * (from_base.cross(&axis).norm() - travel).max(0.0);
                let t = least.abs().max(most.abs());
                let drive = (reach * reach - t * t).max(0.0).sqrt() / (across * crank.rod);
                rod_bend(drive, across, across, travel, second, crank.rod, RADIANS)
            }
        }
    }

    /// Computes the bounds of a strut on a ring, whose anchor slides along it: with y the speed of the platform's
    /// point at the base anchor, rho its distance from the axis, psi the angle along the ring in
    /// the platform,
    ///
    /// ```text
    /// |psi'| ≤ y/rho,  |psi''| ≤ y'/rho + 2 (y/rho)²,  |p'| ≤ V + r |psi'|,
    /// |p''| ≤ A + 2 Ω r |psi'| + r (|psi''| + |psi'|²),  |q''| ≤ max(V², (r/rho) y²)/l + A
    /// ```
    ///
    /// (core, module `leg::ring`).
    fn ring_bend(
        &self,
        i: usize,
        middle: &Middle,
        spread: &Spread,
        travel: f64,
        second: f64,
    ) -> Option<SecondDerivatives> {
        let LegMiddle { segment, length, .. } = &middle.legs[i];
        let leg = &self.config.geometry.legs()[i];
        let to_base = self.to_base(i, middle).norm() + spread.shift;
        let speed = spread.shift + to_base * spread.turn;
        let speeding = to_base * spread.turn * spread.turn + 2.0 * spread.shift * spread.turn;
        let (radius, rho) = match Ring::of(leg, segment, &middle.rotation) {
            Some(ring) => (ring.radius, ring.rho - speed),
            None if leg.kind.ring_radius() > 0.0 => return None,
            None => (0.0, f64::INFINITY),
        };
        // No pose exists nearer to the axis than the ring.
        let length = length - travel;
        (length > 0.0 && rho >= radius).then_some(())?;
        let turn = speed / rho;
        let turning = speeding / rho + 2.0 * turn * turn;
        let first = travel + radius * turn;
        let bent = second + radius * (2.0 * spread.turn * turn + turning + turn * turn);
        Some(SecondDerivatives {
            joint: (travel * travel).max(radius / rho * speed * speed) / length + second,
            direction: [first / length, second_of_direction(first, bent, length)],
            length,
            ends: [0.0, bent],
            farthest: first,
            slide: [first - travel, bent - second],
        })
    }

    /// Bounds the second derivative of the nut correction of leg `i`.
    fn nut_second_derivative(
        &self,
        i: usize,
        middle: &Middle,
        spread: &Spread,
        direction: &[f64; 2],
        lead: f64,
    ) -> Option<f64> {
        if lead == 0.0 {
            return Some(0.0);
        }
        let [turn_a, turn_b] = [direction[0], direction[0] + spread.turn];
        let [cos_a, cos_b] = self.cardan(i, middle, [turn_a, turn_b])?;
        let per_radian = lead.abs() / (2.0 * PI);
        let tangents = (1.0 / (cos_a * cos_a) - 1.0).sqrt() + (1.0 / (cos_b * cos_b) - 1.0).sqrt();
        // The correction jumps where the screw has turned by half a turn.
        let turned = tangents * direction[0] + spread.turn / cos_b;
        let room = PI - middle.at.corrections()[i].abs() / per_radian;
        (turned < room).then_some(())?;
        let second_derivative = 3.0 * turn_a * turn_a / (cos_a * cos_a)
            + 3.0 * turn_b * turn_b / (cos_b * cos_b)
            + tangents * direction[1]
            + spread.turn * spread.turn / cos_b;
        Some(per_radian * second_derivative)
    }

    /// Returns the least cosines of the angles between a strut and the planes normal to its cardan axes,
    /// if it rotates by at most these angles.
    pub(super) fn cardan(&self, i: usize, middle: &Middle, turns: [f64; 2]) -> Option<[f64; 2]> {
        let strut = self.config.geometry.legs()[i].kind.screw();
        let n = middle.legs[i].n;
        let axes = [
            Vector3::from(strut.base_axis).normalize(),
            middle.rotation * Vector3::from(strut.platform_axis).normalize(),
        ];
        let mut cosines = [0.0; 2];
        for ((cosine, axis), turn) in cosines.iter_mut().zip(axes).zip(turns) {
            *cosine = (n.dot(&axis).abs().min(1.0).asin() + turn).min(PI / 2.0).cos();
        }
        cosines.iter().all(|cosine| *cosine > LEAST_COSINE).then_some(cosines)
    }
}

/// Bounds a rod whose lower end moves with speed `pace` and acceleration `curve` per unit of its joint,
/// of which at least the share `drive` is along the rod; its acceleration is normal to its speed.
fn rod_bend(
    drive: f64,
    pace: f64,
    curve: f64,
    travel: f64,
    second: f64,
    rod: f64,
    unit: f64,
) -> Option<SecondDerivatives> {
    (drive >= LEAST_DRIVE).then_some(())?;
    let gain = drive * pace;
    let rate = travel / gain;
    let first = travel / drive;
    let (inward, swing) = (first * first / rod, curve * rate * rate);
    let across = (1.0 - drive * drive).max(0.0).sqrt();
    let joint = (inward + second + swing * across) / gain;
    // The length is constant, so the direction is the vector along the rod, scaled.
    let direction = [first / rod, (inward + second + swing) / (drive * rod)];
    Some(SecondDerivatives {
        joint: joint / unit,
        direction,
        length: rod,
        ends: [swing + pace * joint, second],
        farthest: travel.max(pace * rate),
        slide: [0.0; 2],
    })
}

/// Bounds the second derivative of a unit vector along a vector with these bounds.
fn second_of_direction(first: f64, second: f64, length: f64) -> f64 {
    let turn = first / length;
    second / length + 3.0 * turn * turn
}
