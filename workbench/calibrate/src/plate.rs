// SPDX-License-Identifier: GPL-2.0-or-later
//! The plate with holes that the calibration program probes, and its pose.

use super::model::Frame;
use kinematics::Vector3;
use machine::files::{AtFile, Locate, read_text};
use nalgebra::Matrix3;
use serde::Deserialize;
use std::io;
use std::path::Path;

/// Largest deviation of a hole from its position, as a share of the least distance between holes: beyond it, it
/// may be another hole.
const ASTRAY: f64 = 0.25;

/// A plate as described in its TOML file.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Plate {
    /// `mm` or `inch`: the unit of all lengths in the file.
    pub unit: Unit,
    /// Diameter of the probe's ball.
    pub ball: f64,
    pub hole: Vec<Hole>,
}

#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    /// Millimeter.
    Mm,
    Inch,
}

/// A bore perpendicular to the plate's face.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Hole {
    /// Number of the hole in the log.
    pub number: u32,
    /// X, Y of its axis on the plate; Z is up, 0 on the face.
    pub place: [f64; 2],
    pub diameter: f64,
}

/// Why a plate cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum PlateError {
    #[error(transparent)]
    Unread(#[from] AtFile<io::Error>),
    #[error(transparent)]
    Malformed(#[from] AtFile<toml::de::Error>),
    #[error(transparent)]
    Bad(#[from] AtFile<BadPlate>),
}

/// Why a plate cannot be probed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BadPlate {
    #[error("ball = {0}: expected a diameter above 0")]
    Ball(f64),
    #[error("hole {number}: diameter = {diameter}: expected more than the ball diameter, {ball}")]
    Narrow { number: u32, diameter: f64, ball: f64 },
    #[error("hole {0}: place: expected two numbers")]
    Nowhere(u32),
    #[error("hole {0} is given twice")]
    Twice(u32),
}

/// Why touches do not determine the pose of a plate.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Astray {
    #[error(
        "touches in {0} holes do not determine the position of the plate: probe at least three that are not collinear"
    )]
    TooFew(usize),
    #[error(
        "holes in the wrong order: in the log hole {}; number them like that and probe again, or \
         correct the numbers in the log",
        .0.iter().map(|(number, other)| format!("{number} is {other}")).collect::<Vec<_>>().join(", ")
    )]
    Order(Vec<(u32, u32)>),
    #[error("hole {0} is {1:.1} from its position on the plate: check that this plate was probed")]
    Away(u32, f64),
}

impl Plate {
    /// Reads a plate in machine units.
    ///
    /// # Errors
    /// See [`PlateError`].
    pub fn read(file: &Path, units_per_mm: f64) -> Result<Self, PlateError> {
        let text = read_text(file)?;
        let plate: Self = toml::from_str(&text).at(file)?;
        plate.check().at(file)?;
        let scale = units_per_mm * if plate.unit == Unit::Mm { 1.0 } else { 25.4 };
        Ok(plate.scaled(scale))
    }

    fn check(&self) -> Result<(), BadPlate> {
        if !(self.ball > 0.0) {
            return Err(BadPlate::Ball(self.ball));
        }
        for (i, hole) in self.hole.iter().enumerate() {
            let Hole { number, diameter, place } = *hole;
            if !(diameter > self.ball) {
                return Err(BadPlate::Narrow { number, diameter, ball: self.ball });
            }
            if !place.iter().all(|x| x.is_finite()) {
                return Err(BadPlate::Nowhere(number));
            }
            if self.hole[..i].iter().any(|other| other.number == number) {
                return Err(BadPlate::Twice(number));
            }
        }
        Ok(())
    }

    fn scaled(mut self, scale: f64) -> Self {
        self.ball *= scale;
        for hole in &mut self.hole {
            hole.place = hole.place.map(|x| x * scale);
            hole.diameter *= scale;
        }
        self
    }

    pub(crate) fn hole(&self, number: u32) -> Option<&Hole> {
        self.hole.iter().find(|hole| hole.number == number)
    }

    fn least_distance(&self) -> f64 {
        let pairs = self.hole.iter().enumerate().flat_map(|(i, a)| {
            self.hole[..i]
                .iter()
                .map(move |b| (a.place[0] - b.place[0]).hypot(a.place[1] - b.place[1]))
        });
        pairs.fold(f64::INFINITY, f64::min)
    }

    /// Estimates the frame of a plate whose holes were found at these approximate positions.
    ///
    /// # Errors
    /// There are fewer than three, or they are not at the plate's positions; the error names another order that
    /// would fit.
    pub(crate) fn found_at(&self, centres: &[(u32, Vector3<f64>)]) -> Result<Frame, Astray> {
        if centres.len() < 3 {
            return Err(Astray::TooFew(centres.len()));
        }
        let nominal: Vec<Vector3<f64>> =
            centres.iter().map(|(number, _)| self.point(*number)).collect();
        let seen: Vec<Vector3<f64>> = centres.iter().map(|(_, centre)| *centre).collect();
        let frame = fitted(&nominal, &seen);
        let miss = |i: usize| (frame.seen(&seen[i]) - nominal[i]).xy().norm();
        let worst = (0..seen.len()).max_by(|a, b| miss(*a).total_cmp(&miss(*b))).unwrap_or(0);
        let limit = ASTRAY * self.least_distance();
        if miss(worst) <= limit {
            return Ok(frame);
        }
        Err(match self.other_order(&seen, limit) {
            Some(order) => {
                let pairs = centres.iter().map(|(number, _)| *number).zip(order);
                Astray::Order(pairs.filter(|(number, other)| number != other).collect())
            }
            None => Astray::Away(centres[worst].0, miss(worst)),
        })
    }

    fn point(&self, number: u32) -> Vector3<f64> {
        self.hole(number)
            .map_or(Vector3::zeros(), |hole| Vector3::new(hole.place[0], hole.place[1], 0.0))
    }

    /// Returns the numbers of the plate's holes for which the plate fits the positions found, seen from above.
    fn other_order(&self, seen: &[Vector3<f64>], limit: f64) -> Option<Vec<u32>> {
        let flat: Vec<[f64; 2]> = seen.iter().map(|p| [p.x, p.y]).collect();
        let pairs = self.hole.iter().flat_map(|a| self.hole.iter().map(move |b| (a, b)));
        pairs.filter(|(a, b)| a.number != b.number).find_map(|(a, b)| {
            let [ux, uy] = [flat[1][0] - flat[0][0], flat[1][1] - flat[0][1]];
            let [vx, vy] = [b.place[0] - a.place[0], b.place[1] - a.place[1]];
            let turn = vy.atan2(vx) - uy.atan2(ux);
            let (s, c) = turn.sin_cos();
            let placed = |p: &[f64; 2]| {
                let [x, y] = [p[0] - flat[0][0], p[1] - flat[0][1]];
                [a.place[0] + c * x - s * y, a.place[1] + s * x + c * y]
            };
            let mut order = vec![];
            for point in flat.iter().map(placed) {
                let away =
                    |hole: &&Hole| (hole.place[0] - point[0]).hypot(hole.place[1] - point[1]);
                let hole = self.hole.iter().min_by(|a, b| away(a).total_cmp(&away(b)))?;
                if away(&hole) > limit || order.contains(&hole.number) {
                    return None;
                }
                order.push(hole.number);
            }
            Some(order)
        })
    }
}

/// Returns the frame that best maps points of the frame to the points seen in base (least squares, Kabsch
/// 1976).
pub(crate) fn fitted(of_frame: &[Vector3<f64>], seen: &[Vector3<f64>]) -> Frame {
    let mean =
        |points: &[Vector3<f64>]| points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
    let (own, there) = (mean(of_frame), mean(seen));
    let spread = of_frame
        .iter()
        .zip(seen)
        .fold(Matrix3::zeros(), |sum, (a, b)| sum + (b - there) * (a - own).transpose());
    let svd = spread.svd(true, true);
    let (Some(u), Some(v)) = (svd.u, svd.v_t) else { return Frame::BASE };
    // A rotation, not a reflection.
    let turn = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u * v).determinant().signum()));
    let rotation = u * turn * v;
    Frame { origin: there - rotation * own, rotation }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinematics::Pose;

    fn plate() -> Plate {
        let places = [[0.0, 0.0], [50.0, 0.0], [100.0, 5.0], [0.0, 60.0], [50.0, 65.0]];
        let hole = (1..).zip(places).map(|(number, place)| Hole { number, place, diameter: 20.0 });
        Plate { unit: Unit::Mm, ball: 6.0, hole: hole.collect() }
    }

    fn lying() -> Frame {
        let turned = Pose::from_degrees([0.0, 0.0, 0.0, 1.0, -2.0, 140.0]).rotation();
        Frame { origin: Vector3::new(20.0, -30.0, 400.0), rotation: turned }
    }

    fn seen(numbers: &[u32]) -> Vec<(u32, Vector3<f64>)> {
        let (plate, frame) = (plate(), lying());
        let place = |number: u32| frame.origin + frame.rotation * plate.point(number);
        (1..).zip(numbers).map(|(called, number)| (called, place(*number))).collect()
    }

    #[test]
    fn a_plate_is_found_where_it_lies() {
        let found = plate().found_at(&seen(&[1, 2, 3, 4, 5])).unwrap();
        // Rounding at 400.
        assert!((found.origin - lying().origin).norm() < 1e-11);
        assert!((found.rotation - lying().rotation).norm() < 1e-13);
    }

    #[test]
    fn another_order_is_reported() {
        let text = plate().found_at(&seen(&[1, 3, 2, 4, 5])).unwrap_err().to_string();
        assert!(text.contains("in the log hole 2 is 3, 3 is 2;"), "{text}");
        let mut astray = seen(&[1, 2, 3, 4, 5]);
        astray[2].1.x += 30.0;
        let text = plate().found_at(&astray).unwrap_err().to_string();
        assert!(text.contains("check that this plate was probed"), "{text}");
        assert!(plate().found_at(&astray[..2]).unwrap_err().to_string().contains("at least three"));
    }
}
