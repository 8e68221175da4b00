// SPDX-License-Identifier: GPL-2.0-or-later
//! What the extra axes carry, as the integrator wrote it, and its part of the hash.

use super::{FIRST, MAX_LINKS, is_rotary};
use crate::extra::ExtraAxes;
use crate::fault::{Cause, Fault};
use crate::geometry::Fnv1a;

/// What an extra axis carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carries {
    /// The work.
    Work,
    /// The tool: it stands on the platform, or beside a work that is on the platform.
    Tool,
    /// The base of the legs.
    Legs,
}

impl Carries {
    /// All values, in the order of their numbers on pins, starting at 1; 0 passes the coordinate through.
    pub const ALL: [Self; 3] = [Self::Work, Self::Tool, Self::Legs];

    /// Returns the word for it in the INI file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Work => "WORK",
            Self::Tool => "TOOL",
            Self::Legs => "LEGS",
        }
    }
}

/// An axis as given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkGeometry {
    /// What it carries: 0 for nothing, otherwise the index in [`Carries::ALL`] plus 1.
    pub carries: i32,
    /// Direction, any length: right-handed for increasing angles, or the direction in which the carried
    /// part moves for increasing values.
    pub axis: [f64; 3],
    /// A point on a rotary axis; machine units.
    pub point: [f64; 3],
}

impl LinkGeometry {
    /// An axis that passes its coordinate through.
    pub const PASSING: Self = Self { carries: 0, axis: [0.0; 3], point: [0.0; 3] };
}

/// What the extra axes carry, as given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChainGeometry {
    /// By letter: A B C U V W.
    pub links: [LinkGeometry; MAX_LINKS],
    /// Position in base of the control point of the fixed tool holder, if the work is on the platform;
    /// machine units.
    pub holder: Option<[f64; 3]>,
}

impl ChainGeometry {
    /// No axis carries anything; the tools are on the platform.
    pub const NONE: Self = Self { links: [LinkGeometry::PASSING; MAX_LINKS], holder: None };

    /// Combines the hash of a geometry with the chain: for each axis that carries something, in joint
    /// order, its index among [`crate::POSE_LETTERS`], what it carries, its direction and its point (0 for a
    /// linear axis); then 9 and the position of the fixed holder. Without a chain the hash is unchanged.
    pub fn hash(&self, axes: &ExtraAxes, of_geometry: u32) -> u32 {
        let mut hash = Fnv1a(of_geometry);
        for place in axes.places() {
            let Some(link) = self.link(place).filter(|link| link.carries != 0) else { continue };
            hash.add(&[place as f64, f64::from(link.carries)]);
            hash.add(&link.axis);
            hash.add(if is_rotary(place) { &link.point } else { &[0.0; 3] });
        }
        if let Some(holder) = &self.holder {
            hash.add(&[9.0]);
            hash.add(holder);
        }
        hash.0
    }

    /// Rejects a fixed holder whose position is not finite: the machine's reference pose depends on it.
    ///
    /// # Errors
    /// [`Cause::HolderNotFinite`].
    pub fn check_holder(holder: Option<[f64; 3]>) -> Result<(), Fault> {
        match holder.is_none_or(|holder| holder.iter().all(|value| value.is_finite())) {
            true => Ok(()),
            false => Err(Cause::HolderNotFinite.into()),
        }
    }

    pub(super) fn link(&self, place: usize) -> Option<&LinkGeometry> {
        self.links.get(place.checked_sub(FIRST)?)
    }

    /// Computes the machine's pose for a pose of LinuxCNC with a level platform and all chain axes at 0,
    /// with the fixed holder at `holder`, if any; angles in degrees.
    pub fn machine_home(holder: Option<[f64; 3]>, home: [f64; 6]) -> [f64; 6] {
        let Some(holder) = holder else { return home };
        let [x, y, z, a, b, c] = home;
        [holder[0] - x, holder[1] - y, holder[2] - z, a, b, c]
    }
}
