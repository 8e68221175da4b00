// SPDX-License-Identifier: GPL-2.0-or-later
//! Inverse kinematics: pose to joints.

use crate::fault::{Cause, Fault};
use crate::lanes::Lanes3;
use crate::layout::{Joints, MAX_JOINTS, MAX_LEGS, PerLeg};
use crate::leg::Leg;
use crate::machine::{Mechanism, Place, Placed, Segment};
use crate::pose::{Pose, Trigonometry};
use nalgebra::Vector3;

/// A pose with its legs, as inverse and Jacobian see it.
pub(crate) struct Posed<const N: usize> {
    pub trig: Trigonometry,
    pub place: Place,
    /// The reference point in base, legs and table together.
    pub point: Vector3<f64>,
    /// The legs from their base anchors at joint value 0.
    pub placed: Placed<N>,
    pub corrections: [f64; N],
}

impl<const N: usize> Mechanism<N> {
    #[inline(always)]
    pub fn inverse(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Joints, Fault> {
        let posed = self.posed(pose, tool)?;
        let legs = self.joints_of(&posed)?;
        let mut joints = [0.0; MAX_JOINTS];
        for (joint, leg) in joints.iter_mut().zip(&legs).take(self.count()) {
            *joint = *leg;
        }
        let table = joints.iter_mut().skip(self.count()).zip(self.layout.table().as_slice());
        for (joint, letter) in table {
            *joint = posed.point[letter.index().min(2)];
        }
        for (i, joint) in joints.iter().enumerate() {
            if !joint.is_finite() {
                return Err(Fault::of_leg(Cause::ResultNotFinite, i, *joint));
            }
        }
        Ok(joints)
    }

    pub fn corrections(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<PerLeg, Fault> {
        Ok(self.per_leg(&self.posed(pose, tool)?.corrections))
    }

    pub fn segments(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<[Segment; MAX_LEGS], Fault> {
        let posed = self.posed(pose, tool)?;
        let anchors = self.moved_anchors(&self.joints_of(&posed)?)?;
        let mut segments =
            [Segment { base: Vector3::zeros(), platform: Vector3::zeros() }; MAX_LEGS];
        for (i, segment) in segments.iter_mut().enumerate().take(self.count()) {
            *segment = Segment {
                base: anchors.get(i),
                platform: posed.place.centre + posed.placed.arms.get(i),
            };
        }
        Ok(segments)
    }

    /// A pose with its legs; refuses what cannot be one.
    #[inline(always)]
    pub(crate) fn posed(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Posed<N>, Fault> {
        let (pose, trig) = self.checked(pose)?;
        if !(tool.x.is_finite() && tool.y.is_finite() && tool.z.is_finite()) {
            return Err(Cause::ToolNotFinite.into());
        }
        let rotation = trig.rotation();
        let point = self.point(&pose.position, &rotation, tool);
        let place = Place { centre: self.of_legs(point), rotation, angles: pose.angles };
        let (placed, corrections) = self.corrected(&place)?;
        Ok(Posed { trig, place, point, placed, corrections })
    }

    /// Legs from their base anchors at joint value 0, and the nut corrections there.
    #[inline(always)]
    fn corrected(&self, place: &Place) -> Result<(Placed<N>, [f64; N]), Fault> {
        let placed = self.placed(&self.base, place);
        for i in 0..self.count() {
            if self.legs[i] == Leg::Strut {
                self.refuse_short(i, placed.length[i])?;
            }
        }
        let corrections = match &self.nut {
            None => [0.0; N],
            Some(nut) => nut.corrections(&nut.twist(&placed.directions(), &place.rotation)?),
        };
        Ok((placed, corrections))
    }

    /// Joint values of the legs at a place.
    #[inline(always)]
    pub(crate) fn joints_at(&self, place: &Place) -> Result<[f64; N], Fault> {
        let (placed, corrections) = self.corrected(place)?;
        self.leg_joints(&placed, &corrections)
    }

    #[inline(always)]
    pub(crate) fn joints_of(&self, posed: &Posed<N>) -> Result<[f64; N], Fault> {
        self.leg_joints(&posed.placed, &posed.corrections)
    }

    #[inline(always)]
    fn leg_joints(&self, placed: &Placed<N>, corrections: &[f64; N]) -> Result<[f64; N], Fault> {
        let mut joints = [0.0; N];
        for i in 0..N {
            let native = self.legs[i]
                .joint(&placed.span.get(i), placed.length[i])
                .map_err(|(cause, value)| Fault::of_leg(cause, i, value))?;
            joints[i] = native + corrections[i] - self.offset[i];
        }
        Ok(joints)
    }

    /// Where the joints put the moving base anchors.
    #[inline(always)]
    pub(crate) fn moved_anchors(&self, joints: &[f64; N]) -> Result<Lanes3<N>, Fault> {
        Ok(self.target(joints)?.anchors)
    }

    /// Per-leg values for the outside.
    pub(crate) fn per_leg(&self, lanes: &[f64; N]) -> PerLeg {
        let mut out = [0.0; MAX_LEGS];
        for (to, value) in out.iter_mut().zip(lanes).take(self.count()) {
            *to = *value;
        }
        out
    }
}
