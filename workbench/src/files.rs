// SPDX-License-Identifier: GPL-2.0-or-later
//! Files: what is wrong with one is told with its name, and one that is written is written whole.

use std::fs::{self, Permissions};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use tempfile::{NamedTempFile, TempDir};

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

    /// Makes it beside a place that it takes when it is whole.
    ///
    /// # Errors
    /// It cannot be made there.
    pub fn beside(place: &Path) -> Result<Self, AtFile<io::Error>> {
        let parent = place.parent().filter(|folder| !folder.as_os_str().is_empty());
        let mut folders = FOLDERS.lock().expect("nobody panics with it");
        let folder = tempfile::Builder::new()
            .prefix(".pkm-")
            .permissions(Permissions::from_mode(0o755))
            .tempdir_in(parent.unwrap_or(Path::new(".")))
            .at(place)?;
        folders.push(folder.path().into());
        Ok(Self(folder))
    }

    /// Gives it its place, where nothing may be.
    ///
    /// # Errors
    /// Something is there, or it cannot be renamed.
    pub fn become_whole(self, place: &Path) -> Result<(), AtFile<io::Error>> {
        // Only an empty folder is replaced by a rename, and this one is nobody else's.
        fs::create_dir(place).at(place)?;
        fs::rename(self.path(), place).inspect_err(|_| drop(fs::remove_dir(place))).at(place)
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

/// A file that is written beside its place, and takes its name when it is whole.
#[derive(Debug)]
pub struct Whole {
    part: BufWriter<NamedTempFile>,
    file: PathBuf,
}

impl Whole {
    /// Begins it.
    ///
    /// # Errors
    /// Its folder cannot be written, or something that is no file stands in its place.
    pub fn new(file: &Path) -> Result<Self, AtFile<io::Error>> {
        Self::begun(file).at(file)
    }

    fn begun(file: &Path) -> io::Result<Self> {
        // A device, a pipe or a folder would be replaced.
        if fs::metadata(file).is_ok_and(|found| !found.is_file()) {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                "not a file that can be replaced",
            ));
        }
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
        // Temporary files are private by default; this one is to be read by others.
        let mut part = tempfile::Builder::new();
        part.prefix(".pkm-").permissions(Permissions::from_mode(0o644));
        let part = part.tempfile_in(folder.unwrap_or(Path::new(".")))?;
        Ok(Self { part: BufWriter::new(part), file: file.into() })
    }

    /// Gives it its name.
    ///
    /// # Errors
    /// The rest cannot be written, or the file not renamed.
    pub fn finish(self) -> Result<(), AtFile<io::Error>> {
        let part = self.part.into_inner().map_err(|error| error.into_error()).at(&self.file)?;
        part.persist(&self.file).map_err(|error| error.error).at(&self.file)?;
        Ok(())
    }
}

impl Write for Whole {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.part.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.part.flush()
    }
}

/// Writes beside the file, then renames.
///
/// # Errors
/// The file cannot be written.
pub fn write_whole(file: &Path, text: &str) -> Result<(), AtFile<io::Error>> {
    let mut whole = Whole::new(file)?;
    whole.write_all(text.as_bytes()).at(file)?;
    whole.finish()
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

    #[test]
    fn a_folder_takes_a_free_place_whole_and_no_other() {
        let parent = tempfile::tempdir().unwrap();
        let place = parent.path().join("machine");
        let made = Folder::beside(&place).unwrap();
        write_whole(&made.path().join("a"), "text").unwrap();
        assert!(!place.exists());
        made.become_whole(&place).unwrap();
        assert!(place.join("a").exists());
        // An empty folder is somebody's too.
        let taken = parent.path().join("taken");
        fs::create_dir(&taken).unwrap();
        assert!(Folder::beside(&taken).unwrap().become_whole(&taken).is_err());
        assert_eq!(fs::read_dir(parent.path()).unwrap().count(), 2);
    }

    #[test]
    fn what_is_no_file_is_not_replaced() {
        for place in ["/dev/full", "/tmp"] {
            assert!(write_whole(Path::new(place), "text").is_err());
        }
        assert!(!fs::metadata("/dev/full").unwrap().is_file());
    }
}
