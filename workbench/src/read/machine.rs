// SPDX-License-Identifier: GPL-2.0-or-later
//! A machine as its INI file describes it: the geometry for the core, and what only
//! host tools use (cones, limits, speeds).
//!
//! What is refused here does not start in LinuxCNC: hal/pkmkins.tcl runs `pkmkins-pins`, which reads with it.

use crate::read::boxes::{self, BoxSection};
use crate::read::chain;
use crate::read::direction::ToolDirection;
use crate::read::error::{Errors, MachineError};
use crate::read::ini::{Entry, Ini, IniError};
use crate::read::joints::{Axis, ExtraAxis, Group, Joint, JointKind};
use crate::read::legs::check_leg_sections;
use crate::read::models::Model;
use crate::read::place::Place;
use crate::read::places;
use crate::read::values::Values;
use keys::{machine as of_machine, second as of_second};
use kinematics::{
    Chain, ExtraAxes, Fault, Geometry, Letter, Load, MAX_EXTRA, Machine, POSE_LETTERS, PerLeg,
    Pose, Second, Solver, Vector3, World,
};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Load parameters of the module, in the order that [`Load::parse`] takes them; the next ones are those
/// of [`Load::with_axes`] and [`Load::with_boxes`], then those of a second mechanism.
const PARAMETERS: [&str; 9] = [
    "legs",
    "coordinates",
    "table",
    "axes",
    "boxes",
    "second",
    "second_coordinates",
    "second_angles",
    "second_boxes",
];

/// Why a file with `sparm=` is not judged.
const IDENTITY_FIRST: &str = "pkm judges a machine that LinuxCNC starts in its own kinematics, and sparm=identityfirst \
     starts it in the identity: expected a copy of the file without sparm=, the machine is the same";

/// Those that may be given without a value.
const MAY_BE_EMPTY: [&str; 3] = ["table", "axes", "second_angles"];

/// What LinuxCNC's interpreter needs to read programs as this machine does.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    /// `[RS274NGC]PARAMETER_FILE`, or what LinuxCNC takes without it, beside the INI file; `None` keeps nothing.
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

/// A machine with everything its INI file says that this crate uses; of two mechanisms the first one.
#[derive(Clone, Debug)]
pub struct Mechanism {
    /// Which mechanism of the file it is.
    pub place: Place,
    /// Letters of a second mechanism.
    pub second_letters: Option<Second>,
    /// The second mechanism of the file as a machine in its own coordinates, if there is one.
    pub second: Option<Box<Mechanism>>,
    /// Smallest distance of the legs and the platform of one of two mechanisms from those of the
    /// other, machine units, `[PKM]MECHANISM_CLEARANCE`.
    pub mechanism_clearance: Option<f64>,
    /// `[TRAJ]HOME` as LinuxCNC has it, X Y Z A B C U V W.
    pub world_home: [f64; 9],
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
    /// `[TRAJ]HOME` in its own letters, which programs begin at: x y z in machine units, a b c in degrees.
    pub start: [f64; 6],
    /// The machine's own pose there.
    pub home: [f64; 6],
    /// Tool vector without a tool: the spindle offset along Z, machine units.
    pub spindle: Vector3<f64>,
    /// Which way tools point, `[PKM]TOOL_DIRECTION`.
    pub tool_direction: Option<ToolDirection>,
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
    /// `[AXIS_X]` to `[AXIS_C]`, or those of the letters that stand for them, of what programs say.
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
    /// Shapes of parts, for who draws the machine.
    pub models: Vec<Model>,
    /// `[BOX_K]`: boxes for the start without a seed.
    pub boxes: Vec<BoxSection>,
    /// Why there are none although the file names some, see [`Mechanism::read_without_boxes`].
    pub refused_boxes: Option<MachineError>,
}

/// A second mechanism of a machine that has one.
#[derive(Debug, thiserror::Error)]
#[error("--mechanism 2: {} has one mechanism; second= in [KINS]KINEMATICS gives another", .0.display())]
pub struct OneMechanism(pub PathBuf);

impl Mechanism {
    /// Reads a machine from its INI file.
    ///
    /// # Errors
    /// The file, one of its values, or the geometry is refused.
    pub fn read(file: &Path) -> Result<Self, MachineError> {
        Self::from_ini(&Ini::read(file)?)
    }

    /// The same, also of a file whose boxes are refused, as those of another geometry are: for who looks at
    /// everything, or writes them again.
    ///
    /// # Errors
    /// As [`Mechanism::read`], but for the boxes.
    pub fn read_without_boxes(file: &Path) -> Result<Self, MachineError> {
        Self::from_ini_without_boxes(&Ini::read(file)?)
    }

    /// A machine from an INI file already read.
    ///
    /// # Errors
    /// One of the values, or the geometry is refused.
    pub fn from_ini(ini: &Ini) -> Result<Self, MachineError> {
        refuse_identity(ini)?;
        Self::loaded(ini)
    }

    /// As [`Mechanism::from_ini`], also of a machine that LinuxCNC starts in the identity: its geometry is the same.
    ///
    /// # Errors
    /// One of the values, or the geometry is refused.
    pub fn loaded(ini: &Ini) -> Result<Self, MachineError> {
        let config = Self::loaded_without_boxes(ini)?;
        let refused = config.mechanisms().find_map(|mechanism| mechanism.refused_boxes.clone());
        refused.map_or(Ok(config), Err)
    }

    /// As [`Mechanism::read_without_boxes`], from an INI file already read.
    ///
    /// # Errors
    /// One of the values, or the geometry is refused.
    pub fn from_ini_without_boxes(ini: &Ini) -> Result<Self, MachineError> {
        refuse_identity(ini)?;
        Self::loaded_without_boxes(ini)
    }

    fn loaded_without_boxes(ini: &Ini) -> Result<Self, MachineError> {
        let load = load(ini)?;
        let second = Place::second(&load).zip(load.of_second());
        let legs = load.layout.legs() + second.as_ref().map_or(0, |(_, own)| own.layout.legs());
        let mut errors = Errors::default();
        errors.of(check_joints(ini, &load));
        errors.of(check_leg_sections(ini, legs));
        errors.of(check_coordinates(ini, &load));
        errors.of(check_second_sections(ini, &load));
        // Where these are wrong, what follows only repeats it.
        errors.checked()?;
        let mut errors = Errors::default();
        let first = Place::first(&load);
        let read = Values::read(ini, &load, &first, &mut errors);
        let of_second = second
            .map(|(place, load)| (Values::read(ini, &load, &place, &mut errors), load, place));
        let (read, of_second) = match of_second {
            None => (errors.value(read)?, None),
            Some((own, load, place)) => {
                let (read, own) = errors.value(read.zip(own))?;
                (read, Some((own, load, place)))
            }
        };
        let mut config = Self::of_values(ini, &load, first, read)?;
        if let Some((own, load, place)) = of_second {
            config.second = Some(Box::new(Self::of_values(ini, &load, place, own)?));
        }
        Ok(config)
    }

    /// Of the values of a mechanism, whose load parameters are as if it were alone.
    fn of_values(ini: &Ini, load: &Load, place: Place, read: Values) -> Result<Self, MachineError> {
        let refused = |fault| MachineError::of_geometry(ini, &place, fault);
        let geometry = read.geometry(load);
        let machine = Machine::freeze(&geometry, &read.offsets).map_err(refused)?;
        let chain = Chain::freeze(&read.chain, &load.extra, &load.layout, machine.size());
        let chain = chain.map_err(refused)?;
        let hash = read.chain.hash(&load.extra, geometry.hash());
        let boxes = boxes::read(ini, load, &place).map_err(MachineError::from);
        let boxes = boxes.and_then(|boxes| {
            let checked = boxes::check(&boxes, hash);
            checked.map(|()| boxes).map_err(|fault| boxes::refused(ini, &place, fault, hash))
        });
        let (boxes, refused_boxes) = match boxes {
            Ok(boxes) => (boxes, None),
            Err(error) => (vec![], Some(error)),
        };
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
            place,
            second_letters: load.second().copied(),
            second: None,
            mechanism_clearance: read.mechanism_clearance,
            world_home: read.world_home,
            machine,
            home: geometry.home.unwrap_or(read.home),
            geometry,
            chain,
            hash,
            offsets: read.offsets,
            start: read.home,
            spindle,
            tool_direction: read.tool_direction,
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
            models: read.models,
            program: program(ini),
            boxes,
            refused_boxes,
            ini: Arc::new(ini.clone()),
        })
    }

    /// Its mechanisms, the first one first.
    pub fn mechanisms(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(self.second.as_deref())
    }

    /// Returns one mechanism alone, the first or, for 2, the second.
    ///
    /// # Errors
    /// The machine has one mechanism.
    pub fn mechanism(mut self, number: u8) -> Result<Self, OneMechanism> {
        match (number, self.second.take()) {
            (2, Some(second)) => Ok(*second),
            (2, None) => Err(OneMechanism(self.file)),
            _ => Ok(self),
        }
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

    /// Values of the extra axes in a pose of LinuxCNC's, in joint order.
    pub fn extra_of(&self, world: &World) -> Vec<f64> {
        self.extra_axes.places().map(|place| world[place]).collect()
    }

    /// Their values at `[TRAJ]HOME`.
    pub fn extra_home(&self) -> Vec<f64> {
        self.extra_of(&self.world_home)
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

    /// Number of joints of legs and table, those of a second mechanism included: behind them stand
    /// those of extra axes.
    pub fn guarded_joints(&self) -> usize {
        self.mechanisms().map(|mechanism| mechanism.joints.len()).sum()
    }

    /// The joints of legs and table, of a second mechanism and of extra axes, as LinuxCNC counts them.
    pub fn all_joints(&self) -> impl Iterator<Item = &Joint> {
        let own = self.mechanisms().flat_map(|mechanism| &mechanism.joints);
        own.chain(self.extra.iter().map(|axis| &axis.joint))
    }

    /// Joint `i` of [`Mechanism::all_joints`].
    ///
    /// # Panics
    /// If there is none.
    pub fn joint(&self, i: usize) -> &Joint {
        self.all_joints().nth(i).expect("a joint of the machine")
    }

    /// Unit of the values of joint `i`.
    pub fn unit_of(&self, i: usize) -> &'static str {
        match i.checked_sub(self.guarded_joints()) {
            Some(n) => self.extra[n].unit(self.length_unit()),
            None => self.unit(self.joint(i).kind),
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

/// What LinuxCNC's modules call the load parameter that chooses the kinematics to start in.
const SPARM: &str = "sparm=";

/// Refuses a machine that LinuxCNC starts in the identity.
fn refuse_identity(ini: &Ini) -> Result<(), IniError> {
    let entry = ini.first("KINS", "KINEMATICS");
    let given = entry.filter(|entry| entry.words().any(|word| word.starts_with(SPARM)));
    given.map_or(Ok(()), |entry| Err(ini.refuse(entry, IDENTITY_FIRST)))
}

/// The load parameters in `[KINS]KINEMATICS`.
pub(super) fn load(ini: &Ini) -> Result<Load, IniError> {
    let expected = "expected pkmkins [legs=KIND:COUNT[,KIND:COUNT]] [coordinates=LETTERS] [table=LETTERS] [axes=LETTERS] [boxes=COUNT] [second=KIND:COUNT[,KIND:COUNT] second_coordinates=LETTERS [second_angles=LETTERS] [second_boxes=COUNT]]";
    let entry = ini.require("KINS", "KINEMATICS", expected)?;
    let mut words = entry.value.split_ascii_whitespace();
    if words.next() != Some("pkmkins") {
        return Err(ini.refuse(entry, expected));
    }
    let mut given: [Option<&[u8]>; PARAMETERS.len()] = [None; PARAMETERS.len()];
    for word in words.filter(|word| !word.starts_with(SPARM)) {
        let place = word
            .split_once('=')
            .and_then(|(name, text)| Some((PARAMETERS.iter().position(|p| *p == name)?, text)));
        let (place, text) = place.ok_or_else(|| ini.refuse(entry, expected))?;
        let name = PARAMETERS[place];
        // Of several LinuxCNC takes the last one, and an empty one for none.
        if given[place].is_some() {
            return Err(ini.refuse(entry, &format!("expected {name}= once; {expected}")));
        }
        if text.is_empty() && !MAY_BE_EMPTY.contains(&name) {
            return Err(ini.refuse(entry, &format!("expected a value after {name}=; {expected}")));
        }
        given[place] = Some(text.as_bytes());
    }
    let [legs, coordinates, table, axes, boxes, second, of_second @ ..] = given;
    let [second_coordinates, second_angles, second_boxes] = of_second;
    Load::parse(legs, coordinates, table)
        .and_then(|load| load.with_second(second, second_coordinates, second_angles))
        .and_then(|load| load.with_axes(axes))
        .and_then(|load| load.with_boxes(boxes))
        .and_then(|load| load.with_second_boxes(second_boxes))
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
    let wanted: String = moved_letters(load).collect();
    let expected = format!("expected the letters {wanted} that [KINS]KINEMATICS moves");
    let entry = ini.require("TRAJ", "COORDINATES", &expected)?;
    let given = entry.value.to_ascii_uppercase();
    match moved_letters(load).find(|letter| !given.contains(*letter)) {
        None => Ok(()),
        Some(letter) => Err(ini.refuse(entry, &format!("{expected}, {letter} is missing"))),
    }
}

/// Letters that the machine moves: those of the platform, the table, a second mechanism and extra axes.
pub(super) fn moved_letters(load: &Load) -> impl Iterator<Item = char> {
    let letters = Letter::ALL.into_iter().filter(|letter| !load.layout.is_held(*letter));
    let second = load.second().into_iter().flat_map(Second::places).map(|k| POSE_LETTERS[k]);
    letters.map(Letter::name).chain(second).chain(load.extra.letters())
}

/// What only a second mechanism has.
fn check_second_sections(ini: &Ini, load: &Load) -> Result<(), IniError> {
    let mut names = ini.sections();
    let is_own = |name: &str| name == "SECOND" || name.starts_with("SECOND_BOX_");
    match names.find(|name| is_own(name)).filter(|_| load.second().is_none()) {
        Some(name) => Err(ini.refuse_section(
            name,
            "one section too many; [KINS]KINEMATICS has no second mechanism, second=",
        )),
        None => {
            let key = of_machine::MECHANISM_CLEARANCE.name;
            match ini.first("PKM", key).filter(|_| load.second().is_none()) {
                Some(entry) => {
                    let text = "it is for two mechanisms, and [KINS]KINEMATICS has no second=";
                    Err(ini.refuse(entry, text))
                }
                None => ini.check_keys("SECOND", of_second::ALL.iter().copied()),
            }
        }
    }
}

fn program(ini: &Ini) -> Program {
    let text = |section, key| ini.first(section, key).map(|e: &Entry| e.value.clone());
    let folder = ini.file().parent().unwrap_or(Path::new(""));
    let parameters = text("RS274NGC", "PARAMETER_FILE").filter(|name| !name.is_empty());
    let parameters = parameters.unwrap_or(places::PARAMETERS.into());
    Program {
        parameter_file: Some(folder.join(parameters)),
        tool_table: text("EMCIO", "TOOL_TABLE").map(|name| folder.join(name)),
        startup_code: text("RS274NGC", "RS274NGC_STARTUP_CODE"),
        random_tools: text("EMCIO", "RANDOM_TOOLCHANGER").is_some_and(|value| value == "1"),
        expanded: ini.expanded().map(Into::into),
    }
}
