// SPDX-License-Identifier: GPL-2.0-or-later
//! Values of a model's joints at a pose.

use crate::assemble::is_angle;
use crate::constraints::Constraint;
use crate::legs::Leg;
use crate::model::{Model, Role};
use kinematics::{At, Fault, Letter, MAX_EXTRA, Matrix3, Pose, Vector3, World};
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use std::collections::HashMap;

/// Position and orientation of a platform.
pub struct PlatformPlace {
    /// Its origin, in the frame of the legs.
    pub origin: Vector3<f64>,
    /// Coordinates of its reference point, of which a table replaces some.
    pub place: Vector3<f64>,
    /// A B C, radians.
    pub angles: Vector3<f64>,
    pub rotation: Matrix3<f64>,
}

impl PlatformPlace {
    /// Computes the place of a mechanism's platform; `tool` is that of `at`.
    pub fn of(config: &Mechanism, at: &At, tool: &Vector3<f64>) -> Self {
        let centre = Vector3::from(config.geometry.centre);
        let (full, rotation) = (at.full_pose(), at.rotation());
        let place = full.position - tool + rotation * (tool + centre);
        let moves = |k: usize| moves_platform(config, Letter::ALL[k]);
        let held = Vector3::from_fn(|k, _| if moves(k) { place[k] } else { 0.0 });
        Self { origin: held - rotation * centre, place, angles: full.angles, rotation }
    }
}

/// Returns whether legs move a coordinate of the platform, or constraints determine it.
pub(crate) fn moves_platform(config: &Mechanism, letter: Letter) -> bool {
    let layout = config.machine.layout();
    layout.constraints() > 0 || layout.coordinates().contains(letter)
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

/// A mechanism at home.
pub struct MechanismAtHome {
    pub at: PlatformPlace,
    pub legs: Vec<Leg>,
    pub constraints: Vec<Constraint>,
}

impl MechanismAtHome {
    /// Creates a mechanism's parts at its home; `meters` is the length of a machine unit.
    pub fn new(config: &Mechanism, home: &At, meters: f64) -> Self {
        let tool = config.chain.machine_tool(&config.spindle);
        let at = PlatformPlace::of(config, home, &tool);
        let legs = (0..config.legs()).map(|i| Leg::new(config, i, home, meters)).collect();
        let constraints = config.geometry.constraints().iter().enumerate();
        let constraints = constraints
            .map(|(i, constraint)| Constraint::new(constraint, i, &at, meters))
            .collect();
        Self { at, legs, constraints }
    }
}

/// The machine of a model, ready for many poses.
pub struct States<'a> {
    config: &'a MachineConfig,
    /// Letters of extra axes and of a second mechanism.
    others: Vec<usize>,
    mechanisms: Vec<MechanismAtHome>,
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
        let mechanisms = config.mechanisms.iter().map(|one| {
            let tool = one.chain.machine_tool(&one.spindle);
            let home = one.machine.at(&one.home_pose(), &tool)?;
            Ok(MechanismAtHome::new(one, &home, meters))
        });
        let mechanisms = mechanisms.collect::<Result<_, Fault>>()?;
        let names = model.joints().map(|(_, joint)| joint.name.clone());
        let places = names.enumerate().map(|(n, name)| (name, n)).collect();
        Ok(Self { config, others: others(config), mechanisms, places, meters })
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
        for (config, home) in self.config.mechanisms.iter().zip(&self.mechanisms) {
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
            let now = PlatformPlace::of(config, &at, &tool);
            for letter in Letter::ALL {
                let k = letter.index();
                let value = if k < 3 { now.place[k] * self.meters } else { now.angles[k - 3] };
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
            let rotation = now.rotation * home.at.rotation.transpose();
            for (i, leg) in home.legs.iter().enumerate() {
                let segment = at.segments()[i];
                let offset = config.offsets[i] * unit(i);
                let ends = [segment.base, segment.platform];
                for (name, value) in leg.values(ends, &rotation, at.joints()[i] * unit(i), offset) {
                    put(&name, value);
                }
            }
            for constraint in &home.constraints {
                for (name, value) in constraint.values(&(now.origin * self.meters), &rotation) {
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
    PlatformPlace::of(config, at, &tool).origin
}

/// Returns the names of a model's joints that no drive moves.
pub fn passive(model: &Model) -> impl Iterator<Item = &str> {
    let joints = model.joints().filter(|(_, joint)| !matches!(joint.role, Role::Driven(_)));
    joints.map(|(_, joint)| joint.name.as_str())
}
