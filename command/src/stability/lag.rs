// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm stability lag`.

use super::super::Verdict;
use super::super::failure::Failure;
use super::super::output;
use draw::plot::Plot;
use draw::stability::{Cutting, of_overhangs, of_partitions, of_responses};
use machine::files::{Locate, check_writable, csv, write_whole};
use nalgebra::{Complex, ComplexField};
use serde::Serialize;
use serde_json::json;
use std::f64::consts::TAU;
use std::io::Write;
use std::path::{Path, PathBuf};
use studies::stability::WORTH;
use studies::stability::count::Counter;
use studies::stability::lag::Crossing;
use studies::stability::response::{Margins, Response, unwrapped};
use studies::stability::system::Adjustment;
use studies::study::cutting::{Chip, Link};
use studies::study::file::Study;
use studies::study::measured::Measured;

/// Number of overhangs of the curve.
const OVERHANGS: usize = 200;

/// Limit depth of a spring-mass model with a lagging force (paper 002)
///
/// The tool moves against the work as the sum of spring-mass systems, of the modes of a
/// spindle, and of measured frequency responses; the cutting force K/(1 + T p) follows the displacement with a lag T. Reports the
/// limit cutting stiffness: all K at which a pair of roots crosses the imaginary axis, the
/// smallest positive one, and whether counts of unstable roots (by eigenvalues) confirm it; the
/// lag with the lowest limit; limit width and depth of cut; and at a given cutting stiffness the
/// margins: gain, phase and distance, oscillation index (largest amplitude over static
/// amplitude), bandwidth and settling time. --plots draws the D-partitions of the planes of K, of
/// T and K, and of the first link's stiffness and K, hatched on the side with fewer unstable
/// roots and with their number in every region; responses; hodographs of the response, of each
/// link and of the open loop; and the limit by overhang.
///
/// A measured frequency response replaces links or adds to them: [[measured]] with name and file,
/// a CSV file with the columns hz,re_um_per_n,im_um_per_n.
///
///     [lag]
///     time_constant_ms = 0.28
///     [[links]]                    # one or more
///     name = "spindle"
///     mass_kg = 2.27
///     damping_n_s_per_mm = 0.44
///     stiffness_n_per_um = 38.9
///     [[links.joints]]             # optional: a joint in series with the spring, such as an arbor's
///     compliance_um_per_n = 0.002  # or angular_rad_per_n_m and arm_mm
///     [chip]                       # for width and depth: K = factor * ratio * strength * width
///     factor = 1.4
///     ratio = 2.2
///     strength_n_per_mm2 = 750
///     angle_deg = 60
///     [overhang]                   # compliance of the first link: a0 + a1 l + a2 l^2, and
///     compliance_um_per_n = [0.0146, 1.064e-4, 3.7e-7]
///     cantilever_um_per_n = 1.27e-4    # times (l/at)^3
///     cantilever_at_mm = 70
///
/// Exit status: 0, 1 if cutting at --stiffness is unstable, 2 if the limit is not confirmed, or if
/// input or output failed.
#[derive(clap::Args, Debug)]
#[command(verbatim_doc_comment)]
pub struct Arguments {
    /// Read links or a spindle, and the lag, from this TOML file
    #[arg(long, value_name = "STUDY.toml", value_hint = clap::ValueHint::FilePath)]
    study: PathBuf,
    /// Overhangs to compare, mm [default: the study as it is]
    #[arg(long, value_name = "MM", num_args = 1.., value_parser = super::positive)]
    overhang: Vec<f64>,
    /// Cutting stiffness for margins and responses, N/mm [default: half the limit]
    #[arg(long, value_name = "N_PER_MM", value_parser = super::positive)]
    stiffness: Option<f64>,
    /// Draw SVG files into this folder (created if needed)
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath)]
    plots: Option<PathBuf>,
    /// Write the responses as CSV
    #[arg(long, value_name = "FILE.csv", value_hint = clap::ValueHint::FilePath)]
    csv: Option<PathBuf>,
}

/// Results of one adjustment.
#[derive(Serialize)]
struct Answer {
    overhang_mm: Option<f64>,
    /// Null if every cutting stiffness is stable.
    limit: Option<Shown>,
    is_confirmed_by_counts: bool,
    /// The measured range, beyond which nothing is examined; null without measured responses.
    examined_hz: Option<[f64; 2]>,
    crossings: Vec<Shown>,
    /// Null for a measured response, which has no value at rest.
    real_root_passes_0_at_n_per_mm: Option<f64>,
    worst_lag: Option<Worst>,
    chip: Option<Cut>,
    at: At,
    /// Whether the limit is confirmed, and the measured range decides that a stable cutting stiffness is stable.
    #[serde(skip)]
    is_judged: bool,
}

/// A crossing.
#[derive(Serialize)]
struct Shown {
    stiffness_n_per_mm: f64,
    omega_rad_per_s: f64,
    hz: f64,
    unstable_below_and_above: [usize; 2],
}

/// The lag at which the limit is least.
#[derive(Serialize)]
struct Worst {
    time_constant_ms: f64,
    limit_n_per_mm: f64,
}

/// Width and depth of cut at the limit.
#[derive(Serialize)]
struct Cut {
    limit_width_mm: f64,
    limit_depth_mm: f64,
}

/// Margins at a cutting stiffness.
#[derive(Serialize)]
struct At {
    stiffness_n_per_mm: f64,
    unstable: usize,
    gain_margin: Option<f64>,
    phase_margin_deg: Option<f64>,
    distance_from_minus_1: f64,
    oscillation_index: Option<f64>,
    peak_rad_per_s: f64,
    bandwidth_rad_per_s: Option<f64>,
    settling_s: Option<f64>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let study = Study::read(&arguments.study)?;
    let mut overhangs: Vec<Option<f64>> = arguments.overhang.iter().copied().map(Some).collect();
    if overhangs.is_empty() {
        overhangs.push(None);
    }
    let own = overhangs.into_iter().map(|overhang| Adjustment::of(&study, overhang));
    let own: Vec<Adjustment> = own.collect::<Result<_, _>>().at(&arguments.study)?;
    let of_links = study.links.iter().filter_map(Link::doubt);
    let doubts: Vec<String> =
        of_links.chain(study.measured.iter().filter_map(Measured::doubt)).collect();
    let answers: Vec<Answer> =
        own.iter().map(|adjustment| answer(adjustment, &study, arguments.stiffness)).collect();
    write(arguments, &study, &own, &answers)?;
    output::answer(
        &json!({ "study": arguments.study, "adjustments": answers, "warnings": doubts }),
    )?;
    let mut out = output::people();
    writeln!(out, "{}", arguments.study.display())?;
    for (adjustment, answer) in own.iter().zip(&answers) {
        report(&mut out, &adjustment.name(), answer)?;
    }
    doubts.iter().try_for_each(|doubt| writeln!(out, "warning: {doubt}"))?;
    writeln!(out, "{WORTH}")?;
    out.flush()?;
    Ok(verdict(&answers))
}

/// Returns whether cutting is stable at every adjustment; one that is not judged leaves the question open.
fn verdict(answers: &[Answer]) -> Verdict {
    if answers.iter().any(|answer| answer.is_judged && answer.at.unstable > 0) {
        Verdict::Misfit
    } else if answers.iter().all(|answer| answer.is_judged) {
        Verdict::Fits
    } else {
        Verdict::Unjudged
    }
}

fn answer(adjustment: &Adjustment, study: &Study, stiffness: Option<f64>) -> Answer {
    let lag = &adjustment.lag;
    let counter = lag.counter();
    let limit = counter.limit();
    // Half the limit; without a limit, the stiffness of the whole.
    let half = || limit.crossing.map_or(lag.at_rest().abs(), |found| found.stiffness / 2.0);
    let at = stiffness.unwrap_or_else(half);
    let margins = margins(&counter, lag.margins(at, limit.crossing), at);
    let chip = limit.crossing.zip(study.chip).map(|(found, chip): (Crossing, Chip)| Cut {
        limit_width_mm: chip.width(found.stiffness),
        limit_depth_mm: chip.depth(found.stiffness),
    });
    Answer {
        overhang_mm: adjustment.overhang,
        limit: limit.crossing.map(|found| shown(&counter, &found)),
        is_confirmed_by_counts: limit.is_certified,
        examined_hz: (!lag.measured.is_empty()).then(|| lag.range().map(|omega| omega / TAU)),
        crossings: counter.crossings().iter().map(|found| shown(&counter, found)).collect(),
        real_root_passes_0_at_n_per_mm: lag.measured.is_empty().then(|| lag.at_rest()),
        worst_lag: lag.worst_lag().map(|(time, found)| Worst {
            time_constant_ms: 1e3 * time,
            limit_n_per_mm: found.stiffness,
        }),
        chip,
        is_judged: limit.is_certified && (margins.unstable > 0 || lag.is_closed(at)),
        at: margins,
    }
}

fn shown(counter: &Counter, found: &Crossing) -> Shown {
    Shown {
        stiffness_n_per_mm: found.stiffness,
        omega_rad_per_s: found.omega,
        hz: found.omega / TAU,
        unstable_below_and_above: counter.beside(found),
    }
}

fn margins(counter: &Counter, found: Margins, stiffness: f64) -> At {
    At {
        stiffness_n_per_mm: stiffness,
        unstable: counter.unstable(Complex::new(stiffness, 0.0)),
        gain_margin: found.gain.is_finite().then_some(found.gain),
        phase_margin_deg: found.phase.map(f64::to_degrees),
        distance_from_minus_1: found.distance,
        oscillation_index: found.index,
        peak_rad_per_s: found.peak,
        bandwidth_rad_per_s: found.bandwidth,
        settling_s: found.settling(),
    }
}

/// Number of crossings in the table for people: noise in a measured response adds hundreds.
const MOST_ROWS: usize = 20;

fn report(out: &mut impl Write, name: &str, answer: &Answer) -> Result<(), Failure> {
    writeln!(out, "{name}")?;
    let mut row = |name: &str, text: String| writeln!(out, "  {name:<24} {text}");
    match &answer.limit {
        Some(limit) => row(
            "limit cutting stiffness",
            format!(
                "{:.3} N/mm at {:.4} rad/s, {:.4} Hz",
                limit.stiffness_n_per_mm, limit.omega_rad_per_s, limit.hz
            ),
        )?,
        None if answer.examined_hz.is_some() => {
            row("limit cutting stiffness", "none at the measured frequencies".into())?;
        }
        None => row("limit cutting stiffness", "none: every cutting stiffness is stable".into())?,
    }
    let counts = match (answer.is_confirmed_by_counts, answer.examined_hz) {
        (true, Some([low, high])) => format!(
            "confirmed by counts of unstable roots from {low:.1} to {high:.1} Hz; resonances beyond are not covered"
        ),
        (true, None) => "confirmed by counts of unstable roots".into(),
        (false, Some(_)) => {
            "NOT confirmed: measure a wider range of frequencies, at which the open loop stays away from -1".into()
        }
        (false, None) => "NOT confirmed: counts of unstable roots disagree".into(),
    };
    row("", counts)?;
    let mut nearest: Vec<&Shown> = answer.crossings.iter().collect();
    nearest.sort_by(|a, b| a.stiffness_n_per_mm.abs().total_cmp(&b.stiffness_n_per_mm.abs()));
    let rest = nearest.split_off(nearest.len().min(MOST_ROWS)).len();
    nearest.sort_by(|a, b| a.stiffness_n_per_mm.total_cmp(&b.stiffness_n_per_mm));
    for found in nearest {
        let [below, above] = found.unstable_below_and_above;
        row(
            "crossing",
            format!(
                "{:.3} N/mm at {:.4} rad/s: {below} unstable roots below, {above} above",
                found.stiffness_n_per_mm, found.omega_rad_per_s
            ),
        )?;
    }
    if rest > 0 {
        row("", format!("{rest} more crossings at larger stiffnesses; --format json lists them"))?;
    }
    if let Some(stiffness) = answer.real_root_passes_0_at_n_per_mm {
        row("real root passes 0 at", format!("{stiffness:.3} N/mm"))?;
    }
    if let Some(worst) = &answer.worst_lag {
        let [time, limit] = [worst.time_constant_ms, worst.limit_n_per_mm];
        row("worst lag", format!("{time:.4} ms, where the limit is {limit:.3} N/mm"))?;
    }
    if let Some(cut) = &answer.chip {
        let [width, depth] = [cut.limit_width_mm, cut.limit_depth_mm];
        row("limit width, depth", format!("{width:.4} mm, {depth:.4} mm"))?;
    }
    let at = &answer.at;
    row("at cutting stiffness", format!("{:.3} N/mm", at.stiffness_n_per_mm))?;
    let roots = if answer.is_judged { at.unstable.to_string() } else { "not judged".into() };
    row("  unstable roots", roots)?;
    let or_none = |value: Option<String>| value.unwrap_or("none".into());
    row("  gain margin", or_none(at.gain_margin.map(|value| format!("{value:.4}"))))?;
    let phase = at.phase_margin_deg.map(|value| format!("{value:.2} degrees"));
    row("  phase margin", or_none(phase))?;
    row("  distance from -1", format!("{:.4}", at.distance_from_minus_1))?;
    let peak = at.peak_rad_per_s;
    let unknown = || "unknown: the measured range is too narrow".to_string();
    let index = at.oscillation_index.map(|index| format!("{index:.4}, peak at {peak:.3} rad/s"));
    row("  oscillation index", index.unwrap_or_else(unknown))?;
    let bandwidth = at.bandwidth_rad_per_s.map(|bandwidth| format!("{bandwidth:.3} rad/s"));
    row("  bandwidth", bandwidth.unwrap_or_else(unknown))?;
    let settling = match at.settling_s {
        Some(time) => format!("{time:.4} s"),
        None if answer.is_judged && at.unstable > 0 => "never".into(),
        None => "unknown from a measured response".into(),
    };
    row("  settling time", settling)?;
    Ok(())
}

/// Returns the prefix of the pictures' names, different for each of several adjustments.
fn stem(adjustment: &Adjustment) -> String {
    adjustment.overhang.map_or("lag".into(), |length| format!("overhang-{length}"))
}

fn write(
    arguments: &Arguments,
    study: &Study,
    own: &[Adjustment],
    answers: &[Answer],
) -> Result<(), Failure> {
    if arguments.plots.is_none() && arguments.csv.is_none() {
        return Ok(());
    }
    arguments.csv.as_deref().map_or(Ok(()), check_writable)?;
    let cut = |(adjustment, answer): (&Adjustment, &Answer)| {
        let stiffness = answer.at.stiffness_n_per_mm;
        Cutting {
            name: adjustment.name(),
            stiffness,
            responses: adjustment.lag.responses(stiffness),
        }
    };
    let responses: Vec<Cutting> = own.iter().zip(answers).map(cut).collect();
    if let Some(folder) = &arguments.plots {
        let mut plots = vec![];
        for adjustment in own {
            plots.extend(of_partitions(adjustment, &stem(adjustment))?);
        }
        plots.extend(of_responses(&responses, &own[0].names)?);
        let limits = by_overhang(study, own);
        if limits.len() > 1 {
            plots.push(of_overhangs(&limits)?);
        }
        Plot::write_all(&plots, folder)?;
    }
    arguments.csv.as_deref().map_or(Ok(()), |file| write_csv(file, own, &responses))
}

/// Returns the limits over a range around the compared overhangs.
fn by_overhang(study: &Study, own: &[Adjustment]) -> Vec<(f64, f64)> {
    let lengths: Vec<f64> = own.iter().filter_map(|adjustment| adjustment.overhang).collect();
    let most = 1.25 * lengths.iter().copied().fold(0.0, f64::max);
    let limit = |k: usize| {
        let length = most * k as f64 / OVERHANGS as f64;
        let found = Adjustment::of(study, Some(length)).ok()?.lag.limit().crossing?;
        Some((length, found.stiffness))
    };
    // The shortest overhangs would make the others invisible.
    (OVERHANGS / 40..=OVERHANGS).filter_map(limit).filter(|_| most > 0.0).collect()
}

fn write_csv(file: &Path, own: &[Adjustment], responses: &[Cutting]) -> Result<(), Failure> {
    let mut header: Vec<String> = ["adjustment", "omega_rad_per_s"].map(String::from).into();
    let mut named = |name: &str| {
        let parts = ["re_mm_per_n", "im_mm_per_n", "abs_mm_per_n", "phase_deg"];
        header.extend(parts.map(|part| format!("{name}_{part}")));
    };
    named("cutting");
    named("free");
    own[0].names.iter().for_each(|name| named(name));
    let mut rows = vec![];
    for Cutting { name, responses: all, .. } in responses {
        let count = own[0].names.len();
        let column = |of: &dyn Fn(&Response) -> Complex<f64>| -> Vec<[f64; 4]> {
            let values: Vec<Complex<f64>> = all.iter().map(of).collect();
            let phases = unwrapped(values.iter().map(|value| value.argument()));
            let cells = values.iter().zip(phases);
            cells.map(|(v, phase)| [v.re, v.im, v.modulus(), phase.to_degrees()]).collect()
        };
        let mut columns = vec![column(&|r| r.cutting), column(&|r| r.free)];
        columns.extend((0..count).map(|k| column(&|r: &Response| r.terms[k])));
        for (i, response) in all.iter().enumerate() {
            let mut cells = vec![name.clone(), response.omega.to_string()];
            let numbers = columns.iter().flat_map(|column| column[i]);
            cells.extend(numbers.map(|number| number.to_string()));
            rows.push(cells);
        }
    }
    Ok(write_whole(file, &csv(&header, rows))?)
}
