// SPDX-License-Identifier: GPL-2.0-or-later
//! Models of all shipped machines: their loops are closed at any pose, by joints in series alone.

use export::assemble::model;
use export::folder::{Format, write};
use export::model::{LoopKind, Model, Motion, Role};
use export::state::States;
use kinematics::{Matrix3, POSE_LETTERS, Vector3, World};
use machine::read::ini::Ini;
use machine::read::machine::{Lenient, MachineConfig};
use machine::rows;
use nalgebra::{DMatrix, DVector, Rotation3, Unit};
use std::fs;
use std::path::Path;
use studies::cut::moment::Moment;
use studies::dynamics::loads::{Wrench, loads};
use studies::dynamics::model::Model as Dynamics;
use studies::study::file::Study;
use test_support::drawn_constraints;
use test_support::generated::{ALL, generated};
use test_support::shipped::{CONSTRAINED, MACHINES, ini, whole};

/// Rounding of lengths of up to 3 m in a chain of ten joints.
const ROUNDING: f64 = 1e-13;

/// Motion of a body since home.
#[derive(Clone, Copy)]
struct Moved(Matrix3<f64>, Vector3<f64>);

impl Moved {
    fn point(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.0 * point + self.1
    }

    /// Returns a point as the body sees it.
    fn seen(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.0.tr_mul(&(point - self.1))
    }
}

/// Returns the motion of each body by its joints and those of its parents.
fn moved(model: &Model, values: &[f64]) -> Vec<Moved> {
    let mut values = values.iter();
    let mut all: Vec<Moved> = vec![];
    for body in &model.bodies {
        let still = Moved(Matrix3::identity(), Vector3::zeros());
        let mut now = body.parent.map_or(still, |parent| all[parent]);
        for joint in &body.joints {
            let by = values.next().expect("a value for each joint") - joint.home;
            now = match joint.motion {
                Motion::Slide => Moved(now.0, now.1 + now.0 * joint.axis * by),
                Motion::Hinge => {
                    let axis = Unit::new_unchecked(joint.axis);
                    let turn = now.0 * Rotation3::from_axis_angle(&axis, by).matrix();
                    Moved(turn, now.point(&joint.point) - turn * joint.point)
                }
            };
        }
        all.push(now);
    }
    assert!(values.next().is_none());
    all
}

/// Returns the largest distance, in meters or radians, between both sides of a loop.
fn gap(model: &Model, values: &[f64]) -> f64 {
    let moved = moved(model, values);
    let gaps = model.loops.iter().map(|one| {
        let [a, b] = one.bodies.map(|body| moved[body]);
        let apart = (a.point(&one.point) - b.point(&one.point)).norm();
        match one.kind {
            LoopKind::Ball => apart,
            LoopKind::Rigid => apart.max((a.0 - b.0).norm()),
        }
    });
    gaps.fold(0.0, f64::max)
}

/// Returns a pose of a shipped machine beside home.
fn beside(config: &MachineConfig, n: usize) -> World {
    let mut world = config.world_home;
    for (letter, _) in config.words(&world) {
        let place = POSE_LETTERS.iter().position(|known| *known == letter).expect("a letter");
        // Small enough for every machine: 1 % of its size, or 2 degrees.
        let step = if (3..6).contains(&place) { 2.0 } else { 0.01 * config.first().machine.size() };
        world[place] += step * (1.7 * place as f64 + 2.3 * n as f64).sin();
    }
    world
}

/// Checks the loops of a machine at home and at these poses.
fn check(config: &MachineConfig, worlds: &[World]) {
    let file = config.file.display();
    let model = model(config, None).expect("a model");
    let states = States::new(config, &model).expect("home");
    let home: Vec<f64> = model.joints().map(|(_, joint)| joint.home).collect();
    assert!(gap(&model, &home) < ROUNDING, "{file}");
    let legs: usize = config.mechanisms.iter().map(|one| one.legs()).sum();
    let constraints = config.first().geometry.constraints().len();
    assert_eq!(model.loops.len(), legs + constraints, "{file}");
    let driven = model.joints().filter(|(_, joint)| matches!(joint.role, Role::Driven(_))).count();
    let carrying = config.first().chain.links().len();
    assert_eq!(driven, config.guarded_joints() + carrying, "{file}");
    for world in worlds {
        let values = states.values(world, &Vector3::zeros()).expect("a pose in reach");
        let off = gap(&model, &values);
        assert!(off < ROUNDING, "{file}: {off:e}");
        let moved = values.iter().zip(&home).any(|(value, home)| (value - home).abs() > 1e-4);
        assert!(moved, "{file}");
    }
}

#[test]
fn every_loop_of_the_shipped_machines_is_closed_at_every_pose() {
    for machine in MACHINES.into_iter().chain(CONSTRAINED) {
        let config = whole(machine);
        let worlds: Vec<World> = (0..5).map(|n| beside(&config, n)).collect();
        check(&config, &worlds);
    }
}

#[test]
fn every_loop_of_random_machines_is_closed_at_every_pose() {
    for seed in ALL {
        let mut drawn = generated(seed);
        let folder = tempfile::tempdir().expect("a folder");
        let config = MachineConfig::read(&drawn.write(folder.path())).expect("a machine");
        let mut worlds: Vec<World> = (0..20).map(|_| drawn.world(0.9)).collect();
        worlds.retain(|world| drawn.joints(world, &drawn.tools(0)).is_some());
        assert!(worlds.len() > 5, "{}", drawn.name);
        check(&config, &worlds);
    }
}

#[test]
fn every_loop_of_random_machines_with_constraints_is_closed_at_every_pose() {
    for seed in drawn_constraints::ALL {
        let folder = tempfile::tempdir().expect("a folder");
        let file = drawn_constraints::write(seed, folder.path());
        let config = constrained(&file);
        let at_home =
            config.first().machine.full_pose(&config.first().home_pose(), &Vector3::zeros());
        let turned = at_home.expect("home").rotation() - Matrix3::identity();
        assert!(turned.norm() > 0.01, "{seed}: level");
        let worlds: Vec<World> = (0..20).map(|n| beside(&config, n)).collect();
        check(&config, &worlds);
    }
}

fn constrained(file: &Path) -> MachineConfig {
    let ini = Ini::read(file).expect("an INI file");
    MachineConfig::leniently(&ini, Some(Lenient::Constraints)).expect("a machine")
}

#[test]
fn a_loop_opens_where_a_drive_moves_alone() {
    let config = MachineConfig::read(&hexapod()).expect("the hexapod");
    let model = model(&config, None).expect("a model");
    let mut values: Vec<f64> = model.joints().map(|(_, joint)| joint.home).collect();
    let place = model.joints().position(|(_, joint)| joint.name == "joint_3").expect("a joint");
    values[place] += 1e-6;
    assert!((gap(&model, &values) - 1e-6).abs() < ROUNDING);
}

fn hexapod() -> std::path::PathBuf {
    ini("hexapod")
}

/// Returns the hexapod with lines added to its section [PKM].
fn with(lines: &str, folder: &Path, name: &str) -> MachineConfig {
    let text =
        fs::read_to_string(hexapod()).expect("text").replace("[PKM]\n", &format!("[PKM]\n{lines}"));
    let file = folder.join(name);
    fs::write(&file, text).expect("written");
    MachineConfig::from_ini(&Ini::read(&file).expect("an INI file")).expect("a machine")
}

#[test]
fn masses_are_those_of_the_study() {
    let config = MachineConfig::read(&hexapod()).expect("the hexapod");
    let study = Study::read(&hexapod().with_file_name("dynamics.toml")).expect("a study");
    let model = model(&config, Some(&study)).expect("a model");
    let platform = model.bodies.iter().find(|body| body.name == "platform").expect("a platform");
    let mass = platform.mass.expect("a mass");
    assert_eq!(mass.mass, 25.0);
    // Two roundings of lengths below 1 m.
    assert!((mass.centre - platform.origin - Vector3::new(0.006, -0.004, 0.12)).norm() < 1e-15);
    assert_eq!(mass.inertia[(0, 1)], 0.02);
    let most = model.joints().find_map(|(_, joint)| match &joint.role {
        Role::Driven(drive) => drive.max_force,
        _ => None,
    });
    assert_eq!(most, Some(2000.0));
}

/// Values of the drives, positions of the center of mass of the platform and of the tool tip, in SI units, and the
/// platform's rotation since home.
struct Position {
    drives: DVector<f64>,
    mass: Vector3<f64>,
    tip: Vector3<f64>,
    rotation: Matrix3<f64>,
}

impl Position {
    /// Returns the small rotation from another position, as a vector.
    fn turned(&self, from: &Self) -> Vector3<f64> {
        let turn = self.rotation * from.rotation.transpose();
        Rotation3::from_matrix_unchecked(turn).scaled_axis()
    }
}

#[test]
fn drives_carry_inertia_weight_and_a_force_on_the_tool_as_pkm_dynamics_and_pkm_cut_say() {
    let study = Study::read(&hexapod().with_file_name("dynamics.toml")).expect("a study");
    compare_forces(&MachineConfig::read(&hexapod()).expect("the hexapod"), &study);
    let text = "[platform]\nmass_kg = 25\ncentre_mm = [6, -4, 120]\n\
                inertia_kg_m2 = [[0.45, 0, 0], [0, 0.5, 0.02], [0, 0.02, 0.6]]\n\
                [legs]\nstiffness_n_per_um = 10\ndamping_n_s_per_mm = 0.8\n\
                [table]\nstiffness_n_per_um = 50\nmass_kg = 80\ndamping_ratio = 0.02\n";
    let study = Study::parse(text).expect("a study");
    for machine in CONSTRAINED {
        compare_forces(&whole(machine), &study);
    }
    for seed in drawn_constraints::ALL {
        compare_forces(&drawn_constraints::config(seed).into(), &study);
    }
}

/// A moment without a cut.
const MOMENT: Moment = Moment {
    line: 0,
    at: 0.0,
    programmed: [0.0; 6],
    poses: [[0.0; 6]; 3],
    tool: Vector3::new(0.0, 0.0, 0.0),
    rotation: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    speed: 0.0,
    feed: Vector3::new(0.0, 0.0, 0.0),
    rpm: None,
};

/// Compares the forces of the drives in motion with virtual work in the model.
fn compare_forces(config: &MachineConfig, study: &Study) {
    let model = model(config, Some(study)).expect("a model");
    let states = States::new(config, &model).expect("home");
    let letters = rows::moved(config.first());
    let platform = model.bodies.iter().position(|body| body.name == "platform").expect("a body");
    let mass = model.bodies[platform].mass.expect("a mass");
    let site = |name| model.sites.iter().find(|site| site.name == name).expect("a site");
    let (tool, work) = (site("tool"), site("work"));
    let at = |world: &World| {
        let values = states.values(world, &Vector3::zeros()).expect("a pose in reach");
        let moved = moved(&model, &values);
        let driven = model.joints().zip(&values);
        let driven = driven.filter(|((_, joint), _)| matches!(joint.role, Role::Driven(_)));
        Position {
            drives: DVector::from_iterator(letters.len(), driven.map(|(_, value)| *value)),
            mass: moved[platform].point(&mass.centre),
            // On the work, which a table moves.
            tip: moved[work.body].seen(&moved[tool.body].point(&tool.place)),
            rotation: moved[platform].0,
        }
    };
    // N; the legs of these studies have no mass.
    let force = Vector3::new(120.0, -80.0, 300.0);
    let weight = Vector3::new(0.0, 0.0, -9.80665 * mass.mass);
    let dynamics = Dynamics::of(config.first(), study).expect("a whole study");
    let mut drive_masses: Vec<f64> = vec![0.0; config.first().legs()];
    drive_masses.extend(dynamics.table.iter().map(|axis| axis.mass * 1e3));
    for n in 0..5 {
        let world = beside(config, n);
        // At rest, or with speeds of up to 80 mm/s and 8 degrees/s, and accelerations ten times as large.
        let path = [-1.0, 0.0, 1.0].map(|side| {
            let (mut world, time) = (world, side * config.period);
            for letter in &letters {
                let k = letter.index();
                let speed = match k {
                    _ if n == 0 => 0.0,
                    0..3 => 80.0,
                    _ => 8.0,
                };
                let [rate, change] = [1.3, 2.1].map(|by| speed * (by * (k + 3 * n) as f64).sin());
                world[k] += rate * time + 10.0 * change * time * time / 2.0;
            }
            world
        });
        let [before, now, after] = path.map(|world| at(&world));
        let square = config.period * config.period;
        let linear = (after.mass - now.mass * 2.0 + before.mass) / square;
        let joints = (&after.drives - &now.drives * 2.0 + &before.drives) / square;
        // Angular momentum in the middle of each half.
        let momentum = |from: &Position, to: &Position| {
            let turn = to.turned(from);
            let middle = Rotation3::new(turn / 2.0).matrix() * from.rotation;
            middle * mass.inertia * middle.transpose() * turn / config.period
        };
        let moment = (momentum(&now, &after) - momentum(&before, &now)) / config.period;
        // Virtual work: drives, weight, inertia and force do none in any motion of the platform.
        let count = letters.len();
        let (mut speeds, mut work) = (DMatrix::zeros(count, count), DVector::zeros(count));
        // Central differences: an error of STEP², and rounding divided by STEP.
        const STEP: f64 = 1e-3;
        for (k, letter) in letters.iter().enumerate() {
            let [before, after] = [-STEP, STEP].map(|step| {
                let mut world = world;
                world[letter.index()] += step;
                at(&world)
            });
            speeds.set_row(k, &(&after.drives - &before.drives).transpose());
            work[k] = (weight - linear * mass.mass).dot(&(after.mass - before.mass))
                + force.dot(&(after.tip - before.tip))
                - moment.dot(&after.turned(&before));
            for (i, mass) in drive_masses.iter().enumerate() {
                work[k] -= mass * joints[i] * (after.drives[i] - before.drives[i]);
            }
        }
        let expected = speeds.lu().solve(&-work).expect("no singular pose");
        let poses = path.map(|world| std::array::from_fn(|k| world[k]));
        let moving = Moment { poses, tool: config.first().spindle, ..MOMENT };
        let moving = moving.moving(config.first()).expect("in reach");
        let wrench = Wrench { force, moment: Vector3::zeros() };
        let found = loads(config.first(), &dynamics, &moving, &wrench).expect("in reach");
        let found = DVector::from_vec(found.expect("no singular pose").drives);
        // Differences over a servo cycle of 1 ms while speeds change at 10/s: (1e-3 * 10)² over 12, here and there.
        let file = config.file.display();
        assert!((&found - &expected).norm() < 1e-5 * expected.norm(), "{file} {found} {expected}");
    }
}

#[test]
fn a_folder_with_another_model_stays_as_it_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let into = folder.path().join("model");
    let [first, second] = ["one.ini", "two.ini"].map(|name| with("", folder.path(), name));
    let write_one = |config: &MachineConfig, format| {
        write(&model(config, None).expect("a model"), config, format, &into)
    };
    for format in [Format::Mjcf, Format::Urdf, Format::Sdf, Format::Mjcf] {
        write_one(&first, format).expect("its own folder");
    }
    let before = fs::read(into.join("one.xml")).expect("a model");
    let refused = write_one(&second, Format::Mjcf).expect_err("another model").to_string();
    // Whichever file the system lists first.
    assert!(
        refused.ends_with(", which is not a file of this model; give another folder"),
        "{refused}"
    );
    assert_eq!(fs::read(into.join("one.xml")).expect("a model"), before);
    assert!(!into.join("two.xml").exists());
}

#[test]
fn shapes_are_copied_and_a_missing_one_writes_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let config =
        with("PLATFORM_MODEL = part.stl mm\nBASE_MODEL = text.stl mm\n", folder.path(), "m.ini");
    let into = folder.path().join("model");
    let model = model(&config, None).expect("a model");
    let missing = write(&model, &config, Format::Mjcf, &into).expect_err("no file").to_string();
    assert!(missing.contains("text.stl") && missing.contains("remove it"), "{missing}");
    assert!(!into.exists());
    // A binary file without triangles, and a file in text form without any.
    fs::write(folder.path().join("part.stl"), [0; 84]).expect("written");
    fs::write(folder.path().join("text.stl"), "solid a\nendsolid a\n").expect("written");
    let written = write(&model, &config, Format::Mjcf, &into).expect("written");
    assert!(written.files.contains(&into.join("meshes/platform.stl")));
    assert_eq!(written.left_out.len(), 1);
    assert!(!into.join("meshes/base.stl").exists());
    let readme = fs::read_to_string(into.join("README.md")).expect("a README");
    assert!(readme.contains("text.stl: neither a binary STL file nor triangles"), "{readme}");
    write(&model, &config, Format::Urdf, &into).expect("written");
    assert!(into.join("meshes/base.stl").exists());
    let text = "solid a\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n\
                endfacet\nendsolid a\n";
    fs::write(folder.path().join("text.stl"), text).expect("written");
    let written = write(&model, &config, Format::Mjcf, &into).expect("written");
    assert_eq!(written.left_out, [""; 0]);
    assert_eq!(fs::read(into.join("meshes/base.stl")).expect("a shape").len(), 84 + 50);
}

#[test]
fn names_become_identifiers() {
    let folder = tempfile::tempdir().expect("a folder");
    for (file, name) in [
        ("my machine (2).ini", "my_machine__2_"),
        ("6-axis.ini", "machine_6-axis"),
        ("scene.ini", "machine_scene"),
        ("станок.ini", "machine_______"),
    ] {
        let config = with("", folder.path(), file);
        let model = model(&config, None).expect("a model");
        assert_eq!(model.name, name);
        assert!(model.left_out.iter().any(|left| left.ends_with(&format!("the model is {name}"))));
    }
}
