// SPDX-License-Identifier: GPL-2.0-or-later
//! The installed files of `make install`, and that `make uninstall` removes exactly these; nothing is built.

use crate::generated;
use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use test_support::shipped;

fn source() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Adds all files below a folder, by their relative path.
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
        .args(["-s", "-o", "setup", "-o", "module", "-o", "virtual", "-o", "generated", target])
        .arg(format!("DESTDIR={}", root.display()))
        .arg(format!("SO={}", file("libpkmkins.so")))
        .arg(format!("PINS={}", file("pkmkins-pins")))
        .arg(format!("VIRTUAL={}", file("libpkmkins-virtual.so")))
        // A make that runs these tests passes its own switches on.
        .env_remove("MAKEFLAGS")
        .current_dir(source())
        .output()
        .unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
}

#[test]
fn install_puts_everything_in_its_place_and_uninstall_takes_exactly_that_away() {
    let place = tempfile::tempdir().unwrap();
    for name in ["libpkmkins.so", "libpkmkins-virtual.so", "pkmkins-pins"] {
        fs::write(place.path().join(name), name).unwrap();
    }
    shipped::configs();
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
        "usr/bin/pkmkins-pins",
        "usr/bin/pkmkins-vismach",
        "usr/bin/pkmkins-panel",
        "usr/bin/pkm-live",
        "usr/share/pkmkins/pkmkins_scene.py",
        "usr/share/pkmkins/pkmkins_pins.py",
        "usr/share/pkmkins/pkmkins_mesh.py",
        "usr/share/pkmkins/pkmkins_panel.py",
        "usr/share/pkmkins/pkmkins_causes.py",
        "usr/share/pkmkins/pkmkins_refusal.py",
        "usr/share/man/man9/pkmkins.9",
        "usr/share/man/man1/pkm-live.1",
        "usr/share/man/man1/pkmkins-panel.1",
        "usr/share/man/man1/pkmkins-pins.1",
        "usr/share/man/man1/pkmkins-vismach.1",
    ]
    .map(String::from)
    .into();
    expected.extend(machines());
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
    let mode = |file: &str| fs::metadata(root.join(file)).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode("usr/lib/linuxcnc/modules/pkmkins.so"), 0o644);
    assert_eq!(mode("usr/bin/pkm-live"), 0o755);
    assert_eq!(mode("usr/bin/pkmkins-pins"), 0o755);
    // From an earlier version.
    fs::write(root.join("usr/lib/linuxcnc/modules/libpkmkins-virtual-2.8.so"), "").unwrap();
    fs::create_dir_all(root.join("usr/share/pkmkins/virtual")).unwrap();
    fs::write(root.join("usr/share/pkmkins/virtual/build.sh"), "").unwrap();
    make("uninstall", place.path(), &root);
    found.clear();
    files(&root, &root, &mut found);
    assert_eq!(found, BTreeSet::from([format!("{subroutines}/my_own.ngc")]));
    // An empty folder is removed.
    fs::remove_file(own).unwrap();
    make("uninstall", place.path(), &root);
    for folder in [subroutines, "usr/share/pkmkins", "usr/share/linuxcnc/aux_examples/pkmkins"] {
        assert!(!root.join(folder).exists(), "{folder}");
    }
}

/// Returns the folders of the machines' files, which LinuxCNC's configuration selector shows with a file README: those
/// in git, and generated ones.
fn machines() -> BTreeSet<String> {
    let listed =
        Command::new("git").args(["ls-files", "configs"]).current_dir(source()).output().unwrap();
    let listed = String::from_utf8(listed.stdout).unwrap();
    let generated = fs::read_to_string(generated::sums()).unwrap();
    let generated = generated.lines().map(|line| line.split_once("  ").unwrap().1);
    let place = |file: &str| {
        let file = file.strip_prefix("configs/").unwrap();
        format!("usr/share/linuxcnc/aux_examples/pkmkins/{}", file.replace("README.md", "README"))
    };
    listed.lines().chain(generated).map(place).collect()
}

/// Runs `make` for the command pkm by a user who is not root and has no sudo, after a build with some version of
/// cargo.
fn make_pkm(target: &str, place: &Path, version: &str) -> Output {
    let cargo = place.join("cargo");
    fs::write(
        &cargo,
        format!("#!/bin/sh\n[ \"$1\" != --version ] || echo 'cargo {version} (stub)'\n"),
    )
    .unwrap();
    fs::set_permissions(&cargo, fs::Permissions::from_mode(0o755)).unwrap();
    Command::new("make")
        .args(["-s", target, "SUDO=no-sudo", "PREFIX=~/.local"])
        .arg(format!("CARGO={}", cargo.display()))
        .env("HOME", place)
        .env_remove("MAKEFLAGS")
        .current_dir(source())
        .output()
        .unwrap()
}

#[test]
fn pkm_goes_into_a_place_of_ones_own_without_root_and_an_old_cargo_is_named() {
    // The output of a cargo that has nothing to build.
    assert_eq!(
        Path::new(env!("CARGO_BIN_EXE_pkm")).canonicalize().unwrap(),
        source().join("target/host/pkm").canonicalize().unwrap()
    );
    let place = tempfile::tempdir().unwrap();
    let old = make_pkm("install-pkm", place.path(), "1.63.0");
    let reported = String::from_utf8_lossy(&old.stdout).into_owned();
    assert!(
        !old.status.success() && reported.contains("cargo 1.63.0 (stub) found, and 1."),
        "{reported}"
    );
    assert!(reported.contains("https://rustup.rs"), "{reported}");
    let local = place.path().join(".local");
    assert!(!local.exists());
    let done = make_pkm("install-pkm", place.path(), "99.0.0");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    for name in ["bin/pkm", "share/man/man1/pkm.1", "share/man/man1/pkm-stability-pose.1"] {
        assert!(local.join(name).exists(), "{name}");
    }
    assert!(local.join("share/bash-completion/completions/pkm").exists());
    assert!(make_pkm("uninstall-pkm", place.path(), "99.0.0").status.success());
    let mut found = BTreeSet::new();
    files(&local, &local, &mut found);
    assert_eq!(found, BTreeSet::new());
}
