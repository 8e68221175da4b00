// SPDX-License-Identifier: GPL-2.0-or-later
//! Residuals of the legs at a place of the platform: what the searches drive to zero.

use crate::certificate::Motion;
use crate::fault::{Cause, Fault};
use crate::lanes::{Lanes3, are_above, are_finite, inner, pair, put};
use crate::layout::Joints;
use crate::machine::{Chart, Displacement, Mechanism, Place, Placed};
use crate::nut::Twist;
use crate::pose::{Pose, cayley_change};
use crate::qr::Qr;
use libm::sqrt;
use nalgebra::{Matrix3, Vector3};

/// Joints turned into what the solver sees: moving base anchors and target lengths.
pub(crate) struct Target<const N: usize> {
    pub anchors: Lanes3<N>,
    pub(super) length: [f64; N],
    pub(super) joints: [f64; N],
}

impl<const N: usize> Target<N> {
    /// To be filled in by [`Mechanism::aim`].
    #[inline(always)]
    pub(super) fn of(joints: [f64; N]) -> Self {
        Self { anchors: Lanes3::ZERO, length: [0.0; N], joints }
    }
}

/// Residuals at a place, with what the rows need.
#[derive(Clone, Copy)]
pub(crate) struct Measured<const N: usize> {
    pub placed: Placed<N>,
    /// Means something on machines with a nut only.
    pub(super) twist: Twist<N>,
    pub(super) residual: [f64; N],
}

impl<const N: usize> Measured<N> {
    pub(super) const ZERO: Self =
        Self { placed: Placed::ZERO, twist: Twist::ZERO, residual: [0.0; N] };
}

/// A factored place, about which the chart is laid.
pub(super) struct Stance<const N: usize> {
    pub(super) place: Place,
    pub(super) at: Measured<N>,
    pub(super) qr: Qr<N>,
}

impl<const N: usize> Stance<N> {
    /// To be measured and factored.
    #[inline(always)]
    pub(super) fn new(place: Place) -> Self {
        Self { place, at: Measured::ZERO, qr: Qr::ZERO }
    }
}

/// Where a search has come to.
pub(super) struct End<const N: usize> {
    pub(super) place: Place,
    pub(super) at: Measured<N>,
}

impl<const N: usize> Mechanism<N> {
    /// Joint values of the legs; lanes beyond the last leg repeat the first one.
    #[inline(always)]
    pub(super) fn lanes_of(&self, joints: &Joints) -> [f64; N] {
        let mut lanes = *joints.first_chunk::<N>().unwrap_or(&[f64::NAN; N]);
        for lane in lanes.iter_mut().skip(self.count()) {
            *lane = joints[0];
        }
        lanes
    }

    /// Moving base anchors and target lengths of the joints: from here on no leg kind exists.
    pub(crate) fn target(&self, joints: &[f64; N]) -> Result<Target<N>, Fault> {
        let mut target = Target::of(*joints);
        self.aim(&mut target)?;
        Ok(target)
    }

    /// Fills a target in for its joints.
    #[inline(always)]
    pub(super) fn aim(&self, target: &mut Target<N>) -> Result<(), Fault> {
        target.anchors = self.base;
        for i in (0..N).step_by(2) {
            put(&mut target.length, i, pair(&target.joints, i) + pair(&self.offset, i));
        }
        if !self.moving && are_above(&target.length, 0.0) && are_finite(&target.length) {
            return Ok(());
        }
        self.drive(target)
    }

    /// The same leg by leg, each as its kind has it; names the one that refuses.
    pub(super) fn drive(&self, target: &mut Target<N>) -> Result<(), Fault> {
        for i in 0..N {
            let joint = target.joints[i];
            if !joint.is_finite() {
                return Err(Fault::of_leg(Cause::JointNotFinite, i, joint));
            }
            let drive = self.legs[i]
                .drive(joint + self.offset[i])
                .map_err(|cause| Fault::of_leg(cause, i, joint))?;
            target.anchors.set(i, self.base.get(i) + drive.displacement);
            target.length[i] = drive.length;
        }
        Ok(())
    }

    /// How the legs move between two targets; `None` where all are struts.
    #[inline]
    pub(super) fn motion(&self, from: &Target<N>, to: &Target<N>) -> Option<Motion<N>> {
        if !self.moving {
            return None;
        }
        let chord = |i: usize| to.anchors.get(i) - from.anchors.get(i);
        let mut shift = Vector3::zeros();
        // With nut corrections the platform stays: they would change along the way.
        if self.nut.is_none() {
            for i in 0..self.count() {
                shift += chord(i);
            }
            shift = self.of_legs(shift / self.count() as f64);
        }
        let mut motion = Motion { shift, travel: [0.0; N], second: [0.0; N], turn: [0.0; N] };
        for i in 0..N {
            let bend = self.legs[i].bend(to.joints[i] - from.joints[i]);
            motion.travel[i] = (chord(i) - shift).norm() + bend.anchor / 2.0;
            motion.second[i] = bend.anchor + bend.length;
            motion.turn[i] = bend.turn;
        }
        Some(motion)
    }

    /// A place taken along by a motion of the base anchors.
    pub(super) fn taken_along(&self, place: &Place, motion: Option<&Motion<N>>) -> Place {
        let shift = motion.map_or(Vector3::zeros(), |motion| motion.shift);
        Place { centre: place.centre + shift, ..*place }
    }

    /// What the point `x` = (v, r ω) of the chart about a place is away from it.
    #[inline(always)]
    pub(super) fn displacement(&self, place: &Place, x: &[f64; 6]) -> Displacement {
        let change = match self.chart {
            Chart::Group => cayley_change(&self.turn(x)),
            Chart::Angles => {
                let rotation = self.turned(place, x).rotation();
                rotation * place.rotation.transpose() - Matrix3::identity()
            }
            Chart::Level => Matrix3::zeros(),
        };
        Displacement { shift: Vector3::new(x[0], x[1], x[2]), change }
    }

    /// Turn of a point of the chart, in radians.
    #[inline(always)]
    pub(super) fn turn(&self, x: &[f64; 6]) -> Vector3<f64> {
        Vector3::new(x[3], x[4], x[5]) * (1.0 / self.radius)
    }

    /// Pose of the reference point at a point of the chart of angles.
    pub(super) fn turned(&self, place: &Place, x: &[f64; 6]) -> Pose {
        Pose { position: place.centre, angles: place.angles + self.turn(x) }
    }

    /// The place at a point of the chart about another one.
    #[inline(always)]
    pub(super) fn moved(&self, place: &Place, x: &[f64; 6]) -> Place {
        self.carried(place, x, &self.displacement(place, x))
    }

    /// The same, given how far that is away.
    #[inline(always)]
    fn carried(&self, place: &Place, x: &[f64; 6], by: &Displacement) -> Place {
        let centre = place.centre + by.shift;
        match self.chart {
            Chart::Angles => {
                let pose = self.turned(place, x);
                Place { centre, rotation: pose.rotation(), angles: pose.angles }
            }
            Chart::Group | Chart::Level => {
                let rotation = place.rotation + by.change * place.rotation;
                Place { centre, rotation, angles: place.angles }
            }
        }
    }

    /// Angular velocity of a platform whose point of the chart about a place moves at `x`.
    #[inline(always)]
    fn angular(&self, place: &Place, x: &[f64; 6]) -> Vector3<f64> {
        match self.chart {
            Chart::Group => self.turn(x),
            Chart::Angles => {
                let pose = Pose { position: place.centre, angles: place.angles };
                pose.trigonometry().rate_map() * self.turn(x)
            }
            Chart::Level => Vector3::zeros(),
        }
    }

    /// Residual of every leg, length + correction − target length.
    #[inline(always)]
    pub(super) fn measure(
        &self,
        target: &Target<N>,
        place: &Place,
        at: &mut Measured<N>,
    ) -> Result<(), Fault> {
        self.place(&target.anchors, place, &mut at.placed);
        if let Some(nut) = &self.nut {
            at.twist = nut.twist(&at.placed.directions(), &place.rotation);
        }
        self.compare(target, at)
    }

    /// Moves a measured platform to a point of the chart about its place: less work than
    /// to measure there from scratch.
    #[inline(always)]
    pub(super) fn advance(
        &self,
        end: &mut End<N>,
        x: &[f64; 6],
        target: &Target<N>,
    ) -> Result<(), Fault> {
        let by = self.displacement(&end.place, x);
        end.at.placed.advance(&by);
        if let Some(nut) = &self.nut {
            nut.advance(&mut end.at.twist, &end.at.placed.directions(), &by.change);
        }
        end.place = self.carried(&end.place, x, &by);
        self.compare(target, &mut end.at)
    }

    /// Newton's step at the end of a walk by the factorisation at its beginning.
    ///
    /// With the rows J there and J' here, M = J⁻¹: s = −M F, and once more with what the rows
    /// have changed by, s + M (J − J') s. That leaves ‖1 − M J'‖² of the error, as little as
    /// two steps by the old factorisation would, for one measurement. The nut's share of
    /// the rows is small, and what it changes by is left out.
    #[inline(always)]
    pub(super) fn refined_step(&self, about: &Stance<N>, end: &End<N>) -> [f64; 6] {
        let step = newton_step(&about.qr, &end.at.residual);
        let v = Vector3::new(step[0], step[1], step[2]);
        let omega = self.angular(&end.place, &step);
        let slower = end.at.placed.slower_than(&about.at.placed, &v, &omega);
        let more = about.qr.solve(&slower);
        core::array::from_fn(|k| step[k] + more[k])
    }

    /// Residuals of lengths and twists; refuses legs that have none.
    #[inline(always)]
    pub(super) fn compare(&self, target: &Target<N>, at: &mut Measured<N>) -> Result<(), Fault> {
        self.refuse_short_legs(&at.placed.length)?;
        let mut corrections = [0.0; N];
        if let Some(nut) = &self.nut {
            nut.refuse_along_axis(&at.twist)?;
            corrections = nut.corrections(&at.twist);
        }
        for i in (0..N).step_by(2) {
            let length = pair(&at.placed.length, i) + pair(&corrections, i);
            let off = length - pair(&target.length, i);
            put(&mut at.residual, i, off * pair(&self.present, i));
        }
        Ok(())
    }

    pub(super) fn measured(&self, target: &Target<N>, place: &Place) -> Result<Measured<N>, Fault> {
        let mut at = Measured::ZERO;
        self.measure(target, place, &mut at)?;
        Ok(at)
    }

    /// The twist of a machine that has any.
    #[inline]
    pub(super) fn twist_of<'a>(&self, at: &'a Measured<N>) -> Option<&'a Twist<N>> {
        self.nut.is_some().then_some(&at.twist)
    }

    /// Rows of the residuals in the chart, column by column.
    #[inline(always)]
    pub(super) fn columns(&self, at: &Measured<N>, place: &Place) -> [[f64; N]; 6] {
        self.charted_rows(&at.placed, self.twist_of(at), place)
    }

    #[inline(always)]
    pub(super) fn factor(
        &self,
        at: &Measured<N>,
        place: &Place,
        qr: &mut Qr<N>,
    ) -> Result<(), Fault> {
        match qr.renew(&self.active, self.columns(at, place)) {
            true => Ok(()),
            false => Err(Cause::Singular.into()),
        }
    }

    /// Measures and factors where a stance stands.
    #[inline(always)]
    pub(super) fn settle(&self, target: &Target<N>, stance: &mut Stance<N>) -> Result<(), Fault> {
        self.measure(target, &stance.place, &mut stance.at)?;
        self.factor(&stance.at, &stance.place, &mut stance.qr)
    }
}

#[inline(always)]
pub(super) fn newton_step<const N: usize>(qr: &Qr<N>, residual: &[f64; N]) -> [f64; 6] {
    qr.solve(residual).map(|x| -x)
}

#[inline(always)]
pub(super) fn norm<const M: usize>(v: &[f64; M]) -> f64 {
    sqrt(inner(v, v))
}

#[inline]
pub(super) fn largest<const N: usize>(v: &[f64; N]) -> f64 {
    v.iter().fold(0.0, |m: f64, x| if x.abs() <= m { m } else { x.abs() })
}
