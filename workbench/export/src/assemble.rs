// SPDX-License-Identifier: GPL-2.0-or-later
//! The model of a machine at home.

use crate::folder::SCENE;
use crate::mass::{Masses, ball, bar, sum};
use crate::model::{Body, Drive, Joint, Loop, Mass, Mesh, Model, Motion, Rod, Role, Site};
use crate::state::{MechanismAtHome, PlatformPlace, moves_platform, name_of};
use crate::universal::turn;
use kinematics::{Carries, Fault, Letter, Link, Matrix3, POSE_LETTERS, Pose, Vector3};
use machine::passive::{self, PassiveShape};
use machine::read::joints::JointKind;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use studies::study::file::{Lacking, Study};

/// Why a machine has no model.
#[derive(Debug, thiserror::Error)]
pub enum Impossible {
    /// Refused by the core at home.
    #[error("[TRAJ]HOME: {0}")]
    Home(#[from] Fault),
    #[error(transparent)]
    Lacking(#[from] Lacking),
    #[error(
        "axis {0} turns the legs while a table moves the work: not exported, because no chain of rigid bodies moves like \
         this; to export the rest, remove CARRIES from [AXIS_{0}], or table= from [KINS]KINEMATICS"
    )]
    TurnedTable(char),
}

/// Thickness of a platform without a study, as a share of the machine's size.
const PLATE: f64 = 0.03;

/// A model that grows.
pub struct Builder {
    pub model: Model,
    /// Meters per machine unit.
    meters: f64,
}

impl Builder {
    /// Adds a body that moves on `parent`, and returns its number.
    pub fn body(
        &mut self,
        name: String,
        parent: usize,
        origin: Vector3<f64>,
        joints: Vec<Joint>,
        mass: Mass,
        rods: Vec<Rod>,
    ) -> usize {
        let body = Body { name, parent: Some(parent), origin, joints, mass: Some(mass), rods };
        self.model.bodies.push(body);
        self.model.bodies.len() - 1
    }

    /// Creates the joint that a drive moves.
    pub fn driven(
        &self,
        config: &Mechanism,
        i: usize,
        (motion, axis, point): (Motion, Vector3<f64>, Vector3<f64>),
        rotor: Option<f64>,
        max_force: Option<f64>,
    ) -> Joint {
        let joint = config.joint(i);
        let unit = if motion == Motion::Hinge { 1.0_f64.to_radians() } else { self.meters };
        let [low, high] = [joint.min, joint.max].map(|value| value * unit);
        Joint {
            name: name_of(config, i),
            motion,
            axis,
            point,
            home: 0.0,
            range: (low.is_finite() && high.is_finite()).then_some([low, high]),
            role: Role::Driven(Drive {
                part: joint.name.clone(),
                max_velocity: joint.max_velocity * unit,
                max_force,
                rotor,
            }),
        }
    }

    /// Adds the axes of a chain, from the carrier outward, and returns the last body.
    fn chain(
        &mut self,
        config: &Mechanism,
        carries: Carries,
        from: usize,
        zero: Vector3<f64>,
    ) -> usize {
        let radius = 0.03 * self.model.size;
        let mut last = from;
        for link in config.chain.of(carries) {
            let n = config.extra_axes.places().position(|place| place == link.place);
            let i = config.joints.len() + n.expect("what carries is an extra axis");
            let motion = if link.is_rotary() { Motion::Hinge } else { Motion::Slide };
            let point = zero + link.point * self.meters;
            let joint = self.driven(config, i, (motion, link.axis, point), None, None);
            let name = format!("axis_{}", letter(link).to_ascii_lowercase());
            let disc = Rod {
                ends: [-0.5, 0.5].map(|side| point + link.axis * (side * radius)),
                radius: 2.0 * radius,
            };
            last = self.body(name, last, point, vec![joint], bar(&disc), vec![disc]);
        }
        last
    }
}

fn letter(link: &Link) -> char {
    POSE_LETTERS[link.place]
}

/// Builds the model of a machine.
///
/// # Errors
/// See [`Impossible`].
pub fn model(config: &MachineConfig, study: Option<&Study>) -> Result<Model, Impossible> {
    let first = config.first();
    let meters = 1e-3 / config.units_per_mm;
    let lengths = config.mechanisms.iter().map(leg_length).collect::<Result<Vec<_>, _>>()?;
    let size = lengths.into_iter().fold(0.0, f64::max) * meters;
    let stem = config.file.file_stem().unwrap_or_default().to_string_lossy();
    let world = Body {
        name: "world".into(),
        parent: None,
        origin: Vector3::zeros(),
        joints: vec![],
        mass: None,
        rods: vec![],
    };
    let mut to = Builder {
        model: Model {
            name: identifier(&stem),
            bodies: vec![world],
            loops: vec![],
            screws: vec![],
            meshes: vec![],
            sites: vec![],
            left_out: vec![],
            masses: match study {
                Some(_) => "from the study; solid steel bars in place of what it lacks".into(),
                None => "solid steel bars, because no study was given".into(),
            },
            size,
        },
        meters,
    };
    if to.model.name != stem {
        let name = &to.model.name;
        let text = format!("the file's name {stem:?}, which is no identifier: the model is {name}");
        to.model.left_out.push(text);
    }
    let turning = first.chain.of(Carries::Legs).find(|link| link.is_rotary());
    if let Some(link) = turning.filter(|_| !first.machine.layout().table().is_empty()) {
        return Err(Impossible::TurnedTable(letter(link)));
    }
    let carrier = to.chain(first, Carries::Legs, 0, Vector3::zeros());
    let base = Body { name: "base".into(), parent: Some(carrier), ..to.model.bodies[0].clone() };
    to.model.bodies.push(base);
    let base = to.model.bodies.len() - 1;
    for mechanism in &config.mechanisms {
        self::mechanism(&mut to, mechanism, study, base)?;
    }
    for (n, axis) in first.extra.iter().enumerate() {
        let place = first.extra_axes.places().nth(n);
        if !first.chain.links().iter().any(|link| Some(link.place) == place) {
            to.model.left_out.push(format!("axis {}, which carries nothing", axis.letter));
        }
    }
    for joint in config.mechanisms.iter().flat_map(|mechanism| &mechanism.angles) {
        if joint.cones.iter().any(Option::is_some) {
            let text = "cones of the legs' joints: pkm check and preflight judge them";
            to.model.left_out.push(text.into());
            break;
        }
    }
    Ok(depth_first(to.model))
}

/// Orders the bodies depth first, as simulators number them.
fn depth_first(model: Model) -> Model {
    let mut order = vec![];
    let mut open = vec![0];
    while let Some(body) = open.pop() {
        order.push(body);
        open.extend(
            (0..model.bodies.len()).rev().filter(|n| model.bodies[*n].parent == Some(body)),
        );
    }
    let new = |old: usize| order.iter().position(|n| *n == old).expect("each body has a place");
    let body = |old: &usize| {
        let body = model.bodies[*old].clone();
        Body { parent: body.parent.map(new), ..body }
    };
    Model {
        bodies: order.iter().map(body).collect(),
        loops: model
            .loops
            .iter()
            .map(|one| Loop { bodies: one.bodies.map(new), ..one.clone() })
            .collect(),
        meshes: model
            .meshes
            .iter()
            .map(|mesh| Mesh { body: new(mesh.body), ..mesh.clone() })
            .collect(),
        sites: model
            .sites
            .iter()
            .map(|site| Site { body: new(site.body), ..site.clone() })
            .collect(),
        ..model
    }
}

/// Returns the mean length of a mechanism's legs at home.
fn leg_length(config: &Mechanism) -> Result<f64, Fault> {
    let tool = config.chain.machine_tool(&config.spindle);
    let home = config.machine.at(&config.home_pose(), &tool)?;
    let legs = &home.segments()[..config.legs()];
    Ok(legs.iter().map(|leg| leg.span().norm()).sum::<f64>() / legs.len() as f64)
}

/// Adds the platform, legs and table of a mechanism.
fn mechanism(
    to: &mut Builder,
    config: &Mechanism,
    study: Option<&Study>,
    base: usize,
) -> Result<(), Impossible> {
    let masses = study.map(|study| Masses::of(config, study)).transpose()?.unwrap_or_default();
    let meters = to.meters;
    let prefix = if config.place.is_second { "second_" } else { "" };
    let tool = config.chain.machine_tool(&config.spindle);
    let home = config.machine.at(&config.home_pose(), &tool)?;
    let parts = MechanismAtHome::new(config, &home, meters);
    let layout = config.machine.layout();
    let (origin, rotation) = (parts.at.origin * meters, parts.at.rotation);
    let centre = origin + rotation * Vector3::from(config.geometry.centre) * meters;

    // The work side: table axes, then what carries the work or, beside a work on the platform, the tool.
    let mut fixed = 0;
    let mut shift = Vector3::zeros();
    for (k, letter) in layout.table().as_slice().iter().enumerate() {
        let i = config.legs() + k;
        let axis = -Vector3::ith(letter.index(), 1.0);
        shift += axis * (home.joints()[i] * meters);
        let moved = masses.table.as_ref().map(|masses| masses[k]);
        let max_force = masses.most.get(i).copied().flatten();
        let mut joint =
            to.driven(config, i, (Motion::Slide, axis, Vector3::zeros()), moved, max_force);
        joint.home = home.joints()[i] * meters;
        let side = 0.1 * to.model.size;
        let plate = Rod {
            ends: [Vector3::z() * -0.1 * side, Vector3::zeros()].map(|end| end + shift),
            radius: side,
        };
        let mass = if moved.is_some() { ball(shift, 0.1 * side) } else { bar(&plate) };
        fixed = to.body(
            format!("table_{}", letter.name().to_ascii_lowercase()),
            fixed,
            Vector3::zeros(),
            vec![joint],
            mass,
            vec![plate],
        );
    }

    let plate = platform_shapes(config, &parts.at, meters, to.model.size, &tool);
    let simple = sum(&plate.iter().map(bar).collect::<Vec<_>>());
    let mass = match masses.platform {
        Some(own) if own.inertia.norm() > 0.0 => Mass {
            centre: origin + rotation * own.centre,
            inertia: rotation * own.inertia * rotation.transpose(),
            ..own
        },
        Some(own) => Mass {
            centre: origin + rotation * own.centre,
            mass: own.mass,
            inertia: simple.inertia * (own.mass / simple.mass),
        },
        None => simple,
    };
    let platform = to.body(
        format!("{prefix}platform"),
        base,
        origin,
        coordinates(config, prefix, centre, &parts.at, meters),
        mass,
        plate,
    );
    for (i, leg) in parts.legs.iter().enumerate() {
        leg.build(to, config, i, &masses, [base, platform]);
    }
    for constraint in &parts.constraints {
        constraint.build(to, [base, platform]);
    }

    let radius = 0.5 * PLATE * to.model.size;
    let legs = config.geometry.legs();
    let fixed_ends: Vec<_> = (legs.iter().filter(|leg| leg.kind.guide().is_none()))
        .map(|leg| Vector3::from(leg.base) * meters)
        .collect();
    let next = fixed_ends.iter().cycle().skip(1);
    let frame =
        fixed_ends.iter().zip(next).map(|(one, other)| Rod { ends: [*one, *other], radius });
    let frame = frame.filter(|rod| (rod.ends[1] - rod.ends[0]).norm() > radius);
    to.model.bodies[base].rods.extend(frame);

    // Tool and work.
    let o = rotation * config.spindle * meters;
    let (tool_side, tool_zero, work_side, work_zero) = match config.chain.holder() {
        Some(holder) => (fixed, holder * meters + shift, platform, origin),
        None => (platform, origin, fixed, shift),
    };
    let tool_body = to.chain(config, Carries::Tool, tool_side, tool_zero);
    let work_body = to.chain(config, Carries::Work, work_side, work_zero);
    to.model.sites.push(Site {
        name: format!("{prefix}tool"),
        body: tool_body,
        place: tool_zero - o,
    });
    if !config.place.is_second {
        to.model.sites.push(Site { name: "work".into(), body: work_body, place: work_zero });
    }
    for model in &config.models {
        let (body, zero, turned) = match model.part {
            "base" => (base, Vector3::zeros(), Matrix3::identity()),
            "table" => (work_body, shift, Matrix3::identity()),
            _ => (platform, origin, rotation),
        };
        let pose = Pose::from_degrees(model.place);
        to.model.meshes.push(Mesh {
            body,
            part: model.part,
            file: model.file.clone(),
            scale: model.scale * meters,
            place: zero + turned * pose.position * meters,
            rotation: turned * pose.rotation(),
        });
    }
    Ok(())
}

/// Returns the joints of the platform: its coordinates that change, X Y Z then C B A, R = Rz Ry Rx.
fn coordinates(
    config: &Mechanism,
    prefix: &str,
    centre: Vector3<f64>,
    home: &PlatformPlace,
    meters: f64,
) -> Vec<Joint> {
    let order = [
        Letter::ALL[0],
        Letter::ALL[1],
        Letter::ALL[2],
        Letter::ALL[5],
        Letter::ALL[4],
        Letter::ALL[3],
    ];
    let active = order.into_iter().filter(|letter| moves_platform(config, *letter));
    // C and B turn the axes of the angles after them.
    let turned = |letter: Letter| {
        let outer = order[3..].iter().take_while(|outer| **outer != letter);
        outer.filter(|_| letter.is_angle()).fold(Matrix3::identity(), |turned, outer| {
            turned * turn(&Vector3::ith(outer.index() - 3, 1.0), home.angles[outer.index() - 3])
        })
    };
    let joint = |letter: Letter| {
        let (k, is_angle) = (letter.index(), letter.is_angle());
        Joint {
            name: format!("{prefix}platform_{}", letter.name().to_ascii_lowercase()),
            motion: if is_angle { Motion::Hinge } else { Motion::Slide },
            axis: turned(letter) * Vector3::ith(k % 3, 1.0),
            point: centre,
            home: if is_angle { home.angles[k - 3] } else { home.place[k] * meters },
            range: None,
            role: Role::Coordinate,
        }
    };
    active.map(joint).collect()
}

/// Returns bars from the middle of the platform to the legs and to the tool, and the tubes that are fixed to it.
fn platform_shapes(
    config: &Mechanism,
    home: &PlatformPlace,
    meters: f64,
    size: f64,
    tool: &Vector3<f64>,
) -> Vec<Rod> {
    let radius = PLATE * size;
    let place = |point: Vector3<f64>| (home.origin + home.rotation * point) * meters;
    let legs = config.geometry.legs().iter();
    let anchors: Vec<_> = legs.map(|leg| place(leg.platform.into())).collect();
    let middle = anchors.iter().sum::<Vector3<f64>>() / anchors.len() as f64;
    let tip = place(-tool);
    let ends = anchors.into_iter().chain([tip]);
    let rods = ends.map(|end| Rod { ends: [middle, end], radius: 0.6 * radius });
    let hub = Rod {
        ends: [-0.5, 0.5].map(|side| middle + home.rotation * Vector3::z() * (side * radius)),
        radius: 1.5 * radius,
    };
    let tubes = passive::parts(config).into_iter();
    let tubes = tubes.filter(|part| part.shape == PassiveShape::Tube).map(|tube| {
        let ends = tube.ends.map(|end| place(end.platform.into()));
        Rod { ends, radius: 0.6 * radius }
    });
    // An anchor in the middle needs no bar.
    std::iter::once(hub)
        .chain(tubes)
        .chain(rods.filter(|rod| (rod.ends[1] - rod.ends[0]).norm() > 0.01 * size))
        .collect()
}

/// Returns a name with only letters, digits, `-` and `_`.
fn identifier(name: &str) -> String {
    let clean: String = name
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() || "-_".contains(c) { c } else { '_' })
        .collect();
    match clean.chars().next() {
        // MJCF has a class "main" already.
        Some(c) if c.is_ascii_alphabetic() && ![SCENE, "main"].contains(&clean.as_str()) => clean,
        _ => format!("machine_{clean}"),
    }
}

/// Returns the number of the driven joint in a mechanism's kinds.
pub(crate) fn is_angle(config: &Mechanism, i: usize) -> bool {
    match i.checked_sub(config.joints.len()) {
        Some(n) => config.extra[n].is_rotary(),
        None => config.joints[i].kind == JointKind::Arm,
    }
}
