// SPDX-License-Identifier: GPL-2.0-or-later
//! The scene from a viewer's view: only JSON, and two rigid formulas.

use kinematics::{Matrix3, Pose, Vector3};
use machine::proof::axis_box::range;
use machine::read::ini::Ini;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use nalgebra::{Rotation3, Unit};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::Value;
use std::process::Command;
use studies::study::rods::View;
use test_support::shipped::{MACHINES, config, ini, whole};

/// Some roundings of lengths of 1e3.
const LENGTH: f64 = 1e-9;

pub fn scene(file: &std::path::Path, options: &[&str]) -> Value {
    let out = Command::new(env!("CARGO_BIN_EXE_pkm"))
        .arg("scene")
        .arg(file)
        .args(options)
        .output()
        .unwrap();
    assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).unwrap()
}

fn vector(of: &Value) -> Vector3<f64> {
    Vector3::from_fn(|k, _| of[k].as_f64().unwrap())
}

/// Returns the lower end of a leg at a joint value.
pub fn lower(leg: &Value, joint: f64) -> Vector3<f64> {
    let (base, q) = (vector(&leg["base"]), joint + leg["offset"].as_f64().unwrap());
    match leg["kind"].as_str().unwrap() {
        "strut" | "ring" => base,
        "slider" => base + vector(&leg["guide"]) * q,
        "crank" => {
            let axis = Unit::new_unchecked(vector(&leg["axis"]));
            base + Rotation3::from_axis_angle(&axis, q.to_radians()) * vector(&leg["arm"])
        }
        other => panic!("{other}"),
    }
}

/// Returns the upper end of a leg whose lower end is known.
fn upper(
    scene: &Value,
    leg: &Value,
    [t, o, low]: [&Vector3<f64>; 3],
    r: &Matrix3<f64>,
) -> Vector3<f64> {
    let centre = vector(&scene["centre"]);
    let moved = scene["coordinates"].as_str().unwrap();
    let mut p = t - o + r * (o + centre);
    for (k, letter) in ["X", "Y", "Z"].into_iter().enumerate() {
        p[k] = if moved.contains(letter) { p[k] } else { 0.0 };
    }
    let end = p + r * (vector(&leg["platform"]) - centre);
    match leg["radius"].as_f64() {
        None => end,
        Some(radius) => {
            let axis = r.column(2);
            let outward = low - end;
            end + (outward - axis * axis.dot(&outward)).normalize() * radius
        }
    }
}

fn compare(config: &Mechanism, scene: &Value, rng: &mut Pcg64) {
    let whole = range(config);
    let view = View::new(config, vec![], 0.0);
    let legs = scene["legs"].as_array().unwrap();
    let mut reached = 0;
    for _ in 0..200 {
        let pose = Pose::from_degrees(whole.at(std::array::from_fn(|_| rng.random())));
        let spindle = Vector3::z() * scene["spindle_offset"].as_f64().unwrap();
        let tool =
            spindle + Vector3::from_fn(|_, _| rng.random_range(-20.0..20.0) * config.units_per_mm);
        let (Ok(joints), Ok(rods)) = (config.machine.inverse(&pose, &tool), view.at(&pose, &tool))
        else {
            continue;
        };
        for (i, (leg, rod)) in legs.iter().zip(&rods.rods).enumerate() {
            let low = lower(leg, joints[i]);
            let high = upper(scene, leg, [&pose.position, &tool, &low], &pose.rotation());
            let apart = [low - rod.ends.base, high - rod.ends.platform].map(|v| v.norm());
            assert!(apart.iter().all(|a| *a < LENGTH), "{}: leg {i} {apart:?}", scene["machine"]);
        }
        reached += 1;
    }
    assert!(reached > 100, "{}: {reached}", scene["machine"]);
}

#[test]
fn both_ends_of_every_leg_follow_from_the_scene_the_joints_and_the_pose() {
    let mut rng = Pcg64::seed_from_u64(20);
    for machine in MACHINES {
        for (n, mechanism) in whole(machine).mechanisms.iter().enumerate() {
            let number = (n + 1).to_string();
            compare(mechanism, &scene(&ini(machine), &["--mechanism", &number]), &mut rng);
        }
    }
}

#[test]
fn a_scene_contains_unit_hash_letters_home_and_limits_of_its_file() {
    let (lathe, tripod) = (scene(&ini("lathe-counter-spindle"), &[]), scene(&ini("tripod"), &[]));
    assert_eq!(
        (&lathe["version"], &lathe["machine"]),
        (&1.into(), &"lathe-counter-spindle".into())
    );
    assert_eq!([&lathe["coordinates"], &lathe["extra"], &lathe["table"]], ["XYZB", "CW", ""]);
    assert_eq!([&lathe["length_unit"], &tripod["length_unit"]], ["mm", "inch"]);
    assert_eq!(lathe["extra_axes"][1]["letter"], "W");
    assert_eq!(lathe["extra_axes"][1]["joint"], 5);
    assert_eq!(lathe["extra_axes"][1]["home"], 800.0);
    assert_eq!(lathe["geometry_hash"], config("lathe-counter-spindle").geometry.hash());
    assert_eq!(lathe["home"]["pose"], serde_json::json!([0.0, 450.0, 1000.0, 0.0, 0.0, 0.0]));
    assert_eq!((lathe["clearance"].as_f64(), lathe["tilt_limit"].as_f64()), (Some(50.0), None));
    let kinds: Vec<_> = lathe["joints"].as_array().unwrap().iter().map(|j| &j["kind"]).collect();
    assert_eq!(kinds, ["carriage"; 4]);
    assert_eq!(lathe["joints"][3]["max"], 2100.0);
    assert_eq!([&lathe["pins"], &tripod["pins"]], ["pkmkins."; 2]);
    let table = scene(&ini("hexapod-rotary-table"), &[]);
    assert_eq!(table["geometry_hash"], config("hexapod-rotary-table").hash);
    let sees_tool = |machine: &str| scene(&ini(machine), &[])["sees_tool"].as_bool().unwrap();
    assert!(sees_tool("hexapod-rotary-table") && !sees_tool("lathe-two-turrets"));
    assert_eq!([&table["is_carried"], &lathe["is_carried"]], [true, false]);
    assert_eq!(lathe["axes"][3], serde_json::json!({"letter": "B", "min": -20.0, "max": 20.0}));
}

#[test]
fn a_scene_names_the_files_with_shapes_and_a_line_that_says_no_shape_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hexapod.ini");
    let text = std::fs::read_to_string(ini("hexapod")).unwrap();
    let write = |lines: &str| {
        std::fs::write(&file, text.replacen("[PKM]\n", &format!("[PKM]\n{lines}\n"), 1)).unwrap();
    };
    write("TABLE_MODEL = shapes/table.stl cm 1 2 -3");
    let found = &scene(&file, &[])["meshes"][0];
    let path = folder.path().join("shapes/table.stl");
    assert_eq!(found["file"], path.to_str().unwrap());
    assert_eq!([&found["part"], &found["unit"]], ["table", "cm"]);
    assert_eq!(found["scale"], 10.0);
    assert_eq!(found["place"], serde_json::json!([1.0, 2.0, -3.0, 0.0, 0.0, 0.0]));
    for wrong in
        ["a.stl", "a.step mm", "a.stl ft", "a.stl mm 1", "a.stl mm 1 2 3 4", "a.stl mm 1 2 nan"]
    {
        write(&format!("TABLE_MODEL = {wrong}"));
        let refused = MachineConfig::read(&file).unwrap_err().to_string();
        assert!(
            refused.contains("TABLE_MODEL") && refused.contains("FILE UNIT"),
            "{wrong}: {refused}"
        );
    }
}

#[test]
fn the_scene_of_a_second_mechanism_names_its_own_joints_and_pins() {
    let second = scene(&ini("lathe-mirrored"), &["--mechanism", "2"]);
    let numbers: Vec<_> = (0..4).map(|n| second["joints"][n]["number"].as_u64().unwrap()).collect();
    assert_eq!((numbers, &second["pins"]), (vec![4, 5, 6, 7], &"pkmkins.second.".into()));
    assert_ne!(second["geometry_hash"], scene(&ini("lathe-mirrored"), &[])["geometry_hash"]);
}

#[test]
fn a_scene_of_no_machine_or_to_no_place_is_refused_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("none/scene.json");
    let run = |file: &std::path::Path| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_pkm"));
        let out = command.arg("scene").arg(file).arg("-o").arg(&place).output().unwrap();
        (out.status.code(), String::from_utf8_lossy(&out.stderr).into_owned())
    };
    let (code, reported) = run(&ini("tripod"));
    assert!(code == Some(2) && reported.contains("none/scene.json"), "{reported}");
    let broken = folder.path().join("broken.ini");
    let text = Ini::read(&ini("tripod")).map(|_| std::fs::read_to_string(ini("tripod")).unwrap());
    std::fs::write(&broken, text.unwrap().replace("legs=strut:3", "legs=strut:4")).unwrap();
    let (code, reported) = run(&broken);
    assert!(code == Some(2) && reported.contains("broken.ini"), "{reported}");
    assert!(!place.exists());
}

/// Returns the position of a carried point at a value of an axis of the chain.
fn out(link: &Value, value: f64, point: Vector3<f64>) -> Vector3<f64> {
    let (axis, on) = (vector(&link["axis"]), vector(&link["point"]));
    match link["is_rotary"].as_bool().unwrap() {
        false => point + axis * value,
        true => {
            let turn = Rotation3::from_axis_angle(&Unit::new_unchecked(axis), value.to_radians());
            on + turn * (point - on)
        }
    }
}

/// Returns the position of a point after all axes with the same load.
fn carried(scene: &Value, carries: &str, world: &[f64; 9], point: Vector3<f64>) -> Vector3<f64> {
    let links = scene["chain"].as_array().unwrap().iter().filter(|link| link["carries"] == carries);
    links.rev().fold(point, |point, link| {
        let letter = link["letter"].as_str().unwrap();
        out(link, world["XYZABCUVW".find(letter).unwrap()], point)
    })
}

#[test]
fn tool_tip_and_work_of_a_machine_whose_axes_carry_follow_from_the_scene() {
    let mut rng = Pcg64::seed_from_u64(21);
    let mut seen = 0;
    for machine in MACHINES {
        let config = config(machine);
        if config.chain.is_empty() {
            continue;
        }
        let scene = scene(&ini(machine), &[]);
        let (mut questions, mut tips) = (String::new(), vec![]);
        for _ in 0..100 {
            let mut pose: [f64; 6] = config.start;
            for (k, axis) in config.programmed.iter().enumerate().filter(|(_, a)| a.min.is_finite())
            {
                pose[k] = rng.random_range(axis.min..axis.max);
            }
            let extra = std::array::from_fn(|n| match config.extra.get(n) {
                Some(_) => rng.random_range(-180.0..180.0),
                None => 0.0,
            });
            let tool = Vector3::from_fn(|_, _| rng.random_range(-50.0..50.0));
            let world = config.world(&pose, &extra);
            let platform = Pose::from_degrees(config.carried(&pose, &extra, &tool).unwrap());
            // The programmed tip, on the workpiece.
            let reported = Vector3::from_fn(|k, _| world[k]) - tool;
            let held = carried(&scene, "tool", &world, -tool);
            let on_platform = |point| {
                let place = match scene["sees_tool"].as_bool().unwrap() {
                    true => platform.position - tool + platform.rotation() * (tool + point),
                    false => platform.position + platform.rotation() * point,
                };
                carried(&scene, "legs", &world, place)
            };
            let worked = carried(&scene, "work", &world, reported);
            let (tip, work) = match scene["holder"].is_null() {
                true => (on_platform(held), worked),
                false => (vector(&scene["holder"]) + held, on_platform(worked)),
            };
            assert!((tip - work).norm() < LENGTH, "{machine}: {tip} {work}");
            seen += 1;
            let values: serde_json::Map<_, _> =
                "XYZABCUVW".chars().zip(world).map(|(l, v)| (l.to_string(), v.into())).collect();
            let question = serde_json::json!({
                "joints": config.joints.iter().map(|joint| joint.home).collect::<Vec<_>>(),
                "pose": platform.to_degrees(),
                "tool": <[f64; 3]>::from(tool),
                "values": values,
                "of_work": <[f64; 3]>::from(reported),
            });
            questions.push_str(&format!("{question}\n"));
            tips.push(tip);
        }
        for (tip, line) in tips.iter().zip(placed(&scene, &questions)) {
            let apart = [0, 1].map(|n| (vector(&line[n]) - tip).norm());
            assert!(apart.iter().all(|a| *a < LENGTH), "{machine}: the viewer {apart:?}");
        }
    }
    assert!(seen >= 300, "{seen}");
}

/// Returns the viewer's result for the same input.
fn placed(scene: &Value, questions: &str) -> Vec<Value> {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("scene.json");
    std::fs::write(&file, scene.to_string()).unwrap();
    let input = place.path().join("questions");
    std::fs::write(&input, questions).unwrap();
    let program =
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/viewer/placed.py");
    let out = Command::new("python3")
        .arg(program)
        .arg(file)
        .stdin(std::fs::File::open(input).unwrap())
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let text = String::from_utf8(out.stdout).unwrap();
    let lines: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), questions.lines().count());
    lines
}
