// SPDX-License-Identifier: GPL-2.0-or-later
//! What a run of the control tells: a row in every servo cycle, messages, and its end.

use kinematics::{Joints, MAX_EXTRA, Vector3, World};
use machine::read::mechanism::Mechanism;
use serde::Serialize;

/// States of a servo cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flags {
    /// `motion.motion-enabled`: the drives are on.
    pub on: bool,
    /// `pkmkins.tool-busy`: the module moves the joints for another tool offset.
    pub tool_busy: bool,
    /// `pkmkins.feed-inhibit`: the module holds the program.
    pub held: bool,
}

/// The extra axes in a servo cycle, in joint order; 0 beyond the last one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extra {
    /// Commanded values, which are the coordinates of their letters.
    pub positions: [f64; MAX_EXTRA],
    pub errors: [f64; MAX_EXTRA],
    pub allowed: [f64; MAX_EXTRA],
    /// LinuxCNC's whole commanded pose, in which they are coordinates: `axis.L.pos-cmd`. Commands of
    /// joints are two cycles behind it, and smoothed.
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
    /// Number of the move that is made, or was made last; [`Commanded`] counts from 0.
    pub number: usize,
    /// States.
    pub flags: Flags,
    /// Commanded pose of the tool, `axis.L.pos-cmd`: X Y Z in machine units, A B C in degrees. 0 for a
    /// letter of an extra axis or of a second mechanism, whose coordinate is no part of it.
    pub pose: [f64; 6],
    /// Pose and tool offset in effect of a second mechanism, in its own coordinates; zeros without one.
    pub second: Beside,
    /// Commanded joint values, `joint.N.pos-cmd`, those of a second mechanism behind the first one's.
    pub joints: Joints,
    /// Following errors, `joint.N.f-error`, of drives that keep the joint's speed and acceleration.
    pub errors: Joints,
    /// What LinuxCNC allows them, `joint.N.f-error-lim`.
    pub allowed: Joints,
    /// The same of the extra axes.
    pub extra: Extra,
    /// Tool offset in effect, `pkmkins.tool-offset-eff-x` to `-z`, machine units.
    pub tool: [f64; 3],
    /// Share of the feed that the guard allows, `pkmkins.feed-scale`.
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

    /// The machine's own pose (x y z in machine units, a b c in degrees), and the tool vector that it
    /// belongs to.
    pub fn machine(&self, config: &Mechanism) -> ([f64; 6], Vector3<f64>) {
        let Beside { pose, tool } = self.of(config);
        let tool = Vector3::from(tool);
        if config.chain.is_empty() {
            return (pose, tool);
        }
        let pose = config.chain.to_machine(&self.extra.world, &tool);
        (pose.unwrap_or([f64::NAN; 6]), config.chain.machine_tool(&tool))
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Spindle {
    /// It stands. The speed of its S word, 1/min; 0 where there was none.
    Standing(f64),
    /// It turns, 1/min.
    Turning(f64),
    /// G96: its speed depends on the place.
    Surface,
    /// Nobody knows.
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

/// What a circular move goes around.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Arc {
    /// Center, machine units.
    pub center: [f64; 3],
    /// Axis, of any length.
    pub normal: [f64; 3],
    /// Full turns beside the arc, from 0 on anticlockwise, from -1 down clockwise.
    pub turns: i32,
}

/// What a spindle asks of a move that keeps to its places: G33 and G33.1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Thread {
    /// Machine units a turn.
    pub pitch: f64,
    /// The fastest turning, 1/min.
    pub turning: f64,
    /// The fastest speed that LinuxCNC gives the move, machine units a second.
    pub fastest: f64,
}

impl Thread {
    /// Returns the speed that the thread needs, machine units a second.
    pub fn needed(&self) -> f64 {
        self.pitch * self.turning / 60.0
    }
}

/// A move as milltask asks motion for it: straight or circular in X Y Z, straight in all other letters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Commanded {
    /// Line of the program, counted from 1; 0 for none.
    pub line: u32,
    /// Number of the file that the line is in, 0 for the program.
    pub file: usize,
    pub kind: CommandedKind,
    /// X Y Z A B C U V W of its end: machine units and degrees.
    pub end: World,
    /// The circle, where it is not straight.
    pub arc: Option<Arc>,
    /// Feed in machine units a second; in degrees where only rotary axes move.
    pub feed: f64,
    /// Whether the feed follows the spindle.
    pub follows_spindle: bool,
    /// Full turns of the program's arc that LinuxCNC has made this straight move of; 0 where it has not.
    pub lost_turns: u32,
    /// How far the tool may leave the path at its end, machine units; 0 for an exact stop, infinite where the
    /// program sets no bound.
    pub tolerance: f64,
    /// Tool offset in effect, in LinuxCNC's letters.
    pub tool: World,
    pub spindle: Spindle,
    /// What the spindle asks of it, where it keeps to the spindle's places.
    pub thread: Option<Thread>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum MessageKind {
    /// An error, which stops the program.
    Error,
    Text,
    /// `(MSG,...)` and the like in the program.
    Display,
}

/// What LinuxCNC shows to the operator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Message {
    /// Channel.
    pub kind: MessageKind,
    /// Its words.
    pub text: String,
    /// Line of the program that moves or moved last; 0 before the first.
    pub line: u32,
    /// Number of the file that the line is in, 0 for the program.
    pub file: usize,
    /// Line that the interpreter has read to, which runs ahead of the motion.
    pub read: u32,
    /// Seconds since the program was started.
    pub seconds: f64,
}

impl Message {
    /// The line that it is about: the one that it names, else the one that moves, else the one that is read.
    pub fn place(&self) -> u32 {
        let behind = self.text.split_once(" on line ").map_or("", |(_, rest)| rest);
        let digits = behind.split(|c: char| !c.is_ascii_digit()).next().unwrap_or_default();
        digits.parse().unwrap_or(if self.line > 0 { self.line } else { self.read })
    }

    /// Whether it tells what went wrong.
    pub fn is_error(&self) -> bool {
        self.kind == MessageKind::Error
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Ending {
    Finished,
    /// The control stopped it; the messages say why.
    Stopped,
}

/// What is known after a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outcome {
    pub ending: Ending,
    /// Servo cycles from the start of the program to its end.
    pub cycles: u64,
    /// The same in seconds of the machine's time.
    pub seconds: f64,
    /// Everything the operator would have seen.
    pub messages: Vec<Message>,
}
