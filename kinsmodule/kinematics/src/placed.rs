// SPDX-License-Identifier: GPL-2.0-or-later
//! The pose of the platform, and the legs there.

use crate::lanes::{Lanes3, both, cross, dot, pair, put, scaled, sum, times, wide};
use nalgebra::{Matrix3, Vector3};
use wide::f64x2;

/// Pose of the platform: its reference point and orientation, in base. The order of
/// the fields is that of pairs, see `lanes`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub(crate) struct Place {
    pub rotation: Matrix3<f64>,
    pub centre: Vector3<f64>,
    /// A, B, C; updated only by [`crate::mechanism::Chart::Angles`].
    pub angles: Vector3<f64>,
}

impl Place {
    /// Level, with its reference point in the origin.
    pub const LEVEL: Self = Self {
        rotation: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        centre: Vector3::new(0.0, 0.0, 0.0),
        angles: Vector3::new(0.0, 0.0, 0.0),
    };
}

/// Motion of the platform from one pose to another.
pub(crate) struct Displacement {
    /// Of the reference point.
    pub shift: Vector3<f64>,
    /// The orientation R becomes R + `change` R.
    pub change: Matrix3<f64>,
}

/// The legs at one pose of the platform.
#[derive(Clone, Copy)]
pub(crate) struct Placed<const N: usize> {
    /// Arms in base: from the reference point to the platform anchors, which slide on rings.
    pub arms: Lanes3<N>,
    /// From moving base anchor to platform anchor.
    pub span: Lanes3<N>,
    pub length: [f64; N],
    /// Distances of the base anchors from the axes of their rings; meaningful only on machines
    /// with rings.
    pub rho: [f64; N],
}

impl<const N: usize> Placed<N> {
    pub const ZERO: Self =
        Self { arms: Lanes3::ZERO, span: Lanes3::ZERO, length: [0.0; N], rho: [0.0; N] };

    #[inline(always)]
    pub fn put(&mut self, i: usize, span: [f64x2; 3]) {
        self.span.put(i, span);
        put(&mut self.length, i, dot(&span, &span).sqrt());
    }

    /// Computes the legs after the platform has moved, into `placed`.
    #[inline(always)]
    pub fn moved(&self, by: &Displacement, placed: &mut Self) {
        let shift = wide(&by.shift);
        for i in (0..N).step_by(2) {
            let arm = self.arms.pair(i);
            let turned = times(&by.change, &arm);
            placed.arms.put(i, sum(&arm, &turned));
            placed.put(i, sum(&self.span.pair(i), &sum(&turned, &shift)));
        }
    }

    /// Computes the rates of the lengths while the platform moves at `v` and rotates at `omega`.
    #[inline(always)]
    pub fn length_rates(&self, v: &Vector3<f64>, omega: &Vector3<f64>) -> [f64; N] {
        let (v, omega) = (wide(v), wide(omega));
        let mut length_rates = [0.0; N];
        for i in (0..N).step_by(2) {
            let speed = sum(&v, &cross(&omega, &self.arms.pair(i)));
            put(&mut length_rates, i, dot(&self.span.pair(i), &speed) * self.curved(i));
        }
        length_rates
    }

    /// Computes the second derivatives of the lengths while the platform moves at `v` and rotates at `omega`,
    /// both constant: (|u|² − (n·u)²)/l + n·(ω × (ω × arm)), u the velocity of an arm's end.
    #[inline(always)]
    pub fn length_accelerations(&self, v: &Vector3<f64>, omega: &Vector3<f64>) -> [f64; N] {
        let (v, omega) = (wide(v), wide(omega));
        let mut accelerations = [0.0; N];
        for i in (0..N).step_by(2) {
            let turned = cross(&omega, &self.arms.pair(i));
            let u = sum(&v, &turned);
            let (span, curved) = (self.span.pair(i), self.curved(i));
            let along = dot(&span, &u) * curved;
            let pull = dot(&u, &u) - along * along + dot(&span, &cross(&omega, &turned));
            put(&mut accelerations, i, pull * curved);
        }
        accelerations
    }

    /// Computes the unit vectors along the legs, base to platform.
    #[inline(always)]
    pub fn directions(&self) -> Lanes3<N> {
        let mut n = Lanes3::ZERO;
        for i in (0..N).step_by(2) {
            n.put(i, scaled(&self.span.pair(i), self.curved(i)));
        }
        n
    }

    /// Computes 1/l of legs i and i + 1.
    #[inline(always)]
    pub fn curved(&self, i: usize) -> f64x2 {
        // A rod's platform anchor may coincide with its base anchor: no direction, but no NaN.
        both(1.0) / pair(&self.length, i).fast_max(both(f64::MIN_POSITIVE))
    }
}
