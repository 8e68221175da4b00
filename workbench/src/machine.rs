// SPDX-License-Identifier: GPL-2.0-or-later
//! A machine as its INI file describes it: the geometry for the core, and what only
//! host tools use (cones, limits, speeds).
//!
//! The rules are those of hal/pkmkins.tcl; tests/ini/cases.toml holds both to one list.

use crate::ini::{Entry, Ini, IniError};
use kinematics::leg::StrutGeometry;
use kinematics::{
    Coordinates, Fault, Geometry, LEGS, LegGeometry, Load, MAX_ITERATIONS, Machine, Pose, Solver,
    Vector3,
};
use std::fmt;
use std::path::{Path, PathBuf};

/// Joints of the machines that this version describes.
pub const JOINTS: usize = LEGS;

const AXES: [&str; 6] = ["AXIS_X", "AXIS_Y", "AXIS_Z", "AXIS_A", "AXIS_B", "AXIS_C"];

/// LinuxCNC's speed of an axis for which the file gives none (DEFAULT_AXIS_MAX_VELOCITY
/// of emccfg.h), machine units or degrees per second.
const AXIS_VELOCITY: f64 = 1.0;

/// Load parameters of the module, in the order that [`Load::parse`] takes them.
const PARAMETERS: [&str; 3] = ["legs", "coordinates", "table"];

const MACHINE_KEYS: &[&str] =
    &["SCREW_LEAD", "SPINDLE_OFFSET", "CONVERGENCE_CRITERION", "LIMIT_ITERATIONS", "MAX_ERROR"];

const STRUT_KEYS: &[&str] =
    &["BASE", "PLATFORM", "BASE_N", "PLATFORM_N", "LEAD", "OFFSET", "BASE_CONE", "PLATFORM_CONE"];

/// Why no machine could be made of an INI file.
#[derive(Clone, Debug, PartialEq)]
pub enum MachineError {
    /// The text of the file is wrong.
    Ini(IniError),
    /// The text is in order, but describes no machine.
    Geometry(PathBuf, Fault),
}

impl fmt::Display for MachineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MachineError::Ini(error) => error.fmt(f),
            MachineError::Geometry(file, fault) => write!(f, "{}: {fault}", file.display()),
        }
    }
}

impl std::error::Error for MachineError {}

impl From<IniError> for MachineError {
    fn from(error: IniError) -> Self {
        MachineError::Ini(error)
    }
}

/// Limits and home of one joint, `[JOINT_N]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Shortest strut, in joint units.
    pub min: f64,
    /// Longest strut, in joint units.
    pub max: f64,
    /// Joint units per second.
    pub max_velocity: f64,
    /// Joint units per second squared.
    pub max_acceleration: f64,
    /// Value at the end of homing; LinuxCNC takes 0 where it is missing.
    pub home: f64,
}

/// Limits of one pose coordinate, `[AXIS_L]`; infinite where the file gives none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// Lowest value, machine units or degrees.
    pub min: f64,
    /// Highest value, machine units or degrees.
    pub max: f64,
    /// Machine units or degrees per second.
    pub max_velocity: f64,
}

/// What LinuxCNC's interpreter needs to read programs as this machine does.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// `[RS274NGC]PARAMETER_FILE`, beside the INI file.
    pub parameter_file: Option<PathBuf>,
    /// `[EMCIO]TOOL_TABLE`, beside the INI file.
    pub tool_table: Option<PathBuf>,
    /// `[RS274NGC]RS274NGC_STARTUP_CODE`.
    pub startup_code: Option<String>,
    /// `[EMCIO]RANDOM_TOOLCHANGER`.
    pub random_tools: bool,
}

/// A machine with everything its INI file says that this crate uses.
#[derive(Clone, Debug)]
pub struct MachineConfig {
    /// The INI file.
    pub file: PathBuf,
    /// Checked and frozen geometry.
    pub machine: Machine<JOINTS>,
    /// The geometry as given.
    pub geometry: Geometry<JOINTS>,
    /// `[TRAJ]HOME`: x y z in machine units, a b c in degrees.
    pub home: [f64; 6],
    /// Tool vector without a tool: the spindle offset along Z, machine units.
    pub spindle: Vector3<f64>,
    /// Settings of forward kinematics.
    pub solver: Solver,
    /// Half angle of the cone that the strut may leave its home direction by, degrees, per leg.
    pub base_cone: [Option<f64>; JOINTS],
    /// The same at the platform, in the platform frame.
    pub platform_cone: [Option<f64>; JOINTS],
    /// `[JOINT_N]`.
    pub joints: [Joint; JOINTS],
    /// `[AXIS_X]` to `[AXIS_C]`.
    pub axes: [Axis; 6],
    /// Machine units per millimetre, from `[TRAJ]LINEAR_UNITS`.
    pub units_per_mm: f64,
    /// `[TRAJ]MAX_LINEAR_VELOCITY`, machine units per second.
    pub max_linear_velocity: f64,
    /// `[TRAJ]MAX_ANGULAR_VELOCITY`, degrees per second.
    pub max_angular_velocity: f64,
    /// `[EMCMOT]SERVO_PERIOD`, seconds.
    pub period: f64,
    /// What the interpreter needs.
    pub program: Program,
}

impl MachineConfig {
    /// Reads a machine from its INI file.
    ///
    /// # Errors
    /// The file, one of its values, or the geometry is refused.
    pub fn read(file: &Path) -> Result<Self, MachineError> {
        Self::from_ini(&Ini::read(file)?)
    }

    /// A machine from an INI file already read.
    ///
    /// # Errors
    /// One of the values, or the geometry is refused.
    pub fn from_ini(ini: &Ini) -> Result<Self, MachineError> {
        let coordinates = check_kinematics(ini)?;
        check_leg_sections(ini)?;
        ini.check_section("PKM", MACHINE_KEYS)?;
        let home = home(ini)?;
        let legs = per_leg(|n| strut(ini, n))?;
        let offsets = per_leg(|n| ini.number_or(&leg(n), "OFFSET", 0.0))?;
        let geometry = Geometry { legs, home: Some(home), coordinates };
        let machine = Machine::freeze(&geometry, &offsets)
            .map_err(|fault| MachineError::Geometry(ini.file().into(), fault))?;
        ini.numbers::<1>("PKM", "MAX_ERROR")?;
        let speed = |key| positive(ini, "TRAJ", key, Some(f64::INFINITY));
        Ok(Self {
            file: ini.file().into(),
            machine,
            geometry,
            home,
            spindle: Vector3::new(0.0, 0.0, ini.number_or("PKM", "SPINDLE_OFFSET", 0.0)?),
            solver: solver(ini)?,
            base_cone: per_leg(|n| cone(ini, n, "BASE_CONE"))?,
            platform_cone: per_leg(|n| cone(ini, n, "PLATFORM_CONE"))?,
            joints: per_leg(|n| joint(ini, n))?,
            axes: axes(ini)?,
            units_per_mm: units_per_mm(ini)?,
            max_linear_velocity: speed("MAX_LINEAR_VELOCITY")?,
            max_angular_velocity: speed("MAX_ANGULAR_VELOCITY")?,
            period: positive(ini, "EMCMOT", "SERVO_PERIOD", Some(1e6))? * 1e-9,
            program: program(ini),
        })
    }

    /// Name of the machine's unit of length.
    pub fn length_unit(&self) -> &'static str {
        if self.units_per_mm == 1.0 { "mm" } else { "inch" }
    }

    /// `[TRAJ]HOME` as a pose.
    pub fn home_pose(&self) -> Pose {
        Pose::from_degrees(self.home)
    }

    /// Angle of every strut to its direction at home: at the base joints (in base), and
    /// at the platform joints (in the platform frame). Degrees.
    ///
    /// # Errors
    /// As [`Machine::inverse`].
    pub fn cone_angles(&self, pose: &Pose, tool: &Vector3<f64>) -> Result<ConeAngles, Fault> {
        let home = self.home_pose();
        let at_home = self.machine.directions(&home, &self.spindle)?;
        let now = self.machine.directions(pose, tool)?;
        let turn = home.rotation() * pose.rotation().transpose();
        Ok(ConeAngles {
            base: std::array::from_fn(|i| angle_deg(&at_home[i], &now[i])),
            platform: std::array::from_fn(|i| angle_deg(&at_home[i], &(turn * now[i]))),
        })
    }
}

/// Angles between struts and their directions at home, degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConeAngles {
    /// At the base joints, seen in base.
    pub base: [f64; JOINTS],
    /// At the platform joints, seen in the platform frame.
    pub platform: [f64; JOINTS],
}

fn angle_deg(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b)).to_degrees()
}

fn leg(n: usize) -> String {
    format!("LEG_{n}")
}

/// One value a leg; the first error wins.
fn per_leg<T>(value: impl Fn(usize) -> Result<T, IniError>) -> Result<[T; JOINTS], IniError> {
    let values = (0..JOINTS).map(value).collect::<Result<Vec<T>, _>>()?;
    Ok(<[T; JOINTS]>::try_from(values).unwrap_or_else(|_| unreachable!("one value a leg")))
}

/// Checks `[KINS]` and returns the order of the pose letters.
fn check_kinematics(ini: &Ini) -> Result<Coordinates, IniError> {
    let expected = "expected pkmkins legs=strut:6 [coordinates=XYZABC]";
    let entry = ini.require("KINS", "KINEMATICS", expected)?;
    let mut words = entry.value.split_ascii_whitespace();
    if words.next() != Some("pkmkins") {
        return Err(ini.refuse(entry, expected));
    }
    let mut given: [Option<&[u8]>; 3] = [None; 3];
    for word in words {
        let place = word
            .split_once('=')
            .and_then(|(name, text)| Some((PARAMETERS.iter().position(|p| *p == name)?, text)));
        let (place, text) = place.ok_or_else(|| ini.refuse(entry, expected))?;
        given[place] = Some(text.as_bytes());
    }
    let [legs, coordinates, table] = given;
    let load = Load::parse(legs, coordinates, table)
        .map_err(|error| ini.refuse(entry, &format!("{}; {expected}", error.text())))?;
    let [joints] = ini.require_numbers::<1>("KINS", "JOINTS")?;
    if joints != JOINTS as f64 {
        let entry = ini.require("KINS", "JOINTS", "")?;
        return Err(ini.refuse(entry, "expected 6, one joint for each leg of [KINS]KINEMATICS"));
    }
    Ok(load.coordinates)
}

/// Exactly the sections LEG_0 to LEG_5.
fn check_leg_sections(ini: &Ini) -> Result<(), IniError> {
    for n in 0..JOINTS {
        if !ini.sections().iter().any(|(name, _)| *name == leg(n)) {
            let text = "[KINS]KINEMATICS has 6 legs; give each its own section";
            return Err(ini.error(&leg(n), "", None, text));
        }
    }
    for (name, line) in ini.sections().iter().filter(|(name, _)| name.starts_with("LEG_")) {
        if !(0..JOINTS).any(|n| *name == leg(n)) {
            let expected = "one section too many; [KINS]KINEMATICS has legs 0 to 5";
            return Err(ini.error(name, "", Some(""), expected).at_line(*line));
        }
    }
    Ok(())
}

fn home(ini: &Ini) -> Result<[f64; 6], IniError> {
    let expected = "expected 3 to 9 decimal numbers separated by blanks";
    let entry = ini.require("TRAJ", "HOME", expected)?;
    let values = ini.number_list(entry).filter(|values| (3..=9).contains(&values.len()));
    let mut values = values.ok_or_else(|| ini.refuse(entry, expected))?;
    values.resize(6, 0.0);
    let home = std::array::from_fn(|i| values[i]);
    if home[3..].iter().any(|angle| *angle != 0.0) {
        return Err(ini.refuse(entry, "expected a level pose, A = B = C = 0"));
    }
    Ok(home)
}

fn strut(ini: &Ini, n: usize) -> Result<LegGeometry, IniError> {
    let section = leg(n);
    ini.check_section(&section, STRUT_KEYS)?;
    let lead = match ini.numbers(&section, "LEAD")? {
        Some([own]) => own,
        // Not 0 where it is missing: a lost heading or a typing error would drop it silently.
        None => ini.require_numbers::<1>("PKM", "SCREW_LEAD")?[0],
    };
    let axis = |key| match ini.numbers(&section, key)? {
        None if lead != 0.0 => ini.require_numbers(&section, key),
        axis => Ok(axis.unwrap_or_default()),
    };
    let geometry =
        StrutGeometry { base_axis: axis("BASE_N")?, platform_axis: axis("PLATFORM_N")?, lead };
    let base = ini.require_numbers(&section, "BASE")?;
    Ok(LegGeometry::strut(base, ini.require_numbers(&section, "PLATFORM")?, geometry))
}

fn cone(ini: &Ini, n: usize, key: &str) -> Result<Option<f64>, IniError> {
    let section = leg(n);
    let Some([angle]) = ini.numbers::<1>(&section, key)? else { return Ok(None) };
    if !(angle > 0.0 && angle <= 180.0) {
        let expected = "expected more than 0 and at most 180 degrees";
        return Err(ini.refuse(ini.require(&section, key, expected)?, expected));
    }
    Ok(Some(angle))
}

fn solver(ini: &Ini) -> Result<Solver, IniError> {
    let solver = Solver::default();
    let criterion =
        positive(ini, "PKM", "CONVERGENCE_CRITERION", Some(solver.convergence_criterion))?;
    let Some([limit]) = ini.numbers::<1>("PKM", "LIMIT_ITERATIONS")? else {
        return Ok(Solver { convergence_criterion: criterion, ..solver });
    };
    let entry = ini.require("PKM", "LIMIT_ITERATIONS", "")?;
    let is_whole = entry.value.bytes().all(|b| b.is_ascii_digit());
    if !is_whole || !(1.0..=f64::from(MAX_ITERATIONS)).contains(&limit) {
        let expected = format!("expected a whole number from 1 to {MAX_ITERATIONS}");
        return Err(ini.refuse(entry, &expected));
    }
    Ok(Solver { convergence_criterion: criterion, limit_iterations: limit as u32, ..solver })
}

fn joint(ini: &Ini, n: usize) -> Result<Joint, IniError> {
    let section = format!("JOINT_{n}");
    let [min] = ini.require_numbers(&section, "MIN_LIMIT")?;
    let [max] = ini.require_numbers(&section, "MAX_LIMIT")?;
    if min >= max {
        let expected = format!("expected less than MAX_LIMIT = {max}");
        return Err(ini.refuse(ini.require(&section, "MIN_LIMIT", &expected)?, &expected));
    }
    Ok(Joint {
        min,
        max,
        max_velocity: positive(ini, &section, "MAX_VELOCITY", None)?,
        max_acceleration: positive(ini, &section, "MAX_ACCELERATION", None)?,
        home: ini.number_or(&section, "HOME", 0.0)?,
    })
}

fn axes(ini: &Ini) -> Result<[Axis; 6], IniError> {
    per_leg(|i| {
        Ok(Axis {
            min: ini.number_or(AXES[i], "MIN_LIMIT", f64::NEG_INFINITY)?,
            max: ini.number_or(AXES[i], "MAX_LIMIT", f64::INFINITY)?,
            max_velocity: positive(ini, AXES[i], "MAX_VELOCITY", Some(AXIS_VELOCITY))?,
        })
    })
}

/// A number above 0; without a default the key is needed.
fn positive(ini: &Ini, section: &str, key: &str, default: Option<f64>) -> Result<f64, IniError> {
    let value = match (ini.numbers::<1>(section, key)?, default) {
        (None, Some(default)) => default,
        _ => ini.require_numbers::<1>(section, key)?[0],
    };
    if value > 0.0 {
        return Ok(value);
    }
    let expected = "expected more than 0";
    Err(ini.refuse(ini.require(section, key, expected)?, expected))
}

fn units_per_mm(ini: &Ini) -> Result<f64, IniError> {
    let expected = "expected mm or inch";
    let entry = ini.require("TRAJ", "LINEAR_UNITS", expected)?;
    match entry.value.as_str() {
        "mm" | "metric" => Ok(1.0),
        "inch" | "in" | "imperial" => Ok(1.0 / 25.4),
        _ => Err(ini.refuse(entry, expected)),
    }
}

fn program(ini: &Ini) -> Program {
    let text = |section, key| ini.first(section, key).map(|e: &Entry| e.value.clone());
    let folder = ini.file().parent().unwrap_or(Path::new(""));
    Program {
        parameter_file: text("RS274NGC", "PARAMETER_FILE").map(|name| folder.join(name)),
        tool_table: text("EMCIO", "TOOL_TABLE").map(|name| folder.join(name)),
        startup_code: text("RS274NGC", "RS274NGC_STARTUP_CODE"),
        random_tools: text("EMCIO", "RANDOM_TOOLCHANGER").is_some_and(|value| value == "1"),
    }
}
