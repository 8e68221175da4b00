// SPDX-License-Identifier: GPL-2.0-or-later
//! Events in LinuxCNC during a tool change at a tilt: no joint exceeds its limits, the change is
//! completed, and the pose stays the machine's.

use abi_tests::control::{Control, in_a_chain, on_one_guide};
use abi_tests::controller::{Controller, Mode};
use abi_tests::machines::random_hexapod;
use abi_tests::module::{Module, Pose};
use abi_tests::parallel::Parallel;
use abi_tests::random::{Random, cases};
use abi_tests::subjects::{Subject, pose, subjects};
use abi_tests::tolerances::ROUND_TRIP_REL;
use kinematics::Cause;

/// Event during the change, and the return to coordinated mode.
type Event = fn(&mut Controller<'_>, &mut Random);

/// Runs a random number of cycles between the steps of an event: one cycle, or until everything is at rest.
fn pause(controller: &mut Controller<'_>, random: &mut Random) {
    let cycles = if random.between(0.0, 1.0) < 0.5 { 1.0 } else { random.between(1.0, 60.0) };
    (0..cycles as usize).for_each(|_| controller.cycle());
}

fn through(modes: &[Mode], controller: &mut Controller<'_>, random: &mut Random) {
    for mode in modes {
        controller.set_mode(*mode);
        pause(controller, random);
    }
}

fn off_and_on(controller: &mut Controller<'_>, random: &mut Random) {
    controller.turn(false);
    // LinuxCNC's task needs more than a servo cycle to switch on again.
    controller.cycle();
    pause(controller, random);
    controller.turn(true);
}

use Mode::{Coordinated, Free, Teleop};

/// Every event by its name, with the mode in which the change begins.
const EVENTS: [(&str, Mode, Event); 14] = [
    ("end of MDI", Coordinated, |_, _| {}),
    ("abort of a queued move", Coordinated, |c, _| c.queued = None),
    ("manual mode", Coordinated, |c, r| through(&[Teleop], c, r)),
    ("abort, then manual mode", Coordinated, |c, r| {
        c.queued = None;
        c.cycle();
        through(&[Teleop], c, r);
    }),
    ("joint mode", Coordinated, |c, r| through(&[Free], c, r)),
    ("manual, then joint mode", Coordinated, |c, r| through(&[Teleop, Free, Teleop], c, r)),
    ("MDI", Teleop, |c, r| through(&[Coordinated], c, r)),
    ("MDI, manual, joint mode, MDI", Teleop, |c, r| {
        through(&[Coordinated, Teleop, Free, Coordinated], c, r);
    }),
    ("joint mode from manual mode", Teleop, |c, r| through(&[Free], c, r)),
    ("machine off", Coordinated, off_and_on),
    ("machine off in manual mode", Teleop, off_and_on),
    ("unhomed", Coordinated, |c, r| {
        through(&[Free], c, r);
        c.set_homed(false);
        pause(c, r);
        c.set_homed(true);
        pause(c, r);
    }),
    ("kinematics there and back", Coordinated, |c, r| {
        c.switch(1);
        pause(c, r);
        c.switch(0);
        pause(c, r);
    }),
    ("another request", Coordinated, |c, r| {
        let size = r.between(0.0, 1.0);
        c.request = Some([size, -size, 2.0 * size]);
        pause(c, r);
    }),
];

/// Largest number of cycles of a change in these tests.
const MOST_CYCLES: usize = 50_000;

/// Runs cycles until no change is under way and the interpolators have reached the end.
fn settle(controller: &mut Controller<'_>, module: &Module, name: &str) -> usize {
    let mut rest = 0;
    for count in 0..MOST_CYCLES {
        controller.cycle();
        rest = if module.is_on("tool-busy") { 0 } else { rest + 1 };
        if rest > 8 * controller.rate {
            return count;
        }
    }
    panic!("{name}: a change does not end");
}

fn requested(module: &Module, spindle: f64) -> [f64; 3] {
    let [x, y, z] = ["tool-offset-x", "tool-offset-y", "tool-offset"].map(|pin| module.get(pin));
    [x, y, z + spindle]
}

fn in_effect(module: &Module) -> [f64; 3] {
    ["x", "y", "z"].map(|letter| module.get(&format!("tool-offset-eff-{letter}")))
}

fn random_tool(random: &mut Random, size: f64) -> [f64; 3] {
    [random.within(0.03 * size), random.within(0.03 * size), random.between(0.0, 0.1 * size)]
}

/// Returns the largest acceleration of any joint in an event, as a share of its limit; `None` if an offset is out
/// of reach.
fn interrupted(
    control: &Control,
    pose: &Pose,
    (name, mode, event): (&str, Mode, Event),
    rate: u32,
    random: &mut Random,
) -> Option<f64> {
    let module = control.module();
    let size = control.size();
    // Motions of the joints in a tenth of a second to seconds, in cycles of a millisecond.
    let limits: Vec<_> = (0..control.joints())
        .map(|_| {
            let speed = size * random.between(0.1, 1.0);
            (speed, speed / random.between(0.0005, 0.005))
        })
        .collect();
    for (j, (speed, acceleration)) in limits.iter().enumerate() {
        if module.has(&format!("max-velocity.{j}")) {
            module.set(&format!("max-velocity.{j}"), *speed);
            module.set(&format!("max-acceleration.{j}"), *acceleration);
        }
    }
    let mut controller = Controller::new(&module, *pose);
    controller.rate = rate;
    for before in [Teleop, mode] {
        controller.set_mode(before);
        (0..10).for_each(|_| controller.cycle());
    }
    let spindle = control.mechanisms()[0].spindle_offset;
    for (round, tool) in
        [random_tool(random, size), random_tool(random, size)].into_iter().enumerate()
    {
        controller.request = Some(tool);
        if round == 1 {
            // Usually while the joints move.
            controller.queued = (mode == Coordinated).then_some(*pose);
            let at = random.between(0.0, 1.0).powi(2) * 300.0;
            (0..at as usize).for_each(|_| controller.cycle());
            event(&mut controller, random);
            controller.queued = None;
            settle(&mut controller, &module, name);
            through(&[Coordinated], &mut controller, random);
        }
        settle(&mut controller, &module, name);
        if controller.refusals.contains(&Cause::ToolOutOfReach.code()) {
            return None;
        }
        let what = format!("{name}, {} at {pose:?}", control.name());
        assert_eq!(controller.refusals, [0_i32; 0], "{what}: {:?}", module.messages());
        assert_eq!(in_effect(&module), requested(&module, spindle), "{what}");
    }
    let what = format!("{name}, {} at {pose:?}", control.name());
    let fresh = control.module();
    for pin in ["tool-offset-x", "tool-offset-y", "tool-offset"] {
        fresh.set(pin, module.get(pin));
    }
    let expected = fresh.inverse(&controller.command).expect("where the machine stands");
    let joints = controller.positions[controller.positions.len() - 1];
    for (one, other) in joints.iter().zip(expected).take(control.joints()) {
        assert!((one - other).abs() < SAME_JOINT_SHARE * size.max(1.0), "{what}: {one} {other}");
    }
    let (speed, acceleration) = controller.shares(&limits);
    assert!(
        speed <= 1.02 && acceleration <= 1.02,
        "{what}: {speed:.2} of the speed limit, {acceleration:.2} of the acceleration limit"
    );
    Some(acceleration)
}

/// Joints against those of the pose: forward has found it several times since, each time to the accuracy relative to
/// the size in README.
const SAME_JOINT_SHARE: f64 = 100.0 * ROUND_TRIP_REL;

/// Returns a hexapod of random geometry, tilted at its reference pose: the joints' straight line from another one may
/// pass near a singular pose.
fn random_machine(random: &mut Random) -> (Control, Pose) {
    loop {
        let mut machine = random_hexapod(random, 1000.0);
        let mut tilted = pose([0.0, 0.0, 1200.0, 0.0, 0.0, 0.0]);
        tilted[3..6].iter_mut().for_each(|angle| *angle += random.within(15.0));
        machine.home = Some(tilted);
        if machine.apply(&Module::pkmkins(&[])) {
            let machine = Parallel::from(machine);
            let subject = Subject { name: "random hexapod", machine, sample: |_| [0.0; 9] };
            return (Control::Alone(subject), tilted);
        }
    }
}

#[test]
fn joints_keep_their_limits_when_linuxcnc_interrupts_a_tool_change() {
    let mut random = Random::new(51);
    let tilting = |s: &Subject| (3..6).any(|letter| s.machine.moves(letter));
    let mut controls: Vec<_> = subjects().into_iter().filter(tilting).map(Control::Alone).collect();
    controls.extend([in_a_chain(), on_one_guide()]);
    let (mut done, mut all) = (0, 0);
    for row in EVENTS {
        let mut largest = 0.0_f64;
        let mut run = |control: &Control, pose: &Pose, random: &mut Random| {
            all += 1;
            // A slower trajectory period only in coordinated mode: LinuxCNC's teleop mode drops points.
            let slow = row.1 == Coordinated && random.between(0.0, 1.0) < 0.2;
            if let Some(share) = interrupted(control, pose, row, if slow { 3 } else { 1 }, random) {
                done += 1;
                largest = largest.max(share);
            }
        };
        for _ in 0..cases(3) {
            for control in &controls {
                run(control, &control.sample(&mut random), &mut random);
            }
            let (control, pose) = random_machine(&mut random);
            run(&control, &pose, &mut random);
        }
        println!("{:30} at most {largest:.3} of the acceleration limit", row.0);
    }
    assert!(done * 10 >= all * 8, "{done} of {all} within reach");
}
