// SPDX-License-Identifier: GPL-2.0-or-later
//! Cutting of the surface that the previous pass left: by a cutter's teeth, or the single edge of a lathe tool.
//!
//! In the cutter plane x is the feed, y its normal, z the spindle axis; a tooth at angle φ from +y
//! is clockwise seen from +z, and the tool is displaced by u from its position in the previous pass. The
//! force on the tool per millimeter of depth is `B(φ) (u - u')`, with u' one tooth earlier:
//! `B = [-(Kt c + Kr s) ; Kt s - Kr c ; Ka] (s, c)`, s and c of φ (Altintas and Budak 1995).

use crate::dynamics::milling::on_tool;
use crate::dynamics::mode::Mode;
use crate::study::cutting::{Cutting, Turning};
use nalgebra::{Complex, Matrix2x3, Matrix3, Matrix3x2, Rotation3, Vector2, Vector3};
use std::f64::consts::TAU;

/// A mode projected on the process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    pub omega: f64,
    pub zeta: f64,
    /// Components of the mass-normalized mode that change the chip: x and y, or the thickness, 1/√t.
    pub motion: Vector2<f64>,
    /// Components on which the force acts: x, y and z, or along the force, 1/√t.
    pub force: Vector3<f64>,
}

/// The law of the force.
#[derive(Clone, Copy, Debug, PartialEq)]
enum ForceLaw {
    Milling([f64; 3]),
    Turning(f64),
}

/// A process with a delay of one tooth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Process {
    /// Number of teeth, evenly spaced.
    pub teeth: usize,
    /// Angles at which a tooth enters and leaves, rad.
    pub arc: [f64; 2],
    kind: ForceLaw,
}

impl From<&Cutting> for Process {
    fn from(cutting: &Cutting) -> Self {
        Self {
            teeth: cutting.teeth.into(),
            arc: cutting.arc(),
            kind: ForceLaw::Milling(cutting.coefficients),
        }
    }
}

impl From<&Turning> for Process {
    fn from(turning: &Turning) -> Self {
        Self { teeth: 1, arc: [0.0, TAU], kind: ForceLaw::Turning(turning.kf_n_per_mm2.0) }
    }
}

impl Process {
    /// Returns the angle from tooth to tooth, rad.
    pub fn pitch(&self) -> f64 {
        TAU / self.teeth as f64
    }

    /// Returns whether no force acts along the spindle axis.
    pub fn is_flat(&self) -> bool {
        match self.kind {
            ForceLaw::Milling([_, _, axial]) => axial == 0.0,
            ForceLaw::Turning(_) => true,
        }
    }

    /// Returns the time from tooth to tooth at a spindle speed in 1/min, s.
    pub fn delay(&self, rpm: f64) -> f64 {
        60.0 / (self.teeth as f64 * rpm)
    }

    /// Returns the force of a tooth in cut at an angle per depth and displacement, N/mm².
    pub fn at(&self, angle: f64) -> Matrix3x2<f64> {
        match self.kind {
            ForceLaw::Milling(coefficients) => {
                let (s, c) = angle.sin_cos();
                on_tool(coefficients, angle) * Vector2::new(s, c).transpose()
            }
            ForceLaw::Turning(kf) => Matrix3x2::new(kf, 0.0, 0.0, 0.0, 0.0, 0.0),
        }
    }

    /// Returns the integral of [`Process::at`] between two angles of the cut, N/mm².
    pub fn integral(&self, low: f64, high: f64) -> Matrix3x2<f64> {
        match self.kind {
            ForceLaw::Milling([kt, kr, ka]) => {
                // Integrals of s s, s c, c c, s and c.
                let of = |f: fn(f64) -> f64| f(high) - f(low);
                let ss = of(|a| a / 2.0 - (2.0 * a).sin() / 4.0);
                let sc = of(|a| -(2.0 * a).cos() / 4.0);
                let cc = of(|a| a / 2.0 + (2.0 * a).sin() / 4.0);
                let (s, c) = (of(|a| -a.cos()), of(f64::sin));
                Matrix3x2::new(
                    -kt * sc - kr * ss,
                    -kt * cc - kr * sc,
                    kt * ss - kr * sc,
                    kt * sc - kr * cc,
                    ka * s,
                    ka * c,
                )
            }
            ForceLaw::Turning(_) => self.at(low) * (high - low),
        }
    }

    /// Returns the mean over a turn, all teeth, for the zero-order approximation, N/mm².
    pub fn mean(&self) -> Matrix3x2<f64> {
        self.integral(self.arc[0], self.arc[1]) / self.pitch()
    }

    /// Returns the mean of all teeth while the first one turns from `low` to `high`.
    pub fn mean_between(&self, low: f64, high: f64) -> Matrix3x2<f64> {
        let teeth = self.teeth as i64;
        let mut sum = Matrix3x2::zeros();
        // Every tooth in this turn and the previous one.
        for tooth in -teeth..teeth {
            let shift = self.pitch() * tooth as f64;
            let [from, to] = [low, high].map(|a| (a + shift).clamp(self.arc[0], self.arc[1]));
            if to > from {
                sum += self.integral(from, to);
            }
        }
        sum / (high - low)
    }

    /// Divides one pitch, from the entry of the first tooth, into pieces in which the same teeth are in cut,
    /// given as shifts of the angle.
    pub fn pieces(&self) -> Vec<Piece> {
        let pitch = self.pitch();
        let wide = self.arc[1] - self.arc[0];
        let split = wide.rem_euclid(pitch);
        let is_even = split.min(pitch - split) < 1e-9;
        let edges = if is_even { vec![0.0, pitch] } else { vec![0.0, split, pitch] };
        let piece = |pair: &[f64]| {
            let middle = (pair[0] + pair[1]) / 2.0;
            let shifts = (0..self.teeth).map(|tooth| pitch * tooth as f64);
            let shifts = shifts.filter(|shift| middle + shift < wide).collect();
            Piece { from: self.arc[0] + pair[0], to: self.arc[0] + pair[1], shifts }
        };
        edges.windows(2).map(piece).collect()
    }
}

/// A part of a tooth period in which the same teeth cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// Angle of the first tooth at its start, rad.
    pub from: f64,
    /// Angle of the first tooth at its end, rad.
    pub to: f64,
    /// Angles by which the teeth in cut are ahead of the first one; empty if no tooth cuts.
    pub shifts: Vec<f64>,
}

/// A feed along the spindle axis.
#[derive(Clone, Copy, Debug, thiserror::Error, PartialEq)]
#[error("the feed is along the spindle axis: use a feed across it")]
pub struct AlongAxis;

/// Projects modes on the cutter plane whose axes are the columns of `plane`.
pub fn milling_rows(modes: &[Mode], plane: &Matrix3<f64>) -> Vec<Row> {
    let row = |mode: &Mode| {
        let force = plane.transpose() * mode.tip;
        Row { omega: mode.omega, zeta: mode.zeta, motion: force.xy(), force }
    };
    modes.iter().map(row).collect()
}

/// Returns the same modes with the feed turned by an angle in the cutter plane, rad.
pub fn turned(rows: &[Row], angle: f64) -> Vec<Row> {
    let back = Rotation3::from_axis_angle(&Vector3::z_axis(), -angle);
    let row = |row: &Row| {
        let force = back * row.force;
        let motion = (back * Vector3::new(row.motion.x, row.motion.y, 0.0)).xy();
        Row { motion, force, ..*row }
    };
    rows.iter().map(row).collect()
}

/// Projects modes on the thickness and the force of a lathe tool's edge.
pub fn turning_rows(modes: &[Mode], turning: &Turning) -> Vec<Row> {
    let [thicker, force] = [turning.thicker.0, turning.force.0];
    let row = |mode: &Mode| Row {
        omega: mode.omega,
        zeta: mode.zeta,
        motion: Vector2::new(thicker.dot(&mode.tip), 0.0),
        force: Vector3::new(force.dot(&mode.tip), 0.0, 0.0),
    };
    modes.iter().map(row).collect()
}

/// Returns the displacement that changes the chip per force, at an angular frequency, mm/N.
pub fn receptance(rows: &[Row], omega: f64) -> Matrix2x3<Complex<f64>> {
    let mut sum = Matrix2x3::from_element(Complex::new(0.0, 0.0));
    for row in rows {
        let below =
            Complex::new(row.omega * row.omega - omega * omega, 2.0 * row.zeta * row.omega * omega);
        let share = below.inv();
        for i in 0..2 {
            for k in 0..3 {
                sum[(i, k)] += share * (row.motion[i] * row.force[k]);
            }
        }
    }
    sum
}
