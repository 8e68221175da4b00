// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm joints`: inverse kinematics.

use super::failure::Failure;
use super::input::RowFile;
use super::poses::{PoseWords, Tool};
use super::rows::{Answer, Question, answer};
use super::{MachineFile, Verdict};
use kinematics::Pose;
use machine::read::columns::{coordinates, joint_names};

/// Compute joint values from poses (inverse kinematics)
///
/// Reads one pose (--pose), or CSV with columns x y z a b c from a file or standard input, and
/// writes the joint values, one row per pose. Units: machine units and degrees. Joint limits and
/// cones are not checked.
///
/// Exit status: 0, or 1 if a pose has no joint values: its cells stay empty, and the reason goes
/// to standard error.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    pose: PoseWords,
    #[command(flatten)]
    rows: RowFile,
    #[command(flatten)]
    tool: Tool,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read()?;
    let tool = arguments.tool.vector(&config);
    let reply = |row: &[f64]| -> Answer {
        let pose = Pose::from_degrees(std::array::from_fn(|k| row[k]));
        let joints = config.machine.inverse(&pose, &tool)?;
        Ok(joints[..config.joints.len()].to_vec())
    };
    let question = match arguments.pose.is_given() {
        true => {
            arguments.pose.without_rows(&arguments.rows)?;
            Question::Row(arguments.pose.read(&config)?.into())
        }
        false => Question::Rows(&arguments.rows, "--pose X Y Z A B C"),
    };
    answer(&config.file, &question, &coordinates(), &joint_names(config.joints.len()), reply)
}
