// SPDX-License-Identifier: GPL-2.0-or-later
//! The start without a seed: the search for the pose of the joints alone in the boxes of the
//! shipped tripod.

use abi_tests::module::{Joints, Module, Pose};

const SEARCHING: i32 = -100;
const OUTSIDE_BOXES: i32 = -101;
const TWO_POSES: i32 = -102;
const BOX_INVALID: f64 = -103.0;
const BOX_OF_OTHER: f64 = -104.0;

const HOME: Pose = [5.0, 1.768, 3.06, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

/// Inches: the solver stops at 1e-12 of 10 inches, and rounding of the joints adds as much.
const SAME: f64 = 1e-10;

/// Returns the numbers of a key of the shipped tripod.
fn numbers(section: &str, key: &str) -> Vec<f64> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../configs/tripod/tripod.ini");
    let text = std::fs::read_to_string(file).expect("readable");
    let mut lines = text.lines().skip_while(|line| *line != format!("[{section}]"));
    let line = lines.find_map(|line| line.strip_prefix(&format!("{key} = "))).expect(key);
    line.split(' ').map(number).collect()
}

/// Parses a number of an INI file; the hash of a geometry is hexadecimal.
fn number(word: &str) -> f64 {
    match word.strip_prefix("0x") {
        Some(digits) => f64::from(u32::from_str_radix(digits, 16).expect("a hash")),
        None => word.parse().expect("a number"),
    }
}

/// Returns a tripod with this number of boxes, with its geometry on its pins.
fn tripod(boxes: usize) -> Module {
    let count = boxes.to_string();
    let parameters = [("legs", "strut:3"), ("coordinates", "XYZ"), ("boxes", count.as_str())];
    let module = Module::pkmkins(&parameters);
    for n in 0..3 {
        for (pin, key) in [("base", "BASE"), ("platform", "PLATFORM")] {
            for (axis, value) in ["x", "y", "z"].iter().zip(numbers(&format!("LEG_{n}"), key)) {
                module.set(&format!("{pin}.{n}.{axis}"), value);
            }
        }
    }
    for (axis, value) in ["x", "y", "z", "a", "b", "c"].iter().zip(HOME) {
        module.set(&format!("home.{axis}"), value);
    }
    module
}

/// Sets the shipped box on the pins of box `k`; `mirrored`: below the base.
fn wire_box(module: &Module, k: usize, mirrored: bool) {
    let sign = if mirrored { -1.0 } else { 1.0 };
    let (low, high) = (numbers("BOX_0", "LOW"), numbers("BOX_0", "HIGH"));
    for (i, axis) in ["x", "y", "z", "a", "b", "c"].iter().enumerate() {
        let (mut low, mut high) = (low[i], high[i]);
        if i == 2 && mirrored {
            (low, high) = (-high, -low);
        }
        module.set(&format!("box.{k}.low.{axis}"), low);
        module.set(&format!("box.{k}.high.{axis}"), high);
    }
    for axis in ["x", "y", "z"] {
        let factor = if axis == "z" { sign } else { 1.0 };
        let row = numbers("BOX_0", &format!("ROW_{}", axis.to_uppercase()));
        for (n, value) in row.iter().enumerate() {
            module.set(&format!("box.{k}.matrix.{axis}.{n}"), factor * value);
        }
    }
    module.set(&format!("box.{k}.steps"), numbers("BOX_0", "STEPS")[0]);
    module.set(&format!("box.{k}.geometry"), numbers("BOX_0", "GEOMETRY")[0]);
}

/// With a matrix this small a box needs some thousand steps, which takes several calls.
const SLOW: f64 = 0.005;

/// Returns an applied module with the shipped box twice and too short steps.
fn slowly_started() -> Module {
    let module = tripod(2);
    for k in 0..2 {
        wire_box(&module, k, false);
        for axis in ["x", "y", "z"] {
            for n in 0..3 {
                let pin = format!("box.{k}.matrix.{axis}.{n}");
                module.set(&pin, SLOW * module.get(&pin));
            }
        }
        module.set(&format!("box.{k}.steps"), 4096.0);
    }
    before_homing(module)
}

/// Returns an applied module with these boxes.
fn started(mirrored: &[bool]) -> Module {
    let module = tripod(mirrored.len());
    for (k, mirrored) in mirrored.iter().enumerate() {
        wire_box(&module, k, *mirrored);
    }
    before_homing(module)
}

/// Calls an applied module as LinuxCNC does before homing.
fn before_homing(module: Module) -> Module {
    module.apply();
    assert!(module.is_on("geometry-ok"), "{:?}", module.messages());
    for _ in 0..3 {
        let mut world = [0.0; 9];
        assert!(module.forward_into(&[0.0; 16], &mut world) < 0);
        module.monitor();
    }
    assert_eq!(module.get("fault"), 0.0);
    assert!(!(module.has("searching") && module.is_on("searching")));
    module
}

fn far_pose() -> Pose {
    [3.6, 2.9, 2.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}

fn assert_same(found: &Pose, expected: &Pose) {
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() < SAME, "{found:?} {expected:?}");
    }
}

/// Runs one cycle: feedback, monitor. LinuxCNC passes home while it has no pose.
fn cycle(module: &Module, joints: &Joints, world: &mut Pose) -> i32 {
    if world.iter().any(|v| v.is_nan()) {
        *world = HOME;
    }
    let code = module.forward_into(joints, world);
    module.monitor();
    code
}

#[test]
fn the_pose_is_found_at_the_first_call() {
    let module = started(&[false]);
    let joints = module.inverse(&far_pose()).unwrap();
    let mut world = HOME;
    assert_eq!(cycle(&module, &joints, &mut world), 0);
    assert_same(&world, &far_pose());
    assert!(!module.is_on("searching"));
    // The command's call has home as its seed, and gets the pose.
    let mut command = HOME;
    assert_eq!(module.forward_into(&joints, &mut command), 0);
    assert_same(&command, &far_pose());
}

#[test]
fn a_search_of_several_cycles_gives_no_pose_meanwhile_and_is_no_fault() {
    let module = slowly_started();
    let joints = module.inverse(&far_pose()).unwrap();
    let mut world = HOME;
    let mut cycles = 0;
    while cycle(&module, &joints, &mut world) == SEARCHING {
        assert!(module.is_on("searching") && module.is_on("fwd-kins-fail"));
        assert!(world[0].is_nan());
        assert_eq!((module.get("fault"), module.get("fault-count")), (0.0, 0.0));
        cycles += 1;
    }
    // Two boxes of at most 4096 steps, 384 a cycle.
    assert!((2..22).contains(&cycles), "{cycles} cycles");
    assert!(!module.is_on("searching") && !module.is_on("fwd-kins-fail"));
    assert_same(&world, &far_pose());
    assert!(module.messages().is_empty(), "{:?}", module.messages());
}

#[test]
fn after_homing_again_the_pose_is_searched_for_again() {
    let module = slowly_started();
    let joints = module.inverse(&far_pose()).unwrap();
    let mut world = HOME;
    while cycle(&module, &joints, &mut world) == SEARCHING {}
    // A call in every cycle: no search.
    for _ in 0..5 {
        assert_eq!(cycle(&module, &joints, &mut world), 0);
    }
    // A joint is unhomed: no call.
    for _ in 0..3 {
        module.monitor();
    }
    let elsewhere = [6.4, 0.6, 3.9, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let joints = module.inverse(&elsewhere).unwrap();
    let mut world = HOME;
    assert_eq!(cycle(&module, &joints, &mut world), SEARCHING);
    while cycle(&module, &joints, &mut world) == SEARCHING {}
    assert_same(&world, &elsewhere);
}

#[test]
fn joints_outside_all_boxes_or_of_two_poses_are_refused_with_their_code() {
    let module = started(&[false]);
    let outside = [5.0, 1.768, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let joints = module.inverse(&outside).unwrap();
    let mut world = HOME;
    assert_eq!(cycle(&module, &joints, &mut world), OUTSIDE_BOXES);
    assert!(world[0].is_nan());
    assert_eq!(module.get("fault"), f64::from(OUTSIDE_BOXES));
    // The joints return into the box.
    let joints = module.inverse(&far_pose()).unwrap();
    assert_eq!(cycle(&module, &joints, &mut world), 0);
    assert_same(&world, &far_pose());

    let module = started(&[false, true]);
    let mut world = HOME;
    assert_eq!(cycle(&module, &joints, &mut world), TWO_POSES);
    assert!(world[0].is_nan());
}

#[test]
fn boxes_of_another_geometry_and_boxes_without_sense_are_refused_at_apply() {
    let refused = |change: &dyn Fn(&Module)| {
        let module = tripod(1);
        wire_box(&module, 0, false);
        change(&module);
        module.apply();
        assert!(!module.is_on("geometry-ok"));
        module.get("fault")
    };
    assert_eq!(refused(&|m| m.set("platform.1.x", 0.5)), BOX_OF_OTHER);
    for (pin, value) in [
        ("box.0.steps", 0.0),
        ("box.0.steps", 4097.0),
        ("box.0.low.x", f64::NAN),
        ("box.0.high.y", f64::INFINITY),
        ("box.0.low.z", 5.0),
        ("box.0.matrix.x.2", f64::NAN),
    ] {
        assert_eq!(refused(&|m| m.set(pin, value)), BOX_INVALID, "{pin} {value}");
    }
}

#[test]
fn without_boxes_there_are_no_pins_for_them_and_home_is_where_forward_starts() {
    let module = tripod(0);
    assert!(!module.pins().iter().any(|pin| pin.name.starts_with("pkmkins.box.")));
    assert!(!module.has("searching"));
    module.apply();
    let joints = module.inverse(&far_pose()).unwrap();
    let mut world = HOME;
    assert_eq!(module.forward_into(&joints, &mut world), 0);
    assert_same(&world, &far_pose());
}

/// Below the base, at the other pose of the same joints.
const MIRRORED: Pose = [5.0, 1.768, -3.06, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

#[test]
fn three_legs_that_move_x_y_and_z_start_without_boxes_from_any_seed() {
    let module = before_homing(tripod(0));
    let joints = module.inverse(&far_pose()).unwrap();
    let mut world = MIRRORED;
    assert_eq!(module.forward_into(&joints, &mut world), 0);
    assert_same(&world, &far_pose());
    module.monitor();
    // A new caller has LinuxCNC's pose for it.
    let mut command = MIRRORED;
    assert_eq!(module.forward_into(&joints, &mut command), 0);
    assert_same(&command, &far_pose());
    // A joint is unhomed: no call; the joints may have been anywhere.
    for _ in 0..3 {
        module.monitor();
    }
    let elsewhere = [6.4, 0.6, 3.9, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let joints = module.inverse(&elsewhere).unwrap();
    let mut world = MIRRORED;
    assert_eq!(module.forward_into(&joints, &mut world), 0);
    assert_same(&world, &elsewhere);
}

#[test]
fn without_a_reference_pose_the_seed_decides_on_which_side_of_the_base_the_tripod_is() {
    let module = tripod(0);
    for axis in ["x", "y", "z", "a", "b", "c"] {
        module.set(&format!("home.{axis}"), f64::NAN);
    }
    let module = before_homing(module);
    let joints = module.inverse(&HOME).unwrap();
    let mut world = MIRRORED;
    assert_eq!(module.forward_into(&joints, &mut world), 0);
    assert_same(&world, &MIRRORED);
}

#[test]
fn nan_joints_are_refused_with_their_code() {
    let module = slowly_started();
    // -20: a joint value is NaN.
    assert_eq!(cycle(&module, &[f64::NAN; 16], &mut HOME.clone()), -20);
    assert!(!module.is_on("searching"));
}
