// SPDX-License-Identifier: GPL-2.0-or-later
//! Results of a program on a machine.

use crate::follow_move::{advance, arm};
use crate::work_offset::Poses;
use kinematics::{Limit, Part, World};
use linuxcnc::row::{Ending, Message, Row};
use machine::limits;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use serde::{Serialize, Serializer};

/// A requirement on a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// A limit of the machine.
    Limit(Limit),
    /// The least distance of two mechanisms.
    Mechanisms,
    /// The tolerance of LinuxCNC's path.
    Path,
    /// LinuxCNC's limit of a joint's following error.
    FollowingError,
    /// LinuxCNC's own checks, which end in a message.
    Control,
}

impl Rule {
    /// Returns its name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Limit(limit) => limit.name(),
            Self::Mechanisms => "mechanisms apart",
            Self::Path => "path",
            Self::FollowingError => "following error",
            Self::Control => "LinuxCNC",
        }
    }

    /// Returns whether another feed can satisfy it, and another position cannot.
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

/// A violation of a limit by a program, at its first position.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Break {
    /// The limit.
    pub limit: Rule,
    /// Joint, leg or axis; empty for a message of LinuxCNC.
    pub part: String,
    /// Line of the program, counted from 1; 0 for moves before it.
    pub line: u32,
    /// Number of the file of the line, 0 for the program itself.
    pub file: usize,
    /// X Y Z A B C there, machine units and degrees, of the mechanism concerned.
    pub pose: [f64; 6],
    /// The words of the program there: letters with their values, those of extra axes and, in LinuxCNC's cycles, of
    /// both mechanisms included.
    #[serde(serialize_with = "by_letter")]
    pub words: Vec<(char, f64)>,
    /// Whether the second of two mechanisms is concerned.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub of_second: bool,
    /// Seconds since the start of the program, for violations in LinuxCNC's cycles.
    pub seconds: Option<f64>,
    /// Number of moves that violate the limit; of lines, for violations in LinuxCNC's cycles.
    pub moves: usize,
    /// Number of the move, from 0. For violations in LinuxCNC's cycles: of the next move, if known.
    #[serde(skip)]
    pub(super) step: usize,
    /// Legal share of the move.
    #[serde(skip)]
    pub(super) share: f64,
    /// The last counted move.
    #[serde(skip)]
    pub(super) last: usize,
    /// Length of the program before it, as [`Preflight::advance`].
    #[serde(skip)]
    pub(super) before: f64,
    /// A sentence: the part and its violation.
    pub text: String,
}

impl Break {
    /// Creates a violation in LinuxCNC's cycles.
    pub(super) fn in_time(
        config: &MachineConfig,
        limit: Rule,
        part: String,
        place: &Place,
        lines: usize,
        text: String,
    ) -> Self {
        let Place { line, file, pose, seconds, world, advance } = *place;
        Self {
            limit,
            part,
            line,
            file,
            pose,
            words: config.words(&world),
            of_second: false,
            seconds: Some(seconds),
            moves: lines,
            step: usize::MAX,
            share: 0.0,
            last: usize::MAX,
            before: advance,
            text,
        }
    }

    /// Returns whether both concern the same limit of the same part.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        let is_reach = self.limit == Limit::Reach;
        self.limit == other.limit
            && self.of_second == other.of_second
            && (is_reach || self.part == other.part)
    }
}

/// The least margin of a program to a limit.
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
    /// The part as the core numbers it.
    #[serde(skip)]
    pub of: Part,
    /// Line of the program.
    pub line: u32,
    /// Number of its file, as of a break.
    pub file: usize,
}

/// The used and the allowed range of an axis or joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Range {
    /// Joint or axis.
    pub part: String,
    /// Unit of the values.
    pub unit: String,
    /// Smallest and largest value, both of the program and in LinuxCNC's cycles. For a joint the program's is
    /// of first order over pieces of the path, which are cut to a hundredth of its range.
    pub used: [f64; 2],
    /// Smallest and largest value that the limits allow; infinite, `null` in JSON, without a limit.
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

    /// Extends the used range.
    pub(super) fn widen(&mut self, used: [f64; 2]) {
        self.used = [self.used[0].min(used[0]), self.used[1].max(used[1])];
    }
}

/// The joint load of a line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LineLoad {
    /// Line of the program.
    pub line: u32,
    /// Number of its file, as of a break.
    pub file: usize,
    /// Largest factor of the feeds of this line; above 1 there is room.
    pub factor: f64,
}

/// A position in the program, with its time.
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
    /// LinuxCNC's position, with the values of extra axes and of a second mechanism.
    #[serde(skip)]
    pub(super) world: World,
    /// Length of the path so far, as [`Preflight::advance`].
    #[serde(skip)]
    pub(super) advance: f64,
}

/// The positions of servo cycles, one after another.
pub(super) struct Places<'a> {
    config: &'a MachineConfig,
    last: Option<Row>,
    advance: f64,
}

impl<'a> Places<'a> {
    pub(super) const fn new(config: &'a MachineConfig) -> Self {
        Self { config, last: None, advance: 0.0 }
    }

    /// Returns the position in the next cycle.
    pub(super) fn next(&mut self, row: &Row) -> Place {
        let last = self.last.replace(*row).unwrap_or(*row);
        for mechanism in &self.config.mechanisms {
            let world = |row: &Row| mechanism.world(&row.of(mechanism).pose, &row.extra.positions);
            let (from, to) = (world(&last), world(row));
            let delta = std::array::from_fn(|k| to[k] - from[k]);
            self.advance += advance(&delta, arm(mechanism));
        }
        Place {
            line: row.line,
            file: row.file,
            pose: row.pose,
            seconds: row.cycle as f64 * self.config.period,
            world: row.extra.world,
            advance: self.advance,
        }
    }
}

/// Serializes words as objects.
fn by_letter<S: Serializer>(words: &[(char, f64)], to: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Word {
        letter: char,
        value: f64,
    }
    to.collect_seq(words.iter().map(|(letter, value)| Word { letter: *letter, value: *value }))
}

/// Largest load of a joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Peak {
    /// Joint.
    pub joint: String,
    /// Value in the joint's unit, or per second, or per second squared.
    pub value: f64,
    /// Its limit there.
    pub limit: f64,
    /// Its position and time.
    #[serde(flatten)]
    pub place: Place,
}

impl Peak {
    /// Returns the value as a share of the limit.
    pub fn share(&self) -> f64 {
        self.value / self.limit
    }
}

/// Timing of a program in LinuxCNC's servo cycles.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Timing {
    /// Seconds from the start of the program to its end.
    pub seconds: f64,
    /// How it ended.
    pub ending: Ending,
    /// All messages that LinuxCNC would show to the operator.
    pub messages: Vec<Message>,
    /// Largest speeds of the joints.
    pub speeds: Vec<Peak>,
    /// Largest accelerations of the joints.
    pub accelerations: Vec<Peak>,
    /// Following errors of the joints, where they are nearest to LinuxCNC's limit.
    pub following_errors: Vec<Peak>,
    /// Largest factor of every feed.
    pub feed_factor: f64,
    /// Largest feed factor of every line.
    pub lines: Vec<LineLoad>,
    /// Violated limits, which are among the violations of the program.
    #[serde(skip)]
    pub(super) breaks: Vec<Break>,
}

/// The results of a program that depend on time.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Time {
    /// As LinuxCNC runs it.
    Judged(Timing),
    /// Why it is unknown.
    NotJudged(String),
}

/// The results of a program on a machine.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Preflight {
    /// Moves.
    pub moves: usize,
    /// Length of the path of the control point, machine units.
    pub length: f64,
    /// Number of pieces into which the moves were cut.
    pub pieces: usize,
    /// Every limit of every part that the program violates, at its first position: those of the path in
    /// order, then those in LinuxCNC's cycles by time.
    pub breaks: Vec<Break>,
    /// Least margin of every limit that the machine has.
    pub margins: Vec<LeastMargin>,
    /// Used ranges of the axes and joints.
    pub ranges: Vec<Range>,
    /// Whether they, and the margins to limits of the pose, cover all moves of the program: not if LinuxCNC stops it even
    /// without its limits.
    pub is_whole: bool,
    /// File and line of the last move.
    #[serde(skip)]
    pub(super) last: (usize, u32),
    /// Length of the path with angles multiplied by half of the machine's size, to which [`Self::runnable`] relates.
    #[serde(skip)]
    pub(super) advance: f64,
    /// Share of the path before the first violation or LinuxCNC's stop, rotation and extra axes included.
    pub runnable: f64,
    /// What depends on time.
    pub time: Time,
    /// Files and lines before which the tool offset changes while the platform is tilted.
    pub tilted_tool_changes: Vec<(usize, u32)>,
    /// Files and lines of rapids that go down to the machine's own Z0, below home.
    pub rapids_to_zero: Vec<(usize, u32)>,
    /// Files and lines of the first feed move with each new tool while the spindle stands, in a program that has turned it.
    #[serde(skip)]
    pub feeds_without_spindle: Vec<(usize, u32)>,
    /// Deviations of LinuxCNC's path beyond the program's tolerance: limits are judged on the actual path.
    #[serde(skip)]
    pub off_path: Vec<Break>,
    /// Whether all moves end at `[TRAJ]HOME`.
    #[serde(skip)]
    pub(super) is_still: bool,
    /// Poses for the search for another work offset.
    #[serde(skip)]
    pub poses: Poses,
}

impl Time {
    /// Returns whether LinuxCNC ran the whole program.
    pub fn is_whole(&self) -> bool {
        matches!(self, Self::Judged(timing) if timing.ending == Ending::Finished)
    }
}

impl Preflight {
    /// Returns the share of the path before a violation.
    pub(super) fn share(&self, before: f64) -> f64 {
        if self.advance > 0.0 { before / self.advance } else { 0.0 }
    }

    /// Returns whether the program satisfies all limits that were judged.
    pub fn fits(&self) -> bool {
        self.breaks.is_empty()
    }
}
