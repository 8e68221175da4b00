// SPDX-License-Identifier: GPL-2.0-or-later
//! Poses in LinuxCNC's form: position and the angles A, B, C with
//! R = Rz(C) Ry(B) Rx(A).

use crate::fault::{Cause, Fault};
use crate::lanes::{are_within, both, pair};
use crate::trig::{MAX_ANGLE_DEG, RADIANS, arc, arcs, sincos, sincos_of_one};
use core::f64::consts::FRAC_PI_2;
use libm::{atan2, sqrt};
use nalgebra::{Matrix3, Vector3};
use wide::f64x2;

/// cos B below which rounding would determine C.
const GIMBAL_COS: f64 = 1e-12;

/// Position of the control point and orientation of the platform, in base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Control point (tool tip) in base, in machine units.
    pub position: Vector3<f64>,
    /// A, B, C in radians; R = Rz(C) Ry(B) Rx(A). Whole turns are kept.
    pub angles: Vector3<f64>,
}

impl Pose {
    /// Converts (x, y, z, a, b, c), machine units and degrees, to a pose.
    pub fn from_degrees(v: [f64; 6]) -> Self {
        // Pairs, see `lanes`.
        let [z, alpha] = (pair(&v, 2) * f64x2::new([1.0, RADIANS])).to_array();
        let [beta, gamma] = (pair(&v, 4) * both(RADIANS)).to_array();
        Self { position: Vector3::new(v[0], v[1], z), angles: Vector3::new(alpha, beta, gamma) }
    }

    /// Converts to (x, y, z, a, b, c), machine units and degrees.
    pub fn to_degrees(&self) -> [f64; 6] {
        let Self { position: p, angles: a } = self;
        let [z, alpha] = (f64x2::new([p.z, a.x]) / f64x2::new([1.0, RADIANS])).to_array();
        let [beta, gamma] = (f64x2::new([a.y, a.z]) / both(RADIANS)).to_array();
        [p.x, p.y, z, alpha, beta, gamma]
    }

    /// Returns whether all six components are finite.
    pub fn is_finite(&self) -> bool {
        let Self { position: p, angles: a } = self;
        are_within(&[p.x, p.y, p.z, a.x, a.y, a.z], f64::MAX)
    }

    /// Computes the orientation: base from platform.
    #[inline(always)]
    pub fn rotation(&self) -> Matrix3<f64> {
        self.trigonometry().rotation()
    }

    /// Computes the distance of two poses as a length: ‖(Δp, radius · rotation angle)‖.
    ///
    /// `radius` converts an angle to a length; normally [`crate::Machine::radius`].
    pub fn distance(&self, other: &Pose, radius: f64) -> f64 {
        let turn = rotation_vector(&(other.rotation() * self.rotation().transpose()));
        let move_ = other.position - self.position;
        sqrt(move_.norm_squared() + radius * radius * turn.norm_squared())
    }

    /// Refuses values that are not finite or too large.
    #[inline(always)]
    pub(crate) fn check(&self) -> Result<(), Fault> {
        if !self.is_finite() {
            return Err(Cause::PoseNotFinite.into());
        }
        match self.angles.iter().find(|angle| !(angle.abs() <= MAX_ANGLE_DEG * RADIANS)) {
            Some(angle) => Err(Fault::with_value(Cause::AngleTooLarge, angle / RADIANS)),
            None => Ok(()),
        }
    }

    /// Computes E with ω = E · (Ȧ, Ḃ, Ċ), ω in base axes, radians.
    pub fn rate_map(&self) -> Matrix3<f64> {
        self.trigonometry().rate_map()
    }

    #[inline(always)]
    pub(crate) fn trigonometry(&self) -> Trigonometry {
        let (sines, cosines) = sincos(f64x2::new([self.angles.x, self.angles.y]));
        let ([sa, sb], [ca, cb]) = (sines.to_array(), cosines.to_array());
        let [sc, cc] = sincos_of_one(self.angles.z);
        Trigonometry { sa, ca, sb, cb, sc, cc }
    }
}

/// Sines and cosines of A, B, C, computed once per call.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trigonometry {
    pub sa: f64,
    pub ca: f64,
    pub sb: f64,
    pub cb: f64,
    pub sc: f64,
    pub cc: f64,
}

impl Trigonometry {
    /// For angles of 0.
    pub const LEVEL: Self = Self { sa: 0.0, ca: 1.0, sb: 0.0, cb: 1.0, sc: 0.0, cc: 1.0 };

    /// Computes R = Rz(C) Ry(B) Rx(A).
    #[inline(always)]
    pub fn rotation(&self) -> Matrix3<f64> {
        let Self { sa, ca, sb, cb, sc, cc } = *self;
        Matrix3::new(
            cc * cb,
            cc * sb * sa - sc * ca,
            cc * sb * ca + sc * sa,
            sc * cb,
            sc * sb * sa + cc * ca,
            sc * sb * ca - cc * sa,
            -sb,
            cb * sa,
            cb * ca,
        )
    }

    /// Computes E with ω = E · (Ȧ, Ḃ, Ċ), ω in base axes; det E = cos B.
    pub fn rate_map(&self) -> Matrix3<f64> {
        let Self { sb, cb, sc, cc, .. } = *self;
        Matrix3::new(cc * cb, -sc, 0.0, sc * cb, cc, 0.0, -sb, 0.0, 1.0)
    }
}

/// Computes the angles A, B, C (radians) of `r` nearest to those of `seed`.
///
/// Increments from the seed keep whole turns and pass ±180° without a jump. Of the two
/// triples with this rotation (B and 180° − B) the one nearer to the seed is returned, so
/// that B can pass 90°.
pub(crate) fn angles_near(r: &Matrix3<f64>, seed: &Pose, trig: &Trigonometry) -> Vector3<f64> {
    let sheet = if trig.cb < 0.0 { -1.0 } else { 1.0 };
    let same = angles_on_sheet(r, seed, trig, sheet);
    if (same.z - seed.angles.z).abs() <= FRAC_PI_2 {
        return same;
    }
    let other = angles_on_sheet(r, seed, trig, -sheet);
    let away = |angles: &Vector3<f64>| (angles - seed.angles).abs().sum();
    if away(&other) < away(&same) { other } else { same }
}

/// cos² B above which A, B and C are computed independently: rounding is then amplified at most ten times
/// in A and C, and no division waits for another one.
const APART: f64 = 0.01;

/// Computes the triple whose cos B has the sign of `sheet`.
fn angles_on_sheet(r: &Matrix3<f64>, seed: &Pose, trig: &Trigonometry, sheet: f64) -> Vector3<f64> {
    let square = r[(0, 0)] * r[(0, 0)] + r[(1, 0)] * r[(1, 0)];
    if !(square >= APART) {
        return angles_in_turn(r, seed, trig, sheet * sqrt(square));
    }
    // First column cos B (cos C, sin C, ·), last row cos B (·, sin A, cos A).
    let (s, c) = (f64x2::new([r[(2, 1)], r[(1, 0)]]), f64x2::new([r[(2, 2)], r[(0, 0)]]));
    let (s0, c0) = (f64x2::new([trig.sa, trig.sc]), f64x2::new([trig.ca, trig.cc]));
    let side = both(sheet);
    let [a, c] = arcs(side * (s * c0 - c * s0), side * (c * c0 + s * s0)).to_array();
    let (sin_b, cos_b) = (-r[(2, 0)], sheet * sqrt(square));
    let b = arc(sin_b * trig.cb - cos_b * trig.sb, cos_b * trig.cb + sin_b * trig.sb);
    seed.angles + Vector3::new(a, b, c)
}

/// Computes the angles near |B| = 90°, where C keeps the seed's value. C is computed first, then A and B from
/// the remaining rotation: together they reproduce it to rounding even where A and C are
/// almost indistinguishable.
fn angles_in_turn(r: &Matrix3<f64>, seed: &Pose, trig: &Trigonometry, cos_b: f64) -> Vector3<f64> {
    let (sin_c, cos_c) = if cos_b.abs() >= GIMBAL_COS {
        (r[(1, 0)] / cos_b, r[(0, 0)] / cos_b)
    } else {
        (trig.sc, trig.cc)
    };
    // Rz(C)ᵀ R = Ry(B) Rx(A): first row (cos B, ·, ·), middle row (0, cos A, −sin A).
    let cos_b = cos_c * r[(0, 0)] + sin_c * r[(1, 0)];
    let cos_a = cos_c * r[(1, 1)] - sin_c * r[(0, 1)];
    let sin_a = sin_c * r[(0, 2)] - cos_c * r[(1, 2)];
    // The short way from the seed's directions.
    let (s0, c0) = (f64x2::new([trig.sa, trig.sb]), f64x2::new([trig.ca, trig.cb]));
    let (s, c) = (f64x2::new([sin_a, -r[(2, 0)]]), f64x2::new([cos_a, cos_b]));
    let [a, b] = arcs(s * c0 - c * s0, c * c0 + s * s0).to_array();
    let c = arc(sin_c * trig.cc - cos_c * trig.sc, cos_c * trig.cc + sin_c * trig.sc);
    seed.angles + Vector3::new(a, b, c)
}

/// Computes the rotation vector (axis times angle) of `r`, angle in [0, π].
pub(crate) fn rotation_vector(r: &Matrix3<f64>) -> Vector3<f64> {
    let twice_sin_axis =
        Vector3::new(r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]);
    let twice_sin = twice_sin_axis.norm();
    let angle = atan2(twice_sin, r.trace() - 1.0);
    if twice_sin > 1e-9 {
        return twice_sin_axis * (angle / twice_sin);
    }
    if angle < 1.0 {
        return twice_sin_axis * 0.5;
    }
    // At a half turn the sine does not determine the axis, but R + Rᵀ does.
    let symmetric = (r + r.transpose()) * 0.5 + Matrix3::identity();
    let mut axis = symmetric.column(0).into_owned();
    for i in 1..3 {
        let column = symmetric.column(i).into_owned();
        if column.norm_squared() > axis.norm_squared() {
            axis = column;
        }
    }
    axis * (angle / axis.norm())
}

/// Computes the change by a rotation of about |ω| radians about ω (Cayley's formula): C − 1, with C
/// exactly orthogonal and its angle never larger than |ω|.
#[inline(always)]
pub(crate) fn cayley_change(w: &Vector3<f64>) -> Matrix3<f64> {
    let h = w * 0.5;
    let k = 2.0 / (1.0 + h.norm_squared());
    let (x, y, z) = (h.x, h.y, h.z);
    Matrix3::new(
        -(y * y + z * z),
        x * y - z,
        x * z + y,
        x * y + z,
        -(x * x + z * z),
        y * z - x,
        x * z - y,
        y * z + x,
        -(x * x + y * y),
    ) * k
}

/// Computes the angular velocity of the rotation by Cayley's formula about `w` while `w` changes at `rate`.
#[inline(always)]
pub(crate) fn cayley_rate(w: &Vector3<f64>, rate: &Vector3<f64>) -> Vector3<f64> {
    let h = w * 0.5;
    (rate + h.cross(rate)) * (1.0 / (1.0 + h.norm_squared()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(v: [f64; 6]) -> Pose {
        Pose::from_degrees(v)
    }

    /// 1e-12 rad: a few hundred roundings of values near 1.
    const ANGLE: f64 = 1e-12;

    #[test]
    fn rotation_is_rz_ry_rx() {
        let r = pose([0.0, 0.0, 0.0, 30.0, -20.0, 50.0]);
        let axis = |i: usize, s: f64| {
            let mut v = Vector3::zeros();
            v[i] = s;
            nalgebra::Rotation3::new(v)
        };
        let product = axis(2, r.angles.z) * axis(1, r.angles.y) * axis(0, r.angles.x);
        assert!((product.matrix() - r.rotation()).norm() < ANGLE);
    }

    #[test]
    fn angles_near_returns_what_made_the_rotation_over_turns_and_sheets() {
        for v in [
            [0.0, 0.0, 0.0, 179.9, 10.0, -179.9],
            [0.0, 0.0, 0.0, 725.0, -40.0, 359.0],
            [0.0, 0.0, 0.0, 10.0, 120.0, 20.0],
            [0.0, 0.0, 0.0, 10.0, -250.0, 20.0],
        ] {
            let target = pose(v);
            let mut near = target;
            near.angles += Vector3::new(0.01, -0.02, 0.015);
            let got = angles_near(&target.rotation(), &near, &near.trigonometry());
            assert!((got - target.angles).norm() < ANGLE, "{v:?}: {got:?}");
        }
    }

    #[test]
    fn at_b_90_c_keeps_the_seed_and_a_takes_the_rest() {
        let target = pose([0.0, 0.0, 0.0, 20.0, 90.0, 5.0]);
        let seed = pose([0.0, 0.0, 0.0, 18.0, 89.0, 5.0]);
        let got = angles_near(&target.rotation(), &seed, &seed.trigonometry());
        assert_eq!(got.z, seed.angles.z);
        assert!((got - target.angles).norm() < 1e-7, "{got:?}");
    }

    #[test]
    fn near_b_90_the_angles_give_the_rotation_back_to_rounding() {
        for off in [1e-3, 1e-5, 1e-7, 1e-9, 1e-13, 0.0] {
            let target = pose([0.0, 0.0, 0.0, 10.0, 90.0 - off, 20.0]);
            let seed = pose([0.0, 0.0, 0.0, 10.0, 90.0 - off, 0.0]);
            let r = target.rotation();
            let got = Pose { angles: angles_near(&r, &seed, &seed.trigonometry()), ..seed };
            // 4e-15: a few roundings of nine elements.
            assert!((got.rotation() - r).norm() < 4e-15, "{off}: {got:?}");
        }
    }

    #[test]
    fn b_passes_90_without_a_jump_of_the_other_angles() {
        let mut last = pose([0.0, 0.0, 0.0, 3.0, 89.99, -2.0]);
        for k in -8..9 {
            let target = pose([0.0, 0.0, 0.0, 3.0, 90.0 + 0.00125 * f64::from(k), -2.0]);
            let got = angles_near(&target.rotation(), &last, &last.trigonometry());
            last = Pose { angles: got, ..last };
        }
        // 1e-6: at B = 90 rounding divided by cos B distributes the sum of A and C.
        let expected = [3.0, 90.01, -2.0];
        for (a, b) in last.to_degrees()[3..].iter().zip(expected) {
            assert!((a - b).abs() < 1e-6, "{last:?}");
        }
    }

    #[test]
    fn b_passes_90_in_one_step_in_all_quadrants_of_a_and_c() {
        for (a, c) in [(3.0, -2.0), (70.0, 100.0), (-70.0, -100.0), (130.0, 85.0)] {
            for (from, to) in [(89.99, 90.01), (90.01, 89.99), (-89.99, -90.01), (269.9, 270.1)] {
                let [seed, target] = [from, to].map(|b| pose([0.0, 0.0, 0.0, a, b, c]));
                let got = angles_near(&target.rotation(), &seed, &seed.trigonometry());
                // 1e-4: half of the smallest cos B.
                assert!((got - target.angles).norm() < ANGLE / 1e-4, "{a} {from} {c}: {got:?}");
            }
        }
    }

    #[test]
    fn a_pose_is_checked_coordinate_by_coordinate_and_its_angle_returned() {
        assert_eq!(pose([1e300, -1e300, 1e300, 720.0, -720.0, 0.0]).check(), Ok(()));
        for k in 0..6 {
            for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                // Alone, and with any other.
                for other in 0..6 {
                    let mut v = [10.0; 6];
                    (v[k], v[other]) = (bad, bad);
                    assert_eq!(pose(v).check(), Err(Cause::PoseNotFinite.into()), "{k}: {bad}");
                    assert!(!pose(v).is_finite());
                }
            }
            for sign in [-1.0, 1.0] {
                let mut v = [10.0; 6];
                v[k] = sign * 999_999.0;
                assert_eq!(pose(v).check(), Ok(()), "{k}");
                v[k] = sign * 1_000_001.0;
                match pose(v).check() {
                    Ok(()) => assert!(k < 3, "{k}"),
                    Err(fault) => {
                        assert_eq!(fault, Fault::with_value(Cause::AngleTooLarge, fault.value));
                        // Degrees, converted through radians.
                        let off = (fault.value - v[k]).abs();
                        assert!(k >= 3 && off < 1e6 * 4.0 * f64::EPSILON, "{k}: {fault:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_rate_map_gives_the_angular_velocity_of_each_angle() {
        const STEP: f64 = 1e-5;
        let at = pose([0.0, 0.0, 0.0, 30.0, -20.0, 50.0]);
        for k in 0..3 {
            let moved = |by: f64| {
                let mut moved = at;
                moved.angles[k] += by;
                moved.rotation()
            };
            // Differences: an error of h², and rounding divided by h.
            let derivative = (moved(STEP) - moved(-STEP)) / (2.0 * STEP);
            let omega = at.trigonometry().rate_map().column(k).into_owned();
            assert!((omega.cross_matrix() * at.rotation() - derivative).norm() < 1e-9, "{k}");
        }
    }

    #[test]
    fn a_rotation_vector_is_the_one_that_made_the_rotation() {
        let axes = [[3.0, 0.0, 0.0], [0.0, -2.0, 0.0], [0.0, 0.0, 1.0], [1.0, -2.0, 3.0]];
        let axes = axes.into_iter().chain([[-3.0, 1.0, 2.0], [1.0, 3.0, -2.0]]);
        for axis in axes.map(|axis| Vector3::from(axis).normalize()) {
            for angle in [0.0, 1e-12, 1e-8, 0.3, 1.5, 3.0, 3.1] {
                let rotation = nalgebra::Rotation3::new(axis * angle);
                let got = rotation_vector(rotation.matrix());
                assert!((got - axis * angle).norm() < ANGLE, "{axis:?} {angle}: {got:?}");
            }
            // So near to half a turn that the sine does not determine the axis: either direction about it.
            for off in [0.0, 1e-12, -1e-12] {
                let half = nalgebra::Rotation3::new(axis * (core::f64::consts::PI + off));
                let got = rotation_vector(half.matrix());
                // The offset, and rounding.
                assert!((got.norm() - core::f64::consts::PI).abs() < 2e-12, "{axis:?}: {got:?}");
                assert!(got.cross(&axis).norm() < 1e-11, "{axis:?}: {got:?}");
            }
        }
    }

    #[test]
    fn rotation_vector_and_distance_measure_the_turn() {
        let a = pose([1.0, 2.0, 3.0, 0.0, 0.0, 0.0]);
        let b = pose([1.0, 2.0, 7.0, 90.0, 0.0, 0.0]);
        let quarter = core::f64::consts::FRAC_PI_2 * 3.0;
        let expected = sqrt(16.0 + quarter * quarter);
        assert!((a.distance(&b, 3.0) - expected).abs() < 1e-12);
        let half = pose([0.0, 0.0, 0.0, 180.0, 0.0, 0.0]).rotation();
        let v = rotation_vector(&half);
        assert!((v.norm() - core::f64::consts::PI).abs() < 1e-9, "{v:?}");
    }

    #[test]
    fn steep_and_flat_angles_have_the_same_sines() {
        use core::f64::consts::FRAC_PI_4;
        let (below, above) = (FRAC_PI_4, FRAC_PI_4 * (1.0 + f64::EPSILON));
        for axis in 0..3 {
            let at = |angle: f64| {
                let mut pose = pose([0.0; 6]);
                pose.angles[axis] = angle;
                pose.rotation()
            };
            // Two roundings of values below 1; below the limit, a few roundings of sines.
            assert!((at(below) - at(above)).amax() <= 2.0 * f64::EPSILON);
            assert!(
                (at(2.0) - nalgebra::Rotation3::new(Vector3::ith(axis, 2.0)).matrix()).amax()
                    < 1e-15
            );
        }
    }

    #[test]
    fn the_rate_of_cayleys_rotation_is_its_derivative() {
        let (w, rate) = (Vector3::new(0.3, -0.2, 0.5), Vector3::new(-0.4, 0.7, 0.1));
        let at = |t: f64| Matrix3::identity() + cayley_change(&(w + rate * t));
        // Differences of step h: an error of h², and rounding divided by h.
        const STEP: f64 = 1e-5;
        let derivative = (at(STEP) - at(-STEP)) / (2.0 * STEP);
        let omega = cayley_rate(&w, &rate);
        assert!((omega.cross_matrix() * at(0.0) - derivative).norm() < 1e-9);
    }

    #[test]
    fn cayley_is_orthogonal_and_turns_no_more_than_asked() {
        let w = Vector3::new(0.3, -0.2, 0.5);
        let r = Matrix3::identity() + cayley_change(&w);
        assert!((r * r.transpose() - Matrix3::identity()).norm() < 1e-14);
        assert!(rotation_vector(&r).norm() <= w.norm());
    }
}
