// SPDX-License-Identifier: GPL-2.0-or-later
//! Searches without a seed, in boxes that are one-to-one: narrow ones, about a pose whose Jacobian
//! is the matrix.

use crate::common::machines::{geometry, hexapods, linear_delta, pyramid, strut, tripod};
use crate::common::{Case, NO_TOOL, cases, rng, uniform, within};
use kinematics::{
    Cause, Fault, Joints, MAX_BOX_STEPS, MAX_BOXES, Pose, Progress, STEPS_PER_CALL, Search, Solver,
    Vector3, WorkspaceBox,
};
use nalgebra::SMatrix;
use rand_pcg::Pcg64;

const EMPTY: WorkspaceBox = WorkspaceBox::EMPTY;

/// Returns a box of half widths `by` about a pose, with the inverse of the Jacobian there.
fn about(case: &Case, middle: [f64; 6], by: [f64; 6]) -> WorkspaceBox {
    let jacobian =
        case.machine.at(&Pose::from_degrees(middle), &NO_TOOL).unwrap().pose_jacobian().unwrap();
    let layout = case.machine.layout();
    let moved = |k: usize| layout.coordinates().as_slice().iter().any(|l| l.index() == k);
    let rows = SMatrix::<f64, 8, 6>::from_fn(|i, k| {
        if i < layout.legs() && moved(k) { jacobian[(i, k)] } else { 0.0 }
    });
    let inverse = rows.pseudo_inverse(1e-12).unwrap();
    let mut given = WorkspaceBox { steps: 60, ..EMPTY };
    for k in (0..6).filter(|k| moved(*k)) {
        (given.low[k], given.high[k]) = (middle[k] - by[k], middle[k] + by[k]);
        given.matrix[k] = std::array::from_fn(|i| inverse[(k, i)]);
    }
    given
}

/// Returns boxes in which the matrix of the middle is near all inverse Jacobians.
fn boxed() -> Vec<(Case, WorkspaceBox)> {
    let small = [30.0, 30.0, 30.0, 4.0, 4.0, 4.0];
    let [first, second] = hexapods();
    [
        (first, small),
        (second, small),
        (linear_delta(), small),
        (pyramid(), small),
        (tripod(), [0.4; 6]),
    ]
    .into_iter()
    .map(|(case, by)| {
        let given = about(&case, case.home.to_degrees(), by);
        (case, given)
    })
    .collect()
}

/// Returns a pose of the box widened by `factor`.
fn drawn(rng: &mut Pcg64, given: &WorkspaceBox, factor: f64) -> [f64; 6] {
    std::array::from_fn(|k| {
        let (middle, half) =
            (0.5 * (given.low[k] + given.high[k]), 0.5 * (given.high[k] - given.low[k]));
        middle + factor * half * uniform(rng, -1.0, 1.0)
    })
}

/// Returns the result of a search, and the number of calls it took.
fn searched(
    case: &Case,
    joints: &Joints,
    boxes: &[WorkspaceBox],
    tool: &Vector3<f64>,
) -> (Result<Pose, Fault>, usize) {
    let mut search = Search::new(joints, boxes);
    for call in 1..1000 {
        match case.machine.search(search, boxes, tool, &Solver::default()) {
            Ok(Progress::Searching(further)) => search = further,
            Ok(Progress::Found(pose)) => return (Ok(pose), call),
            Err(fault) => return (Err(fault), call),
        }
    }
    panic!("{}: the search does not end", case.name);
}

#[test]
fn a_pose_is_found_from_its_joints_alone_where_it_is_in_the_box_and_nowhere_else() {
    let mut rng = rng(91);
    for (case, given) in boxed() {
        assert!(given.is_valid());
        let tool = Vector3::new(3.0, -2.0, 5.0);
        for _ in 0..cases(100) {
            let at = drawn(&mut rng, &given, 1.0);
            let mut pose = Pose::from_degrees(at);
            assert!(given.holds(&pose));
            pose.position += tool - pose.rotation() * tool;
            let joints = case.machine.inverse(&pose, &tool).unwrap();
            let found = searched(&case, &joints, &[given], &tool).0.unwrap();
            // Forward's own tolerance is 1e-12 of the size.
            assert!(case.apart(&found, &pose) < 1e-10, "{}: {at:?}", case.name);
            // Outside it in every coordinate of the box: by a hundredth of its width.
            for k in (0..6).filter(|k| given.high[*k] > given.low[*k]) {
                let mut beside = at;
                beside[k] = given.high[k] + 0.01 * (given.high[k] - given.low[k]);
                assert!(!given.holds(&Pose::from_degrees(beside)));
                let joints = case.joints(&Pose::from_degrees(beside));
                let fault = searched(&case, &joints, &[given], &NO_TOOL).0.unwrap_err();
                assert_eq!(fault.cause, Cause::OutsideBoxes, "{}: {beside:?}", case.name);
            }
        }
    }
}

#[test]
fn a_table_carries_the_pose_out_of_no_box() {
    let case = pyramid();
    let given = about(&case, case.home.to_degrees(), [0.0, 0.0, 30.0, 4.0, 4.0, 0.0]);
    let mut at = case.home.to_degrees();
    (at[0], at[1]) = (120.0, -70.0);
    let pose = Pose::from_degrees(at);
    let found = searched(&case, &case.joints(&pose), &[given], &NO_TOOL).0.unwrap();
    assert!(case.apart(&found, &pose) < 1e-10);
}

#[test]
fn neighboring_boxes_have_one_pose_at_their_face_and_two_poses_are_reported() {
    let case = tripod();
    let home = case.home.to_degrees();
    let whole = about(&case, home, [0.4; 6]);
    let half = |low: f64, high: f64| {
        let mut half = whole;
        (half.low[0], half.high[0]) = (low, high);
        half
    };
    let halves = [half(whole.low[0], home[0]), half(home[0], whole.high[0])];
    let joints = case.joints(&case.home);
    let found = searched(&case, &joints, &halves, &NO_TOOL).0.unwrap();
    assert!(case.apart(&found, &case.home) < 1e-10);
    // Struts from a plane also reach its other side.
    let mirrored = [home[0], home[1], -home[2], 0.0, 0.0, 0.0];
    let below = about(&case, mirrored, [0.4; 6]);
    let fault = searched(&case, &joints, &[whole, below], &NO_TOOL).0.unwrap_err();
    assert_eq!(fault.cause, Cause::TwoPoses);
    // The distance of the two.
    assert!((fault.value - 2.0 * home[2]).abs() < 1e-6, "{}", fault.value);
    let found = searched(&case, &joints, &[below], &NO_TOOL).0.unwrap();
    assert!(case.apart(&found, &Pose::from_degrees(mirrored)) < 1e-10);
}

#[test]
fn a_long_search_goes_on_in_later_calls_and_ends_after_the_steps_that_were_given() {
    let case = tripod();
    let mut slow = about(&case, case.home.to_degrees(), [0.4; 6]);
    // Contracts by 0.98 a step: 1e-11 of the widths after some 1300.
    slow.matrix.iter_mut().flatten().for_each(|m| *m *= 0.02);
    slow.steps = 2000;
    let corner = Pose::from_degrees([slow.low[0], slow.high[1], slow.low[2], 0.0, 0.0, 0.0]);
    let joints = case.joints(&corner);
    let (found, calls) = searched(&case, &joints, &[slow], &NO_TOOL);
    assert!(case.apart(&found.unwrap(), &corner) < 1e-10);
    let least = 1 + 700 / STEPS_PER_CALL as usize;
    assert!((least..=2000_usize.div_ceil(STEPS_PER_CALL as usize)).contains(&calls), "{calls}");
    // The given number of steps: if the search has not converged by then, the proof was for another box.
    slow.steps = 10;
    let (ended, calls) = searched(&case, &joints, &[slow], &NO_TOOL);
    assert_eq!((ended.map_err(|fault| fault.cause), calls), (Err(Cause::OutsideBoxes), 1));
}

#[test]
fn a_long_search_asks_each_box_from_its_own_beginning() {
    let case = tripod();
    let home = case.home.to_degrees();
    let slow = |middle: [f64; 6]| {
        let mut slow = about(&case, middle, [0.4; 6]);
        slow.matrix.iter_mut().flatten().for_each(|m| *m *= 0.02);
        // Each box takes some 1300: more are given than one needs, fewer than both.
        slow.steps = 2000;
        slow
    };
    let boxes = [slow([home[0] + 1.2, home[1], home[2], 0.0, 0.0, 0.0]), slow(home)];
    let corner = Pose::from_degrees([boxes[1].low[0], boxes[1].high[1], home[2], 0.0, 0.0, 0.0]);
    let (found, calls) = searched(&case, &case.joints(&corner), &boxes, &NO_TOOL);
    // Forward's own tolerance is 1e-12 of the size.
    assert!(case.apart(&found.unwrap(), &corner) < 1e-10);
    assert!(calls > 2000 / STEPS_PER_CALL as usize, "{calls}");
}

#[test]
fn a_box_holds_what_its_tolerance_lets_stand_beside_it() {
    let mut given = EMPTY;
    (given.low, given.high) = ([-3.0; 6], [5.0; 6]);
    // Two millionths of a width of 8.
    for (off, is_held) in [(15e-6, true), (17e-6, false)] {
        for k in 0..6 {
            for end in [-3.0 - off, 5.0 + off] {
                let mut pose = [0.0; 6];
                pose[k] = end;
                assert_eq!(given.holds(&Pose::from_degrees(pose)), is_held, "{k}: {end}");
            }
        }
    }
}

#[test]
fn the_boxes_that_a_machine_may_have_are_asked_and_no_more() {
    let case = tripod();
    let home = case.home.to_degrees();
    let whole = about(&case, home, [0.4; 6]);
    let mut elsewhere = whole;
    (elsewhere.low[0], elsewhere.high[0]) = (home[0] + 0.2, home[0] + 0.4);
    let joints = case.joints(&case.home);
    let last = |count: usize| {
        let mut boxes = vec![elsewhere; count];
        boxes[count - 1] = whole;
        searched(&case, &joints, &boxes, &NO_TOOL).0.is_ok()
    };
    assert!(last(1) && last(2) && last(MAX_BOXES) && !last(MAX_BOXES + 1));
    let fault = searched(&case, &joints, &[], &NO_TOOL).0.unwrap_err();
    assert_eq!(fault.cause, Cause::OutsideBoxes);
    let mut bad = joints;
    bad[2] = f64::NAN;
    let fault = searched(&case, &bad, &[whole], &NO_TOOL).0.unwrap_err();
    assert_eq!((fault.cause, fault.number()), (Cause::JointNotFinite, Some(2)));
}

#[test]
fn numbers_that_cannot_be_computed_with_are_no_box() {
    let with = |change: fn(&mut WorkspaceBox)| {
        let mut given = EMPTY;
        change(&mut given);
        given.is_valid()
    };
    assert!(with(|_| ()));
    assert!(with(|b| b.steps = MAX_BOX_STEPS));
    for change in [
        |b: &mut WorkspaceBox| b.steps = 0,
        |b: &mut WorkspaceBox| b.steps = MAX_BOX_STEPS + 1,
        |b: &mut WorkspaceBox| b.low[3] = 1.0,
        |b: &mut WorkspaceBox| b.low[0] = f64::NEG_INFINITY,
        |b: &mut WorkspaceBox| b.high[5] = f64::INFINITY,
        |b: &mut WorkspaceBox| b.high[2] = f64::NAN,
        |b: &mut WorkspaceBox| b.matrix[5][7] = f64::NAN,
    ] {
        assert!(!with(change));
    }
}

#[test]
fn the_assembly_is_the_sign_of_the_determinant() {
    let mut rng = rng(92);
    for (case, given) in boxed() {
        let layout = case.machine.layout();
        let letters = layout.coordinates().as_slice();
        for _ in 0..cases(50) {
            let pose = Pose::from_degrees(drawn(&mut rng, &given, 1.5));
            let at = case.machine.at(&pose, &NO_TOOL).unwrap();
            let assembly = at.assembly().unwrap();
            if layout.is_redundant() {
                assert_eq!(assembly, 0, "{}", case.name);
                continue;
            }
            let jacobian = at.inverse_jacobian().unwrap();
            let size = letters.len();
            let square = SMatrix::<f64, 6, 6>::from_fn(|i, k| match i < size && k < size {
                true => jacobian[(i, letters[k].index())],
                false => f64::from(u8::from(i == k)),
            });
            assert_eq!(f64::from(assembly), square.determinant().signum(), "{}", case.name);
        }
    }
    // A strut's two sides are two assemblies.
    let legs = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0]].map(|b| strut(b, [0.0; 3]));
    let home = Some([3.0, 3.0, 4.0, 0.0, 0.0, 0.0]);
    let case =
        Case::new("corner", geometry(&legs, "XYZ", "", home), within([0.0; 6], [0.0; 6]), 1.0);
    let at = |z: f64| {
        let pose = Pose::from_degrees([3.0, 3.0, z, 0.0, 0.0, 0.0]);
        case.machine.at(&pose, &NO_TOOL).unwrap().assembly().unwrap()
    };
    assert_eq!((at(4.0), at(-4.0), at(0.0)), (1, -1, 0));
}
