// SPDX-License-Identifier: GPL-2.0-or-later
//! loadrt: what the module exports, accepts and refuses.

use abi_tests::module::{Module, pkmkins_path};

/// Parameters that must be refused, and a word the refusal has to contain.
const REFUSED: &[(&str, &str, &str)] = &[
    ("legs", "hexapod:6", "hexapod"),
    ("legs", "strut", "strut"),
    ("legs", "strut:", "strut"),
    ("legs", "strut:six", "six"),
    ("legs", "strut:-6", "-6"),
    ("legs", "strut:0", "0"),
    ("legs", "strut:5", "5"),
    ("legs", "strut:7", "7"),
    ("legs", "strut:99", "99"),
    ("legs", "strut:4294967302", "4294967302"),
    ("legs", "strut:6,strut:1", "strut"),
    ("legs", "strut:6,", "legs"),
    ("legs", ":6", "legs"),
    ("legs", "crank:6", "crank"),
    ("legs", "slider:6", "slider"),
    ("coordinates", "XYZ", "XYZ"),
    ("coordinates", "XYZXYZ", "XYZXYZ"),
    ("coordinates", "XYZABQ", "XYZABQ"),
    ("coordinates", "XYZABU", "XYZABU"),
    ("coordinates", "XYZABCUVW", "XYZABCUVW"),
    ("table", "XY", "table"),
    ("table", "Q", "table"),
];

#[test]
fn the_defaults_load_quietly() {
    let module = Module::pkmkins(&[]);
    assert_eq!(module.messages().len(), 0, "{:?}", module.messages());
}

#[test]
fn the_defaults_are_six_struts_and_all_six_coordinates() {
    let named = Module::pkmkins(&[("legs", "strut:6"), ("coordinates", "XYZABC")]);
    let names = |module: &Module| module.pins().into_iter().map(|p| p.name).collect::<Vec<_>>();
    assert_eq!(names(&Module::pkmkins(&[])), names(&named));
}

#[test]
fn a_parameter_without_a_value_means_its_default() {
    Module::pkmkins(&[("legs", ""), ("coordinates", ""), ("table", "")]);
}

#[test]
fn coordinates_may_be_lower_case_and_in_any_order() {
    for coordinates in ["xyzabc", "CBAZYX", "aXbYcZ"] {
        Module::pkmkins(&[("coordinates", coordinates)]);
    }
}

#[test]
fn bad_parameters_are_refused_with_a_message_that_repeats_them() {
    let mut wrong = Vec::new();
    for (name, value, word) in REFUSED {
        match Module::try_pkmkins(&[(name, value)]) {
            Ok(_) => wrong.push(format!("{name}={value} was accepted")),
            Err(error) => {
                let said = error.messages.join(" ");
                if error.code >= 0 || !said.contains("pkmkins") || !said.contains(word) {
                    wrong.push(format!("{name}={value}: code {}, said '{said}'", error.code));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

#[test]
fn a_long_parameter_is_refused_and_not_copied_beyond_its_buffer() {
    let long = "strut:6,".repeat(10_000);
    let error = Module::try_pkmkins(&[("legs", &long)]).err().expect("refused");
    assert!(error.code < 0, "{error:?}");
}

#[test]
fn an_unknown_parameter_has_no_symbol_to_be_written_to() {
    let error = Module::try_pkmkins(&[("sparm", "x")]).err().expect("refused");
    assert_eq!(error.code, 0, "rtapi_app itself refuses it: {error:?}");
}

#[test]
fn the_module_is_of_type_both_and_switchable() {
    let module = Module::pkmkins(&[]);
    // KINEMATICS_BOTH of kinematics.h.
    assert_eq!(module.kind(), 4);
    assert_eq!(module.switchable(), 1);
}

#[test]
fn parameters_and_licence_are_described_for_rtapi_app() {
    let module = Module::pkmkins(&[]);
    assert_eq!(module.text("rtapi_info_license").as_deref(), Some("GPL"));
    for parameter in ["legs", "coordinates", "table"] {
        let kind = module.text(&format!("rtapi_info_type_{parameter}"));
        assert_eq!(kind.as_deref(), Some("s"), "{parameter}");
        let description = module.text(&format!("rtapi_info_description_{parameter}"));
        assert!(description.is_some_and(|text| !text.is_empty()), "{parameter}");
    }
}

#[test]
fn the_export_section_of_other_modules_is_there() {
    let bytes = std::fs::read(pkmkins_path()).expect("readable");
    assert!(bytes.windows(14).any(|window| window == b".rtapi_export\0"));
}
