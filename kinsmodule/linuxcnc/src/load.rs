// SPDX-License-Identifier: GPL-2.0-or-later
//! Load parameters and module information, as `rtapi_app` looks them up by symbol.

use core::ffi::{CStr, c_char, c_void};
use core::ptr::null_mut;

/// A pointer that LinuxCNC reads or sets before any thread runs.
#[repr(transparent)]
struct Shared<T>(T);

// SAFETY: rtapi_app reads these once at load, from one thread; the module never writes them.
unsafe impl<T> Sync for Shared<T> {}

/// Where rtapi_app puts the text of a string parameter.
#[repr(transparent)]
pub struct Parameter(core::cell::UnsafeCell<*mut c_char>);

// SAFETY: written by rtapi_app before rtapi_app_main, read by rtapi_app_main only.
unsafe impl Sync for Parameter {}

impl Parameter {
    const fn new() -> Self {
        Self(core::cell::UnsafeCell::new(null_mut()))
    }

    /// The text given at load, or `None`.
    pub fn text(&self) -> Option<&CStr> {
        // SAFETY: only rtapi_app writes the cell, before this is called.
        let text = unsafe { *self.0.get() };
        // SAFETY: a non-null text ends with a zero and stays until the module is unloaded.
        (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) })
    }
}

macro_rules! string_parameter {
    ($name:ident, $upper:ident, $address:ident, $type:ident, $description:ident, $text:literal) => {
        pub static $upper: Parameter = Parameter::new();
        #[unsafe(no_mangle)]
        #[allow(non_upper_case_globals)]
        static $address: Shared<*mut c_void> = Shared((&raw const $upper).cast_mut().cast());
        #[unsafe(no_mangle)]
        #[allow(non_upper_case_globals)]
        static $type: Shared<*const c_char> = Shared(c"s".as_ptr());
        #[unsafe(no_mangle)]
        #[allow(non_upper_case_globals)]
        static $description: Shared<*const c_char> = Shared($text.as_ptr());
    };
}

string_parameter!(
    legs,
    LEGS,
    rtapi_info_address_legs,
    rtapi_info_type_legs,
    rtapi_info_description_legs,
    c"kinds and numbers of legs (strut, slider, crank, ring), such as strut:6 or slider:4"
);
string_parameter!(
    coordinates,
    COORDINATES,
    rtapi_info_address_coordinates,
    rtapi_info_type_coordinates,
    rtapi_info_description_coordinates,
    c"pose letters that the legs move; their order is that of the identity kinematics"
);
string_parameter!(
    table,
    TABLE,
    rtapi_info_address_table,
    rtapi_info_type_table,
    rtapi_info_description_table,
    c"serial axes under the workpiece, some of X Y Z"
);

string_parameter!(
    axes,
    AXES,
    rtapi_info_address_axes,
    rtapi_info_type_axes,
    rtapi_info_description_axes,
    c"joints behind legs and table that pass their coordinate through, some of X Y Z A B C U V W"
);

string_parameter!(
    boxes,
    BOXES,
    rtapi_info_address_boxes,
    rtapi_info_type_boxes,
    rtapi_info_description_boxes,
    c"number of workspace boxes in which a start without a seed searches"
);

string_parameter!(
    second,
    SECOND,
    rtapi_info_address_second,
    rtapi_info_type_second,
    rtapi_info_description_second,
    c"kinds and numbers of legs of a second mechanism, as legs"
);

string_parameter!(
    second_coordinates,
    SECOND_COORDINATES,
    rtapi_info_address_second_coordinates,
    rtapi_info_type_second_coordinates,
    rtapi_info_description_second_coordinates,
    c"coordinates that its legs move, as its own X Y Z A B C; U V W stand for X Y Z"
);

string_parameter!(
    second_angles,
    SECOND_ANGLES,
    rtapi_info_address_second_angles,
    rtapi_info_type_second_angles,
    rtapi_info_description_second_angles,
    c"letters of A B C that stand for its angles, in the order of second_coordinates"
);

string_parameter!(
    second_boxes,
    SECOND_BOXES,
    rtapi_info_address_second_boxes,
    rtapi_info_type_second_boxes,
    rtapi_info_description_second_boxes,
    c"number of its workspace boxes, as boxes"
);

string_parameter!(
    sparm,
    SPARM,
    rtapi_info_address_sparm,
    rtapi_info_type_sparm,
    rtapi_info_description_sparm,
    c"identityfirst: the identity kinematics are number 0, with which LinuxCNC starts"
);

#[unsafe(no_mangle)]
#[allow(non_upper_case_globals)]
static rtapi_info_license: Shared<*const c_char> = Shared(c"GPL".as_ptr());

/// Names that LinuxCNC's own tools read from this section of a module.
macro_rules! exported_names {
    ($($name:ident: $length:literal = $text:literal;)*) => {$(
        #[unsafe(link_section = ".rtapi_export")]
        #[used]
        static $name: [u8; $length] = *$text;
    )*};
}

exported_names! {
    EXPORT_FORWARD: 18 = b"kinematicsForward\0";
    EXPORT_INVERSE: 18 = b"kinematicsInverse\0";
    EXPORT_TYPE: 15 = b"kinematicsType\0";
    EXPORT_SWITCHABLE: 21 = b"kinematicsSwitchable\0";
    EXPORT_SWITCH: 17 = b"kinematicsSwitch\0";
    EXPORT_TYPE_FLAGS: 20 = b"kinematicsTypeFlags\0";
    EXPORT_SET_TOOL: 18 = b"kinematicsSetTool\0";
    EXPORT_JACOBIAN: 19 = b"kinematicsJacobian\0";
    EXPORT_TOOL_FRAME: 20 = b"kinematicsToolFrame\0";
    EXPORT_WORK_FRAME: 20 = b"kinematicsWorkFrame\0";
    EXPORT_MAIN: 15 = b"rtapi_app_main\0";
    EXPORT_EXIT: 15 = b"rtapi_app_exit\0";
}
