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
//! **Tilt, pyramids**: cosines of angles between a leg, or the tool axis, and vectors that stand
//! still in base or platform, as those of the cones.
//!
//! **Conditioning**: with G the rows [u (ρ × u)/r] of the legs and M their pseudo-inverse in the
//! middle, M G(X) = I + E, where E is bounded entry by entry by a matrix B: the slopes along every step
//! in amount, and |M| times the bounds of the second derivatives. Where the spectral radius of B is
//! less than 1, (I + E)⁻¹ is bounded by I + B + B² + … = (I − B)⁻¹, and as v = (I + E)⁻¹ M G(X) v, the
//! least singular value is at least σ(C) / ‖(I − B)⁻¹‖.
//!
//! **Regular**: the same of the rows of the joints J, nut corrections included: M J(X) = I + E, where
//! B has |M (J(C) − G(C))| more. Where its spectral radius is less than 1, the joints hold the
//! platform at every pose of the cell.

use crate::limits::beyond_axes;
use crate::read::machine::MachineConfig;
use kinematics::{
    At, Fault, Jacobian, Joints, LEAST_DRIVE, LEAST_SINE_TO_AXIS, LegGeometry, LegKind, Letter,
    Limit, Limits, MAX_LEGS, Margin, Matrix3, Part, Pose, Segment, Vector3,
};
use nalgebra::{Matrix6, SMatrix, Vector6};
use std::f64::consts::PI;
use std::ops::ControlFlow;

const RADIANS: f64 = PI / 180.0;

/// Least cosine of the angle between a strut and the plane square to a cardan axis, 80 degrees. It
/// is a choice of this proof: the correction is defined beyond it, up to the core's
/// [`LEAST_SINE_TO_AXIS`], but changes so fast there that no cell of use is proved.
const LEAST_COSINE: f64 = 0.17;
// The cosine of the angle to the plane is the sine of that to the axis.
const _: () = assert!(LEAST_COSINE > LEAST_SINE_TO_AXIS);

/// Steps towards the positive vector that bounds the spectral radius of a matrix best.
const STEPS: usize = 4;

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
    /// The pose has no joint values.
    Fault(Fault),
    /// A limit that is not kept.
    Limit(Margin),
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

/// The value of a limit over a cell, or on a way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// In the middle.
    pub margin: Margin,
    /// Nowhere less and more than these; infinite where nothing is known. Distances of legs that are
    /// nowhere the nearest ones have a lower bound than need be.
    pub ends: [f64; 2],
}

impl Span {
    fn of(limit: Limit, part: Part, value: f64, ends: [f64; 2], range: [f64; 2]) -> Self {
        Self { margin: Margin { limit, part, value, range }, ends }
    }

    /// The value keeps at least this distance from the ends of its range everywhere, negative
    /// beyond them; minus infinity where nothing is known.
    pub fn room(&self) -> f64 {
        let [low, high] = self.margin.range;
        let room = (self.ends[0] - low).min(high - self.ends[1]);
        // What is not a number proves nothing.
        if room.is_nan() { f64::NEG_INFINITY } else { room }
    }
}

/// What is proved of a straight way.
#[derive(Clone, Debug, PartialEq)]
pub struct Way {
    /// Joint values. Where all bends are finite, every pose has joint values.
    pub joints: Vec<Course>,
    /// All limits that are set, of the pose alone and without its axes.
    pub spans: Vec<Span>,
    /// Whether the legs are proved to hold the platform everywhere.
    pub holds: bool,
}

/// Legs by coordinates.
type Rows = SMatrix<f64, MAX_LEGS, 6>;

/// Coordinates by legs.
type Inverse = SMatrix<f64, 6, MAX_LEGS>;

/// Coordinates by coordinates.
type Square = Matrix6<f64>;

/// A machine with one tool, as its cells see it.
pub struct Reach<'a> {
    config: &'a MachineConfig,
    /// Tool vector, spindle offset included.
    tool: Vector3<f64>,
    /// Those of the pose, without axes.
    limits: Limits,
    /// Coordinates that the legs move.
    active: [bool; 6],
    /// Platform anchors in parts that turn about the control point and that a held or table
    /// coordinate takes away from the legs, or not.
    arms: Vec<[Vector3<f64>; 2]>,
    /// Directions of the legs at home.
    home: Vec<Vector3<f64>>,
    /// Pairs of legs, lower number first, that share no anchor.
    pairs: Vec<[usize; 2]>,
    /// Point of the platform that the conditioning is about.
    about: Vector3<f64>,
    /// Whether any strut has a lead.
    is_geared: bool,
}

/// How far anything moves within a cell: its poses are the middle plus a sum of `steps`, each
/// times a number from -1 to 1. Machine units and radians.
struct Spread {
    steps: Vec<[f64; 6]>,
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
struct Middle<'a> {
    at: At<'a>,
    gradient: Jacobian,
    rotation: Matrix3<f64>,
    /// Axes that A, B and C turn about, in base.
    axes: [Vector3<f64>; 3],
    legs: Vec<LegMiddle>,
}

/// A leg there.
struct LegMiddle {
    segment: Segment,
    /// Unit vector along it.
    n: Vector3<f64>,
    length: f64,
    /// Changes of the platform anchor with every coordinate, per machine unit or radian.
    motions: [Vector3<f64>; 6],
    /// The same of the vector along the leg.
    changes: [Vector3<f64>; 6],
}

/// What is not proved of a cell.
struct Unproved {
    /// The coordinate to halve it along.
    along: usize,
    /// Whether all limits are proved but how well the legs hold the platform.
    but_conditioning: bool,
}

/// How well the legs hold the platform over a cell.
struct Hold {
    /// The smallest singular value is its value in the middle times this at least.
    share: f64,
    /// Whether the joints hold the platform everywhere.
    is_regular: bool,
    /// Bound of the largest singular value of the pseudo-inverse in the middle.
    inverse: f64,
    /// What every step of the cell contributes to what is not known.
    shares: Vec<f64>,
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
        let home = config.machine.at(&config.home_pose(), &config.spindle)?;
        let centre = Vector3::from(config.geometry.centre);
        let arms = |leg: &LegGeometry| {
            let anchor = Vector3::from(leg.platform);
            match active[..3] {
                [true, true, true] => [tool + anchor, Vector3::zeros()],
                _ => [tool + centre, anchor - centre],
            }
        };
        let legs = config.geometry.legs();
        let anchors = legs.iter().map(|leg| Vector3::from(leg.platform));
        Ok(Self {
            config,
            tool,
            limits: beyond_axes(config),
            active,
            arms: legs.iter().map(arms).collect(),
            home: home.segments()[..legs.len()].iter().map(|leg| leg.span().normalize()).collect(),
            pairs: pairs(config),
            about: match active[..3] {
                [true, true, true] => anchors.sum::<Vector3<f64>>() / legs.len() as f64,
                _ => centre,
            },
            is_geared: legs.iter().any(|leg| lead(leg) != 0.0),
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
        self.at(pose).map_or(0.0, |at| at.smallest_singular_value())
    }

    /// The machine at a pose.
    ///
    /// # Errors
    /// As [`kinematics::Machine::at`].
    pub fn at(&self, pose: &[f64; 6]) -> Result<At<'a>, Fault> {
        self.config.machine.at(&Pose::from_degrees(*pose), &self.tool)
    }

    /// Whether the machine can take one pose.
    ///
    /// # Errors
    /// What stops it.
    pub fn check(&self, pose: &[f64; 6]) -> Result<(), Stop> {
        let at = self.at(pose).map_err(Stop::Fault)?;
        at.check(&self.limits).map_err(Stop::Limit)
    }

    /// What is known of a cell.
    pub fn judge(&self, cell: &Cell) -> Verdict {
        let middle = match self.middle(&cell.middle) {
            Ok(middle) => middle,
            Err(fault) => return Verdict::Outside(Stop::Fault(fault)),
        };
        // What is proved of the cell holds in its middle, too.
        match self.holds(cell, &middle) {
            Ok(()) => Verdict::Inside,
            Err(Unproved { along, but_conditioning }) => {
                let rest = match but_conditioning {
                    true => Limits { conditioning: self.limits.conditioning, ..Limits::NONE },
                    false => self.limits,
                };
                match middle.at.check(&rest) {
                    Ok(()) => Verdict::Open(along),
                    Err(margin) => Verdict::Outside(Stop::Limit(margin)),
                }
            }
        }
    }

    fn middle(&self, pose: &[f64; 6]) -> Result<Middle<'a>, Fault> {
        let at = self.at(pose)?;
        let ((sb, cb), (sc, cc)) = (at.pose().angles.y.sin_cos(), at.pose().angles.z.sin_cos());
        let mut middle = Middle {
            gradient: at.pose_jacobian()?,
            rotation: at.rotation(),
            axes: [
                Vector3::new(cc * cb, sc * cb, -sb),
                Vector3::new(-sc, cc, 0.0),
                Vector3::new(0.0, 0.0, 1.0),
            ],
            at,
            legs: vec![],
        };
        middle.legs = (0..self.config.legs()).map(|i| self.leg(i, &middle)).collect();
        Ok(middle)
    }

    fn leg(&self, i: usize, middle: &Middle) -> LegMiddle {
        let segment = middle.at.segments()[i];
        let motions = self.motions(i, middle);
        let length = segment.span().norm();
        let changes = self.span_changes(i, &segment, &motions, middle);
        LegMiddle { segment, n: segment.span() / length, length, motions, changes }
    }

    /// Whether every pose of a cell is proved to be inside.
    fn holds(&self, cell: &Cell, middle: &Middle) -> Result<(), Unproved> {
        let spread = self.spread((0..6).map(|k| along_one(k, cell.half[k])));
        let along = || greatest(&self.extents(&spread));
        let unproved = || Unproved { along: along(), but_conditioning: false };
        let bends: Option<Vec<_>> =
            (0..self.config.legs()).map(|i| self.bend(i, middle, &spread)).collect();
        let bends = bends.ok_or_else(unproved)?;
        let kept = |span: Span| match span.room() >= 0.0 {
            true => ControlFlow::Continue(()),
            false => ControlFlow::Break(()),
        };
        if self.spans(middle, &spread, Some(&bends), self.limits.clearance, kept).is_break() {
            return Err(unproved());
        }
        let hold = self.hold(middle, &spread, &bends);
        let least = self.limits.conditioning;
        let is_kept = hold.is_regular
            && (hold.share / hold.inverse >= least
                || hold.share * middle.at.smallest_singular_value() >= least);
        let along = greatest(&hold.shares);
        is_kept.then_some(()).ok_or(Unproved { along, but_conditioning: true })
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
        let mut spans = vec![];
        let _ = self.spans(&middle, &spread, bends.as_deref(), f64::INFINITY, |span| {
            spans.push(span);
            ControlFlow::<()>::Continue(())
        });
        let hold = bends.as_ref().map(|bends| self.hold(&middle, &spread, bends));
        let holds = hold.as_ref().is_some_and(|hold| hold.is_regular);
        let value = middle.at.smallest_singular_value();
        let least = match hold {
            Some(hold) if hold.is_regular && hold.share > 0.0 => hold.share * value,
            // Of rows of which nothing is known but that they are there.
            Some(_) => 0.0,
            None => f64::NEG_INFINITY,
        };
        let range = [self.limits.conditioning, f64::INFINITY];
        let ends = [least, f64::INFINITY];
        spans.push(Span::of(Limit::Conditioning, Part::Whole, value, ends, range));
        let joint = |i| self.joint_course(i, &middle, &spread, bends.as_deref());
        Ok(Way { joints: (0..self.config.joints.len()).map(joint).collect(), spans, holds })
    }

    /// Visits all limits that are set, of the pose alone but for its axes and the conditioning.
    /// Bounds of distances that are `enough` are not made any better.
    fn spans<B>(
        &self,
        middle: &Middle,
        spread: &Spread,
        bends: Option<&[Bend]>,
        enough: f64,
        mut visit: impl FnMut(Span) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        for (i, joint) in self.config.joints.iter().enumerate() {
            let course = self.joint_course(i, middle, spread, bends);
            let (low, high) = course.range();
            let range = [joint.min, joint.max];
            let part = Part::Joint(i);
            visit(Span::of(Limit::JointRange, part, course.middle, [low, high], range))?;
        }
        for i in 0..self.config.legs() {
            let lean = Lean { i, middle, spread, bend: bends.map(|bends| &bends[i]) };
            self.cones(&lean, &mut visit)?;
            self.pyramids(&lean, &mut visit)?;
        }
        if self.limits.tilt != 0.0 {
            let course = tilt(middle, spread);
            let ends = [f64::NEG_INFINITY, degrees_of_cosine(course.range().0)];
            let value = middle.at.tilt();
            let range = [f64::NEG_INFINITY, self.limits.tilt];
            visit(Span::of(Limit::Tilt, Part::Whole, value, ends, range))?;
        }
        self.gaps(middle, spread, bends, enough, &mut visit)
    }

    fn cones<B>(
        &self,
        lean: &Lean,
        visit: &mut impl FnMut(Span) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        for (limit, most) in [
            (Limit::BaseCone, self.limits.base_cone[lean.i]),
            (Limit::PlatformCone, self.limits.platform_cone[lean.i]),
        ] {
            if most == 0.0 {
                continue;
            }
            let course = lean.course(limit == Limit::PlatformCone, &self.home[lean.i]);
            let ends = [f64::NEG_INFINITY, degrees_of_cosine(course.range().0)];
            let value = degrees_of_cosine(course.middle);
            let range = [f64::NEG_INFINITY, most];
            visit(Span::of(limit, Part::Leg(lean.i), value, ends, range))?;
        }
        ControlFlow::Continue(())
    }

    fn pyramids<B>(
        &self,
        lean: &Lean,
        visit: &mut impl FnMut(Span) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        for (limit, most) in [
            (Limit::BasePyramid, self.limits.base_pyramid[lean.i]),
            (Limit::PlatformPyramid, self.limits.platform_pyramid[lean.i]),
        ] {
            if most == [0.0; 2] {
                continue;
            }
            let is_platform = limit == Limit::PlatformPyramid;
            let turns = lean.middle.at.turns()[usize::from(is_platform)];
            let turns = [turns.about[lean.i], turns.across[lean.i]];
            let known = self.turns(lean, is_platform);
            for k in (0..2).filter(|k| most[*k] != 0.0) {
                let ends = known.map_or([f64::NEG_INFINITY, f64::INFINITY], |known| known[k]);
                let range = [-most[k], most[k]];
                visit(Span::of(limit, Part::Leg(lean.i), turns[k], ends, range))?;
            }
        }
        ControlFlow::Continue(())
    }

    /// Ends of the turns about the fixed axis of a cardan joint and across it, degrees.
    fn turns(&self, lean: &Lean, is_platform: bool) -> Option<[[f64; 2]; 2]> {
        let LegKind::Strut(strut) = self.config.geometry.legs()[lean.i].kind else { return None };
        let axis = if is_platform { strut.platform_axis } else { strut.base_axis };
        let axis = Vector3::from(axis).try_normalize(0.0)?;
        let home = &self.home[lean.i];
        let zero = (home - axis * axis.dot(home)).try_normalize(0.0)?;
        let quarter = axis.cross(&zero);
        let [x, y, sine] =
            [zero, quarter, axis].map(|vector| lean.course(is_platform, &vector).range());
        let across = [sine.0, sine.1].map(|sine| sine.clamp(-1.0, 1.0).asin() / RADIANS);
        // Where the leg may point along the axis, or back, it may be turned by any angle.
        let about = match x.0 <= 0.0 && y.0 <= 0.0 && y.1 >= 0.0 {
            true => [-180.0, 180.0],
            false => {
                let corners = [(x.0, y.0), (x.0, y.1), (x.1, y.0), (x.1, y.1)];
                let angles = corners.map(|(x, y)| y.atan2(x) / RADIANS);
                [
                    angles.into_iter().fold(180.0, f64::min),
                    angles.into_iter().fold(-180.0, f64::max),
                ]
            }
        };
        Some([about, across])
    }

    /// Of steps in machine units and degrees.
    fn spread(&self, steps: impl IntoIterator<Item = [f64; 6]>) -> Spread {
        let radians =
            |s: [f64; 6]| std::array::from_fn(|k| if k < 3 { s[k] } else { s[k] * RADIANS });
        let steps: Vec<[f64; 6]> = steps.into_iter().map(radians).collect();
        let half = |k: usize| steps.iter().map(|step| step[k].abs()).sum::<f64>();
        let squares = (0..3).filter(|k| self.active[*k]).map(|k| half(k) * half(k));
        let shift = squares.sum::<f64>().sqrt();
        Spread { shift, turn: (3..6).map(half).sum(), steps }
    }

    /// How far every step moves the ends of the legs, more or less: to compare.
    fn extents(&self, spread: &Spread) -> Vec<f64> {
        let unit = |k: usize| if k < 3 { 1.0 } else { self.config.machine.size() / 2.0 };
        let extent = |step: &[f64; 6]| (0..6).map(|k| step[k].abs() * unit(k)).sum();
        spread.steps.iter().map(extent).collect()
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
        Course { middle: middle.at.joints()[i], slope: spread.slope(&gradient), bend, rounding }
    }

    /// Changes of the platform anchor of leg `i` with every coordinate, per machine unit or radian.
    fn motions(&self, i: usize, middle: &Middle) -> [Vector3<f64>; 6] {
        let [shared, own] = self.arms[i].map(|arm| middle.rotation * arm);
        std::array::from_fn(|k| {
            if k < 3 {
                let mut along = Vector3::zeros();
                along[k] = if self.active[k] { 1.0 } else { 0.0 };
                return along;
            }
            let axis = middle.axes[k - 3];
            axis.cross(&own) + self.of_legs(axis.cross(&shared))
        })
    }

    /// Changes of the vector along leg `i` with every coordinate, per machine unit or radian.
    fn span_changes(
        &self,
        i: usize,
        segment: &Segment,
        motions: &[Vector3<f64>; 6],
        middle: &Middle,
    ) -> [Vector3<f64>; 6] {
        let leg = &self.config.geometry.legs()[i];
        let per_joint = match leg.kind {
            LegKind::Strut(_) => return *motions,
            LegKind::Slider(slider) => Vector3::from(slider.guide).normalize(),
            LegKind::Crank(crank) => {
                let arm = segment.base - Vector3::from(leg.base);
                Vector3::from(crank.axis).normalize().cross(&arm) * RADIANS
            }
        };
        std::array::from_fn(|k| {
            let unit = if k < 3 { 1.0 } else { 1.0 / RADIANS };
            motions[k] - per_joint * (middle.gradient[(i, k)] * unit)
        })
    }

    fn arm(&self, i: usize) -> f64 {
        self.arms[i].iter().map(|arm| arm.norm()).sum()
    }

    /// Bounds of one leg; `None` where the cell is too large for any.
    fn bend(&self, i: usize, middle: &Middle, spread: &Spread) -> Option<Bend> {
        let segment = &middle.legs[i].segment;
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
        let room = PI - middle.at.corrections()[i].abs() / per_radian;
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
        let n = middle.legs[i].n;
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

    /// Distances of the legs; bounds that are `enough`, or those of pairs that are not the nearest
    /// ones anywhere, are not made any better.
    fn gaps<B>(
        &self,
        middle: &Middle,
        spread: &Spread,
        bends: Option<&[Bend]>,
        enough: f64,
        visit: &mut impl FnMut(Span) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let Some(nearest) = middle.at.nearest().map(|nearest| nearest.distance) else {
            return ControlFlow::Continue(());
        };
        // No two legs come nearer by more than the two that move farthest.
        let farthest = bends.map_or(f64::INFINITY, |bends| {
            bends.iter().map(|bend| bend.farthest).fold(0.0, f64::max)
        });
        if nearest - 2.0 * farthest - ROUNDING * self.config.machine.size() >= enough {
            return ControlFlow::Continue(());
        }
        let nearest = nearest.min(enough);
        for pair @ [i, j] in &self.pairs {
            let gap = middle.legs[*i].segment.gap(&middle.legs[*j].segment);
            let distance = gap.norm();
            let least = bends.map_or(f64::NEG_INFINITY, |bends| {
                // No point of a leg moves farther than its ends.
                let least = distance
                    - bends[*i].farthest
                    - bends[*j].farthest
                    - ROUNDING * self.config.machine.size();
                match least >= nearest || distance == 0.0 {
                    true => least,
                    false => self.least_gap(*pair, &(gap / distance), middle, spread, bends),
                }
            });
            let range = [self.limits.clearance, f64::INFINITY];
            let ends = [least, f64::INFINITY];
            visit(Span::of(Limit::Clearance, Part::Legs(*pair), distance, ends, range))?;
        }
        ControlFlow::Continue(())
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
            let leg = &middle.legs[i];
            let ends = [leg.segment.base, leg.segment.platform].map(|end| w.dot(&end));
            let mut gradients = [[0.0; 6]; 2];
            for k in 0..6 {
                gradients[0][k] = w.dot(&(leg.motions[k] - leg.changes[k]));
                gradients[1][k] = w.dot(&leg.motions[k]);
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

    /// How well the legs hold the platform over a cell.
    fn hold(&self, middle: &Middle, spread: &Spread, bends: &[Bend]) -> Hold {
        let extents = self.extents(spread);
        let unknown = |shares| Hold { share: 0.0, is_regular: false, inverse: 1.0, shares };
        let rows = constraint_rows(&middle.at);
        let Some((inverse, square)) = self.pseudo_inverse(&rows) else { return unknown(extents) };
        let rest = self.row_rest(spread, bends);
        let change = |step| (inverse * self.row_slopes(middle, step)).abs();
        let changes: Vec<Square> = spread.steps.iter().map(change).collect();
        let bound = changes.iter().fold(inverse.abs() * rest, |sum, change| sum + change);
        let whole: f64 = extents.iter().sum();
        let beside = (inverse.abs() * rest).norm() / whole;
        let share = |(change, extent): (&Square, &f64)| change.norm() + beside * extent;
        let shares = changes.iter().zip(&extents).map(share).collect();
        let is_bounded = spectral_radius(&bound) < 1.0 - ROUNDING;
        let is_regular = match self.is_geared {
            true => self.is_regular_with_nuts(middle, spread, bends, (&rows, &inverse, &bound)),
            false => is_bounded,
        };
        let series = (Square::identity() - bound).try_inverse().filter(|_| is_bounded);
        let norm = series.map(|sum| spectral_radius(&sum.tr_mul(&sum)).sqrt());
        let share = norm.map_or(0.0, |norm| (1.0 - ROUNDING) / norm);
        // The largest eigenvalue is at most the fourth root of the trace of the fourth power.
        let inverse = (square * square).norm().powf(0.25);
        Hold { share, is_regular, inverse, shares }
    }

    /// Whether the rows of the joints, nut corrections included, have an inverse all over a cell,
    /// from the bound of [`Self::hold`] and its pseudo-inverse.
    fn is_regular_with_nuts(
        &self,
        middle: &Middle,
        spread: &Spread,
        bends: &[Bend],
        (rows, inverse, bound): (&Rows, &Inverse, &Square),
    ) -> bool {
        let nuts = self.rows_of_nuts(middle).zip(self.rest_of_nuts(middle, spread, bends));
        nuts.is_some_and(|(with_nuts, rest)| {
            let of_nuts = (inverse * (with_nuts - rows)).abs() + inverse.abs() * rest;
            spectral_radius(&(bound + of_nuts)) < 1.0 - ROUNDING
        })
    }

    /// Pseudo-inverse of rows, and its product with its transpose; coordinates that the legs do not
    /// move have zeros.
    fn pseudo_inverse(&self, rows: &Rows) -> Option<(Inverse, Square)> {
        let mut normal = rows.tr_mul(rows);
        for k in (0..6).filter(|k| !self.active[*k]) {
            normal[(k, k)] = 1.0;
        }
        let mut square = normal.cholesky()?.inverse();
        for k in (0..6).filter(|k| !self.active[*k]) {
            square[(k, k)] = 0.0;
        }
        Some((square * rows.transpose(), square))
    }

    /// Whether the angular columns are about the axes of base, or about those of one or two angles,
    /// which turn as well.
    fn is_about_base(&self) -> bool {
        self.active[3..] == [true; 3]
    }

    /// Axis of an angular column.
    fn axis(&self, k: usize, middle: &Middle) -> Vector3<f64> {
        match self.is_about_base() {
            true => Vector3::ith(k, 1.0),
            false => middle.axes[k],
        }
    }

    /// From the point that the conditioning is about to the platform anchor of leg `i`, in base.
    fn lever(&self, i: usize, middle: &Middle) -> Vector3<f64> {
        let anchor = Vector3::from(self.config.geometry.legs()[i].platform);
        middle.rotation * (anchor - self.about)
    }

    /// Change of the constraint rows along a step, machine units and radians.
    fn row_slopes(&self, middle: &Middle, step: &[f64; 6]) -> Rows {
        let mut slopes = Rows::zeros();
        let per_radius = 1.0 / self.config.machine.radius();
        let turn: Vector3<f64> = (0..3).map(|k| middle.axes[k] * step[k + 3]).sum();
        let moved = || (0..6).filter(|k| step[*k] != 0.0);
        for (i, leg) in middle.legs.iter().enumerate() {
            let change: Vector3<f64> = moved().map(|k| leg.changes[k] * step[k]).sum();
            let turned = (change - leg.n * leg.n.dot(&change)) / leg.length;
            let lever = self.lever(i, middle);
            let moment = lever.cross(&leg.n);
            let slope = turn.cross(&lever).cross(&leg.n) + lever.cross(&turned);
            for k in (0..3).filter(|k| self.active[*k]) {
                slopes[(i, k)] = turned[k];
            }
            for k in (0..3).filter(|k| self.active[k + 3]) {
                let mut entry = self.axis(k, middle).dot(&slope);
                if !self.is_about_base() {
                    // R = Rz Ry Rx: every axis turns with those further left in the product.
                    let outer = (k + 1..3).map(|m| middle.axes[m] * step[m + 3]);
                    entry += outer.sum::<Vector3<f64>>().cross(&middle.axes[k]).dot(&moment);
                }
                slopes[(i, k + 3)] = entry * per_radius;
            }
        }
        slopes
    }

    /// Bound of what the constraint rows change by in the cell beside [`Self::row_slopes`].
    fn row_rest(&self, spread: &Spread, bends: &[Bend]) -> Rows {
        let turns = if self.is_about_base() { spread.turn } else { 2.0 * spread.turn };
        let mut rest = Rows::zeros();
        for (i, bend) in bends.iter().enumerate() {
            let [turned, bent] = bend.direction;
            let lever = self.arm_about(i) / self.config.machine.radius();
            let angular = lever * (bent + 2.0 * turned * turns + turns * turns) / 2.0;
            for k in (0..6).filter(|k| self.active[*k]) {
                rest[(i, k)] = if k < 3 { bent / 2.0 } else { angular };
            }
        }
        rest
    }

    fn arm_about(&self, i: usize) -> f64 {
        (Vector3::from(self.config.geometry.legs()[i].platform) - self.about).norm()
    }

    /// The constraint rows with those of the joints in place of the struts'.
    fn rows_of_nuts(&self, middle: &Middle) -> Option<Rows> {
        let of_twist = middle.at.inverse_jacobian().ok()?;
        let mut rows = constraint_rows(&middle.at);
        let per_radius = 1.0 / self.config.machine.radius();
        // From the control point to the one that the rows are about.
        let lever = middle.rotation * (self.tool + self.about);
        let legs = self.config.geometry.legs().iter().enumerate();
        for (i, _) in legs.filter(|(_, leg)| lead(leg) != 0.0) {
            let part = |k: usize| Vector3::from_fn(|m, _| of_twist[(i, k + m)]);
            let (force, moment) = (part(0), part(3) - lever.cross(&part(0)));
            for k in (0..3).filter(|k| self.active[*k]) {
                rows[(i, k)] = force[k];
            }
            for k in (0..3).filter(|k| self.active[k + 3]) {
                rows[(i, k + 3)] = self.axis(k, middle).dot(&moment) * per_radius;
            }
        }
        Some(rows)
    }

    /// Bound of what the nut corrections add to the change of the rows in the cell.
    fn rest_of_nuts(&self, middle: &Middle, spread: &Spread, bends: &[Bend]) -> Option<Rows> {
        let mut rest = Rows::zeros();
        for (i, bend) in bends.iter().enumerate() {
            let lead = lead(&self.config.geometry.legs()[i]);
            if lead == 0.0 {
                continue;
            }
            let [turned, _] = bend.direction;
            let turns = [turned, turned + spread.turn];
            let [a, b] = self.cardan(i, middle, turns)?.map(|cosine| 1.0 / (cosine * cosine));
            let tangents = (a - 1.0).sqrt() + (b - 1.0).sqrt();
            for k in (0..6).filter(|k| self.active[*k]) {
                let (speed, turn) = if k < 3 { (1.0, 0.0) } else { (self.arm_about(i), 1.0) };
                let unit = if k < 3 { 1.0 } else { 1.0 / self.config.machine.radius() };
                // The bilinear form of `nut_bend`.
                let around = turn * spread.turn;
                let own = speed / bend.length;
                let second = speed * around / bend.length + 3.0 * own * turned;
                let nut = 3.0 * own * turned * a
                    + 3.0 * (own + turn) * (turned + spread.turn) * b
                    + tangents * second
                    + around * b.sqrt();
                rest[(i, k)] = lead.abs() / (2.0 * PI) * nut * unit;
            }
        }
        Some(rest)
    }

    /// The part of a platform's motion that the legs take.
    fn of_legs(&self, v: Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|k, _| if self.active[k] { v[k] } else { 0.0 })
    }
}

/// A leg over a cell, as vectors that stand still in base or platform see it.
struct Lean<'a> {
    i: usize,
    middle: &'a Middle<'a>,
    spread: &'a Spread,
    bend: Option<&'a Bend>,
}

impl Lean<'_> {
    /// Product of the leg's direction and a unit vector of base or platform.
    fn course(&self, is_platform: bool, vector: &Vector3<f64>) -> Course {
        let LegMiddle { n, length, changes, .. } = &self.middle.legs[self.i];
        let vector = if is_platform { self.middle.rotation * vector } else { *vector };
        let cosine = n.dot(&vector);
        let across = vector - n * cosine;
        let gradient = std::array::from_fn(|k| {
            let turned = match is_platform && k >= 3 {
                true => n.dot(&self.middle.axes[k - 3].cross(&vector)),
                false => 0.0,
            };
            across.dot(&changes[k]) / length + turned
        });
        // cos = n · d; in the platform d turns, too.
        let turn = if is_platform { self.spread.turn } else { 0.0 };
        let bound = |bend: &Bend| {
            let [first, second] = bend.direction;
            second + 2.0 * first * turn + turn * turn
        };
        Course {
            middle: cosine,
            slope: self.spread.slope(&gradient),
            bend: self.bend.map_or(f64::INFINITY, bound),
            rounding: ROUNDING,
        }
    }
}

/// Cosine of the angle between the tool axis and Z of base.
fn tilt(middle: &Middle, spread: &Spread) -> Course {
    let z = middle.rotation.column(2).into_owned();
    let gradient = std::array::from_fn(|k| match k {
        0..3 => 0.0,
        _ => middle.axes[k - 3].cross(&z).z,
    });
    Course {
        middle: z.z,
        slope: spread.slope(&gradient),
        bend: spread.turn * spread.turn,
        rounding: ROUNDING,
    }
}

/// Bound of the spectral radius of a matrix without negative entries, by Collatz and Wielandt: for
/// any vector x of positive numbers it is at most the largest (B x)ᵢ/xᵢ.
fn spectral_radius(matrix: &Square) -> f64 {
    let mut x = Vector6::repeat(1.0);
    let mut least = f64::INFINITY;
    for _ in 0..STEPS {
        let y = matrix * x;
        let bound = y.component_div(&x).max();
        // What is not a number bounds nothing.
        if bound.is_nan() {
            return f64::INFINITY;
        }
        least = least.min(bound);
        x = y / y.max().max(f64::MIN_POSITIVE) + Vector6::repeat(1e-3);
    }
    least
}

fn constraint_rows(at: &At) -> Rows {
    let rows = at.constraint_rows();
    Rows::from_fn(|i, k| rows[i][k])
}

fn degrees_of_cosine(cosine: f64) -> f64 {
    cosine.clamp(-1.0, 1.0).acos() / RADIANS
}

/// Lead of a strut's screw; 0 where there is none.
fn lead(leg: &LegGeometry) -> f64 {
    match leg.kind {
        LegKind::Strut(strut) => strut.lead,
        _ => 0.0,
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
pub fn pairs(config: &MachineConfig) -> Vec<[usize; 2]> {
    let pairs = (0..config.legs()).flat_map(|i| (i + 1..config.legs()).map(move |j| [i, j]));
    pairs.filter(|pair| config.machine.watch().is_watched(*pair)).collect()
}

/// A step along one coordinate.
fn along_one(k: usize, half: f64) -> [f64; 6] {
    std::array::from_fn(|m| if m == k { half } else { 0.0 })
}

fn greatest(values: &[f64]) -> usize {
    (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or(0)
}
