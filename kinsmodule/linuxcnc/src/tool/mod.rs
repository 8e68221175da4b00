// SPDX-License-Identifier: GPL-2.0-or-later
//! The tool offset in effect, and how it follows the one requested.
//!
//! With the platform tilted by R, an offset that changes by Δo shifts the platform by
//! (R − I) Δo along a straight line, without rotating it, while the control point stays; if an axis
//! carries workpiece or tool, by another linear function of Δo. With constraints the platform also rotates, as these
//! require.
//! A change waits until the machine is at rest. Its path along this line is then surveyed, some
//! poses per cycle, and followed at a constant speed.
//!
//! LinuxCNC commands no motion meanwhile and therefore counts as in position: it may change
//! the mode in any cycle, and no kinematics module can prevent or even detect that. Outside of world mode it
//! does not call inverse, so that no braking is possible then. The speed is therefore so low that every
//! joint can stop within one cycle (see [`survey`]), and a change may end anywhere.

mod path;
mod survey;

pub use path::shift;

use kinematics::{Cause, Fault, MAX_JOINTS, Machine, Matrix3, Pose, Solver, Vector3};
use path::Path;
use survey::Survey;

/// A tool change without a monitor, or without known limits, may shift the platform by no
/// more than this fraction of the machine's size: less than the error of a level platform from
/// following errors.
pub const NOTICEABLE: f64 = 1e-5;

/// A shift of the platform by no more than this fraction of the machine's size is made in
/// one cycle: on a machine of 1 m in cycles of 1 ms that is an acceleration of 1 mm/s².
pub const IMPERCEPTIBLE: f64 = 1e-9;

/// Cycles without motion before and after a change: LinuxCNC's interpolators lag by two.
const REST_CYCLES: u32 = 5;

/// Longest time in seconds that a motion may take to stop.
const MAX_WAIT: f64 = 5.0;

/// Fraction of a joint's limits for a motion that LinuxCNC does not command: of the velocity limit, and of the
/// speed that the acceleration limit reaches within one cycle.
///
/// LinuxCNC may change its mode in any cycle. Let V be the largest step of a joint from one point to the
/// next. The joints follow a cubic B-spline of these points, which lags by two of them.
/// - To joint mode: the joint stops from one cycle to the next, an acceleration of V / T².
/// - From coordinated to teleop mode or back: the spline starts anew, filled with the next point. The joint
///   jumps there within one cycle, by 2 V for the lag and by V for the point itself, then stops for a
///   cycle: at most 3 V / T for the speed, and 3 V / T² for the acceleration.
/// - To the identity kinematics: the spline returns to the joint's last value, by at most 5 V / 3 T².
///
/// So a third is the bound; a tenth less allows for the second derivative and for rounding. T is the
/// servo period even if the trajectory period is longer: the jump happens within a servo cycle.
const STEP_SHARE: f64 = 0.3;

/// Limits of a joint, in joint units and seconds.
#[derive(Clone, Copy)]
pub struct JointLimits {
    pub least: f64,
    pub most: f64,
    pub velocity: f64,
    pub acceleration: f64,
}

impl JointLimits {
    /// Limits that are not set.
    pub const ABSENT: Self = Self { least: -1e99, most: 1e99, velocity: 1e99, acceleration: 1e99 };

    /// Returns whether velocity and acceleration have limits.
    pub fn are_known(&self) -> bool {
        let Self { velocity, acceleration, .. } = Self::ABSENT;
        self.velocity > 0.0
            && self.velocity < velocity
            && self.acceleration > 0.0
            && self.acceleration < acceleration
    }

    /// Returns the speed from which LinuxCNC may stop a joint in any cycle, `seconds` long.
    pub fn stoppable_speed(&self, seconds: f64) -> f64 {
        STEP_SHARE * self.velocity.min(self.acceleration * seconds)
    }
}

/// The inputs of a change in one cycle.
pub struct Cycle<'a> {
    pub machine: &'a Machine,
    pub limits: [JointLimits; MAX_JOINTS],
    pub solver: Solver,
    /// The requested offset; may hold NaN.
    pub request: Vector3<f64>,
    /// The pose commanded in this cycle; none outside of world mode.
    pub commanded: Option<Pose>,
    /// Whether LinuxCNC's commanded pose differs from that of the cycle before, if the machine's
    /// own does not show it: an axis that carries something changes it with the tool offset.
    pub has_moved: Option<bool>,
    /// The shift of the platform per change of the offset at that pose.
    pub shift: &'a Matrix3<f64>,
    /// Distance by which the platform would move at once, if axes carry something beside constraints: the path of such a
    /// change is not known.
    pub travel: Option<f64>,
    pub seconds: f64,
}

impl Cycle<'_> {
    /// Returns whether the commanded pose, previously `from`, has changed.
    fn is_elsewhere(&self, from: &Pose, pose: &Pose) -> bool {
        self.has_moved.unwrap_or(pose != from)
    }

    /// Returns whether constraints make the platform rotate with the offset.
    fn turns(&self) -> bool {
        self.machine.layout().constraints() > 0
    }

    /// Returns the refusal if a joint has no limits of velocity and acceleration.
    fn unlimited(&self) -> Option<Fault> {
        let layout = self.machine.layout();
        let mut known = self.limits.iter().take(layout.joints());
        let joint = known.position(|limits| !limits.are_known())?;
        Some(Fault::of_joint(Cause::ToolChangedTilted, layout, joint, 0.0))
    }
}

/// The offset in effect, and the present change.
pub struct Tool {
    offset: Vector3<f64>,
    /// The tool vector of the machine's poses: the offset, or 0.
    of_machine: Vector3<f64>,
    is_bare: bool,
    change: Change,
}

#[derive(Clone, Copy)]
#[allow(clippy::large_enum_variant, reason = "one of it exists, and there is no allocator")]
enum Change {
    None,
    /// Until the motion has stopped.
    Waiting(Waiting),
    Surveying(Survey),
    Moving(Moving),
    /// Until LinuxCNC's interpolators have reached the end, for this number of cycles.
    Resting(u32),
    Refused {
        request: Vector3<f64>,
        fault: Fault,
    },
}

impl Tool {
    pub fn new() -> Self {
        Self {
            offset: Vector3::zeros(),
            of_machine: Vector3::zeros(),
            is_bare: false,
            change: Change::None,
        }
    }

    pub fn offset(&self) -> Vector3<f64> {
        self.offset
    }

    /// Returns the tool vector of the machine's poses.
    pub fn of_machine(&self) -> Vector3<f64> {
        self.of_machine
    }

    /// Sets whether the machine's poses are those of the platform, regardless of the offset.
    pub fn set_bare(&mut self, is_bare: bool) {
        self.is_bare = is_bare;
        self.set(self.offset);
    }

    fn set(&mut self, offset: Vector3<f64>) {
        self.offset = offset;
        self.of_machine = if self.is_bare { Vector3::zeros() } else { offset };
    }

    pub fn take(&mut self, offset: Vector3<f64>) {
        self.set(offset);
        self.change = Change::None;
    }

    /// Returns whether a change is active, so that nothing else may move.
    pub fn is_busy(&self) -> bool {
        !matches!(self.change, Change::None | Change::Refused { .. })
    }

    /// Returns whether this offset is in effect.
    pub fn has(&self, request: &Vector3<f64>) -> bool {
        *request == self.offset
    }

    /// Returns whether this offset is in effect and nothing remains to be done for it.
    pub fn is_at(&self, request: &Vector3<f64>) -> bool {
        matches!(self.change, Change::None) && self.has(request)
    }

    /// Returns why this request was refused, if it was.
    pub fn refusal(&self, request: &Vector3<f64>) -> Option<Fault> {
        match &self.change {
            Change::Refused { request: refused, fault } if refused == request => Some(*fault),
            _ => None,
        }
    }

    /// Runs one cycle toward the request.
    ///
    /// # Errors
    /// The fault of a request that is refused from now on. The offset in effect stays.
    pub fn advance(&mut self, cycle: &Cycle<'_>) -> Result<(), Fault> {
        let stepped = match &cycle.commanded {
            // Outside of world mode inverse is not called, so that it cannot move anything.
            None => Ok(Change::None),
            Some(pose) => self.stepped(cycle, pose),
        };
        let refused = |fault| Change::Refused { request: cycle.request, fault };
        self.change = stepped.unwrap_or_else(refused);
        stepped.map(|_| ())
    }

    fn stepped(&mut self, cycle: &Cycle<'_>, pose: &Pose) -> Result<Change, Fault> {
        match self.change {
            Change::None => self.started(cycle, pose),
            Change::Refused { request, .. } if request == cycle.request => Ok(self.change),
            Change::Refused { .. } => self.started(cycle, pose),
            Change::Waiting(waiting) => self.waited(waiting, cycle, pose),
            Change::Surveying(survey) if survey.path.to != cycle.request => {
                self.started(cycle, pose)
            }
            Change::Surveying(survey) => survey.continued(cycle, pose),
            Change::Moving(moving) => self.moved(moving, cycle, pose),
            Change::Resting(0) => self.started(cycle, pose),
            Change::Resting(cycles) => Ok(Change::Resting(cycles - 1)),
        }
    }

    /// Returns the first step toward a request, if there is one: wait until the machine is at rest.
    fn started(&mut self, cycle: &Cycle<'_>, pose: &Pose) -> Result<Change, Fault> {
        if self.is_settled(cycle, pose) {
            return Ok(Change::None);
        }
        if let Some(travel) = cycle.travel {
            return Err(Fault::with_value(Cause::ToolChangedTilted, travel));
        }
        match cycle.unlimited() {
            Some(fault) => Err(fault),
            None => Ok(Change::Waiting(Waiting { pose: *pose, cycles: 0, seconds: 0.0 })),
        }
    }

    /// Returns whether nothing remains to be done; a request that moves nothing takes effect.
    fn is_settled(&mut self, cycle: &Cycle<'_>, pose: &Pose) -> bool {
        let request = cycle.request;
        // An invalid offset makes inverse fail, which is enough.
        if request == self.offset || cycle.machine.check_tool(&request).is_err() {
            return true;
        }
        let share = if cycle.unlimited().is_some() { NOTICEABLE } else { IMPERCEPTIBLE };
        let machine = cycle.machine;
        let shift = match (cycle.travel, cycle.turns()) {
            (Some(travel), _) => travel,
            (None, false) => (cycle.shift * (request - self.offset)).norm(),
            (None, true) => {
                machine.tool_travel(pose, &self.offset, &request).unwrap_or(f64::INFINITY)
            }
        };
        let moves_nothing = shift <= share * machine.size();
        if moves_nothing {
            self.set(request);
        }
        moves_nothing
    }

    fn waited(
        &mut self,
        waiting: Waiting,
        cycle: &Cycle<'_>,
        pose: &Pose,
    ) -> Result<Change, Fault> {
        if self.is_settled(cycle, pose) {
            return Ok(Change::None);
        }
        let waiting = waiting.continued(cycle, pose)?;
        if waiting.cycles < REST_CYCLES {
            return Ok(Change::Waiting(waiting));
        }
        let (from, to) = (self.offset, cycle.request);
        let travel = cycle.shift * (to - from);
        let (tool, turns) = (self.of_machine, cycle.turns());
        let path = Path { pose: *pose, tool, travel, from, to, turns };
        Ok(Change::Surveying(Survey::new(path)))
    }

    fn moved(&mut self, moving: Moving, cycle: &Cycle<'_>, pose: &Pose) -> Result<Change, Fault> {
        moving.path.refuse_other_pose(cycle, pose)?;
        if cycle.request != moving.path.to {
            // The motion is slow enough to stop at once.
            return self.started(cycle, pose);
        }
        let moving = moving.continued();
        self.set(moving.path.at(moving.share));
        if moving.share >= 1.0 {
            return Ok(Change::Resting(REST_CYCLES));
        }
        Ok(Change::Moving(moving))
    }
}

fn disturbed() -> Fault {
    Cause::ToolChangeDisturbed.into()
}

/// Waiting for the machine to stop.
#[derive(Clone, Copy)]
struct Waiting {
    pose: Pose,
    /// Number of cycles at rest.
    cycles: u32,
    /// Time since the change was requested.
    seconds: f64,
}

impl Waiting {
    fn continued(self, cycle: &Cycle<'_>, pose: &Pose) -> Result<Self, Fault> {
        let seconds = self.seconds + cycle.seconds;
        if !(seconds <= MAX_WAIT) {
            return Err(disturbed());
        }
        let moves = cycle.is_elsewhere(&self.pose, pose);
        let cycles = if moves { 0 } else { self.cycles + 1 };
        Ok(Self { pose: *pose, cycles, seconds })
    }
}

/// Motion along a surveyed path at constant speed.
#[derive(Clone, Copy)]
struct Moving {
    path: Path,
    share: f64,
    /// Fraction of the path per cycle.
    step: f64,
}

impl Moving {
    /// Advances one cycle.
    fn continued(self) -> Self {
        // Not more than the rest, including a rest that is only rounding.
        let is_last = !(self.step * (1.0 + 1e-9) < 1.0 - self.share);
        Self { share: if is_last { 1.0 } else { self.share + self.step }, ..self }
    }
}
