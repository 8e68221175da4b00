// SPDX-License-Identifier: GPL-2.0-or-later
//! The report on a program in sentences.

use crate::cut::report::{Drive, Report, Stability};
use crate::stability::WORTH;

/// Returns a line and the time from the start, if known: a loop executes a line several times.
pub fn place(line: u32, at_s: Option<f64>) -> String {
    at_s.map_or(format!("line {line}"), |seconds| format!("line {line} at {seconds:.3} s"))
}

impl Report {
    /// Returns the verdict in a sentence.
    pub fn why(&self) -> String {
        let above = self.drives.iter().find(|drive| drive.share.is_some_and(|share| share > 1.0));
        if let Some(Drive { name, load, unit, line, at_s, share, .. }) = above {
            let share = share.unwrap_or_default();
            return format!(
                "{name} needs {load:.1} {unit} in {}, {share:.3} of its rating.",
                place(*line, *at_s)
            );
        }
        let stability = &self.stability;
        if !(stability.margin > 1.0) {
            let limit = stability.stable_to_mm;
            return format!(
                "In {} the cut chatters beyond {limit:.4} mm, but its depth is {} mm.",
                place(stability.line, stability.at_s),
                self.depth_mm
            );
        }
        match (&self.stopped, &self.not_judged) {
            (Some(why), _) => format!("LinuxCNC stops the program: {why}."),
            (_, Some(why)) => format!("Time and inertia are not judged: {why}."),
            _ if self.fits.is_none() => {
                "Everything examined is within its limit; not everything was examined.".into()
            }
            _ => "Every drive is within its rating, and every position examined is stable.".into(),
        }
    }

    /// Returns what was not assessed.
    pub fn notes(&self) -> Vec<String> {
        let of_cut = if self.is_turning { "depth" } else { "immersion and depth" };
        let mut notes = vec![
            format!(
                "The position of the stock: every feed move counts as a cut with the study's {of_cut}."
            ),
            WORTH.replace('\n', " "),
        ];
        let Stability { places, feed_moves, .. } = self.stability;
        notes.push("Stability and vibration between the ends of a move.".into());
        if places < feed_moves {
            let rest = feed_moves - places;
            notes.push(format!(
                "Stability and vibration of {rest} feed moves: use --places {feed_moves} to examine all."
            ));
        }
        if self.drives.iter().any(|drive| drive.share.is_none()) {
            notes.push(
                "The ratings of some drives: the study has no max_force_n, max_torque_n_m or \
                 motor_torque_n_m for them."
                    .into(),
            );
        }
        if self.resolution_um.is_none() {
            notes.push("The step size of the drives: not every [JOINT_N] has a SCALE.".into());
        }
        if let Some(why) = &self.rapids_not_judged {
            notes.push(format!("Rapid moves through the stock: {why}."));
        }
        if let Some(why) = &self.not_judged {
            notes.push(format!("Time and inertia: {why}."));
        }
        notes
    }
}
