// SPDX-License-Identifier: GPL-2.0-or-later
//! All tests of the workbench from outside in one program, which is linked once.

mod boxes;
mod calibrate;
mod calibrate_command;
mod calibrate_tables;
mod cell;
mod check;
mod commands;
mod configs;
mod control;
mod course;
mod curve;
mod dynamics;
mod dynamics_command;
mod dynamics_motion;
mod golden;
mod ini_cases;
mod inivar;
mod interpreter;
mod lathe_loops;
mod mobility;
mod offsets;
mod page;
mod path;
mod preflight;
mod random_program;
mod replay;
mod rods;
mod rooms;
mod sensitivity;
mod shipped;
mod stability;
mod stiffness;
mod studies;
mod typical;
mod workspace;
