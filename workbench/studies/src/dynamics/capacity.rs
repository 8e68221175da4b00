// SPDX-License-Identifier: GPL-2.0-or-later
//! Capacities of drives: force or torque of each, and the torque of its motor through the lead.

use crate::study::file::{Each, Lacking, Study};
use machine::read::joints::JointKind;
use machine::read::mechanism::Mechanism;
use std::f64::consts::TAU;

/// N mm per N m.
const MM_PER_M: f64 = 1e3;

/// A drive.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Capacity {
    /// Largest force, N, or torque of an arm, N mm.
    pub most: Option<f64>,
    pub motor: Option<Motor>,
}

/// A motor that drives a screw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    /// Largest torque, N mm.
    pub torque: f64,
    /// Travel per turn, mm.
    pub lead: f64,
    /// Share of its work that the screw transmits.
    pub efficiency: f64,
}

impl Motor {
    /// Computes the torque that a force of the drive requires, N mm.
    pub fn torque_of(&self, force: f64) -> f64 {
        force.abs() * self.lead.abs() / (TAU * self.efficiency)
    }
}

impl Capacity {
    /// Computes the load (N or N mm) as a share of the drive's capacity; `None` without a limit.
    pub fn share(&self, load: f64) -> Option<f64> {
        let own = self.most.map(|most| load.abs() / most);
        let motor = self.motor.map(|motor| motor.torque_of(load) / motor.torque);
        own.into_iter().chain(motor).reduce(f64::max)
    }

    /// Reads the capacities of all drives: legs, then table axes.
    ///
    /// # Errors
    /// See [`Lacking`].
    pub fn of(config: &Mechanism, study: &Study) -> Result<Vec<Self>, Lacking> {
        let legs = (0..config.legs()).collect::<Vec<_>>();
        let (given, own) = (&study.legs, &study.table);
        let arms = config.joints[..config.legs()].iter().filter(|j| j.kind == JointKind::Arm);
        let arms = arms.count();
        let is_arm = |i: &usize| config.joints[*i].kind == JointKind::Arm;
        let straight: Vec<usize> = legs.iter().copied().filter(|i| !is_arm(i)).collect();
        let turned: Vec<usize> = legs.iter().copied().filter(is_arm).collect();
        let mut all = vec![Self::default(); config.joints.len()];
        let forces = of("max_force_n", &given.max_force_n, straight.len())?;
        straight.iter().zip(forces).for_each(|(i, force)| all[*i].most = Some(force));
        let torques = of("max_torque_n_m", &given.max_torque_n_m, arms)?;
        turned.iter().zip(torques).for_each(|(i, t)| all[*i].most = Some(t * MM_PER_M));
        let torques = of("motor_torque_n_m", &given.motor_torque_n_m, straight.len())?;
        let leads = of("screw_lead_mm", &given.screw_lead_mm, straight.len())?;
        for (n, (i, torque)) in straight.iter().zip(torques).enumerate() {
            let lead = lead(config, *i).or(leads.get(n).copied());
            let lead = lead.ok_or(Lacking::Key { section: "legs", key: "screw_lead_mm" })?;
            let efficiency = given.screw_efficiency.map_or(1.0, |share| share.0);
            all[*i].motor = Some(Motor { torque: torque * MM_PER_M, lead, efficiency });
        }
        let axes = config.joints.len() - config.legs();
        let table = &mut all[config.legs()..];
        let forces = of("max_force_n", &own.max_force_n, axes)?;
        table.iter_mut().zip(forces).for_each(|(axis, force)| axis.most = Some(force));
        let torques = of("motor_torque_n_m", &own.motor_torque_n_m, axes)?;
        let leads = of("screw_lead_mm", &own.screw_lead_mm, axes)?;
        for (n, (axis, torque)) in table.iter_mut().zip(torques).enumerate() {
            let lead = leads.get(n).copied();
            let lead = lead.ok_or(Lacking::Key { section: "table", key: "screw_lead_mm" })?;
            let efficiency = own.screw_efficiency.map_or(1.0, |share| share.0);
            axis.motor = Some(Motor { torque: torque * MM_PER_M, lead, efficiency });
        }
        Ok(all)
    }
}

/// Returns the values of a key, none if it is missing.
fn of(key: &'static str, value: &Option<Each>, count: usize) -> Result<Vec<f64>, Lacking> {
    value.as_ref().map_or(Ok(vec![]), |value| value.of(key, count))
}

/// Returns the lead of a strut's own screw, mm.
fn lead(config: &Mechanism, leg: usize) -> Option<f64> {
    let lead = config.geometry.legs()[leg].kind.screw().lead;
    (lead != 0.0).then(|| lead / config.units_per_mm)
}
