// SPDX-License-Identifier: GPL-2.0-or-later
//! The verdict on a program, from its file to a value: LinuxCNC's run, warnings, and for a misfit
//! another work offset with which it fits.

use crate::preflight::{self, JudgeError, Judged};
use crate::report::{Preflight, Rule, Time};
use crate::work_offset::{self, Offset};
use check::cautions::{Caution, cautions, once};
use kinematics::Letter;
use linuxcnc::process::Options;
use linuxcnc::refusal::NotJudged;
use linuxcnc::row::Row;
use machine::files::{self, AtFile, open};
use machine::read::machine::MachineConfig;
use serde::Serialize;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// The verdict on a program; docs/reference/json.md describes its JSON.
#[derive(Clone, Debug, Serialize)]
pub struct ProgramVerdict<'a> {
    /// The machine.
    #[serde(skip)]
    pub config: &'a MachineConfig,
    /// Machine file as given.
    pub machine: String,
    /// Program file as given.
    pub program: String,
    /// Files of the lines, by the numbers in their findings; the first one is the program.
    pub files: Vec<PathBuf>,
    #[serde(skip)]
    pub(super) texts: Vec<String>,
    /// Unknown if no judged limit is violated, but not everything was judged.
    pub fits: Option<bool>,
    /// All findings.
    #[serde(flatten)]
    pub found: Preflight,
    /// Warnings, each once.
    pub warnings: Vec<Caution>,
    /// Another work offset, with which the program fits.
    pub offset: Option<Suggestion>,
}

/// A work offset that was checked, and the block that sets it.
#[derive(Clone, Debug, Serialize)]
pub struct Suggestion {
    /// The offset.
    #[serde(flatten)]
    pub offset: Offset,
    /// The block.
    pub block: String,
    /// Whether LinuxCNC ran the program with it.
    time_judged: bool,
}

impl Suggestion {
    /// Returns how much of the program was checked with it.
    pub const fn checked(&self) -> &'static str {
        match self.time_judged {
            true => "verified with the whole program",
            false => "verified for the judged part only",
        }
    }
}

/// Progress of a verdict.
#[derive(Clone, Copy, Debug)]
pub enum Step<'a> {
    /// A servo cycle of the program.
    Row(&'a Row),
    /// The kind of search for another work offset, and its completed share.
    Search(&'static str, f64),
    /// A servo cycle of the program with the new offset.
    Trial(&'a Row),
}

/// Receives the progress of a verdict.
pub type Show<'a> = &'a mut (dyn FnMut(Step) + Send);

/// Judges a program. If it does not fit and `searches` is set, searches for another work offset.
///
/// # Errors
/// See [`JudgeError`].
pub fn judge<'a>(
    config: &'a MachineConfig,
    program: &Path,
    options: &Options,
    searches: bool,
    show: Show,
) -> Result<ProgramVerdict<'a>, JudgeError> {
    // Reported before LinuxCNC starts, in the system's words.
    open(program)?;
    let Judged { found, files } =
        preflight::judge(config, program, options, &mut |row| show(Step::Row(row)))?;
    if found.is_still {
        if let Some(stop) = found.breaks.iter().find(|broken| broken.limit == Rule::Control) {
            let (file, line) = (files[stop.file].clone(), stop.line.max(1));
            return Err(JudgeError::NeverStarts { file, line, text: stop.text.clone() });
        }
        if found.fits() {
            return Err(JudgeError::MovesNothing(program.into()));
        }
    }
    let text = |file: &PathBuf| Ok(String::from_utf8_lossy(&files::read(file)?).into_owned());
    let texts = files.iter().map(text).collect::<Result<Vec<_>, AtFile<io::Error>>>()?;
    let mut warnings = cautions(config, &texts);
    warnings.extend(found.tilted_tool_changes.iter().map(|change| tilted(config, *change)));
    let home = config.first().home[Letter::Z.index()];
    warnings.extend(found.rapids_to_zero.iter().map(|rapid| to_zero(*rapid, home)));
    warnings.extend(found.feeds_without_spindle.iter().map(|feed| without_spindle(*feed)));
    warnings.extend(found.off_path.iter().map(|off| Caution {
        line: Some(off.line),
        file: off.file,
        text: off.text.clone(),
    }));
    let fits = match (&found.time, found.fits()) {
        (_, false) => Some(false),
        (Time::Judged(_), true) => Some(true),
        (Time::NotJudged(_), true) => None,
    };
    let offset = match searches && may_shift(config, &found) {
        true => offset(config, program, options, &found, show)?,
        false => None,
    };
    if options.stop.load(Ordering::Relaxed) {
        return Err(NotJudged::Interrupted.into());
    }
    Ok(ProgramVerdict {
        config,
        machine: config.file.display().to_string(),
        program: program.display().to_string(),
        files,
        texts,
        fits,
        found,
        warnings: once(warnings),
        offset,
    })
}

fn tilted(config: &MachineConfig, (file, line): (usize, u32)) -> Caution {
    let text = if config.first().refuses_tool_motion() {
        "the tool offset changes at a tilt, which pkmkins refuses on a machine whose axes carry something beside \
         constraints: level the platform first, with these axes at 0"
    } else {
        "the tool offset changes at a tilt: the program waits while pkmkins moves the joints"
    };
    Caution { line: Some(line), file, text: text.into() }
}

fn without_spindle((file, line): (usize, u32)) -> Caution {
    let text = "a feed with a new tool while the spindle stands: M6 stops it. If the tool cuts, add S and M3 or M4 after M6";
    Caution { line: Some(line), file, text: text.into() }
}

fn to_zero((file, line): (usize, u32), home: f64) -> Caution {
    let text = format!(
        "a rapid goes down to Z0 of the machine, which G53 G0 Z0 and G28 mean: here that is below home, and not the top as on other \
         machines. Let the post write G53 G0 Z{home}"
    );
    Caution { line: Some(line), file, text }
}

/// Returns whether another work offset may help. Another position does not make a program slower, two mechanisms have
/// two offsets, and the search uses only the machine's own poses.
fn may_shift(config: &MachineConfig, found: &Preflight) -> bool {
    found.breaks.iter().any(|broken| !broken.limit.is_of_time())
        && config.mechanisms.len() == 1
        && config.first().chain.is_empty()
}

/// Searches for a work offset that LinuxCNC and the whole check confirm: a shift if sufficient, otherwise one with
/// a rotation.
fn offset(
    config: &MachineConfig,
    program: &Path,
    options: &Options,
    found: &Preflight,
    show: Show,
) -> Result<Option<Suggestion>, JudgeError> {
    let mut confirmed = |kind, search: work_offset::Search| -> Result<_, JudgeError> {
        let goes_on = &mut |share| {
            show(Step::Search(kind, share));
            !options.stop.load(Ordering::Relaxed)
        };
        let Some(offset) = search(config.first(), &found.poses, goes_on)? else { return Ok(None) };
        let block = offset.block();
        let shifted = Options { block: Some(block.clone()), ..options.clone() };
        // With another offset LinuxCNC may refuse the program: cutter radii, arcs.
        let judged =
            preflight::judge(config, program, &shifted, &mut |row| show(Step::Trial(row))).ok();
        let found = judged.map(|judged| judged.found).filter(Preflight::fits);
        Ok(found.map(|found| Suggestion { offset, block, time_judged: found.time.is_whole() }))
    };
    match confirmed("searching for another work offset", work_offset::shift)? {
        None if found.poses.may_turn(config.first()) => {
            confirmed("searching for a rotated work offset", work_offset::turn)
        }
        shifted => Ok(shifted),
    }
}
