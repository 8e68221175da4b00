// SPDX-License-Identifier: GPL-2.0-or-later
//! Output of a subcommand: text or one JSON value on standard output,
//! remarks and progress on standard error. The format is set once, from the command line.

use super::Verdict;
use super::failure::{self, Failure};
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::ffi::OsString;
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Mutex, OnceLock};

/// Version of all JSON values, see `pkm help reference/json`: incremented if a field is removed or changes its meaning.
const VERSION: u32 = 1;

/// Options that every subcommand has.
#[derive(clap::Args, Clone, Debug)]
#[command(next_help_heading = "Options of every command")]
pub struct Settings {
    /// Output format: text, or one JSON value for programs (`pkm help reference/json`)
    #[arg(long, global = true, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// Print findings only, without progress and statistics
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Use colors; auto means on a terminal, unless NO_COLOR is set
    #[arg(long, global = true, value_enum, value_name = "WHEN", default_value_t = clap::ColorChoice::Auto)]
    color: clap::ColorChoice,
}

/// Format of standard output.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    Text,
    Json,
}

/// Current settings, and the words of the subcommand.
struct Chosen {
    settings: Settings,
    command: String,
}

static CHOSEN: OnceLock<Chosen> = OnceLock::new();

/// JSON value to write at the end.
static ANSWER: Mutex<Option<Answer>> = Mutex::new(None);

enum Answer {
    /// Fields of a single object.
    Fields(Map<String, Value>),
    /// Several objects.
    List(Vec<Value>),
}

impl Settings {
    /// Applies the settings to this command.
    pub fn choose(&self, command: String) {
        let _ = CHOSEN.set(Chosen { settings: self.clone(), command });
    }
}

/// Sets the colors of all output, including that of the command line's grammar: before it is parsed.
pub fn choose_colors(words: impl Iterator<Item = OsString>) {
    let words: Vec<String> = words.map(|word| word.to_string_lossy().into_owned()).collect();
    let behind = words.iter().position(|word| word == "--color").and_then(|k| words.get(k + 1));
    let joined = words.iter().find_map(|word| word.strip_prefix("--color="));
    match joined.or(behind.map(String::as_str)) {
        Some("always") => anstream::ColorChoice::Always.write_global(),
        Some("never") => anstream::ColorChoice::Never.write_global(),
        _ => {}
    }
}

/// Returns whether standard output is JSON.
pub fn is_json() -> bool {
    CHOSEN.get().is_some_and(|chosen| chosen.settings.format == Format::Json)
}

/// Returns whether only findings and results are requested.
pub fn is_quiet() -> bool {
    CHOSEN.get().is_some_and(|chosen| chosen.settings.quiet)
}

/// Returns the stream of text output; it discards the text if standard output is JSON.
pub fn people() -> Box<dyn Write> {
    match is_json() {
        true => Box::new(io::sink()),
        false => Box::new(anstream::stdout().lock()),
    }
}

/// Returns the stream of facts that are neither findings nor results.
pub fn facts() -> Box<dyn Write> {
    if is_quiet() { Box::new(io::sink()) } else { people() }
}

/// Writes a remark about the execution to standard error, such as amount or speed.
pub fn remark(text: &str) {
    if !is_quiet() {
        // Nothing can be done if standard error is closed.
        let _ = writeln!(anstream::stderr(), "{text}");
    }
}

/// Adds results of a subcommand to the JSON object, besides the common fields.
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

/// Sets a list of results, each with its verdict.
pub fn list(answers: Vec<(Verdict, Value)>) {
    let whole = |(verdict, found)| match found {
        Value::Object(fields) => object(verdict, fields),
        value => value,
    };
    put(Answer::List(answers.into_iter().map(whole).collect()));
}

fn put(answer: Answer) {
    *ANSWER.lock().expect("never poisoned") = Some(answer);
}

/// A table of numbers: as text CSV, row by row; as JSON all rows at the end.
pub struct Table {
    columns: Vec<String>,
    out: csv::Writer<Box<dyn Write>>,
    rows: Vec<Vec<Option<f64>>>,
}

impl Table {
    /// Begins a table with its header.
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

    /// Ends the table, in JSON with the machine.
    pub fn finish(mut self, machine: &Path) -> Result<(), Failure> {
        self.out.flush()?;
        let Self { columns, rows, .. } = self;
        answer(&json!({ "machine": machine, "columns": columns, "rows": rows }))
    }
}

/// Returns an object of the JSON output: with version, command and verdict.
fn object(verdict: Verdict, fields: Map<String, Value>) -> Value {
    let command = CHOSEN.get().map_or("", |chosen| &chosen.command);
    let head = json!({ "version": VERSION, "command": command, "fits": verdict.fits() });
    let Value::Object(mut all) = head else { return head };
    all.extend(fields);
    Value::Object(all)
}

/// Writes the JSON output once the verdict is known: one value, even without results.
pub fn finish(verdict: Verdict) -> Result<(), Failure> {
    if !is_json() {
        return Ok(());
    }
    let errors = failure::reported();
    let value = match ANSWER.lock().expect("never poisoned").take() {
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
