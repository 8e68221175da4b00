// SPDX-License-Identifier: GPL-2.0-or-later
//! Extra axes: serial joints after those of legs and table, whose coordinates pass through.

use crate::layout::Layout;
use crate::letters::Letter;
use crate::load_error::LoadError;

/// Letters of LinuxCNC's pose, in its order.
pub const POSE_LETTERS: [char; 9] = ['X', 'Y', 'Z', 'A', 'B', 'C', 'U', 'V', 'W'];

/// Largest number of extra axes: the legs move at least one of nine letters.
pub const MAX_EXTRA: usize = POSE_LETTERS.len() - 1;

/// Extra axes, in joint order. Each is a joint whose value is the coordinate of its letter; legs,
/// table and tool pose do not depend on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExtraAxes {
    places: [u8; MAX_EXTRA],
    count: usize,
    /// One bit for each index.
    set: u16,
}

impl ExtraAxes {
    /// No extra axes.
    pub const NONE: Self = Self { places: [0; MAX_EXTRA], count: 0, set: 0 };

    /// Parses text such as `CW`, upper or lower case, for a machine with this layout.
    ///
    /// # Errors
    /// [`LoadError::AxesWrong`] for a character that is not a pose letter or occurs twice,
    /// [`LoadError::AxisTaken`] for a letter that legs or table move.
    pub fn parse(text: &[u8], layout: &Layout) -> Result<Self, LoadError> {
        let mut axes = Self::NONE;
        for character in text {
            let place = place_of(character.to_ascii_uppercase()).ok_or(LoadError::AxesWrong)?;
            let taken = Letter::ALL.get(place).is_some_and(|letter| !layout.is_held(*letter));
            if taken {
                return Err(LoadError::AxisTaken);
            }
            if axes.has(place) {
                return Err(LoadError::AxesWrong);
            }
            *axes.places.get_mut(axes.count).ok_or(LoadError::AxesWrong)? = place as u8;
            axes.count += 1;
            axes.set |= 1 << place;
        }
        Ok(axes)
    }

    /// Returns the number of extra axes.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Returns whether there are no extra axes.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Returns whether an extra axis has this index among [`POSE_LETTERS`].
    pub fn has(&self, place: usize) -> bool {
        self.set.checked_shr(place as u32).is_some_and(|bits| bits & 1 == 1)
    }

    /// Returns their indices among [`POSE_LETTERS`], in joint order.
    pub fn places(&self) -> impl Iterator<Item = usize> + '_ {
        self.places.iter().take(self.count).map(|place| usize::from(*place))
    }

    /// Returns their letters, in joint order.
    pub fn letters(&self) -> impl Iterator<Item = char> + '_ {
        self.places().filter_map(|place| POSE_LETTERS.get(place)).copied()
    }
}

/// Returns the index of a capital among [`POSE_LETTERS`]. Uses ranges: a search would compile to a
/// jump table, whose targets are hard to verify in the built module.
fn place_of(letter: u8) -> Option<usize> {
    let (first, begin) = match letter {
        b'X'..=b'Z' => (b'X', 0),
        b'A'..=b'C' => (b'A', 3),
        b'U'..=b'W' => (b'U', 6),
        _ => return None,
    };
    Some(usize::from(letter - first) + begin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::Letters;

    #[test]
    fn letters_that_nothing_else_moves_are_taken_in_their_order() {
        let [legs, table] = [&b"ZAB"[..], b"XY"].map(|text| Letters::parse(text).unwrap());
        let layout = Layout::new(4, legs, table).unwrap();
        let parsed = |text: &str| ExtraAxes::parse(text.as_bytes(), &layout);
        let axes = parsed("wcU").unwrap();
        assert!(axes.letters().eq(['W', 'C', 'U']) && axes.places().eq([8, 5, 6]));
        assert_eq!(parsed(""), Ok(ExtraAxes::NONE));
        for text in ["Z", "WA", "X"] {
            assert_eq!(parsed(text), Err(LoadError::AxisTaken), "{text}");
        }
        for text in ["CC", "U W", "Q", "UVWCC"] {
            assert_eq!(parsed(text), Err(LoadError::AxesWrong), "{text}");
        }
    }

    #[test]
    fn every_letter_has_its_place_and_nothing_else_has_one() {
        for letter in 0..=u8::MAX {
            let place = POSE_LETTERS.iter().position(|l| *l == char::from(letter));
            assert_eq!(place_of(letter), place, "{letter}");
        }
    }

    #[test]
    fn one_coordinate_leaves_eight_letters() {
        let layout = Layout::new(1, Letters::parse(b"X").unwrap(), Letters::NONE).unwrap();
        assert_eq!(ExtraAxes::parse(b"YZABCUVW", &layout).unwrap().len(), MAX_EXTRA);
    }
}
