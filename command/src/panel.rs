// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm panel`.

use super::failure::{Failure, refused};
use super::{Verdict, output, print_text};
use machine::files::{Locate, write_whole};
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use new::panel::Panel;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Write an operator panel for AXIS and other GUIs
///
/// Writes NAME-panel.xml, a PyVCP panel, and NAME-panel.tcl, which connects it, beside the INI
/// file or into a folder, and prints the two lines to add to the INI file. The panel shows every
/// joint in its range, the cones, what the guard does, the travel left along every letter, the
/// active kinematics, the geometry, and why something was refused. Write it again after changing
/// limits or axes of the machine. `pkm help guide/panel` describes it.
///
/// Exit status: 0, or 2 if the file describes no machine or the output cannot be written.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    /// The machine's LinuxCNC INI file
    #[arg(value_name = "MACHINE.ini", value_hint = clap::ValueHint::FilePath, value_parser = super::input::ini_file())]
    machine: PathBuf,
    /// Write the two files into this folder (created if needed) instead of beside the INI file
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath)]
    output_dir: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let ini = Ini::read(&arguments.machine)?;
    let config = MachineConfig::leniently(&ini, Some(Lenient::Constraints))?;
    let name = config.file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    if let Some(odd) = name.chars().find(|c| !(c.is_alphanumeric() || "-_.+".contains(*c))) {
        return Err(refused(format!(
            "{}: the name contains {odd:?}, at which LinuxCNC splits names of HAL files: rename the \
             file, using letters, digits, - and _",
            config.file.display()
        )));
    }
    let beside = config.file.parent().unwrap_or(Path::new(""));
    let folder = arguments.output_dir.as_deref().unwrap_or(beside);
    let Panel { widgets, wiring } = Panel::new(&config, &name);
    if arguments.output_dir.is_some() {
        std::fs::create_dir_all(folder).at(folder)?;
    }
    let [xml, tcl] = ["xml", "tcl"].map(|ending| format!("{name}-panel.{ending}"));
    write_whole(&folder.join(&xml), &widgets)?;
    write_whole(&folder.join(&tcl), &wiring)?;
    let files = [folder.join(&xml), folder.join(&tcl)];
    output::answer(&json!({ "machine": config.file, "files": files }))?;
    print_text(&format!("[DISPLAY]\nPYVCP = {xml}\n\n[HAL]\nPOSTGUI_HALFILE = {tcl}\n"))?;
    Ok(Verdict::Fits)
}
