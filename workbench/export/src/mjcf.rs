// SPDX-License-Identifier: GPL-2.0-or-later
//! MJCF, the format of MuJoCo. Values of driven joints and coordinates are those of LinuxCNC: attribute `ref`.

use crate::model::{Body, Joint, LoopKind, Mesh, Model, Motion, Role};
use crate::xml::{Element, numbers, vector};
use kinematics::Vector3;
use nalgebra::{Rotation3, UnitQuaternion};
use std::f64::consts::TAU;

/// Time constant and damping ratio of the loops: twice the time step is the least that MuJoCo allows.
const SOLREF: &str = "0.001 1";
const STEP: &str = "0.0005";

/// Stiffness of loops near 1: they barely yield.
const SOLIMP: &str = "0.9999 0.9999 0.001 0.5 2";

/// Frequency of a drive without load on its position controller, Hz.
const SERVO: f64 = 70.0;

/// Returns the file of a model whose meshes are in these files.
pub fn file(model: &Model, meshes: &[(&Mesh, String)], comment: &str) -> String {
    let compiler = Element::new("compiler")
        .with("angle", "radian")
        .with("autolimits", "true")
        .with("meshdir", "meshes");
    let option = Element::new("option")
        .with("timestep", STEP)
        .with("integrator", "implicitfast")
        .with("gravity", "0 0 -9.80665");
    let geom = Element::new("geom")
        .with("type", "cylinder")
        .with("contype", "0")
        .with("conaffinity", "0")
        .with("group", "1")
        .with("rgba", "0.6 0.63 0.68 1");
    let equality = Element::new("equality").with("solref", SOLREF).with("solimp", SOLIMP);
    let position = Element::new("position").with("dampratio", "1");
    // A class of its own: the default values of a file that includes this one remain as they are.
    let class = Element::new("default").with("class", &model.name);
    let default = Element::new("default").child(class.child(geom).child(equality).child(position));
    let asset = meshes.iter().map(|(mesh, file)| {
        let scale = numbers(&[mesh.scale; 3]);
        Element::new("mesh").with("name", mesh.part).with("file", file).with("scale", scale)
    });
    let mut world = Element::new("worldbody");
    contents(model, 0, meshes, &mut world);
    let mut root = Element::new("mujoco").with("model", &model.name);
    for part in [compiler, option, default] {
        root.push(part);
    }
    if !meshes.is_empty() {
        root.push(Element::new("asset").children(asset));
    }
    root.push(world);
    root.push(Element::new("equality").children(equalities(model)));
    root.push(Element::new("actuator").children(actuators(model)));
    root.push(Element::new("keyframe").child(home(model)));
    root.file(comment)
}

/// Returns a file that shows the model over a floor.
pub fn scene(model: &Model, comment: &str) -> String {
    let ends = model.bodies.iter().flat_map(|body| &body.rods).flat_map(|rod| rod.ends);
    let [low, high] = ends
        .fold([Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN)], |[low, high], end| {
            [low.inf(&end), high.sup(&end)]
        });
    let (centre, extent) = ((low + high) / 2.0, (high - low).norm() / 2.0);
    let visual = Element::new("visual")
        .child(
            Element::new("headlight").with("diffuse", "0.6 0.6 0.6").with("ambient", "0.3 0.3 0.3"),
        )
        .child(Element::new("global").with("offwidth", "1280").with("offheight", "960"));
    let texture = |kind: &str| Element::new("texture").with("type", kind).with("width", "300");
    let asset = Element::new("asset")
        .child(
            texture("skybox")
                .with("builtin", "gradient")
                .with("rgb1", "0.9 0.93 0.97")
                .with("rgb2", "0.7 0.75 0.8")
                .with("height", "1800"),
        )
        .child(
            texture("2d")
                .with("name", "floor")
                .with("builtin", "checker")
                .with("rgb1", "0.75 0.77 0.8")
                .with("rgb2", "0.7 0.72 0.75")
                .with("height", "300"),
        )
        .child(
            Element::new("material")
                .with("name", "floor")
                .with("texture", "floor")
                .with("texuniform", "true")
                .with("texrepeat", numbers(&[1.0 / extent; 2])),
        );
    let above = centre + Vector3::z() * (3.0 * extent);
    let below = Vector3::new(centre.x, centre.y, low.z - 0.1 * extent);
    let world = Element::new("worldbody")
        .child(
            Element::new("light")
                .with("pos", vector(&above))
                .with("dir", "0 0 -1")
                .with("type", "directional"),
        )
        .child(
            Element::new("geom")
                .with("name", "floor")
                .with("type", "plane")
                .with("pos", vector(&below))
                .with("size", "0 0 0.05")
                .with("material", "floor")
                .with("rgba", "1 1 1 1"),
        );
    Element::new("mujoco")
        .with("model", format!("{} scene", model.name))
        .child(Element::new("include").with("file", format!("{}.xml", model.name)))
        .child(
            Element::new("statistic")
                .with("center", vector(&centre))
                .with("extent", numbers(&[extent])),
        )
        .child(visual)
        .child(asset)
        .child(world)
        .file(comment)
}

/// Adds shapes, sites and children of a body.
fn contents(model: &Model, number: usize, meshes: &[(&Mesh, String)], to: &mut Element) {
    let body = &model.bodies[number];
    let is_world = body.parent.is_none();
    let shape = || match is_world {
        true => Element::new("geom").with("class", &model.name),
        false => Element::new("geom"),
    };
    for rod in &body.rods {
        let ends = [rod.ends[0] - body.origin, rod.ends[1] - body.origin];
        let fromto = numbers(&[ends[0].as_slice(), ends[1].as_slice()].concat());
        to.push(shape().with("fromto", fromto).with("size", numbers(&[rod.radius])));
    }
    for (mesh, _) in meshes.iter().filter(|(mesh, _)| mesh.body == number) {
        let rotation = Rotation3::from_matrix_unchecked(mesh.rotation);
        let q = UnitQuaternion::from_rotation_matrix(&rotation);
        to.push(
            shape()
                .with("type", "mesh")
                .with("mesh", mesh.part)
                .with("pos", vector(&(mesh.place - body.origin)))
                .with("quat", numbers(&[q.w, q.i, q.j, q.k])),
        );
    }
    for site in model.sites.iter().filter(|site| site.body == number) {
        to.push(
            Element::new("site")
                .with("name", &site.name)
                .with("pos", vector(&(site.place - body.origin)))
                .with("size", numbers(&[0.01 * model.size])),
        );
    }
    for (n, child) in
        model.bodies.iter().enumerate().filter(|(_, child)| child.parent == Some(number))
    {
        let mut element =
            Element::new("body").with("name", &child.name).with("pos", vector(&model.offset(n)));
        if is_world {
            element = element.with("childclass", &model.name);
        }
        if let Some(mass) = child.mass {
            element.push(inertial(child, &mass));
        }
        for joint in &child.joints {
            element.push(joint_element(model, n, joint));
        }
        contents(model, n, meshes, &mut element);
        to.push(element);
    }
}

fn inertial(body: &Body, mass: &crate::model::Mass) -> Element {
    let i = mass.inertia;
    let full = [i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(0, 1)], i[(0, 2)], i[(1, 2)]];
    Element::new("inertial")
        .with("pos", vector(&(mass.centre - body.origin)))
        .with("mass", numbers(&[mass.mass]))
        .with("fullinertia", numbers(&full))
}

fn joint_element(model: &Model, number: usize, joint: &Joint) -> Element {
    let body = &model.bodies[number];
    let mut element = Element::new("joint").with("name", &joint.name);
    element = match joint.motion {
        Motion::Slide => element.with("type", "slide"),
        Motion::Hinge => {
            element.with("type", "hinge").with("pos", vector(&(joint.point - body.origin)))
        }
    };
    element = element.with("axis", vector(&joint.axis));
    if joint.home != 0.0 {
        element = element.with("ref", numbers(&[joint.home]));
    }
    if let Some(range) = joint.range {
        element = element.with("range", numbers(&range));
    }
    match &joint.role {
        Role::Driven(drive) => {
            // Without it the loops would have only the masses of the legs to act on.
            let rotor = drive.rotor.unwrap_or_else(|| model.share(number, joint));
            element.with("armature", numbers(&[rotor]))
        }
        _ => element,
    }
}

fn equalities(model: &Model) -> impl Iterator<Item = Element> {
    let loops = model.loops.iter().map(|one| {
        let [first, second] = one.bodies.map(|body| &model.bodies[body]);
        let (kind, place) = match one.kind {
            LoopKind::Ball => ("connect", one.point - first.origin),
            // The anchor of a weld is in its second body.
            LoopKind::Rigid => ("weld", one.point - second.origin),
        };
        Element::new(kind)
            .with("name", &one.name)
            .with("class", &model.name)
            .with("body1", &first.name)
            .with("body2", &second.name)
            .with("anchor", vector(&place))
    });
    let screws = model.screws.iter().map(|screw| {
        Element::new("joint")
            .with("name", &screw.name)
            .with("class", &model.name)
            .with("joint1", &screw.slide)
            .with("joint2", &screw.turn)
            .with("polycoef", numbers(&[0.0, screw.per_radian, 0.0, 0.0, 0.0]))
    });
    loops.chain(screws)
}

/// Returns a position controller for every driven joint.
fn actuators(model: &Model) -> impl Iterator<Item = Element> {
    model.joints().filter_map(move |(n, joint)| {
        let Role::Driven(drive) = &joint.role else { return None };
        let gain = model.share(n, joint) * (TAU * SERVO).powi(2);
        let mut element = Element::new("position")
            .with("name", &joint.name)
            .with("class", &model.name)
            .with("joint", &joint.name)
            .with("kp", numbers(&[gain]));
        if let Some(range) = joint.range {
            element = element.with("ctrlrange", numbers(&range));
        }
        if let Some(most) = drive.max_force {
            element = element.with("forcerange", numbers(&[-most, most]));
        }
        Some(element)
    })
}

/// Returns the keyframe of the machine at home.
fn home(model: &Model) -> Element {
    let all: Vec<f64> = model.joints().map(|(_, joint)| joint.home).collect();
    let is_driven = |joint: &Joint| matches!(joint.role, Role::Driven(_));
    let driven: Vec<f64> =
        model.joints().filter(|(_, joint)| is_driven(joint)).map(|(_, joint)| joint.home).collect();
    Element::new("key")
        .with("name", "home")
        .with("qpos", numbers(&all))
        .with("ctrl", numbers(&driven))
}
