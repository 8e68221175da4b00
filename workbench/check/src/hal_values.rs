// SPDX-License-Identifier: GPL-2.0-or-later
//! Values that the HAL files of a configuration give to the pins of a component, for its migration.
//!
//! The files run as for the drives, in an interpreter without access to files, programs and the network. A part that it
//! cannot run is a [`Gap`]: a value that this part could set is not determined.

use crate::drives::{Location, program, recorded};
use machine::read::ini::Ini;
use std::collections::BTreeMap;
use std::path::Path;

/// Keys whose files LinuxCNC runs, in its order.
const FILES: [&str; 2] = ["HALFILE", "POSTGUI_HALFILE"];

/// Interpreters that run a user's file, which may set pins.
const INTERPRETERS: [&str; 8] =
    ["python", "python2", "python3", "sh", "bash", "halcmd", "haltcl", "tclsh"];

/// A part of the HAL files that is not run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gap {
    pub place: Location,
    pub reason: String,
    /// The command, if one line is skipped; `None` if the rest of the file is.
    pub command: Option<String>,
}

/// The value of a pin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Value {
    /// The word it was set to, and the position of the command.
    Set(String, Location),
    /// Its signal, which no `sets` gives a value, and the position of the connection.
    Driven(String, Location),
}

/// All settings of the HAL files.
#[derive(Clone, Debug, Default)]
pub struct HalValues {
    pins: BTreeMap<String, (String, Location)>,
    signals: BTreeMap<String, (String, Location)>,
    on: BTreeMap<String, (String, Location)>,
    /// Modules in the order of loading, with their load parameters.
    pub modules: Vec<Vec<String>>,
    pub gaps: Vec<Gap>,
    /// Custom programs that are started, and could set pins.
    pub programs: Vec<(String, Location)>,
}

impl HalValues {
    /// Runs the HAL files that an INI file names, or one file instead.
    ///
    /// # Errors
    /// The reason why the files cannot be run at all.
    pub fn read(ini: &Ini, instead: Option<&Path>) -> Result<Self, String> {
        let mut found = Self::default();
        let of = |key: &str, kind: &str| -> Vec<String> {
            ini.all("HAL", key).iter().map(|entry| format!("{kind} {}", entry.value)).collect()
        };
        let mut entries = match instead {
            Some(file) => {
                let whole = std::path::absolute(file).unwrap_or_else(|_| file.into());
                vec![format!("file {}", whole.display())]
            }
            None => {
                let [files, late] = FILES.map(|key| of(key, "file"));
                [files, of("HALCMD", "command"), late].concat()
            }
        };
        // HAL files of Machinekit in Python.
        entries.retain(|entry| match entry.split_whitespace().nth(1) {
            Some(name) if name.ends_with(".py") => {
                let place = Location { file: name.into(), line: 0 };
                let reason = "a program of Python computes what is set".into();
                found.gaps.push(Gap { place, reason, command: None });
                false
            }
            _ => true,
        });
        for line in recorded(ini, "all", &entries)?.lines() {
            let words: Vec<&str> = line.split('\t').collect();
            let [file, line, what, words @ ..] = &words[..] else { continue };
            found.take(
                Location { file: file.into(), line: line.parse().unwrap_or(0) },
                what,
                words,
            );
        }
        Ok(found)
    }

    fn take(&mut self, place: Location, what: &str, words: &[&str]) {
        match (what, words) {
            ("setp", [pin, value, ..]) => {
                self.pins.insert((*pin).into(), ((*value).into(), place));
            }
            ("sets", [signal, value, ..]) => {
                self.signals.insert((*signal).into(), ((*value).into(), place));
            }
            ("net", [signal, pins @ ..]) => {
                for pin in pins {
                    self.on.insert((*pin).into(), ((*signal).into(), place.clone()));
                }
            }
            ("unlinkp", [pin, ..]) => drop(self.on.remove(*pin)),
            ("loadrt", words) => {
                self.modules.push(words.iter().map(|word| (*word).into()).collect());
            }
            ("loadusr", words) => {
                let words: Vec<String> = words.iter().map(|word| (*word).into()).collect();
                if let Some(name) = program(&words).filter(|name| is_own(name)) {
                    self.programs.push((name.into(), place));
                }
            }
            // A pin may be set by its alias.
            ("alias", _) => {
                let (reason, command) =
                    ("another name of a pin is not followed".into(), words.join(" "));
                self.gaps.push(Gap { place, reason, command: Some(command) });
            }
            ("skipped", [reason, command, ..]) => {
                let is_file = command.split_whitespace().next() == Some("source");
                let command = (!is_file).then(|| (*command).into());
                self.gaps.push(Gap { place, reason: (*reason).into(), command });
            }
            ("refused" | "failed", [reason, ..]) => {
                self.gaps.push(Gap { place, reason: (*reason).into(), command: None });
            }
            _ => {}
        }
    }

    /// Returns the value of a pin after all files have run; `None` if no file sets it.
    pub fn get(&self, pin: &str) -> Option<Value> {
        let Some((signal, place)) = self.on.get(pin) else {
            return self.pins.get(pin).map(|(word, place)| Value::Set(word.clone(), place.clone()));
        };
        Some(match self.signals.get(signal) {
            Some((word, place)) => Value::Set(word.clone(), place.clone()),
            None => Value::Driven(signal.clone(), place.clone()),
        })
    }

    /// Returns whether two pins are on one signal.
    pub fn are_connected(&self, pin: &str, other: &str) -> bool {
        let signal = |pin: &str| self.on.get(pin).map(|(signal, _)| signal);
        signal(pin).is_some_and(|own| signal(other) == Some(own))
    }

    /// Returns the pins of a component that are set or on a signal, each with the position of a command.
    pub fn pins_of<'a>(
        &'a self,
        component: &'a str,
    ) -> impl Iterator<Item = (&'a str, &'a Location)> {
        let all = self.pins.iter().chain(&self.on);
        let own = move |pin: &str| pin.split('.').next() == Some(component);
        all.filter(move |(pin, _)| own(pin)).map(|(pin, (_, place))| (pin.as_str(), place))
    }
}

/// Returns whether a program may be custom, or runs a user's file.
fn is_own(name: &str) -> bool {
    let is_script = [".py", ".sh", ".tcl"].iter().any(|end| name.ends_with(end));
    name.contains('/') || is_script || INTERPRETERS.contains(&name)
}
