// SPDX-License-Identifier: GPL-2.0-or-later
//! Free and forced response of a structure: modes, poles, receptance.

use crate::dense;
use crate::dynamics::mode::Mode;
use crate::dynamics::shapes::Shapes;
use crate::dynamics::structure::Structure;
use nalgebra::{Complex, DMatrix, DVector, Matrix3};
use std::f64::consts::TAU;

/// Number of evenly spaced steps of a response.
const EVEN: u32 = 400;

/// Steps on either side of a mode: up to sinh 4.5, 45 of its widths.
const BESIDE: i32 = 30;

impl Structure {
    /// Computes the modes without damping; `None` if some motion is unconstrained.
    pub fn shapes(&self) -> Option<Shapes> {
        Shapes::of(&self.mass, &self.stiffness)
    }

    /// Computes the modes as measured at the tool tip, lowest first; `None` as in [`Structure::shapes`]. Each has the
    /// damping that it would have alone: [`Structure::poles`] and
    /// [`Structure::receptance`] include dampers that couple modes.
    pub fn modes(&self) -> Option<Vec<Mode>> {
        let shapes = self.shapes()?;
        let mode = |(k, omega): (usize, &f64)| {
            let shape = shapes.vectors.column(k);
            let zeta = shape.dot(&(&self.damping * shape)) / (2.0 * omega);
            let tip = self.tip.fixed_rows::<3>(0) * shape;
            Mode { omega: *omega, zeta, tip }
        };
        Some(shapes.omegas.iter().enumerate().map(mode).collect())
    }

    /// Computes the poles with damping, including coupled modes: oscillating poles, with imaginary parts above 0,
    /// and real poles; by magnitude, smallest first, 1/s. `None` as in [`Structure::shapes`] or [`dense::eigenvalues`].
    pub fn poles(&self) -> Option<Vec<Complex<f64>>> {
        let shapes = self.shapes()?;
        let count = shapes.omegas.len();
        let omegas = DMatrix::from_diagonal(&DVector::from(shapes.omegas));
        // State (Ω q, q') with x = Φ q: all entries have the size of a frequency.
        let mut state = DMatrix::zeros(2 * count, 2 * count);
        state.view_mut((0, count), (count, count)).copy_from(&omegas);
        state.view_mut((count, 0), (count, count)).copy_from(&-omegas);
        let damping = shapes.vectors.tr_mul(&(&self.damping * &shapes.vectors));
        state.view_mut((count, count), (count, count)).copy_from(&-damping);
        let mut poles = dense::eigenvalues(state)?;
        poles.retain(|pole| pole.im >= 0.0);
        poles.sort_by(|a, b| a.re.hypot(a.im).total_cmp(&b.re.hypot(b.im)));
        Some(poles)
    }

    /// Computes the displacement of the tool tip per force on it that oscillates with an angular frequency in rad/s:
    /// H = S (K + iωC - ω²M)⁻¹ Sᵀ, mm/N; `None` if a motion is unconstrained.
    pub fn receptance(&self, omega: f64) -> Option<Matrix3<Complex<f64>>> {
        let dynamic = DMatrix::from_fn(self.mass.nrows(), self.mass.nrows(), |i, k| {
            let still = self.stiffness[(i, k)] - omega * omega * self.mass[(i, k)];
            Complex::new(still, omega * self.damping[(i, k)])
        });
        let tip = self.tip.fixed_rows::<3>(0).map(|value| Complex::new(value, 0.0));
        let moved = dynamic.lu().solve(&tip.transpose())?;
        let found = tip * moved;
        found
            .iter()
            .all(|value| value.re.is_finite())
            .then(|| found.fixed_view::<3, 3>(0, 0).into())
    }
}

/// Returns frequencies in Hz that resolve the peaks of a response: evenly spaced ones from 0 to `top`, and more
/// around every mode, spaced by its width.
pub fn frequencies(modes: &[Mode], top: f64) -> Vec<f64> {
    let even = (0..=EVEN).map(|k| top * f64::from(k) / f64::from(EVEN));
    let about = modes.iter().flat_map(|mode| {
        let (middle, width) = (mode.omega / TAU, mode.zeta * mode.omega / TAU);
        (-BESIDE..=BESIDE).map(move |k| middle + width * (0.15 * f64::from(k)).sinh())
    });
    let mut all: Vec<f64> = even.chain(about).filter(|hz| (0.0..=top).contains(hz)).collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

impl Structure {
    /// Returns the lowest natural frequency in Hz, and the largest displacement of the tip per force on it, in any
    /// direction, at one of the natural frequencies, mm/N.
    pub fn softest(&self) -> Option<[f64; 2]> {
        let shapes = self.shapes()?;
        let peak = |omega: &f64| Some(self.receptance(*omega)?.singular_values().max());
        let peaks: Option<Vec<f64>> = shapes.omegas.iter().map(peak).collect();
        Some([shapes.omegas.first()? / TAU, peaks?.into_iter().fold(0.0, f64::max)])
    }
}
