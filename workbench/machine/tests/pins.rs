// SPDX-License-Identifier: GPL-2.0-or-later
//! Output of `pkmkins-pins`; tests/cases/ini/run.py passes it to the module.

use machine::read::diagnostic::of_machine;
use machine::read::pins::printed;
use std::fs;
use std::path::PathBuf;
use test_support::shipped::root;

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

fn has(text: &str, line: &str) -> bool {
    text.lines().any(|own| own == line)
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
    let pins = |text: &str| -> Vec<String> {
        let text = text_of(text);
        text.lines().filter(|line| line.starts_with("pin ")).map(String::from).collect()
    };
    assert_eq!(pins(&first), pins(&hexapod));
    assert!(!pins(&first).is_empty());
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
