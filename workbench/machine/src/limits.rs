// SPDX-License-Identifier: GPL-2.0-or-later
//! The limits of a machine's configuration as the core lists them, and their names in reports.

use crate::digits::plain;
use crate::read::mechanism::{LegAngles, Mechanism};
use kinematics::{At, Body, Joints, LEAST_DRIVE, Limit, Limits, Margin, Part};
use serde::Serializer;
use std::ops::ControlFlow;

/// Center lines of legs nearer than this share of the machine's size count as touching: no leg is
/// thinner.
pub const MEETING: f64 = 1e-3;

/// Returns the limits that a machine's file sets.
pub fn of(config: &Mechanism) -> Limits {
    let mut limits = Limits {
        tilt: config.tilt_limit.unwrap_or(0.0),
        conditioning: config.conditioning_limit,
        clearance: least_distance(config),
        ..Limits::NONE
    };
    for (range, axis) in limits.axis.iter_mut().zip(&config.axes) {
        *range = [axis.min, axis.max];
    }
    let joints = |values: &mut Joints, of: fn(&crate::read::joints::Joint) -> f64| {
        values.iter_mut().zip(&config.joints).for_each(|(to, joint)| *to = of(joint));
    };
    joints(&mut limits.min, |joint| joint.range()[0]);
    joints(&mut limits.max, |joint| joint.range()[1]);
    joints(&mut limits.speed, |joint| joint.speed());
    joints(&mut limits.acceleration, |joint| joint.max_acceleration);
    for (i, LegAngles { cones, pyramids }) in config.angles.iter().enumerate() {
        [limits.base_cone[i], limits.platform_cone[i]] = cones.map(Option::unwrap_or_default);
        [limits.base_pyramid[i], limits.platform_pyramid[i]] =
            pyramids.map(Option::unwrap_or_default);
    }
    limits
}

/// Returns all limits except those of the axes, which apply to programmed coordinates.
pub fn beyond_axes(config: &Mechanism) -> Limits {
    Limits { axis: Limits::NONE.axis, ..of(config) }
}

/// Returns the limits of the legs alone, for a pose that homing passes before the switches.
pub fn of_homing(config: &Mechanism) -> Limits {
    let Limits { min, max, .. } = Limits::NONE;
    Limits { min, max, ..beyond_axes(config) }
}

/// Returns the least distance of the center lines of legs that share no anchor, machine units:
/// `[PKM]ROD_CLEARANCE`, or by default the distance at which they count as touching.
fn least_distance(config: &Mechanism) -> f64 {
    config.clearance.unwrap_or(MEETING * config.machine.size())
}

/// Returns the least distance of two mechanisms, of which `config` is the first, machine units:
/// `[PKM]MECHANISM_CLEARANCE`, or by default the distance at which they count as touching.
pub fn least_distance_between(config: &Mechanism) -> f64 {
    config.mechanism_clearance.unwrap_or(MEETING * config.machine.size())
}

/// Describes two parts whose distance is limited.
pub fn between(configs: [&Mechanism; 2], bodies: [Body; 2]) -> String {
    let name = |i: usize| match bodies[i] {
        Body::Leg(n) => format!("leg {}", configs[i].place.first_leg + n),
        Body::Platform => format!("the {} platform", ["first", "second"][i]),
    };
    format!("the distance between {} and {}", name(0), name(1))
}

/// Visits the margins of all configured limits at a pose.
pub fn each(at: &At, limits: &Limits, mut visit: impl FnMut(Margin)) {
    let _ = at.margins(limits, |margin| {
        visit(margin);
        ControlFlow::<()>::Continue(())
    });
}

/// Returns the purpose of a limit, for users who know no kinematics.
pub fn meaning(limit: Limit) -> &'static str {
    match limit {
        Limit::Axis => "travel of the tool in each direction",
        Limit::Reach => "whether the legs are long enough",
        Limit::JointRange => "travel of each drive",
        Limit::DeadPoint => "positions where a drive can no longer move its leg",
        Limit::BaseCone | Limit::BasePyramid => "swing of the joints at the frame",
        Limit::PlatformCone | Limit::PlatformPyramid => "swing of the joints at the platform",
        Limit::Tilt => "tilt of the tool",
        Limit::Clearance => "distance between the legs",
        Limit::Conditioning => "distance from singular poses",
        Limit::JointSpeed => "speed of each drive",
        Limit::JointAcceleration => "acceleration and braking of each drive",
    }
}

/// Describes the part that a limit concerns.
pub fn part(config: &Mechanism, limit: Limit, part: Part) -> String {
    let (first, joint) = (config.place.first_leg, |i: usize| config.joint(i).name.clone());
    let of_legs = |i: usize| match limit {
        Limit::BaseCone | Limit::BasePyramid => format!("the base joint of leg {}", first + i),
        Limit::PlatformCone | Limit::PlatformPyramid => {
            format!("the platform joint of leg {}", first + i)
        }
        _ => joint(i),
    };
    match (limit, part) {
        (_, Part::Axis(letter)) => format!("axis {}", config.place.letter(letter)),
        (Limit::JointSpeed, Part::Joint(i)) => format!("the speed of {}", joint(i)),
        (Limit::JointAcceleration, Part::Joint(i)) => format!("the acceleration of {}", joint(i)),
        (_, Part::Joint(i)) => joint(i),
        (_, Part::Leg(i)) => of_legs(i),
        (_, Part::Legs([i, j])) => {
            format!("the distance between legs {} and {}", first + i, first + j)
        }
        (Limit::Tilt, Part::Whole) => "the tilt of the tool axis".into(),
        (Limit::Conditioning, Part::Whole) => "the conditioning".into(),
        (_, Part::Whole) => "the machine".into(),
    }
}

/// Returns the unit of a limit's value.
pub fn unit(config: &Mechanism, limit: Limit, part: Part) -> String {
    let joint = |suffix: &str| match part {
        Part::Joint(i) | Part::Leg(i) => {
            format!("{}{suffix}", config.unit_of(i))
        }
        _ => String::new(),
    };
    match limit {
        Limit::Axis if matches!(part, Part::Axis(letter) if letter.is_angle()) => "degrees".into(),
        Limit::Axis | Limit::Clearance => config.length_unit().into(),
        Limit::JointRange => joint(""),
        Limit::JointSpeed => joint("/s"),
        Limit::JointAcceleration => joint("/s²"),
        Limit::BaseCone
        | Limit::PlatformCone
        | Limit::BasePyramid
        | Limit::PlatformPyramid
        | Limit::Tilt => "degrees".into(),
        Limit::Reach | Limit::DeadPoint | Limit::Conditioning => String::new(),
    }
}

/// Returns the range of a margin, with its unit.
pub fn bound(config: &Mechanism, margin: &Margin) -> String {
    let unit = unit(config, margin.limit, margin.part);
    let value = match margin.range.map(plain) {
        [_, high] if is_either_way(margin.limit) => format!("{high}"),
        [low, high] if low.is_finite() && high.is_finite() => format!("{low} to {high}"),
        [low, high] => format!("{}", if low.is_finite() { low } else { high }),
    };
    format!("{value} {unit}").trim_end().into()
}

/// Returns the allowed range of a margin, worded as an upper or a lower limit.
pub fn allowed(config: &Mechanism, margin: &Margin) -> String {
    let side = match margin.range {
        _ if is_either_way(margin.limit) => "at most ",
        [low, high] if low.is_finite() && high.is_finite() => "",
        [low, _] if low.is_finite() => "at least ",
        _ => "at most ",
    };
    format!("{side}{}", bound(config, margin))
}

/// Returns the smallest and largest value that the machine's file allows a part; `None` if it has no such limit, or
/// one for each of several directions.
pub fn range(config: &Mechanism, limit: Limit, part: Part) -> Option<[f64; 2]> {
    let limits = of(config);
    let most = |value: f64| (value != 0.0).then_some([f64::NEG_INFINITY, value]);
    let least = |value: f64| (value != 0.0).then_some([value, f64::INFINITY]);
    let both_ways = |value: f64| [-value, value];
    match (limit, part) {
        (Limit::Axis, Part::Axis(letter)) => Some(limits.axis[letter.index()]),
        (Limit::JointRange, Part::Joint(i)) => Some(config.range_of(i)),
        (Limit::JointSpeed, Part::Joint(i)) => Some(both_ways(config.joint(i).speed())),
        (Limit::JointAcceleration, Part::Joint(i)) => {
            Some(both_ways(config.joint(i).max_acceleration))
        }
        (Limit::BaseCone, Part::Leg(i)) => most(limits.base_cone[i]),
        (Limit::PlatformCone, Part::Leg(i)) => most(limits.platform_cone[i]),
        (Limit::Tilt, _) => most(limits.tilt),
        (Limit::DeadPoint, _) => least(LEAST_DRIVE),
        (Limit::Clearance, _) => least(limits.clearance),
        (Limit::Conditioning, _) => least(limits.conditioning),
        _ => None,
    }
}

/// Returns whether a limit is a single number for both directions.
pub fn is_either_way(limit: Limit) -> bool {
    is_of_feed(limit) || matches!(limit, Limit::BasePyramid | Limit::PlatformPyramid)
}

/// Describes a violated limit in a sentence.
pub fn sentence(config: &Mechanism, margin: &Margin) -> String {
    let Margin { limit, part: of, value, .. } = *margin;
    let (name, unit, bound) =
        (part(config, limit, of), unit(config, limit, of), bound(config, margin));
    match limit {
        Limit::Clearance if config.clearance.is_none() => {
            let Part::Legs(pair) = of else { return name };
            let [i, j] = pair.map(|leg| config.place.first_leg + leg);
            format!("legs {i} and {j} meet: their center lines are {} {unit} apart", shown(value))
        }
        Limit::Conditioning => format!(
            "the pose is near a singularity: conditioning {value:.4} (0: singular); pkmkins stops the machine \
             at {bound}"
        ),
        Limit::DeadPoint => format!("{name} comes too close to a dead point"),
        _ => format!("{name} is at {} {unit}, beyond its limit of {bound}", shown(value)),
    }
}

/// Returns whether a limit depends on the programmed feed.
pub fn is_of_feed(limit: Limit) -> bool {
    matches!(limit, Limit::JointSpeed | Limit::JointAcceleration)
}

/// Serializes the identifier of a limit.
pub fn word<S: Serializer>(limit: &Limit, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(match limit {
        Limit::Axis => "axis",
        Limit::Reach => "reach",
        Limit::JointRange => "joint",
        Limit::DeadPoint => "dead-point",
        Limit::BaseCone => "base-cone",
        Limit::PlatformCone => "platform-cone",
        Limit::BasePyramid => "base-pyramid",
        Limit::PlatformPyramid => "platform-pyramid",
        Limit::Tilt => "tilt",
        Limit::Clearance => "clearance",
        Limit::Conditioning => "hold",
        Limit::JointSpeed => "speed",
        Limit::JointAcceleration => "acceleration",
    })
}

/// Formats a value with digits according to its magnitude.
pub fn shown(value: f64) -> String {
    match value.abs() >= 1e-3 || value == 0.0 {
        true => format!("{value:.3}"),
        false => format!("{value:.1e}"),
    }
}
