// SPDX-License-Identifier: GPL-2.0-or-later
//! Inverse kinematics: pose to joints.

use crate::fault::{Cause, Fault};
use crate::geometry::HUGE;
use crate::lanes::{Lanes3, are_finite, between, both, dot, pair, put};
use crate::layout::{Joints, MAX_JOINTS, MAX_LEGS, PerLeg};
use crate::leg::Leg;
use crate::mechanism::Mechanism;
use crate::nut::{Nut, Torsion, Turns};
use crate::placed::{Place, Placed};
use crate::pose::{FLAT, Pose, Trigonometry};
use nalgebra::Vector3;

/// A pose as the legs see it.
pub(crate) struct Placement {
    pub place: Place,
    /// The reference point in base, legs and table together.
    pub point: Vector3<f64>,
}

impl Placement {
    /// Level, at the origin.
    pub const LEVEL: Self = Self { place: Place::LEVEL, point: Vector3::new(0.0, 0.0, 0.0) };
}

impl<const N: usize> Mechanism<N> {
    #[inline(always)]
    pub fn inverse(
        &self,
        pose: &Pose,
        tool: &Vector3<f64>,
        joints: &mut [f64],
    ) -> Result<(), Fault> {
        if self.plain && (pose.within(FLAT) & self.within_reach(tool)).all() {
            // Registers: one pair of struts after the other is computed without memory.
            let rotation = pose.flat_trigonometry().rotation();
            let centre = self.point(&pose.position, &rotation, tool);
            let place = Place { rotation, centre, angles: pose.angles };
            let struts = self.lengths(&place);
            if let (Some(struts), Some(joints)) = (struts, joints.first_chunk_mut::<N>()) {
                *joints = self.joints_of_lengths(&struts);
                return Ok(());
            }
        }
        // Copies: registers, see `lanes`.
        let (pose, tool) = (*pose, *tool);
        if self.plain {
            return self.inverse_of_unchecked(pose, tool, joints);
        }
        // Other machines are always here: checked while pose and tool are in registers.
        pose.check()?;
        self.check_tool(&tool)?;
        self.inverse_of_any(pose, tool, joints)
    }

    /// Lengths of struts, nut corrections included; `None` where the general way has to tell.
    #[inline(always)]
    fn lengths(&self, place: &Place) -> Option<[f64; N]> {
        match &self.nut {
            Some(nut) => self.corrected_struts(nut, place),
            None => self.struts(place),
        }
    }

    /// Lengths of struts without nut corrections; `None` where any has none, or a huge one.
    #[inline(always)]
    fn struts(&self, place: &Place) -> Option<[f64; N]> {
        let mut length = [0.0; N];
        for i in (0..N).step_by(2) {
            let [_, span] = self.leg(&self.base, place, i);
            put(&mut length, i, dot(&span, &span).sqrt());
        }
        between(&length, self.least_length(), HUGE).all().then_some(length)
    }

    /// Lengths of struts with their corrections; `None` as well where any has no torsion, or a large
    /// one.
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
        // A loop of its own: overlap, see `lanes`.
        for i in (0..N).step_by(2) {
            let (correction, known) = nut.correction(i, &turns);
            sound &= known;
            let corrected = pair(&length, i) + correction;
            put(&mut length, i, corrected);
        }
        sound.all().then_some(length)
    }

    /// The same for a pose that is not flat, or has something wrong with it.
    #[inline(never)]
    fn inverse_of_unchecked(
        &self,
        pose: Pose,
        tool: Vector3<f64>,
        joints: &mut [f64],
    ) -> Result<(), Fault> {
        pose.check()?;
        self.check_tool(&tool)?;
        self.inverse_of_any(pose, tool, joints)
    }

    /// The same for any checked pose and any kind of machine.
    #[inline(never)]
    fn inverse_of_any(
        &self,
        mut pose: Pose,
        tool: Vector3<f64>,
        joints: &mut [f64],
    ) -> Result<(), Fault> {
        if self.holds {
            pose = self.held(&pose, true)?;
        }
        let placement = self.placement(&pose, &pose.trigonometry(), &tool);
        let struts = if self.moving { None } else { self.lengths(&placement.place) };
        let legs = match struts {
            Some(struts) => self.joints_of_lengths(&struts),
            None => self.joints_at(&placement.place)?,
        };
        self.write_joints(&legs, &placement.point, joints)
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
            // Known length, see `lanes`.
            Some(all) if self.count() == N => *all = *legs,
            _ => self.of_first_legs(*legs, joints),
        }
        if table {
            self.of_table(*point, joints);
        }
        Ok(())
    }

    /// Writes the legs' joints.
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
        Fault::of_joint(Cause::ResultNotFinite, &self.layout, bad, joints[bad])
    }

    /// Where a pose puts the platform.
    #[inline(always)]
    pub(crate) fn placement(
        &self,
        pose: &Pose,
        trig: &Trigonometry,
        tool: &Vector3<f64>,
    ) -> Placement {
        let rotation = trig.rotation();
        let point = self.point(&pose.position, &rotation, tool);
        Placement {
            place: Place { centre: self.of_legs(point), rotation, angles: pose.angles },
            point,
        }
    }

    /// Legs from their base anchors at joint value 0, and the nut corrections there; hands over the
    /// torsion that they come from.
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

    /// A rod may start at its platform anchor, a strut may not.
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

    /// Joint values of the legs at a place.
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

    /// Struts between random anchors, with screws or without.
    fn struts<const N: usize>(
        rng: &mut Pcg64,
        (count, screws): (usize, bool),
        [coordinates, table]: [&[u8]; 2],
    ) -> Mechanism<N> {
        let mut vector = |size: f64| core::array::from_fn(|_| random(rng, -size, size));
        let legs: [_; N] = core::array::from_fn(|_| {
            let lead = if screws { 10.0 } else { 0.0 };
            let (base_axis, platform_axis) = (vector(1.0), vector(1.0));
            let screw = StrutGeometry { base_axis, platform_axis, lead };
            LegGeometry::strut(vector(500.0), vector(200.0), screw)
        });
        let [coordinates, table] = [coordinates, table].map(|text| Letters::parse(text).unwrap());
        let mut geometry = Geometry::new(&legs[..count], coordinates, table).unwrap();
        let offset = core::array::from_fn(|i| 10.0 * i as f64);
        let frozen = |geometry: &Geometry| Frozen { geometry, offset: &offset }.mechanism();
        // Corrections fold as a home says, or as the arcsin does where there is none.
        let home = random(rng, 0.0, 1.0) < 0.5;
        geometry.home = home.then_some([0.0, 0.0, 900.0, 0.0, 0.0, 0.0]);
        let settled = frozen(&geometry);
        geometry.home = None;
        settled.or_else(|_| frozen(&geometry)).expect("a machine")
    }

    /// Six of them that move everything.
    fn hexapod(rng: &mut Pcg64, screws: bool) -> Mechanism<6> {
        struts(rng, (6, screws), [b"XYZABC", b""])
    }

    /// The joints of inverse and those of the leg by leg way, which shares nothing with the quick
    /// one but the anchors' places, say the same; how often they say that nothing is wrong.
    fn compare<const N: usize>(rng: &mut Pcg64) -> usize {
        let mut sound = 0;
        for round in 0..400 {
            let screws = random(rng, 0.0, 1.0) < 0.5;
            let machine = struts::<N>(rng, (N, screws), [b"XYZABC", b""]);
            let mut value = |size: f64| random(rng, -size, size);
            let tool = Vector3::from_fn(|_, _| value(50.0));
            // Within 45 degrees and far beyond; and so far away that lengths are not known.
            let far = if round % 10 == 0 { 1e75 } else { 900.0 };
            let most = if round % 5 == 0 { 3.0 } else { 0.9 };
            let pose = Pose {
                position: Vector3::new(value(100.0), value(100.0), far),
                angles: Vector3::from_fn(|_, _| value(most)),
            };
            let mut quick = [f64::NAN; N];
            let result = machine.inverse(&pose, &tool, &mut quick);
            let placement = machine.placement(&pose, &pose.trigonometry(), &tool);
            let expected = machine.joints_at(&placement.place);
            assert_eq!(result.err(), expected.err());
            sound += usize::from(result.is_ok());
            for (quick, expected) in quick.into_iter().zip(expected.unwrap_or(quick)) {
                // Roundings of lengths of some 1000 (1e-13 each), and of arcs that a strut next
                // to its joint axis (1e-3) makes 1000 times as large.
                let same = (quick - expected).abs() <= 1e-9 + 1e-15 * expected.abs();
                // What is refused is left alone.
                assert!(if result.is_ok() { same } else { quick.is_nan() }, "{quick} {expected}");
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

    #[test]
    fn a_slice_too_short_for_all_joints_gets_the_first_ones() {
        let machine = hexapod(&mut Pcg64::seed_from_u64(33), false);
        let pose = Pose { position: Vector3::new(0.0, 0.0, 900.0), angles: Vector3::zeros() };
        let (mut all, mut some) = ([0.0; 6], [0.0; 4]);
        machine.inverse(&pose, &Vector3::zeros(), &mut all).unwrap();
        machine.inverse(&pose, &Vector3::zeros(), &mut some).unwrap();
        assert_eq!(all[..4], some);
    }

    #[test]
    fn only_struts_that_move_all_coordinates_are_plain() {
        let mut rng = Pcg64::seed_from_u64(32);
        let mut is_plain = |letters| struts::<6>(&mut rng, (6, false), letters).plain;
        assert!(is_plain([b"XYZABC", b""]));
        assert!(!is_plain([b"XYZAB", b""]));
        assert!(!is_plain([b"YZABC", b"X"]));
        // A lane that is no leg has no joint.
        let mut is_plain = |count| struts::<8>(&mut rng, (count, false), [b"XYZABC", b""]).plain;
        assert!(is_plain(8) && !is_plain(7));
    }
}
