// SPDX-License-Identifier: GPL-2.0-or-later
//! Conversion of an older configuration of a parallel machine to one for pkmkins: from before LinuxCNC had joints and
//! axes, or for one of LinuxCNC's own modules.
//!
//! `modules` has these modules and the legs they describe, `old` reads the INI file, `check` runs the HAL files,
//! which set the geometry. [`crate::make`] makes the folder, as for any machine.

pub mod modules;
mod old;

use crate::anchors::Leg;
use crate::carried::{Carried, CarriedAxis, CarriedJoint};
use crate::home;
use crate::ini::{Plan, line};
use crate::kinds::{KINDS, MachineKind};
use crate::make::{Made, Order, completed, refuse_name, refuse_place};
use crate::parameters::{ANCHORS, UNIT};
use crate::questions::Given;
use crate::values::{MOST, Refusal, Values};
use check::drives::Location;
use check::hal_values::{Gap, HalValues, Value};
use keys::machine as of_machine;
use kinematics::{Joints, MAX_JOINTS, Pose};
use machine::digits::plain;
use machine::files::{read, read_text};
use machine::read::ini::decimal;
use machine::read::machine::MachineConfig;
use machine::read::near;
use modules::{PEERS, PeerModule, Pins};
use old::{AT_HOME, NamedHome, OldIni};
use std::path::{Path, PathBuf};

/// Pin of motion with the tool length.
const TOOL_LENGTH: &str = "motion.tooloffset.z";

/// User interfaces of LinuxCNC.
const DISPLAYS: [&str; 7] =
    ["axis", "gmoccapy", "gscreen", "qtvcp", "qtdragon", "tklinuxcnc", "touchy"];

/// Keys of the user interface that are kept.
const OF_DISPLAY: [&str; 5] =
    ["POSITION_OFFSET", "POSITION_FEEDBACK", "MAX_FEED_OVERRIDE", "INCREMENTS", "EDITOR"];

/// Largest angle, in degrees, of a pose that counts as level: joint values in files are rounded. [`fits`] then
/// compares the joints.
const LEVEL: f64 = 0.01;

/// Input of a migration.
#[derive(Debug)]
pub struct Migration<'a> {
    /// The older INI file.
    pub file: &'a Path,
    /// Folder to create; `None`: beside the folder of the file.
    pub folder: Option<&'a Path>,
    /// Tool position at home, which replaces the file's.
    pub home: Option<[f64; 3]>,
    /// HAL file that sets the geometry, which replaces those of the file.
    pub geometry: Option<&'a Path>,
}

/// A migrated machine.
#[derive(Debug)]
pub struct Migrated {
    pub made: Made,
    pub folder: PathBuf,
    /// Name of the machine and its files.
    pub name: String,
    /// LinuxCNC's module of the older configuration.
    pub module: &'static str,
    pub notes: Notes,
}

/// Sentences on the parts of the older configuration.
#[derive(Clone, Debug, Default)]
pub struct Notes {
    pub carried: Vec<String>,
    /// Values that the files do not determine, and the value used instead.
    pub undetermined: Vec<String>,
    pub left_out: Vec<String>,
}

/// Creates the folder; `say` gets the progress, as in [`crate::make::make`].
///
/// # Errors
/// The file is wrong, its geometry or home is not determined, or no such machine can work. Then nothing is created.
pub fn migrate(
    migration: &Migration,
    say: impl Fn(&str, Option<f64>) + Sync,
) -> Result<Migrated, Refusal> {
    let old = OldIni::read(migration.file)?;
    let name = name_of(migration.file);
    refuse_name(&name)?;
    let folder = match migration.folder {
        Some(folder) => folder.to_path_buf(),
        None => beside(migration.file, &name)?,
    };
    refuse_place(&folder)?;
    say("carrying the HAL files out", None);
    let hal = HalValues::read(&old.ini, None)
        .map_err(|reason| input(&old, &format!("the HAL files cannot be carried out: {reason}")))?;
    let peer = module(&old, &hal)?;
    let mut notes = Notes::default();
    let pins = geometry(&old, peer, &hal, migration.geometry, &mut notes)?;
    let kind = KINDS.iter().find(|kind| kind.name == peer.kind);
    let kind = kind.ok_or_else(|| Refusal::Input(format!("no kind {}", peer.kind)))?;
    let mut carried = carried(&old, peer, kind, &pins, &hal, &mut notes)?;
    let legs = (peer.build)(&pins);
    let given = given(&old, peer, &carried.joints[..peer.legs])?;
    let values = Values::new(kind.name, &kind.parameters(), &given)?;
    say("looking for home", None);
    let plan = planned(&name, (kind, peer), &legs, &values, &carried);
    let home = stand(&plan, peer, &old, migration.home, &mut notes)?.map(|x| x + 0.0);
    notes.undetermined.extend(old.chosen());
    notes.left_out = left_out(&old);
    about(&mut carried, &name, &old, peer, kind, &notes);
    let with = |limits: bool| {
        let mut given = given.clone();
        given.insert("home", home.map(|x| x.to_string()).to_vec());
        if limits {
            given.insert("limits", words_of_limits(&carried.axes, peer));
        }
        Values::new(kind.name, &kind.parameters(), &given)
    };
    let make = |values: &Values| {
        let plan = planned(&name, (kind, peer), &legs, values, &carried);
        let (home, config) = home::found(&plan)?;
        let fixed = with_homes(&carried, &joints_at(&config)?[..peer.legs]);
        let plan = Plan { home, carried: Some(fixed), ..plan };
        let order = Order { kind, values, name: &name, folder: &folder };
        completed(&order, plan, &say)
    };
    // Keep all limits if every pose between them is reachable; otherwise take the largest proved box within them.
    let made = match words_of_limits(&carried.axes, peer).is_empty() {
        true => None,
        false => with(true).and_then(|values| make(&values)).ok(),
    };
    let made = match made {
        Some(made) => made,
        None => make(&with(false)?)?,
    };
    limits_that_changed(&made, &carried, &mut notes);
    if made.motion != carried.motion {
        let words = |[[speed, acceleration], [turn, turn_acceleration]]: [[f64; 2]; 2]| {
            let angles = match peer.letters.contains('A') {
                true => format!(", of angles {turn} and {turn_acceleration} degrees"),
                false => String::new(),
            };
            format!("{speed} a second and {acceleration} a second squared{angles}")
        };
        notes.undetermined.push(format!(
            "speed and acceleration of the tool: {} in place of {}: the drives, at their own largest ones, cannot follow more everywhere",
            words(made.motion),
            words(carried.motion)
        ));
    }
    Ok(Migrated { made, folder, name, module: peer.name, notes })
}

/// Builds the plan of a machine whose home is not known yet.
fn planned<'a>(
    name: &'a str,
    (kind, peer): (&'static MachineKind, &PeerModule),
    legs: &[Leg],
    values: &'a Values,
    carried: &Carried,
) -> Plan<'a> {
    Plan {
        name,
        kind,
        values,
        legs: legs.to_vec(),
        coordinates: peer.letters.into(),
        home: [0.0; 3],
        cardans: vec![],
        joints: vec![],
        limits: None,
        speeds: vec![],
        boxes: (String::new(), 0),
        carried: Some(carried.clone()),
    }
}

fn input(old: &OldIni, text: &str) -> Refusal {
    Refusal::Input(format!("{}: {text}", old.ini.file().display()))
}

/// Returns the machine's name: the file's name, with `-` for characters that HAL files do not allow in names.
fn name_of(file: &Path) -> String {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' };
    stem.chars().map(plain).collect::<String>().trim_start_matches('-').into()
}

/// Returns a path beside the folder of the file.
fn beside(file: &Path, name: &str) -> Result<PathBuf, Refusal> {
    let whole = std::fs::canonicalize(file)
        .map_err(|error| Refusal::Input(format!("{}: {error}", file.display())))?;
    let folder = whole.parent().unwrap_or(Path::new("/"));
    Ok(folder.parent().unwrap_or(folder).join(format!("{name}-pkmkins")))
}

/// Finds the module of the configuration.
fn module(old: &OldIni, hal: &HalValues) -> Result<&'static PeerModule, Refusal> {
    let known: Vec<&str> = PEERS.iter().map(|peer| peer.name).collect();
    let known = known.join(", ");
    let of = |name: &str| PEERS.iter().find(|peer| peer.name == name);
    if let Some(entry) = old.entry("KINS", "KINEMATICS")? {
        let name = entry.value.split_ascii_whitespace().next().unwrap_or_default();
        let text = match name {
            "pkmkins" => "the configuration is for pkmkins already: pkm check judges it".into(),
            _ => format!("expected one of LinuxCNC's modules of parallel machines, {known}"),
        };
        return of(name).ok_or_else(|| old.ini.refuse(entry, &text).into());
    }
    let loaded = |words: &Vec<String>| words.first().and_then(|name| of(name));
    hal.modules.iter().find_map(loaded).ok_or_else(|| {
        let other = hal.modules.iter().filter_map(|words| words.first());
        let other = other.filter(|name| name.ends_with("kins")).map(|name| format!("{name} is loaded, "));
        let gap = hal.gaps.iter().find(|gap| gap.command.is_none());
        let gap = gap.map(|gap| format!("; {} is not carried out: {}", gap.place, gap.reason));
        let text = format!(
            "no HAL file loads a module of a parallel machine: {}expected loadrt of {known}, or [KINS]KINEMATICS{}",
            other.collect::<String>(),
            gap.unwrap_or_default()
        );
        input(old, &text)
    })
}

/// Collects the values of the module's pins.
fn geometry(
    old: &OldIni,
    peer: &PeerModule,
    hal: &HalValues,
    instead: Option<&Path>,
    notes: &mut Notes,
) -> Result<Pins, Refusal> {
    let own;
    let hal = match instead {
        None => hal,
        Some(file) => {
            own = HalValues::read(&old.ini, Some(file)).map_err(|reason| input(old, &reason))?;
            if let Some(gap) = own.gaps.first() {
                return Err(Refusal::Input(format!("{}: {}", gap.place, gap.reason)));
            }
            &own
        }
    };
    refuse_unknown_pins(peer, hal)?;
    let mut pins = (peer.defaults)();
    let mut by_default = vec![];
    for (name, value) in &mut pins {
        let pin = format!("{}.{name}", peer.name);
        match hal.get(&pin) {
            Some(Value::Set(word, place)) => {
                *value = decimal(&word).ok_or_else(|| {
                    Refusal::Input(format!("{place}: {pin} {word}: expected a decimal number"))
                })?;
            }
            Some(Value::Driven(..)) if name == "tool-offset" => {}
            Some(Value::Driven(signal, place)) => {
                return Err(undetermined(
                    &format!(
                        "{place}: {pin} is on signal {signal}, to which no sets gives a value"
                    ),
                    peer,
                ));
            }
            None => by_default.push(name.clone()),
        }
    }
    refuse_gaps(old, peer, hal, !by_default.iter().all(|name| is_free(&pins, name)))?;
    let counted = pins.len() - by_default.len();
    notes.carried.push(format!(
        "geometry: {counted} values of {} pins of {}",
        pins.len(),
        peer.name
    ));
    if by_default.len() == pins.len() {
        notes.undetermined.push(format!(
            "geometry: no HAL file sets a pin of {}, so that all have the module's own values: see that they are the \
             machine's",
            peer.name
        ));
    } else {
        by_default.retain(|name| !is_free(&pins, name));
        if !by_default.is_empty() {
            notes.undetermined.push(format!(
                "geometry: no HAL file sets {}, which have the module's own values",
                by_default.join(", ")
            ));
        }
    }
    Ok(pins)
}

/// Returns whether the default of a pin needs no note.
fn is_free(pins: &Pins, name: &str) -> bool {
    let of_screw = name.starts_with("base-n.") || name.starts_with("platform-n.");
    let is_screw = pins.get("screw-lead").is_some_and(|lead| *lead != 0.0);
    (of_screw && !is_screw) || ["screw-lead", "spindle-offset", "tool-offset"].contains(&name)
}

/// Returns the refusal of undetermined geometry, with a remedy.
fn undetermined(why: &str, peer: &PeerModule) -> Refusal {
    Refusal::Input(format!(
        "{why}: the geometry is not determined. Write lines such as setp {}.{} 100 into a HAL file, a line for each pin \
         (halcmd show pin {}, where the machine runs, has them), and give it with --geometry FILE.hal",
        peer.name,
        (peer.defaults)().keys().next().map_or("", |name| name),
        peer.name
    ))
}

/// Rejects pins that the module does not have.
fn refuse_unknown_pins(peer: &PeerModule, hal: &HalValues) -> Result<(), Refusal> {
    let known = (peer.defaults)();
    for (pin, place) in hal.pins_of(peer.name) {
        let name = pin.split_once('.').map_or("", |(_, name)| name);
        let is_known = known.contains_key(name)
            || peer.others.contains(&name)
            || name.starts_with("correction.");
        let is_nothing =
            matches!(hal.get(pin), Some(Value::Set(word, _)) if decimal(&word) == Some(0.0));
        if !is_known && !is_nothing {
            return Err(Refusal::Input(format!(
                "{place}: LinuxCNC's {} has no pin {name}, and what it means is not known here: correct it, or take the line \
                 out of a copy",
                peer.name
            )));
        }
    }
    Ok(())
}

/// Rejects commands, files and programs that are not run and could set the geometry.
fn refuse_gaps(
    old: &OldIni,
    peer: &PeerModule,
    hal: &HalValues,
    has_defaults: bool,
) -> Result<(), Refusal> {
    let pins = format!("{}.", peer.name);
    for Gap { place, reason, command } in &hal.gaps {
        let may_set = match command {
            Some(command) => command.contains(&pins),
            None => match text_of(old, place) {
                Some(text) => text.contains(&pins) || (has_defaults && text.contains("source")),
                None => has_defaults,
            },
        };
        if may_set {
            let what = command.as_ref().map(|command| format!("{}: ", command.trim()));
            let why = format!(
                "{place}: {}it is not carried out here, for {reason}",
                what.unwrap_or_default()
            );
            return Err(undetermined(&why, peer));
        }
    }
    match hal.programs.first().filter(|_| has_defaults) {
        Some((program, place)) => Err(undetermined(
            &format!(
                "{place}: {program}, which is not started here, may set pins that no HAL file sets"
            ),
            peer,
        )),
        None => Ok(()),
    }
}

/// Reads a file that is not run.
fn text_of(old: &OldIni, place: &Location) -> Option<String> {
    let name = place.file.to_string_lossy();
    let file = machine::read::places::named(old.ini.file(), &name);
    read(&file).ok().map(|bytes| String::from_utf8_lossy(&bytes).into())
}

/// Collects everything that the new file keeps.
fn carried(
    old: &OldIni,
    peer: &PeerModule,
    kind: &MachineKind,
    pins: &Pins,
    hal: &HalValues,
    notes: &mut Notes,
) -> Result<Carried, Refusal> {
    let is_arm = kind.leg == kinematics::leg::Kind::Crank;
    let mut joints = vec![];
    for n in 0..peer.legs {
        joints.push(old.joint(n, None, is_arm)?);
    }
    let motion = motion(old, peer, &joints, notes)?;
    let extra = extra(old, peer, notes)?;
    let mut axes = vec![];
    for letter in peer.letters.chars() {
        axes.push(old.axis(letter, motion[usize::from("ABC".contains(letter))])?);
    }
    for (letter, n) in &extra {
        let joint = old.joint(*n, Some(*letter), "ABC".contains(*letter))?;
        let mut axis = old.axis(*letter, joint.motion)?;
        // This joint moves only this axis.
        axis.motion = std::array::from_fn(|k| axis.motion[k].min(joint.motion[k]));
        axis.limits = axis.limits.or(Some(joint.range));
        joints.push(joint);
        axes.push(axis);
    }
    let start = [
        old.number_of("TRAJ", &["DEFAULT_LINEAR_VELOCITY", "DEFAULT_VELOCITY"])?,
        old.number_of("TRAJ", &["DEFAULT_ANGULAR_VELOCITY"])?,
    ];
    let period = old.number("EMCMOT", "SERVO_PERIOD")?;
    if period.is_none() {
        old.choose("SERVO_PERIOD is 1000000 ns, for the file has none", String::new());
    }
    notes.carried.push(format!(
        "{} joints: limits, speeds, accelerations, homing and the keys of their drives",
        joints.len()
    ));
    Ok(Carried {
        display: display(old)?,
        period: period.unwrap_or(1e6) as u32,
        machine: machine_lines(peer, pins, hal, notes),
        direction: Carried::usual_direction(kind),
        motion,
        start: std::array::from_fn(|k| start[k].unwrap_or(0.2 * motion[k][0]).min(motion[k][0])),
        joints,
        axes,
        extra: extra.iter().map(|(letter, _)| letter).collect(),
        tools: tools(old, notes)?,
        ..Carried::default()
    })
}

/// Returns speeds and accelerations of the tool.
fn motion(
    old: &OldIni,
    peer: &PeerModule,
    joints: &[CarriedJoint],
    notes: &mut Notes,
) -> Result<[[f64; 2]; 2], Refusal> {
    let of = |key: &[&str]| old.number_of("TRAJ", key);
    let slowest = |k: usize| {
        let values = joints.iter().map(|joint| joint.motion[k]);
        let least = values.fold(f64::INFINITY, f64::min);
        // Joint values of an arm are degrees, not lengths.
        let lengths = joints[0].kind == "LINEAR";
        Ok::<f64, Refusal>(if lengths { least } else { [50.0, 400.0][k] * old.per_mm()? })
    };
    let mut usual = |what: &str, found: Option<f64>, other: f64| {
        if found.is_none() {
            notes.undetermined.push(format!("{what} is {other}: [TRAJ] has none"));
        }
        found.unwrap_or(other)
    };
    let speed = of(&["MAX_LINEAR_VELOCITY", "MAX_VELOCITY"])?;
    let speed = usual("MAX_LINEAR_VELOCITY", speed, slowest(0)?);
    let acceleration = of(&[
        "MAX_LINEAR_ACCELERATION",
        "MAX_ACCELERATION",
        "DEFAULT_LINEAR_ACCELERATION",
        "DEFAULT_ACCELERATION",
    ])?;
    let mut of_axes: Option<f64> = None;
    for letter in ["X", "Y", "Z"] {
        let own = old.number_of(&format!("AXIS_{letter}"), &["MAX_ACCELERATION"])?;
        of_axes = [of_axes, own].into_iter().flatten().reduce(f64::max);
    }
    let acceleration = acceleration.or(of_axes);
    let acceleration = usual("MAX_LINEAR_ACCELERATION", acceleration, slowest(1)?);
    let turn = of(&["MAX_ANGULAR_VELOCITY"])?;
    let turn_acceleration = of(&["MAX_ANGULAR_ACCELERATION", "DEFAULT_ANGULAR_ACCELERATION"])?;
    let angular = match peer.letters.contains('A') {
        true => {
            let turn = usual("MAX_ANGULAR_VELOCITY", turn, 8.0);
            [turn, usual("MAX_ANGULAR_ACCELERATION", turn_acceleration, 10.0 * turn)]
        }
        false => {
            let turn = turn.unwrap_or(100.0);
            [turn, turn_acceleration.unwrap_or(10.0 * turn)]
        }
    };
    Ok([[speed, acceleration], angular])
}

/// Returns the letters that the module passes on, with the numbers of their joints.
fn extra(
    old: &OldIni,
    peer: &PeerModule,
    notes: &mut Notes,
) -> Result<Vec<(char, usize)>, Refusal> {
    let joints = match old.number("KINS", "JOINTS")? {
        Some(joints) => Some(("[KINS]JOINTS", joints)),
        None => match old.number("TRAJ", "JOINTS")? {
            Some(joints) => Some(("[TRAJ]JOINTS", joints)),
            None => old.number("TRAJ", "AXES")?.map(|axes| ("[TRAJ]AXES", axes)),
        },
    };
    old.pass(&[("TRAJ", "AXES"), ("TRAJ", "JOINTS"), ("TRAJ", "COORDINATES")]);
    let Some((key, count)) = joints else { return Ok(vec![]) };
    if count < peer.legs as f64 {
        let text = format!("{key} = {count}: {} has {} joints", peer.name, peer.legs);
        return Err(input(old, &text));
    }
    let mut found = vec![];
    for n in peer.legs..(count as usize).min(MAX_JOINTS) {
        let letter = peer.passes.chars().nth(n - peer.legs);
        match letter.filter(|_| old.has_section(&old.joint_section(n))) {
            Some(letter) => found.push((letter, n)),
            None => notes.left_out.push(match letter {
                Some(_) => format!("joint {n}, which has no section"),
                None => format!("joint {n}, to which {} gives no value", peer.name),
            }),
        }
    }
    Ok(found)
}

/// Writes the lines of `[PKM]`.
fn machine_lines(peer: &PeerModule, pins: &Pins, hal: &HalValues, notes: &mut Notes) -> String {
    let mut lines = String::new();
    if let Some(lead) = pins.get("screw-lead") {
        lines += &line(of_machine::SCREW_LEAD.name, &[*lead]);
    } else if peer.kind == "tripod" {
        lines += &line(of_machine::SCREW_LEAD.name, &[0.0]);
    }
    let Some(length) = pins.get("tool-offset") else { return lines };
    let offset = pins.get("spindle-offset").copied().unwrap_or(0.0);
    if !hal.are_connected(&format!("{}.tool-offset", peer.name), TOOL_LENGTH) {
        notes.undetermined.push(format!(
            "tool lengths: {}.tool-offset was not on {TOOL_LENGTH}, so that tilts turned about a point without the tool's length; \
             with pkmkins they turn about the tip",
            peer.name
        ));
    }
    if offset + length != 0.0 {
        lines += &line(of_machine::SPINDLE_OFFSET.name, &[offset + length]);
    }
    lines
}

/// Writes the lines of `[DISPLAY]`.
fn display(old: &OldIni) -> Result<String, Refusal> {
    let given = old.word("DISPLAY", "DISPLAY")?.unwrap_or("axis");
    let name = given.split_whitespace().next().unwrap_or_default();
    let known = DISPLAYS.contains(&name);
    if !known {
        old.choose(
            &format!("the user interface is axis, for LinuxCNC has no {name}"),
            String::new(),
        );
    }
    let mut lines = format!("DISPLAY = {}\n", if known { given } else { "axis" });
    for key in OF_DISPLAY {
        if let Some(word) = old.word("DISPLAY", key)? {
            lines += &format!("{key} = {word}\n");
        }
    }
    old.pass(&[
        ("EMC", "VERSION"),
        ("EMC", "MACHINE"),
        ("EMC", "DEBUG"),
        ("DISPLAY", "CYCLE_TIME"),
        ("DISPLAY", "GEOMETRY"),
        ("DISPLAY", "HELP_FILE"),
        ("DISPLAY", "MAX_LINEAR_VELOCITY"),
        ("DISPLAY", "DEFAULT_LINEAR_VELOCITY"),
        ("DISPLAY", "MAX_ANGULAR_VELOCITY"),
        ("DISPLAY", "DEFAULT_ANGULAR_VELOCITY"),
        ("EMCMOT", "EMCMOT"),
        ("EMCMOT", "COMM_TIMEOUT"),
        ("EMCMOT", "COMM_WAIT"),
        ("TASK", "TASK"),
        ("TASK", "CYCLE_TIME"),
        ("EMCIO", "EMCIO"),
        ("EMCIO", "CYCLE_TIME"),
        ("TRAJ", "CYCLE_TIME"),
        ("TRAJ", "DEFAULT_LINEAR_ACCELERATION"),
        ("TRAJ", "DEFAULT_ANGULAR_ACCELERATION"),
        ("TRAJ", "DEFAULT_ACCELERATION"),
        ("KINS", "JOINTS"),
    ]);
    Ok(lines)
}

/// Reads the tool table.
fn tools(old: &OldIni, notes: &mut Notes) -> Result<String, Refusal> {
    let none = "T1 P1 Z0 D0 ;no length yet: measure your tools\n";
    let Some(file) = old.file("EMCIO", "TOOL_TABLE")? else {
        notes.undetermined.push("tools: [EMCIO] names no TOOL_TABLE".into());
        return Ok(none.into());
    };
    match read_text(&file) {
        Ok(text) => {
            notes.carried.push(format!("tool table: {}", file.display()));
            Ok(text)
        }
        Err(error) => {
            notes.undetermined.push(format!("tools: {error}"));
            Ok(none.into())
        }
    }
}

/// Returns values of the kind's parameters, as `pkm new` gets them.
fn given(old: &OldIni, peer: &PeerModule, joints: &[CarriedJoint]) -> Result<Given, Refusal> {
    let low = joints.iter().map(|joint| joint.range[0]).fold(f64::INFINITY, f64::min);
    let high = joints.iter().map(|joint| joint.range[1]).fold(f64::NEG_INFINITY, f64::max);
    let unit = if old.per_mm()? == 1.0 { "mm" } else { "inch" };
    Ok(Given::from([
        (UNIT.name, vec![unit.into()]),
        // Replaces the dimensions; no file is read.
        (ANCHORS.name, vec![peer.name.into()]),
        // Values beyond MOST count as no limit.
        (peer.range, [low, high].map(|x| x.clamp(-MOST, MOST).to_string()).to_vec()),
    ]))
}

fn words_of_limits(axes: &[CarriedAxis], peer: &PeerModule) -> Vec<String> {
    let of = |axis: &CarriedAxis| {
        let [low, high] = axis.limits.filter(|_| peer.letters.contains(axis.letter))?;
        Some([axis.letter.to_string(), low.to_string(), high.to_string()])
    };
    let all: Option<Vec<_>> =
        axes.iter().filter(|axis| peer.letters.contains(axis.letter)).map(of).collect();
    all.unwrap_or_default().concat()
}

/// Computes the joint values at home.
fn joints_at(config: &MachineConfig) -> Result<Joints, Refusal> {
    let machine = config.first();
    let joints = machine.machine.inverse(&machine.home_pose(), &machine.spindle);
    joints.map_err(|fault| Refusal::Misfit(format!("at home {fault}")))
}

/// Sets HOME_OFFSET = HOME for joints that are at home when they are homed, with all digits of HOME.
fn with_homes(carried: &Carried, joints: &[f64]) -> Carried {
    let mut carried = carried.clone();
    for (n, joint) in carried.joints.iter_mut().enumerate() {
        let home = joints.get(n).copied().unwrap_or(joint.home);
        joint.lines = joint.lines.replace(AT_HOME, &line("HOME_OFFSET", &[home]));
    }
    carried
}

/// Decides on home, in the order of docs/guide/migrating.md.
fn stand(
    plan: &Plan,
    peer: &PeerModule,
    old: &OldIni,
    given: Option<[f64; 3]>,
    notes: &mut Notes,
) -> Result<[f64; 3], Refusal> {
    if let Some(home) = given {
        return Ok(home);
    }
    let carried = plan.carried.as_ref().map_or(&[][..], |carried| &carried.joints[..]);
    let mut homes: Joints = [0.0; MAX_JOINTS];
    for (home, joint) in homes.iter_mut().zip(carried) {
        *home = joint.home;
    }
    let own: Vec<String> = homes[..peer.legs].iter().map(|home| plain(*home).to_string()).collect();
    let own = own.join(", ");
    let named = old.home()?;
    if let Some(NamedHome { is_level: false, name, .. }) = named {
        notes
            .undetermined
            .push(format!("home: {name} is tilted, and pkmkins starts level: A, B and C are 0"));
    }
    let named = named.map(|NamedHome { place, name, .. }| (place, name));
    let words = |place: [f64; 3]| {
        let [x, y, z] = place.map(plain);
        format!("X{x} Y{y} Z{z}")
    };
    let at_named = named.and_then(|(place, _)| Some((place, home::standing(plan, place).ok()?)));
    if let Some((place, config)) = &at_named
        && fits(&joints_at(config)?, &homes, peer, old)
    {
        return Ok(*place);
    }
    // The pose at the joints' HOME.
    let seed = match &at_named {
        Some((_, config)) => Some(config.clone()),
        None if peer.is_one_to_one => Some(home::found(plan)?.1),
        None => None,
    };
    let of_joints = seed.and_then(|seed| forward(plan, &seed, &homes, peer, old));
    match (of_joints, at_named, named) {
        (Some(place), None, None) => Ok(place),
        (Some(place), _, Some((other, name))) => {
            notes.undetermined.push(format!(
                "home: {name} is {}, and the joints' HOME {own} are those of {}; taken is where homing ends, the joints' HOME",
                words(other),
                words(place)
            ));
            Ok(place)
        }
        (None, Some((place, config)), Some((_, name))) => {
            let joints = joints_at(&config)?;
            let off = (0..peer.legs).map(|n| (joints[n] - homes[n]).abs()).fold(0.0, f64::max);
            notes.undetermined.push(format!(
                "home: the joints' HOME, {own}, are off by up to {} from what the kinematics give at {name}, {}; taken is {name}: see \
                 that the machine stands there when it is homed",
                (off * 1e4).ceil() / 1e4,
                words(place)
            ));
            Ok(place)
        }
        (_, _, named) => {
            let why = match named {
                Some((place, name)) => {
                    format!("the machine cannot take {name}, {}", words(place))
                }
                None => {
                    "neither [TRAJ]HOME nor HOME of the axes says where the machine stands".into()
                }
            };
            Err(Refusal::Misfit(format!(
                "{}: home is not determined: {why}, and the joints' HOME {own} belong to no pose that is known: give --home X Y Z",
                old.ini.file().display()
            )))
        }
    }
}

/// Returns whether joint values equal those of the file, which may be rounded.
fn fits(joints: &Joints, homes: &Joints, peer: &PeerModule, old: &OldIni) -> bool {
    // Roundings of some hundred operations on lengths below a thousand.
    let near = |n: usize| (joints[n] - homes[n]).abs() <= old.rounding(n).max(1e-9);
    (0..peer.legs).all(near)
}

/// Computes the level pose of joint values; `None` if none is found.
fn forward(
    plan: &Plan,
    seed: &MachineConfig,
    homes: &Joints,
    peer: &PeerModule,
    old: &OldIni,
) -> Option<[f64; 3]> {
    let config = seed.first();
    let seed = Pose::from_degrees(config.home);
    let found = config.machine.forward(homes, &seed, &config.spindle, &config.solver).ok()?;
    let pose = found.pose.to_degrees();
    if pose[3..].iter().any(|angle| angle.abs() > LEVEL) {
        return None;
    }
    let place = [pose[0], pose[1], pose[2]].map(|x| (x * 1e9).round() / 1e9 + 0.0);
    let config = home::standing(plan, place).ok()?;
    let is_own = fits(&joints_at(&config).ok()?, homes, peer, old)
        || (0..peer.legs)
            .all(|n| (joints_at(&config).map_or(f64::NAN, |j| j[n]) - homes[n]).abs() < 1e-6);
    is_own.then_some(place)
}

/// Lists keys and sections that the new file does not keep.
fn left_out(old: &OldIni) -> Vec<String> {
    let mut left = old.left_out();
    for item in &mut left {
        let section = item.split(']').next().unwrap_or_default().trim_start_matches('[');
        // Before joints and axes, LinuxCNC numbered its axes.
        if !near::is_section(section) && !section.starts_with("AXIS_") {
            *item += ": only HAL files read it";
        }
        if item.starts_with("[HAL]") {
            *item += ": simulated drives take their place; `pkm help guide/drives` lists files for real ones, which read \
                      the keys of [JOINT_N]";
        }
    }
    left
}

/// Writes the comment at the head of the file.
fn about(
    carried: &mut Carried,
    name: &str,
    old: &OldIni,
    peer: &PeerModule,
    kind: &MachineKind,
    notes: &Notes,
) {
    let unit = if old.per_mm().is_ok_and(|per_mm| per_mm == 1.0) { "mm" } else { "inch" };
    let file = old.ini.file().display();
    carried.source = format!("Made by `pkm migrate` of {file}, which is for {}.", peer.name);
    carried.about = vec![format!(
        "{name}, {}; lengths in {unit}. Made by pkm migrate of {file}, which is for {}: joint values and poses are the same. \
         HOME of every joint is what the kinematics give at [TRAJ]HOME, and without a tool the machine can take every pose \
         between the axis limits, which is proved.",
        kind.text, peer.name
    )];
    for (what, items) in [("Not determined", &notes.undetermined), ("Left out", &notes.left_out)] {
        carried.about.extend(items.iter().map(|item| format!("{what}: {item}.")));
    }
}

/// Notes axis limits that changed.
fn limits_that_changed(made: &Made, carried: &Carried, notes: &mut Notes) {
    let mut without = vec![];
    for axis in &carried.axes {
        let letter = kinematics::Letter::ALL.into_iter().find(|known| known.name() == axis.letter);
        let Some(k) =
            letter.map(kinematics::Letter::index).filter(|_| !carried.extra.contains(axis.letter))
        else {
            continue;
        };
        let found = [made.limits.low[k], made.limits.high[k]];
        let [low, high] = found;
        match axis.limits {
            Some(limits) if limits == found => {}
            Some([old_low, old_high]) => {
                let home = made.report.config.home[k];
                let why = match (old_low..=old_high).contains(&home) {
                    true => "of which not every pose is proved".to_string(),
                    false => format!("beyond which home is, {} {home}", axis.letter),
                };
                notes.undetermined.push(format!(
                    "limits of {}: {low} to {high} in place of {old_low} to {old_high}, {why}",
                    axis.letter
                ));
            }
            None => without.push(axis.letter.to_string()),
        }
    }
    if !without.is_empty() {
        let lowest = made.limits.low[kinematics::Letter::Z.index()];
        notes.undetermined.push(format!(
            "limits of {}: the file has none, and those that are proved about home are taken. Z begins at {lowest}: let MIN_LIMIT of \
             [AXIS_Z] end at your table. Another --home X Y Z, farther from the ends of the drives, gives wider ones",
            without.join(", ")
        ));
    }
}
