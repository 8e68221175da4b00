// SPDX-License-Identifier: GPL-2.0-or-later
//! Inverse Jacobians: joint rates per twist, and per pose coordinate.

use crate::fault::{Cause, Fault};
use crate::lanes::Lanes3;
use crate::layout::{MAX_JOINTS, MAX_LEGS};
use crate::legs_at::{Gradient, LegsAt};
use crate::mechanism::{Chart, Mechanism};
use crate::trig::RADIANS;
use nalgebra::{SMatrix, Vector3};

/// Rows of joints by columns of a twist or pose; rows beyond the last joint are 0.
pub type Jacobian = SMatrix<f64, MAX_JOINTS, 6>;

/// cos B below which the pose coordinates A and C are not independent.
const MIN_COS_B: f64 = 1e-6;

impl<const N: usize> LegsAt<'_, N> {
    /// Computes the rows per unit twist about the control point.
    pub fn inverse_jacobian(&self) -> Result<Jacobian, Fault> {
        let (machine, legs) = (self.machine, self.gradients()?);
        // A twist about the control point moves the reference point by v + ω × lever.
        let lever = self.lever();
        let mut jacobian = Jacobian::zeros();
        let mut set = |joint: usize, Gradient { force, moment }: &Gradient| {
            let moment = moment + lever.cross(force);
            for (axis, value) in force.iter().chain(moment.iter()).enumerate() {
                if let Some(place) = jacobian.get_mut((joint, axis)) {
                    *place = *value;
                }
            }
        };
        for (i, leg) in legs.iter().enumerate().take(machine.count()) {
            set(i, &Gradient { force: machine.of_legs(leg.force), moment: leg.moment });
        }
        for (i, letter) in machine.layout.table().as_slice().iter().enumerate() {
            let mut force = Vector3::zeros();
            force[letter.index().min(2)] = if machine.couplings().is_some() { -1.0 } else { 1.0 };
            set(machine.count() + i, &Gradient { force, moment: Vector3::zeros() });
        }
        Ok(jacobian)
    }

    pub fn pose_jacobian(&self) -> Result<Jacobian, Fault> {
        if self.machine.couplings().is_some() {
            return self.commanded_jacobian();
        }
        let mut jacobian = self.inverse_jacobian()?;
        // If A or C is held, the coordinates remain independent.
        if self.machine.chart == Chart::Group && !(self.trig.cb.abs() >= MIN_COS_B) {
            return Err(Fault::with_value(Cause::TiltNearRightAngle, self.trig.cb));
        }
        let per_degree = self.trig.rate_map() * RADIANS;
        let angular = jacobian.fixed_columns::<3>(3) * per_degree;
        jacobian.fixed_columns_mut::<3>(3).copy_from(&angular);
        Ok(jacobian)
    }

    /// Computes the rates of the joints per commanded coordinate, which the dependent ones follow.
    fn commanded_jacobian(&self) -> Result<Jacobian, Fault> {
        let mut jacobian = Jacobian::zeros();
        for k in 0..6 {
            let mut unit = [0.0; 6];
            unit[k] = 1.0;
            let rates = self.rates(&unit)?;
            for (joint, rate) in rates.iter().enumerate() {
                if let Some(place) = jacobian.get_mut((joint, k)) {
                    *place = *rate;
                }
            }
        }
        Ok(jacobian)
    }

    pub fn assembly(&self) -> Result<i32, Fault> {
        let (machine, legs) = (self.machine, self.gradients()?);
        if machine.layout.is_redundant() {
            return Ok(0);
        }
        let force = Lanes3::from_fn(|i| legs[i].force);
        let moment = Lanes3::from_fn(|i| legs[i].moment);
        let mut columns = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
        if let Some(couplings) = machine.couplings() {
            couplings.write_rows(&self.placement.place, &mut columns);
        }
        machine.to_chart(&mut columns, &self.placement.place);
        Ok(machine.sign_of(&columns))
    }
}

impl<const N: usize> Mechanism<N> {
    /// Computes the sign of the determinant of the active columns.
    pub fn sign_of(&self, columns: &[[f64; N]; 6]) -> i32 {
        let mut square = [[0.0; MAX_LEGS]; MAX_LEGS];
        let active = columns.iter().zip(self.active).filter(|(_, active)| *active);
        for (row, (column, _)) in square.iter_mut().zip(active) {
            for (to, value) in row.iter_mut().zip(column) {
                *to = *value;
            }
        }
        sign_of_determinant(square, self.equations().min(MAX_LEGS))
    }
}

/// Computes the sign of the determinant of the first `m` rows and columns.
fn sign_of_determinant(mut a: [[f64; MAX_LEGS]; MAX_LEGS], m: usize) -> i32 {
    let m = m.min(MAX_LEGS);
    let mut sign = 1;
    for k in 0..m {
        // Exchanges rows one by one instead of searching for a pivot: no index depends on data.
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
        // Entries beyond the first rows and columns must have no effect.
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
        // Three times the first row plus one: a determinant of 2·(5·7 − 4·8), and of −2·(…).
        assert_eq!(sign([[2.0, 4.0, 6.0], [6.0, 17.0, 22.0], [2.0, 12.0, 13.0]]), 1);
        assert_eq!(sign([[2.0, 4.0, 6.0], [2.0, 12.0, 13.0], [6.0, 17.0, 22.0]]), -1);
    }
}
