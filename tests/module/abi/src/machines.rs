// SPDX-License-Identifier: GPL-2.0-or-later
//! The machines of the tests, and how their pins are set.

use crate::geometry::{Vector, cross, minus, norm, plus, unit};
use crate::module::{Module, Pose};
use crate::random::Random;

/// A machine of six struts.
#[derive(Clone, Debug)]
pub struct Hexapod {
    pub base: [Vector; 6],
    /// Platform anchors, in the platform.
    pub platform: [Vector; 6],
    /// Fixed axes of the base joints.
    pub base_axis: [Vector; 6],
    /// Fixed axes of the platform joints, in the platform.
    pub platform_axis: [Vector; 6],
    /// Lead of all screws.
    pub lead: f64,
    pub spindle_offset: f64,
    pub tool_offset: f64,
    /// Reference pose; without one the correction is genhexkins' literal arcsin.
    pub home: Option<Pose>,
}

/// Returns a point of a circle about z.
fn on_circle(radius: f64, degrees: f64, z: f64) -> Vector {
    let (s, c) = degrees.to_radians().sin_cos();
    [radius * c, radius * s, z]
}

/// Home of [`paper_004`].
pub const PAPER_004_HOME: Pose = [0.0, 0.0, 250.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

/// Returns the hexapod of paper 004 in millimeters: base joints above, table below.
///
/// Joint radii and heights are those of the golden rows; each pair of joint
/// axes is entered in opposite directions, the base one across the strut at home.
pub fn paper_004() -> Hexapod {
    let base = [-15.0, 15.0, 105.0, 135.0, 225.0, 255.0].map(|at| on_circle(560.0, at, 1250.0));
    let platform = [-45.0, 45.0, 75.0, 165.0, 195.0, 285.0].map(|at| on_circle(200.0, at, 150.0));
    let place = [PAPER_004_HOME[0], PAPER_004_HOME[1], PAPER_004_HOME[2]];
    let base_axis = std::array::from_fn(|i| {
        unit(cross([0.0, 0.0, 1.0], minus(plus(place, platform[i]), base[i])))
    });
    Hexapod {
        base,
        platform,
        base_axis,
        platform_axis: base_axis.map(|axis: Vector| axis.map(|v| -v)),
        lead: 10.0,
        spindle_offset: 0.0,
        tool_offset: 0.0,
        home: Some(PAPER_004_HOME),
    }
}

/// Returns a random pose of paper 004's workspace: 150 mm about the axis, 300 mm of height and
/// up to 30° of tilt in any direction, with C = 0.
pub fn paper_004_pose(random: &mut Random) -> Pose {
    let (radius, at) = (150.0 * random.between(0.0, 1.0).sqrt(), random.within(180.0));
    let [x, y, z] = on_circle(radius, at, random.between(100.0, 400.0));
    let (tilt, towards) = (30.0 * random.between(0.0, 1.0).sqrt(), random.within(180.0));
    let (a, b) = tilted(tilt, towards);
    [x, y, z, a, b, 0.0, 0.0, 0.0, 0.0]
}

/// Home of [`lab_hexapod`].
pub const LAB_HOME: Pose = [0.0, 0.0, 640.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

/// Returns the laboratory hexapod of paper 001 in millimeters: platform above, no lead.
pub fn lab_hexapod() -> Hexapod {
    let ring = |radius: f64, angles: [f64; 2]| angles.map(|at| on_circle(radius, at, 0.0));
    let [b0, b1] = ring(400.0, [78.0, 102.0]);
    let [b2, b3] = ring(372.0, [198.0, 222.0]);
    let [b4, b5] = ring(372.0, [318.0, 342.0]);
    Hexapod {
        base: [b0, b1, b2, b3, b4, b5],
        platform: [42.0, 138.0, 162.0, 258.0, 282.0, 18.0].map(|at| on_circle(140.0, at, 0.0)),
        base_axis: [[0.0; 3]; 6],
        platform_axis: [[0.0; 3]; 6],
        lead: 0.0,
        spindle_offset: 0.0,
        tool_offset: 0.0,
        home: Some(LAB_HOME),
    }
}

/// Returns a random pose of the laboratory hexapod's workspace.
pub fn lab_pose(random: &mut Random) -> Pose {
    let mut pose = [0.0; 9];
    pose[0] = random.within(60.0);
    pose[1] = random.within(60.0);
    pose[2] = random.between(520.0, 800.0);
    for angle in &mut pose[3..6] {
        *angle = random.within(15.0);
    }
    pose
}

/// Returns a pose one servo step away, at 0.5 m/s and 60°/s on a machine of 1250 mm: 0.5 mm
/// and 0.06° in any direction, scaled to the machine's size.
pub fn one_servo_step_from(pose: &Pose, size: f64, random: &mut Random) -> Pose {
    let mut near = *pose;
    let (go, turn) = (random.direction(), random.direction());
    for k in 0..3 {
        near[k] += size * 0.5 / 1250.0 * go[k];
        near[k + 3] += 0.06 * turn[k];
    }
    near
}

/// Returns A and B that tilt the platform's axis by `tilt` degrees toward azimuth `towards`.
pub fn tilted(tilt: f64, towards: f64) -> (f64, f64) {
    // Third column of Ry(B) Rx(A): (sin B cos A, −sin A, cos B cos A).
    let [x, y, z] = on_circle(tilt.to_radians().sin(), towards, tilt.to_radians().cos());
    ((-y).asin().to_degrees(), x.atan2(z).to_degrees())
}

/// Returns genhexkins' default geometry, read from its pins.
pub fn genhexkins_default(module: &Module) -> Hexapod {
    let vector = |name: &str, leg: usize| {
        ["x", "y", "z"].map(|axis| module.get(&format!("{name}.{leg}.{axis}")))
    };
    Hexapod {
        base: std::array::from_fn(|leg| vector("base", leg)),
        platform: std::array::from_fn(|leg| vector("platform", leg)),
        base_axis: std::array::from_fn(|leg| vector("base-n", leg)),
        platform_axis: std::array::from_fn(|leg| vector("platform-n", leg)),
        lead: module.get("screw-lead"),
        spindle_offset: 0.0,
        tool_offset: 0.0,
        home: None,
    }
}

impl Hexapod {
    /// Sets every pin of the geometry; `.home` only if the module has it.
    pub fn wire(&self, module: &Module) {
        for leg in 0..6 {
            wire_vector(module, "base", leg, self.base[leg]);
            wire_vector(module, "platform", leg, self.platform[leg]);
            wire_vector(module, "base-n", leg, self.base_axis[leg]);
            wire_vector(module, "platform-n", leg, self.platform_axis[leg]);
        }
        module.set("screw-lead", self.lead);
        module.set("spindle-offset", self.spindle_offset);
        module.set("tool-offset", self.tool_offset);
        if module.has("home.x") {
            self.wire_home(module);
        }
    }

    fn wire_home(&self, module: &Module) {
        for (i, axis) in ["x", "y", "z", "a", "b", "c"].into_iter().enumerate() {
            let value = self.home.map_or(f64::NAN, |home| home[i]);
            module.set(&format!("home.{axis}"), value);
        }
    }

    /// Returns a module with this machine's pins set and applied.
    /// # Panics
    /// If the geometry is refused.
    pub fn module(&self) -> Module {
        let module = Module::pkmkins(&[]);
        assert!(self.apply(&module), "{:?}", module.messages());
        module
    }

    /// Sets this machine's pins of a module and applies it; false if it is refused.
    pub fn apply(&self, module: &Module) -> bool {
        self.wire(module);
        module.apply();
        module.is_on("geometry-ok") && !module.is_on("geometry-changed")
    }

    /// Returns the largest distance of an anchor from its body's origin.
    pub fn size(&self) -> f64 {
        self.base.iter().chain(&self.platform).map(|anchor| norm(*anchor)).fold(0.0, f64::max)
    }

    /// Returns the root mean square radius of the platform anchors about their centroid,
    /// which converts an angle to a length.
    pub fn radius(&self) -> f64 {
        let centroid: Vector =
            std::array::from_fn(|k| self.platform.iter().map(|b| b[k]).sum::<f64>() / 6.0);
        let squares: f64 = self.platform.iter().map(|b| norm(minus(*b, centroid)).powi(2)).sum();
        (squares / 6.0).sqrt()
    }
}

fn wire_vector(module: &Module, name: &str, leg: usize, value: Vector) {
    for (axis, value) in ["x", "y", "z"].into_iter().zip(value) {
        module.set(&format!("{name}.{leg}.{axis}"), value);
    }
}

/// Returns an artificial hexapod: joints in six sectors of two scattered rings, axes in
/// any direction, a lead of either hand, offsets. Lengths are of the order of `size`.
pub fn random_hexapod(random: &mut Random, size: f64) -> Hexapod {
    // Offsetting the platform's sectors by half of one keeps struts crossed and J regular.
    let mut ring = |radius: f64, turn: f64| -> [Vector; 6] {
        std::array::from_fn(|i| {
            let at = 60.0 * i as f64 + turn * if i % 2 == 0 { 1.0 } else { -1.0 };
            on_circle(
                size * radius * random.between(0.9, 1.1),
                at + random.within(6.0),
                size * random.within(0.1),
            )
        })
    };
    let base = ring(1.0, 20.0);
    let platform = ring(0.45, -20.0);
    Hexapod {
        base,
        platform,
        base_axis: std::array::from_fn(|_| random.direction()),
        platform_axis: std::array::from_fn(|_| random.direction()),
        lead: size * random.within(0.05),
        spindle_offset: size * random.within(0.2),
        tool_offset: size * random.within(0.2),
        home: None,
    }
}

/// Returns a pose above the base of [`random_hexapod`], slightly tilted and rotated.
pub fn random_pose(random: &mut Random, size: f64) -> Pose {
    let mut pose = [0.0; 9];
    pose[0] = size * random.within(0.3);
    pose[1] = size * random.within(0.3);
    pose[2] = size * random.between(0.9, 1.5);
    for angle in &mut pose[3..6] {
        *angle = random.within(25.0);
    }
    pose
}
