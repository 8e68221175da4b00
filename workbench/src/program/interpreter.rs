// SPDX-License-Identifier: GPL-2.0-or-later
//! Programs read by LinuxCNC's own interpreter.
//!
//! The Python script `interpreter/canon.py` drives LinuxCNC's module `gcode`, so that
//! O-words, parameters, cutter compensation, cycles and remaps mean what they mean on
//! the machine. Arcs come as short straight moves.

use crate::files::{AtFile, Locate};
use crate::read::machine::MachineConfig;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io::{self, Write};
use std::path::{self, PathBuf};
use std::process::{Command, Output, Stdio};

/// LinuxCNC's Python modules belong to the system's Python.
const PYTHON: &str = "/usr/bin/python3";
const CANON: &str = include_str!("../../interpreter/canon.py");

/// Folder of the programs that come with LinuxCNC, as Debian's package has it.
pub const LINUXCNC_PROGRAMS: &str = "/usr/share/linuxcnc/ncfiles";

/// Largest distance of an arc from its straight moves, in mm: far below what any
/// machine reaches, and only a few hundred moves a turn.
const CHORD_ERROR_MM: f64 = 1e-4;

/// Path control modes as the interpreter numbers them: G61 and G61.1.
const EXACT_PATH: u32 = 610;
const EXACT_STOP: u32 = 611;

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
    /// What LinuxCNC's planner makes of it.
    pub path: Path,
}

/// How LinuxCNC's planner goes on from a move to the next one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PathMode {
    /// G61.1: every move ends at rest.
    Stop,
    /// G61: the path is kept, and slowed down at corners as far as needed; the interpreter's own default.
    #[default]
    Exact,
    /// G64.
    Blend {
        /// P: distance from the path at corners, machine units; 0 for no limit.
        tolerance: f64,
        /// Q: moves within this distance of a straight line become one; 0 for none.
        merging: f64,
    },
}

/// The arc that a straight move is a piece of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// Number among the arcs of the program; the pieces of an arc share it.
    pub number: u32,
    /// Machine units.
    pub radius: f64,
    /// Axis square to its plane: 0 to 2 for X to Z.
    pub normal: usize,
}

/// What the planner needs to know of a move beside its places.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Path {
    /// Path control mode in force.
    pub mode: PathMode,
    /// None for a move that is straight in the program.
    pub arc: Option<Arc>,
    /// Motion stands still before it: a tool change, a dwell, a spindle that starts.
    pub stands: bool,
    /// Number of the file that its line belongs to ([`Reading::files`]).
    pub file: usize,
}

/// What the interpreter makes of a program.
#[derive(Clone, Debug, PartialEq)]
pub struct Reading {
    /// All moves, the first one ending at `[TRAJ]HOME`.
    pub moves: Vec<Move>,
    /// The program, and the files of subroutines that move anything.
    pub files: Vec<PathBuf>,
}

impl Reading {
    fn new(program: &path::Path) -> Self {
        Self { moves: vec![], files: vec![program.to_path_buf()] }
    }

    fn add(&mut self, row: Row, units: f64) {
        let file = match row.file.as_str() {
            "" => 0,
            name => {
                self.files.iter().position(|file| file.as_os_str() == name).unwrap_or_else(|| {
                    self.files.push(name.into());
                    self.files.len() - 1
                })
            }
        };
        self.moves.push(row.into_move(units, file));
    }
}

/// Why a program could not be read.
#[derive(Debug, thiserror::Error)]
pub enum InterpreterError {
    /// The interpreter does not run.
    #[error("{PYTHON}: {0}")]
    Unstarted(#[from] io::Error),
    /// It refuses the program, in its words, with file and line.
    #[error("{0}")]
    Refused(String),
    /// What it answers is no list of moves.
    #[error(transparent)]
    Malformed(#[from] AtFile<csv::Error>),
}

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
    mode: u32,
    tolerance: f64,
    merging: f64,
    arc: u32,
    radius: f64,
    normal: usize,
    stands: u8,
    file: String,
}

impl Row {
    fn path(&self, units: f64, file: usize) -> Path {
        let Self { tolerance, merging, arc: number, normal, .. } = *self;
        let mode = match self.mode {
            EXACT_STOP => PathMode::Stop,
            EXACT_PATH => PathMode::Exact,
            _ => PathMode::Blend { tolerance: tolerance * units, merging: merging * units },
        };
        let arc = (number > 0).then_some(Arc { number, radius: self.radius * units, normal });
        Path { mode, arc, stands: self.stands != 0, file }
    }

    fn into_move(self, units: f64, file: usize) -> Move {
        Move {
            kind: self.kind,
            line: self.line,
            end: [self.x * units, self.y * units, self.z * units, self.a, self.b, self.c],
            feed: self.feed * units / 60.0,
            angular_feed: self.angular_feed / 60.0,
            tool: [self.tool_x * units, self.tool_y * units, self.tool_z * units],
            path: self.path(units, file),
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
    program: &path::Path,
    work_offset: Option<[f64; 6]>,
) -> Result<Vec<Move>, InterpreterError> {
    let offset = work_offset.map(|offset| format!("G10 L2 P1 {}", words(offset)));
    Ok(read(config, program, offset)?.moves)
}

/// As [`moves`] with the stored work offset, and the files that the lines belong to.
///
/// # Errors
/// As [`moves`].
pub fn reading(config: &MachineConfig, program: &path::Path) -> Result<Reading, InterpreterError> {
    read(config, program, None)
}

/// As [`moves`], with the work offset in force at the start changed by a block.
///
/// # Errors
/// As [`moves`].
pub fn moves_after(
    config: &MachineConfig,
    program: &path::Path,
    block: &str,
) -> Result<Vec<Move>, InterpreterError> {
    Ok(read(config, program, Some(block.into()))?.moves)
}

fn read(
    config: &MachineConfig,
    program: &path::Path,
    offset: Option<String>,
) -> Result<Reading, InterpreterError> {
    let output = run(config, program, offset)?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr).trim().to_string();
        return Err(InterpreterError::Refused(text));
    }
    let mut found = Reading::new(program);
    for row in csv::Reader::from_reader(output.stdout.as_slice()).deserialize() {
        found.add(row.at(program)?, config.units_per_mm);
    }
    Ok(found)
}

fn run(config: &MachineConfig, program: &path::Path, offset: Option<String>) -> io::Result<Output> {
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

fn named(path: &path::Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", path.display()))
}

/// The path for a process that runs in another folder; empty for none.
fn absolute(path: Option<&path::Path>) -> io::Result<PathBuf> {
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
