// SPDX-License-Identifier: GPL-2.0-or-later
//! Comment lines that state the origin of a file of measurements: `# key value`.

use super::log::BadLog;
use kinematics::Vector3;
use machine::read::mechanism::Mechanism;

const MARKS: [char; 2] = ['#', ';'];

/// Returns whether a line contains no more than a comment.
pub(crate) fn is_comment(line: &str) -> bool {
    line.trim().is_empty() || line.trim().starts_with(MARKS)
}

/// Returns the text after a key, and its line.
///
/// # Errors
/// The key is missing (the error states `expected`), or given twice.
pub(crate) fn value<'a>(
    text: &'a str,
    key: &str,
    expected: &str,
) -> Result<(usize, &'a str), BadLog> {
    let behind = |line: &'a str| {
        let words = line.trim().strip_prefix(MARKS)?.trim_start().strip_prefix(key)?;
        words.starts_with(char::is_whitespace).then(|| words.trim())
    };
    let mut all = (1..).zip(text.lines()).filter_map(|(n, line)| Some((n, behind(line)?)));
    let first = all.next();
    let first = first.ok_or_else(|| BadLog { line: 1, text: format!("expected {expected}") })?;
    match all.next() {
        None => Ok(first),
        Some((line, _)) => {
            Err(BadLog { line, text: format!("\"{key}\" appears twice: use one per file") })
        }
    }
}

/// Returns the `N` numbers after a key.
///
/// # Errors
/// As [`value`], or other than `N` numbers.
pub(crate) fn numbers<const N: usize>(
    text: &str,
    key: &str,
    expected: &str,
) -> Result<[f64; N], BadLog> {
    let (line, words) = value(text, key, expected)?;
    finite(words)
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| BadLog { line, text: format!("\"{words}\": expected {expected}") })
}

/// Parses words that are all finite numbers.
pub(crate) fn finite(text: &str) -> Option<Vec<f64>> {
    text.split_ascii_whitespace()
        .map(|word| word.parse().ok().filter(|x: &f64| x.is_finite()))
        .collect()
}

/// Refuses measurements taken with another geometry.
///
/// # Errors
/// As [`value`], or a geometry hash other than the machine's.
pub(crate) fn of_geometry(config: &Mechanism, text: &str) -> Result<(), BadLog> {
    let expected = "a line \"# geometry HASH\", the value of pkmkins.geometry-hash";
    let (line, word) = value(text, "geometry", expected)?;
    let own = config.hash;
    let bad = |text| Err(BadLog { line, text });
    // `halcmd getp` prints it as decimal, `halcmd show` as hexadecimal.
    match keys::hash(word) {
        Some(hash) if hash == own => Ok(()),
        Some(hash) => bad(format!(
            "measured with geometry {hash:#010x}, but {} has {own:#010x}: calibrate the file that LinuxCNC used",
            config.file.display()
        )),
        None => bad(format!("\"{word}\": expected {expected}")),
    }
}

/// Returns the tool vector.
///
/// # Errors
/// As [`numbers`].
pub(crate) fn tool(text: &str) -> Result<Vector3<f64>, BadLog> {
    numbers(text, "tool", "a line \"# tool X Y Z\", with the spindle offset").map(Vector3::from)
}
