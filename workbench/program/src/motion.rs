// SPDX-License-Identifier: GPL-2.0-or-later
//! The moves of a program, as LinuxCNC's task commands them to motion.
//!
//! LinuxCNC itself reads the program, in virtual time ([`linuxcnc`]), with the machine's tool, parameters and
//! position. It commands straight and circular moves; circular ones are split here
//! into short straight ones.

use kinematics::{Letter, MAX_EXTRA, POSE_LETTERS, Pose, Vector3, World};
use linuxcnc::process::{Event, Options, run_with_moves};
use linuxcnc::refusal::NotJudged;
pub use linuxcnc::row::Spindle;
use linuxcnc::row::{Arc, Commanded, CommandedKind, Ending, Outcome};
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Folder of the programs that come with LinuxCNC, as Debian's package has it.
pub const LINUXCNC_PROGRAMS: &str = "/usr/share/linuxcnc/ncfiles";

/// Rounding of LinuxCNC's positions, as a share of the machine's size.
pub(super) const ROUNDING: f64 = 1e-9;

/// Largest distance of an arc from its straight moves, in mm: far below the resolution of any
/// machine, with only a few hundred moves per turn.
const CHORD_ERROR_MM: f64 = 1e-4;

/// Least number of straight moves per full turn: even an arc of rounding size keeps its direction.
const LEAST_CHORDS: f64 = 16.0;

/// Kind of a straight move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MoveKind {
    /// G0.
    Rapid,
    /// G1, and the pieces of arcs.
    Feed,
    /// G38: up to its end point, without contact.
    Probe,
}

/// One straight move; it starts where the one before ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// Kind.
    pub kind: MoveKind,
    /// Line of the program, counted from 1; 0 for moves before the program.
    pub line: u32,
    /// End point as motion receives it, tool length included: x y z in machine units,
    /// a b c in degrees.
    pub end: [f64; 6],
    /// Feed in machine units per second; infinite if the spindle determines it.
    pub feed: f64,
    /// Feed of moves of rotary axes alone, degrees per second.
    pub angular_feed: f64,
    /// Active tool length offset x y z, machine units.
    pub tool: [f64; 3],
    /// Number of the file of its line, 0 for the program.
    pub file: usize,
    /// Whether an extra axis rotates in it, or moves together with a tool.
    pub extra: bool,
    /// The same move of the second mechanism, in its own coordinates, if the machine has two.
    pub second: Option<Beside>,
    /// Duration in seconds, if another mechanism affects it.
    pub lasts: Option<f64>,
    /// Values of the extra axes at its end, in joint order: machine units and degrees.
    pub extra_end: [f64; MAX_EXTRA],
    /// The spindle during the move.
    pub spindle: Spindle,
    /// Whether its feed is one per turn of the spindle: G95, G33.
    pub is_per_turn: bool,
}

/// The part of a move of the second of two mechanisms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beside {
    /// End point, as [`Move::end`].
    pub end: [f64; 6],
    /// Tool length offset, as [`Move::tool`].
    pub tool: [f64; 3],
}

impl Move {
    /// Returns the move of each mechanism.
    pub fn of_each(&self) -> impl Iterator<Item = Self> {
        let own = |Beside { end, tool }| Self { end, tool, second: None, ..*self };
        [Self { second: None, ..*self }].into_iter().chain(self.second.map(own))
    }

    /// Returns whether the machine is at home at its end with all its axes, within LinuxCNC's rounding.
    pub fn stays(&self, config: &Mechanism) -> bool {
        let slack = ROUNDING * config.machine.size();
        let at = |values: &[f64], home: &[f64]| {
            values.iter().zip(home).all(|(value, home)| (value - home).abs() <= slack)
        };
        at(&self.end, &config.start) && at(&self.extra_end, &extra_home(config))
    }
}

/// Returns the values of the extra axes at home, as of [`Move::extra_end`].
pub fn extra_home(config: &Mechanism) -> [f64; MAX_EXTRA] {
    std::array::from_fn(|n| config.extra.get(n).map_or(0.0, |axis| axis.joint.home))
}

/// Why the moves of a program are unknown.
#[derive(Debug, thiserror::Error)]
pub enum ProgramError {
    /// LinuxCNC did not run it.
    #[error(transparent)]
    NotJudged(#[from] NotJudged),
    /// LinuxCNC stops it, with file, line and LinuxCNC's message.
    #[error("{}:{line}: LinuxCNC stops the program: {text}", program.display())]
    Stopped {
        /// The program.
        program: PathBuf,
        /// Line, counted from 1.
        line: u32,
        /// Its messages.
        text: String,
    },
}

/// Reads all moves of a program on this machine.
///
/// # Errors
/// As [`read`].
pub fn moves(
    config: &MachineConfig,
    program: &Path,
    block: Option<&str>,
) -> Result<Vec<Move>, ProgramError> {
    Ok(read(config, program, block)?.0)
}

/// Reads all moves of a program on this machine, the first one ending at `[TRAJ]HOME`, and the names of its files.
///
/// Limits of axes and joints are disabled, so that a program is read beyond its first violation. `block` runs
/// before it, for example to change the work offset. Lines that begin with `/` are skipped, as in LinuxCNC until
/// the operator changes it.
///
/// # Errors
/// LinuxCNC cannot run the program, or stops it before its end for a reason other than a pose that the machine
/// cannot reach; that pose is the end of the last move.
pub fn read(
    config: &MachineConfig,
    program: &Path,
    block: Option<&str>,
) -> Result<(Vec<Move>, Vec<PathBuf>), ProgramError> {
    let options = Options { block: block.map(Into::into), open_limits: true, ..Options::default() };
    let mut translator = Translator::new(config);
    let (mut all, mut files) = (vec![], vec![]);
    let outcome = run_with_moves(config, program, &options, |event| {
        match event {
            Event::Move(commanded) => translator.see(commanded, |step| all.push(*step)),
            Event::File(name) => files.push(name.into()),
            Event::Row(_) => {}
        }
        ControlFlow::Continue(())
    })?;
    match outcome.ending {
        Ending::Finished => Ok((all, files)),
        Ending::Stopped if all.last().is_some_and(|last| !is_reached(config, last)) => {
            Ok((all, files))
        }
        Ending::Stopped => Err(stopped(program, &files, &outcome)),
    }
}

/// Returns whether the pose at the end of a move is legal.
fn is_reached(config: &MachineConfig, step: &Move) -> bool {
    config.mechanisms.iter().zip(step.of_each()).all(|(config, step)| {
        let tool = config.spindle + Vector3::from(step.tool);
        let pose = config.carried(&step.end, &step.extra_end, &tool);
        let tool = config.chain.machine_tool(&tool);
        pose.is_ok_and(|pose| config.machine.at(&Pose::from_degrees(pose), &tool).is_ok())
    })
}

fn stopped(program: &Path, files: &[PathBuf], outcome: &Outcome) -> ProgramError {
    let errors: Vec<_> = outcome.messages.iter().filter(|message| message.is_error()).collect();
    let texts: Vec<&str> = errors.iter().map(|message| message.text.as_str()).collect();
    ProgramError::Stopped {
        // The first file is the program, which keeps the name that the user gave it.
        program: errors
            .first()
            .filter(|message| message.file > 0)
            .and_then(|message| files.get(message.file))
            .map_or(program, |file| file)
            .into(),
        line: errors.first().map_or(0, |message| message.place()).max(1),
        text: if texts.is_empty() { "without a message".into() } else { texts.join("; ") },
    }
}

/// Converts LinuxCNC's commands to straight moves of a machine.
pub struct Translator<'a> {
    config: &'a MachineConfig,
    /// The coordinates of each mechanism that a letter of the program sets.
    set: Vec<[bool; 6]>,
    /// Letters of the extra axes.
    extra: [bool; 9],
    /// End of the last command, in LinuxCNC's letters.
    at: World,
    line: u32,
}

impl<'a> Translator<'a> {
    /// Creates the state before the first command.
    pub fn new(config: &'a MachineConfig) -> Self {
        let letters = axes(config);
        let extra: String = config.first().extra_axes.letters().collect();
        let is_set = |mechanism: &Mechanism, letter| match config.second_letters {
            // A constant coordinate of one of two mechanisms may be a letter of the other.
            Some(_) => !mechanism.machine.layout().is_held(letter),
            None => letters.contains(letter.name()) && !extra.contains(letter.name()),
        };
        let set = config.mechanisms.iter().map(|one| Letter::ALL.map(|letter| is_set(one, letter)));
        Self {
            config,
            set: set.collect(),
            extra: POSE_LETTERS.map(|letter| extra.contains(letter)),
            at: [0.0; 9],
            line: 0,
        }
    }

    /// Passes the straight moves of a command to `show`.
    pub fn see(&mut self, commanded: &Commanded, mut show: impl FnMut(&Move)) {
        // The lathe cycles G70 to G72 number their own blocks -1: they belong to the previous block.
        if commanded.line > 0 {
            self.line = commanded.line;
        }
        let from = self.at;
        let extra = self.line > 0 && self.moves_extra(&from, &commanded.end);
        match (commanded.kind, &commanded.arc) {
            (_, Some(arc)) => {
                let error = CHORD_ERROR_MM * self.config.units_per_mm;
                let arc = Circle::new(arc, &from, &commanded.end);
                let count = arc.chords(error);
                for n in 1..count {
                    let end = arc.at(f64::from(n) / f64::from(count));
                    show(&Move { extra, ..self.straight(commanded, &end) });
                }
                show(&Move { extra, ..self.straight(commanded, &commanded.end) });
            }
            (CommandedKind::Tap, None) => {
                show(&self.straight(commanded, &commanded.end));
                show(&self.straight(commanded, &from));
                return;
            }
            (_, None) => show(&Move { extra, ..self.straight(commanded, &commanded.end) }),
        }
        self.at = commanded.end;
    }

    /// Returns whether an extra axis rotates in a move, or moves together with a tool.
    fn moves_extra(&self, from: &World, end: &World) -> bool {
        let moved: [bool; 9] = std::array::from_fn(|k| from[k] != end[k]);
        let own = (0..9).any(|k| moved[k] && !self.extra[k]);
        (0..9).any(|k| moved[k] && self.extra[k] && (own || (3..6).contains(&k)))
    }

    fn straight(&self, commanded: &Commanded, end: &World) -> Move {
        let [x, y, z, .., u, v, w] = commanded.tool;
        let own = |(Mechanism { place, start, .. }, set): (&Mechanism, &[bool; 6])| Beside {
            end: std::array::from_fn(|k| if set[k] { end[place.places[k]] } else { start[k] }),
            tool: if place.is_second { [u, v, w] } else { [x, y, z] },
        };
        let mut each = self.config.mechanisms.iter().zip(&self.set).map(own);
        let first = each.next().expect("a machine has a mechanism");
        let feed = if commanded.follows_spindle { f64::INFINITY } else { commanded.feed };
        let mut extra_end = [0.0; MAX_EXTRA];
        extra_end
            .iter_mut()
            .zip(self.config.first().extra_axes.places())
            .for_each(|(to, k)| *to = end[k]);
        Move {
            kind: match commanded.kind {
                CommandedKind::Rapid => MoveKind::Rapid,
                CommandedKind::Feed | CommandedKind::Tap => MoveKind::Feed,
                CommandedKind::Probe => MoveKind::Probe,
            },
            line: self.line,
            end: first.end,
            feed,
            angular_feed: feed,
            tool: first.tool,
            file: commanded.file,
            extra: false,
            second: each.next(),
            lasts: None,
            extra_end,
            spindle: commanded.spindle,
            is_per_turn: commanded.is_per_turn,
        }
    }
}

/// A circular move: a helix or spiral in X Y Z, straight in all other letters.
#[derive(Clone, Copy, Debug)]
pub struct Circle {
    from: World,
    delta: World,
    center: Vector3<f64>,
    /// Vectors from the center to the start, and normal to it in the direction of rotation; both of the start's radius.
    across: [Vector3<f64>; 2],
    /// Displacement along the axis over the whole move.
    rise: Vector3<f64>,
    /// Growth of the radius, as a share of the start's.
    spiral: f64,
    radius: f64,
    angle: f64,
}

impl Circle {
    /// Distance between start and end below which an arc is a full turn for LinuxCNC, machine units.
    const FULL: f64 = 1e-6;

    /// Creates the move along `arc` between two poses.
    pub fn new(arc: &Arc, from: &World, end: &World) -> Self {
        let vector = |world: &World| Vector3::new(world[0], world[1], world[2]);
        let (start, stop, center) = (vector(from), vector(end), Vector3::from(arc.center));
        let normal = Vector3::from(arc.normal);
        let (turns, sense) = match arc.turns {
            turns if turns < 0 => (-1 - turns, -1.0),
            turns => (turns, 1.0),
        };
        let axis = normal * (sense / normal.norm());
        // The center in the start's plane.
        let center = center + axis * axis.dot(&(start - center));
        let out = start - center;
        let radius = out.norm();
        let rise = axis * axis.dot(&(stop - center));
        let flat = stop - center - rise;
        let across = axis.cross(&out);
        let mut angle = across.dot(&flat).atan2(out.dot(&flat));
        if angle <= 0.0 || (start - stop + rise).norm() < Self::FULL {
            angle = if (start - stop + rise).norm() < Self::FULL { TAU } else { angle + TAU };
        }
        Self {
            from: *from,
            delta: std::array::from_fn(|k| end[k] - from[k]),
            center,
            across: [out, across],
            rise,
            spiral: flat.norm() / radius - 1.0,
            radius,
            angle: angle + TAU * f64::from(turns),
        }
    }

    /// Returns the pose after a share of the move.
    pub fn at(&self, share: f64) -> World {
        let (sin, cos) = (self.angle * share).sin_cos();
        let out = (self.across[0] * cos + self.across[1] * sin) * (1.0 + self.spiral * share);
        let place = self.center + out + self.rise * share;
        let mut world: World = std::array::from_fn(|k| self.from[k] + share * self.delta[k]);
        (world[0], world[1], world[2]) = (place.x, place.y, place.z);
        world
    }

    /// Returns the distance of a point: exact on the curve, and to second order near it.
    pub fn distance(&self, place: &Vector3<f64>) -> f64 {
        let beside = *place - self.center;
        let turned = self.across[1].dot(&beside).atan2(self.across[0].dot(&beside)).rem_euclid(TAU);
        let point = |angle: f64| {
            let world = self.at((angle / self.angle).clamp(0.0, 1.0));
            (Vector3::new(world[0], world[1], world[2]) - *place).norm()
        };
        // The turn of a helix at the height of the point, and its neighbors.
        let rise = self.rise.dot(&self.rise);
        let share = if rise > 0.0 { self.rise.dot(&beside) / rise } else { 0.0 };
        let turn = ((share * self.angle - turned) / TAU).round();
        // For flat curves, which may be spirals, every turn.
        let turns = if rise > 0.0 {
            vec![turn - 1.0, turn, turn + 1.0]
        } else {
            (-1..=(self.angle / TAU) as i32).map(f64::from).collect()
        };
        let nearest = turns.into_iter().map(|n| point(turned + n * TAU));
        nearest.fold(point(0.0).min(point(self.angle)), f64::min)
    }

    /// Returns the number of straight moves that deviate by at most `error`.
    fn chords(&self, error: f64) -> u32 {
        let radius = self.radius * (1.0 + self.spiral.max(0.0));
        let step = (8.0 * error / radius.max(error)).sqrt().min(TAU / LEAST_CHORDS);
        (self.angle / step).ceil().max(1.0) as u32
    }
}

/// Returns the letters of the machine's axes.
fn axes(config: &MachineConfig) -> String {
    let given = config.ini.first("TRAJ", "COORDINATES").map_or("", |entry| entry.value.as_str());
    let given = given.to_ascii_uppercase();
    POSE_LETTERS.into_iter().filter(|letter| given.contains(*letter)).collect()
}
