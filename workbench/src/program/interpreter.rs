// SPDX-License-Identifier: GPL-2.0-or-later
//! Programs read by LinuxCNC's own interpreter.
//!
//! The Python script `interpreter/canon.py` drives LinuxCNC's module `gcode`, so that
//! O-words, parameters, cutter compensation, cycles and remaps mean what they mean on
//! the machine. Arcs come as short straight moves.

use crate::files::{self, Folder, Locate};
use crate::read::machine::MachineConfig;
use crate::read::places::with_folders;
use kinematics::{Letter, MAX_EXTRA, POSE_LETTERS};
use serde::Serialize;
use std::fs;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{self, PathBuf};
use std::process::{Child, Command, Stdio};

/// LinuxCNC's Python modules belong to the system's Python.
const PYTHON: &str = "/usr/bin/python3";
const CANON: &str = include_str!("../../interpreter/canon.py");

/// Folder of the programs that come with LinuxCNC, as Debian's package has it.
pub const LINUXCNC_PROGRAMS: &str = "/usr/share/linuxcnc/ncfiles";

/// Largest distance of an arc from its straight moves, in mm: far below what any
/// machine reaches, and only a few hundred moves a turn.
const CHORD_ERROR_MM: f64 = 1e-4;

/// Bytes of the records that are read at a time.
const BLOCK: usize = 1 << 16;

/// Kind of a straight move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MoveKind {
    /// G0.
    Rapid,
    /// G1, and the pieces of arcs.
    Feed,
    /// G38: taken to its end point, as if nothing were touched.
    Probe,
}

/// What the spindle does.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Spindle {
    /// It stands. The speed of its S word, 1/min; 0 where there was none.
    Standing(f64),
    /// It turns, 1/min.
    Turning(f64),
    /// G96: its speed depends on the place.
    Surface,
    /// The interpreter does not say, or was not asked.
    #[default]
    Unknown,
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
    /// Feed in machine units per second; infinite where the spindle sets it.
    pub feed: f64,
    /// Feed of moves of rotary axes alone, degrees per second.
    pub angular_feed: f64,
    /// Tool length offset x y z in force, machine units.
    pub tool: [f64; 3],
    /// Number of the file that its line belongs to, in the order of [`each`].
    pub file: usize,
    /// Whether an extra axis turns in it, or moves along with the tool; the same of another mechanism.
    pub extra: bool,
    /// The same move of the second mechanism, in its own coordinates, where the machine has two.
    pub second: Option<Beside>,
    /// Seconds that it takes, where another mechanism has a part in them.
    pub lasts: Option<f64>,
    /// Values of the extra axes at its end, in joint order: machine units and degrees.
    pub extra_end: [f64; MAX_EXTRA],
    /// The spindle during the move, where [`with_spindle`] asked for it.
    pub spindle: Spindle,
}

/// What a move is for the second of two mechanisms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beside {
    /// End point, as [`Move::end`].
    pub end: [f64; 6],
    /// Tool length offset, as [`Move::tool`].
    pub tool: [f64; 3],
}

impl Move {
    /// The move as the second mechanism sees it.
    pub fn of_second(&self) -> Option<Self> {
        let Beside { end, tool } = self.second?;
        Some(Self { end, tool, second: None, ..*self })
    }
}

/// How long a program may go on before it counts as endless.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patience {
    /// Moves.
    pub moves: u64,
    /// Seconds of the interpreter without a move.
    pub seconds: f64,
}

impl Default for Patience {
    fn default() -> Self {
        Self { moves: 10_000_000, seconds: 60.0 }
    }
}

/// Why a program could not be read.
#[derive(Debug, thiserror::Error)]
pub enum InterpreterError {
    /// The interpreter does not run, or the connection to it broke.
    #[error("{PYTHON}: {0}")]
    Unstarted(#[from] io::Error),
    /// It refuses the program, in its words, with file and line.
    #[error("{0}")]
    Refused(String),
}

/// What canon.py reads.
#[derive(Serialize)]
struct Request {
    program: PathBuf,
    length_units: f64,
    axes: String,
    init_codes: Vec<String>,
    parameter_file: PathBuf,
    tool_table: PathBuf,
    random_tools: bool,
    extra: String,
    calls: bool,
    spindle: bool,
    chord_error: f64,
    most_moves: u64,
    most_seconds: f64,
}

/// All moves of a program on this machine, the first one ending at `[TRAJ]HOME`.
///
/// `block` runs before it, for instance to change the work offset.
///
/// # Errors
/// LinuxCNC is not installed, or its interpreter refuses the program; the machine's
/// own files are never written.
pub fn moves(
    config: &MachineConfig,
    program: &path::Path,
    block: Option<&str>,
) -> Result<Vec<Move>, InterpreterError> {
    let mut all = vec![];
    each(config, program, block, &Patience::default(), |step| all.push(*step))?;
    Ok(all)
}

/// All moves of a program, each with what the spindle does. That takes the interpreter half as long
/// again.
///
/// # Errors
/// As [`moves`].
pub fn with_spindle(
    config: &MachineConfig,
    program: &path::Path,
) -> Result<Vec<Move>, InterpreterError> {
    let mut all = vec![];
    run(config, program, None, &Patience::default(), true, |step| all.push(*step))?;
    Ok(all)
}

/// Shows every move of a program while the interpreter reads it, the first one ending at
/// `[TRAJ]HOME`; `block` runs before it. What comes back is the program and the files of
/// subroutines that move anything.
///
/// # Errors
/// As [`moves`]; moves may have been shown before.
pub fn each(
    config: &MachineConfig,
    program: &path::Path,
    block: Option<&str>,
    patience: &Patience,
    see: impl FnMut(&Move),
) -> Result<Vec<PathBuf>, InterpreterError> {
    run(config, program, block, patience, false, see)
}

fn run(
    config: &MachineConfig,
    program: &path::Path,
    block: Option<&str>,
    patience: &Patience,
    spindle: bool,
    see: impl FnMut(&Move),
) -> Result<Vec<PathBuf>, InterpreterError> {
    let scratch = Folder::new().map_err(|error| error.error)?;
    let request = Request { spindle, ..request(config, program, block, patience, scratch.path())? };
    let mut running = Running(start(config, scratch.path(), &request)?);
    let mut records = Records::new(config, program, running.0.stdout.take());
    let end = records.show(see);
    // An interpreter that is gone without an end has told why on standard error.
    let status = if end.is_ok() { running.0.wait()? } else { running.ended()? };
    match end {
        Ok(End::Program) if status.success() => Ok(records.files),
        Ok(End::Refused(text)) => Err(InterpreterError::Refused(text.trim().into())),
        _ => {
            let told = fs::read(scratch.path().join(ERRORS))?;
            let told = String::from_utf8_lossy(&told).trim().to_string();
            let text = match told.is_empty() {
                true => format!("{}: LinuxCNC's interpreter ended: {status}", program.display()),
                false => told,
            };
            Err(InterpreterError::Refused(text))
        }
    }
}

/// File of the scratch folder that takes standard error.
const ERRORS: &str = "errors";

/// The interpreter, which ends with its owner.
struct Running(Child);

impl Running {
    fn ended(&mut self) -> io::Result<std::process::ExitStatus> {
        let _ = self.0.kill();
        self.0.wait()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.ended();
    }
}

/// How the records end.
enum End {
    Program,
    Refused(String),
}

/// Records of canon.py as they come.
struct Records<'a, R> {
    config: &'a MachineConfig,
    /// Axes that words may name and that move the tool or the work.
    axes: [bool; 6],
    /// Tool offsets U V W, machine units.
    tool_beside: [f64; 3],
    files: Vec<PathBuf>,
    input: Option<BufReader<R>>,
    /// The next move, but for its line and end.
    next: Move,
}

impl<'a, R: Read> Records<'a, R> {
    fn new(config: &'a MachineConfig, program: &path::Path, input: Option<R>) -> Self {
        let letters = axes(config);
        Self {
            config,
            axes: std::array::from_fn(|k| {
                let letter = POSE_LETTERS[config.place.places[k]];
                // A coordinate that a second mechanism holds has no letter.
                let has_letter =
                    !config.place.is_second || !config.machine.layout().is_held(Letter::ALL[k]);
                has_letter && letters.contains(letter) && !others(config).contains(letter)
            }),
            tool_beside: [0.0; 3],
            files: vec![program.to_path_buf()],
            input: input.map(|input| BufReader::with_capacity(BLOCK, input)),
            next: Move {
                kind: MoveKind::Rapid,
                line: 0,
                end: config.start,
                feed: 0.0,
                angular_feed: 0.0,
                tool: [0.0; 3],
                file: 0,
                extra: false,
                second: None,
                lasts: None,
                extra_end: [0.0; MAX_EXTRA],
                spindle: Spindle::default(),
            },
        }
    }

    fn show(&mut self, mut see: impl FnMut(&Move)) -> io::Result<End> {
        let units = self.config.units_per_mm;
        loop {
            let [kind] = self.bytes()?;
            match kind {
                b'r' | b'f' | b'p' => {
                    see(self.step(kind)?);
                    self.next.extra = false;
                }
                b'X' => self.next.extra = true,
                b'F' => {
                    let [feed, angular_feed] = self.numbers()?;
                    self.next.feed = feed * units / 60.0;
                    self.next.angular_feed = angular_feed / 60.0;
                }
                b'T' => {
                    let [x, y, z, u, v, w] = self.numbers()?.map(|length: f64| length * units);
                    let own = if self.config.place.is_second { [u, v, w] } else { [x, y, z] };
                    (self.next.tool, self.tool_beside) = (own, [u, v, w]);
                }
                b'S' => self.next.spindle = self.spindle()?,
                b'P' => self.enter_file()?,
                b'R' => return Ok(End::Refused(self.text()?)),
                b'E' => return Ok(End::Program),
                _ => return Err(io::ErrorKind::InvalidData.into()),
            }
        }
    }

    fn step(&mut self, kind: u8) -> io::Result<&Move> {
        let line = u32::from_le_bytes(self.bytes()?);
        let mut place: [f64; 9] = self.numbers()?;
        let units = self.config.units_per_mm;
        for k in [0, 1, 2, 6, 7, 8] {
            place[k] *= units;
        }
        self.next.kind = match kind {
            b'r' => MoveKind::Rapid,
            b'f' => MoveKind::Feed,
            _ => MoveKind::Probe,
        };
        self.next.line = line;
        // What leads to home before the program is no motion of its own.
        self.next.extra &= line > 0;
        let (config, axes) = (self.config, self.axes);
        let own = |k: usize| if axes[k] { place[config.place.places[k]] } else { config.start[k] };
        self.next.end = std::array::from_fn(own);
        self.next.second = config.second.as_deref().map(|second| {
            let is_held = |k: usize| second.machine.layout().is_held(Letter::ALL[k]);
            let own =
                |k: usize| if is_held(k) { second.start[k] } else { place[second.place.places[k]] };
            Beside { end: std::array::from_fn(own), tool: self.tool_beside }
        });
        let extra = self.config.extra_axes.places();
        self.next.extra_end.iter_mut().zip(extra).for_each(|(to, k)| *to = place[k]);
        Ok(&self.next)
    }

    fn spindle(&mut self) -> io::Result<Spindle> {
        let [kind] = self.bytes()?;
        let [speed] = self.numbers()?;
        match kind {
            b'0' => Ok(Spindle::Standing(speed)),
            b'1' => Ok(Spindle::Turning(speed)),
            b'2' => Ok(Spindle::Surface),
            b'?' => Ok(Spindle::Unknown),
            _ => Err(io::ErrorKind::InvalidData.into()),
        }
    }

    fn enter_file(&mut self) -> io::Result<()> {
        let name = self.text()?;
        self.next.file = match name.as_str() {
            "" => 0,
            name => {
                self.files.iter().position(|file| file.as_os_str() == name).unwrap_or_else(|| {
                    self.files.push(name.into());
                    self.files.len() - 1
                })
            }
        };
        Ok(())
    }

    fn bytes<const N: usize>(&mut self) -> io::Result<[u8; N]> {
        let mut bytes = [0; N];
        let input = self.input.as_mut().ok_or(io::ErrorKind::BrokenPipe)?;
        input.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    fn numbers<const N: usize>(&mut self) -> io::Result<[f64; N]> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = f64::from_le_bytes(self.bytes()?);
        }
        Ok(numbers)
    }

    fn text(&mut self) -> io::Result<String> {
        let mut text = vec![];
        let length = u64::from(u32::from_le_bytes(self.bytes()?));
        let input = self.input.as_mut().ok_or(io::ErrorKind::BrokenPipe)?;
        input.take(length).read_to_end(&mut text)?;
        Ok(String::from_utf8_lossy(&text).into_owned())
    }
}

fn start(config: &MachineConfig, scratch: &path::Path, request: &Request) -> io::Result<Child> {
    // As LinuxCNC's start script does it, which also goes to the folder of the file.
    let text = config.program.expanded.as_deref().unwrap_or(config.ini.text());
    let ini = scratch.join("expanded.ini");
    fs::write(&ini, with_folders(&path::absolute(&config.file)?, text))?;
    let mut child = Command::new(PYTHON)
        .args(["-c", CANON])
        .env("HOME", scratch)
        .env("INI_FILE_NAME", ini)
        .current_dir(scratch)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(fs::File::create(scratch.join(ERRORS))?)
        .spawn()?;
    if let Some(mut stdin) = child.stdin.take() {
        // A child that ended early tells the reason on standard error.
        let _ = stdin.write_all(&serde_json::to_vec(request)?);
    }
    Ok(child)
}

fn request(
    config: &MachineConfig,
    program: &path::Path,
    block: Option<&str>,
    patience: &Patience,
    scratch: &path::Path,
) -> Result<Request, InterpreterError> {
    let parameter_file = scratch.join("parameters.var");
    let stored = config.program.parameter_file.as_ref().filter(|stored| stored.exists());
    let parameters = stored.map_or(Ok(vec![]), |stored| fs::read(stored).at(stored));
    let parameters = parameters.map_err(|error| InterpreterError::Refused(error.to_string()))?;
    if let Some(stored) = stored {
        check_order(stored, &parameters)?;
    }
    fs::write(&parameter_file, parameters)?;
    let file = program.canonicalize().map_err(|error| named(program, &error))?;
    Ok(Request {
        calls: may_call(config, &file)?,
        program: file,
        length_units: config.units_per_mm,
        axes: axes(config),
        init_codes: init_codes(config, block),
        parameter_file,
        tool_table: absolute(config.program.tool_table.as_deref())?,
        random_tools: config.program.random_tools,
        extra: others(config),
        spindle: false,
        chord_error: CHORD_ERROR_MM,
        most_moves: patience.moves,
        most_seconds: patience.seconds,
    })
}

/// LinuxCNC reads no parameters behind the first one that is not larger than that before it, and the
/// module says of a program that it cannot be read.
fn check_order(file: &path::Path, parameters: &[u8]) -> Result<(), InterpreterError> {
    let mut last = 0;
    for (n, line) in String::from_utf8_lossy(parameters).lines().enumerate() {
        let mut words = line.split_whitespace();
        let number = words.next().and_then(|word| word.parse::<i64>().ok());
        let value = words.next().and_then(|word| word.parse::<f64>().ok());
        let (Some(number), Some(_)) = (number, value) else { continue };
        if number <= last {
            return Err(InterpreterError::Refused(format!(
                "{}:{}: Parameter file out of order: {number} behind {last}",
                file.display(),
                n + 1
            )));
        }
        last = number;
    }
    Ok(())
}

/// Whether a block of the program may run a subroutine in a file of its own: O-words with `call`, M98,
/// and codes that the machine has remapped.
fn may_call(config: &MachineConfig, program: &path::Path) -> io::Result<bool> {
    if config.ini.first("RS274NGC", "REMAP").is_some() {
        return Ok(true);
    }
    let file = files::open(program).map_err(|at| named(program, &at.error))?;
    let mut lines = BufReader::with_capacity(BLOCK, file).split(b'\n');
    lines.try_fold(false, |found, line| Ok(found || calls(&line?.to_ascii_lowercase())))
}

fn calls(line: &[u8]) -> bool {
    let blanks_and_zeros =
        |text: &[u8]| text.iter().rposition(|c| !matches!(c, b' ' | b'\t' | b'0')).map(|n| text[n]);
    (line.contains(&b'o') && line.windows(4).any(|word| word == b"call"))
        || (line.contains(&b'm')
            && (0..line.len()).any(|n| {
                line[n..].starts_with(b"98") && blanks_and_zeros(&line[..n]) == Some(b'm')
            }))
}

/// Letters that move no leg of the mechanism: of extra axes, and of another one.
fn others(config: &MachineConfig) -> String {
    let own = config.place.places;
    let is_own = |k: &usize| {
        let letter = own.iter().position(|place| place == k).map(|n| Letter::ALL[n]);
        letter.is_some_and(|letter| !config.machine.layout().is_held(letter))
    };
    let all = (0..POSE_LETTERS.len()).filter(|k| !is_own(k)).map(|k| POSE_LETTERS[k]);
    let extra: String = config.extra_axes.letters().collect();
    all.filter(|letter| config.place.is_of_pair || extra.contains(*letter)).collect()
}

/// Letters of the machine's axes.
fn axes(config: &MachineConfig) -> String {
    let given = config.ini.first("TRAJ", "COORDINATES").map_or("", |entry| entry.value.as_str());
    let given = given.to_ascii_uppercase();
    POSE_LETTERS.into_iter().filter(|letter| given.contains(*letter)).collect()
}

fn named(path: &path::Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", path.display()))
}

/// The path for a process that runs in another folder; empty for none.
fn absolute(path: Option<&path::Path>) -> io::Result<PathBuf> {
    path.map_or(Ok(PathBuf::new()), |path| path.canonicalize().map_err(|error| named(path, &error)))
}

/// Blocks that bring the interpreter into the state in which the machine starts: without a feed.
fn init_codes(config: &MachineConfig, block: Option<&str>) -> Vec<String> {
    let units = if config.units_per_mm == 1.0 { "G21" } else { "G20" };
    let mut codes = vec![format!("{units} G90 G94")];
    codes.extend(config.program.startup_code.clone());
    codes.extend(block.map(String::from));
    codes.push(format!("G53 G0 {}", words(world_home(config), &axes(config))));
    codes
}

/// Home in LinuxCNC's letters: its own, that of another mechanism, and HOME of the extra axes' joints.
fn world_home(config: &MachineConfig) -> [f64; 9] {
    let mut world = config.world_home;
    for (place, axis) in config.extra_axes.places().zip(&config.extra) {
        world[place] = axis.joint.home;
    }
    let letters = Letter::ALL.into_iter().zip(config.start);
    let is_own =
        |letter: Letter| !config.place.is_second || !config.machine.layout().is_held(letter);
    for (letter, value) in letters.filter(|(letter, _)| is_own(*letter)) {
        world[config.place.places[letter.index()]] = value;
    }
    world
}

/// Words of these axes; the interpreter reads no exponents.
fn words(values: [f64; 9], axes: &str) -> String {
    let word = |(letter, value): (char, f64)| format!("{letter}{value:.12}");
    let all = POSE_LETTERS.into_iter().zip(values);
    all.filter(|(letter, _)| axes.contains(*letter)).map(word).collect::<Vec<_>>().join(" ")
}
