// SPDX-License-Identifier: GPL-2.0-or-later
//! The list of all limits of a machine, and the margins of a pose to them.

use crate::at::At;
use crate::fault::{Cause, Fault};
use crate::layout::{Joints, Layout, MAX_JOINTS, MAX_LEGS, PerLeg};
use crate::leg::LEAST_DRIVE;
use crate::letters::Letter;
use crate::watch::{Cones, Nearest, Turns};
use core::ops::ControlFlow;

/// Default of the smallest singular value at which a machine must stop: below it some
/// motion moves no anchor along its leg by more than a twentieth of the motion. The shipped
/// machines stay above four times this value.
pub const CONDITIONING_LIMIT: f64 = 0.05;

/// A kind of limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Limit {
    /// Range of a pose coordinate.
    Axis,
    /// A leg must reach its platform anchor.
    Reach,
    /// Range of a joint value.
    JointRange,
    /// Distance of a rod from its dead point.
    DeadPoint,
    /// Angle of a leg from its direction at the reference pose, at its base joint.
    BaseCone,
    /// Angle of a leg from its direction at the reference pose, at its platform joint.
    PlatformCone,
    /// Rotation of a leg about the fixed axis of its base joint and across it.
    BasePyramid,
    /// Rotation of a leg about the fixed axis of its platform joint and across it.
    PlatformPyramid,
    /// Angle between tool axis and Z of base.
    Tilt,
    /// Distance of legs that share no anchor.
    Clearance,
    /// Smallest singular value of the legs' constraint rows.
    Conditioning,
    /// Speed of a joint.
    JointSpeed,
    /// Acceleration of a joint.
    JointAcceleration,
}

impl Limit {
    /// All of them, in the order in which [`At::margins`] visits them.
    pub const ALL: [Limit; 13] = [
        Self::Axis,
        Self::Reach,
        Self::JointRange,
        Self::DeadPoint,
        Self::BaseCone,
        Self::PlatformCone,
        Self::BasePyramid,
        Self::PlatformPyramid,
        Self::Tilt,
        Self::Clearance,
        Self::Conditioning,
        Self::JointSpeed,
        Self::JointAcceleration,
    ];

    /// Returns its index in [`Limit::ALL`].
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Returns its name in messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Axis => "axis range",
            Self::Reach => "reach",
            Self::JointRange => "joint range",
            Self::DeadPoint => "dead point",
            Self::BaseCone => "base cone",
            Self::PlatformCone => "platform cone",
            Self::BasePyramid => "base pyramid",
            Self::PlatformPyramid => "platform pyramid",
            Self::Tilt => "tilt",
            Self::Clearance => "clearance of legs",
            Self::Conditioning => "conditioning",
            Self::JointSpeed => "joint speed",
            Self::JointAcceleration => "joint acceleration",
        }
    }
}

// Arrays with one value per limit are indexed by it.
const _: () = {
    let mut i = 0;
    while i < Limit::ALL.len() {
        assert!(Limit::ALL[i].index() == i);
        i += 1;
    }
};

/// The part of the machine that a margin refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The machine as a whole.
    Whole,
    /// A coordinate of the pose.
    Axis(Letter),
    /// A joint, counted from 0.
    Joint(usize),
    /// A leg, counted from 0.
    Leg(usize),
    /// Two legs, lower number first.
    Legs([usize; 2]),
}

/// A value with its allowed range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margin {
    /// The limit.
    pub limit: Limit,
    /// The part of the machine.
    pub part: Part,
    /// In units of the range.
    pub value: f64,
    /// Smallest and largest allowed value; infinite without a limit. Machine units, degrees,
    /// joint units, or dimensionless, depending on the limit.
    pub range: [f64; 2],
}

impl Margin {
    /// Returns the distance to the nearer end of the range, negative beyond it; NaN if anything is NaN.
    pub fn room(&self) -> f64 {
        let [low, high] = [self.value - self.range[0], self.range[1] - self.value];
        if low.is_nan() || low < high { low } else { high }
    }

    /// Returns whether the value is within its range; false for NaN.
    pub fn is_kept(&self) -> bool {
        self.value >= self.range[0] && self.value <= self.range[1]
    }

    /// Returns the scale of the share: usually the range if it has two ends, otherwise its one end.
    pub fn scale(&self) -> f64 {
        match (self.limit, self.range) {
            // A singular value of unit rows, and a distance that may be large compared with its limit.
            (Limit::Conditioning, _) => 1.0,
            (Limit::Clearance, [low, _]) => self.value.max(low),
            (_, [low, high]) if low.is_finite() && high.is_finite() => high - low,
            (_, [low, high]) => if low.is_finite() { low } else { high }.abs(),
        }
    }

    /// Returns the distance to the limit as a share of the range: 0 at the limit, negative beyond it, infinite
    /// without a limit or if nothing can move; minus infinity if anything is NaN.
    pub fn share(&self) -> f64 {
        let (room, scale) = (self.room(), self.scale());
        if room == f64::INFINITY || (scale == 0.0 && room >= 0.0) {
            return f64::INFINITY;
        }
        let share = room / scale;
        if share.is_nan() { f64::NEG_INFINITY } else { share }
    }

    /// Returns the margin of a pose that [`crate::Machine::at`] refuses: out of reach by the value, or a rod at
    /// its dead point. NaN if the refusal has another cause.
    pub fn of_fault(fault: &Fault) -> Self {
        let part = fault.number().map_or(Part::Whole, |leg| Part::Leg(usize::from(leg)));
        match fault.cause {
            Cause::DeadPoint => Self::dead_point(part, fault.value),
            Cause::OutOfReach => Self::reach(part, -fault.value.abs()),
            _ => Self::reach(part, f64::NAN),
        }
    }

    fn reach(part: Part, value: f64) -> Self {
        Self { limit: Limit::Reach, part, value, range: [0.0, f64::INFINITY] }
    }

    fn dead_point(part: Part, value: f64) -> Self {
        Self { limit: Limit::DeadPoint, part, value, range: [LEAST_DRIVE, f64::INFINITY] }
    }

    /// Returns the monitor's fault for a violated limit; `None` for limits that it does not monitor.
    pub(crate) fn fault(&self, layout: &Layout) -> Option<Fault> {
        let cause = match self.limit {
            Limit::JointRange => Cause::JointLimitAhead,
            Limit::BaseCone => Cause::BaseConeAhead,
            Limit::PlatformCone => Cause::PlatformConeAhead,
            Limit::BasePyramid => Cause::BasePyramidAhead,
            Limit::PlatformPyramid => Cause::PlatformPyramidAhead,
            Limit::Tilt => Cause::TiltAhead,
            Limit::Clearance => Cause::LegsNear,
            Limit::Conditioning => Cause::ConditioningAhead,
            Limit::JointSpeed => Cause::JointTooFast,
            Limit::DeadPoint => Cause::DeadPoint,
            Limit::Axis | Limit::Reach | Limit::JointAcceleration => return None,
        };
        Some(match self.part {
            Part::Joint(i) => Fault::of_joint(cause, layout, i, self.value),
            Part::Leg(i) => Fault::of_leg(cause, i, self.value),
            Part::Legs(pair) => Fault::of_legs(cause, pair, self.value),
            Part::Whole | Part::Axis(_) => Fault::with_value(cause, self.value),
        })
    }
}

/// Values of all limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Smallest and largest value of each coordinate X … C, machine units and degrees.
    pub axis: [[f64; 2]; 6],
    /// Smallest joint values.
    pub min: Joints,
    /// Largest joint values.
    pub max: Joints,
    /// Joint speeds, joint units per second.
    pub speed: Joints,
    /// Joint accelerations, joint units per second².
    pub acceleration: Joints,
    /// Cones of the base joints, degrees; 0 = no limit.
    pub base_cone: PerLeg,
    /// Cones of the platform joints, degrees; 0 = no limit.
    pub platform_cone: PerLeg,
    /// Rotation at the base joints about the fixed axis and across it, either way, degrees; 0 = no
    /// limit.
    pub base_pyramid: [[f64; 2]; MAX_LEGS],
    /// Rotation at the platform joints about the fixed axis and across it.
    pub platform_pyramid: [[f64; 2]; MAX_LEGS],
    /// Tilt of the tool axis, degrees; 0 = no limit.
    pub tilt: f64,
    /// Smallest singular value of the constraint rows; 0 = no limit. The monitor stops the machine
    /// there, and slows it down below twice that value.
    pub conditioning: f64,
    /// Smallest distance of legs that share no anchor; 0 = no limit.
    pub clearance: f64,
}

impl Limits {
    /// No limit is set.
    pub const NONE: Self = Self {
        axis: [[f64::NEG_INFINITY, f64::INFINITY]; 6],
        min: [f64::NEG_INFINITY; MAX_JOINTS],
        max: [f64::INFINITY; MAX_JOINTS],
        speed: [f64::INFINITY; MAX_JOINTS],
        acceleration: [f64::INFINITY; MAX_JOINTS],
        base_cone: [0.0; MAX_LEGS],
        platform_cone: [0.0; MAX_LEGS],
        base_pyramid: [[0.0; 2]; MAX_LEGS],
        platform_pyramid: [[0.0; 2]; MAX_LEGS],
        tilt: 0.0,
        conditioning: 0.0,
        clearance: 0.0,
    };

    /// Visits the margins of joint values, for the first `count` joints.
    pub fn joints<B>(
        &self,
        values: &Joints,
        count: usize,
        mut visit: impl FnMut(Margin) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let ranges = self.min.iter().zip(&self.max);
        for (i, (value, (min, max))) in values.iter().zip(ranges).enumerate().take(count) {
            let (part, range) = (Part::Joint(i), [*min, *max]);
            visit(Margin { limit: Limit::JointRange, part, value: *value, range })?;
        }
        ControlFlow::Continue(())
    }

    /// Visits the margins of joint speeds, for the first `count` joints.
    pub fn speeds<B>(
        &self,
        rates: &Joints,
        count: usize,
        visit: impl FnMut(Margin) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        either_way(Limit::JointSpeed, rates, &self.speed, count, visit)
    }

    /// Visits the margins of joint accelerations, for the first `count` joints.
    pub fn accelerations<B>(
        &self,
        accelerations: &Joints,
        count: usize,
        visit: impl FnMut(Margin) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        either_way(Limit::JointAcceleration, accelerations, &self.acceleration, count, visit)
    }
}

fn either_way<B>(
    limit: Limit,
    values: &Joints,
    most: &Joints,
    count: usize,
    mut visit: impl FnMut(Margin) -> ControlFlow<B>,
) -> ControlFlow<B> {
    for (i, (value, most)) in values.iter().zip(most).enumerate().take(count) {
        visit(Margin { limit, part: Part::Joint(i), value: *value, range: [-most, *most] })?;
    }
    ControlFlow::Continue(())
}

impl At<'_> {
    /// Visits the margins of all set limits of the pose itself; joint speeds and
    /// accelerations belong to a motion, see [`Limits::speeds`]. Reach was checked when the machine
    /// moved to the pose, see [`Margin::of_fault`]. Values without a limit are not computed.
    ///
    /// A limit on a joint without the axis or the reference pose that it needs has the value NaN
    /// and counts as violated.
    pub fn margins<B>(
        &self,
        limits: &Limits,
        mut visit: impl FnMut(Margin) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        self.margins_of_place(limits, &mut visit)?;
        self.margins_of_angles(limits, &mut visit)?;
        if limits.clearance != 0.0
            && let Some(nearest) = self.nearest()
        {
            visit(clearance(&nearest, limits))?;
        }
        if limits.conditioning != 0.0 {
            visit(self.conditioning(limits))?;
        }
        ControlFlow::Continue(())
    }

    fn conditioning(&self, limits: &Limits) -> Margin {
        let (value, range) = (self.smallest_singular_value(), [limits.conditioning, f64::INFINITY]);
        Margin { limit: Limit::Conditioning, part: Part::Whole, value, range }
    }

    /// Checks all limits of [`At::margins`]. Limits that are certainly kept are not evaluated, so this takes
    /// less work than a fold over the margins.
    ///
    /// # Errors
    /// The first violated limit, in the order of the list.
    pub fn check(&self, limits: &Limits) -> Result<(), Margin> {
        if let Some(broken) = self.first_broken(limits) {
            return Err(broken);
        }
        if limits.conditioning == 0.0 || self.is_surely_above(limits.conditioning) {
            return Ok(());
        }
        let margin = self.conditioning(limits);
        if margin.is_kept() { Ok(()) } else { Err(margin) }
    }

    /// Returns the first violated limit in the order of the list, except conditioning.
    pub(crate) fn first_broken(&self, limits: &Limits) -> Option<Margin> {
        let visit = |margin: Margin| match margin.is_kept() {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(margin),
        };
        let near = || {
            let nearest =
                (limits.clearance != 0.0).then(|| self.nearest_within(limits.clearance))??;
            Some(clearance(&nearest, limits)).filter(|margin| !margin.is_kept())
        };
        let leans = || {
            let cones = [&limits.base_cone, &limits.platform_cone];
            let pyramids = [&limits.base_pyramid, &limits.platform_pyramid];
            let are_kept = self.surely_keeps(limits.tilt, cones, pyramids);
            if are_kept { None } else { self.margins_of_angles(limits, visit).break_value() }
        };
        self.margins_of_place(limits, visit).break_value().or_else(leans).or_else(near)
    }

    /// Visits the margins of axes, joints and dead points.
    fn margins_of_place<B>(
        &self,
        limits: &Limits,
        mut visit: impl FnMut(Margin) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let pose = self.pose().to_degrees();
        for ((letter, value), range) in Letter::ALL.into_iter().zip(pose).zip(limits.axis) {
            visit(Margin { limit: Limit::Axis, part: Part::Axis(letter), value, range })?;
        }
        limits.joints(self.joints(), self.layout().joints(), &mut visit)?;
        for i in 0..self.layout().legs() {
            if let Some(drive) = self.drive(i) {
                visit(Margin::dead_point(Part::Leg(i), drive))?;
            }
        }
        ControlFlow::Continue(())
    }

    /// Visits the margins of cones, pyramids and tilt.
    fn margins_of_angles<B>(
        &self,
        limits: &Limits,
        mut visit: impl FnMut(Margin) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        self.margins_of_cones(limits, &mut visit)?;
        self.margins_of_pyramids(limits, &mut visit)?;
        if limits.tilt != 0.0 {
            let (value, range) = (self.tilt(), [f64::NEG_INFINITY, limits.tilt]);
            visit(Margin { limit: Limit::Tilt, part: Part::Whole, value, range })?;
        }
        ControlFlow::Continue(())
    }

    fn margins_of_cones<B>(
        &self,
        limits: &Limits,
        visit: &mut impl FnMut(Margin) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let all =
            [(Limit::BaseCone, &limits.base_cone), (Limit::PlatformCone, &limits.platform_cone)];
        if all.iter().all(|(_, most)| **most == [0.0; MAX_LEGS]) {
            return ControlFlow::Continue(());
        }
        let Cones { base, platform } = self.cones();
        for ((limit, most), angles) in all.into_iter().zip([&base, &platform]) {
            let legs = most.iter().zip(angles).enumerate().take(self.layout().legs());
            for (i, (most, value)) in legs.filter(|(_, (most, _))| **most != 0.0) {
                let (part, range) = (Part::Leg(i), [f64::NEG_INFINITY, *most]);
                visit(Margin { limit, part, value: *value, range })?;
            }
        }
        ControlFlow::Continue(())
    }

    fn margins_of_pyramids<B>(
        &self,
        limits: &Limits,
        visit: &mut impl FnMut(Margin) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let all = [
            (Limit::BasePyramid, &limits.base_pyramid),
            (Limit::PlatformPyramid, &limits.platform_pyramid),
        ];
        if all.iter().all(|(_, most)| **most == [[0.0; 2]; MAX_LEGS]) {
            return ControlFlow::Continue(());
        }
        let turns = self.turns();
        for ((limit, most), Turns { about, across }) in all.into_iter().zip(&turns) {
            let legs = most.iter().zip(about.iter().zip(across)).enumerate();
            for (i, (most, (about, across))) in legs.take(self.layout().legs()) {
                let ways = most.iter().zip([about, across]);
                for (most, value) in ways.filter(|(most, _)| **most != 0.0) {
                    let (part, range) = (Part::Leg(i), [-most, *most]);
                    visit(Margin { limit, part, value: *value, range })?;
                }
            }
        }
        ControlFlow::Continue(())
    }
}

fn clearance(nearest: &Nearest, limits: &Limits) -> Margin {
    let (part, range) = (Part::Legs(nearest.pair), [limits.clearance, f64::INFINITY]);
    Margin { limit: Limit::Clearance, part, value: nearest.distance, range }
}
