// SPDX-License-Identifier: GPL-2.0-or-later
//! Rational B-splines in space, by de Boor's algorithm with derivatives.

use machine::proof::jet::Taylor;

/// Why a spline cannot be created.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SplineError {
    #[error("a spline of degree {degree} needs at least {} points; found {points}", degree + 1)]
    Points { degree: usize, points: usize },
    #[error("expected {expected} knots, one per point and {more} more; found {found}", more = expected - points)]
    Knots { expected: usize, points: usize, found: usize },
    #[error("knot {0} is smaller than the previous one")]
    Order(usize),
    #[error("the knots span no range: both ends are {0}")]
    NoRange(f64),
    #[error("expected {points} weights, one per point; found {found}")]
    Weights { points: usize, found: usize },
    #[error("weight {value} of point {point}: expected more than 0")]
    Weight {
        /// Number of the point, from 1.
        point: usize,
        value: f64,
    },
    #[error("knot {0} repeats more often than the degree, so the curve has a gap there")]
    Gap(f64),
    #[error("degree 0: expected 1 or more")]
    Degree,
}

/// A rational B-spline.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    degree: usize,
    knots: Vec<f64>,
    /// x, y, z times the weight, and the weight.
    points: Vec<[f64; 4]>,
}

impl Spline {
    /// Creates a spline of control points with weights; the default knots clamp it to its ends and are
    /// evenly spaced between.
    ///
    /// # Errors
    /// See [`SplineError`].
    pub fn new(
        degree: usize,
        points: &[[f64; 3]],
        weights: Option<&[f64]>,
        knots: Option<Vec<f64>>,
    ) -> Result<Self, SplineError> {
        let count = points.len();
        if degree == 0 {
            return Err(SplineError::Degree);
        }
        if count <= degree {
            return Err(SplineError::Points { degree, points: count });
        }
        let knots = knots.unwrap_or_else(|| clamped(degree, count));
        let expected = count + degree + 1;
        if knots.len() != expected {
            return Err(SplineError::Knots { expected, points: count, found: knots.len() });
        }
        if let Some(k) = (1..expected).find(|k| !(knots[*k] >= knots[k - 1])) {
            return Err(SplineError::Order(k + 1));
        }
        let inside = 1..expected - degree - 1;
        let gap = inside.into_iter().find(|k| {
            knots[*k] == knots[k + degree] && knots[*k] > knots[degree] && knots[*k] < knots[count]
        });
        if let Some(k) = gap {
            return Err(SplineError::Gap(knots[k]));
        }
        if !(knots[degree] < knots[count]) {
            return Err(SplineError::NoRange(knots[degree]));
        }
        if let Some(weights) = weights.filter(|weights| weights.len() != count) {
            return Err(SplineError::Weights { points: count, found: weights.len() });
        }
        let weight = |k: usize| weights.map_or(1.0, |all| all[k]);
        if let Some(k) = (0..count).find(|k| !(weight(*k) > 0.0 && weight(*k).is_finite())) {
            return Err(SplineError::Weight { point: k + 1, value: weight(k) });
        }
        let weighted = |(k, p): (usize, &[f64; 3])| {
            let w = weight(k);
            [p[0] * w, p[1] * w, p[2] * w, w]
        };
        let points = points.iter().enumerate().map(weighted).collect();
        Ok(Self { degree, knots, points })
    }

    /// Returns the spans with a positive length, with their ends.
    pub fn spans(&self) -> Vec<(usize, [f64; 2])> {
        let ends = |k: usize| [self.knots[k], self.knots[k + 1]];
        let spans = (self.degree..self.points.len()).map(|k| (k, ends(k)));
        spans.filter(|(_, [a, b])| a < b).collect()
    }

    /// Returns the first and last parameter.
    fn domain(&self) -> [f64; 2] {
        [self.knots[self.degree], self.knots[self.points.len()]]
    }

    /// Returns the same curve with another range of its parameter.
    #[must_use]
    pub fn over(mut self, [first, last]: [f64; 2]) -> Self {
        let [a, b] = self.domain();
        self.knots.iter_mut().for_each(|k| *k = first + (*k - a) / (b - a) * (last - first));
        self
    }

    /// Reverses the direction.
    #[must_use]
    pub fn reversed(mut self) -> Self {
        let [a, b] = self.domain();
        self.points.reverse();
        self.knots = self.knots.iter().rev().map(|k| a + b - k).collect();
        self
    }

    /// Returns the first and last point.
    pub fn ends(&self) -> [[f64; 3]; 2] {
        let spans = self.spans();
        let end = |k: usize, side: usize| {
            let (span, range) = spans[k];
            self.at(span, Taylor::constant(range[side])).map(|x| x.value.middle())
        };
        [end(0, 0), end(spans.len() - 1, 1)]
    }

    /// Returns whether all its numbers are finite.
    pub fn is_finite(&self) -> bool {
        self.knots.iter().chain(self.points.iter().flatten()).all(|x| x.is_finite())
    }

    /// Returns whether it lies at Z 0.
    pub fn is_plane(&self) -> bool {
        self.points.iter().all(|[_, _, z, _]| *z == 0.0)
    }

    /// Evaluates the coordinates at a parameter of a span.
    pub fn at(&self, span: usize, t: Taylor) -> [Taylor; 3] {
        let degree = self.degree;
        let mut points: Vec<[Taylor; 4]> =
            (0..=degree).map(|j| self.points[j + span - degree].map(Taylor::constant)).collect();
        for level in 1..=degree {
            for j in (level..=degree).rev() {
                let low = self.knots[j + span - degree];
                let high = self.knots[j + 1 + span - level];
                let share = (t - Taylor::constant(low)) * (1.0 / (high - low));
                points[j] = std::array::from_fn(|k| {
                    points[j - 1][k] + (points[j][k] - points[j - 1][k]) * share
                });
            }
        }
        let [x, y, z, w] = points[degree];
        match w.as_constant() {
            Some(1.0) => [x, y, z],
            _ => [x / w, y / w, z / w],
        }
    }
}

/// Returns clamped knots from 0 to 1.
fn clamped(degree: usize, count: usize) -> Vec<f64> {
    let spans = count - degree;
    let knot = |k: usize| (k.saturating_sub(degree).min(spans)) as f64 / spans as f64;
    (0..count + degree + 1).map(knot).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use machine::proof::interval::Interval;
    use std::f64::consts::FRAC_1_SQRT_2;

    /// Rounding of some ten operations with numbers up to 10.
    const ROUNDING: f64 = 1e-13;

    fn point(t: f64) -> Taylor {
        Taylor::variable(Interval::point(t), 0)
    }

    #[test]
    fn a_rational_quadratic_is_a_quarter_of_a_circle() {
        let points = [[10.0, 0.0, 3.0], [10.0, 10.0, 3.0], [0.0, 10.0, 3.0]];
        let spline = Spline::new(2, &points, Some(&[1.0, FRAC_1_SQRT_2, 1.0]), None).unwrap();
        assert_eq!(spline.spans(), [(2, [0.0, 1.0])]);
        for k in 0..=10 {
            let [x, y, z] = spline.at(2, point(f64::from(k) / 10.0));
            let (a, b) = (x.value.middle(), y.value.middle());
            let off = (a.hypot(b) - 10.0).abs().max((z.value.middle() - 3.0).abs());
            assert!(off < ROUNDING, "{off}");
            // Tangents are perpendicular to radii.
            assert!((a * x.first().middle() + b * y.first().middle()).abs() < 1e-12);
        }
    }

    #[test]
    fn a_spline_begins_and_ends_at_its_end_points_and_has_two_derivatives_at_its_knots() {
        let points: Vec<[f64; 3]> =
            (0..7).map(|k| [f64::from(k), f64::from(k * k % 5), f64::from(3 - k % 3)]).collect();
        let spline = Spline::new(3, &points, None, None).unwrap();
        let spans = spline.spans();
        assert_eq!(spans.len(), 4);
        let ends = [(0, 0), (spans.len() - 1, 6)];
        for (span, end) in ends {
            let at = spline.at(spans[span].0, point(if span == 0 { 0.0 } else { 1.0 }));
            assert!((0..3).all(|k| at[k].value.contains(points[end][k])), "{at:?}");
        }
        for pair in spans.windows(2) {
            let [before, after] = [0, 1].map(|k| spline.at(pair[k].0, point(pair[1].1[0])));
            for (a, b) in before.iter().zip(after) {
                assert!((a.value.middle() - b.value.middle()).abs() < 1e-13);
                assert!((a.first().middle() - b.first().middle()).abs() < 1e-12);
                assert!((a.second().middle() - b.second().middle()).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn a_spline_turned_around_over_another_range_is_the_same_curve() {
        let points = [[0.0; 3], [1.0, 4.0, 2.0], [3.0, -1.0, 0.0], [6.0, 2.0, 1.0]];
        let knots = vec![0.0, 0.0, 0.0, 0.3, 1.0, 1.0, 1.0];
        let weights = [1.0, 2.0, 0.5, 1.0];
        let spline = Spline::new(2, &points, Some(&weights), Some(knots)).unwrap();
        let turned = spline.clone().reversed().over([4.0, 5.0]);
        assert_eq!(turned.ends(), [points[3], points[0]]);
        let value = |spline: &Spline, t: f64| {
            let (span, _) = spline.spans().into_iter().find(|(_, [_, b])| t <= *b).unwrap();
            spline.at(span, point(t)).map(|x| x.value.middle())
        };
        for k in 0..=10 {
            let t = f64::from(k) / 10.0;
            let (a, b) = (value(&spline, t), value(&turned, 5.0 - t));
            for k in 0..3 {
                assert!((a[k] - b[k]).abs() < ROUNDING, "{t}: {a:?} {b:?}");
            }
        }
    }

    #[test]
    fn an_invalid_spline_is_refused() {
        let points = [[0.0; 3], [1.0; 3], [2.0; 3], [3.0; 3]];
        let of = |degree, weights: Option<&[f64]>, knots| {
            Spline::new(degree, &points, weights, knots).unwrap_err()
        };
        assert_eq!(of(0, None, None), SplineError::Degree);
        assert_eq!(of(4, None, None), SplineError::Points { degree: 4, points: 4 });
        assert_eq!(
            of(1, None, Some(vec![0.0, 1.0])),
            SplineError::Knots { expected: 6, points: 4, found: 2 }
        );
        let knots = vec![0.0, 0.0, 2.0, 1.0, 3.0, 3.0];
        assert_eq!(of(1, None, Some(knots)), SplineError::Order(4));
        let knots = vec![0.0, 0.0, 1.0, 1.0, 2.0, 2.0];
        assert_eq!(of(1, None, Some(knots)), SplineError::Gap(1.0));
        let knots = vec![2.0; 6];
        assert_eq!(of(1, None, Some(knots)), SplineError::NoRange(2.0));
        assert_eq!(of(3, Some(&[1.0; 3]), None), SplineError::Weights { points: 4, found: 3 });
        let weights = [1.0, 0.0, 1.0, 1.0];
        assert_eq!(of(1, Some(&weights), None), SplineError::Weight { point: 2, value: 0.0 });
    }
}
