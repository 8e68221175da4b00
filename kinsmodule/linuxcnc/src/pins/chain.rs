// SPDX-License-Identifier: GPL-2.0-or-later
//! The pins of the axes that carry workpiece, tool or legs, and of a workpiece on the platform.

use super::maker::{Live, Maker, Source, Vector};
use crate::hal::{Direction, HalError, Pin};
use kinematics::{ChainGeometry, LinkGeometry, Load, MAX_LINKS, text};

/// Letters of the axes that can carry something.
const LETTERS: [&str; MAX_LINKS] = ["a", "b", "c", "u", "v", "w"];
const FIRST: usize = 3;

/// Number of rotary ones, which have a point.
const ROTARY: usize = 3;

#[repr(C)]
struct LinkPins {
    carries: Pin<i32>,
    axis: Vector,
    point: Vector,
}

/// Pins of the chain; those of letters that are not extra axes are not created and never read.
#[repr(C)]
pub(super) struct ChainPins {
    links: [LinkPins; MAX_LINKS],
    holder: Vector,
    /// False with two mechanisms.
    is_made: bool,
}

/// Returns the indices of the extra axes that can carry something, from the first letter on.
fn places(load: &Load) -> impl Iterator<Item = usize> + '_ {
    load.extra.places().filter_map(|place| place.checked_sub(FIRST))
}

impl ChainPins {
    /// Returns the number of its pins.
    pub(super) fn count(load: &Load) -> usize {
        // What it carries and its axis; the point of a rotary one; the fixed holder.
        places(load).map(|i| if i < ROTARY { 7 } else { 4 }).sum::<usize>() + 3
    }

    pub(super) fn create(&mut self, make: &Maker, load: &Load) -> Result<(), HalError> {
        use Direction::In;
        for i in places(load) {
            let (Some(pins), Some(letter)) = (self.links.get_mut(i), LETTERS.get(i)) else {
                continue;
            };
            let letter = *letter;
            make.one(&mut pins.carries, In, text!["pkmkins.chain.", letter, ".carries"], 0)?;
            make.letters(&mut pins.axis, In, text!["pkmkins.chain.", letter, ".axis."], [0.0; 3])?;
            if i < ROTARY {
                let point = &mut pins.point;
                make.letters(point, In, text!["pkmkins.chain.", letter, ".point."], [0.0; 3])?;
            }
        }
        make.letters(&mut self.holder, In, text!["pkmkins.work-on-platform."], [f64::NAN; 3])?;
        self.is_made = true;
        Ok(())
    }

    /// Returns the position of the control point of the fixed holder; all NaN is the default and means that the
    /// workpiece is not on the platform.
    pub(super) fn holder(&self, from: &impl Source) -> Option<[f64; 3]> {
        if !self.is_made {
            return None;
        }
        let holder = from.row(&self.holder);
        (!holder.iter().all(|v| v.is_nan())).then_some(holder)
    }

    /// Reads the chain from the pins.
    pub(super) fn given(&self, load: &Load, from: &impl Source) -> ChainGeometry {
        let mut given = ChainGeometry { holder: self.holder(from), ..ChainGeometry::NONE };
        for i in places(load).filter(|_| self.is_made) {
            if let (Some(to), Some(pins)) = (given.links.get_mut(i), self.links.get(i)) {
                *to = pins.given(i < ROTARY, from);
            }
        }
        given
    }

    /// Returns whether the pins give the frozen chain.
    pub(super) fn give(&self, frozen: &ChainGeometry, load: &Load) -> bool {
        let same = |i: usize| match (frozen.links.get(i), self.links.get(i)) {
            (Some(link), Some(pins)) => pins.given(i < ROTARY, &Live) == *link,
            _ => true,
        };
        self.holder(&Live) == frozen.holder && places(load).all(|i| !self.is_made || same(i))
    }
}

impl LinkPins {
    fn given(&self, is_rotary: bool, from: &impl Source) -> LinkGeometry {
        let point = if is_rotary { from.row(&self.point) } else { [0.0; 3] };
        LinkGeometry { carries: from.get(&self.carries), axis: from.row(&self.axis), point }
    }
}
