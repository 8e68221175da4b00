// SPDX-License-Identifier: GPL-2.0-or-later
//! Poses of LinuxCNC and of a machine with constraints whose platform has axes that carry the tool, such as a wrist.
//!
//! The axes give the vector o' from the tip to the platform, in the frame of the platform. Its orientation R depends on
//! its position P = w + R o', and P on R. But a machine with the tool vector o' computes R for the pose of its tip: the
//! control point with which the constraints are solved is the tip at the present values of the axes. The machine's own
//! pose then is P, with the tool vector 0, and the same platform must belong to both poses.

use crate::chain::{Chain, Varied, World, WorldRates};
use crate::extra::POSE_LETTERS;
use crate::fault::{Cause, Fault};
use crate::machine::Machine;
use crate::pose::Pose;
use crate::trig::{DEGREES, RADIANS};
use nalgebra::{Matrix3, Vector3};

/// Distance of two platforms that count as one, as a share of the size: far above rounding, also near a constraint
/// singularity.
const SAME_PLATFORM: f64 = 1e-7;

const NO_TOOL: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

impl Machine {
    /// Converts LinuxCNC's pose `world` with tool vector `tool` to the machine's pose, angles in degrees.
    ///
    /// # Errors
    /// As [`Chain::to_machine`]; if axes carry the tool beside constraints, also as [`Machine::inverse`], and
    /// [`Cause::ConstraintPassed`] if the platform is another one with the tip as control point than without tool.
    #[inline(always)]
    pub fn pose_of_world(
        &self,
        chain: &Chain,
        world: &World,
        tool: &Vector3<f64>,
    ) -> Result<[f64; 6], Fault> {
        match chain.follows() {
            false => chain.to_machine(world, tool),
            true => self.followed(chain, world, tool),
        }
    }

    #[inline(never)]
    fn followed(
        &self,
        chain: &Chain,
        world: &World,
        tool: &Vector3<f64>,
    ) -> Result<[f64; 6], Fault> {
        self.check_tool(tool)?;
        let ([tip, carried], [_, _, _, a, b, c]) = chain.commanded(world, tool, Varied::Nothing)?;
        let [x, y, z] = tip.at.into();
        let rotation = self.platform(&[x, y, z, a, b, c], &carried.at)?;
        let [x, y, z] = (tip.at - carried.at + rotation * carried.at).into();
        let pose = [x, y, z, a, b, c];
        self.refuse_other(&rotation, &self.platform(&pose, &NO_TOOL)?)?;
        Ok(pose)
    }

    /// Writes X Y Z and the angles of LinuxCNC's pose that correspond to the machine's pose; `world` contains the values
    /// of the extra axes.
    ///
    /// # Errors
    /// As [`Machine::pose_of_world`].
    pub fn write_world(
        &self,
        chain: &Chain,
        machine: &[f64; 6],
        world: &mut World,
        tool: &Vector3<f64>,
    ) -> Result<(), Fault> {
        if !chain.follows() {
            return chain.to_world(machine, world, tool);
        }
        let rotation = self.platform(machine, &NO_TOOL)?;
        let mut found = *world;
        chain.write_world(machine, &rotation, &mut found, tool)?;
        // Refuses a tip from which inverse would not lead back.
        self.followed(chain, &found, tool)?;
        *world = found;
        Ok(())
    }

    /// Computes the derivatives of the machine's pose by every letter of LinuxCNC's pose, angles in degrees.
    ///
    /// # Errors
    /// As [`Machine::pose_of_world`].
    pub fn world_rates(
        &self,
        chain: &Chain,
        world: &World,
        tool: &Vector3<f64>,
    ) -> Result<WorldRates, Fault> {
        if !chain.follows() {
            return Ok(chain.rates(world, tool));
        }
        let mut rates = WorldRates::zeros();
        for letter in 0..POSE_LETTERS.len() {
            let is_angle = (3..6).contains(&letter);
            let unit = if is_angle { RADIANS } else { 1.0 };
            let turns = is_angle && !chain.is_extra(letter);
            let rate = self.followed_rate(chain, world, tool, (Varied::Letter(letter), turns))?;
            for (k, value) in rate.iter().enumerate() {
                if let Some(place) = rates.get_mut((k, letter)) {
                    *place = *value * unit;
                }
            }
            if turns && let Some(place) = rates.get_mut((letter, letter)) {
                *place = 1.0;
            }
        }
        Ok(rates)
    }

    /// Computes the rate of P: w' + R o'' + ω × R o'; `turns` if the quantity is one of the platform's angles.
    fn followed_rate(
        &self,
        chain: &Chain,
        world: &World,
        tool: &Vector3<f64>,
        (varied, turns): (Varied, bool),
    ) -> Result<Vector3<f64>, Fault> {
        let ([tip, carried], [_, _, _, a, b, c]) = chain.commanded(world, tool, varied)?;
        let [x, y, z] = tip.at.into();
        let at = self.at(&Pose::from_degrees([x, y, z, a, b, c]), &carried.at)?;
        let [x, y, z] = tip.rate.into();
        let mut rate = [x, y, z, 0.0, 0.0, 0.0];
        if let (Varied::Letter(letter), true) = (varied, turns)
            && let Some(place) = rate.get_mut(letter)
        {
            *place = DEGREES;
        }
        let rotation = at.rotation();
        let omega = at.turning(&rate, &carried.rate)?;
        let arm = rotation * carried.at;
        Ok(tip.rate - carried.rate + rotation * carried.rate + omega.cross(&arm))
    }

    /// Computes the platform's orientation.
    fn platform(&self, pose: &[f64; 6], tool: &Vector3<f64>) -> Result<Matrix3<f64>, Fault> {
        Ok(self.full_pose(&Pose::from_degrees(*pose), tool)?.rotation())
    }

    fn refuse_other(&self, one: &Matrix3<f64>, other: &Matrix3<f64>) -> Result<(), Fault> {
        let off = (one - other).norm() * self.radius();
        match off <= SAME_PLATFORM * self.size() {
            true => Ok(()),
            false => Err(Fault::with_value(Cause::ConstraintPassed, off)),
        }
    }
}
