// SPDX-License-Identifier: GPL-2.0-or-later
//! Machine INI files, in LinuxCNC's dialect.
//!
//! Lines are `[SECTION]`, `KEY = value`, empty, or comments starting with `#` or `;`;
//! other lines are skipped, as in LinuxCNC.
//! Everything after `=` is the value: LinuxCNC has no comments after values.
//! Sections that describe the machine are strict (see `check_section`); in all
//! others the first of repeated keys counts, as in LinuxCNC's own readers, unless the
//! machine depends on the value: then a repetition is refused.
//!
//! LinuxCNC 2.9 has two readers, and its start script first copies included files into the file.
//! The reader of its programs (`inivar` prints its values) joins a line that ends with a backslash to the
//! next one, reads 255 bytes of a line, and uses only the first of two sections of the same name.
//! The reader of its HAL files (haltcl) does none of this. If they differ, the file is ambiguous:
//! such a line is refused, or its value if the machine depends on it.
//! tests/inivar.rs compares this reader with `inivar`.

use crate::files::{self, AtFile};
use crate::read::{near, places};
use keys::{Key, Need, Range};
use std::borrow::Cow;
use std::fmt;
use std::path::{Path, PathBuf};

/// Longest line that LinuxCNC's programs read as one line (LINELEN of inifile.cc), bytes.
const LONGEST_LINE: usize = 255;

/// First word of a line that includes a file.
const INCLUDE: &str = "#INCLUDE";

/// Byte order mark that some editors write before the first line.
const MARK: char = '\u{feff}';

/// A line of a file, and the offending part of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Excerpt {
    /// The line.
    pub text: String,
    /// The offending part, in bytes of the line.
    pub part: std::ops::Range<usize>,
}

/// Why an INI file was refused: location, found text, expected text.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Problem {
    /// The file as the caller named it.
    pub file: PathBuf,
    /// Line, counted from 1; `None` if something is missing.
    pub line: Option<usize>,
    /// Section without brackets; empty if no section is concerned, as in a tool table.
    pub section: String,
    /// Key; empty if no key is concerned.
    pub key: String,
    /// The offending text, if there is one.
    pub found: Option<String>,
    /// The expected text, and a fix.
    pub expected: String,
    /// The line itself, if any.
    #[serde(skip)]
    pub excerpt: Option<Excerpt>,
}

impl Problem {
    /// Returns the problem without its location.
    pub fn message(&self) -> String {
        if self.section.is_empty() {
            let found = self.found.as_ref().map(|found| format!("{found}: ")).unwrap_or_default();
            return found + &self.expected;
        }
        let found = match &self.found {
            Some(found) if self.key.is_empty() => found.clone(),
            Some(found) => format!(" = {found}"),
            None => " is missing".into(),
        };
        format!("[{}]{}{found}: {}", self.section, self.key, self.expected)
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        write!(f, ": {}", self.message())
    }
}

/// An error of this module; boxed, because every reader returns it.
#[derive(Clone, Debug, PartialEq)]
pub struct IniError(pub Box<Problem>);

impl fmt::Display for IniError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl std::error::Error for IniError {}

impl IniError {
    fn at(mut self, line: &Line, part: &str) -> Self {
        self.0.file.clone_from(&line.file);
        self.0.line = Some(line.number);
        self.0.excerpt = Some(line.excerpt(part));
        self
    }
}

/// A line of the file or of an included file.
#[derive(Clone, Debug, PartialEq)]
struct Line {
    file: PathBuf,
    /// Counted from 1.
    number: usize,
    /// Text without its line end.
    text: String,
}

impl Line {
    /// Returns the line with one part of it, or with all of it if the part is not in it.
    fn excerpt(&self, part: &str) -> Excerpt {
        let text = self.text.trim_end();
        // Search for a value after its key, which may contain the same characters.
        let from = text.find('=').filter(|at| text[*at..].contains(part)).unwrap_or(0);
        let whole = text.len() - text.trim_start().len()..text.len();
        let part = match text[from..].find(part) {
            Some(at) if !part.is_empty() => from + at..from + at + part.len(),
            _ => whole,
        };
        Excerpt { text: text.into(), part }
    }

    /// Returns whether LinuxCNC's programs join the next line to this one. A blank or a
    /// carriage return after the backslash prevents it.
    fn goes_on(&self) -> bool {
        self.text.ends_with('\\')
    }

    fn is_comment(&self) -> bool {
        self.text.trim_start().starts_with(['#', ';'])
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
    /// First line.
    line: Line,
    /// Whether LinuxCNC's programs continue it on the next line.
    continued: bool,
    /// Whether an earlier section of the same name hides it from LinuxCNC's programs.
    hidden: bool,
}

/// A file as read, without interpretation.
#[derive(Clone, Debug)]
pub struct Ini {
    file: PathBuf,
    entries: Vec<Entry>,
    headings: Vec<(String, Line)>,
    /// Section and first word of lines without `=`, and the number of entries before them.
    unassigned: Vec<(String, String, usize)>,
    /// The text with included files; `None` if it includes none.
    expanded: Option<String>,
    /// The text of the file itself.
    text: String,
    /// Whether the text is complete: bytes that are not UTF-8 are replaced.
    is_whole: bool,
}

impl Ini {
    /// Reads a file and its included files.
    ///
    /// # Errors
    /// A file cannot be read, or LinuxCNC's readers differ on a line.
    pub fn read(file: &Path) -> Result<Self, IniError> {
        let text = files::read(file).map_err(|AtFile { error, .. }| {
            let expected =
                format!("cannot be read: {error}; give the path of the machine's INI file");
            Self::empty(file).error("", "", None, &expected)
        })?;
        let lossy = String::from_utf8_lossy(&text);
        Ok(Self { is_whole: matches!(lossy, Cow::Borrowed(_)), ..Self::parse(file, &lossy)? })
    }

    /// Parses text; `file` is its name in errors, and included files are searched for in its folder.
    ///
    /// # Errors
    /// As [`Ini::read`].
    pub fn parse(file: &Path, text: &str) -> Result<Self, IniError> {
        let mut ini = Self { text: text.into(), ..Self::empty(file) };
        let own: Vec<Line> = numbered(file, text);
        ini.refuse_mark(&own)?;
        let includes = own.iter().any(|line| line.text.starts_with(INCLUDE));
        let lines = if includes { ini.expand(own)? } else { own };
        if includes {
            ini.expanded = Some(lines.iter().map(|line| format!("{}\n", line.text)).collect());
        }
        let mut lines = lines.into_iter().peekable();
        while let Some(first) = lines.next() {
            let mut whole = first.text.clone();
            let mut continued = false;
            while whole.ends_with('\\') {
                let Some(next) = lines.next() else { break };
                ini.refuse_join(&first, &next)?;
                whole.pop();
                whole.push_str(&next.text);
                continued = true;
            }
            ini.take_line(first, &whole, continued)?;
        }
        Ok(ini)
    }

    fn empty(file: &Path) -> Self {
        Self {
            file: file.into(),
            entries: vec![],
            headings: vec![],
            unassigned: vec![],
            expanded: None,
            text: String::new(),
            is_whole: true,
        }
    }

    /// Returns the lines as LinuxCNC's start script copies them: it reads the file with the shell's
    /// `read`, which removes backslashes, and copies included files unchanged.
    fn expand(&self, own: Vec<Line>) -> Result<Vec<Line>, IniError> {
        let mut lines = vec![];
        let mut own = own.into_iter();
        while let Some(mut line) = own.next() {
            while line.goes_on() {
                line.text.pop();
                line.text.push_str(&own.next().map_or(String::new(), |next| next.text));
            }
            line.text = without_escapes(&line.text);
            let mut words = line.text.trim().splitn(2, [' ', '\t']);
            if words.next() != Some(INCLUDE) {
                // The script inserts a blank between the first word and the rest.
                line.text.push(' ');
                lines.push(line);
                continue;
            }
            lines.extend(self.included(&line, words.next().unwrap_or("").trim())?);
        }
        Ok(lines)
    }

    fn included(&self, line: &Line, name: &str) -> Result<Vec<Line>, IniError> {
        let refuse = |expected: &str| self.error("", "", None, expected).at(line, name);
        if name.is_empty() {
            return Err(refuse("expected a file name after #INCLUDE"));
        }
        // The start script passes the name to the shell.
        if name.contains(['$', '`', '*', '?', '[', '"', '\'', '(', '&', ';', '|', '<', '>']) {
            return Err(refuse("expected a plain file name: the shell would expand this one"));
        }
        let file = places::named(&self.file, name);
        let text = files::read(&file).map_err(|AtFile { error, .. }| {
            refuse(&format!("cannot be read: {error}; LinuxCNC would start without these lines, so correct the name"))
        })?;
        Ok(numbered(&file, &String::from_utf8_lossy(&text)))
    }

    /// Refuses a joined line on which LinuxCNC's readers differ, for any use of the value.
    fn refuse_join(&self, line: &Line, next: &Line) -> Result<(), IniError> {
        let refuse = |expected: &str| Err(self.error("", "", None, expected).at(line, "\\"));
        if next.text.trim_start().starts_with('[') {
            return refuse(
                "the backslash joins the section heading below to this line; remove the backslash",
            );
        }
        let is_entry = !line.is_comment() && line.text.contains('=');
        if !is_entry && !next.text.trim().is_empty() {
            return refuse(
                "the backslash joins the next line for LinuxCNC's programs, but not for its HAL files; \
                 remove the backslash",
            );
        }
        Ok(())
    }

    fn take_line(&mut self, line: Line, whole: &str, continued: bool) -> Result<(), IniError> {
        let text = whole.trim();
        self.refuse_long(&line)?;
        if self.headings.is_empty() {
            self.refuse_before_sections(&line)?;
        }
        if text.is_empty() || line.is_comment() {
            return Ok(());
        }
        if text.starts_with('[') {
            let expected = "expected a section heading such as [PKM] and nothing else on the line";
            let name = heading(text)
                .ok_or_else(|| self.error("", "", None, expected).at(&line, text))?
                .to_string();
            self.headings.push((name, line));
            return Ok(());
        }
        let section = self.headings.last().map_or("", |(name, _)| name);
        if let Some((key, value)) = text.split_once('=') {
            let named = self.headings.iter().filter(|(name, _)| name == section);
            self.entries.push(Entry {
                section: section.to_string(),
                key: key.trim().to_string(),
                value: value.trim().to_string(),
                line,
                continued,
                hidden: named.count() > 1,
            });
        } else if let Some((word, _)) = whole.trim_start().split_once([' ', '\t']) {
            self.unassigned.push((section.to_string(), word.to_string(), self.entries.len()));
        }
        Ok(())
    }

    /// Refuses a key before the first section: LinuxCNC's interpreter of HAL files treats every line with `=` and no
    /// `#` before it as a key of the section above, even a comment with `;`, and aborts if there is no section.
    fn refuse_before_sections(&self, line: &Line) -> Result<(), IniError> {
        match line.text.split_once('=') {
            Some((key, _)) if !key.trim().is_empty() && !key.contains('#') => {
                let expected = "expected a section heading first: LinuxCNC's haltcl reads this line as a key and fails; \
                                start comments with #";
                Err(self.error("", "", None, expected).at(line, line.text.trim()))
            }
            _ => Ok(()),
        }
    }

    /// Refuses a byte order mark: LinuxCNC's programs read it as part of the first line.
    fn refuse_mark(&self, lines: &[Line]) -> Result<(), IniError> {
        let marked = lines.first().and_then(|line| Some((line, line.text.strip_prefix(MARK)?)));
        match marked {
            Some((line, text)) if text.trim_start().starts_with('[') || text.contains('=') => {
                let expected = "this line starts with a byte order mark, so LinuxCNC does not recognize it; save \
                                the file as UTF-8 without BOM";
                Err(self.error("", "", None, expected).at(line, text.trim()))
            }
            _ => Ok(()),
        }
    }

    /// Refuses a line too long for LinuxCNC's programs, which read the rest as another line.
    fn refuse_long(&self, line: &Line) -> Result<(), IniError> {
        let rest = line.text.as_bytes().get(LONGEST_LINE..).unwrap_or_default();
        let section = self.headings.last().map_or("", |(name, _)| name);
        let is_harmless = !rest.iter().any(|b| b"=[".contains(b));
        if rest.is_empty() || (is_harmless && (line.is_comment() || is_of_hal(section))) {
            return Ok(());
        }
        let expected = format!(
            "LinuxCNC reads {LONGEST_LINE} bytes of a line and treats the rest as another line; shorten it"
        );
        Err(self.error("", "", None, &expected).at(line, ""))
    }

    /// Returns the value that LinuxCNC's programs read for this key (as `inivar` prints it).
    pub fn as_inivar(&self, section: &str, key: &str) -> Option<&str> {
        let is_it = |e: &Entry| e.section == section && !e.hidden && e.key == key;
        let place = self.entries.iter().position(is_it)?;
        // They stop at a line that begins with the key and a blank, and has no `=`.
        let is_stop = |(own, word, before): &(String, String, usize)| {
            own == section && word == key && *before <= place
        };
        if self.unassigned.iter().any(is_stop) {
            return None;
        }
        Some(self.entries[place].value.as_str()).filter(|value| !value.is_empty())
    }

    /// Returns section, key and value of every line that LinuxCNC's haltcl reads, in file order. It does not join
    /// lines, and reads a comment with `;` and `=` as a key.
    pub fn as_haltcl(&self) -> impl Iterator<Item = (&str, &str, &str)> {
        let mut section = "";
        self.expanded().unwrap_or(&self.text).split('\n').filter_map(move |line| {
            let line = line.trim();
            if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
                section = name;
                return None;
            }
            let (key, value) = line.split_once('=')?;
            let key = key.trim_end();
            let is_key = !key.is_empty() && !key.contains('#');
            is_key.then_some((section, key, value.trim_start()))
        })
    }

    /// Returns the text with included files, as LinuxCNC's start script writes it; `None` if
    /// it includes none.
    pub fn expanded(&self) -> Option<&str> {
        self.expanded.as_deref()
    }

    /// Returns the text of the file itself, as it was read.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the text of the file itself, to be written with other values.
    ///
    /// # Errors
    /// A line is not UTF-8 and would be lost.
    pub fn editable(&self) -> Result<&str, IniError> {
        if self.is_whole {
            return Ok(&self.text);
        }
        let is_replaced = |line: &Line| line.text.contains(char::REPLACEMENT_CHARACTER);
        let expected = "this line is not UTF-8 and would be lost: convert the file first, for example with \
                        iconv -f latin1 -t utf-8";
        let error = self.error("", "", None, expected);
        Err(match numbered(&self.file, &self.text).iter().find(|line| is_replaced(line)) {
            Some(line) => error.at(line, line.text.trim()),
            None => error,
        })
    }

    /// Returns the file as the caller named it.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Returns the names of all sections, in file order.
    pub fn sections(&self) -> impl Iterator<Item = &str> {
        self.headings.iter().map(|(name, _)| name.as_str())
    }

    /// Returns every entry, in file order.
    pub fn entries(&self) -> impl Iterator<Item = &Entry> {
        self.entries.iter()
    }

    /// Returns the first entry of this key that LinuxCNC's programs read.
    pub fn first(&self, section: &str, key: &str) -> Option<&Entry> {
        self.all(section, key).into_iter().find(|entry| !entry.hidden)
    }

    /// Returns all entries of this key.
    pub fn all(&self, section: &str, key: &str) -> Vec<&Entry> {
        self.entries.iter().filter(|e| e.section == section && e.key == key).collect()
    }

    /// Returns the entry of this key.
    ///
    /// # Errors
    /// The key is missing, with `expected` as the expected value, or repeated.
    pub fn require(&self, section: &str, key: &str, expected: &str) -> Result<&Entry, IniError> {
        self.only(section, key)?.ok_or_else(|| self.missing(section, key, expected))
    }

    /// Returns the error of a missing key, at a key that may be its misspelling.
    fn missing(&self, section: &str, key: &str, expected: &str) -> IniError {
        let own = self.entries.iter().filter(|entry| entry.section == section);
        let meant = own
            .filter(|entry| near::word(&entry.key, [key]).is_some())
            .find(|entry| near::key(section, &entry.key).is_none_or(|meant| meant == key));
        match meant {
            Some(entry) if !is_known(section, &entry.key) => {
                let text = format!("{expected}; did you mean this line, {}?", entry.key);
                self.error(section, key, None, &text).at(&entry.line, &entry.key)
            }
            _ if self.headings.iter().all(|(name, _)| name != section) => {
                let IniError(problem) = self.missing_section(section, expected);
                IniError(Box::new(Problem { key: key.into(), ..*problem }))
            }
            _ => self.error(section, key, None, expected),
        }
    }

    /// Returns the entry of an optional key and refuses a repeated one: readers differ in which
    /// of two they use.
    fn only(&self, section: &str, key: &str) -> Result<Option<&Entry>, IniError> {
        let all = self.all(section, key);
        match all.as_slice() {
            [] => Ok(None),
            [only] if only.hidden && !is_of_hal(section) => {
                let text = format!(
                    "LinuxCNC's programs read only the first section [{section}]; move the line there"
                );
                Err(self.refuse(only, &text))
            }
            [only] => Ok(Some(only)),
            [first, .., last] => {
                let Line { file, number, .. } = &first.line;
                let place = match *file == last.line.file {
                    true => format!("line {number}"),
                    false => format!("{}:{number}", file.display()),
                };
                let count = all.len();
                let text =
                    format!("the key is given {count} times, first in {place}; keep one of them");
                Err(self.refuse(last, &text))
            }
        }
    }

    /// Refuses keys that are not in `keys`, and repeated keys.
    ///
    /// # Errors
    /// The first entry that does not belong in the section.
    pub fn check_section(&self, section: &str, keys: &[&str]) -> Result<(), IniError> {
        let known = format!("known keys are {}", keys.join(" "));
        for entry in self.entries.iter().filter(|e| e.section == section) {
            if !keys.contains(&entry.key.as_str()) {
                let meant = near::word(&entry.key, keys.iter().copied());
                let meant =
                    meant.map(|meant| format!(" (did you mean {meant}?)")).unwrap_or_default();
                return Err(self.refuse_key(entry, &format!("unknown key{meant}; {known}")));
            }
            self.only(section, &entry.key)?;
        }
        Ok(())
    }

    /// Refuses keys that are not in the table, and repeated keys.
    ///
    /// # Errors
    /// As [`Ini::check_section`].
    pub fn check_keys<'a>(
        &self,
        section: &str,
        keys: impl Iterator<Item = &'a Key>,
    ) -> Result<(), IniError> {
        self.check_section(section, &keys.map(|key| key.name).collect::<Vec<_>>())
    }

    /// Returns the numbers of a key of the table, `None` if it is missing and optional.
    ///
    /// # Errors
    /// It is missing and required, as [`Ini::numbers`], or a number is out of range.
    pub fn values<const N: usize>(
        &self,
        section: &str,
        key: &Key,
    ) -> Result<Option<[f64; N]>, IniError> {
        assert_eq!(N, key.count(), "{} has another number of numbers", key.name);
        match self.only(section, key.name)? {
            None if key.need != Need::Needed => Ok(None),
            _ => self.require_values(section, key).map(Some),
        }
    }

    /// Returns the numbers of a key of the table that is required here.
    ///
    /// # Errors
    /// The key is missing, or as [`Ini::values`].
    pub fn require_values<const N: usize>(
        &self,
        section: &str,
        key: &Key,
    ) -> Result<[f64; N], IniError> {
        let entry = self.require(section, key.name, &expected_numbers(N))?;
        let values = self.numbers_of(entry)?;
        match entry.words().zip(values).all(|(word, value)| key.range.holds(word, value)) {
            true => Ok(values),
            false => Err(self.refuse(entry, &format!("expected {}", key.expected()))),
        }
    }

    /// Returns the index of a key's word among its allowed words, counted from 1.
    ///
    /// # Errors
    /// It is missing, repeated or another word.
    pub fn require_word(&self, section: &str, key: &Key) -> Result<usize, IniError> {
        let expected = format!("expected {}", key.expected());
        let entry = self.require(section, key.name, &expected)?;
        let Range::Word(words) = key.range else { return Err(self.refuse(entry, &expected)) };
        let place = words.iter().position(|word| *word == entry.value);
        place.map(|place| place + 1).ok_or_else(|| self.refuse(entry, &expected))
    }

    /// Returns the index of the word of an optional key, as [`Ini::require_word`].
    ///
    /// # Errors
    /// As [`Ini::require_word`].
    pub fn word(&self, section: &str, key: &Key) -> Result<Option<usize>, IniError> {
        match self.only(section, key.name)? {
            None => Ok(None),
            Some(_) => self.require_word(section, key).map(Some),
        }
    }

    /// Returns a hash, in either of its notations.
    ///
    /// # Errors
    /// It is missing, repeated or not a hash.
    pub fn require_hash(&self, section: &str, key: &Key) -> Result<u32, IniError> {
        let expected = format!("expected {}", key.expected());
        let entry = self.require(section, key.name, &expected)?;
        keys::hash(&entry.value).ok_or_else(|| self.refuse(entry, &expected))
    }

    /// Returns the single number of a key of the table, `None` as in [`Ini::values`].
    ///
    /// # Errors
    /// As [`Ini::values`].
    pub fn value(&self, section: &str, key: &Key) -> Result<Option<f64>, IniError> {
        Ok(self.values::<1>(section, key)?.map(|[value]| value))
    }

    /// Returns the single number of a key of the table that is required here.
    ///
    /// # Errors
    /// As [`Ini::require_values`].
    pub fn require_value(&self, section: &str, key: &Key) -> Result<f64, IniError> {
        self.require_values::<1>(section, key).map(|[value]| value)
    }

    /// Returns the numbers of this key, `None` if the key is missing.
    ///
    /// # Errors
    /// Not exactly `N` plain decimal numbers separated by spaces, or a repeated key.
    pub fn numbers<const N: usize>(
        &self,
        section: &str,
        key: &str,
    ) -> Result<Option<[f64; N]>, IniError> {
        self.only(section, key)?.map(|entry| self.numbers_of(entry)).transpose()
    }

    /// Returns the numbers of this key.
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

    /// Returns the number of this key, or `default` if the key is missing.
    ///
    /// # Errors
    /// As [`Ini::numbers`].
    pub fn number_or(&self, section: &str, key: &str, default: f64) -> Result<f64, IniError> {
        Ok(self.numbers::<1>(section, key)?.map_or(default, |[value]| value))
    }

    /// Parses the entry's value as exactly `N` numbers.
    fn numbers_of<const N: usize>(&self, entry: &Entry) -> Result<[f64; N], IniError> {
        let expected = expected_numbers(N);
        if entry.continued {
            // HAL files include the backslash.
            let error = self.refuse(entry, &expected);
            return Err(error.at(&entry.line, "\\"));
        }
        let values = self.number_list(entry).ok_or_else(|| self.refuse_word(entry, &expected))?;
        <[f64; N]>::try_from(values).map_err(|_| self.refuse(entry, &expected))
    }

    /// Parses the entry's value as any number of numbers; `None` if a word is not a plain decimal number.
    pub fn number_list(&self, entry: &Entry) -> Option<Vec<f64>> {
        entry.words().map(decimal).collect()
    }

    /// Returns the error that refuses this entry.
    pub fn refuse(&self, entry: &Entry, expected: &str) -> IniError {
        let found = match entry.continued {
            true => entry.line.text.split_once('=').map_or("", |(_, value)| value.trim()),
            false => entry.value.as_str(),
        };
        let error = self.error(&entry.section, &entry.key, Some(found), expected);
        error.at(&entry.line, found)
    }

    /// Returns the same error, with the first word that is not a number as the offending part.
    fn refuse_word(&self, entry: &Entry, expected: &str) -> IniError {
        let error = self.refuse(entry, expected);
        match entry.words().find(|word| decimal(word).is_none()) {
            Some(word) => error.at(&entry.line, word),
            None => error,
        }
    }

    /// Returns the same error, with the key as the offending part.
    pub fn refuse_key(&self, entry: &Entry, expected: &str) -> IniError {
        self.refuse(entry, expected).at(&entry.line, &entry.key)
    }

    /// Returns the error that refuses a section (the last of this name), or reports it as missing.
    pub fn refuse_section(&self, section: &str, expected: &str) -> IniError {
        match self.headings.iter().rfind(|(name, _)| name == section) {
            Some((_, line)) => {
                self.error(section, "", Some(""), expected).at(line, line.text.trim())
            }
            None => self.missing_section(section, expected),
        }
    }

    /// Returns the error of a missing section, at a heading that may be its misspelling.
    fn missing_section(&self, section: &str, expected: &str) -> IniError {
        let is_meant = |name: &str| near::section(name).is_some_and(|meant| meant == section);
        match self.headings.iter().find(|(name, _)| is_meant(name)) {
            Some((name, line)) => {
                let text = format!("{expected}; did you mean this section, [{name}]?");
                self.error(section, "", None, &text).at(line, line.text.trim())
            }
            None => self.error(section, "", None, expected),
        }
    }

    /// Returns an error without a line.
    pub fn error(&self, section: &str, key: &str, found: Option<&str>, expected: &str) -> IniError {
        IniError(Box::new(Problem {
            file: self.file.clone(),
            line: None,
            section: section.into(),
            key: key.into(),
            found: found.map(Into::into),
            expected: expected.into(),
            excerpt: None,
        }))
    }
}

impl Entry {
    pub(super) fn words(&self) -> impl Iterator<Item = &str> {
        self.value.split([' ', '\t']).filter(|word| !word.is_empty())
    }
}

fn numbered(file: &Path, text: &str) -> Vec<Line> {
    // Not `lines`, which removes a carriage return.
    let mut lines: Vec<&str> = text.split('\n').collect();
    if lines.last() == Some(&"") {
        lines.pop();
    }
    let line =
        |(i, text): (usize, &str)| Line { file: file.into(), number: i + 1, text: text.into() };
    lines.into_iter().enumerate().map(line).collect()
}

/// Returns a line as the shell's `read` returns it, without escapes.
fn without_escapes(text: &str) -> String {
    let mut kept = String::new();
    let mut characters = text.chars();
    while let Some(c) = characters.next() {
        kept.extend(if c == '\\' { characters.next() } else { Some(c) });
    }
    kept
}

/// Returns whether a section has this key, so that it is not a misspelling.
fn is_known(section: &str, key: &str) -> bool {
    let legs = [keys::leg::ALL, keys::constraint::ALL, keys::chain::ALL];
    let own = [keys::machine::ALL, keys::workspace_box::ALL].into_iter().chain(legs);
    own.flatten().any(|known| known.name == key) || near::is_of_linuxcnc(section, key)
}

/// Returns whether only HAL files read the section: they join sections of the same name.
fn is_of_hal(section: &str) -> bool {
    section == "PKM" || section.starts_with("LEG_") || section.starts_with("BOX_")
}

/// Returns the name in a section heading. LinuxCNC's readers treat blanks and text next to it
/// differently, and may lose the section.
fn heading(line: &str) -> Option<&str> {
    let name = line.strip_prefix('[')?.strip_suffix(']')?;
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
    (!name.is_empty() && name.chars().all(plain)).then_some(name)
}

fn expected_numbers(count: usize) -> String {
    let what = match count {
        1 => "expected one decimal number".to_string(),
        _ => format!("expected {count} decimal numbers separated by spaces"),
    };
    format!("{what} and nothing else on the line; put comments on lines of their own")
}

/// Parses a plain decimal number: digits, a fraction, an exponent; a digit before or after the point may be missing.
/// Rejects hex, nan and inf: all readers of the file must agree on the value.
pub fn decimal(word: &str) -> Option<f64> {
    let unsigned = word.strip_prefix(['+', '-']).unwrap_or(word);
    let (mantissa, exponent) = unsigned.split_once(['e', 'E']).unwrap_or((unsigned, "0"));
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let exponent = exponent.strip_prefix(['+', '-']).unwrap_or(exponent);
    let digits = |text: &str| text.bytes().all(|b| b.is_ascii_digit());
    let has_digits = !(exponent.is_empty() || whole.is_empty() && fraction.is_empty());
    if !(has_digits && digits(whole) && digits(fraction) && digits(exponent)) {
        return None;
    }
    // A number too small for a double would silently become 0.
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
        for (word, value) in [
            ("1", 1.0),
            ("-0.5", -0.5),
            ("+2.0", 2.0),
            ("1e-3", 1e-3),
            ("010", 10.0),
            (".5", 0.5),
            ("-.25", -0.25),
            ("5.", 5.0),
            ("1.e1", 10.0),
        ] {
            assert_eq!(decimal(word), Some(value), "{word}");
        }
        for word in [
            "", "nan", "-inf", "0x10", "1e999", "1,5", "1\\", "e5", "-", ".", "-.", ".e1", "1e",
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
    fn the_offending_word_is_marked() {
        let error = ini("[LEG_2]\n BASE = 1 B 2\n").require_numbers::<3>("LEG_2", "BASE");
        let excerpt = error.unwrap_err().0.excerpt.unwrap();
        assert_eq!(excerpt, Excerpt { text: " BASE = 1 B 2".into(), part: 10..11 });
    }

    #[test]
    fn included_lines_stand_in_place_and_keep_their_file_and_line() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("x.inc"), "\nK = bad\n[B]\n").unwrap();
        let file = folder.path().join("m.ini");
        let ini = Ini::parse(&file, "[A]\n#INCLUDE x.inc\nK = 2\n").unwrap();
        assert_eq!(ini.numbers("B", "K"), Ok(Some([2.0])));
        let error = ini.numbers::<1>("A", "K").unwrap_err().to_string();
        assert!(error.contains("x.inc:2: [A]K = bad"), "{error}");
    }

    #[test]
    fn an_included_file_that_cannot_be_read_is_named_with_the_line_that_names_it() {
        for (line, part) in
            [("#INCLUDE none.inc", "none.inc"), ("#INCLUDE", "expected a file name")]
        {
            let text = Ini::parse(Path::new("m.ini"), line).unwrap_err().to_string();
            assert!(text.starts_with("m.ini:1: "), "{text}");
            let problem = Ini::parse(Path::new("m.ini"), line).unwrap_err();
            assert!(text.contains(part) || problem.0.excerpt.unwrap().text.contains(part));
        }
    }

    #[test]
    fn what_linuxcnc_reads_in_two_ways_is_refused() {
        for text in [
            "[A]\nK = 1 \\\n[B]\n",
            "[A]\n# note \\\nK = 1\n",
            &format!("[A]\nK = {}\n", "1".repeat(300)),
            &format!("[A]\n# {} K = 2\n", "x".repeat(300)),
            "; of 2026, version = 1\n[A]\nK = 1\n",
            "K = 1\n[A]\n",
        ] {
            assert!(Ini::parse(Path::new("m.ini"), text).is_err(), "{text}");
        }
        for text in ["[J]\nK = 1 \\\n2\n", "[J]\n[A]\n[J]\nK = 1\n"] {
            assert!(ini(text).numbers::<2>("J", "K").is_err(), "{text}");
        }
    }
}
