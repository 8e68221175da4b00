// SPDX-License-Identifier: GPL-2.0-or-later
//! Why LinuxCNC could not be run.

use machine::files::AtFile;
use machine::read::ini::IniError;
use std::io;
use std::path::PathBuf;

/// Why a program's motion is unknown.
#[derive(Debug, thiserror::Error)]
pub enum NotJudged {
    #[error(
        "{}: {error}; install LinuxCNC and pkmkins, from packages or with `make install`",
        .file.display()
    )]
    Missing { file: PathBuf, error: io::Error },
    #[error(
        "LinuxCNC {0} is installed, which virtual time does not support: install version {versions}",
        versions = crate::process::SUPPORTED.join(" or ")
    )]
    OtherVersion(String),
    #[error(
        "the installed library for virtual time belongs to another version of pkmkins: install both together"
    )]
    OtherRecords,
    #[error(
        "the kernel cannot protect your files from the program ({0}): use Linux 5.13 or later with \
         Landlock, or --unconfined for programs and HAL files that you trust"
    )]
    Unconfined(String),
    #[error("{0}: {1}, which virtual time does not support")]
    Asked(String, &'static str),
    #[error(transparent)]
    File(#[from] AtFile<io::Error>),
    #[error("LinuxCNC cannot be run: {0}")]
    System(#[from] io::Error),
    #[error("LinuxCNC runs both mechanisms of the machine or none: remove --mechanism")]
    HalfOfPair,
    #[error("{0}")]
    Refused(String),
    #[error("{text}")]
    Step {
        /// File of the step; empty if it is in the INI file.
        file: PathBuf,
        /// Its line; 0 if unknown.
        line: usize,
        /// Index of its entry, counted from 0.
        entry: usize,
        /// Whether LinuxCNC refuses the step too, not only this simulation.
        is_mistake: bool,
        /// The message of the program that refused it.
        text: String,
    },
    #[error(transparent)]
    StartupCode(IniError),
    #[error("LinuxCNC did not finish within {0} s")]
    Slow(f64),
    #[error(
        "LinuxCNC did nothing for {0} s after line {1}: a signal stopped it, or the computer is too busy; run it again"
    )]
    Rests(u64, u32),
    #[error("LinuxCNC exited before the end of the program{0}")]
    Crashed(String),
    #[error("the run was canceled")]
    Interrupted,
    #[error(
        "LinuxCNC reads the program without a move after line {0}: check for an endless loop, or raise --patience"
    )]
    Endless(u32),
    #[error(
        "more than {0} moves, the next in line {1}: check for an endless loop, or raise --most-moves"
    )]
    TooManyMoves(u64, u32),
    #[error("the program runs longer than {0} s of machine time (line {1}): raise --most-time")]
    TooLong(f64, u32),
    #[error("nothing moves for {0} s in line {1}: raise --most-standstill")]
    Stands(f64, u32),
}
