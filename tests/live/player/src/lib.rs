// SPDX-License-Identifier: GPL-2.0-or-later
//! `pkmkins_truth.so`: simulates the true machine in a simulated LinuxCNC, with a probe and a plate.
//!
//! ```text
//! loadrt pkmkins_truth machine=true.ini plate=plate.toml pose=x,y,z,a,b,c
//! ```
//!
//! The true machine is described by an INI file other than LinuxCNC's. In every servo
//! cycle it computes from the joints (`pkmkins_truth.joint-N`), by the core's forward kinematics of that
//! machine, the true position of the probe's ball (`.tool-x` … `-z`), `.x .y .z`; `.touch` is on while
//! the ball touches the plate at `pose`. As a function of the servo thread it responds in the
//! cycle of the contact: its delay is the motion of one cycle, speed times period.
//!
//! Only for simulation: files are read when it is loaded. It allocates nothing in a cycle.

use calibrate::model::Frame;
use calibrate::plate::Plate;
use kinematics::{Joints, MAX_JOINTS, Pose, Solver, Vector3};
use machine::read::machine::MachineConfig;
use machine::read::mechanism::Mechanism;
use std::cell::UnsafeCell;
use std::error::Error;
use std::ffi::{CStr, CString, c_char, c_int, c_long, c_void};
use std::path::Path;
use std::ptr::null_mut;

const NAME: &CStr = c"pkmkins_truth";
const IN: c_int = 16;
const OUT: c_int = 32;
const RTAPI_MSG_ERR: c_int = 1;
const EINVAL: c_int = 22;

unsafe extern "C" {
    fn hal_init(name: *const c_char) -> c_int;
    fn hal_exit(component: c_int) -> c_int;
    fn hal_ready(component: c_int) -> c_int;
    fn hal_malloc(size: c_long) -> *mut c_void;
    fn hal_pin_float_new(
        name: *const c_char,
        direction: c_int,
        pin: *mut *mut f64,
        component: c_int,
    ) -> c_int;
    fn hal_pin_bit_new(
        name: *const c_char,
        direction: c_int,
        pin: *mut *mut bool,
        component: c_int,
    ) -> c_int;
    fn hal_export_funct(
        name: *const c_char,
        function: unsafe extern "C" fn(*mut c_void, c_long),
        argument: *mut c_void,
        uses_fp: c_int,
        reentrant: c_int,
        component: c_int,
    ) -> c_int;
    fn rtapi_print_msg(level: c_int, format: *const c_char, ...);
}

/// A load parameter, with the data that rtapi_app looks up by symbol.
#[repr(transparent)]
pub struct Shared<T>(UnsafeCell<T>);

// SAFETY: rtapi_app writes parameters before rtapi_app_main runs, and never calls main, exit and the
// function of the thread at the same time.
unsafe impl<T> Sync for Shared<T> {}

macro_rules! parameter {
    ($static:ident, $address:ident, $type:ident, $description:ident, $text:literal) => {
        static $static: Shared<*mut c_char> = Shared(UnsafeCell::new(null_mut()));
        #[unsafe(no_mangle)]
        #[allow(non_upper_case_globals)]
        static $address: Shared<*const c_void> =
            Shared(UnsafeCell::new((&raw const $static).cast()));
        #[unsafe(no_mangle)]
        #[allow(non_upper_case_globals)]
        static $type: Shared<*const c_char> = Shared(UnsafeCell::new(c"s".as_ptr()));
        #[unsafe(no_mangle)]
        #[allow(non_upper_case_globals)]
        static $description: Shared<*const c_char> = Shared(UnsafeCell::new($text.as_ptr()));
    };
}

parameter!(
    MACHINE,
    rtapi_info_address_machine,
    rtapi_info_type_machine,
    rtapi_info_description_machine,
    c"INI file of the machine as built"
);
parameter!(
    PLATE,
    rtapi_info_address_plate,
    rtapi_info_type_plate,
    rtapi_info_description_plate,
    c"TOML file of the plate"
);
parameter!(
    POSE,
    rtapi_info_address_pose,
    rtapi_info_type_pose,
    rtapi_info_description_pose,
    c"where the plate lies: x,y,z,a,b,c"
);

#[unsafe(no_mangle)]
#[allow(non_upper_case_globals)]
static rtapi_info_license: Shared<*const c_char> = Shared(UnsafeCell::new(c"GPL".as_ptr()));

/// Pins, in HAL memory.
#[repr(C)]
struct Pins {
    joint: [*mut f64; MAX_JOINTS],
    tool: [*mut f64; 3],
    tip: [*mut f64; 3],
    touch: *mut bool,
}

/// The state between cycles.
struct Truth {
    component: c_int,
    pins: *mut Pins,
    config: Mechanism,
    plate: Plate,
    frame: Frame,
    last: Pose,
}

static TRUTH: Shared<Option<Truth>> = Shared(UnsafeCell::new(None));

impl Truth {
    fn cycle(&mut self) {
        // SAFETY: HAL keeps the pins' pointers valid from their creation on.
        let pins = unsafe { &*self.pins };
        // SAFETY: as above; other threads write the values.
        let read = |pin: &*mut f64| unsafe { pin.read_volatile() };
        let mut joints: Joints = [0.0; MAX_JOINTS];
        for (joint, pin) in joints.iter_mut().zip(&pins.joint).take(self.config.joints.len()) {
            *joint = read(pin);
        }
        let tool = Vector3::from_fn(|k, _| read(&pins.tool[k]));
        let solved = self.config.machine.forward(&joints, &self.last, &tool, &Solver::default());
        let Ok(solution) = solved else {
            self.last = self.config.home_pose();
            // SAFETY: as above.
            unsafe { pins.touch.write_volatile(false) };
            return;
        };
        self.last = solution.pose;
        let tip = solution.pose.position - tool;
        let touch = is_touching(&self.plate, &self.frame.seen(&tip));
        for (k, pin) in pins.tip.iter().enumerate() {
            // SAFETY: as above.
            unsafe { pin.write_volatile(tip[k]) };
        }
        // SAFETY: as above.
        unsafe { pins.touch.write_volatile(touch) };
    }
}

/// Returns whether a ball with its center there touches the plate, which is solid except for its holes.
fn is_touching(plate: &Plate, centre: &Vector3<f64>) -> bool {
    let radius = plate.ball / 2.0;
    let inside = plate.hole.iter().find_map(|hole| {
        let [x, y] = hole.place;
        let free = hole.diameter / 2.0 - (centre.x - x).hypot(centre.y - y);
        (free > 0.0).then_some(free)
    });
    match inside {
        // Distance to the wall, or above the face to the edge.
        Some(free) => free.hypot(centre.z.max(0.0)) < radius,
        None => centre.z < radius,
    }
}

fn text(parameter: &Shared<*mut c_char>) -> Result<String, String> {
    // SAFETY: only rtapi_app writes it, before main.
    let pointer = unsafe { *parameter.0.get() };
    if pointer.is_null() {
        return Err("expected machine=FILE plate=FILE pose=x,y,z,a,b,c".into());
    }
    // SAFETY: a text of rtapi_app ends with a zero.
    Ok(unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned())
}

fn loaded() -> Result<(Mechanism, Plate, Frame), Box<dyn Error>> {
    let file = text(&MACHINE)?;
    let config = MachineConfig::read(Path::new(&file))?.first().clone();
    let plate = Plate::read(Path::new(&text(&PLATE)?), config.units_per_mm)?;
    let pose = text(&POSE)?;
    let numbers: Option<Vec<f64>> = pose.split(',').map(|word| word.parse().ok()).collect();
    let pose: Option<[f64; 6]> = numbers.and_then(|numbers| numbers.try_into().ok());
    let pose = Pose::from_degrees(pose.ok_or("pose: expected six numbers x,y,z,a,b,c")?);
    Ok((config, plate, Frame { origin: pose.position, rotation: pose.rotation() }))
}

/// Creates the pins of a component.
///
/// # Safety
/// `pins` must be in HAL memory.
unsafe fn make_pins(component: c_int, pins: *mut Pins, joints: usize) -> Result<(), String> {
    // SAFETY: the caller guarantees the memory.
    let pins = unsafe { &mut *pins };
    let float = |name: String, direction: c_int, pin: *mut *mut f64| {
        let full = CString::new(format!("pkmkins_truth.{name}")).unwrap_or_default();
        // SAFETY: the name ends with a zero, the pin is in HAL memory.
        let code = unsafe { hal_pin_float_new(full.as_ptr(), direction, pin, component) };
        if code < 0 { Err(format!("pin {name}: code {code}")) } else { Ok(()) }
    };
    for (n, pin) in pins.joint.iter_mut().enumerate().take(joints) {
        float(format!("joint-{n}"), IN, pin)?;
    }
    for (k, letter) in ["x", "y", "z"].into_iter().enumerate() {
        float(format!("tool-{letter}"), IN, &mut pins.tool[k])?;
        float(letter.into(), OUT, &mut pins.tip[k])?;
    }
    // SAFETY: as above.
    match unsafe {
        hal_pin_bit_new(c"pkmkins_truth.touch".as_ptr(), OUT, &mut pins.touch, component)
    } {
        code if code < 0 => Err(format!("pin touch: code {code}")),
        _ => Ok(()),
    }
}

fn start() -> Result<Truth, Box<dyn Error>> {
    let (config, plate, frame) = loaded()?;
    // SAFETY: the name ends with a zero.
    let component = unsafe { hal_init(NAME.as_ptr()) };
    // SAFETY: a plain request for memory.
    let pins = unsafe { hal_malloc(size_of::<Pins>() as c_long) }.cast::<Pins>();
    if component < 0 || pins.is_null() {
        return Err("LinuxCNC refused the component".into());
    }
    // SAFETY: hal_malloc returned that many bytes, aligned to 8.
    unsafe { pins.cast::<u8>().write_bytes(0, size_of::<Pins>()) };
    // SAFETY: HAL memory.
    unsafe { make_pins(component, pins, config.joints.len())? };
    // SAFETY: the name ends with a zero, the function takes a null argument.
    let code = unsafe { hal_export_funct(NAME.as_ptr(), cycle, null_mut(), 1, 0, component) };
    // SAFETY: the component is that of hal_init.
    if code < 0 || unsafe { hal_ready(component) } < 0 {
        return Err("LinuxCNC refused the function".into());
    }
    let last = config.home_pose();
    Ok(Truth { component, pins, config, plate, frame, last })
}

unsafe extern "C" fn cycle(_: *mut c_void, _: c_long) {
    // SAFETY: only the servo thread calls this, and never during main or exit.
    if let Some(truth) = unsafe { (*TRUTH.0.get()).as_mut() } {
        truth.cycle();
    }
}

/// Loads the component.
#[unsafe(no_mangle)]
pub extern "C" fn rtapi_app_main() -> c_int {
    match start() {
        Ok(truth) => {
            // SAFETY: no thread runs the function yet.
            unsafe { *TRUTH.0.get() = Some(truth) };
            0
        }
        Err(error) => {
            let text = CString::new(error.to_string()).unwrap_or_default();
            // SAFETY: both strings end with a zero, and "%s" takes one.
            unsafe {
                rtapi_print_msg(RTAPI_MSG_ERR, c"pkmkins_truth: %s\n".as_ptr(), text.as_ptr())
            };
            -EINVAL
        }
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn rtapi_app_exit() {
    // SAFETY: LinuxCNC stops its threads before.
    if let Some(truth) = unsafe { (*TRUTH.0.get()).take() } {
        // SAFETY: the component is that of hal_init.
        unsafe { hal_exit(truth.component) };
    }
}
