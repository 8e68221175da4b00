// SPDX-License-Identifier: GPL-2.0-or-later
//! Progress of a program.

use machine::files::{self, AtFile};
use std::io;
use std::path::Path;

/// The completed share of a program, as far as its lines are executed in order: with loops, and subroutines
/// elsewhere, the share is unknown.
pub struct Done {
    all: u32,
    highest: u32,
    in_order: bool,
}

impl Done {
    /// Starts at 0.
    ///
    /// # Errors
    /// The program cannot be read.
    pub fn of(program: &Path) -> Result<Self, AtFile<io::Error>> {
        if !program.is_file() {
            // The control reports that error.
            return Ok(Self::new(0));
        }
        let lines = files::read(program)?.split(|byte| *byte == b'\n').count();
        Ok(Self::new(u32::try_from(lines).unwrap_or(u32::MAX)))
    }

    fn new(all: u32) -> Self {
        Self { all: all.max(1), highest: 0, in_order: all > 0 }
    }

    /// Begins the program again.
    pub fn restart(&mut self) {
        self.highest = 0;
    }

    /// Records the line of a move; 0 for none.
    pub fn see(&mut self, line: u32) {
        self.in_order &= line == 0 || line >= self.highest;
        self.highest = self.highest.max(line);
    }

    /// Returns the completed share; `None` if unknown.
    pub fn share(&self) -> Option<f64> {
        (self.in_order && self.highest > 0)
            .then(|| (f64::from(self.highest) / f64::from(self.all)).min(1.0))
    }

    /// Returns the percentage of the program before a line, in any order.
    pub fn percent(&self, line: u32) -> u32 {
        (100 * u64::from(line) / u64::from(self.all)).min(100) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_tell_how_much_is_done_until_one_comes_again() {
        let mut done = Done::new(10);
        assert_eq!(done.share(), None);
        for line in [0, 2, 2, 5, 0, 5] {
            done.see(line);
        }
        assert_eq!(done.share(), Some(0.5));
        done.see(3);
        done.see(10);
        assert_eq!(done.share(), None);
        assert_eq!([3, 12, u32::MAX].map(|line| done.percent(line)), [30, 100, 100]);
    }
}
