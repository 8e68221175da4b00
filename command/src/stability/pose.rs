// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm stability pose`.

use super::super::failure::{Failure, refused};
use super::super::poses::At;
use super::super::{Bar, MachineFile, Verdict, in_words, output};
use super::{Speeds, setup};
use draw::plot::Plot;
use draw::stability::{of_lobes, of_stable_map, of_tip};
use kinematics::Vector3;
use machine::files::{check_writable, csv, write_whole};
use nalgebra::ComplexField;
use serde::Serialize;
use std::f64::consts::TAU;
use std::io::Write;
use std::path::PathBuf;
use studies::stability::WORTH;
use studies::stability::bands::{Band, Loss, bands};
use studies::stability::floquet::{Period, fast_enough};
use studies::stability::lobes::{Limit, Lobes};
use studies::stability::map::StableMap;
use studies::stability::pose::Setup;
use studies::stability::process::{Row, receptance, turned};
use studies::stability::semi;
use studies::study::file::Study;

/// Compute the limit depth at a pose, by spindle speed
///
/// Combines the modes of the machine at a pose, and of a spindle if the study has one, with the
/// cutting forces of a milling cutter (`[cutting]`) or a lathe tool (`[turning]`). Reports the
/// modes, the lowest limit by the zero-order approximation over all speeds, and by collocation of
/// the delay equation the depths that are unstable: an unstable island can have stable depths
/// above it, which zero order cannot show. The map over speeds is refined where it changes. --rpm
/// adds single speeds, compared with zero order and with semi-discretization.
///
/// Masses, springs and dampers of the machine are those of `pkm dynamics`.
///
///     [cutting]
///     teeth = 2
///     entry_deg = 90               # half immersion, down milling; a slot: 0 to 180
///     exit_deg = 180
///     kt_n_per_mm2 = 700           # tangential, radial and axial force per mm2 of chip
///     kr_n_per_mm2 = 210
///     ka_n_per_mm2 = 0
///     [turning]                    # instead of [cutting]
///     kf_n_per_mm2 = 1000
///     thicker = [0, -1, 0]         # direction of the tool that thickens the chip, machine axes
///     force = [0, 1, 0]            # direction of the cutting force on the tool
///
/// mm, degrees, 1/min; machine axes.
///
/// Exit status: 0, 1 if --depth is unstable at a speed of --rpm, 2 if input or output failed.
#[derive(clap::Args, Debug)]
#[command(verbatim_doc_comment)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Read masses, springs, dampers and cutting coefficients from this TOML file
    #[arg(long, value_name = "STUDY.toml", value_hint = clap::ValueHint::FilePath)]
    study: PathBuf,
    #[command(flatten)]
    at: At,
    /// Feed direction, machine axes [default: the one with the lowest limit]
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true)]
    feed: Vec<f64>,
    #[command(flatten)]
    speeds: Speeds,
    /// Single spindle speeds, 1/min
    #[arg(long, value_name = "RPM", num_args = 1.., value_parser = super::positive)]
    rpm: Vec<f64>,
    /// Depth to judge at the speeds of --rpm, mm
    #[arg(long, value_name = "MM", value_parser = super::depth, requires = "rpm")]
    depth: Option<f64>,
    /// Initial number of spindle speeds of the map
    #[arg(long, value_name = "N", default_value_t = 61, value_parser = clap::value_parser!(u16).range(2..=5001))]
    columns: u16,
    /// Draw SVG files into this folder (created if needed)
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath)]
    plots: Option<PathBuf>,
    /// Write the map as CSV: speed, zero-order limit, borders of unstable depths
    #[arg(long, value_name = "FILE.csv", value_hint = clap::ValueHint::FilePath)]
    csv: Option<PathBuf>,
}

#[derive(Serialize)]
struct Answer {
    machine: PathBuf,
    pose: [f64; 6],
    modes: Vec<Mode>,
    /// Angle of the feed in the cutter plane from the platform's X, if none was given.
    worst_feed_deg: Option<f64>,
    /// Zero-order limit over all speeds; null if every depth is stable.
    floor: Option<Shown>,
    deepest_mm: f64,
    best: Speed,
    worst: Speed,
    /// Ranges of sampled speeds without an unstable depth up to the deepest.
    without_unstable_rpm: Vec<[f64; 2]>,
    at: Vec<Single>,
    map: Vec<Column>,
}

#[derive(Serialize)]
struct Mode {
    hz: f64,
    damping_ratio: f64,
    tip_per_root_kg: [f64; 3],
}

#[derive(Serialize)]
struct Shown {
    depth_mm: f64,
    hz: f64,
}

#[derive(Serialize)]
struct Speed {
    rpm: f64,
    stable_to_mm: f64,
}

#[derive(Serialize)]
struct Single {
    rpm: f64,
    zero_order_mm: Option<f64>,
    unstable: Vec<Unstable>,
    /// Result at the first border by collocation: 1 if both methods agree.
    semi_discretisation: Option<f64>,
    multiplier_at_depth: Option<f64>,
}

#[derive(Serialize)]
struct Unstable {
    from_mm: f64,
    /// Null if it extends beyond the deepest.
    to_mm: Option<f64>,
    loss: &'static str,
}

#[derive(Serialize)]
struct Column {
    rpm: f64,
    zero_order_mm: Option<f64>,
    unstable: Vec<Unstable>,
}

/// Least number of steps of semi-discretization in a tooth period, and in a period of the fastest mode.
const STEPS: [f64; 2] = [60.0, 20.0];

/// Default depth of the map, relative to the zero-order limit over all speeds.
const DEEPEST: f64 = 8.0;

/// Default depth of the map if every depth is stable by zero order, mm.
const DEEP: f64 = 20.0;

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read()?;
    let study = Study::read(&arguments.study)?;
    let setup = setup(&config, &study, &arguments.study)?;
    let (pose, tool) = arguments.at.read(&config)?;
    let at = |error| Failure::at(in_words(&pose), error);
    let given = match arguments.feed[..] {
        [x, y, z] => Some(Vector3::new(x, y, z)),
        _ => None,
    };
    let feed = given.unwrap_or(pose.rotation().column(0).into_owned());
    let modes = setup.modes(&pose, &tool).map_err(at)?;
    let mut rows = setup.rows(&pose, &tool, &feed).map_err(at)?;
    let worst = given.is_none().then(|| setup.worst_feed(&rows));
    rows = turned(&rows, worst.unwrap_or_default());
    let range = arguments.speeds.range()?;
    let slowest = arguments.rpm.iter().copied().fold(range[0], f64::min);
    fast_enough(&rows, &setup.process, slowest)?;
    let lobes = Lobes::new(&rows, &setup.process, slowest);
    let floor = lobes.floor();
    let deepest = arguments.speeds.deepest.unwrap_or(floor.map_or(DEEP, |f| DEEPEST * f.depth));
    let bar = Bar::new("stable depths");
    let first = usize::from(arguments.columns);
    let map = StableMap::new(&rows, &setup.process, range, deepest, first, |share| bar.set(share));
    bar.next("limits by zero order and at single speeds".into());
    let zero_order = |rpm: f64| lobes.limit(rpm).map(|limit| limit.depth);
    arguments.csv.as_deref().map_or(Ok(()), check_writable)?;
    if let Some(folder) = &arguments.plots {
        Plot::write_all(&plots(&setup, &rows, &map, &lobes, range)?, folder)?;
    }
    if let Some(file) = &arguments.csv {
        write_whole(file, &table(&map, zero_order))?;
    }
    let answer = Answer {
        machine: config.file.clone(),
        pose: pose.to_degrees(),
        modes: modes
            .iter()
            .map(|mode| Mode {
                hz: mode.omega / TAU,
                damping_ratio: mode.zeta,
                // 1/√t is 1/√(1000 kg).
                tip_per_root_kg: (mode.tip / 1000.0_f64.sqrt()).into(),
            })
            .collect(),
        worst_feed_deg: worst.map(f64::to_degrees),
        floor: floor.map(|Limit { depth, omega }| Shown { depth_mm: depth, hz: omega / TAU }),
        deepest_mm: deepest,
        best: speed(&map, map.best()),
        worst: speed(&map, map.worst()),
        without_unstable_rpm: map.without_unstable(),
        at: arguments
            .rpm
            .iter()
            .map(|rpm| single(&setup, &rows, *rpm, deepest, arguments.depth, zero_order(*rpm)))
            .collect(),
        map: map
            .columns
            .iter()
            .map(|column| Column {
                rpm: column.rpm,
                zero_order_mm: zero_order(column.rpm),
                unstable: unstable(&column.bands, deepest),
            })
            .collect(),
    };
    drop(bar);
    output::answer(&answer)?;
    let mut out = output::people();
    writeln!(out, "{} at {}", config.file.display(), in_words(&pose))?;
    report(&mut out, &answer)?;
    out.flush()?;
    let is_stable = |single: &Single| single.multiplier_at_depth.is_none_or(|m| m < 1.0);
    Ok(if answer.at.iter().all(is_stable) { Verdict::Fits } else { Verdict::Misfit })
}

fn speed(map: &StableMap, column: &studies::stability::map::Column) -> Speed {
    Speed { rpm: column.rpm, stable_to_mm: column.stable_to(map.most) }
}

fn unstable(bands: &[Band], deepest: f64) -> Vec<Unstable> {
    let shown = |band: &Band| Unstable {
        from_mm: band.low,
        to_mm: (band.high < deepest).then_some(band.high),
        loss: name(band.loss),
    };
    bands.iter().map(shown).collect()
}

fn name(loss: Loss) -> &'static str {
    match loss {
        Loss::Hopf => "chatter",
        Loss::Doubling => "two tooth periods",
        Loss::Fold => "deflection",
    }
}

fn single(
    setup: &Setup,
    rows: &[Row],
    rpm: f64,
    deepest: f64,
    depth: Option<f64>,
    zero_order_mm: Option<f64>,
) -> Single {
    let period = Period::new(rows, &setup.process, rpm);
    let found = bands(&period, deepest);
    let fastest = rows.iter().map(|row| row.omega).fold(0.0, f64::max);
    let periods = fastest * setup.process.delay(rpm) / TAU;
    let steps = STEPS[0].max(STEPS[1] * periods) as usize;
    let check = |band: &Band| semi::multiplier(rows, &setup.process, rpm, band.low, steps);
    Single {
        rpm,
        zero_order_mm,
        semi_discretisation: found.first().and_then(check),
        unstable: unstable(&found, deepest),
        multiplier_at_depth: depth.map(|depth| period.multiplier(depth).modulus()),
    }
}

fn plots(
    setup: &Setup,
    rows: &[Row],
    map: &StableMap,
    lobes: &Lobes,
    [low, high]: [f64; 2],
) -> Result<Vec<Plot>, Failure> {
    let speeds = (0..=LINE).map(|k| low + (high - low) * k as f64 / LINE as f64);
    let depth = |rpm: f64| lobes.limit(rpm).map_or(f64::INFINITY, |limit| limit.depth);
    let line: Vec<(f64, f64)> = speeds.map(|rpm| (rpm, depth(rpm))).collect();
    let highest = 1.5 * rows.iter().map(|row| row.omega).fold(0.0, f64::max);
    let amplitude = |k: usize| -> Vec<(f64, f64)> {
        let omegas = (0..=LINE).map(|i| highest * i as f64 / LINE as f64);
        omegas.map(|omega| (omega, receptance(rows, omega)[(k, k)].modulus())).collect()
    };
    let lobes = lobes.curves(LOBES);
    let mut plots = vec![of_stable_map(map, &line)?, of_lobes(&lobes, &line, map.most)?];
    if setup.is_milling() {
        plots.push(of_tip([amplitude(0), amplitude(1)])?);
    }
    Ok(plots)
}

/// Number of lobes in the plot.
const LOBES: usize = 12;

/// Number of points of a line.
const LINE: usize = 1000;

fn table(map: &StableMap, zero_order: impl Fn(f64) -> Option<f64>) -> String {
    let header = ["rpm", "zero_order_mm", "unstable_from_mm", "unstable_to_mm", "loss"];
    let mut rows: Vec<[String; 5]> = vec![];
    for column in &map.columns {
        let depth = zero_order(column.rpm).map_or(String::new(), |depth| depth.to_string());
        let start = [column.rpm.to_string(), depth];
        if column.bands.is_empty() {
            let [rpm, depth] = start.clone();
            rows.push([rpm, depth, String::new(), String::new(), String::new()]);
        }
        for band in &column.bands {
            let [rpm, depth] = start.clone();
            let ends = [band.low, band.high].map(|depth| depth.to_string());
            let [from, to] = ends;
            rows.push([rpm, depth, from, to, name(band.loss).into()]);
        }
    }
    csv(&header, rows)
}

fn report(out: &mut impl Write, answer: &Answer) -> Result<(), Failure> {
    writeln!(out, "  {:>12} {:>14}   tip in the mode, 1/sqrt(kg)", "mode, Hz", "damping ratio")?;
    for mode in &answer.modes {
        let [x, y, z] = mode.tip_per_root_kg;
        let [hz, ratio] = [mode.hz, mode.damping_ratio];
        writeln!(out, "  {hz:>12.4} {ratio:>14.5}   {x:9.5} {y:9.5} {z:9.5}")?;
    }
    if let Some(angle) = answer.worst_feed_deg {
        writeln!(
            out,
            "  feed: {angle:.0} degrees from the platform's X, the direction with the lowest limit"
        )?;
    }
    match &answer.floor {
        Some(floor) => writeln!(
            out,
            "  zero order: every depth below {:.4} mm is stable at all speeds, as far as it sees \
             ({:.2} Hz)",
            floor.depth_mm, floor.hz
        )?,
        None => writeln!(out, "  zero order: every depth is stable at all speeds")?,
    }
    let deepest = answer.deepest_mm;
    writeln!(out, "  by collocation, depths up to {deepest:.3} mm:")?;
    for (name, speed) in [("best", &answer.best), ("worst", &answer.worst)] {
        let [rpm, depth] = [speed.rpm, speed.stable_to_mm];
        let at_least = if depth < deepest { "" } else { "at least " };
        writeln!(out, "    {name:<6} {rpm:10.1} 1/min: stable to {at_least}{depth:.4} mm")?;
    }
    let ranges: Vec<String> = answer
        .without_unstable_rpm
        .iter()
        .map(|[low, high]| format!("{low:.1} to {high:.1}"))
        .collect();
    if !ranges.is_empty() {
        writeln!(
            out,
            "    every depth up to {deepest:.3} mm is stable at the sampled speeds {} 1/min",
            ranges.join(", ")
        )?;
    }
    for single in &answer.at {
        let zero = single.zero_order_mm;
        let zero = zero.map_or("every depth is stable".into(), |depth| format!("{depth:.4} mm"));
        writeln!(out, "  {} 1/min: zero order {zero}", single.rpm)?;
        for band in &single.unstable {
            let to = band.to_mm.map_or("beyond".into(), |depth| format!("to {depth:.4} mm"));
            writeln!(out, "    unstable from {:.4} mm {to} ({})", band.from_mm, band.loss)?;
        }
        if single.unstable.is_empty() {
            writeln!(out, "    every depth up to {deepest:.3} mm is stable")?;
        }
        match single.semi_discretisation {
            _ if single.unstable.is_empty() => {}
            Some(check) => {
                writeln!(out, "    largest multiplier there by semi-discretization: {check:.4}")?
            }
            None => writeln!(
                out,
                "    not judged by semi-discretization: its eigenvalues were not found"
            )?,
        }
        if let Some(multiplier) = single.multiplier_at_depth {
            writeln!(out, "    at --depth the largest multiplier is {multiplier:.5}")?;
        }
    }
    writeln!(out, "{WORTH}")?;
    Ok(())
}

/// Refuses an unused range of speeds as a mistake on the command line.
impl Speeds {
    pub(super) fn range(&self) -> Result<[f64; 2], Failure> {
        let [low, high] = [self.speeds[0], self.speeds[1]];
        match low < high {
            true => Ok([low, high]),
            false => Err(refused(format!("--speeds {low} {high}: expected the lower speed first"))),
        }
    }
}
