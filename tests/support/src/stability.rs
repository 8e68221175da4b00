// SPDX-License-Identifier: GPL-2.0-or-later
//! Values of stability in the cut, computed by other software.

use crate::shipped::root;
use std::sync::LazyLock;
use toml::{Table, Value};

/// The file of values; see its head for their origin.
static GOLDEN: LazyLock<Table> = LazyLock::new(|| {
    let file = root().join("tests/cases/golden/stability.toml");
    std::fs::read_to_string(file).unwrap().parse().unwrap()
});

pub fn golden(section: &str, key: &str) -> &'static Value {
    GOLDEN[section].get(key).unwrap_or_else(|| panic!("{section}.{key}"))
}

pub fn number(value: &Value) -> f64 {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64)).unwrap()
}

pub fn row(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

pub fn rows(section: &str, key: &str) -> Vec<Vec<f64>> {
    golden(section, key).as_array().unwrap().iter().map(row).collect()
}

#[track_caller]
pub fn close(found: f64, expected: f64, tolerance: f64) {
    let off = (found / expected - 1.0).abs();
    assert!(off < tolerance, "{found} {expected}: {off:e}");
}
