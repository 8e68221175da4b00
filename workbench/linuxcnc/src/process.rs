// SPDX-License-Identifier: GPL-2.0-or-later
//! A run from its start to its end.

use crate::confined::{self, Keeper, Rights};
use crate::pulse::{MOST_REST, Pulse};
use crate::refusal::NotJudged;
use crate::row::{Commanded, Ending, Message, Outcome, Row};
use crate::scratch::Scratch;
use crate::stream::{Cause, Columns, Record, Records, VERSION};
use command_fds::{CommandFdExt, FdMapping};
use machine::files::Locate;
use machine::read::machine::MachineConfig;
use machine::read::places::{BIN, MODULES};
use std::env;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufReader, PipeReader, pipe};
use std::ops::ControlFlow;
use std::os::fd::OwnedFd;
use std::path::{self, Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread::sleep;
use std::time::Duration;

/// The library that replaces HAL, RTAPI and the clock, in the folder of LinuxCNC's modules.
const LIBRARY: &str = "libpkmkins-virtual.so";
/// Supported versions of LinuxCNC, by their first two numbers.
pub const SUPPORTED: [&str; 2] = ["2.9", "2.10"];
const MILLTASK: &str = "/usr/bin/milltask";
const TCL: &str = "/usr/bin/tclsh";
/// Reads the INI file for pkmkins.tcl; if it is not installed yet, it is beside the library.
const PINS: &str = "pkmkins-pins";
/// Prints LinuxCNC's build variables.
const VERSIONS: &str = "/usr/bin/linuxcnc_var";

/// Number of the file that the library writes its records to.
const STREAM: i32 = 3;

/// Lines of a log that are reported if a run fails.
const LINES: usize = 4;

/// Seconds of a standstill after LinuxCNC or the module has reported an error: nothing follows it.
const AFTER_ERROR: f64 = 5.0;

/// Number of retries, and the pause before each, while a file is busy.
const BUSY_TRIES: usize = 100;
const BUSY_PAUSE: Duration = Duration::from_millis(10);

/// Options of a run.
#[derive(Clone, Debug, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Seconds of the machine's time.
    pub most_seconds: f64,
    /// Seconds of standstill after which the run ends.
    pub most_standstill: f64,
    /// Moves after which a program counts as endless.
    pub most_moves: u64,
    /// Seconds of CPU time that LinuxCNC may use without a cycle: no cycle takes that long.
    pub most_work: f64,
    /// HAL files, of halcmd or of Tcl, that are executed after those of the simulated machine: probes,
    /// other spindles, the user's logic. Modules are searched beside them first.
    pub hal: Vec<PathBuf>,
    /// Block that is run before the program, such as a work offset.
    pub block: Option<String>,
    /// Folder for the files that the program writes, under their names.
    pub written: Option<PathBuf>,
    /// Skips lines that begin with `/`, as LinuxCNC does until the operator decides otherwise.
    pub block_delete: bool,
    /// Removes the limits of axes, joints and the guard, so that a program continues beyond them.
    pub open_limits: bool,
    /// Runs the program with all rights of the user: for a kernel without confinement.
    pub unconfined: bool,
    /// The machine's own HAL files instead of the simulated machine's, and its own homing.
    #[serde(skip)]
    pub own: Option<OwnFiles>,
    /// Seconds of CPU time that the whole run may use.
    pub most_in_all: f64,
    /// Ends the run within a second, once it is set.
    #[serde(skip)]
    pub stop: Arc<AtomicBool>,
}

/// A Tcl script that executes the machine's own HAL files, called with the INI file of the run, the
/// folder of the library, the folder of LinuxCNC's modules, and these arguments.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnFiles {
    pub script: String,
    /// Additional arguments.
    pub arguments: Vec<OsString>,
}

/// First word of the line with which such a script reports the step that failed.
const FAILED: &str = "START";
/// Its last word if LinuxCNC has ended meanwhile, and reports the reason itself.
const GONE: &str = "LinuxCNC has exited";

impl Default for Options {
    fn default() -> Self {
        Self {
            most_seconds: 86_400.0,
            most_standstill: 600.0,
            most_moves: 10_000_000,
            most_work: 20.0,
            hal: vec![],
            block: None,
            written: None,
            block_delete: true,
            open_limits: false,
            unconfined: false,
            own: None,
            most_in_all: f64::INFINITY,
            stop: Arc::default(),
        }
    }
}

/// An event of a run, in order. Moves come before the cycles in which they are made.
#[derive(Clone, Copy, Debug)]
pub enum Event<'a> {
    /// A servo cycle.
    Row(&'a Row),
    /// The next move; the first one ends where the program starts.
    Move(&'a Commanded),
    /// The next file with program lines; the first one is the program.
    File(&'a str),
}

/// Runs a program and passes on every servo cycle.
///
/// # Errors
/// Why its motion is unknown.
pub fn run(
    config: &MachineConfig,
    program: &Path,
    options: &Options,
    mut see: impl FnMut(&Row) -> ControlFlow<()>,
) -> Result<Outcome, NotJudged> {
    run_with_moves(config, program, options, |event| match event {
        Event::Row(row) => see(row),
        Event::Move(_) | Event::File(_) => ControlFlow::Continue(()),
    })
}

/// Runs a program and passes on its moves as well.
///
/// # Errors
/// As [`run`].
pub fn run_with_moves(
    config: &MachineConfig,
    program: &Path,
    options: &Options,
    see: impl FnMut(Event<'_>) -> ControlFlow<()>,
) -> Result<Outcome, NotJudged> {
    if config.is_half() {
        return Err(NotJudged::HalfOfPair);
    }
    check_version(&linuxcnc("LINUXCNCVERSION")?)?;
    let library = library();
    for file in [Path::new(MILLTASK), &library] {
        fs::metadata(file).map_err(|error| NotJudged::Missing { file: file.into(), error })?;
    }
    let scratch = Scratch::new(config, options.own.as_ref().map(|own| own.script.as_str()))?;
    let program = program.canonicalize().at(program)?;
    if program.is_dir() {
        return Err(io::Error::from(io::ErrorKind::IsADirectory)).at(&program)?;
    }
    let hal = options.hal.iter().map(|file| file.canonicalize().at(file));
    let hal = hal.map(|file| file.map(Into::into)).collect::<Result<Vec<_>, _>>()?;
    let run = Run::start(config, &scratch, &library, &program, &hal, options)?;
    let (mut see, mut is_begun) = (see, false);
    let outcome = run.watched(config, options, |event| {
        is_begun = true;
        see(event)
    });
    // LinuxCNC does not detect a full disk: it ends without a message, or its output is truncated.
    if outcome.is_err() || options.written.is_some() {
        scratch.check_room()?;
    }
    let outcome =
        outcome.map_err(|error| if is_begun { error } else { at_startup_code(config, error) })?;
    if let Some(folder) = &options.written {
        scratch.keep_written(folder)?;
    }
    Ok(outcome)
}

/// Text in LinuxCNC's last message if it refuses a block of the startup code.
const STARTUP_REFUSED: [&str; 2] = ["can't initialize interpreter", "need to be enabled"];
/// Text that it also contains if the interpreter fails to start for another reason.
const NOT_OF_STARTUP: [&str; 2] = ["REMAP", "arameter file"];
/// Words that wait for the machine: a tool change, an input, a probe.
const WAITING: [&str; 4] = ["M6", "M06", "M66", "G38"];

/// Names the startup code if it is the reason why a run ended before its program: LinuxCNC executes it before
/// the machine is on, and its messages name neither the key nor the line.
fn at_startup_code(config: &MachineConfig, error: NotJudged) -> NotJudged {
    let Some(entry) = config.ini.first("RS274NGC", "RS274NGC_STARTUP_CODE") else { return error };
    let block: String = entry.value.to_uppercase().split_whitespace().collect();
    let contains = |text: &str, words: &[&str]| words.iter().any(|words| text.contains(words));
    let reason = match &error {
        NotJudged::Endless(_) | NotJudged::Slow(_) if contains(&block, &WAITING) => {
            "LinuxCNC executes it before the machine is on, waits forever and cannot be switched on"
                .into()
        }
        NotJudged::Crashed(text) | NotJudged::Refused(text)
            if contains(text, &STARTUP_REFUSED) && !contains(text, &NOT_OF_STARTUP) =>
        {
            match text.split_once("interp_error: ").and_then(|(_, rest)| rest.split(';').next()) {
                Some(words) => format!("LinuxCNC does not start: {words}"),
                None if text.contains(STARTUP_REFUSED[1]) => {
                    "LinuxCNC executes it while the machine is off and refuses the move".into()
                }
                None => "LinuxCNC does not start with it".into(),
            }
        }
        _ => return error,
    };
    let expected =
        format!("{reason}; expected only modes, such as G21 G64: move the rest to the program");
    NotJudged::StartupCode(config.ini.refuse(entry, &expected))
}

/// Returns the installed library, or the one that the environment names: one that is not installed yet, with the module
/// and HAL files beside it if there are any.
fn library() -> PathBuf {
    match env::var_os("PKM_VIRTUAL_LIBRARY").map(PathBuf::from) {
        // The run has its own working directory.
        Some(named) => path::absolute(&named).unwrap_or(named),
        None => Path::new(MODULES).join(LIBRARY),
    }
}

/// The two processes of a run, which end with it: milltask, and the HAL files' interpreter.
struct Run<'a> {
    scratch: &'a Scratch,
    milltask: Child,
    wiring: Child,
    records: Option<PipeReader>,
    _keeper: Keeper,
}

impl<'a> Run<'a> {
    fn start(
        config: &MachineConfig,
        scratch: &'a Scratch,
        library: &Path,
        program: &Path,
        hal: &[OsString],
        options: &Options,
    ) -> Result<Self, NotJudged> {
        let (asked, ask) = pipe()?;
        let (answered, answer) = pipe()?;
        let (records, write) = pipe()?;
        let log = |name: &str| {
            let file = scratch.path().join(name);
            File::create(&file).at(&file)
        };
        let beside = library.parent().unwrap_or(Path::new(MODULES));
        let mut wiring = Command::new(TCL);
        wiring
            .arg(scratch.wiring())
            .arg(scratch.ini())
            .arg(beside)
            .arg(MODULES)
            .args(options.own.as_ref().map_or(hal, |own| &own.arguments))
            .current_dir(scratch.path())
            .env("HALLIB_DIR", linuxcnc("HALLIB_DIR")?)
            .stdin(answered)
            .stdout(ask)
            .stderr(log("wiring.log")?);
        let control = scratch.milltask(Path::new(MILLTASK))?;
        let mut milltask = Command::new(&control);
        milltask
            .arg("-ini")
            .arg(scratch.ini())
            .current_dir(scratch.path())
            .env_clear()
            .env("PATH", "/usr/bin:/bin")
            .env("HOME", scratch.path())
            .env("INI_FILE_NAME", scratch.ini())
            .env("LD_PRELOAD", library)
            .env("PKMKINS_VIRTUAL_FOLDER", scratch.path())
            .env("PKMKINS_VIRTUAL_PROGRAM", program)
            .env("PKMKINS_VIRTUAL_BLOCK", options.block.as_deref().unwrap_or_default())
            .env("PKMKINS_VIRTUAL_BLOCK_DELETE", if options.block_delete { "1" } else { "0" })
            .env("PKMKINS_VIRTUAL_OPEN", if options.open_limits { "1" } else { "" })
            .env("PKMKINS_VIRTUAL_TOOLS", &scratch.tool_table)
            .env(
                "PKMKINS_VIRTUAL_RANDOM_TOOLS",
                if config.program.random_tools { "1" } else { "0" },
            )
            .env(
                "PKMKINS_VIRTUAL_CHANGER_CYCLE",
                config.ini.as_inivar("EMCIO", "CYCLE_TIME").unwrap_or_default(),
            )
            .env("PKMKINS_VIRTUAL_STREAM", STREAM.to_string())
            .stdin(asked)
            .stdout(answer)
            .stderr(log("milltask.log")?);
        let parent_fd = OwnedFd::from(write);
        milltask
            .fd_mappings(vec![FdMapping { parent_fd, child_fd: STREAM }])
            .map_err(io::Error::other)?;
        let given = options.own.as_ref().map_or(hal, |own| &own.arguments);
        // Of the machine's own HAL files only some arguments are paths.
        let files = given.iter().map(Path::new).filter(|file| file.is_absolute());
        let folder = |file| if Path::is_dir(file) { Some(file) } else { file.parent() };
        let folders = files.filter_map(folder).chain([beside]);
        let rights = Rights {
            reads: scratch
                .folders
                .iter()
                .map(PathBuf::as_path)
                .chain(folders)
                .chain([program])
                .map(Into::into)
                .collect(),
            writes: scratch.path().into(),
            starts: vec![control, TCL.into(), beside.join(PINS), Path::new(BIN).join(PINS)],
        };
        let rights = (!options.unconfined).then_some(rights);
        let ((milltask, wiring), keeper) = confined::start(rights, move || {
            let wiring = wiring.spawn();
            let wiring = wiring.map_err(|error| NotJudged::Missing { file: TCL.into(), error })?;
            Ok((spawned(&mut milltask)?, wiring))
        })?;
        Ok(Self { scratch, milltask, wiring, records: Some(records), _keeper: keeper })
    }

    fn watched(
        mut self,
        config: &MachineConfig,
        options: &Options,
        mut see: impl FnMut(Event<'_>) -> ControlFlow<()>,
    ) -> Result<Outcome, NotJudged> {
        let from = self.records.take().expect("a run is watched once");
        let most = [options.most_work, options.most_in_all];
        let pulse = Pulse::new(from, self.milltask.id(), most, options.stop.clone());
        let mut records = Records::new(
            BufReader::with_capacity(1 << 16, pulse),
            Columns {
                joints: config.guarded_joints(),
                extra: config.first().extra_axes,
                second: config.second_letters,
            },
        );
        let mut watch = Watch::new(config.period, options);
        let mut moves = 0;
        while let Some(record) = records.read().map_err(|error| watch.quiet(error))? {
            match record {
                Record::Head(VERSION) => {}
                Record::Head(_) => return Err(NotJudged::OtherRecords),
                Record::Move(commanded) => {
                    moves += 1;
                    watch.commanded = (commanded.line, commanded.file);
                    if moves > options.most_moves {
                        return Err(NotJudged::TooManyMoves(options.most_moves, commanded.line));
                    }
                    if see(Event::Move(commanded)).is_break() {
                        return Err(NotJudged::Interrupted);
                    }
                }
                Record::Reading(line) => watch.line = line,
                Record::File(name) => {
                    let _ = see(Event::File(&name));
                }
                Record::Row(row) => {
                    if see(Event::Row(row)).is_break() {
                        return Err(NotJudged::Interrupted);
                    }
                    if let Some(ending) = watch.row(row)? {
                        return Ok(watch.outcome(ending, row.cycle));
                    }
                }
                Record::Message(cycle, file, message) => watch.message(cycle, file, message),
                Record::End(cycle, _, Cause::Finished, _) => {
                    return Ok(watch.outcome(Ending::Finished, cycle));
                }
                Record::End(cycle, _, Cause::Stopped, _) => {
                    return Ok(watch.outcome(Ending::Stopped, cycle));
                }
                Record::End(_, _, Cause::NotJudged, text) => {
                    return Err(match options.own {
                        Some(_) => self.refused(text),
                        None => NotJudged::Refused(text + &self.complaint()),
                    });
                }
            }
        }
        Err(NotJudged::Crashed(self.last_words()))
    }

    /// Returns the error of the HAL files: Tcl prints the reason first, and then the location.
    fn complaint(&mut self) -> String {
        // It sees the end of milltask, prints its message and ends.
        let _ = self.wiring.wait();
        let lines = self.log("wiring.log");
        let reason: Vec<String> =
            lines.into_iter().take_while(|line| line.trim() != "while executing").collect();
        joined(&reason[..reason.len().min(LINES)])
    }

    /// Returns why the machine's own files do not start it: the step that failed, if one did.
    fn refused(&mut self, text: String) -> NotJudged {
        let _ = self.wiring.wait();
        let lines = self.log("wiring.log");
        let words = lines.iter().map(|line| line.split('\t').collect::<Vec<_>>());
        let failed = words.into_iter().find_map(|words| match words[..] {
            [FAILED, kind, file, line, entry, reason] => Some((
                kind == "mistake",
                file.into(),
                line.parse().ok()?,
                entry.parse().ok()?,
                reason.to_string(),
            )),
            _ => None,
        });
        let Some((is_mistake, file, line, entry, reason)) = failed else {
            // LinuxCNC's errors are among the operator messages already.
            let words =
                if text.starts_with("LinuxCNC") { String::new() } else { self.last_words() };
            return NotJudged::Refused(text + &words);
        };
        let text = if reason == GONE { text + &self.last_words() } else { reason };
        NotJudged::Step { file, line, entry, is_mistake, text }
    }

    /// Returns LinuxCNC's last messages.
    fn last_words(&self) -> String {
        let mut lines = self.log("milltask.log");
        // A slow computer is not the subject of the check.
        lines.retain(|line| !line.contains("main loop took"));
        joined(&lines[lines.len().saturating_sub(LINES)..])
    }

    fn log(&self, name: &str) -> Vec<String> {
        let text = fs::read(self.scratch.path().join(name)).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        text.lines().filter(|line| !line.trim().is_empty()).map(String::from).collect()
    }
}

impl Drop for Run<'_> {
    fn drop(&mut self) {
        end(&mut self.milltask);
        end(&mut self.wiring);
    }
}

fn joined(lines: &[String]) -> String {
    if lines.is_empty() { String::new() } else { format!(": {}", lines.join("; ")) }
}

/// Starts a file that was just written: while another thread of this process starts a program, that program
/// briefly has the file open for writing.
fn spawned(command: &mut Command) -> io::Result<Child> {
    for _ in 0..BUSY_TRIES {
        match command.spawn() {
            Err(error) if error.kind() == io::ErrorKind::ExecutableFileBusy => sleep(BUSY_PAUSE),
            result => return result,
        }
    }
    command.spawn()
}

fn end(child: &mut Child) {
    // It may have ended already.
    let _ = child.kill();
    let _ = child.wait();
}

/// Returns one of LinuxCNC's build variables.
fn linuxcnc(name: &str) -> Result<String, NotJudged> {
    let output = Command::new(VERSIONS).arg(name).stdin(Stdio::null()).output();
    let output = output.map_err(|error| NotJudged::Missing { file: VERSIONS.into(), error })?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_string())
}

/// Refuses a LinuxCNC that is not supported: its first two numbers decide.
fn check_version(installed: &str) -> Result<(), NotJudged> {
    let is_one = |series: &str| {
        let rest = installed.strip_prefix(series);
        rest.is_some_and(|rest| !rest.starts_with(|next: char| next.is_ascii_digit()))
    };
    match SUPPORTED.into_iter().any(is_one) {
        true => Ok(()),
        false => Err(NotJudged::OtherVersion(installed.into())),
    }
}

/// The state of a run so far.
struct Watch<'a> {
    period: f64,
    options: &'a Options,
    messages: Vec<Message>,
    pose: [[f64; 6]; 2],
    /// Cycle of the last motion, and its line.
    moved: u64,
    line: u32,
    file: usize,
    /// Line and file of the last command to motion.
    commanded: (u32, usize),
}

impl<'a> Watch<'a> {
    fn new(period: f64, options: &'a Options) -> Self {
        Self {
            period,
            options,
            messages: vec![],
            pose: [[f64::NAN; 6]; 2],
            moved: 0,
            line: 0,
            file: 0,
            commanded: (0, 0),
        }
    }

    fn seconds(&self, cycles: u64) -> f64 {
        cycles as f64 * self.period
    }

    /// Returns how the program ended, if it stands and will not continue.
    fn row(&mut self, row: &Row) -> Result<Option<Ending>, NotJudged> {
        let pose = [row.pose, row.second.pose];
        if pose != self.pose {
            (self.pose, self.moved) = (pose, row.cycle);
        }
        if row.line > 0 {
            (self.line, self.file) = (row.line, row.file);
        }
        let stands = self.seconds(row.cycle - self.moved);
        if stands > AFTER_ERROR && row.flags.held && self.messages.iter().any(Message::is_error) {
            return Ok(Some(Ending::Stopped));
        }
        if stands > self.options.most_standstill {
            return Err(NotJudged::Stands(self.options.most_standstill, self.line));
        }
        if self.seconds(row.cycle) > self.options.most_seconds {
            return Err(NotJudged::TooLong(self.options.most_seconds, self.line));
        }
        Ok(None)
    }

    fn quiet(&self, error: io::Error) -> NotJudged {
        match error.kind() {
            io::ErrorKind::TimedOut => NotJudged::Endless(self.line),
            io::ErrorKind::WouldBlock => NotJudged::Rests(MOST_REST.as_secs(), self.line),
            io::ErrorKind::QuotaExceeded => NotJudged::Slow(self.options.most_in_all),
            io::ErrorKind::ConnectionAborted => NotJudged::Interrupted,
            _ => error.into(),
        }
    }

    /// Adds a message: the interpreter's is in the file that it reads, one of motion about a refused command in the file of
    /// that command, and any other one in the file of the present move.
    fn message(&mut self, cycle: u64, read: Option<usize>, message: Message) {
        let (line, commanded) = self.commanded;
        let refused = (message.named_line() == Some(line)).then_some(commanded);
        let file = read.or(refused).unwrap_or(self.file);
        self.messages.push(Message { seconds: self.seconds(cycle), file, ..message });
    }

    fn outcome(self, ending: Ending, cycles: u64) -> Outcome {
        Outcome { ending, cycles, seconds: self.seconds(cycles), messages: self.messages }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_two_numbers_of_a_version_decide() {
        for supported in ["2.9.0~pre1+git20230208.f1270d6ed7", "2.9.4", "2.10.0~pre1", "2.10"] {
            assert!(check_version(supported).is_ok(), "{supported}");
        }
        for other in ["2.8.4", "2.11.0", "2.90.1", "3.2.9", ""] {
            let refused = check_version(other).unwrap_err().to_string();
            let expected = format!(
                "LinuxCNC {other} is installed, which virtual time does not support: install version 2.9 or 2.10"
            );
            assert_eq!(refused, expected);
        }
    }

    #[test]
    fn the_supported_versions_are_those_of_the_table() {
        let table = include_str!("../versions.toml").lines();
        let versions: Vec<_> =
            table.filter_map(|line| line.strip_prefix("version = \"")?.strip_suffix('"')).collect();
        assert_eq!(versions, SUPPORTED);
    }
}
