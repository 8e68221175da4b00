// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm travel` from the user's view.

use crate::commands::Bench;
use serde_json::Value;

#[test]
fn questions_are_answered_line_by_line_and_errors_stay_in_their_line() {
    let good = r#"{"at": [0, 0, -300, 0, 0, 0, 0, 0, 0], "tools": [[0, 0, 0]]}"#;
    let far = r#"{"at": [99999, 0, 0, 0, 0, 0, 0, 0, 0], "tools": [[0, 0, 0]]}"#;
    let two = r#"{"at": [0, 0, 0, 0, 0, 0, 0, 0, 0], "tools": [[0, 0, 0], [0, 0, 0]]}"#;
    let asked = [good, "{}", two, far, good, ""].join("\n");
    let text = Bench::new().answer("travel linear-delta.ini --serve", &asked);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!((lines.len(), lines[5]), (6, "exit 0"), "{text}");
    let answer = |n: usize| serde_json::from_str::<Value>(lines[n]).unwrap();
    assert_eq!(answer(0), answer(4));
    assert_eq!(answer(0)["travel"][2]["letter"], "Z");
    let error = |n: usize| answer(n)["error"].as_str().unwrap().to_string();
    assert!(error(1).contains("at"), "{}", error(1));
    assert!(error(2).contains("expected 1, one for each mechanism; found 2"), "{}", error(2));
    assert!(error(3).contains("does not reach"), "{}", error(3));
}

#[test]
fn a_pose_beyond_a_limit_is_no_place_to_stand() {
    let bench = Bench::new();
    let reported = bench.answer("travel linear-delta.ini --pose Z900", "");
    assert!(
        reported.contains("the machine cannot be at this pose: ")
            && reported.contains("joint range"),
        "{reported}"
    );
    assert!(reported.ends_with("exit 1\n"), "{reported}");
}

#[test]
fn words_that_name_no_coordinate_and_poses_out_of_reach_are_refused() {
    let bench = Bench::new();
    let reported = bench.answer("travel linear-delta.ini --pose Q7", "");
    assert!(
        reported.contains("or a letter of XYZ and a number each") && reported.ends_with("exit 2\n")
    );
    for word in ["X", "Xnan", "A5"] {
        assert!(
            bench
                .answer(&format!("travel linear-delta.ini --pose {word}"), "")
                .ends_with("exit 2\n")
        );
    }
    assert!(bench.answer("travel linear-delta.ini --pose X99999", "").ends_with("exit 1\n"));
}
