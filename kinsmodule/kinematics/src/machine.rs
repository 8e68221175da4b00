// SPDX-License-Identifier: GPL-2.0-or-later
//! The checked, frozen machine: everything a call needs, computed once.

use crate::certificate::{CERTAIN_AT_ALL, flatness};
use crate::fault::{Cause, Fault};
use crate::geometry::Geometry;
use crate::lanes::Lanes3;
use crate::leg::{Leg, LegKind};
use crate::nut::{Nut, Twist};
use crate::pose::Pose;
use crate::qr::Qr;
use libm::sqrt;
use nalgebra::{Matrix3, Vector3};

/// Anchors nearer than this share of the size count as one point.
const SAME_POINT: f64 = 1e-9;

/// Shortest leg that still has a direction, as a share of the size.
const MIN_LENGTH: f64 = 1e-6;

/// A parallel machine of N legs, checked by [`Machine::freeze`].
#[derive(Clone, Debug, PartialEq)]
pub struct Machine<const N: usize> {
    pub(crate) legs: [Leg; N],
    /// Base anchors in base.
    pub(crate) base: Lanes3<N>,
    /// Platform anchors about their centroid: the reference point of all solvers, so
    /// that a long tool does not weaken the certificate.
    pub(crate) arms: Lanes3<N>,
    /// Centroid of the platform anchors in the platform frame.
    pub(crate) centroid: Vector3<f64>,
    /// Joint = native value + correction − offset.
    pub(crate) offset: [f64; N],
    pub(crate) nut: Option<Nut<N>>,
    /// Largest anchor distance from its frame's origin.
    pub(crate) size: f64,
    /// Root mean square of the arms' lengths.
    pub(crate) radius: f64,
    /// Per leg √(1 + (|arm|/radius)²): bound of the platform anchor's speed.
    pub(crate) s1: [f64; N],
    /// Per leg |arm|/radius²: bound of the platform anchor's second derivative.
    pub(crate) s2: [f64; N],
}

/// The legs at one place of the platform.
pub(crate) struct Placed<const N: usize> {
    /// Arms in base (R times the platform anchor about the centroid).
    pub arms: Lanes3<N>,
    /// From moving base anchor to platform anchor.
    pub span: Lanes3<N>,
    pub length: [f64; N],
}

impl<const N: usize> Placed<N> {
    /// Unit vectors along the legs, base to platform.
    #[inline]
    pub fn directions(&self) -> Lanes3<N> {
        let mut inverse = [0.0; N];
        for i in 0..N {
            inverse[i] = 1.0 / self.length[i];
        }
        self.span.scaled(&inverse)
    }
}

impl<const N: usize> Machine<N> {
    /// Checks a geometry and computes what stays constant.
    ///
    /// `offset` is in joint units, one per leg (0 for a joint that reads its native
    /// value). Work is bounded: no loop depends on the values.
    ///
    /// # Errors
    /// A [`Fault`] with a cause of the geometry group, naming the leg.
    pub fn freeze(geometry: &Geometry<N>, offset: &[f64; N]) -> Result<Self, Fault> {
        for (i, (leg, offset)) in geometry.legs.iter().zip(offset).enumerate() {
            if !leg.is_finite() || !offset.is_finite() {
                return Err(Fault::of_leg(Cause::GeometryNotFinite, i, 0.0));
            }
        }
        let base = Lanes3::from_fn(|i| Vector3::from(geometry.legs[i].base));
        let platform = Lanes3::from_fn(|i| Vector3::from(geometry.legs[i].platform));
        let mut centroid = Vector3::zeros();
        let mut size = 0.0_f64;
        for i in 0..N {
            centroid += platform.get(i) / N as f64;
            size = size.max(base.get(i).norm()).max(platform.get(i).norm());
        }
        if !(size > 0.0 && size.is_finite()) {
            return Err(Fault::with_value(Cause::PlatformDegenerate, size));
        }
        refuse_coincident(&base, &platform, size)?;
        let arms = Lanes3::from_fn(|i| platform.get(i) - centroid);
        refuse_collinear(&arms, size)?;
        let radius = sqrt(arms.dot(&arms).iter().sum::<f64>() / N as f64);
        let mut machine = Self {
            legs: geometry.legs.map(|leg| match leg.kind {
                LegKind::Strut(_) => Leg::Strut,
            }),
            base,
            arms,
            centroid,
            offset: *offset,
            nut: nut_of(geometry)?,
            size,
            radius,
            s1: [0.0; N],
            s2: [0.0; N],
        };
        for i in 0..N {
            let arm = arms.get(i).norm();
            machine.s1[i] = sqrt(1.0 + (arm / radius) * (arm / radius));
            machine.s2[i] = arm / (radius * radius);
        }
        if let Some(home) = geometry.home {
            machine.settle_at(home)?;
        }
        Ok(machine)
    }

    /// Largest distance of an anchor from the origin of its frame: what relative
    /// tolerances refer to. Machine units.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Root mean square distance of the platform anchors from their centroid: turns
    /// an angle into a length in pose distances. Machine units.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Place of the centroid in base for a pose with rotation `r`.
    ///
    /// P = t − o + R (o + centroid): the tool o changes nothing while R = 1.
    #[inline]
    pub(crate) fn centre(
        &self,
        position: &Vector3<f64>,
        r: &Matrix3<f64>,
        tool: &Vector3<f64>,
    ) -> Vector3<f64> {
        position - tool + r * (tool + self.centroid)
    }

    /// Legs between `anchors` (moving base anchors) and the platform at centre and rotation.
    #[inline]
    pub(crate) fn placed(
        &self,
        anchors: &Lanes3<N>,
        centre: &Vector3<f64>,
        r: &Matrix3<f64>,
    ) -> Result<Placed<N>, Fault> {
        let arms = self.arms.rotated(r);
        let span = arms.shifted_minus(centre, anchors);
        let mut length = span.dot(&span);
        for l in &mut length {
            *l = sqrt(*l);
        }
        let shortest = MIN_LENGTH * self.size;
        for (i, l) in length.iter().enumerate() {
            if !(*l > shortest) {
                return Err(Fault::of_leg(Cause::StrutTooShort, i, *l));
            }
        }
        Ok(Placed { arms, span, length })
    }

    /// Twist of every leg, if any leg has a lead.
    #[inline]
    pub(crate) fn twist(&self, n: &Lanes3<N>, r: &Matrix3<f64>) -> Result<Option<Twist<N>>, Fault> {
        self.nut.as_ref().map(|nut| nut.twist(n, r)).transpose()
    }

    /// Rows of the length constraints at a place of the platform: one column per lane
    /// array, linear part first, about the centroid; the last three per radian.
    #[inline]
    pub(crate) fn rows(
        &self,
        placed: &Placed<N>,
        n: &Lanes3<N>,
        twist: Option<&Twist<N>>,
    ) -> [[f64; N]; 6] {
        let mut force = *n;
        let mut moment = Lanes3::ZERO;
        if let (Some(nut), Some(twist)) = (&self.nut, twist) {
            let rates = nut.rates(twist, n, &placed.length);
            for i in 0..N {
                force.set(i, n.get(i) + rates.along.get(i));
            }
            moment = rates.moment;
        }
        let lever = placed.arms.cross(&force);
        for i in 0..N {
            moment.set(i, moment.get(i) + lever.get(i));
        }
        [force.x, force.y, force.z, moment.x, moment.y, moment.z]
    }

    /// Checks the reference pose and fixes the fold of the nut correction there.
    fn settle_at(&mut self, home: [f64; 6]) -> Result<(), Fault> {
        let pose = Pose::from_degrees(home);
        pose.check().map_err(|_| Fault::from(Cause::HomeNotFinite))?;
        let r = pose.rotation();
        let centre = self.centre(&pose.position, &r, &Vector3::zeros());
        let placed = self
            .placed(&self.base, &centre, &r)
            .map_err(|fault| Fault { cause: Cause::StrutZeroAtHome, ..fault })?;
        let n = placed.directions();
        if let Some(nut) = &mut self.nut {
            nut.fold_at(&n, &r)?;
        }
        let twist = self.twist(&n, &r)?;
        let columns = self.scaled(self.rows(&placed, &n, twist.as_ref()));
        let qr = Qr::new(&columns).ok_or(Cause::SingularAtHome)?;
        let flat = flatness(self, &placed, twist.as_ref(), &qr, 0.0)?;
        if !(flat * self.size * CERTAIN_AT_ALL < 1.0) {
            return Err(Cause::SingularAtHome.into());
        }
        Ok(())
    }

    /// The angular columns per unit of radius·angle instead of per radian.
    #[inline]
    pub(crate) fn scaled(&self, mut columns: [[f64; N]; 6]) -> [[f64; N]; 6] {
        let inverse = 1.0 / self.radius;
        for column in &mut columns[3..] {
            for value in column {
                *value *= inverse;
            }
        }
        columns
    }
}

/// The screws, if any leg has a lead.
fn nut_of<const N: usize>(geometry: &Geometry<N>) -> Result<Option<Nut<N>>, Fault> {
    let struts = geometry.legs.map(|leg| {
        let LegKind::Strut(strut) = leg.kind;
        strut
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

/// Two legs between the same points constrain the same motion twice.
fn refuse_coincident<const N: usize>(
    base: &Lanes3<N>,
    platform: &Lanes3<N>,
    size: f64,
) -> Result<(), Fault> {
    for i in 0..N {
        for j in 0..i {
            let apart =
                (base.get(i) - base.get(j)).norm().max((platform.get(i) - platform.get(j)).norm());
            if apart <= SAME_POINT * size {
                return Err(Fault::of_leg(Cause::LegsCoincide, i, j as f64));
            }
        }
    }
    Ok(())
}

/// Platform anchors on one line leave the rotation about that line free.
fn refuse_collinear<const N: usize>(arms: &Lanes3<N>, size: f64) -> Result<(), Fault> {
    let mut spread = 0.0_f64;
    for i in 0..N {
        for j in 0..i {
            spread = spread.max(arms.get(i).cross(&arms.get(j)).norm());
        }
    }
    if spread <= SAME_POINT * size * size {
        return Err(Fault::with_value(Cause::PlatformDegenerate, spread));
    }
    Ok(())
}
