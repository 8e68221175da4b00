// SPDX-License-Identifier: GPL-2.0-or-later
//! Whether a run still goes on: what it writes, read with a look at the time that it takes.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::fs;
use std::io::{self, PipeReader, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Between two looks.
const LOOK: Timespec = Timespec { tv_sec: 1, tv_nsec: 0 };

/// As long a run may be quiet without work, as on a computer that does something else.
pub const MOST_REST: Duration = Duration::from_secs(120);

/// Ticks of a second in /proc, the same on every Linux.
const TICKS: f64 = 100.0;

/// The reading end of what a process writes.
pub struct Pulse {
    pipe: PipeReader,
    process: u32,
    /// Seconds of a processor that it may work without a sign.
    most_work: f64,
    /// Seconds of a processor that it may work in all.
    most_in_all: f64,
    /// What the process had worked, and when, at its last sign.
    work: f64,
    sign: Instant,
    most_rest: Duration,
    stop: Arc<AtomicBool>,
}

impl Pulse {
    /// Reads the pipe that a process writes to, which may work so many seconds of a processor in between and in all,
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

/// Seconds of a processor that a process has worked.
fn worked(process: u32) -> f64 {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    // Behind the name, which may hold blanks: state, ..., user and system ticks as 12th and 13th.
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
        // This one works less than it waits; the other end of its pipe stays open.
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
