// SPDX-License-Identifier: GPL-2.0-or-later
//! Numbers and letters of a machine: its joints, and the pose coordinates that they move.

use crate::constraint::MAX_CONSTRAINTS;
use crate::fault::{Cause, Fault, MachinePart};
use crate::letters::{Letter, Letters};
use crate::load_error::LoadError;

/// Largest number of legs of a machine.
pub const MAX_LEGS: usize = 8;

/// Largest number of joints of a machine: legs, then X, Y and Z of a table.
pub const MAX_JOINTS: usize = MAX_LEGS + 3;

/// Joint values: legs in order, then table axes; 0 beyond the last joint.
pub type Joints = [f64; MAX_JOINTS];

/// One number for each leg; 0 beyond the last leg.
pub type PerLeg = [f64; MAX_LEGS];

/// Numbers and letters of a machine, checked for consistency.
///
/// Joints are the legs in order, then the table axes. Coordinates that neither the
/// platform nor the table moves are held at 0, unless constraints make them follow from the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    legs: usize,
    coordinates: Letters,
    table: Letters,
    /// Number of constraints, including redundant ones.
    constraints: usize,
}

impl Layout {
    /// Creates the layout of `legs` legs that move the platform along `coordinates`, and serial axes under
    /// the workpiece for the letters of `table`.
    ///
    /// # Errors
    /// No leg or too many, no coordinate or more coordinates than legs, a table letter that
    /// is an angle, a letter in both.
    pub fn new(legs: usize, coordinates: Letters, table: Letters) -> Result<Self, LoadError> {
        if !(1..=MAX_LEGS).contains(&legs) {
            return Err(LoadError::LegsWrong);
        }
        if coordinates.is_empty() {
            return Err(LoadError::CoordinatesWrong);
        }
        if coordinates.len() > legs {
            return Err(LoadError::TooManyCoordinates);
        }
        if table.as_slice().iter().any(|letter| letter.is_angle()) {
            return Err(LoadError::TableWrong);
        }
        if table.as_slice().iter().any(|letter| coordinates.contains(*letter)) {
            return Err(LoadError::LetterTwice);
        }
        Ok(Self { legs, coordinates, table, constraints: 0 })
    }

    /// Adds constraints of the platform: then its six coordinates move, those that `coordinates` names as commanded, the
    /// others as these and the constraints determine.
    ///
    /// # Errors
    /// More constraints than [`MAX_CONSTRAINTS`]; more legs than coordinates; fewer than six legs and constraints.
    pub fn with_constraints(self, constraints: usize) -> Result<Self, LoadError> {
        if constraints > MAX_CONSTRAINTS {
            return Err(LoadError::ConstraintsWrong);
        }
        if constraints > 0 && self.is_redundant() {
            return Err(LoadError::ConstraintsLegs);
        }
        if constraints > 0 && self.legs + constraints < 6 {
            return Err(LoadError::ConstraintsFew);
        }
        Ok(Self { constraints, ..self })
    }

    /// Returns the number of constraints of the platform, including redundant ones.
    pub fn constraints(&self) -> usize {
        self.constraints
    }

    /// Returns whether constraints determine the platform's coordinate from those that are commanded.
    pub fn is_dependent(&self, letter: Letter) -> bool {
        self.constraints > 0 && !self.coordinates.contains(letter)
    }

    /// Returns the number of legs.
    pub fn legs(&self) -> usize {
        self.legs
    }

    /// Returns the number of joints: legs and table axes.
    pub fn joints(&self) -> usize {
        self.legs + self.table.len()
    }

    /// Returns the coordinates that the legs move; joint j of the identity kinematics is the j-th
    /// letter. Their order has no other effect.
    pub fn coordinates(&self) -> &Letters {
        &self.coordinates
    }

    /// Returns the coordinates of the table axes, in joint order.
    pub fn table(&self) -> &Letters {
        &self.table
    }

    /// Returns whether the coordinate is always 0 in LinuxCNC's poses: no joint moves it, or it is
    /// [dependent](Self::is_dependent) and no table compensates it.
    pub fn is_held(&self, letter: Letter) -> bool {
        !self.coordinates.contains(letter) && !self.table.contains(letter)
    }

    /// Returns whether legs exceed coordinates, so that joint values can contradict each other.
    pub fn is_redundant(&self) -> bool {
        self.legs > self.coordinates.len()
    }

    /// Returns what joint `i` moves: a leg, or a table axis.
    pub fn joint(&self, i: usize) -> MachinePart {
        let axis = i.checked_sub(self.legs).and_then(|k| self.table.as_slice().get(k));
        axis.map_or(MachinePart::Joint(i as u8), |l| MachinePart::TableAxis(i as u8, *l))
    }

    /// Returns the letter of every joint for the identity kinematics; `None` if a joint has none.
    pub fn joint_letters(&self) -> Option<impl Iterator<Item = Letter> + '_> {
        let both = [&self.coordinates, &self.table];
        (!self.is_redundant()).then(|| both.into_iter().flat_map(|l| l.as_slice()).copied())
    }
}

impl Fault {
    /// Creates a refusal that names joint `joint` (counted from 0) of a machine with this layout.
    pub fn of_joint(cause: Cause, layout: &Layout, joint: usize, value: f64) -> Self {
        Self { cause, part: Some(layout.joint(joint)), value }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_together_is_refused() {
        let letters = |text: &str| Letters::parse(text.as_bytes()).unwrap();
        let layout =
            |legs, coordinates, table| Layout::new(legs, letters(coordinates), letters(table));
        for (legs, coordinates, table, error) in [
            (0, "X", "", LoadError::LegsWrong),
            (9, "X", "", LoadError::LegsWrong),
            (6, "", "", LoadError::CoordinatesWrong),
            (4, "XYZAB", "", LoadError::TooManyCoordinates),
            (4, "ZAB", "XC", LoadError::TableWrong),
            (4, "ZAB", "XZ", LoadError::LetterTwice),
        ] {
            assert_eq!(
                layout(legs, coordinates, table),
                Err(error),
                "{legs} {coordinates} {table}"
            );
        }
        let pyramid = layout(4, "ZAB", "XY").unwrap();
        assert_eq!((pyramid.joints(), pyramid.is_redundant()), (6, true));
        assert!(pyramid.is_held(Letter::C) && !pyramid.is_held(Letter::X));
        assert!(pyramid.joint_letters().is_none());
        let square = layout(3, "ZAB", "XY").unwrap();
        let letters = square.joint_letters().unwrap().map(Letter::name);
        assert!(letters.eq(['Z', 'A', 'B', 'X', 'Y']));
    }
}
