// SPDX-License-Identifier: GPL-2.0-or-later
//! Inverse Jacobians: joint rates per twist, and per pose coordinate.

use crate::fault::{Cause, Fault};
use crate::machine::Machine;
use crate::pose::Pose;
use nalgebra::{SMatrix, Vector3};

/// cos B below which the pose coordinates A and C are not independent.
const MIN_COS_B: f64 = 1e-6;

impl<const N: usize> Machine<N> {
    /// Inverse Jacobian: joint rates per unit twist, N × 6.
    ///
    /// Row i is `[nᵢᵀ (ρᵢ × nᵢ)ᵀ]` for a strut, plus the exact gradient of the nut
    /// correction, so that q̇ = J (v; ω), linear part first. Frames: v and ω in base
    /// axes; reference point = control point (tool tip), ρᵢ = R (o + bᵢ).
    /// Units: columns 0–2 joint units per machine unit, 3–5 joint units per radian.
    ///
    /// # Errors
    /// As [`Machine::inverse`].
    /// Source: paper 004 and LinuxCNC's genhexkins for the rows without the nut term.
    pub fn inverse_jacobian(
        &self,
        pose: &Pose,
        tool: &Vector3<f64>,
    ) -> Result<SMatrix<f64, N, 6>, Fault> {
        pose.check()?;
        let r = pose.rotation();
        let centre = self.centre(&pose.position, &r, tool);
        let placed = self.placed(&self.base, &centre, &r)?;
        let n = placed.directions();
        let twist = self.twist(&n, &r)?;
        let rows = self.rows(&placed, &n, twist.as_ref());
        // A twist about the control point moves the centroid by v + ω × lever.
        let lever = r * (tool + self.centroid);
        let mut jacobian = SMatrix::zeros();
        for i in 0..N {
            let rate = self.legs[i].rate(&n.get(i));
            let force = Vector3::new(rows[0][i], rows[1][i], rows[2][i]);
            let moment = Vector3::new(rows[3][i], rows[4][i], rows[5][i]) + lever.cross(&force);
            for axis in 0..3 {
                jacobian[(i, axis)] = force[axis] * rate;
                jacobian[(i, axis + 3)] = moment[axis] * rate;
            }
        }
        Ok(jacobian)
    }

    /// Inverse Jacobian in pose coordinates: ∂q / ∂(x, y, z, a, b, c), N × 6.
    ///
    /// Units: joint units per machine unit and per **degree**.
    ///
    /// # Errors
    /// As [`Machine::inverse`]; [`Cause::TiltNearRightAngle`] where cos B < 1e-6.
    pub fn pose_jacobian(
        &self,
        pose: &Pose,
        tool: &Vector3<f64>,
    ) -> Result<SMatrix<f64, N, 6>, Fault> {
        let of_twist = self.inverse_jacobian(pose, tool)?;
        let trig = pose.trigonometry();
        if !(trig.cb.abs() >= MIN_COS_B) {
            return Err(Fault::with_value(Cause::TiltNearRightAngle, trig.cb));
        }
        let per_degree = trig.rate_map() * (core::f64::consts::PI / 180.0);
        let mut jacobian = of_twist;
        for i in 0..N {
            for angle in 0..3 {
                jacobian[(i, angle + 3)] = of_twist[(i, 3)] * per_degree[(0, angle)]
                    + of_twist[(i, 4)] * per_degree[(1, angle)]
                    + of_twist[(i, 5)] * per_degree[(2, angle)];
            }
        }
        Ok(jacobian)
    }
}

impl Machine<6> {
    /// Sign of det J (1, −1, or 0 where it is singular): tells apart ways of assembling
    /// the machine, but not all of them. Information, not a guard.
    ///
    /// # Errors
    /// As [`Machine::inverse`].
    pub fn assembly(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<i32, Fault> {
        let jacobian = self.inverse_jacobian(pose, tool)?;
        let mut a: [[f64; 6]; 6] =
            core::array::from_fn(|i| core::array::from_fn(|j| jacobian[(i, j)]));
        let mut sign = 1;
        for k in 0..6 {
            // Row by row exchange instead of a pivot search: no index depends on data.
            for i in k + 1..6 {
                if a[i][k].abs() > a[k][k].abs() {
                    a.swap(i, k);
                    sign = -sign;
                }
            }
            if a[k][k] == 0.0 {
                return Ok(0);
            }
            if a[k][k] < 0.0 {
                sign = -sign;
            }
            for i in k + 1..6 {
                let factor = a[i][k] / a[k][k];
                for j in k..6 {
                    a[i][j] -= factor * a[k][j];
                }
            }
        }
        Ok(sign)
    }
}
