// SPDX-License-Identifier: GPL-2.0-or-later
//! A machine as rigid bodies: meters, kilograms, seconds, radians.
//!
//! All frames are parallel to the machine's frame when the machine is at home, so that positions and axes of every
//! body are those of the machine at home, in the machine's frame. A model therefore opens assembled.

use kinematics::{Matrix3, Vector3};
use std::path::PathBuf;

/// Bodies of a machine in order: a parent precedes its children.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Identifier: letters, digits, `-` and `_`.
    pub name: String,
    pub bodies: Vec<Body>,
    /// Joints that close loops.
    pub loops: Vec<Loop>,
    pub screws: Vec<Screw>,
    /// Shapes from files.
    pub meshes: Vec<Mesh>,
    /// Points that users look for: the tool tip without a tool, and the zero of the work.
    pub sites: Vec<Site>,
    /// Parts of the machine that the model lacks, one sentence each.
    pub left_out: Vec<String>,
    /// Where the masses come from.
    pub masses: String,
    /// Mean length of the legs at home, of the mechanism with the longer ones.
    pub size: f64,
}

/// A rigid body, connected to its parent by joints in series; fixed without joints.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    pub name: String,
    /// `None` for the world.
    pub parent: Option<usize>,
    /// Origin of its frame.
    pub origin: Vector3<f64>,
    /// From the parent outward.
    pub joints: Vec<Joint>,
    /// `None` for a body that never moves.
    pub mass: Option<Mass>,
    /// Simple shapes that show it.
    pub rods: Vec<Rod>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mass {
    pub mass: f64,
    /// Center of mass.
    pub centre: Vector3<f64>,
    /// Tensor of inertia about it.
    pub inertia: Matrix3<f64>,
}

/// A round bar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rod {
    pub ends: [Vector3<f64>; 2],
    pub radius: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    Slide,
    Hinge,
}

/// A joint with one degree of freedom.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    pub name: String,
    pub motion: Motion,
    /// Unit vector.
    pub axis: Vector3<f64>,
    /// A point on the axis of a hinge.
    pub point: Vector3<f64>,
    /// Value at home.
    pub home: f64,
    pub range: Option<[f64; 2]>,
    pub role: Role,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Role {
    /// Moved by a drive.
    Driven(Drive),
    /// A coordinate of the platform, free.
    Coordinate,
    /// A joint that follows.
    Passive,
}

/// The drive of a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// Name in reports, such as `strut 3`.
    pub part: String,
    pub max_velocity: f64,
    /// Largest force or torque, if the study has it.
    pub max_force: Option<f64>,
    /// Mass or moment of inertia of what turns in the drive itself, as seen at the joint; `None` if it is unknown.
    pub rotor: Option<f64>,
}

/// How two bodies of a loop are connected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoopKind {
    /// One point in common.
    Ball,
    /// No motion between them.
    Rigid,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Loop {
    pub name: String,
    pub kind: LoopKind,
    pub bodies: [usize; 2],
    pub point: Vector3<f64>,
}

/// A thread: a slide moves in proportion to a turn about the same axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Screw {
    pub name: String,
    /// Name of the hinge.
    pub turn: String,
    /// Name of the slide.
    pub slide: String,
    /// Slide per turn of the hinge by a radian; positive for a right-hand thread.
    pub per_radian: f64,
}

/// The shape of a body, from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    pub body: usize,
    /// `base`, `platform`, `spindle` or `table`.
    pub part: &'static str,
    pub file: PathBuf,
    /// Meters per unit of the file.
    pub scale: f64,
    /// Zero of the file.
    pub place: Vector3<f64>,
    pub rotation: Matrix3<f64>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Site {
    pub name: String,
    pub body: usize,
    pub place: Vector3<f64>,
}

impl Model {
    /// Returns all joints with their bodies, in the order of their values.
    pub fn joints(&self) -> impl Iterator<Item = (usize, &Joint)> {
        self.bodies.iter().enumerate().flat_map(|(i, body)| body.joints.iter().map(move |j| (i, j)))
    }

    /// Returns the place of a body's frame in its parent's at home.
    pub fn offset(&self, body: usize) -> Vector3<f64> {
        let body = &self.bodies[body];
        body.origin - body.parent.map_or(Vector3::zeros(), |parent| self.bodies[parent].origin)
    }

    /// Returns whether a body can move.
    pub fn moves(&self, body: usize) -> bool {
        let body = &self.bodies[body];
        !body.joints.is_empty() || body.parent.is_some_and(|parent| self.moves(parent))
    }

    /// Returns an equal share of all moving masses for a driven joint of a body; the moment of inertia of that share at
    /// the end of an arm.
    pub fn share(&self, body: usize, joint: &Joint) -> f64 {
        let mass: f64 = self.bodies.iter().filter_map(|body| body.mass).map(|mass| mass.mass).sum();
        let drives = self.joints().filter(|(_, joint)| matches!(joint.role, Role::Driven(_)));
        let share = mass / drives.count() as f64;
        let length = |rod: &Rod| (rod.ends[1] - rod.ends[0]).norm().max(rod.radius);
        match joint.motion {
            Motion::Slide => share,
            Motion::Hinge => {
                share * self.bodies[body].rods.iter().map(length).fold(0.0, f64::max).powi(2)
            }
        }
    }
}
