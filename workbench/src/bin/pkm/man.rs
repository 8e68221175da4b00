// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm man`.

use super::failure::Failure;
use super::{Cli, Verdict};
use clap::CommandFactory;
use pkm::files::{Locate, write_whole};
use std::path::{Path, PathBuf};

/// Writes the manual pages of pkm
#[derive(clap::Args, Debug)]
pub struct Arguments {
    /// Folder for pkm.1, pkm-check.1 and the others; made if needed
    #[arg(value_hint = clap::ValueHint::DirPath)]
    folder: PathBuf,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let folder = &arguments.folder;
    std::fs::create_dir_all(folder).at(folder)?;
    let main = Cli::command();
    pages(folder, &main, "pkm")?;
    Ok(Verdict::Fits)
}

/// The page of a command, and of every command below it.
fn pages(folder: &Path, command: &clap::Command, name: &str) -> Result<(), Failure> {
    for part in command.get_subcommands() {
        pages(folder, part, &format!("{name}-{}", part.get_name()))?;
    }
    page(folder, command.clone().name(name.to_string()), name)
}

fn page(folder: &Path, command: clap::Command, name: &str) -> Result<(), Failure> {
    let mut text = vec![];
    let file = folder.join(format!("{name}.1"));
    clap_mangen::Man::new(command).render(&mut text).at(&file)?;
    Ok(write_whole(&file, &String::from_utf8_lossy(&text))?)
}
