// SPDX-License-Identifier: GPL-2.0-or-later
//! The installed module and the host library are the same code: same bits, for every kind of
//! leg, redundant or not, with a table and without.

use abi_tests::machines::{Hexapod, paper_004, paper_004_pose};
use abi_tests::module::{Module, Pose};
use abi_tests::parallel::{Kind, Leg, Parallel};
use abi_tests::random::{Random, cases};
use abi_tests::subjects::{Subject, subjects};
use kinematics::leg::{CrankGeometry, RingGeometry, SliderGeometry, StrutGeometry};
use kinematics::{
    Geometry, Joints, LegGeometry, LegKind, Letters, MAX_JOINTS, Machine, Solver, Vector3,
};

fn leg(leg: &Leg) -> LegGeometry {
    let (base, platform) = (leg.base, leg.platform);
    let kind = match leg.kind {
        Kind::Strut { base_axis, platform_axis, lead } => {
            let strut = StrutGeometry { base_axis, platform_axis, lead };
            return LegGeometry::strut(base, platform, strut);
        }
        Kind::Slider { guide, rod, side } => LegKind::Slider(SliderGeometry { guide, rod, side }),
        Kind::Crank { axis, arm, rod, side } => {
            LegKind::Crank(CrankGeometry { axis, arm, rod, side })
        }
        Kind::Ring { radius } => LegKind::Ring(RingGeometry { radius }),
    };
    LegGeometry { base, platform, kind }
}

fn geometry(machine: &Parallel) -> Geometry {
    let letters = |text: &str| Letters::parse(text.as_bytes()).expect("letters");
    let legs: Vec<LegGeometry> = machine.legs.iter().map(leg).collect();
    let layout = Geometry::new(&legs, letters(machine.coordinates), letters(machine.table));
    let mut geometry = layout.expect("legs and letters that fit");
    geometry.centre = machine.centre;
    geometry.home = machine.home.map(|home| six(&home));
    geometry
}

fn six(pose: &Pose) -> [f64; 6] {
    std::array::from_fn(|i| pose[i])
}

/// Returns every machine, and the options of a hexapod.
fn machines() -> Vec<Subject> {
    let hexapod =
        |name, machine: Hexapod| Subject { name, machine: machine.into(), sample: paper_004_pose };
    let mut all = subjects();
    all.push(hexapod("without lead", Hexapod { lead: 0.0, ..paper_004() }));
    let tools = Hexapod { tool_offset: 80.0, spindle_offset: -12.5, ..paper_004() };
    all.push(hexapod("with both offsets", tools));
    all
}

/// Returns the host's frozen machine, tool and solver with the values of the module's pins.
fn host(machine: &Parallel, module: &Module) -> (Machine, Vector3<f64>, Solver) {
    let frozen = Machine::freeze(&geometry(machine), &[0.0; 8]).expect("a good machine");
    let [x, y, z] = machine.tool;
    let solver = Solver {
        limit_iterations: module.get("limit-iterations") as u32,
        convergence_criterion: module.get("convergence-criterion"),
        residual_limit: module.get("residual-limit"),
        ..Solver::default()
    };
    (frozen, Vector3::new(x, y, machine.spindle_offset + z), solver)
}

fn host_joints(joints: &[f64]) -> Joints {
    let mut all = [0.0; MAX_JOINTS];
    all.copy_from_slice(&joints[..MAX_JOINTS]);
    all
}

#[test]
fn inverse_gives_the_same_bits_as_the_host_library() {
    for subject in machines() {
        let module = subject.machine.module();
        let (frozen, tool, _) = host(&subject.machine, &module);
        let mut random = Random::new(7);
        for _ in 0..cases(20_000) {
            let pose = (subject.sample)(&mut random);
            let ours = module.inverse(&pose).expect("a pose of the workspace");
            let host = frozen
                .inverse(&kinematics::Pose::from_degrees(six(&pose)), &tool)
                .expect("a pose of the workspace");
            assert_eq!(
                host_joints(&ours).map_bits(),
                host.map_bits(),
                "{}: {pose:?}",
                subject.name
            );
        }
    }
}

/// A hexapod without a reference pose uses the literal arcsin, which forward cannot
/// always follow: inverse only.
#[test]
fn inverse_gives_the_same_bits_without_a_reference_pose() {
    let machine = Parallel::from(Hexapod { home: None, ..paper_004() });
    let module = machine.module();
    let (frozen, tool, _) = host(&machine, &module);
    let mut random = Random::new(7);
    for _ in 0..cases(20_000) {
        let pose = paper_004_pose(&mut random);
        let ours = module.inverse(&pose).expect("a pose of the workspace");
        let host = frozen.inverse(&kinematics::Pose::from_degrees(six(&pose)), &tool);
        let host = host.expect("a pose of the workspace");
        assert_eq!(host_joints(&ours).map_bits(), host.map_bits(), "{pose:?}");
    }
}

#[test]
fn forward_gives_the_same_bits_as_the_host_library_near_and_far() {
    for subject in machines() {
        let module = subject.machine.module();
        let (frozen, tool, solver) = host(&subject.machine, &module);
        let mut random = Random::new(8);
        for _ in 0..cases(2_000) {
            let pose = (subject.sample)(&mut random);
            let joints = module.inverse(&pose).expect("a pose of the workspace");
            let mut near = pose;
            near[2] += 4e-4 * subject.machine.size();
            for seed in [near, subject.home()] {
                let ours = module.forward(&joints, &seed).expect("solves");
                let start = kinematics::Pose::from_degrees(six(&seed));
                let host = frozen.forward(&host_joints(&joints), &start, &tool, &solver);
                let host = host.expect("solves").pose.to_degrees();
                let (ours, name) = (ours[..6].map_bits(), subject.name);
                assert_eq!(ours, host.map_bits(), "{name}: {pose:?} from {seed:?}");
            }
        }
    }
}

#[test]
fn the_jacobian_has_the_same_bits_as_the_host_librarys() {
    for subject in machines() {
        let module = subject.machine.module();
        let (frozen, tool, _) = host(&subject.machine, &module);
        let mut random = Random::new(9);
        for _ in 0..cases(2_000) {
            let pose = (subject.sample)(&mut random);
            let ours = module.jacobian(&[0.0; 16], &pose).expect("a regular pose");
            let start = kinematics::Pose::from_degrees(six(&pose));
            let host = frozen
                .at(&start, &tool)
                .expect("a regular pose")
                .pose_jacobian()
                .expect("a regular pose");
            for (row, (ours, host)) in ours.iter().zip(host.row_iter()).enumerate() {
                let host: Vec<u64> = host.iter().map(|value| value.to_bits()).collect();
                assert_eq!(ours[..6].map_bits(), host, "{} row {row}: {pose:?}", subject.name);
            }
        }
    }
}

#[test]
fn the_geometry_hash_on_the_pin_is_the_host_librarys() {
    let mut seen = Vec::new();
    for subject in machines() {
        let hash = subject.machine.module().get("geometry-hash") as u32;
        assert_eq!(hash, geometry(&subject.machine).hash(), "{}", subject.name);
        // Tools have no effect; the subjects without one all differ.
        if subject.machine.tool == [0.0; 3] {
            assert!(!seen.contains(&hash), "{}", subject.name);
            seen.push(hash);
        }
    }
}

/// Bits of numbers, so that −0 and NaN are compared exactly.
trait MapBits {
    fn map_bits(&self) -> Vec<u64>;
}

impl MapBits for [f64] {
    fn map_bits(&self) -> Vec<u64> {
        self.iter().map(|value| value.to_bits()).collect()
    }
}
