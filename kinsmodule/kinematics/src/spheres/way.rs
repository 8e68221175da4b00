// SPDX-License-Identifier: GPL-2.0-or-later
//! Whether the straight line of the joints leads from a seed anywhere to where three spheres meet.
//!
//! It does if the two points of the spheres stay apart all the way and no leg comes to its dead point.
//! The way is looked at in pieces, x from 0 to 1 on each. What is quadratic there is a mean of
//! f(0), 2 f(½) − (f(0) + f(1))/2 and f(1), the control points of a Bézier curve: nowhere is it
//! outside of what they span. Of struts and carriages all that is used here is quadratic; where arms
//! turn, it is but for ρ = max |f‴|/(72 √3).
//!
//! **The points stay apart.** For weights λ with Σ λᵢ = 1, Σ λᵢ sᵢ is a point of the plane of the centres,
//! and the square of its distance from t is Σ λᵢ dᵢ² − Σ λᵢ λⱼ |sᵢ − sⱼ|² over the pairs i < j. The least
//! of these is that of the height,
//!
//! ```text
//! h² = min over λ of Σ λᵢ dᵢ² − Σ λᵢ λⱼ |sᵢ − sⱼ|²
//! ```
//!
//! As the least of linear functions it is a concave one of the six squares, so that it is nowhere less
//! than the least of its values at the control points. With Σ |λᵢ λⱼ| ≤ Σ λᵢ² = 1 − 2 Σ λᵢ λⱼ, squares that
//! are off by ρ leave at least what squares of distances less by 2 ρ make of it, less ρ.
//!
//! **No leg comes to its dead point.** With f the foot of the height, a and b the ways from sᵢ to the
//! two other centres in their cyclic order, N = a × b and u the direction that drives the leg,
//!
//! ```text
//! |N|² u · (t − sᵢ) = |N|² u · (f − sᵢ) ± h |N| N · u
//! |N|² u · (f − sᵢ) = N · (u × (α b − β a)),   α = a · (f − sᵢ),   β = b · (f − sᵢ)
//! ```
//!
//! α = (|a|² + dᵢ² − dⱼ²)/2 and β are quadratic too, and the product of three such functions is within
//! its seven coefficients in Bernstein's basis of degree six. Of arms u turns as well, away from the middle
//! by half of the piece's angle at most, and takes as much from a margin. With V = α b − β a and the curves'
//! values N' and V', what the coefficients do not show is
//!
//! ```text
//! N · (u × V) − N' · (u × V') = (N − N') · (u × V) + N' · (u × (V − V')),   |α| ≤ |a| dᵢ
//! ```

use super::{Spheres, driven};
use crate::leg::{Drive, LEAST_DRIVE, Leg, SecondDerivatives};
use core::array::from_fn;
use core::ops::{Add, Mul, Sub};
use libm::sqrt;
use nalgebra::Vector3;

/// How often the way is halved.
const HALVINGS: usize = 2;

/// Shortest piece of the way that is tried.
const SHORTEST: f64 = 1.0 / (1 << HALVINGS) as f64;

/// Most pieces that are tried: all of the way in the shortest, and one of each that is longer.
const MOST_TRIED: usize = (1 << HALVINGS) + HALVINGS;

/// 1/(72 √3), rounded up: largest |x (x − ½)(x − 1)|/6 on a piece.
const CUBIC: f64 = 0.008_02;

/// Least square of the height, as a share of that of the longest leg. What is computed of it is off by
/// some roundings times 1/[`NARROW`]², and by as many times more as legs are longer than their centres
/// are apart.
const LOW: f64 = 1e-6;

/// Least sine of the angle between the ways from one centre to the two others.
const NARROW: f64 = 0.05;

/// Coefficients of the binomials of degree 2 and 6.
const TWO: [f64; 3] = [1.0, 2.0, 1.0];
const SIX: [f64; 7] = [1.0, 6.0, 15.0, 20.0, 15.0, 6.0, 1.0];

/// What the joints make of each leg at a moment, with the centre of its sphere as displacement.
type Moment = [Drive; 3];

/// Values at begin, middle and end of a piece, or the control points of what goes through them.
type Three<T> = [T; 3];

/// A piece of the way.
struct Piece<'a> {
    legs: &'a [Leg; 3],
    moments: Three<Moment>,
    second: [SecondDerivatives; 3],
    /// Bounds of the centres' speeds: half of the largest second derivative above the mean.
    speed: [f64; 3],
    off: Off,
}

/// ρ where arms turn, 0 where none does.
struct Off {
    /// Of the squares of distances between centres.
    square: f64,
    /// Of the normal.
    normal: f64,
}

/// The normal N on a piece.
struct Normal {
    /// 1 where the point that is followed is on its side of the plane, else −1.
    side: f64,
    control: Three<Vector3<f64>>,
    /// Bounds of its length.
    least: f64,
    most: f64,
}

/// A leg and the ways to the two others.
struct Seen {
    /// The direction that drives the leg, at the middle of the piece.
    u: Vector3<f64>,
    ways: [Way; 2],
}

/// The way from the centre of a leg to that of another one.
struct Way {
    control: Three<Vector3<f64>>,
    /// Its scalar product with f − sᵢ.
    along: Three<f64>,
}

impl Spheres {
    /// Whether the straight line from one set of joint values to another leads to the point on the side with
    /// this sign, if it begins there.
    pub(super) fn leads(&self, side: f64, from: &[f64; 3], to: &[f64; 3]) -> bool {
        let at = |share: f64| self.moment(&from_fn(|i| from[i] + (to[i] - from[i]) * share));
        let (Some(mut first), Some(mut last)) = (at(0.0), at(1.0)) else { return false };
        let (mut done, mut step) = (0.0, 1.0);
        for _ in 0..MOST_TRIED {
            let Some(middle) = at(done + 0.5 * step) else { return false };
            let joints = from_fn(|i| (to[i] - from[i]) * step);
            if Piece::new(&self.legs, [first, middle, last], &joints).is_clear(side) {
                done += step;
                if done >= 1.0 {
                    return true;
                }
                first = last;
                let Some(next) = at(done + step) else { return false };
                last = next;
            } else {
                step *= 0.5;
                if step < SHORTEST {
                    return false;
                }
                last = middle;
            }
        }
        false
    }

    #[inline(always)]
    fn moment(&self, joints: &[f64; 3]) -> Option<Moment> {
        let at = |leg: usize, lane: usize| {
            let mut drive = driven(&self.legs[leg], joints[leg] + self.offset[lane])?;
            drive.displacement += self.origin.get(lane);
            Some(drive)
        };
        Some([at(0, 2)?, at(1, 0)?, at(2, 1)?])
    }
}

impl<'a> Piece<'a> {
    /// The piece of these moments, on which the joints go so far.
    #[inline(always)]
    fn new(legs: &'a [Leg; 3], moments: Three<Moment>, joints: &[f64; 3]) -> Self {
        let second: [_; 3] = from_fn(|i| legs[i].second_derivatives(joints[i]));
        let [first, _, last] = &moments;
        let speed = from_fn(|i| {
            (last[i].displacement - first[i].displacement).norm() + second[i].anchor * 0.5
        });
        let mut piece =
            Self { legs, moments, second, speed, off: Off { square: 0.0, normal: 0.0 } };
        if piece.second.iter().any(|second| second.anchor > 0.0) {
            piece.off = piece.off();
        }
        piece
    }

    /// Whether the point on that side stays apart from the other one, and no leg comes to its dead point.
    fn is_clear(&self, side: f64) -> bool {
        let [_, middle, _] = &self.moments;
        let longest = middle.iter().fold(0.0, |longest: f64, drive| longest.max(drive.length));
        let height = self.least_height();
        if !(height > LOW * longest * longest) {
            return false;
        }
        let normal = self.normal(side);
        normal.least > 0.0
            && (0..3).all(|i| self.legs[i] == Leg::Strut || self.drives(i, sqrt(height), &normal))
    }

    /// Least square of the height, below 0 where there is none.
    fn least_height(&self) -> f64 {
        let squares: Three<[f64; 6]> = self.moments.each_ref().map(squares);
        let [first, middle, last] = &squares;
        let between = from_fn(|i| control([first[i], middle[i], last[i]])[1]);
        least([first, &between, last].map(|squares| square_of_height(squares, self.off.square)))
    }

    #[inline(always)]
    fn off(&self) -> Off {
        let square = |i, j| {
            let [apart, speed, second, third] = self.bounds(i, j);
            2.0 * apart * third + 6.0 * speed * second
        };
        let squares = square(0, 1).max(square(0, 2)).max(square(1, 2));
        let (a, b) = (self.bounds(0, 1), self.bounds(0, 2));
        let normal = a[3] * b[0] + 3.0 * (a[2] * b[1] + a[1] * b[2]) + a[0] * b[3];
        Off { square: CUBIC * squares, normal: CUBIC * normal }
    }

    fn normal(&self, side: f64) -> Normal {
        let control = control(self.moments.each_ref().map(normal));
        let off = self.off.normal;
        let [_, middle, _] = &control;
        let upward = middle / middle.norm();
        let most = control.iter().fold(0.0, |most: f64, n| most.max(n.norm()));
        let least = least(control.map(|n| n.dot(&upward)));
        Normal { side, control, least: least - off, most: most + off }
    }

    /// Whether a leg keeps away from its dead point, with that least height.
    #[inline(always)]
    fn drives(&self, leg: usize, height: f64, normal: &Normal) -> bool {
        let seen = self.seen_from(leg);
        let [_, middle, _] = &self.moments;
        let length = middle[leg].length;
        let rise = least(normal.control.map(|n| n.dot(&seen.u) * normal.side)) - self.off.normal;
        // The height is at most the leg.
        let up = if rise > 0.0 { height * normal.least } else { length * normal.most };
        let level = least(seen.level(&normal.control)) - self.off_level(leg, length, normal.most);
        let needed = LEAST_DRIVE + self.second[leg].turn * 0.5;
        level + up * rise > needed * length * normal.most * normal.most
    }

    #[inline(always)]
    fn seen_from(&self, leg: usize) -> Seen {
        let [_, middle, _] = &self.moments;
        let u = middle[leg].towards * middle[leg].length;
        Seen { u, ways: [self.way(leg, (leg + 1) % 3), self.way(leg, (leg + 2) % 3)] }
    }

    #[inline(always)]
    fn way(&self, leg: usize, other: usize) -> Way {
        let ways = self.moments.each_ref().map(|m| m[other].displacement - m[leg].displacement);
        let along = from_fn(|k| {
            let [own, others] = [leg, other].map(|i| self.moments[k][i].length);
            (ways[k].norm_squared() + own * own - others * others) * 0.5
        });
        Way { control: control(ways), along: control(along) }
    }

    /// How far [`Seen::level`] may be off, with the most that the normal and its curve are long.
    #[inline(always)]
    fn off_level(&self, leg: usize, length: f64, normal: f64) -> f64 {
        if !(self.off.normal > 0.0) {
            return 0.0;
        }
        let [[a, off_a], [b, off_b]] = [1, 2].map(|next| {
            let [apart, _, _, third] = self.bounds(leg, (leg + next) % 3);
            let off = CUBIC * third;
            [apart + off, off]
        });
        let off_along = self.off.square * 0.5;
        let (alpha, beta) = (a * length + off_along, b * length + off_along);
        let off = off_along * (a + b) + alpha * off_b + beta * off_a;
        self.off.normal * (alpha * b + beta * a) + normal * off
    }

    /// Bounds of the distance between the centres of two legs, and of the first three derivatives of the
    /// way from one to the other.
    #[inline(always)]
    fn bounds(&self, i: usize, j: usize) -> [f64; 4] {
        let [_, middle, _] = &self.moments;
        let speed = self.speed[i] + self.speed[j];
        let apart = (middle[i].displacement - middle[j].displacement).norm() + speed * 0.5;
        let [one, other] = [&self.second[i], &self.second[j]];
        let third = one.anchor * one.turn + other.anchor * other.turn;
        [apart, speed, one.anchor + other.anchor, third]
    }
}

impl Seen {
    /// The coefficients of |N|² u · (f − sᵢ), with the normal's control points.
    #[inline(always)]
    fn level(&self, normals: &Three<Vector3<f64>>) -> [f64; 7] {
        let [a, b] = &self.ways;
        let mut sums = [0.0; 7];
        for p in 0..3 {
            let normal = &normals[p];
            for q in 0..3 {
                let of_a = normal.dot(&self.u.cross(&a.control[q]));
                let of_b = normal.dot(&self.u.cross(&b.control[q]));
                for r in 0..3 {
                    let product = a.along[r] * of_b - b.along[r] * of_a;
                    if let Some(sum) = sums.get_mut(p + q + r) {
                        *sum += TWO[p] * TWO[q] * TWO[r] * product;
                    }
                }
            }
        }
        from_fn(|i| sums[i] / SIX[i])
    }
}

/// The control points of the curve of second degree through the values at begin, middle and end.
fn control<T>([first, middle, last]: Three<T>) -> Three<T>
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>,
{
    [first, middle * 2.0 - (first + last) * 0.5, last]
}

/// Squares of the distances between centres 0 and 1, 0 and 2, 1 and 2, and of the lengths.
fn squares([zero, one, two]: &Moment) -> [f64; 6] {
    let [s0, s1, s2] = [zero, one, two].map(|drive| drive.displacement);
    let [a, b, apart] = [s1 - s0, s2 - s0, s2 - s1].map(|way| way.norm_squared());
    let [d0, d1, d2] = [zero, one, two].map(|drive| drive.length * drive.length);
    [a, b, apart, d0, d1, d2]
}

/// N.
fn normal(moment: &Moment) -> Vector3<f64> {
    let [zero, one, two] = moment.each_ref().map(|drive| drive.displacement);
    (one - zero).cross(&(two - zero))
}

/// Least square of the height that belongs to squares of which those between centres are off by `off` at
/// most; minus infinity where these are no triangle.
fn square_of_height(squares: &[f64; 6], off: f64) -> f64 {
    let [a, b, apart, d0, d1, d2] = *squares;
    let [a, b, apart] = [a, b, apart].map(|square| square - 2.0 * off);
    let other = (a + b - apart) * 0.5;
    let area = a * b - other * other;
    if !(a > 0.0 && area > NARROW * NARROW * a * b) {
        return f64::NEG_INFINITY;
    }
    let (alpha, beta) = ((a + d0 - d1) * 0.5, (b + d0 - d2) * 0.5);
    let foot = alpha * (alpha * b - 2.0 * beta * other) + beta * beta * a;
    d0 - foot / area - off
}

/// The least value; minus infinity if any is NaN.
fn least<const N: usize>(values: [f64; N]) -> f64 {
    values.iter().fold(f64::INFINITY, |least, value| {
        if *value >= least {
            least
        } else if *value < least {
            *value
        } else {
            f64::NEG_INFINITY
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leg::{CrankGeometry, LegKind, SliderGeometry};
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64;

    fn vector(rng: &mut Pcg64, most: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| (rng.random::<f64>() - 0.5) * 2.0 * most)
    }

    fn crank(rng: &mut Pcg64) -> Leg {
        let [axis, arm] = [vector(rng, 1.0), vector(rng, 1.0)].map(Into::into);
        let crank = CrankGeometry { axis, arm, rod: 2.0, side: 1 };
        LegKind::Crank(crank).checked().expect("a crank")
    }

    fn slider(rng: &mut Pcg64) -> Leg {
        let guide = vector(rng, 1.0).into();
        let slider = SliderGeometry { guide, rod: 2.0, side: -1 };
        LegKind::Slider(slider).checked().expect("a slider")
    }

    const STRUT: Leg = Leg::Strut;

    /// Whether the spheres meet on that side of the plane, and no leg is at its dead point.
    fn is_sound(moment: &Moment, side: f64) -> bool {
        let [zero, one, two] = moment;
        let (a, b) = (one.displacement - zero.displacement, two.displacement - zero.displacement);
        let normal = a.cross(&b);
        let square = |drive: &Drive| drive.length * drive.length;
        let alpha = (a.norm_squared() + square(zero) - square(one)) * 0.5;
        let beta = (b.norm_squared() + square(zero) - square(two)) * 0.5;
        let foot = (alpha * b - beta * a).cross(&normal) / normal.norm_squared();
        let height = square(zero) - foot.norm_squared();
        let point = zero.displacement + foot + normal.normalize() * (side * sqrt(height));
        let drives = |drive: &Drive| {
            let margin = (point - drive.displacement).dot(&drive.towards);
            margin >= LEAST_DRIVE || drive.towards == Vector3::zeros()
        };
        height > 0.0 && moment.iter().all(drives)
    }

    /// What is `x` of the way through the control points.
    fn curve<T>([first, middle, last]: Three<T>, x: f64) -> T
    where
        T: Add<Output = T> + Mul<f64, Output = T>,
    {
        first * (1.0 - x).powi(2) + middle * (2.0 * x * (1.0 - x)) + last * x.powi(2)
    }

    /// Legs that move, and what the joints make of them at a share of the way.
    struct Moving {
        legs: [Leg; 3],
        hips: [Vector3<f64>; 3],
        from: [f64; 3],
        by: [f64; 3],
    }

    impl Moving {
        fn arms(rng: &mut Pcg64) -> Self {
            let legs = from_fn(|_| crank(rng));
            let hips = from_fn(|_| vector(rng, 2.0));
            let [from, by] =
                [90.0, 60.0].map(|most| from_fn(|_| (rng.random::<f64>() - 0.5) * 2.0 * most));
            Self { legs, hips, from, by }
        }

        /// Legs of any kind, on the whole as long as they are apart.
        fn any(rng: &mut Pcg64) -> Self {
            let mut moving = Self::arms(rng);
            for i in 0..3 {
                match rng.random_range(0..3) {
                    0 => {}
                    1 => {
                        moving.legs[i] = slider(rng);
                        moving.from[i] /= 90.0;
                        moving.by[i] /= 60.0;
                    }
                    _ => {
                        moving.legs[i] = STRUT;
                        moving.from[i] = 2.0 + moving.from[i] / 180.0;
                        moving.by[i] /= 60.0;
                    }
                }
            }
            moving
        }

        fn at(&self, x: f64) -> Moment {
            from_fn(|i| {
                let q = self.from[i] + self.by[i] * x;
                let mut drive = driven(&self.legs[i], q).expect("a drive");
                drive.displacement += self.hips[i];
                drive
            })
        }

        fn piece(&self) -> Piece<'_> {
            Piece::new(&self.legs, [0.0, 0.5, 1.0].map(|x| self.at(x)), &self.by)
        }
    }

    /// Places between those through which the curves go.
    const BETWEEN: [f64; 4] = [0.2, 0.25, 0.75, 0.8];

    #[test]
    fn squares_and_normals_of_turning_arms_are_off_their_curves_by_at_most_what_is_said() {
        let mut rng = Pcg64::seed_from_u64(31);
        let mut nearest = [0.0_f64; 2];
        for _ in 0..2000 {
            let arms = Moving::arms(&mut rng);
            let piece = arms.piece();
            let of_squares = piece.moments.each_ref().map(squares);
            let of_normal = control(piece.moments.each_ref().map(normal));
            for x in BETWEEN {
                let moment = arms.at(x);
                let found = squares(&moment);
                for i in 0..3 {
                    let expected = curve(control(of_squares.map(|s| s[i])), x);
                    let share = (found[i] - expected).abs() / piece.off.square;
                    nearest[0] = nearest[0].max(share);
                }
                let off = (normal(&moment) - curve(of_normal, x)).norm();
                nearest[1] = nearest[1].max(off / piece.off.normal);
            }
        }
        // Above 1 the bound is none; far below it would be of no use.
        assert!(nearest.iter().all(|share| *share > 0.2 && *share <= 1.0), "{nearest:?}");
    }

    #[test]
    fn what_drives_a_leg_is_off_its_curve_by_at_most_what_is_said() {
        let mut rng = Pcg64::seed_from_u64(37);
        let mut nearest = 0.0_f64;
        for _ in 0..2000 {
            let arms = Moving::arms(&mut rng);
            let piece = arms.piece();
            let (most, curves) = (piece.normal(1.0).most, piece.moments.each_ref().map(normal));
            for (leg, x) in [0, 1, 2].into_iter().zip(BETWEEN) {
                let there = arms.at(x);
                let seen = piece.seen_from(leg);
                let [one, other] = [1, 2].map(|next| (leg + next) % 3);
                let [a, b] = [one, other].map(|i| there[i].displacement - there[leg].displacement);
                let length = there[leg].length;
                if a.norm().max(b.norm()) > 2.0 * length {
                    // Such spheres do not meet.
                    continue;
                }
                let along = |way: &Vector3<f64>| way.norm_squared() * 0.5;
                let exact = normal(&there).dot(&seen.u.cross(&(along(&a) * b - along(&b) * a)));
                let [of_a, of_b] = &seen.ways;
                let by_curve = curve(of_a.along, x) * curve(of_b.control, x)
                    - curve(of_b.along, x) * curve(of_a.control, x);
                let expected = curve(control(curves), x).dot(&seen.u.cross(&by_curve));
                let coefficients = seen.level(&control(curves));
                let terms = from_fn::<_, 7, _>(|k| {
                    let binomial = SIX[k] * x.powi(k as i32) * (1.0 - x).powi(6 - k as i32);
                    coefficients[k] * binomial
                });
                // Roundings of some hundred products of lengths up to 10.
                assert!((terms.iter().sum::<f64>() - expected).abs() < 1e-9, "{expected}");
                let share = (exact - expected).abs() / piece.off_level(leg, length, most);
                nearest = nearest.max(share);
            }
        }
        // As above; four errors seldom add up.
        assert!(nearest > 0.1 && nearest <= 1.0, "{nearest}");
    }

    #[test]
    fn a_piece_that_is_clear_is_sound_everywhere_and_most_that_are_sound_are_clear() {
        let mut rng = Pcg64::seed_from_u64(41);
        let [mut clear, mut sound] = [0; 2];
        for _ in 0..20_000 {
            let moving = Moving::any(&mut rng);
            let piece = moving.piece();
            for side in [1.0, -1.0] {
                let is_sound = (0..=40).all(|k| is_sound(&moving.at(f64::from(k) / 40.0), side));
                let is_clear = piece.is_clear(side);
                assert!(is_sound || !is_clear, "{:?} {:?}", moving.from, moving.by);
                sound += usize::from(is_sound);
                clear += usize::from(is_clear);
            }
        }
        assert!(clear * 2 > sound && sound > 1000, "{clear} of {sound}");
    }
}
