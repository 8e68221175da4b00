// SPDX-License-Identifier: GPL-2.0-or-later
//! What the module remembers between calls, and the rules that go with it: when a
//! geometry is frozen, which tool offset holds, from which pose forward starts.

use crate::calls::Calls;
use crate::crossing::{Crossing, Sighting};
use crate::guard::{Guard, Scene};
use crate::hal::{nanoseconds, print_error};
use crate::pins::{Given, Pins};
use crate::start::Start;
use crate::tool::{Cycle, NOTICEABLE, Tool, shift};
use kinematics::{
    Cause, Fault, Jacobian, Joints, Layout, Letter, Load, MAX_JOINTS, Machine, MachinePart, Pose,
    Solution, Vector3, text,
};

/// Cycles without a fault after which the same fault is told again.
const QUIET_CYCLES: u32 = 1000;

/// Most different faults that are told before a quiet while.
const MOST_TOLD: usize = 4;

/// Kinds of forward calls that LinuxCNC makes (feedback, command), told apart by
/// where they keep their pose.
const CALLERS: usize = 2;

/// The geometry in use.
struct Frozen {
    machine: Machine,
    given: Given,
}

/// Last good pose of one kind of forward call.
#[derive(Clone, Copy)]
struct Caller {
    /// Address of the pose that LinuxCNC keeps for this kind of call.
    address: usize,
    pose: Pose,
    /// The seed LinuxCNC holds is not a pose (the kinematics were switched), or the pose
    /// of another tool.
    seed_is_stale: bool,
}

/// Kinematics in force.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Machine,
    Identity,
}

/// What the monitor has told the operator.
struct Report {
    /// Whether the monitor runs: it then does the telling.
    monitored: bool,
    pending: Option<Fault>,
    /// Told since the last quiet while; when it is full, nothing more is told until then.
    told: [Option<(Cause, Option<MachinePart>)>; MOST_TOLD],
    /// Cycles since the last fault.
    quiet: u32,
}

/// State between calls.
pub struct Module {
    pins: &'static Pins,
    load: Load,
    frozen: Option<Frozen>,
    kind: Kind,
    apply_was: bool,
    reset_was: bool,
    /// Once `.apply` was used, no call freezes by itself.
    apply_used: bool,
    tool: Tool,
    calls: Calls,
    callers: [Option<Caller>; CALLERS],
    /// The kinematics were switched back to the machine: a caller not yet known holds
    /// joint values as its seed.
    switched_back: bool,
    /// The same, and forward has found no pose of the joints since: what LinuxCNC takes for the
    /// pose may be one from before the switch, far from where the joints are.
    pose_is_unknown: bool,
    /// Forward was refused, and no pose has been asked for since: LinuxCNC may hand the NaN of the
    /// refusal over to inverse.
    refused: bool,
    /// Joints commanded last in identity kinematics, where there was a call.
    identity_joints: Option<Joints>,
    /// Last good pose of any kind of call.
    last_pose: Option<Pose>,
    /// Whether `.machine-on` was ever true: only then does false mean that it is off.
    machine_was_on: bool,
    /// The start without a seed.
    start: Start,
    crossing: Crossing,
    report: Report,
    guard: Guard,
}

impl Module {
    pub fn new(pins: &'static Pins, load: Load) -> Self {
        Self {
            pins,
            load,
            frozen: None,
            kind: Kind::Machine,
            apply_was: false,
            reset_was: false,
            apply_used: false,
            tool: Tool::new(),
            calls: Calls::default(),
            callers: [None; CALLERS],
            switched_back: false,
            pose_is_unknown: false,
            refused: false,
            identity_joints: None,
            last_pose: None,
            machine_was_on: false,
            start: Start::new(),
            crossing: Crossing::new(),
            report: Report { monitored: false, pending: None, told: [None; MOST_TOLD], quiet: 0 },
            guard: Guard::new(),
        }
    }

    pub fn kind(&self) -> Kind {
        self.kind
    }

    pub fn layout(&self) -> &Layout {
        &self.load.layout
    }

    /// Joints of a pose in degrees, written to `joints`; left alone after an error.
    ///
    /// Changes nothing that a later call would depend on, so that LinuxCNC may ask for end
    /// points of queued moves at any time; the first call of all freezes the geometry.
    #[inline(always)]
    pub fn inverse(&mut self, degrees: &[f64; 6], joints: &mut [f64]) -> Result<(), Fault> {
        let timed = self.report.monitored && self.calls.awaits_command();
        let begin = nanoseconds_if(timed);
        let pose = Pose::from_degrees(*degrees);
        let result = match self.prepared(|| !is_zero(degrees)) {
            Ok(()) if self.pose_is_unknown => Err(Cause::PoseUnknown.into()),
            Ok(()) => self.joints_of(&pose, joints),
            Err(fault) => Err(fault),
        };
        self.calls.saw_inverse(&pose);
        if timed {
            self.guard.timed_inverse(nanoseconds().wrapping_sub(begin));
        }
        let Err(fault) = result else {
            self.refused = false;
            return Ok(());
        };
        if !(self.refused && is_consequence(fault.cause)) {
            self.record(&fault);
        }
        Err(fault)
    }

    #[inline(always)]
    fn joints_of(&self, pose: &Pose, joints: &mut [f64]) -> Result<(), Fault> {
        let (frozen, tool) = (self.frozen()?, self.tool.offset());
        let request = self.pins.tool(frozen.given.spindle_offset);
        if self.tool.has(&request) {
            return frozen.machine.inverse_into(pose, &tool, joints);
        }
        let tool = self.tool_instead_of(frozen, request)?;
        let found = frozen.machine.inverse(&{ *pose }, &tool)?;
        for (joint, value) in joints.iter_mut().zip(found) {
            *joint = value;
        }
        Ok(())
    }

    /// Pose of the joints in degrees, which takes the place of the seed's; `address` tells the
    /// kind of call, the seed may hold NaN.
    pub fn forward(
        &mut self,
        joints: &Joints,
        pose: &mut [f64; 6],
        address: usize,
    ) -> Result<(), Fault> {
        let timed = self.report.monitored && !self.calls.awaits_command();
        let begin = nanoseconds_if(timed);
        self.calls.saw_forward();
        let result = self.pose_at(joints, pose, address);
        if timed {
            self.guard.timed_forward(nanoseconds().wrapping_sub(begin));
        }
        result
    }

    fn pose_at(
        &mut self,
        joints: &Joints,
        pose: &mut [f64; 6],
        address: usize,
    ) -> Result<(), Fault> {
        self.forget_before_homing();
        let seed = &Pose::from_degrees(*pose);
        let prepared = self.prepared(|| !(is_zero(joints) && is_blank(&seed.to_degrees())));
        // LinuxCNC calls with all joints 0 until it knows them: a failure is no fault then.
        let unhomed = self.last_pose.is_none() && is_zero(joints);
        let mut solution = Solution::NONE;
        let mut result = prepared.and_then(|()| self.solve(joints, seed, address, &mut solution));
        if unhomed && result.as_ref().is_err_and(|fault| is_of_joints(fault.cause)) {
            return Err(Cause::NotHomed.into());
        }
        if result.is_ok() {
            // A pose that is refused below is what the joints lead to nevertheless.
            self.remember(address, solution.pose);
            result = self.refuse_beyond_singular(joints, &solution.pose);
        }
        self.refused = result.is_err();
        self.pins.fwd_kins_fail.set(self.refused);
        self.show_start();
        if result.is_ok() {
            *pose = solution.pose.to_degrees();
            self.show(&solution, *pose);
        }
        if !self.report.monitored {
            self.watch_geometry();
            self.show_assembly();
        }
        if let Err(fault) = result
            && fault.cause == Cause::Searching
        {
            return Err(fault);
        }
        self.recorded(result)
    }

    /// Refuses the pose found while the commanded motion is beyond a singular pose.
    ///
    /// Once it is, this stays so without a commanded pose as well, until the machine is off.
    fn refuse_beyond_singular(&mut self, joints: &Joints, found: &Pose) -> Result<(), Fault> {
        let Some(commanded) = self.calls.commanded_before() else {
            if !self.crossing.has_passed() {
                return Ok(());
            }
            if self.is_off() {
                self.crossing = Crossing::new();
                return Ok(());
            }
            return Err(Cause::SingularPassed.into());
        };
        let Some(Frozen { machine, .. }) = &self.frozen else { return Ok(()) };
        let (tool, solver) = (&self.tool.offset(), &self.pins.solver());
        let sighting = Sighting { machine, tool, solver, joints, found, commanded };
        self.crossing.look(&sighting);
        if self.crossing.has_passed() { Err(sighting.refusal()) } else { Ok(()) }
    }

    /// Drops what was known of the pose when joints had to be homed in between.
    fn forget_before_homing(&mut self) {
        if self.start.resumes() {
            self.callers = [None; CALLERS];
            self.last_pose = None;
        }
    }

    fn show_start(&self) {
        if self.start.has_boxes() {
            self.pins.show_searching(self.start.is_searching());
        }
    }

    /// Pose of the joints for the tool frame: no state changes, no fault is recorded.
    pub fn pose_of(&self, joints: &Joints) -> Result<Pose, Fault> {
        let machine = &self.frozen()?.machine;
        let seed = self.last_pose.or(self.reference()).ok_or(Cause::SeedMissing)?;
        let tool = self.tool_in_effect()?;
        Ok(machine.forward(joints, &seed, &tool, &self.pins.solver())?.pose)
    }

    /// ∂q/∂(x … c), joint units per machine unit and per degree, row by row.
    pub fn jacobian(&self, pose: &Pose) -> Result<Jacobian, Fault> {
        let tool = self.tool_in_effect()?;
        self.frozen()?.machine.at(pose, &tool)?.pose_jacobian()
    }

    /// Changes the kinematics: 0 the machine, 1 identity.
    pub fn switch(&mut self, number: i32) -> Result<(), Fault> {
        match self.switched_to(number) {
            Ok(kind) => self.kind = kind,
            Err(fault) => {
                self.tell_unmonitored(&fault);
                return self.recorded(Err(fault));
            }
        }
        self.pins.show_type(number);
        Ok(())
    }

    /// What a switch changes beside the kind of the kinematics; nothing where it is refused.
    fn switched_to(&mut self, number: i32) -> Result<Kind, Fault> {
        let kind = self.kind_of(number)?;
        match kind {
            _ if kind == self.kind => {}
            Kind::Identity => {
                self.identity_joints = None;
                self.crossing = Crossing::new();
            }
            Kind::Machine => {
                self.find_pose_again()?;
                self.switched_back = true;
                self.pose_is_unknown = true;
            }
        }
        Ok(kind)
    }

    /// Follows the joints from the last pose to where the identity kinematics have moved them.
    ///
    /// LinuxCNC does not look whether the first forward after a switch succeeds, and would go on
    /// from the pose before. Where no pose was ever known, as before homing, there is none to start
    /// from, and nothing is refused here.
    fn find_pose_again(&mut self) -> Result<(), Fault> {
        let Some(last) = self.last_pose else { return Ok(()) };
        let mut pose = last;
        if let Some(joints) = &self.identity_joints {
            let (machine, solver) = (&self.frozen()?.machine, self.pins.solver());
            pose = machine.forward(joints, &last, &self.tool.offset(), &solver)?.pose;
            self.last_pose = Some(pose);
        }
        for caller in self.callers.iter_mut().flatten() {
            if self.identity_joints.is_some() {
                caller.pose = pose;
            }
            caller.seed_is_stale = true;
        }
        Ok(())
    }

    fn kind_of(&self, number: i32) -> Result<Kind, Fault> {
        match number {
            0 => Ok(Kind::Machine),
            1 if self.layout().joint_letters().is_some() => Ok(Kind::Identity),
            1 => Err(Cause::IdentityImpossible.into()),
            _ => Err(Fault::with_value(Cause::KinematicsTypeUnknown, f64::from(number))),
        }
    }

    /// Identity kinematics: pose (degrees) of the joints, shown on the pins.
    pub fn identity_forward(&mut self, joints: &Joints, pose: &mut [f64; 6]) -> Result<(), Fault> {
        self.forget_before_homing();
        self.calls.saw_forward();
        let result = self.identity_pose(joints);
        self.pins.fwd_kins_fail.set(result.is_err());
        *pose = self.recorded(result)?;
        self.identity_joints = Some(*joints);
        self.pins.show_pose(*pose);
        Ok(())
    }

    /// Each joint at its letter's place, 0 at those that no joint moves.
    pub fn identity_pose(&self, joints: &Joints) -> Result<[f64; 6], Fault> {
        let mut world = [0.0; 6];
        if let Some(i) = joints.iter().position(|v| !v.is_finite()) {
            return Err(Fault::of_joint(Cause::JointNotFinite, self.layout(), i, joints[i]));
        }
        for (letter, value) in self.layout().joint_letters().into_iter().flatten().zip(joints) {
            if let Some(place) = world.get_mut(letter.index()) {
                *place = *value;
            }
        }
        Ok(world)
    }

    /// ∂q/∂(x … c) of the identity kinematics.
    pub fn identity_jacobian(&self) -> Jacobian {
        let mut jacobian = Jacobian::zeros();
        for (i, letter) in self.layout().joint_letters().into_iter().flatten().enumerate() {
            if let Some(place) = jacobian.get_mut((i, letter.index())) {
                *place = 1.0;
            }
        }
        jacobian
    }

    /// Identity kinematics: joint j is the pose's (degrees) j-th letter.
    pub fn identity_inverse(&mut self, pose: &[f64; 6], joints: &mut [f64]) -> Result<(), Fault> {
        if !pose.iter().all(|v| v.is_finite()) {
            return self.recorded(Err(Cause::PoseNotFinite.into()));
        }
        let held = self.refuse_held(pose);
        self.recorded(held)?;
        let letters = self.layout().joint_letters().into_iter().flatten();
        let mut commanded = [0.0; MAX_JOINTS];
        for ((joint, kept), letter) in joints.iter_mut().zip(&mut commanded).zip(letters) {
            *joint = pose.get(letter.index()).copied().unwrap_or(0.0);
            *kept = *joint;
        }
        if self.calls.takes_command() {
            self.identity_joints = Some(commanded);
        }
        Ok(())
    }

    /// Refuses a value for a letter that no joint moves: nothing would bring it back to 0.
    fn refuse_held(&self, pose: &[f64; 6]) -> Result<(), Fault> {
        // Before a geometry is known rounding is that of one machine unit.
        let size = self.frozen.as_ref().map_or(1.0, |frozen| frozen.machine.size());
        for (letter, value) in Letter::ALL.into_iter().zip(pose) {
            if self.layout().is_held(letter) {
                letter.check_held(*value, size)?;
            }
        }
        Ok(())
    }

    /// The servo-thread function beside the kinematics calls: watches `.apply`, moves the
    /// tool offset, shows what only people read, guards the motion, and tells the operator
    /// about faults.
    pub fn monitor(&mut self, seconds: f64) {
        self.report.monitored = true;
        self.start.count_cycle();
        self.watch_apply();
        self.watch_reset();
        let commanded = self.calls.end_cycle();
        self.advance_tool(commanded, seconds);
        self.watch_geometry();
        if let Some(fault) = self.guarded(commanded, seconds) {
            self.record(&fault);
        }
        self.pins.feed_inhibit.set(self.inhibits_feed());
        self.report.tell_pending();
    }

    /// A cycle of the guard, `period` seconds long.
    fn guarded(&mut self, commanded: Option<Pose>, period: f64) -> Option<Fault> {
        let Some(frozen) = self.frozen.as_ref().filter(|_| self.kind == Kind::Machine) else {
            self.guard.idle(self.pins, period);
            self.show_assembly();
            return None;
        };
        self.guard.run(&Scene {
            pins: self.pins,
            machine: &frozen.machine,
            tool: &self.tool.offset(),
            pose: self.last_pose,
            commanded,
            period,
        })
    }

    /// Reads the pins that ask for something, and freezes what has to be frozen before a
    /// kinematics call; `drop_in` tells whether the call may do so without `.apply`.
    fn prepared(&mut self, drop_in: impl Fn() -> bool) -> Result<(), Fault> {
        if !self.report.monitored {
            self.watch_reset();
        }
        self.machine_was_on |= self.pins.machine_on();
        self.watch_apply();
        if self.frozen.is_none() && !self.apply_used && drop_in() {
            let result = self.freeze();
            if let Err(fault) = &result {
                self.tell_unmonitored(fault);
            }
            return result;
        }
        Ok(())
    }

    /// Honours a rising edge of `.apply`.
    fn watch_apply(&mut self) {
        let apply = self.pins.apply();
        let rising = apply && !self.apply_was;
        self.apply_was = apply;
        if !rising {
            return;
        }
        self.apply_used = true;
        let result =
            if self.pins.machine_on() { Err(Cause::ApplyWhileOn.into()) } else { self.freeze() };
        if let Err(fault) = result {
            self.record(&fault);
            self.tell_unmonitored(&fault);
        }
    }

    /// Takes the geometry of the pins, or leaves the last good one in force.
    fn freeze(&mut self) -> Result<(), Fault> {
        let given = self.pins.given(&self.load);
        let hash = given.geometry.hash();
        let checked = given.checked().and_then(|machine| {
            self.start.freeze(self.pins, &self.load, hash)?;
            Ok(machine)
        });
        self.pins.geometry_ok.set(checked.is_ok());
        let machine = checked?;
        self.pins.geometry_hash.set(hash);
        self.pins.geometry_changed.set(false);
        let tool = self.pins.tool(given.spindle_offset);
        if machine.check_tool(&tool).is_ok() {
            self.tool.take(tool);
        }
        self.guard.forget();
        // What was commanded to the machine before says nothing of this one.
        self.calls = Calls::default();
        self.crossing = Crossing::new();
        self.frozen = Some(Frozen { machine, given });
        self.pins.show_tool(&self.tool.offset());
        self.callers = [None; CALLERS];
        self.switched_back = false;
        self.last_pose = None;
        self.pins.max_iterations.set(0);
        Ok(())
    }

    fn frozen(&self) -> Result<&Frozen, Fault> {
        self.frozen.as_ref().ok_or(Cause::NoGeometry.into())
    }

    /// Shows whether the pins differ from the frozen values.
    fn watch_geometry(&self) {
        // NaN on a pin counts as a change: a frozen geometry holds none.
        let changed =
            self.frozen.as_ref().is_some_and(|frozen| self.pins.given(&self.load) != frozen.given);
        self.pins.geometry_changed.set(changed);
    }

    fn reference(&self) -> Option<Pose> {
        let home = self.frozen.as_ref()?.given.geometry.home?;
        Some(Pose::from_degrees(home))
    }

    /// The tool offset to compute with.
    ///
    /// A request takes effect at once with the machine off and before any pose is known.
    /// Otherwise the monitor brings it into effect, without which that happens where it
    /// moves no joint: while the platform is level.
    #[inline(always)]
    fn tool_in_effect(&self) -> Result<Vector3<f64>, Fault> {
        let (frozen, tool) = (self.frozen()?, self.tool.offset());
        let request = self.pins.tool(frozen.given.spindle_offset);
        if self.tool.has(&request) {
            return Ok(tool);
        }
        self.tool_instead_of(frozen, request)
    }

    /// The tool offset to compute with where it is not the one requested.
    #[inline(never)]
    fn tool_instead_of(
        &self,
        frozen: &Frozen,
        request: Vector3<f64>,
    ) -> Result<Vector3<f64>, Fault> {
        let tool = self.tool.offset();
        frozen.machine.check_tool(&request)?;
        if self.is_off() {
            return Ok(request);
        }
        let Some(pose) = self.last_pose else {
            return Ok(request);
        };
        if self.report.monitored {
            return self.tool.refusal(&request).map_or(Ok(tool), Err);
        }
        let jump = shift(&pose, &(request - tool)).norm();
        if jump <= NOTICEABLE * frozen.machine.size() {
            return Ok(request);
        }
        Err(Fault::with_value(Cause::ToolChangedTilted, jump))
    }

    /// Whether the machine is off, as far as this can be known: a HAL file that does not
    /// connect `.machine-on` never tells.
    fn is_off(&self) -> bool {
        (self.machine_was_on || self.report.monitored) && !self.pins.machine_on()
    }

    /// Brings the tool offset nearer to the one requested, and shows how far it is.
    fn advance_tool(&mut self, commanded: Option<Pose>, seconds: f64) {
        if let Ok(tool) = self.tool_in_effect() {
            self.retool(tool);
        }
        let of_this_cycle = self.tool.offset();
        if let Err(fault) = self.tool_advanced(commanded, seconds) {
            self.record(&fault);
        }
        let shown = if self.tool.is_busy() { of_this_cycle } else { self.tool.offset() };
        self.pins.show_tool(&shown);
        self.pins.tool_busy.set(self.tool.is_busy());
    }

    fn tool_advanced(&mut self, commanded: Option<Pose>, seconds: f64) -> Result<(), Fault> {
        let Some(Frozen { machine, given }) = &self.frozen else {
            return Ok(());
        };
        let request = self.pins.tool(given.spindle_offset);
        if self.tool.is_at(&request) {
            return Ok(());
        }
        let (limits, solver) = (self.pins.limits(&self.load), self.pins.solver());
        self.tool.advance(&Cycle { machine, limits, solver, request, commanded, seconds })
    }

    /// Whether no motion may begin or go on.
    fn inhibits_feed(&self) -> bool {
        self.tool.is_busy() || self.guard.inhibits_feed()
    }

    /// Takes a tool offset. The joints stay, so that the poses move.
    fn retool(&mut self, tool: Vector3<f64>) {
        let change = tool - self.tool.offset();
        if change == Vector3::zeros() {
            return;
        }
        self.tool.take(tool);
        if let Some(pose) = &mut self.last_pose {
            pose.position -= shift(pose, &change);
        }
        for Caller { pose, seed_is_stale, .. } in self.callers.iter_mut().flatten() {
            pose.position -= shift(pose, &change);
            *seed_is_stale = true;
        }
    }

    /// Takes the tool offset that forward has to go by.
    #[inline(always)]
    fn retool_for_forward(&mut self) -> Result<(), Fault> {
        let request = self.pins.tool(self.frozen()?.given.spindle_offset);
        if self.tool.has(&request) {
            return Ok(());
        }
        self.retool_if_asked(request)
    }

    #[inline(never)]
    fn retool_if_asked(&mut self, request: Vector3<f64>) -> Result<(), Fault> {
        let usable = self.frozen()?.machine.check_tool(&request).is_ok();
        let of_command = self.calls.is_for_commanded_joints();
        if self.report.monitored && of_command && usable {
            self.retool(request);
        } else if let Ok(tool) = self.tool_in_effect() {
            // A refused tool change must not blind the display: the old offset still holds.
            self.retool(tool);
        }
        Ok(())
    }

    fn solve(
        &mut self,
        joints: &Joints,
        seed: &Pose,
        address: usize,
        solution: &mut Solution,
    ) -> Result<(), Fault> {
        self.retool_for_forward()?;
        let tool = self.tool.offset();
        let seed = match self.searched(joints, &tool) {
            Some(found) => Some(found?),
            None => self.seed_for(seed, address),
        };
        let Some(seed) = seed else { return Err(Cause::SeedMissing.into()) };
        let machine = &self.frozen()?.machine;
        if machine.is_literal() {
            return self.solve_first(joints, &seed, &tool, solution);
        }
        machine.forward_into(joints, &seed, &tool, &self.pins.solver(), solution)
    }

    /// Forward while no pose has fixed the folds of nut corrections: a drop-in HAL file has no
    /// reference pose. The first pose known stands in for it, which is the seed, [TRAJ]HOME: it
    /// is the same after every start, where joints that were homed are not. A seed of zeros is
    /// none; then the pose found is the first one known.
    ///
    /// Inverse never decides: LinuxCNC may ask it for the end point of a move that is not made.
    #[cold]
    #[inline(never)]
    fn solve_first(
        &mut self,
        joints: &Joints,
        seed: &Pose,
        tool: &Vector3<f64>,
        solution: &mut Solution,
    ) -> Result<(), Fault> {
        let solver = self.pins.solver();
        let machine = &mut self.frozen.as_mut().ok_or(Cause::NoGeometry)?.machine;
        let is_known = !is_zero(&seed.to_degrees());
        let mut folded = is_known.then(|| machine.fold_at(seed, tool).ok()).flatten();
        if let Err(fault) = machine.forward_into(joints, seed, tool, &solver, solution) {
            machine.unfold();
            return Err(fault);
        }
        if folded.is_none() {
            folded = machine.fold_at(&solution.pose, tool).ok();
        }
        if let Some(doubt) = folded.flatten() {
            self.report.pending = Some(doubt);
            self.tell_unmonitored(&doubt);
        }
        Ok(())
    }

    /// The pose to start from where none is known, if there are boxes to search it in.
    fn searched(&mut self, joints: &Joints, tool: &Vector3<f64>) -> Option<Result<Pose, Fault>> {
        if self.last_pose.is_some() || is_zero(joints) || !self.start.has_boxes() {
            return None;
        }
        let machine = &self.frozen.as_ref()?.machine;
        Some(self.start.seed(machine, joints, tool, &self.pins.solver()))
    }

    /// The pose to start from: LinuxCNC's, unless that is none.
    fn seed_for(&self, seed: &Pose, address: usize) -> Option<Pose> {
        let caller = self.callers.iter().flatten().find(|c| c.address == address);
        let stale = caller.map_or(self.switched_back, |c| c.seed_is_stale);
        let known = caller.map(|c| c.pose).or(self.last_pose);
        match known {
            // With boxes, a caller not yet known hands over [TRAJ]HOME, not a pose it was told.
            Some(pose) if caller.is_none() && self.start.has_boxes() => Some(pose),
            Some(pose) if stale || !seed.is_finite() => Some(pose),
            // After a switch a seed may hold joint values.
            None if stale || !seed.is_finite() => {
                self.reference().or(Some(*seed).filter(Pose::is_finite))
            }
            _ => Some(*seed),
        }
    }

    fn remember(&mut self, address: usize, pose: Pose) {
        self.last_pose = Some(pose);
        self.pose_is_unknown = false;
        let entry = Caller { address, pose, seed_is_stale: false };
        let known = self.callers.iter_mut().flatten().find(|c| c.address == address);
        if let Some(caller) = known {
            *caller = entry;
            return;
        }
        // The newest stands first; a third kind of call would push out the oldest.
        self.callers.rotate_right(1);
        self.callers[0] = Some(entry);
    }

    fn show(&self, solution: &Solution, pose: [f64; 6]) {
        let pins = self.pins;
        pins.last_iterations.set(solution.iterations);
        pins.max_iterations.set(pins.max_iterations.get().max(solution.iterations));
        pins.residual.set(solution.residual);
        pins.show_pose(pose);
        pins.show_tool(&self.tool.offset());
        pins.show_corrections(&self.load, &solution.corrections);
    }

    #[inline(never)]
    fn show_assembly(&self) {
        let sign = self.last_pose.and_then(|pose| {
            let machine = &self.frozen.as_ref()?.machine;
            machine.at(&pose, &self.tool.offset()).ok()?.assembly().ok()
        });
        self.pins.assembly.set(sign.unwrap_or(0));
    }

    /// Records the fault of a refused call.
    fn recorded<T>(&mut self, result: Result<T, Fault>) -> Result<T, Fault> {
        if let Err(fault) = &result {
            self.record(fault);
        }
        result
    }

    fn record(&mut self, fault: &Fault) {
        self.pins.show_fault(fault);
        self.report.pending = Some(*fault);
    }

    /// Honours a rising edge of `.fault-reset`.
    fn watch_reset(&mut self) {
        let reset = self.pins.fault_reset();
        if reset && !self.reset_was {
            self.pins.clear_fault();
            self.crossing = Crossing::new();
            self.report.told = [None; MOST_TOLD];
        }
        self.reset_was = reset;
    }

    /// Without a monitor a refused geometry or kinematics type is told at once: nobody
    /// else would say it, and it does not happen in the course of motion.
    fn tell_unmonitored(&mut self, fault: &Fault) {
        if !self.report.monitored {
            self.report.tell(fault);
        }
    }
}

impl Report {
    /// Tells a pending fault, and forgets what was told after a quiet while.
    fn tell_pending(&mut self) {
        if let Some(fault) = self.pending.take() {
            self.quiet = 0;
            self.tell(&fault);
            return;
        }
        self.quiet = self.quiet.saturating_add(1);
        if self.quiet >= QUIET_CYCLES {
            self.told = [None; MOST_TOLD];
        }
    }

    /// Tells a fault unless it was told already, or too many others were.
    fn tell(&mut self, fault: &Fault) {
        let news = Some((fault.cause, fault.part));
        if self.told.contains(&news) {
            return;
        }
        if let Some(free) = self.told.iter_mut().find(|t| t.is_none()) {
            *free = news;
            let mut message = text!["pkmkins: "];
            fault.tell(&mut message);
            print_error(&message);
        }
    }
}

/// The clock where it is wanted: not free beside calls of some tens of nanoseconds.
fn nanoseconds_if(wanted: bool) -> i64 {
    if wanted { nanoseconds() } else { 0 }
}

/// Whether inverse refuses so after forward was refused: forward's reason is the one to be told.
fn is_consequence(cause: Cause) -> bool {
    matches!(cause, Cause::PoseNotFinite | Cause::PoseUnknown)
}

/// Whether a refusal may come from joints and seed alone, as before homing.
fn is_of_joints(cause: Cause) -> bool {
    use Cause::{
        CriterionInvalid, LimitIterationsInvalid, ResidualLimitInvalid, ToolNotFinite, ToolTooLong,
    };
    !matches!(
        cause,
        CriterionInvalid
            | LimitIterationsInvalid
            | ResidualLimitInvalid
            | ToolNotFinite
            | ToolTooLong
    )
}

/// A seed that says nothing: zeros, or the NaN that a refusal left.
fn is_blank(seed: &[f64; 6]) -> bool {
    is_zero(seed) || seed.iter().all(|v| v.is_nan())
}

fn is_zero<const M: usize>(values: &[f64; M]) -> bool {
    values.iter().all(|v| *v == 0.0)
}
