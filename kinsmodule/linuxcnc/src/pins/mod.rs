// SPDX-License-Identifier: GPL-2.0-or-later
//! The HAL pins: names, directions, defaults, and the machine read from them.
//!
//! Names and defaults are genhexkins' where the meaning is the same, so that a HAL
//! file for genhexkins works after the name is replaced.

mod chain;
mod constraint;
mod correction;
mod guard;
mod jog;
mod leg;
mod machine;
mod maker;
mod workspace_box;

pub use guard::{FAR, GuardInputs, GuardPins};
pub use jog::JogPins;
pub use machine::MachinePins;
pub use maker::{Live, Maker, Place, Source, Target};

use crate::hal::{Component, Direction, HalError, Pin};
use crate::tool::JointLimits;
use constraint::DependentPins;
pub use correction::CorrectionPins;
use kinematics::{
    ChainGeometry, Fault, Geometry, Joints, Layout, Load, MAX_BOXES, MAX_JOINTS, Machine, PerLeg,
    Pose, Solver, Vector3, WorkspaceBox, text,
};
use maker::{Pose6, Vector};
use workspace_box::BoxPins;

/// The version as one number: a million per major version, a thousand per minor version.
const VERSION: u32 = 1_000_000 * number(env!("CARGO_PKG_VERSION_MAJOR"))
    + 1000 * number(env!("CARGO_PKG_VERSION_MINOR"))
    + number(env!("CARGO_PKG_VERSION_PATCH"));

const fn number(text: &str) -> u32 {
    match u32::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => panic!("a version is made of numbers"),
    }
}

/// Pins of one joint.
#[repr(C)]
struct JointPins {
    min_limit: Pin<f64>,
    max_limit: Pin<f64>,
    max_velocity: Pin<f64>,
    max_acceleration: Pin<f64>,
    correction: CorrectionPins,
}

/// All pins of a mechanism, in HAL memory.
#[repr(C)]
pub struct Pins {
    machine: MachinePins,
    joints: [JointPins; MAX_JOINTS],
    boxes: [BoxPins; MAX_BOXES],
    searching: Pin<bool>,
    tool_offset_x: Pin<f64>,
    tool_offset_y: Pin<f64>,
    tool_offset_eff: Vector,
    pub tool_busy: Pin<bool>,
    pub feed_inhibit: Pin<bool>,
    max_error: Pin<f64>,
    pub last_iterations: Pin<u32>,
    pub max_iterations: Pin<u32>,
    pub fwd_kins_fail: Pin<bool>,
    pub residual: Pin<f64>,
    pub assembly: Pin<i32>,
    pose: Pose6,
    dependent: DependentPins,
    skgui: Pose6,
    is_type: [Pin<bool>; 3],
    pub geometry_ok: Pin<bool>,
    pub geometry_hash: Pin<u32>,
    pub geometry_changed: Pin<bool>,
    machine_on: Pin<bool>,
    apply: Pin<bool>,
    fault: Pin<i32>,
    fault_leg: Pin<i32>,
    fault_count: Pin<u32>,
    fault_reset: Pin<bool>,
    version: Pin<u32>,
    pub jog: JogPins,
    pub guard: GuardPins,
}

/// The values frozen at `.apply`.
#[derive(Clone, Copy, PartialEq)]
pub struct Given {
    pub geometry: Geometry,
    /// Subtracted from the native joint values.
    pub offset: PerLeg,
    pub spindle_offset: f64,
}

impl Given {
    /// Builds the machine, or returns why it is refused.
    pub fn checked(&self) -> Result<Machine, Fault> {
        let machine = Machine::freeze(&self.geometry, &self.offset)?;
        machine.check_tool(&Vector3::new(0.0, 0.0, self.spindle_offset))?;
        Ok(machine)
    }

    /// Combines the hash of geometry and chain with everything else that affects the joints.
    pub fn hash(&self, load: &Load, of_chain: u32) -> u32 {
        load.hash(of_chain, &self.offset, self.spindle_offset)
    }
}

impl JointPins {
    fn create(&mut self, make: &Maker, n: usize) -> Result<(), HalError> {
        use Direction::In;
        let absent = JointLimits::ABSENT;
        for (pin, name, value) in [
            (&mut self.min_limit, "min-limit", absent.least),
            (&mut self.max_limit, "max-limit", absent.most),
            (&mut self.max_velocity, "max-velocity", absent.velocity),
            (&mut self.max_acceleration, "max-acceleration", absent.acceleration),
        ] {
            make.one(pin, In, make.of_joint(name, n), value)?;
        }
        self.correction.create(make, n)
    }

    fn limits(&self) -> JointLimits {
        let limits = JointLimits {
            least: self.min_limit.get(),
            most: self.max_limit.get(),
            velocity: self.max_velocity.get(),
            acceleration: self.max_acceleration.get(),
        };
        match self.correction.is_allowed() {
            false => limits,
            true => self.correction.room_in(limits),
        }
    }
}

impl Pins {
    /// Creates all pins of a mechanism; `self` must be in memory from [`Component::allocate`]. Those that
    /// a second mechanism shares with the first are not created: see [`Pins::share`].
    pub fn create(
        &mut self,
        component: Component,
        load: &Load,
        place: Place,
    ) -> Result<(), HalError> {
        let make = Maker { target: Target::Hal(component), place };
        self.machine.create_legs(&make, load)?;
        self.machine.create_axes(&make, load)?;
        for (n, joint) in self.joints.iter_mut().enumerate().take(load.layout.joints()) {
            joint.create(&make, n)?;
        }
        for (k, pins) in self.boxes.iter_mut().enumerate().take(load.boxes()) {
            pins.create(&make, k, load)?;
        }
        if load.boxes() > 0 {
            let searching = &mut self.searching;
            make.one(searching, Direction::Out, text![make.stem(), "searching"], false)?;
        }
        self.create_inputs(&make)?;
        if !place.is_second && load.second().is_none() {
            self.machine.create_chain(&make, load)?;
        }
        self.create_outputs(&make)?;
        self.dependent.create(&make, load)?;
        if !place.is_second {
            self.create_common(&make)?;
            self.jog.create(&make, load)?;
        }
        self.guard.create(&make, load)
    }

    /// Uses the pins that both mechanisms share, from those of the first.
    pub fn share(&self, first: &Self) {
        self.machine.share(&first.machine);
        for (own, first) in [
            (&self.machine_on, &first.machine_on),
            (&self.apply, &first.apply),
            (&self.fault_reset, &first.fault_reset),
        ] {
            own.share(first);
        }
        self.fault.share(&first.fault);
        self.fault_leg.share(&first.fault_leg);
        self.fault_count.share(&first.fault_count);
        self.is_type.iter().zip(&first.is_type).for_each(|(own, first)| own.share(first));
        // The pose has only one set of names here.
        self.skgui.iter().zip(&self.pose).for_each(|(gui, own)| gui.share(own));
        self.guard.asked.share(&first.guard.asked);
        self.jog.share(&first.jog);
    }

    fn create_inputs(&mut self, make: &Maker) -> Result<(), HalError> {
        use Direction::In;
        let name = |name: &str| text![make.stem(), name];
        self.machine.create_pose(make)?;
        self.machine.create_centre(make)?;
        make.one(&mut self.tool_offset_x, In, name("tool-offset-x"), 0.0)?;
        make.one(&mut self.tool_offset_y, In, name("tool-offset-y"), 0.0)
    }

    fn create_outputs(&mut self, make: &Maker) -> Result<(), HalError> {
        use Direction::Out;
        let name = |name: &str| text![make.stem(), name];
        make.letters(&mut self.tool_offset_eff, Out, name("tool-offset-eff-"), [0.0; 3])?;
        make.one(&mut self.tool_busy, Out, name("tool-busy"), false)?;
        make.one(&mut self.feed_inhibit, Out, name("feed-inhibit"), false)?;
        make.letters(&mut self.pose, Out, name(""), [0.0; 6])?;
        make.one(&mut self.last_iterations, Out, name("last-iterations"), 0)?;
        make.one(&mut self.max_iterations, Out, name("max-iterations"), 0)?;
        make.one(&mut self.fwd_kins_fail, Out, name("fwd-kins-fail"), false)?;
        make.one(&mut self.residual, Out, name("residual"), 0.0)?;
        make.one(&mut self.assembly, Out, name("assembly"), 0)?;
        make.one(&mut self.geometry_ok, Out, name("geometry-ok"), false)?;
        make.one(&mut self.geometry_hash, Out, name("geometry-hash"), 0)?;
        self.machine.create_hash(make, Out)?;
        make.one(&mut self.geometry_changed, Out, name("geometry-changed"), false)
    }

    /// Creates the pins that a module has once, regardless of the number of mechanisms.
    fn create_common(&mut self, make: &Maker) -> Result<(), HalError> {
        use Direction::{In, Out};
        self.machine.create_common(make)?;
        self.machine.create_residual_limit(make)?;
        make.one(&mut self.max_error, In, text!["pkmkins.max-error"], 500.0)?;
        make.one(&mut self.machine_on, In, text!["pkmkins.machine-on"], false)?;
        make.one(&mut self.apply, In, text!["pkmkins.apply"], false)?;
        make.one(&mut self.fault_reset, In, text!["pkmkins.fault-reset"], false)?;
        make.letters(&mut self.skgui, Out, text!["skgui."], [0.0; 6])?;
        for (n, pin) in self.is_type.iter_mut().enumerate() {
            make.one(pin, Out, text!["kinstype.is-", n], n == 0)?;
        }
        make.one(&mut self.fault, Out, text!["pkmkins.fault"], 0)?;
        make.one(&mut self.fault_leg, Out, text!["pkmkins.fault-leg"], -1)?;
        make.one(&mut self.fault_count, Out, text!["pkmkins.fault-count"], 0)?;
        make.one(&mut self.version, Out, text!["pkmkins.version"], VERSION)
    }

    /// Reads the pins that affect the joint values, except the tool.
    pub fn given(&self, load: &Load) -> Given {
        self.machine.given(load, &Live)
    }

    /// Reads what the extra axes carry.
    pub fn chain(&self, load: &Load) -> ChainGeometry {
        self.machine.chain(load, &Live)
    }

    /// Returns whether the pins give the frozen chain.
    pub fn give_chain(&self, frozen: &ChainGeometry, load: &Load) -> bool {
        self.machine.give_chain(frozen, load)
    }

    /// Shows the hash of everything that affects the joints, for callers outside real time.
    pub fn show_kinematics_hash(&self, hash: u32) {
        self.machine.kinematics_hash.set(hash);
    }

    /// Reads box `k` of the workspace, and the hash of its geometry.
    pub fn workspace_box(&self, k: usize, layout: &Layout) -> (WorkspaceBox, u32) {
        let pins = &self.boxes[k.min(MAX_BOXES - 1)];
        (pins.given(layout), pins.geometry.get())
    }

    /// Returns the requested tool offset.
    pub fn tool(&self) -> Vector3<f64> {
        Vector3::new(
            self.tool_offset_x.get(),
            self.tool_offset_y.get(),
            self.machine.tool_offset.get(),
        )
    }

    /// Returns the limits of the joints, live, narrowed for their corrections; joints beyond the last one have none.
    pub fn limits(&self, load: &Load) -> [JointLimits; MAX_JOINTS] {
        let mut limits = [JointLimits::ABSENT; MAX_JOINTS];
        let joints = self.joints.iter().take(load.layout.joints());
        for (to, joint) in limits.iter_mut().zip(joints) {
            *to = joint.limits();
        }
        limits
    }

    /// Returns the corrections of the first `count` joints.
    pub fn corrections(&self, count: usize) -> impl Iterator<Item = &CorrectionPins> {
        self.joints.iter().take(count).map(|joint| &joint.correction)
    }

    /// Returns the solver settings, live.
    pub fn solver(&self) -> Solver {
        self.machine.solver(&Live)
    }

    /// Returns the smallest and largest values and largest speeds of the first `count` joints, narrowed for
    /// their corrections.
    pub fn joint_limits(&self, count: usize) -> [Joints; 3] {
        let mut limits = [[0.0; MAX_JOINTS]; 3];
        for (i, joint) in self.joints.iter().enumerate().take(count) {
            let pins = [&joint.min_limit, &joint.max_limit, &joint.max_velocity];
            for (limit, pin) in limits.iter_mut().filter_map(|l| l.get_mut(i)).zip(pins) {
                *limit = pin.get();
            }
            if joint.correction.is_allowed() {
                let JointLimits { least, most, velocity, .. } = joint.limits();
                let rows = limits.iter_mut().filter_map(|l| l.get_mut(i));
                rows.zip([least, most, velocity]).for_each(|(limit, value)| *limit = value);
            }
        }
        limits
    }

    pub fn machine_on(&self) -> bool {
        self.machine_on.get()
    }

    pub fn apply(&self) -> bool {
        self.apply.get()
    }

    pub fn fault_reset(&self) -> bool {
        self.fault_reset.get()
    }

    /// Shows a fault: the code, the number of the leg or joint (−1: none), and increments the count.
    pub fn show_fault(&self, fault: &Fault) {
        self.fault.set(fault.cause.code());
        self.fault_leg.set(fault.number().map_or(-1, i32::from));
        self.fault_count.set(self.fault_count.get().wrapping_add(1));
    }

    /// Clears the shown fault; the count stays.
    pub fn clear_fault(&self) {
        self.fault.set(0);
        self.fault_leg.set(-1);
    }

    /// Shows a pose (machine units, degrees).
    pub fn show_pose(&self, pose: [f64; 6]) {
        for ((out, gui), value) in self.pose.iter().zip(&self.skgui).zip(pose) {
            out.set(value);
            gui.set(value);
        }
    }

    /// Shows the coordinates that constraints determine, of the pose of the control point in base.
    pub fn show_dependent(&self, load: &Load, pose: &Pose) {
        self.dependent.show(load, pose);
    }

    pub fn show_corrections(&self, load: &Load, corrections: &PerLeg) {
        self.machine.show_corrections(load, corrections);
    }

    /// Shows whether a search runs; only a module with boxes has the pin.
    pub fn show_searching(&self, searching: bool) {
        self.searching.set(searching);
    }

    pub fn show_tool(&self, tool: &Vector3<f64>) {
        for (pin, value) in self.tool_offset_eff.iter().zip(tool.iter()) {
            pin.set(*value);
        }
    }

    /// Shows the number of the kinematics in force.
    pub fn show_type(&self, number: usize) {
        for (n, pin) in self.is_type.iter().enumerate() {
            pin.set(n == number);
        }
    }
}
