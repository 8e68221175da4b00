// SPDX-License-Identifier: GPL-2.0-or-later
//! What the page is given, and what its kinematics answer. tests/page opens it in a browser.

use crate::shipped::{MACHINES, config, ini, whole};
use kinematics::{Joints, Limits, MAX_JOINTS, Pose, Vector3};
use machine::proof::axis_box::range;
use machine::read::mechanism::Mechanism;
use page_core::{Described, Drawn};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::path::Path;
use std::process::{Command, Output};
use studies::study::rods::View;

/// Some roundings of lengths of 1e3.
const LENGTH: f64 = 1e-9;

fn described(config: &Mechanism) -> Described {
    let of = |value: fn(&machine::read::joints::Joint) -> f64| -> Joints {
        std::array::from_fn(|i| config.joints.get(i).map_or(f64::INFINITY, value))
    };
    let limits = Limits { max: of(|joint| joint.max), tilt: 12.5, ..Limits::NONE };
    Described { geometry: config.geometry, offsets: config.offsets, limits }
}

fn numbers(described: &Described) -> Vec<f64> {
    let mut numbers = vec![];
    described.write(|value| numbers.push(value));
    numbers
}

fn mechanisms() -> impl Iterator<Item = Mechanism> {
    MACHINES.into_iter().flat_map(|machine| whole(machine).mechanisms)
}

#[test]
fn a_machine_in_numbers_is_the_same_machine() {
    for config in mechanisms() {
        let described = described(&config);
        let read = Described::read(&numbers(&described)).unwrap();
        assert_eq!(read, described);
        assert_eq!(read.geometry.hash(), config.geometry.hash());
    }
}

#[test]
fn other_numbers_are_no_machine() {
    let whole = numbers(&described(&config("hexapod")));
    for length in 0..whole.len() {
        assert!(Described::read(&whole[..length]).is_none(), "the first {length}");
    }
    assert!(Described::read(&[&whole[..], &[0.0]].concat()).is_none());
    for place in 0..20 {
        let mut wrong = whole.clone();
        wrong[place] = f64::NAN;
        assert!(Described::read(&wrong).is_none_or(|read| read.freeze().is_none()), "{place}");
    }
}

#[test]
fn what_is_drawn_is_what_the_machine_and_the_rods_say() {
    let mut rng = Pcg64::seed_from_u64(2020);
    for config in mechanisms() {
        let described = Described::read(&numbers(&described(&config))).unwrap();
        let machine = described.freeze().unwrap();
        let (whole, view) = (range(&config), View::new(&config, vec![], 0.0));
        let mut reached = 0;
        for _ in 0..200 {
            let degrees = whole.at(std::array::from_fn(|_| rng.random()));
            let pose = Pose::from_degrees(degrees);
            let own = Vector3::from_fn(|_, _| rng.random_range(-20.0..20.0) * config.units_per_mm);
            let tool = config.spindle + own;
            let (centre, limits) = (config.geometry.centre, &described.limits);
            let drawn = Drawn::new(&machine, centre, limits, degrees, tool.into());
            let (joints, rods) = (config.machine.inverse(&pose, &tool), view.at(&pose, &tool));
            assert_eq!(drawn.as_ref().map(|drawn| drawn.joints).map_err(|e| *e), joints);
            let (Ok(drawn), Ok(rods)) = (drawn, rods) else { continue };
            for (end, rod) in drawn.segments.iter().zip(&rods.rods) {
                assert_eq!([end.base, end.platform], [rod.ends.base, rod.ends.platform]);
            }
            // A table carries the work below a platform that stands; else the tip is where it is programmed.
            let tip = drawn.tip - drawn.table - (pose.position - tool);
            assert!(tip.norm() < LENGTH * config.machine.size().max(1.0), "{tip}");
            let ranges = drawn.margins().filter(|margin| margin.part != kinematics::Part::Whole);
            assert!(ranges.count() >= config.joints.len().min(MAX_JOINTS));
            reached += 1;
        }
        assert!(reached > 100, "{}: {reached}", config.file.display());
    }
}

fn view(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_pkm"))
        .current_dir(folder)
        .arg("view")
        .args(arguments)
        .output()
        .unwrap()
}

#[test]
fn the_page_of_a_machine_is_one_file_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let hexapod = ini("hexapod");
    assert_eq!(view(folder.path(), &[hexapod.to_str().unwrap()]).status.code(), Some(0));
    let page = std::fs::read_to_string(folder.path().join("hexapod.html")).unwrap();
    assert!(page.len() < 2_000_000, "{}", page.len());
    for foreign in [" src=", "rel=\"stylesheet\"", "@import", "import("] {
        assert!(
            !page.split("<script type=\"module\">").next().unwrap().contains(foreign),
            "{foreign}"
        );
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_program_that_cannot_be_read_is_told_and_the_page_shows_the_machine() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("broken.ngc"), "G1 X10 F100\nG1 X[1+\nM2\n").unwrap();
    let out = view(
        folder.path(),
        &[ini("hexapod").to_str().unwrap(), "broken.ngc", "--html", "page.html"],
    );
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains("broken.ngc"));
    assert!(folder.path().join("page.html").is_file());
}

#[test]
fn what_cannot_be_written_or_drawn_is_refused_and_nothing_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let hexapod = ini("hexapod");
    let file = hexapod.to_str().unwrap();
    let cases: [(&[&str], &str); 6] = [
        (&["--html", "nowhere/page.html"], "nowhere"),
        (&["--picture", "p.png", "--browser", "/nowhere/browser"], "/nowhere/browser"),
        (&["--picture", "p.png", "--browser", "/bin/false"], "drew 0 of 1 frames"),
        (&["--picture", "p.png", "--size", "63", "100"], "an even number"),
        (&["--video", "v.mp4"], "PROGRAM.ngc"),
        (&["--from", "below"], "3D, front, side, top"),
    ];
    for (arguments, told) in cases {
        let out = view(folder.path(), &[&[file], arguments].concat());
        let stderr = String::from_utf8_lossy(&out.stderr).into_owned();
        assert_eq!(out.status.code(), Some(2), "{arguments:?} {stderr}");
        assert!(stderr.contains(told), "{arguments:?}: {stderr}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{arguments:?}");
    }
}
