// SPDX-License-Identifier: GPL-2.0-or-later
//! Poses that a study runs through: those of a program, or CSV from standard input.

use super::failure::{Failure, refused};
use super::joints::{Tool, coordinates};
use super::{moves, rows};
use kinematics::{Pose, Vector3};
use pkm::program::replay::replay_seen;
use pkm::read::machine::MachineConfig;
use std::path::{Path, PathBuf};

/// Where the poses come from.
#[derive(clap::Args, Clone, Debug)]
pub struct Source {
    /// A program, followed as `pkm replay` does; without it CSV is read from standard input, with
    /// a header that names x y z a b c
    #[arg(value_name = "PROGRAM.ngc", value_hint = clap::ValueHint::FilePath)]
    program: Option<PathBuf>,
    /// Seconds between poses of a program instead of [EMCMOT]SERVO_PERIOD
    #[arg(long, value_name = "SECONDS")]
    period: Option<f64>,
    #[command(flatten)]
    tool: Tool,
}

/// One pose, home where nothing is given.
#[derive(clap::Args, Clone, Debug)]
pub struct At {
    /// X Y Z A B C of the pose; without them home
    #[arg(allow_negative_numbers = true)]
    pose: Vec<f64>,
    #[command(flatten)]
    tool: Tool,
}

impl At {
    /// Pose and tool vector, spindle offset included.
    pub fn read(&self, config: &MachineConfig) -> Result<(Pose, Vector3<f64>), Failure> {
        let pose = match <[f64; 6]>::try_from(self.pose.as_slice()) {
            Ok(pose) => Pose::from_degrees(pose),
            Err(_) if self.pose.is_empty() => config.home_pose(),
            Err(_) => {
                let count = self.pose.len();
                return Err(refused(format!("expected X Y Z A B C; found {count} numbers")));
            }
        };
        Ok((pose, self.tool.vector(config)))
    }
}

/// One of them.
#[derive(Clone, Copy, Debug)]
pub struct Stop {
    /// Seconds, and line of the program; without a program 0 and the line of the input.
    pub time: f64,
    /// See `time`.
    pub line: u64,
    /// The pose.
    pub pose: Pose,
    /// Tool vector, spindle offset included.
    pub tool: Vector3<f64>,
}

/// The poses, and whether all of a program were reached.
pub struct Stops {
    /// In order.
    pub stops: Vec<Stop>,
    /// Whether they belong to a program.
    pub is_program: bool,
    /// Why the program ends early.
    pub end: Option<String>,
}

impl Source {
    /// All poses.
    pub fn read(&self, config: &MachineConfig) -> Result<Stops, Failure> {
        let stops = match &self.program {
            Some(program) => self.of_program(config, program)?,
            None => self.of_input(config)?,
        };
        match stops.stops.is_empty() {
            true => Err(refused("there is no pose to look at")),
            false => Ok(stops),
        }
    }

    fn of_program(&self, config: &MachineConfig, program: &Path) -> Result<Stops, Failure> {
        let period = self.period.unwrap_or(config.period);
        if !(period > 0.0 && period.is_finite()) {
            return Err(refused(format!("--period {period}: expected more than 0 seconds")));
        }
        let moves = moves(config, program)?;
        let mut stops = vec![];
        let replayed = replay_seen(config, &moves, period, |visit| {
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

    fn of_input(&self, config: &MachineConfig) -> Result<Stops, Failure> {
        let tool = self.tool.vector(config);
        let mut stops = vec![];
        rows::Rows::open(&coordinates())?.each(|line, row| {
            let pose = Pose::from_degrees(std::array::from_fn(|k| row[k]));
            stops.push(Stop { time: 0.0, line, pose, tool });
            Ok(())
        })?;
        Ok(Stops { stops, is_program: false, end: None })
    }
}
