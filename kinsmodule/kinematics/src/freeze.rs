// SPDX-License-Identifier: GPL-2.0-or-later
//! Freezes a geometry as given into a checked machine: every check is here and runs once.

use crate::certificate::{CERTAIN_AT_ALL, lipschitz_constant};
use crate::coupling::Couplings;
use crate::fault::{Cause, Fault};
use crate::geometry::{FARTHEST, Geometry};
use crate::lanes::Lanes3;
use crate::layout::{MAX_LEGS, PerLeg};
use crate::leg::{Leg, LegKind, StrutGeometry};
use crate::letters::Letter;
use crate::mechanism::{Chart, Mechanism};
use crate::nut::Nut;
use crate::placed::{Place, Placed};
use crate::pose::Pose;
use crate::pseudo_inverse::PseudoInverse;
use crate::trig::MAX_ANGLE_DEG;
use libm::sqrt;
use nalgebra::{Matrix3, Vector3};

/// Anchors nearer than this share of the size count as one point.
const SAME_POINT: f64 = 1e-9;

/// Largest length: products of ten of them are still within f64's range.
const LONGEST: f64 = 1e30;

/// Input from which a machine is frozen.
pub(crate) struct Frozen<'a> {
    pub geometry: &'a Geometry,
    /// Per leg, in joint units.
    pub offset: &'a PerLeg,
}

impl Frozen<'_> {
    /// Builds the checked machine in N lanes.
    pub fn mechanism<const N: usize>(&self) -> Result<Mechanism<N>, Fault> {
        self.refuse_not_finite()?;
        let layout = *self.geometry.layout();
        let leg = |i: usize| self.geometry.lane(i);
        let base = Lanes3::from_fn(|i| Vector3::from(leg(i).base));
        let centroid = self.centroid();
        let size = self.size()?;
        self.refuse_coincident(size)?;
        let constrained = layout.constraints() > 0;
        let active = core::array::from_fn(|k| {
            constrained || layout.coordinates().as_slice().iter().any(|letter| letter.index() == k)
        });
        let angles = active[3..].iter().filter(|a| **a).count();
        let chart = match angles {
            0 => Chart::Level,
            3 => Chart::Group,
            _ => Chart::Angles,
        };
        let radius = self.radius(&centroid, size, chart)?;
        let whole = active[..3].iter().all(|a| *a);
        let reference = if whole { centroid } else { Vector3::from(self.geometry.centre) };
        let couplings = Couplings::new(self.geometry, (&reference, radius, size))?;
        let equations = layout.legs() + couplings.as_ref().map_or(0, Couplings::count);
        let mut mechanism = Mechanism {
            layout,
            chart,
            active,
            holds: Letter::ALL.iter().any(|letter| layout.is_held(*letter)),
            moving: false,
            legs: [Leg::Strut; N],
            base,
            arms: Lanes3::from_fn(|i| Vector3::from(leg(i).platform) - reference),
            reference,
            offset: core::array::from_fn(|i| *self.offset.get(self.lane(i)).unwrap_or(&0.0)),
            nut: self.nut()?,
            ring: core::array::from_fn(|i| leg(i).kind.ring_radius()),
            slides: false,
            size,
            radius,
            per_radius: 1.0 / radius,
            s1: [0.0; N],
            s2: [0.0; N],
            present: core::array::from_fn(|i| f64::from(u8::from(i < equations))),
            couplings,
        };
        for i in 0..N {
            let checked = leg(i).kind.checked();
            mechanism.legs[i] =
                checked.map_err(|(cause, value)| Fault::of_leg(cause, self.lane(i), value))?;
            mechanism.moving |= !leg(i).kind.stands();
        }
        if let Some(couplings) = &mechanism.couplings {
            couplings.write_anchors(&mut mechanism.base, &mut mechanism.arms);
            for i in layout.legs()..equations.min(N) {
                (mechanism.legs[i], mechanism.ring[i], mechanism.offset[i]) =
                    (Leg::Strut, 0.0, 0.0);
            }
        }
        mechanism.slides = mechanism.ring.iter().any(|radius| *radius > 0.0);
        mechanism.moving |= mechanism.slides;
        self.refuse_far(size)?;
        mechanism.bound_anchors(angles);
        if let Some(home) = self.geometry.home {
            mechanism.settle_at(home)?;
        }
        Ok(mechanism)
    }

    /// Returns the leg whose values lane `i` contains.
    fn lane(&self, i: usize) -> usize {
        if i < self.geometry.layout().legs() { i } else { 0 }
    }

    fn refuse_not_finite(&self) -> Result<(), Fault> {
        for (i, (leg, offset)) in self.geometry.legs().iter().zip(self.offset).enumerate() {
            if !leg.is_finite() || !offset.is_finite() {
                return Err(Fault::of_leg(Cause::GeometryNotFinite, i, 0.0));
            }
        }
        if !self.geometry.centre.iter().all(|v| v.is_finite()) {
            return Err(Cause::CentreNotFinite.into());
        }
        Ok(())
    }

    fn centroid(&self) -> Vector3<f64> {
        let mut centroid = Vector3::zeros();
        for leg in self.geometry.legs() {
            centroid += Vector3::from(leg.platform) / self.geometry.legs().len() as f64;
        }
        centroid
    }

    /// Returns the largest length of all legs; refuses unusable lengths.
    fn size(&self) -> Result<f64, Fault> {
        let mut size = 0.0_f64;
        for (i, leg) in self.geometry.legs().iter().enumerate() {
            let longest = leg.lengths().into_iter().fold(0.0, f64::max);
            let lead = leg.kind.screw().lead.abs();
            if !(longest.max(lead) <= LONGEST) {
                return Err(Fault::of_leg(Cause::LengthTooLarge, i, longest.max(lead)));
            }
            size = size.max(longest);
        }
        Ok(size)
    }

    /// Refuses offsets and distances so large that joints would silently lose precision.
    fn refuse_far(&self, size: f64) -> Result<(), Fault> {
        for (i, (leg, offset)) in self.geometry.legs().iter().zip(self.offset).enumerate() {
            let most = if leg.kind.is_angular() { MAX_ANGLE_DEG } else { FARTHEST * size };
            if !(offset.abs() <= most) {
                return Err(Fault::of_leg(Cause::OffsetTooLarge, i, *offset));
            }
        }
        let away = Vector3::from(self.geometry.centre).amax();
        if !(away <= FARTHEST * size) {
            return Err(Fault::with_value(Cause::CentreTooFar, away));
        }
        Ok(())
    }

    /// Computes the root mean square distance of the platform anchors from their centroid. A ring of radius r,
    /// represented by its center, adds r (r + |b|), b its base anchor: the curvature of its strut grows with the
    /// square of that distance divided by the square of this radius (module `certificate`).
    fn radius(&self, centroid: &Vector3<f64>, size: f64, chart: Chart) -> Result<f64, Fault> {
        let legs = self.geometry.legs();
        let arm = |i: usize| Vector3::from(self.geometry.lane(i).platform) - centroid;
        let ring = |i: usize| self.geometry.lane(i).kind.ring_radius();
        let base = |i: usize| Vector3::from(self.geometry.lane(i).base).norm();
        let square = |i: usize| arm(i).norm_squared() + ring(i) * (ring(i) + base(i));
        let sum = (0..legs.len()).fold(0.0, |sum, i| sum + square(i));
        let radius = sqrt(sum / legs.len() as f64);
        let is_point = !(radius > SAME_POINT * size);
        if chart == Chart::Level {
            return Ok(if is_point { size } else { radius });
        }
        // With all platform anchors on one line, the rotation about that line is free.
        let mut spread = 0.0_f64;
        for i in 0..legs.len() {
            for j in 0..i {
                spread = spread.max(arm(i).cross(&arm(j)).norm());
            }
        }
        // Constraints may prevent it, which is judged at the reference pose.
        if self.geometry.layout().constraints() > 0 {
            return Ok(if is_point { size } else { radius });
        }
        if is_point || (chart == Chart::Group && spread <= SAME_POINT * size * size) {
            return Err(Fault::with_value(Cause::PlatformDegenerate, spread));
        }
        Ok(radius)
    }

    /// Refuses two equal legs, which constrain the same motion twice; for struts that end at points, equal
    /// anchors suffice.
    fn refuse_coincident(&self, size: f64) -> Result<(), Fault> {
        let legs = self.geometry.legs();
        let apart = |a: &[f64; 3], b: &[f64; 3]| (Vector3::from(*a) - Vector3::from(*b)).norm();
        for (i, one) in legs.iter().enumerate() {
            for (j, other) in legs.iter().enumerate().take(i) {
                let same_kind = match (one.kind, other.kind) {
                    (LegKind::Strut(_), LegKind::Strut(_)) => true,
                    (a, b) => a == b,
                };
                let apart =
                    apart(&one.base, &other.base).max(apart(&one.platform, &other.platform));
                if same_kind && apart <= SAME_POINT * size {
                    return Err(Fault::of_legs(Cause::LegsCoincide, [i, j], 0.0));
                }
            }
        }
        Ok(())
    }

    /// Builds the screws if any leg has a lead.
    fn nut<const N: usize>(&self) -> Result<Option<Nut<N>>, Fault> {
        let legs = self.geometry.layout().legs();
        let constrained = self.geometry.layout().constraints() > 0;
        let struts: [_; N] = core::array::from_fn(|i| match constrained && i >= legs {
            true => StrutGeometry::default(),
            false => self.geometry.lane(i).kind.screw(),
        });
        if struts.iter().all(|s| s.lead == 0.0) {
            return Ok(None);
        }
        let nut = Nut::new(
            &struts.map(|s| s.base_axis),
            &struts.map(|s| s.platform_axis),
            &struts.map(|s| s.lead),
        )?;
        Ok(Some(nut))
    }
}

impl<const N: usize> Mechanism<N> {
    /// Bounds the platform anchors' derivatives in the chart with `angles` active angles.
    fn bound_anchors(&mut self, angles: usize) {
        // The axes of two angles are perpendicular: the platform rotates at |ω| = |(α', β')|, and
        // with both axes and their normal as a frame an anchor's second derivative is its arm times
        // [[-β'², 0, 0], [2 α'β', -α'², 0], [0, 0, -1]], α'² + β'² = 1, whose norm is at most (1 + √2)/2.
        let (turn, bend) = match self.chart {
            Chart::Group => (1.0, 1.0),
            Chart::Angles if angles == 1 => (1.0, 1.0),
            Chart::Angles => (1.0, (1.0 + core::f64::consts::SQRT_2) / 2.0),
            Chart::Level => (0.0, 0.0),
        };
        for i in 0..N {
            let arm = match self.rings() {
                Some(rings) => rings.farthest(i),
                None => self.arms.get(i).norm(),
            } / self.radius;
            self.s1[i] = sqrt(1.0 + turn * arm * arm);
            self.s2[i] = bend * arm / self.radius;
        }
        // The lengths of their lanes have no zero to be kept away from.
        if self.couplings().is_some() {
            for i in self.count()..self.equations() {
                (self.s1[i], self.s2[i]) = (0.0, 0.0);
            }
        }
    }

    /// Checks the reference pose and fixes the fold of the nut correction there.
    fn settle_at(&mut self, home: [f64; 6]) -> Result<(), Fault> {
        let place = self.place_of(home)?;
        self.refuse_free_at(&place)
    }

    /// Returns the platform's pose at the reference pose, with the fold fixed there. A separate function, so
    /// that its stack is released before the next step.
    fn place_of(&mut self, home: [f64; 6]) -> Result<Place, Fault> {
        let pose = Pose::from_degrees(home);
        pose.check().map_err(|_| Fault::from(Cause::HomeNotFinite))?;
        let pose = self
            .held(&pose, true)
            .map_err(|fault| Fault::with_value(Cause::HomeHeld, fault.value))?;
        let place = self.placement(&pose, &pose.trigonometry(), &Vector3::zeros())?.place;
        let rotation = place.rotation;
        let placed = self.placed(&self.base, &place);
        for i in 0..self.count() {
            if self.legs[i] == Leg::Strut && self.refuse_short(i, placed.length[i]).is_err() {
                return Err(Fault::of_leg(Cause::StrutZeroAtHome, i, placed.length[i]));
            }
        }
        if let Some(nut) = &mut self.nut
            && let Some(doubt) = nut.fold_at(&placed.directions(), &rotation)?
        {
            return Err(doubt);
        }
        Ok(place)
    }

    /// Fixes the fold of the nut correction at a pose other than a reference pose.
    pub fn fold_at(&mut self, pose: &Pose, tool: &Vector3<f64>) -> Result<Option<Fault>, Fault> {
        let pose = self.held(pose, false)?;
        pose.check()?;
        self.check_tool(tool)?;
        let place = self.placement(&pose, &pose.trigonometry(), tool)?.place;
        let mut placed = Placed::ZERO;
        self.corrected(&place, &mut placed, |_| ())?;
        let Some(nut) = &mut self.nut else { return Ok(None) };
        nut.fold_at(&placed.directions(), &place.rotation)
    }

    /// Returns the legs at a pose without tool, from moving base anchor to platform anchor, and the platform's
    /// orientation.
    pub fn spans_at(&self, pose: &Pose) -> Result<([Vector3<f64>; MAX_LEGS], Matrix3<f64>), Fault> {
        let place = self.placement(pose, &pose.trigonometry(), &Vector3::zeros())?.place;
        let anchors = self.moved_anchors(&self.joints_at(&place)?)?;
        let placed = self.placed(&anchors, &place);
        let mut spans = [Vector3::zeros(); MAX_LEGS];
        for (i, span) in spans.iter_mut().enumerate().take(self.count()) {
            *span = placed.span.get(i);
        }
        Ok((spans, place.rotation))
    }

    /// Computes the legs at a pose from the moving base anchors of its joint values. A separate function, like
    /// [`Self::place_of`].
    fn place_driven(&self, place: &Place, placed: &mut Placed<N>) -> Result<(), Fault> {
        let anchors = self.moved_anchors(&self.joints_at(place)?)?;
        self.place(&anchors, place, placed);
        Ok(())
    }

    /// Refuses a layout whose legs do not constrain the platform at `place`.
    fn refuse_free_at(&self, place: &Place) -> Result<(), Fault> {
        let mut placed = Placed::ZERO;
        self.place_driven(place, &mut placed)?;
        let torsion = self.torsion(&placed.directions(), &place.rotation)?;
        let columns = self.charted_rows(&placed, torsion.as_ref(), place);
        let inverse = PseudoInverse::new(&columns, &self.active).ok_or(Cause::SingularAtHome)?;
        let lipschitz = lipschitz_constant(self, &placed, torsion.as_ref(), &inverse, 0.0, None)?;
        if !(lipschitz * self.size * CERTAIN_AT_ALL < 1.0) {
            return Err(Cause::SingularAtHome.into());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::LegGeometry;
    use crate::letters::Letters;

    /// Platform anchors of struts from far below, at distances 2, 2, 4 and 4 from their center.
    const PLATFORM: [[f64; 3]; 6] = [
        [12.0, 0.0, 7.0],
        [8.0, 0.0, 7.0],
        [10.0, 4.0, 7.0],
        [10.0, -4.0, 7.0],
        [10.0, 0.0, 7.0],
        [10.0, 0.0, 7.0],
    ];

    fn strut(base: [f64; 3], platform: [f64; 3]) -> LegGeometry {
        LegGeometry::strut(base, platform, StrutGeometry::default())
    }

    fn frozen<const N: usize>(
        legs: &[LegGeometry],
        coordinates: &str,
        home: Option<[f64; 6]>,
    ) -> Result<Mechanism<N>, Fault> {
        let letters = Letters::parse(coordinates.as_bytes()).expect("letters");
        let mut geometry = Geometry::new(legs, letters, Letters::NONE).expect("a layout");
        geometry.home = home;
        Frozen { geometry: &geometry, offset: &PerLeg::default() }.mechanism()
    }

    /// Returns struts to these platform anchors; the base of the last one is 1030.8 from the origin.
    fn struts_to(platform: [[f64; 3]; 6]) -> [LegGeometry; 6] {
        core::array::from_fn(|i| {
            strut([100.0 * i as f64, -30.0 * (i * i) as f64, -500.0], platform[i])
        })
    }

    #[test]
    fn bounds_of_the_anchors_are_those_of_the_chart_at_numbers_by_hand() {
        // A radius of √((4 + 4 + 16 + 16)/6); the axis of one of two angles rotates with the other.
        let radius_squared = 40.0 / 6.0;
        for (coordinates, turns, bends) in [
            ("XYZABC", 1.0, 1.0),
            ("XYZAB", 1.0, 1.207_106_781_186_547_5),
            ("XYZB", 1.0, 1.0),
            ("XYZ", 0.0, 0.0),
        ] {
            let machine = frozen::<6>(&struts_to(PLATFORM), coordinates, None).expect("a machine");
            // A few roundings of numbers below 10.
            assert!((machine.radius * machine.radius - radius_squared).abs() < 1e-14);
            for (i, arm) in [2.0, 2.0, 4.0, 4.0, 0.0, 0.0].into_iter().enumerate() {
                let s1 = sqrt(1.0 + turns * arm * arm / radius_squared);
                let s2 = bends * arm / radius_squared;
                assert!((machine.s1[i] - s1).abs() < 1e-14, "{coordinates} {i}");
                assert!((machine.s2[i] - s2).abs() < 1e-14, "{coordinates} {i}");
            }
        }
    }

    #[test]
    fn lanes_without_a_leg_repeat_the_first_and_are_marked() {
        let machine = frozen::<6>(&struts_to(PLATFORM)[..5], "XYZAB", None).expect("a machine");
        assert_eq!(machine.present, [1.0, 1.0, 1.0, 1.0, 1.0, 0.0]);
        assert_eq!(machine.base.get(5), machine.base.get(0));
        assert_ne!(machine.base.get(4), machine.base.get(0));
    }

    #[test]
    fn rows_of_lanes_without_a_leg_and_columns_that_are_not_active_are_zero() {
        fn columns<const N: usize>(legs: &[LegGeometry], coordinates: &str) -> [[f64; N]; 6] {
            let machine = frozen::<N>(legs, coordinates, None).expect("a machine");
            let (rotation, angles) = (nalgebra::Matrix3::identity(), Vector3::zeros());
            let place = Place { centre: Vector3::zeros(), rotation, angles };
            machine.charted_rows(&machine.placed(&machine.base, &place), None, &place)
        }
        let six = struts_to(PLATFORM);
        let seven = core::array::from_fn::<_, 7, _>(|i| match i {
            6 => strut([-200.0, 300.0, -500.0], [9.0, 1.0, 6.0]),
            _ => six[i],
        });
        for column in columns::<8>(&seven, "XYZABC") {
            assert!(column[..7].iter().any(|v| *v != 0.0) && column[7] == 0.0, "{column:?}");
        }
        for (k, column) in columns::<6>(&six, "XYZAB").iter().enumerate() {
            assert_eq!(column.iter().any(|v| *v != 0.0), k < 5, "{k}: {column:?}");
        }
    }

    #[test]
    fn a_platform_whose_anchors_are_a_line_or_a_point_is_refused_where_it_would_turn() {
        let degenerate = |spread| Err(Fault::with_value(Cause::PlatformDegenerate, spread));
        let on_a_line = |off: f64| {
            let anchor = |i: usize| [10.0 * i as f64, if i == 2 { off } else { 0.0 }, 0.0];
            frozen::<6>(&struts_to(core::array::from_fn(anchor)), "XYZABC", None).map(|_| ())
        };
        assert_eq!(on_a_line(0.0), degenerate(0.0));
        // The largest parallelogram of the anchors is 21.7 times this; the limit is 1e-9 · 1030.8².
        assert!(on_a_line(4e-5).is_err_and(|fault| fault.cause == Cause::PlatformDegenerate));
        assert_eq!(on_a_line(6e-5), Ok(()));
        let points = |apart: f64, coordinates: &str| {
            let anchor = |i: usize| [if i == 0 { apart } else { 0.0 }, 0.0, 0.0];
            frozen::<6>(&struts_to(core::array::from_fn(anchor)), coordinates, None)
        };
        let turning = |apart| points(apart, "XYZB").map(|_| ());
        assert_eq!(turning(0.0), degenerate(0.0));
        // One of six anchors differs from the others: a radius of √5/6 of that; the limit is 1e-9 · 1030.8.
        assert!(turning(2e-6).is_err_and(|fault| fault.cause == Cause::PlatformDegenerate));
        assert_eq!(turning(4e-6), Ok(()));
        // A platform that never rotates needs no radius; its size is used instead.
        let level = points(2e-6, "XYZ").expect("a machine");
        assert_eq!(level.radius, level.size);
        let level = points(4e-6, "XYZ").expect("a machine");
        // A few roundings of a number below 1e-5.
        assert!((level.radius - sqrt(5.0) / 6.0 * 4e-6).abs() < 1e-20, "{}", level.radius);
    }

    #[test]
    fn legs_nearer_than_a_billionth_of_the_machine_are_one() {
        let apart = |by: f64| {
            let mut legs = PLATFORM
                .map(|platform| strut([platform[0] * 9.0, platform[1] * 9.0, -500.0], platform));
            legs[4] = legs[1];
            legs[4].platform[1] += by;
            legs[5].base[0] += 100.0;
            frozen::<6>(&legs, "XYZABC", None).map(|_| ())
        };
        // Slightly more than 500 to the farthest anchor.
        assert_eq!(apart(4e-7), Err(Fault::of_legs(Cause::LegsCoincide, [4, 1], 0.0)));
        assert_eq!(apart(6e-7), Ok(()));
    }

    #[test]
    fn a_home_so_near_to_a_singular_pose_that_nothing_is_certain_is_refused() {
        // Three struts to one point, which they no longer constrain if it is in their plane.
        let at = |height: f64| {
            let bases = [[500.0, 0.0, 0.0], [-250.0, 433.0, 0.0], [-250.0, -433.0, 0.0]];
            let home = Some([0.0, 0.0, height, 0.0, 0.0, 0.0]);
            frozen::<4>(&bases.map(|base| strut(base, [0.0; 3])), "XYZ", home).map(|_| ())
        };
        // ‖J⁻¹‖ is 500/(√3 · height), √Σk² is √3/500: 1/height; the limit is 1e-6 of 500.
        assert_eq!(at(4e-4), Err(Cause::SingularAtHome.into()));
        assert_eq!(at(6e-4), Ok(()));
    }
}
