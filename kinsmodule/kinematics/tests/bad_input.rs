// SPDX-License-Identifier: GPL-2.0-or-later
//! Bad input: each is refused with its own cause, naming the leg where there is one.

mod common;

use common::{NO_TOOL, geometry, paper_004, shipped};
use kinematics::leg::{LegKind, StrutGeometry};
use kinematics::{Cause, Fault, Geometry, Machine, Pose, Solver, Vector3};

const BAD: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];

fn refused(geometry: &Geometry<6>) -> Fault {
    Machine::freeze(geometry, &[0.0; 6]).unwrap_err()
}

fn changed(change: impl Fn(&mut Geometry<6>)) -> Geometry<6> {
    let mut geometry = paper_004(10.0);
    change(&mut geometry);
    geometry
}

fn strut(geometry: &mut Geometry<6>, i: usize) -> &mut StrutGeometry {
    let LegKind::Strut(strut) = &mut geometry.legs[i].kind;
    strut
}

#[test]
fn values_that_are_not_finite_are_refused_wherever_they_stand() {
    for bad in BAD {
        let of_leg = [
            changed(|g| g.legs[2].base[1] = bad),
            changed(|g| g.legs[2].platform[0] = bad),
            changed(|g| strut(g, 2).base_axis[2] = bad),
            changed(|g| strut(g, 2).platform_axis[2] = bad),
            changed(|g| strut(g, 2).lead = bad),
        ];
        for geometry in of_leg {
            let fault = refused(&geometry);
            assert_eq!((fault.cause, fault.leg), (Cause::GeometryNotFinite, Some(2)));
        }
        for k in 0..6 {
            let home = changed(|g| g.home.as_mut().unwrap()[k] = bad);
            assert_eq!(refused(&home).cause, Cause::HomeNotFinite);
        }
        let fault = Machine::freeze(&paper_004(0.0), &[0.0, 0.0, 0.0, bad, 0.0, 0.0]).unwrap_err();
        assert_eq!((fault.cause, fault.leg), (Cause::GeometryNotFinite, Some(3)));
    }
}

#[test]
fn bad_poses_joints_seeds_and_tools_are_refused_and_named() {
    let [case, _] = shipped();
    let (m, home) = (&case.machine, &case.home);
    let joints = m.inverse(home, &NO_TOOL).unwrap();
    let solver = Solver::default();
    for bad in BAD {
        for k in 0..6 {
            let mut v = home.to_degrees();
            v[k] = bad;
            let pose = Pose::from_degrees(v);
            assert_eq!(m.inverse(&pose, &NO_TOOL).unwrap_err().cause, Cause::PoseNotFinite);
            assert_eq!(m.pose_jacobian(&pose, &NO_TOOL).unwrap_err().cause, Cause::PoseNotFinite);
            let fault = m.forward(&joints, &pose, &NO_TOOL, &solver).unwrap_err();
            assert_eq!(fault.cause, Cause::SeedMissing);
            let mut q = joints;
            q[k] = bad;
            let fault = m.forward(&q, home, &NO_TOOL, &solver).unwrap_err();
            assert_eq!((fault.cause, fault.leg), (Cause::JointNotFinite, Some(k as u8)));
        }
        for k in 0..3 {
            let mut tool = Vector3::zeros();
            tool[k] = bad;
            assert_eq!(m.inverse(home, &tool).unwrap_err().cause, Cause::ToolNotFinite);
            let fault = m.forward(&joints, home, &tool, &solver).unwrap_err();
            assert_eq!(fault.cause, Cause::ToolNotFinite);
        }
    }
    let huge = Pose::from_degrees([0.0, 0.0, 250.0, 0.0, 0.0, 1.1e6]);
    assert_eq!(m.inverse(&huge, &NO_TOOL).unwrap_err().cause, Cause::AngleTooLarge);
    let far = Pose::from_degrees([1e308, 1e308, 1e308, 0.0, 0.0, 0.0]);
    assert!(m.inverse(&far, &NO_TOOL).is_err());
}

#[test]
fn joints_that_close_no_platform_are_refused() {
    for case in shipped() {
        let joints = case.machine.inverse(&case.home, &NO_TOOL).unwrap();
        let solver = Solver::default();
        let refuse = |q: [f64; 6]| {
            case.machine.forward(&q, &case.home, &NO_TOOL, &solver).unwrap_err().cause
        };
        let mut zero = joints;
        zero[4] = 0.0;
        assert_eq!(refuse(zero), Cause::JointNotPositive);
        zero[4] = -500.0;
        assert_eq!(refuse(zero), Cause::JointNotPositive);
        // Far beyond what closes, either limit of the tracker may be met first.
        let mut torn = joints;
        torn[0] *= 3.0;
        for q in [torn, [1.0; 6]] {
            assert!(matches!(refuse(q), Cause::PathStalled | Cause::TooManySubSteps), "{q:?}");
        }
    }
}

#[test]
fn solver_settings_out_of_range_are_refused() {
    let [case, _] = shipped();
    let joints = case.machine.inverse(&case.home, &NO_TOOL).unwrap();
    let cause = |solver: Solver| {
        case.machine.forward(&joints, &case.home, &NO_TOOL, &solver).unwrap_err().cause
    };
    for limit_iterations in [0, 289, u32::MAX] {
        let solver = Solver { limit_iterations, ..Solver::default() };
        assert_eq!(cause(solver), Cause::LimitIterationsInvalid);
    }
    for convergence_criterion in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let solver = Solver { convergence_criterion, ..Solver::default() };
        assert_eq!(cause(solver), Cause::CriterionInvalid);
    }
    let far = Pose::from_degrees([100.0, 0.0, 350.0, 20.0, 0.0, 0.0]);
    let solver = Solver { limit_iterations: 1, ..Solver::default() };
    let fault = case.machine.forward(&joints, &far, &NO_TOOL, &solver).unwrap_err();
    assert_eq!(fault.cause, Cause::TooManyIterations);
}

#[test]
fn degenerate_geometries_are_refused_with_their_reason() {
    let coincide = changed(|g| {
        g.legs[4].base = g.legs[1].base;
        g.legs[4].platform = g.legs[1].platform;
    });
    let fault = refused(&coincide);
    assert_eq!((fault.cause, fault.leg, fault.value), (Cause::LegsCoincide, Some(4), 1.0));

    let line = changed(|g| {
        for (i, leg) in g.legs.iter_mut().enumerate() {
            leg.platform = [10.0 * i as f64, 0.0, 0.0];
        }
    });
    assert_eq!(refused(&line).cause, Cause::PlatformDegenerate);

    let no_axis = changed(|g| strut(g, 5).base_axis = [0.0; 3]);
    let fault = refused(&no_axis);
    assert_eq!((fault.cause, fault.leg), (Cause::AxisZero, Some(5)));

    let closed = changed(|g| {
        let p = g.legs[3].platform;
        g.legs[3].base = [p[0], p[1], p[2] + 250.0];
    });
    let fault = refused(&closed);
    assert_eq!((fault.cause, fault.leg), (Cause::StrutZeroAtHome, Some(3)));

    // Similar hexagons, one above the other without a twist: the classic singular layout.
    let hexagon = |r: f64| {
        std::array::from_fn(|i| {
            let t = f64::to_radians(60.0 * i as f64 + 7.0);
            [r * t.cos(), r * t.sin(), 0.0]
        })
    };
    let home = Some([0.0, 0.0, 600.0, 0.0, 0.0, 0.0]);
    let similar = geometry(hexagon(400.0), hexagon(200.0), [StrutGeometry::default(); 6], home);
    assert_eq!(refused(&similar).cause, Cause::SingularAtHome);
}

#[test]
fn axes_are_not_asked_for_where_a_strut_has_no_lead() {
    let plain = changed(|g| {
        for i in 0..6 {
            *strut(g, i) = StrutGeometry::default();
        }
        *strut(g, 0) = StrutGeometry {
            base_axis: [0.0, 1.0, 0.0],
            platform_axis: [0.0, -1.0, 0.0],
            lead: 5.0,
        };
    });
    let machine = Machine::freeze(&plain, &[0.0; 6]).unwrap();
    let turned = Pose::from_degrees([0.0, 0.0, 250.0, 0.0, 0.0, 10.0]);
    let corrections = machine.corrections(&turned, &NO_TOOL).unwrap();
    assert!(corrections[0] != 0.0);
    assert_eq!(corrections[1..], [0.0; 5]);
}

#[test]
fn a_singular_pose_is_an_error_of_forward_and_not_of_inverse() {
    // The same hexagons again, frozen without a reference pose.
    let hexagon = |r: f64| {
        std::array::from_fn(|i| {
            let t = f64::to_radians(60.0 * i as f64);
            [r * t.cos(), r * t.sin(), 0.0]
        })
    };
    let given = geometry(hexagon(400.0), hexagon(200.0), [StrutGeometry::default(); 6], None);
    let machine = Machine::freeze(&given, &[0.0; 6]).unwrap();
    let pose = Pose::from_degrees([0.0, 0.0, 600.0, 0.0, 0.0, 0.0]);
    let joints = machine.inverse(&pose, &NO_TOOL).unwrap();
    let fault = machine.forward(&joints, &pose, &NO_TOOL, &Solver::default()).unwrap_err();
    assert!(matches!(fault.cause, Cause::Singular | Cause::NearlySingular), "{fault}");
}
