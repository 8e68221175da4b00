// SPDX-License-Identifier: GPL-2.0-or-later
//! Corrections by a check, as a new text of the file: HOMEs, axis limits, the order of homing and
//! pose boxes. Comments and order stay, and no file is written here.

use crate::findings::Report;
use crate::homing::{self, TOGETHER, Trouble};
use crate::report;
use crate::workspace::MOST;
use kinematics::{Fault, Letter};
use machine::digits::plain;
use machine::proof::axis_box::AxisBox;
use machine::proof::boxes as proof;
use machine::read::boxes;
use machine::read::edit::{Edit, Elsewhere, entered, with_ends, with_sections};
use machine::read::error::MachineError;
use machine::read::ini::{Ini, IniError};
use machine::read::machine::{Lenient, MachineConfig};
use machine::read::mechanism::Mechanism;
use std::path::Path;

/// Tolerated difference between HOME and the kinematics, as a share of the machine's size (of 1 degree for arms), for
/// digits that a file in plain decimals cannot represent: far below the resolution of any encoder.
const DIGITS: f64 = 1e-12;

/// Why a correction failed.
#[derive(Debug, thiserror::Error)]
pub enum FixError {
    #[error(transparent)]
    Elsewhere(#[from] Elsewhere),
    #[error(transparent)]
    Machine(#[from] MachineError),
    #[error(transparent)]
    Home(#[from] Fault),
}

impl From<IniError> for FixError {
    fn from(error: IniError) -> Self {
        Self::Machine(error.into())
    }
}

/// A new text of a machine's file.
#[derive(Clone, Debug, PartialEq)]
pub struct Fixed {
    pub text: String,
    /// Uncorrected problems, and the reasons.
    pub left: Vec<String>,
}

/// Corrects as much as possible. Boxes are proved again, which takes seconds to minutes; `progress` receives
/// the current task.
///
/// # Errors
/// See [`FixError`].
pub fn fixed(config: &MachineConfig, mut progress: impl FnMut(&str)) -> Result<Fixed, FixError> {
    let file = &config.file;
    progress("homes");
    let old = config.ini.editable()?;
    let mut text = entered(old, &homes(config)?)?;
    // The following corrections depend on them.
    let homed = machine(file, &text)?;
    progress("homing");
    text = entered(&text, &homings(&homed)?)?;
    progress("searching for pose boxes");
    text = axes(&homed, text)?;
    progress("proving the boxes");
    let found = boxed(file, text)?;
    Ok(Fixed { text: with_ends(old, found.text), ..found })
}

/// Returns the machine of a text, even with refused boxes, or with constraints.
///
/// # Errors
/// The text describes no machine.
pub fn machine(file: &Path, text: &str) -> Result<MachineConfig, MachineError> {
    MachineConfig::leniently(&Ini::parse(file, text)?, Some(Lenient::Report))
}

/// Returns HOME of the joints, with all digits of the kinematics, and of axes that have one.
fn homes(config: &MachineConfig) -> Result<Vec<Edit>, FixError> {
    let mut edits = vec![];
    for mechanism in &config.mechanisms {
        let wanted = mechanism.machine.inverse(&mechanism.home_pose(), &mechanism.spindle)?;
        for (i, (joint, wanted)) in mechanism.joints.iter().zip(wanted).enumerate() {
            let section = mechanism.place.joint_section(i);
            let is_given = config.ini.first(&section, "HOME").is_some();
            if !has_all_digits(mechanism, joint.home, wanted) || !is_given {
                edits.push(Edit { section, key: "HOME", value: plain(wanted).to_string() });
            }
        }
        for letter in moved(mechanism) {
            let section = mechanism.place.axis_section(letter);
            let home = mechanism.start[letter.index()];
            if config.ini.number_or(&section, "HOME", home)? != home {
                edits.push(Edit { section, key: "HOME", value: plain(home).to_string() });
            }
        }
    }
    Ok(edits)
}

/// Returns whether HOME of a joint is what the kinematics want, but for digits that plain decimals cannot represent.
pub(crate) fn has_all_digits(mechanism: &Mechanism, home: f64, wanted: f64) -> bool {
    (home - wanted).abs() <= DIGITS * mechanism.machine.size().max(1.0)
}

fn moved(config: &Mechanism) -> impl Iterator<Item = Letter> {
    Letter::ALL.into_iter().filter(|letter| !config.machine.layout().is_held(*letter))
}

/// Makes all joints of legs home together, if this keeps limits that the order of the file violates.
fn homings(config: &MachineConfig) -> Result<Vec<Edit>, FixError> {
    let mut edits = vec![];
    for mechanism in &config.mechanisms {
        let troubles = homing::check(&config.ini, mechanism)?;
        let is_order = |trouble: &Trouble| !matches!(trouble, Trouble::Switch(..));
        if !troubles.iter().any(is_order) || !homing::is_kept_together(&config.ini, mechanism)? {
            continue;
        }
        edits.extend((0..mechanism.joints.len()).map(|i| Edit {
            section: mechanism.place.joint_section(i),
            key: "HOME_SEQUENCE",
            value: TOGETHER.to_string(),
        }));
    }
    Ok(edits)
}

/// Replaces axis limits that are missing or mostly out of reach by proved ones.
fn axes(config: &MachineConfig, mut text: String) -> Result<String, FixError> {
    for mechanism in &config.mechanisms {
        let report = report::check(config, mechanism, |_| ())?;
        let Some(limits) = suggested(mechanism, &report) else { continue };
        let of = |letter: Letter, ends: [f64; 6]| ends[letter.index()];
        for letter in moved(mechanism) {
            let section = mechanism.place.axis_section(letter);
            if !mechanism.ini.sections().any(|name| name == section) {
                let kind = if letter.is_angle() { "ANGULAR" } else { "LINEAR" };
                text = format!("{}\n\n[{section}]\nTYPE = {kind}\n", text.trim_end());
            }
            let edit = |key, value: f64| Edit {
                section: section.clone(),
                key,
                value: plain(value).to_string(),
            };
            let edits = [
                edit("MIN_LIMIT", of(letter, limits.low)),
                edit("MAX_LIMIT", of(letter, limits.high)),
            ];
            text = entered(&text, &edits)?;
        }
    }
    Ok(text)
}

/// Returns the proved limits, if those of the file are of little use. If axes carry something, the proved limits
/// are not those of programmed coordinates.
fn suggested(config: &Mechanism, report: &Report) -> Option<AxisBox> {
    let axis = |letter: Letter| &config.programmed[letter.index()];
    let is_open = moved(config).any(|l| axis(l).min.is_infinite() || axis(l).max.is_infinite());
    let is_useless = report.taken.is_some_and(|taken| taken < MOST);
    // Limits that stop a coordinate correct nothing.
    let moves =
        |limits: &AxisBox| moved(config).all(|l| limits.low[l.index()] < limits.high[l.index()]);
    report.suggestion.filter(moves).filter(|_| config.chain.is_empty() && (is_open || is_useless))
}

/// Proves boxes of an older geometry again for the new text.
fn boxed(file: &Path, text: String) -> Result<Fixed, FixError> {
    let config = machine(file, &text)?;
    let mut fixed = Fixed { text, left: vec![] };
    for mechanism in config.mechanisms.iter().filter(|one| one.refused_boxes.is_some()) {
        match proof::found(mechanism, &|_| ()) {
            Ok(found) => {
                let sections: Vec<_> = found.into_iter().map(|(section, _)| section).collect();
                fixed.text = rewritten(&fixed.text, mechanism, &sections)?;
            }
            Err(doubt) => fixed.left.push(format!("no boxes could be proved: {doubt}")),
        }
    }
    Ok(fixed)
}

/// Replaces the boxes of a mechanism in a text.
///
/// # Errors
/// They are in an included file.
pub fn rewritten(
    text: &str,
    config: &Mechanism,
    found: &[boxes::BoxSection],
) -> Result<String, Elsewhere> {
    let letters = config.machine.layout().coordinates().as_slice();
    let section = |(k, section): (usize, &boxes::BoxSection)| {
        boxes::text(&config.place.box_section(k), section, letters, config.legs())
    };
    let sections: Vec<String> = found.iter().enumerate().map(section).collect();
    let names = (config.place.box_prefix(), config.place.boxes_parameter());
    Ok(with_ends(text, with_sections(text, names, &sections)?))
}
