// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm cut`.

use super::failure::{Failure, refused};
use super::run::{Control, Progress};
use super::stability::program::Job;
use super::stability::{WORTH, depth};
use super::{Bar, Verdict, in_words, output};
use draw::cut::of_cut;
use kinematics::Pose;
use std::collections::BTreeMap;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::{self, PathBuf};
use workbench::control::process;
use workbench::control::row::Ending;
use workbench::cut::moment::{NoMoment, Subject};
use workbench::cut::pass::{Found, Pass};
use workbench::cut::place::half_steps;
use workbench::cut::program::{Line, lines, stops};
use workbench::cut::report::{Drive, LineReport, Looked, Most, Report, Run, Stability, report};
use workbench::cut::teeth::Teeth;
use workbench::dynamics::capacity::Capacity;
use workbench::dynamics::model::Model;
use workbench::files::{Locate, write_whole};
use workbench::program::motion::Move;
use workbench::read::machine::MachineConfig;
use workbench::stability::path::{Path, Stop};
use workbench::stability::pose::Setup;
use workbench::study::file::{Lacking, Study};

/// What a program asks of a machine while it cuts
///
/// Runs the program by LinuxCNC in virtual time and tells: time, feed per tooth, forces on the tool,
/// force and motor torque of every drive by virtual work (cutting force, weight and inertia) against what
/// the drives can do, how far the tool yields to the cutting force and to inertia, how far it swings under
/// the teeth, the depth at which the cut begins to chatter, and the worst lines.
///
/// Every feed move counts as a cut of the study's immersion and depth: where the tool is in the work is
/// not known. A plunge counts as a feed across the tool. Where LinuxCNC cannot run the program, time and
/// inertia are not judged.
///
///     [cutting]
///     depth_mm = 0.5               # and what `pkm stability pose` needs
///     [legs]
///     max_force_n = 2000           # what each drive can do; docs/cut.md has all keys
///
///     pkm cut hexapod.ini part.ngc --study cut.toml --report part.html
///
/// N, Nm, mm, um, 1/min, s.
///
/// Exit status: 0, 1 where a drive is asked for more than it can do, a cut is unstable or LinuxCNC stops
/// the program, 2 where that could not be judged: drives of which the study does not say what they can do,
/// more feed moves than --places, a program without a spindle speed, input or output that failed.
#[derive(clap::Args, Debug)]
#[command(verbatim_doc_comment)]
pub struct Arguments {
    #[command(flatten)]
    job: Job,
    /// The largest depth looked at, mm; without it twenty times the depth of cut
    #[arg(long, value_name = "MM", value_parser = depth)]
    deepest: Option<f64>,
    /// Writes a page with tables and plots
    #[arg(long, value_name = "FILE.html", value_hint = clap::ValueHint::FilePath)]
    report: Option<PathBuf>,
    #[command(flatten)]
    control: Control,
}

/// Without --deepest, depths up to this many times the depth of cut are looked at.
const DEEPEST: f64 = 20.0;

/// Lines of the program, by their numbers.
type Lines = BTreeMap<u32, Line>;

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.job.machine.read_unchained("the cut")?;
    let study = Study::read(&arguments.job.study)?;
    let (subject, depth) = subject(&config, &study).at(&arguments.job.study)?;
    let setup = Setup::new(&config, &study).at(&arguments.job.study)?;
    let moves = arguments.job.moves(&config)?;
    let lines = lines(&moves).at(&arguments.job.program)?;
    let (stops, feed_moves) =
        stops(&config, &moves, arguments.job.places as usize).at(&arguments.job.program)?;
    let deepest = arguments.deepest.unwrap_or(DEEPEST * depth);
    let at = |stop: usize| {
        let Stop { line, pose, .. } = &stops[stop];
        format!("{}: line {line}: {}", arguments.job.program.display(), in_words(pose))
    };
    let path = Path::new(&setup, &stops, deepest).map_err(|(k, e)| Failure::at(at(k), e))?;
    path.check(f64::INFINITY).map_err(|(k, error)| Failure::at(at(k), error))?;
    let (found, ran) = passed(arguments, &subject, &lines, &moves)?;
    let bar = Bar::new("limit depths");
    let depths = path.depths(|share| bar.set(share));
    drop(bar);
    let steps = half_steps(&config);
    let mut places = vec![];
    for (k, (stop, limit)) in stops.iter().zip(depths).enumerate() {
        let chip = match found.lines.get(&stop.line) {
            Some(line) => line.chip,
            // Made one move with its neighbours: at the most that was seen.
            None => found.peaks[0].as_ref().map_or(0.0, |peak| peak.value),
        };
        let place = subject.look(stop, chip, steps.as_deref());
        places.push((*stop, limit, place.map_err(|error| Failure::at(at(k), error))?));
    }
    let looked = Looked { places, feed_moves, deepest };
    let program = arguments.job.program.clone();
    let answer = report(&subject, program, depth, &lines, &found, &looked, &ran);
    write(arguments, &config, &answer)?;
    Ok(match answer.fits {
        Some(true) => Verdict::Fits,
        Some(false) => Verdict::Misfit,
        None => Verdict::Unjudged,
    })
}

/// What the study says of machine and cutter, and the depth of cut.
fn subject<'a>(config: &'a MachineConfig, study: &Study) -> Result<(Subject<'a>, f64), Lacking> {
    let lacks = |key| Lacking::Key { section: "cutting", key };
    let cutter = study.cutting.as_ref().ok_or_else(|| lacks("teeth"))?;
    let depth = cutter.depth_mm.ok_or_else(|| lacks("depth_mm"))?;
    let model = Model::of(config, study)?;
    let drives = Capacity::of(config, study)?;
    let teeth = Teeth::of(cutter, study.milling.as_ref(), depth);
    Ok((Subject { config, model, drives, teeth }, depth))
}

/// Runs the program and judges its moments; its moves alone where LinuxCNC cannot run it.
fn passed(
    arguments: &Arguments,
    subject: &Subject,
    lines: &Lines,
    moves: &[Move],
) -> Result<(Found, Run), Failure> {
    let program = &arguments.job.program;
    let failed = |(line, error): (u32, NoMoment)| {
        Failure::at(format!("{}: line {line}", program.display()), error)
    };
    let mut pass = Pass::new(subject, lines);
    let mut error = None;
    let mut progress = Progress::new(subject.config, program)?;
    let outcome = process::run(subject.config, program, &arguments.control.options(), |row| {
        progress.see(row);
        error = pass.see(row).err();
        if error.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    drop(progress);
    if let Some(error) = error {
        return Err(failed(error));
    }
    Ok(match outcome {
        Ok(outcome) => {
            let found = pass.finish().map_err(failed)?;
            let errors = outcome.messages.iter().filter(|message| message.is_error());
            let told: Vec<&str> = errors.map(|message| message.text.as_str()).collect();
            let run = match outcome.ending {
                Ending::Finished => Run::Finished(outcome.seconds),
                Ending::Stopped => Run::Stopped(outcome.seconds, told.join("; ")),
            };
            (found, run)
        }
        Err(why) => {
            let found = Pass::new(subject, lines).of_moves(moves).map_err(failed)?;
            (found, Run::NotJudged(why.to_string()))
        }
    })
}

fn write(arguments: &Arguments, config: &MachineConfig, answer: &Report) -> Result<(), Failure> {
    if let Some(file) = &arguments.report {
        let names = [name(&arguments.job.program)?, name(&config.file)?];
        write_whole(file, &of_cut(answer, names, &why(answer), &notes(answer))?)?;
    }
    output::answer(answer)?;
    let mut out = output::people();
    tell(&mut out, answer)?;
    out.flush()?;
    Ok(())
}

fn name(file: &path::Path) -> Result<&str, Failure> {
    let name = file.file_name().and_then(|name| name.to_str());
    name.ok_or_else(|| refused(format!("{}: expected a file name in UTF-8", file.display())))
}

/// The verdict in a sentence.
fn why(answer: &Report) -> String {
    let above = answer.drives.iter().find(|drive| drive.share.is_some_and(|share| share > 1.0));
    if let Some(Drive { name, load, unit, line, share, .. }) = above {
        let share = share.unwrap_or_default();
        return format!(
            "{name} has to do {load:.1} {unit} in line {line}, {share:.3} of what it can."
        );
    }
    let stability = &answer.stability;
    if !(stability.margin > 1.0) {
        let (limit, line) = (stability.stable_to_mm, stability.line);
        return format!(
            "In line {line} a cut chatters beyond {limit:.4} mm, and {} mm are cut.",
            answer.depth_mm
        );
    }
    match (&answer.stopped, &answer.not_judged) {
        (Some(why), _) => format!("LinuxCNC stops the program: {why}."),
        (_, Some(why)) => format!("Time and inertia are not judged: {why}."),
        _ if answer.fits.is_none() => {
            "Nothing that was looked at is beyond its limit; not everything was looked at.".into()
        }
        _ => "Every drive can do what is asked of it, and every place looked at is stable.".into(),
    }
}

/// What is not known.
fn notes(answer: &Report) -> Vec<String> {
    let mut notes = vec![
        "Where the tool is in the work: every feed move counts as a cut of the study's immersion and depth."
            .to_string(),
        WORTH.replace('\n', " "),
    ];
    let Stability { places, feed_moves, .. } = answer.stability;
    notes.push("Stability and vibration between the ends of a move.".into());
    if places < feed_moves {
        let rest = feed_moves - places;
        notes.push(format!(
            "Stability and vibration of {rest} feed moves: --places {feed_moves} looks at all."
        ));
    }
    if answer.drives.iter().any(|drive| drive.share.is_none()) {
        notes.push(
            "What some drives can do: the study names neither max_force_n, max_torque_n_m nor \
             motor_torque_n_m for them."
                .into(),
        );
    }
    if answer.resolution_um.is_none() {
        notes.push("The drives' steps: not every [JOINT_N] has a SCALE.".into());
    }
    if let Some(why) = &answer.not_judged {
        notes.push(format!("Time and inertia: {why}."));
    }
    notes
}

fn tell(out: &mut impl Write, answer: &Report) -> Result<(), Failure> {
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
        let Some(Most { value, line, .. }) = most else { continue };
        writeln!(out, "  {name:<12}  {value:.4} {unit}, line {line}")?;
    }
    if let Some([x, y, z]) = answer.resolution_um {
        writeln!(
            out,
            "  resolution    {x:.3} {y:.3} {z:.3} um in X Y Z, every drive off by half a step"
        )?;
    }
    tell_drives(out, &answer.drives)?;
    tell_stability(out, answer)?;
    tell_lines(out, answer)?;
    writeln!(out, "\n{}", why(answer))?;
    writeln!(out, "\nnot known:")?;
    for note in notes(answer) {
        writeln!(out, "  {note}")?;
    }
    Ok(())
}

fn shown(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".into(), |value| format!("{value:.digits$}"))
}

fn tell_drives(out: &mut impl Write, drives: &[Drive]) -> Result<(), Failure> {
    writeln!(out, "\ndrive: largest load, allowed; motor in Nm, allowed; share, line")?;
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
            drive.line
        )?;
    }
    Ok(())
}

fn tell_stability(out: &mut impl Write, answer: &Report) -> Result<(), Failure> {
    let stability = &answer.stability;
    let at_least = if stability.stable_to_mm < stability.deepest_mm { "" } else { "at least " };
    let word = if stability.margin > 1.0 { "stable" } else { "unstable" };
    writeln!(
        out,
        "\nstability: {} places on {} feed moves, depths up to {} mm",
        stability.places, stability.feed_moves, stability.deepest_mm
    )?;
    writeln!(
        out,
        "  least limit   {at_least}{:.4} mm at line {}, {} 1/min, {}",
        stability.stable_to_mm,
        stability.line,
        stability.rpm,
        in_words(&Pose::from_degrees(stability.pose))
    )?;
    let (depth, margin) = (answer.depth_mm, stability.margin);
    writeln!(out, "  depth of cut  {depth} mm: {word}, margin {at_least}{margin:.3}")?;
    Ok(())
}

fn tell_lines(out: &mut impl Write, answer: &Report) -> Result<(), Failure> {
    // Deeper than that nothing is looked at.
    let margin = |line: &LineReport| match line.stable_to_mm {
        Some(limit) if limit >= answer.stability.deepest_mm => {
            format!(">{}", shown(line.margin, 3))
        }
        _ => shown(line.margin, 3),
    };
    writeln!(
        out,
        "\nworst lines: share; chip mm; force N; drive, its share; deflection, inertia, vibration um; margin"
    )?;
    for line in &answer.worst_lines {
        writeln!(
            out,
            "  {:>6} {:>7.3} {:>8} {:>8} {:>12} {:>7} {:>8} {:>8} {:>8} {:>8}",
            line.line,
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
