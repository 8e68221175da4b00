// SPDX-License-Identifier: GPL-2.0-or-later
//! Output of `pkm dynamics` as text, as JSON and as tables.

use super::failure::Failure;
use super::in_words;
use kinematics::{Matrix3, Pose, Vector3};
use machine::files::csv;
use nalgebra::Complex;
use serde::Serialize;
use std::io::Write;
use std::path::PathBuf;
use studies::dynamics::linear::Ellipse;
use studies::dynamics::record::Record;
use studies::dynamics::structure::Structure;
use studies::study::forcing::Force as Random;

/// um per mm.
pub const UM: f64 = 1e3;

/// Results.
#[derive(Serialize)]
pub struct Answer {
    pub machine: PathBuf,
    /// X Y Z in machine units, A B C in degrees.
    pub pose: [f64; 6],
    pub modes: Vec<ModeAnswer>,
    /// Poles with all dampers: real and imaginary parts, 1/s.
    pub poles: Vec<[f64; 2]>,
    /// Compliance of the tip, um/N.
    pub compliance_um_per_n: [[f64; 3]; 3],
    /// Leg forces that support the weight, positive for compression.
    pub bearing_n: Vec<f64>,
    pub motion: Option<MotionAnswer>,
}

#[derive(Serialize)]
pub struct ModeAnswer {
    pub hz: f64,
    pub damping_ratio: f64,
    /// Displacement in the mass-normalized shape, 1/sqrt(kg).
    pub tip: [f64; 3],
}

#[derive(Serialize)]
pub struct MotionAnswer {
    pub seconds: f64,
    pub step_s: f64,
    pub mean_um: [f64; 3],
    pub rms_um: [f64; 3],
    pub peak_um: [f64; 3],
    pub ellipse: EllipseAnswer,
    /// Largest absolute force of every leg.
    pub leg_peaks_n: Vec<f64>,
    /// Volume that a cutter has removed from `[stock]`.
    pub removed_mm3: Option<f64>,
    /// Results of the linear theory under a random force.
    pub linear: Option<LinearAnswer>,
}

/// Half axes of one standard deviation in X and Y, and the direction of the long one from X.
#[derive(Serialize)]
pub struct EllipseAnswer {
    pub axes_um: [f64; 2],
    pub direction_deg: f64,
}

#[derive(Serialize)]
pub struct LinearAnswer {
    pub rms_um: [f64; 3],
    pub ellipse: EllipseAnswer,
    /// RMS displacement of the end of a unit vector along the spindle axis, along X Y Z: its inclination.
    pub axis_rms_urad: [f64; 3],
    /// RMS force of every leg, about its static load.
    pub leg_rms_n: Vec<f64>,
    /// Relative standard deviation of the variances of a record of this length.
    pub spread: [f64; 3],
}

impl EllipseAnswer {
    pub fn of(covariance: &Matrix3<f64>) -> Self {
        let Ellipse { axes, direction } = Ellipse::of(covariance);
        Self { axes_um: axes.map(|axis| axis * UM), direction_deg: direction }
    }
}

pub fn roots(covariance: &Matrix3<f64>) -> [f64; 3] {
    [0, 1, 2].map(|k| covariance[(k, k)].sqrt() * UM)
}

/// Returns the results of a motion in time.
pub fn of_record(record: &Record, linear: Option<LinearAnswer>) -> MotionAnswer {
    let covariance = record.covariance();
    MotionAnswer {
        seconds: record.tip.len() as f64 * record.step,
        step_s: record.step,
        mean_um: (record.mean() * UM).into(),
        rms_um: roots(&covariance),
        peak_um: (record.peaks() * UM).into(),
        ellipse: EllipseAnswer::of(&covariance),
        leg_peaks_n: record.forces.clone(),
        removed_mm3: record.removed,
        linear,
    }
}

/// Prints the results as text.
pub fn report(answer: &Answer, pose: &Pose) -> Result<(), Failure> {
    let mut out = super::output::people();
    writeln!(out, "{} at {}", answer.machine.display(), in_words(pose))?;
    writeln!(out, "\nmodes: Hz, damping ratio; motion of the tip in X Y Z, 1/sqrt(kg)")?;
    for ModeAnswer { hz, damping_ratio, tip: [x, y, z] } in &answer.modes {
        writeln!(out, "{hz:>12.3} {damping_ratio:>9.4}  {x:9.4} {y:9.4} {z:9.4}")?;
    }
    let row =
        |values: &[f64]| values.iter().map(|v| format!("{:>10.4}", v + 0.0)).collect::<String>();
    writeln!(out, "\ncompliance of the tip, um/N")?;
    for values in &answer.compliance_um_per_n {
        writeln!(out, "  {}", row(values))?;
    }
    writeln!(out, "\nforces by which the legs bear the weight, N\n  {}", row(&answer.bearing_n))?;
    let Some(motion) = &answer.motion else { return Ok(out.flush()?) };
    writeln!(out, "\nin {:.3} s: the tip from its command, um, along X Y Z", motion.seconds)?;
    for (name, values) in [
        ("mean", motion.mean_um),
        ("standard deviation", motion.rms_um),
        ("largest", motion.peak_um),
    ] {
        writeln!(out, "{name:>24}{}", row(&values))?;
    }
    report_ellipse(&mut out, &motion.ellipse)?;
    writeln!(out, "{:>24}{}", "largest forces, N", row(&motion.leg_peaks_n))?;
    if let Some(removed) = motion.removed_mm3 {
        writeln!(out, "{:>24}{removed:>10.1}", "removed, mm3")?;
    }
    if let Some(linear) = &motion.linear {
        writeln!(out, "\nby the linear theory")?;
        writeln!(out, "{:>24}{}", "standard deviation", row(&linear.rms_um))?;
        report_ellipse(&mut out, &linear.ellipse)?;
        writeln!(out, "{:>24}{}", "spindle axis, urad", row(&linear.axis_rms_urad))?;
        writeln!(out, "{:>24}{}", "legs, N", row(&linear.leg_rms_n))?;
        let percent = linear.spread.map(|spread| 50.0 * spread);
        writeln!(out, "A record of this length shows it to{} %.", row(&percent))?;
    }
    Ok(out.flush()?)
}

fn report_ellipse(out: &mut impl Write, ellipse: &EllipseAnswer) -> Result<(), Failure> {
    let EllipseAnswer { axes_um: [long, short], direction_deg } = ellipse;
    writeln!(
        out,
        "{:>24}{long:>10.4}{short:>10.4}, the long axis at {direction_deg:.2} degrees from X",
        "ellipse in X and Y"
    )?;
    Ok(())
}

/// Spectral densities of a motion, mm²/Hz.
pub struct Spectra {
    pub hz: Vec<f64>,
    pub found: Vec<Vector3<f64>>,
    /// Densities by the linear theory; empty if there is none.
    pub linear: Vec<Vector3<f64>>,
}

impl Spectra {
    /// Computes the densities at the frequencies below half of the sampling frequency.
    pub fn of(
        structure: &Structure,
        record: &Record,
        force: Option<&Random>,
        frequencies: &[f64],
    ) -> Self {
        let hz: Vec<f64> =
            frequencies.iter().copied().filter(|hz| *hz * record.step < 0.5).collect();
        let expected = |hz: &f64| {
            let force = force?;
            let found = structure.spectrum(&force.sigma_n.into(), &force.band.into(), *hz)?;
            Some(found.diagonal())
        };
        let linear = hz.iter().filter_map(expected).collect();
        Self { found: record.spectrum(&hz), hz, linear }
    }

    /// Returns the text of a CSV file.
    pub fn csv(&self) -> String {
        let named = |of: &str| ["x", "y", "z"].map(|axis| format!("{axis}{of}_um2_per_hz"));
        let mut header = vec!["hz".to_string()];
        header.extend(named(""));
        if !self.linear.is_empty() {
            header.extend(named("_linear"));
        }
        let rows = self.hz.iter().enumerate().map(|(n, hz)| {
            let densities = [self.found.get(n), self.linear.get(n)].into_iter().flatten();
            let densities = densities.flat_map(|density| density.iter().map(|part| part * UM * UM));
            std::iter::once(*hz).chain(densities).collect::<Vec<_>>()
        });
        csv(&header, rows)
    }
}

/// Elements of a symmetric receptance, in the order of their columns.
const ELEMENTS: [(usize, usize, &str); 6] =
    [(0, 0, "xx"), (1, 1, "yy"), (2, 2, "zz"), (0, 1, "xy"), (0, 2, "xz"), (1, 2, "yz")];

/// Returns the column names of [`response_row`].
pub fn response_header() -> Vec<String> {
    let parts = |name: &str| [format!("{name}_re"), format!("{name}_im")];
    let elements = ELEMENTS.iter().flat_map(|(_, _, name)| parts(name));
    std::iter::once("hz".to_string()).chain(elements).collect()
}

/// Returns a row of Hz and a receptance.
pub fn response_row((hz, h): &(f64, Matrix3<Complex<f64>>)) -> Vec<f64> {
    let element = |(i, k, _): &(usize, usize, &str)| [h[(*i, *k)].re, h[(*i, *k)].im];
    std::iter::once(*hz).chain(ELEMENTS.iter().flat_map(element)).collect()
}
