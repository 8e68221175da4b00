// SPDX-License-Identifier: GPL-2.0-or-later
//! The module outside real time, as LinuxCNC's draft calls it, beside the one that runs; and the checks of Jacobians
//! that LinuxCNC's test of its own modules makes.

use abi_tests::carrying::carrying;
use abi_tests::geometry::{minus, norm};
use abi_tests::machines::{Hexapod, paper_004, paper_004_pose};
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::outside::{Library, MAX_PARAMS, Outside};
use abi_tests::parallel::Parallel;
use abi_tests::random::{Random, cases};
use abi_tests::stub::PinDir::{In, Out};
use abi_tests::subjects::{Subject, constrained, subjects};
use kinematics::Cause;
use std::process::Command;

/// A share of this of the tool's frame is rounding: forward starts at another pose, and agrees to 1e-10 of the size.
const FRAME: f64 = 1e-9;

/// Returns the parameter `sparm` with every load parameter of a machine but `coordinates`.
fn sparm(machine: &Parallel, more: &[&str]) -> String {
    let given = machine.parameters();
    let own = given.iter().filter(|(name, value)| *name != "coordinates" && !value.is_empty());
    let own = own.map(|(name, value)| format!("{name}={value}"));
    own.chain(more.iter().map(|item| (*item).to_owned())).collect::<Vec<_>>().join("/")
}

fn describe<'a>(library: &'a Library, machine: &Parallel, more: &[&str]) -> Outside<'a> {
    let described = library.describe(Some(machine.coordinates), Some(&sparm(machine, more)));
    described.unwrap_or_else(|code| panic!("{code}: {machine:?}"))
}

/// Returns the description with the values of the pins.
fn live<'a>(library: &'a Library, machine: &Parallel, module: &Module) -> Outside<'a> {
    let mut outside = describe(library, machine, &[]);
    let [x, y, _] = machine.tool;
    outside.refresh(module, [x, y]);
    outside
}

/// Returns the machines that a block can represent.
fn machines() -> Vec<Subject> {
    let mut all = subjects();
    all.extend(constrained());
    all.retain(|subject| subject.name != "exechon");
    let offsets = Hexapod { tool_offset: 80.0, spindle_offset: -12.5, ..paper_004() };
    let (name, machine) = ("hexapod with both offsets", offsets.into());
    all.push(Subject { name, machine, sample: paper_004_pose });
    all
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// Runs the program `outside`, whose process has no HAL.
fn without_hal(arguments: &[&str]) -> (bool, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_outside"))
        .args(arguments)
        .env("PKMKINS_SO", abi_tests::module::pkmkins_path())
        .output()
        .expect("the program starts");
    let text = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
    (output.status.success(), text)
}

#[test]
fn a_program_without_hal_has_the_module_described() {
    let (_, text) = without_hal(&[]);
    assert_eq!(text, "96 parameters, 2 types, 6 joints, inverse: Err(-70)\n");
    let (_, text) = without_hal(&["ZAB", "legs=slider:4/table=XY"]);
    assert_eq!(text, "67 parameters, 1 types, 6 joints, inverse: Err(-70)\n");
    for (arguments, reason) in [
        (&["XYZABC", "leg=strut:6"][..], "sparm=leg=strut:6: sparm= must be identityfirst and"),
        (&["XYZABC", "rubbish"], "sparm= must be identityfirst and load parameters"),
        (&["XYZQ"], "coordinates=XYZQ sparm=: coordinates= must be letters"),
        (&["XYZABC", "coordinates=XYZ"], "given twice with different values"),
        (&["XYZABC", "legs=crank:8"], "the machine has 133 parameters, but a block has 96"),
        (
            &["XYZ", "legs=strut:3/constraints=4"],
            "the machine has 100 parameters, but a block has 96",
        ),
        (
            &["XYZB", "legs=slider:4/second=slider:3/second_coordinates=XYZ"],
            "a block has one pose and one tool, but second= has a second mechanism",
        ),
    ] {
        let (is_described, text) = without_hal(arguments);
        assert!(!is_described && text.contains(reason), "{arguments:?}: {text}");
    }
}

#[test]
fn the_table_has_the_pins_with_their_types_and_defaults() {
    for subject in machines() {
        let (library, module) = (Library::open().unwrap(), subject.machine.loaded());
        let outside = describe(&library, &subject.machine, &[]);
        let (prefix, pins) = (outside.prefix(), module.pins());
        let parameters = outside.parameters();
        assert!(parameters.len() <= MAX_PARAMS);
        for parameter in &parameters {
            let name = format!("{prefix}.{}", parameter.name);
            let pin = pins.iter().find(|pin| pin.name == name);
            let pin = pin.unwrap_or_else(|| panic!("{}: no pin {name}", subject.name));
            let direction = if parameter.name == "kinematics-hash" { Out } else { In };
            assert_eq!((pin.kind, pin.dir), (parameter.kind, direction), "{name}");
            assert_eq!(pin.get().to_bits(), parameter.default.to_bits(), "{name}");
            assert_eq!(parameter.is_tool, parameter.name == "tool-offset", "{name}");
        }
        assert_eq!(outside.counts()[1] as usize, subject.machine.joints());
        assert_eq!(outside.flags(0), [true, false, true, false]);
        if outside.counts()[0] == 2 {
            assert_eq!(outside.flags(1), [false, true, false, false]);
        }
    }
}

/// A million poses in all with PKMKINS_CASES=8.
#[test]
fn inverse_gives_the_bits_of_the_module() {
    for subject in machines() {
        let (library, module) = (Library::open().unwrap(), subject.machine.module());
        let mut outside = live(&library, &subject.machine, &module);
        let mut random = Random::new(31);
        for _ in 0..cases(10_000) {
            let pose = (subject.sample)(&mut random);
            let ours = module.inverse(&pose).expect("a pose of the workspace");
            let found = outside.inverse(0, &pose).unwrap_or_else(|code| panic!("{code}"));
            assert_eq!(bits(&found), bits(&ours), "{}: {pose:?}", subject.name);
        }
    }
}

#[test]
fn forward_jacobian_and_frames_are_those_of_the_module() {
    for subject in machines() {
        let (library, module) = (Library::open().unwrap(), subject.machine.module());
        let mut outside = live(&library, &subject.machine, &module);
        let mut random = Random::new(32);
        let home = subject.home();
        // Neither has a seed at first.
        let (mut last, mut compared) = ([0.0; 9], 0);
        let all = cases(1000);
        for _ in 0..all {
            // Between the last pose and another one of the workspace, which is convex.
            let (other, share) = ((subject.sample)(&mut random), random.between(0.0, 0.05));
            let from = if compared == 0 { home } else { last };
            let pose: Pose = std::array::from_fn(|k| from[k] + share * (other[k] - from[k]));
            let joints = module.inverse(&pose).expect("a pose of the workspace");
            let Ok(ours) = module.follow(&joints, &home) else { continue };
            let found = outside.forward(0, &joints, &last);
            assert_eq!(found.map(|p| bits(&p)), Ok(bits(&ours)), "{}: {pose:?}", subject.name);
            last = ours;
            compared += 1;
            let ours = module.jacobian(&joints, &pose).expect("a regular pose");
            let found = outside.jacobian(0, &joints, &pose).expect("a regular pose");
            assert_eq!(bits(found.as_flattened()), bits(ours.as_flattened()), "{}", subject.name);
            let ours = [module.tool_frame(&joints), module.work_frame(&joints)];
            let found = outside.frames(0, &joints).expect("the same pose");
            for (found, ours) in found.iter().zip(ours.map(|frame| frame.expect("a pose"))) {
                for (found, ours) in found.iter().zip(&ours) {
                    let off = norm(minus(*found, *ours));
                    assert!(off <= FRAME, "{}: {found:?} is not {ours:?}", subject.name);
                }
            }
        }
        // The module alone follows the commanded pose, and refuses some.
        assert!(10 * compared > 9 * all, "{}: {compared} of {all}", subject.name);
    }
}

#[test]
fn forward_needs_no_seed_where_the_reference_pose_leads_to_the_joints() {
    for subject in machines() {
        let (library, module) = (Library::open().unwrap(), subject.machine.module());
        let mut outside = live(&library, &subject.machine, &module);
        let mut random = Random::new(33);
        for n in 0..cases(100) {
            let pose = (subject.sample)(&mut random);
            let joints = module.inverse(&pose).expect("a pose of the workspace");
            for seed in [[0.0; 9], [f64::NAN; 9], [1e9; 9]] {
                outside.scratch = outside.another().scratch;
                let found = outside.forward(0, &joints, &seed);
                let found = found.unwrap_or_else(|code| panic!("{}: {code}", subject.name));
                let far = norm(minus([found[0], found[1], found[2]], [pose[0], pose[1], pose[2]]));
                assert!(far <= 1e-9 * subject.machine.size(), "{} {n}: {far}", subject.name);
            }
        }
    }
}

#[test]
fn axes_that_carry_are_in_the_block_where_they_fit() {
    let mut random = Random::new(34);
    let (mut same, mut refused) = (0, 0);
    // Beside constraints, few axes may carry something.
    let free = |subject: &Subject| subject.machine.constraints.is_empty();
    for subject in machines().into_iter().filter(free) {
        for _ in 0..cases(20) {
            let carrying = carrying(&subject, &mut random);
            let (library, module) = (Library::open().unwrap(), carrying.module());
            let axes = format!("axes={}", carrying.letters());
            let mut outside = describe(&library, &carrying.machine, &[&axes]);
            let [x, y, _] = carrying.machine.tool;
            outside.refresh(&module, [x, y]);
            let chain = carrying.chain();
            let has_chain = outside.parameters().iter().any(|p| p.name.starts_with("chain."));
            for _ in 0..5 {
                let pose = (subject.sample)(&mut random);
                let world = carrying.world(&pose, &chain, &mut random);
                let ours = module.inverse(&world).map(|joints| bits(&joints));
                let found = outside.inverse(0, &world).map(|joints| bits(&joints));
                if found == Err(Cause::NoGeometry.code()) {
                    assert!(!has_chain, "{}", subject.name);
                    refused += 1;
                    continue;
                }
                assert_eq!(found, ours, "{}: {world:?}", subject.name);
                same += 1;
            }
        }
    }
    assert!(same > 0 && refused > 0, "{same} the same, {refused} refused");
}

#[test]
fn the_identity_is_that_of_the_module() {
    let mut seen = 0;
    for subject in machines() {
        let (library, module) = (Library::open().unwrap(), subject.machine.module());
        let mut outside = live(&library, &subject.machine, &module);
        if outside.counts()[0] == 1 {
            assert_ne!(module.switch(1), 0, "{}", subject.name);
            continue;
        }
        seen += 1;
        assert_eq!(module.switch(1), 0, "{}", subject.name);
        let mut random = Random::new(35);
        for _ in 0..cases(100) {
            let mut pose = (subject.sample)(&mut random);
            let ours = module.inverse(&pose).expect("letters");
            let joints = outside.inverse(1, &pose).expect("letters");
            assert_eq!(bits(&joints), bits(&ours), "{}", subject.name);
            let mut world = [7.0; 9];
            assert_eq!(module.forward_into(&joints, &mut world), 0);
            assert_eq!(outside.forward(1, &joints, &[7.0; 9]), Ok(world), "{}", subject.name);
            let ours = module.jacobian(&joints, &pose);
            assert_eq!(outside.jacobian(1, &joints, &pose), ours, "{}", subject.name);
            let unit = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            assert_eq!(outside.frames(1, &joints), Ok([unit; 2]));
            pose[random.between(0.0, 6.0) as usize] = f64::NAN;
            assert_eq!(outside.inverse(1, &pose), Err(Cause::PoseNotFinite.code()));
        }
    }
    assert!(seen > 3, "{seen}");
    let library = Library::open().unwrap();
    let first = library.describe(None, Some("identityfirst")).unwrap();
    assert_eq!([0, 1].map(|kind| first.flags(kind)[1]), [true, false]);
}

#[test]
fn a_block_that_is_not_the_machine_in_force_is_refused() {
    const REFUSED: Result<Joints, i32> = Err(Cause::NoGeometry.code());
    let machine = Parallel::from(paper_004());
    let (library, module) = (Library::open().unwrap(), machine.loaded());
    let mut outside = describe(&library, &machine, &[]);
    let pose = paper_004_pose(&mut Random::new(36));
    // Nothing is frozen yet.
    machine.wire(&module);
    outside.refresh(&module, [0.0; 2]);
    assert_eq!(outside.inverse(0, &pose), REFUSED);
    module.apply();
    assert_eq!(outside.inverse(0, &pose), REFUSED, "the values before");
    outside.refresh(&module, [0.0; 2]);
    assert_eq!(outside.inverse(0, &pose), Ok(module.inverse(&pose).unwrap()));
    // Pins that the module has not frozen, even those that its geometry hash does not contain.
    for pin in ["base.3.x", "platform.0.z", "offset.2", "spindle-offset", "home.z", "lead.1"] {
        let value = module.get(pin);
        module.set(pin, value + 1.0);
        outside.refresh(&module, [0.0; 2]);
        assert_eq!(outside.inverse(0, &pose), REFUSED, "{pin}");
        assert!(outside.forward(0, &[500.0; 16], &pose).is_err(), "{pin}");
        assert!(outside.jacobian(0, &[0.0; 16], &pose).is_err(), "{pin}");
        assert!(outside.frames(0, &[500.0; 16]).is_err(), "{pin}");
        assert_eq!(outside.inverse(1, &pose), REFUSED, "{pin}");
        assert!(outside.forward(1, &[500.0; 16], &pose).is_err(), "{pin}");
        module.set(pin, value);
    }
    // The center does not fit in a hexapod's table, and is in the hash.
    module.set("centre.z", 5.0);
    module.apply();
    outside.refresh(&module, [0.0; 2]);
    assert_eq!(outside.inverse(0, &pose), REFUSED);
    module.set("centre.z", 0.0);
    module.apply();
    outside.refresh(&module, [0.0; 2]);
    assert!(outside.inverse(0, &pose).is_ok());
    outside.block.size -= 8;
    assert_eq!(outside.inverse(0, &pose), REFUSED, "another layout");
    // A module that was loaded with more than the description has: the axis has no pin in the table.
    let more = machine.loaded_with(&[("axes", "W")]);
    assert!(machine.apply(&more));
    let mut less = outside.another();
    less.block.size += 8;
    less.refresh(&more, [0.0; 2]);
    assert_eq!(less.inverse(0, &pose), REFUSED, "axes=W is missing in sparm=");
    let own = Library::open().unwrap();
    let mut with = describe(&own, &machine, &["axes=W"]);
    with.refresh(&more, [0.0; 2]);
    let world = [pose[0], pose[1], pose[2], pose[3], pose[4], pose[5], 0.0, 0.0, 42.0];
    assert_eq!(with.inverse(0, &world), Ok(more.inverse(&world).unwrap()));
}

/// The module fixes the folds of its nut corrections at the first pose, which the block does not have.
#[test]
fn a_lead_without_a_reference_pose_is_refused() {
    let pose = paper_004_pose(&mut Random::new(37));
    for (lead, expected) in [(10.0, Some(Cause::FoldUndefined)), (0.0, None)] {
        let machine = Parallel::from(Hexapod { home: None, lead, ..paper_004() });
        let (library, module) = (Library::open().unwrap(), machine.module());
        let mut outside = live(&library, &machine, &module);
        let found = outside.inverse(0, &pose);
        assert_eq!(found.err(), expected.map(Cause::code), "lead {lead}");
    }
}

#[test]
fn a_copy_of_the_module_describes_one_machine() {
    let library = Library::open().unwrap();
    let first = library.describe(None, None).unwrap();
    let again = library.describe(Some("xyzabc"), Some("legs=strut:3,strut:3")).unwrap();
    assert_eq!(first.table(), again.table());
    let before = first.parameters();
    assert!(library.describe(Some("XYZ"), Some("legs=slider:3")).is_err());
    assert_eq!(first.parameters().len(), before.len());
    // A refused machine leaves the copy free for another.
    let library = Library::open().unwrap();
    assert!(library.describe(None, Some("legs=crank:8")).is_err());
    assert_eq!(library.describe(Some("XYZ"), Some("legs=slider:3")).unwrap().counts(), [2, 3]);
}

#[test]
fn callers_in_several_threads_do_not_disturb_each_other() {
    for round in 0..cases(50) {
        let library = Library::open().unwrap();
        let tables: Vec<usize> = std::thread::scope(|scope| {
            let describes = || library.describe(None, None).map(|described| described.table());
            let threads: Vec<_> = (0..4).map(|_| scope.spawn(describes)).collect();
            threads.into_iter().map(|thread| thread.join().unwrap().expect("described")).collect()
        });
        assert!(tables.iter().all(|table| *table == tables[0]), "{round}: {tables:?}");
    }
    let machine = Parallel::from(paper_004());
    let (library, module) = (Library::open().unwrap(), machine.module());
    let outside = live(&library, &machine, &module);
    let poses = |seed| {
        let mut random = Random::new(seed);
        (0..cases(2000)).map(|_| paper_004_pose(&mut random)).collect::<Vec<Pose>>()
    };
    let expected = [38, 39].map(|seed| {
        poses(seed).iter().map(|pose| module.inverse(pose).unwrap()).collect::<Vec<Joints>>()
    });
    std::thread::scope(|scope| {
        for (seed, expected) in [38, 39].into_iter().zip(&expected) {
            let mut caller = outside.another();
            scope.spawn(move || {
                for (pose, joints) in poses(seed).iter().zip(expected) {
                    assert_eq!(caller.inverse(0, pose).as_ref(), Ok(joints));
                    let found = caller.forward(0, joints, pose).expect("its own joints");
                    assert!((0..3).all(|k| (found[k] - pose[k]).abs() < 1e-7), "{found:?}");
                }
            });
        }
    });
}

// ---------------------------------------------------------------- LinuxCNC's checks of Jacobians

/// Steps of LinuxCNC's checker: of a joint, and of a pose coordinate.
const JOINT_STEP: f64 = 1e-5;
const POSE_STEP: f64 = 2e-3;

/// LinuxCNC's checker compares with 1e-6. Of a difference over 2e-5 of a joint, forward's 1e-13 of the largest machine
/// (1400 mm) is 7e-6, and rows have derivatives up to 30.
const BY_FORWARD: f64 = 1e-4;
/// The checker's own number.
const BY_INVERSE: f64 = 1e-6;

#[test]
fn the_jacobian_passes_the_checks_of_linuxcnc() {
    for subject in machines() {
        let (library, module) = (Library::open().unwrap(), subject.machine.module());
        let mut outside = live(&library, &subject.machine, &module);
        let mut random = Random::new(40);
        for _ in 0..cases(50) {
            check_jacobian(&subject, &mut outside, &(subject.sample)(&mut random));
        }
    }
}

fn check_jacobian(subject: &Subject, outside: &mut Outside<'_>, pose: &Pose) {
    let (name, count) = (subject.name, subject.machine.joints());
    let joints = outside.inverse(0, pose).expect("a pose of the workspace");
    let pose = outside.forward(0, &joints, pose).expect("its own joints");
    let found = outside.jacobian(0, &joints, &pose).expect("a regular pose");
    assert!(found[count..].iter().all(|row| *row == [0.0; 9]), "{name}: rows beyond the joints");
    // The joints of more legs than coordinates cannot change one by one: LinuxCNC checks a gantry by inverse alone.
    let moved = (0..6).filter(|k| subject.machine.moves(*k)).count();
    for joint in (0..count).filter(|_| moved == count) {
        let mut side = |sign: f64| {
            let mut changed = joints;
            changed[joint] += sign * JOINT_STEP;
            outside.forward(0, &changed, &pose).expect("a joint value nearby")
        };
        let (low, high) = (side(-1.0), side(1.0));
        for (n, row) in found.iter().take(count).enumerate() {
            let columns = row.iter().zip(high.iter().zip(&low));
            let product: f64 =
                columns.map(|(value, (high, low))| value * (high - low) / (2.0 * JOINT_STEP)).sum();
            let unit = f64::from(u8::from(n == joint));
            assert!((product - unit).abs() <= BY_FORWARD, "{name} [{n}][{joint}]: {product}");
        }
    }
    for letter in 0..9 {
        let mut side = |sign: f64| {
            let mut changed = pose;
            changed[letter] += sign * POSE_STEP;
            outside.inverse(0, &changed)
        };
        let sides = [side(-1.0), side(1.0)];
        let [Ok(low), Ok(high)] = sides else {
            // A letter that no joint moves cannot have the value that the checker tries.
            let held = [Cause::HeldX, Cause::HeldY, Cause::HeldZ, Cause::HeldA, Cause::HeldB];
            let held = match subject.machine.constraints.is_empty() {
                true => *held.get(letter).unwrap_or(&Cause::HeldC),
                false => Cause::DependentGiven,
            };
            assert!(letter < 6 && !subject.machine.moves(letter), "{name}: letter {letter}");
            assert_eq!(sides, [Err(held.code()); 2], "{name}: letter {letter}");
            continue;
        };
        for (n, row) in found.iter().take(count).enumerate() {
            let by_inverse = (high[n] - low[n]) / (2.0 * POSE_STEP);
            let off = (by_inverse - row[letter]).abs();
            let most = BY_INVERSE * (1.0 + by_inverse.abs());
            assert!(off <= most, "{name} [{n}][{letter}]: {} is not {by_inverse}", row[letter]);
        }
    }
}

// ---------------------------------------------------------------- caps of a segment

const PERIOD: f64 = 1e-3;
const LENGTH: f64 = 200.0;
const SAMPLES: usize = 33;

fn line(s: f64) -> Pose {
    [-100.0 + s, 40.0, 120.0 + 0.6 * s, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}

fn tilting(s: f64) -> Pose {
    [-50.0 + 0.25 * s, 0.0, 250.0, -15.0 + 0.15 * s, 10.0 - 0.1 * s, 0.0, 0.0, 0.0, 0.0]
}

/// Returns the largest speed on a path at which no joint exceeds `most`, as the draft finds it: from the Jacobian
/// along the tangent at samples, and a share for what lies between them.
fn cap(outside: &mut Outside<'_>, path: impl Fn(f64) -> Pose, most: f64) -> f64 {
    let step = LENGTH / (SAMPLES - 1) as f64;
    let rates: Vec<[f64; 6]> = (0..SAMPLES)
        .map(|k| {
            let (s, pose) = (k as f64 * step, path(k as f64 * step));
            let (low, high) = ((s - step / 8.0).max(0.0), (s + step / 8.0).min(LENGTH));
            let joints = outside.inverse(0, &pose).expect("on the path");
            let rows = outside.jacobian(0, &joints, &pose).expect("on the path");
            let (low_pose, high_pose) = (path(low), path(high));
            let tangent = |a: usize| (high_pose[a] - low_pose[a]) / (high - low);
            std::array::from_fn(|n| (0..9).map(|a| rows[n][a] * tangent(a)).sum())
        })
        .collect();
    let bulge = |n: usize, k: usize| {
        let middle = k.clamp(1, SAMPLES - 2);
        let near = middle.saturating_sub(1).max(1)..=(middle + 1).min(SAMPLES - 2);
        let second = |k: usize| rates[k + 1][n] - 2.0 * rates[k][n] + rates[k - 1][n];
        near.map(|k| second(k).abs() / 8.0).fold(0.0, f64::max)
    };
    let fastest = (0..SAMPLES).flat_map(|k| (0..6).map(move |n| (k, n)));
    let fastest = fastest.map(|(k, n)| rates[k][n].abs() + bulge(n, k)).fold(0.0, f64::max);
    most / fastest
}

/// Returns the largest speed that the guard allows on a path.
fn guarded(module: &Module, path: impl Fn(f64) -> Pose, feed: f64) -> f64 {
    let speed = 0.2 * feed;
    let mut least = 1.0_f64;
    let mut s = 0.0;
    module.set("requested-vel", feed);
    while s < LENGTH {
        module.set("current-vel", speed);
        module.set("distance-to-go", LENGTH - s);
        let joints = module.inverse(&path(s)).expect("on the path");
        module.follow(&joints, &path(0.0)).expect("its own joints");
        module.inverse(&path(s)).expect("on the path");
        module.monitor();
        least = least.min(module.get("feed-scale"));
        s += speed * PERIOD;
    }
    least * feed
}

/// The guard keeps a margin of two per cent to the joints' limits (SPEED_SHARE in the core), which the draft does not.
#[test]
fn the_drafts_cap_of_a_segment_is_the_guards_within_two_per_cent() {
    const MARGIN: f64 = 0.98;
    type Path = fn(f64) -> Pose;
    for (name, path) in [("line", line as Path), ("tilting", tilting)] {
        for most in [20.0, 80.0] {
            let machine = Parallel::from(paper_004());
            let (library, module) = (Library::open().unwrap(), machine.module());
            for n in 0..6 {
                module.set(&format!("max-velocity.{n}"), most);
            }
            let cap = cap(&mut live(&library, &machine, &module), path, most);
            let allowed = guarded(&module, path, 1.5 * cap);
            println!("{name}, {most}: cap {cap:.3}, guard {allowed:.3}");
            let ratio = allowed / (MARGIN * cap);
            assert!((ratio - 1.0).abs() <= 0.02, "{name}, {most}: {allowed} and {cap}");
        }
    }
}
