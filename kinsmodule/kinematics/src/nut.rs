// SPDX-License-Identifier: GPL-2.0-or-later
//! Nut rotation: a strut whose screw and nut are held by cardan joints only is
//! twisted about its own axis by a change of pose, and the thread turns that twist
//! into length the motor did not command.
//!
//! Source: paper 004 (Novikov, Strutynsky, Kyrychenko 2011), equation 1, in its
//! closed and continuous form. With the unit vectors n (strut, base to platform),
//! A (axis of the base joint fixed in base), B (axis of the platform joint, R times
//! its direction in the platform), α = A·n, β = B·n:
//!
//! ```text
//! S = n·(A×B),  C = A·B − αβ,  twist φ = atan2(S, C)
//! correction = h (lead/2π) atan2(h S, h C),   h = cos φ₀ = ±1
//! ```
//!
//! φ₀ is 0 or π, whichever is nearer to φ at the reference pose. Within ±90° of φ₀
//! this equals the published arcsin (genhexkins); beyond, it stays continuous. With
//! no reference pose h follows the sign of C at every pose: that is the arcsin itself.
//! lead > 0 is a right-hand screw if A and B were entered in opposite senses.

use crate::fault::{Cause, Fault};
use crate::lanes::{Lanes3, both, cross, dot, pair, put};
use crate::pose::arc;
use libm::sqrt;
use nalgebra::{Matrix3, Vector3};

/// Smallest 1 − α² and 1 − β²: nearer to a joint axis the twist is undefined.
const MIN_SIN_SQUARED: f64 = 1e-6;

/// Smallest |cos(φ − φ₀)| at the reference pose: nearer to a quarter turn the
/// choice of φ₀ would hang on rounding.
const MIN_FOLD_COS: f64 = 0.1;

/// Where the continuous correction is folded.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fold {
    /// No reference pose: the published arcsin, h = sign C at each pose.
    Literal,
    /// h fixed by the reference pose, leg by leg.
    Fixed,
}

/// The screws of all legs; legs without lead have `travel` 0 and zero axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Nut<const N: usize> {
    base_axis: Lanes3<N>,
    platform_axis: Lanes3<N>,
    /// lead / 2π: length per radian of twist.
    travel: [f64; N],
    hand: [f64; N],
    /// 1 for a leg without a screw, which gives it a twist of 0; else 0.
    idle: [f64; N],
    fold: Fold,
}

/// The twist of every leg at one pose.
#[derive(Clone, Copy)]
pub(crate) struct Twist<const N: usize> {
    /// Platform axes in base.
    platform_axis: Lanes3<N>,
    alpha: [f64; N],
    beta: [f64; N],
    sine: [f64; N],
    cosine: [f64; N],
    hand: [f64; N],
    /// φ − φ₀, in (−π, π].
    from_fold: [f64; N],
}

/// Gradient of the correction: force part along v, free moment along ω.
pub(crate) struct CorrectionRates<const N: usize> {
    pub along: Lanes3<N>,
    pub moment: Lanes3<N>,
}

impl<const N: usize> Nut<N> {
    /// From axes (checked to be finite, not yet to be non-zero) and leads.
    pub fn new(
        base_axis: &[[f64; 3]; N],
        platform_axis: &[[f64; 3]; N],
        lead: &[f64; N],
    ) -> Result<Self, Fault> {
        let mut nut = Self {
            base_axis: Lanes3::ZERO,
            platform_axis: Lanes3::ZERO,
            travel: lead.map(|l| l / core::f64::consts::TAU),
            hand: [1.0; N],
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

    /// Fixes φ₀ by the reference pose, given its strut directions and orientation.
    pub fn fold_at(&mut self, n: &Lanes3<N>, rotation: &Matrix3<f64>) -> Result<(), Fault> {
        let twist = self.twist(n, rotation);
        self.refuse_along_axis(&twist)?;
        for i in 0..N {
            if self.travel[i] == 0.0 {
                continue;
            }
            let cos = twist.cosine[i] / twist.norm(i);
            if !(cos.abs() >= MIN_FOLD_COS) {
                return Err(Fault::of_leg(Cause::FoldUndefined, i, cos));
            }
            self.hand[i] = cos.signum();
        }
        self.fold = Fold::Fixed;
        Ok(())
    }

    /// Twist of every leg; [`Self::refuse_along_axis`] tells whether it means anything.
    #[inline(always)]
    pub fn twist(&self, n: &Lanes3<N>, rotation: &Matrix3<f64>) -> Twist<N> {
        let mut twist = Twist::ZERO;
        self.project(n, rotation, &mut twist);
        for i in (0..N).step_by(2) {
            let hand = pair(&twist.hand, i);
            let (sine, cosine) = (hand * pair(&twist.sine, i), hand * pair(&twist.cosine, i));
            put(&mut twist.from_fold, i, sine.atan2(cosine));
        }
        twist
    }

    /// Twist of every leg at a pose near that of `twist`, in its place: the arcs of the
    /// small differences are what costs least.
    #[inline(always)]
    pub fn twist_on(&self, n: &Lanes3<N>, rotation: &Matrix3<f64>, twist: &mut Twist<N>) {
        if self.fold == Fold::Literal {
            *twist = self.twist(n, rotation);
            return;
        }
        let (s0, c0) = (twist.sine, twist.cosine);
        self.project(n, rotation, twist);
        for i in 0..N {
            let (s, c) = (twist.sine[i], twist.cosine[i]);
            twist.from_fold[i] += arc(s * c0[i] - c * s0[i], c * c0[i] + s * s0[i]);
        }
    }

    /// All of a twist but the arc.
    #[inline(always)]
    fn project(&self, n: &Lanes3<N>, rotation: &Matrix3<f64>, twist: &mut Twist<N>) {
        let r = rotation.map(both);
        for i in (0..N).step_by(2) {
            let [px, py, pz] = self.platform_axis.pair(i);
            let b = [
                r[(0, 0)] * px + r[(0, 1)] * py + r[(0, 2)] * pz,
                r[(1, 0)] * px + r[(1, 1)] * py + r[(1, 2)] * pz,
                r[(2, 0)] * px + r[(2, 1)] * py + r[(2, 2)] * pz,
            ];
            twist.platform_axis.put(i, b);
            let (a, n) = (self.base_axis.pair(i), n.pair(i));
            let (alpha, beta) = (dot(&a, &n), dot(&b, &n));
            put(&mut twist.alpha, i, alpha);
            put(&mut twist.beta, i, beta);
            put(&mut twist.sine, i, dot(&n, &cross(&a, &b)));
            put(&mut twist.cosine, i, dot(&a, &b) - alpha * beta + pair(&self.idle, i));
        }
        twist.hand = self.hand;
        if self.fold == Fold::Literal {
            twist.hand = twist.cosine.map(|c| if c < 0.0 { -1.0 } else { 1.0 });
        }
    }

    /// Refuses a strut that points along one of its joint axes: it has no twist.
    #[inline(always)]
    pub fn refuse_along_axis(&self, twist: &Twist<N>) -> Result<(), Fault> {
        let mut free = true;
        for i in 0..N {
            free &= twist.room(i) >= MIN_SIN_SQUARED;
        }
        if free { Ok(()) } else { Err(twist.along_axis()) }
    }

    /// Lengths to add to the struts, in machine units.
    #[inline(always)]
    pub fn corrections(&self, twist: &Twist<N>) -> [f64; N] {
        let mut out = [0.0; N];
        for i in 0..N {
            out[i] = twist.hand[i] * self.travel[i] * twist.from_fold[i];
        }
        out
    }

    /// Exact gradient of [`Self::corrections`]:
    ///
    /// ```text
    /// w  = ( β (B×n)/(1−β²) − α (A×n)/(1−α²) ) / l
    /// dφ = w·v + ( ρ×w + (n − βB)/(1−β²) )·ω
    /// ```
    #[inline(always)]
    pub fn rates(&self, twist: &Twist<N>, n: &Lanes3<N>, length: &[f64; N]) -> CorrectionRates<N> {
        let mut of_a = [0.0; N];
        let mut of_b = [0.0; N];
        let mut of_n = [0.0; N];
        let mut of_axis = [0.0; N];
        for i in 0..N {
            let gain = twist.hand[i] * self.travel[i];
            let (alpha, beta) = (twist.alpha[i], twist.beta[i]);
            of_n[i] = gain / (1.0 - beta * beta);
            of_axis[i] = -beta * of_n[i];
            of_b[i] = beta * of_n[i] / length[i];
            of_a[i] = -alpha * gain / ((1.0 - alpha * alpha) * length[i]);
        }
        let b = &twist.platform_axis;
        let from_b = b.cross(n).scaled(&of_b);
        let from_a = self.base_axis.cross(n).scaled(&of_a);
        let across = b.scaled(&of_axis);
        let turn = n.scaled(&of_n);
        let sum = |p: &Lanes3<N>, q: &Lanes3<N>| Lanes3::from_fn(|i| p.get(i) + q.get(i));
        CorrectionRates { along: sum(&from_a, &from_b), moment: sum(&turn, &across) }
    }

    /// Bound of the correction's second derivative in the chart scaled by r, over the
    /// ball of radius `rho`; `None` where the ball may reach a joint axis, or the
    /// place where the correction folds.
    ///
    /// With κ = |lead|/2π, n' = s₁/l, n'' = s₂/l + 3n'², and θA, θB the angles of n from
    /// the planes normal to the joint axes, widened by what the ball may turn them:
    /// κ (3n'²/cos²θA + 3(n'+1/r)²/cos²θB + (tan θA + tan θB) n'' + 1/(r² cos θB)).
    pub fn curvature(&self, twist: &Twist<N>, i: usize, ball: &Ball) -> Option<f64> {
        let kappa = self.travel[i].abs();
        if kappa == 0.0 {
            return Some(0.0);
        }
        let turn = 1.0 / ball.radius;
        let n1 = ball.s1 / ball.length;
        let n2 = ball.s2 / ball.length + 3.0 * n1 * n1;
        let a = widened(twist.alpha[i], n1 * ball.rho)?;
        let b = widened(twist.beta[i], (n1 + turn) * ball.rho)?;
        let slope = n1 * (a.tan + b.tan) + turn / b.cos;
        let fold = match self.fold {
            Fold::Literal => core::f64::consts::FRAC_PI_2,
            Fold::Fixed => core::f64::consts::PI,
        };
        if !(twist.from_fold[i].abs() + slope * ball.rho < fold) {
            return None;
        }
        let (ca, cb) = (a.cos * a.cos, b.cos * b.cos);
        let n1b = n1 + turn;
        let bending = 3.0 * n1 * n1 / ca + 3.0 * n1b * n1b / cb;
        Some(kappa * (bending + (a.tan + b.tan) * n2 + turn * turn / b.cos))
    }
}

impl<const N: usize> Twist<N> {
    pub const ZERO: Self = Self {
        platform_axis: Lanes3::ZERO,
        alpha: [0.0; N],
        beta: [0.0; N],
        sine: [0.0; N],
        cosine: [0.0; N],
        hand: [0.0; N],
        from_fold: [0.0; N],
    };

    /// The strut that points most closely along a joint axis.
    #[cold]
    fn along_axis(&self) -> Fault {
        let mut worst = (0, f64::INFINITY);
        for i in 0..N {
            if !(self.room(i) >= worst.1) {
                worst = (i, self.room(i));
            }
        }
        Fault::of_leg(Cause::StrutAlongAxis, worst.0, worst.1)
    }

    /// Squared sine of the angle between leg i and the nearer of its joint axes.
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

/// The ball about a pose over which a bound has to hold, for one leg.
pub(crate) struct Ball {
    /// Radius of the ball, a length.
    pub rho: f64,
    /// Radius of the platform, a length: the chart is scaled by it.
    pub radius: f64,
    /// Shortest leg within the ball.
    pub length: f64,
    pub s1: f64,
    pub s2: f64,
}

struct Widened {
    cos: f64,
    tan: f64,
}

/// cos and tan of the angle asin|sine| widened by `by` radians; refused beyond 89°.
fn widened(sine: f64, by: f64) -> Option<Widened> {
    const SIN_89: f64 = 0.999_847_695_156_391_3;
    // |sin(θ + by)| ≤ |sin θ| + by, which keeps trigonometry out of the servo path.
    let sin = sine.abs() + by;
    if !(sin < SIN_89) {
        return None;
    }
    let cos = sqrt(1.0 - sin * sin);
    Some(Widened { cos, tan: sin / cos })
}

/// Unit vector of an axis as given.
fn direction(given: &[f64; 3], leg: usize) -> Result<Vector3<f64>, Fault> {
    crate::leg::direction(given).ok_or(Fault::of_leg(Cause::AxisZero, leg, 0.0))
}
