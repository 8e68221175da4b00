// SPDX-License-Identifier: GPL-2.0-or-later
//! The inverse problem: from laws of the joints to the path of the tool, by forward kinematics seeded with the
//! previous pose.

use crate::expression::{Expression, ExpressionError, Trouble};
use crate::file::{CarriageKeys, PathFile};
use kinematics::{Fault, Joints, MAX_JOINTS, Vector3};
use machine::files;
use machine::limits;
use machine::proof::jet::Taylor;
use machine::read::columns::{coordinates, joint_names};
use machine::read::mechanism::Mechanism;
use machine::read::tools;
use program::motion::extra_home;
use std::ops::ControlFlow;

/// Why the laws of the joints give no path.
#[derive(Debug, thiserror::Error)]
pub enum CarriageError {
    #[error("[carriages]: {0}")]
    Keys(String),
    #[error("[carriages] laws_mm_or_deg {joint}: {error}")]
    Expression { joint: usize, error: ExpressionError },
    #[error("[carriages] laws_mm_or_deg {joint}: at t = {t}: {trouble}")]
    Trouble {
        joint: usize,
        /// Time, s.
        t: f64,
        trouble: Trouble,
    },
    #[error("at t = {t}: {fault}")]
    Fault {
        /// Time, s.
        t: f64,
        fault: Fault,
    },
    #[error("at t = {t}: {text}")]
    Leaves {
        /// Time, s.
        t: f64,
        text: String,
    },
    #[error(transparent)]
    Table(#[from] tools::TableError),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CarriagePose {
    /// Time, s.
    pub t: f64,
    pub joints: Joints,
    /// The commanded pose: x y z in machine units, a b c in degrees.
    pub pose: [f64; 6],
    /// Residual of the forward kinematics; above 0 if redundant joints contradict each other.
    pub residual: f64,
}

/// Computes the path of the tool tip for the laws of a file, one pose per servo cycle.
///
/// # Errors
/// See [`CarriageError`].
pub fn taken(config: &Mechanism, file: &PathFile) -> Result<Vec<CarriagePose>, CarriageError> {
    let missing = || CarriageError::Keys("missing".into());
    let keys = file.carriages.as_ref().ok_or_else(missing)?;
    let laws = laws(config, file, keys)?;
    let tool = tool(config, file)?;
    let [first, last] = keys.t_s;
    if !(first < last && first.is_finite() && last.is_finite()) {
        let text = format!("t_s: {first} to {last}: expected the smaller number first");
        return Err(CarriageError::Keys(text));
    }
    let count = ((last - first) / config.period).ceil();
    if count > MOST_PLACES {
        return Err(CarriageError::Keys(format!(
            "t_s: more than {MOST_PLACES} servo cycles; use a shorter range"
        )));
    }
    let own = config.chain.machine_tool(&tool);
    let mut seed = config.home_pose();
    let mut all = vec![];
    for n in 0..=count as usize {
        let t = first + (last - first) * n as f64 / count;
        let joints = joints(config, &laws, t)?;
        let found = config.machine.forward(&joints, &seed, &own, &config.solver);
        let found = found.map_err(|fault| CarriageError::Fault { t, fault })?;
        seed = found.pose;
        check(config, t, &seed, &own)?;
        let pose = programmed(config, &seed.to_degrees(), &tool);
        let pose = pose.map_err(|fault| CarriageError::Fault { t, fault })?;
        all.push(CarriagePose { t, joints, pose, residual: found.residual });
    }
    Ok(all)
}

/// Converts the machine's own pose to a commanded one, with the extra axes at home.
fn programmed(
    config: &Mechanism,
    machine: &[f64; 6],
    tool: &Vector3<f64>,
) -> Result<[f64; 6], Fault> {
    if config.chain.is_empty() {
        return Ok(*machine);
    }
    let mut world = config.world(machine, &extra_home(config));
    config.chain.to_world(machine, &mut world, tool)?;
    Ok(std::array::from_fn(|k| if config.chain.is_extra(k) { 0.0 } else { world[k] }))
}

/// Largest number of poses: an hour of servo cycles.
const MOST_PLACES: f64 = 3.6e6;

fn laws(
    config: &Mechanism,
    file: &PathFile,
    keys: &CarriageKeys,
) -> Result<Vec<Expression>, CarriageError> {
    let (given, count) = (keys.laws_mm_or_deg.len(), config.joints.len());
    if given != count {
        let text = format!("laws_mm_or_deg: expected {count}, one per joint; found {given}");
        return Err(CarriageError::Keys(text));
    }
    let law = |(joint, law): (usize, &crate::file::Formula)| {
        Expression::parse(&law.0, &["t"], &file.parameters)
            .map_err(|error| CarriageError::Expression { joint, error })
    };
    keys.laws_mm_or_deg.iter().enumerate().map(law).collect()
}

fn tool(config: &Mechanism, file: &PathFile) -> Result<Vector3<f64>, CarriageError> {
    let Some(number) = file.program.tool else { return Ok(config.spindle) };
    let all = tools::read(config)?;
    let found = all.iter().find(|tool| tool.number == i64::from(number));
    let missing = || {
        CarriageError::Keys(format!(
            "tool {number} is not in the tool table: add it, or choose another"
        ))
    };
    Ok(config.spindle + found.ok_or_else(missing)?.offset)
}

/// Evaluates the joint values at a time.
fn joints(config: &Mechanism, laws: &[Expression], t: f64) -> Result<Joints, CarriageError> {
    let mut joints = [0.0; MAX_JOINTS];
    for (joint, law) in laws.iter().enumerate() {
        let found = law.at(&[Taylor::constant(t)]);
        let found = found.map_err(|trouble| CarriageError::Trouble { joint, t, trouble })?;
        let own = &config.joints[joint];
        let is_arm = config.unit(own.kind) == "degrees";
        joints[joint] = found.value.middle() * if is_arm { 1.0 } else { config.units_per_mm };
    }
    Ok(joints)
}

fn check(
    config: &Mechanism,
    t: f64,
    pose: &kinematics::Pose,
    tool: &Vector3<f64>,
) -> Result<(), CarriageError> {
    let at = config.machine.at(pose, tool).map_err(|fault| CarriageError::Fault { t, fault })?;
    let mut broken = None;
    let _ = at.margins(&limits::of(config), |margin| match margin.is_kept() {
        true => ControlFlow::Continue(()),
        false => {
            broken = Some(limits::sentence(config, &margin));
            ControlFlow::Break(())
        }
    });
    broken.map_or(Ok(()), |text| Err(CarriageError::Leaves { t, text }))
}

/// Formats the poses as CSV: seconds, joints, pose and residual.
pub fn csv(config: &Mechanism, places: &[CarriagePose]) -> String {
    let count = config.joints.len();
    let mut header = vec!["t".to_string()];
    header.extend(joint_names(count));
    header.extend(coordinates());
    header.push("residual".to_string());
    let row = |place: &CarriagePose| {
        let numbers = [place.t].into_iter().chain(place.joints.into_iter().take(count));
        numbers.chain(place.pose).chain([place.residual]).map(|x| x + 0.0).collect::<Vec<_>>()
    };
    files::csv(&header, places.iter().map(row))
}
