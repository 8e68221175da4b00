// SPDX-License-Identifier: GPL-2.0-or-later
//! Jacobian rows of the joints at a pose of a machine, for a motion about the tool
//! tip.

use crate::read::legs::{drive_rate, platform_anchor};
use crate::read::mechanism::Mechanism;
use kinematics::{At, Fault, Letter, MAX_JOINTS, Matrix3, Pose, Vector3};
use nalgebra::SMatrix;

/// Rows by joints and coordinates of the pose; rows beyond the last joint, and columns of coordinates that
/// no joint moves, are 0.
pub type Rows = SMatrix<f64, MAX_JOINTS, 6>;

/// Singular values below this share of the largest count as 0: far above the rounding of linearly dependent
/// rows (1e-15), far below those of any pose in operation, and of a
/// machine that the core accepts ([`kinematics::CERTAIN_AT_ALL`]).
pub const RANK_TOLERANCE: f64 = 1e-9;

/// Returns the extension of each leg, and the motion of each table axis, per unit of X Y Z and per radian of
/// A B C, without the correction for a rotating nut. `tool` is that of `at`.
///
/// A leg's row is `[uᵀ (ρ × u)ᵀ]` with u along the leg and ρ from the control point to its
/// anchor; the rate map of R = Rz Ry Rx converts A B C. The legs do not take part in the
/// motion of `CENTRE` along a table or a guide.
pub fn length_rows(config: &Mechanism, at: &At, tool: &Vector3<f64>) -> Rows {
    let layout = config.machine.layout();
    let centre = Vector3::from(config.geometry.centre);
    let lever = at.rotation() * (tool + centre);
    let map = rate_map(at.pose());
    let mut rows = Rows::zeros();
    let mut set = |row: usize, force: Vector3<f64>, moment: Vector3<f64>| {
        let angular = map.tr_mul(&(moment + lever.cross(&force)));
        for k in 0..3 {
            (rows[(row, k)], rows[(row, k + 3)]) = (force[k], angular[k]);
        }
    };
    let active = |k: usize| layout.coordinates().contains(Letter::ALL[k]);
    for (i, leg) in config.geometry.legs().iter().enumerate() {
        let u = at.segments()[i].span().normalize();
        let anchor = platform_anchor(leg, &at.segments()[i], &at.rotation());
        let arm = at.rotation() * (anchor - centre);
        let force = Vector3::from_fn(|k, _| if active(k) { u[k] } else { 0.0 });
        set(i, force, arm.cross(&u));
    }
    for (i, letter) in layout.table().as_slice().iter().enumerate() {
        let force = Vector3::from_fn(|k, _| f64::from(u8::from(k == letter.index())));
        set(config.legs() + i, force, Vector3::zeros());
    }
    moved_columns(config, rows)
}

/// Returns the rows with the correction for a rotating nut: the extension of each leg by its
/// joint alone.
///
/// By virtual work these are also the wrench of an axial force f in a leg on the platform while its
/// motor is locked: f along the leg, and the torque f · lead / 2π of the thread,
/// transmitted by both cardan joints.
///
/// # Errors
/// As [`At::inverse_jacobian`].
pub fn joint_rows(config: &Mechanism, at: &At) -> Result<Rows, Fault> {
    let mut rows = at.inverse_jacobian()?;
    let angular = rows.fixed_columns::<3>(3) * rate_map(at.pose());
    rows.fixed_columns_mut::<3>(3).copy_from(&angular);
    for (mut row, gain) in rows.row_iter_mut().zip(gains(config, at)) {
        row *= gain;
    }
    Ok(moved_columns(config, rows))
}

/// Returns the extension of a leg, or the motion of a table axis, per joint unit.
pub fn gains(config: &Mechanism, at: &At) -> Vec<f64> {
    let legs = config.geometry.legs().iter().zip(at.segments());
    let of_leg = legs.map(|(leg, segment)| {
        let along = segment.span().normalize();
        drive_rate(leg, segment).map_or(1.0, |rate| rate.dot(&along).abs())
    });
    let table = config.machine.layout().table().len();
    of_leg.chain(std::iter::repeat_n(1.0, table)).collect()
}

/// Returns the gains in mm, per mm or radian of the joint.
pub fn gains_in_mm(config: &Mechanism, at: &At) -> Vec<f64> {
    let mut gains = gains(config, at);
    for (gain, leg) in gains.iter_mut().zip(config.geometry.legs()) {
        if leg.kind.is_angular() {
            *gain = gain.to_degrees() / config.units_per_mm;
        }
    }
    gains
}

/// Returns the rows with zeros for coordinates that no joint moves.
pub fn moved_columns(config: &Mechanism, mut rows: Rows) -> Rows {
    for letter in Letter::ALL.into_iter().filter(|l| config.machine.layout().is_held(*l)) {
        rows.column_mut(letter.index()).fill(0.0);
    }
    rows
}

/// Returns the coordinates that a joint moves.
pub fn moved(config: &Mechanism) -> Vec<Letter> {
    let layout = config.machine.layout();
    Letter::ALL.into_iter().filter(|letter| !layout.is_held(*letter)).collect()
}

/// Returns the singular values of the rows over `moved` coordinates, largest first.
pub fn singular_values(rows: &Rows, moved: usize) -> Vec<f64> {
    let mut values: Vec<f64> = rows.singular_values().iter().copied().collect();
    values.sort_by(|a, b| b.total_cmp(a));
    values.truncate(moved);
    values
}

/// Returns the pseudo-inverse of rows with `moved` coordinates; `None` at a singular pose.
pub fn inverse(rows: &Rows, moved: usize) -> Option<SMatrix<f64, 6, MAX_JOINTS>> {
    let values = singular_values(rows, moved);
    let (most, least) = (*values.first()?, *values.last()?);
    if !(least > RANK_TOLERANCE * most) {
        return None;
    }
    rows.pseudo_inverse(least / 2.0).ok()
}

/// Returns the angular velocity in base per rate of A, B, C: columns of R = Rz(C) Ry(B) Rx(A).
pub fn rate_map(pose: &Pose) -> Matrix3<f64> {
    let ((sb, cb), (sc, cc)) = (pose.angles.y.sin_cos(), pose.angles.z.sin_cos());
    Matrix3::new(cc * cb, -sc, 0.0, sc * cb, cc, 0.0, -sb, 0.0, 1.0)
}
