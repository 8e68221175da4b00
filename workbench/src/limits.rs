// SPDX-License-Identifier: GPL-2.0-or-later
//! What a machine's configuration asks its poses to keep.

use crate::read::machine::MachineConfig;

/// Centre lines of legs that are nearer than this share of the machine's size meet: no leg is
/// thinner.
const MEETING: f64 = 1e-3;

/// What the centre lines of legs that share no anchor have to keep, machine units:
/// `[PKM]ROD_CLEARANCE`, or without it what keeps them from meeting.
pub fn least_distance(config: &MachineConfig) -> f64 {
    config.clearance.unwrap_or(MEETING * config.machine.size())
}
