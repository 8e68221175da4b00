// SPDX-License-Identifier: GPL-2.0-or-later
//! Joints and axes: kinds, ranges and speeds, `[JOINT_N]` and `[AXIS_L]`.

use crate::read::error::Errors;
use crate::read::ini::{Ini, IniError};
use crate::read::place::{Place, leg_section};
use keys::{joint as of_joint, leg as of_leg};
use kinematics::Load;
use kinematics::leg::Kind;

/// LinuxCNC's default speed of an axis (DEFAULT_AXIS_MAX_VELOCITY
/// of emccfg.h), machine units or degrees per second.
const AXIS_VELOCITY: f64 = 1.0;

/// LinuxCNC's default acceleration of an axis (DEFAULT_AXIS_MAX_ACCELERATION).
const AXIS_ACCELERATION: f64 = 1.0;

/// What a joint drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// The length of a strut.
    Strut,
    /// A carriage along its guide.
    Carriage,
    /// An arm about its axis, in degrees.
    Arm,
    /// The table under the workpiece.
    Table,
    /// An extra axis.
    Extra,
}

impl JointKind {
    pub(super) const ALL: [Self; 5] =
        [Self::Strut, Self::Carriage, Self::Arm, Self::Table, Self::Extra];

    const fn of_leg(kind: Kind) -> Self {
        match kind {
            Kind::Strut | Kind::Ring => Self::Strut,
            Kind::Slider => Self::Carriage,
            Kind::Crank => Self::Arm,
        }
    }

    /// Returns the name of one such joint.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Strut => "strut",
            Self::Carriage => "carriage",
            Self::Arm => "arm",
            Self::Table => "table",
            Self::Extra => "axis",
        }
    }

    /// Returns the plural of the name.
    pub const fn plural(self) -> &'static str {
        match self {
            Self::Strut => "struts",
            Self::Carriage => "carriages",
            Self::Arm => "arms",
            Self::Table => "table axes",
            Self::Extra => "extra axes",
        }
    }

    /// Returns the name of the measured quantity.
    pub const fn quantity(self) -> &'static str {
        match self {
            Self::Strut => "length",
            Self::Carriage | Self::Table | Self::Extra => "position",
            Self::Arm => "angle",
        }
    }
}

/// Joints of one kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Their kind.
    pub kind: JointKind,
    /// Their unit.
    pub unit: &'static str,
    /// Their numbers.
    pub joints: Vec<usize>,
}

/// Kind, limits and home of one joint, `[JOINT_N]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Kind.
    pub kind: JointKind,
    /// Name in reports, such as `strut 3` or `table X`.
    pub name: String,
    /// Lowest value, in joint units.
    pub min: f64,
    /// Highest value, in joint units.
    pub max: f64,
    /// Largest speed, joint units per second.
    pub max_velocity: f64,
    /// Largest acceleration, joint units per second squared.
    pub max_acceleration: f64,
    /// Value at the end of homing; LinuxCNC's default is 0.
    pub home: f64,
    /// Largest correction while the machine runs, in either direction, and its rate, in joint units (per second).
    pub correction: [f64; 2],
}

impl Joint {
    /// Returns the smallest and largest value that the kinematics may command: with any correction that
    /// CORRECTION_LIMIT allows, LinuxCNC's joint value is then within `min` and `max`.
    pub fn range(&self) -> [f64; 2] {
        [self.min + self.correction[0], self.max - self.correction[0]]
    }

    /// Returns the largest speed that the kinematics may command: a correction that changes at CORRECTION_RATE
    /// adds to it.
    pub fn speed(&self) -> f64 {
        self.max_velocity - self.correction[1]
    }
}

/// Limits of one pose coordinate, `[AXIS_L]`; infinite if the file gives none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Lowest value, machine units or degrees.
    pub min: f64,
    /// Highest value, machine units or degrees.
    pub max: f64,
    /// Largest speed, machine units or degrees per second.
    pub max_velocity: f64,
    /// Largest acceleration, machine units or degrees per second squared.
    pub max_acceleration: f64,
}

impl Axis {
    /// Limits of a coordinate without any in the file.
    pub(super) const UNLIMITED: Self = Self {
        min: f64::NEG_INFINITY,
        max: f64::INFINITY,
        max_velocity: AXIS_VELOCITY,
        max_acceleration: AXIS_ACCELERATION,
    };
}

/// An extra axis: a joint whose value is a coordinate.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtraAxis {
    /// Its letter.
    pub letter: char,
    /// Its joint.
    pub joint: Joint,
    /// Limits of its coordinate.
    pub axis: Axis,
}

impl ExtraAxis {
    /// Returns whether it is rotary.
    pub fn is_rotary(&self) -> bool {
        "ABC".contains(self.letter)
    }

    /// Returns the smallest and largest value that the limits of its joint and of its coordinate both allow.
    pub fn range(&self) -> [f64; 2] {
        [self.joint.min.max(self.axis.min), self.joint.max.min(self.axis.max)]
    }

    /// Returns the unit of its values, with `length` as the unit of lengths.
    pub fn unit(&self, length: &'static str) -> &'static str {
        if self.is_rotary() { "degrees" } else { length }
    }
}

/// Reads extra axis `n`, whose joint follows those of legs and table.
pub(super) fn extra(ini: &Ini, n: usize, load: &Load, errors: &mut Errors) -> Option<ExtraAxis> {
    let letter = load.extra.letters().nth(n)?;
    let number = load.first_extra_joint() + n;
    let name = format!("{} {letter}", JointKind::Extra.name());
    let joint = limited(ini, &format!("JOINT_{number}"), (JointKind::Extra, name), None, errors);
    let section = format!("AXIS_{letter}");
    let axis = axis(ini, &section, errors);
    let (joint, axis) = (joint?, axis?);
    for (key, of_axis, of_joint) in [
        ("MAX_VELOCITY", axis.max_velocity, joint.max_velocity),
        ("MAX_ACCELERATION", axis.max_acceleration, joint.max_acceleration),
    ] {
        if of_axis > of_joint {
            let expected = format!(
                "expected at most {key} = {of_joint} of [JOINT_{number}], the joint of this axis"
            );
            let entry = ini.require(&section, key, &expected);
            errors.of(entry.and_then(|entry| Err::<(), _>(ini.refuse(entry, &expected))));
        }
    }
    Some(ExtraAxis { letter, joint, axis })
}

/// Reads joint `n` of a mechanism, of a leg or of the table.
pub(super) fn joint(
    ini: &Ini,
    n: usize,
    (load, place): (&Load, &Place),
    errors: &mut Errors,
) -> Option<Joint> {
    let leg = (n < load.layout.legs()).then(|| place.first_leg + n);
    limited(ini, &place.joint_section(n), kind_and_name(n, load, place), leg, errors)
}

/// Reads the joint of this section; the joint of a leg has the leg's number.
fn limited(
    ini: &Ini,
    section: &str,
    (kind, name): (JointKind, String),
    leg: Option<usize>,
    errors: &mut Errors,
) -> Option<Joint> {
    let value = |key, errors: &mut Errors| errors.of(ini.require_value(section, key));
    let min = value(&of_joint::MIN_LIMIT, errors);
    let max = value(&of_joint::MAX_LIMIT, errors);
    if let (Some(min), Some(max)) = (min, max) {
        let expected = format!("expected less than MAX_LIMIT = {max}");
        errors.of(check_least(ini, section, min < max, &expected));
        if let Some(leg) = leg.filter(|_| kind == JointKind::Arm) {
            errors.of(check_turn(ini, leg, section));
        }
    }
    let max_velocity = value(&of_joint::MAX_VELOCITY, errors);
    let max_acceleration = value(&of_joint::MAX_ACCELERATION, errors);
    let home = errors.of(ini.number_or(section, "HOME", 0.0));
    let (min, max) = (min?, max?);
    let (max_velocity, max_acceleration) = (max_velocity?, max_acceleration?);
    let correction = errors.of(correction(ini, section, kind, [max - min, max_velocity]));
    let (home, correction) = (home?, correction?);
    Some(Joint { kind, name, min, max, max_velocity, max_acceleration, home, correction })
}

/// Reads limit and rate of the correction of a joint with this range and this largest speed.
fn correction(
    ini: &Ini,
    section: &str,
    kind: JointKind,
    [range, speed]: [f64; 2],
) -> Result<[f64; 2], IniError> {
    let [limit, rate] = [&of_joint::CORRECTION_LIMIT, &of_joint::CORRECTION_RATE];
    let refuse = |name: &str, expected: &str| {
        Err(ini.refuse(ini.require(section, name, expected)?, expected))
    };
    let Some(most) = ini.value(section, limit)? else {
        return match ini.value(section, rate)? {
            Some(_) => refuse(rate.name, "expected CORRECTION_LIMIT as well, or neither key"),
            None => Ok([0.0; 2]),
        };
    };
    if kind == JointKind::Extra {
        return refuse(limit.name, "remove this key: joints of extra axes have no correction");
    }
    if !(2.0 * most < range) {
        let expected = format!("expected less than {}, half the range of the joint", range / 2.0);
        return refuse(limit.name, &expected);
    }
    match ini.value(section, rate)? {
        Some(own) if own < speed => Ok([most, own]),
        Some(_) => refuse(rate.name, &format!("expected less than MAX_VELOCITY = {speed}")),
        None => refuse(rate.name, "expected a rate as well as CORRECTION_LIMIT"),
    }
}

/// Refuses MIN_LIMIT >= MAX_LIMIT.
fn check_least(ini: &Ini, section: &str, is_range: bool, expected: &str) -> Result<(), IniError> {
    if is_range {
        return Ok(());
    }
    Err(ini.refuse(ini.require(section, of_joint::MIN_LIMIT.name, expected)?, expected))
}

/// Refuses a range of a crank beyond the angle opposite to ARM, where its angle would jump by a turn.
fn check_turn(ini: &Ini, n: usize, section: &str) -> Result<(), IniError> {
    let offset = ini.value(&leg_section(n), &of_leg::OFFSET)?.unwrap_or(0.0);
    for key in [&of_joint::MIN_LIMIT, &of_joint::MAX_LIMIT] {
        let limit = ini.require_value(section, key)?;
        if (limit + offset).abs() < 180.0 {
            continue;
        }
        let expected = format!(
            "expected more than {} and less than {} degrees, at which the arm of LEG_{n} points \
             opposite to ARM",
            -180.0 - offset,
            180.0 - offset
        );
        return Err(ini.refuse(ini.require(section, key.name, &expected)?, &expected));
    }
    Ok(())
}

fn kind_and_name(n: usize, load: &Load, place: &Place) -> (JointKind, String) {
    match load.kinds().get(n) {
        Some(kind) => {
            let kind = JointKind::of_leg(*kind);
            (kind, format!("{} {}", kind.name(), place.first_leg + n))
        }
        None => {
            let letter = load.layout.table().as_slice().get(n - load.layout.legs());
            let letter = letter.map(|letter| letter.name()).unwrap_or_default();
            (JointKind::Table, format!("{} {letter}", JointKind::Table.name()))
        }
    }
}

pub(super) fn axis(ini: &Ini, section: &str, errors: &mut Errors) -> Option<Axis> {
    let min = errors.of(ini.number_or(section, "MIN_LIMIT", Axis::UNLIMITED.min));
    let max = errors.of(ini.number_or(section, "MAX_LIMIT", Axis::UNLIMITED.max));
    if let (Some(min), Some(max)) = (min, max) {
        let expected = format!("expected at most MAX_LIMIT = {max}");
        errors.of(check_least(ini, section, min <= max, &expected));
    }
    let velocity = errors.of(positive(ini, section, "MAX_VELOCITY", Some(AXIS_VELOCITY)));
    let acceleration =
        errors.of(positive(ini, section, "MAX_ACCELERATION", Some(AXIS_ACCELERATION)));
    Some(Axis { min: min?, max: max?, max_velocity: velocity?, max_acceleration: acceleration? })
}

/// Reads a positive number; without a default the key is required.
pub(super) fn positive(
    ini: &Ini,
    section: &str,
    key: &str,
    default: Option<f64>,
) -> Result<f64, IniError> {
    let value = match (ini.numbers::<1>(section, key)?, default) {
        (None, Some(default)) => default,
        _ => ini.require_numbers::<1>(section, key)?[0],
    };
    if value > 0.0 {
        return Ok(value);
    }
    let expected = "expected more than 0";
    Err(ini.refuse(ini.require(section, key, expected)?, expected))
}
