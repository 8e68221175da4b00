// SPDX-License-Identifier: GPL-2.0-or-later
//! The springs of legs and table axes in a study.

use crate::study::file::{Each, Lacking, Legs, Screw, Study};
use machine::read::joints::JointKind;
use machine::read::mechanism::Mechanism;

/// N/mm per N/um.
pub(crate) const PER_UM: f64 = 1e3;

/// N mm per N m.
const MM_PER_M: f64 = 1e3;

/// The spring between the drive of a leg and the platform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spring {
    /// Along the leg, everything included, N/mm.
    Whole(f64),
    /// Rod and drive in series.
    Series {
        /// Along the leg, N/mm.
        rod: f64,
        /// Along the joint: N/mm, or N mm/rad of an arm.
        drive: f64,
    },
}

impl Spring {
    /// Returns the stiffness along the leg, N/mm, if the leg's length changes by `gain` per mm or radian of
    /// the joint: 1/k = 1/k_rod + gain²/k_drive.
    pub fn along(&self, gain: f64) -> f64 {
        match self {
            Self::Whole(k) => *k,
            Self::Series { rod, drive } => 1.0 / (1.0 / rod + gain * gain / drive),
        }
    }
}

/// The legs and table axes as springs.
#[derive(Clone, Debug, PartialEq)]
pub struct Springs {
    /// Every leg, then every table axis.
    pub all: Vec<Spring>,
    /// Screw type of the struts with a lead.
    pub screw: Screw,
}

impl Springs {
    /// Reads the springs of a study.
    ///
    /// # Errors
    /// See [`Lacking`].
    pub fn of(config: &Mechanism, study: &Study) -> Result<Self, Lacking> {
        let mut all = of_legs(config, &study.legs)?;
        let axes = config.joints.len() - config.legs();
        if axes > 0 {
            let (section, key) = ("table", "stiffness_n_per_um");
            let value = study.table.stiffness_n_per_um.as_ref();
            let values = value.ok_or(Lacking::Key { section, key })?.of(key, axes)?;
            all.extend(values.into_iter().map(|k| Spring::Whole(k * PER_UM)));
        }
        Ok(Self { all, screw: study.legs.screw })
    }
}

/// Returns the springs of all legs: `stiffness_n_per_um`, or `rod_stiffness_n_per_um` with that of the drives.
///
/// # Errors
/// See [`Lacking`].
pub fn of_legs(config: &Mechanism, given: &Legs) -> Result<Vec<Spring>, Lacking> {
    let (whole, rod) = ("stiffness_n_per_um", "rod_stiffness_n_per_um");
    let is_given = [given.stiffness_n_per_um.is_some(), given.rod_stiffness_n_per_um.is_some()];
    one_of("legs", [whole, rod], is_given)?;
    if let Some(value) = &given.stiffness_n_per_um {
        let values = value.of(whole, config.legs())?;
        return Ok(values.into_iter().map(|k| Spring::Whole(k * PER_UM)).collect());
    }
    let rods = given.rod_stiffness_n_per_um.iter();
    let rods = rods.map(|value| value.of(rod, config.legs())).next().transpose()?;
    let keys = ["drive_stiffness_n_per_um", "drive_stiffness_n_m_per_rad"];
    let values = [&given.drive_stiffness_n_per_um, &given.drive_stiffness_n_m_per_rad];
    let drives = of_kinds(config, keys, values, [PER_UM, MM_PER_M])?;
    let series = rods.into_iter().flatten().zip(drives).enumerate().map(|(i, (rod, drive))| {
        let key = keys[usize::from(config.joints[i].kind == JointKind::Arm)];
        let drive = drive.ok_or(Lacking::Key { section: "legs", key })?;
        Ok(Spring::Series { rod: rod * PER_UM, drive })
    });
    series.collect()
}

/// Refuses a value given with two keys, and one given with neither.
pub(crate) fn one_of(
    section: &'static str,
    keys: [&'static str; 2],
    [first, second]: [bool; 2],
) -> Result<(), Lacking> {
    match (first, second) {
        (true, true) => Err(Lacking::Both { section, keys }),
        (false, false) => Err(Lacking::Key { section, key: keys[0] }),
        _ => Ok(()),
    }
}

/// Returns values of every leg from two keys, one for legs with straight joints and one for arms, each
/// with a list for the legs of its kind; `None` for a leg whose key is missing.
pub(crate) fn of_kinds(
    config: &Mechanism,
    keys: [&'static str; 2],
    values: [&Option<Each>; 2],
    scales: [f64; 2],
) -> Result<Vec<Option<f64>>, Lacking> {
    let legs = &config.joints[..config.legs()];
    let mut all = vec![None; legs.len()];
    for (k, value) in values.into_iter().enumerate() {
        let Some(value) = value else { continue };
        let own = |i: &usize| (legs[*i].kind == JointKind::Arm) == (k == 1);
        let own: Vec<usize> = (0..legs.len()).filter(own).collect();
        for (i, value) in own.iter().zip(value.of(keys[k], own.len())?) {
            all[*i] = Some(value * scales[k]);
        }
    }
    Ok(all)
}
