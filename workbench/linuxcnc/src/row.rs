// SPDX-License-Identifier: GPL-2.0-or-later
//! The results of a run: a row in every servo cycle, messages, and the end.

use kinematics::{Joints, MAX_EXTRA, Vector3, World};
use machine::read::mechanism::Mechanism;
use serde::Serialize;

/// States of a servo cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flags {
    /// `motion.motion-enabled`: the drives are on.
    pub on: bool,
    /// `pkmkins.tool-busy`: the module moves the joints to another tool offset.
    pub tool_busy: bool,
    /// `pkmkins.feed-inhibit`: the module stops the program.
    pub held: bool,
}

/// The extra axes in a servo cycle, in joint order; 0 beyond the last one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extra {
    /// Commanded values, which are the coordinates of their letters.
    pub positions: [f64; MAX_EXTRA],
    pub errors: [f64; MAX_EXTRA],
    pub allowed: [f64; MAX_EXTRA],
    /// LinuxCNC's whole commanded pose with their coordinates: `axis.L.pos-cmd`. Commands of
    /// joints lag it by two cycles, and are smoothed.
    pub world: World,
}

/// A mechanism in a servo cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Beside {
    /// Commanded pose: X Y Z in machine units, A B C in degrees.
    pub pose: [f64; 6],
    /// Tool offset in effect, machine units.
    pub tool: [f64; 3],
}

/// One servo cycle of a program.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// Servo cycles since the program was started.
    pub cycle: u64,
    /// `motion.program-line`, counted from 1; 0 before the first move.
    pub line: u32,
    /// Number of the file that the line is in, as of [`Commanded`].
    pub file: usize,
    /// Number of the present or last move; [`Commanded`] counts from 0.
    pub number: usize,
    /// States.
    pub flags: Flags,
    /// Commanded pose of the tool, `axis.L.pos-cmd`: X Y Z in machine units, A B C in degrees. 0 for a
    /// letter of an extra axis or of a second mechanism, whose coordinate is not part of it.
    pub pose: [f64; 6],
    /// Pose and tool offset in effect of a second mechanism, in its own coordinates; zeros without one.
    pub second: Beside,
    /// Commanded joint values, `joint.N.pos-cmd`, those of a second mechanism after the first one's.
    pub joints: Joints,
    /// Following errors, `joint.N.f-error`, of drives that obey the joint's limits of speed and acceleration.
    pub errors: Joints,
    /// LinuxCNC's limits of them, `joint.N.f-error-lim`.
    pub allowed: Joints,
    /// The same of the extra axes.
    pub extra: Extra,
    /// Tool offset in effect, `pkmkins.tool-offset-eff-x` to `-z`, machine units.
    pub tool: [f64; 3],
    /// Fraction of the feed that the guard allows, `pkmkins.feed-scale`.
    pub feed: f64,
}

impl Row {
    /// Returns the commanded pose of a mechanism in its own letters, and its tool offset.
    pub fn of(&self, config: &Mechanism) -> Beside {
        match config.place.is_second {
            true => self.second,
            false => Beside { pose: self.pose, tool: self.tool },
        }
    }

    /// Returns the machine's own pose (x y z in machine units, a b c in degrees), and its tool
    /// vector.
    pub fn machine(&self, config: &Mechanism) -> ([f64; 6], Vector3<f64>) {
        let Beside { pose, tool } = self.of(config);
        let tool = Vector3::from(tool);
        if config.chain.is_empty() {
            return (pose, tool);
        }
        let pose = config.machine.pose_of_world(&config.chain, &self.extra.world, &tool);
        (pose.unwrap_or([f64::NAN; 6]), config.chain.machine_tool(&tool))
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Spindle {
    /// Stopped. The speed of its S word, 1/min; 0 without one.
    Standing(f64),
    /// Turning, 1/min.
    Turning(f64),
    /// G96: its speed depends on the position.
    Surface,
    /// Not known.
    #[default]
    Unknown,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CommandedKind {
    /// G0, and moves for the change of a tool.
    #[default]
    Rapid,
    /// G1, G2, G3.
    Feed,
    /// G38.
    Probe,
    /// G33.1: to its end and back.
    Tap,
}

/// The circle of an arc move.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Arc {
    /// Center, machine units.
    pub center: [f64; 3],
    /// Axis, of any length.
    pub normal: [f64; 3],
    /// Additional full turns: from 0 up counterclockwise, from -1 down clockwise.
    pub turns: i32,
}

/// The spindle's requirements on a synchronized move: G33 and G33.1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Thread {
    /// Machine units per turn.
    pub pitch: f64,
    /// The largest spindle speed, 1/min.
    pub turning: f64,
    /// The largest speed that LinuxCNC gives the move, machine units per second.
    pub fastest: f64,
}

impl Thread {
    /// Returns the speed that the thread needs, machine units per second.
    pub fn needed(&self) -> f64 {
        self.pitch * self.turning / 60.0
    }
}

/// A move as milltask commands it: straight or circular in X Y Z, straight in all other letters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Commanded {
    /// Line of the program, counted from 1; 0 for none.
    pub line: u32,
    /// Number of the file that the line is in, 0 for the program.
    pub file: usize,
    pub kind: CommandedKind,
    /// X Y Z A B C U V W of its end: machine units and degrees.
    pub end: World,
    /// The circle; `None` for a straight move.
    pub arc: Option<Arc>,
    /// Feed in machine units per second; in degrees if only rotary axes move.
    pub feed: f64,
    /// Whether the feed follows the spindle.
    pub follows_spindle: bool,
    /// Whether it is a feed move with a feed per turn of the spindle: G95, G33.
    pub is_per_turn: bool,
    /// Full turns of the program's arc that LinuxCNC has lost in making this straight move of it; otherwise 0.
    pub lost_turns: u32,
    /// Allowed deviation from the path at its end, machine units; 0 for an exact stop, infinite if the
    /// program sets no bound.
    pub tolerance: f64,
    /// Tool offset in effect, in LinuxCNC's letters.
    pub tool: World,
    pub spindle: Spindle,
    /// The spindle's requirements, if the move is synchronized with the spindle's position.
    pub thread: Option<Thread>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum MessageKind {
    /// An error, which stops the program.
    Error,
    Text,
    /// `(MSG,...)` and similar in the program.
    Display,
}

/// A message that LinuxCNC shows to the operator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Message {
    /// Channel.
    pub kind: MessageKind,
    /// Text.
    pub text: String,
    /// Line of the program of the present or last move; 0 before the first.
    pub line: u32,
    /// Number of the file that the line is in, 0 for the program.
    pub file: usize,
    /// Line that the interpreter has read to, which runs ahead of the motion.
    pub read: u32,
    /// Seconds since the program was started.
    pub seconds: f64,
}

impl Message {
    /// Returns the line of the message: the one that it names, otherwise the move's, otherwise the one being read.
    pub fn place(&self) -> u32 {
        self.named_line().unwrap_or(if self.line > 0 { self.line } else { self.read })
    }

    /// Returns the line that the text names.
    pub(crate) fn named_line(&self) -> Option<u32> {
        let behind = self.text.split_once(" on line ").map_or("", |(_, rest)| rest);
        behind.split(|c: char| !c.is_ascii_digit()).next().unwrap_or_default().parse().ok()
    }

    /// Returns whether it reports an error.
    pub fn is_error(&self) -> bool {
        self.kind == MessageKind::Error
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Ending {
    Finished,
    /// LinuxCNC stopped it; the messages give the reason.
    Stopped,
}

/// The result of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    pub ending: Ending,
    /// Servo cycles from the start of the program to its end.
    pub cycles: u64,
    /// The same in seconds of the machine's time.
    pub seconds: f64,
    /// All messages for the operator.
    pub messages: Vec<Message>,
}
