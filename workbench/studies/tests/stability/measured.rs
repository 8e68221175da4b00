// SPDX-License-Identifier: GPL-2.0-or-later
//! A measured frequency response in place of masses: samples of the paper's links, computed here from their formula.

use super::example;
use nalgebra::{Complex, ComplexField};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;
use studies::stability::lag::Lag;
use studies::stability::system::{Adjustment, NoLoop};
use studies::study::file::Study;
use studies::study::measured::{BadResponse, Receptance};
use test_support::stability::close;

/// Mass, damping and stiffness of the links of paper 002: kg, N s/m, N/m.
const LINKS: [[f64; 3]; 2] = [[2.27, 441.454, 38.9e6], [8.65, 1217.793, 93e6]];

/// Distance of the samples, Hz.
const STEP: f64 = 0.2;

/// A straight line between samples errs by Δω²/8 of the second derivative, which is at most 2/(ζω)² of the response:
/// 8e-5 with ζω = 70 1/s of the table.
const LINES: f64 = 1e-4;

/// Returns a file with the sum of some links in mm/N times `scale`.
fn file(header: &str, links: &[[f64; 3]], scale: f64, hz: impl Iterator<Item = f64>) -> String {
    let row = |hz: f64| {
        let p = Complex::new(0.0, TAU * hz);
        let of = |[m, h, k]: &[f64; 3]| Complex::new(1e3, 0.0) / (p * p * *m + p * *h + *k);
        let sum: Complex<f64> = links.iter().map(of).sum();
        format!("{hz},{:e},{:e}\n", sum.re * scale, sum.im * scale)
    };
    format!("{header}\n{}", hz.map(row).collect::<String>())
}

fn even(from: f64, to: f64) -> impl Iterator<Item = f64> {
    (0..=((to - from) / STEP) as usize).map(move |k| from + STEP * k as f64)
}

fn measured(links: &[[f64; 3]]) -> Receptance {
    file("hz,re_um_per_n,im_um_per_n", links, 1e3, even(20.0, 3000.0)).parse().unwrap()
}

const MEASURED: &str = "[[measured]]\nname = \"tool\"\nfile = \"frf.csv\"\n";

/// Returns the loop of a study with a response.
fn of(text: &str, response: Receptance) -> Result<Adjustment, NoLoop> {
    let mut study = Study::parse(&format!("[lag]\ntime_constant_ms = 0.27855\n{text}")).unwrap();
    study.measured[0].response = response;
    Adjustment::of(&study, None)
}

fn masses() -> Lag {
    Adjustment::of(&Study::parse(&example("paper-002.toml")).unwrap(), None).unwrap().lag
}

#[test]
fn a_measured_response_has_the_limit_of_the_masses_that_it_comes_from() {
    let masses = masses();
    let limit = masses.limit().crossing.unwrap();
    let own = of(MEASURED, measured(&LINKS)).unwrap();
    let found = own.lag.limit();
    assert!(found.is_certified);
    let crossing = found.crossing.unwrap();
    close(crossing.stiffness, limit.stiffness, LINES);
    close(crossing.omega, limit.omega, LINES);
    let [(time, least), (expected, worst)] =
        [&own.lag, &masses].map(|lag| lag.worst_lag().unwrap());
    close(least.stiffness, worst.stiffness, LINES);
    // At a flat minimum, which samples miss by up to half their distance; T changes by its 1/(ζω) per frequency: 0.6/70.
    close(time, expected, 0.01);
    // One link measured, the other one as a mass.
    let table = "[[links]]\nname = \"table\"\nmass_kg = 8.65\ndamping_n_s_per_mm = 1.217793\n\
                 stiffness_n_per_um = 93\n";
    let mixed = of(&format!("{table}{MEASURED}"), measured(&LINKS[..1])).unwrap();
    assert_eq!(mixed.names, ["table", "tool"]);
    close(mixed.lag.limit().crossing.unwrap().stiffness, limit.stiffness, LINES);
    let [at, other] =
        [&own.lag, &masses].map(|lag| lag.margins(limit.stiffness / 2.0, lag.limit().crossing));
    close(at.gain, other.gain, LINES);
    // A sample next to the extremum: a quarter of the distance of the samples over ζω, squared.
    close(at.distance, other.distance, 2.0 * LINES);
    // Relative to the lowest measured frequency, 20 Hz, instead of rest: (20/522)² of G.
    close(at.index.unwrap(), other.index.unwrap(), 3e-3);
    // Relative to the same.
    close(at.bandwidth.unwrap(), other.bandwidth.unwrap(), 3e-3);
    assert!(at.decay.is_none() && at.settling().is_none());
}

#[test]
fn turns_count_the_roots_that_eigenvalues_count() {
    let masses = masses();
    let own = of(MEASURED, measured(&LINKS)).unwrap().lag;
    let limit = masses.limit().crossing.unwrap().stiffness;
    for (re, im) in [(0.5, 0.0), (0.999, 0.0), (1.001, 0.0), (5.0, 0.0), (1.0, 1.0), (-3.0, 4.0)] {
        let place = Complex::new(re, im) * limit;
        assert_eq!(own.unstable(place), masses.unstable(place), "{place}");
    }
    for point in own.curve(limit) {
        let found = Complex::new(point.at[0], point.at[1]);
        let expected = masses.boundary(point.omega);
        // The curve consists of samples: rounding of the file's units.
        assert!((found - expected).modulus() < 1e-9 * expected.modulus(), "{point:?}");
    }
}

#[test]
fn a_range_that_decides_nothing_confirms_nothing() {
    // Up to 600 Hz, below the limit's 671 Hz.
    let short = file("hz,re_mm_per_n,im_mm_per_n", &LINKS, 1.0, even(20.0, 600.0));
    let limit = of(MEASURED, short.parse().unwrap()).unwrap().lag.limit();
    assert!(!limit.is_certified && limit.crossing.is_none(), "{limit:?}");
    // Up to 1500 Hz everything is decided.
    let long = file("hz,re_mm_per_n,im_mm_per_n", &LINKS, 1.0, even(20.0, 1500.0));
    let limit = of(MEASURED, long.parse().unwrap()).unwrap().lag.limit();
    assert!(limit.is_certified && limit.crossing.is_some(), "{limit:?}");
    let mut apart = Study::parse(&format!("[lag]\ntime_constant_ms = 0.1\n{MEASURED}{MEASURED}"));
    let apart = apart.as_mut().unwrap();
    let far = file("hz,re_m_per_n,im_m_per_n", &LINKS, 1e-3, even(1.0, 19.0));
    apart.measured[0].response = measured(&LINKS);
    apart.measured[1].response = far.parse().unwrap();
    assert_eq!(Adjustment::of(apart, None), Err(NoLoop::Apart));
}

#[test]
fn units_are_those_of_the_header() {
    let one = measured(&LINKS);
    for (header, scale) in
        [("hz,re_mm_per_n,im_mm_per_n", 1.0), ("hz, re_m_per_n, im_m_per_n", 1e-3)]
    {
        let other: Receptance = file(header, &LINKS, scale, even(20.0, 3000.0)).parse().unwrap();
        let (a, b) = (one.at(2e3), other.at(2e3));
        // The cells differ by powers of ten: rounding.
        assert!((a - b).modulus() < 1e-12 * a.modulus(), "{header}");
    }
    let text = "# bench 3\nrad_per_s,re_mm_per_n,im_mm_per_n\n100,2e-5,-1e-6\n300,4e-5,-3e-6\n";
    let found: Receptance = text.parse().unwrap();
    // Halfway between both samples; rounding.
    assert!((found.at(200.0) - Complex::new(3e-5, -2e-6)).modulus() < 1e-19);
    assert_eq!(found.range(), [100.0, 300.0]);
    assert_eq!(found.at(1.0), Complex::new(2e-5, -1e-6));
    assert_eq!(found.at(1e9), Complex::new(4e-5, -3e-6));
}

#[test]
fn a_file_that_is_no_response_is_refused_with_its_line() {
    let of = |text: &str| text.parse::<Receptance>().unwrap_err().to_string();
    for header in
        ["hz,re,im", "f,re_um_per_n,im_um_per_n", "hz,re_um_per_n,im_mm_per_n", "hz,re_um_per_n"]
    {
        let found = of(&format!("{header}\n1,2,3\n"));
        assert!(found.contains(header) && found.contains("such as hz,re_um_per_n"), "{found}");
    }
    let rows = |rows: &str| of(&format!("hz,re_um_per_n,im_um_per_n\n{rows}"));
    assert!(rows("1,2,x\n2,3,4\n").contains("line 2: \"x\" is not a number"));
    assert!(rows("1,2,nan\n2,3,4\n").contains("line 2: \"nan\" is not a number"));
    assert!(rows("1,2,3\n2,3\n").contains("line 3"));
    assert!(rows("0,2,-3\n2,3,-4\n").contains("line 2: remove the row of 0 Hz"));
    assert!(rows("3,2,-3\n2,3,-4\n").contains("line 3: 2 after 3: expected rising"));
    assert!(rows("3,2,-3\n").contains("1 rows below"));
    let header = "hz,re_um_per_n,im_um_per_n";
    let other = file(header, &LINKS, 1e3, even(20.0, 3000.0));
    let other: Vec<_> = other.lines().map(|line| line.rsplit_once(',').unwrap()).collect();
    let negated = |(rest, im): &(&str, &str)| format!("{rest},{}\n", im.trim_start_matches('-'));
    let leading: String = other.iter().map(negated).collect();
    assert_eq!(leading.parse::<Receptance>(), Err(BadResponse::Leading));
    // A reversed sensor, and two turns of a quarter: one of a large response, one of a small one.
    let found = rows("5,-2,0.1\n6,-3,0.2\n");
    assert!(found.contains("lowest frequency, 5.0 Hz: is the direction of the sensor reversed"));
    let found = rows("5,9,-0.1\n6,0.1,-9\n7,0,-1\n");
    assert!(found.contains("turns by 89 degrees from 5.0 to 6.0 Hz"), "{found}");
    let small = "5,20,-0.1\n6,1,-0.1\n7,0.1,-1\n";
    assert!(format!("{header}\n{small}").parse::<Receptance>().is_ok());
}

/// Returns mass, damping and stiffness of a link: kg, N s/m, N/m.
fn link(hz: f64, ratio: f64, stiffness: f64) -> [f64; 3] {
    let omega = TAU * hz;
    let mass = stiffness / (omega * omega);
    [mass, 2.0 * ratio * mass * omega, stiffness]
}

#[test]
fn a_file_coarser_than_its_resonances_is_refused() {
    // 50 samples up to 5000 Hz: straight lines had a limit of 25850 N/mm instead of 3590.
    let hz = (0..50).map(|k| 5.0 + 4995.0 / 49.0 * f64::from(k));
    let text = file("hz,re_um_per_n,im_um_per_n", &LINKS, 1e3, hz);
    let found = text.parse::<Receptance>();
    // The spindle vibrates at 658.8 Hz.
    assert!(
        matches!(found, Err(BadResponse::Coarse { from, to, .. }) if from < 658.8 && 658.8 < to),
        "{found:?}"
    );
}

#[test]
fn a_mass_outside_the_measured_range_is_refused() {
    let response = || {
        let text = file("hz,re_um_per_n,im_um_per_n", &LINKS, 1e3, even(400.0, 900.0));
        text.parse::<Receptance>().unwrap()
    };
    let link = |mass: f64| {
        let rest = "damping_n_s_per_mm = 0.4244\nstiffness_n_per_um = 10\n";
        format!("[[links]]\nname = \"soft\"\nmass_kg = {mass}\n{rest}{MEASURED}")
    };
    // 10 N/um with 11.26, 1 and 0.2 kg: 150, 503 and 1125 Hz.
    for (mass, hz) in [(11.26, "150.0"), (0.2, "1125.4")] {
        let message = of(&link(mass), response()).unwrap_err().to_string();
        let words = format!("soft vibrates at {hz} Hz, outside the measured 400.0 to 900.0 Hz");
        assert!(message.contains(&words), "{message}");
    }
    assert!(of(&link(1.0), response()).is_ok());
}

#[test]
fn an_open_loop_that_rises_at_the_upper_end_confirms_nothing() {
    // The range ends below the resonance at 660 Hz, where the limit is.
    let links = [link(200.0, 0.05, 30e6), link(660.0, 0.02, 38.9e6)];
    let limit = |high: f64| {
        let text = file("hz,re_um_per_n,im_um_per_n", &links, 1e3, even(5.0, high));
        let lag = of(MEASURED, text.parse().unwrap()).unwrap().lag.with_lag(0.9e-3);
        (lag.limit(), lag)
    };
    let (found, lag) = limit(640.0);
    let stiffness = found.crossing.unwrap().stiffness;
    assert!(!found.is_certified, "{found:?}");
    let (whole, _) = limit(3000.0);
    assert!(whole.is_certified && whole.crossing.unwrap().stiffness < stiffness, "{whole:?}");
    // With a modulus above 1 and a positive real part at the end.
    let (omega, large) = (lag.range()[1], 2.0 * stiffness);
    let open = lag.with_lag(1e-4).receptance(omega) * large / lag.with_lag(1e-4).delay(omega);
    assert!(
        open.re > 0.0 && open.modulus() > 1.0 && !lag.with_lag(1e-4).is_closed(large),
        "{open}"
    );
}

#[test]
fn the_slowest_resonance_bounds_the_lag() {
    // The resonance at 2000 Hz is twice as large, that at 200 Hz is slower.
    let links = [link(200.0, 0.03, 60e6), link(2000.0, 0.03, 30e6)];
    let text = file("hz,re_um_per_n,im_um_per_n", &links, 1e3, even(5.0, 5000.0));
    let lag = of(MEASURED, text.parse().unwrap()).unwrap().lag;
    // The imaginary part is largest within ζ² of the natural frequency, and within a sample.
    close(lag.slowest() / TAU, 200.0, 0.03 * 0.03 + STEP / 200.0);
}

#[test]
fn a_narrow_range_has_neither_index_nor_bandwidth() {
    // The first link vibrates at 658.8 Hz, the second one at 521.9 Hz.
    let margins = |low: f64, high: f64| {
        let text = file("hz,re_um_per_n,im_um_per_n", &LINKS, 1e3, even(low, high));
        of(MEASURED, text.parse().unwrap()).unwrap().lag.margins(100.0, None)
    };
    let known = |[low, high]: [f64; 2]| {
        let found = margins(low, high);
        [found.index.is_some(), found.bandwidth.is_some()]
    };
    assert_eq!(known([20.0, 3000.0]), [true, true]);
    // 200 Hz is not at rest.
    assert_eq!(known([200.0, 3000.0]), [false, false]);
    // Above the resonances, but not down to 1/√2 of rest; and below them.
    assert_eq!(known([20.0, 700.0]), [true, false]);
    assert_eq!(known([20.0, 400.0]), [false, false]);
}

/// Returns the response of the links with noise of a tenth of its value at rest.
fn noisy(count: usize) -> Receptance {
    let text =
        file("hz,re_um_per_n,im_um_per_n", &LINKS, 1e3, even(20.0, 20.0 + STEP * count as f64));
    let mut own: Receptance = text.parse().unwrap();
    let mut rng = Pcg64::seed_from_u64(59);
    let noise = 0.1 * own.samples[0].1.re;
    for (_, value) in &mut own.samples {
        *value += Complex::new(rng.random_range(-noise..noise), rng.random_range(-noise..noise));
    }
    own
}

#[test]
fn crossings_of_noise_are_computed_once() {
    let own = of(MEASURED, noisy(5000)).unwrap().lag;
    let counter = own.counter();
    // One alone without noise; this seed gives 41.
    assert!(counter.crossings().len() > 30, "{}", counter.crossings().len());
    // Sums of arguments, an independent count, at a few of them.
    for found in counter.crossings().iter().step_by(5) {
        for (share, count) in [1.0 - 1e-6, 1.0 + 1e-6].into_iter().zip(counter.beside(found)) {
            assert_eq!(count, by_argument(&own, found.stiffness * share), "{found:?}");
        }
    }
}

/// Counts turns by the sum of the arguments between neighboring samples and crossings.
fn by_argument(lag: &Lag, stiffness: f64) -> usize {
    let mut omegas: Vec<f64> = lag.measured[0].samples.iter().map(|(omega, _)| *omega).collect();
    omegas.extend(lag.crossings().iter().map(|found| found.omega));
    omegas.sort_by(f64::total_cmp);
    let at = |omega: &f64| 1.0 + lag.receptance(*omega) * stiffness / lag.delay(*omega);
    let half: Vec<Complex<f64>> = omegas.iter().map(at).collect();
    let one = [Complex::new(1.0, 0.0)];
    let all: Vec<Complex<f64>> =
        half.iter().rev().map(Complex::conj).chain(half.iter().copied()).chain(one).collect();
    let next = all.iter().cycle().skip(1);
    let angle: f64 = all.iter().zip(next).map(|(a, b)| (b / a).argument()).sum();
    (angle / TAU).round().abs() as usize
}

#[test]
fn a_unit_that_is_wrong_by_a_thousand_prompts_the_question() {
    let doubt = |header: &str| {
        let mut study =
            Study::parse(&format!("[lag]\ntime_constant_ms = 0.1\n{MEASURED}")).unwrap();
        // The cells are in um/N, whatever the header says.
        let text = file(header, &LINKS, 1e3, even(20.0, 3000.0));
        study.measured[0].response = text.parse().unwrap();
        study.measured[0].doubt()
    };
    assert_eq!(doubt("hz,re_um_per_n,im_um_per_n"), None);
    for header in ["hz,re_mm_per_n,im_mm_per_n", "hz,re_m_per_n,im_m_per_n"] {
        let found = doubt(header).unwrap();
        assert!(found.contains("tool: frf.csv gives up to") && found.contains("unit"), "{found}");
    }
    let mut study = Study::parse(&format!("[lag]\ntime_constant_ms = 0.1\n{MEASURED}")).unwrap();
    let text = file("hz,re_um_per_n,im_um_per_n", &LINKS, 1.0, even(20.0, 3000.0));
    study.measured[0].response = text.parse().unwrap();
    assert!(study.measured[0].doubt().unwrap().contains("gives only"));
}

#[test]
fn a_joint_without_effect_is_refused() {
    let with = |joint: &str| {
        let link = "name = \"a\"\nmass_kg = 1\ndamping_n_s_per_mm = 1\nstiffness_n_per_um = 9\n";
        let text = format!("[[links]]\n{link}[[links.joints]]\n{joint}\n");
        Study::parse(&text).map(|_| ()).map_err(|error| error.to_string())
    };
    assert!(with("angular_rad_per_n_m = 1e-5\narm_mm = 70").is_ok());
    assert!(with("compliance_um_per_n = 1e-3").is_ok());
    let found = with("angular_rad_per_n_m = 1e-5").unwrap_err();
    assert!(found.contains("angular_rad_per_n_m = 0.00001 without arm_mm"), "{found}");
    for joint in ["", "arm_mm = 70"] {
        assert!(with(joint).unwrap_err().contains("the joint is rigid"), "{joint}");
    }
}

#[test]
fn a_lag_longer_than_a_period_is_refused() {
    let text = example("paper-002.toml");
    let with = |lag: &str| {
        let text = text.replace("time_constant_ms = 0.27855", &format!("time_constant_ms = {lag}"));
        Adjustment::of(&Study::parse(&text).unwrap(), None)
    };
    // The period of the table is 1.9163 ms.
    assert!(with("1.91").is_ok());
    let message = with("3").unwrap_err().to_string();
    assert!(message.contains("time_constant_ms = 3: expected at most 1.916"), "{message}");
}

#[test]
fn a_mass_in_grams_prompts_the_question() {
    let text = example("paper-002.toml");
    let doubts = |text: &str| -> Vec<String> {
        Study::parse(text).unwrap().links.iter().filter_map(|link| link.doubt()).collect()
    };
    assert_eq!(doubts(&text), Vec::<String>::new());
    let found = doubts(&text.replace("mass_kg = 2.27", "mass_kg = 2270"));
    assert_eq!(found.len(), 1);
    assert!(found[0].contains("mass_kg = 2270") && found[0].contains("20.8 Hz; is the mass in g?"));
}

#[test]
fn joints_are_springs_in_series_with_their_link() {
    let text = example("paper-002.toml");
    let joints = "stiffness_n_per_um = 38.9\n[[links.joints]]\ncompliance_um_per_n = 0.004\n\
                  [[links.joints]]\nangular_rad_per_n_m = 2e-6\narm_mm = 70\n";
    let with = text.replace("stiffness_n_per_um = 38.9\n", joints);
    assert!(with != text);
    // The first link alone has the closed form K = h/T + h T k/m + h²/m, with the same damping ratio.
    let alone = |text: &str| {
        let mut study = Study::parse(text).unwrap();
        study.links.truncate(1);
        Adjustment::of(&study, None).unwrap().lag
    };
    let [m, h, k] = [LINKS[0][0] * 1e-3, LINKS[0][1] * 1e-3, LINKS[0][2] * 1e-3];
    let soft = 1.0 / (1.0 / k + 0.004e-3 + 2e-9 * 70.0 * 70.0);
    let time = 0.27855e-3;
    for (text, k, h) in [(&text, k, h), (&with, soft, h * (soft / k).sqrt())] {
        let lag = alone(text);
        // Closed forms: rounding.
        close(lag.receptance(0.0).re, 1.0 / k, 1e-12);
        let limit = lag.limit().crossing.unwrap();
        close(limit.stiffness, h / time + h * time * k / m + h * h / m, 1e-10);
    }
    let mut study = Study::parse(&with).unwrap();
    assert_eq!(Adjustment::of(&study, Some(300.0)), Err(NoLoop::Arm(70.0)));
    study.links[0].joints.truncate(1);
    let found = Adjustment::of(&study, Some(300.0)).unwrap().lag.terms[0];
    let expected = 1.0 / (1.0 / study.overhang.unwrap().stiffness(300.0) + 0.004e-3);
    close(found.square / found.gain, expected, 1e-12);
}
