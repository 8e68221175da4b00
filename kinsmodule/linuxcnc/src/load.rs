// SPDX-License-Identifier: GPL-2.0-or-later
//! Load parameters and module information, as `rtapi_app` looks them up by symbol.

use core::ffi::{CStr, c_char, c_void};
use core::ptr::null_mut;
use kinematics::LOAD_PARAMETERS;

/// A pointer that LinuxCNC reads or sets before any thread runs.
#[repr(transparent)]
struct Shared<T>(T);

// SAFETY: rtapi_app reads these once at load, from one thread; the module never writes them.
unsafe impl<T> Sync for Shared<T> {}

/// A string parameter, whose text rtapi_app sets.
#[repr(transparent)]
pub struct Parameter(core::cell::UnsafeCell<*mut c_char>);

// SAFETY: written by rtapi_app before rtapi_app_main, read by rtapi_app_main only.
unsafe impl Sync for Parameter {}

impl Parameter {
    const fn new() -> Self {
        Self(core::cell::UnsafeCell::new(null_mut()))
    }

    /// Returns the text given at load, or `None`.
    pub fn text(&self) -> Option<&CStr> {
        // SAFETY: only rtapi_app writes the cell, before this is called.
        let text = unsafe { *self.0.get() };
        // SAFETY: a non-null text ends with a zero and stays until the module is unloaded.
        (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) })
    }
}

/// Compares two names; `==` does not at compile time.
const fn is_same(one: &[u8], other: &[u8]) -> bool {
    let mut i = 0;
    while i < one.len() && i < other.len() && one[i] == other[i] {
        i += 1;
    }
    i == one.len() && i == other.len()
}

/// Exports the parameters with the symbols that `rtapi_app` reads for each: address, type and description.
macro_rules! string_parameters {
    ($($name:ident: $text:literal;)*) => {
        $(#[allow(non_upper_case_globals, reason = "the name of the parameter")]
        static $name: Parameter = Parameter::new();

        const _: () = {
            #[unsafe(export_name = concat!("rtapi_info_address_", stringify!($name)))]
            static ADDRESS: Shared<*mut c_void> = Shared((&raw const $name).cast_mut().cast());
            #[unsafe(export_name = concat!("rtapi_info_type_", stringify!($name)))]
            static TYPE: Shared<*const c_char> = Shared(c"s".as_ptr());
            #[unsafe(export_name = concat!("rtapi_info_description_", stringify!($name)))]
            static DESCRIPTION: Shared<*const c_char> = Shared($text.as_ptr());
        };)*

        /// Number of load parameters.
        pub const COUNT: usize = [$($text),*].len();

        // `Load::of` has the same parameters in the same order.
        const _: () = {
            let (names, mut i) = ([$(stringify!($name)),*], 0);
            while i < COUNT {
                assert!(is_same(names[i].as_bytes(), LOAD_PARAMETERS[i].as_bytes()));
                i += 1;
            }
        };

        /// The load parameters, by name.
        pub static PARAMETERS: [(&str, &Parameter); COUNT] = [$((stringify!($name), &$name)),*];
    };
}

string_parameters! {
    legs: c"kinds and counts of legs (strut, slider, crank, ring), such as strut:6 or slider:4";
    coordinates: c"pose letters that the legs move, in the joint order of identity kinematics";
    table: c"serial axes under the workpiece, letters of X Y Z";
    axes: c"joints after legs and table with one coordinate each, letters of X Y Z A B C U V W";
    boxes: c"number of workspace boxes for the start without a seed";
    second: c"kinds and counts of legs of a second mechanism, as in legs";
    second_coordinates: c"coordinates that its legs move, in its own X Y Z A B C; its X Y Z become U V W";
    second_angles: c"letters of A B C for its angles, in the order of second_coordinates";
    second_boxes: c"number of its workspace boxes, as in boxes";
    constraints: c"number of constraints of the platform by passive joints, which determine the coordinates that are not in coordinates";
    sparm: c"identityfirst (identity kinematics are type 0, active at startup), and parameters as NAME=VALUE, separated by /";
}

#[unsafe(no_mangle)]
#[allow(non_upper_case_globals)]
static rtapi_info_license: Shared<*const c_char> = Shared(c"GPL".as_ptr());

/// Exports names for LinuxCNC's own tools, which read what a module exports.
macro_rules! exported_names {
    ($($name:literal)*) => {$(const _: () = {
        #[unsafe(link_section = ".rtapi_export")]
        #[used]
        static NAME: [u8; $name.len()] = *$name;
    };)*};
}

exported_names! {
    b"kinematicsForward\0" b"kinematicsInverse\0" b"kinematicsType\0" b"kinematicsSwitchable\0"
    b"kinematicsSwitch\0" b"kinematicsTypeFlags\0" b"kinematicsSetTool\0" b"kinematicsJacobian\0"
    b"kinematicsToolFrame\0" b"kinematicsWorkFrame\0" b"kinematicsToolFrameInverse\0" b"kinsDescribe\0" b"rtapi_app_main\0" b"rtapi_app_exit\0"
}
