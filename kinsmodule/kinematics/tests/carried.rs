// SPDX-License-Identifier: GPL-2.0-or-later
//! Axes that carry the tool or the work beside constraints: poses, joints and rates compared with an independent
//! calculation; and a table under a head, whose tip stays while the head tilts.

use crate::common::machines::{tricept, z3_head};
use crate::common::{NO_TOOL, cases, rng, uniform};
use crate::constraints::{Reference, frozen, nalgebra_reference, pose_within};
use kinematics::{
    Cause, Chain, ChainGeometry, ExtraAxes, Geometry, LinkGeometry, MachinePart, Pose, Solver,
    Vector3, World,
};
use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion};
use rand_pcg::Pcg64;

const WORK: i32 = 1;
const TOOL: i32 = 2;

/// The precision that is required of all machines, as a share of the size.
const SAME: f64 = 1e-9;

/// Returns a two-axis wrist A B on the platform, whose axes do not meet, and a rotary table C.
fn links() -> [(char, LinkGeometry); 3] {
    let link = |carries, axis, point| LinkGeometry { carries, axis, point };
    [
        ('A', link(TOOL, [1.0, 0.0, 0.1], [5.0, -10.0, -80.0])),
        ('B', link(TOOL, [0.0, 2.0, 0.0], [0.0, 12.0, -120.0])),
        ('C', link(WORK, [0.0, 0.1, 1.0], [30.0, -20.0, -1000.0])),
    ]
}

fn chain(
    geometry: &Geometry,
    links: &[(char, LinkGeometry)],
    size: f64,
) -> Result<Chain, kinematics::Fault> {
    let axes: String = links.iter().map(|(letter, _)| *letter).collect();
    let axes = ExtraAxes::parse(axes.as_bytes(), geometry.layout()).unwrap();
    let mut given = ChainGeometry::NONE;
    for (letter, link) in links {
        given.links["ABCUVW".find(*letter).unwrap()] = *link;
    }
    Chain::freeze(&given, &axes, geometry.layout(), size)
}

/// Returns the frame of what the links carry, from the carrier outward.
fn frame(carries: i32, links: &[(char, LinkGeometry)], world: &World) -> Isometry3<f64> {
    let mut frame = Isometry3::identity();
    for (letter, link) in links.iter().filter(|(_, link)| link.carries == carries) {
        let value = world["XYZABC".find(*letter).unwrap()].to_radians();
        let axis = Unit::new_normalize(Vector3::from(link.axis));
        let to = Translation3::from(Vector3::from(link.point));
        frame *= to * UnitQuaternion::from_axis_angle(&axis, value) * to.inverse();
    }
    frame
}

fn world(rng: &mut Pcg64) -> World {
    let mut value = |most: f64| uniform(rng, -most, most);
    let (a, b, c) = (value(60.0), value(60.0), value(25.0));
    [value(150.0), value(150.0), -1050.0 + value(80.0), a, b, c, 0.0, 0.0, 0.0]
}

fn tool(rng: &mut Pcg64) -> Vector3<f64> {
    Vector3::new(uniform(rng, -20.0, 20.0), uniform(rng, -20.0, 20.0), uniform(rng, 50.0, 120.0))
}

#[test]
fn a_wrist_and_a_rotary_table_reach_the_tip_that_the_loop_of_frames_gives() {
    let mut rng = rng(170);
    let (geometry, links) = (tricept(), links());
    let machine = frozen(&geometry);
    let chain = chain(&geometry, &links, machine.size()).unwrap();
    let most = SAME * machine.size();
    let home = Pose::from_degrees(geometry.home.unwrap());
    let mut compared = 0;
    for _ in 0..cases(60) {
        let (world, tool) = (world(&mut rng), tool(&mut rng));
        // The tip on the table, and the vector from there to the platform through the wrist.
        let tip = Point3::from(Vector3::new(world[0], world[1], world[2]) - tool);
        let on_work = (frame(WORK, &links, &world) * tip).coords;
        let carried = -(frame(TOOL, &links, &world) * Point3::from(-tool)).coords;
        let reference = Reference::new(&geometry, carried);
        let asked = Pose { position: on_work + carried, angles: Vector3::zeros() };
        let Some(full) = reference.complete(&asked, 200) else { continue };
        let Ok(own) = machine.pose_of_world(&chain, &world, &tool) else { continue };
        let own = Pose::from_degrees(own);
        let joints = machine.inverse(&own, &NO_TOOL).unwrap();
        for (joint, expected) in joints.iter().zip(reference.joints(&full)) {
            assert!((joint - expected).abs() <= most, "{world:?}: {joints:?} {expected}");
        }
        // And back, from home.
        let found = machine.forward(&joints, &home, &NO_TOOL, &Solver::default()).unwrap().pose;
        let mut back = world;
        back[..3].fill(0.0);
        machine.write_world(&chain, &found.to_degrees(), &mut back, &tool).unwrap();
        for (one, other) in back.iter().zip(&world) {
            assert!((one - other).abs() <= most, "{back:?} {world:?}");
        }
        // The directions of tool and work.
        let platform = nalgebra_reference::pose(&full);
        let [holder, table] = chain.frames(&machine.full_pose(&own, &NO_TOOL).unwrap(), &world);
        let expected = platform.rotation()
            * frame(TOOL, &links, &world).rotation.to_rotation_matrix().matrix();
        let work = *frame(WORK, &links, &world).rotation.to_rotation_matrix().matrix();
        assert!((holder - expected).norm() <= SAME * 10.0 && (table - work).norm() <= SAME);
        compared += 1;
    }
    assert!(compared * 10 >= cases(60) * 8, "{compared}");
}

#[test]
fn rates_of_a_wrist_beside_constraints_are_derivatives() {
    let mut rng = rng(171);
    let (geometry, links) = (tricept(), links());
    let machine = frozen(&geometry);
    let chain = chain(&geometry, &links, machine.size()).unwrap();
    for _ in 0..cases(30) {
        let (at, tool) = (world(&mut rng), tool(&mut rng));
        let Ok(rates) = machine.world_rates(&chain, &at, &tool) else { continue };
        let pose = |world: &World, tool: &Vector3<f64>| {
            Vector3::from_column_slice(&machine.pose_of_world(&chain, world, tool).unwrap()[..3])
        };
        // Steps of 1e-3: rounding of 1e-12 divided by them, and curvature of a meter per radian squared.
        for letter in 0..6 {
            let moved = |by: f64| {
                let mut world = at;
                world[letter] += by;
                pose(&world, &tool)
            };
            let difference = (moved(1e-3) - moved(-1e-3)) / 2e-3;
            let rate = rates.fixed_view::<3, 1>(0, letter).into_owned();
            assert!(
                (rate - difference).norm() < 1e-6 * (1.0 + difference.norm()),
                "{letter}: {rate} {difference}"
            );
        }
    }
}

#[test]
fn axes_that_need_a_position_which_is_not_commanded_are_refused() {
    let [wrist, ..] = links();
    let letter = ('C', LinkGeometry { carries: TOOL, ..wrist.1 });
    let fault = chain(&z3_head(""), &[letter], 700.0).expect_err("X and Y depend on A and B");
    assert_eq!(fault.cause, Cause::ChainConstrained);
    assert_eq!(fault.part, Some(MachinePart::ExtraAxis(3, b'C')));
    assert!(chain(&z3_head("XY"), &[letter], 700.0).is_ok());
    let axes = ExtraAxes::parse(b"", tricept().layout()).unwrap();
    let given = ChainGeometry { holder: Some([0.0; 3]), ..ChainGeometry::NONE };
    let fault = Chain::freeze(&given, &axes, tricept().layout(), 900.0).expect_err("work on it");
    assert_eq!(fault.cause, Cause::ChainConstrained);
}

#[test]
fn a_table_keeps_the_tip_of_a_head_in_place_over_the_whole_range_of_tilts() {
    let mut rng = rng(172);
    let (geometry, bare) = (z3_head("XY"), z3_head(""));
    let machine = frozen(&geometry);
    let most = SAME * machine.size();
    let (mut compared, mut steepest) = (0, 0.0_f64);
    for _ in 0..cases(300) {
        let tool = Vector3::new(0.0, 0.0, uniform(&mut rng, 0.0, 200.0));
        let reference = Reference::new(&bare, tool);
        let pose = pose_within(&mut rng, &geometry, &[200.0, 200.0, 60.0, 40.0, 40.0, 0.0]);
        // Beyond the reach of a rod.
        let Ok(at) = machine.at(&pose, &tool) else { continue };
        let full = at.full_pose();
        let (p, a) = (full.position, full.angles);
        // The platform that legs and constraints give for these joints, whatever the core believes.
        let start = [p.x, p.y, p.z, a.x, a.y, a.z];
        let Some(found) = reference.follow(&start, at.joints(), 1) else { continue };
        let [x, y, z, a, b, _] = found;
        let off = [
            x + at.joints()[3] - pose.position.x,
            y + at.joints()[4] - pose.position.y,
            z - pose.position.z,
            (a - pose.angles.x) * machine.radius(),
            (b - pose.angles.y) * machine.radius(),
        ];
        assert!(off.iter().all(|off| off.abs() <= most), "{pose:?}: {off:?}");
        steepest = steepest.max(at.tilt());
        compared += 1;
    }
    println!("{compared} poses, tilts up to {steepest:.1}°");
    assert!(compared * 10 >= cases(300) * 7 && steepest > 35.0, "{compared} {steepest}");
}
