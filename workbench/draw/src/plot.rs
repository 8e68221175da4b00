// SPDX-License-Identifier: GPL-2.0-or-later
//! A finished picture: its name and its text.

use machine::files::{AtFile, Locate, write_whole};
use plotters::drawing::DrawingAreaErrorKind;
use std::fs;
use std::io;
use std::path::Path;

/// A plot: its file name and its SVG text.
#[derive(Clone, Debug)]
pub struct Plot {
    /// File name, ending in .svg.
    pub file: String,
    /// Caption, one line.
    pub caption: String,
    pub svg: String,
}

impl Plot {
    /// Writes pictures to a folder, which is created if needed; each appears complete or not at all.
    ///
    /// # Errors
    /// Returns the first file that cannot be written.
    pub fn write_all(plots: &[Self], folder: &Path) -> Result<(), AtFile<io::Error>> {
        fs::create_dir_all(folder).at(folder)?;
        plots.iter().try_for_each(|plot| write_whole(&folder.join(&plot.file), &plot.svg))
    }
}

/// An error of the drawing library.
#[derive(Debug, thiserror::Error)]
#[error("the plot cannot be drawn: {0}")]
pub struct DrawError(#[from] DrawingAreaErrorKind<io::Error>);
