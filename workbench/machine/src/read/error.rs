// SPDX-License-Identifier: GPL-2.0-or-later
//! Errors of an INI file that describes no machine, all at once.

use crate::read::constraints::constraint_section;
use crate::read::ini::{Ini, IniError};
use crate::read::place::{Place, leg_section};
use kinematics::{Fault, MachinePart};
use std::fmt;
use std::path::PathBuf;

/// Why an INI file describes no machine.
#[derive(Clone, Debug, PartialEq)]
pub enum MachineError {
    /// Errors in the text of the file: all of them, never empty.
    Ini(Vec<IniError>),
    /// The text is valid, but describes no machine; with the section of the leg or axis that the fault
    /// names.
    Geometry(PathBuf, Fault, Option<IniError>),
}

impl MachineError {
    /// Returns the refusal of the geometry of a mechanism of a file.
    pub fn of_geometry(ini: &Ini, place: &Place, fault: Fault) -> Self {
        let fault = place.counted(fault);
        let section = match fault.part {
            Some(MachinePart::Leg(leg) | MachinePart::Legs([leg, _])) => {
                Some(ini.refuse_section(&leg_section(leg.into()), &fault.to_string()))
            }
            Some(MachinePart::ExtraAxis(_, letter)) => {
                let section = chain_section(letter.into());
                Some(ini.refuse_section(&section, &fault.to_string()))
            }
            Some(MachinePart::Constraint(n)) => {
                Some(ini.refuse_section(&constraint_section(n.into()), &fault.to_string()))
            }
            // A fault of all legs together.
            _ => ini.first("KINS", "KINEMATICS").map(|entry| ini.refuse(entry, &fault.to_string())),
        };
        Self::Geometry(ini.file().into(), fault, section)
    }

    /// Returns the errors that have a location in the file.
    pub fn in_file(&self) -> &[IniError] {
        match self {
            MachineError::Ini(errors) => errors,
            MachineError::Geometry(_, _, section) => section.as_slice(),
        }
    }
}

impl fmt::Display for MachineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MachineError::Ini(errors) => {
                let texts: Vec<String> = errors.iter().map(ToString::to_string).collect();
                f.write_str(&texts.join("\n"))
            }
            MachineError::Geometry(file, fault, _) => write!(f, "{}: {fault}", file.display()),
        }
    }
}

impl std::error::Error for MachineError {}

impl From<IniError> for MachineError {
    fn from(error: IniError) -> Self {
        MachineError::Ini(vec![error])
    }
}

/// Errors of independent values.
#[derive(Default)]
pub(super) struct Errors(Vec<IniError>);

impl Errors {
    /// Returns the value, or records its error once.
    pub(super) fn of<T>(&mut self, value: Result<T, IniError>) -> Option<T> {
        match value {
            Ok(value) => Some(value),
            Err(error) => {
                if !self.0.contains(&error) {
                    self.0.push(error);
                }
                None
            }
        }
    }

    /// Reads all of them.
    pub(super) fn each<T>(
        &mut self,
        count: usize,
        value: impl Fn(usize, &mut Self) -> Option<T>,
    ) -> Option<Vec<T>> {
        let values: Vec<Option<T>> = (0..count).map(|n| value(n, self)).collect();
        values.into_iter().collect()
    }

    pub(super) fn checked(self) -> Result<(), MachineError> {
        self.value(Some(()))
    }

    /// Returns the value, which exists if there was no error.
    pub(super) fn value<T>(self, value: Option<T>) -> Result<T, MachineError> {
        value.filter(|_| self.0.is_empty()).ok_or(MachineError::Ini(self.0))
    }
}

pub(super) fn chain_section(letter: char) -> String {
    format!("CHAIN_{letter}")
}
