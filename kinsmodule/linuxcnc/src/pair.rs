// SPDX-License-Identifier: GPL-2.0-or-later
//! Two mechanisms behind one pose of nine letters and one row of joints.
//!
//! Each is a [`Module`] of its own, which knows nothing of the other: frozen, certified and guarded
//! for itself. Here is what they have in common. Forward and inverse succeed where both do, and write
//! nothing otherwise; both geometries are frozen or none is; feed is inhibited where one asks for it,
//! and scaled as the slower one needs it.

use crate::between::Between;
use crate::module::{Kind, Module};
use kinematics::{Cause, Fault, Jacobian, Joints, Letter, MAX_JOINTS, Pose, World};

/// The two.
pub struct Pair<'a> {
    pub first: &'a mut Module,
    pub second: &'a mut Module,
    pub between: &'a mut Between,
}

/// The state of a second mechanism, and what is between it and the first.
pub struct Second {
    pub module: Module,
    pub between: Between,
}

/// Rows of a Jacobian of LinuxCNC: one a joint, by its nine letters.
type Rows = [World];

impl Pair<'_> {
    /// Joints to pose: over the seed in `world`, or nothing. `address` as in [`Module::forward`].
    #[inline(never)]
    pub fn forward(
        &mut self,
        joints: &[f64],
        world: &mut World,
        address: usize,
    ) -> Result<(), Fault> {
        self.begin();
        let (own, extra) = joints.split_at_checked(self.count()).unwrap_or((joints, &[]));
        if let Err(fault) = self.first.check_extra(extra, address) {
            self.second.skip_forward(address);
            return Err(fault);
        }
        let (of_first, of_second) =
            own.split_at_checked(self.first.layout().joints()).unwrap_or((own, &[]));
        let mut poses = self.poses(world);
        let [first, second] = &mut poses;
        let result = either(
            forward(self.first, of_first, first, address),
            forward(self.second, of_second, second, address),
        );
        match &result {
            Ok(()) => self.put(&poses, extra, world),
            Err(Fault { cause: Cause::NotHomed, .. }) => {}
            Err(_) => {
                // The pose of the one that has found its own is NaN as well.
                self.first.note_refusal(address);
                self.second.note_refusal(address);
            }
        }
        result
    }

    /// Pose to joints: all of them, or none.
    #[inline(never)]
    pub fn inverse(&mut self, world: &World, joints: &mut [f64]) -> Result<(), Fault> {
        self.begin();
        let poses = self.poses(world);
        if !self.first.awaits_command() {
            self.between.note_queued(poses);
        }
        let [first, second] = poses;
        let mut kept = [0.0; MAX_JOINTS];
        let of_second = inverse(self.second, &second, &mut kept);
        if of_second.is_err() {
            // Every call is a call of both; what it gives goes nowhere.
            inverse(self.first, &first, &mut kept)?;
            return of_second;
        }
        inverse(self.first, &first, joints)?;
        let extra = self.first.extra().places().filter_map(|place| world.get(place));
        let own = kept.iter().take(self.second.layout().joints());
        let behind = joints.iter_mut().skip(self.first.layout().joints());
        behind.zip(own.chain(extra)).for_each(|(joint, value)| *joint = *value);
        Ok(())
    }

    /// Rows of the joints of both, in front of those of extra axes.
    #[inline(never)]
    pub fn jacobian(&mut self, world: &World, rows: &mut Rows) -> Result<(), Fault> {
        self.second.pins.share(self.first.pins);
        let [first, second] = self.poses(world);
        let of_first = jacobian(self.first, &first)?;
        let of_second = jacobian(self.second, &second)?;
        let count = self.first.layout().joints();
        for (out, row) in rows.iter_mut().zip(of_first.row_iter()).take(count) {
            // A letter that the first one holds is the second one's, an extra axis', or nobody's.
            for ((to, value), letter) in out.iter_mut().zip(row.iter()).zip(Letter::ALL) {
                *to = if self.first.layout().is_held(letter) { 0.0 } else { *value };
            }
        }
        let letters = self.first.load().second();
        let own = rows.iter_mut().skip(count).zip(of_second.row_iter());
        for (out, row) in own.take(self.second.layout().joints()) {
            let mut values = [0.0; 6];
            values.iter_mut().zip(row.iter()).for_each(|(to, value)| *to = *value);
            letters.into_iter().for_each(|letters| letters.put(&values, out));
        }
        Ok(())
    }

    /// Changes the kinematics of both, or of none.
    #[inline(never)]
    pub fn switch(&mut self, number: i32) -> Result<(), Fault> {
        self.second.pins.share(self.first.pins);
        let asked = self.first.asked(number);
        let first = self.first.switch_granted(asked)?;
        let asked = self.second.asked(number);
        let second = self.second.switch_granted(asked)?;
        self.first.switch_to(first);
        self.second.switch_to(second);
        Ok(())
    }

    /// Before each call: the pins in common, and a geometry that is offered.
    #[inline(never)]
    pub fn begin(&mut self) {
        self.second.pins.share(self.first.pins);
        if !self.first.is_offered() {
            return;
        }
        if self.first.pins.machine_on() {
            self.second.note_offered();
            return self.first.take_offered();
        }
        // Both are looked at, so that what is wrong with each is told.
        let is_good = self.first.checks_offered() & self.second.checks_offered();
        for mechanism in [&mut *self.first, &mut *self.second] {
            if is_good {
                mechanism.take_offered();
            } else {
                mechanism.note_offered();
                mechanism.pins.geometry_ok.set(false);
            }
        }
    }

    /// The second one's monitor, after that of the first.
    // A frame of its own, as that of a single mechanism is part of its caller's.
    #[inline(never)]
    pub fn monitor_second(&mut self, seconds: f64) {
        self.second.monitor(seconds);
    }

    /// The end of a cycle, after both monitors: what both ask of LinuxCNC.
    #[inline(never)]
    pub fn end_cycle(&mut self, seconds: f64) {
        let near = self.between.watch([&*self.first, &*self.second], seconds);
        let (first, second) = (self.first.pins, self.second.pins);
        let inhibits = [self.first.inhibits_feed(), self.second.inhibits_feed()];
        first.feed_inhibit.set(inhibits[0] || inhibits[1] || self.between.inhibits_feed());
        first.jog.stop.set(self.first.stops_jogs() || self.second.stops_jogs());
        first.tool_busy.set(first.tool_busy.get() || second.tool_busy.get());
        first.geometry_changed.set(first.geometry_changed.get() || second.geometry_changed.get());
        let (shown, of_second) = (&first.guard.shown, &second.guard.shown);
        shown.feed_scale.set(shown.feed_scale.get().min(of_second.feed_scale.get()));
        shown.limit_of_either(of_second);
        if let Some((fault, is_inhibited)) = near {
            shown.limit_if_none(&fault);
            if is_inhibited {
                self.first.record(&fault);
            }
        }
    }

    /// Number of joints of both, without extra axes.
    fn count(&self) -> usize {
        self.first.load().first_extra_joint()
    }

    /// The pose of each, in its own coordinates.
    fn poses(&self, world: &World) -> [[f64; 6]; 2] {
        [self.first.without_extra(world), self.pose_of_second(world)]
    }

    fn pose_of_second(&self, world: &World) -> [f64; 6] {
        self.first.load().second().map_or([0.0; 6], |second| second.pose_of(world))
    }

    /// Both poses and the coordinates of extra axes in LinuxCNC's pose.
    fn put(&self, [first, second]: &[[f64; 6]; 2], extra: &[f64], world: &mut World) {
        for (value, own) in world.iter_mut().zip(first) {
            *value = *own;
        }
        if let Some(letters) = self.first.load().second() {
            letters.put(second, world);
        }
        for (place, value) in self.first.extra().places().zip(extra) {
            if let Some(coordinate) = world.get_mut(place) {
                *coordinate = *value;
            }
        }
    }
}

/// Success of both, or a fault: that the joints are not homed yet only where nothing else is wrong.
fn either(first: Result<(), Fault>, second: Result<(), Fault>) -> Result<(), Fault> {
    match (first, second) {
        (Err(Fault { cause: Cause::NotHomed, .. }), Err(fault)) | (Err(fault), _) => Err(fault),
        (Ok(()), other) => other,
    }
}

// One frame for either mechanism, and none in what a single one calls.
#[inline(never)]
fn forward(
    module: &mut Module,
    joints: &[f64],
    pose: &mut [f64; 6],
    address: usize,
) -> Result<(), Fault> {
    let mut all: Joints = [0.0; MAX_JOINTS];
    all.iter_mut().zip(joints).for_each(|(to, value)| *to = *value);
    match module.kind() {
        Kind::Identity => module.identity_forward(&all, pose),
        Kind::Machine => module.forward(&all, pose, address),
    }
}

#[inline(never)]
fn inverse(module: &mut Module, pose: &[f64; 6], joints: &mut [f64]) -> Result<(), Fault> {
    let count = module.layout().joints();
    let joints = joints.get_mut(..count).unwrap_or_default();
    match module.kind() {
        Kind::Identity => module.identity_inverse(pose, joints),
        Kind::Machine => module.inverse(pose, joints),
    }
}

#[inline(never)]
fn jacobian(module: &Module, pose: &[f64; 6]) -> Result<Jacobian, Fault> {
    match module.kind() {
        Kind::Identity => Ok(module.identity_jacobian()),
        Kind::Machine => module.jacobian(&Pose::from_degrees(*pose)),
    }
}
