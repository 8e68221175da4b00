// SPDX-License-Identifier: GPL-2.0-or-later
//! The pins that HAL files and people hold on to.

use abi_tests::module::Module;
use abi_tests::stub::PinDir::{self, In, Out};
use abi_tests::stub::PinType::{self, Bit, Float, S32, U32};
use std::collections::BTreeMap;

type Kind = (PinType, PinDir);

/// Pins there is one of, with what they hold before anything is set.
const SINGLE: &[(&str, PinType, PinDir, f64)] = &[
    ("screw-lead", Float, In, 0.0),
    ("spindle-offset", Float, In, 0.0),
    ("tool-offset", Float, In, 0.0),
    ("tool-offset-x", Float, In, 0.0),
    ("tool-offset-y", Float, In, 0.0),
    ("tool-offset-eff-x", Float, Out, 0.0),
    ("tool-offset-eff-y", Float, Out, 0.0),
    ("tool-offset-eff-z", Float, Out, 0.0),
    ("convergence-criterion", Float, In, 1e-9),
    ("limit-iterations", U32, In, 120.0),
    ("max-error", Float, In, 500.0),
    ("last-iterations", U32, Out, 0.0),
    ("max-iterations", U32, Out, 0.0),
    ("fwd-kins-fail", Bit, Out, 0.0),
    ("geometry-ok", Bit, Out, 0.0),
    ("geometry-hash", U32, Out, 0.0),
    ("geometry-changed", Bit, Out, 0.0),
    ("machine-on", Bit, In, 0.0),
    ("apply", Bit, In, 0.0),
    ("fault", S32, Out, 0.0),
    ("fault-leg", S32, Out, -1.0),
    ("fault-count", U32, Out, 0.0),
    ("fault-reset", Bit, In, 0.0),
    ("residual", Float, Out, 0.0),
    ("assembly", S32, Out, 0.0),
];

/// Limits of a leg; beyond any joint until somebody sets them.
const LIMITS: &[(&str, f64)] = &[
    ("min-limit", -1e99),
    ("max-limit", 1e99),
    ("max-velocity", 1e99),
    ("max-acceleration", 1e99),
];

fn expected() -> BTreeMap<String, Kind> {
    let mut pins: BTreeMap<String, Kind> = SINGLE
        .iter()
        .map(|(name, kind, dir, _)| (format!("pkmkins.{name}"), (*kind, *dir)))
        .collect();
    let mut add = |name: String, kind, dir| {
        assert!(pins.insert(name, (kind, dir)).is_none());
    };
    for leg in 0..6 {
        for (vector, axis) in ["base", "platform", "base-n", "platform-n"]
            .into_iter()
            .flat_map(|v| ["x", "y", "z"].map(|a| (v, a)))
        {
            add(format!("pkmkins.{vector}.{leg}.{axis}"), Float, In);
        }
        add(format!("pkmkins.lead.{leg}"), Float, In);
        add(format!("pkmkins.offset.{leg}"), Float, In);
        add(format!("pkmkins.correction.{leg}"), Float, Out);
        for (limit, _) in LIMITS {
            add(format!("pkmkins.{limit}.{leg}"), Float, In);
        }
    }
    for axis in ["x", "y", "z", "a", "b", "c"] {
        add(format!("pkmkins.home.{axis}"), Float, In);
        add(format!("pkmkins.{axis}"), Float, Out);
        add(format!("skgui.{axis}"), Float, Out);
    }
    for kind in 0..3 {
        add(format!("kinstype.is-{kind}"), Bit, Out);
    }
    pins
}

fn actual(module: &Module) -> BTreeMap<String, Kind> {
    module.pins().into_iter().map(|pin| (pin.name, (pin.kind, pin.dir))).collect()
}

#[test]
fn the_pins_of_a_hexapod_are_exactly_those_of_the_manual() {
    let (expected, actual) = (expected(), actual(&Module::pkmkins(&[])));
    let mut wrong = Vec::new();
    for (name, kind) in &expected {
        match actual.get(name) {
            Some(found) if found == kind => {}
            found => wrong.push(format!("{name}: expected {kind:?}, found {found:?}")),
        }
    }
    for name in actual.keys().filter(|name| !expected.contains_key(*name)) {
        wrong.push(format!("{name}: {:?}, not in the manual", actual[name]));
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
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
fn every_pin_of_genhexkins_is_there_under_our_name_with_the_same_value() {
    // userk.* belongs to genhexkins' template for own kinematics, type 2, which
    // this module refuses. genhexkins declares the pins it writes for people as
    // inputs; ours say what they are, and a net accepts both.
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
