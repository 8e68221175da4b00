// SPDX-License-Identifier: GPL-2.0-or-later
//! The pins of a box of the workspace, for the start without a seed.

use super::maker::{LETTERS, Live, Maker, Pose6, Source};
use crate::hal::{Direction, HalError, Pin};
use kinematics::{Layout, Load, MAX_LEGS, WorkspaceBox, text};

/// Pins of one box of the workspace; those beyond `boxes=` are not created and never read.
#[repr(C)]
pub(super) struct BoxPins {
    low: Pose6,
    high: Pose6,
    /// Rows of the coordinates X … C, one pin per leg.
    matrix: [[Pin<f64>; MAX_LEGS]; 6],
    steps: Pin<u32>,
    pub(super) geometry: Pin<u32>,
}

impl BoxPins {
    pub(super) fn create(&mut self, make: &Maker, k: usize, load: &Load) -> Result<(), HalError> {
        use Direction::In;
        make.letters(&mut self.low, In, text![make.stem(), "box.", k, ".low."], [0.0; 6])?;
        make.letters(&mut self.high, In, text![make.stem(), "box.", k, ".high."], [0.0; 6])?;
        for letter in load.layout.coordinates().as_slice() {
            let row = letter.index().min(5);
            for (n, pin) in self.matrix[row].iter_mut().enumerate().take(load.layout.legs()) {
                let name = text![make.stem(), "box.", k, ".matrix.", LETTERS[row], ".", n];
                make.one(pin, In, name, 0.0)?;
            }
        }
        make.one(&mut self.steps, In, text![make.stem(), "box.", k, ".steps"], 0)?;
        make.one(&mut self.geometry, In, text![make.stem(), "box.", k, ".geometry"], 0)
    }

    pub(super) fn given(&self, layout: &Layout) -> WorkspaceBox {
        let mut given = WorkspaceBox {
            low: Live.row(&self.low),
            high: Live.row(&self.high),
            steps: self.steps.get(),
            ..WorkspaceBox::EMPTY
        };
        for letter in layout.coordinates().as_slice() {
            let row = letter.index().min(5);
            let places = given.matrix[row].iter_mut().zip(&self.matrix[row]);
            for (place, pin) in places.take(layout.legs()) {
                *place = pin.get();
            }
        }
        given
    }
}
