// SPDX-License-Identifier: GPL-2.0-or-later
//! The draft's structures and functions. The layouts are those of LinuxCNC's pull request 4374 of September 2026.

use super::block::{Block, identity_forward, identity_inverse, identity_jacobian};
use super::description::{Description, describe, described, table};
use super::table::PREFIX;
use crate::abi::{
    EmcPose, KINEMATICS_FORWARD_FLAGS, KINEMATICS_INVERSE_FLAGS, PmRotationMatrix, columns,
};
use crate::control::MOST_JOINTS;
use crate::hal::Message;
use core::ffi::{CStr, c_char, c_int, c_void};
use core::ptr::{NonNull, null};
use kinematics::{Cause, Fault, LOAD_PARAMETERS, Load, Matrix3, Pose, Vector3, World, text};

/// KINS_MAX_PARAMS.
pub const KINS_MAX_PARAMS: usize = 96;

/// KINS_MAX_TYPES.
const KINS_MAX_TYPES: usize = 9;

/// A direction: an input.
pub const KINS_IN: c_int = 0;

/// An entry of the table of parameters, `kins_param_desc`.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct KinsParamDesc {
    pub name: *const c_char,
    pub kind: c_int,
    pub direction: c_int,
    /// Whether it is the tool's length.
    pub tool: c_int,
    pub default: f64,
}

/// A parameter block, `kins_params`.
#[repr(C)]
pub struct KinsParams {
    size: c_int,
    ktype: c_int,
    max_joints: c_int,
    joint_of_axis: [c_int; 9],
    joints_of_axis: [c_int; 9],
    pub tool: World,
    pub geometry: [f64; KINS_MAX_PARAMS],
}

/// What a caller keeps between its calls, `kins_scratch`.
#[repr(C)]
pub struct KinsScratch {
    pose_seed: World,
    have_pose_seed: c_int,
    pose_seed_ok: c_int,
    joint_seed: [f64; MOST_JOINTS],
    have_joint_seed: c_int,
    iterations: c_int,
    failed: c_int,
    /// The last pose of the machine that forward found, and 1 if there is one.
    aux: [f64; 8],
    out: [f64; KINS_MAX_PARAMS],
}

impl KinsScratch {
    /// Returns the last pose that forward found for this caller.
    pub fn last_pose(&self) -> Option<Pose> {
        let [x, y, z, a, b, c, is_known, _] = self.aux;
        let pose = Pose { position: Vector3::new(x, y, z), angles: Vector3::new(a, b, c) };
        (is_known == 1.0).then_some(pose)
    }

    pub fn keep_pose(&mut self, pose: &Pose) {
        let Pose { position, angles } = pose;
        self.aux =
            [position.x, position.y, position.z, angles.x, angles.y, angles.z, 1.0, self.aux[7]];
    }
}

type Forward = unsafe extern "C" fn(
    *const KinsParams,
    *mut KinsScratch,
    *const f64,
    *mut EmcPose,
    *const KINEMATICS_FORWARD_FLAGS,
    *mut KINEMATICS_INVERSE_FLAGS,
) -> c_int;

type Inverse = unsafe extern "C" fn(
    *const KinsParams,
    *mut KinsScratch,
    *const EmcPose,
    *mut f64,
    *const KINEMATICS_INVERSE_FLAGS,
    *mut KINEMATICS_FORWARD_FLAGS,
) -> c_int;

type Frame = unsafe extern "C" fn(
    *const KinsParams,
    *const f64,
    *mut PmRotationMatrix,
    *const KINEMATICS_FORWARD_FLAGS,
) -> c_int;

type Jacobian = unsafe extern "C" fn(
    *const KinsParams,
    *const f64,
    *const EmcPose,
    *mut [f64; 9],
    *const KINEMATICS_INVERSE_FLAGS,
) -> c_int;

/// The functions of one kinematics type, `kins_ops`.
#[repr(C)]
pub struct KinsOps {
    forward: Forward,
    inverse: Inverse,
    work: Frame,
    tool: Frame,
    /// Null: the tool's frame is LinuxCNC's.
    native: *const c_void,
    jacobian: Jacobian,
    /// Whether forward starts at the pose in its argument.
    fwd_iterates: c_int,
    identity: c_int,
    primary: c_int,
    /// Whether it is the machine frame, which has no tool.
    machine: c_int,
}

// SAFETY: functions, and a pointer that is null.
unsafe impl Sync for KinsOps {}

static MACHINE: KinsOps = KinsOps {
    forward: machine_forward,
    inverse: machine_inverse,
    work: machine_work,
    tool: machine_tool,
    native: null(),
    jacobian: machine_jacobian,
    fwd_iterates: 1,
    identity: 0,
    primary: 1,
    machine: 0,
};

static IDENTITY: KinsOps = KinsOps {
    forward: letters_forward,
    inverse: letters_inverse,
    work: letters_frame,
    tool: letters_frame,
    native: null(),
    jacobian: letters_jacobian,
    fwd_iterates: 0,
    identity: 1,
    primary: 0,
    machine: 0,
};

/// A description of the module, `kins_module_info`.
#[repr(C)]
pub struct KinsModuleInfo {
    name: *const c_char,
    halprefix: *const c_char,
    params: *const KinsParamDesc,
    nparams: c_int,
    required_coordinates: *const c_char,
    max_joints: c_int,
    allow_duplicates: c_int,
    ntypes: c_int,
    ops: [*const KinsOps; KINS_MAX_TYPES],
}

// The draft's sizes on a 64-bit processor.
const _: () = assert!(size_of::<KinsParams>() == 928 && size_of::<KinsScratch>() == 1056);
const _: () = assert!(size_of::<KinsParamDesc>() == 32 && size_of::<KinsModuleInfo>() == 128);

/// Describes the module with the load parameters `coordinates` and `sparm`, which contains the others.
///
/// Returns 0, or −1, a message on standard error, and leaves `info` unchanged.
///
/// # Safety
/// The texts must be null or end with a zero; `info` must be null or room for a description, which no other thread
/// uses.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kinsDescribe(
    coordinates: *const c_char,
    sparm: *const c_char,
    info: *mut KinsModuleInfo,
) -> c_int {
    let mut texts: [Option<&[u8]>; LOAD_PARAMETERS.len()] = [None; LOAD_PARAMETERS.len()];
    for (name, text) in [("coordinates", coordinates), ("sparm", sparm)] {
        // SAFETY: the caller guarantees the text.
        let text = (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_bytes());
        let mut places = LOAD_PARAMETERS.iter().zip(&mut texts);
        places.find(|(known, _)| **known == name).into_iter().for_each(|(_, to)| *to = text);
    }
    let described = match Load::of(texts) {
        Ok(load) => describe(&load).map_err(|refusal| refusal.text()),
        Err(error) => Err(text![error.text()]),
    };
    let description = match described {
        Ok(description) => description,
        Err(why) => {
            refuse(&why, texts);
            return -1;
        }
    };
    // SAFETY: the caller guarantees the room.
    let Some(info) = (unsafe { info.as_mut() }) else { return -1 };
    *info = info_of(description);
    0
}

fn info_of(Description { load, letters, .. }: &'static Description) -> KinsModuleInfo {
    let (params, nparams) = table().parameters();
    let mut ops = [null(); KINS_MAX_TYPES];
    let types: [*const KinsOps; 2] = match load.is_identity_first() {
        true => [&IDENTITY, &MACHINE],
        false => [&MACHINE, &IDENTITY],
    };
    let count = if load.has_identity() { 2 } else { 1 };
    ops.iter_mut().zip(types).take(count).for_each(|(to, own)| *to = own);
    KinsModuleInfo {
        name: PREFIX.as_ptr(),
        halprefix: PREFIX.as_ptr(),
        params,
        nparams,
        required_coordinates: letters.as_bytes_with_zero().as_ptr().cast(),
        max_joints: load.joints() as c_int,
        allow_duplicates: 0,
        ntypes: count as c_int,
        ops,
    }
}

/// Reports a refused description to the user of the process, which has no HAL that this module could use.
fn refuse(why: &Message, [_, coordinates, .., sparm]: [Option<&[u8]>; LOAD_PARAMETERS.len()]) {
    let message: Message = text![
        "pkmkins: cannot be used outside real time with coordinates=",
        coordinates.unwrap_or_default(),
        " sparm=",
        sparm.unwrap_or_default(),
        ": ",
        why.as_str(),
        "\n"
    ];
    let text = message.as_str().as_bytes();
    // SAFETY: a text of this length. Nothing can be done about a failure.
    let _ = unsafe { libc::write(libc::STDERR_FILENO, text.as_ptr().cast(), text.len()) };
}

/// Converts a result to the return value of a C function.
fn code(result: Result<(), Fault>) -> c_int {
    result.map_or_else(|fault| fault.cause.code(), |()| 0)
}

/// Returns the description and the block, if the module was described and the block is that of the machine in force.
///
/// # Safety
/// `block` must be null or a block that does not change during the call.
unsafe fn given<'a>(
    block: *const KinsParams,
) -> Result<(&'static Description, &'a KinsParams), Fault> {
    let description = described().ok_or(Cause::NullPointer)?;
    // SAFETY: the caller guarantees the block.
    let block = unsafe { not_null(block)?.as_ref() };
    if usize::try_from(block.size) != Ok(size_of::<KinsParams>()) {
        return Err(Cause::NoGeometry.into());
    }
    Block::check(description, block)?;
    Ok((description, block))
}

/// Refuses a null pointer.
fn not_null<T>(pointer: *const T) -> Result<NonNull<T>, Fault> {
    NonNull::new(pointer.cast_mut()).ok_or(Cause::NullPointer.into())
}

/// Returns the joints.
///
/// # Safety
/// `joint` must be null or point to as many values as the machine has joints.
unsafe fn joints<'a>(joint: *const f64, load: &Load) -> Result<&'a [f64], Fault> {
    let joints = NonNull::slice_from_raw_parts(not_null(joint)?, load.joints());
    // SAFETY: the caller guarantees the values.
    Ok(unsafe { joints.as_ref() })
}

/// As [`joints`], to be written.
///
/// # Safety
/// As [`joints`]; nothing else uses them during the call.
unsafe fn joints_mut<'a>(joint: *mut f64, load: &Load) -> Result<&'a mut [f64], Fault> {
    let mut joints = NonNull::slice_from_raw_parts(not_null(joint)?, load.joints());
    // SAFETY: the caller guarantees the values.
    Ok(unsafe { joints.as_mut() })
}

/// Computes the pose of the joints, from the seed in `pos`, which it replaces. Returns 0, or a negative code and leaves
/// `pos` unchanged.
///
/// # Safety
/// Each pointer must be null or valid as the draft defines it.
unsafe extern "C" fn machine_forward(
    block: *const KinsParams,
    scratch: *mut KinsScratch,
    joint: *const f64,
    pos: *mut EmcPose,
    _fflags: *const KINEMATICS_FORWARD_FLAGS,
    _iflags: *mut KINEMATICS_INVERSE_FLAGS,
) -> c_int {
    // SAFETY: the caller guarantees the pointers.
    code(unsafe { given(block) }.and_then(|(description, block)| {
        // SAFETY: as above.
        let joints = unsafe { joints(joint, &description.load) }?;
        // SAFETY: as above.
        let pos = unsafe { not_null(pos)?.cast::<World>().as_mut() };
        // SAFETY: as above.
        let scratch = unsafe { not_null(scratch)?.as_mut() };
        let result =
            Block::of(description, block).and_then(|machine| machine.forward(joints, pos, scratch));
        scratch.failed = c_int::from(result.is_err());
        result
    }))
}

/// Computes the joints of a pose. Returns 0, or a negative code and leaves `joint` unchanged.
///
/// # Safety
/// As [`machine_forward`].
unsafe extern "C" fn machine_inverse(
    block: *const KinsParams,
    _scratch: *mut KinsScratch,
    pos: *const EmcPose,
    joint: *mut f64,
    _iflags: *const KINEMATICS_INVERSE_FLAGS,
    _fflags: *mut KINEMATICS_FORWARD_FLAGS,
) -> c_int {
    // SAFETY: the caller guarantees the pointers.
    code(unsafe { given(block) }.and_then(|(description, block)| {
        // SAFETY: as above.
        let joints = unsafe { joints_mut(joint, &description.load) }?;
        // SAFETY: as above.
        let pos = unsafe { not_null(pos)?.cast::<World>().as_ref() };
        Block::of(description, block)?.inverse(pos, joints)
    }))
}

/// Computes the axes of the tool in base as columns. Returns 0, or a negative code and leaves `rot` unchanged.
///
/// # Safety
/// As [`machine_forward`].
unsafe extern "C" fn machine_tool(
    block: *const KinsParams,
    joint: *const f64,
    rot: *mut PmRotationMatrix,
    _fflags: *const KINEMATICS_FORWARD_FLAGS,
) -> c_int {
    // SAFETY: the caller guarantees the pointers.
    code(unsafe { given(block) }.and_then(|(description, block)| {
        // SAFETY: as above.
        let joints = unsafe { joints(joint, &description.load) }?;
        let [tool, _] = Block::of(description, block)?.frames(joints)?;
        // SAFETY: as above.
        unsafe { write_frame(rot, &tool) }
    }))
}

/// Computes the axes of the workpiece in base as columns. Returns 0, or a negative code and leaves `rot` unchanged.
///
/// # Safety
/// As [`machine_forward`].
unsafe extern "C" fn machine_work(
    block: *const KinsParams,
    joint: *const f64,
    rot: *mut PmRotationMatrix,
    _fflags: *const KINEMATICS_FORWARD_FLAGS,
) -> c_int {
    // SAFETY: the caller guarantees the pointers.
    code(unsafe { given(block) }.and_then(|(description, block)| {
        let machine = Block::of(description, block)?;
        let work = match machine.turns_work() {
            false => Matrix3::identity(),
            true => {
                // SAFETY: as above.
                let joints = unsafe { joints(joint, &description.load) }?;
                let [_, work] = machine.frames(joints)?;
                work
            }
        };
        // SAFETY: as above.
        unsafe { write_frame(rot, &work) }
    }))
}

/// Computes ∂ joint / ∂ pose at `pos`; rows beyond the last joint are zero. Returns 0, or a negative code and leaves
/// `jac` unchanged.
///
/// # Safety
/// As [`machine_forward`]; `jac` has 16 rows.
unsafe extern "C" fn machine_jacobian(
    block: *const KinsParams,
    _joint: *const f64,
    pos: *const EmcPose,
    jac: *mut [f64; 9],
    _iflags: *const KINEMATICS_INVERSE_FLAGS,
) -> c_int {
    // SAFETY: the caller guarantees the pointers.
    code(unsafe { given(block) }.and_then(|(description, block)| {
        // SAFETY: as above.
        let pos = unsafe { not_null(pos)?.cast::<World>().as_ref() };
        // SAFETY: as above.
        let jac = unsafe { not_null(jac)?.cast::<[World; MOST_JOINTS]>().as_mut() };
        Block::of(description, block)?.jacobian(pos, jac)
    }))
}

/// Computes the pose of the joints, in which each letter equals its joint. Returns 0, or a negative code and leaves
/// `pos` unchanged.
///
/// # Safety
/// As [`machine_forward`].
unsafe extern "C" fn letters_forward(
    block: *const KinsParams,
    _scratch: *mut KinsScratch,
    joint: *const f64,
    pos: *mut EmcPose,
    _fflags: *const KINEMATICS_FORWARD_FLAGS,
    _iflags: *mut KINEMATICS_INVERSE_FLAGS,
) -> c_int {
    // SAFETY: the caller guarantees the pointers.
    code(unsafe { given(block) }.and_then(|(Description { load, .. }, _)| {
        // SAFETY: as above.
        let joints = unsafe { joints(joint, load) }?;
        // SAFETY: as above.
        let pos = unsafe { not_null(pos)?.cast::<World>().as_mut() };
        identity_forward(load, joints, pos)
    }))
}

/// Computes the joints of a pose, each the value of its letter. Returns 0, or a negative code and leaves `joint`
/// unchanged.
///
/// # Safety
/// As [`machine_forward`].
unsafe extern "C" fn letters_inverse(
    block: *const KinsParams,
    _scratch: *mut KinsScratch,
    pos: *const EmcPose,
    joint: *mut f64,
    _iflags: *const KINEMATICS_INVERSE_FLAGS,
    _fflags: *mut KINEMATICS_FORWARD_FLAGS,
) -> c_int {
    // SAFETY: the caller guarantees the pointers.
    code(unsafe { given(block) }.and_then(|(description, block)| {
        // SAFETY: as above.
        let joints = unsafe { joints_mut(joint, &description.load) }?;
        // SAFETY: as above.
        let pos = unsafe { not_null(pos)?.cast::<World>().as_ref() };
        // The size of the machine decides what counts as 0; the module uses 1 before it has one.
        let size = Block::of(description, block).map_or(1.0, |machine| machine.size());
        identity_inverse(&description.load, size, pos, joints)
    }))
}

/// Computes the axes of tool or workpiece, which no joint rotates. Returns 0, or a negative code.
///
/// # Safety
/// As [`machine_forward`].
unsafe extern "C" fn letters_frame(
    block: *const KinsParams,
    _joint: *const f64,
    rot: *mut PmRotationMatrix,
    _fflags: *const KINEMATICS_FORWARD_FLAGS,
) -> c_int {
    // SAFETY: the caller guarantees the pointers.
    code(unsafe { given(block) }.and_then(|_| unsafe { write_frame(rot, &Matrix3::identity()) }))
}

/// Computes ∂ joint / ∂ pose: 1 for the letter of each joint. Returns 0, or a negative code.
///
/// # Safety
/// As [`machine_jacobian`].
unsafe extern "C" fn letters_jacobian(
    block: *const KinsParams,
    _joint: *const f64,
    _pos: *const EmcPose,
    jac: *mut [f64; 9],
    _iflags: *const KINEMATICS_INVERSE_FLAGS,
) -> c_int {
    // SAFETY: the caller guarantees the pointers.
    code(unsafe { given(block) }.and_then(|(Description { load, .. }, _)| {
        // SAFETY: as above.
        let jac = unsafe { not_null(jac)?.cast::<[World; MOST_JOINTS]>().as_mut() };
        identity_jacobian(load, jac);
        Ok(())
    }))
}

/// Writes a frame.
///
/// # Safety
/// `rot` must be null or valid.
unsafe fn write_frame(rot: *mut PmRotationMatrix, frame: &Matrix3<f64>) -> Result<(), Fault> {
    // SAFETY: the caller guarantees the matrix.
    *unsafe { not_null(rot)?.as_mut() } = columns(frame);
    Ok(())
}
