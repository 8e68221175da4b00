// SPDX-License-Identifier: GPL-2.0-or-later
//! Whether every pose of a cell is one that the machine can take: proved, not sampled.
//!
//! A cell holds the poses X = C + Δ, |Δ_k| ≤ h_k. On the straight way from C to X in the
//! coordinates X Y Z A B C, run through in unit time, a platform anchor at distance e from the
//! control point has |p'| ≤ V and |p''| ≤ A:
//!
//! ```text
//! V = ‖(h_x, h_y, h_z)‖ + e Ω,   A = e Ω²,   Ω = h_a + h_b + h_c (radians)
//! ```
//!
//! as R = Rz Ry Rx turns by the sum of its three turns at most. From V and A follow bounds of
//! the second derivatives of every joint value and of every cosine of a cone angle, and with
//! Taylor's formula their range over the cell: value in the middle, plus or minus
//! Σ |gradient_k| h_k + bound/2. Gradients and values in the middle are the core's own.
//!
//! Rods: with u the unit vector along the rod (length L), c(q) its moving end, g = |u · ∂c/∂q|
//!
//! ```text
//! |q'| ≤ V/g = Q,  |s'| ≤ V + |∂c| Q = S,  |q''| ≤ (S²/L + A + |∂²c| Q²)/g,
//! ```
//!
//! from the derivatives of |p − c(q)|² = L². Nut correction: the bound of the core's
//! certificate, with V/l for n' and Ω for 1/r.
//!
//! **Distance of legs**: with w the unit vector from the nearest point of one leg to that of the
//! other in the middle, their distance is at least w · (a − b) for the ends a of one and b of the
//! other that make it least, wherever the legs are. Each of these four values has a slope, and
//! its second derivative is bounded by those of the ends.
//!
//! **Conditioning**: no singular value changes by more than the Frobenius norm of the change of
//! the rows [u (ρ × u)/r].
//!
//! **Regular**: with G the rows of the legs, columns scaled by s, and M its pseudo-inverse in
//! the middle, ‖M (G(X) − G(C))‖ < 1 makes M G(X) invertible, so that the legs hold the
//! platform at every pose of the cell.

use crate::limits::least_distance;
use crate::read::machine::MachineConfig;
use kinematics::{
    Fault, Joints, LegGeometry, LegKind, Letter, MAX_LEGS, Matrix3, Nearest, Pose, Segment, Vector3,
};
use nalgebra::SMatrix;
use std::f64::consts::PI;

const RADIANS: f64 = PI / 180.0;

/// Least |cos| between a rod and the motion of its lower end that the core accepts.
const LEAST_DRIVE: f64 = 0.05;

/// Least cosine of the angle between a strut and the plane square to a cardan axis: 80 degrees,
/// as in the core's certificate.
const LEAST_COSINE: f64 = 0.17;

/// Least scale of a coordinate as a share of the largest one.
const LEAST_SCALE: f64 = 0.3;

/// Rounding of what is computed in the middle, as a share of the size: far above f64's 1e-16
/// times the numbers of operations, far below what anybody can set up.
const ROUNDING: f64 = 1e-9;

/// Poses about a middle one, machine units and degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// The pose in the middle.
    pub middle: [f64; 6],
    /// Half of the extent along every coordinate.
    pub half: [f64; 6],
}

impl Cell {
    /// From one corner to the opposite one.
    pub fn between(low: &[f64; 6], high: &[f64; 6]) -> Self {
        Self {
            middle: std::array::from_fn(|k| (low[k] + high[k]) / 2.0),
            half: std::array::from_fn(|k| (high[k] - low[k]) / 2.0),
        }
    }

    /// Both halves along one coordinate.
    pub fn halves(&self, k: usize) -> [Self; 2] {
        let mut halves = [*self; 2];
        for (part, sign) in halves.iter_mut().zip([-1.0, 1.0]) {
            part.half[k] /= 2.0;
            part.middle[k] += sign * part.half[k];
        }
        halves
    }
}

/// What stops the machine at a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stop {
    /// The pose has no joint values, or the legs do not hold it.
    Fault(Fault),
    /// A joint beyond its limits.
    Joint(usize),
    /// A leg leans too much at its base joint.
    BaseCone(usize),
    /// A leg leans too much at its platform joint.
    PlatformCone(usize),
    /// Two legs come nearer to each other than they may.
    Clearance(Nearest),
}

/// What is known of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Every pose of it can be taken.
    Inside,
    /// The pose in its middle cannot.
    Outside(Stop),
    /// Too large to tell; halved along this coordinate it is most likely to tell.
    Open(usize),
}

/// A value over a cell, or on a way run through in two units of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// In the middle.
    pub middle: f64,
    /// How far it changes from there to the end, to first order: never negative.
    pub slope: f64,
    /// Bound of its second derivative on every straight way from the middle to an end, run
    /// through in one unit of time; infinite where none is known.
    pub bend: f64,
    /// Rounding.
    pub rounding: f64,
}

impl Course {
    /// All its values lie between these.
    pub fn range(&self) -> (f64, f64) {
        let room = self.slope + self.bend / 2.0 + self.rounding;
        (self.middle - room, self.middle + room)
    }
}

/// What is proved of a straight way.
#[derive(Clone, Debug, PartialEq)]
pub struct Way {
    /// Joint values. Where all bends are finite, every pose has joint values.
    pub joints: Vec<Course>,
    /// Cosines of the angles between the legs and their directions at home, seen in base.
    pub base: Vec<Course>,
    /// The same, seen in the platform.
    pub platform: Vec<Course>,
    /// Distances of legs that share no anchor.
    pub gaps: Vec<Gap>,
    /// Bound of how far [`kinematics::Machine::conditioning`] changes from the middle to an end;
    /// infinite where none is known.
    pub drift: f64,
    /// Whether the legs are proved to hold the platform everywhere.
    pub holds: bool,
}

/// Distance of the centre lines of two legs on a way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Numbers of the legs, lower one first.
    pub pair: [usize; 2],
    /// In the middle.
    pub middle: f64,
    /// Nowhere less than this; minus infinity where nothing is known. For pairs that are nowhere
    /// the nearest ones a lower number than need be.
    pub least: f64,
}

/// Legs by coordinates.
type Rows = SMatrix<f64, MAX_LEGS, 6>;

/// A machine with one tool, as its cells see it.
pub struct Reach<'a> {
    config: &'a MachineConfig,
    /// Tool vector, spindle offset included.
    tool: Vector3<f64>,
    /// Coordinates that the legs move.
    active: [bool; 6],
    /// Platform anchors in parts that turn about the control point and that a held or table
    /// coordinate takes away from the legs, or not.
    arms: Vec<[Vector3<f64>; 2]>,
    /// Directions of the legs at home.
    home: Vec<Vector3<f64>>,
    /// Pairs of legs, lower number first, that share no anchor.
    pairs: Vec<[usize; 2]>,
    /// What their centre lines have to keep.
    least_distance: f64,
    /// Arms of the platform anchors that the conditioning counts with, by its radius.
    levers: Vec<f64>,
}

/// How far anything moves within a cell: its poses are the middle plus a sum of `steps`, each
/// times a number from -1 to 1. Machine units and radians.
struct Spread {
    steps: Vec<[f64; 6]>,
    /// Half of the extent along every coordinate.
    half: [f64; 6],
    shift: f64,
    turn: f64,
}

/// One leg over a cell.
struct Bend {
    /// Bound of the second derivative of the joint value, joint units.
    joint: f64,
    /// The same of the leg's direction, and of its first derivative.
    direction: [f64; 2],
    /// Smallest length.
    length: f64,
    /// Bounds of the second derivatives of the ends, at the base and at the platform.
    ends: [f64; 2],
    /// No end moves farther than this.
    farthest: f64,
}

/// The middle of a cell.
struct Middle {
    joints: Joints,
    gradient: kinematics::Jacobian,
    legs: [Segment; MAX_LEGS],
    rotation: Matrix3<f64>,
    /// Axes that A, B and C turn about, in base.
    axes: [Vector3<f64>; 3],
    corrections: [f64; MAX_LEGS],
}

impl<'a> Reach<'a> {
    /// Of this machine without a tool.
    ///
    /// # Errors
    /// Home cannot be taken.
    pub fn new(config: &'a MachineConfig) -> Result<Self, Fault> {
        Self::with_tool(config, config.spindle)
    }

    /// Of this machine with a tool vector, spindle offset included.
    ///
    /// # Errors
    /// Home cannot be taken.
    pub fn with_tool(config: &'a MachineConfig, tool: Vector3<f64>) -> Result<Self, Fault> {
        let active = Letter::ALL.map(|l| config.machine.layout().coordinates().contains(l));
        let segments = config.machine.segments(&config.home_pose(), &config.spindle)?;
        let centre = Vector3::from(config.geometry.centre);
        let arms = |leg: &LegGeometry| {
            let anchor = Vector3::from(leg.platform);
            match active[..3] {
                [true, true, true] => [tool + anchor, Vector3::zeros()],
                _ => [tool + centre, anchor - centre],
            }
        };
        Ok(Self {
            config,
            tool,
            active,
            arms: config.geometry.legs().iter().map(arms).collect(),
            home: segments[..config.legs()].iter().map(along).collect(),
            pairs: watched_pairs(config),
            least_distance: least_distance(config),
            levers: levers(config, &active),
        })
    }

    /// Coordinates that a program can move.
    pub fn moved(&self) -> [bool; 6] {
        Letter::ALL.map(|letter| !self.config.machine.layout().is_held(letter))
    }

    /// Joint values of a pose, within limits or not.
    ///
    /// # Errors
    /// As [`kinematics::Machine::inverse`].
    pub fn joints(&self, pose: &[f64; 6]) -> Result<Joints, Fault> {
        self.config.machine.inverse(&Pose::from_degrees(*pose), &self.tool)
    }

    /// How well the legs hold the platform; 0 where the pose has no joint values.
    pub fn conditioning(&self, pose: &[f64; 6]) -> f64 {
        let pose = Pose::from_degrees(*pose);
        self.config.machine.conditioning(&pose, &self.tool).unwrap_or(0.0)
    }

    /// Whether the machine can take one pose.
    ///
    /// # Errors
    /// What stops it.
    pub fn check(&self, pose: &[f64; 6]) -> Result<(), Stop> {
        let middle = self.middle(pose).map_err(Stop::Fault)?;
        self.check_middle(&middle)
    }

    /// What is known of a cell.
    pub fn judge(&self, cell: &Cell) -> Verdict {
        let middle = match self.middle(&cell.middle) {
            Ok(middle) => middle,
            Err(fault) => return Verdict::Outside(Stop::Fault(fault)),
        };
        if let Err(stop) = self.check_middle(&middle) {
            return Verdict::Outside(stop);
        }
        self.holds(cell, &middle)
    }

    fn middle(&self, pose: &[f64; 6]) -> Result<Middle, Fault> {
        let (machine, tool) = (&self.config.machine, &self.tool);
        let pose = Pose::from_degrees(*pose);
        let ((sb, cb), (sc, cc)) = (pose.angles.y.sin_cos(), pose.angles.z.sin_cos());
        Ok(Middle {
            joints: machine.inverse(&pose, tool)?,
            gradient: machine.pose_jacobian(&pose, tool)?,
            legs: machine.segments(&pose, tool)?,
            rotation: pose.rotation(),
            axes: [
                Vector3::new(cc * cb, sc * cb, -sb),
                Vector3::new(-sc, cc, 0.0),
                Vector3::new(0.0, 0.0, 1.0),
            ],
            corrections: machine.corrections(&pose, tool)?,
        })
    }

    fn check_middle(&self, middle: &Middle) -> Result<(), Stop> {
        for (i, joint) in self.config.joints.iter().enumerate() {
            if !(joint.min..=joint.max).contains(&middle.joints[i]) {
                return Err(Stop::Joint(i));
            }
        }
        for i in 0..self.config.legs() {
            let n = along(&middle.legs[i]);
            if !(n.dot(&self.home[i]) >= least_cosine(self.config.base_cone[i])) {
                return Err(Stop::BaseCone(i));
            }
            let home = middle.rotation * self.home[i];
            if !(n.dot(&home) >= least_cosine(self.config.platform_cone[i])) {
                return Err(Stop::PlatformCone(i));
            }
        }
        for pair @ [i, j] in &self.pairs {
            let distance = middle.legs[*i].distance(&middle.legs[*j]);
            if !(distance >= self.least_distance) {
                return Err(Stop::Clearance(Nearest { distance, pair: *pair }));
            }
        }
        Ok(())
    }

    /// What is known of a cell whose middle can be taken.
    fn holds(&self, cell: &Cell, middle: &Middle) -> Verdict {
        let spread = self.spread((0..6).map(|k| along_one(k, cell.half[k])));
        let mut bends = vec![];
        for i in 0..self.config.legs() {
            match self.bend(i, middle, &spread) {
                Some(bend) if self.cones_hold(i, middle, &spread, &bend) => bends.push(bend),
                _ => return Verdict::Open(greatest(&self.extents(&spread))),
            }
        }
        if !self.joints_hold(middle, &spread, &bends) || !self.gaps_hold(middle, &spread, &bends) {
            return Verdict::Open(greatest(&self.extents(&spread)));
        }
        match self.departure(middle, &spread, &bends) {
            Ok(()) => Verdict::Inside,
            Err(shares) => Verdict::Open(greatest(&shares)),
        }
    }

    /// What the joints and legs do on the straight way from `middle - step` to `middle + step`.
    ///
    /// # Errors
    /// The pose in the middle has no joint values.
    pub fn way(&self, middle: &[f64; 6], step: &[f64; 6]) -> Result<Way, Fault> {
        let middle = self.middle(middle)?;
        let spread = self.spread([*step]);
        let bends: Option<Vec<_>> =
            (0..self.config.legs()).map(|i| self.bend(i, &middle, &spread)).collect();
        let leans = |platform| {
            let lean = |i| self.lean(i, platform, &middle, &spread, bends.as_ref().map(|b| &b[i]));
            (0..self.config.legs()).map(lean).collect()
        };
        Ok(Way {
            joints: (0..self.config.joints.len())
                .map(|i| self.joint_course(i, &middle, &spread, bends.as_deref()))
                .collect(),
            base: leans(false),
            platform: leans(true),
            gaps: self.gaps(&middle, &spread, bends.as_deref(), f64::INFINITY),
            drift: bends.as_ref().map_or(f64::INFINITY, |bends| self.drift(&spread, bends)),
            holds: bends.is_some_and(|bends| self.departure(&middle, &spread, &bends).is_ok()),
        })
    }

    /// Of steps in machine units and degrees.
    fn spread(&self, steps: impl IntoIterator<Item = [f64; 6]>) -> Spread {
        let radians =
            |s: [f64; 6]| std::array::from_fn(|k| if k < 3 { s[k] } else { s[k] * RADIANS });
        let steps: Vec<[f64; 6]> = steps.into_iter().map(radians).collect();
        let half = std::array::from_fn(|k| steps.iter().map(|step| step[k].abs()).sum::<f64>());
        let squares = (0..3).filter(|k| self.active[*k]).map(|k| half[k] * half[k]);
        let shift = squares.sum::<f64>().sqrt();
        Spread { half, shift, turn: half[3..].iter().sum(), steps }
    }

    /// How far every step moves the ends of the legs, more or less: to compare.
    fn extents(&self, spread: &Spread) -> Vec<f64> {
        let unit = |k: usize| if k < 3 { 1.0 } else { self.config.machine.size() / 2.0 };
        let extent = |step: &[f64; 6]| (0..6).map(|k| step[k].abs() * unit(k)).sum();
        spread.steps.iter().map(extent).collect()
    }

    fn joints_hold(&self, middle: &Middle, spread: &Spread, bends: &[Bend]) -> bool {
        self.config.joints.iter().enumerate().all(|(i, joint)| {
            let (low, high) = self.joint_course(i, middle, spread, Some(bends)).range();
            joint.min <= low && high <= joint.max
        })
    }

    fn gaps_hold(&self, middle: &Middle, spread: &Spread, bends: &[Bend]) -> bool {
        let gaps = self.gaps(middle, spread, Some(bends), self.least_distance);
        gaps.iter().all(|gap| gap.least >= self.least_distance)
    }

    /// Joint `i` over a cell; without bends nothing is known of a leg's.
    fn joint_course(
        &self,
        i: usize,
        middle: &Middle,
        spread: &Spread,
        bends: Option<&[Bend]>,
    ) -> Course {
        // A table axis moves by P − R (o + centre).
        let arm = self.tool + Vector3::from(self.config.geometry.centre);
        let bend = match bends {
            _ if i >= self.config.legs() => arm.norm() * spread.turn * spread.turn,
            Some(bends) => bends[i].joint,
            None => f64::INFINITY,
        };
        let unit = |k: usize| if k < 3 { 1.0 } else { 1.0 / RADIANS };
        let gradient = std::array::from_fn(|k| middle.gradient[(i, k)] * unit(k));
        let rounding = ROUNDING * self.config.machine.size();
        Course { middle: middle.joints[i], slope: spread.slope(&gradient), bend, rounding }
    }

    /// Change of the platform anchor of leg `i` with a coordinate, per machine unit or radian.
    fn motion(&self, i: usize, k: usize, middle: &Middle) -> Vector3<f64> {
        if k < 3 {
            let mut along = Vector3::zeros();
            along[k] = if self.active[k] { 1.0 } else { 0.0 };
            return along;
        }
        let axis = middle.axes[k - 3];
        let [shared, own] = self.arms[i].map(|arm| axis.cross(&(middle.rotation * arm)));
        own + self.of_legs(shared)
    }

    fn arm(&self, i: usize) -> f64 {
        self.arms[i].iter().map(|arm| arm.norm()).sum()
    }

    /// Bounds of one leg; `None` where the cell is too large for any.
    fn bend(&self, i: usize, middle: &Middle, spread: &Spread) -> Option<Bend> {
        let segment = &middle.legs[i];
        let (travel, second) = spread.of_anchor(self.arm(i));
        let span = segment.platform - segment.base;
        let leg = &self.config.geometry.legs()[i];
        match leg.kind {
            LegKind::Strut(strut) => {
                let length = span.norm() - travel;
                (length > 0.0).then_some(())?;
                let direction = [travel / length, second_of_direction(travel, second, length)];
                let nut = self.nut_bend(i, middle, spread, &direction, strut.lead)?;
                let joint = travel * travel / length + second + nut;
                Some(Bend { joint, direction, length, ends: [0.0, second], farthest: travel })
            }
            LegKind::Slider(slider) => {
                let guide = Vector3::from(slider.guide).normalize();
                let from_base = segment.platform - Vector3::from(leg.base);
                let farthest = from_base.cross(&guide).norm() + travel;
                let gain =
                    (slider.rod * slider.rod - farthest * farthest).max(0.0).sqrt() / slider.rod;
                rod_bend(gain, 1.0, 0.0, travel, second, slider.rod, 1.0)
            }
            LegKind::Crank(crank) => {
                let axis = Vector3::from(crank.axis).normalize();
                let arm = Vector3::from(crank.arm);
                let (along, across) = (axis.dot(&arm), axis.cross(&arm).norm());
                let from_base = segment.platform - Vector3::from(leg.base);
                let apart = (from_base - axis * along).norm();
                let squares = |d: f64| (d * d + across * across - crank.rod * crank.rod) / 2.0;
                let (least, most) = (squares((apart - travel).max(0.0)), squares(apart + travel));
                let reach = across * (from_base.cross(&axis).norm() - travel).max(0.0);
                let t = least.abs().max(most.abs());
                let drive = (reach * reach - t * t).max(0.0).sqrt() / (across * crank.rod);
                rod_bend(drive, across, across, travel, second, crank.rod, RADIANS)
            }
        }
    }

    /// Bound of the second derivative of the nut correction of leg `i`.
    fn nut_bend(
        &self,
        i: usize,
        middle: &Middle,
        spread: &Spread,
        direction: &[f64; 2],
        lead: f64,
    ) -> Option<f64> {
        if lead == 0.0 {
            return Some(0.0);
        }
        let [turn_a, turn_b] = [direction[0], direction[0] + spread.turn];
        let [cos_a, cos_b] = self.cardan(i, middle, [turn_a, turn_b])?;
        let per_radian = lead.abs() / (2.0 * PI);
        let tangents = (1.0 / (cos_a * cos_a) - 1.0).sqrt() + (1.0 / (cos_b * cos_b) - 1.0).sqrt();
        // The correction jumps where the screw has turned by half a turn.
        let turned = tangents * direction[0] + spread.turn / cos_b;
        let room = PI - middle.corrections[i].abs() / per_radian;
        (turned < room).then_some(())?;
        let bend = 3.0 * turn_a * turn_a / (cos_a * cos_a)
            + 3.0 * turn_b * turn_b / (cos_b * cos_b)
            + tangents * direction[1]
            + spread.turn * spread.turn / cos_b;
        Some(per_radian * bend)
    }

    /// Least cosines of the angles between a strut and the planes square to its cardan axes,
    /// when it turns by these angles.
    fn cardan(&self, i: usize, middle: &Middle, turns: [f64; 2]) -> Option<[f64; 2]> {
        let LegKind::Strut(strut) = self.config.geometry.legs()[i].kind else { return None };
        let n = along(&middle.legs[i]);
        let axes = [
            Vector3::from(strut.base_axis).normalize(),
            middle.rotation * Vector3::from(strut.platform_axis).normalize(),
        ];
        let mut cosines = [0.0; 2];
        for ((cosine, axis), turn) in cosines.iter_mut().zip(axes).zip(turns) {
            *cosine = (n.dot(&axis).abs().min(1.0).asin() + turn).min(PI / 2.0).cos();
        }
        cosines.iter().all(|cosine| *cosine > LEAST_COSINE).then_some(cosines)
    }

    fn cones_hold(&self, i: usize, middle: &Middle, spread: &Spread, bend: &Bend) -> bool {
        [(false, &self.config.base_cone), (true, &self.config.platform_cone)]
            .into_iter()
            .filter(|(_, cones)| cones[i].is_some())
            .all(|(platform, cones)| {
                let course = self.lean(i, platform, middle, spread, Some(bend));
                course.range().0 >= least_cosine(cones[i])
            })
    }

    /// Cosine of the angle between leg `i` and its direction at home, at the base or at the
    /// platform, over a cell.
    fn lean(
        &self,
        i: usize,
        platform: bool,
        middle: &Middle,
        spread: &Spread,
        bend: Option<&Bend>,
    ) -> Course {
        let n = along(&middle.legs[i]);
        let home = if platform { middle.rotation * self.home[i] } else { self.home[i] };
        let length = (middle.legs[i].platform - middle.legs[i].base).norm();
        let cosine = n.dot(&home);
        let across = home - n * cosine;
        let gradient = std::array::from_fn(|k| {
            let turned = match platform && k >= 3 {
                true => n.dot(&middle.axes[k - 3].cross(&home)),
                false => 0.0,
            };
            across.dot(&self.span_change(i, k, middle)) / length + turned
        });
        // cos = n · d; in the platform d turns, too.
        let turn = if platform { spread.turn } else { 0.0 };
        let bound = |bend: &Bend| {
            let [first, second] = bend.direction;
            second + 2.0 * first * turn + turn * turn
        };
        Course {
            middle: cosine,
            slope: spread.slope(&gradient),
            bend: bend.map_or(f64::INFINITY, bound),
            rounding: ROUNDING,
        }
    }

    /// Distances of the legs; bounds that are `enough`, or those of pairs that are not the nearest
    /// ones anywhere, are not made any better.
    fn gaps(
        &self,
        middle: &Middle,
        spread: &Spread,
        bends: Option<&[Bend]>,
        enough: f64,
    ) -> Vec<Gap> {
        let between = |[i, j]: [usize; 2]| middle.legs[i].gap(&middle.legs[j]);
        let gaps: Vec<_> = self.pairs.iter().map(|pair| (*pair, between(*pair))).collect();
        let nearest = gaps.iter().map(|(_, gap)| gap.norm()).fold(enough, f64::min);
        let gap = |(pair, gap): &([usize; 2], Vector3<f64>)| {
            let distance = gap.norm();
            let least = bends.map_or(f64::NEG_INFINITY, |bends| {
                let [i, j] = *pair;
                // No point of a leg moves farther than its ends.
                let at_least = distance
                    - bends[i].farthest
                    - bends[j].farthest
                    - ROUNDING * self.config.machine.size();
                match at_least >= nearest || distance == 0.0 {
                    true => at_least,
                    false => self.least_gap(*pair, &(gap / distance), middle, spread, bends),
                }
            });
            Gap { pair: *pair, middle: distance, least }
        };
        gaps.iter().map(gap).collect()
    }

    /// Least distance of two legs along a direction.
    fn least_gap(
        &self,
        pair: [usize; 2],
        w: &Vector3<f64>,
        middle: &Middle,
        spread: &Spread,
        bends: &[Bend],
    ) -> f64 {
        let [one, other] = pair.map(|i| {
            let ends = [middle.legs[i].base, middle.legs[i].platform].map(|end| w.dot(&end));
            let mut gradients = [[0.0; 6]; 2];
            for k in 0..6 {
                let platform = self.motion(i, k, middle);
                gradients[0][k] = w.dot(&(platform - self.span_change(i, k, middle)));
                gradients[1][k] = w.dot(&platform);
            }
            (ends, gradients, bends[i].ends)
        });
        let apart = |e: usize, f: usize| {
            let gradient = std::array::from_fn(|k| one.1[e][k] - other.1[f][k]);
            one.0[e] - other.0[f] - spread.slope(&gradient) - (one.2[e] + other.2[f]) / 2.0
        };
        let least = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(e, f)| apart(e, f));
        least.into_iter().fold(f64::INFINITY, f64::min) - ROUNDING * self.config.machine.size()
    }

    /// How far the conditioning changes from the middle at most.
    fn drift(&self, spread: &Spread, bends: &[Bend]) -> f64 {
        let angles = self.active[3..].iter().filter(|active| **active).count();
        // About the axes of base, or about those of one or two angles, which turn as well.
        let (columns, turns) = if angles == 3 { (1.0, 1.0) } else { (angles as f64, 2.0) };
        let square = |(bend, lever): (&Bend, &f64)| {
            let direction = bend.direction[0];
            let moment = lever * (direction + turns * spread.turn);
            direction * direction + columns * moment * moment
        };
        bends.iter().zip(&self.levers).map(square).sum::<f64>().sqrt() + ROUNDING
    }

    /// Change of the vector along leg `i` with a coordinate, per machine unit or radian.
    fn span_change(&self, i: usize, k: usize, middle: &Middle) -> Vector3<f64> {
        let leg = &self.config.geometry.legs()[i];
        let per_joint = match leg.kind {
            LegKind::Strut(_) => return self.motion(i, k, middle),
            LegKind::Slider(slider) => Vector3::from(slider.guide).normalize(),
            LegKind::Crank(crank) => {
                let arm = middle.legs[i].base - Vector3::from(leg.base);
                Vector3::from(crank.axis).normalize().cross(&arm) * RADIANS
            }
        };
        let unit = if k < 3 { 1.0 } else { 1.0 / RADIANS };
        self.motion(i, k, middle) - per_joint * (middle.gradient[(i, k)] * unit)
    }

    /// Whether the legs hold the platform all over the cell; where that is not proved, what every
    /// step contributes to that.
    fn departure(&self, middle: &Middle, spread: &Spread, bends: &[Bend]) -> Result<(), Vec<f64>> {
        let extents = || self.extents(spread);
        let active = || (0..6).filter(|k| self.active[*k]);
        let scale = self.scale(spread);
        let mut rows = Rows::zeros();
        let mut rest = Rows::zeros();
        let mut slopes = vec![Rows::zeros(); spread.steps.len()];
        for (i, bend) in bends.iter().enumerate() {
            let leg = self.leg_slopes(i, middle);
            for k in active() {
                let (row, bound) = self.row(i, k, middle, spread, bend).ok_or_else(extents)?;
                (rows[(i, k)], rest[(i, k)]) = (row * scale[k], bound * scale[k]);
                for (change, step) in slopes.iter_mut().zip(&spread.steps) {
                    change[(i, k)] = active().map(|m| leg[m][k] * step[m]).sum::<f64>() * scale[k];
                }
            }
        }
        let mut normal = rows.tr_mul(&rows);
        for k in (0..6).filter(|k| !self.active[*k]) {
            normal[(k, k)] = 1.0;
        }
        let inverse = normal.try_inverse().ok_or_else(extents)? * rows.transpose();
        let rest = inverse.abs() * rest;
        let changes: Vec<_> = slopes.iter().map(|slope| (inverse * slope).abs()).collect();
        let departure = changes.iter().fold(rest, |sum, change| sum + change);
        let columns = (0..6).map(|k| departure.column(k).sum()).fold(0.0, f64::max);
        let lines = (0..6).map(|k| departure.row(k).sum()).fold(0.0, f64::max);
        if departure.norm().min(columns).min(lines) < 1.0 - ROUNDING {
            return Ok(());
        }
        let extents = extents();
        let whole: f64 = extents.iter().sum();
        let share = |(change, extent): (&SMatrix<f64, 6, 6>, f64)| {
            change.norm() + rest.norm() * extent / whole
        };
        Err(changes.iter().zip(extents).map(share).collect())
    }

    /// Scale of every coordinate: any will do, its extent does best. One without an extent still
    /// has to be held.
    fn scale(&self, spread: &Spread) -> [f64; 6] {
        let unit = |k: usize| if k < 3 { 1.0 } else { self.config.machine.radius() };
        let widest = (0..6).map(|k| spread.half[k] * unit(k)).fold(0.0, f64::max);
        if widest == 0.0 {
            return std::array::from_fn(|k| 1.0 / unit(k));
        }
        std::array::from_fn(|k| spread.half[k].max(LEAST_SCALE * widest / unit(k)))
    }

    /// Entry of the rows of leg `i` in the middle, and a bound of what it changes by in the cell
    /// beside [`Self::leg_slopes`].
    fn row(
        &self,
        i: usize,
        k: usize,
        middle: &Middle,
        spread: &Spread,
        bend: &Bend,
    ) -> Option<(f64, f64)> {
        let n = along(&middle.legs[i]);
        let (speed, turn) = if k < 3 { (1.0, 0.0) } else { (self.arm(i), 1.0) };
        let [turned, bent] = bend.direction;
        // n · ∂p: the second derivative of the product.
        let around = turn * spread.turn;
        let bound = speed * (bent + 2.0 * turned * around + around * spread.turn) / 2.0;
        let LegKind::Strut(strut) = self.config.geometry.legs()[i].kind else {
            return Some((n.dot(&self.motion(i, k, middle)), bound));
        };
        let unit = if k < 3 { 1.0 } else { 1.0 / RADIANS };
        let row = middle.gradient[(i, k)] * unit;
        if strut.lead == 0.0 {
            return Some((row, bound));
        }
        // The bilinear form of `nut_bend`.
        let [a, b] = self.cardan(i, middle, [turned, turned + spread.turn])?.map(|c| 1.0 / (c * c));
        let tangents = (a - 1.0).sqrt() + (b - 1.0).sqrt();
        let own = speed / bend.length;
        let second = speed * around / bend.length + 3.0 * own * turned;
        let nut = 3.0 * own * turned * a
            + 3.0 * (own + turn) * (turned + spread.turn) * b
            + tangents * second
            + around * b.sqrt();
        Some((row, bound + strut.lead.abs() / (2.0 * PI) * nut))
    }

    /// Derivatives of n · ∂p/∂k of leg `i` with every coordinate m, by m and k.
    fn leg_slopes(&self, i: usize, middle: &Middle) -> [[f64; 6]; 6] {
        let span = middle.legs[i].platform - middle.legs[i].base;
        let length = span.norm();
        let n = span / length;
        let motions: [Vector3<f64>; 6] = std::array::from_fn(|k| self.motion(i, k, middle));
        std::array::from_fn(|m| {
            let change = self.span_change(i, m, middle);
            let turned = (change - n * n.dot(&change)) / length;
            std::array::from_fn(|k| {
                turned.dot(&motions[k]) + n.dot(&self.second_motion(i, k, m, middle))
            })
        })
    }

    /// Second derivative of the platform anchor of leg `i` with two coordinates.
    fn second_motion(&self, i: usize, k: usize, m: usize, middle: &Middle) -> Vector3<f64> {
        if k < 3 || m < 3 {
            return Vector3::zeros();
        }
        // R = Rz Ry Rx: the turn further left in the product comes last.
        let (outer, inner) = (middle.axes[k.max(m) - 3], middle.axes[k.min(m) - 3]);
        let bent = |arm: Vector3<f64>| outer.cross(&inner.cross(&(middle.rotation * arm)));
        let [shared, own] = self.arms[i].map(bent);
        own + self.of_legs(shared)
    }

    /// The part of a platform's motion that the legs take.
    fn of_legs(&self, v: Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|k, _| if self.active[k] { v[k] } else { 0.0 })
    }
}

impl Spread {
    /// How far the steps together change a value with this gradient, to first order.
    fn slope(&self, gradient: &[f64; 6]) -> f64 {
        let change = |step: &[f64; 6]| (0..6).map(|k| gradient[k] * step[k]).sum::<f64>();
        self.steps.iter().map(|step| change(step).abs()).sum()
    }

    /// Bounds of the first and second derivative of an anchor's place.
    fn of_anchor(&self, arm: f64) -> (f64, f64) {
        (self.shift + arm * self.turn, arm * self.turn * self.turn)
    }
}

/// A rod whose lower end runs with speed `pace` and acceleration `curve` per unit of its joint
/// and the least share `drive` of that along the rod.
fn rod_bend(
    drive: f64,
    pace: f64,
    curve: f64,
    travel: f64,
    second: f64,
    rod: f64,
    unit: f64,
) -> Option<Bend> {
    (drive >= LEAST_DRIVE).then_some(())?;
    let gain = drive * pace;
    let rate = travel / gain;
    let first = travel + pace * rate;
    let joint = (first * first / rod + second + curve * rate * rate) / gain;
    let bent = second + curve * rate * rate + pace * joint;
    let direction = [first / rod, second_of_direction(first, bent, rod)];
    Some(Bend {
        joint: joint / unit,
        direction,
        length: rod,
        ends: [bent - second, second],
        farthest: travel.max(pace * rate),
    })
}

/// Bound of the second derivative of a unit vector along a vector with these bounds.
fn second_of_direction(first: f64, second: f64, length: f64) -> f64 {
    let turn = first / length;
    second / length + 3.0 * turn * turn
}

/// Pairs of legs, lower number first, that share no anchor.
fn watched_pairs(config: &MachineConfig) -> Vec<[usize; 2]> {
    let watch = config.machine.watch();
    let pairs = (0..config.legs()).flat_map(|i| (i + 1..config.legs()).map(move |j| [i, j]));
    pairs.filter(|pair| watch.is_watched(*pair)).collect()
}

/// Lengths of the arms from the point that the conditioning is about, by its radius.
fn levers(config: &MachineConfig, active: &[bool; 6]) -> Vec<f64> {
    let anchors: Vec<Vector3<f64>> =
        config.geometry.legs().iter().map(|leg| Vector3::from(leg.platform)).collect();
    let middle = match active[..3] {
        [true, true, true] => anchors.iter().sum::<Vector3<f64>>() / anchors.len() as f64,
        _ => Vector3::from(config.geometry.centre),
    };
    anchors.iter().map(|anchor| (anchor - middle).norm() / config.machine.radius()).collect()
}

fn along(leg: &Segment) -> Vector3<f64> {
    (leg.platform - leg.base).normalize()
}

/// A step along one coordinate.
fn along_one(k: usize, half: f64) -> [f64; 6] {
    std::array::from_fn(|m| if m == k { half } else { 0.0 })
}

fn greatest(values: &[f64]) -> usize {
    (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or(0)
}

fn least_cosine(cone: Option<f64>) -> f64 {
    cone.map_or(-2.0, |angle| (angle * RADIANS).cos())
}
