// SPDX-License-Identifier: GPL-2.0-or-later
//! All integration tests of the crate in one binary, which is linked once.

mod generated;

use linuxcnc::row::{Beside, Extra, Row};
use machine::read::machine::MachineConfig;
use test_support::generated::generated;
use test_support::shipped::whole;
use view::track::{MOST_POINTS, Track, VALUES};

/// Returns a row in which all values of both mechanisms differ.
fn row() -> Row {
    let from = |first: usize| std::array::from_fn(|k| (first + k) as f64);
    let second = Beside { pose: from(30), tool: [41.0, 42.0, 43.0] };
    let extra = Extra { world: std::array::from_fn(|k| 50.0 + k as f64), ..Extra::default() };
    Row { cycle: 8000, pose: from(10), tool: [21.0, 22.0, 23.0], second, extra, ..Row::default() }
}

#[test]
fn the_track_of_the_second_of_two_mechanisms_is_its_own() {
    let second = whole("lathe-mirrored").mechanism(2).unwrap();
    let alone = second.into();
    let mut track = Track::new(&alone);
    track.see(&alone, &row());
    let row = row();
    let values = [&row.second.pose[..], &row.second.tool].concat();
    assert_eq!(track.points()[0].values[..9], values);
}

#[test]
fn a_point_has_the_time_in_cycles_of_its_machine_and_the_extra_axes_by_their_letters() {
    // A machine in cycles of 2 ms, with extra axes that carry nothing.
    let drawn = generated(11);
    let folder = tempfile::tempdir().unwrap();
    let config = MachineConfig::read(&drawn.write(folder.path())).unwrap();
    let mut track = Track::new(&config);
    track.see(&config, &row());
    let point = &track.points()[0];
    let seconds = 8000.0 * f64::from(drawn.period) * 1e-9;
    assert!((point.at - seconds).abs() < 1e-9 && drawn.period != 1_000_000, "{}", point.at);
    let letters = drawn.extra.iter().map(|extra| extra.axis.letter);
    let expected: Vec<f64> =
        letters.map(|own| 50.0 + "XYZABCUVW".find(own).unwrap() as f64).collect();
    assert_eq!(point.values[drawn.mechanisms.len() * VALUES..], expected);
}

/// Returns the number of points of a value that swings between 0 and `swing`.
fn kept(config: &MachineConfig, k: usize, swing: f64, count: usize) -> usize {
    let values = VALUES * config.mechanisms.len() + config.first().extra.len();
    let mut track = Track::new(config);
    for n in 0..count {
        let mut point = vec![0.0; values];
        point[k] = if n % 2 == 0 { 0.0 } else { swing };
        track.take(n as f64, 1, point);
    }
    track.points().len()
}

#[test]
fn extra_axes_have_the_tolerance_of_their_unit_and_a_long_track_gets_coarser() {
    // Extra axes A, C and W of a machine in mm, whose size makes the two tolerances differ.
    let drawn = generated(4);
    let folder = tempfile::tempdir().unwrap();
    let config = MachineConfig::read(&drawn.write(folder.path())).unwrap();
    let length = 2e-5 * config.first().machine.size();
    assert!(length > 5e-3, "{length}");
    for (n, extra) in drawn.extra.iter().enumerate() {
        // A line keeps what swings by less than its tolerance, to both sides of it.
        let tolerance = if "ABC".contains(extra.axis.letter) { 2e-3 } else { length };
        assert_eq!(kept(&config, VALUES + n, 0.5 * tolerance, 100), 2, "{}", extra.axis.letter);
        let all = kept(&config, VALUES + n, 4.0 * tolerance, 100);
        assert!(all > 90, "{}: {all}", extra.axis.letter);
    }
    let many = kept(&config, 0, 3.0 * length, MOST_POINTS + 10);
    assert!(many < MOST_POINTS / 2, "{many}");
}
