// SPDX-License-Identifier: GPL-2.0-or-later
//! Results of a check: facts, and misfits.

use machine::proof::axis_box::{self, AxisBox, End};
use machine::read::diagnostic::Severity;
use machine::read::ini::{IniError, Problem};
use machine::read::mechanism::Mechanism;
use machine::read::tools::Tool;

/// Ratio of ranges above which one is offered in place of the other.
const WIDER: f64 = 1.05;

/// A finding.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Finding {
    /// Its severity.
    pub severity: Severity,
    /// Problem, location, and a fix.
    #[serde(flatten)]
    pub problem: Problem,
}

/// The range of X Y Z in which a tilt is proved, without a tool. The axis limits of X Y Z do not end it.
#[derive(Clone, Debug)]
pub struct TiltBox {
    /// Largest angle of A and of B, degrees.
    pub tilt: f64,
    /// Poses with up to this tilt, C at home; `None` if none is proved about home.
    pub limits: Option<AxisBox>,
    /// Why it is not larger.
    pub ends: Vec<End>,
}

/// Results of a check.
#[derive(Clone, Debug)]
pub struct Report {
    pub config: Mechanism,
    /// Names and values, one line each.
    pub facts: Vec<(String, String)>,
    /// Errors and warnings.
    pub findings: Vec<Finding>,
    /// The pose box that is proved to be inside the workspace.
    pub suggestion: Option<AxisBox>,
    /// The range of X Y Z for some tilts, from none to the largest; empty if the machine does not tilt.
    pub tilts: Vec<TiltBox>,
    /// Tools with which the suggestion is proved as well, for a machine that tilts.
    pub proved_tools: Vec<Tool>,
    /// Share of legal poses among those sampled in the axis limits.
    pub taken: Option<f64>,
    /// Whether that is the whole box within the axis limits.
    pub is_whole: bool,
}

impl Report {
    /// Creates an empty report.
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

    /// Returns whether there are no errors.
    pub fn fits(&self) -> bool {
        self.findings.iter().all(|finding| finding.severity == Severity::Warning)
    }

    /// Returns axis limits with the whole range of the smallest tilt, if that is wider than the limits of the file.
    pub fn wider(&self) -> Option<AxisBox> {
        let (within, level) =
            (axis_box::range(&self.config), self.tilts.first()?.limits?.rounded());
        let mut wider = within;
        for k in 0..3 {
            (wider.low[k], wider.high[k]) =
                (within.low[k].min(level.low[k]), within.high[k].max(level.high[k]));
        }
        let width = |part: &AxisBox, k: usize| part.high[k] - part.low[k];
        let is_wider = (0..3).any(|k| width(&wider, k) > WIDER * width(&within, k));
        (is_wider && self.config.chain.is_empty()).then_some(wider)
    }

    /// Adds a fact.
    pub fn fact(&mut self, name: &str, value: impl Into<String>) {
        self.facts.push((name.into(), value.into()));
    }

    /// Adds another line to a fact.
    pub(super) fn more(&mut self, name: &str, value: impl Into<String>) {
        let mut behind = self.facts.iter().skip_while(|(own, _)| own != name);
        let is_new = behind.next().is_none();
        let rest = behind.skip_while(|(own, _)| own.is_empty()).count();
        let own = if is_new { name } else { "" };
        self.facts.insert(self.facts.len() - rest, (own.into(), value.into()));
    }

    /// Adds a finding.
    pub fn finding(&mut self, severity: Severity, error: IniError) {
        self.findings.push(Finding { severity, problem: *error.0 });
    }
}
