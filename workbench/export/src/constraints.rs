// SPDX-License-Identifier: GPL-2.0-or-later
//! Passive bodies and joints behind constraints of the platform, and the values of the joints at a pose.
//!
//! Each constraint becomes a light body of its own, with the five freedoms that its equation leaves:
//!
//! | constraint | joints | closed by |
//! | --- | --- | --- |
//! | point in a plane | base, two slides in the plane, body | ball at the point of the platform |
//! | plane through a point | platform, two slides in the plane, body | ball at the point of the base |
//! | perpendicular directions | base, three slides, hinge along the base axis, hinge along the platform axis, body | rigid at the platform |

use crate::assemble::Builder;
use crate::legs::RADIUS;
use crate::mass::bar;
use crate::model::{Joint, Loop, LoopKind, Motion, Rod, Role};
use crate::state::PlatformPlace;
use crate::universal::{angle_about, normal, turn};
use kinematics::{ConstraintGeometry, Matrix3, Vector3};

/// A constraint: its joints at home, meters.
pub struct Constraint {
    /// Number of its section.
    number: usize,
    kind: Kind,
    /// The platform's origin at home.
    origin: Vector3<f64>,
}

/// Directions and points at home, in the machine's frame.
enum Kind {
    PointInPlane { point: Vector3<f64>, plane: [Vector3<f64>; 2] },
    PlaneThroughPoint { point: Vector3<f64>, plane: [Vector3<f64>; 2] },
    Square { base: Vector3<f64>, platform: Vector3<f64> },
}

impl Constraint {
    /// Creates constraint `number`; `home` is the platform at home in machine units, `meters` the length of one.
    pub fn new(
        given: &ConstraintGeometry,
        number: usize,
        home: &PlatformPlace,
        meters: f64,
    ) -> Self {
        let unit = |direction: [f64; 3]| Vector3::from(direction).normalize();
        let kind = match *given {
            ConstraintGeometry::PointInPlane { platform, normal, .. } => Kind::PointInPlane {
                point: (home.origin + home.rotation * Vector3::from(platform)) * meters,
                plane: axes(&unit(normal)),
            },
            ConstraintGeometry::PlaneThroughPoint { normal, base, .. } => Kind::PlaneThroughPoint {
                point: Vector3::from(base) * meters,
                plane: axes(&(home.rotation * unit(normal))),
            },
            ConstraintGeometry::Square { platform_axis, base_axis } => Kind::Square {
                base: unit(base_axis),
                platform: home.rotation * unit(platform_axis),
            },
        };
        Self { number, kind, origin: home.origin * meters }
    }

    fn name(&self, part: impl std::fmt::Display) -> String {
        format!("constraint_{}_{part}", self.number)
    }

    /// Returns the values of its joints, by their names: `origin` is that of the platform at a pose, meters, and
    /// `rotation` the platform's since home.
    pub fn values(&self, origin: &Vector3<f64>, rotation: &Matrix3<f64>) -> Vec<(String, f64)> {
        let values = match &self.kind {
            Kind::PointInPlane { point, plane } => {
                let moved = origin + rotation * (point - self.origin) - point;
                plane.map(|axis| axis.dot(&moved)).to_vec()
            }
            Kind::PlaneThroughPoint { point, plane } => {
                let seen = rotation.tr_mul(&(point - origin)) + self.origin - point;
                plane.map(|axis| axis.dot(&seen)).to_vec()
            }
            Kind::Square { base, platform } => {
                let turned = rotation * platform;
                let first = base.cross(platform).dot(&turned).atan2(platform.dot(&turned));
                let second = angle_about(platform, &turn(base, first).tr_mul(rotation));
                let moved = origin - self.origin;
                vec![moved.x, moved.y, moved.z, first, second]
            }
        };
        values.into_iter().enumerate().map(|(n, value)| (self.name(n + 1), value)).collect()
    }

    /// Adds its body to a model, between these of base and platform.
    pub fn build(&self, to: &mut Builder, [base, platform]: [usize; 2]) {
        let slide = |axis: &Vector3<f64>| (Motion::Slide, *axis);
        let (place, joints, kind, [carrier, closed]) = match &self.kind {
            Kind::PointInPlane { point, plane } => {
                (*point, plane.each_ref().map(slide).to_vec(), LoopKind::Ball, [base, platform])
            }
            Kind::PlaneThroughPoint { point, plane } => {
                (*point, plane.each_ref().map(slide).to_vec(), LoopKind::Ball, [platform, base])
            }
            Kind::Square { base: first, platform: second } => {
                let slides = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| slide(&axis));
                let hinges = [first, second].map(|axis| (Motion::Hinge, *axis));
                let joints = [slides.to_vec(), hinges.to_vec()].concat();
                (self.origin, joints, LoopKind::Rigid, [base, platform])
            }
        };
        let joints = joints.into_iter().enumerate().map(|(n, (motion, axis))| Joint {
            name: self.name(n + 1),
            motion,
            axis,
            point: place,
            home: 0.0,
            range: None,
            role: Role::Passive,
        });
        let joints: Vec<Joint> = joints.collect();
        let radius = RADIUS * to.model.size;
        // A disc in the plane, or the second axis. A body with less inertia would make the rigid loop, by which it passes on
        // all torque, soft in MuJoCo.
        let (along, [length, thickness]) = match &self.kind {
            Kind::Square { platform, .. } => (*platform, [8.0, 2.0]),
            Kind::PointInPlane { plane: [one, other], .. }
            | Kind::PlaneThroughPoint { plane: [one, other], .. } => (one.cross(other), [1.0, 1.0]),
        };
        let ends = [-0.5, 0.5].map(|side| place + along * (side * length * radius));
        let block = Rod { ends, radius: thickness * radius };
        let body = to.body(self.name("body"), carrier, place, joints, bar(&block), vec![block]);
        let bodies = [body, closed];
        to.model.loops.push(Loop { name: self.name("loop"), kind, bodies, point: place });
    }
}

/// Returns two directions across a normal.
fn axes(across: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let first = normal(across);
    [first, across.cross(&first)]
}
