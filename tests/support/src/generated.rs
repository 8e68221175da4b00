// SPDX-License-Identifier: GPL-2.0-or-later
//! Random machines for tests: INI files, each with its meaning in plain numbers.
//!
//! They vary everything that the shipped machines have in common: offsets of joints and spindle, inches, all nine
//! letters, servo periods, second mechanisms of another kind with other letters, spare legs, chains, tables, a tilt
//! about B alone, extra axes, corrections. Expected values follow from the equations of the core's reference tracker
//! and from the algebra in this file, not from the code under test.

use crate::common::random::{RECIPES, draw};
use crate::common::reference::{State, Tracker, rod};
use kinematics::{
    Geometry, LegGeometry, LegKind, Letter, MAX_JOINTS, Machine, Matrix3, Pose, Vector3,
};
use nalgebra::{Rotation3, Unit};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// LinuxCNC's letters.
pub const LETTERS: [char; 9] = ['X', 'Y', 'Z', 'A', 'B', 'C', 'U', 'V', 'W'];

/// Recipe of the first mechanism, extra axes and the parts they carry, whether the work is on the platform; recipe of a
/// second mechanism, and the letters of its angles.
type Plan =
    (&'static str, &'static [(char, &'static str)], bool, Option<(&'static str, &'static str)>);

const PLANS: [Plan; 11] = [
    ("six struts", &[('U', ""), ('V', ""), ('W', "")], false, None),
    ("all kinds", &[('W', "LEGS"), ('V', "WORK")], false, None),
    ("five sliders", &[('C', "WORK")], false, None),
    ("slider, crank and screw, two angles", &[('B', "TOOL"), ('U', "")], false, None),
    ("four sliders, one angle", &[('A', "TOOL"), ('C', ""), ('W', "WORK")], false, None),
    ("three cranks", &[('B', "")], false, Some(("four sliders, one angle", "A"))),
    ("eight legs", &[('U', "WORK"), ('W', "")], true, None),
    ("five for three", &[('C', "WORK"), ('V', "LEGS")], false, None),
    ("rings and carriages for five", &[('C', "")], false, None),
    ("three sliders", &[('W', "")], false, Some(("wrist of cranks", "CAB"))),
    ("five rings", &[('V', "WORK"), ('U', "LEGS")], false, None),
];

/// Machines that cover every plan in mm and in inches, and with each servo period.
pub const ALL: std::ops::Range<u64> = 0..22;

const PERIODS: [u32; 3] = [250_000, 1_000_000, 2_000_000];

/// A joint, `[JOINT_N]`.
#[derive(Clone, Debug)]
pub struct Joint {
    pub home: f64,
    pub min: f64,
    pub max: f64,
    pub velocity: f64,
    pub acceleration: f64,
    /// CORRECTION_LIMIT and CORRECTION_RATE, or 0.
    pub correction: [f64; 2],
    pub is_angular: bool,
}

/// An axis, `[AXIS_L]`.
#[derive(Clone, Debug)]
pub struct Axis {
    pub letter: char,
    pub min: f64,
    pub max: f64,
    pub velocity: f64,
    pub acceleration: f64,
}

/// An extra axis.
#[derive(Clone, Debug)]
pub struct Extra {
    pub axis: Axis,
    pub joint: Joint,
    /// WORK, TOOL or LEGS; empty if it carries nothing.
    pub carries: &'static str,
    pub direction: [f64; 3],
    pub point: [f64; 3],
}

/// One mechanism.
pub struct Built {
    /// Geometry in machine units, with its reference pose.
    pub geometry: Geometry,
    pub offsets: Vec<f64>,
    pub spindle_offset: f64,
    pub first_leg: usize,
    pub first_joint: usize,
    /// LinuxCNC's letters for X Y Z A B C of the mechanism, if it moves them.
    pub letters: [Option<char>; 6],
    pub joints: Vec<Joint>,
    pub axes: Vec<Axis>,
    /// Tool vectors of tools 1 and 2 without the spindle offset.
    pub tools: [Vector3<f64>; 2],
}

/// A machine.
pub struct Generated {
    pub name: String,
    pub text: String,
    pub table: String,
    pub mechanisms: Vec<Built>,
    pub extra: Vec<Extra>,
    pub holder: Option<[f64; 3]>,
    /// Machine units per millimeter.
    pub unit: f64,
    /// Servo period in nanoseconds.
    pub period: u32,
    pub tilt_limit: Option<f64>,
    /// `[TRAJ]HOME`.
    pub home: [f64; 9],
    /// `[TRAJ]MAX_LINEAR_VELOCITY` and `MAX_ANGULAR_VELOCITY`.
    pub velocity: [f64; 2],
    /// `[TRAJ]MAX_LINEAR_ACCELERATION` and `MAX_ANGULAR_ACCELERATION`.
    pub acceleration: [f64; 2],
    pub feed_override: f64,
    pub rng: Pcg64,
}

impl Built {
    /// Returns whether the mechanism moves its coordinate `k`.
    pub fn moves(&self, k: usize) -> bool {
        self.letters[k].is_some()
    }

    /// Returns the pose in the mechanism's letters, degrees, from one of LinuxCNC's.
    pub fn own(&self, world: &[f64; 9]) -> [f64; 6] {
        let home = self.geometry.home.unwrap();
        std::array::from_fn(|k| match self.letters[k] {
            Some(letter) => world[LETTERS.iter().position(|l| *l == letter).unwrap()],
            None => home[k],
        })
    }

    /// Returns the platform's state for the legs: `pose` is that of the controlled point, and `tool` the vector from the
    /// tip to it.
    fn state(&self, tracker: &Tracker, pose: &[f64; 6], tool: &Vector3<f64>) -> State {
        let mut pose = Pose::from_degrees(*pose);
        let shift = rotation(&pose) * tool - tool;
        pose.position += shift;
        tracker.state(&pose)
    }

    /// Returns the joint values at a pose of the platform, or `None` out of reach.
    pub fn joints(&self, pose: &[f64; 6], tool: &Vector3<f64>) -> Option<Vec<f64>> {
        let tracker = Tracker::new(&self.geometry);
        let state = self.state(&tracker, pose, tool);
        let legs = self.geometry.legs().iter().enumerate();
        let mut joints = legs
            .map(|(i, leg)| {
                let span = tracker.span(leg, &state);
                if let LegKind::Ring(ring) = leg.kind {
                    let arm = Vector3::from(leg.platform) - Vector3::from(self.geometry.centre);
                    let seen = Vector3::from(leg.base) - state.centre - state.rotation * arm;
                    let axis = state.rotation.column(2);
                    // Within the ring, no strut lies in a plane with the axis.
                    if (seen - axis * axis.dot(&seen)).norm() <= ring.radius {
                        return None;
                    }
                }
                Some(native(leg, &span)? + tracker.correction(i, leg, &state) - self.offsets[i])
            })
            .collect::<Option<Vec<f64>>>()?;
        let place = Pose::from_degrees(*pose);
        let centre =
            place.position - tool + rotation(&place) * (tool + Vector3::from(self.geometry.centre));
        let table = self.geometry.layout().table().as_slice().iter();
        joints.extend(table.map(|letter| centre[letter.index()]));
        Some(joints)
    }

    /// Returns the least share left at a pose of the platform of the joint ranges that corrections leave, and of the
    /// tilt limit. It is negative beyond a limit.
    pub fn room(&self, pose: &[f64; 6], tool: &Vector3<f64>, tilt_limit: Option<f64>) -> f64 {
        let Some(joints) = self.joints(pose, tool) else { return f64::NEG_INFINITY };
        let rooms = joints.iter().zip(&self.joints).map(|(value, joint)| {
            let [limit, _] = joint.correction;
            let range = [joint.min + limit, joint.max - limit];
            (value - range[0]).min(range[1] - value) / (range[1] - range[0])
        });
        let tilt = (pose[3].to_radians().cos() * pose[4].to_radians().cos()).acos().to_degrees();
        let of_tilt = tilt_limit.map_or(f64::INFINITY, |limit| (limit - tilt) / limit);
        rooms.fold(of_tilt, f64::min)
    }
}

/// Returns R = Rz(C) Ry(B) Rx(A).
fn rotation(pose: &Pose) -> Matrix3<f64> {
    let turn = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
    let [a, b, c]: [f64; 3] = pose.angles.into();
    (turn(Vector3::z_axis(), c) * turn(Vector3::y_axis(), b) * turn(Vector3::x_axis(), a))
        .into_inner()
}

/// Returns a leg's joint value, without offset and nut rotation, between its base anchor and its platform end.
fn native(leg: &LegGeometry, span: &Vector3<f64>) -> Option<f64> {
    let on_side = |q: &f64| {
        let lower = rod(leg, *q);
        let along = span + Vector3::from(leg.base) - lower.anchor;
        along.dot(&lower.onwards) > 0.0
    };
    match leg.kind {
        LegKind::Strut(_) | LegKind::Ring(_) => Some(span.norm()),
        LegKind::Slider(slider) => {
            let guide = Vector3::from(slider.guide).normalize();
            let along = span.dot(&guide);
            let square = slider.rod.powi(2) - (span - guide * along).norm_squared();
            (square > 0.0).then(|| along + f64::from(slider.side) * square.sqrt())
        }
        LegKind::Crank(crank) => {
            let axis = Vector3::from(crank.axis).normalize();
            let arm = Vector3::from(crank.arm);
            let along = axis * axis.dot(&arm);
            let (x, y) = (span.dot(&(arm - along)), span.dot(&axis.cross(&arm)));
            let square = span.norm_squared() + arm.norm_squared() - crank.rod.powi(2);
            let cosine = (square / 2.0 - span.dot(&along)) / x.hypot(y);
            if cosine.abs() >= 1.0 {
                return None;
            }
            [1.0, -1.0]
                .map(|sign| (y.atan2(x) + sign * cosine.acos()).to_degrees())
                .map(|angle| angle - 360.0 * (angle / 360.0).round())
                .into_iter()
                .find(on_side)
        }
    }
}

impl Extra {
    fn turned(&self, value: f64) -> Rotation3<f64> {
        let axis = Unit::new_normalize(Vector3::from(self.direction));
        Rotation3::from_axis_angle(&axis, value.to_radians())
    }

    /// Returns the new position of a point that the axis carries.
    fn carried(&self, at: Vector3<f64>, value: f64) -> Vector3<f64> {
        if !self.is_angle() {
            return at + Vector3::from(self.direction).normalize() * value;
        }
        let point = Vector3::from(self.point);
        point + self.turned(value) * (at - point)
    }

    /// Returns the point that the axis carries to a position.
    fn carried_to(&self, at: Vector3<f64>, value: f64) -> Vector3<f64> {
        if !self.is_angle() {
            return at - Vector3::from(self.direction).normalize() * value;
        }
        let point = Vector3::from(self.point);
        point + self.turned(-value) * (at - point)
    }

    pub fn is_angle(&self) -> bool {
        "ABC".contains(self.axis.letter)
    }
}

impl Generated {
    /// Returns whether an axis carries something or the work is on the platform.
    pub fn is_carried(&self) -> bool {
        self.holder.is_some() || self.extra.iter().any(|extra| !extra.carries.is_empty())
    }

    /// Returns the platform's pose and tool vector for LinuxCNC's pose and a tool vector with the spindle offset.
    pub fn platform(
        &self,
        n: usize,
        world: &[f64; 9],
        tool: &Vector3<f64>,
    ) -> ([f64; 6], Vector3<f64>) {
        let built = &self.mechanisms[n];
        let own = built.own(world);
        if !self.is_carried() {
            return (own, *tool);
        }
        let carrying = |what: &'static str| {
            self.extra.iter().filter(move |extra| extra.carries == what).collect::<Vec<_>>()
        };
        let value =
            |extra: &Extra| world[LETTERS.iter().position(|l| *l == extra.axis.letter).unwrap()];
        // The tip on the work, moved by the axes under the work.
        let tip = Vector3::new(own[0], own[1], own[2]) - tool;
        let on_work = carrying("WORK").into_iter().rev();
        let tip = on_work.fold(tip, |tip, axis| axis.carried(tip, value(axis)));
        let seen_from_legs = |at: Vector3<f64>| {
            carrying("LEGS").into_iter().fold(at, |at, axis| axis.carried_to(at, value(axis)))
        };
        let turn = rotation(&Pose::from_degrees(own));
        let on_tool = carrying("TOOL");
        let (place, tool) = match self.holder {
            // The work is on the platform, and the tool is fixed in base.
            Some(holder) => {
                let rests = seen_from_legs(Vector3::from(holder) - tool);
                (rests - turn * tip, Vector3::zeros())
            }
            None if on_tool.is_empty() => (seen_from_legs(tip) + tool, *tool),
            None => {
                let on_platform =
                    on_tool.into_iter().rev().fold(-tool, |at, axis| axis.carried(at, value(axis)));
                (seen_from_legs(tip) - turn * on_platform, Vector3::zeros())
            }
        };
        ([place.x, place.y, place.z, own[3], own[4], own[5]], tool)
    }

    /// Returns the values of all joints as LinuxCNC counts them, or `None` out of reach. `tools` has a tool vector for
    /// each mechanism, with the spindle offset.
    pub fn joints(&self, world: &[f64; 9], tools: &[Vector3<f64>]) -> Option<Vec<f64>> {
        let mut all = vec![];
        for (n, built) in self.mechanisms.iter().enumerate() {
            let (pose, tool) = self.platform(n, world, &tools[n]);
            all.extend(built.joints(&pose, &tool)?);
        }
        let values = self
            .extra
            .iter()
            .map(|extra| world[LETTERS.iter().position(|l| *l == extra.axis.letter).unwrap()]);
        all.extend(values);
        Some(all)
    }

    /// Returns the mechanisms' tool vectors for a tool number, 0 for no tool.
    pub fn tools(&self, tool: usize) -> Vec<Vector3<f64>> {
        let of = |built: &Built| {
            let spindle = Vector3::z() * built.spindle_offset;
            if tool > 0 { spindle + built.tools[tool - 1] } else { spindle }
        };
        self.mechanisms.iter().map(of).collect()
    }

    /// Draws a pose of LinuxCNC within a share of all axis limits, and of the joint limits of extra axes.
    pub fn world(&mut self, share: f64) -> [f64; 9] {
        let mut world = self.home;
        let axes = self.mechanisms.iter().flat_map(|built| &built.axes);
        let axes = axes.map(|axis| (axis.letter, [axis.min, axis.max]));
        let extra = self.extra.iter().map(|Extra { axis, joint, .. }| {
            (axis.letter, [axis.min.max(joint.min), axis.max.min(joint.max)])
        });
        for (letter, [min, max]) in axes.chain(extra) {
            let k = LETTERS.iter().position(|l| *l == letter).unwrap();
            let end = if self.rng.random() { max } else { min };
            world[k] += share * self.rng.random::<f64>() * (end - world[k]);
        }
        world
    }

    /// Returns the words of a block that moves to a pose of LinuxCNC with a tool.
    pub fn words(&self, world: &[f64; 9], tool: usize) -> String {
        let mut text = String::new();
        for letter in self.letters().chars() {
            let k = LETTERS.iter().position(|own| *own == letter).unwrap();
            let of_tool = match (k, self.mechanisms.get(1)) {
                (0..3, _) => self.mechanisms[0].tools[tool - 1][k],
                (6.., Some(second)) if second.letters[k - 6].is_some() => {
                    second.tools[tool - 1][k - 6]
                }
                _ => 0.0,
            };
            let _ = write!(text, " {letter}{:.9}", world[k] - of_tool);
        }
        text
    }

    /// Writes the INI file and the tool table into a folder.
    pub fn write(&self, folder: &Path) -> PathBuf {
        let file = folder.join(format!("{}.ini", self.name));
        std::fs::write(&file, &self.text).unwrap();
        std::fs::write(file.with_extension("tbl"), &self.table).unwrap();
        file
    }

    /// Returns the letters that the machine moves.
    pub fn letters(&self) -> String {
        let own = self.mechanisms.iter().flat_map(|built| &built.axes);
        let all = own.chain(self.extra.iter().map(|extra| &extra.axis));
        all.map(|axis| axis.letter).collect()
    }
}

fn within(rng: &mut Pcg64, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

/// Draws a mechanism that is level at home, in machine units.
fn mechanism(rng: &mut Pcg64, name: &str, unit: f64, shift: f64) -> Geometry {
    let recipe = RECIPES.iter().find(|recipe| recipe.name == name).unwrap();
    for _ in 0..10_000 {
        let drawn = draw(rng, recipe).geometry;
        let scaled = |v: [f64; 3]| v.map(|x| x * unit);
        let moves_x = drawn.layout().coordinates().contains(Letter::X);
        let mut given = Geometry::of_layout(*drawn.layout(), |i| {
            let LegGeometry { base, platform, kind } = drawn.legs()[i];
            let kind = match kind {
                LegKind::Strut(mut strut) => {
                    strut.lead *= unit;
                    LegKind::Strut(strut)
                }
                LegKind::Ring(mut ring) => {
                    ring.radius *= unit;
                    LegKind::Ring(ring)
                }
                LegKind::Slider(mut slider) => {
                    slider.rod *= unit;
                    LegKind::Slider(slider)
                }
                LegKind::Crank(mut crank) => {
                    (crank.rod, crank.arm) = (crank.rod * unit, scaled(crank.arm));
                    LegKind::Crank(crank)
                }
            };
            let (mut base, mut platform) = (base, platform);
            base[0] += if moves_x { shift } else { 0.0 };
            if let LegKind::Ring(_) = kind {
                // A ring is centered on the tool axis.
                (platform[0], platform[1]) = (0.0, 0.0);
            }
            LegGeometry { base: scaled(base), platform: scaled(platform), kind }
        });
        let [x, y, z, ..] = drawn.home.unwrap();
        let x = if moves_x { x + shift } else { x };
        given.home = Some([x * unit, y * unit, z * unit, 0.0, 0.0, 0.0]);
        given.centre = scaled(drawn.centre);
        let Ok(machine) = Machine::freeze(&given, &[0.0; 8]) else { continue };
        let Ok(at) = machine.at(&Pose::from_degrees(given.home.unwrap()), &Vector3::zeros()) else {
            continue;
        };
        // Reject mechanisms near singular poses or dead points, and with close legs.
        let apart = at.nearest().map_or(f64::INFINITY, |nearest| nearest.distance);
        let ratios = at.speed_ratios().unwrap_or([f64::INFINITY; MAX_JOINTS]);
        let of_lengths = given.legs().iter().zip(ratios).filter(|(leg, _)| !leg.kind.is_angular());
        let fastest = of_lengths.map(|(_, ratio)| ratio).fold(0.0, f64::max);
        if at.smallest_singular_value() > 0.15 && apart > 0.015 * machine.size() && fastest < 2.5 {
            return given;
        }
    }
    panic!("no machine of {name}");
}

/// Draws machine `seed`.
pub fn generated(seed: u64) -> Generated {
    let mut rng = Pcg64::seed_from_u64(1000 + seed);
    let rng = &mut rng;
    let count = PLANS.len() as u64;
    let (first, extra, on_platform, second) = PLANS[(seed % count) as usize];
    let unit = if (seed + seed / count).is_multiple_of(2) { 1.0 } else { 1.0 / 25.4 };
    let period = PERIODS[(seed % 3) as usize];
    let holder: Option<[f64; 3]> =
        on_platform.then(|| std::array::from_fn(|_| unit * within(rng, -100.0, 100.0)));
    let mut home = [0.0; 9];
    let mut mechanisms = vec![];
    let recipes = [Some((first, "")), second];
    for (n, (name, angles)) in recipes.into_iter().flatten().enumerate() {
        // The two mechanisms are too far apart to collide.
        let mut geometry = mechanism(rng, name, unit, 4000.0 * n as f64);
        let layout = *geometry.layout();
        let mut angles = angles.chars();
        let mut letters = [None; 6];
        for letter in layout.coordinates().as_slice() {
            letters[letter.index()] = Some(match (n, letter.index()) {
                (0, _) => letter.name(),
                (_, k @ 0..3) => LETTERS[6 + k],
                _ => angles.next().unwrap(),
            });
        }
        for letter in layout.table().as_slice() {
            letters[letter.index()] = Some(letter.name());
        }
        let mut own = geometry.home.unwrap();
        if let Some(holder) = holder {
            // X Y Z are the tip on the platform.
            let mut machine = own;
            for k in 0..3 {
                own[k] = holder[k] - own[k];
                // Rounded like the text in the file.
                machine[k] = holder[k] - own[k];
            }
            geometry.home = Some(machine);
        }
        for (k, letter) in letters.iter().enumerate() {
            if let Some(letter) = letter {
                home[LETTERS.iter().position(|l| l == letter).unwrap()] = own[k];
            }
        }
        let (first_leg, first_joint) = mechanisms
            .last()
            .map_or((0, 0), |built: &Built| (built.geometry.legs().len(), built.joints.len()));
        let of_length = |k: usize| if k < 3 { unit } else { 1.0 };
        let axes = (0..6)
            .filter_map(|k| {
                let reach = if k < 3 { 25.0 } else { 7.0 } * of_length(k);
                Some(Axis {
                    letter: letters[k]?,
                    min: own[k] - reach * within(rng, 0.8, 1.0),
                    max: own[k] + reach * within(rng, 0.8, 1.0),
                    velocity: of_length(k) * within(rng, 30.0, 50.0),
                    acceleration: of_length(k) * within(rng, 200.0, 300.0),
                })
            })
            .collect();
        let mut built = Built {
            offsets: geometry
                .legs()
                .iter()
                .map(|leg| {
                    let unit = if leg.kind.is_angular() { 0.2 } else { unit };
                    unit * within(rng, -80.0, 80.0)
                })
                .collect(),
            geometry,
            spindle_offset: unit * within(rng, 5.0, 40.0),
            first_leg,
            first_joint,
            letters,
            joints: vec![],
            axes,
            tools: [(); 2].map(|()| {
                Vector3::from_fn(|k, _| match letters[k] {
                    // A tool must not require motion in a missing coordinate.
                    None => 0.0,
                    Some(_) if k == 2 => unit * within(rng, 10.0, 50.0),
                    Some(_) => unit * within(rng, -3.0, 3.0),
                })
            }),
        };
        let spindle = Vector3::z() * built.spindle_offset;
        let tool = if holder.is_some() { Vector3::zeros() } else { spindle };
        let values = built.joints(&built.geometry.home.unwrap(), &tool).unwrap();
        for (i, value) in values.into_iter().enumerate() {
            let is_angular = built.geometry.legs().get(i).is_some_and(|leg| leg.kind.is_angular());
            let unit = if is_angular { 0.3 } else { unit };
            let corrected = rng.random_range(0..3) == 0;
            built.joints.push(Joint {
                home: value,
                min: value - unit * within(rng, 110.0, 130.0),
                max: value + unit * within(rng, 110.0, 130.0),
                velocity: unit * within(rng, 300.0, 400.0),
                acceleration: unit * within(rng, 3000.0, 4000.0),
                correction: if corrected { [5.0 * unit, 0.2 * unit] } else { [0.0; 2] },
                is_angular,
            });
        }
        mechanisms.push(built);
    }
    let extra: Vec<Extra> = extra
        .iter()
        .map(|(letter, carries)| {
            let is_angle = "ABC".contains(*letter);
            let point = std::array::from_fn(|_| unit * within(rng, -60.0, 60.0));
            let unit = if is_angle { 1.0 } else { unit };
            // [TRAJ]HOME is level, with 0 for axes that carry something.
            let stands = is_angle || !carries.is_empty();
            let at = if stands { 0.0 } else { unit * within(rng, -20.0, 20.0) };
            home[LETTERS.iter().position(|l| l == letter).unwrap()] = at;
            let reach = if carries.is_empty() { 90.0 } else { 15.0 } * unit;
            let [speed, brake] = [unit * within(rng, 20.0, 40.0), unit * within(rng, 200.0, 300.0)];
            Extra {
                axis: Axis {
                    letter: *letter,
                    min: at - reach * within(rng, 0.8, 1.0),
                    max: at + reach * within(rng, 0.8, 1.0),
                    velocity: speed,
                    acceleration: brake,
                },
                joint: Joint {
                    home: at,
                    // One of the two joint limits is nearer than the axis limit.
                    min: at - reach * 0.7,
                    max: at + reach * 1.2,
                    velocity: 1.5 * speed,
                    acceleration: 2.0 * brake,
                    correction: [0.0; 2],
                    is_angular: is_angle,
                },
                carries,
                direction: std::array::from_fn(|_| within(rng, -2.0, 2.0)),
                point: if is_angle { point } else { [0.0; 3] },
            }
        })
        .collect();
    let layout = mechanisms[0].geometry.layout();
    let tilts_once = [Letter::A, Letter::B].iter().any(|letter| layout.is_held(*letter));
    let mut machine = Generated {
        name: format!("machine-{seed}"),
        text: String::new(),
        table: String::new(),
        mechanisms,
        extra,
        holder,
        unit,
        period,
        tilt_limit: Some(if tilts_once { 5.0 } else { 30.0 }),
        home,
        velocity: [unit * 60.0, 45.0],
        acceleration: [unit * 280.0, 250.0],
        feed_override: 1.5,
        rng: rng.clone(),
    };
    (machine.text, machine.table) = (ini(&machine), table(&machine));
    machine
}

/// Returns kinds and numbers of legs as in `[KINS]KINEMATICS`.
fn kinds(geometry: &Geometry) -> String {
    let name = |leg: &LegGeometry| match leg.kind {
        LegKind::Strut(_) => "strut",
        LegKind::Ring(_) => "ring",
        LegKind::Slider(_) => "slider",
        LegKind::Crank(_) => "crank",
    };
    let names: Vec<&str> = geometry.legs().iter().map(name).collect();
    let alike = names.chunk_by(|one, other| one == other);
    alike.map(|alike| format!("{}:{}", alike[0], alike.len())).collect::<Vec<_>>().join(",")
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

fn table(machine: &Generated) -> String {
    let line = |tool: usize| {
        let mut text = format!("T{0} P{0} D0.1", tool + 1);
        for (built, letters) in machine.mechanisms.iter().zip(["XYZ", "UVW"]) {
            let words = letters.chars().zip(&built.tools[tool]);
            for (letter, value) in words.filter(|(_, value)| **value != 0.0) {
                let _ = write!(text, " {letter}{value:+}");
            }
        }
        text + " ;drawn\n"
    };
    line(0) + &line(1)
}

fn ini(machine: &Generated) -> String {
    let name = &machine.name;
    let first = &machine.mechanisms[0];
    let letters = |of: &[Letter]| of.iter().map(|letter| letter.name()).collect::<String>();
    let layout = *first.geometry.layout();
    let mut kins = format!(
        "pkmkins legs={} coordinates={}",
        kinds(&first.geometry),
        letters(layout.coordinates().as_slice())
    );
    if !layout.table().is_empty() {
        kins += &format!(" table={}", letters(layout.table().as_slice()));
    }
    if !machine.extra.is_empty() {
        kins += " axes=";
        kins.extend(machine.extra.iter().map(|extra| extra.axis.letter));
    }
    if let [_, second] = machine.mechanisms.as_slice() {
        let coordinates = second.geometry.layout().coordinates();
        kins += &format!(
            " second={} second_coordinates={}",
            kinds(&second.geometry),
            letters(coordinates.as_slice())
        );
        let angles = coordinates.as_slice().iter().filter(|letter| letter.is_angle());
        let angles: String = angles.filter_map(|letter| second.letters[letter.index()]).collect();
        if !angles.is_empty() {
            kins += &format!(" second_angles={angles}");
        }
    }
    let joints = machine.mechanisms.iter().flat_map(|built| &built.joints);
    let joints: Vec<&Joint> =
        joints.chain(machine.extra.iter().map(|extra| &extra.joint)).collect();
    let unit = if machine.unit == 1.0 { "mm" } else { "inch" };
    let code = if machine.unit == 1.0 { "G21" } else { "G20" };
    let mut text = format!(
        "# Drawn at random, for tests.
[EMC]
VERSION = 1.1
MACHINE = {name}
[DISPLAY]
DISPLAY = axis
PROGRAM_PREFIX = .
MAX_FEED_OVERRIDE = {}
[RS274NGC]
PARAMETER_FILE = {name}.var
RS274NGC_STARTUP_CODE = {code} G17 G40 G49 G54 G64 P0.01 G80 G90 G94
[EMCMOT]
EMCMOT = motmod
COMM_TIMEOUT = 1.0
SERVO_PERIOD = {}
[TASK]
TASK = milltask
CYCLE_TIME = 0.002
[EMCIO]
EMCIO = io
CYCLE_TIME = 0.050
TOOL_TABLE = {name}.tbl
[HAL]
HALFILE = LIB:pkmkins_sim.tcl
HALFILE = LIB:pkmkins.tcl
[KINS]
KINEMATICS = {kins}
JOINTS = {}
[TRAJ]
COORDINATES = {}
HOME = {}
LINEAR_UNITS = {unit}
ANGULAR_UNITS = degree
MAX_LINEAR_VELOCITY = {}
MAX_ANGULAR_VELOCITY = {}
MAX_LINEAR_ACCELERATION = {}
MAX_ANGULAR_ACCELERATION = {}
",
        machine.feed_override,
        machine.period,
        joints.len(),
        machine.letters(),
        numbers(&machine.home),
        machine.velocity[0],
        machine.velocity[1],
        machine.acceleration[0],
        machine.acceleration[1],
    );
    for (built, section) in machine.mechanisms.iter().zip(["PKM", "SECOND"]) {
        let _ = writeln!(text, "[{section}]\nCENTRE = {}", numbers(&built.geometry.centre));
        let _ = writeln!(text, "SPINDLE_OFFSET = {}\nTOOL_DIRECTION = down", built.spindle_offset);
        if section == "PKM" {
            let _ = writeln!(text, "CONDITIONING_LIMIT = 0.06");
            let _ = writeln!(text, "ROD_CLEARANCE = {}", 2.0 * machine.unit);
            machine.tilt_limit.iter().for_each(|limit| {
                let _ = writeln!(text, "TILT_LIMIT = {limit}");
            });
            if machine.mechanisms.len() > 1 {
                let _ = writeln!(text, "MECHANISM_CLEARANCE = {}", 50.0 * machine.unit);
            }
            if let Some(holder) = &machine.holder {
                let _ = writeln!(text, "WORK_ON_PLATFORM = {}", numbers(holder));
            }
        }
        for (i, leg) in built.geometry.legs().iter().enumerate() {
            let _ = writeln!(text, "[LEG_{}]\nBASE = {}", built.first_leg + i, numbers(&leg.base));
            if let LegKind::Ring(ring) = leg.kind {
                let _ = writeln!(text, "EFFECTOR = {} {}", ring.radius, leg.platform[2]);
            } else {
                let _ = writeln!(text, "PLATFORM = {}", numbers(&leg.platform));
            }
            let _ = match leg.kind {
                LegKind::Ring(_) => Ok(()),
                LegKind::Strut(strut) if strut.lead == 0.0 => writeln!(text, "LEAD = 0"),
                LegKind::Strut(strut) => writeln!(
                    text,
                    "LEAD = {}\nBASE_N = {}\nPLATFORM_N = {}",
                    strut.lead,
                    numbers(&strut.base_axis),
                    numbers(&strut.platform_axis)
                ),
                LegKind::Slider(slider) => writeln!(
                    text,
                    "GUIDE = {}\nROD = {}\nSIDE = {}",
                    numbers(&slider.guide),
                    slider.rod,
                    slider.side
                ),
                LegKind::Crank(crank) => writeln!(
                    text,
                    "AXIS = {}\nARM = {}\nROD = {}\nSIDE = {}",
                    numbers(&crank.axis),
                    numbers(&crank.arm),
                    crank.rod,
                    crank.side
                ),
            };
            let _ = writeln!(text, "OFFSET = {}\nBASE_CONE = 60", built.offsets[i]);
        }
    }
    for extra in machine.extra.iter().filter(|extra| !extra.carries.is_empty()) {
        let _ = writeln!(
            text,
            "[CHAIN_{}]\nCARRIES = {}\nAXIS = {}",
            extra.axis.letter,
            extra.carries,
            numbers(&extra.direction)
        );
        if extra.is_angle() {
            let _ = writeln!(text, "POINT = {}", numbers(&extra.point));
        }
    }
    for (n, joint) in joints.into_iter().enumerate() {
        let kind = if joint.is_angular { "ANGULAR" } else { "LINEAR" };
        let unit = if joint.is_angular { 1.0 } else { machine.unit };
        let _ = writeln!(
            text,
            "[JOINT_{n}]\nTYPE = {kind}\nHOME = {}\nMIN_LIMIT = {}\nMAX_LIMIT = {}\nMAX_VELOCITY = {}\n\
             MAX_ACCELERATION = {}\nFERROR = {}\nMIN_FERROR = {}\nHOME_ABSOLUTE_ENCODER = 2\n\
             HOME_OFFSET = 0\nHOME_SEARCH_VEL = 0\nHOME_LATCH_VEL = 0\nHOME_SEQUENCE = 0",
            joint.home,
            joint.min,
            joint.max,
            joint.velocity,
            joint.acceleration,
            2.0 * unit,
            0.5 * unit
        );
        if let [limit, rate] = joint.correction
            && limit > 0.0
        {
            let _ = writeln!(text, "CORRECTION_LIMIT = {limit}\nCORRECTION_RATE = {rate}");
        }
    }
    let axes = machine.mechanisms.iter().flat_map(|built| &built.axes);
    for axis in axes.chain(machine.extra.iter().map(|extra| &extra.axis)) {
        let kind = if "ABC".contains(axis.letter) { "ANGULAR" } else { "LINEAR" };
        let _ = writeln!(
            text,
            "[AXIS_{}]\nTYPE = {kind}\nMIN_LIMIT = {}\nMAX_LIMIT = {}\nMAX_VELOCITY = {}\nMAX_ACCELERATION = {}",
            axis.letter, axis.min, axis.max, axis.velocity, axis.acceleration
        );
    }
    text
}
