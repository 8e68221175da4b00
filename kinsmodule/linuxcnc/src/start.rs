// SPDX-License-Identifier: GPL-2.0-or-later
//! The start without a seed: boxes of the workspace, and the search in them.

use crate::pins::Pins;
use kinematics::{
    Cause, Fault, Joints, Load, MAX_BOXES, Machine, Pose, Progress, Search, Solver, Vector3,
    WorkspaceBox,
};

/// The boxes in use, and the progress of a search.
pub struct Start {
    boxes: [WorkspaceBox; MAX_BOXES],
    count: usize,
    search: Option<Search>,
    /// Runs of the monitor since the last forward call.
    idle: u32,
}

impl Start {
    pub const fn new() -> Self {
        Self { boxes: [WorkspaceBox::EMPTY; MAX_BOXES], count: 0, search: None, idle: 0 }
    }

    /// Reads the boxes of the pins, and checks that all are valid and belong to the geometry with this hash.
    pub fn read(pins: &Pins, load: &Load, hash: u32) -> Result<Self, Fault> {
        let mut start = Self { count: load.boxes(), ..Self::new() };
        for (k, place) in start.boxes.iter_mut().enumerate().take(load.boxes()) {
            let (given, of) = pins.workspace_box(k, &load.layout);
            if !given.is_valid() {
                return Err(Fault::with_value(Cause::BoxInvalid, k as f64));
            }
            if of != hash {
                return Err(Fault::with_value(Cause::BoxOfOther, k as f64));
            }
            *place = given;
        }
        Ok(start)
    }

    /// Returns whether there are boxes to search.
    pub fn has_boxes(&self) -> bool {
        self.count > 0
    }

    /// Continues the search: returns the pose from which forward starts, or why none is known (yet).
    ///
    /// A search uses the joints of its first call to its end. Forward then follows from the pose found to the present
    /// joints.
    pub fn seed(
        &mut self,
        machine: &Machine,
        joints: &Joints,
        tool: &Vector3<f64>,
        solver: &Solver,
    ) -> Result<Pose, Fault> {
        let boxes = self.boxes.get(..self.count).unwrap_or(&self.boxes);
        let search = self.search.take().unwrap_or_else(|| Search::new(joints, boxes));
        match machine.search(search, boxes, tool, solver)? {
            Progress::Found(pose) => Ok(pose),
            Progress::Searching(search) => {
                self.search = Some(search);
                Err(Cause::Searching.into())
            }
        }
    }

    pub fn is_searching(&self) -> bool {
        self.search.is_some()
    }

    /// Counts a run of the monitor.
    pub fn count_cycle(&mut self) {
        self.idle = self.idle.saturating_add(1);
    }

    /// Returns in a call of forward whether LinuxCNC had stopped calling it, as it does while a joint is not homed; the
    /// joints may have moved arbitrarily since.
    pub fn resumes(&mut self) -> bool {
        core::mem::take(&mut self.idle) > 1
    }

    /// Ends a search whose joints are no longer the present ones.
    pub fn stop_searching(&mut self) {
        self.search = None;
    }
}
