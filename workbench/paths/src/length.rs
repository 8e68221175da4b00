// SPDX-License-Identifier: GPL-2.0-or-later
//! Arc length by Gauss-Legendre quadrature, and the parameter at a length by Newton's method.

use crate::base::{Form, Part};
use crate::expression::Trouble;

/// Nodes and weights of the ten-point rule on −1 to 1, one half of them.
const RULE: [[f64; 2]; 5] = [
    [0.148_874_338_981_631_2, 0.295_524_224_714_752_87],
    [0.433_395_394_129_247_2, 0.269_266_719_309_996_35],
    [0.679_409_568_299_024_4, 0.219_086_362_515_982_04],
    [0.865_063_366_688_984_5, 0.149_451_349_150_580_6],
    [0.973_906_528_517_171_7, 0.066_671_344_308_688_14],
];
/// Error of an integral, as a share of the whole, or in mm if it is shorter than 1 mm: some
/// roundings of a point of the curve. For a parameter far from 0, its rounding adds more.
const ERROR: f64 = 1e-13;
/// Halvings: a kink of the speed (a cusp) is enclosed to 1e-12 of the range, and contributes the square of
/// that.
const HALVINGS: u32 = 40;
/// Number of nodes at which lengths are stored.
const NODES: usize = 64;
/// Largest number of Newton steps to a length.
const NEWTON: usize = 60;

fn rule(part: &Part, [a, b]: [f64; 2]) -> Result<f64, Trouble> {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    let mut sum = 0.0;
    for [place, weight] in RULE {
        sum += weight * (part.speed(middle - half * place)? + part.speed(middle + half * place)?);
    }
    Ok(half * sum)
}

/// Returns the relative error of an integral due to rounding of the ends of its range.
fn rounding(a: f64, b: f64) -> f64 {
    f64::EPSILON * (a.abs() + b.abs()) / (b - a).abs()
}

/// Integrates over a range to within an error by halving; one rule over the range gives `whole`.
fn halved(
    part: &Part,
    [a, b]: [f64; 2],
    whole: f64,
    error: f64,
    left: u32,
) -> Result<f64, Trouble> {
    let middle = 0.5 * (a + b);
    let halves = [rule(part, [a, middle])?, rule(part, [middle, b])?];
    let sum = halves[0] + halves[1];
    // Near a pole a part of the range is longer than the whole seemed to be. The same relative error is then
    // sufficient, and an error below rounding is unreachable.
    let enough = error.max(sum.abs() * ERROR.max(rounding(a, b)));
    if left == 0 || !((sum - whole).abs() > enough) {
        return Ok(sum);
    }
    let [first, second] = halves;
    Ok(halved(part, [a, middle], first, error, left - 1)?
        + halved(part, [middle, b], second, error, left - 1)?)
}

/// Returns the length of a part between two parameters.
pub(super) fn between(part: &Part, range: [f64; 2]) -> Result<f64, Trouble> {
    if range[0] == range[1] {
        return Ok(0.0);
    }
    let whole = rule(part, range)?;
    halved(part, range, whole, ERROR * whole.abs().max(1.0), HALVINGS)
}

/// Lengths of a part at nodes of its range.
#[derive(Clone, Debug)]
pub struct Lengths {
    /// Parameters, and the lengths from the curve's start.
    nodes: Vec<[f64; 2]>,
}

impl Lengths {
    /// Computes the lengths of a part that begins at a length.
    pub(super) fn of(part: &Part, start: f64) -> Result<Self, Trouble> {
        let [a, b] = part.range;
        let count = if matches!(part.form, Form::Implicit(..)) { 1 } else { NODES };
        let mut nodes = vec![[a, start]];
        for k in 1..=count {
            let [last, length] = nodes[k - 1];
            let next = if k == count { b } else { a + (b - a) * k as f64 / count as f64 };
            nodes.push([next, length + between(part, [last, next])?]);
        }
        Ok(Self { nodes })
    }

    pub(super) fn end(&self) -> f64 {
        self.nodes[self.nodes.len() - 1][1]
    }

    pub(super) fn at(&self, part: &Part, at: f64) -> Result<f64, Trouble> {
        let next = self.nodes.partition_point(|node| node[0] <= at).clamp(1, self.nodes.len() - 1);
        let [from, length] = self.nodes[next - 1];
        Ok(length + between(part, [from, at])?)
    }

    pub(super) fn parameter(&self, part: &Part, length: f64) -> Result<f64, Trouble> {
        let next = self.nodes.partition_point(|node| node[1] < length);
        let next = next.clamp(1, self.nodes.len() - 1);
        let ([mut low, _], [mut high, _]) = (self.nodes[next - 1], self.nodes[next]);
        let mut at = 0.5 * (low + high);
        for _ in 0..NEWTON {
            let error = self.at(part, at)? - length;
            *(if error > 0.0 { &mut high } else { &mut low }) = at;
            let newton = at - error / part.speed(at)?;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - at).abs() <= 1e-15 * (1.0 + at.abs()) {
                return Ok(next);
            }
            at = next;
        }
        Ok(at)
    }
}
