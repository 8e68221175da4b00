// SPDX-License-Identifier: GPL-2.0-or-later
//! What the page of `pkm preflight --report` tells.

use kinematics::{Limit, Margin, Part};
use pkm::draw::over::Mark;
use pkm::draw::page::LimitRow;
use pkm::limits;
use pkm::program::course::{Abscissa, Thinned, Worst};
use pkm::program::findings::{Break, LeastMargin, Preflight, Rule, Time};
use pkm::read::machine::MachineConfig;

/// The breaks, with their places on the axis of the plots. `place` names a line of a file, `block`
/// says what is in it.
pub fn marks(
    config: &MachineConfig,
    found: &Preflight,
    course: &Thinned,
    place: impl Fn(&Break) -> String,
    block: impl Fn(&Break) -> String,
) -> Vec<Mark> {
    let mark = |told: &Break| Mark {
        place: place(told),
        block: block(told),
        text: format!("{}: {}", told.limit.name(), told.text),
        at: match course.abscissa {
            Abscissa::Seconds => told.seconds,
            Abscissa::Length => None,
        }
        .or_else(|| course.place(config, told.line, &told.pose)),
        pose: told.pose,
    };
    found.breaks.iter().map(mark).collect()
}

/// All limits that the program was judged by.
pub fn rows(config: &MachineConfig, found: &Preflight, course: &Thinned) -> Vec<LimitRow> {
    let mut rows: Vec<LimitRow> =
        Limit::ALL.into_iter().filter_map(|limit| row(config, found, course, limit)).collect();
    let broken = |rule: Rule| {
        let own = found.breaks.iter().zip(1..).filter(move |(told, _)| told.limit == rule);
        own.map(|(_, number)| number).collect::<Vec<usize>>()
    };
    rows.extend(course.error.map(|worst| {
        let breaks = broken(Rule::FollowingError);
        LimitRow { breaks, ..following_error(config, &worst) }
    }));
    let stops = broken(Rule::Control);
    if let Some(first) = stops.first() {
        let told = &found.breaks[first - 1];
        rows.push(LimitRow {
            name: Rule::Control.name().into(),
            meaning: "the control's own checks, which stop a program with a message".into(),
            part: String::new(),
            allowed: "no error".into(),
            used: "stopped".into(),
            margin: String::new(),
            line: format!("line {}", told.line),
            breaks: stops,
        });
    }
    rows
}

fn row(
    config: &MachineConfig,
    found: &Preflight,
    course: &Thinned,
    limit: Limit,
) -> Option<LimitRow> {
    let own = |(k, told): (usize, &Break)| (told.limit == limit).then_some(k + 1);
    let breaks: Vec<usize> = found.breaks.iter().enumerate().filter_map(own).collect();
    let first = breaks.first().map(|number| found.breaks[number - 1].line);
    let least = found.margins.iter().find(|margin| margin.limit == limit);
    if least.is_none() && breaks.is_empty() {
        return None;
    }
    let mut row = LimitRow {
        name: limit.name().into(),
        meaning: limits::meaning(limit).into(),
        part: String::new(),
        allowed: String::new(),
        used: String::new(),
        margin: String::new(),
        line: first.map_or(String::new(), |line| format!("line {line}")),
        breaks,
    };
    match least {
        Some(least) => fill(&mut row, config, course, least),
        // Reach has no size.
        None => row.used = "beyond it".into(),
    }
    Some(row)
}

fn fill(row: &mut LimitRow, config: &MachineConfig, course: &Thinned, least: &LeastMargin) {
    let LeastMargin { limit, value, unit, part, line, of } = least;
    row.part = part.clone();
    row.margin = format!("{value:.3} {unit}").trim_end().into();
    let worst = match line {
        0 => "before the program".into(),
        line => format!("line {line}"),
    };
    row.line = match row.line.as_str() {
        first if first.is_empty() || first == worst => worst,
        first => format!("{first}, worst in {worst}"),
    };
    let Rule::Limit(limit) = *limit else { return };
    let Some(range) = limits::range(config, limit, *of) else { return };
    let margin = Margin { limit, part: *of, value: f64::NAN, range };
    row.allowed = limits::allowed(config, &margin);
    let used = match (range, of) {
        (_, Part::Axis(letter)) => ends(course.range(|s| s.poses[letter.index()])),
        (_, Part::Joint(i)) if limit == Limit::JointRange => ends(course.range(|s| s.joints[*i])),
        ([_, high], _) if high.is_finite() => format!("{:.3}", high - value),
        ([low, _], _) => format!("{:.3}", low + value),
    };
    row.used = format!("{used} {unit}").trim_end().into();
}

fn ends([low, high]: [f64; 2]) -> String {
    format!("{low:.3} to {high:.3}")
}

fn following_error(config: &MachineConfig, worst: &Worst) -> LimitRow {
    let joint = &config.joints[worst.joint];
    let unit = config.unit(joint.kind);
    LimitRow {
        name: "following error".into(),
        meaning: "how far a drive may lag behind its command".into(),
        part: joint.name.clone(),
        allowed: format!("at most {:.3} {unit}", worst.limit),
        used: format!("{:.3} {unit}", worst.value),
        margin: format!("{:.3} {unit}", worst.limit - worst.value),
        line: format!("line {}", worst.line),
        breaks: vec![],
    }
}

/// Why the program fits or does not, in a sentence for everybody.
pub fn why(found: &Preflight, rows: &[LimitRow]) -> String {
    let Some(first) = found.breaks.first() else {
        if let Time::NotJudged(cause) = &found.time {
            return format!(
                "The path stays within the limits of the machine. How fast its joints would have to move \
                 is not known, because LinuxCNC could not run the program: {cause}."
            );
        }
        return "Every move stays within all limits of the machine, from its start to its end."
            .into();
    };
    let broken = rows.iter().filter(|row| !row.breaks.is_empty()).count();
    let rest = match broken {
        1 => "All other limits are kept.".into(),
        more => format!("{more} limits are broken in all."),
    };
    format!(
        "The machine cannot run this program as it is. In line {} it would leave its limits for the \
         first time: {}. {rest}",
        first.line, first.text
    )
}
