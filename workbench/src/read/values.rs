// SPDX-License-Identifier: GPL-2.0-or-later
//! The values of a mechanism as its INI file gives them, before the machine is made of them.

use crate::read::chain;
use crate::read::direction::{self, ToolDirection};
use crate::read::error::Errors;
use crate::read::ini::{Ini, IniError};
use crate::read::joints::{Axis, ExtraAxis, Joint, axis, extra, joint, positive};
use crate::read::legs::leg_geometry;
use crate::read::models::{self, Model};
use crate::read::place::Place;
use keys::{leg as of_leg, machine as of_machine, second as of_second};
use kinematics::{
    CONDITIONING_LIMIT, ChainGeometry, Geometry, LegGeometry, Letter, Load, MAX_LEGS, PerLeg,
    Solver,
};

/// Limits of the path in `[TRAJ]`: speeds, then accelerations, lengths before angles.
const SPEEDS: [&str; 4] = [
    "MAX_LINEAR_VELOCITY",
    "MAX_ANGULAR_VELOCITY",
    "MAX_LINEAR_ACCELERATION",
    "MAX_ANGULAR_ACCELERATION",
];

/// The values of a file, before the machine is made of them.
pub(super) struct Values {
    pub(super) world_home: [f64; 9],
    pub(super) mechanism_clearance: Option<f64>,
    pub(super) chain: ChainGeometry,
    pub(super) home: [f64; 6],
    pub(super) centre: [f64; 3],
    pub(super) spindle: f64,
    pub(super) tool_direction: Option<ToolDirection>,
    pub(super) legs: Vec<LegGeometry>,
    pub(super) offsets: PerLeg,
    pub(super) cones: Vec<[Option<f64>; 2]>,
    pub(super) solver: Solver,
    pub(super) conditioning_limit: f64,
    pub(super) clearance: Option<f64>,
    pub(super) tilt_limit: Option<f64>,
    pub(super) pyramids: Vec<[Option<[f64; 2]>; 2]>,
    pub(super) joints: Vec<Joint>,
    pub(super) extra: Vec<ExtraAxis>,
    pub(super) axes: Vec<Axis>,
    pub(super) units_per_mm: f64,
    pub(super) speeds: [f64; 4],
    pub(super) models: Vec<Model>,
    pub(super) period: f64,
}

impl Values {
    /// Everything is read, also where something is wrong before it.
    pub(super) fn read(ini: &Ini, load: &Load, place: &Place, errors: &mut Errors) -> Option<Self> {
        let legs = load.layout.legs();
        errors.of(ini.check_keys("PKM", of_machine::ALL.iter().copied()));
        let machine = |key, errors: &mut Errors| errors.of(ini.value("PKM", key));
        // Only the module uses these; the last one where a strut has no lead of its own.
        for key in [&of_machine::MAX_ERROR, &of_machine::FEED_FLOOR, &of_machine::SCREW_LEAD] {
            machine(key, errors);
        }
        let chain = match place.is_of_pair {
            true => errors.of(chain::refuse(ini)).map(|()| ChainGeometry::NONE),
            false => chain::geometry(ini, load, errors),
        };
        let world_home = errors.of(world_home(ini, place.is_of_pair));
        let own = |key, of_second| match place.is_second {
            true => ("SECOND", of_second),
            false => ("PKM", key),
        };
        let (section, key) = own(&of_machine::CENTRE, &of_second::CENTRE);
        let centre = errors.of(ini.values(section, key));
        let (section, key) = own(&of_machine::SPINDLE_OFFSET, &of_second::SPINDLE_OFFSET);
        let spindle = errors.of(ini.value(section, key));
        let (section, key) = own(&of_machine::TOOL_DIRECTION, &of_second::TOOL_DIRECTION);
        let tool_direction = errors.of(direction::read(ini, section, key, spindle.flatten()));
        let leg_section = |n| place.leg_section(n);
        let leg =
            |n, errors: &mut Errors| leg_geometry(ini, &leg_section(n), load.kinds()[n], errors);
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
        let mechanism_clearance = machine(&of_machine::MECHANISM_CLEARANCE, errors);
        let tilt_limit = machine(&of_machine::TILT_LIMIT, errors);
        let joints =
            errors.each(load.layout.joints(), |n, errors| joint(ini, n, (load, place), errors));
        let extra = errors.each(load.extra.len(), |n, errors| extra(ini, n, load, errors));
        let axes = errors.each(Letter::ALL.len(), |n, errors| {
            let letter = Letter::ALL[n];
            let is_of_others = load.other_places().any(|k| k == place.places[n]);
            match is_of_others || (place.is_second && load.layout.is_held(letter)) {
                // The coordinate of another mechanism or of an extra axis is none of the tool's.
                true => Some(Axis::UNLIMITED),
                false => axis(ini, &place.axis_section(letter), errors),
            }
        });
        let units_per_mm = errors.of(units_per_mm(ini));
        let models = match place.is_second {
            true => Some(vec![]),
            false => models::read(ini, units_per_mm.unwrap_or(1.0), errors),
        };
        let speeds = errors.each(SPEEDS.len(), |n, errors| {
            errors.of(positive(ini, "TRAJ", SPEEDS[n], Some(f64::INFINITY)))
        });
        let period = errors.of(positive(ini, "EMCMOT", "SERVO_PERIOD", Some(1e6)));
        let mut padded = [0.0; MAX_LEGS];
        padded.iter_mut().zip(offsets?).for_each(|(to, given)| *to = given.unwrap_or(0.0));
        let world_home = world_home?;
        let [x, y, z, a, b, c, u, v, w] = world_home;
        Some(Self {
            world_home,
            mechanism_clearance: mechanism_clearance?,
            chain: chain?,
            home: if place.is_second { [u, v, w, 0.0, 0.0, 0.0] } else { [x, y, z, a, b, c] },
            centre: centre?.unwrap_or_default(),
            spindle: spindle?.unwrap_or(0.0),
            tool_direction: tool_direction?,
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
            models: models?,
            period: period?,
        })
    }

    pub(super) fn geometry(&self, load: &Load) -> Geometry {
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

/// `[TRAJ]HOME` as LinuxCNC has it; a second mechanism needs all nine numbers.
fn world_home(ini: &Ini, is_whole: bool) -> Result<[f64; 9], IniError> {
    let (least, expected) = match is_whole {
        true => (9, "expected 9 decimal numbers separated by blanks, X Y Z A B C U V W"),
        false => (3, "expected 3 to 9 decimal numbers separated by blanks"),
    };
    let entry = ini.require("TRAJ", "HOME", expected)?;
    let values = ini.number_list(entry).filter(|values| (least..=9).contains(&values.len()));
    let mut values = values.ok_or_else(|| ini.refuse(entry, expected))?;
    values.resize(9, 0.0);
    if values[3..6].iter().any(|angle| *angle != 0.0) {
        return Err(ini.refuse(entry, "expected a level pose, A = B = C = 0"));
    }
    Ok(std::array::from_fn(|i| values[i]))
}
