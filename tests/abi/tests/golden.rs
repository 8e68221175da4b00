// SPDX-License-Identifier: GPL-2.0-or-later
//! The golden rows, through the built module.

use abi_tests::machines::Hexapod;
use abi_tests::module::{Module, Pose};
use abi_tests::tolerances::{GOLDEN_JACOBIAN, GOLDEN_JOINT_MM};
use serde::Deserialize;

type Anchors = [[f64; 3]; 6];

#[derive(Deserialize)]
struct Golden {
    machine: Vec<Machine>,
}

#[derive(Deserialize)]
struct Machine {
    name: String,
    home: [f64; 6],
    base: Anchors,
    platform: Anchors,
    lead: f64,
    #[serde(default)]
    base_axis: Anchors,
    #[serde(default)]
    platform_axis: Anchors,
    row: Vec<Row>,
    jacobian: Jacobian,
}

#[derive(Deserialize)]
struct Row {
    pose: [f64; 6],
    joints: [f64; 6],
}

#[derive(Deserialize)]
struct Jacobian {
    pose: [f64; 6],
    rows: [[f64; 6]; 6],
}

fn golden() -> Vec<Machine> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../golden/hexapods.toml");
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let golden: Golden = toml::from_str(&text).unwrap_or_else(|error| panic!("{path}: {error}"));
    golden.machine
}

fn nine(six: &[f64; 6]) -> Pose {
    std::array::from_fn(|i| six.get(i).copied().unwrap_or(0.0))
}

fn module(machine: &Machine) -> Module {
    let hexapod = Hexapod {
        base: machine.base,
        platform: machine.platform,
        base_axis: machine.base_axis,
        platform_axis: machine.platform_axis,
        lead: machine.lead,
        spindle_offset: 0.0,
        tool_offset: 0.0,
        home: Some(nine(&machine.home)),
    };
    hexapod.module()
}

#[test]
fn inverse_gives_the_golden_joints() {
    for machine in golden() {
        let module = module(&machine);
        for row in &machine.row {
            let found = module.inverse(&nine(&row.pose)).expect("a pose of the workspace");
            for (joint, (one, other)) in found.iter().zip(row.joints).enumerate() {
                let message = format!("{} {:?} joint {joint}", machine.name, row.pose);
                assert!((one - other).abs() <= GOLDEN_JOINT_MM, "{message}: {one} {other}");
            }
        }
    }
}

#[test]
fn forward_gives_the_golden_poses_from_home() {
    for machine in golden() {
        let module = module(&machine);
        for row in &machine.row {
            let mut joints = [0.0; 16];
            joints[..6].copy_from_slice(&row.joints);
            let found = module.forward(&joints, &nine(&machine.home)).expect("solves from home");
            for (one, other) in found.iter().zip(row.pose) {
                let message = format!("{} {:?}: {found:?}", machine.name, row.pose);
                assert!((one - other).abs() <= 10.0 * GOLDEN_JOINT_MM, "{message}");
            }
        }
    }
}

#[test]
fn the_jacobian_has_the_golden_elements() {
    for machine in golden() {
        let module = module(&machine);
        let pose = nine(&machine.jacobian.pose);
        let joints = module.inverse(&pose).expect("a pose of the workspace");
        let found = module.jacobian(&joints, &pose).expect("a regular pose");
        for (row, (found, expected)) in found.iter().zip(&machine.jacobian.rows).enumerate() {
            for (column, (one, other)) in found.iter().zip(expected).enumerate() {
                let message = format!("{} [{row}][{column}]: {one} {other}", machine.name);
                assert!((one - other).abs() <= GOLDEN_JACOBIAN, "{message}");
            }
        }
    }
}
