// SPDX-License-Identifier: GPL-2.0-or-later
//! The INI file with another geometry: all other lines, comments and layout are kept.

use super::model::{Model, Quantity};
use keys::{constraint, leg};
use kinematics::{ConstraintGeometry, Fault, Geometry, LegKind, PerLeg};
use machine::files::{AtFile, Locate};
use machine::proof::boxes::found;
use machine::proof::one_to_one::Doubt;
use machine::read::boxes;
use machine::read::edit::{self, Edit, Elsewhere, enter};
use machine::read::error::MachineError;
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use machine::read::mechanism::Mechanism;
use std::path::Path;

/// Decimals of lengths in the file, in millimeters: a nanometer, a thousandth of the measuring accuracy.
const DECIMALS: usize = 6;

/// Why no new file can be written.
#[derive(Debug, thiserror::Error)]
pub enum RewriteError {
    #[error(transparent)]
    Elsewhere(#[from] AtFile<Elsewhere>),
    #[error(transparent)]
    Machine(#[from] MachineError),
    #[error(transparent)]
    Home(#[from] Fault),
    #[error(transparent)]
    Doubt(#[from] Doubt),
}

/// Returns the text of a machine's file with these changes of a model. Removes `boxes=` and the `[BOX_K]` sections,
/// which were proved for the old geometry.
///
/// # Errors
/// See [`RewriteError`].
pub fn calibrated(
    config: &Mechanism,
    model: &Model,
    changes: &[f64],
) -> Result<String, RewriteError> {
    let (geometry, offsets) = model.changed(changes);
    let mut lines: Vec<String> = without_boxes(config.ini.editable().map_err(MachineError::from)?);
    let mut edits = of_legs(model, &geometry, &offsets);
    edits.extend(of_constraints(model, &geometry));
    edits.extend(of_home(config, model, changes)?);
    for edit in &edits {
        enter(&mut lines, edit).at(&config.file)?;
    }
    let new = edit::with_ends(config.ini.text(), lines.join("\n") + "\n");
    read_back(&config.file, &new)?;
    Ok(new)
}

/// Parses the machine of the new text.
///
/// # Errors
/// The text does not describe a machine.
pub(crate) fn read_back(file: &Path, text: &str) -> Result<Mechanism, MachineError> {
    let ini = Ini::parse(file, text)?;
    Ok(MachineConfig::leniently(&ini, Some(Lenient::Constraints))?.first().clone())
}

/// Adds boxes that are proved for the machine of a text.
///
/// # Errors
/// The text does not describe a machine, or no box can be proved.
pub fn with_boxes(file: &Path, old: &str) -> Result<String, RewriteError> {
    let config = read_back(file, old)?;
    let found = found(&config, &|_| ())?;
    let letters = config.machine.layout().coordinates().as_slice();
    let mut text = old
        .lines()
        .map(|line| match line.trim_start().starts_with("KINEMATICS") {
            true => format!("{line} boxes={}\n", found.len()),
            false => format!("{line}\n"),
        })
        .collect::<String>();
    for (k, (section, _)) in found.iter().enumerate() {
        text += &format!(
            "\n{}",
            boxes::text(&config.place.box_section(k), section, letters, config.legs())
        );
    }
    let text = edit::with_ends(old, text);
    read_back(file, &text)?;
    Ok(text)
}

/// Formats the difference of both texts.
pub fn difference(old: &str, new: &str, names: (&str, &str)) -> String {
    edit::difference(old, new, names, 1)
}

fn decimal(value: f64) -> String {
    // Adding 0 avoids "-0".
    format!("{:.DECIMALS$}", value + 0.0)
}

fn list<const N: usize>(values: &[f64; N]) -> String {
    values.map(decimal).join(" ")
}

/// Returns the values of the legs that differ from those of the file.
fn of_legs(model: &Model, geometry: &Geometry, offsets: &PerLeg) -> Vec<Edit> {
    let mut edits = vec![];
    for (n, (old, new)) in model.geometry.legs().iter().zip(geometry.legs()).enumerate() {
        let mut edit = |key, value| edits.push(Edit { section: format!("LEG_{n}"), key, value });
        if old.base != new.base {
            edit(leg::BASE.name, list(&new.base));
        }
        match new.kind {
            _ if old.platform == new.platform => {}
            LegKind::Ring(ring) => {
                edit(leg::EFFECTOR.name, list(&[ring.radius, new.platform[2]]));
            }
            _ => edit(leg::PLATFORM.name, list(&new.platform)),
        }
        if model.offsets[n] != offsets[n] {
            edit(leg::OFFSET.name, decimal(offsets[n]));
        }
        let [rod, drawn] = [new.kind, old.kind].map(|mut kind| kind.rod().copied());
        if let Some(rod) = rod.filter(|_| rod != drawn) {
            edit(leg::ROD.name, decimal(rod));
        }
        let lead = new.kind.screw().lead;
        if lead != old.kind.screw().lead {
            edit(leg::LEAD.name, decimal(lead));
        }
    }
    edits
}

/// Decimals of unit vectors: below the last decimal of a length over a machine's size.
const DIRECTION_DECIMALS: usize = 12;

/// Returns the vectors of the constraints that differ from those of the file.
fn of_constraints(model: &Model, geometry: &Geometry) -> Vec<Edit> {
    let direction = |v: &[f64; 3]| v.map(|x| format!("{:.DIRECTION_DECIMALS$}", x + 0.0)).join(" ");
    let words = |given: &ConstraintGeometry| match given {
        ConstraintGeometry::PointInPlane { platform, base, normal }
        | ConstraintGeometry::PlaneThroughPoint { platform, normal, base } => vec![
            (constraint::PLATFORM.name, list(platform)),
            (constraint::BASE.name, list(base)),
            (constraint::NORMAL.name, direction(normal)),
        ],
        ConstraintGeometry::Square { platform_axis, base_axis } => vec![
            (constraint::PLATFORM_AXIS.name, direction(platform_axis)),
            (constraint::BASE_AXIS.name, direction(base_axis)),
        ],
    };
    let mut edits = vec![];
    let both = model.geometry.constraints().iter().zip(geometry.constraints());
    for (n, (old, new)) in both.enumerate() {
        for ((key, value), (_, old)) in words(new).into_iter().zip(words(old)) {
            if value != old {
                edits.push(Edit { section: format!("CONSTRAINT_{n}"), key, value });
            }
        }
    }
    edits
}

/// Returns HOME of the joints: the same pose, with the new geometry.
fn of_home(config: &Mechanism, model: &Model, changes: &[f64]) -> Result<Vec<Edit>, Fault> {
    if model.number(Quantity::Length(0)).is_none() {
        return Ok(vec![]);
    }
    let joints = model.machine(changes)?.inverse(&config.home_pose(), &config.spindle)?;
    let edit =
        |n: usize| Edit { section: format!("JOINT_{n}"), key: "HOME", value: decimal(joints[n]) };
    Ok((0..config.joints.len())
        .filter(|n| decimal(config.joints[*n].home) != decimal(joints[*n]))
        .map(edit)
        .collect())
}

/// Returns the lines without `[BOX_K]` and `boxes=`; comments are kept.
fn without_boxes(text: &str) -> Vec<String> {
    let mut is_box = false;
    let mut lines = vec![];
    for line in text.lines() {
        if line.trim_start().starts_with('[') {
            is_box = line.trim_start().starts_with("[BOX_");
        }
        let is_kept = !is_box || line.trim().is_empty() || line.trim_start().starts_with('#');
        if is_kept && !(is_box && line.trim().is_empty()) {
            lines.push(without_count(line));
        }
    }
    lines
}

fn without_count(line: &str) -> String {
    if !line.trim_start().starts_with("KINEMATICS") {
        return line.into();
    }
    let kept: Vec<&str> = line.split(' ').filter(|word| !word.starts_with("boxes=")).collect();
    kept.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_of_the_old_geometry_go() {
        let text = "[KINS]\nKINEMATICS = pkmkins legs=strut:6 boxes=1\n\n# Start\n[BOX_0]\nLOW = 1\n\n[JOINT_0]\nHOME = 1\n";
        let lines = without_boxes(text).join("\n");
        assert_eq!(
            lines,
            "[KINS]\nKINEMATICS = pkmkins legs=strut:6\n\n# Start\n[JOINT_0]\nHOME = 1"
        );
    }
}
