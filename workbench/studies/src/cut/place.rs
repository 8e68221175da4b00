// SPDX-License-Identifier: GPL-2.0-or-later
//! Positions along a program at which expensive quantities are computed: vibration under the teeth,
//! resolution, stability.

use crate::cut::moment::{NoMoment, Subject};
use crate::cut::teeth::{HARMONICS, Teeth};
use crate::dynamics::structure::Structure;
use crate::stability::path::Stop;
use crate::study::sensitivity::Sensitivity;
use kinematics::Vector3;
use machine::read::mechanism::Mechanism;
use nalgebra::Complex;
use std::f64::consts::TAU;

/// Results for a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Assessment {
    /// Amplitude of the tool's vibration under the teeth, mm; `None` in turning, whose force is constant.
    pub vibration: Option<f64>,
    /// Largest error in X, Y, Z if every drive is off by half a step, mm; `None` if the
    /// INI file defines no steps.
    pub resolution: Option<[f64; 3]>,
}

/// Keys of `[JOINT_N]` with steps or counts per joint unit; the first one present is used.
const SCALES: [&str; 4] = ["STEP_SCALE", "STEPGEN_SCALE", "SCALE", "INPUT_SCALE"];

/// Returns half a step of every drive in joint units; `None` if any is unknown.
pub fn half_steps(config: &Mechanism) -> Option<Vec<f64>> {
    let half = |joint: usize| {
        let section = config.place.joint_section(joint);
        let scale = SCALES.iter().find_map(|key| config.ini.first(&section, key))?;
        let scale: f64 = scale.value.split_whitespace().next()?.parse().ok()?;
        (scale != 0.0 && scale.is_finite()).then(|| 0.5 / scale.abs())
    };
    (0..config.joints.len()).map(half).collect()
}

impl Subject<'_> {
    /// Assesses a position, with its feed per tooth in mm.
    ///
    /// # Errors
    /// See [`NoMoment`].
    pub fn look(
        &self,
        stop: &Stop,
        chip: f64,
        half_steps: Option<&[f64]>,
    ) -> Result<Assessment, NoMoment> {
        let resolution = half_steps.map(|steps| self.resolution(stop, steps)).transpose()?;
        if self.teeth.is_turning() {
            return Ok(Assessment { vibration: None, resolution });
        }
        let structure = Structure::at(self.config, &self.model, &stop.pose, &stop.tool)?;
        let frame = self.teeth.frame(&stop.feed, &stop.rotation);
        let frame = frame.map(|value| Complex::new(value, 0.0));
        let tooth = TAU * f64::from(self.teeth.count) * stop.rpm / 60.0;
        let mut swings: Vec<Vector3<Complex<f64>>> = vec![];
        for harmonic in 1..=HARMONICS {
            let receptance = structure.receptance(tooth * harmonic as f64);
            let receptance = receptance.ok_or(NoMoment::Singular)?;
            swings.push(receptance * (frame * self.teeth.harmonic(chip, harmonic)));
        }
        Ok(Assessment { vibration: Some(Teeth::swing(&swings)), resolution })
    }

    fn resolution(&self, stop: &Stop, steps: &[f64]) -> Result<[f64; 3], NoMoment> {
        let length = self.config.machine.radius();
        let found = Sensitivity::at(self.config, &stop.pose, &stop.tool, length)?;
        let [x, y, z, ..] = found.ok_or(NoMoment::Singular)?.worst(steps);
        Ok([x, y, z].map(|error| error / self.config.units_per_mm))
    }
}
