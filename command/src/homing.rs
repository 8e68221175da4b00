// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm homing`.

use super::failure::{Failure, tell_error};
use super::{Bar, MachineFile, Verdict, output};
use check::homing_ways::{Group, Homing, Moment, Outcome, Way, sequences, shown};
use machine::files::{csv, write_whole};
use machine::read::columns::{coordinates, joint_names};
use machine::read::mechanism::Mechanism;
use serde_json::{Value, json};
use std::io::Write;
use std::path::PathBuf;
use view::data::Data;
use view::page::page;
use view::track::Track;

/// Follow homing from every pose, and find a safe order
///
/// Draws poses within the axis limits and follows the joints from each to their switches at HOME_OFFSET
/// and to HOME, in the order of HOME_SEQUENCE and with the speeds of the file, by forward kinematics: how
/// many keep the cones, the tilt, the distance of legs and the conditioning on the way, and what the
/// first of the others breaks. Then the order of fewest sequences that keeps them from all these poses is
/// looked for, as lines of the INI file. What is said is seen at places on the way, not proved. That a
/// joint passes its switch by a little, backs off and comes again is left out. docs/guide/homing.md describes
/// the ways of homing.
///
/// Exit status: 0 where nothing was seen to break, 1 where something was, 2 where it is not judged.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    /// The page of pkm view with the machine on its worst way home
    #[arg(long, value_name = "FILE.html", value_hint = clap::ValueHint::FilePath)]
    html: Option<PathBuf>,
    /// That way as a table: time, sequence, joints, pose
    #[arg(long, value_name = "FILE.csv", value_hint = clap::ValueHint::FilePath)]
    csv: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read()?;
    let Some(homing) = Homing::new(&config)? else {
        tell_error("not judged: axes carry something, and homing is not followed with them");
        return Ok(Verdict::Unjudged);
    };
    if let Some(i) = homing.joints.iter().position(|joint| joint.sequence.is_none()) {
        let section = config.place.joint_section(i);
        let text = format!(
            "not judged: Home All leaves [{section}] out, which has no HOME_SEQUENCE, or one behind a gap"
        );
        tell_error(&text);
        return Ok(Verdict::Unjudged);
    }
    let order = homing.order();
    let bar = Bar::spinner("following the way home");
    let outcome = homing.judge(&order);
    if outcome.broken > 0 {
        bar.say("looking for a safe order".into());
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
    let told = write(&config, &homing, &order, &outcome, proposal.as_deref());
    Failure::unless_unread(told.map_err(Failure::from))?;
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
            "\nNot judged: no pose within the axis limits was found to begin from."
        );
    }
    let kept = starts - broken;
    writeln!(
        out,
        "\nFrom {kept} of {starts} poses within the axis limits the legs keep their limits on the way, seen."
    )?;
    for (i, share) in (0..homing.joints.len()).filter_map(|i| Some((i, homing.share_closed(i)?))) {
        // What check warns of, it warns of here as well.
        if share > 0.5 {
            writeln!(
                facts,
                "{} stands where its switch has to be closed in {:.0} % of these poses: from others the search finds it, \
                 from these the joint leaves it first.",
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
            "\nNo order of the joints keeps them from all. Home from nearer to HOME, move the switches, or use \
             encoders that know their place."
        ),
        Some(order) => {
            writeln!(out, "\nThis order keeps them from all {starts}:\n")?;
            for (i, number) in sequences(order).iter().enumerate() {
                writeln!(out, "[{}]\nHOME_SEQUENCE = {number}", config.place.joint_section(i))?;
            }
            Ok(())
        }
    }
}

/// The joints of a sequence, and what each does.
fn members(config: &Mechanism, homing: &Homing, group: &Group) -> String {
    let told = group.joints.iter().map(|i| {
        let way = match homing.joints[*i].way {
            Way::Search { switch, end: Some(end), .. } => {
                format!("to its switch at {switch}, which is closed from there to {end}")
            }
            Way::Search { switch, .. } => format!("to its index at {switch}"),
            Way::Known(at) => format!("known to stand at {at}"),
            Way::Absolute { moves: true } => "to HOME by its encoder".into(),
            Way::Absolute { moves: false } => "stays".into(),
        };
        format!("{} {way}", config.joints[*i].name)
    });
    told.collect::<Vec<_>>().join(", ")
}

/// Cells of a moment without a pose stay empty.
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

/// The way as the page has a program: a line for each sequence.
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
            // Extra axes are homed by themselves and shown at home.
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
