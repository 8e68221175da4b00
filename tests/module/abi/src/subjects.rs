// SPDX-License-Identifier: GPL-2.0-or-later
//! Machines of every kind with their workspaces.
//!
//! Dimensions and workspaces are those of configs/; the last two machines are artificial, with
//! all kinds of legs, eight of them, a lead, and both charts of rotations.

use crate::geometry::{Vector, cross, plus, unit};
use crate::machines::{Hexapod, lab_hexapod, lab_pose, paper_004, paper_004_pose};
use crate::module::Pose;
use crate::parallel::{Kind, Leg, Parallel};
use crate::random::Random;
use kinematics::ConstraintGeometry;

/// A machine with the poses of its workspace.
pub struct Subject {
    pub name: &'static str,
    pub machine: Parallel,
    /// Returns a random pose of the workspace.
    pub sample: fn(&mut Random) -> Pose,
}

impl Subject {
    fn new(name: &'static str, machine: Parallel, sample: fn(&mut Random) -> Pose) -> Self {
        Self { name, machine, sample }
    }

    /// Returns the reference pose.
    /// # Panics
    /// If the machine has none.
    pub fn home(&self) -> Pose {
        self.machine.home.expect("every subject has a reference pose")
    }
}

/// Returns every machine.
pub fn subjects() -> Vec<Subject> {
    let mut all = hexapods();
    all.extend(rods());
    all.push(Subject::new("tripod", tripod(), tripod_pose));
    all.push(Subject::new("hybrid of all kinds", hybrid(), hybrid_pose));
    all.push(Subject::new("eight struts over a table", octopod(), octopod_pose));
    all.push(Subject::new("pentapod on rings", sample_pentapod(), pentapod_pose));
    let mixed = Subject::new("rings, struts and carriages", ringed(), ringed_pose);
    all.push(mixed);
    all
}

/// Returns machines of six struts.
pub fn hexapods() -> Vec<Subject> {
    let long_tool = Hexapod { tool_offset: 120.0, ..paper_004() };
    vec![
        Subject::new("hexapod of paper 004", paper_004().into(), paper_004_pose),
        Subject::new("the same with a tool", long_tool.into(), paper_004_pose),
        Subject::new("laboratory hexapod", lab_hexapod().into(), lab_pose),
    ]
}

/// Returns machines of rods on carriages or cranks.
pub fn rods() -> Vec<Subject> {
    let with_tool = Parallel { tool: [7.0, -11.0, 80.0], ..pyramid() };
    let home = Some(pose([0.0, 0.0, -12.0, 0.0, 0.0, 0.0]));
    let rotary = Parallel { home, ..rotary_delta(10.0, 10.0, 18.0, 5.0) };
    vec![
        Subject::new("four-rod lathe", four_rod_lathe(), four_rod_lathe_pose),
        Subject::new("six-rod lathe", six_rod_lathe(), six_rod_lathe_pose),
        Subject::new("pyramid", pyramid(), pyramid_pose),
        Subject::new("pyramid with a tool", with_tool, pyramid_pose),
        Subject::new("linear delta", linear_delta(163.25, 33.0, 269.0), linear_delta_pose),
        Subject::new("rotary delta", rotary, rotary_delta_pose),
    ]
}

/// Returns a pose of six coordinates.
pub const fn pose(c: [f64; 6]) -> Pose {
    [c[0], c[1], c[2], c[3], c[4], c[5], 0.0, 0.0, 0.0]
}

/// Returns a random pose in a box of `half` sizes about `middle`.
fn in_box(random: &mut Random, middle: [f64; 6], half: [f64; 6]) -> Pose {
    let mut pose = pose(middle);
    for (value, half) in pose.iter_mut().zip(half) {
        *value += random.within(half);
    }
    pose
}

fn slider(base: Vector, platform: Vector, guide: Vector, rod: f64, side: i32) -> Leg {
    Leg { base, platform, kind: Kind::Slider { guide, rod, side } }
}

const UP: Vector = [0.0, 0.0, 1.0];

const LATHE_HOME: Pose = pose([0.0, 450.0, 1000.0, 0.0, 0.0, 0.0]);

/// Returns the four-rod lathe of Kuznetsov, Dmytriev, Dinevych; dimensions of configs/four-rod-lathe.
pub fn four_rod_lathe() -> Parallel {
    let leg =
        |rail: f64, z: f64, side| slider([rail, 0.0, 0.0], [rail / 3.0, 0.0, z], UP, 700.0, side);
    let legs = vec![
        leg(450.0, -60.0, -1),
        leg(450.0, 60.0, 1),
        leg(-450.0, -60.0, -1),
        leg(-450.0, 60.0, 1),
    ];
    Parallel::new(legs, "XYZB", LATHE_HOME)
}

pub fn four_rod_lathe_pose(random: &mut Random) -> Pose {
    in_box(random, [0.0, 450.0, 1000.0, 0.0, 0.0, 0.0], [120.0, 70.0, 400.0, 0.0, 20.0, 0.0])
}

/// Returns the six-rod lathe of the same authors; dimensions of configs/six-rod-lathe.
pub fn six_rod_lathe() -> Parallel {
    let mut machine = four_rod_lathe();
    let third =
        |sign: f64| slider([600.0 * sign, 0.0, 0.0], [100.0 * sign, -150.0, 0.0], UP, 700.0, 1);
    machine.legs.insert(2, third(1.0));
    machine.legs.push(third(-1.0));
    machine.coordinates = "XYZABC";
    machine
}

fn six_rod_lathe_pose(random: &mut Random) -> Pose {
    in_box(random, [0.0, 445.0, 1000.0, 0.0, 0.0, 0.0], [70.0, 35.0, 400.0, 12.0, 12.0, 12.0])
}

/// Returns the drill-milling machine of Dmytriev, Piven, Keba; dimensions of configs/pyramid.
pub fn pyramid() -> Parallel {
    let leg = |x: f64, y: f64| {
        let base = [700.0 * x, 700.0 * y, 200.0];
        slider(base, [120.0 * x, 120.0 * y, 150.0], [-500.0 * x, -500.0 * y, 1000.0], 550.0, 1)
    };
    let legs = vec![leg(1.0, 0.0), leg(0.0, 1.0), leg(-1.0, 0.0), leg(0.0, -1.0)];
    let home = pose([0.0, 0.0, 270.0, 0.0, 0.0, 0.0]);
    Parallel { table: "XY", centre: [0.0, 0.0, 150.0], ..Parallel::new(legs, "ZAB", home) }
}

/// Returns a random pose of the pyramid's workspace.
pub fn pyramid_pose(random: &mut Random) -> Pose {
    in_box(random, [0.0, 0.0, 270.0, 0.0, 0.0, 0.0], [150.0, 150.0, 120.0, 20.0, 20.0, 0.0])
}

/// Returns the directions of three legs at `degrees`, in that order.
fn spokes(degrees: [f64; 3]) -> [Vector; 3] {
    degrees.map(|at| {
        let (s, c) = f64::to_radians(at).sin_cos();
        [c, s, 0.0]
    })
}

fn along(spoke: Vector, radius: f64) -> Vector {
    spoke.map(|v| v * radius)
}

/// Returns a linear delta with the towers of LinuxCNC's lineardeltakins.
pub fn linear_delta(towers: f64, effector: f64, rod: f64) -> Parallel {
    let leg = |d: Vector| slider(along(d, towers), along(d, effector), UP, rod, 1);
    let legs = spokes([90.0, 210.0, 330.0]).map(leg).to_vec();
    // A third of the rod up: for the dimensions of configs/linear-delta inside its workspace.
    Parallel::new(legs, "XYZ", pose([0.0, 0.0, rod / 3.0, 0.0, 0.0, 0.0]))
}

fn linear_delta_pose(random: &mut Random) -> Pose {
    in_box(random, [0.0, 0.0, 50.0, 0.0, 0.0, 0.0], [80.0, 80.0, 50.0, 0.0, 0.0, 0.0])
}

/// Returns a rotary delta with the arms of LinuxCNC's rotarydeltakins; at its reference
/// pose the shins are perpendicular to the thighs.
pub fn rotary_delta(platform: f64, thigh: f64, shin: f64, foot: f64) -> Parallel {
    let leg = |d: Vector| Leg {
        base: along(d, platform),
        platform: along(d, foot),
        kind: Kind::Crank { axis: cross(UP, d), arm: along(d, thigh), rod: shin, side: -1 },
    };
    let legs = spokes([270.0, 30.0, 150.0]).map(leg).to_vec();
    let depth = (thigh * thigh + shin * shin - (platform - foot).powi(2)).sqrt();
    Parallel::new(legs, "XYZ", pose([0.0, 0.0, -depth, 0.0, 0.0, 0.0]))
}

fn rotary_delta_pose(random: &mut Random) -> Pose {
    in_box(random, [0.0, 0.0, -14.0, 0.0, 0.0, 0.0], [4.0, 4.0, 4.0, 0.0, 0.0, 0.0])
}

/// Returns machines with constraints of the platform.
pub fn constrained() -> Vec<Subject> {
    let (x, y, o) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3]);
    let through =
        |platform, normal, base| ConstraintGeometry::PlaneThroughPoint { platform, normal, base };
    let strut = |base, platform| Leg { base, platform, kind: Kind::PLAIN_STRUT };
    let level = |z| pose([0.0, 0.0, z, 0.0, 0.0, 0.0]);
    let around = spokes([90.0, 210.0, 330.0]);
    let tripod = around.map(|d| strut(along(d, 400.0), plus(along(d, 150.0), [0.0, 0.0, 40.0])));
    let square = ConstraintGeometry::Square { platform_axis: y, base_axis: x };
    let tricept = Parallel {
        constraints: vec![through(o, y, o), through(o, x, o), square],
        ..Parallel::new(tripod.to_vec(), "XYZ", level(-900.0))
    };
    let down = [0.0, 0.0, -1.0];
    let carriages = around.map(|d| slider(along(d, 320.0), along(d, 200.0), down, 500.0, -1));
    let planes = around.map(|d| {
        let normal = cross(UP, d);
        ConstraintGeometry::PointInPlane { platform: along(d, 200.0), base: o, normal }
    });
    let head = Parallel {
        table: "XY",
        constraints: planes.to_vec(),
        ..Parallel::new(carriages.to_vec(), "ZAB", level(-700.0))
    };
    let pair = [([-350.0, 0.0, 0.0], [-150.0, 0.0, 0.0]), ([350.0, 0.0, 0.0], [150.0, 0.0, 0.0])];
    let third = ([0.0, 450.0, 0.0], [0.0, 160.0, 0.0]);
    let of_pair = pair.map(|(base, platform)| through(platform, y, base));
    let legs = pair.into_iter().chain([third]).map(|(base, platform)| strut(base, platform));
    let exechon = Parallel {
        constraints: of_pair.into_iter().chain([square, through(third.1, x, third.0)]).collect(),
        ..Parallel::new(legs.collect(), "XYZ", level(-900.0))
    };
    vec![
        Subject::new("tricept", tricept, |random| {
            in_box(random, [0.0, 0.0, -900.0, 0.0, 0.0, 0.0], [350.0, 350.0, 150.0, 0.0, 0.0, 0.0])
        }),
        Subject::new("z3-head", head, |random| {
            in_box(random, [0.0, 0.0, -700.0, 0.0, 0.0, 0.0], [200.0, 200.0, 60.0, 30.0, 30.0, 0.0])
        }),
        Subject::new("exechon", exechon, |random| {
            in_box(random, [0.0, 0.0, -900.0, 0.0, 0.0, 0.0], [250.0, 250.0, 150.0, 0.0, 0.0, 0.0])
        }),
    ]
}

/// Returns three struts to one point, with the base joints of LinuxCNC's tripodkins.
pub fn three_struts(bx: f64, cx: f64, cy: f64, home: Pose) -> Parallel {
    let leg = |base| Leg { base, platform: [0.0; 3], kind: Kind::PLAIN_STRUT };
    let legs = vec![leg([0.0; 3]), leg([bx, 0.0, 0.0]), leg([cx, cy, 0.0])];
    Parallel::new(legs, "XYZ", home)
}

pub fn tripod() -> Parallel {
    three_struts(10.0, 5.0, 7.071, pose([5.0, 1.768, 3.06, 0.0, 0.0, 0.0]))
}

fn tripod_pose(random: &mut Random) -> Pose {
    in_box(random, [5.0, 1.75, 3.25, 0.0, 0.0, 0.0], [1.5, 1.25, 0.75, 0.0, 0.0, 0.0])
}

/// Returns two struts with a lead, two carriages on vertical guides and two cranks with arms that
/// lean along their axes, at the anchors of paper 004's hexapod.
pub fn hybrid() -> Parallel {
    let mut machine = Parallel::from(paper_004());
    for (i, leg) in machine.legs.iter_mut().enumerate().skip(2) {
        leg.kind = if i < 4 {
            Kind::Slider { guide: [0.0, 0.0, -3.0], rod: 700.0, side: -1 }
        } else {
            crank_inwards(leg.base)
        };
    }
    machine
}

/// Returns a crank whose arm points inward and slightly along its axis.
fn crank_inwards(hip: Vector) -> Kind {
    let inwards = unit([-hip[0], -hip[1], 0.0]);
    let axis = cross(inwards, UP);
    let arm = plus(along(inwards, 200.0), along(axis, 30.0));
    Kind::Crank { axis: along(axis, 2.0), arm, rod: 900.0, side: 1 }
}

fn hybrid_pose(random: &mut Random) -> Pose {
    in_box(random, [0.0, 0.0, 250.0, 0.0, 0.0, 0.0], [60.0, 60.0, 80.0, 10.0, 10.0, 10.0])
}

/// Returns eight struts that move a platform along X Y A B C, over a table that moves along Z.
pub fn octopod() -> Parallel {
    let ring = |radius: f64, turn: f64, z: f64, i: usize| {
        let at = 45.0 * i as f64 + turn * if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let (s, c) = at.to_radians().sin_cos();
        [radius * c, radius * s, z]
    };
    let leg = |i: usize| Leg {
        base: ring(560.0, 12.0, 900.0, i),
        platform: ring(200.0, -12.0, 0.0, i),
        kind: Kind::PLAIN_STRUT,
    };
    let legs = (0..8).map(leg).collect();
    let home = pose([0.0, 0.0, 100.0, 0.0, 0.0, 0.0]);
    Parallel { table: "Z", centre: [0.0, 0.0, 50.0], ..Parallel::new(legs, "XYABC", home) }
}

fn octopod_pose(random: &mut Random) -> Pose {
    in_box(random, [0.0, 0.0, 100.0, 0.0, 0.0, 0.0], [80.0, 80.0, 90.0, 15.0, 15.0, 15.0])
}

/// Returns five struts to rings about the tool's axis, as in LinuxCNC's pentakins.
pub fn pentapod(base: [Vector; 5], rings: [[f64; 2]; 5]) -> Parallel {
    let leg = |i: usize| {
        let [radius, height] = rings[i];
        Leg { base: base[i], platform: [0.0, 0.0, height], kind: Kind::Ring { radius } }
    };
    Parallel::new((0..5).map(leg).collect(), "XYZAB", pose([0.0; 6]))
}

/// Base anchors of LinuxCNC's sample configuration sim/axis/pentapod, millimeters.
pub const PENTAPOD_BASE: [Vector; 5] = [
    [-418.0, 500.0, -140.0],
    [418.0, 500.0, -140.0],
    [0.0, 500.0, -310.0],
    [418.0, 500.0, 510.0],
    [-418.0, 500.0, 510.0],
];

/// Radius and height of its rings.
pub const PENTAPOD_RINGS: [[f64; 2]; 5] =
    [[80.3, 87.0], [80.3, 114.5], [80.3, 140.5], [80.3, 232.5], [80.3, 258.5]];

/// Returns LinuxCNC's sample pentapod; dimensions of configs/pentapod. A pose of zeros freezes nothing: LinuxCNC
/// uses it before homing.
pub fn sample_pentapod() -> Parallel {
    let home = Some(pose([0.0, 0.0, 10.0, 0.0, 0.0, 0.0]));
    Parallel { home, ..pentapod(PENTAPOD_BASE, PENTAPOD_RINGS) }
}

pub fn pentapod_pose(random: &mut Random) -> Pose {
    in_box(random, [0.0; 6], [80.0, 80.0, 80.0, 12.0, 10.0, 0.0])
}

/// Returns three struts on rings, two plain ones and a carriage at the anchors of paper 004's hexapod.
pub fn ringed() -> Parallel {
    let mut machine = Parallel::from(paper_004());
    for (i, leg) in machine.legs.iter_mut().enumerate() {
        leg.kind = match i {
            0 | 2 | 4 => Kind::Ring { radius: 60.0 },
            1 | 3 => Kind::PLAIN_STRUT,
            _ => Kind::Slider { guide: [0.0, 0.0, -3.0], rod: 700.0, side: -1 },
        };
        if let Kind::Ring { .. } = leg.kind {
            leg.platform = [0.0, 0.0, 20.0 * i as f64];
        }
    }
    machine
}

fn ringed_pose(random: &mut Random) -> Pose {
    in_box(random, [0.0, 0.0, 250.0, 0.0, 0.0, 0.0], [40.0, 40.0, 60.0, 8.0, 8.0, 8.0])
}
