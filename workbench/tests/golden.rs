// SPDX-License-Identifier: GPL-2.0-or-later
//! The core gives the golden rows; see tests/golden/hexapods.toml for their origin.

use kinematics::leg::StrutGeometry;
use kinematics::{Coordinates, Geometry, LegGeometry, Machine, Pose, Solver, Vector3};
use pkm::machine::{JOINTS, MachineConfig};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Rows carry 16 digits of lengths near 1000: some roundings of 1e-13.
const LENGTH_TOLERANCE_MM: f64 = 1e-9;
/// Derivatives near 1, the same number of roundings.
const JACOBIAN_TOLERANCE: f64 = 1e-9;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Golden {
    machine: Vec<Hexapod>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Hexapod {
    name: String,
    home: [f64; 6],
    base: [[f64; 3]; JOINTS],
    platform: [[f64; 3]; JOINTS],
    lead: f64,
    base_axis: Option<[[f64; 3]; JOINTS]>,
    platform_axis: Option<[[f64; 3]; JOINTS]>,
    row: Vec<Row>,
    jacobian: Jacobian,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    pose: [f64; 6],
    joints: [f64; JOINTS],
    lengths: Option<[f64; JOINTS]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Jacobian {
    pose: [f64; 6],
    rows: [[f64; 6]; JOINTS],
}

impl Hexapod {
    fn geometry(&self) -> Geometry<JOINTS> {
        let axis = |axes: &Option<[[f64; 3]; JOINTS]>, i: usize| axes.map_or([0.0; 3], |a| a[i]);
        let legs = std::array::from_fn(|i| {
            let strut = StrutGeometry {
                base_axis: axis(&self.base_axis, i),
                platform_axis: axis(&self.platform_axis, i),
                lead: self.lead,
            };
            LegGeometry::strut(self.base[i], self.platform[i], strut)
        });
        Geometry { legs, home: Some(self.home), coordinates: Coordinates::XYZABC }
    }

    fn machine(&self) -> Machine<JOINTS> {
        Machine::freeze(&self.geometry(), &[0.0; JOINTS]).unwrap()
    }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn golden() -> Vec<Hexapod> {
    let text = std::fs::read_to_string(root().join("tests/golden/hexapods.toml")).unwrap();
    let golden: Golden = toml::from_str(&text).unwrap();
    assert_eq!(golden.machine.len(), 2);
    golden.machine
}

fn close(what: &str, got: &[f64], expected: &[f64], tolerance: f64) {
    for (got, expected) in got.iter().zip(expected) {
        assert!((got - expected).abs() <= tolerance, "{what}: {got} instead of {expected}");
    }
}

#[test]
fn inverse_and_corrections_give_the_golden_rows() {
    for hexapod in golden() {
        let machine = hexapod.machine();
        for row in &hexapod.row {
            let (pose, tool) = (Pose::from_degrees(row.pose), Vector3::zeros());
            let joints = machine.inverse(&pose, &tool).unwrap();
            close(&hexapod.name, &joints, &row.joints, LENGTH_TOLERANCE_MM);
            let corrections = machine.corrections(&pose, &tool).unwrap();
            let lengths: [f64; JOINTS] = std::array::from_fn(|i| joints[i] - corrections[i]);
            let expected = row.lengths.unwrap_or(row.joints);
            close(&hexapod.name, &lengths, &expected, LENGTH_TOLERANCE_MM);
        }
    }
}

#[test]
fn forward_from_home_finds_the_golden_poses() {
    for hexapod in golden() {
        let machine = hexapod.machine();
        let home = Pose::from_degrees(hexapod.home);
        for row in &hexapod.row {
            let found = machine.forward(&row.joints, &home, &Vector3::zeros(), &Solver::default());
            let pose = found.unwrap().pose.to_degrees();
            close(&hexapod.name, &pose, &row.pose, LENGTH_TOLERANCE_MM);
        }
    }
}

#[test]
fn pose_jacobian_gives_the_golden_rows() {
    for hexapod in golden() {
        let Jacobian { pose, rows } = &hexapod.jacobian;
        let jacobian =
            hexapod.machine().pose_jacobian(&Pose::from_degrees(*pose), &Vector3::zeros());
        let jacobian = jacobian.unwrap();
        for (i, row) in rows.iter().enumerate() {
            let got: [f64; 6] = std::array::from_fn(|a| jacobian[(i, a)]);
            close(&hexapod.name, &got, row, JACOBIAN_TOLERANCE);
        }
    }
}

#[test]
fn shipped_configurations_are_the_golden_machines() {
    for hexapod in golden() {
        let ini = format!("configs/{0}/{0}.ini", hexapod.name);
        let config = MachineConfig::read(&root().join(ini)).unwrap();
        assert_eq!(config.geometry, hexapod.geometry(), "{}", hexapod.name);
    }
}
