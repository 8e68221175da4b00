// SPDX-License-Identifier: GPL-2.0-or-later
//! One kinematics module, loaded as `rtapi_app` loads it.

use crate::stub::{self, Message, Pin, World, function};
use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, HashMap};
use std::ffi::{CStr, CString, c_char, c_int, c_uint, c_ulong, c_void};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// LinuxCNC's `EmcPose` as numbers: x y z a b c u v w, degrees for angles.
pub type Pose = [f64; 9];

/// Joint values; LinuxCNC passes an array of this length.
pub type Joints = [f64; 16];

/// `PmRotationMatrix`: three columns.
pub type Columns = [[f64; 3]; 3];

/// `kinematicsJacobian`'s result: joint by pose component.
pub type Jacobian = [[f64; 9]; 16];

/// Period of the servo thread in the tests, nanoseconds.
const PERIOD: i64 = 1_000_000;

/// Cycles after which all pins for display are updated: a few turns of the module's.
pub const ALL_IS_SHOWN: usize = 50;

/// `kinematicsForward`.
pub type ForwardFn =
    unsafe extern "C" fn(*const f64, *mut Pose, *const c_ulong, *mut c_ulong) -> c_int;
/// `kinematicsInverse`.
pub type InverseFn =
    unsafe extern "C" fn(*const Pose, *mut f64, *const c_ulong, *mut c_ulong) -> c_int;
type JacobianFn =
    unsafe extern "C" fn(*const f64, *const Pose, *mut Jacobian, *const c_ulong) -> c_int;
type FrameFn = unsafe extern "C" fn(*const f64, *mut Columns, *const c_ulong) -> c_int;
type PlainFn = unsafe extern "C" fn() -> c_int;
type SwitchFn = unsafe extern "C" fn(c_int) -> c_int;
type ToolFrameInverseFn = unsafe extern "C" fn(
    *const [f64; 3],
    *const [f64; 3],
    *const f64,
    c_uint,
    *mut f64,
    c_int,
    *mut c_int,
    *mut f64,
) -> c_int;
type SetToolFn = unsafe extern "C" fn(*const Pose) -> c_int;

struct Entry {
    forward: ForwardFn,
    inverse: InverseFn,
    kind: PlainFn,
    switchable: PlainFn,
    switch: SwitchFn,
    exit: unsafe extern "C" fn(),
    jacobian: Option<JacobianFn>,
    tool_frame: Option<FrameFn>,
    work_frame: Option<FrameFn>,
    tool_frame_inverse: Option<ToolFrameInverseFn>,
    type_flags: Option<SwitchFn>,
    set_tool: Option<SetToolFn>,
}

/// Why a module was not loaded.
#[derive(Debug)]
pub struct LoadError {
    /// Return code of `rtapi_app_main`; 0 if it was not called.
    pub code: i32,
    /// Messages of the module or the loader.
    pub messages: Vec<String>,
}

/// A loaded module with its own statics and its own HAL.
pub struct Module {
    prefix: &'static str,
    entry: Entry,
    object: NonNull<c_void>,
    pins: HashMap<String, Pin>,
    /// LinuxCNC's feedback pose of [`Module::forward`], at a separate address.
    feedback: Box<RefCell<Pose>>,
    /// Whether forward starts at the next seed of [`Module::forward`].
    follows_seeds: Cell<bool>,
    /// Whether the feedback pose is the last pose found.
    is_followed: Cell<bool>,
    world: World,
    // The parameters' text, which the module may read until it is closed.
    _parameters: Vec<CString>,
}

impl Module {
    /// Returns the module under test: `PKMKINS_SO`, or the result of `make module`.
    /// # Panics
    /// If the file is missing or is not loaded with these parameters.
    pub fn pkmkins(parameters: &[(&str, &str)]) -> Module {
        Module::try_pkmkins(parameters).unwrap_or_else(|error| panic!("{parameters:?}: {error:?}"))
    }

    /// Loads the module under test, with parameters that may be refused.
    /// # Errors
    /// The module's code and messages.
    pub fn try_pkmkins(parameters: &[(&str, &str)]) -> Result<Module, LoadError> {
        Module::load(&pkmkins_path(), "pkmkins", parameters)
    }

    /// Returns LinuxCNC's general hexapod, with its default parameters.
    /// # Panics
    /// If LinuxCNC is not installed.
    pub fn genhexkins() -> Module {
        Module::of_linuxcnc("genhexkins")
    }

    /// Returns one of LinuxCNC's kinematics modules, with its default parameters.
    /// # Panics
    /// If LinuxCNC is not installed, or has no such module.
    pub fn of_linuxcnc(name: &'static str) -> Module {
        let path = linuxcnc_modules().join(format!("{name}.so"));
        assert!(path.exists(), "{} is missing: install linuxcnc-uspace", path.display());
        Module::load(&path, name, &[]).unwrap_or_else(|error| panic!("{error:?}"))
    }

    fn load(
        path: &Path,
        prefix: &'static str,
        parameters: &[(&str, &str)],
    ) -> Result<Module, LoadError> {
        let say = |text: String| LoadError { code: 0, messages: vec![text] };
        let world = World::new();
        world.enter();
        let object = open_own_copy(path).map_err(say)?;
        let parameters = set_parameters(object, parameters).map_err(say)?;
        let entry = Entry::find(object).map_err(say)?;
        start(object, &world)?;
        let pins = world.pins().into_iter().map(|pin| (pin.name.clone(), pin)).collect();
        Ok(Module {
            prefix,
            entry,
            object,
            pins,
            feedback: Box::new(RefCell::new([0.0; 9])),
            follows_seeds: Cell::new(false),
            is_followed: Cell::new(false),
            world,
            _parameters: parameters,
        })
    }

    /// Returns its name, the prefix of its pins.
    pub fn name(&self) -> &'static str {
        self.prefix
    }

    /// Returns all pins, in the order of their creation.
    pub fn pins(&self) -> Vec<Pin> {
        self.world.pins()
    }

    fn pin(&self, name: &str) -> Option<&Pin> {
        self.pins.get(&format!("{}.{name}", self.prefix)).or_else(|| self.pins.get(name))
    }

    /// Returns whether a pin of this name exists, with or without the module's prefix.
    pub fn has(&self, name: &str) -> bool {
        self.pin(name).is_some()
    }

    /// Returns the value of a pin.
    /// # Panics
    /// If no pin has this name.
    pub fn get(&self, name: &str) -> f64 {
        self.pin(name).unwrap_or_else(|| panic!("no pin {name}")).get()
    }

    /// Sets a pin.
    /// # Panics
    /// If no pin has this name.
    pub fn set(&self, name: &str, value: f64) {
        self.follows_seeds.set(false);
        self.pin(name).unwrap_or_else(|| panic!("no pin {name}")).set(value);
    }

    /// Returns whether a bit pin is on.
    pub fn is_on(&self, name: &str) -> bool {
        self.get(name) != 0.0
    }

    /// Runs `pkmkins.monitor` once, as in the servo thread.
    /// # Panics
    /// If the module exports no such function.
    pub fn monitor(&self) {
        self.monitor_in_cycle_of(PERIOD);
    }

    /// Runs the monitor until all pins for display are updated.
    pub fn monitor_until_all_is_shown(&self) {
        for _ in 0..ALL_IS_SHOWN {
            self.monitor();
        }
    }

    /// Runs the monitor in a servo thread of another period (nanoseconds).
    /// # Panics
    /// If the module exports no such function.
    pub fn monitor_in_cycle_of(&self, period: i64) {
        let name = format!("{}.monitor", self.prefix);
        assert!(self.world.run(&name, period), "no function {name}");
    }

    /// Makes a rising edge of `.apply`, detected by the monitor.
    pub fn apply(&self) {
        self.set("apply", 0.0);
        self.monitor();
        self.set("apply", 1.0);
        self.monitor();
    }

    pub fn messages(&self) -> Vec<Message> {
        self.world.messages()
    }

    /// Discards the messages so far.
    pub fn clear_messages(&self) {
        self.world.clear_messages();
    }

    /// Returns the number of calls by the module to HAL and RTAPI so far.
    pub fn hal_calls(&self) -> u64 {
        self.world.calls()
    }

    /// Calls `kinematicsType`.
    pub fn kind(&self) -> i32 {
        // SAFETY: no argument, module started.
        unsafe { (self.entry.kind)() }
    }

    /// Calls `kinematicsSwitchable`.
    pub fn switchable(&self) -> i32 {
        // SAFETY: no argument, module started.
        unsafe { (self.entry.switchable)() }
    }

    /// Calls `kinematicsSwitch`.
    pub fn switch(&self, kind: i32) -> i32 {
        self.world.enter();
        // SAFETY: plain number, module started.
        unsafe { (self.entry.switch)(kind) }
    }

    /// Calls `kinematicsTypeFlags`.
    /// # Panics
    /// If the module does not export it.
    pub fn type_flags(&self, kind: i32) -> i32 {
        let call = self.entry.type_flags.expect("kinematicsTypeFlags is exported");
        // SAFETY: plain number, module started.
        unsafe { call(kind) }
    }

    /// Calls `kinematicsSetTool`; `None` as a null pointer.
    /// # Panics
    /// If the module does not export it.
    pub fn set_tool(&self, tool: Option<&Pose>) -> i32 {
        self.world.enter();
        let call = self.entry.set_tool.expect("kinematicsSetTool is exported");
        // SAFETY: null, or a live object of the size LinuxCNC uses.
        unsafe { call(tool.map_or(std::ptr::null(), std::ptr::from_ref)) }
    }

    /// Calls `kinematicsInverse` with the caller's joints.
    pub fn inverse_into(&self, pose: &Pose, joints: &mut Joints) -> i32 {
        self.world.enter();
        // SAFETY: every pointer is to a live object of the size LinuxCNC uses.
        unsafe { (self.entry.inverse)(pose, joints.as_mut_ptr(), &0, &mut 0) }
    }

    /// Calls `kinematicsForward` with the caller's pose as seed and result.
    pub fn forward_into(&self, joints: &Joints, world: &mut Pose) -> i32 {
        self.world.enter();
        // SAFETY: as in `inverse_into`.
        unsafe { (self.entry.forward)(joints.as_ptr(), world, &0, &mut 0) }
    }

    /// Calls `kinematicsInverse` with an array of exactly as many joints as the machine
    /// has.
    ///
    /// # Safety
    /// `joints` must be as long as the machine has joints, which is not checked.
    pub unsafe fn inverse_exactly(&self, pose: &Pose, joints: &mut [f64]) -> i32 {
        self.world.enter();
        // SAFETY: the caller vouches for the length; the other pointers as in `inverse_into`.
        unsafe { (self.entry.inverse)(pose, joints.as_mut_ptr(), &0, &mut 0) }
    }

    /// Calls `kinematicsForward` with an array of exactly as many joints as the machine
    /// has.
    ///
    /// # Safety
    /// As [`Module::inverse_exactly`].
    pub unsafe fn forward_exactly(&self, joints: &[f64], world: &mut Pose) -> i32 {
        self.world.enter();
        // SAFETY: as in `inverse_exactly`.
        unsafe { (self.entry.forward)(joints.as_ptr(), world, &0, &mut 0) }
    }

    /// Returns the joints of a pose.
    /// # Errors
    /// The module's code.
    pub fn inverse(&self, pose: &Pose) -> Result<Joints, i32> {
        let mut joints = [0.0; 16];
        match self.inverse_into(pose, &mut joints) {
            0 => Ok(joints),
            code => Err(code),
        }
    }

    /// Returns the pose of these joints, from a seed.
    ///
    /// The module starts at its last pose, for any seed. Here it has none: the
    /// reference pose is removed after it has fixed the folds of nut corrections, and a seed other
    /// than the previous pose means that the joints were homed there.
    /// # Errors
    /// The module's code; as in LinuxCNC only a negative one is a failure.
    pub fn forward(&self, joints: &Joints, seed: &Pose) -> Result<Pose, i32> {
        if self.prefix == "pkmkins" && !self.follows_seeds.get() {
            self.take_reference_away();
        }
        let code = self.forward_from(joints, seed);
        // After a refusal LinuxCNC's next seed is ignored, and the next call starts at the last good pose.
        self.follows_seeds.set(code >= 0);
        self.is_followed.set(code >= 0);
        if code < 0 { Err(code) } else { Ok(*self.feedback.borrow()) }
    }

    /// Calls `kinematicsForward` with a seed in LinuxCNC's feedback pose, which the module follows after
    /// [`Module::take_reference_away`] and a successful call.
    pub fn forward_from(&self, joints: &Joints, seed: &Pose) -> i32 {
        let mut world = self.feedback.borrow_mut();
        *world = *seed;
        self.forward_into(joints, &mut world)
    }

    /// Returns the pose of these joints in the course of a motion, as LinuxCNC's servo thread requests it: the
    /// seed is the last pose found, and after a refusal `home`.
    /// # Errors
    /// As [`Module::forward`].
    pub fn follow(&self, joints: &Joints, home: &Pose) -> Result<Pose, i32> {
        self.follows_seeds.set(false);
        let mut world = self.feedback.borrow_mut();
        if !self.is_followed.get() {
            *world = *home;
        }
        let code = self.forward_into(joints, &mut world);
        self.is_followed.set(code >= 0);
        if code < 0 { Err(code) } else { Ok(*world) }
    }

    /// Applies the geometry without its reference pose, but with the folds of nut corrections of that pose.
    pub fn take_reference_away(&self) {
        let mut home = [0.0; 9];
        for (letter, value) in ["x", "y", "z", "a", "b", "c"].into_iter().zip(&mut home) {
            *value = self.get(&format!("home.{letter}"));
        }
        self.take_reference_away_at(&home);
    }

    /// Applies the geometry without its reference pose, given by all letters.
    pub fn take_reference_away_at(&self, home: &Pose) {
        let is_home =
            |name: &str| name.rsplit_once('.').is_some_and(|(stem, _)| stem.ends_with("home"));
        let homes: Vec<&Pin> = self.pins.values().filter(|pin| is_home(&pin.name)).collect();
        let kept: Vec<f64> = homes.iter().map(|pin| pin.get()).collect();
        // A drop-in has none.
        if kept.iter().all(|value| value.is_nan()) {
            return;
        }
        let (apply, on) = (self.get("apply"), self.get("machine-on"));
        self.pin("machine-on").into_iter().for_each(|pin| pin.set(0.0));
        let at_home = self.inverse(home);
        homes.iter().for_each(|pin| pin.set(f64::NAN));
        for edge in [0.0, 1.0] {
            self.set("apply", edge);
            let _ = self.inverse(home);
        }
        self.set("apply", apply);
        let _ = self.inverse(home);
        // Two calls without a call of inverse between them: no pose is commanded.
        for _ in 0..2 {
            self.forward_from(&at_home.unwrap_or([f64::NAN; 16]), home);
        }
        homes.iter().zip(kept).for_each(|(pin, value)| pin.set(value));
        self.set("machine-on", on);
    }

    /// Calls `kinematicsJacobian`. Every element is NaN before the call.
    /// # Errors
    /// The module's code.
    /// # Panics
    /// If the module does not export it.
    pub fn jacobian(&self, joints: &Joints, pose: &Pose) -> Result<Jacobian, i32> {
        self.world.enter();
        let mut result = [[f64::NAN; 9]; 16];
        let call = self.entry.jacobian.expect("kinematicsJacobian is exported");
        // SAFETY: as in `inverse_into`.
        match unsafe { call(joints.as_ptr(), pose, &mut result, &0) } {
            0 => Ok(result),
            code => Err(code),
        }
    }

    /// Calls `kinematicsToolFrame`: columns are the tool's axes in world.
    /// # Errors
    /// The module's code.
    /// # Panics
    /// If the module does not export it.
    pub fn tool_frame(&self, joints: &Joints) -> Result<Columns, i32> {
        self.frame(self.entry.tool_frame.expect("kinematicsToolFrame is exported"), joints)
    }

    /// Calls `kinematicsWorkFrame`.
    /// # Errors
    /// The module's code.
    /// # Panics
    /// If the module does not export it.
    pub fn work_frame(&self, joints: &Joints) -> Result<Columns, i32> {
        self.frame(self.entry.work_frame.expect("kinematicsWorkFrame is exported"), joints)
    }

    /// Calls `kinematicsToolFrameInverse`: returns joints, the number of free directions and the spin.
    /// # Errors
    /// The number of solutions, or −1.
    /// # Panics
    /// If the module does not export it, or has more than one solution.
    pub fn tool_frame_inverse(
        &self,
        axis: [f64; 3],
        x: Option<[f64; 3]>,
        seed: &Joints,
        held: u32,
    ) -> Result<(Joints, usize, f64), i32> {
        self.world.enter();
        let call = self.entry.tool_frame_inverse.expect("kinematicsToolFrameInverse is exported");
        let (mut joints, mut free, mut spin) = ([0.0; 16], -1, f64::NAN);
        let x = x.as_ref().map_or(std::ptr::null(), std::ptr::from_ref);
        // SAFETY: as in `inverse_into`; room for one solution.
        let count = unsafe {
            call(&axis, x, seed.as_ptr(), held, joints.as_mut_ptr(), 1, &mut free, &mut spin)
        };
        match count {
            1 => Ok((joints, usize::try_from(free).expect("a number"), spin)),
            count => {
                assert!(count < 1, "{count} solutions");
                Err(count)
            }
        }
    }

    /// Calls a frame function on a matrix of NaN, which a refusal must not change.
    fn frame(&self, call: FrameFn, joints: &Joints) -> Result<Columns, i32> {
        self.world.enter();
        let mut columns = [[f64::NAN; 3]; 3];
        // SAFETY: as in `inverse_into`.
        match unsafe { call(joints.as_ptr(), &mut columns, &0) } {
            0 => Ok(columns),
            code => {
                let is_untouched = columns.iter().flatten().all(|value| value.is_nan());
                assert!(is_untouched, "a refused frame was written: {columns:?}");
                Err(code)
            }
        }
    }

    /// Returns a text that the module exports for `rtapi_app` and `modinfo`.
    pub fn text(&self, symbol: &str) -> Option<String> {
        let address = stub::symbol(self.object, symbol)?;
        // SAFETY: MODULE_INFO's layout: a pointer to a constant C string.
        let text = unsafe { CStr::from_ptr(address.cast::<*const c_char>().read()) };
        Some(text.to_string_lossy().into_owned())
    }

    /// Returns the entry points, for measurements without this wrapper.
    pub fn entry_points(&self) -> (ForwardFn, InverseFn) {
        self.world.enter();
        (self.entry.forward, self.entry.inverse)
    }
}

impl Drop for Module {
    fn drop(&mut self) {
        self.world.enter();
        // SAFETY: started once in `load`; nothing is called after the object is closed.
        unsafe { (self.entry.exit)() };
        let left = self.world.has_exited();
        // SAFETY: as above.
        unsafe { libc::dlclose(self.object.as_ptr()) };
        assert!(left || std::thread::panicking(), "rtapi_app_exit did not call hal_exit");
    }
}

impl Entry {
    fn find(object: NonNull<c_void>) -> Result<Entry, String> {
        let missing = |name: &str| format!("the module exports no {name}");
        macro_rules! need {
            ($name:literal) => {
                function!(object, $name, _).ok_or_else(|| missing($name))?
            };
        }
        Ok(Entry {
            forward: need!("kinematicsForward"),
            inverse: need!("kinematicsInverse"),
            kind: need!("kinematicsType"),
            switchable: need!("kinematicsSwitchable"),
            switch: need!("kinematicsSwitch"),
            exit: need!("rtapi_app_exit"),
            jacobian: function!(object, "kinematicsJacobian", JacobianFn),
            tool_frame: function!(object, "kinematicsToolFrame", FrameFn),
            work_frame: function!(object, "kinematicsWorkFrame", FrameFn),
            tool_frame_inverse: function!(object, "kinematicsToolFrameInverse", ToolFrameInverseFn),
            type_flags: function!(object, "kinematicsTypeFlags", SwitchFn),
            set_tool: function!(object, "kinematicsSetTool", SetToolFn),
        })
    }
}

/// Returns the path of the module under test.
/// # Panics
/// If it does not exist.
pub fn pkmkins_path() -> PathBuf {
    let path = std::env::var_os("PKMKINS_SO").map_or_else(
        || {
            Path::new(env!("CARGO_MANIFEST_DIR"))
                .join("../../../target/module/release/libpkmkins.so")
        },
        PathBuf::from,
    );
    assert!(path.exists(), "{} is missing: run `make module` first", path.display());
    path
}

fn linuxcnc_modules() -> PathBuf {
    std::env::var_os("LINUXCNC_MODULES")
        .map_or_else(|| PathBuf::from("/usr/lib/linuxcnc/modules"), PathBuf::from)
}

/// Opens a copy of the file: the dynamic linker identifies libraries by inode, and
/// only another inode has separate statics. The name is not needed afterwards.
fn open_own_copy(path: &Path) -> Result<NonNull<c_void>, String> {
    let copy = own_copy(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let object = stub::open(&copy, false);
    let _ = std::fs::remove_file(&copy);
    object
}

/// Writes a copy of the file, to be removed once it is open.
/// # Errors
/// The file cannot be read, or the copy not written.
pub fn own_copy(path: &Path) -> std::io::Result<PathBuf> {
    let copy = own_name();
    std::fs::write(&copy, &*without_lines(path)?)?;
    Ok(copy)
}

/// Returns a name that no other test uses.
fn own_name() -> PathBuf {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    std::env::temp_dir().join(format!("pkmkins-test-{}-{number}.so", std::process::id()))
}

/// Returns the file without debug lines, four fifths of the module: the tests copy it thousands of times.
///
/// STRIP names the command for modules of another processor.
fn without_lines(path: &Path) -> std::io::Result<Arc<[u8]>> {
    static KNOWN: Mutex<BTreeMap<PathBuf, Arc<[u8]>>> = Mutex::new(BTreeMap::new());
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(bytes) = known.get(path) {
        return Ok(bytes.clone());
    }
    let stripped = own_name();
    let command = std::env::var_os("STRIP").unwrap_or_else(|| "strip".into());
    let status = Command::new(command)
        .arg("--strip-debug")
        .arg("-o")
        .args([stripped.as_path(), path])
        .status()?;
    if !status.success() {
        return Err(std::io::Error::other("strip failed"));
    }
    let bytes: Arc<[u8]> = std::fs::read(&stripped)?.into();
    let _ = std::fs::remove_file(&stripped);
    known.insert(path.into(), bytes.clone());
    Ok(bytes)
}

/// Writes loadrt parameters as `rtapi_app` does: through the address symbol.
fn set_parameters(
    object: NonNull<c_void>,
    parameters: &[(&str, &str)],
) -> Result<Vec<CString>, String> {
    let mut texts = Vec::new();
    for (name, value) in parameters {
        let address = stub::symbol(object, &format!("rtapi_info_address_{name}"))
            .ok_or_else(|| format!("unknown parameter '{name}'"))?;
        let text = CString::new(*value).expect("a parameter without NUL");
        // SAFETY: MODULE_PARM's layout: the symbol is a pointer to the module's
        // own char pointer, which is set before rtapi_app_main runs.
        unsafe {
            let target: *mut *const c_char = address.cast::<*mut *const c_char>().read();
            target.write(text.as_ptr());
        }
        texts.push(text);
    }
    Ok(texts)
}

/// Runs `rtapi_app_main`; a refused start closes the object again.
fn start(object: NonNull<c_void>, world: &World) -> Result<(), LoadError> {
    let main = function!(object, "rtapi_app_main", PlainFn);
    // SAFETY: parameters are set, the HAL world is entered.
    let code = main.map_or(-1, |main| unsafe { main() });
    if code >= 0 && world.is_ready() {
        return Ok(());
    }
    let messages = world.messages().into_iter().map(|message| message.text).collect();
    // SAFETY: nothing of the object is in use.
    unsafe { libc::dlclose(object.as_ptr()) };
    Err(LoadError { code, messages })
}
