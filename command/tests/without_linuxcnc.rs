// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm check` on a computer without LinuxCNC: it reports what it could not check, and counts it as neither good nor
//! bad.

use std::fs;
use std::path::Path;
use std::process::Command;
use test_support::shipped;

/// Hides an installed LinuxCNC from the command by a mount namespace.
const HIDDEN: &str = "for folder in /usr/share/linuxcnc /usr/lib/linuxcnc; do \
     [ ! -d $folder ] || mount -t tmpfs none $folder || exit 99; done; exec \"$@\"";

/// Returns the output of the command, on both streams, and its exit status; the shell runs `before` first.
fn answer(before: &str, file: &Path) -> (String, i32) {
    // Root needs no user namespace, which some computers forbid.
    let user: &[&str] =
        if rustix::process::geteuid().is_root() { &[] } else { &["--map-root-user"] };
    let done = Command::new("unshare")
        .arg("--mount")
        .args(user)
        .args(["sh", "-c", &format!("{before}{HIDDEN}"), "sh"])
        .args([env!("CARGO_BIN_EXE_pkm").as_ref(), "check".as_ref(), file.as_os_str()])
        .env("NO_COLOR", "1")
        .output()
        .expect("unshare, of util-linux");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&done.stdout) + &text(&done.stderr), done.status.code().unwrap_or(99))
}

/// The parts that need a computer with LinuxCNC.
const NOT_JUDGED: [&str; 2] = [
    "LinuxCNC is not installed here, so programs to start and files of LinuxCNC are not judged",
    "the drives are not judged from here on: LIB:pkmkins_sim.tcl is neither beside the INI file nor in /usr/share/linuxcnc/hallib",
];

fn expect(reported: &(String, i32), code: i32, parts: &[&str]) {
    let (text, found) = reported;
    assert_eq!(*found, code, "{text}");
    for part in parts {
        assert!(text.contains(part), "{part:?} is not said:\n{text}");
    }
    let warnings = text.matches("\nwarning: ").count();
    assert!(warnings >= NOT_JUDGED.len(), "{text}");
    assert!(!text.contains("there is no such"), "{text}");
}

#[test]
fn what_needs_linuxcnc_is_not_judged_and_the_rest_is() {
    let good = answer("", &shipped::ini("hexapod"));
    expect(
        &good,
        0,
        &[&NOT_JUDGED[..], &["The machine fits together; see the warnings."]].concat(),
    );
    assert_eq!(good.0.matches("\nwarning: ").count(), NOT_JUDGED.len(), "{}", good.0);
    // Mistakes that are not detected without LinuxCNC, then one that is.
    let folder = shipped::copied("linapod");
    let file = folder.path().join("linapod.ini");
    let text = fs::read_to_string(shipped::ini("linapod")).unwrap();
    let unseen = text
        .replace("DISPLAY = axis\n", "DISPLAY = axes\n")
        .replace("TASK = milltask", "TASK = miltask")
        .replace("LIB:pkmkins_sim.tcl", "LIB:pkmkins_sin.tcl");
    assert!(unseen.contains("DISPLAY = axes") && unseen.contains("TASK = miltask"));
    fs::write(&file, &unseen).unwrap();
    let drives = NOT_JUDGED[1].replace("_sim", "_sin");
    expect(&answer("", &file), 0, &[NOT_JUDGED[0], &drives]);
    let seen = unseen
        .replace("ANGULAR_UNITS = degree", "ANGULAR_UNITS = gon")
        .replace("OPEN_FILE = programs/", "OPEN_FILE = program/")
        .replace("PROGRAM_PREFIX = programs", "PROGRAM_PREFIX = /usr/share/linuxcnc/ncfiles")
        .replace("[JOINT_1]\n", "[JOINT_1]\nCOMP_FILE = screw.comp\n");
    fs::write(&file, seen).unwrap();
    let (text, code) = answer("", &file);
    assert_eq!(code, 1, "{text}");
    let seen = ["ANGULAR_UNITS = gon", "OPEN_FILE = program/", "COMP_FILE = screw.comp"];
    let parts = [NOT_JUDGED[0], &drives, "does not fit together"].into_iter().chain(seen);
    for part in parts {
        assert!(text.contains(part), "{part:?} is not said:\n{text}");
    }
    assert!(!text.contains("PROGRAM_PREFIX ="), "{text}");
}

#[test]
fn without_tcl_the_drives_are_not_judged() {
    let hidden = "mount --bind /dev/null /usr/bin/tclsh || exit 99; ";
    let reported = answer(hidden, &shipped::ini("hexapod"));
    expect(
        &reported,
        0,
        &[NOT_JUDGED[0], "the drives are not judged: /usr/bin/tclsh", "install tcl"],
    );
}
