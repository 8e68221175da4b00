// SPDX-License-Identifier: GPL-2.0-or-later
//! Jacobian rows of the joints at a pose of a machine, for a motion about the tool
//! tip.

use crate::read::legs::{drive_rate, platform_anchor};
use crate::read::mechanism::Mechanism;
use kinematics::{
    At, ConstraintGeometry, Fault, Geometry, Letter, MAX_JOINTS, Machine, Matrix3, Pose, Vector3,
};
use nalgebra::{Matrix6, SMatrix};

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
/// motion of `CENTRE` along a table or a guide. Coordinates that constraints determine follow the commanded ones.
pub fn length_rows(config: &Mechanism, at: &At, tool: &Vector3<f64>) -> Rows {
    let layout = config.machine.layout();
    let centre = Vector3::from(config.geometry.centre);
    let lever = at.rotation() * (tool + centre);
    let full = at.full_pose();
    let map = rate_map(&full);
    let is_bound = layout.constraints() > 0;
    let mut rows = Rows::zeros();
    let mut set = |row: usize, force: Vector3<f64>, moment: Vector3<f64>| {
        let angular = map.tr_mul(&(moment + lever.cross(&force)));
        for k in 0..3 {
            (rows[(row, k)], rows[(row, k + 3)]) = (force[k], angular[k]);
        }
    };
    let active = |k: usize| is_bound || layout.coordinates().contains(Letter::ALL[k]);
    for (i, leg) in config.geometry.legs().iter().enumerate() {
        let u = at.segments()[i].span().normalize();
        let anchor = platform_anchor(leg, &at.segments()[i], &at.rotation());
        let arm = at.rotation() * (anchor - centre);
        let force = Vector3::from_fn(|k, _| if active(k) { u[k] } else { 0.0 });
        set(i, force, arm.cross(&u));
    }
    if is_bound {
        let follow = follow(&config.geometry, config.machine.radius(), at, tool);
        rows *= follow;
        // The table moves the rest of the commanded way.
        for (i, letter) in layout.table().as_slice().iter().enumerate() {
            let k = letter.index();
            rows.set_row(config.legs() + i, &(Matrix6::identity().row(k) - follow.row(k)));
        }
        return moved_columns(config, rows);
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
    let mut rows = if config.machine.layout().constraints() > 0 {
        let mut rows = at.pose_jacobian()?;
        rows.fixed_columns_mut::<3>(3).scale_mut(1_f64.to_degrees());
        rows
    } else {
        let mut rows = at.inverse_jacobian()?;
        let angular = rows.fixed_columns::<3>(3) * rate_map(at.pose());
        rows.fixed_columns_mut::<3>(3).copy_from(&angular);
        rows
    };
    for (mut row, gain) in rows.row_iter_mut().zip(gains(config, at)) {
        row *= gain;
    }
    Ok(moved_columns(config, rows))
}

/// Returns the rates of all coordinates of the control point in base per rate of LinuxCNC's coordinates, machine units and
/// radians: the identity, but for coordinates that constraints determine. `tool` is that of `at`, `radius` that of the
/// machine.
pub fn follow(geometry: &Geometry, radius: f64, at: &At, tool: &Vector3<f64>) -> Matrix6<f64> {
    let layout = geometry.layout();
    let dependent = Letter::ALL.map(|letter| layout.is_dependent(letter));
    let mut follow = Matrix6::from_fn(|i, k| if i == k && !dependent[k] { 1.0 } else { 0.0 });
    if layout.constraints() == 0 {
        return follow;
    }
    let rows = constraint_rows(geometry, radius, at, tool);
    // Angles times a length of the machine, for the rank test.
    let unit = |k: usize| if k < 3 { 1.0 } else { radius };
    let own = Matrix6::from_fn(|i, k| if dependent[k] { rows[(i, k)] / unit(k) } else { 0.0 });
    let most = own.singular_values().max();
    let inverse = own.pseudo_inverse(RANK_TOLERANCE * most).unwrap_or_else(|_| Matrix6::zeros());
    let found = -inverse * rows * follow;
    for k in (0..6).filter(|k| dependent[*k]) {
        follow.set_row(k, &(found.row(k) / unit(k)));
    }
    follow
}

/// Returns one of LinuxCNC's poses with the values of the coordinates that constraints determine, except those that a table
/// compensates.
///
/// # Errors
/// As [`Machine::inverse`].
pub fn with_dependent(machine: &Machine, pose: &Pose, tool: &Vector3<f64>) -> Result<Pose, Fault> {
    let (mut whole, full) = (*pose, machine.full_pose(pose, tool)?);
    let layout = machine.layout();
    let is_shown = |letter: &Letter| layout.is_dependent(*letter) && layout.is_held(*letter);
    for letter in Letter::ALL.into_iter().filter(is_shown) {
        match letter.index() {
            k @ 0..3 => whole.position[k] = full.position[k],
            k => whole.angles[k - 3] = full.angles[k - 3],
        }
    }
    Ok(whole)
}

/// Returns the rates of tool tip and workpiece relative to each other like [`follow`]: a coordinate for which a table
/// makes up is commanded.
pub fn follow_on_work(
    geometry: &Geometry,
    radius: f64,
    at: &At,
    tool: &Vector3<f64>,
) -> Matrix6<f64> {
    let mut follow = follow(geometry, radius, at, tool);
    for letter in geometry.layout().table().as_slice() {
        let k = letter.index();
        follow.set_row(k, &Matrix6::identity().row(k));
    }
    follow
}

/// Returns the derivatives of the constraints of the platform, redundant ones included, by all coordinates of the control
/// point, as lengths per machine unit and radian; `radius` makes directions lengths.
fn constraint_rows(geometry: &Geometry, radius: f64, at: &At, tool: &Vector3<f64>) -> Matrix6<f64> {
    let rotation = at.rotation();
    let full = at.full_pose();
    let map = rate_map(&full);
    let lever = rotation * tool;
    let origin = full.position - tool + lever;
    let unit = |v: [f64; 3]| Vector3::from(v).normalize();
    let mut rows = Matrix6::zeros();
    for (i, constraint) in geometry.constraints().iter().enumerate() {
        // Per velocity of the platform's origin, and per angular velocity about it.
        let (force, moment) = match *constraint {
            ConstraintGeometry::PointInPlane { platform, normal, .. } => {
                let normal = unit(normal);
                (normal, (rotation * Vector3::from(platform)).cross(&normal))
            }
            ConstraintGeometry::PlaneThroughPoint { normal, base, .. } => {
                let normal = rotation * unit(normal);
                (-normal, normal.cross(&(Vector3::from(base) - origin)))
            }
            ConstraintGeometry::Square { platform_axis, base_axis } => {
                let scaled = rotation * unit(platform_axis) * radius;
                (Vector3::zeros(), scaled.cross(&unit(base_axis)))
            }
        };
        let angular = map.tr_mul(&(moment + lever.cross(&force)));
        for k in 0..3 {
            (rows[(i, k)], rows[(i, k + 3)]) = (force[k], angular[k]);
        }
    }
    rows
}

/// Returns the first constraint of the platform that depends on those before it at home.
///
/// # Errors
/// As [`Machine::inverse`].
pub fn redundant_constraint(config: &Mechanism) -> Result<Option<usize>, Fault> {
    let (machine, tool) = (&config.machine, &config.spindle);
    let at = machine.at(&config.home_pose(), tool)?;
    let mut rows = constraint_rows(&config.geometry, machine.radius(), &at, tool);
    // Angles times a length of the machine, for the rank test.
    rows.columns_mut(3, 3).unscale_mut(machine.radius());
    let mut known = 0..config.geometry.constraints().len();
    Ok(known.find(|last| {
        let values = rows.rows(0, last + 1).into_owned().singular_values();
        values.min() <= RANK_TOLERANCE.sqrt() * values.max()
    }))
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
