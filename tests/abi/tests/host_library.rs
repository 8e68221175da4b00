// SPDX-License-Identifier: GPL-2.0-or-later
//! The installed module and the host library are one code: same bits.

use abi_tests::machines::{Hexapod, PAPER_004_HOME, paper_004, paper_004_pose};
use abi_tests::module::{Module, Pose};
use abi_tests::random::{Random, cases};
use kinematics::leg::StrutGeometry;
use kinematics::{Coordinates, Geometry, LegGeometry, Machine, Solver, Vector3};

fn geometry(machine: &Hexapod) -> Geometry<6> {
    let strut = |leg: usize| StrutGeometry {
        base_axis: machine.base_axis[leg],
        platform_axis: machine.platform_axis[leg],
        lead: machine.lead,
    };
    Geometry {
        legs: std::array::from_fn(|leg| {
            LegGeometry::strut(machine.base[leg], machine.platform[leg], strut(leg))
        }),
        home: machine.home.map(|home| six(&home)),
        coordinates: Coordinates::XYZABC,
    }
}

fn six(pose: &Pose) -> [f64; 6] {
    std::array::from_fn(|i| pose[i])
}

fn machines() -> [Hexapod; 4] {
    [
        paper_004(),
        Hexapod { lead: 0.0, ..paper_004() },
        Hexapod { home: None, ..paper_004() },
        Hexapod { tool_offset: 80.0, spindle_offset: -12.5, ..paper_004() },
    ]
}

/// The host's frozen machine, tool and solver as the module's pins have them.
fn host(machine: &Hexapod, module: &Module) -> (Machine<6>, Vector3<f64>, Solver) {
    let frozen = Machine::freeze(&geometry(machine), &[0.0; 6]).expect("a good machine");
    let tool = Vector3::new(0.0, 0.0, machine.spindle_offset + machine.tool_offset);
    let solver = Solver {
        limit_iterations: module.get("limit-iterations") as u32,
        convergence_criterion: module.get("convergence-criterion"),
        ..Solver::default()
    };
    (frozen, tool, solver)
}

#[test]
fn inverse_gives_the_same_bits_as_the_host_library() {
    for machine in machines() {
        let module = machine.module();
        let (frozen, tool, _) = host(&machine, &module);
        let mut random = Random::new(7);
        for _ in 0..cases(20_000) {
            let pose = paper_004_pose(&mut random);
            let ours = module.inverse(&pose).expect("a pose of the workspace");
            let host = frozen
                .inverse(&kinematics::Pose::from_degrees(six(&pose)), &tool)
                .expect("a pose of the workspace");
            assert_eq!(ours[..6].map_bits(), host.map_bits(), "{pose:?}");
        }
    }
}

#[test]
fn forward_gives_the_same_bits_as_the_host_library_near_and_far() {
    for machine in machines() {
        let module = machine.module();
        let (frozen, tool, solver) = host(&machine, &module);
        let mut random = Random::new(8);
        for _ in 0..cases(2_000) {
            let pose = paper_004_pose(&mut random);
            let joints = module.inverse(&pose).expect("a pose of the workspace");
            let mut near = pose;
            near[0] += 0.5;
            for seed in [near, PAPER_004_HOME] {
                let ours = module.forward(&joints, &seed).expect("solves");
                let six_joints = std::array::from_fn(|i| joints[i]);
                let start = kinematics::Pose::from_degrees(six(&seed));
                let host = frozen.forward(&six_joints, &start, &tool, &solver).expect("solves");
                let host = host.pose.to_degrees();
                assert_eq!(ours[..6].map_bits(), host.map_bits(), "{pose:?} from {seed:?}");
            }
        }
    }
}

#[test]
fn the_geometry_hash_on_the_pin_is_the_host_librarys() {
    for machine in machines() {
        let module = machine.module();
        assert_eq!(module.get("geometry-hash") as u32, geometry(&machine).hash());
    }
}

/// Bits of numbers, so that −0 and NaN compare as what they are.
trait MapBits {
    fn map_bits(&self) -> Vec<u64>;
}

impl MapBits for [f64] {
    fn map_bits(&self) -> Vec<u64> {
        self.iter().map(|value| value.to_bits()).collect()
    }
}
