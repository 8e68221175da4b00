// SPDX-License-Identifier: GPL-2.0-or-later
//! The hexapod of paper 004 at its poses: modes assembled in the test from its struts, so that
//! only the cutting process is tested.

use nalgebra::{Complex, ComplexField, Matrix3, Matrix6, Rotation3, Vector3, Vector6};
use std::f64::consts::TAU;
use studies::dynamics::milling::frame;
use studies::dynamics::mode::Mode;
use studies::stability::bands::{bands, first_limit};
use studies::stability::floquet::Period;
use studies::stability::lag::{Lag, Term};
use studies::stability::lobes::{Limit, Lobes};
use studies::stability::process::{Process, Row, milling_rows, receptance};
use studies::stability::semi;
use studies::study::file::Study;
use test_support::stability::{close, golden, row, rows};

/// Two methods for the zero of one function.
const ZERO_ORDER: f64 = 1e-7;
/// Depths at which a multiplier with an error of 1e-8 passes 1.
const DEPTH: f64 = 1e-6;
/// First-order semi-discretization with 60 steps.
const SEMI: f64 = 0.01;

const POSES: [(&str, [f64; 6]); 3] = [
    ("home", [0.0, 0.0, 250.0, 0.0, 0.0, 0.0]),
    ("pose_2", [100.0, -50.0, 150.0, 0.0, 0.0, 0.0]),
    ("pose_4", [-80.0, 60.0, 350.0, 10.0, -20.0, 0.0]),
];

/// Returns six points in pairs on a circle, in the order of the struts.
fn ring(radius: f64, phase: f64, height: f64) -> [Vector3<f64>; 6] {
    std::array::from_fn(|i| {
        let angle = phase + 120.0 * (i / 2) as f64 + if i % 2 == 0 { -15.0 } else { 15.0 };
        let (s, c) = angle.to_radians().sin_cos();
        Vector3::new(radius * c, radius * s, height)
    })
}

/// Stiffness and damping of a strut, N/mm and N s/mm.
const STIFFNESS: f64 = 1e4;
const DAMPING: f64 = 0.8;

fn rotation(pose: &[f64; 6]) -> Matrix3<f64> {
    let [a, b, c] = [pose[3], pose[4], pose[5]].map(f64::to_radians);
    *Rotation3::from_euler_angles(a, b, c).matrix()
}

/// Returns the modes at a pose of a body of 25 kg: t, mm, s.
fn modes(pose: &[f64; 6]) -> Vec<Mode> {
    let turn = rotation(pose);
    let place = Vector3::new(pose[0], pose[1], pose[2]);
    let base = ring(560.0, 0.0, 1250.0);
    let around = ring(200.0, 60.0, 150.0);
    let mut stiffness = Matrix6::zeros();
    for i in 0..6 {
        let arm = turn * around[(i + 5) % 6];
        let along = (place + arm - base[i]).normalize();
        let moment = arm.cross(&along);
        let row = Vector6::new(along.x, along.y, along.z, moment.x, moment.y, moment.z);
        stiffness += row * row.transpose() * STIFFNESS;
    }
    let (mass, centre) = (0.025, turn * Vector3::new(6.0, -4.0, 120.0));
    let inertia = Matrix3::new(0.46, 0.02, -0.01, 0.02, 0.43, 0.015, -0.01, 0.015, 0.60) * 1e3;
    let cross = centre.cross_matrix();
    let mut inert = Matrix6::identity() * mass;
    inert.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-mass * cross));
    inert.fixed_view_mut::<3, 3>(3, 0).copy_from(&(mass * cross));
    let about = turn * inertia * turn.transpose() - mass * cross * cross;
    inert.fixed_view_mut::<3, 3>(3, 3).copy_from(&about);
    let root = inert.cholesky().unwrap().l();
    let inverse = root.try_inverse().unwrap();
    let eigen = (inverse * stiffness * inverse.transpose()).symmetric_eigen();
    let tip = turn * Vector3::new(0.0, 0.0, -100.0);
    let shapes = inverse.transpose() * eigen.eigenvectors;
    (0..6)
        .map(|j| {
            let omega = eigen.eigenvalues[j].sqrt();
            let turned = Vector3::new(shapes[(3, j)], shapes[(4, j)], shapes[(5, j)]);
            let moved = Vector3::new(shapes[(0, j)], shapes[(1, j)], shapes[(2, j)]);
            let zeta = DAMPING / STIFFNESS * omega / 2.0;
            Mode { omega, zeta, tip: moved + turned.cross(&tip) }
        })
        .collect()
}

/// Returns the rows at a pose, with the feed along the platform's x.
fn in_plane(pose: &[f64; 6]) -> Vec<Row> {
    let turn = rotation(pose);
    let axes = frame(&turn.column(0).into_owned(), &turn.column(2).into_owned()).unwrap();
    milling_rows(&modes(pose), &axes)
}

fn process() -> Process {
    let values = row(golden("chatter", "a_cut_N_st_ex_Kt_Kn"));
    let text = format!(
        "[cutting]\nteeth = {}\nentry_deg = {}\nexit_deg = {}\nkt_n_per_mm2 = {}\n\
         kr_n_per_mm2 = {}\n",
        values[0],
        values[1].to_degrees(),
        values[2].to_degrees(),
        values[3],
        values[4]
    );
    Process::from(&Study::parse(&text).unwrap().cutting.unwrap())
}

#[test]
fn the_modes_assembled_here_are_those_of_the_hexapod() {
    let mut found: Vec<f64> = modes(&POSES[2].1).iter().map(|mode| mode.omega / TAU).collect();
    found.sort_by(f64::total_cmp);
    let expected =
        [45.7358878314, 65.2709008602, 96.6947570294, 181.343616805, 218.025635906, 248.553180646];
    for (found, expected) in found.iter().zip(expected) {
        // Values of 12 digits.
        close(*found, expected, 1e-10);
    }
}

/// Computes the zero-order limit by eliminating the depth from the real and the imaginary part of
/// det(1 - a L), sampled finely.
fn by_elimination(rows: &[Row], process: &Process, rpm: f64) -> Limit {
    let delay = process.delay(rpm);
    let mean = process.mean();
    let coefficients = |omega: f64| {
        let h = receptance(rows, omega);
        let factor = 1.0 - Complex::new(0.0, -omega * delay).exp();
        let entry = |i: usize, k: usize| -> Complex<f64> {
            (h[(i, 0)] * mean[(0, k)] + h[(i, 1)] * mean[(1, k)] + h[(i, 2)] * mean[(2, k)])
                * factor
        };
        let trace = entry(0, 0) + entry(1, 1);
        (-trace, entry(0, 0) * entry(1, 1) - entry(0, 1) * entry(1, 0))
    };
    let g = |omega: f64| {
        let (c1, c2) = coefficients(omega);
        c2.re * c1.im * c1.im - c1.re * c1.im * c2.im + c2.im * c2.im
    };
    let mut best = Limit { depth: f64::INFINITY, omega: 0.0 };
    // Resonances are tens of rad/s wide, and lobes hundreds apart.
    let step = 0.1;
    let mut to = g(100.0 * step) > 0.0;
    for k in 100..75_000 {
        let (mut low, mut high) = (f64::from(k) * step, f64::from(k + 1) * step);
        let from = to;
        to = g(high) > 0.0;
        if from == to {
            continue;
        }
        for _ in 0..60 {
            let middle = (low + high) / 2.0;
            if (g(middle) > 0.0) == from { low = middle } else { high = middle }
        }
        let (c1, c2) = coefficients(low);
        let depth = -c1.im / c2.im;
        let is_root = (1.0 + c1 * depth + c2 * depth * depth).modulus() < 1e-6;
        if depth > 0.0 && is_root && depth < best.depth {
            best = Limit { depth, omega: low };
        }
    }
    best
}

#[test]
fn zero_order_limits_are_those_of_an_independent_calculation_and_of_elimination() {
    let process = process();
    for (name, pose) in POSES {
        let in_plane = in_plane(&pose);
        let lobes = Lobes::new(&in_plane, &process, 3000.0);
        let floor = lobes.floor().unwrap();
        let expected = row(golden("chatter", &format!("a_{name}_floor_mm_omega")));
        close(floor.depth, expected[0], ZERO_ORDER);
        close(floor.omega, expected[1], DEPTH);
        for expected in rows("chatter", &format!("a_{name}_rpm_zero_order_mm_omega_floquet_mm")) {
            let found = lobes.limit(expected[0]).unwrap();
            close(found.depth, expected[1], ZERO_ORDER);
            close(found.omega, expected[2], ZERO_ORDER);
            let again = by_elimination(&in_plane, &process, expected[0]);
            close(found.depth, again.depth, ZERO_ORDER);
        }
    }
}

#[test]
fn limits_by_collocation_are_those_of_an_independent_calculation_and_of_semi_discretisation() {
    let process = process();
    for (name, pose) in POSES {
        let in_plane = in_plane(&pose);
        for expected in rows("chatter", &format!("a_{name}_rpm_zero_order_mm_omega_floquet_mm")) {
            let (rpm, depth) = (expected[0], expected[3]);
            let found = first_limit(&Period::new(&in_plane, &process, rpm), 3.0 * expected[1]);
            close(found.unwrap(), depth, DEPTH);
            // The limit of the other method is within 1 %: its multiplier passes 1 in this range.
            let at =
                |share: f64| semi::multiplier(&in_plane, &process, rpm, share * depth, 60).unwrap();
            assert!(at(1.0 - SEMI) < 1.0 && at(1.0 + SEMI) > 1.0, "{name} {rpm}");
        }
    }
}

#[test]
fn an_island_of_instability_is_found_that_zero_order_cannot_see() {
    let (process, in_plane) = (process(), in_plane(&POSES[2].1));
    let period = Period::new(&in_plane, &process, 6000.0);
    let expected = row(golden("chatter", "a_pose_4_6000rpm_island_mm"));
    let found = bands(&period, 16.0);
    assert_eq!(found.len(), 1, "{found:?}");
    close(found[0].low, expected[0], DEPTH);
    close(found[0].high, expected[1], DEPTH);
    assert!(period.multiplier(8.5).norm_sqr() < 1.0);
    // Period doubling: the multiplier is -1 at both ends.
    for depth in [found[0].low, found[0].high] {
        assert!((period.multiplier(depth) + 1.0).modulus() < 1e-5);
    }
    // Semi-discretization finds it as well.
    let semi = |depth: f64| semi::multiplier(&in_plane, &process, 6000.0, depth, 80).unwrap();
    assert!(semi(2.26) < 1.0 && semi(2.30) > 1.0 && semi(7.2) > 1.0 && semi(7.28) < 1.0);
    let zero_order = Lobes::new(&in_plane, &process, 6000.0).limit(6000.0).unwrap().depth;
    assert!(zero_order > 8.15, "{zero_order}");
}

#[test]
fn the_best_speed_of_three_poses_is_that_of_an_independent_calculation() {
    let process = process();
    let lobes: Vec<Lobes> =
        POSES.iter().map(|(_, pose)| Lobes::new(&in_plane(pose), &process, 3000.0)).collect();
    let least = |rpm: f64| {
        let depths = lobes.iter().map(|lobes| lobes.limit(rpm).map_or(f64::INFINITY, |l| l.depth));
        depths.fold(f64::INFINITY, f64::min)
    };
    let speeds = (0..=60).map(|k| 3000.0 + 250.0 * f64::from(k));
    let all: Vec<(f64, f64)> = speeds.map(|rpm| (least(rpm), rpm)).collect();
    let best = all.iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    let worst = all.iter().min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    for (found, key) in [
        (best, "a_best_speed_of_three_poses_mm_rpm"),
        (worst, "a_worst_speed_of_three_poses_mm_rpm"),
    ] {
        let expected = row(golden("chatter", key));
        close(found.0, expected[0], ZERO_ORDER);
        assert_eq!(found.1, expected[1]);
    }
}

#[test]
fn a_lag_at_the_tip_is_worst_at_twice_the_regenerative_floor() {
    let expected = row(golden("chatter", "a_home_feed_lag_floor_and_regenerative_floor_n_per_mm"));
    let terms =
        modes(&POSES[0].1).into_iter().map(|mode| Term::mode(&mode, &Vector3::x(), &-Vector3::x()));
    let lag = Lag { terms: terms.collect(), lag: 0.0, ..Lag::default() };
    let (time, crossing) = lag.worst_lag().unwrap();
    close(crossing.stiffness, expected[0], 1e-9);
    close(crossing.stiffness, 2.0 * expected[1], 1e-9);
    // Six modes: a polynomial of degree 11, whose limit the root counts confirm.
    let limit = lag.with_lag(time).limit();
    assert!(limit.is_certified);
    close(limit.crossing.unwrap().stiffness, crossing.stiffness, 1e-9);
}

#[test]
fn a_feed_along_the_spindle_axis_is_refused() {
    assert!(frame(&Vector3::new(0.0, 0.0, -1.0), &Vector3::z()).is_none());
    let axes = frame(&Vector3::new(0.0, 2.0, 1.0), &Vector3::z()).unwrap();
    assert_eq!(axes, Matrix3::from_columns(&[Vector3::y(), -Vector3::x(), Vector3::z()]));
}
