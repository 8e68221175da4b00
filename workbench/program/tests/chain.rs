// SPDX-License-Identifier: GPL-2.0-or-later
//! Axes that carry workpiece, tool or legs: in LinuxCNC itself, in virtual time, and in the proofs.

use kinematics::{Joints, MAX_JOINTS, Matrix3, Pose, Vector3};
use linuxcnc::row::{Ending, Row};
use machine::read::mechanism::Mechanism;
use program::motion;
use program::preflight::preflight;
use program::replay::replay_seen;
use std::collections::BTreeMap;
use std::fs;
use test_support::control::run;
use test_support::shipped::{config, folder};

const TABLE: &str = "hexapod-rotary-table";

const ON_PLATFORM: &str = "lathe-work-on-platform";

const TURRETS: &str = "lathe-two-turrets";

fn about_y(degrees: f64) -> Matrix3<f64> {
    let (s, c) = degrees.to_radians().sin_cos();
    Matrix3::new(c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c)
}

fn about_z(degrees: f64) -> Matrix3<f64> {
    let (s, c) = degrees.to_radians().sin_cos();
    Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
}

/// Computes LinuxCNC's smoothing of joint commands, a cubic B-spline over the inverse of three cycles, the middle one
/// two cycles earlier.
fn smoothed(three: [&Joints; 3]) -> Joints {
    std::array::from_fn(|i| (three[0][i] + 4.0 * three[1][i] + three[2][i]) / 6.0)
}

/// Returns the largest difference of the first joints.
fn apart(a: &Joints, b: &Joints, count: usize) -> f64 {
    (0..count).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max)
}

/// Returns the carriages of a lathe whose turrets rotate by A about an axis along Y at X -60 of the platform: the tip
/// at A 0 is at the tool vector from the center, and rotates about that axis.
fn by_the_turrets(config: &Mechanism, row: &Row) -> Joints {
    let [x, y, z, a, b, ..] = row.extra.world;
    let (tool, pivot) = (Vector3::from(row.tool), Vector3::new(-60.0, 0.0, 0.0));
    let tip = Vector3::new(x, y, z) - tool;
    let in_platform = pivot + about_y(a) * (-tool - pivot);
    let place = tip - about_y(b) * in_platform;
    let pose = Pose::from_degrees([place.x, place.y, place.z, 0.0, b, 0.0]);
    config.machine.inverse(&pose, &Vector3::zeros()).unwrap()
}

/// Returns the carriages of a lathe that carries the workpiece: its point under the tip is moved to the resting tool.
fn by_the_work(config: &Mechanism, row: &Row) -> Joints {
    let [x, y, z, _, b, ..] = row.extra.world;
    let tool = Vector3::from(row.tool);
    let tip_in_base = Vector3::new(60.0, 450.0, 1300.0) - tool;
    let place = tip_in_base - about_y(b) * (Vector3::new(x, y, z) - tool);
    let pose = Pose::from_degrees([place.x, place.y, place.z, 0.0, b, 0.0]);
    config.machine.inverse(&pose, &Vector3::zeros()).unwrap()
}

/// Runs a program to its end and returns the largest difference of the legs' joints from this inverse of the rows'
/// commands, smoothed, while the tool offset is constant.
fn off(machine: &str, program: &str, inverse: impl Fn(&Mechanism, &Row) -> Joints) -> f64 {
    let (outcome, rows) = run(machine, &folder(machine).join("programs").join(program));
    assert_eq!(outcome.ending, Ending::Finished, "{:?}", outcome.messages);
    assert!(outcome.messages.is_empty(), "{:?}", outcome.messages);
    let config = config(machine);
    let inverse: Vec<Joints> = rows.iter().map(|row| inverse(&config, row)).collect();
    let rests = |n: usize| rows[n - 4..=n].iter().all(|row| row.tool == rows[n].tool);
    let legs = config.legs();
    let off = |n: usize| {
        let expected = smoothed([&inverse[n - 3], &inverse[n - 2], &inverse[n - 1]]);
        apart(&rows[n].joints, &expected, legs)
    };
    let seen: Vec<f64> = (4..rows.len()).filter(|n| rests(*n)).map(off).collect();
    let farthest = seen.iter().fold(0.0, |most: f64, off| most.max(*off));
    println!("{machine} {program}: {} cycles, joints within {farthest:.1e}", seen.len());
    assert!(seen.len() > 10_000, "{}", seen.len());
    farthest
}

#[test]
fn the_carriages_follow_turrets_and_a_tilted_work_in_every_cycle() {
    let turrets = off(TURRETS, "any-angle.ngc", by_the_turrets);
    let work = off(ON_PLATFORM, "face-and-holes.ngc", by_the_work);
    assert!(turrets < 1e-9 && work < 1e-9, "{turrets} {work}");
}

/// Returns the legs at the commanded tip on the workpiece, by a separate formula: the table rotates the tip
/// about Z of base, and the spindle with it.
fn over_the_table(config: &Mechanism, row: &Row) -> Joints {
    let [x, y, z, a, b, c, ..] = row.extra.world;
    let tool = Vector3::from(row.tool);
    let tip = about_z(c) * (Vector3::new(x, y, z) - tool);
    let place = tip + tool;
    let pose = Pose::from_degrees([place.x, place.y, place.z, a, b, 0.0]);
    config.machine.inverse(&pose, &tool).unwrap()
}

/// Returns the largest distance from the programmed circle, on the workpiece, of the tip at the smoothed commands of
/// struts and table: forward of the struts, rotated back by the table.
fn tip_of_commands(config: &Mechanism, circle: &[&Row]) -> f64 {
    let inner = circle.iter().filter(|row| (1.0..1079.0).contains(&row.extra.positions[0]));
    let off = inner.map(|row| {
        let (tool, world) = (Vector3::from(row.tool), row.extra.world);
        let near = config.chain.to_machine(&world, &tool).unwrap();
        let found = config
            .machine
            .forward(&row.joints, &Pose::from_degrees(near), &tool, &config.solver)
            .unwrap();
        let tip = about_z(-row.extra.positions[0]) * (found.pose.position - tool);
        let in_plane = (tip.x - 20.0).hypot(tip.y + 10.0) - 40.0;
        in_plane.abs().max((tip.z - 65.0).abs())
    });
    off.fold(0.0, f64::max)
}

/// Returns the largest displacement of a strut's command from the inverse of the middle cycle due to smoothing.
fn smoothed_away(rows: &[Row], inverse: &[Joints], is_meant: impl Fn(&&Row) -> bool) -> f64 {
    let cycles = (3..rows.len()).filter(|n| is_meant(&&rows[*n]));
    cycles.map(|n| apart(&rows[n].joints, &inverse[n - 2], 6)).fold(0.0, f64::max)
}

#[test]
fn the_tip_is_on_the_circle_of_the_work_in_every_cycle_while_the_table_turns() {
    let (outcome, rows) = run(TABLE, &folder(TABLE).join("programs/turning-circle.ngc"));
    assert_eq!(outcome.ending, Ending::Finished, "{:?}", outcome.messages);
    assert!(outcome.messages.is_empty(), "{:?}", outcome.messages);
    let config = config(TABLE);
    let text = fs::read_to_string(folder(TABLE).join("programs/turning-circle.ngc")).unwrap();
    let line = 1 + text.lines().position(|line| line.starts_with("G3 ")).unwrap() as u32;
    let cutting = |row: &&Row| row.line == line && row.extra.world[5] > 0.0;
    let circle: Vec<&Row> = rows.iter().filter(cutting).collect();
    assert!(circle.len() > 30_000, "{} cycles: 251 mm at 450 mm/min", circle.len());
    // LinuxCNC's commanded tip is on the programmed circle.
    for row in &circle {
        let [x, y, z, ..] = row.extra.world;
        let off = (x - 20.0).hypot(y + 10.0) - 40.0;
        // Except blending with the adjacent moves (G64 P0.005), at the ends.
        if row.extra.world[5] > 1.0 && row.extra.world[5] < 1079.0 {
            assert!(off.abs() < 1e-9 && (z - row.tool[2] - 65.0).abs() < 1e-9, "{off}");
        }
    }
    // The joints of a cycle are the smoothed inverse of the three before: pkmkins was called in every
    // cycle, and has moved the tip along the circle on the workpiece.
    let inverse: Vec<Joints> = rows.iter().map(|row| over_the_table(&config, row)).collect();
    let mut farthest = 0.0_f64;
    for (n, row) in rows.iter().enumerate().skip(3).filter(|(_, row)| cutting(row)) {
        let expected = smoothed([&inverse[n - 3], &inverse[n - 2], &inverse[n - 1]]);
        farthest = farthest.max(apart(&row.joints, &expected, 6));
    }
    println!("{} cycles, joints within {farthest:.1e} mm", circle.len());
    assert!(farthest < 1e-9, "{farthest}");
    let inner = |row: &&Row| cutting(row) && (1.0..1079.0).contains(&row.extra.world[5]);
    let smoothed_away = smoothed_away(&rows, &inverse, inner);
    let off = tip_of_commands(&config, &circle);
    println!(
        "smoothing moves a strut by {smoothed_away:.1e} mm, the tip off the circle by {off:.1e} mm"
    );
    // LinuxCNC moves the command of a strut by a sixth of its second difference, and the tip by at most four
    // times as much. The kinematics cannot correct it: they are called before.
    assert!(off < 1e-5 && off < 4.0 * smoothed_away, "{off} {smoothed_away}");
    assert!(off > 1e-9, "the smoothed commands are looked at: {off}");
    let most = circle.iter().map(|row| row.extra.positions[0]).fold(0.0, f64::max);
    // G64 P0.005 ends slightly before.
    assert!((most - 1080.0).abs() < 0.2, "{most}");
}

#[test]
fn preflight_proves_a_program_over_a_turning_table_and_finds_what_leaves_it() {
    let config = config(TABLE);
    let file = folder(TABLE).join("programs/turning-circle.ngc");
    let moves = motion::moves(&config.clone().into(), &file, None).unwrap();
    let found = preflight(std::slice::from_ref(&config), &moves).unwrap();
    assert!(found.breaks.is_empty(), "{:?}", found.breaks);
    // At an eighth turn of the table a strut is longer than at both ends of the rotation: with a limit
    // between them, it is violated inside the move.
    let mut narrow = config.clone();
    let text = "G21 G90 G94\nG0 X100 Y0 Z200\nG1 C90 F3000\nM2\n";
    let file = tempfile::Builder::new().suffix(".ngc").tempfile().unwrap();
    fs::write(&file, text).unwrap();
    let moves = motion::moves(&config.clone().into(), file.path(), None).unwrap();
    assert!(preflight(std::slice::from_ref(&config), &moves).unwrap().breaks.is_empty());
    let joints = |c: f64| {
        let place = about_z(c) * Vector3::new(100.0, 0.0, 200.0);
        let pose = Pose::from_degrees([place.x, place.y, place.z, 0.0, 0.0, 0.0]);
        config.machine.inverse(&pose, &Vector3::zeros()).unwrap()
    };
    let (begin, middle, end) = (joints(0.0), joints(45.0), joints(90.0));
    let strut = (0..6)
        .max_by(|i, j| {
            let room = |i: &usize| middle[*i] - begin[*i].max(end[*i]);
            room(i).total_cmp(&room(j))
        })
        .unwrap();
    narrow.joints[strut].max = (middle[strut] + begin[strut].max(end[strut])) / 2.0;
    let found = preflight(std::slice::from_ref(&narrow), &moves).unwrap();
    let [message] = found.breaks.as_slice() else { panic!("{:?}", found.breaks) };
    assert!(message.text.contains(&format!("strut {strut}")), "{}", message.text);
    assert_eq!(message.line, 3);
    // At the reported position the strut leaves its range, to the accuracy of a violation.
    let c = message.pose[5];
    assert!((joints(c)[strut] - narrow.joints[strut].max).abs() < 0.01, "{c}");
}

/// Checks the core's round trip over poses of the axis limits: LinuxCNC's pose to joints and back.
fn round_trip(machine: &str, count: usize) {
    use rand::{Rng, SeedableRng};
    let config = config(machine);
    let mut rng = rand_pcg::Pcg64::seed_from_u64(190);
    let (mut seen, mut farthest) = (0, 0.0_f64);
    while seen < count {
        let pose: [f64; 6] = std::array::from_fn(|k| {
            let axis = &config.programmed[k];
            let is_held = config.machine.layout().is_held(kinematics::Letter::ALL[k]);
            if is_held { 0.0 } else { rng.random_range(axis.min..=axis.max) }
        });
        let mut extra = [0.0; kinematics::MAX_EXTRA];
        for (value, axis) in extra.iter_mut().zip(&config.extra) {
            *value = rng.random_range(axis.axis.min.max(-720.0)..=axis.axis.max.min(720.0));
        }
        let length = [0.0, 0.0, rng.random_range(0.0..60.0)];
        let tool = config.spindle + Vector3::from(length);
        let world = config.world(&pose, &extra);
        let own = config.chain.to_machine(&world, &tool).unwrap();
        let of_machine = config.chain.machine_tool(&tool);
        let asked = Pose::from_degrees(own);
        // Not all corners of all axis limits together are within reach.
        let Ok(at) = config.machine.at(&asked, &of_machine) else { continue };
        if at.smallest_singular_value() < config.conditioning_limit {
            continue;
        }
        let near = Pose { position: asked.position.add_scalar(0.3), ..asked };
        let mut joints = [0.0; MAX_JOINTS];
        joints.copy_from_slice(at.joints());
        let found = config.machine.forward(&joints, &near, &of_machine, &config.solver).unwrap();
        let mut back = world;
        config.chain.to_world(&found.pose.to_degrees(), &mut back, &tool).unwrap();
        let place = |w: &[f64; 9]| Vector3::new(w[0], w[1], w[2]);
        let off = (place(&back) - place(&world)).norm() / config.machine.size();
        let turned = (3..6).map(|k| (back[k] - world[k]).abs().to_radians()).fold(0.0, f64::max);
        farthest = farthest.max(off).max(turned);
        seen += 1;
    }
    println!("{machine}: {count} poses within {farthest:.1e} of the size");
    assert!(farthest < 1e-10, "{machine}: {farthest}");
}

#[test]
fn poses_come_back_from_legs_and_axes_of_the_shipped_machines() {
    for machine in [TABLE, ON_PLATFORM, TURRETS] {
        round_trip(machine, test_support::shipped::cases(100_000));
    }
}

/// Returns a folder with the table's configuration, its struts limited to this speed.
fn slow_table(most: f64) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder_of_copy = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(test_support::shipped::ini(TABLE)).unwrap();
    let (head, joints) = text.split_once("[JOINT_0]").unwrap();
    let (struts, rest) = joints.split_once("[JOINT_6]").unwrap();
    let struts = struts.replace("MAX_VELOCITY = 500", &format!("MAX_VELOCITY = {most}"));
    let file = folder_of_copy.path().join(format!("{TABLE}.ini"));
    fs::write(&file, format!("{head}[JOINT_0]{struts}[JOINT_6]{rest}")).unwrap();
    let tools = format!("{TABLE}.tbl");
    fs::copy(folder(TABLE).join(&tools), folder_of_copy.path().join(&tools)).unwrap();
    (folder_of_copy, file)
}

/// Only the table moves: LinuxCNC counts degrees, and the struts follow the tip about its axis.
#[test]
fn the_guard_slows_the_table_down_where_the_struts_that_follow_it_would_be_too_fast() {
    const MOST: f64 = 25.0;
    let (copy, file) = slow_table(MOST);
    let config = test_support::shipped::first_of(&file);
    let program = copy.path().join("turn.ngc");
    let text =
        |feed: &str| format!("G21 G90 G94 {feed}\nG1 X100 Y0 Z200 F600\nG1 C720 F3000\nM2\n");
    let fastest = |feed: &str| {
        fs::write(&program, text(feed)).unwrap();
        let (mut last, mut fastest, mut least) = (None::<Joints>, 0.0_f64, 1.0_f64);
        let options = linuxcnc::process::Options::default();
        let outcome = linuxcnc::process::run(&config.clone().into(), &program, &options, |row| {
            if let Some(last) = last.filter(|_| row.extra.world[5] > 0.0) {
                fastest = fastest.max(apart(&row.joints, &last, 6) / config.period);
                least = least.min(row.feed);
            }
            last = Some(row.joints);
            std::ops::ControlFlow::Continue(())
        });
        (outcome.unwrap(), fastest, least)
    };
    let (outcome, guarded, least) = fastest("M52 P1");
    assert_eq!(outcome.ending, Ending::Finished, "{:?}", outcome.messages);
    assert!(guarded <= MOST && guarded > 0.9 * MOST && least < 0.8, "{guarded} {least}");
    // Without the guard a strut would have to be that much faster, and its drive lags.
    let (_, free, _) = fastest("M52 P0");
    assert!(free > 1.1 * MOST, "{free}");
}

/// Returns the largest difference of the tips on the work and of the tool directions of a replay from `expected`, which
/// gets LinuxCNC's pose and the tool vector.
fn drawn_off(
    machine: &str,
    program: &str,
    expected: impl Fn(&[f64; 9], &Vector3<f64>) -> [Vector3<f64>; 2],
) -> f64 {
    let config = config(machine);
    let file = folder(machine).join("programs").join(program);
    let moves = motion::moves(&config.clone().into(), &file, None).unwrap();
    let tools: BTreeMap<u32, [f64; 3]> = moves.iter().map(|step| (step.line, step.tool)).collect();
    let (mut most, mut count) = (0.0_f64, 0);
    replay_seen(&config, &moves, 0.05, |visit| {
        let tool = config.spindle + Vector3::from(tools[&visit.line]);
        let [tip, axis] = visit.on_work.unwrap().map(Vector3::from);
        let [own_tip, own_axis] = expected(&visit.world, &tool);
        most = most.max((tip - own_tip).norm()).max((axis - own_axis).norm());
        count += 1;
    })
    .unwrap();
    assert!(count > 100, "{count}");
    most
}

#[test]
fn a_replay_has_the_tip_on_the_work_and_the_direction_of_the_tool_there() {
    let off = drawn_off(TURRETS, "any-angle.ngc", |[x, y, z, a, b, ..], tool| {
        [
            Vector3::new(*x, *y, *z) - tool,
            about_y(a + b) * tool.try_normalize(0.0).unwrap_or(Vector3::z()),
        ]
    });
    // Rounding of positions of a meter.
    assert!(off < 1e-9, "{off}");
    let off = drawn_off(TABLE, "turning-circle.ngc", |[x, y, z, a, b, c, ..], tool| {
        let leaning = Pose::from_degrees([0.0, 0.0, 0.0, *a, *b, 0.0]).rotation();
        let own = tool.try_normalize(0.0).unwrap_or(Vector3::z());
        [Vector3::new(*x, *y, *z) - tool, about_z(-c) * leaning * own]
    });
    assert!(off < 1e-9, "{off}");
}
