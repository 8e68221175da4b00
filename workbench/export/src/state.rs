// SPDX-License-Identifier: GPL-2.0-or-later
//! Values of a model's joints at a pose.

use crate::assemble::is_angle;
use crate::legs::Leg;
use crate::model::{Model, Role};
use kinematics::{At, Fault, Letter, MAX_EXTRA, Pose, Vector3, World};
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use std::collections::HashMap;

/// Position of a platform.
pub struct Home {
    /// Its origin, in the frame of the legs.
    pub origin: Vector3<f64>,
    /// Coordinates of its reference point, of which a table replaces some.
    pub place: Vector3<f64>,
}

impl Home {
    /// Computes the position of a mechanism's platform; `tool` is that of `at`.
    pub fn of(config: &Mechanism, at: &At, tool: &Vector3<f64>) -> Self {
        let centre = Vector3::from(config.geometry.centre);
        let place = at.pose().position - tool + at.rotation() * (tool + centre);
        let layout = config.machine.layout();
        let moved = |k: usize| layout.coordinates().contains(Letter::ALL[k]);
        let held = Vector3::from_fn(|k, _| if moved(k) { place[k] } else { 0.0 });
        Self { origin: held - at.rotation() * centre, place }
    }
}

/// Returns the name of joint `i` of a mechanism, or of an extra axis: LinuxCNC's number.
pub fn name_of(config: &Mechanism, i: usize) -> String {
    let number = match i.checked_sub(config.joints.len()) {
        Some(n) => config.place.first_extra_joint + n,
        None => config.place.first_joint + i,
    };
    format!("joint_{number}")
}

/// Returns the letters of LinuxCNC's pose that extra axes and a second mechanism move.
fn others(config: &MachineConfig) -> Vec<usize> {
    let of_second = config.mechanisms.iter().filter(|one| one.place.is_second).flat_map(|second| {
        let layout = second.machine.layout();
        let moved = Letter::ALL.into_iter().filter(move |letter| !layout.is_held(*letter));
        moved.map(|letter| second.place.places[letter.index()])
    });
    config.first().extra_axes.places().chain(of_second).collect()
}

/// Returns the letters of LinuxCNC's pose on which the values depend, beyond X Y Z A B C.
pub fn letters(config: &MachineConfig) -> impl Iterator<Item = usize> {
    let others = others(config);
    (6..9).filter(move |place| others.contains(place))
}

/// The machine of a model, ready for many poses.
pub struct States<'a> {
    config: &'a MachineConfig,
    /// Letters of extra axes and of a second mechanism.
    others: Vec<usize>,
    legs: Vec<Vec<Leg>>,
    /// Places of the joints among the values.
    places: HashMap<String, usize>,
    meters: f64,
}

impl<'a> States<'a> {
    /// Prepares the machine of a model.
    ///
    /// # Errors
    /// The core refuses the pose at home.
    pub fn new(config: &'a MachineConfig, model: &Model) -> Result<Self, Fault> {
        let meters = 1e-3 / config.units_per_mm;
        let legs = config.mechanisms.iter().map(|one| {
            let tool = one.chain.machine_tool(&one.spindle);
            let home = one.machine.at(&one.home_pose(), &tool)?;
            Ok((0..one.legs()).map(|i| Leg::new(one, i, &home, meters)).collect())
        });
        let legs = legs.collect::<Result<_, Fault>>()?;
        let names = model.joints().map(|(_, joint)| joint.name.clone());
        let places = names.enumerate().map(|(n, name)| (name, n)).collect();
        Ok(Self { config, others: others(config), legs, places, meters })
    }

    /// Computes the values of all joints at one of LinuxCNC's poses, in the model's order. `offset` is the
    /// tool offset of the first mechanism.
    ///
    /// # Errors
    /// A mechanism does not reach the pose.
    pub fn values(&self, world: &World, offset: &Vector3<f64>) -> Result<Vec<f64>, Fault> {
        let mut values = vec![0.0; self.places.len()];
        let mut put = |name: &str, value: f64| {
            if let Some(place) = self.places.get(name) {
                values[*place] = value;
            }
        };
        for (config, legs) in self.config.mechanisms.iter().zip(&self.legs) {
            let own = config.place.places.map(|place| world[place]);
            let layout = config.machine.layout();
            let others = &self.others;
            let mut extra = [0.0; MAX_EXTRA];
            for (value, place) in extra.iter_mut().zip(config.extra_axes.places()) {
                *value = world[place];
            }
            // Letters of the other mechanism and of extra axes.
            let is_other = |k: usize| match config.place.is_second {
                true => layout.is_held(Letter::ALL[k]),
                false => others.contains(&k),
            };
            let own: [f64; 6] = std::array::from_fn(|k| if is_other(k) { 0.0 } else { own[k] });
            let own_offset = if config.place.is_second { Vector3::zeros() } else { *offset };
            let tool = config.spindle + own_offset;
            let pose = Pose::from_degrees(config.carried(&own, &extra, &tool)?);
            let tool = config.chain.machine_tool(&tool);
            let at = config.machine.at(&pose, &tool)?;
            let prefix = if config.place.is_second { "second_" } else { "" };
            let place = Home::of(config, &at, &tool).place;
            for letter in Letter::ALL {
                let k = letter.index();
                let value = if k < 3 { place[k] * self.meters } else { at.pose().angles[k - 3] };
                put(&format!("{prefix}platform_{}", letter.name().to_ascii_lowercase()), value);
            }
            let unit =
                |i: usize| if is_angle(config, i) { 1.0_f64.to_radians() } else { self.meters };
            for i in 0..config.joints.len() {
                put(&name_of(config, i), at.joints()[i] * unit(i));
            }
            for (n, place) in config.extra_axes.places().enumerate() {
                let i = config.joints.len() + n;
                put(&name_of(config, i), world[place] * unit(i));
            }
            for (i, leg) in legs.iter().enumerate() {
                let segment = at.segments()[i];
                let offset = config.offsets[i] * unit(i);
                let ends = [segment.base, segment.platform];
                for (name, value) in
                    leg.values(ends, &at.rotation(), at.joints()[i] * unit(i), offset)
                {
                    put(&name, value);
                }
            }
        }
        Ok(values)
    }
}

/// Returns the position of a platform's origin in the frame of the legs.
pub(crate) fn platform_origin(config: &Mechanism, at: &At) -> Vector3<f64> {
    let tool = config.chain.machine_tool(&config.spindle);
    Home::of(config, at, &tool).origin
}

/// Returns the names of a model's joints that no drive moves.
pub fn passive(model: &Model) -> impl Iterator<Item = &str> {
    let joints = model.joints().filter(|(_, joint)| !matches!(joint.role, Role::Driven(_)));
    joints.map(|(_, joint)| joint.name.as_str())
}
