// SPDX-License-Identifier: GPL-2.0-or-later
//! One vector per leg, stored as three arrays: loops over legs then use vector units.

use nalgebra::{Matrix3, Vector3};

/// N vectors, component by component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lanes3<const N: usize> {
    pub x: [f64; N],
    pub y: [f64; N],
    pub z: [f64; N],
}

impl<const N: usize> Lanes3<N> {
    pub const ZERO: Self = Self { x: [0.0; N], y: [0.0; N], z: [0.0; N] };

    pub fn from_fn(f: impl Fn(usize) -> Vector3<f64>) -> Self {
        let mut lanes = Self::ZERO;
        for i in 0..N {
            lanes.set(i, f(i));
        }
        lanes
    }

    #[inline]
    pub fn get(&self, i: usize) -> Vector3<f64> {
        Vector3::new(self.x[i], self.y[i], self.z[i])
    }

    pub fn set(&mut self, i: usize, v: Vector3<f64>) {
        self.x[i] = v.x;
        self.y[i] = v.y;
        self.z[i] = v.z;
    }

    /// `m · v` for every lane.
    #[inline]
    pub fn rotated(&self, m: &Matrix3<f64>) -> Self {
        let mut out = Self::ZERO;
        for i in 0..N {
            out.x[i] = m[(0, 0)] * self.x[i] + m[(0, 1)] * self.y[i] + m[(0, 2)] * self.z[i];
            out.y[i] = m[(1, 0)] * self.x[i] + m[(1, 1)] * self.y[i] + m[(1, 2)] * self.z[i];
            out.z[i] = m[(2, 0)] * self.x[i] + m[(2, 1)] * self.y[i] + m[(2, 2)] * self.z[i];
        }
        out
    }

    /// `self + shift − other` for every lane.
    #[inline]
    pub fn shifted_minus(&self, shift: &Vector3<f64>, other: &Self) -> Self {
        let mut out = Self::ZERO;
        for i in 0..N {
            out.x[i] = self.x[i] + shift.x - other.x[i];
            out.y[i] = self.y[i] + shift.y - other.y[i];
            out.z[i] = self.z[i] + shift.z - other.z[i];
        }
        out
    }

    #[inline]
    pub fn cross(&self, other: &Self) -> Self {
        let mut out = Self::ZERO;
        for i in 0..N {
            out.x[i] = self.y[i] * other.z[i] - self.z[i] * other.y[i];
            out.y[i] = self.z[i] * other.x[i] - self.x[i] * other.z[i];
            out.z[i] = self.x[i] * other.y[i] - self.y[i] * other.x[i];
        }
        out
    }

    #[inline]
    pub fn dot(&self, other: &Self) -> [f64; N] {
        let mut out = [0.0; N];
        for i in 0..N {
            out[i] = self.x[i] * other.x[i] + self.y[i] * other.y[i] + self.z[i] * other.z[i];
        }
        out
    }

    #[inline]
    pub fn scaled(&self, factor: &[f64; N]) -> Self {
        let mut out = *self;
        for i in 0..N {
            out.x[i] *= factor[i];
            out.y[i] *= factor[i];
            out.z[i] *= factor[i];
        }
        out
    }
}
