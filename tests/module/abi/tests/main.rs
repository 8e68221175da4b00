// SPDX-License-Identifier: GPL-2.0-or-later
//! All tests of the built module in one program, which is linked once.

mod c_header;
mod chain;
mod connected;
mod contradiction;
mod correction;
mod exact_arrays;
mod extra_axes;
mod failure;
mod freezing;
mod garbage;
mod genhexkins;
mod golden;
mod guard;
mod held;
mod host_library;
mod jacobian;
mod jog;
mod loading;
mod migrated;
mod pair;
mod peers;
mod pins;
mod released;
mod rods;
mod sequences;
mod singular;
mod start;
mod switching;
mod through;
mod tool_change;
mod tool_interrupted;
mod tool_offset;
mod workspace;
