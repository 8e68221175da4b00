// SPDX-License-Identifier: GPL-2.0-or-later
//! Two mechanisms behind one module.

use crate::geometry::{minus, norm};
use crate::module::{Joints, Module, Pose};
use crate::parallel::{LETTERS, Parallel, wire_leg};
use crate::subjects::{Subject, subjects};

/// Two machines, and the letters of the second one's angles.
pub struct Two {
    pub first: Subject,
    /// The second machine, in its own coordinates.
    pub second: Subject,
    /// Load parameter `second_angles`.
    pub angles: &'static str,
}

/// Returns two of [`subjects`].
/// # Panics
/// If there is none of this name.
pub fn two(first: &str, second: &str, angles: &'static str) -> Two {
    let find = |name: &str| {
        let found = subjects().into_iter().find(|subject| subject.name == name);
        found.unwrap_or_else(|| panic!("no machine {name}"))
    };
    Two { first: find(first), second: find(second), angles }
}

/// Returns the mirrored lathe, and pairs with other numbers of legs, with a table, and with other angles.
pub fn pairs() -> Vec<Two> {
    vec![
        two("four-rod lathe", "four-rod lathe", "C"),
        two("pyramid", "linear delta", ""),
        two("tripod", "pentapod on rings", "CA"),
        two("rotary delta", "four-rod lathe", "A"),
    ]
}

impl Two {
    /// Returns the indices in LinuxCNC's pose of the second machine's X Y Z A B C.
    /// # Panics
    /// If it has more angles than letters for them.
    pub fn places(&self) -> [Option<usize>; 6] {
        let mut angles = self.angles.chars();
        let machine = &self.second.machine;
        let mut places = [None; 6];
        for letter in machine.coordinates.chars() {
            let k = "XYZABC".find(letter).expect("a letter of a pose");
            places[k] = Some(match k {
                0..3 => 6 + k,
                _ => "XYZABC".find(angles.next().expect("a letter for each angle")).unwrap(),
            });
        }
        places
    }

    /// Returns LinuxCNC's pose of both.
    pub fn world(&self, first: &Pose, second: &Pose) -> Pose {
        let mut world = *first;
        for (value, place) in second.iter().zip(self.places()) {
            place.into_iter().for_each(|place| world[place] = *value);
        }
        world
    }

    /// Returns the second machine's pose in LinuxCNC's pose.
    pub fn second_of(&self, world: &Pose) -> Pose {
        let mut pose = [0.0; 9];
        for (value, place) in pose.iter_mut().zip(self.places()) {
            *value = place.map_or(0.0, |place| world[place]);
        }
        pose
    }

    pub fn parameters(&self) -> Vec<(&'static str, String)> {
        let [legs, coordinates, ..] = self.second.machine.parameters();
        let mut all = self.first.machine.parameters().to_vec();
        all.push(("second", legs.1));
        all.push(("second_coordinates", coordinates.1));
        all.push(("second_angles", self.angles.into()));
        all
    }

    /// Returns a module loaded for both, with pins unset.
    pub fn loaded(&self) -> Module {
        self.loaded_with(&[])
    }

    /// Returns such a module with more load parameters.
    pub fn loaded_with(&self, more: &[(&str, &str)]) -> Module {
        let all = self.parameters();
        let own = all.iter().map(|(name, value)| (*name, value.as_str()));
        let all: Vec<_> = own.chain(more.iter().copied()).collect();
        Module::pkmkins(&all)
    }

    /// Returns a module with the pins of both set and applied.
    /// # Panics
    /// If a geometry is refused.
    pub fn module(&self) -> Module {
        let module = self.loaded();
        self.wire(&module);
        module.apply();
        assert!(module.is_on("geometry-ok"), "{:?}", module.messages());
        module
    }

    /// Sets every pin of both geometries.
    /// # Panics
    /// If the second one has no reference pose.
    pub fn wire(&self, module: &Module) {
        self.first.machine.wire(module);
        let Parallel { legs, centre, home, tool, spindle_offset, .. } = &self.second.machine;
        let first = self.first.machine.legs.len();
        legs.iter().enumerate().for_each(|(n, leg)| wire_leg(module, first + n, leg));
        for (letter, value) in LETTERS.into_iter().zip(centre) {
            module.set(&format!("second.centre.{letter}"), *value);
        }
        for (letter, value) in LETTERS.into_iter().zip(home.expect("a reference pose")) {
            module.set(&format!("second.home.{letter}"), value);
        }
        for (pin, value) in ["tool-offset-x", "tool-offset-y", "tool-offset"].into_iter().zip(tool)
        {
            module.set(&format!("second.{pin}"), *value);
        }
        module.set("second.spindle-offset", *spindle_offset);
    }

    pub fn joints(&self, first: &Joints, second: &Joints) -> Joints {
        let (of_first, of_second) = (self.first.machine.joints(), self.second.machine.joints());
        let mut joints = [0.0; 16];
        joints[..of_first].copy_from_slice(&first[..of_first]);
        joints[of_first..of_first + of_second].copy_from_slice(&second[..of_second]);
        joints
    }

    /// Returns LinuxCNC's pose with both at their reference poses.
    pub fn homes(&self) -> Pose {
        self.world(&self.first.home(), &self.second.home())
    }

    /// Returns the distance of two of the second machine's poses, as a share of its size.
    pub fn gap(machine: &Parallel, one: &Pose, other: &Pose) -> f64 {
        let way = norm(minus([one[0], one[1], one[2]], [other[0], other[1], other[2]]));
        let turn = (3..6).map(|k| (one[k] - other[k]).abs().to_radians()).sum::<f64>();
        (way + machine.radius() * turn) / machine.size()
    }
}
