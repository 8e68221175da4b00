// SPDX-License-Identifier: GPL-2.0-or-later
//! Continuation of the curve that two families define, from a start point, with every step proved.
//!
//! Pseudo-arclength in (x, y, w), w being t in units of its range: a step follows the tangent
//! T = ∇α × ∇β, and Newton steps return to the curve in the plane perpendicular to it. A step is accepted
//! only if Krawczyk's operator proves that the curve over the chord is unique and has one tangent, so
//! no step can change to another branch, and none can pass a singular point.

use crate::base::{Form, Part};
use crate::expression::Trouble;
use crate::implicit::{Chord, Families};
use machine::proof::interval::Interval;
use nalgebra::Vector3;
use std::sync::Arc;

/// First step, as a share of the size of the start point.
const FIRST: f64 = 1e-3;
/// Smallest step, as the same share: below it the curve has no unique tangent.
const LEAST: f64 = 1e-9;
/// Cosine of the largest turn of the tangent in a step, 15 degrees.
const MOST_TURN: f64 = 0.965_925_826_289_068_3;
/// The step grows if the tangent has turned by less than a third of that.
const LITTLE_TURN: f64 = 0.996_194_698_091_745_5;
/// Number of Newton steps for a good prediction.
const FEW: usize = 4;
/// Steps after which a curve counts as endless.
const STEPS: usize = 200_000;
/// Distance, as a multiple of the size of the start point, beyond which a curve counts as endless.
const FARTHEST: f64 = 1e6;
const BISECTIONS: usize = 200;

/// A maximum or minimum of t along the curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turning {
    /// x and y, mm.
    pub at: [f64; 2],
    pub t: f64,
}

/// Start, range and bounds of a continuation.
#[derive(Clone, Debug)]
pub struct Wanted {
    /// x and y near the start, mm.
    pub start: [f64; 2],
    /// t at the start and at the end; `None` if the start determines t, and the order of the families the direction.
    pub t: Option<[f64; 2]>,
    /// Smallest and largest t along the curve.
    pub bounds: [f64; 2],
    /// Whether a turning point of t ends the curve.
    pub stops_at_turning: bool,
}

/// Result of a continuation.
#[derive(Clone, Debug)]
pub struct Trace {
    pub parts: Vec<Part>,
    /// Turning points of t.
    pub turnings: Vec<Turning>,
    /// Whether it returns to its start.
    pub is_closed: bool,
    /// x and y of the start, mm.
    pub start: [f64; 2],
}

/// Why a curve cannot be followed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TraceError {
    #[error("near x {:.6} y {:.6} t {t:.6}: {trouble}", .at[0], .at[1])]
    Trouble { at: [f64; 2], t: f64, trouble: Trouble },
    #[error("the families have no real branch near start_mm [{}, {}] at t = {t}: use a start on both curves", .at[0], .at[1])]
    NoBranch { at: [f64; 2], t: f64 },
    #[error("singular point near x {:.6} y {:.6} t {t:.6}: the curves of both families touch, or branches cross; end the range of t before it, or choose another start", .at[0], .at[1])]
    Singular { at: [f64; 2], t: f64 },
    #[error("the curve does not end; it is at x {:.6} y {:.6} t {t:.6}: set the range of t, t_bounds or length_mm", .at[0], .at[1])]
    Endless { at: [f64; 2], t: f64 },
}

/// The state of a continuation.
struct Walk<'a> {
    families: &'a Arc<Families>,
    wanted: &'a Wanted,
    size: f64,
    trace: Trace,
}

/// Follows the curve; after the length `most` in x and y it may end.
///
/// # Errors
/// See [`TraceError`].
pub fn trace(families: &Arc<Families>, wanted: &Wanted, most: f64) -> Result<Trace, TraceError> {
    let trace = Trace { parts: vec![], turnings: vec![], is_closed: false, start: wanted.start };
    let [x, y] = wanted.start;
    let guess = Vector3::new(x, y, wanted.t.map_or(x, |t| t[0]) / families.t_unit);
    let size = 1.0 + guess.xy().amax();
    let mut walk = Walk { families, wanted, size, trace };
    let (start, tangent) = walk.begin(guess)?;
    walk.trace.start = [start.x, start.y];
    walk.follow(start, tangent, most)?;
    Ok(walk.trace)
}

impl Walk<'_> {
    fn place(&self, point: &Vector3<f64>) -> ([f64; 2], f64) {
        ([point.x, point.y], point.z * self.families.t_unit)
    }

    fn trouble(&self, point: &Vector3<f64>) -> impl Fn(Trouble) -> TraceError + use<> {
        let (at, t) = self.place(point);
        move |trouble| TraceError::Trouble { at, t, trouble }
    }

    fn singular(&self, point: &Vector3<f64>) -> TraceError {
        let (at, t) = self.place(point);
        TraceError::Singular { at, t }
    }

    /// Returns the point of the curve at the start's t, and the tangent along which t goes towards its end.
    fn begin(&self, guess: Vector3<f64>) -> Result<(Vector3<f64>, Vector3<f64>), TraceError> {
        let Some([t, end]) = self.wanted.t else { return self.begin_nearby(guess) };
        let no_branch = TraceError::NoBranch { at: self.wanted.start, t };
        let trouble = self.trouble(&guess);
        let found = self.families.in_plane(guess, &Vector3::z(), guess.z).map_err(&trouble)?;
        let start = match found {
            Some((start, _)) => start,
            // At a turning point of t the plane does not intersect the curve; the guess may lie on it.
            None if self.is_on(&guess).map_err(&trouble)? => guess,
            None => return Err(no_branch),
        };
        let tangent = self.tangent(&start)?;
        let forward = tangent.z * (end - t) >= 0.0;
        Ok((start, if forward { tangent } else { -tangent }))
    }

    /// Returns the point of the curve in the plane across its direction at the guess, and the tangent there.
    fn begin_nearby(
        &self,
        guess: Vector3<f64>,
    ) -> Result<(Vector3<f64>, Vector3<f64>), TraceError> {
        let across = self.tangent(&guess)?;
        let found = self.families.in_plane(guess, &across, across.dot(&guess));
        let (start, _) = found.map_err(self.trouble(&guess))?.ok_or_else(|| {
            let (at, t) = self.place(&guess);
            TraceError::NoBranch { at, t }
        })?;
        Ok((start, self.tangent(&start)?))
    }

    fn is_on(&self, point: &Vector3<f64>) -> Result<bool, Trouble> {
        let (values, gradients) = self.families.at(point)?;
        let is_zero =
            |(value, row): (f64, Vector3<f64>)| value.abs() <= 1e-12 * self.size * row.norm();
        Ok(values.into_iter().zip(gradients).all(is_zero))
    }

    fn tangent(&self, point: &Vector3<f64>) -> Result<Vector3<f64>, TraceError> {
        let (_, [a, b]) = self.families.at(point).map_err(self.trouble(point))?;
        let across = a.cross(&b);
        match across.norm() > LEAST * a.norm() * b.norm() {
            true => Ok(across.normalize()),
            false => Err(self.singular(point)),
        }
    }

    fn follow(
        &mut self,
        start: Vector3<f64>,
        tangent: Vector3<f64>,
        most: f64,
    ) -> Result<(), TraceError> {
        let (mut point, mut direction, mut step) = (start, tangent, FIRST * self.size);
        let mut length = 0.0;
        for _ in 0..STEPS {
            let (next, turned) = self.step(&point, &direction, &mut step)?;
            if self.comes_back(&start, &tangent, &point, &next) {
                let part = self.proved(&point, &start).map_err(self.trouble(&point))?;
                let part = part.ok_or_else(|| self.singular(&point))?;
                self.ends(part, &direction, &tangent);
                self.trace.is_closed = true;
                return Ok(());
            }
            let part = self.proved(&point, &next).map_err(self.trouble(&point))?;
            let Some(part) = part else {
                step *= 0.5;
                if step < LEAST * self.size {
                    return Err(self.singular(&point));
                }
                continue;
            };
            if self.ends(part, &direction, &turned) {
                return Ok(());
            }
            length += (next - point).xy().norm();
            if length >= most {
                return Ok(());
            }
            if next.xy().amax() > FARTHEST * self.size {
                break;
            }
            if direction.dot(&turned) > LITTLE_TURN {
                step *= 1.5;
            }
            (point, direction) = (next, turned);
        }
        let (at, t) = self.place(&point);
        Err(TraceError::Endless { at, t })
    }

    /// Steps along the tangent and back to the curve, with the largest acceptable step.
    fn step(
        &self,
        point: &Vector3<f64>,
        direction: &Vector3<f64>,
        step: &mut f64,
    ) -> Result<(Vector3<f64>, Vector3<f64>), TraceError> {
        loop {
            let guess = point + direction * *step;
            // If an expression has no value beyond the curve's end, a shorter step may have one.
            let found = self.families.in_plane(guess, direction, direction.dot(&guess));
            if let Ok(Some((next, steps))) = &found
                && *steps <= FEW
                && let Ok(tangent) = self.tangent(next)
            {
                let turned = if tangent.dot(direction) < 0.0 { -tangent } else { tangent };
                if turned.dot(direction) > MOST_TURN {
                    return Ok((*next, turned));
                }
            }
            *step *= 0.5;
            if *step < LEAST * self.size {
                found.map_err(self.trouble(point))?;
                return Err(self.singular(point));
            }
        }
    }

    /// Returns the part between two points of the curve, if it is proved to be unique.
    fn proved(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> Result<Option<Part>, Trouble> {
        let (chord, length) = Chord::between(*from, *to);
        let proof = chord.at(self.families, Interval::new(0.0, length))?;
        let form = Form::Implicit(self.families.clone(), chord);
        Ok(proof.map(|_| Part { form, range: [0.0, length] }))
    }

    /// Returns whether the curve passes its start between two points.
    fn comes_back(
        &self,
        start: &Vector3<f64>,
        tangent: &Vector3<f64>,
        point: &Vector3<f64>,
        next: &Vector3<f64>,
    ) -> bool {
        let before = tangent.dot(&(point - start));
        let after = tangent.dot(&(next - start));
        let length = (next - point).norm();
        let aside = (start - point).cross(&(next - point)).norm() / length;
        // The start is no farther from the chord than the curve is.
        before < 0.0 && after >= 0.0 && aside < 0.1 * length && self.trace.parts.len() > 2
    }

    /// Adds a part; returns whether the curve ends in it.
    fn ends(&mut self, mut part: Part, before: &Vector3<f64>, after: &Vector3<f64>) -> bool {
        let turning = (before.z * after.z < 0.0).then(|| self.turning(&part));
        let stop = turning.filter(|_| self.wanted.stops_at_turning);
        part.range[1] = stop.unwrap_or(part.range[1]);
        let bound = self.bound(&part, turning);
        part.range[1] = bound.unwrap_or(part.range[1]);
        if let Some(turning) = turning.filter(|at| *at <= part.range[1]) {
            self.note_turning(&part, turning);
        }
        self.trace.parts.push(part);
        bound.is_some() || stop.is_some()
    }

    fn note_turning(&mut self, part: &Part, at: f64) {
        let found = self.at(part, at);
        self.trace.turnings.extend(found);
    }

    fn at(&self, part: &Part, at: f64) -> Option<Turning> {
        let place = part.at(Interval::point(at)).ok().flatten()?;
        let [x, y, _] = place.at.map(|x| x.value.middle());
        Some(Turning { at: [x, y], t: place.t.value.middle() })
    }

    /// Returns the parameter at which dt changes its sign within a part whose ends have different signs.
    fn turning(&self, part: &Part) -> f64 {
        let slope = |at: f64| {
            let place = part.at(Interval::point(at)).ok().flatten();
            place.map_or(f64::NAN, |place| place.t.first().middle())
        };
        let rises = slope(part.range[0]) > 0.0;
        bisected(part.range, |at| (slope(at) > 0.0) == rises)
    }

    /// Returns the parameter at which t first leaves its bounds within a part with at most one turning point.
    fn bound(&self, part: &Part, turning: Option<f64>) -> Option<f64> {
        let [low, high] = self.wanted.bounds;
        // Tolerance for rounding of t where it only touches a bound.
        let room = 1e-12 * self.families.t_unit;
        let inside = |at: f64| {
            self.at(part, at).is_some_and(|found| (low - room..=high + room).contains(&found.t))
        };
        let [start, end] = part.range;
        let outside = turning.into_iter().chain([end]).find(|at| *at <= end && !inside(*at))?;
        Some(bisected([start, outside], inside))
    }
}

/// Returns the value in a range up to which a condition is true.
fn bisected([mut low, mut high]: [f64; 2], holds: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        *(if holds(middle) { &mut low } else { &mut high }) = middle;
    }
    low
}
