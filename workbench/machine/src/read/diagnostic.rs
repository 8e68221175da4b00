// SPDX-License-Identifier: GPL-2.0-or-later
//! Problems of a file as people read them: the line, the part that is meant, and a way out.

use crate::read::error::MachineError;
use crate::read::ini::{IniError, Problem};
use annotate_snippets::{AnnotationKind, Level, Origin, Renderer, Snippet};

/// How much a finding weighs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Something does not fit.
    Error,
    /// Something may not be meant so.
    Warning,
}

/// Returns why an INI file describes no machine, in colours: every error with its line.
pub fn of_machine(error: &MachineError) -> String {
    let marked = |IniError(problem): &IniError| rendered(Severity::Error, problem);
    match error.in_file() {
        [] => format!("pkm: {error}"),
        errors => errors.iter().map(marked).collect::<Vec<_>>().join("\n\n"),
    }
}

/// A problem with its line, in colours; who prints takes them away where they do not belong.
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
