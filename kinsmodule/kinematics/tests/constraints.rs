// SPDX-License-Identifier: GPL-2.0-or-later
//! Platforms whose passive joints make coordinates follow from others: golden values, an independent reference, poses
//! near both kinds of singularity, and constraints that are refused.

use crate::common::machines::{
    constrained, exechon, plane_through_point, point_in_plane, square, strut, tricept, z3_head,
};
use crate::common::{NO_OFFSET, NO_TOOL, cases, direction, rng, uniform};
use kinematics::{
    Cause, ConstraintGeometry, Fault, Geometry, Joints, Letter, Machine, MachinePart, Matrix3,
    Pose, Solver, Vector3,
};
pub(crate) use nalgebra_reference::Reference;

/// A pose of the platform that an independent program computed.
struct Golden {
    machine: String,
    /// From the platform's origin to the control point, in its frame.
    tip: Vector3<f64>,
    pose: [f64; 6],
    joints: [f64; 3],
}

fn golden() -> Vec<Golden> {
    let text = include_str!("../../../tests/cases/golden/constraints.toml");
    let value = |row: &str, key: &str| -> String {
        let line = row.lines().find_map(|line| line.strip_prefix(&format!("{key} = ")));
        line.expect("every row has every key").trim_matches(['[', ']', '"']).into()
    };
    fn numbers<const M: usize>(text: &str) -> [f64; M] {
        let all: Vec<f64> = text.split(", ").map(|word| word.parse().unwrap()).collect();
        all.try_into().unwrap()
    }
    let rows = text.split("[[row]]").skip(1);
    rows.map(|row| Golden {
        machine: value(row, "machine"),
        tip: numbers::<3>(&value(row, "tip")).into(),
        pose: numbers(&value(row, "pose")),
        joints: numbers(&value(row, "joints")),
    })
    .collect()
}

fn geometry(name: &str) -> Geometry {
    match name {
        "tricept" => tricept(),
        "z3-head" => z3_head(""),
        "exechon" => exechon(true),
        _ => panic!("{name}"),
    }
}

pub(crate) fn frozen(geometry: &Geometry) -> Machine {
    Machine::freeze(geometry, &NO_OFFSET).unwrap_or_else(|fault| panic!("{fault}"))
}

/// Sets the coordinates of a pose that cannot be commanded to 0.
fn commanded(machine: &Machine, pose: &Pose) -> Pose {
    let mut values = pose.to_degrees();
    for letter in Letter::ALL {
        if !machine.layout().coordinates().contains(letter) {
            values[letter.index()] = 0.0;
        }
    }
    Pose::from_degrees(values)
}

#[test]
fn golden_poses_have_their_dependent_coordinates_and_joints() {
    let rows = golden();
    assert_eq!(rows.len(), 12);
    for Golden { machine: name, tip, pose, joints } in rows {
        let machine = frozen(&geometry(&name));
        // The tool has no effect on the position while the platform is level.
        let tool = -tip;
        let full = Pose::from_degrees(pose);
        let full = Pose { position: full.position + tool, ..full };
        let world = commanded(&machine, &full);
        let found =
            machine.inverse(&world, &tool).unwrap_or_else(|fault| panic!("{name}: {fault}"));
        for (joint, expected) in found.iter().zip(joints) {
            // The precision that is required of all machines: 1e-9 of the size; far above rounding.
            assert!(
                (joint - expected).abs() <= 1e-9 * machine.size(),
                "{name}: {found:?} {joints:?}"
            );
        }
        let at = machine.at(&world, &tool).unwrap();
        let apart = at.full_pose().distance(&full, machine.radius());
        assert!(apart <= 1e-9 * machine.size(), "{name}: {:?} {pose:?}", at.full_pose());
        assert_eq!(machine.full_pose(&world, &tool).unwrap(), at.full_pose());
        let home = commanded(&machine, &Pose::from_degrees(geometry(&name).home.unwrap()));
        let back = machine.forward(&found, &home, &tool, &Solver::default());
        let back = back.unwrap_or_else(|fault| panic!("{name}: {fault}")).pose;
        assert!(back.distance(&world, machine.radius()) <= 1e-10 * machine.size(), "{name}");
    }
}

/// The constraints and legs of a geometry as equations, with derivatives by differences and LU factors: nothing in
/// common with the core.
pub(crate) mod nalgebra_reference {
    use super::*;
    use kinematics::LegKind;
    use nalgebra::{SMatrix, SVector};

    /// Constraints and legs, by coordinates; the rest is 0.
    type Derivatives = SMatrix<f64, 7, 6>;

    fn vector(values: &[f64]) -> SVector<f64, 7> {
        SVector::from_fn(|i, _| values.get(i).copied().unwrap_or(0.0))
    }

    /// Returns the products of the columns; a column after the first `count` becomes one that no other meets.
    fn products(derivatives: &Derivatives, count: usize) -> SMatrix<f64, 6, 6> {
        let mut products = derivatives.tr_mul(derivatives);
        let trace = products.trace();
        (count..6).for_each(|j| products[(j, j)] = trace);
        products
    }

    /// Returns the smallest singular value of the first `count` columns.
    fn least(derivatives: &Derivatives, count: usize) -> f64 {
        products(derivatives, count).symmetric_eigenvalues().min().max(0.0).sqrt()
    }

    pub struct Reference {
        pub geometry: Geometry,
        pub tool: Vector3<f64>,
        free: Vec<usize>,
        radius: f64,
    }

    fn rotation(pose: &[f64; 6]) -> Matrix3<f64> {
        let [(sa, ca), (sb, cb), (sc, cc)] = [3, 4, 5].map(|k| pose[k].sin_cos());
        let about_x = Matrix3::new(1.0, 0.0, 0.0, 0.0, ca, -sa, 0.0, sa, ca);
        let about_y = Matrix3::new(cb, 0.0, sb, 0.0, 1.0, 0.0, -sb, 0.0, cb);
        let about_z = Matrix3::new(cc, -sc, 0.0, sc, cc, 0.0, 0.0, 0.0, 1.0);
        about_z * about_y * about_x
    }

    impl Reference {
        pub fn new(geometry: &Geometry, tool: Vector3<f64>) -> Self {
            let free = Letter::ALL.into_iter().filter(|l| geometry.layout().is_dependent(*l));
            Self {
                geometry: *geometry,
                tool,
                free: free.map(Letter::index).collect(),
                radius: 200.0,
            }
        }

        /// Returns the platform of a pose (lengths, and angles in radians) of the control point.
        fn platform(&self, pose: &[f64; 6]) -> (Matrix3<f64>, Vector3<f64>) {
            let r = rotation(pose);
            let t = Vector3::new(pose[0], pose[1], pose[2]);
            (r, t - self.tool + r * self.tool)
        }

        pub fn rows(&self, pose: &[f64; 6]) -> Vec<f64> {
            let (r, p) = self.platform(pose);
            let v = Vector3::from;
            let row = |constraint: &ConstraintGeometry| match *constraint {
                ConstraintGeometry::PointInPlane { platform, base, normal } => {
                    v(normal).normalize().dot(&(p + r * v(platform) - v(base)))
                }
                ConstraintGeometry::PlaneThroughPoint { platform, normal, base } => {
                    (r * v(normal).normalize()).dot(&(v(base) - p - r * v(platform)))
                }
                ConstraintGeometry::Square { platform_axis, base_axis } => {
                    self.radius * (r * v(platform_axis).normalize()).dot(&v(base_axis).normalize())
                }
            };
            self.geometry.constraints().iter().map(row).collect()
        }

        pub fn joints(&self, pose: &[f64; 6]) -> Vec<f64> {
            let (r, p) = self.platform(pose);
            let joint = |leg: &kinematics::LegGeometry| {
                let d = p + r * Vector3::from(leg.platform) - Vector3::from(leg.base);
                match leg.kind {
                    LegKind::Strut(_) => d.norm(),
                    LegKind::Slider(slider) => {
                        let u = Vector3::from(slider.guide).normalize();
                        let along = u.dot(&d);
                        let square = slider.rod.powi(2) - d.norm_squared() + along * along;
                        along + f64::from(slider.side) * square.sqrt()
                    }
                    _ => panic!("not used here"),
                }
            };
            self.geometry.legs().iter().map(joint).collect()
        }

        /// Computes derivatives by central differences, angles times the radius.
        fn derivatives(
            &self,
            of: impl Fn(&[f64; 6]) -> Vec<f64>,
            pose: &[f64; 6],
            by: &[usize],
        ) -> Derivatives {
            let mut matrix = Derivatives::zeros();
            for (j, k) in by.iter().enumerate() {
                let unit = if *k < 3 { 1.0 } else { 1.0 / self.radius };
                let at = |by: f64| {
                    let mut pose = *pose;
                    pose[*k] += by * unit;
                    vector(&of(&pose))
                };
                matrix.set_column(j, &((at(1e-3) - at(-1e-3)) / 2e-3));
            }
            matrix
        }

        /// Corrects the unknown coordinates; `None` if Newton's method does not converge.
        fn correct(
            &self,
            of: impl Fn(&[f64; 6]) -> Vec<f64> + Copy,
            pose: &mut [f64; 6],
            by: &[usize],
        ) -> Option<()> {
            for _ in 0..30 {
                let values = vector(&of(pose));
                let derivatives = self.derivatives(of, pose, by);
                let step = products(&derivatives, by.len())
                    .cholesky()?
                    .solve(&derivatives.tr_mul(&values));
                for (j, k) in by.iter().enumerate() {
                    pose[*k] -= step[j] * if *k < 3 { 1.0 } else { 1.0 / self.radius };
                }
                if step.norm() < 1e-10 {
                    return (vector(&of(pose)).norm() < 1e-8).then_some(());
                }
            }
            None
        }

        /// Returns the pose of the control point at home, lengths and radians.
        pub fn home(&self) -> [f64; 6] {
            let pose = Pose::from_degrees(self.geometry.home.unwrap());
            let (p, a) = (pose.position, pose.angles);
            let mut home = [p.x, p.y, p.z, a.x, a.y, a.z];
            let bare = Self {
                tool: Vector3::zeros(),
                geometry: self.geometry,
                free: self.free.clone(),
                ..*self
            };
            bare.correct(|pose| bare.rows(pose), &mut home, &self.free).expect("home");
            // With the tool mounted.
            let shift = self.tool - rotation(&home) * self.tool;
            (0..3).for_each(|k| home[k] += shift[k]);
            home
        }

        /// Follows the dependent coordinates along the straight line from home; `None` where they end or nearly so.
        pub fn complete(&self, world: &Pose, parts: usize) -> Option<[f64; 6]> {
            let home = self.home();
            let (p, a) = (world.position, world.angles);
            let to = [p.x, p.y, p.z, a.x, a.y, a.z];
            let mut pose = home;
            for n in 1..=parts {
                let before = pose;
                for k in (0..6).filter(|k| !self.free.contains(k)) {
                    pose[k] = home[k] + (to[k] - home[k]) * n as f64 / parts as f64;
                }
                self.correct(|pose| self.rows(pose), &mut pose, &self.free)?;
                let derivatives = self.derivatives(|pose| self.rows(pose), &pose, &self.free);
                let least = least(&derivatives, self.free.len());
                let moved = (0..6).map(|k| (pose[k] - before[k]).abs()).fold(0.0, f64::max);
                if least < 1e-3 || moved > 0.2 * self.radius {
                    return None;
                }
            }
            Some(pose)
        }

        /// Solves as [`Self::complete`] does, in less time: three unknowns, with derivatives by one-sided differences once a part.
        pub fn complete_quickly(
            &self,
            home: &[f64; 6],
            world: &Pose,
            parts: usize,
        ) -> Option<[f64; 6]> {
            let (p, a) = (world.position, world.angles);
            let to = [p.x, p.y, p.z, a.x, a.y, a.z];
            let mut pose = *home;
            for n in 1..=parts {
                let before = pose;
                for k in (0..6).filter(|k| !self.free.contains(k)) {
                    pose[k] = home[k] + (to[k] - home[k]) * n as f64 / parts as f64;
                }
                self.correct_three(&mut pose)?;
                let moved = |k: usize| (pose[k] - before[k]).abs() * self.unit(k);
                if (0..6).any(|k| moved(k) > 0.2 * self.radius) {
                    return None;
                }
            }
            Some(pose)
        }

        /// Converts a change of a coordinate to a length.
        fn unit(&self, k: usize) -> f64 {
            if k < 3 { 1.0 } else { self.radius }
        }

        /// Corrects three dependent coordinates; `None` near a constraint singularity.
        pub fn correct_three(&self, pose: &mut [f64; 6]) -> Option<()> {
            let mut inverse: Option<SMatrix<f64, 3, 7>> = None;
            let mut before = f64::INFINITY;
            for _ in 0..40 {
                let values = vector(&self.rows(pose));
                let by = match inverse {
                    Some(inverse) => inverse,
                    None => {
                        let mut columns = SMatrix::<f64, 7, 3>::zeros();
                        for (j, k) in self.free.iter().enumerate() {
                            let mut moved = *pose;
                            moved[*k] += 1e-5 / self.unit(*k);
                            columns.set_column(j, &((vector(&self.rows(&moved)) - values) / 1e-5));
                        }
                        let square = columns.tr_mul(&columns);
                        let least = square.symmetric_eigenvalues().min();
                        if !(least > 1e-6) {
                            return None;
                        }
                        square.try_inverse()? * columns.transpose()
                    }
                };
                inverse = Some(by);
                let step = by * values;
                for (j, k) in self.free.iter().enumerate() {
                    pose[*k] -= step[j] / self.unit(*k);
                }
                let length = step.norm();
                if length < 1e-9 {
                    return Some(());
                }
                if length > 0.1 * before {
                    inverse = None;
                }
                before = length;
            }
            None
        }

        /// Follows joints along the straight line from those of a pose; `None` where the path ends or nearly so.
        pub fn follow(&self, from: &[f64; 6], to: &Joints, parts: usize) -> Option<[f64; 6]> {
            let start = self.joints(from);
            let mut pose = *from;
            for n in 1..=parts {
                let wanted: Vec<f64> = (0..start.len())
                    .map(|i| start[i] + (to[i] - start[i]) * n as f64 / parts as f64)
                    .collect();
                let all = |pose: &[f64; 6]| {
                    let off =
                        self.joints(pose).into_iter().zip(&wanted).map(|(q, wanted)| q - wanted);
                    off.chain(self.rows(pose)).collect::<Vec<_>>()
                };
                self.correct(all, &mut pose, &[0, 1, 2, 3, 4, 5])?;
                let derivatives = self.derivatives(all, &pose, &[0, 1, 2, 3, 4, 5]);
                if least(&derivatives, 6) < 1e-3 {
                    return None;
                }
            }
            Some(pose)
        }
    }

    /// Converts lengths and radians to a pose.
    pub fn pose(values: &[f64; 6]) -> Pose {
        let [x, y, z, a, b, c] = *values;
        Pose { position: Vector3::new(x, y, z), angles: Vector3::new(a, b, c) }
    }
}

/// Returns the machines, with the half ranges of their commanded coordinates about home: well within reach, and beyond.
pub(crate) fn machines() -> [(&'static str, Geometry, [f64; 6], [f64; 6]); 4] {
    let (xyz, far) = ([350.0, 350.0, 150.0, 0.0, 0.0, 0.0], [1500.0, 1500.0, 900.0, 0.0, 0.0, 0.0]);
    let (zab, steep) = ([0.0, 0.0, 80.0, 35.0, 35.0, 0.0], [0.0, 0.0, 300.0, 100.0, 100.0, 0.0]);
    [
        ("tricept", tricept(), xyz, far),
        ("z3-head", z3_head(""), zab, steep),
        (
            "z3-head with table",
            z3_head("XY"),
            [300.0, 300.0, 80.0, 35.0, 35.0, 0.0],
            [300.0, 300.0, 300.0, 100.0, 100.0, 0.0],
        ),
        ("exechon", exechon(true), [250.0, 250.0, 150.0, 0.0, 0.0, 0.0], far),
    ]
}

pub(crate) fn tool(rng: &mut rand_pcg::Pcg64) -> Vector3<f64> {
    match uniform(rng, 0.0, 3.0) as usize {
        0 => NO_TOOL,
        1 => Vector3::new(0.0, 0.0, uniform(rng, -50.0, 250.0)),
        _ => Vector3::new(
            uniform(rng, -70.0, 70.0),
            uniform(rng, -70.0, 70.0),
            uniform(rng, 0.0, 200.0),
        ),
    }
}

pub(crate) fn pose_within(rng: &mut rand_pcg::Pcg64, geometry: &Geometry, half: &[f64; 6]) -> Pose {
    let home = geometry.home.unwrap();
    Pose::from_degrees(std::array::from_fn(|k| home[k] + uniform(rng, -half[k], half[k])))
}

#[test]
fn forward_returns_the_pose_of_inverse_from_home_and_from_near() {
    let mut rng = rng(60);
    for (name, geometry, half, _) in machines() {
        let machine = frozen(&geometry);
        let home = Pose::from_degrees(geometry.home.unwrap());
        let (mut all, mut found) = (0, 0);
        for _ in 0..cases(3000) {
            let (tool, pose) = (tool(&mut rng), pose_within(&mut rng, &geometry, &half));
            all += 1;
            let Ok(joints) = machine.inverse(&pose, &tool) else { continue };
            let near = Pose {
                position: pose.position + pose_near(&mut rng, &machine, 0),
                angles: pose.angles + pose_near(&mut rng, &machine, 3),
            };
            for seed in [home, near] {
                match machine.forward(&joints, &seed, &tool, &Solver::default()) {
                    Ok(solution) => {
                        let apart = solution.pose.distance(&pose, machine.radius());
                        assert!(
                            apart <= 1e-10 * machine.size(),
                            "{name}: {:?} {tool:?} {apart:e} seed {:?}",
                            pose.to_degrees(),
                            seed.to_degrees()
                        );
                        found += 1;
                    }
                    Err(fault) => {
                        assert!(seed == home, "{name}: {:?} {tool:?}: {fault}", pose.to_degrees())
                    }
                }
            }
        }
        println!("{name}: {found} of {}", 2 * all);
        // A few poses are beyond singularities or out of reach.
        assert!(found as f64 >= 1.8 * all as f64, "{name}: {found} of {}", 2 * all);
    }
}

/// Returns a step of up to half a millimeter or 0.06 degrees in commanded coordinates.
pub(crate) fn pose_near(
    rng: &mut rand_pcg::Pcg64,
    machine: &Machine,
    first: usize,
) -> Vector3<f64> {
    let step = direction(rng) * if first == 0 { 0.5 } else { 0.001 };
    Vector3::from_fn(
        |k, _| if machine.layout().is_held(Letter::ALL[first + k]) { 0.0 } else { step[k] },
    )
}

#[test]
fn dependent_coordinates_are_those_of_the_reference_also_where_they_end() {
    let mut rng = rng(61);
    for (name, geometry, half, far) in machines() {
        if !geometry.layout().table().is_empty() {
            continue;
        }
        let machine = frozen(&geometry);
        let (mut found, mut refused, mut missed) = (0, 0, 0);
        for n in 0..cases(150) {
            let tool = tool(&mut rng);
            let pose = pose_within(&mut rng, &geometry, if n % 2 == 0 { &half } else { &far });
            let reference = Reference::new(&geometry, tool);
            let expected = reference.complete(&pose, 200);
            match (machine.full_pose(&pose, &tool), expected) {
                (Ok(full), Some(expected)) => {
                    let apart =
                        full.distance(&nalgebra_reference::pose(&expected), machine.radius());
                    // Differences and Newton's method of the reference leave 1e-8.
                    assert!(
                        apart <= 1e-9 * machine.size(),
                        "{name}: {:?} {tool:?}: {full:?} {expected:?}",
                        pose.to_degrees()
                    );
                    found += 1;
                }
                // The reference gives up earlier.
                (Ok(_), None) => missed += 1,
                (Err(fault), Some(_)) => {
                    assert_eq!(fault.cause, Cause::ConstraintSingular, "{name}: {fault}");
                    refused += 1;
                    println!("{name} refused {:?} {tool:?} {fault}", pose.to_degrees());
                }
                (Err(_), None) => {}
            }
        }
        println!("{name}: {found} found, {refused} refused, {missed} without reference");
        assert!(
            found >= 40 * cases(150) / 100 && refused <= cases(150) / 20,
            "{name}: {found} {refused} {missed}"
        );
    }
}

#[test]
fn forward_follows_joints_as_the_reference_does_and_refuses_what_is_not_connected() {
    let mut rng = rng(62);
    for (name, geometry, half, _) in machines() {
        if !geometry.layout().table().is_empty() {
            continue;
        }
        let machine = frozen(&geometry);
        let (mut followed, mut refused) = (0, 0);
        for _ in 0..cases(60) {
            let tool = tool(&mut rng);
            let reference = Reference::new(&geometry, tool);
            let seed = pose_within(&mut rng, &geometry, &half);
            let Some(start) = reference.complete(&seed, 100) else { continue };
            // Joints that need not belong to any pose, or to one beyond a singularity.
            let mut joints: Joints = [0.0; 11];
            let far = if uniform(&mut rng, 0.0, 1.0) < 0.5 { 40.0 } else { 400.0 };
            for (joint, own) in joints.iter_mut().zip(reference.joints(&start)) {
                *joint = own + uniform(&mut rng, -far, far);
            }
            let Ok(solution) = machine.forward(&joints, &seed, &tool, &Solver::default()) else {
                refused += 1;
                continue;
            };
            let full = machine.full_pose(&solution.pose, &tool).expect("forward has checked it");
            // Where the reference stops, a step of it is near a singularity that the path only passes by.
            let Some(expected) = reference.follow(&start, &joints, 400) else { continue };
            let apart = full.distance(&nalgebra_reference::pose(&expected), machine.radius());
            assert!(
                apart <= 1e-9 * machine.size(),
                "{name}: {seed:?} {joints:?}: {full:?} {expected:?}"
            );
            followed += 1;
        }
        println!("{name}: {followed} followed, {refused} refused");
        assert!(followed >= cases(60) / 3, "{name}: {followed}");
    }
}

#[test]
fn the_jacobian_is_the_derivative_of_the_joints_with_dependent_coordinates() {
    let mut rng = rng(63);
    for (name, geometry, half, _) in machines() {
        let machine = frozen(&geometry);
        let mut compared = 0;
        for _ in 0..cases(50) {
            let (tool, pose) = (tool(&mut rng), pose_within(&mut rng, &geometry, &half));
            let Ok(at) = machine.at(&pose, &tool) else { continue };
            let jacobian = at.pose_jacobian().unwrap();
            // Steps of a micrometer and of 1e-5 degrees: rounding of 1e-13 divided by them, and curvature.
            let mut check =
                |rates: &dyn Fn(usize) -> f64, moved: &dyn Fn(f64) -> Option<Joints>, step: f64| {
                    let (Some(low), Some(high)) = (moved(-step), moved(step)) else { return };
                    for i in 0..machine.layout().joints() {
                        let difference = (high[i] - low[i]) / (2.0 * step);
                        assert!(
                            (rates(i) - difference).abs() < 1e-5 * (1.0 + difference.abs()),
                            "{name} joint {i}: {} {difference}",
                            rates(i)
                        );
                        compared += 1;
                    }
                };
            for letter in Letter::ALL {
                let k = letter.index();
                if machine.layout().is_held(letter) {
                    assert!((0..11).all(|i| jacobian[(i, k)] == 0.0));
                    continue;
                }
                let moved = |by: f64| {
                    let mut values = pose.to_degrees();
                    values[k] += by;
                    machine.inverse(&Pose::from_degrees(values), &tool).ok()
                };
                check(&|i| jacobian[(i, k)], &moved, 1e-3);
            }
            let change = direction(&mut rng);
            let rates = at.tool_rates(&change).unwrap();
            check(&|i| rates[i], &|by| machine.inverse(&pose, &(tool + change * by)).ok(), 1e-3);
            // Joints that stay while the tool changes belong to the shifted pose.
            let longer = tool + change * 20.0;
            let shifted = Pose {
                position: pose.position
                    - machine.tool_shift(&pose, &tool, &(change * 20.0)).unwrap(),
                ..pose
            };
            if let Ok(joints) = machine.inverse(&shifted, &longer) {
                for (one, other) in joints.iter().zip(at.joints()) {
                    assert!((one - other).abs() < 1e-9, "{name}: {joints:?} {:?}", at.joints());
                }
            }
        }
        assert!(compared >= cases(50) * 8, "{name}: {compared}");
    }
}

/// Returns the refusal of a machine with these constraints instead of its own.
fn refusal(geometry: &Geometry, constraints: &[ConstraintGeometry]) -> Fault {
    let (coordinates, table) = (geometry.layout().coordinates(), geometry.layout().table());
    let word = |letters: &kinematics::Letters| {
        letters.as_slice().iter().map(|l| l.name()).collect::<String>()
    };
    let (coordinates, table) = (word(coordinates), word(table));
    let changed =
        constrained(geometry.legs(), (&coordinates, &table), constraints, geometry.home.unwrap());
    Machine::freeze(&changed, &NO_OFFSET).expect_err("refused")
}

#[test]
fn constraints_that_make_no_machine_are_refused_with_their_number() {
    let (x, y, z, o) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3]);
    let tricept = tricept();
    let own = [plane_through_point(o, y, o), plane_through_point(o, x, o), square(y, x)];
    let with = |n: usize, other| {
        let mut constraints = own;
        constraints[n] = other;
        refusal(&tricept, &constraints)
    };
    let of = |cause, n| (cause, Some(MachinePart::Constraint(n)));
    for (fault, expected) in [
        (with(1, plane_through_point(o, o, o)), of(Cause::ConstraintAxisZero, 1)),
        (with(2, square(y, o)), of(Cause::ConstraintAxisZero, 2)),
        (
            with(0, plane_through_point([f64::NAN, 0.0, 0.0], y, o)),
            of(Cause::ConstraintNotFinite, 0),
        ),
        (with(0, plane_through_point(o, y, [0.0, 1e12, 0.0])), of(Cause::ConstraintTooFar, 0)),
        // The same plane once more, and one freedom too many.
        (with(2, plane_through_point([0.0, 0.0, 50.0], y, o)), of(Cause::ConstraintRedundant, 2)),
        // A point of the platform in a plane of the base fixes a commanded coordinate.
        (
            with(2, point_in_plane(o, [0.0, 0.0, -900.0], z)),
            (Cause::ConstraintsFix, Some(MachinePart::Coordinate(Letter::Z))),
        ),
    ] {
        assert_eq!((fault.cause, fault.part), expected, "{fault}");
    }
    let [a, b, c] = own;
    let fault = refusal(&tricept, &[a, b, c, square(x, z)]);
    assert_eq!((fault.cause, fault.part), of(Cause::ConstraintsTooMany, 3));
    // A fourth one that repeats the first at the home pose, where both planes contain the base point.
    let fault = refusal(&tricept, &[a, b, c, plane_through_point([0.0, 3.0, 0.0], y, o)]);
    assert_eq!((fault.cause, fault.part), of(Cause::ConstraintContradicts, 3));
    // The other axes of the universal joint: both agree along X and along Y, and nowhere else.
    let fault = refusal(&tricept, &[a, b, c, square(x, y)]);
    assert_eq!((fault.cause, fault.part), of(Cause::ConstraintContradicts, 3));
    let mut homeless = tricept;
    homeless.home = None;
    let fault = Machine::freeze(&homeless, &NO_OFFSET).expect_err("no home");
    assert_eq!(fault.cause, Cause::ConstraintsNeedHome);
    homeless.home = Some([400.0, 0.0, -100.0, 0.0, 0.0, 0.0]);
    let fault = Machine::freeze(&homeless, &NO_OFFSET).expect_err("far from the constraints");
    assert_eq!(fault.cause, Cause::HomeOffConstraints);
    homeless.home = Some([0.0, 0.0, -900.0, 5.0, 0.0, 0.0]);
    let fault = Machine::freeze(&homeless, &NO_OFFSET).expect_err("a dependent coordinate");
    assert_eq!(fault.cause, Cause::HomeHeld);
}

/// Two planes of the platform are 7 degrees apart, so that the constraints determine the dependent coordinates badly,
/// though everywhere about home.
#[test]
fn coordinates_that_are_badly_determined_are_found_as_long_as_they_are_determined() {
    let legs = [
        ([-65.0, -324.6, 0.0], [-36.6, 52.7, -36.3]),
        ([-433.9, 491.8, 236.9], [83.4, -17.0, 2.2]),
        ([-360.8, 247.7, 0.0], [159.2, -94.2, -33.2]),
    ]
    .map(|(base, platform)| strut(base, platform));
    let constraints = [
        square(
            [0.0, 0.0, 3.136364910749829],
            [0.018962283657990686, 0.9965884540740964, -0.05513926984258134],
        ),
        plane_through_point(
            [123.54741643899817, 180.78959712914988, 22.609190275427892],
            [0.29898230257368835, 0.023345626063166487, -2.288687594325489],
            [-380.42849860328687, 15.780478527532619, -138.68742044827863],
        ),
        plane_through_point(
            [17.030762747944976, 66.77554041368197, 172.73593976419554],
            [0.0, 0.0, 4.046676445137255],
            [-111.80435023446654, -50.70366880822805, 179.8497188981945],
        ),
    ];
    let home = [-93.51342008768735, 0.0, 0.0, 0.0, -19.26040383472563, -10.1991002387677];
    let geometry = constrained(&legs, ("XBC", ""), &constraints, home);
    let machine = frozen(&geometry);
    let mut rng = rng(66);
    for _ in 0..cases(300) {
        let pose = pose_within(&mut rng, &geometry, &[6.0, 0.0, 0.0, 0.0, 0.2, 0.2]);
        let full = machine.full_pose(&pose, &NO_TOOL).unwrap_or_else(|fault| panic!("{fault}"));
        let expected = Reference::new(&geometry, NO_TOOL).complete(&pose, 50);
        let expected = nalgebra_reference::pose(&expected.expect("a regular line"));
        // The reference ends at 1e-8, which a singular value of 0.01 makes a hundred times as much.
        let apart = full.distance(&expected, machine.radius());
        assert!(apart <= 1e-6, "{:?}: {apart}", pose.to_degrees());
    }
}

#[test]
fn an_overconstrained_machine_whose_equations_agree_is_the_machine_without_the_redundant_one() {
    let (all, own) = (frozen(&exechon(true)), frozen(&exechon(false)));
    let mut rng = rng(64);
    for _ in 0..cases(50) {
        let pose = pose_within(&mut rng, &exechon(true), &[200.0, 200.0, 100.0, 0.0, 0.0, 0.0]);
        assert_eq!(all.inverse(&pose, &NO_TOOL), own.inverse(&pose, &NO_TOOL));
    }
    assert_ne!(exechon(true).hash(), exechon(false).hash());
}

#[test]
fn a_dependent_letter_is_refused_with_the_letters_that_it_follows() {
    let machine = frozen(&tricept());
    let mut pose = Pose::from_degrees([10.0, 20.0, -900.0, 0.0, 0.5, 0.0]);
    let fault = machine.inverse(&pose, &NO_TOOL).expect_err("B follows");
    assert_eq!(fault.cause, Cause::DependentGiven);
    assert!(fault.to_string().starts_with("on this machine B follows from X Y Z: "), "{fault}");
    assert_eq!(fault.number(), None);
    pose.angles.y = 0.0;
    assert!(machine.inverse(&pose, &NO_TOOL).is_ok());
}

#[test]
fn the_cones_of_a_platform_that_is_tilted_at_home_are_measured_from_there() {
    for home in [[60.0, -40.0, -900.0, 0.0, 0.0, 0.0], [0.0, 0.0, -900.0, 0.0, 0.0, 0.0]] {
        let mut geometry = tricept();
        geometry.home = Some(home);
        let machine = frozen(&geometry);
        let at = machine.at(&Pose::from_degrees(home), &NO_TOOL).unwrap();
        assert_eq!(at.tilt() > 1.0, home[0] > 0.0);
        let cones = at.cones();
        // The cosine of such an angle is 1 within rounding, so that the angle is of the order of its root.
        assert!(cones.base.iter().chain(&cones.platform).all(|angle| *angle < 1e-5), "{cones:?}");
    }
}

#[test]
fn a_table_keeps_the_tip_of_a_tilting_head_in_place() {
    let (machine, geometry) = (frozen(&z3_head("XY")), z3_head("XY"));
    let tool = Vector3::new(0.0, 0.0, 150.0);
    let mut rng = rng(65);
    for _ in 0..cases(500) {
        let pose = pose_within(&mut rng, &geometry, &[200.0, 200.0, 60.0, 30.0, 30.0, 0.0]);
        let at = machine.at(&pose, &tool).unwrap();
        // The table carries the work by minus its joint.
        let (tip, joints) = (at.full_pose().position, at.joints());
        let off = (tip.x + joints[3] - pose.position.x)
            .abs()
            .max((tip.y + joints[4] - pose.position.y).abs());
        assert!(off <= 1e-12 * machine.size(), "{off}");
        assert!((at.full_pose().angles - pose.angles).xy().norm() < 1e-15);
    }
}

#[test]
fn constraints_that_keep_a_platform_level_make_the_machine_with_held_letters() {
    let delta = crate::common::machines::linear_delta();
    let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let level = [square(x, y), square(y, z), square(z, x)];
    let given = &delta.geometry;
    let machine = frozen(&constrained(given.legs(), ("XYZ", ""), &level, given.home.unwrap()));
    let mut rng = rng(66);
    let mut found_from_home = 0;
    for _ in 0..cases(300) {
        let (pose, tool) = ((delta.sample)(&mut rng), tool(&mut rng));
        let joints = machine.inverse(&pose, &tool).unwrap();
        let expected = delta.machine.inverse(&pose, &tool).unwrap();
        for (one, other) in joints.iter().zip(&expected) {
            assert!((one - other).abs() <= 1e-12 * machine.size(), "{joints:?} {expected:?}");
        }
        let near = Pose { position: pose.position + direction(&mut rng) * 0.5, ..pose };
        for seed in [near, delta.home] {
            let Ok(found) = machine.forward(&joints, &seed, &tool, &Solver::default()) else {
                // More coordinates make smaller balls, and a far seed may need too many of them.
                assert_eq!(seed, delta.home, "{pose:?}");
                continue;
            };
            assert!(found.pose.distance(&pose, machine.radius()) <= 1e-10 * machine.size());
            found_from_home += usize::from(seed == delta.home);
        }
    }
    println!("{found_from_home} of {} from home", cases(300));
    assert!(found_from_home > 0);
}
