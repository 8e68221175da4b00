// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm pose`: forward kinematics.

use super::failure::{Failure, refused};
use super::input::RowFile;
use super::poses::Tool;
use super::rows::{Answer, Question, answer};
use super::{MachineFile, Verdict};
use kinematics::Pose;
use machine::read::columns::{coordinates, joint_names};
use machine::rows::with_dependent;

/// Compute poses from joint values (forward kinematics)
///
/// Reads the joint values of one pose (--joints), or CSV with columns joint_0 joint_1 ... from a
/// file or standard input, and writes the poses X Y Z A B C. Units: machine units and degrees.
/// Several poses may have the same joint values; pkm returns the one that the machine reaches if
/// its joints move straight from the seed: for the first row home, then the previous row. If that
/// is not certain, there is no result. Coordinates that constraints of the platform determine are
/// included; pkm joints wants 0 for them.
///
/// Exit status: 0, or 1 if joint values have no pose: its cells stay empty, and the reason goes
/// to standard error.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Joint values of one pose, in the order of the joints
    #[arg(long, num_args = 1.., value_name = "VALUE", allow_negative_numbers = true, conflicts_with = "rows")]
    joints: Vec<f64>,
    #[command(flatten)]
    rows: RowFile,
    /// Pose from which the joints start [default: [TRAJ]HOME]
    #[arg(long, num_args = 6, value_names = ["X", "Y", "Z", "A", "B", "C"], allow_negative_numbers = true)]
    seed: Option<Vec<f64>>,
    #[command(flatten)]
    tool: Tool,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read_constrained()?;
    let tool = arguments.tool.vector(&config);
    let given = arguments.seed.as_deref();
    let mut seed = given
        .map_or(config.home_pose(), |seed| Pose::from_degrees(std::array::from_fn(|k| seed[k])));
    let reply = |row: &[f64]| -> Answer {
        let joints = std::array::from_fn(|i| row.get(i).copied().unwrap_or(0.0));
        let solution = config.machine.forward(&joints, &seed, &tool, &config.solver)?;
        seed = solution.pose;
        let pose = match config.dependent().is_empty() {
            true => solution.pose,
            false => with_dependent(&config.machine, &solution.pose, &tool)?,
        };
        Ok(pose.to_degrees().to_vec())
    };
    let (names, given) = (joint_names(config.joints.len()), &arguments.joints);
    let question = match given.len() {
        0 => Question::Rows(&arguments.rows, "--joints"),
        count if count == names.len() => Question::Row(given.clone()),
        count => {
            let text = format!("--joints: found {count} numbers; expected {}", names.join(" "));
            return Err(refused(text));
        }
    };
    answer(&config.file, &question, &names, &coordinates(), reply)
}
