// SPDX-License-Identifier: GPL-2.0-or-later
//! A finished picture: its name and its text.

use machine::files::{self, AtFile, Locate};
use plotters::drawing::DrawingAreaErrorKind;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

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
    /// Writes pictures to a folder, which is created if needed: all of them or none.
    ///
    /// # Errors
    /// Returns the first file that cannot be written.
    pub fn write_all(plots: &[Self], folder: &Path) -> Result<(), AtFile<io::Error>> {
        Self::write_with(plots, Some(folder), vec![])
    }

    /// Writes pictures to a folder, if one is given, and other files: all of them or none.
    ///
    /// # Errors
    /// Returns the first file that cannot be written.
    pub fn write_with(
        plots: &[Self],
        folder: Option<&Path>,
        mut files: Vec<(PathBuf, String)>,
    ) -> Result<(), AtFile<io::Error>> {
        // Before the folder, which would remain.
        files.iter().try_for_each(|(file, _)| files::check_writable(file))?;
        if let Some(folder) = folder {
            fs::create_dir_all(folder).at(folder)?;
            files.extend(plots.iter().map(|plot| (folder.join(&plot.file), plot.svg.clone())));
        }
        files::write_all(&files)
    }
}

/// An error of the drawing library.
#[derive(Debug, thiserror::Error)]
#[error("the plot cannot be drawn: {0}")]
pub struct DrawError(#[from] DrawingAreaErrorKind<io::Error>);
