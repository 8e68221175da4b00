// SPDX-License-Identifier: GPL-2.0-or-later
//! The certificate: the ball around a pose in which the legs determine the pose.
//!
//! Chart at a pose (p₀, R₀): X = (p₀ + v, exp([ω]) R₀), with norm ‖(v, r ω)‖ and r
//! the platform radius; if not all of A, B, C are active, the active angles replace
//! ω. A platform anchor moves with |Ds| ≤ s₁ and |D²s| ≤ s₂, so within a ball
//! of radius ρ a leg of length l has
//!
//! ```text
//! |D²f| ≤ k = s₁²/l_min + s₂  (+ the nut term),   l_min = l − s₁ρ
//! ```
//!
//! With L = ‖J⁻¹‖_F √Σk² of the ball: if L ρ < 1, then ‖I − J⁻¹J(X)‖ < 1 on it, so
//! forward is one-to-one and J regular there. A solution at distance d with L(d) d < 1
//! is therefore the only one in its ball, and h = L η ≤ 1/2 (η = first Newton step, L of
//! the ball of radius 2η) proves a priori that the platform's path along the straight
//! joint path to the target stays inside (Newton-Kantorovich). Steps turn the platform
//! by Cayley's formula instead of exp: a smaller turn by at most |ω|³/12, which the
//! margin between 0.4 and 1/2 covers. With more legs than coordinates J⁻¹ is the
//! pseudo-inverse, and the certificate covers the one pose that fits all legs. Joints that contradict
//! each other by |F| have a least-squares pose instead, which may differ by about L d ‖J⁻¹‖ |F|
//! (d = distance from the center of the ball); the residual limit bounds |F|.
//!
//! **Moving base anchors** (carriages, cranks) rotate the rows while the joints move. The platform
//! is shifted by their mean displacement, which changes no leg; the remainder
//! is the travel δ of each anchor, |δ'| ≤ δ over a step of unit time, |c''| its second derivative, and
//! |d''| that of the length set by the joint (0 except for a kind whose length is not
//! linear in q; no row depends on d). Relative to the shifted platform, a gradient
//! changes by at most s₁δ/l_min, and a residual at a fixed pose differs from the straight line
//! between its ends by at most (δ²/l_min + |c''| + |d''|)/8 = b. So
//!
//! ```text
//! h = L η + ‖J⁻¹‖_F √Σ(s₁δ/l_min)²,   η = first step + ‖J⁻¹‖_F √Σb²
//! ```
//!
//! replaces L η: η + Lρ²/2 + (h − Lη)ρ ≤ ρ for ρ = 2η and h ≤ 1/2, throughout the step.
//!
//! **Rings** (module `leg::ring`): the platform anchor slides on a circle of radius r whose axis is
//! at distance ϱ from the base anchor. This subtracts (r/ϱ)(e · y)²/l from the second derivative, with y
//! the velocity of the platform's point at the base anchor. With B the distance of that point from the
//! reference point, |y| ≤ Y = √(1 + ((B + ρ)/radius)²) in the ball, and ϱ decreases by at most Yρ. The
//! two parts have opposite signs, so that
//!
//! ```text
//! |D²f| ≤ k = max(s₁², (r/ϱ_min) Y²)/l_min + s₂
//! ```
//!
//! **Constraints** (module `coupling`) have no length: |D²f| has a bound of its own, their value is linear in the shift
//! of the platform, and only the row of a plane through a point changes with it.
//!
//! If base anchors also move, a row changes by (s₁ + (r/ϱ_min) Y) δ/l_min, and a residual at a
//! fixed pose deviates by max(1, r/ϱ_min) δ²/l_min.

use crate::fault::{Cause, Fault};
use crate::lanes::{both, pair};
use crate::leg::LEAST_DRIVE;
use crate::mechanism::Mechanism;
use crate::nut::{Ball, Torsion};
use crate::placed::Placed;
use crate::pseudo_inverse::PseudoInverse;
use crate::rings::Rings;
use libm::sqrt;
use nalgebra::Vector3;
use wide::f64x2;

/// Largest h = L η that counts as certified: Newton-Kantorovich allows 1/2, the rest
/// covers the convergence error of a sub-step.
pub const CERTIFIED: f64 = 0.4;

/// A pose whose ball is smaller than this share of the size counts as singular.
pub const CERTAIN_AT_ALL: f64 = 1e-6;

/// Motion of the base anchors while the joints move from one set of values to another in
/// unit time, relative to the shifted platform.
#[derive(Clone, Copy)]
pub(crate) struct Motion<const N: usize> {
    /// Displacement by which the platform is shifted.
    pub shift: Vector3<f64>,
    /// Per leg, travel of the anchor relative to that.
    pub travel: [f64; N],
    /// Per leg, |c''| + |d''|, a length.
    pub second: [f64; N],
    /// Per leg, the largest change of its margin while its direction is constant.
    pub turn: [f64; N],
}

/// Computes L of the ball of radius `rho`: 1/L bounds the ball on which the legs determine the pose;
/// with `motion`, throughout the motion.
///
/// # Errors
/// A ball that is too large for any statement: it reaches a leg of zero length, a
/// strut along one of its joint axes, or the limit of the nut correction.
pub(crate) fn lipschitz_constant<const N: usize>(
    machine: &Mechanism<N>,
    placed: &Placed<N>,
    torsion: Option<&Torsion<N>>,
    inverse: &PseudoInverse<N>,
    rho: f64,
    motion: Option<&Motion<N>>,
) -> Result<f64, Fault> {
    let mut sum = f64x2::ZERO;
    for i in (0..N).step_by(2) {
        let mut k = curvature(machine, placed, torsion, i, rho, motion)?;
        if let Some(couplings) = machine.couplings() {
            let shift = motion.map_or(0.0, |motion| motion.shift.norm());
            let [one, other] = k.to_array();
            let of = |lane, leg| couplings.curvature(placed, lane, rho, shift).unwrap_or(leg);
            k = f64x2::new([of(i, one), of(i + 1, other)]);
        }
        let k = k * pair(&machine.present, i);
        sum += k * k;
    }
    Ok(inverse.inverse_norm() * sqrt(sum.reduce_add()))
}

/// Computes k of legs `i` and `i + 1`: bound of the second derivative of their residuals within the
/// ball.
#[inline(always)]
fn curvature<const N: usize>(
    machine: &Mechanism<N>,
    placed: &Placed<N>,
    torsion: Option<&Torsion<N>>,
    i: usize,
    rho: f64,
    motion: Option<&Motion<N>>,
) -> Result<f64x2, Fault> {
    let (s1, s2) = (pair(&machine.s1, i), pair(&machine.s2, i));
    let curved = most_curved(machine, placed, i, rho, motion)?;
    let mut of_square = s1 * s1;
    if let Some(rings) = machine.rings() {
        of_square = of_square.fast_max(slipping(&rings, placed, i, rho, motion)?);
    }
    Ok(of_square * curved + s2 + of_nut(machine, torsion, i, rho, curved)?)
}

/// Computes 1/l_min of legs `i` and `i + 1` within the ball.
#[inline(always)]
fn most_curved<const N: usize>(
    machine: &Mechanism<N>,
    placed: &Placed<N>,
    i: usize,
    rho: f64,
    motion: Option<&Motion<N>>,
) -> Result<f64x2, Fault> {
    let mut shortest = pair(&placed.length, i) - pair(&machine.s1, i) * both(rho);
    if let Some(motion) = motion {
        shortest -= pair(&motion.travel, i);
    }
    if !shortest.simd_gt(both(0.0)).all() {
        let [one, other] = shortest.to_array();
        let (leg, length) = if one > 0.0 { (i + 1, other) } else { (i, one) };
        return Err(Fault::of_leg(Cause::StrutTooShort, leg, length));
    }
    Ok(both(1.0) / shortest)
}

/// Computes the nut's part of the curvature of legs `i` and `i + 1`.
#[inline(always)]
fn of_nut<const N: usize>(
    machine: &Mechanism<N>,
    torsion: Option<&Torsion<N>>,
    i: usize,
    rho: f64,
    curved: f64x2,
) -> Result<f64x2, Fault> {
    let (Some(nut), Some(torsion)) = (&machine.nut, torsion) else { return Ok(f64x2::ZERO) };
    let (s1, s2) = (pair(&machine.s1, i), pair(&machine.s2, i));
    let ball = Ball { rho, radius: machine.radius, curved, s1, s2 };
    nut.curvature(torsion, i, &ball).ok_or_else(|| torsion.uncertain())
}

/// Computes the term that replaces s₁² if the platform anchors of legs `i` and `i + 1` slide.
fn slipping<const N: usize>(
    rings: &Rings<'_, N>,
    placed: &Placed<N>,
    i: usize,
    rho: f64,
    motion: Option<&Motion<N>>,
) -> Result<f64x2, Fault> {
    let of_leg = |leg: usize| {
        // The compiler knows this bound.
        let leg = leg.min(N - 1);
        let travel = motion.map_or(0.0, |motion| motion.travel[leg]);
        rings
            .widened(placed, leg, rho, travel)
            .map(|ring| ring.ratio * ring.speed * ring.speed)
            .ok_or(Fault::of_leg(Cause::AxisAtAnchor, leg, placed.rho[leg]))
    };
    Ok(f64x2::new([of_leg(i)?, of_leg(i + 1)?]))
}

/// Computes the motion's addition to the first Newton step: the chord deviation of the residuals
/// between the ends of the step.
pub(crate) fn chord_deviation<const N: usize>(
    machine: &Mechanism<N>,
    placed: &Placed<N>,
    inverse: &PseudoInverse<N>,
    motion: &Motion<N>,
) -> f64 {
    let mut sum = 0.0;
    for i in 0..machine.count() {
        let chord_deviation = leg_chord_deviation(machine, placed, motion, i);
        sum += chord_deviation * chord_deviation;
    }
    inverse.inverse_norm() * sqrt(sum)
}

/// Bounds the deviation of the residual of leg `i` from the straight line between its ends; infinite if
/// the tool axis may reach the base anchor.
pub(crate) fn leg_chord_deviation<const N: usize>(
    machine: &Mechanism<N>,
    placed: &Placed<N>,
    motion: &Motion<N>,
    i: usize,
) -> f64 {
    let (travel, shortest) = (motion.travel[i], placed.length[i] - motion.travel[i]);
    let mut square = travel * travel;
    if let Some(rings) = machine.rings() {
        square *= rings.ratio(placed, i, travel).map_or(f64::INFINITY, |ratio| ratio.max(1.0));
    }
    (square / shortest.max(0.0) + motion.second[i]) / 8.0
}

/// Computes the motion's addition to h: the rotation of the rows with the anchors, in the ball of
/// radius `rho`. Infinite if a rod may reach its dead point; `margin` is the distance of
/// each rod from it.
pub(crate) fn row_change<const N: usize>(
    machine: &Mechanism<N>,
    placed: &Placed<N>,
    inverse: &PseudoInverse<N>,
    rho: f64,
    motion: &Motion<N>,
    margin: impl Fn(usize) -> Option<f64>,
) -> f64 {
    let mut sum = 0.0;
    for i in 0..machine.count() {
        let (s1, travel) = (machine.s1[i], motion.travel[i]);
        let shortest = placed.length[i] - s1 * rho - travel;
        if !(shortest > 0.0) {
            return f64::INFINITY;
        }
        let turn = (s1 * rho + travel) / shortest + motion.turn[i];
        if margin(i).is_some_and(|margin| !(margin > turn)) {
            return f64::INFINITY;
        }
        let mut speed = s1;
        if let Some(rings) = machine.rings() {
            let Some(ring) = rings.widened(placed, i, rho, travel) else { return f64::INFINITY };
            speed += ring.ratio * ring.speed;
        }
        let change = speed * travel / shortest;
        sum += change * change;
    }
    if let Some(couplings) = machine.couplings() {
        sum += couplings.row_change(motion.shift.norm());
    }
    inverse.inverse_norm() * sqrt(sum)
}

impl<const N: usize> Mechanism<N> {
    /// Computes the margin of leg `i` on its side at native joint value `q`; `None` for a strut.
    pub fn margin(&self, placed: &Placed<N>, i: usize, q: f64) -> Option<f64> {
        let leg = &self.legs[i];
        leg.margin(leg.transmission(q, &(placed.span.get(i) / placed.length[i])))
    }

    /// Refuses rods at or beyond their dead point at these joint values, and base anchors within the
    /// cylinders over their rings.
    pub fn refuse_dead_points(&self, placed: &Placed<N>, joints: &[f64; N]) -> Result<(), Fault> {
        for i in 0..self.count() {
            if let Some(margin) = self.margin(placed, i, joints[i] + self.offset[i])
                && !(margin >= LEAST_DRIVE)
            {
                return Err(Fault::of_leg(Cause::DeadPoint, i, margin));
            }
        }
        self.refuse_within_rings(placed)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    extern crate std;

    use super::*;
    use crate::freeze::Frozen;
    use crate::geometry::{Geometry, LegGeometry};
    use crate::lanes::Lanes3;
    use crate::layout::PerLeg;
    use crate::leg::{CrankGeometry, LegKind, RingGeometry, SliderGeometry, StrutGeometry};
    use crate::letters::Letters;
    use crate::mechanism::Chart;
    use crate::placed::Place;
    use crate::pose::Pose;
    use nalgebra::{Rotation3, Vector3};
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64;

    pub(crate) fn random(rng: &mut Pcg64, low: f64, high: f64) -> f64 {
        low + (high - low) * rng.random::<f64>()
    }

    pub(crate) fn vector(rng: &mut Pcg64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| random(rng, -1.0, 1.0))
    }

    /// Creates a leg of a random kind from near `p`, the position of its platform anchor at the pose.
    fn leg(rng: &mut Pcg64, platform: Vector3<f64>, p: Vector3<f64>, screws: bool) -> LegGeometry {
        let c = vector(rng) * 500.0;
        let span = p - c;
        let kind = match rng.random_range(0..4) {
            0 => {
                let strut = StrutGeometry {
                    base_axis: vector(rng).into(),
                    platform_axis: vector(rng).into(),
                    lead: if screws { random(rng, -50.0, 50.0) } else { 0.0 },
                };
                return LegGeometry::strut(c.into(), platform.into(), strut);
            }
            1 => {
                let guide = vector(rng);
                let side = if guide.dot(&span) > 0.0 { -1 } else { 1 };
                LegKind::Slider(SliderGeometry { guide: guide.into(), rod: span.norm(), side })
            }
            2 => LegKind::Ring(RingGeometry { radius: random(rng, 0.0, 200.0) }),
            _ => {
                let (axis, arm) = (vector(rng), vector(rng) * 300.0);
                let side = if axis.cross(&arm).dot(&span) > 0.0 { -1 } else { 1 };
                let crank =
                    CrankGeometry { axis: axis.into(), arm: arm.into(), rod: span.norm(), side };
                let base = (c - arm).into();
                let kind = LegKind::Crank(crank);
                return LegGeometry { base, platform: platform.into(), kind };
            }
        };
        LegGeometry { base: c.into(), platform: platform.into(), kind }
    }

    /// Creates a random machine with its platform about one meter above the base, and the pose.
    pub(crate) fn machine(
        rng: &mut Pcg64,
        coordinates: &[u8],
        screws: bool,
    ) -> Option<(Mechanism<6>, Place)> {
        let platform: [_; 6] = core::array::from_fn(|_| vector(rng) * 200.0);
        let letters = Letters::parse(coordinates).unwrap();
        let mut angles = vector(rng) * 0.5;
        for letter in crate::Letter::ALL {
            if letter.is_angle() && !letters.contains(letter) {
                angles[letter.index() - 3] = 0.0;
            }
        }
        let centre = vector(rng) * 100.0 + Vector3::new(0.0, 0.0, 900.0);
        let rotation = Pose { position: centre, angles }.rotation();
        let centroid = platform.iter().sum::<Vector3<f64>>() / 6.0;
        let legs = platform.map(|b| leg(rng, b, centre + rotation * (b - centroid), screws));
        let geometry = Geometry::new(&legs, letters, Letters::NONE).unwrap();
        let frozen = Frozen { geometry: &geometry, offset: &PerLeg::default() };
        let mechanism = frozen.mechanism().expect("random anchors are not degenerate");
        Some((mechanism, Place { centre, rotation, angles }))
    }

    /// Creates a direction in the chart, (v, r ω), of length 1; 0 for inactive coordinates.
    pub(crate) fn unit(rng: &mut Pcg64, machine: &Mechanism<6>) -> [f64; 6] {
        let raw: [f64; 6] =
            core::array::from_fn(|k| if machine.active[k] { random(rng, -1.0, 1.0) } else { 0.0 });
        let length = sqrt(raw.iter().map(|x| x * x).sum());
        raw.map(|x| x / length)
    }

    /// Computes the pose with coordinates `x` in the chart at `place`.
    pub(crate) fn at(machine: &Mechanism<6>, place: &Place, x: &[f64; 6]) -> Place {
        let centre = place.centre + Vector3::new(x[0], x[1], x[2]);
        let turn = Vector3::new(x[3], x[4], x[5]) / machine.radius;
        let angles = place.angles + turn;
        let rotation = match machine.chart {
            Chart::Group => Rotation3::new(turn).matrix() * place.rotation,
            Chart::Angles | Chart::Level => Pose { position: centre, angles }.rotation(),
        };
        Place { centre, rotation, angles }
    }

    /// Computes length and correction of every leg between `anchors` and the platform.
    pub(crate) fn lengths(
        machine: &Mechanism<6>,
        anchors: &Lanes3<6>,
        place: &Place,
    ) -> Option<[f64; 6]> {
        let placed = machine.placed(anchors, place);
        let mut lengths = placed.length;
        if let Some(nut) = &machine.nut {
            let torsion = nut.torsion(&placed.directions(), &place.rotation);
            nut.refuse_along_axis(&torsion).ok()?;
            for (length, correction) in lengths.iter_mut().zip(nut.corrections(&torsion)) {
                *length += correction;
            }
        }
        Some(lengths)
    }

    pub(crate) const CHARTS: [&[u8]; 5] = [b"XYZABC", b"XYZAB", b"XYZCB", b"XYZB", b"XYZ"];

    /// Computes the second derivative of every leg's length at a point of the chart, by differences.
    fn bending(
        machine: &Mechanism<6>,
        anchors: &Lanes3<6>,
        place: &Place,
        point: &[f64; 6],
        direction: &[f64; 6],
    ) -> Option<[f64; 6]> {
        // Step in units of the ray: the rounding error 2e-13/5e-2² stays below 1e-10, a share of 1e-3 of k.
        const STEP: f64 = 0.05;
        let lengths = |s: f64| {
            let x = core::array::from_fn(|k| point[k] + s * direction[k]);
            lengths(machine, anchors, &at(machine, place, &x))
        };
        let (a, b, c) = (lengths(-STEP)?, lengths(0.0)?, lengths(STEP)?);
        Some(core::array::from_fn(|i| (a[i] - 2.0 * b[i] + c[i]) / (STEP * STEP)))
    }

    /// Creates a machine whose bounds are simple numbers, its legs at these lengths,
    /// and factors whose inverse has the norm √6 / 2.
    fn by_hand(length: [f64; 6]) -> (Mechanism<6>, Placed<6>, PseudoInverse<6>) {
        let mut rng = Pcg64::seed_from_u64(14);
        let (mut machine, place) = machine(&mut rng, b"XYZABC", false).expect("a machine");
        (machine.s1, machine.s2) = ([2.0; 6], [0.25; 6]);
        machine.present = [1.0, 1.0, 0.0, 0.0, 0.0, 0.0];
        machine.slides = false;
        let anchors = machine.base;
        let placed = Placed { length, ..machine.placed(&anchors, &place) };
        let twice: [_; 6] =
            core::array::from_fn(|k| core::array::from_fn(|i| if i == k { 2.0 } else { 0.0 }));
        (machine, placed, PseudoInverse::new(&twice, &[true; 6]).expect("regular"))
    }

    fn motion(travel: [f64; 6]) -> Motion<6> {
        Motion { shift: Vector3::zeros(), travel, second: [0.4; 6], turn: [0.3; 6] }
    }

    /// Returns the product of the inverse's norm and of two legs with these numbers.
    fn of_both(one: f64, other: f64) -> f64 {
        sqrt(6.0) / 2.0 * sqrt(one * one + other * other)
    }

    // 1e-14: a few roundings of numbers below 10.
    fn assert_near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-14, "{found} {expected}");
    }

    #[test]
    fn the_lipschitz_constant_is_that_of_the_legs_shortened_by_ball_and_travel() {
        let (machine, placed, inverse) = by_hand([10.0, 18.0, 10.0, 10.0, 10.0, 10.0]);
        // 2² / (10 − 2·1) + 0.25 and 2² / (18 − 2·1) + 0.25.
        let lipschitz = lipschitz_constant(&machine, &placed, None, &inverse, 1.0, None).unwrap();
        assert_near(lipschitz, of_both(0.75, 0.5));
        // The same lengths less 3 and 11.
        let motion = motion([3.0, 11.0, 0.0, 0.0, 0.0, 0.0]);
        let lipschitz =
            lipschitz_constant(&machine, &placed, None, &inverse, 1.0, Some(&motion)).unwrap();
        assert_near(lipschitz, of_both(4.0 / 5.0 + 0.25, 4.0 / 5.0 + 0.25));
    }

    #[test]
    fn a_nut_adds_its_own_bend_to_that_of_the_length() {
        let mut rng = Pcg64::seed_from_u64(20);
        let mut added = 0;
        for _ in 0..60 {
            let Some((machine, place)) = machine(&mut rng, b"XYZABC", true) else { continue };
            let placed = machine.placed(&machine.base, &place);
            let Ok(Some(torsion)) = machine.torsion(&placed.directions(), &place.rotation) else {
                continue;
            };
            let bare = Mechanism { nut: None, ..machine.clone() };
            for i in [0, 2, 4] {
                let k = |m, torsion| curvature(m, &placed, torsion, i, 1.0, None);
                let (Ok(all), Ok(length)) = (k(&machine, Some(&torsion)), k(&bare, None)) else {
                    continue;
                };
                let (s1, s2) = (pair(&machine.s1, i), pair(&machine.s2, i));
                let curved = both(1.0) / (pair(&placed.length, i) - s1);
                let ball = Ball { rho: 1.0, radius: machine.radius, curved, s1, s2 };
                let nut = machine.nut.as_ref().and_then(|nut| nut.curvature(&torsion, i, &ball));
                assert_eq!(all, length + nut.expect("as above"));
                added += u32::from(all != length);
            }
        }
        assert!(added > 20, "{added}");
    }

    #[test]
    fn a_ball_that_reaches_a_leg_of_no_length_has_no_lipschitz_constant_and_names_it() {
        for leg in 0..6 {
            let mut length = [10.0; 6];
            length[leg] = 7.0;
            let (machine, placed, inverse) = by_hand(length);
            let lipschitz = |rho| lipschitz_constant(&machine, &placed, None, &inverse, rho, None);
            assert!(lipschitz(3.4).is_ok());
            let fault = Fault::of_leg(Cause::StrutTooShort, leg, 0.0);
            assert_eq!(lipschitz(3.5), Err(fault));
            assert_eq!(lipschitz(3.75), Err(Fault { value: -0.5, ..fault }));
        }
    }

    #[test]
    fn chord_deviation_and_row_change_are_those_of_travel_and_second_derivatives_at_numbers_by_hand()
     {
        let (machine, placed, inverse) = by_hand([12.0, 9.0, 1e9, 1e9, 1e9, 1e9]);
        let motion = motion([4.0, 3.0, 0.0, 0.0, 0.0, 0.0]);
        // (4²/(12 − 4) + 0.4)/8 and (3²/(9 − 3) + 0.4)/8; the others bend by 0.4/8.
        let expected = [0.3, 0.2375, 0.05, 0.05, 0.05, 0.05];
        for (leg, expected) in expected.into_iter().enumerate() {
            assert_near(leg_chord_deviation(&machine, &placed, &motion, leg), expected);
        }
        let sum: f64 =
            expected.iter().map(|chord_deviation| chord_deviation * chord_deviation).sum();
        assert_near(
            chord_deviation(&machine, &placed, &inverse, &motion),
            sqrt(6.0) / 2.0 * sqrt(sum),
        );
        // 2·4/(12 − 2·1.5 − 4) and 2·3/(9 − 2·1.5 − 3).
        let row_change =
            |rho, margin| row_change(&machine, &placed, &inverse, rho, &motion, |_| margin);
        assert_near(row_change(1.5, None), of_both(1.6, 2.0));
        // Rotates by (2·1.5 + 4)/5 + 0.3 and (2·1.5 + 3)/3 + 0.3 = 2.3, which the margin of a
        // rod must exceed.
        assert_near(row_change(1.5, Some(2.31)), of_both(1.6, 2.0));
        assert_eq!(row_change(1.5, Some(2.29)), f64::INFINITY);
        assert_eq!(row_change(1.5, Some(f64::NAN)), f64::INFINITY);
        // The second leg may vanish.
        assert!(row_change(2.9, None).is_finite());
        assert_eq!(row_change(3.0, None), f64::INFINITY);
        assert_eq!(row_change(f64::NAN, None), f64::INFINITY);
    }

    #[test]
    fn a_ring_bends_its_leg_by_its_share_of_the_distance_and_the_speed_at_the_base_anchor() {
        let (machine, placed, inverse) = by_hand([10.0, 18.0, 1e9, 1e9, 1e9, 1e9]);
        // Base anchors at 24 and 0 from the reference point, the first at 13 from the axis of its ring of
        // radius 3; the other leg has no ring.
        let radii = [3.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let machine = Mechanism { ring: radii, slides: true, per_radius: 0.2, ..machine };
        let mut placed = Placed { rho: [13.0; 6], ..placed };
        placed.arms.set(0, Vector3::new(0.0, 24.0, 0.0));
        placed.span.set(0, Vector3::zeros());
        // (24 + 1)/5 for the rotation and 1 for the translation: 26 is the square of the speed Y.
        let (lipschitz, y) = (
            |rho, motion| lipschitz_constant(&machine, &placed, None, &inverse, rho, motion),
            sqrt(26.0),
        );
        let ratio = 3.0 / (13.0 - y);
        let expected = of_both(ratio * 26.0 / 8.0 + 0.25, 0.5);
        assert_near(lipschitz(1.0, None).unwrap(), expected);
        // The base anchor moves by a further 0.5: 25.5/5 about the reference point.
        let mut moved = motion([0.5, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let y = sqrt(1.0 + 5.1 * 5.1);
        let ratio = 3.0 / (13.0 - y - 0.5);
        let expected = of_both(ratio * y * y / 7.5 + 0.25, 0.5);
        assert_near(lipschitz(1.0, Some(&moved)).unwrap(), expected);
        let change = row_change(&machine, &placed, &inverse, 1.0, &moved, |_| None);
        assert_near(change, of_both((2.0 + ratio * y) * 0.5 / 7.5, 0.0));
        // With the platform at rest, the base anchor's own travel counts: 13 less 2 exceeds the
        // radius, 4 less 2 does not.
        moved.travel[0] = 2.0;
        assert_near(leg_chord_deviation(&machine, &placed, &moved, 0), (4.0 / 8.0 + 0.4) / 8.0);
        placed.rho[0] = 4.0;
        let widened = (3.0 / 2.0 * 4.0 / 8.0 + 0.4) / 8.0;
        assert_near(leg_chord_deviation(&machine, &placed, &moved, 0), widened);
        // No statement is possible about a ball in which the tool axis may reach the base anchor.
        let fault = Fault::of_leg(Cause::AxisAtAnchor, 0, 4.0);
        let lipschitz = lipschitz_constant(&machine, &placed, None, &inverse, 1.0, None);
        assert_eq!(lipschitz, Err(fault));
        let change = row_change(&machine, &placed, &inverse, 1.0, &moved, |_| None);
        assert_eq!(change, f64::INFINITY);
    }

    #[test]
    fn no_direction_in_the_ball_bends_a_leg_on_a_ring_more_than_the_bound_says_and_some_nearly() {
        for coordinates in CHARTS {
            let mut rng = Pcg64::seed_from_u64(41);
            // Legs whose curvature comes mostly from the ring, and legs that behave as struts.
            let (mut largest, mut checked) = ([0.0_f64; 2], [0; 2]);
            for _ in 0..8000 {
                let Some((machine, place)) = machine(&mut rng, coordinates, false) else {
                    continue;
                };
                let (Ok(joints), Some(rings)) = (machine.joints_at(&place), machine.rings()) else {
                    continue;
                };
                let anchors = machine.moved_anchors(&joints).unwrap();
                let rho = random(&mut rng, 0.1, 40.0);
                let placed = machine.placed(&anchors, &place);
                let point = unit(&mut rng, &machine).map(|x| x * random(&mut rng, 0.0, rho - 0.06));
                let direction = unit(&mut rng, &machine);
                let Some(bent) = bending(&machine, &anchors, &place, &point, &direction) else {
                    continue;
                };
                for i in 0..6 {
                    let Some(ring) = rings.widened(&placed, i, rho, 0.0) else { continue };
                    let k = curvature(&machine, &placed, None, i & !1, rho, None);
                    let (Ok(k), true) = (k, ring.ratio > 0.0) else { continue };
                    let share = bent[i] / k.to_array()[i % 2];
                    let slips = ring.ratio * ring.speed * ring.speed > machine.s1[i].powi(2);
                    let kind = usize::from(!slips);
                    largest[kind] = largest[kind].max(share.abs());
                    checked[kind] += 1;
                }
            }
            let name = core::str::from_utf8(coordinates).unwrap();
            std::println!("{name}: {checked:?} legs on rings, {largest:.2?} of their bounds");
            assert!(largest.iter().all(|share| *share < 1.0), "{name}: {largest:?}");
            assert!(checked[0] + checked[1] > 2000, "{name}: {checked:?}");
            // Bounds that are far too wide would be sound and useless.
            assert!(largest[0].max(largest[1]) > 0.3, "{name}: {largest:?}");
        }
    }

    #[test]
    fn dead_points_are_refused_at_the_joint_values_with_their_offsets() {
        let mut rng = Pcg64::seed_from_u64(15);
        let mut cranks = 0;
        for _ in 0..40 {
            let Some((mut machine, place)) = machine(&mut rng, b"XYZABC", false) else { continue };
            let Ok(joints) = machine.joints_at(&place) else { continue };
            let placed = machine.placed(&machine.moved_anchors(&joints).unwrap(), &place);
            assert_eq!(machine.refuse_dead_points(&placed, &joints), Ok(()));
            // A crank's margin depends on its joint value: half a turn away it is on the other
            // side, unless the offset defines that as its original side.
            for i in (0..6).filter(|i| matches!(machine.legs[*i], crate::leg::Leg::Crank(_))) {
                let mut turned = joints;
                turned[i] -= 180.0;
                let fault = machine.refuse_dead_points(&placed, &turned).unwrap_err();
                assert_eq!(fault, Fault::of_leg(Cause::DeadPoint, i, fault.value));
                machine.offset[i] = 180.0;
                assert_eq!(machine.refuse_dead_points(&placed, &turned), Ok(()));
                machine.offset[i] = 90.0;
                turned[i] = joints[i] - 90.0;
                assert_eq!(machine.refuse_dead_points(&placed, &turned), Ok(()));
                machine.offset[i] = 0.0;
                cranks += 1;
            }
        }
        assert!(cranks > 20, "{cranks}");
    }

    #[test]
    fn no_direction_in_the_ball_bends_a_leg_more_than_the_bounds_of_length_and_nut_say() {
        for coordinates in CHARTS {
            let mut rng = Pcg64::seed_from_u64(11);
            let mut largest = [0.0_f64; 2];
            let mut checked = 0;
            for n in 0..8000 {
                let Some((machine, place)) = machine(&mut rng, coordinates, n % 2 == 0) else {
                    continue;
                };
                let Ok(joints) = machine.joints_at(&place) else { continue };
                let anchors = machine.moved_anchors(&joints).unwrap();
                let rho = random(&mut rng, 0.1, 40.0);
                let placed = machine.placed(&anchors, &place);
                let torsion = machine.torsion(&placed.directions(), &place.rotation);
                let Ok(torsion) = torsion else { continue };
                // The differences use points slightly beyond the one where they are taken.
                let away = random(&mut rng, 0.0, rho - 0.06);
                let ray = unit(&mut rng, &machine);
                let point = ray.map(|x| x * away);
                let direction = if rng.random() { ray } else { unit(&mut rng, &machine) };
                let bare = Mechanism { nut: None, ..machine.clone() };
                let bent = |m| bending(m, &anchors, &place, &point, &direction);
                let (Some(both), Some(length)) = (bent(&machine), bent(&bare)) else { continue };
                for i in 0..6 {
                    let bound = |m, torsion| {
                        let pair = curvature(m, &placed, torsion, i & !1, rho, None)?;
                        Ok::<_, Fault>(pair.to_array()[i % 2])
                    };
                    let Ok(k) = bound(&machine, torsion.as_ref()) else { continue };
                    let of_length = bound(&bare, None).unwrap();
                    largest[0] = largest[0].max(length[i].abs() / of_length);
                    // 1e-9: rounding of the differences, for nut terms of 1e-5 and more.
                    if k - of_length > 1e-5 {
                        let nut = (both[i] - length[i]).abs() - 1e-9;
                        largest[1] = largest[1].max(nut / (k - of_length));
                    }
                    checked += 1;
                }
            }
            let name = core::str::from_utf8(coordinates).unwrap();
            std::println!("{name}: {checked} legs, length and nut {largest:.2?} of their bounds");
            assert!(checked > 5_000, "{name}: {checked}");
            assert!(largest[0] < 1.0 && largest[1] < 1.0, "{name}: {largest:?}");
            // A bound that is far too wide would be sound and useless.
            assert!(largest[0] > 0.2, "{name}: {largest:?}");
        }
    }
}
