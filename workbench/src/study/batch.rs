// SPDX-License-Identifier: GPL-2.0-or-later
//! The kinematics over many poses at once, as a scan of a workspace asks for them: the kernels
//! of the servo thread, on as many threads as wanted.

use kinematics::{Fault, Joints, Machine, Pose, Vector3};
use std::num::NonZero;

/// Joints of every pose, in order; bit by bit what [`Machine::inverse`] gives one by one.
pub fn inverse(
    machine: &Machine,
    poses: &[Pose],
    tool: &Vector3<f64>,
    threads: NonZero<usize>,
) -> Vec<Result<Joints, Fault>> {
    each(poses, threads, |pose| machine.inverse(pose, tool))
}

/// `f` of every item, in order. Each thread takes one run of them.
///
/// # Panics
/// If `f` does.
pub fn each<T: Sync, U: Send>(
    items: &[T],
    threads: NonZero<usize>,
    f: impl Fn(&T) -> U + Sync,
) -> Vec<U> {
    let run = |part: &[T]| -> Vec<U> { part.iter().map(&f).collect() };
    if threads.get() == 1 {
        return run(items);
    }
    let parts = items.chunks(items.len().div_ceil(threads.get()).max(1));
    std::thread::scope(|scope| {
        let workers: Vec<_> = parts.map(|part| scope.spawn(|| run(part))).collect();
        let mut results = Vec::with_capacity(items.len());
        for worker in workers {
            results.extend(worker.join().expect("what panics there has been told"));
        }
        results
    })
}
