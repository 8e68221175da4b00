// SPDX-License-Identifier: GPL-2.0-or-later
//! `[BOX_K]` sections: pose boxes for the start without a seed, with the values
//! that their proof needs.

use crate::read::error::MachineError;
use crate::read::ini::{Ini, IniError};
use crate::read::place::Place;
use keys::{ROW, workspace_box};
use kinematics::{Cause, Fault, Letter, Load, WorkspaceBox};
use std::fmt::Write;

/// A pose box with the values that its proof needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Claim {
    /// The box.
    pub region: WorkspaceBox,
    /// Weight of each coordinate in the norm: per machine unit, per degree.
    pub weight: [f64; 6],
    /// Claimed upper bound c of ‖1 − M J‖.
    pub contraction: f64,
}

/// One `[BOX_K]` section.
#[derive(Clone, Debug, PartialEq)]
pub struct BoxSection {
    /// Its claim.
    pub claim: Claim,
    /// Hash of the geometry for which it was proved.
    pub geometry: u32,
}

/// Reads the `[BOX_K]` sections of a mechanism, as many as `boxes=` or `second_boxes=` states; `load` and `hash` are
/// those of the mechanism.
///
/// # Errors
/// A section or key is missing, unknown or malformed, or the module refuses a box.
pub fn read(
    ini: &Ini,
    load: &Load,
    place: &Place,
    hash: u32,
) -> Result<Vec<BoxSection>, MachineError> {
    let names: Vec<String> = (0..load.boxes()).map(|k| place.box_section(k)).collect();
    for name in ini.sections().filter(|name| name.starts_with(place.box_prefix())) {
        if !names.iter().any(|own| own == name) {
            let expected = format!(
                "extra section: remove it, or raise the count; [KINS]KINEMATICS has {}={}",
                place.boxes_parameter(),
                load.boxes()
            );
            return Err(ini.refuse_section(name, &expected).into());
        }
    }
    let all = names.iter().map(|name| section(ini, name, load)).collect::<Result<Vec<_>, _>>()?;
    for (k, section) in all.iter().enumerate() {
        let cause = match section.claim.region.is_valid() {
            false => Cause::BoxInvalid,
            true if section.geometry != hash => Cause::BoxOfOther,
            true => continue,
        };
        return Err(refused(ini, &names[k], Fault::with_value(cause, k as f64), hash));
    }
    Ok(all)
}

/// Returns the refusal of a box, at its line; `hash` is that of the machine.
fn refused(ini: &Ini, name: &str, fault: Fault, hash: u32) -> MachineError {
    let expected = format!(
        "the box was proved for another geometry than this one, {hash:#010x}, so LinuxCNC does not start; when the \
         geometry is right, run pkm boxes --write {} to prove and write the boxes again",
        ini.file().display()
    );
    let error = match ini.first(name, workspace_box::GEOMETRY.name) {
        Some(entry) if fault.cause == Cause::BoxOfOther => ini.refuse(entry, &expected),
        _ => ini.refuse_section(name, &fault.to_string()),
    };
    MachineError::Geometry(ini.file().into(), fault, Some(error))
}

fn row(letter: Letter) -> String {
    format!("{ROW}{}", letter.name())
}

fn section(ini: &Ini, name: &str, load: &Load) -> Result<BoxSection, IniError> {
    let letters = load.layout.coordinates().as_slice();
    let rows: Vec<String> = letters.iter().map(|letter| row(*letter)).collect();
    let mut known: Vec<&str> = workspace_box::ALL.iter().map(|key| key.name).collect();
    known.extend(rows.iter().map(String::as_str));
    ini.check_section(name, &known)?;
    let legs = load.layout.legs();
    let mut matrix = [[0.0; 8]; 6];
    for (letter, key) in letters.iter().zip(&rows) {
        let expected = format!("expected {legs} decimal numbers separated by spaces");
        let entry = ini.require(name, key, &expected)?;
        let values = ini.number_list(entry).filter(|values| values.len() == legs);
        let values = values.ok_or_else(|| ini.refuse(entry, &expected))?;
        matrix[letter.index()][..legs].copy_from_slice(&values);
    }
    let contraction = ini.require_value(name, &workspace_box::CONTRACTION)?;
    let region = WorkspaceBox {
        low: ini.require_values(name, &workspace_box::LOW)?,
        high: ini.require_values(name, &workspace_box::HIGH)?,
        matrix,
        steps: ini.require_value(name, &workspace_box::STEPS)? as u32,
    };
    let weight = ini.require_values(name, &workspace_box::WEIGHT)?;
    let claim = Claim { region, weight, contraction };
    Ok(BoxSection { claim, geometry: ini.require_hash(name, &workspace_box::GEOMETRY)? })
}

/// Returns the text of the section of this name for an INI file.
pub fn text(name: &str, section: &BoxSection, load_letters: &[Letter], legs: usize) -> String {
    let BoxSection { claim, geometry } = section;
    let list = |values: &[f64]| values.iter().map(|x| x.to_string()).collect::<Vec<_>>().join(" ");
    let mut text = format!("[{name}]\n");
    let mut line = |key: &str, value: String| {
        writeln!(text, "{key} = {value}").expect("a string takes everything");
    };
    line(workspace_box::LOW.name, list(&claim.region.low));
    line(workspace_box::HIGH.name, list(&claim.region.high));
    for letter in load_letters {
        line(&row(*letter), list(&claim.region.matrix[letter.index()][..legs]));
    }
    line(workspace_box::STEPS.name, claim.region.steps.to_string());
    line(workspace_box::WEIGHT.name, list(&claim.weight));
    line(workspace_box::CONTRACTION.name, claim.contraction.to_string());
    line(workspace_box::GEOMETRY.name, format!("{geometry:#010x}"));
    text
}
