// SPDX-License-Identifier: GPL-2.0-or-later
//! A box of poses wholly inside the workspace, as large as its faces can be pushed.
//!
//! First the range of the axes is shrunk towards home until it is proved (see [`crate::proof::cell`]).
//! Then the faces are pushed outwards in turn, a share of the range at a time, as long as the
//! layer that this adds is proved. What comes out is a box of which no face can be pushed any
//! more with the effort that a proof may take: not the largest of all boxes, for which there is
//! no one measure of millimetres and degrees together.

use crate::proof::cell::{Cell, Verdict};
use crate::proof::reach::{Reach, Stop};
use crate::read::mechanism::Mechanism;
use kinematics::{Letter, Vector3};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// How often the share of the range is halved that the box is shrunk to.
const SHRINKS: i32 = 5;

/// Shares of a range that a face is pushed by.
const SHARES: [f64; 4] = [1.0 / 8.0, 1.0 / 16.0, 1.0 / 32.0, 1.0 / 64.0];

/// Most cells of the proof of all of the axis limits, of one other proof, and of all that make a box
/// grow.
const WHOLE_CELLS: usize = 50_000;
const MOST_CELLS: usize = 10_000;
const ALL_CELLS: usize = 20_000;

/// Most cells of all proofs of a box that has to be covered by one.
const PROOFS_CELLS: usize = 200_000;

/// Shares of the angles that are tried.
const ANGLES: [f64; 4] = [1.0, 0.75, 0.5, 0.25];

/// Poses drawn before a proof is begun: one that cannot be taken spares it.
const DRAWN: usize = 200;

/// Ways down the tree of cells from which its size is estimated.
const WAYS: usize = 32;

/// A proof is not begun where it is estimated to take this many times the cells that it may take:
/// the estimate has no bias, but scatters.
const DOUBT: f64 = 2.0;

/// Range of an angle for which the file gives no limits, either way from home.
const FREE_ANGLE_DEG: f64 = 90.0;

/// Poses from one corner to the opposite one, machine units and degrees.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct AxisBox {
    /// Lowest coordinates.
    pub low: [f64; 6],
    /// Highest coordinates.
    pub high: [f64; 6],
}

/// Digits after the point of suggested limits, of a box that is 1 to 10 units wide.
const LIMIT_DIGITS: i32 = 3;

impl AxisBox {
    /// The pose at these shares of the extents.
    pub fn at(&self, shares: [f64; 6]) -> [f64; 6] {
        std::array::from_fn(|k| self.low[k] + shares[k] * (self.high[k] - self.low[k]))
    }

    /// Ends with few digits, inside this box.
    pub fn rounded(&self) -> Self {
        let mut rounded = *self;
        for k in 0..6 {
            let width = self.high[k] - self.low[k];
            if width > 0.0 {
                let grid = 10_f64.powi(LIMIT_DIGITS - width.log10().floor() as i32);
                rounded.low[k] = (self.low[k] * grid).ceil() / grid;
                rounded.high[k] = (self.high[k] * grid).floor() / grid;
            }
        }
        rounded
    }

    /// With the ends of another box where `of` says so.
    pub fn with_ends(mut self, other: &Self, of: [bool; 6]) -> Self {
        for k in (0..6).filter(|k| of[*k]) {
            (self.low[k], self.high[k]) = (other.low[k], other.high[k]);
        }
        self
    }

    fn shrunk(&self, to: &[f64; 6], share: f64) -> Self {
        self.with_shares(to, [share; 2])
    }

    /// With these shares of its lengths and of its angles.
    fn with_shares(&self, to: &[f64; 6], shares: [f64; 2]) -> Self {
        let share = |k: usize| shares[usize::from(Letter::ALL[k].is_angle())];
        let part = |end: &[f64; 6]| std::array::from_fn(|k| to[k] + share(k) * (end[k] - to[k]));
        Self { low: part(&self.low), high: part(&self.high) }
    }
}

/// The limits of the axes, finite also where the file gives none.
pub fn range(config: &Mechanism) -> AxisBox {
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

/// The box, without a tool; `progress` is told the share of the work that is done.
///
/// Growing from home leaves a box in six coordinates small; growing from the box in X Y Z with all of
/// the tilt, where the caller has one ([`at_tilt`]), may leave it larger. The one whose narrowest
/// side has more of its range is taken: a box without a turn is of little use, be it ever so large.
///
/// # Errors
/// Home itself is outside.
pub fn find(
    config: &Mechanism,
    within: &AxisBox,
    tilted: Option<&AxisBox>,
    mut progress: impl FnMut(f64),
) -> Result<AxisBox, Stop> {
    let mut search = Search::new(config, &Vector3::zeros(), within)?;
    if search.is_proved(within, WHOLE_CELLS) {
        return Ok(*within);
    }
    search.left = ALL_CELLS;
    let steps = f64::from(SHRINKS) + SHARES.len() as f64;
    let mut found = AxisBox { low: config.home, high: config.home };
    let mut shrunk = 0.0;
    for n in 1..=SHRINKS {
        let share = shrunk + 0.5_f64.powi(n);
        let part = within.shrunk(&config.home, share);
        if search.is_inside(&part) {
            (found, shrunk) = (part, share);
        }
        progress(f64::from(n) / steps);
    }
    let moved = Letter::ALL.map(|letter| !config.machine.layout().is_held(letter));
    search.grow(&mut found, &moved);
    if let Some(tilted) = tilted {
        let mut other = *tilted;
        search.left = ALL_CELLS;
        search.grow(&mut other, &moved);
        if share_of(&other, within, &moved) > share_of(&found, within, &moved) {
            found = other;
        }
    }
    progress(1.0);
    Ok(found)
}

/// A box that one proof covers, so that a check of it as axis limits repeats that proof: with all of the
/// angles if that leaves a share of the lengths that is `enough`, otherwise with less of them; then faces are
/// pushed as far as the whole is still proved. The ends of `asked` coordinates are those of `within` in any case.
/// `progress` is told the share of the work that is done. `None` where not even these are proved, with the other
/// coordinates at home.
///
/// # Errors
/// Home itself is outside.
pub fn in_one_proof(
    config: &Mechanism,
    within: &AxisBox,
    asked: [bool; 6],
    enough: f64,
    mut progress: impl FnMut(f64),
) -> Result<Option<AxisBox>, Stop> {
    let mut search = Search::new(config, &Vector3::zeros(), within)?;
    (search.left, search.asked) = (PROOFS_CELLS, asked);
    if search.is_whole(within) {
        return Ok(Some(*within));
    }
    let mut found = search.part(config, [0.0; 2]);
    if asked.contains(&true) && !search.is_whole(&found) {
        return Ok(None);
    }
    for angles in ANGLES {
        let lengths = search.lengths(config, angles);
        if lengths > 0.0 {
            found = search.part(config, [lengths, angles]);
        }
        progress(1.0 - search.left as f64 / PROOFS_CELLS as f64);
        if lengths > 0.0 && lengths >= enough {
            break;
        }
    }
    for share in SHARES {
        while search.push_whole(&mut found, share) {
            progress(1.0 - search.left as f64 / PROOFS_CELLS as f64);
        }
    }
    Ok(Some(found))
}

/// What the narrowest side of a box has of that of another one.
fn share_of(part: &AxisBox, of: &AxisBox, moved: &[bool; 6]) -> f64 {
    let share = |k: usize| (part.high[k] - part.low[k]) / (of.high[k] - of.low[k]);
    (0..6).filter(|k| moved[*k]).map(share).fold(1.0, f64::min)
}

/// Whether a box is proved with a tool offset.
pub fn holds_with(config: &Mechanism, tool: &Vector3<f64>, part: &AxisBox) -> bool {
    Search::new(config, tool, part).is_ok_and(|mut search| search.is_inside(part))
}

/// The box in X Y Z with A and B up to `tilt` degrees either way from 0, C at home; `None` where
/// none is proved about home. `steeper` is one that is proved for a larger tilt.
pub fn at_tilt(
    config: &Mechanism,
    within: &AxisBox,
    tilt: f64,
    steeper: Option<&AxisBox>,
) -> Option<AxisBox> {
    let mut found = AxisBox { low: config.home, high: config.home };
    for k in 3..5 {
        found.low[k] = within.low[k].max(-tilt);
        found.high[k] = within.high[k].min(tilt);
    }
    let lengths = |to: &mut AxisBox, of: &AxisBox| {
        to.low[..3].copy_from_slice(&of.low[..3]);
        to.high[..3].copy_from_slice(&of.high[..3]);
    };
    let mut whole = found;
    lengths(&mut whole, within);
    if let Some(steeper) = steeper {
        lengths(&mut found, steeper);
    }
    if found == whole {
        return Some(whole);
    }
    let mut search = Search::new(config, &Vector3::zeros(), within).ok()?;
    if search.is_inside(&whole) {
        return Some(whole);
    }
    search.left = ALL_CELLS;
    if steeper.is_none() && !search.is_inside(&found) {
        return None;
    }
    search.grow(
        &mut found,
        &Letter::ALL.map(|l| !l.is_angle() && !config.machine.layout().is_held(l)),
    );
    Some(found)
}

struct Search<'a> {
    reach: Reach<'a>,
    within: AxisBox,
    /// Coordinates that keep the ends of `within`.
    asked: [bool; 6],
    /// Cells that may still be looked at.
    left: usize,
}

impl<'a> Search<'a> {
    fn new(config: &'a Mechanism, tool: &Vector3<f64>, within: &AxisBox) -> Result<Self, Stop> {
        let reach = Reach::with_tool(config, config.spindle + tool).map_err(Stop::Fault)?;
        reach.check(&config.home)?;
        Ok(Self { reach, within: *within, asked: [false; 6], left: ALL_CELLS })
    }

    /// With these shares of lengths and angles, and all of what is asked.
    fn part(&self, config: &Mechanism, shares: [f64; 2]) -> AxisBox {
        self.within.with_shares(&config.home, shares).with_ends(&self.within, self.asked)
    }

    /// Pushes the faces as far as they go.
    fn grow(&mut self, found: &mut AxisBox, moved: &[bool; 6]) {
        for share in SHARES {
            while self.push_all(found, moved, share) {}
        }
    }

    /// Pushes every face once where that can be proved; whether any has moved.
    fn push_all(&mut self, found: &mut AxisBox, moved: &[bool; 6], share: f64) -> bool {
        let mut any = false;
        for k in (0..6).filter(|k| moved[*k]) {
            let step = share * (self.within.high[k] - self.within.low[k]);
            for is_high in [false, true] {
                let mut layer = *found;
                if is_high {
                    (layer.low[k], layer.high[k]) =
                        (found.high[k], (found.high[k] + step).min(self.within.high[k]));
                } else {
                    (layer.low[k], layer.high[k]) =
                        ((found.low[k] - step).max(self.within.low[k]), found.low[k]);
                }
                if layer.high[k] > layer.low[k] && self.is_inside(&layer) {
                    found.low[k] = found.low[k].min(layer.low[k]);
                    found.high[k] = found.high[k].max(layer.high[k]);
                    any = true;
                }
            }
        }
        any
    }

    /// The largest share of the lengths that is proved with this share of the angles; 0: none.
    fn lengths(&mut self, config: &Mechanism, angles: f64) -> f64 {
        if self.asked[..3] == [true; 3] {
            return f64::from(self.is_whole(&self.part(config, [1.0, angles])));
        }
        let mut found = 0.0;
        for n in 1..=SHRINKS {
            let share = found + 0.5_f64.powi(n);
            if self.is_whole(&self.part(config, [share, angles])) {
                found = share;
            }
        }
        found
    }

    /// Pushes every face once where the whole box stays proved; whether any has moved.
    fn push_whole(&mut self, found: &mut AxisBox, share: f64) -> bool {
        let mut any = false;
        for k in 0..6 {
            let step = share * (self.within.high[k] - self.within.low[k]);
            for is_high in [false, true] {
                let mut pushed = *found;
                if is_high {
                    pushed.high[k] = (found.high[k] + step).min(self.within.high[k]);
                } else {
                    pushed.low[k] = (found.low[k] - step).max(self.within.low[k]);
                }
                if pushed != *found && self.is_whole(&pushed) {
                    *found = pushed;
                    any = true;
                }
            }
        }
        any
    }

    /// Whether a box is proved as axis limits are.
    fn is_whole(&mut self, part: &AxisBox) -> bool {
        self.is_proved(part, WHOLE_CELLS.min(self.left))
    }

    /// Whether a proof will do with so many cells, as far as an estimate by Knuth's method (1975) can
    /// say: halves are followed at random down to a cell that is proved, and a cell that was reached
    /// by n choices stands for 2ⁿ. It will not where a pose is met that cannot be taken.
    fn is_likely(&mut self, part: &AxisBox, most: usize, rng: &mut Pcg64) -> bool {
        let mut left = DOUBT * (most * WAYS) as f64;
        for _ in 0..WAYS {
            let mut cell = Cell::between(&part.low, &part.high);
            let mut stands_for = 1.0;
            loop {
                self.left = self.left.saturating_sub(1);
                left -= stands_for;
                match self.reach.judge(&cell) {
                    Verdict::Inside => break,
                    Verdict::Open(k) if left > 0.0 => cell = cell.halves(k)[rng.random_range(0..2)],
                    _ => return false,
                }
                stands_for *= 2.0;
            }
        }
        left > 0.0
    }

    /// Whether a box is proved to be inside with the cells that are left.
    fn is_inside(&mut self, part: &AxisBox) -> bool {
        self.is_proved(part, MOST_CELLS.min(self.left))
    }

    /// Whether a box is proved to be inside with so many cells.
    fn is_proved(&mut self, part: &AxisBox, most: usize) -> bool {
        let mut rng = Pcg64::seed_from_u64(0);
        let drawn = (0..DRAWN).map(|_| part.at(std::array::from_fn(|_| rng.random())));
        let mut tried = corners(part).chain(drawn);
        if most == 0 || tried.any(|pose| self.reach.check(&pose).is_err()) {
            return false;
        }
        if !self.is_likely(part, most, &mut rng) {
            return false;
        }
        let mut open = vec![Cell::between(&part.low, &part.high)];
        for _ in 0..most {
            let Some(cell) = open.pop() else { return true };
            self.left = self.left.saturating_sub(1);
            match self.reach.judge(&cell) {
                Verdict::Inside => {}
                Verdict::Outside(_) => return false,
                Verdict::Open(k) => open.extend(cell.halves(k)),
            }
        }
        open.is_empty()
    }
}

fn corners(part: &AxisBox) -> impl Iterator<Item = [f64; 6]> {
    let part = *part;
    (0..64_usize).map(move |n| {
        std::array::from_fn(|k| if n >> k & 1 == 0 { part.low[k] } else { part.high[k] })
    })
}
