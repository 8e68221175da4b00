// SPDX-License-Identifier: GPL-2.0-or-later
//! Poses per second of inverse over a whole workspace, in a loop and in batches on one core and more,
//! positions per second of a workspace study, stability in the cut, and programs judged before
//! cutting. Times are printed, never asserted; only the ratios within one run are reproducible.

use kinematics::{Machine, Pose, Vector3};
use linuxcnc::process::Options;
use linuxcnc::row::Row;
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use program::motion::LINUXCNC_PROGRAMS;
use program::preflight::judge;
use program::report::Time;
use program::work_offset::Offset;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::fmt::Write;
use std::fs;
use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::time::Instant;
use studies::stability::lobes::Lobes;
use studies::stability::map::StableMap;
use studies::stability::pose::Setup;
use studies::study::body::{Body, Effort, counted};
use studies::study::file::Study;
use studies::study::workspace::Workspace;

/// Lines of the long program.
const LINES: u32 = 1_000_000;

/// Number of poses per scan, and of alternating scans of each kind; the median counts.
const POSES: u32 = 200_000;
const SCANS: usize = 11;

/// Number of rays from pole to pole, of steps along one, and of grid points along its longest side.
const BANDS: usize = 24;
const STEPS: f64 = 300.0;
const GRID: usize = 60;

/// Returns a raster about home: 50 units and 10 degrees in either direction, also for inactive coordinates.
fn raster(config: &Mechanism) -> Vec<Pose> {
    let home = config.home_pose().to_degrees();
    let layout = config.machine.layout();
    let active = kinematics::Letter::ALL.map(|letter| !layout.is_held(letter));
    let pose = |n: u32| {
        let mut pose = home;
        for (k, value) in pose.iter_mut().enumerate().filter(|(k, _)| active[*k]) {
            let share = f64::from(n % (11 + 2 * k as u32)) / f64::from(10 + 2 * k as u32);
            *value += (2.0 * share - 1.0) * if k < 3 { 50.0 } else { 10.0 };
        }
        Pose::from_degrees(pose)
    };
    (0..POSES).map(pose).collect()
}

/// Formats millions per second, from the median of times.
fn millions(count: f64, times: &mut [f64]) -> String {
    times.sort_by(f64::total_cmp);
    format!("{:.1}", count / times[times.len() / 2] * 1e-6)
}

fn one_by_one(machine: &Machine, poses: &[Pose], tool: &Vector3<f64>) {
    for pose in poses {
        let _ = black_box(machine.inverse(pose, tool));
    }
}

fn row(config: &Mechanism, name: &str, cores: &[ThreadPool]) {
    let (machine, tool) = (&config.machine, &config.spindle);
    let poses = raster(config);
    let mut seconds = vec![Vec::new(); cores.len() + 1];
    for _ in 0..SCANS {
        seconds[0].push(seconds_of(|| one_by_one(machine, &poses, tool)).1);
        for (times, cores) in seconds[1..].iter_mut().zip(cores) {
            let scan = || {
                let joints = poses.par_iter().map(|pose| machine.inverse(pose, tool));
                black_box(cores.install(|| joints.collect::<Vec<_>>()));
            };
            times.push(seconds_of(scan).1);
        }
    }
    let found = poses.iter().filter(|pose| machine.inverse(pose, tool).is_ok()).count();
    let rates: Vec<String> =
        seconds.iter_mut().map(|times| millions(f64::from(POSES), times)).collect();
    println!("| {name} | {found} of {POSES} | {} |", rates.join(" | "));
}

/// Measures rays and a grid over the whole level workspace of a machine, as `pkm workspace` does.
fn looked_over(config: &Mechanism, name: &str, cores: &[ThreadPool]) {
    let workspace =
        Workspace::new(config, config.spindle, vec![[0.0; 3]], &Study::default()).unwrap();
    let from = config.home_pose().position;
    let look = || {
        let step = workspace.extent() / STEPS;
        let effort = Effort { bands: BANDS, step, grid: GRID, progress: &|_| () };
        let body = Body::seen(&workspace, from, &effort).unwrap();
        body.looked() + counted(&workspace, &body.corners(), &effort).points
    };
    let positions = look();
    let mut seconds = vec![Vec::new(); cores.len()];
    for _ in 0..SCANS {
        for (times, cores) in seconds.iter_mut().zip(cores) {
            times.push(seconds_of(|| black_box(cores.install(look))).1);
        }
    }
    let rates: Vec<String> =
        seconds.iter_mut().map(|times| millions(positions as f64, times)).collect();
    println!("| {name} | {positions} | {} |", rates.join(" | "));
}

/// Returns straight lines of half a millimeter each about the center of the workspace: a spiral
/// outward and inward.
fn long_program() -> String {
    let mut text = String::from("G21 G90 G64\nM52 P1\nG0 X0 Y0 Z220\n");
    for n in 0..LINES {
        let turn = f64::from(n) * 0.02;
        let radius = 25.0 + 20.0 * (f64::from(n) * 1e-4).sin();
        let (x, y) = (radius * turn.cos(), radius * turn.sin());
        let z = 220.0 + 10.0 * (turn * 0.1).sin();
        // Writing to a String does not fail.
        let _ = writeln!(text, "G1 X{x:.4} Y{y:.4} Z{z:.4} F12000");
    }
    text + "M2\n"
}

/// Returns the largest memory of this process so far, MB.
fn memory() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse::<f64>().ok().map(|kilobytes| kilobytes / 1024.0)
}

/// Measures the judgement of a program as by `pkm preflight`.
fn judged(config: &MachineConfig, name: &str, program: &Path, offset: &Offset) {
    let options = Options { block: Some(offset.block()), ..Options::default() };
    let mut lines = 0;
    let mut see = |row: &Row| lines = lines.max(row.line);
    let (judged, seconds) = seconds_of(|| judge(config, program, &options, &mut see).unwrap());
    let machine = match judged.found.time {
        Time::Judged(timing) => timing.seconds,
        Time::NotJudged(cause) => panic!("{name}: {cause}"),
    };
    println!(
        "| {name} | {lines} | {} | {machine:.0} s | {seconds:.1} s | {:.0} | {:.0} | {:.0} MB |",
        judged.found.pieces,
        machine / config.period / seconds,
        machine / seconds,
        memory().unwrap_or(f64::NAN)
    );
}

/// Number of spindle speeds of the lobes, and of positions along each side of the map of limit depths.
const SPEEDS: usize = 1000;
const SIDE: usize = 100;

/// Measures stability in the cut: lobes at a pose, unstable depths there, limit depths over many poses.
fn stability(configs: &Path, cores: &[ThreadPool]) {
    let config = MachineConfig::read(&configs.join("hexapod/hexapod.ini")).unwrap();
    let study = Study::read(&configs.join("hexapod/cutting.toml")).unwrap();
    let setup = Setup::new(config.first(), &study).unwrap();
    let (pose, tool) = (config.first().home_pose(), config.first().spindle);
    let rows = setup.rows(&pose, &tool, &Vector3::x()).unwrap();
    let speeds: Vec<f64> =
        (0..SPEEDS).map(|k| 3000.0 + 15_000.0 * k as f64 / SPEEDS as f64).collect();
    let lobes = || {
        let lobes = Lobes::new(&rows, &setup.process, speeds[0]);
        speeds.par_iter().map(|rpm| lobes.limit(*rpm)).collect::<Vec<_>>()
    };
    let depths = || StableMap::new(&rows, &setup.process, [3000.0, 18_000.0], 5.0, 61, |_| ());
    let places = || {
        let place = |n: usize| {
            let mut at = pose;
            at.position.x = -150.0 + 300.0 * (n % SIDE) as f64 / SIDE as f64;
            at.position.y = -150.0 + 300.0 * (n / SIDE) as f64 / SIDE as f64;
            setup.least(&at, &tool, None).unwrap()
        };
        (0..SIDE * SIDE).into_par_iter().map(place).collect::<Vec<_>>()
    };
    let row = |name: &str, work: &(dyn Fn() + Sync)| {
        let times = cores.iter().map(|cores| seconds_of(|| cores.install(work)).1);
        let times: Vec<String> = times.map(|time| format!("{time:.2} s")).collect();
        println!("| {name} | {} |", times.join(" | "));
    };
    row("lobes of 1,000 spindle speeds at a pose", &|| drop(black_box(lobes())));
    row("unstable depths by collocation, from 61 speeds on", &|| drop(black_box(depths())));
    row("limit depths at 10,000 poses, 18 feeds each", &|| drop(black_box(places())));
}

/// Number of rows of 80 mm, each of which takes eight seconds at 600 mm/min.
const HOUR_ROWS: u32 = 440;

/// Returns about an hour of milling: a surface of waves, in rows of lines of two millimeters.
fn hour_of_milling() -> String {
    let mut text = String::from("G21 G90 G64 P0.01\nS9000 M3\nG0 X-40 Y-40 Z220\n");
    for row in 0..HOUR_ROWS {
        let y = 80.0 * f64::from(row) / f64::from(HOUR_ROWS) - 40.0;
        for k in 0..=40 {
            let x =
                if row % 2 == 0 { 2.0 * f64::from(k) - 40.0 } else { 40.0 - 2.0 * f64::from(k) };
            let z = 220.0 + 3.0 * (x * 0.08).sin() * (y * 0.05).cos();
            let _ = writeln!(text, "G1 X{x:.4} Y{y:.4} Z{z:.4} F600");
        }
    }
    text + "M5\nM2\n"
}

/// Measures the cutting report of an hour-long program, as the command writes it.
fn cutting_report(configs: &Path) {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("hour.ngc");
    fs::write(&program, hour_of_milling()).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_pkm"));
    command.arg("cut").arg(configs.join("hexapod/hexapod.ini")).arg(program);
    command.arg("--study").arg(configs.join("hexapod/cut.toml")).args(["--format", "json"]);
    let (output, seconds) = seconds_of(|| command.output().unwrap());
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    println!("\n`pkm cut` of a long program on the hexapod, LinuxCNC's run of it included:\n");
    println!("| machine's time | moments judged | places of stability | wall time |");
    println!("|--:|--:|--:|--:|");
    println!(
        "| {:.0} s | {} | {} | {seconds:.1} s |",
        found["seconds"].as_f64().unwrap(),
        found["moments"],
        found["stability"]["places"]
    );
}

/// Returns a result and its computation time.
fn seconds_of<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed().as_secs_f64())
}

fn programs(configs: &Path) {
    let config = MachineConfig::read(&configs.join("hexapod/hexapod.ini")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let long = folder.path().join("long.ngc");
    fs::write(&long, long_program()).unwrap();
    println!(
        "\nPrograms judged by preflight on the hexapod; memory is the most of this process so far:\n"
    );
    println!(
        "| program | lines | pieces | machine's time | judged in | cycles a second | times real time | memory |"
    );
    println!("|---|--:|--:|--:|--:|--:|--:|--:|");
    let chips = Path::new(LINUXCNC_PROGRAMS).join("3D_Chips.ngc");
    judged(&config, "3D_Chips.ngc", &chips, &Offset { shift: [0.0, 0.0, 140.0], turn: 0.0 });
    judged(&config, "spiral", &long, &Offset { shift: [0.0; 3], turn: 0.0 });
}

fn main() {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    let pool = |threads: usize| ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let most = std::thread::available_parallelism().map_or(1, usize::from);
    let mut cores = vec![pool(1)];
    cores.extend((most > 1).then(|| pool(most)));
    let threads = || cores.iter().map(ThreadPool::current_num_threads);
    let columns: Vec<String> = threads().map(|n| format!("batch, threads: {n}")).collect();
    println!("\nInverse over a raster of poses, in million poses a second:\n");
    println!("| machine | within reach | one by one | {} |", columns.join(" | "));
    println!("|---|--:|--:|{}", "--:|".repeat(columns.len()));
    for name in ["hexapod", "six-rod-lathe", "pyramid"] {
        let config = MachineConfig::read(&configs.join(format!("{name}/{name}.ini"))).unwrap();
        row(config.first(), name, &cores);
    }
    let columns: Vec<String> = threads().map(|n| format!("threads: {n}")).collect();
    println!("\nPositions of `pkm workspace`, every limit checked, in millions a second:\n");
    println!("| machine | positions | {} |", columns.join(" | "));
    println!("|---|--:|{}", "--:|".repeat(columns.len()));
    for name in ["hexapod", "six-rod-lathe", "linear-delta"] {
        let config = MachineConfig::read(&configs.join(format!("{name}/{name}.ini"))).unwrap();
        looked_over(config.first(), name, &cores);
    }
    println!("\nStability in the cut of the hexapod:\n");
    println!("| answer | {} |", columns.join(" | "));
    println!("|---|{}", "--:|".repeat(columns.len()));
    stability(&configs, &cores);
    cutting_report(&configs);
    programs(&configs);
}
