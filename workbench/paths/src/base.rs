// SPDX-License-Identifier: GPL-2.0-or-later
//! Curves divided into parts, each over a range of its own parameter.

use crate::ellipse::Ellipse;
use crate::expression::{Expression, Trouble};
use crate::implicit::{Chord, Families};
use crate::spline::Spline;
use machine::proof::interval::Interval;
use machine::proof::jet::Taylor;
use std::sync::Arc;

/// Number of coordinates that contribute to the arc length of a family: x and y. For a curve in
/// space all three do.
pub(super) const PLANE: usize = 2;

/// Coordinates and the parameter t of a curve; z of a family is 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurveTaylor {
    /// x, y and z, mm.
    pub at: [Taylor; 3],
    /// The parameter.
    pub t: Taylor,
}

/// Representation of a part of a curve.
#[derive(Clone, Debug)]
pub enum Form {
    /// x = f(t), y = g(t), each with its drive's own parameter.
    Explicit(Arc<Explicit>),
    /// A curve defined by two families, over its chord.
    Implicit(Arc<Families>, Chord),
    Spline(Arc<Spline>, usize),
    /// An elliptical arc of a drawing.
    Ellipse(Ellipse),
}

/// x = f(t_X), y = g(t_Y), with t_X and t_Y functions of t.
#[derive(Clone, Debug)]
pub struct Explicit {
    /// f and g.
    pub both: [Expression; 2],
    /// t_X and t_Y.
    pub own: [Expression; 2],
}

impl Explicit {
    fn at(&self, t: Taylor) -> Result<[Taylor; 2], Trouble> {
        let of = |k: usize| self.both[k].at(&[self.own[k].at(&[t])?]);
        Ok([of(0)?, of(1)?])
    }

    /// Returns x and y at a parameter, if they have values.
    pub fn point(&self, t: f64) -> Option<[f64; 2]> {
        Some(self.at(Taylor::constant(t)).ok()?.map(|x| x.value.middle()))
    }
}

#[derive(Clone, Debug)]
pub struct Part {
    pub form: Form,
    /// First and last parameter.
    pub range: [f64; 2],
}

impl Part {
    /// Evaluates the curve over a range of the parameter; returns `None` if it cannot be enclosed, which may
    /// succeed over a shorter range.
    ///
    /// # Errors
    /// As [`Expression::at`].
    pub fn at(&self, over: Interval) -> Result<Option<CurveTaylor>, Trouble> {
        let zero = Taylor::constant(0.0);
        Ok(match &self.form {
            Form::Explicit(explicit) => {
                let t = Taylor::variable(over, 0);
                let [x, y] = explicit.at(t)?;
                Some(CurveTaylor { at: [x, y, zero], t })
            }
            Form::Implicit(families, chord) => {
                chord.at(families, over)?.map(|[x, y, t]| CurveTaylor { at: [x, y, zero], t })
            }
            Form::Spline(spline, span) => {
                let t = Taylor::variable(over, 0);
                Some(CurveTaylor { at: spline.at(*span, t), t })
            }
            Form::Ellipse(ellipse) => {
                let t = Taylor::variable(over, 0);
                Some(CurveTaylor { at: ellipse.at(t), t })
            }
        })
    }

    /// Returns the number of coordinates that contribute to the arc length.
    pub(super) fn dimensions(&self) -> usize {
        match self.form {
            Form::Spline(..) | Form::Ellipse(_) => PLANE + 1,
            Form::Explicit(_) | Form::Implicit(..) => PLANE,
        }
    }

    /// Returns the rate of the arc length at a point.
    pub(super) fn speed(&self, at: f64) -> Result<f64, Trouble> {
        let Some(place) = self.at(Interval::point(at))? else { return Ok(f64::NAN) };
        let squares = place.at[..self.dimensions()].iter().map(|x| x.first().middle().powi(2));
        Ok(squares.sum::<f64>().sqrt())
    }
}
