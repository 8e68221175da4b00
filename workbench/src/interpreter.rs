// SPDX-License-Identifier: GPL-2.0-or-later
//! Programs read by LinuxCNC's own interpreter.
//!
//! The Python script `interpreter/canon.py` drives LinuxCNC's module `gcode`, so that
//! O-words, parameters, cutter compensation, cycles and remaps mean what they mean on
//! the machine. Arcs come as short straight moves.

use crate::machine::MachineConfig;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// LinuxCNC's Python modules belong to the system's Python.
const PYTHON: &str = "/usr/bin/python3";
const CANON: &str = include_str!("../interpreter/canon.py");

/// Folder of the programs that come with LinuxCNC, as Debian's package has it.
pub const LINUXCNC_PROGRAMS: &str = "/usr/share/linuxcnc/ncfiles";

/// Largest distance of an arc from its straight moves, in mm: far below what any
/// machine reaches, and only a few hundred moves a turn.
const CHORD_ERROR_MM: f64 = 1e-4;

/// Kind of a straight move.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MoveKind {
    /// G0.
    Rapid,
    /// G1, and the pieces of arcs.
    Feed,
    /// G38: taken to its end point, as if nothing were touched.
    Probe,
}

/// One straight move; it starts where the one before ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Kind.
    pub kind: MoveKind,
    /// Line of the program, counted from 1; 0 for what runs before the program.
    pub line: u32,
    /// End point as motion receives it, tool length included: x y z in machine units,
    /// a b c in degrees.
    pub end: [f64; 6],
    /// Feed in machine units per second.
    pub feed: f64,
    /// Feed of moves of rotary axes alone, degrees per second.
    pub angular_feed: f64,
    /// Tool length offset x y z in force, machine units.
    pub tool: [f64; 3],
}

/// Why a program could not be read; the interpreter's words, with file and line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InterpreterError(String);

impl fmt::Display for InterpreterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for InterpreterError {}

/// What canon.py reads.
#[derive(Serialize)]
struct Request {
    program: PathBuf,
    length_units: f64,
    init_codes: Vec<String>,
    parameter_file: PathBuf,
    tool_table: PathBuf,
    random_tools: bool,
    chord_error: f64,
}

/// What canon.py prints, in mm and degrees, rates per minute.
#[derive(Deserialize)]
struct Row {
    kind: MoveKind,
    line: u32,
    x: f64,
    y: f64,
    z: f64,
    a: f64,
    b: f64,
    c: f64,
    feed: f64,
    angular_feed: f64,
    tool_x: f64,
    tool_y: f64,
    tool_z: f64,
}

impl Row {
    fn into_move(self, units: f64) -> Move {
        Move {
            kind: self.kind,
            line: self.line,
            end: [self.x * units, self.y * units, self.z * units, self.a, self.b, self.c],
            feed: self.feed * units / 60.0,
            angular_feed: self.angular_feed / 60.0,
            tool: [self.tool_x * units, self.tool_y * units, self.tool_z * units],
        }
    }
}

/// All moves of a program on this machine, the first one ending at `[TRAJ]HOME`.
///
/// `work_offset` (x y z in machine units, a b c in degrees) takes the place of the
/// machine's stored G54; without it the stored one is used.
///
/// # Errors
/// LinuxCNC is not installed, or its interpreter refuses the program; the machine's
/// own files are never written.
pub fn moves(
    config: &MachineConfig,
    program: &Path,
    work_offset: Option<[f64; 6]>,
) -> Result<Vec<Move>, InterpreterError> {
    read(config, program, work_offset.map(|offset| format!("G10 L2 P1 {}", words(offset))))
}

/// As [`moves`], with the work offset in force at the start changed by a block.
///
/// # Errors
/// As [`moves`].
pub fn moves_after(
    config: &MachineConfig,
    program: &Path,
    block: &str,
) -> Result<Vec<Move>, InterpreterError> {
    read(config, program, Some(block.into()))
}

fn read(
    config: &MachineConfig,
    program: &Path,
    offset: Option<String>,
) -> Result<Vec<Move>, InterpreterError> {
    let output = run(config, program, offset)
        .map_err(|error| InterpreterError(format!("{PYTHON}: {error}")))?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr).trim().to_string();
        return Err(InterpreterError(text));
    }
    csv::Reader::from_reader(output.stdout.as_slice())
        .deserialize()
        .map(|row| row.map(|row: Row| row.into_move(config.units_per_mm)))
        .collect::<Result<_, _>>()
        .map_err(|error| InterpreterError(format!("{}: {error}", program.display())))
}

fn run(config: &MachineConfig, program: &Path, offset: Option<String>) -> io::Result<Output> {
    let scratch = tempfile::tempdir()?;
    let parameter_file = scratch.path().join("parameters.var");
    match &config.program.parameter_file {
        Some(stored) if stored.exists() => drop(fs::copy(stored, &parameter_file)?),
        _ => fs::write(&parameter_file, "")?,
    }
    let request = Request {
        program: program.canonicalize().map_err(|error| named(program, &error))?,
        length_units: config.units_per_mm,
        init_codes: init_codes(config, offset),
        parameter_file,
        tool_table: absolute(config.program.tool_table.as_deref())?,
        random_tools: config.program.random_tools,
        chord_error: CHORD_ERROR_MM,
    };
    let mut ini = config.file.canonicalize()?;
    if let Some(text) = &config.program.expanded {
        // As LinuxCNC's start script does it.
        ini = scratch.path().join("expanded.ini");
        fs::write(&ini, text)?;
    }
    let mut child = Command::new(PYTHON)
        .args(["-c", CANON])
        .env("HOME", scratch.path())
        .env("INI_FILE_NAME", ini)
        .current_dir(scratch.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()?;
    if let Some(mut stdin) = child.stdin.take() {
        // A child that ended early tells the reason on standard error.
        let _ = stdin.write_all(&serde_json::to_vec(&request)?);
    }
    child.wait_with_output()
}

fn named(path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", path.display()))
}

/// The path for a process that runs in another folder; empty for none.
fn absolute(path: Option<&Path>) -> io::Result<PathBuf> {
    path.map_or(Ok(PathBuf::new()), |path| path.canonicalize().map_err(|error| named(path, &error)))
}

/// Blocks that bring the interpreter into the state in which the machine starts.
fn init_codes(config: &MachineConfig, offset: Option<String>) -> Vec<String> {
    let units = if config.units_per_mm == 1.0 { "G21" } else { "G20" };
    let mut codes = vec![format!("{units} G90")];
    codes.extend(config.program.startup_code.clone());
    codes.extend(offset);
    codes.push(format!("G53 G0 {}", words(config.home)));
    codes
}

/// Axis words; the interpreter reads no exponents.
fn words(values: [f64; 6]) -> String {
    let word = |(letter, value)| format!("{letter}{value:.12}");
    ["X", "Y", "Z", "A", "B", "C"].into_iter().zip(values).map(word).collect::<Vec<_>>().join(" ")
}
