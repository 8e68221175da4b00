// SPDX-License-Identifier: GPL-2.0-or-later
//! Changes of a geometry by a calibration.

use crate::bars::{Group, bars};
use crate::plot::{DrawError, Plot};
use crate::sheet::Frame;

/// Draws the changes of all legs with their intervals.
///
/// # Errors
/// As [`DrawError`].
pub fn of_changes(unit: &str, groups: &[Group]) -> Result<Plot, DrawError> {
    let caption = "Changes of the geometry, with their 95 % intervals";
    let y = format!("change in {unit}");
    let svg = bars(
        &Frame { title: caption, x: "number of the leg at each bar", y: &y, limits: vec![] },
        groups,
    )?;
    Ok(Plot { file: "changes.svg".into(), caption: caption.into(), svg })
}
