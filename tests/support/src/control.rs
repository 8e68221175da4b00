// SPDX-License-Identifier: GPL-2.0-or-later
//! Runs of LinuxCNC in virtual time.

use crate::shipped;
use kinematics::MAX_JOINTS;
use linuxcnc::process::{self, Options};
use linuxcnc::refusal::NotJudged;
use linuxcnc::row::{Beside, Extra, Flags, Outcome, Row};
use machine::read::mechanism::Mechanism;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::{Child, ExitStatus};
use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant};

/// More than any test needs on a computer with ten other jobs, where three seconds of processor time took two minutes.
const MOST: Duration = Duration::from_secs(600);

/// Runs a program on a shipped machine; returns its outcome, and a row for every cycle.
pub fn run(machine: &str, program: &Path) -> (Outcome, Vec<Row>) {
    let mut rows = vec![];
    let config = shipped::whole(machine);
    let outcome = process::run(&config, program, &Options::default(), |row| {
        rows.push(*row);
        ControlFlow::Continue(())
    });
    (outcome.unwrap(), rows)
}

/// Returns options that interrupt a run after `MOST`, so that the test of an endless program fails.
pub fn bounded(options: Options) -> Options {
    let stop = options.stop.clone();
    thread::spawn(move || {
        thread::sleep(MOST);
        stop.store(true, Ordering::Relaxed);
    });
    options
}

/// Waits for the end of a process. Panics after `MOST`, and ends the process.
pub fn ended(child: &mut Child) -> ExitStatus {
    let begin = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if begin.elapsed() > MOST {
            child.kill().unwrap();
            panic!("process {} does not end", child.id());
        }
        thread::sleep(Duration::from_millis(5));
    }
}

/// Runs the text of a program on a shipped machine.
pub fn run_text(machine: &str, text: &str, options: &Options) -> Result<Outcome, NotJudged> {
    let file = tempfile::Builder::new().suffix(".ngc").tempfile().unwrap();
    fs::write(&file, text).unwrap();
    process::run(&shipped::whole(machine), file.path(), options, |_| ControlFlow::Continue(()))
}

/// Returns the row of a machine at rest at home with its drives on.
pub fn standing(config: &Mechanism) -> Row {
    let at = config.machine.at(&config.home_pose(), &config.spindle).unwrap();
    Row {
        cycle: 0,
        file: 0,
        number: 0,
        line: 1,
        flags: Flags { on: true, tool_busy: false, held: false },
        pose: config.home,
        joints: *at.joints(),
        errors: [0.0; MAX_JOINTS],
        allowed: [1.0; MAX_JOINTS],
        extra: Extra::default(),
        second: Beside::default(),
        tool: config.spindle.into(),
        feed: 1.0,
    }
}
