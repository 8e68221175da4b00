// SPDX-License-Identifier: GPL-2.0-or-later
//! Pictures of a motion.

use draw::motion::all;
use draw::sample::Sample;
use kinematics::{MAX_EXTRA, MAX_JOINTS};
use test_support::shipped::config;

/// A path begins at 0 seconds with its first cycle in world mode, regardless of the time that homing takes.
#[test]
fn the_time_before_world_mode_is_not_in_the_pictures() {
    let config = config("hexapod");
    let sample = |cycle: i32, seconds: f64| {
        let mut pose = config.home;
        pose[0] += f64::from(cycle);
        let at = config.machine.at(&kinematics::Pose::from_degrees(pose), &config.spindle);
        Sample {
            time: seconds + 0.25 * f64::from(cycle),
            in_world: cycle >= 0,
            pose,
            joints: *at.unwrap().joints(),
            motors: [0.0; MAX_JOINTS],
            extra: [0.0; MAX_EXTRA],
            passed: 0.0,
            forward: pose,
            corrections: Default::default(),
            tool: config.spindle.into(),
            on_work: None,
            iterations: 1.0,
            residual: 0.0,
        }
    };
    // Quarters of seconds are exact.
    let drawn = |seconds: f64| {
        let samples: Vec<Sample> = (-1..40).map(|cycle| sample(cycle, seconds)).collect();
        let plots = all(&config, &samples).unwrap();
        plots.into_iter().map(|plot| (plot.file, plot.svg)).collect::<Vec<_>>()
    };
    let first = drawn(0.25);
    assert!(first.len() > 4);
    for ((name, own), (_, late)) in first.iter().zip(drawn(64.0)) {
        assert!(*own == late, "{name}");
    }
}
