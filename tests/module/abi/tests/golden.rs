// SPDX-License-Identifier: GPL-2.0-or-later
//! The golden rows, through the built module.

use abi_tests::machines::Hexapod;
use abi_tests::module::Joints;
use abi_tests::parallel::{Kind, Leg, Parallel};
use abi_tests::subjects::pose;
use abi_tests::tolerances::{GOLDEN_JACOBIAN, GOLDEN_JOINT_MM};
use serde::Deserialize;
use serde::de::DeserializeOwned;

type Anchors = [[f64; 3]; 6];

#[derive(Deserialize)]
struct Golden<M> {
    machine: Vec<M>,
}

/// A machine with its rows, for any kinds of legs.
struct Case {
    name: String,
    machine: Parallel,
    rows: Vec<Row>,
    jacobian: Jacobian,
}

#[derive(Deserialize)]
struct OfStruts {
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
struct OfRods {
    name: String,
    kinds: Vec<String>,
    home: [f64; 6],
    coordinates: String,
    table: String,
    centre: [f64; 3],
    base: Vec<[f64; 3]>,
    guide: Vec<[f64; 3]>,
    platform: Vec<[f64; 3]>,
    rod: Vec<f64>,
    side: Vec<i32>,
    row: Vec<Row>,
    jacobian: Jacobian,
}

#[derive(Deserialize)]
struct Row {
    pose: [f64; 6],
    joints: Vec<f64>,
}

#[derive(Deserialize)]
struct Jacobian {
    pose: [f64; 6],
    rows: Vec<[f64; 6]>,
}

fn read<M: DeserializeOwned>(name: &str) -> Vec<M> {
    let path = format!("{}/../../cases/golden/{name}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let golden: Golden<M> = toml::from_str(&text).unwrap_or_else(|error| panic!("{path}: {error}"));
    golden.machine
}

impl From<OfStruts> for Case {
    fn from(given: OfStruts) -> Self {
        let hexapod = Hexapod {
            base: given.base,
            platform: given.platform,
            base_axis: given.base_axis,
            platform_axis: given.platform_axis,
            lead: given.lead,
            spindle_offset: 0.0,
            tool_offset: 0.0,
            home: Some(pose(given.home)),
        };
        let machine = Parallel::from(hexapod);
        Self { name: given.name, machine, rows: given.row, jacobian: given.jacobian }
    }
}

impl From<OfRods> for Case {
    fn from(given: OfRods) -> Self {
        assert!(given.kinds.iter().all(|kind| kind == "slider"), "{:?}", given.kinds);
        let leg = |i: usize| Leg {
            base: given.base[i],
            platform: given.platform[i],
            kind: Kind::Slider { guide: given.guide[i], rod: given.rod[i], side: given.side[i] },
        };
        let legs = (0..given.kinds.len()).map(leg).collect();
        // Two short texts per machine, read once: they are kept as long as the test runs.
        let coordinates = given.coordinates.leak();
        let machine = Parallel {
            table: given.table.leak(),
            centre: given.centre,
            ..Parallel::new(legs, coordinates, pose(given.home))
        };
        Self { name: given.name, machine, rows: given.row, jacobian: given.jacobian }
    }
}

fn golden() -> Vec<Case> {
    let struts = read::<OfStruts>("hexapods.toml").into_iter().map(Case::from);
    struts.chain(read::<OfRods>("sliders.toml").into_iter().map(Case::from)).collect()
}

#[test]
fn all_five_machines_of_the_papers_have_golden_rows() {
    let cases = golden();
    assert_eq!(cases.len(), 5);
    for case in cases {
        assert!(case.rows.len() >= 5, "{}", case.name);
        assert!(case.rows.iter().all(|row| row.joints.len() == case.machine.joints()));
        assert_eq!(case.jacobian.rows.len(), case.machine.joints(), "{}", case.name);
    }
}

#[test]
fn inverse_gives_the_golden_joints() {
    for case in golden() {
        let module = case.machine.module();
        for row in &case.rows {
            let found = module.inverse(&pose(row.pose)).expect("a pose of the workspace");
            for (joint, (one, other)) in found.iter().zip(&row.joints).enumerate() {
                let message = format!("{} {:?} joint {joint}", case.name, row.pose);
                assert!((one - other).abs() <= GOLDEN_JOINT_MM, "{message}: {one} {other}");
            }
        }
    }
}

#[test]
fn forward_gives_the_golden_poses_from_home() {
    for case in golden() {
        let module = case.machine.module();
        let home = case.machine.home.expect("given");
        for row in &case.rows {
            let mut joints: Joints = [0.0; 16];
            joints[..row.joints.len()].copy_from_slice(&row.joints);
            let found = module.forward(&joints, &home).expect("solves from home");
            for (one, other) in found.iter().zip(row.pose) {
                let message = format!("{} {:?}: {found:?}", case.name, row.pose);
                assert!((one - other).abs() <= 10.0 * GOLDEN_JOINT_MM, "{message}");
            }
        }
    }
}

/// All columns, including those of constant letters: the plain derivatives.
#[test]
fn the_jacobian_has_the_golden_elements() {
    for case in golden() {
        let module = case.machine.module();
        let at = pose(case.jacobian.pose);
        let joints = module.inverse(&at).expect("a pose of the workspace");
        let found = module.jacobian(&joints, &at).expect("a regular pose");
        for (row, (found, expected)) in found.iter().zip(&case.jacobian.rows).enumerate() {
            for (column, (one, other)) in found.iter().zip(expected).enumerate() {
                let message = format!("{} [{row}][{column}]: {one} {other}", case.name);
                assert!((one - other).abs() <= GOLDEN_JACOBIAN, "{message}");
            }
        }
    }
}
