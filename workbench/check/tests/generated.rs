// SPDX-License-Identifier: GPL-2.0-or-later
//! Generated machines: findings and proofs of `pkm check`, compared with the equations of their legs.

use check::between;
use check::report::check;
use kinematics::Vector3;
use machine::read::diagnostic::Severity;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use rand::Rng;
use test_support::generated::{Generated, generated};

/// Share of a limit's range that may be rounding.
const ROUNDED: f64 = 1e-9;

/// Returns the fact about the size of a mechanism: a box around its joints at home, in its unit and in meters.
fn size(drawn: &Generated, mechanism: &Mechanism) -> String {
    let at = mechanism.machine.at(&mechanism.home_pose(), &mechanism.spindle).unwrap();
    let ends = at.segments()[..mechanism.legs()].iter().flat_map(|leg| [leg.base, leg.platform]);
    let bases = mechanism.geometry.legs().iter().map(|leg| leg.base.into());
    let (low, high) = ends.chain(bases).fold(
        (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)),
        |(low, high), point| (low.inf(&point), high.sup(&point)),
    );
    let text = |per_unit: f64| {
        let [x, y, z] = <[f64; 3]>::from((high - low) * per_unit);
        format!("{x:.3} x {y:.3} x {z:.3}")
    };
    let (unit, own) = match drawn.unit {
        1.0 => ("mm", String::new()),
        _ => ("inch", format!("{} inch, ", text(1.0))),
    };
    let meters = text(1e-3 / drawn.unit);
    format!(
        "lengths in {unit}; at home the joints of all legs span {own}{meters} m: if that is wrong, correct LINEAR_UNITS"
    )
}

#[test]
fn machines_fit_and_every_pose_that_is_proved_keeps_ranges_and_tilt() {
    let mut proved = 0;
    for seed in 0..11 {
        let mut drawn = generated(seed);
        let folder = tempfile::tempdir().unwrap();
        let config = MachineConfig::read(&drawn.write(folder.path())).unwrap();
        for (n, mechanism) in config.mechanisms.iter().enumerate() {
            let report = check(&config, mechanism, |_| ()).unwrap();
            let fact = |name: &str| {
                let found = report.facts.iter().find(|(own, _)| own == name);
                found.map(|(_, value)| value.clone()).unwrap_or_default()
            };
            let errors = report.findings.iter().filter(|one| one.severity == Severity::Error);
            let reported: Vec<_> = errors.map(|finding| finding.problem.message()).collect();
            let reported = format!("{} {n}: {reported:?}", drawn.name);
            assert!(report.fits(), "{reported}");
            assert!(fact("geometry hash").starts_with(&format!("{:#010x}", mechanism.hash)));
            assert_eq!(fact("size"), size(&drawn, mechanism), "{reported}");
            for joint in mechanism.joints.iter() {
                let value = fact(&joint.name);
                assert!(value.contains(&format!("MIN_LIMIT {}", joint.min)), "{reported}: {value}");
                assert!(value.contains(&format!("MAX_LIMIT {}", joint.max)), "{reported}: {value}");
            }
            let Some(limits) = report.suggestion else { continue };
            let built = &drawn.mechanisms[n];
            let spindle = if mechanism.chain.is_bare() {
                kinematics::Vector3::zeros()
            } else {
                mechanism.spindle
            };
            for _ in 0..300 {
                let shares = std::array::from_fn(|_| drawn.rng.random());
                let pose = limits.at(shares);
                let room = built.room(&pose, &spindle, drawn.tilt_limit);
                assert!(room > -ROUNDED, "{} {n}: {pose:?} is beyond by {room}", drawn.name);
            }
            proved += 1;
        }
        assert_eq!(between::check(&config).unwrap().is_some(), config.mechanisms.len() == 2);
    }
    assert!(proved > 8, "{proved}");
}

/// Checks that a joint with a wrong HOME is named by its number, also in the second mechanism and after a table.
#[test]
fn a_wrong_home_is_found_in_every_joint() {
    for seed in [1, 3, 5, 7, 9] {
        let drawn = generated(seed);
        for (m, built) in drawn.mechanisms.iter().enumerate() {
            let i = (seed as usize + m) % built.joints.len();
            let number = built.first_joint + i;
            let head = format!("[JOINT_{number}]\n");
            let (before, after) = drawn.text.split_once(&head).unwrap();
            let home = built.joints[i].home;
            let unit = if built.joints[i].is_angular { 1.0 } else { drawn.unit };
            let moved = format!("HOME = {}\n", home + 3.0 * unit);
            let wrong = after.replacen(&format!("HOME = {home}\n"), &moved, 1);
            let folder = tempfile::tempdir().unwrap();
            let file = drawn.write(folder.path());
            std::fs::write(&file, format!("{before}{head}{wrong}")).unwrap();
            let config = MachineConfig::read(&file).unwrap();
            for (n, mechanism) in config.mechanisms.iter().enumerate() {
                let report = check(&config, mechanism, |_| ()).unwrap();
                let of_home: Vec<&str> = report
                    .findings
                    .iter()
                    .filter(|finding| finding.problem.key == "HOME")
                    .map(|finding| finding.problem.section.as_str())
                    .collect();
                let is_here = of_home.contains(&format!("JOINT_{number}").as_str());
                assert_eq!(is_here, n == m, "{} {number}: {:?}", drawn.name, report.findings);
            }
        }
    }
}

/// Replaces the value of a key in a section of a text.
fn with_value(text: &str, section: &str, key: &str, value: f64) -> String {
    let (before, own) = text.split_once(&format!("[{section}]\n")).unwrap();
    let (between, old) = own.split_once(&format!("{key} = ")).unwrap();
    assert!(!between.contains('['), "[{section}] has no {key}");
    let after = &old[old.find('\n').unwrap()..];
    format!("{before}[{section}]\n{between}{key} = {value}{after}")
}

#[test]
fn a_home_of_an_extra_axis_outside_any_of_its_four_limits_is_found_in_its_joint() {
    let ends = [("JOINT", true), ("AXIS", true), ("AXIS", false), ("JOINT", false)];
    let mut cases = ends.iter().cycle();
    for seed in [0, 10] {
        let drawn = generated(seed);
        let first: usize = drawn.mechanisms.iter().map(|built| built.joints.len()).sum();
        let mut text = drawn.text.clone();
        for (n, extra) in drawn.extra.iter().enumerate() {
            let (joint, axis) = (&extra.joint, &extra.axis);
            let (of, is_upper) = cases.next().unwrap();
            let (section, [min, max]) = match *of {
                "JOINT" => (format!("JOINT_{}", first + n), [joint.min, joint.max]),
                _ => (format!("AXIS_{}", axis.letter), [axis.min, axis.max]),
            };
            let (key, other) = if *is_upper { ("MAX_LIMIT", min) } else { ("MIN_LIMIT", max) };
            let value = joint.home + 0.1 * (other - joint.home);
            text = with_value(&text, &section, key, value);
        }
        let folder = tempfile::tempdir().unwrap();
        let file = drawn.write(folder.path());
        std::fs::write(&file, text).unwrap();
        let config = MachineConfig::read(&file).unwrap();
        let report = check(&config, config.first(), |_| ()).unwrap();
        let of_home = report.findings.iter().filter(|finding| {
            finding.problem.key == "HOME" && finding.problem.section.starts_with("JOINT_")
        });
        let found: Vec<_> = of_home.map(|finding| finding.problem.section.clone()).collect();
        let all = (0..drawn.extra.len()).map(|n| format!("JOINT_{}", first + n));
        assert_eq!(found, all.collect::<Vec<_>>(), "{}: {:?}", drawn.name, report.findings);
    }
}
