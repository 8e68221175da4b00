// SPDX-License-Identifier: GPL-2.0-or-later
//! Random machines: anchors, guides and cranks at random, well conditioned at home.

use super::machines::geometry;
use super::{Case, NO_TOOL, direction, uniform, within};
use kinematics::leg::{CrankGeometry, RingGeometry, SliderGeometry, StrutGeometry};
use kinematics::{Geometry, Jacobian, LegGeometry, LegKind, Machine, Pose, Vector3};
use nalgebra::Rotation3;
use rand::Rng;
use rand_pcg::Pcg64;

/// Kind of a random leg.
#[derive(Clone, Copy, Debug)]
pub enum Draw {
    Strut,
    /// With axes and a lead of up to 20.
    Screw,
    Slider,
    Crank,
    Ring,
}

/// Kinds, coordinates and table of random machines.
pub struct Recipe {
    pub name: &'static str,
    pub kinds: &'static [Draw],
    pub coordinates: &'static str,
    pub table: &'static str,
}

use Draw::{Crank, Ring, Screw, Slider, Strut};

/// Every kind alone and mixed, with 6, 5, 4 and 3 coordinates, redundant and with a table.
pub const RECIPES: &[Recipe] = &[
    Recipe { name: "six struts", kinds: &[Strut; 6], coordinates: "XYZABC", table: "" },
    Recipe { name: "six sliders", kinds: &[Slider; 6], coordinates: "XYZABC", table: "" },
    Recipe { name: "six cranks", kinds: &[Crank; 6], coordinates: "XYZABC", table: "" },
    Recipe {
        name: "all kinds",
        kinds: &[Screw, Screw, Slider, Slider, Crank, Crank],
        coordinates: "XYZABC",
        table: "",
    },
    Recipe { name: "five sliders", kinds: &[Slider; 5], coordinates: "XYZAB", table: "" },
    Recipe {
        name: "slider, crank and screw, two angles",
        kinds: &[Slider, Crank, Crank, Screw],
        coordinates: "YZAC",
        table: "X",
    },
    Recipe { name: "four sliders, one angle", kinds: &[Slider; 4], coordinates: "XYZB", table: "" },
    Recipe { name: "three cranks", kinds: &[Crank; 3], coordinates: "XYZ", table: "" },
    Recipe { name: "three sliders", kinds: &[Slider; 3], coordinates: "XYZ", table: "" },
    Recipe { name: "wrist of cranks", kinds: &[Crank; 3], coordinates: "ABC", table: "" },
    Recipe {
        name: "eight legs",
        kinds: &[Slider, Slider, Slider, Crank, Crank, Crank, Strut, Strut],
        coordinates: "XYZABC",
        table: "",
    },
    Recipe { name: "five for three", kinds: &[Slider; 5], coordinates: "ZAB", table: "XY" },
    Recipe { name: "five rings", kinds: &[Ring; 5], coordinates: "XYZAB", table: "" },
    Recipe { name: "six rings", kinds: &[Ring; 6], coordinates: "XYZABC", table: "" },
    Recipe {
        name: "rings beside all kinds",
        kinds: &[Ring, Ring, Slider, Crank, Screw, Strut],
        coordinates: "XYZABC",
        table: "",
    },
    Recipe {
        name: "rings and carriages for five",
        kinds: &[Ring, Ring, Ring, Slider, Slider, Slider, Ring],
        coordinates: "XYZAB",
        table: "",
    },
];

/// Least singular value of the rows, angles times the radius, of a machine that is
/// tested: below it the workspace is a few millimeters.
const CONDITION: f64 = 0.15;

/// Creates a machine of the recipe that is well conditioned at home.
pub fn draw(rng: &mut Pcg64, recipe: &Recipe) -> Case {
    loop {
        let given = given(rng, recipe);
        let Ok(machine) = Machine::freeze(&given, &super::NO_OFFSET) else { continue };
        let home = Pose::from_degrees(given.home.expect("drawn with one"));
        let rows = machine
            .at(&home, &NO_TOOL)
            .expect("home is reached")
            .inverse_jacobian()
            .expect("home is reached");
        if least_singular_value(&machine, &rows) > CONDITION {
            return case(recipe.name, given, machine, home);
        }
    }
}

/// Samples poses up to 60 mm and 12° from home in the moving coordinates.
fn case(name: &'static str, geometry: Geometry, machine: Machine, home: Pose) -> Case {
    let given = home.to_degrees();
    let spread = |k: usize| match kinematics::Letter::ALL[k] {
        letter if machine.layout().is_held(letter) => 0.0,
        letter if letter.is_angle() => 12.0,
        _ => 60.0,
    };
    let low = std::array::from_fn(|k| given[k] - spread(k));
    let high = std::array::from_fn(|k| given[k] + spread(k));
    Case { name, geometry, machine, home, sample: within(low, high), step: 0.5 }
}

/// Computes it for the rows of struts and of rods' ends along their path, over the active coordinates.
fn least_singular_value(machine: &Machine, rows: &Jacobian) -> f64 {
    let layout = machine.layout();
    let mut normal = nalgebra::SMatrix::<f64, 6, 6>::identity();
    let active = |k: usize| layout.coordinates().as_slice().iter().any(|l| l.index() == k);
    let scale = |k: usize| if k < 3 { 1.0 } else { 1.0 / machine.radius() };
    for j in (0..6).filter(|j| active(*j)) {
        for k in (0..6).filter(|k| active(*k)) {
            normal[(j, k)] = (0..layout.legs()).map(|i| rows[(i, j)] * rows[(i, k)]).sum::<f64>()
                * scale(j)
                * scale(k);
        }
    }
    normal.symmetric_eigenvalues().min().max(0.0).sqrt()
}

fn given(rng: &mut Pcg64, recipe: &Recipe) -> Geometry {
    let held =
        |letter: char| !recipe.coordinates.contains(letter) && !recipe.table.contains(letter);
    let mut home = [0.0; 6];
    for (k, letter) in "XYZABC".chars().enumerate().filter(|(_, l)| !held(*l)) {
        home[k] = if k < 3 { uniform(rng, -100.0, 100.0) } else { uniform(rng, -15.0, 15.0) };
        if letter == 'Z' {
            home[k] += 600.0;
        }
    }
    let centre = direction(rng) * 60.0;
    let at = Pose::from_degrees(home);
    // D = t + R center; neither a table's letter nor a held one affects the legs.
    let mut d = at.position + at.rotation() * centre;
    for (k, letter) in "XYZ".chars().enumerate() {
        if !recipe.coordinates.contains(letter) {
            d[k] = 0.0;
        }
    }
    let legs: Vec<_> = recipe
        .kinds
        .iter()
        .map(|kind| {
            let platform = direction(rng) * uniform(rng, 80.0, 250.0);
            leg(rng, *kind, platform, d + at.rotation() * (platform - centre))
        })
        .collect();
    let mut given = geometry(&legs, recipe.coordinates, recipe.table, Some(home));
    given.centre = centre.into();
    given
}

/// Creates a leg whose platform anchor `platform` is at `p` in base at home.
fn leg(rng: &mut Pcg64, kind: Draw, platform: Vector3<f64>, p: Vector3<f64>) -> LegGeometry {
    let n = direction(rng);
    let length = uniform(rng, 400.0, 900.0);
    let c = p - n * length;
    match kind {
        Strut => LegGeometry::strut(c.into(), platform.into(), StrutGeometry::default()),
        Screw => LegGeometry::strut(c.into(), platform.into(), screw(rng, &n)),
        Slider => {
            let guide = across_not(rng, &n);
            let side = if n.dot(&guide) > 0.0 { -1 } else { 1 };
            let base = c - guide * uniform(rng, -500.0, 500.0);
            let long = guide * uniform(rng, 0.1, 10.0);
            let kind = SliderGeometry { guide: long.into(), rod: length, side };
            LegGeometry {
                base: base.into(),
                platform: platform.into(),
                kind: LegKind::Slider(kind),
            }
        }
        Crank => crank(rng, platform, c, n, length),
        Ring => {
            // Up to most of the distance from the axis to the base anchor, if the platform is level.
            let radius = uniform(rng, 0.0, 0.7) * (n * length).xy().norm();
            let kind = LegKind::Ring(RingGeometry { radius });
            LegGeometry { base: c.into(), platform: platform.into(), kind }
        }
    }
}

/// Returns a direction at least 27° from the plane perpendicular to `n` (u·e at least 0.45).
fn across_not(rng: &mut Pcg64, n: &Vector3<f64>) -> Vector3<f64> {
    loop {
        let guide = direction(rng);
        if n.dot(&guide).abs() > 0.45 {
            return guide;
        }
    }
}

fn screw(rng: &mut Pcg64, n: &Vector3<f64>) -> StrutGeometry {
    let mut across = || loop {
        let axis = direction(rng);
        if axis.dot(n).abs() < 0.5 {
            return axis;
        }
    };
    let (a, b) = (across(), across());
    StrutGeometry { base_axis: a.into(), platform_axis: b.into(), lead: uniform(rng, -20.0, 20.0) }
}

/// Creates a crank whose arm ends at `c` at home; not always perpendicular to its axis.
fn crank(
    rng: &mut Pcg64,
    platform: Vector3<f64>,
    c: Vector3<f64>,
    n: Vector3<f64>,
    rod: f64,
) -> LegGeometry {
    loop {
        let axis = direction(rng);
        let now = direction(rng) * uniform(rng, 200.0, 400.0);
        let motion = axis.cross(&now);
        let drive = n.dot(&motion) / motion.norm();
        if !(drive.abs() > 0.45 && motion.norm() > 100.0) {
            continue;
        }
        let back = Rotation3::new(axis * -uniform(rng, -2.0, 2.0));
        let kind = CrankGeometry {
            axis: (axis * uniform(rng, 0.1, 10.0)).into(),
            arm: (back * now).into(),
            rod,
            side: if drive > 0.0 { -1 } else { 1 },
        };
        return LegGeometry {
            base: (c - now).into(),
            platform: platform.into(),
            kind: LegKind::Crank(kind),
        };
    }
}

/// Returns true or false with equal probability.
pub fn coin(rng: &mut Pcg64) -> bool {
    rng.random()
}
