// SPDX-License-Identifier: GPL-2.0-or-later
//! Laws along a curve: height, tilts and speed as functions of the parameter, the arc length and the position.

use crate::base::CurveTaylor;
use crate::expression::{Expression, Trouble};
use machine::proof::interval::Interval;
use machine::proof::jet::Taylor;

/// Names in laws, in order: the parameter, the arc length in mm, its share of the whole, and the
/// coordinates in mm.
pub(super) const NAMES: [&str; 6] = ["t", "s", "u", "x", "y", "z"];
/// Names in the speed law.
pub(super) const SPEED_NAMES: [&str; 3] = ["t", "s", "u"];

/// Tilt of the tool.
#[derive(Clone, Debug)]
pub enum Tilt {
    /// A, B and C in degrees.
    Angles([Expression; 3]),
    /// A vector along the tool axis: A = −asin n_y, B = atan2(n_x, n_z), C = 0.
    Normal([Expression; 3]),
}

#[derive(Clone, Debug)]
pub struct Laws {
    /// Height in mm; `None` for a curve in space, which has its own.
    pub z: Option<Expression>,
    pub tilt: Tilt,
    /// The parameters of Z, A, B and C as functions of t.
    pub own: [Expression; 4],
    /// Speed of the tool tip, mm/s.
    pub speed: Option<Expression>,
}

impl Laws {
    /// Returns whether a law of the pose depends on the arc length.
    pub(super) fn use_length(&self) -> bool {
        let (Tilt::Angles(tilt) | Tilt::Normal(tilt)) = &self.tilt;
        self.z.iter().chain(tilt).any(|law| law.uses(1) || law.uses(2))
    }

    /// Returns whether neither the tilt nor the speed changes along the curve.
    pub(super) fn is_fixed(&self) -> bool {
        let (Tilt::Angles(tilt) | Tilt::Normal(tilt)) = &self.tilt;
        !tilt.iter().chain(&self.speed).any(Expression::is_variable)
    }

    /// Returns the pose at a point of the curve: mm and degrees.
    pub(super) fn pose(
        &self,
        place: &CurveTaylor,
        length: Taylor,
        whole: f64,
    ) -> Result<[Taylor; 6], Trouble> {
        let [x, y, mut z] = place.at;
        let share = length * (1.0 / whole);
        let own = |k: usize| self.own[k].at(&[place.t]);
        if let Some(law) = &self.z {
            z = law.at(&[own(0)?, length, share, x, y])?;
        }
        let at = |law: &Expression, k: usize| law.at(&[own(k)?, length, share, x, y, z]);
        let [a, b, c] = match &self.tilt {
            Tilt::Angles([a, b, c]) => [at(a, 1)?, at(b, 2)?, at(c, 3)?],
            Tilt::Normal([x, y, z]) => leaning([at(x, 1)?, at(y, 1)?, at(z, 1)?]),
        };
        Ok([x, y, z, a, b, c])
    }
}

fn leaning([x, y, z]: [Taylor; 3]) -> [Taylor; 3] {
    let degrees = 180.0 / std::f64::consts::PI;
    let a = Taylor::angle(&-y, &(x.squared() + z.squared()).sqrt());
    [a * degrees, Taylor::angle(&x, &z) * degrees, Taylor::constant(0.0)]
}

/// Encloses the arc length over a range: between its values at the ends, with the derivatives of the curve.
pub(super) fn length(place: &CurveTaylor, dimensions: usize, ends: [f64; 2]) -> Taylor {
    let square = |of: fn(&Taylor) -> Interval| {
        let of = |x| of(x).squared();
        place.at[..dimensions].iter().map(of).fold(Interval::ZERO, |sum, x| sum + x)
    };
    let speed = square(|x| x.first()).sqrt();
    // |ds'| is at most |r''|, even where the speed is 0.
    let most = square(|x| x.second()).sqrt().magnitude();
    let second = match speed.low > 0.0 {
        true => {
            let products = place.at[..dimensions].iter().map(|x| x.first() * x.second());
            products.fold(Interval::ZERO, |sum, x| sum + x) / speed
        }
        false => Interval::about(0.0, most),
    };
    Taylor::new(Interval::new(ends[0], ends[1]), speed, second)
}
