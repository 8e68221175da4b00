// SPDX-License-Identifier: GPL-2.0-or-later
//! Maps of a machine's properties over a plane.

use kinematics::Pose;

/// `N` values on a grid in a plane of two coordinates.
#[derive(Clone, Debug)]
pub struct Map<const N: usize> {
    /// Indices of the horizontal and the vertical coordinate.
    pub plane: [usize; 2],
    /// Values of the coordinates along the two sides.
    pub sides: [Vec<f64>; 2],
    /// A pose of the plane: x y z in machine units, a b c in degrees.
    pub pose: [f64; 6],
    /// The values, row by row upwards; NaN where there is none.
    pub values: Vec<[f64; N]>,
}

impl<const N: usize> Map<N> {
    /// Evaluates `at` at `count` by `count` positions between the corners, at one orientation.
    pub fn over(
        pose: &Pose,
        plane: [usize; 2],
        [low, high]: [&[f64; 6]; 2],
        count: usize,
        at: impl Fn(&Pose) -> Option<[f64; N]>,
    ) -> Self {
        let side = |k: usize| -> Vec<f64> {
            let share = |n: usize| n as f64 / (count - 1) as f64;
            (0..count).map(|n| low[k] + (high[k] - low[k]) * share(n)).collect()
        };
        let sides = plane.map(side);
        let [across, up] = &sides;
        let values = up.iter().flat_map(|up| across.iter().map(move |x| (up, x)));
        let values = values.map(|(up, x)| {
            let mut pose = *pose;
            (pose.position[plane[0]], pose.position[plane[1]]) = (*x, *up);
            at(&pose).unwrap_or([f64::NAN; N])
        });
        let values = values.collect();
        Self { plane, pose: pose.to_degrees(), values, sides }
    }

    /// Returns whether there are no values at all.
    pub fn is_empty(&self) -> bool {
        self.values.iter().all(|values| values[0].is_nan())
    }

    /// Returns the positions that have values, with these: X, Y, Z, then the values.
    pub fn rows(&self) -> impl Iterator<Item = ([f64; 3], [f64; N])> + '_ {
        let count = self.sides[0].len();
        let reached = self.values.iter().enumerate().filter(|(_, values)| !values[0].is_nan());
        reached.map(move |(n, values)| {
            let [x, y, z, ..] = self.pose;
            let mut place = [x, y, z];
            place[self.plane[0]] = self.sides[0][n % count];
            place[self.plane[1]] = self.sides[1][n / count];
            (place, *values)
        })
    }
}
