// SPDX-License-Identifier: GPL-2.0-or-later
//! Poses a second of inverse over a whole workspace: in a loop, and in batches on one core and
//! more. Times are printed, never asserted; what stays are the ratios of one run.

use kinematics::{Machine, Pose, Vector3};
use pkm::batch;
use pkm::machine::MachineConfig;
use std::hint::black_box;
use std::num::NonZero;
use std::path::Path;
use std::time::Instant;

/// Poses a scan, and scans of each kind in turns; the median counts.
const POSES: u32 = 200_000;
const SCANS: usize = 11;

/// A raster about home: 50 units and 10 degrees either way, whatever is active.
fn raster(config: &MachineConfig) -> Vec<Pose> {
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

/// Seconds of one scan.
fn timed(scan: impl FnOnce()) -> f64 {
    let start = Instant::now();
    scan();
    start.elapsed().as_secs_f64()
}

fn one_by_one(machine: &Machine, poses: &[Pose], tool: &Vector3<f64>) {
    for pose in poses {
        let _ = black_box(machine.inverse(pose, tool));
    }
}

fn row(config: &MachineConfig, name: &str, cores: &[NonZero<usize>]) {
    let (machine, tool) = (&config.machine, &config.spindle);
    let poses = raster(config);
    let mut seconds = vec![Vec::new(); cores.len() + 1];
    for _ in 0..SCANS {
        seconds[0].push(timed(|| one_by_one(machine, &poses, tool)));
        for (times, cores) in seconds[1..].iter_mut().zip(cores) {
            times.push(timed(|| {
                black_box(batch::inverse(machine, &poses, tool, *cores));
            }));
        }
    }
    let found = poses.iter().filter(|pose| machine.inverse(pose, tool).is_ok()).count();
    let rate = |times: &mut Vec<f64>| {
        times.sort_by(f64::total_cmp);
        format!("{:.1}", f64::from(POSES) / times[SCANS / 2] * 1e-6)
    };
    let rates: Vec<String> = seconds.iter_mut().map(rate).collect();
    println!("| {name} | {found} of {POSES} | {} |", rates.join(" | "));
}

fn main() {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    let most = std::thread::available_parallelism().unwrap_or(NonZero::<usize>::MIN);
    let mut cores = vec![NonZero::<usize>::MIN];
    cores.extend((most.get() > 1).then_some(most));
    let columns: Vec<String> = cores.iter().map(|n| format!("batch, threads: {n}")).collect();
    println!("\nInverse over a raster of poses, in million poses a second:\n");
    println!("| machine | within reach | one by one | {} |", columns.join(" | "));
    println!("|---|--:|--:|{}", "--:|".repeat(columns.len()));
    for name in ["hexapod", "six-rod-lathe", "pyramid"] {
        let config = MachineConfig::read(&configs.join(format!("{name}/{name}.ini"))).unwrap();
        row(&config, name, &cores);
    }
}
