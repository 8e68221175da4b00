// SPDX-License-Identifier: GPL-2.0-or-later
//! The README of a model.

use crate::model::{Joint, Model, Motion, Role};
use machine::read::machine::MachineConfig;
use std::fmt::Write;

const TEXT: &str = "\
## Idealizations

- Bodies are rigid, joints have no play, no friction and no damping. Nothing collides.
- Coordinates that no leg moves are held by an ideal guide: the parallelograms of a delta, for example. The joints
  `platform_*` are the other coordinates; they carry no load, and their values are those of LinuxCNC without a tool.
  Those of coordinates that constraints determine are values in the base frame.
- Each `[CONSTRAINT_N]` has a light body of its own with the five freedoms that the equation leaves: two slides in the
  plane, closed by a ball joint at the point; or, for perpendicular directions, three slides and a hinge about each
  direction. In the machine, one passive part, such as a Tricept's central tube, may replace several of them.
- A universal joint without axes in the INI file has its first axis normal to the rod.
- A strut with a screw has a thread between its universal joints: the drive moves the nut, and what the universal joints
  turn the rod changes its length. The correction of pkmkins is not part of the model.
- What turns in a drive has the inertia that the study gives, or that of an equal share of all moving masses (MJCF only).
- A table, and an axis that carries something, is driven like a leg.

## Values of the joints

All numbers are in meters, kilograms, seconds and radians. In MJCF, driven joints and coordinates have LinuxCNC's values.
In URDF and SDF every joint is 0 at home: subtract the column *home*. Passive joints are 0 at home in all formats.
`pkm joints MACHINE.ini --passive` computes all values at any pose.
";

/// Returns the text.
pub fn text(model: &Model, config: &MachineConfig) -> String {
    let mut text = title(model);
    let file = config.file.file_name().unwrap_or_default().to_string_lossy();
    let push = &mut text;
    let mut line = |line: String| writeln!(push, "{line}").expect("a string grows");
    line(format!(
        "\nA parallel-kinematic machine, exported by pkmkins {} from `{file}`; geometry {:#010x}.\n",
        env!("CARGO_PKG_VERSION"),
        config.first().hash
    ));
    line(format!("Masses: {}.\n", model.masses));
    line(TEXT.into());
    line("| joint | part | unit | home | lowest | highest | largest speed |\n| --- | --- | --- | --- | --- | --- | --- |".into());
    for (_, joint) in model.joints() {
        if let Role::Driven(drive) = &joint.role {
            let [low, high] = joint.range.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
            line(format!(
                "| `{}` | {} | {} | {:.6} | {low:.6} | {high:.6} | {:.6} |",
                joint.name,
                drive.part,
                unit(joint),
                joint.home,
                drive.max_velocity
            ));
        }
    }
    line("\n## Bodies\n\n| body | mass |\n| --- | --- |".into());
    for body in model.bodies.iter().filter(|body| body.mass.is_some()) {
        line(format!("| `{}` | {:.4} |", body.name, body.mass.map_or(0.0, |mass| mass.mass)));
    }
    line(format!(
        "\n{} loops: see the model, or `{}.loops.json` beside a URDF file.",
        model.loops.len(),
        model.name
    ));
    if !model.left_out.is_empty() {
        line("\n## Left out\n".into());
        model.left_out.iter().for_each(|left| line(format!("- {left}")));
    }
    text
}

/// Returns the first line, by which a folder with a model of the same name is known.
pub fn title(model: &Model) -> String {
    format!("# {}: a model for simulators\n", model.name)
}

fn unit(joint: &Joint) -> &'static str {
    match joint.motion {
        Motion::Slide => "m",
        Motion::Hinge => "rad",
    }
}
