// SPDX-License-Identifier: GPL-2.0-or-later
//! What LinuxCNC calls. Each function checks pointers, copies into core types, calls
//! [`Module`], and copies back.
#![allow(missing_docs, reason = "LinuxCNC's layouts; their headers document the fields")]
#![allow(non_camel_case_types, reason = "LinuxCNC's names")]

use crate::between::{Between, BetweenPins};
use crate::hal::{Component, HalError, print_error};
use crate::load;
use crate::module::{Kind, Module};
use crate::pair::{Pair, Second};
use crate::pins::{Maker, Pins, Place};
use core::cell::UnsafeCell;
use core::ffi::{CStr, c_int, c_long, c_ulong, c_void};
use kinematics::{
    Cause, Fault, Joints, Layout, Letter, Load, LoadError, MAX_EXTRA, MAX_JOINTS, MAX_LEGS,
    Matrix3, Pose, Second as SecondLetters, World, text,
};

/// LinuxCNC's kinds of kinematics.
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

/// Rows of the Jacobian that LinuxCNC provides: EMCMOT_MAX_JOINTS.
const ROWS: usize = 16;

const _: () = assert!(MAX_JOINTS <= ROWS);

// The letters of a table are none of an extra axis.
const _: () = assert!(MAX_LEGS + MAX_EXTRA <= ROWS);

// A second mechanism shares the legs with the first, and a letter of its own is none of an extra axis:
// joints of a module with two are not more than those of one.

/// LinuxCNC's PmCartesian.
#[cfg(not(any(posemath_h, linuxcnc_posemath_h)))]
#[repr(C)]
#[derive(Clone, Copy)]
pub struct PmCartesian {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

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

/// What LinuxCNC calls PmRotationMatrix: three column vectors.
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

// It is a `World`.
const _: () = assert!(size_of::<EmcPose>() == size_of::<World>());
const _: () = assert!(core::mem::offset_of!(EmcPose, w) == 8 * size_of::<f64>());

/// X … C of LinuxCNC's pose.
#[inline(always)]
fn degrees(world: &World) -> &[f64; 6] {
    let [pose @ .., _, _, _] = world;
    pose
}

/// Makes the coordinates that the machine moves NaN; all of X … C if none is known.
fn set_nan(world: &mut World, layout: Option<&Layout>) {
    for (value, letter) in world.iter_mut().zip(Letter::ALL) {
        if !layout.is_some_and(|layout| layout.is_held(letter)) {
            *value = f64::NAN;
        }
    }
}

/// The same of both mechanisms.
#[cold]
fn set_nan_of_both(world: &mut World, module: &Module) {
    set_nan(world, Some(module.layout()));
    for place in module.load().second().into_iter().flat_map(SecondLetters::places) {
        world.get_mut(place).into_iter().for_each(|value| *value = f64::NAN);
    }
}

/// State, made by `rtapi_app_main`.
struct Cell<T>(UnsafeCell<Option<T>>);

// SAFETY: LinuxCNC calls the kinematics from its servo thread only, and main and exit
// while no thread runs.
unsafe impl<T> Sync for Cell<T> {}

/// That of the mechanism, or of the first one.
static MODULE: Cell<Module> = Cell(UnsafeCell::new(None));

/// That of a second mechanism, where there is one.
static SECOND: Cell<Second> = Cell(UnsafeCell::new(None));

/// The state.
///
/// # Safety
/// No other reference to it may be alive: to be called once by an exported function,
/// from LinuxCNC's servo thread, or while no thread runs.
unsafe fn module<'a>() -> Option<&'a mut Module> {
    // SAFETY: the caller vouches that this is the only reference.
    unsafe { (*MODULE.0.get()).as_mut() }
}

/// Both mechanisms, where there are two.
///
/// # Safety
/// `first` must be the reference of [`module`], and no other reference to the second one may be alive.
unsafe fn pair(first: &mut Module) -> Option<Pair<'_>> {
    // SAFETY: the caller vouches that this is the only reference.
    let Second { module, between } = unsafe { (*SECOND.0.get()).as_mut() }?;
    Some(Pair { first, second: module, between })
}

/// What a C function returns: 0, or the code of the cause.
fn code<T>(result: Result<T, Fault>) -> c_int {
    result.map_or_else(|fault| fault.cause.code(), |_| 0)
}

/// Returns the joint values of legs and table; `None` for a null pointer, or where any joint of the
/// machine is NaN or infinite, those of extra axes and of a second mechanism included.
///
/// # Safety
/// `joint` must be null or point to as many values as the machine has joints.
unsafe fn joints(joint: *const f64, module: &Module) -> Option<Joints> {
    if joint.is_null() {
        return None;
    }
    // SAFETY: the caller vouches for the values.
    let all = unsafe { core::slice::from_raw_parts(joint, module.load().joints()) };
    if !all.iter().all(|value| value.is_finite()) {
        return None;
    }
    let mut values = [0.0; MAX_JOINTS];
    let own = values.iter_mut().take(module.layout().joints());
    own.zip(all).for_each(|(value, given)| *value = *given);
    Some(values)
}

/// Values of the extra axes' joints.
///
/// # Safety
/// `joint` must point to as many values as the machine has joints.
#[inline(always)]
unsafe fn extra_joints<'a>(joint: *const f64, module: &Module) -> &'a [f64] {
    let first = module.load().first_extra_joint();
    // SAFETY: the caller vouches for the values; they stand behind all others.
    unsafe { core::slice::from_raw_parts(joint.add(first), module.extra().len()) }
}

/// Joints to pose. `world` is the seed and receives the pose.
///
/// Returns 0, or a negative code (see the table of causes); then the coordinates of
/// `world` that the machine moves are NaN: LinuxCNC ignores the result in some places, and only NaN stops it safely. Before
/// homing (all joints 0, no pose known yet) `world` is left alone. On success coordinates that the
/// machine holds are 0, those of extra axes are the values of their joints, and other ones of U V W stay.
///
/// # Safety
/// `joint` must be null or hold as many values as the machine has joints; `world` null or valid; the flags
/// are not read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kinematicsForward(
    joint: *const f64,
    world: *mut EmcPose,
    _fflags: *const KINEMATICS_FORWARD_FLAGS,
    _iflags: *mut KINEMATICS_INVERSE_FLAGS,
) -> c_int {
    // SAFETY: LinuxCNC passes its joint array and pose, from its servo thread.
    let (world, module) = unsafe { (world.cast::<World>().as_mut(), module()) };
    let Some(world) = world else { return Cause::NullPointer.code() };
    let Some(module) = module else {
        set_nan(world, None);
        return Cause::NullPointer.code();
    };
    if joint.is_null() {
        set_nan(world, Some(module.layout()));
        return Cause::NullPointer.code();
    }
    if module.was_homed_before(world) {
        module.forget_poses();
        // SAFETY: the reference is the only one.
        if let Some(Pair { second, .. }) = unsafe { pair(module) } {
            second.forget_poses();
        }
    }
    // SAFETY: the array holds as many values as the machine has joints.
    let joints = unsafe { core::slice::from_raw_parts(joint, module.layout().joints()) };
    let result = if module.is_plain() {
        plain_forward(module, joints, world)
    } else if module.load().second().is_some() {
        // SAFETY: LinuxCNC's array, from its servo thread.
        return unsafe { forward_of_both(joint, world, module) };
    } else {
        // SAFETY: as above.
        let extra = unsafe { extra_joints(joint, module) };
        forward_of(module, joints, extra, world)
    };
    module.note_handed(world, result.is_ok());
    // SAFETY: as above.
    let all = unsafe { core::slice::from_raw_parts(joint, module.load().joints()) };
    module.note_command(all, &raw const *world as usize, result.is_ok());
    match result {
        Ok(()) => {}
        // Not yet a failure, and LinuxCNC would pass NaN on to its planner.
        Err(Fault { cause: Cause::NotHomed, .. }) => {}
        Err(_) => set_nan(world, Some(module.layout())),
    }
    code(result)
}

/// [`kinematicsInverse`] where forward has refused the commanded joints.
///
/// # Safety
/// `joint` must have room for as many values as the machine has joints; `module` is the reference of
/// [`module`].
#[cold]
#[inline(never)]
unsafe fn stand(joint: *mut f64, module: &mut Module) -> c_int {
    let result = module.stand();
    if let Ok(standing) = &result {
        // SAFETY: the caller vouches for the room.
        let joints = unsafe { core::slice::from_raw_parts_mut(joint, module.load().joints()) };
        joints.iter_mut().zip(standing).for_each(|(joint, own)| *joint = *own);
    }
    code(result)
}

/// [`kinematicsInverse`] of two mechanisms.
///
/// # Safety
/// `joint` must have room for as many values as the machine has joints; `module` is the reference of
/// [`module`].
#[cold]
#[inline(never)]
unsafe fn inverse_of_both(world: &World, joint: *mut f64, module: &mut Module) -> c_int {
    // SAFETY: the caller vouches for the room.
    let joints = unsafe { core::slice::from_raw_parts_mut(joint, module.load().joints()) };
    // SAFETY: the caller's reference is the only one.
    let Some(mut pair) = (unsafe { pair(module) }) else { return Cause::NullPointer.code() };
    code(pair.inverse(world, joints))
}

/// [`kinematicsForward`] of two mechanisms.
///
/// # Safety
/// `joint` must hold as many values as the machine has joints; `module` is the reference of
/// [`module`].
#[cold]
#[inline(never)]
unsafe fn forward_of_both(joint: *const f64, world: &mut World, module: &mut Module) -> c_int {
    let address = &raw const *world as usize;
    // SAFETY: as above.
    let joints = unsafe { core::slice::from_raw_parts(joint, module.load().joints()) };
    let mut all = *world;
    // SAFETY: the caller's reference is the only one.
    let Some(mut pair) = (unsafe { pair(module) }) else { return Cause::NullPointer.code() };
    let result = pair.forward(joints, &mut all, address);
    pair.first.note_command(joints, address, result.is_ok());
    match result {
        Ok(()) => {
            *world = all;
            pair.first.note_handed(world, true);
        }
        Err(fault) => {
            pair.first.note_handed(world, false);
            if fault.cause != Cause::NotHomed {
                set_nan_of_both(world, pair.first);
            }
        }
    }
    code(result)
}

/// Forward of a machine whose pose is LinuxCNC's.
#[inline(always)]
fn plain_forward(module: &mut Module, joints: &[f64], world: &mut World) -> Result<(), Fault> {
    let address = &raw const *world as usize;
    let [pose @ .., _, _, _] = world;
    match module.kind() {
        Kind::Identity => module.identity_forward(joints, pose),
        Kind::Machine => module.forward(joints, pose, address),
    }
}

/// Forward of every machine.
#[inline(never)]
fn forward_of(
    module: &mut Module,
    joints: &[f64],
    extra: &[f64],
    world: &mut World,
) -> Result<(), Fault> {
    let address = &raw const *world as usize;
    module.check_extra(extra, address)?;
    let mut all = *world;
    match module.kind() {
        Kind::Identity => module.identity_forward_of(joints, extra, &mut all),
        Kind::Machine => module.forward_of(joints, extra, &mut all, address),
    }?;
    *world = all;
    Ok(())
}

/// Pose to joints.
///
/// Returns 0, or a negative code (see the table of causes); then `joint` is left alone.
///
/// # Safety
/// `world` must be null or valid; `joint` null or room for as many values as the
/// machine has joints; the
/// flags are not read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kinematicsInverse(
    world: *const EmcPose,
    joint: *mut f64,
    _iflags: *const KINEMATICS_INVERSE_FLAGS,
    _fflags: *mut KINEMATICS_FORWARD_FLAGS,
) -> c_int {
    // SAFETY: LinuxCNC passes its pose and joint array, from its servo thread.
    let (world, module) = unsafe { (world.cast::<World>().as_ref(), module()) };
    let (Some(world), false, Some(module)) = (world, joint.is_null(), module) else {
        return Cause::NullPointer.code();
    };
    if module.is_standing() && world.iter().all(|value| value.is_finite()) {
        // SAFETY: as above.
        return unsafe { stand(joint, module) };
    }
    let count = module.layout().joints();
    // SAFETY: the array holds as many values as the machine has joints.
    let joints = unsafe { core::slice::from_raw_parts_mut(joint, count) };
    let result = match module.kind() {
        Kind::Machine if module.is_plain() => module.inverse(degrees(world), joints),
        _ if module.load().second().is_some() => {
            // SAFETY: as above, from its servo thread.
            return unsafe { inverse_of_both(world, joint, module) };
        }
        Kind::Machine => module.inverse_of(world, joints),
        Kind::Identity => {
            let pose = module.without_extra(world);
            module.identity_inverse(&pose, joints)
        }
    };
    if result.is_ok() && !module.extra().is_empty() {
        let values = module.extra().places().filter_map(|place| world.get(place));
        for (i, value) in values.enumerate() {
            // SAFETY: as above; the extra axes' joints stand behind the others.
            unsafe { joint.add(count + i).write(*value) };
        }
    }
    code(result)
}

/// ∂ joint / ∂ pose at `world`: `jac[j][a]` in joint units per pose unit (degrees!),
/// rows past the joints zero.
///
/// Returns 0, or −1 and leaves `jac` alone.
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
    let (world, jac, module) =
        unsafe { (world.cast::<World>().as_ref(), jac.cast::<[World; ROWS]>().as_mut(), module()) };
    let (Some(world), Some(jac), Some(module)) = (world, jac, module) else {
        return -1;
    };
    if module.load().second().is_some() {
        let mut rows = [World::default(); ROWS];
        // SAFETY: this reference is the only one.
        let result = unsafe { pair(module) }.map(|mut pair| pair.jacobian(world, &mut rows));
        let Some(Ok(())) = result else { return -1 };
        *jac = rows;
    } else {
        let rows = match module.kind() {
            Kind::Identity => Ok((module.identity_jacobian(), None)),
            Kind::Machine if module.is_plain() => {
                module.jacobian(&Pose::from_degrees(*degrees(world))).map(|rows| (rows, None))
            }
            Kind::Machine => module.jacobian_of(world).map(|(rows, rates)| (rows, Some(rates))),
        };
        let Ok((rows, rates)) = rows else { return -1 };
        *jac = [World::default(); ROWS];
        for (out, row) in jac.iter_mut().zip(rows.row_iter()) {
            let Some(rates) = &rates else {
                out.iter_mut().zip(row.iter()).for_each(|(to, value)| *to = *value);
                continue;
            };
            for (to, column) in out.iter_mut().zip(rates.column_iter()) {
                *to = row.iter().zip(column.iter()).map(|(value, rate)| value * rate).sum();
            }
        }
    }
    let extra = jac.iter_mut().skip(module.load().first_extra_joint());
    for (row, place) in extra.zip(module.extra().places()) {
        if let Some(rate) = row.get_mut(place) {
            *rate = 1.0;
        }
    }
    0
}

/// Tool axes in world coordinates as columns; z from the tip to the holder.
///
/// Returns 0, or −1 and leaves `rot` alone, also where any joint is NaN or infinite.
///
/// # Safety
/// `joint` must be null or hold as many values as the machine has joints; `rot` null or valid; the flags are
/// not read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kinematicsToolFrame(
    joint: *const f64,
    rot: *mut PmRotationMatrix,
    _fflags: *const KINEMATICS_FORWARD_FLAGS,
) -> c_int {
    // SAFETY: LinuxCNC passes its joint array and a matrix, from its servo thread.
    let (rot, module) = unsafe { (rot.as_mut(), module()) };
    let (Some(rot), Some(module)) = (rot, module) else {
        return -1;
    };
    // SAFETY: as above.
    let Some(joints) = (unsafe { joints(joint, module) }) else {
        return -1;
    };
    let frame = match module.kind() {
        // No joint turns a tool there, whatever the letters of the pose say.
        Kind::Identity => Ok(Matrix3::identity()),
        Kind::Machine if module.is_plain() => module.pose_of(&joints).map(|pose| pose.rotation()),
        Kind::Machine => {
            // SAFETY: the array holds as many values as the machine has joints.
            let extra = unsafe { extra_joints(joint, module) };
            module.frames(&joints, extra).map(|[tool, _]| tool)
        }
    };
    let Ok(frame) = frame else { return -1 };
    *rot = columns(&frame);
    0
}

fn columns(frame: &Matrix3<f64>) -> RotationColumns {
    let column = |k: usize| PmCartesian { x: frame[(0, k)], y: frame[(1, k)], z: frame[(2, k)] };
    RotationColumns { x: column(0), y: column(1), z: column(2) }
}

/// Work axes in world coordinates as columns: the extra axes that carry the work turn it, or the platform
/// that it is on. A table moves it only.
///
/// Returns 0, or −1 and leaves `rot` alone. Joints are not read where none of them turns the work.
///
/// # Safety
/// `joint` must be null or hold as many values as the machine has joints; `rot` null or valid; the flags are
/// not read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kinematicsWorkFrame(
    joint: *const f64,
    rot: *mut PmRotationMatrix,
    _fflags: *const KINEMATICS_FORWARD_FLAGS,
) -> c_int {
    // SAFETY: LinuxCNC passes its joint array and a matrix, from its servo thread.
    let (rot, module) = unsafe { (rot.as_mut(), module()) };
    let Some(rot) = rot else {
        return -1;
    };
    let turning = module.filter(|module| module.kind() == Kind::Machine && !module.is_plain());
    let Some(module) = turning else {
        *rot = columns(&Matrix3::identity());
        return 0;
    };
    // SAFETY: as above.
    let Some(joints) = (unsafe { joints(joint, module) }) else {
        return -1;
    };
    // SAFETY: the array holds as many values as the machine has joints.
    let extra = unsafe { extra_joints(joint, module) };
    let Ok([_, work]) = module.frames(&joints, extra) else { return -1 };
    *rot = columns(&work);
    0
}

/// KINEMATICS_BOTH: inverse and forward exist, forward is not called at every cycle.
#[unsafe(no_mangle)]
pub extern "C" fn kinematicsType() -> KINEMATICS_TYPE {
    KinematicsKind::KINEMATICS_BOTH
}

/// The kinematics can be switched (0 = machine, 1 = identity).
#[unsafe(no_mangle)]
pub extern "C" fn kinematicsSwitchable() -> c_int {
    1
}

/// Switches to kinematics 0 (machine) or 1 (identity). Returns 0, or a negative code.
#[unsafe(no_mangle)]
pub extern "C" fn kinematicsSwitch(switchkins_type: c_int) -> c_int {
    // SAFETY: LinuxCNC switches from its servo thread.
    let Some(module) = (unsafe { module() }) else {
        return Cause::NullPointer.code();
    };
    // SAFETY: this reference is the only one.
    match unsafe { pair(module) } {
        Some(mut pair) => code(pair.switch(switchkins_type)),
        None => code(module.switch(switchkins_type)),
    }
}

/// What kinematics `ktype` is: LinuxCNC's KINSTYPE_PRIMARY (2) for the machine's, its
/// KINSTYPE_IDENTITY (1) for the identity, and −1 for kinematics that the module does not have.
#[unsafe(no_mangle)]
pub extern "C" fn kinematicsTypeFlags(ktype: c_int) -> c_int {
    // SAFETY: LinuxCNC asks from its servo thread, or while none runs.
    let kind = unsafe { module() }.and_then(|module| module.kind_numbered(ktype));
    match kind {
        Some(Kind::Identity) => 1,
        Some(Kind::Machine) => 2,
        None => -1,
    }
}

/// Takes the tool offset that LinuxCNC has in effect, as a request: the monitor brings it into effect as
/// one of the pins, which are not read any more. U V W are for the second mechanism, if there is one.
///
/// Returns 0, or −1 for a null pointer.
///
/// # Safety
/// `tool` must be null or valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kinematicsSetTool(tool: *const EmcPose) -> c_int {
    // SAFETY: LinuxCNC passes its pose, from its servo thread, or while none runs.
    let (tool, module) = unsafe { (tool.as_ref(), module()) };
    let (Some(EmcPose { tran, u, v, w, .. }), Some(module)) = (tool, module) else {
        return -1;
    };
    module.request_tool([tran.x, tran.y, tran.z]);
    // SAFETY: this reference is the only one.
    if let Some(Pair { second, .. }) = unsafe { pair(module) } {
        second.request_tool([*u, *v, *w]);
    }
    0
}

/// The HAL function `pkmkins.monitor`, to be added to the thread of the motion controller.
///
/// # Safety
/// To be called by HAL, from that thread.
unsafe extern "C" fn monitor(_argument: *mut c_void, period: c_long) {
    let seconds = period as f64 * 1e-9;
    // SAFETY: the caller vouches for the thread.
    let Some(module) = (unsafe { module() }) else { return };
    // SAFETY: this reference is the only one, here and below. The frames of the two mechanisms stand
    // one after the other.
    if let Some(mut pair) = unsafe { pair(module) } {
        pair.begin();
    }
    module.monitor(seconds);
    // SAFETY: as above.
    if let Some(mut pair) = unsafe { pair(module) } {
        pair.monitor_second(seconds);
        pair.end_cycle(seconds);
    }
}

/// How many load parameters there are.
const COUNT: usize = 10;

/// The load parameters, by name.
static PARAMETERS: [(&str, &load::Parameter); COUNT] = [
    ("legs", &load::LEGS),
    ("coordinates", &load::COORDINATES),
    ("table", &load::TABLE),
    ("axes", &load::AXES),
    ("boxes", &load::BOXES),
    ("second", &load::SECOND),
    ("second_coordinates", &load::SECOND_COORDINATES),
    ("second_angles", &load::SECOND_ANGLES),
    ("second_boxes", &load::SECOND_BOXES),
    ("sparm", &load::SPARM),
];

// Frames of its own and of a refusal, which are gone while the component starts.
#[inline(never)]
fn parsed(parameters: [Option<&[u8]>; COUNT]) -> Result<Load, LoadError> {
    let [legs, coordinates, table, axes, boxes, second @ ..] = parameters;
    let [second, second_coordinates, second_angles, second_boxes, sparm] = second;
    Load::parse(legs, coordinates, table)?
        .with_second(second, second_coordinates, second_angles)?
        .with_axes(axes)?
        .with_boxes(boxes)?
        .with_second_boxes(second_boxes)?
        .with_sparm(sparm)
}

/// Loads the component: parameters, pins, state. Returns 0, or a negative errno.
#[unsafe(no_mangle)]
pub extern "C" fn rtapi_app_main() -> c_int {
    let parameters = PARAMETERS.each_ref().map(|(_, parameter)| parameter.text());
    let load = match parsed(parameters.map(|text| text.map(CStr::to_bytes))) {
        Ok(load) => load,
        Err(error) => {
            refuse_load(error, parameters);
            return -libc::EINVAL;
        }
    };
    match start(load) {
        Ok(()) => 0,
        Err(HalError(code)) => {
            print_error(&text!["pkmkins: LinuxCNC refused a HAL call (code ", code, ")"]);
            code
        }
    }
}

/// Unloads the component.
#[unsafe(no_mangle)]
pub extern "C" fn rtapi_app_exit() {
    // SAFETY: LinuxCNC stops its threads before it unloads a module.
    let component = unsafe { (*COMPONENT.0.get()).take() };
    // SAFETY: as above.
    unsafe { (*MODULE.0.get(), *SECOND.0.get()) = (None, None) };
    if let Some(component) = component {
        component.exit();
    }
}

/// The HAL component, kept for the exit.
struct ComponentCell(UnsafeCell<Option<Component>>);

// SAFETY: used by main and exit only, which LinuxCNC calls one after the other.
unsafe impl Sync for ComponentCell {}

static COMPONENT: ComponentCell = ComponentCell(UnsafeCell::new(None));

fn start(load: Load) -> Result<(), HalError> {
    let component = Component::new(c"pkmkins")?;
    let result = build(component, load);
    match result {
        // SAFETY: no thread runs yet.
        Ok(()) => unsafe { *COMPONENT.0.get() = Some(component) },
        Err(_) => {
            // SAFETY: as above.
            unsafe { (*MODULE.0.get(), *SECOND.0.get()) = (None, None) };
            component.exit();
        }
    }
    result
}

fn build(component: Component, load: Load) -> Result<(), HalError> {
    let first = build_one(component, &load, Place::FIRST)?;
    if let Some(second) = load.of_second() {
        let (leg, joint) = (load.layout.legs() as u8, load.layout.joints() as u8);
        build_one(component, &second, Place { leg, joint, is_second: true })?.share(first);
    }
    component.export(c"pkmkins.monitor", monitor)?;
    component.ready()
}

/// Makes pins and state of a mechanism.
fn build_one(component: Component, load: &Load, place: Place) -> Result<&'static Pins, HalError> {
    let pins = make_pins(component, load, place)?;
    if place.is_second {
        let of_pair = zeroed::<BetweenPins>(component)?;
        of_pair.create(&Maker { component, place })?;
        begin_second(pins, load, place, of_pair);
    } else {
        begin(pins, load, place);
    }
    Ok(pins)
}

// The frames of these stand one after the other.
#[inline(never)]
fn make_pins(component: Component, load: &Load, place: Place) -> Result<&'static Pins, HalError> {
    let pins = zeroed::<Pins>(component)?;
    pins.create(component, load, place)?;
    Ok(pins)
}

#[inline(never)]
fn begin(pins: &'static Pins, load: &Load, place: Place) {
    // SAFETY: no thread runs yet.
    unsafe { *MODULE.0.get() = Some(Module::new(pins, *load, place)) };
}

#[inline(never)]
fn begin_second(pins: &'static Pins, load: &Load, place: Place, of_pair: &'static BetweenPins) {
    let module = Module::new(pins, *load, place);
    // SAFETY: no thread runs yet.
    unsafe { *SECOND.0.get() = Some(Second { module, between: Between::new(of_pair) }) };
}

/// Pins in fresh HAL memory, not yet made: all-zero bytes are null pins.
fn zeroed<T>(component: Component) -> Result<&'static mut T, HalError> {
    let pins = component.allocate::<T>()?;
    // SAFETY: HAL memory of this size, of structures that hold pins alone, which lives as long as
    // LinuxCNC; nobody else knows it.
    Ok(unsafe { &mut *pins })
}

#[cold]
#[inline(never)]
fn refuse_load(error: LoadError, parameters: [Option<&CStr>; COUNT]) {
    let mut message = text!["pkmkins: refused"];
    for ((name, _), value) in PARAMETERS.iter().zip(parameters) {
        // Those of a second mechanism and sparm only where they are given.
        let is_seldom = name.starts_with("second") || *name == "sparm";
        if !is_seldom || value.is_some() {
            message.push(" ");
            message.push(*name);
            message.push("=");
            message.push(value.map_or(&[][..], CStr::to_bytes));
        }
    }
    message.push(": ");
    message.push(error.text());
    print_error(&message);
}
