// SPDX-License-Identifier: GPL-2.0-or-later
//! The loop that a study describes, with its own or another overhang.

use crate::stability::lag::{Lag, Term};
use crate::stability::spindle::NoSpindle;
use crate::study::cutting::{Link, LinkJoint, Overhang};
use crate::study::file::Study;
use std::f64::consts::TAU;

/// Why a study does not describe a loop.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoLoop {
    #[error(
        "the study has neither [[links]] nor [spindle] nor [[measured]], so nothing yields between tool and work: add one of them"
    )]
    Nothing,
    #[error("the study has no time_constant_ms in [lag]: add it")]
    Lag,
    #[error("--overhang needs [overhang] or [spindle] in the study")]
    Overhang,
    #[error("[overhang] changes the first of [[links]], but the study has none: add one")]
    Link,
    #[error(
        "[[links.joints]] arm_mm = {0} does not follow --overhang; add the compliance of this joint to [overhang], or \
         use [spindle] with [[spindle.joints]]"
    )]
    Arm(f64),
    #[error(
        "[lag] time_constant_ms = {lag}: expected at most {period:.3}, the period of the slowest oscillation; is it in us?"
    )]
    Slow { lag: f64, period: f64 },
    #[error("the frequencies of the files of [[measured]] do not overlap: measure a common range")]
    Apart,
    #[error(
        "{name} vibrates at {hz:.1} Hz, outside the measured {low:.1} to {high:.1} Hz, where nothing is examined: \
         measure a range that contains it, or remove it"
    )]
    Outside { name: String, hz: f64, low: f64, high: f64 },
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

/// Natural frequency of a link below which its mass may be in grams, Hz: 2270 kg instead of g on the spring of a
/// spindle vibrates at 21 Hz, while links of machine tools are above 30 Hz.
const SLOW: f64 = 30.0;

impl Link {
    /// Returns the question whether the mass has another unit; `None` for a plausible link.
    pub fn doubt(&self) -> Option<String> {
        let [mass, stiffness] = [self.mass_kg.0, self.stiffness_n_per_um.0];
        let hz = (stiffness * 1e6 / mass).sqrt() / TAU;
        (hz < SLOW).then(|| {
            format!(
                "[[links]] {}: mass_kg = {mass} on {stiffness} N/um vibrates at only {hz:.1} Hz; is the mass in g? \
                 Give it in kg",
                self.name
            )
        })
    }
}

impl LinkJoint {
    /// Returns displacement of the tool per force, mm/N.
    fn compliance(&self) -> f64 {
        // rad/(N m) is 1e-3 rad/(N mm).
        1e-3 * (self.compliance_um_per_n + self.angular_rad_per_n_m * self.arm_mm.powi(2))
    }
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
    /// Builds the loop of a study: the links, then the modes of the spindle, then measured responses. With an
    /// overhang the first link has the stiffness that `[overhang]` gives; without that table
    /// the overhang is the length of the spindle's last cylinder. Joints are springs in series with that of
    /// their link. Another stiffness leaves mass and damping ratio of a link unchanged.
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
                *first = first.with_stiffness(formula.stiffness(length));
                let turns = |joint: &&LinkJoint| joint.angular_rad_per_n_m > 0.0;
                if let Some(joint) = study.links[0].joints.iter().find(turns) {
                    return Err(NoLoop::Arm(joint.arm_mm));
                }
            }
            (Some(length), None) => {
                let own = spindle.take().ok_or(NoLoop::Overhang)?;
                spindle = Some(own.with_overhang(length));
            }
            (None, _) => {}
        }
        for (term, link) in terms.iter_mut().zip(&study.links) {
            let joints: f64 = link.joints.iter().map(LinkJoint::compliance).sum();
            if joints > 0.0 {
                *term = term.with_stiffness(1.0 / (term.gain / term.square + joints));
            }
        }
        if let Some(spindle) = spindle {
            let own = spindle.nose()?.terms();
            names.extend((1..=own.len()).map(|k| format!("spindle, mode {k}")));
            terms.extend(own);
        }
        names.extend(study.measured.iter().map(|own| own.name.clone()));
        let measured = study.measured.iter().map(|own| own.response.clone()).collect();
        let lag = Lag { terms, measured, lag: keys.time_constant_ms.0 * 1e-3 };
        if names.is_empty() {
            return Err(NoLoop::Nothing);
        }
        if lag.is_apart() {
            return Err(NoLoop::Apart);
        }
        if let Some(k) = lag.outside().filter(|_| !lag.measured.is_empty()) {
            let [low, high] = lag.range().map(|omega| omega / TAU);
            let hz = lag.terms[k].omega() / TAU;
            return Err(NoLoop::Outside { name: names.swap_remove(k), hz, low, high });
        }
        let period = TAU / lag.slowest();
        if lag.lag > period {
            return Err(NoLoop::Slow { lag: keys.time_constant_ms.0, period: period * 1e3 });
        }
        Ok(Self { overhang, lag, names })
    }

    /// Returns the name in tables and plots.
    pub fn name(&self) -> String {
        self.overhang.map_or("as given".into(), |length| format!("overhang {length} mm"))
    }
}
