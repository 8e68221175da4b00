// SPDX-License-Identifier: GPL-2.0-or-later
//! A measured frequency response in place of masses: samples of the paper's links, computed here from their formula.

use super::example;
use nalgebra::{Complex, ComplexField};
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
    let [at, other] = [&own.lag, &masses].map(|lag| lag.margins(limit.stiffness / 2.0));
    close(at.gain, other.gain, LINES);
    // A sample next to the extremum: a quarter of the distance of the samples over ζω, squared.
    close(at.distance, other.distance, 2.0 * LINES);
    // Relative to the lowest measured frequency, 20 Hz, instead of rest: (20/522)² of G.
    close(at.index, other.index, 3e-3);
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
    let far = file("rad_per_s,re_m_per_n,im_m_per_n", &LINKS, 1e-3, even(2e4, 2.1e4));
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
    assert!(rows("0,2,-3\n2,3,-4\n").contains("line 2: 0 after 0: expected rising"));
    assert!(rows("3,2,-3\n2,3,-4\n").contains("line 3: 2 after 3: expected rising"));
    assert!(rows("3,2,-3\n").contains("1 rows below"));
    let header = "hz,re_um_per_n,im_um_per_n";
    let other = file(header, &LINKS, 1e3, even(20.0, 3000.0));
    let other: Vec<_> = other.lines().map(|line| line.rsplit_once(',').unwrap()).collect();
    let negated = |(rest, im): &(&str, &str)| format!("{rest},{}\n", im.trim_start_matches('-'));
    let leading: String = other.iter().map(negated).collect();
    assert_eq!(leading.parse::<Receptance>(), Err(BadResponse::Leading));
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
