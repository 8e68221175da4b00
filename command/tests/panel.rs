// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm panel` from the user's view.

use crate::commands::Bench;
use new::panel::Panel;
use std::fs;
use test_support::shipped::{ini, whole};

#[test]
fn both_files_are_written_beside_the_machine_or_into_a_folder_and_nothing_where_that_cannot_be() {
    let bench = Bench::new().with("file", "");
    for name in ["linear-delta-panel.tcl", "linear-delta-panel.xml"] {
        std::fs::remove_file(bench.0.path().join(name)).unwrap();
    }
    let lines = "[DISPLAY]\nPYVCP = linear-delta-panel.xml\n\n[HAL]\nPOSTGUI_HALFILE = linear-delta-panel.tcl\nexit 0\n";
    assert_eq!(bench.answer("panel linear-delta.ini --output-dir a/b", ""), lines);
    assert!(bench.0.path().join("a/b/linear-delta-panel.tcl").exists());
    let before = bench.files();
    assert!(bench.answer("panel linear-delta.ini --output-dir file/a", "").ends_with("exit 2\n"));
    let odd = Bench::new().with("my[delta].ini", &fs::read_to_string(ini("linear-delta")).unwrap());
    let files = odd.files();
    let answer = odd.answer("panel my[delta].ini", "");
    assert!(
        answer.contains("my[delta].ini: the name contains '['") && answer.ends_with("exit 2\n"),
        "{answer}"
    );
    assert_eq!(odd.files(), files);
    let hyphens = Panel::new(&whole("hexapod"), "hexa--pod");
    assert!(!hyphens.widgets.contains("hexa--pod"));
    assert!(bench.answer("panel none.ini", "").ends_with("exit 2\n"));
    assert_eq!(bench.files(), before);
    assert_eq!(bench.answer("panel linear-delta.ini", ""), lines);
    assert_eq!(bench.files(), before + 2);
}

#[test]
fn a_panel_of_other_limits_is_reported_with_the_command_that_writes_it() {
    let bench = Bench::new();
    let path = |name: &str| bench.0.path().join(name);
    let is_stale =
        |reported: &str| reported.contains("run pkm panel linear-delta.ini to write it again");
    let check = || bench.answer("check --no-start linear-delta.ini", "");
    assert!(!is_stale(&check()));
    let text = fs::read_to_string(path("linear-delta.ini")).unwrap();
    let (head, joint) = text.split_once("[JOINT_0]").unwrap();
    let line = joint.lines().find(|line| line.starts_with("MAX_LIMIT")).unwrap();
    let shorter = joint.replacen(line, "MAX_LIMIT = 390", 1);
    fs::write(path("linear-delta.ini"), format!("{head}[JOINT_0]{shorter}")).unwrap();
    let reported = check();
    assert!(
        is_stale(&reported) && reported.contains("PYVCP = linear-delta-panel.xml"),
        "{reported}"
    );
    // A panel of the user is not judged.
    let xml = path("linear-delta-panel.xml");
    let widgets = fs::read_to_string(&xml).unwrap();
    fs::write(&xml, widgets.replace("Made by pkm panel", "Mine")).unwrap();
    assert!(!is_stale(&check()));
    assert!(bench.answer("panel linear-delta.ini", "").ends_with("exit 0\n"));
    assert!(!is_stale(&check()));
}
