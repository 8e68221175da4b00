// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm joints`: inverse kinematics.

use super::failure::Failure;
use super::input::RowFile;
use super::poses::{PoseWords, Tool};
use super::rows::{Answer, Question, answer};
use super::{MachineFile, Verdict};
use export::state::{States, letters};
use kinematics::{POSE_LETTERS, Pose};
use machine::read::columns::{coordinates, joint_names};

/// Compute joint values from poses (inverse kinematics)
///
/// Reads one pose (--pose), or CSV with columns x y z a b c from a file or standard input, and
/// writes the joint values, one row per pose. Units: machine units and degrees. Joint limits and
/// cones are not checked. On a machine with constraints of the platform, a column for each
/// coordinate that follows from the others is appended: its value in the base frame.
///
/// --passive writes every joint of the model that `pkm export` makes, in meters and radians: also
/// the universal joints, threads and rings of the legs, the joints of constraints, and the
/// coordinates of the platforms. Its poses are LinuxCNC's, with columns u v w if the machine moves these letters.
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
    /// Write all joints of the exported model, in meters and radians
    #[arg(long)]
    passive: bool,
}

/// Writes all joints of the exported model.
fn passive(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read_named_constrained()?;
    let failed = |error| Failure::at(config.file.display(), error);
    let model = export::assemble::model(&config, None).map_err(failed)?;
    let states = States::new(&config, &model)?;
    let names: Vec<String> = model.joints().map(|(_, joint)| joint.name.clone()).collect();
    let letters: Vec<usize> = (0..6).chain(letters(&config)).collect();
    let columns: Vec<String> =
        letters.iter().map(|place| POSE_LETTERS[*place].to_ascii_lowercase().to_string()).collect();
    let tool = arguments.tool.offset();
    let reply = |row: &[f64]| -> Answer {
        let mut world = config.world_home;
        letters.iter().zip(row).for_each(|(place, value)| world[*place] = *value);
        states.values(&world, &tool)
    };
    let question = match arguments.pose.is_given() {
        true => {
            arguments.pose.without_rows(&arguments.rows)?;
            let mut world = config.world_home;
            let known: String = letters.iter().map(|place| POSE_LETTERS[*place]).collect();
            for (place, value) in arguments.pose.words(&known, Some)? {
                world[place] = value;
            }
            Question::Row(letters.iter().map(|place| world[*place]).collect())
        }
        false => Question::Rows(&arguments.rows, "--pose X Y Z A B C"),
    };
    answer(&config.file, &question, &columns, &names, reply)
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    if arguments.passive {
        return passive(arguments);
    }
    let config = arguments.machine.read_constrained()?;
    let tool = arguments.tool.vector(&config);
    let dependent = config.dependent();
    let reply = |row: &[f64]| -> Answer {
        let pose = Pose::from_degrees(std::array::from_fn(|k| row[k]));
        let joints = config.machine.inverse(&pose, &tool)?;
        let mut values = joints[..config.joints.len()].to_vec();
        if !dependent.is_empty() {
            let full = config.machine.full_pose(&pose, &tool)?.to_degrees();
            values.extend(dependent.iter().map(|letter| full[letter.index()]));
        }
        Ok(values)
    };
    let mut names = joint_names(config.joints.len());
    names.extend(dependent.iter().map(|letter| coordinates()[letter.index()].clone()));
    let question = match arguments.pose.is_given() {
        true => {
            arguments.pose.without_rows(&arguments.rows)?;
            Question::Row(arguments.pose.read(&config)?.into())
        }
        false => Question::Rows(&arguments.rows, "--pose X Y Z A B C"),
    };
    answer(&config.file, &question, &coordinates(), &names, reply)
}
