// SPDX-License-Identifier: GPL-2.0-or-later
//! Observability: the rank of the readings' derivatives, and named changes of the machine that no
//! reading detects.
//!
//! With struts, varied orientation and known frames the full pose determines all 42 parameters;
//! the tip's position 39, because it does not depend on the orientation of the platform's own axes about the tip;
//! distances 33, because they do not depend on a common motion of base and frame. At constant orientation base and
//! platform anchors of a leg are observable only as their difference: 24 at most.

use super::constraint::{self, Motion};
use super::model::{Frame, Model, Quantity, unit};
use super::reading::{Measured, Reading};
use kinematics::Vector3;
use nalgebra::{DMatrix, DVector};

/// Singular values below this share of the largest one are rounding errors of the derivatives, which are
/// accurate to about 1e-8.
const ROUNDING: f64 = 1e-7;

/// Least share of a change in the unobservable space for which it is reported as unobservable: a screw's
/// lead depends slightly on rotations of the base, because the axes of its joints do not rotate with it.
const NEARLY_ALL: f64 = 0.99;

/// A change of the machine that the readings do not detect.
struct Unseen {
    text: &'static str,
    change: DVector<f64>,
}

/// Converts derivatives to units of the drawing's tolerances.
fn scaled(model: &Model, jacobian: &DMatrix<f64>) -> DMatrix<f64> {
    let deviation = |k: usize| model.parameters[k].deviation;
    DMatrix::from_fn(jacobian.nrows(), jacobian.ncols(), |i, k| jacobian[(i, k)] * deviation(k))
}

/// Returns the number of independent changes that the readings determine, without noise.
pub fn rank(model: &Model, jacobian: &DMatrix<f64>) -> usize {
    let values = scaled(model, jacobian).singular_values();
    values.iter().filter(|value| **value > ROUNDING * values.max()).count()
}

/// Returns unit columns that span the null space of a matrix.
fn null_space(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let n = matrix.ncols();
    // At least as many rows as columns: only then are all right singular vectors computed.
    let square = matrix.clone().resize_vertically(matrix.nrows().max(n), 0.0);
    let svd = square.svd(false, true);
    let largest = svd.singular_values.max();
    let Some(v) = svd.v_t else { return DMatrix::zeros(n, 0) };
    let is_nothing = |k: &usize| svd.singular_values[*k] <= ROUNDING * largest;
    let rows: Vec<usize> = (0..n).filter(is_nothing).collect();
    v.select_rows(&rows).transpose()
}

/// Returns the number of independent changes that the readings determine better than the drawing does.
pub(crate) fn improved(model: &Model, jacobian: &DMatrix<f64>, noise: f64) -> usize {
    let values = scaled(model, jacobian).singular_values();
    values.iter().filter(|value| **value > noise).count()
}

/// Explains a rank below the number of parameters: how many independent changes no reading detects, for each
/// kind. The numbers add up to the difference.
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
        // If less of the unit vector is new, it is a combination of those before it.
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
            "changes that these poses do not distinguish: vary position and orientation",
        ));
    }
    found
}

/// Returns the part of a vector that is orthogonal to the columns of a matrix of unit columns.
fn rejected(columns: &DMatrix<f64>, vector: &DVector<f64>) -> DVector<f64> {
    let once = vector - columns * (columns.transpose() * vector);
    // Repeated to reduce rounding.
    &once - columns * (columns.transpose() * &once)
}

/// Returns changes that some types of measurement do not detect.
fn candidates(model: &Model, readings: &[Reading]) -> Vec<Unseen> {
    let mut all = vec![];
    let axes = || (0..3).map(unit);
    let frames: Vec<Frame> = (0..model.frames.len()).map(|k| model.frame(k, &[])).collect();
    for axis in axes() {
        let text = "rotation of the platform frame about the tip: only the tip position was measured, \
                    not the orientation";
        let tip = readings.first().map_or(Vector3::zeros(), |reading| -reading.tool);
        let motion = Motion { turn: axis, shift: -axis.cross(&tip) };
        let change = filled(model, |quantity| match quantity {
            Quantity::Platform(leg, k) => {
                axis.cross(&(Vector3::from(model.geometry.legs()[leg].platform) - tip))[k]
            }
            Quantity::Constraint(n, part) => {
                let own = &model.geometry.constraints()[n];
                constraint::with_platform(own, part, &motion, model.radius())
            }
            _ => 0.0,
        });
        all.push(Unseen { text, change });
    }
    let text = "joint position of base and measuring frame: the frame is estimated from the same \
                readings";
    let with_base = |n: usize, part, motion: &Motion| {
        constraint::with_base(&model.geometry.constraints()[n], part, motion, model.radius())
    };
    for axis in axes() {
        let motion = Motion { turn: Vector3::zeros(), shift: axis };
        let change = filled(model, |quantity| match quantity {
            Quantity::Base(_, k) | Quantity::Frame(_, k @ 0..3) => axis[k],
            Quantity::Constraint(n, part) => with_base(n, part, &motion),
            _ => 0.0,
        });
        all.push(Unseen { text, change });
    }
    for axis in axes() {
        let motion = Motion { turn: axis, shift: Vector3::zeros() };
        let change = filled(model, |quantity| match quantity {
            Quantity::Constraint(n, part) => with_base(n, part, &motion),
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
    all.extend(about_common_lines(model));
    all.extend(across_planes(model));
    all
}

/// Returns the shifts of base anchors across the planes in which constraints keep their legs.
fn across_planes(model: &Model) -> Vec<Unseen> {
    let text = "shifts of a leg's base across the plane in which a constraint keeps the leg: its length hardly \
                depends on them";
    let legs = constraint::legs_in_planes(&model.geometry, model.size());
    let shift = |(own, normal): (usize, Vector3<f64>)| {
        let change = filled(model, |quantity| match quantity {
            Quantity::Base(leg, k) if leg == own => normal[k],
            _ => 0.0,
        });
        Unseen { text, change }
    };
    legs.into_iter().map(shift).collect()
}

/// Returns the turns of planes of the platform about the line in which they meet.
fn about_common_lines(model: &Model) -> Vec<Unseen> {
    let text = "turns of two planes of the platform about the line in which they meet: the point of base stays on it";
    constraint::about_common_lines(&model.geometry, model.size())
        .into_iter()
        .map(|(own, motion)| {
            let change = filled(model, |quantity| match quantity {
                Quantity::Constraint(n, part) if n == own => {
                    let own = &model.geometry.constraints()[n];
                    constraint::with_platform(own, part, &motion, model.radius())
                }
                _ => 0.0,
            });
            Unseen { text, change }
        })
        .collect()
}

/// Returns the rotations of frames of ball bars: only the center's position matters, not the frame's orientation.
fn of_distances(model: &Model, readings: &[Reading]) -> Vec<Unseen> {
    let only_distances = |frame: usize| {
        let mut own = readings.iter().filter(|reading| reading.frame == frame).peekable();
        own.peek().is_some() && own.all(|reading| matches!(reading.measured, Measured::Distance(_)))
    };
    let text = "orientation of the frame of a ball bar";
    let frames = (0..model.frames.len()).filter(|frame| only_distances(*frame));
    let turn = |frame: usize, axis: usize| {
        filled(model, |quantity| f64::from(u8::from(quantity == Quantity::Frame(frame, axis))))
    };
    frames
        .flat_map(|frame| (3..6).map(move |axis| (frame, axis)))
        .map(|(frame, axis)| Unseen { text, change: turn(frame, axis) })
        .collect()
}

/// Returns the equal displacements of base and platform anchor of one leg.
fn at_one_orientation(model: &Model, readings: &[Reading]) -> Vec<Unseen> {
    let Some(first) = readings.first() else { return vec![] };
    let rotation = first.pose.rotation();
    let text = "equal shifts of base and platform anchor of one leg: at one orientation only their \
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
