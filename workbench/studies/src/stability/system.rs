// SPDX-License-Identifier: GPL-2.0-or-later
//! The loop that a study describes, with its own or another overhang.

use crate::stability::lag::{Lag, Term};
use crate::stability::spindle::NoSpindle;
use crate::study::cutting::Overhang;
use crate::study::file::Study;

/// Why a study does not describe a loop.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoLoop {
    #[error(
        "the study has neither [[links]] nor [spindle], so nothing yields between tool and work: add one of them"
    )]
    Nothing,
    #[error("the study has no time_constant_ms in [lag]: add it")]
    Lag,
    #[error("--overhang needs [overhang] or [spindle] in the study")]
    Overhang,
    #[error("[overhang] changes the first of [[links]], but the study has none: add one")]
    Link,
    #[error(transparent)]
    Spindle(#[from] NoSpindle),
}

/// A loop at one overhang, and the names of its terms.
#[derive(Clone, Debug, PartialEq)]
pub struct Adjustment {
    /// Overhang of spindle or tool, mm; `None` for the study's own.
    pub overhang: Option<f64>,
    pub lag: Lag,
    pub names: Vec<String>,
}

impl Overhang {
    /// Returns the stiffness of the first link at an overhang in mm, N/mm.
    pub fn stiffness(&self, overhang: f64) -> f64 {
        let [a, b, c] = self.compliance_um_per_n.map(|value| value.0);
        let cantilever = self.cantilever_um_per_n.0 * (overhang / self.cantilever_at_mm.0).powi(3);
        1e3 / (a + b * overhang + c * overhang * overhang + cantilever)
    }
}

impl Adjustment {
    /// Builds the loop of a study: the links, then the modes of the spindle. With an overhang the first link has
    /// the stiffness that `[overhang]` gives, and keeps its mass and damping ratio; without that table
    /// the overhang is the length of the spindle's last cylinder.
    ///
    /// # Errors
    /// See [`NoLoop`].
    pub fn of(study: &Study, overhang: Option<f64>) -> Result<Self, NoLoop> {
        let keys = study.lag.ok_or(NoLoop::Lag)?;
        let mut terms: Vec<Term> = study
            .links
            .iter()
            .map(|link| {
                let [mass, damping, stiffness] =
                    [link.mass_kg, link.damping_n_s_per_mm, link.stiffness_n_per_um];
                Term::link(mass.0 * 1e-3, damping.0, stiffness.0 * 1e3)
            })
            .collect();
        let mut names: Vec<String> = study.links.iter().map(|link| link.name.clone()).collect();
        let mut spindle = study.spindle.clone();
        match (overhang, &study.overhang) {
            (Some(length), Some(formula)) => {
                let first = terms.first_mut().ok_or(NoLoop::Link)?;
                let square = formula.stiffness(length) * first.gain;
                first.rate *= (square / first.square).sqrt();
                first.square = square;
            }
            (Some(length), None) => {
                let own = spindle.take().ok_or(NoLoop::Overhang)?;
                spindle = Some(own.with_overhang(length));
            }
            (None, _) => {}
        }
        if let Some(spindle) = spindle {
            let own = spindle.nose()?.terms();
            names.extend((1..=own.len()).map(|k| format!("spindle, mode {k}")));
            terms.extend(own);
        }
        match terms.is_empty() {
            true => Err(NoLoop::Nothing),
            false => Ok(Self {
                overhang,
                lag: Lag { terms, lag: keys.time_constant_ms.0 * 1e-3 },
                names,
            }),
        }
    }

    /// Returns the name in tables and plots.
    pub fn name(&self) -> String {
        self.overhang.map_or("as given".into(), |length| format!("overhang {length} mm"))
    }
}
