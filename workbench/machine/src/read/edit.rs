// SPDX-License-Identifier: GPL-2.0-or-later
//! Replaces values in the text of an INI file: all other lines, comments and layout stay.

use diffy::DiffOptions;
use std::ops::Range;

/// A section that is not in the file itself.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("[{0}] is not in this file but in an included one: change it there")]
pub struct Elsewhere(pub String);

/// A new value of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Edit {
    /// Section without brackets.
    pub section: String,
    /// Key.
    pub key: &'static str,
    /// Text after `=`.
    pub value: String,
}

/// Returns both texts as a unified diff with `around` lines of context around each change; empty for
/// equal texts.
pub fn difference(old: &str, new: &str, names: (&str, &str), around: usize) -> String {
    let patch = DiffOptions::new()
        .set_context_len(around)
        .set_original_filename(names.0.to_owned())
        .set_modified_filename(names.1.to_owned())
        .create_patch(old, new);
    if patch.hunks().is_empty() { String::new() } else { patch.to_string() }
}

/// Returns the text with these values.
///
/// # Errors
/// A section is in an included file.
pub fn entered(text: &str, edits: &[Edit]) -> Result<String, Elsewhere> {
    let mut lines: Vec<String> = text.split('\n').map(Into::into).collect();
    for edit in edits {
        enter(&mut lines, edit)?;
    }
    Ok(lines.join("\n"))
}

/// Converts the line ends of a new text to carriage return and line feed if all lines of the old text have them.
pub fn with_ends(old: &str, new: String) -> String {
    let mut lines = old.split_inclusive('\n').filter(|line| line.ends_with('\n')).peekable();
    match lines.peek().is_some() && lines.all(|line| line.ends_with("\r\n")) {
        true => new.replace("\r\n", "\n").replace('\n', "\r\n"),
        false => new,
    }
}

/// Returns the lines of a section after its heading, up to the next heading.
fn section(lines: &[String], name: &str) -> Option<Range<usize>> {
    let heading = format!("[{name}]");
    let first = lines.iter().position(|line| line.trim() == heading)? + 1;
    let next = lines[first..].iter().position(|line| line.trim_start().starts_with('['));
    Some(first..next.map_or(lines.len(), |next| first + next))
}

/// Replaces the value of a key, or inserts the key after the last one of its section.
///
/// # Errors
/// The section does not exist.
pub fn enter(lines: &mut Vec<String>, edit: &Edit) -> Result<(), Elsewhere> {
    let Edit { section: name, key, value } = edit;
    let range = section(lines, name).ok_or_else(|| Elsewhere(name.clone()))?;
    let is_own = |line: &String| line.split_once('=').is_some_and(|(word, _)| word.trim() == *key);
    match lines[range.clone()].iter().position(is_own) {
        Some(at) => {
            let line = &mut lines[range.start + at];
            let (before, after) = line.split_once('=').unwrap_or((line.as_str(), ""));
            let blank: String = after.chars().take_while(|c| c.is_whitespace()).collect();
            *line = format!("{before}={blank}{value}");
        }
        None => {
            let own = lines[range.clone()].iter().rposition(|line| line.contains('='));
            lines.insert(range.start + own.map_or(0, |at| at + 1), format!("{key} = {value}"));
        }
    }
    Ok(())
}

/// Returns the text with these sections in place of all whose name begins with `prefix`, and their number in
/// `[KINS]KINEMATICS` as `parameter`; comments stay.
///
/// # Errors
/// `[KINS]KINEMATICS` or such a section is in an included file.
pub fn with_sections(
    text: &str,
    (prefix, parameter): (&str, &str),
    sections: &[String],
) -> Result<String, Elsewhere> {
    let heading = format!("[{prefix}");
    let mut is_own = false;
    let mut place = None;
    let mut lines: Vec<String> = vec![];
    for line in text.split('\n') {
        let start = line.trim_start();
        if start.starts_with('[') {
            is_own = start.starts_with(&heading);
            if is_own {
                place = place.or(Some(lines.len()));
            }
        }
        if !is_own || start.is_empty() || start.starts_with(['#', ';']) {
            lines.push(line.into());
        }
    }
    count(&mut lines, parameter, sections.len())?;
    let new = sections.join("\n");
    match place {
        Some(place) => lines.insert(place, new.trim_end().into()),
        None => {
            while lines.last().is_some_and(|line| line.trim().is_empty()) {
                lines.pop();
            }
            lines.push(format!("\n{new}"));
        }
    }
    Ok(lines.join("\n"))
}

/// Writes a number into `[KINS]KINEMATICS`.
fn count(lines: &mut [String], parameter: &str, count: usize) -> Result<(), Elsewhere> {
    let kins = || Elsewhere("KINS".into());
    let range = section(lines, "KINS").ok_or_else(kins)?;
    let line = lines[range].iter_mut().find(|line| line.trim_start().starts_with("KINEMATICS"));
    let line = line.ok_or_else(kins)?;
    let (word, prefix) = (format!("{parameter}={count}"), format!("{parameter}="));
    let mut words: Vec<&str> = line.split(' ').collect();
    match words.iter_mut().find(|own| own.starts_with(&prefix)) {
        Some(own) => *own = &word,
        None => words.push(&word),
    }
    *line = words.join(" ");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_change_and_all_else_stays() {
        let text = "# a comment\n[LEG_0]\nBASE=1 2 3\n  PLATFORM =  4 5 6\n# of the joint\n\n[LEG_1]\nBASE = 7 8 9\n";
        let edit = |key, value: &str| Edit { section: "LEG_0".into(), key, value: value.into() };
        let edits = [edit("BASE", "1.5 2 3"), edit("PLATFORM", "0 0 0"), edit("OFFSET", "0.25")];
        let new = "# a comment\n[LEG_0]\nBASE=1.5 2 3\n  PLATFORM =  0 0 0\nOFFSET = 0.25\n# of the joint\n\n[LEG_1]\nBASE = 7 8 9\n";
        assert_eq!(entered(text, &edits).unwrap(), new);
        let other = Edit { section: "LEG_7".into(), key: "BASE", value: String::new() };
        assert!(
            entered(text, &[other])
                .unwrap_err()
                .to_string()
                .contains("[LEG_7] is not in this file")
        );
    }

    #[test]
    fn ends_of_lines_stay_those_of_the_file() {
        let new = || "a = 2\nb = 3\r\n".to_string();
        assert_eq!(with_ends("a = 1\r\nb = 3\r\n", new()), "a = 2\r\nb = 3\r\n");
        for old in ["a = 1\r\nb = 3\n", "a = 1\nb = 3\n", "a = 1", ""] {
            assert_eq!(with_ends(old, new()), new());
        }
    }

    #[test]
    fn sections_take_the_place_of_the_old_ones() {
        let text = "[KINS]\nKINEMATICS = pkmkins boxes=2 legs=strut:6\n\n# Start\n[BOX_0]\nLOW = 1\n# mine\n\n[BOX_1]\nLOW = 2\n\n[JOINT_0]\nHOME = 1\n";
        let new = with_sections(text, ("BOX_", "boxes"), &["[BOX_0]\nLOW = 3\n".into()]).unwrap();
        assert_eq!(
            new,
            "[KINS]\nKINEMATICS = pkmkins boxes=1 legs=strut:6\n\n# Start\n[BOX_0]\nLOW = 3\n# mine\n\n\n[JOINT_0]\nHOME = 1\n"
        );
        let none = with_sections(
            "[KINS]\nKINEMATICS = pkmkins\n",
            ("BOX_", "boxes"),
            &["[BOX_0]\nLOW = 3\n".into()],
        );
        assert_eq!(none.unwrap(), "[KINS]\nKINEMATICS = pkmkins boxes=1\n\n[BOX_0]\nLOW = 3\n");
    }
}
