// SPDX-License-Identifier: GPL-2.0-or-later
//! Lines over a sequence of poses.

use crate::lines::Line;
use crate::plot::{DrawError, Plot};
use crate::sheet::TIME;
use crate::strips::{Strip, Strips, drawn_apart, drawn_strips};

/// Name and abscissae of a sequence of poses: the time, or the number of the pose.
pub struct Course {
    /// Name of the abscissa.
    pub name: &'static str,
    /// Abscissa of each pose.
    pub at: Vec<f64>,
}

impl Course {
    /// Creates a sequence over time, in seconds.
    pub fn in_time(at: Vec<f64>) -> Self {
        Self { name: TIME, at }
    }

    /// Creates a sequence by number, from 0.
    pub fn by_number(count: usize) -> Self {
        Self { name: "number of the pose", at: (0..count).map(|k| k as f64).collect() }
    }
}

pub(super) fn lines_over(
    course: &Course,
    file: &str,
    caption: &str,
    y: &str,
    lines: Vec<Line>,
) -> Result<Plot, DrawError> {
    let svg = drawn_apart(caption, course.name, y, lines)?;
    Ok(Plot { file: file.into(), caption: caption.into(), svg })
}

pub(super) fn strips_over(
    course: &Course,
    file: &str,
    caption: &str,
    y: &str,
    strips: &[Strip],
) -> Result<Plot, DrawError> {
    let svg = drawn_strips(&Strips::new(caption, course.name, y, strips), strips)?;
    Ok(Plot { file: file.into(), caption: caption.into(), svg })
}
