// SPDX-License-Identifier: GPL-2.0-or-later
//! Random values on every pin, pose, joint and period between the steps of a machine: nothing crashes, and
//! after the documented recovery the module returns the machine's pose. `fuzz` has single calls.

use abi_tests::module::{Joints, Pose};
use abi_tests::random::{Random, cases};
use abi_tests::sequences::judge::{Judge, Reach, Verdict};
use abi_tests::sequences::setups::{Setup, drop_ins, shipped};
use abi_tests::stub::{Pin, PinDir};

/// Number of calls between two recoveries.
const CALLS: usize = 200;

/// Number of poses on the path from home into the workspace after a recovery.
const STEPS: usize = 20;

const PARTICULAR: [f64; 12] = [
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    0.0,
    -0.0,
    1.0,
    -1.0,
    f64::MAX,
    f64::MIN_POSITIVE,
    1e-320,
    1e9,
    -1e300,
];

fn number(usual: f64, random: &mut Random) -> f64 {
    match random.between(0.0, 4.0) as usize {
        0 => PARTICULAR[random.between(0.0, PARTICULAR.len() as f64) as usize],
        1 => usual + random.within(1e-3),
        2 => usual * random.within(2.0) + random.within(100.0),
        _ => usual,
    }
}

struct Poked {
    setup: Setup,
    module: abi_tests::module::Module,
    inputs: Vec<(Pin, f64)>,
    pose: Pose,
    joints: Joints,
    has_sent_tool: bool,
}

impl Poked {
    fn new(setup: Setup) -> Self {
        let module = setup.module();
        let inputs = module.pins().into_iter().filter(|pin| pin.dir == PinDir::In);
        let inputs = inputs.map(|pin| (pin.clone(), pin.get())).collect();
        let (pose, joints) = (setup.control.home(), setup.system.at_reference().joints);
        Self { setup, module, inputs, pose, joints, has_sent_tool: false }
    }

    /// Makes a call with random values.
    fn poke(&mut self, random: &mut Random) {
        let module = &self.module;
        match random.between(0.0, 12.0) as usize {
            0..3 => {
                let (pin, _) = &self.inputs[random.between(0.0, self.inputs.len() as f64) as usize];
                pin.set(number(pin.get(), random));
            }
            3 => {
                let periods = [0, 1, -1, i64::MIN, i64::MAX, 1_000_000, 250_000, 1_000_000_000];
                module.monitor_in_cycle_of(periods[random.between(0.0, 8.0) as usize]);
            }
            4 => module.monitor(),
            5 => self.pose.iter_mut().for_each(|v| *v = number(*v, random)),
            6 => self.joints.iter_mut().for_each(|v| *v = number(*v, random)),
            7 => {
                let code = module.forward_into(&self.joints, &mut self.pose);
                let moved = self.setup.system.moved_places();
                let finite = moved.iter().all(|k| self.pose[*k].is_finite());
                assert!(code < 0 || finite, "{:?}", self.pose);
            }
            8 => {
                let mut joints = self.joints;
                let code = module.inverse_into(&self.pose, &mut joints);
                let own = &joints[..self.setup.system.joints()];
                assert!(code != 0 || own.iter().all(|q| q.is_finite()), "{joints:?}");
                if code == 0 {
                    self.joints = joints;
                }
            }
            9 => {
                module.switch(random.between(-2.0, 4.0).floor() as i32);
            }
            10 if random.between(0.0, 1.0) < 0.05 => {
                self.has_sent_tool = true;
                module.set_tool(Some(&std::array::from_fn(|_| number(0.0, random))));
            }
            _ => {
                (self.pose, self.joints) =
                    (self.setup.control.home(), self.setup.system.at_reference().joints);
            }
        }
    }

    /// Recovers as in the manual: all pins restored, machine off, kinematics 0, apply, fault-reset, home.
    fn recover(&mut self) {
        let module = &self.module;
        self.inputs.iter().for_each(|(pin, value)| pin.set(*value));
        module.set("machine-on", 0.0);
        if self.has_sent_tool {
            let tools: Vec<_> =
                self.setup.control.mechanisms().iter().map(|machine| machine.tool).collect();
            let mut sent = [0.0; 9];
            sent[..3].copy_from_slice(&tools[0]);
            if let Some(second) = tools.get(1) {
                sent[6..].copy_from_slice(second);
            }
            module.set_tool(Some(&sent));
        }
        module.apply();
        module.set("fault-reset", 0.0);
        module.monitor();
        module.set("fault-reset", 1.0);
        // Joints are homed: LinuxCNC does not call forward.
        for _ in 0..4 {
            module.monitor();
        }
        // Back from the identity, if it was active, with joints that close a platform.
        let joints = self.setup.system.at_reference().joints;
        module.forward_into(&joints, &mut self.setup.world_home());
        module.monitor();
        let code = module.switch(0);
        assert_eq!(code, 0, "{}", self.setup.name);
        // Corrections return at their rate: a rate of 0, the value without corrections, would keep them.
        let rates = || self.inputs.iter().filter(|(pin, _)| pin.name.contains("correction-rate."));
        rates().for_each(|(pin, _)| pin.set(1e9));
        for _ in 0..100 {
            module.monitor_in_cycle_of(10_000_000);
        }
        rates().for_each(|(pin, value)| pin.set(*value));
        assert!(module.is_on("geometry-ok"), "{}: {:?}", self.setup.name, module.messages());
        module.set("machine-on", 1.0);
        module.clear_messages();
    }

    /// Moves from home to a pose of the workspace, in joint mode.
    fn answers(&mut self, random: &mut Random) {
        let system = &self.setup.system;
        let mut judge = Judge::new(system.clone());
        let mut state = system.at_reference();
        judge.good = Some(state);
        let (home, target) = (self.setup.control.home(), self.setup.control.sample(random));
        let mut world = self.setup.world_home();
        for step in 0..=STEPS {
            let share = step as f64 / STEPS as f64;
            let at: Pose = std::array::from_fn(|k| home[k] + share * (target[k] - home[k]));
            if step > 0 {
                let Some((next, margin)) = system.state(&at) else { return };
                if margin < 2.0 {
                    return;
                }
                state = next;
            }
            let code = self.module.forward_into(&state.joints, &mut world);
            let verdict = match code {
                0 => judge.accepted(&state, &state.joints, &world, Reach::default()),
                _ => judge.refused(code, &state, &state.joints, Reach::default(), false),
            };
            let name = &self.setup.name;
            let messages = self.module.messages();
            assert!(
                !matches!(verdict, Verdict::Wrong(_)),
                "{name}, step {step}: {verdict:?}, {messages:?}"
            );
            self.module.monitor();
        }
    }
}

#[test]
fn after_garbage_everywhere_a_machine_recovers() {
    let mut all: Vec<Poked> = shipped().into_iter().chain(drop_ins()).map(Poked::new).collect();
    let rounds = cases(100_000 / CALLS);
    let machines = all.len();
    for round in 0..rounds {
        let poked = &mut all[round % machines];
        let mut random = Random::new(513_000_000 + round as u64);
        for _ in 0..CALLS {
            poked.poke(&mut random);
        }
        poked.recover();
        poked.answers(&mut random);
    }
}
