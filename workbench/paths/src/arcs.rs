// SPDX-License-Identifier: GPL-2.0-or-later
//! Arcs, flat or helical, with a proved distance from a curve.

use crate::piece::{Arc, Piece, ROUNDING, Wanted, speed_change};
use crate::planes::PLANES;
use crate::whole::{Curve, CurveError};
use machine::proof::interval::Interval;
use machine::proof::jet::Taylor;
use std::f64::consts::PI;

/// Largest turn of one arc: an arc whose ends are near each other may be mistaken for a short one.
const MOST_TURN: f64 = 1.5 * PI;
/// Largest radius, mm: larger arcs are written as lines.
const MOST_RADIUS: f64 = 1e4;
/// Halvings of the range of an arc in its proof.
const HALVINGS: u32 = 12;
/// Factor between the lengths of two trials.
const GROWTH: f64 = 1.5;
/// Rounding of LinuxCNC's arcs: the end and the center have separate words, and the radius is
/// that of the start.
const ARC_ROUNDING: f64 = 3.0 * ROUNDING;

/// Returns the longest arc from the start of a line, if there is one longer than the line.
pub(super) fn longest(
    curve: &Curve,
    part: usize,
    line: &Piece,
    end: f64,
    length: &mut f64,
    wanted: &Wanted,
) -> Result<Option<Piece>, CurveError> {
    let from = line.range[0];
    let shortest = GROWTH * (line.range[1] - from);
    let mut best = None;
    let mut tooth = length.max(shortest);
    loop {
        let to = if from + tooth >= end { end } else { from + tooth };
        let found = arc(curve, part, [from, to], wanted)?;
        let is_good = found.is_some();
        best = found.or(best);
        match (is_good, best.is_some()) {
            (true, _) if to < end => tooth *= GROWTH,
            (false, false) if tooth > shortest => tooth = shortest.max(tooth / GROWTH),
            _ => break,
        }
    }
    // An arc is used only if it is longer than the line.
    let best = best.filter(|arc: &Piece| arc.range[1] > line.range[1]);
    *length = best.as_ref().map_or(shortest, |arc| arc.range[1] - from);
    Ok(best)
}

/// Returns the arc over a range, if it is near enough to the curve.
fn arc(
    curve: &Curve,
    part: usize,
    range: [f64; 2],
    wanted: &Wanted,
) -> Result<Option<Piece>, CurveError> {
    let [from, to] = range;
    let places = [from, 0.5 * (from + to), to];
    let mut poses = [[0.0; 6]; 3];
    for (pose, at) in poses.iter_mut().zip(places) {
        *pose = curve.at(part, at)?.pose.map(|x| x.value.middle());
    }
    for plane in 0..PLANES.len() {
        let Some(near) = Near::through(plane, &poses) else { continue };
        let allowed = wanted.chord - ARC_ROUNDING;
        let is_steady = speed_change(curve, part, range)? <= 1.0;
        if allowed > 0.0 && is_steady && near.holds(curve, part, range, allowed, HALVINGS)? {
            let arc = Some(near.arc());
            return Ok(Some(Piece { part, range, from: None, arc, deviation: wanted.chord }));
        }
    }
    Ok(None)
}

/// An arc through three points.
struct Near {
    plane: usize,
    centre: [f64; 2],
    radius: f64,
    /// Direction of the middle of the arc, from which angles are measured.
    middle: [f64; 2],
    /// Position along the axis of the arc: at the middle, and its rate by the angle.
    across: [f64; 2],
    /// Angle of the whole arc, signed.
    turn: f64,
    /// Tilt angles, which are constant along an arc.
    angles: [f64; 3],
}

impl Near {
    fn through(plane: usize, poses: &[[f64; 6]; 3]) -> Option<Self> {
        let [first, second, across] = PLANES[plane];
        let [a, b, c] = poses.map(|pose| [pose[first], pose[second]]);
        let (u, v) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
        let area = 2.0 * (u[0] * v[1] - u[1] * v[0]);
        let (uu, vv) = (u[0] * u[0] + u[1] * u[1], v[0] * v[0] + v[1] * v[1]);
        let centre = [a[0] + (v[1] * uu - u[1] * vv) / area, a[1] + (u[0] * vv - v[0] * uu) / area];
        let radius = (a[0] - centre[0]).hypot(a[1] - centre[1]);
        if !(radius < MOST_RADIUS && radius > 10.0 * ROUNDING) {
            return None;
        }
        let middle = [(b[0] - centre[0]) / radius, (b[1] - centre[1]) / radius];
        let angle = |p: [f64; 2]| {
            let (x, y) = (p[0] - centre[0], p[1] - centre[1]);
            (y * middle[0] - x * middle[1]).atan2(x * middle[0] + y * middle[1])
        };
        let turn = angle(c) - angle(a);
        let rise = (poses[2][across] - poses[0][across]) / turn;
        let level = poses[0][across] - rise * angle(a);
        let good = turn.abs() < MOST_TURN && turn.abs() > 1e-3 && angle(a) * angle(c) < 0.0;
        let angles = [poses[0][3], poses[0][4], poses[0][5]];
        good.then_some(Self { plane, centre, radius, middle, across: [level, rise], turn, angles })
    }

    fn arc(&self) -> Arc {
        let length = self.turn.abs() * self.radius.hypot(self.across[1]);
        Arc { plane: self.plane, centre: self.centre, is_left: self.turn > 0.0, length }
    }

    /// Returns whether the curve stays within `allowed` of the arc and follows it monotonically.
    fn holds(
        &self,
        curve: &Curve,
        part: usize,
        [from, to]: [f64; 2],
        allowed: f64,
        left: u32,
    ) -> Result<bool, CurveError> {
        let whole = curve.over(part, Interval::new(from, to))?;
        let middle = curve.at(part, 0.5 * (from + to))?;
        let half = 0.5 * (to - from);
        if let Some(whole) = whole {
            let [radial, axial, angle] = self.errors(&whole.pose);
            let [radial_at, axial_at, _] = self.errors(&middle.pose);
            let most = |at: Taylor, over: Taylor| {
                at.value.magnitude()
                    + at.first().magnitude() * half
                    + 0.5 * over.second().magnitude() * half * half
            };
            let error = most(radial_at, radial).hypot(most(axial_at, axial));
            let goes_on = match self.turn > 0.0 {
                true => angle.first().low > 0.0,
                false => angle.first().high < 0.0,
            };
            if error <= allowed && goes_on && self.keeps_angles(&whole.pose) {
                return Ok(true);
            }
            if radial_at.value.magnitude().hypot(axial_at.value.magnitude()) > allowed {
                return Ok(false);
            }
        }
        let middle = 0.5 * (from + to);
        Ok(left > 0
            && self.holds(curve, part, [from, middle], allowed, left - 1)?
            && self.holds(curve, part, [middle, to], allowed, left - 1)?)
    }

    /// Returns the deviations from the arc, radial in its plane and along its axis, and the angle.
    fn errors(&self, pose: &[Taylor; 6]) -> [Taylor; 3] {
        let [first, second, across] = PLANES[self.plane];
        let x = pose[first] - Taylor::constant(self.centre[0]);
        let y = pose[second] - Taylor::constant(self.centre[1]);
        let (c, s) = (self.middle[0], self.middle[1]);
        let angle = Taylor::angle(&(y * c - x * s), &(x * c + y * s));
        let radial = (x.squared() + y.squared()).sqrt() - Taylor::constant(self.radius);
        let axial = pose[across] - Taylor::constant(self.across[0]) - angle * self.across[1];
        [radial, axial, angle]
    }

    fn keeps_angles(&self, pose: &[Taylor; 6]) -> bool {
        let error = |k: usize| (pose[3 + k].value - Interval::point(self.angles[k])).magnitude();
        (0..3).all(|k| error(k) <= ROUNDING)
    }
}
