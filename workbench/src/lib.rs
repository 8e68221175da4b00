// SPDX-License-Identifier: GPL-2.0-or-later
//! Host side of pkmkins: the machine as its INI file describes it, programs replayed
//! through the kinematics, and traces of running machines judged and drawn.

pub mod calibrate;
pub mod case;
pub mod check;
pub mod draw;
pub mod program;
pub mod proof;
pub mod read;
pub mod study;
pub mod trace;
