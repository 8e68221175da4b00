// SPDX-License-Identifier: GPL-2.0-or-later
//! The mechanism, or two of them behind one pose of nine letters and one row of joints.
//!
//! A call arrives in LinuxCNC's terms: its pose, and the joints of the whole machine. Each mechanism
//! is a [`Module`], independent of any other: frozen, certified and guarded separately. Forward
//! and inverse succeed if both do, and write nothing otherwise; both geometries are frozen or none is;
//! the feed is inhibited if either requires it, and scaled by the smaller of the two scales.
//!
//! Inverse is `#[inline(always)]` from [`Module::inverse`] down to the core: in one frame the pose stays in
//! registers. In separate frames the functions take a seventh longer on the hexapod (`make bench`). Everything
//! else is left to the compiler.

use crate::between::Between;
use crate::module::Module;
use crate::module::extra::{write_extra_joints, write_extra_rows};
use crate::orient::Request;
use kinematics::{
    Cause, Fault, Letter, Link, MAX_EXTRA, MAX_JOINTS, MAX_LEGS, Matrix3, Second as SecondLetters,
    World,
};

/// EMCMOT_MAX_JOINTS.
pub const MOST_JOINTS: usize = 16;

/// Joints of legs and table, of a second mechanism and of extra axes, in this order; 0 beyond the last one.
pub type AllJoints = [f64; MOST_JOINTS];

// A table and extra axes share no letter. A second mechanism shares the legs with the first, and
// its own letters are not those of an extra axis.
const _: () = assert!(MAX_JOINTS <= MOST_JOINTS && MAX_LEGS + MAX_EXTRA <= MOST_JOINTS);

/// Change of a joint, relative to its value or 1, below which it counts as held: rounding of forward and inverse.
const HELD: f64 = 1e-9;

/// All mechanisms and axes that LinuxCNC controls.
pub struct Control {
    pub first: Module,
    pub second: Option<Second>,
}

/// A second mechanism, and the distance monitor between it and the first.
pub struct Second {
    pub module: Module,
    pub letters: SecondLetters,
    pub between: Between,
}

impl Control {
    /// Returns the total number of joints.
    pub fn joints(&self) -> usize {
        self.first.load().joints()
    }

    /// Replaces the seed in `world` with the pose of the joints. Its address distinguishes the kinds of call.
    ///
    /// A refusal makes the coordinates that the machine moves NaN: LinuxCNC ignores the result in some
    /// places, and only NaN stops it safely. Before homing they stay unchanged: that is not yet a failure, and
    /// LinuxCNC would pass NaN on to its planner.
    pub fn forward(&mut self, joints: &[f64], world: &mut World) -> Result<(), Fault> {
        let address = &raw const *world as usize;
        if self.first.was_homed_before(world) {
            self.first.forget_poses();
            if let Some(Second { module, .. }) = &mut self.second {
                module.forget_poses();
            }
        }
        let result = self.find_pose(joints, world, address);
        self.first.note_handed(world, result.is_ok());
        self.first.note_command(joints, address, result.is_ok());
        if result.is_err_and(|fault| fault.cause != Cause::NotHomed) {
            self.refuse(world);
        }
        result
    }

    /// Replaces the seed in `world` with the pose of the joints that is connected with the last ones, or with the
    /// seed.
    fn find_pose(
        &mut self,
        joints: &[f64],
        world: &mut World,
        address: usize,
    ) -> Result<(), Fault> {
        self.begin();
        let [of_first, of_second, extra] = self.parts(joints);
        let Some(second) = &mut self.second else {
            return self.first.forward(of_first, extra, world, address);
        };
        let [mut own, mut other] = second.worlds(world);
        let Second { module, letters, .. } = second;
        let first = self.first.forward(of_first, extra, &mut own, address);
        let second = module.forward(of_second, &[], &mut other, address);
        // Unhomed joints are reported only if there is no other fault.
        let result = match (first, second) {
            (Err(Fault { cause: Cause::NotHomed, .. }), Err(fault)) | (Err(fault), _) => Err(fault),
            (Ok(()), Err(fault)) => Err(fault),
            (Ok(()), Ok(())) => {
                let [pose @ .., _, _, _] = other;
                letters.put(&pose, &mut own);
                *world = own;
                Ok(())
            }
        };
        if result.is_err_and(|fault| fault.cause != Cause::NotHomed) {
            // The pose of a mechanism that has found its own is NaN as well.
            self.first.note_refusal(address);
            module.note_refusal(address);
        }
        result
    }

    /// Makes the coordinates that the machine moves NaN.
    pub fn refuse(&self, world: &mut World) {
        let layout = &self.first.load().layout;
        let own = Letter::ALL.into_iter().filter(|letter| !layout.is_held(*letter));
        let second = self.second.iter().flat_map(|second| second.letters.places());
        for place in own.map(Letter::index).chain(second) {
            world.get_mut(place).into_iter().for_each(|value| *value = f64::NAN);
        }
    }

    /// Writes the joints of a pose; a refusal leaves them unchanged.
    pub fn inverse(&mut self, world: &World, joints: &mut [f64]) -> Result<(), Fault> {
        if self.first.is_standing() && world.iter().all(|value| value.is_finite()) {
            joints.iter_mut().zip(self.first.stand()?).for_each(|(joint, value)| *joint = value);
            return Ok(());
        }
        self.begin();
        let of_first = match &mut self.second {
            None => self.first.inverse(world),
            Some(second) => {
                let [own, other] = second.worlds(world);
                if !self.first.awaits_command() {
                    second.between.note_queued([own, other]);
                }
                // Every call counts for both.
                let of_second = second.module.inverse(&other);
                let of_first = self.first.inverse(&own);
                if of_first.is_ok() {
                    let behind = joints.iter_mut().skip(self.first.load().layout.joints());
                    behind.zip(of_second?).for_each(|(joint, value)| *joint = value);
                }
                of_first
            }
        };
        let load = self.first.load();
        let own = joints.iter_mut().zip(of_first.as_ref().map_err(|fault| *fault)?);
        own.take(load.layout.joints()).for_each(|(joint, value)| *joint = *value);
        write_extra_joints(load, world, joints);
        Ok(())
    }

    /// Returns a row for each joint: its derivatives with respect to LinuxCNC's nine letters, degrees for angles.
    pub fn jacobian(&self, world: &World) -> Result<[World; MOST_JOINTS], Fault> {
        self.share_pins();
        let load = self.first.load();
        let mut rows = [World::default(); MOST_JOINTS];
        let worlds = self.second.as_ref().map(|second| second.worlds(world));
        let of_first = self.first.jacobian(worlds.as_ref().map_or(world, |[own, _]| own))?;
        rows.iter_mut().zip(of_first).for_each(|(row, own)| *row = own);
        if let (Some(Second { module, letters, .. }), Some([_, other])) = (&self.second, &worlds) {
            // A letter that the first mechanism fixes belongs to the second one, an extra axis, or none.
            for row in &mut rows {
                let letters = Letter::ALL.into_iter().zip(row.iter_mut());
                let held = letters.filter(|(letter, _)| load.layout.is_held(*letter));
                held.for_each(|(_, value)| *value = 0.0);
            }
            let own = rows.iter_mut().skip(load.layout.joints()).zip(module.jacobian(other)?);
            for (row, [values @ .., _, _, _]) in own.take(module.load().layout.joints()) {
                *row = [0.0; 9];
                letters.put(&values, row);
            }
        }
        write_extra_rows(load, &mut rows);
        Ok(rows)
    }

    /// Returns the orientations of tool and workpiece in base. LinuxCNC has none for a second mechanism.
    pub fn frames(&self, joints: &[f64]) -> Result<[Matrix3<f64>; 2], Fault> {
        let [own, _, extra] = self.parts(joints);
        self.first.frames(own, extra)
    }

    /// Writes the joints at which the tool has a requested orientation; joints beyond the first mechanism's keep their values.
    /// Returns the number of free directions and the remaining spin, or `None` if there are none that leave the joints
    /// of `held` where they are.
    pub fn oriented(
        &self,
        joints: &[f64],
        request: &Request,
        held: u32,
        answer: &mut [f64],
    ) -> Result<Option<(usize, f64)>, Fault> {
        let [own, _, extra] = self.parts(joints);
        let Some((found, orientation)) = self.first.oriented(own, extra, request)? else {
            return Ok(None);
        };
        let load = self.first.load();
        answer.iter_mut().zip(joints).for_each(|(to, value)| *to = *value);
        let legs = answer.iter_mut().zip(&found).take(load.layout.joints());
        legs.for_each(|(to, value)| *to = *value);
        let is_held = |n: usize| n < MOST_JOINTS && held >> n & 1 == 1;
        let mut moved = answer.iter().zip(joints).enumerate().filter(|(n, _)| is_held(*n));
        if moved.any(|(_, (to, from))| !((to - from).abs() <= HELD * from.abs().max(1.0))) {
            return Ok(None);
        }
        // Every leg bears every motion of the platform.
        if (0..load.layout.joints()).any(is_held) {
            return Ok(Some((0, orientation.spin)));
        }
        // An extra axis that turns tool or workpiece could move instead.
        let chain = self.first.chain();
        let turning = load.extra.places().enumerate().filter(|(n, place)| {
            let turns = |link: &Link| link.place == *place && link.is_rotary();
            !is_held(load.first_extra_joint() + n) && chain.links().iter().any(turns)
        });
        Ok(Some((orientation.free + turning.count(), orientation.spin)))
    }

    /// Switches the kinematics of both mechanisms, or of neither.
    pub fn switch(&mut self, number: i32) -> Result<(), Fault> {
        self.share_pins();
        let first = self.first.grant_switch(number)?;
        if let Some(Second { module, .. }) = &mut self.second {
            let second = module.grant_switch(number)?;
            module.switch_to(second);
        }
        self.first.switch_to(first);
        Ok(())
    }

    /// Requests the tool offset that LinuxCNC has in effect. U V W are for the second mechanism.
    pub fn request_tool(&mut self, [x, y, z, .., u, v, w]: &World) {
        self.first.request_tool([*x, *y, *z]);
        if let Some(Second { module, .. }) = &mut self.second {
            module.request_tool([*u, *v, *w]);
        }
    }

    /// Runs the monitors at the end of a cycle, and passes the requests of either to LinuxCNC.
    pub fn monitor(&mut self, seconds: f64) {
        self.begin();
        let Some(Second { module, between, .. }) = &mut self.second else {
            return self.first.monitor(seconds, None);
        };
        let both = self.first.programmed(seconds).with_second(&module.programmed(seconds));
        self.first.monitor(seconds, Some(both));
        module.monitor(seconds, Some(both));
        let near = between.watch([&self.first, &*module], seconds);
        let (first, second) = (self.first.pins, module.pins);
        let inhibits = [self.first.inhibits_feed(), module.inhibits_feed()];
        first.feed_inhibit.set(inhibits[0] || inhibits[1] || between.inhibits_feed());
        first.jog.stop.set(self.first.stops_jogs() || module.stops_jogs());
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

    /// Lets the second mechanism use the pins that both have in common.
    #[inline(always)]
    fn share_pins(&self) {
        if let Some(Second { module, .. }) = &self.second {
            module.pins.share(self.first.pins);
        }
    }

    /// Freezes both offered geometries, or neither. (A single mechanism does this in its own module.)
    #[inline(always)]
    fn begin(&mut self) {
        self.share_pins();
        let Some(Second { module: second, .. }) = &mut self.second else { return };
        if !self.first.is_offered() {
            return;
        }
        if self.first.pins.machine_on() {
            second.note_offered();
            return self.first.take_offered();
        }
        // Check both, so that the faults of both are reported.
        let is_good = self.first.checks_offered() & second.checks_offered();
        for mechanism in [&mut self.first, second] {
            if is_good {
                mechanism.take_offered();
            } else {
                mechanism.note_offered();
                mechanism.pins.geometry_ok.set(false);
            }
        }
    }

    /// Returns the joints of the first mechanism, of the second and of the extra axes.
    fn parts<'a>(&self, joints: &'a [f64]) -> [&'a [f64]; 3] {
        let load = self.first.load();
        let (own, extra) =
            joints.split_at_checked(load.first_extra_joint()).unwrap_or((joints, &[]));
        let (first, second) = own.split_at_checked(load.layout.joints()).unwrap_or((own, &[]));
        [first, second, extra]
    }
}

impl Second {
    /// Returns LinuxCNC's pose for each mechanism: the first one without the letters of the second,
    /// which has its own X Y Z A B C.
    fn worlds(&self, world: &World) -> [World; 2] {
        let mut own = *world;
        for place in self.letters.places() {
            own.get_mut(place).into_iter().for_each(|value| *value = 0.0);
        }
        let [x, y, z, a, b, c] = self.letters.pose_of(world);
        [own, [x, y, z, a, b, c, 0.0, 0.0, 0.0]]
    }
}
