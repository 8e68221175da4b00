// SPDX-License-Identifier: GPL-2.0-or-later
//! Dependent coordinates of a pose: solved at the ends of a segment of the line from home, and proved connected.
//!
//! A segment leads from one pair (commanded x, dependent y) to another. Between them a path y(s) is known: the shortest
//! rotation, or angles in proportion. In the chart about y(s), with M the inverse of the derivatives G = F_y in its
//! middle, let
//!
//! ```text
//! η ≥ |M F(x, y(s))|,   λ ≥ ‖1 − M G(x, y(s))‖,   L ≥ ‖M D²F‖ by dependent coordinates
//! ```
//!
//! for all s. If λ < 1 and 2 L η < (1 − λ)², then y ↦ y − M F maps the ball of
//! radius u = 2 η/(1 − λ) about y(s) into itself and contracts there: η + λ u + L u²/2 < u, λ + L u < 1. Each x then has
//! exactly one solution in its ball, which depends continuously on s: the solutions form one path. Where the same bounds
//! hold for all x within [`NEARBY`] of the line, the solution for any x near its end is connected with home along the line
//! to this x, too.
//!
//! F and G are computed at both ends and in the middle. Between these points they differ from linear interpolation by at
//! most 1/32 of their second derivatives by s, which [`Task::bounds`] bounds for the whole segment. In the frame of the
//! platform G changes little along the solutions of these mechanisms, so that one segment usually reaches any pose.

use super::{Coupling, Couplings, Kind, LEAST_BALL, MOST, Row, TOLERANCE};
use crate::fault::{Cause, Fault};
use crate::placed::Place;
use crate::pose::{Pose, Trigonometry, cayley_change};
use libm::{hypot, sqrt};
use nalgebra::{Matrix3, Vector3};

/// Distance from the line within which commanded coordinates belong to the same solution, as a share of the size: more
/// than a servo step.
const NEARBY: f64 = 2e-3;

/// Largest 2 L η/(1 − λ)² of a segment; the rest is for rounding.
const PROVED: f64 = 0.9;

/// The same at which the length of the next segment aims.
const AIM: f64 = 0.6;

/// Largest number of segments that are tried.
const MOST_TRIALS: u32 = 96;

/// Shortest segment, as a share of the line.
const SHORTEST: f64 = 1e-4;

/// Largest number of corrections at the end of a segment.
const MOST_CORRECTIONS: u32 = 12;

/// Ratio of a correction to the one before that needs new derivatives.
const STALE: f64 = 0.02;

/// Largest distance of the end of a segment from its solution, as a share of the radius.
const STRAY: f64 = 1e-3;

/// Rounding of a value, as a share of the size.
const ROUNDING: f64 = 1e-13;

/// Least cosine of the rotation of a segment.
const LEAST_COSINE: f64 = -0.5;

type Square<const M: usize> = [[f64; M]; M];

/// The platform while the dependent coordinates are sought.
#[derive(Clone, Copy)]
struct Spot {
    rotation: Matrix3<f64>,
    /// Current only if an angle is commanded, as are their sines.
    angles: Vector3<f64>,
    trig: Trigonometry,
    /// Position of the reference point; only the dependent coordinates are used.
    free: Vector3<f64>,
}

/// A spot with values and derivatives of the constraints.
#[derive(Clone, Copy)]
struct Center<const M: usize> {
    spot: Spot,
    values: [f64; M],
    /// Row by row.
    rows: Square<M>,
    /// Point that the translations of the bounds refer to.
    point: Vector3<f64>,
}

/// The end of a segment.
struct End<const M: usize> {
    /// Where the derivatives were computed last.
    center: Center<M>,
    /// Their inverse.
    inverse: Square<M>,
    /// The solution.
    spot: Spot,
    /// Bound of its distance from there.
    moved: f64,
}

/// Bounds over a segment: norms over all constraints of second derivatives of F and G by s, of D²F by dependent
/// coordinates, and of the derivatives of F and G by commanded ones.
struct Bounds {
    value: f64,
    rows: f64,
    bend: f64,
    by_command: f64,
    rows_by_command: f64,
}

/// Proof of a segment.
struct Proof {
    /// 2 L η/(1 − λ)²; infinite if λ is not below 1.
    measure: f64,
    /// Radius u of the balls.
    radius: f64,
    /// The radius with which the proof also holds near the line; negative if it does not.
    near: f64,
}

/// The platform for commanded coordinates.
#[derive(Clone, Copy)]
pub(crate) struct Settled {
    /// Its angles are current only if some of A, B and C are commanded.
    pub place: Place,
    /// Difference of the commanded position and the platform's: what a table compensates; otherwise 0 in commanded
    /// coordinates and without meaning in others.
    pub table: Vector3<f64>,
    /// Distance in dependent coordinates within which a solution for near commanded ones is that of the line from home;
    /// negative if nothing is proved about it.
    near: f64,
}

/// One search with its commanded coordinates.
struct Task<'a, const M: usize> {
    of: &'a Couplings,
    /// With their arms about the point that the commanded X, Y and Z move.
    all: [Coupling; M],
    /// From that point to the reference point, in the platform frame; 0 if all of X, Y and Z are commanded.
    lever: Vector3<f64>,
    /// Control point less the tool, at home.
    from: Vector3<f64>,
    way: Vector3<f64>,
    turn: Vector3<f64>,
}

impl Couplings {
    /// Computes the platform for commanded coordinates.
    ///
    /// # Errors
    /// [`Cause::ConstraintSingular`].
    #[inline(never)]
    pub fn settle(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Settled, Fault> {
        match self.count {
            3 => Task::<3>::new(self, pose, tool).settle(pose, tool),
            _ => Task::<MOST>::new(self, pose, tool).settle(pose, tool),
        }
    }

    /// Returns whether a platform that satisfies the constraints is certainly the one for its commanded coordinates,
    /// because they are near those of `from`; its angles must be current if any is commanded.
    pub fn is_beside(&self, from: &Settled, place: &Place, tool: &Vector3<f64>) -> bool {
        let there = &from.place;
        let turned = place.rotation - there.rotation;
        let moved = place.centre - there.centre;
        let shifted = moved - turned * (tool + self.reference);
        let angles = (place.angles - there.angles) * self.radius;
        let (mut commanded, mut dependent) = (0.0, 0.0);
        for k in 0..3 {
            match self.dependent[k] {
                true => dependent += moved[k] * moved[k],
                false => commanded += shifted[k] * shifted[k],
            }
            match (self.turns_freely, self.dependent[k + 3]) {
                (true, _) => {}
                (false, true) => dependent += angles[k] * angles[k],
                (false, false) => commanded += angles[k] * angles[k],
            }
        }
        if self.turns_freely {
            // 2 sin(θ/2) = ‖ΔR‖/√2 of a rotation by θ; below 1 it is at least θ/1.05.
            let sine = turned.norm_squared() / 2.0;
            if !(sine <= 1.0) {
                return false;
            }
            dependent += sine * (1.05 * self.radius) * (1.05 * self.radius);
        }
        sqrt(commanded) <= NEARBY * self.size && sqrt(dependent) <= from.near
    }
}

impl<'a, const M: usize> Task<'a, M> {
    #[inline(always)]
    fn new(of: &'a Couplings, pose: &Pose, tool: &Vector3<f64>) -> Self {
        let lever = tool + of.reference;
        // Home with this tool.
        let from = of.home.centre - of.home.rotation * lever;
        let mut way = pose.position - tool - from;
        let mut turn = pose.angles - of.home.angles;
        for k in 0..3 {
            if of.dependent[k] {
                way[k] = 0.0;
            }
            if of.dependent[k + 3] {
                turn[k] = 0.0;
            }
        }
        let mut all = [Coupling::NONE; M];
        all.iter_mut().zip(of.used()).for_each(|(to, coupling)| *to = *coupling);
        if of.moves_freely() {
            return Self { of, all, lever, from, way, turn };
        }
        for coupling in &mut all {
            match coupling.kind {
                Kind::InPlane => coupling.arm += lever,
                Kind::Through => coupling.offset += coupling.arm.dot(&lever),
                Kind::Square => {}
            }
        }
        Self { of, all, lever: Vector3::zeros(), from, way, turn }
    }

    #[inline(always)]
    fn settle(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<Settled, Fault> {
        let of = self.of;
        let trig = match of.turns_freely {
            true => Trigonometry::LEVEL,
            false => Pose { position: of.home.centre, angles: of.home.angles }.trigonometry(),
        };
        let Place { rotation, angles, centre } = of.home;
        let mut here = self.center(&Spot { rotation, angles, trig, free: centre }, 0.0);
        let (mut done, mut share, mut holds_nearby) = (0.0, 1.0, true);
        // The solution there, if the center is beside it.
        let mut solution = None;
        for _ in 0..MOST_TRIALS {
            let arrives = share >= 1.0 - done;
            let to = if arrives { 1.0 } else { done + share };
            let part = to - done;
            let mut measure = f64::INFINITY;
            if let Some(end) = self.solved(&here.spot, to)
                && let Some(proof) = self.proof(&here, &end.center, [done, to])
            {
                measure = proof.measure;
                if measure <= PROVED && end.moved <= proof.radius {
                    holds_nearby &= proof.near >= 0.0;
                    if arrives {
                        let near = if holds_nearby { proof.near - end.moved } else { -1.0 };
                        return self.arrived(&end, near, pose, tool);
                    }
                    (here, done, solution) = (end.center, to, Some(end.spot));
                    share = part * sqrt(AIM / measure).clamp(1.0, 4.0);
                    continue;
                }
            }
            // Otherwise the distance from the solution could make the proof of any segment fail, however short.
            if let Some(spot) = solution.take() {
                here = self.center(&spot, done);
            }
            share = part * sqrt(AIM / measure).clamp(0.25, 0.8);
            if !(share >= SHORTEST) {
                break;
            }
        }
        Err(Fault::with_value(Cause::ConstraintSingular, done))
    }

    /// Returns the platform at the end of the line, unless it is near a constraint singularity.
    #[inline(always)]
    fn arrived(
        &self,
        end: &End<M>,
        near: f64,
        pose: &Pose,
        tool: &Vector3<f64>,
    ) -> Result<Settled, Fault> {
        let of = self.of;
        let bounds = self.bounds(&end.center, [0.0; 2]);
        if !(norm_of(&end.inverse) * bounds.bend * LEAST_BALL * of.size < 1.0) {
            return Err(Fault::with_value(Cause::ConstraintSingular, 1.0));
        }
        let Spot { rotation, angles, free, .. } = end.spot;
        let lever = tool + of.reference;
        let at = pose.position - tool + rotation * lever;
        let mut centre = at;
        for k in (0..3).filter(|k| of.dependent[*k]) {
            centre[k] = free[k];
        }
        let place = Place { rotation, centre, angles };
        Ok(Settled { place, table: at - centre, near })
    }

    /// Turns the commanded angles to a share of the line.
    #[inline(always)]
    fn turned(&self, spot: &Spot, share: f64) -> Spot {
        if self.of.turns_freely || self.turn == Vector3::zeros() {
            return *spot;
        }
        let mut angles = spot.angles;
        for k in (0..3).filter(|k| !self.of.dependent[k + 3]) {
            angles[k] = self.of.home.angles[k] + self.turn[k] * share;
        }
        Spot::at(angles, spot.free)
    }

    /// Computes the point of the platform that constraints refer to.
    #[inline(always)]
    fn point(&self, spot: &Spot, share: f64) -> Vector3<f64> {
        let mut point = self.from + self.way * share;
        if self.of.moves_freely() {
            point += spot.rotation * self.lever;
            for k in (0..3).filter(|k| self.of.dependent[*k]) {
                point[k] = spot.free[k];
            }
        }
        point
    }

    #[inline(always)]
    fn values(&self, spot: &Spot, share: f64) -> [f64; M] {
        let point = self.point(spot, share);
        let mut values = [0.0; M];
        for i in 0..M.min(self.of.count) {
            values[i] = self.all[i].row(&spot.rotation, &point).value;
        }
        values
    }

    /// Computes values and derivatives; equations and unknowns that are not there are those of an identity.
    #[inline(always)]
    fn center(&self, spot: &Spot, share: f64) -> Center<M> {
        let of = self.of;
        let point = self.point(spot, share);
        let lever = spot.rotation * self.lever;
        let map = match of.turns_freely {
            true => spot.rotation,
            false => spot.trig.rate_map(),
        } / of.radius;
        let (mut values, mut rows) = ([0.0; M], [[0.0; M]; M]);
        for i in 0..M {
            if i >= of.count {
                rows[i][i] = 1.0;
                continue;
            }
            let Row { value, force, moment } = self.all[i].row(&spot.rotation, &point);
            values[i] = value;
            let mut about = moment;
            if of.moves_freely() {
                // A rotation moves the reference point as commanded, and not in the dependent coordinates.
                let mut moved = force;
                for k in (0..3).filter(|k| of.dependent[*k]) {
                    moved[k] = 0.0;
                }
                about += lever.cross(&moved);
            }
            let turned = map.tr_mul(&about);
            let all = [force.x, force.y, force.z, turned.x, turned.y, turned.z];
            for j in 0..M.min(of.count) {
                rows[i][j] = all[of.unknown[j].min(5)];
            }
        }
        Center { spot: *spot, values, rows, point }
    }

    /// Moves by a step in the dependent coordinates.
    #[inline(always)]
    fn go(&self, spot: &mut Spot, step: &[f64; M]) {
        let of = self.of;
        let mut all = [0.0; 6];
        for j in 0..M.min(of.count) {
            all[of.unknown[j].min(5)] = step[j];
        }
        let [x, y, z, a, b, c] = all;
        let turn = Vector3::new(a, b, c) / of.radius;
        spot.free += Vector3::new(x, y, z);
        match of.turns_freely {
            true => spot.rotation += spot.rotation * cayley_change(&turn),
            false => *spot = Spot::at(spot.angles + turn, spot.free),
        }
    }

    /// Solves the constraints at a share of the line by Newton's method, starting from `guess`.
    #[inline(always)]
    fn solved(&self, guess: &Spot, share: f64) -> Option<End<M>> {
        let size = self.of.size;
        let mut center = self.center(&self.turned(guess, share), share);
        let mut inverse = inverted(&center.rows)?;
        let (mut spot, mut values) = (center.spot, center.values);
        let (mut moved, mut before) = (0.0, f64::INFINITY);
        for _ in 0..MOST_CORRECTIONS {
            let step = times(&inverse, &values).map(|x| -x);
            let length = length_of(&step);
            self.go(&mut spot, &step);
            moved += length;
            let ratio = if before < f64::INFINITY { length / before } else { 1.0 };
            if length * ratio.min(1.0) <= TOLERANCE * size || length <= 16.0 * f64::EPSILON * size {
                // The path of a segment ends at the center: far from the solution, its values would make the proof fail.
                if moved > STRAY * self.of.radius {
                    center = self.center(&spot, share);
                    inverse = inverted(&center.rows)?;
                    moved = 0.0;
                }
                return Some(End { center, inverse, spot, moved });
            }
            if ratio > STALE && before < f64::INFINITY {
                center = self.center(&spot, share);
                inverse = inverted(&center.rows)?;
                (values, moved, before) = (center.values, 0.0, f64::INFINITY);
                continue;
            }
            values = self.values(&spot, share);
            before = length;
        }
        None
    }

    /// Computes the proof of a segment between two shares of the line; `None` without derivatives in its middle.
    #[inline(always)]
    fn proof(&self, one: &Center<M>, other: &Center<M>, [from, to]: [f64; 2]) -> Option<Proof> {
        let of = self.of;
        let free = (one.spot.free + other.spot.free) / 2.0;
        let (spot, turned) = match of.turns_freely {
            true => {
                let change = other.spot.rotation * one.spot.rotation.transpose();
                let cosine = (change.trace() - 1.0) / 2.0;
                if !(cosine > LEAST_COSINE) {
                    return None;
                }
                // The axis times the sine of the rotation, whose half has this cosine.
                let axis = Vector3::new(
                    change[(2, 1)] - change[(1, 2)],
                    change[(0, 2)] - change[(2, 0)],
                    change[(1, 0)] - change[(0, 1)],
                ) / 2.0;
                let half = sqrt(((1.0 + cosine) / 2.0).min(1.0));
                let across = axis.cross_matrix();
                let twice = across * across / (4.0 * (1.0 + half) * half * half);
                let by_half = Matrix3::identity() + across / (2.0 * half) + twice;
                // 2 tan(θ/2), an upper bound of θ.
                let most = 2.0 * axis.norm() / (1.0 + cosine);
                let spot = Spot { rotation: by_half * one.spot.rotation, free, ..one.spot };
                (spot, most)
            }
            false => {
                let by = other.spot.angles - one.spot.angles;
                (Spot::at(one.spot.angles + by / 2.0, free), by.abs().sum())
            }
        };
        let middle = self.center(&spot, (from + to) / 2.0);
        let inverse = inverted(&middle.rows)?;
        let mut moved = (self.way * (to - from)).norm_squared();
        if of.moves_freely() {
            let by = other.spot.free - one.spot.free;
            for k in (0..3).filter(|k| of.dependent[*k]) {
                moved += by[k] * by[k];
            }
        }
        let (mut off, mut change) = (0.0_f64, 0.0_f64);
        for at in [one, &middle, other] {
            off = off.max(length_of(&times(&inverse, &at.values)));
            change = change.max(departure(&inverse, &at.rows));
        }
        let bounds = self.bounds(&middle, [turned, sqrt(moved)]);
        let norm = norm_of(&inverse);
        // For commanded coordinates within a distance of the line.
        let within = |distance: f64| {
            let deviation = bounds.value / 32.0 + bounds.by_command * distance;
            let eta = off + norm * (deviation + ROUNDING * of.size);
            let turned = bounds.rows / 32.0 + bounds.rows_by_command * distance;
            let rest = 1.0 - change - norm * turned;
            let radius = 2.0 * eta / rest;
            match rest > 0.0 && radius <= of.radius {
                true => (2.0 * norm * bounds.bend * eta / (rest * rest), radius),
                false => (f64::INFINITY, radius),
            }
        };
        let (measure, radius) = within(0.0);
        let (nearby, reach) = within(NEARBY * of.size);
        let near = if nearby <= PROVED { reach } else { -1.0 };
        Some(Proof { measure, radius, near })
    }

    /// Bounds derivatives over a segment about its middle, on which the platform rotates by up to `turned` and its
    /// reference point moves by up to `moved` beside this rotation; dependent coordinates change by up to the radius.
    ///
    /// With s the parameter, |R'| ≤ φ, |R''| ≤ φ² for a rotation by φ, and the same for derivatives of R by angles. Where
    /// X, Y or Z is dependent, the reference point also moves by the rotation of the lever in the others.
    #[inline(always)]
    fn bounds(&self, middle: &Center<M>, [turned, moved]: [f64; 2]) -> Bounds {
        let of = self.of;
        let per = 1.0 / of.radius;
        let square = turned * turned;
        let (y, yy) = (of.turning.y, of.turning.yy);
        let x = of.turning.x;
        let frees = of.moves_freely();
        let lever = if frees { self.lever.norm() } else { 0.0 };
        let moved = moved + lever * turned;
        let mut sums = [0.0; 5];
        for i in 0..M.min(of.count) {
            let coupling = &self.all[i];
            let of_arm = |arm: f64| {
                let (per_turn, twice) = (arm * per, arm * per * per);
                [arm * square, y * per_turn * square, yy * twice, 1.0 + x * per_turn, x * y * twice]
            };
            let bounds = match coupling.kind {
                Kind::InPlane => of_arm(coupling.commanded * lever + coupling.arm.norm()),
                Kind::Square => of_arm(coupling.scale),
                Kind::Through => {
                    let near = if frees { of.radius + y * lever } else { 0.0 };
                    let distance = (coupling.base - middle.point).norm()
                        + moved / 2.0
                        + NEARBY * of.size * (1.0 + x * lever * per)
                        + near;
                    let both = square * distance + 2.0 * turned * moved;
                    let free = if frees { square } else { 0.0 };
                    let twice = yy * (distance + 3.0 * lever) * per * per;
                    let bend =
                        if frees { twice / 2.0 + hypot(twice / 2.0, y * per) } else { twice };
                    [
                        both + square * lever,
                        (both + 5.0 * square * lever) * y * per + free,
                        bend,
                        1.0 + x * (distance + lever) * per,
                        x * y * (distance + 3.0 * lever) * per * per + (x + y) * per,
                    ]
                    .map(|bound| bound * coupling.scale)
                }
            };
            sums.iter_mut().zip(bounds).for_each(|(sum, bound)| *sum += bound * bound);
        }
        let [value, rows, bend, by_command, rows_by_command] = sums.map(sqrt);
        Bounds { value, rows, bend, by_command, rows_by_command }
    }
}

impl Spot {
    #[inline(always)]
    fn at(angles: Vector3<f64>, free: Vector3<f64>) -> Self {
        let trig = Pose { position: free, angles }.trigonometry();
        Self { rotation: trig.rotation(), angles, trig, free }
    }
}

/// Inverts a matrix; `None` if it is singular.
#[inline(always)]
fn inverted<const M: usize>(rows: &Square<M>) -> Option<Square<M>> {
    let mut rest = *rows;
    let mut inverse = [[0.0; M]; M];
    for i in 0..M {
        inverse[i][i] = 1.0;
    }
    for k in 0..M {
        // Exchanges rows one by one instead of searching for a pivot: no index depends on data.
        for i in k + 1..M {
            if rest[i][k].abs() > rest[k][k].abs() {
                rest.swap(i, k);
                inverse.swap(i, k);
            }
        }
        if !(rest[k][k].abs() > 0.0) {
            return None;
        }
        let over = 1.0 / rest[k][k];
        for j in 0..M {
            rest[k][j] *= over;
            inverse[k][j] *= over;
        }
        let (pivot, of_pivot) = (rest[k], inverse[k]);
        for i in (0..M).filter(|i| *i != k) {
            let share = rest[i][k];
            for j in 0..M {
                rest[i][j] -= share * pivot[j];
                inverse[i][j] -= share * of_pivot[j];
            }
        }
    }
    Some(inverse)
}

#[inline(always)]
fn times<const M: usize>(matrix: &Square<M>, vector: &[f64; M]) -> [f64; M] {
    let mut product = [0.0; M];
    for i in 0..M {
        for j in 0..M {
            product[i] += matrix[i][j] * vector[j];
        }
    }
    product
}

#[inline(always)]
fn length_of<const M: usize>(vector: &[f64; M]) -> f64 {
    sqrt(vector.iter().map(|x| x * x).sum())
}

/// Computes the Frobenius norm of 1 − M G.
#[inline(always)]
fn departure<const M: usize>(inverse: &Square<M>, rows: &Square<M>) -> f64 {
    let mut sum = 0.0;
    for i in 0..M {
        for j in 0..M {
            let mut off = if i == j { 1.0 } else { 0.0 };
            for k in 0..M {
                off -= inverse[i][k] * rows[k][j];
            }
            sum += off * off;
        }
    }
    sqrt(sum)
}

/// Bounds the spectral norm of M by trace and Frobenius norm of S = M Mᵀ: its largest eigenvalue is at most
/// t/m + √((m − 1)/m (‖S‖² − t²/m)).
#[inline(always)]
fn norm_of<const M: usize>(matrix: &Square<M>) -> f64 {
    let (mut trace, mut square) = (0.0, 0.0);
    for i in 0..M {
        for j in i..M {
            let mut product = 0.0;
            for k in 0..M {
                product += matrix[i][k] * matrix[j][k];
            }
            if i == j {
                trace += product;
            }
            square += if i == j { product * product } else { 2.0 * product * product };
        }
    }
    let m = M as f64;
    let spread = (square - trace * trace / m).max(0.0);
    sqrt(trace / m + sqrt((m - 1.0) / m * spread))
}
