// SPDX-License-Identifier: GPL-2.0-or-later
//! Examples and further reading of every subcommand: one table for help and manual pages.

use clap::Command;
use new::kinds::KINDS;
use new::parameters::{Measure, Need, Parameter};

/// A page of help.
pub struct Page {
    /// Words of the subcommand; empty for pkm itself.
    command: &'static str,
    /// Command lines, each with its purpose.
    examples: &'static [(&'static str, &'static str)],
    /// Names of subcommands, and pages of the documentation.
    see: &'static [&'static str],
}

const fn page(
    command: &'static str,
    examples: &'static [(&'static str, &'static str)],
    see: &'static [&'static str],
) -> Page {
    Page { command, examples, see }
}

/// All pages except those of the kinds of `pkm new`, which are derived from their table.
const PAGES: &[Page] = &[
    page(
        "",
        &[
            ("pkm check hexapod.ini", "check that the machine fits together"),
            ("pkm preflight hexapod.ini part.ngc", "check that a program fits the machine"),
            ("pkm help preflight", "show a subcommand and its options"),
            ("pkm help guide", "show the guide; `reference` and `studies`, or any of their pages"),
        ],
        &["new", "check", "preflight", "reference/pkm", "reference/json"],
    ),
    page(
        "new",
        &[
            ("pkm new", "ask for everything, on a terminal"),
            ("pkm new linear-delta", "ask for the values of a linear delta"),
            (
                "pkm new hexapod --base-radius 400 --base-half-angle 12 --platform-radius 180 \
                 --platform-half-angle 15 --strut 550 850 --lead 5 --hands RLRLRL --tool up my-hexapod",
                "make a hexapod whose tool points up, with screws of both hands",
            ),
            (
                "pkm new struts --anchors anchors.csv --strut 450 800 --coordinates XYZAB",
                "make a machine with struts between the anchors of a table (- for standard input)",
            ),
        ],
        &["check", "view", "preflight", "reference/pkm"],
    ),
    page(
        "migrate",
        &[
            ("pkm migrate ldelta.ini", "a machine of lineardeltakins, into ../../ldelta-pkmkins"),
            (
                "pkm migrate delta.ini --geometry delta.hal --out delta-29",
                "with its geometry from a file of setp lines",
            ),
        ],
        &["new", "check", "guide/migrating"],
    ),
    page(
        "check",
        &[
            ("pkm check hexapod.ini", "print what was found, and everything that does not fit"),
            ("pkm check hexapod.ini --quiet", "print only what does not fit"),
            ("pkm check hexapod.ini --no-start", "skip the start in virtual time"),
            ("pkm check hexapod.ini --fix", "print corrections of the file as a diff"),
            ("pkm check hexapod.ini --fix --write", "write the corrections into the file"),
        ],
        &["homing", "boxes", "preflight", "reference/pkm", "guide/drives"],
    ),
    page(
        "homing",
        &[
            ("pkm homing hexapod.ini", "check that homing keeps the limits of the legs"),
            (
                "pkm homing hexapod.ini --html home.html",
                "show the worst homing motion in a browser",
            ),
        ],
        &["check", "view", "guide/homing"],
    ),
    page(
        "preflight",
        &[
            ("pkm preflight hexapod.ini part.ngc", "check that the program fits the machine"),
            (
                "pkm preflight hexapod.ini part.ngc --report part.html",
                "also write a page with plots",
            ),
            (
                "pkm preflight hexapod.ini programs",
                "check all programs of a folder, with a table at the end",
            ),
            (
                "pkm random hexapod.ini | pkm preflight hexapod.ini -",
                "check a program from standard input",
            ),
        ],
        &["run", "filter", "view", "reference/preflight", "reference/json"],
    ),
    page(
        "filter",
        &[(
            "pkm filter part.ngc --machine hexapod.ini",
            "print the program if it fits the machine",
        )],
        &["preflight", "reference/preflight"],
    ),
    page(
        "joints",
        &[
            ("pkm joints hexapod.ini --pose 10 0 250 0 0 0", "compute the joint values of a pose"),
            (
                "pkm joints hexapod.ini --pose X10 A5",
                "the same, with all other coordinates at home",
            ),
            (
                "pkm joints hexapod.ini --passive --pose X10 A5",
                "compute the values of all joints of the exported model",
            ),
            (
                "pkm joints hexapod.ini --rows poses.csv > joints.csv",
                "compute the joint values of many poses",
            ),
        ],
        &["pose", "replay", "travel"],
    ),
    page(
        "pose",
        &[
            (
                "pkm pose hexapod.ini --joints 940 940 940 940 940 940",
                "compute the pose of joint values",
            ),
            (
                "pkm joints hexapod.ini --rows poses.csv | pkm pose hexapod.ini",
                "compute joint values, and poses from them",
            ),
        ],
        &["joints"],
    ),
    page(
        "run",
        &[
            ("pkm run hexapod.ini part.ngc", "print LinuxCNC's messages and the duration"),
            ("pkm run hexapod.ini part.ngc --trace part.csv", "also write every servo cycle"),
        ],
        &["preflight", "replay", "reference/preflight"],
    ),
    page(
        "replay",
        &[
            (
                "pkm replay hexapod.ini part.ngc > part.csv",
                "write the joint values along a program",
            ),
            ("pkm replay hexapod.ini part.ngc --plots plots > part.csv", "also plot them"),
        ],
        &["joints", "run", "rods"],
    ),
    page(
        "path",
        &[
            ("pkm path pyramid.ini cycloid.toml -o cycloid.ngc", "write a program along a curve"),
            (
                "pkm path pyramid.ini cycloid.toml -o cycloid.ngc --csv joints.csv",
                "also write the joint motion",
            ),
        ],
        &["preflight", "studies/paths"],
    ),
    page(
        "scene",
        &[("pkm scene hexapod.ini -o scene.json", "write the machine for a viewer")],
        &["view", "export", "reference/view"],
    ),
    page(
        "export",
        &[
            (
                "pkm export hexapod.ini --mjcf model",
                "write a model for MuJoCo into the folder model",
            ),
            (
                "pkm export hexapod.ini --urdf ros --sdf gazebo --study dynamics.toml",
                "write models for ROS and Gazebo, with the masses of a study",
            ),
        ],
        &["joints", "run", "guide/simulators"],
    ),
    page(
        "frames",
        &[(
            "pkm frames hexapod.ini -o frames.svg",
            "write the drawing, for a browser or a printer",
        )],
        &["check", "view", "guide/frames"],
    ),
    page(
        "view",
        &[
            (
                "pkm view hexapod.ini part.ngc --html part.html",
                "write a page with machine and program",
            ),
            ("pkm view hexapod.ini part.ngc --video part.mp4", "write a video"),
        ],
        &["preflight", "scene", "reference/view"],
    ),
    page(
        "panel",
        &[(
            "pkm panel hexapod.ini",
            "write the panel beside the INI file, and print the lines to add",
        )],
        &["travel", "guide/panel"],
    ),
    page(
        "travel",
        &[
            ("pkm travel hexapod.ini", "show the travel from home"),
            (
                "pkm travel hexapod.ini --pose X20 Z300 A5 --tool 0 0 80",
                "show the travel from a pose, with a tool",
            ),
        ],
        &["joints", "panel", "guide/panel"],
    ),
    page(
        "rods",
        &[
            (
                "pkm rods hexapod.ini part.ngc > rods.csv",
                "write the positions of the legs along a program",
            ),
            (
                "pkm rods hexapod.ini part.ngc --period 0.001 > rods.csv",
                "the same for every servo cycle",
            ),
            (
                "pkm rods hexapod.ini --rows poses.csv --study legs.toml",
                "write them at your own poses",
            ),
        ],
        &["replay", "workspace", "studies/machine"],
    ),
    page(
        "sensitivity",
        &[
            ("pkm sensitivity hexapod.ini --study errors.toml", "compute the sensitivity at home"),
            (
                "pkm sensitivity hexapod.ini --pose 0 0 300 10 0 0 --along part.ngc --csv errors.csv",
                "compute it at a pose, and along a program",
            ),
        ],
        &["stiffness", "calibrate", "studies/machine"],
    ),
    page(
        "stiffness",
        &[
            ("pkm stiffness hexapod.ini --study cutting.toml", "compute the stiffness at home"),
            (
                "pkm stiffness hexapod.ini --study cutting.toml --pose 0 0 300 10 0 0 --plots plots",
                "compute it at a pose, with maps in planes through the pose",
            ),
        ],
        &["dynamics", "sensitivity", "studies/machine"],
    ),
    page(
        "stability",
        &[(
            "pkm stability pose hexapod.ini --study cutting.toml",
            "compute the limit depth at home",
        )],
        &[
            "stability pose",
            "stability map",
            "stability program",
            "stability lag",
            "studies/stability",
        ],
    ),
    page(
        "stability pose",
        &[
            (
                "pkm stability pose hexapod.ini --study cutting.toml --rpm 6000",
                "judge one spindle speed at home",
            ),
            (
                "pkm stability pose hexapod.ini --study cutting.toml --pose -80 60 350 10 -20 0 --plots plots",
                "compute the limit depth at a pose, and plot it over speed",
            ),
        ],
        &["stability map", "dynamics", "studies/stability"],
    ),
    page(
        "stability map",
        &[(
            "pkm stability map hexapod.ini --study cutting.toml --plane xy --grid 100 --plots plots",
            "map a plane through home",
        )],
        &["stability pose", "studies/stability"],
    ),
    page(
        "stability program",
        &[(
            "pkm stability program hexapod.ini part.ngc --study cutting.toml --csv depths.csv",
            "find the line that is nearest to chatter",
        )],
        &["stability pose", "cut", "studies/stability"],
    ),
    page(
        "stability lag",
        &[(
            "pkm stability lag --study lag.toml --overhang 500 300 --plots plots",
            "compare two overhangs",
        )],
        &["stability spindle", "studies/stability"],
    ),
    page(
        "stability spindle",
        &[("pkm stability spindle --study spindle.toml --overhang 32 90", "compare two tools")],
        &["stability lag", "studies/stability"],
    ),
    page(
        "dynamics",
        &[
            (
                "pkm dynamics hexapod.ini --study dynamics.toml",
                "compute natural frequencies at home",
            ),
            (
                "pkm dynamics hexapod.ini --study dynamics.toml --pose -80 60 350 10 -20 0 --shake noise",
                "simulate a random force at a pose",
            ),
        ],
        &["stiffness", "stability", "studies/dynamics"],
    ),
    page(
        "cut",
        &[(
            "pkm cut hexapod.ini part.ngc --study cut.toml --report part.html",
            "write a page with the load on drives and tool",
        )],
        &["preflight", "stability program", "studies/cut"],
    ),
    page(
        "workspace",
        &[
            ("pkm workspace hexapod.ini", "compute it with a level platform"),
            (
                "pkm workspace hexapod.ini --tilt 15 --mesh body.obj",
                "require a tilt of 15 degrees in every direction",
            ),
            (
                "pkm workspace lathe.ini --mechanism 1 --beside home --plots .",
                "of the first of two mechanisms, with the other one at home",
            ),
        ],
        &["check", "rods", "studies/machine"],
    ),
    page(
        "boxes",
        &[
            ("pkm boxes hexapod.ini", "prove the boxes of the file, or find some"),
            ("pkm boxes hexapod.ini --write", "write the boxes found into the file"),
        ],
        &["check", "reference/start-without-a-seed"],
    ),
    page(
        "random",
        &[(
            "pkm random hexapod.ini --seed 3 --seconds 600 > random.ngc",
            "write ten minutes of moves",
        )],
        &["preflight", "run"],
    ),
    page(
        "measure",
        &[(
            "pkm measure hexapod.ini dial.toml -o dial",
            "write dial.ngc, which stops at each pose, and dial.csv",
        )],
        &["calibrate", "guide/calibration"],
    ),
    page(
        "calibrate",
        &[
            (
                "pkm calibrate hexapod.ini probed.log --plate plate.toml --write true.ini",
                "write a file with the geometry measured with a probed plate",
            ),
            ("pkm calibrate hexapod.ini dial.csv --write true.ini", "the same from gauge readings"),
        ],
        &["measure", "check", "sensitivity", "guide/calibration"],
    ),
    page(
        "man",
        &[("pkm man pages", "write pages/pkm.1 and a page for each subcommand")],
        &["completions"],
    ),
    page(
        "completions",
        &[(
            "pkm completions bash > ~/.local/share/bash-completion/completions/pkm",
            "install them for bash",
        )],
        &["man"],
    ),
];

/// End of a page of help.
pub struct Ending {
    /// Command lines, each with its purpose.
    pub examples: Vec<(String, String)>,
    /// Manual pages, and commands that show a page of the documentation.
    pub see: Vec<String>,
}

/// Returns the ending of a subcommand by its words.
pub fn ending(command: &str) -> Ending {
    if let Some(kind) = command.strip_prefix("new ") {
        return of_kind(kind);
    }
    let found = PAGES.iter().find(|page| page.command == command);
    let Some(Page { examples, see, .. }) = found else {
        return Ending { examples: vec![], see: vec![] };
    };
    let mut see: Vec<String> = see.iter().map(|name| reference(name)).collect();
    if !command.is_empty() {
        see.insert(0, reference(""));
    }
    let examples = examples.iter().map(|(line, what)| ((*line).into(), (*what).into())).collect();
    Ending { examples, see }
}

/// Returns the ending of a kind of machine: with all required values.
fn of_kind(name: &str) -> Ending {
    let kind = KINDS.iter().find(|kind| kind.name == name);
    let parameters = kind.map(|kind| kind.parameters()).unwrap_or_default();
    let needed = parameters.iter().filter(|parameter| parameter.need != Need::Optional);
    let value = |parameter: &Parameter| match parameter.measure {
        Measure::File => "anchors.csv",
        _ => parameter.default,
    };
    let words: String =
        needed.map(|parameter| format!(" --{} {}", parameter.name, value(parameter))).collect();
    let line = format!("pkm new {name}{words} my-{name}");
    let see = ["new", "check", "reference/pkm"].map(reference).into();
    Ending { examples: vec![(line, "make one with the required values".into())], see }
}

/// Returns the manual page of a subcommand, or the command that shows a page of the documentation.
fn reference(name: &str) -> String {
    match name {
        "" => "pkm(1)".into(),
        page if page.contains('/') => format!("pkm help {page}"),
        name => format!("pkm-{}(1)", name.replace(' ', "-")),
    }
}

/// Largest width of an example; a longer one is continued on the next line, as in a shell.
const WIDEST: usize = 90;

fn continued(line: &str) -> String {
    let (mut text, mut column) = (String::new(), 0);
    for word in line.split(' ') {
        match column {
            0 => {}
            _ if column + word.len() > WIDEST => (text, column) = (text + " \\\n      ", 6),
            _ => (text, column) = (text + " ", column + 1),
        }
        text += word;
        column += word.len();
    }
    text
}

/// Adds its ending to the long help of every subcommand.
pub fn documented(command: Command, words: &str) -> Command {
    let below = |part: Command| {
        let words = format!("{words} {}", part.get_name());
        documented(part, words.trim_start())
    };
    let Ending { examples, see } = ending(words);
    let lines: String = examples
        .iter()
        .map(|(line, what)| format!("  {}\n      {what}\n", continued(line)))
        .collect();
    let text = format!("Examples:\n{lines}\nSee also: {}", see.join(", "));
    command.mut_subcommands(below).after_long_help(text)
}
