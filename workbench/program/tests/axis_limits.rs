// SPDX-License-Identifier: GPL-2.0-or-later
//! Axis limits that `pkm check` suggests: every pose within them is legal.

use crate::preflight::{follow, rapid};
use check::report::check;
use kinematics::Letter;
use machine::proof::axis_box::{AxisBox, range};
use machine::proof::reach::Reach;
use machine::read::tools::Tool;
use program::motion::Move;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use test_support::shipped::{CONSTRAINED, MACHINES, cases, config, drawn as pose, whole};

#[test]
fn shipped_machines_fit_and_every_pose_of_the_suggested_box_can_be_taken() {
    /// Poses sampled in each box.
    const POSES: usize = 20_000;
    for machine in MACHINES.into_iter().chain(CONSTRAINED) {
        let (whole, config) = (whole(machine), config(machine));
        for second in whole.mechanisms.iter().skip(1) {
            let report = check(&whole, second, |_| ()).unwrap();
            assert!(report.fits(), "{machine}, second: {:?}", report.findings);
        }
        let report = check(&whole, &config, |_| ()).unwrap();
        assert!(report.fits(), "{machine}: {:?}", report.findings);
        let limits = report.suggestion.unwrap();
        if config.chain.is_empty() {
            // Otherwise they are not limits of programs.
            go_over_corners(machine, &limits, &report.proved_tools);
        }
        let reach = Reach::new(&config).unwrap();
        let side = |pose: &[f64; 6]| {
            config
                .machine
                .at(&kinematics::Pose::from_degrees(*pose), &config.spindle)
                .unwrap()
                .assembly()
                .unwrap()
        };
        let reaches = report
            .proved_tools
            .iter()
            .map(|t| Reach::with_tool(&config, config.spindle + t.offset));
        let tools: Vec<Reach> = reaches.map(Result::unwrap).collect();
        let mut rng = Pcg64::seed_from_u64(6);
        for n in 0..cases(POSES) {
            let pose = pose(&mut rng, &limits);
            assert_eq!(reach.check(&pose), Ok(()), "{machine} {pose:?}");
            let with = n % (tools.len() + 1);
            if with > 0 {
                assert_eq!(tools[with - 1].check(&pose), Ok(()), "{machine} {with} {pose:?}");
            }
            // No singular pose is between this one and home.
            assert_eq!(side(&pose), side(&config.home), "{machine} {pose:?}");
        }
        let moved = Letter::ALL.map(|letter| !config.machine.layout().is_held(letter));
        let whole = range(&config);
        for k in (0..6).filter(|k| moved[*k]) {
            let share = (limits.high[k] - limits.low[k]) / (whole.high[k] - whole.low[k]);
            // A quarter: half of the present share of the machines that are not proved completely.
            assert!(share > 0.25, "{machine}: {share} of axis {k}");
        }
    }
}

/// Sets the suggested limits in the machine, and moves from corner to corner of them with every tool.
fn go_over_corners(machine: &str, limits: &AxisBox, tools: &[Tool]) {
    // A single mechanism: at corners of their limits two may meet.
    let mut config = config(machine);
    for (k, axis) in config.axes.iter_mut().enumerate() {
        (axis.min, axis.max) = (limits.low[k], limits.high[k]);
    }
    let corner = |n: usize| {
        std::array::from_fn(|k| match n >> k & 1 {
            _ if config.machine.layout().is_held(Letter::ALL[k]) => config.start[k],
            0 => limits.low[k],
            _ => limits.high[k],
        })
    };
    let mut moves = vec![rapid(0, config.start)];
    for offset in std::iter::once([0.0; 3]).chain(tools.iter().map(|tool| tool.offset.into())) {
        let ends = (0..64).map(corner).chain([config.start]);
        moves.extend(ends.map(|end| Move { tool: offset, ..rapid(1, end) }));
    }
    let found = follow(&config, &moves);
    assert!(found.fits(), "{machine}: {:?}", found.breaks);
}
