// SPDX-License-Identifier: GPL-2.0-or-later
//! A job of typical paths: its program, and the joints along every operation (paper 003,
//! table 2: joints over the length of the path; figure 8: their changes by operation).

use crate::file::PathFile;
use crate::gcode::{SetupError, Writer, carried};
use crate::operation::{Operation, OperationError};
use crate::pen::Step;
use crate::piece::Arc;
use crate::planes::PLANES;
use kinematics::{Fault, Joints, Pose, Vector3};
use machine::files;
use machine::read::columns::{coordinates, joint_names};
use machine::read::mechanism::Mechanism;
use program::joint_curves::{Along, along};
use program::motion::{Move, MoveKind};
use program::preflight::preflight;

/// Largest distance between poses of a table, mm.
const APART_MM: f64 = 1.0;
/// Largest angle between poses of a table where the tip is at rest, degrees.
const APART_DEG: f64 = 0.5;

/// Why a job is refused.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    #[error("{0}")]
    Keys(&'static str),
    #[error(transparent)]
    Operation(#[from] OperationError),
    #[error(transparent)]
    Setup(#[from] SetupError),
    #[error("[[operation]] {number}, {name}: {text}")]
    Leaves {
        /// Number of the operation, from 1.
        number: usize,
        name: &'static str,
        text: String,
    },
    #[error("[[operation]] {number}: {fault}")]
    Fault {
        /// Number of the operation, from 1.
        number: usize,
        fault: Fault,
    },
}

/// The joints along an operation.
#[derive(Clone, Debug, PartialEq)]
pub struct Done {
    /// Name of the operation.
    pub name: &'static str,
    /// Poses in the machine, machine units and degrees, with the joint values.
    pub places: Vec<([f64; 6], Joints)>,
    /// Length so far, and changes of the joints since the operation's start.
    pub along: Vec<Along>,
}

/// A job within the machine's limits.
#[derive(Clone, Debug)]
pub struct Job {
    pub program: String,
    /// Every operation except tool changes.
    pub done: Vec<Done>,
}

/// Plans the job of a file on a machine.
///
/// # Errors
/// See [`JobError`].
pub fn job(config: &Mechanism, file: &PathFile) -> Result<Job, JobError> {
    let tolerance = file.tolerance.ok_or(JobError::Keys("[tolerance] chord_mm: missing"))?;
    let blend = file.program.blend_mm.unwrap_or(tolerance.chord_mm).0;
    let title = file.program.title.clone().unwrap_or("Typical paths".into());
    let comments = [title, "made by pkm path".into()];
    let mut writer = Writer::begin(config, &file.program, &comments, blend)?;
    let mut parts = vec![];
    for (n, operation) in file.operation.iter().enumerate() {
        let steps = operation.steps(n + 1, tolerance.chord_mm.0)?;
        writer.line(&format!("; {}: {}", n + 1, operation.name()));
        let (line, first) = (writer.lines() + 1, writer.moves.len());
        for step in &steps {
            write(&mut writer, step)?;
        }
        parts.push(Part { line, moves: first..writer.moves.len() });
    }
    let (program, moves, _) = writer.end();
    check(config, &file.operation, &parts, &moves)?;
    let mut done = vec![];
    for (n, (operation, part)) in file.operation.iter().zip(&parts).enumerate() {
        if !matches!(operation, Operation::Tool(_)) {
            let fault = |fault| JobError::Fault { number: n + 1, fault };
            let places = places(config, &moves, part.moves.clone()).map_err(fault)?;
            let along = along(places.iter().copied());
            done.push(Done { name: operation.name(), places, along });
        }
    }
    Ok(Job { program, done })
}

/// Lines and moves of an operation.
struct Part {
    line: u32,
    moves: std::ops::Range<usize>,
}

fn write(writer: &mut Writer, step: &Step) -> Result<(), SetupError> {
    match step {
        Step::Rapid(to) => {
            let (pose, named) = named(to);
            writer.rapid(&pose, &named);
        }
        Step::Cut(to, feed) => {
            let (pose, named) = named(to);
            writer.cut(&pose, &named, *feed);
        }
        Step::Turn { plane, end, level, centre, is_left, turns, feed } => {
            let mut pose = writer.pose();
            let [first, second, across] = PLANES[*plane];
            [pose[first], pose[second]] = *end;
            pose[across] = level.unwrap_or(pose[across]);
            let arc = Arc { plane: *plane, centre: *centre, is_left: *is_left, length: 0.0 };
            let named = if level.is_some() { &PLANES[*plane][..] } else { &PLANES[*plane][..2] };
            writer.arc_to(&pose, named, &arc, *turns, *feed, None);
        }
        Step::Tool(change) => {
            let [x, y, z] = change.park_mm;
            let park = [x, y, z, 0.0, 0.0, 0.0];
            if writer.has_moved() {
                writer.rapid(&park, &[0, 1, 2]);
                writer.rapid(&park, &[3, 4, 5]);
            }
            if let Some(tool) = change.tool {
                writer.take(tool)?;
                // All coordinates are named, because the next operation may name only some of them.
                writer.rapid(&park, &[0, 1, 2, 3, 4, 5]);
            }
            match change.spindle_rpm {
                Some(speed) => writer.spin_at(speed),
                None if change.tool.is_some() => writer.spin_on(),
                None => {}
            }
        }
    }
    Ok(())
}

fn named(to: &[Option<f64>; 6]) -> ([f64; 6], Vec<usize>) {
    (to.map(|value| value.unwrap_or(0.0)), (0..6).filter(|k| to[*k].is_some()).collect())
}

fn check(
    config: &Mechanism,
    operations: &[Operation],
    parts: &[Part],
    moves: &[Move],
) -> Result<(), JobError> {
    let found = preflight(std::slice::from_ref(config), moves)
        .map_err(|fault| JobError::Fault { number: 1, fault })?;
    let Some(first) = found.breaks.iter().min_by_key(|broken| broken.line) else { return Ok(()) };
    let at = parts.iter().rposition(|part| part.line <= first.line).unwrap_or(0);
    let (number, name, text) = (at + 1, operations[at].name(), first.text.clone());
    Err(JobError::Leaves { number, name, text })
}

/// Returns poses along moves, with the joint values.
fn places(
    config: &Mechanism,
    moves: &[Move],
    range: std::ops::Range<usize>,
) -> Result<Vec<([f64; 6], Joints)>, Fault> {
    let mut all = vec![];
    // The rapid moves to an operation are not part of it.
    let first = range.clone().find(|n| moves[*n].kind == MoveKind::Feed).unwrap_or(range.start);
    let mut from = if first > 0 { moves[first - 1].end } else { config.start };
    for step in &moves[first..range.end] {
        let tool = config.spindle + Vector3::from(step.tool);
        let own = config.chain.machine_tool(&tool);
        let joints = |pose: [f64; 6]| -> Result<_, Fault> {
            let machine = Pose::from_degrees(carried(config, &pose, &tool)?);
            Ok((pose, config.machine.inverse(&machine, &own)?))
        };
        if all.is_empty() {
            all.push(joints(from)?);
        }
        let change: [f64; 6] = std::array::from_fn(|k| step.end[k] - from[k]);
        let size = |of: &[f64]| of.iter().map(|x| x * x).sum::<f64>().sqrt();
        let count = (size(&change[..3]) / (APART_MM * config.units_per_mm))
            .max(size(&change[3..]) / APART_DEG)
            .ceil()
            .max(1.0);
        for n in 1..=count as usize {
            let share = n as f64 / count;
            all.push(joints(std::array::from_fn(|k| from[k] + share * change[k]))?);
        }
        from = step.end;
    }
    Ok(all)
}

/// Formats the poses of all operations as CSV, machine units and degrees.
pub fn csv(config: &Mechanism, job: &Job) -> String {
    let count = config.joints.len();
    let mut header = ["operation", "kind", "length"].map(String::from).to_vec();
    header.extend(coordinates());
    header.extend(joint_names(count));
    header.extend((0..count).map(|i| format!("change_{i}")));
    let rows = job.done.iter().enumerate().flat_map(|(n, done)| {
        done.places.iter().zip(&done.along).map(move |((pose, joints), along)| {
            let names = [(n + 1).to_string(), done.name.into(), along.length.to_string()];
            let numbers = pose.iter().chain(&joints[..count]).chain(&along.change[..count]);
            names.into_iter().chain(numbers.map(|x| (x + 0.0).to_string())).collect::<Vec<_>>()
        })
    });
    files::csv(&header, rows)
}
