// SPDX-License-Identifier: GPL-2.0-or-later
//! Pictures of a workspace.

use draw::workspace::of_workspace;
use studies::study::body::{Body, Effort};
use studies::study::file::Study;
use studies::study::slice::{Plane, Slice};
use studies::study::workspace::Workspace;
use test_support::shipped::config;

/// The area within all limits has a corner for each ray.
#[test]
fn a_slice_has_its_area() {
    const RAYS: usize = 90;
    let config = config("linear-delta");
    let workspace =
        Workspace::new(&config, config.spindle, vec![[0.0; 3]], &Study::default()).unwrap();
    let step = workspace.extent() / 150.0;
    let effort = Effort { bands: 12, step, grid: 8, progress: &|_| () };
    let home = config.home_pose().position;
    let body = Body::seen(&workspace, home, &effort).unwrap();
    let slice = Slice::seen(&workspace, Plane::parse("xz").unwrap(), home, RAYS, &effort);
    let plots = of_workspace(&config, &body, &[slice], Some(0.0)).unwrap();
    let slice = &plots.last().unwrap().svg;
    assert!(
        slice.contains("Slice XZ: reachable with a tilt of 0 degrees in every direction, by limit")
    );
    let areas = slice.split("<polygon ").skip(1).filter(|tag| tag.contains("opacity=\"0.14\""));
    let corners = areas.map(|tag| {
        let points = tag.split_once("points=\"").unwrap().1.split_once('"').unwrap().0;
        points.split_whitespace().count()
    });
    assert!(corners.clone().any(|count| count >= RAYS), "{:?}", corners.collect::<Vec<_>>());
}
