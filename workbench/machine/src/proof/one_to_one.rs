// SPDX-License-Identifier: GPL-2.0-or-later
//! Proof that a pose box is one-to-one: sup ‖1 − M J(X)‖ over the box, J = ∂q/∂X.
//!
//! Branch and bound. Over a cell with half widths h, J is the multilinear interpolation of its
//! values at the corners minus an element of
//!
//! ```text
//! Σ_k [0, h_k²/2] ∂_k ∂_k J
//! ```
//!
//! Multiplied by M this is C ± R, elementwise. The interpolation is a weighted mean of the values at the
//! corners, so
//!
//! ```text
//! ‖1 − M J(X)‖ ≤ max over corners ‖1 − M J + C‖ + ‖R‖
//! ```
//!
//! If third derivatives have constant signs, R is half as large as about C = 0.
//!
//! Norms are those of the weighted coordinates. The values at the corners are
//! the core's; the third derivatives are bounded by interval arithmetic on the
//! equations of the legs, which are repeated here.

use crate::proof::interval::Interval;
use crate::proof::jet;
use crate::read::boxes::Claim;
use kinematics::{
    BOX_TOLERANCE, Fault, Geometry, LAST_STEP, LegGeometry, LegKind, Letter, MAX_BOX_STEPS,
    Machine, Pose, Vector3, WorkspaceBox,
};
use nalgebra::SMatrix;
use std::ops::Add;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Tolerance for rounding in bounds and norms, of quantities near 1.
const ROUNDING: f64 = 1e-7;

const RADIANS: f64 = std::f64::consts::PI / 180.0;

/// Square matrix over X … C; rows and columns of coordinates that are not active are 0.
pub type Matrix = SMatrix<f64, 6, 6>;

/// Functions of N coordinates with all derivatives that the proof needs.
type Jet<const N: usize> = jet::Jet<N, 3>;

/// Legs by coordinates.
pub type LegRows = SMatrix<f64, 8, 6>;

/// Why a claim is not proved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Doubt {
    /// Its numbers are invalid for a box.
    #[error("{0}")]
    Malformed(&'static str),
    /// No boxes cover the axis limits.
    #[error("{0}")]
    Limits(String),
    /// The norm exceeds the claim at this pose.
    #[error("not proved: the norm is {1:.4} (must be below 1) at {0:?}; make the box smaller")]
    Exceeded([f64; 6], f64),
    /// This pose is out of reach.
    #[error("{0:?}: {1}")]
    Reach([f64; 6], Fault),
    /// The proof would need more cells than allowed.
    #[error("not proved with {0} cells; make the box smaller")]
    Effort(usize),
}

/// A machine with the equations that the proof needs.
pub struct Prover<'a> {
    machine: &'a Machine,
    geometry: &'a Geometry,
    active: Vec<usize>,
    /// Lead of each leg with the sign of the nut correction at home.
    lead: Vec<f64>,
    /// Receives the proved share of a box.
    progress: &'a (dyn Fn(f64) + Sync),
}

/// A part of a box.
#[derive(Clone, Copy, Debug)]
struct Cell {
    low: [f64; 6],
    high: [f64; 6],
}

/// Position and orientation of the platform over a cell.
struct Platform<const N: usize> {
    /// Center, in the frame of the legs.
    point: [Jet<N>; 3],
    /// As a function of the angles alone, which is much cheaper than of all coordinates.
    rotation: [[Jet<3>; 3]; 3],
    /// Indices of the angles among the coordinates.
    angles: [Option<usize>; 3],
}

/// State of a proof.
struct Work<'a> {
    claim: &'a Claim,
    /// Largest number of cells.
    limit: usize,
    count: AtomicUsize,
    failed: AtomicBool,
    /// Proved share of the box.
    done: Mutex<f64>,
}

/// Nonlinearity of J over a cell: W (1 − M J) W⁻¹ is the interpolation between the corners plus a matrix
/// within `radius` of `middle`.
struct Bend {
    middle: Matrix,
    /// Norm of the remainder; infinite if unknown.
    radius: f64,
    /// The coordinate with the largest contribution to the radius.
    mostly: usize,
}

/// Result of a cell.
enum Verdict {
    Proved,
    /// Must be halved along this coordinate.
    Split(usize),
}

impl<'a> Prover<'a> {
    /// Creates a prover for this machine and its geometry.
    pub fn new(machine: &'a Machine, geometry: &'a Geometry) -> Self {
        let active = Letter::ALL
            .into_iter()
            .filter(|letter| machine.layout().coordinates().contains(*letter))
            .map(Letter::index)
            .collect();
        Self { machine, geometry, active, lead: signed_leads(machine, geometry), progress: &|_| () }
    }

    /// Sets the function that receives the proved share of a box.
    #[must_use]
    pub fn with_progress(self, progress: &'a (dyn Fn(f64) + Sync)) -> Self {
        Self { progress, ..self }
    }

    /// Returns the indices of the coordinates that the legs move.
    pub fn active(&self) -> &[usize] {
        &self.active
    }

    /// Returns J at a pose without tool: joint units per machine unit and per degree.
    ///
    /// # Errors
    /// The pose is out of reach.
    pub fn jacobian(&self, pose: &[f64; 6]) -> Result<LegRows, Doubt> {
        let jacobian = self
            .machine
            .at(&Pose::from_degrees(*pose), &Vector3::zeros())
            .and_then(|at| at.pose_jacobian())
            .map_err(|fault| Doubt::Reach(*pose, fault))?;
        let mut rows = LegRows::zeros();
        for i in 0..self.machine.layout().legs() {
            for k in &self.active {
                rows[(i, *k)] = jacobian[(i, *k)];
            }
        }
        Ok(rows)
    }

    /// Returns ‖1 − M J‖ at a pose.
    ///
    /// # Errors
    /// The pose is out of reach.
    pub fn norm_at(&self, claim: &Claim, pose: &[f64; 6]) -> Result<f64, Doubt> {
        Ok(self.departure(claim, pose)?.singular_values()[0])
    }

    /// Returns W (1 − M J) W⁻¹ at a pose.
    fn departure(&self, claim: &Claim, pose: &[f64; 6]) -> Result<Matrix, Doubt> {
        let product = matrix_of(&claim.region) * self.jacobian(pose)?;
        let mut departure = Matrix::zeros();
        for &i in &self.active {
            for &j in &self.active {
                let unit = f64::from(u8::from(i == j));
                let ratio = claim.weight[i] / claim.weight[j];
                departure[(i, j)] = (unit - product[(i, j)]) * ratio;
            }
        }
        Ok(departure)
    }

    /// Proves a claim with at most `limit` cells and returns their number.
    ///
    /// # Errors
    /// The claim is wrong, or was not proved.
    pub fn prove(&self, claim: &Claim, limit: usize) -> Result<usize, Doubt> {
        self.check(claim)?;
        let whole = Cell { low: claim.region.low, high: claim.region.high };
        let (count, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
        let work = Work { claim, limit, count, failed, done: Mutex::new(0.0) };
        self.prove_cell(&work, &whole)?;
        Ok(work.count.into_inner())
    }

    /// Proves a cell, or its halves in parallel; stops once any cell has failed.
    fn prove_cell(&self, work: &Work, cell: &Cell) -> Result<(), Doubt> {
        if work.failed.load(Ordering::Relaxed) {
            return Ok(());
        }
        let proved = self.judged(work, cell);
        if proved.is_err() {
            work.failed.store(true, Ordering::Relaxed);
        }
        match proved? {
            Verdict::Proved => {
                let mut done = work.done.lock().expect("never poisoned");
                *done += self.share(work.claim, cell);
                (self.progress)(*done);
                Ok(())
            }
            Verdict::Split(k) => {
                let [lower, upper] = cell.halves(k);
                let both =
                    rayon::join(|| self.prove_cell(work, &lower), || self.prove_cell(work, &upper));
                both.0.and(both.1)
            }
        }
    }

    /// Returns the cell's share of the box.
    fn share(&self, claim: &Claim, cell: &Cell) -> f64 {
        let along = |k: &usize| {
            (cell.high[*k] - cell.low[*k]) / (claim.region.high[*k] - claim.region.low[*k])
        };
        self.active.iter().map(along).product()
    }

    fn judged(&self, work: &Work, cell: &Cell) -> Result<Verdict, Doubt> {
        match work.count.fetch_add(1, Ordering::Relaxed) < work.limit {
            true => self.judge(work.claim, cell),
            false => Err(Doubt::Effort(work.limit)),
        }
    }

    /// Checks the claim's numbers, so that the iteration in the box converges within the allowed steps.
    fn check(&self, claim: &Claim) -> Result<(), Doubt> {
        let region = &claim.region;
        if !(region.is_valid() && claim.contraction > 0.0 && claim.contraction < 1.0) {
            return Err(Doubt::Malformed(
                "LOW, HIGH, STEPS or CONTRACTION is out of range; run pkm boxes --write",
            ));
        }
        for letter in Letter::ALL {
            let (k, moved) = (letter.index(), self.active.contains(&letter.index()));
            if (region.high[k] > region.low[k]) != moved || (!moved && region.low[k] != 0.0) {
                return Err(Doubt::Malformed(
                    "LOW and HIGH must differ for letters that the legs move, and be 0 for others",
                ));
            }
            if moved && !(claim.weight[k] > 0.0 && claim.weight[k].is_finite()) {
                return Err(Doubt::Malformed("every WEIGHT must be positive"));
            }
        }
        if region.steps < steps_needed(claim, &self.active).ok_or(TOO_SLOW)? {
            return Err(Doubt::Malformed(
                "STEPS is smaller than CONTRACTION and WEIGHT require; run pkm boxes --write",
            ));
        }
        Ok(())
    }

    fn judge(&self, claim: &Claim, cell: &Cell) -> Result<Verdict, Doubt> {
        let bend = self.bend(claim, cell);
        let split = match bend.radius.is_finite() {
            true => bend.mostly,
            // Every share is unbounded: use the widest part of the box.
            false => self.widest(claim, cell),
        };
        // Remainder for the corners.
        let most = claim.contraction - ROUNDING - bend.radius;
        for corner in cell.corners(&self.active) {
            if is_below(&(self.departure(claim, &corner)? + bend.middle), most) {
                continue;
            }
            // Corners must satisfy the claim even before the cells are small enough.
            for corner in [cell.low, cell.high, corner] {
                let norm = self.norm_at(claim, &corner)?;
                if norm > claim.contraction {
                    return Err(Doubt::Exceeded(corner, norm));
                }
            }
            return Ok(Verdict::Split(split));
        }
        Ok(Verdict::Proved)
    }

    /// Returns the coordinate along which the cell has the largest share of the box.
    fn widest(&self, claim: &Claim, cell: &Cell) -> usize {
        let share = |k: &usize| {
            (cell.high[*k] - cell.low[*k]) / (claim.region.high[*k] - claim.region.low[*k])
        };
        let best = self.active.iter().max_by(|a, b| share(a).total_cmp(&share(b)));
        best.copied().unwrap_or(0)
    }

    /// Bounds the nonlinearity of J over the cell.
    fn bend(&self, claim: &Claim, cell: &Cell) -> Bend {
        match self.active.len() {
            0 | 1 => self.bend_of::<1>(claim, cell),
            2 => self.bend_of::<2>(claim, cell),
            3 => self.bend_of::<3>(claim, cell),
            4 => self.bend_of::<4>(claim, cell),
            5 => self.bend_of::<5>(claim, cell),
            _ => self.bend_of::<6>(claim, cell),
        }
    }

    /// Bounds the nonlinearity for N coordinates that the legs move.
    fn bend_of<const N: usize>(&self, claim: &Claim, cell: &Cell) -> Bend {
        let platform = self.platform::<N>(cell);
        let legs = self.geometry.legs().iter().zip(&self.lead);
        let joints: Vec<Jet<N>> =
            legs.map(|(leg, lead)| self.joint(leg, *lead, &platform)).collect();
        let (mut middle, mut radius) = (Matrix::zeros(), Matrix::zeros());
        let (mut most, mut mostly) = (-1.0, 0);
        for (place, &k) in self.active.iter().enumerate() {
            let half = 0.5 * (cell.high[k] - cell.low[k]);
            let part = self.bend_along(claim, place, 0.5 * half * half, &joints);
            middle += part.map(Interval::middle);
            let wide = part.map(|x| 0.5 * (x.high - x.low));
            radius += wide;
            if wide.norm() > most {
                (most, mostly) = (wide.norm(), k);
            }
        }
        Bend { middle, radius: norm_of_bound(&radius), mostly }
    }

    /// Returns [0, reach] W M ∂_k ∂_k J W⁻¹, elementwise, where k is the index among the coordinates that the legs
    /// move.
    fn bend_along<const N: usize>(
        &self,
        claim: &Claim,
        place: usize,
        reach: f64,
        joints: &[Jet<N>],
    ) -> SMatrix<Interval, 6, 6> {
        let mut bend = SMatrix::repeat(Interval::ZERO);
        for (n, &j) in self.active.iter().enumerate() {
            for &i in &self.active {
                let row = joints.iter().zip(&claim.region.matrix[i]);
                let sum = row.map(|(joint, m)| joint.third(place, n) * *m);
                let ratio = claim.weight[i] / claim.weight[j];
                let whole = sum.fold(Interval::ZERO, Add::add) * (reach * ratio);
                // NaN stays: the radius is then unknown.
                let low = if whole.low > 0.0 { 0.0 } else { whole.low };
                let high = if whole.high < 0.0 { 0.0 } else { whole.high };
                bend[(i, j)] = Interval::new(low, high);
            }
        }
        bend
    }

    /// Returns the platform over a cell.
    fn platform<const N: usize>(&self, cell: &Cell) -> Platform<N> {
        let place = |n: usize| self.active.iter().position(|k| *k == n);
        let range = |n: usize| Interval::new(cell.low[n], cell.high[n]);
        let angles = [3, 4, 5].map(place);
        // In degrees, like the box.
        let angle = |k: usize| match angles[k] {
            Some(_) => Jet::variable(range(k + 3), k) * RADIANS,
            None => Jet::held(range(k + 3)) * RADIANS,
        };
        let rotation = rotation([angle(0), angle(1), angle(2)]);
        let reference = times(&rotation, self.geometry.centre);
        let point = std::array::from_fn(|n| match place(n) {
            Some(place) => Jet::variable(range(n), place) + reference[n].among(angles),
            // The legs do not depend on constant coordinates, nor on the table's.
            None => Jet::constant(0.0),
        });
        Platform { point, rotation, angles }
    }

    /// Returns the joint value of a leg, up to a constant.
    fn joint<const N: usize>(
        &self,
        leg: &LegGeometry,
        lead: f64,
        platform: &Platform<N>,
    ) -> Jet<N> {
        let Platform { point, rotation, angles } = platform;
        let centre = self.geometry.centre;
        let arm = times(rotation, std::array::from_fn(|n| leg.platform[n] - centre[n]));
        let anchor: [Jet<N>; 3] = std::array::from_fn(|n| {
            let mut place = (arm[n] - Jet::constant(leg.base[n])).among(*angles);
            place += &point[n];
            place
        });
        match leg.kind {
            LegKind::Strut(strut) => {
                let length = dot(&anchor, &anchor).sqrt();
                if lead == 0.0 {
                    return length;
                }
                let over = length.inverse();
                let n = anchor.map(|w| w * over);
                let axes = [strut.base_axis, strut.platform_axis].map(unit);
                let turn = torsion(&n, &axes[0], &times(rotation, axes[1]), *angles);
                length.and(&turn, lead / std::f64::consts::TAU)
            }
            LegKind::Slider(slider) => {
                let guide = unit(slider.guide);
                let across = across(guide).map(|e| dot_fixed(&anchor, &e).squared());
                let square = slider.rod * slider.rod;
                let root = (Jet::constant(square) - across[0] - across[1]).sqrt();
                dot_fixed(&anchor, &guide).and(&root, f64::from(slider.side))
            }
            LegKind::Crank(crank) => {
                let axis = Vector3::from(unit(crank.axis));
                let arm = Vector3::from(crank.arm);
                let along = axis.dot(&arm);
                let level = arm - axis * along;
                let a = dot_fixed(&anchor, &level.into());
                let b = dot_fixed(&anchor, &axis.cross(&level).into());
                let apart: [Jet<N>; 3] =
                    std::array::from_fn(|n| anchor[n] - Jet::constant(axis[n] * along));
                let rest = level.norm_squared() - crank.rod * crank.rod;
                let t = (dot(&apart, &apart) + Jet::constant(rest)) * 0.5;
                let root = (a.squared() + b.squared() - t.squared()).sqrt();
                // atan2(b, a) + side acos(T/√(a²+b²)), the latter as the angle of (T, root).
                let side = f64::from(crank.side);
                let angle = Jet::angle(&b, &a).and(&Jet::angle(&root, &t), side);
                angle * (1.0 / RADIANS)
            }
            LegKind::Ring(ring) => {
                // From base anchor to ring, in the platform's frame, where the platform's arm is constant.
                let from_base: [Jet<N>; 3] =
                    std::array::from_fn(|n| point[n] - Jet::constant(leg.base[n]));
                let [x, y, height]: [Jet<N>; 3] = std::array::from_fn(|k| {
                    let axis: [Jet<N>; 3] = std::array::from_fn(|n| rotation[n][k].among(*angles));
                    dot(&from_base, &axis) + Jet::constant(leg.platform[k] - centre[k])
                });
                let rho = (x.squared() + y.squared()).sqrt();
                ((rho - Jet::constant(ring.radius)).squared() + height.squared()).sqrt()
            }
        }
    }
}

/// Returns the lead of each leg, negative if the joint axes are opposed at home.
fn signed_leads(machine: &Machine, geometry: &Geometry) -> Vec<f64> {
    let home = Pose::from_degrees(geometry.home.unwrap_or_default());
    let at = machine.at(&home, &Vector3::zeros());
    let lead = |(i, leg): (usize, &LegGeometry)| {
        let strut = leg.kind.screw();
        let Ok(at) = &at else { return strut.lead };
        let n = at.segments()[i].span().normalize();
        let base = Vector3::from(strut.base_axis);
        let platform = home.rotation() * Vector3::from(strut.platform_axis);
        let cosine = base.dot(&platform) - base.dot(&n) * platform.dot(&n);
        if cosine < 0.0 { -strut.lead } else { strut.lead }
    };
    geometry.legs().iter().enumerate().map(lead).collect()
}

/// Returns the angle of the nut about the strut, up to a constant: of (C, S), see the core's `nut`.
fn torsion<const N: usize>(
    n: &[Jet<N>; 3],
    base_axis: &[f64; 3],
    platform_axis: &[Jet<3>; 3],
    angles: [Option<usize>; 3],
) -> Jet<N> {
    let cross: [Jet<N>; 3] = std::array::from_fn(|k| {
        let (p, q) = ((k + 1) % 3, (k + 2) % 3);
        (platform_axis[q] * base_axis[p]).and(&platform_axis[p], -base_axis[q]).among(angles)
    });
    let sine = dot(n, &cross);
    let of_both: Jet<N> = dot_fixed(platform_axis, base_axis).among(angles);
    let platform_axis = platform_axis.each_ref().map(|axis| axis.among(angles));
    let cosine = of_both - dot_fixed(n, base_axis) * dot(&platform_axis, n);
    Jet::angle(&sine, &cosine)
}

/// Returns Rz(C) Ry(B) Rx(A) as rows.
fn rotation<const N: usize>([a, b, c]: [Jet<N>; 3]) -> [[Jet<N>; 3]; 3] {
    let ([sa, sb, sc], [ca, cb, cc]) = ([a, b, c].map(|x| x.sin()), [a, b, c].map(|x| x.cos()));
    let (cs, ss) = (cc * sb, sc * sb);
    [
        [cc * cb, cs * sa - sc * ca, cs * ca + sc * sa],
        [sc * cb, ss * sa + cc * ca, ss * ca - cc * sa],
        [-sb, cb * sa, cb * ca],
    ]
}

fn times<const N: usize>(rotation: &[[Jet<N>; 3]; 3], v: [f64; 3]) -> [Jet<N>; 3] {
    rotation.map(|row| dot_fixed(&row, &v))
}

fn dot<const N: usize>(a: &[Jet<N>; 3], b: &[Jet<N>; 3]) -> Jet<N> {
    let product = |k: usize| {
        if std::ptr::eq(a, b) { a[k].squared() } else { a[k] * b[k] }
    };
    let mut sum = product(0);
    sum += &product(1);
    sum += &product(2);
    sum
}

fn dot_fixed<const N: usize>(a: &[Jet<N>; 3], b: &[f64; 3]) -> Jet<N> {
    (a[0] * b[0]).and(&a[1], b[1]).and(&a[2], b[2])
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    Vector3::from(v).normalize().into()
}

/// Returns two directions normal to a unit vector and to each other, with exact zeros for a coordinate axis.
fn across(u: [f64; 3]) -> [[f64; 3]; 2] {
    let u = Vector3::from(u);
    let first = u.cross(&Vector3::ith(u.iamin(), 1.0)).normalize();
    [first.into(), u.cross(&first).into()]
}

/// Bounds the norm of a matrix of bounds; infinite if one is unknown.
fn norm_of_bound(bound: &Matrix) -> f64 {
    if bound.iter().all(|x| x.is_finite()) { bound.singular_values()[0] } else { f64::INFINITY }
}

/// Returns whether ‖m‖ < most: most² − mᵀm is positive definite. Its rounding is far below `ROUNDING`.
fn is_below(m: &Matrix, most: f64) -> bool {
    most > 0.0 && (Matrix::identity() * (most * most) - m.tr_mul(m)).cholesky().is_some()
}

/// Returns M as a matrix.
fn matrix_of(region: &WorkspaceBox) -> SMatrix<f64, 6, 8> {
    SMatrix::from_fn(|i, j| region.matrix[i][j])
}

const TOO_SLOW: Doubt =
    Doubt::Malformed("CONTRACTION and WEIGHT require more than 4096 steps; make the box smaller");

/// Returns the number of steps after which the iteration has converged from anywhere in the box; `None`
/// if there are too many, or a step does not bound the distance to the solution well enough.
pub fn steps_needed(claim: &Claim, active: &[usize]) -> Option<u32> {
    let width = |k: &usize| claim.region.high[*k] - claim.region.low[*k];
    let across = active.iter().map(|k| (claim.weight[*k] * width(k)).powi(2)).sum::<f64>().sqrt();
    let least = active.iter().map(|k| claim.weight[*k] * width(k)).reduce(f64::min).unwrap_or(0.0);
    // Let P be the pose of the joints, X at distance d from it: the step from X is at most (1 + c) d
    // long, and in any coordinate at most least/width of it.
    let c = claim.contraction;
    let near = BOX_TOLERANCE * least / (across * (1.0 + c));
    let steps = (near.ln() / c.ln()).ceil() + 1.0;
    // Early termination: a step of LAST_STEP of all widths leaves 1/(1 − c) of it.
    let early = LAST_STEP / (1.0 - c);
    (steps <= f64::from(MAX_BOX_STEPS) && early <= near).then_some(steps as u32)
}

impl Cell {
    fn halves(&self, k: usize) -> [Self; 2] {
        let middle = 0.5 * (self.low[k] + self.high[k]);
        let (mut lower, mut upper) = (*self, *self);
        lower.high[k] = middle;
        upper.low[k] = middle;
        [lower, upper]
    }

    fn corners<'b>(&'b self, active: &'b [usize]) -> impl Iterator<Item = [f64; 6]> + 'b {
        (0..1_usize << active.len()).map(|bits| {
            let mut corner = self.low;
            for (n, k) in active.iter().enumerate() {
                if bits >> n & 1 == 1 {
                    corner[*k] = self.high[*k];
                }
            }
            corner
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::machine::MachineConfig;
    use crate::read::mechanism::Mechanism;
    use rand::{Rng, SeedableRng};
    use rand_pcg::Pcg64;
    use std::path::Path;

    const MACHINES: [&str; 9] = [
        "four-rod-lathe",
        "hexapod",
        "lab-hexapod",
        "linear-delta",
        "pentapod",
        "pyramid",
        "rotary-delta",
        "six-rod-lathe",
        "tripod",
    ];

    fn config(name: &str) -> Mechanism {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs").join(name);
        let config = MachineConfig::read(&folder.join(format!("{name}.ini")));
        config.unwrap().mechanism(1).unwrap()
    }

    /// Returns a random part of the axis limits, of the relative width `share`.
    fn cell(config: &Mechanism, active: &[usize], share: f64, rng: &mut Pcg64) -> Cell {
        let mut cell = Cell { low: [0.0; 6], high: [0.0; 6] };
        for &k in active {
            let (axis, width) = (&config.axes[k], config.axes[k].max - config.axes[k].min);
            cell.low[k] = axis.min + (1.0 - share) * width * rng.random::<f64>();
            cell.high[k] = cell.low[k] + share * width;
        }
        cell
    }

    #[test]
    fn the_equations_written_here_have_the_jacobian_of_the_core() {
        let mut rng = Pcg64::seed_from_u64(21);
        for name in MACHINES {
            let config = config(name);
            let prover = Prover::new(&config.machine, &config.geometry);
            for _ in 0..200 {
                let point = cell(&config, prover.active(), 0.0, &mut rng);
                let rows = prover.jacobian(&point.low).unwrap();
                // All six coordinates: inactive ones have no index.
                let platform = prover.platform::<6>(&point);
                for (i, leg) in config.geometry.legs().iter().enumerate() {
                    let joint = prover.joint(leg, prover.lead[i], &platform);
                    for (place, &j) in prover.active().iter().enumerate() {
                        let slope = joint.slope(place);
                        let off = (slope.low - rows[(i, j)]).abs();
                        // Some hundred roundings of values up to a few units.
                        assert!(off < 1e-10, "{name} {i} {j}: {slope:?} {}", rows[(i, j)]);
                    }
                }
            }
        }
    }

    #[test]
    fn no_pose_of_a_cell_departs_from_its_corners_by_more_than_the_bound() {
        let mut rng = Pcg64::seed_from_u64(22);
        for name in MACHINES {
            let config = config(name);
            let prover = Prover::new(&config.machine, &config.geometry);
            let (mut largest, mut checked) = (0.0_f64, 0);
            for n in 0..400 {
                let share = if n % 2 == 0 { 0.05 } else { 0.2 };
                let cell = cell(&config, prover.active(), share, &mut rng);
                let middle = std::array::from_fn(|k| 0.5 * (cell.low[k] + cell.high[k]));
                let rows = prover.jacobian(&middle).unwrap();
                let inverse = rows.pseudo_inverse(1e-12).unwrap();
                let mut region = WorkspaceBox { low: cell.low, high: cell.high, ..EMPTY };
                for (i, row) in region.matrix.iter_mut().enumerate() {
                    *row = std::array::from_fn(|j| inverse[(i, j)]);
                }
                let weight = std::array::from_fn(|k| rows.column(k).norm());
                let claim = Claim { region, weight, contraction: 0.5 };
                let bend = prover.bend(&claim, &cell);
                if !bend.radius.is_finite() {
                    continue;
                }
                let corners: Vec<_> = cell.corners(prover.active()).collect();
                let mean = corners.iter().map(|c| prover.departure(&claim, c).unwrap());
                let mean = mean.sum::<Matrix>() / corners.len() as f64;
                let there = prover.departure(&claim, &middle).unwrap();
                // At the center the interpolation is the mean of the corners.
                let off = (there - mean - bend.middle).singular_values()[0];
                assert!(off <= bend.radius + 1e-12, "{name}: {off} {}", bend.radius);
                largest = largest.max((there - mean).singular_values()[0] / bend.radius);
                checked += 1;
            }
            assert!(checked > 100, "{name}: {checked}");
            // A much too wide bound would be sound but useless.
            assert!(largest > 0.05, "{name}: {largest}");
        }
    }

    const EMPTY: WorkspaceBox = WorkspaceBox::EMPTY;
}
