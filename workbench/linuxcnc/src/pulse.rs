// SPDX-License-Identifier: GPL-2.0-or-later
//! The output of a run, read with a check of its CPU time and of whether it still makes progress.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::fs;
use std::io::{self, PipeReader, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Interval between two checks.
const LOOK: Timespec = Timespec { tv_sec: 1, tv_nsec: 0 };

/// Time that a run may be silent without work, as on a busy computer.
pub const MOST_REST: Duration = Duration::from_secs(120);

/// Clock ticks per second in /proc, the same on every Linux.
const TICKS: f64 = 100.0;

/// The reading end of a process's pipe.
pub struct Pulse {
    pipe: PipeReader,
    process: u32,
    /// Seconds of CPU time that it may use without a sign of progress.
    most_work: f64,
    /// Seconds of CPU time that it may use in total.
    most_in_all: f64,
    /// CPU time of the process, and the wall time, at its last sign.
    work: f64,
    sign: Instant,
    most_rest: Duration,
    stop: Arc<AtomicBool>,
}

impl Pulse {
    /// Reads the pipe of a process, which may use this CPU time in seconds between two signs and in total,
    /// until `stop` is set.
    pub fn new(
        pipe: PipeReader,
        process: u32,
        [most_work, most_in_all]: [f64; 2],
        stop: Arc<AtomicBool>,
    ) -> Self {
        Self {
            pipe,
            process,
            most_work,
            most_in_all,
            stop,
            work: 0.0,
            sign: Instant::now(),
            most_rest: MOST_REST,
        }
    }

    fn has_something(&self) -> io::Result<bool> {
        if self.stop.load(Ordering::Relaxed) {
            return Err(io::ErrorKind::ConnectionAborted.into());
        }
        let mut ready = [PollFd::new(&self.pipe, PollFlags::IN)];
        match poll(&mut ready, Some(&LOOK)) {
            Ok(count) => Ok(count > 0),
            Err(rustix::io::Errno::INTR) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }
}

/// Returns the seconds of CPU time that a process has used.
fn worked(process: u32) -> f64 {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    // After the name, which may contain blanks: state, ..., user and system ticks as 12th and 13th.
    let fields = stat.rsplit_once(')').map_or("", |(_, rest)| rest).split_whitespace();
    fields.skip(11).take(2).filter_map(|field| field.parse::<f64>().ok()).sum::<f64>() / TICKS
}

impl Read for Pulse {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        while !self.has_something()? {
            if worked(self.process) > self.most_in_all {
                return Err(io::ErrorKind::QuotaExceeded.into());
            }
            if worked(self.process) - self.work > self.most_work {
                return Err(io::ErrorKind::TimedOut.into());
            }
            if self.sign.elapsed() > self.most_rest {
                return Err(io::ErrorKind::WouldBlock.into());
            }
        }
        (self.work, self.sign) = (worked(self.process), Instant::now());
        if self.work > self.most_in_all {
            return Err(io::ErrorKind::QuotaExceeded.into());
        }
        self.pipe.read(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_that_rests_works_without_end_or_is_stopped_is_reported_as_such() {
        // This process waits more than it works; the other end of its pipe stays open.
        let (pipe, _open) = io::pipe().unwrap();
        let stop: Arc<AtomicBool> = Arc::default();
        let pulse = Pulse::new(pipe, std::process::id(), [f64::INFINITY; 2], stop.clone());
        let mut pulse = Pulse { most_rest: Duration::ZERO, ..pulse };
        assert_eq!(pulse.read(&mut [0]).unwrap_err().kind(), io::ErrorKind::WouldBlock);
        pulse.most_work = -1.0;
        assert_eq!(pulse.read(&mut [0]).unwrap_err().kind(), io::ErrorKind::TimedOut);
        stop.store(true, Ordering::Relaxed);
        assert_eq!(pulse.read(&mut [0]).unwrap_err().kind(), io::ErrorKind::ConnectionAborted);
    }
}
