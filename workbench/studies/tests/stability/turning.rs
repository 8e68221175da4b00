// SPDX-License-Identifier: GPL-2.0-or-later
//! Turning with one mode, whose lobes have a closed form.

use nalgebra::Vector3;
use std::f64::consts::{PI, TAU};
use studies::dynamics::mode::Mode;
use studies::stability::floquet::Period;
use studies::stability::lobes::Lobes;
use studies::stability::process::{Process, Row, turning_rows};
use studies::study::file::Study;
use test_support::stability::{close, golden, row, rows};

/// Returns k, the natural frequency in rad/s, ζ, Kf.
fn values() -> [f64; 4] {
    let values = row(golden("chatter", "turning_k_fn_zeta_Kf"));
    [values[0], TAU * values[1], values[2], values[3]]
}

fn lathe() -> (Vec<Row>, Process) {
    let [k, omega, zeta, kf] = values();
    let text = format!("[turning]\nkf_n_per_mm2 = {kf}\nthicker = [0, 2, 0]\nforce = [0, -1, 0]\n");
    let turning = Study::parse(&text).unwrap().turning.unwrap();
    let tip = Vector3::new(0.3, omega / k.sqrt(), 0.0);
    (turning_rows(&[Mode { omega, zeta, tip }], &turning), Process::from(&turning))
}

#[test]
fn the_floor_of_turning_is_its_closed_form() {
    let [k, omega, zeta, kf] = values();
    let (rows, process) = lathe();
    let floor = Lobes::new(&rows, &process, 1000.0).floor().unwrap();
    let expected = row(golden("chatter", "turning_b_min_omega"));
    // A minimum: the error of the frequency is the square root of that of the depth.
    close(floor.depth, 2.0 * k * zeta * (1.0 + zeta) / kf, 1e-10);
    close(floor.depth, expected[0], 1e-10);
    close(floor.omega, omega * (1.0 + 2.0 * zeta).sqrt(), 1e-6);
    close(floor.omega, expected[1], 1e-6);
}

#[test]
fn the_lobes_of_turning_are_least_where_the_closed_form_says() {
    let (rows, process) = lathe();
    let lobes = Lobes::new(&rows, &process, 1000.0);
    let floor = lobes.floor().unwrap();
    for rpm in row(golden("chatter", "turning_least_rpm_lobes_0_3")) {
        close(lobes.limit(rpm).unwrap().depth, floor.depth, 1e-8);
        assert!([0.98, 1.02].iter().all(|s| lobes.limit(rpm * s).unwrap().depth > floor.depth));
    }
    // ωτ = 3π + 2 arg G + 2πj, the phase of G between -π and -π/2.
    let [k, omega, zeta, kf] = values();
    for point in lobes.curves(3).concat().iter().filter(|point| point.limit.depth < 20.0) {
        let at = point.limit.omega / omega;
        let phase = -(2.0 * zeta * at).atan2(1.0 - at * at);
        let turns = (60.0 * point.limit.omega / point.rpm - 3.0 * PI - 2.0 * phase) / TAU;
        assert!((turns - turns.round()).abs() < 1e-9, "{turns}");
        let real = (1.0 - at * at) / ((1.0 - at * at).powi(2) + (2.0 * zeta * at).powi(2)) / k;
        close(point.limit.depth, -1.0 / (2.0 * kf * real), 1e-9);
    }
}

#[test]
fn collocation_gives_the_lobes_of_turning() {
    let (rows_, process) = lathe();
    let lobes = Lobes::new(&rows_, &process, 1000.0);
    for expected in rows("chatter", "turning_rpm_b") {
        let depth = lobes.limit(expected[0]).unwrap().depth;
        close(depth, expected[1], 1e-8);
        let period = Period::new(&rows_, &process, expected[0]);
        let over = |depth: f64| period.multiplier(depth).norm_sqr().sqrt() - 1.0;
        // The slope of the multiplier converts its error to one of the depth.
        let step = 1e-3 * depth;
        let slope = (over(depth + step) - over(depth - step)) / (2.0 * step);
        assert!((over(depth) / slope).abs() < 1e-8 * depth, "{expected:?}");
        assert!(over(0.999 * depth) < 0.0 && over(1.001 * depth) > 0.0);
    }
}
