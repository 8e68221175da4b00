// SPDX-License-Identifier: GPL-2.0-or-later
//! The path of the control point, or of the tip on the work, in planes and in space.

use crate::key::{Key, Sign, keyed};
use crate::lines::without_stairs;
use crate::plot::DrawError;
use crate::sample::Sample;
use crate::sheet::{Frame, drawn, path_axes, span};
use crate::space::{Space, project};
use crate::style::{BLUE, VERMILLION};
use crate::thin::places_apart;
use kinematics::{Letter, Vector3};
use plotters::prelude::*;

/// Number of tool axes drawn along the path.
const NEEDLES: usize = 60;

/// Length of a tool axis, as a share of the path's largest side.
const NEEDLE: f64 = 0.12;

/// Least change of a coordinate, as a share of the others', for the path to count as moving along it.
const LEAST_EXTENT: f64 = 1e-6;

pub(super) fn tool_path(world: &[&Sample], unit: &str) -> Result<String, DrawError> {
    let views = views(world);
    let grid = [(1, 1), (1, 1), (1, 2), (2, 2)][views.len()];
    drawn(|root| {
        for (area, View { title, across, up }) in root.split_evenly(grid).iter().zip(views) {
            let point = |s: &&Sample| (s.place()[across.index()], s.place()[up.index()]);
            let points: Vec<(f64, f64)> = world.iter().map(point).collect();
            let frame = Frame {
                title,
                x: &format!("{} in {unit}", across.name()),
                y: &format!("{} in {unit}", up.name()),
                limits: vec![],
            };
            let mut chart = path_axes(area, &frame, &points)?;
            let path = without_stairs(&chart, &points);
            chart.draw_series([PathElement::new(path, BLUE.stroke_width(2))])?;
        }
        Ok(())
    })
}

/// A view of the path along one of the axes.
#[derive(Clone, Copy)]
struct View {
    title: &'static str,
    across: Letter,
    up: Letter,
}

const VIEWS: [View; 3] = [
    View { title: "Seen from above", across: Letter::X, up: Letter::Y },
    View { title: "Seen from the front", across: Letter::X, up: Letter::Z },
    View { title: "Seen from the side", across: Letter::Y, up: Letter::Z },
];

/// Returns the views in which the path is more than a line; if there is none, those in which
/// it is not a point.
fn views(world: &[&Sample]) -> Vec<View> {
    let extent = |letter: Letter| {
        let (low, high) = span(world.iter().map(|s| s.place()[letter.index()]));
        high - low
    };
    let most = Letter::ALL.into_iter().take(3).map(extent).fold(0.0, f64::max);
    let moves = |letter| extent(letter) > LEAST_EXTENT * most;
    let plane: Vec<View> =
        VIEWS.into_iter().filter(|view| moves(view.across) && moves(view.up)).collect();
    if !plane.is_empty() {
        return plane;
    }
    VIEWS.into_iter().filter(|view| most == 0.0 || moves(view.across) || moves(view.up)).collect()
}

pub(super) fn isometric(world: &[&Sample], unit: &str) -> Result<String, DrawError> {
    let all: Vec<Vector3<f64>> = world.iter().map(|sample| sample.place()).collect();
    let flat: Vec<(f64, f64)> = all.iter().map(project).collect();
    let path: Vec<Vector3<f64>> = places_apart(&flat, 1.0).into_iter().map(|k| all[k]).collect();
    let extent = |k: usize| {
        let (low, high) = span(all.iter().map(|place| place[k]));
        high - low
    };
    let length = NEEDLE * extent(0).max(extent(1)).max(extent(2)).max(1.0);
    let step = world.len().div_ceil(NEEDLES).max(1);
    let needles: Vec<_> = world.iter().step_by(step).map(|s| needle(s, length)).collect();
    let (bold, thin) = (BLUE.stroke_width(2), VERMILLION.stroke_width(1));
    let on_work = world.iter().any(|sample| sample.on_work.is_some());
    let point = if on_work { "tip on the work" } else { "control point" };
    let keys = [Key::new(Sign::Line(bold), point), Key::new(Sign::Line(thin), "tool axis")];
    let ends: Vec<Vector3<f64>> = all.iter().chain(needles.as_flattened()).copied().collect();
    keyed(&keys, |area| {
        let title = "Tool path, with the tool axis at some places";
        let view = Space::around(title, unit, &ends).draw(area, vec![])?;
        needles.iter().try_for_each(|ends| area.draw(&view.path(ends, thin)))?;
        area.draw(&view.path(&path, bold))?;
        Ok(())
    })
}

/// Returns the ends of a line from the tip along the tool axis to the holder.
fn needle(sample: &Sample, length: f64) -> [Vector3<f64>; 2] {
    [sample.place(), sample.place() + sample.axis() * length]
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinematics::{MAX_EXTRA, MAX_JOINTS, MAX_LEGS};

    /// Creates a path over these coordinates, each with a different law.
    fn path(letters: &[Letter]) -> Vec<Sample> {
        let sample = |k: u32| {
            let mut pose = [5.0; 6];
            for letter in letters {
                pose[letter.index()] = (f64::from(k) * (1.0 + letter.index() as f64)).sin();
            }
            Sample {
                time: f64::from(k),
                in_world: true,
                pose,
                joints: [0.0; MAX_JOINTS],
                motors: [0.0; MAX_JOINTS],
                extra: [0.0; MAX_EXTRA],
                passed: 0.0,
                forward: pose,
                corrections: [0.0; MAX_LEGS],
                tool: [0.0; 3],
                on_work: None,
                iterations: 1.0,
                residual: 0.0,
            }
        };
        (0..100).map(sample).collect()
    }

    #[test]
    fn a_path_is_seen_in_the_planes_it_moves_in() {
        use Letter::{B, X, Y, Z};
        for (letters, titles) in [
            (&[X, Z][..], &["Seen from the front"][..]),
            (&[Y, Z, B], &["Seen from the side"]),
            (&[X, Y, Z], &["Seen from above", "Seen from the front", "Seen from the side"]),
            (&[Z], &["Seen from the front", "Seen from the side"]),
            (&[B], &["Seen from above", "Seen from the front", "Seen from the side"]),
        ] {
            let samples = path(letters);
            let found = views(&samples.iter().collect::<Vec<_>>());
            assert_eq!(found.iter().map(|view| view.title).collect::<Vec<_>>(), titles);
        }
    }
}
