// SPDX-License-Identifier: GPL-2.0-or-later
//! Test start of a machine: LinuxCNC runs in virtual time with the machine's own HAL files: on, homing, a small move
//! along each coordinate and back, a tool change.
//!
//! Only a refusal by LinuxCNC itself is an error. Hardware, and programs that are not LinuxCNC's, do not run in virtual
//! time: if the HAL files need them, the machine is started without them, and a failure is not judged.

use check::drives::{self, Plan};
use check::wiring::at_key;
use check::world;
use kinematics::POSE_LETTERS;
use linuxcnc::process::{self, Options, OwnFiles};
use linuxcnc::refusal::NotJudged;
use linuxcnc::row::{Ending, Message};
use machine::files::{AtFile, Folder, write_whole};
use machine::read::ini::{Entry, Ini, IniError};
use machine::read::joints::Axis;
use machine::read::machine::MachineConfig;
use machine::read::places::HALLIB;
use machine::read::tools;
use std::ffi::OsString;
use std::io;
use std::ops::ControlFlow;
use std::path::Path;

/// Processor time that a start may take, seconds.
const MOST_WORK: f64 = 3.0;

/// Machine time without motion after which the start is aborted, seconds: no tool changer takes as long.
const MOST_STANDSTILL: f64 = 60.0;

/// Size of a small move as a share of a coordinate's range, or of the machine's size if it is unlimited; and the
/// largest angle, degrees.
const SHARE: f64 = 0.02;
const MOST_ANGLE: f64 = 1.0;

/// Duration of a move at its feed, seconds.
const DURATION: f64 = 0.25;

/// Number of halvings of a move that does not fit.
const HALVES: usize = 6;

/// Result of a start.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// Description of the result.
    pub fact: String,
    /// Why the machine does not start, if LinuxCNC refuses it.
    pub error: Option<IniError>,
}

impl Start {
    pub(super) fn not_tried(reason: impl std::fmt::Display) -> Self {
        Self { fact: format!("not tested: {reason}"), error: None }
    }
}

/// Action of a line of the program.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Tried {
    Coordinate(char),
    Tool(i64),
}

/// Starts the machine.
///
/// # Errors
/// A file cannot be written.
pub fn start(config: &MachineConfig) -> Result<Start, AtFile<io::Error>> {
    if !Path::new(HALLIB).is_dir() {
        return Ok(Start::not_tried("LinuxCNC is not installed here"));
    }
    let plan = Plan::new(&config.ini);
    if let Some(reason) = plan.reason {
        return Ok(Start::not_tried(reason));
    }
    let program = Program::new(config, plan.changes_tools);
    let folder = Folder::new()?;
    let file = folder.path().join("start.ngc");
    write_whole(&file, &program.text)?;
    let entries = drives::started(&config.ini);
    let options = Options {
        most_standstill: MOST_STANDSTILL,
        most_work: MOST_WORK,
        most_in_all: MOST_WORK,
        own: Some(own_files(config, &plan, &entries)),
        ..Options::default()
    };
    let outcome = process::run(config, &file, &options, |_| ControlFlow::Continue(()));
    let refusal = match outcome {
        Ok(outcome) if outcome.ending == Ending::Finished => None,
        Ok(outcome) => Some(program.refusal(config, &outcome.messages)),
        Err(error) => match refused(config, &entries, &error) {
            Some(refusal) => Some(refusal),
            None => return Ok(Start::not_tried(error)),
        },
    };
    let without = plan.left_out.map_or(String::new(), |what| format!(" without {what}"));
    Ok(match refusal {
        None => {
            Start { fact: format!("{}, in virtual time{without}", program.done()), error: None }
        }
        Some(error) if without.is_empty() => Start {
            fact: "LinuxCNC refuses the machine in virtual time".into(),
            error: Some(error),
        },
        Some(error) => Start::not_tried(format!(
            "{without}, which has no virtual time, LinuxCNC refuses the machine: {}",
            error.0.expected
        )),
    })
}

fn own_files(
    config: &MachineConfig,
    plan: &Plan,
    entries: &[(Option<&Entry>, String)],
) -> OwnFiles {
    let folder = config.file.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.into());
    let arguments = [folder.into_os_string(), plan.strangers.join(" ").into()];
    let entries = entries.iter().map(|(_, text)| OsString::from(text));
    OwnFiles {
        script: drives::START.into(),
        arguments: arguments.into_iter().chain(entries).collect(),
    }
}

/// Returns why LinuxCNC refuses the machine, at the responsible line; `None` if the machine is not the reason.
fn refused(
    config: &MachineConfig,
    entries: &[(Option<&Entry>, String)],
    error: &NotJudged,
) -> Option<IniError> {
    let ini = &config.ini;
    let is_of_virtual_time = |text: &str| {
        ["no substitute in virtual time", "undefined symbol", "time limit"]
            .iter()
            .any(|words| text.contains(words))
    };
    match error {
        NotJudged::Step { text, .. } | NotJudged::Refused(text) if is_of_virtual_time(text) => None,
        NotJudged::Step { is_mistake: false, .. } => None,
        NotJudged::Step { file, line, entry, text, .. } => {
            let answer = format!("LinuxCNC fails to start: {text}");
            let is_own = *line > 0 && !file.starts_with(HALLIB);
            if is_own && file.parent().is_some() && !is_of_library(file) {
                return Some(drives::of_line(file, *line, &answer));
            }
            let entry = entries.get(*entry).and_then(|(entry, _)| *entry);
            Some(named(ini, text, &answer).unwrap_or_else(|| match entry {
                Some(entry) => ini.refuse(entry, &answer),
                None => whole(ini, &answer),
            }))
        }
        NotJudged::StartupCode(error) => Some(error.clone()),
        NotJudged::Refused(text) => Some(at(ini, text.trim_end_matches([':', ' ']))),
        NotJudged::Crashed(text) => Some(at(ini, &format!("LinuxCNC exits while starting{text}"))),
        NotJudged::Stands(..) => {
            let text = "LinuxCNC starts a move that never ends, without a message";
            let key = ini.first("DISPLAY", "MAX_FEED_OVERRIDE");
            let key = key.filter(|entry| entry.value.parse().is_ok_and(|most: f64| most <= 0.0));
            Some(key.map_or_else(|| whole(ini, text), |entry| ini.refuse(entry, text)))
        }
        _ => None,
    }
}

/// Returns whether a file is one of those that come with pkmkins, wherever the library for virtual time is installed.
fn is_of_library(file: &Path) -> bool {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    name.starts_with("pkmkins") && name.ends_with(".tcl")
}

/// Returns a refusal at the key that it names or concerns.
fn at(ini: &Ini, text: &str) -> IniError {
    named(ini, text, text).unwrap_or_else(|| whole(ini, text))
}

/// Returns a refusal without a line.
fn whole(ini: &Ini, text: &str) -> IniError {
    ini.error("", "", Some("the start in LinuxCNC"), text)
}

/// Subjects of LinuxCNC's messages, and the key that is usually responsible.
const ABOUT: [(&str, &str, &str); 9] = [
    ("REMAP INI Line", "RS274NGC", "REMAP"),
    ("initialize IO", "EMCIO", "TOOL_CHANGE_POSITION"),
    ("num_joints", "KINS", "JOINTS"),
    ("arameter file", "RS274NGC", "PARAMETER_FILE"),
    ("tool table", "EMCIO", "TOOL_TABLE"),
    ("motmod", "EMCMOT", "EMCMOT"),
    ("tpmod", "TRAJ", "TPMOD"),
    ("homemod", "EMCMOT", "HOMEMOD"),
    ("pkmkins.so", "KINS", "KINEMATICS"),
];

/// Returns the refusal `answer` at the key that a message names, if any.
fn named(ini: &Ini, text: &str, answer: &str) -> Option<IniError> {
    let between = |start: &str, end: &str| {
        let (_, rest) = text.split_once(start)?;
        Some(rest.split_once(end)?.0.to_string())
    };
    let is_name = |name: &String| {
        !name.is_empty()
            && name.bytes().all(|b| b.is_ascii_uppercase() || b.is_ascii_digit() || b == b'_')
    };
    // As LinuxCNC's INI reader prints it, and as pkmkins.tcl does.
    let of_reader = between("section=", ",").zip(between("tag=", ","));
    let of_file = between("[", "]").filter(is_name).and_then(|section| {
        let (_, rest) = text.split_once(&format!("[{section}]"))?;
        let key: String =
            rest.chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '_').collect();
        Some((section, key)).filter(|(_, key)| is_name(key))
    });
    if let Some((section, key)) = of_reader.or(of_file) {
        return Some(at_key(ini, &section, &key, answer));
    }
    if let Some((section, key)) = of_joint(text) {
        return Some(at_key(ini, &section, key, answer));
    }
    let table = ini.entries().find(|entry| {
        let is_named = text.contains("compensation file") && text.contains(&entry.value);
        entry.key == "COMP_FILE" && is_named
    });
    if let Some(entry) = table {
        return Some(ini.refuse(entry, answer));
    }
    let about = ABOUT
        .iter()
        .find(|(words, section, key)| text.contains(words) && ini.first(section, key).is_some());
    about.map(|(_, section, key)| at_key(ini, section, key, answer))
}

/// Returns the key of the joint or axis of a message.
fn of_joint(text: &str) -> Option<(String, &'static str)> {
    let key = ["positive limit", "negative limit", "following error", "home"]
        .into_iter()
        .zip(["MAX_LIMIT", "MIN_LIMIT", "FERROR", "HOME_SEARCH_VEL"])
        .find(|(words, _)| text.contains(words))
        .map(|(_, key)| key)?;
    let joint = text.split_once("joint ").and_then(|(_, rest)| {
        let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
        (!digits.is_empty()).then(|| format!("JOINT_{digits}"))
    });
    let axis = text.split_once("'s ").and_then(|(before, _)| {
        let letter = before.chars().last().filter(|c| POSE_LETTERS.contains(c))?;
        Some(format!("AXIS_{letter}"))
    });
    joint.or(axis).map(|section| (section, key))
}

/// The test program.
struct Program {
    text: String,
    /// Actions of its lines, starting with line 1.
    lines: Vec<Option<Tried>>,
}

impl Program {
    fn new(config: &MachineConfig, changes_tools: bool) -> Self {
        let mut program = Self { text: String::new(), lines: vec![] };
        let unit = if config.units_per_mm == 1.0 { "G21" } else { "G20" };
        program.line(None, &format!("{unit} G17 G40 G49 G80 G90 G94"));
        for (letter, place, axis) in world::coordinates(config) {
            let Some(distance) = small_move(config, place, &axis) else { continue };
            let (home, feed) = (world::home(config)[place], 60.0 * distance.abs() / DURATION);
            let tried = Some(Tried::Coordinate(letter));
            program.line(tried, &format!("G53 G0 {letter}{:.9}", home + distance));
            program.line(tried, &format!("G53 G1 {letter}{home:.9} F{feed:.6}"));
        }
        // Errors of a tool table are reported by its reader.
        let tools = tools::read(config.first()).unwrap_or_default();
        if let Some(tool) = tools.iter().find(|tool| changes_tools && tool.number > 0) {
            program.line(Some(Tried::Tool(tool.number)), &format!("T{} M6", tool.number));
        }
        program.line(None, "M2");
        program
    }

    fn line(&mut self, tried: Option<Tried>, text: &str) {
        self.text += &format!("{text}\n");
        self.lines.push(tried);
    }

    /// Describes what was tested.
    fn done(&self) -> String {
        let mut letters: Vec<char> = vec![];
        let mut tools = String::new();
        for tried in self.lines.iter().flatten() {
            match tried {
                Tried::Coordinate(letter) if !letters.contains(letter) => letters.push(*letter),
                Tried::Coordinate(_) => {}
                Tried::Tool(number) => tools = format!(", T{number} changed"),
            }
        }
        let letters: Vec<String> = letters.iter().map(char::to_string).collect();
        let moved = match letters.is_empty() {
            true => "nothing moved, because home leaves no travel within the limits".into(),
            false => format!("{} moved", letters.join(" ")),
        };
        format!("switched on, homed, {moved}{tools}")
    }

    /// Returns why LinuxCNC stopped the program.
    fn refusal(&self, config: &MachineConfig, messages: &[Message]) -> IniError {
        let ini = &config.ini;
        let errors: Vec<&Message> = messages.iter().filter(|message| message.is_error()).collect();
        let texts: Vec<&str> = errors.iter().map(|message| message.text.as_str()).collect();
        let all = texts.join("; ");
        // A move that is not in the program has a line below 0.
        let line = errors.first().map_or(0, |message| message.place().max(message.read)) as usize;
        let tried = match all.contains("line -1") {
            true => {
                self.lines.iter().flatten().find(|tried| matches!(tried, Tried::Tool(_))).copied()
            }
            false => line.checked_sub(1).and_then(|k| self.lines.get(k).copied().flatten()),
        };
        let what = match tried {
            Some(Tried::Coordinate(letter)) => format!("LinuxCNC does not move {letter}"),
            Some(Tried::Tool(number)) => format!("LinuxCNC does not change to T{number}"),
            None => "LinuxCNC stops the first program".into(),
        };
        let text = if all.is_empty() { what } else { format!("{what}: {all}") };
        let key = match tried {
            Some(Tried::Tool(_)) => {
                let keys = [
                    "TOOL_CHANGE_POSITION",
                    "TOOL_CHANGE_QUILL_UP",
                    "TOOL_CHANGE_AT_G30",
                    "TOOL_TABLE",
                ];
                keys.into_iter()
                    .find(|key| ini.first("EMCIO", key).is_some())
                    .map(|key| ("EMCIO".into(), key))
            }
            Some(Tried::Coordinate(letter)) => {
                of_joint(&all).or(Some((format!("AXIS_{letter}"), "MAX_VELOCITY")))
            }
            None => of_joint(&all),
        };
        match key {
            Some((section, key)) => at_key(ini, &section, key, &text),
            None => at(ini, &text),
        }
    }
}

/// Returns a small displacement of a coordinate from home within all limits, in a direction with room.
fn small_move(config: &MachineConfig, place: usize, axis: &Axis) -> Option<f64> {
    let turns = "ABC".contains(POSE_LETTERS[place]);
    let most = if turns { MOST_ANGLE } else { SHARE * config.first().machine.size() };
    let mut distance = most.min(SHARE * (axis.max - axis.min));
    for _ in 0..HALVES {
        for signed in [distance, -distance] {
            let mut world = world::home(config);
            world[place] += signed;
            if world::violated(config, &world).is_none() {
                return Some(signed);
            }
        }
        distance /= 2.0;
    }
    None
}
