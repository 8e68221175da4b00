// SPDX-License-Identifier: GPL-2.0-or-later
//! The page about the cutting process of a program.

use crate::lines::Line;
use crate::margins::Figure;
use crate::page::{drawing, page, verdict};
use crate::plot::DrawError;
use crate::strips::{Strip, Strips, drawn_strips};
use crate::thin::{highest, lowest};
use maud::{Markup, html};
use studies::cut::report::{Drive, LineReport, Most, Report};

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
        let line = format!("line {}", most.line);
        row(name, meaning, &format!("{:.4} {unit}", most.value), &line)
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
                    &format!("{:.4} mm", stability.stable_to_mm), &format!("line {}", stability.line)))
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
                    td { "line " (drive.line) }
                }
            } }
        }
    }
}

fn worst(lines: &[LineReport]) -> Markup {
    let head = [
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

/// Returns the points of a plot over the lines of a program.
fn points(lines: &[LineReport], of: impl Fn(&LineReport) -> Option<f64>) -> Vec<(f64, f64)> {
    lines.iter().filter_map(|line| Some((f64::from(line.line), of(line)?))).collect()
}

fn figures(report: &Report) -> Result<Vec<Figure>, DrawError> {
    let lines = &report.lines;
    let end = lines.last().map_or(1.0, |line| f64::from(line.line));
    let figure =
        |title: &str, about: &str, y: &str, limits: &[f64], most: f64, lines: Vec<Line>| {
            let lines = lines.into_iter().filter(|line| !line.points.is_empty());
            let strip = |line| Strip { shown: [0.0, most], ..Strip::of(line, limits.to_vec()) };
            let strips: Vec<Strip> = lines.map(strip).collect();
            if strips.is_empty() {
                return Ok(None);
            }
            let x = "line of the program";
            let sheet = Strips { title: "", x, y, end, all_limits: true, marks: &[], dots: true };
            let svg = drawn_strips(&sheet, &strips)?;
            Ok::<_, DrawError>(Some(Figure { title: title.into(), about: about.into(), svg }))
        };
    let high = |name: &str, of: &dyn Fn(&LineReport) -> Option<f64>| Line {
        name: name.into(),
        points: highest(&points(lines, of)),
    };
    let shares = vec![
        high("drive", &|line| line.drive_share),
        high("depth of cut", &|line| line.margin.map(|margin| 1.0 / margin)),
    ];
    let yields = vec![
        high("deflection", &|line| line.deflection_um),
        high("inertia", &|line| line.inertia_um),
        high("vibration", &|line| line.vibration_um),
    ];
    let limits = points(lines, |line| line.stable_to_mm);
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
            yields,
        )?,
        figure(
            "Depth at which chatter starts",
            "At the programmed spindle speeds. Good: above the thick black line, the depth of cut.",
            "depth in mm",
            &[report.depth_mm],
            f64::INFINITY,
            vec![Line { name: "stable up to".into(), points: lowest(&limits) }],
        )?,
    ];
    Ok(all.into_iter().flatten().collect())
}
