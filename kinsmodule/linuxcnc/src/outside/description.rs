// SPDX-License-Identifier: GPL-2.0-or-later
//! The description: what a load line and its table of parameters say, made once in a copy of the module.

use super::interface::KINS_MAX_PARAMS;
use super::table::Table;
use crate::hal::Message;
use crate::pins::{MachinePins, Maker, Place, Target};
use core::cell::UnsafeCell;
use core::ffi::c_int;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicU8, Ordering};
use kinematics::{Load, Text, text};

/// A configuration and its table of parameters.
pub struct Description {
    pub load: Load,
    /// Each refers to its value of the block.
    pub pins: MachinePins,
    /// The letters of `coordinates`, with a zero.
    pub letters: Text<8>,
}

const FREE: u8 = 0;
const BEING_MADE: u8 = 1;
const MADE: u8 = 2;

/// How often a caller waits for another one that makes the description, which takes some microseconds.
const MOST_WAITS: u32 = 1 << 28;

struct Shelf {
    state: AtomicU8,
    table: Table,
    description: UnsafeCell<MaybeUninit<Description>>,
}

// SAFETY: table and description are written by the caller that has changed the state from FREE to BEING_MADE,
// and read by others once it is MADE.
unsafe impl Sync for Shelf {}

static SHELF: Shelf = Shelf {
    state: AtomicU8::new(FREE),
    table: Table::new(),
    description: UnsafeCell::new(MaybeUninit::uninit()),
};

/// Returns the description, if there is one.
pub fn described() -> Option<&'static Description> {
    let is_made = SHELF.state.load(Ordering::Acquire) == MADE;
    // SAFETY: written before the state was set, and unchanged from then on.
    is_made.then(|| unsafe { (*SHELF.description.get()).assume_init_ref() })
}

/// Returns the table of parameters of the description.
pub fn table() -> &'static Table {
    &SHELF.table
}

/// Why a configuration is not described.
pub enum Refusal {
    SecondMechanism,
    /// With the number of parameters of the machine.
    TooManyParameters(c_int),
    AnotherMachine,
    AnotherCaller,
}

impl Refusal {
    /// Returns the message.
    pub fn text(&self) -> Message {
        match self {
            Self::SecondMechanism => text![
                "a block has one pose and one tool, but second= has a second mechanism with its own"
            ],
            Self::TooManyParameters(wanted) => text![
                "the machine has ",
                *wanted,
                " parameters, but a block has ",
                KINS_MAX_PARAMS,
                " (KINS_MAX_PARAMS)"
            ],
            Self::AnotherMachine => {
                text![
                    "this copy of the module describes another machine: close it, then open it again"
                ]
            }
            Self::AnotherCaller => {
                text!["another caller could not describe a machine: describe it again"]
            }
        }
    }
}

/// Returns the description of a configuration, made if it is the first one of this copy of the module.
pub fn describe(load: &Load) -> Result<&'static Description, Refusal> {
    if load.second().is_some() {
        return Err(Refusal::SecondMechanism);
    }
    let first =
        SHELF.state.compare_exchange(FREE, BEING_MADE, Ordering::Acquire, Ordering::Acquire);
    if first.is_ok() {
        make(load)?;
    }
    let mut waits = 0;
    while SHELF.state.load(Ordering::Acquire) == BEING_MADE && waits < MOST_WAITS {
        core::hint::spin_loop();
        waits += 1;
    }
    match described() {
        Some(description) if description.load == *load => Ok(description),
        Some(_) => Err(Refusal::AnotherMachine),
        None => Err(Refusal::AnotherCaller),
    }
}

/// Makes the description; a refusal leaves none.
fn make(load: &Load) -> Result<(), Refusal> {
    // SAFETY: all-zero bytes are null pins, and false.
    let mut pins = unsafe { MaybeUninit::<MachinePins>::zeroed().assume_init() };
    let make = Maker { target: Target::Table(&SHELF.table), place: Place::FIRST };
    SHELF.table.clear();
    if !pins.describe(&SHELF.table, &make, load) {
        let (_, wanted) = SHELF.table.parameters();
        SHELF.state.store(FREE, Ordering::Release);
        return Err(Refusal::TooManyParameters(wanted));
    }
    let mut letters = Text::EMPTY;
    for letter in load.layout.coordinates().as_slice() {
        letters.push(&[letter.name() as u8][..]);
    }
    // SAFETY: no other caller writes or reads it in the state BEING_MADE.
    unsafe { (*SHELF.description.get()).write(Description { load: *load, pins, letters }) };
    SHELF.state.store(MADE, Ordering::Release);
    Ok(())
}
