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

#[test]
fn six_numbers_are_a_pose_of_the_selected_mechanism_and_move_no_held_coordinate() {
    let bench = Bench::new();
    // On lathe-mirrored U V W C are X Y Z B of the second mechanism.
    let lathe = test_support::shipped::ini("lathe-mirrored");
    let own = |pose: &str| {
        let words = format!("travel {} --mechanism 2 --pose {pose}", lathe.display());
        bench.answer(&words, "")
    };
    let words = own("U-36 V440 W2580 C3");
    assert!(words.ends_with("exit 0\n"), "{words}");
    assert_eq!(own("-36 440 2580 0 3 0"), words);
    assert_ne!(own("-30 440 2580 0 3 0"), words);
    let held = own("-36 440 2580 7 3 0");
    assert!(held.contains("no joint moves A") && held.ends_with("exit 2\n"), "{held}");
    let delta = bench.answer("travel linear-delta.ini --pose 0 0 40 0 5 0", "");
    assert!(delta.contains("no joint moves B") && delta.ends_with("exit 2\n"), "{delta}");
}
