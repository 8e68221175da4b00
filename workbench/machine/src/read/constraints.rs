// SPDX-License-Identifier: GPL-2.0-or-later
//! Constraints of the platform, `[CONSTRAINT_N]`.

use crate::read::error::Errors;
use crate::read::ini::{Ini, IniError};
use keys::constraint as of_constraint;
use kinematics::ConstraintGeometry;

/// Returns the name of the section of constraint `n`.
pub(super) fn constraint_section(n: usize) -> String {
    format!("CONSTRAINT_{n}")
}

/// Checks that exactly the sections CONSTRAINT_0 to that of the last constraint exist.
pub(super) fn check_constraint_sections(ini: &Ini, count: usize) -> Result<(), IniError> {
    for n in 0..count {
        if !ini.sections().any(|name| name == constraint_section(n)) {
            let text = format!(
                "[KINS]KINEMATICS has constraints={count}; add a section for each, or lower the number"
            );
            return Err(ini.refuse_section(&constraint_section(n), &text));
        }
    }
    for name in ini.sections().filter(|name| name.starts_with("CONSTRAINT_")) {
        if !(0..count).any(|n| name == constraint_section(n)) {
            let expected = format!(
                "extra section: remove it, or raise constraints= in [KINS]KINEMATICS, which is {count}"
            );
            return Err(ini.refuse_section(name, &expected));
        }
    }
    Ok(())
}

/// Returns constraint `n` as given.
pub(super) fn constraint(ini: &Ini, n: usize, errors: &mut Errors) -> Option<ConstraintGeometry> {
    let section = constraint_section(n);
    let kind = errors.of(ini.require_word(&section, &of_constraint::KIND))?;
    errors.of(ini.check_keys(&section, keys::of_constraint(ConstraintGeometry::KINDS[kind - 1])));
    let mut vector = |key| errors.of(ini.require_values(&section, key));
    if kind == 3 {
        let platform_axis = vector(&of_constraint::PLATFORM_AXIS);
        let base_axis = vector(&of_constraint::BASE_AXIS)?;
        return Some(ConstraintGeometry::Square { platform_axis: platform_axis?, base_axis });
    }
    let platform = vector(&of_constraint::PLATFORM);
    let base = vector(&of_constraint::BASE);
    let (normal, platform, base) = (vector(&of_constraint::NORMAL)?, platform?, base?);
    Some(match kind {
        1 => ConstraintGeometry::PointInPlane { platform, base, normal },
        _ => ConstraintGeometry::PlaneThroughPoint { platform, normal, base },
    })
}
