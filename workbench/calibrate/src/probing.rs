// SPDX-License-Identifier: GPL-2.0-or-later
//! A probing program for the holes of a plate, for any machine that moves X, Y and Z and for tools that point
//! up or down: the calibration program of the hexapod, generalized to the tilts that the machine has.

use super::at_tool;
use super::log::{self, HEADER};
use super::model::Frame;
use super::plate::{Hole, Plate, PlateError, Unit};
use super::program::{name_in_comments, unit_word};
use super::propose::{decimals, words};
use super::setup::{LOOKS_AWAY, looks_away};
use kinematics::{Letter, Pose, Vector3};
use machine::files::{AtFile, Locate, as_comment, read_text};
use machine::read::mechanism::Mechanism;
use serde::Deserialize;
use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};

/// Tilts of the touches, in shares of the largest one, A B C.
const TILTS: [[f64; 3]; 7] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.6],
    [0.0, 1.0, -0.6],
    [0.0, -1.0, 0.0],
    [0.7, 0.7, 0.0],
    [-0.7, -0.7, 1.0],
];

/// Factor that reduces a tilt outside the limits, and number of reductions.
const SMALLER: f64 = 0.8;
const TRIES: usize = 8;

/// Programmed depth of a probing move in the wall, and retraction between a fast and a slow touch, mm.
const BEYOND: f64 = 3.0;
const BACK: f64 = 0.15;

/// A plate to be probed as described in the TOML file: lengths in its `unit`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    unit: Unit,
    #[serde(rename = "gauge")]
    _gauge: Probe,
    plate: PathBuf,
    place: [f64; 3],
    #[serde(default)]
    angles: [f64; 3],
    tool: [f64; 3],
    depth: f64,
    clearance: f64,
    #[serde(default = "tilt")]
    tilt: f64,
    fast: f64,
    slow: f64,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Probe {
    Probe,
}

fn tilt() -> f64 {
    15.0
}

/// A program, and the HAL file that latches the joints for it.
#[derive(Clone, Debug)]
pub struct Probing {
    pub program: String,
    pub hal: String,
    pub touches: usize,
    /// Tilts of the platform, A B C in degrees.
    pub tilts: Vec<[f64; 3]>,
}

/// Why no program can be written.
#[derive(Debug, thiserror::Error)]
pub enum NoProbing {
    #[error(transparent)]
    Unread(#[from] AtFile<io::Error>),
    #[error(transparent)]
    Malformed(#[from] AtFile<toml::de::Error>),
    #[error(transparent)]
    Plate(#[from] PlateError),
    #[error(transparent)]
    Bad(#[from] AtFile<BadProbing>),
}

/// Why a plate cannot be probed at the given pose.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct BadProbing(String);

/// Returns whether a file is for a probe, not for a gauge that the operator reads.
pub fn is_one(text: &str) -> bool {
    let table: Option<toml::Table> = toml::from_str(text).ok();
    table.is_some_and(|table| table.get("gauge").and_then(|word| word.as_str()) == Some("probe"))
}

/// Writes the program for a file, which logs to a file of this name.
///
/// # Errors
/// See [`NoProbing`].
pub fn probing(config: &Mechanism, file: &Path, log: &str) -> Result<Probing, NoProbing> {
    if as_comment(log) != log {
        let text = format!(
            "{log:?}: LinuxCNC reads the log name between parentheses: use another --output"
        );
        return Err(BadProbing(text)).at(file)?;
    }
    let text = read_text(file)?;
    let given: File = toml::from_str(&text).at(file)?;
    let folder = file.parent().unwrap_or(Path::new(""));
    let plate = Plate::read(&folder.join(&given.plate), config.units_per_mm)?;
    let maker = Maker::new(config, given, plate).at(file)?;
    let tilts = maker.tilts().at(file)?;
    let touches = 5 * maker.plate.hole.len() * tilts.len();
    let program = maker.program(&tilts, log);
    Ok(Probing { program, hal: hal(config), touches, tilts })
}

struct Maker<'a> {
    config: &'a Mechanism,
    plate: Plate,
    frame: Frame,
    /// Tool vector, spindle offset included.
    tool: Vector3<f64>,
    /// 1 if the plate's face points up, -1 if it points down.
    up: f64,
    depth: f64,
    clearance: f64,
    tilt: f64,
    fast: f64,
    slow: f64,
}

impl<'a> Maker<'a> {
    fn new(config: &'a Mechanism, given: File, plate: Plate) -> Result<Self, BadProbing> {
        let scale = config.units_per_mm * if given.unit == Unit::Mm { 1.0 } else { 25.4 };
        let bad = |text: String| Err(BadProbing(text));
        for (key, value) in [
            ("depth", given.depth),
            ("clearance", given.clearance),
            ("fast", given.fast),
            ("slow", given.slow),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return bad(format!("{key} = {value}: expected more than 0"));
            }
        }
        if !given.place.iter().chain(&given.angles).chain(&given.tool).all(|x| x.is_finite()) {
            return bad("place, angles, tool: expected three numbers".into());
        }
        if !(given.tilt >= 0.0 && given.tilt.is_finite()) {
            return bad(format!("tilt = {}: expected 0 or more", given.tilt));
        }
        let [a, b, c] = given.angles;
        let rotation = Pose::from_degrees([0.0, 0.0, 0.0, a, b, c]).rotation();
        let up = rotation[(2, 2)];
        if !(up.abs() > 0.9) {
            return bad(format!(
                "angles = {:?}: expected a face that points up or down",
                given.angles
            ));
        }
        if looks_away(&rotation, &(Vector3::from(given.tool) * scale + config.spindle)) {
            return bad(format!("angles = {:?}: {LOOKS_AWAY}", given.angles));
        }
        let layout = config.machine.layout();
        if let Some(letter) = Letter::ALL[..3].iter().find(|letter| layout.is_held(**letter)) {
            return bad(format!(
                "the machine does not move {}: it cannot probe holes",
                letter.name()
            ));
        }
        Ok(Self {
            config,
            plate,
            frame: Frame { origin: Vector3::from(given.place) * scale - config.spindle, rotation },
            tool: Vector3::from(given.tool) * scale + config.spindle,
            up: up.signum(),
            depth: given.depth * scale,
            clearance: given.clearance * scale,
            tilt: given.tilt,
            fast: given.fast * scale,
            slow: given.slow * scale,
        })
    }

    /// Returns the tip that LinuxCNC displays at a position of the plate.
    fn shown(&self, x: f64, y: f64, height: f64) -> [f64; 3] {
        let local = Vector3::new(x, y, height);
        (self.frame.origin + self.frame.rotation * local + self.config.spindle).into()
    }

    /// Returns the clearance of the ball in a hole, on each side.
    fn room(&self, hole: &Hole) -> f64 {
        (hole.diameter - self.plate.ball) / 2.0
    }

    /// Returns a position on the face near a hole and in no other hole.
    fn beside(&self, hole: &Hole) -> [f64; 2] {
        let away = hole.diameter / 2.0 + 1.5 * self.plate.ball;
        let places = (0..8).map(|k| {
            let (s, c) = (f64::from(k) * std::f64::consts::FRAC_PI_4).sin_cos();
            [hole.place[0] + away * c, hole.place[1] + away * s]
        });
        let free = |[x, y]: &[f64; 2]| {
            let others =
                self.plate.hole.iter().map(|other| {
                    (other.place[0] - x).hypot(other.place[1] - y) - other.diameter / 2.0
                });
            others.fold(f64::INFINITY, f64::min)
        };
        places.max_by(|a, b| free(a).total_cmp(&free(b))).expect("there are eight")
    }

    /// Returns the tilts at which the whole plate is within the limits, level first.
    fn tilts(&self) -> Result<Vec<[f64; 3]>, BadProbing> {
        let layout = self.config.machine.layout();
        let mut found: Vec<[f64; 3]> = vec![];
        for shares in TILTS {
            let fitting = (0..TRIES).map(|k| SMALLER.powi(k as i32)).find_map(|factor| {
                let angles: [f64; 3] =
                    std::array::from_fn(|k| match layout.is_held(Letter::ALL[3 + k]) {
                        true => self.config.home[3 + k],
                        false => (10.0 * shares[k] * self.tilt * factor).round() / 10.0,
                    });
                self.is_legal(&angles).then_some(angles)
            });
            match fitting {
                Some(angles) if !found.contains(&angles) => found.push(angles),
                _ => {}
            }
        }
        match found.is_empty() {
            true => Err(BadProbing(
                "the holes, or the path to them, are outside the limits of the machine, or the probe would lean by \
                 more than tilt there: check the position of the plate, the length of the probe and tilt"
                    .into(),
            )),
            false => Ok(found),
        }
    }

    /// Returns whether every position of the plate is within the limits, with the overtravel of probing moves.
    fn is_legal(&self, angles: &[f64; 3]) -> bool {
        let beyond = BEYOND * self.config.units_per_mm;
        let mut places = vec![];
        for hole in &self.plate.hole {
            let [x, y] = hole.place;
            let reach = self.room(hole) + beyond;
            places.extend([-1.0, 1.0].map(|s| self.shown(x + s * reach, y, -self.depth)));
            places.extend([-1.0, 1.0].map(|s| self.shown(x, y + s * reach, -self.depth)));
            places.push(self.shown(x, y, self.clearance));
            let [x, y] = self.beside(hole);
            places.push(self.shown(x, y, self.clearance));
            places.push(self.shown(x, y, self.plate.ball / 2.0 - beyond));
        }
        let [a, b, c] = *angles;
        places.iter().all(|[x, y, z]| {
            let pose = log::shown(self.config, [*x, *y, *z, a, b, c], &self.tool);
            at_tool::programmable(self.config, &pose, &self.tool).is_ok() && self.is_upright(&pose)
        })
    }

    /// Returns whether the probe leans by at most the largest tilt, if its orientation follows from its position.
    fn is_upright(&self, pose: &Pose) -> bool {
        let layout = self.config.machine.layout();
        if ![Letter::A, Letter::B].into_iter().any(|letter| layout.is_dependent(letter)) {
            return true;
        }
        let full = self.config.machine.full_pose(pose, &self.tool);
        full.is_ok_and(|full| full.rotation()[(2, 2)] >= self.tilt.to_radians().cos())
    }

    fn program(&self, tilts: &[[f64; 3]], log: &str) -> String {
        let decimals = decimals(self.config);
        let [x, y, z] = (self.tool - self.config.spindle).map(|length| length + 0.0).into();
        let mut text = self.subroutines();
        let _ = write!(
            text,
            "{} G17 G40 G90 G94 G61\n; Machine coordinates: the last work system, without an offset, and no G92.\n\
             G10 L2 P9 {} R0\nG59.3\nG92.1\n\
             G43.1 X{x:.decimals$} Y{y:.decimals$} Z{z:.decimals$}\n\
             #<_touch> = 0\n(LOGOPEN,{log})\n(LOG,{HEADER})\n#<unit> = #<_metric>\n(LOG,unit #<unit>)\n",
            unit_word(self.config),
            words(self.config, &[0.0; 6])
        );
        for angles in tilts {
            text += &self.at_tilt(angles);
        }
        text += "(LOG,end #<_touch>)\n(LOGCLOSE)\n";
        let [x, y, z] = self.over_first();
        let [a, b, c] = tilts[0];
        let _ = writeln!(text, "G0 {}", words(self.config, &[x, y, z, a, b, c]));
        text + "G49\nG54\nM2\n"
    }

    /// Returns the position above the first hole.
    fn over_first(&self) -> [f64; 3] {
        let [x, y] = self.plate.hole.first().map_or([0.0; 2], |hole| hole.place);
        self.shown(x, y, self.clearance)
    }

    fn at_tilt(&self, angles: &[f64; 3]) -> String {
        let [a, b, c] = *angles;
        let [x, y, z] = self.over_first();
        let mut text = format!("G0 {}\n", words(self.config, &[x, y, z, a, b, c]));
        let place = |[x, y, z]: [f64; 3]| format!("[{x:.6}] [{y:.6}] [{z:.6}]");
        for hole in &self.plate.hole {
            let [x, y] = hole.place;
            let number = hole.number;
            let [u, v, over] = self.shown(x, y, self.clearance);
            let _ = writeln!(text, "G0 X{u:.6} Y{v:.6} Z{over:.6}");
            let inside = self.shown(x, y, -self.depth);
            let _ = writeln!(
                text,
                "G1 X{:.6} Y{:.6} Z{:.6} F{}",
                inside[0], inside[1], inside[2], self.fast
            );
            let reach = self.room(hole) + BEYOND * self.config.units_per_mm;
            for approach in [1, -1, 2, -2] {
                let _ = writeln!(
                    text,
                    "o<wall> call [{number}] [{approach}] {} [{reach:.6}]",
                    place(inside)
                );
            }
            let _ = writeln!(text, "G0 X{u:.6} Y{v:.6} Z{over:.6}");
            let [x, y] = self.beside(hole);
            let [u, v, over] = self.shown(x, y, self.clearance);
            let _ = writeln!(text, "G0 X{u:.6} Y{v:.6} Z{over:.6}");
            let [_, _, below] =
                self.shown(x, y, self.plate.ball / 2.0 - BEYOND * self.config.units_per_mm);
            let _ = writeln!(text, "o<face> call [{number}] [{below:.6}]");
            let _ = writeln!(text, "G0 X{u:.6} Y{v:.6} Z{over:.6}");
        }
        text
    }

    fn subroutines(&self) -> String {
        let joints = 0..self.config.joints.len();
        let read: String =
            joints.clone().map(|n| format!("    #<j{n}> = #<_hal[latch-{n}.out]>\n")).collect();
        let logged = joints.map(|n| format!("#<j{n}>")).collect::<Vec<_>>().join(" ");
        let back = BACK * self.config.units_per_mm;
        let beyond = BEYOND * self.config.units_per_mm;
        let machine = name_in_comments(self.config);
        let (up, fast, slow) = (self.up, self.fast, self.slow);
        format!(
            "; Written by `pkm measure` for {machine}: probes the holes of the plate and logs every touch for \
             `pkm calibrate`.\n\
             ; Needed: [RS274NGC]HAL_PIN_VARS = 1, and the HAL file beside it, which holds the joints of the trip.\n\
             \n\
             ; The touch that LinuxCNC has latched: hole, signed number of the axis moved along.\n\
             o<log_touch> sub\n    #<hole> = #1\n    #<approach> = #2\n    #<_touch> = [#<_touch> + 1]\n{read}\
             \x20   #<tx> = #<_hal[pkmkins.tool-offset-eff-x]>\n\
             \x20   #<ty> = #<_hal[pkmkins.tool-offset-eff-y]>\n\
             \x20   #<tz> = #<_hal[pkmkins.tool-offset-eff-z]>\n\
             \x20   #<hash> = #<_hal[pkmkins.geometry-hash]>\n\
             \x20   (LOG,touch #<_touch> hole #<hole> approach #<approach> at #5061 #5062 #5063 #5064 #5065 #5066)\n\
             \x20   (LOG,joints #<_touch> {logged} tool #<tx> #<ty> #<tz> geometry #<hash>)\n\
             o<log_touch> endsub\n\n\
             ; To the wall along X (axis 1) or Y (axis 2) from X#3 Y#4 Z#5, #6 at most, fast and then slow, and back.\n\
             o<wall> sub\n    #<hole> = #1\n    #<approach> = #2\n    #<x> = #3\n    #<y> = #4\n    #<z> = #5\n    #<reach> = #6\n\
             \x20   #<dx> = 0\n    #<dy> = 0\n\
             \x20   o<axis> if [ABS[#<approach>] EQ 1]\n        #<dx> = #<approach>\n\
             \x20   o<axis> else\n        #<dy> = [#<approach> / 2]\n    o<axis> endif\n\
             \x20   G38.2 X[#<x> + #<reach> * #<dx>] Y[#<y> + #<reach> * #<dy>] F{fast}\n\
             \x20   G1 X[#5061 - {back} * #<dx>] Y[#5062 - {back} * #<dy>] F{fast}\n\
             \x20   G38.2 X[#5061 + {beyond} * #<dx>] Y[#5062 + {beyond} * #<dy>] F{slow}\n\
             \x20   o<log_touch> call [#<hole>] [#<approach>]\n\
             \x20   G1 X#<x> Y#<y> Z#<z> F{fast}\no<wall> endsub\n\n\
             ; Onto the face beside a hole, to Z#2 at most.\n\
             o<face> sub\n    #<hole> = #1\n    #<below> = #2\n\
             \x20   G38.2 Z#<below> F{fast}\n    G1 Z[#5063 + {back} * {up}] F{fast}\n    G38.2 Z#<below> F{slow}\n\
             \x20   o<log_touch> call [#<hole>] [-3]\no<face> endsub\n\n"
        )
    }
}

/// Writes a HAL file that latches the joints of the servo cycle in which the probe tripped, until it is released.
fn hal(config: &Mechanism) -> String {
    let joints = 0..config.joints.len();
    let names = joints.clone().map(|n| format!("latch-{n}")).collect::<Vec<_>>().join(",");
    let machine = name_in_comments(config);
    let mut text = format!(
        "# Written by `pkm measure` for {machine}: latches the joints of the servo cycle in which the probe tripped while\n\
         # it presses, for the program to log. Behind the files that load the motion controller and the kinematics.\n\
         # The latches run after the motion controller, which takes its probed position in the same cycle; their\n\
         # switch runs after them, so that they hold from the next cycle on.\n\
         loadrt mux4 names={names}\nloadrt or2 names=latch-switch\n"
    );
    let mut add = |line: String| text += &(line + "\n");
    joints.clone().for_each(|n| add(format!("addf latch-{n} servo-thread")));
    add("addf latch-switch servo-thread".into());
    add("net latch-probe latch-switch.in0 motion.probe-input".into());
    let held = joints.clone().map(|n| format!(" latch-{n}.sel0")).collect::<String>();
    add(format!("net latch-hold latch-switch.out{held}"));
    joints.clone().for_each(|n| add(format!("net latch-fb-{n} joint.{n}.pos-fb latch-{n}.in0")));
    joints.for_each(|n| add(format!("net latched-{n} latch-{n}.out latch-{n}.in1")));
    text
}
