// SPDX-License-Identifier: GPL-2.0-or-later
//! Machines with constraints at very many poses: inverse, forward from home and from near, and motions through and along
//! singularities of the constraints and of the legs, compared with an independent reference.
//!
//! `PKMKINS_CASES=1000` makes a million poses of each machine.

use crate::common::{cases, direction, rng, uniform};
use crate::constraints::{
    Reference, frozen, machines, nalgebra_reference, pose_near, pose_within, tool,
};
use kinematics::{Geometry, Joints, Machine, Pose, Solver, Vector3};

/// Poses for each tool: the reference computes home once.
const POSES: usize = 50;

/// The precision that is required of all machines, as a share of the size.
const SAME: f64 = 1e-9;

/// Parts in which the reference follows a line, within the workspace, far beyond, and where it decides.
const PARTS: [usize; 3] = [6, 30, 2000];

/// A machine with a tool, and its reference.
struct Subject<'a> {
    name: &'static str,
    machine: &'a Machine,
    tool: Vector3<f64>,
    reference: Reference,
    home: [f64; 6],
}

/// What became of the calls.
#[derive(Default)]
struct Count {
    calls: usize,
    right: usize,
    refused: usize,
    /// Found, but the reference stops near a singularity.
    undecided: usize,
    wrong: usize,
}

impl Count {
    fn add(&mut self, found: Option<bool>) {
        self.calls += 1;
        match found {
            Some(true) => self.right += 1,
            Some(false) => self.wrong += 1,
            None => self.undecided += 1,
        }
    }

    fn refuse(&mut self) {
        self.calls += 1;
        self.refused += 1;
    }

    fn print(&self, name: &str, what: &str) {
        let Self { calls, right, refused, undecided, wrong } = self;
        println!(
            "{name}: {what}: {calls} calls, {right} right, {refused} refused, {undecided} undecided, {wrong} wrong"
        );
        assert_eq!(*wrong, 0, "{name}: {what}");
    }
}

/// Returns the machines without tables, which the reference does not know.
fn subjects() -> impl Iterator<Item = (&'static str, Geometry, [f64; 6], [f64; 6])> {
    machines().into_iter().filter(|(_, geometry, ..)| geometry.layout().table().is_empty())
}

impl<'a> Subject<'a> {
    fn new(
        name: &'static str,
        machine: &'a Machine,
        geometry: &Geometry,
        tool: Vector3<f64>,
    ) -> Self {
        let reference = Reference::new(geometry, tool);
        let home = reference.home();
        Self { name, machine, tool, reference, home }
    }

    fn apart(&self, one: &Pose, other: &[f64; 6]) -> f64 {
        one.distance(&nalgebra_reference::pose(other), self.machine.radius())
    }

    fn is_same(&self, one: &Pose, other: &[f64; 6]) -> bool {
        self.apart(one, other) <= SAME * self.machine.size()
    }

    /// Judges the platform of a pose; `None` where the reference does not reach it.
    fn judged(&self, pose: &Pose, full: &Pose, quick: Option<[f64; 6]>) -> Option<bool> {
        if quick.is_some_and(|expected| self.is_same(full, &expected)) {
            return Some(true);
        }
        let expected = self.reference.complete(pose, PARTS[2])?;
        let is_same = self.is_same(full, &expected);
        if !is_same {
            println!("{}: {pose:?} {:?}: {full:?} {expected:?}", self.name, self.tool);
        }
        Some(is_same)
    }

    /// Checks that a full pose meets the constraints and that the joints are those of its legs.
    fn check(&self, full: &Pose, joints: &Joints) {
        let (p, a) = (full.position, full.angles);
        let pose = [p.x, p.y, p.z, a.x, a.y, a.z];
        let most = SAME * self.machine.size();
        assert!(self.reference.rows(&pose).iter().all(|value| value.abs() <= most));
        for (own, found) in self.reference.joints(&pose).iter().zip(joints) {
            assert!((own - found).abs() <= most, "{}: {full:?} {joints:?}", self.name);
        }
    }

    /// Judges forward from a seed by the reference that follows the joints from there.
    fn followed(&self, seed: &Pose, joints: &Joints, found: &Pose, parts: usize) -> Option<bool> {
        let (machine, tool) = (self.machine, &self.tool);
        let start = machine.full_pose(seed, tool).expect("forward has solved it");
        let (p, a) = (start.position, start.angles);
        let from = [p.x, p.y, p.z, a.x, a.y, a.z];
        // Next to a constraint singularity the proof of the seed may reach farther than that of the pose.
        let full = machine.full_pose(found, tool).ok()?;
        let quick = self.reference.follow(&from, joints, parts)?;
        if self.is_same(&full, &quick) {
            return Some(true);
        }
        // In few parts it may itself change to another pose.
        let expected = self.reference.follow(&from, joints, PARTS[2])?;
        let is_same = self.is_same(&full, &expected);
        if !is_same {
            println!("{}: {seed:?} {joints:?}: {full:?} {expected:?}", self.name);
        }
        Some(is_same)
    }

    /// Judges forward where it should return the pose of inverse.
    fn forward(&self, seed: &Pose, joints: &Joints, pose: &Pose, parts: usize, count: &mut Count) {
        let Ok(found) = self.machine.forward(joints, seed, &self.tool, &Solver::default()) else {
            return count.refuse();
        };
        if let Ok(full) = self.machine.full_pose(&found.pose, &self.tool) {
            assert!(
                found.full.distance(&full, self.machine.radius()) <= SAME * self.machine.size(),
                "{}: {found:?} {full:?}",
                self.name
            );
        }
        let apart = found.pose.distance(pose, self.machine.radius());
        match apart <= SAME * self.machine.size() {
            true => count.add(Some(true)),
            // Another pose of the same joints may be the one that is connected with the seed.
            false => count.add(self.followed(seed, joints, &found.pose, parts)),
        }
    }
}

#[test]
fn many_poses_have_the_platform_of_the_reference_and_forward_returns_them() {
    let mut rng = rng(160);
    for (name, geometry, half, far) in subjects() {
        let machine = frozen(&geometry);
        let home = Pose::from_degrees(geometry.home.unwrap());
        let mut counts: [Count; 3] = Default::default();
        let [inverse, near_seed, far_seed] = &mut counts;
        for _ in 0..cases(1000).div_ceil(POSES) {
            let subject = Subject::new(name, &machine, &geometry, tool(&mut rng));
            for n in 0..POSES {
                let is_far = n % 5 == 0;
                let pose = pose_within(&mut rng, &geometry, if is_far { &far } else { &half });
                let parts = PARTS[usize::from(is_far)];
                let quick = subject.reference.complete_quickly(&subject.home, &pose, parts);
                let Ok(full) = machine.full_pose(&pose, &subject.tool) else {
                    inverse.refuse();
                    assert!(is_far || quick.is_none(), "{name}: {pose:?} {:?}", subject.tool);
                    continue;
                };
                inverse.add(subject.judged(&pose, &full, quick));
                let Ok(joints) = machine.inverse(&pose, &subject.tool) else { continue };
                subject.check(&full, &joints);
                let near = Pose {
                    position: pose.position + pose_near(&mut rng, &machine, 0),
                    angles: pose.angles + pose_near(&mut rng, &machine, 3),
                };
                subject.forward(&near, &joints, &pose, 20, near_seed);
                subject.forward(&home, &joints, &pose, 400, far_seed);
            }
        }
        inverse.print(name, "inverse");
        near_seed.print(name, "forward from near");
        far_seed.print(name, "forward from home");
        // Most poses are in the workspace.
        assert!(
            inverse.right * 10 >= 7 * inverse.calls && near_seed.right * 10 >= 7 * inverse.calls
        );
    }
}

/// Poses of a motion, and the step between them as a share of the size.
const STEPS: usize = 300;

/// Smallest singular values at which motions along a singularity stay.
const CLOSE: [f64; 2] = [0.02, 0.002];

impl Subject<'_> {
    /// Returns the pose at a share of the line from home to `to`.
    fn on_line(&self, to: &Pose, share: f64) -> Pose {
        let home = nalgebra_reference::pose(&self.home);
        let at = |k: usize| {
            let index = if k < 3 { to.position[k] } else { to.angles[k - 3] };
            let from = if k < 3 { home.position[k] } else { home.angles[k - 3] };
            // Dependent coordinates cannot be commanded.
            if self.machine.layout().is_held(kinematics::Letter::ALL[k]) {
                0.0
            } else {
                from + (index - from) * share
            }
        };
        nalgebra_reference::pose(&std::array::from_fn(at))
    }

    /// Returns the largest share of a line whose poses all are farther from singularities than `least`, up to 1.
    fn until(&self, to: &Pose, least: f64) -> f64 {
        let is_regular = |share: f64| {
            let at = self.machine.at(&self.on_line(to, share), &self.tool);
            at.is_ok_and(|at| at.smallest_singular_value() > least)
        };
        let parts = 40;
        let open = (1..=parts).take_while(|n| is_regular(f64::from(*n) / f64::from(parts))).count();
        let (mut low, mut high) = (open as f64 / 40.0, (open as f64 + 1.0) / 40.0);
        for _ in 0..40 {
            let middle = (low + high) / 2.0;
            if is_regular(middle) { low = middle } else { high = middle }
        }
        low.min(1.0)
    }

    /// Judges forward along poses, each from the result before, and inverse at each of them.
    fn moved(&self, poses: impl Iterator<Item = Pose>, [inverse, forward]: [&mut Count; 2]) {
        let (machine, tool) = (self.machine, &self.tool);
        let mut seed = None;
        for pose in poses {
            let (Ok(full), Ok(joints)) =
                (machine.full_pose(&pose, tool), machine.inverse(&pose, tool))
            else {
                inverse.refuse();
                continue;
            };
            let quick = self.reference.complete_quickly(&self.home, &pose, PARTS[1]);
            inverse.add(self.judged(&pose, &full, quick));
            self.check(&full, &joints);
            let from = seed.unwrap_or(pose);
            match machine.forward(&joints, &from, tool, &Solver::default()) {
                Ok(found) => {
                    forward.add(self.followed(&from, &joints, &found.pose, 6));
                    seed = Some(found.pose);
                }
                Err(_) => forward.refuse(),
            }
        }
    }
}

#[test]
fn motions_through_and_along_singularities_return_no_other_pose() {
    let mut rng = rng(161);
    for (name, geometry, _, far) in subjects() {
        let machine = frozen(&geometry);
        let mut counts: [Count; 4] = Default::default();
        let [inverse, forward, inverse_along, forward_along] = &mut counts;
        for n in 0..cases(2) {
            let subject = Subject::new(name, &machine, &geometry, tool(&mut rng));
            // A line that reaches a singularity.
            let reaches = |to: &Pose, least: f64| subject.until(to, least) < 1.0;
            let mut beyond = |least: f64| {
                (0..100)
                    .map(|_| pose_within(&mut rng, &geometry, &far))
                    .find(|to| reaches(to, least))
            };
            let least = CLOSE[n % 2];
            let (Some(to), Some(from)) = (beyond(1e-3), beyond(least)) else { continue };
            // Through: the part of the line that begins shortly before.
            let at = subject.until(&to, 1e-3);
            let length = 0.3 * uniform(&mut rng, 0.1, 1.0);
            let shares = (0..STEPS).map(|k| at + length * (k as f64 / STEPS as f64 - 0.3));
            let line = shares.map(|share| subject.on_line(&to, share.max(0.0)));
            subject.moved(line, [inverse, forward]);
            // Along: directions that change little, each as far as a small singular value.
            let turn = direction(&mut rng);
            let along = (0..STEPS / 3).map(|k| {
                let by = turn * (k as f64 * 1e-3);
                let to = Pose {
                    position: from.position + by * machine.size(),
                    angles: from.angles + by,
                };
                subject.on_line(&to, subject.until(&to, least) * (1.0 - 1e-6))
            });
            subject.moved(along, [inverse_along, forward_along]);
        }
        inverse.print(name, "inverse through singularities");
        forward.print(name, "forward through singularities");
        inverse_along.print(name, "inverse along singularities");
        forward_along.print(name, "forward along singularities");
    }
}
