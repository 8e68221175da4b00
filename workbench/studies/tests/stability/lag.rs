// SPDX-License-Identifier: GPL-2.0-or-later
//! The two links of tests/cases/two-links.toml: the numbers of paper 002 with its masses as tonnes.

use super::two_links;
use nalgebra::{Complex, ComplexField, DMatrix};
use studies::stability::lag::{Crossing, Lag, Term};
use studies::stability::partition::{CHORD, Point, chordal, regions};
use studies::stability::response::unwrapped;
use studies::stability::system::Adjustment;
use test_support::stability::{close, golden, number, row, rows};

/// Both are solutions of a polynomial with 16 digits; condition numbers are below 1e5.
const CROSSING: f64 = 1e-9;

/// Tolerance of closed forms: some roundings, and their square root at an extremum of a curve.
const CLOSED: f64 = 1e-10;

fn of_link(values: &[f64]) -> Term {
    Term::link(values[0], values[1], values[2])
}

fn links() -> Vec<Term> {
    ["link_1_m_h_k", "link_2_m_h_k"].map(|key| of_link(&row(golden("dpartition", key)))).into()
}

fn lag(milliseconds: f64) -> Lag {
    Lag { terms: links(), lag: milliseconds * 1e-3, ..Lag::default() }
}

fn real(value: f64) -> Complex<f64> {
    Complex::new(value, 0.0)
}

/// Names in the file of values.
const LAGS: [(&str, f64); 5] =
    [("T_0p0003", 0.3), ("T_0p001", 1.0), ("T_0p003", 3.0), ("T_0p01", 10.0), ("T_0p03", 30.0)];

fn same(found: &[Crossing], expected: &[Vec<f64>]) {
    let mut expected = expected.to_vec();
    expected.sort_by(|a, b| a[1].total_cmp(&b[1]));
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        close(found.omega, expected[0], CROSSING);
        close(found.stiffness, expected[1], CROSSING);
    }
}

#[test]
fn crossings_are_those_of_an_independent_calculation() {
    for (name, milliseconds) in LAGS {
        same(&lag(milliseconds).crossings(), &rows("dpartition", &format!("{name}_omega_K")));
    }
    let mut three = lag(3.0);
    three.terms.push(of_link(&row(golden("dpartition", "three_links_third_m_h_k"))));
    same(&three.crossings(), &rows("dpartition", "three_links_T_3ms_omega_K"));
}

/// Computes the crossings by sampling: where the boundary crosses the real axis at ω > 0.
fn sampled(lag: &Lag) -> Vec<Crossing> {
    let step = |k: usize| 1e-3 * 1.0002_f64.powi(k as i32);
    let mut found = vec![];
    for k in 0..70_000 {
        let (mut low, mut high) = (step(k), step(k + 1));
        let side = |omega: f64| lag.boundary(omega).im > 0.0;
        if side(low) == side(high) || lag.boundary(low).im.abs() > 1e12 {
            continue;
        }
        let from = side(low);
        for _ in 0..100 {
            let middle = (low + high) / 2.0;
            if side(middle) == from { low = middle } else { high = middle }
        }
        found.push(Crossing { omega: low, stiffness: lag.boundary(low).re });
    }
    found.sort_by(|a, b| a.stiffness.total_cmp(&b.stiffness));
    found
}

#[test]
fn the_polynomial_finds_the_crossings_that_sampling_finds() {
    for (_, milliseconds) in LAGS {
        let lag = lag(milliseconds);
        let (roots, seen) = (lag.crossings(), sampled(&lag));
        assert_eq!(roots.len(), seen.len());
        for (root, seen) in roots.iter().zip(seen) {
            close(root.omega, seen.omega, CROSSING);
            close(root.stiffness, seen.stiffness, CROSSING);
        }
    }
}

#[test]
fn roots_counted_beside_each_crossing_agree_and_certify_the_limit() {
    for (name, milliseconds) in LAGS {
        let lag = lag(milliseconds);
        let limit = lag.limit();
        assert!(limit.is_certified, "{milliseconds} ms");
        for found in lag.crossings() {
            let key = format!("{name}_unstable_about_{:.0}", found.stiffness);
            let expected = row(golden("dpartition", &key));
            let beside = [1.0 - 1e-6, 1.0 + 1e-6];
            let counts = beside.map(|share| lag.unstable(real(found.stiffness * share)) as f64);
            assert_eq!(counts.to_vec(), expected, "{key}");
        }
        let first = lag.crossings()[0];
        assert_eq!(limit.crossing, Some(first));
    }
}

#[test]
fn roots_in_the_plane_are_as_many_as_an_independent_calculation_counts() {
    let lag = lag(3.0);
    let counts = row(golden("dpartition", "plane_T_3ms_unstable"));
    for (place, count) in rows("dpartition", "plane_T_3ms_points_re_im").iter().zip(counts) {
        assert_eq!(lag.unstable(Complex::new(place[0], place[1])) as f64, count, "{place:?}");
    }
    let at_rest = number(golden("dpartition", "K_at_omega_0"));
    close(lag.at_rest(), at_rest, CLOSED);
    assert_eq!([1.001, 0.999].map(|share| lag.unstable(real(at_rest * share))), [1, 0]);
}

/// Counts unstable roots by the argument principle along the imaginary axis.
fn by_argument(lag: &Lag, stiffness: Complex<f64>) -> usize {
    let degree = 2 * lag.terms.len() + 1;
    let value = |omega: f64| {
        let below: Complex<f64> = lag
            .terms
            .iter()
            .map(|term| Complex::new(term.square - omega * omega, term.rate * omega))
            .product();
        (lag.delay(omega) + lag.receptance(omega) * stiffness) * below
    };
    let count = 200_001;
    let omega = |k: i32| 30.0 * (9.0 * (2.0 * f64::from(k) / f64::from(count - 1) - 1.0)).sinh();
    let angles = unwrapped((0..count).map(|k| value(omega(k)).argument()));
    let turn = (angles.last().unwrap() - angles[0]) / std::f64::consts::PI;
    ((degree as f64 - turn) / 2.0).round() as usize
}

#[test]
fn roots_are_as_many_as_the_turn_of_the_characteristic_function_says() {
    for place in [(2000.0, 0.0), (4000.0, 3000.0), (-20000.0, 30000.0), (60000.0, 1000.0)] {
        let place = Complex::new(place.0, place.1);
        assert_eq!(lag(3.0).unstable(place), by_argument(&lag(3.0), place), "{place}");
    }
}

#[test]
fn the_left_side_of_the_boundary_has_one_unstable_root_less() {
    let lag = lag(3.0);
    for omega in [-300.0, -137.0, -90.0, 40.0, 100.0, 120.0, 136.0, 150.0, 400.0] {
        let place = lag.boundary(omega);
        let along = lag.boundary(omega + 1e-4) - lag.boundary(omega - 1e-4);
        let side = |turn: f64| place + Complex::new(0.0, turn) * along * 0.01;
        assert_eq!(lag.unstable(side(1.0)) + 1, lag.unstable(side(-1.0)), "{omega}");
    }
}

#[test]
fn the_curve_is_sampled_evenly_to_the_eye() {
    for milliseconds in [1.0, 30.0] {
        let curve = lag(milliseconds).curve(2000.0);
        let place = |point: &Point| Complex::new(point.at[0], point.at[1]) / 2000.0;
        let steps = curve.windows(2).map(|pair| chordal(place(&pair[0]), place(&pair[1])));
        assert!(steps.fold(0.0, f64::max) <= CHORD);
        assert!((300..2000).contains(&curve.len()), "{}", curve.len());
        assert!(curve.windows(2).all(|pair| pair[0].omega < pair[1].omega));
    }
}

#[test]
fn regions_are_found_once_each_with_their_number_of_unstable_roots() {
    let lag = lag(30.0);
    let limit = lag.limit().crossing.unwrap().stiffness;
    // Near the real axis: stable below 7581, 2 roots up to 20691, 4 up to 53433, 2 beyond.
    let window = [[-10.0 * limit, 10.0 * limit], [-10.0 * limit, 10.0 * limit]];
    let found = regions(&window, |[re, im]| lag.unstable(Complex::new(re, im)));
    for region in &found {
        let [re, im] = region.at;
        assert_eq!(lag.unstable(Complex::new(re, im)), region.unstable);
        assert_eq!(by_argument(&lag, Complex::new(re, im)), region.unstable);
    }
    let mut counts: Vec<usize> = found.iter().map(|region| region.unstable).collect();
    counts.sort_unstable();
    counts.dedup();
    assert_eq!(counts, [0, 1, 2, 3, 4]);
}

#[test]
fn partitions_by_two_parameters_are_those_of_an_independent_calculation() {
    for expected in rows("dpartition", "two_parameter_omega_T_K") {
        let Point { at: [time, stiffness], .. } = lag(0.0).lag_and_stiffness(expected[0]);
        close(time, expected[1], CROSSING);
        close(stiffness, expected[2], CROSSING);
        let loop_ = lag(time * 1e3);
        let counts = [0.999, 1.001].map(|share| loop_.unstable(real(stiffness * share)));
        assert_eq!(counts[0].abs_diff(counts[1]), 2);
    }
    let found = [110.0, 138.0, 200.0, 300.0].map(|omega| lag(3.0).link_and_stiffness(omega));
    let found = found.concat();
    let expected = rows("dpartition", "k1_K_T_3ms_omega_k1_K");
    assert_eq!(found.len(), expected.len());
    for expected in expected {
        let is_it = |point: &&Point| (point.at[0] / expected[1] - 1.0).abs() < CROSSING;
        let point = found.iter().filter(|point| point.omega == expected[0]).find(is_it).unwrap();
        close(point.at[1], expected[2], CROSSING);
        let counts = [0.999, 1.001]
            .map(|share| lag(3.0).with_first(expected[1]).unstable(real(expected[2] * share)));
        assert_eq!(counts[0].abs_diff(counts[1]), 2, "{expected:?}");
    }
}

#[test]
fn at_the_worst_lag_the_limit_is_twice_the_regenerative_floor() {
    let expected = row(golden("dpartition", "worst_lag_omega_T_K"));
    let (time, crossing) = lag(1.0).worst_lag().unwrap();
    close(crossing.omega, expected[0], CROSSING);
    close(time, expected[1], CROSSING);
    close(crossing.stiffness, expected[2], CLOSED);
    let floor = number(golden("dpartition", "regenerative_floor_K"));
    close(crossing.stiffness, 2.0 * floor, CLOSED);
    let limit = lag(time * 1e3).limit().crossing.unwrap();
    close(limit.stiffness, crossing.stiffness, CLOSED);
    // No other lag has a smaller limit.
    for share in [0.5, 0.9, 0.99, 1.01, 1.1, 2.0] {
        let other = lag(time * share * 1e3).limit().crossing.unwrap();
        assert!(other.stiffness > crossing.stiffness, "{share}");
    }
}

#[test]
fn one_link_follows_its_closed_form() {
    let values = row(golden("dpartition", "link_1_m_h_k"));
    let (m, h, k) = (values[0], values[1], values[2]);
    for time in [0.001, 0.00763907, 0.02] {
        let one = Lag { terms: vec![Term::link(m, h, k)], lag: time, ..Lag::default() };
        let found = one.crossings();
        assert_eq!(found.len(), 1);
        close(found[0].omega, (k / m + h / (m * time)).sqrt(), CLOSED);
        close(found[0].stiffness, h / time + h * time * k / m + h * h / m, CLOSED);
    }
    let zeta = h / (2.0 * (k * m).sqrt());
    let one = Lag { terms: vec![Term::link(m, h, k)], lag: 0.0, ..Lag::default() };
    let (time, least) = one.worst_lag().unwrap();
    close(least.stiffness, 4.0 * zeta * (1.0 + zeta) * k, CLOSED);
    let expected = row(golden("dpartition", "one_link_least_T_K"));
    close(time, expected[0], CROSSING);
    close(least.stiffness, expected[1], CLOSED);
}

#[test]
fn without_a_lag_there_is_no_limit_unless_modes_couple() {
    let none = lag(0.0);
    assert_eq!(none.crossings(), []);
    assert_eq!(none.unstable(real(1e9)), 0);
    assert!(none.limit().is_certified && none.limit().crossing.is_none());
    let values = row(golden("dpartition", "mode_coupling_weights_omegas_zeta"));
    let term = |k: usize| Term {
        gain: values[k],
        rate: 2.0 * values[4] * values[2 + k],
        square: values[2 + k] * values[2 + k],
    };
    let coupled = Lag { terms: vec![term(0), term(1)], lag: 0.0, ..Lag::default() };
    same(&coupled.crossings(), &rows("dpartition", "mode_coupling_T_0_omega_K"));
    let limit = coupled.limit();
    assert!(limit.is_certified);
    let stiffness = limit.crossing.unwrap().stiffness;
    assert_eq!([0.999, 1.001].map(|share| coupled.unstable(real(stiffness * share))), [0, 2]);
}

#[test]
fn responses_are_those_of_an_independent_calculation() {
    let lag = lag(3.0);
    for expected in rows("dpartition", "response_K_2000_T_3ms_omega_re_im_abs_arg_reP_imP") {
        let found = lag.response(2000.0, expected[0]);
        let size = expected[3];
        // Complex numbers of 16 digits.
        assert!((found.cutting - Complex::new(expected[1], expected[2])).modulus() < 1e-12 * size);
        close(found.cutting.modulus(), expected[3], 1e-12);
        assert!((found.cutting.argument() - expected[4]).abs() < 1e-12);
        let printed = lag.response_to(1, 2000.0, expected[0]);
        assert!((printed - Complex::new(expected[5], expected[6])).modulus() < 1e-12 * size);
        let sum: Complex<f64> = found.terms.iter().sum();
        assert!((sum - found.free).modulus() < 1e-15 * found.free.modulus());
    }
}

#[test]
fn margins_end_at_the_limit() {
    let lag = lag(3.0);
    let limit = lag.limit().crossing.unwrap();
    let at = |share: f64| lag.margins(limit.stiffness * share, Some(limit));
    let [low, high] = [at(0.4), at(0.999)];
    close(low.gain, 2.5, CLOSED);
    close(high.gain, 1.0 / 0.999, CLOSED);
    assert!(low.distance > high.distance && high.distance < 1e-3);
    assert!(low.index < high.index && high.index > Some(100.0));
    assert!((high.peak / limit.omega - 1.0).abs() < 1e-3, "{}", high.peak);
    assert!(low.settling().unwrap() < high.settling().unwrap());
    assert!(high.phase.unwrap() < 1e-3 && low.phase.is_none_or(|phase| phase > 0.1));
    assert_eq!(at(1.001).settling(), None);
    assert!(low.bandwidth > Some(low.peak));
    // One link with negligible cutting stiffness: roots decay at ζω, and the peak is 1/(2ζ√(1-ζ²)).
    let (mass, damping, stiffness) = (2.0, 8.0, 800.0);
    let (omega, zeta) = (20.0, 0.1);
    let one =
        Lag { terms: vec![Term::link(mass, damping, stiffness)], lag: 1e-3, ..Lag::default() };
    let free = one.margins(1e-9, None);
    close(free.decay.unwrap(), zeta * omega, 1e-9);
    // The largest sample, near the extremum of the amplitude.
    close(free.index.unwrap(), 1.0 / (2.0 * zeta * (1.0 - zeta * zeta).sqrt()), 1e-5);
    let cut = 1.0 - 2.0 * zeta * zeta;
    close(free.bandwidth.unwrap(), omega * (cut + (cut * cut + 1.0).sqrt()).sqrt(), 1e-9);
}

#[test]
fn the_closed_loop_of_real_matrices_has_the_same_roots() {
    // An independent formulation in machine units with one matrix: displacement and speed of
    // each link, and the force.
    let lag = lag(3.0);
    let values = ["link_1_m_h_k", "link_2_m_h_k"].map(|key| row(golden("dpartition", key)));
    let stiffness = 6000.0;
    let mut matrix = DMatrix::<f64>::zeros(5, 5);
    for (j, link) in values.iter().enumerate() {
        matrix[(2 * j, 2 * j + 1)] = 1.0;
        matrix[(2 * j + 1, 2 * j)] = -link[2] / link[0];
        matrix[(2 * j + 1, 2 * j + 1)] = -link[1] / link[0];
        matrix[(2 * j + 1, 4)] = -1.0 / link[0];
        matrix[(4, 2 * j)] = stiffness / 3e-3;
    }
    matrix[(4, 4)] = -1.0 / 3e-3;
    let own = matrix.complex_eigenvalues();
    for root in lag.roots(real(stiffness)) {
        let nearest =
            own.iter().map(|other| (other - root).modulus()).fold(f64::INFINITY, f64::min);
        // Eigenvalues of an unbalanced matrix whose entries differ by 1e6.
        assert!(nearest < 1e-7 * root.modulus(), "{root}: {nearest:e}");
    }
}

#[test]
fn many_terms_have_all_their_crossings_and_a_certified_limit() {
    // Twenty modes over a decade: a polynomial of degree 39, which alone has no accurate digit left.
    let term = |k: i32| {
        let omega = 100.0 * 10.0_f64.powf(f64::from(k) / 19.0);
        let gain = if k % 3 == 2 { -0.4 } else { 1.0 };
        Term { gain, rate: 0.06 * omega, square: omega * omega }
    };
    let many = Lag { terms: (0..20).map(term).collect(), lag: 2e-3, ..Lag::default() };
    let (found, seen) = (many.crossings(), sampled(&many));
    assert!(found.len() >= 10, "{}", found.len());
    for seen in seen {
        let is_it = |found: &&Crossing| (found.omega / seen.omega - 1.0).abs() < 1e-9;
        assert!(found.iter().any(|found| is_it(&found)), "{seen:?}");
    }
    assert!(many.limit().is_certified);
}

#[test]
fn width_and_depth_of_the_chip_are_those_of_the_formulas() {
    let chip = |factor: f64| {
        let text = two_links().replace("factor = 1.4", &format!("factor = {factor}"));
        studies::study::file::Study::parse(&text).unwrap().chip.unwrap()
    };
    let widths = rows("dpartition", "chip_b_1p4_1p3");
    for (stiffness, expected) in [3823.0, 1526.0].into_iter().zip(widths) {
        close(chip(1.4).width(stiffness), expected[0], 1e-12);
        close(chip(1.3).width(stiffness), expected[1], 1e-12);
    }
    close(chip(1.4).depth(3823.0), number(golden("dpartition", "chip_t_opt_1p4")), 1e-12);
}

#[test]
fn the_first_link_yields_with_its_overhang_as_the_formula_says() {
    let study = studies::study::file::Study::parse(&two_links()).unwrap();
    for expected in rows("dpartition", "overhang_l_delta_k1_omega_K_T_3ms") {
        let stiffness = study.overhang.unwrap().stiffness(expected[0]);
        close(1.0 / stiffness, expected[1], 1e-12);
        close(stiffness, expected[2], 1e-12);
        let own = Adjustment::of(&study, Some(expected[0])).unwrap().lag;
        let limit = own.limit();
        let crossing = limit.crossing.unwrap();
        close(crossing.omega, expected[3], 1e-9);
        close(crossing.stiffness, expected[4], 1e-9);
        assert!(limit.is_certified);
    }
}
