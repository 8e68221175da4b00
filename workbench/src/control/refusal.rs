// SPDX-License-Identifier: GPL-2.0-or-later
//! Why LinuxCNC could not be run.

use crate::files::AtFile;
use crate::read::ini::IniError;
use std::io;
use std::path::PathBuf;

/// Compiles what stands in for HAL, RTAPI and the clock, for the LinuxCNC that is installed.
const COMPILES: &str = "/usr/share/pkmkins/virtual/build.sh";

/// Why nothing is known of a program's motion.
#[derive(Debug, thiserror::Error)]
pub enum NotJudged {
    /// LinuxCNC, or its part that pkmkins installs, is not there.
    #[error(
        "{}: {error}; install LinuxCNC and pkmkins, by their packages or by `make install`",
        .file.display()
    )]
    Missing {
        /// The file.
        file: PathBuf,
        /// What the system says.
        error: io::Error,
    },
    /// The library was built for another LinuxCNC.
    #[error(
        "virtual time was built for LinuxCNC {built}, and {installed} is installed: \
         `sudo {COMPILES}` builds it for this one"
    )]
    OtherVersion {
        /// Version that it was built for.
        built: String,
        /// Version that is installed.
        installed: String,
    },
    /// The library writes other records.
    #[error(
        "the installed library for virtual time is of another version of pkmkins: install both together"
    )]
    OtherRecords,
    /// The kernel enforces no rights of a run.
    #[error(
        "the kernel cannot keep a program from your files and from starting others ({0}): use Linux 5.13 or later with \
         Landlock, or --unconfined for programs and HAL files that you trust"
    )]
    Unconfined(String),
    /// The INI file asks for what is not run.
    #[error("{0}: {1}, which is not looked at here")]
    Asked(String, &'static str),
    /// A file of the run cannot be read or written.
    #[error(transparent)]
    File(#[from] AtFile<io::Error>),
    /// The system refuses something else.
    #[error("LinuxCNC cannot be run: {0}")]
    System(#[from] io::Error),
    /// Half of a machine.
    #[error("LinuxCNC runs both mechanisms of the machine or none: leave --mechanism out")]
    HalfOfPair,
    /// LinuxCNC cannot be brought to run the program.
    #[error("{0}")]
    Refused(String),
    /// A step of the machine's own HAL files failed.
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
    /// LinuxCNC does not get beyond the startup code.
    #[error(transparent)]
    StartupCode(IniError),
    /// It takes longer than the time that it was given.
    #[error("LinuxCNC did not come to an end in {0} s")]
    Slow(f64),
    /// It does nothing any more.
    #[error(
        "LinuxCNC did nothing for {0} s after line {1}: a signal stopped it, or the computer is too busy; run it again"
    )]
    Rests(u64, u32),
    /// It ended without a word.
    #[error("LinuxCNC ended without an end of the program{0}")]
    Crashed(String),
    /// Nobody wants to know any more.
    #[error("the run was ended")]
    Interrupted,
    /// The interpreter works and works, and nothing comes of it.
    #[error(
        "LinuxCNC reads the program without coming to a move after line {0}: is there a loop without an end?"
    )]
    Endless(u32),
    /// More moves than a program may have.
    #[error(
        "more than {0} moves, the next in line {1}: a loop without an end? --most-moves allows more"
    )]
    TooManyMoves(u64, u32),
    /// Longer than the program may be watched.
    #[error(
        "the program runs longer than {0} s of the machine's time (line {1}): --most-time allows more"
    )]
    TooLong(f64, u32),
    /// Longer at rest than it may be.
    #[error("nothing moves for {0} s in line {1}: --most-standstill allows more")]
    Stands(f64, u32),
}
