// SPDX-License-Identifier: GPL-2.0-or-later
//! The rigid machine of a module: one or two mechanisms, and axes that pass through or carry something.

use crate::control::Control;
use crate::module::{Joints, Pose};
use crate::parallel::Parallel;
use crate::random::Random;
use crate::truth::{Followed, Look, Platform, Truth};

/// Current state of the machine.
#[derive(Clone, Copy, Debug)]
pub struct State {
    pub poses: [Platform; 2],
    pub joints: Joints,
}

/// One mechanism.
#[derive(Clone)]
struct Body {
    truth: Truth,
    first_joint: usize,
    /// Indices of its letters in LinuxCNC's pose.
    places: [Option<usize>; 6],
    /// Indices of its joints' letters in the identity kinematics.
    letters: Vec<usize>,
}

/// The machine.
#[derive(Clone)]
pub struct System {
    bodies: Vec<Body>,
    /// Indices in LinuxCNC's pose of axes outside the mechanism, in joint order.
    extra: Vec<usize>,
    pub reference: [Platform; 2],
}

fn letters_of(machine: &Parallel) -> Vec<usize> {
    let all = machine.coordinates.chars().chain(machine.table.chars());
    all.map(|letter| "XYZABC".find(letter).expect("a letter of a pose")).collect()
}

impl System {
    pub fn new(control: &Control) -> Self {
        let machines = control.mechanisms();
        let mut first_joint = 0;
        let mut bodies: Vec<Body> = machines
            .iter()
            .map(|machine| {
                let truth = Truth::new(machine);
                let body = Body {
                    first_joint,
                    places: std::array::from_fn(Some),
                    letters: letters_of(machine),
                    truth,
                };
                first_joint += machine.joints();
                body
            })
            .collect();
        let mut extra = vec![];
        match control {
            Control::Alone(_) => {}
            Control::Carrying(_, carrying) => {
                bodies[0].truth.carry(carrying);
                extra.clone_from(&carrying.axes);
            }
            Control::Pair(_, two) => {
                let places = two.places();
                let second = &mut bodies[1];
                second.letters = second.letters.iter().filter_map(|k| places[*k]).collect();
                second.places = places;
            }
        }
        let mut system = Self { bodies, extra, reference: [[0.0; 6]; 2] };
        system.reference = system.poses(&control.home());
        system
    }

    /// Fixes the folds of the nut corrections at the reference pose.
    pub fn fold_at_reference(&mut self) {
        for (body, pose) in self.bodies.iter_mut().zip(&self.reference) {
            body.truth.fold_at(pose);
        }
    }

    pub fn joints(&self) -> usize {
        self.bodies.iter().map(|body| body.truth.joints()).sum::<usize>() + self.extra.len()
    }

    /// Returns the number of joints of the mechanisms.
    pub fn driven(&self) -> usize {
        self.joints() - self.extra.len()
    }

    /// Returns the size of the largest mechanism.
    pub fn size(&self) -> f64 {
        self.bodies.iter().map(|body| body.truth.size()).fold(0.0, f64::max)
    }

    /// Returns the size of the smallest mechanism.
    pub fn least_size(&self) -> f64 {
        self.bodies.iter().map(|body| body.truth.size()).fold(f64::INFINITY, f64::min)
    }

    /// Returns whether there are two mechanisms.
    pub fn is_pair(&self) -> bool {
        self.bodies.len() > 1
    }

    /// Returns whether a mechanism has more legs than coordinates.
    pub fn is_redundant(&self) -> bool {
        self.bodies.iter().any(|body| body.truth.is_redundant())
    }

    /// Returns a joint's unit as a length.
    pub fn unit(&self, joint: usize) -> f64 {
        if self.is_extra(joint) {
            // A turn counts as much as the size.
            let turns = self.extra[joint - self.driven()] < 6;
            return if turns { self.size() / 360.0 } else { 1.0 };
        }
        let body = self.bodies.iter().rev().find(|body| body.first_joint <= joint);
        body.map_or(1.0, |body| body.truth.unit(joint - body.first_joint))
    }

    /// Returns whether a joint is one of the axes outside the mechanisms.
    pub fn is_extra(&self, joint: usize) -> bool {
        joint >= self.driven()
    }

    /// Returns the index in LinuxCNC's pose of each joint's letter in the identity kinematics.
    pub fn identity_places(&self) -> Vec<usize> {
        let own = self.bodies.iter().flat_map(|body| body.letters.iter().copied());
        own.chain(self.extra.iter().copied()).collect()
    }

    /// Returns whether every joint has a letter.
    pub fn has_identity(&self) -> bool {
        self.bodies.iter().all(|body| body.letters.len() == body.truth.joints())
    }

    /// Returns the indices in LinuxCNC's pose that something moves.
    pub fn moved_places(&self) -> Vec<usize> {
        let mut all = self.identity_places();
        all.sort_unstable();
        all
    }

    /// Returns the poses of the mechanisms in one of LinuxCNC's poses.
    pub fn poses(&self, world: &Pose) -> [Platform; 2] {
        let mut poses = [[0.0; 6]; 2];
        for (to, body) in poses.iter_mut().zip(&self.bodies) {
            let is_alone = body.places.iter().zip(0..).all(|(place, k)| *place == Some(k));
            *to = if is_alone {
                body.truth.platform(world, &self.extra)
            } else {
                let own = |k: usize| body.places.get(k).copied().flatten();
                let world = std::array::from_fn(|k| own(k).map_or(0.0, |place| world[place]));
                body.truth.platform(&world, &[])
            };
        }
        poses
    }

    fn own(body: &Body, joints: &Joints) -> Joints {
        let mut own = [0.0; 16];
        let count = body.truth.joints();
        own[..count].copy_from_slice(&joints[body.first_joint..body.first_joint + count]);
        own
    }

    /// Returns the machine at these poses, with the values of the other joints from `joints`; and the
    /// least margin of a leg. `None` if a leg does not reach.
    pub fn at(&self, poses: &[Platform; 2], joints: &Joints) -> Option<(State, f64)> {
        let (mut joints, mut least) = (*joints, f64::INFINITY);
        for (body, pose) in self.bodies.iter().zip(poses) {
            let (own, margin) = body.truth.inverse(pose)?;
            let count = body.truth.joints();
            joints[body.first_joint..body.first_joint + count].copy_from_slice(&own[..count]);
            least = least.min(margin);
        }
        Some((State { poses: *poses, joints }, least))
    }

    /// Returns the machine at one of LinuxCNC's poses.
    pub fn state(&self, world: &Pose) -> Option<(State, f64)> {
        let mut joints = [0.0; 16];
        for (i, place) in self.extra.iter().enumerate() {
            joints[self.driven() + i] = world[*place];
        }
        self.at(&self.poses(world), &joints)
    }

    /// Returns the machine at its reference pose.
    /// # Panics
    /// If a leg does not reach it.
    pub fn at_reference(&self) -> State {
        self.at(&self.reference, &[0.0; 16]).expect("the reference pose").0
    }

    /// Returns the largest distance of the mechanisms' poses.
    pub fn distance(&self, one: &[Platform; 2], other: &[Platform; 2]) -> f64 {
        let each = self.bodies.iter().zip(one.iter().zip(other));
        each.map(|(body, (one, other))| body.truth.distance(one, other)).fold(0.0, f64::max)
    }

    /// Returns the state of other joints nearby; `None` if Newton's method moves farther than `most`.
    pub fn near(&self, from: &State, joints: &Joints, most: f64) -> Option<State> {
        let mut state = State { poses: from.poses, joints: *joints };
        for (body, pose) in self.bodies.iter().zip(&mut state.poses) {
            *pose = body.truth.near(pose, &Self::own(body, joints), most)?;
        }
        Some(state)
    }

    /// Returns the state at the end of the straight line of joints, and the least distances along it.
    pub fn follow(&self, from: &State, joints: &Joints) -> (Option<State>, Followed) {
        let mut state = State { poses: from.poses, joints: *joints };
        let mut all =
            Followed { distance: f64::INFINITY, margin: f64::INFINITY, ..Followed::default() };
        let mut arrives = true;
        for (body, pose) in self.bodies.iter().zip(&mut state.poses) {
            let (from, to) = (Self::own(body, &from.joints), Self::own(body, joints));
            let (end, followed) = body.truth.follow(&from, pose, &to);
            all.distance = all.distance.min(followed.distance / body.truth.size());
            all.margin = all.margin.min(followed.margin);
            all.length = all.length.max(followed.length);
            all.steps = all.steps.max(followed.steps);
            match end {
                Some(end) => *pose = end,
                None => arrives = false,
            }
        }
        (arrives.then_some(state), all)
    }

    /// Returns the distances of the mechanism that is nearest to a singular pose.
    pub fn look(&self, state: &State) -> Look {
        let looks = self.bodies.iter().zip(&state.poses).map(|(body, pose)| {
            let mut look = body.truth.look(pose, &Self::own(body, &state.joints));
            look.margin = look.margin.min(f64::MAX);
            look
        });
        let least = |one: Look, other: Look| Look {
            margin: one.margin.min(other.margin),
            ..if other.distance < one.distance { other } else { one }
        };
        looks.reduce(least).expect("a mechanism")
    }

    pub fn signs(&self, state: &State) -> [i32; 2] {
        let mut signs = [1; 2];
        for ((sign, body), pose) in signs.iter_mut().zip(&self.bodies).zip(&state.poses) {
            *sign = body.truth.sign(pose, &Self::own(body, &state.joints));
        }
        signs
    }

    /// Returns whether the poses fit the joints: residuals, and Newton steps for redundant legs.
    pub fn fits(&self, state: &State) -> bool {
        self.bodies.iter().zip(&state.poses).all(|(body, pose)| {
            let (most, next) = body.truth.misfit(pose, &Self::own(body, &state.joints));
            // The criterion is 1e-9 units; the module stops at 1e-12 of the size, and a joint may move
            // some twenty times as far.
            let allowed = 3e-9 + 3e-11 * body.truth.size();
            if body.truth.is_redundant() { next <= 10.0 * allowed } else { most <= allowed }
        })
    }

    /// Returns a random motion of the platforms by a length, for a machine whose joints must be consistent.
    pub fn shifted(&self, state: &State, share: f64, random: &mut Random) -> Option<State> {
        let mut poses = state.poses;
        for (body, pose) in self.bodies.iter().zip(&mut poses) {
            let length = share * body.truth.size();
            for (k, value) in pose.iter_mut().enumerate().filter(|(k, _)| body.truth.moves(*k)) {
                *value += if k < 3 { random.within(length) } else { random.within(100.0 * share) };
            }
        }
        self.at(&poses, &state.joints).map(|(state, _)| state)
    }
}
