// SPDX-License-Identifier: GPL-2.0-or-later
//! Start without a seed: finds the pose for given joint values in boxes of poses on which the
//! inverse kinematics are one-to-one.
//!
//! A [`WorkspaceBox`] B comes with a matrix M and the proof, made on the host, that in a
//! scaled Euclidean norm ‖1 − M J(X)‖ ≤ c < 1 for every pose X of B, J = ∂q/∂X. Then for
//! any joint values q
//!
//! ```text
//! X ← P(X − M (inverse(X) − q)),   P: each coordinate clamped to B
//! ```
//!
//! contracts by c (clamping increases no distance), so from any start it converges to one
//! pose X*. A pose in B with these joints is a fixed point: it is X*, and B contains no other
//! one. If the iteration would still move X* outwards, B contains none. Either way B is decided
//! after a number of steps that c bounds in advance (Banach).
//!
//! The boxes are searched one after the other, with a limited number of steps per call. All must be
//! decided: two boxes may contain a pose each, and then the joints alone do not determine the pose.
//!
//! Poses in boxes are those without tool and spindle offset, which move no leg.

use crate::fault::{Cause, Fault};
use crate::forward::Solver;
use crate::lanes::inner;
use crate::layout::{Joints, MAX_LEGS};
use crate::machine::Machine;
use crate::pose::Pose;
use nalgebra::Vector3;

/// Largest number of boxes of a machine.
pub const MAX_BOXES: usize = 8;

/// Largest number of steps that a box may need: sufficient up to c = 0.995.
pub const MAX_BOX_STEPS: u32 = 4096;

/// Steps in one call of [`Machine::search`], over all boxes: each costs one inverse, so that a
/// call costs less than forward may. Most searches end within one call, which matters because
/// LinuxCNC enters world mode right after homing and asks for the pose then.
pub const STEPS_PER_CALL: u32 = 384;

/// Largest number of linear solves for the exact pose in a box: Newton's method doubles the six
/// digits that the steps provide.
const REFINING: u32 = 12;

/// Distance from X* that the steps of a box reach, as a share of its widths. The certified forward
/// covers the rest; it is also the slack at the faces of the box.
pub const BOX_TOLERANCE: f64 = 1e-6;

/// A step shorter than this share of the widths is the last one.
pub const LAST_STEP: f64 = 1e-11;

/// A box of poses on which the inverse kinematics were proved to be one-to-one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorkspaceBox {
    /// Lowest X … C of the control point without tool: machine units, degrees. Both ends
    /// of coordinates that the legs do not move are 0.
    pub low: [f64; 6],
    /// Highest X … C.
    pub high: [f64; 6],
    /// M: pose coordinates (degrees) per joint unit, one row for each coordinate.
    pub matrix: [[f64; MAX_LEGS]; 6],
    /// Steps after which the iteration is near enough from any start, 1 to [`MAX_BOX_STEPS`].
    pub steps: u32,
}

impl WorkspaceBox {
    /// A box that contains nothing.
    pub const EMPTY: Self =
        Self { low: [0.0; 6], high: [0.0; 6], matrix: [[0.0; MAX_LEGS]; 6], steps: 1 };

    /// Returns whether its numbers are usable. Only the host can verify the proof about them.
    pub fn is_valid(&self) -> bool {
        let ends = self.low.iter().zip(&self.high);
        ends.clone().all(|(low, high)| low <= high && low.is_finite() && high.is_finite())
            && self.matrix.iter().flatten().all(|m| m.is_finite())
            && (1..=MAX_BOX_STEPS).contains(&self.steps)
    }

    fn middle(&self) -> [f64; 6] {
        core::array::from_fn(|k| 0.5 * (self.low[k] + self.high[k]))
    }

    /// Returns the width of coordinate `k`.
    fn width(&self, k: usize) -> f64 {
        self.high[k] - self.low[k]
    }

    /// Returns whether the pose is in the box, within the tolerance.
    pub fn holds(&self, pose: &Pose) -> bool {
        let pose = pose.to_degrees();
        (0..6).all(|k| {
            let slack = 2.0 * BOX_TOLERANCE * self.width(k);
            pose[k] >= self.low[k] - slack && pose[k] <= self.high[k] + slack
        })
    }
}

/// A search that may take several calls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    joints: Joints,
    /// Index of the box being searched.
    index: usize,
    /// Current point of the iteration in it.
    at: [f64; 6],
    /// Steps taken within it.
    steps: u32,
    /// Pose without tool that a box has produced.
    found: Option<Pose>,
}

/// Result of [`Machine::search`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// Not finished: call again.
    Searching(Search),
    /// The only pose in the boxes.
    Found(Pose),
}

/// State of a box after some steps.
enum Answer {
    Open,
    Absent,
    Present(Pose),
}

impl Search {
    /// Starts a search for the pose of `joints`.
    pub fn new(joints: &Joints, boxes: &[WorkspaceBox]) -> Self {
        let at = boxes.first().map_or([0.0; 6], WorkspaceBox::middle);
        Self { joints: *joints, index: 0, at, steps: 0, found: None }
    }
}

impl Machine {
    /// Continues a search by at most [`STEPS_PER_CALL`] steps.
    ///
    /// The pose found is that of the control point with the tool vector `tool`. It is
    /// exact, and the only one in the boxes, provided that these were proved for
    /// this geometry.
    ///
    /// # Errors
    /// [`Cause::OutsideBoxes`], [`Cause::TwoPoses`] or a joint that is not finite; also
    /// any refusal of inverse or forward within a box.
    pub fn search(
        &self,
        mut search: Search,
        boxes: &[WorkspaceBox],
        tool: &Vector3<f64>,
        solver: &Solver,
    ) -> Result<Progress, Fault> {
        if let Some((i, value)) = search.joints.iter().enumerate().find(|(_, v)| !v.is_finite()) {
            return Err(Fault::of_joint(Cause::JointNotFinite, self.layout(), i, *value));
        }
        let mut allowed = STEPS_PER_CALL;
        for asked in boxes.iter().skip(search.index).take(MAX_BOXES) {
            match self.ask(asked, &mut search, &mut allowed, solver)? {
                Answer::Open => return Ok(Progress::Searching(search)),
                Answer::Absent => {}
                Answer::Present(pose) => search.add(&pose, self)?,
            }
            search.go_on(boxes);
        }
        search.ended(tool)
    }

    /// Takes the remaining allowed steps in one box.
    fn ask(
        &self,
        asked: &WorkspaceBox,
        search: &mut Search,
        allowed: &mut u32,
        solver: &Solver,
    ) -> Result<Answer, Fault> {
        for _ in 0..STEPS_PER_CALL {
            if *allowed == 0 {
                break;
            }
            *allowed -= 1;
            let step = self.box_step(asked, search)?;
            let mut moved = false;
            for k in 0..6 {
                let before = search.at[k];
                search.at[k] = (before + step[k]).clamp_to(asked.low[k], asked.high[k]);
                moved |= (search.at[k] - before).abs() > LAST_STEP * asked.width(k);
            }
            search.steps += 1;
            if moved && search.steps < asked.steps {
                continue;
            }
            let still = (0..6).all(|k| step[k].abs() <= BOX_TOLERANCE * asked.width(k));
            if !still {
                return Ok(Answer::Absent);
            }
            return self.refined(asked, search, solver);
        }
        Ok(Answer::Open)
    }

    /// Computes −M (inverse(X) − q).
    fn box_step(&self, asked: &WorkspaceBox, search: &Search) -> Result<[f64; 6], Fault> {
        let joints = self.inverse(&Pose::from_degrees(search.at), &Vector3::zeros())?;
        let mut off = [0.0; MAX_LEGS];
        let legs = joints.iter().zip(&search.joints).take(self.layout().legs());
        off.iter_mut().zip(legs).for_each(|(off, (joint, wanted))| *off = joint - wanted);
        Ok(asked.matrix.each_ref().map(|row| -inner(row, &off)))
    }

    /// Computes the exact pose at the end of the steps, if it is in the box.
    fn refined(
        &self,
        asked: &WorkspaceBox,
        search: &Search,
        solver: &Solver,
    ) -> Result<Answer, Fault> {
        let near = Pose::from_degrees(search.at);
        let solver = Solver { limit_iterations: solver.limit_iterations.min(REFINING), ..*solver };
        let pose = self.forward(&search.joints, &near, &Vector3::zeros(), &solver)?.pose;
        let mut of_legs = pose;
        for letter in self.layout().table().as_slice() {
            of_legs.position[letter.index().min(2)] = 0.0;
        }
        Ok(if asked.holds(&of_legs) { Answer::Present(pose) } else { Answer::Absent })
    }
}

impl Search {
    /// Stores a pose, unless a neighboring box has already produced it.
    fn add(&mut self, pose: &Pose, machine: &Machine) -> Result<(), Fault> {
        if let Some(first) = &self.found {
            let apart = first.distance(pose, machine.radius());
            if !(apart <= BOX_TOLERANCE * machine.size()) {
                return Err(Fault::with_value(Cause::TwoPoses, apart));
            }
        }
        self.found = Some(*pose);
        Ok(())
    }

    fn go_on(&mut self, boxes: &[WorkspaceBox]) {
        self.index += 1;
        self.steps = 0;
        self.at = boxes.get(self.index).map_or([0.0; 6], WorkspaceBox::middle);
    }

    fn ended(&self, tool: &Vector3<f64>) -> Result<Progress, Fault> {
        let mut pose = self.found.ok_or(Fault::from(Cause::OutsideBoxes))?;
        // The joints determine t − o + R o, independent of the tool o.
        pose.position += tool - pose.rotation() * tool;
        Ok(Progress::Found(pose))
    }
}

/// Clamps without the panic of `f64::clamp`.
trait ClampTo {
    fn clamp_to(self, low: f64, high: f64) -> f64;
}

impl ClampTo for f64 {
    fn clamp_to(self, low: f64, high: f64) -> f64 {
        self.max(low).min(high)
    }
}
