// SPDX-License-Identifier: GPL-2.0-or-later
//! Files: what is wrong with one is told with its name, and one that is written is written whole.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// What is wrong with a file.
#[derive(Debug, thiserror::Error)]
#[error("{}: {error}", .file.display())]
pub struct AtFile<E> {
    /// The file.
    pub file: PathBuf,
    /// What.
    pub error: E,
}

/// Gives an error its file.
pub trait Locate<T, E> {
    /// The same, at this file.
    ///
    /// # Errors
    /// The one given, with the file.
    fn at(self, file: &Path) -> Result<T, AtFile<E>>;
}

impl<T, E> Locate<T, E> for Result<T, E> {
    fn at(self, file: &Path) -> Result<T, AtFile<E>> {
        self.map_err(|error| AtFile { file: file.into(), error })
    }
}

/// A table as the text of a CSV file.
///
/// # Panics
/// A row has more or fewer cells than the header.
pub fn csv<R: IntoIterator<Item: ToString>>(
    header: &[impl AsRef<str>],
    rows: impl IntoIterator<Item = R>,
) -> String {
    let mut out = csv::Writer::from_writer(vec![]);
    let mut write = |cells: Vec<String>| out.write_record(cells).expect("rows of one length");
    write(header.iter().map(|name| name.as_ref().to_string()).collect());
    for row in rows {
        write(row.into_iter().map(|cell| cell.to_string()).collect());
    }
    let bytes = out.into_inner().expect("memory takes everything");
    String::from_utf8(bytes).expect("cells are text")
}

/// Writes beside the file, then renames.
///
/// # Errors
/// The file cannot be written.
pub fn write_whole(file: &Path, text: &str) -> Result<(), AtFile<io::Error>> {
    replaced(file, text).at(file)
}

fn replaced(file: &Path, text: &str) -> io::Result<()> {
    let folder = file.parent().unwrap_or(Path::new("."));
    let mut scratch = tempfile::Builder::new();
    // Temporary files are private by default; a report is to be read by others.
    #[cfg(unix)]
    scratch.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o644));
    let scratch = scratch.tempfile_in(folder)?;
    fs::write(scratch.path(), text)?;
    scratch.persist(file)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_whole_and_nothing_else_is_left() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("x.svg");
        for text in ["first", "second"] {
            write_whole(&file, text).unwrap();
            assert_eq!(fs::read_to_string(&file).unwrap(), text);
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
