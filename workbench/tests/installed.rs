// SPDX-License-Identifier: GPL-2.0-or-later
//! What `make install` puts where, and that `make uninstall` takes exactly it away; nothing is built.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn source() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// All files below a folder, by their place in it.
fn files(root: &Path, folder: &Path, found: &mut BTreeSet<String>) {
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        match entry.is_dir() {
            true => files(root, &entry, found),
            false => drop(found.insert(entry.strip_prefix(root).unwrap().display().to_string())),
        }
    }
}

fn make(target: &str, place: &Path, root: &Path) {
    let file = |name: &str| place.join(name).display().to_string();
    let done = Command::new("make")
        .args(["-s", "-o", "setup", "-o", "module", "-o", "virtual", target])
        .arg(format!("DESTDIR={}", root.display()))
        .arg(format!("SO={}", file("libpkmkins.so")))
        .arg(format!("VIRTUAL={}", file("libpkmkins-virtual.so")))
        // A make that runs these tests hands its own switches on.
        .env_remove("MAKEFLAGS")
        .current_dir(source())
        .output()
        .unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
}

#[test]
fn install_puts_module_hal_files_subroutines_and_viewer_in_place_and_uninstall_takes_exactly_them_away()
 {
    let place = tempfile::tempdir().unwrap();
    for name in ["libpkmkins.so", "libpkmkins-virtual.so"] {
        fs::write(place.path().join(name), name).unwrap();
    }
    let root = place.path().join("root");
    let subroutines = "usr/share/linuxcnc/ncfiles/pkmkins_lib";
    let own = root.join(subroutines).join("my_own.ngc");
    fs::create_dir_all(own.parent().unwrap()).unwrap();
    fs::write(&own, "").unwrap();
    make("install", place.path(), &root);
    let mut expected: BTreeSet<String> = [
        "usr/lib/linuxcnc/modules/pkmkins.so",
        "usr/lib/linuxcnc/modules/libpkmkins-virtual.so",
        "usr/share/linuxcnc/hallib/pkmkins.tcl",
        "usr/share/linuxcnc/hallib/pkmkins_sim.tcl",
        "usr/share/linuxcnc/hallib/pkmkins_panel.tcl",
        "usr/share/linuxcnc/hallib/pkmkins_drives.tcl",
        "usr/share/linuxcnc/hallib/pkmkins_mesa.tcl",
        "usr/share/linuxcnc/hallib/pkmkins_mesa_step.tcl",
        "usr/share/linuxcnc/hallib/pkmkins_mesa_servo.tcl",
        "usr/share/linuxcnc/hallib/pkmkins_parport.tcl",
        "usr/share/linuxcnc/hallib/pkmkins_ethercat.tcl",
        "usr/share/linuxcnc/hallib/pkmkins_jog.tcl",
        "usr/share/linuxcnc/hallib/pkmkins_vfd_analog.tcl",
        "usr/share/linuxcnc/hallib/pkmkins_vfd_modbus.tcl",
        "usr/share/linuxcnc/hallib/pkmkins_coolant.tcl",
        "usr/share/linuxcnc/ncfiles/pkmkins_lib/my_own.ngc",
        "usr/bin/pkmkins-vismach",
        "usr/bin/pkmkins-panel",
        "usr/bin/pkm-live",
        "usr/share/pkmkins/pkmkins_scene.py",
        "usr/share/pkmkins/pkmkins_pins.py",
        "usr/share/pkmkins/pkmkins_mesh.py",
        "usr/share/pkmkins/pkmkins_panel.py",
        "usr/share/pkmkins/pkmkins_causes.py",
        "usr/share/pkmkins/pkmkins_refusal.py",
    ]
    .map(String::from)
    .into();
    for entry in fs::read_dir(source().join("subroutines")).unwrap() {
        let file = entry.unwrap().path();
        if !file.ends_with("README.md") {
            let name = file.file_name().unwrap().to_str().unwrap();
            expected.insert(format!("{subroutines}/{name}"));
            assert_eq!(
                fs::read(&file).unwrap(),
                fs::read(root.join(subroutines).join(name)).unwrap()
            );
        }
    }
    let mut found = BTreeSet::new();
    files(&root, &root, &mut found);
    assert_eq!(found, expected);
    make("uninstall", place.path(), &root);
    found.clear();
    files(&root, &root, &mut found);
    assert_eq!(found, BTreeSet::from([format!("{subroutines}/my_own.ngc")]));
    // Of an empty folder nothing is left.
    fs::remove_file(own).unwrap();
    make("uninstall", place.path(), &root);
    assert!(!root.join(subroutines).exists());
}
