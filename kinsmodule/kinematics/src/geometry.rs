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

/// The pose letters in the order of `coordinates=`: joint j of the identity
/// kinematics is the j-th letter. For the machine itself the order means nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coordinates([u8; 6]);

impl Coordinates {
    /// X Y Z A B C.
    pub const XYZABC: Self = Self([0, 1, 2, 3, 4, 5]);

    /// From text such as `XYZABC`, any order, upper or lower case.
    ///
    /// `None` unless each of the six letters stands exactly once: machines with
    /// fewer active coordinates are not supported by this version.
    pub fn parse(text: &[u8]) -> Option<Self> {
        let mut indices = [0; 6];
        if text.len() != indices.len() {
            return None;
        }
        for (i, letter) in text.iter().enumerate() {
            let index = b"XYZABC".iter().position(|l| *l == letter.to_ascii_uppercase())?;
            if indices[..i].contains(&(index as u8)) {
                return None;
            }
            indices[i] = index as u8;
        }
        Some(Self(indices))
    }

    /// For each joint of the identity kinematics, its pose index (X = 0 … C = 5).
    pub fn indices(&self) -> &[u8; 6] {
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
    /// strut the lead and, where that is not 0, base axis and platform axis; then the
    /// reference pose if there is one; then the coordinates (X = 0 … C = 5).
    /// Joint offsets, tool and solver settings do not enter.
    pub fn hash(&self) -> u32 {
        let mut hash = Fnv1a::new();
        for leg in &self.legs {
            hash.add(&[leg.kind.number()]);
            hash.add(&leg.base);
            hash.add(&leg.platform);
            let LegKind::Strut(strut) = &leg.kind;
            hash.add(&[strut.lead]);
            if strut.lead != 0.0 {
                hash.add(&strut.base_axis);
                hash.add(&strut.platform_axis);
            }
        }
        if let Some(home) = &self.home {
            hash.add(home);
        }
        for index in self.coordinates.indices() {
            hash.add(&[f64::from(*index)]);
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
        assert_eq!(Coordinates::parse(b"CBAZYX").unwrap().indices(), &[5, 4, 3, 2, 1, 0]);
        for bad in [&b"XYZAB"[..], b"XYZABB", b"XYZABU", b"", b"XYZABCC"] {
            assert_eq!(Coordinates::parse(bad), None);
        }
    }

    #[test]
    fn fnv_matches_its_published_test_vector() {
        // FNV-1a of the bytes 00..00 (8 of them), computed by the definition:
        // each byte only multiplies.
        let expected = (0..8).fold(0x811c_9dc5_u32, |h, _| h.wrapping_mul(0x0100_0193));
        let mut hash = Fnv1a::new();
        hash.add(&[-0.0]);
        assert_eq!(hash.0, expected);
    }
}
