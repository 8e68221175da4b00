// SPDX-License-Identifier: GPL-2.0-or-later
//! Files: what is wrong with one is told with its name, and one that is written is written whole.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use tempfile::TempDir;

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

/// Folders that are in use.
static FOLDERS: Mutex<Vec<PathBuf>> = Mutex::new(vec![]);

/// A folder of one's own, gone with its owner, and also where the process is interrupted.
#[derive(Debug)]
pub struct Folder(TempDir);

impl Folder {
    /// Makes it where the system keeps such folders.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn new() -> Result<Self, AtFile<io::Error>> {
        // Nobody interrupts between the two lines who then would not find it.
        let mut folders = FOLDERS.lock().expect("nobody panics with it");
        let folder = TempDir::with_prefix("pkm-").at(&std::env::temp_dir())?;
        folders.push(folder.path().into());
        Ok(Self(folder))
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        FOLDERS.lock().expect("nobody panics with it").retain(|folder| folder != self.0.path());
    }
}

/// Removes every folder in use: for a process that is interrupted, which has to end at once after it.
pub fn leave_nothing() {
    for folder in FOLDERS.lock().expect("nobody panics with it").drain(..) {
        // Nothing is left to do where it cannot be removed.
        let _ = fs::remove_dir_all(folder);
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
