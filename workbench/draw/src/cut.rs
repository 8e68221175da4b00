// SPDX-License-Identifier: GPL-2.0-or-later
//! The page about the cutting process of a program.

use crate::lines::Line;
use crate::margins::Figure;
use crate::page::{drawing, page, verdict};
use crate::plot::DrawError;
use crate::sheet::TIME;
use crate::strips::{Strip, Strips, drawn_strips};
use crate::thin::{highest, lowest};
use maud::{Markup, html};
use program::timeline::Abscissa;
use studies::cut::course::{Position, Stretch};
use studies::cut::report::{Drive, LineReport, Most, Report};
use studies::cut::words::place;

/// Largest share drawn: otherwise a single large one would hide all others.
const MOST_SHARE: f64 = 2.0;

/// Returns the page; `program` and `machine` are names.
///
/// # Errors
/// As [`DrawError`].
pub fn of_cut(report: &Report, [program, machine]: [&str; 2]) -> Result<String, DrawError> {
    let figures = figures(report)?;
    let body = html! {
        (verdict(report.fits, ["The machine can cut the program", "The machine cannot cut the program"], &report.why()))
        (peaks(report))
        (drives(&report.drives))
        (worst(&report.worst_lines))
        @if !report.warnings.is_empty() {
            h2 { "Warnings" }
            ul { @for warning in &report.warnings { li { (warning) } } }
        }
        h2 { "Not known" }
        ul { @for note in report.notes() { li { (note) } } }
        @for figure in &figures { (drawing(figure)) }
    };
    Ok(page(&format!("Cutting {program} on {machine}"), &body))
}

fn row(name: &str, meaning: &str, value: &str, place: &str) -> Markup {
    html! { tr {
        th scope="row" { (name) small { (meaning) } }
        td class="number" { (value) }
        td { (place) }
    } }
}

fn peaks(report: &Report) -> Markup {
    let peak = |name: &str, meaning: &str, unit: &str, most: &Option<Most>| {
        let Some(most) = most else { return html! {} };
        row(name, meaning, &format!("{:.4} {unit}", most.value), &place(most.line, most.at_s))
    };
    let stability = &report.stability;
    let seconds = report.seconds.map(|seconds| format!("{seconds:.3} s"));
    let cutting =
        report.cutting_seconds.map(|seconds| format!("{seconds:.3} s of it in feed moves"));
    let [seconds, cutting] = [seconds, cutting].map(Option::unwrap_or_default);
    let resolution = report.resolution_um.map(|error| error.map(|value| format!("{value:.3}")));
    html! {
        h2 { "The largest values" }
        table {
            thead { tr {
                th scope="col" { "what" }
                th scope="col" class="number" { "value" }
                th scope="col" { "where" }
            } }
            tbody {
                @if report.seconds.is_some() {
                    (row("time", "from start to end", &seconds, &cutting))
                }
                (peak("chip load", "feed of each tooth", "mm", &report.chip_mm))
                (peak("force on the tool", "the largest in a turn", "N", &report.force_n))
                (peak("deflection", "deflection by the mean force", "um", &report.deflection_um))
                (peak("inertia", "deflection by acceleration", "um", &report.inertia_um))
                (peak("vibration", "vibration under the teeth", "um", &report.vibration_um))
                (row("limit depth", "depth at which chatter starts",
                    &format!("{:.4} mm", stability.stable_to_mm), &place(stability.line, stability.at_s)))
                (row("stability margin", "limit depth over depth of cut",
                    &format!("{:.3}", stability.margin), &format!("depth of cut {} mm", report.depth_mm)))
                @if let Some(error) = resolution {
                    (row("resolution", "X, Y, Z error with every drive off by half a step",
                        &format!("{} um", error.join(", ")), ""))
                }
            }
        }
    }
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or(String::new(), |value| format!("{value:.digits$}"))
}

fn drives(drives: &[Drive]) -> Markup {
    let head = ["largest load", "allowed", "motor, Nm", "motor allows", "share"];
    html! {
        h2 { "The drives" }
        table {
            thead { tr {
                th scope="col" { "drive" }
                @for head in head { th scope="col" class="number" { (head) } }
                th scope="col" { "where" }
            } }
            tbody { @for drive in drives {
                tr class=[drive.share.is_some_and(|share| share > 1.0).then_some("broken")] {
                    th scope="row" { (drive.name) }
                    td class="number" { (format!("{:.1} {}", drive.load, drive.unit)) }
                    td class="number" { (number(drive.limit, 1)) }
                    td class="number" { (number(drive.motor_torque_n_m, 3)) }
                    td class="number" { (number(drive.motor_limit_n_m, 3)) }
                    td class="number" { (number(drive.share, 3)) }
                    td { (place(drive.line, drive.at_s)) }
                }
            } }
        }
    }
}

fn worst(lines: &[LineReport]) -> Markup {
    let head = [
        "at, s",
        "share",
        "chip, mm",
        "force, N",
        "share of a drive",
        "deflection, um",
        "inertia, um",
        "vibration, um",
        "margin",
    ];
    html! {
        h2 { "The worst lines" }
        table {
            thead { tr {
                th scope="col" { "line" }
                @for head in head { th scope="col" class="number" { (head) } }
            } }
            tbody { @for line in lines {
                tr class=[(line.share > 1.0).then_some("broken")] {
                    th scope="row" { (line.line) }
                    td class="number" { (number(line.at_s, 3)) }
                    td class="number" { (number(Some(line.share), 3)) }
                    td class="number" { (number(line.chip_mm, 4)) }
                    td class="number" { (number(line.force_n, 1)) }
                    td class="number" { (number(line.drive_share, 3)) " " (line.drive.as_deref().unwrap_or_default()) }
                    td class="number" { (number(line.deflection_um, 3)) }
                    td class="number" { (number(line.inertia_um, 3)) }
                    td class="number" { (number(line.vibration_um, 3)) }
                    td class="number" { (number(line.margin, 3)) }
                }
            } }
        }
    }
}

/// Returns the figures over time, or along the feed moves if the time is unknown.
fn figures(report: &Report) -> Result<Vec<Figure>, DrawError> {
    let course = &report.course;
    let (x, end) = match course.over {
        Abscissa::Seconds => (TIME, course.end),
        Abscissa::Length => ("length of the feed moves in machine units", course.end),
    };
    let figure =
        |title: &str, about: &str, y: &str, limits: &[f64], most: f64, lines: Vec<Line>| {
            let lines = lines.into_iter().filter(|line| !line.points.is_empty());
            let strip = |line| Strip { shown: [0.0, most], ..Strip::of(line, limits.to_vec()) };
            let strips: Vec<Strip> = lines.map(strip).collect();
            if strips.is_empty() {
                return Ok(None);
            }
            let sheet = Strips { title: "", x, y, end, all_limits: true, marks: &[], dots: true };
            let svg = drawn_strips(&sheet, &strips)?;
            Ok::<_, DrawError>(Some(Figure { title: title.into(), about: about.into(), svg }))
        };
    let moments = |name: &str, of: &dyn Fn(&Stretch) -> Option<f64>| {
        let points: Vec<(f64, f64)> = course
            .stretches
            .iter()
            .filter_map(|stretch| Some((stretch.at, of(stretch)?)))
            .collect();
        Line { name: name.into(), points: highest(&points) }
    };
    let positions = |of: &dyn Fn(&Position) -> Option<f64>| -> Vec<(f64, f64)> {
        let point = |position: &Position| Some((position.at, of(position)?));
        course.positions.iter().filter_map(point).collect()
    };
    let at_positions = |name: &str, of: &dyn Fn(&Position) -> Option<f64>| Line {
        name: name.into(),
        points: highest(&positions(of)),
    };
    let shares = vec![
        moments("drive", &|stretch| stretch.drive_share),
        at_positions("depth of cut", &|position| Some(report.depth_mm / position.stable_to_mm)),
    ];
    let inertia = report.seconds.map(|_| moments("inertia", &|stretch| Some(stretch.inertia_um)));
    let yields = [moments("deflection", &|stretch| Some(stretch.deflection_um))]
        .into_iter()
        .chain(inertia)
        .chain([at_positions("vibration", &|position| position.vibration_um)])
        .filter(|line| !line.points.is_empty());
    let all = [
        figure(
            "Load as a share of the rating",
            "Load of the most loaded drive divided by its rating, and depth of cut divided by the depth \
             at which chatter starts. Good: below the thick black line at 1. Values above 2 are drawn at \
             2.",
            "share of the limit",
            &[1.0],
            MOST_SHARE,
            shares,
        )?,
        figure(
            "Deflection of the tool",
            "By the mean cutting force, by acceleration, and by the individual teeth.",
            "deflection in µm",
            &[],
            f64::INFINITY,
            yields.collect(),
        )?,
        figure(
            "Depth at which chatter starts",
            "At the programmed spindle speeds. Good: above the thick black line, the depth of cut.",
            "depth in mm",
            &[report.depth_mm],
            f64::INFINITY,
            vec![Line {
                name: "stable up to".into(),
                points: lowest(&positions(&|position| Some(position.stable_to_mm))),
            }],
        )?,
    ];
    Ok(all.into_iter().flatten().collect())
}
