// SPDX-License-Identifier: GPL-2.0-or-later
//! What is known of a program on a machine.

use crate::limits;
use crate::program::loads::Peak;
use kinematics::{Joints, Limit, Part};
use serde::Serialize;

/// First place where a program leaves a limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Break {
    /// The limit.
    #[serde(serialize_with = "limits::word")]
    pub limit: Limit,
    /// Line of the program, counted from 1; 0 for what runs before it.
    pub line: u32,
    /// Number of the file that the line is in, 0 for the program itself.
    pub file: usize,
    /// X Y Z A B C there, machine units and degrees.
    pub pose: [f64; 6],
    /// Number of the move, from 0.
    #[serde(skip)]
    pub(super) step: usize,
    /// Share of the move that is kept.
    #[serde(skip)]
    pub(super) share: f64,
    /// What breaks, and how: a sentence.
    pub text: String,
}

/// How near a program comes to a limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LeastMargin {
    /// The limit.
    #[serde(serialize_with = "limits::word")]
    pub limit: Limit,
    /// Machine units, degrees, their rates, or a singular value; negative beyond the limit.
    pub value: f64,
    /// Unit of the value.
    pub unit: String,
    /// Joint, leg or axis.
    pub part: String,
    /// The same as the core numbers it.
    #[serde(skip)]
    pub of: Part,
    /// Line of the program.
    pub line: u32,
}

/// What a line asks of the joints.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LineLoad {
    /// Line of the program.
    pub line: u32,
    /// Feeds of this line may be multiplied by this; above 1 there is room.
    pub factor: f64,
}

/// A sample of the motion, for plots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Seconds from the start at the programmed feed, without acceleration.
    pub time: f64,
    /// Line of the program.
    pub line: u32,
    /// X Y Z A B C.
    pub pose: [f64; 6],
    /// Joint values.
    pub joints: Joints,
    /// Joint speeds as shares of their limits.
    pub speeds: Joints,
    /// Least margin of the geometric limits as a share of their range.
    pub margin: f64,
}

/// What is known of a program on a machine.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Preflight {
    /// Moves.
    pub moves: usize,
    /// Length of the path of the control point, machine units.
    pub length: f64,
    /// Seconds of motion.
    pub time: f64,
    /// Pieces that the moves were cut into.
    pub pieces: usize,
    /// First break of every limit that breaks, in the order of the program.
    pub breaks: Vec<Break>,
    /// Least margin of every limit that the machine has.
    pub margins: Vec<LeastMargin>,
    /// Share of the path before the first break.
    pub runnable: f64,
    /// Every feed may be multiplied by this.
    pub feed_factor: f64,
    /// The same of every line.
    pub lines: Vec<LineLoad>,
    /// Largest speeds of the joints.
    pub speeds: Vec<Peak>,
    /// Largest accelerations of the joints.
    pub accelerations: Vec<Peak>,
    /// Files and lines before which the tool offset changes while the platform is tilted.
    pub tilted_tool_changes: Vec<(usize, u32)>,
    /// Samples, where they were asked for.
    #[serde(skip)]
    pub samples: Vec<Sample>,
}

impl Preflight {
    /// Whether the program keeps all limits.
    pub fn fits(&self) -> bool {
        self.breaks.is_empty()
    }
}
