// SPDX-License-Identifier: GPL-2.0-or-later
//! Input from standard input, selected by `-` on the command line.

use clap::builder::{OsStringValueParser, TypedValueParser};
use machine::files::{Folder, read_all, write_whole};
use std::ffi::OsStr;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::sync::OnceLock;

/// Argument for standard input.
pub const DASH: &str = "-";

/// Parser of a program argument, of which LinuxCNC needs a file: the named one, or a copy of standard
/// input. All other code then uses only files.
#[derive(Clone, Copy, Debug)]
pub struct Program;

impl TypedValueParser for Program {
    type Value = PathBuf;

    fn parse_ref(
        &self,
        command: &clap::Command,
        _: Option<&clap::Arg>,
        value: &OsStr,
    ) -> Result<PathBuf, clap::Error> {
        if value != DASH {
            return Ok(value.into());
        }
        spooled().map_err(|text| {
            clap::Error::raw(clap::error::ErrorKind::Io, format!("{text}\n")).with_cmd(command)
        })
    }
}

/// Copies standard input, which can be read once, to a file that is removed when the command ends.
fn spooled() -> Result<PathBuf, String> {
    static FILE: OnceLock<Result<(Folder, PathBuf), String>> = OnceLock::new();
    let found = FILE.get_or_init(|| {
        let reported = |error: String| format!("standard input: {error}; name a file instead of -");
        let bytes =
            read_all(&mut std::io::stdin().lock()).map_err(|error| reported(error.to_string()))?;
        let text = String::from_utf8(bytes).map_err(|error| reported(error.to_string()))?;
        let folder = Folder::new().map_err(|error| error.to_string())?;
        let file = folder.path().join("standard-input.ngc");
        write_whole(&file, &text).map_err(|error| error.to_string())?;
        Ok((folder, file))
    });
    found.as_ref().map(|(_, file)| file.clone()).map_err(Clone::clone)
}

/// Returns the parser of a machine's INI file: never standard input, which has no folder.
pub fn ini_file() -> impl TypedValueParser<Value = PathBuf> {
    OsStringValueParser::new().try_map(|name| match name == DASH {
        true => Err("a machine is read together with the files beside it, not from standard input: name its INI file"),
        false => Ok(PathBuf::from(name)),
    })
}

/// A file of rows.
#[derive(clap::Args, Clone, Debug)]
pub struct RowFile {
    /// Read rows from this CSV file; - is standard input, as is leaving the option out
    #[arg(long, value_name = "ROWS.csv", value_hint = clap::ValueHint::FilePath)]
    rows: Option<PathBuf>,
}

impl RowFile {
    /// Returns the file; `None` for standard input.
    pub fn file(&self) -> Option<&PathBuf> {
        self.rows.as_ref().filter(|file| file.as_os_str() != DASH)
    }

    /// Returns whether rows would have to be typed by a user who may not know it.
    pub fn is_forgotten(&self) -> bool {
        self.rows.is_none() && std::io::stdin().is_terminal()
    }

    /// Returns whether a file or standard input is named.
    pub const fn is_named(&self) -> bool {
        self.rows.is_some()
    }
}

/// Returns the name of a file that is read once.
pub fn file_of_dash(word: String) -> String {
    if word == DASH { "/dev/stdin".into() } else { word }
}
