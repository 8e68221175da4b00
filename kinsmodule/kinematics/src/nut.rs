// SPDX-License-Identifier: GPL-2.0-or-later
//! Nut rotation: in a strut whose screw and nut are supported only by cardan joints,
//! a change of pose rotates the nut about the strut's axis, and the thread converts this torsion
//! to length that the motor did not command.
//!
//! Source: paper 004 (Novikov, Strutynsky, Kyrychenko 2011), equation 1, in its
//! closed and continuous form. With the unit vectors n (strut, base to platform),
//! A (axis of the base joint fixed in base), B (axis of the platform joint, R times
//! its direction in the platform), α = A·n, β = B·n:
//!
//! ```text
//! S = n·(A×B),  C = A·B − αβ,  torsion φ = atan2(S, C)
//! correction = h (lead/2π) atan2(h S, h C),   h = cos φ₀ = ±1
//! ```
//!
//! φ₀ is 0 or π, whichever is nearer to φ at the reference pose. Within ±90° of φ₀
//! this equals the published arcsin (genhexkins); beyond, it stays continuous. Until
//! a pose has fixed φ₀, h follows the sign of C at every pose, which is the arcsin itself.
//! Half a turn from φ₀ it would jump by a lead: torsions near that are refused.
//! lead > 0 is a right-hand screw if A and B were entered in opposite directions.

use crate::fault::{Cause, Fault};
use crate::lanes::{Lanes3, both, cross, dot, pair, put, scaled, sum, times};
use crate::leg;
use crate::trig::{arcs, arcs_by_half, broad_arcs};
use libm::sqrt;
use nalgebra::{Matrix3, Vector3};
use wide::f64x2;

/// Smallest 1 − α² and 1 − β²: nearer to a joint axis the torsion is undefined.
pub const MIN_SIN_SQUARED: f64 = 1e-6;

/// Smallest sine of the angle between a strut and a joint axis, reduced by the possible change of pose,
/// for which the correction's derivatives are bounded: the root of [`MIN_SIN_SQUARED`].
pub const LEAST_SINE_TO_AXIS: f64 = 1e-3;

/// Largest |φ − φ₀|. At half a turn the correction jumps by a lead, which inverse cannot detect
/// because it keeps no state. It refuses from ten degrees before: to skip over these and those beyond the
/// jump, a screw would have to rotate by 20° from one call to the next, which at a lead of 10 mm and a
/// period of 1 ms is 0.56 m/s of this joint alone.
const MAX_TORSION: f64 = 170.0 / 180.0 * core::f64::consts::PI;

/// Smallest |cos(φ − φ₀)| at the reference pose: nearer to a quarter turn, rounding
/// would determine φ₀.
const MIN_FOLD_COS: f64 = 0.1;

/// Squared sine of 10°, within which a joint axis is the cause of fast torsion changes.
const NEAR_AXIS: f64 = 0.03;

/// Origin of the fold of the continuous correction.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fold {
    /// No pose: the published arcsin, h = sign C at each pose.
    Literal,
    /// h fixed at one pose for each leg.
    Fixed,
}

/// The screws of all legs; legs without lead have `travel` 0 and zero axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Nut<const N: usize> {
    /// Multiplied by h once the fold is fixed, so that S and C become h S and h C.
    base_axis: Lanes3<N>,
    platform_axis: Lanes3<N>,
    /// lead / 2π, multiplied by h once the fold is fixed: length per radian of torsion.
    travel: [f64; N],
    /// 1 for a leg without a screw, which makes its torsion 0; otherwise 0.
    idle: [f64; N],
    fold: Fold,
}

/// The torsion of every leg at one pose.
#[derive(Clone, Copy)]
pub(crate) struct Torsion<const N: usize> {
    /// Platform axes in base.
    platform_axis: Lanes3<N>,
    alpha: [f64; N],
    beta: [f64; N],
    sine: [f64; N],
    cosine: [f64; N],
    /// h of the arcsin at this pose; 1 once the fold is fixed, because then the axes include h.
    hand: [f64; N],
    /// φ − φ₀, in (−π, π].
    from_fold: [f64; N],
}

/// Components of nut corrections: factor · atan2(sine, cosine).
#[repr(align(16))]
pub(crate) struct Turns<const N: usize> {
    sine: [f64; N],
    cosine: [f64; N],
    factor: [f64; N],
}

impl<const N: usize> Turns<N> {
    pub const ZERO: Self = Self { sine: [0.0; N], cosine: [0.0; N], factor: [0.0; N] };
}

/// Gradient of the correction of two legs: force part along v, free moment along ω.
pub(crate) struct Rates {
    pub along: [f64x2; 3],
    pub moment: [f64x2; 3],
}

impl<const N: usize> Nut<N> {
    /// Creates the screws from axes (known to be finite, not yet to be non-zero) and leads.
    #[inline(always)]
    pub fn new(
        base_axis: &[[f64; 3]; N],
        platform_axis: &[[f64; 3]; N],
        lead: &[f64; N],
    ) -> Result<Self, Fault> {
        let mut nut = Self {
            base_axis: Lanes3::ZERO,
            platform_axis: Lanes3::ZERO,
            travel: lead.map(|l| l / core::f64::consts::TAU),
            idle: lead.map(|l| f64::from(u8::from(l == 0.0))),
            fold: Fold::Literal,
        };
        for i in 0..N {
            if lead[i] != 0.0 {
                nut.base_axis.set(i, direction(&base_axis[i], i)?);
                nut.platform_axis.set(i, direction(&platform_axis[i], i)?);
            }
        }
        Ok(nut)
    }

    /// Fixes φ₀ at a pose, given its strut directions and orientation. There, and up to a
    /// quarter turn from φ₀, the correction is the arcsin.
    ///
    /// Returns a leg, if any, so near to a quarter turn that rounding may have determined φ₀.
    pub fn fold_at(
        &mut self,
        n: &Lanes3<N>,
        rotation: &Matrix3<f64>,
    ) -> Result<Option<Fault>, Fault> {
        let torsion = self.torsion(n, rotation);
        self.refuse_along_axis(&torsion)?;
        let mut doubt = None;
        for i in 0..N {
            if self.travel[i] == 0.0 {
                continue;
            }
            let cos = torsion.cosine[i] / torsion.norm(i);
            if doubt.is_none() && !(cos.abs() >= MIN_FOLD_COS) {
                doubt = Some(Fault::of_leg(Cause::FoldUndefined, i, cos));
            }
            let hand = if cos < 0.0 { -1.0 } else { 1.0 };
            self.base_axis.set(i, self.base_axis.get(i) * hand);
            self.travel[i] *= hand;
        }
        self.fold = Fold::Fixed;
        Ok(doubt)
    }

    /// Returns whether no pose has fixed φ₀.
    pub fn is_literal(&self) -> bool {
        self.fold == Fold::Literal
    }

    /// Reverts the fold. The factor h in the axes does not change the arcsin.
    #[inline(always)]
    pub fn unfold(&mut self) {
        self.fold = Fold::Literal;
    }

    /// Computes the torsion of every leg; [`Self::refuse_along_axis`] checks whether it is defined.
    #[inline(always)]
    pub fn torsion(&self, n: &Lanes3<N>, rotation: &Matrix3<f64>) -> Torsion<N> {
        let mut torsion = Torsion::ZERO;
        for i in (0..N).step_by(2) {
            torsion.platform_axis.put(i, times(rotation, &self.platform_axis.pair(i)));
        }
        self.project(n, &mut torsion);
        torsion.unfold();
        torsion
    }

    /// Computes the torsion of every leg after the platform has changed its orientation R to R + `change` R,
    /// into `torsion`: arcs of small differences are cheapest.
    #[inline(always)]
    pub fn torsion_from(
        &self,
        from: &Torsion<N>,
        n: &Lanes3<N>,
        change: &Matrix3<f64>,
        torsion: &mut Torsion<N>,
    ) {
        for i in (0..N).step_by(2) {
            let was = from.platform_axis.pair(i);
            torsion.platform_axis.put(i, sum(&was, &times(change, &was)));
        }
        self.project(n, torsion);
        if self.fold == Fold::Literal {
            torsion.unfold();
            return;
        }
        for i in (0..N).step_by(2) {
            let (s, c) = (pair(&torsion.sine, i), pair(&torsion.cosine, i));
            let (s0, c0) = (pair(&from.sine, i), pair(&from.cosine, i));
            let arc = arcs(s * c0 - c * s0, c * c0 + s * s0);
            put(&mut torsion.from_fold, i, pair(&from.from_fold, i) + arc);
        }
    }

    /// Computes the components of the corrections of struts i and i + 1, and a mask of those that are defined:
    /// [`Self::torsion`] and [`Self::refuse_along_axis`] in one, for struts as vectors with
    /// their lengths. S and C are multiplied by l², which avoids a division; the mask is false if squares of the
    /// lengths overflow.
    #[inline(always)]
    pub fn turn(
        &self,
        i: usize,
        (strut, length): (&[f64x2; 3], f64x2),
        rotation: &Matrix3<f64>,
        turns: &mut Turns<N>,
    ) -> f64x2 {
        let (a, b) = (self.base_axis.pair(i), times(rotation, &self.platform_axis.pair(i)));
        let (alpha, beta) = (dot(&a, strut), dot(&b, strut));
        let square = length * length;
        let mut sine = dot(strut, &cross(&a, &b)) * length;
        let mut cosine = (dot(&a, &b) + pair(&self.idle, i)) * square - alpha * beta;
        let mut factor = pair(&self.travel, i);
        if self.fold == Fold::Literal {
            let hand = cosine.simd_lt(both(0.0)).select(both(-1.0), both(1.0));
            (sine, cosine, factor) = (hand * sine, hand * cosine, hand * factor);
        }
        put(&mut turns.sine, i, sine);
        put(&mut turns.cosine, i, cosine);
        put(&mut turns.factor, i, factor);
        let most = both(1.0 - MIN_SIN_SQUARED) * square;
        (alpha * alpha).simd_le(most) & (beta * beta).simd_le(most)
    }

    /// Computes the lengths to add to struts i and i + 1, and a mask of those that are known: torsions of more
    /// than 47° are not.
    #[inline(always)]
    pub fn correction(&self, i: usize, turns: &Turns<N>) -> (f64x2, f64x2) {
        let (arcs, known) = arcs_by_half(pair(&turns.sine, i), pair(&turns.cosine, i));
        (pair(&turns.factor, i) * arcs, known)
    }

    /// Computes all of a torsion except the platform axes, which must be set, and the arc.
    #[inline(always)]
    fn project(&self, n: &Lanes3<N>, torsion: &mut Torsion<N>) {
        for i in (0..N).step_by(2) {
            let (a, b, n) = (self.base_axis.pair(i), torsion.platform_axis.pair(i), n.pair(i));
            let (alpha, beta) = (dot(&a, &n), dot(&b, &n));
            let cosine = dot(&a, &b) - alpha * beta + pair(&self.idle, i);
            put(&mut torsion.alpha, i, alpha);
            put(&mut torsion.beta, i, beta);
            put(&mut torsion.sine, i, dot(&n, &cross(&a, &b)));
            put(&mut torsion.cosine, i, cosine);
        }
        torsion.hand = [1.0; N];
        if self.fold == Fold::Literal {
            torsion.hand = torsion.cosine.map(|c| if c < 0.0 { -1.0 } else { 1.0 });
        }
    }

    /// Refuses a strut along one of its joint axes, for which the torsion is undefined.
    #[inline(always)]
    pub fn refuse_along_axis(&self, torsion: &Torsion<N>) -> Result<(), Fault> {
        for i in (0..N).step_by(2) {
            let (alpha, beta) = (pair(&torsion.alpha, i), pair(&torsion.beta, i));
            let room = (both(1.0) - alpha * alpha, both(1.0) - beta * beta);
            let least = both(MIN_SIN_SQUARED);
            if !(room.0.simd_ge(least) & room.1.simd_ge(least)).all() {
                return Err(torsion.along_axis());
            }
        }
        Ok(())
    }

    /// Refuses a strut whose torsion is undefined or near its jump.
    #[inline(always)]
    pub fn refuse(&self, torsion: &Torsion<N>) -> Result<(), Fault> {
        self.refuse_along_axis(torsion)?;
        for i in (0..N).step_by(2) {
            if !pair(&torsion.from_fold, i).abs().simd_le(both(MAX_TORSION)).all() {
                return Err(torsion.beyond());
            }
        }
        Ok(())
    }

    /// Computes the lengths to add to the struts, in machine units.
    #[inline(always)]
    pub fn corrections(&self, torsion: &Torsion<N>) -> [f64; N] {
        let mut out = [0.0; N];
        for i in (0..N).step_by(2) {
            let factor = pair(&torsion.hand, i) * pair(&self.travel, i);
            put(&mut out, i, factor * pair(&torsion.from_fold, i));
        }
        out
    }

    /// Computes the exact gradient of [`Self::corrections`] for legs i and i + 1 with the unit vectors
    /// `n`, 1/l = `curved`:
    ///
    /// ```text
    /// w  = ( β (B×n)/(1−β²) − α (A×n)/(1−α²) ) / l
    /// dφ = w·v + ( ρ×w + (n − βB)/(1−β²) )·ω
    /// ```
    #[inline(always)]
    pub fn rates(&self, torsion: &Torsion<N>, i: usize, n: &[f64x2; 3], curved: f64x2) -> Rates {
        let factor = pair(&torsion.hand, i) * pair(&self.travel, i);
        let (alpha, beta) = (pair(&torsion.alpha, i), pair(&torsion.beta, i));
        let of_n = factor / (both(1.0) - beta * beta);
        let of_b = beta * of_n;
        let of_a = alpha * factor / (both(1.0) - alpha * alpha);
        let (a, b) = (self.base_axis.pair(i), torsion.platform_axis.pair(i));
        // One product with n for both axes.
        let axes = sum(&scaled(&b, of_b * curved), &scaled(&a, -of_a * curved));
        Rates { along: cross(&axes, n), moment: sum(&scaled(n, of_n), &scaled(&b, -of_b)) }
    }

    /// Bounds the correction's second derivative in the chart scaled by r, over the
    /// ball of radius `rho`; `None` if the ball may reach a joint axis, or the
    /// pose where the correction folds.
    ///
    /// With κ = |lead|/2π, n' = s₁/l, n'' = s₂/l + 3n'², and θA, θB the angles of n from
    /// the planes normal to the joint axes, increased by their largest change in the ball:
    /// κ (3n'²/cos²θA + 3(n'+1/r)²/cos²θB + (tan θA + tan θB) n'' + 1/(r² cos θB)).
    #[inline(always)]
    pub fn curvature(&self, torsion: &Torsion<N>, i: usize, ball: &Ball) -> Option<f64x2> {
        let kappa = pair(&self.travel, i).abs();
        let idle = kappa.simd_eq(both(0.0));
        let (rho, turn) = (both(ball.rho), both(1.0 / ball.radius));
        let n1 = ball.s1 * ball.curved;
        let n2 = ball.s2 * ball.curved + both(3.0) * n1 * n1;
        let n1b = n1 + turn;
        let a = Widened::new(pair(&torsion.alpha, i), n1 * rho);
        let b = Widened::new(pair(&torsion.beta, i), n1b * rho);
        let slope = n1 * (a.tan + b.tan) + turn * b.secant;
        let fold = match self.fold {
            Fold::Literal => core::f64::consts::FRAC_PI_2,
            Fold::Fixed => MAX_TORSION,
        };
        let folded = pair(&torsion.from_fold, i).abs() + slope * rho;
        if !(idle | (a.allowed & b.allowed & folded.simd_lt(both(fold)))).all() {
            return None;
        }
        let bending = both(3.0) * (n1 * n1 * a.secant * a.secant + n1b * n1b * b.secant * b.secant);
        let bound = kappa * (bending + (a.tan + b.tan) * n2 + turn * turn * b.secant);
        Some(idle.select(both(0.0), bound))
    }
}

impl<const N: usize> Torsion<N> {
    pub const ZERO: Self = Self {
        platform_axis: Lanes3::ZERO,
        alpha: [0.0; N],
        beta: [0.0; N],
        sine: [0.0; N],
        cosine: [0.0; N],
        hand: [0.0; N],
        from_fold: [0.0; N],
    };

    /// Fills in the arcs. A separate loop, see `lanes` (overlap).
    #[inline(always)]
    fn unfold(&mut self) {
        for i in (0..N).step_by(2) {
            let hand = pair(&self.hand, i);
            let (sine, cosine) = (hand * pair(&self.sine, i), hand * pair(&self.cosine, i));
            put(&mut self.from_fold, i, broad_arcs(sine, cosine));
        }
    }

    /// Returns the refusal of the strut most nearly along a joint axis.
    pub fn along_axis(&self) -> Fault {
        let mut worst = (0, f64::INFINITY);
        for i in 0..N {
            if !(self.room(i) >= worst.1) {
                worst = (i, self.room(i));
            }
        }
        Fault::of_leg(Cause::StrutAlongAxis, worst.0, worst.1)
    }

    /// Returns the refusal of the strut with the largest torsion.
    fn beyond(&self) -> Fault {
        let mut most = (0, 0.0);
        for i in 0..N {
            if self.from_fold[i].abs() > f64::abs(most.1) {
                most = (i, self.from_fold[i]);
            }
        }
        Fault::of_leg(Cause::TorsionTooLarge, most.0, most.1 * 180.0 / core::f64::consts::PI)
    }

    /// Returns why these torsions are uncertain: they are too large, or a strut is too near to
    /// one of its joint axes.
    pub fn uncertain(&self) -> Fault {
        // Near an axis any step changes a torsion by an arbitrary amount.
        let clear = (0..N).all(|i| self.room(i) > NEAR_AXIS);
        if clear { self.beyond() } else { self.along_axis() }
    }

    /// Returns the squared sine of the angle between leg i and the nearer of its joint axes.
    pub fn room(&self, i: usize) -> f64 {
        room(self.alpha[i], self.beta[i])
    }

    fn norm(&self, i: usize) -> f64 {
        sqrt(self.sine[i] * self.sine[i] + self.cosine[i] * self.cosine[i])
    }
}

fn room(alpha: f64, beta: f64) -> f64 {
    (1.0 - alpha * alpha).min(1.0 - beta * beta)
}

/// The ball around a pose in which a bound must be valid, for two legs.
pub(crate) struct Ball {
    /// Radius of the ball, a length.
    pub rho: f64,
    /// Radius of the platform, a length: the chart is scaled by it.
    pub radius: f64,
    /// 1/l of the shortest legs within the ball.
    pub curved: f64x2,
    pub s1: f64x2,
    pub s2: f64x2,
}

/// Bounds for angles asin|sine| after widening.
struct Widened {
    /// Whether they stay below a right angle.
    allowed: f64x2,
    secant: f64x2,
    tan: f64x2,
}

impl Widened {
    /// Widens by `by` radians.
    #[inline(always)]
    fn new(sine: f64x2, by: f64x2) -> Self {
        let sine = sine.abs();
        let cosine = (both(1.0) - sine * sine).sqrt();
        // sin by ≤ by and cos by ≥ 1 − by²/2 avoid trigonometry in the servo thread.
        let least = cosine * (both(1.0) - both(0.5) * by * by) - sine * by;
        let secant = both(1.0) / least;
        let most = sine + cosine * by;
        Self { allowed: least.simd_gt(both(LEAST_SINE_TO_AXIS)), secant, tan: most * secant }
    }
}

/// Computes the unit vector of an axis as given.
fn direction(given: &[f64; 3], leg: usize) -> Result<Vector3<f64>, Fault> {
    leg::direction(given).ok_or(Fault::of_leg(Cause::AxisZero, leg, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{FRAC_PI_2, PI, TAU};

    /// A few roundings of numbers near 1.
    const ROUNDING: f64 = 1e-15;

    /// Creates two equal screws with a travel of 2 per radian, and two legs without screws.
    fn nut(fold: Fold) -> Nut<4> {
        Nut { travel: [2.0, 2.0, 0.0, 0.0], idle: [0.0, 0.0, 1.0, 1.0], fold, ..NONE }
    }

    const NONE: Nut<4> = Nut {
        base_axis: Lanes3::ZERO,
        platform_axis: Lanes3::ZERO,
        travel: [0.0; 4],
        idle: [1.0; 4],
        fold: Fold::Fixed,
    };

    /// n' = 0.1 and n'' = 0.05 + 3·0.1², on a platform of radius 10, over a distance of 2: angles of
    /// a strut to its axes may change by sines of 0.2 at the base and 0.4 at the platform.
    const BALL: Ball =
        Ball { rho: 2.0, radius: 10.0, curved: f64x2::splat(0.1), s1: f64x2::ONE, s2: f64x2::HALF };

    /// Creates sines 0.6 and 0.28, cosines 0.8 and 0.96. The ball widens them by 0.2 and 0.4, to cosines
    /// of 0.8 · 0.98 − 0.6 · 0.2 and 0.96 · 0.92 − 0.28 · 0.4, and sines of 0.6 + 0.8 · 0.2 and
    /// 0.28 + 0.96 · 0.4.
    fn tilted(from_fold: f64) -> Torsion<4> {
        Torsion { alpha: [0.6; 4], beta: [-0.28; 4], from_fold: [from_fold; 4], ..Torsion::ZERO }
    }

    const COSINES: [f64; 2] = [0.664, 0.7712];
    const TANGENTS: f64 = 0.76 / COSINES[0] + 0.664 / COSINES[1];

    #[test]
    fn curvature_is_that_of_the_formula_at_numbers_by_hand() {
        let bound = nut(Fold::Fixed).curvature(&tilted(0.0), 0, &BALL).expect("within");
        let [a, b] = COSINES;
        let squares = 3.0 * (0.01 / (a * a) + 0.04 / (b * b));
        let expected = 2.0 * (squares + TANGENTS * 0.08 + 0.01 / b);
        for bound in bound.to_array() {
            assert!((bound - expected).abs() < ROUNDING, "{bound} {expected}");
        }
        let idle = nut(Fold::Fixed).curvature(&tilted(0.0), 2, &BALL);
        assert_eq!(idle.map(f64x2::to_array), Some([0.0; 2]));
    }

    #[test]
    fn there_is_no_curvature_where_the_correction_may_fold() {
        // Change of torsion over a distance of 2.
        let turn = 2.0 * 0.1 * (TANGENTS + 1.0 / COSINES[1]);
        for (fold, limit) in [(Fold::Fixed, 170.0 / 180.0 * PI), (Fold::Literal, FRAC_PI_2)] {
            let within = |torsion| nut(fold).curvature(&tilted(torsion), 0, &BALL).is_some();
            let room = limit - turn;
            for sign in [-1.0, 1.0] {
                assert!(within(sign * (room - 1e-6)), "{limit}");
                assert!(!within(sign * (room + 1e-6)), "{limit}");
            }
        }
    }

    #[test]
    fn there_is_no_curvature_where_a_strut_may_meet_a_joint_axis() {
        // One of the two legs and one of the axes, widened by 0.0002 and 0.0004 to a cosine of
        // 0.001; torsions change by less than π.
        let ball = Ball { rho: 2e-3, ..BALL };
        let sine_of = |cosine: f64| sqrt(1.0 - cosine * cosine);
        for leg in 0..2 {
            for (alpha, beta, is_met) in [
                (sine_of(1.21e-3), -0.2, false),
                (-sine_of(1.19e-3), -0.2, true),
                (0.6, sine_of(1.41e-3), false),
                (0.6, -sine_of(1.39e-3), true),
            ] {
                let mut torsion = tilted(0.0);
                (torsion.alpha[leg], torsion.beta[leg]) = (alpha, beta);
                let bound = nut(Fold::Fixed).curvature(&torsion, 0, &ball);
                assert_eq!(bound.is_none(), is_met, "{leg}: {alpha} {beta}");
            }
        }
        // Legs without a screw have no joint axes to avoid.
        let idle = Torsion { alpha: [1.0; 4], beta: [1.0; 4], ..tilted(9.0) };
        assert_eq!(NONE.curvature(&idle, 0, &BALL).map(f64x2::to_array), Some([0.0; 2]));
    }

    #[test]
    fn the_strut_that_is_nearest_to_an_axis_is_refused_with_the_square_of_its_sine() {
        let nut = nut(Fold::Fixed);
        let mut torsion = tilted(0.0);
        assert_eq!(nut.refuse_along_axis(&torsion), Ok(()));
        assert!((torsion.room(0) - 0.64).abs() < ROUNDING);
        torsion.beta[1] = 0.8;
        assert!((torsion.room(1) - 0.36).abs() < ROUNDING);
        // Sines slightly larger and slightly smaller than the smallest allowed ones.
        let (far, near) = (sqrt(1.0 - 1.1e-6), sqrt(1.0 - 0.9e-6));
        for leg in 0..4 {
            for sign in [-1.0, 1.0] {
                let mut along = torsion;
                along.alpha[leg] = sign * far;
                assert_eq!(nut.refuse_along_axis(&along), Ok(()));
                along.alpha[leg] = 0.6;
                along.beta[leg] = sign * near;
                let fault = nut.refuse_along_axis(&along).unwrap_err();
                assert_eq!(fault, Fault::of_leg(Cause::StrutAlongAxis, leg, fault.value));
                assert!((fault.value - 0.9e-6).abs() < ROUNDING, "{fault:?}");
            }
        }
    }

    #[test]
    fn inverse_asks_the_struts_themselves_whether_they_meet_an_axis() {
        let axes = |i: usize| [Vector3::x(), Vector3::y(), Vector3::z()][i % 3];
        let nut = Nut { base_axis: Lanes3::from_fn(axes), ..nut(Fold::Fixed) };
        let platform: [_; 4] = core::array::from_fn(|i| axes(i + 1));
        let nut = Nut { platform_axis: Lanes3::from_fn(|i| platform[i]), ..nut };
        // Struts of different lengths, perpendicular to both axes except one of them, whose squared sine
        // to one or the other axis is this.
        let met = |leg: usize, axis: Vector3<f64>, room: f64| {
            let off = axes(leg).cross(&platform[leg]);
            let strut = (axis * sqrt(1.0 - room) + off * sqrt(room)) * 3.0;
            let struts = Lanes3::<4>::from_fn(|i| {
                let across = axes(i).cross(&platform[i]) * 70.0;
                if i == leg { strut } else { across }
            });
            let mut turns = Turns::ZERO;
            let known = [0, 2].map(|i| {
                let pair = struts.pair(i);
                let length = dot(&pair, &pair).sqrt();
                nut.turn(i, (&pair, length), &Matrix3::identity(), &mut turns).to_array()
            });
            [known[0][0], known[0][1], known[1][0], known[1][1]].map(|mask| mask.to_bits() == 0)
        };
        for leg in 0..4 {
            for axis in [axes(leg), platform[leg], -axes(leg), -platform[leg]] {
                assert_eq!(met(leg, axis, 1.1e-6), [false; 4], "{leg}");
                let expected: [bool; 4] = core::array::from_fn(|i| i == leg);
                assert_eq!(met(leg, axis, 0.9e-6), expected, "{leg}");
            }
        }
    }

    #[test]
    fn a_pose_near_a_quarter_turn_fixes_the_fold_and_its_cosine_is_returned() {
        // Axes perpendicular to the strut, the platform's rotated from the base's by an angle.
        let up = Lanes3::<4>::from_fn(|_| Vector3::z());
        let folded = |angle: f64, lean: f64| {
            let platform = [libm::cos(angle), libm::sin(angle), lean];
            let mut nut = Nut::new(&[[1.0, 0.0, 0.0]; 4], &[platform; 4], &[0.0, 5.0, 5.0, 5.0])?;
            nut.fold_at(&up, &Matrix3::identity()).map(|doubt| (nut, doubt))
        };
        for lean in [0.0, 1.0] {
            for cosine in [0.9, 0.11, 0.09, 1e-9, -1e-9, -0.09, -0.11] {
                let (nut, doubt) = folded(libm::acos(cosine), lean).expect("a fold");
                assert_eq!(nut.travel[0], 0.0);
                assert!((nut.travel[1] - 5.0_f64.copysign(cosine) / TAU).abs() < ROUNDING);
                assert_eq!(doubt.is_some(), cosine.abs() < 0.1);
                if let Some(fault) = doubt {
                    assert_eq!(fault, Fault::of_leg(Cause::FoldUndefined, 1, fault.value));
                    assert!((fault.value - cosine).abs() < ROUNDING, "{fault:?}");
                }
            }
        }
    }

    #[test]
    fn a_fold_is_taken_back_to_the_arcsin_and_fixed_anew_as_if_it_were_the_first() {
        let up = Lanes3::<4>::from_fn(|_| Vector3::z());
        let axis = |angle: f64| [libm::cos(angle), libm::sin(angle), 0.3];
        let fresh = Nut::new(&[[1.0, 0.0, 0.0]; 4], &[axis(0.3); 4], &[0.0, 5.0, -5.0, 5.0]);
        let turned =
            |angle: f64| *nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), angle).matrix();
        let corrections =
            |nut: &Nut<4>, angle: f64| nut.corrections(&nut.torsion(&up, &turned(angle)));
        let same = |one: &Nut<4>, other: &Nut<4>| {
            for k in -30..=30 {
                let angle = 0.1 * f64::from(k);
                let (one, other) = (corrections(one, angle), corrections(other, angle));
                // A few roundings of numbers below 3.
                assert!((0..4).all(|i| (one[i] - other[i]).abs() < 4.0 * ROUNDING), "{angle}");
            }
        };
        let fresh = fresh.expect("axes");
        let mut nut = fresh;
        for angle in [0.0, 2.5, 0.1, -2.9] {
            assert_eq!(nut.fold_at(&up, &turned(angle)), Ok(None));
            let mut first = fresh;
            assert_eq!(first.fold_at(&up, &turned(angle)), Ok(None));
            same(&nut, &first);
            assert!(!nut.is_literal());
            // Twice, because a fold may be changed without being reverted.
            if angle > 0.0 {
                nut.unfold();
                assert!(nut.is_literal());
                same(&nut, &fresh);
            }
        }
    }
}
