// SPDX-License-Identifier: GPL-2.0-or-later
//! Files with the shapes of parts, for viewers: `[PKM]BASE_MODEL` and the others.

use crate::read::error::Errors;
use crate::read::ini::{Entry, Ini, IniError};
use keys::{Key, machine as of_machine};
use std::path::PathBuf;

/// Units of files of shapes, in millimeters.
const UNITS: [(&str, f64); 4] = [("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("inch", 25.4)];

/// Keys and their parts.
const PARTS: [(&Key, &str); 4] = [
    (&of_machine::BASE_MODEL, "base"),
    (&of_machine::PLATFORM_MODEL, "platform"),
    (&of_machine::SPINDLE_MODEL, "spindle"),
    (&of_machine::TABLE_MODEL, "table"),
];

/// The shape of a part. The viewer checks whether its file can be read.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// `base`, `platform`, `spindle` or `table`.
    pub part: &'static str,
    /// STL or OBJ.
    pub file: PathBuf,
    /// Its unit.
    pub unit: &'static str,
    /// Machine units per unit of the file.
    pub scale: f64,
    /// Position and orientation of the file's zero in the frame of the part, X Y Z A B C, machine units and degrees.
    pub place: [f64; 6],
}

/// Reads all shapes of the file.
pub(super) fn read(ini: &Ini, units_per_mm: f64, errors: &mut Errors) -> Option<Vec<Model>> {
    let given =
        PARTS.iter().filter_map(|(key, part)| Some((key, part, ini.first("PKM", key.name)?)));
    let all = given.map(|(key, part, entry)| errors.of(model(ini, key, part, entry, units_per_mm)));
    // Each is read, even after a wrong one.
    all.collect::<Vec<_>>().into_iter().collect()
}

fn model(
    ini: &Ini,
    key: &Key,
    part: &'static str,
    entry: &Entry,
    units_per_mm: f64,
) -> Result<Model, IniError> {
    let expected = format!("expected {}", key.expected());
    ini.require("PKM", key.name, &expected)?;
    let refused = || ini.refuse(entry, &expected);
    let words: Vec<&str> = entry.words().collect();
    let [file, unit, numbers @ ..] = words.as_slice() else { return Err(refused()) };
    let (unit, in_mm) = *UNITS.iter().find(|(name, _)| name == unit).ok_or_else(refused)?;
    if !matches!(numbers.len(), 0 | 3 | 6) || !is_shape(file) {
        return Err(refused());
    }
    let mut place = [0.0; 6];
    for (to, word) in place.iter_mut().zip(numbers) {
        *to = word.parse().ok().filter(|value: &f64| value.is_finite()).ok_or_else(refused)?;
    }
    let file = ini.file().parent().map_or_else(|| file.into(), |folder| folder.join(file));
    Ok(Model { part, file, unit, scale: in_mm * units_per_mm, place })
}

fn is_shape(file: &str) -> bool {
    let end = file.rsplit_once('.').map(|(_, end)| end.to_ascii_lowercase());
    matches!(end.as_deref(), Some("stl" | "obj"))
}
