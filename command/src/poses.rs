// SPDX-License-Identifier: GPL-2.0-or-later
//! The pose of the command line, and the poses of a study: from a program or CSV.

use super::failure::{Failure, refused};
use super::input::{Program, RowFile};
use super::{Bar, moves, output, rows};
use kinematics::{Letter, POSE_LETTERS, Pose, Vector3};
use machine::read::columns::coordinates;
use machine::read::mechanism::Mechanism;
use program::replay::{duration_of_all, replay_seen};
use std::path::{Path, PathBuf};

/// Default number of poses of a program: more than a picture shows. A hexapod's row has 1.7 kB, so
/// this is a table of 17 MB; every servo cycle of an hour would be one of 6 GB.
const USUAL_POSES: f64 = 1e4;

/// Where the poses come from.
#[derive(clap::Args, Clone, Debug)]
pub struct Source {
    /// Program to follow, as in `pkm replay` (- for standard input) [default: CSV rows with columns
    /// x y z a b c]
    #[arg(value_name = "PROGRAM.ngc", value_hint = clap::ValueHint::FilePath, value_parser = Program, conflicts_with = "rows")]
    program: Option<PathBuf>,
    #[command(flatten)]
    rows: RowFile,
    /// Time between poses of a program [default: [EMCMOT]SERVO_PERIOD, or a multiple that gives
    /// 10000 poses]
    #[arg(long, value_name = "SECONDS")]
    period: Option<f64>,
    #[command(flatten)]
    tool: Tool,
}

/// The tool in the spindle.
#[derive(clap::Args, Clone, Debug)]
pub struct Tool {
    /// Tool offset X Y Z, as G43 would set it
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true)]
    tool: Option<Vec<f64>>,
}

impl Tool {
    /// Returns the tool vector, spindle offset included.
    pub fn vector(&self, config: &Mechanism) -> Vector3<f64> {
        config.spindle + self.offset()
    }

    /// Returns the tool offset.
    pub fn offset(&self) -> Vector3<f64> {
        let given = self.tool.as_deref().unwrap_or(&[0.0; 3]);
        Vector3::from_fn(|k, _| given[k])
    }
}

/// A pose; home if none is given.
#[derive(clap::Args, Clone, Debug)]
pub struct PoseWords {
    /// Pose in machine units and degrees: six numbers X Y Z A B C, or words as in a program block,
    /// such as X20 Z300 A5; missing letters are taken from home
    #[arg(long, num_args = 1..=9, value_name = "WORD", allow_negative_numbers = true)]
    pose: Vec<String>,
}

impl PoseWords {
    pub const fn is_given(&self) -> bool {
        !self.pose.is_empty()
    }

    /// Refuses rows in addition to it.
    pub fn without_rows(&self, rows: &RowFile) -> Result<(), Failure> {
        match rows.is_named() {
            true => Err(refused("--pose and --rows: give only one of them")),
            false => Ok(()),
        }
    }

    /// Returns X Y Z A B C.
    pub fn read(&self, config: &Mechanism) -> Result<[f64; 6], Failure> {
        let letters: String = Letter::ALL.iter().map(|letter| letter.name()).collect();
        let mut pose = config.home;
        for (place, value) in self.words(&letters, Some)? {
            pose[place] = value;
        }
        Ok(pose)
    }

    /// Parses words for these letters, or numbers for X Y Z A B C, of which number `k` is at `place_of(k)`: indices
    /// among LinuxCNC's nine coordinates, and values. A number without a place must be 0.
    pub fn words(
        &self,
        letters: &str,
        place_of: impl Fn(usize) -> Option<usize>,
    ) -> Result<Vec<(usize, f64)>, Failure> {
        let finite = |word: &str| word.parse().ok().filter(|value: &f64| value.is_finite());
        let numbers: Option<Vec<f64>> = self.pose.iter().map(|word| finite(word)).collect();
        match numbers {
            Some(numbers) if numbers.is_empty() || numbers.len() == 6 => {
                let places = numbers.into_iter().zip(Letter::ALL).map(|(value, letter)| {
                    match place_of(letter.index()) {
                        Some(place) => Ok(Some((place, value))),
                        None if value == 0.0 => Ok(None),
                        None => Err(refused(format!(
                            "--pose: {name} is {value}, but no joint moves {name}; use 0",
                            name = letter.name()
                        ))),
                    }
                });
                Ok(places.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
            }
            Some(numbers) => {
                let count = numbers.len();
                Err(refused(format!("--pose: found {count} numbers; expected X Y Z A B C")))
            }
            None => self.pose.iter().map(|word| word_of(letters, word)).collect(),
        }
    }
}

/// Parses index and value of a word such as `X20`.
fn word_of(letters: &str, word: &str) -> Result<(usize, f64), Failure> {
    let letter = word.chars().next().map(|letter| letter.to_ascii_uppercase());
    let place = POSE_LETTERS.iter().position(|known| Some(*known) == letter);
    let value =
        word.get(1..).and_then(|number| number.parse().ok()).filter(|v: &f64| v.is_finite());
    match place.filter(|place| letters.contains(POSE_LETTERS[*place])).zip(value) {
        Some(found) => Ok(found),
        None => Err(refused(format!(
            "--pose: \"{word}\": expected six numbers, or a letter of {letters} and a number each, such as \
             {}20; files go before --pose",
            &letters[..1]
        ))),
    }
}

/// One pose, home if nothing is given, and the tool there.
#[derive(clap::Args, Clone, Debug)]
pub struct At {
    #[command(flatten)]
    pose: PoseWords,
    #[command(flatten)]
    tool: Tool,
}

impl At {
    /// Returns pose and tool vector, spindle offset included.
    pub fn read(&self, config: &Mechanism) -> Result<(Pose, Vector3<f64>), Failure> {
        let pose = match self.pose.is_given() {
            true => Pose::from_degrees(self.pose.read(config)?),
            false => config.home_pose(),
        };
        Ok((pose, self.tool.vector(config)))
    }
}

/// A pose of a study.
#[derive(Clone, Copy, Debug)]
pub struct Stop {
    /// Seconds, and line of the program; without a program 0 and the line of the input.
    pub time: f64,
    /// Line of the program or the input, see `time`.
    pub line: u64,
    /// The pose.
    pub pose: Pose,
    /// Tool vector, spindle offset included.
    pub tool: Vector3<f64>,
}

/// The poses of a study, and whether all poses of a program were reached.
pub struct Stops {
    /// The poses in order.
    pub stops: Vec<Stop>,
    /// Whether they belong to a program.
    pub is_program: bool,
    /// Why the program ends early.
    pub end: Option<String>,
}

impl Source {
    /// Reads all poses.
    pub fn read(&self, config: &Mechanism) -> Result<Stops, Failure> {
        let stops = match &self.program {
            Some(program) => self.of_program(config, program)?,
            None => self.of_input(config)?,
        };
        match stops.stops.is_empty() {
            true => Err(refused(
                "no pose to examine: give a program that moves, or rows below the header",
            )),
            false => Ok(stops),
        }
    }

    fn of_program(&self, config: &Mechanism, program: &Path) -> Result<Stops, Failure> {
        if let Some(period) = self.period.filter(|period| !(*period > 0.0 && period.is_finite())) {
            return Err(refused(format!("--period {period}: expected more than 0 seconds")));
        }
        let moves = moves(config, program)?;
        let whole = duration_of_all(config, &moves);
        let usual = config.period.max(whole / USUAL_POSES);
        let period = self.period.unwrap_or(usual);
        if self.period.is_none() && usual > config.period {
            output::remark(&format!(
                "a pose every {usual:.4} s, {USUAL_POSES} in all; use --period {} for every servo cycle, {:.0} \
                 times as many poses",
                config.period,
                usual / config.period
            ));
        }
        let mut stops = vec![];
        let bar = Bar::new("following the program");
        let replayed = replay_seen(config, &moves, period, |visit| {
            bar.set(visit.time / whole);
            stops.push(Stop {
                time: visit.time,
                line: visit.line.into(),
                pose: Pose::from_degrees(visit.pose),
                tool: visit.tool.into(),
            });
        });
        let end = replayed.err().map(|fault| format!("{}: {fault}", program.display()));
        Ok(Stops { stops, is_program: true, end })
    }

    fn of_input(&self, config: &Mechanism) -> Result<Stops, Failure> {
        let tool = self.tool.vector(config);
        let mut stops = vec![];
        let instead = "a program, - for one on standard input";
        rows::Rows::open(&self.rows, &coordinates(), instead)?.each(|line, row| {
            let pose = Pose::from_degrees(std::array::from_fn(|k| row[k]));
            stops.push(Stop { time: 0.0, line, pose, tool });
            Ok(())
        })?;
        Ok(Stops { stops, is_program: false, end: None })
    }
}
