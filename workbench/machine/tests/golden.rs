// SPDX-License-Identifier: GPL-2.0-or-later
//! Comparison of the core with the golden rows; see the files in tests/cases/golden for their origin. The module's tests
//! compare poses and Jacobians, and show that this build of the core has the same bits.

use kinematics::leg::{SliderGeometry, StrutGeometry};
use kinematics::{Geometry, LegGeometry, LegKind, Letters, MAX_LEGS, Machine, Pose, Vector3};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use test_support::shipped::root;

/// Rows have 16 digits of lengths near 1000: some roundings of 1e-13.
const LENGTH_TOLERANCE_MM: f64 = 1e-9;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File<T> {
    machine: Vec<T>,
}

#[derive(Deserialize)]
struct Hexapod {
    name: String,
    home: [f64; 6],
    base: [[f64; 3]; 6],
    platform: [[f64; 3]; 6],
    lead: f64,
    base_axis: Option<[[f64; 3]; 6]>,
    platform_axis: Option<[[f64; 3]; 6]>,
    row: Vec<Row>,
}

#[derive(Deserialize)]
struct SliderMachine {
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
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    pose: [f64; 6],
    joints: Vec<f64>,
    lengths: Option<Vec<f64>>,
}

/// A machine of either file.
struct Golden {
    name: String,
    geometry: Geometry,
    row: Vec<Row>,
}

impl Golden {
    fn machine(&self) -> Machine {
        Machine::freeze(&self.geometry, &[0.0; MAX_LEGS]).unwrap()
    }

    fn close(&self, got: &[f64], expected: &[f64], tolerance: f64) {
        for (got, expected) in got.iter().zip(expected) {
            let off = (got - expected).abs();
            assert!(off <= tolerance, "{}: {got} instead of {expected}", self.name);
        }
    }
}

impl From<Hexapod> for Golden {
    fn from(given: Hexapod) -> Self {
        let axis = |axes: &Option<[[f64; 3]; 6]>, i: usize| axes.map_or([0.0; 3], |a| a[i]);
        let leg = |i: usize| {
            let strut = StrutGeometry {
                base_axis: axis(&given.base_axis, i),
                platform_axis: axis(&given.platform_axis, i),
                lead: given.lead,
            };
            LegGeometry::strut(given.base[i], given.platform[i], strut)
        };
        let legs: [LegGeometry; 6] = std::array::from_fn(leg);
        let mut geometry = Geometry::new(&legs, Letters::XYZABC, Letters::NONE).unwrap();
        geometry.home = Some(given.home);
        Self { name: given.name, geometry, row: given.row }
    }
}

impl From<SliderMachine> for Golden {
    fn from(given: SliderMachine) -> Self {
        assert!(given.kinds.iter().all(|kind| kind == "slider"), "{:?}", given.kinds);
        let leg = |i: usize| LegGeometry {
            base: given.base[i],
            platform: given.platform[i],
            kind: LegKind::Slider(SliderGeometry {
                guide: given.guide[i],
                rod: given.rod[i],
                side: given.side[i],
            }),
        };
        let legs: Vec<LegGeometry> = (0..given.kinds.len()).map(leg).collect();
        let letters = |text: &str| Letters::parse(text.as_bytes()).unwrap();
        let (coordinates, table) = (letters(&given.coordinates), letters(&given.table));
        let mut geometry = Geometry::new(&legs, coordinates, table).unwrap();
        (geometry.centre, geometry.home) = (given.centre, Some(given.home));
        Self { name: given.name, geometry, row: given.row }
    }
}

fn machines<T: DeserializeOwned + Into<Golden>>(file: &str) -> impl Iterator<Item = Golden> {
    let text = std::fs::read_to_string(root().join("tests/cases/golden").join(file)).unwrap();
    let file: File<T> = toml::from_str(&text).unwrap();
    file.machine.into_iter().map(Into::into)
}

fn golden() -> Vec<Golden> {
    let hexapods = machines::<Hexapod>("hexapods.toml");
    let all: Vec<Golden> = hexapods.chain(machines::<SliderMachine>("sliders.toml")).collect();
    assert_eq!(all.len(), 5);
    all
}

#[test]
fn inverse_and_corrections_give_the_golden_rows() {
    for golden in golden() {
        let machine = golden.machine();
        for row in &golden.row {
            let (pose, tool) = (Pose::from_degrees(row.pose), Vector3::zeros());
            let joints = machine.inverse(&pose, &tool).unwrap();
            assert_eq!(row.joints.len(), machine.layout().joints());
            golden.close(&joints, &row.joints, LENGTH_TOLERANCE_MM);
            let corrections = machine.at(&pose, &tool).unwrap().corrections();
            let lengths: Vec<f64> = joints.iter().zip(corrections).map(|(j, c)| j - c).collect();
            let expected = row.lengths.as_ref().unwrap_or(&row.joints);
            golden.close(&lengths, expected, LENGTH_TOLERANCE_MM);
        }
    }
}

#[test]
fn shipped_configurations_are_the_golden_machines() {
    for golden in golden() {
        let ini = format!("configs/{0}/{0}.ini", golden.name);
        let config = test_support::shipped::first_of(&root().join(ini));
        assert_eq!(config.geometry, golden.geometry, "{}", golden.name);
    }
}
