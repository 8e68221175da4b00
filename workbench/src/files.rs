// SPDX-License-Identifier: GPL-2.0-or-later
//! Files that are written.

use std::fs;
use std::io;
use std::path::Path;

/// Writes beside the file, then renames.
///
/// # Errors
/// A sentence naming the file.
pub fn write_whole(file: &Path, text: &str) -> Result<(), String> {
    let named = |error: io::Error| format!("{}: {error}", file.display());
    let folder = file.parent().unwrap_or(Path::new("."));
    let mut scratch = tempfile::Builder::new();
    // Temporary files are private by default; a report is to be read by others.
    #[cfg(unix)]
    scratch.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o644));
    let scratch = scratch.tempfile_in(folder).map_err(named)?;
    fs::write(scratch.path(), text).map_err(named)?;
    scratch.persist(file).map_err(|e| named(e.error)).map(drop)
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
