// SPDX-License-Identifier: GPL-2.0-or-later
//! The table of a study that describes the platform as a body.

use crate::study::number::Positive;
use kinematics::{Matrix3, Vector3};
use serde::Deserialize;

/// `[platform]`: the body that moves with the platform joints, spindle and tool included.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Platform {
    pub mass_kg: Positive,
    /// Center of mass in the platform frame.
    pub centre_mm: Position,
    /// Inertia tensor about the center of mass, platform axes; products of inertia are entered
    /// with the sign they have in the tensor, I_xy = −∫ x y dm.
    pub inertia_kg_m2: Option<Inertia>,
    /// Direction of the weight in the machine frame, any length; −Z if it is missing.
    pub down: Option<Direction>,
    /// Whether the stiffness includes the terms of the weight and of the leg forces that support it.
    #[serde(default)]
    pub geometric_stiffness: bool,
}

/// A position: three finite numbers.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(try_from = "[f64; 3]")]
pub struct Position(pub Vector3<f64>);

/// A number that is not finite.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("{0}: expected a finite number")]
pub struct NotFinite(f64);

impl TryFrom<[f64; 3]> for Position {
    type Error = NotFinite;

    fn try_from(values: [f64; 3]) -> Result<Self, NotFinite> {
        match values.into_iter().find(|value| !value.is_finite()) {
            None => Ok(Self(values.into())),
            Some(value) => Err(NotFinite(value)),
        }
    }
}

/// A unit vector.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(try_from = "[f64; 3]")]
pub struct Direction(pub Vector3<f64>);

/// Three numbers without a direction.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("expected a direction: three finite numbers, not all 0")]
pub struct NoDirection;

impl TryFrom<[f64; 3]> for Direction {
    type Error = NoDirection;

    fn try_from(values: [f64; 3]) -> Result<Self, NoDirection> {
        let largest = values.into_iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        let scaled = Vector3::from(values) / largest;
        match scaled.iter().all(|value| value.is_finite()) {
            true => Ok(Self(scaled.normalize())),
            false => Err(NoDirection),
        }
    }
}

/// An inertia tensor of a possible body, kg m².
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(try_from = "[[f64; 3]; 3]")]
pub struct Inertia(pub Matrix3<f64>);

/// Why no body can have an inertia tensor.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum BodyError {
    #[error("expected finite numbers")]
    NotFinite,
    #[error("expected a symmetric tensor; found {0} and {1} on opposite sides of the diagonal")]
    Asymmetric(f64, f64),
    #[error("not a physical inertia: a principal moment is {0:.6}, expected more than 0")]
    NotPositive(f64),
    #[error(
        "not a physical inertia: of the principal moments {0:.6}, {1:.6} and {2:.6} the largest exceeds \
         the sum of the others; check the signs of the products of inertia"
    )]
    Triangle(f64, f64, f64),
}

/// Tolerance of the rules of an inertia tensor, as a share of its largest moment: users may have
/// rounded the values to six digits.
const ROUNDED: f64 = 1e-6;

impl TryFrom<[[f64; 3]; 3]> for Inertia {
    type Error = BodyError;

    fn try_from(rows: [[f64; 3]; 3]) -> Result<Self, BodyError> {
        let tensor = Matrix3::from(rows).transpose();
        if !tensor.iter().all(|value| value.is_finite()) {
            return Err(BodyError::NotFinite);
        }
        let size = tensor.amax();
        for (i, k) in [(0, 1), (0, 2), (1, 2)] {
            if (tensor[(i, k)] - tensor[(k, i)]).abs() > ROUNDED * size {
                return Err(BodyError::Asymmetric(tensor[(i, k)], tensor[(k, i)]));
            }
        }
        let tensor = (tensor + tensor.transpose()) / 2.0;
        let mut moments: [f64; 3] = tensor.symmetric_eigenvalues().into();
        moments.sort_by(f64::total_cmp);
        let [least, middle, most] = moments;
        if !(least > 0.0) {
            return Err(BodyError::NotPositive(least));
        }
        if most > (least + middle) * (1.0 + ROUNDED) {
            return Err(BodyError::Triangle(least, middle, most));
        }
        Ok(Self(tensor))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_inertia_that_no_body_has_is_refused_with_the_reason() {
        let of = |rows: [[f64; 3]; 3]| Inertia::try_from(rows).unwrap_err().to_string();
        let diagonal = |a, b, c| [[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]];
        assert!(of(diagonal(0.4, 0.4, 0.9)).contains("exceeds the sum"));
        assert!(of(diagonal(0.4, 0.4, -0.1)).contains("expected more than 0"));
        assert!(of(diagonal(0.4, 0.0, 0.4)).contains("expected more than 0"));
        assert!(of(diagonal(0.4, f64::NAN, 0.4)).contains("finite"));
        let skew = [[0.4, 0.1, 0.0], [-0.1, 0.4, 0.0], [0.0, 0.0, 0.4]];
        assert!(of(skew).contains("found 0.1 and -0.1"));
        // Products of inertia as large as these would need a negative mass somewhere.
        let coupled = [[0.4, 0.5, 0.0], [0.5, 0.4, 0.0], [0.0, 0.0, 0.4]];
        assert!(of(coupled).contains("-0.1"));
    }

    #[test]
    fn a_thin_rod_and_a_thin_plate_are_bodies() {
        for rows in [[0.5, 0.5, 1.0], [0.3, 0.3, 1e-9]] {
            let [a, b, c] = rows;
            let tensor = [[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]];
            assert_eq!(Inertia::try_from(tensor).map(|i| i.0[(2, 2)]), Ok(c));
        }
    }
}
