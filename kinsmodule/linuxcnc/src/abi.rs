// SPDX-License-Identifier: GPL-2.0-or-later
//! The functions that LinuxCNC calls. Each checks pointers and passes LinuxCNC's poses and arrays to [`Control`].
#![allow(missing_docs, reason = "LinuxCNC's layouts; their headers document the fields")]
#![allow(non_camel_case_types, reason = "LinuxCNC's names")]

use crate::component::control;
use crate::control::{Control, MOST_JOINTS};
use crate::module::Kind;
use crate::orient::{FOUND, Request};
use core::ffi::{c_int, c_long, c_uint, c_ulong, c_void};
use kinematics::{Cause, Fault, Matrix3, Vector3, World};

/// LinuxCNC's kinematics types.
#[cfg(not(any(kinematics_h, linuxcnc_kinematics_h)))]
#[repr(C)]
pub enum KinematicsKind {
    KINEMATICS_IDENTITY = 1,
    KINEMATICS_FORWARD_ONLY,
    KINEMATICS_INVERSE_ONLY,
    KINEMATICS_BOTH,
}

/// An alias, because LinuxCNC's type has no tag.
#[cfg(not(any(kinematics_h, linuxcnc_kinematics_h)))]
pub type KINEMATICS_TYPE = KinematicsKind;

/// Flags that LinuxCNC passes; not read.
#[cfg(not(any(kinematics_h, linuxcnc_kinematics_h)))]
pub type KINEMATICS_FORWARD_FLAGS = c_ulong;

/// Flags that LinuxCNC passes; not read.
#[cfg(not(any(kinematics_h, linuxcnc_kinematics_h)))]
pub type KINEMATICS_INVERSE_FLAGS = c_ulong;

/// LinuxCNC's PmCartesian.
#[cfg(not(any(posemath_h, linuxcnc_posemath_h)))]
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CartesianVector {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// An alias, because LinuxCNC's type has no tag.
#[cfg(not(any(posemath_h, linuxcnc_posemath_h)))]
pub type PmCartesian = CartesianVector;

/// LinuxCNC's EmcPose: machine units and degrees.
#[cfg(not(any(emcpos_h, linuxcnc_emcpos_h)))]
#[repr(C)]
#[derive(Clone, Copy)]
pub struct EmcPose {
    pub tran: PmCartesian,
    pub a: f64,
    pub b: f64,
    pub c: f64,
    pub u: f64,
    pub v: f64,
    pub w: f64,
}

/// LinuxCNC's PmRotationMatrix: three column vectors.
#[cfg(not(any(posemath_h, linuxcnc_posemath_h)))]
#[repr(C)]
#[derive(Clone, Copy)]
pub struct RotationColumns {
    pub x: PmCartesian,
    pub y: PmCartesian,
    pub z: PmCartesian,
}

/// An alias, because LinuxCNC's type has no tag.
#[cfg(not(any(posemath_h, linuxcnc_posemath_h)))]
pub type PmRotationMatrix = RotationColumns;

// An `EmcPose` is read and written as a `World`.
const _: () = assert!(size_of::<EmcPose>() == size_of::<World>());
const _: () = assert!(core::mem::offset_of!(EmcPose, w) == 8 * size_of::<f64>());

/// Converts a result to the return value of a C function: 0, or the code of the cause.
fn code<T>(result: Result<T, Fault>) -> c_int {
    result.map_or_else(|fault| fault.cause.code(), |_| 0)
}

/// Returns the joint values; `None` for a null pointer.
///
/// # Safety
/// `joint` must be null or point to as many values as the machine has joints, and these must not
/// change during the call.
unsafe fn joints<'a>(joint: *const f64, control: &Control) -> Option<&'a [f64]> {
    // SAFETY: the caller guarantees the values.
    (!joint.is_null()).then(|| unsafe { core::slice::from_raw_parts(joint, control.joints()) })
}

/// Computes the pose of the joints. `world` is the seed and receives the pose.
///
/// Returns 0, or a negative code (see the table of causes). On failure the coordinates of `world` that the
/// machine moves are NaN: LinuxCNC ignores the result in some places, and only NaN stops it safely. Before
/// homing (all joints 0, no pose known yet) a failure leaves `world` unchanged. On success the coordinates that
/// the machine fixes are 0, those of extra axes are the values of their joints, and the others of U V W stay.
///
/// # Safety
/// `joint` must be null or point to as many values as the machine has joints; `world` null or valid; the flags
/// are not read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kinematicsForward(
    joint: *const f64,
    world: *mut EmcPose,
    _fflags: *const KINEMATICS_FORWARD_FLAGS,
    _iflags: *mut KINEMATICS_INVERSE_FLAGS,
) -> c_int {
    // SAFETY: LinuxCNC passes its joint array and pose, from its servo thread.
    let (world, control) = unsafe { (world.cast::<World>().as_mut(), control()) };
    let Some(world) = world else { return Cause::NullPointer.code() };
    let Some(control) = control else {
        let [pose @ .., _, _, _] = world;
        *pose = [f64::NAN; 6];
        return Cause::NullPointer.code();
    };
    // SAFETY: the array holds as many values as the machine has joints.
    let Some(joints) = (unsafe { joints(joint, control) }) else {
        control.refuse(world);
        return Cause::NullPointer.code();
    };
    code(control.forward(joints, world))
}

/// Computes the joints of a pose.
///
/// Returns 0, or a negative code (see the table of causes). On failure `joint` stays unchanged.
///
/// # Safety
/// `world` must be null or valid; `joint` null or room for as many values as the machine has joints; the
/// flags are not read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kinematicsInverse(
    world: *const EmcPose,
    joint: *mut f64,
    _iflags: *const KINEMATICS_INVERSE_FLAGS,
    _fflags: *mut KINEMATICS_FORWARD_FLAGS,
) -> c_int {
    // SAFETY: LinuxCNC passes its pose and joint array, from its servo thread.
    let (world, control) = unsafe { (world.cast::<World>().as_ref(), control()) };
    let (Some(world), false, Some(control)) = (world, joint.is_null(), control) else {
        return Cause::NullPointer.code();
    };
    // SAFETY: the array has room for as many values as the machine has joints.
    let joints = unsafe { core::slice::from_raw_parts_mut(joint, control.joints()) };
    code(control.inverse(world, joints))
}

/// Computes ∂ joint / ∂ pose at `world`: `jac[j][a]` in joint units per pose unit (degrees!);
/// rows beyond the last joint are zero.
///
/// Returns 0, or −1 and leaves `jac` unchanged.
///
/// # Safety
/// `world` must be null or valid, `jac` null or room for 16 × 9 values; the other
/// arguments are not read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kinematicsJacobian(
    _joint: *const f64,
    world: *const EmcPose,
    jac: *mut [f64; 9],
    _iflags: *const KINEMATICS_INVERSE_FLAGS,
) -> c_int {
    // SAFETY: LinuxCNC passes its pose and a 16 × 9 array, from its servo thread.
    let (world, jac, control) = unsafe {
        (world.cast::<World>().as_ref(), jac.cast::<[World; MOST_JOINTS]>().as_mut(), control())
    };
    let (Some(world), Some(jac), Some(control)) = (world, jac, control) else {
        return -1;
    };
    let Ok(rows) = control.jacobian(world) else { return -1 };
    *jac = rows;
    0
}

/// Computes the tool axes in world coordinates as columns; z points from the tip to the holder.
///
/// Returns 0, or −1 and leaves `rot` unchanged, also if any joint is NaN or infinite.
///
/// # Safety
/// `joint` must be null or point to as many values as the machine has joints; `rot` null or valid; the flags are
/// not read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kinematicsToolFrame(
    joint: *const f64,
    rot: *mut PmRotationMatrix,
    _fflags: *const KINEMATICS_FORWARD_FLAGS,
) -> c_int {
    // SAFETY: LinuxCNC passes its joint array and a matrix, from its servo thread.
    let (Some(rot), Some(control)) = (unsafe { (rot.as_mut(), control()) }) else { return -1 };
    // SAFETY: as above.
    let Some([tool, _]) = (unsafe { frames(joint, control) }) else { return -1 };
    *rot = tool;
    0
}

/// Returns the axes of tool and workpiece; `None` if a joint is NaN or infinite, or forward refuses.
///
/// # Safety
/// As [`joints`].
unsafe fn frames(joint: *const f64, control: &Control) -> Option<[RotationColumns; 2]> {
    // SAFETY: the caller guarantees the values.
    let joints = unsafe { joints(joint, control) }?;
    let frames = joints.iter().all(|value| value.is_finite()).then(|| control.frames(joints));
    Some(frames?.ok()?.map(|frame| columns(&frame)))
}

pub(crate) fn columns(frame: &Matrix3<f64>) -> RotationColumns {
    let column = |k: usize| PmCartesian { x: frame[(0, k)], y: frame[(1, k)], z: frame[(2, k)] };
    RotationColumns { x: column(0), y: column(1), z: column(2) }
}

/// Computes the workpiece axes in world coordinates as columns: extra axes that carry the workpiece rotate it, or
/// the platform that it is mounted on. A table only translates it.
///
/// Returns 0, or −1 and leaves `rot` unchanged. The joints are read only if one of them rotates the workpiece.
///
/// # Safety
/// `joint` must be null or point to as many values as the machine has joints; `rot` null or valid; the flags are
/// not read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kinematicsWorkFrame(
    joint: *const f64,
    rot: *mut PmRotationMatrix,
    _fflags: *const KINEMATICS_FORWARD_FLAGS,
) -> c_int {
    // SAFETY: LinuxCNC passes its joint array and a matrix, from its servo thread.
    let (rot, control) = unsafe { (rot.as_mut(), control()) };
    let Some(rot) = rot else { return -1 };
    let Some(control) = control.filter(|control| control.first.turns_work()) else {
        *rot = columns(&Matrix3::identity());
        return 0;
    };
    // SAFETY: as above.
    let Some([_, work]) = (unsafe { frames(joint, control) }) else { return -1 };
    *rot = work;
    0
}

/// Computes joints at which the tool points along `axis_in_work`, and its X along `x_in_work` if that is not null.
///
/// LinuxCNC's X Y Z and the extra axes keep the values that they have at the joints `seed`; of the platform's
/// orientations the nearest is the only solution. Joints whose bit in `held` is set keep their values: with a leg among them
/// there is a solution only if it is the seed. Where the angles reach the axis but not X, `tool_spin` receives the rotation
/// about the axis that remains, radians; otherwise 0. `free_directions` receives the number of directions in which
/// joints could move on.
///
/// Returns the number of solutions, 0 or 1; or −1 without an answer, in the identity kinematics as well.
///
/// # Safety
/// Each pointer must be null or valid; `seed` has as many values as the machine has joints, and `solutions` room for as
/// many times `max_solutions`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kinematicsToolFrameInverse(
    axis_in_work: *const PmCartesian,
    x_in_work: *const PmCartesian,
    seed: *const f64,
    held: c_uint,
    solutions: *mut f64,
    max_solutions: c_int,
    free_directions: *mut c_int,
    tool_spin: *mut f64,
) -> c_int {
    // SAFETY: LinuxCNC passes vectors, from its servo thread, or while none runs.
    let (axis, x, control) = unsafe { (axis_in_work.as_ref(), x_in_work.as_ref(), control()) };
    let (Some(axis), Some(control), false) = (axis, control, solutions.is_null()) else {
        return -1;
    };
    // SAFETY: the array has as many values as the machine has joints.
    let Some(joints) = (unsafe { joints(seed, control) }) else { return -1 };
    let vector = |given: &PmCartesian| Vector3::new(given.x, given.y, given.z);
    let Some(request) = Request::new(vector(axis), x.map(vector)) else { return -1 };
    if max_solutions < 1 || !joints.iter().all(|value| value.is_finite()) {
        return -1;
    }
    let mut found = [0.0; MOST_JOINTS];
    let (free, spin) = match control.oriented(joints, &request, held, &mut found) {
        Err(_) => return -1,
        Ok(None) => return 0,
        Ok(Some(answer)) => answer,
    };
    // SAFETY: LinuxCNC passes room for each, or null.
    let (free_directions, tool_spin) = unsafe { (free_directions.as_mut(), tool_spin.as_mut()) };
    match tool_spin {
        Some(to) => *to = spin,
        // An exact answer can have a spin of some rounding.
        None if spin.abs() > FOUND => return 0,
        None => {}
    }
    free_directions.into_iter().for_each(|to| *to = free as c_int);
    // SAFETY: room for a row of joints, as `max_solutions` is positive.
    let solution = unsafe { core::slice::from_raw_parts_mut(solutions, control.joints()) };
    solution.iter_mut().zip(found).for_each(|(to, value)| *to = value);
    1
}

/// Returns KINEMATICS_BOTH: inverse and forward exist, and forward is not called in every cycle.
#[unsafe(no_mangle)]
pub extern "C" fn kinematicsType() -> KINEMATICS_TYPE {
    KinematicsKind::KINEMATICS_BOTH
}

/// Reports that the kinematics can be switched (0 = machine, 1 = identity).
#[unsafe(no_mangle)]
pub extern "C" fn kinematicsSwitchable() -> c_int {
    1
}

/// Switches to kinematics 0 (machine) or 1 (identity). Returns 0, or a negative code.
#[unsafe(no_mangle)]
pub extern "C" fn kinematicsSwitch(switchkins_type: c_int) -> c_int {
    // SAFETY: LinuxCNC switches from its servo thread.
    let Some(control) = (unsafe { control() }) else { return Cause::NullPointer.code() };
    code(control.switch(switchkins_type))
}

/// Returns the kind of kinematics `ktype`: LinuxCNC's KINSTYPE_PRIMARY (2) for the machine's, its
/// KINSTYPE_IDENTITY (1) for the identity, and −1 for kinematics that the module does not have.
#[unsafe(no_mangle)]
pub extern "C" fn kinematicsTypeFlags(ktype: c_int) -> c_int {
    // SAFETY: LinuxCNC calls it from its servo thread, or while none runs.
    let kind = unsafe { control() }.map(|control| control.first.kind_of(ktype));
    match kind {
        Some(Ok(Kind::Identity)) => 1,
        Some(Ok(Kind::Machine)) => 2,
        _ => -1,
    }
}

/// Requests the tool offset that LinuxCNC has in effect. The monitor brings it into effect like one from the
/// pins, which are ignored from then on. U V W are for the second mechanism, if there is one.
///
/// Returns 0, or −1 for a null pointer.
///
/// # Safety
/// `tool` must be null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kinematicsSetTool(tool: *const EmcPose) -> c_int {
    // SAFETY: LinuxCNC passes its pose, from its servo thread, or while none runs.
    let (tool, control) = unsafe { (tool.cast::<World>().as_ref(), control()) };
    let (Some(tool), Some(control)) = (tool, control) else { return -1 };
    control.request_tool(tool);
    0
}

/// Runs the HAL function `pkmkins.monitor`, which must be added to the motion controller's thread.
///
/// # Safety
/// Only HAL may call it, from that thread.
pub(crate) unsafe extern "C" fn monitor(_argument: *mut c_void, period: c_long) {
    // SAFETY: the caller guarantees the thread.
    if let Some(control) = unsafe { control() } {
        control.monitor(period as f64 * 1e-9);
    }
}
