// SPDX-License-Identifier: GPL-2.0-or-later
//! The geometry as the integrator wrote it, before any check, and its hash.

use crate::leg::{LegKind, StrutGeometry};

/// One leg as given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegGeometry {
    /// Base anchor in base, machine units.
    pub base: [f64; 3],
    /// Platform anchor in the platform frame, machine units.
    pub platform: [f64; 3],
    /// Kind and what belongs to it.
    pub kind: LegKind,
}

impl LegGeometry {
    /// A strut. Its axes matter only where it has a lead: without one they are
    /// dropped, so that they change neither hash nor comparison.
    pub fn strut(base: [f64; 3], platform: [f64; 3], strut: StrutGeometry) -> Self {
        let kept = if strut.lead == 0.0 { StrutGeometry::default() } else { strut };
        Self { base, platform, kind: LegKind::Strut(kept) }
    }

    /// Whether every value is finite.
    pub(crate) fn is_finite(&self) -> bool {
        let LegKind::Strut(s) = &self.kind;
        let finite = |v: &[f64]| v.iter().all(|x| x.is_finite());
        finite(&self.base)
            && finite(&self.platform)
            && finite(&s.base_axis)
            && finite(&s.platform_axis)
            && s.lead.is_finite()
    }
}

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
    const ALL: [Letter; 6] = [Self::X, Self::Y, Self::Z, Self::A, Self::B, Self::C];

    /// Place in a pose: X = 0 … C = 5.
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// The pose letters in the order of `coordinates=`: joint j of the identity
/// kinematics is the j-th letter. For the machine itself the order means nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coordinates([Letter; 6]);

impl Coordinates {
    /// X Y Z A B C.
    pub const XYZABC: Self = Self(Letter::ALL);

    /// From text such as `XYZABC`, any order, upper or lower case.
    ///
    /// `None` unless each of the six letters stands exactly once: machines with
    /// fewer active coordinates are not supported by this version.
    pub fn parse(text: &[u8]) -> Option<Self> {
        let mut letters = Letter::ALL;
        if text.len() != letters.len() {
            return None;
        }
        for (i, character) in text.iter().enumerate() {
            let index = b"XYZABC".iter().position(|l| *l == character.to_ascii_uppercase())?;
            let letter = Letter::ALL[index];
            if letters[..i].contains(&letter) {
                return None;
            }
            letters[i] = letter;
        }
        Some(Self(letters))
    }

    /// For each joint of the identity kinematics, its letter.
    pub fn letters(&self) -> &[Letter; 6] {
        &self.0
    }
}

/// A machine as given: what [`crate::Machine::freeze`] checks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry<const N: usize> {
    /// Legs in joint order.
    pub legs: [LegGeometry; N],
    /// Reference pose (x, y, z, a, b, c), machine units and degrees; it fixes the
    /// fold of the nut correction. `None`: the correction is the literal arcsin.
    pub home: Option<[f64; 6]>,
    /// Order of the pose letters.
    pub coordinates: Coordinates,
}

impl<const N: usize> Geometry<N> {
    /// FNV-1a (32 bit) over the little-endian bits of the values as given, −0 as +0.
    ///
    /// Order: per leg its kind (strut 1), base anchor, platform anchor, and for a
    /// strut base axis, platform axis (zeros without a lead) and lead; then the
    /// reference pose if there is one; then the coordinates (X = 0 … C = 5).
    /// Joint offsets, tool and solver settings do not enter.
    pub fn hash(&self) -> u32 {
        let mut hash = Fnv1a::new();
        for leg in &self.legs {
            hash.add(&[leg.kind.number()]);
            hash.add(&leg.base);
            hash.add(&leg.platform);
            let LegKind::Strut(strut) = &leg.kind;
            hash.add(&strut.base_axis);
            hash.add(&strut.platform_axis);
            hash.add(&[strut.lead]);
        }
        if let Some(home) = &self.home {
            hash.add(home);
        }
        for letter in self.coordinates.letters() {
            hash.add(&[letter.index() as f64]);
        }
        hash.0
    }
}

struct Fnv1a(u32);

impl Fnv1a {
    const fn new() -> Self {
        Self(0x811c_9dc5)
    }

    fn add(&mut self, values: &[f64]) {
        for v in values {
            // −0 + 0 = +0: the sign of zero changes no joint.
            for byte in (v + 0.0).to_bits().to_le_bytes() {
                self.0 = (self.0 ^ u32::from(byte)).wrapping_mul(0x0100_0193);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_take_each_letter_once_in_any_order() {
        assert_eq!(Coordinates::parse(b"xyzabc"), Some(Coordinates::XYZABC));
        let turned = Coordinates::parse(b"CBAZYX").unwrap();
        assert_eq!(turned.letters().map(Letter::index), [5, 4, 3, 2, 1, 0]);
        for bad in [&b"XYZAB"[..], b"XYZABB", b"XYZABU", b"", b"XYZABCC"] {
            assert_eq!(Coordinates::parse(bad), None);
        }
    }

    #[test]
    fn fnv_1a_gives_the_number_of_an_independent_implementation() {
        // Python: reduce(lambda h, b: (h ^ b) * 0x01000193 & 0xffffffff,
        //                struct.pack("<3d", 0.0, 1.5, -2.25), 0x811c9dc5)
        let mut hash = Fnv1a::new();
        hash.add(&[-0.0, 1.5, -2.25]);
        assert_eq!(hash.0, 0x982567f2);
    }
}
