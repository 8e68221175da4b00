// SPDX-License-Identifier: GPL-2.0-or-later
//! Linear theory of a random force: covariances from Lyapunov's equation, and spectra.
//!
//! States are modal displacements times their frequencies, modal velocities, and the filters of the
//! force, so that all entries have similar size. A P + P Aᵀ + Q = 0 is solved by Schur's form (Bartels and
//! Stewart 1972).

use crate::dense;
use crate::dynamics::noise::{Spectrum, exponential};
use crate::dynamics::structure::Structure;
use kinematics::{Matrix3, Vector3};
use nalgebra::{Complex, DMatrix, DVector};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Doublings of the sum for a sampled force: 2^60 steps.
const DOUBLINGS: usize = 60;

/// A structure under a random force on its tool tip.
#[derive(Clone, Debug)]
pub struct Linear {
    /// x' = A x + white noise.
    a: DMatrix<f64>,
    /// Density of the white noise.
    q: DMatrix<f64>,
    /// Displacement of the tip, mm per state.
    tip: DMatrix<f64>,
    /// Rotation of the platform and its spindle about the machine's axes, rad per state.
    turns: DMatrix<f64>,
    /// Change of force of every leg, N per state.
    legs: DMatrix<f64>,
    /// Number of states of the structure; the others are those of the force, whose covariance is 1.
    structural: usize,
}

/// An ellipse of one standard deviation in X and Y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ellipse {
    /// Long and short half axis.
    pub axes: [f64; 2],
    /// Direction of the long axis from X, degrees, more than -90 and at most 90.
    pub direction: f64,
}

impl Ellipse {
    pub fn of(covariance: &Matrix3<f64>) -> Self {
        let (a, b, c) = (covariance[(0, 0)], covariance[(0, 1)], covariance[(1, 1)]);
        let (mean, half) = ((a + c) / 2.0, ((a - c) / 2.0).hypot(b));
        let angle = b.atan2((a - c) / 2.0) / 2.0;
        let angle = if angle <= -FRAC_PI_2 { angle + PI } else { angle };
        Self {
            axes: [mean + half, (mean - half).max(0.0)].map(f64::sqrt),
            direction: angle.to_degrees(),
        }
    }
}

impl Linear {
    /// Combines a structure, a force with standard deviations along X Y Z in N, and the stiffness of its legs;
    /// `None` if some motion is unconstrained.
    pub fn of(
        structure: &Structure,
        legs: &[f64],
        sigma: &Vector3<f64>,
        spectrum: &Spectrum,
    ) -> Option<Self> {
        let shapes = structure.shapes()?;
        let count = shapes.omegas.len();
        let omegas = DMatrix::from_diagonal(&DVector::from(shapes.omegas.clone()));
        let filter = spectrum.filter();
        let order = filter.nrows();
        let all = 2 * count + 3 * order;
        let mut a = DMatrix::zeros(all, all);
        a.view_mut((0, count), (count, count)).copy_from(&omegas);
        a.view_mut((count, 0), (count, count)).copy_from(&-&omegas);
        let damping = shapes.vectors.tr_mul(&(&structure.damping * &shapes.vectors));
        a.view_mut((count, count), (count, count)).copy_from(&-damping);
        let tip = structure.tip.rows(0, 3) * &shapes.vectors;
        let mut q = DMatrix::zeros(all, all);
        let density = -(&filter + filter.transpose());
        for axis in 0..3 {
            let first = 2 * count + axis * order;
            a.view_mut((count, first), (count, 1))
                .copy_from(&(tip.row(axis).transpose() * sigma[axis]));
            a.view_mut((first, first), (order, order)).copy_from(&filter);
            q.view_mut((first, first), (order, order)).copy_from(&density);
        }
        let per_state = DMatrix::from_diagonal(&DVector::from_iterator(
            count,
            shapes.omegas.iter().map(|omega| 1.0 / omega),
        ));
        let wide = |matrix: &DMatrix<f64>| {
            let mut wide = DMatrix::zeros(matrix.nrows(), all);
            wide.view_mut((0, 0), (matrix.nrows(), count)).copy_from(&(matrix * &per_state));
            wide
        };
        let turns = wide(&(structure.tip.rows(3, 3) * &shapes.vectors));
        let stretched = &structure.elongation * &shapes.vectors;
        let stiff = DMatrix::from_diagonal(&DVector::from_column_slice(legs));
        let legs = wide(&(-stiff * stretched));
        Some(Self { a, q, tip: wide(&tip), turns, legs, structural: 2 * count })
    }

    /// Adds the forces of dampers in the legs, N s/mm, to those of their springs.
    pub fn with_dampers(mut self, structure: &Structure, dampers: &[f64]) -> Option<Self> {
        let shapes = structure.shapes()?;
        let count = self.structural / 2;
        let stretched = &structure.elongation * &shapes.vectors;
        let damping = DMatrix::from_diagonal(&DVector::from_column_slice(dampers));
        let mut part = self.legs.columns_mut(count, count);
        part -= damping * stretched;
        Some(self)
    }

    /// Computes the stationary covariance of the states; `None` if the structure is not stable.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        let once = lyapunov(&self.a, &self.q)?;
        // Repeated with variances scaled to 1, because they differ by many powers of ten.
        let scale =
            once.diagonal().map(|variance| if variance > 0.0 { variance.sqrt() } else { 1.0 });
        let scaled = |matrix: &DMatrix<f64>, by: fn(f64, f64) -> f64| {
            DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, k| {
                matrix[(i, k)] * by(scale[i], scale[k])
            })
        };
        let a = scaled(&self.a, |i, k| k / i);
        let found = lyapunov(&a, &scaled(&self.q, |i, k| 1.0 / (i * k)))?;
        Some(scaled(&found, |i, k| i * k))
    }

    /// Computes the covariance at the samples for a force that is constant between samples `step` seconds apart.
    pub fn held(&self, step: f64) -> Option<DMatrix<f64>> {
        let all = self.a.nrows();
        let (own, forcing) = (self.structural, all - self.structural);
        let mut held = &self.a * step;
        held.rows_mut(own, forcing).fill(0.0);
        let mut whole = exponential(&held);
        let filter = exponential(&(self.a.view((own, own), (forcing, forcing)) * step));
        whole.view_mut((own, own), (forcing, forcing)).copy_from(&filter);
        let mut sum = DMatrix::zeros(all, all);
        let added = DMatrix::identity(forcing, forcing) - &filter * filter.transpose();
        sum.view_mut((own, own), (forcing, forcing)).copy_from(&added);
        // Sum of Φᵏ Q Φᵏᵀ over all k, by doubling.
        for _ in 0..DOUBLINGS {
            sum += &whole * &sum * whole.transpose();
            whole = &whole * &whole;
            if whole.amax() < f64::EPSILON {
                return Some(sum);
            }
        }
        None
    }

    /// Computes the covariance of the tip from that of the states, mm².
    pub fn of_tip(&self, covariance: &DMatrix<f64>) -> Matrix3<f64> {
        (&self.tip * covariance * self.tip.transpose()).fixed_view::<3, 3>(0, 0).into()
    }

    /// Computes the covariance of the rotation of the spindle from that of the states, rad², about machine axes.
    pub fn of_turns(&self, covariance: &DMatrix<f64>) -> Matrix3<f64> {
        (&self.turns * covariance * self.turns.transpose()).fixed_view::<3, 3>(0, 0).into()
    }

    /// Computes the standard deviation of the force of every leg, N.
    pub fn of_legs(&self, covariance: &DMatrix<f64>) -> Vec<f64> {
        let all = &self.legs * covariance * self.legs.transpose();
        all.diagonal().iter().map(|variance| variance.sqrt()).collect()
    }

    /// Computes the standard deviation of the variance observed in a record of `seconds`, relative to the variance
    /// of the tip along an axis: 2 √(c X cᵀ/T)/σ² with A X + X Aᵀ + b bᵀ = 0, b = P cᵀ, for records
    /// much longer than the decay of the slowest mode.
    pub fn spread(&self, covariance: &DMatrix<f64>, axis: usize, seconds: f64) -> Option<f64> {
        let row = self.tip.row(axis).into_owned();
        let along = covariance * row.transpose();
        let found = lyapunov(&self.a, &(&along * along.transpose()))?;
        let variance = (&row * along)[0];
        Some(2.0 * ((&row * found * row.transpose())[0] / seconds).sqrt() / variance)
    }
}

/// Solves A P + P Aᵀ + Q = 0; `None` if A is not stable or its Schur form does not converge.
pub fn lyapunov(a: &DMatrix<f64>, q: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let complex = |matrix: &DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0));
    let (u, t) = dense::complex_schur(complex(a))?;
    let count = a.nrows();
    let right = u.adjoint() * complex(q) * &u;
    let mut y = DMatrix::zeros(count, count);
    for i in (0..count).rev() {
        for k in (0..count).rev() {
            let mut sum = -right[(i, k)];
            for j in i + 1..count {
                sum -= t[(i, j)] * y[(j, k)];
            }
            for j in k + 1..count {
                sum -= y[(i, j)] * t[(k, j)].conj();
            }
            let rate: Complex<f64> = t[(i, i)] + t[(k, k)].conj();
            if !(rate.re < 0.0) {
                return None;
            }
            y[(i, k)] = sum / rate;
        }
    }
    let found = (&u * y * u.adjoint()).map(|value| value.re);
    Some((&found + found.transpose()) / 2.0)
}

impl Structure {
    /// Computes the one-sided spectral densities of the tip at a frequency in Hz, mm²/Hz: H S H*.
    pub fn spectrum(
        &self,
        sigma: &Vector3<f64>,
        spectrum: &Spectrum,
        hz: f64,
    ) -> Option<Matrix3<f64>> {
        let h = self.receptance(TAU * hz)?;
        let density = sigma.map(|sigma| Complex::new(sigma * sigma * spectrum.density(hz), 0.0));
        Some((h * Matrix3::from_diagonal(&density) * h.adjoint()).map(|value| value.re))
    }
}
