// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm check`.

use super::failure::{Failure, refused, report_error};
use super::{Bar, MachineFile, Verdict, output, print_text};
use check::findings::{Report, TiltBox};
use check::fixes::{fixed, machine};
use check::suggestion::{axis_lines, face, limit, tilt_table};
use machine::files::write_over;
use machine::proof::axis_box::End;
use machine::read::diagnostic::rendered;
use machine::read::edit::difference;
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use new::panel::stale;
use program::machine_check::checked;
use serde_json::{Value, json};
use std::io::Write;

/// Check that the files of a machine fit together
///
/// Reads the INI file as LinuxCNC does, builds the machine as the module would, and reports what
/// it found: joints and mobility, geometry hash, unit and size, the order of the legs around the
/// base, leads and hands of the screws, the position of every tool tip, and the nearest limit at
/// home.
///
/// Checks HOME of joints and axes against the kinematics; the homing order, and homing from any
/// position, against the pose limits; the HAL files (present, in order, wiring the drives and the
/// module's guard); misspelled names; joint ranges; the distance between legs and the
/// conditioning, at home and at worst. Every finding says what to do.
///
/// Then prints [AXIS_*] limits within which every pose without a tool is proved to keep all
/// limits: reach, joint ranges, cones, pyramids, tilt, the distance between legs and the
/// conditioning. They never exceed the axis limits in the file. For a machine that tilts it also
/// reports whether the proof holds with every tool of the tool table, how far X, Y and Z reach with
/// a smaller tilt, also beyond the axis limits, what ends them, and wider limits.
///
/// Finally LinuxCNC starts the machine in virtual time with its own HAL files: it switches on,
/// homes, moves each coordinate a little and back, and changes a tool. If LinuxCNC refuses
/// anything, the machine does not fit together. Hardware, and programs that HAL files start, are
/// not run.
///
/// Two mechanisms are checked separately, each in its own letters. The distance between them is
/// computed at home and at sampled poses within the axis limits.
///
/// Exit status: 0 if all is well (there may be warnings), 1 if something does not fit, 2 if the
/// file describes no machine.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Print a unified diff with corrections: HOME of joints and axes with all digits, axis limits
    /// that are missing or mostly out of reach, the homing order, and boxes of another geometry,
    /// proved again
    #[arg(long)]
    fix: bool,
    /// Write the corrections of --fix into the file
    #[arg(long, requires = "fix")]
    write: bool,
    /// Skip the start in virtual time
    #[arg(long)]
    no_start: bool,
}

/// Lines of context around each change of a proposal, as in `diff -u`.
const AROUND: usize = 3;

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let machine = &arguments.machine;
    let config = MachineConfig::leniently(&Ini::read(&machine.machine)?, Some(Lenient::Report))?;
    let config = machine.named(config)?;
    if arguments.fix {
        return propose(arguments, &config);
    }
    let bar = Bar::spinner("reading the machine");
    let mut whole = checked::<Failure>(&config, !arguments.no_start, |what, share| match share {
        Some(share) => bar.set(share),
        None => bar.next(what.into()),
    })?;
    drop(bar);
    whole.mechanisms[0].findings.extend(stale(&config)?);
    for report in &whole.mechanisms {
        let heading = match (config.mechanisms.len(), report.config.place.is_second) {
            (1, _) => "",
            (_, true) => "\nThe second mechanism\n",
            (_, false) => "The first mechanism\n",
        };
        // A closed reader does not change the verdict.
        let written = write(report, heading);
        Failure::unless_unread(written.map_err(Failure::from))?;
    }
    if let Some(between) = &whole.between {
        let written = write_found(between, "\nBetween the two\n");
        Failure::unless_unread(written.map_err(Failure::from))?;
    }
    output::answer(&json!({
        "machine": config.file,
        "mechanisms": whole.mechanisms.iter().map(of_report).collect::<Vec<_>>(),
        "between": whole.between.as_ref().map(
            |found| json!({ "facts": named(&found.facts), "findings": found.findings }),
        ),
    }))?;
    Ok(Some(whole.fits()).into())
}

/// Returns the report on a mechanism for JSON.
fn of_report(report: &Report) -> Value {
    let ends = |ends: &[End]| -> Vec<Value> {
        let end = |end| json!({ "face": face(&report.config, end), "limit": limit(end) });
        ends.iter().map(end).collect()
    };
    let tilts = report.tilts.iter().map(|TiltBox { tilt, limits, ends: stops }| {
        json!({ "tilt": tilt, "limits": limits, "ends": ends(stops) })
    });
    json!({
        "facts": named(&report.facts),
        "findings": report.findings,
        "limits": report.suggestion,
        "limits_are_those_of_the_file": report.is_whole,
        "tilts": tilts.collect::<Vec<_>>(),
        "wider_limits": report.wider(),
    })
}

/// Adds facts without a name to the preceding fact.
fn named(facts: &[(String, String)]) -> Vec<Value> {
    facts.iter().map(|(name, value)| json!({ "name": name, "value": value })).collect()
}

/// Proposes the corrected file; the remaining errors then determine the verdict.
fn propose(arguments: &Arguments, config: &MachineConfig) -> Result<Verdict, Failure> {
    if arguments.machine.mechanism.is_some() {
        return Err(refused("--fix works on the whole file: remove --mechanism"));
    }
    let bar = Bar::spinner("homes");
    let fixed = fixed(config, |what| bar.say(what.into()))
        .map_err(|error| Failure::at(config.file.display(), error))?;
    let new = machine(&config.file, &fixed.text)?;
    bar.say("checking the corrections".into());
    let mut whole = checked::<Failure>(&new, false, |_, _| ())?;
    if arguments.write {
        whole.mechanisms[0].findings.extend(stale(&new)?);
    }
    let findings = whole.findings();
    drop(bar);
    for text in &fixed.left {
        report_error(&format!("{}: {text}", config.file.display()));
    }
    let old = config.ini.text();
    if fixed.text == old {
        report_error(&format!("{}: nothing to correct automatically", config.file.display()));
    } else if arguments.write {
        write_over(&config.file, &fixed.text)?;
    }
    let name = config.file.display().to_string();
    let difference = difference(old, &fixed.text, (&name, &name), AROUND);
    Failure::unless_unread(print_text(&difference))?;
    output::answer(&json!({
        "machine": config.file,
        "difference": difference,
        "is_written": arguments.write && fixed.text != old,
        "findings": findings,
    }))?;
    // What the user must correct.
    for finding in &findings {
        let _ = writeln!(anstream::stderr(), "\n{}", rendered(finding.severity, &finding.problem));
    }
    Ok(Some(fixed.left.is_empty() && whole.fits()).into())
}

/// Writes facts and findings below a heading.
fn write_found(report: &Report, heading: &str) -> std::io::Result<()> {
    let (mut facts, mut out) = (output::facts(), output::people());
    write!(facts, "{heading}")?;
    for (name, value) in &report.facts {
        writeln!(facts, "  {name:<14} {value}")?;
    }
    for finding in &report.findings {
        writeln!(out, "\n{}", rendered(finding.severity, &finding.problem))?;
    }
    out.flush()
}

fn write(report: &Report, heading: &str) -> std::io::Result<()> {
    let config = &report.config;
    write_found(report, &format!("{heading}{}\n", config.file.display()))?;
    let mut out = output::people();
    if output::is_quiet() {
        return Ok(());
    }
    if let Some(limits) = &report.suggestion {
        let limited = if report.is_whole { "its axis limits" } else { "these limits" };
        let text = "Proved: without a tool the machine reaches every pose within";
        let whose = match config.chain.is_empty() {
            true => "",
            false => ", in the coordinates of its legs, without base and carrying axes",
        };
        writeln!(out, "\n{text} {limited}{whose}:\n")?;
        write!(out, "{}", axis_lines(config, limits))?;
    }
    if !report.tilts.is_empty() {
        let unit = config.length_unit();
        writeln!(
            out,
            "\nProved boxes in {unit} around home, for A and B up to a tilt, without a tool, whatever the axis \
             limits of X Y Z are:\n"
        )?;
        write!(out, "{}", tilt_table(config, &report.tilts))?;
    }
    if let Some(wider) = report.wider() {
        let text = "With wider axis limits, programs that tilt less can use these boxes. The machine then does not reach \
                    every pose within the limits: run pkm preflight before each program.";
        writeln!(out, "\n{text}\n")?;
        write!(out, "{}", axis_lines(config, &wider))?;
    }
    writeln!(out, "\n{}", verdict(report))?;
    out.flush()
}

fn verdict(report: &Report) -> &'static str {
    match (report.fits(), report.findings.is_empty()) {
        (true, true) => "The machine fits together.",
        (true, false) => "The machine fits together; see the warnings.",
        (false, _) => "The machine does not fit together.",
    }
}
