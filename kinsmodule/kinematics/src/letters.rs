// SPDX-License-Identifier: GPL-2.0-or-later
//! Letters of the coordinates of a pose.

/// A coordinate of the pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "LinuxCNC's letters")]
pub enum Letter {
    X,
    Y,
    Z,
    A,
    B,
    C,
}

impl Letter {
    /// X Y Z A B C.
    pub const ALL: [Letter; 6] = [Self::X, Self::Y, Self::Z, Self::A, Self::B, Self::C];

    /// Returns its index in a pose: X = 0 … C = 5.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Returns the letter itself, upper case.
    pub const fn name(self) -> char {
        match self {
            Self::X => 'X',
            Self::Y => 'Y',
            Self::Z => 'Z',
            Self::A => 'A',
            Self::B => 'B',
            Self::C => 'C',
        }
    }

    /// Returns whether it is an angle.
    pub const fn is_angle(self) -> bool {
        self.index() >= 3
    }
}

/// A list of letters without repetition, in the order written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Letters {
    all: [Letter; 6],
    count: usize,
}

impl Letters {
    /// No letters.
    pub const NONE: Self = Self { all: [Letter::X; 6], count: 0 };

    /// X Y Z A B C.
    pub const XYZABC: Self = Self { all: Letter::ALL, count: 6 };

    /// Parses text such as `XYZB`, upper or lower case; `None` if a character is not a
    /// letter of the pose or is repeated.
    pub fn parse(text: &[u8]) -> Option<Self> {
        let mut letters = Self::NONE;
        for character in text {
            let index = b"XYZABC".iter().position(|l| *l == character.to_ascii_uppercase())?;
            let letter = *Letter::ALL.get(index)?;
            if letters.contains(letter) {
                return None;
            }
            *letters.all.get_mut(letters.count)? = letter;
            letters.count += 1;
        }
        // Entries beyond the last letter must not make two equal lists differ.
        for rest in letters.all.iter_mut().skip(letters.count) {
            *rest = Letter::X;
        }
        Some(letters)
    }

    /// Returns the letters in the order written.
    pub fn as_slice(&self) -> &[Letter] {
        self.all.get(..self.count).unwrap_or(&self.all)
    }

    /// Returns whether `letter` is one of them.
    pub fn contains(&self, letter: Letter) -> bool {
        self.as_slice().contains(&letter)
    }

    /// Returns the number of letters.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Returns whether there are no letters.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_stand_once_each_in_any_order() {
        assert_eq!(Letters::parse(b"xyzabc"), Some(Letters::XYZABC));
        let turned = Letters::parse(b"CBAZYX").unwrap();
        assert!(turned.as_slice().iter().map(|l| l.index()).eq([5, 4, 3, 2, 1, 0]));
        assert_eq!(Letters::parse(b"").unwrap().len(), 0);
        for bad in [&b"XX"[..], b"XYZABB", b"XYZABU", b"X Y", b"XYZABCC"] {
            assert_eq!(Letters::parse(bad), None);
        }
    }
}
