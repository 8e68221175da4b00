// SPDX-License-Identifier: GPL-2.0-or-later
//! When the geometry on the pins becomes the geometry of the joints, and when it does not.

use abi_tests::control::{Control, controls, in_a_chain};
use abi_tests::machines::{Hexapod, PAPER_004_HOME, paper_004};
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::stub::PinDir;
use abi_tests::subjects::Subject;
use abi_tests::tolerances::{SAME_COMPONENT, SAME_JOINT_MM};
use kinematics::Cause;

const TILTED: Pose = [-80.0, 60.0, 350.0, 10.0, -20.0, 0.0, 0.0, 0.0, 0.0];

fn joints(module: &Module) -> Joints {
    module.inverse(&TILTED).expect("a pose of the workspace")
}

/// Returns a module set up by a HAL file without `.apply`.
fn dropped_in(machine: &Hexapod) -> Module {
    let module = Module::pkmkins(&[]);
    machine.wire(&module);
    module
}

fn fault(module: &Module) -> i32 {
    module.get("fault") as i32
}

#[test]
fn nothing_is_frozen_before_the_first_call() {
    let module = Module::pkmkins(&[]);
    paper_004().wire(&module);
    module.monitor();
    assert!(!module.is_on("geometry-ok"));
    assert_eq!(module.get("geometry-hash"), 0.0);
}

#[test]
fn a_rising_edge_of_apply_freezes_the_pins() {
    let module = paper_004().module();
    assert!(module.is_on("geometry-ok"));
    assert!(!module.is_on("geometry-changed"));
    assert_ne!(module.get("geometry-hash"), 0.0);
}

#[test]
fn the_first_inverse_call_freezes_a_drop_in_hal_file() {
    let module = dropped_in(&paper_004());
    let before = joints(&module);
    assert!(module.is_on("geometry-ok"));
    module.set("base.2.x", 0.0);
    assert_eq!(joints(&module), before, "frozen by the first call");
}

#[test]
fn the_first_forward_call_freezes_a_drop_in_hal_file() {
    let reference = paper_004().module().inverse(&TILTED).expect("a pose of the workspace");
    let module = dropped_in(&paper_004());
    let pose = module.follow(&reference, &PAPER_004_HOME).expect("joints of the workspace");
    assert!((pose[0] - TILTED[0]).abs() < SAME_COMPONENT, "{pose:?}");
}

/// Rotated so far that the arcsin of every strut has folded.
const TURNED: Pose = [0.0, 0.0, 300.0, 0.0, 0.0, 120.0, 0.0, 0.0, 0.0];

#[test]
fn the_first_pose_known_is_the_reference_of_a_drop_in_and_inverse_alone_never_decides() {
    let reference = paper_004().module().inverse(&TURNED).expect("a pose");
    let machine = Hexapod { home: None, ..paper_004() };
    for seed in [PAPER_004_HOME, [0.0; 9]] {
        let module = dropped_in(&machine);
        let literal = module.inverse(&TURNED).expect("a pose");
        let home = module.inverse(&PAPER_004_HOME).expect("home");
        assert_eq!(module.inverse(&TURNED), Ok(literal));
        assert!((0..6).all(|n| (literal[n] - reference[n]).abs() > SAME_JOINT_MM));
        let mut elsewhere = home;
        elsewhere[0] += 1e6;
        assert!(module.follow(&elsewhere, &seed).is_err());
        assert_eq!(module.inverse(&TURNED), Ok(literal), "no pose is known yet");
        module.follow(&home, &seed).expect("home");
        let folded = module.inverse(&TURNED).expect("a pose");
        assert!((0..6).all(|n| (folded[n] - reference[n]).abs() < SAME_JOINT_MM), "{folded:?}");
        module.forward(&reference, &TURNED).expect("its own joints");
        assert_eq!(module.inverse(&TURNED), Ok(folded), "decided once");
        assert!(module.messages().is_empty(), "{:?}", module.messages());
    }
}

#[test]
fn drop_in_and_applied_geometry_give_the_same_joints_and_hash() {
    let (applied, dropped) = (paper_004().module(), dropped_in(&paper_004()));
    assert_eq!(joints(&applied), joints(&dropped));
    assert_eq!(applied.get("geometry-hash"), dropped.get("geometry-hash"));
}

#[test]
fn pins_changed_after_freezing_are_shown_and_change_no_joint() {
    for on in [0.0, 1.0] {
        let module = paper_004().module();
        module.set("machine-on", on);
        change_each_pin_and_back(&module);
    }
}

/// Pins of the geometry of a module.
fn of_geometry(module: &Module) -> Vec<String> {
    // Excluded: limits of the guard, and inputs whose effect another pin shows.
    let others = ["axis-max-velocity", "rod-clearance", "base-cone", "base-pyramid"];
    let others = |name: &str| {
        name.starts_with("platform-cone")
            || name.starts_with("platform-pyramid")
            || others.iter().any(|other| name.starts_with(other))
    };
    let stems = [
        "base",
        "platform",
        "lead",
        "offset",
        "guide",
        "axis",
        "arm",
        "rod",
        "side",
        "effector",
        "centre",
        "home",
        "spindle-offset",
        "chain",
        "work-on-platform",
    ];
    let is_own = |name: &str| {
        let name = name.trim_start_matches("second.");
        stems.iter().any(|stem| name.starts_with(stem)) && !others(name)
    };
    let all = module.pins().into_iter().filter(|pin| pin.dir == PinDir::In);
    let names = all.map(|pin| pin.name.trim_start_matches("pkmkins.").to_string());
    names.filter(|name| is_own(name)).collect()
}

/// Machines of every kind, one of them with the work on its platform.
fn all_machines() -> Vec<Control> {
    let mut all = controls();
    let Control::Carrying(subject, mut carrying) = in_a_chain() else { unreachable!("a chain") };
    // The reference pose on the pins is LinuxCNC's: the holder's point seen from the platform's.
    carrying.given.holder = Some([10.0, 20.0, 500.0]);
    carrying.machine.home = Some([10.0, 20.0, 250.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let subject = Subject { machine: carrying.machine.clone(), ..subject };
    all.push(Control::Carrying(subject, carrying));
    all
}

#[test]
fn every_pin_of_the_geometry_shows_a_change_and_those_of_the_legs_give_another_hash() {
    for control in all_machines() {
        let module = control.module();
        let hashes = |module: &Module| {
            let second = module.has("second.geometry-hash");
            let of = |pin: &str| module.get(pin);
            (of("geometry-hash"), if second { of("second.geometry-hash") } else { 0.0 })
        };
        let before = hashes(&module);
        let mut others = 0;
        let pins = of_geometry(&module);
        for pin in &pins {
            let what = format!("{} of {}", pin, control.name());
            let value = module.get(pin);
            // A small change, so that most geometries stay valid. A side and a carried part are whole numbers.
            let is_whole = ["side", "carries"].iter().any(|name| pin.contains(name));
            let change = if is_whole { 1.0 } else { 1e-4 * control.size() };
            module.set(pin, if value.is_nan() { 1.0 } else { value + change });
            module.monitor_until_all_is_shown();
            assert!(module.is_on("geometry-changed"), "{what}");
            assert_eq!(hashes(&module), before, "{what}: not applied yet");
            module.apply();
            // Offsets move no leg, and axes of cardan joints only one with a lead.
            let has_effect = !["offset", "-n."].iter().any(|name| pin.contains(name));
            if module.is_on("geometry-ok") && has_effect {
                assert_ne!(hashes(&module), before, "{what}");
                others += 1;
            }
            module.set(pin, value);
            module.apply();
            assert!(!module.is_on("geometry-changed"), "{what} set back");
            assert_eq!(hashes(&module), before, "{what} set back");
        }
        assert!(3 * others > pins.len(), "{}: {others} of {}", control.name(), pins.len());
    }
}

fn change_each_pin_and_back(module: &Module) {
    let before = joints(module);
    for pin in [
        "base.0.x",
        "platform.3.y",
        "base-n.1.z",
        "platform-n.5.x",
        "lead.4",
        "offset.2",
        "home.a",
        "spindle-offset",
    ] {
        let value = module.get(pin);
        module.set(pin, value + 1.0);
        module.monitor_until_all_is_shown();
        assert!(module.is_on("geometry-changed"), "{pin}");
        assert_eq!(joints(module), before, "{pin}");
        module.set(pin, value);
        module.monitor_until_all_is_shown();
        assert!(!module.is_on("geometry-changed"), "{pin} set back");
    }
}

#[test]
fn apply_is_an_edge_and_not_a_level() {
    let module = paper_004().module();
    let before = joints(&module);
    module.set("offset.0", 5.0);
    for _ in 0..10 {
        module.monitor();
        assert_eq!(joints(&module), before);
    }
    module.apply();
    assert_eq!(joints(&module)[0], before[0] - 5.0);
}

#[test]
fn an_apply_edge_is_seen_without_the_monitor_too() {
    let module = dropped_in(&paper_004());
    let before = joints(&module);
    module.set("offset.0", 5.0);
    module.set("apply", 1.0);
    let after = joints(&module);
    assert_eq!(after[0], before[0] - 5.0);
    assert_eq!(after[1..], before[1..]);
}

#[test]
fn a_machine_that_is_on_keeps_its_geometry_despite_apply() {
    let bad = |module: &Module| module.set("platform.1.z", f64::NAN);
    let good = |module: &Module| module.set("platform.1.z", 151.0);
    for change in [&bad as &dyn Fn(&Module), &good] {
        let module = paper_004().module();
        let (before, hash) = (joints(&module), module.get("geometry-hash"));
        module.set("machine-on", 1.0);
        change(&module);
        module.apply();
        assert_eq!(fault(&module), Cause::ApplyWhileOn.code());
        assert_eq!(joints(&module), before);
        assert_eq!(module.get("geometry-hash"), hash);
        module.set("machine-on", 0.0);
        module.monitor();
        assert_eq!(joints(&module), before, "the refused edge is not remembered");
    }
}

#[test]
fn switching_off_and_applying_again_takes_the_new_geometry() {
    let module = paper_004().module();
    module.set("machine-on", 1.0);
    module.set("offset.3", 1.0);
    module.apply();
    let refused = joints(&module);
    module.set("machine-on", 0.0);
    module.apply();
    assert_eq!(joints(&module)[3], refused[3] - 1.0);
    assert!(module.is_on("geometry-ok"));
}

#[test]
fn bad_geometry_is_refused_by_leg_and_the_last_good_one_stays() {
    type Change = (&'static str, &'static [(&'static str, f64)], Cause, Option<u32>);
    let cases: &[Change] = &[
        ("NaN anchor", &[("base.3.y", f64::NAN)], Cause::GeometryNotFinite, Some(3)),
        ("infinite anchor", &[("platform.5.x", f64::INFINITY)], Cause::GeometryNotFinite, Some(5)),
        ("NaN axis", &[("base-n.2.z", f64::NAN)], Cause::GeometryNotFinite, Some(2)),
        ("NaN lead", &[("lead.4", f64::NAN)], Cause::GeometryNotFinite, Some(4)),
        (
            "zero axis",
            &[("base-n.1.x", 0.0), ("base-n.1.y", 0.0), ("base-n.1.z", 0.0)],
            Cause::AxisZero,
            Some(1),
        ),
        ("NaN spindle", &[("spindle-offset", f64::NAN)], Cause::ToolNotFinite, None),
        ("incomplete home", &[("home.z", f64::NAN)], Cause::HomeNotFinite, None),
        ("infinite home", &[("home.b", f64::INFINITY)], Cause::HomeNotFinite, None),
    ];
    for (what, pins, cause, leg) in cases {
        let module = paper_004().module();
        let (before, hash) = (joints(&module), module.get("geometry-hash"));
        module.clear_messages();
        for (pin, value) in *pins {
            module.set(pin, *value);
        }
        module.apply();
        assert_refused(&module, what, *cause, *leg);
        assert_eq!(joints(&module), before, "{what}");
        assert_eq!(module.get("geometry-hash"), hash, "{what}");
    }
}

fn assert_refused(module: &Module, what: &str, cause: Cause, leg: Option<u32>) {
    assert!(!module.is_on("geometry-ok"), "{what}");
    assert_eq!(fault(module), cause.code(), "{what}");
    let said: String = module.messages().into_iter().map(|m| m.text).collect();
    assert!(said.contains(cause.text()), "{what}: '{said}'");
    if let Some(leg) = leg {
        assert_eq!(module.get("fault-leg"), f64::from(leg), "{what}");
        let named = [format!("leg {leg}:"), format!("legs {leg} and ")];
        assert!(named.iter().any(|name| said.contains(name)), "{what}: '{said}'");
    }
}

#[test]
fn a_message_of_a_refused_geometry_comes_once() {
    let module = paper_004().module();
    module.clear_messages();
    module.set("base.3.y", f64::NAN);
    module.apply();
    for _ in 0..10 {
        module.monitor();
    }
    assert_eq!(module.messages().len(), 1, "{:?}", module.messages());
    assert_eq!(module.messages()[0].level, 1, "an error, so that the operator sees it");
}

#[test]
fn two_legs_between_the_same_points_are_refused() {
    let module = paper_004().module();
    let before = joints(&module);
    let mut machine = paper_004();
    machine.base[4] = machine.base[2];
    machine.platform[4] = machine.platform[2];
    machine.wire(&module);
    module.apply();
    assert_eq!(fault(&module), Cause::LegsCoincide.code());
    assert!(!module.is_on("geometry-ok"));
    assert_eq!(joints(&module), before);
}

#[test]
fn a_layout_that_is_singular_at_home_is_refused() {
    let module = Module::pkmkins(&[]);
    let mut machine = paper_004();
    machine.lead = 0.0;
    // Struts that all intersect the axis: rotation about it is free.
    for leg in 0..6 {
        let at = (60.0 * leg as f64).to_radians();
        machine.base[leg] = [560.0 * at.cos(), 560.0 * at.sin(), 1250.0];
        machine.platform[leg] = [200.0 * at.cos(), 200.0 * at.sin(), 150.0];
    }
    machine.wire(&module);
    module.apply();
    assert_eq!(fault(&module), Cause::SingularAtHome.code());
}

#[test]
fn a_strut_of_no_length_at_home_is_refused() {
    let module = Module::pkmkins(&[]);
    let mut machine = paper_004();
    machine.lead = 0.0;
    machine.base[3] = machine.platform[3];
    machine.base[3][2] += PAPER_004_HOME[2];
    machine.wire(&module);
    module.apply();
    assert_refused(&module, "zero strut", Cause::StrutZeroAtHome, Some(3));
}

#[test]
fn platform_anchors_on_one_line_are_refused() {
    let module = Module::pkmkins(&[]);
    let mut machine = paper_004();
    machine.lead = 0.0;
    for (leg, anchor) in machine.platform.iter_mut().enumerate() {
        *anchor = [50.0 * leg as f64, 0.0, 150.0];
    }
    machine.wire(&module);
    module.apply();
    assert!(!module.is_on("geometry-ok"));
    assert_eq!(fault(&module), Cause::PlatformDegenerate.code());
}

#[test]
fn a_fold_that_home_does_not_decide_is_refused() {
    let module = Module::pkmkins(&[]);
    let mut machine = paper_004();
    // Both axes across the strut, a quarter turn apart about it.
    let strut = |k: usize| PAPER_004_HOME[k] + machine.platform[0][k] - machine.base[0][k];
    let n = abi_tests::geometry::unit([strut(0), strut(1), strut(2)]);
    machine.platform_axis[0] = abi_tests::geometry::cross(n, machine.base_axis[0]);
    machine.wire(&module);
    module.apply();
    assert_refused(&module, "quarter turn", Cause::FoldUndefined, Some(0));
}

#[test]
fn zero_axes_are_accepted_where_there_is_no_lead() {
    let mut machine = paper_004();
    machine.lead = 0.0;
    machine.base_axis = [[0.0; 3]; 6];
    machine.platform_axis = [[0.0; 3]; 6];
    let with_axes = Hexapod { lead: 0.0, ..paper_004() }.module();
    assert_eq!(joints(&machine.module()), joints(&with_axes));
}

#[test]
fn a_lead_of_one_leg_asks_for_the_axes_of_that_leg_only() {
    let mut machine = paper_004();
    machine.lead = 0.0;
    for leg in [0, 1, 3, 4, 5] {
        machine.base_axis[leg] = [0.0; 3];
    }
    let module = Module::pkmkins(&[]);
    machine.wire(&module);
    module.set("lead.2", 10.0);
    module.apply();
    assert!(module.is_on("geometry-ok"), "{:?}", module.messages());
    let (one, all) = (joints(&module), joints(&paper_004().module()));
    assert_eq!(one[2], all[2]);
    assert_ne!(one[0], all[0]);
}

#[test]
fn a_lead_of_a_leg_overrides_the_screw_lead_and_its_sign_is_the_hand() {
    let plain = joints(&Hexapod { lead: 0.0, ..paper_004() }.module());
    let right = joints(&paper_004().module());
    let module = Module::pkmkins(&[]);
    Hexapod { lead: 3.0, ..paper_004() }.wire(&module);
    module.set("lead.0", 10.0);
    module.set("lead.1", -10.0);
    module.apply();
    let mixed = joints(&module);
    assert_eq!(mixed[0], right[0]);
    let mirrored = plain[1] - (right[1] - plain[1]);
    assert!((mixed[1] - mirrored).abs() < SAME_JOINT_MM, "{} {mirrored}", mixed[1]);
    assert_ne!(mixed[2], right[2]);
}

#[test]
fn axes_that_are_not_unit_vectors_are_normalised() {
    let mut long = paper_004();
    for leg in 0..6 {
        long.base_axis[leg] = long.base_axis[leg].map(|v| 1024.0 * v);
        long.platform_axis[leg] = long.platform_axis[leg].map(|v| v / 1024.0);
    }
    let (long, unit) = (joints(&long.module()), joints(&paper_004().module()));
    for (one, other) in long.iter().zip(unit) {
        assert!((one - other).abs() < SAME_JOINT_MM, "{one} {other}");
    }
}

#[test]
fn the_hash_follows_geometry_and_nothing_else() {
    let module = paper_004().module();
    let hash = module.get("geometry-hash");
    let again = |pin: &str, value: f64| {
        let before = module.get(pin);
        module.set(pin, value);
        module.apply();
        let changed = module.get("geometry-hash");
        module.set(pin, before);
        module.apply();
        assert_eq!(module.get("geometry-hash"), hash, "{pin} set back");
        changed
    };
    for pin in ["base.0.x", "platform.5.z", "base-n.3.y", "lead.2", "home.z"] {
        assert_ne!(again(pin, module.get(pin) + 0.125), hash, "{pin}");
    }
    for pin in ["offset.1", "tool-offset", "spindle-offset", "convergence-criterion", "max-error"] {
        assert_eq!(again(pin, module.get(pin) + 0.125), hash, "{pin}");
    }
    assert_eq!(again("home.a", -0.0), hash, "minus zero is zero");
}

#[test]
fn a_bad_drop_in_geometry_answers_no_call() {
    let module = dropped_in(&paper_004());
    module.set("base.3.y", f64::NAN);
    let mut joints = [7.0; 16];
    assert!(module.inverse_into(&TILTED, &mut joints) < 0);
    assert_eq!(joints, [7.0; 16]);
    assert!(!module.is_on("geometry-ok"));
    let said: String = module.messages().into_iter().map(|m| m.text).collect();
    assert!(said.contains("leg 3"), "'{said}'");
}

#[test]
fn a_bad_drop_in_geometry_is_reported_once_and_not_in_every_cycle() {
    let module = dropped_in(&paper_004());
    module.set("base.3.y", f64::NAN);
    for _ in 0..1000 {
        assert!(module.inverse(&TILTED).is_err());
        assert!(module.follow(&[900.0; 16], &PAPER_004_HOME).is_err());
    }
    assert_eq!(module.messages().len(), 1, "{:?}", module.messages());
}

#[test]
fn a_drop_in_geometry_may_be_mended_before_it_is_frozen() {
    let module = dropped_in(&paper_004());
    module.set("base.3.y", f64::NAN);
    assert!(module.inverse(&TILTED).is_err());
    module.set("base.3.y", paper_004().base[3][1]);
    assert_eq!(joints(&module), joints(&paper_004().module()));
}

/// A HAL file written for genhexkins adds no function of a kinematics module to
/// a thread: one of 16 forward calls then updates the pins that the monitor updates otherwise.
#[test]
fn without_the_monitor_changed_pins_are_shown_by_forward() {
    let module = dropped_in(&paper_004());
    let at = joints(&module);
    module.follow(&at, &TILTED).expect("its own joints");
    assert!(!module.is_on("geometry-changed"));
    let is_shown_in_time = |changed: bool| {
        let mut calls = 0..16;
        calls.any(|_| {
            module.follow(&at, &TILTED).expect("its own joints");
            module.is_on("geometry-changed") == changed
        })
    };
    let before = module.get("platform.0.x");
    module.set("platform.0.x", before + 1.0);
    assert!(is_shown_in_time(true));
    module.set("platform.0.x", before);
    assert!(is_shown_in_time(false));
}

#[test]
fn once_apply_was_used_no_call_freezes_by_itself() {
    let module = dropped_in(&paper_004());
    module.set("base.3.y", f64::NAN);
    module.apply();
    module.set("base.3.y", paper_004().base[3][1]);
    assert_eq!(module.inverse(&TILTED), Err(Cause::NoGeometry.code()));
    module.set("apply", 0.0);
    module.monitor();
    assert_eq!(module.inverse(&TILTED), Err(Cause::NoGeometry.code()), "apply taken back");
    module.apply();
    joints(&module);
}
