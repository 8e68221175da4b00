// SPDX-License-Identifier: GPL-2.0-or-later
//! What is known of a program on a machine.

use crate::work_offset::Poses;
use kinematics::{Limit, Part};
use linuxcnc::row::{Ending, Message};
use machine::limits;
use machine::read::mechanism::Mechanism;
use serde::{Serialize, Serializer};

/// What a program has to keep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// A limit of the machine.
    Limit(Limit),
    /// How near two mechanisms may come to each other.
    Mechanisms,
    /// That LinuxCNC keeps to the programmed path.
    Path,
    /// How far LinuxCNC lets a joint lag behind its command.
    FollowingError,
    /// LinuxCNC's own checks, which end in a message.
    Control,
}

impl Rule {
    /// What people call it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Limit(limit) => limit.name(),
            Self::Mechanisms => "mechanisms apart",
            Self::Path => "path",
            Self::FollowingError => "following error",
            Self::Control => "LinuxCNC",
        }
    }

    /// Whether another feed may keep it, and another place does not.
    pub fn is_of_time(self) -> bool {
        match self {
            Self::Limit(limit) => limits::is_of_feed(limit),
            Self::Mechanisms | Self::Path => false,
            Self::FollowingError | Self::Control => true,
        }
    }
}

impl From<Limit> for Rule {
    fn from(limit: Limit) -> Self {
        Self::Limit(limit)
    }
}

impl PartialEq<Limit> for Rule {
    fn eq(&self, limit: &Limit) -> bool {
        *self == Self::Limit(*limit)
    }
}

impl Serialize for Rule {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Limit(limit) => limits::word(limit, to),
            Self::Mechanisms => to.serialize_str("mechanisms"),
            Self::Path => to.serialize_str("path"),
            Self::FollowingError => to.serialize_str("following-error"),
            Self::Control => to.serialize_str("linuxcnc"),
        }
    }
}

/// A limit that a program leaves, with the first place where it does.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Break {
    /// The limit.
    pub limit: Rule,
    /// Joint, leg or axis; empty for a message of LinuxCNC.
    pub part: String,
    /// Line of the program, counted from 1; 0 for what runs before it.
    pub line: u32,
    /// Number of the file that the line is in, 0 for the program itself.
    pub file: usize,
    /// X Y Z A B C there, machine units and degrees; of the mechanism that is meant.
    pub pose: [f64; 6],
    /// Whether the second of two mechanisms is meant.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub of_second: bool,
    /// Seconds since the program was started, of what LinuxCNC's cycles show.
    pub seconds: Option<f64>,
    /// Moves that leave the limit; lines, where LinuxCNC's cycles are judged.
    pub moves: usize,
    /// Number of the move, from 0. Of what LinuxCNC's cycles show: of the first move that is made later, where it is known.
    #[serde(skip)]
    pub(super) step: usize,
    /// Share of the move that is kept.
    #[serde(skip)]
    pub(super) share: f64,
    /// The last move that was counted.
    #[serde(skip)]
    pub(super) last: usize,
    /// What was gone before it, as [`Preflight::advance`].
    #[serde(skip)]
    pub(super) before: f64,
    /// What breaks, and how: a sentence.
    pub text: String,
}

impl Break {
    /// A limit that LinuxCNC's cycles leave.
    pub(super) fn in_time(
        limit: Rule,
        part: String,
        place: &Place,
        lines: usize,
        text: String,
    ) -> Self {
        let Place { line, file, pose, seconds } = *place;
        Self {
            limit,
            part,
            line,
            file,
            pose,
            of_second: false,
            seconds: Some(seconds),
            moves: lines,
            step: usize::MAX,
            share: 0.0,
            last: usize::MAX,
            before: f64::INFINITY,
            text,
        }
    }

    /// Whether both are about the same limit of the same part.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        let is_reach = self.limit == Limit::Reach;
        self.limit == other.limit
            && self.of_second == other.of_second
            && (is_reach || self.part == other.part)
    }
}

/// How near a program comes to a limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LeastMargin {
    /// The limit.
    pub limit: Rule,
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
    /// Number of its file, as of a break.
    pub file: usize,
}

/// What a program uses of an axis or joint, beside what there is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Range {
    /// Joint or axis.
    pub part: String,
    /// Unit of the values.
    pub unit: String,
    /// Smallest and largest value that the program asks for and that LinuxCNC makes of it. Of a joint the former is
    /// of first order over pieces of the path, which are cut to a hundredth of its range.
    pub used: [f64; 2],
    /// Smallest and largest value that the limits allow; infinite, `null` in JSON, where there is none.
    pub allowed: [f64; 2],
}

impl Range {
    pub(super) fn of(
        config: &Mechanism,
        limit: Limit,
        part: Part,
        used: [f64; 2],
        allowed: [f64; 2],
    ) -> Self {
        let unit = limits::unit(config, limit, part);
        Self { part: limits::part(config, limit, part), unit, used, allowed }
    }

    /// Adds values to those that are used.
    pub(super) fn widen(&mut self, used: [f64; 2]) {
        self.used = [self.used[0].min(used[0]), self.used[1].max(used[1])];
    }
}

/// What a line asks of the joints.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LineLoad {
    /// Line of the program.
    pub line: u32,
    /// Number of its file, as of a break.
    pub file: usize,
    /// Feeds of this line may be multiplied by this; above 1 there is room.
    pub factor: f64,
}

/// A place in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Place {
    /// Line of the program.
    pub line: u32,
    /// Number of its file, as of a break.
    pub file: usize,
    /// X Y Z A B C, machine units and degrees.
    pub pose: [f64; 6],
    /// Seconds since the program was started.
    pub seconds: f64,
}

/// Largest value of a joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Peak {
    /// Joint.
    pub joint: String,
    /// In the joint's unit, or that a second, or a second squared.
    pub value: f64,
    /// Its limit there.
    pub limit: f64,
    /// Where.
    #[serde(flatten)]
    pub place: Place,
}

impl Peak {
    /// As a share of the limit.
    pub fn share(&self) -> f64 {
        self.value / self.limit
    }
}

/// What LinuxCNC makes of a program in its servo cycles.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Timing {
    /// Seconds from the start of the program to its end.
    pub seconds: f64,
    /// How it ended.
    pub ending: Ending,
    /// Everything that LinuxCNC would show to the operator.
    pub messages: Vec<Message>,
    /// Largest speeds of the joints.
    pub speeds: Vec<Peak>,
    /// Largest accelerations of the joints.
    pub accelerations: Vec<Peak>,
    /// Following errors of the joints, where they come nearest to what LinuxCNC allows.
    pub following_errors: Vec<Peak>,
    /// Every feed may be multiplied by this.
    pub feed_factor: f64,
    /// The same of every line.
    pub lines: Vec<LineLoad>,
    /// Lowest and highest value of every extra axis, which stand among the ranges of the program.
    #[serde(skip)]
    pub(super) extra: Vec<[f64; 2]>,
    /// Limits left, which stand among the breaks of the program.
    #[serde(skip)]
    pub(super) breaks: Vec<Break>,
}

/// Everything of a program that depends on time.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Time {
    /// As LinuxCNC runs it.
    Judged(Timing),
    /// Why it could not be had.
    NotJudged(String),
}

/// What is known of a program on a machine.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Preflight {
    /// Moves.
    pub moves: usize,
    /// Length of the path of the control point, machine units.
    pub length: f64,
    /// Pieces that the moves were cut into.
    pub pieces: usize,
    /// Every limit of every part that the program leaves with its first place: those of the path in its
    /// order, then those that LinuxCNC's cycles show in the order of time.
    pub breaks: Vec<Break>,
    /// Least margin of every limit that the machine has.
    pub margins: Vec<LeastMargin>,
    /// What is used of the axes and joints.
    pub ranges: Vec<Range>,
    /// Length of the path with angles at half of the machine's size, of which [`Self::runnable`] is a share.
    #[serde(skip)]
    pub(super) advance: f64,
    /// Share of the path before the first break, turning included.
    pub runnable: f64,
    /// What depends on time.
    pub time: Time,
    /// Files and lines before which the tool offset changes while the platform is tilted.
    pub tilted_tool_changes: Vec<(usize, u32)>,
    /// Files and lines of rapids that go down to the machine's own Z0, below home.
    pub rapids_to_zero: Vec<(usize, u32)>,
    /// Where LinuxCNC leaves the path by more than the program allows: limits are judged where it goes.
    #[serde(skip)]
    pub off_path: Vec<Break>,
    /// Whether all moves end at `[TRAJ]HOME`.
    #[serde(skip)]
    pub(super) is_still: bool,
    /// Poses for the search of another work offset.
    #[serde(skip)]
    pub poses: Poses,
}

impl Time {
    /// Whether LinuxCNC ran the whole program.
    pub fn is_whole(&self) -> bool {
        matches!(self, Self::Judged(timing) if timing.ending == Ending::Finished)
    }
}

impl Preflight {
    /// Whether the program keeps all limits, as far as they were judged.
    pub fn fits(&self) -> bool {
        self.breaks.is_empty()
    }
}
