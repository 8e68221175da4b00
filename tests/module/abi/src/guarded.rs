// SPDX-License-Identifier: GPL-2.0-or-later
//! A machine with every guarded limit.

use crate::module::Module;
use crate::parallel::{Kind, Parallel};

/// Returns whether all legs are struts, and the axes of their cardan joints are known.
fn has_pyramids(mechanisms: &[&Parallel]) -> bool {
    let is_known = |axis: &[f64; 3]| axis.iter().any(|value| *value != 0.0);
    mechanisms.iter().flat_map(|machine| &machine.legs).all(|leg| match &leg.kind {
        Kind::Strut { base_axis, platform_axis, .. } => {
            is_known(base_axis) && is_known(platform_axis)
        }
        _ => false,
    })
}

/// Sets every limit that the guard checks, wide enough for all poses of the workspace; for all mechanisms
/// of the module.
pub fn set_limits(mechanisms: &[&Parallel], module: &Module) {
    let size = mechanisms.iter().map(|machine| machine.size()).fold(0.0, f64::max);
    module.set("linear-acceleration", size);
    module.set("angular-acceleration", 100.0);
    module.set("rod-clearance", 1e-12 * size);
    module.set("tilt-limit", 180.0);
    if module.has("mechanism-clearance") {
        module.set("mechanism-clearance", 1e-12 * size);
    }
    for n in 0..mechanisms.iter().map(|machine| machine.legs.len()).sum() {
        module.set(&format!("base-cone.{n}"), 180.0);
        module.set(&format!("platform-cone.{n}"), 180.0);
        for way in ["base-pyramid", "platform-pyramid"] {
            // A leg without an axis, or a machine without a reference pose, has no such limit.
            let limit = if has_pyramids(mechanisms) { 180.0 } else { 0.0 };
            module.set(&format!("{way}.{n}.about"), limit);
            module.set(&format!("{way}.{n}.across"), limit);
        }
    }
    // Extra axes have none: LinuxCNC limits them itself.
    for n in (0..).take_while(|n| module.has(&format!("max-velocity.{n}"))) {
        module.set(&format!("max-velocity.{n}"), size);
        module.set(&format!("max-acceleration.{n}"), 6.0 * size);
    }
}
