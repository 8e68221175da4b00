// SPDX-License-Identifier: GPL-2.0-or-later
//! Files next to the INI file: a first program, the tool table and a page of next steps.

use crate::ini::Plan;
use crate::wrist::Wrist;
use kinematics::Letter;
use machine::digits::plain;
use machine::proof::axis_box::AxisBox;
use std::fmt::Write;
use std::path::Path;

/// Speed of the first program, as a share of the largest one.
const SHARE: f64 = 0.5;

/// Shares of the limits to which the program moves along one letter, and along all of them.
const ALONE: [f64; 2] = [0.1, 0.9];
const TOGETHER: [f64; 2] = [0.3, 0.7];

/// Formats the words of a pose, with few digits.
fn words(plan: &Plan, letters: &[Letter], pose: [f64; 6]) -> String {
    let of = |letter: &Letter| {
        let digits = if letter.is_angle() || plan.values.unit() == "mm" { 2 } else { 4 };
        let grid = 10_f64.powi(digits);
        format!("{}{}", letter.name(), plain((pose[letter.index()] * grid).round() / grid))
    };
    letters.iter().map(of).collect::<Vec<_>>().join(" ")
}

/// Returns a program that moves the machine along each of its letters, and along all of them, within its limits.
///
/// With exact stops: where a letter turns back in G64, LinuxCNC 2.10 of August 2026 exceeds the acceleration of joints.
pub fn first(plan: &Plan, limits: &AxisBox) -> String {
    let [[feed, _], [turn, _]] = plan.motion();
    let letters = plan.letters();
    let home: [f64; 6] = std::array::from_fn(|k| plan.home.get(k).copied().unwrap_or(0.0));
    let code = if plan.values.unit() == "mm" { "G21" } else { "G20" };
    let mut text = format!(
        "; The first program of {}: every letter separately, then all together, within the proved limits.\n\
         {code} G17 G40 G49 G54 G61 G80 G90 G94 ; exact stops\n",
        plan.name
    );
    text += "M52 P1 ; the guard may slow the feed\n";
    let mut line = |block: &str| {
        let _ = writeln!(text, "{block}");
    };
    line(&format!("G0 {}", words(plan, &letters, home)));
    for letter in &letters {
        let k = letter.index();
        // A feed without X Y Z is in degrees per minute.
        let speed = (60.0 * SHARE * if letter.is_angle() { turn } else { feed }).round().max(1.0);
        for share in ALONE {
            let mut pose = home;
            pose[k] = limits.low[k] + share * (limits.high[k] - limits.low[k]);
            line(&format!("G1 F{speed} {}", words(plan, &[*letter], pose)));
        }
        line(&format!("G1 {}", words(plan, &[*letter], home)));
    }
    if let Some(wrist) = Wrist::of(plan) {
        wrist.blocks().iter().for_each(|block| line(block));
    }
    let speed = (60.0 * SHARE * feed).round().max(1.0);
    for n in 0..4_usize {
        let share = |k: usize| TOGETHER[(n ^ k) >> (k % 2) & 1];
        let pose = limits.at(std::array::from_fn(share));
        line(&format!("G1 F{speed} {}", words(plan, &letters, pose)));
    }
    line(&format!("G0 {}", words(plan, &letters, home)));
    line("M2");
    text
}

/// Returns a table with one tool without a length, or the table of an older configuration.
pub fn tools<'a>(plan: &'a Plan) -> &'a str {
    let carried = plan.carried.as_ref();
    carried.map_or("T1 P1 Z0 D0 ;no length yet: measure your tools\n", |old| &old.tools)
}

/// Returns the page of next steps.
pub fn readme(plan: &Plan) -> String {
    let name = plan.name;
    let tools = match plan.direction() {
        None if plan.carried.is_some() => {
            "Tools: the older configuration does not say which way they point; `TOOL_DIRECTION = down` or `up` in `[PKM]` lets `pkm check` judge their lengths."
        }
        None => {
            "Tools: X, Y and Z of the tool table are the position of the tip relative to the center of the platform joints."
        }
        Some("up") => {
            "Tools: the tip is above the nose, so Z in the tool table is negative: minus the tool length."
        }
        _ => {
            "Tools: the tip is below the nose, so Z in the tool table is the tool length, positive."
        }
    };
    let source = match &plan.carried {
        Some(carried) => carried.source.clone(),
        None => format!("Made by `pkm new {}`.", plan.kind.name),
    };
    let frame = if plan.carried.is_some() { "" } else { plan.kind.frame };
    let boxes = match plan.kind.boxes {
        "" => "",
        _ => ", and `pkm boxes` to prove\n`[BOX_K]` sections again",
    };
    format!(
        "# {name}: {}\n\n{source} {frame} {tools}\n\n{}\n\
         On real hardware replace `LIB:pkmkins_sim.tcl` by your HAL file; keep `LIB:pkmkins.tcl` after it.\n\
         After changes of dimensions: run `pkm check` for the new HOME and axis limits{boxes}. After changes of limits: run `pkm panel` to write the panel again.\n",
        plan.kind.text,
        next_steps("    ", Path::new(""), name),
    )
}

/// Returns the commands that follow, one per line after an indent, for a machine in a folder.
pub fn next_steps(indent: &str, folder: &Path, name: &str) -> String {
    let [ini, first, frames] = [&format!("{name}.ini"), "programs/first.ngc", "frames.svg"]
        .map(|file| folder.join(file).display().to_string());
    let steps = [
        (format!("pkm check {ini}"), "check that everything fits together"),
        (format!("pkm frames {ini} -o {frames}"), "draw axes, numbers and signs"),
        (format!("pkm view {ini} {first}"), "make a page of machine and program"),
        (format!("pkm preflight {ini} {first}"), "check that the program fits"),
        (format!("linuxcnc {ini}"), "run it with simulated drives"),
    ];
    let width = steps.iter().map(|(command, _)| command.len()).max().unwrap_or_default();
    let line = |(command, what): &(String, _)| format!("{indent}{command:<width$}   {what}\n");
    steps.iter().map(line).collect()
}
