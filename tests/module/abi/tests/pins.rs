// SPDX-License-Identifier: GPL-2.0-or-later
//! The pins that HAL files and users depend on.

use abi_tests::module::Module;
use abi_tests::stub::PinDir::{self, In, Out};
use abi_tests::stub::PinType::{self, Bit, Float, S32, U32};
use std::collections::BTreeMap;

type Kind = (PinType, PinDir);

/// The version of all crates as a number, which `hal/pkmkins.tcl` splits again.
const VERSION: f64 = {
    let [major, minor, patch] = [
        env!("CARGO_PKG_VERSION_MAJOR"),
        env!("CARGO_PKG_VERSION_MINOR"),
        env!("CARGO_PKG_VERSION_PATCH"),
    ];
    1e6 * number(major) + 1e3 * number(minor) + number(patch)
};

const fn number(text: &str) -> f64 {
    match u32::from_str_radix(text, 10) {
        Ok(number) => number as f64,
        Err(_) => panic!("a version is made of numbers"),
    }
}

/// Pins that exist once, with their initial values.
const SINGLE: &[(&str, PinType, PinDir, f64)] = &[
    ("screw-lead", Float, In, 0.0),
    ("spindle-offset", Float, In, 0.0),
    ("tool-offset", Float, In, 0.0),
    ("tool-offset-x", Float, In, 0.0),
    ("tool-offset-y", Float, In, 0.0),
    ("tool-offset-eff-x", Float, Out, 0.0),
    ("tool-offset-eff-y", Float, Out, 0.0),
    ("tool-offset-eff-z", Float, Out, 0.0),
    ("tool-busy", Bit, Out, 0.0),
    ("feed-inhibit", Bit, Out, 0.0),
    ("centre.x", Float, In, 0.0),
    ("centre.y", Float, In, 0.0),
    ("centre.z", Float, In, 0.0),
    ("convergence-criterion", Float, In, 1e-9),
    ("residual-limit", Float, In, 0.0),
    ("limit-iterations", U32, In, 120.0),
    ("max-error", Float, In, 500.0),
    ("last-iterations", U32, Out, 0.0),
    ("max-iterations", U32, Out, 0.0),
    ("fwd-kins-fail", Bit, Out, 0.0),
    ("geometry-ok", Bit, Out, 0.0),
    ("geometry-hash", U32, Out, 0.0),
    ("kinematics-hash", U32, Out, 0.0),
    ("geometry-changed", Bit, Out, 0.0),
    ("machine-on", Bit, In, 0.0),
    ("apply", Bit, In, 0.0),
    ("fault", S32, Out, 0.0),
    ("fault-leg", S32, Out, -1.0),
    ("fault-count", U32, Out, 0.0),
    ("fault-reset", Bit, In, 0.0),
    ("version", U32, Out, VERSION),
    ("residual", Float, Out, 0.0),
    ("assembly", S32, Out, 0.0),
    ("conditioning", Float, Out, 0.0),
    ("conditioning-limit", Float, In, 0.05),
    ("rod-distance", Float, Out, 1e99),
    ("rod-pair-a", S32, Out, -1.0),
    ("rod-pair-b", S32, Out, -1.0),
    ("rod-clearance", Float, In, 0.0),
    ("inverse-time", S32, Out, 0.0),
    ("forward-time", S32, Out, 0.0),
    ("feed-scale", Float, Out, 1.0),
    ("feed-floor", Float, In, 0.02),
    ("limit-soon", Bit, Out, 0.0),
    ("limit-leg", S32, Out, -1.0),
    ("limit-reason", S32, Out, 0.0),
    ("tilt-limit", Float, In, 0.0),
    ("max-override", Float, In, 1.0),
    ("linear-acceleration", Float, In, 1e99),
    ("angular-acceleration", Float, In, 1e99),
    ("requested-vel", Float, In, 0.0),
    ("current-vel", Float, In, 0.0),
    ("distance-to-go", Float, In, 1e99),
    ("jogging", Bit, In, 0.0),
    ("jog-stop", Bit, Out, 0.0),
    ("jog-scale", Float, Out, 1.0),
];

/// Pins of every LinuxCNC axis that the machine moves.
const JOGGED: &[(&str, PinDir)] = &[("axis-max-velocity", In), ("jog-velocity", Out)];

/// Pins of every leg for the motion guard, and of every joint.
const WATCHED_LEG: &[(&str, PinDir)] =
    &[("base-angle", Out), ("platform-angle", Out), ("base-cone", In), ("platform-cone", In)];
/// Limits of a leg in its cardan joints, about their fixed axis and across it.
const PYRAMIDS: [&str; 2] = ["base-pyramid", "platform-pyramid"];
const WATCHED_JOINT: &[&str] = &["margin", "speed-ratio"];

/// Pins of a leg of each kind: vectors, numbers (float in), and the rest.
const STRUT: OfKind = OfKind {
    vectors: &["base", "platform", "base-n", "platform-n"],
    numbers: &["offset", "lead"],
    others: &[("correction", Float, Out)],
    effector: &[],
};
const SLIDER: OfKind = OfKind {
    vectors: &["base", "platform", "guide"],
    numbers: &["offset", "rod"],
    others: &[("side", S32, In)],
    effector: &[],
};
const CRANK: OfKind = OfKind {
    vectors: &["base", "platform", "axis", "arm"],
    numbers: &["offset", "rod"],
    others: &[("side", S32, In)],
    effector: &[],
};

const RING: OfKind =
    OfKind { vectors: &["base"], numbers: &["offset"], others: &[], effector: &["r", "z"] };

#[derive(Clone, Copy)]
struct OfKind {
    vectors: &'static [&'static str],
    numbers: &'static [&'static str],
    others: &'static [(&'static str, PinType, PinDir)],
    effector: &'static [&'static str],
}

/// Corrections of a joint while the machine runs: none by default.
const CORRECTION: &[(&str, PinDir)] = &[
    ("joint-correction", In),
    ("correction-limit", In),
    ("correction-rate", In),
    ("joint-correction-eff", Out),
];

/// Limits of a joint; by default beyond any joint.
const LIMITS: &[(&str, f64)] = &[
    ("min-limit", -1e99),
    ("max-limit", 1e99),
    ("max-velocity", 1e99),
    ("max-acceleration", 1e99),
];

/// Returns name, type and direction of every pin of a machine with these legs.
fn expected(legs: &[OfKind], joints: usize, moved: &str) -> BTreeMap<String, Kind> {
    let mut pins: BTreeMap<String, Kind> = SINGLE
        .iter()
        .map(|(name, kind, dir, _)| (format!("pkmkins.{name}"), (*kind, *dir)))
        .collect();
    let mut add = |name: String, kind, dir| {
        assert!(pins.insert(name, (kind, dir)).is_none());
    };
    for (n, leg) in legs.iter().enumerate() {
        for (vector, axis) in leg.vectors.iter().flat_map(|v| ["x", "y", "z"].map(|a| (v, a))) {
            add(format!("pkmkins.{vector}.{n}.{axis}"), Float, In);
        }
        for number in leg.numbers {
            add(format!("pkmkins.{number}.{n}"), Float, In);
        }
        for (name, kind, dir) in leg.others {
            add(format!("pkmkins.{name}.{n}"), *kind, *dir);
        }
        for part in leg.effector {
            add(format!("pkmkins.effector.{n}.{part}"), Float, In);
        }
        for (name, dir) in WATCHED_LEG {
            add(format!("pkmkins.{name}.{n}"), Float, *dir);
        }
        for way in PYRAMIDS.iter().flat_map(|end| ["about", "across"].map(|way| (end, way))) {
            add(format!("pkmkins.{}.{n}.{}", way.0, way.1), Float, In);
        }
    }
    for n in 0..joints {
        for (limit, _) in LIMITS {
            add(format!("pkmkins.{limit}.{n}"), Float, In);
        }
        for (name, dir) in CORRECTION {
            add(format!("pkmkins.{name}.{n}"), Float, *dir);
        }
        for name in WATCHED_JOINT {
            add(format!("pkmkins.{name}.{n}"), Float, Out);
        }
    }
    for axis in ["x", "y", "z", "a", "b", "c"] {
        if ["x", "y", "z"].contains(&axis) {
            add(format!("pkmkins.work-on-platform.{axis}"), Float, In);
        }
        add(format!("pkmkins.home.{axis}"), Float, In);
        add(format!("pkmkins.{axis}"), Float, Out);
        add(format!("skgui.{axis}"), Float, Out);
    }
    for letter in moved.to_lowercase().chars() {
        for (name, dir) in JOGGED {
            add(format!("pkmkins.{name}.{letter}"), Float, *dir);
        }
    }
    for kind in 0..3 {
        add(format!("kinstype.is-{kind}"), Bit, Out);
    }
    pins
}

fn actual(module: &Module) -> BTreeMap<String, Kind> {
    module.pins().into_iter().map(|pin| (pin.name, (pin.kind, pin.dir))).collect()
}

fn assert_exactly(expected: &BTreeMap<String, Kind>, module: &Module, what: &str) {
    let actual = actual(module);
    let mut wrong = Vec::new();
    for (name, kind) in expected {
        match actual.get(name) {
            Some(found) if found == kind => {}
            found => wrong.push(format!("{name}: expected {kind:?}, found {found:?}")),
        }
    }
    for name in actual.keys().filter(|name| !expected.contains_key(*name)) {
        wrong.push(format!("{name}: {:?}, not in the manual", actual[name]));
    }
    assert!(wrong.is_empty(), "{what}\n{}", wrong.join("\n"));
}

#[test]
fn the_pins_of_a_hexapod_are_exactly_those_of_the_manual() {
    assert_exactly(&expected(&[STRUT; 6], 6, "XYZABC"), &Module::pkmkins(&[]), "hexapod");
}

#[test]
fn every_leg_has_the_pins_of_its_kind_and_every_joint_its_limits() {
    for (legs, coordinates, table, kinds, joints) in [
        ("strut:3", "XYZ", "", &[STRUT; 3][..], 3),
        ("slider:4", "XYZB", "", &[SLIDER; 4], 4),
        ("slider:4", "ZAB", "XY", &[SLIDER; 4], 6),
        ("crank:3", "XYZ", "", &[CRANK; 3], 3),
        ("crank:1,strut:2,slider:1", "XYZ", "", &[CRANK, STRUT, STRUT, SLIDER], 4),
        ("ring:5", "XYZAB", "", &[RING; 5], 5),
        ("strut:1,slider:5,crank:1,ring:1", "ABC", "XYZ", &ALL_KINDS, 11),
    ] {
        let parameters = [("legs", legs), ("coordinates", coordinates), ("table", table)];
        assert_exactly(
            &expected(kinds, joints, &format!("{coordinates}{table}")),
            &Module::pkmkins(&parameters),
            legs,
        );
    }
}

#[test]
fn a_machine_with_constraints_has_pins_for_them_and_for_its_dependent_coordinates() {
    for (legs, coordinates, table, kinds, dependent) in
        [("strut:3", "XYZ", "", [STRUT; 3], "abc"), ("slider:3", "ZAB", "XY", [SLIDER; 3], "xyc")]
    {
        let joints = 3 + table.len();
        let mut pins = expected(&kinds, joints, &format!("{coordinates}{table}"));
        for n in 0..3 {
            pins.insert(format!("pkmkins.constraint.{n}.kind"), (S32, In));
            for vector in ["base", "platform", "normal", "platform-axis", "base-axis"] {
                for axis in ["x", "y", "z"] {
                    pins.insert(format!("pkmkins.constraint.{n}.{vector}.{axis}"), (Float, In));
                }
            }
        }
        for letter in dependent.chars() {
            pins.insert(format!("pkmkins.dependent.{letter}"), (Float, Out));
        }
        let parameters =
            [("legs", legs), ("coordinates", coordinates), ("table", table), ("constraints", "3")];
        assert_exactly(&pins, &Module::pkmkins(&parameters), legs);
    }
}

const ALL_KINDS: [OfKind; 8] = [STRUT, SLIDER, SLIDER, SLIDER, SLIDER, SLIDER, CRANK, RING];

/// Returns a pin's name as in the manual: no prefix, N for numbers, without a coordinate's letter.
fn in_manual(pin: &str) -> String {
    let words =
        pin.split('.').skip(1).take_while(|word| word.len() > 1 || word.parse::<u8>().is_ok());
    words
        .map(|word| if word.parse::<u8>().is_ok() { ".N".into() } else { format!(".{word}") })
        .collect()
}

#[test]
fn the_manual_names_every_pin() {
    let manual = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../docs/reference/pkmkins.9");
    let manual = std::fs::read_to_string(manual).expect("the manual page");
    let names: Vec<&str> = manual.lines().filter(|line| line.starts_with(".B ")).collect();
    let is_named = |name: &str| {
        let ends = |rest: &str| !rest.starts_with(|c: char| c.is_ascii_alphanumeric() || c == '-');
        names
            .iter()
            .any(|line| line.match_indices(name).any(|(at, _)| ends(&line[at + name.len()..])))
    };
    let all =
        [("legs", "strut:3,slider:2,crank:2,ring:1"), ("coordinates", "ABC"), ("table", "XYZ")];
    let constrained = [("legs", "strut:3"), ("coordinates", "XYZ"), ("constraints", "3")];
    let pins = Module::pkmkins(&all).pins().into_iter().chain(Module::pkmkins(&constrained).pins());
    let lacking: Vec<String> =
        pins.map(|pin| pin.name).filter(|pin| !is_named(&in_manual(pin))).collect();
    assert!(lacking.is_empty(), "not in docs/reference/pkmkins.9: {lacking:?}");
}

/// HAL_NAME_LEN of LinuxCNC 2.9; the stub uses the limit of its headers.
#[test]
fn no_name_is_longer_than_the_oldest_hal_takes() {
    let largest =
        [("legs", "strut:3,slider:2,crank:2,ring:1"), ("coordinates", "ABC"), ("table", "XYZ")];
    let module = Module::pkmkins(&largest);
    let longest = module.pins().into_iter().map(|pin| pin.name).max_by_key(String::len);
    let longest = longest.expect("pins");
    assert!(longest.len() <= 47, "{longest}");
}

/// A rod without dimensions is refused, and gets no default length; only struts and rings
/// start with a machine (genhexkins', pentakins').
#[test]
fn pins_of_rods_start_at_zero_and_are_refused_until_they_are_set() {
    for kind in ["slider", "crank"] {
        let module = Module::pkmkins(&[("legs", &format!("{kind}:3")), ("coordinates", "XYZ")]);
        for pin in module.pins() {
            let of_rod = ["base", "platform", "guide", "axis", "arm", "rod", "side", "offset"];
            if of_rod.iter().any(|name| pin.name.starts_with(&format!("pkmkins.{name}."))) {
                assert_eq!(pin.get(), 0.0, "{}", pin.name);
            }
        }
        module.apply();
        assert!(!module.is_on("geometry-ok"), "{kind}");
        assert!(module.get("fault") < 0.0, "{kind}");
    }
}

#[test]
fn every_pin_starts_with_its_documented_value() {
    let module = Module::pkmkins(&[]);
    for leg in 0..6 {
        for (limit, value) in LIMITS {
            assert_eq!(module.get(&format!("{limit}.{leg}")), *value);
        }
    }
    for (name, _, _, value) in SINGLE {
        assert_eq!(module.get(name), *value, "{name}");
    }
    for axis in ["x", "y", "z", "a", "b", "c"] {
        assert!(module.get(&format!("home.{axis}")).is_nan(), "no reference pose yet");
    }
    assert!(module.is_on("kinstype.is-0"));
}

#[test]
fn every_pin_of_pentakins_is_there_under_our_name_with_the_same_value() {
    let theirs = Module::of_linuxcnc("pentakins");
    let ours = Module::pkmkins(&[("legs", "ring:5"), ("coordinates", "XYZAB")]);
    let mut seen = 0;
    // It creates pins for a sixth strut that does not exist.
    for pin in theirs.pins().into_iter().filter(|pin| !pin.name.contains(".5.")) {
        let name = pin.name.replace("pentakins.", "pkmkins.");
        let own = ours.pins().into_iter().find(|own| own.name == name);
        let own = own.unwrap_or_else(|| panic!("{name} is missing"));
        assert_eq!(own.kind, pin.kind, "{name}");
        // Its limit of an error sum has no effect here.
        if !name.ends_with("max-error") {
            assert_eq!(own.get(), pin.get(), "{name}");
        }
        seen += 1;
    }
    assert!(seen > 25, "{seen}");
}

#[test]
fn every_pin_of_genhexkins_is_there_under_our_name_with_the_same_value() {
    // userk.* belongs to genhexkins' template for user-defined kinematics, type 2, which
    // this module refuses. genhexkins declares the pins that it writes for display as
    // inputs; ours have the correct direction, and a net accepts both.
    let written =
        |name: &str| name.starts_with("skgui.") || ["x", "y", "z", "a", "b", "c"].contains(&name);
    let (theirs, ours) = (Module::genhexkins(), Module::pkmkins(&[]));
    let found = actual(&ours);
    for pin in theirs.pins().into_iter().filter(|pin| !pin.name.starts_with("userk.")) {
        let local = pin.name.trim_start_matches("genhexkins.").to_string();
        let name = pin.name.replace("genhexkins.", "pkmkins.");
        let (kind, dir) = found.get(&name).copied().unwrap_or_else(|| panic!("no pin {name}"));
        assert_eq!(kind, pin.kind, "{name}");
        assert!(dir == pin.dir || written(&local), "{name} is {dir:?}, theirs {:?}", pin.dir);
        assert_eq!(ours.get(&name), pin.get(), "{name}");
    }
}
