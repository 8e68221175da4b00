// SPDX-License-Identifier: GPL-2.0-or-later
//! Typical tool paths of paper 003: milling rows, circles, pockets, plunges, turning, drilling.
//!
//! Every operation is also a subroutine for LinuxCNC (`subroutines`), with the same
//! arguments and the same moves. Places are in work coordinates, in mm: of a plane the two axes that
//! G17, G18 and G19 turn (X Y, Z X, Y Z), and the level across it.

use crate::curve::planes::PLANES;
use crate::study::number::Positive;
use serde::Deserialize;
use std::f64::consts::{PI, TAU};

/// G17, G18 or G19.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Plane {
    /// G17.
    #[default]
    Xy,
    /// G18: the first axis is Z.
    Zx,
    /// G19.
    Yz,
}

/// Where an operation lies, and how fast it cuts.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rows {
    #[serde(default)]
    plane: Plane,
    /// First corner.
    start_mm: [f64; 2],
    /// Length of a row, along the first axis; below 0 the other way.
    length_mm: f64,
    /// Width of all rows, along the second axis; below 0 the other way.
    width_mm: f64,
    /// Largest distance of rows.
    step_mm: Positive,
    level_mm: f64,
    clear_mm: f64,
    feed_mm_per_min: Positive,
}

/// A circle, or a round pocket.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Circle {
    #[serde(default)]
    plane: Plane,
    centre_mm: [f64; 2],
    radius_mm: Positive,
    level_mm: f64,
    clear_mm: f64,
    #[serde(default)]
    clockwise: bool,
    feed_mm_per_min: Positive,
}

/// A round pocket: a spiral, then a circle.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pocket {
    #[serde(default)]
    plane: Plane,
    centre_mm: [f64; 2],
    radius_mm: Positive,
    /// What the radius gains in one turn.
    step_mm: Positive,
    level_mm: f64,
    clear_mm: f64,
    feed_mm_per_min: Positive,
}

/// A flat spiral from its centre.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spiral {
    #[serde(default)]
    plane: Plane,
    centre_mm: [f64; 2],
    /// What the radius gains in one turn.
    growth_mm: Positive,
    turns: Positive,
    level_mm: f64,
    clear_mm: f64,
    feed_mm_per_min: Positive,
}

/// A plunge along a helix, or along one that gets narrower.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Helix {
    #[serde(default)]
    plane: Plane,
    centre_mm: [f64; 2],
    radius_mm: Positive,
    /// What the radius loses in one turn.
    #[serde(default)]
    shrink_mm: f64,
    /// Change of the level in one turn; below 0 it goes down.
    pitch_mm: f64,
    turns: Positive,
    /// Level at the start.
    level_mm: f64,
    clear_mm: f64,
    feed_mm_per_min: Positive,
}

/// Turning by loops, then along the contour: a step of a shaft, X being a radius.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Turn {
    /// Radius of the bar.
    from_mm: f64,
    /// Radius of the step.
    to_mm: f64,
    /// Z of the face, and of the shoulder.
    face_mm: f64,
    shoulder_mm: f64,
    /// Fillet at the shoulder.
    #[serde(default)]
    fillet_mm: f64,
    /// Largest depth of a loop.
    cut_mm: Positive,
    /// Left for the contour.
    #[serde(default)]
    spare_mm: f64,
    feed_mm_per_min: Positive,
}

/// A groove or chamfer: into the part and out.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plunge {
    /// X from where, and to where.
    from_mm: f64,
    to_mm: f64,
    z_mm: f64,
    feed_mm_per_min: Positive,
}

/// A hole along the tool's axis.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drill {
    /// The hole's mouth.
    at_mm: [f64; 3],
    /// Tilts.
    #[serde(default)]
    a_deg: f64,
    #[serde(default)]
    b_deg: f64,
    /// Along which axis of the tool's holder the drill points when level.
    points: Points,
    depth_mm: Positive,
    /// Distance before the mouth from which it feeds.
    clear_mm: Positive,
    feed_mm_per_min: Positive,
}

/// Where a drill points while the platform is level.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Points {
    /// Towards −Z.
    Down,
    /// Towards −X, as the cross tools of a lathe do.
    Across,
}

/// A change of the tool at a place clear of the work; the first one of a job is made where the
/// machine stands. Without a tool the machine only goes there.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Change {
    /// Where.
    pub park_mm: [f64; 3],
    /// T.
    pub tool: Option<u32>,
    /// Speed of the spindle; 0 stops it, none leaves it as it is.
    pub spindle_rpm: Option<f64>,
}

/// One operation.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Operation {
    /// Rows there and back.
    Zigzag(Rows),
    /// Rows one way, lifted on the way back.
    Loop(Rows),
    /// A circle.
    Circle(Circle),
    /// A round pocket.
    Pocket(Pocket),
    /// A pocket with straight sides: a zigzag, then around.
    BoxPocket(Rows),
    /// A flat spiral.
    Spiral(Spiral),
    /// A helix, cylindrical or conical.
    Helix(Helix),
    /// A step of a shaft.
    Turn(Turn),
    /// A groove.
    Plunge(Plunge),
    /// A hole.
    Drill(Drill),
    /// A tool.
    Tool(Change),
}

/// One move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Element {
    /// G0 of these coordinates.
    Rapid([Option<f64>; 6]),
    /// G1 of these coordinates.
    Cut([Option<f64>; 6], f64),
    /// G2 or G3 in a plane to a place of it, about a centre.
    Turn {
        /// 0 to 2: G17, G18, G19.
        plane: usize,
        /// The end: first and second axis of the plane.
        end: [f64; 2],
        /// The level at the end; without one it stays.
        level: Option<f64>,
        /// The centre.
        centre: [f64; 2],
        /// G3.
        is_left: bool,
        /// Whole turns; 0 for an arc that ends elsewhere than it begins.
        turns: u32,
        /// Feed per minute.
        feed: f64,
    },
    /// A change of the tool.
    Tool(Change),
}

/// An operation that is none.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("[[operation]] {number}, {name}: {text}")]
pub struct OperationError {
    number: usize,
    name: &'static str,
    text: String,
}

/// Writes in a plane.
struct Pen {
    plane: usize,
    feed: f64,
    all: Vec<Element>,
}

impl Pen {
    fn new(plane: Plane, feed: Positive) -> Self {
        Self { plane: plane as usize, feed: feed.0, all: vec![] }
    }

    fn place(&self, at: [Option<f64>; 3]) -> [Option<f64>; 6] {
        let mut place = [None; 6];
        for (axis, value) in PLANES[self.plane].into_iter().zip(at) {
            place[axis] = value;
        }
        place
    }

    fn level(&mut self, w: f64) {
        self.all.push(Element::Rapid(self.place([None, None, Some(w)])));
    }

    fn over(&mut self, u: f64, v: f64) {
        self.all.push(Element::Rapid(self.place([Some(u), Some(v), None])));
    }

    fn sink(&mut self, w: f64) {
        self.all.push(Element::Cut(self.place([None, None, Some(w)]), self.feed));
    }

    fn cut(&mut self, u: f64, v: f64) {
        self.all.push(Element::Cut(self.place([Some(u), Some(v), None]), self.feed));
    }

    fn cut_to(&mut self, at: [f64; 3]) {
        self.all.push(Element::Cut(self.place(at.map(Some)), self.feed));
    }

    fn turn(&mut self, [u, v, w]: [f64; 3], centre: [f64; 2], is_left: bool, turns: u32) {
        let (plane, feed, end, level) = (self.plane, self.feed, [u, v], Some(w));
        self.all.push(Element::Turn { plane, end, level, centre, is_left, turns, feed });
    }

    /// Down at a place.
    fn enter(&mut self, clear: f64, [u, v]: [f64; 2], level: f64) {
        self.level(clear);
        self.over(u, v);
        self.sink(level);
    }

    /// Points of a curve at even steps of its angle, whose second derivative is at most `bent`.
    fn along(&mut self, angle: f64, bent: f64, chord: f64, at: impl Fn(f64) -> [f64; 3]) {
        let steps = (angle / (8.0 * chord / bent).sqrt()).ceil();
        for n in 1..=steps as usize {
            self.cut_to(at(angle * n as f64 / steps));
        }
    }
}

impl Rows {
    /// How many rows there are, and their distance.
    fn rows(&self) -> (usize, f64) {
        let gaps = (self.width_mm.abs() / self.step_mm.0).ceil().max(1.0);
        (gaps as usize + 1, self.width_mm / gaps)
    }

    fn zigzag(&self) -> Pen {
        let mut pen = Pen::new(self.plane, self.feed_mm_per_min);
        let [u, v] = self.start_mm;
        let ends = [u, u + self.length_mm];
        pen.enter(self.clear_mm, self.start_mm, self.level_mm);
        let (rows, step) = self.rows();
        for row in 0..rows {
            let side = v + step * row as f64;
            if row > 0 {
                pen.cut(ends[row % 2], side);
            }
            pen.cut(ends[1 - row % 2], side);
        }
        pen
    }

    fn one_way(&self) -> Pen {
        let mut pen = Pen::new(self.plane, self.feed_mm_per_min);
        let [u, v] = self.start_mm;
        let (rows, step) = self.rows();
        for row in 0..rows {
            let side = v + step * row as f64;
            pen.enter(self.clear_mm, [u, side], self.level_mm);
            pen.cut(u + self.length_mm, side);
        }
        pen.level(self.clear_mm);
        pen
    }

    fn around(&self) -> Pen {
        let mut pen = self.zigzag();
        let [u, v] = self.start_mm;
        let (far, side) = (u + self.length_mm, v + self.width_mm);
        // The zigzag ends at one of the far corners.
        let last = if self.rows().0 % 2 == 1 { far } else { u };
        let other = u + far - last;
        for (u, v) in [(last, v), (other, v), (other, side), (last, side)] {
            pen.cut(u, v);
        }
        pen.level(self.clear_mm);
        pen
    }
}

impl Circle {
    fn pen(&self) -> Pen {
        let mut pen = Pen::new(self.plane, self.feed_mm_per_min);
        let [u, v] = self.centre_mm;
        let start = [u + self.radius_mm.0, v];
        pen.enter(self.clear_mm, start, self.level_mm);
        pen.turn([start[0], v, self.level_mm], self.centre_mm, !self.clockwise, 1);
        pen.level(self.clear_mm);
        pen
    }
}

/// A spiral r = k φ up to a radius.
fn spiral(pen: &mut Pen, [u, v]: [f64; 2], level: f64, growth: f64, angle: f64, chord: f64) {
    let k = growth / TAU;
    // |r″| = k √(φ² + 4).
    pen.along(angle, k * angle.hypot(2.0), chord, |at| {
        [u + k * at * at.cos(), v + k * at * at.sin(), level]
    });
}

impl Pocket {
    fn pen(&self, chord: f64) -> Pen {
        let mut pen = Pen::new(self.plane, self.feed_mm_per_min);
        let (centre, radius) = (self.centre_mm, self.radius_mm.0);
        pen.enter(self.clear_mm, centre, self.level_mm);
        let angle = TAU * radius / self.step_mm.0;
        spiral(&mut pen, centre, self.level_mm, self.step_mm.0, angle, chord);
        // In two halves: the spiral's end is known to rounding, which a whole turn does not bear.
        for half in [angle + PI, angle + TAU] {
            let end = [centre[0] + radius * half.cos(), centre[1] + radius * half.sin()];
            pen.turn([end[0], end[1], self.level_mm], centre, true, 0);
        }
        pen.level(self.clear_mm);
        pen
    }
}

impl Spiral {
    fn pen(&self, chord: f64) -> Pen {
        let mut pen = Pen::new(self.plane, self.feed_mm_per_min);
        pen.enter(self.clear_mm, self.centre_mm, self.level_mm);
        let angle = TAU * self.turns.0;
        spiral(&mut pen, self.centre_mm, self.level_mm, self.growth_mm.0, angle, chord);
        pen.level(self.clear_mm);
        pen
    }
}

impl Helix {
    fn pen(&self, chord: f64) -> Pen {
        let mut pen = Pen::new(self.plane, self.feed_mm_per_min);
        let ([u, v], radius) = (self.centre_mm, self.radius_mm.0);
        pen.enter(self.clear_mm, [u + radius, v], self.level_mm);
        let angle = TAU * self.turns.0;
        let (shrink, pitch) = (self.shrink_mm / TAU, self.pitch_mm / TAU);
        if self.shrink_mm == 0.0 && self.turns.0.fract() == 0.0 {
            let end = self.level_mm + self.pitch_mm * self.turns.0;
            pen.turn([u + radius, v, end], self.centre_mm, true, self.turns.0 as u32);
        } else {
            // |r″|² = r² + (2 κ)², and r is largest at one of the ends.
            let widest = radius.max((radius - shrink * angle).abs());
            pen.along(angle, widest.hypot(2.0 * shrink), chord, |at| {
                let r = radius - shrink * at;
                [u + r * at.cos(), v + r * at.sin(), self.level_mm + pitch * at]
            });
        }
        pen.cut(u, v);
        pen.level(self.clear_mm);
        pen
    }
}

/// How far a loop leaves the part at 45 degrees, mm.
const LEAVE: f64 = 1.0;
/// How far before the face a loop begins, mm.
const BEFORE: f64 = 2.0;

impl Turn {
    fn pen(&self) -> Pen {
        // The plane of G18: first Z, then X; loops stay in it.
        let mut pen = Pen::new(Plane::Zx, self.feed_mm_per_min);
        let rapid = |x: Option<f64>, z: Option<f64>| Element::Rapid([x, None, z, None, None, None]);
        let begin = self.face_mm + BEFORE;
        let depth = self.from_mm - self.to_mm - self.spare_mm;
        let loops = (depth / self.cut_mm.0).ceil().max(1.0);
        pen.all.push(rapid(None, Some(begin)));
        for n in 1..=loops as usize {
            let x = self.from_mm - depth * n as f64 / loops;
            let end = self.shoulder_mm + self.spare_mm;
            pen.all.push(rapid(Some(x), None));
            pen.cut(end, x);
            pen.cut(end + LEAVE, x + LEAVE);
            pen.all.push(rapid(None, Some(begin)));
        }
        let (x, z, fillet) = (self.to_mm, self.shoulder_mm, self.fillet_mm);
        pen.all.push(rapid(Some(x), None));
        pen.cut(z + fillet, x);
        if fillet > 0.0 {
            pen.all.push(Element::Turn {
                plane: Plane::Zx as usize,
                end: [z, x + fillet],
                level: None,
                centre: [z + fillet, x + fillet],
                is_left: false,
                turns: 0,
                feed: self.feed_mm_per_min.0,
            });
        }
        pen.cut(z, self.from_mm + BEFORE);
        pen.all.push(rapid(None, Some(begin)));
        pen
    }
}

impl Plunge {
    fn pen(&self) -> Pen {
        let mut pen = Pen::new(Plane::Yz, self.feed_mm_per_min);
        let mut rapid = [None; 6];
        rapid[2] = Some(self.z_mm);
        pen.all.push(Element::Rapid(rapid));
        pen.level(self.from_mm);
        pen.sink(self.to_mm);
        pen.level(self.from_mm);
        pen
    }
}

impl Drill {
    fn pen(&self) -> Pen {
        let mut pen = Pen::new(Plane::Xy, self.feed_mm_per_min);
        let (a, b) = (self.a_deg.to_radians(), self.b_deg.to_radians());
        // Columns of R = Ry(B) Rx(A): the drill points along minus the third or the first.
        let out = match self.points {
            Points::Down => [a.cos() * b.sin(), -a.sin(), a.cos() * b.cos()],
            Points::Across => [b.cos(), 0.0, -b.sin()],
        };
        let at = |along: f64| -> [Option<f64>; 6] {
            let mut place = [None; 6];
            for k in 0..3 {
                place[k] = Some(self.at_mm[k] + along * out[k]);
            }
            (place[3], place[4]) = (Some(self.a_deg), Some(self.b_deg));
            place
        };
        let above = at(self.clear_mm.0);
        pen.all.push(Element::Rapid(above));
        pen.all.push(Element::Cut(at(-self.depth_mm.0), pen.feed));
        pen.all.push(Element::Rapid(above));
        pen
    }
}

impl Operation {
    /// What it is called.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Zigzag(_) => "zigzag",
            Self::Loop(_) => "loop",
            Self::Circle(_) => "circle",
            Self::Pocket(_) => "pocket",
            Self::BoxPocket(_) => "box-pocket",
            Self::Spiral(_) => "spiral",
            Self::Helix(_) => "helix",
            Self::Turn(_) => "turn",
            Self::Plunge(_) => "plunge",
            Self::Drill(_) => "drill",
            Self::Tool(_) => "tool",
        }
    }

    /// Its moves, spirals and cones within `chord` of their curves; `number` from 1.
    ///
    /// # Errors
    /// Numbers that make no path.
    pub fn elements(&self, number: usize, chord: f64) -> Result<Vec<Element>, OperationError> {
        if let Some(text) = self.refusal() {
            return Err(OperationError { number, name: self.name(), text });
        }
        Ok(match self {
            Self::Zigzag(rows) => {
                let mut pen = rows.zigzag();
                pen.level(rows.clear_mm);
                pen.all
            }
            Self::Loop(rows) => rows.one_way().all,
            Self::BoxPocket(rows) => rows.around().all,
            Self::Circle(circle) => circle.pen().all,
            Self::Pocket(pocket) => pocket.pen(chord).all,
            Self::Spiral(spiral) => spiral.pen(chord).all,
            Self::Helix(helix) => helix.pen(chord).all,
            Self::Turn(turn) => turn.pen().all,
            Self::Plunge(plunge) => plunge.pen().all,
            Self::Drill(drill) => drill.pen().all,
            Self::Tool(change) => vec![Element::Tool(*change)],
        })
    }

    fn refusal(&self) -> Option<String> {
        match self {
            Self::Zigzag(rows) | Self::Loop(rows) | Self::BoxPocket(rows) => {
                let zero = rows.length_mm == 0.0 || rows.width_mm == 0.0;
                zero.then(|| "length_mm and width_mm: expected other than 0".into())
            }
            Self::Helix(helix) if helix.shrink_mm * helix.turns.0 > helix.radius_mm.0 => {
                Some("shrink_mm: the radius ends below 0".into())
            }
            Self::Turn(turn) if turn.from_mm <= turn.to_mm + turn.spare_mm => {
                Some("from_mm: expected more than to_mm and spare_mm".into())
            }
            Self::Turn(turn) if turn.shoulder_mm >= turn.face_mm => {
                Some("shoulder_mm: expected less than face_mm".into())
            }
            Self::Turn(turn) if turn.fillet_mm < 0.0 || turn.spare_mm < 0.0 => {
                Some("fillet_mm, spare_mm: expected 0 or more".into())
            }
            Self::Drill(drill) if drill.points == Points::Across && drill.a_deg != 0.0 => {
                Some("a_deg: a drill that points across leans by b_deg alone".into())
            }
            _ => None,
        }
    }
}
