// SPDX-License-Identifier: GPL-2.0-or-later
//! Two one-parametric families of curves, α(x, y, t) = 0 and β(x, y, t) = 0, whose points of
//! intersection form a curve (paper 000), and proved pieces of that curve over their chords.

use crate::expression::{Expression, Trouble};
use machine::proof::interval::Interval;
use machine::proof::jet::Taylor;
use nalgebra::{Matrix3, Vector3};

/// Largest number of Newton steps to a nearby point.
const NEWTON: usize = 12;
/// Rounding of a point, as a share of its size.
const ROUNDING: f64 = 1e-14;
/// Largest number of times that a box is enlarged before its proof fails.
const GROWTHS: usize = 8;

/// The families. Points are (x, y, w): millimeters, and t in units of `t_unit`, so that all
/// three are of the same magnitude.
#[derive(Clone, Debug)]
pub struct Families {
    /// α and β as functions of x, y, t.
    pub both: [Expression; 2],
    /// Value of t at w = 1.
    pub t_unit: f64,
}

/// Gradients of both functions, or their enclosures.
type Gradients = [[Interval; 3]; 2];

impl Families {
    /// Evaluates both functions along a direction from every point of a box: value, first and second
    /// derivative.
    fn along(&self, at: [Interval; 3], direction: [Interval; 3]) -> Result<[Taylor; 2], Trouble> {
        let mut slots: [Taylor; 3] =
            std::array::from_fn(|k| Taylor::new(at[k], direction[k], Interval::ZERO));
        slots[2] = slots[2] * self.t_unit;
        Ok([self.both[0].at(&slots)?, self.both[1].at(&slots)?])
    }

    /// Returns α (0) or β (1) at x, y and t; NaN if it has no value.
    pub fn value(&self, which: usize, at: [f64; 3]) -> f64 {
        let found = self.both[which].at(&at.map(Taylor::constant));
        found.map_or(f64::NAN, |found| found.value.middle())
    }

    /// Returns values and gradients over a box. At a point the values equal those of [`Self::value`] up to rounding,
    /// because there a power with t in its exponent has a constant exponent.
    fn over(&self, at: [Interval; 3]) -> Result<([Interval; 2], Gradients), Trouble> {
        let mut values = [Interval::ZERO; 2];
        let mut gradients = [[Interval::ZERO; 3]; 2];
        for k in 0..3 {
            let unit = |i| if i == k { Interval::point(1.0) } else { Interval::ZERO };
            let [alpha, beta] = self.along(at, std::array::from_fn(unit))?;
            (gradients[0][k], gradients[1][k]) = (alpha.first(), beta.first());
            values = [alpha.value, beta.value];
        }
        Ok((values, gradients))
    }

    /// Returns values and gradients at a point.
    pub(super) fn at(
        &self,
        point: &Vector3<f64>,
    ) -> Result<([f64; 2], [Vector3<f64>; 2]), Trouble> {
        let (values, gradients) = self.over(alone(point))?;
        Ok((values.map(Interval::middle), gradients.map(middles)))
    }

    /// Returns the point of the curve near `guess` in the plane n · p = `height`, and the number of Newton steps;
    /// `None` if they do not converge.
    pub(super) fn in_plane(
        &self,
        guess: Vector3<f64>,
        normal: &Vector3<f64>,
        height: f64,
    ) -> Result<Option<(Vector3<f64>, usize)>, Trouble> {
        let mut point = guess;
        for step in 1..=NEWTON {
            let ([alpha, beta], [a, b]) = self.at(&point)?;
            let rows = Matrix3::from_rows(&[a.transpose(), b.transpose(), normal.transpose()]);
            let residual = Vector3::new(alpha, beta, normal.dot(&point) - height);
            let Some(correction) = rows.lu().solve(&residual) else { return Ok(None) };
            point -= correction;
            if !point.iter().all(|x| x.is_finite()) {
                return Ok(None);
            }
            if correction.amax() < ROUNDING * 10.0 * (1.0 + point.amax()) {
                return Ok(Some((point, step)));
            }
        }
        Ok(None)
    }
}

fn alone(point: &Vector3<f64>) -> [Interval; 3] {
    std::array::from_fn(|k| Interval::point(point[k]))
}

fn middles(row: [Interval; 3]) -> Vector3<f64> {
    Vector3::from(row.map(Interval::middle))
}

/// A piece of the curve over its chord: the parameter is the distance along the chord.
#[derive(Clone, Debug)]
pub struct Chord {
    /// Start of the chord.
    pub from: Vector3<f64>,
    /// Unit vector along the chord.
    pub along: Vector3<f64>,
}

impl Chord {
    /// Creates the chord between two points, and returns its length.
    pub(super) fn between(from: Vector3<f64>, to: Vector3<f64>) -> (Self, f64) {
        let length = (to - from).norm();
        (Self { from, along: (to - from) / length }, length)
    }

    /// Encloses x, y and t over a range of the chord, with one point for each parameter: proved by Krawczyk's
    /// operator (an interval form of a Newton step that maps a box into itself). Returns `None` if
    /// the proof fails, which may succeed over a shorter range.
    pub(super) fn at(
        &self,
        families: &Families,
        over: Interval,
    ) -> Result<Option<[Taylor; 3]>, Trouble> {
        let height = self.along.dot(&self.from) + over.middle();
        let guess = self.from + self.along * over.middle();
        let Some((middle, _)) = families.in_plane(guess, &self.along, height)? else {
            return Ok(None);
        };
        let (_, gradients) = families.over(alone(&middle))?;
        let [a, b] = gradients.map(middles);
        let rows = Matrix3::from_rows(&[a.transpose(), b.transpose(), self.along.transpose()]);
        let Some(inverse) = rows.try_inverse() else { return Ok(None) };
        let proof = Proof { families, along: &self.along, middle, gradients, inverse };
        Ok(proof.enclosed(over)?.map(|[x, y, w]| [x, y, w * families.t_unit]))
    }
}

/// A point of the curve, gradients there, and the inverse of the rows of its equations.
struct Proof<'a> {
    families: &'a Families,
    along: &'a Vector3<f64>,
    middle: Vector3<f64>,
    gradients: Gradients,
    inverse: Matrix3<f64>,
}

impl Proof<'_> {
    fn enclosed(&self, over: Interval) -> Result<Option<[Taylor; 3]>, Trouble> {
        let half = 0.5 * (over.high - over.low);
        if half == 0.0 {
            return self.derivatives(alone(&self.middle), &self.excess(&self.gradients));
        }
        let tangent = self.inverse.column(2).into_owned();
        let rounding = ROUNDING * (1.0 + self.middle.amax());
        let mut radius =
            tangent.map(|x| 1.1 * x.abs() * half) + Vector3::repeat(0.1 * half + rounding);
        for _ in 0..GROWTHS {
            let at: [Interval; 3] =
                std::array::from_fn(|k| Interval::about(self.middle[k], radius[k]));
            let (_, gradients) = self.families.over(at)?;
            let excess = self.excess(&gradients);
            // |x − middle| for every solution with x in the box.
            let reached: [f64; 3] = std::array::from_fn(|k| {
                let bent: f64 = (0..3).map(|j| excess[k][j].magnitude() * radius[j]).sum();
                tangent[k].abs() * half + bent + rounding
            });
            if (0..3).all(|k| reached[k] < radius[k]) {
                return self.derivatives(at, &excess);
            }
            radius = Vector3::from_fn(|k, _| (1.2 * reached[k]).max(radius[k]));
            if !radius.iter().all(|r| r.is_finite()) {
                break;
            }
        }
        Ok(None)
    }

    /// Returns the residual of the inverse over a box: 1 − inverse · rows.
    fn excess(&self, gradients: &Gradients) -> [[Interval; 3]; 3] {
        let row = |i: usize, k: usize| match i {
            2 => Interval::point(self.along[k]),
            _ => gradients[i][k],
        };
        std::array::from_fn(|i| {
            std::array::from_fn(|k| {
                let unit = Interval::point(if i == k { 1.0 } else { 0.0 });
                (0..3).fold(unit, |sum, j| sum - row(j, k) * self.inverse[(i, j)])
            })
        })
    }

    /// Returns first and second derivatives with respect to the parameter, for all points of the box.
    fn derivatives(
        &self,
        at: [Interval; 3],
        excess: &[[Interval; 3]; 3],
    ) -> Result<Option<[Taylor; 3]>, Trouble> {
        let share = |row: &[Interval; 3]| row.iter().map(|x| x.magnitude()).sum::<f64>();
        let most = excess.iter().map(share).fold(0.0, f64::max) * (1.0 + ROUNDING);
        if !(most < 1.0) {
            return Ok(None);
        }
        // The solution of rows · q = right: q = inverse · right + excess · q.
        let solved = |right: [Interval; 3]| -> [Interval; 3] {
            let first: [Interval; 3] = std::array::from_fn(|i| {
                (0..3).fold(Interval::ZERO, |sum, j| sum + right[j] * self.inverse[(i, j)])
            });
            let size = first.iter().map(|x| x.magnitude()).fold(0.0, f64::max) / (1.0 - most);
            let size = size * (1.0 + ROUNDING);
            std::array::from_fn(|i| {
                let all = Interval::about(0.0, size);
                (0..3).fold(first[i], |sum, j| sum + excess[i][j] * all)
            })
        };
        let first = solved([Interval::ZERO, Interval::ZERO, Interval::point(1.0)]);
        let bent = self.families.along(at, first)?;
        let second = solved([-bent[0].second(), -bent[1].second(), Interval::ZERO]);
        Ok(Some(std::array::from_fn(|k| Taylor::new(at[k], first[k], second[k]))))
    }
}
