// SPDX-License-Identifier: GPL-2.0-or-later
//! Migrated configurations compared with the LinuxCNC modules that they were for: joint values are equal.
//!
//! LinuxCNC's five samples, and eight layouts in `tests/cases/older`. The modules' pin values are repeated here, not
//! read from the HAL files.

use abi_tests::module::{Module, Pose};
use abi_tests::random::Random;
use abi_tests::subjects::{PENTAPOD_BASE, PENTAPOD_RINGS};
use abi_tests::tolerances::MIGRATED_JOINT;
use machine::read::machine::MachineConfig;
use new::migrate::modules::PEERS;
use new::migrate::{Migration, migrate};
use std::path::{Path, PathBuf};

/// Number of poses of each machine.
const POSES: usize = 500;

/// Folder of the samples in LinuxCNC's package.
const SAMPLES: &str = "/usr/share/doc/linuxcnc/examples/sample-configs/sim";

fn own(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases/older").join(name)
}

/// Migrates a file and compares its joints with those of the module over all of its axis limits.
fn assert_same_joints(file: &Path, module: &'static str, pins: &[(String, f64)]) {
    let folder = tempfile::tempdir().unwrap();
    let made = folder.path().join("made");
    let migration = Migration { file, folder: Some(&made), home: None, geometry: None };
    let migrated = migrate(&migration, |_, _| ()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(migrated.module, module);
    let config = MachineConfig::read(&made.join(format!("{}.ini", migrated.name))).unwrap();
    let theirs = Module::of_linuxcnc(module);
    for (pin, value) in pins {
        theirs.set(pin, *value);
    }
    let config = config.first();
    let legs = config.legs();
    let mut random = Random::new(57);
    let mut worst = 0.0_f64;
    for _ in 0..POSES {
        let mut pose: Pose = [0.0; 9];
        for (value, axis) in pose.iter_mut().zip(&config.axes) {
            if axis.min.is_finite() {
                *value = random.between(axis.min, axis.max);
            }
        }
        let own = kinematics::Pose::from_degrees(std::array::from_fn(|k| pose[k]));
        let own = config.machine.inverse(&own, &config.spindle).unwrap();
        // The joint of an extra axis equals its coordinate, in the order of both.
        for (k, axis) in config.extra.iter().enumerate() {
            let place = "XYZABCUVW".find(axis.letter).unwrap();
            pose[place] = 1.5 + k as f64;
        }
        let their = theirs.inverse(&pose).unwrap();
        for n in 0..legs {
            worst = worst.max((own[n] - their[n]).abs());
        }
        for (k, joint) in their[legs..legs + config.extra.len()].iter().enumerate() {
            assert_eq!(*joint, 1.5 + k as f64, "{}: extra axis {k}", file.display());
        }
    }
    println!("{}: off by {worst:.1e}", file.display());
    assert!(worst <= MIGRATED_JOINT, "{}: off by {worst}", file.display());
}

fn named(pins: &[(&str, f64)]) -> Vec<(String, f64)> {
    pins.iter().map(|(name, value)| ((*name).into(), *value)).collect()
}

/// Returns the pins of vectors, one per leg.
fn vectors(name: &str, of_legs: &[[f64; 3]]) -> Vec<(String, f64)> {
    let of = |(n, vector): (usize, &[f64; 3])| {
        let vector = *vector;
        ["x", "y", "z"].into_iter().zip(vector).map(move |(axis, x)| (n, axis, x))
    };
    let all = of_legs.iter().enumerate().flat_map(of);
    all.map(|(n, axis, x)| (format!("{name}.{n}.{axis}"), x)).collect()
}

fn rings(of_legs: [[f64; 2]; 5]) -> Vec<(String, f64)> {
    let of = |(n, [r, z]): (usize, [f64; 2])| {
        [(format!("effector.{n}.r"), r), (format!("effector.{n}.z"), z)]
    };
    of_legs.into_iter().enumerate().flat_map(of).collect()
}

#[test]
fn the_samples_of_linuxcnc_keep_their_joints() {
    let sample = |name: &str| Path::new(SAMPLES).join(name);
    let delta = named(&[("R", 130.25), ("L", 269.0)]);
    assert_same_joints(&sample("axis/ldelta.ini"), "lineardeltakins", &delta);
    let rotary = named(&[
        ("platformradius", 10.0),
        ("thighlength", 10.0),
        ("shinlength", 18.0),
        ("footradius", 5.0),
    ]);
    assert_same_joints(&sample("axis/rdelta.ini"), "rotarydeltakins", &rotary);
    let tripod = named(&[("Bx", 10.0), ("Cx", 5.0), ("Cy", 7.071)]);
    assert_same_joints(&sample("tklinuxcnc/tripod.ini"), "tripodkins", &tripod);
    let penta = [vectors("base", &PENTAPOD_BASE), rings(PENTAPOD_RINGS)].concat();
    assert_same_joints(&sample("axis/pentapod/pentapod.ini"), "pentakins", &penta);
    // The module's defaults are those of its sample.
    assert_same_joints(&sample("axis/vismach/hexapod-sim/hexapod.ini"), "genhexkins", &[]);
}

#[test]
fn files_of_2_7_and_machinekit_keep_their_joints() {
    let delta = named(&[("R", 118.6), ("L", 242.3)]);
    assert_same_joints(&own("delta-27/delta.ini"), "lineardeltakins", &delta);
    let delta = named(&[("R", 106.0), ("L", 221.5)]);
    assert_same_joints(&own("machinekit-delta/rostock.ini"), "lineardeltakins", &delta);
    let tripod = named(&[("Bx", 420.5), ("Cx", 205.25), ("Cy", 380.0)]);
    assert_same_joints(&own("tripod-27/tripod.ini"), "tripodkins", &tripod);
    let base = [
        [9.292, -1.975, 0.25],
        [9.292, 1.975, 0.25],
        [-2.936, 9.035, 0.25],
        [-6.357, 7.06, 0.25],
        [-6.357, -7.06, 0.25],
        [-2.936, -9.035, 0.25],
    ];
    let platform = [
        [3.178, -3.53, -0.5],
        [3.178, 3.53, -0.5],
        [1.468, 4.518, -0.5],
        [-4.646, 0.988, -0.5],
        [-4.646, -0.988, -0.5],
        [1.468, -4.518, -0.5],
    ];
    let pins = [vectors("base", &base), vectors("platform", &platform)].concat();
    assert_same_joints(&own("hexapod-27/hexapod.ini"), "genhexkins", &pins);
}

#[test]
fn geometry_by_formulas_signals_and_screws_keeps_its_joints() {
    let rotary = named(&[
        ("platformradius", 130.0),
        ("thighlength", 180.0),
        ("shinlength", 330.0),
        ("footradius", 42.0),
    ]);
    assert_same_joints(&own("rotary-delta/picker.ini"), "rotarydeltakins", &rotary);
    let penta = [
        vectors(
            "base",
            &[
                [-402.0, 480.0, -150.0],
                [402.0, 480.0, -150.0],
                [10.0, 480.0, -322.0],
                [402.0, 480.0, 498.0],
                [-402.0, 480.0, 498.0],
            ],
        ),
        rings([[76.5, 84.0], [76.5, 112.0], [78.0, 138.0], [78.0, 229.0], [76.5, 256.0]]),
    ]
    .concat();
    assert_same_joints(&own("pentapod/wall.ini"), "pentakins", &penta);
    let circle = |radius: f64, half: f64, z: f64| -> [[f64; 3]; 6] {
        std::array::from_fn(|i| {
            let side = if i % 2 == 0 { -half } else { half };
            let (sin, cos) = (120.0 * (i / 2) as f64 + side).to_radians().sin_cos();
            [radius * cos, radius * sin, z]
        })
    };
    let circles = [
        vectors("base", &circle(420.0, 14.0, 35.5)),
        vectors("platform", &circle(165.0, 48.0, 0.0)),
    ];
    assert_same_joints(&own("hexapod-circles/circles.ini"), "genhexkins", &circles.concat());
    let axes = [
        [0.2508, -0.968, 0.0],
        [-0.2508, -0.968, 0.0],
        [0.7129, 0.7012, 0.0],
        [0.9638, 0.2668, 0.0],
        [-0.9638, 0.2668, 0.0],
        [-0.7129, 0.7012, 0.0],
    ];
    let base = [
        [10.7979, -2.0989, 0.0],
        [10.7979, 2.0989, 0.0],
        [-3.5812, 10.4007, 0.0],
        [-7.2166, 8.3018, 0.0],
        [-7.2166, -8.3018, 0.0],
        [-3.5812, -10.4007, 0.0],
    ];
    let platform = [
        [3.8891, -3.8891, 0.0],
        [3.8891, 3.8891, 0.0],
        [1.4235, 5.3126, 0.0],
        [-5.3126, 1.4235, 0.0],
        [-5.3126, -1.4235, 0.0],
        [1.4235, -5.3126, 0.0],
    ];
    let screws = [
        vectors("base", &base),
        vectors("platform", &platform),
        vectors("base-n", &axes),
        vectors("platform-n", &axes.map(|axis| axis.map(|x| -x))),
        named(&[("screw-lead", 0.4), ("spindle-offset", 1.25)]),
    ];
    assert_same_joints(&own("hexapod-screws/screws.ini"), "genhexkins", &screws.concat());
}

#[test]
fn a_pin_that_no_file_sets_has_the_value_of_its_module() {
    for peer in PEERS {
        let module = Module::of_linuxcnc(peer.name);
        for (pin, value) in (peer.defaults)() {
            assert_eq!(module.get(&pin), value, "{}.{pin}", peer.name);
        }
    }
}
