// SPDX-License-Identifier: GPL-2.0-or-later
//! Exactly as many joints as the machine has are read and written: there is no accessible memory after an
//! array of this length.

use abi_tests::module::{Module, Pose};
use abi_tests::random::Random;
use abi_tests::subjects::subjects;
use std::ptr::NonNull;

/// An array that ends at the end of the accessible memory.
struct AtTheEdge {
    pages: NonNull<libc::c_void>,
    page: usize,
    count: usize,
}

impl AtTheEdge {
    fn new(count: usize) -> AtTheEdge {
        // SAFETY: asks the system for its page size, and for two fresh pages of which
        // the second is then closed.
        unsafe {
            let page = usize::try_from(libc::sysconf(libc::_SC_PAGESIZE)).expect("a size");
            let flags = libc::MAP_PRIVATE | libc::MAP_ANONYMOUS;
            let access = libc::PROT_READ | libc::PROT_WRITE;
            let pages = libc::mmap(std::ptr::null_mut(), 2 * page, access, flags, -1, 0);
            assert_ne!(pages, libc::MAP_FAILED);
            assert_eq!(libc::mprotect(pages.byte_add(page), page, libc::PROT_NONE), 0);
            AtTheEdge { pages: NonNull::new(pages).expect("not null"), page, count }
        }
    }

    fn values(&mut self) -> &mut [f64] {
        // SAFETY: the last `count` numbers of the open page, borrowed from self.
        unsafe {
            let end = self.pages.as_ptr().byte_add(self.page).cast::<f64>();
            std::slice::from_raw_parts_mut(end.sub(self.count), self.count)
        }
    }

    /// Returns the number before the array.
    fn before(&self) -> f64 {
        // SAFETY: inside the open page, which is zeros until written.
        unsafe { self.pages.as_ptr().byte_add(self.page).cast::<f64>().sub(self.count + 1).read() }
    }
}

impl Drop for AtTheEdge {
    fn drop(&mut self) {
        // SAFETY: mapped in `new`, unmapped once.
        unsafe { libc::munmap(self.pages.as_ptr(), 2 * self.page) };
    }
}

/// Calls inverse and forward with arrays of exactly `count`; returns the resulting pose.
fn round_trip(module: &Module, pose: &Pose, count: usize) -> Pose {
    let mut array = AtTheEdge::new(count);
    // SAFETY: the array is as long as the machine has joints; that is what is tested.
    let code = unsafe { module.inverse_exactly(pose, array.values()) };
    assert_eq!(code, 0, "{pose:?}");
    assert_eq!(array.before(), 0.0);
    let mut world = *pose;
    // SAFETY: as above.
    let code = unsafe { module.forward_exactly(array.values(), &mut world) };
    assert_eq!(code, 0, "{pose:?}");
    world
}

/// The same machine with two extra axes.
#[test]
fn nothing_behind_the_last_extra_axis_is_touched() {
    for subject in subjects() {
        let module = subject.machine.loaded_with(&[("axes", "UW")]);
        assert!(subject.machine.apply(&module), "{}", subject.name);
        let mut pose = (subject.sample)(&mut Random::new(62));
        [pose[6], pose[8]] = [3.0, -4.0];
        let found = round_trip(&module, &pose, subject.machine.joints() + 2);
        assert_eq!([found[6], found[8]], [3.0, -4.0], "{}", subject.name);
    }
}

#[test]
fn nothing_behind_the_last_joint_is_touched_by_the_machine() {
    for subject in subjects() {
        let module = subject.machine.module();
        let count = subject.machine.joints();
        let pose = (subject.sample)(&mut Random::new(61));
        let joints = module.inverse(&pose).expect("a pose of the workspace");
        let mut array = AtTheEdge::new(count);
        // SAFETY: as in `round_trip`.
        unsafe { module.inverse_exactly(&pose, array.values()) };
        assert_eq!(*array.values(), joints[..count], "{}", subject.name);
        let other = subject.machine.module();
        assert_eq!(Ok(round_trip(&other, &pose, count)), module.follow(&joints, &pose));
    }
}

#[test]
fn nothing_behind_the_last_joint_is_touched_by_the_identity() {
    for subject in subjects().into_iter().filter(|s| s.machine.table.is_empty()) {
        let module = subject.machine.module();
        assert_eq!(module.switch(1), 0, "{}", subject.name);
        let pose = (subject.sample)(&mut Random::new(62));
        assert_eq!(round_trip(&module, &pose, subject.machine.joints()), pose);
    }
}

/// LinuxCNC's values of other joints in its longer array stay, and are not read.
#[test]
fn guards_behind_the_joints_stay_and_may_be_nan() {
    for subject in subjects() {
        let module = subject.machine.module();
        let count = subject.machine.joints();
        let pose = (subject.sample)(&mut Random::new(63));
        let mut joints = [7.0; 16];
        assert_eq!(module.inverse_into(&pose, &mut joints), 0);
        assert!(joints[count..].iter().all(|guard| *guard == 7.0), "{}", subject.name);
        let clean = module.follow(&joints, &pose).expect("its own joints");
        joints[count..].fill(f64::NAN);
        let other = subject.machine.module();
        assert_eq!(other.follow(&joints, &pose), Ok(clean), "{}", subject.name);
        assert!(module.tool_frame(&joints).is_ok(), "{}", subject.name);
    }
}
