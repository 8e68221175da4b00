// SPDX-License-Identifier: GPL-2.0-or-later
//! Drives of the joints of a machine: those of its legs, and those of extra axes.

use machine::read::joints::{Joint, JointKind};
use machine::read::mechanism::Mechanism;

/// The drive of a leg or an extra axis.
pub(super) struct Motor<'a> {
    /// Its section of the INI file.
    pub section: String,
    pub joint: &'a Joint,
    pub unit: &'static str,
    /// Whether its values are angles.
    pub turns: bool,
}

/// Returns all drives of a mechanism; extra axes, whose joints follow all others, belong to the first one.
pub(super) fn of(config: &Mechanism) -> Vec<Motor<'_>> {
    let own = config.joints.iter().enumerate().map(|(i, joint)| Motor {
        section: config.place.joint_section(i),
        joint,
        unit: config.unit(joint.kind),
        turns: joint.kind == JointKind::Arm,
    });
    let extra = (config.place.first_extra_joint..).zip(&config.extra).map(|(i, axis)| Motor {
        section: format!("JOINT_{i}"),
        joint: &axis.joint,
        unit: axis.unit(config.length_unit()),
        turns: axis.is_rotary(),
    });
    own.chain(extra).collect()
}
