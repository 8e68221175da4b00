// SPDX-License-Identifier: GPL-2.0-or-later
//! Load and unload: from the load parameters to pins and state, and back.

use crate::abi::monitor;
use crate::between::{Between, BetweenPins};
use crate::control::{Control, Second};
use crate::hal::{Component, HalError, print_error};
use crate::load::{COUNT, PARAMETERS};
use crate::module::Module;
use crate::pins::{Maker, Pins, Place, Target};
use core::cell::UnsafeCell;
use core::ffi::{CStr, c_int};
use kinematics::{Load, LoadError, text};

/// The component and its state.
struct Loaded {
    component: Component,
    control: Control,
}

/// A cell for the component, once it is loaded.
struct Cell(UnsafeCell<Option<Loaded>>);

// SAFETY: LinuxCNC calls the kinematics from its servo thread only, and main and exit
// while no thread runs.
unsafe impl Sync for Cell {}

static LOADED: Cell = Cell(UnsafeCell::new(None));

/// Returns the state, if the component is loaded.
///
/// # Safety
/// No other reference to it may be alive: an exported function calls this once,
/// from LinuxCNC's servo thread, or while no thread runs.
pub unsafe fn control<'a>() -> Option<&'a mut Control> {
    // SAFETY: the caller guarantees that this is the only reference.
    unsafe { (*LOADED.0.get()).as_mut() }.map(|loaded| &mut loaded.control)
}

/// Loads the component: parameters, pins, state. Returns 0, or a negative errno.
#[unsafe(no_mangle)]
pub extern "C" fn rtapi_app_main() -> c_int {
    let texts = PARAMETERS.each_ref().map(|(_, parameter)| parameter.text());
    let load = match Load::of(texts.map(|text| text.map(CStr::to_bytes))) {
        Ok(load) => load,
        Err(error) => {
            refuse_load(error, texts);
            return -libc::EINVAL;
        }
    };
    match start(&load) {
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
    if let Some(Loaded { component, .. }) = unsafe { (*LOADED.0.get()).take() } {
        component.exit();
    }
}

fn start(load: &Load) -> Result<(), HalError> {
    let component = Component::new(c"pkmkins")?;
    let started = build(component, load).and_then(|control| {
        // SAFETY: no thread runs yet.
        unsafe { *LOADED.0.get() = Some(Loaded { component, control }) };
        component.export(c"pkmkins.monitor", monitor)?;
        component.ready()
    });
    if started.is_err() {
        // SAFETY: as above.
        unsafe { *LOADED.0.get() = None };
        component.exit();
    }
    started
}

/// Creates pins and state of all mechanisms.
fn build(component: Component, load: &Load) -> Result<Control, HalError> {
    let pins = make_pins(component, load, Place::FIRST)?;
    let mut control = Control { first: Module::new(pins, *load, Place::FIRST), second: None };
    if let (Some(alone), Some(letters)) = (load.of_second(), load.second()) {
        let (leg, joint) = (load.layout.legs() as u8, load.layout.joints() as u8);
        let place = Place { leg, joint, is_second: true };
        let own = make_pins(component, &alone, place)?;
        own.share(pins);
        let between = zeroed::<BetweenPins>(component)?;
        between.create(&Maker { target: Target::Hal(component), place })?;
        let (module, between) = (Module::new(own, alone, place), Between::new(between));
        control.second = Some(Second { module, letters: *letters, between });
    }
    Ok(control)
}

fn make_pins(component: Component, load: &Load, place: Place) -> Result<&'static Pins, HalError> {
    let pins = zeroed::<Pins>(component)?;
    pins.create(component, load, place)?;
    Ok(pins)
}

/// Returns pins in fresh HAL memory, not yet created: all-zero bytes are null pins.
fn zeroed<T>(component: Component) -> Result<&'static mut T, HalError> {
    let pins = component.allocate::<T>()?;
    // SAFETY: HAL memory of this size, of structures that contain only pins, which lives as long as
    // LinuxCNC; no other reference to it exists.
    Ok(unsafe { &mut *pins })
}

/// Reports why the load parameters are refused.
fn refuse_load(error: LoadError, texts: [Option<&CStr>; COUNT]) {
    let mut message = text!["pkmkins: refused"];
    for ((name, _), value) in PARAMETERS.iter().zip(texts) {
        // Those of a second mechanism and sparm only if they are given.
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
