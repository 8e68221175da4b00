// SPDX-License-Identifier: GPL-2.0-or-later
//! Proofs that a cell of poses is inside the workspace: no pose of it may be outside.

use kinematics::{Letter, Limit, Machine, Margin, Pose, Vector3};
use machine::limits;
use machine::proof::axis_box::{AxisBox, at_tilt, ends, grown, range, reached};
use machine::proof::cell::{Cell, Verdict};
use machine::proof::reach::{Reach, Stop};
use machine::proof::spans::Span;
use machine::read::mechanism::Mechanism;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use test_support::shipped::{CONSTRAINED, MACHINES, config, drawn as pose};

/// Moves home by up to 8 degrees and a fiftieth of the size, with a spindle offset: angles of the legs' joints are those
/// from their directions there.
fn move_home(config: &mut Mechanism, rng: &mut Pcg64) {
    let mut home = config.home;
    let size = config.machine.size();
    config.spindle = Vector3::new(0.0, 0.0, rng.random_range(-0.05..0.05) * size);
    for letter in config.machine.layout().coordinates().as_slice() {
        let most = if letter.is_angle() { 8.0 } else { size / 50.0 };
        home[letter.index()] += rng.random_range(-most..most);
    }
    let mut geometry = config.geometry;
    geometry.home = Some(home);
    let Ok(machine) = Machine::freeze(&geometry, &config.offsets) else { return };
    let joints = machine.inverse(&Pose::from_degrees(home), &config.spindle);
    let Ok(joints) = joints else { return };
    for (joint, value) in config.joints.iter_mut().zip(joints) {
        joint.home = value;
    }
    (config.geometry, config.machine, config.home) = (geometry, machine, home);
}

/// Returns the machine with joint limits and cones that some of its poses violate.
fn narrowed(rng: &mut Pcg64, machine: &str) -> Mechanism {
    let mut config = config(machine);
    if rng.random() {
        move_home(&mut config, rng);
    }
    for joint in &mut config.joints {
        let half = (joint.max - joint.min) * rng.random_range(0.02..0.4);
        (joint.min, joint.max) = (joint.home - half, joint.home + half);
    }
    for cone in config.angles.iter_mut().flat_map(|leg| &mut leg.cones) {
        *cone = Some(rng.random_range(5.0..40.0));
    }
    let at = config.machine.at(&config.home_pose(), &config.spindle).unwrap();
    let share = rng.random_range(0.5..1.0);
    config.clearance = at.nearest().map(|nearest| share * nearest.distance);
    config.conditioning_limit = at.smallest_singular_value() * rng.random_range(0.2..0.95);
    config.tilt_limit = Some(rng.random_range(2.0..30.0));
    // Only struts with a lead have fixed axes.
    if machine == "hexapod" {
        for pyramid in config.angles.iter_mut().flat_map(|leg| &mut leg.pyramids) {
            *pyramid = Some([rng.random_range(2.0..30.0), rng.random_range(2.0..30.0)]);
        }
    }
    config
}

#[test]
fn no_pose_of_a_cell_that_is_proved_is_outside() {
    let mut rng = Pcg64::seed_from_u64(3);
    for machine in MACHINES.into_iter().chain(CONSTRAINED) {
        let (mut proved, mut open) = (0, 0);
        for _ in 0..60 {
            let config = narrowed(&mut rng, machine);
            let (reach, whole) = (Reach::new(&config).unwrap(), range(&config));
            for _ in 0..30 {
                let away = whole.at(std::array::from_fn(|_| rng.random()));
                let part = rng.random_range(0.0..0.4);
                let middle =
                    std::array::from_fn(|k| config.home[k] + part * (away[k] - config.home[k]));
                let share = 10_f64.powf(rng.random_range(-2.5..-0.8));
                let half = std::array::from_fn(|k| share * (whole.high[k] - whole.low[k]));
                let cell = Cell { middle, half };
                if reach.judge(&cell) != Verdict::Inside {
                    open += 1;
                    continue;
                }
                proved += 1;
                let part = AxisBox {
                    low: std::array::from_fn(|k| middle[k] - half[k]),
                    high: std::array::from_fn(|k| middle[k] + half[k]),
                };
                for _ in 0..30 {
                    let pose = pose(&mut rng, &part);
                    assert_eq!(reach.check(&pose), Ok(()), "{machine} {cell:?} {pose:?}");
                }
            }
        }
        assert!(proved > 20 && open > 20, "{machine}: {proved} {open}");
    }
}

/// A cell that barely fits is proved: the bounds are not uselessly wide.
#[test]
fn a_cell_may_come_near_a_limit() {
    let mut config = config("lab-hexapod");
    let half = [5.0, 5.0, 5.0, 1.0, 1.0, 1.0];
    let cell = Cell { middle: config.home, half };
    let reach = Reach::new(&config).unwrap();
    let mut rng = Pcg64::seed_from_u64(4);
    let part = AxisBox {
        low: std::array::from_fn(|k| cell.middle[k] - half[k]),
        high: std::array::from_fn(|k| cell.middle[k] + half[k]),
    };
    let strut = |pose: [f64; 6]| reach.joints(&pose).unwrap()[0];
    let longest = (0..20_000).map(|_| strut(pose(&mut rng, &part))).fold(0.0, f64::max);
    drop(reach);
    let beyond = longest - config.joints[0].home;
    // A tenth beyond the longest sampled strut, which occurs at a corner of the cell.
    for (room, expected) in [(1.1, true), (0.98, false)] {
        config.joints[0].max = config.joints[0].home + room * beyond;
        let verdict = Reach::new(&config).unwrap().judge(&cell);
        assert_eq!(verdict == Verdict::Inside, expected, "{room} {verdict:?}");
    }
}

/// Bounds of a path contain the values at all its poses, and are narrow on a short path.
#[test]
fn bounds_of_a_path_contain_its_values_and_become_narrow() {
    let mut rng = Pcg64::seed_from_u64(13);
    for machine in MACHINES.into_iter().chain(CONSTRAINED) {
        for _ in 0..20 {
            let config = narrowed(&mut rng, machine);
            let (reach, whole) = (Reach::new(&config).unwrap(), range(&config));
            let away = whole.at(std::array::from_fn(|_| rng.random()));
            let middle: [f64; 6] =
                std::array::from_fn(|k| config.home[k] + 0.3 * (away[k] - config.home[k]));
            for share in [1e-7, 1e-2, 0.3] {
                let steps: [[f64; 6]; 2] = [(); 2].map(|()| {
                    let half = |k: usize| share / 2.0 * (whole.high[k] - whole.low[k]);
                    std::array::from_fn(|k| half(k) * rng.random_range(-1.0..1.0))
                });
                let bounds = reach.bounds_within(&middle, Some(&steps)).unwrap();
                let is_known = bounds.joints.iter().all(|joint| joint.range().1.is_finite());
                assert!(is_known || share > 1e-6, "{machine}");
                for _ in 0..30 {
                    let parts: [f64; 2] = [(); 2].map(|()| rng.random_range(-1.0..1.0));
                    let pose = std::array::from_fn(|k| {
                        middle[k] + parts[0] * steps[0][k] + parts[1] * steps[1][k]
                    });
                    let Ok(at) = reach.at(&pose) else {
                        assert!(!is_known, "{machine}: {pose:?}");
                        continue;
                    };
                    for (joint, value) in bounds.joints.iter().zip(at.joints()) {
                        let (low, high) = joint.range();
                        assert!(low <= *value && *value <= high, "{machine}: {joint:?} {value}");
                    }
                    limits::each(&at, &limits::beyond_axes(&config), |margin| {
                        let Margin { limit, part, value, .. } = margin;
                        let is_same = |span: &&Span| match limit {
                            // Any legs may be the nearest ones.
                            Limit::Clearance => span.margin.limit == limit,
                            _ => (span.margin.limit, span.margin.part) == (limit, part),
                        };
                        let ends = bounds.spans.iter().filter(is_same).map(|span| span.ends);
                        let Some([low, high]) =
                            ends.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
                        else {
                            // Axes are programmed; a dead point is one of the joint's second derivative.
                            let is_elsewhere = matches!(limit, Limit::Axis | Limit::DeadPoint);
                            return assert!(is_elsewhere, "{machine}: no bound: {margin:?}");
                        };
                        assert!(low <= value && value <= high, "{machine}: {low} {margin:?}");
                        // The conditioning changes by less than a hundredth in a ten-millionth of the range.
                        let is_wide = limit == Limit::Conditioning && low < 0.99 * value;
                        assert!(share > 1e-6 || !is_wide, "{machine}: {low} {margin:?}");
                    });
                }
            }
        }
    }
}

/// The boxes reported for smaller tilts are legal.
#[test]
fn boxes_of_a_tilt_can_be_taken() {
    let config = config("four-rod-lathe");
    let whole = range(&config);
    let reach = Reach::new(&config).unwrap();
    let mut rng = Pcg64::seed_from_u64(7);
    let widths = [0.0, 0.5, 1.0].map(|share| {
        let tilt = share * whole.high[4].max(-whole.low[4]);
        let found = at_tilt(&config, &whole, tilt, None).unwrap();
        assert_eq!([found.low[4], found.high[4]], [-tilt, tilt]);
        for _ in 0..2_000 {
            let pose = pose(&mut rng, &found);
            assert_eq!(reach.check(&pose), Ok(()), "{tilt} {pose:?}");
        }
        (0..3).map(|k| found.high[k] - found.low[k]).sum::<f64>()
    });
    assert!(widths[0] >= widths[1] && widths[1] >= widths[2], "{widths:?}");
}

/// In a range that is not proved as a whole, X, Y and Z grow from home or from the box of a larger tilt; angles do not.
#[test]
fn boxes_of_a_tilt_grow_in_lengths_alone() {
    let mut rng = Pcg64::seed_from_u64(8);
    for machine in ["hexaglide", "four-rod-lathe"] {
        let config = config(machine);
        let (axes, reach) = (range(&config), Reach::new(&config).unwrap());
        let within = reached(&config, &reach, &axes);
        let most = within.high[3].max(within.high[4]);
        let mut steeper: Option<AxisBox> = None;
        for tilt in [2.0 * most, 0.5 * most, 0.1 * most] {
            let found = at_tilt(&config, &within, tilt, steeper.as_ref()).unwrap();
            for (k, letter) in Letter::ALL.into_iter().enumerate() {
                let (home, ends) = (config.home[k], [found.low[k], found.high[k]]);
                match k {
                    3 | 4 => assert_eq!(
                        ends,
                        [within.low[k].max(-tilt), within.high[k].min(tilt)],
                        "{machine}: {tilt} {letter:?}"
                    ),
                    0..3 if !config.machine.layout().is_held(letter) => {
                        let is_within = within.low[k] <= ends[0] && ends[1] <= within.high[k];
                        let is_grown = ends[0] < ends[1] && ends[0] <= home && home <= ends[1];
                        assert!(is_within && is_grown, "{machine}: {tilt} {letter:?} {ends:?}");
                    }
                    _ => assert_eq!(ends, [home; 2], "{machine}: {tilt} {letter:?}"),
                }
            }
            assert!((0..3).any(|k| found.low[k] > within.low[k]), "{machine}: the whole range");
            for _ in 0..1_000 {
                let pose = pose(&mut rng, &found);
                assert_eq!(reach.check(&pose), Ok(()), "{machine}: {tilt} {pose:?}");
            }
            if let Some(steeper) = steeper {
                let contains =
                    |k| found.low[k] <= steeper.low[k] && steeper.high[k] <= found.high[k];
                assert!((0..3).all(contains), "{machine}: {tilt} {found:?} {steeper:?}");
                let is_same =
                    found.with_ends(&steeper, [false, false, false, true, true, true]) == steeper;
                assert!(!is_same, "{machine}: {tilt} reaches no farther");
            }
            steeper = Some(found);
        }
    }
}

/// Within its axis limits, which hold at the full tilt, every box of a hexaglide would be equal.
#[test]
fn boxes_of_smaller_tilts_reach_beyond_the_axis_limits_and_end_at_limits_of_the_machine() {
    let config = config("hexaglide");
    let (within, reach) = (range(&config), Reach::new(&config).unwrap());
    let reached = reached(&config, &reach, &within);
    let mut rng = Pcg64::seed_from_u64(9);
    let mut steeper: Option<AxisBox> = None;
    for tilt in [within.high[3], 2.0, 0.0] {
        let inner = at_tilt(&config, &within, tilt, None).unwrap();
        let found = grown(&config, &reached, &inner, steeper.as_ref());
        for _ in 0..2_000 {
            let pose = pose(&mut rng, &found);
            assert_eq!(reach.check(&pose), Ok(()), "{tilt} {pose:?}");
        }
        let contains = |other: &AxisBox| {
            (0..3).all(|k| found.low[k] <= other.low[k] && other.high[k] <= found.high[k])
        };
        // It grows from the larger of both, which need not contain the other.
        let volume = |part: &AxisBox| (0..3).map(|k| part.high[k] - part.low[k]).product::<f64>();
        let starts = [Some(inner), steeper].into_iter().flatten();
        let start = starts.max_by(|a, b| volume(a).total_cmp(&volume(b))).unwrap();
        assert!(contains(&start), "{tilt}");
        let ends = ends(&config, &reach, &found, &reached);
        assert_eq!(ends.len(), 6);
        // Steep boxes may end where the proof becomes too long.
        assert!(tilt > 0.0 || ends.iter().any(|end| end.stop.is_some()), "{ends:?}");
        steeper = Some(found);
    }
    let level = steeper.unwrap();
    assert!(level.high[0] - level.low[0] > 1.2 * (within.high[0] - within.low[0]), "{level:?}");
    // No box could reach farther: there the machine is beyond a limit even with all other coordinates at home.
    for k in 0..3 {
        for end in [reached.low[k], reached.high[k]] {
            let mut beyond = config.home;
            beyond[k] += 1.001 * (end - config.home[k]);
            assert!(reach.check(&beyond).is_err(), "{k} {end}");
        }
    }
}

/// At 25 degrees of A and of B the hexapod's spindle tilts by 34.8.
#[test]
fn a_limit_of_the_tilt_cuts_the_corners_of_boxes() {
    let mut config = config("hexapod");
    config.tilt_limit = Some(30.0);
    let whole = range(&config);
    assert_eq!(at_tilt(&config, &whole, 25.0, None), None);
    let found = at_tilt(&config, &whole, 21.0, None).unwrap();
    let tilt = |a: f64, b: f64| (a.to_radians().cos() * b.to_radians().cos()).acos().to_degrees();
    assert!(tilt(found.high[3], found.high[4]) > 29.0);
    let reach = Reach::new(&config).unwrap();
    let mut corner = config.home;
    (corner[3], corner[4]) = (25.0, -25.0);
    let Err(Stop::Limit(margin)) = reach.check(&corner) else { panic!("{corner:?}") };
    assert_eq!(margin.limit, Limit::Tilt);
    assert!((margin.value - tilt(25.0, 25.0)).abs() < 1e-9, "{margin:?}");
}

/// A path through the joint of a tricept's passive leg meets a constraint singularity there; others are proved.
#[test]
fn a_path_through_a_constraint_singularity_is_refused_there() {
    let config = config("tricept");
    let reach = Reach::new(&config).unwrap();
    let straight = |from: [f64; 6], to: [f64; 6]| {
        reach.refuse_unconnected(|middle, half| {
            let way: [f64; 6] = std::array::from_fn(|k| to[k] - from[k]);
            let at = std::array::from_fn(|k| from[k] + middle * way[k]);
            Ok(Some((at, vec![way.map(|value| half * value)])))
        })
    };
    let pose = |x: f64, y: f64, z: f64| [x, y, z, 0.0, 0.0, 0.0];
    for (from, to) in [
        (pose(-250.0, 250.0, -800.0), pose(250.0, -250.0, -1050.0)),
        (pose(0.0, 0.0, -900.0), pose(400.0, 0.0, -300.0)),
        (pose(-1.0, 2.0, -900.0), pose(-1.0, 2.0, -900.0)),
    ] {
        assert_eq!(straight(from, to), Ok(()), "{from:?} {to:?}");
    }
    let (share, fault) = straight(pose(0.0, 0.0, -300.0), pose(0.0, 0.0, 300.0)).unwrap_err();
    // The core refuses it slightly before, too.
    assert!((share - 0.5).abs() < 0.01, "{share} {fault}");
    assert_eq!(fault.cause, kinematics::Cause::ConstraintSingular);
}
