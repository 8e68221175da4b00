// SPDX-License-Identifier: GPL-2.0-or-later
//! The INI file of a new machine, with comments for the integrator.

use crate::anchors::{self, Leg};
use crate::carried::{Carried, CarriedJoint};
use crate::constraints::Constraint;
use crate::kinds::{Homing, MachineKind};
use crate::parameters::{JOINT_ANGLE, TABLE};
use crate::values::{Values, rounded};
use crate::wrist::{self, Wrist};
use keys::{leg as of_leg, machine as of_machine};
use kinematics::leg;
use kinematics::{Letter, POSE_LETTERS};
use machine::digits::{list, plain};
use machine::proof::axis_box::AxisBox;
use std::fmt::Write;

/// Required distance of the legs' center lines, in diameters.
const CLEARANCE: f64 = 1.2;

/// Servo period, nanoseconds.
const PERIOD: u32 = 1_000_000;

/// The user interface of a machine that has none yet.
const DISPLAY: &str = "DISPLAY = axis\nPOSITION_OFFSET = RELATIVE\nPOSITION_FEEDBACK = ACTUAL\nMAX_FEED_OVERRIDE = 1.0\n";

/// Lag of a drive at its largest speed, in servo cycles, as for the shipped machines.
const LAG: f64 = 4.0;

/// Tolerated share of the following error at standstill.
const STANDSTILL: f64 = 0.25;

/// Significant digits of speeds and distances that follow from given ones: drives need fewer.
const DIGITS: i32 = 7;

/// Smallest following error, mm, or degrees for an arm.
const LEAST_ERROR: [f64; 2] = [1.0, 0.5];

/// A new machine. Unknown values are omitted from its file, or are 0 or 1.
#[derive(Clone, Debug)]
pub struct Plan<'a> {
    /// Its name, also the name of its files.
    pub name: &'a str,
    pub kind: &'static MachineKind,
    /// The given values.
    pub values: &'a Values,
    pub legs: Vec<Leg>,
    /// Letters that the legs move.
    pub coordinates: String,
    /// Position of the tool at home, machine units.
    pub home: [f64; 3],
    /// Axes BASE_N of the cardan joints, for struts with leads.
    pub cardans: Vec<[f64; 3]>,
    /// Values of the joints at home.
    pub joints: Vec<f64>,
    pub limits: Option<AxisBox>,
    /// Largest speed and acceleration of every joint.
    pub speeds: Vec<[f64; 2]>,
    /// Sections of boxes, and their number.
    pub boxes: (String, usize),
    /// Values of the older configuration, if one is migrated.
    pub carried: Option<Carried>,
}

impl Plan<'_> {
    /// Returns the smallest and largest value of the legs' joints.
    pub fn range(&self) -> [f64; 2] {
        let name = match self.kind.leg {
            leg::Kind::Slider => "carriage",
            leg::Kind::Crank => "angle",
            _ => "strut",
        };
        self.values.list(name).unwrap_or_default()
    }

    /// Returns the letters that the table moves; a head may have none.
    pub fn table(&self) -> &'static str {
        let travel = self.values.list::<2>(TABLE.name);
        if travel.is_some() { self.kind.table } else { "" }
    }

    /// Returns the constraints of the platform.
    pub fn constraints(&self) -> Vec<Constraint> {
        (self.kind.constraints)(self.values, &self.legs)
    }

    /// Returns the letters that anything moves, in LinuxCNC's order.
    pub fn letters(&self) -> Vec<Letter> {
        let is_moved = |letter: &Letter| {
            [self.coordinates.as_str(), self.table()].concat().contains(letter.name())
        };
        Letter::ALL.into_iter().filter(is_moved).collect()
    }

    /// Returns whether the letters include an angle.
    pub fn tilts(&self) -> bool {
        self.letters().iter().any(|letter| letter.is_angle())
    }

    /// Returns the letters of extra axes.
    fn extra(&self) -> &str {
        match &self.carried {
            Some(carried) => &carried.extra,
            None if Wrist::of(self).is_some() => wrist::LETTERS,
            None => "",
        }
    }

    pub fn all_joints(&self) -> usize {
        self.legs.len() + self.table().len() + self.extra().len()
    }

    /// Returns the largest speed and acceleration along X Y Z and of angles, per second.
    pub fn motion(&self) -> [[f64; 2]; 2] {
        if let Some(carried) = &self.carried {
            return carried.motion.map(|most| most.map(plain));
        }
        let turn = self.values.number("turn");
        let feed = rounded(DIGITS, self.values.number("feed") / 60.0);
        [[feed, self.values.number("accel")], [turn, plain(10.0 * turn)]]
    }

    /// Returns the initial speeds of a user interface, along X Y Z and of angles.
    fn start(&self) -> [f64; 2] {
        let [[feed, _], [turn, _]] = self.motion();
        let usual = [rounded(DIGITS, 0.2 * feed), rounded(DIGITS, 0.5 * turn)];
        let carried = self.carried.as_ref();
        carried.map_or(usual, |carried| [carried.start[0].min(feed), carried.start[1].min(turn)])
    }

    /// Returns whether programs have words of degrees.
    fn turns(&self) -> bool {
        self.tilts() || self.extra().contains(['A', 'B', 'C'])
    }

    pub fn text(&self) -> String {
        let parts = [
            self.head(),
            self.interface(),
            self.machine(),
            self.geometry(),
            self.boxes.0.clone(),
            (0..self.all_joints()).map(|n| self.joint(n)).collect(),
            self.letters().into_iter().map(|letter| self.axis(letter)).collect(),
            self.extra().chars().map(|letter| self.extra_axis(letter)).collect(),
        ];
        parts.concat()
    }

    fn head(&self) -> String {
        let Self { name, kind, .. } = self;
        let unit = self.values.unit();
        if let Some(carried) = &self.carried {
            let paragraphs: Vec<String> = carried.about.iter().map(|text| comment(text)).collect();
            return paragraphs.join("#\n");
        }
        let proved = match Wrist::of(self) {
            None => {
                "The axis limits are proved: without a tool the machine reaches every pose between them."
            }
            Some(_) => {
                "The limits of X Y Z are proved with the wrist at 0: without a tool the machine reaches every pose between \
                 them. Run pkm preflight before programs that tilt the tool."
            }
        };
        let text = format!(
            "{name}, {} ({}); lengths in {unit}. Made by pkm new. {} HOME of every joint comes from the \
             kinematics at [TRAJ]HOME. {proved} Run pkm check after a change of dimensions.",
            kind.text, kind.name, kind.frame
        );
        comment(&text)
    }

    /// Returns the settings that LinuxCNC needs besides the machine itself.
    fn interface(&self) -> String {
        let Self { name, .. } = self;
        let [[feed, _], [turn, _]] = self.motion();
        let [start, start_turn] = self.start();
        let angular = match self.turns() {
            true => {
                format!("DEFAULT_ANGULAR_VELOCITY = {start_turn}\nMAX_ANGULAR_VELOCITY = {turn}\n")
            }
            false => String::new(),
        };
        let carried = self.carried.as_ref();
        let display = carried.map_or(DISPLAY, |carried| &carried.display);
        let period = carried.map_or(PERIOD, |carried| carried.period);
        let (code, blend) =
            if self.values.unit() == "mm" { ("G21", 0.01) } else { ("G20", 0.0005) };
        format!(
            "
[EMC]
VERSION = 1.1
MACHINE = {name}
DEBUG = 0

# The user interface. It draws the path of the control point X Y Z, at any tilt.
[DISPLAY]
{display}PYVCP = {name}-panel.xml
CYCLE_TIME = 0.1
PROGRAM_PREFIX = programs
OPEN_FILE = programs/first.ngc
GEOMETRY = XYZ
DEFAULT_LINEAR_VELOCITY = {start}
MAX_LINEAR_VELOCITY = {feed}
{angular}
[RS274NGC]
PARAMETER_FILE = {name}.var
RS274NGC_STARTUP_CODE = {code} G17 G40 G49 G54 G64 P{blend} G80 G90 G94

[EMCMOT]
EMCMOT = motmod
COMM_TIMEOUT = 1.0
SERVO_PERIOD = {period}

[TASK]
TASK = milltask
CYCLE_TIME = 0.002

[EMCIO]
EMCIO = io
CYCLE_TIME = 0.050
TOOL_TABLE = {name}.tbl

# The first file loads the kinematics, the motion controller and simulated drives: on real hardware
# replace it by your own file that loads hardware and drives. The second file passes the geometry
# below to the kinematics; keep it.
[HAL]
HALFILE = LIB:pkmkins_sim.tcl
HALFILE = LIB:pkmkins.tcl
POSTGUI_HALFILE = {name}-panel.tcl

# With any user interface: a 3D model of the machine, and slower jogs near limits.
[APPLICATIONS]
APP = pkmkins-vismach {name}.ini
APP = haltcl $HALLIB_DIR/pkmkins_jog.tcl
"
        )
    }

    /// Returns the coordinates and their speeds.
    fn machine(&self) -> String {
        let letters: String = self.letters().iter().map(|letter| letter.name()).collect();
        let mut letters: Vec<char> = letters.chars().chain(self.extra().chars()).collect();
        letters.sort_by_key(|letter| POSE_LETTERS.iter().position(|known| known == letter));
        let letters: String = letters.into_iter().collect();
        let extra = match self.extra() {
            "" => String::new(),
            extra => format!(" axes={extra}"),
        };
        let [start, start_turn] = self.start();
        let kind = self.kind.leg.name();
        let table = match self.table() {
            "" => String::new(),
            table => format!(" table={table}"),
        };
        let boxes = match self.boxes.1 {
            0 => String::new(),
            count => format!(" boxes={count}"),
        };
        let constraints = match self.constraints().len() {
            0 => String::new(),
            count => format!(" constraints={count}"),
        };
        let [[feed, accel], [turn, turn_accel]] = self.motion();
        let angular = match self.turns() {
            true => format!(
                "DEFAULT_ANGULAR_VELOCITY = {start_turn}\nMAX_ANGULAR_VELOCITY = {turn}\n\
                 DEFAULT_ANGULAR_ACCELERATION = {turn_accel}\nMAX_ANGULAR_ACCELERATION = {turn_accel}\n"
            ),
            false => String::new(),
        };
        let home = list(&self.home);
        format!(
            "
# The kind and number of the legs, and the letters that they move.
[KINS]
KINEMATICS = pkmkins legs={kind}:{} coordinates={}{table}{extra}{boxes}{constraints}
JOINTS = {}

# HOME is the pose of the machine with all joints at their HOME. Speeds and accelerations of the
# tool; those of the joints below follow from them.
[TRAJ]
COORDINATES = {letters}
HOME = {home} 0 0 0
LINEAR_UNITS = {}
ANGULAR_UNITS = degree
DEFAULT_LINEAR_VELOCITY = {start}
MAX_LINEAR_VELOCITY = {feed}
DEFAULT_LINEAR_ACCELERATION = {accel}
MAX_LINEAR_ACCELERATION = {accel}
{angular}",
            self.legs.len(),
            self.coordinates,
            self.all_joints(),
            self.values.unit(),
        )
    }

    fn geometry(&self) -> String {
        let mut text = String::from("\n# The whole machine.\n[PKM]\n");
        if let Some(carried) = &self.carried {
            text += &carried.machine;
        } else if self.kind.leg == leg::Kind::Strut {
            // Struts with leads need values that are known only after home.
            let lead = if self.cardans.is_empty() { 0.0 } else { self.lead(0) };
            text += &line(of_machine::SCREW_LEAD.name, &[lead]);
        }
        if let Some(direction) = self.direction() {
            text += &format!(
                "# The direction of tools. Lengths in the tool table, and a SPINDLE_OFFSET here, are {}.\n{} = {direction}\n",
                if direction == "up" { "negative" } else { "positive" },
                of_machine::TOOL_DIRECTION.name
            );
        }
        if !self.table().is_empty() && self.constraints().is_empty() {
            let centre = [0.0, 0.0, self.values.number("nose")];
            text += "# The platform point that stays at 0 in letters that no joint moves.\n";
            text += &line(of_machine::CENTRE.name, &centre);
        }
        text += &match self.values.number("diameter") {
            0.0 => "# The thickness of the legs was not given, so it is not judged. Set ROD_CLEARANCE to the minimum distance\n# between center lines: their diameter and some margin.\n".into(),
            diameter => format!(
                "# The legs are {diameter} thick; the minimum distance between center lines is a fifth more.\n{}",
                line(of_machine::ROD_CLEARANCE.name, &[rounded(DIGITS, CLEARANCE * diameter)])
            ),
        };
        text += match &self.carried {
            Some(_) => {
                "\n# Dimensions of every leg. BASE_CONE is the largest swing of its base joint from its direction at home, in\n# degrees: add it to every leg, such as BASE_CONE = 40; without it the swing is not judged.\n"
            }
            None if self.cone().is_empty() => {
                "\n# Dimensions of every leg: measure them on the machine.\n"
            }
            None => {
                "\n# Dimensions of every leg: measure them on the machine. BASE_CONE is the largest swing of its base joint\n# from its direction at home, in degrees.\n"
            }
        };
        if !self.cardans.is_empty() {
            text += "# The sign of LEAD is for a left-hand screw. BASE_N and PLATFORM_N are the base-fixed and platform-fixed axes of\n# the cardan joints: here level and across the strut at home. Enter those of your joints.\n";
        }
        let legs: Vec<String> = (0..self.legs.len()).map(|n| self.leg(n)).collect();
        let wrist = Wrist::of(self).map_or(String::new(), |wrist| wrist.chain());
        text + &legs.join("\n") + &self.constraint_sections() + &wrist
    }

    fn constraint_sections(&self) -> String {
        let sections = self.constraints().into_iter().enumerate().map(|(n, constraint)| {
            let Constraint { about, kind, numbers } = constraint;
            let about = if about.is_empty() { String::new() } else { comment(about) };
            let numbers: String =
                numbers.iter().map(|(key, numbers)| line(key.name, numbers)).collect();
            format!("\n{about}[CONSTRAINT_{n}]\nKIND = {kind}\n{numbers}")
        });
        sections.collect()
    }

    /// Returns whether the platform is above the base, or on the other side of the rails of a lathe.
    pub fn is_up(&self) -> bool {
        anchors::is_up(self.values)
    }

    /// Returns the direction of tools along Z, if any.
    pub fn direction(&self) -> Option<&str> {
        if let Some(carried) = &self.carried {
            return carried.direction;
        }
        match self.values.word("tool") {
            _ if self.kind.is_lathe() => None,
            given => Some(given),
        }
    }

    /// Returns the lead of a strut, with the sign of its hand.
    fn lead(&self, n: usize) -> f64 {
        let lead = self.values.number("lead");
        let hands = self.values.word("hands").as_bytes();
        let hand = hands.get(n).or(hands.last());
        if hand == Some(&b'L') { -lead } else { lead }
    }

    fn leg(&self, n: usize) -> String {
        let mut text = format!("[LEG_{n}]\n");
        for (key, numbers) in &self.legs[n].0 {
            text += &line(key.name, numbers);
        }
        if let Some(axis) = self.cardans.get(n) {
            let lead = self.lead(n);
            if lead != self.lead(0) {
                text += &line(of_leg::LEAD.name, &[lead]);
            }
            text += &line(of_leg::BASE_N.name, axis);
            text += &line(of_leg::PLATFORM_N.name, &axis.map(|x| 0.0 - x));
        }
        match &self.carried {
            Some(_) => text,
            None => text + &self.cone(),
        }
    }

    /// Returns the cone of a base joint, if its swing is limited.
    fn cone(&self) -> String {
        let swing = self.values.list::<1>(JOINT_ANGLE.name);
        swing.map_or(String::new(), |swing| line(of_leg::BASE_CONE.name, &swing))
    }

    fn joint(&self, n: usize) -> String {
        if let Some(joint) = self.carried.as_ref().and_then(|carried| carried.joints.get(n)) {
            return self.carried_joint(n, joint);
        }
        let is_leg = n < self.legs.len();
        let of_wrist = n.checked_sub(self.legs.len() + self.table().len());
        if let (Some(wrist), Some(i)) = (Wrist::of(self), of_wrist) {
            let errors = self.following_error(self.motion()[1][0], true);
            return wrist.joint(i, n, errors, &self.homing(n, 0.0));
        }
        let is_arm = is_leg && self.kind.leg == leg::Kind::Crank;
        let [min, max] = match is_leg {
            true => self.range(),
            false => self.values.list("table").unwrap_or_default(),
        };
        let home = plain(self.joints.get(n).copied().unwrap_or_default());
        let [speed, acceleration] = self.speeds.get(n).copied().unwrap_or([1.0; 2]);
        let (error, least) = self.following_error(speed, is_arm);
        let kind = if is_arm { "ANGULAR" } else { "LINEAR" };
        format!(
            "\n{}[JOINT_{n}]\nTYPE = {kind}\nHOME = {home}\nMIN_LIMIT = {min}\nMAX_LIMIT = {max}\n\
             MAX_VELOCITY = {speed}\nMAX_ACCELERATION = {acceleration}\nFERROR = {error}\nMIN_FERROR = {}\n{}",
            if n == 0 { self.about_joints() } else { String::new() },
            least,
            self.homing(n, home)
        )
    }

    /// Returns the following errors allowed at the largest speed and at standstill.
    fn following_error(&self, speed: f64, is_angle: bool) -> (f64, f64) {
        let least = if is_angle { LEAST_ERROR[1] } else { self.values.from_mm(LEAST_ERROR[0]) };
        let error = rounded(DIGITS, (LAG * speed * f64::from(PERIOD) * 1e-9).max(least));
        (error, rounded(DIGITS, STANDSTILL * error))
    }

    fn carried_joint(&self, n: usize, joint: &CarriedJoint) -> String {
        let CarriedJoint { kind, range: [min, max], motion: [speed, acceleration], lines, .. } =
            joint;
        let mut error = String::new();
        let has = |key: &str| lines.lines().any(|line| line.starts_with(key));
        let (ferror, least) = self.following_error(*speed, *kind == "ANGULAR");
        if !has("FERROR ") {
            error += &format!("FERROR = {ferror}\n");
        }
        if !has("MIN_FERROR ") {
            error += &format!("MIN_FERROR = {least}\n");
        }
        let home = match n < self.legs.len() {
            true => plain(self.joints.get(n).copied().unwrap_or_default()),
            false => joint.home,
        };
        let about = match n {
            0 => {
                "\n# The drives as they were. HOME is from the kinematics; SIM_START is where a simulated drive stands at power-up."
            }
            _ => "",
        };
        format!(
            "{about}\n[JOINT_{n}]\nTYPE = {kind}\nHOME = {home}\nMIN_LIMIT = {min}\nMAX_LIMIT = {max}\n\
             MAX_VELOCITY = {speed}\nMAX_ACCELERATION = {acceleration}\n{error}{lines}"
        )
    }

    fn about_joints(&self) -> String {
        let homing = match self.kind.homing {
            Homing::Absolute => {
                "Homing uses the values of their absolute encoders. With switches, homing must keep the platform within its limits: pkm check verifies that."
            }
            Homing::AtEnd | Homing::BeyondHome => {
                "They have incremental encoders: all move at the same time (one HOME_SEQUENCE) until each reaches its switch at HOME_OFFSET, and return to HOME together (the negative number). Mount the switches at HOME_OFFSET, or enter their positions. SIM_START is the position of a simulated drive at power-up."
            }
        };
        comment(&format!(
            "The drives: HOME from the kinematics, the range as given, and the highest speeds and \
             accelerations that the tool needs within the axis limits; your drives must reach them. \
             {homing}"
        ))
    }

    fn homing(&self, n: usize, home: f64) -> String {
        let mm = |mm: f64| self.values.from_mm(mm);
        let (way, switch) = match self.kind.homing {
            // Away from the work.
            Homing::AtEnd if self.is_up() => (-1.0, self.range()[0] + mm(5.0)),
            Homing::AtEnd => (1.0, self.range()[1] - mm(5.0)),
            Homing::BeyondHome => (1.0, home + mm(20.0)),
            Homing::Absolute => {
                return "HOME_ABSOLUTE_ENCODER = 2\nHOME_OFFSET = 0\nHOME_SEARCH_VEL = 0\nHOME_LATCH_VEL = 0\nHOME_SEQUENCE = 0\n".into();
            }
        };
        // Drives are not exactly aligned at power-up.
        let start = switch - way * mm(30.0 + 3.0 * (n % 3) as f64);
        format!(
            "HOME_OFFSET = {}\nHOME_SEARCH_VEL = {}\nHOME_LATCH_VEL = {}\nHOME_FINAL_VEL = {}\n\
             HOME_SEQUENCE = -1\nSIM_START = {}\n",
            plain(switch),
            way * mm(20.0),
            way * mm(-2.0),
            mm(20.0),
            plain(start)
        )
    }

    fn axis(&self, letter: Letter) -> String {
        let kind = if letter.is_angle() { "ANGULAR" } else { "LINEAR" };
        let k = letter.index();
        let [linear, angular] = self.motion();
        let [speed, acceleration] = if letter.is_angle() { angular } else { linear };
        let carried = self.carried.as_ref().and_then(|carried| carried.axis(letter.name()));
        // No more than the tool may have together.
        let [speed, acceleration] = carried.map_or([speed, acceleration], |axis| {
            [axis.motion[0].min(speed), axis.motion[1].min(acceleration)]
        });
        let about = match (carried.and_then(|axis| axis.limits), &self.limits) {
            (Some([low, high]), Some(found)) if [found.low[k], found.high[k]] != [low, high] => {
                format!(
                    "# The older configuration has {low} to {high}: not every pose between these is proved.\n"
                )
            }
            _ => String::new(),
        };
        let limits = match &self.limits {
            Some(AxisBox { low, high }) => {
                format!("MIN_LIMIT = {}\nMAX_LIMIT = {}\n", plain(low[k]), plain(high[k]))
            }
            None => String::new(),
        };
        format!(
            "\n{about}[AXIS_{}]\nTYPE = {kind}\n{limits}MAX_VELOCITY = {speed}\nMAX_ACCELERATION = {acceleration}\n",
            letter.name()
        )
    }
}

impl Plan<'_> {
    /// Writes the axis of a wrist, or of a coordinate that passes through.
    fn extra_axis(&self, letter: char) -> String {
        if let Some(wrist) = Wrist::of(self) {
            return wrist.axis(letter);
        }
        let Some(axis) = self.carried.as_ref().and_then(|carried| carried.axis(letter)) else {
            return String::new();
        };
        let kind = if "ABC".contains(letter) { "ANGULAR" } else { "LINEAR" };
        let [speed, acceleration] = axis.motion;
        let limits = axis.limits.map_or(String::new(), |[low, high]| {
            format!("MIN_LIMIT = {low}\nMAX_LIMIT = {high}\n")
        });
        format!(
            "\n[AXIS_{letter}]\nTYPE = {kind}\n{limits}MAX_VELOCITY = {speed}\nMAX_ACCELERATION = {acceleration}\n"
        )
    }
}

pub(crate) fn line(key: &str, numbers: &[f64]) -> String {
    format!("{key} = {}\n", list(numbers))
}

/// Formats a text as lines of a comment.
fn comment(text: &str) -> String {
    let mut lines = String::new();
    let mut line = String::from("#");
    for word in text.split_ascii_whitespace() {
        if line.len() + word.len() > 98 {
            let _ = writeln!(lines, "{line}");
            line = "#".into();
        }
        line.push(' ');
        line += word;
    }
    lines + &line + "\n"
}
