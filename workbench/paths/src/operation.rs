// SPDX-License-Identifier: GPL-2.0-or-later
//! Typical tool paths of paper 003: milling rows, circles, pockets, plunges, turning, drilling.
//!
//! Every operation is also a subroutine for LinuxCNC (`subroutines`), with the same
//! arguments and the same moves. Positions are in work coordinates, in mm: in a plane the two axes of
//! G17, G18 and G19 (X Y, Z X, Y Z), and the level perpendicular to it.

use crate::milling::{Circle, Helix, Pocket, Rows, Spiral};
use crate::pen::{Change, Step};
use crate::turning::{Drill, Plunge, Turn};
use serde::Deserialize;

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Operation {
    Zigzag(Rows),
    /// Rows in one direction, retracted on the return.
    Loop(Rows),
    Circle(Circle),
    Pocket(Pocket),
    /// A pocket with straight sides: a zigzag, then the boundary.
    BoxPocket(Rows),
    Spiral(Spiral),
    /// A cylindrical or conical helix.
    Helix(Helix),
    /// A step of a shaft.
    Turn(Turn),
    /// A groove.
    Plunge(Plunge),
    /// A hole.
    Drill(Drill),
    Tool(Change),
}

#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("[[operation]] {number}, {name}: {text}")]
pub struct OperationError {
    number: usize,
    name: &'static str,
    text: String,
}

impl Operation {
    pub fn name(&self) -> &'static str {
        match self {
            Self::Zigzag(_) => "zigzag",
            Self::Loop(_) => "loop",
            Self::Circle(_) => "circle",
            Self::Pocket(_) => "pocket",
            Self::BoxPocket(_) => "box-pocket",
            Self::Spiral(_) => "spiral",
            Self::Helix(_) => "helix",
            Self::Turn(_) => "turn",
            Self::Plunge(_) => "plunge",
            Self::Drill(_) => "drill",
            Self::Tool(_) => "tool",
        }
    }

    /// Returns its moves, with spirals and cones within `chord` of their curves; `number` from 1.
    ///
    /// # Errors
    /// The numbers do not describe a path.
    pub fn steps(&self, number: usize, chord: f64) -> Result<Vec<Step>, OperationError> {
        if let Some(text) = self.refusal() {
            return Err(OperationError { number, name: self.name(), text });
        }
        Ok(match self {
            Self::Zigzag(rows) => rows.there_and_back(),
            Self::Loop(rows) => rows.one_way(),
            Self::BoxPocket(rows) => rows.around(),
            Self::Circle(circle) => circle.moves(),
            Self::Pocket(pocket) => pocket.moves(chord),
            Self::Spiral(spiral) => spiral.moves(chord),
            Self::Helix(helix) => helix.moves(chord),
            Self::Turn(turn) => turn.moves(),
            Self::Plunge(plunge) => plunge.moves(),
            Self::Drill(drill) => drill.moves(),
            Self::Tool(change) => vec![Step::Tool(*change)],
        })
    }

    fn refusal(&self) -> Option<String> {
        match self {
            Self::Zigzag(rows) | Self::Loop(rows) | Self::BoxPocket(rows) => rows.refusal(),
            Self::Helix(helix) => helix.refusal(),
            Self::Turn(turn) => turn.refusal(),
            Self::Drill(drill) => drill.refusal(),
            Self::Circle(_) | Self::Pocket(_) | Self::Spiral(_) => None,
            Self::Plunge(_) | Self::Tool(_) => None,
        }
    }
}
