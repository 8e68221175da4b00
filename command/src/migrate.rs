// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm migrate`.

use super::failure::{Failure, report_error};
use super::{Bar, Verdict, input, output, print_text};
use machine::read::diagnostic::rendered;
use new::make::limit_lines;
use new::migrate::{Migrated, Migration, migrate};
use new::values::Refusal;
use serde_json::json;
use std::path::PathBuf;

/// Convert a configuration for an older LinuxCNC or another module
///
/// Reads an INI file for genhexkins, lineardeltakins, rotarydeltakins, tripodkins or pentakins, also from before
/// LinuxCNC had joints and axes (2.7, Machinekit), and the geometry that its HAL files set. Writes a folder like that
/// of pkm new, with the old limits, speeds, homing, scales and tools. Lists the values that the file does not determine
/// and the omitted parts; the old folder does not change. `pkm help guide/migrating` describes it.
///
/// Exit status: 0 if the folder is complete and pkm check finds no error in it, 1 if pkm check finds errors, or if no
/// such machine can work and no folder is created, 2 if the file is wrong or does not determine the machine, or if the
/// folder exists; then nothing is written.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    /// The INI file of the older configuration
    #[arg(value_name = "OLD.ini", value_hint = clap::ValueHint::FilePath, value_parser = input::ini_file())]
    file: PathBuf,
    /// Folder to create [default: NAME-pkmkins beside the folder of OLD.ini]
    #[arg(long, value_name = "FOLDER", value_hint = clap::ValueHint::DirPath)]
    out: Option<PathBuf>,
    /// Position at home of a tool without length, instead of the one in the file
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true)]
    home: Option<Vec<f64>>,
    /// HAL file with a setp line for each pin of the geometry, instead of the HAL files of OLD.ini
    #[arg(long, value_name = "FILE.hal", value_hint = clap::ValueHint::FilePath)]
    geometry: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let migration = Migration {
        file: &arguments.file,
        folder: arguments.out.as_deref(),
        home: arguments.home.as_deref().and_then(|home| home.try_into().ok()),
        geometry: arguments.geometry.as_deref(),
    };
    let bar = Bar::spinner("migrating the machine");
    let migrated = migrate(&migration, |what, share| match share {
        Some(share) => bar.set(share),
        None => bar.next(what.into()),
    });
    drop(bar);
    let migrated = match migrated {
        Ok(migrated) => migrated,
        Err(Refusal::Misfit(text)) => {
            report_error(&text);
            return Ok(Verdict::Misfit);
        }
        Err(refusal) => return Err(refusal.into()),
    };
    Failure::unless_unread(print_text(&text(&migrated)))?;
    let Migrated { made, folder, name, module, notes } = &migrated;
    output::answer(&json!({
        "folder": folder,
        "machine": folder.join(format!("{name}.ini")),
        "module": module,
        "carried": notes.carried,
        "undetermined": notes.undetermined,
        "left_out": notes.left_out,
        "boxes": made.boxes,
        "findings": made.report.findings,
    }))?;
    Ok(if made.report.fits() { Verdict::Fits } else { Verdict::Misfit })
}

fn text(migrated: &Migrated) -> String {
    let Migrated { made, folder, name, module, notes } = migrated;
    let folder = folder.display();
    let mut text = format!("{folder} is made, of a configuration for {module}.\n");
    for (heading, items) in [
        ("Carried over", &notes.carried),
        ("Not determined by the old files", &notes.undetermined),
        ("Left out", &notes.left_out),
    ] {
        if !items.is_empty() {
            text += &format!("\n{heading}:\n");
            text.extend(items.iter().map(|item| format!("  {item}\n")));
        }
    }
    text += &format!(
        "\nWithout a tool it can take every pose within, proved:\n\n{}\n{}\n\n",
        limit_lines(&made.report.config),
        made.boxes
    );
    let findings = made.report.findings.iter();
    text.extend(findings.map(|f| format!("{}\n\n", rendered(f.severity, &f.problem))));
    text + &format!(
        "Next:\n\n  pkm check {folder}/{name}.ini\n  pkm view {folder}/{name}.ini\n  pkm preflight {folder}/{name}.ini {folder}/programs/first.ngc\n  linuxcnc {folder}/{name}.ini\n"
    )
}
