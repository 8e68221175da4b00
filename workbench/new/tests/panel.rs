// SPDX-License-Identifier: GPL-2.0-or-later
//! Panels of the shipped machines. tests/viewer/screens.py checks in AXIS that PyVCP accepts them and that every pin
//! exists.

use new::panel::Panel;
use std::collections::BTreeSet;
use std::fs;
use test_support::shipped::{MACHINES, ini, whole};

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
        // The buttons are sources, not sinks.
        let shown: BTreeSet<&str> =
            names.into_iter().filter(|name| *name != "kinematics").collect();
        assert_eq!(set, shown, "{machine}");
        // LinuxCNC 2.9 accepts names of 47 characters.
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
    // Six struts move five coordinates: no joint can be assigned a letter.
    let table = Panel::new(&whole("hexapod-rotary-table"), "hexapod-rotary-table");
    assert!(wiring.contains("::switch\n") && !table.wiring.contains("::switch\n"));
    let pair = Panel::new(&whole("lathe-mirrored"), "lathe-mirrored").wiring;
    assert!(pair.contains("pkmkins.second.conditioning conditioning-second"), "{pair}");
    assert!(pair.contains("{x y z b c u v w}"), "{pair}");
}

/// The travel of each letter has a label with its unit.
#[test]
fn lengths_and_angles_have_their_units() {
    for machine in MACHINES {
        let config = whole(machine);
        let Panel { widgets, wiring } = Panel::new(&config, machine);
        let letters = wiring.split_once(".ini {").unwrap().1.split_once('}').unwrap().0;
        let travel = widgets.split_once("Travel left from here").unwrap().1;
        let travel = travel.split_once("</labelframe>").unwrap().0;
        for letter in letters.split(' ') {
            let label = format!("text=\"{}\" ", letter.to_uppercase());
            let own = travel.split_once(&label).unwrap().1;
            let own = own.split("<tablerow/>").next().unwrap();
            let is_angle = "abc".contains(letter);
            let unit = if is_angle { "degrees" } else { config.length_unit() };
            assert!(own.contains(&format!("text=\"{unit}\"")), "{machine} {letter}: {own}");
        }
    }
}
