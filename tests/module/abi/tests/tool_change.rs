// SPDX-License-Identifier: GPL-2.0-or-later
//! Tool offsets that change while the platform is tilted: the monitor moves them, and all
//! joints stay within the limits on their pins.

use abi_tests::geometry::{minus, norm};
use abi_tests::machines::{Hexapod, paper_004, random_hexapod};
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::parallel::Parallel;
use abi_tests::random::{Random, cases};
use abi_tests::subjects::subjects;
use abi_tests::tolerances::{LIMIT_ROUNDING, SAME_COMPONENT, SAME_JOINT_MM};
use kinematics::Cause;

const TILTED: Pose = [10.0, -20.0, 260.0, 12.0, -5.0, 0.0, 0.0, 0.0, 0.0];
const TOOLS: [&str; 3] = ["tool-offset-x", "tool-offset-y", "tool-offset"];
const LONG: [f64; 3] = [5.0, -3.0, 80.0];

/// Upper bound of the cycles of any change in these tests: 3 % of the machine, the shift of a long tool at a tilt
/// of 20°, with the least acceleration in cycles of 250 us takes 12,000.
const MOST_CYCLES: usize = 40_000;

/// Cycles after a change.
const AFTER: usize = 3;

/// LinuxCNC's servo thread with a machine at rest in world mode, with drives that
/// follow exactly.
struct Thread<'a> {
    module: &'a Module,
    pose: Pose,
    period: i64,
    /// Results of inverse in every cycle.
    joints: Vec<Joints>,
}

impl<'a> Thread<'a> {
    /// Starts with the machine on, at rest at a pose.
    fn at(module: &'a Module, pose: Pose) -> Self {
        module.set("machine-on", 1.0);
        let mut thread = Self { module, pose, period: 1_000_000, joints: vec![] };
        for _ in 0..3 {
            thread.cycle().expect("a pose of the workspace");
        }
        thread
    }

    /// Runs one cycle: forward of the feedback, inverse, monitor.
    fn cycle(&mut self) -> Result<(), i32> {
        if let Some(joints) = self.joints.last() {
            self.module.follow(joints, &self.pose).expect("the joints of inverse");
        }
        let asked = self.module.inverse(&self.pose);
        self.module.monitor_in_cycle_of(self.period);
        self.joints.push(asked?);
        Ok(())
    }

    fn cycles(&mut self, count: usize) {
        for _ in 0..count {
            self.cycle().expect("a change goes on");
        }
    }

    /// Runs until no change is under way, plus three cycles; returns the number of cycles.
    fn settle(&mut self) -> Result<usize, i32> {
        for count in 1..MOST_CYCLES {
            self.cycle()?;
            if !self.module.is_on("tool-busy") {
                (0..AFTER).try_for_each(|_| self.cycle())?;
                return Ok(count);
            }
        }
        panic!("a tool change does not end");
    }

    /// Returns the largest ratios of any joint to the limits in successive cycles.
    fn shares(&self, limits: &[(f64, f64)]) -> (f64, f64) {
        let dt = self.period as f64 * 1e-9;
        let (mut speed, mut acceleration) = (0.0_f64, 0.0_f64);
        for (j, (most_speed, most_acceleration)) in limits.iter().enumerate() {
            for three in self.joints.windows(3) {
                let [a, b, c] = [three[0][j], three[1][j], three[2][j]];
                speed = speed.max((c - b).abs() / dt / most_speed);
                acceleration =
                    acceleration.max((c - 2.0 * b + a).abs() / (dt * dt) / most_acceleration);
            }
        }
        (speed, acceleration)
    }
}

fn request(module: &Module, tool: [f64; 3]) {
    for (pin, value) in TOOLS.into_iter().zip(tool) {
        module.set(pin, value);
    }
}

fn in_effect(module: &Module) -> [f64; 3] {
    ["x", "y", "z"].map(|letter| module.get(&format!("tool-offset-eff-{letter}")))
}

fn limit(module: &Module, limits: &[(f64, f64)]) {
    for (j, (speed, acceleration)) in limits.iter().enumerate() {
        module.set(&format!("max-velocity.{j}"), *speed);
        module.set(&format!("max-acceleration.{j}"), *acceleration);
    }
}

/// A hundred times the acceleration of the shipped hexapod, so that changes are short.
const USUAL: [(f64, f64); 6] = [(500.0, 300_000.0); 6];

/// Returns a hexapod at [`TILTED`], on, with the usual limits.
fn hexapod() -> Module {
    let module = paper_004().module();
    limit(&module, &USUAL);
    module
}

fn said(module: &Module) -> String {
    module.messages().into_iter().map(|message| message.text).collect()
}

/// Returns the joints with this initial offset.
fn joints_with(machine: &Parallel, tool: [f64; 3], pose: &Pose) -> Result<Joints, i32> {
    Parallel { tool, ..machine.clone() }.module().inverse(pose)
}

/// Changes the offset of one machine at one pose. `None` if either is out of reach or
/// nearly singular.
fn change(
    machine: &Parallel,
    pose: Pose,
    tools: [[f64; 3]; 2],
    random: &mut Random,
) -> Option<f64> {
    let expected = joints_with(machine, tools[1], &pose).ok()?;
    let machine = Parallel { tool: tools[0], ..machine.clone() };
    let module = machine.module();
    module.follow(&module.inverse(&pose).ok()?, &pose).ok()?;
    // Speeds of a tenth to a whole machine per second, reached in 0.5 to 3 ms, so that changes are short;
    // cranks use degrees, of which the travel over a machine's size is about sixty.
    let size = if machine.size() > 0.0 { machine.size() } else { 1.0 };
    let limits: Vec<_> = (0..machine.joints())
        .map(|_| {
            let speed = size * random.between(0.1, 1.0);
            (speed, speed / random.between(0.0005, 0.003))
        })
        .collect();
    limit(&module, &limits);
    let mut thread = Thread::at(&module, pose);
    thread.period = if random.between(0.0, 1.0) < 0.5 { 250_000 } else { 1_000_000 };
    request(&module, tools[1]);
    thread.cycle().expect("the old offset still holds");
    assert!(module.is_on("tool-busy") && module.is_on("feed-inhibit"));
    match thread.settle() {
        Err(code) if code == Cause::ToolOutOfReach.code() => return None,
        other => other.expect("a change within reach"),
    };
    assert_eq!(in_effect(&module), plus_spindle(&machine, tools[1]));
    assert!(!module.is_on("feed-inhibit"));
    // LinuxCNC's interpolators lag by two points of four: they stand once four equal ones have passed.
    let still = thread.joints.iter().rev().take_while(|joints| **joints == expected).count();
    assert!(still >= 4 + AFTER, "released {still} cycles after the last motion");
    assert_eq!(module.inverse(&pose), Ok(expected), "{machine:?} at {pose:?}");
    let (speed, acceleration) = thread.shares(&limits);
    assert!(
        speed <= 1.0 && acceleration <= 1.0 + LIMIT_ROUNDING,
        "shares {speed}, {acceleration} of the limits: {machine:?} at {pose:?}, {tools:?}"
    );
    Some(speed.max(acceleration))
}

fn plus_spindle(machine: &Parallel, tool: [f64; 3]) -> [f64; 3] {
    [tool[0], tool[1], machine.spindle_offset + tool[2]]
}

fn random_tool(random: &mut Random, size: f64) -> [f64; 3] {
    [random.within(0.03 * size), random.within(0.03 * size), random.between(0.0, 0.1 * size)]
}

#[test]
fn every_machine_changes_tools_at_any_tilt_within_the_limits_of_its_joints() {
    let mut random = Random::new(41);
    let (mut done, mut least_use) = (0, 1.0_f64);
    let tilting: Vec<_> =
        subjects().into_iter().filter(|s| (3..6).any(|c| s.machine.moves(c))).collect();
    let count = cases(20);
    for subject in &tilting {
        for _ in 0..count {
            let size = subject.machine.size();
            let tools = [random_tool(&mut random, size), random_tool(&mut random, size)];
            let pose = (subject.sample)(&mut random);
            if let Some(used) = change(&subject.machine, pose, tools, &mut random) {
                done += 1;
                least_use = least_use.min(used);
            }
        }
    }
    // A few offsets move a carriage or crank out of its reach.
    let all = count * tilting.len();
    assert!(done * 10 >= all * 9, "{done} of {all} within reach");
    // The share of the limits that a step may use (0.3, by one joint at least), less the margins for poses
    // between the sampled ones.
    assert!(least_use > 0.2, "a change uses {least_use} of the limits only");
}

/// Joints of the displayed pose against the measured ones, in millimeters: forward stops if every strut
/// is accurate to the convergence criterion of 1e-9 mm, and the lengths are rounded as well.
const SHOWN_MM: f64 = 1e-8;

/// After forward and inverse the request changes, while the drives still have a hundred thousandth
/// of a degree to move: the displayed pose belongs to the old offset.
#[test]
fn pose_and_tool_offset_on_the_pins_are_of_the_same_cycle() {
    let level = [10.0, -20.0, 260.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let nearly_level = [10.0, -20.0, 260.0, 1e-5, -5e-6, 0.0, 0.0, 0.0, 0.0];
    let module = hexapod();
    let measured = module.inverse(&nearly_level).expect("a pose of the workspace");
    module.set("machine-on", 1.0);
    let mut before = [0.0; 3];
    for tool in [LONG, [0.0; 3], LONG] {
        module.follow(&measured, &level).expect("the joints of inverse");
        module.inverse(&level).expect("a pose of the workspace");
        request(&module, tool);
        module.monitor_in_cycle_of(1_000_000);
        let shown = in_effect(&module);
        let mut pose = Pose::default();
        for (value, letter) in pose.iter_mut().zip(["x", "y", "z", "a", "b", "c"]) {
            *value = module.get(letter);
        }
        let fresh = hexapod();
        request(&fresh, shown);
        let of_shown = fresh.inverse(&pose).expect("the pose shown");
        let gaps = of_shown.iter().zip(&measured).map(|(a, b)| (a - b).abs());
        let off = gaps.fold(0.0, f64::max);
        assert!(off < SHOWN_MM, "{pose:?} at {shown:?}: joints off by {off} mm");
        assert_eq!(shown, before, "the offset that forward and inverse computed with");
        before = tool;
    }
}

/// Returns a hexapod with a reference pose, which determines every fold: joints then are those of a fresh module.
fn with_home(random: &mut Random) -> Hexapod {
    loop {
        let mut machine = random_hexapod(random, 1000.0);
        machine.home = Some([0.0, 0.0, 1200.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        if machine.apply(&Module::pkmkins(&[])) {
            return machine;
        }
    }
}

#[test]
fn machines_of_random_geometry_do_too() {
    let mut random = Random::new(42);
    let mut done = 0;
    let count = cases(60);
    for _ in 0..count {
        let machine = Parallel::from(with_home(&mut random));
        let mut pose = machine.home.unwrap_or([0.0; 9]);
        for value in &mut pose[3..6] {
            *value += random.within(15.0);
        }
        let tools = [random_tool(&mut random, 1000.0), random_tool(&mut random, 1000.0)];
        done += usize::from(change(&machine, pose, tools, &mut random).is_some());
    }
    assert!(done * 10 >= count * 9, "{done} of {count} within reach");
}

/// Two other requests, at any time of the change under way.
#[test]
fn a_request_that_changes_during_a_change_keeps_the_limits_too() {
    for after in [1, 8, 20, 30, 45, 60, 90, 120] {
        let module = hexapod();
        let mut thread = Thread::at(&module, TILTED);
        for tool in [LONG, [-20.0, 10.0, 30.0], [0.0; 3]] {
            request(&module, tool);
            thread.cycles(after);
        }
        thread.settle().expect("within reach");
        assert_eq!(in_effect(&module), [0.0; 3]);
        let (speed, acceleration) = thread.shares(&USUAL);
        assert!(speed <= 1.0 && acceleration <= 1.0 + LIMIT_ROUNDING, "{speed} {acceleration}");
        assert_eq!(thread.joints.last(), thread.joints.first(), "after {after} cycles each");
    }
}

#[test]
fn a_change_taken_back_at_once_moves_nothing() {
    let module = hexapod();
    let mut thread = Thread::at(&module, TILTED);
    request(&module, LONG);
    thread.cycles(5);
    assert!(module.is_on("feed-inhibit"));
    request(&module, [0.0; 3]);
    thread.cycles(2);
    assert!(!module.is_on("tool-busy") && !module.is_on("feed-inhibit"));
    assert!(thread.joints.iter().all(|joints| Some(joints) == thread.joints.first()));
}

#[test]
fn a_request_that_is_not_finite_in_between_is_refused_and_mended() {
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let module = hexapod();
        let mut thread = Thread::at(&module, TILTED);
        request(&module, LONG);
        thread.cycles(50);
        let under_way = in_effect(&module);
        assert!(under_way[2] > 0.0 && under_way[2] < LONG[2], "{under_way:?}");
        let joints = *thread.joints.last().expect("cycles");
        module.set("tool-offset", value);
        for _ in 0..500 {
            let _ = module.follow(&joints, &TILTED);
            assert_eq!(module.inverse(&TILTED), Err(Cause::ToolNotFinite.code()));
            module.monitor();
        }
        assert!(!module.is_on("tool-busy"), "busy with {value}");
        assert!(in_effect(&module).iter().all(|v| v.is_finite()));
        request(&module, LONG);
        thread.settle().expect("mended");
        assert_eq!(in_effect(&module), LONG);
    }
}

#[test]
fn an_offset_out_of_reach_is_refused_and_nothing_moves() {
    for (far, limit) in [([0.0, 0.0, 1e6], None), ([0.0, 0.0, 80.0], Some("max-limit.3"))] {
        let module = hexapod();
        let mut thread = Thread::at(&module, TILTED);
        if let Some(pin) = limit {
            // At some point of the path; the sign of its motion is not tested.
            let joint = thread.joints[0][3];
            module.set(pin, joint + 0.1);
            module.set("min-limit.3", joint - 0.1);
        }
        request(&module, far);
        let code = Cause::ToolOutOfReach.code();
        assert_eq!(thread.settle(), Err(code), "{far:?}");
        assert!(!module.is_on("tool-busy") && !module.is_on("feed-inhibit"));
        assert_eq!(in_effect(&module), [0.0; 3]);
        assert!(thread.joints.iter().all(|joints| Some(joints) == thread.joints.first()));
        assert_eq!(module.get("fault"), f64::from(code));
        assert!(said(&module).contains(Cause::ToolOutOfReach.text()), "'{}'", said(&module));
        let reasons = module.messages().len();
        thread.settle().expect_err("still asked for");
        assert_eq!(module.messages().len(), reasons, "reported once");
        request(&module, [0.0; 3]);
        thread.settle().expect("taken back");
        module.set("min-limit.3", 0.0);
        module.set("max-limit.3", 1e99);
        request(&module, LONG);
        thread.settle().expect("another one");
        assert_eq!(in_effect(&module), LONG);
    }
}

#[test]
fn limits_that_are_none_are_refused_with_the_joint() {
    for pin in ["max-velocity.4", "max-acceleration.4"] {
        for value in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e99] {
            let module = hexapod();
            module.set(pin, value);
            let mut thread = Thread::at(&module, TILTED);
            request(&module, LONG);
            assert_eq!(thread.settle(), Err(Cause::ToolChangedTilted.code()), "{pin} = {value}");
            assert_eq!(module.get("fault-leg"), 4.0);
            assert_eq!(in_effect(&module), [0.0; 3]);
            assert!(!module.is_on("tool-busy"));
        }
    }
}

/// A tiny limit makes a change slow, not wrong.
#[test]
fn a_velocity_limit_of_next_to_nothing_is_kept() {
    let module = hexapod();
    let mut limits = USUAL;
    limits[2].0 = 1e-300;
    limit(&module, &limits);
    let mut thread = Thread::at(&module, TILTED);
    request(&module, LONG);
    thread.cycles(2000);
    assert!(module.is_on("tool-busy"));
    assert!(thread.joints.iter().all(|joints| Some(joints) == thread.joints.first()));
}

#[test]
fn motion_past_the_inhibited_feed_is_refused() {
    for before in [8, 15, 60] {
        let module = hexapod();
        let mut thread = Thread::at(&module, TILTED);
        request(&module, LONG);
        thread.cycles(before);
        thread.pose[0] += 1e-6;
        thread.cycle().expect("the cycle that shows it");
        assert_eq!(thread.cycle(), Err(Cause::ToolChangeDisturbed.code()), "{before}");
        assert!(!module.is_on("tool-busy"));
        assert!(said(&module).contains("M49"), "'{}'", said(&module));
    }
}

#[test]
fn motion_under_way_is_waited_for_but_not_for_ever() {
    let module = hexapod();
    let mut thread = Thread::at(&module, TILTED);
    request(&module, LONG);
    for _ in 0..200 {
        thread.pose[0] += 0.01;
        thread.cycles(1);
        assert!(module.is_on("feed-inhibit"));
        assert_eq!(in_effect(&module), [0.0; 3]);
    }
    thread.settle().expect("it has stopped");
    assert_eq!(in_effect(&module), LONG);
    request(&module, [0.0; 3]);
    let code = (0..10_000).find_map(|_| {
        thread.pose[0] -= 0.001;
        thread.cycle().err()
    });
    assert_eq!(code, Some(Cause::ToolChangeDisturbed.code()));
}

#[test]
fn with_the_machine_off_a_change_under_way_is_made_at_once() {
    let module = hexapod();
    let mut thread = Thread::at(&module, TILTED);
    request(&module, LONG);
    thread.cycles(60);
    assert!(in_effect(&module)[2] > 0.0);
    let joints = *thread.joints.last().expect("cycles");
    module.set("machine-on", 0.0);
    module.monitor();
    assert!(!module.is_on("tool-busy") && !module.is_on("feed-inhibit"));
    let pose = module.follow(&joints, &TILTED).expect("the joints stay");
    assert_eq!(in_effect(&module), LONG);
    module.set("machine-on", 1.0);
    let mut thread = Thread::at(&module, pose);
    thread.settle().expect("nothing is left to do");
    for (one, other) in thread.joints[0].iter().zip(joints) {
        assert!((one - other).abs() < SAME_JOINT_MM * 10.0, "{one} {other}");
    }
}

/// LinuxCNC's command handler runs before the controller, or after it if a HAL file says so.
#[test]
fn end_points_of_queued_moves_are_not_taken_for_the_commanded_pose() {
    for after in [false, true] {
        let module = hexapod();
        let mut joints = Thread::at(&module, TILTED).joints[0];
        request(&module, LONG);
        let mut end = TILTED;
        for _ in 0..400 {
            // Another end point in every cycle: as commanded poses they would be a motion without rest.
            end[0] += 0.1;
            let queued = |now: bool| now.then(|| module.inverse(&end).expect("within reach"));
            queued(!after);
            module.follow(&joints, &TILTED).expect("the joints of inverse");
            joints = module.inverse(&TILTED).expect("within reach");
            queued(after);
            module.monitor();
        }
        assert_eq!(in_effect(&module), LONG, "end points after the controller: {after}");
    }
}

/// LinuxCNC then requests the poses of feedback and command, and no joints.
#[test]
fn in_joint_mode_a_change_moves_the_pose_and_no_joint() {
    let module = hexapod();
    let thread = Thread::at(&module, TILTED);
    let joints = thread.joints[0];
    let (mut feedback, mut command) = (TILTED, TILTED);
    request(&module, LONG);
    for _ in 0..3 {
        assert_eq!(module.forward_into(&joints, &mut feedback), 0);
        assert_eq!(module.forward_into(&joints, &mut command), 0);
        module.monitor();
        assert!(!module.is_on("tool-busy") && !module.is_on("feed-inhibit"));
    }
    assert_eq!(in_effect(&module), LONG);
    for (one, other) in feedback.iter().zip(command) {
        assert!((one - other).abs() < SAME_COMPONENT, "{feedback:?} {command:?}");
    }
    let moved = norm(minus([command[0], command[1], command[2]], [10.0, -20.0, 260.0]));
    assert!(moved > 1.0, "the pose stayed at {command:?}");
    let again = module.inverse(&command).expect("where it is");
    for (one, other) in again.iter().zip(joints) {
        assert!((one - other).abs() < SAME_COMPONENT, "{one} {other}");
    }
}

#[test]
fn forward_follows_the_joints_during_a_tool_change() {
    let module = hexapod();
    let mut thread = Thread::at(&module, TILTED);
    request(&module, LONG);
    while thread.joints.len() < 200 {
        thread.cycle().expect("within reach");
        let joints = thread.joints[thread.joints.len() - 1];
        let from = thread.joints.len();
        // The monitor has made a step since: inverse of the same cycle returns the pose to find.
        let now = module.inverse(&TILTED).expect("within reach");
        let pose = module.follow(&now, &TILTED).expect("the joints of inverse");
        let off = pose.iter().zip(TILTED).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < SAME_COMPONENT, "cycle {from}: {pose:?} from {joints:?}");
    }
}

/// LinuxCNC's own call passes the offset before the pins change, and the pins follow.
#[test]
fn an_offset_that_linuxcnc_hands_over_goes_the_way_of_one_on_the_pins() {
    let by_pins = hexapod();
    let mut thread = Thread::at(&by_pins, TILTED);
    request(&by_pins, LONG);
    thread.settle().expect("a change within reach");
    let joints = thread.joints;

    let by_call = hexapod();
    let mut thread = Thread::at(&by_call, TILTED);
    assert_eq!(by_call.set_tool(Some(&sent(LONG))), 0);
    request(&by_call, LONG);
    thread.settle().expect("a change within reach");
    assert_eq!(in_effect(&by_call), LONG);
    assert_eq!(thread.joints, joints, "cycle by cycle");
    let (speed, acceleration) = thread.shares(&USUAL);
    assert!(speed <= 1.0 && acceleration <= 1.0 + LIMIT_ROUNDING, "{speed}, {acceleration}");
    assert_eq!(said(&by_call), "");
}

fn sent(tool: [f64; 3]) -> Pose {
    let [x, y, z] = tool;
    [x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}

#[test]
fn offsets_from_linuxcnc_count_and_contradicting_pins_are_reported_once() {
    let module = hexapod();
    let mut thread = Thread::at(&module, TILTED);
    assert_eq!(module.set_tool(Some(&sent([0.0; 3]))), 0);
    request(&module, LONG);
    thread.cycles(1000);
    assert_eq!((in_effect(&module), said(&module)), ([0.0; 3], String::new()));
    thread.cycles(3000);
    assert_eq!(in_effect(&module), [0.0; 3]);
    let messages = module.messages();
    assert_eq!(messages.len(), 1, "{messages:?}");
    assert!(messages[0].text.contains("motion.tooloffset"), "{messages:?}");
}

#[test]
fn no_offset_handed_over_changes_nothing_and_one_that_is_no_number_is_refused() {
    let module = hexapod();
    let mut thread = Thread::at(&module, TILTED);
    assert_eq!(module.set_tool(None), -1);
    request(&module, LONG);
    thread.settle().expect("the pins still count");
    assert_eq!(in_effect(&module), LONG);
    let before = module.inverse(&TILTED);
    assert_eq!(module.set_tool(Some(&sent([0.0, f64::NAN, 0.0]))), 0);
    assert_eq!(thread.cycle(), Err(Cause::ToolNotFinite.code()));
    assert_eq!(module.set_tool(Some(&sent(LONG))), 0);
    thread.cycles(3);
    assert_eq!(module.inverse(&TILTED), before);
}
