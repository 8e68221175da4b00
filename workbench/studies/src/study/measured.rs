// SPDX-License-Identifier: GPL-2.0-or-later
//! `[[measured]]` of a study: a measured frequency response of the tool against the work.
//!
//! A file has three columns, whose names give their units:
//!
//! ```text
//! hz,re_um_per_n,im_um_per_n
//! 20,0.0371,-0.0004
//! ```

use nalgebra::{Complex, ComplexField};
use serde::Deserialize;
use std::f64::consts::TAU;
use std::path::PathBuf;
use std::str::FromStr;

/// One of `[[measured]]`.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// Name in tables and plots.
    pub name: String,
    /// Relative to the study.
    pub file: PathBuf,
    #[serde(skip)]
    pub response: Receptance,
}

/// Largest displacement per force of a tool at its resonance, um/N: tools of machines have 0.01 to 5. A unit that is wrong by a
/// thousand leaves this range.
const PLAUSIBLE: [f64; 2] = [1e-3, 30.0];

impl Measured {
    /// Returns the question whether the file has another unit; `None` for a plausible response.
    pub fn doubt(&self) -> Option<String> {
        let sizes = self.response.samples.iter().map(|(_, value)| value.modulus());
        // um per mm.
        let largest = 1e3 * sizes.fold(0.0, f64::max);
        let [low, high] = PLAUSIBLE;
        let word = if largest < low { "only" } else { "up to" };
        (!(low..=high).contains(&largest)).then(|| {
            format!(
                "[[measured]] {}: {} gives {word} {largest:.3e} um/N, but tools of machines yield {low} to {high} um/N; \
                 is the unit of its columns right?",
                self.name,
                self.file.display()
            )
        })
    }
}

/// A receptance at measured frequencies, with straight lines between them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Receptance {
    /// Angular frequency in rad/s, rising, and displacement per force in mm/N; at least two.
    pub samples: Vec<(f64, Complex<f64>)>,
}

/// Why a file is no frequency response.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BadResponse {
    #[error(
        "line 1: found the columns {0}; expected hz or rad_per_s, then re_UNIT and im_UNIT with the unit um_per_n, \
         mm_per_n or m_per_n, such as hz,re_um_per_n,im_um_per_n"
    )]
    Columns(String),
    #[error("line {0}: {1}")]
    Row(u64, String),
    #[error("line {line}: {at} after {before}: expected rising frequencies above 0; sort the rows")]
    Falling { line: u64, at: f64, before: f64 },
    #[error("line {0}: remove the row of 0 Hz; frequencies are above 0")]
    Rest(u64),
    #[error("{0} rows below the header: expected at least 2")]
    Short(usize),
    #[error(
        "the displacement leads the force, which no structure does at rest; if the program that measured has the \
         opposite sign of the phase, negate the imaginary part"
    )]
    Leading,
    #[error(
        "the displacement opposes the force at the lowest frequency, {0:.1} Hz: is the direction of the sensor reversed, \
         or is it an acceleration? Give displacement per force, from below the first resonance and above the noise"
    )]
    Opposed(f64),
    #[error(
        "the response turns by {turn:.0} degrees from {from:.1} to {to:.1} Hz, so a resonance may lie between both rows: \
         measure at more frequencies, with turns of at most {TURN} degrees"
    )]
    Coarse { turn: f64, from: f64, to: f64 },
}

/// Largest turn between neighboring samples, degrees: a straight line then leaves a circle by 1 - cos(22.5°), 8% of
/// its radius.
const TURN: f64 = 45.0;

/// Share of the largest response below which turns are not judged: antiresonances and noise turn fast.
const MATTERS: f64 = 0.1;

/// Units of frequency and displacement per force, with their size in rad/s and mm/N.
const FREQUENCIES: [(&str, f64); 2] = [("hz", TAU), ("rad_per_s", 1.0)];
const UNITS: [(&str, f64); 3] = [("um_per_n", 1e-3), ("mm_per_n", 1.0), ("m_per_n", 1e3)];

impl FromStr for Receptance {
    type Err = BadResponse;

    fn from_str(text: &str) -> Result<Self, BadResponse> {
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let bad = |error: csv::Error| {
            BadResponse::Row(error.position().map_or(1, csv::Position::line), error.to_string())
        };
        let header = reader.headers().map_err(bad)?;
        let [scale, unit] = units(header)
            .ok_or_else(|| BadResponse::Columns(header.iter().collect::<Vec<_>>().join(",")))?;
        let mut samples: Vec<(f64, Complex<f64>)> = vec![];
        for record in reader.records() {
            let record = record.map_err(bad)?;
            let line = record.position().map_or(0, csv::Position::line);
            let mut cells = [0.0; 3];
            for (cell, word) in cells.iter_mut().zip(&record) {
                let number = word.parse().ok().filter(|number: &f64| number.is_finite());
                *cell = number
                    .ok_or_else(|| BadResponse::Row(line, format!("\"{word}\" is not a number")))?;
            }
            let before = samples.last().map_or(0.0, |(omega, _)| omega / scale);
            if cells[0] == 0.0 {
                return Err(BadResponse::Rest(line));
            }
            if !(cells[0] > before) {
                return Err(BadResponse::Falling { line, at: cells[0], before });
            }
            samples.push((cells[0] * scale, Complex::new(cells[1], cells[2]) * unit));
        }
        if samples.len() < 2 {
            return Err(BadResponse::Short(samples.len()));
        }
        // Causality: the displacement per force at rest is -2/π times the integral of the imaginary part over ln ω.
        let area = |pair: &[(f64, Complex<f64>)]| {
            (pair[0].1.im + pair[1].1.im) * (pair[1].0 / pair[0].0).ln()
        };
        let integral: f64 = samples.windows(2).map(area).sum();
        if samples[0].1.re < 0.0 {
            return Err(BadResponse::Opposed(samples[0].0 / TAU));
        }
        if samples[0].1.re > 0.0 && integral > 0.0 {
            return Err(BadResponse::Leading);
        }
        let own = Self { samples };
        own.coarse().map_or(Ok(own), Err)
    }
}

/// Returns the units of the columns in rad/s and mm/N; `None` if they are others.
fn units(header: &csv::StringRecord) -> Option<[f64; 2]> {
    let [frequency, re, im] = header.iter().collect::<Vec<_>>().try_into().ok()?;
    let find = |units: &[(&str, f64)], word: &str| {
        units.iter().find(|(name, _)| *name == word).map(|(_, size)| *size)
    };
    let unit = re.strip_prefix("re_")?;
    (im.strip_prefix("im_")? == unit).then_some(())?;
    Some([find(&FREQUENCIES, frequency)?, find(&UNITS, unit)?])
}

impl Receptance {
    /// Returns the displacement per force at an angular frequency, mm/N; beyond the ends that at the end.
    pub fn at(&self, omega: f64) -> Complex<f64> {
        let next = self.samples.partition_point(|(other, _)| *other < omega);
        let next = next.clamp(1, self.samples.len() - 1);
        let [(low, from), (high, to)] = [self.samples[next - 1], self.samples[next]];
        from + (to - from) * ((omega - low) / (high - low)).clamp(0.0, 1.0)
    }

    /// Returns the lowest and the highest frequency, rad/s.
    pub fn range(&self) -> [f64; 2] {
        [self.samples[0].0, self.samples[self.samples.len() - 1].0]
    }

    /// Returns the first turn of a large response that is too wide for a straight line.
    fn coarse(&self) -> Option<BadResponse> {
        let largest = |samples: &[(f64, Complex<f64>)]| {
            samples.iter().map(|(_, value)| value.modulus()).fold(0.0, f64::max)
        };
        let least = MATTERS * largest(&self.samples);
        let wide = |pair: &[(f64, Complex<f64>)]| {
            let turn = (pair[1].1 * pair[0].1.conjugate()).argument().abs().to_degrees();
            let [from, to] = [pair[0].0 / TAU, pair[1].0 / TAU];
            (turn > TURN && largest(pair) > least).then_some(BadResponse::Coarse { turn, from, to })
        };
        self.samples.windows(2).find_map(wide)
    }

    /// Returns the frequency of the slowest resonance, rad/s: the lowest peak of the imaginary part that noise does
    /// not have.
    pub fn slowest(&self) -> f64 {
        let size = |at: usize| self.samples[at].1.im.abs();
        let count = self.samples.len();
        let least = MATTERS * (0..count).map(size).fold(0.0, f64::max);
        let mut at = (0..count).find(|k| size(*k) >= least).unwrap_or(0);
        while at + 1 < count && size(at + 1) > size(at) {
            at += 1;
        }
        self.samples[at].0
    }
}
