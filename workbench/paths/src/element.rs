// SPDX-License-Identifier: GPL-2.0-or-later
//! Elements of drawings: splines and elliptical arcs, without approximation.

use crate::base::{Form, Part};
use crate::ellipse::Ellipse;
use crate::spline::{Spline, SplineError};
use nalgebra::Vector3;
use std::sync::Arc;

/// One curve of a drawing, mm; t goes from 0 to 1 along it.
#[derive(Clone, Debug, PartialEq)]
pub enum Element {
    /// A line, a Bézier curve, or another rational spline.
    Spline(Spline),
    Ellipse(Ellipse),
}

impl Element {
    /// Creates a Bézier curve; with two points a line.
    ///
    /// # Errors
    /// Fewer than two points.
    pub fn bezier(points: &[Vector3<f64>]) -> Result<Self, SplineError> {
        let points: Vec<[f64; 3]> = points.iter().map(|p| [p.x, p.y, p.z]).collect();
        Ok(Self::Spline(Spline::new(points.len() - 1, &points, None, None)?))
    }

    /// Returns the first and last point.
    pub fn ends(&self) -> [Vector3<f64>; 2] {
        match self {
            Self::Spline(spline) => spline.ends().map(Vector3::from),
            Self::Ellipse(ellipse) => ellipse.ends(),
        }
    }

    /// Reverses the direction.
    #[must_use]
    pub fn reversed(self) -> Self {
        match self {
            Self::Spline(spline) => Self::Spline(spline.reversed()),
            Self::Ellipse(ellipse) => Self::Ellipse(ellipse.reversed()),
        }
    }

    /// Returns whether all its numbers are finite.
    pub fn is_finite(&self) -> bool {
        match self {
            Self::Spline(spline) => spline.is_finite(),
            Self::Ellipse(ellipse) => {
                let [u, v] = ellipse.halves;
                let vectors = [ellipse.centre, u, v];
                vectors.iter().flatten().chain(&ellipse.angles).all(|x| x.is_finite())
            }
        }
    }

    /// Returns whether it lies at Z 0.
    pub fn is_plane(&self) -> bool {
        match self {
            Self::Spline(spline) => spline.is_plane(),
            Self::Ellipse(ellipse) => {
                let [u, v] = ellipse.halves;
                [ellipse.centre, u, v].iter().all(|vector| vector.z == 0.0)
            }
        }
    }

    /// Splits the element into parts, with t over a range.
    fn parts(self, over: [f64; 2]) -> Vec<Part> {
        match self {
            Self::Spline(spline) => spans(spline.over(over)),
            Self::Ellipse(ellipse) => {
                vec![Part { form: Form::Ellipse(Ellipse { over, ..ellipse }), range: over }]
            }
        }
    }
}

/// Returns the parts of a drawing: t goes from k to k + 1 along element k, starting at 0.
pub fn parts(elements: Vec<Element>) -> Vec<Part> {
    let with_t = elements.into_iter().enumerate();
    with_t.flat_map(|(k, element)| element.parts([k as f64, (k + 1) as f64])).collect()
}

/// Returns the spans of a spline, with the spline's own parameter.
pub fn spans(spline: Spline) -> Vec<Part> {
    let spans = spline.spans();
    let spline = Arc::new(spline);
    let part = |(span, range)| Part { form: Form::Spline(spline.clone(), span), range };
    spans.into_iter().map(part).collect()
}
