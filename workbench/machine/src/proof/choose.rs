// SPDX-License-Identifier: GPL-2.0-or-later
//! Finds the matrix M and the weights for which the proof of a box has the widest margin:
//! minimizes sup ‖1 − M J(X)‖ over samples of the box.
//!
//! The norm is convex in M. The largest value is smoothed, log Σ exp(p norm)/p with rising
//! p, and minimized by gradient descent (Adam). The result needs no guarantee here: the
//! prover checks it.

use crate::proof::one_to_one::{Doubt, LegRows, Matrix, Prover, steps_needed};
use crate::read::boxes::Claim;
use kinematics::{MAX_LEGS, WorkspaceBox};
use nalgebra::{SMatrix, Vector6};

/// Sampled poses besides the corners.
const SAMPLES: usize = 400;

/// Sharpness of the smoothed maximum, and the number of steps with it.
const ROUNDS: [(f64, usize); 4] = [(10.0, 300), (40.0, 300), (150.0, 300), (500.0, 300)];

/// Power iterations, starting from the nearby direction of the step before.
const ITERATIONS: usize = 2;

/// Share of the gap between the largest sampled norm and 1 that the claim leaves to the
/// proof: the larger, the fewer cells; the rest determines how many steps the module needs.
const GAP: f64 = 0.7;

/// Boxes whose largest sampled norm exceeds this are cut: the number of cells of a proof grows with a
/// high power of 1/(1 − norm).
const SPLIT_ABOVE: f64 = 0.9;

type Inverse = SMatrix<f64, 6, 8>;

/// The unknowns: M with rows multiplied by the weights and columns divided by the joints' rates, and the
/// logarithms of the weights.
#[derive(Clone)]
struct Unknowns {
    matrix: Inverse,
    weight: [f64; 6],
}

/// A box that is to be proved.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Claim with a contraction of 0: see [`Candidate::claim`].
    claim: Claim,
    /// Largest norm over the samples.
    largest: f64,
    /// Pose of this norm.
    place: [f64; 6],
}

/// Returns boxes that cover the poses between `low` and `high`: one, or as many as necessary for the
/// largest sampled norm in each to be at most `SPLIT_ABOVE`.
///
/// # Errors
/// A pose is out of reach, or `most` boxes are too few for norms below 1.
pub fn claims(
    prover: &Prover,
    low: [f64; 6],
    high: [f64; 6],
    most: usize,
) -> Result<Vec<Claim>, Doubt> {
    let mut boxes = vec![candidate(prover, low, high)?];
    while boxes.len() < most {
        let worst = (0..boxes.len()).max_by(|a, b| boxes[*a].largest.total_cmp(&boxes[*b].largest));
        let Some(worst) = worst.filter(|worst| boxes[*worst].largest > SPLIT_ABOVE) else { break };
        let halves = best_halves(prover, &boxes[worst].claim.region)?;
        boxes.splice(worst..=worst, halves);
    }
    boxes.into_iter().map(|candidate| candidate.claim(prover)).collect()
}

/// Returns the halves of a box, cut so that the larger of their norms is least.
fn best_halves(prover: &Prover, region: &WorkspaceBox) -> Result<[Candidate; 2], Doubt> {
    let half = |k: usize, upper: bool| {
        let (mut low, mut high) = (region.low, region.high);
        let end = if upper { &mut low } else { &mut high };
        end[k] = 0.5 * (region.low[k] + region.high[k]);
        candidate(prover, low, high)
    };
    let halved = |k: usize| {
        let (upper, lower) = rayon::join(|| half(k, true), || half(k, false));
        Ok([upper?, lower?])
    };
    let all = prover.active().iter().map(|k| halved(*k)).collect::<Result<Vec<_>, Doubt>>()?;
    let worse = |halves: &[Candidate; 2]| halves[0].largest.max(halves[1].largest);
    let best = all.into_iter().min_by(|a, b| worse(a).total_cmp(&worse(b)));
    best.ok_or(Doubt::Malformed("the legs move no coordinate"))
}

/// Returns the matrix and weights with the smallest norm found for poses between `low` and `high`.
fn candidate(prover: &Prover, low: [f64; 6], high: [f64; 6]) -> Result<Candidate, Doubt> {
    let poses = poses(prover.active(), &low, &high);
    let rows = poses.iter().map(|pose| prover.jacobian(pose)).collect::<Result<Vec<_>, _>>()?;
    let scale: [f64; 8] = std::array::from_fn(|i| {
        let sum: f64 = rows.iter().map(|rows| rows.row(i).norm_squared()).sum();
        (sum / rows.len() as f64).sqrt().max(f64::MIN_POSITIVE)
    });
    let scaled: Vec<LegRows> =
        rows.iter().map(|rows| LegRows::from_fn(|i, k| rows[(i, k)] / scale[i])).collect();
    let best = descended(prover.active(), &scaled);
    let region = WorkspaceBox {
        low,
        high,
        matrix: std::array::from_fn(|i| {
            std::array::from_fn(|j| best.matrix[(i, j)] / scale[j] / best.weight[i].exp())
        }),
        steps: 1,
    };
    let weight = std::array::from_fn(|k| {
        if prover.active().contains(&k) { rounded(best.weight[k].exp()) } else { 0.0 }
    });
    let mut claim = Claim { region, weight, contraction: 0.0 };
    for row in claim.region.matrix.iter_mut() {
        *row = row.map(rounded);
    }
    let mut largest = (0.0, poses[0]);
    for pose in &poses {
        let norm = prover.norm_at(&claim, pose)?;
        if norm > largest.0 {
            largest = (norm, *pose);
        }
    }
    Ok(Candidate { claim, largest: largest.0, place: largest.1 })
}

impl Candidate {
    /// Returns the claim with its contraction and steps.
    fn claim(self, prover: &Prover) -> Result<Claim, Doubt> {
        let Self { mut claim, largest, place } = self;
        claim.contraction = rounded(largest + GAP * (1.0 - largest));
        match steps_needed(&claim, prover.active()) {
            Some(steps) if largest < 1.0 => claim.region.steps = steps,
            _ => return Err(Doubt::Exceeded(place, largest)),
        }
        Ok(claim)
    }
}

/// Rounds to six digits, as shown in an INI file.
fn rounded(x: f64) -> f64 {
    format!("{x:.5e}").parse().unwrap_or(x)
}

/// Returns the corners, then points of a Halton sequence, every second one moved to faces of the box.
pub(super) fn poses(active: &[usize], low: &[f64; 6], high: &[f64; 6]) -> Vec<[f64; 6]> {
    let at = |share: &dyn Fn(usize) -> f64| {
        let mut pose = [0.0; 6];
        for (n, k) in active.iter().enumerate() {
            pose[*k] = low[*k] + (high[*k] - low[*k]) * share(n);
        }
        pose
    };
    let corners = (0..1_usize << active.len()).map(|bits| at(&|n| (bits >> n & 1) as f64));
    let inside = (1..=SAMPLES).map(|i| {
        at(&|n| {
            let x = halton(i, [2, 3, 5, 7, 11, 13][n]);
            if i % 2 == 0 { x } else { (2.0 * x - 0.5).clamp(0.0, 1.0) }
        })
    });
    corners.chain(inside).collect()
}

/// Returns the i-th number of the van der Corput sequence of a base.
fn halton(mut i: usize, base: usize) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0);
    while i > 0 {
        digit /= base as f64;
        value += digit * (i % base) as f64;
        i /= base;
    }
    value
}

fn descended(active: &[usize], rows: &[LegRows]) -> Unknowns {
    let mean = rows.iter().sum::<LegRows>() / rows.len() as f64;
    let inverse = mean.pseudo_inverse(1e-12).expect("the threshold is positive");
    // Weights of coordinates by their effect on the joints.
    let weight: [f64; 6] = std::array::from_fn(|k| mean.column(k).norm().max(1e-9).ln());
    let mut x = Unknowns {
        matrix: Inverse::from_fn(|i, j| 0.5 * inverse[(i, j)] * weight[i].exp()),
        weight,
    };
    let mut best = (f64::INFINITY, x.clone());
    let mut directions = vec![Vector6::repeat(1.0); rows.len()];
    let (mut first, mut second) = ([0.0; 54], [0.0; 54]);
    let mut step = 0;
    for (sharpness, count) in ROUNDS {
        for n in 0..count {
            let (value, gradient) = gradient(active, rows, &x, sharpness, &mut directions);
            if value < best.0 {
                best = (value, x.clone());
            }
            step += 1;
            let rate = 0.02 / (1.0 + sharpness / 40.0) * (1.0 - n as f64 / count as f64);
            for (p, g) in gradient.iter().enumerate() {
                first[p] = 0.9 * first[p] + 0.1 * g;
                second[p] = 0.99 * second[p] + 0.01 * g * g;
                let m = first[p] / (1.0 - 0.9_f64.powi(step));
                let v: f64 = second[p] / (1.0 - 0.99_f64.powi(step));
                let change = rate * m / (v.sqrt() + 1e-12);
                match p {
                    0..48 => x.matrix[(p / 8, p % 8)] -= change,
                    _ => x.weight[p - 48] -= change,
                }
            }
        }
    }
    best.1
}

/// Computes the largest norm over the samples, and the gradient of its smoothed form. The directions of largest
/// stretch are kept from step to step.
fn gradient(
    active: &[usize],
    rows: &[LegRows],
    x: &Unknowns,
    sharpness: f64,
    directions: &mut [Vector6<f64>],
) -> (f64, [f64; 54]) {
    let over: [f64; 6] = std::array::from_fn(|k| (-x.weight[k]).exp());
    let mut terms = Vec::with_capacity(rows.len());
    let mut largest = 0.0_f64;
    for (rows, direction) in rows.iter().zip(directions) {
        let scaled = LegRows::from_fn(|i, k| rows[(i, k)] * over[k]);
        let product = x.matrix * scaled;
        let mut departure = -product;
        for &k in active {
            departure[(k, k)] += 1.0;
        }
        let (norm, u, v) = dominant(&departure, direction);
        largest = largest.max(norm);
        terms.push((norm, u, v, scaled, product));
    }
    let total: f64 = terms.iter().map(|t| (sharpness * (t.0 - largest)).exp()).sum();
    let mut gradient = [0.0; 54];
    for (norm, u, v, scaled, product) in &terms {
        let share = (sharpness * (norm - largest)).exp() / total;
        if share < 1e-6 {
            continue;
        }
        let through = scaled * v;
        let back = product.transpose() * u;
        for i in 0..6 {
            for j in 0..MAX_LEGS {
                gradient[8 * i + j] -= share * u[i] * through[j];
            }
            gradient[48 + i] += share * back[i] * v[i];
        }
    }
    (largest, gradient)
}

/// Computes the largest singular value and its vectors, by power iterations from a direction.
fn dominant(m: &Matrix, direction: &mut Vector6<f64>) -> (f64, Vector6<f64>, Vector6<f64>) {
    for _ in 0..ITERATIONS {
        let next = m.tr_mul(&(m * *direction));
        *direction = next.try_normalize(0.0).unwrap_or(*direction);
    }
    let image = m * *direction;
    let norm = image.norm();
    (norm, image / norm.max(f64::MIN_POSITIVE), *direction)
}
