// SPDX-License-Identifier: GPL-2.0-or-later
//! Constraints of the platform, checked: equations beside those of the legs, and the coordinates that they determine.
//!
//! Each constraint is bilinear in the orientation R and the position P of the reference point, so that its derivatives
//! have simple bounds. Forward treats a constraint like a strut whose joint value never changes: the lanes after those
//! of the legs have the machine's size as their length, plus the value of the constraint, which is 0 at a solution.
//!
//! **Dependent coordinates.** For given commanded coordinates x the constraints F(x, y) = 0 determine the dependent
//! ones, y. The machine is assembled at home; the correct y is the end of the unique continuous path of solutions from
//! home along the straight line in x, with the tool mounted. It is followed in balls: with M the inverse of F_y at the
//! center (x₀, y₀) of a ball of radius ρ, and η a bound of |M F(x, y₀)| along the part of the line from x₀, a bound
//! λ ≤ 1/2 of ‖1 − M F_y‖ over ball and part and ρ = 2η make y ↦ y − M F(x, y) a contraction of the ball into itself
//! for every x of the part. It then contains one solution for each of them, which depends continuously on x. The center
//! of the next ball is so near to its own solution that this is in both. No state is kept between calls: the answer
//! depends on the pose and the tool alone.
//!
//! **Bounds** in the norm ‖(translation, r · angle)‖, r the platform radius: see [`Couplings::bend`].

use crate::constraint::ConstraintGeometry;
use crate::fault::{Cause, Fault, MachinePart};
use crate::geometry::{FARTHEST, Geometry};
use crate::lanes::{Lanes3, inner};
use crate::layout::Layout;
use crate::leg::direction;
use crate::letters::Letter;
use crate::placed::{Place, Placed};
use crate::pose::{Pose, angles_near, cayley_change};
use crate::pseudo_inverse::PseudoInverse;
use core::f64::consts::SQRT_2;
use libm::{hypot, sqrt};
use nalgebra::{Matrix3, Vector3};

/// Largest number of independent constraints: at least one leg moves the platform.
const MOST: usize = 5;

/// Largest ‖1 − M F_y‖ in a ball.
const CONTRACTION: f64 = 0.5;

/// ‖1 − M F_y‖ for which the next part of the line is chosen: the bound grows from one ball to the next.
const AIM: f64 = 0.45;

/// Largest number of balls that are tried.
const MOST_TRIALS: u32 = 96;

/// Shortest part of the line, as a share of it.
const SHORTEST: f64 = 1e-4;

/// A solution is too near to a constraint singularity if its ball is smaller than twice this share of the size.
const LEAST_BALL: f64 = 1e-6;

/// Largest number of corrections at the end of the line.
const MOST_CORRECTIONS: u32 = 12;

/// Error of the dependent coordinates at which corrections stop, as a share of the size.
const TOLERANCE: f64 = 1e-14;

/// Rounding of a step, as a share of the size: every ball has room for it.
const ROUNDING: f64 = 1e-12;

/// A constraint whose gradient is farther from those of the others than this share of its length is independent at the
/// pose [TRAJ]HOME, whose dependent coordinates are still 0; at the home of the machine.
const INDEPENDENT: [f64; 2] = [1e-2, 1e-7];

/// Largest value of a redundant constraint that agrees with the others, as a share of the size.
const AGREES: f64 = 1e-9;

/// Displacements at which redundant constraints are compared with the others, as a share of the radius.
const COMPARED: f64 = 0.05;

/// A pivot below this share of the largest one counts as 0.
const NO_PIVOT: f64 = 1e-9;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// n · (P + R b − c).
    InPlane,
    /// (R m) · (c − P) − m · b.
    Through,
    /// (R m) · e.
    Square,
}

/// One constraint, its points about the reference point.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Coupling {
    kind: Kind,
    /// b of a point in a plane; the unit vector m of the other kinds; in the platform frame.
    arm: Vector3<f64>,
    /// c; of a square the unit vector e.
    base: Vector3<f64>,
    /// Unit vector n of a point in a plane.
    normal: Vector3<f64>,
    /// m · b of a plane through a point.
    offset: f64,
    /// Factor that makes the equation a length, and its gradient comparable with those of legs.
    scale: f64,
}

/// Value and gradient of a constraint.
struct Row {
    value: f64,
    /// Per velocity of the reference point.
    force: Vector3<f64>,
    /// Per angular velocity, about the reference point.
    moment: Vector3<f64>,
}

/// The constraints of a machine.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Couplings {
    all: [Coupling; MOST],
    count: usize,
    /// Lane of the first one.
    first: usize,
    /// Per coordinate X … C, whether they determine it.
    dependent: [bool; 6],
    /// Whether A, B and C are dependent: then rotation vectors about the present orientation are the chart, otherwise the
    /// angles themselves.
    turns_freely: bool,
    turning: Turning,
    /// Home of the platform, with the dependent coordinates that the constraints determine there.
    home: Place,
    reference: Vector3<f64>,
    radius: f64,
    size: f64,
}

/// Bounds of the derivatives of R by the angles, for unit rates of the dependent (y) and the commanded (x) ones.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Turning {
    y: f64,
    x: f64,
    yy: f64,
    xy: f64,
    xx: f64,
}

/// Bounds of the second derivatives of a constraint: of its gradient by y per change of y, per commanded rotation and
/// per commanded translation; of its value along a commanded motion, for the square of the rotation and for the product
/// of both.
struct Bend {
    yy: f64,
    xr: f64,
    xt: f64,
    rr: f64,
    rt: f64,
}

/// The platform while the dependent coordinates are sought.
#[derive(Clone, Copy)]
struct Spot {
    rotation: Matrix3<f64>,
    angles: Vector3<f64>,
    /// Position of the reference point; only the dependent coordinates are used.
    free: Vector3<f64>,
}

/// Commanded coordinates: position of the control point less the tool, and the vector from there to the reference point
/// in the platform frame.
struct Commanded {
    position: Vector3<f64>,
    lever: Vector3<f64>,
}

/// A spot with the inverse of the derivatives there.
struct Center {
    spot: Spot,
    values: [f64; 6],
    inverse: PseudoInverse<6>,
    /// Length of Newton's step from there.
    off: f64,
}

/// The platform for commanded coordinates.
pub(crate) struct Settled {
    /// Its angles are current only if some of A, B and C are commanded.
    pub place: Place,
    /// Difference of the commanded position and the platform's: what a table compensates; otherwise 0 in commanded
    /// coordinates and without meaning in others.
    pub table: Vector3<f64>,
}

impl Coupling {
    const NONE: Self = Self {
        kind: Kind::Square,
        arm: Vector3::new(0.0, 0.0, 0.0),
        base: Vector3::new(0.0, 0.0, 0.0),
        normal: Vector3::new(0.0, 0.0, 0.0),
        offset: 0.0,
        scale: 0.0,
    };

    /// Checks constraint `i` as given.
    fn new(
        given: &ConstraintGeometry,
        i: usize,
        (reference, radius, size): (&Vector3<f64>, f64, f64),
    ) -> Result<Self, Fault> {
        let refuse =
            |cause, value| Fault { cause, part: Some(MachinePart::Constraint(i as u8)), value };
        let (points, directions) = given.vectors();
        let mut values = points.iter().chain(&directions).flatten();
        if !values.all(|value| value.is_finite()) {
            return Err(refuse(Cause::ConstraintNotFinite, 0.0));
        }
        let farthest = points.iter().flatten().fold(0.0, |most: f64, value| most.max(value.abs()));
        if !(farthest <= FARTHEST * size) {
            return Err(refuse(Cause::ConstraintTooFar, farthest));
        }
        let unit =
            |given: &[f64; 3]| direction(given).ok_or(refuse(Cause::ConstraintAxisZero, 0.0));
        let about = |given: &[f64; 3]| Vector3::from(*given) - reference;
        Ok(match given {
            ConstraintGeometry::PointInPlane { platform, base, normal } => Self {
                kind: Kind::InPlane,
                arm: about(platform),
                base: Vector3::from(*base),
                normal: unit(normal)?,
                scale: 1.0,
                ..Self::NONE
            },
            ConstraintGeometry::PlaneThroughPoint { platform, normal, base } => Self {
                kind: Kind::Through,
                arm: unit(normal)?,
                base: Vector3::from(*base),
                offset: unit(normal)?.dot(&about(platform)),
                scale: 1.0,
                ..Self::NONE
            },
            ConstraintGeometry::Square { platform_axis, base_axis } => Self {
                kind: Kind::Square,
                arm: unit(platform_axis)?,
                base: unit(base_axis)?,
                scale: radius,
                ..Self::NONE
            },
        })
    }

    /// Computes value and gradient at a pose of the platform.
    #[inline(always)]
    fn row(&self, rotation: &Matrix3<f64>, point: &Vector3<f64>) -> Row {
        let arm = rotation * self.arm;
        match self.kind {
            Kind::InPlane => Row {
                value: self.normal.dot(&(point + arm - self.base)),
                force: self.normal,
                moment: arm.cross(&self.normal),
            },
            Kind::Through => {
                let (arm, to) = (arm * self.scale, self.base - point);
                Row {
                    value: arm.dot(&to) - self.scale * self.offset,
                    force: -arm,
                    moment: arm.cross(&to),
                }
            }
            Kind::Square => {
                let arm = arm * self.scale;
                Row {
                    value: arm.dot(&self.base),
                    force: Vector3::zeros(),
                    moment: arm.cross(&self.base),
                }
            }
        }
    }

    /// Computes the second derivative of the value while the platform moves at `v` and rotates at `omega`.
    fn acceleration(&self, place: &Place, [v, omega]: [&Vector3<f64>; 2]) -> f64 {
        let arm = place.rotation * self.arm * self.scale;
        let turned = omega.cross(&arm);
        let twice = omega.cross(&turned);
        match self.kind {
            Kind::InPlane => self.normal.dot(&twice),
            Kind::Through => twice.dot(&(self.base - place.centre)) - 2.0 * turned.dot(v),
            Kind::Square => twice.dot(&self.base),
        }
    }
}

impl Turning {
    /// Returns the bounds for the dependent angles: ∂R by a unit rate of angles rotates at most at √2, at 1 about one
    /// axis or two perpendicular ones, such as those of A and B or of B and C; each of the derivatives by two angles is
    /// at most 1.
    fn of([a, b, c]: [bool; 3]) -> Self {
        let two = (1.0 + SQRT_2) / 2.0;
        match [a, b, c].iter().filter(|dependent| **dependent).count() {
            3 => Self { y: 1.0, x: 0.0, yy: 1.0, xy: 0.0, xx: 0.0 },
            2 => Self { y: SQRT_2, x: 1.0, yy: 2.0, xy: SQRT_2, xx: 1.0 },
            1 if b => Self { y: 1.0, x: SQRT_2, yy: 1.0, xy: SQRT_2, xx: 2.0 },
            1 => Self { y: 1.0, x: 1.0, yy: 1.0, xy: 1.0, xx: two },
            _ => Self { y: 0.0, x: SQRT_2, yy: 0.0, xy: SQRT_2, xx: 3.0 },
        }
    }
}

impl Couplings {
    /// Checks the constraints of a geometry, which must have a reference pose; `None` if there are none.
    pub fn new(
        geometry: &Geometry,
        sizes: (&Vector3<f64>, f64, f64),
    ) -> Result<Option<Self>, Fault> {
        let layout = geometry.layout();
        if layout.constraints() == 0 {
            return Ok(None);
        }
        let mut home = Pose::from_degrees(geometry.home.ok_or(Cause::ConstraintsNeedHome)?);
        home.check().map_err(|_| Fault::from(Cause::HomeNotFinite))?;
        let (reference, radius, size) = sizes;
        for letter in Letter::ALL.into_iter().filter(|letter| layout.is_dependent(*letter)) {
            let value = match letter.index() {
                k @ 0..3 => &mut home.position[k],
                k => &mut home.angles[k.min(5) - 3],
            };
            if layout.is_held(letter) && letter.check_held(*value, size).is_err() {
                return Err(Fault::with_value(Cause::HomeHeld, *value));
            }
            // What a table compensates is no motion of the platform.
            *value = 0.0;
        }
        let mut given = [Coupling::NONE; crate::constraint::MAX_CONSTRAINTS];
        for (i, (place, constraint)) in given.iter_mut().zip(geometry.constraints()).enumerate() {
            *place = Coupling::new(constraint, i, sizes)?;
        }
        let given = given.get_mut(..layout.constraints()).unwrap_or_default();
        let rotation = home.rotation();
        let start =
            Place { rotation, centre: home.position + rotation * reference, angles: home.angles };
        for coupling in given.iter_mut().filter(|coupling| coupling.kind == Kind::Through) {
            // The length of its gradient is then 1.
            coupling.scale = 1.0 / hypot(1.0, (coupling.base - start.centre).norm() / radius);
        }
        let dependent = Letter::ALL.map(|letter| layout.is_dependent(letter));
        let [.., a, b, c] = dependent;
        let mut couplings = Self {
            all: [Coupling::NONE; MOST],
            count: 0,
            first: layout.legs(),
            dependent,
            turns_freely: a && b && c,
            turning: Turning::of([a, b, c]),
            home: start,
            reference: *reference,
            radius,
            size,
        };
        let mut dropped = [false; crate::constraint::MAX_CONSTRAINTS];
        for share in INDEPENDENT {
            couplings.choose(given, &mut dropped, share, layout)?;
            couplings.refuse_undetermined(layout)?;
            couplings.home = start;
            let settled = couplings
                .settle(&home, &Vector3::zeros())
                .map_err(|_| Fault::with_value(Cause::HomeOffConstraints, couplings.off(&start)))?;
            couplings.home = couplings.with_angles(settled.place);
        }
        couplings.refuse_contradicting(given, &dropped, &home)?;
        Ok(Some(couplings))
    }

    /// Returns the largest value of the constraints at a pose of the platform.
    fn off(&self, place: &Place) -> f64 {
        let values = self.used().iter().map(|c| c.row(&place.rotation, &place.centre).value.abs());
        values.fold(0.0, f64::max)
    }

    fn used(&self) -> &[Coupling] {
        self.all.get(..self.count).unwrap_or(&self.all)
    }

    /// Chooses independent constraints at home, in their order; marks the others.
    fn choose(
        &mut self,
        given: &[Coupling],
        dropped: &mut [bool],
        share: f64,
        layout: &Layout,
    ) -> Result<(), Fault> {
        let wanted = 6 - layout.legs().min(6);
        let mut basis = [[0.0; 6]; 6];
        (self.count, self.all) = (0, [Coupling::NONE; MOST]);
        for (i, coupling) in given.iter().enumerate() {
            let Row { force, moment, .. } = coupling.row(&self.home.rotation, &self.home.centre);
            let moment = moment / self.radius;
            let mut row = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
            let length = sqrt(inner(&row, &row));
            for other in basis.iter().take(self.count) {
                let along = inner(&row, other);
                row.iter_mut().zip(other).for_each(|(value, other)| *value -= along * other);
            }
            let rest = sqrt(inner(&row, &row));
            let is_dropped = !(rest > share * length);
            if let Some(mark) = dropped.get_mut(i) {
                *mark = is_dropped;
            }
            if is_dropped {
                continue;
            }
            let (Some(place), Some(row_place)) =
                (self.all.get_mut(self.count), basis.get_mut(self.count))
            else {
                return Err(too_many(i, layout));
            };
            *place = *coupling;
            *row_place = row.map(|value| value / rest);
            self.count += 1;
            if self.count > wanted {
                return Err(too_many(i, layout));
            }
        }
        if self.count == wanted {
            return Ok(());
        }
        let free = (wanted - self.count) as f64;
        let redundant = dropped.iter().position(|dropped| *dropped);
        let part = match redundant {
            Some(i) => Some(MachinePart::Constraint(i as u8)),
            None => self.free_letter().map(MachinePart::Coordinate),
        };
        let cause =
            if redundant.is_some() { Cause::ConstraintRedundant } else { Cause::ConstraintsFree };
        Err(Fault { cause, part, value: free })
    }

    /// Computes the derivatives of the constraints by the coordinates, one row each, angles times the radius.
    fn rows_by_letter(&self, place: &Place) -> [[f64; 6]; MOST] {
        let pose = Pose { position: place.centre, angles: place.angles };
        let map = pose.rate_map() / self.radius;
        let mut rows = [[0.0; 6]; MOST];
        let lever = place.rotation * self.reference;
        for (row, coupling) in rows.iter_mut().zip(self.used()) {
            let Row { force, moment, .. } = coupling.row(&place.rotation, &place.centre);
            // While the control point stays.
            let turned = map.tr_mul(&(moment + lever.cross(&force)));
            *row = [force.x, force.y, force.z, turned.x, turned.y, turned.z];
        }
        rows
    }

    /// Eliminates dependent coordinates with the largest pivots; returns the rows left, which of them had no pivot, and
    /// which coordinates are determined.
    fn eliminated(&self) -> ([[f64; 6]; MOST], [bool; MOST], [bool; 6]) {
        let mut rows = self.rows_by_letter(&self.home);
        let (mut open, mut done) = ([false; MOST], [false; 6]);
        open.iter_mut().take(self.count).for_each(|open| *open = true);
        let mut most = 0.0_f64;
        for _ in 0..self.count {
            let mut best = (0.0, 0, 0);
            for i in (0..MOST).filter(|i| open[*i]) {
                for k in (0..6).filter(|k| self.dependent[*k] && !done[*k]) {
                    if rows[i][k].abs() > best.0 {
                        best = (rows[i][k].abs(), i, k);
                    }
                }
            }
            let (size, i, k) = best;
            most = most.max(size);
            if !(size > NO_PIVOT * most) {
                break;
            }
            let (i, k) = (i.min(MOST - 1), k.min(5));
            (open[i], done[k]) = (false, true);
            let pivot = rows[i];
            for (row, _) in rows.iter_mut().zip(open).filter(|(_, open)| *open) {
                let share = row[k] / pivot[k];
                row.iter_mut().zip(&pivot).for_each(|(value, pivot)| *value -= share * pivot);
            }
        }
        (rows, open, done)
    }

    /// Returns a dependent coordinate that no constraint determines.
    fn free_letter(&self) -> Option<Letter> {
        let (_, _, done) = self.eliminated();
        Letter::ALL.into_iter().find(|l| self.dependent[l.index()] && !done[l.index()])
    }

    /// Refuses constraints that do not determine the dependent coordinates at home, naming a commanded coordinate that
    /// they fix instead.
    fn refuse_undetermined(&self, layout: &Layout) -> Result<(), Fault> {
        let (rows, open, _) = self.eliminated();
        let Some(row) = rows.iter().zip(open).find_map(|(row, open)| open.then_some(row)) else {
            return Ok(());
        };
        let mut fixed = (0.0, None);
        for letter in layout.coordinates().as_slice() {
            let value = row.get(letter.index()).map_or(0.0, |value| value.abs());
            if value > fixed.0 {
                fixed = (value, Some(MachinePart::Coordinate(*letter)));
            }
        }
        Err(Fault { cause: Cause::ConstraintsFix, part: fixed.1, value: 0.0 })
    }

    /// Refuses a redundant constraint that contradicts the others at home or near it.
    fn refuse_contradicting(
        &self,
        given: &[Coupling],
        dropped: &[bool],
        home: &Pose,
    ) -> Result<(), Fault> {
        let mut others = given.iter().zip(dropped).enumerate().filter(|(_, (_, drop))| **drop);
        others.try_for_each(|(i, (coupling, _))| {
            let check = |place: &Place| {
                let value = coupling.row(&place.rotation, &place.centre).value;
                if value.abs() <= AGREES * self.size {
                    return Ok(());
                }
                let part = Some(MachinePart::Constraint(i as u8));
                Err(Fault { cause: Cause::ConstraintContradicts, part, value })
            };
            check(&self.home)?;
            for k in 0..6 {
                for by in [-COMPARED, COMPARED] {
                    let mut pose = *home;
                    match k {
                        0..3 => pose.position[k] += by * self.radius,
                        _ => pose.angles[k - 3] += by,
                    }
                    if self.dependent[k] {
                        continue;
                    }
                    if let Ok(settled) = self.settle(&pose, &Vector3::zeros()) {
                        check(&settled.place)?;
                    }
                }
            }
            Ok(())
        })
    }

    /// Returns the number of constraints that have lanes.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Returns a point of base for the lane of each constraint, whose distance from the reference point the
    /// certificate needs.
    pub fn write_anchors<const N: usize>(&self, base: &mut Lanes3<N>, arms: &mut Lanes3<N>) {
        for (lane, coupling) in self.lanes::<N>() {
            let is_point = coupling.kind == Kind::Through;
            base.set(lane, if is_point { coupling.base } else { Vector3::zeros() });
            arms.set(lane, Vector3::zeros());
        }
    }

    #[inline(always)]
    fn lanes<const N: usize>(&self) -> impl Iterator<Item = (usize, &Coupling)> {
        let first = self.first;
        self.used().iter().enumerate().map(move |(i, one)| ((first + i).min(N - 1), one))
    }

    /// Writes the lengths of the constraints' lanes at a pose of the platform.
    pub fn write_lengths<const N: usize>(&self, place: &Place, length: &mut [f64; N]) {
        for (lane, coupling) in self.lanes::<N>() {
            length[lane] = self.size + coupling.row(&place.rotation, &place.centre).value;
        }
    }

    /// Writes the rows of the constraints at a pose of the platform, see [`crate::mechanism::Mechanism::rows`].
    pub fn write_rows<const N: usize>(&self, place: &Place, columns: &mut [[f64; N]; 6]) {
        for (lane, coupling) in self.lanes::<N>() {
            let Row { force, moment, .. } = coupling.row(&place.rotation, &place.centre);
            for (column, value) in columns.iter_mut().zip(force.iter().chain(moment.iter())) {
                column[lane] = *value;
            }
        }
    }

    /// Writes the rates of the constraints' lengths while the platform moves at `v` and rotates at `omega`.
    pub fn write_rates<const N: usize>(
        &self,
        place: &Place,
        [v, omega]: [&Vector3<f64>; 2],
        rates: &mut [f64; N],
    ) {
        for (lane, coupling) in self.lanes::<N>() {
            let Row { force, moment, .. } = coupling.row(&place.rotation, &place.centre);
            rates[lane] = force.dot(v) + moment.dot(omega);
        }
    }

    /// Writes the second derivatives of the constraints' lengths.
    pub fn write_accelerations<const N: usize>(
        &self,
        place: &Place,
        motion: [&Vector3<f64>; 2],
        accelerations: &mut [f64; N],
    ) {
        for (lane, coupling) in self.lanes::<N>() {
            accelerations[lane] = coupling.acceleration(place, motion);
        }
    }

    /// Bounds the second derivative of the constraint in `lane` within a ball of radius `rho` of poses, shifted by up to
    /// `shift`; `None` for the lane of a leg. In the chart of rotation vectors, with a point at distance d: |D²f| ≤
    /// d/r² for an arm, and for a plane through a point, whose equation has the terms d |ω|² and 2 |ω| |v|, their
    /// largest sum.
    pub fn curvature<const N: usize>(
        &self,
        placed: &Placed<N>,
        lane: usize,
        rho: f64,
        shift: f64,
    ) -> Option<f64> {
        let coupling = self.used().get(lane.checked_sub(self.first)?)?;
        let per = 1.0 / self.radius;
        Some(match coupling.kind {
            Kind::InPlane => coupling.arm.norm() * per * per,
            Kind::Through => {
                let distance = placed.span.get(lane.min(N - 1)).norm() + rho + shift;
                let half = distance * per * per / 2.0;
                coupling.scale * (half + hypot(half, per))
            }
            Kind::Square => per,
        })
    }

    /// Bounds the change of the rows by a shift of the platform, as the square of its norm.
    pub fn row_change(&self, shift: f64) -> f64 {
        let through = self.used().iter().filter(|coupling| coupling.kind == Kind::Through);
        through.map(|coupling| coupling.scale * shift / self.radius).map(|x| x * x).sum()
    }

    /// Computes the platform for commanded coordinates.
    ///
    /// # Errors
    /// [`Cause::ConstraintSingular`].
    pub fn settle(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Settled, Fault> {
        let lever = tool + self.reference;
        // Home with this tool.
        let from = self.home.centre - self.home.rotation * lever;
        let mut way = pose.position - tool - from;
        let mut turn = pose.angles - self.home.angles;
        for k in 0..3 {
            if self.dependent[k] {
                way[k] = 0.0;
            }
            if self.dependent[k + 3] {
                turn[k] = 0.0;
            }
        }
        let travel = [way.norm(), self.radius * turn.norm()];
        let at = |share: f64| Commanded { position: from + way * share, lever };
        let Place { rotation, angles, centre } = self.home;
        let start = Spot { rotation, angles, free: centre };
        let mut here = self.center(start, &at(0.0)).ok_or(Cause::ConstraintSingular)?;
        let (mut done, mut share) = (0.0, 1.0);
        for _ in 0..MOST_TRIALS {
            let rest = 1.0 - done;
            let arrives = share >= rest;
            let part = if arrives { rest } else { share };
            let to = if arrives { 1.0 } else { done + share };
            let commanded = at(to);
            let mut spot = self.turned(&here.spot, &turn, to);
            let values = self.values(&spot, &commanded);
            let step = here.inverse.solve(&values).map(|x| -x);
            let length = sqrt(inner(&step, &step));
            let ball = self.ball(&here, &at(done), length, travel.map(|travel| travel * part));
            if ball.change <= CONTRACTION {
                self.go(&mut spot, &step);
                if let Some(next) = self.center(spot, &commanded)
                    && length + 2.0 * next.off <= ball.radius
                {
                    if arrives {
                        let place = self.converge(next, &commanded)?;
                        let table = pose.position - tool + place.rotation * lever - place.centre;
                        return Ok(Settled { place, table });
                    }
                    (here, done) = (next, to);
                    share = part * (AIM / ball.change).clamp(0.5, 4.0);
                    continue;
                }
                share = part / 2.0;
            } else {
                share = part * (AIM / ball.change).clamp(0.1, 0.7);
            }
            if !(share >= SHORTEST) {
                break;
            }
        }
        Err(Fault::with_value(Cause::ConstraintSingular, done))
    }

    /// Turns the commanded angles to a share of their way.
    fn turned(&self, spot: &Spot, turn: &Vector3<f64>, share: f64) -> Spot {
        if self.turns_freely || *turn == Vector3::zeros() {
            return *spot;
        }
        let mut angles = spot.angles;
        for k in (0..3).filter(|k| !self.dependent[k + 3]) {
            angles[k] = self.home.angles[k] + turn[k] * share;
        }
        let rotation = Pose { position: Vector3::zeros(), angles }.rotation();
        Spot { rotation, angles, free: spot.free }
    }

    /// Computes the position of the reference point.
    fn point(&self, spot: &Spot, commanded: &Commanded) -> Vector3<f64> {
        let mut point = commanded.position + spot.rotation * commanded.lever;
        for k in (0..3).filter(|k| self.dependent[*k]) {
            point[k] = spot.free[k];
        }
        point
    }

    fn values(&self, spot: &Spot, commanded: &Commanded) -> [f64; 6] {
        let point = self.point(spot, commanded);
        let mut values = [0.0; 6];
        for (value, coupling) in values.iter_mut().zip(self.used()) {
            *value = coupling.row(&spot.rotation, &point).value;
        }
        values
    }

    /// Computes values and derivatives by the dependent coordinates; `None` at a constraint singularity.
    fn center(&self, spot: Spot, commanded: &Commanded) -> Option<Center> {
        let point = self.point(&spot, commanded);
        let lever = spot.rotation * commanded.lever;
        let mut columns = [[0.0; 6]; 6];
        let mut values = [0.0; 6];
        let map = match self.turns_freely {
            true => Matrix3::identity(),
            false => Pose { position: point, angles: spot.angles }.rate_map(),
        } / self.radius;
        for (i, coupling) in self.used().iter().enumerate().take(MOST) {
            let Row { value, force, moment } = coupling.row(&spot.rotation, &point);
            // A rotation moves the reference point as commanded, and not in the dependent coordinates.
            let mut moved = force;
            for k in (0..3).filter(|k| self.dependent[*k]) {
                moved[k] = 0.0;
            }
            let turned = map.tr_mul(&(moment + lever.cross(&moved)));
            values[i] = value;
            for k in 0..3 {
                columns[k][i] = if self.dependent[k] { force[k] } else { 0.0 };
                columns[k + 3][i] = if self.dependent[k + 3] { turned[k] } else { 0.0 };
            }
        }
        let inverse = PseudoInverse::new(&columns, &self.dependent)?;
        let step = inverse.solve(&values);
        Some(Center { spot, values, inverse, off: sqrt(inner(&step, &step)) })
    }

    /// Moves by a step in the dependent coordinates, angles times the radius.
    fn go(&self, spot: &mut Spot, step: &[f64; 6]) {
        let [x, y, z, a, b, c] = *step;
        let turn = Vector3::new(a, b, c) / self.radius;
        spot.free += Vector3::new(x, y, z);
        match self.turns_freely {
            true => spot.rotation += cayley_change(&turn) * spot.rotation,
            false => {
                spot.angles += turn;
                spot.rotation = Pose { position: spot.free, angles: spot.angles }.rotation();
            }
        }
    }

    /// Computes radius and ‖1 − M F_y‖ of the ball about `here` for a part of the line with this travel, at whose end
    /// Newton's step is `length`.
    fn ball(&self, here: &Center, commanded: &Commanded, length: f64, travel: [f64; 2]) -> Ball {
        let [moved, turned] = travel;
        let norm = here.inverse.inverse_norm();
        let mut deviation = 0.0;
        let reach = length.max(here.off).max(ROUNDING * self.size);
        for coupling in self.used() {
            let Bend { rr, rt, .. } = self.bend(coupling, here, commanded, reach, travel);
            let off = (rr * turned * turned + rt * turned * moved) / 8.0;
            deviation += off * off;
        }
        let radius = 2.0 * (reach + norm * sqrt(deviation));
        let mut change = 0.0;
        for coupling in self.used() {
            let Bend { yy, xr, xt, .. } = self.bend(coupling, here, commanded, radius, travel);
            let off = yy * radius + xr * turned + xt * moved;
            change += off * off;
        }
        Ball { radius, change: norm * sqrt(change) }
    }

    /// Bounds the second derivatives of a constraint for commanded motions by up to `travel` and dependent ones by up
    /// to `rho`.
    ///
    /// A point in a plane depends on R alone but for linear terms. So does a plane through a point if X, Y and Z are
    /// commanded, with c seen from the control point as its arm; otherwise P also moves with R.
    fn bend(
        &self,
        coupling: &Coupling,
        here: &Center,
        commanded: &Commanded,
        rho: f64,
        [moved, turned]: [f64; 2],
    ) -> Bend {
        let Turning { y, x, yy, xy, xx } = self.turning;
        let per = 1.0 / self.radius;
        let of_arm = |arm: f64| {
            let arm = arm * per * per;
            Bend { yy: yy * arm, xr: xy * arm, xt: 0.0, rr: xx * arm, rt: 0.0 }
        };
        let [free_x, free_y, free_z, ..] = self.dependent;
        let (is_free, lever) = (free_x || free_y || free_z, commanded.lever.norm());
        match coupling.kind {
            Kind::Square => of_arm(coupling.scale),
            Kind::InPlane if !is_free => of_arm((commanded.lever + coupling.arm).norm()),
            Kind::InPlane => {
                let mut normal = coupling.normal;
                for k in (0..3).filter(|k| self.dependent[*k]) {
                    normal[k] = 0.0;
                }
                of_arm(normal.norm() * lever + coupling.arm.norm())
            }
            Kind::Through if !is_free => {
                let distance = (coupling.base - commanded.position).norm() + moved;
                let bend = of_arm(coupling.scale * distance);
                let cross = coupling.scale * per;
                Bend { xt: y * cross, rt: 2.0 * x * cross, ..bend }
            }
            Kind::Through => {
                let speed = 1.0 + SQRT_2 * lever * per;
                let point = self.point(&here.spot, commanded);
                let distance = (coupling.base - point).norm() + speed * (rho + moved + turned);
                let all = coupling.scale
                    * (3.0 * (distance + lever) * per * per + 2.0 * SQRT_2 * speed * per);
                Bend { yy: all, xr: all, xt: all, rr: all, rt: 2.0 * all }
            }
        }
    }

    /// Corrects the last center until rounding remains; refuses a solution near a constraint singularity.
    fn converge(&self, mut at: Center, commanded: &Commanded) -> Result<Place, Fault> {
        let singular = Fault::with_value(Cause::ConstraintSingular, 1.0);
        let (most, mut moved) = (2.0 * at.off + TOLERANCE * self.size, 0.0);
        let mut before = f64::INFINITY;
        for _ in 0..MOST_CORRECTIONS {
            let step = at.inverse.solve(&at.values).map(|x| -x);
            let length = sqrt(inner(&step, &step));
            let ratio = if before < f64::INFINITY { length / before } else { 1.0 };
            self.go(&mut at.spot, &step);
            moved += length;
            if length * ratio.min(1.0) <= TOLERANCE * self.size
                || length <= 16.0 * f64::EPSILON * self.size
            {
                let surely = self.ball(&at, commanded, self.size * LEAST_BALL, [0.0; 2]);
                if !(moved <= most && surely.change < 1.0) {
                    return Err(singular);
                }
                let Spot { rotation, angles, .. } = at.spot;
                return Ok(Place { rotation, centre: self.point(&at.spot, commanded), angles });
            }
            if ratio > 0.1 && before < f64::INFINITY {
                at = self.center(at.spot, commanded).ok_or(singular)?;
                before = f64::INFINITY;
                continue;
            }
            at.values = self.values(&at.spot, commanded);
            before = length;
        }
        Err(singular)
    }

    /// Updates the angles of a platform.
    pub fn with_angles(&self, place: Place) -> Place {
        if !self.turns_freely {
            return place;
        }
        let home = Pose { position: self.home.centre, angles: self.home.angles };
        let angles = angles_near(&place.rotation, &home, &home.trigonometry());
        Place { angles, ..place }
    }

    /// Computes the pose of the control point in base.
    pub fn pose(&self, place: &Place, tool: &Vector3<f64>) -> Pose {
        let Place { rotation, centre, angles } = self.with_angles(*place);
        Pose { position: centre + tool - rotation * (tool + self.reference), angles }
    }

    /// Computes the rates of all coordinates of the control point in base from those of the commanded ones, lengths and
    /// radians, while the platform also moves at `drift` relative to it; `None` at a constraint singularity.
    pub fn rates(
        &self,
        place: &Place,
        (lever, drift): (&Vector3<f64>, &Vector3<f64>),
        rate: &[f64; 6],
    ) -> Option<[f64; 6]> {
        let pose = Pose { position: place.centre, angles: place.angles };
        let map = pose.rate_map();
        let mut columns = [[0.0; 6]; 6];
        let mut values = [0.0; 6];
        let mut rate = *rate;
        for k in (0..6).filter(|k| self.dependent[*k]) {
            rate[k] = 0.0;
        }
        for (i, coupling) in self.used().iter().enumerate().take(MOST) {
            let Row { force, moment, .. } = coupling.row(&place.rotation, &place.centre);
            // About the control point.
            let turned = map.tr_mul(&(moment + lever.cross(&force)));
            let row = [force.x, force.y, force.z, turned.x, turned.y, turned.z];
            values[i] = inner(&row, &rate) + force.dot(drift);
            for k in (0..6).filter(|k| self.dependent[*k]) {
                columns[k][i] = if k < 3 { row[k] } else { row[k] / self.radius };
            }
        }
        let solved = PseudoInverse::new(&columns, &self.dependent)?.solve(&values);
        for k in (0..6).filter(|k| self.dependent[*k]) {
            rate[k] = if k < 3 { -solved[k] } else { -solved[k] / self.radius };
        }
        Some(rate)
    }
}

/// Creates the refusal of constraint `i`, with which there are more than six equations.
fn too_many(i: usize, layout: &Layout) -> Fault {
    let part = Some(MachinePart::Constraint(i as u8));
    Fault { cause: Cause::ConstraintsTooMany, part, value: (6 - layout.legs().min(6)) as f64 }
}

/// A ball in which the dependent coordinates are unique.
struct Ball {
    radius: f64,
    /// Bound of ‖1 − M F_y‖.
    change: f64,
}
