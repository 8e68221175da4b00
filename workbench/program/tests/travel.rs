// SPDX-License-Identifier: GPL-2.0-or-later
//! Available travel, compared with individually sampled poses.

use kinematics::{Letter, Vector3};
use machine::proof::axis_box::range;
use machine::proof::reach::Reach;
use machine::read::machine::MachineConfig;
use program::travel::{Stand, travel};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use test_support::shipped::{self, unchained, whole};

/// Number of poses sampled along a path.
const LOOKS: u32 = 400;

/// Accuracy of reported positions, as a share of the machine's size: a piece of a path of this length is not halved,
/// and it is a part of one of eight parts.
const RESOLUTION: f64 = 1e-5;

/// Returns the machine with unlimited ranges of its axes.
fn free(machine: &str) -> MachineConfig {
    let mut config = whole(machine);
    for axis in &mut config.mechanisms[0].programmed {
        (axis.min, axis.max) = (f64::NEG_INFINITY, f64::INFINITY);
    }
    config
}

#[test]
fn a_long_way_is_followed_to_its_end() {
    let mut config = whole("triaglide");
    let first = &mut config.mechanisms[0];
    first.programmed[0].max = 1e5;
    first.joints.iter_mut().for_each(|joint| joint.max = 9000.0);
    let found = travel(&config, &Stand::home(&config)).unwrap();
    let plus = &found[0].plus;
    // From the center of the guides, until the carriages in front reach the end.
    assert!(plus.left.is_some_and(|left| left > 5000.0 && left < 9000.0), "{plus:?}");
    assert!(plus.stop.as_ref().is_some_and(|stop| stop.contains("carriage")), "{plus:?}");
}

#[test]
fn poses_up_to_the_reported_end_keep_all_limits_and_just_behind_it_one_does_not() {
    let mut rng = Pcg64::seed_from_u64(22);
    let mut stopped = 0;
    for machine in unchained() {
        let config = free(machine);
        if config.mechanisms.len() > 1 {
            continue;
        }
        let whole = range(&shipped::config(machine));
        let reach = Reach::new(config.first()).unwrap();
        for _ in 0..3 {
            let pose = whole.at(std::array::from_fn(|_| rng.random()));
            if reach.check(&pose).is_err() {
                continue;
            }
            let mut stand = Stand::home(&config);
            stand.world[..6].copy_from_slice(&pose);
            for found in travel(&config, &stand).unwrap() {
                let own = |l: &Letter| l.name() == found.letter;
                let Some(letter) = Letter::ALL.into_iter().find(own) else { continue };
                if config.first().machine.layout().is_held(letter) {
                    // An extra axis, which only its own range limits.
                    continue;
                }
                let k = letter.index();
                for (side, sign) in [(&found.minus, -1.0), (&found.plus, 1.0)] {
                    let Some(left) = side.left else { continue };
                    let at = |way: f64| {
                        let mut pose = pose;
                        pose[k] += sign * way;
                        reach.check(&pose)
                    };
                    for n in 0..LOOKS {
                        let way = left * f64::from(n) / f64::from(LOOKS);
                        assert!(at(way).is_ok(), "{machine}: {found:?} at {way}");
                    }
                    let unit = if k < 3 { config.first().machine.size() } else { 360.0 };
                    let behind = (1..=20).map(|n| left + f64::from(n) * RESOLUTION * unit);
                    // A limit that is only touched is reported as well.
                    stopped += usize::from(behind.map(at).any(|seen| seen.is_err()));
                    assert!(side.stop.is_some());
                }
            }
        }
    }
    // Nearly all paths end at a violated limit, not at one that is touched.
    assert!(stopped > 200, "{stopped}");
}

#[test]
fn a_letter_beyond_its_own_range_can_go_back_and_no_further() {
    let config = whole("hexapod");
    let mut stand = Stand::home(&config);
    stand.world[2] = 401.0;
    let found = travel(&config, &stand).unwrap();
    let left = |letter: char| {
        let way = found.iter().find(|way| way.letter == letter).unwrap();
        [way.minus.left.unwrap(), way.plus.left.unwrap()]
    };
    assert_eq!(left('Z'), [301.0, 0.0]);
    assert_eq!(left('X'), [0.0, 0.0]);
}

#[test]
fn a_second_mechanism_ends_the_way_of_the_first() {
    let mut config = free("lathe-mirrored");
    for axis in &mut config.mechanisms[1].programmed {
        (axis.min, axis.max) = (f64::NEG_INFINITY, f64::INFINITY);
    }
    let found = travel(&config, &Stand::home(&config)).unwrap();
    let way = found.iter().find(|way| way.letter == 'Z').unwrap();
    let stop = way.plus.stop.as_deref().unwrap();
    assert!(stop.contains("mechanisms apart") || stop.contains("joint range"), "{stop}");
    assert_eq!(found.iter().map(|way| way.letter).collect::<String>(), "XYZBCUVW");
}

#[test]
fn a_table_that_turns_without_end_is_followed_for_a_turn() {
    let config = whole("hexapod-rotary-table");
    let mut stand = Stand::home(&config);
    stand.world[0] = 100.0;
    stand.tools[0] = config.first().spindle + Vector3::z() * 40.0;
    let found = travel(&config, &stand).unwrap();
    let table = found.iter().find(|way| way.letter == 'C').unwrap();
    assert_eq!((table.minus.left, table.plus.left), (Some(36000.0), Some(36000.0)));
}

/// An extra axis ends at the nearer limit of its joint and its axis, and the stop names that one.
#[test]
fn the_nearer_limit_of_joint_and_axis_ends_an_extra_axis() {
    for (in_joint, sign) in [(true, -1.0), (true, 1.0), (false, -1.0), (false, 1.0)] {
        let mut config = whole("lathe-counter-spindle");
        let stand = Stand::home(&config);
        let extra = &mut config.mechanisms[0].extra[1];
        let end = extra.joint.home + sign * 12.0;
        let (min, max) = match in_joint {
            true => (&mut extra.joint.min, &mut extra.joint.max),
            false => (&mut extra.axis.min, &mut extra.axis.max),
        };
        *(if sign < 0.0 { min } else { max }) = end;
        let name =
            if in_joint { extra.joint.name.clone() } else { format!("axis {}:", extra.letter) };
        let found = travel(&config, &stand).unwrap();
        let way = found.iter().find(|way| way.letter == 'W').unwrap();
        let side = if sign < 0.0 { &way.minus } else { &way.plus };
        let stop = side.stop.as_deref().unwrap();
        assert!(
            (side.left.unwrap() - 12.0).abs() < 1e-9 && stop.starts_with(&name),
            "{name} {side:?}"
        );
        assert_eq!(stop.contains("joint range"), in_joint, "{stop}");
    }
}
