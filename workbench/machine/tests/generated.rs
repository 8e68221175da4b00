// SPDX-License-Identifier: GPL-2.0-or-later
//! Generated machines through the reader, the pins, the limits and the scene, compared with their own numbers.

use kinematics::{LegKind, Limit, Margin, Part, Pose, Vector3};
use machine::limits;
use machine::read::diagnostic::of_machine;
use machine::read::machine::MachineConfig;
use machine::read::pins::printed;
use machine::scene::{Kind, Scene};
use std::collections::BTreeMap;
use test_support::common::reference::Tracker;
use test_support::generated::{ALL, Generated, LETTERS, generated};

/// Tolerance relative to the machine's size: some roundings of lengths whose sums have two different orders, and of
/// chains and rods that move 2.5 times as fast as the platform.
const SAME: f64 = 1e-11;

/// Runs a test for every machine, read from its file.
fn each(mut test: impl FnMut(&mut Generated, &MachineConfig)) {
    for seed in ALL {
        let mut drawn = generated(seed);
        let folder = tempfile::tempdir().unwrap();
        let file = drawn.write(folder.path());
        let config = MachineConfig::read(&file)
            .unwrap_or_else(|error| panic!("{}:\n{}", drawn.name, of_machine(&error)));
        test(&mut drawn, &config);
    }
}

#[test]
fn every_value_of_the_file_is_read_where_it_belongs() {
    each(|drawn, config| {
        let name = &drawn.name;
        assert_eq!(config.world_home, drawn.home, "{name}");
        assert_eq!(config.length_unit(), if drawn.unit == 1.0 { "mm" } else { "inch" });
        assert_eq!(config.units_per_mm, drawn.unit);
        assert!((config.period * 1e9 - f64::from(drawn.period)).abs() < 1e-6, "{name}");
        assert_eq!(config.max_velocity, drawn.velocity, "{name}");
        assert_eq!(config.max_acceleration, drawn.acceleration, "{name}");
        assert_eq!(config.mechanisms.len(), drawn.mechanisms.len());
        let joints = drawn.mechanisms.iter().map(|built| built.joints.len()).sum::<usize>();
        assert_eq!(config.guarded_joints(), joints, "{name}");
        assert_eq!(config.all_joints().count(), joints + drawn.extra.len(), "{name}");
        for (mechanism, built) in config.mechanisms.iter().zip(&drawn.mechanisms) {
            assert_eq!(mechanism.geometry, built.geometry, "{name}");
            assert_eq!(mechanism.offsets[..built.offsets.len()], built.offsets, "{name}");
            assert_eq!(mechanism.spindle, Vector3::z() * built.spindle_offset, "{name}");
            assert_eq!(mechanism.place.first_leg, built.first_leg, "{name}");
            assert_eq!(mechanism.place.first_joint, built.first_joint, "{name}");
            assert_eq!(mechanism.home, built.geometry.home.unwrap(), "{name}");
            assert_eq!(mechanism.tilt_limit, drawn.tilt_limit, "{name}");
            assert_eq!(mechanism.conditioning_limit, 0.06, "{name}");
            for k in 0..6 {
                let axis = built.letters[k]
                    .and_then(|letter| built.axes.iter().find(|axis| axis.letter == letter));
                let Some(axis) = axis else { continue };
                let read = &mechanism.programmed[k];
                assert_eq!(
                    [read.min, read.max, read.max_velocity, read.max_acceleration],
                    [axis.min, axis.max, axis.velocity, axis.acceleration],
                    "{name} {}",
                    axis.letter
                );
            }
            let set = limits::of(mechanism);
            for (i, joint) in built.joints.iter().enumerate() {
                let [limit, rate] = joint.correction;
                assert_eq!(mechanism.joints[i].home, joint.home, "{name} {i}");
                let range = [joint.min + limit, joint.max - limit];
                assert_eq!([set.min[i], set.max[i]], range, "{name} {i}");
                assert_eq!(set.speed[i], joint.velocity - rate, "{name} {i}");
                assert_eq!(set.acceleration[i], joint.acceleration, "{name} {i}");
                let unit = if joint.is_angular { "degrees" } else { config.length_unit() };
                assert_eq!(mechanism.unit_of(i), unit, "{name} {i}");
                let part = Part::Joint(i);
                assert_eq!(limits::range(mechanism, Limit::JointRange, part), Some(range));
                let speed = limits::unit(mechanism, Limit::JointSpeed, part);
                assert_eq!(speed, format!("{unit}/s"), "{name} {i}");
                let number = (built.first_joint + i).to_string();
                let is_leg = i < built.geometry.legs().len();
                let leg = (built.first_leg + i).to_string();
                let reported = limits::part(mechanism, Limit::JointRange, part);
                assert!(
                    !is_leg || reported.ends_with(&format!(" {leg}")),
                    "{name} {number}: {reported}"
                );
            }
            for k in 0..6 {
                let Some(letter) = built.letters[k] else { continue };
                let part = Part::Axis(kinematics::Letter::ALL[k]);
                assert_eq!(limits::part(mechanism, Limit::Axis, part), format!("axis {letter}"));
            }
        }
        for (n, (extra, read)) in drawn.extra.iter().zip(&config.first().extra).enumerate() {
            assert_eq!(read.letter, extra.axis.letter, "{name}");
            assert_eq!([read.axis.min, read.axis.max], [extra.axis.min, extra.axis.max]);
            assert_eq!([read.joint.min, read.joint.max], [extra.joint.min, extra.joint.max]);
            assert_eq!(read.joint.max_velocity, extra.joint.velocity);
            assert_eq!(read.joint.max_acceleration, extra.joint.acceleration);
            assert_eq!(read.joint.home, extra.joint.home);
            assert_eq!(read.is_rotary(), extra.is_angle());
            let (first, of_axis, of_joint) = (config.first(), &extra.axis, &extra.joint);
            let part = Part::Joint(first.joints.len() + n);
            let ends = [of_axis.min.max(of_joint.min), of_axis.max.min(of_joint.max)];
            for (limit, range) in [
                (Limit::JointRange, ends),
                (Limit::JointSpeed, [-of_joint.velocity, of_joint.velocity]),
                (Limit::JointAcceleration, [-of_joint.acceleration, of_joint.acceleration]),
            ] {
                assert_eq!(limits::range(first, limit, part), Some(range), "{name} {n}");
                let margin = Margin { limit, part, value: 0.0, range };
                let shown = limits::allowed(first, &margin);
                assert!(!shown.contains("inf"), "{name} {n}: {shown}");
            }
        }
    });
}

/// Returns the pins that a machine needs, computed from its numbers.
fn pins(drawn: &Generated) -> BTreeMap<String, f64> {
    let mut pins = BTreeMap::new();
    let mut set = |name: String, parts: &[&str], values: &[f64]| {
        for (part, value) in parts.iter().zip(values) {
            let dot = if part.is_empty() { "" } else { "." };
            pins.insert(format!("{name}{dot}{part}"), *value);
        }
    };
    const XYZ: [&str; 3] = ["x", "y", "z"];
    const POSE: [&str; 6] = ["x", "y", "z", "a", "b", "c"];
    set("home".into(), &POSE, &drawn.home);
    set("conditioning-limit".into(), &[""], &[0.06]);
    set("rod-clearance".into(), &[""], &[2.0 * drawn.unit]);
    drawn.tilt_limit.iter().for_each(|limit| set("tilt-limit".into(), &[""], &[*limit]));
    set("max-override".into(), &[""], &[drawn.feed_override]);
    set("limit-iterations".into(), &[""], &[288.0]);
    drawn.holder.iter().for_each(|holder| set("work-on-platform".into(), &XYZ, holder));
    if drawn.mechanisms.len() > 1 {
        set("mechanism-clearance".into(), &[""], &[50.0 * drawn.unit]);
        set("second.home".into(), &POSE, &drawn.mechanisms[1].geometry.home.unwrap());
    }
    for (built, stem) in drawn.mechanisms.iter().zip(["", "second."]) {
        set(format!("{stem}centre"), &XYZ, &built.geometry.centre);
        set(format!("{stem}spindle-offset"), &[""], &[built.spindle_offset]);
        for (i, leg) in built.geometry.legs().iter().enumerate() {
            let n = built.first_leg + i;
            set(format!("base.{n}"), &XYZ, &leg.base);
            set(format!("offset.{n}"), &[""], &[built.offsets[i]]);
            set(format!("base-cone.{n}"), &[""], &[60.0]);
            if let LegKind::Ring(ring) = leg.kind {
                set(format!("effector.{n}"), &["r", "z"], &[ring.radius, leg.platform[2]]);
            } else {
                set(format!("platform.{n}"), &XYZ, &leg.platform);
            }
            match leg.kind {
                LegKind::Ring(_) => {}
                LegKind::Strut(strut) => {
                    // Applies to a `lead.N` of 0.
                    set("screw-lead".into(), &[""], &[0.0]);
                    set(format!("lead.{n}"), &[""], &[strut.lead]);
                    if strut.lead != 0.0 {
                        set(format!("base-n.{n}"), &XYZ, &strut.base_axis);
                        set(format!("platform-n.{n}"), &XYZ, &strut.platform_axis);
                    }
                }
                LegKind::Slider(slider) => {
                    set(format!("guide.{n}"), &XYZ, &slider.guide);
                    set(format!("rod.{n}"), &[""], &[slider.rod]);
                    set(format!("side.{n}"), &[""], &[f64::from(slider.side)]);
                }
                LegKind::Crank(crank) => {
                    set(format!("axis.{n}"), &XYZ, &crank.axis);
                    set(format!("arm.{n}"), &XYZ, &crank.arm);
                    set(format!("rod.{n}"), &[""], &[crank.rod]);
                    set(format!("side.{n}"), &[""], &[f64::from(crank.side)]);
                }
            }
        }
        for (i, joint) in built.joints.iter().enumerate() {
            let n = built.first_joint + i;
            set(format!("min-limit.{n}"), &[""], &[joint.min]);
            set(format!("max-limit.{n}"), &[""], &[joint.max]);
            set(format!("max-velocity.{n}"), &[""], &[joint.velocity]);
            set(format!("max-acceleration.{n}"), &[""], &[joint.acceleration]);
            if joint.correction[0] > 0.0 {
                set(format!("correction-limit.{n}"), &[""], &joint.correction[..1]);
                set(format!("correction-rate.{n}"), &[""], &joint.correction[1..]);
            }
        }
    }
    for extra in drawn.extra.iter().filter(|extra| !extra.carries.is_empty()) {
        let stem = format!("chain.{}", extra.axis.letter.to_ascii_lowercase());
        let carries = ["WORK", "TOOL", "LEGS"].iter().position(|word| *word == extra.carries);
        set(format!("{stem}.carries"), &[""], &[(carries.unwrap() + 1) as f64]);
        set(format!("{stem}.axis"), &XYZ, &extra.direction);
        if extra.is_angle() {
            set(format!("{stem}.point"), &XYZ, &extra.point);
        }
    }
    for extra in &drawn.extra {
        let pin = format!("extra-acceleration.{}", extra.axis.letter.to_ascii_lowercase());
        set(pin, &[""], &[extra.axis.acceleration]);
    }
    // Axes that limit the planner's acceleration: all except slides of extra axes that carry nothing.
    let own = drawn.mechanisms.iter().flat_map(|built| &built.axes);
    let carrying = drawn
        .extra
        .iter()
        .filter(|extra| !extra.carries.is_empty() || "ABCXYZ".contains(extra.axis.letter));
    let axes: Vec<_> = own.chain(carrying.map(|extra| &extra.axis)).collect();
    for (name, angular, traj) in [
        ("linear-acceleration", false, drawn.acceleration[0]),
        ("angular-acceleration", true, drawn.acceleration[1]),
    ] {
        let alike = axes.iter().filter(|axis| "ABC".contains(axis.letter) == angular);
        set(name.into(), &[""], &[alike.map(|axis| axis.acceleration).fold(traj, f64::min)]);
    }
    pins
}

#[test]
fn every_pin_has_its_value() {
    each(|drawn, config| {
        let text = printed(&config.file, "1.2.3").unwrap();
        let reported: BTreeMap<String, f64> = text
            .lines()
            .filter_map(|line| line.strip_prefix("pin ")?.split_once(' '))
            .map(|(name, value)| (name.into(), value.parse().unwrap()))
            .collect();
        assert_eq!(reported, pins(drawn), "{}", drawn.name);
    });
}

#[test]
fn joints_at_poses_of_linuxcnc_are_those_of_the_equations() {
    each(|drawn, config| {
        let mut reached = 0;
        for n in 0..30 {
            let world = drawn.world(1.0);
            let tools = drawn.tools(n % 3);
            let Some(wanted) = drawn.joints(&world, &tools) else { continue };
            for (m, mechanism) in config.mechanisms.iter().enumerate() {
                let own = drawn.mechanisms[m].own(&world);
                let extra = drawn.extra.iter().map(|extra| &extra.axis.letter);
                let mut values = [0.0; kinematics::MAX_EXTRA];
                for (value, letter) in values.iter_mut().zip(extra) {
                    *value = world[LETTERS.iter().position(|l| l == letter).unwrap()];
                }
                let carried = mechanism.carried(&own, &values, &tools[m]).unwrap();
                let tool = mechanism.chain.machine_tool(&tools[m]);
                let found = mechanism.machine.inverse(&Pose::from_degrees(carried), &tool);
                let found =
                    found.unwrap_or_else(|fault| panic!("{} {world:?}: {fault}", drawn.name));
                let from = drawn.mechanisms[m].first_joint;
                let size = mechanism.machine.size();
                for (i, joint) in found.iter().take(mechanism.joints.len()).enumerate() {
                    let is_angular = drawn.mechanisms[m].joints[i].is_angular;
                    let unit = if is_angular { 360.0 } else { size };
                    let off = (joint - wanted[from + i]).abs();
                    assert!(off < SAME * unit, "{} joint {}: {off}", drawn.name, from + i);
                }
                // The equations hold, too, including the side of every rod.
                if drawn.is_carried() {
                    continue;
                }
                let native: Vec<f64> = found
                    .iter()
                    .zip(&mechanism.offsets)
                    .map(|(joint, offset)| joint + offset)
                    .collect();
                let mut joints = [0.0; kinematics::MAX_JOINTS];
                joints[..found.len()].copy_from_slice(&found);
                joints[..mechanism.legs()].copy_from_slice(&native[..mechanism.legs()]);
                let mut pose = Pose::from_degrees(own);
                pose.position += pose.rotation() * tool - tool;
                let tracker = Tracker::new(&mechanism.geometry);
                assert!(tracker.fits(&pose, &joints), "{} {world:?}", drawn.name);
            }
            reached += 1;
        }
        assert!(reached > 20, "{}: {reached}", drawn.name);
    });
}

#[test]
fn a_scene_has_the_numbers_of_the_file() {
    each(|drawn, config| {
        for (mechanism, built) in config.mechanisms.iter().zip(&drawn.mechanisms) {
            let (scene, name) = (Scene::new(mechanism), &drawn.name);
            assert_eq!(&scene.machine, name);
            assert_eq!((scene.units_per_mm, scene.length_unit), (drawn.unit, config.length_unit()));
            assert_eq!(scene.spindle_offset, built.spindle_offset);
            assert_eq!(scene.tool_direction, Some("down"));
            assert_eq!(scene.centre, built.geometry.centre);
            assert_eq!(scene.is_of_pair, drawn.mechanisms.len() == 2);
            assert_eq!(
                scene.pins,
                if built.first_leg > 0 { "pkmkins.second." } else { "pkmkins." }
            );
            let layout = built.geometry.layout();
            let names = |letters: &kinematics::Letters| {
                letters.as_slice().iter().map(|letter| letter.name()).collect::<String>()
            };
            assert_eq!(scene.coordinates, names(layout.coordinates()));
            assert_eq!(scene.table, names(layout.table()));
            assert_eq!(scene.home.pose, built.geometry.home.unwrap());
            let homes: Vec<f64> = built.joints.iter().map(|joint| joint.home).collect();
            assert_eq!(scene.home.joints, homes);
            assert_eq!((scene.conditioning_limit, scene.tilt_limit), (0.06, drawn.tilt_limit));
            assert_eq!(scene.clearance, Some(2.0 * drawn.unit));
            for (i, (leg, given)) in scene.legs.iter().zip(built.geometry.legs()).enumerate() {
                assert_eq!((leg.offset, leg.base), (built.offsets[i], given.base), "{name} {i}");
                assert_eq!((leg.platform, leg.base_cone), (given.platform, Some(60.0)));
                assert_eq!(leg.platform_cone, None);
                let close = |one: &[f64; 3], other: &[f64; 3]| {
                    (Vector3::from(*one) - Vector3::from(*other).normalize()).norm() < 1e-15
                };
                let is_same = match (&leg.kind, given.kind) {
                    (Kind::Strut { lead }, LegKind::Strut(strut)) => *lead == strut.lead,
                    (Kind::Ring { radius }, LegKind::Ring(ring)) => *radius == ring.radius,
                    (Kind::Slider { guide, rod }, LegKind::Slider(slider)) => {
                        close(guide, &slider.guide) && *rod == slider.rod
                    }
                    (Kind::Crank { axis, arm, rod }, LegKind::Crank(crank)) => {
                        close(axis, &crank.axis) && *arm == crank.arm && *rod == crank.rod
                    }
                    _ => false,
                };
                assert!(is_same, "{name} {i}: {leg:?}");
            }
            for (i, (joint, given)) in scene.joints.iter().zip(&built.joints).enumerate() {
                assert_eq!(joint.number, built.first_joint + i, "{name}");
                assert_eq!([joint.min, joint.max], [given.min, given.max], "{name} {i}");
                assert_eq!(joint.max_velocity, given.velocity, "{name} {i}");
                let unit = if given.is_angular { "degrees" } else { config.length_unit() };
                assert_eq!(joint.unit, unit, "{name} {i}");
            }
            if !drawn.is_carried() {
                for axis in &scene.axes {
                    let k = LETTERS.iter().position(|letter| *letter == axis.letter).unwrap();
                    let own = built.letters[k].unwrap();
                    let given = built.axes.iter().find(|given| given.letter == own).unwrap();
                    assert_eq!([axis.min, axis.max], [given.min, given.max], "{name} {own}");
                }
            }
            assert_eq!(scene.axes.len(), built.axes.len(), "{name}");
            if built.first_leg > 0 {
                assert!(scene.extra_axes.is_empty() && scene.chain.is_empty());
                continue;
            }
            let behind: usize = drawn.mechanisms.iter().map(|built| built.joints.len()).sum();
            for (n, (axis, extra)) in scene.extra_axes.iter().zip(&drawn.extra).enumerate() {
                assert_eq!((axis.letter, axis.joint), (extra.axis.letter, behind + n), "{name}");
                let (of_axis, of_joint) = (&extra.axis, &extra.joint);
                let ends = [of_axis.min.max(of_joint.min), of_axis.max.min(of_joint.max)];
                assert_eq!([axis.min, axis.max], ends, "{name}");
                assert_eq!(axis.home, extra.joint.home, "{name}");
            }
            let carrying = || drawn.extra.iter().enumerate().filter(|(_, e)| !e.carries.is_empty());
            assert_eq!(scene.chain.len(), carrying().count(), "{name}");
            for (link, (n, extra)) in scene.chain.iter().zip(carrying()) {
                assert_eq!((link.letter, link.joint), (extra.axis.letter, behind + n), "{name}");
                assert_eq!(link.carries, extra.carries.to_ascii_lowercase(), "{name}");
                assert_eq!((link.is_rotary, link.point), (extra.is_angle(), extra.point), "{name}");
                let direction = Vector3::from(extra.direction).normalize();
                assert!((Vector3::from(link.axis) - direction).norm() < 1e-15, "{name}");
            }
            assert_eq!((scene.holder, scene.is_carried), (drawn.holder, drawn.is_carried()));
        }
    });
}

/// Checks that the box of platform poses derived from LinuxCNC's axis limits contains all of these poses.
#[test]
fn limits_of_the_platform_hold_every_pose_that_the_axes_allow() {
    each(|drawn, config| {
        let tools = drawn.tools(0);
        for _ in 0..200 {
            let world = drawn.world(1.0);
            let (pose, _) = drawn.platform(0, &world, &tools[0]);
            for (k, axis) in config.first().axes.iter().enumerate() {
                if drawn.mechanisms[0].moves(k) {
                    let slack = SAME * config.first().machine.size();
                    let inside = pose[k] >= axis.min - slack && pose[k] <= axis.max + slack;
                    assert!(inside, "{}: {k}: {} in {axis:?}", drawn.name, pose[k]);
                }
            }
        }
    });
}

#[test]
fn a_limit_of_a_joint_of_a_leg_has_the_number_of_the_leg_in_the_file() {
    let mut seconds = 0;
    each(|drawn, config| {
        for (mechanism, built) in config.mechanisms.iter().zip(&drawn.mechanisms) {
            for (n, limit) in (0..built.geometry.legs().len()).flat_map(|n| {
                let all = [
                    Limit::BaseCone,
                    Limit::BasePyramid,
                    Limit::PlatformCone,
                    Limit::PlatformPyramid,
                ];
                all.map(|limit| (n, limit))
            }) {
                let name = limits::part(mechanism, limit, Part::Leg(n));
                assert!(
                    name.ends_with(&format!(" joint of leg {}", built.first_leg + n)),
                    "{name}"
                );
                seconds += usize::from(built.first_leg > 0);
            }
        }
    });
    assert!(seconds > 0);
}
