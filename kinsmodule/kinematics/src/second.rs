// SPDX-License-Identifier: GPL-2.0-or-later
//! A second mechanism beside the first one: its layout, and the letters of LinuxCNC's pose that
//! represent its coordinates.
//!
//! The rule: U V W are its X Y Z. Its angles use free letters of A B C, one for each in the order in
//! which both are written. Its joints follow those of the first mechanism and its table.

use crate::layout::{Layout, MAX_LEGS};
use crate::letters::{Letter, Letters};
use crate::load_error::LoadError;

/// The letters of a second mechanism, from the load parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Second {
    layout: Layout,
    /// Index in LinuxCNC's pose of each of X Y Z A B C; undefined for a held one.
    places: [u8; 6],
}

impl Second {
    /// Creates the layout of `legs` legs that move `coordinates`, whose angles have the letters `angles` of
    /// LinuxCNC's pose, beside a first mechanism.
    ///
    /// # Errors
    /// As [`Layout::new`]; more legs in total than a module supports, a number of `angles` that differs
    /// from the number of angles in `coordinates`, a letter that the first mechanism moves.
    pub fn new(
        legs: usize,
        coordinates: Letters,
        angles: Letters,
        first: &Layout,
    ) -> Result<Self, LoadError> {
        if first.legs() + legs > MAX_LEGS {
            return Err(LoadError::LegsTogether);
        }
        let layout = match Layout::new(legs, coordinates, Letters::NONE) {
            Ok(layout) => layout,
            Err(LoadError::LegsWrong) => return Err(LoadError::LegsTogether),
            Err(_) => return Err(LoadError::SecondCoordinates),
        };
        let own = coordinates.as_slice().iter().filter(|letter| letter.is_angle());
        let is_linear = |letter: &Letter| !letter.is_angle();
        if own.clone().count() != angles.len() || angles.as_slice().iter().any(is_linear) {
            return Err(LoadError::SecondAngles);
        }
        if angles.as_slice().iter().any(|letter| !first.is_held(*letter)) {
            return Err(LoadError::SecondTaken);
        }
        let mut places = [6, 7, 8, 3, 4, 5];
        for (own, angle) in own.zip(angles.as_slice()) {
            if let Some(place) = places.get_mut(own.index()) {
                *place = angle.index() as u8;
            }
        }
        Ok(Self { layout, places })
    }

    /// Returns numbers and letters, as for a separate machine.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Returns the index in LinuxCNC's pose of one of its coordinates; `None` for a held one.
    pub fn place(&self, letter: Letter) -> Option<usize> {
        let place = self.places.get(letter.index()).map(|place| usize::from(*place));
        place.filter(|_| !self.layout.is_held(letter))
    }

    /// Returns the indices in LinuxCNC's pose of the coordinates that it moves.
    pub fn places(&self) -> impl Iterator<Item = usize> + '_ {
        Letter::ALL.into_iter().filter_map(|letter| self.place(letter))
    }

    /// Returns its own pose X … C from LinuxCNC's; held coordinates are 0.
    pub fn pose_of(&self, world: &[f64; 9]) -> [f64; 6] {
        let mut pose = [0.0; 6];
        for (value, letter) in pose.iter_mut().zip(Letter::ALL) {
            let place = self.place(letter).and_then(|place| world.get(place));
            *value = place.copied().unwrap_or(0.0);
        }
        pose
    }

    /// Writes its own pose into LinuxCNC's, leaving the other letters unchanged.
    pub fn put(&self, pose: &[f64; 6], world: &mut [f64; 9]) {
        for (value, letter) in pose.iter().zip(Letter::ALL) {
            if let Some(coordinate) = self.place(letter).and_then(|place| world.get_mut(place)) {
                *coordinate = *value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn letters(text: &str) -> Letters {
        Letters::parse(text.as_bytes()).unwrap()
    }

    fn first() -> Layout {
        Layout::new(4, letters("XYZB"), Letters::NONE).unwrap()
    }

    fn second(legs: usize, coordinates: &str, angles: &str) -> Result<Second, LoadError> {
        Second::new(legs, letters(coordinates), letters(angles), &first())
    }

    #[test]
    fn u_v_w_are_its_x_y_z_and_angles_take_the_letters_that_are_named() {
        let world = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];
        let one = second(4, "XYZB", "C").unwrap();
        assert_eq!(one.pose_of(&world), [7.0, 8.0, 9.0, 0.0, 6.0, 0.0]);
        assert!(one.places().eq([6, 7, 8, 5]));
        let two = second(4, "ZBA", "CA").unwrap();
        assert_eq!(two.pose_of(&world), [0.0, 0.0, 9.0, 4.0, 6.0, 0.0]);
        let mut back = [0.0; 9];
        two.put(&two.pose_of(&world), &mut back);
        assert_eq!(back, [0.0, 0.0, 0.0, 4.0, 0.0, 6.0, 0.0, 0.0, 9.0]);
    }

    #[test]
    fn what_does_not_fit_beside_the_first_is_refused() {
        for (legs, coordinates, angles, error) in [
            (5, "XYZB", "C", LoadError::LegsTogether),
            (0, "XYZB", "C", LoadError::LegsTogether),
            (4, "XYZBC", "CA", LoadError::SecondCoordinates),
            (4, "", "", LoadError::SecondCoordinates),
            (4, "XYZB", "", LoadError::SecondAngles),
            (4, "XYZB", "AC", LoadError::SecondAngles),
            (4, "XYZ", "C", LoadError::SecondAngles),
            (4, "XYZB", "X", LoadError::SecondAngles),
            (4, "XYZB", "B", LoadError::SecondTaken),
        ] {
            assert_eq!(second(legs, coordinates, angles), Err(error), "{legs} {coordinates}");
        }
    }
}
