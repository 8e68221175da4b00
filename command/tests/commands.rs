// SPDX-License-Identifier: GPL-2.0-or-later
//! The command `pkm` from the user's view: every message, exit codes, pipes. After a change of a text
//! `SNAPSHOTS=overwrite cargo test --profile host -p pkm commands::` writes the new ones here; `[..]`
//! replaces digits that depend on rounding.

use snapbox::{assert_data_eq, str};
use std::fs;
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use test_support::shipped::{folder, with_programs};

const PKM: &str = env!("CARGO_BIN_EXE_pkm");

/// A folder with a copy of the linear delta.
pub struct Bench(pub tempfile::TempDir);

impl Bench {
    pub fn new() -> Self {
        let bench = Self(tempfile::tempdir().unwrap());
        let folder = folder("linear-delta");
        for file in [
            "linear-delta.ini",
            "linear-delta.tbl",
            "linear-delta-panel.tcl",
            "linear-delta-panel.xml",
        ] {
            fs::copy(folder.join(file), bench.0.path().join(file)).unwrap();
        }
        with_programs("linear-delta", bench.0.path());
        bench
    }

    /// Writes a file.
    pub fn with(self, name: &str, text: &str) -> Self {
        let file = self.0.path().join(name);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(file, text).unwrap();
        self
    }

    /// Replaces a text in the machine's file once.
    pub fn spoilt(self, from: &str, to: &str) -> Self {
        let file = self.0.path().join("linear-delta.ini");
        let text = fs::read_to_string(&file).unwrap();
        assert!(text.contains(from), "{from}");
        fs::write(&file, text.replacen(from, to, 1)).unwrap();
        self
    }

    fn command(&self, words: &str) -> Command {
        let mut command = Command::new(PKM);
        command.args(words.split_whitespace()).current_dir(self.0.path());
        command.env("NO_COLOR", "1").env("COLUMNS", "100");
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Returns the command's output with its exit code.
    pub fn answer(&self, words: &str, input: &str) -> String {
        let mut child = self.command(words).spawn().unwrap();
        // A command that does not read it may have ended already.
        let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
        let output = child.wait_with_output().unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let folder = self.0.path().display().to_string();
        let shown = format!(
            "{}{}exit {}\n",
            text(&output.stdout),
            text(&output.stderr),
            output.status.code().unwrap()
        );
        shown.replace(&folder, "FOLDER")
    }

    pub fn files(&self) -> usize {
        fs::read_dir(self.0.path()).unwrap().count()
    }
}

#[test]
fn a_machine_that_fits() {
    assert_data_eq!(
        Bench::new().answer("check linear-delta.ini", ""),
        str![[r#"
linear-delta.ini
  joints         3 carriages
  mobility       legs constrain 3 of 6 motions, 3 of XYZ; joints or guides constrain ABC
  count          8 links + 2 loops - 9 joints = 1; mobility by count 6
  geometry hash  0x6e4a5df2 (compare with pin pkmkins.geometry-hash; 1850367474 on the panel)
  size           lengths in mm; at home the joints of all legs span 0.283 x 0.245 x 0.325 m: if that is wrong, correct LINEAR_UNITS
  order of legs  0 1 2, counter-clockwise seen from above, leg 0 at 90.0 degrees from X: number joints and drives in the same order
  tool tips      T1 at the platform joints
                 TOOL_DIRECTION = down: tools of positive length are below the platform's reference point
  home           joint HOME is that of the inverse kinematics at [TRAJ]HOME
  homing         keeps the limits of the legs from 200 of 200 sampled poses; see pkm homing
  nearest limit  axis Z at home: 90.000 mm, 0 to 100 mm allowed, 10.0 % margin; move [TRAJ]HOME if that is too little
  nearest legs   the center lines of legs 0 and 1 are 57.158 mm apart at home
                 the center lines of legs [..] mm apart, the smallest sampled within the axis limits, at [..]
  conditioning   0.5930 at home (0: singular); pkmkins stops the machine at 0.05, slows it from twice that
                 0.5926, the smallest found within the axis limits, at [..]
  carriage 0     152.914 to 364.051 mm in sampled poses of the axis limits; MIN_LIMIT 0, MAX_LIMIT 375
  carriage 1     132.168 to 365.304 mm in sampled poses of the axis limits; MIN_LIMIT 0, MAX_LIMIT 375
  carriage 2     130.995 to 365.641 mm in sampled poses of the axis limits; MIN_LIMIT 0, MAX_LIMIT 375
  axis limits    the machine reaches 100.0 % of the poses sampled in them; use pkm preflight to check that a program stays in those
  start          switched on, homed, X Y Z moved, T1 changed, in virtual time

Proved: without a tool the machine reaches every pose within its axis limits:

[AXIS_X]
MIN_LIMIT = -80
MAX_LIMIT = 80
[AXIS_Y]
MIN_LIMIT = -80
MAX_LIMIT = 80
[AXIS_Z]
MIN_LIMIT = 0
MAX_LIMIT = 100

The machine fits together.
exit 0

"#]]
    );
}

#[test]
fn a_file_that_cannot_be_read() {
    assert_data_eq!(
        Bench::new().answer("check none.ini", ""),
        str![[r#"
error: this file cannot be read
--> none.ini
 = help: cannot be read: No such file or directory (os error 2); give the path of the machine's INI file
exit 2

"#]]
    );
    assert_data_eq!(
        Bench::new().answer("check .", ""),
        str![[r#"
error: this file cannot be read
--> .
 = help: cannot be read: Is a directory (os error 21); give the path of the machine's INI file
exit 2

"#]]
    );
}

#[test]
fn a_file_of_another_machine() {
    let bench = Bench::new().with("mill.ini", "[KINS]\nKINEMATICS = trivkins\nJOINTS = 3\n");
    assert_data_eq!(
        bench.answer("check mill.ini", ""),
        str![[r#"
error: [KINS]KINEMATICS = trivkins
 --> mill.ini:2:14
  |
2 | KINEMATICS = trivkins
  |              ^^^^^^^^ expected pkmkins [legs=KIND:COUNT[,KIND:COUNT]] [coordinates=LETTERS] [table=LETTERS] [axes=LETTERS] [boxes=COUNT] [constraints=COUNT] [second=KIND:COUNT[,KIND:COUNT] second_coordinates=LETTERS [second_angles=LETTERS] [second_boxes=COUNT]]
exit 2

"#]]
    );
    let first = "[KINS]\nKINEMATICS = pkmkins sparm=identityfirst\nJOINTS = 6\n";
    assert_data_eq!(
        Bench::new().with("first.ini", first).answer("check first.ini", ""),
        str![[r#"
error: [KINS]KINEMATICS = pkmkins sparm=identityfirst
 --> first.ini:2:14
  |
2 | KINEMATICS = pkmkins sparm=identityfirst
  |              ^^^^^^^^^^^^^^^^^^^^^^^^^^^ pkm needs LinuxCNC to start in the machine's kinematics, but sparm=identityfirst starts it in identity kinematics: use a copy of the file without identityfirst, the machine is the same
exit 2

"#]]
    );
    let bench = Bench::new().spoilt("[LEG_1]", "[LEG_7]");
    assert_data_eq!(
        bench.answer("check linear-delta.ini", ""),
        str![[r#"
error: [LEG_1] is missing
--> linear-delta.ini
 = help: [KINS]KINEMATICS has 3 legs; add a section for each
exit 2

"#]]
    );
}

#[test]
fn text_that_is_no_number() {
    let bench = Bench::new().spoilt("GUIDE = 0 0 1", "GUIDE = 0 0 1 # up");
    assert_data_eq!(
        bench.answer("check linear-delta.ini", ""),
        str![[r#"
error: [LEG_0]GUIDE = 0 0 1 # up
  --> linear-delta.ini:81:15
   |
81 | GUIDE = 0 0 1 # up
   |               ^ expected 3 decimal numbers separated by spaces and nothing else on the line; put comments on lines of their own
exit 2

"#]]
    );
}

#[test]
fn an_unknown_key() {
    let bench = Bench::new().spoilt("GUIDE =", "GUIDES =");
    assert_data_eq!(
        bench.answer("joints linear-delta.ini --pose 0 0 50 0 0 0", ""),
        str![[r#"
error: [LEG_0]GUIDES = 0 0 1
  --> linear-delta.ini:81:1
   |
81 | GUIDES = 0 0 1
   | ^^^^^^ unknown key (did you mean GUIDE?); known keys are BASE PLATFORM GUIDE ROD SIDE OFFSET BASE_CONE PLATFORM_CONE

error: [LEG_0]GUIDE is missing
  --> linear-delta.ini:81:1
   |
81 | GUIDES = 0 0 1
   | ^^^^^^ expected 3 decimal numbers separated by spaces and nothing else on the line; put comments on lines of their own; did you mean this line, GUIDES?
exit 2

"#]]
    );
}

#[test]
fn all_errors_are_reported_at_once() {
    let bench = Bench::new()
        .spoilt("GUIDE = 0 0 1", "GUIDE = 0 0 up")
        .spoilt("ROD = 269", "ROD = -269")
        .spoilt("HOME = 0 0 90", "HOME = here")
        .spoilt("MAX_LIMIT = 375", "MAX_LIMIT = -375");
    assert_data_eq!(
        bench.answer("check linear-delta.ini", ""),
        str![[r#"
error: [TRAJ]HOME = here
  --> linear-delta.ini:70:8
   |
70 | HOME = here
   |        ^^^^ expected 3 to 9 decimal numbers separated by spaces

error: [LEG_0]GUIDE = 0 0 up
  --> linear-delta.ini:81:13
   |
81 | GUIDE = 0 0 up
   |             ^^ expected 3 decimal numbers separated by spaces and nothing else on the line; put comments on lines of their own

error: [LEG_0]ROD = -269
  --> linear-delta.ini:82:7
   |
82 | ROD = -269
   |       ^^^^ expected more than 0

error: [JOINT_0]MIN_LIMIT = 0
   --> linear-delta.ini:118:13
    |
118 | MIN_LIMIT = 0
    |             ^ expected less than MAX_LIMIT = -375
exit 2

"#]]
    );
}

#[test]
fn an_axis_whose_lower_limit_is_beyond_its_upper_one() {
    let bench = Bench::new()
        .spoilt(
            "[AXIS_Z]\nTYPE = LINEAR\nMIN_LIMIT = 0",
            "[AXIS_Z]\nTYPE = LINEAR\nMIN_LIMIT = 200",
        )
        .with("line.ngc", "G21 G90\nG1 X10 F100\nM2\n");
    for words in ["check linear-delta.ini", "preflight linear-delta.ini line.ngc"] {
        assert_data_eq!(
            bench.answer(words, ""),
            str![[r#"
error: [AXIS_Z]MIN_LIMIT = 200
   --> linear-delta.ini:179:13
    |
179 | MIN_LIMIT = 200
    |             ^^^ expected at most MAX_LIMIT = 100
exit 2

"#]]
        );
    }
}

#[test]
fn a_tool_table_that_is_none() {
    let bench = Bench::new().with("linear-delta.tbl", "T1 P1 Z1\nT2 Zlong\n");
    let reported = bench.answer("check linear-delta.ini", "");
    let reported: Vec<&str> =
        reported.lines().skip_while(|line| !line.starts_with("warning")).collect();
    assert_data_eq!(
        reported[..5].join("\n"),
        str![[r#"
warning: [EMCIO]TOOL_TABLE = linear-delta.tbl
  --> linear-delta.ini:50:14
   |
50 | TOOL_TABLE = linear-delta.tbl
   |              ^^^^^^^^^^^^^^^^ linear-delta.tbl:2: expected a letter and a number, such as T1 or Z40.5, not Zlong; LinuxCNC needs this file, with at least a line T1 P1 Z0
"#]]
    );
}

/// End of the output without findings.
const FITS: &str = "The program fits the machine.\nexit 0\n";

/// A line that fits only along the diagonal.
#[test]
fn a_work_offset_that_is_turned() {
    let bench =
        Bench::new().with("slot.ngc", "G21 G90\nM52 P1\nG0 X-95 Y0 Z60\nG1 X95 F3000\nM2\n");
    let reported = bench.answer("preflight linear-delta.ini slot.ngc", "");
    let help: Vec<&str> = reported.lines().skip_while(|line| !line.starts_with("help")).collect();
    assert_data_eq!(
        help.join("\n"),
        str![[r#"
help: the program fits with its work offset rotated by [..] degrees about Z, then shifted by X [..] Y [..] Z 0 mm: verified with the whole program.
  Clamp the workpiece there, and run once before the program:
  G10 L2 P0 X[..]*COS[..]

The program does not fit the machine.
exit 1
"#]]
    );
    let block = help[2].trim();
    // As the operator would do it.
    let turned = format!("{block}\nG21 G90\nM52 P1\nG0 X-95 Y0 Z60\nG1 X95 F3000\nM2\n");
    let bench = bench.with("turned.ngc", &turned);
    let reported = bench.answer("preflight linear-delta.ini turned.ngc", "");
    assert!(reported.ends_with(FITS), "{reported}");
}

#[test]
fn an_included_file_that_is_missing() {
    let bench = Bench::new().spoilt("[KINS]", "#INCLUDE kins.inc\n[KINS]");
    assert_data_eq!(
        bench.answer("check linear-delta.ini", ""),
        str![[r#"
error: this file cannot be read
  --> linear-delta.ini:64:10
   |
64 | #INCLUDE kins.inc
   |          ^^^^^^^^ cannot be read: No such file or directory (os error 2); LinuxCNC would start without these lines, so correct the name
exit 2

"#]]
    );
}

#[test]
fn an_error_in_an_included_file() {
    let bench = Bench::new()
        .spoilt("[KINS]", "#INCLUDE kins.inc\n[KINS]")
        .with("kins.inc", "# more\n[LEG_0]\nROAD = 5\n");
    assert_data_eq!(
        bench.answer("check linear-delta.ini", ""),
        str![[r#"
error: [LEG_0]ROAD = 5
 --> kins.inc:3:1
  |
3 | ROAD = 5
  | ^^^^ unknown key (did you mean ROD?); known keys are BASE PLATFORM GUIDE ROD SIDE OFFSET BASE_CONE PLATFORM_CONE
exit 2

"#]]
    );
}

#[test]
fn a_machine_that_the_module_refuses() {
    let bench = Bench::new().spoilt("GUIDE = 0 0 1", "GUIDE = 0 0 0");
    assert_data_eq!(
        bench.answer("check linear-delta.ini", ""),
        str![[r#"
error: [LEG_0]
  --> linear-delta.ini:78:1
   |
78 | [LEG_0]
   | ^^^^^^^ leg 0: the guide direction is zero; set GUIDE to a direction [code -58]
exit 2

"#]]
    );
}

#[test]
fn homes_that_do_not_agree() {
    let bench = Bench::new()
        .spoilt("HOME = 325.3634158062803", "HOME = 300")
        .spoilt("MAX_LIMIT = 375", "MAX_LIMIT = 310");
    assert_data_eq!(
        bench.answer("check linear-delta.ini", ""),
        str![[r#"
linear-delta.ini
  joints         3 carriages
  mobility       legs constrain 3 of 6 motions, 3 of XYZ; joints or guides constrain ABC
  count          8 links + 2 loops - 9 joints = 1; mobility by count 6
  geometry hash  0x6e4a5df2 (compare with pin pkmkins.geometry-hash; 1850367474 on the panel)
  size           lengths in mm; at home the joints of all legs span 0.283 x 0.245 x 0.325 m: if that is wrong, correct LINEAR_UNITS
  order of legs  0 1 2, counter-clockwise seen from above, leg 0 at 90.0 degrees from X: number joints and drives in the same order
  tool tips      T1 at the platform joints
                 TOOL_DIRECTION = down: tools of positive length are below the platform's reference point
  home           joint HOME differs from the inverse kinematics at [TRAJ]HOME by up to 25.363 mm; run pkm check --fix to write all digits
  homing         keeps the limits of the legs from 200 of 200 sampled poses; see pkm homing
  nearest limit  carriage 0 at home: 325.363 mm, 0 to 310 mm allowed, -5.0 % margin; move [TRAJ]HOME if that is too little
  nearest legs   the center lines of legs 0 and 1 are 57.158 mm apart at home
  start          not tested: correct the errors first

error: [JOINT_0]HOME = 300
   --> linear-delta.ini:117:8
    |
117 | HOME = 300
    |        ^^^ off by 25.363 mm: the kinematics give carriage 0 = 325.3634158062803 at [TRAJ]HOME; use that (pkm check --fix writes it), or correct [TRAJ]HOME or [LEG_0] if this value was measured

error: [TRAJ]HOME = 0 0 90
  --> linear-delta.ini:70:8
   |
70 | HOME = 0 0 90
   |        ^^^^^^ [TRAJ]HOME needs 325.3634158062803 of carriage 0: widen its limits 0 to 310, or move HOME

warning: [JOINT_0]HOME_OFFSET = 370
   --> linear-delta.ini:124:15
    |
124 | HOME_OFFSET = 370
    |               ^^^ the switch is 60.000 mm outside MIN_LIMIT to MAX_LIMIT: expected the joint value at the switch; keep it only if the switch is beyond the travel of programs

warning: [DISPLAY]PYVCP = linear-delta-panel.xml
  --> linear-delta.ini:23:9
   |
23 | PYVCP = linear-delta-panel.xml
   |         ^^^^^^^^^^^^^^^^^^^^^^ the panel is not that of this machine and shows other limits or axes: run pkm panel linear-delta.ini to write it again; if you changed it yourself, remove the comment "Made by pkm panel" from it

The machine does not fit together.
exit 1

"#]]
    );
}

#[test]
fn warnings() {
    let bench = Bench::new()
        .spoilt("[TRAJ]", "[TRAJ]\nNO_FORCE_HOMING = 1")
        .spoilt("HALFILE = LIB:pkmkins.tcl", "HALFILE = own.hal")
        .spoilt("HOME_SEQUENCE = -1", "# no sequence");
    assert_data_eq!(
        bench.answer("check linear-delta.ini", ""),
        str![[r#"
linear-delta.ini
  joints         3 carriages
  mobility       legs constrain 3 of 6 motions, 3 of XYZ; joints or guides constrain ABC
  count          8 links + 2 loops - 9 joints = 1; mobility by count 6
  geometry hash  0x6e4a5df2 (compare with pin pkmkins.geometry-hash; 1850367474 on the panel)
  size           lengths in mm; at home the joints of all legs span 0.283 x 0.245 x 0.325 m: if that is wrong, correct LINEAR_UNITS
  order of legs  0 1 2, counter-clockwise seen from above, leg 0 at 90.0 degrees from X: number joints and drives in the same order
  tool tips      T1 at the platform joints
                 TOOL_DIRECTION = down: tools of positive length are below the platform's reference point
  home           joint HOME is that of the inverse kinematics at [TRAJ]HOME
  homing         judged only from HOME, because not all joints are homed
  nearest limit  axis Z at home: 90.000 mm, 0 to 100 mm allowed, 10.0 % margin; move [TRAJ]HOME if that is too little
  nearest legs   the center lines of legs 0 and 1 are 57.158 mm apart at home
                 the center lines of legs [..] mm apart, the smallest sampled within the axis limits, at [..]
  conditioning   0.5930 at home (0: singular); pkmkins stops the machine at 0.05, slows it from twice that
                 0.5926, the smallest found within the axis limits, at [..]
  carriage 0     152.914 to 364.051 mm in sampled poses of the axis limits; MIN_LIMIT 0, MAX_LIMIT 375
  carriage 1     132.168 to 365.304 mm in sampled poses of the axis limits; MIN_LIMIT 0, MAX_LIMIT 375
  carriage 2     130.995 to 365.641 mm in sampled poses of the axis limits; MIN_LIMIT 0, MAX_LIMIT 375
  axis limits    the machine reaches 100.0 % of the poses sampled in them; use pkm preflight to check that a program stays in those
  start          not tested: correct the errors first

warning: [JOINT_0]HOME_SEQUENCE is missing
--> linear-delta.ini
 = help: Home All skips this joint, and world mode needs all joints homed: set it to the number of the others

error: [HAL]HALFILE = own.hal
  --> linear-delta.ini:56:11
   |
56 | HALFILE = own.hal
   |           ^^^^^^^ there is no such file, so LinuxCNC fails to start: expected own.hal or /usr/share/linuxcnc/hallib/own.hal

warning: [TRAJ]NO_FORCE_HOMING = 1
  --> linear-delta.ini:69:19
   |
69 | NO_FORCE_HOMING = 1
   |                   ^ programs may run before homing, from an unknown pose; remove the line

warning: [HAL]HALFILE = own.hal
  --> linear-delta.ini:56:11
   |
56 | HALFILE = own.hal
   |           ^^^^^^^ expected a line HALFILE = LIB:pkmkins.tcl: it passes the geometry to the module and adds its monitor, which reports errors

warning: [HAL]HALFILE = own.hal
  --> linear-delta.ini:56:11
   |
56 | HALFILE = own.hal
   |           ^^^^^^^ the drives are not judged from here on: own.hal is neither beside the INI file nor in /usr/share/linuxcnc/hallib

Proved: without a tool the machine reaches every pose within its axis limits:

[AXIS_X]
MIN_LIMIT = -80
MAX_LIMIT = 80
[AXIS_Y]
MIN_LIMIT = -80
MAX_LIMIT = 80
[AXIS_Z]
MIN_LIMIT = 0
MAX_LIMIT = 100

The machine does not fit together.
exit 1

"#]]
    );
}

#[test]
fn legs_homed_one_by_one_lean_too_much() {
    let bench = Bench::new()
        .spoilt("HOME_SEQUENCE = -1", "HOME_SEQUENCE = 0")
        .spoilt("HOME_OFFSET = 370", "HOME_OFFSET = 150");
    assert_data_eq!(
        bench.answer("check linear-delta.ini", ""),
        str![[r#"
linear-delta.ini
  joints         3 carriages
  mobility       legs constrain 3 of 6 motions, 3 of XYZ; joints or guides constrain ABC
  count          8 links + 2 loops - 9 joints = 1; mobility by count 6
  geometry hash  0x6e4a5df2 (compare with pin pkmkins.geometry-hash; 1850367474 on the panel)
  size           lengths in mm; at home the joints of all legs span 0.283 x 0.245 x 0.325 m: if that is wrong, correct LINEAR_UNITS
  order of legs  0 1 2, counter-clockwise seen from above, leg 0 at 90.0 degrees from X: number joints and drives in the same order
  tool tips      T1 at the platform joints
                 TOOL_DIRECTION = down: tools of positive length are below the platform's reference point
  home           joint HOME is that of the inverse kinematics at [TRAJ]HOME
  homing         keeps the limits of the legs from 127 of 200 sampled poses; see pkm homing
  nearest limit  axis Z at home: 90.000 mm, 0 to 100 mm allowed, 10.0 % margin; move [TRAJ]HOME if that is too little
  nearest legs   the center lines of legs 0 and 1 are 57.158 mm apart at home
                 the center lines of legs [..] mm apart, the smallest sampled within the axis limits, at [..]
  conditioning   0.5930 at home (0: singular); pkmkins stops the machine at 0.05, slows it from twice that
                 0.5926, the smallest found within the axis limits, at [..]
  carriage 0     152.914 to 364.051 mm in sampled poses of the axis limits; MIN_LIMIT 0, MAX_LIMIT 375
  carriage 1     132.168 to 365.304 mm in sampled poses of the axis limits; MIN_LIMIT 0, MAX_LIMIT 375
  carriage 2     130.995 to 365.641 mm in sampled poses of the axis limits; MIN_LIMIT 0, MAX_LIMIT 375
  axis limits    the machine reaches 100.0 % of the poses sampled in them; use pkm preflight to check that a program stays in those
  start          not tested: correct the errors first

warning: [JOINT_0]HOME_SEARCH_VEL = 20
   --> linear-delta.ini:125:19
    |
125 | HOME_SEARCH_VEL = 20
    |                   ^^ in 100 % of the poses within the axis limits carriage 0 is beyond its switch, from HOME_OFFSET = 150 to 375, and never finds it unless the switch is closed there: expected -20, or a switch that stays closed to that end

error: [JOINT_0]HOME_SEQUENCE = 0
   --> linear-delta.ini:128:17
    |
128 | HOME_SEQUENCE = 0
    |                 ^ between HOME and the switches at HOME_OFFSET the base joint of leg 0 is at 40.651 degrees, beyond its limit of 40 degrees; home more legs together, or move the switches

Proved: without a tool the machine reaches every pose within its axis limits:

[AXIS_X]
MIN_LIMIT = -80
MAX_LIMIT = 80
[AXIS_Y]
MIN_LIMIT = -80
MAX_LIMIT = 80
[AXIS_Z]
MIN_LIMIT = 0
MAX_LIMIT = 100

The machine does not fit together.
exit 1

"#]]
    );
}

#[test]
fn joints_of_a_pose_and_back() {
    let bench = Bench::new();
    assert_data_eq!(
        bench.answer("joints linear-delta.ini --pose 10 -20 50 0 0 0", ""),
        str![[r#"
joint_0 = 272.90342639807045
joint_1 = 285.04242451766345
joint_2 = 294.4523137073128
exit 0

"#]]
    );
    let joints =
        bench.answer("joints linear-delta.ini", "x,y,z,a,b,c\n10,-20,50,0,0,0\n0,0,90,0,0,0\n");
    let rows = joints.strip_suffix("exit 0\n").unwrap();
    let poses = bench.answer("pose linear-delta.ini", rows);
    let numbers: Vec<f64> =
        poses.lines().nth(1).unwrap().split(',').map(|word| word.parse().unwrap()).collect();
    let expected = [10.0, -20.0, 50.0, 0.0, 0.0, 0.0];
    for (number, expected) in numbers.iter().zip(expected) {
        // The accuracy of forward for 300 mm: 1e-10 of the size.
        assert!((number - expected).abs() < 1e-7, "{poses}");
    }
}

#[test]
fn poses_and_joints_without_an_answer() {
    let bench = Bench::new();
    assert_data_eq!(
        bench.answer("joints linear-delta.ini --pose 900 0 0 0 0 0", ""),
        str![[r#"
pkm: leg 0: the rod does not reach the platform anchor: too short by this length (too long if negative) (value 640.376); move the platform nearer to this guide or crank, or check ROD, BASE and GUIDE or AXIS [code -19]
exit 1

"#]]
    );
    let input = "x,y,z,a,b,c\n900,0,0,0,0,0\n0,0,50,0,0,0\n";
    assert_data_eq!(
        bench.answer("joints linear-delta.ini", input),
        str![[r#"
joint_0,joint_1,joint_2
,,
285.3634158062803,285.36341580628033,285.36341580628033
pkm: standard input:2: leg 0: the rod does not reach the platform anchor: too short by this length (too long if negative) (value 640.376); move the platform nearer to this guide or crank, or check ROD, BASE and GUIDE or AXIS [code -19]
exit 1

"#]]
    );
    assert_data_eq!(
        bench.answer("pose linear-delta.ini --joints 0 0 9000", ""),
        str![[r#"
pkm: no pose is reached from the last pose: the legs do not close, or a singularity lies between (value 0.0260425); jog the joints back to their last good values [code -33]
exit 1

"#]]
    );
}

#[test]
fn rows_that_are_none() {
    let bench = Bench::new();
    assert_data_eq!(
        bench.answer("joints linear-delta.ini --pose 1 2", ""),
        str![[r#"
pkm: --pose: found 2 numbers; expected X Y Z A B C
exit 2

"#]]
    );
    assert_data_eq!(
        bench.answer("joints linear-delta.ini", "x,y,z\n1,2,3\n"),
        str![[r#"
pkm: standard input:1: the header has no column a; expected x,y,z,a,b,c
exit 2

"#]]
    );
    let input = "x,y,z,a,b,c\n1,2,3,0,0,0\n1,two,3,0,0,0\n";
    assert_data_eq!(
        bench.answer("joints linear-delta.ini", input),
        str![[r#"
joint_0,joint_1,joint_2
239.45705212575072,237.31781383905528,238.27863718936715
pkm: standard input:3: "two" is not a number; expected one such as 12.5
exit 2

"#]]
    );
    assert_data_eq!(
        bench.answer("joints linear-delta.ini", "x,y,z,a,b,c\n1,2\n"),
        str![[r#"
joint_0,joint_1,joint_2
pkm: standard input:2: 2 cells; expected 6, as in the header
exit 2

"#]]
    );
}

#[test]
fn a_program_and_its_trace() {
    let bench = Bench::new().with("line.ngc", "G21 G90\nG1 X10 F6000\nM2\n");
    let words = "replay linear-delta.ini line.ngc --period 0.05 --plots drawn";
    let trace = bench.answer(words, "");
    assert!(trace.starts_with("time,line,x,y,z,a,b,c,joint_0,joint_1,joint_2\n"), "{trace}");
    let last =
        trace.lines().nth_back(1).unwrap().split(',').map(|cell| cell.parse::<f64>().unwrap());
    let last: Vec<f64> = last.collect();
    // LinuxCNC's home is that of the joints, within their rounding.
    let off =
        last[1..8].iter().zip([2.0, 10.0, 0.0, 90.0, 0.0, 0.0, 0.0]).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 1e-9, "{trace}");
    assert!(trace.ends_with("exit 0\n"), "{trace}");
    let drawn: Vec<_> = fs::read_dir(bench.0.path().join("drawn")).unwrap().collect();
    assert!(drawn.len() >= 5, "{drawn:?}");
}

#[test]
fn extra_axes_are_drawn_if_they_move() {
    let lathe = include_str!("../../configs/lathe-counter-spindle/lathe-counter-spindle.ini");
    let bench = Bench::new()
        .with("lathe.ini", lathe)
        .with(
            "lathe-counter-spindle.tbl",
            include_str!("../../configs/lathe-counter-spindle/lathe-counter-spindle.tbl"),
        )
        .with("turn.ngc", "G21 G90\nG1 C90 F600\nM2\n")
        .with("slide.ngc", "G21 G90\nG1 C90 W700 F600\nM2\n");
    for (program, moved) in [("turn", vec!["rotary"]), ("slide", vec!["linear", "rotary"])] {
        let words = format!("replay lathe.ini {program}.ngc --period 0.05 --plots {program}");
        assert!(bench.answer(&words, "").ends_with("exit 0\n"), "{program}");
        let files = fs::read_dir(bench.0.path().join(program)).unwrap();
        let names = files.map(|file| file.unwrap().file_name().into_string().unwrap());
        let mut drawn: Vec<String> =
            names.filter_map(|name| Some(name.strip_suffix("-extra-axes.svg")?.into())).collect();
        drawn.sort();
        assert_eq!(drawn, moved, "{program}");
    }
}

#[test]
fn a_program_that_leaves_the_limits() {
    let bench = Bench::new().with("far.ngc", "G21 G90\nG1 X79 F60000\nG1 X120\nM2\n");
    let answer = bench.answer("replay linear-delta.ini far.ngc --period 0.5", "");
    let reported: Vec<&str> = answer.lines().filter(|line| line.starts_with("pkm: ")).collect();
    assert_data_eq!(
        reported.join("\n"),
        str!["pkm: far.ngc: line 3: axis X reaches 120.000 mm, above 80"]
    );
}

#[test]
fn programs_that_are_none() {
    let bench = Bench::new()
        .with("empty.ngc", "")
        .with("nothing.ngc", "%\n%\n")
        .with("bad.ngc", "G21\nG1 X1 F100\nG1 G2 X3\n")
        .with("line.ngc", "G21 G90\nG1 X10 F6000\nM2\n")
        .with("file", "");
    assert_data_eq!(
        bench.answer("replay linear-delta.ini none.ngc", ""),
        str![[r#"
pkm: none.ngc: No such file or directory (os error 2)
exit 2

"#]]
    );
    assert_data_eq!(
        bench.answer("replay linear-delta.ini empty.ngc", ""),
        str![[r#"
pkm: empty.ngc:1: LinuxCNC stops the program: File ended with no percent sign; can't open FOLDER/empty.ngc; File ended with no percent sign or program end
exit 2

"#]]
    );
    assert_data_eq!(
        bench.answer("replay linear-delta.ini bad.ngc", ""),
        str![[r#"
pkm: bad.ngc:3: LinuxCNC stops the program: Two g codes used from same modal group
exit 2

"#]]
    );
    assert_data_eq!(
        bench.answer("replay linear-delta.ini line.ngc --period 0", ""),
        str![[r#"
pkm: --period 0: expected at least 0.000001 seconds
exit 2

"#]]
    );
    assert_data_eq!(
        bench.answer("replay linear-delta.ini line.ngc --period 1e-300", ""),
        str![[r#"
pkm: --period 0.000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000001: expected at least 0.000001 seconds
exit 2

"#]]
    );
    for command in ["replay", "preflight"] {
        assert_data_eq!(
            bench.answer(&format!("{command} linear-delta.ini nothing.ngc"), ""),
            str![[r#"
pkm: nothing.ngc: the program moves nothing; add a block such as G1 X10 F600
exit 2

"#]]
        );
    }
    let before = bench.files();
    let answer = bench.answer("replay linear-delta.ini line.ngc --plots file/plots", "");
    assert_data_eq!(
        answer,
        str![[r#"
pkm: file/plots: Not a directory (os error 20)
exit 2

"#]]
    );
    assert_eq!(bench.files(), before);
}

#[test]
fn help_and_usage() {
    let bench = Bench::new();
    assert_data_eq!(
        bench.answer("--help", ""),
        str![[r#"
Check parallel-kinematic machines and programs before cutting

Reads the machine from its LinuxCNC INI file and uses the same kinematics as the LinuxCNC module
pkmkins. `pkm design` and `pkm compare`, which help to choose a machine before it is built, come
with the Python package pkmkins.

Exit status: 0 if all is well, 1 if something does not fit, 2 if no verdict was possible: invalid
input, or a file that cannot be written.

Usage: pkm [OPTIONS] <COMMAND>

Machine:
  new          Make a complete LinuxCNC configuration of a machine
  migrate      Convert a configuration for an older LinuxCNC or another module
  check        Check that the files of a machine fit together
  homing       Simulate homing from sampled poses, and find a safe order
  frames       Draw the machine with its frames and signs
  view         Show a machine, and a program on it, as a page for browsers
  panel        Write an operator panel for AXIS and other GUIs
  boxes        Find and prove pose boxes for the start without a seed

Program:
  preflight    Check before cutting that a program fits the machine
  run          Run a program in LinuxCNC without hardware, faster than the machine
  travel       Show how far the machine can move from a pose
  filter       Pass a program to the LinuxCNC GUI only if it fits
  path         Write programs along curves, and report the joint motion
  replay       Write the joint values along a program
  random       Write a program of random moves that the machine can run

Calibration:
  measure      Write a program that stops for gauge readings, and their table
  calibrate    Find a machine's true geometry from measurements

Studies:
  workspace    Compute the workspace of the tool, and what limits it
  sensitivity  Compute the effect of joint errors on the pose, and the conditioning
  stiffness    Compute the stiffness at the tool tip
  rods         Report the positions of the legs along a program or list of poses
  dynamics     Compute the vibration of the machine
  stability    Compute the depth of cut at which chatter starts
  cut          Compute forces, deflection and vibration while a program cuts

Files and shell:
  joints       Compute joint values from poses (inverse kinematics)
  pose         Compute poses from joint values (forward kinematics)
  scene        Write the machine as one JSON object, for viewers
  export       Write the machine as a model for simulators
  man          Write the manual pages of pkm
  completions  Print shell completions of pkm

Options:
      --format <FORMAT>
          Output format: text, or one JSON value for programs (`pkm help reference/json`)
          
          [default: text]
          [possible values: text, json]

  -q, --quiet
          Print findings only, without progress and statistics

      --color <WHEN>
          Use colors; auto means on a terminal, unless NO_COLOR is set
          
          [default: auto]
          [possible values: auto, always, never]

  -h, --help
          Print help (see a summary with '-h')

  -V, --version
          Print version


Examples:
  pkm check hexapod.ini
      check that the machine fits together
  pkm preflight hexapod.ini part.ngc
      check that a program fits the machine
  pkm help preflight
      show a subcommand and its options
  pkm help guide
      show the guide; `reference` and `studies`, or any of their pages

See also: pkm-new(1), pkm-check(1), pkm-preflight(1), pkm help reference/pkm, pkm help
reference/json
exit 0

"#]]
    );
    assert_data_eq!(
        bench.answer("check --help", ""),
        str![[r#"
Check that the files of a machine fit together

Reads the INI file as LinuxCNC does, builds the machine as the module would, and reports what it
found: joints and mobility, geometry hash, unit and size, the order of the legs around the base,
leads and hands of the screws, the position of every tool tip, and the nearest limit at home.

Checks HOME of joints and axes against the kinematics; the homing order, and homing from any
position, against the pose limits; the HAL files (present, in order, wiring the drives and the
module's guard); misspelled names; joint ranges; the distance between legs and the conditioning, at
home and at worst. Every finding says what to do.

Then prints [AXIS_*] limits within which every pose without a tool is proved to keep all limits:
reach, joint ranges, cones, pyramids, tilt, the distance between legs and the conditioning. They
never exceed the axis limits in the file. For a machine that tilts it also reports whether the proof
holds with every tool of the tool table, how far X, Y and Z reach with a smaller tilt, also beyond
the axis limits, what ends them, and wider limits.

Finally LinuxCNC starts the machine in virtual time with its own HAL files: it switches on, homes,
moves each coordinate a little and back, and changes a tool. If LinuxCNC refuses anything, the
machine does not fit together. Hardware, and programs that HAL files start, are not run.

Two mechanisms are checked separately, each in its own letters. The distance between them is
computed at home and at sampled poses within the axis limits.

Exit status: 0 if all is well (there may be warnings), 1 if something does not fit, 2 if the file
describes no machine.

Usage: pkm check [OPTIONS] <MACHINE.ini>

Arguments:
  <MACHINE.ini>
          The machine's LinuxCNC INI file

Options:
      --mechanism <NUMBER>
          Mechanism to use (1 or 2) on a two-mechanism machine, in its own coordinates X Y Z A B C.
          By default check, boxes, run, preflight, travel and workspace use both; other subcommands
          use the first

      --fix
          Print a unified diff with corrections: HOME of joints and axes with all digits, axis
          limits that are missing or mostly out of reach, the homing order, and boxes of another
          geometry, proved again

      --write
          Write the corrections of --fix into the file

      --no-start
          Skip the start in virtual time

  -h, --help
          Print help (see a summary with '-h')

Options of every command:
      --format <FORMAT>
          Output format: text, or one JSON value for programs (`pkm help reference/json`)
          
          [default: text]
          [possible values: text, json]

  -q, --quiet
          Print findings only, without progress and statistics

      --color <WHEN>
          Use colors; auto means on a terminal, unless NO_COLOR is set
          
          [default: auto]
          [possible values: auto, always, never]

Examples:
  pkm check hexapod.ini
      print what was found, and everything that does not fit
  pkm check hexapod.ini --quiet
      print only what does not fit
  pkm check hexapod.ini --no-start
      skip the start in virtual time
  pkm check hexapod.ini --fix
      print corrections of the file as a diff
  pkm check hexapod.ini --fix --write
      write the corrections into the file

See also: pkm(1), pkm-homing(1), pkm-boxes(1), pkm-preflight(1), pkm help reference/pkm, pkm help
guide/drives
exit 0

"#]]
    );
    assert_data_eq!(
        bench.answer("chek", ""),
        str![[r#"
error: unrecognized subcommand 'chek'

  tip: a similar subcommand exists: 'check'

Usage: pkm [OPTIONS] <COMMAND>

For more information, try '--help'.
exit 2

"#]]
    );
    assert_data_eq!(
        bench.answer("new lathe", ""),
        str![[r#"
error: unrecognized subcommand 'lathe'

  tip: some similar subcommands exist: 'four-rod-lathe', 'six-rod-lathe'

Usage: pkm new [OPTIONS] [COMMAND]

For more information, try '--help'.
exit 2

"#]]
    );
    assert_data_eq!(
        bench.answer("check -", ""),
        str![[r#"
error: invalid value '-' for '<MACHINE.ini>': a machine is read together with the files beside it, not from standard input: name its INI file

For more information, try '--help'.
exit 2

"#]]
    );
    for command in ["panel -", "filter --machine - a.ngc"] {
        let reported = bench.answer(command, "");
        assert!(
            reported.contains("not from standard input: name its INI file"),
            "{command}: {reported}"
        );
    }
}

#[test]
fn a_program_that_fits() {
    let bench =
        Bench::new().with("good.ngc", "G21 G90\nM52 P1\nG0 X-70 Y45 Z60\nG1 X70 F3000\nM2\n");
    assert_data_eq!(
        bench.answer("preflight linear-delta.ini good.ngc", ""),
        str![[r#"
good.ngc on linear-delta.ini
  moves              3, 228.5 mm long
  time               3.9 s
  axis range         10.0000 mm to spare: axis X, line 3
  joint range        49.6265 mm to spare: carriage 2, line 3
  base cone          16.3241 degrees to spare: the base joint of leg 2, line 4
  clearance of legs  7.1577 mm to spare: the distance between legs 0 and 2, line 3
  conditioning       0.5077 to spare: the conditioning, line 4
  joint speed        149.2800 mm/s to spare: the speed of carriage 2, line 3
  joint acceleration 3023.0556 mm/s² to spare: the acceleration of carriage 2, line 3
  axis X             -70.000 to 70.000 of -80 to 80 mm
  axis Y             0.000 to 45.000 of -80 to 80 mm
  axis Z             60.000 to 90.000 of 0 to 100 mm
  carriage 0         305.344 to 325.367 of 0 to 375 mm
  carriage 1         223.761 to 325.367 of 0 to 375 mm
  carriage 2         223.761 to 325.368 of 0 to 375 mm
  feed               joint speeds allow 1.990 times the programmed feed, in line 3

The program fits the machine.
exit 0

"#]]
    );
    let reported =
        bench.answer("preflight linear-delta.ini good.ngc --format json --report r.html", "");
    let json: serde_json::Value =
        serde_json::from_str(reported.split_once("exit ").unwrap().0).unwrap();
    assert_eq!((&json["version"], json["breaks"].as_array().map(Vec::len)), (&1.into(), Some(0)));
    let page = fs::read_to_string(bench.0.path().join("r.html")).unwrap();
    assert!(page.contains("fits the machine") && page.contains("<svg"));
    // A self-contained page names no other file.
    assert!(!page.contains("src=") && !page.contains("href="));
}

/// LinuxCNC stops it in its first line: the later motion of its joints was not observed.
#[test]
fn the_page_of_a_stopped_program_calls_no_limit_kept_that_was_not_judged_to_the_end() {
    let bench = Bench::new().with("far.ngc", "M52 P1\nG1 X0 Y200 Z60 F3000\nG1 X10\nM2\n");
    bench.answer("preflight linear-delta.ini far.ngc --report r.html", "");
    let page = fs::read_to_string(bench.0.path().join("r.html")).unwrap();
    let rows: Vec<&str> =
        page.split("<tr").filter(|row| row.contains("<th scope=\"row\"")).collect();
    let row = |name: &str| *rows.iter().find(|row| row.contains(&format!(">{name}<"))).unwrap();
    // Even without its limits LinuxCNC cannot go on, so the rest of the path is unknown as well.
    for name in ["joint speed", "joint acceleration", "conditioning"] {
        let row = row(name);
        assert!(row.contains("? not judged") && row.contains("up to the stop"), "{row}");
    }
    assert!(row("LinuxCNC").contains("broken"));
}

#[test]
fn programs_that_do_not_fit() {
    let bench = Bench::new()
        .spoilt("MAX_LIMIT = 375", "MAX_LIMIT = 330")
        .with("middle.ngc", "G21 G90\nG0 X-75 Y75 Z70\n(both ends fine)\nG1 X75 F3000\nM2\n")
        .with("far.ngc", "G1 X0 Y200 Z60 F3000\nM52 P0\nM3 S60\nG33 Z50 K1\nM2\n");
    assert_data_eq!(
        bench.answer("preflight linear-delta.ini middle.ngc", ""),
        str![[r#"
middle.ngc on linear-delta.ini
  moves              3, 257.9 mm long
  time               2.0 s, then LinuxCNC stops it
  axis range         5.0000 mm to spare: axis X, line 2
  joint range        3.2650 mm beyond: carriage 0, line 4
  base cone          8.0476 degrees to spare: the base joint of leg 2, line 4
  clearance of legs  7.1577 mm to spare: the distance between legs 0 and 1, line 2
  conditioning       0.5035 to spare: the conditioning, line 4
  joint speed        119.1044 mm/s to spare: the speed of carriage 2, line 2 (up to the stop)
  joint acceleration 2251.9712 mm/s² to spare: the acceleration of carriage 2, line 2 (up to the stop)
  axis X             -75.000 to 75.000 of -80 to 80 mm
  axis Y             0.000 to 75.000 of -80 to 80 mm
  axis Z             70.000 to 90.000 of 0 to 100 mm
  carriage 0         322.356 to 333.432 of 0 to 330 mm
  carriage 1         202.126 to 325.365 of 0 to 375 mm
  carriage 2         202.126 to 325.365 of 0 to 375 mm
  feed               joint speeds allow 1.658 times the programmed feed, in line 2 (up to the stop)
  runs               54.9 % of the path before the first limit

error: line 4: joint range: carriage 0 violates its limit of 0 to 330 mm on this move by 3.2650 mm
  G1 X75 F3000
  at X-41.3333 Y75.0000 Z70.0000

error: line 4: LinuxCNC: LinuxCNC stops here: Exceeded POSITIVE soft limit (330.00000) on joint 0; Hint: switch to joint mode to jog off soft limit
  G1 X75 F3000
  at X-37.[..] Y75.0000 Z70.0000

warning: the program has no M52 P1, so the guard cannot slow the feed: add it at the start (LinuxCNC 2.9 loses it in the startup code)

help: the program fits with its work offset shifted by X 0 Y -35.04 Z 0 mm: verified with the whole program.
  Clamp the workpiece there, and run once before the program:
  G10 L2 P0 X[#[5201 + 20*#5220]] Y[#[5202 + 20*#5220] + -35.04] Z[#[5203 + 20*#5220]]

The program does not fit the machine.
exit 1

"#]]
    );
    assert_data_eq!(
        bench.answer("preflight linear-delta.ini far.ngc", ""),
        str![[r#"
far.ngc on linear-delta.ini
  moves              2, 202.2 mm long (up to line 1)
  time               0.0 s, then LinuxCNC stops it
  axis range         120.0000 mm beyond: axis Y, line 1 (up to line 1)
  joint range        12.4602 mm beyond: carriage 0, line 1 (up to line 1)
  base cone          15.2543 degrees beyond: the base joint of leg 1, line 1 (up to line 1)
  clearance of legs  6.1432 mm to spare: the distance between legs 0 and 1, line 1 (up to line 1)
  conditioning       0.5327 to spare: the conditioning, line 1 (up to line 1)
  joint speed        300.0000 mm/s to spare: the speed of carriage 0, before the program (up to the stop)
  joint acceleration 5000.0000 mm/s² to spare: the acceleration of carriage 0, before the program (up to the stop)
  axis X             0.000 to 0.000 of -80 to 80 mm (up to line 1)
  axis Y             0.000 to 200.000 of -80 to 80 mm (up to line 1)
  axis Z             60.000 to 90.000 of 0 to 100 mm (up to line 1)
  carriage 0         325.363 to 342.489 of 0 to 330 mm (up to line 1)
  carriage 1         76.642 to 325.385 of 0 to 375 mm (up to line 1)
  carriage 2         76.642 to 325.385 of 0 to 375 mm (up to line 1)
  runs               0.0 % of the path (up to line 1) before LinuxCNC stops it

error: line 1: joint range: carriage 0 violates its limit of 0 to 330 mm on this move by 12.4602 mm
  G1 X0 Y200 Z60 F3000
  at X0.0000 Y12.5463 Z88.1180

error: line 1: axis range: axis Y violates its limit of -80 to 80 mm on this move by 120.0000 mm
  G1 X0 Y200 Z60 F3000
  at X0.0000 Y80.0000 Z78.0000

error: line 1: base cone: the base joint of leg 1 violates its limit of 40 degrees on this move by 15.2543 degrees
  G1 X0 Y200 Z60 F3000
  at X0.0000 Y145.7890 Z68.1317

error: line 1: base cone: the base joint of leg 2 violates its limit of 40 degrees on this move by 15.2543 degrees
  G1 X0 Y200 Z60 F3000
  at X0.0000 Y145.7890 Z68.1317

error: line 1: reach: carriage 0 comes too close to a dead point
  G1 X0 Y200 Z60 F3000
  at X0.0000 Y178.7115 Z63.1933

error: line 1: LinuxCNC: LinuxCNC stops here: Linear move on line 1 would exceed Y's positive limit
  G1 X0 Y200 Z60 F3000
  at X0.0000 Y0.0000 Z90.0000

warning: line 2: M52 P0 switches adaptive feed off, so the guard cannot slow the feed; remove it

warning: line 4: G33 follows the spindle: neither feed override nor the guard can slow it

warning: the program has neither G20 nor G21, so its lengths are in the units of RS274NGC_STARTUP_CODE, else in mm: add one of them

help: the program fits with its work offset shifted by X 0 Y -124.36 Z 0 mm: verified with the whole program.
  Clamp the workpiece there, and run once before the program:
  G10 L2 P0 X[#[5201 + 20*#5220]] Y[#[5202 + 20*#5220] + -124.36] Z[#[5203 + 20*#5220]]

The program does not fit the machine.
exit 1

"#]]
    );
}

#[test]
fn programs_that_are_not_judged() {
    let bench = Bench::new().with("empty.ngc", "").with("bad.ngc", "G21\nG1 X1 F0\nG99\nM2\n");
    assert_data_eq!(
        bench.answer("preflight linear-delta.ini none.ngc", ""),
        str![[r#"
pkm: none.ngc: No such file or directory (os error 2)
exit 2

"#]]
    );
    assert_data_eq!(
        bench.answer("preflight linear-delta.ini empty.ngc", ""),
        str![[r#"
pkm: FOLDER/empty.ngc:1: LinuxCNC stops here: File ended with no percent sign; can't open FOLDER/empty.ngc; File ended with no percent sign or program end
exit 2

"#]]
    );
    assert_data_eq!(
        bench.answer("preflight linear-delta.ini bad.ngc", ""),
        str![[r#"
pkm: FOLDER/bad.ngc:2: LinuxCNC stops here: Cannot do g1 with zero feed rate
exit 2

"#]]
    );
    let bench = bench.with("good.ngc", "G21 G1 X10 F600\nM2\n");
    let files = bench.files();
    assert_data_eq!(
        bench.answer("preflight linear-delta.ini good.ngc --report none/r.html", ""),
        str![[r#"
pkm: none/r.html: No such file or directory (os error 2)
exit 2

"#]]
    );
    assert_eq!(bench.files(), files);
}

#[test]
fn several_programs_and_a_folder() {
    let bench = Bench::new()
        .with("all/a.ngc", "G21 G90 M52 P1\nG1 X10 F600\nM2\n")
        .with("all/b.nc", "G21 G90 M52 P1\nG1 Y200 F600\nM2\n")
        .with("all/notes.txt", "none")
        .with("all/c.ngc", "G21\nG1 G2 X3\nM2\n");
    let reported = bench.answer("preflight linear-delta.ini all", "");
    let lines: Vec<&str> = reported.lines().collect();
    let table = lines.iter().position(|line| line.starts_with("all/a.ngc  ")).unwrap();
    assert_data_eq!(
        lines[table..table + 3].join("\n"),
        str![[r#"
all/a.ngc  fits          1.1 s
all/b.nc   does not fit  line 2: [..]
all/c.ngc  not judged    FOLDER/all/c.ngc:2: LinuxCNC stops here: Two g codes used from same modal group
"#]]
    );
    assert!(reported.ends_with("exit 2\n"), "{reported}");
    let reported = bench.answer("preflight linear-delta.ini --format json all/b.nc all/c.ngc", "");
    let json = reported.split("\n]\n").next().unwrap().to_string() + "]";
    let json = &json[json.find('[').unwrap()..];
    let list: serde_json::Value =
        serde_json::from_str(json).unwrap_or_else(|e| panic!("{e}: {reported}"));
    assert_eq!((&list[0]["fits"], &list[1]["fits"]), (&false.into(), &serde_json::Value::Null));
    assert!(list[1]["error"].as_str().unwrap().contains("Two g codes"), "{list}");
    assert!(bench.answer("preflight linear-delta.ini all/b.nc all/b.nc", "").ends_with("exit 1\n"));
    for (words, said) in [
        ("all --report r.html", "--report works with a single program"),
        ("all --trace t.csv", "--trace works with a single program"),
        ("none", "none: No such file or directory"),
    ] {
        let reported = bench.answer(&format!("preflight linear-delta.ini {words}"), "");
        assert!(reported.contains(said) && reported.ends_with("exit 2\n"), "{reported}");
    }
}

#[test]
fn every_subcommand_has_a_manual_page_and_completions() {
    let bench = Bench::new();
    assert_eq!(bench.answer("man pages", ""), "exit 0\n");
    let help = bench.answer("--help", "");
    for name in [
        "check",
        "preflight",
        "filter",
        "scene",
        "export",
        "panel",
        "travel",
        "joints",
        "pose",
        "replay",
        "rods",
        "sensitivity",
        "stiffness",
        "stability",
        "dynamics",
        "cut",
        "workspace",
        "boxes",
        "random",
        "measure",
        "calibrate",
        "man",
        "completions",
    ] {
        assert!(help.contains(&format!("\n  {name} ")), "{name}: {help}");
        let page = fs::read_to_string(bench.0.path().join(format!("pages/pkm-{name}.1"))).unwrap();
        assert!(page.contains(".SH SYNOPSIS"), "{page}");
        for shell in ["bash", "zsh", "fish"] {
            assert!(bench.answer(&format!("completions {shell}"), "").contains(name), "{shell}");
        }
    }
    for page in ["pkm", "pkm-stability-pose", "pkm-stability-lag"] {
        assert!(bench.0.path().join(format!("pages/{page}.1")).exists());
    }
    let pages: Vec<_> = fs::read_dir(bench.0.path().join("pages")).unwrap().flatten().collect();
    for page in pages {
        let text = fs::read_to_string(page.path()).unwrap();
        let [examples, see] = [".SH EXAMPLES\n.TP\n\\fBpkm ", ".SH \"SEE ALSO\"\n"];
        assert!(text.contains(examples) && text.contains(see), "{:?}: {text}", page.path());
        // The pages and files that it refers to exist.
        let end = text.rsplit_once(see).unwrap().1.replace('\\', "");
        for name in end.trim().split(", ") {
            let file = match name.strip_suffix("(1)") {
                Some(name) => bench.0.path().join(format!("pages/{name}.1")),
                None => {
                    let page = name.strip_prefix("pkm help ").unwrap();
                    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../docs/{page}.md"))
                }
            };
            assert!(file.exists(), "{:?}: {name}", page.path());
        }
    }
}

#[test]
fn a_folder_that_cannot_be_written() {
    let bench = Bench::new().with("file", "");
    assert_data_eq!(
        bench.answer("man file/pages", ""),
        str![[r#"
pkm: file/pages: Not a directory (os error 20)
exit 2

"#]]
    );
}

#[test]
fn boxes_are_proved_and_found() {
    let bench = Bench::new();
    assert_data_eq!(
        bench.answer("boxes linear-delta.ini", ""),
        str![[r#"
[BOX_0] proved with 19 cells: contraction [..]
exit 0

"#]]
    );
    let bench = bench.spoilt(" boxes=1", "").spoilt("[BOX_0]", "[OLD_BOX]");
    let found = bench.answer("boxes linear-delta.ini", "");
    assert!(found.starts_with("# boxes=1 in [KINS]KINEMATICS\n"), "{found}");
    assert!(found.contains("[BOX_0]\nLOW = ") && found.ends_with("exit 0\n"), "{found}");
    let bench = bench.spoilt("[AXIS_Z]\nTYPE = LINEAR\nMIN_LIMIT", "[AXIS_Z]\nOLD");
    assert_data_eq!(
        bench.answer("boxes linear-delta.ini", ""),
        str![[r#"
pkm: linear-delta.ini: an axis that the legs move has no MIN_LIMIT or MAX_LIMIT; add both
exit 1

"#]]
    );
}

#[test]
fn a_random_program_runs_through_preflight() {
    let bench = Bench::new();
    let program = bench.answer("random linear-delta.ini --seed 3 --seconds 20", "");
    let bench = bench.with("random.ngc", program.strip_suffix("exit 0\n").unwrap());
    let reported = bench.answer("preflight linear-delta.ini random.ngc", "");
    assert!(reported.ends_with(FITS), "{reported}");
    assert_data_eq!(
        bench.answer("random linear-delta.ini --seconds nan", ""),
        str![[r#"
pkm: --seconds NaN: expected more than 0 and at most 86400
exit 2

"#]]
    );
}

#[test]
fn a_closed_output_changes_no_exit_code() {
    let bench = Bench::new().with("good.ngc", "G21 G1 X10 F600\nM2\n");
    for (words, code) in [
        ("check linear-delta.ini", 0),
        ("preflight linear-delta.ini good.ngc", 0),
        ("joints linear-delta.ini", 0),
        ("completions bash", 0),
        ("rods linear-delta.ini good.ngc", 0),
        ("replay linear-delta.ini good.ngc --period 0.001", 0),
        ("check linear-delta.ini --format json", 0),
        ("rods linear-delta.ini good.ngc --format json", 0),
        ("workspace linear-delta.ini --bands 4 --grid 4 --quiet", 0),
        ("--help", 0),
    ] {
        let mut child = bench.command(words).spawn().unwrap();
        drop(child.stdout.take());
        let mut input = child.stdin.take().unwrap();
        let rows = "0,0,50,0,0,0\n".repeat(20_000);
        let _ = input.write_all(format!("x,y,z,a,b,c\n{rows}").as_bytes());
        drop(input);
        let mut reported = String::new();
        child.stderr.take().unwrap().read_to_string(&mut reported).unwrap();
        assert_eq!((child.wait().unwrap().code(), reported.as_str()), (Some(code), ""), "{words}");
    }
}

#[test]
fn no_colors_and_no_bar_go_into_a_pipe() {
    let bench = Bench::new().spoilt("HALFILE = LIB:pkmkins.tcl", "HALFILE = own.hal");
    let output = bench.command("check linear-delta.ini").env_remove("NO_COLOR").output().unwrap();
    assert!(!output.stdout.contains(&0x1b), "{}", String::from_utf8_lossy(&output.stdout));
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
}

/// The folder of subroutines is named relative to that of the INI file.
#[test]
fn a_line_of_a_subroutine_is_reported_with_its_file() {
    let bench = Bench::new().spoilt("[RS274NGC]\n", "[RS274NGC]\nSUBROUTINE_PATH = .\n");
    let program = "G21 F6000 M52 P1\nG0 Z80\nG0 X1\no<away> call\nG0 X0\nM2\n";
    let away = "o<away> sub\n\n\n\n\nG1 X75 Y75\no<away> endsub\nM2\n";
    let bench = bench.with("p.ngc", program).with("away.ngc", away);
    let reported = bench.answer("preflight linear-delta.ini p.ngc --report p.html", "");
    // From the path, and from LinuxCNC's cycles, which have only the line.
    for part in ["  axis range ", "  joint speed ", "  feed "] {
        let line = reported.lines().find(|line| line.starts_with(part));
        assert!(line.is_some_and(|line| line.ends_with("FOLDER/away.ngc, line 6")), "{reported}");
    }
    let page = fs::read_to_string(bench.0.path().join("p.html")).unwrap();
    let (all, named) = (page.matches("line 6").count(), page.matches("away.ngc, line 6").count());
    assert!(named >= 6 && all == named, "{named} of {all}");
}
