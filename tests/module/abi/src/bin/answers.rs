// SPDX-License-Identifier: GPL-2.0-or-later
//! Writes the bits of the module's results, one line per call, for machines of every kind: equal lines
//! on two processors mean equal results.

use abi_tests::machines::one_servo_step_from;
use abi_tests::module::{Module, Pose};
use abi_tests::random::{Random, cases};
use abi_tests::stub::PinType;
use abi_tests::subjects::{Subject, subjects};
use std::io::{BufWriter, Write, stdout};

/// Poses of each machine's workspace.
const POSES: usize = 2000;

/// Interval of poses for which long results are written: rows of the Jacobian, and all pins.
const SELDOM: usize = 20;

/// Number of poses beyond the workspace, which may be refused.
const WILD: usize = 400;

fn main() {
    let mut lines = Lines(BufWriter::new(stdout().lock()));
    for subject in subjects() {
        let module = subject.machine.module();
        lines.pins(subject.name, "given", &module);
        in_workspace(&mut lines, &subject, &module);
        beyond(&mut lines, &subject, &module);
    }
}

fn in_workspace(lines: &mut Lines<impl Write>, subject: &Subject, module: &Module) {
    let mut random = Random::new(2021);
    let size = subject.machine.size();
    for n in 0..cases(POSES) {
        let pose = rounded((subject.sample)(&mut random));
        let seed = rounded(one_servo_step_from(&pose, size, &mut random));
        let joints = lines.inverse(subject.name, module, &pose);
        lines.forward(subject.name, module, &joints, &seed);
        if n % SELDOM == 0 {
            let rows = module.jacobian(&joints, &pose);
            lines.write(subject.name, "jacobian", code(&rows), rows.iter().flatten().flatten());
            module.monitor_until_all_is_shown();
            lines.pins(subject.name, "shown", module);
        }
    }
}

/// Tests poses three times as far from home as those of the workspace: forward starts at home.
fn beyond(lines: &mut Lines<impl Write>, subject: &Subject, module: &Module) {
    let mut random = Random::new(2022);
    let home = subject.home();
    for _ in 0..cases(WILD) {
        let pose = (subject.sample)(&mut random);
        let wild = rounded(std::array::from_fn(|i| home[i] + 3.0 * (pose[i] - home[i])));
        let joints = lines.inverse(subject.name, module, &wild);
        lines.forward(subject.name, module, &joints, &home);
    }
}

/// Rounds a pose: sines of the C library, with which poses are sampled, differ in their last bit between
/// processors, but the module's input must not.
fn rounded(pose: Pose) -> Pose {
    const STEPS: f64 = 65536.0;
    pose.map(|value| (value * STEPS).round() / STEPS)
}

fn code<T>(answer: &Result<T, i32>) -> i32 {
    answer.as_ref().err().copied().unwrap_or(0)
}

/// Output of lines: machine, call, code, and numbers as their bits.
struct Lines<W: Write>(W);

impl<W: Write> Lines<W> {
    fn inverse(&mut self, machine: &str, module: &Module, pose: &Pose) -> [f64; 16] {
        let mut joints = [0.0; 16];
        let code = module.inverse_into(pose, &mut joints);
        self.write(machine, "inverse", code, pose.iter().chain(&joints));
        joints
    }

    fn forward(&mut self, machine: &str, module: &Module, joints: &[f64; 16], seed: &Pose) {
        let mut pose = *seed;
        let code = module.forward_into(joints, &mut pose);
        self.write(machine, "forward", code, seed.iter().chain(&pose));
    }

    /// Writes every pin except those that measure time.
    fn pins(&mut self, machine: &str, what: &str, module: &Module) {
        let pins = module.pins();
        let values: Vec<f64> =
            pins.iter().filter(|pin| pin.kind != PinType::S32).map(|pin| pin.get()).collect();
        self.write(machine, what, 0, &values);
    }

    fn write<'a>(
        &mut self,
        machine: &str,
        call: &str,
        code: i32,
        numbers: impl IntoIterator<Item = &'a f64>,
    ) {
        let numbers: Vec<String> =
            numbers.into_iter().map(|number| format!("{:x}", number.to_bits())).collect();
        writeln!(self.0, "{machine}; {call} {code} {}", numbers.join(" "))
            .expect("the lines are written");
    }
}
