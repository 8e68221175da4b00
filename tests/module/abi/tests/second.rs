// SPDX-License-Identifier: GPL-2.0-or-later
//! With two mechanisms, each is guarded, jogged, corrected and given tools as if alone, cycle by cycle: the pins of a
//! module with both equal those of modules with one, under the names of the second mechanism or its higher numbers.

use abi_tests::module::{Joints, Module, Pose};
use abi_tests::pair::{Two, pairs};
use abi_tests::random::{Random, cases};
use abi_tests::stub::PinDir;

/// Pins of joints; all other numbered pins are of legs.
const OF_JOINTS: [&str; 10] = [
    "min-limit",
    "max-limit",
    "max-velocity",
    "max-acceleration",
    "margin",
    "speed-ratio",
    "joint-correction",
    "correction-limit",
    "correction-rate",
    "joint-correction-eff",
];

/// Pins with a common value for both mechanisms, the hash that contains the load parameters, and the clock of calls.
const OF_BOTH: [&str; 16] = [
    "kinematics-hash",
    "feed-inhibit",
    "feed-scale",
    "limit-soon",
    "limit-leg",
    "limit-reason",
    "jog-stop",
    "jog-scale",
    "tool-busy",
    "geometry-changed",
    "fault",
    "fault-leg",
    "fault-count",
    "version",
    "inverse-time",
    "forward-time",
];

/// A module with both mechanisms, and one with each alone.
struct Beside {
    two: Two,
    both: Module,
    alone: [Module; 2],
}

impl Beside {
    fn new(two: Two) -> Self {
        let both = two.module();
        let alone = [&two.first, &two.second].map(|subject| subject.machine.module());
        Self { two, both, alone }
    }

    /// Returns the name of a single mechanism's pin in the module with both; `None` if that has no such pin.
    fn name(&self, mechanism: usize, pin: &str) -> Option<String> {
        let machine = &self.two.first.machine;
        let own = if mechanism == 0 {
            pin.to_string()
        } else {
            let mut parts: Vec<String> = pin.split('.').map(ToString::to_string).collect();
            let number = parts.get(1).and_then(|part| part.parse::<usize>().ok());
            if let Some(number) = number {
                let is_joint = OF_JOINTS.contains(&parts[0].as_str());
                let first = if is_joint { machine.joints() } else { machine.legs.len() };
                parts[1] = (number + first).to_string();
                parts.join(".")
            } else if self.both.has(&format!("second.{pin}")) {
                format!("second.{pin}")
            } else {
                return None;
            }
        };
        self.both.has(&own).then_some(own)
    }

    /// Sets a pin of one mechanism, in its own module and in the module with both.
    fn set(&self, mechanism: usize, pin: &str, value: f64) {
        self.alone[mechanism].set(pin, value);
        let name = self.name(mechanism, pin).unwrap_or_else(|| panic!("no pin for {pin}"));
        self.both.set(&name, value);
    }

    /// Sets a pin that both mechanisms share.
    fn set_for_both(&self, pin: &str, value: f64) {
        self.alone.iter().chain([&self.both]).for_each(|module| module.set(pin, value));
    }

    /// Runs a cycle at poses of the two; returns false if all modules refuse it.
    fn cycle(&self, poses: &[Pose; 2]) -> bool {
        let world = self.two.world(&poses[0], &poses[1]);
        let run = |module: &Module, pose: &Pose| -> Option<Joints> {
            let joints = module.inverse(pose).ok()?;
            module.follow(&joints, pose).ok()?;
            let again = module.inverse(pose).ok();
            module.monitor();
            again
        };
        let own = [0, 1].map(|i| run(&self.alone[i], &poses[i]));
        let both = run(&self.both, &world);
        let [Some(first), Some(second)] = own else {
            assert!(both.is_none());
            return false;
        };
        assert_eq!(both, Some(self.two.joints(&first, &second)));
        true
    }

    /// Compares all outputs; with `is_at_rest` also those that are updated in other cycles.
    fn compare(&self, what: &str, is_at_rest: bool) {
        let in_turn =
            ["margin", "speed-ratio", "base-angle", "platform-angle", "conditioning", "assembly"];
        let in_turn =
            |pin: &str| in_turn.iter().any(|name| pin.starts_with(name)) || pin.starts_with("rod-");
        for (i, alone) in self.alone.iter().enumerate() {
            let mut seen = 0;
            for pin in alone.pins().iter().filter(|pin| pin.dir == PinDir::Out) {
                let own = pin.name.trim_start_matches("pkmkins.");
                if OF_BOTH.contains(&own) || (in_turn(own) && !is_at_rest) {
                    continue;
                }
                let Some(name) = self.name(i, own) else { continue };
                let first = self.two.first.machine.legs.len() as f64;
                let (found, mut expected) = (self.both.get(&name), pin.get());
                if own.starts_with("rod-pair") && i == 1 && expected >= 0.0 {
                    // By symmetry another pair may have the same distance.
                    let legs = self.two.second.machine.legs.len() as f64;
                    assert!((first..first + legs).contains(&found), "{what}: {name} is {found}");
                    expected = found;
                }
                // Updated in another cycle, from a pose equal up to rounding.
                let is_same = in_turn(own) && (found - expected).abs() <= 1e-9 * expected.abs();
                assert!(
                    found == expected || is_same,
                    "{what}: {name} is {found}, {own} {expected}"
                );
                seen += 1;
            }
            assert!(seen > 10, "{seen} pins of mechanism {i}");
        }
        let [one, other] = [0, 1].map(|i| &self.alone[i]);
        let is_on = |pin: &str| [one, other].map(|module| module.is_on(pin));
        let either = |pin: &str| is_on(pin)[0] || is_on(pin)[1];
        for pin in ["feed-inhibit", "jog-stop", "tool-busy", "limit-soon", "geometry-changed"] {
            assert_eq!(self.both.is_on(pin), either(pin), "{what}: {pin}");
        }
        let scales = [one, other].map(|module| module.get("feed-scale"));
        assert_eq!(self.both.get("feed-scale"), scales[0].min(scales[1]), "{what}");
        assert_eq!(self.both.get("second.feed-scale"), scales[1], "{what}");
        if either("limit-soon") {
            let of = usize::from(!is_on("limit-soon")[0]);
            let reason = self.alone[of].get("limit-reason");
            assert_eq!(self.both.get("limit-reason"), reason, "{what}");
            let leg = self.alone[of].get("limit-leg");
            let machine = &self.two.first.machine;
            let counted = [machine.legs.len(), machine.joints()].map(|first| leg + first as f64);
            let found = self.both.get("limit-leg");
            let is_right =
                if of == 0 || leg < 0.0 { found == leg } else { counted.contains(&found) };
            assert!(is_right, "{what}: {found} of {leg}");
        }
    }
}

/// Sets limits of a mechanism that it sometimes reaches within some tenths of a second about a pose.
fn limit(beside: &Beside, i: usize, pose: &Pose, random: &mut Random) {
    let machine = [&beside.two.first.machine, &beside.two.second.machine][i];
    let (joints, size) = (beside.alone[i].inverse(pose).expect("a pose"), machine.size());
    for n in 0..machine.joints() {
        for (pin, value) in [
            ("min-limit", joints[n] - size * random.between(0.002, 0.1)),
            ("max-limit", joints[n] + size * random.between(0.002, 0.1)),
            ("max-velocity", size * random.between(0.1, 2.0)),
            ("max-acceleration", size * random.between(10.0, 50.0)),
            ("correction-limit", 1e-3 * size * random.between(0.0, 1.0)),
            ("correction-rate", 1e-2 * size * random.between(0.0, 1.0)),
        ] {
            beside.set(i, &format!("{pin}.{n}"), value);
        }
    }
    for n in 0..machine.legs.len() {
        for pin in ["base-cone", "platform-cone"] {
            beside.set(i, &format!("{pin}.{n}"), random.between(30.0, 90.0));
        }
    }
}

#[test]
fn each_of_two_is_guarded_jogged_corrected_and_given_tools_as_alone() {
    let mut random = Random::new(421);
    let mut counts = [0; 4];
    // The same number in a long run: the guard of two combines the angles of both, that of one considers only its own,
    // so that with two joints too fast they may name different ones.
    for case in 0..cases(6).min(6) {
        for (n, two) in pairs().into_iter().enumerate() {
            let what = format!("case {case}, pair {n}");
            let beside = Beside::new(two);
            // Only one moves: then the same acceleration brakes it alone and in the pair.
            let who = random.between(0.0, 2.0) as usize;
            let subjects = [&beside.two.first, &beside.two.second];
            let mut poses = [0, 1].map(|i| (subjects[i].sample)(&mut random));
            let targets = [0, 1].map(|i| (subjects[i].sample)(&mut random));
            for i in 0..2 {
                limit(&beside, i, &poses[i], &mut random);
            }
            let size = subjects[who].machine.size();
            beside.set_for_both("linear-acceleration", size * random.between(1.0, 10.0));
            beside.set_for_both("angular-acceleration", 500.0);
            beside.set_for_both("max-override", random.between(0.5, 2.0));
            beside.set_for_both("tilt-limit", random.between(10.0, 40.0));
            let is_jog = random.between(0.0, 1.0) < 0.5;
            beside.set_for_both("machine-on", 1.0);
            let step: Pose = std::array::from_fn(|k| 1e-3 * (targets[who][k] - poses[who][k]));
            let speed = 1e3 * step[..3].iter().map(|v| v * v).sum::<f64>().sqrt();
            let changes = random.between(0.0, 1.0) < 0.5;
            for cycle in 0..180 {
                let moves = (20..90).contains(&cycle);
                if moves {
                    (0..9).for_each(|k| poses[who][k] += step[k]);
                }
                let asked = if moves && !is_jog { speed } else { 0.0 };
                beside.set_for_both("jogging", f64::from(u8::from(moves && is_jog)));
                beside.set_for_both("requested-vel", asked);
                beside.set_for_both("current-vel", asked);
                beside.set_for_both("distance-to-go", 1e3 * size);
                if cycle == 30 {
                    beside.set(who, "joint-correction.0", 1e-4 * size);
                }
                if cycle == 110 && changes {
                    let tool = beside.alone[who].get("tool-offset");
                    beside.set(who, "tool-offset", tool + 1e-3 * size);
                }
                if !beside.cycle(&poses) {
                    break;
                }
                let [one, other] = &beside.alone;
                let either = |pin: &str| one.is_on(pin) || other.is_on(pin);
                for (count, pin) in
                    counts.iter_mut().zip(["feed-inhibit", "jog-stop", "tool-busy", "limit-soon"])
                {
                    *count += usize::from(either(pin));
                }
                beside.compare(&format!("{what}, cycle {cycle}"), cycle == 109);
            }
        }
    }
    println!("{counts:?} cycles inhibited, jogs stopped, tools changed, limits reported");
    assert!(counts.iter().all(|count| *count > 0), "{counts:?}");
}
