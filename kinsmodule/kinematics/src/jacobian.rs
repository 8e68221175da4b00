// SPDX-License-Identifier: GPL-2.0-or-later
//! Inverse Jacobians: joint rates per twist, and per pose coordinate.

use crate::fault::{Cause, Fault};
use crate::inverse::{Posed, Stand};
use crate::lanes::Lanes3;
use crate::layout::{MAX_JOINTS, MAX_LEGS};
use crate::machine::{Chart, Jacobian, Mechanism, Moving};
use crate::pose::{Pose, Trigonometry};
use nalgebra::Vector3;

/// cos B below which the pose coordinates A and C are not independent.
const MIN_COS_B: f64 = 1e-6;

/// Rates of one joint.
struct Rates {
    /// Per velocity of the reference point.
    force: Vector3<f64>,
    /// Per angular velocity, about the reference point.
    moment: Vector3<f64>,
}

impl<const N: usize> Mechanism<N> {
    pub fn inverse_jacobian(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Jacobian, Fault> {
        Ok(self.twist_rows(pose, tool)?.0)
    }

    /// Rows per unit twist about the control point, and the pose's sines and cosines.
    fn twist_rows(
        &self,
        pose: &Pose,
        tool: &Vector3<f64>,
    ) -> Result<(Jacobian, Trigonometry), Fault> {
        let posed = self.posed(pose, tool)?;
        let joints = self.joints_of(&posed)?;
        let legs = self.leg_rates(&posed, &joints, &self.moved_anchors(&joints)?)?;
        // A twist about the control point moves the reference point by v + ω × lever.
        let lever = posed.stand.place.rotation * (tool + self.reference);
        let mut jacobian = Jacobian::zeros();
        let mut set = |joint: usize, Rates { force, moment }: &Rates| {
            let moment = moment + lever.cross(force);
            for (axis, value) in force.iter().chain(moment.iter()).enumerate() {
                if let Some(place) = jacobian.get_mut((joint, axis)) {
                    *place = *value;
                }
            }
        };
        for (i, leg) in legs.iter().enumerate().take(self.count()) {
            set(i, &Rates { force: self.of_legs(leg.force), moment: leg.moment });
        }
        for (i, letter) in self.layout.table().as_slice().iter().enumerate() {
            let mut force = Vector3::zeros();
            force[letter.index().min(2)] = 1.0;
            set(self.count() + i, &Rates { force, moment: Vector3::zeros() });
        }
        Ok((jacobian, posed.trig))
    }

    /// Rates of the legs' joints, at their values and with their base anchors there.
    fn leg_rates(
        &self,
        posed: &Posed<N>,
        joints: &[f64; N],
        anchors: &Lanes3<N>,
    ) -> Result<[Rates; N], Fault> {
        let placed = self.placed(anchors, &posed.stand.place);
        let n = placed.directions();
        let twist = self.twist(&n, &posed.stand.place.rotation)?;
        let rows = self.rows(&placed, twist.as_ref());
        let mut rates = [0.0; N];
        for (i, rate) in rates.iter_mut().enumerate() {
            *rate = 1.0 / self.legs[i].gain(joints[i] + self.offset[i], &n.get(i));
            // So far away that a joint value swallows its leg.
            if !rate.is_finite() {
                return Err(Fault::of_leg(Cause::DeadPoint, i, 0.0));
            }
        }
        Ok(core::array::from_fn(|i| {
            let rate = rates[i];
            let force = Vector3::new(rows[0][i], rows[1][i], rows[2][i]);
            let moment = Vector3::new(rows[3][i], rows[4][i], rows[5][i]);
            Rates { force: force * rate, moment: moment * rate }
        }))
    }

    pub fn pose_jacobian(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Jacobian, Fault> {
        let (of_twist, trig) = self.twist_rows(pose, tool)?;
        // Where A or C is held there is nothing to tell apart.
        if self.chart == Chart::Group && !(trig.cb.abs() >= MIN_COS_B) {
            return Err(Fault::with_value(Cause::TiltNearRightAngle, trig.cb));
        }
        let per_degree = trig.rate_map() * (core::f64::consts::PI / 180.0);
        let mut jacobian = of_twist;
        let angular = of_twist.fixed_columns::<3>(3) * per_degree;
        jacobian.fixed_columns_mut::<3>(3).copy_from(&angular);
        Ok(jacobian)
    }

    /// Joints, their rates and the legs, while the pose changes at `rate` (degrees).
    pub fn moving(
        &self,
        pose: &Pose,
        tool: &Vector3<f64>,
        rate: &[f64; 6],
    ) -> Result<Moving, Fault> {
        let posed = self.posed(pose, tool)?;
        let joints = self.joints_of(&posed)?;
        let anchors = self.moved_anchors(&joints)?;
        let legs = self.leg_rates(&posed, &joints, &anchors)?;
        let Posed { trig, stand: Stand { place, point }, .. } = &posed;
        let [vx, vy, vz, a, b, c] = *rate;
        let omega = trig.rate_map() * (Vector3::new(a, b, c) * (core::f64::consts::PI / 180.0));
        let lever = place.rotation * (tool + self.reference);
        let speed = Vector3::new(vx, vy, vz) + omega.cross(&lever);
        let mut rates = [0.0; MAX_JOINTS];
        let of_legs = self.of_legs(speed);
        for (rate, leg) in rates.iter_mut().zip(&legs).take(self.count()) {
            *rate = leg.force.dot(&of_legs) + leg.moment.dot(&omega);
        }
        let table = rates.iter_mut().skip(self.count()).zip(self.layout.table().as_slice());
        for (rate, letter) in table {
            *rate = speed[letter.index().min(2)];
        }
        let segments = self.segments_of(&posed, &anchors);
        Ok(Moving { joints: self.all_joints(&joints, point)?, rates, segments })
    }

    pub fn assembly(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<i32, Fault> {
        if self.layout.is_redundant() {
            return Ok(0);
        }
        let posed = self.posed(pose, tool)?;
        let joints = self.joints_of(&posed)?;
        let legs = self.leg_rates(&posed, &joints, &self.moved_anchors(&joints)?)?;
        let force = Lanes3::from_fn(|i| legs[i].force);
        let moment = Lanes3::from_fn(|i| legs[i].moment);
        let mut columns = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
        self.to_chart(&mut columns, &posed.stand.place);
        let mut square = [[0.0; MAX_LEGS]; MAX_LEGS];
        let active = columns.iter().zip(self.active).filter(|(_, active)| *active);
        for (row, (column, _)) in square.iter_mut().zip(active) {
            for (to, value) in row.iter_mut().zip(column) {
                *to = *value;
            }
        }
        Ok(sign_of_determinant(square, self.count().min(MAX_LEGS)))
    }
}

/// Sign of the determinant of the first `m` rows and columns.
pub(crate) fn sign_of_determinant(mut a: [[f64; MAX_LEGS]; MAX_LEGS], m: usize) -> i32 {
    let m = m.min(MAX_LEGS);
    let mut sign = 1;
    for k in 0..m {
        // Row by row exchange instead of a pivot search: no index depends on data.
        for i in k + 1..m {
            if a[i][k].abs() > a[k][k].abs() {
                a.swap(i, k);
                sign = -sign;
            }
        }
        if a[k][k] == 0.0 {
            return 0;
        }
        if a[k][k] < 0.0 {
            sign = -sign;
        }
        for i in k + 1..m {
            let factor = a[i][k] / a[k][k];
            for j in k..m {
                a[i][j] -= factor * a[k][j];
            }
        }
    }
    sign
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sign<const M: usize>(rows: [[f64; M]; M]) -> i32 {
        // What lies beyond the first rows and columns must not count.
        let mut a = [[7.0; MAX_LEGS]; MAX_LEGS];
        for (to, row) in a.iter_mut().zip(rows) {
            to[..M].copy_from_slice(&row);
        }
        sign_of_determinant(a, M)
    }

    #[test]
    fn the_sign_of_a_determinant_is_that_of_permutation_diagonal_and_elimination() {
        assert_eq!(sign([[2.0, 0.0, 0.0], [0.0, -3.0, 0.0], [0.0, 0.0, -5.0]]), 1);
        assert_eq!(sign([[2.0, 0.0, 0.0], [0.0, -3.0, 0.0], [0.0, 0.0, 5.0]]), -1);
        // An even and an odd permutation.
        assert_eq!(sign([[0.0, 2.0, 0.0], [0.0, 0.0, 3.0], [5.0, 0.0, 0.0]]), 1);
        assert_eq!(sign([[0.0, 2.0, 0.0], [3.0, 0.0, 0.0], [0.0, 0.0, 5.0]]), -1);
        // 2·1 − 1·1, 2·1 − 3·1 and 1·2 − 2·1.
        assert_eq!(sign([[2.0, 1.0], [1.0, 1.0]]), 1);
        assert_eq!(sign([[2.0, 3.0], [1.0, 1.0]]), -1);
        assert_eq!(sign([[1.0, 2.0], [1.0, 2.0]]), 0);
        assert_eq!(sign([[0.0; 3]; 3]), 0);
        // Thrice the first row and one: a determinant of 2·(5·7 − 4·8), and of −2·(…).
        assert_eq!(sign([[2.0, 4.0, 6.0], [6.0, 17.0, 22.0], [2.0, 12.0, 13.0]]), 1);
        assert_eq!(sign([[2.0, 4.0, 6.0], [2.0, 12.0, 13.0], [6.0, 17.0, 22.0]]), -1);
    }
}
