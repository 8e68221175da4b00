// SPDX-License-Identifier: GPL-2.0-or-later
//! One mechanism of an INI file: the geometry for the core, and values for host tools only (cones, limits, speeds).

use crate::read::boxes::{self, BoxSection};
use crate::read::chain;
use crate::read::constraints::constraint;
use crate::read::direction::{self, ToolDirection};
use crate::read::error::{Errors, MachineError};
use crate::read::facts::FileFacts;
use crate::read::ini::Ini;
use crate::read::joints::{Axis, ExtraAxis, Group, Joint, JointKind, axis, extra, joint};
use crate::read::legs::leg_geometry;
use crate::read::models::{self, Model};
use crate::read::place::Place;
use keys::{leg as of_leg, machine as of_machine};
use kinematics::{
    CONDITIONING_LIMIT, Chain, ChainGeometry, ExtraAxes, Fault, Geometry, Letter, Load, MAX_EXTRA,
    Machine, POSE_LETTERS, PerLeg, Pose, Solver, Vector3, World,
};
use std::ops::Deref;
use std::sync::Arc;

/// A mechanism of a machine in its own coordinates; it derefs to the facts of its file.
#[derive(Clone, Debug)]
pub struct Mechanism {
    /// Facts of the machine as a whole.
    pub facts: Arc<FileFacts>,
    /// Location in the file.
    pub place: Place,
    /// Checked and frozen geometry.
    pub machine: Machine,
    /// The geometry as given.
    pub geometry: Geometry,
    /// Joint offsets, `[LEG_N]OFFSET`.
    pub offsets: PerLeg,
    /// Loads of the extra axes.
    pub chain: Chain,
    /// Hash of geometry and chain, as the module publishes it.
    pub hash: u32,
    /// `[TRAJ]HOME` in its own letters, the start of programs: x y z in machine units, a b c in degrees.
    pub start: [f64; 6],
    /// The machine's own pose there.
    pub home: [f64; 6],
    /// Tool vector without a tool: the spindle offset along Z, machine units.
    pub spindle: Vector3<f64>,
    /// Direction of tools, `[PKM]TOOL_DIRECTION`.
    pub tool_direction: Option<ToolDirection>,
    /// Settings of forward kinematics.
    pub solver: Solver,
    /// Largest angles of the joints of each leg.
    pub angles: Vec<LegAngles>,
    /// Conditioning at which the module's guard stops the machine, `[PKM]CONDITIONING_LIMIT`.
    pub conditioning_limit: f64,
    /// Smallest distance between the legs' center lines, machine units, `[PKM]ROD_CLEARANCE`.
    pub clearance: Option<f64>,
    /// Largest angle between the tool axis and its direction at A = B = C = 0, degrees,
    /// `[PKM]TILT_LIMIT`.
    pub tilt_limit: Option<f64>,
    /// `[JOINT_N]`: legs, then table axes.
    pub joints: Vec<Joint>,
    /// Axes after all mechanisms that pass a coordinate through, `axes=`; none for a second mechanism.
    pub extra_axes: ExtraAxes,
    /// Their limits, in joint order.
    pub extra: Vec<ExtraAxis>,
    /// `[AXIS_X]` to `[AXIS_C]`, or those of the corresponding letters: limits of programmed coordinates.
    pub programmed: Vec<Axis>,
    /// Limits of the machine's own coordinates: equal to `programmed` unless an axis carries something.
    pub axes: Vec<Axis>,
    /// Shapes of parts, for viewers.
    pub models: Vec<Model>,
    /// `[BOX_K]`: pose boxes for the start without a seed.
    pub boxes: Vec<BoxSection>,
    /// Why the boxes of the file are refused, if the reader accepts that.
    pub refused_boxes: Option<MachineError>,
}

/// Largest angles of a leg from its direction at home, degrees: at the base, and at the platform in its frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LegAngles {
    /// Half angles of the cones about that direction.
    pub cones: [Option<f64>; 2],
    /// Largest angles about the axis of the joint that is fixed in base or platform, and across it.
    pub pyramids: [Option<[f64; 2]>; 2],
}

impl Deref for Mechanism {
    type Target = FileFacts;

    fn deref(&self) -> &FileFacts {
        &self.facts
    }
}

impl Mechanism {
    /// Reads a mechanism of a file; `load` describes it alone. Reads every value, even after
    /// a wrong one.
    ///
    /// `None` if a value is wrong; an error if the geometry is refused.
    pub(super) fn read(
        facts: Option<&Arc<FileFacts>>,
        ini: &Ini,
        (place, load): &(Place, Load),
        errors: &mut Errors,
    ) -> Option<Result<Self, MachineError>> {
        let legs = load.layout.legs();
        errors.of(ini.check_keys("PKM", of_machine::ALL.iter().copied()));
        let machine = |key, errors: &mut Errors| errors.of(ini.value("PKM", key));
        // Only the module uses these; the last one for struts without their own lead.
        for key in [&of_machine::MAX_ERROR, &of_machine::FEED_FLOOR, &of_machine::SCREW_LEAD] {
            machine(key, errors);
        }
        let carried = match (place.is_second, load.second()) {
            (true, _) => Some(ChainGeometry::NONE),
            (_, Some(_)) => errors.of(chain::refuse(ini)).map(|()| ChainGeometry::NONE),
            (_, None) => chain::geometry(ini, load, errors),
        };
        let section = place.machine_section();
        let centre = errors.of(ini.values(section, &of_machine::CENTRE));
        let spindle = errors.of(ini.value(section, &of_machine::SPINDLE_OFFSET));
        let tool_direction = errors.of(direction::read(ini, section, spindle.flatten()));
        let of_legs = errors.each(legs, |n, errors| {
            leg_geometry(ini, &place.leg_section(n), load.kinds()[n], errors)
        });
        let constraints =
            errors.each(load.layout.constraints(), |n, errors| constraint(ini, n, errors));
        let offsets = errors
            .each(legs, |n, errors| errors.of(ini.value(&place.leg_section(n), &of_leg::OFFSET)));
        let angles = errors.each(legs, |n, errors| leg_angles(ini, &place.leg_section(n), errors));
        let solver = solver(ini, errors);
        let conditioning_limit = machine(&of_machine::CONDITIONING_LIMIT, errors);
        let clearance = machine(&of_machine::ROD_CLEARANCE, errors);
        let tilt_limit = machine(&of_machine::TILT_LIMIT, errors);
        let joints =
            errors.each(load.layout.joints(), |n, errors| joint(ini, n, (load, place), errors));
        let extra = errors.each(load.extra.len(), |n, errors| extra(ini, n, load, errors));
        let programmed = errors.each(Letter::ALL.len(), |n, errors| {
            let letter = Letter::ALL[n];
            let is_of_others = load.other_places().any(|k| k == place.places[n]);
            match is_of_others || (place.is_second && load.layout.is_held(letter)) {
                // The coordinate of another mechanism or of an extra axis does not belong to the tool.
                true => Some(Axis::UNLIMITED),
                false => axis(ini, &place.axis_section(letter), errors),
            }
        });
        let models = match place.is_second {
            true => Some(vec![]),
            false => models::read(ini, facts.map_or(1.0, |facts| facts.units_per_mm), errors),
        };
        let (facts, carried) = (facts?.clone(), carried?);
        let mut padded = PerLeg::default();
        padded.iter_mut().zip(offsets?).for_each(|(to, given)| *to = given.unwrap_or(0.0));
        let [x, y, z, a, b, c, u, v, w] = facts.world_home;
        let mut start = if place.is_second { [u, v, w, 0.0, 0.0, 0.0] } else { [x, y, z, a, b, c] };
        if place.is_second {
            // The letter of a coordinate that it holds may be an extra axis.
            let held = Letter::ALL.into_iter().filter(|letter| load.layout.is_held(*letter));
            held.for_each(|letter| start[letter.index()] = 0.0);
        }
        let home = ChainGeometry::machine_home(carried.holder, start);
        let (of_legs, constraints) = (of_legs?, constraints?);
        let mut geometry =
            Geometry::of_layout(load.layout, |n| of_legs[n]).with_constraints(|n| constraints[n]);
        (geometry.centre, geometry.home) = (centre?.unwrap_or_default(), Some(home));
        let spindle = Vector3::new(0.0, 0.0, spindle?.unwrap_or(0.0));
        let (programmed, extra) = (programmed?, extra?);
        let frozen = Machine::freeze(&geometry, &padded).and_then(|machine| {
            let chain = Chain::freeze(&carried, &load.extra, &load.layout, machine.size())?;
            Ok((machine, chain))
        });
        let (machine, chain) = match frozen {
            Ok(frozen) => frozen,
            Err(fault) => return Some(Err(MachineError::of_geometry(ini, place, fault))),
        };
        let hash = carried.hash(&load.extra, geometry.hash());
        let (boxes, refused_boxes) = match boxes::read(ini, load, place, hash) {
            Ok(boxes) => (boxes, None),
            Err(error) => (vec![], Some(error)),
        };
        Some(Ok(Self {
            facts,
            place: *place,
            axes: chain::machine_axes(&chain, &programmed, &extra, &load.layout, &spindle),
            machine,
            geometry,
            offsets: padded,
            chain,
            hash,
            start,
            home,
            spindle,
            tool_direction: tool_direction?,
            solver: solver?,
            angles: angles?,
            conditioning_limit: conditioning_limit?.unwrap_or(CONDITIONING_LIMIT),
            clearance: clearance?,
            tilt_limit: tilt_limit?.filter(|limit| *limit != 0.0),
            joints: joints?,
            extra_axes: load.extra,
            extra,
            programmed,
            models: models?,
            boxes,
            refused_boxes,
        }))
    }

    /// Returns whether the module refuses a change of the tool offset that moves the platform: axes carry something
    /// beside constraints, so that the path of the platform is not known.
    pub fn refuses_tool_motion(&self) -> bool {
        !self.chain.is_empty() && self.machine.layout().constraints() > 0
    }

    /// Returns LinuxCNC's pose for the tool's commanded pose and these values of the extra axes.
    pub fn world(&self, pose: &[f64; 6], extra: &[f64; MAX_EXTRA]) -> World {
        let mut world = [0.0; 9];
        world[..6].copy_from_slice(pose);
        for (place, value) in self.extra_axes.places().zip(extra) {
            world[place] = *value;
        }
        world
    }

    /// Returns the values of the extra axes in one of LinuxCNC's poses, in joint order.
    pub fn extra_of(&self, world: &World) -> Vec<f64> {
        self.extra_axes.places().map(|place| world[place]).collect()
    }

    /// Returns the values of the extra axes after homing. `[TRAJ]HOME` may leave them out.
    pub fn extra_home(&self) -> Vec<f64> {
        self.extra.iter().map(|axis| axis.joint.home).collect()
    }

    /// Returns the words of a program at a commanded position, whose X Y Z A B C are its own.
    pub fn words(&self, world: &World) -> Vec<(char, f64)> {
        let own = self.places().map(|(place, k)| (place, world[k]));
        in_order(own.chain(self.extra_axes.places().map(|place| (place, world[place]))))
    }

    /// Returns the coordinates that it moves: indices among LinuxCNC's letters and among its own.
    pub(super) fn places(&self) -> impl Iterator<Item = (usize, usize)> {
        let moved =
            Letter::ALL.into_iter().filter(|letter| !self.machine.layout().is_held(*letter));
        moved.map(|letter| (self.place.places[letter.index()], letter.index()))
    }

    /// Returns a commanded pose of the tool for reports, with the angles of the extra axes.
    pub fn reported_pose(&self, pose: &[f64; 6], extra: &[f64; MAX_EXTRA]) -> [f64; 6] {
        let [x, y, z, a, b, c, ..] = self.world(pose, extra);
        [x, y, z, a, b, c]
    }

    /// Converts one of LinuxCNC's poses to the machine's own pose, with this tool vector, spindle offset included.
    ///
    /// # Errors
    /// As [`Machine::pose_of_world`].
    pub fn carried(
        &self,
        pose: &[f64; 6],
        extra: &[f64; MAX_EXTRA],
        tool: &Vector3<f64>,
    ) -> Result<[f64; 6], Fault> {
        if self.chain.is_empty() {
            return Ok(*pose);
        }
        self.machine.pose_of_world(&self.chain, &self.world(pose, extra), tool)
    }

    /// Returns the tip on the work and the direction from it to the holder there, for the machine's own pose, LinuxCNC's pose
    /// and the tool vector, spindle offset included: along the tool vector, or along Z of a spindle without a tool. `None` if
    /// no axis carries anything, or constraints refuse the pose.
    pub fn on_work(
        &self,
        pose: &Pose,
        world: &World,
        tool: &Vector3<f64>,
    ) -> Option<[[f64; 3]; 2]> {
        if self.chain.is_empty() {
            return None;
        }
        let tip = Vector3::new(world[0], world[1], world[2]) - tool;
        let platform = match self.machine.layout().constraints() {
            0 => *pose,
            _ => self.machine.full_pose(pose, &self.chain.machine_tool(tool)).ok()?,
        };
        let [holder, work] = self.chain.frames(&platform, world);
        let own = tool.try_normalize(0.0).unwrap_or(Vector3::z());
        Some([tip.into(), work.tr_mul(&(holder * own)).into()])
    }

    /// Returns the machine's pose at `[TRAJ]HOME`.
    pub fn home_pose(&self) -> Pose {
        Pose::from_degrees(self.home)
    }

    /// Returns the coordinates that constraints determine from the commanded ones.
    pub fn dependent(&self) -> Vec<Letter> {
        let layout = self.machine.layout();
        Letter::ALL.into_iter().filter(|letter| layout.is_dependent(*letter)).collect()
    }

    /// Returns the number of legs; the other joints belong to the table.
    pub fn legs(&self) -> usize {
        self.machine.layout().legs()
    }

    /// Returns joint `i` of its own joints: legs, table, then extra axes.
    pub fn joint(&self, i: usize) -> &Joint {
        self.joints.get(i).unwrap_or_else(|| &self.extra[i - self.joints.len()].joint)
    }

    /// Returns the unit of the values of joint `i`.
    pub fn unit_of(&self, i: usize) -> &'static str {
        match i.checked_sub(self.joints.len()) {
            Some(n) => self.extra[n].unit(self.length_unit()),
            None => self.unit(self.joints[i].kind),
        }
    }

    /// Returns all pairs of legs, lower number first.
    pub fn pairs(&self) -> Vec<[usize; 2]> {
        let legs = self.legs();
        (0..legs).flat_map(|i| (i + 1..legs).map(move |j| [i, j])).collect()
    }

    /// Returns the joints grouped by the kinds that the machine has.
    pub fn groups(&self) -> Vec<Group> {
        let group = |kind: JointKind| Group {
            kind,
            unit: self.unit(kind),
            joints: (0..self.joints.len()).filter(|i| self.joints[*i].kind == kind).collect(),
        };
        JointKind::ALL.into_iter().map(group).filter(|group| !group.joints.is_empty()).collect()
    }

    /// Returns the joints as [`Self::groups`] does, then the extra axes by unit.
    pub fn all_groups(&self) -> Vec<Group> {
        let mut groups = self.groups();
        let first = self.joints.len();
        for joint in first..first + self.extra.len() {
            let (kind, unit) = (JointKind::Extra, self.unit_of(joint));
            match groups.iter_mut().find(|group| (group.kind, group.unit) == (kind, unit)) {
                Some(group) => group.joints.push(joint),
                None => groups.push(Group { kind, unit, joints: vec![joint] }),
            }
        }
        groups
    }

    /// Returns the smallest and largest value that the limits allow joint `i`.
    pub fn range_of(&self, i: usize) -> [f64; 2] {
        match i.checked_sub(self.joints.len()) {
            Some(n) => self.extra[n].range(),
            None => self.joints[i].range(),
        }
    }

    /// Returns the unit of the values of joints of this kind.
    pub fn unit(&self, kind: JointKind) -> &'static str {
        if kind == JointKind::Arm { "degrees" } else { self.length_unit() }
    }
}

/// Returns the values of coordinates in LinuxCNC's order, each with its letter.
pub(super) fn in_order(values: impl Iterator<Item = (usize, f64)>) -> Vec<(char, f64)> {
    let mut values: Vec<_> = values.collect();
    values.sort_by_key(|(place, _)| *place);
    values.into_iter().map(|(place, value)| (POSE_LETTERS[place], value)).collect()
}

fn leg_angles(ini: &Ini, section: &str, errors: &mut Errors) -> Option<LegAngles> {
    let cones = [&of_leg::BASE_CONE, &of_leg::PLATFORM_CONE];
    let cones = cones.map(|key| errors.of(ini.value(section, key)));
    let pyramids = [&of_leg::BASE_PYRAMID, &of_leg::PLATFORM_PYRAMID];
    let pyramids = pyramids.map(|key| errors.of(ini.values(section, key)));
    Some(LegAngles { cones: [cones[0]?, cones[1]?], pyramids: [pyramids[0]?, pyramids[1]?] })
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
        // 0 selects the core's own limit.
        residual_limit: residual_limit?.unwrap_or(0.0),
        ..solver
    })
}
