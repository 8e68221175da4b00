// SPDX-License-Identifier: GPL-2.0-or-later
//! A program that uses the module outside real time, as the loader of LinuxCNC's draft does: it opens the module
//! without HAL, has it described, fills a parameter block with the values of the pins, and calls the functions.
//!
//! The declarations are separate from the module's, from the interface of pull request 4374.

use crate::module::{Columns, Jacobian, Joints, Module, Pose, own_copy, pkmkins_path};
use crate::stub::{self, PinType, function};
use std::ffi::{CStr, CString, c_char, c_int, c_ulong, c_void};
use std::ptr::NonNull;

/// Places of the block.
pub const MAX_PARAMS: usize = 96;
const MAX_TYPES: usize = 9;

#[repr(C)]
struct ParamDesc {
    name: *const c_char,
    kind: c_int,
    direction: c_int,
    tool: c_int,
    default: f64,
}

/// A parameter block.
#[repr(C)]
#[derive(Clone)]
pub struct Params {
    pub size: c_int,
    ktype: c_int,
    max_joints: c_int,
    joint_of_axis: [c_int; 9],
    joints_of_axis: [c_int; 9],
    pub tool: Pose,
    pub geometry: [f64; MAX_PARAMS],
}

/// What a caller keeps.
#[repr(C)]
#[derive(Clone)]
pub struct Scratch {
    pose_seed: Pose,
    have_pose_seed: c_int,
    pose_seed_ok: c_int,
    joint_seed: Joints,
    have_joint_seed: c_int,
    iterations: c_int,
    pub failed: c_int,
    aux: [f64; 8],
    out: [f64; MAX_PARAMS],
}

impl Scratch {
    /// Returns a fresh one.
    pub fn new() -> Self {
        Self {
            pose_seed: [0.0; 9],
            have_pose_seed: 0,
            pose_seed_ok: 0,
            joint_seed: [0.0; 16],
            have_joint_seed: 0,
            iterations: 0,
            failed: 0,
            aux: [0.0; 8],
            out: [0.0; MAX_PARAMS],
        }
    }
}

impl Default for Scratch {
    fn default() -> Self {
        Self::new()
    }
}

type ForwardFn = unsafe extern "C" fn(
    *const Params,
    *mut Scratch,
    *const f64,
    *mut Pose,
    *const c_ulong,
    *mut c_ulong,
) -> c_int;
type InverseFn = unsafe extern "C" fn(
    *const Params,
    *mut Scratch,
    *const Pose,
    *mut f64,
    *const c_ulong,
    *mut c_ulong,
) -> c_int;
type FrameFn =
    unsafe extern "C" fn(*const Params, *const f64, *mut Columns, *const c_ulong) -> c_int;
type JacobianFn = unsafe extern "C" fn(
    *const Params,
    *const f64,
    *const Pose,
    *mut Jacobian,
    *const c_ulong,
) -> c_int;

#[repr(C)]
struct Ops {
    forward: Option<ForwardFn>,
    inverse: Option<InverseFn>,
    work: Option<FrameFn>,
    tool: Option<FrameFn>,
    native: *const c_void,
    jacobian: Option<JacobianFn>,
    fwd_iterates: c_int,
    identity: c_int,
    primary: c_int,
    machine: c_int,
}

#[repr(C)]
struct Info {
    name: *const c_char,
    halprefix: *const c_char,
    params: *const ParamDesc,
    nparams: c_int,
    required_coordinates: *const c_char,
    max_joints: c_int,
    allow_duplicates: c_int,
    ntypes: c_int,
    ops: [*const Ops; MAX_TYPES],
}

type DescribeFn = unsafe extern "C" fn(*const c_char, *const c_char, *mut Info) -> c_int;

/// An entry of the table of parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name after the prefix.
    pub name: String,
    pub kind: PinType,
    pub is_tool: bool,
    pub default: f64,
}

/// A copy of the module opened outside real time.
pub struct Library(NonNull<c_void>);

// SAFETY: a handle of the dynamic linker, which any thread may use.
unsafe impl Send for Library {}
// SAFETY: as above.
unsafe impl Sync for Library {}

impl Library {
    /// Opens a copy of the module as the draft's loader does: symbols are looked up at the first call.
    /// # Errors
    /// The dynamic linker's message.
    pub fn open() -> Result<Self, String> {
        let copy = own_copy(&pkmkins_path()).map_err(|error| error.to_string())?;
        let object = stub::open_lazily(&copy);
        let _ = std::fs::remove_file(&copy);
        object.map(Self)
    }

    /// Has the module described.
    /// # Errors
    /// The code of the refusal.
    /// # Panics
    /// If the module describes nothing, or a refusal writes something.
    pub fn describe(
        &self,
        coordinates: Option<&str>,
        sparm: Option<&str>,
    ) -> Result<Outside<'_>, i32> {
        let describe = function!(self.0, "kinsDescribe", DescribeFn).expect("kinsDescribe");
        let texts = [coordinates, sparm].map(|text| text.map(|text| CString::new(text).unwrap()));
        let [coordinates, sparm] =
            texts.each_ref().map(|text| text.as_ref().map_or(std::ptr::null(), |t| t.as_ptr()));
        let mut info = Info {
            name: std::ptr::null(),
            halprefix: std::ptr::null(),
            params: std::ptr::null(),
            nparams: -1,
            required_coordinates: std::ptr::null(),
            max_joints: -1,
            allow_duplicates: -1,
            ntypes: -1,
            ops: [std::ptr::null(); MAX_TYPES],
        };
        // SAFETY: texts with a zero or null, and room for the description.
        match unsafe { describe(coordinates, sparm, &mut info) } {
            0 => Ok(Outside { library: self, block: block(&info), info, scratch: Scratch::new() }),
            code => {
                assert!(info.nparams == -1 && info.name.is_null(), "a refusal wrote");
                Err(code)
            }
        }
    }
}

impl Drop for Library {
    fn drop(&mut self) {
        // SAFETY: no description outlives it.
        unsafe { libc::dlclose(self.0.as_ptr()) };
    }
}

/// Returns the block that the draft begins with: the letters' joints, and every default.
fn block(info: &Info) -> Params {
    let mut block = Params {
        size: size_of::<Params>() as c_int,
        ktype: 0,
        max_joints: 0,
        joint_of_axis: [-1; 9],
        joints_of_axis: [0; 9],
        tool: [0.0; 9],
        geometry: [0.0; MAX_PARAMS],
    };
    // SAFETY: a text with a zero, in the open library.
    let letters = unsafe { CStr::from_ptr(info.required_coordinates) }.to_str().unwrap();
    for (joint, letter) in letters.chars().enumerate() {
        let axis = "XYZABCUVW".find(letter).expect("a letter");
        assert_eq!(block.joint_of_axis[axis], -1, "{letter} twice");
        block.joint_of_axis[axis] = joint as c_int;
        block.joints_of_axis[axis] |= 1 << joint;
        block.max_joints = joint as c_int + 1;
    }
    for (to, entry) in block.geometry.iter_mut().zip(entries(info)) {
        *to = entry.default;
    }
    block
}

fn entries(info: &Info) -> &[ParamDesc] {
    let count = usize::try_from(info.nparams).expect("a number");
    assert!(count <= MAX_PARAMS, "{count} parameters");
    // SAFETY: the description's table, in the open library.
    unsafe { std::slice::from_raw_parts(info.params, count) }
}

/// The described module, with a block and a scratch.
pub struct Outside<'a> {
    library: &'a Library,
    info: Info,
    pub block: Params,
    pub scratch: Scratch,
}

// SAFETY: the pointers are to constants of the open library.
unsafe impl Send for Outside<'_> {}

impl Outside<'_> {
    /// Returns the table of parameters.
    /// # Panics
    /// If an entry is no input, or of an unknown type.
    pub fn parameters(&self) -> Vec<Parameter> {
        let parameter = |entry: &ParamDesc| {
            assert_eq!(entry.direction, 0, "an input");
            // SAFETY: a text with a zero, in the open library.
            let name = unsafe { CStr::from_ptr(entry.name) }.to_str().unwrap().to_owned();
            let kinds = [PinType::Float, PinType::Bit, PinType::S32, PinType::U32];
            let kind = kinds[usize::try_from(entry.kind).expect("a type")];
            Parameter { name, kind, is_tool: entry.tool != 0, default: entry.default }
        };
        entries(&self.info).iter().map(parameter).collect()
    }

    /// Returns the prefix of the pins.
    pub fn prefix(&self) -> String {
        // SAFETY: a text with a zero, in the open library.
        unsafe { CStr::from_ptr(self.info.halprefix) }.to_str().unwrap().to_owned()
    }

    /// Returns the address of the table.
    pub fn table(&self) -> usize {
        self.info.params.addr()
    }

    /// Returns the number of kinematics types, and of joints.
    pub fn counts(&self) -> [i32; 2] {
        [self.info.ntypes, self.info.max_joints]
    }

    /// Returns whether a type iterates, is the identity, the working transform, the machine frame.
    pub fn flags(&self, kind: usize) -> [bool; 4] {
        let ops = self.ops(kind);
        [ops.fwd_iterates, ops.identity, ops.primary, ops.machine].map(|flag| flag != 0)
    }

    fn ops(&self, kind: usize) -> &Ops {
        assert!((kind as i32) < self.info.ntypes, "type {kind}");
        // SAFETY: the description's functions, in the open library.
        unsafe { self.info.ops[kind].as_ref() }.expect("functions")
    }

    /// Reads the pins, as the draft does before every call; motion publishes the tool offset `x` and `y` as well.
    pub fn refresh(&mut self, module: &Module, [x, y]: [f64; 2]) {
        for (n, parameter) in self.parameters().into_iter().enumerate() {
            self.block.geometry[n] = module.get(&parameter.name);
            if parameter.is_tool {
                self.block.tool = [x, y, self.block.geometry[n], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            }
        }
    }

    /// Returns another caller with the same block.
    pub fn another(&self) -> Self {
        let Self { library, block, .. } = self;
        let info = Info { ops: self.info.ops, ..self.info };
        Self { library, info, block: block.clone(), scratch: Scratch::new() }
    }

    /// Returns the joints of a pose.
    /// # Errors
    /// The code of the refusal.
    pub fn inverse(&mut self, kind: usize, pose: &Pose) -> Result<Joints, i32> {
        let mut joints = [0.0; 16];
        let call = self.ops(kind).inverse.expect("a function");
        // SAFETY: every pointer is to a live object of the draft's size.
        match unsafe { call(&self.block, &mut self.scratch, pose, joints.as_mut_ptr(), &0, &mut 0) }
        {
            0 => Ok(joints),
            code => Err(code),
        }
    }

    /// Returns the pose of the joints, from a seed.
    /// # Errors
    /// The code of the refusal.
    pub fn forward(&mut self, kind: usize, joints: &Joints, seed: &Pose) -> Result<Pose, i32> {
        let mut pose = *seed;
        let call = self.ops(kind).forward.expect("a function");
        // SAFETY: as in `inverse`.
        match unsafe {
            call(&self.block, &mut self.scratch, joints.as_ptr(), &mut pose, &0, &mut 0)
        } {
            0 => Ok(pose),
            code => {
                let bits = |pose: &Pose| pose.map(f64::to_bits);
                assert_eq!(bits(&pose), bits(seed), "a refusal wrote");
                Err(code)
            }
        }
    }

    /// Returns the Jacobian at a pose.
    /// # Errors
    /// The code of the refusal.
    pub fn jacobian(&self, kind: usize, joints: &Joints, pose: &Pose) -> Result<Jacobian, i32> {
        let mut result = [[f64::NAN; 9]; 16];
        let call = self.ops(kind).jacobian.expect("a function");
        // SAFETY: as in `inverse`.
        match unsafe { call(&self.block, joints.as_ptr(), pose, &mut result, &0) } {
            0 => Ok(result),
            code => Err(code),
        }
    }

    /// Returns the axes of tool and workpiece.
    /// # Errors
    /// The code of the refusal.
    pub fn frames(&self, kind: usize, joints: &Joints) -> Result<[Columns; 2], i32> {
        let ops = self.ops(kind);
        let mut frames = [[[f64::NAN; 3]; 3]; 2];
        for (call, frame) in [ops.tool, ops.work].into_iter().zip(&mut frames) {
            // SAFETY: as in `inverse`.
            let code =
                unsafe { call.expect("a function")(&self.block, joints.as_ptr(), frame, &0) };
            if code != 0 {
                return Err(code);
            }
        }
        Ok(frames)
    }
}
