// SPDX-License-Identifier: GPL-2.0-or-later
//! The stack that calls actually use, measured with a painted stack: never more than the sum that `cargo xtask prove`
//! computes from the file.

use abi_tests::module::{Jacobian, Joints, Module, Pose, pkmkins_path};
use abi_tests::random::Random;
use abi_tests::subjects::{Subject, subjects};
use prove::built::Built;
use prove::graph::Graph;
use std::ffi::c_void;
use std::ptr::null_mut;

/// Size of a stack, in bytes.
const SIZE: usize = 1 << 20;

const PAINT: u8 = 0xa5;

/// Largest size of the frames between the mark and the module: of this file's closure, of the
/// call's wrapper and of the stub HAL; the Jacobian's has its result twice.
const BETWEEN: usize = 512;
const BETWEEN_JACOBIAN: usize = BETWEEN + 2 * size_of::<Jacobian>();

/// Largest ratio of the sum to the measurement. The sum assumes that the largest frames meet; otherwise it is
/// too large, but a larger ratio would make it meaningless.
const TOO_WIDE: usize = 3;

/// A painted stack and its task.
struct Job<'a> {
    run: &'a mut dyn FnMut(),
    /// Address of the frame that calls it.
    mark: usize,
}

extern "C" fn on_paint(job: *mut c_void) -> *mut c_void {
    let place = 0_u8;
    // SAFETY: `used` waits with the job until this thread has ended.
    let job = unsafe { &mut *job.cast::<Job<'_>>() };
    job.mark = &raw const place as usize;
    (job.run)();
    null_mut()
}

/// Returns the bytes of stack that `run` uses, on a separate thread.
fn used(run: &mut dyn FnMut()) -> usize {
    let mut stack = vec![PAINT; SIZE + 4096];
    let bottom = stack.as_mut_ptr() as usize;
    let aligned = bottom.next_multiple_of(4096);
    let mut job = Job { run, mark: 0 };
    // SAFETY: attributes are initialized before use; the stack and the job outlive the thread, which
    // is joined; no other code accesses either in between.
    unsafe {
        let mut attributes = std::mem::zeroed::<libc::pthread_attr_t>();
        assert_eq!(libc::pthread_attr_init(&mut attributes), 0);
        let set = libc::pthread_attr_setstack(&mut attributes, aligned as *mut c_void, SIZE);
        assert_eq!(set, 0);
        let mut thread = std::mem::zeroed::<libc::pthread_t>();
        let argument = (&raw mut job).cast();
        assert_eq!(libc::pthread_create(&mut thread, &attributes, on_paint, argument), 0);
        assert_eq!(libc::pthread_join(thread, null_mut()), 0);
        libc::pthread_attr_destroy(&mut attributes);
    }
    // SAFETY: the thread has ended; the bytes are those of the vector, read back as they are.
    let painted = unsafe { std::slice::from_raw_parts(aligned as *const u8, SIZE) };
    let lowest = painted.iter().position(|byte| *byte != PAINT).expect("a thread has a stack");
    job.mark - (aligned + lowest)
}

/// Returns the stack of an entry point according to the file.
fn promised(entry: &str) -> usize {
    let data = std::fs::read(pkmkins_path()).expect("the module can be read");
    let built = Built::read(&data).expect("a library");
    let function = built.function_named(entry).expect("an entry point");
    Graph::new(&built).reached(function.address).stack as usize
}

/// Returns a pose of the workspace, one far off, one that is unreachable.
fn poses(subject: &Subject) -> Vec<Pose> {
    let mut random = Random::new(81);
    let mut poses = vec![subject.home()];
    for _ in 0..20 {
        poses.push((subject.sample)(&mut random));
    }
    let wild = poses.clone();
    for pose in wild {
        poses.push(std::array::from_fn(|i| pose[i] * random.within(3.0)));
    }
    poses.push([f64::NAN; 9]);
    poses
}

/// Creates a module with the pins of a machine, which its first call or the monitor freezes.
fn wired(subject: &Subject) -> Module {
    let module = subject.machine.loaded();
    subject.machine.wire(&module);
    module
}

fn frozen(subject: &Subject) -> Module {
    subject.machine.module()
}

/// Poses to calculate, and joints of those that have some.
struct Asked {
    poses: Vec<Pose>,
    joints: Vec<Joints>,
}

/// Compares the largest use of a call with any machine to the value from the file.
fn compare(entry: &str, between: usize, made: fn(&Subject) -> Module, call: fn(&Module, &Asked)) {
    let mut most = 0;
    for subject in subjects() {
        let other = frozen(&subject);
        let poses = poses(&subject);
        let joints = poses.iter().filter_map(|pose| other.inverse(pose).ok()).collect();
        let (module, asked) = (made(&subject), Asked { poses, joints });
        most = most.max(used(&mut || call(&module, &asked)));
    }
    let promised = promised(entry);
    println!("{entry}: {most} bytes used of {promised}");
    assert!(most <= promised + between, "{entry}: {most} bytes used of {promised}");
    assert!(promised <= TOO_WIDE * most, "{entry}: {most} bytes used of {promised}");
}

#[test]
fn inverse_stays_within_what_the_file_says() {
    compare("kinematicsInverse", BETWEEN, wired, |module, asked| {
        for pose in &asked.poses {
            let _ = module.inverse(pose);
        }
    });
}

#[test]
fn forward_stays_within_what_the_file_says() {
    compare("kinematicsForward", BETWEEN, wired, |module, asked| {
        for joints in &asked.joints {
            for seed in &asked.poses {
                let _ = module.forward(joints, seed);
            }
        }
    });
}

#[test]
fn frames_and_rates_stay_within_what_the_file_says() {
    compare("kinematicsToolFrame", BETWEEN, frozen, |module, asked| {
        for joints in &asked.joints {
            let _ = module.tool_frame(joints);
        }
    });
    compare("kinematicsJacobian", BETWEEN_JACOBIAN, frozen, |module, asked| {
        for pose in &asked.poses {
            let _ = module.jacobian(&[0.0; 16], pose);
        }
    });
}

#[test]
fn the_monitor_stays_within_what_the_file_says() {
    compare("pkmkins::abi::monitor", BETWEEN, wired, |module, _| {
        module.apply();
        assert!(module.is_on("geometry-ok"));
        module.monitor();
    });
}
