// SPDX-License-Identifier: GPL-2.0-or-later
//! Check whether the files of a machine fit together, before it moves.
//!
//! - Input: a description of `machine`, with its INI file and HAL files.
//! - Output: [`report`], facts, and [`findings`], mistakes with their severity and line; [`fixes`],
//!   the corrected file.
//! - Uses: `machine`. HAL files run in an interpreter that only records ([`drives`]); none of them has access to HAL.

pub mod between;
pub mod cautions;
mod direction;
mod display;
pub mod drives;
pub mod findings;
pub mod fixes;
pub mod hal_values;
mod homes;
mod homing;
pub mod homing_paths;
pub mod mobility;
mod motion;
mod motors;
mod nearest;
mod odd;
mod order;
mod programs;
pub mod report;
pub mod screws;
mod searches;
mod seen;
mod sequence;
mod size;
mod speeds;
mod startup;
pub mod suggestion;
mod table;
mod tips;
mod tool_change;
mod typos;
pub mod usual;
pub mod wiring;
mod workspace;
pub mod world;

/// Returns the LinuxCNC version that findings name: the first one of the table.
fn linuxcnc() -> &'static str {
    let table = include_str!("../../linuxcnc/versions.toml");
    let version = table.lines().find_map(|line| line.strip_prefix("version = "));
    version.unwrap_or_default().trim_matches('"')
}
