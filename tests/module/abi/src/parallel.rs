// SPDX-License-Identifier: GPL-2.0-or-later
//! Any machine of the module, described by its load parameters and pins.

use crate::geometry::{Vector, cross, dot, minus, norm, plus, rotation, scaled, turned, unit};
use crate::machines::Hexapod;
use crate::module::{Module, Pose};
use kinematics::ConstraintGeometry;

/// The letters of a pose, in its order.
pub const LETTERS: [&str; 6] = ["x", "y", "z", "a", "b", "c"];

#[derive(Clone, Debug)]
pub struct Leg {
    /// Base anchor; for a slider the guide's point with the carriage at 0, for a crank the hip.
    pub base: Vector,
    /// Platform anchor, or the center of its ring, in the platform.
    pub platform: Vector,
    /// Kind and its parameters.
    pub kind: Kind,
}

/// Parameters of a leg of each kind.
#[derive(Clone, Debug)]
pub enum Kind {
    Strut {
        /// Fixed axis of the base joint.
        base_axis: Vector,
        /// Fixed axis of the platform joint, in the platform.
        platform_axis: Vector,
        lead: f64,
    },
    /// Rod on a carriage.
    Slider {
        /// Direction of the guide, any length.
        guide: Vector,
        rod: f64,
        /// Branch.
        side: i32,
    },
    /// Rod on a rotating arm.
    Crank {
        /// Direction of the axis, any length.
        axis: Vector,
        /// Vector from the hip to the arm's end at 0 degrees.
        arm: Vector,
        rod: f64,
        /// Branch.
        side: i32,
    },
    /// Telescopic strut to a ring about the tool axis.
    Ring { radius: f64 },
}

impl Kind {
    /// A strut without a lead.
    pub const PLAIN_STRUT: Self =
        Self::Strut { base_axis: [0.0; 3], platform_axis: [0.0; 3], lead: 0.0 };

    /// Returns its name in the load parameter `legs`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Strut { .. } => "strut",
            Self::Slider { .. } => "slider",
            Self::Crank { .. } => "crank",
            Self::Ring { .. } => "ring",
        }
    }
}

impl Leg {
    /// Returns the displacement of the leg's lower end from its base anchor by a joint value (without offset).
    pub fn displacement(&self, joint: f64) -> Vector {
        match self.kind {
            Kind::Strut { .. } | Kind::Ring { .. } => [0.0; 3],
            Kind::Slider { guide, .. } => scaled(unit(guide), joint),
            Kind::Crank { axis, arm, .. } => {
                // Rodrigues: about the unit vector k by the joint value in degrees.
                let (s, c) = joint.to_radians().sin_cos();
                let k = unit(axis);
                let across = plus(scaled(arm, c), scaled(cross(k, arm), s));
                plus(across, scaled(k, (1.0 - c) * dot(k, arm)))
            }
        }
    }

    /// Returns the unit vector of the lower end's motion; `None` for a fixed lower end.
    pub fn motion(&self, joint: f64) -> Option<Vector> {
        match self.kind {
            Kind::Strut { .. } | Kind::Ring { .. } => None,
            Kind::Slider { guide, .. } => Some(unit(guide)),
            Kind::Crank { axis, .. } => Some(unit(cross(axis, self.displacement(joint)))),
        }
    }

    /// Returns the joint value of the other branch with the same platform anchor;
    /// `None` for a leg without branches.
    pub fn other_side(&self, anchor: Vector, joint: f64) -> Option<f64> {
        let w = minus(anchor, self.base);
        match self.kind {
            Kind::Strut { .. } | Kind::Ring { .. } => None,
            Kind::Slider { guide, .. } => Some(2.0 * dot(unit(guide), w) - joint),
            Kind::Crank { axis, arm, .. } => {
                // Mirrored at the plane of axis and platform anchor.
                let b = dot(w, cross(unit(axis), arm));
                let a = dot(w, minus(arm, scaled(unit(axis), dot(unit(axis), arm))));
                Some(2.0 * b.atan2(a).to_degrees() - joint)
            }
        }
    }
}

#[derive(Clone, Debug)]
pub struct Parallel {
    /// Legs in joint order.
    pub legs: Vec<Leg>,
    /// Load parameter `coordinates`, upper case.
    pub coordinates: &'static str,
    /// Load parameter `table`, upper case.
    pub table: &'static str,
    /// Reference point of the platform for constant and table letters.
    pub centre: Vector,
    /// Constraints of the platform; [`Self::scaled`] does not know them.
    pub constraints: Vec<ConstraintGeometry>,
    pub home: Option<Pose>,
    pub tool: Vector,
    pub spindle_offset: f64,
}

impl Parallel {
    /// Creates a machine without table, center and tool.
    pub fn new(legs: Vec<Leg>, coordinates: &'static str, home: Pose) -> Self {
        Self {
            legs,
            coordinates,
            table: "",
            centre: [0.0; 3],
            constraints: vec![],
            home: Some(home),
            tool: [0.0; 3],
            spindle_offset: 0.0,
        }
    }

    /// Returns the machine with all its lengths multiplied, as in another unit.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let mut machine = self.clone();
        for leg in &mut machine.legs {
            leg.base = scaled(leg.base, factor);
            leg.platform = scaled(leg.platform, factor);
            match &mut leg.kind {
                Kind::Strut { lead, .. } => *lead *= factor,
                Kind::Slider { rod, .. } => *rod *= factor,
                Kind::Crank { arm, rod, .. } => {
                    *arm = scaled(*arm, factor);
                    *rod *= factor;
                }
                Kind::Ring { radius } => *radius *= factor,
            }
        }
        machine.centre = scaled(machine.centre, factor);
        machine.home.iter_mut().for_each(|home| *home = in_unit(home, factor));
        machine.tool = scaled(machine.tool, factor);
        machine.spindle_offset *= factor;
        machine
    }

    /// Returns the number of joints: legs, then table axes.
    pub fn joints(&self) -> usize {
        self.legs.len() + self.table.len()
    }

    /// Returns whether legs or table move a coordinate (X = 0 … C = 5).
    pub fn moves(&self, coordinate: usize) -> bool {
        let letter = LETTERS[coordinate].to_uppercase();
        self.coordinates.contains(&letter) || self.table.contains(&letter)
    }

    /// Returns D = t − o + R (o + centre), which legs and table together position.
    pub fn point(&self, pose: &Pose) -> Vector {
        let o = plus(self.tool, [0.0, 0.0, self.spindle_offset]);
        let t = [pose[0], pose[1], pose[2]];
        plus(minus(t, o), turned(&rotation(pose), plus(o, self.centre)))
    }

    /// Returns the position of the platform anchor of leg `n`, or of the center of its ring, relative to the legs: with
    /// 0 instead of constant and table coordinates of D.
    pub fn joint_centre(&self, pose: &Pose, n: usize) -> Vector {
        let point = self.point(pose);
        let seen: Vector = std::array::from_fn(|k| {
            let moved = self.coordinates.contains(&LETTERS[k].to_uppercase());
            if moved { point[k] } else { 0.0 }
        });
        plus(seen, turned(&rotation(pose), minus(self.legs[n].platform, self.centre)))
    }

    /// Returns the position of the platform anchor; on a ring its point nearest to the base anchor.
    pub fn anchor(&self, pose: &Pose, n: usize) -> Vector {
        let (leg, centre) = (&self.legs[n], self.joint_centre(pose, n));
        let Kind::Ring { radius } = leg.kind else { return centre };
        let axis = turned(&rotation(pose), [0.0, 0.0, 1.0]);
        let outward = cross(cross(axis, minus(leg.base, centre)), axis);
        if radius == 0.0 { centre } else { plus(centre, scaled(unit(outward), radius)) }
    }

    /// Returns the vector from the lower end of leg `n` at a joint value to its platform anchor.
    pub fn span(&self, pose: &Pose, n: usize, joint: f64) -> Vector {
        let leg = &self.legs[n];
        minus(minus(self.anchor(pose, n), leg.base), leg.displacement(joint))
    }

    /// Returns the load parameters of this machine.
    pub fn parameters(&self) -> [(&'static str, String); 4] {
        let legs: Vec<String> =
            self.legs.iter().map(|leg| format!("{}:1", leg.kind.name())).collect();
        [
            ("legs", legs.join(",")),
            ("coordinates", self.coordinates.to_string()),
            ("table", self.table.to_string()),
            ("constraints", self.constraints.len().to_string()),
        ]
    }

    /// Returns a module loaded for this machine, with pins unset.
    pub fn loaded(&self) -> Module {
        self.loaded_with_boxes(0)
    }

    /// Returns such a module with boxes for the start without a seed.
    pub fn loaded_with_boxes(&self, boxes: usize) -> Module {
        self.loaded_with(&[("boxes", &boxes.to_string())])
    }

    /// Returns such a module with more load parameters.
    pub fn loaded_with(&self, more: &[(&str, &str)]) -> Module {
        let parameters = self.parameters();
        let mut all = more.to_vec();
        all.extend(parameters.iter().map(|(name, value)| (*name, value.as_str())));
        Module::pkmkins(&all)
    }

    /// Returns a module with this machine's pins set and applied.
    /// # Panics
    /// If the geometry is refused.
    pub fn module(&self) -> Module {
        let module = self.loaded();
        assert!(self.apply(&module), "{:?}: {self:?}", module.messages());
        module
    }

    /// Sets this machine's pins of a module and applies it; false if it is refused.
    pub fn apply(&self, module: &Module) -> bool {
        self.wire(module);
        module.apply();
        module.is_on("geometry-ok") && !module.is_on("geometry-changed")
    }

    /// Sets the pins of every leg.
    pub fn wire_legs(&self, module: &Module) {
        for (n, leg) in self.legs.iter().enumerate() {
            wire_leg(module, n, leg);
        }
    }

    /// Sets every pin of the geometry.
    pub fn wire(&self, module: &Module) {
        self.wire_legs(module);
        for (n, constraint) in self.constraints.iter().enumerate() {
            wire_constraint(module, n, constraint);
        }
        for (letter, value) in LETTERS.into_iter().zip(self.centre) {
            module.set(&format!("centre.{letter}"), value);
        }
        for (i, letter) in LETTERS.into_iter().enumerate() {
            module.set(&format!("home.{letter}"), self.home.map_or(f64::NAN, |home| home[i]));
        }
        for (pin, value) in
            ["tool-offset-x", "tool-offset-y", "tool-offset"].into_iter().zip(self.tool)
        {
            module.set(pin, value);
        }
        module.set("spindle-offset", self.spindle_offset);
    }

    /// Returns the largest length: of an anchor from its body's origin, a rod or an arm.
    pub fn size(&self) -> f64 {
        let lengths = self.legs.iter().flat_map(|leg| {
            let [rod, arm] = match leg.kind {
                Kind::Strut { .. } => [0.0; 2],
                Kind::Slider { rod, .. } => [rod, 0.0],
                Kind::Crank { arm, rod, .. } => [rod, norm(arm)],
                Kind::Ring { radius } => [radius, 0.0],
            };
            [norm(leg.base), norm(leg.platform), rod, arm]
        });
        lengths.fold(0.0, f64::max)
    }

    /// Returns the root mean square radius of the platform anchors about their centroid; rings contribute as in
    /// the module.
    pub fn radius(&self) -> f64 {
        let count = self.legs.len() as f64;
        let centroid: Vector = std::array::from_fn(|k| {
            self.legs.iter().map(|leg| leg.platform[k]).sum::<f64>() / count
        });
        let of_ring = |leg: &Leg| match leg.kind {
            Kind::Ring { radius } => radius * (radius + norm(leg.base)),
            _ => 0.0,
        };
        let square = |leg: &Leg| norm(minus(leg.platform, centroid)).powi(2) + of_ring(leg);
        let squares = self.legs.iter().map(square);
        (squares.sum::<f64>() / count).sqrt()
    }
}

/// Returns a pose with its lengths multiplied.
#[must_use]
pub fn in_unit(pose: &Pose, factor: f64) -> Pose {
    std::array::from_fn(|k| if (3..6).contains(&k) { pose[k] } else { factor * pose[k] })
}

/// Sets the pins of leg `n`.
pub fn wire_leg(module: &Module, n: usize, leg: &Leg) {
    wire_vector(module, "base", n, leg.base);
    if let Kind::Ring { radius } = leg.kind {
        module.set(&format!("effector.{n}.r"), radius);
        module.set(&format!("effector.{n}.z"), leg.platform[2]);
        return;
    }
    wire_vector(module, "platform", n, leg.platform);
    match &leg.kind {
        Kind::Ring { .. } => {}
        Kind::Strut { base_axis, platform_axis, lead } => {
            wire_vector(module, "base-n", n, *base_axis);
            wire_vector(module, "platform-n", n, *platform_axis);
            module.set(&format!("lead.{n}"), *lead);
        }
        Kind::Slider { guide, rod, side } => {
            wire_vector(module, "guide", n, *guide);
            wire_rod(module, n, *rod, *side);
        }
        Kind::Crank { axis, arm, rod, side } => {
            wire_vector(module, "axis", n, *axis);
            wire_vector(module, "arm", n, *arm);
            wire_rod(module, n, *rod, *side);
        }
    }
}

fn wire_constraint(module: &Module, n: usize, constraint: &ConstraintGeometry) {
    module.set(&format!("constraint.{n}.kind"), f64::from(constraint.kind()));
    let vectors = match *constraint {
        ConstraintGeometry::PointInPlane { platform, base, normal }
        | ConstraintGeometry::PlaneThroughPoint { platform, normal, base } => {
            vec![("platform", platform), ("base", base), ("normal", normal)]
        }
        ConstraintGeometry::Square { platform_axis, base_axis } => {
            vec![("platform-axis", platform_axis), ("base-axis", base_axis)]
        }
    };
    for (name, vector) in vectors {
        for (letter, value) in LETTERS.into_iter().zip(vector) {
            module.set(&format!("constraint.{n}.{name}.{letter}"), value);
        }
    }
}

fn wire_rod(module: &Module, n: usize, rod: f64, side: i32) {
    module.set(&format!("rod.{n}"), rod);
    module.set(&format!("side.{n}"), f64::from(side));
}

/// Sets three pins `NAME.N.x`, `.y`, `.z`.
pub fn wire_vector(module: &Module, name: &str, n: usize, value: Vector) {
    for (axis, value) in ["x", "y", "z"].into_iter().zip(value) {
        module.set(&format!("{name}.{n}.{axis}"), value);
    }
}

impl From<Hexapod> for Parallel {
    fn from(hexapod: Hexapod) -> Self {
        let leg = |i: usize| Leg {
            base: hexapod.base[i],
            platform: hexapod.platform[i],
            kind: Kind::Strut {
                base_axis: hexapod.base_axis[i],
                platform_axis: hexapod.platform_axis[i],
                lead: hexapod.lead,
            },
        };
        Self {
            legs: (0..6).map(leg).collect(),
            coordinates: "XYZABC",
            table: "",
            centre: [0.0; 3],
            constraints: vec![],
            home: hexapod.home,
            tool: [0.0, 0.0, hexapod.tool_offset],
            spindle_offset: hexapod.spindle_offset,
        }
    }
}
