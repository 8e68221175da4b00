// SPDX-License-Identifier: GPL-2.0-or-later
//! Workspaces against independent values, two methods for the volume, and symmetry.

use kinematics::{Gap, Pose};
use kinematics::{Limit, Part, Vector3};
use machine::read::mechanism::Mechanism;
use studies::study::body::{Body, Effort, counted, csv, mesh_volume, obj};
use studies::study::file::Study;
use studies::study::slice::{Plane, Slice};
use studies::study::workspace::Stand;
use studies::study::workspace::{Border, Workspace, tilts};
use test_support::shipped::{config, whole};

fn level<'a>(config: &'a Mechanism, study: &Study) -> Workspace<'a> {
    Workspace::new(config, config.spindle, vec![[0.0; 3]], study).unwrap()
}

/// Returns coarse settings for tests.
fn effort(workspace: &Workspace) -> Effort<'static> {
    Effort { bands: 24, step: workspace.extent() / 150.0, grid: 40, progress: &|_| () }
}

/// Rays from home, at home's orientation: distances from an independent computation.
const REACHES: [(&str, [f64; 3], f64, &str); 7] = [
    ("hexapod", [1.0, 0.0, 0.0], 624.504495326756, "base cone"),
    ("hexapod", [-1.0, 0.0, 0.0], 680.800981123708, ""),
    ("hexapod", [0.0, 1.0, 0.0], 635.757774687582, ""),
    ("hexapod", [0.0, 0.0, 1.0], 665.181080239693, ""),
    ("hexapod", [0.0, 0.0, -1.0], 502.216584149046, ""),
    ("lab-hexapod", [0.0, 0.0, 1.0], 261.947838497324, "joint at its highest"),
    ("lab-hexapod", [0.0, 0.0, -1.0], 220.139058575230, "joint at its lowest"),
];

#[test]
fn the_reach_along_the_axes_is_that_of_an_independent_calculation() {
    for (machine, direction, expected, limit) in REACHES {
        let config = config(machine);
        let workspace = level(&config, &Study::default());
        let ray = workspace.ray(&config.home_pose().position, &direction.into(), 5.0);
        // 1e-6 of the values.
        assert!((ray.exit() - expected).abs() < 1e-6, "{machine} {direction:?} {}", ray.exit());
        assert!(ray.limit.to_string().starts_with(limit), "{machine} {}", ray.limit);
    }
}

#[test]
fn both_volumes_agree_to_one_per_cent_and_the_mesh_is_closed_around_one_of_them() {
    for machine in ["lab-hexapod", "linear-delta"] {
        let config = config(machine);
        let workspace = level(&config, &Study::default());
        let effort = Effort { bands: 40, grid: 60, ..effort(&workspace) };
        let body = Body::seen(&workspace, config.home_pose().position, &effort).unwrap();
        let grid = counted(&workspace, &body.corners(), &effort);
        let apart = (body.volume() / grid.volume - 1.0).abs();
        assert!(apart < 0.01, "{machine}: {} {}", body.volume(), grid.volume);
        let mesh = body.mesh();
        let mut edges: Vec<[usize; 2]> =
            mesh.1.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]).collect();
        edges.sort_unstable();
        for [a, b] in &edges {
            assert!(edges.binary_search(&[*b, *a]).is_ok(), "an edge with one side");
        }
        assert!(edges.windows(2).all(|pair| pair[0] != pair[1]), "an edge run twice");
        // Chords of 4.5 degrees are inside by some thousandths; only the first segments count.
        let first: f64 = body.rays().map(|(angle, ray)| angle * ray.exit().powi(3) / 3.0).sum();
        assert!((mesh_volume(&mesh) / first - 1.0).abs() < 0.02, "{machine}");
        assert_eq!(obj("mm", &mesh).lines().count(), 1 + mesh.0.len() + mesh.1.len());
        let rays = body.rays().map(|(_, ray)| 1 + 2 * ray.others.len()).sum::<usize>();
        assert_eq!(csv(&body).lines().count(), 1 + rays);
    }
}

#[test]
fn a_workspace_is_a_sphere_where_only_the_reach_of_a_round_limit_counts() {
    // The sum of the solid angles of all rays.
    let config = config("tripod");
    let workspace = level(&config, &Study::default());
    let body = Body::seen(&workspace, config.home_pose().position, &effort(&workspace)).unwrap();
    let sum: f64 = body.rays().map(|(angle, _)| angle).sum();
    assert!((sum / (4.0 * std::f64::consts::PI) - 1.0).abs() < 1e-12);
    let shares: f64 = body.shares().iter().map(|(_, share)| share).sum();
    assert!((shares - 1.0).abs() < 1e-12);
}

#[test]
fn the_workspace_of_a_symmetric_machine_is_symmetric() {
    let config = config("hexapod");
    let workspace = level(&config, &Study::default());
    let home = config.home_pose().position;
    for angle in [0.2_f64, 0.9, 1.7] {
        let exit = |angle: f64, rise: f64| {
            let (y, x) = angle.sin_cos();
            workspace.ray(&home, &Vector3::new(x, y, rise).normalize(), 10.0).exit()
        };
        for rise in [-0.5, 0.0, 0.5] {
            let here = exit(angle, rise);
            let third = 2.0 * std::f64::consts::PI / 3.0;
            // Rounding of anchors that were computed from sines.
            assert!((here - exit(-angle, rise)).abs() < 1e-8);
            assert!((here - exit(angle + third, rise)).abs() < 1e-8);
        }
    }
}

#[test]
fn what_every_tilt_allows_lies_within_what_one_orientation_allows() {
    let config = config("hexapod");
    let one = level(&config, &Study::default());
    let orientations = tilts(&config, 15.0, 6);
    assert_eq!(orientations.len(), 7);
    let all = Workspace::new(&config, config.spindle, orientations, &Study::default()).unwrap();
    let effort = Effort { bands: 8, ..effort(&one) };
    let home = config.home_pose().position;
    let bodies = [&one, &all].map(|space| Body::seen(space, home, &effort).unwrap());
    for ((_, wide), (_, narrow)) in bodies[0].rays().zip(bodies[1].rays()) {
        assert!(narrow.exit() <= wide.exit() + 1e-9);
    }
    assert!(bodies[1].volume() < 0.9 * bodies[0].volume());
}

#[test]
fn a_machine_that_turns_about_one_axis_is_tilted_about_that_one() {
    let lathe = config("four-rod-lathe");
    let found = tilts(&lathe, 10.0, 12);
    assert_eq!(found.len(), 3);
    for (angles, expected) in found.iter().zip([0.0, 10.0, -10.0]) {
        assert!((angles[1] - expected).abs() < 1e-9 && angles[0] == 0.0);
    }
    assert_eq!(tilts(&config("tripod"), 10.0, 12), [[0.0; 3]]);
}

#[test]
fn limits_of_a_study_end_rays_where_they_are_met() {
    let config = config("hexapod");
    let home = config.home_pose().position;
    let hold = |position: Vector3<f64>| {
        let pose = kinematics::Pose { position, angles: Vector3::zeros() };
        config.machine.at(&pose, &config.spindle).unwrap().smallest_singular_value()
    };
    let free = level(&config, &Study::default());
    let mut looked = 0;
    for direction in [Vector3::x(), Vector3::y(), Vector3::z(), -Vector3::z()] {
        let end = home + direction * free.ray(&home, &direction, 5.0).exit();
        if hold(end) >= 0.95 * hold(home) {
            continue;
        }
        looked += 1;
        let least = (hold(end) + hold(home)) / 2.0;
        let study = Study::parse(&format!("[limits]\nconditioning = {least}\n")).unwrap();
        let ray = level(&config, &study).ray(&home, &direction, 5.0);
        assert_eq!(ray.limit.limit, Limit::Conditioning);
        // The end is accurate to rounding.
        assert!((hold(home + direction * ray.exit()) - least).abs() < 1e-9);
    }
    assert!(looked > 0);
}

#[test]
fn a_pyramid_ends_a_ray_where_the_leg_turns_too_far_about_the_axis_of_its_joint() {
    let config = config("hexapod");
    let study = Study::parse("[limits]\nbase_pyramid_deg = [10, 10]\n").unwrap();
    let home = config.home_pose();
    let ray = level(&config, &study).ray(&home.position, &Vector3::x(), 5.0);
    let Border { limit: Limit::BasePyramid, part: Part::Leg(leg), .. } = ray.limit else {
        panic!("{}", ray.limit)
    };
    let mut pose = home;
    pose.position += ray.direction * ray.exit();
    let along = |pose: &kinematics::Pose| {
        let segment = config.machine.at(pose, &config.spindle).unwrap().segments()[leg];
        (segment.platform - segment.base).normalize()
    };
    let kinematics::LegKind::Strut(strut) = config.geometry.legs()[leg].kind else { panic!() };
    let axis = Vector3::from(strut.base_axis).normalize();
    let (now, home) = (along(&pose), along(&home));
    let about = axis.dot(&home.cross(&now)).atan2(now.dot(&home)).to_degrees().abs();
    let across = now.dot(&axis).asin().to_degrees().abs();
    assert!((about.max(across) - 10.0).abs() < 1e-9, "{about} {across}");
}

#[test]
fn a_pyramid_of_the_platform_is_seen_from_the_platform() {
    let config = config("hexapod");
    let text = "[limits]\nplatform_pyramid_deg = [20, 20]\n";
    let study = Study::parse(text).unwrap();
    // Tilted, so that the angles at base and platform differ.
    let tilt = [9.0, -6.0, 0.0];
    let space = Workspace::new(&config, config.spindle, vec![tilt], &study).unwrap();
    let home = config.home_pose();
    let ray = space.ray(&home.position, &Vector3::x(), 5.0);
    let Border { limit: Limit::PlatformPyramid, part: Part::Leg(leg), .. } = ray.limit else {
        panic!("{}", ray.limit)
    };
    let [a, b, c] = tilt.map(f64::to_radians);
    let position = home.position + ray.direction * ray.exit();
    let pose = kinematics::Pose { position, angles: Vector3::new(a, b, c) };
    let seen = |pose: &kinematics::Pose| {
        let segment = config.machine.at(pose, &config.spindle).unwrap().segments()[leg];
        pose.rotation().transpose() * (segment.platform - segment.base).normalize()
    };
    let kinematics::LegKind::Strut(strut) = config.geometry.legs()[leg].kind else { panic!() };
    let axis = Vector3::from(strut.platform_axis).normalize();
    let (now, then) = (seen(&pose), seen(&home));
    let about = axis.dot(&then.cross(&now)).atan2(now.dot(&then)).to_degrees().abs();
    let across = now.dot(&axis).asin().to_degrees().abs();
    assert!((about.max(across) - 20.0).abs() < 1e-9, "{about} {across}");
    // Axes in the study have priority over those of the file.
    let own: Vec<String> = (0..6)
        .map(|i| {
            let kinematics::LegKind::Strut(strut) = config.geometry.legs()[i].kind else {
                panic!()
            };
            format!("{:?}", strut.platform_axis)
        })
        .collect();
    let named = format!("{text}platform_axes = [{}]\n", own.join(", "));
    let named = Study::parse(&named).unwrap();
    let same = Workspace::new(&config, config.spindle, vec![tilt], &named).unwrap();
    assert_eq!(same.ray(&home.position, &Vector3::x(), 5.0), ray);
    let turned = Study::parse(&format!("{text}platform_axes = {}\n", "[[1, 0, 0]]")).unwrap();
    let error = Workspace::new(&config, config.spindle, vec![tilt], &turned).err().unwrap();
    assert_eq!(error.to_string(), "platform_axes: expected 6 axes; found 1");
    // A pyramid in the file refers to the file's axis, which no study may change.
    let mut limited = config.clone();
    limited.angles[4].pyramids[1] = Some([30.0, 30.0]);
    assert!(Workspace::new(&limited, config.spindle, vec![tilt], &named).is_ok());
    let text = format!("{text}platform_axes = [{}]\n", ["[1, 0, 0]"; 6].join(", "));
    let other = Study::parse(&text).unwrap();
    assert!(Workspace::new(&config, config.spindle, vec![tilt], &other).is_ok());
    let error = Workspace::new(&limited, config.spindle, vec![tilt], &other).err().unwrap();
    assert!(error.to_string().starts_with("platform_axes: leg 4 has a pyramid"), "{error}");
    let rods = test_support::shipped::config("linear-delta");
    let error = Workspace::new(&rods, rods.spindle, vec![[0.0; 3]], &study).err().unwrap();
    assert_eq!(error.to_string(), "platform_pyramid_deg: leg 0 has no axis; add platform_axes");
}

#[test]
fn slices_have_their_area_and_the_angles_they_are_seen_under() {
    let config = config("lab-hexapod");
    let workspace = level(&config, &Study::default());
    let effort = effort(&workspace);
    let home = config.home_pose().position;
    let slice =
        |name: &str| Slice::seen(&workspace, Plane::parse(name).unwrap(), home, 360, &effort);
    let (xz, normal) = (slice("xz"), slice("0,1,0"));
    assert!((xz.area() / normal.area() - 1.0).abs() < 1e-3);
    let [low, high] = xz.sector().unwrap();
    // The machine is symmetric in X, and stands above the origin.
    assert!((low + high - 180.0).abs() < 1e-6 && low > 0.0, "{low} {high}");
    for (point, _) in xz.outline() {
        let angle = point[1].atan2(point[0]).to_degrees();
        assert!((low - 1e-9..=high + 1e-9).contains(&angle));
    }
}

#[test]
fn planes_are_named_or_given_by_their_normal() {
    let across = Plane::parse("1,1,0").unwrap().axes;
    assert!(across[0].dot(&Vector3::new(1.0, 1.0, 0.0)).abs() < 1e-15);
    assert!((across[1] - Vector3::z()).norm() < 1e-15);
    for bad in ["zx", "1,2", "0,0,0", "a,b,c", "1,2,3,4", ""] {
        assert!(Plane::parse(bad).is_none(), "{bad}");
    }
}

#[test]
fn a_place_outside_has_no_workspace_around_it_and_says_why() {
    let config = config("hexapod");
    let workspace = level(&config, &Study::default());
    let far = Vector3::new(0.0, 0.0, -900.0);
    let limit = Body::seen(&workspace, far, &effort(&workspace)).unwrap_err();
    assert!(limit.limit == Limit::JointRange && !limit.is_low, "{limit}");
}

#[test]
fn any_number_of_threads_sees_the_same() {
    let config = config("linear-delta");
    let workspace = level(&config, &Study::default());
    let home = config.home_pose().position;
    let seen = |threads: usize| {
        let effort = Effort { bands: 8, ..effort(&workspace) };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let body = Body::seen(&workspace, home, &effort).unwrap();
            (body.volume(), counted(&workspace, &body.corners(), &effort))
        })
    };
    assert_eq!(seen(1), seen(3));
}

#[test]
fn a_workspace_beside_the_other_one_ends_where_the_clearance_is_lost() {
    let first = config("lathe-mirrored");
    let second = whole("lathe-mirrored").mechanism(2).unwrap();
    let space =
        |config| Workspace::new(config, config.spindle, vec![[0.0; 3]], &Study::default()).unwrap();
    let home = first.home_pose().position;
    let beside = [Stand::Home, Stand::Anywhere]
        .map(|stand| space(&first).beside(&first, &second, stand).unwrap());
    let alone = space(&first);
    let exit = |space: &Workspace, way: Vector3<f64>| space.ray(&home, &way, 5.0);
    // Carriages of both mechanisms run on one rail, and Z moves one of them.
    let gap = |one: &Pose, other: &Pose| {
        let [one, other] = [(&first, one), (&second, other)]
            .map(|(config, pose)| config.machine.at(pose, &config.spindle).unwrap());
        Gap::between(&one, &other).distance
    };
    let ray = exit(&beside[0], Vector3::z());
    let expected = gap(&first.home_pose(), &second.home_pose()) - 150.0;
    assert!((ray.exit() - expected).abs() < 1e-6 && ray.limit.is_between, "{ray:?} {expected}");
    assert!(exit(&alone, Vector3::z()).exit() > expected + 50.0);
    assert_eq!(exit(&beside[0], -Vector3::z()), exit(&alone, -Vector3::z()));
    // The workspace for all poses of the other mechanism is never larger; from the far end of Z on, if it is inside.
    let from = beside[1].place_inside().expect("a corner is clear of it");
    let ray = beside[1].ray(&from, &Vector3::z(), 5.0);
    let end = Pose { position: from + Vector3::z() * ray.exit(), angles: Vector3::zeros() };
    let axes = &second.axes;
    let corners = (0..16).map(|n| {
        let side = |bit: usize, k: usize| if n >> bit & 1 == 0 { axes[k].min } else { axes[k].max };
        Pose::from_degrees([side(0, 0), side(1, 1), side(2, 2), 0.0, side(3, 4), 0.0])
    });
    let reached = corners.filter(|pose| second.machine.inverse(pose, &second.spindle).is_ok());
    let least = reached.map(|pose| gap(&end, &pose)).fold(f64::INFINITY, f64::min);
    assert!((least - 150.0).abs() < 1e-6 && ray.limit.is_between, "{least} {ray:?}");
    let volumes = [&alone, &beside[0], &beside[1]].map(|space| {
        let effort = Effort { bands: 16, step: space.extent() / 100.0, grid: 8, progress: &|_| () };
        Body::seen(space, from, &effort).unwrap().volume()
    });
    println!(
        "alone {:.0}, beside the other at home {:.0}, anywhere {:.0}",
        volumes[0], volumes[1], volumes[2]
    );
    assert!(volumes[0] > 1.05 * volumes[1] && volumes[1] > 1.05 * volumes[2], "{volumes:?}");
}
