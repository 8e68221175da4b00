// SPDX-License-Identifier: GPL-2.0-or-later
//! Limits of a pose, and of the path, in LinuxCNC's servo cycles.
//!
//! The moves of a program are proved as commanded ([`crate::move_sequence`]). The machine's motion
//! may differ: corners are rounded, and a tap continues until its spindle has stopped. So every
//! cycle is judged as well, with the same list of limits, and compared with the path.

use crate::motion::{Circle, ROUNDING};
use crate::report::{Break, Place, Places, Rule};
use kinematics::{
    Fault, Letter, Limit, Limits, MAX_EXTRA, MAX_JOINTS, Margin, Part, Pose, Vector3, World,
};
use linuxcnc::row::{Commanded, CommandedKind, Row, Thread};
use machine::limits;
use machine::proof::between::approach;
use machine::proof::reach::Reach;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use std::collections::VecDeque;
use std::mem::discriminant;

/// Deviation of LinuxCNC's own arithmetic of arcs from the path, as a share of the machine's size: its arcs are
/// accurate to some 1e-6 of their radius. A thousandth of a millimeter on a machine of a meter.
const OFF_PATH: f64 = 1e-6;

/// Rounding tolerance of a spindle-driven feed at the limit, due to units.
const SAME: f64 = 1.0 + 1e-9;

/// Judges cycles.
pub struct Cycles<'a> {
    machines: Vec<Judge<'a>>,
    /// Distance of two mechanisms, for the current tools.
    apart: Option<Apart<'a>>,
    path: Path,
    places: Places<'a>,
    config: &'a MachineConfig,
    beyond: Vec<Beyond>,
}

/// One mechanism.
struct Judge<'a> {
    config: &'a Mechanism,
    limits: Limits,
    before: Option<([f64; 6], Vector3<f64>, [f64; MAX_EXTRA])>,
    /// Smallest and largest value of every programmed axis, and of every joint.
    axes: [[f64; 2]; 6],
    joints: [[f64; 2]; MAX_JOINTS],
    extra: [[f64; 2]; MAX_EXTRA],
}

/// The distance of two mechanisms.
struct Apart<'a> {
    configs: [&'a Mechanism; 2],
    reaches: [Reach<'a>; 2],
    tools: [Vector3<f64>; 2],
}

/// A violation of a limit.
struct Beyond {
    rule: Rule,
    name: String,
    of_second: bool,
    place: Place,
    /// Largest step of the program to which the cycle may belong, see [`Path::steps`].
    step: usize,
    /// File and line of the last violation.
    last: (usize, u32),
    lines: usize,
    /// Size of the violation.
    worst: f64,
    text: Text,
}

/// Form of its description.
enum Text {
    Bound(String),
    Fault(String),
    Path(f64),
    Turns(u32),
    Thread(Thread),
}

impl<'a> Cycles<'a> {
    /// Creates the state before the first cycle.
    ///
    /// # Errors
    /// A spindle offset without a legal pose at home.
    pub fn new(config: &'a MachineConfig) -> Result<Self, Fault> {
        let apart = match config.mechanisms.as_slice() {
            [first, second] => {
                let configs = [first, second];
                let reaches = [Reach::new(first)?, Reach::new(second)?];
                Some(Apart { configs, reaches, tools: configs.map(|config| config.spindle) })
            }
            _ => None,
        };
        Ok(Self {
            machines: config.mechanisms.iter().map(Judge::new).collect(),
            apart,
            path: Path::default(),
            places: Places::new(config),
            config,
            beyond: vec![],
        })
    }

    /// Adds the next move, which ends after that many steps of the program ([`crate::motion::Move`]).
    pub fn take(&mut self, commanded: &Commanded, steps: usize) {
        let turns = (commanded.lost_turns > 0).then_some(Text::Turns(commanded.lost_turns));
        let thread = commanded.thread.filter(|thread| !(thread.needed() <= thread.fastest * SAME));
        for text in turns.into_iter().chain(thread.map(Text::Thread)) {
            let place = Place {
                line: commanded.line,
                file: commanded.file,
                pose: std::array::from_fn(|k| commanded.end[k]),
                seconds: 0.0,
                world: commanded.end,
                // LinuxCNC executes the whole program in spite of it.
                advance: f64::INFINITY,
            };
            self.note(Rule::Path, (String::new(), false), (place, steps), 0.0, text);
        }
        self.path.take(commanded, steps);
    }

    /// Judges a servo cycle.
    pub fn see(&mut self, row: &Row) {
        if !row.flags.on {
            return;
        }
        let place = self.places.next(row);
        let mut found = vec![];
        let mut moved = false;
        for (n, judge) in self.machines.iter_mut().enumerate() {
            let of_second = n > 0;
            moved |= judge.see(row, |margin, fault| {
                found.push((Rule::Limit(margin.limit), margin, fault, of_second));
            });
        }
        if !moved {
            return;
        }
        let off = self.path.off(row);
        let step = self.path.steps(row);
        for (rule, margin, fault, of_second) in found {
            let config = self.machines[usize::from(of_second)].config;
            let name = limits::part(config, margin.limit, margin.part);
            let text = match fault {
                Some(fault) => Text::Fault(fault.to_string()),
                None => Text::Bound(limits::sentence(config, &margin)),
            };
            let place = Place { pose: row.of(config).pose, ..place };
            self.note(rule, (name, of_second), (place, step), -margin.room(), text);
        }
        if let Some((off, allowed)) = off
            && off > allowed + OFF_PATH * self.config.first().machine.size()
        {
            let part = (String::new(), false);
            self.note(Rule::Path, part, (place, step), off, Text::Path(allowed));
        }
        if let Some(apart) = &mut self.apart
            && let Some((bodies, distance)) = apart.beyond(row)
        {
            let configs = apart.configs;
            let name = limits::between(configs, bodies);
            let text = Text::Fault(format!(
                "{name} decreases to {distance:.4} {}",
                configs[0].length_unit()
            ));
            self.note(Rule::Mechanisms, (name, false), (place, step), -distance, text);
        }
    }

    fn note(
        &mut self,
        rule: Rule,
        (name, of_second): (String, bool),
        (place, step): (Place, usize),
        worst: f64,
        text: Text,
    ) {
        let line = (place.file, place.line);
        let is_same = |known: &&mut Beyond| {
            known.rule == rule
                && known.name == name
                && known.of_second == of_second
                && (rule != Rule::Path || discriminant(&known.text) == discriminant(&text))
        };
        if let Some(known) = self.beyond.iter_mut().find(is_same) {
            if known.last != line {
                (known.last, known.lines) = (line, known.lines + 1);
            }
            // A limit is listed with its first line, and its largest violation there.
            if worst > known.worst && (rule == Rule::Path || known.lines == 1) {
                (known.worst, known.text) = (worst, text);
            }
            return;
        }
        let last = line;
        self.beyond.push(Beyond {
            rule,
            name,
            of_second,
            place,
            step,
            last,
            lines: 1,
            worst,
            text,
        });
    }

    /// Returns the used ranges of the axes and joints, in the order of [`ranges`](crate::report::Preflight::ranges).
    pub fn used(&self) -> Vec<[f64; 2]> {
        self.machines.iter().flat_map(Judge::used).collect()
    }

    /// Returns the violations by time, and LinuxCNC's deviations from the path beyond the program's
    /// tolerance.
    pub fn finish(self) -> [Vec<Break>; 2] {
        let unit = self.config.length_unit();
        let (off, beyond): (Vec<_>, Vec<_>) =
            self.beyond.into_iter().partition(|found| matches!(found.text, Text::Path(_)));
        [beyond, off].map(|all| {
            all.into_iter().map(|found| {
                let text = match &found.text {
                    Text::Bound(sentence) => format!("{sentence}, as LinuxCNC runs the program"),
                    Text::Fault(text) => text.clone(),
                    Text::Path(allowed) => format!(
                        "LinuxCNC deviates from the programmed path by {:.4} {unit}, but the program allows {allowed} {unit}",
                        found.worst
                    ),
                    Text::Turns(turns) => format!(
                        "LinuxCNC replaces this arc of {turns} turns by a straight move (naive CAM \
                         detection): program G64 P without Q, or a smaller Q"
                    ),
                    Text::Thread(thread) => format!(
                        "the thread gets a wrong pitch: {:.1} turns per minute of {} {unit} need {:.3} \
                         {unit}/s, but LinuxCNC allows {:.3} {unit}/s for this move: reduce the spindle \
                         speed",
                        thread.turning, thread.pitch, thread.needed(), thread.fastest
                    ),
                };
                let message = Break::in_time(
                    self.config,
                    found.rule,
                    found.name,
                    &found.place,
                    found.lines,
                    text,
                );
                Break { of_second: found.of_second, step: found.step, ..message }
            })
            .collect()
        })
    }
}

impl<'a> Judge<'a> {
    fn new(config: &'a Mechanism) -> Self {
        const NONE: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];
        let limits = limits::beyond_axes(config);
        let (axes, joints, extra) = ([NONE; 6], [NONE; MAX_JOINTS], [NONE; MAX_EXTRA]);
        Self { config, limits, before: None, axes, joints, extra }
    }

    /// Extends the used ranges of the axes and joints. Joints move for some cycles after the pose has stopped.
    fn widen(&mut self, row: &Row, programmed: &[f64; 6]) {
        let first = self.config.place.first_joint;
        let joints = self.joints.iter_mut().zip(row.joints.iter().skip(first));
        let extra = self.extra.iter_mut().zip(&row.extra.positions);
        for (range, value) in self.axes.iter_mut().zip(programmed).chain(joints).chain(extra) {
            *range = [range[0].min(*value), range[1].max(*value)];
        }
    }

    /// Returns the used ranges, in the order of [`ranges`](crate::report::Preflight::ranges).
    fn used(&self) -> impl Iterator<Item = [f64; 2]> {
        let layout = self.config.machine.layout();
        let axes = Letter::ALL.into_iter().zip(self.axes);
        let axes = axes.filter(|(letter, _)| !layout.is_held(*letter)).map(|(_, used)| used);
        let extra = self.extra.into_iter().take(self.config.extra.len());
        axes.chain(self.joints.into_iter().take(self.config.joints.len())).chain(extra)
    }

    /// Passes violations to `show`; returns whether the mechanism has moved.
    fn see(&mut self, row: &Row, mut show: impl FnMut(Margin, Option<Fault>)) -> bool {
        let (pose, tool) = row.machine(self.config);
        let programmed = self.config.reported_pose(&row.of(self.config).pose, &row.extra.positions);
        self.widen(row, &programmed);
        let now = (pose, tool, row.extra.positions);
        if self.before.replace(now) == Some(now) {
            return false;
        }
        let slack = ROUNDING * self.config.machine.size();
        let axes = Letter::ALL.into_iter().zip(&self.config.programmed).zip(programmed);
        for ((letter, axis), value) in axes {
            let (limit, part) = (Limit::Axis, Part::Axis(letter));
            let margin = Margin { limit, part, value, range: [axis.min, axis.max] };
            if !(margin.room() >= -slack) {
                show(margin, None);
            }
        }
        self.see_extra(row, slack, &mut show);
        match self.config.machine.at(&Pose::from_degrees(pose), &tool) {
            Ok(at) => limits::each(&at, &self.limits, |margin| {
                if !(margin.room() >= -slack) {
                    show(margin, None);
                }
            }),
            Err(fault) => show(Margin::of_fault(&fault), Some(fault)),
        }
        true
    }

    fn see_extra(&self, row: &Row, slack: f64, show: &mut impl FnMut(Margin, Option<Fault>)) {
        let first = self.config.joints.len();
        for (n, (axis, value)) in self.config.extra.iter().zip(row.extra.positions).enumerate() {
            let (limit, part) = (Limit::JointRange, Part::Joint(first + n));
            let margin = Margin { limit, part, value, range: axis.range() };
            if !(margin.room() >= -slack) {
                show(margin, None);
            }
        }
    }
}

impl Apart<'_> {
    /// Returns the distance of two mechanisms if it is too small.
    fn beyond(&mut self, row: &Row) -> Option<([kinematics::Body; 2], f64)> {
        let tools = [Vector3::from(row.tool), Vector3::from(row.second.tool)];
        for n in 0..2 {
            if tools[n] != self.tools[n] {
                // A tool without a legal pose is reported with the pose of its mechanism.
                self.reaches[n] = Reach::with_tool(self.configs[n], tools[n]).ok()?;
                self.tools[n] = tools[n];
            }
        }
        let least = limits::least_distance_between(self.configs[0]);
        let [one, other] = &self.reaches;
        let still = [0.0; 6];
        let found = approach([one, other], [&row.pose, &row.second.pose], [&still, &still], least);
        let found = found.ok()?;
        (found.distance < least - ROUNDING * self.configs[0].machine.size())
            .then_some((found.bodies, found.distance))
    }
}

/// The commanded path around the current move.
#[derive(Default)]
struct Path {
    pieces: VecDeque<Piece>,
    /// Number of the first one.
    first: usize,
    end: World,
}

struct Piece {
    shape: Shape,
    tolerance: f64,
    is_free: bool,
    /// Number of steps of the program up to its end.
    steps: usize,
}

enum Shape {
    Line([Vector3<f64>; 2]),
    Arc(Box<Circle>),
}

impl Path {
    fn take(&mut self, commanded: &Commanded, steps: usize) {
        let from = std::mem::replace(&mut self.end, commanded.end);
        let from = if self.first == 0 && self.pieces.is_empty() { commanded.end } else { from };
        let point = |world: &World| Vector3::new(world[0], world[1], world[2]);
        let is_tap = commanded.kind == CommandedKind::Tap;
        self.pieces.push_back(Piece {
            shape: match &commanded.arc {
                Some(arc) => Shape::Arc(Box::new(Circle::new(arc, &from, &commanded.end))),
                None => Shape::Line([point(&from), point(&commanded.end)]),
            },
            tolerance: commanded.tolerance,
            // A tap reverses where its spindle does; a probe stops on contact, and the next move starts there.
            is_free: is_tap || commanded.kind == CommandedKind::Probe,
            steps,
        });
        if is_tap {
            self.end = from;
        }
    }

    /// Returns the largest number of steps begun in a cycle. A move that ends in a corner is blended into the next.
    fn steps(&self, row: &Row) -> usize {
        let mut pieces = self.pieces.iter().skip(row.number.saturating_sub(self.first));
        let (now, next) = (pieces.next(), pieces.next());
        let is_rounded = |piece: &&Piece| !piece.is_free && piece.tolerance > 0.0;
        let last = now.filter(is_rounded).and(next).or(now);
        last.map_or(usize::MAX, |piece| piece.steps)
    }

    /// Returns the distance of a cycle from the path, and its tolerance; none if unknown.
    fn off(&mut self, row: &Row) -> Option<(f64, f64)> {
        while self.first + 1 < row.number && self.pieces.len() > 1 {
            self.pieces.pop_front();
            self.first += 1;
        }
        let around = self.pieces.iter().take(row.number + 2 - self.first.min(row.number));
        let place = Vector3::new(row.pose[0], row.pose[1], row.pose[2]);
        let mut found: Option<(f64, f64)> = None;
        for piece in around {
            if piece.is_free {
                return None;
            }
            let distance = piece.shape.distance(&place);
            let (off, allowed) = found.unwrap_or((f64::INFINITY, 0.0));
            found = Some((off.min(distance), allowed.max(piece.tolerance)));
        }
        found
    }
}

impl Shape {
    fn distance(&self, place: &Vector3<f64>) -> f64 {
        match self {
            Self::Line([from, to]) => {
                let way = *to - *from;
                let length = way.dot(&way);
                let share = if length > 0.0 { (*place - *from).dot(&way) / length } else { 0.0 };
                (*from + way * share.clamp(0.0, 1.0) - *place).norm()
            }
            Self::Arc(circle) => circle.distance(place),
        }
    }
}
