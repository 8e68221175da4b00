// SPDX-License-Identifier: GPL-2.0-or-later
//! SDF, the format of Gazebo. Every value is 0 at home.

use crate::mass::ball;
use crate::model::{LoopKind, Mass, Mesh, Model, Motion, Role};
use crate::split::{Link, links, range};
use crate::urdf::{along, angles, tensor};
use crate::xml::{Element, numbers, vector};
use kinematics::{Matrix3, Vector3};

/// Version of the format: the one of Debian 12's parser.
const VERSION: &str = "1.9";

/// Returns the file of a model whose meshes are in these files.
pub fn file(model: &Model, meshes: &[(&Mesh, String)], comment: &str) -> String {
    let (links, ends) = links(model);
    let mut root = Element::new("model").with("name", &model.name);
    // A thread is one joint: the slide's link takes the place of both.
    let is_turn = |link: &Link| {
        link.joint.is_some_and(|joint| model.screws.iter().any(|screw| screw.turn == joint.name))
    };
    for link in links.iter().filter(|link| link.parent.is_some() && !is_turn(link)) {
        root.push(link_element(model, link, meshes));
    }
    for link in links.iter().filter(|link| !is_turn(link)) {
        if let Some(parent) = link.parent {
            let parent = &links[parent];
            let parent = if is_turn(parent) {
                parent.parent.map_or(parent, |one| &links[one])
            } else {
                parent
            };
            root.push(joint_element(model, link, parent));
        }
    }
    for one in &model.loops {
        let [first, second] = one.bodies.map(|body| &links[ends[body]]);
        let kind = match one.kind {
            LoopKind::Ball => "ball",
            LoopKind::Rigid => "fixed",
        };
        root.push(
            Element::new("joint")
                .with("name", &one.name)
                .with("type", kind)
                .child(pose(&(one.point - second.origin), &Matrix3::identity()))
                .child(Element::new("parent").text(&first.name))
                .child(Element::new("child").text(&second.name)),
        );
    }
    for (_, joint) in model.joints().filter(|(_, joint)| matches!(joint.role, Role::Driven(_))) {
        root.push(
            Element::new("plugin")
                .with("filename", "gz-sim-joint-position-controller-system")
                .with("name", "gz::sim::systems::JointPositionController")
                .child(Element::new("joint_name").text(&joint.name))
                .child(Element::new("topic").text(format!("{}/{}", model.name, joint.name))),
        );
    }
    Element::new("sdf").with("version", VERSION).child(root).file(comment)
}

fn pose(place: &Vector3<f64>, rotation: &Matrix3<f64>) -> Element {
    Element::new("pose").text(format!("{} {}", vector(place), numbers(&angles(rotation))))
}

fn link_element(model: &Model, link: &Link, meshes: &[(&Mesh, String)]) -> Element {
    let level = Matrix3::identity();
    let mut element =
        Element::new("link").with("name", &link.name).child(pose(&link.origin, &level));
    let mass = link.body.and_then(|(_, body)| body.mass);
    element.push(inertial(
        &mass.unwrap_or_else(|| ball(link.origin, 1e-3 * model.size)),
        &link.origin,
    ));
    let Some((number, body)) = link.body else { return element };
    let visual = |name: String, pose: Element, shape: Element| {
        Element::new("visual")
            .with("name", name)
            .child(pose)
            .child(Element::new("geometry").child(shape))
    };
    for (n, rod) in body.rods.iter().enumerate() {
        let span = rod.ends[1] - rod.ends[0];
        let middle = (rod.ends[0] + rod.ends[1]) / 2.0 - link.origin;
        let cylinder = Element::new("cylinder")
            .child(Element::new("radius").text(numbers(&[rod.radius])))
            .child(Element::new("length").text(numbers(&[span.norm()])));
        element.push(visual(format!("bar_{n}"), pose(&middle, &along(&span)), cylinder));
    }
    for (mesh, file) in meshes.iter().filter(|(mesh, _)| mesh.body == number) {
        let shape = Element::new("mesh")
            .child(Element::new("uri").text(format!("meshes/{file}")))
            .child(Element::new("scale").text(numbers(&[mesh.scale; 3])));
        element.push(visual(
            mesh.part.into(),
            pose(&(mesh.place - link.origin), &mesh.rotation),
            shape,
        ));
    }
    element
}

fn inertial(mass: &Mass, at: &Vector3<f64>) -> Element {
    let inertia =
        tensor(mass).into_iter().map(|(name, value)| Element::new(name).text(numbers(&[value])));
    Element::new("inertial")
        .child(pose(&(mass.centre - at), &Matrix3::identity()))
        .child(Element::new("mass").text(numbers(&[mass.mass])))
        .child(Element::new("inertia").children(inertia))
}

fn joint_element(model: &Model, link: &Link, parent: &Link) -> Element {
    let ends = |element: Element| {
        element
            .child(Element::new("parent").text(&parent.name))
            .child(Element::new("child").text(&link.name))
    };
    let Some(joint) = link.joint else {
        let name = format!("{}_fixed", link.name);
        return ends(Element::new("joint").with("name", name).with("type", "fixed"));
    };
    let screw = model.screws.iter().find(|screw| screw.slide == joint.name);
    let kind = match (screw, joint.motion) {
        (Some(_), _) => "screw",
        (None, Motion::Slide) => "prismatic",
        (None, Motion::Hinge) => "revolute",
    };
    let mut axis = Element::new("axis").child(Element::new("xyz").text(vector(&joint.axis)));
    let mut limit = Element::new("limit");
    if let Some([low, high]) = range(joint) {
        limit = limit
            .child(Element::new("lower").text(numbers(&[low])))
            .child(Element::new("upper").text(numbers(&[high])));
    }
    if let Role::Driven(drive) = &joint.role {
        limit = limit
            .child(Element::new("effort").text(numbers(&[drive.max_force.unwrap_or(1e6)])))
            .child(Element::new("velocity").text(numbers(&[drive.max_velocity])));
    }
    axis.push(limit);
    let mut element =
        ends(Element::new("joint").with("name", &joint.name).with("type", kind)).child(axis);
    if let Some(screw) = screw {
        // Radians per meter, positive for a left-hand thread.
        element.push(Element::new("thread_pitch").text(numbers(&[-1.0 / screw.per_radian])));
    }
    element
}
