// SPDX-License-Identifier: GPL-2.0-or-later
//! Pictures of curves as programs.

use draw::curve::of_route;
use paths::file::PathFile;
use paths::route::route;
use std::fs;
use test_support::CIRCLE;
use test_support::shipped::{config, folder};

const LAWS: &str = "
[laws]
speed_mm_per_s = 20
[tolerance]
chord_mm = 0.01
angle_deg = 0.02
[program]
moves = 'lines'
zero_mm = [0, 0, 200]
";

#[test]
fn pictures_of_a_route_show_families_split_and_joints() {
    let config = config("pyramid");
    let found = route(&config, &PathFile::parse(&format!("{CIRCLE}{LAWS}")).unwrap()).unwrap();
    let plots = of_route(&config, &found).unwrap();
    let names: Vec<&str> = plots.iter().map(|plot| plot.file.as_str()).collect();
    let expected = ["families-net.svg", "families-surfaces.svg", "split.svg", "split-tilts.svg"];
    assert_eq!(names[..4], expected);
    assert_eq!(
        names[4..],
        ["carriages.svg", "carriages-speeds.svg", "table-axes.svg", "table-axes-speeds.svg"]
    );
    // Nine parameter values: their points are in the picture, in addition to that of the legend.
    assert_eq!(plots[0].svg.matches("<circle").count(), 10);
}

#[test]
fn the_split_names_the_part_that_moves_in_each_direction() {
    for (machine, parts) in [
        ("pyramid", ["X (table)", "Y (table)", "Z (platform)"]),
        ("pyramid-cross", ["X (platform)", "Y (table)", "Z (platform)"]),
    ] {
        let file = folder(machine).join("paths/cycloid.toml");
        let file = PathFile::parse(&fs::read_to_string(file).unwrap()).unwrap();
        let config = config(machine);
        let plots = of_route(&config, &route(&config, &file).unwrap()).unwrap();
        let split = plots.iter().find(|plot| plot.file == "split.svg").unwrap();
        for part in parts {
            assert!(split.svg.contains(part), "{machine}: {part}");
        }
    }
}
