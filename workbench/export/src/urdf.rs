// SPDX-License-Identifier: GPL-2.0-or-later
//! URDF: a tree. A second file lists the loops, which the format lacks. Every value is 0 at home.

use crate::mass::ball;
use crate::model::{LoopKind, Mass, Mesh, Model, Motion, Role};
use crate::split::{Link, links, range};
use crate::xml::{Element, numbers, vector};
use kinematics::{Matrix3, Vector3};
use nalgebra::{Rotation3, Unit};
use serde::Serialize;

/// Limit of a slide without limits, in sizes of the machine: the format wants one.
const FAR: f64 = 100.0;

/// Returns the file of a model whose meshes are in these files.
pub fn file(model: &Model, meshes: &[(&Mesh, String)], comment: &str) -> String {
    let (links, _) = links(model);
    let mut root = Element::new("robot").with("name", &model.name);
    for link in &links {
        root.push(link_element(model, link, meshes));
    }
    for link in &links {
        if let Some(parent) = link.parent {
            root.push(joint_element(model, link, &links[parent]));
        }
    }
    root.file(comment)
}

fn link_element(model: &Model, link: &Link, meshes: &[(&Mesh, String)]) -> Element {
    let mut element = Element::new("link").with("name", &link.name);
    let Some((number, body)) = link.body else {
        // Simulators refuse a link without mass.
        return element.child(inertial(&ball(link.origin, 1e-3 * model.size), &link.origin));
    };
    if let Some(mass) = &body.mass {
        element.push(inertial(mass, &link.origin));
    }
    for rod in &body.rods {
        let span = rod.ends[1] - rod.ends[0];
        let middle = (rod.ends[0] + rod.ends[1]) / 2.0 - link.origin;
        let cylinder = Element::new("cylinder")
            .with("radius", numbers(&[rod.radius]))
            .with("length", numbers(&[span.norm()]));
        element.push(
            Element::new("visual")
                .child(origin(&middle, &along(&span)))
                .child(Element::new("geometry").child(cylinder)),
        );
    }
    for (mesh, file) in meshes.iter().filter(|(mesh, _)| mesh.body == number) {
        let shape = Element::new("mesh")
            .with("filename", format!("meshes/{file}"))
            .with("scale", numbers(&[mesh.scale; 3]));
        element.push(
            Element::new("visual")
                .child(origin(&(mesh.place - link.origin), &mesh.rotation))
                .child(Element::new("geometry").child(shape)),
        );
    }
    element
}

/// Returns a rotation that turns Z to a direction.
pub fn along(direction: &Vector3<f64>) -> Matrix3<f64> {
    let half = Unit::new_normalize(Vector3::x());
    let turned = Rotation3::rotation_between(&Vector3::z(), direction);
    *turned.unwrap_or_else(|| Rotation3::from_axis_angle(&half, std::f64::consts::PI)).matrix()
}

/// Returns roll, pitch and yaw.
pub fn angles(rotation: &Matrix3<f64>) -> [f64; 3] {
    let (roll, pitch, yaw) = Rotation3::from_matrix_unchecked(*rotation).euler_angles();
    [roll, pitch, yaw]
}

fn origin(place: &Vector3<f64>, rotation: &Matrix3<f64>) -> Element {
    Element::new("origin").with("xyz", vector(place)).with("rpy", numbers(&angles(rotation)))
}

fn inertial(mass: &Mass, at: &Vector3<f64>) -> Element {
    Element::new("inertial")
        .child(Element::new("origin").with("xyz", vector(&(mass.centre - at))))
        .child(Element::new("mass").with("value", numbers(&[mass.mass])))
        .child(
            tensor(mass).into_iter().fold(Element::new("inertia"), |to, (name, value)| {
                to.with(name, numbers(&[value]))
            }),
        )
}

/// Returns the named elements of a tensor of inertia.
pub fn tensor(mass: &Mass) -> [(&'static str, f64); 6] {
    let i = mass.inertia;
    [
        ("ixx", i[(0, 0)]),
        ("ixy", i[(0, 1)]),
        ("ixz", i[(0, 2)]),
        ("iyy", i[(1, 1)]),
        ("iyz", i[(1, 2)]),
        ("izz", i[(2, 2)]),
    ]
}

fn joint_element(model: &Model, link: &Link, parent: &Link) -> Element {
    let place = Element::new("origin").with("xyz", vector(&(link.origin - parent.origin)));
    let ends = |element: Element| {
        element
            .child(place)
            .child(Element::new("parent").with("link", &parent.name))
            .child(Element::new("child").with("link", &link.name))
    };
    let Some(joint) = link.joint else {
        let name = format!("{}_fixed", link.name);
        return ends(Element::new("joint").with("name", name).with("type", "fixed"));
    };
    let kind = match (joint.motion, joint.range) {
        (Motion::Slide, _) => "prismatic",
        (Motion::Hinge, Some(_)) => "revolute",
        (Motion::Hinge, None) => "continuous",
    };
    let mut element = ends(Element::new("joint").with("name", &joint.name).with("type", kind))
        .child(Element::new("axis").with("xyz", vector(&joint.axis)));
    let (effort, velocity) = match &joint.role {
        Role::Driven(drive) => (drive.max_force.unwrap_or(1e6), drive.max_velocity),
        Role::Coordinate | Role::Passive => (0.0, 1e3),
    };
    let mut limit = Element::new("limit")
        .with("effort", numbers(&[effort]))
        .with("velocity", numbers(&[velocity]));
    if kind != "continuous" {
        let far = FAR * model.size;
        let [low, high] = range(joint).unwrap_or([-far, far]);
        limit = limit.with("lower", numbers(&[low])).with("upper", numbers(&[high]));
    }
    element.push(limit);
    if let Some(screw) = model.screws.iter().find(|screw| screw.slide == joint.name) {
        let turn = Element::new("mimic").with("joint", &screw.turn);
        element.push(turn.with("multiplier", numbers(&[screw.per_radian])).with("offset", "0"));
    }
    element
}

/// What the format lacks.
#[derive(Serialize)]
struct Beside<'a> {
    loops: Vec<LoopEntry<'a>>,
    screws: Vec<ScrewEntry<'a>>,
    joints: Vec<JointEntry<'a>>,
}

#[derive(Serialize)]
struct LoopEntry<'a> {
    name: &'a str,
    /// `ball`, three equations, or `rigid`, six.
    kind: &'static str,
    links: [&'a str; 2],
    /// The point in both links' frames, which are parallel at 0.
    points: [[f64; 3]; 2],
}

#[derive(Serialize)]
struct ScrewEntry<'a> {
    turn: &'a str,
    slide: &'a str,
    meters_per_radian: f64,
}

#[derive(Serialize)]
struct JointEntry<'a> {
    name: &'a str,
    role: &'static str,
    /// Value of LinuxCNC, in SI units, at this format's 0.
    home: f64,
}

/// Returns loops, threads and home values as JSON.
pub fn beside(model: &Model) -> String {
    let (links, ends) = links(model);
    let beside = Beside {
        loops: model
            .loops
            .iter()
            .map(|one| {
                let of = one.bodies.map(|body| &links[ends[body]]);
                LoopEntry {
                    name: &one.name,
                    kind: match one.kind {
                        LoopKind::Ball => "ball",
                        LoopKind::Rigid => "rigid",
                    },
                    links: of.map(|link| link.name.as_str()),
                    points: of.map(|link| (one.point - link.origin).into()),
                }
            })
            .collect(),
        screws: model
            .screws
            .iter()
            .map(|screw| ScrewEntry {
                turn: &screw.turn,
                slide: &screw.slide,
                meters_per_radian: screw.per_radian,
            })
            .collect(),
        joints: model
            .joints()
            .map(|(_, joint)| JointEntry {
                name: &joint.name,
                role: match joint.role {
                    Role::Driven(_) => "driven",
                    Role::Coordinate => "coordinate",
                    Role::Passive => "passive",
                },
                home: joint.home,
            })
            .collect(),
    };
    serde_json::to_string_pretty(&beside).expect("numbers and names") + "\n"
}
