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
//!
//! **Constraints**, where an axis carries the tool: with w the tip and o' the tool vector as the axes move it, both functions
//! of the parameter, the platform at P with the orientation R satisfies P − R o' = w beside the constraints. A box
//! about the tangent contains the solution (`dependent`). It is the core's if the lines from home to all tips are
//! regular with the tool vector o', and those to all platforms without a tool: both solutions are then continuous along
//! the move, the core refuses a move whose solutions at the center differ, and different solutions stay apart.

use crate::proof::dependent::{Arm, Commanded, Place};
use crate::proof::reach::{RADIANS, ROUNDING, Reach};
use kinematics::{Carries, Chain, Fault, Link, Pose, Vector3, World};

/// Poses of the machine that contain a whole move: the center plus a sum of steps, each multiplied by a number
/// from −1 to 1. Machine units and degrees.
pub struct Enclosure {
    /// The machine's pose at the center of the move.
    pub middle: [f64; 6],
    /// The tangent, and the deviation of the curve from it along X, Y and Z; `None` if the move is too long for a bound
    /// beside constraints.
    pub steps: Option<[[f64; 6]; 4]>,
}

impl Enclosure {
    /// Encloses the straight path from `middle − step` to `middle + step` of a chain that does not follow the platform's
    /// orientation.
    ///
    /// # Errors
    /// As [`Chain::to_machine`].
    fn of(chain: &Chain, middle: &World, step: &World, tool: &Vector3<f64>) -> Result<Self, Fault> {
        let pose = chain.to_machine(middle, tool)?;
        let rates = chain.rates(middle, tool);
        let tangent = std::array::from_fn(|k| (0..9).map(|i| rates[(k, i)] * step[i]).sum());
        let bend = Bends { chain, middle, step }.of_place(tool);
        Ok(Self::about(pose, tangent, [bend / 2.0; 3]))
    }

    fn about(middle: [f64; 6], tangent: [f64; 6], off: [f64; 3]) -> Self {
        let along = |k: usize| {
            std::array::from_fn(|i| if i == k { off[k] * (1.0 + ROUNDING) } else { 0.0 })
        };
        Self { middle, steps: Some([tangent, along(0), along(1), along(2)]) }
    }

    /// Returns its extent, with angles multiplied by an arm.
    pub fn extent(&self, arm: f64) -> Option<f64> {
        let steps = self.steps?;
        let lengths = steps.iter().map(|step| Vector3::from_fn(|k, _| step[k]).norm());
        let turn: f64 = steps[0][3..].iter().map(|angle| angle.abs() * RADIANS).sum();
        Some(2.0 * (lengths.sum::<f64>() + arm * turn))
    }
}

impl Reach<'_> {
    /// Encloses the machine's poses on the straight path of LinuxCNC's pose from `middle − step` to `middle + step`, with
    /// this tool vector, spindle offset included.
    ///
    /// # Errors
    /// As [`kinematics::Machine::pose_of_world`].
    pub fn enclosure(
        &self,
        middle: &World,
        step: &World,
        tool: &Vector3<f64>,
    ) -> Result<Enclosure, Fault> {
        let chain = &self.config.chain;
        let Some(dependent) = self.dependent.as_ref().filter(|_| chain.follows()) else {
            return Enclosure::of(chain, middle, step, tool);
        };
        let pose = self.config.machine.pose_of_world(chain, middle, tool)?;
        let place = self.place(&pose)?;
        let [tip, vector] = Bends { chain, middle, step }.ends(tool);
        let by = commanded(chain, step, [&tip, &vector]);
        let Some(enclosed) = dependent.enclose_commanded(&place, &by) else {
            return Ok(Enclosure { middle: pose, steps: None });
        };
        let (tangents, box_) = enclosed.steps.split_at(1);
        let turn = |steps: &[[f64; 6]]| -> f64 {
            steps.iter().flat_map(|step| &step[3..]).map(|angle| angle.abs() * RADIANS).sum()
        };
        let (off, turned) = (turn(box_), turn(&enclosed.steps));
        let axes = place.axes.iter().zip(&tangents[0][3..]);
        let omega: Vector3<f64> = axes.map(|(axis, rate)| axis * (rate * RADIANS)).sum();
        let arm = place.rotation * vector.at;
        let rate = tip.rate + place.rotation * vector.rate + omega.cross(&arm);
        let (long, fast) = (vector.at.norm() + vector.speed, vector.speed);
        let bent = tip.bend + vector.bend + turned * (long * turned + 2.0 * fast);
        let (mut tangent, mut beside) = ([0.0; 6], [0.0; 3]);
        for k in 0..6 {
            match (dependent.dependent[k], k) {
                (false, _) => tangent[k] = tangents[0][k],
                // A table, which makes the whole rest of the tip's motion.
                (true, 0..3) => tangent[k] = rate[k],
                (true, _) => {}
            }
        }
        for (k, beside) in beside.iter_mut().enumerate() {
            *beside = match dependent.dependent[k] {
                false => box_.iter().map(|step| step[k].abs()).sum(),
                true => long * off + bent / 2.0,
            };
        }
        Ok(Enclosure::about(pose, tangent, beside))
    }

    /// Proves that the lines from home to all tips of a straight path of LinuxCNC's pose are regular, if constraints
    /// determine the orientation of a platform whose axes carry the tool. [`Self::refuse_unconnected`] proves it for
    /// the platforms.
    ///
    /// # Errors
    /// The share of the path at which that is not proved, and why.
    pub fn refuse_unconnected_tip(
        &self,
        from: &World,
        delta: &World,
        tool: &Vector3<f64>,
    ) -> Result<(), (f64, Fault)> {
        let (chain, machine) = (&self.config.chain, &self.config.machine);
        if self.dependent.is_none() || !chain.follows() {
            return Ok(());
        }
        let home = self.config.home;
        let level = self.place(&home).map_err(|fault| (0.0, fault))?.rotation;
        self.refuse_singular(|[[t, ht], [s, hs]]| {
            let world = std::array::from_fn(|k| from[k] + s * delta[k]);
            let step = delta.map(|value| hs * value);
            let [tip, vector] = Bends { chain, middle: &world, step: &step }.ends(tool);
            let mut by = commanded(chain, &step, [&tip, &vector]);
            // The tip at home, whose platform is the same with any tool.
            let start = Vector3::from_fn(|k, _| home[k]) - level * vector.at;
            let point = start.lerp(&tip.at, t);
            let start_rate = -level * vector.rate;
            let mut pose = [0.0; 6];
            // Along the lines, along the path, and the product of both.
            let mut steps = [[0.0; 6]; 3];
            for k in 0..3 {
                let change = tip.rate[k] - start_rate[k];
                pose[k] = point[k] + vector.at[k];
                steps[0][k] = ht * (tip.at - start)[k];
                steps[1][k] = start_rate[k] + t * change;
                steps[2][k] = ht * change;
                by.bend[k] = (t + ht) * tip.bend + (1.0 - t + ht) * vector.bend;
            }
            for k in (3..6).filter(|k| !chain.is_extra(*k)) {
                pose[k] = home[k] + t * (world[k] - home[k]);
                steps[0][k] = ht * (world[k] - home[k]);
                steps[1][k] = t * step[k];
                steps[2][k] = ht * step[k];
            }
            by.steps = steps.to_vec();
            let arm = by.arm.take().map(|arm| Arm {
                rates: vec![Vector3::zeros(), vector.rate, Vector3::zeros()],
                point,
                ..arm
            });
            let mut full = machine.full_pose(&Pose::from_degrees(pose), &vector.at)?;
            full.position += full.rotation() * vector.at - vector.at;
            Ok(Some((Place::new(&full), Commanded { arm, ..by })))
        })
    }
}

/// Returns the motion of the tip, and of the tool vector from it to the platform, over a move.
fn commanded(chain: &Chain, step: &World, [tip, vector]: [&Bound; 2]) -> Commanded {
    let rate = |k: usize| match k {
        0..3 => tip.rate[k],
        _ if chain.is_extra(k) => 0.0,
        _ => step[k],
    };
    Commanded {
        steps: vec![std::array::from_fn(rate)],
        bend: [tip.bend, tip.bend, tip.bend, 0.0, 0.0, 0.0],
        arm: Some(Arm {
            at: vector.at,
            rates: vec![vector.rate],
            bend: vector.bend,
            point: tip.at,
        }),
    }
}

/// A point at the center of the move, its rate there, and bounds of its first and second derivative.
#[derive(Clone, Copy)]
struct Bound {
    at: Vector3<f64>,
    /// Without the rotation of the platform.
    rate: Vector3<f64>,
    speed: f64,
    bend: f64,
}

impl Bound {
    /// Rotates about a point by `turn`; `at` is the resulting position.
    fn turned(self, arm: f64, turn: f64, at: Vector3<f64>) -> Self {
        let arm = arm + self.speed;
        let speed = self.speed + turn * arm;
        let bend = self.bend + 2.0 * turn * self.speed + turn * turn * arm;
        Self { at, rate: self.rate, speed, bend }
    }
}

struct Bends<'a> {
    chain: &'a Chain,
    middle: &'a World,
    step: &'a World,
}

impl Bends<'_> {
    /// Returns the point moved by an axis, in its direction or, for `sign` −1, seen from what it carries.
    fn through(&self, point: Bound, link: &Link, sign: f64) -> Bound {
        let change = self.step[link.place];
        let at = match sign > 0.0 {
            true => link.out(&point.at, self.middle),
            false => link.into(&point.at, self.middle),
        };
        if !link.is_rotary() {
            let rate = point.rate + link.axis * (sign * change);
            return Bound { at, rate, speed: point.speed + change.abs(), ..point };
        }
        let turn = change * RADIANS;
        let rotation = link.rotation(self.middle);
        let rotation = if sign > 0.0 { rotation } else { rotation.transpose() };
        let rate = rotation * point.rate + link.axis.cross(&(at - link.point)) * (sign * turn);
        Bound { rate, ..point.turned((point.at - link.point).norm(), turn.abs(), at) }
    }

    fn out(&self, point: Bound, link: &Link) -> Bound {
        self.through(point, link, 1.0)
    }

    fn seen(&self, point: Bound, link: &Link) -> Bound {
        self.through(point, link, -1.0)
    }

    fn as_legs_see(&self, point: Bound) -> Bound {
        self.chain.of(Carries::Legs).fold(point, |point, link| self.seen(point, link))
    }

    /// Bounds the second derivative of a vector of the platform, in base.
    fn of_platform(&self, vector: Bound) -> f64 {
        let is_extra = |place: usize| self.chain.is_extra(place);
        let turning = (3..6).filter(|place| !is_extra(*place));
        let turn: f64 = turning.map(|place| self.step[place].abs() * RADIANS).sum();
        vector.turned(vector.at.norm(), turn, vector.at).bend
    }

    /// Bounds the tip, as moved by the axes that carry the work.
    fn tip(&self, tool: &Vector3<f64>) -> Bound {
        let place = |k: usize| if self.chain.is_extra(k) { 0.0 } else { self.middle[k] };
        let rate = |k: usize| if self.chain.is_extra(k) { 0.0 } else { self.step[k] };
        let rate = Vector3::from_fn(|k, _| rate(k));
        let at = Vector3::from_fn(|k, _| place(k)) - tool;
        let tip = Bound { at, rate, speed: rate.norm(), bend: 0.0 };
        let work = self.chain.of(Carries::Work).rev();
        work.fold(tip, |tip, link| self.out(tip, link))
    }

    /// Bounds the tool vector, as moved by the axes that carry it.
    fn vector(&self, tool: &Vector3<f64>) -> Bound {
        let point = Bound { at: -tool, rate: Vector3::zeros(), speed: 0.0, bend: 0.0 };
        let links = self.chain.of(Carries::Tool).rev();
        let point = links.fold(point, |point, link| self.out(point, link));
        Bound { at: -point.at, rate: -point.rate, ..point }
    }

    /// Bounds the tip as seen from the base of the legs, and the tool vector.
    fn ends(&self, tool: &Vector3<f64>) -> [Bound; 2] {
        [self.as_legs_see(self.tip(tool)), self.vector(tool)]
    }

    /// Bounds the second derivative of the machine's position.
    fn of_place(&self, tool: &Vector3<f64>) -> f64 {
        let (tip, vector) = (self.tip(tool), self.vector(tool));
        match self.chain.holder() {
            Some(holder) => {
                let tip_now = Bound { at: holder - vector.at, ..vector };
                self.as_legs_see(tip_now).bend + self.of_platform(tip)
            }
            None if !self.chain.is_bare() => self.as_legs_see(tip).bend,
            None => self.as_legs_see(tip).bend + self.of_platform(vector),
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
                let steps = steps.unwrap();
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
