// SPDX-License-Identifier: GPL-2.0-or-later
//! The report of a run as a folder: one page and its plots.

use crate::trace::{Report, RunResult};
use maud::{Markup, html};
use pkm::draw::page::page;
use pkm::draw::plots::{self, Plot};
use pkm::draw::sample::Sample;
use pkm::files::write_whole;
use pkm::read::machine::MachineConfig;
use std::fs;
use std::path::Path;

/// Writes plots and report.html into `folder`, which is made if needed.
///
/// Every file appears complete or not at all.
///
/// # Errors
/// A sentence naming the file, or what could not be drawn.
pub fn write(
    folder: &Path,
    config: &MachineConfig,
    samples: &[Sample],
    result: &RunResult,
    report: &Report,
) -> Result<(), String> {
    let plots = plots::all(config, samples)?;
    fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    for plot in &plots {
        write_whole(&folder.join(&plot.file), &plot.svg)?;
    }
    let title = format!("{}: {}", result.config, result.program);
    write_whole(&folder.join("report.html"), &page(&title, &body(report, &plots)))
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
