// SPDX-License-Identifier: GPL-2.0-or-later
//! What a check has found: facts, and what does not fit.

use machine::proof::axis_box::AxisBox;
use machine::read::diagnostic::Severity;
use machine::read::ini::{IniError, Problem};
use machine::read::mechanism::Mechanism;
use machine::read::tools::Tool;

/// One thing found.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Finding {
    /// How much it weighs.
    pub severity: Severity,
    /// What, where, and a way out.
    #[serde(flatten)]
    pub problem: Problem,
}

/// What a check has found.
#[derive(Clone, Debug)]
pub struct Report {
    pub config: Mechanism,
    /// Names and values, one line each.
    pub facts: Vec<(String, String)>,
    /// What does not fit, or may not.
    pub findings: Vec<Finding>,
    /// The box of poses that is proved to be inside the workspace.
    pub suggestion: Option<AxisBox>,
    /// Tilts of A and B, degrees, and the largest box in X Y Z that is proved with each, without a
    /// tool; empty where the machine does not tilt.
    pub tilts: Vec<(f64, Option<AxisBox>)>,
    /// Tools with which the suggestion is proved, too, of a machine that tilts.
    pub proved_tools: Vec<Tool>,
    /// Share of the poses in the axis limits that the machine can take, seen.
    pub taken: Option<f64>,
    /// Whether that is all of the box that the axis limits give.
    pub is_whole: bool,
}

impl Report {
    /// Of a machine of which nothing is known yet.
    pub(super) fn new(config: &Mechanism) -> Self {
        Self {
            config: config.clone(),
            facts: vec![],
            findings: vec![],
            suggestion: None,
            tilts: vec![],
            proved_tools: vec![],
            taken: None,
            is_whole: false,
        }
    }

    /// Whether nothing is wrong.
    pub fn fits(&self) -> bool {
        self.findings.iter().all(|finding| finding.severity == Severity::Warning)
    }

    /// Adds a row.
    pub fn fact(&mut self, name: &str, value: impl Into<String>) {
        self.facts.push((name.into(), value.into()));
    }

    /// One more line of a fact that was told.
    pub(super) fn more(&mut self, name: &str, value: impl Into<String>) {
        let mut behind = self.facts.iter().skip_while(|(own, _)| own != name);
        let is_new = behind.next().is_none();
        let rest = behind.skip_while(|(own, _)| own.is_empty()).count();
        let own = if is_new { name } else { "" };
        self.facts.insert(self.facts.len() - rest, (own.into(), value.into()));
    }

    /// Adds a thing found.
    pub fn finding(&mut self, severity: Severity, error: IniError) {
        self.findings.push(Finding { severity, problem: *error.0 });
    }
}
