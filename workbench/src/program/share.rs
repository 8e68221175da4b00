// SPDX-License-Identifier: GPL-2.0-or-later
//! What the axes leave to a move: speed and acceleration along it.

use crate::program::interpreter::Arc;
use crate::program::segment::{ALONG_CIRCLES, FUZZ, lengths, norm};
use crate::read::machine::MachineConfig;
use kinematics::Vector3;

pub(super) struct Limits {
    pub(super) turns_only: bool,
    pub(super) length: f64,
    pub(super) most: f64,
    pub(super) acceleration: f64,
}

/// Seconds at the axes' speeds, and seconds squared at their accelerations.
fn axis_times(config: &MachineConfig, delta: &[f64; 6]) -> (f64, f64) {
    let moved = delta.iter().zip(&config.axes).filter(|(d, _)| d.abs() >= FUZZ / 10.0);
    moved.fold((0.0, 0.0), |(speed, acceleration): (f64, f64), (d, axis)| {
        let d = d.abs();
        (speed.max(d / axis.max_velocity), acceleration.max(d / axis.max_acceleration))
    })
}

pub(super) fn line_limits(config: &MachineConfig, delta: &[f64; 6]) -> Limits {
    let turns_only = norm(&delta[..3]) < FUZZ;
    let length = if turns_only { norm(&delta[3..]) } else { norm(&delta[..3]) };
    let (seconds, squared) = axis_times(config, delta);
    Limits { turns_only, length, most: length / seconds, acceleration: length / squared }
}

pub(super) fn circle_limits(
    config: &MachineConfig,
    arc: &Arc,
    delta: &[f64; 6],
    places: &[[f64; 6]],
) -> Limits {
    let along = lengths(places);
    let length = along[along.len() - 1];
    let in_plane = (length.powi(2) - delta[arc.normal].powi(2)).max(0.0).sqrt();
    let planar = |limit: &dyn Fn(usize) -> f64| {
        (0..3).filter(|axis| *axis != arc.normal).map(limit).fold(f64::INFINITY, f64::min)
    };
    let acceleration = planar(&|axis| config.axes[axis].max_acceleration);
    let across = acceleration * (1.0 - ALONG_CIRCLES * ALONG_CIRCLES).sqrt();
    let speed = planar(&|axis| config.axes[axis].max_velocity).min((across * arc.radius).sqrt());
    let (seconds, squared) = axis_times(config, delta);
    Limits {
        turns_only: false,
        length,
        most: length / seconds.max(in_plane / speed),
        acceleration: length / squared.max(in_plane / acceleration),
    }
}

/// Unit tangents of X Y Z at both ends; between the places of an arc it turns evenly.
pub(super) fn directions(places: &[[f64; 6]]) -> (Vector3<f64>, Vector3<f64>) {
    let chord = |a: &[f64; 6], b: &[f64; 6]| {
        let way = Vector3::new(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
        // LinuxCNC's direction of a move that stands still in X Y Z.
        if way.norm() < FUZZ * 1e-6 { Vector3::x() } else { way.normalize() }
    };
    let last = places.len() - 1;
    if last < 2 {
        let way = chord(&places[0], &places[last]);
        return (way, way);
    }
    let at_end = |a: Vector3<f64>, b: Vector3<f64>| (a * 1.5 - b * 0.5).normalize();
    (
        at_end(chord(&places[0], &places[1]), chord(&places[1], &places[2])),
        at_end(
            chord(&places[last - 1], &places[last]),
            chord(&places[last - 2], &places[last - 1]),
        ),
    )
}
