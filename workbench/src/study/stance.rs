// SPDX-License-Identifier: GPL-2.0-or-later
//! The legs at one pose of a machine, and the rows that tell what they feel of a motion.

use crate::read::machine::{MachineConfig, drive_rate};
use kinematics::{Fault, Letter, MAX_JOINTS, Matrix3, Pose, Segment, Vector3};
use nalgebra::SMatrix;

/// Joints by coordinates of the pose; rows beyond the last joint, and columns of coordinates that
/// no joint moves, are 0.
pub type Rows = SMatrix<f64, MAX_JOINTS, 6>;

/// Singular values below this share of the largest count as 0: far above the rounding of rows
/// that depend on each other (1e-15), far below those of a pose that any machine is run at.
const RANK_TOLERANCE: f64 = 1e-9;

/// A machine at a pose.
pub struct Stance<'a> {
    /// The machine.
    pub config: &'a MachineConfig,
    /// The pose.
    pub pose: Pose,
    /// Orientation of the platform, base from platform.
    pub rotation: Matrix3<f64>,
    /// The legs, in base.
    pub legs: Vec<Segment>,
    tool: Vector3<f64>,
}

impl<'a> Stance<'a> {
    /// Of a machine, with the tool vector (spindle offset included).
    ///
    /// # Errors
    /// As [`kinematics::Machine::inverse`].
    pub fn new(config: &'a MachineConfig, pose: Pose, tool: Vector3<f64>) -> Result<Self, Fault> {
        let segments = config.machine.segments(&pose, &tool)?;
        let legs = segments[..config.legs()].to_vec();
        Ok(Self { config, pose, rotation: pose.rotation(), legs, tool })
    }

    /// Unit vector along a leg, base to platform, in base.
    pub fn direction(&self, leg: usize) -> Vector3<f64> {
        (self.legs[leg].platform - self.legs[leg].base).normalize()
    }

    /// A point of the platform frame, in base.
    pub fn in_base(&self, point: &Vector3<f64>) -> Vector3<f64> {
        let anchor = Vector3::from(self.config.geometry.legs()[0].platform);
        self.legs[0].platform + self.rotation * (point - anchor)
    }

    /// Rows of the constraints: by how much each leg gets longer, and each table axis moves, per
    /// unit of X Y Z and per radian of A B C. Without the correction for a turning nut.
    ///
    /// A leg's row is `[uᵀ (ρ × u)ᵀ]` with u along the leg and ρ from the control point to its
    /// anchor; A B C turn by the rate map of R = Rz Ry Rx. What a table or a guide takes of the
    /// motion of `CENTRE` does not reach the legs.
    pub fn rows(&self) -> Rows {
        let layout = self.config.machine.layout();
        let centre = Vector3::from(self.config.geometry.centre);
        let lever = self.rotation * (self.tool + centre);
        let map = rate_map(&self.pose);
        let mut rows = Rows::zeros();
        let mut set = |row: usize, force: Vector3<f64>, moment: Vector3<f64>| {
            let angular = map.tr_mul(&(moment + lever.cross(&force)));
            for k in 0..3 {
                (rows[(row, k)], rows[(row, k + 3)]) = (force[k], angular[k]);
            }
        };
        for (i, leg) in self.config.geometry.legs().iter().enumerate() {
            let u = self.direction(i);
            let arm = self.rotation * (Vector3::from(leg.platform) - centre);
            let force =
                Vector3::from_fn(|k, _| match layout.coordinates().contains(Letter::ALL[k]) {
                    true => u[k],
                    false => 0.0,
                });
            set(i, force, arm.cross(&u));
        }
        for (i, letter) in layout.table().as_slice().iter().enumerate() {
            let force = Vector3::from_fn(|k, _| f64::from(u8::from(k == letter.index())));
            set(self.legs.len() + i, force, Vector3::zeros());
        }
        moved_columns(self.config, rows)
    }

    /// The same rows with the correction for a turning nut: by how much each leg would get longer
    /// from its joint alone.
    ///
    /// By virtual work they are also what an axial force f in a leg does to the platform while its
    /// motor holds the joint: beside f along the leg, the torque f · lead / 2π of the thread, which
    /// goes through both cardan joints.
    ///
    /// # Errors
    /// As [`kinematics::Machine::inverse_jacobian`].
    pub fn joint_rows(&self) -> Result<Rows, Fault> {
        let of_twist = self.config.machine.inverse_jacobian(&self.pose, &self.tool)?;
        let mut rows = of_twist;
        let angular = of_twist.fixed_columns::<3>(3) * rate_map(&self.pose);
        rows.fixed_columns_mut::<3>(3).copy_from(&angular);
        for (mut row, gain) in rows.row_iter_mut().zip(self.gains()) {
            row *= gain;
        }
        Ok(moved_columns(self.config, rows))
    }

    /// By how much a leg gets longer, or a table axis moves, per joint unit.
    pub fn gains(&self) -> Vec<f64> {
        let legs = self.config.geometry.legs().iter().zip(&self.legs).enumerate();
        let of_leg = legs.map(|(i, (leg, segment))| {
            drive_rate(leg, segment).map_or(1.0, |rate| rate.dot(&self.direction(i)).abs())
        });
        let table = self.config.machine.layout().table().len();
        of_leg.chain(std::iter::repeat_n(1.0, table)).collect()
    }
}

/// The rows with zeros for coordinates that no joint moves.
pub fn moved_columns(config: &MachineConfig, mut rows: Rows) -> Rows {
    for letter in Letter::ALL.into_iter().filter(|l| config.machine.layout().is_held(*l)) {
        rows.column_mut(letter.index()).fill(0.0);
    }
    rows
}

/// Coordinates that a joint moves.
pub fn moved(config: &MachineConfig) -> Vec<Letter> {
    let layout = config.machine.layout();
    Letter::ALL.into_iter().filter(|letter| !layout.is_held(*letter)).collect()
}

/// Singular values of the rows over `moved` coordinates, largest first.
pub fn singular_values(rows: &Rows, moved: usize) -> Vec<f64> {
    let mut values: Vec<f64> = rows.singular_values().iter().copied().collect();
    values.sort_by(|a, b| b.total_cmp(a));
    values.truncate(moved);
    values
}

/// The pseudo-inverse of rows that hold `moved` coordinates; `None` at a singular pose.
pub fn inverse(rows: &Rows, moved: usize) -> Option<SMatrix<f64, 6, MAX_JOINTS>> {
    let values = singular_values(rows, moved);
    let (most, least) = (*values.first()?, *values.last()?);
    if !(least > RANK_TOLERANCE * most) {
        return None;
    }
    rows.pseudo_inverse(least / 2.0).ok()
}

/// Angular velocity in base per rate of A, B, C: columns of R = Rz(C) Ry(B) Rx(A).
pub fn rate_map(pose: &Pose) -> Matrix3<f64> {
    let ((sb, cb), (sc, cc)) = (pose.angles.y.sin_cos(), pose.angles.z.sin_cos());
    Matrix3::new(cc * cb, -sc, 0.0, sc * cb, cc, 0.0, -sb, 0.0, 1.0)
}
