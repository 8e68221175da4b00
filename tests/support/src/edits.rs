// SPDX-License-Identifier: GPL-2.0-or-later
//! Edits of INI files, as the lists of cases specify them.

use serde::Deserialize;

/// A change of a section or a key of a file.
#[derive(Deserialize)]
#[serde(from = "Written")]
pub struct Edit {
    section: String,
    change: Change,
}

enum Change {
    Key(String, Vec<String>),
    Append(Vec<String>),
    Remove,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Written {
    Text(String),
    Key { section: String, key: String, lines: Vec<String> },
    Append { section: String, append: Vec<String> },
}

impl From<Written> for Edit {
    fn from(written: Written) -> Self {
        let text = match written {
            Written::Key { section, key, lines } => {
                return Self { section, change: Change::Key(key, lines) };
            }
            Written::Append { section, append } => {
                return Self { section, change: Change::Append(append) };
            }
            Written::Text(text) => text,
        };
        let (section, rest) = text[1..].split_once(']').unwrap();
        let lines = |text: &str| text.split('\n').map(String::from).collect();
        let change = match (rest, rest.strip_prefix('+'), rest.split_once('=')) {
            ("-", ..) => Change::Remove,
            (_, Some(more), _) => Change::Append(lines(more)),
            (_, None, Some((key, _))) => Change::Key(key.trim().into(), lines(rest)),
            (key, None, None) => Change::Key(key.into(), vec![]),
        };
        Self { section: section.into(), change }
    }
}

fn is_key(line: &str, key: &str) -> bool {
    line.split_once('=').is_some_and(|(name, _)| name.trim() == key)
}

/// Returns the first line of the section and the first line after it.
fn bounds(lines: &[String], section: &str) -> Option<(usize, usize)> {
    let start = lines.iter().position(|line| line.trim() == format!("[{section}]"))?;
    let length = lines[start + 1..].iter().position(|line| line.starts_with('['));
    Some((start, length.map_or(lines.len(), |length| start + 1 + length)))
}

pub fn apply(lines: &mut Vec<String>, edit: &Edit) {
    let (start, end) = bounds(lines, &edit.section).unwrap_or_else(|| {
        lines.push(format!("[{}]", edit.section));
        (lines.len() - 1, lines.len())
    });
    match &edit.change {
        Change::Remove => drop(lines.drain(start..end)),
        Change::Append(more) => drop(lines.splice(end..end, more.iter().cloned())),
        Change::Key(key, new) => {
            let mut body: Vec<String> = lines[start + 1..end].to_vec();
            let place = body.iter().position(|line| is_key(line, key)).unwrap_or(body.len());
            body.retain(|line| !is_key(line, key));
            body.splice(place..place, new.iter().cloned());
            lines.splice(start + 1..end, body);
        }
    }
}
