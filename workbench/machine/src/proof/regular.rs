// SPDX-License-Identifier: GPL-2.0-or-later
//! Bounds of the conditioning over a cell.
//!
//! **Conditioning**: let G be the rows [u (ρ × u)/r] of the legs and M their pseudo-inverse at the
//! center C. Then M G(X) = I + E, where E is bounded elementwise by a matrix B: the absolute slopes along every
//! step, and |M| times the bounds of the second derivatives. If the spectral radius of B is
//! less than 1, (I + E)⁻¹ is bounded by I + B + B² + … = (I − B)⁻¹, and because v = (I + E)⁻¹ M G(X) v, the
//! least singular value is at least σ(C) / ‖(I − B)⁻¹‖.
//!
//! **Regular**: the same for the rows of the joints J, nut corrections included: M J(X) = I + E, where
//! B has the additional term |M (J(C) − G(C))|. If its spectral radius is less than 1, the Jacobian is regular
//! at every pose of the cell.

use crate::proof::bounds::SecondDerivatives;
use crate::proof::reach::{LegMiddle, Middle, ROUNDING, Reach, Spread};
use kinematics::{At, MAX_LEGS, Vector3};
use nalgebra::{Matrix6, SMatrix, Vector6};
use std::f64::consts::PI;

/// Legs by coordinates.
type LegRows = SMatrix<f64, MAX_LEGS, 6>;

/// Coordinates by legs.
type Inverse = SMatrix<f64, 6, MAX_LEGS>;

/// Coordinates by coordinates.
type Square = Matrix6<f64>;

/// Iterations for the positive vector that bounds the spectral radius of a matrix.
const STEPS: usize = 4;

/// Bounds of the conditioning over a cell.
pub(super) struct Regularity {
    /// Lower bound of the smallest singular value, as a share of its value at the center.
    pub(super) share: f64,
    /// Whether the joints' Jacobian is regular everywhere.
    pub(super) is_regular: bool,
    /// Bound of the largest singular value of the pseudo-inverse at the center.
    pub(super) inverse: f64,
    /// Contribution of every step of the cell to the uncertainty.
    pub(super) shares: Vec<f64>,
}

/// Rotation of the platform along a step.
struct Turn {
    whole: Vector3<f64>,
    /// Changes of the axes of A, B and C: R = Rz Ry Rx, and each angle rotates the axes further right in the
    /// product.
    of_axes: [Vector3<f64>; 3],
}

impl Turn {
    fn of(step: &[f64; 6], axes: &[Vector3<f64>; 3]) -> Self {
        let of = |from: usize| -> Vector3<f64> { (from..3).map(|m| axes[m] * step[m + 3]).sum() };
        Self { whole: of(0), of_axes: std::array::from_fn(|k| of(k + 1).cross(&axes[k])) }
    }
}

impl Reach<'_> {
    /// Bounds the conditioning over a cell.
    pub(super) fn regularity(
        &self,
        middle: &Middle,
        spread: &Spread,
        seconds: &[SecondDerivatives],
    ) -> Regularity {
        let extents = self.extents(spread);
        let unknown = |shares| Regularity { share: 0.0, is_regular: false, inverse: 1.0, shares };
        let rows = constraint_rows(middle.at);
        let Some((inverse, square)) = self.pseudo_inverse(&rows) else { return unknown(extents) };
        let legs = self.config.legs();
        let constrained = self.dependent.as_ref().zip(middle.place.as_ref());
        let couplings = constrained.map(|(all, place)| all.rows(place, &self.about, &spread.steps));
        let couplings = match couplings.map(|all| all.scaled(|i| rows.row(legs + i).transpose())) {
            Some(None) => return unknown(extents),
            known => known.flatten(),
        };
        let mut rest = self.row_rest(spread, seconds);
        for (i, [linear, angular]) in couplings.iter().flat_map(|all| &all.rest).enumerate() {
            for k in 0..6 {
                rest[(legs + i, k)] = if k < 3 { *linear } else { *angular };
            }
        }
        let rest = inverse.abs() * rest;
        let levers: Vec<_> = (0..middle.legs.len()).map(|i| self.lever(i, middle)).collect();
        let change = |(n, step): (usize, &[f64; 6])| {
            let mut change = self.change_along(step, middle, &levers, &inverse);
            for (i, changes) in couplings.iter().flat_map(|all| &all.changes).enumerate() {
                change.ger(1.0, &inverse.column(legs + i), &changes[n], 1.0);
            }
            change.abs()
        };
        let changes: Vec<Square> = spread.steps.iter().enumerate().map(change).collect();
        let bound = changes.iter().fold(rest, |sum, change| sum + change);
        let whole: f64 = extents.iter().sum();
        let beside = rest.norm() / whole;
        let share = |(change, extent): (&Square, &f64)| change.norm() + beside * extent;
        let shares = changes.iter().zip(&extents).map(share).collect();
        let is_bounded = spectral_radius(&bound) < 1.0 - ROUNDING;
        let is_regular = match self.is_geared {
            true => self.is_regular_with_nuts(middle, spread, seconds, (&rows, &inverse, &bound)),
            false => is_bounded,
        };
        let series = is_bounded.then(|| (Square::identity() - bound).try_inverse()).flatten();
        let norm = series.map(|sum| spectral_radius(&sum.tr_mul(&sum)).sqrt());
        let share = norm.map_or(0.0, |norm| (1.0 - ROUNDING) / norm);
        // The largest eigenvalue is at most the fourth root of the trace of the fourth power.
        let inverse = (square * square).norm().powf(0.25);
        Regularity { share, is_regular, inverse, shares }
    }

    /// Returns whether the rows of the joints, nut corrections included, have an inverse all over a cell,
    /// from the bound of [`Self::hold`] and its pseudo-inverse.
    fn is_regular_with_nuts(
        &self,
        middle: &Middle,
        spread: &Spread,
        seconds: &[SecondDerivatives],
        (rows, inverse, bound): (&LegRows, &Inverse, &Square),
    ) -> bool {
        let nuts = self.rows_of_nuts(middle).zip(self.rest_of_nuts(middle, spread, seconds));
        nuts.is_some_and(|(with_nuts, rest)| {
            let of_nuts = (inverse * (with_nuts - rows)).abs() + inverse.abs() * rest;
            spectral_radius(&(bound + of_nuts)) < 1.0 - ROUNDING
        })
    }

    /// Returns the pseudo-inverse of rows, and its product with its transpose; zeros for coordinates that the legs do
    /// not move.
    fn pseudo_inverse(&self, rows: &LegRows) -> Option<(Inverse, Square)> {
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

    /// Returns whether the angular columns are about the axes of base, or about those of one or two angles,
    /// which rotate as well.
    fn is_about_base(&self) -> bool {
        self.active[3..] == [true; 3]
    }

    /// Returns the axis of an angular column.
    fn axis(&self, k: usize, middle: &Middle) -> Vector3<f64> {
        match self.is_about_base() {
            true => Vector3::ith(k, 1.0),
            false => middle.axes[k],
        }
    }

    /// Returns the vector from the reference point of the conditioning to the platform anchor of leg `i`, in base.
    fn lever(&self, i: usize, middle: &Middle) -> Vector3<f64> {
        self.lever_from(&self.about, i, middle)
    }

    /// Returns the pseudo-inverse times the change of the legs' rows along a step, machine units and radians.
    fn change_along(
        &self,
        step: &[f64; 6],
        middle: &Middle,
        levers: &[Vector3<f64>],
        inverse: &Inverse,
    ) -> Square {
        let mut change = Square::zeros();
        // A cell has a step along every coordinate, also along constant ones.
        if *step == [0.0; 6] {
            return change;
        }
        let turn = Turn::of(step, &middle.axes);
        for (i, (leg, lever)) in middle.legs.iter().zip(levers).enumerate() {
            let slope = self.row_slope(step, (leg, lever), middle, &turn);
            change.ger(1.0, &inverse.column(i), &slope, 1.0);
        }
        change
    }

    /// Returns the change of a leg's constraint row along a step.
    fn row_slope(
        &self,
        step: &[f64; 6],
        (leg, lever): (&LegMiddle, &Vector3<f64>),
        middle: &Middle,
        turn: &Turn,
    ) -> Vector6<f64> {
        let along = |ways: &[Vector3<f64>; 6]| -> Vector3<f64> {
            (0..6).filter(|k| step[*k] != 0.0).map(|k| ways[k] * step[k]).sum()
        };
        let change = along(&leg.changes);
        let turned = (change - leg.n * leg.n.dot(&change)) / leg.length;
        let moment = lever.cross(&leg.n);
        let slope =
            (turn.whole.cross(lever) + along(&leg.slides)).cross(&leg.n) + lever.cross(&turned);
        let per_radius = 1.0 / self.config.machine.radius();
        let mut row = Vector6::zeros();
        for k in (0..3).filter(|k| self.active[*k]) {
            row[k] = turned[k];
        }
        for k in (0..3).filter(|k| self.active[k + 3]) {
            let mut entry = self.axis(k, middle).dot(&slope);
            if !self.is_about_base() {
                entry += turn.of_axes[k].dot(&moment);
            }
            row[k + 3] = entry * per_radius;
        }
        row
    }

    /// Bounds the change of the constraint rows in the cell beyond [`Self::row_slope`].
    fn row_rest(&self, spread: &Spread, seconds: &[SecondDerivatives]) -> LegRows {
        let turns = if self.is_about_base() { spread.turn } else { 2.0 * spread.turn };
        let mut rest = LegRows::zeros();
        let per_radius = 1.0 / self.config.machine.radius();
        for (i, second_derivative) in seconds.iter().enumerate() {
            let [turned, bent] = second_derivative.direction;
            let lever = self.arm_about(i) * per_radius;
            let [slid, sliding] = second_derivative.slide;
            let of_ring = (sliding + 2.0 * slid * (turned + spread.turn)) * per_radius;
            let angular = (lever * (bent + 2.0 * turned * turns + turns * turns) + of_ring) / 2.0;
            for k in (0..6).filter(|k| self.active[*k]) {
                rest[(i, k)] = if k < 3 { bent / 2.0 } else { angular };
            }
        }
        rest
    }

    fn arm_about(&self, i: usize) -> f64 {
        let leg = &self.config.geometry.legs()[i];
        (Vector3::from(leg.platform) - self.about).norm() + leg.kind.ring_radius()
    }

    /// Returns the constraint rows with those of the joints instead of the struts'.
    fn rows_of_nuts(&self, middle: &Middle) -> Option<LegRows> {
        let of_twist = middle.at.inverse_jacobian().ok()?;
        let mut rows = constraint_rows(middle.at);
        let per_radius = 1.0 / self.config.machine.radius();
        // From the control point to the reference point of the rows.
        let lever = middle.rotation * (self.tool + self.about);
        let legs = self.config.geometry.legs().iter().enumerate();
        for (i, _) in legs.filter(|(_, leg)| leg.kind.screw().lead != 0.0) {
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

    /// Bounds what the nut corrections add to the change of the rows in the cell.
    fn rest_of_nuts(
        &self,
        middle: &Middle,
        spread: &Spread,
        seconds: &[SecondDerivatives],
    ) -> Option<LegRows> {
        let mut rest = LegRows::zeros();
        for (i, second_derivative) in seconds.iter().enumerate() {
            let lead = self.config.geometry.legs()[i].kind.screw().lead;
            if lead == 0.0 {
                continue;
            }
            let [turned, _] = second_derivative.direction;
            let turns = [turned, turned + spread.turn];
            let [a, b] = self.cardan(i, middle, turns)?.map(|cosine| 1.0 / (cosine * cosine));
            let tangents = (a - 1.0).sqrt() + (b - 1.0).sqrt();
            for k in (0..6).filter(|k| self.active[*k]) {
                let (speed, turn) = if k < 3 { (1.0, 0.0) } else { (self.arm_about(i), 1.0) };
                let unit = if k < 3 { 1.0 } else { 1.0 / self.config.machine.radius() };
                // The bilinear form of `nut_second_derivative`.
                let around = turn * spread.turn;
                let own = speed / second_derivative.length;
                let second = speed * around / second_derivative.length + 3.0 * own * turned;
                let nut = 3.0 * own * turned * a
                    + 3.0 * (own + turn) * (turned + spread.turn) * b
                    + tangents * second
                    + around * b.sqrt();
                rest[(i, k)] = lead.abs() / (2.0 * PI) * nut * unit;
            }
        }
        Some(rest)
    }
}

/// Bounds the spectral radius of a nonnegative matrix (Collatz and Wielandt): for
/// any positive vector x it is at most the largest (B x)ᵢ/xᵢ.
fn spectral_radius(matrix: &Square) -> f64 {
    let mut x = Vector6::repeat(1.0);
    let mut least = f64::INFINITY;
    for _ in 0..STEPS {
        let y = matrix * x;
        let bound = y.component_div(&x).max();
        // NaN bounds nothing.
        if bound.is_nan() {
            return f64::INFINITY;
        }
        least = least.min(bound);
        x = y / y.max().max(f64::MIN_POSITIVE) + Vector6::repeat(1e-3);
    }
    least
}

fn constraint_rows(at: &At) -> LegRows {
    let rows = at.constraint_rows();
    LegRows::from_fn(|i, k| rows[i][k])
}
