// SPDX-License-Identifier: GPL-2.0-or-later
//! Approximation of a curve by straight moves and arcs with a proved distance.
//!
//! Over a range Δ of its parameter a curve deviates from its chord by at most Δ²/8 · max |r″|; the largest
//! r″ is enclosed by interval arithmetic. The same holds for angles. An arc is proved by the distance
//! from its center, enclosed to second order over halves of the range.

use crate::arcs;
use crate::file::Moves;
use crate::piece::{Piece, ROUNDING, Wanted, speed_change};
use crate::whole::{Curve, CurveError};
use machine::proof::interval::Interval;

/// Number of subranges in which derivatives are enclosed.
const PARTS: usize = 8;
/// Share of the tolerance above which a piece is long enough: a longer one would gain little.
const GAIN: f64 = 0.9985;
/// Number of points of a part at which the speed is checked first.
const SPEEDS: usize = 64;
/// Largest number of trials for the length of one piece.
const TRIALS: usize = 40;
/// Smallest piece, as a share of a part's range.
const LEAST: f64 = 1e-9;

/// Share of the tolerances that a range uses; 1 is all.
#[derive(Clone, Copy, Debug)]
struct Need {
    share: f64,
    deviation: f64,
}

/// Divides a curve into pieces.
///
/// # Errors
/// The curve has no value at some point, jumps, or its second derivative is unbounded there.
pub fn pieces(curve: &Curve, wanted: &Wanted) -> Result<Vec<Piece>, CurveError> {
    check_speed(curve)?;
    let mut all = vec![];
    for part in 0..curve.parts.len() {
        let [mut from, end] = curve.parts[part].range;
        let mut length = (end - from) / 4.0;
        let mut arc_length = length;
        while from < end {
            let line = longest(curve, part, from, end, &mut length, wanted)?;
            let arc = match wanted.moves {
                Moves::Arcs => arcs::longest(curve, part, &line, end, &mut arc_length, wanted)?,
                Moves::Lines => None,
            };
            let piece = arc.unwrap_or(line);
            from = piece.range[1];
            all.push(piece);
        }
    }
    Ok(all)
}

/// Refuses a speed of 0, near which pieces would become infinitely short.
fn check_speed(curve: &Curve) -> Result<(), CurveError> {
    for (part, own) in curve.parts.iter().enumerate() {
        let [from, to] = own.range;
        for k in 0..=SPEEDS {
            curve.speed(part, from + (to - from) * k as f64 / SPEEDS as f64)?;
        }
    }
    Ok(())
}

/// Returns the longest line from a parameter; `length` is the first guess.
fn longest(
    curve: &Curve,
    part: usize,
    from: f64,
    end: f64,
    length: &mut f64,
    wanted: &Wanted,
) -> Result<Piece, CurveError> {
    let [first, last] = curve.parts[part].range;
    let mut best = None;
    let mut tooth = *length;
    for _ in 0..TRIALS {
        let to = if from + tooth * (1.0 + LEAST) >= end { end } else { from + tooth };
        let need = need(curve, part, [from, to], wanted)?;
        let Some(need) = need.filter(|need| need.share.is_finite()) else {
            tooth /= 4.0;
            if tooth < LEAST * (last - first) {
                return Err(unbounded(curve, part, from));
            }
            continue;
        };
        if need.share <= 1.0 {
            best = Some((to, need));
            if to == end || need.share > GAIN {
                break;
            }
        } else if best.is_some_and(|(_, need)| need.share > 0.9) {
            break;
        }
        tooth = (to - from) * (0.9997 / need.share.max(0.01).sqrt()).clamp(0.1, 4.0);
    }
    let (to, need) = best.ok_or_else(|| unbounded(curve, part, from))?;
    *length = to - from;
    Ok(Piece {
        part,
        range: [from, to],
        from: None,
        arc: None,
        deviation: need.deviation + ROUNDING,
    })
}

fn unbounded(curve: &Curve, part: usize, at: f64) -> CurveError {
    let t = curve.at(part, at).map_or(f64::NAN, |here| here.t.value.middle());
    CurveError::Keys(format!(
        "at t = {t}: the second derivative of the curve is unbounded, so no chord can be proved; end or \
         start the range of t before it"
    ))
}

/// Returns the proved deviation of a line over a range; `None` if the range cannot be enclosed.
pub(super) fn deviation(
    curve: &Curve,
    part: usize,
    range: [f64; 2],
    wanted: &Wanted,
) -> Result<Option<f64>, CurveError> {
    Ok(need(curve, part, range, wanted)?.map(|need| need.deviation))
}

/// Returns the share of the tolerances for a line over a range; `None` if the range cannot be enclosed.
fn need(
    curve: &Curve,
    part: usize,
    [from, to]: [f64; 2],
    wanted: &Wanted,
) -> Result<Option<Need>, CurveError> {
    let (mut place, mut angle, mut slopes) = (0.0_f64, 0.0_f64, [0.0_f64; 6]);
    for k in 0..PARTS {
        let at = |k: usize| from + (to - from) * k as f64 / PARTS as f64;
        let Some(here) = curve.over(part, Interval::new(at(k), at(k + 1)))? else {
            return Ok(None);
        };
        let bent = |k: usize| here.pose[k].second().magnitude();
        place = place.max((0..3).map(|k| bent(k).powi(2)).sum::<f64>().sqrt());
        angle = (3..6).map(bent).fold(angle, f64::max);
        for (slope, x) in slopes.iter_mut().zip(here.pose) {
            *slope = slope.max(x.first().magnitude());
        }
    }
    let sag = (to - from).powi(2) / 8.0;
    let deviation = sag * place;
    if !(deviation.is_finite() && angle.is_finite()) {
        return Ok(None);
    }
    check_jump(curve, part, [from, to], &slopes)?;
    let speed = speed_change(curve, part, [from, to])?;
    let share = (deviation / wanted.chord).max(sag * angle / wanted.angle).max(speed * speed);
    Ok(Some(Need { share, deviation }))
}

/// Refuses a value that changes by more than its derivative allows: it has jumped.
fn check_jump(
    curve: &Curve,
    part: usize,
    [from, to]: [f64; 2],
    slopes: &[f64; 6],
) -> Result<(), CurveError> {
    let (start, end) = (curve.at(part, from)?, curve.at(part, to)?);
    for (k, letter) in ["x", "y", "z", "A", "B", "C"].into_iter().enumerate() {
        let change = (end.pose[k].value.middle() - start.pose[k].value.middle()).abs();
        if change > (to - from) * slopes[k] * (1.0 + 1e-6) + ROUNDING {
            let t = start.t.value.middle();
            return Err(CurveError::Keys(format!("near t = {t}: {letter} jumps by {change}")));
        }
    }
    Ok(())
}
