// SPDX-License-Identifier: GPL-2.0-or-later
//! Homing in the order of the INI file, checked with forward kinematics.
//!
//! The joint positions at power-up are unknown. This check covers the path of every
//! sequence from HOME to the switches at HOME_OFFSET and back, its joints together, all others
//! at HOME: a sequence that moves only some of the legs tilts the platform.

use crate::sequence;
use kinematics::{Joints, MAX_JOINTS, Margin};
use machine::limits;
use machine::read::ini::{Ini, IniError};
use machine::read::mechanism::Mechanism;

/// Poses sampled on the path of a sequence.
const STEPS: u32 = 50;

/// HOME_SEQUENCE of joints that home together and move back together.
pub(crate) const TOGETHER: i64 = -1;

struct Homing {
    sequence: Option<i64>,
    /// Position at its switch; `None` without a switch.
    switch: Option<f64>,
}

/// A mistake in the order of homing.
#[derive(Clone, Debug, PartialEq)]
pub enum Trouble {
    /// This joint, in LinuxCNC's numbering, is not homed by Home All.
    LeftOut(usize),
    /// The switch of this joint, in LinuxCNC's numbering, is that far outside its limits: with the unit.
    Switch(usize, f64, &'static str),
    /// A limit is violated on the path of a sequence: sequence, and the limit.
    Limit(i64, Margin),
    /// No pose exists on the path of a sequence: sequence, text of the fault.
    NoPose(i64, String),
}

/// Returns all mistakes in the order of homing.
///
/// # Errors
/// A value that is not a number.
pub(crate) fn check(ini: &Ini, config: &Mechanism) -> Result<Vec<Trouble>, IniError> {
    // Its own joints, and those of extra axes, which follow those of a second mechanism.
    let own = config.place.first_joint..config.place.first_joint + config.joints.len();
    let extra = (config.place.first_extra_joint..).take(config.extra.len());
    let numbers: Vec<usize> = own.chain(extra).collect();
    let joints: Vec<Homing> = numbers.iter().map(|i| homing(ini, *i)).collect::<Result<_, _>>()?;
    let mut troubles: Vec<Trouble> = numbers
        .iter()
        .zip(&joints)
        .filter(|(_, joint)| joint.sequence.is_none())
        .map(|(i, _)| Trouble::LeftOut(*i))
        .collect();
    let places = numbers.iter().copied().enumerate();
    troubles.extend(places.zip(&joints).filter_map(|(place, joint)| outside(config, place, joint)));
    let mut sequences: Vec<i64> = joints.iter().filter_map(|joint| joint.sequence).collect();
    // A negative number only makes all joints of a sequence do the last move together.
    sequences.sort_by_key(|sequence| sequence.abs());
    sequences.dedup_by_key(|sequence| sequence.abs());
    for sequence in sequences {
        troubles.extend(follow(config, &joints, sequence));
    }
    Ok(troubles)
}

/// Reports a switch beyond the limits of its joint: of a machine's own joints, then those of its extra axes, the one
/// with index `n`, which has number `i` in LinuxCNC.
fn outside(config: &Mechanism, (n, i): (usize, usize), joint: &Homing) -> Option<Trouble> {
    let switch = joint.switch.filter(|_| joint.sequence.is_some())?;
    let (own, unit) = match config.joints.get(n) {
        Some(own) => (own, config.unit(own.kind)),
        None => {
            let axis = config.extra.get(n - config.joints.len())?;
            (&axis.joint, axis.unit(config.length_unit()))
        }
    };
    let beyond = (own.min - switch).max(switch - own.max);
    (beyond > 0.0).then_some(Trouble::Switch(i, beyond, unit))
}

/// Returns whether the path of all joints together, from HOME to their switches, keeps the limits that the order of the
/// file violates.
pub(crate) fn is_kept_together(ini: &Ini, config: &Mechanism) -> Result<bool, IniError> {
    let first = config.place.first_joint;
    let mut joints: Vec<Homing> =
        (first..first + config.joints.len()).map(|i| homing(ini, i)).collect::<Result<_, _>>()?;
    joints.iter_mut().for_each(|joint| joint.sequence = Some(TOGETHER));
    Ok(follow(config, &joints, TOGETHER).is_none())
}

fn homing(ini: &Ini, i: usize) -> Result<Homing, IniError> {
    let section = format!("JOINT_{i}");
    let number = |key, default| ini.number_or(&section, key, default);
    // With an absolute encoder there is no switch, and HOME_OFFSET is not a position.
    let is_absolute = number("HOME_ABSOLUTE_ENCODER", 0.0)? != 0.0;
    Ok(Homing {
        sequence: sequence::of(ini, &section)?,
        switch: if is_absolute { None } else { Some(number("HOME_OFFSET", 0.0)?) },
    })
}

fn follow(config: &Mechanism, joints: &[Homing], sequence: i64) -> Option<Trouble> {
    let target = |i: usize| {
        let own = joints.get(i).filter(|j| j.sequence.is_some_and(|s| s.abs() == sequence.abs()));
        own.and_then(|joint| joint.switch)
    };
    let home: Joints = std::array::from_fn(|i| config.joints.get(i).map_or(0.0, |j| j.home));
    if (0..MAX_JOINTS).all(|i| target(i).is_none()) {
        return None;
    }
    let limits = limits::of_homing(config);
    let mut seed = config.home_pose();
    for step in 1..=STEPS {
        let share = f64::from(step) / f64::from(STEPS);
        let at: Joints = std::array::from_fn(|i| {
            target(i).map_or(home[i], |switch| home[i] + share * (switch - home[i]))
        });
        match config.machine.forward(&at, &seed, &config.spindle, &config.solver) {
            Ok(solution) => seed = solution.pose,
            Err(fault) => return Some(Trouble::NoPose(sequence, fault.to_string())),
        }
        match config.machine.at(&seed, &config.spindle).map(|at| at.check(&limits)) {
            Ok(Ok(())) => {}
            Ok(Err(margin)) => return Some(Trouble::Limit(sequence, margin)),
            Err(fault) => return Some(Trouble::NoPose(sequence, fault.to_string())),
        }
    }
    None
}
