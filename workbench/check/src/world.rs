// SPDX-License-Identifier: GPL-2.0-or-later
//! One of LinuxCNC's poses, in all its letters, against the limits of every mechanism and extra axis.

use kinematics::{Letter, MAX_EXTRA, POSE_LETTERS, Pose, World};
use machine::limits;
use machine::read::joints::Axis;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;

/// Returns the letters that the machine moves, with their indices in LinuxCNC's pose and their limits.
pub fn coordinates(config: &MachineConfig) -> Vec<(char, usize, Axis)> {
    let of = |mechanism: &Mechanism| {
        let moved = Letter::ALL.into_iter().filter(|l| !mechanism.machine.layout().is_held(*l));
        let of = |letter: Letter| {
            let place = mechanism.place.places[letter.index()];
            (POSE_LETTERS[place], place, mechanism.programmed[letter.index()])
        };
        moved.map(of).collect::<Vec<_>>()
    };
    let first = config.first();
    let extra = first.extra_axes.places().zip(&first.extra);
    let extra = extra.map(|(place, axis)| (axis.letter, place, axis.axis));
    config.mechanisms.iter().flat_map(of).chain(extra).collect()
}

/// Returns LinuxCNC's pose after homing: extra axes have their joints' positions, independent of `[TRAJ]HOME`.
pub fn home(config: &MachineConfig) -> World {
    let first = config.first();
    let mut world = config.world_home;
    for (place, axis) in first.extra_axes.places().zip(&first.extra) {
        world[place] = axis.joint.home;
    }
    world
}

/// Describes the first limit that the machine violates at a pose without a tool; `None` if it satisfies all.
pub fn violated(config: &MachineConfig, world: &World) -> Option<String> {
    let beyond = coordinates(config)
        .into_iter()
        .find(|(_, place, axis)| !(axis.min..=axis.max).contains(&world[*place]));
    if let Some((letter, place, axis)) = beyond {
        let value = limits::shown(world[place]);
        return Some(format!(
            "{letter} {value} is outside [AXIS_{letter}], {} to {}",
            axis.min, axis.max
        ));
    }
    let mut pose: [f64; 6] = std::array::from_fn(|k| world[k]);
    let (first, second) = (config.first(), config.second_letters);
    let others = first.extra_axes.places().chain(second.iter().flat_map(|second| second.places()));
    for place in others.collect::<Vec<_>>() {
        pose.get_mut(place).into_iter().for_each(|value| *value = 0.0);
    }
    let mut extra = [0.0; MAX_EXTRA];
    extra.iter_mut().zip(first.extra_of(world)).for_each(|(to, value)| *to = value);
    for (axis, value) in first.extra.iter().zip(extra) {
        if !(axis.joint.min..=axis.joint.max).contains(&value) {
            let value = limits::shown(value);
            return Some(format!(
                "{} at {value} is outside {} to {}",
                axis.joint.name, axis.joint.min, axis.joint.max
            ));
        }
    }
    let poses = [pose, second.map_or(pose, |letters| letters.pose_of(world))];
    config.mechanisms.iter().zip(poses).find_map(|(mechanism, pose)| {
        let own = mechanism.carried(&pose, &extra, &mechanism.spindle);
        let at =
            own.and_then(|own| mechanism.machine.at(&Pose::from_degrees(own), &mechanism.spindle));
        match at.map(|at| at.check(&limits::beyond_axes(mechanism))) {
            Ok(Ok(())) => None,
            Ok(Err(margin)) => Some(limits::sentence(mechanism, &margin)),
            Err(fault) => Some(fault.to_string()),
        }
    })
}
