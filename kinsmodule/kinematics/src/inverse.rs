// SPDX-License-Identifier: GPL-2.0-or-later
//! Inverse kinematics: pose to joints.

use crate::fault::{Cause, Fault};
use crate::lanes::{Lanes3, are_above, are_finite, both, dot, pair, put};
use crate::layout::{Joints, MAX_JOINTS, MAX_LEGS, PerLeg};
use crate::leg::Leg;
use crate::machine::{Mechanism, Place, Placed, Segment};
use crate::nut::{Nut, Turns};
use crate::pose::{Pose, Trigonometry};
use nalgebra::Vector3;

/// A pose as the legs see it.
pub(crate) struct Stand {
    pub place: Place,
    /// The reference point in base, legs and table together.
    pub point: Vector3<f64>,
}

/// A pose with its legs, as Jacobian and reports see it.
pub(crate) struct Posed<const N: usize> {
    pub trig: Trigonometry,
    pub stand: Stand,
    /// The legs from their base anchors at joint value 0.
    pub placed: Placed<N>,
    pub corrections: [f64; N],
}

impl<const N: usize> Mechanism<N> {
    #[inline(always)]
    pub fn inverse(
        &self,
        pose: &Pose,
        tool: &Vector3<f64>,
        joints: &mut [f64],
    ) -> Result<(), Fault> {
        pose.check()?;
        self.check_tool(tool)?;
        if self.holds || self.moving {
            return self.inverse_of_any(*pose, tool, joints);
        }
        // What remains is done within registers, one pair of struts after the other.
        let stand = self.standing(pose, &pose.trigonometry(), tool);
        let legs = match &self.nut {
            Some(nut) => self.corrected_struts(nut, &stand.place),
            None => self.struts(&stand.place),
        };
        match legs {
            Some(legs) => self.write_joints(&legs, &stand.point, joints),
            None => self.inverse_of_any(*pose, tool, joints),
        }
    }

    /// Joints of struts without nut corrections; `None` where any has no length.
    #[inline(always)]
    fn struts(&self, place: &Place) -> Option<[f64; N]> {
        let mut length = [0.0; N];
        for i in (0..N).step_by(2) {
            let [_, span] = self.leg(&self.base, place, i);
            put(&mut length, i, dot(&span, &span).sqrt());
        }
        are_above(&length, self.least_length()).then(|| self.joints_of_lengths(&length))
    }

    /// Joints of struts with their corrections; `None` where any has no length or no twist.
    #[inline(always)]
    fn corrected_struts(&self, nut: &Nut<N>, place: &Place) -> Option<[f64; N]> {
        let mut length = [0.0; N];
        let mut turns = Turns::ZERO;
        let mut defined = both(0.0).simd_eq(both(0.0));
        for i in (0..N).step_by(2) {
            let [_, span] = self.leg(&self.base, place, i);
            let lengths = dot(&span, &span).sqrt();
            defined &= nut.turn(i, (&span, lengths), &place.rotation, &mut turns);
            put(&mut length, i, lengths);
        }
        let sound = are_above(&length, self.least_length()) && defined.all();
        // A loop of its own: long chains that do not depend on each other overlap.
        for i in (0..N).step_by(2) {
            let corrected = pair(&length, i) + nut.correction(i, &turns);
            put(&mut length, i, corrected);
        }
        sound.then(|| self.joints_of_lengths(&length))
    }

    /// The same for a checked pose and any kind of machine.
    #[inline(never)]
    fn inverse_of_any(
        &self,
        mut pose: Pose,
        tool: &Vector3<f64>,
        joints: &mut [f64],
    ) -> Result<(), Fault> {
        if self.holds {
            pose = self.held(&pose, true)?;
        }
        let stand = self.standing(&pose, &pose.trigonometry(), tool);
        self.write_joints(&self.joints_at(&stand.place)?, &stand.point, joints)
    }

    /// Joint values of legs and table.
    pub(crate) fn all_joints(
        &self,
        legs: &[f64; N],
        point: &Vector3<f64>,
    ) -> Result<Joints, Fault> {
        let mut joints = [0.0; MAX_JOINTS];
        self.write_joints(legs, point, &mut joints)?;
        Ok(joints)
    }

    #[inline(always)]
    fn write_joints(
        &self,
        legs: &[f64; N],
        point: &Vector3<f64>,
        joints: &mut [f64],
    ) -> Result<(), Fault> {
        let table = self.layout.joints() > self.count();
        if !(are_finite(legs) && (!table || (point * 0.0).sum() == 0.0)) {
            return Err(self.not_finite(*legs, *point));
        }
        match joints.first_chunk_mut::<N>() {
            // A copy of known length is no call.
            Some(all) if self.count() == N => *all = *legs,
            _ => self.of_first_legs(*legs, joints),
        }
        if table {
            self.of_table(*point, joints);
        }
        Ok(())
    }

    /// Writes the legs' joints where some lanes have none.
    fn of_first_legs(&self, legs: [f64; N], joints: &mut [f64]) {
        for (joint, leg) in joints.iter_mut().zip(legs).take(self.count()) {
            *joint = leg;
        }
    }

    /// Writes the table's joints behind those of the legs.
    fn of_table(&self, point: Vector3<f64>, joints: &mut [f64]) {
        let table = joints.iter_mut().skip(self.count()).zip(self.layout.table().as_slice());
        for (joint, letter) in table {
            *joint = point[letter.index().min(2)];
        }
    }

    #[cold]
    fn not_finite(&self, legs: [f64; N], point: Vector3<f64>) -> Fault {
        let mut joints = [0.0; MAX_JOINTS];
        self.of_first_legs(legs, &mut joints);
        self.of_table(point, &mut joints);
        let bad = joints.iter().position(|joint| !joint.is_finite()).unwrap_or(0);
        Fault::of_leg(Cause::ResultNotFinite, bad, joints[bad])
    }

    pub fn corrections(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<PerLeg, Fault> {
        Ok(self.per_leg(&self.posed(pose, tool)?.corrections))
    }

    pub fn segments(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<[Segment; MAX_LEGS], Fault> {
        let posed = self.posed(pose, tool)?;
        let anchors = self.moved_anchors(&self.joints_of(&posed)?)?;
        Ok(self.segments_of(&posed, &anchors))
    }

    /// The legs of a pose between their moved base anchors and the platform.
    pub(crate) fn segments_of(&self, posed: &Posed<N>, anchors: &Lanes3<N>) -> [Segment; MAX_LEGS] {
        let mut segments =
            [Segment { base: Vector3::zeros(), platform: Vector3::zeros() }; MAX_LEGS];
        for (i, segment) in segments.iter_mut().enumerate().take(self.count()) {
            *segment = Segment {
                base: anchors.get(i),
                platform: posed.stand.place.centre + posed.placed.arms.get(i),
            };
        }
        segments
    }

    /// Where a pose puts the platform.
    #[inline(always)]
    fn standing(&self, pose: &Pose, trig: &Trigonometry, tool: &Vector3<f64>) -> Stand {
        let rotation = trig.rotation();
        let point = self.point(&pose.position, &rotation, tool);
        Stand { place: Place { centre: self.of_legs(point), rotation, angles: pose.angles }, point }
    }

    /// A pose with its legs.
    pub(crate) fn posed(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Posed<N>, Fault> {
        pose.check()?;
        self.check_tool(tool)?;
        let pose = &if self.holds { self.held(pose, true)? } else { *pose };
        let trig = pose.trigonometry();
        let stand = self.standing(pose, &trig, tool);
        let mut placed = Placed::ZERO;
        let corrections = self.corrected(&stand.place, &mut placed)?;
        Ok(Posed { trig, stand, placed, corrections })
    }

    /// Legs from their base anchors at joint value 0, and the nut corrections there.
    #[inline(always)]
    fn corrected(&self, place: &Place, placed: &mut Placed<N>) -> Result<[f64; N], Fault> {
        self.place(&self.base, place, placed);
        if self.moving {
            self.refuse_short_struts(placed)?;
        } else {
            self.refuse_short_legs(&placed.length)?;
        }
        let Some(nut) = &self.nut else { return Ok([0.0; N]) };
        let twist = nut.twist(&placed.directions(), &place.rotation);
        nut.refuse_along_axis(&twist)?;
        Ok(nut.corrections(&twist))
    }

    /// A rod may start at its platform anchor, a strut may not.
    fn refuse_short_struts(&self, placed: &Placed<N>) -> Result<(), Fault> {
        for i in 0..self.count() {
            if self.legs[i] == Leg::Strut {
                self.refuse_short(i, placed.length[i])?;
            }
        }
        Ok(())
    }

    /// Joint values of the legs at a place.
    #[inline(always)]
    pub(crate) fn joints_at(&self, place: &Place) -> Result<[f64; N], Fault> {
        let mut placed = Placed::ZERO;
        let corrections = self.corrected(place, &mut placed)?;
        self.leg_joints(&placed, &corrections)
    }

    pub(crate) fn joints_of(&self, posed: &Posed<N>) -> Result<[f64; N], Fault> {
        self.leg_joints(&posed.placed, &posed.corrections)
    }

    #[inline(always)]
    fn leg_joints(&self, placed: &Placed<N>, corrections: &[f64; N]) -> Result<[f64; N], Fault> {
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

    /// Joint values of native ones, which are the lengths of struts.
    #[inline(always)]
    fn joints_of_lengths(&self, native: &[f64; N]) -> [f64; N] {
        let mut joints = [0.0; N];
        for i in (0..N).step_by(2) {
            put(&mut joints, i, pair(native, i) - pair(&self.offset, i));
        }
        joints
    }

    /// Native joint values where not all legs are struts.
    fn native_joints(&self, placed: &Placed<N>, joints: &mut [f64; N]) -> Result<(), Fault> {
        for i in 0..N {
            joints[i] = self.legs[i]
                .joint(&placed.span.get(i), placed.length[i])
                .map_err(|(cause, value)| Fault::of_leg(cause, i, value))?;
        }
        Ok(())
    }

    /// Where the joints put the moving base anchors.
    #[inline(always)]
    pub(crate) fn moved_anchors(&self, joints: &[f64; N]) -> Result<Lanes3<N>, Fault> {
        Ok(self.target(joints)?.anchors)
    }

    /// Per-leg values for the outside.
    pub(crate) fn per_leg(&self, lanes: &[f64; N]) -> PerLeg {
        let mut out = [0.0; MAX_LEGS];
        for i in 0..N.min(MAX_LEGS) {
            out[i] = lanes[i] * self.present[i];
        }
        out
    }
}
