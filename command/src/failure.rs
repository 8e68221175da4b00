// SPDX-License-Identifier: GPL-2.0-or-later
//! Errors of subcommands, and their output to the terminal.

use machine::files::AtPlace;
use machine::read::diagnostic::{Severity, of_machine, rendered};
use machine::read::error::MachineError;
use machine::read::ini::IniError;
use std::error::Error;
use std::fmt::{self, Display};
use std::io::{self, ErrorKind, Write};
use std::sync::Mutex;

/// Any error of a subcommand, with its location and a remedy.
#[derive(Debug)]
pub struct Failure(Box<dyn Error + Send + Sync>);

impl<E: Error + Send + Sync + 'static> From<E> for Failure {
    fn from(error: E) -> Self {
        Self(Box::new(error))
    }
}

/// Texts that were reported on standard error.
static ERRORS: Mutex<Vec<String>> = Mutex::new(vec![]);

/// Returns the texts reported on standard error since the last call, for JSON.
pub fn reported() -> Vec<String> {
    std::mem::take(&mut *ERRORS.lock().expect("never poisoned"))
}

/// An error in the arguments that the command line's grammar accepts.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Refused(String);

/// Creates the refusal of arguments or standard input from a sentence.
pub fn refused(text: impl Into<String>) -> Failure {
    Refused(text.into()).into()
}

impl Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl Failure {
    /// Adds a location to an error.
    pub fn at(place: impl Display, error: impl Error + Send + Sync + 'static) -> Self {
        AtPlace::new(place, error).into()
    }

    /// Returns the result of writing to standard output, ignoring a closed reader.
    pub fn unless_unread(written: Result<(), Self>) -> Result<(), Self> {
        match written {
            Err(failure) if failure.is_unread() => Ok(()),
            other => other,
        }
    }

    /// Returns whether the reader of standard output is closed.
    pub fn is_unread(&self) -> bool {
        let json = self.0.downcast_ref::<serde_json::Error>();
        if json.is_some_and(|error| error.io_error_kind() == Some(ErrorKind::BrokenPipe)) {
            return true;
        }
        let written = match self.0.downcast_ref::<csv::Error>().map(csv::Error::kind) {
            Some(csv::ErrorKind::Io(error)) => Some(error),
            _ => self.0.downcast_ref::<io::Error>(),
        };
        written.is_some_and(|error| error.kind() == ErrorKind::BrokenPipe)
    }

    /// Reports the error on standard error: with an excerpt for an INI file.
    pub fn report(&self) {
        if let Some(error) = self.0.downcast_ref::<IniError>() {
            report_lines(&rendered(Severity::Error, &error.0));
        } else if let Some(error) = self.0.downcast_ref::<MachineError>() {
            report_lines(&of_machine(error));
        } else if self.0.is::<io::Error>()
            || self.0.is::<csv::Error>()
            || self.0.is::<serde_json::Error>()
        {
            // Errors of files have their names; one without was written to standard output.
            report_error(&format!("standard output: {}", self.0));
        } else {
            report_error(&self.0);
        }
    }
}

/// Reports an error on standard error.
pub fn report_error(error: &(impl Display + ?Sized)) {
    report_lines(&format!("pkm: {error}"));
}

fn report_lines(text: &str) {
    let plain = anstream::adapter::strip_str(text).to_string();
    let error = plain.strip_prefix("pkm: ").unwrap_or(&plain).into();
    ERRORS.lock().expect("never poisoned").push(error);
    // Nothing can be done if standard error is closed as well.
    let _ = writeln!(anstream::stderr(), "{text}");
}
