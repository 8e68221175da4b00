// SPDX-License-Identifier: GPL-2.0-or-later
//! Parameters of the constraints of the platform.
//!
//! A constraint is one equation, and its section has more numbers than the equation depends on. The parameters are those on
//! which it depends: the shift of a plane along its normal, the tilts of directions, and points. A point that is an anchor
//! of a leg is the same joint and follows the parameters of the leg; planes through the same point share it.

use super::model::Quantity;
use kinematics::{ConstraintGeometry, Geometry, Vector3};

/// Points of the file that are nearer than this share of the size are one point.
const SAME: f64 = 1e-6;

/// Part of a constraint that a parameter changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConstraintPart {
    /// A coordinate of the point of base of this constraint and all others with the same point.
    Base(usize),
    /// A coordinate of the platform's point.
    Platform(usize),
    /// Shift of the plane along its normal.
    Shift,
    /// Tilt of the normal, or of the platform's axis, about one of two perpendicular directions: a length at the radius of
    /// the platform.
    Normal(usize),
    /// Tilt of the axis of base.
    BaseAxis(usize),
}

/// Returns whether two points are the same joint.
fn is_same(one: &[f64; 3], other: &[f64; 3], size: f64) -> bool {
    (Vector3::from(*one) - Vector3::from(*other)).norm() <= SAME * size
}

/// Returns the leg whose platform anchor is a point.
fn platform_leg(geometry: &Geometry, point: &[f64; 3], size: f64) -> Option<usize> {
    geometry.legs().iter().position(|leg| is_same(&leg.platform, point, size))
}

/// Returns the leg whose fixed base anchor is a point.
fn base_leg(geometry: &Geometry, point: &[f64; 3], size: f64) -> Option<usize> {
    let mut legs = geometry.legs().iter();
    legs.position(|leg| leg.kind.stands() && is_same(&leg.base, point, size))
}

/// Returns the first constraint with the same point of base.
fn first_through(geometry: &Geometry, point: &[f64; 3], size: f64) -> Option<usize> {
    geometry.constraints().iter().position(|constraint| match constraint {
        ConstraintGeometry::PlaneThroughPoint { base, .. } => is_same(base, point, size),
        _ => false,
    })
}

/// Returns the parameters of the constraints of a geometry.
pub(crate) fn parameters(geometry: &Geometry, size: f64) -> Vec<Quantity> {
    let mut all = vec![];
    for (i, constraint) in geometry.constraints().iter().enumerate() {
        let mut parts = vec![];
        match constraint {
            ConstraintGeometry::PointInPlane { platform, .. } => {
                if platform_leg(geometry, platform, size).is_none() {
                    parts.extend((0..3).map(ConstraintPart::Platform));
                }
                parts.push(ConstraintPart::Shift);
                parts.extend((0..2).map(ConstraintPart::Normal));
            }
            ConstraintGeometry::PlaneThroughPoint { platform, base, .. } => {
                let is_first = first_through(geometry, base, size) == Some(i);
                if is_first && base_leg(geometry, base, size).is_none() {
                    parts.extend((0..3).map(ConstraintPart::Base));
                }
                if platform_leg(geometry, platform, size).is_none() {
                    parts.push(ConstraintPart::Shift);
                }
                parts.extend((0..2).map(ConstraintPart::Normal));
            }
            ConstraintGeometry::Square { .. } => {
                parts.extend((0..2).map(ConstraintPart::Normal));
                parts.extend((0..2).map(ConstraintPart::BaseAxis));
            }
        }
        all.extend(parts.into_iter().map(|part| Quantity::Constraint(i, part)));
    }
    all
}

/// Returns constraint `i` of a drawn geometry with changes of its parameters; `legs` is the geometry with changed legs.
pub(crate) fn changed(
    drawn: &Geometry,
    legs: &Geometry,
    i: usize,
    (size, radius): (f64, f64),
    changes: &[(Quantity, f64)],
) -> ConstraintGeometry {
    let of = |n: usize, part: ConstraintPart| -> f64 {
        let own = changes.iter().filter(|(quantity, _)| *quantity == Quantity::Constraint(n, part));
        own.map(|(_, change)| change).sum()
    };
    let vector =
        |n: usize, part: fn(usize) -> ConstraintPart| Vector3::from_fn(|axis, _| of(n, part(axis)));
    let tilted = |given: &[f64; 3], part: fn(usize) -> ConstraintPart| {
        let by = [0, 1].map(|k| of(i, part(k)) / radius);
        if by == [0.0; 2] { *given } else { tilted(given, by) }
    };
    let mut constraint = drawn.constraints()[i];
    match &mut constraint {
        ConstraintGeometry::PointInPlane { platform, base, normal } => {
            match platform_leg(drawn, platform, size) {
                Some(leg) => *platform = legs.legs()[leg].platform,
                None => add(platform, &vector(i, ConstraintPart::Platform)),
            }
            add(base, &(unit(normal) * of(i, ConstraintPart::Shift)));
            *normal = tilted(normal, ConstraintPart::Normal);
        }
        ConstraintGeometry::PlaneThroughPoint { platform, normal, base } => {
            match platform_leg(drawn, platform, size) {
                Some(leg) => *platform = legs.legs()[leg].platform,
                None => add(platform, &(unit(normal) * of(i, ConstraintPart::Shift))),
            }
            match (base_leg(drawn, base, size), first_through(drawn, base, size)) {
                (Some(leg), _) => *base = legs.legs()[leg].base,
                (None, first) => add(base, &vector(first.unwrap_or(i), ConstraintPart::Base)),
            }
            *normal = tilted(normal, ConstraintPart::Normal);
        }
        ConstraintGeometry::Square { platform_axis, base_axis } => {
            *platform_axis = tilted(platform_axis, ConstraintPart::Normal);
            *base_axis = tilted(base_axis, ConstraintPart::BaseAxis);
        }
    }
    constraint
}

fn add(point: &mut [f64; 3], shift: &Vector3<f64>) {
    point.iter_mut().zip(shift.iter()).for_each(|(value, change)| *value += change);
}

fn unit(direction: &[f64; 3]) -> Vector3<f64> {
    Vector3::from(*direction).normalize()
}

/// Returns the two directions along which a direction tilts.
fn tilt_directions(given: &[f64; 3]) -> [Vector3<f64>; 2] {
    let own = unit(given);
    let across = own.cross(&super::model::unit(own.iamin())).normalize();
    [across, own.cross(&across)]
}

/// Returns a unit vector tilted along two directions perpendicular to a given one.
fn tilted(given: &[f64; 3], by: [f64; 2]) -> [f64; 3] {
    let [one, other] = tilt_directions(given);
    (unit(given) + one * by[0] + other * by[1]).normalize().into()
}

/// A small motion of all parts of the base or of the platform: a turn about the origin, and a shift.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    pub turn: Vector3<f64>,
    pub shift: Vector3<f64>,
}

impl Motion {
    fn of_point(&self, point: &[f64; 3]) -> Vector3<f64> {
        self.shift + self.turn.cross(&Vector3::from(*point))
    }

    /// Returns the tilt of a direction, as a length at the radius of the platform.
    fn of_direction(&self, given: &[f64; 3], k: usize, radius: f64) -> f64 {
        radius * self.turn.cross(&unit(given)).dot(&tilt_directions(given)[k])
    }
}

/// Returns the change of a parameter when all parts of the base move.
pub(crate) fn with_base(
    constraint: &ConstraintGeometry,
    part: ConstraintPart,
    motion: &Motion,
    radius: f64,
) -> f64 {
    use ConstraintPart::{Base, BaseAxis, Normal, Shift};
    match (constraint, part) {
        (ConstraintGeometry::PointInPlane { base, normal, .. }, Shift) => {
            motion.of_point(base).dot(&unit(normal))
        }
        (ConstraintGeometry::PointInPlane { normal, .. }, Normal(k)) => {
            motion.of_direction(normal, k, radius)
        }
        (ConstraintGeometry::PlaneThroughPoint { base, .. }, Base(k)) => motion.of_point(base)[k],
        (ConstraintGeometry::Square { base_axis, .. }, BaseAxis(k)) => {
            motion.of_direction(base_axis, k, radius)
        }
        _ => 0.0,
    }
}

/// Returns the change of a parameter when all parts of the platform move.
pub(crate) fn with_platform(
    constraint: &ConstraintGeometry,
    part: ConstraintPart,
    motion: &Motion,
    radius: f64,
) -> f64 {
    use ConstraintPart::{Normal, Platform, Shift};
    match (constraint, part) {
        (ConstraintGeometry::PointInPlane { platform, .. }, Platform(k)) => {
            motion.of_point(platform)[k]
        }
        (ConstraintGeometry::PlaneThroughPoint { platform, normal, .. }, Shift) => {
            motion.of_point(platform).dot(&unit(normal))
        }
        (ConstraintGeometry::PlaneThroughPoint { normal, .. }, Normal(k)) => {
            motion.of_direction(normal, k, radius)
        }
        (ConstraintGeometry::Square { platform_axis, .. }, Normal(k)) => {
            motion.of_direction(platform_axis, k, radius)
        }
        _ => 0.0,
    }
}

/// Returns the legs that constraints keep in planes of the base, and the normals of these planes.
pub(crate) fn legs_in_planes(geometry: &Geometry, size: f64) -> Vec<(usize, Vector3<f64>)> {
    let leg = |constraint: &ConstraintGeometry| match constraint {
        ConstraintGeometry::PointInPlane { platform, normal, .. } => {
            Some((platform_leg(geometry, platform, size)?, unit(normal)))
        }
        _ => None,
    };
    geometry.constraints().iter().filter_map(leg).collect()
}

/// Returns the turns of planes of the platform about the line in which they meet, if all contain the same point of base: the
/// line, and with it the platform, stays. Each is the number of the constraint and its turn.
pub(crate) fn about_common_lines(geometry: &Geometry, size: f64) -> Vec<(usize, Motion)> {
    let plane = |(i, constraint): (usize, &ConstraintGeometry)| match constraint {
        ConstraintGeometry::PlaneThroughPoint { platform, normal, base } => {
            Some((i, *platform, unit(normal), *base))
        }
        _ => None,
    };
    let planes: Vec<_> = geometry.constraints().iter().enumerate().filter_map(plane).collect();
    let mut all = vec![];
    for (i, platform, normal, base) in &planes {
        let mut others =
            planes.iter().filter(|(k, _, _, other)| k != i && is_same(base, other, size));
        let Some((_, other_platform, other_normal, _)) = others.next() else { continue };
        // The point of both planes that is nearest to the origin.
        let line = normal.cross(other_normal);
        let heights = Vector3::new(
            normal.dot(&Vector3::from(*platform)),
            other_normal.dot(&Vector3::from(*other_platform)),
            0.0,
        );
        let rows = kinematics::Matrix3::from_rows(&[
            normal.transpose(),
            other_normal.transpose(),
            line.transpose(),
        ]);
        if let Some(inverse) = rows.try_inverse() {
            let turn = line.normalize();
            all.push((*i, Motion { turn, shift: -turn.cross(&(inverse * heights)) }));
        }
    }
    all
}
