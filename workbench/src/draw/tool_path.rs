// SPDX-License-Identifier: GPL-2.0-or-later
//! The path of the control point, in planes and in space.

use crate::draw::lines::apart;
use crate::draw::plot::DrawError;
use crate::draw::sample::Sample;
use crate::draw::sheet::{Frame, STYLES, drawn, legend, padded, path_axes, project, span};
use kinematics::Letter;
use plotters::prelude::*;

/// Tool axes drawn along the path.
const NEEDLES: usize = 60;

/// A path does not move along a coordinate that changes by less than this share of the others.
const LEAST_EXTENT: f64 = 1e-6;

pub(super) fn tool_path(world: &[&Sample], unit: &str) -> Result<String, DrawError> {
    let views = views(world);
    let grid = [(1, 1), (1, 1), (1, 2), (2, 2)][views.len()];
    drawn(|root| {
        for (area, View { title, across, up }) in root.split_evenly(grid).iter().zip(views) {
            let point = |s: &&Sample| (s.pose[across.index()], s.pose[up.index()]);
            let points: Vec<(f64, f64)> = world.iter().map(point).collect();
            let frame = Frame {
                title,
                x: &format!("{} in {unit}", across.name()),
                y: &format!("{} in {unit}", up.name()),
                limits: vec![],
            };
            let mut chart = path_axes(area, &frame, &points)?;
            chart.draw_series(LineSeries::new(apart(&points), BLACK))?;
        }
        Ok(())
    })
}

/// A look at the path along one of the axes.
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

/// The views in which the path is more than a line; where it is one in all, those in which
/// it is not a point.
fn views(world: &[&Sample]) -> Vec<View> {
    let extent = |letter: Letter| {
        let (low, high) = span(world.iter().map(|s| s.pose[letter.index()]));
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
    drawn(|root| {
        let points: Vec<(f64, f64)> =
            world.iter().map(|s| project([s.pose[0], s.pose[1], s.pose[2]])).collect();
        let (x, y) = (padded(points.iter().map(|p| p.0)), padded(points.iter().map(|p| p.1)));
        let length = 0.08 * (x.end - x.start).max(y.end - y.start);
        let step = (world.len() / NEEDLES).max(1);
        let needles: Vec<_> = world.iter().step_by(step).map(|s| needle(s, length)).collect();
        let ends: Vec<(f64, f64)> = points.iter().chain(needles.as_flattened()).copied().collect();
        let frame = Frame {
            title: "Tool path, isometric: X right and down, Y right and up, Z up",
            x: &format!("(X + Y) cos 30° in {unit}"),
            y: &format!("Z + (Y - X)/2 in {unit}"),
            limits: vec![],
        };
        let mut chart = path_axes(root, &frame, &ends)?;
        chart
            .draw_series(LineSeries::new(apart(&points), BLACK.stroke_width(2)))?
            .label("control point")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 34, y)], BLACK.stroke_width(2)));
        let thin = STYLES[2].0.stroke_width(1);
        chart
            .draw_series(needles.iter().map(|ends| PathElement::new(*ends, thin)))?
            .label("tool axis")
            .legend(move |(x, y)| PathElement::new([(x, y + 6), (x + 12, y - 6)], thin));
        legend(&mut chart)
    })
}

/// From the control point along the tool axis, tip to holder.
fn needle(sample: &Sample, length: f64) -> [(f64, f64); 2] {
    let pose = kinematics::Pose::from_degrees(sample.pose);
    let end = pose.position + pose.rotation().column(2) * length;
    [project(pose.position.into()), project(end.into())]
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinematics::{MAX_JOINTS, MAX_LEGS};

    /// A path over these coordinates, each with a law of its own.
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
                passed: 0.0,
                forward: pose,
                corrections: [0.0; MAX_LEGS],
                tool: [0.0; 3],
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
