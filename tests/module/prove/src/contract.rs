// SPDX-License-Identifier: GPL-2.0-or-later
//! The guarantees of the module: a table that developers read and extend.

use serde::Deserialize;
use std::collections::BTreeSet;

/// When a function runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum When {
    /// While no servo thread runs.
    Load,
    /// In the servo thread.
    Run,
}

/// A function that other libraries call.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Its symbol, as `nm -C` shows it.
    pub name: String,
    /// When it runs.
    pub when: When,
    /// Bound of its stack in bytes.
    pub stack: u64,
    /// Whether it is found by name; otherwise its address is passed.
    #[serde(default = "yes")]
    pub exported: bool,
}

fn yes() -> bool {
    true
}

/// The provider of an imported symbol.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Provider {
    /// LinuxCNC: HAL and RTAPI.
    #[default]
    LinuxCnc,
    /// The C library and the start files of the C compiler.
    C,
}

/// How LinuxCNC creates pins; the module is built for one of the two.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Hal {
    /// A pointer to a value of the pin's type.
    Pointers,
    /// A reference to 64 bits with getters and setters.
    References,
}

/// A symbol of another library.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Import {
    pub name: String,
    /// Its provider.
    #[serde(default)]
    pub from: Provider,
    /// `run`: may be called in the servo thread.
    pub when: When,
    /// Only for a module built for this HAL.
    pub hal: Option<Hal>,
    /// Why it is needed, and why it is harmless.
    pub reason: String,
}

/// A version of LinuxCNC that loads the module.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Version {
    /// Its first two numbers.
    pub version: String,
    /// The Debian releases that ship it.
    #[serde(default)]
    pub debian: Vec<String>,
    /// The commit of LinuxCNC that is tested, where no Debian release ships the version.
    pub commit: Option<String>,
    /// Supported HALs; empty: the module has no pins.
    #[serde(default)]
    pub hal: Vec<Hal>,
    /// Symbols of HAL and RTAPI that it exports to realtime modules.
    pub exports: Vec<String>,
}

/// All guarantees.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contract {
    /// Functions that other libraries call.
    pub entry: Vec<Entry>,
    pub data: Vec<String>,
    /// Symbols of other libraries.
    pub import: Vec<Import>,
    /// Versions of LinuxCNC that load the module.
    pub linuxcnc: Vec<Version>,
}

/// The guarantees of the module, and the LinuxCNC versions that load it.
pub const CONTRACT: &str = concat!(
    include_str!("../contract.toml"),
    include_str!("../../../../workbench/linuxcnc/versions.toml")
);

impl Contract {
    /// Reads the table.
    /// # Errors
    /// A message with the location of the error.
    pub fn parse(text: &str) -> Result<Contract, String> {
        toml::from_str(text).map_err(|error| error.to_string())
    }

    /// Returns the guarantees of a module with these imports: those of the HAL that it is built for.
    #[must_use]
    pub fn of(&self, imports: &BTreeSet<String>) -> Contract {
        let own = self.import.iter().find(|i| i.hal.is_some() && imports.contains(&i.name));
        let hal = own.and_then(|i| i.hal);
        let is_own = |import: &Import| import.hal.is_none() || import.hal == hal;
        let loads = |version: &Version| hal.is_none_or(|hal| version.hal.contains(&hal));
        Contract {
            entry: self.entry.clone(),
            data: self.data.clone(),
            import: self.import.iter().filter(|i| is_own(i)).cloned().collect(),
            linuxcnc: self.linuxcnc.iter().filter(|v| loads(v)).cloned().collect(),
        }
    }
}
