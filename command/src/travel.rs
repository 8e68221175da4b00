// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkm travel`.

use super::failure::Failure;
use super::poses::{PoseWords, Tool};
use super::{MachineFile, Verdict, output, print_text};
use kinematics::{Letter, POSE_LETTERS, Vector3};
use machine::read::machine::MachineConfig;
use program::travel::{Side, Stand, Travel, letters, travel};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::BTreeSet;
use std::io::{BufRead, Write};

/// Show how far the machine can move from a pose
///
/// Reports the travel along every letter in both directions, and the limit that ends it: a joint,
/// a cone, an axis limit. The motion is followed as in `pkm preflight`: every limit is proved to
/// be kept up to the reported end, which is exact to a millionth of the machine's size. If the
/// pose itself violates a limit, no travel is left in either direction. Units: machine units and
/// degrees.
///
/// With --serve, pkm answers every line of standard input with a line of JSON, until standard
/// input ends; panels use this. `pkm help guide/panel` describes both.
///
/// Exit status: 0, 1 if the machine cannot be at the pose, 2 if input or output failed.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    machine: MachineFile,
    #[command(flatten)]
    pose: PoseWords,
    #[command(flatten)]
    tool: Tool,
    /// Answer lines of standard input such as {"at": [X, Y, Z, A, B, C, U, V, W], "tools": [[X, Y,
    /// Z], ...]}, with the tool vector of every mechanism, spindle offset included
    #[arg(long, conflicts_with_all = ["tool", "pose"])]
    serve: bool,
}

/// A request.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Question {
    at: [f64; 9],
    tools: Vec<[f64; 3]>,
}

/// The response.
#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
enum Answer {
    Travel(Vec<Travel>),
    Error(String),
}

pub fn run(arguments: &Arguments) -> Result<Verdict, Failure> {
    let config = arguments.machine.read_named_constrained()?;
    if arguments.serve {
        return Failure::unless_unread(serve(&config)).map(|()| Verdict::Fits);
    }
    let mut stand = Stand::home(&config);
    let letters = letters(&config);
    let first = config.first();
    let place_of = |k: usize| {
        let place = first.place.places[k];
        let is_extra = !first.place.is_second && letters.contains(POSE_LETTERS[place]);
        (is_extra || !first.machine.layout().is_held(Letter::ALL[k])).then_some(place)
    };
    for (place, value) in arguments.pose.words(&letters, place_of)? {
        stand.world[place] = value;
    }
    stand.tools[0] = arguments.tool.vector(config.first());
    let found = match travel(&config, &stand) {
        Ok(found) => found,
        Err(fault) => {
            super::failure::report_error(&fault);
            return Ok(Verdict::Misfit);
        }
    };
    print_text(&in_words(&found))?;
    output::answer(&json!({ "machine": config.file, "pose": stand.world, "travel": found }))?;
    Ok(match left_at(&found) {
        None => Verdict::Fits,
        Some(limits) => {
            super::failure::report_error(&format!("the machine cannot be at this pose: {limits}"));
            Verdict::Misfit
        }
    })
}

/// Returns the limits that are violated at the pose itself, which leaves no travel.
fn left_at(found: &[Travel]) -> Option<String> {
    let sides = || found.iter().flat_map(|way| [&way.minus, &way.plus]);
    if !sides().all(|side| side.left == Some(0.0)) {
        return None;
    }
    let limits: BTreeSet<&str> = sides().filter_map(|side| side.stop.as_deref()).collect();
    Some(limits.into_iter().collect::<Vec<_>>().join(", "))
}

fn serve(config: &MachineConfig) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    for line in std::io::stdin().lock().lines() {
        let answer = match answer(config, &line?) {
            Ok(found) => Answer::Travel(found),
            Err(text) => Answer::Error(text),
        };
        writeln!(out, "{}", serde_json::to_string(&answer)?)?;
        out.flush()?;
    }
    Ok(())
}

/// Returns the available travel, or why it is unknown.
fn answer(config: &MachineConfig, line: &str) -> Result<Vec<Travel>, String> {
    let Question { at, tools } = serde_json::from_str(line).map_err(|error| error.to_string())?;
    let count = config.mechanisms.len();
    if tools.len() != count {
        return Err(format!(
            "tools: expected {count}, one for each mechanism; found {}",
            tools.len()
        ));
    }
    let tool = |i: usize| Vector3::from(tools[i.min(count - 1)]);
    let stand = Stand { world: at, tools: [tool(0), tool(1)] };
    travel(config, &stand).map_err(|fault| fault.to_string())
}

fn in_words(found: &[Travel]) -> String {
    let row = |way: &Travel| {
        let side = |sign: &str, side: &Side| {
            let left =
                side.left.map_or("unlimited".into(), |left| format!("{left:.3} {}", way.unit));
            format!(
                "{sign}{} {left:>18}  {}\n",
                way.letter,
                side.stop.as_deref().unwrap_or_default()
            )
        };
        side("-", &way.minus) + &side("+", &way.plus)
    };
    found.iter().map(row).collect()
}
