// SPDX-License-Identifier: GPL-2.0-or-later
//! Repeatable random numbers: a fixed seed per test, so that a failure can be
//! reproduced, and one setting for the number of cases.

/// SplitMix64 (Steele, Lea and Flood, 2014): small, and the same everywhere.
pub struct Random(u64);

impl Random {
    /// Creates a generator with reproducible numbers for a seed.
    pub fn new(seed: u64) -> Random {
        Random(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns a uniform number between `low` and `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        let unit = (self.next() >> 11) as f64 / (1_u64 << 53) as f64;
        low + (high - low) * unit
    }

    /// Returns a uniform number within ± `size`.
    pub fn within(&mut self, size: f64) -> f64 {
        self.between(-size, size)
    }

    /// Returns a direction, uniform on the sphere.
    pub fn direction(&mut self) -> [f64; 3] {
        let z = self.within(1.0);
        let angle = self.within(std::f64::consts::PI);
        let r = (1.0 - z * z).sqrt();
        [r * angle.cos(), r * angle.sin(), z]
    }
}

/// Returns `usual` cases, times `PKMKINS_CASES` (default 1; 10 for a long run, 0.01 for a quick one).
pub fn cases(usual: usize) -> usize {
    let factor: f64 = match std::env::var("PKMKINS_CASES") {
        Ok(text) => text.parse().expect("PKMKINS_CASES is a number"),
        Err(_) => 1.0,
    };
    ((usual as f64 * factor).round() as usize).max(1)
}
