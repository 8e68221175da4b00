// SPDX-License-Identifier: GPL-2.0-or-later
//! The geometry as the integrator wrote it, before any check, and its hash.

use crate::constraint::{ConstraintGeometry, MAX_CONSTRAINTS};
use crate::layout::{Layout, MAX_LEGS};
use crate::leg::{LegKind, StrutGeometry};
use crate::letters::Letters;
use crate::load_error::LoadError;
use nalgebra::Vector3;

/// Largest tool offset, joint offset, and distance of the center and of a chain's points, in sizes of the
/// machine. With more, rounding would exceed the precision that the solver promises for joints and
/// poses: 1e6 · 2⁻⁵³ = 1e-10 of the size.
pub(crate) const FARTHEST: f64 = 1e6;

/// Strut lengths up to this need no overflow checks: their fourth powers are still within f64's range,
/// and leads and offsets are bounded when a machine is frozen. Products of more lengths that overflow
/// are refused by comparisons.
pub(crate) const HUGE: f64 = 1e70;

/// One leg as given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegGeometry {
    /// Base anchor in base, machine units.
    pub base: [f64; 3],
    /// Platform anchor, or the center of its ring, in the platform frame, machine units.
    pub platform: [f64; 3],
    /// Kind, with its parameters.
    pub kind: LegKind,
}

impl LegGeometry {
    /// Fills unused leg entries.
    const NONE: Self = Self {
        base: [0.0; 3],
        platform: [0.0; 3],
        kind: LegKind::Strut(StrutGeometry {
            base_axis: [0.0; 3],
            platform_axis: [0.0; 3],
            lead: 0.0,
        }),
    };

    /// Creates a strut. Without a lead its axes affect no joint and do not enter the hash: only
    /// limits of its cardan joints use them.
    pub fn strut(base: [f64; 3], platform: [f64; 3], strut: StrutGeometry) -> Self {
        Self { base, platform, kind: LegKind::Strut(strut) }
    }

    /// Returns whether every value is finite.
    pub(crate) fn is_finite(&self) -> bool {
        let finite = |v: &[f64]| v.iter().all(|x| x.is_finite());
        let mut all = finite(&self.base) && finite(&self.platform);
        self.kind.for_each_value(|values| all = all && finite(values));
        all
    }

    /// Returns the lengths that determine the size: of the anchors from the origins of their frames, of
    /// rod and arm. Guides may intersect in the origin, and then all base anchors are there.
    pub(crate) fn lengths(&self) -> [f64; 4] {
        let [rod, arm] = self.kind.lengths();
        [Vector3::from(self.base).norm(), Vector3::from(self.platform).norm(), rod, arm]
    }
}

/// A machine as given: input of [`crate::Machine::freeze`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// Numbers of legs and coordinates, and their letters.
    layout: Layout,
    legs: [LegGeometry; MAX_LEGS],
    constraints: [ConstraintGeometry; MAX_CONSTRAINTS],
    /// Point of the platform whose held X, Y, Z are 0, and whose X, Y, Z a table
    /// replaces; platform frame, machine units.
    pub centre: [f64; 3],
    /// Reference pose (x, y, z, a, b, c), machine units and degrees; it fixes the
    /// fold of the nut correction, and must not be singular. `None`:
    /// the correction is the literal arcsin, until [`crate::Machine::fold_at`].
    pub home: Option<[f64; 6]>,
}

impl Geometry {
    /// Creates a machine from these legs, in joint order, with `coordinates` for its platform and
    /// `table` under the workpiece; center 0, no reference pose.
    ///
    /// # Errors
    /// As [`Layout::new`].
    pub fn new(
        legs: &[LegGeometry],
        coordinates: Letters,
        table: Letters,
    ) -> Result<Self, LoadError> {
        let layout = Layout::new(legs.len(), coordinates, table)?;
        Ok(Self::of_layout(layout, |i| legs.get(i).copied().unwrap_or(LegGeometry::NONE)))
    }

    /// Creates a machine leg by leg, like [`Geometry::new`].
    pub fn of_layout(layout: Layout, leg: impl Fn(usize) -> LegGeometry) -> Self {
        let mut legs = [LegGeometry::NONE; MAX_LEGS];
        for (i, place) in legs.iter_mut().enumerate().take(layout.legs()) {
            *place = leg(i);
        }
        let constraints = [ConstraintGeometry::NONE; MAX_CONSTRAINTS];
        Self { layout, legs, constraints, centre: [0.0; 3], home: None }
    }

    /// Sets the constraints of the platform, one by one; their number is that of the layout.
    #[must_use]
    pub fn with_constraints(mut self, constraint: impl Fn(usize) -> ConstraintGeometry) -> Self {
        let constraints = self.constraints.iter_mut().enumerate();
        for (i, place) in constraints.take(self.layout.constraints()) {
            *place = constraint(i);
        }
        self
    }

    /// Returns the constraints of the platform.
    pub fn constraints(&self) -> &[ConstraintGeometry] {
        self.constraints.get(..self.layout.constraints()).unwrap_or(&self.constraints)
    }

    /// Returns numbers and letters.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Returns the legs in joint order.
    pub fn legs(&self) -> &[LegGeometry] {
        self.legs.get(..self.layout.legs()).unwrap_or(&self.legs)
    }

    /// Returns leg `lane`; lanes beyond the last leg repeat the first one.
    pub(crate) fn lane(&self, lane: usize) -> &LegGeometry {
        self.legs().get(lane).unwrap_or(&self.legs[0])
    }

    /// Computes FNV-1a (32 bit) over the little-endian bits of the values as given, −0 as +0.
    ///
    /// Order: per leg its base anchor and platform anchor after its kind (strut 1,
    /// slider 2, crank 3, ring 4), then for a strut base axis, platform axis (zeros without a
    /// lead) and lead; for a slider guide, rod and side; for a crank axis, rod, side and
    /// arm; for a ring its radius. After the legs the center, the reference pose if there is one, the constraints with
    /// their kinds, points and directions, and the letters of coordinates and table (X = 0 … C = 5). Joint offsets, tool and solver
    /// settings are not included.
    pub fn hash(&self) -> u32 {
        let mut hash = Fnv1a::new();
        for leg in self.legs() {
            let mut anchors = Some([leg.base, leg.platform]);
            leg.kind.for_each_value(|values| {
                hash.add(values);
                for anchor in anchors.take().into_iter().flatten() {
                    hash.add(&anchor);
                }
            });
        }
        hash.add(&self.centre);
        if let Some(home) = &self.home {
            hash.add(home);
        }
        for constraint in self.constraints() {
            let (points, directions) = constraint.vectors();
            hash.add(&[f64::from(constraint.kind())]);
            points.iter().chain(&directions).for_each(|vector| hash.add(vector));
        }
        for letters in [self.layout.coordinates(), self.layout.table()] {
            for letter in letters.as_slice() {
                hash.add(&[letter.index() as f64]);
            }
        }
        hash.0
    }
}

pub(crate) struct Fnv1a(pub(crate) u32);

impl Fnv1a {
    const fn new() -> Self {
        Self(0x811c_9dc5)
    }

    pub(crate) fn add(&mut self, values: &[f64]) {
        for v in values {
            // −0 + 0 = +0: the sign of zero affects no joint.
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
    fn fnv_1a_gives_the_number_of_an_independent_implementation() {
        // Python: reduce(lambda h, b: (h ^ b) * 0x01000193 & 0xffffffff,
        //                struct.pack("<3d", 0.0, 1.5, -2.25), 0x811c9dc5)
        let mut hash = Fnv1a::new();
        hash.add(&[-0.0, 1.5, -2.25]);
        assert_eq!(hash.0, 0x982567f2);
    }
}
