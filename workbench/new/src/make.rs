// SPDX-License-Identifier: GPL-2.0-or-later
//! Creates the folder of a machine, completely or not at all.

use crate::carried::Carried;
use crate::ini::Plan;
use crate::kinds::MachineKind;
use crate::panel::Panel;
use crate::parameters::ANCHORS;
use crate::values::{Refusal, Values};
use crate::{home, limits, program, table};
use check::findings::{Finding, Report};
use check::report::check;
use kinematics::{Letter, Vector3};
use machine::digits::plain;
use machine::files::{AtFile, Folder, write_over, write_whole};
use machine::proof::axis_box::AxisBox;
use machine::proof::boxes;
use machine::read::boxes::text as box_text;
use machine::read::diagnostic::{Severity, rendered};
use machine::read::error::MachineError;
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use machine::read::mechanism::Mechanism;
use std::fmt::Display;
use std::io;
use std::path::Path;

/// A machine to create.
#[derive(Debug)]
pub struct Order<'a> {
    pub kind: &'static MachineKind,
    /// The given values.
    pub values: &'a Values,
    /// Name of the machine and of its files.
    pub name: &'a str,
    /// Its folder, which must not exist.
    pub folder: &'a Path,
}

#[derive(Debug)]
pub struct Made {
    /// Result of `pkm check`.
    pub report: Report,
    /// A note about boxes for the start without a seed.
    pub boxes: String,
    /// The axis limits.
    pub limits: AxisBox,
    /// Largest speed and acceleration along X Y Z and of angles, a second.
    pub motion: [[f64; 2]; 2],
}

impl From<AtFile<io::Error>> for Refusal {
    fn from(error: AtFile<io::Error>) -> Self {
        Self::Input(error.to_string())
    }
}

/// Names of long tasks.
const PROVING_LIMITS: &str = "proving axis limits";
const PROVING_BOXES: &str = "proving boxes for the start without a seed";
const CHECKING: &str = "checking the result";

/// Creates the machine; `say` receives the current task and, for a long one, the completed share.
///
/// # Errors
/// The given values are wrong, no such machine works, or the folder cannot be written. Then no files
/// remain.
pub fn make(order: &Order, say: impl Fn(&str, Option<f64>) + Sync) -> Result<Made, Refusal> {
    refuse_name(order.name)?;
    refuse_place(order.folder)?;
    let mut plan = begun(order)?;
    say("searching for home", None);
    let (place, config) = home::found(&plan)?;
    plan.home = place;
    if plan.values.number("lead") != 0.0 {
        plan.cardans = cardans(config.first());
    }
    completed(order, plan, say)
}

/// Makes the folder of a machine whose home is known.
///
/// # Errors
/// As [`make`](fn@make).
pub(crate) fn completed(
    order: &Order,
    plan: Plan,
    say: impl Fn(&str, Option<f64>) + Sync,
) -> Result<Made, Refusal> {
    let folder = Folder::beside(order.folder)?;
    // The user does not know the temporary folder.
    let report = filled(order, folder.path(), plan, say).map_err(|refusal| {
        let [hidden, named] = [folder.path(), order.folder].map(|path| path.display().to_string());
        refusal.renamed(&hidden, &named)
    })?;
    folder.become_whole(order.folder)?;
    Ok(report)
}

/// Writes all files into a folder.
fn filled(
    order: &Order,
    folder: &Path,
    mut plan: Plan,
    say: impl Fn(&str, Option<f64>) + Sync,
) -> Result<Made, Refusal> {
    let read = |plan: &Plan| written(folder, plan);
    write_whole(&folder.join(format!("{}.tbl", order.name)), program::tools(&plan))?;
    let config = read(&plan)?;
    plan.joints = joints(config.first())?;
    say(PROVING_LIMITS, None);
    let found = limits::proved(config.first(), &plan, |share| say(PROVING_LIMITS, Some(share)))?;
    match plan.carried.is_some() {
        true => {
            let motion = limits::slowed(config.first(), &plan, &found);
            plan.carried = plan.carried.map(|carried| Carried { motion, ..carried });
        }
        false => plan.speeds = limits::speeds(config.first(), &plan, &found),
    }
    plan.limits = Some(found);
    let config = read(&plan)?;
    let boxes = with_boxes(&mut plan, config.first(), &say);
    let config = read(&plan)?;
    let at = |name: &str| folder.join(name);
    let panel = Panel::new(&config, order.name);
    std::fs::create_dir(at("programs"))
        .map_err(|error| Refusal::Input(format!("{}: {error}", order.folder.display())))?;
    for (name, text) in [
        (format!("{}-panel.xml", order.name), panel.widgets),
        (format!("{}-panel.tcl", order.name), panel.wiring),
        ("programs/first.ngc".into(), program::first(&plan, &found)),
        ("README.md".into(), program::readme(&plan)),
    ] {
        write_whole(&at(&name), &text)?;
    }
    // After all files exist, which the check searches for.
    say(CHECKING, None);
    let mut report = checked(&config, (folder, order), plan.carried.is_some(), |share| {
        say(CHECKING, Some(share))
    })?;
    report.findings.extend(limits::short_of_tilt(config.first(), &plan, &found));
    name_place(&mut report, folder, order);
    Ok(Made { report, boxes, limits: found, motion: plan.motion() })
}

/// Creates the machine of these values in memory, with its home, but with neither proved axis limits nor boxes: for
/// comparing many machines.
///
/// # Errors
/// As [`make`](fn@make).
pub fn sketched(kind: &'static MachineKind, values: &Values) -> Result<MachineConfig, Refusal> {
    let order = Order { kind, values, name: kind.name, folder: Path::new("") };
    let mut plan = begun(&order)?;
    let (place, config) = home::found(&plan)?;
    if plan.values.number("lead") == 0.0 {
        return Ok(config);
    }
    plan.home = place;
    plan.cardans = cardans(config.first());
    let ini = Ini::parse(Path::new(&format!("{}.ini", plan.name)), &plan.text())
        .map_err(|error| Refusal::Misfit(error.to_string()))?;
    MachineConfig::leniently(&ini, Some(Lenient::Constraints))
        .map_err(|error| Refusal::Misfit(error.to_string()))
}

/// Longest name of a machine: lines of its INI file and of its first program contain it, of which LinuxCNC reads 255
/// bytes.
const LONGEST_NAME: usize = 64;

/// Refuses a name unsuitable for HAL files, where blanks separate and some characters are special.
pub(crate) fn refuse_name(name: &str) -> Result<(), Refusal> {
    let is_good = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if name.len() > LONGEST_NAME {
        return Err(Refusal::Input(format!(
            "{name:?} is too long for the lines that LinuxCNC reads: use at most {LONGEST_NAME} characters"
        )));
    }
    match !name.is_empty() && name.chars().all(is_good) && !name.starts_with('-') {
        true => Ok(()),
        false => Err(Refusal::Input(format!(
            "{name:?} is not a valid machine name: use letters, digits, - and _"
        ))),
    }
}

pub(crate) fn refuse_place(folder: &Path) -> Result<(), Refusal> {
    if folder.symlink_metadata().is_ok() {
        return Err(Refusal::Input(format!(
            "{} exists already and was not changed: use another name, or --out FOLDER",
            folder.display()
        )));
    }
    match folder.parent() {
        Some(parent) if !parent.as_os_str().is_empty() && !parent.is_dir() => Err(Refusal::Input(
            format!("{} is not a folder: create it, or use another --out", parent.display()),
        )),
        _ => Ok(()),
    }
}

fn begun<'a>(order: &Order<'a>) -> Result<Plan<'a>, Refusal> {
    let Order { kind, values, name, .. } = *order;
    let legs = match values.word(ANCHORS.name) {
        "" => (kind.anchors)(values),
        file => table::read(Path::new(file), kind.leg)?,
    };
    let count = legs.len();
    if kind.legs != 0 && count != kind.legs {
        let text =
            format!("a {} has {} legs, but the table of anchors has {count}", kind.name, kind.legs);
        return Err(Refusal::Input(text));
    }
    let hands = values.word("hands").len();
    if hands > 1 && hands != count {
        let text = format!(
            "--hands {}: expected one letter, or one for each of {count} struts",
            values.word("hands")
        );
        return Err(Refusal::Input(text));
    }
    if values.word("hands").contains('L') && values.number("lead") == 0.0 {
        let text = format!(
            "--hands {} without --lead: hands only matter if turning the screw changes the strut \
             length; add --lead, or remove --hands",
            values.word("hands")
        );
        return Err(Refusal::Input(text));
    }
    let coordinates = coordinates(kind, values, count)?;
    Ok(Plan {
        name,
        kind,
        values,
        legs,
        coordinates,
        home: [0.0; 3],
        cardans: vec![],
        joints: vec![],
        limits: None,
        speeds: vec![],
        boxes: (String::new(), 0),
        carried: None,
    })
}

/// Returns the letters that the legs move.
fn coordinates(kind: &MachineKind, values: &Values, legs: usize) -> Result<String, Refusal> {
    let letters = match (kind.coordinates, values.word("coordinates"), legs) {
        ("", "", 3) => "XYZ",
        ("", "", 5) => "XYZAB",
        ("", "", 6) => "XYZABC",
        ("", "", _) => "",
        ("", given, _) => given,
        (own, ..) => own,
    };
    if letters.is_empty() {
        let text = format!(
            "--coordinates: {legs} legs can move different letters; choose them, for example XYZB"
        );
        return Err(Refusal::Input(text));
    }
    if letters.len() > legs {
        let text = format!(
            "{legs} legs cannot move {} letters ({letters}): use fewer letters, or more legs",
            letters.len()
        );
        return Err(Refusal::Input(text));
    }
    Ok(letters.into())
}

/// Returns the axes of the base joints: horizontal, and normal to the struts at home.
fn cardans(config: &Mechanism) -> Vec<[f64; 3]> {
    let Ok(at) = config.machine.at(&config.home_pose(), &config.spindle) else { return vec![] };
    let up = Vector3::z();
    let axis = |segment: &kinematics::Segment| {
        let along = segment.span();
        // For a vertical strut any horizontal axis is normal to it.
        let across = up.cross(&along).try_normalize(1e-9 * along.norm());
        across.unwrap_or(Vector3::x()).map(|x| x + 0.0).into()
    };
    at.segments()[..config.legs()].iter().map(axis).collect()
}

/// Writes the machine's file and reads it back.
fn written(folder: &Path, plan: &Plan) -> Result<MachineConfig, Refusal> {
    let file = folder.join(format!("{}.ini", plan.name));
    write_over(&file, &plan.text())?;
    let read = || MachineConfig::leniently(&Ini::read(&file)?, Some(Lenient::Constraints));
    read().map_err(|error: MachineError| Refusal::Misfit(error.to_string()))
}

fn joints(config: &Mechanism) -> Result<Vec<f64>, Refusal> {
    let joints = config.machine.inverse(&config.home_pose(), &config.spindle);
    let joints = joints.map_err(|fault| Refusal::Misfit(format!("at home {fault}")))?;
    Ok(joints[..config.joints.len()].to_vec())
}

/// Proves boxes if requested and returns a note about them.
fn with_boxes(
    plan: &mut Plan,
    config: &Mechanism,
    say: impl Fn(&str, Option<f64>) + Sync,
) -> String {
    let without = |why: &dyn Display| {
        let text = format!(
            "# There are no [BOX_K] sections for the start without a seed: {why}.\n\
             # pkm boxes {}.ini finds and proves some (`pkm help reference/start-without-a-seed`).\n",
            plan.name
        );
        (format!("\n{text}"), 0)
    };
    if plan.kind.boxes.is_empty() {
        return "no boxes for the start without a seed: with constraints= they are not supported"
            .into();
    }
    if plan.values.word("boxes") != "yes" {
        plan.boxes = without(&"--boxes yes was not given");
        return "no boxes for the start without a seed: use --boxes yes, or run pkm boxes later"
            .into();
    }
    say(PROVING_BOXES, None);
    let reported = |share: f64| say(PROVING_BOXES, Some(share));
    match boxes::found(config, &reported) {
        Ok(found) => {
            let letters = config.machine.layout().coordinates().as_slice();
            let section = |(k, (section, _)): (usize, &(_, usize))| {
                box_text(&config.place.box_section(k), section, letters, config.legs())
            };
            let sections: Vec<String> = found.iter().enumerate().map(section).collect();
            let about = "\n# Start without a seed: poses on which the kinematics are one-to-one. After a change of the\n# geometry let pkm boxes write new sections.\n";
            plan.boxes = (format!("{about}{}", sections.join("\n")), found.len());
            let boxes = if found.len() == 1 { "box" } else { "boxes" };
            format!("proved {} {boxes} for the start without a seed", found.len())
        }
        Err(doubt) => {
            plan.boxes = without(&doubt);
            format!("no boxes for the start without a seed: {doubt}")
        }
    }
}

/// Returns the result of `pkm check` for the file at its final path.
fn checked(
    config: &MachineConfig,
    (folder, order): (&Path, &Order),
    is_carried: bool,
    progress: impl FnMut(f64),
) -> Result<Report, Refusal> {
    let mut report = check(config, config.first(), progress)
        .map_err(|error| Refusal::Misfit(error.to_string()))?;
    name_place(&mut report, folder, order);
    // A migrated configuration may contain errors of the older one.
    if report.fits() || is_carried {
        return Ok(report);
    }
    let errors = report.findings.iter().filter(|finding| finding.severity == Severity::Error);
    let lines: Vec<String> =
        errors.map(|finding| rendered(finding.severity, &finding.problem)).collect();
    Err(Refusal::Misfit(format!("this machine does not fit together:\n{}", lines.join("\n"))))
}

/// Replaces the temporary paths in findings by those of the machine's files.
fn name_place(report: &mut Report, folder: &Path, order: &Order) {
    for Finding { problem, .. } in &mut report.findings {
        if let Ok(name) = problem.file.strip_prefix(folder) {
            problem.file = order.folder.join(name);
        }
    }
}

/// Formats the limits of the new machine, letter by letter.
pub fn limit_lines(config: &Mechanism) -> String {
    let line = |letter: &Letter| {
        let axis = &config.programmed[letter.index()];
        let unit = if letter.is_angle() { "degrees" } else { config.length_unit() };
        format!("  {} {} to {} {unit}\n", letter.name(), plain(axis.min), plain(axis.max))
    };
    let is_moved = |letter: &&Letter| !config.machine.layout().is_held(**letter);
    Letter::ALL.iter().filter(is_moved).map(line).collect()
}
