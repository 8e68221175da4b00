// SPDX-License-Identifier: GPL-2.0-or-later
//! A machine in space, drawn as its legs, guides, platform and tool.

use crate::space::{Part, ball, course, line, plate};
use crate::style::PALE;
use kinematics::{At, LegGeometry, Pose, Vector3};
use machine::passive::{Passive, PassiveShape, parts as passive_parts};
use machine::read::mechanism::Mechanism;
use machine::space::rail;
use plotters::prelude::*;

pub(super) const LEG: RGBColor = RGBColor(85, 85, 105);

pub(super) const GUIDE: RGBColor = RGBColor(150, 150, 165);

/// Passive legs, and axes of passive joints.
pub(super) const PASSIVE: RGBColor = RGBColor(181, 143, 90);
pub(super) const JOINT_AXIS: RGBColor = RGBColor(48, 54, 61);

/// The parts of a machine at a pose.
pub(super) struct Drawn {
    pub(super) parts: Vec<Part>,
    /// Points that the picture must show.
    pub(super) places: Vec<Vector3<f64>>,
}

/// Draws the machine at a pose; nothing if the pose is unreachable.
pub(super) fn at_pose(config: &Mechanism, pose: &Pose) -> Drawn {
    let nothing = Drawn { parts: vec![], places: vec![] };
    let Ok(at) = config.machine.at(pose, &config.spindle) else { return nothing };
    let legs = &at.segments()[..config.legs()];
    let lower: Vec<Vector3<f64>> = legs.iter().map(|leg| leg.base).collect();
    let upper: Vec<Vector3<f64>> = legs.iter().map(|leg| leg.platform).collect();
    let mut parts = vec![];
    let mut places = [lower.clone(), upper.clone()].concat();
    for (from, to) in lower.iter().zip(&upper) {
        parts.extend(line(*from, *to, LEG.stroke_width(4)));
    }
    for (i, leg) in legs.iter().enumerate() {
        let rail = rail_or_arm(config, i, &leg.base);
        let is_finite = |ends: &[Vector3<f64>; 2]| ends.iter().flatten().all(|x| x.is_finite());
        if let Some([from, to]) = rail.filter(is_finite) {
            let width = if config.geometry.legs()[i].kind.is_angular() { 7 } else { 6 };
            parts.extend(line(from, to, GUIDE.stroke_width(width)));
            places.extend([from, to]);
        }
    }
    for ([from, to], style) in passive(config, &at) {
        parts.extend(line(from, to, style));
        places.extend([from, to]);
    }
    let around = ring(&upper);
    parts.extend(lower.iter().map(|at| ball(*at, LEG, 5)));
    parts.extend(upper.iter().map(|at| ball(*at, LEG, 3)));
    let middle = upper.iter().sum::<Vector3<f64>>() / upper.len() as f64;
    let tip = at.full_pose().position;
    parts.extend(line(middle, tip, LEG.stroke_width(3)));
    if around.len() > 2 {
        parts.push(plate(around.clone(), PALE, 0.9));
        parts.extend(course(&[&around[..], &[around[0]]].concat(), LEG.stroke_width(1)));
    }
    places.push(tip);
    Drawn { parts, places }
}

/// Returns the parts of constraints as lines, for the machine without a tool.
pub(super) fn passive(config: &Mechanism, at: &At) -> Vec<([Vector3<f64>; 2], ShapeStyle)> {
    let style = |part: &Passive| match part.shape {
        PassiveShape::Axis => JOINT_AXIS.stroke_width(3),
        PassiveShape::Rod => PASSIVE.stroke_width(4),
        PassiveShape::Tube => PASSIVE.stroke_width(7),
    };
    let parts = passive_parts(config);
    parts.iter().map(|part| (part.positions(at, &config.spindle), style(part))).collect()
}

/// Returns the ends of the rail that carries the lower end of a leg, or those of its arm.
pub(super) fn rail_or_arm(
    config: &Mechanism,
    leg: usize,
    lower: &Vector3<f64>,
) -> Option<[Vector3<f64>; 2]> {
    let LegGeometry { base, kind, .. } = config.geometry.legs()[leg];
    rail(config, leg).or_else(|| (!kind.stands()).then_some([Vector3::from(base), *lower]))
}

/// Sorts points by their angle around their middle, seen from above.
fn ring(places: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let middle = places.iter().sum::<Vector3<f64>>() / places.len().max(1) as f64;
    let mut ring = places.to_vec();
    let angle = |place: &Vector3<f64>| (place.y - middle.y).atan2(place.x - middle.x);
    ring.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    ring
}

/// Returns the corners of the limits of X, Y and Z, if all are limited.
pub(super) fn axis_box(config: &Mechanism) -> Option<[Vector3<f64>; 2]> {
    let low = Vector3::from_fn(|k, _| config.axes[k].min);
    let high = Vector3::from_fn(|k, _| config.axes[k].max);
    let is_limited = low.iter().chain(high.iter()).all(|end| end.is_finite());
    is_limited.then_some([low, high])
}
