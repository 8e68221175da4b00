// SPDX-License-Identifier: GPL-2.0-or-later
//! Files: errors name their file, a file is written completely or not at all, and a file that was read is replaced
//! only by [`write_over`].

use std::collections::BTreeSet;
use std::error::Error;
use std::fmt::Display;
use std::fs::{self, File, Permissions};
use std::io::{self, BufWriter, IsTerminal, Read, Write};
use std::mem;
use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt, chown};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard};
use tempfile::{NamedTempFile, TempDir};

/// An error with its file.
#[derive(Debug, thiserror::Error)]
#[error("{}: {error}", .file.display())]
pub struct AtFile<E> {
    pub file: PathBuf,
    pub error: E,
}

/// An error at a location without a type: a pose, a line of standard input.
#[derive(Debug, thiserror::Error)]
#[error("{place}: {error}")]
pub struct AtPlace {
    place: String,
    error: Box<dyn Error + Send + Sync>,
}

impl AtPlace {
    /// Prefixes an error with a location.
    pub fn new(place: impl Display, error: impl Error + Send + Sync + 'static) -> Self {
        Self { place: place.to_string(), error: Box::new(error) }
    }
}

/// Adds a file to an error.
pub trait Locate<T, E> {
    /// Returns the result with this file added to its error.
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

/// Canonical paths of the files that were read.
static READ: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Begins a new task, which may replace the files that were read before.
pub fn forget_read() {
    READ.lock().expect("never poisoned").clear();
}

/// Largest file that is read, bytes: a program of ten million lines has half as many.
const MOST_BYTES: u64 = 1 << 30;

/// Opens and records a file that is read, by this process or on its behalf.
///
/// # Errors
/// It cannot be opened, is larger than a file that is read, or is a device or a named pipe: those may have no end, and a pipe without a writer is not even
/// opened. A pipe that is open already has no name, as standard input.
pub fn open(file: &Path) -> Result<File, AtFile<io::Error>> {
    let place = fs::canonicalize(file).ok();
    let metadata = fs::metadata(file).at(file)?;
    let kind = metadata.file_type();
    refuse_long(metadata.len()).at(file)?;
    let is_endless = kind.is_block_device() || (kind.is_fifo() && place.is_some());
    if is_endless || (kind.is_char_device() && !is_quiet(file)) {
        let text = "a device or a named pipe, which may never end; copy its content to a file";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, text)).at(file);
    }
    let opened = File::open(file).at(file)?;
    // A pipe has no canonical path and cannot be replaced.
    if let Some(place) = place {
        READ.lock().expect("never poisoned").insert(place);
    }
    Ok(opened)
}

/// Returns whether a device is a terminal, whose user ends the text, or the null device.
fn is_quiet(device: &Path) -> bool {
    device == Path::new("/dev/null") || File::open(device).is_ok_and(|device| device.is_terminal())
}

/// Returns a text for a comment of a program or a HAL file: without line breaks and other control characters,
/// which would end the comment, without parentheses, and short enough for a line.
pub fn as_comment(text: &str) -> String {
    // LinuxCNC reads 255 bytes of a line; other words are on the same line.
    const MOST: usize = 160;
    let one = |c: char| match c {
        '(' => '[',
        ')' => ']',
        c if c.is_control() => ' ',
        c => c,
    };
    let end = (0..=MOST.min(text.len())).rev().find(|n| text.is_char_boundary(*n)).unwrap_or(0);
    text[..end].chars().map(one).collect()
}

/// Returns the bytes of a file.
///
/// # Errors
/// It cannot be read, or has no end.
pub fn read(file: &Path) -> Result<Vec<u8>, AtFile<io::Error>> {
    read_all(&mut open(file)?).at(file)
}

/// Returns the bytes of an open file or pipe.
///
/// # Errors
/// It cannot be read, or has no end.
pub fn read_all(from: &mut dyn Read) -> io::Result<Vec<u8>> {
    let mut bytes = vec![];
    from.take(MOST_BYTES + 1).read_to_end(&mut bytes)?;
    refuse_long(bytes.len() as u64)?;
    Ok(bytes)
}

/// Refuses more bytes than [`MOST_BYTES`].
fn refuse_long(bytes: u64) -> io::Result<()> {
    if bytes > MOST_BYTES {
        let text = "larger than 1 GiB, the limit for files read into memory; split the file";
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, text));
    }
    Ok(())
}

/// Returns the text of a file.
///
/// # Errors
/// As [`read`], or it is not UTF-8.
pub fn read_text(file: &Path) -> Result<String, AtFile<io::Error>> {
    String::from_utf8(read(file)?)
        .map_err(|error| {
            let line = 1 + error.as_bytes()[..error.utf8_error().valid_up_to()]
                .iter()
                .filter(|byte| **byte == b'\n')
                .count();
            let text = format!("line {line} is not UTF-8: save the file as UTF-8");
            io::Error::new(io::ErrorKind::InvalidData, text)
        })
        .at(file)
}

/// Temporary files and folders in use.
static TEMPORARY: Mutex<Vec<PathBuf>> = Mutex::new(vec![]);

/// Attempts to remove a folder into which a process still writes.
const REMOVALS: usize = 100;

fn temporary() -> MutexGuard<'static, Vec<PathBuf>> {
    TEMPORARY.lock().expect("never poisoned")
}

/// An entry in the list of temporary files and folders.
#[derive(Debug)]
struct Listed(PathBuf);

impl Listed {
    /// Creates a temporary file or folder and lists it. An interruption waits until both are done: otherwise it would
    /// miss the new file.
    fn made<T: AsRef<Path>>(make: impl FnOnce() -> io::Result<T>) -> io::Result<(T, Self)> {
        let mut list = temporary();
        let made = make()?;
        list.push(made.as_ref().into());
        let listed = Self(made.as_ref().into());
        Ok((made, listed))
    }
}

impl Drop for Listed {
    fn drop(&mut self) {
        temporary().retain(|path| *path != self.0);
    }
}

/// A private temporary folder, removed with its owner and also if the process is interrupted.
#[derive(Debug)]
pub struct Folder {
    folder: TempDir,
    _listed: Listed,
}

impl Folder {
    /// Creates a folder in the system's temporary folder.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn new() -> Result<Self, AtFile<io::Error>> {
        let make = || TempDir::with_prefix("pkm-");
        let (folder, _listed) = Listed::made(make).at(&std::env::temp_dir())?;
        Ok(Self { folder, _listed })
    }

    /// Creates a folder next to the path that it gets when it is complete.
    ///
    /// # Errors
    /// It cannot be made there.
    pub fn beside(place: &Path) -> Result<Self, AtFile<io::Error>> {
        let parent = place.parent().filter(|folder| !folder.as_os_str().is_empty());
        let mut folder = tempfile::Builder::new();
        folder.prefix(".pkm-").permissions(Permissions::from_mode(0o755));
        let make = || folder.tempdir_in(parent.unwrap_or(Path::new(".")));
        let (folder, _listed) = Listed::made(make).at(place)?;
        Ok(Self { folder, _listed })
    }

    /// Renames the folder to its final path, which must not exist.
    ///
    /// # Errors
    /// The path exists, or the folder cannot be renamed.
    pub fn become_whole(self, place: &Path) -> Result<(), AtFile<io::Error>> {
        // Blocks an interruption, which would leave an empty folder.
        let _list = temporary();
        // A rename replaces only an empty folder, and this one was just created here.
        fs::create_dir(place).at(place)?;
        fs::rename(self.path(), place).inspect_err(|_| drop(fs::remove_dir(place))).at(place)
    }

    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// Removes every temporary file and folder, for a process that ends at once: it can create no more.
pub fn leave_nothing() {
    let mut list = temporary();
    for path in list.drain(..) {
        let is_gone = || {
            let removed = fs::remove_file(&path).or_else(|_| fs::remove_dir_all(&path));
            removed.is_ok() || !path.exists()
        };
        // LinuxCNC may still write into the folder of its run, but it can create no folder there.
        let _ = (0..REMOVALS).any(|_| is_gone());
    }
    // Other threads run until the process has ended: those that create or finish a file wait.
    mem::forget(list);
}

/// Returns a table as the text of a CSV file.
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

/// A file that is written under a temporary name, and renamed when it is complete.
#[derive(Debug)]
pub struct Whole {
    part: BufWriter<NamedTempFile>,
    listed: Listed,
    /// Path as given, and its canonical path.
    file: PathBuf,
    place: PathBuf,
}

/// Checks that a file can be written, before a command writes its other files.
///
/// # Errors
/// As [`Whole::new`].
pub fn check_writable(file: &Path) -> Result<(), AtFile<io::Error>> {
    Whole::new(file).map(drop)
}

impl Whole {
    /// Creates the temporary file.
    ///
    /// # Errors
    /// Its folder cannot be written, its path is not a regular file, or the file was read.
    pub fn new(file: &Path) -> Result<Self, AtFile<io::Error>> {
        let is_read = |place: &PathBuf| READ.lock().expect("never poisoned").contains(place);
        if fs::canonicalize(file).is_ok_and(|place| is_read(&place)) {
            let text =
                "this file was read as input and would be lost; choose another file for the output";
            return Err(io::Error::new(io::ErrorKind::InvalidInput, text)).at(file);
        }
        Self::begun(file).map_err(without_path).at(file)
    }

    fn begun(file: &Path) -> io::Result<Self> {
        // Behind a link, the target is replaced.
        let place = fs::canonicalize(file).unwrap_or_else(|_| file.into());
        let there = fs::metadata(&place).ok();
        // A device, a pipe or a folder would be replaced.
        if there.as_ref().is_some_and(|found| !found.is_file()) {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                "not a regular file, so it cannot be replaced; choose another name",
            ));
        }
        let folder = place.parent().filter(|folder| !folder.as_os_str().is_empty());
        // Temporary files are private by default; this one must be readable by others.
        let mode = there.as_ref().map_or(0o644, |found| found.mode() & 0o7777);
        let mut part = tempfile::Builder::new();
        part.prefix(".pkm-").permissions(Permissions::from_mode(mode));
        let make = || part.tempfile_in(folder.unwrap_or(Path::new(".")));
        let (part, listed) = Listed::made(make)?;
        if let Some(found) = there {
            part.as_file().set_permissions(Permissions::from_mode(mode))?;
            // Only root can change the owner; otherwise another user's file becomes this user's, as with any editor.
            let _ = chown(part.path(), Some(found.uid()), Some(found.gid()));
        }
        Ok(Self { part: BufWriter::new(part), listed, file: file.into(), place })
    }

    /// Renames the file to its final name.
    ///
    /// # Errors
    /// The rest cannot be written, or the file cannot be renamed.
    pub fn finish(self) -> Result<(), AtFile<io::Error>> {
        // Until the file has its name, an interruption removes it.
        let _listed = self.listed;
        let part = self.part.into_inner().map_err(|error| without_path(error.into_error()));
        let part = part.at(&self.file)?;
        part.persist(&self.place).map_err(|error| error.error).at(&self.file)?;
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

/// Returns the error without the name of the temporary file, which means nothing to the user.
fn without_path(error: io::Error) -> io::Error {
    match error.to_string().split_once(" at path ") {
        Some((text, _)) => io::Error::new(error.kind(), text),
        None => error,
    }
}

/// Writes a temporary file next to `file`, then renames it.
///
/// # Errors
/// The file cannot be written, or the command has read it.
pub fn write_whole(file: &Path, text: &str) -> Result<(), AtFile<io::Error>> {
    filled(Whole::new(file)?, file, text)
}

/// Writes all of these files, or none of them if one cannot be written.
///
/// # Errors
/// A file cannot be written, the command has read it, or two texts have the same file.
pub fn write_all(files: &[(PathBuf, String)]) -> Result<(), AtFile<io::Error>> {
    let mut begun: Vec<Whole> = vec![];
    for (file, text) in files {
        let mut whole = Whole::new(file)?;
        if begun.iter().any(|other| other.place == whole.place) {
            let text = "two outputs have this name; choose another name for one of them";
            return Err(io::Error::new(io::ErrorKind::InvalidInput, text)).at(file);
        }
        whole
            .write_all(text.as_bytes())
            .and_then(|()| whole.flush())
            .map_err(without_path)
            .at(file)?;
        begun.push(whole);
    }
    begun.into_iter().try_for_each(Whole::finish)
}

/// Writes a file that was read, to replace its text.
///
/// # Errors
/// The file cannot be written.
pub fn write_over(file: &Path, text: &str) -> Result<(), AtFile<io::Error>> {
    filled(Whole::begun(file).map_err(without_path).at(file)?, file, text)
}

fn filled(mut whole: Whole, file: &Path, text: &str) -> Result<(), AtFile<io::Error>> {
    whole.write_all(text.as_bytes()).map_err(without_path).at(file)?;
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
    fn files_are_written_together_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| (folder.path().join(name), name.to_string());
        for (second, expected) in
            [("no/b.csv", "no/b.csv: No such file"), ("./a.csv", "two outputs")]
        {
            let error = write_all(&[file("a.csv"), file(second)]).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "{second}");
        }
        write_all(&[file("a.csv"), file("b.csv")]).unwrap();
        for name in ["a.csv", "b.csv"] {
            assert_eq!(fs::read_to_string(folder.path().join(name)).unwrap(), name);
        }
    }

    #[test]
    fn what_was_read_is_replaced_only_where_that_is_meant() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("m.ini"), folder.path().join("link.ini"));
        fs::write(&file, "first").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        fs::set_permissions(&file, Permissions::from_mode(0o660)).unwrap();
        assert_eq!(read_text(&link).unwrap(), "first");
        for place in [&file, &link] {
            let refused = write_whole(place, "second").unwrap_err().to_string();
            assert!(refused.contains("was read"), "{refused}");
            assert_eq!(fs::read_to_string(&file).unwrap(), "first");
        }
        write_over(&link, "second").unwrap();
        assert_eq!(fs::read_to_string(&file).unwrap(), "second");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::metadata(&file).unwrap().mode() & 0o777, 0o660);
    }

    #[test]
    fn invalid_text_is_reported_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("table.csv");
        fs::write(&file, b"a,b\n\xf6,1\n").unwrap();
        let refused = read_text(&file).unwrap_err().to_string();
        assert!(refused.contains("line 2 is not UTF-8"), "{refused}");
    }

    #[test]
    fn devices_and_named_pipes_are_refused_before_they_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        // Without a writer, opening it would block.
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        for file in [Path::new("/dev/zero"), Path::new("/dev/urandom"), &pipe] {
            let refused = read(file).unwrap_err().to_string();
            assert!(refused.contains("may never end"), "{refused}");
        }
        assert_eq!(read(Path::new("/dev/null")).unwrap(), b"");
    }

    #[test]
    fn endless_input_ends() {
        assert!(read_all(&mut io::repeat(0)).is_err());
        assert_eq!(read_all(&mut io::repeat(7).take(3)).unwrap(), [7; 3]);
    }

    #[test]
    fn a_comment_is_one_line_and_closes_nothing() {
        assert_eq!(as_comment("x)\nM68 E0 Q1 ("), "x] M68 E0 Q1 [");
        assert_eq!(as_comment("a\r\u{85}b").lines().count(), 1);
        let long = as_comment(&"ä".repeat(200));
        assert!(long.len() <= 160 && long.chars().all(|c| c == 'ä'), "{long}");
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
        // An empty folder may belong to someone else.
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
