// SPDX-License-Identifier: GPL-2.0-or-later
//! The report of a run as a folder: one page and its plots.

use crate::trace::{Report, RunResult};
use draw::motion;
use draw::page::page;
use draw::plot::Plot;
use draw::sample::Sample;
use machine::files::write_whole;
use machine::read::mechanism::Mechanism;
use maud::{Markup, html};
use std::error::Error;
use std::path::Path;

/// Writes plots and report.html into `folder`, which is created if needed.
///
/// Every file appears complete or not at all.
///
/// # Errors
/// A file cannot be written, or a plot cannot be drawn.
pub fn write(
    folder: &Path,
    config: &Mechanism,
    samples: &[Sample],
    result: &RunResult,
    report: &Report,
) -> Result<(), Box<dyn Error>> {
    let plots = motion::all(config, samples)?;
    Plot::write_all(&plots, folder)?;
    let title = format!("{}: {}", result.config, result.program);
    Ok(write_whole(&folder.join("report.html"), &page(&title, &body(report, &plots)))?)
}

fn body(report: &Report, plots: &[Plot]) -> Markup {
    html! {
        table {
            tr { th { "figure" } th { "found" } th { "allowed" } th {} }
            @for check in &report.checks {
                tr class=[(!check.kept).then_some("bad")] {
                    td { (check.name) }
                    td { (check.found) }
                    td { (check.allowed) }
                    td { @if !check.kept { "BAD" } }
                }
            }
        }
        @for plot in plots {
            h2 { (plot.caption) }
            p { img src=(plot.file) alt=(plot.caption); }
        }
    }
}
