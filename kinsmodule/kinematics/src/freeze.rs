// SPDX-License-Identifier: GPL-2.0-or-later
//! From the geometry as given to a machine that cannot be wrong: every check is here,
//! and is made once.

use crate::certificate::{CERTAIN_AT_ALL, flatness};
use crate::fault::{Cause, Fault};
use crate::geometry::Geometry;
use crate::lanes::Lanes3;
use crate::leg::{Leg, LegKind};
use crate::machine::Machine;
use crate::nut::Nut;
use crate::pose::Pose;
use crate::qr::Qr;
use libm::sqrt;
use nalgebra::Vector3;

/// Anchors nearer than this share of the size count as one point.
const SAME_POINT: f64 = 1e-9;

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
        if !size.is_finite() {
            return Err(Fault::with_value(Cause::GeometryNotFinite, size));
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
