// SPDX-License-Identifier: GPL-2.0-or-later
//! Programs for LinuxCNC, written line by line, with the resulting moves of a machine.

use crate::file::{Feed, ProgramKeys};
use crate::piece::{Arc, DECIMALS};
use crate::planes::PLANES;
use kinematics::{Fault, Letter, POSE_LETTERS, Vector3};
use machine::files::as_comment;
use machine::read::mechanism::Mechanism;
use machine::read::tools;
use program::motion::{Move, MoveKind, Spindle, extra_home};
use std::fmt::Write;

const FEED_DECIMALS: usize = 4;
/// Tolerance of a fixed coordinate, mm and degrees.
const HELD: f64 = 1e-6;
/// The work coordinate system of these programs: the last one, so that the operator's G54 is unchanged.
const SYSTEM: [&str; 2] = ["P9", "G59.3"];

/// Why a machine cannot run the program.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    #[error(
        "{file}: no joint moves {letter}, which stays at {held}; the path has {asked} at t = {t}"
    )]
    Held { file: String, letter: char, held: f64, asked: f64, t: f64 },
    #[error("[program] tool: {tool} is not in the machine's tool table: add it, or choose another")]
    NoTool {
        /// T number.
        tool: u32,
    },
    #[error(transparent)]
    Table(#[from] tools::TableError),
    #[error("[program]: {0}")]
    Clear(&'static str),
}

/// A program that is being written.
pub struct Writer<'a> {
    config: &'a Mechanism,
    keys: &'a ProgramKeys,
    /// Offset of the tool, machine units.
    pub tool: [f64; 3],
    has_tool: bool,
    /// Speed of the spindle, 1/min; 0 if it stands.
    speed: f64,
    text: String,
    lines: u32,
    /// Position of the machine, in work coordinates; `None` before the first move.
    at: [Option<f64>; 6],
    feed: Option<String>,
    plane: usize,
    /// The moves as the motion controller receives them.
    pub moves: Vec<Move>,
    /// Line numbers, with the parameter t at their ends.
    pub places: Vec<(u32, f64)>,
}

/// Formats a number of a word.
pub(super) fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    match text {
        "-0" => "0".into(),
        text => text.into(),
    }
}

impl<'a> Writer<'a> {
    /// Starts a program: comments, modes, work zero, tool and spindle.
    ///
    /// # Errors
    /// See [`SetupError`].
    pub fn begin(
        config: &'a Mechanism,
        keys: &'a ProgramKeys,
        comments: &[String],
        blend: f64,
    ) -> Result<Self, SetupError> {
        if keys.clear_z_mm.is_some() && keys.clear_x_mm.is_some() {
            return Err(SetupError::Clear(
                "clear_z_mm and clear_x_mm exclude each other: remove one",
            ));
        }
        let mut writer = Self {
            config,
            keys,
            tool: [0.0; 3],
            has_tool: false,
            speed: 0.0,
            text: String::new(),
            lines: 0,
            at: [None; 6],
            feed: None,
            plane: 0,
            moves: vec![],
            places: vec![],
        };
        for comment in comments {
            writer.line(&format!("; {}", as_comment(comment)));
        }
        writer.line("G21 G17 G40 G49 G80 G90 G94 M52 P1");
        writer.line(&format!("G64 P{}", number(blend, DECIMALS)));
        let level: String = writer.tilts().iter().map(|k| format!(" {}0", name(*k))).collect();
        let zero = [0, 1, 2].map(|k| format!("{}{}", name(k), number(keys.zero_mm[k], DECIMALS)));
        writer.line(&format!("G10 L2 {} {}{level} R0", SYSTEM[0], zero.join(" ")));
        writer.line(SYSTEM[1]);
        if !config.chain.links().is_empty() {
            writer.carriers_home();
        }
        if let Some(tool) = keys.tool {
            writer.take(tool)?;
        }
        if let Some(speed) = keys.spindle_rpm {
            writer.spin_at(speed.0);
        }
        Ok(writer)
    }

    /// Moves the axes that carry something to their home, where the path is computed.
    fn carriers_home(&mut self) {
        let home = self.config.extra_home();
        let places: Vec<usize> = self.config.extra_axes.places().collect();
        for link in self.config.chain.links() {
            let value = places.iter().position(|place| *place == link.place).map(|n| home[n]);
            let word = number(value.unwrap_or(0.0), DECIMALS);
            self.line(&format!("G53 G0 {}{word}", POSE_LETTERS[link.place]));
        }
    }

    /// Changes the tool.
    ///
    /// # Errors
    /// The tool is not in the tool table.
    pub fn take(&mut self, tool: u32) -> Result<(), SetupError> {
        let all = tools::read(self.config)?;
        let found = all.iter().find(|found| found.number == i64::from(tool));
        let found = found.ok_or(SetupError::NoTool { tool })?.offset.into();
        if self.has_tool {
            self.line("G49");
        }
        (self.tool, self.has_tool) = (found, true);
        // The machine does not move, but its position in work coordinates changes.
        self.at[..3].fill(None);
        self.line(&format!("T{tool} M6"));
        self.line("G43");
        Ok(())
    }

    /// Starts the spindle, or stops it at speed 0.
    pub fn spin_at(&mut self, speed: f64) {
        self.speed = speed;
        match speed == 0.0 {
            true => self.line("M5"),
            false => self.line(&format!("S{} M3", number(speed, FEED_DECIMALS))),
        }
    }

    /// Starts the spindle again after a tool change, which stops it.
    pub fn spin_on(&mut self) {
        if self.speed != 0.0 {
            self.spin_at(self.speed);
        }
    }

    /// Returns whether the program has moves.
    pub(super) fn has_moved(&self) -> bool {
        !self.moves.is_empty()
    }

    pub fn lines(&self) -> u32 {
        self.lines
    }

    /// Returns the position of the tool, in work coordinates.
    pub(super) fn pose(&self) -> [f64; 6] {
        self.at.map(|value| value.unwrap_or(0.0))
    }

    pub fn keys(&self) -> &'a ProgramKeys {
        self.keys
    }

    pub fn line(&mut self, text: &str) {
        self.text.push_str(text);
        self.text.push('\n');
        self.lines += 1;
    }

    /// Returns the coordinates that the machine moves.
    fn moved(&self) -> Vec<usize> {
        let layout = self.config.machine.layout();
        (0..6).filter(|k| !layout.is_held(Letter::ALL[*k])).collect()
    }

    fn tilts(&self) -> Vec<usize> {
        self.moved().into_iter().filter(|k| *k > 2).collect()
    }

    /// Converts a pose from work coordinates to machine coordinates.
    pub(super) fn in_machine(&self, pose: &[f64; 6]) -> [f64; 6] {
        in_machine(self.config, self.keys, &self.tool, pose)
    }

    /// Refuses a pose that differs in a coordinate that is fixed in the machine.
    ///
    /// # Errors
    /// See [`SetupError::Held`].
    pub fn check(&self, pose: &[f64; 6], t: f64) -> Result<(), SetupError> {
        let (there, home) = (self.in_machine(pose), self.config.start);
        let held = (0..6).filter(|k| self.config.machine.layout().is_held(Letter::ALL[*k]));
        for k in held {
            if (there[k] - home[k]).abs() > HELD {
                let (file, letter) = (self.config.file.display().to_string(), name(k));
                return Err(SetupError::Held { file, letter, held: home[k], asked: there[k], t });
            }
        }
        Ok(())
    }

    /// Returns the words of the coordinates that change, and updates the position.
    fn words(&mut self, pose: &[f64; 6], of: &[usize]) -> String {
        let mut words = String::new();
        for k in self.moved() {
            let value = round(pose[k]);
            if of.contains(&k) && self.at[k] != Some(value) {
                self.at[k] = Some(value);
                // Writing to a string never fails.
                let _ = write!(words, " {}{}", name(k), number(value, DECIMALS));
            }
        }
        words
    }

    fn go(&mut self, kind: MoveKind, feed: f64) {
        let pose = self.at.map(|value| value.unwrap_or(0.0));
        let mut end = self.in_machine(&pose);
        for k in 0..6 {
            if self.at[k].is_none() {
                end[k] = self.moves.last().map_or(self.config.start[k], |last| last.end[k]);
            }
        }
        let units = self.config.units_per_mm;
        self.moves.push(Move {
            kind,
            line: self.lines + 1,
            end,
            feed: feed * units / 60.0,
            angular_feed: feed / 60.0,
            tool: self.tool,
            file: 0,
            extra: false,
            second: None,
            lasts: None,
            extra_end: extra_home(self.config),
            spindle: Spindle::Unknown,
            is_per_turn: false,
        });
    }

    /// Writes G0 to some coordinates of a pose.
    pub fn rapid(&mut self, pose: &[f64; 6], of: &[usize]) {
        let words = self.words(pose, of);
        if !words.is_empty() {
            self.go(MoveKind::Rapid, 0.0);
            self.line(&format!("G0{words}"));
        }
    }

    /// Writes the moves from the current position to a pose: via the clear height, and from there at the
    /// feed.
    pub fn approach(&mut self, pose: &[f64; 6], feed: f64) {
        match self.clear() {
            None => self.rapid(pose, &[0, 1, 2, 3, 4, 5]),
            Some((axis, height)) => {
                let mut above = *pose;
                above[axis] = height;
                self.rapid(&above, &[axis]);
                let others: Vec<usize> = (0..6).filter(|k| *k != axis).collect();
                self.rapid(&above, &others);
                self.feed_to(pose, feed, None);
            }
        }
    }

    /// Writes the retraction of the tool to the clear height.
    pub fn lift(&mut self) {
        if let Some((axis, height)) = self.clear() {
            let mut above = [0.0; 6];
            above[axis] = height;
            self.rapid(&above, &[axis]);
        }
    }

    fn clear(&self) -> Option<(usize, f64)> {
        let keys = self.keys;
        keys.clear_z_mm.map(|z| (2, z)).or(keys.clear_x_mm.map(|x| (0, x)))
    }

    /// Returns whether the tool can be retracted.
    pub fn can_lift(&self) -> bool {
        self.clear().is_some()
    }

    /// Writes G1 at a feed per minute, or over `minutes` for inverse time.
    pub fn feed_to(&mut self, pose: &[f64; 6], feed: f64, minutes: Option<f64>) {
        self.straight(pose, &[0, 1, 2, 3, 4, 5], feed, minutes);
    }

    /// Writes G1 to some coordinates of a pose, at a feed per minute.
    pub fn cut(&mut self, pose: &[f64; 6], of: &[usize], feed: f64) {
        self.straight(pose, of, feed, None);
    }

    fn straight(&mut self, pose: &[f64; 6], of: &[usize], feed: f64, minutes: Option<f64>) {
        let words = self.words(pose, of);
        if words.is_empty() {
            return;
        }
        self.go(MoveKind::Feed, feed);
        let feed = self.feed_word(feed, minutes);
        self.line(&format!("G1{words}{feed}"));
    }

    /// Writes G2 or G3 to some coordinates of a pose, with whole turns if `turns` is not 0.
    pub fn arc_to(
        &mut self,
        pose: &[f64; 6],
        of: &[usize],
        arc: &Arc,
        turns: u32,
        feed: f64,
        minutes: Option<f64>,
    ) {
        if self.plane != arc.plane {
            self.plane = arc.plane;
            self.line(["G17", "G18", "G19"][arc.plane]);
        }
        let before = self.at;
        let from: [f64; 6] = std::array::from_fn(|k| before[k].unwrap_or(pose[k]));
        let to = pose.map(round);
        let kind = if arc.is_left { "G3" } else { "G2" };
        let axes = PLANES[arc.plane];
        let centre = [0, 1].map(|k| {
            let offset = arc.centre[k] - from[axes[k]];
            format!(" {}{}", ['I', 'J', 'K'][axes[k]], number(offset, DECIMALS))
        });
        for place in arc.places(&from, &to, turns) {
            of.iter().for_each(|k| self.at[*k] = Some(place[*k]));
            self.go(MoveKind::Feed, feed);
        }
        self.at = before;
        // An arc needs at least one word of its plane.
        self.at[axes[0]] = None;
        self.at[axes[1]] = None;
        let words = self.words(pose, of);
        let feed = self.feed_word(feed, minutes);
        let turns = if turns > 1 { format!(" P{turns}") } else { String::new() };
        self.line(&format!("{kind}{words}{}{turns}{feed}", centre.concat()));
    }

    /// Returns the F word if it changes; inverse time needs one in every line.
    fn feed_word(&mut self, feed: f64, minutes: Option<f64>) -> String {
        let value = minutes.map_or(feed, |minutes| 1.0 / minutes);
        let text = number(value, FEED_DECIMALS);
        let word = format!(" F{text}");
        let same = self.feed.as_ref() == Some(&word) && minutes.is_none();
        self.feed = minutes.is_none().then(|| word.clone());
        if same { String::new() } else { word }
    }

    /// Switches the format of feeds.
    pub fn feed_mode(&mut self, feed: Feed) {
        self.line(if feed == Feed::InverseTime { "G93" } else { "G94" });
        self.feed = None;
    }

    /// Records t at the end of the last line.
    pub fn note(&mut self, t: f64) {
        self.places.push((self.lines, t));
    }

    /// Writes the end of the program, and returns it with its moves.
    pub fn end(mut self) -> (String, Vec<Move>, Vec<(u32, f64)>) {
        self.lift();
        if self.keys.spindle_rpm.is_some() {
            self.line("M5");
        }
        let tilts = self.tilts();
        self.rapid(&[0.0; 6], &tilts);
        if self.has_tool {
            self.line("G49");
        }
        if self.plane != 0 {
            self.line("G17");
        }
        self.line("G54");
        self.line("M2");
        (self.text, self.moves, self.places)
    }
}

fn name(k: usize) -> char {
    Letter::ALL[k].name()
}

fn round(value: f64) -> f64 {
    let scale = 10_f64.powi(DECIMALS as i32);
    (value * scale).round() / scale + 0.0
}

/// Converts a pose of the motion controller to the machine's own pose, with the extra axes at home.
///
/// # Errors
/// As [`Mechanism::carried`].
pub(super) fn carried(
    config: &Mechanism,
    pose: &[f64; 6],
    tool: &Vector3<f64>,
) -> Result<[f64; 6], Fault> {
    config.carried(pose, &extra_home(config), tool)
}

/// Converts a pose in work coordinates to that of the motion controller: machine units, with the tool offset.
pub(super) fn in_machine(
    config: &Mechanism,
    keys: &ProgramKeys,
    tool: &[f64; 3],
    pose: &[f64; 6],
) -> [f64; 6] {
    std::array::from_fn(|k| match k {
        0..3 => (pose[k] + keys.zero_mm[k]) * config.units_per_mm + tool[k],
        _ => pose[k],
    })
}
