// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm homing`.

use super::failure::{Failure, report_error};
use super::{Bar, MachineFile, Verdict, output};
use check::homing_paths::{Group, Homing, HomingMethod, Moment, Outcome, sequences, shown};
use machine::files::{csv, write_whole};
use machine::read::columns::{coordinates, joint_names};
use machine::read::mechanism::Mechanism;
use serde_json::{Value, json};
use std::io::Write;
use std::path::PathBuf;
use view::data::Data;
use view::page::page;
use view::track::Track;

/// Simulate homing from sampled poses, and find a safe order
///
/// Samples poses within the axis limits. From each pose the joints move to their switches at
/// HOME_OFFSET and on to HOME, in the order of HOME_SEQUENCE and at the speeds in the file; the
/// forward kinematics give the pose. Reports how many of these motions keep the cones, the tilt,
/// the distance between legs and the conditioning, and the first violation of the others. If
/// there is one, it searches for the order with the fewest sequences that keeps the limits from
/// all these poses, and prints it as lines for the INI file. The motions are sampled, not proved.
/// The overtravel of a joint past its switch, and its second approach, are not simulated.
/// `pkm help guide/homing` describes the methods of homing.
///
/// Exit status: 0 if no violation was found, 1 if one was, 2 if homing could not be judged.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// Write a page that shows the worst homing motion, as pkm view does
    #[arg(long, value_name = "FILE.html", value_hint = clap::ValueHint::FilePath)]
    html: Option<PathBuf>,
    /// Write that motion as a table: time, sequence, joints, pose
    #[arg(long, value_name = "FILE.csv", value_hint = clap::ValueHint::FilePath)]
    csv: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read()?;
    let Some(homing) = Homing::new(&config)? else {
        report_error(
            "not judged: homing is not simulated for machines whose axes carry the work, the tool or the legs",
        );
        return Ok(Verdict::Unjudged);
    };
    if let Some(i) = homing.joints.iter().position(|joint| joint.sequence.is_none()) {
        let section = config.place.joint_section(i);
        let text = format!(
            "not judged: Home All skips [{section}]: give it a HOME_SEQUENCE, without a gap in the numbers"
        );
        report_error(&text);
        return Ok(Verdict::Unjudged);
    }
    let order = homing.order();
    let bar = Bar::spinner("simulating homing");
    let outcome = homing.judge(&order);
    if outcome.broken > 0 {
        bar.say("searching for a safe order".into());
    }
    let proposal = if outcome.broken > 0 { homing.safe_order() } else { None };
    let track = homing.track(&order);
    drop(bar);
    if let Some(file) = &arguments.csv {
        write_whole(file, &table(&config, &track))?;
    }
    if let Some(file) = &arguments.html {
        write_whole(file, &page(&on_page(&config, &homing, &order, &track, &outcome)))?;
    }
    let groups = |order: &[Group]| -> Vec<Value> {
        let of = |group: &Group| json!({ "joints": group.joints, "text": members(&config, &homing, group) });
        order.iter().map(of).collect()
    };
    output::answer(&json!({
        "machine": config.file,
        "order": groups(&order),
        "starts": outcome.starts,
        "broken": outcome.broken,
        "first": outcome.first,
        "safe_order": proposal.as_deref().map(groups),
        "safe_sequences": proposal.as_deref().map(sequences),
    }))?;
    let reported = write(&config, &homing, &order, &outcome, proposal.as_deref());
    Failure::unless_unread(reported.map_err(Failure::from))?;
    Ok(match outcome {
        Outcome { starts: 0, .. } => Verdict::Unjudged,
        Outcome { broken: 0, .. } => Verdict::Fits,
        _ => Verdict::Misfit,
    })
}

fn write(
    config: &Mechanism,
    homing: &Homing,
    order: &[Group],
    outcome: &Outcome,
    proposal: Option<&[Group]>,
) -> std::io::Result<()> {
    let (mut facts, mut out) = (output::facts(), output::people());
    writeln!(facts, "{}", config.file.display())?;
    for (number, group) in order.iter().enumerate() {
        writeln!(
            facts,
            "  {:<14} {}",
            format!("sequence {}", number + 1),
            members(config, homing, group)
        )?;
    }
    let Outcome { starts, broken, first } = outcome;
    if *starts == 0 {
        return writeln!(
            out,
            "\nNot judged: no legal pose was found within the axis limits; see pkm check."
        );
    }
    let kept = starts - broken;
    writeln!(
        out,
        "\nHoming keeps the limits of the legs from {kept} of {starts} sampled poses within the axis limits."
    )?;
    for (i, share) in (0..homing.joints.len()).filter_map(|i| Some((i, homing.share_closed(i)?))) {
        // The same warning as in `pkm check`.
        if share > 0.5 {
            writeln!(
                facts,
                "{}: the switch is already closed in {:.0} % of these poses; from there the joint first moves off it, \
                 from the others it searches for it.",
                config.joints[i].name,
                100.0 * share
            )?;
        }
    }
    let Some(first) = first else { return Ok(()) };
    writeln!(
        out,
        "From {}, in sequence {}: {}.",
        shown(config, &first.start),
        first.group + 1,
        first.what
    )?;
    match proposal {
        None => writeln!(
            out,
            "\nNo order keeps the limits from all of them. Home from nearer to HOME, move the switches, or use \
             absolute encoders."
        ),
        Some(order) => {
            writeln!(out, "\nThis order keeps the limits from all {starts} poses:\n")?;
            for (i, number) in sequences(order).iter().enumerate() {
                writeln!(out, "[{}]\nHOME_SEQUENCE = {number}", config.place.joint_section(i))?;
            }
            Ok(())
        }
    }
}

/// Describes the joints of a sequence, and the motion of each.
fn members(config: &Mechanism, homing: &Homing, group: &Group) -> String {
    let reported = group.joints.iter().map(|i| {
        let method = match homing.joints[*i].method {
            HomingMethod::Search { switch, end: Some(end), .. } => {
                format!("to its switch at {switch} (closed from there to {end})")
            }
            HomingMethod::Search { switch, .. } => format!("to its index at {switch}"),
            HomingMethod::Known(at) => format!("assumed at {at}"),
            HomingMethod::Absolute { moves: true } => "to HOME by its encoder".into(),
            HomingMethod::Absolute { moves: false } => "stays".into(),
        };
        format!("{} {method}", config.joints[*i].name)
    });
    reported.collect::<Vec<_>>().join(", ")
}

/// Returns the table of a path; cells of a moment without a pose stay empty.
fn table(config: &Mechanism, track: &[Moment]) -> String {
    let count = config.joints.len();
    let header = [
        vec!["t_s".into(), "sequence".into()],
        joint_names(count),
        coordinates(),
        vec!["broken".into()],
    ];
    let rows = track.iter().map(|moment| {
        let joints = moment.joints[..count].iter().map(f64::to_string);
        let pose: Vec<String> = match moment.pose {
            Some(pose) => pose.iter().map(f64::to_string).collect(),
            None => vec![String::new(); 6],
        };
        [moment.at.to_string(), (moment.group + 1).to_string()]
            .into_iter()
            .chain(joints)
            .chain(pose)
            .chain([moment.broken.clone().unwrap_or_default()])
            .collect::<Vec<_>>()
    });
    csv(&header.concat(), rows)
}

/// Converts the path to a program for the page: a line for each sequence.
fn on_page(
    config: &Mechanism,
    homing: &Homing,
    order: &[Group],
    track: &[Moment],
    outcome: &Outcome,
) -> Data {
    let alone = config.clone().into();
    let mut way = Track::new(&alone);
    for moment in track {
        if let Some(pose) = moment.pose {
            // Extra axes are homed separately and shown at home.
            let tool = config.spindle.iter().copied();
            let values = pose.into_iter().chain(tool).chain(config.extra_home()).collect();
            way.take(moment.at, moment.group as u32 + 1, values);
        }
    }
    let text: Vec<String> = order.iter().map(|group| members(config, homing, group)).collect();
    let breaks: Vec<_> = track
        .iter()
        .filter_map(|moment| {
            let text = moment.broken.as_ref()?;
            Some(json!({"file": 0, "line": moment.group + 1, "seconds": moment.at, "limit": "homing", "text": text}))
        })
        .collect();
    let report = json!({"fits": outcome.broken == 0, "breaks": breaks, "warnings": [], "files": ["homing"], "time": {}});
    Data::new(&alone, false).with_program(
        config,
        ["homing".into(), text.join("\n")],
        &way,
        None,
        report,
    )
}
