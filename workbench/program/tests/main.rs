// SPDX-License-Identifier: GPL-2.0-or-later
//! All external tests of the crate in one program, which is linked once.

mod axis_limits;
mod chain;
mod constrained;
mod correction;
mod extra_axes;
mod generated;
mod joint_curves;
mod motion;
mod preflight;
mod random_program;
mod reading;
mod replay;
mod servo_cycles;
mod starts;
mod timeline;
mod travel;
mod two_mechanisms;
