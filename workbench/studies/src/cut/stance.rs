// SPDX-License-Identifier: GPL-2.0-or-later
//! Tool and work at a commanded position, as the legs bear them.
//!
//! Where an axis carries the tool, the machine has an equal one without that axis: the tool vector is the one that the
//! axis has turned, and the pose is that of its control point. Where an axis carries the work, only the direction of the
//! feed differs.

use kinematics::{Carries, Fault, Matrix3, Pose, Vector3, World};
use machine::read::mechanism::Mechanism;

/// Tool and work at a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stance {
    /// The machine's own pose with `tool`: x y z in machine units, a b c in degrees.
    pub pose: [f64; 6],
    /// Tool vector on the platform, machine units.
    pub tool: Vector3<f64>,
    /// Orientation of the tool in base.
    pub rotation: Matrix3<f64>,
    /// Orientation of the work in base.
    pub work: Matrix3<f64>,
}

/// Why forces on a machine are not computed, with its file.
#[derive(Clone, Debug, thiserror::Error)]
pub enum NotJudged {
    #[error(
        "{0}: not judged: an axis carries the legs, or the work is on the platform; forces are computed only for a tool on \
         the platform and a fixed base"
    )]
    Base(String),
    #[error(
        "{0}: not judged: axes carry tool or work beside constraints of the platform; forces along a program are computed \
         only where one of the two is missing"
    )]
    BesideConstraints(String),
}

/// Refuses a machine whose legs rest on a moving axis or carry the work, or that [`check_beside_constraints`] refuses.
///
/// # Errors
/// See [`NotJudged`].
pub fn check(config: &Mechanism) -> Result<(), NotJudged> {
    let rests = config.chain.of(Carries::Legs).next().is_none();
    match rests && config.chain.holder().is_none() {
        true => check_beside_constraints(config),
        false => Err(NotJudged::Base(config.file.display().to_string())),
    }
}

/// Refuses a machine whose axes carry something beside constraints of the platform: a stance would lack its dependent
/// coordinates.
///
/// # Errors
/// See [`NotJudged`].
pub fn check_beside_constraints(config: &Mechanism) -> Result<(), NotJudged> {
    match config.machine.layout().constraints() > 0 && !config.chain.is_empty() {
        true => Err(NotJudged::BesideConstraints(config.file.display().to_string())),
        false => Ok(()),
    }
}

impl Stance {
    /// Returns the stance at a commanded pose; `world` has the values of the extra axes too, and `tool` is the tool vector
    /// with the spindle offset.
    ///
    /// # Errors
    /// As [`kinematics::Chain::to_machine`], and with constraints of the platform as [`kinematics::Machine::full_pose`].
    pub fn at(
        config: &Mechanism,
        pose: &[f64; 6],
        world: &World,
        tool: &Vector3<f64>,
    ) -> Result<Self, Fault> {
        let chain = &config.chain;
        if chain.is_empty() {
            let own = Pose::from_degrees(*pose);
            let (rotation, work) = (own.rotation(), Matrix3::identity());
            // Constraints may determine the orientation.
            let rotation = match config.machine.layout().constraints() {
                0 => rotation,
                _ => config.machine.full_pose(&own, tool)?.rotation(),
            };
            return Ok(Self { pose: *pose, tool: *tool, rotation, work });
        }
        let pose = chain.to_machine(world, tool)?;
        let platform = Pose::from_degrees(pose);
        let [rotation, work] = chain.frames(&platform, world);
        let bare = Self { pose, tool: *tool, rotation, work };
        if !chain.is_bare() {
            return Ok(bare);
        }
        let tip = Vector3::new(world[0], world[1], world[2]) - tool;
        let tip = chain.of(Carries::Work).rev().fold(tip, |tip, link| link.out(&tip, world));
        let tool = platform.rotation().tr_mul(&(platform.position - tip));
        Ok(Self { tool, ..bare }.with(&platform, &tool))
    }

    /// Returns the stance of another position with the tool of this one, which must be on the same platform.
    pub fn with_tool_of(&self, other: &Self) -> Self {
        let own = Pose::from_degrees(self.pose);
        let platform =
            Pose { position: own.position - self.tool + own.rotation() * self.tool, ..own };
        self.with(&platform, &other.tool)
    }

    fn with(&self, platform: &Pose, tool: &Vector3<f64>) -> Self {
        let place = platform.position + tool - platform.rotation() * tool;
        let [.., a, b, c] = self.pose;
        Self { pose: [place.x, place.y, place.z, a, b, c], tool: *tool, ..*self }
    }
}
