// SPDX-License-Identifier: GPL-2.0-or-later
//! The machine of a loaded module from LinuxCNC's view: a mechanism, alone or with axes that carry something,
//! or two mechanisms.

use crate::carrying::{Carrying, LEGS, TOOL, WORK};
use crate::geometry::scaled;
use crate::machines::paper_004;
use crate::module::{Module, Pose};
use crate::pair::{Two, two};
use crate::parallel::Parallel;
use crate::random::Random;
use crate::subjects::{Subject, subjects};
use kinematics::{ChainGeometry, LinkGeometry};

/// The machine of a loaded module.
pub enum Control {
    /// A single mechanism.
    Alone(Subject),
    /// A mechanism with axes that carry something; poses of the mechanism, and the axes.
    Carrying(Subject, Box<Carrying>),
    Pair(&'static str, Box<Two>),
}

/// Returns all machines alone, then one with a chain and one with two mechanisms.
pub fn controls() -> Vec<Control> {
    let mut all: Vec<Control> = subjects().into_iter().map(Control::Alone).collect();
    all.extend([in_a_chain(), on_one_guide()]);
    all
}

/// Returns the hexapod of paper 004 with constant C, over a rotary table on a slide, with a quill, on a track: an axis
/// of every kind.
pub fn in_a_chain() -> Control {
    let machine = Parallel { coordinates: "XYZAB", ..paper_004().into() };
    let mut given = ChainGeometry::NONE;
    let point = [20.0, -10.0, 0.0];
    given.links[2] = LinkGeometry { carries: WORK, axis: [0.0, 0.0, 1.0], point };
    for (link, carries, axis) in
        [(3, WORK, [0.0, 1.0, 0.0]), (4, TOOL, [0.0, 0.0, -1.0]), (5, LEGS, [1.0, 0.0, 0.0])]
    {
        given.links[link] = LinkGeometry { carries, axis, point: [0.0; 3] };
    }
    let sample = crate::machines::paper_004_pose;
    let subject = Subject { name: "hexapod in a chain", machine: machine.clone(), sample };
    let axes = vec![5, 6, 7, 8];
    Control::Carrying(subject, Box::new(Carrying { machine, axes, given }))
}

/// Returns the mirrored lathe: the second mechanism is the first one, displaced by 1600.
pub fn on_one_guide() -> Control {
    let mut both = two("four-rod lathe", "four-rod lathe", "C");
    both.second.machine.home.iter_mut().for_each(|home| home[2] += 1600.0);
    both.second.sample = |random| {
        let subject = crate::subjects::four_rod_lathe_pose(random);
        std::array::from_fn(|k| if k == 2 { subject[k] + 1600.0 } else { subject[k] })
    };
    Control::Pair("mirrored lathe", Box::new(both))
}

impl Control {
    /// Returns the same with all lengths multiplied, as in another unit. [`Self::sample`] stays in the old one.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let of =
            |subject: &Subject| Subject { machine: subject.machine.scaled(factor), ..*subject };
        match self {
            Self::Alone(subject) => Self::Alone(of(subject)),
            Self::Carrying(subject, carrying) => {
                let mut given = carrying.given;
                for link in &mut given.links {
                    link.point = scaled(link.point, factor);
                }
                let (machine, axes) = (carrying.machine.scaled(factor), carrying.axes.clone());
                Self::Carrying(of(subject), Box::new(Carrying { machine, axes, given }))
            }
            Self::Pair(name, two) => {
                let Two { first, second, angles } = &**two;
                Self::Pair(name, Box::new(Two { first: of(first), second: of(second), angles }))
            }
        }
    }

    pub fn name(&self) -> &'static str {
        match self {
            Self::Alone(subject) | Self::Carrying(subject, _) => subject.name,
            Self::Pair(name, _) => name,
        }
    }

    /// Returns its mechanisms in order.
    pub fn mechanisms(&self) -> Vec<&Parallel> {
        match self {
            Self::Alone(subject) | Self::Carrying(subject, _) => vec![&subject.machine],
            Self::Pair(_, two) => vec![&two.first.machine, &two.second.machine],
        }
    }

    pub fn joints(&self) -> usize {
        let of_mechanisms: usize = self.mechanisms().iter().map(|machine| machine.joints()).sum();
        match self {
            Self::Carrying(_, carrying) => of_mechanisms + carrying.axes.len(),
            _ => of_mechanisms,
        }
    }

    /// Returns the size of the larger mechanism.
    pub fn size(&self) -> f64 {
        self.mechanisms().iter().map(|machine| machine.size()).fold(0.0, f64::max)
    }

    /// Returns whether a joint moves a letter of LinuxCNC's pose (X = 0 … W = 8).
    pub fn moves(&self, letter: usize) -> bool {
        let first = letter < 6 && self.mechanisms()[0].moves(letter);
        first
            || match self {
                Self::Alone(_) => false,
                Self::Carrying(_, carrying) => carrying.axes.contains(&letter),
                Self::Pair(_, two) => two.places().contains(&Some(letter)),
            }
    }

    /// Returns LinuxCNC's pose with every mechanism at its reference pose and every other axis at 0.
    pub fn home(&self) -> Pose {
        match self {
            Self::Alone(subject) | Self::Carrying(subject, _) => subject.home(),
            Self::Pair(_, two) => two.homes(),
        }
    }

    /// Returns a random pose of the workspace.
    pub fn sample(&self, random: &mut Random) -> Pose {
        match self {
            Self::Alone(subject) => (subject.sample)(random),
            Self::Carrying(subject, carrying) => {
                let inside = (subject.sample)(random);
                carrying.world(&inside, &carrying.chain(), random)
            }
            Self::Pair(_, two) => {
                let poses = [(two.first.sample)(random), (two.second.sample)(random)];
                two.world(&poses[0], &poses[1])
            }
        }
    }

    /// Returns a module loaded for it, with pins unset.
    pub fn loaded(&self) -> Module {
        self.loaded_with_boxes(0)
    }

    /// Returns such a module with boxes for the start without a seed, for each mechanism.
    pub fn loaded_with_boxes(&self, boxes: usize) -> Module {
        let boxes = boxes.to_string();
        match self {
            Self::Alone(subject) => subject.machine.loaded_with(&[("boxes", &boxes)]),
            Self::Carrying(subject, carrying) => {
                let axes = carrying.letters();
                subject.machine.loaded_with(&[("boxes", &boxes), ("axes", &axes)])
            }
            Self::Pair(_, two) => two.loaded_with(&[("boxes", &boxes), ("second_boxes", &boxes)]),
        }
    }

    /// Sets every pin of the geometry.
    pub fn wire(&self, module: &Module) {
        match self {
            Self::Alone(subject) => subject.machine.wire(module),
            Self::Carrying(subject, carrying) => {
                subject.machine.wire(module);
                carrying.wire(module);
            }
            Self::Pair(_, two) => two.wire(module),
        }
    }

    /// Sets its pins of a module and applies it; false if it is refused.
    pub fn apply(&self, module: &Module) -> bool {
        self.wire(module);
        module.apply();
        module.is_on("geometry-ok") && !module.is_on("geometry-changed")
    }

    /// Returns a module with its pins set and applied.
    /// # Panics
    /// If the geometry is refused.
    pub fn module(&self) -> Module {
        let module = self.loaded();
        assert!(self.apply(&module), "{}: {:?}", self.name(), module.messages());
        module
    }
}
