// SPDX-License-Identifier: GPL-2.0-or-later
//! The records that a run writes (workbench/linuxcnc/virtual/record.cc describes them).

use crate::row::{
    Arc, Commanded, CommandedKind, Flags, Message, MessageKind, Row, Spindle, Thread,
};
use kinematics::{ExtraAxes, Second};
use std::collections::VecDeque;
use std::io::{self, Read};

/// Supported version of the records.
pub const VERSION: u32 = 7;

const HEAD: u32 = 1;
const ROW: u32 = 2;
const MESSAGE: u32 = 3;
const END: u32 = 4;
const MOVE: u32 = 5;
const FILE: u32 = 6;
const READING: u32 = 7;
/// Flag of a message kind: the interpreter stopped in the line being read.
const OF_INTERPRETER: u32 = 256;

/// Largest length of a record: a row with LinuxCNC's largest number of joints, or a message.
const LONGEST: usize = 1 << 16;

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The program came to its end.
    Finished,
    Stopped,
    /// It could not be run; the text gives the reason.
    NotJudged,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Record<'a> {
    /// The first record: the version of the records.
    Head(u32),
    /// A servo cycle.
    Row(&'a Row),
    /// A message for the operator, and the file of its line if it is the interpreter's; its time is still in cycles.
    Message(u64, Option<usize>, Message),
    /// A move that the task commands, before it begins.
    Move(&'a Commanded),
    /// A file with lines of moves; files count from 0, the program.
    File(String),
    /// A line in which the interpreter reads endlessly.
    Reading(u32),
    /// The last record: cycles, line, cause, text.
    End(u64, u32, Cause, String),
}

/// The columns of the rows.
#[derive(Clone, Copy, Debug)]
pub struct Columns {
    /// Number of joints of legs and table, of both mechanisms if there are two.
    pub joints: usize,
    pub extra: ExtraAxes,
    /// Letters of a second mechanism.
    pub second: Option<Second>,
}

/// Reads records of a machine.
pub struct Records<R> {
    from: R,
    columns: Columns,
    bytes: Vec<u8>,
    /// The newest row: nearly all records are rows, and large to copy.
    row: Row,
    commanded: Commanded,
    /// Files of the moves that are not yet made; the first one has this number.
    files: VecDeque<usize>,
    first: usize,
    /// Number of files named so far.
    known: usize,
}

impl<R: Read> Records<R> {
    /// Reads records from a buffered reader.
    pub fn new(from: R, columns: Columns) -> Self {
        let (row, commanded) = (Row::default(), Commanded::default());
        Self {
            from,
            columns,
            bytes: vec![],
            row,
            commanded,
            files: VecDeque::new(),
            first: 0,
            known: 0,
        }
    }

    /// Returns the next record; `None` at the end.
    ///
    /// # Errors
    /// It cannot be read, or is not a record.
    pub fn read(&mut self) -> io::Result<Option<Record<'_>>> {
        let mut head = [0; 8];
        if self.from.read(&mut head[..1])? == 0 {
            return Ok(None);
        }
        self.from.read_exact(&mut head[1..])?;
        let [kind, bytes] =
            [0, 4].map(|at| u32::from_ne_bytes(std::array::from_fn(|n| head[at + n])));
        if bytes as usize > LONGEST {
            return Err(malformed());
        }
        self.bytes.resize(bytes as usize, 0);
        self.from.read_exact(&mut self.bytes)?;
        let mut fields = Fields(&self.bytes);
        let record = match kind {
            HEAD => fields.number().map(Record::Head),
            ROW => fields.row(&self.columns, &mut self.row).map(|()| {
                // Between moves LinuxCNC has no move number, or an earlier one.
                while self.first < self.row.number && self.files.len() > 1 {
                    self.files.pop_front();
                    self.first += 1;
                }
                self.row.number = self.first;
                self.row.file = self.files.front().copied().unwrap_or_default();
                Record::Row(&self.row)
            }),
            // Until a file is named, moves belong to file 0, the program.
            MOVE => fields
                .commanded(&mut self.commanded)
                .filter(|()| self.commanded.file < self.known.max(1))
                .map(|()| {
                    self.files.push_back(self.commanded.file);
                    Record::Move(&self.commanded)
                }),
            FILE => {
                self.known += 1;
                Some(Record::File(fields.text()))
            }
            READING => fields.line().map(Record::Reading),
            // As for moves.
            MESSAGE => fields
                .message()
                .filter(|(_, file, _)| file.is_none_or(|file| file < self.known.max(1)))
                .map(|(cycle, file, message)| Record::Message(cycle, file, message)),
            END => fields.end(),
            _ => None,
        };
        record.map(Some).ok_or_else(malformed)
    }
}

fn malformed() -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, "a record is malformed")
}

/// The fields of a record, in order.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*first)
    }

    fn cycle(&mut self) -> Option<u64> {
        self.take().map(u64::from_ne_bytes)
    }

    /// Reads a line; LinuxCNC uses negative lines for moves that are in no program.
    fn line(&mut self) -> Option<u32> {
        self.take().map(|bytes| i32::from_ne_bytes(bytes).max(0) as u32)
    }

    fn number(&mut self) -> Option<u32> {
        self.take().map(u32::from_ne_bytes)
    }

    fn value(&mut self) -> Option<f64> {
        self.take().map(f64::from_ne_bytes)
    }

    fn values(&mut self, into: &mut [f64]) -> Option<()> {
        for value in into {
            *value = self.value()?;
        }
        Some(())
    }

    /// Returns the rest as text; text that is not UTF-8 is read as Latin-1, as in comments of old programs.
    fn text(&self) -> String {
        let latin = || self.0.iter().map(|&byte| char::from(byte)).collect();
        str::from_utf8(self.0).map_or_else(|_| latin(), String::from)
    }

    /// Reads into a row that is empty or has the same columns.
    fn row(&mut self, columns: &Columns, row: &mut Row) -> Option<()> {
        let (joints, axes) = (columns.joints, columns.extra.len());
        (row.cycle, row.line) = (self.cycle()?, self.line()?);
        let flags = self.number()?;
        row.number = self.number()? as usize;
        row.flags = Flags { on: flags & 1 != 0, tool_busy: flags & 2 != 0, held: flags & 4 != 0 };
        row.feed = self.value()?;
        self.values(&mut row.extra.world)?;
        self.values(&mut row.tool)?;
        self.values(&mut row.second.tool)?;
        self.values(row.joints.get_mut(..joints)?)?;
        self.values(row.extra.positions.get_mut(..axes)?)?;
        self.values(row.errors.get_mut(..joints)?)?;
        self.values(row.extra.errors.get_mut(..axes)?)?;
        self.values(row.allowed.get_mut(..joints)?)?;
        self.values(row.extra.allowed.get_mut(..axes)?)?;
        row.pose.copy_from_slice(&row.extra.world[..6]);
        let second = columns.second.iter().flat_map(Second::places);
        for place in columns.extra.places().chain(second) {
            row.pose.get_mut(place).into_iter().for_each(|value| *value = 0.0);
        }
        row.second.pose =
            columns.second.map_or([0.0; 6], |second| second.pose_of(&row.extra.world));
        Some(())
    }

    fn commanded(&mut self, to: &mut Commanded) -> Option<()> {
        (to.line, to.file) = (self.line()?, self.number()? as usize);
        let kinds =
            [CommandedKind::Rapid, CommandedKind::Feed, CommandedKind::Probe, CommandedKind::Tap];
        to.kind = *kinds.get(self.number()? as usize)?;
        let flags = self.number()?;
        to.follows_spindle = flags & 2 != 0;
        to.is_per_turn = flags & 16 != 0;
        let turns = self.take().map(i32::from_ne_bytes)?;
        to.lost_turns = self.number()?;
        to.feed = self.value()?;
        let speed = self.value()?;
        to.spindle = match (flags >> 2) & 3 {
            0 => Spindle::Standing(speed),
            1 => Spindle::Turning(speed),
            _ => Spindle::Surface,
        };
        to.tolerance = self.value()?;
        let [pitch, turning, fastest] = [self.value()?, self.value()?, self.value()?];
        to.thread = (pitch > 0.0).then_some(Thread { pitch, turning, fastest });
        self.values(&mut to.end)?;
        self.values(&mut to.tool)?;
        let mut arc = Arc { center: [0.0; 3], normal: [0.0; 3], turns };
        self.values(&mut arc.center)?;
        self.values(&mut arc.normal)?;
        to.arc = (flags & 1 != 0).then_some(arc);
        Some(())
    }

    fn message(&mut self) -> Option<(u64, Option<usize>, Message)> {
        let (cycle, line, kind) = (self.cycle()?, self.line()?, self.number()?);
        let (read, read_file) = (self.line()?, self.number()? as usize);
        let is_of_interpreter = kind & OF_INTERPRETER != 0;
        let line = if is_of_interpreter { read } else { line };
        let kind = kind & !OF_INTERPRETER;
        let kind =
            *[MessageKind::Error, MessageKind::Text, MessageKind::Display].get(kind as usize)?;
        let text = self.text().trim_end().into();
        let file = is_of_interpreter.then_some(read_file);
        let message = Message { kind, text, line, file: 0, read, seconds: 0.0 };
        Some((cycle, file, message))
    }

    fn end(&mut self) -> Option<Record<'static>> {
        let (cycle, line, cause) = (self.cycle()?, self.line()?, self.number()?);
        let cause = *[Cause::Finished, Cause::Stopped, Cause::NotJudged].get(cause as usize)?;
        Some(Record::End(cycle, line, cause, self.text()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinematics::{Layout, Letters};

    fn plain(joints: usize) -> Columns {
        Columns { joints, extra: ExtraAxes::NONE, second: None }
    }

    fn record(kind: u32, payload: &[&[u8]]) -> Vec<u8> {
        let payload = payload.concat();
        [&kind.to_ne_bytes()[..], &(payload.len() as u32).to_ne_bytes(), &payload].concat()
    }

    #[test]
    fn records_come_back_as_they_were_written() {
        let values: Vec<u8> = (1..=22).flat_map(|n| f64::from(n).to_ne_bytes()).collect();
        let bytes = [
            record(HEAD, &[&6_u32.to_ne_bytes()]),
            record(
                ROW,
                &[
                    &7_u64.to_ne_bytes(),
                    &(-1_i32).to_ne_bytes(),
                    &5_u32.to_ne_bytes(),
                    &0_u32.to_ne_bytes(),
                    &values,
                ],
            ),
            record(END, &[&9_u64.to_ne_bytes(), &4_i32.to_ne_bytes(), &1_u32.to_ne_bytes(), b"so"]),
        ]
        .concat();
        let mut records = Records::new(bytes.as_slice(), plain(2));
        assert_eq!(records.read().unwrap(), Some(Record::Head(6)));
        let Some(Record::Row(row)) = records.read().unwrap() else { panic!("no row") };
        assert_eq!(
            (row.cycle, row.line, row.feed, row.pose[5], row.tool[2]),
            (7, 0, 1.0, 7.0, 13.0)
        );
        assert_eq!((row.flags.on, row.flags.tool_busy, row.flags.held), (true, false, true));
        assert_eq!((row.joints[1], row.errors[0], row.allowed[1]), (18.0, 19.0, 22.0));
        assert_eq!(records.read().unwrap(), Some(Record::End(9, 4, Cause::Stopped, "so".into())));
        assert_eq!(records.read().unwrap(), None);
    }

    #[test]
    fn values_of_extra_axes_stand_behind_those_of_legs_and_table() {
        let values: Vec<u8> = (1..=25).flat_map(|n| f64::from(n).to_ne_bytes()).collect();
        let bytes = record(ROW, &[&[0; 20], &values]);
        let layout = Layout::new(1, Letters::parse(b"X").unwrap(), Letters::NONE).unwrap();
        let axes = ExtraAxes::parse(b"WC", &layout).unwrap();
        let columns = Columns { extra: axes, ..plain(1) };
        let mut records = Records::new(bytes.as_slice(), columns);
        let Some(Record::Row(row)) = records.read().unwrap() else { panic!("no row") };
        // The values are the feed, all coordinates (the pose has no C) and the tool, then commands, errors and allowed
        // errors of three joints.
        assert_eq!(row.pose, [2.0, 3.0, 4.0, 5.0, 6.0, 0.0]);
        let first = |values: &[f64]| [values[0], values[1], values[2]];
        assert_eq!((row.joints[0], row.errors[0], row.allowed[0]), (17.0, 20.0, 23.0));
        assert_eq!(first(&row.extra.positions), [18.0, 19.0, 0.0]);
        assert_eq!(row.extra.world[5..], [7.0, 8.0, 9.0, 10.0]);
        assert_eq!(first(&row.extra.errors), [21.0, 22.0, 0.0]);
        assert_eq!(first(&row.extra.allowed), [24.0, 25.0, 0.0]);
    }

    #[test]
    fn a_second_mechanism_has_its_own_pose_and_tool_and_takes_its_letters_out_of_the_first() {
        let values: Vec<u8> = (1..=22).flat_map(|n| f64::from(n).to_ne_bytes()).collect();
        let bytes = record(ROW, &[&[0; 20], &values]);
        let letters = |text: &[u8]| Letters::parse(text).unwrap();
        let first = Layout::new(1, letters(b"X"), Letters::NONE).unwrap();
        let second = Second::new(2, letters(b"ZB"), letters(b"C"), &first).unwrap();
        let columns = Columns { second: Some(second), ..plain(2) };
        let mut records = Records::new(bytes.as_slice(), columns);
        let Some(Record::Row(row)) = records.read().unwrap() else { panic!("no row") };
        assert_eq!(row.pose, [2.0, 3.0, 4.0, 5.0, 6.0, 0.0]);
        assert_eq!(row.second.pose, [0.0, 0.0, 10.0, 0.0, 7.0, 0.0]);
        assert_eq!((row.tool, row.second.tool), ([11.0, 12.0, 13.0], [14.0, 15.0, 16.0]));
    }

    #[test]
    fn what_is_cut_off_or_is_no_record_is_an_error() {
        let whole = record(ROW, &[&[0; 20 + 22 * 8]]);
        let is_read = |bytes: &[u8], joints| Records::new(bytes, plain(joints)).read().is_ok();
        assert!(is_read(&whole, 2));
        assert!(!is_read(&whole, 3));
        assert!(!is_read(&whole[..whole.len() - 1], 2));
        assert!(!is_read(&record(9, &[]), 2));
        assert!(!is_read(&[0xff; 8], 2));
    }
}
