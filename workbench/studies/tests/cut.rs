// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm cut`: forces of the drives, deflection and chip against independent computations, the pass, which must not
//! miss a peak, and the command as users run it.

use kinematics::{Joints, MAX_EXTRA, MAX_JOINTS, Matrix3, Pose, Vector3};
use linuxcnc::row::{Beside, Commanded, Extra, Flags, Row};
use machine::read::mechanism::Mechanism;
use nalgebra::Rotation3;
use program::motion::{Move, MoveKind, Spindle};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::collections::BTreeMap;
use std::sync::Arc;
use studies::cut::moment::{Moment, Subject};
use studies::cut::pass::Pass;
use studies::cut::program::{Line, NoCut, against_thicker, lines};
use studies::cut::rapids::through_stock;
use studies::cut::stance::{self, Stance};
use studies::cut::teeth::Teeth;
use studies::dynamics::capacity::Capacity;
use studies::dynamics::model::Model;
use studies::study::file::Study;
use studies::study::sensitivity::Sensitivity;
use studies::study::springs::Springs;
use studies::study::stiffness::Stiffness;
use test_support::CUT as STUDY;
use test_support::shipped::{self, config};

const TOOL: Vector3<f64> = Vector3::new(0.0, 0.0, 100.0);

/// Rounding of products of matrices with a condition number of a thousand.
const ROUNDED: f64 = 1e-9;

fn subject<'a>(config: &'a Mechanism, text: &str) -> Subject<'a> {
    let study = Study::parse(text).unwrap();
    let cutter = study.cutting.unwrap();
    Subject {
        config,
        model: Model::of(config, &study).unwrap(),
        drives: Capacity::of(config, &study).unwrap(),
        teeth: Teeth::of(&cutter, study.milling.as_ref(), cutter.depth_mm.unwrap()),
    }
}

/// Returns a moment of a cut at rest.
fn cut(pose: [f64; 6]) -> Moment {
    let feed = Vector3::new(3.0, 2.0, 0.5);
    Moment {
        line: 1,
        at: 0.0,
        programmed: pose,
        poses: [pose; 3],
        tool: TOOL,
        rotation: Pose::from_degrees(pose).rotation(),
        speed: 10.0,
        feed,
        rpm: Some(6000.0),
    }
}

#[track_caller]
fn close(found: f64, expected: f64, size: f64) {
    assert!((found - expected).abs() < ROUNDED * size, "{found} {expected}");
}

#[test]
fn six_struts_of_one_slope_share_the_weight() {
    let config = config("hexapod");
    // A self-locking thread exerts no torque on the joints.
    let text = STUDY.replace("max_force", "screw = \"self-locking\"\nmax_force");
    let subject = subject(&config, &text);
    let pose = [0.0, 0.0, 300.0, 0.0, 0.0, 0.0];
    let judged = subject.judge(&Moment { rpm: None, ..cut(pose) }).unwrap();
    let at = config.machine.at(&Pose::from_degrees(pose), &TOOL).unwrap();
    let slope = at.segments()[0].span().normalize().z;
    // 6 f nz = m g: by symmetry all struts have the same force.
    for [low, high] in judged.drives {
        close(low, 2.0 * 9.80665 / (6.0 * slope), 1.0);
        assert_eq!(low, high);
    }
    assert_eq!((judged.chip, judged.force, judged.lag.norm()), (None, 0.0, 0.0));
}

#[test]
fn a_drive_bears_what_virtual_work_asks_of_it_at_every_angle_of_the_cutter() {
    let config = config("hexapod");
    let subject = subject(&config, STUDY);
    let place = [-80.0, 60.0, 350.0, 10.0, -20.0, 0.0];
    let moment = cut(place);
    let weight = subject.judge(&Moment { rpm: None, ..moment }).unwrap();
    let judged = subject.judge(&moment).unwrap();
    let pose = Pose::from_degrees(place);
    let gain =
        Sensitivity::at(&config, &pose, &TOOL, config.machine.radius()).unwrap().unwrap().gain;
    let frame = subject.teeth.frame(&moment.feed, &pose.rotation());
    // 10 mm/s, two teeth, 100 revolutions per second.
    let chip = 0.05;
    close(judged.chip.unwrap(), chip, 1.0);
    for (i, [low, high]) in judged.drives.iter().enumerate() {
        // A small motion dq of one drive moves the tip by gain dq: f dq + F gain dq = 0.
        let work = |force: Vector3<f64>| -> f64 {
            let force = frame * force;
            weight.drives[i][0] - (0..3).map(|k| force[k] * gain[(k, i)]).sum::<f64>()
        };
        let all: Vec<f64> = subject.teeth.forces(chip).map(work).collect();
        close(*low, all.iter().copied().fold(f64::INFINITY, f64::min), 100.0);
        close(*high, all.iter().copied().fold(f64::NEG_INFINITY, f64::max), 100.0);
        assert!(low < high);
    }
}

#[test]
fn the_tool_yields_by_the_compliance_of_the_stiffness_study() {
    for (machine, place) in [
        ("hexapod", [-80.0, 60.0, 350.0, 10.0, -20.0, 0.0]),
        ("linear-delta", [20.0, -30.0, 40.0, 0.0, 0.0, 0.0]),
        ("pyramid", [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
    ] {
        let config = config(machine);
        let table = "[table]\nstiffness_n_per_um = 50\nmass_kg = 80\ndamping_ratio = 0.02\n";
        let text = format!("{STUDY}{table}");
        let place = if machine == "pyramid" { config.home } else { place };
        let subject = subject(&config, &text);
        let moment = Moment { tool: config.spindle, ..cut(place) };
        let judged = subject.judge(&moment).unwrap();
        let springs = Springs::of(&config, &Study::parse(&text).unwrap()).unwrap();
        let pose = Pose::from_degrees(place);
        let found = Stiffness::at(&config, &pose, &config.spindle, &springs).unwrap().unwrap();
        let force = subject.teeth.frame(&moment.feed, &pose.rotation())
            * subject.teeth.mean(judged.chip.unwrap());
        let compliance = found.compliance.fixed_view::<3, 3>(0, 0).into_owned();
        let expected = compliance * force;
        assert!(expected.norm() > 1e-6, "{machine} {expected}");
        let off = (judged.deflection - expected).norm();
        assert!(off < ROUNDED * expected.norm(), "{machine} {} {expected}", judged.deflection);
    }
}

#[test]
fn inertia_moves_the_tool_as_the_force_that_speeds_it_up() {
    let config = config("linear-delta");
    let subject = subject(&config, STUDY);
    // The platform does not rotate: its inertia is a force -m a on any of its points.
    let (period, acceleration) = (config.period, 3000.0);
    let step = acceleration * period * period / 2.0;
    let pose = |x: f64| [x, 0.0, 50.0, 0.0, 0.0, 0.0];
    let poses = [pose(step), pose(0.0), pose(step)];
    let judged = subject.judge(&Moment { poses, tool: config.spindle, ..cut(pose(0.0)) }).unwrap();
    let springs = Springs::of(&config, &Study::parse(STUDY).unwrap()).unwrap();
    let pose = Pose::from_degrees(pose(0.0));
    let found = Stiffness::at(&config, &pose, &config.spindle, &springs).unwrap().unwrap();
    let compliance = found.compliance.fixed_view::<3, 3>(0, 0).into_owned();
    // 2 kg are 0.002 t.
    let expected = compliance * Vector3::new(-0.002 * acceleration, 0.0, 0.0);
    let off = (judged.lag - expected).norm();
    // The second difference of positions of 50 mm that differ by a nanometer and more.
    assert!(off < 1e-6 * expected.norm(), "{} {expected}", judged.lag);
}

#[test]
fn the_harmonics_of_the_teeth_add_up_to_their_force() {
    let cutting = Study::parse(STUDY).unwrap().cutting.unwrap();
    let teeth = Teeth::of(&cutting, None, 0.1);
    let chip = 0.05;
    let mean = teeth.mean(chip);
    // The force of a slot with two teeth is continuous: it has only the first two harmonics, except along
    // the axis, where it is a half sine with a third harmonic of 2 %.
    let parts: Vec<_> = (1..=20).map(|k| teeth.harmonic(chip, k)).collect();
    let largest = teeth.forces(chip).map(|force| (force - mean).norm()).fold(0.0, f64::max);
    let found = Teeth::swing(&parts);
    assert!((found / largest - 1.0).abs() < 1e-2, "{found} {largest}");
    // In the plane of a slot Ft = K h is a sine of twice the angle: h sin, h cos over half a turn.
    let [kt, kr] = [700.0, 200.0].map(|k: f64| k * 0.1 * chip / 2.0);
    let amplitude = parts[0].map(|part| part.re.hypot(part.im));
    for k in [0, 1] {
        close(amplitude[k], kt.hypot(kr), 1.0);
    }
}

fn row(cycle: u64, x: f64) -> Row {
    let joints: Joints = [0.0; MAX_JOINTS];
    Row {
        cycle,
        file: 0,
        number: 0,
        line: 7,
        flags: Flags { on: true, tool_busy: false, held: false },
        pose: [x, 0.0, 50.0, 0.0, 0.0, 0.0],
        joints,
        errors: joints,
        allowed: joints,
        extra: Extra::default(),
        second: Beside::default(),
        tool: [0.0; 3],
        feed: 1.0,
    }
}

#[test]
fn a_peak_of_one_cycle_is_not_lost_in_one_pass() {
    let config = config("linear-delta");
    let subject = subject(&config, STUDY);
    let lines = BTreeMap::from([(7, Line { feed: 1000.0, rpm: 6000.0 })]);
    // 10 mm/s, with one deviation of 1 um: an acceleration of 2 m/s² in one cycle.
    let x = |k: u64| 0.01 * k as f64 * config.period / 1e-3 + if k == 777 { 1e-3 } else { 0.0 };
    let found = |bump: u64| {
        let mut pass = Pass::new(&subject, &lines);
        for k in 0..2000 {
            let shift = if k == 777 { bump as f64 * 1e-3 - 1e-3 } else { 0.0 };
            pass.see(&row(k, x(k) + shift)).unwrap();
        }
        pass.finish().unwrap()
    };
    let (calm, jerky) = (found(0), found(1));
    assert!(calm.peaks[3].as_ref().unwrap().value < 1e-9);
    let peak = jerky.peaks[3].as_ref().unwrap();
    assert!(peak.value > 1e-4 && peak.judged.line == 7, "{}", peak.value);
    assert!((peak.judged.pose[0] - x(777)).abs() < 1e-12);
    // Every cycle counts as time, but only one in ten is evaluated.
    assert_eq!((jerky.lines[&7].cycles, jerky.cutting), (1998, 1998));
    assert_eq!(jerky.judged, 200);
}

/// LinuxCNC's feed per turn is 0.2 % above F times S.
#[test]
fn a_feed_per_turn_cuts_although_it_is_faster_than_programmed() {
    let config = config("linear-delta");
    let subject = subject(&config, STUDY);
    let lines = BTreeMap::from([(7, Line { feed: 10.0, rpm: 6000.0 })]);
    for (is_per_turn, cutting) in [(true, 98), (false, 0)] {
        let mut pass = Pass::new(&subject, &lines);
        pass.command(&Commanded { line: 7, is_per_turn, ..Commanded::default() });
        for k in 0..100 {
            pass.see(&row(k, 10.02 * config.period * k as f64)).unwrap();
        }
        assert_eq!(pass.finish().unwrap().cutting, cutting);
    }
}

/// Returns a move to a tip without a tool.
fn to(kind: MoveKind, line: u32, end: [f64; 6]) -> Move {
    Move {
        kind,
        line,
        end,
        feed: 10.0,
        angular_feed: 0.0,
        tool: [0.0; 3],
        file: 0,
        extra: false,
        second: None,
        lasts: None,
        extra_end: [0.0; MAX_EXTRA],
        spindle: Spindle::Turning(6000.0),
        is_per_turn: false,
    }
}

#[test]
fn a_rapid_through_the_material_that_is_left_is_found() {
    let config = config("hexapod");
    let at = |kind, line, [x, y, z]: [f64; 3]| to(kind, line, [x, y, z, 0.0, 0.0, 0.0]);
    let (rapid, feed) = (MoveKind::Rapid, MoveKind::Feed);
    let mut moves = vec![
        at(rapid, 0, [0.0, 0.0, 310.0]),
        // Above, and beside the stock.
        at(rapid, 1, [-10.0, 10.0, 310.0]),
        at(rapid, 2, [-10.0, 10.0, 295.0]),
        // A slot, back in it, and across into its wall.
        at(feed, 3, [50.0, 10.0, 295.0]),
        at(rapid, 4, [-10.0, 10.0, 295.0]),
        at(rapid, 5, [20.0, 10.0, 296.0]),
        at(rapid, 6, [20.0, 14.0, 296.0]),
        at(rapid, 7, [20.0, 14.0, 310.0]),
        // Down into the uncut corner.
        at(rapid, 8, [38.0, 18.0, 310.0]),
        at(rapid, 9, [38.0, 18.0, 299.9]),
    ];
    let milling = "[milling]\nspeed_rpm = 6000\nfeed_mm = 0.1\ndiameter_mm = 10\nseconds = 1\n";
    let stock = "[stock]\nlow_mm = [0, 0]\nhigh_mm = [40, 20]\ntop_mm = 300\ncell_mm = 0.5\n";
    let study = |text: &str| Study::parse(&format!("{STUDY}{text}")).unwrap();
    let found = |text: &str, moves: &[Move]| through_stock(&config, &study(text), moves);
    let both = format!("{milling}{stock}");
    assert_eq!(found(&both, &moves), Ok(vec![6, 9]));
    assert!(found(stock, &moves).unwrap_err().contains("diameter_mm in [milling]"));
    assert!(found(milling, &moves).unwrap_err().contains("no [stock]"));
    let coarse = both.replace("cell_mm = 0.5", "cell_mm = 0.6");
    assert!(found(&coarse, &moves).unwrap_err().contains("a twentieth of the cutter's diameter"));
    moves.push(to(feed, 10, [38.0, 18.0, 299.0, 5.0, 0.0, 0.0]));
    assert!(found(&both, &moves).unwrap_err().contains("line 10: the tool is inclined by 5.00"));
}

#[test]
fn a_chip_that_gets_thicker_against_every_feed_is_refused() {
    let config = config("four-rod-lathe");
    let study = |thicker: &str| {
        Study::parse(&TURNING.replace("[0, 0, -1]", thicker)).unwrap().turning.unwrap()
    };
    let at = |line, x: f64, z: f64| to(MoveKind::Feed, line, [x, 440.0, z, 0.0, 0.0, 0.0]);
    let moves = [at(1, 20.0, 950.0), at(2, 20.0, 900.0), at(3, 30.0, 900.0), at(4, 30.0, 920.0)];
    let found =
        |thicker: &str, count: usize| against_thicker(&config, &moves[..count], &study(thicker));
    // Towards the headstock and across, then also away from it.
    assert_eq!(found("[0, 0, -1]", 3), Ok(None));
    assert_eq!(found("[0, 0, -1]", 4), Ok(Some((1, 4))));
    assert_eq!(found("[0, 0, 1]", 3), Err(NoCut::Thinner(2)));
    assert_eq!(found("[0, 0, 1]", 4), Ok(Some((1, 2))));
    assert_eq!(found("[0, 1, 0]", 4), Ok(None));
}

const TURNING: &str = "[platform]\nmass_kg = 60\ncentre_mm = [0, 0, 0]\n\
    inertia_kg_m2 = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n\
    [legs]\nstiffness_n_per_um = 60\ndamping_ratio = 0.03\nmax_force_n = 9000\n\
    [turning]\nkf_n_per_mm2 = 2000\nthicker = [0, 0, -1]\nforce = [0.3, -1, 0.4]\ndepth_mm = 2\n";

/// Returns a lathe that turns at 600 1/min with a feed of 0.2 mm per revolution, and its moment.
fn turning(config: &Mechanism) -> (Subject<'_>, Moment) {
    let study = Study::parse(TURNING).unwrap();
    let turning = study.turning.unwrap();
    let subject = Subject {
        config,
        model: Model::of(config, &study).unwrap(),
        drives: Capacity::of(config, &study).unwrap(),
        teeth: Teeth::of_edge(&turning, turning.depth_mm.unwrap().0),
    };
    let place = [20.0, 440.0, 950.0, 0.0, 6.0, 0.0];
    let tool = config.spindle + Vector3::new(230.0, 0.0, 10.0);
    let (speed, rpm) = (2.0, Some(600.0));
    (subject, Moment { tool, speed, rpm, feed: -Vector3::z(), ..cut(place) })
}

/// Returns the force of the edge: 2000 N/mm² on 2 mm by 0.2 mm, in machine axes.
fn edge_force() -> Vector3<f64> {
    Vector3::new(0.3, -1.0, 0.4).normalize() * (2000.0 * 2.0 * 0.2)
}

#[test]
fn carriages_bear_the_force_of_a_lathe_tool_by_the_work_of_each_coordinate() {
    let config = config("four-rod-lathe");
    let (subject, moment) = turning(&config);
    let weight = subject.judge(&Moment { rpm: None, ..moment }).unwrap();
    let judged = subject.judge(&moment).unwrap();
    close(judged.chip.unwrap(), 0.2, 1.0);
    close(judged.force, 800.0, 800.0);
    let force: Vec<f64> =
        judged.drives.iter().zip(&weight.drives).map(|(all, own)| all[0] - own[0]).collect();
    // The force of one edge does not vary within a turn.
    assert!(judged.drives.iter().all(|[low, high]| low == high));
    let joints = |k: usize, by: f64| {
        let mut pose = moment.poses[1];
        pose[k] += by;
        config.machine.inverse(&Pose::from_degrees(pose), &moment.tool).unwrap()
    };
    for (k, along) in [(0, 0), (1, 1), (2, 2), (4, 3)] {
        // A small motion of one coordinate: f dq + F dx = 0. A turn about the tip moves no force.
        let (ahead, behind) = (joints(k, 1e-3), joints(k, -1e-3));
        let rates = (0..4).map(|i| (ahead[i] - behind[i]) / 2e-3);
        let work: f64 = rates.zip(&force).map(|(rate, force)| rate * force).sum();
        let of_edge = if along < 3 { edge_force()[along] } else { 0.0 };
        // Central differences: rounding of a meter, 1e-13 mm, over 2e-3 mm, and a third derivative of 1e-5 per mm².
        assert!((work + of_edge).abs() < 1e-6 * 800.0, "{k}: {work} {of_edge}");
    }
}

#[test]
fn the_rods_store_the_work_of_a_lathe_tool() {
    let config = config("four-rod-lathe");
    let (subject, moment) = turning(&config);
    let weight = subject.judge(&Moment { rpm: None, ..moment }).unwrap();
    let judged = subject.judge(&moment).unwrap();
    let at = config.machine.at(&Pose::from_degrees(moment.poses[1]), &moment.tool).unwrap();
    // A carriage on a rail along Z bears the rod's force times the cosine between them.
    let stored = |(i, segment): (usize, &kinematics::Segment)| {
        let drive = judged.drives[i][0] - weight.drives[i][0];
        (drive / segment.span().normalize().z).powi(2) / 60e3
    };
    let stored: f64 = at.segments().iter().take(4).enumerate().map(stored).sum();
    close(edge_force().dot(&judged.deflection), stored, stored);
    assert!(stored > 1.0, "{stored}");
}

#[test]
fn where_an_axis_carries_the_tool_the_legs_bear_it_as_one_fixed_to_the_platform() {
    let config = config("lathe-two-turrets");
    let tool = config.spindle + Vector3::new(190.0, -100.0, 0.0);
    let (a, b) = (-35.0, 8.0);
    let extra = config.extra_axes.places().map(|place| if place == 3 { a } else { 20.0 });
    let mut values = [0.0; kinematics::MAX_EXTRA];
    values.iter_mut().zip(extra).for_each(|(value, given)| *value = given);
    let pose = [200.0, 450.0, 1010.0, 0.0, b, 0.0];
    let world = config.world(&pose, &values);
    let found = Stance::at(&config, &pose, &world, &tool).unwrap();
    // The tool as the turret has turned it about its axis at X -60 of the platform.
    let (s, c) = f64::to_radians(a).sin_cos();
    let turn = Matrix3::new(c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c);
    let pivot = Vector3::new(-60.0, 0.0, 0.0);
    let turned = -(pivot + turn * (-tool - pivot));
    assert!((found.tool - turned).norm() < 1e-9, "{} {turned}", found.tool);
    // The tip stays where the program puts it, and the carriages where the chain puts them.
    let own = Pose::from_degrees(found.pose);
    let tip = own.position - found.tool;
    assert!((tip - (Vector3::new(pose[0], pose[1], pose[2]) - tool)).norm() < 1e-9);
    let machine = Pose::from_degrees(config.carried(&pose, &values, &tool).unwrap());
    let expected = config.machine.inverse(&machine, &Vector3::zeros()).unwrap();
    let joints = config.machine.inverse(&own, &found.tool).unwrap();
    // Rounding of some additions of a meter.
    assert!((0..4).all(|i| (joints[i] - expected[i]).abs() < 1e-9), "{joints:?} {expected:?}");
    let (sin, cos) = f64::to_radians(a + b).sin_cos();
    let rotation = Matrix3::new(cos, 0.0, sin, 0.0, 1.0, 0.0, -sin, 0.0, cos);
    assert!((found.rotation - rotation).norm() < 1e-12 && found.work == Matrix3::identity());
    // Another pose of the platform with the same tool has its own carriages.
    let shifted = [pose[0] + 3.0, pose[1], pose[2] - 2.0, 0.0, b - 1.0, 0.0];
    values[config.extra_axes.places().position(|place| place == 3).unwrap()] = a + 2.0;
    let world = config.world(&shifted, &values);
    let other = Stance::at(&config, &shifted, &world, &tool).unwrap().with_tool_of(&found);
    let machine = Pose::from_degrees(config.carried(&shifted, &values, &tool).unwrap());
    let expected = config.machine.inverse(&machine, &Vector3::zeros()).unwrap();
    let joints = config.machine.inverse(&Pose::from_degrees(other.pose), &found.tool).unwrap();
    assert!((0..4).all(|i| (joints[i] - expected[i]).abs() < 1e-9), "{joints:?} {expected:?}");
}

/// The joints are those of the chain, though the platform turns with its position.
#[test]
fn a_wrist_beside_constraints_is_a_tool_fixed_to_the_platform() {
    let file = shipped::root().join("tests/cases/ini/constraints/tricept-wrist.ini");
    let config = shipped::first_of(&file);
    let tool = config.spindle + Vector3::new(3.0, -2.0, 60.0);
    let mut rng = Pcg64::seed_from_u64(7);
    let mut drawn = || {
        let pose = [
            rng.random_range(-100.0..100.0),
            rng.random_range(-100.0..100.0),
            rng.random_range(-950.0..-880.0),
            0.0,
            0.0,
            0.0,
        ];
        let mut values = [0.0; MAX_EXTRA];
        values[..2].iter_mut().for_each(|value| *value = rng.random_range(-30.0..30.0));
        (pose, values)
    };
    let stance = |(pose, values): &([f64; 6], [f64; MAX_EXTRA])| {
        Stance::at(&config, pose, &config.world(pose, values), &tool).unwrap()
    };
    let of_chain = |(pose, values): &([f64; 6], [f64; MAX_EXTRA])| {
        let machine = Pose::from_degrees(config.carried(pose, values, &tool).unwrap());
        config.machine.inverse(&machine, &Vector3::zeros()).unwrap()
    };
    let joints = |found: &Stance, tool: &Vector3<f64>| {
        config.machine.inverse(&Pose::from_degrees(found.pose), tool).unwrap()
    };
    // Where the dependent coordinates stop: 1e-9 of a meter.
    let same = |one: &Joints, other: &Joints| (0..3).all(|i| (one[i] - other[i]).abs() < 1e-6);
    for _ in 0..50 {
        let (from, to) = (drawn(), drawn());
        let (found, other) = (stance(&from), stance(&to));
        assert!(same(&joints(&found, &found.tool), &of_chain(&from)), "{from:?}");
        let own = Pose::from_degrees(found.pose);
        let tip = Vector3::new(from.0[0], from.0[1], from.0[2]) - tool;
        assert!((own.position - found.tool - tip).norm() < 1e-9, "{from:?}");
        // Where the tool points: turned by A, by C, and by the platform.
        let world = config.world(&from.0, &from.1);
        let turn = |axis, k: usize| Rotation3::from_axis_angle(&axis, world[k].to_radians());
        let platform = config.machine.full_pose(&own, &found.tool).unwrap().rotation();
        let turned = platform * turn(Vector3::z_axis(), 5) * turn(Vector3::x_axis(), 3);
        assert!((found.rotation - turned).norm() < 1e-9, "{from:?}");
        // The other position of the platform, with the tool of the first.
        let moved = other.with_tool_of(&found);
        assert!(same(&joints(&moved, &found.tool), &of_chain(&to)), "{to:?}");
    }
}

#[test]
fn where_an_axis_carries_the_work_the_feed_turns_with_it() {
    let config = config("hexapod-rotary-table");
    let pose = config.start;
    let mut values = [0.0; kinematics::MAX_EXTRA];
    values[0] = 90.0;
    let found = Stance::at(&config, &pose, &config.world(&pose, &values), &config.spindle).unwrap();
    assert!((found.work * Vector3::x() - Vector3::y()).norm() < 1e-12, "{}", found.work);
    assert!(stance::check(&config).is_ok());
    let refused = stance::check(&self::config("lathe-work-on-platform")).unwrap_err().to_string();
    assert!(
        refused.contains("not judged") && refused.contains("lathe-work-on-platform"),
        "{refused}"
    );
}

/// Of a window with an acceleration along X and a later one about A, the one nearer to its own limit is assessed.
#[test]
fn lengths_and_angles_of_a_window_are_compared_by_their_own_limits() {
    let lines = BTreeMap::from([(7, Line { feed: 1000.0, rpm: 6000.0 })]);
    for (limits, is_later) in [([1.0, 100.0], false), ([100.0, 1.0], true)] {
        let mut config = config("hexapod");
        Arc::make_mut(&mut config.facts).max_acceleration = limits;
        let subject = subject(&config, STUDY);
        let mut pass = Pass::new(&subject, &lines);
        for k in 0..9 {
            let mut row = row(k, 0.01 * k as f64 + if k < 3 { 0.0 } else { 1e-3 });
            row.pose[2] = 300.0;
            row.pose[3] = if k < 7 { 0.0 } else { 2e-3 };
            pass.see(&row).unwrap();
        }
        let found = pass.finish().unwrap();
        assert_eq!(found.judged, 1);
        let judged = &found.peaks[3].as_ref().unwrap().judged;
        assert_eq!(judged.pose[0] > 0.04, is_later, "{limits:?}");
    }
}

/// The feed per tooth divides by the spindle speed.
#[test]
fn a_spindle_that_turns_at_no_speed_cuts_nothing() {
    let step = |x: f64, spindle: Spindle| Move {
        kind: MoveKind::Feed,
        line: 3,
        end: [x, 0.0, 0.0, 0.0, 0.0, 0.0],
        feed: 10.0,
        angular_feed: f64::INFINITY,
        tool: [0.0; 3],
        file: 0,
        extra: false,
        lasts: None,
        second: None,
        extra_end: [0.0; MAX_EXTRA],
        spindle,
        is_per_turn: false,
    };
    let found = |spindle: Spindle| lines(&[step(0.0, spindle), step(9.0, spindle)]);
    assert_eq!(found(Spindle::Turning(0.0)), Err(NoCut::NoSpeed(3)));
    assert_eq!(found(Spindle::Standing(0.0)), Err(NoCut::NoSpeed(3)));
    assert_eq!(found(Spindle::Standing(900.0)), Err(NoCut::Standing(3)));
    assert_eq!(found(Spindle::Turning(900.0)).unwrap()[&3], Line { feed: 10.0, rpm: 900.0 });
}
