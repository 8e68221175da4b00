// SPDX-License-Identifier: GPL-2.0-or-later
//! Machine INI files, in LinuxCNC's dialect.
//!
//! Lines are `[SECTION]`, `KEY = value`, empty, or comments starting with `#` or `;`;
//! a line that is none of these is skipped, as LinuxCNC does.
//! Everything after `=` is the value: LinuxCNC knows no comments behind values.
//! Sections that describe the machine are strict (see [`Ini::check_section`]); in all
//! others the first of repeated keys counts, as LinuxCNC's own readers have it, unless the
//! machine depends on the value: then a repetition is refused.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

/// Why an INI file was refused: where, what was found, what was expected.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// The file as it was named by the caller.
    pub file: PathBuf,
    /// Line, counted from 1; `None` where something is missing.
    pub line: Option<usize>,
    /// Section without brackets; empty where no section is concerned.
    pub section: String,
    /// Key; empty where no key is concerned.
    pub key: String,
    /// The offending text, if there is one.
    pub found: Option<String>,
    /// What was expected, and a way out.
    pub expected: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        write!(f, ": ")?;
        if !self.section.is_empty() {
            write!(f, "[{}]{}", self.section, self.key)?;
            match &self.found {
                Some(found) => write!(f, " = {found}")?,
                None => write!(f, " is missing")?,
            }
            write!(f, ": ")?;
        }
        write!(f, "{}", self.expected)
    }
}

/// The error of this module; boxed, because it travels through every reader.
#[derive(Clone, Debug, PartialEq)]
pub struct IniError(pub Box<Problem>);

impl fmt::Display for IniError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl std::error::Error for IniError {}

impl IniError {
    /// The same error at a line (counted from 1).
    pub fn at_line(mut self, line: usize) -> Self {
        self.0.line = Some(line);
        self
    }
}

/// One `KEY = value` line.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Section without brackets.
    pub section: String,
    /// Key as written.
    pub key: String,
    /// Text after `=`, without blanks around it.
    pub value: String,
    /// Line, counted from 1.
    pub line: usize,
}

/// A file as read: nothing is interpreted yet.
#[derive(Clone, Debug)]
pub struct Ini {
    file: PathBuf,
    entries: Vec<Entry>,
    sections: Vec<(String, usize)>,
}

impl Ini {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read, or it includes another file.
    pub fn read(file: &Path) -> Result<Self, IniError> {
        let text = fs::read(file).map_err(|error| {
            let expected = format!("cannot be read: {error}; name the machine's INI file");
            Self::empty(file).error("", "", None, &expected)
        })?;
        Self::parse(file, &String::from_utf8_lossy(&text))
    }

    /// Reads text; `file` only names it in errors.
    ///
    /// # Errors
    /// The text includes another file, or a section heading is malformed.
    pub fn parse(file: &Path, text: &str) -> Result<Self, IniError> {
        let mut ini = Self::empty(file);
        let mut section = String::new();
        for (i, line) in text.lines().enumerate() {
            ini.take_line(line.trim(), i + 1, &mut section)?;
        }
        Ok(ini)
    }

    fn empty(file: &Path) -> Self {
        Self { file: file.into(), entries: vec![], sections: vec![] }
    }

    fn take_line(
        &mut self,
        line: &str,
        number: usize,
        section: &mut String,
    ) -> Result<(), IniError> {
        if line.starts_with("#INCLUDE") {
            let expected = "included files are not followed; name the file that LinuxCNC \
                            expands it to (its name ends in .expanded)";
            return Err(self.error("", "", None, expected).at_line(number));
        }
        if line.is_empty() || line.starts_with(['#', ';']) {
            return Ok(());
        }
        if line.starts_with('[') {
            let expected = "expected a section heading such as [PKM] and nothing else on the line";
            let name = heading(line)
                .ok_or_else(|| self.error("", "", Some(line), expected).at_line(number))?;
            *section = name.to_string();
            self.sections.push((name.to_string(), number));
            return Ok(());
        }
        if let Some((key, value)) = line.split_once('=') {
            self.entries.push(Entry {
                section: section.clone(),
                key: key.trim().to_string(),
                value: value.trim().to_string(),
                line: number,
            });
        }
        Ok(())
    }

    /// The file as it was named by the caller.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Names of all sections with the lines they start at, in the order of the file.
    pub fn sections(&self) -> &[(String, usize)] {
        &self.sections
    }

    /// First entry of this key.
    pub fn first(&self, section: &str, key: &str) -> Option<&Entry> {
        self.entries.iter().find(|e| e.section == section && e.key == key)
    }

    /// The entry of this key.
    ///
    /// # Errors
    /// The key is missing, and `expected` says what it should hold, or repeated.
    pub fn require(&self, section: &str, key: &str, expected: &str) -> Result<&Entry, IniError> {
        self.only(section, key)?.ok_or_else(|| self.error(section, key, None, expected))
    }

    /// The entry of a key that may be missing, but not repeated: readers differ in which
    /// of two they take.
    fn only(&self, section: &str, key: &str) -> Result<Option<&Entry>, IniError> {
        let all: Vec<&Entry> =
            self.entries.iter().filter(|e| e.section == section && e.key == key).collect();
        match all.as_slice() {
            [] => Ok(None),
            [only] => Ok(Some(only)),
            [first, .., last] => {
                let (count, line) = (all.len(), first.line);
                let text = format!(
                    "the key is given {count} times, first in line {line}; keep one of them"
                );
                Err(self.refuse(last, &text))
            }
        }
    }

    /// Refuses keys that are not in `keys`, and repeated keys.
    ///
    /// # Errors
    /// The first entry that does not belong into the section.
    pub fn check_section(&self, section: &str, keys: &[&str]) -> Result<(), IniError> {
        let known = format!("known keys are {}", keys.join(" "));
        for entry in self.entries.iter().filter(|e| e.section == section) {
            if !keys.contains(&entry.key.as_str()) {
                return Err(self.refuse(entry, &format!("unknown key; {known}")));
            }
            self.only(section, &entry.key)?;
        }
        Ok(())
    }

    /// Numbers of this key, `None` if the key is missing.
    ///
    /// # Errors
    /// Not exactly `N` plain decimal numbers separated by blanks, or a repeated key.
    pub fn numbers<const N: usize>(
        &self,
        section: &str,
        key: &str,
    ) -> Result<Option<[f64; N]>, IniError> {
        self.only(section, key)?.map(|entry| self.numbers_of(entry)).transpose()
    }

    /// Numbers of this key.
    ///
    /// # Errors
    /// The key is missing, or as [`Ini::numbers`].
    pub fn require_numbers<const N: usize>(
        &self,
        section: &str,
        key: &str,
    ) -> Result<[f64; N], IniError> {
        self.numbers_of(self.require(section, key, &expected_numbers(N))?)
    }

    /// A number of this key, or `default` if the key is missing.
    ///
    /// # Errors
    /// As [`Ini::numbers`].
    pub fn number_or(&self, section: &str, key: &str, default: f64) -> Result<f64, IniError> {
        Ok(self.numbers::<1>(section, key)?.map_or(default, |[value]| value))
    }

    /// The entry's value as exactly `N` numbers.
    fn numbers_of<const N: usize>(&self, entry: &Entry) -> Result<[f64; N], IniError> {
        self.number_list(entry)
            .and_then(|values| <[f64; N]>::try_from(values).ok())
            .ok_or_else(|| self.refuse(entry, &expected_numbers(N)))
    }

    /// The entry's value as numbers, however many; `None` if a word is no plain decimal number.
    pub fn number_list(&self, entry: &Entry) -> Option<Vec<f64>> {
        let words = entry.value.split([' ', '\t']).filter(|word| !word.is_empty());
        words.map(decimal).collect()
    }

    /// The error that refuses this entry.
    pub fn refuse(&self, entry: &Entry, expected: &str) -> IniError {
        let found = Some(entry.value.as_str());
        self.error(&entry.section, &entry.key, found, expected).at_line(entry.line)
    }

    /// An error without a line.
    pub fn error(&self, section: &str, key: &str, found: Option<&str>, expected: &str) -> IniError {
        IniError(Box::new(Problem {
            file: self.file.clone(),
            line: None,
            section: section.into(),
            key: key.into(),
            found: found.map(Into::into),
            expected: expected.into(),
        }))
    }
}

/// Name in a section heading. LinuxCNC's readers differ in what they make of blanks and
/// of text beside it, up to losing the section.
fn heading(line: &str) -> Option<&str> {
    let name = line.strip_prefix('[')?.strip_suffix(']')?;
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
    (!name.is_empty() && name.chars().all(plain)).then_some(name)
}

fn expected_numbers(count: usize) -> String {
    let what = match count {
        1 => "expected one decimal number".to_string(),
        _ => format!("expected {count} decimal numbers separated by blanks"),
    };
    format!("{what} and nothing else on the line; put comments on lines of their own")
}

/// A plain decimal number: digits, a fraction, an exponent. No hex, nan or inf, no
/// "5." or ".5": text that means the same to every reader of the file.
pub fn decimal(word: &str) -> Option<f64> {
    let unsigned = word.strip_prefix(['+', '-']).unwrap_or(word);
    let (mantissa, exponent) = unsigned.split_once(['e', 'E']).unwrap_or((unsigned, "0"));
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, "0"));
    let exponent = exponent.strip_prefix(['+', '-']).unwrap_or(exponent);
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    if !(digits(whole) && digits(fraction) && digits(exponent)) {
        return None;
    }
    // A number too small for a double would silently be none at all.
    let is_nothing = mantissa.bytes().all(|b| matches!(b, b'0' | b'.'));
    word.parse().ok().filter(|value: &f64| value.is_finite() && (*value != 0.0 || is_nothing))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ini(text: &str) -> Ini {
        Ini::parse(Path::new("m.ini"), text).unwrap()
    }

    #[test]
    fn decimal_takes_plain_numbers_only() {
        for (word, value) in
            [("1", 1.0), ("-0.5", -0.5), ("+2.0", 2.0), ("1e-3", 1e-3), ("010", 10.0)]
        {
            assert_eq!(decimal(word), Some(value), "{word}");
        }
        for word in [
            "", "nan", "-inf", "0x10", "1e999", "1,5", "1\\", "e5", "-", ".5", "5.", "1.e1", "1e",
            "+-1",
        ] {
            assert_eq!(decimal(word), None, "{word}");
        }
    }

    #[test]
    fn a_number_is_read_past_comment_lines_and_other_sections() {
        let ini = ini("[A]\n# K = 0\n; K = 0\n K=1 \n[B]\nK = 3\n");
        assert_eq!(ini.numbers("A", "K"), Ok(Some([1.0])));
        assert_eq!(ini.numbers("B", "K"), Ok(Some([3.0])));
        assert_eq!(ini.numbers::<1>("B", "L"), Ok(None));
    }

    #[test]
    fn a_repeated_key_is_refused_where_its_value_counts() {
        let ini = ini("[A]\nK = 1\nK = 1\n");
        assert!(ini.numbers::<1>("A", "K").unwrap_err().to_string().contains("m.ini:3"));
        assert!(ini.require("A", "K", "").is_err());
    }

    #[test]
    fn error_names_file_line_section_key_text_and_expectation() {
        let error = ini("[LEG_2]\nBASE = 1 2 # mm\n").require_numbers::<3>("LEG_2", "BASE");
        let text = error.unwrap_err().to_string();
        let start = "m.ini:2: [LEG_2]BASE = 1 2 # mm: expected 3 decimal numbers";
        assert!(text.starts_with(start), "{text}");
    }

    #[test]
    fn missing_key_is_named() {
        let text = ini("").require_numbers::<3>("LEG_2", "BASE").unwrap_err().to_string();
        assert!(text.starts_with("m.ini: [LEG_2]BASE is missing: expected 3 decimal"), "{text}");
    }

    #[test]
    fn strict_section_refuses_unknown_and_repeated_keys() {
        for text in ["[P]\nX = 1\n", "[P]\nK = 1\n[P]\nK = 1\n"] {
            assert!(ini(text).check_section("P", &["K"]).is_err(), "{text}");
        }
        assert!(ini("[P]\nK = 1\n").check_section("P", &["K"]).is_ok());
    }

    #[test]
    fn includes_are_refused() {
        assert!(Ini::parse(Path::new("m.ini"), "#INCLUDE other.inc\n").is_err());
    }
}
