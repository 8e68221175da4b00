// SPDX-License-Identifier: GPL-2.0-or-later
//! What the readings do not tell: rank of their derivatives, and changes of the machine that no
//! reading sees, by name.
//!
//! With struts, varied orientation and known frames the full pose determines all 42 parameters;
//! the tip's place 39, for nobody sees how the platform's own axes lie about the tip; distances 33,
//! for nobody sees where base and frame stand together. At constant orientation base and platform
//! anchors of a leg show as their difference only: 24 at most.

use super::model::{Frame, Model, Quantity, unit};
use super::reading::{Measured, Reading};
use kinematics::Vector3;
use nalgebra::{DMatrix, DVector};

/// Singular values below this share of the largest one are rounding of the derivatives, which are
/// good to about 1e-8.
const ROUNDING: f64 = 1e-7;

/// Share of a change that lies in what no reading sees, where it is said to be unseen: a screw's
/// lead shows turns of the base a little, for the axes of its joints do not turn with it.
const NEARLY_ALL: f64 = 0.99;

/// A change of the machine that the readings do not see.
struct Unseen {
    text: &'static str,
    change: DVector<f64>,
}

/// Derivatives in units of the drawing's tolerances.
fn scaled(model: &Model, jacobian: &DMatrix<f64>) -> DMatrix<f64> {
    let deviation = |k: usize| model.parameters[k].deviation;
    DMatrix::from_fn(jacobian.nrows(), jacobian.ncols(), |i, k| jacobian[(i, k)] * deviation(k))
}

/// Number of independent changes that the readings tell apart, in principle.
pub fn rank(model: &Model, jacobian: &DMatrix<f64>) -> usize {
    let values = scaled(model, jacobian).singular_values();
    values.iter().filter(|value| **value > ROUNDING * values.max()).count()
}

/// Unit columns that span what a matrix makes nothing of.
fn null_space(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.ncols();
    // At least as many rows as columns: only then are all right singular vectors found.
    let square = matrix.clone().resize_vertically(matrix.nrows().max(n), 0.0);
    let svd = square.svd(false, true);
    let largest = svd.singular_values.max();
    let Some(v) = svd.v_t else { return DMatrix::zeros(n, 0) };
    let is_nothing = |k: &usize| svd.singular_values[*k] <= ROUNDING * largest;
    let rows: Vec<usize> = (0..n).filter(is_nothing).collect();
    v.select_rows(&rows).transpose()
}

/// Number of independent changes that the readings know better than the drawing does.
pub(crate) fn improved(model: &Model, jacobian: &DMatrix<f64>, noise: f64) -> usize {
    let values = scaled(model, jacobian).singular_values();
    values.iter().filter(|value| **value > noise).count()
}

/// Why the rank is not that of all parameters: how many independent changes no reading sees, each
/// kind in words. The numbers add up to what is missing.
pub fn unseen(
    model: &Model,
    readings: &[Reading],
    jacobian: &DMatrix<f64>,
) -> Vec<(usize, &'static str)> {
    let missing = model.parameters.len() - rank(model, jacobian);
    let nothing = null_space(&scaled(model, jacobian));
    let mut found: Vec<(usize, &'static str)> = vec![];
    let mut known = DMatrix::zeros(model.parameters.len(), 0);
    for Unseen { text, change } in candidates(model, readings) {
        let own = DVector::from_fn(change.len(), |k, _| change[k] / model.parameters[k].deviation);
        let norm = own.norm();
        let is_unseen = norm > 0.0 && (nothing.transpose() * &own).norm() > NEARLY_ALL * norm;
        let new = rejected(&known, &(own / norm));
        // Of a unit vector: below that it is a combination of those before it.
        if !is_unseen || !(new.norm() > 1e-6) {
            continue;
        }
        known = known.clone().insert_column(known.ncols(), 0.0);
        let last = known.ncols() - 1;
        known.set_column(last, &(&new / new.norm()));
        match found.iter_mut().find(|(_, other)| *other == text) {
            Some((count, _)) => *count += 1,
            None => found.push((1, text)),
        }
    }
    let named: usize = found.iter().map(|(count, _)| count).sum();
    if missing > named {
        found.push((
            missing - named,
            "changes that these poses do not tell apart: vary place and orientation",
        ));
    }
    found
}

/// What of a vector is square to the columns of a matrix of unit columns.
fn rejected(columns: &DMatrix<f64>, vector: &DVector<f64>) -> DVector<f64> {
    let once = vector - columns * (columns.transpose() * vector);
    // A second time, for rounding.
    &once - columns * (columns.transpose() * &once)
}

/// Changes that some kind of measurement does not see.
fn candidates(model: &Model, readings: &[Reading]) -> Vec<Unseen> {
    let mut all = vec![];
    let axes = || (0..3).map(unit);
    let frames: Vec<Frame> = (0..model.frames.len()).map(|k| model.frame(k, &[])).collect();
    for axis in axes() {
        let text = "turn of the platform's own axes about the tip: only where the tip is was measured, \
                    not how the platform is turned";
        let tip = readings.first().map_or(Vector3::zeros(), |reading| -reading.tool);
        let change = filled(model, |quantity| match quantity {
            Quantity::Platform(leg, k) => {
                axis.cross(&(Vector3::from(model.geometry.legs()[leg].platform) - tip))[k]
            }
            _ => 0.0,
        });
        all.push(Unseen { text, change });
    }
    let text = "where base and measuring frame stand together: the frame's own place is measured by \
                the same readings";
    for axis in axes() {
        let change = filled(model, |quantity| match quantity {
            Quantity::Base(_, k) | Quantity::Frame(_, k @ 0..3) => axis[k],
            _ => 0.0,
        });
        all.push(Unseen { text, change });
    }
    for axis in axes() {
        let change = filled(model, |quantity| match quantity {
            Quantity::Base(leg, k) => {
                axis.cross(&Vector3::from(model.geometry.legs()[leg].base))[k]
            }
            Quantity::Frame(number, k @ 0..3) => axis.cross(&frames[number].origin)[k],
            Quantity::Frame(_, k) => axis[k - 3],
            _ => 0.0,
        });
        all.push(Unseen { text, change });
    }
    all.extend(at_one_orientation(model, readings));
    all.extend(of_distances(model, readings));
    all
}

/// Of a ball-bar only the centre's place counts, not how its frame is turned.
fn of_distances(model: &Model, readings: &[Reading]) -> Vec<Unseen> {
    let only_distances = |frame: usize| {
        let own = readings.iter().filter(|reading| reading.frame == frame);
        own.into_iter().all(|reading| matches!(reading.measured, Measured::Distance(_)))
    };
    let text = "how the frame of a ball-bar is turned";
    let frames = (0..model.frames.len()).filter(|frame| only_distances(*frame));
    let turn = |frame: usize, axis: usize| {
        filled(model, |quantity| f64::from(u8::from(quantity == Quantity::Frame(frame, axis))))
    };
    frames
        .flat_map(|frame| (3..6).map(move |axis| (frame, axis)))
        .map(|(frame, axis)| Unseen { text, change: turn(frame, axis) })
        .collect()
}

/// Base and platform anchor of one leg moved alike.
fn at_one_orientation(model: &Model, readings: &[Reading]) -> Vec<Unseen> {
    let Some(first) = readings.first() else { return vec![] };
    let rotation = first.pose.rotation();
    let text = "base and platform anchor of one leg moved alike: at one orientation only their \
                difference shows; measure at several tilts";
    let alike = |leg: usize, axis: usize| {
        filled(model, |quantity| match quantity {
            Quantity::Base(own, k) if own == leg => rotation[(k, axis)],
            Quantity::Platform(own, k) if own == leg => f64::from(u8::from(k == axis)),
            _ => 0.0,
        })
    };
    (0..model.geometry.legs().len())
        .flat_map(|leg| (0..3).map(move |axis| (leg, axis)))
        .map(|(leg, axis)| Unseen { text, change: alike(leg, axis) })
        .collect()
}

fn filled(model: &Model, value: impl Fn(Quantity) -> f64) -> DVector<f64> {
    DVector::from_iterator(
        model.parameters.len(),
        model.parameters.iter().map(|parameter| value(parameter.quantity)),
    )
}
