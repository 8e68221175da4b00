// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm cut`.

use super::failure::{Failure, refused};
use super::run::{Control, Progress};
use super::stability::depth;
use super::stability::program::Job;
use super::{Verdict, in_words, output};
use draw::cut::of_cut;
use kinematics::Pose;
use machine::files::{Locate, write_whole};
use machine::read::mechanism::Mechanism;
use std::io::Write;
use std::path::{Path, PathBuf};
use studies::cut::judge::Cut;
use studies::cut::report::{Drive, LineReport, Most, Report};
use studies::cut::stance;
use studies::cut::words::place;
use studies::study::file::Study;

/// Compute forces, deflection and vibration while a program cuts
///
/// Runs the program with LinuxCNC in virtual time and reports: time; feed per tooth; forces on
/// the tool; force and motor torque of every drive (from cutting force, weight and inertia)
/// against its ratings; deflection of the tool by cutting force and inertia, and its vibration
/// under the teeth; the depth at which chatter starts; and the worst lines.
///
/// Every feed move counts as a cut with the study's immersion and depth, because the position of
/// the stock is not known. With [stock] and the diameter in [milling], a rapid through the material
/// that the feed moves have left there is reported with its line. Results have the time, because a loop runs a line several times; the
/// plots of --report are over time. A plunge counts as a feed across the tool. If LinuxCNC cannot run the
/// program, time and inertia are not judged.
///
///     [cutting]
///     depth_mm = 0.5               # and the keys of `pkm stability pose`; [turning] for a lathe tool
///     [legs]
///     max_force_n = 2000           # rating of each drive; `pkm help studies/cut` lists all keys
///
/// N, Nm, mm, um, 1/min, s.
///
/// Exit status: 0, 1 if a drive is overloaded, a cut is unstable or LinuxCNC stops the program, 2
/// if that could not be judged: drives without ratings in the study, more feed moves than
/// --places, a program without a spindle speed, input or output that failed.
#[derive(clap::Args, Debug)]
#[command(verbatim_doc_comment)]
pub struct Arguments {
    #[command(flatten)]
    job: Job,
    /// Largest depth to examine, mm [default: 20 times the depth of cut]
    #[arg(long, value_name = "MM", value_parser = depth)]
    deepest: Option<f64>,
    /// Write a page with tables and plots
    #[arg(long, value_name = "FILE.html", value_hint = clap::ValueHint::FilePath)]
    report: Option<PathBuf>,
    #[command(flatten)]
    control: Control,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let Arguments { job, deepest, control, .. } = arguments;
    let config = job.machine.read_constrained()?;
    stance::check(&config)?;
    let study = Study::read(&job.study)?;
    let cut = Cut::new(&config, &study).at(&job.study)?;
    let moves = job.moves(&config)?;
    if let (Some(rpm), Some(step)) = (job.rpm, moves.iter().find(|step| step.is_per_turn)) {
        return Err(refused(format!(
            "--rpm {rpm}: {}: line {}: the feed is one per turn, so another speed also changes the motion; change the \
             S word instead, under G97",
            job.program.display(),
            step.line
        )));
    }
    let mut progress = Progress::new(&config, &job.program)?;
    let (options, places) = (control.options(), job.places as usize);
    let answer =
        cut.judge(&job.program, &moves, &options, places, *deepest, |step| progress.show(step))?;
    drop(progress);
    write(arguments, &config, &answer)?;
    Ok(answer.fits.into())
}

fn write(arguments: &Arguments, config: &Mechanism, answer: &Report) -> Result<(), Failure> {
    if let Some(file) = &arguments.report {
        let names = [name(&arguments.job.program)?, name(&config.file)?];
        write_whole(file, &of_cut(answer, names)?)?;
    }
    output::answer(answer)?;
    let mut out = output::people();
    report(&mut out, answer)?;
    out.flush()?;
    Ok(())
}

fn name(file: &Path) -> Result<&str, Failure> {
    let name = file.file_name().and_then(|name| name.to_str());
    name.ok_or_else(|| refused(format!("{}: expected a file name in UTF-8", file.display())))
}

fn report(out: &mut impl Write, answer: &Report) -> Result<(), Failure> {
    writeln!(out, "{} on {}", answer.program.display(), answer.machine.display())?;
    if let (Some(seconds), Some(cutting)) = (answer.seconds, answer.cutting_seconds) {
        writeln!(out, "  time          {seconds:.3} s, {cutting:.3} s of it in feed moves")?;
    }
    let peaks = [
        ("chip load", "mm", &answer.chip_mm),
        ("tool force", "N", &answer.force_n),
        ("deflection", "um by the mean cutting force", &answer.deflection_um),
        ("inertia", "um by speeding up and braking", &answer.inertia_um),
        ("vibration", "um under the teeth", &answer.vibration_um),
    ];
    for (name, unit, most) in peaks {
        let Some(Most { value, line, at_s, .. }) = most else { continue };
        writeln!(out, "  {name:<12}  {value:.4} {unit}, {}", place(*line, *at_s))?;
    }
    if let Some([x, y, z]) = answer.resolution_um {
        writeln!(
            out,
            "  resolution    {x:.3} {y:.3} {z:.3} um in X Y Z, every drive off by half a step"
        )?;
    }
    report_drives(out, &answer.drives)?;
    report_stability(out, answer)?;
    report_lines(out, answer)?;
    writeln!(out, "\n{}", answer.why())?;
    for warning in &answer.warnings {
        writeln!(out, "warning: {warning}")?;
    }
    writeln!(out, "\nnot known:")?;
    for note in answer.notes() {
        writeln!(out, "  {note}")?;
    }
    Ok(())
}

fn shown(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".into(), |value| format!("{value:.digits$}"))
}

fn report_drives(out: &mut impl Write, drives: &[Drive]) -> Result<(), Failure> {
    writeln!(out, "\ndrive: largest load, allowed; motor in Nm, allowed; share; line and time")?;
    for drive in drives {
        writeln!(
            out,
            "  {:<12} {:>10.1} {:<2} {:>8} {:>8} {:>8} {:>7}  {}",
            drive.name,
            drive.load,
            drive.unit,
            shown(drive.limit, 1),
            shown(drive.motor_torque_n_m, 3),
            shown(drive.motor_limit_n_m, 3),
            shown(drive.share, 3),
            place(drive.line, drive.at_s)
        )?;
    }
    Ok(())
}

fn report_stability(out: &mut impl Write, answer: &Report) -> Result<(), Failure> {
    let stability = &answer.stability;
    let at_least = if stability.stable_to_mm < stability.deepest_mm { "" } else { "at least " };
    let word = if stability.margin > 1.0 { "stable" } else { "unstable" };
    writeln!(
        out,
        "\nstability: {} positions on {} feed moves, depths up to {} mm",
        stability.places, stability.feed_moves, stability.deepest_mm
    )?;
    writeln!(
        out,
        "  least limit   {at_least}{:.4} mm in {}, {} 1/min, {}",
        stability.stable_to_mm,
        place(stability.line, stability.at_s),
        stability.rpm,
        in_words(&Pose::from_degrees(stability.pose))
    )?;
    let (depth, margin) = (answer.depth_mm, stability.margin);
    writeln!(out, "  depth of cut  {depth} mm: {word}, margin {at_least}{margin:.3}")?;
    Ok(())
}

fn report_lines(out: &mut impl Write, answer: &Report) -> Result<(), Failure> {
    // Larger depths are not tested.
    let margin = |line: &LineReport| match line.stable_to_mm {
        Some(limit) if limit >= answer.stability.deepest_mm => {
            format!(">{}", shown(line.margin, 3))
        }
        _ => shown(line.margin, 3),
    };
    writeln!(
        out,
        "\nworst lines: at s; share; chip mm; force N; drive, its share; deflection, inertia, vibration um; margin"
    )?;
    for line in &answer.worst_lines {
        writeln!(
            out,
            "  {:>6} {:>9} {:>7.3} {:>8} {:>8} {:>12} {:>7} {:>8} {:>8} {:>8} {:>8}",
            line.line,
            shown(line.at_s, 3),
            line.share,
            shown(line.chip_mm, 4),
            shown(line.force_n, 1),
            line.drive.as_deref().unwrap_or("-"),
            shown(line.drive_share, 3),
            shown(line.deflection_um, 3),
            shown(line.inertia_um, 3),
            shown(line.vibration_um, 3),
            margin(line)
        )?;
    }
    Ok(())
}
