// SPDX-License-Identifier: GPL-2.0-or-later
//! The motion law of a study, see [`crate::study::file::Law`], about the home of a machine.

use crate::study::file::Law;
use kinematics::Letter;
use machine::read::mechanism::Mechanism;
use std::f64::consts::TAU;

impl Law {
    /// Returns the pose and its rate at a time in seconds: machine units and degrees.
    pub fn at(&self, config: &Mechanism, time: f64) -> ([f64; 6], [f64; 6]) {
        let period = self.period_s.0;
        let share = time / period;
        let (sin, cos) = (TAU * share).sin_cos();
        let radius = self.radius_mm + self.growth_mm * share;
        let growth = self.growth_mm / period;
        let turn = TAU / period;
        let place = [radius * cos, radius * sin, self.rise_mm + self.bend_mm * share * share];
        let speed = [
            growth * cos - radius * turn * sin,
            growth * sin + radius * turn * cos,
            2.0 * self.bend_mm * share / period,
        ];
        let (mut pose, mut rate) = (config.home, [0.0; 6]);
        let layout = config.machine.layout();
        for letter in Letter::ALL.into_iter().filter(|letter| !layout.is_held(*letter)) {
            let k = letter.index();
            let (value, change) = match letter.is_angle() {
                true => {
                    let amplitude = self.amplitude_deg[k - 3];
                    (amplitude * sin, amplitude * turn * cos)
                }
                false => (place[k] * config.units_per_mm, speed[k] * config.units_per_mm),
            };
            (pose[k], rate[k]) = (pose[k] + value, change);
        }
        (pose, rate)
    }
}
