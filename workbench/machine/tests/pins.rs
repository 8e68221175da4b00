// SPDX-License-Identifier: GPL-2.0-or-later
//! Output of `pkmkins-pins`; tests/cases/ini/run.py passes it to the module.

use keys::{Key, chain, joint, leg, machine as pkm, second, workspace_box};
use machine::read::diagnostic::of_machine;
use machine::read::pins::printed;
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use test_support::shipped::{MACHINES, root};

fn shipped(name: &str) -> PathBuf {
    root().join(format!("configs/{name}/{name}.ini"))
}

/// Returns the output for the text of a file in its own folder.
fn text_of(text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("machine.ini");
    fs::write(&file, text).unwrap();
    printed(&file, "1.2.3").unwrap_or_else(|error| of_machine(&error))
}

fn pin_lines(text: &str) -> Vec<String> {
    let text = text_of(text);
    text.lines().filter(|line| line.starts_with("pin ")).map(String::from).collect()
}

fn has(text: &str, line: &str) -> bool {
    text.lines().any(|own| own == line)
}

/// Returns the text of a shipped machine without its boxes, which are those of its geometry and reference pose.
fn without_boxes(name: &str) -> String {
    let text = fs::read_to_string(shipped(name)).unwrap();
    let text = text.replace(" boxes=1", "").replace(" second_boxes=1", "");
    text.replace("[BOX_0]", "[OLD]").replace("[SECOND_BOX_0]", "[OLD_SECOND]")
}

/// Returns the lines `pin NAME VALUE` by name.
fn pins_of(text: &str) -> BTreeMap<String, f64> {
    assert!(text.ends_with("\nend\n"), "{text}");
    let pins = text.lines().filter_map(|line| line.strip_prefix("pin ")?.split_once(' '));
    pins.map(|(name, value)| (name.into(), value.parse().unwrap())).collect()
}

/// Returns the pins of a key of the INI file by the rule of the manual page: the key in small letters with - for _,
/// followed by the number of the section and the parts of a vector.
fn expected(section: &str, key: &str, value: &str) -> Vec<(String, f64)> {
    let (kind, number) = section.rsplit_once('_').unwrap_or((section, ""));
    let name = key.to_lowercase().replace('_', "-");
    let number = number.to_lowercase();
    let (all, stem): (&[&Key], String) = match kind {
        "PKM" => (pkm::ALL, name.clone()),
        "SECOND" => (second::ALL, format!("second.{name}")),
        "LEG" => (leg::ALL, format!("{name}.{number}")),
        "JOINT" => (joint::ALL, format!("{name}.{number}")),
        "CHAIN" => (chain::ALL, format!("chain.{number}.{name}")),
        "BOX" => (workspace_box::ALL, format!("box.{number}.{name}")),
        "SECOND_BOX" => (workspace_box::ALL, format!("second.box.{number}.{name}")),
        _ => return vec![],
    };
    let rows = key.strip_prefix("ROW_").filter(|_| kind.ends_with("BOX"));
    if rows.is_none() && !all.iter().any(|own| own.name == key && !own.pin.is_empty()) {
        return vec![];
    }
    let words: Vec<&str> = value.split_whitespace().collect();
    let parts: Vec<String> = match (rows, words.len()) {
        (Some(letter), count) => {
            let stem = stem.rsplit_once('.').unwrap().0;
            let letter = letter.to_lowercase();
            let row = (0..count).map(|n| format!("{stem}.matrix.{letter}.{n}"));
            return row.zip(words).map(|(name, word)| (name, word.parse().unwrap())).collect();
        }
        (None, 1) => return vec![(stem, number_of(words[0]))],
        (None, 2) if key == "EFFECTOR" => vec!["r".into(), "z".into()],
        (None, 2) => vec!["about".into(), "across".into()],
        (None, _) => ["x", "y", "z", "a", "b", "c"].map(String::from).into(),
    };
    let values = words.iter().map(|word| word.parse().unwrap());
    parts.into_iter().map(|part| format!("{stem}.{part}")).zip(values).collect()
}

/// Returns the number that a pin has for a word of the INI file.
fn number_of(word: &str) -> f64 {
    match word {
        "WORK" => 1.0,
        "TOOL" => 2.0,
        "LEGS" => 3.0,
        _ => match word.strip_prefix("0x") {
            Some(digits) => f64::from(u32::from_str_radix(digits, 16).unwrap()),
            None => word.parse().unwrap(),
        },
    }
}

/// Returns the sections, keys and values of a file, the first of each key.
fn entries(text: &str) -> Vec<(String, String, String)> {
    let mut section = "";
    let mut found: Vec<(String, String, String)> = vec![];
    for line in text.lines() {
        if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
            section = name;
        } else if let Some((key, value)) = line.split_once('=').filter(|_| !line.starts_with('#')) {
            let entry = (section.to_string(), key.trim().to_string(), value.trim().to_string());
            if !found.iter().any(|own| (&own.0, &own.1) == (&entry.0, &entry.1)) {
                found.push(entry);
            }
        }
    }
    found
}

/// Checks that the printed pins are exactly those of the keys; the reference pose, leads and planner values have
/// separate tests.
fn assert_every_key_reaches_its_pin(name: &str, text: &str) {
    let mut printed = pins_of(&text_of(text));
    let count = printed.len();
    assert!(count > 20, "{name}: {}", text_of(text));
    // The joints of extra axes have no limits in the module.
    let word = |key| text.split_whitespace().find_map(|word: &str| word.strip_prefix(key));
    let joints = text.matches("\n[LEG_").count() + word("table=").map_or(0, str::len);
    for (section, key, value) in entries(text) {
        let joint = section.strip_prefix("JOINT_").and_then(|number| number.parse::<usize>().ok());
        if joint.is_some_and(|joint| joint >= joints) {
            continue;
        }
        for (pin, value) in expected(&section, &key, &value) {
            if pin.starts_with("lead.") || pin == "screw-lead" {
                continue;
            }
            assert_eq!(printed.remove(&pin), Some(value), "{name}: [{section}]{key}: {pin}");
        }
    }
    // The only other value is a default of the reader.
    if let Some(value) = printed.remove("limit-iterations") {
        assert_eq!(value, 288.0, "{name}");
    }
    let others = ["home.", "second.home.", "lead.", "screw-lead", "max-override"];
    let accelerations = ["linear-acceleration", "angular-acceleration", "extra-acceleration"];
    printed
        .retain(|pin, _| !others.iter().chain(&accelerations).any(|start| pin.starts_with(start)));
    assert!(printed.is_empty(), "{name}: of no key: {printed:?}");
}

#[test]
fn every_key_of_a_shipped_machine_reaches_its_pin() {
    for name in MACHINES {
        assert_every_key_reaches_its_pin(name, &fs::read_to_string(shipped(name)).unwrap());
    }
}

/// Keys that no shipped machine has, with different values for each joint and leg.
#[test]
fn every_other_key_reaches_its_pin() {
    let mut text = without_boxes("hexapod");
    let more = "[PKM]\nCENTRE = 1.5 -2.5 3.5\nSPINDLE_OFFSET = 12.25\nCONVERGENCE_CRITERION = 2e-9\nRESIDUAL_LIMIT = 0.001\n\
        MAX_ERROR = 499\nCONDITIONING_LIMIT = 0.01\nFEED_FLOOR = 0.03\n";
    text = text.replace("[PKM]\n", more).replace("TILT_LIMIT = 30", "TILT_LIMIT = 29.5");
    // Values are in machine units, whatever these are.
    text = text.replace("LINEAR_UNITS = mm", "LINEAR_UNITS = inch");
    for n in 0..6 {
        let offset = format!("[LEG_{n}]\nOFFSET = {n}.5\n");
        text = text.replace(&format!("[LEG_{n}]\n"), &offset);
        let correction =
            format!("[JOINT_{n}]\nCORRECTION_LIMIT = 0.{n}1\nCORRECTION_RATE = 1.{n}\n");
        text = text.replace(&format!("[JOINT_{n}]\n"), &correction);
    }
    assert_every_key_reaches_its_pin("hexapod with more keys", &text);
    assert!(pins_of(&text_of(&text)).contains_key("correction-rate.5"));
    // The second mechanism's own keys, and the distance of both.
    let mirrored = without_boxes("lathe-mirrored");
    let text = format!("{mirrored}[SECOND]\nCENTRE = 4 5 6\nSPINDLE_OFFSET = -3\n");
    assert_every_key_reaches_its_pin("lathe-mirrored with an offset", &text);
    assert_eq!(pins_of(&text_of(&text))["second.spindle-offset"], -3.0);
}

#[test]
fn the_reference_pose_of_both_mechanisms_is_trajs_home() {
    let mirrored = without_boxes("lathe-mirrored");
    let text = mirrored
        .replace("HOME = 0 450 1000 0 0 0 0 450 2600", "HOME = 1 451 1002 0 0 0 5 456 2607");
    assert_ne!(text, mirrored);
    let pins = pins_of(&text_of(&text));
    let of =
        |stem: &str| ["x", "y", "z", "a", "b", "c"].map(|letter| pins[&format!("{stem}.{letter}")]);
    assert_eq!(of("home"), [1.0, 451.0, 1002.0, 0.0, 0.0, 0.0]);
    assert_eq!(of("second.home"), [5.0, 456.0, 2607.0, 0.0, 0.0, 0.0]);
}

/// The planner's accelerations, linear and angular: the smallest of those of the axes and of `[TRAJ]`.
#[test]
fn the_planner_has_the_smallest_acceleration_of_what_brakes_the_tool() {
    let planner = |text: &str| {
        let pins = pins_of(&text_of(text));
        ["linear-acceleration", "angular-acceleration", "max-override"]
            .map(|name| pins.get(name).copied())
    };
    // Replaces values named SECTION/KEY, or the MAX_ACCELERATION of a SECTION; 0 removes the line.
    let with = |name: &str, values: &[(&str, f64)]| {
        let text = fs::read_to_string(shipped(name)).unwrap();
        let mut section = String::new();
        let lines = text.lines().map(|line| {
            if line.starts_with('[') {
                section = line.trim_matches(['[', ']']).into();
            }
            let key = line.split('=').next().unwrap().trim();
            let is_it = |(of, _): &&(&str, f64)| {
                *of == format!("{section}/{key}") || *of == section && key == "MAX_ACCELERATION"
            };
            match values.iter().find(is_it) {
                Some((_, value)) if *value == 0.0 => String::new(),
                Some((_, value)) => format!("{key} = {value}"),
                None => line.into(),
            }
        });
        lines.collect::<Vec<String>>().join("\n") + "\n"
    };
    const LINEAR: &str = "TRAJ/MAX_LINEAR_ACCELERATION";
    const ANGULAR: &str = "TRAJ/MAX_ANGULAR_ACCELERATION";
    let axes = |own: &'static str, least: f64| {
        let all = [
            "AXIS_X", "AXIS_Y", "AXIS_Z", "AXIS_A", "AXIS_B", "AXIS_C", "AXIS_U", "AXIS_V",
            "AXIS_W",
        ];
        let mut values: Vec<(&str, f64)> = all.iter().map(|axis| (*axis, 5000.0)).collect();
        // An extra axis may not exceed the acceleration of its joint.
        values.extend([
            ("JOINT_6", 5000.0),
            (LINEAR, 6000.0),
            (ANGULAR, 7000.0),
            ("DISPLAY/MAX_FEED_OVERRIDE", 1.25),
        ]);
        values.retain(|(axis, _)| *axis != own);
        values.push((own, least));
        values
    };
    let machines = [
        ("hexapod", "XYZABC", ""),
        ("lathe-mirrored", "XYZBCUVW", "UVW"),
        ("hexapod-rotary-table", "XYZABC", ""),
    ];
    for (name, letters, second) in machines {
        for letter in "XYZABCUVW".chars() {
            let axis: &'static str = match letter {
                'X' => "AXIS_X",
                'Y' => "AXIS_Y",
                'Z' => "AXIS_Z",
                'A' => "AXIS_A",
                'B' => "AXIS_B",
                'C' => "AXIS_C",
                'U' => "AXIS_U",
                'V' => "AXIS_V",
                _ => "AXIS_W",
            };
            let found = planner(&with(name, &axes(axis, 10.0)));
            let is_linear = "XYZ".contains(letter) || second.contains(letter);
            let brakes = letters.contains(letter);
            let of = |moves: bool| Some(if moves && brakes { 10.0 } else { 5000.0 });
            let expected = [of(is_linear), of("ABC".contains(letter)), Some(1.25)];
            assert_eq!(found, expected, "{name}: {letter}");
        }
        assert_eq!(
            planner(&with(name, &axes(LINEAR, 11.0)))[..2],
            [Some(11.0), Some(5000.0)],
            "{name}"
        );
        assert_eq!(
            planner(&with(name, &axes(ANGULAR, 12.0)))[..2],
            [Some(5000.0), Some(12.0)],
            "{name}"
        );
        // Without the key, or with a value that LinuxCNC does not accept either, the module's default stays.
        let text = with(name, &axes("DISPLAY/MAX_FEED_OVERRIDE", 0.0));
        assert_eq!(planner(&text)[2], None, "{name}");
        assert_eq!(
            planner(&with(name, &axes("DISPLAY/MAX_FEED_OVERRIDE", -1.0)))[2],
            None,
            "{name}"
        );
    }
    // A slide that carries something limits the acceleration, one that carries nothing does not.
    let slide = |carries: &str| {
        let text = with("linear-delta", &axes("AXIS_X", 5000.0));
        let joint = "[JOINT_3]\nTYPE = LINEAR\nMIN_LIMIT = -1\nMAX_LIMIT = 1\nMAX_VELOCITY = 1\nMAX_ACCELERATION = 10\n";
        let axis =
            "[AXIS_W]\nMIN_LIMIT = -1\nMAX_LIMIT = 1\nMAX_VELOCITY = 1\nMAX_ACCELERATION = 10\n";
        text.replace("coordinates=XYZ", "coordinates=XYZ axes=W")
            .replace("COORDINATES = XYZ", "COORDINATES = XYZW")
            .replace("JOINTS = 3", "JOINTS = 4")
            .replace(" boxes=1", "")
            .replace("[BOX_0]", "[OLD_BOX]")
            + joint
            + axis
            + carries
    };
    let carrying = slide("[CHAIN_W]\nCARRIES = WORK\nAXIS = 0 0 1\n");
    assert_eq!(planner(&carrying)[0], Some(10.0), "{}", text_of(&carrying));
    assert_eq!(planner(&slide(""))[0], Some(5000.0), "{}", text_of(&slide("")));
}

#[test]
fn values_are_printed_in_full_and_as_the_pin_needs_them() {
    let hexapod = fs::read_to_string(shipped("hexapod")).unwrap();
    let text = text_of(&hexapod.replace("SCREW_LEAD = 10", "SCREW_LEAD = 010\nMAX_ERROR = 1e300"));
    assert!(text.starts_with("version 1.2.3\ncompared KINS * ") && text.ends_with("\nend\n"));
    for line in [
        "pin screw-lead 10",
        "pin max-error 1e300",
        "pin limit-iterations 288",
        "pin home.c 0",
        "ini PKM SCREW_LEAD=010",
    ] {
        assert!(has(&text, line), "{line} is not in\n{text}");
    }
    // Hashes are written in hexadecimal digits.
    let hash = text.lines().find_map(|line| line.strip_prefix("pin box.0.geometry ")).unwrap();
    assert_eq!(hash.parse::<u32>().unwrap().to_string(), hash);
}

#[test]
fn every_strut_gets_its_lead_where_one_has_its_own() {
    let hexapod = fs::read_to_string(shipped("hexapod")).unwrap();
    let plain = text_of(&hexapod);
    assert!(!plain.contains("pin lead."));
    let own = hexapod
        .replace("pkmkins legs=strut:6 boxes=1", "pkmkins legs=strut:6")
        .replace("[BOX_0]", "[OLD_BOX]")
        .replace("[LEG_2]\n", "[LEG_2]\nLEAD = 0\n");
    let text = text_of(&own);
    for line in ["pin screw-lead 0", "pin lead.1 10", "pin lead.2 0", "pin lead.5 10"] {
        assert!(has(&text, line), "{line} is not in\n{text}");
    }
}

#[test]
fn a_machine_that_starts_in_the_identity_has_the_same_pins() {
    let hexapod = fs::read_to_string(shipped("hexapod")).unwrap();
    let first = hexapod.replace("KINEMATICS = pkmkins", "KINEMATICS = pkmkins sparm=identityfirst");
    assert_eq!(pin_lines(&first), pin_lines(&hexapod));
    assert!(!pin_lines(&first).is_empty());
}

#[test]
fn load_parameters_in_sparm_are_those_of_the_machine() {
    let hexapod = fs::read_to_string(shipped("hexapod")).unwrap();
    let (given, inside) = ("pkmkins legs=strut:6 boxes=1", "pkmkins sparm=boxes=1/legs=strut:6");
    assert!(hexapod.contains(given));
    assert_eq!(pin_lines(&hexapod.replace(given, inside)), pin_lines(&hexapod));
    let both = format!("{given} sparm=boxes=1");
    assert_eq!(pin_lines(&hexapod.replace(given, &both)), pin_lines(&hexapod));
    let error = text_of(&hexapod.replace(given, &format!("{given} sparm=boxes=2")));
    assert!(error.contains("given twice with different values"), "{error}");
}

#[test]
fn errors_of_a_file_that_linuxcnc_has_expanded_name_the_lines_of_the_original() {
    let folder = tempfile::tempdir().unwrap();
    let hexapod = fs::read_to_string(shipped("hexapod")).unwrap();
    let (head, legs) = hexapod.split_at(hexapod.find("[LEG_0]").unwrap());
    let legs = legs.replacen("BASE = ", "BASE = x ", 1);
    let file = folder.path().join("machine.ini");
    fs::write(&file, format!("{head}#INCLUDE legs.inc\n")).unwrap();
    fs::write(folder.path().join("legs.inc"), &legs).unwrap();
    let expanded = folder.path().join("machine.ini.expanded");
    fs::write(&expanded, format!("#*** expanded\n{head}\n#*** Begin\n{legs}#*** End\n")).unwrap();
    let error = of_machine(&printed(&expanded, "").unwrap_err());
    assert!(error.contains("legs.inc") && error.contains("BASE = x"), "{error}");
    // A file other than the one that LinuxCNC reads.
    fs::write(&file, &hexapod).unwrap();
    let error = of_machine(&printed(&expanded, "").unwrap_err());
    assert!(error.contains("machine.ini.expanded"), "{error}");
}

#[test]
fn a_line_that_is_not_utf_8_is_refused_where_linuxcnc_would_read_other_characters() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("machine.ini");
    let mut bytes = fs::read(shipped("hexapod")).unwrap();
    bytes.extend(b"[PKM]\nBASE_MODEL = K\xf6rper.stl mm\n");
    fs::write(&file, bytes).unwrap();
    let error = of_machine(&printed(&file, "").unwrap_err());
    assert!(error.contains("not UTF-8"), "{error}");
}

#[test]
fn constraints_are_printed_by_kind_and_vector() {
    for (name, lines) in [
        (
            "tricept",
            [
                "pin constraint.0.kind 2",
                "pin constraint.1.normal.x 1",
                "pin constraint.2.kind 3",
                "pin constraint.2.platform-axis.y 1",
                "pin constraint.2.base-axis.x 1",
            ],
        ),
        (
            "z3-head",
            [
                "pin constraint.0.kind 1",
                "pin constraint.0.platform.y 200",
                "pin constraint.0.normal.x -320",
                "pin constraint.2.base.z 0",
                "pin home.z -700",
            ],
        ),
    ] {
        let file = root().join(format!("configs/{name}/{name}.ini"));
        let text = printed(&file, "1.2.3").unwrap_or_else(|error| of_machine(&error));
        for line in lines {
            assert!(has(&text, line), "{line}: {text}");
        }
    }
}

#[test]
fn a_machine_with_constraints_is_not_judged_by_tools_that_do_not_know_them() {
    let file = root().join("configs/tricept/tricept.ini");
    let ini = machine::read::ini::Ini::read(&file).unwrap();
    let refused = machine::read::machine::MachineConfig::from_ini(&ini).unwrap_err();
    assert!(refused.to_string().contains("not judged"), "{refused}");
}
