// SPDX-License-Identifier: GPL-2.0-or-later
//! Facts of an INI file that exist once, for one mechanism or two.

use crate::read::error::Errors;
use crate::read::ini::{Entry, Ini, IniError};
use crate::read::joints::positive;
use crate::read::places;
use keys::machine as of_machine;
use kinematics::{Load, Second};
use std::path::{Path, PathBuf};

/// Settings with which LinuxCNC's interpreter reads programs as this machine does.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// `[RS274NGC]PARAMETER_FILE` or LinuxCNC's default, in the INI file's folder; `None` saves nothing.
    pub parameter_file: Option<PathBuf>,
    /// `[EMCIO]TOOL_TABLE`, in the INI file's folder.
    pub tool_table: Option<PathBuf>,
    /// `[RS274NGC]RS274NGC_STARTUP_CODE`.
    pub startup_code: Option<String>,
    /// `[EMCIO]RANDOM_TOOLCHANGER`.
    pub random_tools: bool,
    /// The INI file with its included files, if any.
    pub expanded: Option<String>,
}

/// Facts of a machine as a whole.
#[derive(Clone, Debug)]
pub struct FileFacts {
    /// The INI file.
    pub file: PathBuf,
    /// The parsed INI file.
    pub ini: Ini,
    /// Letters of the second mechanism, if the file has one.
    pub second_letters: Option<Second>,
    /// Smallest distance between the legs and the platform of one of two mechanisms and those of the
    /// other, machine units, `[PKM]MECHANISM_CLEARANCE`.
    pub mechanism_clearance: Option<f64>,
    /// `[TRAJ]HOME` in LinuxCNC's coordinates, X Y Z A B C U V W.
    pub world_home: [f64; 9],
    /// Machine units per millimeter, from `[TRAJ]LINEAR_UNITS`.
    pub units_per_mm: f64,
    /// `[TRAJ]MAX_LINEAR_VELOCITY`, machine units per second, and `MAX_ANGULAR_VELOCITY`, degrees per second.
    pub max_velocity: [f64; 2],
    /// `[TRAJ]MAX_LINEAR_ACCELERATION` and `MAX_ANGULAR_ACCELERATION`, per second squared.
    pub max_acceleration: [f64; 2],
    /// `[EMCMOT]SERVO_PERIOD`, seconds.
    pub period: f64,
    /// Settings of the interpreter.
    pub program: Program,
}

impl FileFacts {
    pub(super) fn read(ini: &Ini, load: &Load, errors: &mut Errors) -> Option<Self> {
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

    /// Returns the name of the machine's unit of length.
    pub fn length_unit(&self) -> &'static str {
        if self.units_per_mm == 1.0 { "mm" } else { "inch" }
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

/// Reads `[TRAJ]HOME` as LinuxCNC does; a second mechanism needs all nine numbers.
fn world_home(ini: &Ini, is_whole: bool) -> Result<[f64; 9], IniError> {
    let (least, expected) = match is_whole {
        true => (9, "expected 9 decimal numbers separated by spaces, X Y Z A B C U V W"),
        false => (3, "expected 3 to 9 decimal numbers separated by spaces"),
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
