// SPDX-License-Identifier: GPL-2.0-or-later
//! Motion of a rigid body, integrated on the rotation group with a fixed step.
//!
//! Runge-Kutta-Munthe-Kaas of order 4: classical Runge-Kutta on velocities and on the rotation
//! vector Θ since the beginning of the step, R = R₀ exp Θ, Θ' = ω + ½ Θ×ω + Θ×(Θ×ω)/12 with ω in body
//! axes (Munthe-Kaas 1998). R stays orthogonal without correction.

use kinematics::{Matrix3, Vector3};
use nalgebra::Rotation3;

/// State of a body, and of the table under the work.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Center of mass in the machine frame, mm.
    pub place: Vector3<f64>,
    /// Its velocity, mm/s.
    pub velocity: Vector3<f64>,
    /// Machine frame from body axes.
    pub rotation: Matrix3<f64>,
    /// Angular velocity in body axes, rad/s.
    pub spin: Vector3<f64>,
    /// Joint values of the table axes, mm.
    pub table: Vector3<f64>,
    /// Their rates, mm/s.
    pub table_velocity: Vector3<f64>,
}

/// Derivatives of the velocities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acceleration {
    /// Of the center of mass, mm/s².
    pub place: Vector3<f64>,
    /// Of the angular velocity in body axes, rad/s².
    pub spin: Vector3<f64>,
    /// Of the table axes, mm/s².
    pub table: Vector3<f64>,
}

/// Changes within a step, or their rates.
#[derive(Clone, Copy)]
struct Change([Vector3<f64>; 6]);

impl Change {
    fn scaled(&self, by: f64) -> Self {
        Self(self.0.map(|part| part * by))
    }
}

impl Motion {
    /// Applies a change; Θ is its third part.
    fn changed(&self, Change([place, velocity, turn, spin, table, rate]): &Change) -> Self {
        Self {
            place: self.place + place,
            velocity: self.velocity + velocity,
            rotation: self.rotation * Rotation3::new(*turn).matrix(),
            spin: self.spin + spin,
            table: self.table + table,
            table_velocity: self.table_velocity + rate,
        }
    }

    /// Integrates over a time in seconds, in one step; `rates` is called at the start, twice in the middle
    /// and at the end, with the elapsed share of the step.
    ///
    /// # Errors
    /// The error of `rates`.
    pub fn after<E>(
        &self,
        time: f64,
        mut rates: impl FnMut(&Self, f64) -> Result<Acceleration, E>,
    ) -> Result<Self, E> {
        let mut field = |change: &Change, share: f64| -> Result<Change, E> {
            let now = self.changed(change);
            let rate = rates(&now, share)?;
            let turn = change.0[2];
            let once = turn.cross(&now.spin);
            let turned = now.spin + once / 2.0 + turn.cross(&once) / 12.0;
            Ok(Change([
                now.velocity,
                rate.place,
                turned,
                rate.spin,
                now.table_velocity,
                rate.table,
            ]))
        };
        let k1 = field(&Change([Vector3::zeros(); 6]), 0.0)?;
        let k2 = field(&k1.scaled(time / 2.0), 0.5)?;
        let k3 = field(&k2.scaled(time / 2.0), 0.5)?;
        let k4 = field(&k3.scaled(time), 1.0)?;
        let mean = |i: usize| k1.0[i] + (k2.0[i] + k3.0[i]) * 2.0 + k4.0[i];
        Ok(self.changed(&Change(std::array::from_fn(|i| mean(i) * (time / 6.0)))))
    }
}
