// SPDX-License-Identifier: GPL-2.0-or-later
//! Bounds of machines whose drives have a wrong scale.

use crate::shop::Shop;
use crate::two_runs::shops;
use calibrate::at_tool;
use calibrate::model::{Frame, Model, Tolerance};
use calibrate::reading::{Instrument, Measured, Reading};
use calibrate::study::{Given, Study, study};
use kinematics::Vector3;

/// Returns the error of the tip after a calibration.
fn error(shop: &Shop, study: &Study) -> f64 {
    shop.error(&study.model.machine(&study.found.changes).unwrap())
}

#[test]
fn twelve_machines_with_a_wrong_scale_stay_below_their_bounds_or_the_excluded_scale_explains_it() {
    let mut excluded = 0;
    let mut machines = 0;
    for (k, (mut shop, noise)) in shops().into_iter().enumerate() {
        for (run, drives) in [0.999, 1.002, 1.005].into_iter().enumerate() {
            shop.drives = drives;
            shop.build(700 + run as u64);
            let table = shop.table(2, noise);
            let study = study(&shop.config, shop.given(&table), |_| {}).unwrap();
            let (error, below) = (error(&shop, &study), study.shape[1].below);
            let by_scale = (drives - 1.0_f64).abs() * study.scale.motion;
            println!(
                "{k} {drives}: {error:.5} below {below:.5}, by scale {by_scale:.5} {:?} {}",
                study.scale,
                study.scale.is_covered()
            );
            let bound = if study.scale.is_covered() { below } else { below + by_scale };
            assert!(error <= bound, "{k} {drives}: {error} {below} {by_scale}");
            excluded += usize::from(error > below);
            machines += 1;
        }
    }
    assert_eq!(machines, 12);
    // The scale matters: without it, bounds would be violated.
    assert!(excluded > 3, "{excluded}");
}

/// Returns a tracker's positions of the tip.
fn tracked(shop: &Shop, count: usize) -> Given {
    let (config, tool) = (&shop.config, shop.setup.gauge.tool);
    let model = Model::new(config.geometry, config.offsets, &Tolerance::of_lengths(0.1)).unwrap();
    let reading = |(k, pose): (usize, &kinematics::Pose)| {
        // The noise of a tracker: any three numbers of a micrometer that do not repeat.
        let noise = Vector3::from_fn(|i, _| 1.5e-3 * (12.9 * (3 * k + i) as f64).sin());
        Reading {
            name: format!("reading {k}"),
            group: k,
            joints: config.machine.inverse(pose, &tool).unwrap(),
            pose: *pose,
            tool,
            frame: 0,
            measured: Measured::Position(shop.reached(pose, &tool).position - tool + noise),
            instrument: Instrument::default(),
        }
    };
    let poses = at_tool::poses(config, &tool, count, 4);
    Given {
        model: model.with_unknown_frame(Frame::BASE),
        readings: poses.iter().enumerate().map(reading).collect(),
        instruments: vec!["tracker".into()],
        noise: None,
        typed: vec![],
    }
}

#[test]
fn a_tracker_determines_the_scale_and_names_a_wrong_one() {
    let [(mut shop, _), ..] = shops();
    for drives in [1.0, 1.00004, 0.9995] {
        shop.drives = drives;
        shop.build(800);
        let study = study(&shop.config, tracked(&shop, 60), |_| {});
        // A large error is no noise: readings contradict each other.
        let Ok(study) = study else {
            assert!(drives < 1.0, "{drives}");
            continue;
        };
        let (error, below) = (error(&shop, &study), study.shape[1].below);
        println!("{drives}: {error:.5} below {below:.5} {:?}", study.scale);
        let is_right = drives == 1.0;
        assert_eq!((study.scale.is_off(), study.scale.is_covered()), (!is_right, is_right));
        if is_right {
            assert!(error < below, "{error} {below}");
        } else {
            // Four deviations, and the share that outliers left out take with them.
            let off = (study.scale.change - (drives - 1.0)).abs();
            assert!(off < 4.0 * study.scale.deviation + 0.1 * (drives - 1.0).abs(), "{off}");
        }
    }
}
