// SPDX-License-Identifier: GPL-2.0-or-later
//! Comparison with LinuxCNC's modules for single kinds of parallel machines, in one
//! process: the same joints and poses if they are right; if they are silently
//! wrong a code, or the right pose.

use abi_tests::geometry::{Vector, cross, distance, dot, unit};
use abi_tests::machines::one_servo_step_from;
use abi_tests::module::{Joints, Module, Pose};
use abi_tests::parallel::Parallel;
use abi_tests::random::{Random, cases};
use abi_tests::subjects::{
    PENTAPOD_BASE, PENTAPOD_RINGS, linear_delta, pentapod, pentapod_pose, pose, rotary_delta,
    three_struts, tripod,
};
use abi_tests::tolerances::{
    INVERSE_REL, PEER_LEAST_DRIVE, PEER_LEAST_VOLUME, ROUND_TRIP_REL, SAME_JOINT_MM, WRONG_REL,
};
use kinematics::Cause;

/// Number of poses per geometry: wiring is more expensive than a pose.
const POSES: usize = 100;

const NAN_JOINTS: Joints = [f64::NAN; 16];

fn at(x: f64, y: f64, z: f64) -> Pose {
    pose([x, y, z, 0.0, 0.0, 0.0])
}

fn joints(values: &[f64]) -> Joints {
    let mut joints = [0.0; 16];
    joints[..values.len()].copy_from_slice(values);
    joints
}

/// Both modules with the same machine.
struct Peer {
    theirs: Module,
    ours: Module,
    machine: Parallel,
    /// Reference of a joint's error: the machine's size, or half a turn.
    unit: f64,
    compared: usize,
    solved: usize,
    refused: usize,
    worst_joint: f64,
    worst_pose: f64,
}

impl Peer {
    fn new(name: &'static str, machine: Parallel) -> Peer {
        let (theirs, ours) = (Module::of_linuxcnc(name), machine.loaded());
        let unit = machine.size();
        let mut peer = Peer {
            theirs,
            ours,
            machine: machine.clone(),
            unit,
            compared: 0,
            solved: 0,
            refused: 0,
            worst_joint: 0.0,
            worst_pose: 0.0,
        };
        peer.take(machine, &[]);
        peer
    }

    /// Sets another machine: `pins` are theirs.
    fn take(&mut self, machine: Parallel, pins: &[(&str, f64)]) {
        for (pin, value) in pins {
            self.theirs.set(pin, *value);
        }
        assert!(machine.apply(&self.ours), "{:?}: {machine:?}", self.ours.messages());
        self.unit = match machine.legs[0].kind.name() {
            "crank" => 180.0,
            _ => machine.size(),
        };
        self.machine = machine;
    }

    /// Compares the joints of both; `None` if ours refuses, which it must if theirs does.
    fn same_joints(&mut self, pose: &Pose) -> Option<Joints> {
        let theirs = self.theirs.inverse(pose);
        let Ok(ours) = self.ours.inverse(pose) else {
            self.refused += 1;
            return None;
        };
        let theirs =
            theirs.unwrap_or_else(|e| panic!("code {e} at {pose:?} of {:?}", self.machine));
        for n in 0..self.machine.joints() {
            let off = (ours[n] - theirs[n]).abs() / self.unit;
            let message = format!("joint {n}: {} is not {}", ours[n], theirs[n]);
            assert!(off <= INVERSE_REL, "{message} at {pose:?} of {:?}", self.machine);
            self.worst_joint = self.worst_joint.max(off);
        }
        self.compared += 1;
        Some(ours)
    }

    /// Compares the poses of both from a servo step away. If theirs is right, ours must agree at once
    /// to the accuracy in README, and, after it has settled in the next cycle, to roundings.
    /// Otherwise ours finds a pose of these joints, or refuses.
    fn same_pose(&mut self, joints: &Joints, pose: &Pose, random: &mut Random) {
        let size = self.machine.size();
        let mut world = one_servo_step_from(pose, size, random);
        if !self.is_regular(joints, pose) {
            // Near a singular pose the seed may be on the side of the joints' other pose.
            if let Ok(found) = self.ours.forward(joints, &world) {
                assert!(self.belong(joints, &found), "{found:?} at {pose:?} of {:?}", self.machine);
            }
            return;
        }
        let theirs = self.theirs.forward(joints, &world).expect("theirs solves");
        for (cycle, allowed) in [ROUND_TRIP_REL, INVERSE_REL].into_iter().enumerate() {
            let found = self.ours.forward(joints, &world);
            world = found.unwrap_or_else(|e| panic!("code {e} at {pose:?} of {:?}", self.machine));
            let off = distance(&world, &self.beside(&theirs, &world), self.machine.radius()) / size;
            let machine = &self.machine;
            assert!(
                off <= allowed,
                "cycle {cycle}: {off} from {theirs:?} to {world:?} of {machine:?}"
            );
            self.worst_pose = if cycle == 1 { self.worst_pose.max(off) } else { self.worst_pose };
        }
        self.solved += 1;
    }

    /// Returns whether a pose has these joints, by our inverse.
    fn belong(&self, joints: &Joints, pose: &Pose) -> bool {
        let off = |own: Joints| (0..3).map(|n| (own[n] - joints[n]).abs()).fold(0.0, f64::max);
        self.ours.inverse(pose).is_ok_and(|own| off(own) <= WRONG_REL * self.unit)
    }

    /// Returns whether the legs are clear of a common plane, on the side assumed by theirs
    /// (rods hang, struts stand), and of their dead points: there theirs is right. More
    /// than three legs are solved by iteration from the seed.
    fn is_regular(&self, joints: &Joints, pose: &Pose) -> bool {
        if self.machine.legs.len() != 3 {
            return true;
        }
        let rods = self.rods(joints, pose);
        // Base joints are counterclockwise: legs that point down span a negative volume.
        let side = if self.machine.legs[0].kind.name() == "strut" { 1.0 } else { -1.0 };
        let volume = side * dot(rods[0], cross(rods[1], rods[2]));
        volume >= PEER_LEAST_VOLUME && self.is_driven(joints, &rods)
    }

    /// Returns their pose in the coordinates that move, ours in the others: theirs ignores or
    /// copies coordinates that it does not have.
    fn beside(&self, theirs: &Pose, ours: &Pose) -> Pose {
        std::array::from_fn(|c| if c < 6 && self.machine.moves(c) { theirs[c] } else { ours[c] })
    }

    /// Returns unit vectors along the three legs.
    fn rods(&self, joints: &Joints, pose: &Pose) -> [Vector; 3] {
        std::array::from_fn(|n| unit(self.machine.span(pose, n, joints[n])))
    }

    /// Returns whether every rod is clear of its dead point.
    fn is_driven(&self, joints: &Joints, rods: &[Vector; 3]) -> bool {
        self.machine.legs.iter().zip(rods).zip(joints).all(|((leg, rod), joint)| {
            leg.motion(*joint).is_none_or(|motion| dot(*rod, motion).abs() >= PEER_LEAST_DRIVE)
        })
    }

    fn report(&self, name: &str) {
        println!(
            "{name}: {} inverse, worst {:.1e}; {} forward, worst {:.1e}; {} refused",
            self.compared, self.worst_joint, self.solved, self.worst_pose, self.refused
        );
        // The boxes extend beyond the reach, so that its edge is inside them.
        assert!(self.refused < self.compared && 2 * self.solved > self.compared);
    }
}

/// Returns the size of a machine in meters to one in tenths of millimeters.
fn random_size(random: &mut Random) -> f64 {
    10.0_f64.powf(random.between(0.0, 4.0))
}

#[test]
fn linear_deltas_have_the_joints_and_poses_of_lineardeltakins() {
    let mut peer = Peer::new("lineardeltakins", linear_delta(163.25, 33.0, 269.0));
    let mut random = Random::new(31);
    let (mut radius, mut rod) = (peer.theirs.get("R"), peer.theirs.get("L"));
    assert_eq!((radius, rod), (130.25, 269.0), "the shipped machine comes first");
    while peer.compared < cases(100_000) {
        for _ in 0..POSES {
            let reach = rod - radius;
            let pose = at(random.within(reach), random.within(reach), random.within(rod));
            if let Some(joints) = peer.same_joints(&pose) {
                peer.same_pose(&joints, &pose, &mut random);
            }
        }
        rod = random_size(&mut random);
        radius = rod * random.between(0.2, 0.7);
        let effector = rod * random.between(0.0, 0.3);
        peer.take(linear_delta(radius + effector, effector, rod), &[("R", radius), ("L", rod)]);
    }
    peer.report("lineardeltakins");
}

#[test]
fn tripods_have_the_joints_and_poses_of_tripodkins() {
    let first = three_struts(1.0, 1.0, 1.0, at(0.4, 0.3, 0.8));
    let mut peer = Peer::new("tripodkins", first);
    let defaults = ["Bx", "Cx", "Cy"].map(|pin| peer.theirs.get(pin));
    assert_eq!(defaults, [1.0; 3], "the shipped machine comes first");
    let mut random = Random::new(32);
    while peer.compared < cases(100_000) {
        let size = peer.machine.size();
        for _ in 0..POSES {
            // Below a twentieth of the size the three struts are nearly in one plane,
            // where the two poses of the joints coincide.
            let (x, y) = (random.between(-0.5, 1.5), random.between(-0.5, 1.5));
            let pose = at(size * x, size * y, size * random.between(0.1, 2.0));
            let joints = peer.same_joints(&pose).expect("a strut of some length");
            peer.same_pose(&joints, &pose, &mut random);
        }
        let size = random_size(&mut random);
        let [bx, cx, cy] = [(0.5, 1.0), (-0.5, 1.0), (0.5, 1.0)]
            .map(|(low, high)| size * random.between(low, high));
        let machine = three_struts(bx, cx, cy, at(0.3 * size, 0.3 * size, size));
        peer.take(machine, &[("Bx", bx), ("Cx", cx), ("Cy", cy)]);
    }
    peer.report("tripodkins");
}

#[test]
fn rotary_deltas_have_the_joints_and_poses_of_rotarydeltakins_below_the_base() {
    let mut peer = Peer::new("rotarydeltakins", rotary_delta(10.0, 10.0, 14.0, 6.0));
    let pins = ["platformradius", "thighlength", "shinlength", "footradius"];
    assert_eq!(pins.map(|pin| peer.theirs.get(pin)), [10.0, 10.0, 14.0, 6.0], "shipped");
    let mut random = Random::new(33);
    let (mut arms, mut width) = ([10.0, 14.0], 4.0);
    while peer.compared < cases(100_000) {
        let [thigh, shin] = arms;
        for _ in 0..POSES {
            let z = -random.between(0.6 * shin, 0.9 * (shin + thigh));
            let pose = at(random.within(width), random.within(width), z);
            if let Some(joints) = peer.same_joints(&pose) {
                peer.same_pose(&joints, &pose, &mut random);
            }
        }
        let size = random_size(&mut random);
        let values =
            [1.0, random.between(0.6, 1.2), random.between(1.2, 2.0), random.between(0.3, 0.8)]
                .map(|share| size * share);
        arms = [values[1], values[2]];
        width = 0.3 * size;
        let machine = rotary_delta(values[0], values[1], values[2], values[3]);
        let pins: Vec<(&str, f64)> = pins.into_iter().zip(values).collect();
        peer.take(machine, &pins);
    }
    peer.report("rotarydeltakins");
}

#[test]
fn pentapods_have_the_joints_and_poses_of_pentakins_with_rings_of_any_radius() {
    let mut random = Random::new(34);
    let (machine, pins) = random_pentapod(&mut random);
    let mut peer = Peer::new("pentakins", machine.clone());
    wire_pentapod(&mut peer, machine, &pins);
    while peer.compared < cases(100_000) {
        for _ in 0..POSES {
            let pose = pentapod_pose(&mut random);
            let joints = peer.same_joints(&pose).expect("a strut of some length");
            peer.same_pose(&joints, &pose, &mut random);
        }
        let (machine, pins) = random_pentapod(&mut random);
        wire_pentapod(&mut peer, machine, &pins);
    }
    peer.report("pentakins");
}

/// Returns five base anchors and rings near the sample configuration's; one machine in eight has points for
/// rings. (Rings of very different radii make machines that are singular in their workspace.)
fn random_pentapod(random: &mut Random) -> (Parallel, Vec<(String, f64)>) {
    let base = PENTAPOD_BASE.map(|anchor| anchor.map(|value| value + random.within(30.0)));
    let share = if random.between(0.0, 8.0) < 1.0 { 0.0 } else { random.between(0.8, 1.2) };
    let rings = PENTAPOD_RINGS.map(|[radius, height]| {
        [share * (radius + random.within(2.0)), height + random.within(5.0)]
    });
    let mut pins = Vec::new();
    for n in 0..5 {
        for (axis, value) in ["x", "y", "z"].into_iter().zip(base[n]) {
            pins.push((format!("base.{n}.{axis}"), value));
        }
        pins.push((format!("effector.{n}.r"), rings[n][0]));
        pins.push((format!("effector.{n}.z"), rings[n][1]));
    }
    (pentapod(base, rings), pins)
}

fn wire_pentapod(peer: &mut Peer, machine: Parallel, pins: &[(String, f64)]) {
    // Its default max-error of 100 length units is too small in millimeters.
    // By default it stops within 1e-9 of the joints, before the last step of its numerical
    // Jacobian has made poses more accurate than a billionth.
    let mut all = vec![("max-error", 1e4), ("convergence-criterion", 1e-11)];
    all.extend(pins.iter().map(|(name, value)| (name.as_str(), *value)));
    peer.take(machine, &all);
}

/// Returns every peer with its machine, and joints of a pose of it.
fn peers() -> Vec<(Peer, Pose)> {
    let (sample, pins) = random_pentapod(&mut Random::new(35));
    let mut penta = Peer::new("pentakins", sample.clone());
    wire_pentapod(&mut penta, sample, &pins);
    vec![
        (linear(), at(10.0, -20.0, 30.0)),
        (tripods(), at(5.0, 2.0, 3.0)),
        (rotary(), at(1.0, 2.0, -15.0)),
        (penta, pose([5.0, -8.0, 12.0, 3.0, -4.0, 0.0])),
    ]
}

fn linear() -> Peer {
    Peer::new("lineardeltakins", linear_delta(163.25, 33.0, 269.0))
}

fn tripods() -> Peer {
    let mut peer = Peer::new("tripodkins", tripod());
    peer.take(tripod(), &[("Bx", 10.0), ("Cx", 5.0), ("Cy", 7.071)]);
    peer
}

/// Returns the sample configuration sim/axis/rdelta.
fn rotary() -> Peer {
    rotary_of([10.0, 10.0, 18.0, 5.0])
}

fn rotary_of([platform, thigh, shin, foot]: [f64; 4]) -> Peer {
    let machine = rotary_delta(platform, thigh, shin, foot);
    let mut peer = Peer::new("rotarydeltakins", machine.clone());
    let pins = [
        ("platformradius", platform),
        ("thighlength", thigh),
        ("shinlength", shin),
        ("footradius", foot),
    ];
    peer.take(machine, &pins);
    peer
}

/// Checks our refusal: the code, the leg, a pose that stops the machine.
fn assert_refuses_forward(peer: &Peer, joints: &Joints, seed: &Pose, causes: &[Cause]) {
    let mut world = *seed;
    let code = peer.ours.forward_into(joints, &mut world);
    assert!(causes.iter().any(|cause| cause.code() == code), "code {code} for {joints:?}");
    assert!(world[..3].iter().all(|value| value.is_nan()), "{world:?}");
}

#[test]
fn all_four_take_a_joint_that_is_no_number_for_a_pose_and_ours_names_it() {
    for (mut peer, pose) in peers() {
        let good = peer.same_joints(&pose).expect("a pose of the workspace");
        for n in 0..peer.machine.joints() {
            let mut bad = good;
            bad[n] = f64::NAN;
            let theirs = peer.theirs.forward(&bad, &pose).expect("theirs reports success");
            assert!(theirs[..3].iter().any(|value| value.is_nan()), "{theirs:?}");
            assert_refuses_forward(&peer, &bad, &pose, &[Cause::JointNotFinite]);
            peer.ours.monitor();
            assert_eq!(peer.ours.get("fault-leg"), n as f64);
        }
    }
}

#[test]
fn a_pose_that_is_no_number_gives_no_joints() {
    for (peer, good) in peers() {
        let mut bad = good;
        bad[0] = f64::NAN;
        let mut left = [7.0; 16];
        assert_eq!(peer.ours.inverse_into(&bad, &mut left), Cause::PoseNotFinite.code());
        assert_eq!(left, [7.0; 16]);
        // lineardeltakins refuses it too, but writes NaN.
        let mut left = [7.0; 16];
        let code = peer.theirs.inverse_into(&bad, &mut left);
        assert_eq!(code, if peer.theirs.has("L") { -1 } else { 0 });
        assert!(left.iter().any(|value| value.is_nan()), "theirs is wrong no more: {left:?}");
    }
}

/// lineardeltakins writes NaN to the joints that it refuses; tripodkins reaches everything.
#[test]
fn beyond_the_reach_of_a_rod_the_joints_are_left_alone() {
    for (peer, pose) in [
        (linear(), at(300.0, 0.0, 0.0)),
        (rotary(), at(0.0, 0.0, -40.0)),
        (rotary(), at(20.0, 0.0, -15.0)),
    ] {
        let mut left = NAN_JOINTS;
        assert_eq!(peer.theirs.inverse_into(&pose, &mut left), -1);
        let mut left = [7.0; 16];
        assert_eq!(peer.ours.inverse_into(&pose, &mut left), Cause::OutOfReach.code());
        assert_eq!(left, [7.0; 16]);
    }
    let mut left = [0.0; 16];
    assert_eq!(linear().theirs.inverse_into(&at(300.0, 0.0, 0.0), &mut left), -1);
    assert!(left.iter().any(|value| value.is_nan()), "theirs is wrong no more: {left:?}");
}

/// It always uses the lower of two points, even if a rod would have to point up.
#[test]
fn lineardeltakins_answers_joints_with_the_pose_of_others_and_ours_does_not() {
    let peer = linear();
    let joints = joints(&[364.434_170_765_252_1, 99.430_622_519_990_64, 337.209_149_105_009_04]);
    let pose = peer.theirs.forward(&joints, &at(0.0, 0.0, 0.0)).expect("theirs reports success");
    let others = peer.theirs.inverse(&pose).expect("of its own pose");
    assert!((others[1] - joints[1]).abs() > 30.0, "{others:?}");
    let home = peer.machine.home.expect("given");
    let causes = [Cause::DeadPoint, Cause::PathStalled, Cause::NearlySingular];
    assert_refuses_forward(&peer, &joints, &home, &causes);
}

#[test]
fn of_random_carriages_ours_never_answers_with_the_pose_of_others() {
    let peer = linear();
    let home = peer.machine.home.expect("given");
    let mut random = Random::new(36);
    let (mut right, mut refused, mut wrong_of_theirs) = (0, 0, 0);
    for _ in 0..cases(20_000) {
        let joints = joints(&[(); 3].map(|()| random.between(0.0, 375.0)));
        let belongs = |module: &Module, pose: &Pose| {
            module.inverse(pose).is_ok_and(|own| {
                own.iter().zip(joints).take(3).all(|(a, b)| (a - b).abs() <= WRONG_REL * 269.0)
            })
        };
        if let Ok(pose) = peer.theirs.forward(&joints, &home) {
            wrong_of_theirs += u32::from(!belongs(&peer.theirs, &pose));
        }
        match peer.ours.forward(&joints, &home) {
            Ok(pose) => {
                assert!(belongs(&peer.ours, &pose), "{joints:?} gave {pose:?}");
                right += 1;
            }
            Err(_) => refused += 1,
        }
    }
    println!("{right} right, {refused} refused; of theirs {wrong_of_theirs} wrong as success");
    // A tenth: far below the observed share of either, far above a chance result for none.
    let tenth = cases(20_000) as u32 / 10;
    assert!(right >= tenth && wrong_of_theirs >= tenth);
}

/// tripodkins uses the side that its inverse has set, not that of the seed.
#[test]
fn below_the_base_tripodkins_returns_the_mirrored_pose_and_ours_that_of_the_seed() {
    let peer = tripods();
    for z in [3.06, -3.06] {
        let pose = at(5.0, 1.768, z);
        let joints = peer.ours.inverse(&pose).expect("a pose");
        let theirs = peer.theirs.forward(&joints, &pose).expect("theirs reports success");
        assert!((theirs[2] - 3.06).abs() <= SAME_JOINT_MM, "{theirs:?}");
        let mut seed = pose;
        seed[2] *= 0.99;
        let ours = peer.ours.forward(&joints, &seed).expect("ours solves");
        assert!((ours[2] - z).abs() <= SAME_JOINT_MM, "{ours:?}");
    }
}

#[test]
fn a_strut_of_negative_length_is_one_to_tripodkins_and_a_code_to_ours() {
    let peer = tripods();
    let joints = joints(&[-6.0, 6.0, 6.0]);
    let seed = at(5.0, 1.768, 3.06);
    peer.theirs.forward(&joints, &seed).expect("theirs reports success");
    assert_refuses_forward(&peer, &joints, &seed, &[Cause::JointNotPositive]);
}

#[test]
fn tripodkins_ignores_a_tilt_that_ours_refuses() {
    let peer = tripods();
    let level = peer.theirs.inverse(&at(5.0, 2.0, 3.0));
    for (letter, cause) in [(3, Cause::HeldA), (4, Cause::HeldB), (5, Cause::HeldC)] {
        let mut tilted = at(5.0, 2.0, 3.0);
        tilted[letter] = 10.0;
        assert_eq!(peer.theirs.inverse(&tilted), level);
        assert_eq!(peer.ours.inverse(&tilted), Err(cause.code()));
    }
}

#[test]
fn joints_that_close_no_platform_leave_no_pose() {
    let tripod = tripods();
    let short = joints(&[1.0, 1.0, 1.0]);
    let seed = at(5.0, 1.768, 3.06);
    let mut left = seed;
    assert_eq!(tripod.theirs.forward_into(&short, &mut left), -1);
    assert!(left[2] < 0.0, "theirs leaves a negative square: {left:?}");
    assert_refuses_forward(&tripod, &short, &seed, &[Cause::PathStalled]);

    let linear = linear();
    let apart = joints(&[0.0, 800.0, 0.0]);
    let home = linear.machine.home.expect("given");
    assert_eq!(linear.theirs.forward(&apart, &home), Err(-1));
    assert_refuses_forward(&linear, &apart, &home, &[Cause::DeadPoint, Cause::PathStalled]);
}

/// It uses the outer elbow, which above the base is another branch, and forward the
/// lower point: there they contradict each other.
#[test]
fn above_the_base_rotarydeltakins_contradicts_itself_and_ours_does_not() {
    for (x, y, z) in [(0.0, 0.0, 12.0), (1.0, 2.0, 15.0), (2.0, 1.0, 20.0)] {
        let peer = rotary();
        let pose = at(x, y, z);
        let theirs = peer.theirs.inverse(&pose).expect("theirs reports success");
        let back = peer.theirs.forward(&theirs, &pose).expect("theirs reports success");
        assert!((back[2] - z).abs() > 15.0, "theirs is wrong no more: {back:?}");
        match peer.ours.inverse(&pose) {
            Ok(joints) => {
                let back = peer.ours.forward(&joints, &pose).expect("its own joints");
                let off = distance(&back, &pose, 0.0);
                assert!(off <= ROUND_TRIP_REL * peer.machine.size(), "{back:?}");
            }
            Err(code) => {
                let causes = [Cause::OutOfReach, Cause::DeadPoint];
                assert!(causes.iter().any(|cause| cause.code() == code), "{code}");
            }
        }
    }
}

/// With short shins the foot can pass through the plane of the hips: the motion is regular
/// there, but rotarydeltakins changes the branch, and divides by 0 in the plane.
#[test]
fn through_the_plane_of_the_hips_the_joints_go_on_without_a_step() {
    let peer = rotary_of([10.0, 10.0, 12.0, 6.0]);
    let below = peer.theirs.inverse(&at(0.0, 0.0, -0.01)).expect("reachable");
    let above = peer.theirs.inverse(&at(0.0, 0.0, 0.01)).expect("reachable");
    assert!((below[0] - above[0]).abs() > 100.0, "theirs steps no more");
    let within = peer.theirs.inverse(&at(0.0, 0.0, 0.0)).expect("theirs reports success");
    assert!(within[0].is_nan(), "theirs divides by 0 no more");

    let mut last: Option<Joints> = None;
    for step in -100..=100 {
        let joints = peer.ours.inverse(&at(0.0, 0.0, 0.01 * f64::from(step))).expect("reachable");
        for (n, (one, other)) in joints.iter().zip(last.unwrap_or(joints)).enumerate() {
            // Some 14 degrees per length unit; a hundredth of it is the step.
            assert!((one - other).abs() < 0.5, "joint {n}: {other} to {one} at step {step}");
        }
        last = Some(joints);
    }
}

/// It always uses the lower point, without an elbow branch.
#[test]
fn rotarydeltakins_answers_for_the_other_elbow_and_ours_refuses_it() {
    let peer = rotary();
    let pose = at(1.0, 2.0, -15.0);
    let other = joints(&[-163.844_9, -170.506_4, -167.423_1]);
    let theirs = peer.theirs.forward(&other, &pose).expect("theirs reports success");
    let own = peer.theirs.inverse(&theirs).expect("of its own pose");
    assert!((own[0] - other[0]).abs() > 100.0, "theirs is wrong no more: {own:?}");
    let causes = [Cause::DeadPoint, Cause::PathStalled, Cause::NearlySingular];
    assert_refuses_forward(&peer, &other, &pose, &causes);
}

#[test]
fn arms_that_no_pose_of_the_workspace_has_are_refused() {
    let peer = rotary();
    let apart = joints(&[150.0, -150.0, 150.0]);
    let home = peer.machine.home.expect("given");
    let theirs = peer.theirs.forward(&apart, &home).expect("theirs reports success");
    assert!(theirs[0] < -10.0, "a pose far outside the box of its sample: {theirs:?}");
    let causes = [Cause::DeadPoint, Cause::PathStalled, Cause::TooManyIterations];
    assert_refuses_forward(&peer, &apart, &home, &causes);
}

#[test]
fn a_foot_between_hips_that_no_arm_reaches_is_refused() {
    let peer = rotary();
    let middle = at(0.0, 0.0, 0.0);
    let theirs = peer.theirs.inverse(&middle).expect("theirs reports success");
    assert!(theirs[..3].iter().all(|angle| angle.is_nan()), "{theirs:?}");
    let mut left = [7.0; 16];
    assert_eq!(peer.ours.inverse_into(&middle, &mut left), Cause::OutOfReach.code());
    assert_eq!(left, [7.0; 16]);
}
