// SPDX-License-Identifier: GPL-2.0-or-later
//! Generated machines through the command: frames with the numbers of all legs, and travel along all letters.

use std::path::Path;
use std::process::Command;
use test_support::generated::{LETTERS, generated};

fn pkm(file: &Path, words: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pkm"));
    let done = command.arg(words[0]).arg(file).args(&words[1..]).output().unwrap();
    let error = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(0), "{} {words:?}: {error}", file.display());
    String::from_utf8(done.stdout).unwrap()
}

#[test]
fn frames_and_travel_answer_for_every_machine() {
    for seed in 0..11 {
        let drawn = generated(seed);
        let folder = tempfile::tempdir().unwrap();
        let file = drawn.write(folder.path());
        for (n, built) in drawn.mechanisms.iter().enumerate() {
            let svg = pkm(&file, &["frames", "--mechanism", &(n + 1).to_string()]);
            for leg in built.first_leg..built.first_leg + built.geometry.legs().len() {
                assert!(svg.contains(&format!("\n{leg}")), "{} {n}: leg {leg}", drawn.name);
            }
        }
        let reported = pkm(&file, &["travel", "--format", "json"]);
        let named: String =
            reported.split("\"letter\": \"").skip(1).map(|rest| &rest[..1]).collect();
        let letters: String = LETTERS.iter().filter(|l| drawn.letters().contains(**l)).collect();
        assert_eq!(named, letters, "{}: {reported}", drawn.name);
    }
}
