// SPDX-License-Identifier: GPL-2.0-or-later
//! A file with every servo cycle of a run.

use crate::row::Row;
use machine::files::{AtFile, Locate, Whole};
use machine::read::columns::{coordinates, joint_names};
use machine::read::machine::MachineConfig;
use std::fmt::{Display, Write as _};
use std::io::{self, Write as _};
use std::ops::ControlFlow;
use std::path::Path;

/// A file with a row for every servo cycle; it gets its name when it is complete.
pub struct Trace<'a> {
    config: &'a MachineConfig,
    out: Whole,
    file: &'a Path,
    /// The row being written.
    text: String,
    unwritten: Option<AtFile<io::Error>>,
}

impl<'a> Trace<'a> {
    /// Creates a file with the names of its columns.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn new(config: &'a MachineConfig, file: &'a Path) -> Result<Self, AtFile<io::Error>> {
        let mut out = Whole::new(file)?;
        let joints = joint_names(config.all_joints().count());
        let errors = joints.iter().map(|name| format!("{name}_error"));
        let is_pair = config.second_letters.is_some();
        let beside = |names: &[&str]| -> Vec<String> {
            names.iter().filter(|_| is_pair).map(ToString::to_string).collect()
        };
        let head = ["time", "line"].map(String::from).into_iter().chain(coordinates());
        let tail = ["tool_x", "tool_y", "tool_z"].map(String::from).into_iter();
        let tail = tail.chain(beside(&["tool_u", "tool_v", "tool_w"])).chain(["feed".into()]);
        let head = head.chain(beside(&["u", "v", "w"]));
        let names: Vec<String> = head.chain(joints.clone()).chain(errors).chain(tail).collect();
        writeln!(out, "{}", names.join(",")).at(file)?;
        Ok(Self { config, out, file, text: String::new(), unwritten: None })
    }

    /// Adds a servo cycle; ends the run if the file cannot be written, which [`Self::finish`] reports.
    pub fn see(&mut self, row: &Row) -> ControlFlow<()> {
        if self.unwritten.is_none() {
            self.unwritten = self.write(row).err();
        }
        match self.unwritten {
            None => ControlFlow::Continue(()),
            Some(_) => ControlFlow::Break(()),
        }
    }

    fn write(&mut self, row: &Row) -> Result<(), AtFile<io::Error>> {
        let (joints, extra) = (self.config.guarded_joints(), self.config.first().extra.len());
        let time = row.cycle as f64 * self.config.period;
        let pose = row.extra.world;
        let (letters, tools) = if self.config.second_letters.is_some() { (9, 3) } else { (6, 0) };
        let values: [&[f64]; 8] = [
            &pose[..letters],
            &row.joints[..joints],
            &row.extra.positions[..extra],
            &row.errors[..joints],
            &row.extra.errors[..extra],
            &row.tool,
            &row.second.tool[..tools],
            &[row.feed],
        ];
        self.text.clear();
        put_cycle(&mut self.text, time, row.line, values.into_iter().flatten().copied());
        self.out.write_all(self.text.as_bytes()).at(self.file)
    }

    /// Keeps the file of a run that was judged.
    ///
    /// # Errors
    /// It cannot be written, now or before.
    pub fn finish(self, is_judged: bool) -> Result<(), AtFile<io::Error>> {
        if let Some(error) = self.unwritten {
            return Err(error);
        }
        if !is_judged {
            return Ok(());
        }
        self.out.finish()
    }
}

/// Writes a row. Numbers need no quotes; a long program has millions of rows.
fn put_cycle(text: &mut String, time: f64, line: impl Display, values: impl Iterator<Item = f64>) {
    put_number(text, time);
    write!(text, ",{line}").expect("a text takes all");
    for value in values {
        text.push(',');
        put_number(text, value);
    }
    text.push('\n');
}

/// Writes the fewest digits that are read as the same number; below 1e-5 and from 1e16 on with an exponent.
fn put_number(text: &mut String, value: f64) {
    let mut digits = zmij::Buffer::new();
    let shortest = digits.format(value);
    text.push_str(shortest.strip_suffix(".0").unwrap_or(shortest));
}
