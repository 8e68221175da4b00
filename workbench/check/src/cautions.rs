// SPDX-License-Identifier: GPL-2.0-or-later
//! Properties of a program or a machine that no limit covers: a disabled guard, feeds that it
//! cannot reduce, units that the program does not set.

use machine::read::facts::FileFacts;
use serde::Serialize;

/// Spindle-synchronized motion, whose speed the spindle determines.
const SYNCHRONISED: [&str; 6] = ["G33", "G33.1", "G74", "G76", "G84", "G95"];

/// Words after which a program branches on an input.
const ASKING: [&str; 5] = ["G38.2", "G38.3", "G38.4", "G38.5", "M66"];

/// A warning before a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Caution {
    /// Line of the program; none for the machine.
    pub line: Option<u32>,
    /// Number of the file of the line, 0 for the program itself.
    pub file: usize,
    /// A sentence.
    pub text: String,
}

/// Returns the cautions for the texts of a program and of the files of its subroutines, and for its machine's
/// file.
pub fn cautions(config: &FileFacts, texts: &[impl AsRef<str>]) -> Vec<Caution> {
    let mut found = vec![];
    let forced =
        config.ini.first("TRAJ", "NO_FORCE_HOMING").is_some_and(|entry| entry.value != "0");
    if forced {
        let text = "[TRAJ]NO_FORCE_HOMING lets programs start before homing, when the pose is unknown; remove it";
        found.push(Caution { line: None, file: 0, text: text.into() });
    }
    if config.ini.first("HAL", "HALUI").is_some() {
        let text = "[HAL]HALUI: requests on its pins while the program runs are not judged";
        found.push(Caution { line: None, file: 0, text: text.into() });
    }
    let mut names_units = false;
    let mut says_m52 = false;
    let lines = texts.iter().enumerate().flat_map(|(file, text)| {
        text.as_ref().lines().enumerate().map(move |(n, line)| (file, n, line))
    });
    for (file, n, line) in lines {
        let words = words(line);
        let has = |word: &str| words.iter().any(|w| w == word);
        let mut tell = |text: String| found.push(Caution { line: Some(n as u32 + 1), file, text });
        if has("M52") && has("P0") {
            tell(
                "M52 P0 switches adaptive feed off, so the guard cannot slow the feed; remove it"
                    .into(),
            );
        }
        for word in SYNCHRONISED.into_iter().filter(|word| has(word)) {
            tell(format!(
                "{word} follows the spindle: neither feed override nor the guard can slow it"
            ));
        }
        for word in ASKING.into_iter().filter(|word| has(word)) {
            let taken = match word {
                "M66" => "the input is assumed never to switch",
                _ => "the probe is assumed never to touch",
            };
            tell(format!("{word}: the motion after it depends on an input; {taken}"));
        }
        names_units |= has("G20") || has("G21");
        says_m52 |= has("M52");
    }
    // A user who switches it off knows, and is shown the line.
    if !says_m52 {
        let text = format!(
            "the program has no M52 P1, so the guard cannot slow the feed: add it at the start (LinuxCNC {} \
             loses it in the startup code)",
            crate::linuxcnc()
        );
        found.push(Caution { line: None, file: 0, text });
    }
    if !names_units {
        let unit = config.length_unit();
        let text = format!(
            "the program has neither G20 nor G21, so its lengths are in the units of RS274NGC_STARTUP_CODE, \
             else in {unit}: add one of them"
        );
        found.push(Caution { line: None, file: 0, text });
    }
    found
}

/// Returns each caution once, with its first line and the number of the others.
pub fn once(found: Vec<Caution>) -> Vec<Caution> {
    let mut kept: Vec<(Caution, usize)> = vec![];
    for caution in found {
        match kept.iter_mut().find(|(known, _)| known.text == caution.text) {
            Some((_, more)) => *more += 1,
            None => kept.push((caution, 0)),
        }
    }
    let counted = kept.into_iter().map(|(caution, more)| {
        let more = match more {
            0 => String::new(),
            1 => "; also in 1 more line".into(),
            more => format!("; also in {more} more lines"),
        };
        Caution { text: caution.text + &more, ..caution }
    });
    counted.collect()
}

/// Returns the words of a line with plain numbers, such as `G33.1`: without comments, blanks, leading zeros
/// and zeros after the decimal point.
pub(crate) fn words(line: &str) -> Vec<String> {
    let mut words: Vec<String> = vec![];
    let mut in_comment = false;
    for c in line.chars() {
        match c {
            ';' if !in_comment => break,
            '(' => in_comment = true,
            ')' => in_comment = false,
            _ if in_comment || c.is_whitespace() => {}
            _ if c.is_ascii_digit() || c == '.' => {
                if let Some(word) = words.last_mut() {
                    word.push(c);
                }
            }
            _ => words.push(c.to_ascii_uppercase().to_string()),
        }
    }
    words.into_iter().map(plain).collect()
}

fn plain(word: String) -> String {
    let number = word.get(1..).and_then(|number| number.parse::<f64>().ok());
    number.map_or(word.clone(), |number| format!("{}{number}", &word[..1]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use machine::read::machine::MachineConfig;
    use std::path::Path;

    fn reported(program: &str) -> Vec<(Option<u32>, String)> {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/hexapod/hexapod.ini");
        let config = MachineConfig::read(&file).unwrap();
        let first = |text: String| text.split(' ').take(2).collect::<Vec<_>>().join(" ");
        cautions(&config, &[program]).into_iter().map(|c| (c.line, first(c.text))).collect()
    }

    #[test]
    fn words_are_found_however_they_are_written() {
        let line = |n, text: &str| (Some(n), text.to_string());
        let unguarded = || (None, "the program".to_string());
        assert_eq!(reported("g 021\nm52 p 0\n"), [line(2, "M52 P0")]);
        assert_eq!(reported("M52 P1 G20 G33.10 Z1"), [line(1, "G33.1 follows")]);
        assert_eq!(reported("G21\nM52 P1\n(G76) G1 X76 ; G95\nM52"), []);
        assert_eq!(reported("M52\nG1 X1 é"), [(None, "the program".into())]);
        assert_eq!(reported("G21 (M52 P1)"), [unguarded()]);
        let probed = reported("G21 M52 P1\nG38.20 Z1 F10\nM66 P0 L3 Q1\n");
        assert_eq!(probed, [line(2, "G38.2: the"), line(3, "M66: the")]);
    }

    #[test]
    fn a_caution_of_many_lines_is_given_once() {
        let caution = |line, text: &str| Caution { line: Some(line), file: 0, text: text.into() };
        let found = once(vec![caution(3, "a"), caution(4, "b"), caution(5, "a"), caution(9, "a")]);
        assert_eq!(found, [caution(3, "a; also in 2 more lines"), caution(4, "b")]);
    }

    #[test]
    fn files_of_subroutines_are_read_as_well() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/hexapod/hexapod.ini");
        let config = MachineConfig::read(&file).unwrap();
        let found = cautions(&config, &["G21 M52 P1\nO<s> call", "O<s> sub\nM52 P0\nO<s> endsub"]);
        assert_eq!(found.iter().map(|c| (c.file, c.line)).collect::<Vec<_>>(), [(1, Some(2))]);
    }
}
