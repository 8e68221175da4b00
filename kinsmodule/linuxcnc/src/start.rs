// SPDX-License-Identifier: GPL-2.0-or-later
//! The start without a seed: boxes of the workspace, and the search in them.

use crate::pins::Pins;
use kinematics::{
    Cause, Fault, Joints, Load, MAX_BOXES, Machine, Pose, Progress, Search, Solver, Vector3,
    WorkspaceBox,
};

/// Boxes in use, and how far a search has come.
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

    /// Whether the boxes of the pins can be taken for a geometry with this hash.
    pub fn check(&self, pins: &Pins, load: &Load, hash: u32) -> Result<(), Fault> {
        (0..load.boxes()).try_for_each(|k| checked(pins, load, k, hash).map(|_| ()))
    }

    /// Takes the boxes of the pins, or leaves the last ones.
    ///
    /// They are read twice, so that no second set of them needs room on the stack.
    pub fn freeze(&mut self, pins: &Pins, load: &Load, hash: u32) -> Result<(), Fault> {
        self.check(pins, load, hash)?;
        (self.count, self.search, self.idle) = (0, None, 0);
        for (k, place) in self.boxes.iter_mut().enumerate().take(load.boxes()) {
            *place = checked(pins, load, k, hash)?;
        }
        self.count = load.boxes();
        Ok(())
    }

    /// Whether there are boxes to search.
    pub fn has_boxes(&self) -> bool {
        self.count > 0
    }

    /// Goes on searching: the pose that forward starts from, or why there is none (yet).
    ///
    /// The search is for the joints of its first call until it ends. From the pose found for them
    /// forward leads to the present joints.
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

    /// The monitor has run once more.
    pub fn count_cycle(&mut self) {
        self.idle = self.idle.saturating_add(1);
    }

    /// Returns, as forward is called, whether LinuxCNC had ceased to call it. It does so while a joint
    /// is not homed; the joints may then have been anywhere.
    pub fn resumes(&mut self) -> bool {
        core::mem::take(&mut self.idle) > 1
    }

    /// Ends a search, as its joints are no longer the present ones.
    pub fn stop_searching(&mut self) {
        self.search = None;
    }
}

/// Box `k` of the pins, if it can be computed with and belongs to this geometry.
fn checked(pins: &Pins, load: &Load, k: usize, hash: u32) -> Result<WorkspaceBox, Fault> {
    let (given, of) = pins.workspace_box(k, &load.layout);
    if !given.is_valid() {
        return Err(Fault::with_value(Cause::BoxInvalid, k as f64));
    }
    if of != hash {
        return Err(Fault::with_value(Cause::BoxOfOther, k as f64));
    }
    Ok(given)
}
