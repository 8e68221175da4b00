// SPDX-License-Identifier: GPL-2.0-or-later
//! A machine whose extra axes carry the workpiece, the tool or the legs.

use crate::geometry::{Vector, minus};
use crate::module::{Module, Pose};
use crate::parallel::Parallel;
use crate::random::Random;
use crate::subjects::Subject;
use kinematics::{
    Chain, ChainGeometry, ExtraAxes, Layout, Letters, LinkGeometry, POSE_LETTERS, Vector3,
};

/// Value of an axis' pin for the load that it carries.
pub const WORK: i32 = 1;
pub const TOOL: i32 = 2;
pub const LEGS: i32 = 3;
/// The letters that can carry something.
const LETTERS: [&str; 6] = ["a", "b", "c", "u", "v", "w"];

/// A machine whose extra axes carry something.
pub struct Carrying {
    /// The mechanism.
    pub machine: Parallel,
    /// Indices of the axes among [`POSE_LETTERS`], in joint order.
    pub axes: Vec<usize>,
    pub given: ChainGeometry,
}

impl Carrying {
    /// Returns the load parameter `axes`.
    pub fn letters(&self) -> String {
        self.axes.iter().map(|k| POSE_LETTERS[*k]).collect()
    }

    /// Returns a module with this machine's pins set and applied.
    /// # Panics
    /// If the geometry is refused.
    pub fn module(&self) -> Module {
        let module = self.machine.loaded_with(&[("axes", &self.letters())]);
        self.wire(&module);
        assert!(self.machine.apply(&module), "{:?}", module.messages());
        module
    }

    /// Sets the pins of the axes, not those of the mechanism.
    pub fn wire(&self, module: &Module) {
        for k in self.axes.iter().filter(|k| **k > 2) {
            wire(module, k - 3, &self.given.links[k - 3]);
        }
        for (letter, k) in ["x", "y", "z"].into_iter().zip(0..) {
            let value = self.given.holder.map_or(f64::NAN, |holder| holder[k]);
            module.set(&format!("work-on-platform.{letter}"), value);
        }
    }

    /// Returns the core's chain.
    /// # Panics
    /// If there is no such chain.
    pub fn chain(&self) -> Chain {
        let letters = |text: &str| Letters::parse(text.as_bytes()).unwrap();
        let Parallel { coordinates, table, .. } = self.machine;
        let layout =
            Layout::new(self.machine.legs.len(), letters(coordinates), letters(table)).unwrap();
        let axes = ExtraAxes::parse(self.letters().as_bytes(), &layout).unwrap();
        Chain::freeze(&self.given, &axes, &layout, self.machine.size()).unwrap()
    }

    pub fn tool(&self) -> Vector3<f64> {
        let [x, y, z] = self.machine.tool;
        Vector3::new(x, y, z + self.machine.spindle_offset)
    }

    /// Returns LinuxCNC's pose at which the machine without axes is at `pose`, with random values of the axes.
    /// # Panics
    /// If a value is not a number.
    pub fn world(&self, pose: &Pose, chain: &Chain, random: &mut Random) -> Pose {
        let mut world = [0.0; 9];
        for k in &self.axes {
            world[*k] = random.within(if *k < 6 { 180.0 } else { 0.3 * self.machine.size() });
        }
        let mut machine = [pose[0], pose[1], pose[2], pose[3], pose[4], pose[5]];
        if chain.is_bare() {
            // The platform's own pose: D − R centre with the tool of the sample.
            let point = self.machine.point(pose);
            let bare = Parallel { tool: [0.0; 3], spindle_offset: 0.0, ..self.machine.clone() };
            let shift = minus(point, bare.point(pose));
            (0..3).for_each(|k| machine[k] += shift[k]);
        }
        chain.to_world(&machine, &mut world, &self.tool()).unwrap();
        world
    }
}

/// Sets the pins of the axis of the `i`-th letter that can carry something.
fn wire(module: &Module, i: usize, link: &LinkGeometry) {
    let name = LETTERS[i];
    module.set(&format!("chain.{name}.carries"), f64::from(link.carries));
    for (letter, k) in ["x", "y", "z"].into_iter().zip(0..) {
        module.set(&format!("chain.{name}.axis.{letter}"), link.axis[k]);
        if i < 3 {
            module.set(&format!("chain.{name}.point.{letter}"), link.point[k]);
        }
    }
}

fn three(random: &mut Random, size: f64) -> Vector {
    std::array::from_fn(|_| random.within(size))
}

/// Returns random axes for the remaining letters of a machine, with random loads.
pub fn carrying(subject: &Subject, random: &mut Random) -> Carrying {
    let free: Vec<usize> = (0..9).filter(|k| *k > 5 || !subject.machine.moves(*k)).collect();
    let axes: Vec<usize> = free.into_iter().filter(|k| *k > 2).rev().collect();
    let mut given = ChainGeometry::NONE;
    for k in &axes {
        let carries = random.between(0.0, 4.0).floor() as i32;
        let (axis, point) = (three(random, 1.0), three(random, 0.5 * subject.machine.size()));
        given.links[k - 3] = LinkGeometry { carries, axis, point };
    }
    if random.between(0.0, 1.0) < 0.3 {
        given.holder = Some(three(random, 0.5 * subject.machine.size()));
    }
    let mut machine = subject.machine.clone();
    if let (Some(holder), Some(home)) = (given.holder, &mut machine.home) {
        // The pins need LinuxCNC's pose, which the module converts to the machine's.
        (0..3).for_each(|k| home[k] = holder[k] - home[k]);
    }
    Carrying { machine, axes, given }
}
