// SPDX-License-Identifier: GPL-2.0-or-later
//! Coordinates of the platform at a pose: X Y Z of the machine's center and the angles A B C, limited to
//! those that the legs move.
//!
//! The center is the point whose held X, Y, Z are constant; if none is held, it is any point. With
//! p = o + R(A, B, C) (s − c) for a point s of the platform, c the center and o its position, guides are
//! satisfied exactly, and derivatives of any order are those of R.
//!
//! With constraints of the platform, the center is the tool tip, all six of its coordinates change, and the coordinates
//! of the chart are those that are commanded: the others follow, with the rates N per rate of these.

use crate::dynamics::structure::{STEP, tip};
use kinematics::{At, Fault, Letter, Matrix3, Pose, Vector3};
use machine::read::mechanism::Mechanism;
use machine::rows::{Rows, follow, rate_map};
use nalgebra::{DMatrix, DVector, Matrix3xX, Matrix6xX};

/// The coordinates, and how points of the platform depend on them; mm and radians.
#[derive(Clone, Debug)]
pub struct Chart {
    /// Coordinates by their numbers: X Y Z, then A B C.
    coordinates: Vec<usize>,
    /// How all six follow, if constraints couple them.
    coupled: Option<Coupled>,
    /// The center in the platform frame.
    centre: Vector3<f64>,
    /// A B C.
    angles: Vector3<f64>,
    /// Angular velocity per rate of A B C.
    rates: Matrix3<f64>,
}

/// How all coordinates follow those of a chart.
#[derive(Clone, Debug)]
struct Coupled {
    /// N.
    rates: Matrix6xX<f64>,
    /// Derivative of N by each coordinate of the chart; empty without [`Chart::with_bends`].
    bends: Vec<Matrix6xX<f64>>,
}

impl Chart {
    /// Creates the chart of a machine at a pose; `tool` is that of `at`.
    pub fn of(config: &Mechanism, at: &At, tool: &Vector3<f64>) -> Self {
        let layout = config.machine.layout();
        let is_moved = |k: &usize| layout.coordinates().contains(Letter::ALL[*k]);
        let coordinates: Vec<usize> = (0..6).filter(is_moved).collect();
        if layout.constraints() == 0 {
            let centre = Vector3::from(config.geometry.centre) / config.units_per_mm;
            return Self::new(coordinates, centre, at.pose());
        }
        let follow = follow(&config.geometry, config.machine.radius(), at, tool);
        let length = |k: usize| if k < 3 { config.units_per_mm } else { 1.0 };
        let rates = Matrix6xX::from_fn(coordinates.len(), |i, k| {
            follow[(i, coordinates[k])] * length(coordinates[k]) / length(i)
        });
        let coupled = Some(Coupled { rates, bends: vec![] });
        Self { coupled, ..Self::new(coordinates, tip(config, tool), &at.full_pose()) }
    }

    /// Adds what [`Self::curvature`] needs if constraints couple coordinates, by central differences.
    ///
    /// # Errors
    /// As [`kinematics::Machine::at`].
    pub fn with_bends(
        mut self,
        config: &Mechanism,
        pose: &Pose,
        tool: &Vector3<f64>,
    ) -> Result<Self, Fault> {
        if self.coupled.is_none() {
            return Ok(self);
        }
        let radius = config.machine.radius() / config.units_per_mm;
        let mut bends = vec![];
        for k in 0..self.count() {
            let step = STEP * if self.is_angle(k) { 1.0 } else { radius };
            let side = |by: f64| -> Result<Matrix6xX<f64>, Fault> {
                let pose = self.moved(pose, k, by, &self.centre, config.units_per_mm);
                let chart = Self::of(config, &config.machine.at(&pose, tool)?, tool);
                Ok(chart.coupled.map_or(Matrix6xX::zeros(self.count()), |coupled| coupled.rates))
            };
            bends.push((side(step)? - side(-step)?) / (2.0 * step));
        }
        if let Some(coupled) = &mut self.coupled {
            coupled.bends = bends;
        }
        Ok(self)
    }

    /// Returns the chart of all coordinates that change, also of those that follow from others.
    pub fn whole(&self) -> Self {
        let coordinates = match self.coupled {
            Some(_) => (0..6).collect(),
            None => self.coordinates.clone(),
        };
        Self { coordinates, coupled: None, ..self.clone() }
    }

    /// Converts forces by all coordinates that change to those by the coordinates of the chart, as virtual work does.
    pub fn reduced(&self, forces: DVector<f64>) -> DVector<f64> {
        match &self.coupled {
            Some(coupled) => coupled.rates.tr_mul(&forces),
            None => forces,
        }
    }

    /// Creates a chart from coordinate numbers, a center in the platform frame, and a pose.
    pub fn new(coordinates: Vec<usize>, centre: Vector3<f64>, pose: &Pose) -> Self {
        Self { coordinates, coupled: None, centre, angles: pose.angles, rates: rate_map(pose) }
    }

    /// Returns the number of coordinates.
    pub fn count(&self) -> usize {
        self.coordinates.len()
    }

    /// Returns the center in the platform frame.
    pub fn centre(&self) -> &Vector3<f64> {
        &self.centre
    }

    /// Returns whether a coordinate is an angle.
    pub fn is_angle(&self, k: usize) -> bool {
        self.coordinates[k] >= 3
    }

    /// Computes the orientation of the platform, differentiated `orders` times by A, B and C.
    fn rotation(&self, orders: [usize; 3]) -> Matrix3<f64> {
        let [a, b, c] = [0, 1, 2].map(|axis| turn(axis, self.angles[axis], orders[axis]));
        c * b * a
    }

    /// Returns the angular velocity per rate of A B C.
    pub fn rate_map(&self) -> &Matrix3<f64> {
        &self.rates
    }

    /// Computes the displacement of a point of the platform per coordinate.
    pub fn displacement(&self, point: &Vector3<f64>) -> Matrix3xX<f64> {
        if let Some(coupled) = &self.coupled {
            return self.whole().displacement(point) * &coupled.rates;
        }
        let arm = point - self.centre;
        let column = |k: &usize| match *k {
            k if k < 3 => Vector3::ith(k, 1.0),
            k => self.rotation(orders(&[k - 3])) * arm,
        };
        Matrix3xX::from_columns(&self.coordinates.iter().map(column).collect::<Vec<_>>())
    }

    /// Computes the second derivative of the position of a point of the platform by coordinates `i` and `k`.
    pub fn curvature(&self, point: &Vector3<f64>, i: usize, k: usize) -> Vector3<f64> {
        if let Some(coupled) = &self.coupled {
            let (whole, rates) = (self.whole(), &coupled.rates);
            let mut sum = Vector3::zeros();
            for a in 3..6 {
                for b in 3..6 {
                    sum += whole.curvature(point, a, b) * (rates[(a, i)] * rates[(b, k)]);
                }
            }
            // Half from either order of the two derivatives.
            let follow = coupled.bends[k].column(i) + coupled.bends[i].column(k);
            return sum + whole.displacement(point) * follow / 2.0;
        }
        match [self.coordinates[i], self.coordinates[k]] {
            [i, k] if i >= 3 && k >= 3 => {
                self.rotation(orders(&[i - 3, k - 3])) * (point - self.centre)
            }
            _ => Vector3::zeros(),
        }
    }

    /// Computes the angular velocity in the machine frame per rate of each coordinate.
    pub fn turns(&self) -> Matrix3xX<f64> {
        if let Some(coupled) = &self.coupled {
            return self.whole().turns() * &coupled.rates;
        }
        let column = |k: &usize| match *k {
            k if k < 3 => Vector3::zeros(),
            k => self.rates.column(k - 3).into_owned(),
        };
        Matrix3xX::from_columns(&self.coordinates.iter().map(column).collect::<Vec<_>>())
    }

    /// Computes the rates of the coordinates from the velocity of the center and the angular velocity. Those of
    /// angles are not finite at B of ±90°, where A and C rotate about one axis.
    pub fn rates(&self, speed: &Vector3<f64>, omega: &Vector3<f64>) -> DVector<f64> {
        let angles = self.rates.try_inverse().map_or(Vector3::repeat(f64::NAN), |map| map * omega);
        let rate = |k: &usize| if *k < 3 { speed[*k] } else { angles[*k - 3] };
        DVector::from_iterator(self.count(), self.coordinates.iter().map(rate))
    }

    /// Computes the acceleration of a point of the platform that is due to the rates of the coordinates.
    pub fn bend(&self, point: &Vector3<f64>, rates: &DVector<f64>) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for i in 0..self.count() {
            for k in 0..self.count() {
                sum += self.curvature(point, i, k) * (rates[i] * rates[k]);
            }
        }
        sum
    }

    /// Computes the angular acceleration that is due to the rates of the coordinates.
    pub fn turning(&self, rates: &DVector<f64>) -> Vector3<f64> {
        let mut of_angles = Vector3::zeros();
        for (k, rate) in self.coordinates.iter().zip(rates.iter()).filter(|(k, _)| **k >= 3) {
            of_angles[k - 3] = *rate;
        }
        let [a, b, c]: [f64; 3] = of_angles.into();
        let ((sb, cb), (sc, cc)) = (self.angles.y.sin_cos(), self.angles.z.sin_cos());
        // Rates of the axes of A and B; the axis of C is fixed.
        let of_a =
            Vector3::new(-cc * sb, -sc * sb, -cb) * b + Vector3::new(-sc, cc, 0.0) * (cb * c);
        let of_b = Vector3::new(-cc, -sc, 0.0) * c;
        of_a * a + of_b * b
    }

    /// Converts rows over X Y Z A B C of the tool tip (machine units and radians, see [`machine::rows`]) to
    /// rows over these coordinates, per mm and radian; `tip` in the platform frame, mm.
    pub fn rows(&self, rows: &Rows, tip: &Vector3<f64>, units_per_mm: f64) -> DMatrix<f64> {
        // The rows of a machine with constraints have followed already.
        let chart = Self { coupled: None, ..self.clone() };
        let tip = chart.displacement(tip);
        DMatrix::from_fn(rows.nrows(), self.count(), |i, k| {
            let moved = (0..3).map(|axis| rows[(i, axis)] * tip[(axis, k)]).sum::<f64>();
            match self.coordinates[k] {
                own if own < 3 => moved,
                own => moved + rows[(i, own)] / units_per_mm,
            }
        })
    }

    /// Computes the pose with one coordinate changed by `by` mm or radians; `tip` as in [`Self::rows`], the pose
    /// in machine units.
    pub fn moved(
        &self,
        pose: &Pose,
        k: usize,
        by: f64,
        tip: &Vector3<f64>,
        units_per_mm: f64,
    ) -> Pose {
        let mut moved = *pose;
        match self.coordinates[k] {
            k if k < 3 => moved.position[k] += by * units_per_mm,
            k => {
                moved.angles[k - 3] += by;
                let turned = moved.rotation() - pose.rotation();
                moved.position += turned * (tip - self.centre) * units_per_mm;
            }
        }
        moved
    }
}

/// Counts how often each angle occurs.
fn orders(angles: &[usize]) -> [usize; 3] {
    let mut orders = [0; 3];
    angles.iter().for_each(|angle| orders[*angle] += 1);
    orders
}

/// Computes the rotation about an axis of the frame, differentiated `order` times by its angle.
fn turn(axis: usize, angle: f64, order: usize) -> Matrix3<f64> {
    // Each differentiation advances sine and cosine by a quarter turn.
    let (sin, cos) = (angle + order as f64 * std::f64::consts::FRAC_PI_2).sin_cos();
    let (i, k) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut turn = Matrix3::zeros();
    turn[(axis, axis)] = if order == 0 { 1.0 } else { 0.0 };
    (turn[(i, i)], turn[(i, k)], turn[(k, i)], turn[(k, k)]) = (cos, -sin, sin, cos);
    turn
}
