// SPDX-License-Identifier: GPL-2.0-or-later
//! The required motion of the joints: positions and rates, and its split between table and platform.

use crate::file::ProgramKeys;
use crate::gcode::{carried, in_machine};
use crate::motion::Node;
use crate::route_error::RouteError;
use kinematics::{Joints, MAX_JOINTS, Pose, Vector3};
use machine::files;
use machine::read::columns::{coordinates, joint_names};
use machine::read::mechanism::Mechanism;
use program::motion::extra_home;

/// A point of the path, and the machine's state there.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    pub node: Node,
    pub joints: Joints,
    /// Rates of the joints per second, if the node has a rate.
    pub rates: Option<Joints>,
    /// x y z of the platform's center, whose motion table and platform share (machine units): a
    /// table performs x and y, the platform z.
    pub centre: [f64; 3],
}

/// Computes the machine's state at all nodes.
///
/// # Errors
/// A pose out of reach, or a joint that is too slow.
pub fn rows(
    config: &Mechanism,
    keys: &ProgramKeys,
    nodes: &[Node],
    tool: [f64; 3],
) -> Result<Vec<Row>, RouteError> {
    nodes.iter().map(|node| row(config, keys, node, tool)).collect()
}

fn row(
    config: &Mechanism,
    keys: &ProgramKeys,
    node: &Node,
    tool: [f64; 3],
) -> Result<Row, RouteError> {
    let fault = |fault| RouteError::Fault { t: node.t, fault };
    let programmed = in_machine(config, keys, &tool, &node.pose);
    let offset = config.spindle + Vector3::from(tool);
    let pose = Pose::from_degrees(carried(config, &programmed, &offset).map_err(fault)?);
    let tool = config.chain.machine_tool(&offset);
    let at = config.machine.at(&pose, &tool).map_err(fault)?;
    let units = config.units_per_mm;
    let scaled = |rate: &[f64; 6]| -> [f64; 6] {
        let rate = std::array::from_fn(|k| if k < 3 { rate[k] * units } else { rate[k] });
        of_machine(config, &programmed, &offset, rate)
    };
    let rates =
        node.rate.as_ref().map(|rate| at.rates(&scaled(rate))).transpose().map_err(fault)?;
    if let Some(rates) = &rates {
        check_speeds(config, node.t, rates)?;
    }
    let lever = at.rotation() * (tool + Vector3::from(config.geometry.centre));
    // The position of the level platform: the pose minus the tool's offset, plus the rotated lever.
    let centre = (pose.position - tool + lever).into();
    Ok(Row { node: node.clone(), joints: *at.joints(), rates, centre })
}

/// Returns the rates of the machine's own pose for those of a programmed one, with the extra axes at home.
fn of_machine(
    config: &Mechanism,
    programmed: &[f64; 6],
    tool: &Vector3<f64>,
    rate: [f64; 6],
) -> [f64; 6] {
    if config.chain.is_empty() {
        return rate;
    }
    let rates = config.chain.rates(&config.world(programmed, &extra_home(config)), tool);
    let moves = |letter: &usize| !config.chain.is_extra(*letter);
    let of = |k: usize| (0..6).filter(moves).map(|letter| rates[(k, letter)] * rate[letter]).sum();
    std::array::from_fn(of)
}

fn check_speeds(config: &Mechanism, t: f64, rates: &Joints) -> Result<(), RouteError> {
    let fast = config.joints.iter().zip(rates).find(|(joint, rate)| rate.abs() > joint.speed());
    match fast {
        None => Ok(()),
        Some((joint, rate)) => Err(RouteError::TooFast {
            t,
            joint: joint.name.clone(),
            speed: rate.abs(),
            most: joint.speed(),
        }),
    }
}

/// Formats the rows as CSV: position, tangent, joints and rates, then the split of the path.
pub fn csv(config: &Mechanism, rows: &[Row]) -> String {
    let count = config.joints.len();
    let mut header = ["t", "s"].map(String::from).to_vec();
    header.extend(coordinates());
    header.extend(["tangent_x", "tangent_y", "tangent_z"].map(String::from));
    header.extend(joint_names(count));
    header.extend((0..count).map(|i| format!("rate_{i}")));
    header.extend(["centre_x", "centre_y", "centre_z"].map(String::from));
    let cell = |value: Option<f64>| value.map_or(String::new(), |value| (value + 0.0).to_string());
    let cells = |row: &Row| {
        let node = &row.node;
        let numbers = [node.t, node.s].into_iter().chain(node.pose).map(Some);
        let tangent = (0..3).map(|k| node.tangent.map(|tangent| tangent[k]));
        let joints = (0..count).map(|i| Some(row.joints[i]));
        let rates = (0..count).map(|i| row.rates.map(|rates: [f64; MAX_JOINTS]| rates[i]));
        let centre = row.centre.into_iter().map(Some);
        numbers
            .chain(tangent)
            .chain(joints)
            .chain(rates)
            .chain(centre)
            .map(cell)
            .collect::<Vec<_>>()
    };
    files::csv(&header, rows.iter().map(cells))
}
