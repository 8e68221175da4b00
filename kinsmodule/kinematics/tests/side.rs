// SPDX-License-Identifier: GPL-2.0-or-later
//! Sides of the singular poses, compared with the sign of det J.

use crate::common::machines::declared;
use crate::common::random::{RECIPES, draw};
use crate::common::{Case, NO_TOOL, cases, direction, rng, uniform};
use kinematics::{Pose, Vector3};
use rand_pcg::Pcg64;

fn all(rng: &mut Pcg64) -> Vec<Case> {
    let random = RECIPES.iter().flat_map(|recipe| (0..4).map(move |_| recipe));
    let drawn: Vec<Case> = random.map(|recipe| draw(rng, recipe)).collect();
    declared().into_iter().chain(drawn).collect()
}

/// Returns a pose `way` from another, with angles multiplied by the radius.
fn away(case: &Case, from: &Pose, way: f64, rng: &mut Pcg64) -> Pose {
    let share = uniform(rng, 0.0, 1.0);
    case.without_held(&Pose {
        position: from.position + direction(rng) * way * share,
        angles: from.angles + direction(rng) * (way * (1.0 - share) / case.machine.radius()),
    })
}

#[test]
fn what_is_said_to_be_on_a_side_has_its_sign_of_the_determinant() {
    let mut rng = rng(71);
    let (mut near, mut far) = (0, 0);
    // With more legs than coordinates there is no sign, and all poses are on one side.
    let square = |case: &Case| {
        case.machine.layout().legs() == case.machine.layout().coordinates().as_slice().len()
    };
    for case in all(&mut rng).into_iter().filter(square) {
        let sign = |pose: &Pose, tool: &Vector3<f64>| {
            case.machine.at(pose, tool).and_then(|at| at.assembly())
        };
        for _ in 0..cases(60).max(6) {
            let pose = (case.sample)(&mut rng);
            let tool = direction(&mut rng) * (0.1 * case.machine.size());
            let Ok(side) = case.machine.side(&pose, &tool) else { continue };
            for _ in 0..10 {
                let way = case.machine.size() * uniform(&mut rng, 0.0, 0.7).powi(3);
                let other = away(&case, &pose, way, &mut rng);
                let retooled = tool + direction(&mut rng) * (0.2 * way);
                if !side.reaches(&other, &retooled) {
                    far += 1;
                    continue;
                }
                near += 1;
                let signs = [sign(&other, &retooled), sign(&pose, &tool)];
                assert_eq!(signs[0], signs[1], "{}: {other:?} and {pose:?}", case.name);
                let there = case.machine.side(&other, &retooled).expect("next to a regular pose");
                assert!(!there.opposes(&side));
            }
        }
    }
    // A reach that is far too short would be sound and useless.
    assert!(near > far / 4, "{near} near, {far} far");
}

#[test]
fn poses_oppose_each_other_where_the_signs_of_the_determinant_differ() {
    let mut rng = rng(72);
    let (mut opposed, mut agreed) = (0, 0);
    for case in all(&mut rng) {
        for _ in 0..cases(60).max(6) {
            let one = (case.sample)(&mut rng);
            let way = case.machine.size() * uniform(&mut rng, 0.0, 2.0);
            let other = away(&case, &one, way, &mut rng);
            let sides = [&one, &other].map(|pose| case.machine.side(pose, &NO_TOOL));
            let [Ok(here), Ok(there)] = sides else { continue };
            let signs = [&one, &other].map(|pose| {
                case.machine.at(pose, &NO_TOOL).expect("reached").assembly().expect("reached")
            });
            assert_eq!(here.opposes(&there), signs[0] * signs[1] < 0, "{}", case.name);
            opposed += usize::from(here.opposes(&there));
            agreed += usize::from(!here.opposes(&there));
        }
    }
    assert!(opposed > 20 && agreed > 20, "{opposed} {agreed}");
}

/// Tests that a servo step seldom leaves the reach, so that the side is seldom computed.
#[test]
fn a_side_reaches_over_many_servo_steps_of_the_declared_workspaces() {
    let mut rng = rng(73);
    for case in declared() {
        let (mut within, count) = (0, cases(200).max(50));
        for _ in 0..count {
            let pose = (case.sample)(&mut rng);
            let side = case.machine.side(&pose, &NO_TOOL).expect("a pose of the workspace");
            let other = away(&case, &pose, 5.0 * case.step, &mut rng);
            within += usize::from(side.reaches(&other, &NO_TOOL));
        }
        assert!(10 * within > 9 * count, "{}: {within} of {count}", case.name);
    }
}

#[test]
fn the_way_of_joints_is_the_largest_as_a_length() {
    for case in declared() {
        let from = case.joints(&case.home);
        let mut to = from;
        to[1] += 0.25;
        let way = case.machine.travel(&from, &to);
        // An angle of a crank, in degrees, moves the arm's end by less than the machine's size.
        let is_crank = case.geometry.legs()[1].kind.is_angular();
        let most = if is_crank { 0.25_f64.to_radians() * case.machine.size() } else { 0.25 };
        assert!(way > 0.0 && way <= most * (1.0 + 1e-12), "{}: {way}", case.name);
        assert!(is_crank || (way - 0.25).abs() < 1e-12, "{}: {way}", case.name);
        assert_eq!(case.machine.travel(&to, &to), 0.0);
    }
}
