// SPDX-License-Identifier: GPL-2.0-or-later
//! The program that stops at the poses where a gauge is read.

use super::gauge::Kind;
use super::propose::{Proposal, Step, decimals, words};
use super::setup::Setup;
use machine::files::as_comment;
use machine::read::mechanism::Mechanism;
use std::fmt::Write as _;

/// Writes the program of a proposal, whose readings go into the table of this name.
pub fn text(config: &Mechanism, setup: &Setup, proposal: &Proposal, table: &str) -> String {
    let gauge = &setup.gauge;
    let count = proposal.stops.len();
    let (machine, table) = (name_in_comments(config), as_comment(table));
    let mut text = format!(
        "; Written by `pkm measure`: stops at {count} poses of {machine} for the readings of {table}.\n\
         ; The machine's own coordinates: the last work system, without an offset, and no G92.\n\
         {} G17 G40 G90 G94 G61\n\
         G10 L2 P9 {} R0\n\
         G59.3\nG92.1\n",
        unit_word(config),
        words(config, &[0.0; 6])
    );
    let decimals = decimals(config);
    let [x, y, z] = (gauge.tool - config.spindle).map(|length| length + 0.0).into();
    let _ = writeln!(text, "G43.1 X{x:.decimals$} Y{y:.decimals$} Z{z:.decimals$}");
    for (n, (stop, path)) in (1..).zip(proposal.stops.iter().zip(&proposal.paths)) {
        text += &moves(config, setup, path);
        let object = &setup.objects[stop.object].name;
        let _ = writeln!(text, "(MSG,pose {n} of {count} at {object}: {})\nM0", request(setup, n));
    }
    text += &moves(config, setup, &proposal.home);
    text + "G49\nG54\nM2\n"
}

/// Returns the name of the machine's file.
pub(crate) fn name_in_comments(config: &Mechanism) -> String {
    as_comment(&config.file.file_name().unwrap_or_default().to_string_lossy())
}

/// Returns G20 or G21.
pub(crate) fn unit_word(config: &Mechanism) -> &'static str {
    if config.units_per_mm == 1.0 { "G21" } else { "G20" }
}

fn moves(config: &Mechanism, setup: &Setup, steps: &[Step]) -> String {
    let line = |step: &Step| match step.is_slow {
        true => format!("G1 {} F{}\n", words(config, &step.at), setup.feed),
        false => format!("G0 {}\n", words(config, &step.at)),
    };
    steps.iter().map(line).collect()
}

/// Returns the operator's task at a pose.
fn request(setup: &Setup, pose: usize) -> String {
    let (gauge, expected) = (&setup.gauge, setup.expected);
    let scale = gauge.scale;
    match gauge.kind {
        Kind::Dial if pose == 1 => {
            format!(
                "turn the scale to {expected} {scale}, and enter the reading of the dial in {scale}"
            )
        }
        Kind::Dial => format!("enter the reading of the dial in {scale}"),
        Kind::Feeler => format!("enter the gap in {scale}"),
        Kind::Bar => format!("mount the bar, enter its length in {scale}, and remove it"),
    }
}
