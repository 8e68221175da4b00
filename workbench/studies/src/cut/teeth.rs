// SPDX-License-Identifier: GPL-2.0-or-later
//! The force of a milling cutter over one tooth pitch, or of the edge of a lathe tool.

use crate::dynamics::milling::{Milling, frame};
use crate::study::cutting::{Cutting, Turning};
use crate::study::forcing;
use kinematics::{Matrix3, Vector3};
use nalgebra::Complex;
use std::f64::consts::TAU;

/// Angles in a pitch: the force of a tooth that enters or leaves is off by a two-hundredth of a pitch.
const ANGLES: usize = 200;

/// Harmonics of the tooth frequency: those with at least ten angles per period.
pub const HARMONICS: usize = ANGLES / 10;

/// Forces on the tool at even angles of a pitch: those of a milling cutter in the frame of
/// [`crate::dynamics::milling::frame`], the constant one of a lathe tool in machine axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Teeth {
    pub count: u16,
    /// N for each mm of feed per tooth.
    per_chip: Vec<Vector3<f64>>,
    /// Force of the edges alone, N.
    edge: Vec<Vector3<f64>>,
    is_turning: bool,
}

impl Teeth {
    /// Computes the forces of a cutter at a depth of cut in mm; `run` contains its edge and helix, if given.
    pub fn of(cutter: &Cutting, run: Option<&forcing::Milling>, depth: f64) -> Self {
        let plain = Milling {
            teeth: cutter.teeth,
            speed: 0.0,
            feed: 0.0,
            depth,
            arc: cutter.arc(),
            cutting: cutter.coefficients,
            edge: [0.0; 3],
            lag: 0.0,
        };
        let milling = run.map_or(plain, |run| Milling::of(cutter, run, depth));
        let forces = |milling: Milling| -> Vec<Vector3<f64>> {
            let pitch = TAU / f64::from(cutter.teeth);
            let angle = |k: usize| pitch * (k as f64 + 0.5) / ANGLES as f64;
            (0..ANGLES).map(|k| milling.force(angle(k))).collect()
        };
        Self {
            count: cutter.teeth,
            per_chip: forces(Milling { feed: 1.0, edge: [0.0; 3], ..milling }),
            edge: forces(Milling { feed: 0.0, ..milling }),
            is_turning: false,
        }
    }

    /// Computes the force of a lathe tool at a depth of cut in mm: per area of the chip, which is the depth times the feed
    /// per revolution.
    pub fn of_edge(turning: &Turning, depth: f64) -> Self {
        let per_chip = vec![turning.force.0 * (turning.kf_n_per_mm2.0 * depth)];
        Self { count: 1, per_chip, edge: vec![Vector3::zeros()], is_turning: true }
    }

    /// Returns whether the work rotates: the force is constant and shakes nothing.
    pub fn is_turning(&self) -> bool {
        self.is_turning
    }

    /// Returns the axes of the forces as columns, for a tool with this orientation in base: feed, across and tool axis; those
    /// of the machine in turning. The force of a plunge counts as that of a feed along the tool's X.
    pub fn frame(&self, feed: &Vector3<f64>, rotation: &Matrix3<f64>) -> Matrix3<f64> {
        if self.is_turning {
            return Matrix3::identity();
        }
        let axis = rotation.column(2).into_owned();
        feed.try_normalize(0.0).and_then(|feed| frame(&feed, &axis)).unwrap_or(*rotation)
    }

    /// Computes the feed per tooth, or per revolution in turning, in mm from the speed along the path in mm/s and the spindle speed in 1/min.
    pub fn chip(&self, speed: f64, rpm: f64) -> f64 {
        speed * 60.0 / (f64::from(self.count) * rpm)
    }

    /// Computes the forces at all angles, N, from the feed per tooth in mm.
    pub fn forces(&self, chip: f64) -> impl Iterator<Item = Vector3<f64>> + '_ {
        self.per_chip.iter().zip(&self.edge).map(move |(force, edge)| force * chip + edge)
    }

    pub fn mean(&self, chip: f64) -> Vector3<f64> {
        self.forces(chip).sum::<Vector3<f64>>() / self.per_chip.len() as f64
    }

    /// Returns the magnitude of the largest force.
    pub fn peak(&self, chip: f64) -> f64 {
        self.forces(chip).map(|force| force.norm()).fold(0.0, f64::max)
    }

    /// Computes the component of the force at `harmonic` times the tooth frequency: its complex amplitude, so that
    /// the force is the real part of the sum of amplitude times e^(i harmonic angle).
    pub fn harmonic(&self, chip: f64, harmonic: usize) -> Vector3<Complex<f64>> {
        let part = |(k, force): (usize, Vector3<f64>)| {
            let turn = turn(-phase(k, harmonic)) * (2.0 / ANGLES as f64);
            force.map(|value| turn * value)
        };
        self.forces(chip).enumerate().map(part).sum()
    }

    /// Computes the largest displacement of a motion with such amplitudes, starting at the tooth frequency.
    pub fn swing(amplitudes: &[Vector3<Complex<f64>>]) -> f64 {
        let at = |k: usize| {
            let turned = amplitudes.iter().zip(1..).map(|(amplitude, harmonic)| {
                let turn = turn(phase(k, harmonic));
                amplitude.map(|value| (value * turn).re)
            });
            turned.sum::<Vector3<f64>>().norm()
        };
        (0..ANGLES).map(at).fold(0.0, f64::max)
    }
}

fn phase(k: usize, harmonic: usize) -> f64 {
    TAU * (k as f64 + 0.5) * harmonic as f64 / ANGLES as f64
}

fn turn(angle: f64) -> Complex<f64> {
    let (sin, cos) = angle.sin_cos();
    Complex::new(cos, sin)
}
