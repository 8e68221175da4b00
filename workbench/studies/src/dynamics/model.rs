// SPDX-License-Identifier: GPL-2.0-or-later
//! Masses, springs and dampers of a machine, as its study names them: N, mm, s, t.

use crate::study::file::{Each, Lacking, Screw, Study};
use crate::study::springs::{PER_UM, Spring, of_kinds, of_legs, one_of};
use kinematics::{Letter, Matrix3, Vector3};
use machine::read::mechanism::Mechanism;

/// Standard gravity, mm/s².
const GRAVITY: f64 = 9806.65;

/// Tonnes per kilogram.
const T_PER_KG: f64 = 1e-3;

const T_MM2_PER_KG_M2: f64 = 1e3;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Mass, t.
    pub mass: f64,
    /// Center of mass in the platform frame, mm.
    pub centre: Vector3<f64>,
    /// Tensor of inertia about it, platform axes, t mm².
    pub inertia: Matrix3<f64>,
}

/// A leg as spring, damper and masses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    pub spring: Spring,
    /// Along the leg, N s/mm; 0 if damping is given as a ratio.
    pub damping: f64,
    /// Mass that moves along the leg with its platform joint, t.
    pub axial: f64,
    /// Mass that moves across it, t.
    pub across: f64,
    /// Mass moved by the joint: t, or t mm² for an arm; `None` without mass.
    pub drive: Option<f64>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableAxis {
    /// Its coordinate: 0, 1, 2 for X, Y, Z.
    pub axis: usize,
    /// Moved mass, t.
    pub mass: f64,
    /// N/mm.
    pub stiffness: f64,
    /// N s/mm.
    pub damping: f64,
}

/// A machine as masses, springs and dampers.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The platform.
    pub body: Body,
    /// The legs, in order.
    pub legs: Vec<Leg>,
    /// The table axes, in order.
    pub table: Vec<TableAxis>,
    /// Damping ratio of all modes of the platform, if the legs have no dampers.
    pub ratio: Option<f64>,
    /// Gravitational acceleration in the machine frame, mm/s².
    pub gravity: Vector3<f64>,
    /// Whether the stiffness includes weight and bearing forces.
    pub is_geometric: bool,
    /// What supports the torque of a strut's thread.
    pub screw: Screw,
}

impl Model {
    /// Reads the model of a machine.
    ///
    /// # Errors
    /// See [`Lacking`].
    pub fn of(config: &Mechanism, study: &Study) -> Result<Self, Lacking> {
        let section = "platform";
        let lacks = |key| Lacking::Key { section, key };
        let platform = study.platform.as_ref().ok_or_else(|| lacks("mass_kg"))?;
        let layout = config.machine.layout();
        let turns =
            layout.constraints() > 0 || Letter::ALL[3..].iter().any(|a| !layout.is_held(*a));
        let inertia = match platform.inertia_kg_m2 {
            Some(inertia) => inertia.0 * T_MM2_PER_KG_M2,
            None if turns => return Err(lacks("inertia_kg_m2")),
            None => Matrix3::zeros(),
        };
        let down = platform.down.map_or(-Vector3::z(), |down| down.0);
        Ok(Self {
            body: Body {
                mass: platform.mass_kg.0 * T_PER_KG,
                centre: platform.centre_mm.0,
                inertia,
            },
            legs: legs(config, study)?,
            table: table(config, study)?,
            ratio: study.legs.damping_ratio.map(|ratio| ratio.0),
            gravity: down * GRAVITY,
            is_geometric: platform.geometric_stiffness,
            screw: study.legs.screw,
        })
    }
}

impl Model {
    /// Returns the model with massless drives: rod and drive become one spring.
    pub fn without_drive_masses(&self) -> Self {
        let mut model = self.clone();
        model.legs.iter_mut().for_each(|leg| leg.drive = None);
        model
    }
}

fn legs(config: &Mechanism, study: &Study) -> Result<Vec<Leg>, Lacking> {
    let given = &study.legs;
    let count = config.legs();
    let each = |key: &'static str, value: &Option<Each>| {
        value.as_ref().map(|value| value.of(key, count)).transpose()
    };
    let damping = each("damping_n_s_per_mm", &given.damping_n_s_per_mm)?;
    let keys = ["damping_n_s_per_mm", "damping_ratio"];
    one_of("legs", keys, [damping.is_some(), given.damping_ratio.is_some()])?;
    let axial = each("axial_mass_kg", &given.axial_mass_kg)?;
    let across = each("across_mass_kg", &given.across_mass_kg)?;
    let springs = of_legs(config, &study.legs)?;
    let drives = drives(config, study)?;
    let of = |values: &Option<Vec<f64>>, i: usize| values.as_ref().map_or(0.0, |v| v[i]);
    let leg = |i: usize| Leg {
        spring: springs[i],
        damping: of(&damping, i),
        axial: of(&axial, i) * T_PER_KG,
        across: of(&across, i) * T_PER_KG,
        drive: drives[i],
    };
    Ok((0..count).map(leg).collect())
}

fn drives(config: &Mechanism, study: &Study) -> Result<Vec<Option<f64>>, Lacking> {
    let given = &study.legs;
    let keys = ["drive_mass_kg", "drive_inertia_kg_m2"];
    let values = [&given.drive_mass_kg, &given.drive_inertia_kg_m2];
    let masses = of_kinds(config, keys, values, [T_PER_KG, T_MM2_PER_KG_M2])?;
    // A mass between two springs: both must be known.
    let is_hung = given.rod_stiffness_n_per_um.is_some();
    match masses.iter().any(Option::is_some) && !is_hung {
        true => Err(Lacking::Key { section: "legs", key: "rod_stiffness_n_per_um" }),
        false => Ok(masses),
    }
}

fn table(config: &Mechanism, study: &Study) -> Result<Vec<TableAxis>, Lacking> {
    let letters = config.machine.layout().table().as_slice();
    if letters.is_empty() {
        return Ok(vec![]);
    }
    let (given, section) = (&study.table, "table");
    let each = |key: &'static str, value: &Option<Each>| {
        value.as_ref().map(|value| value.of(key, letters.len())).transpose()
    };
    let needed = |key: &'static str, value| each(key, value)?.ok_or(Lacking::Key { section, key });
    let masses = needed("mass_kg", &given.mass_kg)?;
    let stiffness = needed("stiffness_n_per_um", &given.stiffness_n_per_um)?;
    let dampers = each("damping_n_s_per_mm", &given.damping_n_s_per_mm)?;
    let keys = ["damping_n_s_per_mm", "damping_ratio"];
    one_of(section, keys, [dampers.is_some(), given.damping_ratio.is_some()])?;
    let axis = |i: usize| {
        let (mass, stiffness) = (masses[i] * T_PER_KG, stiffness[i] * PER_UM);
        let critical = 2.0 * (mass * stiffness).sqrt();
        let ratio = given.damping_ratio.map_or(0.0, |ratio| ratio.0);
        let damping = dampers.as_ref().map_or(ratio * critical, |dampers| dampers[i]);
        TableAxis { axis: letters[i].index(), mass, stiffness, damping }
    };
    Ok((0..letters.len()).map(axis).collect())
}
