// SPDX-License-Identifier: GPL-2.0-or-later
//! The effect of joint errors on the pose, against independent values, finite differences of the core's
//! forward kinematics, and random draws.

use kinematics::{LEAST_DRIVE, LegKind, Letter, Pose, Solver, Vector3};
use machine::proof::axis_box;
use machine::read::mechanism::Mechanism;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use studies::study::file::{Lacking, Law, Study};
use studies::study::sensitivity::{Kind, Sensitivity, axis_sigma, monte_carlo, near, ratios};
use test_support::shipped::{MACHINES, config};

const NO_TOOL: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

fn at(config: &Mechanism, pose: &Pose) -> Sensitivity {
    Sensitivity::at(config, pose, &config.spindle, 100.0).unwrap().unwrap()
}

/// Effect of ten micrometers on each strut of `lab-hexapod` at home, from an independent computation: X Y Z
/// in mm, A B C in degrees.
const SIGMA: [f64; 6] = [
    0.018659961526,
    0.017384339137,
    0.004462135638,
    0.003202024091,
    0.003254106529,
    0.005208929727,
];

#[test]
fn errors_of_the_struts_spread_as_in_an_independent_calculation() {
    let config = config("lab-hexapod");
    let found = at(&config, &config.home_pose()).sigma(&[0.01; 6]);
    for (found, expected) in found.iter().zip(SIGMA) {
        // The values have twelve decimals, and a relative error of 1e-9.
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
}

#[test]
fn draws_through_forward_kinematics_spread_as_the_covariance_says() {
    for (machine, count) in [("lab-hexapod", 20_000), ("pyramid", 20_000)] {
        let config = config(machine);
        let sigma = vec![0.01; config.joints.len()];
        let home = config.home_pose();
        let expected = at(&config, &home).sigma(&sigma);
        let drawn = monte_carlo(&config, &home, &config.spindle, &sigma, count).unwrap();
        for (k, expected) in expected.iter().enumerate().filter(|(_, s)| **s > 0.0) {
            // 1/sqrt(2 n) = 0.5 % is one standard deviation; the tolerance is four.
            let off = (drawn.sigma[k] / expected - 1.0).abs();
            assert!(off < 0.02, "{machine} {k}: {} {expected}", drawn.sigma[k]);
        }
    }
}

#[test]
fn the_spindle_axis_spreads_as_the_forward_kinematics_turn_it() {
    let config = config("lab-hexapod");
    let sigma = [0.01, 0.02, 0.005, 0.01, 0.015, 0.01];
    // A level platform with equal errors: the axis turns by A and B alone, which are independent by symmetry.
    let home = config.home_pose();
    let level = axis_sigma(&at(&config, &home), &[0.01; 6]);
    assert!((level[0] - SIGMA[4]).abs() < 1e-9 && (level[1] - SIGMA[3]).abs() < 1e-9, "{level:?}");
    let pose = Pose::from_degrees([20.0, -30.0, 650.0, 12.0, -9.0, 5.0]);
    let [most, least] = axis_sigma(&at(&config, &pose), &sigma);
    // The sum of both variances is that of the axes that the core's forward kinematics find for each joint alone.
    let joints = config.machine.inverse(&pose, &config.spindle).unwrap();
    let axis = |i: usize, by: f64| {
        let mut off = joints;
        off[i] += by;
        let found = config.machine.forward(&off, &pose, &config.spindle, &Solver::default());
        found.unwrap().pose.rotation().column(2).into_owned()
    };
    let step = 1e-3;
    let moved = |i: usize| ((axis(i, step) - axis(i, -step)) / (2.0 * step)).to_owned() * sigma[i];
    let moved: Vec<Vector3<f64>> = (0..6).map(moved).collect();
    let sum: f64 = moved.iter().map(|axis| axis.norm_squared()).sum();
    // Forward kinematics end within 1e-12 of a step of 1e-3; the third derivative adds 1e-6.
    let found = most.hypot(least).to_radians();
    assert!((found / sum.sqrt() - 1.0).abs() < 1e-5, "{found} {}", sum.sqrt());
    // No direction spreads more than the largest, and one reaches it.
    let spread = |degrees: u32| {
        let (s, c) = f64::from(degrees).to_radians().sin_cos();
        let along = pose.rotation() * Vector3::new(c, s, 0.0);
        moved.iter().map(|axis| axis.dot(&along).powi(2)).sum::<f64>().sqrt().to_degrees()
    };
    let largest = (0..180).map(spread).fold(0.0, f64::max);
    let smallest = (0..180).map(spread).fold(f64::INFINITY, f64::min);
    // Half a degree beside the axes of an ellipse changes its radius by less than 1e-4.
    assert!((largest / most - 1.0).abs() < 1e-4, "{largest} {most}");
    assert!((smallest / least - 1.0).abs() < 2e-4, "{smallest} {least}");
    let drawn = monte_carlo(&config, &pose, &config.spindle, &sigma, 20_000).unwrap();
    // One standard deviation of the estimate is below 1/sqrt(2 n) = 0.5 %; the tolerance is four.
    assert!((drawn.axis / most.hypot(least) - 1.0).abs() < 0.02, "{}", drawn.axis);
}

#[test]
fn no_errors_within_their_bounds_exceed_the_worst_case_and_some_reach_it() {
    let config = config("hexapod");
    let found = at(&config, &config.home_pose());
    let bound = [0.01, 0.02, 0.03, 0.01, 0.02, 0.03];
    let worst = found.worst(&bound);
    for corner in 0..64 {
        let sign = |j: usize| if corner >> j & 1 == 1 { 1.0 } else { -1.0 };
        for k in 0..6 {
            let off: f64 = (0..6).map(|j| found.gain[(k, j)] * sign(j) * bound[j]).sum();
            assert!(off <= worst[k] * (1.0 + 1e-12));
        }
    }
    for k in 0..6 {
        let reached: f64 = (0..6).map(|j| (found.gain[(k, j)] * bound[j]).abs()).sum();
        assert!((reached - worst[k]).abs() < 1e-15);
    }
}

#[test]
fn on_every_machine_the_pose_moves_as_differences_of_forward_kinematics_say() {
    for machine in MACHINES {
        let config = config(machine);
        let range = axis_box::range(&config);
        let mut rng = Pcg64::seed_from_u64(3);
        let mut looked = 0;
        while looked < 10 {
            let pose = Pose::from_degrees(range.at(std::array::from_fn(|_| rng.random())));
            let Ok(joints) = config.machine.inverse(&pose, &config.spindle) else { continue };
            looked += 1;
            let found = at(&config, &pose);
            // Contradicting joints are permitted: their effect is tested.
            let solver = Solver { residual_limit: config.machine.size(), ..config.solver };
            let step = 1e-3 * config.units_per_mm;
            for j in 0..config.joints.len() {
                let side = |sign: f64| {
                    let mut off = joints;
                    off[j] += sign * step;
                    let solved = config.machine.forward(&off, &pose, &config.spindle, &solver);
                    solved.unwrap().pose.to_degrees()
                };
                let (more, less) = (side(1.0), side(-1.0));
                for k in 0..6 {
                    let slope = (more[k] - less[k]) / (2.0 * step);
                    let gain = found.gain[(k, j)];
                    // Steps of 1e-3 leave 1e-6 of curvature, and the solver's rounding of
                    // 1e-10 over them 1e-7; near singular poses both grow with the gain.
                    let most = found.gain.abs().max();
                    let allowed = 2e-5 * (1.0 + most * most);
                    assert!((slope - gain).abs() < allowed, "{machine} {k} {j}: {slope} {gain}");
                }
            }
        }
    }
}

#[test]
fn scaled_singular_values_change_with_the_length_and_the_unit_of_angles_does_not_count() {
    let config = config("hexapod");
    let found = at(&config, &config.home_pose());
    let other = Sensitivity::at(&config, &config.home_pose(), &NO_TOOL, 200.0).unwrap().unwrap();
    // Three columns of half the size.
    assert!((found.determinant / other.determinant - 8.0).abs() < 1e-9);
    assert!(((found.gain - other.gain).abs().max()) < 1e-12);
}

/// Returns the law of Strutynsky and Yumashev with the square that their matrix confirms.
fn paper_law() -> Law {
    let text = "[law]\nperiod_s = 6.283185307179586\nradius_mm = 10\ngrowth_mm = 20\n\
                rise_mm = 10\nbend_mm = 10\namplitude_deg = [1, 2, 3]\n";
    Study::parse(text).unwrap().law.unwrap()
}

#[test]
fn the_motion_law_has_the_rates_of_paper_001_and_those_of_its_differences() {
    let config = config("lab-hexapod");
    let law = paper_law();
    let (_, rate) = law.at(&config, 2.8);
    // Meters per second in the published values, which have eight decimals: 1e-8 m/s.
    for (found, expected) in rate.iter().zip([-0.00933471, -0.01675365, 0.00141850]) {
        assert!((found * 1e-3 - expected).abs() < 1e-8, "{found} {expected}");
    }
    let step = 1e-5;
    for time in [0.0, 1.3, 2.8, 6.0] {
        let [(more, _), (less, _)] = [time + step, time - step].map(|t| law.at(&config, t));
        let (_, rate) = law.at(&config, time);
        for k in 0..6 {
            let slope = (more[k] - less[k]) / (2.0 * step);
            // Rounding of 640 mm over the step: 1e-8.
            assert!((slope - rate[k]).abs() < 1e-6, "{time} {k}: {slope} {}", rate[k]);
        }
    }
}

/// Paper 001's table, with decimals and signs restored, one row per strut.
const TABLE: [[f64; 6]; 6] = [
    [-3.761, -2.096, 24.75, 4.889, 2.849, 1.941],
    [-1.584, -0.883, 10.424, 2.059, 1.2, 0.818],
    [1.375, 0.766, -9.047, -1.787, -1.041, -0.71],
    [1.877, 1.046, -12.355, -2.441, -1.422, -0.969],
    [1.957, 1.09, -12.88, -2.544, -1.482, -1.01],
    [-2.369, -1.32, 15.591, 3.08, 1.795, 1.223],
];

#[test]
fn the_table_of_paper_001_is_one_of_ratios_along_its_law_and_no_jacobian() {
    let table = nalgebra::Matrix6::from_fn(|i, k| TABLE[i][k]);
    let values = table.singular_values();
    assert!(values[1] / values[0] < 1e-4, "{values}");
    let (_, rate) = paper_law().at(&config("lab-hexapod"), 2.8);
    // Three to four digits are printed.
    let [first, third] = [TABLE[0][0] / TABLE[0][1], TABLE[0][2] / TABLE[0][0]];
    assert!((first - rate[1] / rate[0]).abs() < 1e-3, "{first}");
    assert!((third - rate[0] / rate[2]).abs() < 2e-3, "{third}");
}

#[test]
fn ratios_along_a_path_overstate_its_own_changes_six_times() {
    let config = config("lab-hexapod");
    let (pose, rate) = paper_law().at(&config, 2.8);
    let at = config.machine.at(&Pose::from_degrees(pose), &NO_TOOL).unwrap();
    let rates = at.rates(&rate).unwrap();
    let table = ratios(&rates[..6], &rate);
    let table = nalgebra::Matrix6::from_fn(|j, i| table[j][i]);
    let values = table.singular_values();
    assert!(values[1] < 1e-12 * values[0]);
    let change = nalgebra::Vector6::from_row_slice(&rate);
    for (j, sum) in (table * change).iter().enumerate() {
        assert!((sum / rates[j] - 6.0).abs() < 1e-12, "{sum}");
    }
}

#[test]
fn singular_poses_are_found_where_the_legs_are_assembled_another_way_beyond() {
    let config = config("lab-hexapod");
    let range = axis_box::range(&config);
    let found = near(&config, &range, &config.spindle, 300, 3.0);
    let parallel = found.nearest.iter().find(|found| found.kind == Kind::Parallel).unwrap();
    let hold = config
        .machine
        .at(&Pose::from_degrees(parallel.pose), &NO_TOOL)
        .unwrap()
        .smallest_singular_value();
    assert!(hold < 1e-8, "{hold}");
    // The axis limits of this machine are proved to contain no singular pose.
    assert!(parallel.reach > 1.0 && found.least > 0.01, "{found:?}");
    let middle = range.at([0.5; 6]);
    let side = |factor: f64| {
        let pose = std::array::from_fn(|k| middle[k] + factor * (parallel.pose[k] - middle[k]));
        config.machine.at(&Pose::from_degrees(pose), &NO_TOOL).unwrap().assembly().unwrap()
    };
    // Much less than the distance between two sheets of singular poses.
    assert_eq!(side(1.0 - 1e-6) * side(1.0 + 1e-6), -1);
}

#[test]
fn the_end_of_a_rods_reach_is_where_it_stands_nearly_square_to_its_guide() {
    let config = config("four-rod-lathe");
    let range = axis_box::range(&config);
    let found = near(&config, &range, &config.spindle, 100, 6.0);
    let serial = found.nearest.iter().find(|found| found.kind == Kind::Serial).unwrap();
    let pose = Pose::from_degrees(serial.pose);
    let at = config.machine.at(&pose, &NO_TOOL).unwrap();
    let drives = (0..config.legs()).filter_map(|i| at.drive(i));
    let drive = drives.reduce(f64::min).unwrap();
    // The core refuses a rod whose |cos| to its guide is below this.
    assert!((drive - LEAST_DRIVE).abs() < 1e-9, "{drive}");
}

#[test]
fn coordinates_that_no_joint_moves_have_no_errors() {
    for machine in MACHINES {
        let config = config(machine);
        let found = at(&config, &config.home_pose());
        for letter in Letter::ALL {
            let is_held = config.machine.layout().is_held(letter);
            let row = found.gain.row(letter.index());
            assert_eq!(row.iter().all(|x| x.abs() < 1e-12), is_held, "{machine} {letter:?}");
        }
    }
}

/// Legs and table axes have own values, which are distances at the end of an arm.
#[test]
fn errors_of_joints_are_those_of_the_legs_and_then_of_the_table() {
    let key = "joint_sigma_um";
    let section = |name: &str, values: &[f64]| format!("[{name}]\n{key} = {values:?}\n");
    let mut tables = 0;
    for machine in MACHINES {
        let config = config(machine);
        let micrometers: Vec<f64> = (0..config.joints.len()).map(|i| 5.0 + i as f64).collect();
        let (legs, table) = micrometers.split_at(config.legs());
        let sigma = |text: &str| Study::parse(text).unwrap().joint_sigma(&config);
        assert_eq!(sigma(&section("table", table)), Ok(None), "{machine}");
        let length = |expected, found| Err(Lacking::Length { key, expected, found });
        assert_eq!(sigma(&section("legs", &legs[1..])), length(legs.len(), legs.len() - 1));
        let mut text = section("legs", legs);
        if !table.is_empty() {
            tables += 1;
            assert_eq!(sigma(&text), Err(Lacking::Key { section: "table", key }), "{machine}");
            let long = text.clone() + &section("table", &[1.0; 3]);
            assert_eq!(sigma(&long), length(table.len(), 3), "{machine}");
            text += &section("table", table);
        }
        let found = sigma(&text).unwrap().unwrap();
        let kinds = config.geometry.legs().iter().map(|leg| Some(&leg.kind));
        let kinds = kinds.chain(table.iter().map(|_| None));
        let travels = kinds.zip(&found).map(|(kind, value)| match kind {
            Some(LegKind::Crank(crank)) => value.to_radians() * Vector3::from(crank.arm).norm(),
            _ => *value,
        });
        let travels: Vec<f64> = travels.collect();
        assert_eq!(travels.len(), micrometers.len(), "{machine}");
        for (travel, expected) in travels.iter().zip(&micrometers) {
            // Some roundings of a double.
            let expected = expected * 1e-3 * config.units_per_mm;
            assert!((travel / expected - 1.0).abs() < 1e-14, "{machine}: {travel} {expected}");
        }
    }
    assert!(tables > 0);
}
