// SPDX-License-Identifier: GPL-2.0-or-later
//! An older INI file: its values, from whichever section contains them, and the keys that were never read.

use crate::carried::{CarriedAxis, CarriedJoint};
use crate::ini::line;
use crate::values::{MM_PER_INCH, Refusal};
use machine::read::ini::{Entry, Ini, IniError, decimal};
use machine::read::near;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Keys of a joint that are copied unchanged.
const KEPT: [&str; 13] = [
    "FERROR",
    "MIN_FERROR",
    "BACKLASH",
    "HOME_SEARCH_VEL",
    "HOME_LATCH_VEL",
    "HOME_FINAL_VEL",
    "HOME_USE_INDEX",
    "HOME_INDEX_NO_ENCODER_RESET",
    "HOME_IGNORE_LIMITS",
    "HOME_IS_SHARED",
    "HOME_ABSOLUTE_ENCODER",
    "VOLATILE_HOME",
    "MAX_JERK",
];

/// Speed and acceleration if the file has none: LinuxCNC's defaults, in units per second (squared).
const USUAL: f64 = 1.0;

/// Distance of a simulated drive before its switch, in mm and degrees.
const BEFORE_SWITCH: [f64; 2] = [30.0, 10.0];

impl From<IniError> for Refusal {
    fn from(error: IniError) -> Self {
        Self::Input(error.to_string())
    }
}

/// A pose at home that the file gives.
pub struct NamedHome {
    pub place: [f64; 3],
    /// Whether A, B and C are 0.
    pub is_level: bool,
    /// Name of its key, for messages.
    pub name: &'static str,
}

/// An older INI file, with the keys read so far.
pub struct OldIni {
    pub ini: Ini,
    /// Whether joints and axes share sections, as in `[AXIS_0]`.
    pub is_of_axes: bool,
    /// Sections and keys that were read.
    used: RefCell<BTreeSet<(String, String)>>,
    /// Values chosen instead of missing ones, and their joints.
    chosen: RefCell<BTreeMap<String, Vec<String>>>,
}

impl OldIni {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read, or LinuxCNC's readers interpret a line differently.
    pub fn read(file: &Path) -> Result<Self, Refusal> {
        let ini = Ini::read(file)?;
        let is_of_axes = !ini.sections().any(|name| name.starts_with("JOINT_"));
        Ok(Self { ini, is_of_axes, used: RefCell::default(), chosen: RefCell::default() })
    }

    /// Returns the name of a joint's section.
    pub fn joint_section(&self, n: usize) -> String {
        format!("{}_{n}", if self.is_of_axes { "AXIS" } else { "JOINT" })
    }

    pub fn has_section(&self, name: &str) -> bool {
        self.ini.sections().any(|known| known == name)
    }

    fn mark(&self, section: &str, key: &str) {
        self.used.borrow_mut().insert((section.into(), key.into()));
    }

    /// Notes a value chosen for a joint, or for the whole machine with an empty name.
    pub fn choose(&self, text: &str, joint: String) {
        self.chosen.borrow_mut().entry(text.into()).or_default().push(joint);
    }

    /// Returns all chosen values, one line each.
    pub fn chosen(&self) -> Vec<String> {
        let of = |(text, joints): (&String, &Vec<String>)| match joints.concat().is_empty() {
            true => text.clone(),
            false => format!("{text}: joint {}", joints.join(", ")),
        };
        self.chosen.borrow().iter().map(of).collect()
    }

    /// Returns the entry of a key, which may be missing but not repeated.
    pub fn entry(&self, section: &str, key: &str) -> Result<Option<&Entry>, Refusal> {
        self.mark(section, key);
        match self.ini.all(section, key).is_empty() {
            true => Ok(None),
            false => Ok(Some(self.ini.require(section, key, "")?)),
        }
    }

    pub fn word(&self, section: &str, key: &str) -> Result<Option<&str>, Refusal> {
        let entry = self.entry(section, key)?;
        Ok(entry.map(|entry| entry.value.as_str()).filter(|word| !word.is_empty()))
    }

    pub fn number(&self, section: &str, key: &str) -> Result<Option<f64>, Refusal> {
        self.mark(section, key);
        Ok(self.ini.numbers::<1>(section, key)?.map(|[number]| number))
    }

    /// Returns the value of the first of several keys that the file has: LinuxCNC renamed them.
    pub fn number_of(&self, section: &str, keys: &[&str]) -> Result<Option<f64>, Refusal> {
        let mut found = None;
        for key in keys {
            let number = self.positive(section, key)?;
            found = found.or(number);
        }
        Ok(found)
    }

    fn positive(&self, section: &str, key: &str) -> Result<Option<f64>, Refusal> {
        let number = self.number(section, key)?;
        if number.is_some_and(|number| !(number > 0.0)) {
            let entry = self.ini.require(section, key, "")?;
            return Err(self.ini.refuse(entry, "expected more than 0").into());
        }
        Ok(number)
    }

    /// Returns the machine units per millimeter.
    ///
    /// # Errors
    /// The unit is missing or unknown.
    pub fn per_mm(&self) -> Result<f64, Refusal> {
        let expected = "expected mm or inch: lengths mean nothing without their unit; add the line, with the unit that the \
                        machine was measured in";
        self.mark("TRAJ", "LINEAR_UNITS");
        let entry = self.ini.require("TRAJ", "LINEAR_UNITS", expected)?;
        if let Some(angular) = self.entry("TRAJ", "ANGULAR_UNITS")?
            && !["degree", "deg"].contains(&angular.value.as_str())
        {
            return Err(self
                .ini
                .refuse(angular, "expected degree: convert all angles first")
                .into());
        }
        match entry.value.as_str() {
            "mm" | "metric" => Ok(1.0),
            "inch" | "in" | "imperial" => Ok(1.0 / MM_PER_INCH),
            _ => Err(self.ini.refuse(entry, expected).into()),
        }
    }

    /// Reads the limits of a section, `None` if it has neither.
    fn limits(&self, section: &str) -> Result<Option<[f64; 2]>, Refusal> {
        let [low, high] = ["MIN_LIMIT", "MAX_LIMIT"].map(|key| self.number(section, key));
        let (low, high) = match (low?, high?) {
            (Some(low), Some(high)) => (low, high),
            (None, None) => return Ok(None),
            (low, _) => {
                let key = if low.is_none() { "MIN_LIMIT" } else { "MAX_LIMIT" };
                return Err(self.ini.error(section, key, None, "expected both limits").into());
            }
        };
        if low < high {
            return Ok(Some([low, high]));
        }
        let text = format!("expected less than MAX_LIMIT = {high}");
        let entry = self.ini.require(section, "MIN_LIMIT", &text)?;
        Err(self.ini.refuse(entry, &text).into())
    }

    /// Reads speed and acceleration of a section, or LinuxCNC's defaults.
    fn motion(&self, section: &str, n: usize) -> Result<[f64; 2], Refusal> {
        let of = |key: &str| -> Result<f64, Refusal> {
            let number = self.positive(section, key)?;
            if number.is_none() {
                let text = format!("{key} is {USUAL}, which LinuxCNC takes where a file has none");
                self.choose(&text, n.to_string());
            }
            Ok(number.unwrap_or(USUAL))
        };
        Ok([of("MAX_VELOCITY")?, of("MAX_ACCELERATION")?])
    }

    /// Reads the joint of leg `n`, or of an extra axis with its letter.
    pub fn joint(
        &self,
        n: usize,
        letter: Option<char>,
        is_angle: bool,
    ) -> Result<CarriedJoint, Refusal> {
        let section = self.joint_section(n);
        if !self.has_section(&section) {
            let text = format!(
                "expected a section for joint {n}: the machine has one for every leg; copy that of another leg and \
                 correct its values"
            );
            return Err(self.ini.refuse_section(&section, &text).into());
        }
        let range = match (self.limits(&section)?, letter) {
            (Some(limits), _) => limits,
            (None, Some(letter)) => {
                let axis = format!("AXIS_{letter}");
                let expected = format!("expected limits of joint {n}, here or in [{axis}]");
                let limits = self.limits(&axis)?;
                limits.ok_or_else(|| self.ini.error(&section, "MIN_LIMIT", None, &expected))?
            }
            (None, None) => {
                let expected = "expected the smallest value of the leg's drive, and MAX_LIMIT";
                return Err(self.ini.error(&section, "MIN_LIMIT", None, expected).into());
            }
        };
        if letter.is_none() && is_angle {
            self.check_turn(&section, range)?;
        }
        let motion = self.motion(&section, n)?;
        let home = self.number(&section, "HOME")?.unwrap_or(0.0);
        let lines = self.joint_lines(n, &section, (range, home, is_angle))?;
        let kind = if is_angle { "ANGULAR" } else { "LINEAR" };
        self.mark(&section, "TYPE");
        Ok(CarriedJoint { kind, home, range, motion, lines })
    }

    /// Rejects limits of an arm beyond half a turn, where its joint value is discontinuous.
    fn check_turn(&self, section: &str, range: [f64; 2]) -> Result<(), Refusal> {
        for (key, limit) in ["MIN_LIMIT", "MAX_LIMIT"].into_iter().zip(range) {
            if limit.abs() >= 180.0 {
                let text =
                    "expected more than -180 and less than 180 degrees, as far as the arm can turn";
                return Err(self.ini.refuse(self.ini.require(section, key, text)?, text).into());
            }
        }
        Ok(())
    }

    /// Collects the lines for following errors, homing and drives.
    fn joint_lines(
        &self,
        n: usize,
        section: &str,
        ([min, max], home, is_angle): ([f64; 2], f64, bool),
    ) -> Result<String, Refusal> {
        let mut lines = String::new();
        for key in KEPT {
            if let Some(word) = self.word(section, key)? {
                lines += &format!("{key} = {word}\n");
            }
        }
        if self.number(section, "FERROR")?.is_none() {
            self.choose(
                "FERROR is four servo cycles at the largest speed, for the file has none",
                n.to_string(),
            );
        }
        let search = self.number(section, "HOME_SEARCH_VEL")?.unwrap_or(0.0);
        match self.number(section, "HOME_OFFSET")? {
            // The joint is at home when it is homed; HOME now has more digits.
            Some(offset) if offset == home && search == 0.0 => lines += AT_HOME,
            Some(offset) => lines += &line("HOME_OFFSET", &[offset]),
            None => {}
        }
        let sequence = self.number(section, "HOME_SEQUENCE")?;
        match sequence {
            // Before joints and axes, this value excluded a joint from homing.
            Some(-1.0) if self.is_of_axes => {}
            Some(sequence) => lines += &line("HOME_SEQUENCE", &[sequence]),
            None => {}
        }
        if sequence.is_none() || (self.is_of_axes && sequence == Some(-1.0)) {
            self.choose("HOME_SEQUENCE is 0, for the file has none", n.to_string());
            lines += "HOME_SEQUENCE = 0\n";
        }
        if search != 0.0 {
            let switch = self.number(section, "HOME_OFFSET")?.unwrap_or(0.0);
            let before =
                if is_angle { BEFORE_SWITCH[1] } else { BEFORE_SWITCH[0] * self.per_mm()? };
            let start = switch - search.signum() * before.min(0.25 * (max - min));
            lines += &line("SIM_START", &[(start.clamp(min, max) * 1e6).round() / 1e6]);
        }
        let of_drives = self.ini.entries().filter(|entry| {
            let key = entry.key.as_str();
            let is_of_linuxcnc = key == "CYCLE_TIME"
                || ["JOINT_0", "AXIS_X"].iter().any(|of| near::is_of_linuxcnc(of, key));
            entry.section == section && !KEPT.contains(&key) && !is_of_linuxcnc
        });
        let of_drives: BTreeSet<&str> = of_drives.map(|entry| entry.key.as_str()).collect();
        for key in of_drives {
            if let Some(word) = self.word(section, key)? {
                lines += &format!("{key} = {word}\n");
            }
        }
        Ok(lines)
    }

    /// Reads the axis of a letter, with `usual` if the file has no speeds for it.
    pub fn axis(&self, letter: char, usual: [f64; 2]) -> Result<CarriedAxis, Refusal> {
        let section = format!("AXIS_{letter}");
        let limits = self.limits(&section)?;
        let speed = self.positive(&section, "MAX_VELOCITY")?.unwrap_or(usual[0]);
        let acceleration = self.positive(&section, "MAX_ACCELERATION")?.unwrap_or(usual[1]);
        self.mark(&section, "TYPE");
        Ok(CarriedAxis { letter, limits, motion: [speed, acceleration] })
    }

    /// Reads `[TRAJ]HOME`, or if it is missing the HOME of the axes X Y Z.
    pub fn home(&self) -> Result<Option<NamedHome>, Refusal> {
        if let Some(entry) = self.entry("TRAJ", "HOME")?.filter(|entry| !entry.value.is_empty()) {
            let expected = "expected 3 to 9 decimal numbers separated by blanks";
            let numbers = self.ini.number_list(entry).filter(|list| (3..=9).contains(&list.len()));
            let numbers = numbers.ok_or_else(|| self.ini.refuse(entry, expected))?;
            let is_level = numbers.iter().skip(3).take(3).all(|angle| *angle == 0.0);
            let place = [numbers[0], numbers[1], numbers[2]];
            return Ok(Some(NamedHome { place, is_level, name: "[TRAJ]HOME" }));
        }
        let mut home = [None; 3];
        for (home, letter) in home.iter_mut().zip(["X", "Y", "Z"]) {
            *home = self.number(&format!("AXIS_{letter}"), "HOME")?;
        }
        let is_given = home.iter().any(Option::is_some);
        let place = home.map(Option::unwrap_or_default);
        Ok(is_given.then_some(NamedHome { place, is_level: true, name: "HOME of the axes" }))
    }

    /// Returns half a unit of the last digit of a joint's HOME, its rounding.
    pub fn rounding(&self, n: usize) -> f64 {
        let word = self.ini.first(&self.joint_section(n), "HOME").map_or("", |entry| &entry.value);
        match (decimal(word), word.split_once('.')) {
            (Some(_), Some((_, digits))) if digits.bytes().all(|byte| byte.is_ascii_digit()) => {
                0.500_001 * 10_f64.powi(-(digits.len() as i32))
            }
            _ => 0.0,
        }
    }

    /// Returns the path of a file that a key names.
    pub fn file(&self, section: &str, key: &str) -> Result<Option<PathBuf>, Refusal> {
        let name = self.word(section, key)?;
        Ok(name.map(|name| machine::read::places::named(self.ini.file(), name)))
    }

    /// Marks keys as read, so that they are not listed as left out.
    pub fn pass(&self, keys: &[(&str, &str)]) {
        for (section, key) in keys {
            self.mark(section, key);
        }
    }

    /// Lists the keys that were not read, a line for each section.
    pub fn left_out(&self) -> Vec<String> {
        let used = self.used.borrow();
        let mut left: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
        for entry in self.ini.entries() {
            if !used.contains(&(entry.section.clone(), entry.key.clone())) {
                let keys = left.entry(&entry.section).or_default();
                if !keys.contains(&entry.key.as_str()) {
                    keys.push(&entry.key);
                }
            }
        }
        left.into_iter().map(|(section, keys)| format!("[{section}] {}", keys.join(", "))).collect()
    }
}

/// Line that replaces HOME_OFFSET if it equals the joint's HOME.
pub const AT_HOME: &str = "HOME_OFFSET = HOME\n";
