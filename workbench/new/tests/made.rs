// SPDX-License-Identifier: GPL-2.0-or-later
//! Files and findings of new machines, compared with the requested values.

use kinematics::Letter;
use machine::read::diagnostic::Severity;
use machine::read::machine::MachineConfig;
use new::kinds::KINDS;
use new::make::{Made, Order, make};
use new::parameters::Need;
use new::values::Values;
use std::collections::BTreeMap;
use std::path::Path;

/// Makes a machine of its kind's default dimensions and these values, without boxes.
fn made(folder: &Path, kind: &str, more: &[(&'static str, &str)]) -> Made {
    let kind = KINDS.iter().find(|known| known.name == kind).unwrap();
    let parameters = kind.parameters();
    let needed = parameters.iter().filter(|p| p.need != Need::Optional);
    let needed = needed.map(|p| (p.name, p.default));
    let all = needed.chain([("boxes", "no")]).chain(more.iter().copied());
    let words = |text: &str| text.split_whitespace().map(String::from).collect();
    let given: BTreeMap<_, Vec<String>> = all.map(|(name, text)| (name, words(text))).collect();
    let values = Values::new(kind.name, &parameters, &given).unwrap();
    let order = Order { kind, values: &values, name: "made", folder };
    make(&order, |_, _| ()).unwrap()
}

#[test]
fn the_first_program_moves_lengths_and_angles_at_half_of_their_own_speeds() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("made");
    let made = made(&folder, "four-rod-lathe", &[]);
    let [[feed, _], [turn, _]] = made.motion;
    let text = std::fs::read_to_string(folder.join("programs/first.ngc")).unwrap();
    let mut found = [0, 0];
    for line in text.lines().filter(|line| line.starts_with("G1 F")) {
        let words: Vec<&str> = line.split(' ').collect();
        let is_turn = words[2..].iter().all(|word| word.starts_with(['A', 'B', 'C']));
        found[usize::from(is_turn)] += 1;
        let speed: f64 = words[1][1..].parse().unwrap();
        // Per minute, as a whole number.
        let expected = 60.0 * 0.5 * if is_turn { turn } else { feed };
        assert!((speed - expected).abs() <= 0.5, "{line}: {expected}");
    }
    assert!(found.iter().all(|count| *count > 0), "{text}");
}

/// Checks that a new machine searches each switch toward the nearer end of the range, within it, from before the switch.
#[test]
fn switches_are_within_the_ranges_and_simulated_drives_start_before_them() {
    for tool in ["down", "up"] {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("made");
        made(&folder, "linear-delta", &[("tool", tool)]);
        let config = MachineConfig::read(&folder.join("made.ini")).unwrap();
        for (i, joint) in config.first().joints.iter().enumerate() {
            let section = format!("JOINT_{i}");
            let value = |key: &str| config.ini.number_or(&section, key, f64::NAN).unwrap();
            let [switch, search, start] =
                ["HOME_OFFSET", "HOME_SEARCH_VEL", "SIM_START"].map(value);
            let range = joint.min..=joint.max;
            assert!(range.contains(&switch) && range.contains(&start), "{tool}: {switch} {start}");
            let is_up = switch - joint.min > joint.max - switch;
            assert!((search > 0.0) == is_up && (start < switch) == is_up, "{tool}: {search}");
        }
    }
}

/// At this home B reaches its requested tilt to one side only.
#[test]
fn a_tilt_that_one_side_of_an_angle_does_not_reach_is_reported() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("made");
    let asked = 14.0;
    let more = [("home", "150 0 -600"), ("tilt", "14")];
    let made = made(&folder, "hexapod", &more);
    let mut one_sided = 0;
    for letter in [Letter::A, Letter::B, Letter::C] {
        let k = letter.index();
        let sides = [-made.limits.low[k], made.limits.high[k]].map(|side| side >= asked);
        one_sided += usize::from(sides[0] != sides[1]);
        let section = format!("AXIS_{}", letter.name());
        let is_reported = made.report.findings.iter().any(|finding| {
            let problem = &finding.problem;
            finding.severity == Severity::Warning
                && problem.section == section
                && problem.expected.starts_with("--tilt 14: only ")
        });
        assert_eq!(is_reported, sides != [true; 2], "{section}: {:?}", made.limits);
    }
    assert!(one_sided > 0, "{:?}", made.limits);
}
