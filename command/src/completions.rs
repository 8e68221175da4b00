// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm completions`.

use super::failure::Failure;
use super::{Cli, Verdict, output, print_text};
use clap::CommandFactory;
use clap_complete::Shell;
use serde_json::json;

/// Print shell completions of pkm
#[derive(clap::Args, Debug)]
pub struct Arguments {
    /// Shell to complete for
    shell: Shell,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let mut text = vec![];
    clap_complete::generate(arguments.shell, &mut Cli::command(), "pkm", &mut text);
    let text = String::from_utf8_lossy(&text);
    print_text(&text)?;
    output::answer(&json!({ "shell": arguments.shell.to_string(), "text": text }))?;
    Ok(Verdict::Fits)
}
