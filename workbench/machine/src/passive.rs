// SPDX-License-Identifier: GPL-2.0-or-later
//! Parts that the passive joints behind constraints of the platform are drawn as: axes of joints, passive legs.
//!
//! A constraint does not name its part. A point in a plane, or a plane through a point, that is an anchor of a leg belongs
//! to a revolute joint of this leg; two planes of the platform through the same other point to a tube that is fixed to
//! the platform and slides through a joint there; any other one to a passive leg. Two directions that stay square are
//! the axes of the universal joint at a point through which a plane with this normal passes; otherwise their
//! place is unknown, and nothing is drawn.

use crate::read::mechanism::Mechanism;
use kinematics::{At, ConstraintGeometry, Vector3};
use serde::Serialize;

/// Half length of an axis, as a share of the machine's size.
const AXIS: f64 = 0.1;

/// Length of a tube, as a multiple of its length between platform and joint at home.
const TUBE: f64 = 1.3;

/// Points of the file that are nearer than this share of the size are one point, directions within this angle in radians
/// one direction: a calibrated machine has the parts of its drawing, from which it differs by less.
const SAME: f64 = 1e-2;

/// A straight part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Passive {
    /// Number of the constraint that it belongs to.
    pub constraint: usize,
    pub shape: PassiveShape,
    pub ends: [PassiveEnd; 2],
}

/// The kind of a straight part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum PassiveShape {
    /// The axis of a revolute joint, or of one half of a universal joint.
    Axis,
    /// A passive leg between base and platform.
    Rod,
    /// A passive leg that is fixed to the platform.
    Tube,
}

/// An end of a part: origin + `base` + R `platform`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PassiveEnd {
    /// `base`, `platform`: the origin of this frame; `leg`: the lower end of this leg.
    pub origin: &'static str,
    /// Index in the list of legs.
    pub leg: Option<usize>,
    /// Vector in the base frame.
    pub base: [f64; 3],
    /// Vector in the platform frame.
    pub platform: [f64; 3],
}

impl PassiveEnd {
    fn on(
        origin: &'static str,
        leg: Option<usize>,
        base: Vector3<f64>,
        platform: Vector3<f64>,
    ) -> Self {
        Self { origin, leg, base: base.into(), platform: platform.into() }
    }

    /// Returns its position in base, for the tool of the pose.
    pub fn position(&self, at: &At, tool: &Vector3<f64>) -> Vector3<f64> {
        let rotation = at.rotation();
        let origin = match (self.leg, self.origin) {
            (Some(leg), _) => at.segments()[leg].base,
            (None, "platform") => at.full_pose().position - tool + rotation * tool,
            (None, _) => Vector3::zeros(),
        };
        origin + Vector3::from(self.base) + rotation * Vector3::from(self.platform)
    }
}

impl Passive {
    /// Returns its ends in base, for the tool of the pose.
    pub fn positions(&self, at: &At, tool: &Vector3<f64>) -> [Vector3<f64>; 2] {
        self.ends.each_ref().map(|end| end.position(at, tool))
    }
}

/// Returns the passive parts of a machine; none without constraints.
pub fn parts(config: &Mechanism) -> Vec<Passive> {
    let given = config.geometry.constraints();
    let Ok(home) = config.machine.at(&config.home_pose(), &config.spindle) else { return vec![] };
    let maker = Maker { config, home };
    let planes = given.iter().enumerate().filter_map(|(i, constraint)| maker.plane(i, constraint));
    let planes: Vec<Plane> = planes.collect();
    let mut parts: Vec<Passive> = vec![];
    for (i, constraint) in given.iter().enumerate() {
        match *constraint {
            ConstraintGeometry::PointInPlane { platform, base, normal } => {
                parts.extend(maker.in_plane(i, platform, base.into(), unit(normal)));
            }
            ConstraintGeometry::PlaneThroughPoint { .. } => {
                let plane = planes.iter().find(|plane| plane.constraint == i);
                parts.extend(plane.map(|plane| maker.through(plane, &planes)).unwrap_or_default());
            }
            ConstraintGeometry::Square { platform_axis, base_axis } => {
                let axes = [unit(base_axis), unit(platform_axis)];
                let is_of = |plane: &&Plane| is_parallel(&plane.normal, &axes[1]);
                parts.extend(planes.iter().filter(is_of).flat_map(|plane| {
                    let at = ("base", None, plane.through);
                    let zero = Vector3::zeros();
                    [maker.axis(i, at, axes[0], zero), maker.axis(i, at, zero, axes[1])]
                }));
            }
        }
    }
    parts
}

/// A plane of the platform that contains a point of base.
struct Plane {
    constraint: usize,
    point: Vector3<f64>,
    normal: Vector3<f64>,
    through: Vector3<f64>,
    /// The leg from the point of base to an anchor in the plane.
    leg: Option<usize>,
}

struct Maker<'a> {
    config: &'a Mechanism,
    home: At<'a>,
}

impl Maker<'_> {
    fn plane(&self, constraint: usize, given: &ConstraintGeometry) -> Option<Plane> {
        let ConstraintGeometry::PlaneThroughPoint { platform, normal, base } = *given else {
            return None;
        };
        let (point, normal, through) = (Vector3::from(platform), unit(normal), base.into());
        let mut legs = self.config.geometry.legs().iter();
        let leg = legs.position(|leg| {
            let off = normal.dot(&(Vector3::from(leg.platform) - point)).abs();
            leg.kind.stands() && self.is_same(&leg.base.into(), &through) && self.is_small(off)
        });
        Some(Plane { constraint, point, normal, through, leg })
    }

    fn is_small(&self, length: f64) -> bool {
        length <= SAME * self.config.machine.size()
    }

    fn is_same(&self, one: &Vector3<f64>, other: &Vector3<f64>) -> bool {
        self.is_small((one - other).norm())
    }

    /// Returns the parts of a point in a plane.
    fn in_plane(
        &self,
        i: usize,
        point: [f64; 3],
        foot: Vector3<f64>,
        normal: Vector3<f64>,
    ) -> Vec<Passive> {
        let (zero, point) = (Vector3::zeros(), Vector3::from(point));
        let mut legs = self.config.geometry.legs().iter();
        match legs.position(|leg| self.is_same(&leg.platform.into(), &point)) {
            Some(leg) => vec![self.axis(i, ("leg", Some(leg), zero), normal, zero)],
            None => vec![self.axis(i, ("base", None, foot), normal, zero), rod(i, foot, point)],
        }
    }

    /// Returns the parts of a plane through a point.
    fn through(&self, plane: &Plane, planes: &[Plane]) -> Vec<Passive> {
        let (i, zero) = (plane.constraint, Vector3::zeros());
        if let Some(leg) = plane.leg {
            let anchor = self.config.geometry.legs()[leg].platform.into();
            return vec![self.axis(i, ("platform", None, anchor), zero, plane.normal)];
        }
        let is_other = |other: &&Plane| {
            let is_there = other.leg.is_none() && self.is_same(&plane.through, &other.through);
            is_there && !is_parallel(&plane.normal, &other.normal)
        };
        match planes.iter().find(is_other) {
            Some(other) if other.constraint > i => vec![self.tube(plane, other)],
            // The first of both has the tube.
            Some(_) => vec![],
            None => vec![
                self.axis(i, ("platform", None, plane.point), zero, plane.normal),
                rod(i, plane.through, plane.point),
            ],
        }
    }

    /// Makes the tube along the line in which two planes of the platform meet.
    fn tube(&self, first: &Plane, second: &Plane) -> Passive {
        let legs = self.config.geometry.legs().iter().map(|leg| Vector3::from(leg.platform));
        let middle = legs.sum::<Vector3<f64>>() / self.config.legs() as f64;
        // The point of both planes that is nearest to the middle of the anchors.
        let off = [first, second].map(|plane| plane.normal.dot(&(plane.point - middle)));
        let along = first.normal.dot(&second.normal);
        let square = 1.0 - along * along;
        let near = middle
            + first.normal * ((off[0] - along * off[1]) / square)
            + second.normal * ((off[1] - along * off[0]) / square);
        let way = first.normal.cross(&second.normal).normalize();
        let zero = Vector3::zeros();
        let end = |place| PassiveEnd::on("platform", None, zero, place);
        let origin = end(zero).position(&self.home, &self.config.spindle);
        let joint = self.home.rotation().transpose() * (first.through - origin);
        let far = near + way * (way.dot(&(joint - near)) * TUBE);
        let ends = [end(near), end(far)];
        Passive { constraint: first.constraint, shape: PassiveShape::Tube, ends }
    }

    /// Makes an axis about a point of a frame, along the sum of a direction of base and one of the platform, one of them
    /// 0.
    fn axis(
        &self,
        constraint: usize,
        (origin, leg, place): (&'static str, Option<usize>, Vector3<f64>),
        of_base: Vector3<f64>,
        of_platform: Vector3<f64>,
    ) -> Passive {
        let half = AXIS * self.config.machine.size();
        let ends = [-half, half].map(|by| {
            let (base, platform) = (of_base * by, of_platform * by);
            match origin {
                "platform" => PassiveEnd::on(origin, leg, base, place + platform),
                _ => PassiveEnd::on(origin, leg, place + base, platform),
            }
        });
        Passive { constraint, shape: PassiveShape::Axis, ends }
    }
}

fn rod(constraint: usize, foot: Vector3<f64>, end: Vector3<f64>) -> Passive {
    let zero = Vector3::zeros();
    let ends =
        [PassiveEnd::on("base", None, foot, zero), PassiveEnd::on("platform", None, zero, end)];
    Passive { constraint, shape: PassiveShape::Rod, ends }
}

fn unit(direction: [f64; 3]) -> Vector3<f64> {
    Vector3::from(direction).normalize()
}

fn is_parallel(one: &Vector3<f64>, other: &Vector3<f64>) -> bool {
    one.cross(other).norm() <= SAME
}
