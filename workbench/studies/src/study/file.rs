// SPDX-License-Identifier: GPL-2.0-or-later
//! The data that studies need beyond the INI file: a TOML file.
//!
//! Every value may be missing; a study that needs it reports so. Keys contain their units, so a
//! value without its unit is an unknown key.

use crate::study::cutting::{Chip, Cutting, LagKeys, Link, Overhang, Turning};
use crate::study::forcing::{Force, Milling, Stock};
use crate::study::masses::Platform;
use crate::study::measured::{BadResponse, Measured};
use crate::study::number::{Positive, Ratio, Share};
use crate::study::spindle::Spindle;
use machine::files::{AtFile, Locate, read_text};
use machine::read::mechanism::Mechanism;
use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::io;
use std::path::Path;

#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct Study {
    pub platform: Option<Platform>,
    /// A random force on the tool.
    pub force: Option<Force>,
    /// A milling cutter in its cut.
    pub cutting: Option<Cutting>,
    /// Its speed, feed and edge forces.
    pub milling: Option<Milling>,
    /// The block that it cuts along a program.
    pub stock: Option<Stock>,
    pub legs: Legs,
    /// The joints of the table under the workpiece.
    pub table: Table,
    /// Limits of a pose beyond those of the INI file.
    pub limits: Limits,
    /// A motion of the control point.
    pub law: Option<Law>,
    /// A single edge that cuts a rotating workpiece.
    pub turning: Option<Turning>,
    /// Masses on springs between tool and work.
    pub links: Vec<Link>,
    /// Measured frequency responses between tool and work.
    pub measured: Vec<Measured>,
    /// Lag of the cutting force behind the chip's thickness.
    pub lag: Option<LagKeys>,
    /// Cutting stiffness per width of chip.
    pub chip: Option<Chip>,
    /// Compliance of the first link as a function of its overhang.
    pub overhang: Option<Overhang>,
    /// A shaft on two bearings.
    pub spindle: Option<Spindle>,
}

/// `[legs]`: one number for all legs, or a list with one for each.
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct Legs {
    /// Force per change of length, joints and drive included.
    pub stiffness_n_per_um: Option<Each>,
    /// Standard deviation of the joint value; for the angle of an arm, as the travel of the arm's end.
    pub joint_sigma_um: Option<Each>,
    /// Diameter of the rods, subtracted from the distance between their center lines.
    pub rod_diameter_mm: Option<Positive>,
    /// Reaction to the torque of an axial force in a strut's thread.
    pub screw: Screw,
    /// Force per change of length of rod and joints alone, in series with the drive.
    pub rod_stiffness_n_per_um: Option<Each>,
    /// Force of a drive per displacement of a carriage or nut.
    pub drive_stiffness_n_per_um: Option<Each>,
    /// Torque of a drive per angle of an arm.
    pub drive_stiffness_n_m_per_rad: Option<Each>,
    /// Mass of a carriage, or effective mass along the strut of all that rotates with its nut.
    pub drive_mass_kg: Option<Each>,
    /// Moment of inertia about its axis of an arm and all that rotates with it.
    pub drive_inertia_kg_m2: Option<Each>,
    /// Force per rate of change of length.
    pub damping_n_s_per_mm: Option<Each>,
    /// Damping ratio of every mode of the platform, instead of dampers in the legs.
    pub damping_ratio: Option<Ratio>,
    /// Mass that moves along the leg with its platform joint.
    pub axial_mass_kg: Option<Each>,
    /// Mass that moves across the leg with its platform joint: moment of inertia about the base joint
    /// divided by the square of the length, a third of the mass of a uniform rod.
    pub across_mass_kg: Option<Each>,
    /// Largest force of a drive, along its joint.
    pub max_force_n: Option<Each>,
    /// Largest torque about the axis of an arm.
    pub max_torque_n_m: Option<Each>,
    /// Largest torque of the motor that turns the screw.
    pub motor_torque_n_m: Option<Each>,
    /// Travel per turn of the screw; the INI file's lead for a strut that has one.
    pub screw_lead_mm: Option<Each>,
    /// Efficiency of the screw; 1 if it is missing.
    pub screw_efficiency: Option<Share>,
}

/// Reaction to the torque f · lead / 2π that an axial force f causes in the thread of a strut.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Screw {
    /// The motor, which fixes the nut to the housing: the torque passes through both cardan
    /// joints, as with a ball screw.
    #[default]
    Backdrivable,
    /// Friction in the thread: no torque reaches the cardan joints.
    SelfLocking,
}

/// `[table]`: the table's joints, in order.
#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct Table {
    /// Force per displacement.
    pub stiffness_n_per_um: Option<Each>,
    /// Standard deviation of the joint value.
    pub joint_sigma_um: Option<Each>,
    /// Mass that each axis moves, workpiece included.
    pub mass_kg: Option<Each>,
    /// Force per speed.
    pub damping_n_s_per_mm: Option<Each>,
    /// Damping ratio of every axis, instead of its damper.
    pub damping_ratio: Option<Ratio>,
    /// Largest force of each drive.
    pub max_force_n: Option<Each>,
    /// Largest torque of the motor that turns the screw.
    pub motor_torque_n_m: Option<Each>,
    /// Travel per turn of the screw.
    pub screw_lead_mm: Option<Each>,
    /// Efficiency of the screw; 1 if it is missing.
    pub screw_efficiency: Option<Share>,
}

#[derive(Clone, Debug, Default, Deserialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Smallest conditioning, as in the module's pin.
    pub conditioning: Option<Positive>,
    /// Largest angle about the fixed axis of a base joint, and across it, in either direction.
    pub base_pyramid_deg: Option<[Positive; 2]>,
    /// Fixed axes of the base joints in the machine frame, one per leg; if missing, those of `BASE_N`.
    pub base_axes: Option<Vec<[f64; 3]>>,
    /// The same angles for the platform joints.
    pub platform_pyramid_deg: Option<[Positive; 2]>,
    /// Fixed axes of the platform joints in the platform frame, one per leg; if missing, those of
    /// `PLATFORM_N`.
    pub platform_axes: Option<Vec<[f64; 3]>>,
}

/// `[law]`: the motion of equation 2 of Strutynsky and Yumashev (2008), with the time t
/// and its share τ of the period: X = r cos 2πτ, Y = r sin 2πτ, r = radius + growth τ,
/// Z = rise + bend τ², all relative to home; angles are harmonic, amplitude sin 2πτ.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Law {
    /// Duration of one turn.
    pub period_s: Positive,
    /// Radius of the spiral at its start.
    pub radius_mm: f64,
    /// Growth of the radius in one turn.
    pub growth_mm: f64,
    /// Height at the start.
    pub rise_mm: f64,
    /// Growth of the height in one turn, with the square of time.
    pub bend_mm: f64,
    /// Amplitudes of A, B and C.
    #[serde(default)]
    pub amplitude_deg: [f64; 3],
}

/// Why a study cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    #[error(transparent)]
    Unread(#[from] AtFile<io::Error>),
    #[error(transparent)]
    Malformed(#[from] AtFile<toml::de::Error>),
    #[error(transparent)]
    Response(#[from] AtFile<BadResponse>),
}

/// A value that a study lacks, or has in the wrong form.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Lacking {
    #[error("the study has no {key} in [{section}]{}: add it", if *.section == "table" { ", which this machine needs" } else { "" })]
    Key { section: &'static str, key: &'static str },
    #[error("the study has both {} and {} in [{section}]; remove one of them", .keys[0], .keys[1])]
    Both { section: &'static str, keys: [&'static str; 2] },
    #[error("{key}: expected one number, or {expected} of them; found {found}")]
    Length { key: &'static str, expected: usize, found: usize },
}

/// One positive number for all items, or one for each.
#[derive(Clone, Debug, PartialEq)]
pub enum Each {
    Same(f64),
    /// In order.
    Own(Vec<f64>),
}

impl Each {
    /// Returns the numbers for `count` items.
    ///
    /// # Errors
    /// A list of another length is an error.
    pub fn of(&self, key: &'static str, count: usize) -> Result<Vec<f64>, Lacking> {
        match self {
            Self::Same(value) => Ok(vec![*value; count]),
            Self::Own(values) if values.len() == count => Ok(values.clone()),
            Self::Own(values) => Err(Lacking::Length { key, expected: count, found: values.len() }),
        }
    }
}

impl<'de> Deserialize<'de> for Each {
    // Implemented manually, because the error of an untagged enum would only say that no variant matched.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(EachVisitor)
    }
}

struct EachVisitor;

impl<'de> Visitor<'de> for EachVisitor {
    type Value = Each;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a number above 0, or a list of them")
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Each, E> {
        Positive::try_from(value).map(|value| Each::Same(value.0)).map_err(E::custom)
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Each, E> {
        self.visit_f64(value as f64)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Each, A::Error> {
        let mut values = vec![];
        while let Some(Positive(value)) = items.next_element()? {
            values.push(value);
        }
        Ok(Each::Own(values))
    }
}

impl Study {
    /// Reads a study, and the files that it names relative to its own.
    ///
    /// # Errors
    /// See [`StudyError`].
    pub fn read(file: &Path) -> Result<Self, StudyError> {
        let text = read_text(file)?;
        let mut study = Self::parse(&text).at(file)?;
        for measured in &mut study.measured {
            let place = file.parent().unwrap_or(Path::new("")).join(&measured.file);
            measured.response = read_text(&place)?.parse().at(&place)?;
        }
        Ok(study)
    }

    /// Returns the standard deviation of every joint, in its unit; `None` if the file has none.
    ///
    /// # Errors
    /// See [`Lacking`].
    pub fn joint_sigma(&self, config: &Mechanism) -> Result<Option<Vec<f64>>, Lacking> {
        let all = self.of_joints(
            config,
            "joint_sigma_um",
            [&self.legs.joint_sigma_um, &self.table.joint_sigma_um],
        )?;
        let unit = |(i, value): (usize, f64)| {
            let travel = value * 1e-3 * config.units_per_mm;
            match config.geometry.legs().get(i).filter(|leg| leg.kind.is_angular()) {
                Some(leg) => (travel / leg.kind.lengths()[1]).to_degrees(),
                None => travel,
            }
        };
        Ok(all.map(|values| values.into_iter().enumerate().map(unit).collect()))
    }

    /// Returns the values of legs, then of table axes; `None` if those of the legs are missing.
    fn of_joints(
        &self,
        config: &Mechanism,
        key: &'static str,
        [legs, table]: [&Option<Each>; 2],
    ) -> Result<Option<Vec<f64>>, Lacking> {
        let Some(legs) = legs else { return Ok(None) };
        let mut values = legs.of(key, config.legs())?;
        let axes = config.joints.len() - config.legs();
        if axes > 0 {
            let table = table.as_ref().ok_or(Lacking::Key { section: "table", key })?;
            values.extend(table.of(key, axes)?);
        }
        Ok(Some(values))
    }

    /// Parses a study.
    ///
    /// # Errors
    /// As [`Study::read`].
    pub fn parse(text: &str) -> Result<Self, toml::de::Error> {
        toml::from_str(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_number_stands_for_all_legs_and_a_list_for_each() {
        let study = Study::parse(
            "[legs]\nstiffness_n_per_um = 10\njoint_sigma_um = [1, 2.5]\nrod_diameter_mm = 3\n",
        );
        let legs = study.unwrap().legs;
        assert_eq!(legs.stiffness_n_per_um.unwrap().of("k", 2), Ok(vec![10.0, 10.0]));
        let sigma = legs.joint_sigma_um.unwrap();
        assert_eq!(sigma.of("s", 2), Ok(vec![1.0, 2.5]));
        assert!(sigma.of("s", 3).unwrap_err().to_string().contains("expected one number, or 3"));
        assert_eq!(legs.rod_diameter_mm, Some(Positive(3.0)));
    }

    #[test]
    fn an_error_names_its_line_and_a_way_out() {
        for (text, line, word) in [
            ("[legs]\nstiffness = 10\n", "line 2", "stiffness_n_per_um"),
            ("[legs]\n\nstiffness_n_per_um = -1\n", "line 3", "-1: expected more than 0"),
            ("[legs]\nstiffness_n_per_um = [1, -2]\n", "line 2", "-2: expected more than 0"),
            ("[legs]\nstiffness_n_per_um = \"10\"\n", "line 2", "a number above 0"),
            ("[legs]\nrod_diameter_mm = nan\n", "line 2", "expected more than 0"),
            ("[leg]\n", "line 1", "unknown field `leg`"),
            ("[law]\nperiod_s = 1\n", "line 1", "missing field"),
            ("[legs\n", "line 1", "]"),
        ] {
            let message = Study::parse(text).unwrap_err().to_string();
            assert!(message.contains(line) && message.contains(word), "{text}: {message}");
        }
    }
}
