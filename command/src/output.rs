// SPDX-License-Identifier: GPL-2.0-or-later
//! What a subcommand tells, and to whom: text for people or one JSON value for programs on standard
//! output, remarks and progress on standard error. Set once, from the command line.

use super::Verdict;
use super::failure::{self, Failure};
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::ffi::OsString;
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Mutex, OnceLock};

/// Of every JSON value, which docs/reference/json.md describes: raised where a field goes or changes its meaning.
const VERSION: u32 = 1;

/// Options that every subcommand has.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Options of every command")]
pub struct Settings {
    /// Output format: text, or one JSON value for programs (docs/reference/json.md)
    #[arg(long, global = true, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// Print findings only, without progress and statistics
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Use colors; auto means on a terminal, unless NO_COLOR is set
    #[arg(long, global = true, value_enum, value_name = "WHEN", default_value_t = clap::ColorChoice::Auto)]
    color: clap::ColorChoice,
}

/// Who reads standard output.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    Text,
    Json,
}

/// What is set, and the words of the subcommand that runs.
struct Chosen {
    settings: Settings,
    command: String,
}

static CHOSEN: OnceLock<Chosen> = OnceLock::new();

/// What is to be told as JSON at the end.
static ANSWER: Mutex<Option<Answer>> = Mutex::new(None);

enum Answer {
    /// Fields of the one object.
    Fields(Map<String, Value>),
    /// Objects of their own.
    List(Vec<Value>),
}

impl Settings {
    /// Of this command from now on.
    pub fn choose(&self, command: String) {
        let _ = CHOSEN.set(Chosen { settings: self.clone(), command });
    }
}

/// Colours of everything, of what the grammar of the command line says as well: before it is parsed.
pub fn choose_colours(words: impl Iterator<Item = OsString>) {
    let words: Vec<String> = words.map(|word| word.to_string_lossy().into_owned()).collect();
    let behind = words.iter().position(|word| word == "--color").and_then(|k| words.get(k + 1));
    let joined = words.iter().find_map(|word| word.strip_prefix("--color="));
    match joined.or(behind.map(String::as_str)) {
        Some("always") => anstream::ColorChoice::Always.write_global(),
        Some("never") => anstream::ColorChoice::Never.write_global(),
        _ => {}
    }
}

/// Whether standard output is for programs.
pub fn is_json() -> bool {
    CHOSEN.get().is_some_and(|chosen| chosen.settings.format == Format::Json)
}

/// Whether findings and results alone are wanted.
pub fn is_quiet() -> bool {
    CHOSEN.get().is_some_and(|chosen| chosen.settings.quiet)
}

/// Where text for people goes; nowhere where standard output is for programs.
pub fn people() -> Box<dyn Write> {
    match is_json() {
        true => Box::new(io::sink()),
        false => Box::new(anstream::stdout().lock()),
    }
}

/// Where facts go that are neither findings nor results.
pub fn facts() -> Box<dyn Write> {
    if is_quiet() { Box::new(io::sink()) } else { people() }
}

/// Tells on standard error how it went: how much was written, how fast.
pub fn remark(text: &str) {
    if !is_quiet() {
        // Nothing is left to do where standard error is closed.
        let _ = writeln!(anstream::stderr(), "{text}");
    }
}

/// Takes what a subcommand has found, for programs: the fields of an object, beside those that all have.
pub fn answer(found: &impl Serialize) -> Result<(), Failure> {
    if !is_json() {
        return Ok(());
    }
    let fields = match serde_json::to_value(found)? {
        Value::Object(fields) => fields,
        value => Map::from_iter([("answer".into(), value)]),
    };
    put(Answer::Fields(fields));
    Ok(())
}

/// Takes several answers, each with its verdict, for a list.
pub fn list(answers: Vec<(Verdict, Value)>) {
    let whole = |(verdict, found)| match found {
        Value::Object(fields) => object(verdict, fields),
        value => value,
    };
    put(Answer::List(answers.into_iter().map(whole).collect()));
}

fn put(answer: Answer) {
    *ANSWER.lock().expect("nobody panics with it") = Some(answer);
}

/// A table of numbers: for people CSV, a row at a time; for programs all rows when it is finished.
pub struct Table {
    columns: Vec<String>,
    out: csv::Writer<Box<dyn Write>>,
    rows: Vec<Vec<Option<f64>>>,
}

impl Table {
    /// Begins it with its header.
    pub fn new(columns: Vec<String>) -> Result<Self, Failure> {
        let mut out = csv::Writer::from_writer(people());
        out.write_record(&columns)?;
        Ok(Self { columns, out, rows: vec![] })
    }

    /// Adds a row; a cell without a number stays empty.
    pub fn row(&mut self, cells: Vec<Option<f64>>) -> Result<(), Failure> {
        if is_json() {
            self.rows.push(cells);
            return Ok(());
        }
        let word = |cell: Option<f64>| cell.map_or(String::new(), |value| value.to_string());
        Ok(self.out.write_record(cells.into_iter().map(word))?)
    }

    /// The end of it, for programs with the machine.
    pub fn finish(mut self, machine: &Path) -> Result<(), Failure> {
        self.out.flush()?;
        let Self { columns, rows, .. } = self;
        answer(&json!({ "machine": machine, "columns": columns, "rows": rows }))
    }
}

/// An object as programs get it: with version, command and verdict.
fn object(verdict: Verdict, fields: Map<String, Value>) -> Value {
    let command = CHOSEN.get().map_or("", |chosen| &chosen.command);
    let head = json!({ "version": VERSION, "command": command, "fits": verdict.fits() });
    let Value::Object(mut all) = head else { return head };
    all.extend(fields);
    Value::Object(all)
}

/// Tells programs what was found, when the verdict is known: one value, also where nothing was found.
pub fn finish(verdict: Verdict) -> Result<(), Failure> {
    if !is_json() {
        return Ok(());
    }
    let errors = failure::reported();
    let value = match ANSWER.lock().expect("nobody panics with it").take() {
        Some(Answer::List(list)) => Value::Array(list),
        Some(Answer::Fields(mut fields)) => {
            fields.insert("errors".into(), json!(errors));
            object(verdict, fields)
        }
        None => object(verdict, Map::from_iter([("errors".into(), json!(errors))])),
    };
    let mut out = io::stdout().lock();
    serde_json::to_writer_pretty(&mut out, &value)?;
    writeln!(out)?;
    out.flush()?;
    Ok(())
}
