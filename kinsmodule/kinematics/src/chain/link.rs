// SPDX-License-Identifier: GPL-2.0-or-later
//! One axis of a chain: position and velocity of a point that it carries.

use super::{Carries, World, is_rotary};
use crate::trig::{RADIANS, sincos_of_one};
use nalgebra::{Matrix3, Vector3};

/// An axis of the chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// Index of its letter among [`crate::POSE_LETTERS`].
    pub place: usize,
    /// What it carries.
    pub carries: Carries,
    /// Unit vector of its direction.
    pub axis: Vector3<f64>,
    /// A point on it; 0 for a linear axis.
    pub point: Vector3<f64>,
}

impl Link {
    pub(super) const NONE: Self = Self {
        place: 0,
        carries: Carries::Work,
        axis: Vector3::new(0.0, 0.0, 0.0),
        point: Vector3::new(0.0, 0.0, 0.0),
    };

    /// Returns whether the axis is rotary.
    pub fn is_rotary(&self) -> bool {
        is_rotary(self.place)
    }

    pub(super) fn value(&self, world: &World) -> f64 {
        world.get(self.place).copied().unwrap_or(f64::NAN)
    }

    /// Computes the orientation of what it carries; the identity for a linear axis.
    pub fn rotation(&self, world: &World) -> Matrix3<f64> {
        if !self.is_rotary() {
            return Matrix3::identity();
        }
        let [sine, cosine] = sincos_of_one(self.value(world) * RADIANS);
        let a = &self.axis;
        let across = a.cross_matrix();
        Matrix3::identity() + across * sine + across * across * (1.0 - cosine)
    }

    /// Computes the position of a carried point.
    pub fn out(&self, point: &Vector3<f64>, world: &World) -> Vector3<f64> {
        self.moved(Moving { at: *point, rate: Vector3::zeros() }, world, 0.0).at
    }

    /// Computes the point that the axis carries to a position.
    pub fn into(&self, place: &Vector3<f64>, world: &World) -> Vector3<f64> {
        self.seen(Moving { at: *place, rate: Vector3::zeros() }, world, 0.0).at
    }

    /// Computes a moving point that it carries; `change` is the rate of the axis value, in radians.
    pub(super) fn moved(&self, x: Moving, world: &World, change: f64) -> Moving {
        if !self.is_rotary() {
            let at = x.at + self.axis * self.value(world);
            return Moving { at, rate: x.rate + self.axis * change };
        }
        let rotation = self.rotation(world);
        let arm = rotation * (x.at - self.point);
        let rate = rotation * x.rate + self.axis.cross(&arm) * change;
        Moving { at: self.point + arm, rate }
    }

    /// Computes the inverse of [`Self::moved`].
    pub(super) fn seen(&self, x: Moving, world: &World, change: f64) -> Moving {
        if !self.is_rotary() {
            let at = x.at - self.axis * self.value(world);
            return Moving { at, rate: x.rate - self.axis * change };
        }
        let rotation = self.rotation(world).transpose();
        let arm = rotation * (x.at - self.point);
        let rate = rotation * x.rate - self.axis.cross(&arm) * change;
        Moving { at: self.point + arm, rate }
    }
}

/// A point and its velocity.
#[derive(Clone, Copy)]
pub(crate) struct Moving {
    pub(crate) at: Vector3<f64>,
    pub(crate) rate: Vector3<f64>,
}
