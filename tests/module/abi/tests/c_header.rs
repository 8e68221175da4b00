// SPDX-License-Identifier: GPL-2.0-or-later
//! The C side of the interface, checked by a C compiler.

use std::path::Path;
use std::process::Command;

#[test]
fn the_header_compiles_beside_linuxcncs_own_and_planted_mismatches_do_not() {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../c/run.sh");
    let output = Command::new("sh").arg(script).output().expect("sh starts");
    println!("{}", String::from_utf8_lossy(&output.stdout));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
