// SPDX-License-Identifier: GPL-2.0-or-later
//! The verdict on a program, as `pkm preflight` gives it.

use crate::refusal::failed;
use linuxcnc::process::Options;
use linuxcnc::trace::Trace;
use machine::files;
use machine::read::machine::MachineConfig;
use program::report::Time;
use program::verdict::{Step, judge};
use pyo3::prelude::*;
use std::error::Error;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// Time between two checks for signals, such as Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// Runs work in a separate thread, without the interpreter's lock. A signal whose handler raises an exception sets
/// `stop`; the exception is raised once the work has ended.
fn interruptible(
    py: Python<'_>,
    stop: &AtomicBool,
    work: impl FnOnce() -> Result<String, Box<dyn Error + Send + Sync>> + Send,
) -> PyResult<String> {
    py.detach(|| {
        thread::scope(|scope| {
            let caller = thread::current();
            let worker = scope.spawn(move || {
                let result = work();
                caller.unpark();
                result
            });
            let mut raised = Ok(());
            while !worker.is_finished() {
                thread::park_timeout(LOOK);
                if raised.is_ok() {
                    raised = Python::attach(|py| py.check_signals());
                    stop.store(raised.is_err(), Ordering::Relaxed);
                }
            }
            let result = worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            raised.and(result.map_err(failed))
        })
    })
}

/// Returns the answer of `pkm preflight` as JSON; `options` are those of a run, as JSON.
#[pyfunction]
pub fn preflight(
    py: Python<'_>,
    machine: PathBuf,
    program: PathBuf,
    mechanism: Option<u8>,
    trace: Option<PathBuf>,
    options: &str,
) -> PyResult<String> {
    let options: Options = serde_json::from_str(options).map_err(failed)?;
    interruptible(py, &options.stop, || {
        files::forget_read();
        let mut config = MachineConfig::read(&machine)?;
        if let Some(number) = mechanism {
            config = config.mechanism(number)?.into();
        }
        let mut trace = trace.as_deref().map(|file| Trace::new(&config, file)).transpose()?;
        let verdict = judge(&config, &program, &options, true, &mut |step| {
            if let (Step::Row(row), Some(trace)) = (step, &mut trace) {
                // A write error is reported at the end.
                let _ = trace.see(row);
            }
        })?;
        let is_judged = matches!(verdict.found.time, Time::Judged(_));
        trace.map_or(Ok(()), |trace| trace.finish(is_judged))?;
        Ok(serde_json::to_string(&verdict)?)
    })
}
