// SPDX-License-Identifier: GPL-2.0-or-later
//! Inverse and forward solutions of the rows of a file in batches, to be run alternately with other programs:
//!
//! ```text
//! cargo bench -p pkm --bench batch -- MACHINE.ini ROWS
//! ```
//!
//! ROWS are poses of six little-endian float64, machine units and degrees. For each line of the standard input,
//! `inverse` or `forward`, the response is the time in seconds, conversion to radians included, as in Python. Forward
//! starts 0.1 units and 0.01 degrees away from the true poses. `RAYON_NUM_THREADS` limits the cores.

use kinematics::{MAX_JOINTS, Pose};
use machine::read::machine::MachineConfig;
use rayon::prelude::*;
use std::hint::black_box;
use std::io::stdin;
use std::path::Path;
use std::time::Instant;

/// Bytes of a number, and numbers of a pose.
const NUMBER: usize = 8;
const POSE: usize = 6;

fn rows(file: &str) -> Vec<[f64; POSE]> {
    let bytes = std::fs::read(file).unwrap();
    let number = |bytes: &[u8]| f64::from_le_bytes(bytes.try_into().unwrap());
    let row = |bytes: &[u8]| std::array::from_fn(|k| number(&bytes[k * NUMBER..(k + 1) * NUMBER]));
    bytes.chunks_exact(POSE * NUMBER).map(row).collect()
}

fn main() {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let config = MachineConfig::read(Path::new(&given[0])).unwrap().mechanism(1).unwrap();
    let (machine, tool) = (&config.machine, &config.spindle);
    let rows = rows(&given[1]);
    let seeds = rows.iter().map(|[x, y, z, a, b, c]| [x + 0.1, *y, *z, a + 0.01, *b, *c]);
    let seeds: Vec<_> = seeds.collect();
    // Results are written in place: returning each one would double the time.
    let inverse = || {
        let mut joints = vec![[0.0; MAX_JOINTS]; rows.len()];
        rows.par_iter().zip(&mut joints).for_each(|(row, joints)| {
            *joints = machine.inverse(&Pose::from_degrees(*row), tool).unwrap();
        });
        joints
    };
    let joints = inverse();
    let forward = || {
        let found = joints.par_iter().zip(&seeds).map(|(joints, seed)| {
            let seed = Pose::from_degrees(*seed);
            machine.forward(joints, &seed, tool, &config.solver).map(|found| found.pose)
        });
        found.collect::<Vec<_>>()
    };
    for line in stdin().lines() {
        let start = Instant::now();
        match line.unwrap().as_str() {
            "inverse" => drop(black_box(inverse())),
            "forward" => drop(black_box(forward())),
            other => panic!("{other}: expected inverse or forward"),
        }
        println!("{}", start.elapsed().as_secs_f64());
    }
}
