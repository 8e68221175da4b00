// SPDX-License-Identifier: GPL-2.0-or-later
//! Joints that contradict each other, where legs exceed coordinates: how far off, and which one.

use super::residual::{Measured, newton_step, norm};
use super::solver::Solver;
use crate::fault::{Cause, Fault, MachinePart};
use crate::lanes::largest;
use crate::mechanism::Mechanism;
use crate::placed::Place;
use crate::pseudo_inverse::PseudoInverse;
use crate::target::Target;

/// Default of the residual limit as a share of the platform radius: a following error of
/// 1 mm of one carriage leaves 0.25 mm on the four rods of paper 000's machine, and a
/// platform of 120 mm then allows 0.6 mm.
const RESIDUAL_SHARE: f64 = 5e-3;

/// How many times less than all others the legs without a contradicting one have to be off
/// the seed: creeping away, a joint reaches the limit with others as far off as its own.
const STANDS_OUT: f64 = 2.0;

impl<const N: usize> Mechanism<N> {
    pub(super) fn residual_limit(&self, solver: &Solver) -> f64 {
        match solver.residual_limit {
            0.0 => RESIDUAL_SHARE * self.radius,
            given => given,
        }
    }

    /// Largest error of a joint that the residuals amount to: of a strut's length, of the
    /// place of a carriage, of the end of an arm along its circle.
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

    /// The refusal of joints that contradict each other by `residual`, with the one that does.
    pub(super) fn inconsistent(&self, target: &Target<N>, start: &Place, residual: f64) -> Fault {
        let part = self.contradicting(target, start).map(MachinePart::Joint);
        Fault { cause: Cause::JointsInconsistent, part, value: residual }
    }

    /// The leg without which the others agree best with the seed, for joints that
    /// contradict each other; `None` where no leg stands out. (Residuals alone cannot tell:
    /// with one leg more than coordinates they have the same shape whichever joint is off.
    /// A joint that creeps away takes the seed along, until nothing tells it from the others.)
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

    /// How far the legs but one are from fitting the seed: the step there, and what it leaves.
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
    fn what_legs_are_off_is_told_as_errors_of_their_joints_wherever_these_have_their_zero() {
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
                // A rod's end moves by more than its length is off, a strut's by as much.
                let margin = machine.margin(&at.placed, leg, joints[leg]).unwrap_or(1.0);
                assert_eq!(machine.off(&target, &at), 0.5 / margin.abs());
                let mut elsewhere = machine.clone();
                elsewhere.offset[leg] = 40.0;
                let mut joints = joints;
                joints[leg] -= 40.0;
                let target = elsewhere.target(&joints).expect("a target");
                let off = elsewhere.off(&target, &at);
                // An angle that is told 40 degrees elsewhere, over a margin of 0.05 or more.
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
