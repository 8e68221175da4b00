// SPDX-License-Identifier: GPL-2.0-or-later
//! Closed form for three legs that move only X, Y and Z: the pose is an intersection of three spheres.
//!
//! The platform keeps its orientation, so that leg i of any kind constrains the control point t to a
//! sphere: |t − sᵢ| = dᵢ with sᵢ = cᵢ − bᵢ, c its moving base anchor and b its platform anchor. The
//! tool moves no leg of such a machine. With a = s₂ − s₁, b = s₃ − s₁ and N = a × b
//!
//! ```text
//! t = s₁ + y ± N √(h²/|N|²),   h² = d₁² − |y|²,
//! y = λ a + μ b,               a · y = (|a|² + d₁² − d₂²)/2,   b · y = (|b|² + d₁² − d₃²)/2
//! ```
//!
//! The two points are mirror images in the plane of the centers. On that plane they coincide, and J is
//! singular: with uᵢ the unit vectors along the legs, det(u₁, u₂, u₃) = ± h |N|/(d₁ d₂ d₃) = D.
//!
//! **Which of the two, and why it is connected with the seed.** The one on the seed's side of the
//! plane, if the path to it is so short that the joints cannot have led elsewhere. Joints are measured
//! here as travels pᵢ of the legs' lower ends, which are linear in them. At a margin m (module `leg`; 1 for
//! a strut) |∂p/∂t| ≤ 1/m and |∂²p/∂t²| ≤ k/m³, and m² decreases by at most 2 k per unit of length, with
//! k = 1/d for struts and sliders, 1/d + 1/arm for cranks. (For a strut m is constant and d decreases to
//! d − ρ: 1/(d − ρ) is covered by the bound for a decreasing margin, because (1 − 2 ρ/d)^(3/2) ≤ 1 − ρ/d.)
//! With M the inverse of ∂p/∂t at t, whose columns
//!
//! ```text
//! Λ ρ,   Λ = Σ mᵢ k/mᵢ³ (smallest m within ρ) / |D|
//! ```
//!
//! Let w be the distance of the seed, ρ = 2 w and w Σ k ≤ m² |D|/12, m the smallest margin at t. Within
//! ρ, m² stays above 2/3 of its value, so that Λ w ≤ (3/2)^(3/2)/12 < 1/6 and Λ ρ < 1/3. There p is
//! one-to-one, a step of M p is between 2/3 and 4/3 as long as that of t, and the straight line of the
//! joints from the seed's to those of t, at most 4 w/3 long as M p, corresponds to points within 2 w.
//! Nothing in that ball is singular or at a dead point.
//!
//! All other cases are left to the general method, which also determines the cause of a refusal.

use crate::geometry::{FARTHEST, HUGE};
use crate::lanes::{
    Lanes3, between, both, cross, difference, dot, pair, scaled, sum, swapped, wide,
};
use crate::leg::crank::Crank;
use crate::leg::{Drive, LEAST_DRIVE, Leg};
use crate::mechanism::Mechanism;
use crate::trig::{RADIANS, arcs_all_around};
use nalgebra::Vector3;
use wide::f64x2;

/// Smallest |D| for which the closed form is used: its rounding grows with 1/D².
const FLAT: f64 = 0.05;

/// Ratio of m² |D| to the bound of the path below which a path counts as short.
const SHORT: f64 = 12.0;

/// Arms farther than this from 0, in degrees, are near the angle at which the inverse kinematics jump by a
/// turn: farther than any short path can rotate an arm, which is less than 1/10 rad.
const MOST_TURNED: f64 = 170.0;

/// Returns the leg of a lane: two of them side by side, and twice the first one.
const fn leg_of(lane: usize) -> usize {
    if lane < 2 { lane + 1 } else { 0 }
}

/// Returns the vectors of the legs, in their order.
#[inline(always)]
fn of_legs([pair, alone]: &[[f64x2; 3]; 2]) -> [Vector3<f64>; 3] {
    let [[x1, x2], [y1, y2], [z1, z2]] = pair.map(f64x2::to_array);
    let [x0, y0, z0] = alone.map(|part| part.to_array()[0]);
    [Vector3::new(x0, y0, z0), Vector3::new(x1, y1, z1), Vector3::new(x2, y2, z2)]
}

/// Computes the angles of three arms in degrees, from their components along 90 and 0 degrees: the arcs in
/// pairs, and only after every arm is known to reach.
#[inline(always)]
fn angles([[s0, c0], [s1, c1], [s2, c2]]: [[f64; 2]; 3]) -> [f64; 3] {
    let pair = arcs_all_around(f64x2::new([s1, s2]), f64x2::new([c1, c2]));
    let alone = arcs_all_around(both(s0), both(c0));
    let ([one, two], [zero, _]) = (pair.to_array(), alone.to_array());
    [zero, one, two].map(|arc| arc / RADIANS)
}

/// Kinds of the legs.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kinds {
    Struts,
    Sliders,
    /// Any kinds, computed leg by leg.
    Mixed,
}

/// Three legs that move X, Y and Z, as spheres. Arrays have the lanes of [`leg_of`].
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Spheres {
    kinds: Kinds,
    legs: [Leg; 3],
    offset: [f64; 4],
    /// Base anchors minus platform anchors.
    origin: Lanes3<4>,
    /// Guides of sliders.
    guide: Lanes3<4>,
    towards: Lanes3<4>,
    side: [f64; 4],
    rod_square: [f64; 4],
    least_square: [f64; 4],
    /// The margin of a strut, 1; 0 for other legs.
    rest: [f64; 4],
    /// Per leg k times its length.
    bend: [f64; 4],
    /// Present if all lengths are those of rods.
    sizes: Option<Sizes>,
    /// Shortest length at which a leg has a direction.
    least_length: f64,
    /// Longest part of a tool vector.
    farthest: f64,
}

/// Constants that follow from the lengths of the legs.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sizes {
    /// Squares of the lengths.
    square: [f64; 4],
    /// Smallest square of D d₁ d₂ d₃ for which the closed form is used.
    flat: f64,
    /// Square of 12 Σ k d₁ d₂ d₃.
    short: f64,
    /// Half of 1 over the smallest length.
    half: f64,
}

/// Moving base anchors and lengths at the joint values.
struct Driven {
    centre: [[f64x2; 3]; 2],
    towards: [[f64x2; 3]; 2],
    length: [f64; 4],
}

/// Computes a leg's state at its joint value, unless its arm is rotated too far.
#[inline(always)]
fn driven(leg: &Leg, q: f64) -> Option<Drive> {
    if matches!(leg, Leg::Crank(_)) && !(q.abs() <= MOST_TURNED) {
        return None;
    }
    leg.drive(q).ok()
}

/// Which of the two points.
#[derive(Clone, Copy)]
pub(crate) enum Which<'a> {
    /// The one on this point's side of the plane, if it is near.
    Near(&'a Vector3<f64>),
    /// The one on the side with this sign, at any distance.
    Side(f64),
}

/// An intersection of the spheres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Meeting {
    /// The control point.
    pub point: Vector3<f64>,
    /// Bound of a leg's residual, see [`crate::Solution::residual`].
    pub residual: f64,
}

impl Sizes {
    /// Computes the constants; `None` if a leg has no direction.
    #[inline(always)]
    fn of(length: &[f64; 4], bend: &[f64; 4], least: f64) -> Option<Self> {
        if !between(length, least, HUGE).all() {
            return None;
        }
        let [one, two, zero, _] = *length;
        let bends = bend[0] * two * zero + bend[1] * one * zero + bend[2] * one * two;
        let square = length.map(|d| d * d);
        let shortest = pair(length, 0).fast_min(pair(length, 2));
        let [shortest, _] = shortest.fast_min(swapped(shortest)).to_array();
        Some(Self {
            square,
            flat: FLAT * FLAT * (square[0] * square[1] * square[2]),
            short: (SHORT * bends) * (SHORT * bends),
            half: 0.5 / shortest,
        })
    }
}

impl Spheres {
    /// Creates the spheres of three legs that move X, Y and Z, and end at points. (The correction of a screw
    /// changes with the direction of its strut.)
    #[inline(always)]
    pub fn of(machine: &Mechanism<4>) -> Option<Self> {
        let moves = machine.active == [true, true, true, false, false, false];
        let is_plain = machine.nut.is_none() && !machine.slides && machine.couplings().is_none();
        if !(machine.count() == 3 && moves && is_plain) {
            return None;
        }
        let [zero, one, two, _] = machine.legs;
        let legs = [zero, one, two];
        let kinds = match legs {
            [Leg::Strut, Leg::Strut, Leg::Strut] => Kinds::Struts,
            [Leg::Slider(_), Leg::Slider(_), Leg::Slider(_)] => Kinds::Sliders,
            _ => Kinds::Mixed,
        };
        let mut spheres = Self {
            kinds,
            legs,
            offset: core::array::from_fn(|lane| machine.offset[leg_of(lane)]),
            origin: Lanes3::from_fn(|lane| {
                let leg = leg_of(lane);
                machine.base.get(leg) - (machine.arms.get(leg) + machine.reference)
            }),
            guide: Lanes3::ZERO,
            towards: Lanes3::ZERO,
            side: [0.0; 4],
            rod_square: [0.0; 4],
            least_square: [0.0; 4],
            rest: core::array::from_fn(|lane| legs[leg_of(lane)].rest()),
            bend: core::array::from_fn(|lane| legs[leg_of(lane)].bend()),
            sizes: None,
            least_length: machine.least_length(),
            farthest: FARTHEST * machine.size,
        };
        spheres.take_rods();
        Some(spheres)
    }

    fn take_rods(&mut self) {
        let mut rod = [0.0; 4];
        for lane in 0..4 {
            match &self.legs[leg_of(lane)] {
                Leg::Strut => {}
                Leg::Crank(crank) => rod[lane] = crank.rod(),
                Leg::Slider(slider) => {
                    rod[lane] = slider.rod;
                    self.guide.set(lane, slider.guide);
                    self.towards.set(lane, slider.towards);
                    self.side[lane] = slider.side;
                    self.least_square[lane] = slider.least_square;
                }
            }
            self.rod_square[lane] = rod[lane] * rod[lane];
        }
        self.sizes = Sizes::of(&rod, &self.bend, self.least_length);
    }

    /// Computes the joint values of a control point, and of angles in any unit; `None` if the general method
    /// must decide. That method subtracts the tool and adds it again, so results differ by these roundings.
    #[inline(always)]
    pub fn joints(
        &self,
        point: &Vector3<f64>,
        angles: &Vector3<f64>,
        tool: &Vector3<f64>,
    ) -> Option<[f64; 3]> {
        let turned = angles.x.abs() + angles.y.abs() + angles.z.abs();
        if !(turned == 0.0 && self.is_within_reach(tool)) {
            return None;
        }
        self.joints_of(&self.ways(point))
    }

    /// Computes the vectors from base anchors to platform anchors.
    #[inline(always)]
    fn ways(&self, point: &Vector3<f64>) -> [[f64x2; 3]; 2] {
        // Both lanes from the start: pairs, see `lanes`.
        let place = wide(point);
        let way = |lane| difference(&place, &self.origin.pair(lane));
        [way(0), way(2)]
    }

    /// Computes the joint values of the vectors from base anchors to platform anchors.
    #[inline(always)]
    fn joints_of(&self, ways: &[[f64x2; 3]; 2]) -> Option<[f64; 3]> {
        if self.kinds == Kinds::Mixed {
            return self.mixed_joints(&of_legs(ways));
        }
        let (pair, known) = self.joints_of_two(0, &ways[0]);
        let (alone, is_known) = self.joints_of_two(2, &ways[1]);
        let ([one, two], [zero, _]) = (pair.to_array(), alone.to_array());
        (known & is_known).all().then_some([zero, one, two])
    }

    /// Computes the joint values of the legs of two lanes, struts or sliders, and a mask of those that exist.
    #[inline(always)]
    fn joints_of_two(&self, lane: usize, way: &[f64x2; 3]) -> (f64x2, f64x2) {
        let (native, known) = match self.kinds {
            Kinds::Struts | Kinds::Mixed => {
                let length = dot(way, way).sqrt();
                let known = length.simd_gt(both(self.least_length)) & length.simd_lt(both(HUGE));
                (length, known)
            }
            Kinds::Sliders => {
                let guide = self.guide.pair(lane);
                let along = dot(&guide, way);
                let apart = difference(way, &scaled(&guide, along));
                let square = pair(&self.rod_square, lane) - dot(&apart, &apart);
                let known = square.simd_ge(pair(&self.least_square, lane));
                (along + pair(&self.side, lane) * square.sqrt(), known)
            }
        };
        (native - pair(&self.offset, lane), known)
    }

    /// Computes the joint values leg by leg.
    #[inline(always)]
    fn mixed_joints(&self, [way0, way1, way2]: &[Vector3<f64>; 3]) -> Option<[f64; 3]> {
        let [zero, one, two] = match &self.legs {
            [Leg::Crank(zero), Leg::Crank(one), Leg::Crank(two)] => {
                let arm = |crank: &Crank, way| crank.arm_towards(way).ok();
                angles([arm(zero, way0)?, arm(one, way1)?, arm(two, way2)?])
            }
            [zero, one, two] => {
                [self.joint(zero, way0)?, self.joint(one, way1)?, self.joint(two, way2)?]
            }
        };
        Some([zero - self.offset[2], one - self.offset[0], two - self.offset[1]])
    }

    #[inline(always)]
    fn joint(&self, leg: &Leg, way: &Vector3<f64>) -> Option<f64> {
        match leg {
            Leg::Strut => Some(way.norm()).filter(|l| *l > self.least_length && *l < HUGE),
            leg => leg.joint(way, 0.0).ok(),
        }
    }

    #[inline(always)]
    fn is_within_reach(&self, tool: &Vector3<f64>) -> bool {
        let within = |value: f64| value.abs() <= self.farthest;
        within(tool.x) & within(tool.y) & within(tool.z)
    }

    /// Finds the point of the joint values that is connected with a seed, or on a given side; `None` if the
    /// general method must find it, or determine the refusal. `accepted` is the largest residual of
    /// a leg.
    #[inline(always)]
    pub fn meeting(
        &self,
        joints: &[f64; 3],
        which: Which<'_>,
        tool: &Vector3<f64>,
        accepted: f64,
    ) -> Option<Meeting> {
        let driven = self.drive(joints)?;
        let own;
        let sizes = match &self.sizes {
            Some(sizes) => sizes,
            None => {
                own = Sizes::of(&driven.length, &self.bend, self.least_length)?;
                &own
            }
        };
        let met = self.met(&driven, sizes, which, accepted)?;
        self.is_within_reach(tool).then_some(met)
    }

    /// Computes the lower ends at the joint values, and the lengths of the legs.
    #[inline(always)]
    fn drive(&self, [zero, one, two]: &[f64; 3]) -> Option<Driven> {
        let q = f64x2::new([*one, *two]) + pair(&self.offset, 0);
        let q0 = both(*zero) + pair(&self.offset, 2);
        let ([one, two], [zero, _]) = (q.to_array(), q0.to_array());
        let origin = [self.origin.pair(0), self.origin.pair(2)];
        let towards = [self.towards.pair(0), self.towards.pair(2)];
        match self.kinds {
            Kinds::Struts => {
                Some(Driven { centre: origin, towards, length: [one, two, zero, zero] })
            }
            Kinds::Sliders => {
                let moved = [scaled(&self.guide.pair(0), q), scaled(&self.guide.pair(2), q0)];
                let centre = [sum(&origin[0], &moved[0]), sum(&origin[1], &moved[1])];
                Some(Driven { centre, towards, length: [0.0; 4] })
            }
            Kinds::Mixed => self.drive_mixed([zero, one, two]),
        }
    }

    /// Computes the lower ends and lengths leg by leg.
    #[inline(always)]
    fn drive_mixed(&self, [zero, one, two]: [f64; 3]) -> Option<Driven> {
        let [of_zero, of_one, of_two] = &self.legs;
        let (zero, one, two) = (driven(of_zero, zero)?, driven(of_one, one)?, driven(of_two, two)?);
        let of = |part: fn(&Drive) -> Vector3<f64>| {
            let (zero, one, two) = (part(&zero), part(&one), part(&two));
            let pair = |k| f64x2::new([one[k], two[k]]);
            [[pair(0), pair(1), pair(2)], wide(&zero)]
        };
        let [moved, alone] = of(|drive| drive.displacement);
        let centre = [sum(&self.origin.pair(0), &moved), sum(&self.origin.pair(2), &alone)];
        let length = [one.length, two.length, zero.length, zero.length];
        Some(Driven { centre, towards: of(|drive| drive.towards), length })
    }

    /// Evaluates the formulas at the head of this file. Quantities that belong to no pair have the same value in
    /// both lanes, except for N and its products, whose sign alternates.
    #[inline(always)]
    fn met(
        &self,
        driven: &Driven,
        sizes: &Sizes,
        which: Which<'_>,
        accepted: f64,
    ) -> Option<Meeting> {
        let [centre, from] = &driven.centre;
        let square = [pair(&sizes.square, 0), pair(&sizes.square, 2)];
        // (a, b) and (b, a).
        let ab = difference(centre, from);
        let ba = ab.map(swapped);
        let normal = cross(&ab, &ba);
        let area = dot(&normal, &normal);
        let per_area = both(1.0) / area;
        let (own, other) = (dot(&ab, &ab), dot(&ab, &ba));
        let ahead = (own + square[1] - square[0]) * both(0.5);
        let shares = (ahead * swapped(own) - swapped(ahead) * other) * per_area;
        let y = scaled(&ab, shares).map(|part| part + swapped(part));
        let height = square[1] - dot(&y, &y);
        let side = match which {
            Which::Near(seed) => dot(&normal, &difference(&wide(seed), from)),
            Which::Side(side) => f64x2::new([side, -side]),
        };
        let up = (height * per_area).sqrt() | (side & both(-0.0));
        let first = sum(&y, &scaled(&normal, up));
        let spans = [difference(&first, &ab), first];
        let point = sum(from, &first);
        let way = match which {
            Which::Near(seed) => {
                let way = difference(&wide(seed), &point);
                dot(&way, &way)
            }
            Which::Side(_) => both(0.0),
        };
        let off = |k: usize| (dot(&spans[k], &spans[k]) - square[k]).abs();
        let off = off(0).fast_max(off(1));
        let off = off.fast_max(swapped(off)) * both(sizes.half);
        let margin = |k: usize| dot(&spans[k], &driven.towards[k]) + pair(&self.rest, 2 * k);
        let margin = margin(0).fast_min(margin(1));
        let margin = margin.fast_min(swapped(margin));
        let volume = height * area;
        let drives = margin * margin;
        let counts = volume.simd_gt(both(sizes.flat))
            & (way * both(sizes.short)).simd_le(drives * drives * volume)
            & margin.simd_ge(both(LEAST_DRIVE))
            & off.simd_le(both(accepted));
        let [x, y, z] = point.map(|part| part.to_array()[0]);
        let [residual, _] = (off / margin).to_array();
        counts.all().then_some(Meeting { point: Vector3::new(x, y, z), residual })
    }

    /// Returns the sign of the side of the plane of the centers on which a control point is.
    pub fn side(&self, point: &Vector3<f64>) -> Option<f64> {
        let joints = self.joints_of(&self.ways(point))?;
        let Driven { centre: [centre, from], .. } = self.drive(&joints)?;
        let ab = difference(&centre, &from);
        let normal = cross(&ab, &ab.map(swapped));
        let [side, _] = dot(&normal, &difference(&wide(point), &from)).to_array();
        Some(1.0_f64.copysign(side))
    }
}
