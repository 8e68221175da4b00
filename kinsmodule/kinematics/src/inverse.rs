// SPDX-License-Identifier: GPL-2.0-or-later
//! Inverse kinematics: pose to joints.

use crate::fault::{Cause, Fault};
use crate::machine::{Machine, Placed};
use crate::pose::Pose;
use nalgebra::{Matrix3, Vector3};

/// What inverse knows beside the joints.
struct Posed<const N: usize> {
    placed: Placed<N>,
    corrections: [f64; N],
}

impl<const N: usize> Machine<N> {
    /// Joint values of a pose, in joint units (struts: length).
    ///
    /// `tool` is the vector o in machine units: tool offsets x and y, and the sum of
    /// spindle and tool offset in z. It changes no joint at A = B = C = 0
    /// (P = t − o + R o, as genhexkins has it).
    ///
    /// # Errors
    /// A [`Fault`] of the pose group; nothing is returned in part.
    pub fn inverse(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<[f64; N], Fault> {
        pose.check()?;
        self.joints_at(&pose.position, &pose.rotation(), tool)
    }

    /// Length corrections of a pose by nut rotation, machine units; zeros without a lead.
    ///
    /// # Errors
    /// As [`Machine::inverse`].
    pub fn corrections(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<[f64; N], Fault> {
        pose.check()?;
        Ok(self.posed(&pose.position, &pose.rotation(), tool)?.corrections)
    }

    /// Unit vectors along the legs in base, from base to platform anchor.
    ///
    /// # Errors
    /// As [`Machine::inverse`].
    pub fn directions(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<[Vector3<f64>; N], Fault> {
        pose.check()?;
        let posed = self.posed(&pose.position, &pose.rotation(), tool)?;
        let n = posed.placed.directions();
        Ok(core::array::from_fn(|i| n.get(i)))
    }

    /// [`Machine::inverse`] of a checked pose whose rotation is known.
    #[inline]
    pub(crate) fn joints_at(
        &self,
        position: &Vector3<f64>,
        r: &Matrix3<f64>,
        tool: &Vector3<f64>,
    ) -> Result<[f64; N], Fault> {
        let Posed { placed, corrections } = self.posed(position, r, tool)?;
        let mut joints = [0.0; N];
        for i in 0..N {
            let native = self.legs[i]
                .joint(&placed.span.get(i), placed.length[i])
                .map_err(|cause| Fault::of_leg(cause, i, placed.length[i]))?;
            joints[i] = native + corrections[i] - self.offset[i];
        }
        for (i, joint) in joints.iter().enumerate() {
            if !joint.is_finite() {
                return Err(Fault::of_leg(Cause::ResultNotFinite, i, *joint));
            }
        }
        Ok(joints)
    }

    #[inline]
    fn posed(
        &self,
        position: &Vector3<f64>,
        r: &Matrix3<f64>,
        tool: &Vector3<f64>,
    ) -> Result<Posed<N>, Fault> {
        if !(tool.x.is_finite() && tool.y.is_finite() && tool.z.is_finite()) {
            return Err(Cause::ToolNotFinite.into());
        }
        let centre = self.centre(position, r, tool);
        let placed = self.placed(&self.base, &centre, r)?;
        let corrections = match &self.nut {
            None => [0.0; N],
            Some(nut) => nut.corrections(&nut.twist(&placed.directions(), r)?),
        };
        Ok(Posed { placed, corrections })
    }
}
