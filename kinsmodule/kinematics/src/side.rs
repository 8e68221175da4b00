// SPDX-License-Identifier: GPL-2.0-or-later
//! The side of the singular poses on which a pose is.
//!
//! When a motion passes a singular pose, the sign of det J changes. Joints beyond the fold belong to
//! two nearby poses, the commanded one and its mirror image on the near side. Forward follows the
//! joints, never passes a singular pose, and finds the mirror image: each of its results is a correct
//! solution, but the sequence is not the machine's motion. Commanded poses must therefore stay on
//! forward's side.
//!
//! The sign is not recomputed for every pose: it is constant while J is regular, in a ball of radius
//! ρ with L(ρ) ρ < 1 (module `certificate`). There the base anchors are fixed; here the joints
//! follow the pose, and rods rotate faster: the lower end of a rod with margin m (module `leg`) moves, as long
//! as the margin stays above m/2, by at most 2 s₁/m per unit of motion, which adds 2 s₁²/(m l) to its k.

use crate::certificate::lipschitz_constant;
use crate::fault::Fault;
use crate::layout::Joints;
use crate::machine::{Lanes, Machine, each};
use crate::mechanism::Mechanism;
use crate::placed::Placed;
use crate::pose::Pose;
use crate::pseudo_inverse::PseudoInverse;
use libm::sqrt;
use nalgebra::Vector3;

/// Radius of the first ball to try, as a share of 1/L at its center: L grows with the ball.
const FIRST_SHARE: f64 = 0.7;

/// Number of balls to try, each half as large as the one before.
const TRIES: u32 = 4;

/// The side of the singular poses on which a pose is, and the distance for which that is proved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    sign: i32,
    pose: Pose,
    tool: Vector3<f64>,
    /// Distance from the control point to the reference point.
    lever: f64,
    radius: f64,
    reach: f64,
}

impl Side {
    /// Returns whether every path between the two passes a singular pose: both signs of det J are known and
    /// differ. Machines with more legs than coordinates have no such sign.
    pub fn opposes(&self, other: &Self) -> bool {
        self.sign * other.sign < 0
    }

    /// Returns whether another pose is so near that it is certainly on the same side.
    ///
    /// The platform rotates by no more than A, B and C change in total; its reference point
    /// t − o + R (o + reference) moves no farther than t, twice o, and the rotation of its lever together.
    pub fn reaches(&self, pose: &Pose, tool: &Vector3<f64>) -> bool {
        let turn = (pose.angles - self.pose.angles).abs().sum();
        let retooled = (tool - self.tool).abs().sum();
        let way = (pose.position - self.pose.position).norm();
        let way = way + 2.0 * retooled + (self.lever + retooled) * turn;
        let turn = self.radius * turn;
        way * way + turn * turn < self.reach * self.reach
    }
}

impl Machine {
    /// Computes the side on which a pose is.
    ///
    /// # Errors
    /// As [`Machine::inverse`].
    pub fn side(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Side, Fault> {
        each!(self, m => m.side(pose, tool))
    }

    /// Computes the largest travel of a leg's joint between two sets of values as a length, machine units; for
    /// a crank, the travel of the arm's end.
    pub fn travel(&self, from: &Joints, to: &Joints) -> f64 {
        each!(self, m => m.travel(from, to))
    }
}

impl<const N: usize> Mechanism<N> {
    pub fn side(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Side, Fault> {
        let mut legs = self.nowhere();
        legs.move_to(pose, tool)?;
        let (joints, placed, place) = (&legs.target.joints, &legs.placed, &legs.placement.place);
        let torsion = legs.torsion();
        let columns = self.charted_rows(placed, torsion, place);
        let sign = if self.layout.is_redundant() { 0 } else { self.sign_of(&columns) };
        let reach = match PseudoInverse::new(&columns, &self.active) {
            // The platform also moves in coordinates that the pose does not have.
            _ if self.couplings().is_some() => 0.0,
            Some(inverse) => self.largest_ball(|rho| {
                let fixed = lipschitz_constant(self, placed, torsion, &inverse, rho, None).ok()?;
                Some(fixed + self.of_joints(placed, joints, &inverse, rho)?)
            }),
            None => 0.0,
        };
        let lever = (tool + self.reference).norm();
        Ok(Side { sign, pose: *pose, tool: *tool, lever, radius: self.radius, reach })
    }

    pub fn travel(&self, from: &Joints, to: &Joints) -> f64 {
        let legs = self.legs.iter().zip(from.iter().zip(to)).take(self.count());
        // The margin for a transmission of 1 is 1 over the largest transmission.
        let ways =
            legs.map(|(leg, (from, to))| (to - from).abs() / leg.margin(1.0).map_or(1.0, f64::abs));
        ways.fold(0.0, f64::max)
    }

    /// Finds the radius ρ of a ball with L(ρ) ρ < 1; 0 if none was found.
    fn largest_ball(&self, lipschitz: impl Fn(f64) -> Option<f64>) -> f64 {
        let Some(least) = lipschitz(0.0) else { return 0.0 };
        let mut rho = FIRST_SHARE / least;
        for _ in 0..TRIES {
            if lipschitz(rho).is_some_and(|lipschitz| lipschitz * rho < 1.0) {
                return rho;
            }
            rho /= 2.0;
        }
        0.0
    }

    /// Computes the addition of the rods' lower ends, which follow the pose, to L of the ball of radius `rho`;
    /// `None` if a rod may come too near to its dead point, or a base anchor within the cylinder
    /// over its ring.
    fn of_joints(
        &self,
        placed: &Placed<N>,
        joints: &[f64; N],
        inverse: &PseudoInverse<N>,
        rho: f64,
    ) -> Option<f64> {
        let mut sum = 0.0;
        for i in 0..self.count() {
            if let Some(rings) = self.rings()
                && rings.widened(placed, i, rho, 0.0).is_none_or(|ring| ring.ratio > 1.0)
            {
                return None;
            }
            let (leg, s1, length) = (&self.legs[i], self.s1[i], placed.length[i]);
            let transmission =
                leg.transmission(joints[i] + self.offset[i], &(placed.span.get(i) / length));
            let Some(margin) = leg.margin(transmission) else { continue };
            let speed = s1 * (1.0 + 2.0 / margin);
            let turn =
                speed * rho / length + leg.second_derivatives(2.0 * s1 * rho / transmission).turn;
            if !(margin > 0.0 && turn <= margin / 2.0) {
                return None;
            }
            let more = 2.0 * s1 * s1 / (margin * length);
            sum += more * more;
        }
        Some(inverse.inverse_norm() * sqrt(sum))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::freeze::Frozen;
    use crate::geometry::{Geometry, LegGeometry};
    use crate::layout::MAX_LEGS;
    use crate::leg::{LegKind, SliderGeometry};
    use crate::letters::Letters;

    /// Creates three carriages on vertical guides with rods of 5 that reach 3 inwards and 4 up.
    fn delta() -> Mechanism<4> {
        let legs = [[3.0, 0.0], [-3.0, 0.0], [0.0, 3.0]].map(|[x, y]| {
            let kind =
                LegKind::Slider(SliderGeometry { guide: [0.0, 0.0, 1.0], rod: 5.0, side: -1 });
            LegGeometry { base: [x, y, 0.0], platform: [0.0; 3], kind }
        });
        let [xyz, none] = ["XYZ", ""].map(|text| Letters::parse(text.as_bytes()).unwrap());
        let geometry = Geometry::new(&legs, xyz, none).unwrap();
        Frozen { geometry: &geometry, offset: &[0.0; MAX_LEGS] }.mechanism().unwrap()
    }

    #[test]
    fn rods_add_what_their_lower_ends_turn_them_by_until_one_comes_half_way_to_its_dead_point() {
        let machine = delta();
        let mut legs = machine.nowhere();
        let pose = Pose { position: Vector3::new(0.0, 0.0, 10.0), angles: Vector3::zeros() };
        legs.move_to(&pose, &Vector3::zeros()).unwrap();
        let columns = machine.charted_rows(&legs.placed, None, &legs.placement.place);
        let inverse = PseudoInverse::new(&columns, &machine.active).unwrap();
        let add = |rho| machine.of_joints(&legs.placed, &legs.target.joints, &inverse, rho);
        // A margin of 4/5 and s1 = 1: a lower end moves at 2/0.8, its rod rotates at 1 + 2/0.8 over 5,
        // up to 0.4; each adds 2/(0.8 · 5). A few roundings.
        let most = 0.4 * 5.0 / 3.5;
        assert!(add(most * 0.999_999).is_some() && add(most * 1.000_001).is_none());
        let expected = inverse.inverse_norm() * sqrt(3.0) * 0.5;
        let found = add(0.1).unwrap();
        assert!((found - expected).abs() < 1e-14 * expected, "{found} {expected}");
    }
}
