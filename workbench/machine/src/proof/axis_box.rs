// SPDX-License-Identifier: GPL-2.0-or-later
//! A pose box inside the workspace, as large as its faces can be moved outward.
//!
//! First the range of the axes is shrunk toward home until it is proved (see [`crate::proof::cell`]).
//! Then the faces are moved outward in turn, by a share of the range at a time, as long as the
//! added layer is proved. The result is a box of which no face can be moved further
//! within the cells that a proof may use. It is not the largest box, for which
//! no common measure of millimeters and degrees exists.

use crate::digits::plain;
use crate::proof::cell::{Cell, Verdict};
use crate::proof::reach::{Reach, Stop};
use crate::read::mechanism::Mechanism;
use kinematics::{Letter, Vector3};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;

/// Number of halvings of the share of the range to which the box is shrunk.
const SHRINKS: i32 = 5;

/// Shares of a range by which a face is moved.
const SHARES: [f64; 4] = [1.0 / 8.0, 1.0 / 16.0, 1.0 / 32.0, 1.0 / 64.0];

/// Largest number of cells of the proof of all axis limits, of one other proof, and of all proofs of growing
/// boxes.
const WHOLE_CELLS: usize = 50_000;
const MOST_CELLS: usize = 10_000;
const ALL_CELLS: usize = 20_000;

/// Largest number of cells of all proofs of a box that must be covered by a single proof.
const PROOFS_CELLS: usize = 200_000;

/// Tested shares of the angles.
const ANGLES: [f64; 4] = [1.0, 0.75, 0.5, 0.25];

/// Poses sampled before a proof: a pose outside makes the proof unnecessary.
const DRAWN: usize = 200;

/// Random paths down the tree of cells from which its size is estimated.
const WAYS: usize = 32;

/// A proof is skipped if its estimated number of cells is this many times the allowed one:
/// the estimate is unbiased, but scatters.
const DOUBT: f64 = 2.0;

/// Range of an angle without limits in the file, in either direction from home.
const FREE_ANGLE_DEG: f64 = 90.0;

/// Poses between two opposite corners, machine units and degrees.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct AxisBox {
    /// Lowest coordinates.
    pub low: [f64; 6],
    /// Highest coordinates.
    pub high: [f64; 6],
}

/// Digits after the decimal point of suggested limits, for a box that is 1 to 10 units wide.
const LIMIT_DIGITS: i32 = 3;

impl AxisBox {
    /// Returns the pose at these shares of the extents.
    pub fn at(&self, shares: [f64; 6]) -> [f64; 6] {
        std::array::from_fn(|k| self.low[k] + shares[k] * (self.high[k] - self.low[k]))
    }

    /// Rounds the ends to few digits, inside this box.
    pub fn rounded(&self) -> Self {
        let mut rounded = *self;
        for k in 0..6 {
            let width = self.high[k] - self.low[k];
            if width > 0.0 {
                let grid = 10_f64.powi(LIMIT_DIGITS - width.log10().floor() as i32);
                rounded.low[k] = plain((self.low[k] * grid).ceil() / grid);
                rounded.high[k] = plain((self.high[k] * grid).floor() / grid);
            }
        }
        rounded
    }

    /// Replaces the ends of the coordinates in `of` by those of another box.
    pub fn with_ends(mut self, other: &Self, of: [bool; 6]) -> Self {
        for k in (0..6).filter(|k| of[*k]) {
            (self.low[k], self.high[k]) = (other.low[k], other.high[k]);
        }
        self
    }

    fn shrunk(&self, to: &[f64; 6], share: f64) -> Self {
        self.with_shares(to, [share; 2])
    }

    /// Shrinks the box toward a pose, with these shares of its lengths and of its angles.
    fn with_shares(&self, to: &[f64; 6], shares: [f64; 2]) -> Self {
        let share = |k: usize| shares[usize::from(Letter::ALL[k].is_angle())];
        let part = |end: &[f64; 6]| std::array::from_fn(|k| to[k] + share(k) * (end[k] - to[k]));
        Self { low: part(&self.low), high: part(&self.high) }
    }
}

/// Returns the limits of the axes, finite even if the file gives none.
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

/// Steps of a ray from home to its end, and halvings of the last one.
const RAY_STEPS: u32 = 64;
const RAY_HALVINGS: u32 = 12;

/// Largest length of a ray, in sizes of the machine.
pub const FARTHEST: f64 = 2.0;

/// Returns the end of a ray from home along coordinate `k`, and the limit at it; none at the distance `far`.
pub fn ray(config: &Mechanism, reach: &Reach, k: usize, far: f64) -> (f64, Option<Stop>) {
    let stop = |share: f64| {
        let mut pose = config.home;
        pose[k] += share * far;
        reach.check(&pose).err()
    };
    let share = |n: u32| f64::from(n) / f64::from(RAY_STEPS);
    let Some(first) = (1..=RAY_STEPS).find(|n| stop(share(*n)).is_some()) else {
        return (config.home[k] + far, None);
    };
    let (mut good, mut bad) = (share(first - 1), share(first));
    for _ in 0..RAY_HALVINGS {
        let middle = 0.5 * (good + bad);
        if stop(middle).is_none() { good = middle } else { bad = middle }
    }
    (config.home[k] + good * far, stop(bad))
}

/// Returns the range of X, Y and Z that the machine reaches from home, each alone, whatever the limits of the axes are;
/// that of the angles is `within`.
pub fn reached(config: &Mechanism, reach: &Reach, within: &AxisBox) -> AxisBox {
    let mut reached = *within;
    for k in (0..3).filter(|k| !config.machine.layout().is_held(Letter::ALL[*k])) {
        let far = FARTHEST * config.machine.size();
        let end = |far| ray(config, reach, k, far).0;
        (reached.low[k], reached.high[k]) = (end(-far), end(far));
    }
    reached
}

/// The limit at a face of a box.
#[derive(Clone, Debug, PartialEq)]
pub struct End {
    /// Index of the coordinate.
    pub k: usize,
    pub is_high: bool,
    /// What a pose slightly beyond the face violates; `None` if none is found, only the proof ends there.
    pub stop: Option<Stop>,
}

/// Distance beyond a face at which poses are checked, as a share of the range.
const BEYOND: f64 = 1.0 / 64.0;

/// Returns the limits at the faces of a box in X, Y and Z, which lies in the range `reached`.
pub fn ends(config: &Mechanism, reach: &Reach, part: &AxisBox, reached: &AxisBox) -> Vec<End> {
    let moved = (0..3).filter(|k| !config.machine.layout().is_held(Letter::ALL[*k]));
    let faces = moved.flat_map(|k| [(k, false), (k, true)]);
    let end = |(k, is_high): (usize, bool)| {
        let step = BEYOND * (reached.high[k] - reached.low[k]);
        let mut face = *part;
        let at = if is_high { part.high[k] + step } else { part.low[k] - step };
        (face.low[k], face.high[k]) = (at, at);
        let mut rng = Pcg64::seed_from_u64(0);
        let drawn = (0..DRAWN).map(|_| face.at(std::array::from_fn(|_| rng.random())));
        let stop = corners(&face).chain(drawn).find_map(|pose| reach.check(&pose).err());
        End { k, is_high, stop }
    };
    faces.map(end).collect()
}

/// Finds the box, without a tool; `progress` receives the completed share of the work.
///
/// Growing from home leaves a box in six coordinates small; growing from the box in X Y Z with all of
/// the tilt, if the caller has one ([`at_tilt`]), may leave it larger. Returns the one whose narrowest
/// side has a larger share of its range: a box without rotation is of little use, however large it is.
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

/// Returns a box that a single proof covers, so that a check of its ends as axis limits repeats that proof. It has all
/// of the angles if that leaves a share of the lengths of at least `enough`, otherwise less of them; then faces are
/// moved as far as the whole box is still proved. `asked` coordinates always have the ends of `within`.
/// `progress` receives the completed share of the work. `None` if not even these are proved, with the other
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

/// Returns the smallest ratio of corresponding moved sides of two boxes, at most 1.
fn share_of(part: &AxisBox, of: &AxisBox, moved: &[bool; 6]) -> f64 {
    let share = |k: usize| (part.high[k] - part.low[k]) / (of.high[k] - of.low[k]);
    (0..6).filter(|k| moved[*k]).map(share).fold(1.0, f64::min)
}

/// Returns whether a box is proved with a tool offset.
pub fn holds_with(config: &Mechanism, tool: &Vector3<f64>, part: &AxisBox) -> bool {
    Search::new(config, tool, part).is_ok_and(|mut search| search.is_inside(part))
}

/// Returns a box in X Y Z that contains a proved one with the same angles, or one of a larger tilt, whichever is larger,
/// and reaches as far as it is proved in the range `reached`.
pub fn grown(
    config: &Mechanism,
    reached: &AxisBox,
    proved: &AxisBox,
    steeper: Option<&AxisBox>,
) -> AxisBox {
    let volume = |part: &AxisBox| -> f64 {
        let moved = (0..3).filter(|k| !config.machine.layout().is_held(Letter::ALL[*k]));
        moved.map(|k| part.high[k] - part.low[k]).product()
    };
    let mut found = *proved;
    if let Some(steeper) = steeper.filter(|steeper| volume(steeper) > volume(proved)) {
        found = found.with_ends(steeper, Letter::ALL.map(|letter| !letter.is_angle()));
    }
    if let Ok(mut search) = Search::new(config, &Vector3::zeros(), reached) {
        search.grow(
            &mut found,
            &Letter::ALL.map(|l| !l.is_angle() && !config.machine.layout().is_held(l)),
        );
    }
    found
}

/// Returns the box in X Y Z with A and B up to `tilt` degrees in either direction from 0, C at home; `None` if
/// none is proved about home. `steeper` is a proved box of a larger tilt.
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
    /// Remaining number of cells.
    left: usize,
}

impl<'a> Search<'a> {
    fn new(config: &'a Mechanism, tool: &Vector3<f64>, within: &AxisBox) -> Result<Self, Stop> {
        let reach = Reach::with_tool(config, config.spindle + tool).map_err(Stop::Fault)?;
        reach.check(&config.home)?;
        Ok(Self { reach, within: *within, asked: [false; 6], left: ALL_CELLS })
    }

    /// Returns these shares of lengths and angles, and all of the `asked` coordinates.
    fn part(&self, config: &Mechanism, shares: [f64; 2]) -> AxisBox {
        self.within.with_shares(&config.home, shares).with_ends(&self.within, self.asked)
    }

    /// Moves the faces outward as far as possible.
    fn grow(&mut self, found: &mut AxisBox, moved: &[bool; 6]) {
        for share in SHARES {
            while self.push_all(found, moved, share) {}
        }
    }

    /// Moves every face once if that can be proved; returns whether any has moved.
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

    /// Returns the largest share of the lengths that is proved with this share of the angles, or 0.
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

    /// Moves every face once if the whole box stays proved; returns whether any has moved.
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

    /// Returns whether a box is proved in the same way as axis limits.
    fn is_whole(&mut self, part: &AxisBox) -> bool {
        self.is_proved(part, WHOLE_CELLS.min(self.left))
    }

    /// Estimates whether a proof needs at most this many cells, by Knuth's method (1975):
    /// random halves are followed down to a proved cell, and a cell reached
    /// by n choices counts 2ⁿ. Returns false if a sampled pose is outside the limits.
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

    /// Returns whether a box is proved to be inside with the remaining cells.
    fn is_inside(&mut self, part: &AxisBox) -> bool {
        self.is_proved(part, MOST_CELLS.min(self.left))
    }

    /// Returns whether a box is proved to be inside with this many cells.
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
