// SPDX-License-Identifier: GPL-2.0-or-later
//! Host side of pkmkins: the machine as its INI file describes it, programs replayed
//! through the kinematics, and traces of running machines judged and drawn.

pub mod axis_box;
pub mod batch;
pub mod boxes;
pub mod case;
pub mod cautions;
pub mod cell;
pub mod check;
pub mod choose;
pub mod conditioning;
pub mod diagnostic;
pub mod fit;
pub mod homing;
pub mod ini;
pub mod interpreter;
pub mod jet;
pub mod machine;
pub mod mobility;
pub mod one_to_one;
pub mod path;
pub mod plots;
pub mod preflight;
pub mod random_program;
pub mod replay;
pub mod report;
pub mod tools;
pub mod trace;
pub mod wiring;
