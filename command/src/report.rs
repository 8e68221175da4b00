// SPDX-License-Identifier: GPL-2.0-or-later
//! The page of `pkm preflight --report`.

use super::failure::Failure;
use draw::margins::figures;
use draw::over::Mark;
use draw::page::{LimitRow, Report, of_program};
use kinematics::{Limit, Margin};
use machine::limits;
use program::report::{Break, LeastMargin, Range, Rule, Time};
use program::timeline::{Abscissa, Thinned};
use program::verdict::ProgramVerdict;

/// Largest number of warnings above the plots of the page; its copy of the JSON value has all.
const MOST_NOTES: usize = 20;

/// Returns the page, with plots along `course`.
pub fn page(verdict: &ProgramVerdict, course: &Thinned) -> Result<String, Failure> {
    let (marks, rows) = (marks(verdict, course), rows(verdict));
    let help = verdict.offset.as_ref().map(|found| {
        let words = format!(
            "The program fits with another work offset: {}. Clamp the workpiece there, and once before \
             the program run:",
            found.checked()
        );
        (words, found.block.clone())
    });
    let notes = verdict.warnings.iter().map(|caution| verdict.caution(caution));
    Ok(of_program(&Report {
        program: &verdict.program,
        machine: &verdict.machine,
        fits: verdict.fits,
        why: why(verdict, &rows),
        notes: notes.take(MOST_NOTES).collect(),
        help,
        rows,
        marks: &marks,
        figures: &figures(verdict.config.first(), course, &marks)?,
        text: &verdict.text(),
    }))
}

/// Returns the violations, with their positions on the axis of the plots.
fn marks(verdict: &ProgramVerdict, course: &Thinned) -> Vec<Mark> {
    let mark = |broken: &Break| Mark {
        place: verdict.place(broken.file, broken.line),
        block: verdict.block(broken).unwrap_or_default().into(),
        text: format!("{}: {}", broken.limit.name(), broken.text),
        at: match course.abscissa {
            Abscissa::Seconds => broken.seconds,
            Abscissa::Length => None,
        }
        .or_else(|| course.place(verdict.config.first(), broken.line, &broken.pose)),
        pose: broken.pose,
    };
    verdict.found.breaks.iter().map(mark).collect()
}

/// Returns all limits that the program was judged by.
fn rows(verdict: &ProgramVerdict) -> Vec<LimitRow> {
    let limits = Limit::ALL.into_iter().filter_map(|limit| row(verdict, limit));
    limits.chain(following_error(verdict)).chain(control(verdict)).collect()
}

/// Range of the values of a program that LinuxCNC stopped.
const TO_THE_STOP: &str = "up to the stop";

/// Returns the row of a limit without values.
fn bare(verdict: &ProgramVerdict, limit: Rule, meaning: &str) -> LimitRow {
    let found = &verdict.found;
    let own = |(number, broken): (usize, &Break)| (broken.limit == limit).then_some(number);
    let breaks: Vec<usize> = (1..).zip(&found.breaks).filter_map(own).collect();
    let first = breaks.first().map(|number| &found.breaks[number - 1]);
    LimitRow {
        name: limit.name().into(),
        meaning: meaning.into(),
        part: String::new(),
        allowed: String::new(),
        used: String::new(),
        margin: String::new(),
        line: first.map_or(String::new(), |broken| verdict.place(broken.file, broken.line)),
        breaks,
        is_judged: if limit.is_of_time() { found.time.is_whole() } else { found.is_whole },
    }
}

fn row(verdict: &ProgramVerdict, limit: Limit) -> Option<LimitRow> {
    let mut row = bare(verdict, limit.into(), limits::meaning(limit));
    match verdict.found.margins.iter().find(|margin| margin.limit == limit) {
        Some(least) => fill(&mut row, verdict, least),
        // Reach has no value.
        None if !row.breaks.is_empty() => row.used = "beyond it".into(),
        // A limit of the machine for a motion that was not simulated.
        None if limits::is_of_feed(limit) && !row.is_judged => {}
        None => return None,
    }
    Some(row)
}

fn fill(row: &mut LimitRow, verdict: &ProgramVerdict, least: &LeastMargin) {
    let ProgramVerdict { config, found, .. } = verdict;
    let LeastMargin { limit, value, unit, part, line, file, of } = least;
    row.part = part.clone();
    row.margin = format!("{value:.3} {unit}").trim_end().into();
    let worst = match line {
        0 => "before the program".into(),
        _ => verdict.place(*file, *line),
    };
    row.line = match row.line.as_str() {
        first if first.is_empty() || first == worst => worst,
        first => format!("{first}, worst in {worst}"),
    };
    let Rule::Limit(limit) = *limit else { return };
    let Some(range) = limits::range(config.first(), limit, *of) else { return };
    let margin = Margin { limit, part: *of, value: f64::NAN, range };
    row.allowed = limits::allowed(config.first(), &margin);
    let whole = found.ranges.iter().find(|range| range.part == *part);
    let used = match (range, whole.filter(|_| limit == Limit::Axis || limit == Limit::JointRange)) {
        (_, Some(Range { used: [low, high], .. })) => format!("{low:.3} to {high:.3}"),
        ([_, high], None) if high.is_finite() => format!("{:.3}", high - value),
        ([low, _], None) => format!("{:.3}", low + value),
    };
    row.used = format!("{used} {unit}").trim_end().into();
    say_how_far(row);
}

fn say_how_far(row: &mut LimitRow) {
    if !row.is_judged {
        row.used = format!("{} {TO_THE_STOP}", row.used);
    }
}

/// Returns the row of the drive nearest to LinuxCNC's following error limit.
fn following_error(verdict: &ProgramVerdict) -> Option<LimitRow> {
    let Time::Judged(timing) = &verdict.found.time else { return None };
    let lagging = timing.following_errors.iter().enumerate();
    let lagging = lagging.filter(|(_, peak)| peak.limit.is_finite());
    let (joint, worst) = lagging.max_by(|a, b| a.1.share().total_cmp(&b.1.share()))?;
    let unit = verdict.config.first().unit_of(joint);
    let meaning = "lag of a drive behind its command";
    let mut row = LimitRow {
        part: worst.joint.clone(),
        allowed: format!("at most {:.3} {unit}", worst.limit),
        used: format!("{:.3} {unit}", worst.value),
        margin: format!("{:.3} {unit}", worst.limit - worst.value),
        line: verdict.place(worst.place.file, worst.place.line),
        ..bare(verdict, Rule::FollowingError, meaning)
    };
    say_how_far(&mut row);
    Some(row)
}

/// Returns the reason why LinuxCNC stops, if it does.
fn control(verdict: &ProgramVerdict) -> Option<LimitRow> {
    let meaning = "LinuxCNC's own checks, which stop a program with a message";
    let row = bare(verdict, Rule::Control, meaning);
    let said = || LimitRow { allowed: "no error".into(), used: "stopped".into(), ..row.clone() };
    (!row.breaks.is_empty()).then(said)
}

/// Returns a sentence why the program fits or does not, for any reader.
fn why(verdict: &ProgramVerdict, rows: &[LimitRow]) -> String {
    let found = &verdict.found;
    let Some(first) = found.breaks.first() else {
        if let Time::NotJudged(cause) = &found.time {
            let part = if found.is_whole { "" } else { "judged part of the " };
            return format!(
                "The {part}path stays within the limits of the machine. The required joint speeds are \
                 unknown, because LinuxCNC could not run the program: {cause}."
            );
        }
        return "Every move stays within all limits of the machine, from its start to its end."
            .into();
    };
    let broken = rows.iter().filter(|row| !row.breaks.is_empty()).count();
    let rest = match broken {
        1 if rows.iter().all(|row| row.is_judged) => "All other limits are kept.".into(),
        1 if found.is_whole => {
            "The other limits of the path are kept; time-dependent limits are not judged to the end."
                .into()
        }
        1 => "The other limits are kept up to the stop; the rest is not judged.".into(),
        more => format!("{more} limits are violated in total."),
    };
    format!(
        "The machine cannot run this program as it is: in {}, {}. {rest}",
        verdict.place(first.file, first.line),
        first.text
    )
}
