// SPDX-License-Identifier: GPL-2.0-or-later
//! One page that shows a machine, and a program on it, in any browser: docs/reference/view.md.
//!
//! - Input: a description of `machine`, and LinuxCNC's run of a program.
//! - Output: one HTML file with the page's own code, which is built from the folder `page`; frames and videos.
//! - Uses: `machine`, `linuxcnc` and `program`.
//!
//! `track` records where the machine is at every time of a program, `data` collects the input of the page, `page`
//! packs both into one file, and `film` has a browser draw it.

pub mod data;
pub mod film;
pub mod page;
pub mod track;
