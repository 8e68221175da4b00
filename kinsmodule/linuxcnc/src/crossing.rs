// SPDX-License-Identifier: GPL-2.0-or-later
//! Whether the commanded motion has passed a singular pose.
//!
//! Forward follows the joints and stays on its side of the singular poses; a commanded motion that
//! passes one leaves forward behind, on the mirror image of the commanded pose. Both fit the joints,
//! so that only the commanded poses show it.

use kinematics::{Cause, Fault, Joints, Machine, Pose, Side, Solver, Vector3};

/// Share of the machine's size within which a pose found again is the same one.
const SAME_POSE: f64 = 1e-6;

/// Share of the machine's size by which joints that follow the commanded pose may differ from its
/// joints: on a machine of 1 m twice the following error at which drives usually stop.
const FOLLOWING: f64 = 0.02;

/// The commanded pose beside the one that forward has found.
pub struct Comparison<'a> {
    pub machine: &'a Machine,
    pub tool: &'a Vector3<f64>,
    pub solver: &'a Solver,
    pub joints: &'a Joints,
    pub found: &'a Pose,
    pub commanded: &'a Pose,
}

/// What is known of the commanded motion.
pub struct Crossing {
    /// Side of a commanded pose that was forward's; none where the motion has passed a singular pose.
    side: Option<Side>,
    /// Whether the commanded motion has passed a singular pose and not come back.
    passed: bool,
}

impl Crossing {
    pub const fn new() -> Self {
        Self { side: None, passed: false }
    }

    pub fn has_passed(&self) -> bool {
        self.passed
    }

    /// Whether a commanded pose has passed no singular pose, as one compared before is so near. Most
    /// are.
    #[inline]
    pub fn is_known_before(&self, commanded: &Pose, tool: &Vector3<f64>) -> bool {
        self.side.as_ref().is_some_and(|side| side.reaches(commanded, tool))
    }

    /// Compares a commanded pose.
    pub fn update(&mut self, comparison: &Comparison<'_>) {
        let Comparison { machine, tool, found, commanded, .. } = *comparison;
        self.side = None;
        let (Ok(there), Ok(here)) = (machine.side(commanded, tool), machine.side(found, tool))
        else {
            return;
        };
        if there.opposes(&here) {
            self.passed |= comparison.joints_follow();
        } else if !self.passed || comparison.is_connected() {
            self.passed = false;
            self.side = Some(there);
        }
    }
}

impl Comparison<'_> {
    /// Whether the joints are those of the commanded pose, as far as drives follow.
    fn joints_follow(&self) -> bool {
        let Ok(joints) = self.machine.inverse(self.commanded, self.tool) else { return false };
        self.machine.travel(&joints, self.joints) <= FOLLOWING * self.machine.size()
    }

    /// Whether the joints lead from the pose found to the commanded one. The sign of det J does not
    /// decide that: it is the same again after a motion through two singular poses.
    fn is_connected(&self) -> bool {
        let Self { machine, tool, solver, found, commanded, .. } = self;
        let Ok(joints) = machine.inverse(commanded, tool) else { return false };
        let led = machine.forward(&joints, found, tool, solver);
        let same = SAME_POSE * machine.size();
        led.is_ok_and(|led| led.pose.distance(commanded, machine.radius()) <= same)
    }

    /// The refusal, with the distance of the two poses.
    pub fn refusal(&self) -> Fault {
        let apart = self.found.distance(self.commanded, self.machine.radius());
        Fault::with_value(Cause::SingularPassed, apart)
    }
}
