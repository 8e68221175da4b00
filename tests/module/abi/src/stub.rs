// SPDX-License-Identifier: GPL-2.0-or-later
//! The stub HAL (`tests/module/stub_hal/stub_hal.c`) and the loading of shared libraries.

use std::ffi::{CStr, CString, c_char, c_int, c_long, c_longlong, c_ulong, c_void};
use std::path::Path;
use std::ptr::NonNull;
use std::sync::OnceLock;

/// A pin's type, as numbered by `hal.h`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum PinType {
    /// `hal_bit_t`
    Bit,
    /// `hal_float_t`
    Float,
    /// `hal_s32_t`
    S32,
    /// `hal_u32_t`
    U32,
}

/// A pin's direction from the module's view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum PinDir {
    /// Read by the module.
    In,
    /// Written by the module.
    Out,
    Io,
    /// A parameter that only the module writes.
    ReadOnly,
    /// A parameter that `setp` may write.
    ReadWrite,
}

/// One pin of a world, or one parameter.
#[derive(Clone, Debug)]
pub struct Pin {
    /// Full HAL name.
    pub name: String,
    pub kind: PinType,
    /// Direction.
    pub dir: PinDir,
    cell: *mut c_void,
}

impl Pin {
    /// Returns the pin's value; bits are 0 or 1.
    pub fn get(&self) -> f64 {
        // SAFETY: the stub keeps a cell of the pin's type alive as long as its
        // world, and a world outlives the pins handed out by its module.
        unsafe {
            match self.kind {
                PinType::Bit => f64::from(u8::from(self.cell.cast::<bool>().read_volatile())),
                PinType::Float => self.cell.cast::<f64>().read_volatile(),
                PinType::S32 => f64::from(self.cell.cast::<i32>().read_volatile()),
                PinType::U32 => f64::from(self.cell.cast::<u32>().read_volatile()),
            }
        }
    }

    /// Sets the pin, as `setp` would.
    pub fn set(&self, value: f64) {
        // SAFETY: as in `get`.
        unsafe {
            match self.kind {
                PinType::Bit => self.cell.cast::<bool>().write_volatile(value != 0.0),
                PinType::Float => self.cell.cast::<f64>().write_volatile(value),
                PinType::S32 => self.cell.cast::<i32>().write_volatile(value as i32),
                PinType::U32 => self.cell.cast::<u32>().write_volatile(value as u32),
            }
        }
    }
}

/// A message of the module, with RTAPI's level (1 = error).
#[derive(Clone, Debug)]
pub struct Message {
    pub level: i32,
    pub text: String,
}

/// Advances the clock of this thread's modules, which otherwise counts its own calls.
pub fn pass_time(nanoseconds: i64) {
    // SAFETY: takes a number and adds it.
    unsafe { (stub().pass_time)(nanoseconds) }
}

/// Opens a shared library. `global` makes its symbols visible to later ones.
/// # Errors
/// The dynamic linker's message.
pub fn open(path: &Path, global: bool) -> Result<NonNull<c_void>, String> {
    let scope = if global { libc::RTLD_GLOBAL } else { libc::RTLD_LOCAL };
    open_as(path, libc::RTLD_NOW | scope)
}

/// Opens a shared library without looking up its symbols before they are needed.
/// # Errors
/// The dynamic linker's message.
pub fn open_lazily(path: &Path) -> Result<NonNull<c_void>, String> {
    open_as(path, libc::RTLD_LAZY | libc::RTLD_LOCAL)
}

fn open_as(path: &Path, flags: c_int) -> Result<NonNull<c_void>, String> {
    let name = CString::new(path.as_os_str().as_encoded_bytes()).expect("a path without NUL");
    // SAFETY: the libraries are kinematics modules and the stub; their
    // constructors do nothing beyond libc's.
    let handle = unsafe { libc::dlopen(name.as_ptr(), flags) };
    NonNull::new(handle).ok_or_else(|| {
        // SAFETY: dlerror returns a string that lives until the next dl call.
        unsafe { CStr::from_ptr(libc::dlerror()) }.to_string_lossy().into_owned()
    })
}

/// Returns the address of `name` in an open library.
pub fn symbol(library: NonNull<c_void>, name: &str) -> Option<NonNull<c_void>> {
    let name = CString::new(name).expect("a symbol without NUL");
    // SAFETY: `library` came from `open` and is not closed while in use.
    NonNull::new(unsafe { libc::dlsym(library.as_ptr(), name.as_ptr()) })
}

/// Looks up a function and casts it to its C type.
macro_rules! function {
    ($library:expr, $name:expr, $type:ty) => {
        $crate::stub::symbol($library, $name).map(|address| {
            // SAFETY: the C check in tests/module/c compares this symbol's prototype
            // with LinuxCNC's header; the type here repeats it.
            unsafe { std::mem::transmute::<*mut std::ffi::c_void, $type>(address.as_ptr()) }
        })
    };
}
pub(crate) use function;

struct Stub {
    world_new: unsafe extern "C" fn() -> *mut c_void,
    world_free: unsafe extern "C" fn(*mut c_void),
    world_enter: unsafe extern "C" fn(*mut c_void),
    pin_count: unsafe extern "C" fn(*const c_void) -> c_int,
    pin_name: unsafe extern "C" fn(*const c_void, c_int) -> *const c_char,
    pin_type: unsafe extern "C" fn(*const c_void, c_int) -> c_int,
    pin_dir: unsafe extern "C" fn(*const c_void, c_int) -> c_int,
    pin_value: unsafe extern "C" fn(*mut c_void, c_int) -> *mut c_void,
    message_count: unsafe extern "C" fn(*const c_void) -> c_int,
    message_text: unsafe extern "C" fn(*const c_void, c_int) -> *const c_char,
    message_level: unsafe extern "C" fn(*const c_void, c_int) -> c_int,
    messages_clear: unsafe extern "C" fn(*mut c_void),
    ready: unsafe extern "C" fn(*const c_void) -> c_int,
    exited: unsafe extern "C" fn(*const c_void) -> c_int,
    calls: unsafe extern "C" fn(*const c_void) -> c_ulong,
    funct_call: unsafe extern "C" fn(*mut c_void, *const c_char, c_long) -> c_int,
    pass_time: unsafe extern "C" fn(c_longlong),
}

fn stub() -> &'static Stub {
    static STUB: OnceLock<Stub> = OnceLock::new();
    STUB.get_or_init(|| {
        let library = open(Path::new(env!("STUB_HAL_SO")), true).expect("the stub HAL opens");
        macro_rules! find {
            ($($field:ident),*) => {
                Stub { $($field: function!(library, concat!("stub_", stringify!($field)), _)
                    .expect(concat!("stub_", stringify!($field)))),* }
            };
        }
        find!(
            world_new,
            world_free,
            world_enter,
            pin_count,
            pin_name,
            pin_type,
            pin_dir,
            pin_value,
            message_count,
            message_text,
            message_level,
            messages_clear,
            ready,
            exited,
            calls,
            pass_time,
            funct_call
        )
    })
}

/// One module's HAL: its pins, functions and messages.
pub struct World(NonNull<c_void>);

impl World {
    /// Creates an empty HAL.
    #[expect(clippy::new_without_default, reason = "a world is a resource, not a value")]
    pub fn new() -> World {
        // SAFETY: allocates; no precondition.
        World(NonNull::new(unsafe { (stub().world_new)() }).expect("memory for a stub HAL"))
    }

    /// Makes this the HAL of this thread's next calls.
    pub fn enter(&self) {
        // SAFETY: the pointer is alive as long as self.
        unsafe { (stub().world_enter)(self.0.as_ptr()) }
    }

    /// Returns all pins in the order of their creation.
    pub fn pins(&self) -> Vec<Pin> {
        let world = self.0.as_ptr();
        // SAFETY: indices below the count, pointer alive as long as self.
        unsafe {
            (0..(stub().pin_count)(world))
                .map(|i| Pin {
                    name: text((stub().pin_name)(world, i)),
                    kind: pin_type((stub().pin_type)(world, i)),
                    dir: pin_dir((stub().pin_dir)(world, i)),
                    cell: (stub().pin_value)(world, i),
                })
                .collect()
        }
    }

    /// Returns the module's messages since the last [`World::clear_messages`].
    pub fn messages(&self) -> Vec<Message> {
        let world = self.0.as_ptr();
        // SAFETY: as in `pins`.
        unsafe {
            (0..(stub().message_count)(world))
                .map(|i| Message {
                    level: (stub().message_level)(world, i),
                    text: text((stub().message_text)(world, i)),
                })
                .collect()
        }
    }

    pub fn clear_messages(&self) {
        // SAFETY: pointer alive as long as self.
        unsafe { (stub().messages_clear)(self.0.as_ptr()) }
    }

    /// Returns whether the module called `hal_ready`.
    pub fn is_ready(&self) -> bool {
        // SAFETY: as above.
        unsafe { (stub().ready)(self.0.as_ptr()) != 0 }
    }

    /// Returns whether the module called `hal_exit`.
    pub fn has_exited(&self) -> bool {
        // SAFETY: as above.
        unsafe { (stub().exited)(self.0.as_ptr()) != 0 }
    }

    /// Returns the number of calls to HAL and RTAPI so far.
    pub fn calls(&self) -> u64 {
        // SAFETY: as above.
        unsafe { (stub().calls)(self.0.as_ptr()) }
    }

    /// Runs an exported function as a thread of `period` nanoseconds would.
    /// Returns false if the module exported none of this name.
    pub fn run(&self, name: &str, period: i64) -> bool {
        self.enter();
        let name = CString::new(name).expect("a name without NUL");
        // SAFETY: as above; the module that exported the function is still loaded.
        unsafe { (stub().funct_call)(self.0.as_ptr(), name.as_ptr(), period) == 0 }
    }
}

impl Drop for World {
    fn drop(&mut self) {
        // SAFETY: created by world_new, freed once; Module closes the library first.
        unsafe { (stub().world_free)(self.0.as_ptr()) }
    }
}

/// # Safety
/// `pointer` is a NUL-terminated string.
unsafe fn text(pointer: *const c_char) -> String {
    // SAFETY: passed on from the caller.
    unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned()
}

fn pin_type(number: c_int) -> PinType {
    match number {
        1 => PinType::Bit,
        2 => PinType::Float,
        3 => PinType::S32,
        4 => PinType::U32,
        other => panic!("pin type {other} is none of hal.h's"),
    }
}

fn pin_dir(number: c_int) -> PinDir {
    match number {
        16 => PinDir::In,
        32 => PinDir::Out,
        48 => PinDir::Io,
        64 => PinDir::ReadOnly,
        192 => PinDir::ReadWrite,
        other => panic!("pin direction {other} is none of hal.h's"),
    }
}
