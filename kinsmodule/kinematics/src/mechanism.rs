// SPDX-License-Identifier: GPL-2.0-or-later
//! The checked machine in its lanes.
//!
//! Legs are stored in lanes; their number is rounded up to 4, 6 or 8, so
//! that loops over them have a fixed length. Lanes beyond the last leg are copies of the
//! first one, so that they are safe to compute with; their contribution is
//! discarded (rows and residuals of 0).

use crate::coupling::Couplings;
use crate::fault::{Cause, Fault, MachinePart};
use crate::geometry::FARTHEST;
use crate::lanes::{Lanes3, are_above, both, cross, pair, put, scaled, sum, times, wide};
use crate::layout::Layout;
use crate::leg::Leg;
use crate::letters::Letter;
use crate::nut::{Nut, Torsion};
use crate::placed::{Place, Placed};
use crate::pose::Pose;
use crate::rings::Rings;
use nalgebra::{Matrix3, Vector3};
use wide::f64x2;

/// Shortest leg length that still defines a direction, as a share of the size.
const MIN_LENGTH: f64 = 1e-6;

/// Chart of the platform's orientation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Chart {
    /// A, B and C are active: rotation vectors about the present orientation.
    Group,
    /// One or two of them are active: the angles themselves.
    Angles,
    /// None of them is active: the platform stays level.
    Level,
}

/// A machine of up to N legs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mechanism<const N: usize> {
    pub layout: Layout,
    pub chart: Chart,
    /// Per coordinate X … C, whether the legs move it.
    pub active: [bool; 6],
    /// Whether any coordinate is moved neither by the legs nor by a table.
    pub holds: bool,
    /// Whether any leg is not a strut: its base anchor moves, its length is nonlinear, or its platform
    /// anchor slides.
    pub moving: bool,
    pub legs: [Leg; N],
    /// Base anchors in base.
    pub base: Lanes3<N>,
    /// Platform anchors, or the centers of their rings, about the reference point.
    pub arms: Lanes3<N>,
    /// Reference point of all solvers, in the platform frame: the centroid of the
    /// platform anchors, so that a long tool does not weaken the certificate; with a held
    /// or table X, Y, Z the point to which these refer.
    pub reference: Vector3<f64>,
    /// Joint = native value + correction − offset.
    pub offset: [f64; N],
    pub nut: Option<Nut<N>>,
    /// Radii of the rings on which platform anchors slide; 0 for a point.
    pub ring: [f64; N],
    /// Whether any of them slides.
    pub slides: bool,
    /// Largest length of the geometry, see [`Machine::size`].
    pub size: f64,
    /// Root mean square distance of the platform anchors from their centroid.
    pub radius: f64,
    /// 1 over the radius.
    pub per_radius: f64,
    /// Per leg √(1 + (|arm|/radius)²), 1 without rotation: bound of
    /// the platform anchor's speed; for a ring, of its farthest point's.
    pub s1: [f64; N],
    /// Per leg |arm|/radius², (1 + √2)/2 times that with two active angles: bound of the platform
    /// anchor's second derivative.
    pub s2: [f64; N],
    /// 1 for a lane that is a leg or a constraint, 0 for one that repeats the first.
    pub present: [f64; N],
    /// Constraints, in the lanes after those of the legs.
    pub couplings: Option<Couplings>,
}

impl<const N: usize> Mechanism<N> {
    /// Returns the number of legs; the compiler knows its bound.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.layout.legs().min(N)
    }

    /// Returns the constraints. With them there are six equations: the compiler knows that other machines have none.
    #[inline(always)]
    pub fn couplings(&self) -> Option<&Couplings> {
        if N == 6 { self.couplings.as_ref() } else { None }
    }

    /// Returns the number of equations: legs and constraints.
    #[inline(always)]
    pub fn equations(&self) -> usize {
        let constraints = self.couplings().map_or(0, Couplings::count);
        (self.layout.legs() + constraints).min(N)
    }

    /// Returns the rings if any platform anchor slides.
    #[inline(always)]
    pub fn rings(&self) -> Option<Rings<'_, N>> {
        if !self.slides {
            return None;
        }
        let per_radius = if self.chart == Chart::Level { 0.0 } else { self.per_radius };
        Some(Rings { radius: &self.ring, centre: &self.arms, per_radius })
    }

    /// Sets the held coordinates of a pose to 0; `strict` refuses other values.
    pub fn held(&self, pose: &Pose, strict: bool) -> Result<Pose, Fault> {
        let given = pose.to_degrees();
        let mut held = *pose;
        for letter in Letter::ALL {
            if !self.layout.is_held(letter) {
                continue;
            }
            let k = letter.index();
            if strict {
                letter
                    .check_held(given[k], self.size)
                    .map_err(|fault| self.named(fault, letter))?;
            }
            if letter.is_angle() {
                held.angles[k - 3] = 0.0;
            } else {
                held.position[k] = 0.0;
            }
        }
        Ok(held)
    }

    /// Replaces the refusal of a held coordinate if it depends on others.
    fn named(&self, fault: Fault, letter: Letter) -> Fault {
        if !self.layout.is_dependent(letter) {
            return fault;
        }
        let letters = self.layout.coordinates().as_slice();
        let commanded = letters.iter().fold(0, |bits, letter| bits | 1 << letter.index());
        let part = Some(MachinePart::Dependent(letter, commanded));
        Fault { cause: Cause::DependentGiven, part, value: fault.value }
    }

    /// Refuses an unusable tool vector.
    #[inline(always)]
    pub fn check_tool(&self, tool: &Vector3<f64>) -> Result<(), Fault> {
        if tool.iter().all(|value| value.abs() <= FARTHEST * self.size) {
            return Ok(());
        }
        match tool.iter().all(|value| value.is_finite()) {
            true => Err(Fault::with_value(Cause::ToolTooLong, tool.amax())),
            false => Err(Cause::ToolNotFinite.into()),
        }
    }

    /// Computes the reference point in base, as moved by legs and table together, for a pose with rotation `r`:
    /// t − o + R (o + reference). The tool o has no effect while R = 1.
    #[inline(always)]
    pub fn point(
        &self,
        position: &Vector3<f64>,
        r: &Matrix3<f64>,
        tool: &Vector3<f64>,
    ) -> Vector3<f64> {
        position - tool + r * (tool + self.reference)
    }

    /// Returns the part of a point, or of a velocity, that the legs move.
    #[inline(always)]
    pub fn of_legs(&self, mut v: Vector3<f64>) -> Vector3<f64> {
        for k in 0..3 {
            if !self.active[k] {
                v[k] = 0.0;
            }
        }
        v
    }

    /// Computes the legs between `anchors` (moving base anchors) and the platform at a pose.
    #[inline(always)]
    pub fn placed(&self, anchors: &Lanes3<N>, place: &Place) -> Placed<N> {
        let mut placed = Placed::ZERO;
        self.place(anchors, place, &mut placed);
        placed
    }

    /// Computes the legs into `placed`. One loop over everything: registers, see `lanes`.
    #[inline(always)]
    pub fn place(&self, anchors: &Lanes3<N>, place: &Place, placed: &mut Placed<N>) {
        for i in (0..N).step_by(2) {
            let [arm, span] = self.leg(anchors, place, i);
            placed.arms.put(i, arm);
            placed.put(i, span);
        }
        if let Some(rings) = self.rings() {
            rings.turn(&place.rotation, placed);
        }
        if let Some(couplings) = self.couplings() {
            couplings.write_lengths(place, &mut placed.length);
        }
    }

    /// Computes the arms of legs i and i + 1 in base, and the vectors from `anchors` (moving base anchors) to
    /// the platform, or to the centers of their rings.
    #[inline(always)]
    pub fn leg(&self, anchors: &Lanes3<N>, place: &Place, i: usize) -> [[f64x2; 3]; 2] {
        let arm = times(&place.rotation, &self.arms.pair(i));
        let (c, [x, y, z]) = (wide(&place.centre), anchors.pair(i));
        [arm, [arm[0] + c[0] - x, arm[1] + c[1] - y, arm[2] + c[2] - z]]
    }

    /// Returns the shortest length at which a leg has a direction.
    #[inline(always)]
    pub fn least_length(&self) -> f64 {
        MIN_LENGTH * self.size
    }

    /// Refuses a leg without a direction.
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

    fn short_leg(&self, length: [f64; N]) -> Result<(), Fault> {
        for (i, l) in length.iter().enumerate() {
            self.refuse_short(i, *l)?;
        }
        Ok(())
    }

    /// Computes the torsion of every leg, if any leg has a lead.
    pub fn torsion(&self, n: &Lanes3<N>, r: &Matrix3<f64>) -> Result<Option<Torsion<N>>, Fault> {
        let Some(nut) = &self.nut else { return Ok(None) };
        let torsion = nut.torsion(n, r);
        nut.refuse_along_axis(&torsion)?;
        Ok(Some(torsion))
    }

    /// Computes the rows of the length constraints at a pose of the platform: one column per lane
    /// array, linear part first, about the reference point; the last three per radian.
    #[inline(always)]
    pub fn rows(&self, placed: &Placed<N>, torsion: Option<&Torsion<N>>) -> [[f64; N]; 6] {
        let mut columns = [[0.0; N]; 6];
        for i in (0..N).step_by(2) {
            let curved = placed.curved(i);
            let mut force = scaled(&placed.span.pair(i), curved);
            let mut moment = [both(0.0); 3];
            if let (Some(nut), Some(torsion)) = (&self.nut, torsion) {
                let rates = nut.rates(torsion, i, &force, curved);
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

    /// Computes the rows in the chart at a pose, see [`Self::to_chart`].
    #[inline(always)]
    pub fn charted_rows(
        &self,
        placed: &Placed<N>,
        torsion: Option<&Torsion<N>>,
        place: &Place,
    ) -> [[f64; N]; 6] {
        let mut columns = self.rows(placed, torsion);
        if let Some(couplings) = self.couplings() {
            couplings.write_rows(place, &mut columns);
        }
        self.to_chart(&mut columns, place);
        columns
    }

    /// Converts columns of the twist to columns of the chart: active coordinates only, angular ones
    /// per unit of radius·angle; the lanes beyond the last equation are 0.
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
        let equations = self.equations();
        if self.active == [true; 6] && equations == N {
            return;
        }
        for (column, active) in columns.iter_mut().zip(self.active) {
            if !active {
                *column = [0.0; N];
            }
            for value in column.iter_mut().skip(equations) {
                *value = 0.0;
            }
        }
    }

    /// Converts angular columns from ω to rates of A, B, C.
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
