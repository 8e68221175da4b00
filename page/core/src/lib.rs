// SPDX-License-Identifier: GPL-2.0-or-later
//! The kinematics of the page that `pkm view` writes: the crate [`kinematics`], built for
//! browsers (wasm32), with a machine and its answers as plain numbers.
//!
//! [`Described`] is a machine with its limits; `pkm view` writes it as numbers ([`Described::write`]), the
//! page passes them on, and [`Described::read`] gives the same machine. [`Drawn`] is everything that the
//! page shows of a pose. Lengths are machine units, angles degrees.
#![no_std]
#![deny(unsafe_code)]

#[cfg(target_arch = "wasm32")]
mod browser;
mod described;
mod drawn;

pub use described::Described;
pub use drawn::{Drawn, MARGIN, MOST_MARGINS, NUMBERS, numbers};
