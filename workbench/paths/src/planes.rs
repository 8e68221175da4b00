// SPDX-License-Identifier: GPL-2.0-or-later
//! The planes of LinuxCNC's arcs.

/// G17, G18 and G19: first axis, second axis, and the perpendicular axis.
pub(super) const PLANES: [[usize; 3]; 3] = [[0, 1, 2], [2, 0, 1], [1, 2, 0]];
