// SPDX-License-Identifier: GPL-2.0-or-later
//! Why LinuxCNC could not be run.

use machine::files::AtFile;
use machine::read::ini::IniError;
use std::io;
use std::path::PathBuf;

/// Compiles what stands in for HAL, RTAPI and the clock, for the LinuxCNC that is installed.
const COMPILES: &str = "/usr/share/pkmkins/virtual/build.sh";

/// Why nothing is known of a program's motion.
#[derive(Debug, thiserror::Error)]
pub enum NotJudged {
    #[error(
        "{}: {error}; install LinuxCNC and pkmkins, by their packages or by `make install`",
        .file.display()
    )]
    Missing { file: PathBuf, error: io::Error },
    #[error(
        "virtual time was built for LinuxCNC {built}, and {installed} is installed: \
         `sudo {COMPILES}` builds it for this one"
    )]
    OtherVersion {
        /// Version that it was built for.
        built: String,
        installed: String,
    },
    #[error(
        "the installed library for virtual time is of another version of pkmkins: install both together"
    )]
    OtherRecords,
    #[error(
        "the kernel cannot keep a program from your files and from starting others ({0}): use Linux 5.13 or later with \
         Landlock, or --unconfined for programs and HAL files that you trust"
    )]
    Unconfined(String),
    #[error("{0}: {1}, which is not looked at here")]
    Asked(String, &'static str),
    #[error(transparent)]
    File(#[from] AtFile<io::Error>),
    #[error("LinuxCNC cannot be run: {0}")]
    System(#[from] io::Error),
    #[error("LinuxCNC runs both mechanisms of the machine or none: leave --mechanism out")]
    HalfOfPair,
    #[error("{0}")]
    Refused(String),
    #[error("{text}")]
    Step {
        /// File of the step; empty where it stands in the INI file.
        file: PathBuf,
        /// Its line; 0 where it is not known.
        line: usize,
        /// Which of the entries it belongs to, counted from 0.
        entry: usize,
        /// Whether LinuxCNC refuses the step, too, and not only what carries it out here.
        is_mistake: bool,
        /// Why, in the words of who refused it.
        text: String,
    },
    #[error(transparent)]
    StartupCode(IniError),
    #[error("LinuxCNC did not come to an end in {0} s")]
    Slow(f64),
    #[error(
        "LinuxCNC did nothing for {0} s after line {1}: a signal stopped it, or the computer is too busy; run it again"
    )]
    Rests(u64, u32),
    #[error("LinuxCNC ended without an end of the program{0}")]
    Crashed(String),
    #[error("the run was ended")]
    Interrupted,
    #[error(
        "LinuxCNC reads the program without coming to a move after line {0}: is there a loop without an end?"
    )]
    Endless(u32),
    #[error(
        "more than {0} moves, the next in line {1}: a loop without an end? --most-moves allows more"
    )]
    TooManyMoves(u64, u32),
    #[error(
        "the program runs longer than {0} s of the machine's time (line {1}): --most-time allows more"
    )]
    TooLong(f64, u32),
    #[error("nothing moves for {0} s in line {1}: --most-standstill allows more")]
    Stands(f64, u32),
}
