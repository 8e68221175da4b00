// SPDX-License-Identifier: GPL-2.0-or-later
//! Generated machines through the command: frames with the numbers of all legs, and travel along all letters.

use std::path::Path;
use std::process::Command;
use test_support::generated::{Extra, LETTERS, generated};

fn pkm(file: &Path, words: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pkm"));
    let done = command.arg(words[0]).arg(file).args(&words[1..]).output().unwrap();
    let error = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(0), "{} {words:?}: {error}", file.display());
    String::from_utf8(done.stdout).unwrap()
}

/// Machine 0 has three extra axes that carry nothing, machine 1 two that carry something.
#[test]
fn a_report_has_limits_and_plots_of_every_extra_axis() {
    for seed in [0, 1] {
        let drawn = generated(seed);
        let folder = tempfile::tempdir().unwrap();
        let file = drawn.write(folder.path());
        // A millimeter or a degree each.
        let word = |extra: &Extra| {
            let way = if extra.is_angle() { 1.0 } else { drawn.unit };
            format!(" {}{way:.4}", extra.axis.letter)
        };
        let words: String = drawn.extra.iter().map(word).collect();
        let program = folder.path().join("move.ngc");
        let units = if drawn.unit == 1.0 { "G21" } else { "G20" };
        std::fs::write(
            &program,
            format!(
                "{units} G91 G61\nG1 F{:.4}{words}\nG1 X{:.4}\nM2\n",
                200.0 * drawn.unit,
                drawn.unit
            ),
        )
        .unwrap();
        let page = folder.path().join("report.html");
        let text = pkm(
            &file,
            &["preflight", program.to_str().unwrap(), "--report", page.to_str().unwrap()],
        );
        let page = std::fs::read_to_string(page).unwrap();
        for shown in [&text, &page] {
            for word in ["at most inf", "-inf", " inf "] {
                assert!(!shown.contains(word), "{}: {word}", drawn.name);
            }
        }
        for extra in &drawn.extra {
            let name = format!("axis {}", extra.axis.letter);
            assert!(text.contains(&format!("\n  {name} ")), "{name}: {text}");
            // One strip each for position, speed, acceleration and following error.
            let strips = page.matches(&format!("\n{name}\n")).count();
            assert!(strips >= 4, "{}: {strips} strips of {name}", drawn.name);
        }
        assert!(page.contains("Speeds of the extra axes"), "{}", drawn.name);
    }
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
