// SPDX-License-Identifier: GPL-2.0-or-later
//! A wrist of two axes on the platform: C turns it about the platform's axis, A tilts the tool about an axis across it.

use crate::ini::{Plan, line};
use keys::chain as key;
use machine::digits::plain;

/// Letters of its axes, from the platform outward.
pub(crate) const LETTERS: &str = "CA";

/// Name of the parameter, the distance from the spindle nose to the tilting axis.
pub(crate) const NAME: &str = "wrist";

/// Largest angles of C and A in both directions, degrees.
const RANGES: [f64; 2] = [180.0, 90.0];

/// Angles of the first program, degrees.
const FIRST: [f64; 2] = [45.0, 20.0];

/// A wrist to write.
pub(crate) struct Wrist {
    /// Distance from the spindle nose to the tilting axis.
    distance: f64,
    is_up: bool,
    /// Largest speed and acceleration, degrees.
    motion: [f64; 2],
}

impl Wrist {
    /// Returns the wrist of a machine; `None` if it has none.
    pub(crate) fn of(plan: &Plan) -> Option<Self> {
        let [distance] = plan.values.list(NAME)?;
        Some(Self { distance, is_up: plan.is_up(), motion: plan.motion()[1] })
    }

    /// Returns how fast the wrist moves the platform while the tip stays, and with which acceleration, per second.
    pub(crate) fn of_platform(&self) -> [f64; 2] {
        // Both axes turn at the same time.
        let [speed, acceleration] = self.motion.map(|value| 2.0 * value.to_radians());
        [self.distance * speed, self.distance * (acceleration + speed * speed)]
    }

    /// Writes the section of what an axis carries.
    pub(crate) fn chain(&self) -> String {
        let height = if self.is_up { -self.distance } else { self.distance };
        let of = |letter, axis: [f64; 3], z: f64| {
            format!(
                "\n[CHAIN_{letter}]\n{} = TOOL\n{}{}",
                key::CARRIES.name,
                line(key::AXIS.name, &axis),
                line(key::POINT.name, &[0.0, 0.0, z])
            )
        };
        format!(
            "\n# The wrist: C turns it about Z of the platform, A tilts the tool. Angles are those of the axes.\n\
             # Change tools at home with both at 0: where the tool or the platform leans, a new length is refused.{}{}",
            of('C', [0.0, 0.0, 1.0], 0.0),
            of('A', [1.0, 0.0, 0.0], height)
        )
    }

    /// Writes the joint of an axis, with its following errors and the lines of its homing.
    pub(crate) fn joint(&self, i: usize, n: usize, errors: (f64, f64), homing: &str) -> String {
        let (range, [speed, acceleration]) = (RANGES[i], self.motion);
        let (error, least) = errors;
        format!(
            "\n[JOINT_{n}]\nTYPE = ANGULAR\nHOME = 0\nMIN_LIMIT = {}\nMAX_LIMIT = {range}\nMAX_VELOCITY = {speed}\n\
             MAX_ACCELERATION = {acceleration}\nFERROR = {error}\nMIN_FERROR = {least}\n{homing}",
            -range
        )
    }

    /// Writes the axis of a letter.
    pub(crate) fn axis(&self, letter: char) -> String {
        let range = RANGES[LETTERS.find(letter).unwrap_or_default()];
        let [speed, acceleration] = self.motion;
        format!(
            "\n[AXIS_{letter}]\nTYPE = ANGULAR\nMIN_LIMIT = {}\nMAX_LIMIT = {range}\nMAX_VELOCITY = {speed}\n\
             MAX_ACCELERATION = {acceleration}\n",
            -range
        )
    }

    /// Returns blocks that turn both axes about the tip, and back.
    pub(crate) fn blocks(&self) -> [String; 2] {
        let [c, a] = FIRST;
        // A feed without X Y Z is in degrees per minute.
        let speed = (30.0 * self.motion[0]).round().max(1.0);
        [format!("G1 F{} A{} C{}", plain(speed), plain(a), plain(c)), "G1 A0 C0".into()]
    }
}
