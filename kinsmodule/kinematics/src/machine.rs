// SPDX-License-Identifier: GPL-2.0-or-later
//! The checked, frozen machine, and its legs at one place of the platform.

use crate::fault::{Cause, Fault};
use crate::lanes::Lanes3;
use crate::leg::Leg;
use crate::nut::{Nut, Twist};
use libm::sqrt;
use nalgebra::{Matrix3, Vector3};

/// Shortest leg that still has a direction, as a share of the size.
const MIN_LENGTH: f64 = 1e-6;

/// A parallel machine of N legs, made by [`Machine::freeze`], which checks it.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine<const N: usize> {
    pub(crate) legs: [Leg; N],
    /// Base anchors in base.
    pub(crate) base: Lanes3<N>,
    /// Platform anchors about their centroid: the reference point of all solvers, so
    /// that a long tool does not weaken the certificate.
    pub(crate) arms: Lanes3<N>,
    /// Centroid of the platform anchors in the platform frame.
    pub(crate) centroid: Vector3<f64>,
    /// Joint = native value + correction − offset.
    pub(crate) offset: [f64; N],
    pub(crate) nut: Option<Nut<N>>,
    /// Largest anchor distance from its frame's origin.
    pub(crate) size: f64,
    /// Root mean square of the arms' lengths.
    pub(crate) radius: f64,
    /// Per leg √(1 + (|arm|/radius)²): bound of the platform anchor's speed.
    pub(crate) s1: [f64; N],
    /// Per leg |arm|/radius²: bound of the platform anchor's second derivative.
    pub(crate) s2: [f64; N],
}

/// The legs at one place of the platform.
pub(crate) struct Placed<const N: usize> {
    /// Arms in base (R times the platform anchor about the centroid).
    pub arms: Lanes3<N>,
    /// From moving base anchor to platform anchor.
    pub span: Lanes3<N>,
    pub length: [f64; N],
}

impl<const N: usize> Placed<N> {
    /// Unit vectors along the legs, base to platform.
    #[inline]
    pub fn directions(&self) -> Lanes3<N> {
        let mut inverse = [0.0; N];
        for i in 0..N {
            inverse[i] = 1.0 / self.length[i];
        }
        self.span.scaled(&inverse)
    }
}

impl<const N: usize> Machine<N> {
    /// Largest distance of an anchor from the origin of its frame: what relative
    /// tolerances refer to. Machine units.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Root mean square distance of the platform anchors from their centroid: turns
    /// an angle into a length in pose distances. Machine units.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Place of the centroid in base for a pose with rotation `r`.
    ///
    /// P = t − o + R (o + centroid): the tool o changes nothing while R = 1.
    #[inline]
    pub(crate) fn centre(
        &self,
        position: &Vector3<f64>,
        r: &Matrix3<f64>,
        tool: &Vector3<f64>,
    ) -> Vector3<f64> {
        position - tool + r * (tool + self.centroid)
    }

    /// Legs between `anchors` (moving base anchors) and the platform at centre and rotation.
    #[inline]
    pub(crate) fn placed(
        &self,
        anchors: &Lanes3<N>,
        centre: &Vector3<f64>,
        r: &Matrix3<f64>,
    ) -> Result<Placed<N>, Fault> {
        let arms = self.arms.rotated(r);
        let span = arms.shifted_minus(centre, anchors);
        let mut length = span.dot(&span);
        for l in &mut length {
            *l = sqrt(*l);
        }
        let shortest = MIN_LENGTH * self.size;
        for (i, l) in length.iter().enumerate() {
            if !(*l > shortest) {
                return Err(Fault::of_leg(Cause::StrutTooShort, i, *l));
            }
        }
        Ok(Placed { arms, span, length })
    }

    /// Twist of every leg, if any leg has a lead.
    #[inline]
    pub(crate) fn twist(&self, n: &Lanes3<N>, r: &Matrix3<f64>) -> Result<Option<Twist<N>>, Fault> {
        self.nut.as_ref().map(|nut| nut.twist(n, r)).transpose()
    }

    /// Rows of the length constraints at a place of the platform: one column per lane
    /// array, linear part first, about the centroid; the last three per radian.
    #[inline]
    pub(crate) fn rows(
        &self,
        placed: &Placed<N>,
        n: &Lanes3<N>,
        twist: Option<&Twist<N>>,
    ) -> [[f64; N]; 6] {
        let mut force = *n;
        let mut moment = Lanes3::ZERO;
        if let (Some(nut), Some(twist)) = (&self.nut, twist) {
            let rates = nut.rates(twist, n, &placed.length);
            for i in 0..N {
                force.set(i, n.get(i) + rates.along.get(i));
            }
            moment = rates.moment;
        }
        let lever = placed.arms.cross(&force);
        for i in 0..N {
            moment.set(i, moment.get(i) + lever.get(i));
        }
        [force.x, force.y, force.z, moment.x, moment.y, moment.z]
    }

    /// The angular columns per unit of radius·angle instead of per radian.
    #[inline]
    pub(crate) fn scaled(&self, mut columns: [[f64; N]; 6]) -> [[f64; N]; 6] {
        let inverse = 1.0 / self.radius;
        for column in &mut columns[3..] {
            for value in column {
                *value *= inverse;
            }
        }
        columns
    }
}
