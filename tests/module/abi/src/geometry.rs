// SPDX-License-Identifier: GPL-2.0-or-later
//! Vectors, LinuxCNC's rotation and the distance of two poses, independent of
//! the module's mathematics.

use crate::module::Pose;

/// A vector or point.
pub type Vector = [f64; 3];

/// Rows of a rotation matrix.
pub type Rows = [[f64; 3]; 3];

/// Returns a · b.
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns a × b.
pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Returns a − b.
pub fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Returns a + b.
pub fn plus(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// Returns k a.
pub fn scaled(a: Vector, k: f64) -> Vector {
    [k * a[0], k * a[1], k * a[2]]
}

/// Returns |a|.
pub fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// Returns a / |a|.
pub fn unit(a: Vector) -> Vector {
    scaled(a, 1.0 / norm(a))
}

/// Returns M v.
pub fn turned(m: &Rows, v: Vector) -> Vector {
    [dot(m[0], v), dot(m[1], v), dot(m[2], v)]
}

/// Returns R = Rz(C) Ry(B) Rx(A) of a pose.
pub fn rotation(pose: &Pose) -> Rows {
    let (sa, ca) = pose[3].to_radians().sin_cos();
    let (sb, cb) = pose[4].to_radians().sin_cos();
    let (sc, cc) = pose[5].to_radians().sin_cos();
    [
        [cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa],
        [sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa],
        [-sb, cb * sa, cb * ca],
    ]
}

/// Returns the distance of two poses as a length: √(|Δp|² + (radius · angle)²).
///
/// The angle is 2 asin(|R₁ − R₂| / √8) with the Frobenius norm, which is accurate
/// for small angles, unlike a trace.
pub fn distance(one: &Pose, other: &Pose, radius: f64) -> f64 {
    let (r1, r2) = (rotation(one), rotation(other));
    let difference: f64 = (0..3).map(|i| minus(r1[i], r2[i])).map(|d| dot(d, d)).sum();
    let angle = 2.0 * (difference.sqrt() / 8.0_f64.sqrt()).min(1.0).asin();
    let moved = norm(minus([one[0], one[1], one[2]], [other[0], other[1], other[2]]));
    moved.hypot(radius * angle)
}
