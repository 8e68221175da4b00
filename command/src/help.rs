// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm help PAGE`: the documentation on disk. Messages, help and manual pages refer to a page by this command, which
//! finds it wherever pkm is installed; subcommands of the same name, such as `pkm help frames`, go first.

use super::failure::{Failure, refused};
use super::{Cli, print_text};
use clap::CommandFactory;
use machine::files::Locate;
use std::ffi::OsString;
use std::fs::{File, read_to_string};
use std::io::{IsTerminal, Write, stderr, stdout};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Folders of the documentation, each with an index of its pages.
pub const FOLDERS: [&str; 3] = ["guide", "reference", "studies"];

/// Exit status of a shell that did not find the program.
const NOT_FOUND: i32 = 127;

/// Shows a page if the words are `help` and the name of one. Returns `None` for everything else, for the grammar to
/// answer.
pub fn run(mut words: impl Iterator<Item = OsString>) -> Option<Result<(), Failure>> {
    let is_help = words.next()? == "help";
    let (name, None) = (words.next()?.into_string().ok()?, words.next()) else { return None };
    if !is_help || Cli::command().find_subcommand(&name).is_some() {
        return None;
    }
    let name = name.trim_start_matches("docs/").trim_end_matches(".md");
    let (folder, page) = name.split_once('/').unwrap_or((name, "README"));
    let folders: Vec<PathBuf> = folders().collect();
    let found = |folder: &str, page: &str| {
        let file = format!("{folder}/{page}.md");
        folders.iter().map(|docs| docs.join(&file)).find(|page| page.is_file())
    };
    if FOLDERS.contains(&folder) && !page.contains('/') {
        if found(folder, "README").is_none() {
            return Some(Err(missing(&folders)));
        }
        return found(folder, page).map(|page| show(&page));
    }
    FOLDERS.iter().find_map(|folder| found(folder, name)).map(|page| show(&page))
}

/// Lists where the documentation is: beside the folder of an installed program, or in the clone that it was built in.
fn folders() -> impl Iterator<Item = PathBuf> {
    let program = std::env::current_exe().unwrap_or_default();
    [(2, "share/doc/pkm/docs"), (3, "docs")]
        .into_iter()
        .filter_map(move |(up, docs)| Some(program.ancestors().nth(up)?.join(docs)))
}

/// Creates the refusal where no documentation is on disk.
fn missing(folders: &[PathBuf]) -> Failure {
    let folder = folders.first().map(|folder| folder.display().to_string()).unwrap_or_default();
    refused(format!(
        "{folder} is missing: the documentation is not installed: install the package pkm again, without a path-exclude \
         of /usr/share/doc in /etc/dpkg/dpkg.cfg.d; or run make install-pkm in a clone"
    ))
}

/// Reports the files of a page on standard error, and shows its text: on a terminal through the pager, as man does.
fn show(page: &Path) -> Result<(), Failure> {
    let text = read_to_string(page).at(page)?;
    let html = html(page).filter(|html| html.is_file());
    for file in [Some(page), html.as_deref()].into_iter().flatten() {
        // Nothing can be done if standard error is closed.
        let _ = writeln!(stderr(), "{}", file.display());
    }
    let pager = std::env::var_os("PAGER").unwrap_or_else(|| "pager".into());
    if stdout().is_terminal() && !pager.is_empty() {
        let status =
            Command::new("sh").arg("-c").arg(pager).stdin(File::open(page).at(page)?).status();
        if status.is_ok_and(|status| status.code() != Some(NOT_FOUND)) {
            return Ok(());
        }
    }
    print_text(&text)
}

/// Returns the place of a page for browsers: `html/docs` beside `docs`.
fn html(page: &Path) -> Option<PathBuf> {
    let docs = page.ancestors().nth(2)?;
    let below = page.strip_prefix(docs).ok()?;
    Some(docs.parent()?.join("html/docs").join(below).with_extension("html"))
}
