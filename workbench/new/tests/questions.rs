// SPDX-License-Identifier: GPL-2.0-or-later
//! Questions about a new machine, and the progress of creating it.

use new::kinds::KINDS;
use new::make::{Order, make};
use new::parameters::Need;
use new::questions::Dialogue;
use new::values::Values;
use snapbox::{assert_data_eq, str};
use std::sync::Mutex;

#[test]
fn questions_are_asked_again_until_they_are_answered_and_offer_what_the_table_has() {
    let mut asked = vec![];
    let mut answers = &b"inch\n\nlong\n-3\n6.5\n"[..];
    let kind = KINDS.iter().find(|kind| kind.name == "linear-delta").unwrap();
    let end = Dialogue { answers: &mut answers, questions: &mut asked }.values(kind);
    assert_eq!(end.unwrap_err().kind(), std::io::ErrorKind::UnexpectedEof);
    assert_data_eq!(
        String::from_utf8(asked).unwrap(),
        str![[r#"
linear-delta: three carriages on vertical rails, pairs of rods, X Y Z. Press Enter for the value in brackets.
Unit of all lengths, and of the machine
  --unit (mm or inch) [mm]: CSV file with the anchors of every leg, instead of dimensions
  --anchors (a file) []: Distance from the center of the base to the center of a joint, seen from above
  --base-radius (inch) [6.42]:   --base-radius long: expected a decimal number
Distance from the center of the base to the center of a joint, seen from above
  --base-radius (inch) [6.42]:   --base-radius -3: expected more than 0
Distance from the center of the base to the center of a joint, seen from above
  --base-radius (inch) [6.42]: Distance from the center of the platform to the center of a joint
  --platform-radius (inch) [1.3]: 
"#]]
    );
}

#[test]
fn enter_at_every_question_makes_what_the_examples_make() {
    for kind in KINDS.iter().filter(|kind| kind.legs != 0) {
        let answers = "\n".repeat(kind.parameters().len());
        let mut answers = answers.as_bytes();
        let mut asked = vec![];
        let given = Dialogue { answers: &mut answers, questions: &mut asked }.values(kind).unwrap();
        for parameter in kind.parameters().iter().filter(|p| p.need != Need::Optional) {
            assert_eq!(given[parameter.name].join(" "), parameter.default, "{}", kind.name);
        }
    }
}

#[test]
fn long_work_reports_the_share_that_is_done() {
    let kind = KINDS.iter().find(|kind| kind.name == "linear-delta").unwrap();
    let needed = kind.parameters().into_iter().filter(|p| p.need != Need::Optional);
    let words = |text: &str| text.split_whitespace().map(String::from).collect();
    let given = needed.map(|p| (p.name, words(p.default))).collect();
    let values = Values::new(kind.name, &kind.parameters(), &given).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("reported");
    let reported = Mutex::new(vec![]);
    let order = Order { kind, values: &values, name: "reported", folder: &folder };
    make(&order, |what, share| reported.lock().unwrap().push((what.to_string(), share))).unwrap();
    let reported = reported.into_inner().unwrap();
    let own = reported.iter().filter(|(what, _)| what == "proving axis limits");
    let own: Vec<Option<f64>> = own.map(|(_, share)| *share).collect();
    let is_rising = own[1..].is_sorted() && own.last().unwrap().is_some_and(|share| share <= 1.0);
    assert!(own[0].is_none() && own.len() > 1 && is_rising, "{own:?}");
}
