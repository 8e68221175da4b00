// SPDX-License-Identifier: GPL-2.0-or-later
//! The optional entry points that LinuxCNC is about to ask for.

use abi_tests::geometry::rotation;
use abi_tests::machines::{Hexapod, paper_004, paper_004_pose};
use abi_tests::module::{Jacobian, Module, Pose};
use abi_tests::random::{Random, cases};
use abi_tests::tolerances::{DIFFERENCE, DIFFERENCE_STEP, FRAME};

const POSE: Pose = [-80.0, 60.0, 350.0, 10.0, -20.0, 5.0, 0.0, 0.0, 0.0];

fn differences(module: &Module, pose: &Pose) -> Jacobian {
    let mut result = [[0.0; 9]; 16];
    for component in 0..6 {
        let at = |step: f64| {
            let mut moved = *pose;
            moved[component] += step;
            module.inverse(&moved).expect("a pose of the workspace")
        };
        let (ahead, behind) = (at(DIFFERENCE_STEP), at(-DIFFERENCE_STEP));
        for joint in 0..6 {
            result[joint][component] = (ahead[joint] - behind[joint]) / (2.0 * DIFFERENCE_STEP);
        }
    }
    result
}

#[test]
fn the_jacobian_is_the_derivative_of_inverse_per_unit_and_per_degree() {
    let tools = Hexapod { tool_offset: 70.0, spindle_offset: -20.0, ..paper_004() };
    for machine in [paper_004(), Hexapod { lead: 0.0, ..paper_004() }, tools] {
        let module = machine.module();
        let mut random = Random::new(6);
        for _ in 0..cases(1000) {
            let pose = paper_004_pose(&mut random);
            let joints = module.inverse(&pose).expect("a pose of the workspace");
            let found = module.jacobian(&joints, &pose).expect("a regular pose");
            let expected = differences(&module, &pose);
            for (row, (found, expected)) in found.iter().zip(&expected).enumerate() {
                for (column, (one, other)) in found.iter().zip(expected).enumerate() {
                    let message = format!("[{row}][{column}] {one} is not {other} at {pose:?}");
                    assert!((one - other).abs() <= DIFFERENCE, "{message}");
                }
            }
        }
    }
}

#[test]
fn rows_past_the_joints_and_columns_of_u_v_w_are_zero() {
    let module = paper_004().module();
    let joints = module.inverse(&POSE).expect("a pose of the workspace");
    let found = module.jacobian(&joints, &POSE).expect("a regular pose");
    assert!(found[6..].iter().all(|row| *row == [0.0; 9]), "{found:?}");
    assert!(found[..6].iter().all(|row| row[6..] == [0.0; 3]), "{found:?}");
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
    }
}

#[test]
fn frames_and_jacobian_leave_no_trace() {
    let module = paper_004().module();
    let joints = module.inverse(&POSE).expect("a pose of the workspace");
    module.forward(&joints, &POSE).expect("its own joints");
    module.monitor();
    let pins = || module.pins().iter().map(|pin| pin.get().to_bits()).collect::<Vec<_>>();
    let before = pins();
    let _ = module.jacobian(&joints, &[f64::NAN; 9]);
    let _ = module.tool_frame(&[f64::NAN; 16]);
    let _ = module.work_frame(&joints);
    module.monitor();
    assert_eq!(pins(), before);
    assert_eq!(module.messages().len(), 0, "{:?}", module.messages());
}
