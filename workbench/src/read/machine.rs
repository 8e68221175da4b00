// SPDX-License-Identifier: GPL-2.0-or-later
//! A machine as its INI file describes it: what the file says once, and its one or two mechanisms.
//!
//! What is refused here does not start in LinuxCNC: hal/pkmkins.tcl runs `pkmkins-pins`, which reads with it.

use crate::read::error::{Errors, MachineError};
use crate::read::ini::{Entry, Ini, IniError};
use crate::read::joints::positive;
use crate::read::legs::check_leg_sections;
use crate::read::mechanism::Mechanism;
use crate::read::place::Place;
use crate::read::places;
use keys::{machine as of_machine, second as of_second};
use kinematics::{Letter, Load, POSE_LETTERS, Second};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Load parameters of the module, in the order that [`Load::parse`] takes them; the next ones are those
/// of [`Load::with_axes`] and [`Load::with_boxes`], then those of a second mechanism.
const PARAMETERS: [&str; 9] = [
    "legs",
    "coordinates",
    "table",
    "axes",
    "boxes",
    "second",
    "second_coordinates",
    "second_angles",
    "second_boxes",
];

/// Why a file with `sparm=` is not judged.
const IDENTITY_FIRST: &str = "pkm judges a machine that LinuxCNC starts in its own kinematics, and sparm=identityfirst \
     starts it in the identity: expected a copy of the file without sparm=, the machine is the same";

/// Those that may be given without a value.
const MAY_BE_EMPTY: [&str; 3] = ["table", "axes", "second_angles"];

/// What LinuxCNC's interpreter needs to read programs as this machine does.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// `[RS274NGC]PARAMETER_FILE`, or what LinuxCNC takes without it, beside the INI file; `None` keeps nothing.
    pub parameter_file: Option<PathBuf>,
    /// `[EMCIO]TOOL_TABLE`, beside the INI file.
    pub tool_table: Option<PathBuf>,
    /// `[RS274NGC]RS274NGC_STARTUP_CODE`.
    pub startup_code: Option<String>,
    /// `[EMCIO]RANDOM_TOOLCHANGER`.
    pub random_tools: bool,
    /// The INI file with those it includes, where it includes any.
    pub expanded: Option<String>,
}

/// What an INI file says of the machine as a whole.
#[derive(Clone, Debug)]
pub struct FileFacts {
    /// The INI file.
    pub file: PathBuf,
    /// What was read from it.
    pub ini: Ini,
    /// Letters of the second mechanism, if the file has one.
    pub second_letters: Option<Second>,
    /// Smallest distance of the legs and the platform of one of two mechanisms from those of the
    /// other, machine units, `[PKM]MECHANISM_CLEARANCE`.
    pub mechanism_clearance: Option<f64>,
    /// `[TRAJ]HOME` as LinuxCNC has it, X Y Z A B C U V W.
    pub world_home: [f64; 9],
    /// Machine units per millimetre, from `[TRAJ]LINEAR_UNITS`.
    pub units_per_mm: f64,
    /// `[TRAJ]MAX_LINEAR_VELOCITY`, machine units per second, and `MAX_ANGULAR_VELOCITY`, degrees per second.
    pub max_velocity: [f64; 2],
    /// `[TRAJ]MAX_LINEAR_ACCELERATION` and `MAX_ANGULAR_ACCELERATION`, per second squared.
    pub max_acceleration: [f64; 2],
    /// `[EMCMOT]SERVO_PERIOD`, seconds.
    pub period: f64,
    /// What the interpreter needs.
    pub program: Program,
}

/// A machine with everything its INI file says that this crate uses; it derefs to the facts of the file.
#[derive(Clone, Debug)]
pub struct MachineConfig {
    /// Its one or two mechanisms, the first one first; or the one of two that was chosen.
    pub mechanisms: Vec<Mechanism>,
}

/// A machine that is accepted although [`MachineConfig::from_ini`] refuses it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lenient {
    /// One whose boxes are refused, as those of another geometry are: [`Mechanism::refused_boxes`] has the reason.
    Boxes,
    /// One that LinuxCNC starts in the identity: its geometry is the same.
    Identity,
}

/// A second mechanism of a machine that has one.
#[derive(Debug, thiserror::Error)]
#[error("--mechanism 2: {} has one mechanism; second= in [KINS]KINEMATICS gives another", .0.display())]
pub struct OneMechanism(pub PathBuf);

impl FileFacts {
    fn read(ini: &Ini, load: &Load, errors: &mut Errors) -> Option<Self> {
        let world_home = errors.of(world_home(ini, load.second().is_some()));
        let clearance = errors.of(ini.value("PKM", &of_machine::MECHANISM_CLEARANCE));
        let units_per_mm = errors.of(units_per_mm(ini));
        let [velocity, acceleration] = ["VELOCITY", "ACCELERATION"].map(|what| {
            ["LINEAR", "ANGULAR"].map(|kind| {
                let key = format!("MAX_{kind}_{what}");
                errors.of(positive(ini, "TRAJ", &key, Some(f64::INFINITY)))
            })
        });
        let period = errors.of(positive(ini, "EMCMOT", "SERVO_PERIOD", Some(1e6)));
        Some(Self {
            file: ini.file().into(),
            ini: ini.clone(),
            second_letters: load.second().copied(),
            mechanism_clearance: clearance?,
            world_home: world_home?,
            units_per_mm: units_per_mm?,
            max_velocity: [velocity[0]?, velocity[1]?],
            max_acceleration: [acceleration[0]?, acceleration[1]?],
            period: period? * 1e-9,
            program: program(ini),
        })
    }

    /// Name of the machine's unit of length.
    pub fn length_unit(&self) -> &'static str {
        if self.units_per_mm == 1.0 { "mm" } else { "inch" }
    }
}

impl Deref for MachineConfig {
    type Target = FileFacts;

    fn deref(&self) -> &FileFacts {
        &self.first().facts
    }
}

impl From<Mechanism> for MachineConfig {
    fn from(mechanism: Mechanism) -> Self {
        Self { mechanisms: vec![mechanism] }
    }
}

impl MachineConfig {
    /// Reads a machine from its INI file.
    ///
    /// # Errors
    /// The file, one of its values, or the geometry is refused.
    pub fn read(file: &Path) -> Result<Self, MachineError> {
        Self::from_ini(&Ini::read(file)?)
    }

    /// Reads a machine from the text of its INI file.
    ///
    /// # Errors
    /// One of the values, the geometry or a box is refused.
    pub fn from_ini(ini: &Ini) -> Result<Self, MachineError> {
        Self::leniently(ini, None)
    }

    /// Reads a machine, also one that [`MachineConfig::from_ini`] refuses for this reason.
    ///
    /// # Errors
    /// As [`MachineConfig::from_ini`], for any other reason.
    pub fn leniently(ini: &Ini, lenient: Option<Lenient>) -> Result<Self, MachineError> {
        if lenient != Some(Lenient::Identity) {
            refuse_identity(ini)?;
        }
        let load = load(ini)?;
        let mechanisms = Place::all(&load);
        let legs = mechanisms.iter().map(|(_, load)| load.layout.legs()).sum();
        let mut errors = Errors::default();
        errors.of(check_joints(ini, &load));
        errors.of(check_leg_sections(ini, legs));
        errors.of(check_coordinates(ini, &load));
        errors.of(check_second_sections(ini, &load));
        // Where these are wrong, what follows only repeats it.
        errors.checked()?;
        let mut errors = Errors::default();
        let facts = FileFacts::read(ini, &load, &mut errors).map(Arc::new);
        let read = errors.each(mechanisms.len(), |n, errors| {
            Mechanism::read(facts.as_ref(), ini, &mechanisms[n], errors)
        });
        let mechanisms = errors.value(read)?.into_iter().collect::<Result<Vec<_>, _>>()?;
        match mechanisms.iter().find_map(|mechanism| mechanism.refused_boxes.clone()) {
            Some(refused) if lenient != Some(Lenient::Boxes) => Err(refused),
            _ => Ok(Self { mechanisms }),
        }
    }

    /// Returns the first mechanism, to which extra axes and shapes belong, or the one that was chosen.
    pub fn first(&self) -> &Mechanism {
        &self.mechanisms[0]
    }

    /// Returns one mechanism, the first or, for 2, the second.
    ///
    /// # Errors
    /// The machine has one mechanism.
    pub fn mechanism(self, number: u8) -> Result<Mechanism, OneMechanism> {
        let file = self.file.clone();
        self.mechanisms.into_iter().nth(usize::from(number == 2)).ok_or(OneMechanism(file))
    }

    /// Returns whether it is one of the two mechanisms of its file.
    pub fn is_half(&self) -> bool {
        self.second_letters.is_some() && self.mechanisms.len() == 1
    }

    /// Number of joints of legs and tables: behind them stand those of extra axes.
    pub fn guarded_joints(&self) -> usize {
        self.mechanisms.iter().map(|mechanism| mechanism.joints.len()).sum()
    }

    /// Returns every joint as LinuxCNC counts them: its mechanism, and its number there.
    pub fn all_joints(&self) -> impl Iterator<Item = (&Mechanism, usize)> {
        let of = |mechanism| move |i| (mechanism, i);
        let own = self.mechanisms.iter().flat_map(move |m| (0..m.joints.len()).map(of(m)));
        let (first, legs) = (self.first(), self.first().joints.len());
        own.chain((legs..legs + first.extra.len()).map(of(first)))
    }
}

/// What LinuxCNC's modules call the load parameter that chooses the kinematics to start in.
const SPARM: &str = "sparm=";

/// Refuses a machine that LinuxCNC starts in the identity.
fn refuse_identity(ini: &Ini) -> Result<(), IniError> {
    let entry = ini.first("KINS", "KINEMATICS");
    let given = entry.filter(|entry| entry.words().any(|word| word.starts_with(SPARM)));
    given.map_or(Ok(()), |entry| Err(ini.refuse(entry, IDENTITY_FIRST)))
}

/// The load parameters in `[KINS]KINEMATICS`.
pub(super) fn load(ini: &Ini) -> Result<Load, IniError> {
    let expected = "expected pkmkins [legs=KIND:COUNT[,KIND:COUNT]] [coordinates=LETTERS] [table=LETTERS] [axes=LETTERS] [boxes=COUNT] [second=KIND:COUNT[,KIND:COUNT] second_coordinates=LETTERS [second_angles=LETTERS] [second_boxes=COUNT]]";
    let entry = ini.require("KINS", "KINEMATICS", expected)?;
    let mut words = entry.value.split_ascii_whitespace();
    if words.next() != Some("pkmkins") {
        return Err(ini.refuse(entry, expected));
    }
    let mut given: [Option<&[u8]>; PARAMETERS.len()] = [None; PARAMETERS.len()];
    for word in words.filter(|word| !word.starts_with(SPARM)) {
        let place = word
            .split_once('=')
            .and_then(|(name, text)| Some((PARAMETERS.iter().position(|p| *p == name)?, text)));
        let (place, text) = place.ok_or_else(|| ini.refuse(entry, expected))?;
        let name = PARAMETERS[place];
        // Of several LinuxCNC takes the last one, and an empty one for none.
        if given[place].is_some() {
            return Err(ini.refuse(entry, &format!("expected {name}= once; {expected}")));
        }
        if text.is_empty() && !MAY_BE_EMPTY.contains(&name) {
            return Err(ini.refuse(entry, &format!("expected a value after {name}=; {expected}")));
        }
        given[place] = Some(text.as_bytes());
    }
    let [legs, coordinates, table, axes, boxes, second, of_second @ ..] = given;
    let [second_coordinates, second_angles, second_boxes] = of_second;
    Load::parse(legs, coordinates, table)
        .and_then(|load| load.with_second(second, second_coordinates, second_angles))
        .and_then(|load| load.with_axes(axes))
        .and_then(|load| load.with_boxes(boxes))
        .and_then(|load| load.with_second_boxes(second_boxes))
        .map_err(|error| ini.refuse(entry, &format!("{}; {expected}", error.text())))
}

fn check_joints(ini: &Ini, load: &Load) -> Result<(), IniError> {
    let [joints] = ini.require_numbers::<1>("KINS", "JOINTS")?;
    if joints == load.joints() as f64 {
        return Ok(());
    }
    let expected = format!(
        "expected {}, one joint for each leg and each letter of table= and axes= in [KINS]KINEMATICS",
        load.joints()
    );
    Err(ini.refuse(ini.require("KINS", "JOINTS", &expected)?, &expected))
}

/// LinuxCNC takes no program word with a letter that is missing here, so that nothing
/// could ever bring that coordinate back to 0. A letter too many does no harm.
fn check_coordinates(ini: &Ini, load: &Load) -> Result<(), IniError> {
    let wanted: String = moved_letters(load).collect();
    let expected = format!("expected the letters {wanted} that [KINS]KINEMATICS moves");
    let entry = ini.require("TRAJ", "COORDINATES", &expected)?;
    let given = entry.value.to_ascii_uppercase();
    match moved_letters(load).find(|letter| !given.contains(*letter)) {
        None => Ok(()),
        Some(letter) => Err(ini.refuse(entry, &format!("{expected}, {letter} is missing"))),
    }
}

/// Letters that the machine moves: those of the platform, the table, a second mechanism and extra axes.
pub(super) fn moved_letters(load: &Load) -> impl Iterator<Item = char> {
    let letters = Letter::ALL.into_iter().filter(|letter| !load.layout.is_held(*letter));
    let second = load.second().into_iter().flat_map(Second::places).map(|k| POSE_LETTERS[k]);
    letters.map(Letter::name).chain(second).chain(load.extra.letters())
}

/// What only a second mechanism has.
fn check_second_sections(ini: &Ini, load: &Load) -> Result<(), IniError> {
    let mut names = ini.sections();
    let is_own = |name: &str| name == "SECOND" || name.starts_with("SECOND_BOX_");
    match names.find(|name| is_own(name)).filter(|_| load.second().is_none()) {
        Some(name) => Err(ini.refuse_section(
            name,
            "one section too many; [KINS]KINEMATICS has no second mechanism, second=",
        )),
        None => {
            let key = of_machine::MECHANISM_CLEARANCE.name;
            match ini.first("PKM", key).filter(|_| load.second().is_none()) {
                Some(entry) => {
                    let text = "it is for two mechanisms, and [KINS]KINEMATICS has no second=";
                    Err(ini.refuse(entry, text))
                }
                None => ini.check_keys("SECOND", of_second::ALL.iter().copied()),
            }
        }
    }
}

fn program(ini: &Ini) -> Program {
    let text = |section, key| ini.first(section, key).map(|e: &Entry| e.value.clone());
    let folder = ini.file().parent().unwrap_or(Path::new(""));
    let parameters = text("RS274NGC", "PARAMETER_FILE").filter(|name| !name.is_empty());
    let parameters = parameters.unwrap_or(places::PARAMETERS.into());
    Program {
        parameter_file: Some(folder.join(parameters)),
        tool_table: text("EMCIO", "TOOL_TABLE").map(|name| folder.join(name)),
        startup_code: text("RS274NGC", "RS274NGC_STARTUP_CODE"),
        random_tools: text("EMCIO", "RANDOM_TOOLCHANGER").is_some_and(|value| value == "1"),
        expanded: ini.expanded().map(Into::into),
    }
}

fn units_per_mm(ini: &Ini) -> Result<f64, IniError> {
    let expected = "expected mm or inch";
    let entry = ini.require("TRAJ", "LINEAR_UNITS", expected)?;
    match entry.value.as_str() {
        "mm" | "metric" => Ok(1.0),
        "inch" | "in" | "imperial" => Ok(1.0 / 25.4),
        _ => Err(ini.refuse(entry, expected)),
    }
}

/// `[TRAJ]HOME` as LinuxCNC has it; a second mechanism needs all nine numbers.
fn world_home(ini: &Ini, is_whole: bool) -> Result<[f64; 9], IniError> {
    let (least, expected) = match is_whole {
        true => (9, "expected 9 decimal numbers separated by blanks, X Y Z A B C U V W"),
        false => (3, "expected 3 to 9 decimal numbers separated by blanks"),
    };
    let entry = ini.require("TRAJ", "HOME", expected)?;
    let values = ini.number_list(entry).filter(|values| (least..=9).contains(&values.len()));
    let mut values = values.ok_or_else(|| ini.refuse(entry, expected))?;
    values.resize(9, 0.0);
    if values[3..6].iter().any(|angle| *angle != 0.0) {
        return Err(ini.refuse(entry, "expected a level pose, A = B = C = 0"));
    }
    Ok(std::array::from_fn(|i| values[i]))
}
