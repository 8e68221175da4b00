// SPDX-License-Identifier: GPL-2.0-or-later
//! What a study file says of the forces that shake a machine.

use crate::study::cutting::NotNegative;
use crate::study::masses::Direction;
use crate::study::number::Positive;
use serde::Deserialize;

/// A random force that is none.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoForce {
    #[error("sigma_n: expected a force along X, Y or Z")]
    Nothing,
    #[error("expected either corner_hz or band_hz with band_quality")]
    Spectrum,
}

/// `[force]` as it is written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ForceKeys {
    sigma_n: [NotNegative; 3],
    corner_hz: Option<Positive>,
    band_hz: Option<Positive>,
    band_quality: Option<Positive>,
    #[serde(default = "first")]
    seed: u64,
    seconds: Positive,
}

const fn first() -> u64 {
    1
}

/// How the power of a random force is spread over frequencies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Band {
    /// Flat below a corner, Hz.
    Corner(f64),
    /// About a frequency in Hz, of the width frequency/quality.
    About {
        hz: f64,
        /// Frequency over width.
        quality: f64,
    },
}

/// `[force]`: a random force on the tool tip.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(try_from = "ForceKeys")]
pub struct Force {
    /// Standard deviations along X Y Z, N.
    pub sigma_n: [f64; 3],
    /// Its spectrum.
    pub band: Band,
    /// What the random numbers begin with; equal seeds give equal forces.
    pub seed: u64,
    /// How long it acts, after the time in which the machine forgets its start.
    pub seconds: f64,
}

impl TryFrom<ForceKeys> for Force {
    type Error = NoForce;

    fn try_from(keys: ForceKeys) -> Result<Self, NoForce> {
        let sigma_n = keys.sigma_n.map(|sigma| sigma.0);
        if sigma_n == [0.0; 3] {
            return Err(NoForce::Nothing);
        }
        let band = match (keys.corner_hz, keys.band_hz, keys.band_quality) {
            (Some(corner), None, None) => Band::Corner(corner.0),
            (None, Some(hz), Some(quality)) => Band::About { hz: hz.0, quality: quality.0 },
            _ => return Err(NoForce::Spectrum),
        };
        Ok(Self { sigma_n, band, seed: keys.seed, seconds: keys.seconds.0 })
    }
}

/// An angle that a helix cannot have.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("{0}: expected 0 degrees or more, and less than 90")]
pub struct NoHelix(f64);

/// The angle of a helix to the tool axis: 0 to less than 90 degrees.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(try_from = "f64")]
pub struct Helix(pub f64);

impl TryFrom<f64> for Helix {
    type Error = NoHelix;

    fn try_from(value: f64) -> Result<Self, NoHelix> {
        if (0.0..90.0).contains(&value) { Ok(Self(value)) } else { Err(NoHelix(value)) }
    }
}

/// `[milling]`: how the cutter of `[cutting]` runs.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Milling {
    /// Turns per minute.
    pub speed_rpm: Positive,
    /// Feed per tooth.
    pub feed_mm: Positive,
    pub diameter_mm: Positive,
    /// Angle of its helix; 0 where it is missing.
    pub helix_deg: Option<Helix>,
    /// Tangential force of the edge per depth of cut.
    #[serde(default)]
    pub kte_n_per_mm: NotNegative,
    /// Radial.
    #[serde(default)]
    pub kre_n_per_mm: NotNegative,
    /// Axial.
    #[serde(default)]
    pub kae_n_per_mm: NotNegative,
    /// Direction of the feed in machine axes; X where it is missing.
    pub feed: Option<Direction>,
    /// How long it cuts, after the time in which the machine forgets its start.
    pub seconds: Positive,
}
