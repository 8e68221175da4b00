// SPDX-License-Identifier: GPL-2.0-or-later
//! The folder of a model.

use crate::model::{Mesh, Model};
use crate::{mjcf, readme, sdf, stl, urdf};
use machine::files::{self, AtFile, Locate, write_whole};
use machine::read::machine::MachineConfig;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Name of the MJCF file that shows a model; no model has it.
pub(crate) const SCENE: &str = "scene";

/// A format for models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    Mjcf,
    Sdf,
    Urdf,
}

impl Format {
    /// Returns the ending of its files.
    const fn ending(self) -> &'static str {
        match self {
            Self::Mjcf => "xml",
            Self::Sdf => "sdf",
            Self::Urdf => "urdf",
        }
    }
}

/// Why a model was not written.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    #[error("{}: contains {found}, which is not a file of this model; give another folder", .folder.display())]
    Other { folder: PathBuf, found: String },
    #[error("{part} shape: {error}; correct the key, or remove it")]
    Mesh { part: &'static str, error: AtFile<io::Error> },
    #[error(transparent)]
    File(#[from] AtFile<io::Error>),
}

/// What was written.
#[derive(Clone, Debug, Default)]
pub struct Written {
    pub files: Vec<PathBuf>,
    /// Shapes that the format cannot have, one sentence each.
    pub left_out: Vec<String>,
}

/// Writes a model into a folder, which is created if needed.
///
/// # Errors
/// The folder holds another model, a shape cannot be read, or a file cannot be written.
pub fn write(
    model: &Model,
    config: &MachineConfig,
    format: Format,
    folder: &Path,
) -> Result<Written, FolderError> {
    refuse_other(model, folder)?;
    let before = model.left_out.len();
    let mut model = model.clone();
    let mut shapes: Vec<(Mesh, String, Vec<u8>)> = vec![];
    for mesh in std::mem::take(&mut model.meshes) {
        let mut bytes = files::read(&mesh.file)
            .map_err(|error| FolderError::Mesh { part: mesh.part, error })?;
        let ending = mesh.file.extension().unwrap_or_default().to_ascii_lowercase();
        let ending = ending.to_string_lossy();
        if format == Format::Mjcf && ending == "stl" && !stl::is_binary(&bytes) {
            let Some(binary) = stl::binary(&bytes) else {
                let file = mesh.file.display();
                model.left_out.push(format!(
                    "{file}: neither a binary STL file nor triangles in text form; save it again as STL"
                ));
                continue;
            };
            bytes = binary;
        }
        shapes.push((mesh.clone(), format!("{}.{ending}", mesh.part), bytes));
    }
    let meshes: Vec<(&Mesh, String)> =
        shapes.iter().map(|(mesh, file, _)| (mesh, file.clone())).collect();
    let comment = format!(" written by pkmkins {}: see README.md ", env!("CARGO_PKG_VERSION"));
    let main = match format {
        Format::Mjcf => mjcf::file(&model, &meshes, &comment),
        Format::Sdf => sdf::file(&model, &meshes, &comment),
        Format::Urdf => urdf::file(&model, &meshes, &comment),
    };
    fs::create_dir_all(folder).at(folder)?;
    let mut written = Written::default();
    let mut put = |name: String, text: &str| -> Result<(), FolderError> {
        let file = folder.join(name);
        write_whole(&file, text)?;
        written.files.push(file);
        Ok(())
    };
    put(format!("{}.{}", model.name, format.ending()), &main)?;
    if format == Format::Mjcf {
        put(format!("{SCENE}.xml"), &mjcf::scene(&model, &comment))?;
    } else {
        put(format!("{}.loops.json", model.name), &urdf::beside(&model))?;
    }
    put("README.md".into(), &readme::text(&model, config))?;
    if !shapes.is_empty() {
        let meshes = folder.join("meshes");
        fs::create_dir_all(&meshes).at(&meshes)?;
        for (_, name, bytes) in &shapes {
            let file = meshes.join(name);
            fs::write(&file, bytes).at(&file)?;
            written.files.push(file);
        }
    }
    written.left_out = model.left_out.split_off(before);
    Ok(written)
}

/// Refuses a folder with files of another model.
fn refuse_other(model: &Model, folder: &Path) -> Result<(), FolderError> {
    let other = |found: String| Err(FolderError::Other { folder: folder.into(), found });
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        entries => entries.at(folder)?,
    };
    for entry in entries {
        let path = entry.at(folder)?.path();
        let ending = path.extension().unwrap_or_default().to_string_lossy().into_owned();
        let is_model =
            [Format::Mjcf, Format::Sdf, Format::Urdf].iter().any(|one| one.ending() == ending);
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if is_model && ![model.name.as_str(), SCENE].contains(&stem.as_str()) {
            return other(path.file_name().unwrap_or_default().to_string_lossy().into_owned());
        }
        if path.file_name().is_some_and(|name| name == "README.md") {
            let text = fs::read_to_string(&path).unwrap_or_default();
            if !text.starts_with(&readme::title(model)) {
                return other("README.md".into());
            }
        }
    }
    Ok(())
}
