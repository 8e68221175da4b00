// SPDX-License-Identifier: GPL-2.0-or-later
//! Whether the pose that forward finds is connected with the commanded one.
//!
//! Forward follows the joints and stays on its side of the singular poses. If a commanded motion passes
//! one, forward stays behind, on the mirror image of the commanded pose: both fit the joints, and only the
//! commanded poses distinguish them. After cycles without feedback, the straight line of the joints may lead to
//! another pose as well. So both poses are compared in every cycle.
//!
//! Two poses are connected on a ball in which the joints determine the pose ([`Side`]). In most cycles both
//! are in the ball of an earlier comparison, and nothing is computed. Otherwise the joints are
//! followed from one to the other.
//!
//! A doubt lasts: the joints do not determine which of the two poses is the machine's. It ends when the
//! commanded motion returns to the pose found, and when [`Crossing::end_doubt`] is called.

use kinematics::{Cause, Fault, Joints, Machine, Pose, Side, Solver, Vector3};

/// Share of the machine's size within which a pose found again is the same one.
const SAME_POSE: f64 = 1e-6;

/// Share of the machine's size by which joints that follow the commanded pose may differ from its
/// joints: on a machine of 1 m twice the usual following error limit of drives.
const FOLLOWING: f64 = 0.02;

/// The commanded pose and the one that forward has found.
pub struct Comparison<'a> {
    pub machine: &'a Machine,
    pub tool: &'a Vector3<f64>,
    pub solver: &'a Solver,
    pub joints: &'a Joints,
    pub found: &'a Pose,
    pub commanded: &'a Pose,
}

/// The result of a comparison.
enum Verdict {
    Connected,
    /// The poses differ.
    Apart(Cause),
    /// The joints do not follow, or a singular pose is nearer than the lag and noise of the joints.
    Undecided,
}

/// The state of the comparison with the commanded motion.
pub struct Crossing {
    /// A ball on which the joints determine the pose.
    side: Option<Side>,
    /// Why the pose found may not be the machine's.
    doubt: Option<Cause>,
}

impl Crossing {
    pub const fn new() -> Self {
        Self { side: None, doubt: None }
    }

    /// Returns why the pose found may not be the machine's.
    pub fn doubt(&self) -> Option<Cause> {
        self.doubt
    }

    /// Accepts the pose found as the machine's: the operator confirmed it, or the machine was homed.
    pub fn end_doubt(&mut self) {
        self.doubt = None;
    }

    /// Returns whether both poses are certainly connected, according to an earlier comparison.
    pub fn is_settled(&self, commanded: &Pose, found: &Pose, tool: &Vector3<f64>) -> bool {
        self.doubt.is_none()
            && self
                .side
                .as_ref()
                .is_some_and(|side| side.reaches(commanded, tool) && side.reaches(found, tool))
    }

    /// Checks in a cycle that forward refuses whether the commanded motion has passed a singular pose. There is no
    /// pose to compare now, and the next one that forward finds is on the side of its last pose.
    pub fn watch_refused(
        &mut self,
        machine: &Machine,
        tool: &Vector3<f64>,
        commanded: &Pose,
        last: &Pose,
    ) {
        let sides = (machine.side(commanded, tool), machine.side(last, tool));
        if let (Ok(there), Ok(here)) = sides
            && there.opposes(&here)
        {
            self.doubt = self.doubt.or(Some(Cause::SingularPassed));
        }
    }

    /// Compares the poses of a cycle.
    pub fn update(&mut self, comparison: &Comparison<'_>) {
        let Comparison { machine, tool, found, commanded, .. } = *comparison;
        let Ok(there) = machine.side(commanded, tool) else { return };
        if there.reaches(found, tool) {
            (self.side, self.doubt) = (Some(there), None);
            return;
        }
        match comparison.verdict(&there) {
            Verdict::Connected => self.doubt = None,
            // A motion that has passed a singular pose may pass another one.
            Verdict::Apart(cause) => self.doubt = self.doubt.or(Some(cause)),
            Verdict::Undecided => {}
        }
    }
}

impl Comparison<'_> {
    /// Follows the joints from the pose found to the commanded one, whose side is `there`.
    fn verdict(&self, there: &Side) -> Verdict {
        let Self { machine, tool, solver, found, commanded, .. } = self;
        let Ok(joints) = machine.inverse(commanded, tool) else { return Verdict::Undecided };
        if !(machine.travel(&joints, self.joints) <= FOLLOWING * machine.size()) {
            return Verdict::Undecided;
        }
        if machine.side(found, tool).is_ok_and(|here| there.opposes(&here)) {
            return Verdict::Apart(Cause::SingularPassed);
        }
        // The sign of det J alone does not decide: it is the same again beyond two singular poses.
        let apart = match machine.forward(&joints, found, tool, solver) {
            Ok(led) => led.pose.distance(commanded, machine.radius()),
            Err(_) if self.distance() <= FOLLOWING * machine.size() => return Verdict::Undecided,
            Err(_) => f64::INFINITY,
        };
        match apart <= SAME_POSE * machine.size() {
            true => Verdict::Connected,
            false => Verdict::Apart(Cause::NotAsCommanded),
        }
    }

    fn distance(&self) -> f64 {
        self.found.distance(self.commanded, self.machine.radius())
    }

    /// Returns the refusal, with the distance of the two poses.
    pub fn refusal(&self, cause: Cause) -> Fault {
        Fault::with_value(cause, self.distance())
    }
}
