// SPDX-License-Identifier: GPL-2.0-or-later
//! The tool offset in effect, and how it follows the one requested.
//!
//! With the platform tilted by R, an offset that changes by Δo shifts the platform by
//! (R − I) Δo along a straight line, without turning it, while the control point stays.
//! A change waits until the machine stands still. Its path along this line is then surveyed, some
//! places a cycle, and followed by a ramp.

mod path;
mod ramp;
mod survey;

pub use path::shift;

use kinematics::{Cause, Fault, MAX_JOINTS, Machine, Pose, Solver, Vector3};
use path::Path;
use ramp::Ramp;
use survey::Survey;

/// A tool change without a monitor, or without known limits, may shift the platform by no
/// more than this share of the machine's size: less than what following errors of a level
/// platform make of it.
pub const NOTICEABLE: f64 = 1e-5;

/// A shift of the platform by no more than this share of the machine's size is made in
/// one cycle: on a machine of 1 m in cycles of 1 ms that is an acceleration of 1 mm/s².
const IMPERCEPTIBLE: f64 = 1e-9;

/// Cycles without motion before and after a change: LinuxCNC's interpolators lag by two.
const REST_CYCLES: u32 = 5;

/// Longest time in seconds that a motion under way may take to stop.
const MAX_WAIT: f64 = 5.0;

/// Limits of a joint, in joint units and seconds.
#[derive(Clone, Copy)]
pub struct JointLimits {
    pub least: f64,
    pub most: f64,
    pub velocity: f64,
    pub acceleration: f64,
}

impl JointLimits {
    /// Where nobody has set any.
    pub const ABSENT: Self = Self { least: -1e99, most: 1e99, velocity: 1e99, acceleration: 1e99 };

    /// Whether velocity and acceleration have limits.
    fn are_known(&self) -> bool {
        let Self { velocity, acceleration, .. } = Self::ABSENT;
        self.velocity > 0.0
            && self.velocity < velocity
            && self.acceleration > 0.0
            && self.acceleration < acceleration
    }
}

/// What a change goes by in one cycle.
pub struct Cycle<'a> {
    pub machine: &'a Machine,
    pub limits: [JointLimits; MAX_JOINTS],
    pub solver: Solver,
    /// The requested offset; may hold NaN.
    pub request: Vector3<f64>,
    /// The pose commanded in this cycle; none outside of world mode.
    pub commanded: Option<Pose>,
    pub seconds: f64,
}

impl Cycle<'_> {
    /// The refusal where a joint has no limits of velocity and acceleration.
    fn unlimited(&self) -> Option<Fault> {
        let layout = self.machine.layout();
        let mut known = self.limits.iter().take(layout.joints());
        let joint = known.position(|limits| !limits.are_known())?;
        Some(Fault::of_joint(Cause::ToolChangedTilted, layout, joint, 0.0))
    }
}

/// The offset in effect, and the change that is under way.
pub struct Tool {
    offset: Vector3<f64>,
    change: Change,
}

#[derive(Clone, Copy)]
#[allow(clippy::large_enum_variant, reason = "one of it exists, and there is no allocator")]
enum Change {
    None,
    /// Until the motion under way has stopped.
    Waiting(Waiting),
    Surveying(Survey),
    Moving(Ramp),
    /// Until LinuxCNC's interpolators have come to the end, for so many cycles.
    Resting(u32),
    Refused {
        request: Vector3<f64>,
        fault: Fault,
    },
}

impl Tool {
    pub fn new() -> Self {
        Self { offset: Vector3::zeros(), change: Change::None }
    }

    /// The offset in effect.
    pub fn offset(&self) -> Vector3<f64> {
        self.offset
    }

    /// Takes an offset at once.
    pub fn take(&mut self, offset: Vector3<f64>) {
        self.offset = offset;
        self.change = Change::None;
    }

    /// Whether a change is under way, so that nothing else may move.
    pub fn is_busy(&self) -> bool {
        !matches!(self.change, Change::None | Change::Refused { .. })
    }

    /// Whether this offset is in effect.
    #[inline(always)]
    pub fn has(&self, request: &Vector3<f64>) -> bool {
        *request == self.offset
    }

    /// Whether this offset is in effect and nothing is left to be done about it.
    pub fn is_at(&self, request: &Vector3<f64>) -> bool {
        matches!(self.change, Change::None) && self.has(request)
    }

    /// Why this request was refused, if it was.
    pub fn refusal(&self, request: &Vector3<f64>) -> Option<Fault> {
        match &self.change {
            Change::Refused { request: refused, fault } if refused == request => Some(*fault),
            _ => None,
        }
    }

    /// One cycle towards the request.
    ///
    /// # Errors
    /// The fault of a request that is refused from now on. What is in effect stays.
    pub fn advance(&mut self, cycle: &Cycle<'_>) -> Result<(), Fault> {
        let stepped = match &cycle.commanded {
            // Joint mode: inverse is not called, so that nothing can be moved by it.
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
            Change::Moving(ramp) => self.moved(ramp, cycle, pose),
            Change::Resting(0) => self.started(cycle, pose),
            Change::Resting(cycles) => Ok(Change::Resting(cycles - 1)),
        }
    }

    /// The first step towards a request, if there is one: to wait until the machine stands still.
    fn started(&mut self, cycle: &Cycle<'_>, pose: &Pose) -> Result<Change, Fault> {
        if self.is_settled(cycle, pose) {
            return Ok(Change::None);
        }
        match cycle.unlimited() {
            Some(fault) => Err(fault),
            None => Ok(Change::Waiting(Waiting { pose: *pose, cycles: 0, seconds: 0.0 })),
        }
    }

    /// Whether nothing is left to be done; a request that moves nothing is taken.
    fn is_settled(&mut self, cycle: &Cycle<'_>, pose: &Pose) -> bool {
        let request = cycle.request;
        // One that cannot be computed with makes inverse fail, which is enough.
        if request == self.offset || cycle.machine.check_tool(&request).is_err() {
            return true;
        }
        let share = if cycle.unlimited().is_some() { NOTICEABLE } else { IMPERCEPTIBLE };
        let moves_nothing =
            shift(pose, &(request - self.offset)).norm() <= share * cycle.machine.size();
        if moves_nothing {
            self.offset = request;
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
        let path = Path { pose: *pose, from: self.offset, to: cycle.request };
        Ok(Change::Surveying(Survey::new(path)))
    }

    fn moved(&mut self, ramp: Ramp, cycle: &Cycle<'_>, pose: &Pose) -> Result<Change, Fault> {
        ramp.path.refuse_other_pose(pose)?;
        let brake = cycle.request != ramp.path.to;
        let ramp = ramp.continued(brake, cycle.seconds);
        self.offset = ramp.path.at(ramp.share);
        if ramp.share >= 1.0 {
            return Ok(Change::Resting(REST_CYCLES));
        }
        if brake && ramp.speed <= 0.0 {
            self.started(cycle, pose)
        } else {
            Ok(Change::Moving(ramp))
        }
    }
}

fn disturbed() -> Fault {
    Cause::ToolChangeDisturbed.into()
}

/// Waiting for the machine to stop.
#[derive(Clone, Copy)]
struct Waiting {
    pose: Pose,
    /// At rest for so many cycles.
    cycles: u32,
    /// Since the change was requested.
    seconds: f64,
}

impl Waiting {
    fn continued(self, cycle: &Cycle<'_>, pose: &Pose) -> Result<Self, Fault> {
        let seconds = self.seconds + cycle.seconds;
        if !(seconds <= MAX_WAIT) {
            return Err(disturbed());
        }
        let cycles = if *pose == self.pose { self.cycles + 1 } else { 0 };
        Ok(Self { pose: *pose, cycles, seconds })
    }
}
