// SPDX-License-Identifier: GPL-2.0-or-later
//! Time of the arithmetic alone: operations counted on paper, at the rate at which this
//! core does many independent ones of each kind.
//!
//! Multiplications and additions count alike, two of them per vector operation, and run in parallel with
//! the divider, which does divisions and square roots; arcs are libm's function. Loads, copies,
//! checks and latencies count nothing: no program for these registers can be faster,
//! and none comes near it.

use std::hint::black_box;
use std::time::Instant;

/// Operations of one call.
#[derive(Clone, Copy, Default)]
pub struct Work {
    /// Multiplications and additions.
    pub flops: f64,
    /// Divisions.
    pub divisions: f64,
    /// Square roots.
    pub roots: f64,
    /// Arcs of sine and cosine.
    pub arcs: f64,
}

/// Legs of a hexapod.
const LEGS: f64 = 6.0;

/// Three sines (15) with their cosines (15) by polynomials.
const SINES: f64 = 3.0 * 30.0;

/// Products of sines (12) and sums (4) of a rotation; 3 × 3 by a vector (15) and 6 additions for
/// the point positioned by the legs.
const PLACE: f64 = 16.0 + 21.0;

/// R b (15), center and base (6), its square (5), the target or offset (1).
const LEG: f64 = 27.0;

/// α and β (10), A·B − αβ (7), n·(A×B) (14), travel and sum (2).
const TORSION: f64 = 33.0;

/// Counts the operations of inverse for a hexapod of struts.
pub fn inverse(lead: bool) -> Work {
    let mut work = Work { flops: SINES + PLACE + LEGS * LEG, roots: LEGS, ..Work::default() };
    if lead {
        // R times the platform axis (15), powers of the length (3).
        work.flops += LEGS * (18.0 + TORSION);
        work.arcs += LEGS;
    }
    work
}

/// Counts the operations of forward for a hexapod of struts with its certificate, within one ball, after `solves`
/// solves.
pub fn forward(lead: bool, solves: f64) -> Work {
    let mut work = inverse(lead);
    // Rows: n (3), its moment (9) by 1/r (3).
    work.flops += LEGS * 15.0;
    work.divisions += LEGS;
    // Gram-Schmidt: 6 squares, 15 products and subtractions; R M = D⁻¹ Qᵀ; the norm of M.
    work.flops += 6.0 * 11.0 + 15.0 * 24.0 + 36.0 + 15.0 * 12.0 + 71.0;
    work.divisions += 6.0;
    // k of each leg with a division; two norms.
    work.flops += LEGS * 6.0 + 22.0;
    work.divisions += LEGS;
    work.roots += 3.0;
    // Rotation and angles near the seed's: two products, three arcs by series.
    work.flops += 2.0 * 45.0 + 75.0;
    work.divisions += 5.0;
    work.roots += 1.0;
    // Each step uses M twice (66), with the nonlinearity or the rotation of its rows (27 per leg); norms.
    work.flops += solves * (132.0 + LEGS * 27.0 + 36.0);
    work.divisions += solves * LEGS;
    work.roots += solves * 2.0;
    // Each residual after a step: C − 1 (25), its product with an arm (18) instead of R b.
    work.flops += solves * (25.0 + LEGS * LEG);
    work.divisions += solves;
    work.roots += solves * LEGS;
    if lead {
        // Rates of the correction; its term of k.
        work.flops += LEGS * (45.0 + 40.0);
        work.divisions += LEGS * 4.0;
        work.roots += LEGS * 2.0;
        // Each torsion again: n and axis (21), the arc of a difference by its series (20).
        work.flops += solves * LEGS * (21.0 + TORSION + 20.0);
        work.divisions += solves * LEGS * 2.0;
    }
    work
}

/// Nanoseconds per operation among many.
pub struct Rates {
    /// Time of a multiplication or an addition.
    pub flop: f64,
    /// Time of a division.
    pub division: f64,
    /// Time of a square root.
    pub root: f64,
    /// Time of an arc.
    pub arc: f64,
}

/// Numbers processed in parallel: twelve vector registers of two.
const LANES: usize = 24;

/// Rounds of a measurement: some tens of microseconds.
const ROUNDS: usize = 2000;

/// Number of measurements; the fastest counts, because other processes only slow it down.
const TRIALS: usize = 15;

impl Rates {
    /// Measures this core.
    pub fn measured() -> Self {
        let lanes: [f64; LANES] = std::array::from_fn(|k| 0.3 + 0.01 * k as f64);
        let (scale, by) = black_box((0.999, 0.001));
        Self {
            // One of each kind.
            flop: quickest(lanes, |x| x * scale + by) / 2.0,
            division: quickest(lanes, |x| scale / x),
            root: quickest(lanes, |x| x.sqrt()),
            arc: quickest(lanes, |x| libm::atan2(x, scale)),
        }
    }

    /// Returns the least time of the work, in nanoseconds.
    pub fn least(&self, work: &Work) -> f64 {
        let trigonometry = work.arcs * self.arc;
        let divider = work.divisions * self.division + work.roots * self.root;
        (work.flops * self.flop + trigonometry).max(divider)
    }
}

fn quickest(start: [f64; LANES], step: impl Fn(f64) -> f64) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..TRIALS {
        let mut lanes = black_box(start);
        let begun = Instant::now();
        for _ in 0..ROUNDS {
            for lane in &mut lanes {
                *lane = step(*lane);
            }
        }
        let time = begun.elapsed().as_nanos() as f64;
        black_box(lanes);
        best = best.min(time / (ROUNDS * LANES) as f64);
    }
    best
}
