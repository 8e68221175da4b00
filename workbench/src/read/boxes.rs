// SPDX-License-Identifier: GPL-2.0-or-later
//! `[BOX_K]` sections: boxes of the workspace for the start without a seed, with what
//! their proof needs.

use crate::read::ini::{Ini, IniError};
use kinematics::{Cause, Fault, Geometry, Letter, Load, WorkspaceBox};
use std::fmt::Write;

/// A box with what its proof needs beside it.
#[derive(Clone, Debug, PartialEq)]
pub struct Claim {
    /// The box.
    pub region: WorkspaceBox,
    /// Weight of each coordinate in the norm: per machine unit, per degree.
    pub weight: [f64; 6],
    /// The bound c that ‖1 − M J‖ is claimed not to exceed.
    pub contraction: f64,
}

/// One `[BOX_K]` section.
#[derive(Clone, Debug, PartialEq)]
pub struct BoxSection {
    /// What it claims.
    pub claim: Claim,
    /// Hash of the geometry that it was proved for.
    pub geometry: u32,
}

/// The sections of a file: as many as `boxes=` says.
///
/// # Errors
/// A section or key is missing, unknown or malformed.
pub fn read(ini: &Ini, load: &Load) -> Result<Vec<BoxSection>, IniError> {
    let names: Vec<String> = (0..load.boxes()).map(|k| format!("BOX_{k}")).collect();
    for name in ini.sections().filter(|name| name.starts_with("BOX_")) {
        if !names.iter().any(|own| own == name) {
            let expected =
                format!("one section too many; [KINS]KINEMATICS has boxes={}", load.boxes());
            return Err(ini.refuse_section(name, &expected));
        }
    }
    names.iter().map(|name| section(ini, name, load)).collect()
}

/// What the module refuses when it freezes the geometry.
///
/// # Errors
/// A box holds no numbers to compute with, or belongs to another geometry.
pub fn check(sections: &[BoxSection], geometry: &Geometry) -> Result<(), Fault> {
    for (k, section) in sections.iter().enumerate() {
        if !section.claim.region.is_valid() {
            return Err(Fault::with_value(Cause::BoxInvalid, k as f64));
        }
        if section.geometry != geometry.hash() {
            return Err(Fault::with_value(Cause::BoxOfOther, k as f64));
        }
    }
    Ok(())
}

fn row(letter: Letter) -> String {
    format!("ROW_{}", letter.name())
}

fn section(ini: &Ini, name: &str, load: &Load) -> Result<BoxSection, IniError> {
    let letters = load.layout.coordinates().as_slice();
    let rows: Vec<String> = letters.iter().map(|letter| row(*letter)).collect();
    let mut keys = vec!["LOW", "HIGH", "WEIGHT", "CONTRACTION", "STEPS", "GEOMETRY"];
    keys.extend(rows.iter().map(String::as_str));
    ini.check_section(name, &keys)?;
    let legs = load.layout.legs();
    let mut matrix = [[0.0; 8]; 6];
    for (letter, key) in letters.iter().zip(&rows) {
        let expected = format!("expected {legs} decimal numbers separated by blanks");
        let entry = ini.require(name, key, &expected)?;
        let values = ini.number_list(entry).filter(|values| values.len() == legs);
        let values = values.ok_or_else(|| ini.refuse(entry, &expected))?;
        matrix[letter.index()][..legs].copy_from_slice(&values);
    }
    let [contraction] = ini.require_numbers::<1>(name, "CONTRACTION")?;
    let region = WorkspaceBox {
        low: ini.require_numbers::<6>(name, "LOW")?,
        high: ini.require_numbers::<6>(name, "HIGH")?,
        matrix,
        steps: whole(ini, name, "STEPS")?,
    };
    let weight = ini.require_numbers::<6>(name, "WEIGHT")?;
    let claim = Claim { region, weight, contraction };
    Ok(BoxSection { claim, geometry: whole(ini, name, "GEOMETRY")? })
}

fn whole(ini: &Ini, section: &str, key: &str) -> Result<u32, IniError> {
    let expected = "expected a whole number without sign";
    let entry = ini.require(section, key, expected)?;
    let digits = entry.value.bytes().all(|b| b.is_ascii_digit());
    let value = entry.value.parse().ok().filter(|_| digits);
    value.ok_or_else(|| ini.refuse(entry, expected))
}

/// The text of the section, as an INI file holds it.
pub fn text(k: usize, section: &BoxSection, load_letters: &[Letter], legs: usize) -> String {
    let BoxSection { claim, geometry } = section;
    let list = |values: &[f64]| values.iter().map(|x| x.to_string()).collect::<Vec<_>>().join(" ");
    let mut text = format!("[BOX_{k}]\n");
    let mut line = |key: &str, value: String| {
        writeln!(text, "{key} = {value}").expect("a string takes everything");
    };
    line("LOW", list(&claim.region.low));
    line("HIGH", list(&claim.region.high));
    for letter in load_letters {
        line(&row(*letter), list(&claim.region.matrix[letter.index()][..legs]));
    }
    line("STEPS", claim.region.steps.to_string());
    line("WEIGHT", list(&claim.weight));
    line("CONTRACTION", claim.contraction.to_string());
    line("GEOMETRY", geometry.to_string());
    text
}
