// SPDX-License-Identifier: GPL-2.0-or-later
//! The checked, frozen machine.
//!
//! Legs are stored in lanes, as many as the number of legs rounded up to 4, 6 or 8, so
//! that loops over them have a fixed length. Lanes beyond the last leg are copies of the
//! first one, which makes them harmless to compute with; what they contribute is
//! dropped (rows and residuals of 0).

use crate::at::{self, At};
use crate::fault::{Cause, Fault};
use crate::forward::{Solution, Solver};
use crate::freeze::Frozen;
use crate::geometry::Geometry;
use crate::lanes::{Lanes3, are_above, both, cross, dot, pair, put, scaled, sum, times, wide};
use crate::layout::{Joints, Layout, Letter, MAX_JOINTS, MAX_LEGS, PerLeg};
use crate::leg::Leg;
use crate::nut::{Nut, Twist};
use crate::pose::Pose;
use crate::segment::Segment;
use crate::watch::Watch;
use nalgebra::{Matrix3, SMatrix, Vector3};
use wide::f64x2;

/// Largest tool offset, joint offset and distance of the centre in sizes of the machine: with
/// more the rounding of f64 would take from joints and poses what the solver promises,
/// 1e6 · 2⁻⁵³ = 1e-10 of the size.
pub(crate) const FARTHEST: f64 = 1e6;

/// Shortest leg that still has a direction, as a share of the size.
const MIN_LENGTH: f64 = 1e-6;

/// Rows of joints by columns of a twist or pose; rows beyond the last joint are 0.
pub type Jacobian = SMatrix<f64, MAX_JOINTS, 6>;

/// A parallel machine, made by [`Machine::freeze`], which checks it.
#[derive(Clone, Debug, PartialEq)]
pub struct Machine {
    pub(crate) lanes: Lanes,
    watch: Watch,
}

/// The machine by number of lanes.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "without an allocator there is no box")]
pub(crate) enum Lanes {
    Four(Mechanism<4>),
    Six(Mechanism<6>),
    Eight(Mechanism<8>),
}

/// Calls the same method on whichever mechanism a machine has.
macro_rules! each {
    ($machine:expr, $mechanism:ident => $call:expr) => {
        each!(&$machine.lanes; $mechanism => $call)
    };
    ($lanes:expr; $mechanism:ident => $call:expr) => {
        match $lanes {
            Lanes::Four($mechanism) => $call,
            Lanes::Six($mechanism) => $call,
            Lanes::Eight($mechanism) => $call,
        }
    };
}
pub(crate) use each;

impl Machine {
    /// Checks a geometry and computes what stays constant.
    ///
    /// `offset` is in joint units, one per leg (0 for a joint that reads its native
    /// value). Work is bounded: no loop depends on the values.
    ///
    /// # Errors
    /// A [`Fault`] with a cause of the geometry group, naming the leg.
    pub fn freeze(geometry: &Geometry, offset: &PerLeg) -> Result<Self, Fault> {
        let frozen = Frozen { geometry, offset };
        let lanes = match geometry.layout().legs() {
            0..=4 => Lanes::Four(frozen.mechanism()?),
            5..=6 => Lanes::Six(frozen.mechanism()?),
            _ => Lanes::Eight(frozen.mechanism()?),
        };
        let mut machine = Self { lanes, watch: Watch::of(geometry, None) };
        if let Some(home) = geometry.home {
            // No tool: it would move a leg where the reference pose is tilted.
            let watch = machine
                .at(&Pose::from_degrees(home), &Vector3::zeros())
                .map(|at| Watch::of(geometry, Some((at.segments(), &at.rotation()))));
            machine.watch = watch?;
        }
        Ok(machine)
    }

    /// The machine at a pose; `tool` as in [`Machine::inverse`].
    ///
    /// # Errors
    /// As [`Machine::inverse`].
    pub fn at<'a>(&'a self, pose: &Pose, tool: &Vector3<f64>) -> Result<At<'a>, Fault> {
        let legs = match &self.lanes {
            Lanes::Four(m) => at::Lanes::Four(m.at(pose, tool)?),
            Lanes::Six(m) => at::Lanes::Six(m.at(pose, tool)?),
            Lanes::Eight(m) => at::Lanes::Eight(m.at(pose, tool)?),
        };
        At::new(legs, &self.watch, pose)
    }

    /// What does not change about the legs and is needed to watch them.
    pub fn watch(&self) -> &Watch {
        &self.watch
    }

    /// Whether nut corrections are the literal arcsin: a geometry without a reference pose is
    /// frozen like that, until [`Machine::fold_at`].
    #[inline]
    pub fn is_literal(&self) -> bool {
        each!(self, m => m.nut.as_ref().is_some_and(Nut::is_literal))
    }

    /// Fixes the folds of nut corrections at a pose, as a reference pose does: there, and up to
    /// a quarter turn of each strut from there, nothing changes; beyond, corrections go on where
    /// the arcsin turns back. A later call fixes them anew.
    ///
    /// A strut may be so near to a quarter turn that rounding has decided which way it goes on:
    /// the first such one comes as [`Cause::FoldUndefined`], and the folds are fixed all the same.
    ///
    /// # Errors
    /// As [`Machine::inverse`], held coordinates aside; then nothing changes.
    pub fn fold_at(&mut self, pose: &Pose, tool: &Vector3<f64>) -> Result<Option<Fault>, Fault> {
        each!(&mut self.lanes; m => m.fold_at(pose, tool))
    }

    /// Takes back what [`Machine::fold_at`] has fixed.
    pub fn unfold(&mut self) {
        each!(&mut self.lanes; m => if let Some(nut) = &mut m.nut { nut.unfold() });
    }

    /// Numbers and letters of the machine.
    pub fn layout(&self) -> &Layout {
        each!(self, m => &m.layout)
    }

    /// Largest length of the geometry (distance of an anchor from the origin of its frame,
    /// rod, arm): what relative tolerances refer to. Machine units.
    pub fn size(&self) -> f64 {
        each!(self, m => m.size)
    }

    /// Root mean square distance of the platform anchors from their centroid: turns
    /// an angle into a length in pose distances. Machine units. (The size, where all
    /// anchors are one point and no angle is active.)
    pub fn radius(&self) -> f64 {
        each!(self, m => m.radius)
    }

    /// Joint values of a pose, in joint units (struts and sliders: length, cranks: degrees).
    ///
    /// `tool` is the vector o in machine units: tool offsets x and y, and the sum of
    /// spindle and tool offset in z. It changes no joint at A = B = C = 0: legs and table
    /// place the point D = t − o + R (o + centre).
    ///
    /// # Errors
    /// A [`Fault`] of the pose group; nothing is returned in part.
    #[inline(never)]
    pub fn inverse(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Joints, Fault> {
        let mut joints = [0.0; MAX_JOINTS];
        self.inverse_into(pose, tool, &mut joints)?;
        Ok(joints)
    }

    /// As [`Machine::inverse`], into the first of `joints`; those beyond the machine's, and
    /// all after an error, are left alone. For those who count nanoseconds: a `Result` of
    /// many values is copied about.
    ///
    /// # Errors
    /// As [`Machine::inverse`].
    #[inline(always)]
    pub fn inverse_into(
        &self,
        pose: &Pose,
        tool: &Vector3<f64>,
        joints: &mut [f64],
    ) -> Result<(), Fault> {
        each!(self, m => m.inverse(pose, tool, joints))
    }

    /// Whether a tool vector may be computed with.
    ///
    /// # Errors
    /// [`Cause::ToolNotFinite`], [`Cause::ToolTooLong`].
    pub fn check_tool(&self, tool: &Vector3<f64>) -> Result<(), Fault> {
        each!(self, m => m.check_tool(tool))
    }

    /// Pose of the joint values that is connected with `seed`.
    ///
    /// `joints` in joint units; `tool` as in [`Machine::inverse`]. Angles of the result
    /// are those nearest to the seed's, whole turns kept; held coordinates are 0, those of
    /// the seed are not read.
    ///
    /// # Errors
    /// A [`Fault`] of the joint, solver or settings group. With
    /// [`crate::Method::Certified`] a pose is never returned unless it is proved to be the
    /// connected one.
    ///
    /// Cost: at most `limit_iterations` linear solves and [`crate::MAX_SUB_STEPS`] sub-steps.
    #[inline]
    pub fn forward(
        &self,
        joints: &Joints,
        seed: &Pose,
        tool: &Vector3<f64>,
        solver: &Solver,
    ) -> Result<Solution, Fault> {
        let mut solution = Solution::NONE;
        self.forward_into(joints, seed, tool, solver, &mut solution)?;
        Ok(solution)
    }

    /// As [`Machine::forward`], into `solution`, which an error leaves alone; see
    /// [`Machine::inverse_into`].
    ///
    /// # Errors
    /// As [`Machine::forward`].
    #[inline]
    pub fn forward_into(
        &self,
        joints: &Joints,
        seed: &Pose,
        tool: &Vector3<f64>,
        solver: &Solver,
        solution: &mut Solution,
    ) -> Result<(), Fault> {
        each!(self, m => m.forward(joints, seed, tool, solver, solution))
    }

    /// Largest [`Solution::residual`] that forward may return with these settings, machine
    /// units: the residual limit where legs exceed coordinates, else what the convergence
    /// criterion of the legs' lengths makes of a joint.
    pub fn largest_residual(&self, solver: &Solver) -> f64 {
        each!(self, m => m.largest_residual(solver))
    }

    /// [`At::segments`] of a pose.
    ///
    /// # Errors
    /// As [`Machine::at`].
    pub fn segments(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<[Segment; MAX_LEGS], Fault> {
        Ok(*self.at(pose, tool)?.segments())
    }

    /// [`At::corrections`] of a pose.
    ///
    /// # Errors
    /// As [`Machine::at`].
    pub fn corrections(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<PerLeg, Fault> {
        Ok(self.at(pose, tool)?.corrections())
    }

    /// [`At::inverse_jacobian`] of a pose.
    ///
    /// # Errors
    /// As there, and as [`Machine::at`].
    pub fn inverse_jacobian(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Jacobian, Fault> {
        self.at(pose, tool)?.inverse_jacobian()
    }

    /// [`At::pose_jacobian`] of a pose.
    ///
    /// # Errors
    /// As there, and as [`Machine::at`].
    pub fn pose_jacobian(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Jacobian, Fault> {
        self.at(pose, tool)?.pose_jacobian()
    }

    /// [`At::smallest_singular_value`] of a pose.
    ///
    /// # Errors
    /// As [`Machine::at`].
    pub fn conditioning(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<f64, Fault> {
        Ok(self.at(pose, tool)?.smallest_singular_value())
    }

    /// [`At::assembly`] of a pose.
    ///
    /// # Errors
    /// As there, and as [`Machine::at`].
    pub fn assembly(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<i32, Fault> {
        self.at(pose, tool)?.assembly()
    }
}

/// How the orientation of the platform is charted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Chart {
    /// A, B and C are active: rotation vectors about the orientation at hand.
    Group,
    /// One or two of them are: the angles themselves.
    Angles,
    /// None of them is: the platform stays level.
    Level,
}

/// A machine of up to N legs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mechanism<const N: usize> {
    pub layout: Layout,
    pub chart: Chart,
    /// Per coordinate X … C whether the legs move it.
    pub active: [bool; 6],
    /// Whether any coordinate is neither moved by the legs nor by a table.
    pub holds: bool,
    /// Whether any leg is not a strut: its base anchor moves, or its length bends.
    pub moving: bool,
    /// Whether every lane is a strut of its own, and they move all six coordinates.
    pub plain: bool,
    pub legs: [Leg; N],
    /// Base anchors in base.
    pub base: Lanes3<N>,
    /// Platform anchors about the reference point.
    pub arms: Lanes3<N>,
    /// Reference point of all solvers, in the platform frame: the centroid of the
    /// platform anchors, so that a long tool does not weaken the certificate; with a held
    /// or table X, Y, Z the point that these are about.
    pub reference: Vector3<f64>,
    /// Joint = native value + correction − offset.
    pub offset: [f64; N],
    pub nut: Option<Nut<N>>,
    /// Largest length of the geometry, see [`Machine::size`].
    pub size: f64,
    /// Root mean square distance of the platform anchors from their centroid.
    pub radius: f64,
    /// 1 over the radius.
    pub per_radius: f64,
    /// Per leg √(1 + m (|arm|/radius)²), m = active angles (1 for the group): bound of
    /// the platform anchor's speed.
    pub s1: [f64; N],
    /// Per leg m |arm|/radius²: bound of the platform anchor's second derivative.
    pub s2: [f64; N],
    /// 1 for a lane that is a leg, 0 for one that repeats the first.
    pub present: [f64; N],
}

/// Where the platform is: its reference point and orientation, in base. In the order in which
/// vector units write and read it: what is read across two stores has to wait for both.
#[derive(Clone, Copy)]
#[repr(C)]
pub(crate) struct Place {
    pub rotation: Matrix3<f64>,
    pub centre: Vector3<f64>,
    /// A, B, C; kept up to date by [`Chart::Angles`] only.
    pub angles: Vector3<f64>,
}

/// How the platform moves from one place to another.
pub(crate) struct Displacement {
    /// Of the reference point.
    pub shift: Vector3<f64>,
    /// The orientation R becomes R + `change` R.
    pub change: Matrix3<f64>,
}

impl Displacement {
    /// The platform stays.
    pub fn none() -> Self {
        Self { shift: Vector3::zeros(), change: Matrix3::zeros() }
    }
}

/// The legs at one place of the platform.
#[derive(Clone, Copy)]
pub(crate) struct Placed<const N: usize> {
    /// Arms in base (R times the platform anchor about the reference point).
    pub arms: Lanes3<N>,
    /// From moving base anchor to platform anchor.
    pub span: Lanes3<N>,
    pub length: [f64; N],
}

impl<const N: usize> Placed<N> {
    pub const ZERO: Self = Self { arms: Lanes3::ZERO, span: Lanes3::ZERO, length: [0.0; N] };

    #[inline(always)]
    fn put(&mut self, i: usize, span: [f64x2; 3]) {
        self.span.put(i, span);
        put(&mut self.length, i, dot(&span, &span).sqrt());
    }

    /// The legs after the platform has moved, written to `placed`.
    #[inline(always)]
    pub fn moved(&self, by: &Displacement, placed: &mut Self) {
        let shift = wide(&by.shift);
        for i in (0..N).step_by(2) {
            let arm = self.arms.pair(i);
            let turned = times(&by.change, &arm);
            placed.arms.put(i, sum(&arm, &turned));
            placed.put(i, sum(&self.span.pair(i), &sum(&turned, &shift)));
        }
    }

    /// Speeds of the lengths while the platform moves at `v` and turns at `omega`.
    #[inline(always)]
    pub fn stretch(&self, v: &Vector3<f64>, omega: &Vector3<f64>) -> [f64; N] {
        let (v, omega) = (wide(v), wide(omega));
        let mut stretch = [0.0; N];
        for i in (0..N).step_by(2) {
            let speed = sum(&v, &cross(&omega, &self.arms.pair(i)));
            put(&mut stretch, i, dot(&self.span.pair(i), &speed) * self.curved(i));
        }
        stretch
    }

    /// Second derivatives of the lengths while the platform moves at `v` and turns at `omega`,
    /// both constant: u the speed of an arm's end, (|u|² − (n·u)²)/l + n·(ω × (ω × arm)).
    #[inline(always)]
    pub fn bend(&self, v: &Vector3<f64>, omega: &Vector3<f64>) -> [f64; N] {
        let (v, omega) = (wide(v), wide(omega));
        let mut bend = [0.0; N];
        for i in (0..N).step_by(2) {
            let turned = cross(&omega, &self.arms.pair(i));
            let u = sum(&v, &turned);
            let (span, curved) = (self.span.pair(i), self.curved(i));
            let along = dot(&span, &u) * curved;
            let pull = dot(&u, &u) - along * along + dot(&span, &cross(&omega, &turned));
            put(&mut bend, i, pull * curved);
        }
        bend
    }

    /// Unit vectors along the legs, base to platform.
    #[inline(always)]
    pub fn directions(&self) -> Lanes3<N> {
        let mut n = Lanes3::ZERO;
        for i in (0..N).step_by(2) {
            n.put(i, scaled(&self.span.pair(i), self.curved(i)));
        }
        n
    }

    /// 1/l of legs i and i + 1.
    #[inline(always)]
    pub fn curved(&self, i: usize) -> f64x2 {
        // A rod's platform anchor may stand on its base anchor: no direction, but no NaN.
        both(1.0) / pair(&self.length, i).fast_max(both(f64::MIN_POSITIVE))
    }
}

impl<const N: usize> Mechanism<N> {
    /// Number of legs; a bound that the compiler knows.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.layout.legs().min(N)
    }

    /// The pose with its held coordinates at 0; `strict` refuses those that ask for more.
    pub fn held(&self, pose: &Pose, strict: bool) -> Result<Pose, Fault> {
        let given = pose.to_degrees();
        let mut held = *pose;
        for letter in Letter::ALL {
            if !self.layout.is_held(letter) {
                continue;
            }
            let k = letter.index();
            if strict {
                letter.check_held(given[k], self.size)?;
            }
            if letter.is_angle() {
                held.angles[k - 3] = 0.0;
            } else {
                held.position[k] = 0.0;
            }
        }
        Ok(held)
    }

    /// Refuses a tool vector that no pose may be computed with.
    #[inline]
    pub fn check_tool(&self, tool: &Vector3<f64>) -> Result<(), Fault> {
        if self.within_reach(tool).all() {
            return Ok(());
        }
        let largest = tool.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        match tool.iter().all(|v| v.is_finite()) {
            true => Err(Fault::with_value(Cause::ToolTooLong, largest)),
            false => Err(Cause::ToolNotFinite.into()),
        }
    }

    /// Whether a tool vector is neither too long nor NaN, as a mask: both lanes have to say so.
    #[inline(always)]
    pub fn within_reach(&self, tool: &Vector3<f64>) -> f64x2 {
        let most = both(FARTHEST * self.size);
        let plane = f64x2::new([tool.x, tool.y]).abs().simd_le(most);
        plane & both(tool.z).abs().simd_le(most)
    }

    /// The reference point in base, legs and table together, for a pose with rotation `r`:
    /// t − o + R (o + reference). The tool o changes nothing while R = 1.
    #[inline(always)]
    pub fn point(
        &self,
        position: &Vector3<f64>,
        r: &Matrix3<f64>,
        tool: &Vector3<f64>,
    ) -> Vector3<f64> {
        position - tool + r * (tool + self.reference)
    }

    /// The part of a point, or of a velocity, that the legs take.
    #[inline(always)]
    pub fn of_legs(&self, mut v: Vector3<f64>) -> Vector3<f64> {
        for k in 0..3 {
            if !self.active[k] {
                v[k] = 0.0;
            }
        }
        v
    }

    /// Legs between `anchors` (moving base anchors) and the platform at a place.
    #[inline(always)]
    pub fn placed(&self, anchors: &Lanes3<N>, place: &Place) -> Placed<N> {
        let mut placed = Placed::ZERO;
        self.place(anchors, place, &mut placed);
        placed
    }

    /// The same in a place that exists. One loop over all of it keeps values in registers.
    #[inline(always)]
    pub fn place(&self, anchors: &Lanes3<N>, place: &Place, placed: &mut Placed<N>) {
        for i in (0..N).step_by(2) {
            let [arm, span] = self.leg(anchors, place, i);
            placed.arms.put(i, arm);
            placed.put(i, span);
        }
    }

    /// Arms of legs i and i + 1 in base, and their way from `anchors` (moving base anchors) to
    /// the platform.
    #[inline(always)]
    pub fn leg(&self, anchors: &Lanes3<N>, place: &Place, i: usize) -> [[f64x2; 3]; 2] {
        let arm = times(&place.rotation, &self.arms.pair(i));
        let (c, [x, y, z]) = (wide(&place.centre), anchors.pair(i));
        [arm, [arm[0] + c[0] - x, arm[1] + c[1] - y, arm[2] + c[2] - z]]
    }

    /// Shortest length at which a leg has a direction.
    #[inline(always)]
    pub fn least_length(&self) -> f64 {
        MIN_LENGTH * self.size
    }

    /// Refuses a leg without a direction.
    #[inline]
    pub fn refuse_short(&self, i: usize, length: f64) -> Result<(), Fault> {
        if length > self.least_length() {
            return Ok(());
        }
        Err(Fault::of_leg(Cause::StrutTooShort, i, length))
    }

    /// Refuses legs without a direction.
    #[inline(always)]
    pub fn refuse_short_legs(&self, length: &[f64; N]) -> Result<(), Fault> {
        if are_above(length, self.least_length()) {
            return Ok(());
        }
        self.short_leg(*length)
    }

    #[cold]
    fn short_leg(&self, length: [f64; N]) -> Result<(), Fault> {
        for (i, l) in length.iter().enumerate() {
            self.refuse_short(i, *l)?;
        }
        Ok(())
    }

    /// Twist of every leg, if any leg has a lead.
    #[inline]
    pub fn twist(&self, n: &Lanes3<N>, r: &Matrix3<f64>) -> Result<Option<Twist<N>>, Fault> {
        let Some(nut) = &self.nut else { return Ok(None) };
        let twist = nut.twist(n, r);
        nut.refuse_along_axis(&twist)?;
        Ok(Some(twist))
    }

    /// Rows of the length constraints at a place of the platform: one column per lane
    /// array, linear part first, about the reference point; the last three per radian.
    #[inline(always)]
    pub fn rows(&self, placed: &Placed<N>, twist: Option<&Twist<N>>) -> [[f64; N]; 6] {
        let mut columns = [[0.0; N]; 6];
        for i in (0..N).step_by(2) {
            let curved = placed.curved(i);
            let mut force = scaled(&placed.span.pair(i), curved);
            let mut moment = [both(0.0); 3];
            if let (Some(nut), Some(twist)) = (&self.nut, twist) {
                let rates = nut.rates(twist, i, &force, curved);
                force = sum(&force, &rates.along);
                moment = rates.moment;
            }
            moment = sum(&moment, &cross(&placed.arms.pair(i), &force));
            for (column, values) in columns.iter_mut().zip(force.into_iter().chain(moment)) {
                put(column, i, values);
            }
        }
        columns
    }

    /// The rows in the chart at a place, see [`Self::to_chart`].
    #[inline(always)]
    pub fn charted_rows(
        &self,
        placed: &Placed<N>,
        twist: Option<&Twist<N>>,
        place: &Place,
    ) -> [[f64; N]; 6] {
        let mut columns = self.rows(placed, twist);
        self.to_chart(&mut columns, place);
        columns
    }

    /// Columns of the chart from those of the twist: active coordinates only, angular ones
    /// per unit of radius·angle; the lanes beyond the last leg are 0.
    #[inline(always)]
    pub fn to_chart(&self, columns: &mut [[f64; N]; 6], place: &Place) {
        if self.chart == Chart::Angles {
            self.of_angles(columns, place);
        }
        let inverse = both(self.per_radius);
        for column in &mut columns[3..] {
            for i in (0..N).step_by(2) {
                put(column, i, pair(column, i) * inverse);
            }
        }
        if self.active == [true; 6] && self.count() == N {
            return;
        }
        for (column, active) in columns.iter_mut().zip(self.active) {
            if !active {
                *column = [0.0; N];
            }
            for value in column.iter_mut().skip(self.count()) {
                *value = 0.0;
            }
        }
    }

    /// Angular columns per rate of A, B, C instead of ω.
    fn of_angles(&self, columns: &mut [[f64; N]; 6], place: &Place) {
        let map = Pose { position: place.centre, angles: place.angles }.trigonometry().rate_map();
        let of_twist = *columns;
        for k in 0..3 {
            for i in 0..N {
                columns[k + 3][i] = of_twist[3][i] * map[(0, k)]
                    + of_twist[4][i] * map[(1, k)]
                    + of_twist[5][i] * map[(2, k)];
            }
        }
    }
}
