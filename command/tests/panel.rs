// SPDX-License-Identifier: GPL-2.0-or-later
//! Panels of the shipped machines. That PyVCP takes them and that every pin is there is seen in AXIS:
//! tests/viewer/screens.py.

use crate::commands::Bench;
use crate::shipped::{MACHINES, ini, whole};
use new::panel::Panel;
use std::collections::BTreeSet;
use std::fs;

#[test]
fn the_shipped_machines_show_their_panels() {
    for machine in MACHINES {
        let text = fs::read_to_string(ini(machine)).unwrap();
        for line in [
            format!("PYVCP = {machine}-panel.xml\n"),
            format!("POSTGUI_HALFILE = {machine}-panel.tcl\n"),
            format!("APP = pkmkins-vismach {machine}.ini\n"),
            "APP = haltcl $HALLIB_DIR/pkmkins_jog.tcl\n".into(),
        ] {
            assert!(text.contains(&line), "{machine}: {line}");
        }
    }
}

#[test]
fn every_widget_with_a_pin_is_fed_once_and_every_pin_feeds_a_widget() {
    for machine in MACHINES {
        let Panel { widgets, wiring } = Panel::new(&whole(machine), machine);
        let names: Vec<&str> = widgets
            .split("halpin=\"")
            .skip(1)
            .map(|rest| rest.split('"').next().unwrap())
            .collect();
        let table = wiring.split("show {\n").nth(1).unwrap().trim_end_matches("}\n");
        let fed: Vec<&str> =
            table.lines().map(|line| line.split(' ').next_back().unwrap()).collect();
        let set: BTreeSet<&str> = fed.iter().copied().collect();
        assert_eq!(set.len(), fed.len(), "{machine}");
        // The buttons feed, and are not fed.
        let shown: BTreeSet<&str> =
            names.into_iter().filter(|name| *name != "kinematics").collect();
        assert_eq!(set, shown, "{machine}");
        // LinuxCNC 2.9 takes names of 47 characters.
        assert!(set.iter().all(|name| format!("pyvcp.{name}").len() <= 47));
    }
}

#[test]
fn a_joint_stands_in_its_range_with_its_margin_and_a_cone_ends_where_the_file_says() {
    let Panel { widgets, wiring } = Panel::new(&whole("hexapod"), "hexapod");
    assert!(widgets.contains("halpin=\"joint-5\" min_=\"390\" max_=\"1410\""), "{widgets}");
    assert!(widgets.contains("halpin=\"base-angle-5\" min_=\"0\" max_=\"40\""), "{widgets}");
    assert!(wiring.contains("\n    pkmkins.margin.5 margin-5\n"), "{wiring}");
    assert!(wiring.contains("start hexapod.ini {x y z a b c}\n"), "{wiring}");
    // Six struts move five coordinates: no joint can be a letter.
    let table = Panel::new(&whole("hexapod-rotary-table"), "hexapod-rotary-table");
    assert!(wiring.contains("::switch\n") && !table.wiring.contains("::switch\n"));
    let pair = Panel::new(&whole("lathe-mirrored"), "lathe-mirrored").wiring;
    assert!(pair.contains("pkmkins.second.conditioning conditioning-second"), "{pair}");
    assert!(pair.contains("{x y z b c u v w}"), "{pair}");
}

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
        answer.contains("my[delta].ini: the name holds '['") && answer.ends_with("exit 2\n"),
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
