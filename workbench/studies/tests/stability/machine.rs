// SPDX-License-Identifier: GPL-2.0-or-later
//! The shipped hexapod: modes from its INI file and a study, and stability from both.

use super::example;
use kinematics::{Pose, Vector3};
use machine::read::mechanism::Mechanism;
use nalgebra::ComplexField;
use studies::stability::bands::{Loss, bands, first_limit};
use studies::stability::floquet::Period;
use studies::stability::lobes::Lobes;
use studies::stability::map::StableMap;
use studies::stability::path::{Path, Stop};
use studies::stability::pose::{NoModes, NoSetup, Setup};
use studies::stability::process::{Row, turned};
use studies::study::file::Study;
use test_support::shipped::config;
use test_support::stability::{close, golden, row, rows};

/// Two programs with 16 digits, with modes of a matrix whose condition number is 1e5.
const ZERO_ORDER: f64 = 1e-7;

/// Depths at which a multiplier with an error of 1e-8 passes 1.
const DEPTH: f64 = 1e-6;

const LEGS: &str = "[legs]\nstiffness_n_per_um = 10\ndamping_n_s_per_mm = 0.8\n\
                    screw = \"self-locking\"\n";

const PLATFORM: &str = "[platform]\nmass_kg = 25\ncentre_mm = [6, -4, 120]\ninertia_kg_m2 = \
                        [[0.46, 0.02, -0.01], [0.02, 0.43, 0.015], [-0.01, 0.015, 0.60]]\n";

const CUTTING: &str = "[cutting]\nteeth = 2\nentry_deg = 90\nexit_deg = 180\n\
                       kt_n_per_mm2 = 700\nkr_n_per_mm2 = 210\n";

fn study() -> Study {
    Study::parse(&[PLATFORM, LEGS, CUTTING].concat()).unwrap()
}

/// A tool that ends 100 mm below the control point.
const TOOL: Vector3<f64> = Vector3::new(0.0, 0.0, 100.0);

/// Returns the pose of the tip of that tool, with the platform where it is at `pose` without a tool.
fn with_tool(pose: [f64; 6]) -> Pose {
    let pose = Pose::from_degrees(pose);
    Pose { position: pose.position - pose.rotation() * TOOL + TOOL, ..pose }
}

const POSES: [(&str, [f64; 6]); 3] = [
    ("home", [0.0, 0.0, 250.0, 0.0, 0.0, 0.0]),
    ("pose_2", [100.0, -50.0, 150.0, 0.0, 0.0, 0.0]),
    ("pose_4", [-80.0, 60.0, 350.0, 10.0, -20.0, 0.0]),
];

/// Returns the rows at a pose, with the feed along the platform's X.
fn in_plane(setup: &Setup, pose: &Pose) -> Vec<Row> {
    setup.rows(pose, &TOOL, &pose.rotation().column(0).into_owned()).unwrap()
}

#[test]
fn limits_at_the_poses_of_the_shipped_hexapod_are_those_of_an_independent_calculation() {
    let (config, study) = (config("hexapod"), study());
    let setup = Setup::new(&config, &study).unwrap();
    for (name, pose) in POSES {
        let in_plane = in_plane(&setup, &with_tool(pose));
        let lobes = Lobes::new(&in_plane, &setup.process, 3000.0);
        let floor = row(golden("chatter", &format!("a_{name}_floor_mm_omega")));
        close(lobes.floor().unwrap().depth, floor[0], ZERO_ORDER);
        for expected in rows("chatter", &format!("a_{name}_rpm_zero_order_mm_omega_floquet_mm")) {
            close(lobes.limit(expected[0]).unwrap().depth, expected[1], ZERO_ORDER);
            let period = Period::new(&in_plane, &setup.process, expected[0]);
            close(first_limit(&period, 3.0 * expected[1]).unwrap(), expected[3], DEPTH);
        }
    }
    let in_plane = in_plane(&setup, &with_tool(POSES[2].1));
    let island = row(golden("chatter", "a_pose_4_6000rpm_island_mm"));
    let found = bands(&Period::new(&in_plane, &setup.process, 6000.0), 16.0);
    assert_eq!((found.len(), found[0].loss), (1, Loss::Doubling));
    close(found[0].low, island[0], DEPTH);
    close(found[0].high, island[1], DEPTH);
}

#[test]
fn the_map_of_speeds_shows_the_island_and_is_fine_where_it_changes() {
    let (config, study) = (config("hexapod"), study());
    let setup = Setup::new(&config, &study).unwrap();
    let in_plane = in_plane(&setup, &with_tool(POSES[2].1));
    let map = StableMap::new(&in_plane, &setup.process, [5000.0, 7000.0], 10.0, 9, |_| ());
    assert!(map.columns.windows(2).all(|pair| pair[0].rpm < pair[1].rpm));
    let steps: Vec<f64> = map.columns.windows(2).map(|pair| pair[1].rpm - pair[0].rpm).collect();
    let [finest, widest] = [f64::min, f64::max].map(|of| steps.iter().copied().reduce(of).unwrap());
    assert!(finest <= widest / 4.0 && widest <= 250.0, "{finest} {widest}");
    let at = map.columns.iter().find(|column| column.rpm == 6000.0).unwrap();
    assert_eq!(at.bands.len(), 1);
    close(at.bands[0].high, 7.238841616316026, DEPTH);
    let [best, worst] = [map.best(), map.worst()].map(|column| column.stable_to(map.most));
    assert!(map.columns.iter().all(|c| (worst..=best).contains(&c.stable_to(map.most))));
    assert!(worst < 2.3 && best > 3.0, "{worst} {best}");
    // No band is missing between two columns: checked at the middle of each pair without bands.
    for pair in map.columns.windows(2).filter(|pair| pair[0].bands.is_empty()) {
        if pair[1].bands.is_empty() {
            let rpm = (pair[0].rpm + pair[1].rpm) / 2.0;
            assert_eq!(bands(&Period::new(&in_plane, &setup.process, rpm), 10.0), []);
        }
    }
}

#[test]
fn the_worst_feed_is_the_least_of_all_directions() {
    let (config, study) = (config("hexapod"), study());
    let setup = Setup::new(&config, &study).unwrap();
    let pose = with_tool(POSES[2].1);
    let in_plane = in_plane(&setup, &pose);
    let lobes = Lobes::new(&in_plane, &setup.process, 6000.0);
    let mut least = f64::INFINITY;
    for degrees in (0..360).step_by(10) {
        let angle = f64::from(degrees).to_radians();
        let rows = turned(&in_plane, angle);
        let own = Lobes::new(&rows, &setup.process, 6000.0);
        // Rotating the rows is equivalent to a feed in that direction.
        let feed = pose.rotation() * Vector3::new(angle.cos(), angle.sin(), 0.0);
        let asked = setup.rows(&pose, &TOOL, &feed).unwrap();
        for (a, b) in rows.iter().zip(&asked) {
            assert!((a.force - b.force).norm() < 1e-12 * b.force.norm().max(1.0));
        }
        close(
            lobes.turned(angle).limit(6000.0).unwrap().depth,
            own.limit(6000.0).unwrap().depth,
            1e-9,
        );
        least = least.min(own.floor().unwrap().depth);
        let opposite = Lobes::new(&turned(&rows, std::f64::consts::PI), &setup.process, 6000.0);
        close(opposite.floor().unwrap().depth, own.floor().unwrap().depth, 1e-9);
    }
    let found = setup.least(&pose, &TOOL, None).unwrap().unwrap();
    // The frequency of a floor is refined: coarse frequencies give the same.
    close(found.depth, least, ZERO_ORDER);
    let worst = turned(&in_plane, setup.worst_feed(&in_plane));
    close(Lobes::new(&worst, &setup.process, 6000.0).floor().unwrap().depth, least, ZERO_ORDER);
    let at = setup.least(&pose, &TOOL, Some(6000.0)).unwrap().unwrap();
    assert!(at.depth >= least);
}

#[test]
fn a_measured_response_is_refused_beside_modes() {
    let measured = "[[measured]]\nname = \"tool\"\nfile = \"frf.csv\"\n";
    let study = Study::parse(&[PLATFORM, LEGS, CUTTING, measured].concat()).unwrap();
    assert!(matches!(Setup::new(&config("hexapod"), &study), Err(NoSetup::Measured)));
}

#[test]
fn a_spindle_adds_its_receptance_to_that_of_the_tip() {
    let config = config("hexapod");
    let spindle = example("spindle.toml");
    let text = [PLATFORM, LEGS, CUTTING, &spindle].concat();
    let with = Study::parse(&text).unwrap();
    let nose = with.spindle.as_ref().unwrap().nose().unwrap();
    let [plain, both] = [study(), with].map(|study| {
        let setup = Setup::new(&config, &study).unwrap();
        in_plane(&setup, &with_tool(POSES[2].1))
    });
    assert_eq!(both.len(), plain.len() + 2 * nose.modes.len());
    for omega in [0.0, 300.0, 4000.0] {
        let [a, b] =
            [&plain, &both].map(|rows| studies::stability::process::receptance(rows, omega));
        let own: nalgebra::Complex<f64> = nose.terms().iter().map(|term| term.at(omega)).sum();
        // The same receptance across the axis, no coupling, and none along the axis.
        for i in 0..2 {
            for k in 0..3 {
                let expected = if i == k { own } else { 0.0.into() };
                assert!((b[(i, k)] - a[(i, k)] - expected).modulus() < 1e-12 * own.modulus());
            }
        }
    }
}

#[test]
fn along_a_path_the_least_depth_is_found_and_the_best_speed_keeps_the_most() {
    let (config, study) = (config("hexapod"), study());
    let setup = Setup::new(&config, &study).unwrap();
    let stop = |line: u32, pose: [f64; 6], rpm: f64| {
        let pose = with_tool(pose);
        Stop {
            step: line as usize,
            line,
            programmed: pose.to_degrees(),
            pose,
            tool: TOOL,
            rotation: pose.rotation(),
            feed: pose.rotation().column(0).into_owned(),
            rpm,
        }
    };
    let stops: Vec<Stop> =
        (1..).zip(POSES).map(|(line, (_, pose))| stop(line, pose, 6000.0)).collect();
    let path = Path::new(&setup, &stops, 12.0).map_err(|(_, error)| error).unwrap();
    let depths = path.depths(|_| ());
    for (depth, expected) in depths.iter().zip([2.2770765079443276, 2.1343250239602987, 2.2802997])
    {
        close(depth.stable_to, expected, DEPTH);
    }
    let speeds: Vec<f64> = (0..16).map(|k| 3000.0 + 1000.0 * f64::from(k)).collect();
    let best = path.best(&speeds).unwrap();
    let at = |rpm: f64| {
        let stops: Vec<Stop> = stops.iter().map(|stop| Stop { rpm, ..*stop }).collect();
        let path = Path::new(&setup, &stops, 12.0).map_err(|(_, error)| error).unwrap();
        path.depths(|_| ()).iter().map(|depth| depth.stable_to).fold(f64::INFINITY, f64::min)
    };
    assert_eq!(at(best.rpm), best.stable_to);
    assert!(at(3000.0) < best.stable_to && at(6000.0) < best.stable_to);
    // A plunge along the spindle axis uses the worst feed.
    let plunge = Stop { feed: stops[2].pose.rotation().column(2).into_owned(), ..stops[2] };
    let found =
        Path::new(&setup, &[plunge], 12.0).map_err(|(_, error)| error).unwrap().depths(|_| ());
    let least = setup.least(&plunge.pose, &TOOL, None).unwrap().unwrap().depth;
    close(found[0].floor, least, ZERO_ORDER);
}

#[test]
fn a_machine_without_what_is_asked_is_refused() {
    fn refused(config: &Mechanism, parts: &[&str]) -> NoSetup {
        Setup::new(config, &Study::parse(&parts.concat()).unwrap()).unwrap_err()
    }
    let config = config("hexapod");
    let turning = "[turning]\nkf_n_per_mm2 = 1000\nthicker = [0, -1, 0]\nforce = [0, 1, 0]\n";
    assert!(matches!(refused(&config, &[LEGS, CUTTING]), NoSetup::Lacking(_)));
    assert!(matches!(refused(&config, &[PLATFORM, CUTTING]), NoSetup::Lacking(_)));
    assert!(matches!(refused(&config, &[PLATFORM, LEGS]), NoSetup::Process));
    assert!(matches!(refused(&config, &[PLATFORM, LEGS, CUTTING, turning]), NoSetup::Both));
    let study = study();
    let setup = Setup::new(&config, &study).unwrap();
    let at_home = config.home_pose();
    let along = setup.rows(&at_home, &TOOL, &Vector3::z());
    assert!(matches!(along, Err(NoModes::Feed(_))));
}

#[test]
fn turning_on_a_lathe_has_the_limits_of_its_lobes() {
    // Zero order is exact if the force is constant.
    let config = config("six-rod-lathe");
    let text = "[platform]\nmass_kg = 40\ncentre_mm = [0, 20, 0]\n\
                inertia_kg_m2 = [[0.9, 0, 0], [0, 1.1, 0], [0, 0, 1.3]]\n\
                [legs]\nrod_stiffness_n_per_um = 20\ndrive_stiffness_n_per_um = 5\n\
                damping_ratio = 0.02\n[turning]\nkf_n_per_mm2 = 1500\nthicker = [1, 0, 0]\n\
                force = [-1, -2, 0.5]\n";
    let study = Study::parse(text).unwrap();
    let setup = Setup::new(&config, &study).unwrap();
    let (pose, tool) = (config.home_pose(), config.spindle);
    let rows = setup.rows(&pose, &tool, &Vector3::x()).unwrap();
    let lobes = Lobes::new(&rows, &setup.process, 500.0);
    for rpm in [500.0, 1000.0, 2500.0] {
        let depth = lobes.limit(rpm).unwrap().depth;
        let period = Period::new(&rows, &setup.process, rpm);
        close(first_limit(&period, 2.0 * depth).unwrap(), depth, DEPTH);
    }
    // The direction of the feed has no effect.
    let other = setup.rows(&pose, &tool, &Vector3::z()).unwrap();
    assert_eq!(rows, other);
    let least = setup.least(&pose, &tool, Some(1000.0)).unwrap().unwrap();
    close(least.depth, lobes.limit(1000.0).unwrap().depth, ZERO_ORDER);
}
