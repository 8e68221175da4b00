// SPDX-License-Identifier: GPL-2.0-or-later
//! Bad input: each is refused with its own cause, which names the leg if there is one.

use crate::common::machines::{
    changed_legs, declared, four_rod_lathe, genhexkins_case, geometry, hexapod, hexapods,
    linear_delta, paper_004, pentapod, ring_pentapod, rotary_delta, slider, tripod,
};
use crate::common::{NO_OFFSET, NO_TOOL};
use kinematics::leg::{CrankGeometry, RingGeometry, SliderGeometry, StrutGeometry};
use kinematics::{
    Cause, Fault, Geometry, Joints, LegGeometry, LegKind, Machine, MachinePart, Pose, Solver,
    Vector3,
};

const BAD: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];

fn refused(geometry: &Geometry) -> Fault {
    Machine::freeze(geometry, &NO_OFFSET).unwrap_err()
}

/// Returns paper 004's hexapod with one leg changed.
fn with_leg(i: usize, change: impl Fn(&mut LegGeometry)) -> Geometry {
    changed_legs(&paper_004(10.0), |k, leg| {
        if k == i {
            change(leg);
        }
    })
}

/// Returns the same with the strut of one leg changed.
fn with_strut(i: usize, change: impl Fn(&mut StrutGeometry)) -> Geometry {
    with_leg(i, |leg| match &mut leg.kind {
        LegKind::Strut(strut) => change(strut),
        _ => panic!("a hexapod has struts only"),
    })
}

#[test]
fn values_that_are_not_finite_are_refused_wherever_they_stand() {
    for bad in BAD {
        let of_leg = [
            with_leg(2, |leg| leg.base[1] = bad),
            with_leg(2, |leg| leg.platform[0] = bad),
            with_strut(2, |strut| strut.base_axis[2] = bad),
            with_strut(2, |strut| strut.platform_axis[2] = bad),
            with_strut(2, |strut| strut.lead = bad),
        ];
        for geometry in of_leg {
            let fault = refused(&geometry);
            assert_eq!((fault.cause, fault.number()), (Cause::GeometryNotFinite, Some(2)));
        }
        for k in 0..6 {
            let mut home = paper_004(10.0);
            home.home.as_mut().unwrap()[k] = bad;
            assert_eq!(refused(&home).cause, Cause::HomeNotFinite);
        }
        let mut centre = paper_004(10.0);
        centre.centre[1] = bad;
        assert_eq!(refused(&centre).cause, Cause::CentreNotFinite);
        let mut offset = NO_OFFSET;
        offset[3] = bad;
        let fault = Machine::freeze(&paper_004(0.0), &offset).unwrap_err();
        assert_eq!((fault.cause, fault.number()), (Cause::GeometryNotFinite, Some(3)));
    }
}

#[test]
fn bad_poses_joints_seeds_and_tools_are_refused_and_named() {
    let [case, _] = hexapods();
    let (m, home) = (&case.machine, &case.home);
    let joints = m.inverse(home, &NO_TOOL).unwrap();
    let solver = Solver::default();
    for bad in BAD {
        for k in 0..6 {
            let mut v = home.to_degrees();
            v[k] = bad;
            let pose = Pose::from_degrees(v);
            assert_eq!(m.inverse(&pose, &NO_TOOL).unwrap_err().cause, Cause::PoseNotFinite);
            assert_eq!(
                m.at(&pose, &NO_TOOL).and_then(|at| at.pose_jacobian()).unwrap_err().cause,
                Cause::PoseNotFinite
            );
            let fault = m.forward(&joints, &pose, &NO_TOOL, &solver).unwrap_err();
            assert_eq!(fault.cause, Cause::SeedMissing);
            let mut q = joints;
            q[k] = bad;
            let fault = m.forward(&q, home, &NO_TOOL, &solver).unwrap_err();
            assert_eq!((fault.cause, fault.number()), (Cause::JointNotFinite, Some(k as u8)));
            assert_eq!(fault.value.to_bits(), bad.to_bits());
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
    for case in hexapods() {
        let joints = case.machine.inverse(&case.home, &NO_TOOL).unwrap();
        let solver = Solver::default();
        let refuse =
            |q: Joints| case.machine.forward(&q, &case.home, &NO_TOOL, &solver).unwrap_err().cause;
        let mut zero = joints;
        zero[4] = 0.0;
        assert_eq!(refuse(zero), Cause::JointNotPositive);
        zero[4] = -500.0;
        assert_eq!(refuse(zero), Cause::JointNotPositive);
        // Far beyond any pose, either limit of the tracker may be reached first.
        let mut torn = joints;
        torn[0] *= 3.0;
        for q in [torn, [1.0; 11]] {
            assert!(matches!(refuse(q), Cause::PathStalled | Cause::TooManySubSteps), "{q:?}");
        }
    }
}

#[test]
fn solver_settings_out_of_range_are_refused() {
    let [case, _] = hexapods();
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
    let one = paper_004(10.0).legs()[1];
    let coincide = with_leg(4, |leg| {
        leg.base = one.base;
        leg.platform = one.platform;
    });
    let fault = refused(&coincide);
    assert_eq!((fault.cause, fault.part), (Cause::LegsCoincide, Some(MachinePart::Legs([4, 1]))));

    let line = changed_legs(&paper_004(10.0), |i, leg| {
        leg.platform = [10.0 * i as f64, 0.0, 0.0];
    });
    assert_eq!(refused(&line).cause, Cause::PlatformDegenerate);

    let no_axis = with_strut(5, |strut| strut.base_axis = [0.0; 3]);
    let fault = refused(&no_axis);
    assert_eq!((fault.cause, fault.number()), (Cause::AxisZero, Some(5)));

    let closed = with_leg(3, |leg| {
        let p = leg.platform;
        leg.base = [p[0], p[1], p[2] + 250.0];
    });
    let fault = refused(&closed);
    assert_eq!((fault.cause, fault.number()), (Cause::StrutZeroAtHome, Some(3)));

    // Similar hexagons, one above the other without a twist: the classic singular layout.
    let hexagon = |r: f64| {
        std::array::from_fn(|i| {
            let t = f64::to_radians(60.0 * i as f64 + 7.0);
            [r * t.cos(), r * t.sin(), 0.0]
        })
    };
    let home = Some([0.0, 0.0, 600.0, 0.0, 0.0, 0.0]);
    let similar = hexapod(hexagon(400.0), hexagon(200.0), [StrutGeometry::default(); 6], home);
    assert_eq!(refused(&similar).cause, Cause::SingularAtHome);
}

#[test]
fn axes_are_not_asked_for_where_a_strut_has_no_lead() {
    let plain = changed_legs(&paper_004(10.0), |i, leg| {
        let screw = StrutGeometry {
            base_axis: [0.0, 1.0, 0.0],
            platform_axis: [0.0, -1.0, 0.0],
            lead: 5.0,
        };
        leg.kind = LegKind::Strut(if i == 0 { screw } else { StrutGeometry::default() });
    });
    let machine = Machine::freeze(&plain, &NO_OFFSET).unwrap();
    let turned = Pose::from_degrees([0.0, 0.0, 250.0, 0.0, 0.0, 10.0]);
    let corrections = machine.at(&turned, &NO_TOOL).unwrap().corrections();
    assert!(corrections[0] != 0.0);
    assert_eq!(corrections[1..], [0.0; 7]);
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
    let given = hexapod(hexagon(400.0), hexagon(200.0), [StrutGeometry::default(); 6], None);
    let machine = Machine::freeze(&given, &NO_OFFSET).unwrap();
    let pose = Pose::from_degrees([0.0, 0.0, 600.0, 0.0, 0.0, 0.0]);
    let joints = machine.inverse(&pose, &NO_TOOL).unwrap();
    let fault = machine.forward(&joints, &pose, &NO_TOOL, &Solver::default()).unwrap_err();
    assert!(matches!(fault.cause, Cause::Singular | Cause::NearlySingular), "{fault}");
}

/// Returns the refusal of a machine after a change of leg `i`.
fn fault_of(given: &Geometry, i: usize, change: impl Fn(&mut LegGeometry)) -> Fault {
    refused(&changed_legs(given, |k, leg| {
        if k == i {
            change(leg);
        }
    }))
}

fn slider_of(leg: &mut LegGeometry) -> &mut SliderGeometry {
    match &mut leg.kind {
        LegKind::Slider(slider) => slider,
        _ => panic!("a slider"),
    }
}

fn crank_of(leg: &mut LegGeometry) -> &mut CrankGeometry {
    match &mut leg.kind {
        LegKind::Crank(crank) => crank,
        _ => panic!("a crank"),
    }
}

#[test]
fn a_slider_without_guide_rod_or_side_is_refused_with_its_number() {
    let given = linear_delta().geometry;
    let named = |fault: Fault| (fault.cause, fault.number());
    let guide = fault_of(&given, 1, |leg| slider_of(leg).guide = [0.0, -0.0, 0.0]);
    assert_eq!(named(guide), (Cause::GuideZero, Some(1)));
    for rod in [0.0, -0.0, -269.0] {
        let fault = fault_of(&given, 2, |leg| slider_of(leg).rod = rod);
        assert_eq!((named(fault), fault.value), ((Cause::RodNotPositive, Some(2)), rod));
    }
    for side in [0, 2, -2, i32::MAX, i32::MIN] {
        let fault = fault_of(&given, 2, |leg| slider_of(leg).side = side);
        assert_eq!((named(fault), fault.value), ((Cause::SideInvalid, Some(2)), f64::from(side)));
    }
    for bad in BAD {
        for fault in [
            fault_of(&given, 0, |leg| slider_of(leg).guide[1] = bad),
            fault_of(&given, 0, |leg| slider_of(leg).rod = bad),
        ] {
            assert_eq!(named(fault), (Cause::GeometryNotFinite, Some(0)));
        }
    }
}

#[test]
fn a_crank_without_axis_arm_rod_or_side_is_refused_with_its_number() {
    let given = rotary_delta().geometry;
    let named = |fault: Fault| (fault.cause, fault.number());
    let along = |leg: &mut LegGeometry| {
        let crank = crank_of(leg);
        crank.arm = crank.axis.map(|v| 10.0 * v);
    };
    for fault in [
        fault_of(&given, 1, |leg| crank_of(leg).axis = [0.0; 3]),
        fault_of(&given, 1, |leg| crank_of(leg).arm = [0.0; 3]),
        fault_of(&given, 1, along),
    ] {
        assert_eq!(named(fault), (Cause::ArmZero, Some(1)));
    }
    let fault = fault_of(&given, 2, |leg| crank_of(leg).rod = 0.0);
    assert_eq!(named(fault), (Cause::RodNotPositive, Some(2)));
    for side in [0, 3] {
        let fault = fault_of(&given, 0, |leg| crank_of(leg).side = side);
        assert_eq!(named(fault), (Cause::SideInvalid, Some(0)));
    }
    for bad in BAD {
        for fault in [
            fault_of(&given, 0, |leg| crank_of(leg).axis[2] = bad),
            fault_of(&given, 0, |leg| crank_of(leg).arm[0] = bad),
            fault_of(&given, 0, |leg| crank_of(leg).rod = bad),
        ] {
            assert_eq!(named(fault), (Cause::GeometryNotFinite, Some(0)));
        }
    }
}

#[test]
fn a_ring_of_no_radius_that_it_can_have_is_refused_with_its_number() {
    let given = ring_pentapod().geometry;
    let with = |radius: f64| {
        let fault = fault_of(&given, 3, |leg| leg.kind = LegKind::Ring(RingGeometry { radius }));
        (fault.cause, fault.number(), fault.value)
    };
    for radius in [-1e-300, -80.3] {
        assert_eq!(with(radius), (Cause::RingNegative, Some(3), radius));
    }
    for radius in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(with(radius).0, Cause::GeometryNotFinite, "{radius}");
    }
    // The base anchor is 652 from the axis at home.
    let (cause, number, distance) = with(652.0);
    assert_eq!((cause, number), (Cause::AxisAtAnchor, Some(3)));
    assert!((distance - 418.0_f64.hypot(500.0)).abs() < 1e-12, "{distance}");
    assert_eq!(with(1e31).0, Cause::LengthTooLarge);
}

#[test]
fn a_tool_axis_through_a_base_anchor_at_home_is_refused() {
    let given = ring_pentapod().geometry;
    let fault = fault_of(&given, 1, |leg| leg.base = [0.0, 0.0, -140.0]);
    assert_eq!((fault.cause, fault.number(), fault.value), (Cause::AxisAtAnchor, Some(1), 0.0));
}

#[test]
fn directions_of_any_length_are_the_same_guide_and_axis() {
    for case in [linear_delta(), rotary_delta()] {
        let longer = changed_legs(&case.geometry, |_, leg| match &mut leg.kind {
            LegKind::Slider(slider) => slider.guide = slider.guide.map(|v| 1e200 * v),
            LegKind::Crank(crank) => crank.axis = crank.axis.map(|v| 1e-200 * v),
            LegKind::Strut(_) | LegKind::Ring(_) => panic!("no struts here"),
        });
        let (a, b) = (case.joints(&case.home), Machine::freeze(&longer, &NO_OFFSET).unwrap());
        let b = b.inverse(&case.home, &NO_TOOL).unwrap();
        for i in 0..3 {
            // One or two rounding errors of the direction.
            assert!((a[i] - b[i]).abs() < 1e-12 * case.machine.size(), "{}", case.name);
        }
    }
}

#[test]
fn two_equal_legs_are_refused_and_two_rods_on_one_guide_are_not() {
    for case in declared() {
        let one = case.geometry.legs()[0];
        let fault = fault_of(&case.geometry, 1, |leg| *leg = one);
        assert_eq!(
            (fault.cause, fault.part),
            (Cause::LegsCoincide, Some(MachinePart::Legs([1, 0])))
        );
    }
    // The rods of the lathes share their guides.
    assert!(Machine::freeze(&four_rod_lathe().geometry, &NO_OFFSET).is_ok());
}

#[test]
fn parallel_guides_that_leave_a_free_motion_are_refused() {
    // Rods in one plane: the platform can leave the plane.
    let rod = |x: f64, z: f64, side| {
        slider([3.0 * x, 0.0, 0.0], [x, 0.0, z], [0.0, 0.0, 1.0], 700.0, side)
    };
    let legs =
        [rod(150.0, -60.0, -1), rod(150.0, 60.0, 1), rod(-150.0, -60.0, -1), rod(-150.0, 60.0, 1)];
    let home = Some([0.0, 0.0, 1000.0, 0.0, 0.0, 0.0]);
    assert_eq!(refused(&geometry(&legs, "XYZB", "", home)).cause, Cause::SingularAtHome);
    // Four rods of the lathe's kind constrain neither A nor C.
    let lathe = four_rod_lathe().geometry;
    for coordinates in ["XYZA", "XYZC"] {
        let other = geometry(lathe.legs(), coordinates, "", lathe.home);
        assert_eq!(refused(&other).cause, Cause::SingularAtHome, "{coordinates}");
    }
    for coordinates in ["XYZB", "XYAB", "YZBC", "YABC"] {
        let mut other = geometry(lathe.legs(), coordinates, "", lathe.home);
        if !coordinates.contains('X') || !coordinates.contains('Z') {
            // Held coordinates are 0, so the guides must pass there.
            let shift = lathe.home.unwrap();
            other = changed_legs(&other, |_, leg| leg.base[2] -= shift[2]);
            other.home = Some([0.0, shift[1], 0.0, 0.0, 0.0, 0.0]);
        }
        assert!(Machine::freeze(&other, &NO_OFFSET).is_ok(), "{coordinates}");
    }
}

#[test]
fn a_home_out_of_reach_or_at_a_dead_point_is_refused_with_its_leg() {
    for case in [linear_delta(), rotary_delta()] {
        let named = |rod: f64| {
            let fault = fault_of(&case.geometry, 2, |leg| match &mut leg.kind {
                LegKind::Slider(slider) => slider.rod = rod,
                LegKind::Crank(crank) => crank.rod = rod,
                LegKind::Strut(_) | LegKind::Ring(_) => panic!("no struts here"),
            });
            (fault.cause, fault.number())
        };
        let joints = case.joints(&case.home);
        let segments = *case.machine.at(&case.home, &NO_TOOL).unwrap().segments();
        let base = Vector3::from(case.geometry.legs()[2].base);
        let span = segments[2].platform - base;
        // The shortest rod that reaches: perpendicular to the guide, or in line with the arm.
        let shortest = match case.geometry.legs()[2].kind {
            LegKind::Slider(_) => span.xy().norm(),
            LegKind::Crank(_) => span.norm() - 10.0,
            LegKind::Strut(_) | LegKind::Ring(_) => panic!("no struts here"),
        };
        assert!(joints[2].is_finite() && shortest > 0.0);
        assert_eq!(named(0.999 * shortest), (Cause::OutOfReach, Some(2)), "{}", case.name);
        assert_eq!(named(1.0001 * shortest), (Cause::DeadPoint, Some(2)), "{}", case.name);
    }
}

#[test]
fn a_home_that_asks_for_a_held_coordinate_is_refused() {
    let mut tilted = linear_delta().geometry;
    tilted.home.as_mut().unwrap()[3] = 1.0;
    let fault = refused(&tilted);
    assert_eq!((fault.cause, fault.value), (Cause::HomeHeld, 1.0));
}

#[test]
fn a_crank_angle_that_inverse_does_not_return_is_refused() {
    let case = rotary_delta();
    let joints = case.joints(&case.home);
    for turn in [-720.0, -360.0, 360.0, 1.1e6] {
        let mut turned = joints;
        turned[1] += turn;
        let fault = case.machine.forward(&turned, &case.home, &NO_TOOL, &Solver::default());
        let fault = fault.unwrap_err();
        assert_eq!((fault.cause, fault.number()), (Cause::JointAngleTooLarge, Some(1)));
    }
}

/// Returns whether a machine is refused as too long in leg 1 after a change of that leg.
fn is_too_long(given: &Geometry, change: impl Fn(&mut LegGeometry)) -> bool {
    let changed = changed_legs(given, |i, leg| {
        if i == 1 {
            change(leg);
        }
    });
    let fault = Machine::freeze(&changed, &NO_OFFSET);
    fault.is_err_and(|fault| (fault.cause, fault.number()) == (Cause::LengthTooLarge, Some(1)))
}

#[test]
fn lengths_that_cannot_be_computed_with_are_refused_with_their_leg() {
    let (linear, rotary, struts) =
        (linear_delta().geometry, rotary_delta().geometry, paper_004(10.0));
    for (long, refuse) in [(1e30, false), (1.1e30, true), (1e160, true), (f64::MAX, true)] {
        for found in [
            is_too_long(&linear, |leg| slider_of(leg).rod = long),
            is_too_long(&rotary, |leg| crank_of(leg).rod = long),
            is_too_long(&rotary, |leg| crank_of(leg).arm = [long, 0.0, 0.0]),
            is_too_long(&struts, |leg| leg.base = [0.0, 0.0, -long]),
            is_too_long(&struts, |leg| leg.platform = [long, 0.0, 0.0]),
        ] {
            assert_eq!(found, refuse, "{long}");
        }
    }
    let fault = refused(&with_strut(3, |strut| strut.lead = -1e31));
    assert_eq!((fault.cause, fault.number(), fault.value), (Cause::LengthTooLarge, Some(3), 1e31));
}

#[test]
fn offsets_and_centres_beyond_a_million_machines_are_refused() {
    for case in [linear_delta(), rotary_delta()] {
        let size = case.machine.size();
        let most = if case.name == "rotary-delta" { 1e6 } else { 1e6 * size };
        let frozen = |offset: f64| {
            let mut offsets = NO_OFFSET;
            offsets[2] = offset;
            Machine::freeze(&case.geometry, &offsets)
        };
        for sign in [1.0, -1.0] {
            assert!(frozen(sign * most).is_ok(), "{}", case.name);
            let fault = frozen(1.001 * sign * most).unwrap_err();
            assert_eq!((fault.cause, fault.number()), (Cause::OffsetTooLarge, Some(2)), "{fault}");
        }
        let mut far = case.geometry;
        far.centre[1] = -1e6 * size;
        assert!(Machine::freeze(&far, &NO_OFFSET).is_ok(), "{}", case.name);
        far.centre[1] = -1.001e6 * size;
        assert_eq!(refused(&far).cause, Cause::CentreTooFar, "{}", case.name);
    }
}

#[test]
fn a_tool_longer_than_a_million_machines_is_refused() {
    let [hexapod, _] = hexapods();
    for case in [four_rod_lathe(), hexapod] {
        let joints = case.joints(&case.home);
        let most = 1e6 * case.machine.size();
        for (k, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)] {
            let mut tool = Vector3::zeros();
            tool[k] = sign * most;
            assert_eq!(case.machine.check_tool(&tool), Ok(()));
            assert!(case.machine.inverse(&case.home, &tool).is_ok());
            tool[k] = 1.001 * sign * most;
            let solver = Solver::default();
            for fault in [
                case.machine.check_tool(&tool).unwrap_err(),
                case.machine.inverse(&case.home, &tool).unwrap_err(),
                case.machine.at(&case.home, &tool).and_then(|at| at.pose_jacobian()).unwrap_err(),
                case.machine.forward(&joints, &case.home, &tool, &solver).unwrap_err(),
            ] {
                assert_eq!((fault.cause, fault.value), (Cause::ToolTooLong, tool[k].abs()));
            }
        }
    }
}

#[test]
fn a_jacobian_where_a_joint_value_swallows_its_leg_is_refused_and_not_infinite() {
    let case = linear_delta();
    let far = Pose::from_degrees([0.0, 0.0, -1e70, 0.0, 0.0, 0.0]);
    let fault = case.machine.at(&far, &NO_TOOL).and_then(|at| at.inverse_jacobian()).unwrap_err();
    assert_eq!(fault.cause, Cause::DeadPoint, "{fault}");
}

#[test]
fn joints_beyond_all_numbers_are_refused_with_the_first_of_them() {
    let far = Pose::from_degrees([0.0, 0.0, 1e200, 0.0, 0.0, 0.0]);
    for case in [tripod(), genhexkins_case()] {
        let fault = case.machine.inverse(&far, &NO_TOOL).unwrap_err();
        assert_eq!(
            (fault.cause, fault.number()),
            (Cause::ResultNotFinite, Some(0)),
            "{}",
            case.name
        );
        assert_eq!(fault.value, f64::INFINITY);
    }
}

#[test]
fn rates_of_angles_are_refused_where_a_and_c_are_one_and_only_there() {
    let [hexapod, _] = hexapods();
    let upright = |b: f64| Pose::from_degrees([0.0, 0.0, 400.0, 0.0, b, 0.0]);
    let fault =
        hexapod.machine.at(&upright(90.0), &NO_TOOL).and_then(|at| at.pose_jacobian()).unwrap_err();
    assert_eq!(fault.cause, Cause::TiltNearRightAngle);
    assert!(hexapod.machine.at(&upright(89.0), &NO_TOOL).and_then(|at| at.pose_jacobian()).is_ok());
    // Two angles are distinguished everywhere.
    assert!(
        pentapod().machine.at(&upright(90.0), &NO_TOOL).and_then(|at| at.pose_jacobian()).is_ok()
    );
}
