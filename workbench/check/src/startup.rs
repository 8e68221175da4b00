// SPDX-License-Identifier: GPL-2.0-or-later
//! The startup code of programs: settings that it leaves open, and text that is not a block.

use crate::findings::Report;
use machine::read::diagnostic::Severity;
use machine::read::mechanism::Mechanism;

/// Checks all of it.
pub(super) fn check(report: &mut Report, config: &Mechanism) {
    let Some(entry) = config.ini.first("RS274NGC", "RS274NGC_STARTUP_CODE") else { return };
    if let Some(rest) = comment(&entry.value) {
        let text = format!(
            "LinuxCNC reads # as a parameter, rejects \"{rest}\" and cannot be switched on: put \
             comments on separate lines, or after ;"
        );
        return report.finding(Severity::Error, config.ini.refuse(entry, &text));
    }
    // LinuxCNC checks parameters, expressions, remarks and calls.
    if entry.value.contains(['#', '[', '(', ';', '<']) {
        return;
    }
    let block: String = entry.value.to_uppercase().split_whitespace().collect();
    let words = words(&block);
    if let Some((letter, number)) = words.iter().find(|(_, number)| number.parse::<f64>().is_err())
    {
        let text = format!("LinuxCNC rejects {letter}{number}: expected a letter and a number");
        report.finding(Severity::Error, config.ini.refuse(entry, &text));
        return;
    }
    let (other, own) = if config.units_per_mm == 1.0 { ("20", "21") } else { ("21", "20") };
    let meant = [
        (other, format!("another unit than the machine's {}", config.length_unit()), own),
        ("91", "distances from the current position".into(), "90"),
        ("93", "inverse time, not speeds".into(), "94"),
    ];
    for (number, taken, expected) in meant {
        if words.contains(&("G", number)) {
            let text = format!(
                "programs without G{number} and G{expected} are read in {taken}: expected G{expected}"
            );
            report.finding(Severity::Warning, config.ini.refuse(entry, &text));
        }
    }
}

/// Returns the text after a # that begins no parameter: a comment in files of other programs, but not in LinuxCNC's.
fn comment(value: &str) -> Option<&str> {
    let code = value.split([';', '(']).next().unwrap_or_default();
    let begins = |c: char| c.is_ascii_digit() || "<#[".contains(c);
    code.match_indices('#')
        .map(|(at, _)| code[at + 1..].trim())
        .find(|rest| !rest.starts_with(begins))
}

/// Returns the letters of a block without blanks, each with its number; text before the first one has no letter.
fn words(block: &str) -> Vec<(&str, &str)> {
    let starts = block.char_indices().filter(|(_, c)| c.is_ascii_alphabetic()).map(|(n, _)| n);
    let starts: Vec<usize> = starts.collect();
    let first = starts.first().copied().unwrap_or(block.len());
    let ends = starts.iter().skip(1).copied().chain([block.len()]);
    let words = starts.iter().zip(ends).map(|(n, end)| (&block[*n..=*n], &block[n + 1..end]));
    (first > 0).then_some(("", &block[..first])).into_iter().chain(words).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comment_is_distinguished_from_a_parameter() {
        assert_eq!(comment("G21 # mm"), Some("mm"));
        assert_eq!(comment("G21 #"), Some(""));
        for code in
            ["G21 F#1", "F # 5220", "F#<_rate>", "F##2", "F#[1+2]", "G21 ; # mm", "G21 (# mm)"]
        {
            assert_eq!(comment(code), None, "{code}");
        }
    }

    #[test]
    fn a_block_falls_into_letters_with_their_numbers() {
        assert_eq!(words("G21G64P0.01"), [("G", "21"), ("G", "64"), ("P", "0.01")]);
        assert_eq!(words("21G1,5P"), [("", "21"), ("G", "1,5"), ("P", "")]);
        assert_eq!(words(""), []);
    }
}
