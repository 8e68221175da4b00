// SPDX-License-Identifier: GPL-2.0-or-later
//! Commands on machines whose axes carry workpiece, tool or legs.

use test_support::shipped::folder;

const TABLE: &str = "hexapod-rotary-table";

#[test]
fn commands_that_know_the_machines_own_pose_alone_judge_no_program_over_a_chain() {
    let ini = test_support::shipped::ini(TABLE);
    let program = folder(TABLE).join("programs/turning-circle.ngc");
    let study = folder("hexapod").join("cut.toml");
    let [ini, program, study] = [&ini, &program, &study].map(|file| file.to_str().unwrap());
    for arguments in [
        &["path", ini, "any.toml"][..],
        &["cut", ini, program, "--study", study],
        &["stability", "program", ini, program, "--study", study],
        &["calibrate", ini, "any.log"],
    ] {
        let pkm = env!("CARGO_BIN_EXE_pkm");
        let done = std::process::Command::new(pkm).args(arguments).output().unwrap();
        let reported = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(2), "{arguments:?}: {reported}");
        assert!(
            reported.contains("not judged") && reported.contains(TABLE),
            "{arguments:?}: {reported}"
        );
        assert!(done.stdout.is_empty(), "{arguments:?}");
    }
}
