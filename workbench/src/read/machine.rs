// SPDX-License-Identifier: GPL-2.0-or-later
//! A machine as its INI file describes it: the geometry for the core, and what only
//! host tools use (cones, limits, speeds).
//!
//! The rules are those of hal/pkmkins.tcl; tests/cases/ini/cases.toml holds both to one list.

use crate::read::boxes::{self, BoxSection};
use crate::read::chain;
use crate::read::error::{Errors, MachineError, leg_section};
use crate::read::ini::{Entry, Ini, IniError};
use crate::read::joints::{
    AXES, Axis, ExtraAxis, Group, Joint, JointKind, axis, extra, joint, positive,
};
use crate::read::legs::{check_leg_sections, leg_geometry};
use keys::{leg as of_leg, machine as of_machine};
use kinematics::{
    CONDITIONING_LIMIT, Chain, ChainGeometry, ExtraAxes, Fault, Geometry, LegGeometry, Letter,
    Load, MAX_EXTRA, MAX_LEGS, Machine, PerLeg, Pose, Solver, Vector3, World,
};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Limits of the path in `[TRAJ]`: speeds, then accelerations, lengths before angles.
const SPEEDS: [&str; 4] = [
    "MAX_LINEAR_VELOCITY",
    "MAX_ANGULAR_VELOCITY",
    "MAX_LINEAR_ACCELERATION",
    "MAX_ANGULAR_ACCELERATION",
];

/// Load parameters of the module, in the order that [`Load::parse`] takes them; the last
/// ones are those of [`Load::with_axes`] and [`Load::with_boxes`].
const PARAMETERS: [&str; 5] = ["legs", "coordinates", "table", "axes", "boxes"];

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
    /// The INI file with those it includes, where it includes any.
    pub expanded: Option<String>,
}

/// A machine with everything its INI file says that this crate uses.
#[derive(Clone, Debug)]
pub struct MachineConfig {
    /// The INI file.
    pub file: PathBuf,
    /// What was read from it.
    pub ini: Arc<Ini>,
    /// Checked and frozen geometry.
    pub machine: Machine,
    /// The geometry as given.
    pub geometry: Geometry,
    /// Joint offsets, `[LEG_N]OFFSET`.
    pub offsets: PerLeg,
    /// What the extra axes carry.
    pub chain: Chain,
    /// Hash of geometry and chain, as the module shows it.
    pub hash: u32,
    /// `[TRAJ]HOME`, which programs begin at: x y z in machine units, a b c in degrees.
    pub start: [f64; 6],
    /// The machine's own pose there.
    pub home: [f64; 6],
    /// Tool vector without a tool: the spindle offset along Z, machine units.
    pub spindle: Vector3<f64>,
    /// Settings of forward kinematics.
    pub solver: Solver,
    /// Half angle of the cone that the leg may leave its home direction by, degrees, per leg.
    pub base_cone: Vec<Option<f64>>,
    /// The same at the platform, in the platform frame.
    pub platform_cone: Vec<Option<f64>>,
    /// Conditioning at which the module's guard stops the machine, `[PKM]CONDITIONING_LIMIT`.
    pub conditioning_limit: f64,
    /// Smallest distance of the legs' centre lines, machine units, `[PKM]ROD_CLEARANCE`.
    pub clearance: Option<f64>,
    /// Largest angle of the tool axis to its direction at A = B = C = 0, degrees,
    /// `[PKM]TILT_LIMIT`.
    pub tilt_limit: Option<f64>,
    /// Largest turns of the leg from its home direction about the axis of its base joint that is
    /// fixed in base, and across it, degrees, per leg.
    pub base_pyramid: Vec<Option<[f64; 2]>>,
    /// The same at the platform, in the platform frame.
    pub platform_pyramid: Vec<Option<[f64; 2]>>,
    /// `[JOINT_N]`: legs, then table axes.
    pub joints: Vec<Joint>,
    /// Axes behind them that pass a coordinate through, `axes=`.
    pub extra_axes: ExtraAxes,
    /// Their limits, in joint order.
    pub extra: Vec<ExtraAxis>,
    /// `[AXIS_X]` to `[AXIS_C]`, of what programs say.
    pub programmed: Vec<Axis>,
    /// Limits of the machine's own coordinates: the same, but for where an axis carries something.
    pub axes: Vec<Axis>,
    /// Machine units per millimetre, from `[TRAJ]LINEAR_UNITS`.
    pub units_per_mm: f64,
    /// `[TRAJ]MAX_LINEAR_VELOCITY`, machine units per second.
    pub max_linear_velocity: f64,
    /// `[TRAJ]MAX_ANGULAR_VELOCITY`, degrees per second.
    pub max_angular_velocity: f64,
    /// `[TRAJ]MAX_LINEAR_ACCELERATION`, machine units per second squared.
    pub max_linear_acceleration: f64,
    /// `[TRAJ]MAX_ANGULAR_ACCELERATION`, degrees per second squared.
    pub max_angular_acceleration: f64,
    /// `[EMCMOT]SERVO_PERIOD`, seconds.
    pub period: f64,
    /// What the interpreter needs.
    pub program: Program,
    /// `[BOX_K]`: boxes for the start without a seed.
    pub boxes: Vec<BoxSection>,
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
        let load = load(ini)?;
        let mut errors = Errors::default();
        errors.of(check_joints(ini, &load));
        errors.of(check_leg_sections(ini, load.layout.legs()));
        errors.of(check_coordinates(ini, &load));
        // Where these are wrong, what follows only repeats it.
        errors.checked()?;
        let mut errors = Errors::default();
        let read = Values::read(ini, &load, &mut errors);
        let read = errors.value(read)?;
        let refused = |fault| MachineError::of_geometry(ini, fault);
        let geometry = read.geometry(&load);
        let machine = Machine::freeze(&geometry, &read.offsets).map_err(refused)?;
        let chain = Chain::freeze(&read.chain, &load.extra, &load.layout, machine.size());
        let chain = chain.map_err(refused)?;
        let hash = read.chain.hash(&load.extra, geometry.hash());
        let boxes = boxes::read(ini, &load)?;
        boxes::check(&boxes, hash).map_err(refused)?;
        let spindle = Vector3::new(0.0, 0.0, read.spindle);
        let axes = chain::machine_axes(&chain, &read.axes, &read.extra, &load.layout, &spindle);
        let [
            max_linear_velocity,
            max_angular_velocity,
            max_linear_acceleration,
            max_angular_acceleration,
        ] = read.speeds;
        Ok(Self {
            file: ini.file().into(),
            machine,
            home: geometry.home.unwrap_or(read.home),
            geometry,
            chain,
            hash,
            offsets: read.offsets,
            start: read.home,
            spindle,
            solver: read.solver,
            base_cone: read.cones.iter().map(|[base, _]| *base).collect(),
            platform_cone: read.cones.iter().map(|[_, platform]| *platform).collect(),
            conditioning_limit: read.conditioning_limit,
            clearance: read.clearance,
            tilt_limit: read.tilt_limit,
            base_pyramid: read.pyramids.iter().map(|[base, _]| *base).collect(),
            platform_pyramid: read.pyramids.iter().map(|[_, platform]| *platform).collect(),
            joints: read.joints,
            extra_axes: load.extra,
            extra: read.extra,
            programmed: read.axes,
            axes,
            units_per_mm: read.units_per_mm,
            max_linear_velocity,
            max_angular_velocity,
            max_linear_acceleration,
            max_angular_acceleration,
            period: read.period * 1e-9,
            program: program(ini),
            boxes,
            ini: Arc::new(ini.clone()),
        })
    }

    /// Name of the machine's unit of length.
    pub fn length_unit(&self) -> &'static str {
        if self.units_per_mm == 1.0 { "mm" } else { "inch" }
    }

    /// LinuxCNC's pose for what is commanded of the tool, and these values of the extra axes.
    pub fn world(&self, pose: &[f64; 6], extra: &[f64; MAX_EXTRA]) -> World {
        let mut world = [0.0; 9];
        world[..6].copy_from_slice(pose);
        for (place, value) in self.extra_axes.places().zip(extra) {
            world[place] = *value;
        }
        world
    }

    /// What is told of a commanded pose of the tool: where axes carry something with their angles.
    pub fn told(&self, pose: &[f64; 6], extra: &[f64; MAX_EXTRA]) -> [f64; 6] {
        if self.chain.is_empty() {
            return *pose;
        }
        let [x, y, z, a, b, c, ..] = self.world(pose, extra);
        [x, y, z, a, b, c]
    }

    /// The machine's own pose for one of LinuxCNC's, with this tool vector, spindle offset included.
    ///
    /// # Errors
    /// As [`Chain::to_machine`].
    pub fn carried(
        &self,
        pose: &[f64; 6],
        extra: &[f64; MAX_EXTRA],
        tool: &Vector3<f64>,
    ) -> Result<[f64; 6], Fault> {
        if self.chain.is_empty() {
            return Ok(*pose);
        }
        self.chain.to_machine(&self.world(pose, extra), tool)
    }

    /// The machine's pose at `[TRAJ]HOME`.
    pub fn home_pose(&self) -> Pose {
        Pose::from_degrees(self.home)
    }

    /// Number of legs; the other joints belong to the table.
    pub fn legs(&self) -> usize {
        self.machine.layout().legs()
    }

    /// The joints of legs, table and extra axes.
    pub fn all_joints(&self) -> impl Iterator<Item = &Joint> {
        self.joints.iter().chain(self.extra.iter().map(|axis| &axis.joint))
    }

    /// Joint `i`, of legs, table or extra axes.
    pub fn joint(&self, i: usize) -> &Joint {
        let extra = i.checked_sub(self.joints.len());
        extra.map_or_else(|| &self.joints[i], |n| &self.extra[n].joint)
    }

    /// Unit of the values of joint `i`.
    pub fn unit_of(&self, i: usize) -> &'static str {
        match i.checked_sub(self.joints.len()) {
            Some(n) => self.extra[n].unit(self.length_unit()),
            None => self.unit(self.joints[i].kind),
        }
    }

    /// All pairs of legs, lower number first.
    pub fn pairs(&self) -> Vec<[usize; 2]> {
        let legs = self.legs();
        (0..legs).flat_map(|i| (i + 1..legs).map(move |j| [i, j])).collect()
    }

    /// The joints by kind, kinds that the machine has only.
    pub fn groups(&self) -> Vec<Group> {
        let group = |kind: JointKind| Group {
            kind,
            unit: self.unit(kind),
            joints: (0..self.joints.len()).filter(|i| self.joints[*i].kind == kind).collect(),
        };
        JointKind::ALL.into_iter().map(group).filter(|group| !group.joints.is_empty()).collect()
    }

    /// Unit of the values of joints of this kind.
    pub fn unit(&self, kind: JointKind) -> &'static str {
        if kind == JointKind::Arm { "degrees" } else { self.length_unit() }
    }
}

/// The load parameters in `[KINS]KINEMATICS`.
fn load(ini: &Ini) -> Result<Load, IniError> {
    let expected = "expected pkmkins [legs=KIND:COUNT[,KIND:COUNT]] [coordinates=LETTERS] [table=LETTERS] [axes=LETTERS] [boxes=COUNT]";
    let entry = ini.require("KINS", "KINEMATICS", expected)?;
    let mut words = entry.value.split_ascii_whitespace();
    if words.next() != Some("pkmkins") {
        return Err(ini.refuse(entry, expected));
    }
    let mut given: [Option<&[u8]>; 5] = [None; 5];
    for word in words {
        let place = word
            .split_once('=')
            .and_then(|(name, text)| Some((PARAMETERS.iter().position(|p| *p == name)?, text)));
        let (place, text) = place.ok_or_else(|| ini.refuse(entry, expected))?;
        let name = PARAMETERS[place];
        // Of several LinuxCNC takes the last one, and an empty one for none.
        if given[place].is_some() {
            return Err(ini.refuse(entry, &format!("expected {name}= once; {expected}")));
        }
        if text.is_empty() && !["table", "axes"].contains(&name) {
            return Err(ini.refuse(entry, &format!("expected a value after {name}=; {expected}")));
        }
        given[place] = Some(text.as_bytes());
    }
    let [legs, coordinates, table, axes, boxes] = given;
    Load::parse(legs, coordinates, table)
        .and_then(|load| load.with_axes(axes))
        .and_then(|load| load.with_boxes(boxes))
        .map_err(|error| ini.refuse(entry, &format!("{}; {expected}", error.text())))
}

fn check_joints(ini: &Ini, load: &Load) -> Result<(), IniError> {
    let [joints] = ini.require_numbers::<1>("KINS", "JOINTS")?;
    if joints == load.joints() as f64 {
        return Ok(());
    }
    let expected = format!(
        "expected {}, one joint for each leg and each letter of table= and axes= in [KINS]KINEMATICS",
        load.joints()
    );
    Err(ini.refuse(ini.require("KINS", "JOINTS", &expected)?, &expected))
}

/// LinuxCNC takes no program word with a letter that is missing here, so that nothing
/// could ever bring that coordinate back to 0. A letter too many does no harm.
fn check_coordinates(ini: &Ini, load: &Load) -> Result<(), IniError> {
    let moved = || {
        let letters = Letter::ALL.into_iter().filter(|letter| !load.layout.is_held(*letter));
        letters.map(Letter::name).chain(load.extra.letters())
    };
    let wanted: String = moved().collect();
    let expected = format!("expected the letters {wanted} that [KINS]KINEMATICS moves");
    let entry = ini.require("TRAJ", "COORDINATES", &expected)?;
    let given = entry.value.to_ascii_uppercase();
    match moved().find(|letter| !given.contains(*letter)) {
        None => Ok(()),
        Some(letter) => Err(ini.refuse(entry, &format!("{expected}, {letter} is missing"))),
    }
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

/// The values of a file, before the machine is made of them.
struct Values {
    chain: ChainGeometry,
    home: [f64; 6],
    centre: [f64; 3],
    spindle: f64,
    legs: Vec<LegGeometry>,
    offsets: PerLeg,
    cones: Vec<[Option<f64>; 2]>,
    solver: Solver,
    conditioning_limit: f64,
    clearance: Option<f64>,
    tilt_limit: Option<f64>,
    pyramids: Vec<[Option<[f64; 2]>; 2]>,
    joints: Vec<Joint>,
    extra: Vec<ExtraAxis>,
    axes: Vec<Axis>,
    units_per_mm: f64,
    speeds: [f64; 4],
    period: f64,
}

impl Values {
    /// Everything is read, also where something is wrong before it.
    fn read(ini: &Ini, load: &Load, errors: &mut Errors) -> Option<Self> {
        let legs = load.layout.legs();
        errors.of(ini.check_keys("PKM", of_machine::ALL.iter().copied()));
        let machine = |key, errors: &mut Errors| errors.of(ini.value("PKM", key));
        // Only the module uses these; the last one where a strut has no lead of its own.
        for key in [&of_machine::MAX_ERROR, &of_machine::FEED_FLOOR, &of_machine::SCREW_LEAD] {
            machine(key, errors);
        }
        let chain = chain::geometry(ini, load, errors);
        let home = errors.of(home(ini));
        let centre = errors.of(ini.values("PKM", &of_machine::CENTRE));
        let spindle = machine(&of_machine::SPINDLE_OFFSET, errors);
        let leg = |n, errors: &mut Errors| leg_geometry(ini, n, load.kinds()[n], errors);
        let of_legs = errors.each(legs, leg);
        let offset =
            |n, errors: &mut Errors| errors.of(ini.value(&leg_section(n), &of_leg::OFFSET));
        let offsets = errors.each(legs, offset);
        let cones = errors.each(legs, |n, errors| {
            let cone = |key, errors: &mut Errors| errors.of(ini.value(&leg_section(n), key));
            let base = cone(&of_leg::BASE_CONE, errors);
            Some([base?, cone(&of_leg::PLATFORM_CONE, errors)?])
        });
        let pyramids = errors.each(legs, |n, errors| {
            let pyramid = |key, errors: &mut Errors| errors.of(ini.values(&leg_section(n), key));
            let base = pyramid(&of_leg::BASE_PYRAMID, errors);
            Some([base?, pyramid(&of_leg::PLATFORM_PYRAMID, errors)?])
        });
        let solver = solver(ini, errors);
        let conditioning_limit = machine(&of_machine::CONDITIONING_LIMIT, errors);
        let clearance = machine(&of_machine::ROD_CLEARANCE, errors);
        let tilt_limit = machine(&of_machine::TILT_LIMIT, errors);
        let joints = errors.each(load.layout.joints(), |n, errors| joint(ini, n, load, errors));
        let extra = errors.each(load.extra.len(), |n, errors| extra(ini, n, load, errors));
        let axes = errors.each(AXES.len(), |n, errors| match load.extra.places().any(|k| k == n) {
            // The coordinate of an extra axis is none of the tool's.
            true => Some(Axis::UNLIMITED),
            false => axis(ini, AXES[n], errors),
        });
        let units_per_mm = errors.of(units_per_mm(ini));
        let speeds = errors.each(SPEEDS.len(), |n, errors| {
            errors.of(positive(ini, "TRAJ", SPEEDS[n], Some(f64::INFINITY)))
        });
        let period = errors.of(positive(ini, "EMCMOT", "SERVO_PERIOD", Some(1e6)));
        let mut padded = [0.0; MAX_LEGS];
        padded.iter_mut().zip(offsets?).for_each(|(to, given)| *to = given.unwrap_or(0.0));
        Some(Self {
            chain: chain?,
            home: home?,
            centre: centre?.unwrap_or_default(),
            spindle: spindle?.unwrap_or(0.0),
            legs: of_legs?,
            offsets: padded,
            cones: cones?,
            solver: solver?,
            conditioning_limit: conditioning_limit?.unwrap_or(CONDITIONING_LIMIT),
            clearance: clearance?,
            tilt_limit: tilt_limit?.filter(|limit| *limit != 0.0),
            pyramids: pyramids?,
            joints: joints?,
            extra: extra?,
            axes: axes?,
            units_per_mm: units_per_mm?,
            speeds: speeds?.try_into().ok()?,
            period: period?,
        })
    }

    fn geometry(&self, load: &Load) -> Geometry {
        let (coordinates, table) = (*load.layout.coordinates(), *load.layout.table());
        let mut geometry = Geometry::new(&self.legs, coordinates, table)
            .expect("the layout of the load parameters is consistent");
        geometry.centre = self.centre;
        geometry.home = Some(ChainGeometry::machine_home(self.chain.holder, self.home));
        geometry
    }
}

fn solver(ini: &Ini, errors: &mut Errors) -> Option<Solver> {
    let solver = Solver::default();
    let value = |key, errors: &mut Errors| errors.of(ini.value("PKM", key));
    let criterion = value(&of_machine::CONVERGENCE_CRITERION, errors);
    let iterations = value(&of_machine::LIMIT_ITERATIONS, errors);
    let residual_limit = value(&of_machine::RESIDUAL_LIMIT, errors);
    Some(Solver {
        convergence_criterion: criterion?.unwrap_or(solver.convergence_criterion),
        limit_iterations: iterations?.map_or(solver.limit_iterations, |limit| limit as u32),
        // 0 stands for the core's own limit.
        residual_limit: residual_limit?.unwrap_or(0.0),
        ..solver
    })
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
        expanded: ini.expanded().map(Into::into),
    }
}
