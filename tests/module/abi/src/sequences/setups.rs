// SPDX-License-Identifier: GPL-2.0-or-later
//! The machines of the sequences.

use super::system::System;
use crate::control::{Control, controls};
use crate::geometry::{Vector, cross, minus, norm, plus, unit};
use crate::machines::{genhexkins_default, paper_004};
use crate::module::{Module, Pose};
use crate::parallel::{Kind, Leg, Parallel};
use crate::random::Random;
use crate::subjects::{
    PENTAPOD_BASE, PENTAPOD_RINGS, Subject, linear_delta, pentapod, pentapod_pose, pose,
    rotary_delta, tripod,
};

/// A machine, and its configuration in LinuxCNC.
pub struct Setup {
    pub name: String,
    /// The machine of the module.
    pub control: Control,
    /// The simulated machine.
    pub system: System,
    /// Whether the HAL file is for another module: no monitor, no reference pose, no `apply`.
    pub drops_in: bool,
}

impl Setup {
    fn new(name: String, control: Control, drops_in: bool) -> Self {
        let mut system = System::new(&control);
        system.fold_at_reference();
        Self { name, control, system, drops_in }
    }

    /// Returns LinuxCNC's world_home: 2.9 reads X Y Z only.
    pub fn world_home(&self) -> Pose {
        let home = self.control.home();
        std::array::from_fn(|k| if k < 3 { home[k] } else { 0.0 })
    }

    /// Returns the module in the state after the HAL files.
    pub fn module(&self) -> Module {
        let module = self.control.loaded();
        self.control.wire(&module);
        // Speed: the machine's size per second. Acceleration: that speed in a tenth of a second.
        for n in (0..).take_while(|n| module.has(&format!("max-velocity.{n}"))) {
            module.set(&format!("max-velocity.{n}"), self.system.size());
            module.set(&format!("max-acceleration.{n}"), 10.0 * self.system.size());
        }
        if self.drops_in {
            for axis in ["x", "y", "z", "a", "b", "c"] {
                module.set(&format!("home.{axis}"), f64::NAN);
            }
        } else {
            module.apply();
            assert!(module.is_on("geometry-ok"), "{}: {:?}", self.name, module.messages());
        }
        module
    }
}

fn dropped_in(name: &'static str, machine: Parallel, sample: fn(&mut Random) -> Pose) -> Setup {
    Setup::new(
        format!("{name} as a drop-in"),
        Control::Alone(Subject { name, machine, sample }),
        true,
    )
}

/// Returns a random pose of genhexkins' sample, inches.
fn genhexkins_pose(random: &mut Random) -> Pose {
    let mut pose = pose([0.0, 0.0, 20.0, 0.0, 0.0, 0.0]);
    for k in 0..3 {
        pose[k] += random.within(5.0);
        pose[3 + k] += random.within(20.0);
    }
    pose
}

fn near_home_of_tripod(random: &mut Random) -> Pose {
    pose([
        5.0 + random.within(1.5),
        1.75 + random.within(1.25),
        3.25 + random.within(0.75),
        0.0,
        0.0,
        0.0,
    ])
}

fn near_home_of_delta(random: &mut Random) -> Pose {
    pose([random.within(60.0), random.within(60.0), 60.0 + random.within(40.0), 0.0, 0.0, 0.0])
}

fn near_home_of_rotary_delta(random: &mut Random) -> Pose {
    pose([random.within(4.0), random.within(4.0), -14.0 + random.within(4.0), 0.0, 0.0, 0.0])
}

/// Returns LinuxCNC's sample machines with their own HAL files and this module.
pub fn drop_ins() -> Vec<Setup> {
    let theirs = Module::genhexkins();
    let hexapod = genhexkins_default(&theirs);
    let home = Some(pose([0.0, 0.0, 20.0, 0.0, 0.0, 0.0]));
    let hexapod = Parallel { home, ..hexapod.into() };
    // With a lead, like paper 004's machine.
    let screws = Parallel { ..paper_004().into() };
    vec![
        dropped_in("pentapod sample", pentapod(PENTAPOD_BASE, PENTAPOD_RINGS), pentapod_pose),
        dropped_in("hexapod-sim", hexapod, genhexkins_pose),
        dropped_in("hexapod with screws", screws, crate::machines::paper_004_pose),
        dropped_in("tripod", tripod(), near_home_of_tripod),
        dropped_in("linear delta", linear_delta(163.25, 33.0, 269.0), near_home_of_delta),
        dropped_in("rotary delta", rotary_delta(10.0, 10.0, 18.0, 5.0), near_home_of_rotary_delta),
    ]
}

/// Returns the machines of configs, one in a chain and a pair.
pub fn shipped() -> Vec<Setup> {
    controls().into_iter().map(|c| Setup::new(c.name().into(), c, false)).collect()
}

/// Coordinates of machines, and number of redundant legs.
const LAYOUTS: [(&str, usize); 12] = [
    ("Z", 0),
    ("XZ", 0),
    ("XYZ", 0),
    ("XYZ", 0),
    ("XYZC", 0),
    ("XYZB", 0),
    ("XYZAB", 0),
    ("XYZABC", 0),
    ("XYZABC", 0),
    ("XYZABC", 0),
    ("XYZABC", 2),
    ("XYZAB", 1),
];

/// Returns a pose of random machines: a fifth of the size and twenty degrees about home.
fn about_home(random: &mut Random) -> Pose {
    let mut pose = [0.0; 9];
    (0..3).for_each(|k| pose[k] = random.within(200.0));
    (3..6).for_each(|k| pose[k] = random.within(20.0));
    pose[2] += HEIGHT;
    pose
}

const HEIGHT: f64 = 1000.0;

/// Returns a random machine in millimeters with a platform 1000 above its base.
pub fn random_machine(random: &mut Random, drops_in: bool) -> Setup {
    let (coordinates, excess) = LAYOUTS[random.between(0.0, LAYOUTS.len() as f64) as usize];
    loop {
        let legs = coordinates.len() + excess;
        let home = pose([0.0, 0.0, HEIGHT, 0.0, 0.0, 0.0]);
        let legs: Vec<Leg> = (0..legs).map(|i| random_leg(i, legs, coordinates, random)).collect();
        let machine = Parallel::new(legs, coordinates, home);
        let name = format!("random {coordinates} with {}", kinds(&machine));
        let sample = about_home;
        let subject = Subject { name: "random", machine, sample };
        let setup = Setup::new(name, Control::Alone(subject), drops_in);
        let system = &setup.system;
        let Some((state, margin)) = system.at(&system.reference, &[0.0; 16]) else { continue };
        let look = system.look(&state);
        // Well away from singular poses and dead points at home.
        if look.distance > 0.1 * system.size() && margin > 2.0 && look.margin > 2.0 {
            let module = setup.control.loaded();
            if setup.control.apply(&module) {
                return setup;
            }
        }
    }
}

fn kinds(machine: &Parallel) -> String {
    let kinds: Vec<_> = machine.legs.iter().map(|leg| leg.kind.name()).collect();
    kinds.join(",")
}

fn random_leg(i: usize, legs: usize, coordinates: &str, random: &mut Random) -> Leg {
    let around = |at: f64, radius: f64, z: f64| -> Vector {
        let (s, c) = at.to_radians().sin_cos();
        [radius * c, radius * s, z]
    };
    let at = 360.0 * i as f64 / legs as f64;
    let turn = if i.is_multiple_of(2) { 20.0 } else { -20.0 };
    let height = random.within(100.0);
    let base = around(at + turn + random.within(8.0), 1000.0 * random.between(0.6, 1.0), height);
    // Legs of a machine that cannot rotate may end in one point, others on a circle.
    let radius = 400.0 * random.between(0.7, 1.0);
    let platform = around(at - turn + random.within(8.0), radius, random.within(60.0));
    let held =
        |k: usize, value: f64| if coordinates.contains(["X", "Y", "Z"][k]) { value } else { 0.0 };
    let anchor = plus(platform, [0.0, 0.0, held(2, HEIGHT)]);
    let kind = random.between(0.0, 4.0) as usize;
    let side = |joint: f64, with: &dyn Fn(i32) -> Kind| {
        // Selects the side of the rod that this joint value belongs to.
        let leg = |side| Leg { base, platform, kind: with(side) };
        let error = |leg: &Leg| {
            let other = leg.other_side(anchor, joint).unwrap_or(joint);
            let span = |q| norm(minus(minus(anchor, base), leg.displacement(q)));
            let _ = span;
            other
        };
        let other = error(&leg(1));
        leg(if (joint > other) == (joint != other) { 1 } else { -1 })
    };
    match kind {
        0 => {
            let lead = if random.between(0.0, 1.0) < 0.5 { 0.0 } else { random.within(30.0) };
            let axis = unit(cross(random.direction(), minus(anchor, base)));
            let kind = Kind::Strut { base_axis: axis, platform_axis: axis.map(|v| -v), lead };
            Leg { base, platform, kind }
        }
        1 => {
            let guide = unit(plus([0.0, 0.0, 1.0], random.direction().map(|v| 0.5 * v)));
            let joint = random.within(400.0);
            let rod = norm(minus(minus(anchor, base), guide.map(|v| v * joint)));
            side(joint, &|side| Kind::Slider { guide, rod, side })
        }
        2 => {
            let inwards = unit([-base[0], -base[1], 0.0]);
            let axis = plus(cross(inwards, [0.0, 0.0, 1.0]), random.direction().map(|v| 0.2 * v));
            let arm = inwards.map(|v| v * random.between(200.0, 400.0));
            let joint = random.within(60.0);
            let proto = Leg { base, platform, kind: Kind::Crank { axis, arm, rod: 1.0, side: 1 } };
            let rod = norm(minus(minus(anchor, base), proto.displacement(joint)));
            // Angles of both branches are around the direction of the anchor.
            side(joint, &|side| Kind::Crank { axis, arm, rod, side })
        }
        _ => {
            let radius = random.between(20.0, 100.0);
            Leg { base, platform: [0.0, 0.0, random.within(300.0)], kind: Kind::Ring { radius } }
        }
    }
}
