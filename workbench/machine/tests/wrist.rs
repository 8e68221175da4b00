// SPDX-License-Identifier: GPL-2.0-or-later
//! Moves of a machine with constraints whose axes carry the tool: every pose that the core computes on a move is in the
//! move's enclosure, and no move is proved on which the core refuses a pose.

use kinematics::{Cause, Fault, Pose, Vector3, World};
use machine::proof::reach::Reach;
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use machine::read::mechanism::Mechanism;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use test_support::shipped::ini;

/// Rounding of positions of a machine of about a meter, mm; of angles the same in degrees.
const ROUNDING: f64 = 1e-9;

/// Returns a machine with axes that carry its tool, whose directions are askew and which do not meet.
fn with_wrist(machine: &str, axes: &str, carries: &str) -> Mechanism {
    let text = std::fs::read_to_string(ini(machine)).unwrap();
    let old = text.lines().find(|line| line.starts_with("JOINTS =")).unwrap();
    let joints: usize = old["JOINTS = ".len()..].trim().parse().unwrap();
    let letters = text.lines().find(|line| line.starts_with("COORDINATES =")).unwrap();
    let mut made = text
        .replacen(" constraints=", &format!(" axes={axes} constraints="), 1)
        .replacen(old, &format!("JOINTS = {}", joints + axes.len()), 1)
        .replacen(letters, &format!("{letters}{axes}"), 1);
    for (n, letter) in axes.chars().enumerate() {
        let (axis, point) = match n {
            0 => ("1 0 0.1", "POINT = 5 -10 80\n"),
            _ => ("0 2 0", "POINT = 0 12 120\n"),
        };
        let (kind, point) = match "ABC".contains(letter) {
            true => ("ANGULAR", point),
            false => ("LINEAR", ""),
        };
        let limits = "MIN_LIMIT = -90\nMAX_LIMIT = 90\nMAX_VELOCITY = 60\nMAX_ACCELERATION = 150\n";
        made += &format!(
            "\n[CHAIN_{letter}]\nCARRIES = {carries}\nAXIS = {axis}\n{point}\
             [AXIS_{letter}]\nTYPE = {kind}\n{limits}[JOINT_{}]\nTYPE = {kind}\nHOME = 0\n{limits}",
            joints + n
        );
    }
    let made = Ini::parse(&ini(machine), &made).unwrap();
    let config = MachineConfig::leniently(&made, Some(Lenient::Constraints)).unwrap();
    config.mechanism(1).unwrap()
}

/// Machines, the letters of their axes, what these carry, and whether A and B tilt the platform.
const MACHINES: [(&str, &str, &str, bool); 6] = [
    ("tricept", "AB", "TOOL", false),
    ("exechon", "CA", "TOOL", false),
    ("tricept", "UA", "TOOL", false),
    ("z3-head", "CU", "TOOL", true),
    ("z3-head", "C", "WORK", true),
    ("exechon", "CV", "LEGS", false),
];

/// Returns a straight path of LinuxCNC's pose: its center and half of its motion.
fn path(
    config: &Mechanism,
    rng: &mut Pcg64,
    [far, long]: [f64; 2],
    (axes, tilts): (&str, bool),
) -> [World; 2] {
    let mut middle: World = std::array::from_fn(|k| config.home.get(k).copied().unwrap_or(0.0));
    let mut step = [0.0; 9];
    for k in 0..3 {
        middle[k] += rng.random_range(-1.0..1.0) * far * 250.0;
        step[k] = rng.random_range(-1.0..1.0) * long * 100.0;
    }
    for k in (3..5).filter(|_| tilts) {
        middle[k] = rng.random_range(-1.0..1.0) * far * 15.0;
        step[k] = rng.random_range(-1.0..1.0) * long * 8.0;
    }
    for letter in axes.chars() {
        let k = "XYZABCUVW".find(letter).unwrap();
        middle[k] = rng.random_range(-1.0..1.0) * far * 60.0;
        step[k] = rng.random_range(-1.0..1.0) * long * 40.0;
    }
    [middle, step]
}

fn tool(rng: &mut Pcg64) -> Vector3<f64> {
    let mut value = |low: f64, high: f64| rng.random_range(low..high);
    Vector3::new(value(-20.0, 20.0), value(-20.0, 20.0), value(0.0, 120.0))
}

fn at(path: &[World; 2], s: f64) -> World {
    std::array::from_fn(|k| path[0][k] + s * path[1][k])
}

#[test]
fn poses_of_a_move_are_in_its_enclosure_which_shrinks_with_the_square_of_its_length() {
    let mut rng = Pcg64::seed_from_u64(60);
    for (machine, axes, carries, tilts) in MACHINES {
        let config = with_wrist(machine, axes, carries);
        let reach = Reach::new(&config).unwrap();
        let (mut enclosed, mut compared) = (0, 0);
        for _ in 0..40 {
            let [middle, whole] = path(&config, &mut rng, [1.0, 0.2], (axes, tilts));
            let tool = tool(&mut rng);
            let mut widths = vec![];
            for share in [1.0, 0.1, 0.01] {
                let step = whole.map(|value| share * value);
                let Ok(found) = reach.enclosure(&middle, &step, &tool) else { break };
                let Some(steps) = found.steps else {
                    assert!(share > 0.05, "{machine}: nothing is proved about {middle:?}");
                    continue;
                };
                enclosed += usize::from(share == 1.0);
                for n in -10..=10 {
                    let s = f64::from(n) / 10.0;
                    let world = at(&[middle, step], s);
                    let own = config.machine.pose_of_world(&config.chain, &world, &tool);
                    let own = own.expect("the solution exists in the enclosure");
                    let off = |k: usize| (own[k] - found.middle[k] - s * steps[0][k]).abs();
                    for k in 0..3 {
                        assert!(
                            off(k) <= steps[k + 1][k] + ROUNDING,
                            "{machine}: {s} {k} {}",
                            off(k)
                        );
                    }
                    assert!((3..6).all(|k| off(k) < ROUNDING), "{machine}: {s}");
                    compared += 1;
                }
                widths.push((0..3).map(|k| steps[k + 1][k]).fold(0.0, f64::max));
            }
            // A tenth of the length: a hundredth of the deviation, twice that where higher orders count.
            for pair in widths.windows(2) {
                assert!(pair[1] < 0.02 * pair[0] + ROUNDING, "{machine}: {widths:?}");
            }
        }
        assert!(enclosed > 10 && compared > 500, "{machine}: {enclosed} {compared}");
    }
}

/// Proves a move, from its start and its motion, as preflight does.
fn connected(
    reach: &Reach,
    [from, delta]: &[World; 2],
    tool: &Vector3<f64>,
) -> Result<(), (f64, Fault)> {
    reach.refuse_unconnected(|share, half| {
        let world = at(&[*from, *delta], share);
        let found = reach.enclosure(&world, &delta.map(|value| half * value), tool)?;
        Ok(found.steps.map(|steps| (found.middle, steps.to_vec())))
    })?;
    reach.refuse_unconnected_tip(from, delta, tool)
}

#[test]
fn a_move_on_which_the_core_refuses_a_pose_or_changes_the_solution_is_never_proved() {
    let mut rng = Pcg64::seed_from_u64(61);
    for (machine, axes, carries, tilts) in MACHINES {
        let config = with_wrist(machine, axes, carries);
        let mut proved = 0;
        for n in 0..24 {
            // Some of them far beyond the limits of the axes.
            let far = if n % 2 == 0 { 1.0 } else { 2.5 };
            let [middle, step] = path(&config, &mut rng, [far, far], (axes, tilts));
            let (tool, from) = (tool(&mut rng), at(&[middle, step], -1.0));
            let delta = step.map(|value| 2.0 * value);
            let reach = Reach::with_tool(&config, tool).unwrap();
            let connected = connected(&reach, &[from, delta], &tool);
            let platform = |share: f64| {
                let world = at(&[from, delta], share);
                let own = config.machine.pose_of_world(&config.chain, &world, &tool)?;
                let own = Pose::from_degrees(own);
                let full = config.machine.full_pose(&own, &config.chain.machine_tool(&tool))?;
                Ok::<_, Fault>(full.rotation())
            };
            match connected {
                Err((share, _)) => assert!((0.0..=1.0).contains(&share)),
                Ok(()) => {
                    proved += 1;
                    let mut before = None;
                    for k in 0..=1000 {
                        let now = platform(f64::from(k) / 1000.0);
                        let now = now.unwrap_or_else(|fault| panic!("{machine}: {k} {fault}"));
                        if let Some(rotation) = before.replace(now) {
                            // A thousandth of a move; another solution is a quarter turn away or more.
                            let turned = (now - rotation).norm();
                            assert!(turned < 0.3, "{machine}: {k} {turned}");
                        }
                    }
                }
            }
        }
        assert!(proved >= 10, "{machine}: {proved}");
    }
}

/// On the axis of the base joint the platform does not turn, so that it passes through the joint as the tip moves straight.
#[test]
fn a_move_of_the_tip_that_leads_the_platform_through_a_constraint_singularity_is_refused_there() {
    let config = with_wrist("tricept", "AB", "TOOL");
    let reach = Reach::new(&config).unwrap();
    let tool = Vector3::new(5.0, -3.0, 60.0);
    let mut from = [0.0; 9];
    (from[3], from[4]) = (20.0, -10.0);
    let below = [0.0, 0.0, -300.0, 0.0, 0.0, 0.0];
    config.machine.write_world(&config.chain, &below, &mut from, &tool).unwrap();
    let mut delta = [0.0; 9];
    delta[2] = -400.0;
    assert_eq!(connected(&reach, &[from, delta], &tool), Ok(()));
    delta[2] = 600.0;
    let (share, fault) = connected(&reach, &[from, delta], &tool).unwrap_err();
    // The core refuses it slightly before, too.
    assert!((share - 0.5).abs() < 0.01, "{share} {fault}");
    assert_eq!(fault.cause, Cause::ConstraintSingular);
}
