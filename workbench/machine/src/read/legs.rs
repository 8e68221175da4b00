// SPDX-License-Identifier: GPL-2.0-or-later
//! Geometry of the legs, `[LEG_N]`.

use crate::read::error::Errors;
use crate::read::ini::{Ini, IniError};
use crate::read::place::leg_section;
use keys::{Key, Need, leg as of_leg, machine as of_machine};
use kinematics::leg::{CrankGeometry, Kind, RingGeometry, SliderGeometry, StrutGeometry};
use kinematics::{LegGeometry, LegKind, Matrix3, Segment, Vector3};

/// Returns the motion of a leg's moving base anchor per joint unit, in base; `None` if it does not move.
pub fn drive_rate(leg: &LegGeometry, segment: &Segment) -> Option<Vector3<f64>> {
    match leg.kind {
        LegKind::Strut(_) | LegKind::Ring(_) => None,
        LegKind::Slider(slider) => Some(Vector3::from(slider.guide).normalize()),
        LegKind::Crank(crank) => {
            let arm = segment.base - Vector3::from(leg.base);
            let axis = Vector3::from(crank.axis).normalize();
            Some(axis.cross(&arm) * (std::f64::consts::PI / 180.0))
        }
    }
}

/// Returns a leg's anchor on the platform, in its frame: on a ring the point nearest to the base anchor.
pub fn platform_anchor(
    leg: &LegGeometry,
    segment: &Segment,
    rotation: &Matrix3<f64>,
) -> Vector3<f64> {
    let radius = leg.kind.ring_radius();
    let along = rotation.tr_mul(&segment.span());
    // From the ring toward the base anchor, normal to the axis; zero if one is above the other.
    let outward = Vector3::new(-along.x, -along.y, 0.0);
    let turned = outward.try_normalize(0.0).unwrap_or_default();
    Vector3::from(leg.platform) + turned * radius
}

/// Checks that exactly the sections LEG_0 to that of the last leg exist.
pub(super) fn check_leg_sections(ini: &Ini, legs: usize) -> Result<(), IniError> {
    for n in 0..legs {
        if !ini.sections().any(|name| name == leg_section(n)) {
            let text = format!("[KINS]KINEMATICS has {legs} legs; add a section for each");
            return Err(ini.refuse_section(&leg_section(n), &text));
        }
    }
    for name in ini.sections().filter(|name| name.starts_with("LEG_")) {
        if !(0..legs).any(|n| name == leg_section(n)) {
            let expected = format!(
                "extra section: remove it, or raise the count; [KINS]KINEMATICS has legs 0 to {}",
                legs - 1
            );
            return Err(ini.refuse_section(name, &expected));
        }
    }
    Ok(())
}

pub(super) fn leg_geometry(
    ini: &Ini,
    section: &str,
    kind: Kind,
    errors: &mut Errors,
) -> Option<LegGeometry> {
    errors.of(ini.check_keys(section, keys::of_leg(kind)));
    let base = errors.of(ini.require_values(section, &of_leg::BASE));
    let mut platform = || errors.of(ini.require_values(section, &of_leg::PLATFORM));
    match kind {
        Kind::Ring => {
            let [radius, height] = errors.of(ini.require_values(section, &of_leg::EFFECTOR))?;
            let kind = LegKind::Ring(RingGeometry { radius });
            Some(LegGeometry { base: base?, platform: [0.0, 0.0, height], kind })
        }
        Kind::Strut => {
            let platform = platform();
            let strut = strut(ini, section, errors);
            Some(LegGeometry::strut(base?, platform?, strut?))
        }
        Kind::Slider => {
            let platform = platform();
            let kind = LegKind::Slider(slider(ini, section, errors)?);
            Some(LegGeometry { base: base?, platform: platform?, kind })
        }
        Kind::Crank => {
            let platform = platform();
            let kind = LegKind::Crank(crank(ini, section, errors)?);
            Some(LegGeometry { base: base?, platform: platform?, kind })
        }
    }
}

pub(super) fn strut(ini: &Ini, section: &str, errors: &mut Errors) -> Option<StrutGeometry> {
    let lead = match errors.of(ini.value(section, &of_leg::LEAD))? {
        Some(own) => own,
        // No default of 0: a lost heading or a typing error would drop it silently.
        None => errors.of(ini.require_value("PKM", &of_machine::SCREW_LEAD))?,
    };
    let axis = |key: &Key| match ini.values(section, key)? {
        None if lead != 0.0 || is_needed_by_another(ini, section, key) => {
            ini.require_values(section, key)
        }
        axis => Ok(axis.unwrap_or_default()),
    };
    let base_axis = errors.of(axis(&of_leg::BASE_N));
    Some(StrutGeometry {
        platform_axis: errors.of(axis(&of_leg::PLATFORM_N))?,
        base_axis: base_axis?,
        lead,
    })
}

/// Returns whether the section of a leg has a key that requires this one.
fn is_needed_by_another(ini: &Ini, section: &str, key: &Key) -> bool {
    let wants = |other: &&Key| other.need == Need::With(key.name);
    of_leg::ALL.iter().copied().filter(wants).any(|other| ini.first(section, other.name).is_some())
}

fn slider(ini: &Ini, section: &str, errors: &mut Errors) -> Option<SliderGeometry> {
    let guide = errors.of(ini.require_values(section, &of_leg::GUIDE));
    let rod = errors.of(ini.require_value(section, &of_leg::ROD));
    let side = errors.of(ini.require_value(section, &of_leg::SIDE));
    Some(SliderGeometry { guide: guide?, rod: rod?, side: side? as i32 })
}

fn crank(ini: &Ini, section: &str, errors: &mut Errors) -> Option<CrankGeometry> {
    let axis = errors.of(ini.require_values(section, &of_leg::AXIS));
    let arm = errors.of(ini.require_values(section, &of_leg::ARM));
    let rod = errors.of(ini.require_value(section, &of_leg::ROD));
    let side = errors.of(ini.require_value(section, &of_leg::SIDE));
    Some(CrankGeometry { axis: axis?, arm: arm?, rod: rod?, side: side? as i32 })
}
