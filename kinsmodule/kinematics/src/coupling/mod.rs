// SPDX-License-Identifier: GPL-2.0-or-later
//! Constraints of the platform, checked: equations beside those of the legs, and the coordinates that they determine.
//!
//! Each constraint is bilinear in the orientation R and the position P of the reference point, so that its derivatives
//! have simple bounds. Forward treats a constraint like a strut whose joint value never changes: the lanes after those
//! of the legs have the machine's size as their length, plus the value of the constraint, which is 0 at a solution.
//!
//! **Dependent coordinates.** For given commanded coordinates x the constraints F(x, y) = 0 determine the dependent
//! ones, y. The machine is assembled at home; the correct y is the end of the unique continuous path of solutions from
//! home along the straight line in x, with the tool mounted. The file `settle` solves it and proves that it is this end.
//! No state is kept between calls: the answer depends on the pose and the tool alone.
//!
//! **Norm** of a displacement of the platform: ‖(translation, r · angle)‖, r the platform radius.

mod settle;

pub(crate) use settle::Settled;

use crate::constraint::{ConstraintGeometry, MAX_CONSTRAINTS};
use crate::fault::{Cause, Fault, MachinePart};
use crate::geometry::{FARTHEST, Geometry};
use crate::lanes::{Lanes3, inner};
use crate::layout::Layout;
use crate::leg::direction;
use crate::letters::Letter;
use crate::placed::{Place, Placed};
use crate::pose::{Pose, angles_near};
use crate::pseudo_inverse::PseudoInverse;
use core::f64::consts::SQRT_2;
use libm::{hypot, sqrt};
use nalgebra::{Matrix3, Vector3};

/// Largest number of independent constraints: at least one leg moves the platform.
const MOST: usize = 5;

/// A solution is too near to a constraint singularity if its derivatives may become singular within this share of the
/// size.
const LEAST_BALL: f64 = 1e-6;

/// Error of the dependent coordinates, estimated by the last two corrections, at which corrections stop, as a share of the
/// size. The promised 1e-9 leaves room for the estimate.
const TOLERANCE: f64 = 1e-14;

/// A constraint whose gradient is farther from those of the others than this share of its length is independent at the
/// pose [TRAJ]HOME, whose dependent coordinates are still 0; at the home of the machine.
const INDEPENDENT: [f64; 2] = [1e-2, 1e-7];

/// Largest value of a redundant constraint that agrees with the others, as a share of the size.
const AGREES: f64 = 1e-9;

/// Displacements at which redundant constraints are compared with the others, as a share of the radius.
const COMPARED: f64 = 0.05;

/// Directions of these displacements: along each coordinate, and along all at once, as a constraint may differ from the
/// others by a product of coordinates.
const DIRECTIONS: [[f64; 6]; 8] = [
    [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    [1.0, 0.8, 0.6, 0.9, 0.7, 0.5],
    [-0.6, 0.9, 1.0, -0.8, 0.5, 0.7],
];

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
    /// Length of the part of n along commanded coordinates.
    commanded: f64,
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
    /// Which of the constraints given depend on those before and are not among them.
    dropped: [bool; MAX_CONSTRAINTS],
    /// Lane of the first one.
    first: usize,
    /// Per coordinate X … C, whether they determine it.
    dependent: [bool; 6],
    /// Index of each dependent coordinate, as many as constraints.
    unknown: [usize; MOST],
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

/// Bounds of the derivatives of R by the dependent angles (y, yy) and by the commanded ones (x), for unit rates.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Turning {
    y: f64,
    x: f64,
    yy: f64,
}

impl Coupling {
    const NONE: Self = Self {
        kind: Kind::Square,
        arm: Vector3::new(0.0, 0.0, 0.0),
        base: Vector3::new(0.0, 0.0, 0.0),
        normal: Vector3::new(0.0, 0.0, 0.0),
        offset: 0.0,
        scale: 0.0,
        commanded: 0.0,
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
    /// Returns the bounds: k angles at a unit rate rotate at most at √k, and the second derivatives sum up to at most k;
    /// rotation vectors, the chart if all angles are dependent, have bounds of 1.
    fn of(angles: [bool; 3]) -> Self {
        let root = |count: usize| [0.0, 1.0, SQRT_2, 1.75][count.min(3)];
        let dependent = angles.iter().filter(|dependent| **dependent).count();
        match dependent {
            3 => Self { y: 1.0, x: 0.0, yy: 1.0 },
            _ => Self { y: root(dependent), x: root(3 - dependent), yy: dependent as f64 },
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
        let mut given = [Coupling::NONE; MAX_CONSTRAINTS];
        for (i, (place, constraint)) in given.iter_mut().zip(geometry.constraints()).enumerate() {
            *place = Coupling::new(constraint, i, sizes)?;
        }
        let given = given.get_mut(..layout.constraints()).unwrap_or_default();
        let rotation = home.rotation();
        let start =
            Place { rotation, centre: home.position + rotation * reference, angles: home.angles };
        let dependent = Letter::ALL.map(|letter| layout.is_dependent(letter));
        for coupling in given.iter_mut() {
            match coupling.kind {
                // The length of its gradient is then 1.
                Kind::Through => {
                    let distance = (coupling.base - start.centre).norm();
                    coupling.scale = 1.0 / hypot(1.0, distance / radius);
                }
                Kind::InPlane => {
                    let parts = (0..3).filter(|k| !dependent[*k]).map(|k| coupling.normal[k]);
                    coupling.commanded = sqrt(parts.map(|part| part * part).sum());
                }
                Kind::Square => {}
            }
        }
        let [.., a, b, c] = dependent;
        let mut couplings = Self {
            all: [Coupling::NONE; MOST],
            count: 0,
            dropped: [false; MAX_CONSTRAINTS],
            first: layout.legs(),
            dependent,
            unknown: [0; MOST],
            turns_freely: a && b && c,
            turning: Turning::of([a, b, c]),
            home: start,
            reference: *reference,
            radius,
            size,
        };
        let dependents = (0..6).filter(|k| dependent[*k]);
        couplings.unknown.iter_mut().zip(dependents).for_each(|(place, k)| *place = k);
        for share in INDEPENDENT {
            couplings.choose(given, share, layout)?;
            couplings.refuse_undetermined(layout)?;
            couplings.home = start;
            let settled = couplings
                .settle(&home, &Vector3::zeros())
                .map_err(|_| Fault::with_value(Cause::HomeOffConstraints, couplings.off(&start)))?;
            couplings.home = couplings.with_angles(settled.place);
        }
        couplings.refuse_contradicting(given, &home)?;
        Ok(Some(couplings))
    }

    /// Returns the largest value of the constraints at a pose of the platform.
    fn off(&self, place: &Place) -> f64 {
        let values = self.used().iter().map(|c| c.row(&place.rotation, &place.centre).value.abs());
        values.fold(0.0, f64::max)
    }

    /// Returns whether X, Y or Z is dependent.
    #[inline(always)]
    fn moves_freely(&self) -> bool {
        let [x, y, z, ..] = self.dependent;
        x || y || z
    }

    /// Returns whether any of A, B and C is commanded, so that a platform's angles are current.
    #[inline(always)]
    pub fn has_angles(&self) -> bool {
        !self.turns_freely
    }

    fn used(&self) -> &[Coupling] {
        self.all.get(..self.count).unwrap_or(&self.all)
    }

    /// Chooses independent constraints at home, in their order; marks the others.
    fn choose(&mut self, given: &[Coupling], share: f64, layout: &Layout) -> Result<(), Fault> {
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
            if let Some(mark) = self.dropped.get_mut(i) {
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
        let redundant = self.dropped.iter().position(|dropped| *dropped);
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
    fn refuse_contradicting(&self, given: &[Coupling], home: &Pose) -> Result<(), Fault> {
        let mut others =
            given.iter().zip(&self.dropped).enumerate().filter(|(_, (_, drop))| **drop);
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
            for direction in DIRECTIONS {
                for by in [-COMPARED, COMPARED] {
                    let mut pose = *home;
                    for k in (0..6).filter(|k| !self.dependent[*k]) {
                        match k {
                            0..3 => pose.position[k] += by * direction[k] * self.radius,
                            _ => pose.angles[k - 3] += by * direction[k],
                        }
                    }
                    if let Ok(settled) = self.settle(&pose, &Vector3::zeros()) {
                        check(&settled.place)?;
                    }
                }
            }
            Ok(())
        })
    }

    /// Returns whether a constraint depends on those before.
    pub fn is_redundant(&self, constraint: usize) -> bool {
        self.dropped.get(constraint) == Some(&true)
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
