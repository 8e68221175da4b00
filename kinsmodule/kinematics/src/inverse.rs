// SPDX-License-Identifier: GPL-2.0-or-later
//! Inverse kinematics: pose to joints.

use crate::coupling::Couplings;
use crate::fault::{Cause, Fault};
use crate::geometry::HUGE;
use crate::lanes::{Lanes3, between, both, dot, pair, put};
use crate::layout::{Joints, MAX_JOINTS, MAX_LEGS, PerLeg};
use crate::leg::Leg;
use crate::mechanism::Mechanism;
use crate::nut::{Nut, Torsion, Turns};
use crate::placed::{Place, Placed};
use crate::pose::{Pose, Trigonometry};
use nalgebra::Vector3;

/// Platform pose from which the legs are computed.
pub(crate) struct Placement {
    pub place: Place,
    /// Reference point in base, as moved by legs and table together; with constraints, its difference from the one that
    /// the legs move.
    pub point: Vector3<f64>,
}

impl Placement {
    /// Level, at the origin.
    pub const LEVEL: Self = Self { place: Place::LEVEL, point: Vector3::new(0.0, 0.0, 0.0) };
}

impl<const N: usize> Mechanism<N> {
    /// Returns the joint values of a pose.
    #[inline(always)]
    pub fn inverse(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Joints, Fault> {
        pose.check()?;
        self.check_tool(tool)?;
        let pose = if self.holds { self.held(pose, true)? } else { *pose };
        let placement = self.placement(&pose, &pose.trigonometry(), tool)?;
        let struts = if self.moving { None } else { self.lengths(&placement.place) };
        let legs = match struts {
            Some(struts) => self.joints_of_lengths(&struts),
            None => self.joints_at(&placement.place)?,
        };
        self.all_joints(&legs, &placement.point)
    }

    /// Computes the lengths of struts, including nut corrections; `None` if the general method must decide.
    #[inline(always)]
    fn lengths(&self, place: &Place) -> Option<[f64; N]> {
        match &self.nut {
            Some(nut) => self.corrected_struts(nut, place),
            None => self.struts(place),
        }
    }

    /// Computes the lengths of struts without nut corrections; `None` if any is zero or huge.
    #[inline(always)]
    fn struts(&self, place: &Place) -> Option<[f64; N]> {
        let mut length = [0.0; N];
        for i in (0..N).step_by(2) {
            let [_, span] = self.leg(&self.base, place, i);
            put(&mut length, i, dot(&span, &span).sqrt());
        }
        between(&length, self.least_length(), HUGE).all().then_some(length)
    }

    /// Computes the lengths of struts with their corrections; `None` also if any torsion is undefined or
    /// large.
    #[inline(always)]
    fn corrected_struts(&self, nut: &Nut<N>, place: &Place) -> Option<[f64; N]> {
        let mut length = [0.0; N];
        let mut turns = Turns::ZERO;
        let mut sound = both(0.0).simd_eq(both(0.0));
        for i in (0..N).step_by(2) {
            let [_, span] = self.leg(&self.base, place, i);
            let lengths = dot(&span, &span).sqrt();
            sound &= nut.turn(i, (&span, lengths), &place.rotation, &mut turns);
            put(&mut length, i, lengths);
        }
        sound &= between(&length, self.least_length(), HUGE);
        // A separate loop, see `lanes` (overlap).
        for i in (0..N).step_by(2) {
            let (correction, known) = nut.correction(i, &turns);
            sound &= known;
            let corrected = pair(&length, i) + correction;
            put(&mut length, i, corrected);
        }
        sound.all().then_some(length)
    }

    /// Returns the joint values of legs and table.
    #[inline(always)]
    pub(crate) fn all_joints(
        &self,
        legs: &[f64; N],
        point: &Vector3<f64>,
    ) -> Result<Joints, Fault> {
        let mut joints = [0.0; MAX_JOINTS];
        joints.iter_mut().zip(legs).take(self.count()).for_each(|(joint, leg)| *joint = *leg);
        let table = self.layout.table().as_slice();
        for (joint, letter) in joints.iter_mut().skip(self.count()).zip(table) {
            *joint = point[letter.index().min(2)];
        }
        match joints.iter().position(|joint| !joint.is_finite()) {
            None => Ok(joints),
            Some(i) => Err(Fault::of_joint(Cause::ResultNotFinite, &self.layout, i, joints[i])),
        }
    }

    /// Computes the platform's pose.
    #[inline(always)]
    pub(crate) fn placement(
        &self,
        pose: &Pose,
        trig: &Trigonometry,
        tool: &Vector3<f64>,
    ) -> Result<Placement, Fault> {
        if let Some(couplings) = self.couplings() {
            return Self::settled(couplings, pose, tool);
        }
        let rotation = trig.rotation();
        let point = self.point(&pose.position, &rotation, tool);
        Ok(Placement {
            place: Place { centre: self.of_legs(point), rotation, angles: pose.angles },
            point,
        })
    }

    /// Computes the platform's pose from commanded coordinates; the table compensates the difference.
    #[inline(never)]
    fn settled(
        couplings: &Couplings,
        pose: &Pose,
        tool: &Vector3<f64>,
    ) -> Result<Placement, Fault> {
        let settled = couplings.settle(pose, tool)?;
        Ok(Placement { place: settled.place, point: settled.table })
    }

    /// Computes how far the platform moves for a change of the tool vector.
    pub(crate) fn tool_travel(
        &self,
        pose: &Pose,
        from: &Vector3<f64>,
        to: &Vector3<f64>,
    ) -> Result<f64, Fault> {
        let place = |tool| {
            let full = self.full_pose(pose, tool)?;
            let rotation = full.rotation();
            Ok::<_, Fault>((self.point(&full.position, &rotation, tool), rotation))
        };
        let (one, other) = (place(from)?, place(to)?);
        Ok((other.0 - one.0).norm() + self.radius * (other.1 - one.1).norm())
    }

    /// Computes the pose of the control point in base.
    pub(crate) fn full_pose(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Pose, Fault> {
        pose.check()?;
        self.check_tool(tool)?;
        let pose = if self.holds { self.held(pose, true)? } else { *pose };
        let place = self.placement(&pose, &pose.trigonometry(), tool)?.place;
        Ok(match self.couplings() {
            Some(couplings) => couplings.pose(&place, tool),
            None => Pose {
                position: place.centre + tool - place.rotation * (tool + self.reference),
                angles: pose.angles,
            },
        })
    }

    /// Computes the legs from their base anchors at joint value 0 and the nut corrections there, and passes on
    /// the torsion from which they are computed.
    #[inline(always)]
    pub(crate) fn corrected(
        &self,
        place: &Place,
        placed: &mut Placed<N>,
        keep: impl FnOnce(&Torsion<N>),
    ) -> Result<[f64; N], Fault> {
        self.place(&self.base, place, placed);
        if self.moving {
            self.refuse_short_struts(placed)?;
            self.refuse_within_rings(placed)?;
        } else {
            self.refuse_short_legs(&placed.length)?;
        }
        let Some(nut) = &self.nut else { return Ok([0.0; N]) };
        let torsion = nut.torsion(&placed.directions(), &place.rotation);
        nut.refuse(&torsion)?;
        keep(&torsion);
        Ok(nut.corrections(&torsion))
    }

    /// Refuses struts of zero length. (A rod's base anchor may coincide with its platform anchor.)
    fn refuse_short_struts(&self, placed: &Placed<N>) -> Result<(), Fault> {
        for i in 0..self.count() {
            if self.legs[i] == Leg::Strut {
                self.refuse_short(i, placed.length[i])?;
            }
        }
        Ok(())
    }

    /// Refuses base anchors too near to the tool axis for their rings.
    pub(crate) fn refuse_within_rings(&self, placed: &Placed<N>) -> Result<(), Fault> {
        self.rings().map_or(Ok(()), |rings| rings.refuse_within(placed, self.count()))
    }

    /// Computes the joint values of the legs at a pose.
    #[inline(always)]
    pub(crate) fn joints_at(&self, place: &Place) -> Result<[f64; N], Fault> {
        let mut placed = Placed::ZERO;
        let corrections = self.corrected(place, &mut placed, |_| ())?;
        self.leg_joints(&placed, &corrections)
    }

    #[inline(always)]
    pub(crate) fn leg_joints(
        &self,
        placed: &Placed<N>,
        corrections: &[f64; N],
    ) -> Result<[f64; N], Fault> {
        let mut joints = placed.length;
        if self.moving {
            self.native_joints(placed, &mut joints)?;
        }
        for i in (0..N).step_by(2) {
            let corrected = pair(&joints, i) + pair(corrections, i);
            put(&mut joints, i, corrected);
        }
        Ok(self.joints_of_lengths(&joints))
    }

    /// Converts native joint values, which are strut lengths, to joint values.
    #[inline(always)]
    fn joints_of_lengths(&self, native: &[f64; N]) -> [f64; N] {
        let mut joints = [0.0; N];
        for i in (0..N).step_by(2) {
            put(&mut joints, i, pair(native, i) - pair(&self.offset, i));
        }
        joints
    }

    /// Computes the native joint values if not all legs are struts.
    fn native_joints(&self, placed: &Placed<N>, joints: &mut [f64; N]) -> Result<(), Fault> {
        for i in 0..N {
            joints[i] = self.legs[i]
                .joint(&placed.span.get(i), placed.length[i])
                .map_err(|(cause, value)| Fault::of_leg(cause, i, value))?;
        }
        Ok(())
    }

    /// Computes the positions of the moving base anchors.
    #[inline(always)]
    pub(crate) fn moved_anchors(&self, joints: &[f64; N]) -> Result<Lanes3<N>, Fault> {
        Ok(self.target(joints)?.anchors)
    }

    /// Converts lanes to per-leg values for callers.
    pub(crate) fn per_leg(&self, lanes: &[f64; N]) -> PerLeg {
        let mut out = [0.0; MAX_LEGS];
        for i in 0..N.min(MAX_LEGS) {
            out[i] = lanes[i] * self.present[i];
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::certificate::tests::random;
    use crate::freeze::Frozen;
    use crate::geometry::{Geometry, LegGeometry};
    use crate::leg::StrutGeometry;
    use crate::letters::Letters;
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    /// Creates struts between random anchors that move all coordinates, with or without screws.
    #[inline(always)]
    fn struts<const N: usize>(rng: &mut Pcg64, screws: bool) -> Mechanism<N> {
        let mut vector = |size: f64| core::array::from_fn(|_| random(rng, -size, size));
        let legs: [_; N] = core::array::from_fn(|_| {
            let lead = if screws { 10.0 } else { 0.0 };
            let (base_axis, platform_axis) = (vector(1.0), vector(1.0));
            let screw = StrutGeometry { base_axis, platform_axis, lead };
            LegGeometry::strut(vector(500.0), vector(200.0), screw)
        });
        let mut geometry = Geometry::new(&legs, Letters::XYZABC, Letters::NONE).unwrap();
        let offset = core::array::from_fn(|i| 10.0 * i as f64);
        let frozen = |geometry: &Geometry| Frozen { geometry, offset: &offset }.mechanism();
        // Corrections fold at a home, or use the arcsin without one.
        let home = random(rng, 0.0, 1.0) < 0.5;
        geometry.home = home.then_some([0.0, 0.0, 900.0, 0.0, 0.0, 0.0]);
        let settled = frozen(&geometry);
        geometry.home = None;
        settled.or_else(|_| frozen(&geometry)).expect("a machine")
    }

    /// Checks that inverse and the leg-by-leg method, which share only the anchor positions, return the
    /// same joints or refusals; returns how often neither refuses.
    fn compare<const N: usize>(rng: &mut Pcg64) -> usize {
        let mut sound = 0;
        for round in 0..400 {
            let screws = random(rng, 0.0, 1.0) < 0.5;
            let machine = struts::<N>(rng, screws);
            let mut value = |size: f64| random(rng, -size, size);
            let tool = Vector3::from_fn(|_, _| value(50.0));
            // Within 45 degrees and far beyond; and so far away that lengths overflow.
            let far = if round % 10 == 0 { 1e75 } else { 900.0 };
            let most = if round % 5 == 0 { 3.0 } else { 0.9 };
            let pose = Pose {
                position: Vector3::new(value(100.0), value(100.0), far),
                angles: Vector3::from_fn(|_, _| value(most)),
            };
            let result = machine.inverse(&pose, &tool);
            let placement =
                machine.placement(&pose, &pose.trigonometry(), &tool).expect("no constraints");
            let expected = machine.joints_at(&placement.place);
            assert_eq!(result.err(), expected.err());
            sound += usize::from(result.is_ok());
            for (quick, expected) in result.iter().flatten().zip(expected.iter().flatten()) {
                // Rounding of lengths of about 1000 (1e-13 each), and of arcs, amplified by up to 1000 for a strut
                // next to its joint axis (1e-3).
                let same = (quick - expected).abs() <= 1e-9 + 1e-15 * expected.abs();
                assert!(same, "{quick} {expected}");
            }
        }
        sound
    }

    #[test]
    fn inverse_gives_plain_machines_the_joints_of_each_leg_for_itself() {
        let mut rng = Pcg64::seed_from_u64(31);
        let sound = compare::<6>(&mut rng) + compare::<8>(&mut rng);
        assert!(sound > 600, "{sound}");
    }
}
