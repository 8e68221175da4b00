// SPDX-License-Identifier: GPL-2.0-or-later
//! Encloses the motion of a machine whose axes carry workpiece, tool or legs: a straight move of LinuxCNC's pose is a
//! curve for it.
//!
//! Along the move, parametrized from −1 to 1, every value changes at a constant rate. A point x carried by a
//! rotary axis, at a distance r from it and rotating by w, satisfies
//!
//!
//! ```text
//! |y'| ≤ |x'| + |w| r,   |y''| ≤ |x''| + 2 |w| |x'| + w² r,   r ≤ r(0) + max |x'|
//! ```
//!
//! and so does a point in the frame of a rotating axis; a linear axis adds its rate. The platform rotates by at most
//! the sum of the rates of A, B and C. The result is a bound of the second derivative p'' of the
//! machine's position, and by Taylor's formula the curve stays within max |p''|/2 of its tangent at the
//! center. The angles are straight.

use crate::proof::reach::{RADIANS, ROUNDING};
use kinematics::{Carries, Chain, Fault, Link, Pose, Vector3, World};

/// Poses of the machine that contain a whole move: the center plus a sum of steps, each multiplied by a number
/// from −1 to 1. Machine units and degrees.
pub struct Enclosure {
    /// The machine's pose at the center of the move.
    pub middle: [f64; 6],
    /// The tangent, and the deviation of the curve from it along X, Y and Z.
    pub steps: [[f64; 6]; 4],
}

impl Enclosure {
    /// Encloses the straight path from `middle − step` to `middle + step`.
    ///
    /// # Errors
    /// As [`Chain::to_machine`].
    pub fn of(
        chain: &Chain,
        middle: &World,
        step: &World,
        tool: &Vector3<f64>,
    ) -> Result<Self, Fault> {
        let pose = chain.to_machine(middle, tool)?;
        let rates = chain.rates(middle, tool);
        let tangent = std::array::from_fn(|k| (0..9).map(|i| rates[(k, i)] * step[i]).sum());
        let bend = Bends { chain, middle, step, pose: &pose }.of_place(tool);
        let off = bend / 2.0 * (1.0 + ROUNDING);
        let along = |k: usize| std::array::from_fn(|i| if i == k { off } else { 0.0 });
        Ok(Self { middle: pose, steps: [tangent, along(0), along(1), along(2)] })
    }

    /// Returns its extent, with angles multiplied by an arm.
    pub fn extent(&self, arm: f64) -> f64 {
        let lengths = self.steps.iter().map(|step| Vector3::from_fn(|k, _| step[k]).norm());
        let turn: f64 = self.steps[0][3..].iter().map(|angle| angle.abs() * RADIANS).sum();
        2.0 * (lengths.sum::<f64>() + arm * turn)
    }
}

/// A point at the center of the move, and bounds of its first and second derivative.
#[derive(Clone, Copy)]
struct Bound {
    at: Vector3<f64>,
    speed: f64,
    bend: f64,
}

impl Bound {
    /// Rotates about a point by `turn`; `at` is the resulting position.
    fn turned(self, arm: f64, turn: f64, at: Vector3<f64>) -> Self {
        let arm = arm + self.speed;
        let speed = self.speed + turn * arm;
        Self { at, speed, bend: self.bend + 2.0 * turn * self.speed + turn * turn * arm }
    }

    fn with(self, other: &Self, at: Vector3<f64>) -> Self {
        Self { at, speed: self.speed + other.speed, bend: self.bend + other.bend }
    }
}

struct Bends<'a> {
    chain: &'a Chain,
    middle: &'a World,
    step: &'a World,
    /// The machine's pose at the center.
    pose: &'a [f64; 6],
}

impl Bends<'_> {
    fn through(&self, point: Bound, link: &Link, at: Vector3<f64>) -> Bound {
        let rate = self.step[link.place].abs();
        match link.is_rotary() {
            true => point.turned((point.at - link.point).norm(), rate * RADIANS, at),
            false => Bound { at, speed: point.speed + rate, ..point },
        }
    }

    fn out(&self, point: Bound, link: &Link) -> Bound {
        self.through(point, link, link.out(&point.at, self.middle))
    }

    fn seen(&self, point: Bound, link: &Link) -> Bound {
        self.through(point, link, link.into(&point.at, self.middle))
    }

    fn as_legs_see(&self, point: Bound) -> Bound {
        self.chain.of(Carries::Legs).fold(point, |point, link| self.seen(point, link))
    }

    /// Bounds a vector of the platform, in base.
    fn of_platform(&self, vector: Bound) -> Bound {
        let is_extra = |place: usize| self.chain.is_extra(place);
        let turning = (3..6).filter(|place| !is_extra(*place));
        let turn: f64 = turning.map(|place| self.step[place].abs() * RADIANS).sum();
        let rotation = Pose::from_degrees(*self.pose).rotation();
        vector.turned(vector.at.norm(), turn, rotation * vector.at)
    }

    /// Bounds the second derivative of the machine's position.
    fn of_place(&self, tool: &Vector3<f64>) -> f64 {
        let place = |k: usize| if self.chain.is_extra(k) { 0.0 } else { self.middle[k] };
        let rate = |k: usize| if self.chain.is_extra(k) { 0.0 } else { self.step[k] };
        let tip = Bound {
            at: Vector3::from_fn(|k, _| place(k)) - tool,
            speed: Vector3::from_fn(|k, _| rate(k)).norm(),
            bend: 0.0,
        };
        let work = self.chain.of(Carries::Work).rev();
        let tip = work.fold(tip, |tip, link| self.out(tip, link));
        let point = Bound { at: -tool, speed: 0.0, bend: 0.0 };
        let links = self.chain.of(Carries::Tool).rev();
        let point = links.fold(point, |point, link| self.out(point, link));
        let vector = Bound { at: -point.at, ..point };
        match self.chain.holder() {
            Some(holder) => {
                let tip_now = Bound { at: holder - vector.at, ..vector };
                let (place, arm) = (self.as_legs_see(tip_now), self.of_platform(tip));
                place.with(&arm, place.at - arm.at).bend
            }
            None if !self.chain.is_bare() => self.as_legs_see(tip).bend,
            None => {
                let (place, arm) = (self.as_legs_see(tip), self.of_platform(vector));
                place.with(&arm, place.at + arm.at).bend
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinematics::{ChainGeometry, ExtraAxes, Layout, Letters, LinkGeometry};
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64;

    fn three(rng: &mut Pcg64, size: f64) -> [f64; 3] {
        std::array::from_fn(|_| rng.random_range(-size..size))
    }

    /// Returns a random machine that moves X Y Z B, with axes that carry something.
    fn drawn(rng: &mut Pcg64) -> Chain {
        let letters = |text: &[u8]| Letters::parse(text).unwrap();
        let layout = Layout::new(4, letters(b"XYZB"), letters(b"")).unwrap();
        let mut given = ChainGeometry::NONE;
        for link in &mut given.links {
            let carries = rng.random_range(0..=3);
            *link = LinkGeometry { carries, axis: three(rng, 1.0), point: three(rng, 300.0) };
        }
        given.holder = rng.random_bool(0.4).then(|| three(rng, 300.0));
        let axes = ExtraAxes::parse(b"WCUAV", &layout).unwrap();
        Chain::freeze(&given, &axes, &layout, 1000.0).unwrap()
    }

    #[test]
    fn a_whole_move_is_enclosed_and_the_enclosure_shrinks_with_the_square_of_its_length() {
        let mut rng = Pcg64::seed_from_u64(195);
        for _ in 0..500 {
            let (chain, tool) = (drawn(&mut rng), Vector3::from(three(&mut rng, 100.0)));
            let mut part = |angle: f64, length: f64| -> World {
                std::array::from_fn(|k| match k {
                    3..6 => rng.random_range(-angle..angle),
                    _ => rng.random_range(-length..length),
                })
            };
            let (middle, step) = (part(90.0, 300.0), part(40.0, 50.0));
            let mut bends = vec![];
            for share in [1.0, 0.1] {
                let step = step.map(|value| share * value);
                let Enclosure { middle: pose, steps } =
                    Enclosure::of(&chain, &middle, &step, &tool).unwrap();
                let mut most = 0.0_f64;
                for n in -20..=20 {
                    let s = f64::from(n) / 20.0;
                    let world = std::array::from_fn(|k| middle[k] + s * step[k]);
                    let at = chain.to_machine(&world, &tool).unwrap();
                    let off = |k: usize| (at[k] - pose[k] - s * steps[0][k]).abs();
                    // Rounding of positions of some hundred units.
                    assert!((0..3).all(|k| off(k) <= steps[k + 1][k] + 1e-9), "{s}");
                    assert!((3..6).all(|k| off(k) < 1e-9), "{s}");
                    most = (0..3).map(off).fold(most, f64::max);
                }
                bends.push((steps[1][0], most));
            }
            let [(long, _), (short, seen)] = bends[..] else { panic!() };
            assert!(short < 0.02 * long || long == 0.0, "{short} {long}");
            // With large curvature, the bound exceeds the sampled deviation by at most the arms of a few axes that may
            // all have another direction.
            assert!(seen < 1e-6 || short < 300.0 * seen, "{short} {seen}");
        }
    }
}
