// SPDX-License-Identifier: GPL-2.0-or-later
//! Masses of the bodies: those of a study, and solid steel bars in place of what it lacks.

use crate::model::{Mass, Rod};
use kinematics::{Matrix3, Vector3};
use machine::read::mechanism::Mechanism;
use std::f64::consts::PI;
use studies::study::file::{Each, Lacking, Study};

/// Density of steel, kg/m³.
const DENSITY: f64 = 7850.0;

/// Masses of a mechanism, as far as a study has them.
#[derive(Clone, Debug, Default)]
pub struct Masses {
    /// All that moves with the platform joints; its center in the platform's frame, m.
    pub platform: Option<Mass>,
    /// Masses of every leg that move along and across it.
    pub legs: Option<[Vec<f64>; 2]>,
    /// Mass of every carriage or nut, kg, or moment of inertia of every arm, kg m².
    pub drives: Option<Vec<f64>>,
    /// Mass that every table axis moves.
    pub table: Option<Vec<f64>>,
    /// Largest force or torque of every joint of legs and table.
    pub most: Vec<Option<f64>>,
}

impl Masses {
    /// Reads the masses of a mechanism.
    ///
    /// # Errors
    /// A list of the wrong length.
    pub fn of(config: &Mechanism, study: &Study) -> Result<Self, Lacking> {
        let (legs, table) = (config.legs(), config.joints.len() - config.legs());
        let each = |key: &'static str, value: &Option<Each>, count: usize| {
            value.as_ref().map(|value| value.of(key, count)).transpose()
        };
        let given = &study.legs;
        let platform = study.platform.as_ref().map(|body| Mass {
            mass: body.mass_kg.0,
            centre: body.centre_mm.0 * 1e-3,
            inertia: body.inertia_kg_m2.map_or(Matrix3::zeros(), |inertia| inertia.0),
        });
        let axial = each("axial_mass_kg", &given.axial_mass_kg, legs)?;
        let across = each("across_mass_kg", &given.across_mass_kg, legs)?;
        let nothing = || vec![0.0; legs];
        let of_legs = (axial.is_some() || across.is_some())
            .then(|| [axial.unwrap_or_else(nothing), across.unwrap_or_else(nothing)]);
        let drives = each("drive_mass_kg", &given.drive_mass_kg, legs)?;
        let arms = each("drive_inertia_kg_m2", &given.drive_inertia_kg_m2, legs)?;
        let is_arm = |i: usize| config.geometry.legs()[i].kind.is_angular();
        let pick = |straight: Option<Vec<f64>>, turning: Option<Vec<f64>>, i: usize| {
            let values = if is_arm(i) { turning } else { straight };
            values.map(|values| values[i])
        };
        let of_drives = (drives.is_some() || arms.is_some()).then(|| {
            (0..legs).map(|i| pick(drives.clone(), arms.clone(), i).unwrap_or(0.0)).collect()
        });
        let forces = each("max_force_n", &given.max_force_n, legs)?;
        let torques = each("max_torque_n_m", &given.max_torque_n_m, legs)?;
        let of_table = each("max_force_n", &study.table.max_force_n, table)?;
        let of_leg = (0..legs).map(|i| pick(forces.clone(), torques.clone(), i));
        let most = of_leg.chain((0..table).map(|k| of_table.as_ref().map(|of| of[k]))).collect();
        let table = each("mass_kg", &study.table.mass_kg, table)?;
        Ok(Self { platform, legs: of_legs, drives: of_drives, table, most })
    }
}

/// Returns a solid bar of steel.
pub fn bar(rod: &Rod) -> Mass {
    let span = rod.ends[1] - rod.ends[0];
    let (length, radius) = (span.norm(), rod.radius);
    let mass = DENSITY * PI * radius * radius * length;
    let along = span / length;
    let axial = along * along.transpose();
    let across = mass * (3.0 * radius * radius + length * length) / 12.0;
    let inertia = axial * (mass * radius * radius / 2.0) + (Matrix3::identity() - axial) * across;
    Mass { mass, centre: (rod.ends[0] + rod.ends[1]) / 2.0, inertia }
}

/// Returns a ball of steel.
pub fn ball(centre: Vector3<f64>, radius: f64) -> Mass {
    let mass = DENSITY * 4.0 / 3.0 * PI * radius.powi(3);
    Mass { mass, centre, inertia: Matrix3::identity() * (0.4 * mass * radius * radius) }
}

/// Returns several bodies as one.
pub fn sum(bodies: &[Mass]) -> Mass {
    let mass = bodies.iter().map(|body| body.mass).sum();
    let moment = bodies.iter().fold(Vector3::zeros(), |sum, body| sum + body.centre * body.mass);
    let centre = moment / mass;
    let inertia = bodies.iter().fold(Matrix3::zeros(), |sum, body| {
        sum + body.inertia + about(body.mass, &(body.centre - centre))
    });
    Mass { mass, centre, inertia }
}

/// Returns the tensor of inertia of a point about another.
pub fn about(mass: f64, arm: &Vector3<f64>) -> Matrix3<f64> {
    (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose()) * mass
}
