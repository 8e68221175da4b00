// SPDX-License-Identifier: GPL-2.0-or-later
//! What a viewer needs to draw a machine, as one JSON object: docs/reference/view.md.
//!
//! A viewer needs no kinematics: the lower ends of legs follow from the joint values, and the upper ends from the
//! pose, by two formulas given there.

use crate::passive::{Passive, parts};
use crate::read::direction::ToolDirection;
use crate::read::mechanism::Mechanism;
use crate::read::models::Model;
use kinematics::{LegGeometry, LegKind, Letter, POSE_LETTERS, Vector3};
use serde::Serialize;

/// Incremented if a field is removed or changes its meaning, not if one is added.
pub const VERSION: u32 = 1;

/// A machine as a viewer sees it, in machine units and degrees; `null` for what is not limited.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scene {
    pub version: u32,
    /// Name of the INI file without its ending.
    pub machine: String,
    /// `mm` or `inch`.
    pub length_unit: &'static str,
    /// Machine units per millimeter.
    pub units_per_mm: f64,
    /// Hash that the module publishes on `pkmkins.geometry-hash`.
    pub geometry_hash: u32,
    /// Prefix of the machine's pin names.
    pub pins: &'static str,
    /// Whether an axis carries the workpiece, the tool or the legs, or the workpiece is on the platform: then the
    /// formulas do not give tool and workpiece.
    pub is_carried: bool,
    /// Whether the pose on the machine's pins is the control point of the tool. If an axis carries the tool, or
    /// the workpiece is on the platform, it is the platform's own origin, and o = 0 in the formulas.
    pub sees_tool: bool,
    /// Letters of the coordinates that the legs move.
    pub coordinates: String,
    /// Letters of the table axes, in joint order.
    pub table: String,
    /// Letters of the coordinates that constraints determine from the commanded ones.
    pub dependent: String,
    /// Letters of the extra axes, in joint order.
    pub extra: String,
    /// Reference point of the platform for legs and table, in its frame.
    pub centre: [f64; 3],
    /// Z component of the tool vector without a tool.
    pub spindle_offset: f64,
    /// Direction of tools along Z, `up` or `down`, if the file gives it.
    pub tool_direction: Option<&'static str>,
    /// A pose with its joint values.
    pub home: Home,
    pub legs: Vec<Leg>,
    /// The parts that constraints of the platform are drawn as.
    pub passive: Vec<Passive>,
    /// Legs and table axes.
    pub joints: Vec<Joint>,
    /// Limits of the moving coordinates among X Y Z A B C.
    pub axes: Vec<Axis>,
    /// Least distance between the legs' center lines.
    pub clearance: Option<f64>,
    /// Largest angle between the tool axis and its direction at A = B = C = 0.
    pub tilt_limit: Option<f64>,
    /// Conditioning at which the guard stops the machine.
    pub conditioning_limit: f64,
    /// Files with the shapes of parts.
    pub meshes: Vec<Mesh>,
    /// The extra axes, in joint order.
    pub extra_axes: Vec<ExtraAxis>,
    /// Axes that carry something; axes with the same load from the innermost outward.
    pub chain: Vec<Link>,
    /// Position of the control point of the resting tool holder in base, if the workpiece is on the platform.
    pub holder: Option<[f64; 3]>,
    /// Whether the file describes a second mechanism.
    pub is_of_pair: bool,
}

/// An axis whose coordinate equals its joint value.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExtraAxis {
    pub letter: char,
    /// Number of its joint in LinuxCNC.
    pub joint: usize,
    /// Value after homing.
    pub home: f64,
    /// Lowest value.
    pub min: f64,
    /// Highest value.
    pub max: f64,
}

/// An axis that carries something.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Link {
    pub letter: char,
    /// Number of its joint in LinuxCNC.
    pub joint: usize,
    /// `work`, `tool` or `legs`.
    pub carries: String,
    /// Whether it is rotary.
    pub is_rotary: bool,
    /// Unit vector of its direction.
    pub axis: [f64; 3],
    /// A point on the axis; 0 for a linear axis.
    pub point: [f64; 3],
}

/// The shape of a part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mesh {
    /// `base`, `platform`, `spindle` or `table`.
    pub part: &'static str,
    /// STL or OBJ file, with its absolute path.
    pub file: String,
    pub unit: &'static str,
    /// Machine units per unit of the file.
    pub scale: f64,
    /// Position and orientation of the file's zero in the frame of the part, X Y Z A B C.
    pub place: [f64; 6],
}

/// `[TRAJ]HOME`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Home {
    /// X Y Z A B C.
    pub pose: [f64; 6],
    /// Joint values of legs and table.
    pub joints: Vec<f64>,
    /// Values of the dependent coordinates, in the order of their letters.
    pub dependent: Vec<f64>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Leg {
    #[serde(flatten)]
    pub kind: Kind,
    /// Base anchor; for sliders the zero of the guide, for cranks the hip.
    pub base: [f64; 3],
    /// Platform anchor, in the platform's frame; for rings the center.
    pub platform: [f64; 3],
    /// Offset between the joint's zero and the leg's value.
    pub offset: f64,
    /// Half angle of the cone about the leg's direction at home, in base.
    pub base_cone: Option<f64>,
    /// Half angle of the same cone, in the platform.
    pub platform_cone: Option<f64>,
}

/// Values that only one kind of leg has.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Kind {
    Strut {
        /// Travel of the screw per turn, with its hand as the sign.
        lead: f64,
    },
    /// A telescopic strut to a ring about the tool axis.
    Ring {
        /// Radius of the ring.
        radius: f64,
    },
    /// A rod on a carriage.
    Slider {
        /// Unit vector along the guide.
        guide: [f64; 3],
        /// Length of the rod.
        rod: f64,
    },
    /// A rod on an arm.
    Crank {
        /// Unit vector along the arm's axis.
        axis: [f64; 3],
        /// Vector from the hip to the arm's end at 0 degrees.
        arm: [f64; 3],
        /// Length of the rod.
        rod: f64,
    },
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Joint {
    /// Number of the joint in LinuxCNC.
    pub number: usize,
    /// Name in reports, such as `strut 3`.
    pub name: String,
    /// `strut`, `carriage`, `arm` or `table`.
    pub kind: &'static str,
    pub unit: &'static str,
    /// Lowest value.
    pub min: f64,
    /// Highest value.
    pub max: f64,
    /// Largest speed, units per second.
    pub max_velocity: f64,
}

/// Limits of a coordinate.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Axis {
    pub letter: char,
    /// Lowest value.
    pub min: f64,
    /// Highest value.
    pub max: f64,
}

impl Scene {
    pub fn new(config: &Mechanism) -> Self {
        let layout = config.machine.layout();
        let letters = |letters: &[Letter]| letters.iter().map(|letter| letter.name()).collect();
        let moved = Letter::ALL.into_iter().filter(|letter| !layout.is_held(*letter));
        let axis = |letter: Letter| {
            let axis = &config.axes[letter.index()];
            Axis { letter: letter.name(), min: axis.min, max: axis.max }
        };
        let stem = config.file.file_stem().unwrap_or_default();
        let dependent = config.dependent();
        let full = config.machine.full_pose(&config.home_pose(), &config.spindle);
        let full = full.map_or(config.home, |pose| pose.to_degrees());
        Self {
            version: VERSION,
            machine: stem.to_string_lossy().into_owned(),
            length_unit: config.length_unit(),
            units_per_mm: config.units_per_mm,
            geometry_hash: config.hash,
            pins: if config.place.is_second { "pkmkins.second." } else { "pkmkins." },
            is_carried: !config.chain.is_empty(),
            sees_tool: !config.chain.is_bare(),
            coordinates: letters(layout.coordinates().as_slice()),
            table: letters(layout.table().as_slice()),
            dependent: letters(&dependent),
            extra: config.extra_axes.letters().collect(),
            centre: config.geometry.centre,
            spindle_offset: config.spindle.z,
            tool_direction: config.tool_direction.map(ToolDirection::name),
            home: Home {
                pose: config.home,
                joints: config.joints.iter().map(|joint| joint.home).collect(),
                dependent: dependent.iter().map(|letter| full[letter.index()]).collect(),
            },
            legs: (0..config.legs()).map(|i| Leg::new(config, i)).collect(),
            passive: parts(config),
            joints: (0..config.joints.len()).map(|i| Joint::new(config, i)).collect(),
            axes: moved.map(axis).collect(),
            clearance: config.clearance,
            tilt_limit: config.tilt_limit,
            conditioning_limit: config.conditioning_limit,
            meshes: config.models.iter().map(Mesh::new).collect(),
            extra_axes: (0..config.extra.len()).map(|n| ExtraAxis::new(config, n)).collect(),
            chain: config.chain.links().iter().map(|link| Link::new(config, link)).collect(),
            holder: config.chain.holder().map(|holder| (*holder).into()),
            is_of_pair: config.second_letters.is_some(),
        }
    }

    /// Returns the JSON object.
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).expect("numbers and names") + "\n"
    }
}

impl ExtraAxis {
    fn new(config: &Mechanism, n: usize) -> Self {
        let extra = &config.extra[n];
        let [min, max] = extra.range();
        Self {
            letter: extra.letter,
            joint: config.place.first_extra_joint + n,
            home: config.extra_home()[n],
            min,
            max,
        }
    }
}

impl Link {
    fn new(config: &Mechanism, link: &kinematics::Link) -> Self {
        let n = config.extra_axes.places().position(|place| place == link.place);
        Self {
            letter: POSE_LETTERS[link.place],
            joint: config.place.first_extra_joint + n.expect("what carries is an extra axis"),
            carries: link.carries.name().to_ascii_lowercase(),
            is_rotary: link.is_rotary(),
            axis: link.axis.into(),
            point: link.point.into(),
        }
    }
}

impl Mesh {
    fn new(Model { part, file, unit, scale, place }: &Model) -> Self {
        // Without a current directory the path stays as given.
        let file = std::path::absolute(file).unwrap_or_else(|_| file.clone());
        let file = file.to_string_lossy().into_owned();
        Self { part, file, unit, scale: *scale, place: *place }
    }
}

impl Leg {
    fn new(config: &Mechanism, i: usize) -> Self {
        let LegGeometry { base, platform, kind } = config.geometry.legs()[i];
        let [base_cone, platform_cone] = config.angles[i].cones;
        Self {
            kind: Kind::of(&kind),
            base,
            platform,
            offset: config.offsets[i],
            base_cone,
            platform_cone,
        }
    }
}

impl Kind {
    fn of(kind: &LegKind) -> Self {
        let unit = |v: [f64; 3]| Vector3::from(v).normalize().into();
        match *kind {
            LegKind::Strut(strut) => Self::Strut { lead: strut.lead },
            LegKind::Ring(ring) => Self::Ring { radius: ring.radius },
            LegKind::Slider(slider) => Self::Slider { guide: unit(slider.guide), rod: slider.rod },
            LegKind::Crank(crank) => {
                Self::Crank { axis: unit(crank.axis), arm: crank.arm, rod: crank.rod }
            }
        }
    }
}

impl Joint {
    fn new(config: &Mechanism, i: usize) -> Self {
        let joint = config.joint(i);
        Self {
            number: config.place.first_joint + i,
            name: joint.name.clone(),
            kind: joint.kind.name(),
            unit: config.unit_of(i),
            min: joint.min,
            max: joint.max,
            max_velocity: joint.max_velocity,
        }
    }
}
