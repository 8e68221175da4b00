// SPDX-License-Identifier: GPL-2.0-or-later
//! Values of the module's pins, as `pkmkins-pins` prints them for `hal/pkmkins.tcl`.
//!
//! The table of keys names the pin of each key. This module adds the values that do not come from a single key: the
//! lead of a strut, the reference pose, the planner's limits.

use crate::read::constraints::constraint_section;
use crate::read::error::{MachineError, chain_section};
use crate::read::ini::{Ini, decimal};
use crate::read::machine::{Lenient, MachineConfig, load, moved_letters};
use crate::read::mechanism::Mechanism;
use crate::read::place::leg_section;
use keys::{Key, Range, chain, constraint, joint, leg, machine, second, workspace_box};
use kinematics::{LegKind, Letter, Load, POSE_LETTERS, Second};
use std::ffi::OsStr;
use std::fmt::Write;
use std::path::Path;

/// Sections and keys that determine the machine, as patterns of Tcl. `hal/pkmkins.tcl` refuses a file if LinuxCNC has
/// read a different value.
const COMPARED: [(&str, &str); 12] = [
    ("KINS", "*"),
    ("TRAJ", "*"),
    ("DISPLAY", "MAX_FEED_OVERRIDE"),
    ("PKM", "*"),
    ("SECOND", "*"),
    ("LEG_*", "*"),
    ("CONSTRAINT_*", "*"),
    ("CHAIN_*", "*"),
    ("JOINT_*", "*"),
    ("AXIS_*", "*"),
    ("BOX_*", "*"),
    ("SECOND_BOX_*", "*"),
];

/// Suffix that LinuxCNC's start script appends to the name of a file whose `#INCLUDE` lines it has expanded.
const EXPANDED: &str = "expanded";

/// Returns the text for a machine's INI file: the version, the values that were read, the pins and an end mark.
///
/// # Errors
/// As [`MachineConfig::read`], for a file that LinuxCNC may start in the identity.
pub fn printed(file: &Path, version: &str) -> Result<String, MachineError> {
    let ini = read(file)?;
    let config = MachineConfig::leniently(&ini, Some(Lenient::Identity))?;
    let mut text = format!("version {version}\n");
    let patterns = COMPARED.map(|(section, key)| format!("{section} {key}")).join(" ");
    text += &format!("compared {patterns}\n");
    for (section, key, value) in ini.as_haltcl() {
        let is_compared =
            |(names, keys): &(&str, &str)| is_like(names, section) && is_like(keys, key);
        if COMPARED.iter().any(is_compared) {
            // LinuxCNC reads other characters here.
            if value.contains(char::REPLACEMENT_CHARACTER) {
                ini.editable()?;
            }
            text += &format!("ini {section} {key}={value}\n");
        }
    }
    let mut pins = Pins { ini: &ini, text };
    pins.all(&config, &load(&ini)?);
    Ok(pins.text + "end\n")
}

/// Returns whether a name matches a pattern with at most one `*`, at its end.
fn is_like(pattern: &str, name: &str) -> bool {
    pattern.strip_suffix('*').map_or(pattern == name, |start| name.starts_with(start))
}

/// Reads an INI file. If LinuxCNC's start script has expanded it, reads the original if it has the same
/// values, so that errors name its lines.
fn read(file: &Path) -> Result<Ini, MachineError> {
    let given = Ini::read(file)?;
    if file.extension() != Some(OsStr::new(EXPANDED)) || !file.with_extension("").exists() {
        return Ok(given);
    }
    let original = Ini::read(&file.with_extension(""))?;
    let is_same = original.as_haltcl().eq(given.as_haltcl());
    Ok(if is_same { original } else { given })
}

struct Pins<'a> {
    ini: &'a Ini,
    text: String,
}

impl Pins<'_> {
    fn all(&mut self, config: &MachineConfig, load: &Load) {
        self.section("PKM", machine::ALL, "");
        self.section("SECOND", second::ALL, "");
        for n in 0..config.guarded_joints() {
            self.section(&format!("JOINT_{n}"), joint::ALL, &n.to_string());
        }
        for letter in load.extra.letters() {
            let number = letter.to_ascii_lowercase().to_string();
            self.section(&chain_section(letter), chain::ALL, &number);
        }
        for n in 0..load.layout.constraints() {
            self.section(&constraint_section(n), constraint::ALL, &n.to_string());
        }
        for mechanism in &config.mechanisms {
            self.mechanism(mechanism);
        }
        self.leads(config);
        let [x, y, z, a, b, c, ..] = config.world_home;
        self.letters("home", [x, y, z, a, b, c]);
        if let Some(second) = config.mechanisms.get(1) {
            self.letters("second.home", second.start);
        }
        self.planner(load);
    }

    fn pin(&mut self, name: &str, value: f64) {
        // Very large and very small numbers get an exponent.
        let text = format!("{value:?}");
        let text = text.strip_suffix(".0").unwrap_or(&text);
        writeln!(self.text, "pin {name} {text}").expect("a string takes everything");
    }

    fn letters(&mut self, name: &str, values: [f64; 6]) {
        for (letter, value) in Letter::ALL.into_iter().zip(values) {
            self.pin(&format!("{name}.{}", letter.name().to_ascii_lowercase()), value);
        }
    }

    /// Prints the pins of a section except leads; `number` is that of its leg, joint or box, or the letter of its axis.
    fn section(&mut self, section: &str, keys: &[&Key], number: &str) {
        let stem = if section.starts_with("SECOND_BOX_") { "second." } else { "" };
        let is_lead = |key: &Key| [leg::LEAD, machine::SCREW_LEAD].contains(key);
        for key in keys.iter().filter(|key| !key.pin.is_empty() && !is_lead(key)) {
            let pin = format!("{stem}{}", key.pin.replace(['N', 'K', 'L'], number));
            let absent = key.absent.map(|value| vec![value.into()]);
            let values = self.values(section, key).or(absent).unwrap_or_default();
            for (n, value) in values.into_iter().enumerate() {
                match key.parts.get(n) {
                    Some(part) => self.pin(&format!("{pin}.{part}"), value),
                    None => self.pin(&pin, value),
                }
            }
        }
    }

    /// Returns the numbers that a key gives to its pins.
    fn values(&self, section: &str, key: &Key) -> Option<Vec<f64>> {
        let entry = *self.ini.all(section, key.name).first()?;
        let values = match key.range {
            Range::Hash => keys::hash(&entry.value).map(|hash| vec![hash.into()]),
            Range::Word(words) => {
                let place = words.iter().position(|word| *word == entry.value);
                place.map(|place| vec![(place + 1) as f64])
            }
            _ => self.ini.number_list(entry),
        };
        Some(values.expect("the reader has checked the value"))
    }

    fn mechanism(&mut self, mechanism: &Mechanism) {
        let place = &mechanism.place;
        for n in place.first_leg..place.first_leg + mechanism.legs() {
            self.section(&leg_section(n), leg::ALL, &n.to_string());
        }
        let stem = if place.is_second { "second." } else { "" };
        for (k, section) in mechanism.boxes.iter().enumerate() {
            self.section(&place.box_section(k), workspace_box::ALL, &k.to_string());
            for letter in mechanism.machine.layout().coordinates().as_slice() {
                let row = section.claim.region.matrix[letter.index()];
                let letter = letter.name().to_ascii_lowercase();
                for (n, value) in row.into_iter().take(mechanism.legs()).enumerate() {
                    self.pin(&format!("{stem}box.{k}.matrix.{letter}.{n}"), value);
                }
            }
        }
    }

    /// Prints the leads of struts. A pin lead.N of 0 means screw-lead, but a key LEAD = 0 means no lead: if any leg has
    /// a LEAD, every strut gets its own pin.
    fn leads(&mut self, config: &MachineConfig) {
        let legs = || config.mechanisms.iter().flat_map(|one| one.geometry.legs()).enumerate();
        if legs().all(|(n, _)| self.ini.all(&leg_section(n), leg::LEAD.name).is_empty()) {
            if let Some(lead) = self.values("PKM", &machine::SCREW_LEAD) {
                self.pin(machine::SCREW_LEAD.pin, lead[0]);
            }
            return;
        }
        self.pin(machine::SCREW_LEAD.pin, 0.0);
        for (n, leg) in legs() {
            if let LegKind::Strut(strut) = leg.kind {
                self.pin(&leg::LEAD.pin.replace('N', &n.to_string()), strut.lead);
            }
        }
    }

    /// Prints what the planner may ask for, as far as the file gives it: LinuxCNC's other defaults are the module's.
    fn planner(&mut self, load: &Load) {
        let second = || load.second().into_iter().flat_map(Second::places);
        // A slide that carries something also limits the tool.
        let is_linear = |letter: &char| match letter {
            'X' | 'Y' | 'Z' => true,
            'U' | 'V' | 'W' => {
                second().any(|place| POSE_LETTERS[place] == *letter)
                    || self.ini.sections().any(|name| name == chain_section(*letter))
            }
            _ => false,
        };
        let is_angular = |letter: &char| ('A'..='C').contains(letter);
        let linear =
            self.accelerations("MAX_LINEAR_ACCELERATION", moved_letters(load).filter(is_linear));
        let angular =
            self.accelerations("MAX_ANGULAR_ACCELERATION", moved_letters(load).filter(is_angular));
        let most = self.positive("DISPLAY", "MAX_FEED_OVERRIDE");
        for (name, value) in [
            ("linear-acceleration", linear),
            ("angular-acceleration", angular),
            ("max-override", most),
        ] {
            if let Some(value) = value {
                self.pin(name, value);
            }
        }
        // Moves of these axes alone, or with the others, brake as slowly as they do.
        for letter in load.extra.letters() {
            if let Some(value) = self.positive(&format!("AXIS_{letter}"), "MAX_ACCELERATION") {
                self.pin(&format!("extra-acceleration.{}", letter.to_ascii_lowercase()), value);
            }
        }
    }

    /// Returns the smallest acceleration of a key of `[TRAJ]` and of axes.
    fn accelerations(&self, key: &str, axes: impl Iterator<Item = char>) -> Option<f64> {
        let of_axes = axes.map(|letter| (format!("AXIS_{letter}"), "MAX_ACCELERATION"));
        let all = of_axes.chain([("TRAJ".into(), key)]);
        all.filter_map(|(section, key)| self.positive(&section, key)).reduce(f64::min)
    }

    /// Returns the first number of a key, if it is positive.
    fn positive(&self, section: &str, key: &str) -> Option<f64> {
        let word = self.ini.first(section, key)?.words().next()?;
        decimal(word).filter(|value| *value > 0.0)
    }
}
