// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm boxes`.

use super::failure::{Failure, report_error};
use super::{Bar, MachineFile, Verdict, output, print_text};
use check::fixes::rewritten;
use machine::files::write_over;
use machine::proof::boxes as proof;
use machine::proof::one_to_one::Doubt;
use machine::read::boxes::{self, BoxSection};
use machine::read::error::MachineError;
use machine::read::mechanism::Mechanism;
use serde::Serialize;
use serde_json::json;

/// Find and prove pose boxes for the start without a seed
///
/// If [KINS]KINEMATICS has boxes=, every [BOX_K] section is proved again: no two poses of a box
/// have the same joint values. Otherwise, and if the sections are refused because they belong to
/// another geometry, pkm searches for boxes that fill the axis limits and proves them. The
/// sections, and the number for boxes=, go to standard output. This takes seconds to minutes.
///
/// Exit status: 0 if all boxes are proved, 1 if one is not, if none is found, or if the file's
/// boxes differ from those found and --write is missing, 2 if the file describes no machine.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Write the sections found, and their number, into the file in place of the old ones; comments
    /// stay
    #[arg(long)]
    write: bool,
}

/// The report about the boxes of a mechanism.
struct Answer {
    /// Text for standard output.
    text: String,
    /// The section of every box, and the number of cells of its proof.
    proved: Vec<Proved>,
    /// The sections that the file should have.
    sections: Vec<BoxSection>,
    /// Whether the file has them.
    is_there: bool,
}

/// A proved box.
#[derive(Serialize)]
struct Proved {
    section: String,
    cells: usize,
    contraction: f64,
    is_in_file: bool,
}

/// Why a proof failed.
#[derive(Debug, thiserror::Error)]
enum Unproved {
    /// The proof of some box failed.
    #[error(transparent)]
    Search(#[from] Doubt),
    /// The proof of a section of the file failed.
    #[error("[{0}] {1}")]
    Section(String, Doubt),
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.named(arguments.machine.read_without_boxes()?)?;
    let mut verdict = Verdict::Fits;
    let mut text = match arguments.write {
        true => config.ini.editable()?,
        false => config.ini.text(),
    }
    .to_string();
    let (mut boxes, mut sections) = (vec![], String::new());
    for mechanism in &config.mechanisms {
        for refused in mechanism.refused_boxes.iter().flat_map(MachineError::in_file) {
            report_error(refused);
        }
        let answer = match of_mechanism(mechanism) {
            Ok(answer) => answer,
            Err(error) => {
                report_error(&format!("{}: {error}", config.file.display()));
                verdict = Verdict::Misfit;
                continue;
            }
        };
        Failure::unless_unread(print_text(&answer.text))?;
        boxes.extend(answer.proved);
        if answer.is_there {
            continue;
        }
        sections += &answer.text;
        match arguments.write {
            true => {
                text = rewritten(&text, mechanism, &answer.sections)
                    .map_err(|error| Failure::at(config.file.display(), error))?;
            }
            // A file without boxes is correct.
            false if mechanism.refused_boxes.is_none() => {}
            false => {
                let file = config.file.display();
                report_error(&format!("{file}: run pkm boxes --write to insert these sections"));
                verdict = Verdict::Misfit;
            }
        }
    }
    let is_written = text != config.ini.text();
    if is_written {
        write_over(&config.file, &text)?;
    }
    let machine = &config.file;
    output::answer(
        &json!({ "machine": machine, "boxes": boxes, "sections": sections, "is_written": is_written }),
    )?;
    Ok(verdict)
}

fn of_mechanism(config: &Mechanism) -> Result<Answer, Unproved> {
    let bar = Bar::new("proving boxes");
    match config.boxes.len() {
        0 => found(config, &bar),
        _ => proved(config, &bar),
    }
}

fn found(config: &Mechanism, bar: &Bar) -> Result<Answer, Unproved> {
    let found = proof::found(config, &|share| bar.set(share))?;
    let letters = config.machine.layout().coordinates().as_slice();
    let parameter = config.place.boxes_parameter();
    let mut text = format!("# {parameter}={} in [KINS]KINEMATICS\n", found.len());
    for (k, (section, cells)) in found.iter().enumerate() {
        text += &format!("\n# proved with {cells} cells\n");
        text += &boxes::text(&config.place.box_section(k), section, letters, config.legs());
    }
    let of = |(k, (section, cells)): (usize, &(BoxSection, usize))| Proved {
        section: config.place.box_section(k),
        cells: *cells,
        contraction: section.claim.contraction,
        is_in_file: false,
    };
    let proved = found.iter().enumerate().map(of).collect();
    let sections = found.into_iter().map(|(section, _)| section).collect();
    Ok(Answer { text, proved, sections, is_there: false })
}

fn proved(config: &Mechanism, bar: &Bar) -> Result<Answer, Unproved> {
    let (mut text, mut proved) = (String::new(), vec![]);
    for (k, section) in config.boxes.iter().enumerate() {
        let name = config.place.box_section(k);
        let count = config.boxes.len() as f64;
        let reported = |share: f64| bar.set((k as f64 + share) / count);
        let cells = proof::prove(config, section, &reported)
            .map_err(|doubt| Unproved::Section(name.clone(), doubt))?;
        let c = section.claim.contraction;
        text += &format!("[{name}] proved with {cells} cells: contraction {c}\n");
        proved.push(Proved { section: name, cells, contraction: c, is_in_file: true });
    }
    Ok(Answer { text, proved, sections: vec![], is_there: true })
}
