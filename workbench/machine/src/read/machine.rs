// SPDX-License-Identifier: GPL-2.0-or-later
//! A machine as its INI file describes it: facts of the file, and its one or two mechanisms.
//!
//! A machine refused here does not start in LinuxCNC: hal/pkmkins.tcl runs `pkmkins-pins`, which uses this reader.

use crate::read::constraints::check_constraint_sections;
use crate::read::error::{Errors, MachineError};
use crate::read::facts::FileFacts;
use crate::read::ini::{Ini, IniError};
use crate::read::legs::check_leg_sections;
use crate::read::mechanism::{Mechanism, in_order};
use crate::read::older;
use crate::read::place::Place;
use keys::{machine as of_machine, second as of_second};
use kinematics::{LOAD_PARAMETERS, Letter, Load, POSE_LETTERS, Second, World};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Why a file with `sparm=identityfirst` is not judged.
const IDENTITY_FIRST: &str = "pkm needs LinuxCNC to start in the machine's kinematics, but sparm=identityfirst starts it in identity \
     kinematics: use a copy of the file without identityfirst, the machine is the same";

/// Why a file with constraints is not judged.
const CONSTRAINED: &str =
    "not judged: this tool does not support constraints= yet (pkm help reference/layouts)";

/// Parameters that may have an empty value.
const MAY_BE_EMPTY: [&str; 4] = ["table", "axes", "second_angles", "sparm"];

/// Parsed machine configuration; it derefs to the facts of the file.
#[derive(Clone, Debug)]
pub struct MachineConfig {
    /// Its one or two mechanisms in order; or the selected one of two.
    pub mechanisms: Vec<Mechanism>,
}

/// A machine that is accepted although [`MachineConfig::from_ini`] refuses it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lenient {
    /// One with refused boxes, for example those of another geometry: [`Mechanism::refused_boxes`] has the reason.
    Boxes,
    /// One that LinuxCNC starts in the identity, with or without constraints: its geometry is the same.
    Identity,
    /// One with constraints of the platform, for computations that know its dependent coordinates.
    Constraints,
    /// One with refused boxes or constraints, for a report about the machine.
    Report,
}

/// A request for the second mechanism of a machine with only one.
#[derive(Debug, thiserror::Error)]
#[error("--mechanism 2: {} has only one mechanism; remove --mechanism, or add second= to [KINS]KINEMATICS", .0.display())]
pub struct OneMechanism(pub PathBuf);

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

    /// Returns the machine that a mechanism belongs to: LinuxCNC runs both of two.
    ///
    /// # Errors
    /// As [`MachineConfig::from_ini`].
    pub fn whole_of(mechanism: &Mechanism) -> Result<Self, MachineError> {
        match mechanism.second_letters {
            Some(_) => Self::from_ini(&mechanism.ini),
            None => Ok(mechanism.clone().into()),
        }
    }

    /// Reads a machine, even if [`MachineConfig::from_ini`] refuses it for this reason.
    ///
    /// # Errors
    /// As [`MachineConfig::from_ini`], for any other reason.
    pub fn leniently(ini: &Ini, lenient: Option<Lenient>) -> Result<Self, MachineError> {
        let load = load(ini)?;
        if load.is_identity_first() && lenient != Some(Lenient::Identity) {
            return Err(ini.refuse(ini.require("KINS", "KINEMATICS", "")?, IDENTITY_FIRST).into());
        }
        let knows_constraints =
            matches!(lenient, Some(Lenient::Constraints | Lenient::Report | Lenient::Identity));
        if load.layout.constraints() > 0 && !knows_constraints {
            return Err(ini.refuse(ini.require("KINS", "KINEMATICS", "")?, CONSTRAINED).into());
        }
        let mechanisms = Place::all(&load);
        let legs = mechanisms.iter().map(|(_, load)| load.layout.legs()).sum();
        let mut errors = Errors::default();
        errors.of(check_joints(ini, &load));
        errors.of(check_leg_sections(ini, legs));
        errors.of(check_constraint_sections(ini, load.layout.constraints()));
        errors.of(check_coordinates(ini, &load));
        errors.of(check_second_sections(ini, &load));
        // If these are wrong, later errors only repeat them.
        errors.checked()?;
        let mut errors = Errors::default();
        let facts = FileFacts::read(ini, &load, &mut errors).map(Arc::new);
        let read = errors.each(mechanisms.len(), |n, errors| {
            Mechanism::read(facts.as_ref(), ini, &mechanisms[n], errors)
        });
        let mechanisms = errors.value(read)?.into_iter().collect::<Result<Vec<_>, _>>()?;
        match mechanisms.iter().find_map(|mechanism| mechanism.refused_boxes.clone()) {
            Some(refused) if !matches!(lenient, Some(Lenient::Boxes | Lenient::Report)) => {
                Err(refused)
            }
            _ => Ok(Self { mechanisms }),
        }
    }

    /// Returns the first mechanism, to which extra axes and shapes belong, or the selected one.
    pub fn first(&self) -> &Mechanism {
        &self.mechanisms[0]
    }

    /// Returns the first mechanism or, for 2, the second.
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

    /// Returns the number of joints of legs and tables, which precede those of extra axes.
    pub fn guarded_joints(&self) -> usize {
        self.mechanisms.iter().map(|mechanism| mechanism.joints.len()).sum()
    }

    /// Returns the words of a program at one of LinuxCNC's positions.
    pub fn words(&self, world: &World) -> Vec<(char, f64)> {
        let own = self.mechanisms.iter().flat_map(|mechanism| {
            let places = mechanism.places().map(|(place, _)| place);
            places.chain(mechanism.extra_axes.places())
        });
        in_order(own.map(|place| (place, world[place])))
    }

    /// Returns every joint in LinuxCNC's order: its mechanism, and its number there.
    pub fn all_joints(&self) -> impl Iterator<Item = (&Mechanism, usize)> {
        let of = |mechanism| move |i| (mechanism, i);
        let own = self.mechanisms.iter().flat_map(move |m| (0..m.joints.len()).map(of(m)));
        let (first, legs) = (self.first(), self.first().joints.len());
        own.chain((legs..legs + first.extra.len()).map(of(first)))
    }
}

/// Reads the load parameters in `[KINS]KINEMATICS`.
pub(super) fn load(ini: &Ini) -> Result<Load, IniError> {
    let expected = "expected pkmkins [legs=KIND:COUNT[,KIND:COUNT]] [coordinates=LETTERS] [table=LETTERS] [axes=LETTERS] [boxes=COUNT] [constraints=COUNT] [second=KIND:COUNT[,KIND:COUNT] second_coordinates=LETTERS [second_angles=LETTERS] [second_boxes=COUNT]]";
    older::refuse(ini)?;
    let entry = ini.require("KINS", "KINEMATICS", expected)?;
    let mut words = entry.value.split_ascii_whitespace();
    if words.next() != Some("pkmkins") {
        return Err(ini.refuse(entry, expected));
    }
    let mut given: [Option<&[u8]>; LOAD_PARAMETERS.len()] = [None; LOAD_PARAMETERS.len()];
    for word in words {
        let place = word.split_once('=').and_then(|(name, text)| {
            Some((LOAD_PARAMETERS.iter().position(|p| *p == name)?, text))
        });
        let (place, text) = place.ok_or_else(|| ini.refuse(entry, expected))?;
        let name = LOAD_PARAMETERS[place];
        // LinuxCNC uses the last of several, and ignores an empty one.
        if given[place].is_some() {
            return Err(ini.refuse(entry, &format!("expected {name}= only once; {expected}")));
        }
        if text.is_empty() && !MAY_BE_EMPTY.contains(&name) {
            return Err(ini.refuse(entry, &format!("expected a value after {name}=; {expected}")));
        }
        given[place] = Some(text.as_bytes());
    }
    Load::of(given).map_err(|error| ini.refuse(entry, &format!("{}; {expected}", error.text())))
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

/// Refuses missing letters of `[TRAJ]COORDINATES`: LinuxCNC accepts no program word with a letter that is missing
/// here, so that coordinate could never return to 0. An extra letter is harmless.
fn check_coordinates(ini: &Ini, load: &Load) -> Result<(), IniError> {
    let wanted: String = moved_letters(load).collect();
    let expected = format!("expected the letters {wanted}, as moved by [KINS]KINEMATICS");
    let entry = ini.require("TRAJ", "COORDINATES", &expected)?;
    let given = entry.value.to_ascii_uppercase();
    match moved_letters(load).find(|letter| !given.contains(*letter)) {
        None => Ok(()),
        Some(letter) => Err(ini.refuse(entry, &format!("{expected}, {letter} is missing"))),
    }
}

/// Returns the letters that the machine moves: those of the platform, the table, a second mechanism and extra axes.
pub(super) fn moved_letters(load: &Load) -> impl Iterator<Item = char> {
    let letters = Letter::ALL.into_iter().filter(|letter| !load.layout.is_held(*letter));
    let second = load.second().into_iter().flat_map(Second::places).map(|k| POSE_LETTERS[k]);
    letters.map(Letter::name).chain(second).chain(load.extra.letters())
}

/// Refuses sections that need a second mechanism.
fn check_second_sections(ini: &Ini, load: &Load) -> Result<(), IniError> {
    let mut names = ini.sections();
    let is_own = |name: &str| name == "SECOND" || name.starts_with("SECOND_BOX_");
    match names.find(|name| is_own(name)).filter(|_| load.second().is_none()) {
        Some(name) => Err(ini
            .refuse_section(name, "extra section: remove it, or add second= to [KINS]KINEMATICS")),
        None => {
            let key = of_machine::MECHANISM_CLEARANCE.name;
            match ini.first("PKM", key).filter(|_| load.second().is_none()) {
                Some(entry) => {
                    let text = "only valid with second= in [KINS]KINEMATICS; remove the key, or add second=";
                    Err(ini.refuse(entry, text))
                }
                None => ini.check_keys("SECOND", of_second::ALL.iter().copied()),
            }
        }
    }
}
