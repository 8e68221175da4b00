// SPDX-License-Identifier: GPL-2.0-or-later
//! The functions for the page. One block of memory each transfers numbers and text; the page reads its address once.

// Names without mangling, and the one state of a program without threads.
#![allow(unsafe_code)]

use crate::{Described, Drawn, MARGIN, NUMBERS};
use core::cell::UnsafeCell;
use kinematics::{Cause, Fault, MAX_JOINTS, MAX_LEGS, Machine, Text};

/// Bytes of a message, as the module keeps them.
const MESSAGE: usize = 512;

struct State {
    numbers: [f64; NUMBERS],
    text: Text<MESSAGE>,
    machine: Option<(Described, Machine)>,
}

struct Only(UnsafeCell<Option<State>>);

// SAFETY: wasm32-unknown-unknown without atomics has one thread.
unsafe impl Sync for Only {}

static STATE: Only = Only(UnsafeCell::new(None));

fn state() -> &'static mut State {
    // SAFETY: one thread, and no function here calls another exported one.
    let state = unsafe { &mut *STATE.0.get() };
    state.get_or_insert_with(|| State {
        numbers: [0.0; NUMBERS],
        text: Text::of(&[]),
        machine: None,
    })
}

/// Returns the address of the block of numbers.
#[unsafe(no_mangle)]
pub extern "C" fn numbers() -> *mut f64 {
    state().numbers.as_mut_ptr()
}

/// Returns the capacity of the block.
#[unsafe(no_mangle)]
pub extern "C" fn capacity() -> usize {
    NUMBERS
}

/// Returns the number of joint values in an answer.
#[unsafe(no_mangle)]
pub extern "C" fn most_joints() -> usize {
    MAX_JOINTS
}

/// Returns the number of legs in an answer.
#[unsafe(no_mangle)]
pub extern "C" fn most_legs() -> usize {
    MAX_LEGS
}

/// Returns the size of a margin in numbers.
#[unsafe(no_mangle)]
pub extern "C" fn margin_length() -> usize {
    MARGIN
}

/// Returns the address of the last refusal's message.
#[unsafe(no_mangle)]
pub extern "C" fn message() -> *const u8 {
    state().text.as_str().as_ptr()
}

/// Returns the length of the message in bytes.
#[unsafe(no_mangle)]
pub extern "C" fn message_length() -> usize {
    state().text.as_str().len()
}

/// Reads the machine from the first `count` numbers: returns 1, or 0 if they describe none.
#[unsafe(no_mangle)]
pub extern "C" fn take_machine(count: usize) -> i32 {
    let state = state();
    let described = state.numbers.get(..count).and_then(Described::read);
    state.machine = described.and_then(|described| Some((described, described.freeze()?)));
    i32::from(state.machine.is_some())
}

/// Draws the pose and tool vector in the first nine numbers: returns 0 and overwrites them with the answer, or
/// returns the code of a refusal, with its message.
#[unsafe(no_mangle)]
pub extern "C" fn draw() -> i32 {
    let state = state();
    let drawn = drawn(&state.machine, &state.numbers);
    match drawn {
        Ok(drawn) => {
            let mut places = state.numbers.iter_mut();
            drawn.write(|value| {
                if let Some(place) = places.next() {
                    *place = value;
                }
            });
            0
        }
        Err(fault) => {
            state.text = Text::of(&[]);
            fault.write_message(&mut state.text);
            fault.cause.code()
        }
    }
}

fn drawn(machine: &Option<(Described, Machine)>, numbers: &[f64; NUMBERS]) -> Result<Drawn, Fault> {
    let (described, machine) = machine.as_ref().ok_or(Cause::NoGeometry)?;
    let [x, y, z, a, b, c, tool_x, tool_y, tool_z, ..] = *numbers;
    let (pose, tool) = ([x, y, z, a, b, c], [tool_x, tool_y, tool_z]);
    Drawn::new(machine, described.geometry.centre, &described.limits, pose, tool)
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    core::arch::wasm32::unreachable()
}
