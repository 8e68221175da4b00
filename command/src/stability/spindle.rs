// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm stability spindle`.

use super::super::Verdict;
use super::super::failure::{Failure, refused};
use super::super::output;
use machine::files::Locate;
use serde::Serialize;
use serde_json::json;
use std::f64::consts::TAU;
use std::io::Write;
use std::path::PathBuf;
use studies::stability::spindle::{Nose, ShaftMode};
use studies::study::file::Study;

/// Compute the compliance of a shaft on two bearings at its nose
///
/// Reports static compliance, natural frequencies, damping ratios and logarithmic decrements at
/// the end of the last cylinder: the nose of the spindle, or the tip of a tool. The shaft is
/// slender (no shear); the housing counts as rigid.
///
///     [spindle]
///     youngs_n_per_mm2 = 210000
///     density_kg_per_m3 = 7850
///     damping_ratio = 0.01         # of the shaft itself
///     modes = 3                    # how many to use
///     [[spindle.sections]]         # cylinders, starting at the rear end
///     length_mm = 312
///     diameter_mm = 60
///     bore_mm = 20                 # solid without it
///     [[spindle.sections]]         # the last one: the overhang
///     length_mm = 32
///     diameter_mm = 60
///     [[spindle.bearings]]         # two
///     at_mm = 0                    # from the rear end
///     compliance_um_per_n = 0.005  # 0: rigid
///     angular_rad_per_n_m = 1e-5   # free to turn without it
///     damping_n_s_per_mm = 0.5
///     [[spindle.bearings]]
///     at_mm = 280
///     compliance_um_per_n = 0.005
///     [[spindle.joints]]           # optional: where an arbor or tool begins
///     at_mm = 312
///     compliance_um_per_n = 0.001
///     angular_rad_per_n_m = 2e-7
///
/// Exit status: 0, or 2 if input or output failed.
#[derive(clap::Args, Debug)]
#[command(verbatim_doc_comment)]
pub struct Arguments {
    /// Read the spindle from this TOML file
    #[arg(long, value_name = "STUDY.toml", value_hint = clap::ValueHint::FilePath)]
    study: PathBuf,
    /// Lengths of the last cylinder to compare, mm
    #[arg(long, value_name = "MM", num_args = 1.., value_parser = super::positive)]
    overhang: Vec<f64>,
}

/// A spindle with one overhang.
#[derive(Serialize)]
struct Answer {
    overhang_mm: f64,
    compliance_um_per_n: f64,
    /// Share of the compliance due to the modes in use.
    share_of_modes: f64,
    /// Share of the compliance due to the joints.
    share_of_joints: f64,
    modes: Vec<Shown>,
}

#[derive(Serialize)]
struct Shown {
    hz: f64,
    damping_ratio: f64,
    decrement: f64,
    compliance_um_per_n: f64,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let study = Study::read(&arguments.study)?;
    let spindle = study.spindle.as_ref();
    let missing = || {
        refused(format!(
            "{}: the study has no [spindle]; see pkm help stability spindle for an example",
            arguments.study.display()
        ))
    };
    let spindle = spindle.ok_or_else(missing)?;
    let own = spindle.sections.last().map_or(0.0, |last| last.length_mm.0);
    let lengths =
        if arguments.overhang.is_empty() { vec![own] } else { arguments.overhang.clone() };
    let mut answers = vec![];
    for length in lengths {
        let own = spindle.with_overhang(length);
        let nose = own.nose().at(&arguments.study)?;
        let rigid = own.without_joints().nose().at(&arguments.study)?;
        answers.push(shown(length, &nose, 1.0 - rigid.compliance / nose.compliance));
    }
    output::answer(&json!({ "study": arguments.study, "adjustments": answers }))?;
    let mut out = output::people();
    answers.iter().try_for_each(|answer| report(&mut out, answer))?;
    out.flush()?;
    Ok(Verdict::Fits)
}

fn shown(overhang_mm: f64, nose: &Nose, share_of_joints: f64) -> Answer {
    let mode = |mode: &ShaftMode| Shown {
        hz: mode.omega / TAU,
        damping_ratio: mode.zeta,
        decrement: mode.decrement(),
        compliance_um_per_n: 1e3 * (mode.nose / mode.omega).powi(2),
    };
    Answer {
        overhang_mm,
        compliance_um_per_n: 1e3 * nose.compliance,
        share_of_modes: nose.share(),
        share_of_joints,
        modes: nose.modes.iter().map(mode).collect(),
    }
}

fn report(out: &mut impl Write, answer: &Answer) -> Result<(), Failure> {
    writeln!(out, "overhang {} mm", answer.overhang_mm)?;
    let share = 100.0 * answer.share_of_modes;
    let compliance = answer.compliance_um_per_n;
    writeln!(
        out,
        "  static compliance  {compliance:.6} um/N at the nose; {share:.2} % of it in the modes used"
    )?;
    if answer.share_of_joints > 0.0 {
        let share = 100.0 * answer.share_of_joints;
        writeln!(out, "  joints             {share:.2} % of the static compliance")?;
    }
    writeln!(out, "  {:>12} {:>14} {:>12} {:>16}", "Hz", "damping ratio", "decrement", "um/N")?;
    for mode in &answer.modes {
        writeln!(
            out,
            "  {:>12.3} {:>14.5} {:>12.5} {:>16.6}",
            mode.hz, mode.damping_ratio, mode.decrement, mode.compliance_um_per_n
        )?;
    }
    Ok(())
}
