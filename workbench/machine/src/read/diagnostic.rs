// SPDX-License-Identifier: GPL-2.0-or-later
//! Problems of a file for the user: the line, the offending part, and a fix.

use crate::read::error::MachineError;
use crate::read::ini::{IniError, Problem};
use annotate_snippets::{AnnotationKind, Level, Origin, Renderer, Snippet};

/// Severity of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// A violation.
    Error,
    /// A possible mistake.
    Warning,
}

/// Returns the refusal of an INI file, in colors: every error with its line.
pub fn of_machine(error: &MachineError) -> String {
    let marked = |IniError(problem): &IniError| rendered(Severity::Error, problem);
    match error.in_file() {
        [] => format!("pkm: {error}"),
        errors => errors.iter().map(marked).collect::<Vec<_>>().join("\n\n"),
    }
}

/// Returns a problem with its line, in colors; the printing code removes them if necessary.
pub fn rendered(severity: Severity, problem: &Problem) -> String {
    let level = match severity {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
    };
    let file = problem.file.display().to_string();
    let title = match (&problem.found, problem.section.is_empty()) {
        (Some(found), true) => found.clone(),
        (None, true) => "this file cannot be read".to_string(),
        (None, _) => format!("[{}]{} is missing", problem.section, problem.key),
        (Some(found), _) if found.is_empty() => format!("[{}]{}", problem.section, problem.key),
        (Some(found), _) => format!("[{}]{} = {found}", problem.section, problem.key),
    };
    let report = match &problem.excerpt {
        Some(excerpt) => {
            let part = AnnotationKind::Primary.span(excerpt.part.clone()).label(&problem.expected);
            let snippet = Snippet::source(&excerpt.text)
                .line_start(problem.line.unwrap_or(1))
                .path(&file)
                .annotation(part);
            level.primary_title(title).element(snippet)
        }
        None => level
            .primary_title(title)
            .element(Origin::path(&file))
            .element(Level::HELP.message(&problem.expected)),
    };
    Renderer::styled().render(&[report])
}
