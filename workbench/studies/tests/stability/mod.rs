// SPDX-License-Identifier: GPL-2.0-or-later
//! Chatter stability, against independently computed values, closed forms, and between two methods.

mod lag;
mod machine;
mod measured;
mod milling;
mod poses;
mod spindle;
mod turning;

use test_support::shipped::root;

/// Returns a study of docs/studies/examples.
pub fn example(name: &str) -> String {
    std::fs::read_to_string(root().join("docs/studies/examples").join(name)).unwrap()
}

/// Returns the study of the links for which golden/stability.toml has independent results.
pub fn two_links() -> String {
    std::fs::read_to_string(root().join("tests/cases/two-links.toml")).unwrap()
}
