// SPDX-License-Identifier: GPL-2.0-or-later
//! The tables of a study that describe exciting forces.

use crate::study::masses::Direction;
use crate::study::number::{Helix, NotNegative, Positive};
use serde::Deserialize;

/// Why a random force is invalid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoForce {
    #[error("sigma_n: expected a force along X, Y or Z")]
    Nothing,
    #[error("expected either corner_hz or band_hz with band_quality")]
    Spectrum,
}

/// `[force]` as written in the file.
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

/// Spectrum of a random force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Band {
    /// Flat below a corner, Hz.
    Corner(f64),
    /// Around a frequency in Hz, of the width frequency/quality.
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
    pub band: Band,
    /// Seed of the random numbers; equal seeds give equal forces.
    pub seed: u64,
    /// Duration, after the time in which the effect of the initial state decays.
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

/// Largest number of cells of a stock: 200 MB.
const MOST_CELLS: f64 = 25e6;

/// Why a stock is invalid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoStock {
    #[error(
        "low_mm = {low}, high_mm = {high}: expected a lower corner in front of the higher one, in X and Y"
    )]
    Empty { low: f64, high: f64 },
    #[error("{0:.0} cells: expected at most {MOST_CELLS:.0}; use a larger cell_mm")]
    Fine(f64),
    #[error("top_mm: expected a finite height")]
    Top,
}

/// `[stock]` as written in the file.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct StockKeys {
    low_mm: [f64; 2],
    high_mm: [f64; 2],
    top_mm: f64,
    cell_mm: Positive,
}

/// `[stock]`: a block whose layers the cutter removes, in machine coordinates of the tool tip.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(try_from = "StockKeys")]
pub struct Stock {
    /// Corners in X and Y.
    pub low_mm: [f64; 2],
    pub high_mm: [f64; 2],
    /// Height of the top face.
    pub top_mm: f64,
    /// Width of the cells of the map of heights.
    pub cell_mm: f64,
}

impl Stock {
    /// Returns the number of cells along X and Y.
    pub fn cells(&self) -> [usize; 2] {
        [0, 1].map(|k| ((self.high_mm[k] - self.low_mm[k]) / self.cell_mm).ceil() as usize)
    }
}

impl TryFrom<StockKeys> for Stock {
    type Error = NoStock;

    fn try_from(keys: StockKeys) -> Result<Self, NoStock> {
        let StockKeys { low_mm, high_mm, top_mm, cell_mm: Positive(cell_mm) } = keys;
        for (low, high) in low_mm.into_iter().zip(high_mm) {
            if !(low < high && (high - low).is_finite()) {
                return Err(NoStock::Empty { low, high });
            }
        }
        if !top_mm.is_finite() {
            return Err(NoStock::Top);
        }
        let cells: f64 =
            [0, 1].map(|k| ((high_mm[k] - low_mm[k]) / cell_mm).ceil()).iter().product();
        match cells <= MOST_CELLS {
            true => Ok(Self { low_mm, high_mm, top_mm, cell_mm }),
            false => Err(NoStock::Fine(cells)),
        }
    }
}

/// `[milling]`: speed, feed and edge forces of the cutter of `[cutting]`.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Milling {
    /// Turns per minute.
    pub speed_rpm: Positive,
    /// Feed per tooth.
    pub feed_mm: Positive,
    pub diameter_mm: Positive,
    /// Helix angle; 0 if it is missing.
    pub helix_deg: Option<Helix>,
    /// Tangential force of the edge per depth of cut.
    #[serde(default)]
    pub kte_n_per_mm: NotNegative,
    /// Radial force of the edge per depth of cut.
    #[serde(default)]
    pub kre_n_per_mm: NotNegative,
    /// Axial force of the edge per depth of cut.
    #[serde(default)]
    pub kae_n_per_mm: NotNegative,
    /// Direction of the feed in machine axes; X if it is missing.
    pub feed: Option<Direction>,
    /// Duration of the cut, after the time in which the effect of the initial state decays.
    pub seconds: Positive,
}
