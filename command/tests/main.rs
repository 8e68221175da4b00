// SPDX-License-Identifier: GPL-2.0-or-later
//! All external tests of the command in one program, which is linked once.

mod calibrate_command;
mod calibrate_tables;
mod chain;
mod command_line;
mod commands;
mod confinement;
mod constrained;
mod constrained_views;
mod control;
mod cut;
mod documentation;
mod dynamics_command;
mod exits;
mod export;
mod filter;
mod fixes;
mod frames;
mod generated;
mod generated_machines;
mod installed;
mod json;
mod measure;
mod migrate;
mod new;
mod offsets;
mod page;
mod panel;
mod papers;
mod path_refusals;
mod pictures;
mod progress;
mod scene;
#[path = "../../workbench/calibrate/tests/shop.rs"]
mod shop;
mod slips;
mod stability;
mod studies;
mod travel;
mod two_mechanisms;
mod view;
mod without_linuxcnc;
