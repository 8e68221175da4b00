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
    /// Pose of the platform, its control point without a tool.
    platform: Pose,
}

/// Why forces on a machine are not computed: its file.
#[derive(Clone, Debug, thiserror::Error)]
#[error(
    "{0}: not judged: an axis carries the legs, or the work is on the platform; forces are computed only for a tool on the \
     platform and a fixed base"
)]
pub struct NotJudged(pub String);

/// Refuses a machine whose legs rest on a moving axis or carry the work.
///
/// # Errors
/// See [`NotJudged`].
pub fn check(config: &Mechanism) -> Result<(), NotJudged> {
    let rests = config.chain.of(Carries::Legs).next().is_none();
    match rests && config.chain.holder().is_none() {
        true => Ok(()),
        false => Err(NotJudged(config.file.display().to_string())),
    }
}

impl Stance {
    /// Returns the stance at a commanded pose; `world` has the values of the extra axes too, and `tool` is the tool vector
    /// with the spindle offset.
    ///
    /// # Errors
    /// As [`kinematics::Machine::pose_of_world`], and with constraints of the platform as
    /// [`kinematics::Machine::full_pose`].
    pub fn at(
        config: &Mechanism,
        pose: &[f64; 6],
        world: &World,
        tool: &Vector3<f64>,
    ) -> Result<Self, Fault> {
        let (chain, machine) = (&config.chain, &config.machine);
        let pose = match chain.is_empty() {
            true => *pose,
            false => machine.pose_of_world(chain, world, tool)?,
        };
        let own = chain.machine_tool(tool);
        let mut platform = Pose::from_degrees(pose);
        // Constraints may determine the orientation.
        if machine.layout().constraints() > 0 {
            platform.angles = machine.full_pose(&platform, &own)?.angles;
        }
        let [rotation, work] = chain.frames(&platform, world);
        platform.position += platform.rotation() * own - own;
        let bare = Self { pose, tool: own, rotation, work, platform };
        if !chain.is_bare() {
            return Ok(bare);
        }
        let tip = Vector3::new(world[0], world[1], world[2]) - tool;
        let tip = chain.of(Carries::Work).rev().fold(tip, |tip, link| link.out(&tip, world));
        let tool = platform.rotation().tr_mul(&(platform.position - tip));
        Ok(bare.with(&tool))
    }

    /// Returns the stance of this position with the tool of another one, which must be on the same platform.
    pub fn with_tool_of(&self, other: &Self) -> Self {
        self.with(&other.tool)
    }

    fn with(&self, tool: &Vector3<f64>) -> Self {
        let place = self.platform.position + tool - self.platform.rotation() * tool;
        let [.., a, b, c] = self.pose;
        Self { pose: [place.x, place.y, place.z, a, b, c], tool: *tool, ..*self }
    }
}
