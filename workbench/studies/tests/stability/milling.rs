// SPDX-License-Identifier: GPL-2.0-or-later
//! The textbook case of milling: one mode in one direction, or the same mode in both.

use nalgebra::{Matrix3, Matrix3x2, Vector3};
use std::f64::consts::{PI, TAU};
use studies::dynamics::mode::Mode;
use studies::stability::bands::first_limit;
use studies::stability::floquet::Period;
use studies::stability::lobes::Lobes;
use studies::stability::process::{Process, Row, milling_rows};
use studies::stability::semi;
use studies::study::file::Study;
use test_support::stability::{close, golden, number, rows};

/// Both methods have converged to 1e-8; rounding of an eigenvalue.
const MULTIPLIER: f64 = 1e-8;
/// Depths at which a multiplier with that error passes 1.
const DEPTH: f64 = 1e-6;
/// Two methods for the zero of one function.
const ZERO_ORDER: f64 = 1e-7;
/// First-order semi-discretization with 80 steps has an error of some tenths of a percent.
const SEMI: f64 = 0.01;

const TEETH: usize = 2;
/// N/mm².
const KT: f64 = 600.0;
const KR: f64 = 200.0;

/// Returns a mode in x, and one in y if `both`. The file of values has 0.03993 kg, 922 Hz, 0.011, and
/// coefficients in N/m²; this function uses t, rad/s and N/mm².
fn modes(both: bool) -> Vec<Mode> {
    let values = golden("chatter", "milling_case_m_fn_zeta_Kt_Kn_N").as_array().unwrap();
    let values: Vec<f64> = values.iter().map(number).collect();
    assert_eq!([values[3], values[4], values[5]], [KT * 1e6, KR * 1e6, TEETH as f64]);
    let size = 1.0 / (values[0] * 1e-3).sqrt();
    let mode =
        |tip: Vector3<f64>| Mode { omega: TAU * values[1], zeta: values[2], tip: tip * size };
    let all = [mode(Vector3::x()), mode(Vector3::y())];
    all[..if both { 2 } else { 1 }].to_vec()
}

fn in_plane(modes: &[Mode]) -> Vec<Row> {
    milling_rows(modes, &Matrix3::identity())
}

/// Returns a cut by its name in the file of values: radial share of the diameter, and up or down.
fn process(name: &str) -> Process {
    let (share, way) = name.split_once('_').unwrap();
    let share: f64 = share.replace('p', ".").parse().unwrap();
    let [entry, exit] = match way {
        "up" => [0.0, (1.0 - 2.0 * share).acos()],
        _ => [(2.0 * share - 1.0).acos(), PI],
    };
    cut(entry, exit, 0.0)
}

fn cut(entry: f64, exit: f64, axial: f64) -> Process {
    let text = format!(
        "[cutting]\nteeth = {TEETH}\nentry_deg = {}\nexit_deg = {}\nkt_n_per_mm2 = {KT}\n\
         kr_n_per_mm2 = {KR}\nka_n_per_mm2 = {axial}\n",
        entry.to_degrees(),
        exit.to_degrees()
    );
    Process::from(&Study::parse(&text).unwrap().cutting.unwrap())
}

fn amount(period: &Period, depth: f64) -> f64 {
    period.multiplier(depth).norm_sqr().sqrt()
}

#[test]
fn the_mean_of_the_force_is_its_integral() {
    for process in [cut(0.0, PI, 50.0), cut(0.3, 1.1, 0.0), cut(PI / 2.0, PI, 90.0)] {
        let [entry, exit] = process.arc;
        // Simpson's rule with 2000 steps: an error of 1e-14 of a sine.
        let count = 2000;
        let step = (exit - entry) / f64::from(count);
        let weight = |k: i32| match k {
            0 => 1.0,
            k if k == count => 1.0,
            k if k % 2 == 1 => 4.0,
            _ => 2.0,
        };
        let sum: Matrix3x2<f64> =
            (0..=count).map(|k| process.at(entry + step * f64::from(k)) * weight(k)).sum();
        let found = process.integral(entry, exit);
        assert!((sum * (step / 3.0) - found).norm() < 1e-11 * found.norm());
        assert!((process.mean() * process.pitch() - found).norm() < 1e-12 * found.norm());
        // The mean over a pitch of all teeth in cut is the same.
        let whole = process.mean_between(entry, entry + process.pitch());
        assert!((whole - process.mean()).norm() < 1e-12 * found.norm());
    }
}

#[test]
fn pieces_hold_the_teeth_that_cut_in_them() {
    let counts = |process: &Process| -> Vec<usize> {
        process.pieces().iter().map(|piece| piece.shifts.len()).collect()
    };
    // In a slot with two teeth always one of them cuts.
    assert_eq!(counts(&process("1_down")), [1]);
    assert_eq!(counts(&process("0p5_down")), [1, 0]);
    let mut many = process("1_down");
    many.teeth = 3;
    assert_eq!(counts(&many), [2, 1]);
    many.teeth = 4;
    assert_eq!(counts(&many), [2]);
}

#[test]
fn multipliers_are_those_of_an_independent_calculation_and_of_semi_discretisation() {
    for (both, key) in [
        (false, "milling_1dof_slot_5000rpm_w_mu_sd80"),
        (true, "milling_2dof_slot_5000rpm_w_mu_sd80"),
    ] {
        let (in_plane, process) = (in_plane(&modes(both)), process("1_down"));
        let period = Period::new(&in_plane, &process, 5000.0);
        for expected in rows("chatter", key) {
            let found = amount(&period, expected[0]);
            close(found, expected[1], MULTIPLIER);
            let semi = semi::multiplier(&in_plane, &process, 5000.0, expected[0], 80).unwrap();
            // The same method with the same steps.
            close(semi, expected[2], MULTIPLIER);
            close(semi, found, 2.0 * SEMI);
            let finer = semi::multiplier(&in_plane, &process, 5000.0, expected[0], 160).unwrap();
            close(finer, found, SEMI);
            // Its error decreases with the square of the steps: Richardson extrapolation gives collocation's value.
            close((4.0 * finer - semi) / 3.0, found, 1e-4);
        }
    }
}

#[test]
fn more_nodes_change_nothing() {
    let in_plane = in_plane(&modes(true));
    for (name, rpm) in [("1_down", 5000.0), ("0p5_up", 14000.0), ("0p05_down", 5000.0)] {
        let process = process(name);
        let usual = amount(&Period::new(&in_plane, &process, rpm), 0.3);
        let finer = amount(&Period::with_more_nodes(&in_plane, &process, rpm, 10), 0.3);
        close(usual, finer, MULTIPLIER);
    }
}

/// Returns rows of depths: cut, speed, limit by collocation, limit of zero order.
fn depths(key: &str) -> Vec<(String, f64, f64, f64)> {
    let table = golden("chatter", key).as_array().unwrap();
    let one = |value: &toml::Value| {
        let cells = value.as_array().unwrap();
        let name = cells[0].as_str().unwrap().to_string();
        (name, number(&cells[1]), number(&cells[2]), number(&cells[3]))
    };
    table.iter().map(one).collect()
}

#[test]
fn limit_depths_are_those_of_an_independent_calculation() {
    for (both, key) in [
        (false, "milling_1dof_case_rpm_depth_mm_zero_order_mm"),
        (true, "milling_2dof_case_rpm_depth_mm_zero_order_mm"),
    ] {
        let in_plane = in_plane(&modes(both));
        for (name, rpm, depth, zero_order) in depths(key) {
            let process = process(&name);
            let period = Period::new(&in_plane, &process, rpm);
            let found = first_limit(&period, 1.5 * depth).unwrap();
            close(found, depth, DEPTH);
            if both {
                let lobes = Lobes::new(&in_plane, &process, rpm);
                close(lobes.limit(rpm).unwrap().depth, zero_order, DEPTH);
            }
        }
    }
}

#[test]
fn the_floor_of_the_slot_is_that_of_an_independent_calculation() {
    let lobes = Lobes::new(&in_plane(&modes(true)), &process("1_down"), 5000.0);
    let floor = lobes.floor().unwrap();
    let expected =
        test_support::stability::row(golden("chatter", "milling_2dof_slot_floor_mm_omega"));
    close(floor.depth, expected[0], ZERO_ORDER);
    close(floor.omega, expected[1], DEPTH);
}

#[test]
fn an_axial_force_counts_where_a_mode_moves_along_the_axis_too() {
    let tilted = |tip: Vector3<f64>| Mode { tip, ..modes(false)[0] };
    let size = modes(false)[0].tip.x;
    let along = in_plane(&[tilted(Vector3::new(size, 0.0, 0.5 * size))]);
    let flat = in_plane(&[tilted(Vector3::new(size, 0.0, 0.0))]);
    let limit = |rows: &[Row], axial: f64| {
        first_limit(&Period::new(rows, &cut(PI / 2.0, PI, axial), 5000.0), 3.0).unwrap()
    };
    close(limit(&flat, 300.0), limit(&flat, 0.0), 1e-12);
    let [with, without] = [limit(&along, 300.0), limit(&along, 0.0)];
    assert!((with / without - 1.0).abs() > 0.02, "{with} {without}");
    // Semi-discretization agrees.
    let process = cut(PI / 2.0, PI, 300.0);
    close(semi::multiplier(&along, &process, 5000.0, with, 160).unwrap(), 1.0, SEMI);
}

/// Simulates the motion with its feed by the classical Runge-Kutta method, and returns for each tooth period the
/// largest change of the displacement from the previous one. A tooth that has
/// left the workpiece exerts no force.
fn simulated(modes: &[Mode], process: &Process, rpm: f64, depth: f64, periods: usize) -> Vec<f64> {
    let steps = 1200;
    let (feed, count) = (0.05, modes.len());
    let delay = process.delay(rpm);
    let h = delay / steps as f64;
    let turn = TAU * rpm / 60.0;
    // Twice as many rows: at full and half steps.
    let mut old = vec![[0.0; 3]; 2 * steps + 1];
    let mut state = vec![0.0; 2 * count];
    // Arrays instead of matrices: tests are built without optimization.
    let tips: Vec<[f64; 3]> = modes.iter().map(|mode| mode.tip.into()).collect();
    let sum = |state: &[f64], first: usize| -> [f64; 3] {
        let mut sum = [0.0; 3];
        for j in 0..count {
            for k in 0..3 {
                sum[k] += tips[j][k] * state[2 * j + first];
            }
        }
        sum
    };
    let place = |state: &[f64]| sum(state, 0);
    let rates = |time: f64, state: &[f64], before: &[f64; 3]| -> Vec<f64> {
        let [x, y, _] = place(state);
        let moved = [x - before[0], y - before[1]];
        let mut force = [0.0; 3];
        for tooth in 0..process.teeth {
            let angle = (turn * time + process.pitch() * tooth as f64) % TAU;
            if angle >= process.arc[0] && angle <= process.arc[1] {
                let (s, c) = angle.sin_cos();
                let chip = feed * s + moved[0] * s + moved[1] * c;
                // Times (s, c), the coefficient matrix gives the force of a chip of 1.
                let [along_x, along_y]: [[f64; 3]; 2] = process.at(angle).into();
                for k in 0..3 {
                    force[k] += (along_x[k] * s + along_y[k] * c) * chip.max(0.0) * depth;
                }
            }
        }
        let mut rate = vec![0.0; 2 * count];
        for (j, mode) in modes.iter().enumerate() {
            let (q, v) = (state[2 * j], state[2 * j + 1]);
            rate[2 * j] = v;
            let push: f64 = (0..3).map(|k| tips[j][k] * force[k]).sum();
            rate[2 * j + 1] = push - 2.0 * mode.zeta * mode.omega * v - mode.omega.powi(2) * q;
        }
        rate
    };
    let moved = |state: &[f64], rate: &[f64], step: f64| -> Vec<f64> {
        state.iter().zip(rate).map(|(x, r)| x + r * step).collect()
    };
    let mut changes = vec![];
    for period in 0..periods {
        let mut new = vec![place(&state)];
        for k in 0..steps {
            let time = period as f64 * delay + k as f64 * h;
            let before = [old[2 * k], old[2 * k + 1], old[2 * k + 2]];
            let r1 = rates(time, &state, &before[0]);
            let r2 = rates(time + h / 2.0, &moved(&state, &r1, h / 2.0), &before[1]);
            let r3 = rates(time + h / 2.0, &moved(&state, &r2, h / 2.0), &before[1]);
            let r4 = rates(time + h, &moved(&state, &r3, h), &before[2]);
            let rate: Vec<f64> =
                (0..2 * count).map(|i| (r1[i] + 2.0 * r2[i] + 2.0 * r3[i] + r4[i]) / 6.0).collect();
            let next = moved(&state, &rate, h);
            // Cubic interpolation between the steps, from positions and speeds.
            let [[here, there], [slow, fast]] =
                [0, 1].map(|first| [&state, &next].map(|state| sum(state, first)));
            let middle = std::array::from_fn(|k| {
                (here[k] + there[k]) / 2.0 + (slow[k] - fast[k]) * (h / 8.0)
            });
            new.extend([middle, there]);
            state = next;
        }
        let apart =
            |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt();
        let change = new.iter().zip(&old).map(|(a, b)| apart(a, b));
        changes.push(change.fold(0.0, f64::max));
        old = new;
    }
    changes
}

#[test]
fn simulated_milling_settles_just_below_the_limit_depth_and_grows_just_above() {
    let rpm = 5000.0;
    let process = process("0p5_down");
    for both in [false, true] {
        let modes = modes(both);
        let period = Period::new(&in_plane(&modes), &process, rpm);
        let limit = first_limit(&period, 2.0).unwrap();
        for (share, grows) in [(0.97, false), (1.03, true)] {
            let changes = simulated(&modes, &process, rpm, share * limit, 160);
            // Late enough that only the slowest motion is left, and before teeth leave
            // the workpiece permanently: over 40 periods it grows as the multiplier predicts.
            let most =
                |from: usize| changes[from..from + 20].iter().fold(0.0, |a: f64, b| a.max(*b));
            let ratio = most(140) / most(100);
            let expected = amount(&period, share * limit).powi(40);
            assert_eq!(ratio > 1.0, grows, "{share}: {ratio}, by the multiplier {expected}");
            // Growth is bounded because teeth leave the workpiece; decay follows the multiplier.
            if !grows {
                close(ratio, expected, 0.3);
            }
        }
    }
}
