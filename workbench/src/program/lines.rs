// SPDX-License-Identifier: GPL-2.0-or-later
//! Which file a line belongs to: LinuxCNC's servo cycles tell its number alone.

use crate::program::interpreter::Move;

/// Lines that move something, of every file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lines(Vec<Vec<bool>>);

impl Lines {
    /// Takes a move.
    pub(super) fn see(&mut self, step: &Move) {
        let (file, line) = (step.file, step.line as usize);
        if self.0.len() <= file {
            self.0.resize(file + 1, vec![]);
        }
        let lines = &mut self.0[file];
        if lines.len() <= line {
            lines.resize(line + 1, false);
        }
        lines[line] = true;
    }

    /// Files that move something in a line of this number, in their order; the program alone where none does.
    pub fn files(&self, line: u32) -> Vec<usize> {
        let moves = |file: &usize| self.0[*file].get(line as usize) == Some(&true);
        let found: Vec<usize> = (0..self.0.len()).filter(moves).collect();
        if found.is_empty() { vec![0] } else { found }
    }
}
