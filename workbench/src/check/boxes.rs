// SPDX-License-Identifier: GPL-2.0-or-later
//! Boxes of the start without a seed that the machine does not have any more.

use crate::check::wiring::at_key;
use crate::read::error::MachineError;
use crate::read::ini::IniError;
use crate::read::machine::MachineConfig;
use keys::workspace_box;
use kinematics::Cause;

/// What is wrong with the boxes that a file names, each at its line; `way` is the way out of those that
/// belong to another geometry.
pub fn refused(config: &MachineConfig, way: &str) -> Vec<IniError> {
    match &config.refused_boxes {
        None => vec![],
        Some(MachineError::Ini(errors)) => errors.clone(),
        Some(MachineError::Geometry(_, fault, section)) => {
            let name = config.place.box_section(fault.value as usize);
            vec![match (fault.cause, section) {
                (Cause::BoxOfOther, _) => {
                    let text = format!(
                        "proved for another geometry than this one, {:#010x}: {way}",
                        config.hash
                    );
                    at_key(&config.ini, &name, workspace_box::GEOMETRY.name, &text)
                }
                (_, Some(section)) => section.clone(),
                (_, None) => config.ini.refuse_section(&name, &fault.to_string()),
            }]
        }
    }
}
