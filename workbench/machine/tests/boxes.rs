// SPDX-License-Identifier: GPL-2.0-or-later
//! Boxes of the shipped configurations: proved, over the whole workspace, and sufficient to
//! find every pose from the joints alone.

use kinematics::{
    Cause, Fault, Joints, MAX_BOX_STEPS, MAX_BOXES, Pose, Progress, STEPS_PER_CALL, Search, Solver,
    Vector3, WorkspaceBox,
};
use machine::proof::boxes::{found, prove as prove_telling};
use machine::proof::choose;
use machine::proof::one_to_one::{Doubt, Prover};
use machine::read::boxes::{self, BoxSection};
use machine::read::mechanism::Mechanism;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::path::Path;
use std::sync::Mutex;
use test_support::shipped::{MACHINES, cases, config};

/// Largest distance between the found pose and the original pose of the joints, as a share of the size:
/// forward stops at 1e-12; conditioning and rounding of the joints are below 1e-9.
const SAME: f64 = 1e-9;

/// Returns a random pose within the axis limits, table letters included; every fifth value is a limit.
fn random_pose(config: &Mechanism, rng: &mut Pcg64) -> Pose {
    let mut pose = [0.0; 6];
    for letter in kinematics::Letter::ALL {
        let (k, axis) = (letter.index(), &config.axes[letter.index()]);
        if !config.machine.layout().is_held(letter) {
            pose[k] = match rng.random_range(0..10) {
                0 => axis.min,
                1 => axis.max,
                _ => axis.min + (axis.max - axis.min) * rng.random::<f64>(),
            };
        }
    }
    Pose::from_degrees(pose)
}

/// Returns the found pose, and the number of calls.
fn searched(
    config: &Mechanism,
    regions: &[WorkspaceBox],
    joints: &Joints,
    tool: &Vector3<f64>,
) -> Result<(Pose, u32), Fault> {
    let mut search = Search::new(joints, regions);
    let steps = regions.iter().map(|region| region.steps).sum::<u32>();
    for calls in 1..=steps.div_ceil(STEPS_PER_CALL) {
        match config.machine.search(search, regions, tool, &Solver::default())? {
            Progress::Searching(next) => search = next,
            Progress::Found(pose) => return Ok((pose, calls)),
        }
    }
    panic!("the search does not end")
}

fn regions(config: &Mechanism) -> Vec<WorkspaceBox> {
    config.boxes.iter().map(|section| section.claim.region).collect()
}

/// Machine whose proof takes 56,905 cells, six seconds of one processor: `cargo xtask boxes` and the long tier make
/// it; otherwise samples replace it.
const DEAR: &str = "hexapod";

#[test]
fn every_shipped_box_is_proved_and_holds_the_whole_workspace() {
    for name in MACHINES {
        let config = config(name);
        assert_eq!(config.boxes.len(), 1, "{name}");
        let section = &config.boxes[0];
        let how = if name == DEAR && cases(1) == 1 { sampled } else { proved };
        let how = how(&config, section).unwrap_or_else(|doubt| panic!("{name}: {doubt}"));
        println!(
            "{name}: contraction {}, at most {} steps, {how}",
            section.claim.contraction, section.claim.region.steps
        );
        for letter in config.machine.layout().coordinates().as_slice() {
            let (k, axis) = (letter.index(), &config.axes[letter.index()]);
            let region = &section.claim.region;
            assert!(region.low[k] < axis.min && axis.max < region.high[k], "{name}: {letter:?}");
        }
    }
}

/// Proves a section; checks that the progress never decreases, and ends with the whole box.
fn prove(config: &Mechanism, section: &BoxSection) -> Result<usize, Doubt> {
    let last = Mutex::new(0.0);
    let cells = prove_telling(config, section, &|share: f64| {
        let mut last = last.lock().unwrap();
        assert!((*last..=1.0 + 1e-9).contains(&share), "{share} after {last}");
        *last = share;
    })?;
    // The tolerance is for rounding of a sum with one share per cell.
    assert!((*last.lock().unwrap() - 1.0).abs() < 1e-15 * cells as f64 + 1e-9);
    Ok(cells)
}

fn proved(config: &Mechanism, section: &BoxSection) -> Result<String, Doubt> {
    Ok(format!("proved with {} cells", prove(config, section)?))
}

/// Checks the numbers of the claim, and its norm at random poses and at faces and corners.
fn sampled(config: &Mechanism, section: &BoxSection) -> Result<String, Doubt> {
    const SAMPLES: usize = 20_000;
    let prover = Prover::new(&config.machine, &config.geometry);
    // Checks what the prover checks before the first cell.
    assert_eq!(section.geometry, config.hash);
    assert_eq!(prover.prove(&section.claim, 0), Err(Doubt::Effort(0)));
    let mut rng = Pcg64::seed_from_u64(40);
    let region = &section.claim.region;
    let mut largest = 0.0_f64;
    for _ in 0..SAMPLES {
        let pose = std::array::from_fn(|k| {
            let share = rng.random_range(-0.5..1.5_f64).clamp(0.0, 1.0);
            region.low[k] + (region.high[k] - region.low[k]) * share
        });
        let norm = prover.norm_at(&section.claim, &pose)?;
        if norm > section.claim.contraction {
            return Err(Doubt::Exceeded(pose, norm));
        }
        largest = largest.max(norm);
    }
    Ok(format!("{largest:.3} in {SAMPLES} samples"))
}

#[test]
fn every_pose_of_the_workspace_is_found_from_its_joints_alone() {
    for name in MACHINES {
        let config = config(name);
        let regions = regions(&config);
        let mut rng = Pcg64::seed_from_u64(41);
        let mut most = 0;
        for _ in 0..cases(1000) {
            let pose = random_pose(&config, &mut rng);
            let tool = Vector3::new(0.1, -0.2, 0.5) * config.machine.radius() * rng.random::<f64>();
            // The workspace is that of the control point without tool.
            let mut tip = pose;
            tip.position += tool - pose.rotation() * tool;
            let joints = config.machine.inverse(&tip, &tool).unwrap();
            let (found, calls) = searched(&config, &regions, &joints, &tool)
                .unwrap_or_else(|fault| panic!("{name}: {pose:?}: {fault}"));
            let off = found.distance(&tip, config.machine.radius());
            assert!(off <= SAME * config.machine.size(), "{name}: {pose:?}: {found:?}");
            most = most.max(calls);
        }
        println!("{name}: at most {most} calls");
    }
}

#[test]
fn joints_of_a_pose_outside_are_refused_with_their_code() {
    for name in MACHINES {
        let config = config(name);
        let regions = regions(&config);
        let mut rng = Pcg64::seed_from_u64(42);
        let mut seen = 0;
        for _ in 0..cases(200) {
            let mut pose = random_pose(&config, &mut rng).to_degrees();
            for letter in config.machine.layout().coordinates().as_slice() {
                let (k, axis) = (letter.index(), &config.axes[letter.index()]);
                if rng.random() {
                    pose[k] = axis.max + (axis.max - axis.min) * (0.01 + 0.2 * rng.random::<f64>());
                }
            }
            let pose = Pose::from_degrees(pose);
            let mut of_legs = pose;
            for letter in config.machine.layout().table().as_slice() {
                of_legs.position[letter.index()] = 0.0;
            }
            if regions.iter().any(|region| region.holds(&of_legs)) {
                continue;
            }
            let Ok(joints) = config.machine.inverse(&pose, &Vector3::zeros()) else { continue };
            match searched(&config, &regions, &joints, &Vector3::zeros()) {
                Err(fault) => assert_eq!(fault.cause, Cause::OutsideBoxes, "{name}: {pose:?}"),
                // Another pose with these joints in the box, which the joints cannot distinguish.
                Ok((found, _)) => {
                    let again = config.machine.inverse(&found, &Vector3::zeros()).unwrap();
                    let off = again.iter().zip(&joints).map(|(a, b)| (a - b).abs());
                    assert!(off.fold(0.0, f64::max) < 1e-6, "{name}: {pose:?}: {found:?}");
                }
            }
            seen += 1;
        }
        assert!(seen > 50, "{name}: {seen}");
    }
}

/// The tripod's joints do not distinguish its pose from its mirror image below the base.
#[test]
fn two_boxes_with_a_pose_each_are_refused_with_their_code() {
    let config = config("tripod");
    let above = config.boxes[0].clone();
    let mut below = above.clone();
    let region = &mut below.claim.region;
    (region.low[2], region.high[2]) = (-above.claim.region.high[2], -above.claim.region.low[2]);
    region.matrix[2] = region.matrix[2].map(|m| -m);
    prove(&config, &below).expect("the mirror image is as good");
    let regions = [above.claim.region, below.claim.region];
    let mut rng = Pcg64::seed_from_u64(43);
    for _ in 0..100 {
        let pose = random_pose(&config, &mut rng);
        let joints = config.machine.inverse(&pose, &Vector3::zeros()).unwrap();
        let fault = searched(&config, &regions, &joints, &Vector3::zeros()).unwrap_err();
        assert_eq!(fault.cause, Cause::TwoPoses);
        // A repeated box is not a second pose.
        let twice = [above.claim.region; 2];
        let found = searched(&config, &twice, &joints, &Vector3::zeros()).unwrap().0;
        assert!(found.distance(&pose, 1.0) < SAME * config.machine.size());
    }
}

#[test]
fn a_claim_that_is_not_true_is_not_proved() {
    let config = config("lab-hexapod");
    let good = &config.boxes[0];
    let refused = |what: &str, change: &dyn Fn(&mut BoxSection)| {
        let mut section = good.clone();
        change(&mut section);
        let doubt = prove(&config, &section).expect_err(what);
        println!("{what}: {doubt}");
        doubt
    };
    let exceeded = |doubt: Doubt| assert!(matches!(doubt, Doubt::Exceeded(..)), "{doubt}");
    exceeded(refused("a contraction below the largest norm", &|s| {
        s.claim.contraction = 0.3;
        s.claim.region.steps = MAX_BOX_STEPS;
    }));
    exceeded(refused("the matrix of a mirrored machine", &|s| {
        s.claim.region.matrix[0] = s.claim.region.matrix[0].map(|m| -m);
    }));
    exceeded(refused("a box with singular poses", &|s| {
        s.claim.region.high[5] = 100.0;
        s.claim.region.steps = MAX_BOX_STEPS;
    }));
    for doubt in [
        refused("too few steps", &|s| s.claim.region.steps -= 1),
        refused("another geometry", &|s| s.geometry ^= 1),
        refused("no contraction", &|s| s.claim.contraction = 1.0),
        refused("a coordinate without width", &|s| s.claim.region.high[3] = s.claim.region.low[3]),
        refused("a weight of 0", &|s| s.claim.weight[0] = 0.0),
    ] {
        assert!(matches!(doubt, Doubt::Malformed(_)), "{doubt}");
    }
    let delta = config_with_reach("linear-delta");
    assert!(matches!(delta, Err(Doubt::Reach(..))), "{delta:?}");
}

/// Proves a box that extends beyond the rods' reach.
fn config_with_reach(name: &str) -> Result<usize, Doubt> {
    let config = config(name);
    let mut claim = config.boxes[0].claim.clone();
    claim.region.high[0] = 400.0;
    claim.region.steps = MAX_BOX_STEPS;
    Prover::new(&config.machine, &config.geometry).prove(&claim, 10_000)
}

#[test]
fn axis_limits_without_boxes_are_refused_with_the_cause_and_the_way_out() {
    let refused = |machine: &str, k: usize, [low, high]: [f64; 2]| {
        let mut config = config(machine);
        (config.axes[k].min, config.axes[k].max) = (low, high);
        found(&config, &|_| ()).unwrap_err().to_string()
    };
    // A turn by more than a quarter passes the pose in which the legs of a hexapod support no turn.
    let singular = refused("hexapod", 5, [-120.0, 120.0]);
    assert!(singular.contains("contain singular poses") && singular.contains(" C"), "{singular}");
    let far = refused("linear-delta", 0, [-80.0, 400.0]);
    assert!(far.contains("cannot reach: at X400.480 Y"), "{far}");
    for text in [singular, far] {
        assert!(text.contains("make the axis limits smaller") && !text.contains("norm"), "{text}");
    }
}

#[test]
fn a_box_is_found_for_a_machine_that_has_none() {
    let config = config("rotary-delta");
    let found = found(&config, &|_| ()).unwrap();
    let [(section, _)] = found.as_slice() else { panic!("{} boxes", found.len()) };
    prove(&config, section).unwrap();
    let letters = config.machine.layout().coordinates().as_slice();
    let text = boxes::text("BOX_0", section, letters, config.legs());
    let path = Path::new("rotary-delta.ini");
    let ini = machine::read::ini::Ini::parse(path, &text).unwrap();
    let load = kinematics::Load::parse(Some(b"crank:3"), Some(b"XYZ"), None);
    let load = load.unwrap().with_boxes(Some(b"1")).unwrap();
    assert_eq!(
        boxes::read(&ini, &load, &config.place, config.hash).unwrap(),
        std::slice::from_ref(section)
    );
}

/// Struts that are nearly in the plane of the base at the lower end, and upright at the upper end.
#[test]
fn what_one_matrix_does_not_cover_is_cut_into_boxes() {
    let config = config("tripod");
    let prover = Prover::new(&config.machine, &config.geometry);
    let (low, high) = ([1.0, -1.0, 0.45, 0.0, 0.0, 0.0], [9.0, 5.0, 8.0, 0.0, 0.0, 0.0]);
    let claims = choose::claims(&prover, low, high, MAX_BOXES).unwrap();
    assert!(claims.len() > 1);
    let volume =
        |low: &[f64; 6], high: &[f64; 6]| (0..3).map(|k| high[k] - low[k]).product::<f64>();
    let sum: f64 = claims.iter().map(|c| volume(&c.region.low, &c.region.high)).sum();
    assert!((sum - volume(&low, &high)).abs() < 1e-9 * sum);
    let regions: Vec<WorkspaceBox> = claims.iter().map(|claim| claim.region).collect();
    let mut rng = Pcg64::seed_from_u64(44);
    for n in 0..500 {
        let share = |k: usize, rng: &mut Pcg64| low[k] + (high[k] - low[k]) * rng.random::<f64>();
        let mut pose: [f64; 6] = std::array::from_fn(|k| share(k, &mut rng));
        if n % 2 == 0 {
            // On a face that two boxes share, or that belongs to one box.
            let region = &regions[n % regions.len()];
            pose[n % 3] = region.high[n % 3];
        }
        let pose = Pose::from_degrees(pose);
        let joints = config.machine.inverse(&pose, &Vector3::zeros()).unwrap();
        let (found, _) = searched(&config, &regions, &joints, &Vector3::zeros())
            .unwrap_or_else(|fault| panic!("{pose:?}: {fault}"));
        assert!(found.distance(&pose, 1.0) < SAME * config.machine.size(), "{pose:?}: {found:?}");
    }
}
