// SPDX-License-Identifier: GPL-2.0-or-later
//! Jogs in world mode, as LinuxCNC makes them: every axis independently, slowed and stopped by the module.

use abi_tests::machines::paper_004;
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::random::{Random, cases};
use kinematics::Cause;

const PERIOD: f64 = 1e-3;
const AXES: [&str; 6] = ["x", "y", "z", "a", "b", "c"];

/// Speed limits of X Y Z, machine units and seconds, and of A B C, degrees.
const FASTEST: [f64; 6] = [60.0, 60.0, 60.0, 30.0, 30.0, 30.0];
const ACCELERATION: [f64; 6] = [1000.0, 1000.0, 1000.0, 200.0, 200.0, 200.0];

/// Range and speed of every strut, 939 long at home.
const RANGE: [f64; 2] = [840.0, 1040.0];
const JOINT_SPEED: f64 = 50.0;

const TILT: f64 = 20.0;
const HOME: Pose = [0.0, 0.0, 250.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

fn hexapod() -> Module {
    let module = paper_004().module();
    for n in 0..6 {
        module.set(&format!("min-limit.{n}"), RANGE[0]);
        module.set(&format!("max-limit.{n}"), RANGE[1]);
        module.set(&format!("max-velocity.{n}"), JOINT_SPEED);
    }
    module.set("tilt-limit", TILT);
    module.set("linear-acceleration", ACCELERATION[0]);
    module.set("angular-acceleration", ACCELERATION[3]);
    for (axis, fastest) in AXES.iter().zip(FASTEST) {
        module.set(&format!("axis-max-velocity.{axis}"), fastest);
    }
    module
}

/// LinuxCNC's jog of axes in world mode: each moves at its own speed and acceleration until it is
/// stopped. `task` is the number of cycles after which its speed limits follow the module's; `None` means
/// never.
struct Jog<'a> {
    module: &'a Module,
    pose: Pose,
    speed: [f64; 6],
    task: Option<usize>,
}

/// Results of a jog.
#[derive(Debug, Default)]
struct Run {
    /// Largest joint speed, as a share of the limit.
    fastest: f64,
    /// Duration of too high joint speeds, seconds.
    too_fast: f64,
    /// Least room in a strut's range, and tilt.
    room: f64,
    tilt: f64,
    is_stopped: bool,
    cycles: usize,
    /// Number of changes of the speed limits.
    changes: usize,
}

impl<'a> Jog<'a> {
    fn from(module: &'a Module, pose: Pose, task: Option<usize>) -> Self {
        module.monitor_until_all_is_shown();
        Self { module, pose, speed: [0.0; 6], task }
    }

    fn joints(&self) -> Joints {
        self.module.inverse(&self.pose).expect("within reach")
    }

    fn speed_limits(&self) -> [f64; 6] {
        AXES.map(|axis| self.module.get(&format!("jog-velocity.{axis}")))
    }

    /// Runs a cycle with the keys of these axes pressed.
    fn cycle(&mut self, keys: [f64; 6], limits: [f64; 6]) {
        for k in 0..6 {
            let wanted = keys[k].signum() * keys[k].abs().min(limits[k]);
            let step = ACCELERATION[k] * PERIOD;
            self.speed[k] += (wanted - self.speed[k]).clamp(-step, step);
            self.pose[k] += self.speed[k] * PERIOD;
        }
        let module = self.module;
        let feedback = self.pose;
        let joints = self.joints();
        module.follow(&joints, &feedback).expect("its own joints");
        module.inverse(&self.pose).expect("within reach");
        module.monitor();
    }

    /// Presses keys until the machine stands, at most some seconds.
    fn hold(&mut self, keys: [f64; 6], seconds: f64) -> Run {
        let mut run = Run { room: f64::INFINITY, ..Run::default() };
        let mut limits = vec![FASTEST];
        let mut keys = keys;
        let mut before = self.joints();
        self.module.set("jogging", 1.0);
        for n in 0..(seconds / PERIOD) as usize {
            // In LinuxCNC the limits only decrease during a jog.
            let known = self.task.map_or(FASTEST, |late| limits[n.saturating_sub(late)]);
            self.cycle(keys, known);
            limits.push(self.speed_limits());
            run.changes += usize::from(limits[n] != limits[n + 1]);
            let joints = self.joints();
            let fastest = (0..6).map(|i| (joints[i] - before[i]).abs() / PERIOD / JOINT_SPEED);
            let fastest = fastest.fold(0.0, f64::max);
            run.fastest = run.fastest.max(fastest);
            run.too_fast += if fastest > 1.0 { PERIOD } else { 0.0 };
            run.room = run.room.min(room(&joints));
            run.tilt = run.tilt.max(tilt(&self.pose));
            before = joints;
            run.cycles = n;
            if self.module.is_on("jog-stop") {
                run.is_stopped = true;
                keys = [0.0; 6];
            }
            if run.is_stopped && self.speed.iter().all(|speed| *speed == 0.0) {
                break;
            }
        }
        self.module.set("jogging", 0.0);
        for _ in 0..4 {
            self.cycle([0.0; 6], FASTEST);
        }
        run
    }
}

fn room(joints: &Joints) -> f64 {
    let each = joints.iter().take(6).map(|joint| (joint - RANGE[0]).min(RANGE[1] - joint));
    each.fold(f64::INFINITY, f64::min)
}

/// Returns the angle of the platform's normal from Z.
fn tilt(pose: &Pose) -> f64 {
    let [a, b] = [pose[3].to_radians(), pose[4].to_radians()];
    (a.cos() * b.cos()).acos().to_degrees()
}

fn along(random: &mut Random) -> [f64; 6] {
    // One to three axes, at any share of their speed.
    let count = random.between(1.0, 3.999) as usize;
    let mut keys = [0.0; 6];
    for _ in 0..count {
        let k = random.between(0.0, 5.999) as usize;
        keys[k] = FASTEST[k] * random.between(0.2, 1.0) * random.within(1.0).signum();
    }
    keys
}

#[test]
fn jogs_end_before_limits_and_keep_joint_speeds_however_late_the_task_is() {
    let mut random = Random::new(31);
    let (mut stopped, mut dead_too_fast) = (0, 0);
    for case in 0..cases(120) {
        let keys = along(&mut random);
        for task in [Some(10), Some(40), None] {
            let module = hexapod();
            let mut jog = Jog::from(&module, HOME, task);
            let run = jog.hold(keys, 60.0);
            let what = format!("case {case}, keys {keys:?}, task {task:?}: {run:?}");
            assert!(run.room >= 0.0 && run.tilt <= TILT, "beyond a limit: {what}");
            assert!(run.is_stopped, "nothing ends it: {what}");
            // While it accelerates the task receives the limits late; the excess ends with their receipt.
            match task {
                Some(late) => assert!(run.too_fast <= 0.06 + late as f64 * PERIOD, "{what}"),
                None => dead_too_fast += usize::from(run.fastest > 1.0),
            }
            // Each takes a cycle of LinuxCNC's task.
            assert!(run.changes <= 80, "{what}");
            stopped += usize::from(run.is_stopped);
            let fault = module.get("fault") as i32;
            assert!(fault != 0 && module.messages().len() == 1, "{what}, fault {fault}");
        }
    }
    assert!(
        stopped > 0 && 12 * dead_too_fast > cases(120),
        "{dead_too_fast} had joints that are too fast alone"
    );
}

#[test]
fn what_is_jogged_away_from_a_limit_is_not_slowed_and_what_goes_on_is_stopped_again() {
    let module = hexapod();
    let mut jog = Jog::from(&module, HOME, Some(10));
    let down = [0.0, 0.0, -FASTEST[2], 0.0, 0.0, 0.0];
    assert!(jog.hold(down, 20.0).is_stopped);
    let stopped_at = jog.pose[2];
    assert_eq!(module.get("fault") as i32, Cause::JointLimitAhead.code());
    for _ in 0..20 {
        let run = jog.hold(down, 1.0);
        assert!(run.is_stopped && run.room >= 0.0, "{run:?}");
    }
    assert!(stopped_at - jog.pose[2] < 5.0, "{} from {stopped_at}", jog.pose[2]);
    let up = down.map(|speed| -speed);
    let run = jog.hold(up, 0.5);
    assert!(!run.is_stopped, "{run:?}");
    // Half a second, plus the time for accelerating.
    assert!(jog.pose[2] > stopped_at + 20.0, "{}", jog.pose[2]);
}

#[test]
fn a_machine_beyond_a_limit_is_led_back_and_not_on() {
    let module = hexapod();
    let beyond = {
        let mut pose = HOME;
        pose[3] = TILT + 1.0;
        pose
    };
    let mut jog = Jog::from(&module, beyond, Some(10));
    let on = [0.0, 0.0, 0.0, 10.0, 0.0, 0.0];
    assert!(jog.hold(on, 2.0).is_stopped && jog.pose[3] < TILT + 2.0, "{}", jog.pose[3]);
    let run = jog.hold(on.map(|speed| -speed), 1.0);
    assert!(!run.is_stopped && jog.pose[3] < TILT - 5.0, "{run:?}, {}", jog.pose[3]);
}

#[test]
fn axes_have_their_own_speeds_where_nothing_is_jogged() {
    let module = hexapod();
    let mut jog = Jog::from(&module, HOME, Some(10));
    jog.cycle([0.0; 6], FASTEST);
    assert_eq!(jog.speed_limits(), FASTEST);
    assert!(module.get("jog-scale") == 1.0 && !module.is_on("jog-stop"));
    // LinuxCNC follows a new speed limit in some cycles.
    module.set("axis-max-velocity.x", 20.0);
    module.monitor_until_all_is_shown();
    assert_eq!(jog.speed_limits()[0], 20.0);
    // A program moves along the same path.
    for _ in 0..3000 {
        jog.cycle([0.0, 0.0, -30.0, 0.0, 0.0, 0.0], FASTEST);
        if room(&jog.joints()) < 1.0 {
            break;
        }
        assert!(!module.is_on("jog-stop") && module.get("jog-scale") == 1.0);
    }
}

#[test]
fn numbers_that_are_none_stop_a_jog_rather_than_let_it_run() {
    for pin in ["min-limit.2", "tilt-limit", "axis-max-velocity.z"] {
        let module = hexapod();
        let mut jog = Jog::from(&module, HOME, Some(10));
        module.set(pin, f64::NAN);
        let run = jog.hold([0.0, 0.0, -FASTEST[2], 0.0, 0.0, 0.0], 20.0);
        assert!(run.is_stopped && run.room >= 0.0, "{pin}: {run:?}");
    }
    // Its braking is unknown: the slowest is assumed.
    let module = hexapod();
    let mut jog = Jog::from(&module, HOME, Some(10));
    module.set("linear-acceleration", f64::NAN);
    jog.hold([0.0, 0.0, -FASTEST[2], 0.0, 0.0, 0.0], 1.0);
    assert!(jog.pose[2] > HOME[2] - 0.02 * FASTEST[2] * 1.1 - 2.0, "{}", jog.pose[2]);
}

#[test]
fn feedback_that_is_no_number_ends_a_jog_and_holds_a_program_until_it_is_aborted() {
    let module = hexapod();
    let jog = Jog::from(&module, HOME, None);
    let good = jog.joints();
    let mut bad = good;
    bad[3] = f64::NAN;
    let cycle = |joints: &Joints, x: f64| {
        let refused = module.follow(joints, &HOME).is_err();
        module.inverse(&[x, 0.0, 250.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).expect("within reach");
        module.monitor();
        refused
    };
    module.set("jogging", 1.0);
    assert!(!cycle(&good, 0.001) && !module.is_on("jog-stop"));
    assert!(cycle(&bad, 0.002) && module.is_on("jog-stop"));
    module.set("jogging", 0.0);
    module.set("requested-vel", 10.0);
    assert!(cycle(&bad, 0.003) && module.is_on("feed-inhibit") && !module.is_on("jog-stop"));
    assert!(!cycle(&good, 0.003) && module.is_on("feed-inhibit"), "it goes on by itself");
    module.set("requested-vel", 0.0);
    assert!(!cycle(&good, 0.003) && !module.is_on("feed-inhibit"));
}
