// SPDX-License-Identifier: GPL-2.0-or-later
//! Programs thinned for plots without losing extremes.

use kinematics::{Limit, MAX_EXTRA, MAX_JOINTS};
use linuxcnc::row::{Beside, Flags, Row};
use program::loads::Motion;
use program::motion::{Move, MoveKind, Spindle};
use program::timeline::{Abscissa, Course, MOST_SAMPLES, Sample};
use test_support::control::standing;
use test_support::shipped::{config, whole};

#[test]
fn a_peak_of_one_cycle_in_a_million_survives() {
    let config = config("hexapod");
    let home = standing(&config);
    let mut course = Course::new(&config);
    const CYCLES: u64 = 1_000_000;
    let (slow, far, late) = (123_457, 654_321, 987_654);
    for cycle in 0..CYCLES {
        let mut row = Row { cycle, line: (cycle / 1000) as u32 + 1, ..home };
        match cycle {
            // A step of a tenth of the motion in a cycle at the speed limit.
            c if c == slow => row.joints[2] += 0.1 * config.joints[2].max_velocity * config.period,
            c if c == far => row.pose[1] = config.axes[1].max + 1.0,
            c if c == late => {
                row.errors[4] = 1.5;
                row.feed = 0.25;
            }
            _ => (),
        }
        course.see(&row);
    }
    let found = course.finish();
    assert!((MOST_SAMPLES / 2..=MOST_SAMPLES).contains(&found.samples.len()));
    assert_eq!(found.abscissa, Abscissa::Seconds);
    let seconds = |cycle: u64| cycle as f64 * config.period;
    assert_eq!(found.end, seconds(CYCLES - 1));
    // Each stretch is below a hundredth of a percent of the whole on either side.
    let near = |at: f64, cycle: u64| (at - seconds(cycle)).abs() < 3e-4 * found.end;

    let fastest = found.samples.iter().max_by(|a, b| a.speeds[2].total_cmp(&b.speeds[2])).unwrap();
    // Joints are read in double precision: a nanometer of a meter's step.
    assert!((fastest.speeds[2] - 0.1).abs() < 1e-6 && near(fastest.at, slow), "{fastest:?}");
    let line = (slow / 1000) as u32 + 1;
    assert!((fastest.lines[0]..=fastest.lines[1]).contains(&line), "{fastest:?}");

    let broken: Vec<_> =
        found.samples.iter().filter(|s| s.rooms[Limit::Axis.index()] < 0.0).collect();
    assert!(broken.len() == 1 && near(broken[0].at, far), "{broken:?}");
    assert_eq!(broken[0].pose[1], config.axes[1].max + 1.0, "the pose beyond the limit is kept");
    assert_eq!(found.range(|sample| sample.poses[1])[1], config.axes[1].max + 1.0);

    let slowed: Vec<_> = found.samples.iter().filter(|sample| sample.feed < 1.0).collect();
    assert!(slowed.len() == 1 && slowed[0].feed == 0.25 && near(slowed[0].at, late));
    assert!(slowed[0].errors[4] == 1.5 && slowed[0].room() == -0.5);
}

#[test]
fn extra_axes_have_values_speeds_errors_and_rooms() {
    let config = config("lathe-counter-spindle");
    let home = standing(&config);
    let (first, w) = (config.joints.len(), &config.extra[1]);
    let mut course = Course::new(&config);
    let speed = 0.5 * w.joint.max_velocity;
    for cycle in 0..1000 {
        let mut row = Row { cycle, ..home };
        row.extra.positions[1] = w.range()[1] + 1.0 - speed * (999 - cycle) as f64 * config.period;
        if cycle == 500 {
            (row.extra.errors[1], row.extra.allowed[1]) = (-3.0, 2.0);
        }
        course.see(&row);
    }
    let found = course.finish();
    let most = |of: &dyn Fn(&Sample) -> f64| found.samples.iter().map(of).fold(0.0, f64::max);
    let [low, high] = found.range(|sample| sample.joints[first + 1]);
    assert!(high == w.range()[1] + 1.0 && low < high - 0.9 * speed, "{low} to {high}");
    // Rounding of positions of a meter over a millisecond.
    assert!((most(&|sample| sample.speeds[first + 1]) - 0.5).abs() < 1e-9);
    assert_eq!(most(&|sample| sample.errors[first + 1]), 1.5);
    assert_eq!(most(&|sample| sample.speeds[first]), 0.0, "C stands");
    let least = found.samples.last().unwrap().rooms[Limit::JointRange.index()];
    let [low, high] = w.range();
    assert!((least + 1.0 / (high - low)).abs() < 1e-9, "{least}");
}

#[test]
fn speeds_and_accelerations_are_those_of_three_cycles() {
    let config = config("linear-delta");
    let home = standing(&config);
    let mut motion = Motion::START;
    let period = 0.001;
    // A parabola: s = a t²/2.
    let acceleration = 500.0;
    let row = |cycle: u64| {
        let mut row = home;
        row.cycle = cycle;
        row.joints[0] += acceleration * (cycle as f64 * period).powi(2) / 2.0;
        row
    };
    let mut next = |row: &Row| motion.next(row, &row.joints, period);
    for cycle in 0..10 {
        let [speeds, accelerations] = next(&row(cycle));
        let expected = if cycle < 2 { 0.0 } else { acceleration };
        // Rounding of positions below a meter over the square of the period.
        assert!((accelerations[0] - expected).abs() < 1e-5, "{cycle}: {}", accelerations[0]);
        let middle = if cycle == 0 { 0.0 } else { (cycle as f64 - 0.5) * period };
        assert!((speeds[0] - acceleration * middle).abs() < 1e-8, "{cycle}: {}", speeds[0]);
    }
    // After a gap, or with the drives off, nothing is known.
    assert_eq!(next(&row(20)), [[0.0; MAX_JOINTS]; 2]);
    let off = Row { flags: Flags::default(), ..row(21) };
    assert_eq!(next(&off), [[0.0; MAX_JOINTS]; 2]);
    assert_eq!(next(&row(22)), [[0.0; MAX_JOINTS]; 2]);
    assert_ne!(next(&row(23))[0], [0.0; MAX_JOINTS]);
}

#[test]
fn the_path_of_moves_goes_by_its_length() {
    let config = config("linear-delta");
    let step = |line, end| Move {
        kind: MoveKind::Feed,
        line,
        end,
        feed: 10.0,
        angular_feed: 0.0,
        tool: [0.0; 3],
        file: 0,
        extra: false,
        second: None,
        lasts: None,
        extra_end: [0.0; MAX_EXTRA],
        spindle: Spindle::Unknown,
        is_per_turn: false,
    };
    let mut ends = [config.home; 3];
    ends[0][0] += 30.0;
    ends[1][0] += 30.0;
    ends[1][1] -= 40.0;
    ends[2][0] += 1e6;
    let moves: Vec<Move> = ends.iter().zip(7..).map(|(end, line)| step(line, *end)).collect();
    let found = Course::along(&config, &moves[..2]);
    assert_eq!(found.abscissa, Abscissa::Length);
    assert!(found.samples.len() <= MOST_SAMPLES && (found.end - 70.0).abs() < 1e-9);
    let corner = found.place(&config, 8, &ends[0]).unwrap();
    assert!((corner - 30.0).abs() < 70.0 * 3.0 / MOST_SAMPLES as f64, "{corner}");
    assert_eq!(found.place(&config, 9, &ends[0]), None, "the program does not come there");
    assert!(found.samples.iter().all(|sample| sample.room() > 0.0));
    // Out of reach there are no joint values, and no room.
    let found = Course::along(&config, &moves);
    let last = found.samples.last().unwrap();
    assert!(last.joints[0][0] > last.joints[0][1] && last.room() == f64::NEG_INFINITY);
}

#[test]
fn the_course_of_the_second_of_two_mechanisms_is_its_own() {
    let second = whole("lathe-mirrored").mechanism(2).unwrap();
    let own = standing(&second);
    let beside = Beside { pose: own.pose, tool: own.tool };
    let mut row = Row { pose: [1.0; 6], joints: [7.0; MAX_JOINTS], second: beside, ..own };
    row.joints[4..8].copy_from_slice(&own.joints[..4]);
    let mut course = Course::new(&second);
    course.see(&row);
    let joints = course.finish().samples[0].joints;
    assert_eq!([0, 1, 2, 3].map(|i| joints[i]), [0, 1, 2, 3].map(|i| [own.joints[i]; 2]));
}
