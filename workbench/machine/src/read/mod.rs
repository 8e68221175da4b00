// SPDX-License-Identifier: GPL-2.0-or-later
//! A machine as its files describe it: INI file, tool table, and their errors.

pub mod boxes;
mod chain;
pub mod columns;
mod constraints;
pub mod diagnostic;
pub mod direction;
pub mod edit;
pub mod error;
pub mod facts;
pub mod ini;
pub mod joints;
pub mod legs;
pub mod machine;
pub mod mechanism;
pub mod models;
pub mod near;
pub mod older;
pub mod pins;
pub mod place;
pub mod places;
pub mod tools;
