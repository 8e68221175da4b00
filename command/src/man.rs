// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm man`.

use super::examples::{Ending, ending};
use super::failure::Failure;
use super::{Cli, Verdict, output};
use clap::CommandFactory;
use machine::files::{Locate, write_whole};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Write the manual pages of pkm
#[derive(clap::Args, Debug)]
pub struct Arguments {
    /// Folder for pkm.1, pkm-check.1 and the other pages; created if needed
    #[arg(value_hint = clap::ValueHint::DirPath)]
    folder: PathBuf,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let folder = &arguments.folder;
    std::fs::create_dir_all(folder).at(folder)?;
    let main = Cli::command();
    let mut files = vec![];
    pages(folder, &main, &[], &mut files)?;
    output::answer(&json!({ "files": files }))?;
    Ok(Verdict::Fits)
}

/// Adds the pages of a command, and of every command below it.
fn pages(
    folder: &Path,
    command: &clap::Command,
    words: &[&str],
    files: &mut Vec<PathBuf>,
) -> Result<(), Failure> {
    for part in command.get_subcommands() {
        pages(folder, part, &[words, &[part.get_name()]].concat(), files)?;
    }
    let name = [&["pkm"], words].concat().join("-");
    let file = folder.join(format!("{name}.1"));
    page(&file, command.clone().name(name), &ending(&words.join(" ")))?;
    files.push(file);
    Ok(())
}

fn page(file: &Path, command: clap::Command, ending: &Ending) -> Result<(), Failure> {
    let mut text = vec![];
    clap_mangen::Man::new(command).render(&mut text).at(file)?;
    let text = format!("{}{}", String::from_utf8_lossy(&text), sections(ending));
    Ok(write_whole(file, &text)?)
}

/// Formats examples and further reading for a manual page.
fn sections(ending: &Ending) -> String {
    let plain = |text: &str| text.replace('\\', "\\e").replace('-', "\\-").replace('~', "\\(ti");
    let example = |(line, what): &(String, String)| {
        format!(".TP\n\\fB{}\\fR\n{}\n", plain(line), plain(what))
    };
    let examples: String = ending.examples.iter().map(example).collect();
    format!(".SH EXAMPLES\n{examples}.SH \"SEE ALSO\"\n{}\n", plain(&ending.see.join(", ")))
}
