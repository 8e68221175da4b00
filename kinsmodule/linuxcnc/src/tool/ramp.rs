// SPDX-License-Identifier: GPL-2.0-or-later
//! The motion along a path: constant acceleration, constant speed, constant deceleration.

use super::path::Path;
use libm::sqrt;

/// Motion along a surveyed path, in shares of the path and seconds.
#[derive(Clone, Copy)]
pub(super) struct Ramp {
    pub(super) path: Path,
    pub(super) share: f64,
    pub(super) speed: f64,
    max_speed: f64,
    acceleration: f64,
}

impl Ramp {
    /// At the beginning of the path, at standstill.
    pub(super) fn new(path: Path, max_speed: f64, acceleration: f64) -> Self {
        Self { path, share: 0.0, speed: 0.0, max_speed, acceleration }
    }

    /// One cycle further, or one nearer to standstill.
    ///
    /// At speed v, slower by d in every cycle of t, the rest of the path is
    /// v t + (v − d) t + … = t v (v + d) / 2d; solved for v that is the speed from which
    /// it can still stop at the end. The last step is what is left; from the step before
    /// it the speed falls by at most 9/8 d.
    pub(super) fn continued(self, brake: bool, seconds: f64) -> Self {
        let left = 1.0 - self.share;
        let max_change = self.acceleration * seconds;
        let half = max_change / 2.0;
        let stoppable = sqrt(half * half + 2.0 * self.acceleration * left) - half;
        let faster = (self.speed + max_change).min(self.max_speed).min(stoppable);
        let slower = (self.speed - max_change).max(0.0);
        let speed = if brake { slower.min(stoppable) } else { faster };
        let step = speed * seconds;
        // Not more than what is left, nor what rounding would leave for another cycle.
        let share = if step * (1.0 + 1e-9) < left { self.share + step } else { 1.0 };
        Self { share, speed, ..self }
    }
}
