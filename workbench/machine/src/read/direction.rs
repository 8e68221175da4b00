// SPDX-License-Identifier: GPL-2.0-or-later
//! Direction of tools, `TOOL_DIRECTION`: a key that changes no motion, only checks tool lengths.

use crate::read::ini::{Ini, IniError};
use keys::machine as of_machine;

/// Direction of tools along the platform's Z from its reference point, at A = B = C = 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToolDirection {
    /// The tip is below the reference point, and lengths are positive.
    Down,
    /// The tip is above it, and lengths are negative.
    Up,
}

impl ToolDirection {
    /// Returns its word in the file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Down => "down",
            Self::Up => "up",
        }
    }

    /// Returns the opposite direction.
    pub const fn other(self) -> Self {
        match self {
            Self::Down => Self::Up,
            Self::Up => Self::Down,
        }
    }

    /// Returns the direction of a length; `None` for 0.
    pub fn of_length(length: f64) -> Option<Self> {
        match length {
            0.0 => None,
            length => Some(if length > 0.0 { Self::Down } else { Self::Up }),
        }
    }

    /// Returns whether a length puts the tip on the other side.
    pub fn contradicts(self, length: f64) -> bool {
        Self::of_length(length).is_some_and(|found| found != self)
    }

    /// Returns the side of the reference point on which the tip is.
    pub const fn side(self) -> &'static str {
        match self {
            Self::Down => "below",
            Self::Up => "above",
        }
    }

    /// Returns the rule for lengths as an error message gives it.
    pub fn rule(self, section: &str) -> String {
        format!(
            "with [{section}]{} = {} the tip is {} the platform's reference point and lengths are {}",
            of_machine::TOOL_DIRECTION.name,
            self.name(),
            self.side(),
            self.sign()
        )
    }

    /// Returns the sign of lengths.
    pub const fn sign(self) -> &'static str {
        match self {
            Self::Down => "positive",
            Self::Up => "negative",
        }
    }
}

/// Reads the direction in a section and checks the sign of the tool length there.
///
/// # Errors
/// Another word, or an offset in the other direction.
pub(super) fn read(
    ini: &Ini,
    section: &str,
    offset: Option<f64>,
) -> Result<Option<ToolDirection>, IniError> {
    let key = &of_machine::TOOL_DIRECTION;
    let given = ini.word(section, key)?.map(|place| match key.range {
        keys::Range::Word(words) if words[place - 1] == ToolDirection::Up.name() => {
            ToolDirection::Up
        }
        _ => ToolDirection::Down,
    });
    let found = offset.and_then(ToolDirection::of_length);
    let (Some(given), Some(found)) = (given, found) else { return Ok(given) };
    if given == found {
        return Ok(Some(given));
    }
    let (name, offset) = (of_machine::SPINDLE_OFFSET.name, offset.unwrap_or(0.0));
    let text = format!(
        "expected {}: {}; if the spindle points {}, set TOOL_DIRECTION = {}",
        -offset,
        given.rule(section),
        found.name(),
        found.name(),
    );
    Err(ini.refuse(ini.require(section, name, &text)?, &text))
}
