// SPDX-License-Identifier: GPL-2.0-or-later
//! A machine with everything to guard.

use crate::module::Module;
use crate::parallel::Kind;
use crate::subjects::Subject;

/// Whether all legs are struts, and the axes of their cardan joints are known.
fn has_pyramids(subject: &Subject) -> bool {
    let is_known = |axis: &[f64; 3]| axis.iter().any(|value| *value != 0.0);
    subject.machine.legs.iter().all(|leg| match &leg.kind {
        Kind::Strut { base_axis, platform_axis, .. } => {
            is_known(base_axis) && is_known(platform_axis)
        }
        _ => false,
    })
}

/// Sets every limit that the guard looks at, wide enough to be met by no pose of the workspace.
pub fn set_limits(subject: &Subject, module: &Module) {
    let size = subject.machine.size();
    module.set("linear-acceleration", size);
    module.set("angular-acceleration", 100.0);
    module.set("rod-clearance", 1e-12 * size);
    module.set("tilt-limit", 180.0);
    for n in 0..subject.machine.legs.len() {
        module.set(&format!("base-cone.{n}"), 180.0);
        module.set(&format!("platform-cone.{n}"), 180.0);
        for way in ["base-pyramid", "platform-pyramid"] {
            // A leg without an axis, or a machine without a reference pose, keeps none.
            let limit = if has_pyramids(subject) { 180.0 } else { 0.0 };
            module.set(&format!("{way}.{n}.about"), limit);
            module.set(&format!("{way}.{n}.across"), limit);
        }
    }
    for n in 0..subject.machine.joints() {
        module.set(&format!("max-velocity.{n}"), size);
        module.set(&format!("max-acceleration.{n}"), 6.0 * size);
    }
}
