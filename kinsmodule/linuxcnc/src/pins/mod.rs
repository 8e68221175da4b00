// SPDX-License-Identifier: GPL-2.0-or-later
//! The HAL pins: names, directions, defaults, and the machine read from them.
//!
//! Names and defaults are genhexkins' where the meaning is the same, so that a HAL
//! file for genhexkins works after replacing the name.

use crate::hal::{Component, Direction, HalError, Name, Pin};
use crate::tool::JointLimits;
use kinematics::leg::{CrankGeometry, Kind, SliderGeometry, StrutGeometry};
use kinematics::{
    Fault, Geometry, Joints, Layout, LegGeometry, LegKind, Load, MAX_BOXES, MAX_JOINTS, MAX_LEGS,
    Machine, Method, PerLeg, Solver, Vector3, WorkspaceBox, text,
};

mod guard;

pub use guard::{GuardInputs, GuardPins};

/// Three pins `.x`, `.y`, `.z`.
pub type Vector = [Pin<f64>; 3];

/// Six pins `.x` … `.c`.
pub type Pose6 = [Pin<f64>; 6];

const LETTERS: [&str; 6] = ["x", "y", "z", "a", "b", "c"];

/// Anchors and axes of genhexkins (inches): base, platform, base axis, platform axis.
#[allow(clippy::approx_constant, reason = "genhexkins' own rounding")]
const GENHEXKINS: [[[f64; 3]; 4]; 6] = {
    const D: f64 = 0.707107;
    const P: f64 = 0.866025;
    [
        [[-22.95, 13.25, 0.0], [-1.0, 11.5, 0.0], [D, 0.0, D], [-1.0, 0.0, 0.0]],
        [[22.95, 13.25, 0.0], [1.0, 11.5, 0.0], [0.0, -D, D], [P, 0.5, 0.0]],
        [[22.95, 13.25, 0.0], [10.459, -4.884, 0.0], [-D, 0.0, D], [P, 0.5, 0.0]],
        [[0.0, -26.5, 0.0], [9.459, -6.616, 0.0], [-D, 0.0, D], [P, -0.5, 0.0]],
        [[0.0, -26.5, 0.0], [-9.459, -6.616, 0.0], [0.0, D, D], [P, -0.5, 0.0]],
        [[-22.95, 13.25, 0.0], [-10.459, -4.884, 0.0], [D, 0.0, D], [-1.0, 0.0, 0.0]],
    ]
};

/// Pins of one leg; those that its kind does not have are not made and never read.
#[repr(C)]
pub struct LegPins {
    base: Vector,
    platform: Vector,
    offset: Pin<f64>,
    // Strut.
    base_axis: Vector,
    platform_axis: Vector,
    lead: Pin<f64>,
    correction: Pin<f64>,
    // Slider.
    guide: Vector,
    // Crank.
    axis: Vector,
    arm: Vector,
    // Slider and crank.
    rod: Pin<f64>,
    side: Pin<i32>,
}

/// Pins of one joint.
#[repr(C)]
pub struct JointPins {
    min_limit: Pin<f64>,
    max_limit: Pin<f64>,
    max_velocity: Pin<f64>,
    max_acceleration: Pin<f64>,
}

/// Pins of one box of the workspace; those beyond `boxes=` are not made and never read.
#[repr(C)]
pub struct BoxPins {
    low: Pose6,
    high: Pose6,
    /// Rows of the coordinates X … C, one pin a leg.
    matrix: [[Pin<f64>; MAX_LEGS]; 6],
    steps: Pin<u32>,
    geometry: Pin<u32>,
}

/// All pins; stands in HAL memory.
#[repr(C)]
pub struct Pins {
    legs: [LegPins; MAX_LEGS],
    joints: [JointPins; MAX_JOINTS],
    boxes: [BoxPins; MAX_BOXES],
    searching: Pin<bool>,
    screw_lead: Pin<f64>,
    home: Pose6,
    centre: Vector,
    spindle_offset: Pin<f64>,
    tool_offset: Pin<f64>,
    tool_offset_x: Pin<f64>,
    tool_offset_y: Pin<f64>,
    tool_offset_eff: Vector,
    pub tool_busy: Pin<bool>,
    pub feed_inhibit: Pin<bool>,
    convergence_criterion: Pin<f64>,
    limit_iterations: Pin<u32>,
    residual_limit: Pin<f64>,
    max_error: Pin<f64>,
    pub last_iterations: Pin<u32>,
    pub max_iterations: Pin<u32>,
    pub fwd_kins_fail: Pin<bool>,
    pub residual: Pin<f64>,
    pub assembly: Pin<i32>,
    pose: Pose6,
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
    pub guard: GuardPins,
}

/// What is frozen at `.apply`.
#[derive(Clone, Copy, PartialEq)]
pub struct Given {
    pub geometry: Geometry,
    /// Taken from the native joint values.
    pub offset: PerLeg,
    pub spindle_offset: f64,
}

impl Given {
    /// The machine, or why it is refused.
    pub fn checked(&self) -> Result<Machine, Fault> {
        let machine = Machine::freeze(&self.geometry, &self.offset)?;
        machine.check_tool(&Vector3::new(0.0, 0.0, self.spindle_offset))?;
        Ok(machine)
    }
}

/// Makes pins of one component.
pub struct Maker(Component);

impl Maker {
    pub fn one<T: crate::hal::PinValue>(
        &self,
        pin: &mut Pin<T>,
        direction: Direction,
        name: Name,
        value: T,
    ) -> Result<(), HalError> {
        // SAFETY: only `Pins::create` uses a maker, on pins in HAL memory.
        unsafe { pin.create(self.0, direction, &name, value) }
    }

    fn letters<const M: usize>(
        &self,
        pins: &mut [Pin<f64>; M],
        direction: Direction,
        stem: Name,
        values: [f64; M],
    ) -> Result<(), HalError> {
        for ((pin, letter), value) in pins.iter_mut().zip(LETTERS).zip(values) {
            let mut name = stem;
            name.push(letter);
            self.one(pin, direction, name, value)?;
        }
        Ok(())
    }
}

impl LegPins {
    fn create(&mut self, make: &Maker, n: usize, kind: Kind) -> Result<(), HalError> {
        use Direction::In;
        // genhexkins' machine where it has such a leg, so that its HAL files work.
        let drop_in = (kind == Kind::Strut).then(|| GENHEXKINS.get(n)).flatten();
        let [base, platform, base_axis, platform_axis] = *drop_in.unwrap_or(&[[0.0; 3]; 4]);
        make.letters(&mut self.base, In, text!["pkmkins.base.", n, "."], base)?;
        make.letters(&mut self.platform, In, text!["pkmkins.platform.", n, "."], platform)?;
        make.one(&mut self.offset, In, text!["pkmkins.offset.", n], 0.0)?;
        match kind {
            Kind::Strut => self.create_strut(make, n, base_axis, platform_axis),
            Kind::Slider => {
                make.letters(&mut self.guide, In, text!["pkmkins.guide.", n, "."], [0.0; 3])?;
                self.create_rod(make, n)
            }
            Kind::Crank => {
                make.letters(&mut self.axis, In, text!["pkmkins.axis.", n, "."], [0.0; 3])?;
                make.letters(&mut self.arm, In, text!["pkmkins.arm.", n, "."], [0.0; 3])?;
                self.create_rod(make, n)
            }
        }
    }

    fn create_strut(
        &mut self,
        make: &Maker,
        n: usize,
        base: [f64; 3],
        platform: [f64; 3],
    ) -> Result<(), HalError> {
        use Direction::{In, Out};
        make.letters(&mut self.base_axis, In, text!["pkmkins.base-n.", n, "."], base)?;
        let axis = &mut self.platform_axis;
        make.letters(axis, In, text!["pkmkins.platform-n.", n, "."], platform)?;
        make.one(&mut self.lead, In, text!["pkmkins.lead.", n], 0.0)?;
        make.one(&mut self.correction, Out, text!["pkmkins.correction.", n], 0.0)
    }

    fn create_rod(&mut self, make: &Maker, n: usize) -> Result<(), HalError> {
        use Direction::In;
        make.one(&mut self.rod, In, text!["pkmkins.rod.", n], 0.0)?;
        make.one(&mut self.side, In, text!["pkmkins.side.", n], 0)
    }

    /// The leg as the pins give it now; `common_lead` is that of all struts.
    fn given(&self, kind: Kind, common_lead: f64) -> LegGeometry {
        let (base, platform) = (read(&self.base), read(&self.platform));
        match kind {
            Kind::Strut => LegGeometry::strut(base, platform, self.strut(common_lead)),
            Kind::Slider => {
                let (guide, rod, side) = (read(&self.guide), self.rod.get(), self.side.get());
                let kind = LegKind::Slider(SliderGeometry { guide, rod, side });
                LegGeometry { base, platform, kind }
            }
            Kind::Crank => {
                let (axis, arm) = (read(&self.axis), read(&self.arm));
                let (rod, side) = (self.rod.get(), self.side.get());
                let kind = LegKind::Crank(CrankGeometry { axis, arm, rod, side });
                LegGeometry { base, platform, kind }
            }
        }
    }

    fn strut(&self, common_lead: f64) -> StrutGeometry {
        let own = self.lead.get();
        StrutGeometry {
            base_axis: read(&self.base_axis),
            platform_axis: read(&self.platform_axis),
            lead: if own == 0.0 { common_lead } else { own },
        }
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
            make.one(pin, In, text!["pkmkins.", name, ".", n], value)?;
        }
        Ok(())
    }

    fn limits(&self) -> JointLimits {
        JointLimits {
            least: self.min_limit.get(),
            most: self.max_limit.get(),
            velocity: self.max_velocity.get(),
            acceleration: self.max_acceleration.get(),
        }
    }
}

impl BoxPins {
    fn create(&mut self, make: &Maker, k: usize, load: &Load) -> Result<(), HalError> {
        use Direction::In;
        make.letters(&mut self.low, In, text!["pkmkins.box.", k, ".low."], [0.0; 6])?;
        make.letters(&mut self.high, In, text!["pkmkins.box.", k, ".high."], [0.0; 6])?;
        for letter in load.layout.coordinates().as_slice() {
            let row = letter.index().min(5);
            for (n, pin) in self.matrix[row].iter_mut().enumerate().take(load.layout.legs()) {
                let name = text!["pkmkins.box.", k, ".matrix.", LETTERS[row], ".", n];
                make.one(pin, In, name, 0.0)?;
            }
        }
        make.one(&mut self.steps, In, text!["pkmkins.box.", k, ".steps"], 0)?;
        make.one(&mut self.geometry, In, text!["pkmkins.box.", k, ".geometry"], 0)
    }

    fn given(&self, layout: &Layout) -> WorkspaceBox {
        let mut given = WorkspaceBox {
            low: read(&self.low),
            high: read(&self.high),
            steps: self.steps.get(),
            ..WorkspaceBox::EMPTY
        };
        for letter in layout.coordinates().as_slice() {
            let row = letter.index().min(5);
            let places = given.matrix[row].iter_mut().zip(&self.matrix[row]);
            for (place, pin) in places.take(layout.legs()) {
                *place = pin.get();
            }
        }
        given
    }
}

impl Pins {
    /// Makes all pins; `self` must stand in memory from [`Component::allocate`].
    pub fn create(&mut self, component: Component, load: &Load) -> Result<(), HalError> {
        let make = Maker(component);
        for (n, (leg, kind)) in self.legs.iter_mut().zip(load.kinds()).enumerate() {
            leg.create(&make, n, *kind)?;
        }
        for (n, joint) in self.joints.iter_mut().enumerate().take(load.layout.joints()) {
            joint.create(&make, n)?;
        }
        for (k, pins) in self.boxes.iter_mut().enumerate().take(load.boxes()) {
            pins.create(&make, k, load)?;
        }
        if load.boxes() > 0 {
            let searching = &mut self.searching;
            make.one(searching, Direction::Out, text!["pkmkins.searching"], false)?;
        }
        self.create_inputs(&make)?;
        self.create_outputs(&make)?;
        self.guard.create(&make, &load.layout)
    }

    fn create_inputs(&mut self, make: &Maker) -> Result<(), HalError> {
        use Direction::In;
        make.one(&mut self.screw_lead, In, text!["pkmkins.screw-lead"], 0.0)?;
        make.letters(&mut self.home, In, text!["pkmkins.home."], [f64::NAN; 6])?;
        make.letters(&mut self.centre, In, text!["pkmkins.centre."], [0.0; 3])?;
        make.one(&mut self.spindle_offset, In, text!["pkmkins.spindle-offset"], 0.0)?;
        make.one(&mut self.tool_offset, In, text!["pkmkins.tool-offset"], 0.0)?;
        make.one(&mut self.tool_offset_x, In, text!["pkmkins.tool-offset-x"], 0.0)?;
        make.one(&mut self.tool_offset_y, In, text!["pkmkins.tool-offset-y"], 0.0)?;
        make.one(
            &mut self.convergence_criterion,
            In,
            text!["pkmkins.convergence-criterion"],
            1e-9,
        )?;
        make.one(&mut self.limit_iterations, In, text!["pkmkins.limit-iterations"], 120)?;
        make.one(&mut self.residual_limit, In, text!["pkmkins.residual-limit"], 0.0)?;
        make.one(&mut self.max_error, In, text!["pkmkins.max-error"], 500.0)?;
        make.one(&mut self.machine_on, In, text!["pkmkins.machine-on"], false)?;
        make.one(&mut self.apply, In, text!["pkmkins.apply"], false)?;
        make.one(&mut self.fault_reset, In, text!["pkmkins.fault-reset"], false)
    }

    fn create_outputs(&mut self, make: &Maker) -> Result<(), HalError> {
        use Direction::Out;
        let (eff, pose, gui) = (&mut self.tool_offset_eff, &mut self.pose, &mut self.skgui);
        make.letters(eff, Out, text!["pkmkins.tool-offset-eff-"], [0.0; 3])?;
        make.one(&mut self.tool_busy, Out, text!["pkmkins.tool-busy"], false)?;
        make.one(&mut self.feed_inhibit, Out, text!["pkmkins.feed-inhibit"], false)?;
        make.letters(pose, Out, text!["pkmkins."], [0.0; 6])?;
        make.letters(gui, Out, text!["skgui."], [0.0; 6])?;
        make.one(&mut self.last_iterations, Out, text!["pkmkins.last-iterations"], 0)?;
        make.one(&mut self.max_iterations, Out, text!["pkmkins.max-iterations"], 0)?;
        make.one(&mut self.fwd_kins_fail, Out, text!["pkmkins.fwd-kins-fail"], false)?;
        make.one(&mut self.residual, Out, text!["pkmkins.residual"], 0.0)?;
        make.one(&mut self.assembly, Out, text!["pkmkins.assembly"], 0)?;
        for (n, pin) in self.is_type.iter_mut().enumerate() {
            make.one(pin, Out, text!["kinstype.is-", n], n == 0)?;
        }
        make.one(&mut self.geometry_ok, Out, text!["pkmkins.geometry-ok"], false)?;
        make.one(&mut self.geometry_hash, Out, text!["pkmkins.geometry-hash"], 0)?;
        make.one(&mut self.geometry_changed, Out, text!["pkmkins.geometry-changed"], false)?;
        make.one(&mut self.fault, Out, text!["pkmkins.fault"], 0)?;
        make.one(&mut self.fault_leg, Out, text!["pkmkins.fault-leg"], -1)?;
        make.one(&mut self.fault_count, Out, text!["pkmkins.fault-count"], 0)
    }

    /// What enters the joint values as the pins give it now, the tool aside.
    pub fn given(&self, load: &Load) -> Given {
        let common_lead = self.screw_lead.get();
        let kind = |i: usize| load.kinds().get(i).copied().unwrap_or(Kind::Strut);
        let mut geometry = Geometry::of_layout(load.layout, |i| {
            self.legs[i.min(MAX_LEGS - 1)].given(kind(i), common_lead)
        });
        geometry.centre = read(&self.centre);
        // All NaN is the default and means that no reference pose was given.
        let home = read(&self.home);
        geometry.home = (!home.iter().all(|v| v.is_nan())).then_some(home);
        let mut offset = [0.0; MAX_LEGS];
        for (value, leg) in offset.iter_mut().zip(&self.legs).take(load.layout.legs()) {
            *value = leg.offset.get();
        }
        Given { geometry, offset, spindle_offset: self.spindle_offset.get() }
    }

    /// Box `k` of the workspace as the pins give it now, and the hash of its geometry.
    pub fn workspace_box(&self, k: usize, layout: &Layout) -> (WorkspaceBox, u32) {
        let pins = &self.boxes[k.min(MAX_BOXES - 1)];
        (pins.given(layout), pins.geometry.get())
    }

    /// The tool vector o that is asked for, with the spindle offset in force.
    pub fn tool(&self, spindle_offset: f64) -> Vector3<f64> {
        Vector3::new(
            self.tool_offset_x.get(),
            self.tool_offset_y.get(),
            spindle_offset + self.tool_offset.get(),
        )
    }

    /// Limits of the joints, live; those beyond the last joint are none.
    pub fn limits(&self, load: &Load) -> [JointLimits; MAX_JOINTS] {
        let mut limits = [JointLimits::ABSENT; MAX_JOINTS];
        let joints = self.joints.iter().take(load.layout.joints());
        for (to, joint) in limits.iter_mut().zip(joints) {
            *to = joint.limits();
        }
        limits
    }

    /// Solver settings, live.
    pub fn solver(&self) -> Solver {
        Solver {
            convergence_criterion: self.convergence_criterion.get(),
            limit_iterations: self.limit_iterations.get(),
            residual_limit: self.residual_limit.get(),
            method: Method::Certified,
        }
    }

    /// Smallest and largest values and largest speeds of the first `count` joints.
    pub fn joint_limits(&self, count: usize) -> [Joints; 3] {
        let mut limits = [[0.0; MAX_JOINTS]; 3];
        for (i, joint) in self.joints.iter().enumerate().take(count) {
            let pins = [&joint.min_limit, &joint.max_limit, &joint.max_velocity];
            for (limit, pin) in limits.iter_mut().filter_map(|l| l.get_mut(i)).zip(pins) {
                *limit = pin.get();
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

    /// Shows a fault: the code, the number of the leg or joint (−1: none), one more counted.
    pub fn show_fault(&self, fault: &Fault) {
        self.fault.set(fault.cause.code());
        self.fault_leg.set(fault.number().map_or(-1, i32::from));
        self.fault_count.set(self.fault_count.get().wrapping_add(1));
    }

    /// Takes the shown fault back; the count stays.
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

    pub fn show_corrections(&self, load: &Load, corrections: &PerLeg) {
        for ((leg, kind), value) in self.legs.iter().zip(load.kinds()).zip(corrections) {
            if *kind == Kind::Strut {
                leg.correction.set(*value);
            }
        }
    }

    /// Only a module with boxes has the pin.
    pub fn show_searching(&self, searching: bool) {
        self.searching.set(searching);
    }

    pub fn show_tool(&self, tool: &Vector3<f64>) {
        for (pin, value) in self.tool_offset_eff.iter().zip(tool.iter()) {
            pin.set(*value);
        }
    }

    pub fn show_type(&self, number: i32) {
        for (n, pin) in self.is_type.iter().enumerate() {
            pin.set(n as i32 == number);
        }
    }
}

fn read<const M: usize>(pins: &[Pin<f64>; M]) -> [f64; M] {
    pins.each_ref().map(Pin::get)
}
