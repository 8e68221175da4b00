// SPDX-License-Identifier: GPL-2.0-or-later
//! A box of poses wholly inside the workspace, as large as its faces can be pushed.
//!
//! First the range of the axes is shrunk towards home until it is proved (see [`crate::cell`]).
//! Then the faces are pushed outwards in turn, a share of the range at a time, as long as the
//! layer that this adds is proved. What comes out is a box of which no face can be pushed any
//! more with the effort that a proof may take: not the largest of all boxes, for which there is
//! no one measure of millimetres and degrees together.

use crate::cell::{Cell, Reach, Stop, Verdict};
use crate::machine::MachineConfig;
use kinematics::{Fault, Letter};

/// How often the share of the range is halved that the box is shrunk to.
const SHRINKS: i32 = 5;

/// Shares of a range that a face is pushed by.
const SHARES: [f64; 3] = [1.0 / 8.0, 1.0 / 16.0, 1.0 / 32.0];

/// Most cells of one proof: a tenth of a second or so.
const MOST_CELLS: usize = 5_000;

/// Range of an angle for which the file gives no limits, either way from home.
const FREE_ANGLE_DEG: f64 = 90.0;

/// Poses from one corner to the opposite one, machine units and degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisBox {
    /// Lowest coordinates.
    pub low: [f64; 6],
    /// Highest coordinates.
    pub high: [f64; 6],
}

impl AxisBox {
    /// Whether a pose is in it.
    pub fn contains(&self, pose: &[f64; 6]) -> bool {
        (0..6).all(|k| (self.low[k]..=self.high[k]).contains(&pose[k]))
    }

    fn shrunk(&self, to: &[f64; 6], share: f64) -> Self {
        let part = |end: &[f64; 6]| std::array::from_fn(|k| to[k] + share * (end[k] - to[k]));
        Self { low: part(&self.low), high: part(&self.high) }
    }
}

/// The limits of the axes, finite also where the file gives none.
pub fn range(config: &MachineConfig) -> AxisBox {
    let size = config.machine.size();
    let mut range = AxisBox { low: config.home, high: config.home };
    for letter in Letter::ALL.into_iter().filter(|l| !config.machine.layout().is_held(*l)) {
        let k = letter.index();
        let free = if letter.is_angle() { FREE_ANGLE_DEG } else { 2.0 * size };
        range.low[k] = config.axes[k].min.max(config.home[k] - free);
        range.high[k] = config.axes[k].max.min(config.home[k] + free);
    }
    range
}

/// The box; `progress` is told the share of the work that is done.
///
/// # Errors
/// Home itself is outside.
pub fn find(
    config: &MachineConfig,
    within: &AxisBox,
    mut progress: impl FnMut(f64),
) -> Result<AxisBox, Stop> {
    let reach = Reach::new(config).map_err(|fault: Fault| Stop::Fault(fault))?;
    reach.check(&config.home)?;
    if is_inside(&reach, within) {
        return Ok(*within);
    }
    let steps = f64::from(SHRINKS) + SHARES.len() as f64;
    let mut found = AxisBox { low: config.home, high: config.home };
    let mut shrunk = 0.0;
    for n in 1..=SHRINKS {
        let share = shrunk + 0.5_f64.powi(n);
        let part = within.shrunk(&config.home, share);
        if is_inside(&reach, &part) {
            (found, shrunk) = (part, share);
        }
        progress(f64::from(n) / steps);
    }
    for (n, share) in SHARES.into_iter().enumerate() {
        while push_all(&reach, &mut found, within, share) {}
        progress((f64::from(SHRINKS) + n as f64 + 1.0) / steps);
    }
    Ok(found)
}

/// Pushes every face once where that can be proved; whether any has moved.
fn push_all(reach: &Reach, found: &mut AxisBox, within: &AxisBox, share: f64) -> bool {
    let mut moved = false;
    for k in (0..6).filter(|k| reach.moved()[*k]) {
        let step = share * (within.high[k] - within.low[k]);
        for is_high in [false, true] {
            let mut layer = *found;
            if is_high {
                (layer.low[k], layer.high[k]) =
                    (found.high[k], (found.high[k] + step).min(within.high[k]));
            } else {
                (layer.low[k], layer.high[k]) =
                    ((found.low[k] - step).max(within.low[k]), found.low[k]);
            }
            if layer.high[k] > layer.low[k] && is_inside(reach, &layer) {
                found.low[k] = found.low[k].min(layer.low[k]);
                found.high[k] = found.high[k].max(layer.high[k]);
                moved = true;
            }
        }
    }
    moved
}

/// Whether a box is proved to be inside.
pub fn is_inside(reach: &Reach, part: &AxisBox) -> bool {
    if corners(part).any(|corner| reach.check(&corner).is_err()) {
        return false;
    }
    let mut open = vec![Cell::between(&part.low, &part.high)];
    for _ in 0..MOST_CELLS {
        let Some(cell) = open.pop() else { return true };
        match reach.judge(&cell) {
            Verdict::Inside => {}
            Verdict::Outside(_) => return false,
            Verdict::Open(k) => open.extend(cell.halves(k)),
        }
    }
    false
}

fn corners(part: &AxisBox) -> impl Iterator<Item = [f64; 6]> {
    let part = *part;
    (0..64_usize).map(move |n| {
        std::array::from_fn(|k| if n >> k & 1 == 0 { part.low[k] } else { part.high[k] })
    })
}
