// SPDX-License-Identifier: GPL-2.0-or-later
//! The report of a run as a folder: one page and its plots.

use crate::draw::plots::{self, Plot};
use crate::read::machine::MachineConfig;
use crate::trace::{Report, RunResult, Sample};
use std::fmt::Write;
use std::fs;
use std::io;
use std::path::Path;

const STYLE: &str = "body { font-family: sans-serif; max-width: 62em; margin: 2em auto }\n\
    td, th { text-align: left; padding: 0.2em 1em 0.2em 0; vertical-align: top }\n\
    .bad { font-weight: bold }\nimg { max-width: 100% }\n";

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
    write_whole(&folder.join("report.html"), &page(result, report, &plots))
}

fn page(result: &RunResult, report: &Report, plots: &[Plot]) -> String {
    let title = format!("{}: {}", escaped(&result.config), escaped(&result.program));
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<title>{title}</title>\n\
         <style>\n{STYLE}</style>\n<h1>{title}</h1>\n<table>\n\
         <tr><th>figure</th><th>found</th><th>allowed</th><th></th></tr>\n"
    );
    for check in &report.checks {
        let (class, mark) = if check.kept { ("", "") } else { (" class=\"bad\"", "BAD") };
        let cells = [&check.name, &check.found, &check.allowed].map(|cell| escaped(cell));
        let row = format!("<tr{class}><td>{}</td><td>{mark}</td></tr>\n", cells.join("</td><td>"));
        page.push_str(&row);
    }
    page.push_str("</table>\n");
    for Plot { file, caption, .. } in plots {
        // Writing to a String does not fail.
        let _ = writeln!(page, "<h2>{caption}</h2>\n<p><img src=\"{file}\" alt=\"{caption}\"></p>");
    }
    page.push_str("</html>\n");
    page
}

/// One page without other files: a text, and plots under their captions.
pub fn single_page(title: &str, text: &str, plots: &[Plot]) -> String {
    let (title, text) = (escaped(title), escaped(text));
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<title>{title}</title>\n\
         <style>\n{STYLE}</style>\n<h1>{title}</h1>\n<pre>\n{text}</pre>\n"
    );
    for Plot { caption, svg, .. } in plots {
        // Writing to a String does not fail.
        let _ = writeln!(page, "<h2>{}</h2>\n{svg}", escaped(caption));
    }
    page.push_str("</html>\n");
    page
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// Writes beside the file, then renames.
///
/// # Errors
/// A sentence naming the file.
pub fn write_whole(file: &Path, text: &str) -> Result<(), String> {
    let named = |error: io::Error| format!("{}: {error}", file.display());
    let folder = file.parent().unwrap_or(Path::new("."));
    let mut scratch = tempfile::Builder::new();
    // Temporary files are private by default; a report is to be read by others.
    #[cfg(unix)]
    scratch.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o644));
    let scratch = scratch.tempfile_in(folder).map_err(named)?;
    fs::write(scratch.path(), text).map_err(named)?;
    scratch.persist(file).map_err(|e| named(e.error)).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_of_messages_cannot_become_markup() {
        assert_eq!(escaped("a < b & c > d"), "a &lt; b &amp; c &gt; d");
    }

    #[test]
    fn a_file_is_replaced_whole_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("x.svg");
        for text in ["first", "second"] {
            write_whole(&file, text).unwrap();
            assert_eq!(fs::read_to_string(&file).unwrap(), text);
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
