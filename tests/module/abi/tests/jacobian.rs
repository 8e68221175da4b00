// SPDX-License-Identifier: GPL-2.0-or-later
//! The optional entry points that LinuxCNC is going to use.

use abi_tests::geometry::rotation;
use abi_tests::machines::{Hexapod, paper_004, paper_004_pose};
use abi_tests::module::{Jacobian, Module, Pose};
use abi_tests::parallel::Parallel;
use abi_tests::random::{Random, cases};
use abi_tests::subjects::{Subject, subjects};
use abi_tests::tolerances::{DIFFERENCE, DIFFERENCE_SHARE, FRAME};

const POSE: Pose = [-80.0, 60.0, 350.0, 10.0, -20.0, 5.0, 0.0, 0.0, 0.0];

/// Returns central differences of inverse over one and two steps, whose errors of third order
/// cancel; only for coordinates that the machine moves: inverse refuses the others.
fn differences(subject: &Subject, module: &Module, pose: &Pose) -> Jacobian {
    let mut result = [[f64::NAN; 9]; 16];
    for component in (0..6).filter(|c| subject.machine.moves(*c)) {
        let step = step(&subject.machine, component);
        let at = |steps: f64| {
            let mut moved = *pose;
            moved[component] += steps * step;
            module.inverse(&moved).expect("beside a pose of the workspace")
        };
        let places = [at(1.0), at(-1.0), at(2.0), at(-2.0)];
        for (joint, row) in result.iter_mut().enumerate() {
            let [ahead, behind, far, back] = places.map(|joints| joints[joint]);
            row[component] = (8.0 * (ahead - behind) - (far - back)) / (12.0 * step);
        }
    }
    result
}

fn step(machine: &Parallel, component: usize) -> f64 {
    let share = if component < 3 { machine.size() } else { 1_f64.to_degrees() };
    DIFFERENCE_SHARE * share
}

fn machines() -> Vec<Subject> {
    let hexapod =
        |name, machine: Hexapod| Subject { name, machine: machine.into(), sample: paper_004_pose };
    let mut all = subjects();
    all.push(hexapod("without lead", Hexapod { lead: 0.0, ..paper_004() }));
    let tools = Hexapod { tool_offset: 70.0, spindle_offset: -20.0, ..paper_004() };
    all.push(hexapod("with both offsets", tools));
    all
}

#[test]
fn the_jacobian_is_the_derivative_of_inverse_per_unit_and_per_degree() {
    for subject in machines() {
        let module = subject.machine.module();
        let mut random = Random::new(6);
        let mut worst = 0.0_f64;
        for _ in 0..cases(1000) {
            worst = worst.max(largest_error(&subject, &module, &(subject.sample)(&mut random)));
        }
        println!("{}: worst {worst:.1e}", subject.name);
    }
}

/// Returns the largest error of the Jacobian at a pose, as a share of its row.
fn largest_error(subject: &Subject, module: &Module, pose: &Pose) -> f64 {
    let joints = module.inverse(pose).expect("a pose of the workspace");
    let found = module.jacobian(&joints, pose).expect("a regular pose");
    let expected = differences(subject, module, pose);
    let mut worst = 0.0_f64;
    for (row, (found, expected)) in found.iter().zip(&expected).enumerate() {
        // Joint units per pose unit, relative to the largest element of the row.
        let scale = found.iter().fold(1.0, |most: f64, v| most.max(v.abs()));
        for column in (0..6).filter(|c| subject.machine.moves(*c)) {
            let (one, other) = (found[column], expected[column]);
            let off = (one - other).abs() / scale;
            let name = &subject.name;
            assert!(off <= DIFFERENCE, "{name} [{row}][{column}] {one} is not {other} at {pose:?}");
            worst = worst.max(off);
        }
    }
    worst
}

/// With constant A and C, B is an angle like any other: the lathe's platform may be at B = 90.
#[test]
fn where_a_and_c_are_held_there_is_a_jacobian_at_b_90() {
    let subject = subjects().into_iter().find(|s| s.name == "four-rod lathe").expect("there");
    let module = subject.machine.module();
    for b in [90.0, -90.0] {
        largest_error(&subject, &module, &[0.0, 450.0, 1000.0, 0.0, b, 0.0, 0.0, 0.0, 0.0]);
    }
}

#[test]
fn rows_past_the_joints_and_columns_of_u_v_w_are_zero() {
    for subject in machines() {
        let module = subject.machine.module();
        let pose = (subject.sample)(&mut Random::new(15));
        let joints = module.inverse(&pose).expect("a pose of the workspace");
        let found = module.jacobian(&joints, &pose).expect("a regular pose");
        let (rows, rest) = found.split_at(subject.machine.joints());
        assert!(rest.iter().all(|row| *row == [0.0; 9]), "{}: {found:?}", subject.name);
        assert!(rows.iter().all(|row| row[6..] == [0.0; 3]), "{}: {found:?}", subject.name);
        assert!(rows.iter().all(|row| row[..6] != [0.0; 6]), "{}: {found:?}", subject.name);
    }
}

/// Without a tilt a table axis follows its letter, and no leg depends on that letter.
#[test]
fn a_table_axis_has_the_row_of_its_letter() {
    let subject = subjects().into_iter().find(|s| s.name == "pyramid").expect("the pyramid");
    let module = subject.machine.module();
    let pose = subject.home();
    let joints = module.inverse(&pose).expect("home");
    let found = module.jacobian(&joints, &pose).expect("home");
    assert_eq!(found[4][..3], [1.0, 0.0, 0.0]);
    assert_eq!(found[5][..3], [0.0, 1.0, 0.0]);
    assert!(found[..4].iter().all(|row| row[..2] == [0.0; 2]), "{found:?}");
}

#[test]
fn the_jacobian_says_when_it_has_none() {
    let module = paper_004().module();
    let joints = module.inverse(&POSE).expect("a pose of the workspace");
    let mut lying = POSE;
    lying[4] = 90.0;
    assert_eq!(module.jacobian(&joints, &lying), Err(-1));
    for component in 0..6 {
        let mut pose = POSE;
        pose[component] = f64::NAN;
        assert_eq!(module.jacobian(&joints, &pose), Err(-1));
    }
    assert_eq!(Module::pkmkins(&[]).jacobian(&joints, &POSE), Err(-1), "nothing frozen");
}

#[test]
fn the_tool_frame_is_the_platforms_rotation_and_the_work_stands_still() {
    let module = paper_004().module();
    let joints = module.inverse(&POSE).expect("a pose of the workspace");
    module.forward(&joints, &POSE).expect("its own joints");
    let (tool, r) = (module.tool_frame(&joints).expect("a known pose"), rotation(&POSE));
    for (axis, column) in tool.iter().enumerate() {
        for (k, value) in column.iter().enumerate() {
            assert!((value - r[k][axis]).abs() <= FRAME, "{tool:?} is not the columns of {r:?}");
        }
    }
    let work = module.work_frame(&joints).expect("always known");
    assert_eq!(work, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
}

#[test]
fn the_tool_frame_of_impossible_joints_is_refused() {
    let module = paper_004().module();
    let joints = module.inverse(&POSE).expect("a pose of the workspace");
    module.forward(&joints, &POSE).expect("its own joints");
    for value in [f64::NAN, 5000.0, -1.0] {
        let mut bad = joints;
        bad[2] = value;
        assert_eq!(module.tool_frame(&bad), Err(-1), "{value}");
        assert!(module.work_frame(&bad).is_ok(), "{value}: no joint rotates the workpiece");
    }
}

#[test]
fn frames_and_jacobian_leave_no_trace() {
    let module = paper_004().module();
    let joints = module.inverse(&POSE).expect("a pose of the workspace");
    module.forward(&joints, &POSE).expect("its own joints");
    module.monitor_until_all_is_shown();
    let pins = || module.pins().iter().map(|pin| pin.get().to_bits()).collect::<Vec<_>>();
    let before = pins();
    let _ = module.jacobian(&joints, &[f64::NAN; 9]);
    let _ = module.tool_frame(&[f64::NAN; 16]);
    let _ = module.work_frame(&joints);
    module.monitor_until_all_is_shown();
    assert_eq!(pins(), before);
    assert_eq!(module.messages().len(), 0, "{:?}", module.messages());
}
