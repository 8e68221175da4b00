// SPDX-License-Identifier: GPL-2.0-or-later
//! The HAL files for real drives, as `pkm check` runs them.

use crate::homing::changed;
use check::report::check;

/// Returns the findings for the hexapod with one of the drive files, as in docs/guide/drives.md.
fn on_drives(files: &[&str], machine: &str, joint: impl Fn(usize) -> String) -> Vec<String> {
    let halfiles: String = files.iter().map(|file| format!("HALFILE = LIB:{file}\n")).collect();
    let (_folder, config) = changed("hexapod", |text| {
        let text = text.replace("HALFILE = LIB:pkmkins_sim.tcl\n", &halfiles);
        let text = text.replace("POSTGUI_HALFILE = hexapod-panel.tcl\n", "");
        let text = text.replace("PYVCP = hexapod-panel.xml\n", "");
        let text = (0..6).fold(text, |text, n| {
            let heading = format!("[JOINT_{n}]\n");
            text.replace(&heading, &format!("{heading}{}", joint(n)))
        });
        format!("{text}\n{machine}")
    });
    let report = check(&config.clone().into(), &config, |_| ()).unwrap();
    report.findings.iter().map(|finding| finding.problem.message()).collect()
}

const TIMES: &str = "STEPLEN = 5000\nSTEPSPACE = 5000\nDIRSETUP = 5000\nDIRHOLD = 5000\n";
const CARD: &str = "[HOSTMOT2]\nDRIVER = hm2_pci\nBOARD = 5i25\n[IO]\nESTOP_PIN = hm2_5i25.0.gpio.012.in\n\
                    ENABLE_PIN = hm2_5i25.0.gpio.013.out\nPUMP_PIN = hm2_5i25.0.gpio.014.out\n\
                    PUMP_OK_PIN = hm2_5i25.0.gpio.015.in\n[SPINDLE_0]\nVFD = hy_vfd -n vfd -d /dev/ttyUSB0\n\
                    OUTPUT_PIN = hm2_5i25.0.pwmgen.06.value\nOUTPUT_SCALE = 24000\nRAMP_TIME = 4\n";

#[test]
fn the_drive_files_are_wired_whole() {
    let steps = |_: usize| format!("SCALE = 400\n{TIMES}");
    let servo = |_: usize| "ENCODER_SCALE = 4000\nOUTPUT_SCALE = 600\nP = 30\n".to_string();
    let port = |n: usize| {
        format!(
            "STEP_PIN = parport.0.pin-{:02}-out\nDIR_PIN = parport.1.pin-{:02}-out\nSCALE = 5\n{TIMES}",
            n + 2,
            n + 2
        )
    };
    let bus = |_: usize| "SCALE = 10000\nDELAY = 3\n".to_string();
    let none = [""; 0];
    // The hexapod has absolute encoders, which a step generator is not.
    let extra = ["pkmkins_vfd_analog.tcl", "pkmkins_coolant.tcl"];
    let found = on_drives(&["pkmkins_mesa_step.tcl", extra[0], extra[1]], CARD, steps);
    assert!(found.len() == 6 && found.iter().all(|it| it.contains("counts steps")), "{found:?}");
    assert_eq!(on_drives(&["pkmkins_mesa_servo.tcl", "pkmkins_vfd_modbus.tcl"], CARD, servo), none);
    let ports = "[PARPORT]\nPORTS = 0x378 out 0x278 out\n[IO]\nESTOP_PIN = NONE\n";
    let found = on_drives(&["pkmkins_parport.tcl"], ports, port);
    assert!(found.len() == 1 && found[0].contains("BASE_PERIOD"), "{found:?}");
    let ethercat = "[ETHERCAT]\nCONFIG = ethercat.xml\n[IO]\nESTOP_PIN = NONE\n";
    assert_eq!(on_drives(&["pkmkins_ethercat.tcl"], ethercat, bus), none);
}

#[test]
fn a_drive_file_without_its_keys_does_not_fit() {
    let found = on_drives(&["pkmkins_mesa_step.tcl"], "", |_| String::new());
    assert!(found.len() == 1 && found[0].contains("LinuxCNC fails to start"), "{found:?}");
    assert!(found[0].contains("[HOSTMOT2]DRIVER is missing"), "{found:?}");
}

#[test]
fn homing_speeds_that_linuxcnc_refuses_and_searches_the_wrong_way_are_reported() {
    let reported = |from: &str, to: &str| {
        let (_folder, config) = changed("linear-delta", |text| {
            assert!(text.contains(from), "{from}");
            text.replacen(from, to, 1)
        });
        let report = check(&config.clone().into(), &config, |_| ()).unwrap();
        let texts = report.findings.iter().map(|finding| finding.problem.message());
        texts.collect::<Vec<String>>().join("\n")
    };
    let latch = reported("HOME_LATCH_VEL = ", "HOME_LATCH_VEL = 0\n# ");
    assert!(latch.contains("LinuxCNC does not home a joint that searches without it"), "{latch}");
    let search = reported("HOME_SEARCH_VEL = ", "HOME_SEARCH_VEL = 0\n# ");
    assert!(search.contains("add HOME_SEARCH_VEL, or HOME_USE_INDEX = YES"), "{search}");
    let away = reported("HOME_SEARCH_VEL = ", "HOME_SEARCH_VEL = -");
    assert!(
        away.contains("the search moves to the other end") && away.contains("expected 20"),
        "{away}"
    );
}
