// SPDX-License-Identifier: GPL-2.0-or-later
//! loadrt: exports, accepted and refused parameters.

use abi_tests::module::{LoadError, Module, pkmkins_path};

/// A parameter that must be refused, the others at their defaults, and a word that the
/// refusal must contain.
const REFUSED: &[(&str, &str, &str)] = &[
    ("legs", "hexapod:6", "hexapod"),
    ("legs", "Strut:6", "Strut"),
    ("legs", "strut", "strut"),
    ("legs", "strut:", "strut"),
    ("legs", "strut:six", "six"),
    ("legs", "strut:-6", "-6"),
    ("legs", "strut:0", "0"),
    ("legs", "strut:5", "5"),
    ("legs", "strut:9", "9"),
    ("legs", "strut:99", "99"),
    ("legs", "strut:4294967302", "4294967302"),
    ("legs", "strut:18446744073709551622", "18446744073709551622"),
    ("legs", "strut:6,strut:3", "strut"),
    ("legs", "strut:6:1", "strut"),
    ("legs", "strut:6,", "legs"),
    ("legs", "strut:6 slider:1", "slider"),
    ("legs", ":6", "legs"),
    ("coordinates", "XYZXYZ", "XYZXYZ"),
    ("coordinates", "XYZABQ", "XYZABQ"),
    ("coordinates", "XYZABU", "XYZABU"),
    ("coordinates", "XYZABCUVW", "XYZABCUVW"),
    ("coordinates", "X YZ", "X YZ"),
    ("table", "XY", "table"),
    ("table", "Q", "table"),
    ("axes", "Q", "axes=Q"),
    ("axes", "UVWU", "axes=UVWU"),
    ("axes", "U V", "axes=U V"),
    ("axes", "C", "coordinates="),
    ("boxes", "9", "boxes=9"),
    ("boxes", "many", "boxes=many"),
    ("second_coordinates", "XYZ", "second_coordinates=XYZ"),
    ("second_angles", "C", "second_angles=C"),
    ("second_boxes", "1", "second_boxes=1"),
    ("constraints", "7", "constraints=7"),
    ("constraints", "one", "constraints=one"),
    ("sparm", "identity", "sparm=identity:"),
];

/// Second mechanisms with slider:4 and XYZB that must be refused: legs, coordinates, angles, and a
/// word of the reason.
const SECOND_REFUSED: &[([&str; 3], &str)] = &[
    (["slider:5", "XYZB", "C"], "one to eight legs"),
    (["slider:0", "XYZB", "C"], "one to eight legs"),
    (["slider", "XYZB", "C"], "KIND:COUNT"),
    (["rail:4", "XYZB", "C"], "strut, slider"),
    (["slider:4", "", "C"], "second_coordinates="),
    (["slider:4", "XYZBA", "CA"], "second_coordinates="),
    (["slider:4", "UVWC", ""], "second_coordinates="),
    (["slider:4", "XYZB", ""], "second_angles="),
    (["slider:4", "XYZB", "CA"], "second_angles="),
    (["slider:4", "XYZB", "W"], "second_angles="),
    (["slider:4", "XYZB", "X"], "second_angles="),
    (["slider:4", "XYAB", "CC"], "second_angles="),
    (["slider:4", "XYZB", "B"], "also in coordinates="),
];

/// Inconsistent parameters, and words that the refusal must contain: the given
/// value, and the problem.
const MISMATCHED: &[([&str; 3], [&str; 2])] = &[
    (["slider:4", "XYZAB", ""], ["XYZAB", "more letters than legs"]),
    (["crank:3", "XYZB", ""], ["XYZB", "more letters than legs"]),
    (["strut:5", "", ""], ["strut:5", "more letters than legs"]),
    (["slider:4", "XYZX", ""], ["XYZX", "each at most once"]),
    (["slider:4", "ZAAB", ""], ["ZAAB", "each at most once"]),
    (["slider:4", "zabZ", ""], ["zabZ", "each at most once"]),
    (["slider:4", "ZAB", "XYX"], ["XYX", "each at most once"]),
    (["slider:4", "ZAB", "XZ"], ["XZ", "and table="]),
    (["slider:4", "XYZB", "y"], ["table=y", "and table="]),
    (["slider:4", "ZBC", "XA"], ["XA", "X Y Z"]),
    (["slider:4", "ZAB", "XU"], ["XU", "X Y Z"]),
    (["slider:4", "ZAB", "W"], ["table=W", "X Y Z"]),
    (["strut:0", "X", ""], ["strut:0", "one to eight legs"]),
    (["slider:9", "XYZ", ""], ["slider:9", "one to eight legs"]),
    (["strut:4,slider:4,crank:1", "XYZ", ""], ["crank:1", "one to eight legs"]),
    (["rail:4", "XYZB", ""], ["rail:4", "strut, slider, crank, ring"]),
];

/// Machines that must load, and their numbers of joints.
const ACCEPTED: &[([&str; 3], usize)] = &[
    (["strut:6", "XYZ", ""], 6),
    (["strut:6", "XYZB", ""], 6),
    (["strut:7", "XYZABC", ""], 7),
    (["strut:8", "XYZABC", ""], 8),
    (["strut:1", "Z", ""], 1),
    (["strut:1", "C", "XYZ"], 4),
    (["slider:4", "XYZB", ""], 4),
    (["slider:4", "ZAB", "XY"], 6),
    (["slider:4", "zab", "yx"], 6),
    (["slider:6", "", ""], 6),
    (["crank:3", "XYZ", ""], 3),
    (["crank:6", "", ""], 6),
    (["strut:3", "XYZ", ""], 3),
    (["strut:5", "XYZAB", ""], 5),
    (["ring:5", "XYZAB", ""], 5),
    (["strut:2,slider:2,crank:2", "XYZABC", ""], 6),
    (["strut:8", "ABC", "XYZ"], 11),
];

fn load(texts: [&str; 3]) -> Result<Module, LoadError> {
    let [legs, coordinates, table] = texts;
    Module::try_pkmkins(&[("legs", legs), ("coordinates", coordinates), ("table", table)])
}

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
fn parameters_that_do_not_fit_together_are_refused_with_the_reason() {
    let mut wrong = Vec::new();
    for (texts, words) in MISMATCHED {
        match load(*texts) {
            Ok(_) => wrong.push(format!("{texts:?} was accepted")),
            Err(error) => {
                let said = error.messages.join(" ");
                if error.code >= 0 || !words.iter().all(|word| said.contains(word)) {
                    wrong.push(format!("{texts:?}: code {}, said '{said}'", error.code));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

#[test]
fn a_second_mechanism_that_does_not_fit_is_refused_with_what_was_written_and_the_reason() {
    let load = |texts: [&str; 3], more: &[(&str, &str)]| {
        let mut all = vec![("legs", "slider:4"), ("coordinates", "XYZB")];
        all.extend(["second", "second_coordinates", "second_angles"].into_iter().zip(texts));
        all.extend(more);
        Module::try_pkmkins(&all)
    };
    let mut wrong = Vec::new();
    for (texts, word) in SECOND_REFUSED {
        let said = load(*texts, &[]).err().map(|error| error.messages.join(" "));
        let written = format!("second={}", texts[0]);
        if !said.as_ref().is_some_and(|said| said.contains(word) && said.contains(&written)) {
            wrong.push(format!("{texts:?}: {said:?}"));
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
    let good = ["slider:4", "XYZB", "C"];
    for (more, is_taken) in [("A", true), ("C", false), ("U", false), ("B", false)] {
        assert_eq!(load(good, &[("axes", more)]).is_ok(), is_taken, "axes={more}");
    }
}

#[test]
fn machines_of_one_to_eight_legs_and_any_letters_load_quietly() {
    for (texts, joints) in ACCEPTED {
        let module = load(*texts).unwrap_or_else(|error| panic!("{texts:?}: {error:?}"));
        assert_eq!(module.messages().len(), 0, "{texts:?}: {:?}", module.messages());
        let limits = |n: usize| module.has(&format!("max-velocity.{n}"));
        assert!((0..*joints).all(limits) && !limits(*joints), "{texts:?}");
    }
}

#[test]
fn a_long_parameter_is_refused_and_not_copied_beyond_its_buffer() {
    let long = "strut:6,".repeat(10_000);
    let error = Module::try_pkmkins(&[("legs", &long)]).err().expect("refused");
    assert!(error.code < 0, "{error:?}");
}

#[test]
fn an_unknown_parameter_has_no_symbol_to_be_written_to() {
    let error = Module::try_pkmkins(&[("kinstype", "x")]).err().expect("refused");
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
    for parameter in ["legs", "coordinates", "table", "boxes", "second", "second_angles", "sparm"] {
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
