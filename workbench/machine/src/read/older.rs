// SPDX-License-Identifier: GPL-2.0-or-later
//! Detection of configurations that are not for pkmkins: for LinuxCNC's own modules of parallel machines, or from
//! before joints and axes.

use crate::read::ini::{Ini, IniError};

/// LinuxCNC's kinematics modules of parallel machines, which `pkm migrate` reads.
pub const MODULES: [&str; 5] =
    ["genhexkins", "lineardeltakins", "rotarydeltakins", "tripodkins", "pentakins"];

/// Refuses such a configuration, and names the command that converts it.
///
/// # Errors
/// It is such a configuration.
pub fn refuse(ini: &Ini) -> Result<(), IniError> {
    let way_out = format!("pkm migrate {} makes one of it", ini.file().display());
    if let Some(entry) = ini.first("KINS", "KINEMATICS") {
        let name = entry.value.split_ascii_whitespace().next().unwrap_or_default();
        let text = format!(
            "this configuration is for LinuxCNC's module {name}, and pkm reads those for pkmkins: {way_out}"
        );
        return if MODULES.contains(&name) { Err(ini.refuse(entry, &text)) } else { Ok(()) };
    }
    let is_old = ini.first("TRAJ", "AXES").is_some() || ini.sections().any(|name| name == "AXIS_0");
    if !is_old {
        return Ok(());
    }
    let text = format!(
        "this configuration is from before LinuxCNC had joints and axes (2.7, Machinekit), and pkm reads those for \
         pkmkins: {way_out} if it is for a parallel machine"
    );
    Err(ini.error("KINS", "KINEMATICS", None, &text))
}
