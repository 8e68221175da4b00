// SPDX-License-Identifier: GPL-2.0-or-later
//! Contradicting joints on machines with more legs than coordinates: the error, and the joint at fault.

use super::residual::{Measured, newton_step, norm};
use super::solver::Solver;
use crate::fault::{Cause, Fault, MachinePart};
use crate::lanes::largest;
use crate::mechanism::Mechanism;
use crate::placed::Place;
use crate::pseudo_inverse::PseudoInverse;
use crate::target::Target;

/// Default residual limit as a share of the platform radius: a following error of
/// 1 mm of one carriage leaves 0.25 mm on the four rods of paper 000's machine, and a
/// platform of 120 mm then allows 0.6 mm.
const RESIDUAL_SHARE: f64 = 5e-3;

/// A leg stands out if without it the other legs fit the seed better by this factor than without any
/// other leg: a joint that drifts slowly reaches the limit with the others equally far off.
const STANDS_OUT: f64 = 2.0;

impl<const N: usize> Mechanism<N> {
    pub(super) fn residual_limit(&self, solver: &Solver) -> f64 {
        match solver.residual_limit {
            0.0 => RESIDUAL_SHARE * self.radius,
            given => given,
        }
    }

    /// Returns the largest joint error that explains the residuals: of a strut's length, of a
    /// carriage's position, of an arm's end along its circle.
    pub(super) fn off(&self, target: &Target<N>, at: &Measured<N>) -> f64 {
        if !self.moving {
            return largest(&at.residual);
        }
        let mut off = at.residual;
        for (i, value) in off.iter_mut().enumerate() {
            let margin = self.margin(&at.placed, i, target.joints[i] + self.offset[i]);
            *value /= margin.unwrap_or(1.0);
        }
        largest(&off)
    }

    /// Creates the refusal of joints that contradict each other by `residual`, naming the joint at fault.
    pub(super) fn inconsistent(&self, target: &Target<N>, start: &Place, residual: f64) -> Fault {
        let part = self.contradicting(target, start).map(MachinePart::Joint);
        Fault { cause: Cause::JointsInconsistent, part, value: residual }
    }

    /// Returns the leg without which the others fit the seed best, for contradicting joints;
    /// `None` if no leg stands out. Residuals alone cannot identify it: with one leg more than
    /// coordinates they have the same shape whichever joint is wrong. A joint that drifts slowly
    /// moves the seed with it, until it no longer differs from the others.
    fn contradicting(&self, target: &Target<N>, start: &Place) -> Option<u8> {
        let mut best = (f64::INFINITY, None);
        let mut second = f64::INFINITY;
        for leg in 0..self.count() {
            let Ok(apart) = self.disagreement_without(leg, target, start) else { continue };
            if apart < best.0 {
                second = best.0;
                best = (apart, u8::try_from(leg).ok());
            } else if apart < second {
                second = apart;
            }
        }
        best.1.filter(|_| best.0 * STANDS_OUT <= second)
    }

    /// Returns how far all legs but one are from fitting the seed: the step there, and the residual after it.
    fn disagreement_without(
        &self,
        leg: usize,
        target: &Target<N>,
        start: &Place,
    ) -> Result<f64, Fault> {
        let mut at = self.measured(target, start)?;
        let mut columns = self.columns(&at, start);
        let without = |values: &mut [f64; N]| {
            for (i, value) in values.iter_mut().enumerate() {
                if i == leg {
                    *value = 0.0;
                }
            }
        };
        without(&mut at.residual);
        columns.iter_mut().for_each(without);
        let inverse = PseudoInverse::new(&columns, &self.active).ok_or(Cause::Singular)?;
        let step = newton_step(&inverse, &at.residual);
        let mut left = at.residual;
        for (column, x) in columns.iter().zip(step) {
            for (value, row) in left.iter_mut().zip(column) {
                *value += row * x;
            }
        }
        Ok(norm(&step) + norm(&left))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::certificate::tests::machine;
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    #[test]
    fn errors_of_legs_are_reported_as_joint_errors_for_any_joint_zero() {
        let mut rng = Pcg64::seed_from_u64(23);
        let mut checked = 0;
        for _ in 0..40 {
            let Some((machine, place)) = machine(&mut rng, b"XYZABC", false) else { continue };
            let Ok(joints) = machine.joints_at(&place) else { continue };
            let target = machine.target(&joints).expect("a target");
            let mut at = machine.measured(&target, &place).expect("measured");
            for leg in 0..6 {
                at.residual = [0.0; 6];
                at.residual[leg] = -0.5;
                // A rod's end moves by more than the length error, a strut's by the same amount.
                let margin = machine.margin(&at.placed, leg, joints[leg]).unwrap_or(1.0);
                assert_eq!(machine.off(&target, &at), 0.5 / margin.abs());
                let mut elsewhere = machine.clone();
                elsewhere.offset[leg] = 40.0;
                let mut joints = joints;
                joints[leg] -= 40.0;
                let target = elsewhere.target(&joints).expect("a target");
                let off = elsewhere.off(&target, &at);
                // An angle that is reported 40 degrees off, divided by a margin of 0.05 or more.
                assert!((off * margin.abs() - 0.5).abs() < 1e-12, "{off} {margin}");
                checked += 1;
            }
            let still = Mechanism { moving: false, ..machine };
            at.residual = [0.25, -0.75, 0.5, 0.0, 0.0, 0.0];
            assert_eq!(still.off(&target, &at), 0.75);
        }
        assert!(checked > 100, "{checked}");
    }
}
