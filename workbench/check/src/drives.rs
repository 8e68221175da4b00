// SPDX-License-Identifier: GPL-2.0-or-later
//! Check of the HAL files: command, feedback and enable of every joint's drive, in an order of the
//! servo thread that adds no delay.
//!
//! HAL files of Tcl have loops, so their text does not show their effect: `hal_files.tcl` runs
//! them in an interpreter without any access, and lists their HAL commands. Files that it cannot
//! run are not judged, with the reason. HAL knows the direction of a pin only once its component is loaded:
//! here it is known for motion and PID loops, and for inputs by their names.

use crate::programs::{is_installed, is_program};
use machine::digits::plain;
use machine::files::{self, Folder};
use machine::read::diagnostic::Severity;
use machine::read::ini::{Entry, Excerpt, Ini, IniError, Problem};
use machine::read::places::{HALLIB, MODULES};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;

const SCRIPT: &str =
    concat!(include_str!("../../machine/src/read/ini.tcl"), include_str!("hal_files.tcl"));

/// Runs the HAL files in LinuxCNC in virtual time.
pub const START: &str = concat!(include_str!("hal_files.tcl"), include_str!("start.tcl"));

/// Components that do not run in virtual time, although no HAL file starts them.
const UNRUN: [&str; 2] = ["halui", "ini"];

/// Modules that need their hardware: prefixes of names, and whole names.
const HARDWARE: ([&str; 6], [&str; 4]) = (
    ["hm2_", "hal_", "lcec", "mesa_", "pluto_", "opto_"],
    ["hostmot2", "serport", "setsserial", "probe_parport"],
);

/// The thread that runs in virtual time, and another one that motmod creates.
const SERVO: &str = "servo-thread";
const BASE: &str = "base-thread";

const TCL: &str = "/usr/bin/tclsh";

/// Number of displayed lines of a file that ends LinuxCNC's start.
const SHOWN: usize = 4;

/// Functions that read from drives, and those that write to them, by the ends of their names.
const READING: [&str; 4] = [".read", ".read-all", ".capture-position", ".read-request"];
const WRITING: [&str; 4] = [".write", ".write-all", ".update-freq", ".do-pid-calcs"];

/// Ends of names of pins that are inputs: none of them is a source.
const TAKING: [&str; 6] =
    [".feedback", ".command", ".position-cmd", ".velocity-cmd", ".enable", ".index-enable"];

/// Assumed largest delay of feedback, in cycles.
const DELAY: f64 = 1.0;

pub(crate) type Found = (Severity, IniError);

/// Location of a command in a HAL file, or in an entry of `[HAL]` if the file has no name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Location {
    pub file: PathBuf,
    /// Line number from 1; 0 for the whole file.
    pub line: usize,
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.file.as_os_str().is_empty(), self.line) {
            (true, _) => f.write_str("[HAL]"),
            (_, 0) => write!(f, "{}", self.file.display()),
            (_, line) => write!(f, "{}:{line}", self.file.display()),
        }
    }
}

/// The HAL commands of the HAL files.
#[derive(Default)]
struct Wiring {
    /// Signal of each linked pin, and the location of the command.
    signals: BTreeMap<String, (String, Location)>,
    /// Functions in the order of their threads.
    functions: BTreeMap<String, Vec<(String, Location)>>,
    /// Modules with their arguments, and where they are loaded.
    modules: Vec<(Vec<String>, Location)>,
    /// Programs with their arguments, and where they are started.
    programs: Vec<(Vec<String>, Location)>,
    /// Why a file cannot be run, and whether this ends LinuxCNC's start.
    stopped: Option<(Severity, String, Location)>,
}

/// Returns all mistakes in the wiring of the drives.
///
/// # Errors
/// A value that is not a number.
pub(crate) fn check(ini: &Ini) -> Result<Vec<Found>, IniError> {
    let mut found = following_errors(ini)?;
    if ini.all("HAL", "HALFILE").is_empty() {
        return Ok(found);
    }
    let wiring = match carried_out(ini) {
        Ok(wiring) => wiring,
        Err(reason) => {
            let text = format!("the drives are not judged: {reason}");
            found.push((Severity::Warning, at_last_file(ini, &text)));
            return Ok(found);
        }
    };
    found.extend(wiring.absent(ini));
    if let Some((severity, text, place)) = &wiring.stopped {
        found.push((*severity, at(ini, place, text)));
        return Ok(found);
    }
    let judge = Judge { ini, wiring: &wiring, found };
    judge.all()
}

/// Checks that LinuxCNC tolerates the following error that a drive's delay causes at its largest speed. The tolerance
/// is proportional to the speed, so the result is the same at every speed.
fn following_errors(ini: &Ini) -> Result<Vec<Found>, IniError> {
    let period = 1e-9 * ini.number_or("EMCMOT", "SERVO_PERIOD", 1e6)?;
    let mut found = vec![];
    for section in joints(ini)?.map(|n| format!("JOINT_{n}")) {
        let speed = ini.number_or(&section, "MAX_VELOCITY", 0.0)?;
        let allowed = ini.number_or(&section, "FERROR", 1.0)?;
        let cycles = ini.number_or(&section, "DELAY", DELAY)?;
        let least = plain(speed * period * cycles);
        if allowed >= least {
            continue;
        }
        let is_measured = ini.first(&section, "DELAY").is_some();
        let severity = if is_measured { Severity::Error } else { Severity::Warning };
        let text = format!(
            "at MAX_VELOCITY {speed} feedback that is {cycles} servo cycles late lags by {least}, and \
             LinuxCNC stops the machine: increase it{}",
            if is_measured { "" } else { ", or the measured cycles as DELAY" }
        );
        found.push((severity, crate::wiring::at_key(ini, &section, "FERROR", &text)));
    }
    Ok(found)
}

fn joints(ini: &Ini) -> Result<std::ops::Range<usize>, IniError> {
    Ok(0..ini.number_or("KINS", "JOINTS", 0.0)? as usize)
}

/// Runs the script on all HAL files; an error gives the reason for a failure.
fn carried_out(ini: &Ini) -> Result<Wiring, String> {
    let entries: Vec<String> = entries(ini).into_iter().map(|(_, text)| text).collect();
    Ok(Wiring::of(&recorded(ini, "main", &entries)?))
}

/// Runs a command of the script on these entries and returns its output, or the reason for a failure.
pub(crate) fn recorded(ini: &Ini, command: &str, entries: &[String]) -> Result<String, String> {
    let folder = Folder::new().map_err(|error| error.to_string())?;
    let [script, copy] = ["hal_files.tcl", "machine.ini"].map(|name| folder.path().join(name));
    let write = |file: &Path, text: &str| {
        std::fs::write(file, text).map_err(|error| format!("{}: {error}", file.display()))
    };
    write(&script, &format!("{SCRIPT}\ndrives::{command} {{*}}$argv\n"))?;
    write(&copy, ini.expanded().unwrap_or(ini.text()))?;
    let beside = ini.file().parent().filter(|folder| !folder.as_os_str().is_empty());
    let done = Command::new(TCL)
        .arg(&script)
        .arg(&copy)
        .arg(beside.unwrap_or(Path::new(".")))
        .arg(HALLIB)
        .args(entries)
        .output()
        .map_err(|error| format!("{TCL}: {error}; install tcl"))?;
    if !done.status.success() {
        return Err(String::from_utf8_lossy(&done.stderr).lines().next().unwrap_or("").into());
    }
    Ok(String::from_utf8_lossy(&done.stdout).into())
}

/// Returns the entries of `[HAL]` in LinuxCNC's order, as arguments of the script.
fn entries(ini: &Ini) -> Vec<(Option<&Entry>, String)> {
    let of = |key: &'static str, kind: &'static str| {
        let all = ini.all("HAL", key).into_iter();
        all.map(move |entry| (Some(entry), format!("{kind} {}", entry.value)))
    };
    of("HALFILE", "file").chain(of("HALCMD", "command")).collect()
}

/// Returns the entries that a start runs: LinuxCNC loads planner and homing before all others.
pub fn started(ini: &Ini) -> Vec<(Option<&Entry>, String)> {
    let module = |section, key, usual: &str| {
        let entry = ini.first(section, key).filter(|entry| !entry.value.is_empty());
        (entry, format!("command loadrt {}", entry.map_or(usual, |entry| &entry.value)))
    };
    let first = [module("TRAJ", "TPMOD", "tpmod"), module("EMCMOT", "HOMEMOD", "homemod")];
    first.into_iter().chain(entries(ini)).collect()
}

/// The part of the HAL files that a start in virtual time can run.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// Why it cannot be tested at all.
    pub reason: Option<String>,
    /// Components whose pins do not exist there.
    pub strangers: Vec<String>,
    /// What is omitted because of them.
    pub left_out: Option<String>,
    /// Whether something responds to a tool change.
    pub changes_tools: bool,
}

impl Plan {
    /// Creates the plan for the HAL files.
    pub fn new(ini: &Ini) -> Self {
        let not_tried = |reason: String| Self { reason: Some(reason), ..Self::default() };
        if let Some(entry) = ini.first("HAL", "TWOPASS").filter(|entry| !entry.value.is_empty()) {
            return not_tried(format!("[HAL]TWOPASS = {} runs the HAL files twice", entry.value));
        }
        match carried_out(ini) {
            Ok(wiring) => wiring.plan().unwrap_or_else(not_tried),
            Err(reason) => not_tried(reason),
        }
    }
}

impl Wiring {
    /// Returns programs and modules that do not exist, if LinuxCNC is installed.
    fn absent(&self, ini: &Ini) -> Vec<Found> {
        // A machine with hardware may be checked on a computer without it and its drivers.
        if !is_installed() || self.hardware().is_some() {
            return vec![];
        }
        // pkmkins itself may be built and not installed.
        let is_module = |name: &str| {
            name == "pkmkins" || Path::new(MODULES).join(format!("{name}.so")).is_file()
        };
        let modules = self.modules.iter().filter_map(|(words, place)| {
            let name = words.first().filter(|name| !is_module(name))?;
            let text = format!("LinuxCNC has no module {name}, so it fails to start; correct the name or install the module");
            Some((Severity::Error, place, name.as_str(), text))
        });
        let programs = self.programs.iter().filter_map(|(words, place)| {
            let name = program(words).filter(|name| !is_program(ini, name))?;
            let mut options = words.iter().take_while(|word| word.starts_with('-'));
            // LinuxCNC waits for it only with -W, -Wn and -w.
            let (severity, what) = match options.any(|word| word.contains(['W', 'w'])) {
                true => {
                    (Severity::Error, "so LinuxCNC fails to start; correct the name or install it")
                }
                false => (
                    Severity::Warning,
                    "and LinuxCNC starts without it; correct the name or install it",
                ),
            };
            Some((severity, place, name, format!("there is no program {name}, {what}")))
        });
        let command = |place: &Location, name: &str, text: &str| {
            let is_it = |entry: &&Entry| entry.value.split_whitespace().any(|word| word == name);
            let entry =
                ini.all("HAL", "HALCMD").into_iter().find(is_it).filter(|_| place.line == 0);
            entry.map_or_else(|| at(ini, place, text), |entry| ini.refuse(entry, text))
        };
        let all = modules.chain(programs);
        all.map(|(severity, place, name, text)| (severity, command(place, name, &text))).collect()
    }

    /// Returns the first module that needs its hardware.
    fn hardware(&self) -> Option<(&str, &Location)> {
        let is_hardware = |name: &str| {
            HARDWARE.0.iter().any(|start| name.starts_with(start)) || HARDWARE.1.contains(&name)
        };
        let named =
            self.modules.iter().filter_map(|(words, place)| Some((words.first()?.as_str(), place)));
        named.into_iter().find(|(name, _)| is_hardware(name))
    }

    /// Returns the plan, or why there is none.
    fn plan(&self) -> Result<Plan, String> {
        if let Some((Severity::Error, text, _)) = &self.stopped {
            return Err(text.clone());
        }
        if let Some((name, place)) = self.hardware() {
            return Err(format!("{name}{} needs its hardware", place.shown()));
        }
        let threads = |(words, _): &&(Vec<String>, Location)| {
            words.first().is_some_and(|name| name == "threads")
        };
        if let Some((_, place)) = self.modules.iter().find(threads) {
            return Err(format!("threads{} makes a thread", place.shown()));
        }
        if let Some((function, place)) = self.functions.get(BASE).and_then(|all| all.first()) {
            return Err(format!(
                "{function}{} runs in {BASE}, which has no virtual time",
                place.shown()
            ));
        }
        let mut strangers: Vec<String> = UNRUN.map(Into::into).into();
        strangers.extend(self.programs.iter().map(|(words, _)| component(words)));
        let is_strange =
            |pin: &str| strangers.iter().any(|name| pin.split('.').next() == Some(name));
        let first = self.programs.first().map(|(words, place)| {
            format!("{}{}", program(words).unwrap_or("a program"), place.shown())
        });
        let pin = || self.signals.iter().find(|(pin, _)| is_strange(pin));
        let left_out =
            first.or_else(|| pin().map(|(pin, (_, place))| format!("{pin}{}", place.shown())));
        let changer = self.beside("iocontrol.0.tool-changed");
        // A missing response is a separate mistake.
        let changes_tools = changer.iter().any(|pin| !is_strange(pin));
        Ok(Plan { reason: None, left_out, changes_tools, strangers })
    }
}

impl Location {
    /// Returns a description to follow a name.
    fn shown(&self) -> String {
        match self.file.file_name() {
            Some(name) => format!(" ({}:{})", name.to_string_lossy(), self.line),
            None => String::new(),
        }
    }
}

/// Returns the program that loadusr starts.
pub(crate) fn program(words: &[String]) -> Option<&str> {
    let mut words = words.iter().map(String::as_str);
    while let Some(word) = words.next() {
        match word.strip_prefix('-') {
            // -Wn NAME, -n NAME.
            Some(options) if options.ends_with('n') => drop(words.next()),
            Some(_) => {}
            None => return Some(word),
        }
    }
    None
}

/// Returns the name of the component that it creates: the given name, or its own.
fn component(words: &[String]) -> String {
    let named = |option: fn(&str) -> bool| {
        let at = words.iter().position(|word| option(word))?;
        words.get(at + 1).cloned()
    };
    let given = named(|word| word.starts_with("-W") && word.ends_with('n'));
    given.or_else(|| named(|word| word == "-n" || word == "-c")).unwrap_or_else(|| {
        let name = Path::new(program(words).unwrap_or_default()).file_stem();
        name.unwrap_or_default().to_string_lossy().into()
    })
}

impl Wiring {
    fn of(text: &str) -> Self {
        let mut wiring = Self::default();
        for line in text.lines() {
            let words: Vec<&str> = line.split('\t').collect();
            let [file, line, what, arguments @ ..] = &words[..] else { continue };
            let place = Location { file: file.into(), line: line.parse().unwrap_or(0) };
            wiring.take(place, what, arguments);
        }
        wiring
    }

    fn take(&mut self, place: Location, what: &str, words: &[&str]) {
        match (what, words) {
            ("net", [signal, pins @ ..]) => {
                for pin in pins {
                    self.signals.insert((*pin).into(), ((*signal).into(), place.clone()));
                }
            }
            ("unlinkp", [pin, ..]) => drop(self.signals.remove(*pin)),
            ("addf", [function, thread, position @ ..]) => {
                self.add(function, thread, position.first(), place);
            }
            ("own", _) => self.add("pkmkins.monitor", "servo-thread", None, place),
            ("loadrt", _) => {
                self.modules.push((words.iter().map(|word| (*word).into()).collect(), place));
            }
            ("loadusr", _) => {
                self.programs.push((words.iter().map(|word| (*word).into()).collect(), place));
            }
            ("ends", _) => {
                let mut text = words.iter().take(SHOWN).copied().collect::<Vec<_>>().join("; ");
                if words.len() > SHOWN {
                    text += &format!("; and {} more", words.len() - SHOWN);
                }
                self.stopped =
                    Some((Severity::Error, format!("LinuxCNC fails to start: {text}"), place));
            }
            ("refused", [reason, ..]) => {
                let text = format!("LinuxCNC fails to start: {reason}");
                self.stopped = Some((Severity::Error, text, place));
            }
            // What ended LinuxCNC's start is already reported; this is its location.
            ("failed", [reason, ..]) => match &mut self.stopped {
                Some((_, _, at)) => *at = place,
                None => {
                    let text = format!("the drives are not judged from here on: {reason}");
                    self.stopped = Some((Severity::Warning, text, place));
                }
            },
            _ => {}
        }
    }

    /// Adds a function at HAL's position: 1 is the first in a thread, -1 or none the last.
    fn add(&mut self, function: &str, thread: &str, position: Option<&&str>, place: Location) {
        let functions = self.functions.entry(thread.into()).or_default();
        let position = position.and_then(|text| text.parse::<i64>().ok()).unwrap_or(-1);
        let last = functions.len();
        let index = match position {
            1.. => (position as usize - 1).min(last),
            _ => (last + 1).saturating_sub(position.unsigned_abs() as usize).min(last),
        };
        functions.insert(index, (function.into(), place));
    }

    /// Returns the other pins on the signal of a pin; none for an unlinked pin.
    fn beside(&self, pin: &str) -> Vec<&str> {
        let Some((signal, _)) = self.signals.get(pin) else { return vec![] };
        let pins = self.signals.iter().filter(|(_, (other, _))| other == signal);
        pins.map(|(other, _)| other.as_str()).filter(|other| *other != pin).collect()
    }

    fn place_of(&self, pin: &str) -> Option<&Location> {
        self.signals.get(pin).map(|(_, place)| place)
    }

    /// Returns thread and position of a function.
    fn function(&self, name: &str) -> Option<(&str, usize)> {
        self.functions.iter().find_map(|(thread, functions)| {
            let index = functions.iter().position(|(function, _)| function == name)?;
            Some((thread.as_str(), index))
        })
    }
}

/// The checks of the drives.
struct Judge<'a> {
    ini: &'a Ini,
    wiring: &'a Wiring,
    found: Vec<Found>,
}

impl Judge<'_> {
    fn all(mut self) -> Result<Vec<Found>, IniError> {
        self.modules()?;
        self.threads();
        self.order();
        for n in joints(self.ini)? {
            self.command(n);
            self.feedback(n);
            self.enable(n);
            self.homing(n)?;
        }
        self.functions_of_drives(joints(self.ini)?);
        self.machine();
        Ok(self.found)
    }

    fn report(&mut self, severity: Severity, place: Option<&Location>, text: &str) {
        let error = match place {
            Some(place) => at(self.ini, place, text),
            None => at_last_file(self.ini, text),
        };
        self.found.push((severity, error));
    }

    /// Checks that kinematics and motion are loaded, with as many joints as the machine has.
    fn modules(&mut self) -> Result<(), IniError> {
        let named = |key: [&str; 2], default: &str| {
            let value = self.ini.first(key[0], key[1]).map_or(default, |entry| &entry.value);
            value.split_whitespace().next().unwrap_or(default).to_string()
        };
        let count = joints(self.ini)?.len();
        let motion = named(["EMCMOT", "EMCMOT"], "motmod");
        let modules = [named(["KINS", "KINEMATICS"], "pkmkins"), motion.clone()];
        let is_loaded = |name: &String| {
            self.wiring.modules.iter().any(|(words, _)| words.first() == Some(name))
        };
        let missing: Vec<&String> = modules.iter().filter(|name| !is_loaded(name)).collect();
        for name in missing {
            let text = format!("no HAL file loads {name}: add loadrt {name} to the first one");
            self.report(Severity::Error, None, &text);
        }
        let arguments =
            self.wiring.modules.iter().find(|(words, _)| words.first() == Some(&motion));
        let given = arguments.and_then(|(words, _)| {
            words.iter().find_map(|word| word.strip_prefix("num_joints=")?.parse::<usize>().ok())
        });
        if let Some(given) = given.filter(|given| *given != count) {
            let text = format!(
                "{motion} is loaded with num_joints={given}, but [KINS]JOINTS is {count}: use the same number"
            );
            self.report(Severity::Error, None, &text);
        }
        let loaded = arguments.map(|(words, _)| {
            words
                .iter()
                .find_map(|word| word.strip_prefix("num_spindles=")?.parse().ok())
                .unwrap_or(1)
        });
        self.spindles(&motion, loaded);
        Ok(())
    }

    /// Reports threads that no module creates. The names given to `threads` are not evaluated.
    fn threads(&mut self) {
        let makes = |(words, _): &(Vec<String>, Location)| {
            words.first().is_some_and(|name| name == "threads")
        };
        if self.wiring.modules.iter().any(makes) {
            return;
        }
        let is_made = |thread: &str| thread == SERVO || thread == BASE;
        let wiring = self.wiring;
        let functions = wiring.functions.iter().filter(|(thread, _)| !is_made(thread));
        for (thread, functions) in functions {
            for (function, place) in functions {
                let text = format!(
                    "{function} is added to {thread}, which does not exist, so LinuxCNC fails to start; expected {SERVO}"
                );
                self.report(Severity::Error, Some(place), &text);
            }
        }
    }

    /// Compares the number of spindles: LinuxCNC's task uses that of the INI file, motion that of its load parameter.
    fn spindles(&mut self, motion: &str, loaded: Option<usize>) {
        let entry = self.ini.first("TRAJ", "SPINDLES");
        let given =
            entry.and_then(|entry| Some((entry, entry.value.trim().parse::<usize>().ok()?)));
        let (Some((entry, given)), Some(loaded)) = (given, loaded) else { return };
        if given > loaded {
            let text = format!(
                "LinuxCNC fails to start, because {motion} is loaded with num_spindles={loaded}: expected \
                 [EMCMOT]EMCMOT = {motion} num_spindles={given} (if the HAL file loads it by that key), or {loaded}"
            );
            self.found.push((Severity::Error, self.ini.refuse(entry, &text)));
        }
    }

    /// Checks the order: read, motion, the kinematics' monitor, write.
    fn order(&mut self) {
        const HANDLER: &str = "motion-command-handler";
        const CONTROLLER: &str = "motion-controller";
        let wiring = self.wiring;
        for name in [HANDLER, CONTROLLER] {
            if wiring.function(name).is_none() {
                let text = format!(
                    "no HAL file adds {name} to the servo thread, so nothing moves: add addf {name}"
                );
                self.report(Severity::Error, None, &text);
            }
        }
        let Some((thread, controller)) = wiring.function(CONTROLLER) else { return };
        for (index, (name, place)) in wiring.functions[thread].iter().enumerate() {
            let ends = |list: &[&str]| list.iter().any(|end| name.ends_with(end));
            let text = if ends(&READING) && index > controller {
                "is read after motion-controller, so feedback is a cycle older than necessary: \
                 add it before motion-command-handler"
            } else if ends(&WRITING) && index < controller {
                "runs before motion-controller, so every command is a cycle late: add it after motion-controller"
            } else if name == HANDLER && index > controller {
                "runs after motion-controller: add it before motion-controller"
            } else if name == "pkmkins.monitor" && index < controller {
                "runs before motion-controller and monitors the pose of the previous cycle: add it after motion-controller"
            } else {
                continue;
            };
            self.report(Severity::Warning, Some(place), &format!("{name} {text}"));
        }
    }

    fn command(&mut self, n: usize) {
        let wiring = self.wiring;
        let pin = format!("joint.{n}.motor-pos-cmd");
        let targets = wiring.beside(&pin);
        if targets.iter().all(|target| target.starts_with("joint.")) {
            let text = format!("joint {n} commands no drive: add a net from {pin} to its drive");
            return self.report(Severity::Error, wiring.place_of(&pin), &text);
        }
        let loops: Vec<&str> =
            targets.iter().filter_map(|target| target.strip_suffix(".command")).collect();
        for pid in loops {
            self.pid(n, pid);
        }
    }

    /// Checks the loop of a joint, with the pins of `pid`.
    fn pid(&mut self, n: usize, pid: &str) {
        let wiring = self.wiring;
        let place = wiring.place_of(&format!("{pid}.command"));
        if !wiring.beside(&format!("{pid}.feedback")).iter().any(|pin| is_source(pin)) {
            let text = format!(
                "the loop {pid} of joint {n} has no feedback: net its encoder to {pid}.feedback"
            );
            self.report(Severity::Error, place, &text);
        }
        if wiring.beside(&format!("{pid}.output")).is_empty() {
            let text =
                format!("the loop {pid} of joint {n} drives nothing: add a net from {pid}.output");
            self.report(Severity::Error, place, &text);
        }
        if wiring.beside(&format!("{pid}.enable")).is_empty() {
            let text = format!(
                "the loop {pid} of joint {n} is never enabled: net joint.{n}.amp-enable-out to {pid}.enable"
            );
            self.report(Severity::Error, place, &text);
        }
    }

    fn feedback(&mut self, n: usize) {
        let wiring = self.wiring;
        let pin = format!("joint.{n}.motor-pos-fb");
        let sources = wiring.beside(&pin);
        if sources.iter().any(|source| *source == format!("joint.{n}.motor-pos-cmd")) {
            let text = format!(
                "the feedback of joint {n} is its own command, which hides every following error: net the encoder to it"
            );
            self.report(Severity::Warning, wiring.place_of(&pin), &text);
        } else if !sources.iter().any(|source| is_source(source)) {
            let text =
                format!("no feedback on joint {n}: add a net from its drive or encoder to {pin}");
            self.report(Severity::Error, wiring.place_of(&pin), &text);
        }
    }

    fn enable(&mut self, n: usize) {
        let pin = format!("joint.{n}.amp-enable-out");
        if self.wiring.beside(&pin).is_empty() {
            let text = format!(
                "the drive of joint {n} is not enabled by {pin}, so it stays on when the machine is off: net {pin} to it"
            );
            self.report(Severity::Warning, None, &text);
        }
    }

    /// Checks the inputs that its method of homing needs.
    fn homing(&mut self, n: usize) -> Result<(), IniError> {
        let section = format!("JOINT_{n}");
        let searches = self.ini.number_or(&section, "HOME_SEARCH_VEL", 0.0)? != 0.0;
        let index = self.ini.first(&section, "HOME_USE_INDEX").is_some_and(is_yes);
        self.latch(&section, searches, index)?;
        self.absolute(n, &section)?;
        for (key, is_used, pin, what) in [
            ("HOME_SEARCH_VEL", searches, "home-sw-in", "a switch"),
            ("HOME_USE_INDEX", index, "index-enable", "an index pulse"),
        ] {
            let pin = format!("joint.{n}.{pin}");
            if is_used && self.wiring.beside(&pin).is_empty() {
                let text = format!(
                    "homing waits for {what}, but {pin} has no signal in any HAL file: net it (with the \
                     drive files of pkmkins, set [{section}]HOME_SWITCH_PIN)"
                );
                let error = crate::wiring::at_key(self.ini, &section, key, &text);
                self.found.push((Severity::Error, error));
            }
        }
        Ok(())
    }

    /// Reports homing speeds with which LinuxCNC refuses to home.
    fn latch(&mut self, section: &str, searches: bool, index: bool) -> Result<(), IniError> {
        let latch = self.ini.number_or(section, "HOME_LATCH_VEL", 0.0)?;
        let text = if searches && latch == 0.0 {
            "LinuxCNC does not home a joint that searches without it: set the speed at which the joint leaves the switch"
        } else if !searches && latch != 0.0 && !index {
            "LinuxCNC does not home a joint with this key alone: add HOME_SEARCH_VEL, or HOME_USE_INDEX = YES"
        } else {
            return Ok(());
        };
        let error = crate::wiring::at_key(self.ini, section, "HOME_LATCH_VEL", text);
        self.found.push((Severity::Error, error));
        Ok(())
    }

    /// Reports an absolute encoder that is the count of a step generator: it is 0 at LinuxCNC's start, independent of
    /// the joint's position.
    fn absolute(&mut self, n: usize, section: &str) -> Result<(), IniError> {
        const KEY: &str = "HOME_ABSOLUTE_ENCODER";
        if self.ini.number_or(section, KEY, 0.0)? == 0.0 {
            return Ok(());
        }
        let sources = self.wiring.beside(&format!("joint.{n}.motor-pos-fb"));
        let counts =
            sources.iter().find(|pin| pin.contains("stepgen.") && pin.ends_with("position-fb"));
        if let Some(pin) = counts {
            let text = format!(
                "the feedback of joint {n} is {pin}, which counts steps from 0 at the start, wherever the joint is: \
                 expected homing by a switch (HOME_SEARCH_VEL, HOME_LATCH_VEL, HOME_OFFSET), or the pin of an absolute encoder"
            );
            let error = crate::wiring::at_key(self.ini, section, KEY, &text);
            self.found.push((Severity::Error, error));
        }
        Ok(())
    }

    /// Checks the functions of the components that receive commands and supply feedback.
    fn functions_of_drives(&mut self, joints: std::ops::Range<usize>) {
        let wiring = self.wiring;
        let mut needed: BTreeMap<String, &str> = BTreeMap::new();
        let ends =
            joints.flat_map(|n| ["cmd", "fb"].map(|end| format!("joint.{n}.motor-pos-{end}")));
        for end in ends {
            for pin in wiring.beside(&end) {
                let more = pin.strip_suffix(".command").map(|pid| format!("{pid}.output"));
                let behind = more.iter().flat_map(|output| wiring.beside(output));
                for pin in std::iter::once(pin).chain(behind) {
                    needed.extend(functions_of(pin).into_iter().map(|function| (function, pin)));
                }
            }
        }
        let has = |name: &String| wiring.function(name).is_some();
        let missing: Vec<(String, &str)> =
            needed.into_iter().filter(|(name, _)| !has(name)).collect();
        for (function, pin) in missing {
            let text = format!(
                "{pin} is connected, but no HAL file adds {function} to a thread, so it never moves: add addf {function}"
            );
            self.report(Severity::Error, wiring.place_of(pin), &text);
        }
    }

    /// Checks what belongs to no joint.
    fn machine(&mut self) {
        let wiring = self.wiring;
        if wiring.beside("iocontrol.0.emc-enable-in").is_empty() {
            let text = "iocontrol.0.emc-enable-in has no signal, so LinuxCNC never leaves the emergency stop: net it";
            self.report(Severity::Error, None, text);
        }
        let asks = !wiring.modules.is_empty() && self.ini.first("EMCIO", "TOOL_TABLE").is_some();
        if asks && wiring.beside("iocontrol.0.tool-changed").is_empty() {
            let text = "iocontrol.0.tool-changed has no signal, so every M6 waits forever: net it";
            self.report(Severity::Warning, None, text);
        }
        let speed: BTreeSet<&String> =
            wiring.signals.keys().filter(|pin| pin.starts_with("spindle.0.speed-out")).collect();
        if let Some(pin) = speed.first()
            && wiring.beside("spindle.0.at-speed").is_empty()
        {
            let text = "spindle.0.at-speed has no signal, so programs cut before the spindle is at speed: net it";
            self.report(Severity::Warning, wiring.place_of(pin), text);
        }
    }
}

/// Returns whether a pin can be the source of a value.
fn is_source(pin: &str) -> bool {
    let is_input = |pin: &str| TAKING.iter().any(|end| pin.ends_with(end)) || pin.ends_with(".in");
    !pin.starts_with("joint.") && !is_input(pin)
}

fn is_yes(entry: &Entry) -> bool {
    ["1", "YES", "TRUE", "ON"].contains(&entry.value.to_uppercase().as_str())
}

/// Returns the functions that a drive's pin depends on; none if its component is unknown.
fn functions_of(pin: &str) -> Vec<String> {
    let words: Vec<&str> = pin.split('.').collect();
    let named = |names: &[&str]| names.iter().map(|name| (*name).to_string()).collect();
    match &words[..] {
        [card, number, ..] if card.starts_with("hm2_") => {
            ["read", "write"].map(|end| format!("{card}.{number}.{end}")).into()
        }
        ["stepgen", ..] => {
            named(&["stepgen.capture-position", "stepgen.update-freq", "stepgen.make-pulses"])
        }
        ["encoder", ..] => named(&["encoder.capture-position", "encoder.update-counters"]),
        ["pwmgen", ..] => named(&["pwmgen.update", "pwmgen.make-pulses"]),
        ["cia402", number, ..] => {
            let own = ["read-all", "write-all"].map(|end| format!("cia402.{number}.{end}"));
            [own.to_vec(), named(&["lcec.read-all", "lcec.write-all"])].concat()
        }
        [.., "command"] => vec![format!("{}.do-pid-calcs", pin.trim_end_matches(".command"))],
        _ => vec![],
    }
}

/// Returns an error at the last HAL file, for something that is in none of them.
fn at_last_file(ini: &Ini, text: &str) -> IniError {
    match ini.all("HAL", "HALFILE").last() {
        Some(entry) => ini.refuse(entry, text),
        None => ini.error("HAL", "HALFILE", None, text),
    }
}

/// Returns an error at a line of a HAL file, or in the INI file if the line is unknown.
fn at(ini: &Ini, place: &Location, text: &str) -> IniError {
    match place.line {
        0 => at_last_file(ini, text),
        _ => at_line(place, text),
    }
}

/// Returns an error at a line of a HAL file.
pub fn of_line(file: &Path, line: usize, text: &str) -> IniError {
    at_line(&Location { file: file.into(), line }, text)
}

fn at_line(place: &Location, text: &str) -> IniError {
    let source = files::read(&place.file).unwrap_or_default();
    let source = String::from_utf8_lossy(&source);
    let line = source.lines().nth(place.line - 1).unwrap_or_default().trim_end();
    let start = line.len() - line.trim_start().len();
    IniError(Box::new(Problem {
        file: place.file.clone(),
        line: Some(place.line),
        section: "HAL".into(),
        key: "HALFILE".into(),
        found: Some(place.file.file_name().unwrap_or_default().to_string_lossy().into()),
        expected: text.into(),
        excerpt: Some(Excerpt { text: line.into(), part: start..line.len() }),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A joint on a step generator, wired correctly.
    const STEPS: &str = "loadrt pkmkins\n\
        loadrt motmod num_joints=1 servo_period_nsec=[EMCMOT]SERVO_PERIOD\n\
        loadrt stepgen step_type=0\n\
        addf stepgen.make-pulses base-thread\n\
        addf stepgen.capture-position servo-thread\n\
        addf motion-command-handler servo-thread\n\
        addf motion-controller servo-thread\n\
        addf stepgen.update-freq servo-thread\n\
        net cmd joint.0.motor-pos-cmd => stepgen.0.position-cmd\n\
        net fb stepgen.0.position-fb => joint.0.motor-pos-fb\n\
        net on joint.0.amp-enable-out => stepgen.0.enable\n\
        net estop iocontrol.0.user-enable-out => iocontrol.0.emc-enable-in\n";

    /// A joint on a PID loop, wired correctly by a loop of Tcl.
    const SERVO: &str = "loadrt pkmkins\n\
        loadrt motmod num_joints=$::KINS(JOINTS)\n\
        loadrt pid names=p0\n\
        foreach f {hm2_5i25.0.read motion-command-handler motion-controller p0.do-pid-calcs hm2_5i25.0.write} {\n\
            addf $f servo-thread\n\
        }\n\
        for {set n 0} {$n < 1} {incr n} {\n\
            net cmd$n joint.$n.motor-pos-cmd p$n.command\n\
            net fb$n hm2_5i25.0.encoder.00.position p$n.feedback joint.$n.motor-pos-fb\n\
            net out$n p$n.output hm2_5i25.0.pwmgen.00.value\n\
            net on$n joint.$n.amp-enable-out p$n.enable\n\
        }\n\
        net estop iocontrol.0.user-enable-out iocontrol.0.emc-enable-in\n";

    fn reported(name: &str, hal: &str, more: &str) -> Vec<(Severity, String, Option<usize>)> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(name), hal).unwrap();
        let text = format!(
            "[KINS]\nJOINTS = 1\n[EMCMOT]\nSERVO_PERIOD = 1000000\n[HAL]\nHALFILE = {name}\nHALFILE = LIB:pkmkins.tcl\n{more}"
        );
        let ini = Ini::parse(&folder.path().join("m.ini"), &text).unwrap();
        let found = check(&ini).unwrap().into_iter();
        found.map(|(severity, error)| (severity, error.0.message(), error.0.line)).collect()
    }

    fn assert_one(
        found: &[(Severity, String, Option<usize>)],
        severity: Severity,
        text: &str,
        line: usize,
    ) {
        assert!(found.len() == 1, "{found:?}");
        assert!(found[0].0 == severity && found[0].1.contains(text), "{found:?}");
        assert_eq!(found[0].2, Some(line), "{found:?}");
    }

    #[test]
    fn completely_wired_drives_have_no_findings() {
        assert_eq!(reported("own.hal", STEPS, ""), []);
        assert_eq!(reported("own.tcl", SERVO, ""), []);
    }

    #[test]
    fn missing_feedback_command_and_enable_are_reported_with_their_line() {
        let without = |text: &str, what: &str| text.replace(what, "");
        let found = reported("own.hal", &without(STEPS, " stepgen.0.position-fb"), "");
        assert_one(&found, Severity::Error, "no feedback on joint 0", 10);
        let found = reported("own.hal", &without(STEPS, " => stepgen.0.position-cmd"), "");
        assert_one(&found, Severity::Error, "joint 0 commands no drive", 9);
        let found = reported("own.hal", &without(STEPS, " => stepgen.0.enable"), "");
        assert_one(&found, Severity::Warning, "joint 0 is not enabled", 7);
        let found = reported("own.tcl", &without(SERVO, "hm2_5i25.0.encoder.00.position "), "");
        assert!(found.len() == 2, "{found:?}");
        assert!(
            found[0].1.contains("p0 of joint 0 has no feedback") && found[0].2 == Some(8),
            "{found:?}"
        );
        assert!(
            found[1].1.contains("no feedback on joint 0") && found[1].2 == Some(9),
            "{found:?}"
        );
        let found = reported(
            "own.tcl",
            &without(SERVO, "net out$n p$n.output hm2_5i25.0.pwmgen.00.value"),
            "",
        );
        assert_one(&found, Severity::Error, "drives nothing", 8);
    }

    #[test]
    fn functions_in_the_wrong_place_are_reported() {
        let late = STEPS.replace("addf stepgen.capture-position servo-thread\n", "\n")
            + "addf stepgen.capture-position servo-thread\n";
        assert_one(&reported("own.hal", &late, ""), Severity::Warning, "a cycle older", 13);
        let first = STEPS.replace(
            "addf stepgen.update-freq servo-thread",
            "addf stepgen.update-freq servo-thread 1",
        );
        assert_one(&reported("own.hal", &first, ""), Severity::Warning, "a cycle late", 8);
        let none = STEPS.replace("addf stepgen.update-freq servo-thread", "");
        assert_one(
            &reported("own.hal", &none, ""),
            Severity::Error,
            "no HAL file adds stepgen.update-freq",
            10,
        );
    }

    #[test]
    fn homing_without_its_switch_or_its_index_is_reported() {
        let more = "[JOINT_0]\nHOME_SEARCH_VEL = 5\nHOME_LATCH_VEL = 1\nHOME_USE_INDEX = YES\n";
        let found = reported("own.hal", STEPS, more);
        assert!(
            found.len() == 2 && found.iter().all(|(severity, ..)| *severity == Severity::Error),
            "{found:?}"
        );
        assert!(
            found[0].1.contains("home-sw-in") && found[1].1.contains("index-enable"),
            "{found:?}"
        );
    }

    #[test]
    fn a_following_error_below_the_delay_is_reported() {
        let joint = |keys: &str| {
            reported("own.hal", STEPS, &format!("[JOINT_0]\nMAX_VELOCITY = 500\n{keys}"))
        };
        assert_eq!(joint("FERROR = 0.5\n"), []);
        assert_one(&joint("FERROR = 0.4\n"), Severity::Warning, "lags by 0.5", 10);
        assert_one(&joint("FERROR = 1\nDELAY = 3\n"), Severity::Error, "lags by 1.5", 10);
        assert_eq!(joint("FERROR = 1.5\nDELAY = 3\n"), []);
    }

    #[test]
    fn a_file_that_cannot_be_carried_out_is_not_judged_and_touches_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("touched");
        let hal = format!("loadrt pkmkins\nset f [open {} w]\n", file.display());
        assert_one(&reported("own.tcl", &hal, ""), Severity::Warning, "not judged", 2);
        let hal = format!("exec touch {}\n", file.display());
        assert_one(&reported("own.tcl", &hal, ""), Severity::Warning, "not judged", 1);
        assert!(!file.exists());
        assert_one(&reported("own.tcl", "while 1 {}\n", ""), Severity::Warning, "time limit", 1);
        let ends = reported("own.tcl", "puts stderr {no card}\nexit 1\n", "");
        assert_one(&ends, Severity::Error, "fails to start: no card", 2);
    }
}
