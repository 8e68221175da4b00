// SPDX-License-Identifier: GPL-2.0-or-later
//! How large the second derivatives of the legs' lengths are at a place, as Newton's step sees them.
//!
//! In the chart of translations and rotation vectors leg i, of direction n, length l and arm b, β = b/r with
//! the radius r, has the Hessian
//!
//! ```text
//! H = Aᵀ(1 − n nᵀ)A/l + S/r,   A = (1, −[β]×),   S = (n βᵀ + β nᵀ)/2 − (n·β) 1
//! ```
//!
//! (S/r in the block of the turns), and the Frobenius norm of M D²f is √Σ (MᵀM)ᵢⱼ ⟨Hᵢ, Hⱼ⟩. Of two legs only scalar
//! products are left: with κ = 1 + βᵢ·βⱼ, p = nᵢ·βⱼ, q = βᵢ·nⱼ, a = n·β of a leg and ν = nᵢ·nⱼ
//!
//! ```text
//! ⟨Hᵢ, Hⱼ⟩ = (κ² + 2κ(aᵢp + aⱼq − βᵢ·βⱼ) + |βᵢ|²|βⱼ|² − |βᵢ|²p² − |βⱼ|²q² + (κν − pq)²)/(lᵢlⱼ)
//!          + (ν(p|βᵢ|² − aᵢ βᵢ·βⱼ) − aⱼ|βᵢ|² − pq aᵢ)/(r lᵢ)   and the same the other way round
//!          + ((ν βᵢ·βⱼ + pq)/2 + aᵢaⱼ)/r²
//! ```

use super::residual::Measured;
use crate::lanes::{both, dot, scaled, swapped};
use crate::mechanism::Mechanism;
use crate::pseudo_inverse::PseudoInverse;
use libm::sqrt;
use wide::f64x2;

/// Two legs beside each other.
struct Two {
    n: [f64x2; 3],
    beta: [f64x2; 3],
    /// n · β and |β|².
    a: f64x2,
    square: f64x2,
    /// 1/l.
    curved: f64x2,
    /// Their columns of M.
    column: [f64x2; 6],
}

impl<const N: usize> Mechanism<N> {
    /// Whether the formulas hold: all of X Y Z A B C are active, and no platform anchor slides.
    #[inline(always)]
    pub(super) fn has_hessian(&self) -> bool {
        self.active == [true; 6] && !self.slides
    }

    /// Frobenius norm of M D²f at a place that is measured and factored, M the inverse there: no |M D²f(x, y)| is
    /// larger for x and y of length 1. Rounding may take 1e-7 of the bound leg by leg from it, which the margin between 0.4
    /// and 1/2 covers. The nut's correction is no part of it.
    #[inline(never)]
    pub(super) fn hessian_norm(&self, at: &Measured<N>, inverse: &PseudoInverse<N>) -> f64 {
        let per_radius = both(self.per_radius);
        let mut sum = f64x2::ZERO;
        for i in (0..N).step_by(2) {
            let one = Two::of(at, inverse, per_radius, i);
            sum += one.products(&one, per_radius) + one.products(&one.swapped(), per_radius);
            for j in (0..N).step_by(2) {
                // Each combination of pairs once.
                if j <= i {
                    continue;
                }
                let other = Two::of(at, inverse, per_radius, j);
                let products =
                    one.products(&other, per_radius) + one.products(&other.swapped(), per_radius);
                sum += products + products;
            }
        }
        let square = sum.reduce_add();
        // Rounding may leave less than nothing; a NaN stays one, and proves nothing.
        sqrt(if square < 0.0 { 0.0 } else { square })
    }
}

impl Two {
    /// Legs i and i + 1.
    #[inline(always)]
    fn of<const N: usize>(
        at: &Measured<N>,
        inverse: &PseudoInverse<N>,
        per_radius: f64x2,
        i: usize,
    ) -> Self {
        // A bound that the compiler knows.
        let i = i.min(N - 2);
        let curved = at.placed.curved(i);
        let n = scaled(&at.placed.span.pair(i), curved);
        let beta = scaled(&at.placed.arms.pair(i), per_radius);
        let (a, square) = (dot(&n, &beta), dot(&beta, &beta));
        Self { n, beta, a, square, curved, column: inverse.columns(i) }
    }

    #[inline(always)]
    fn swapped(&self) -> Self {
        Self {
            n: self.n.map(swapped),
            beta: self.beta.map(swapped),
            a: swapped(self.a),
            square: swapped(self.square),
            curved: swapped(self.curved),
            column: self.column.map(swapped),
        }
    }

    /// (MᵀM)ᵢⱼ ⟨Hᵢ, Hⱼ⟩ of legs that are beside each other.
    #[inline(always)]
    fn products(&self, other: &Self, per_radius: f64x2) -> f64x2 {
        let (nu, across) = (dot(&self.n, &other.n), dot(&self.beta, &other.beta));
        let (p, q) = (dot(&self.n, &other.beta), dot(&self.beta, &other.n));
        let (kappa, pq) = (both(1.0) + across, p * q);
        let rest = kappa * nu - pq;
        let sides = self.a * p + other.a * q - across;
        let bent = kappa * (kappa + sides + sides) + rest * rest + self.square * other.square
            - self.square * p * p
            - other.square * q * q;
        let mixed = nu * (p * self.square - self.a * across) - other.a * self.square - pq * self.a;
        let other_mixed =
            nu * (q * other.square - other.a * across) - self.a * other.square - pq * other.a;
        let turned = (nu * across + pq) * both(0.5) + self.a * other.a;
        let hessians = bent * self.curved * other.curved
            + per_radius * (mixed * self.curved + other_mixed * other.curved + turned * per_radius);
        let columns = self.column.iter().zip(other.column).map(|(x, y)| *x * y);
        hessians * columns.fold(f64x2::ZERO, |sum, product| sum + product)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::certificate::tests::{at, lengths, machine};
    use crate::forward::residual::Stance;
    use crate::lanes::inner;
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    #[test]
    fn the_norm_is_that_of_the_second_derivatives_of_the_lengths() {
        // Second differences: rounding of 2e-13 over the square of the step, beside 1e-3.
        const STEP: f64 = 0.5;
        let mut rng = Pcg64::seed_from_u64(47);
        let (mut checked, mut unknown, mut worst) = (0, 0, 0.0_f64);
        let mut times = std::vec![];
        for _ in 0..400 {
            let Some((machine, place)) = machine(&mut rng, b"XYZABC", false) else { continue };
            let Ok(joints) = machine.joints_at(&place) else { continue };
            let Ok(target) = machine.target(&joints) else { continue };
            let mut about = Stance::new(place);
            if machine.settle(&target, &mut about).is_err() {
                continue;
            }
            if !machine.has_hessian() {
                assert!(machine.slides);
                unknown += 1;
                continue;
            }
            let norm = machine.hessian_norm(&about.at, &about.inverse);
            let length = |a: usize, by: f64, b: usize, also: f64| {
                let mut x = [0.0; 6];
                x[a] += by * STEP;
                x[b] += also * STEP;
                lengths(&machine, &target.anchors, &at(&machine, &place, &x)).expect("lengths")
            };
            let mut sum = 0.0;
            for a in 0..6 {
                for b in 0..6 {
                    let corners = [(1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0)]
                        .map(|(by, also)| length(a, by, b, also));
                    let [one, other, less, also_less] = corners;
                    let second = core::array::from_fn(|i| {
                        (one[i] + other[i] - less[i] - also_less[i]) / (4.0 * STEP * STEP)
                    });
                    let x = about.inverse.solve(&second);
                    sum += inner(&x, &x);
                }
            }
            // What fourth derivatives leave of second differences: the square of the step over the radius, some 1e-5.
            let off = (sqrt(sum) / norm - 1.0).abs();
            assert!(off < 1e-4, "{off:e}: {} {norm}", sqrt(sum));
            worst = worst.max(off);
            let of_legs = machine.lipschitz_of_legs(&about.at, &about.inverse, 0.0, None);
            times.push(of_legs / norm);
            checked += 1;
        }
        times.sort_by(f64::total_cmp);
        let middle = times[times.len() / 2];
        std::println!("{checked} machines, {unknown} with rings, off by {worst:.0e}");
        std::println!(
            "leg by leg {:.1} to {:.1} times, {middle:.1} in the middle",
            times[0],
            times[times.len() - 1]
        );
        // A norm that is no sharper would be sound and useless; nor is it ever less sharp.
        assert!(times[0] >= 1.0 && middle > 3.0, "{times:?}");
        assert!(checked > 50 && unknown > 50, "{checked} {unknown}");
    }
}
