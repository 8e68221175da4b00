// SPDX-License-Identifier: GPL-2.0-or-later
//! Every path through one function: its stack depth, and its calls.
//!
//! The walk keeps, for each instruction, the depth of the stack pointer below its value at the function's
//! first one, and the known values of the registers: enough to resolve calls through a
//! register with an import, and jumps through a table. Anything that it does not
//! understand is a complaint, not a guess.

use crate::built::{Built, Pointer, Symbol};
use iced_x86::{
    Code, Decoder, DecoderOptions, FlowControl, Instruction, InstructionInfoFactory, Mnemonic,
    OpAccess, OpKind, Register,
};
use std::collections::{BTreeMap, BTreeSet};

/// A call, or a jump out of the function.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Call {
    /// Bytes of stack in use when the callee starts, its return address included.
    pub depth: u64,
    /// Its target.
    pub to: Pointer,
}

/// One function.
#[derive(Clone, Debug, Default)]
pub struct Walked {
    /// Deepest stack of the function, without its return address.
    pub depth: u64,
    pub calls: Vec<Call>,
    /// Functions whose address it takes.
    pub taken: BTreeSet<u64>,
    /// Instructions that stop the process or enter the system, with their addresses.
    pub traps: Vec<String>,
    /// Calls with an unknown target, and other instructions that were not understood.
    pub unknown: Vec<String>,
}

/// The known value of a register.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
enum Value {
    #[default]
    Unknown,
    /// A value that the loader fills in.
    Loaded(Pointer),
    Address(u64),
    /// An entry of the jump table at this address.
    Entry(u64),
    /// The target of an entry of this jump table.
    Target(u64),
    Stack(i64),
}

/// The known state before an instruction.
#[derive(Clone, PartialEq, Eq)]
struct State {
    depth: i64,
    registers: [Value; 16],
    /// Values saved in the frame, by depth.
    frame: BTreeMap<i64, Value>,
}

/// Registers that a function may change (System V).
const CLOBBERED: [Register; 9] = [
    Register::RAX,
    Register::RCX,
    Register::RDX,
    Register::RSI,
    Register::RDI,
    Register::R8,
    Register::R9,
    Register::R10,
    Register::R11,
];

/// Rounds after which a walk is aborted: no real function comes near.
const MOST_STEPS: usize = 4_000_000;

pub fn walk(built: &Built, function: &Symbol) -> Walked {
    let mut walker = Walker {
        built,
        function,
        code: decoded(built, function),
        states: BTreeMap::new(),
        work: Vec::new(),
        info: InstructionInfoFactory::new(),
        out: Walked::default(),
    };
    walker.run();
    walker.out
}

fn decoded(built: &Built, function: &Symbol) -> BTreeMap<u64, Instruction> {
    let bytes = built.bytes(function.address);
    let bytes = &bytes[..bytes.len().min(function.size as usize)];
    let decoder = Decoder::with_ip(64, bytes, function.address, DecoderOptions::NONE);
    decoder.into_iter().map(|instruction| (instruction.ip(), instruction)).collect()
}

struct Walker<'a> {
    built: &'a Built,
    function: &'a Symbol,
    code: BTreeMap<u64, Instruction>,
    states: BTreeMap<u64, State>,
    work: Vec<u64>,
    info: InstructionInfoFactory,
    out: Walked,
}

impl State {
    fn get(&self, register: Register) -> Value {
        number(register).map_or(Value::Unknown, |n| self.registers[n].clone())
    }

    fn set(&mut self, register: Register, value: Value) {
        if let Some(n) = number(register) {
            self.registers[n] = value;
        }
    }

    /// Returns the common knowledge of both; `None` if the stacks differ.
    fn joined(&self, other: &State) -> Option<State> {
        if self.depth != other.depth {
            return None;
        }
        let mut joined = self.clone();
        for (value, theirs) in joined.registers.iter_mut().zip(&other.registers) {
            if value != theirs {
                *value = Value::Unknown;
            }
        }
        joined.frame.retain(|at, value| other.frame.get(at) == Some(value));
        Some(joined)
    }
}

fn number(register: Register) -> Option<usize> {
    let full = register.full_register();
    full.is_gpr64().then(|| full.number())
}

impl Walker<'_> {
    fn run(&mut self) {
        let start = State { depth: 0, registers: Default::default(), frame: BTreeMap::new() };
        self.reach(self.function.address, start);
        let mut steps = 0;
        while let Some(at) = self.work.pop() {
            steps += 1;
            if steps > MOST_STEPS {
                self.out
                    .unknown
                    .push(format!("{} is too long to walk through", self.function.name));
                return;
            }
            self.step(at);
        }
        self.report();
    }

    /// Records that an instruction is reached with a state.
    fn reach(&mut self, at: u64, state: State) {
        if !self.code.contains_key(&at) {
            self.complain(at, "leads into the middle of something");
            return;
        }
        let joined = match self.states.get(&at) {
            None => state,
            Some(known) => match known.joined(&state) {
                None => {
                    self.complain(at, "is reached with two depths of the stack");
                    return;
                }
                Some(joined) if joined == *known => return,
                Some(joined) => joined,
            },
        };
        self.states.insert(at, joined);
        self.work.push(at);
    }

    fn complain(&mut self, at: u64, what: &str) {
        let text = format!("{} {what} (at {at:#x})", self.function.name);
        if !self.out.unknown.contains(&text) {
            self.out.unknown.push(text);
        }
    }

    fn step(&mut self, at: u64) {
        let instruction = self.code[&at];
        let state = self.states[&at].clone();
        let next = instruction.next_ip();
        match instruction.flow_control() {
            _ if trap(&instruction) == Some(SYSTEM_CALL) => self.reach(next, state),
            FlowControl::Next => {
                let after = self.after(&instruction, state);
                self.reach(next, after);
            }
            FlowControl::Call | FlowControl::IndirectCall => {
                let mut after = state;
                for register in CLOBBERED {
                    after.set(register, Value::Unknown);
                }
                // A callee may write into the frame if it was given its address, but not
                // where compilers save registers; those addresses are not passed on.
                // After a call that ends a function nothing follows: it does not return.
                if self.is_inside(next) {
                    self.reach(next, after);
                }
            }
            FlowControl::ConditionalBranch => self.branch(&instruction, state),
            FlowControl::UnconditionalBranch => {
                let to = instruction.near_branch_target();
                if self.is_inside(to) {
                    self.reach(to, state);
                }
            }
            FlowControl::IndirectBranch => {
                if let Value::Target(table) = self.operand(&instruction, &state) {
                    for to in self.table(table) {
                        self.reach(to, state.clone());
                    }
                }
            }
            FlowControl::Return | FlowControl::Exception | FlowControl::Interrupt => {}
            FlowControl::XbeginXabortXend => self.complain(at, "uses transactions"),
        }
    }

    fn branch(&mut self, instruction: &Instruction, mut state: State) {
        let to = instruction.near_branch_target();
        // A large frame is probed page by page: compare rsp with a register that contains
        // its end, and jump back while they differ.
        let before = self.code.range(..instruction.ip()).next_back().map(|(_, i)| *i);
        if let Some(compare) = before
            && instruction.mnemonic() == Mnemonic::Jne
            && compare.mnemonic() == Mnemonic::Cmp
            && compare.op0_register() == Register::RSP
            && let Value::Stack(depth) = state.get(compare.op1_register())
        {
            state.depth = depth;
            self.reach(instruction.next_ip(), state);
            return;
        }
        self.reach(instruction.next_ip(), state.clone());
        if self.is_inside(to) {
            self.reach(to, state);
        }
    }

    fn is_inside(&self, address: u64) -> bool {
        (self.function.address..self.function.address + self.function.size).contains(&address)
    }

    /// Returns the targets of a jump table: its entries up to the first outside the function, or up to the next data that the
    /// function refers to, such as its next table, whose entries count from their own start.
    fn table(&self, table: u64) -> Vec<u64> {
        let is_lea =
            |i: &&Instruction| i.mnemonic() == Mnemonic::Lea && i.is_ip_rel_memory_operand();
        let places = self.code.values().filter(is_lea).map(|i| i.ip_rel_memory_address());
        let end = places.filter(|place| *place > table).min().unwrap_or(u64::MAX);
        let most = usize::try_from((end - table) / 4).unwrap_or(usize::MAX);
        let mut targets = Vec::new();
        for entry in self.built.bytes(table).chunks_exact(4).take(most) {
            let offset = i32::from_le_bytes([entry[0], entry[1], entry[2], entry[3]]);
            let to = table.wrapping_add_signed(offset.into());
            if !self.is_inside(to) || !self.code.contains_key(&to) {
                break;
            }
            targets.push(to);
        }
        targets
    }

    /// Returns the state after an instruction that does not branch.
    fn after(&mut self, instruction: &Instruction, mut state: State) -> State {
        let known = self.result(instruction, &state);
        let stored = stored(instruction, &state);
        let pushed = instruction.stack_pointer_increment();
        let mut writes_stack_pointer = false;
        let info = self.info.info(instruction);
        for used in info.used_registers() {
            let writes = matches!(
                used.access(),
                OpAccess::Write
                    | OpAccess::CondWrite
                    | OpAccess::ReadWrite
                    | OpAccess::ReadCondWrite
            );
            if writes && number(used.register()).is_some() {
                writes_stack_pointer |= used.register().full_register() == Register::RSP;
                state.set(used.register(), Value::Unknown);
            }
        }
        let forgotten: Vec<i64> = info
            .used_memory()
            .iter()
            .filter(|m| m.access() != OpAccess::Read && m.base() == Register::RSP)
            .map(|m| state.depth - m.displacement() as i64)
            .collect();
        for at in forgotten {
            state.frame.retain(|slot, _| (slot - at).abs() >= 8);
        }
        if let Some((slot, value)) = stored {
            state.frame.insert(slot, value);
        }
        if let Some((register, value)) = known {
            state.set(register, value);
        }
        if writes_stack_pointer {
            match moved(instruction, &state, pushed) {
                Some(depth) => state.depth = depth,
                None => {
                    self.complain(instruction.ip(), "moves the stack pointer in an unknown way")
                }
            }
        }
        state
    }

    /// Returns the register that an instruction gives a known value, and that value.
    fn result(&self, instruction: &Instruction, state: &State) -> Option<(Register, Value)> {
        let to = instruction.op0_register();
        let is_register = instruction.op0_kind() == OpKind::Register && to.is_gpr64();
        if !is_register || to == Register::RSP {
            return None;
        }
        let value = match instruction.mnemonic() {
            Mnemonic::Lea if instruction.is_ip_rel_memory_operand() => {
                Value::Address(instruction.ip_rel_memory_address())
            }
            Mnemonic::Lea if is_frame(instruction) => {
                Value::Stack(state.depth - instruction.memory_displacement64() as i64)
            }
            Mnemonic::Mov => self.operand_of_move(instruction, state),
            Mnemonic::Movsxd => match state.get(instruction.memory_base()) {
                Value::Address(table) if instruction.memory_index_scale() == 4 => {
                    Value::Entry(table)
                }
                _ => Value::Unknown,
            },
            Mnemonic::Add if instruction.op1_kind() == OpKind::Register => {
                match (state.get(to), state.get(instruction.op1_register())) {
                    (Value::Entry(a), Value::Address(b)) | (Value::Address(b), Value::Entry(a))
                        if a == b =>
                    {
                        Value::Target(a)
                    }
                    _ => Value::Unknown,
                }
            }
            _ => Value::Unknown,
        };
        (value != Value::Unknown).then_some((to, value))
    }

    fn operand_of_move(&self, instruction: &Instruction, state: &State) -> Value {
        match instruction.op1_kind() {
            OpKind::Register if instruction.op1_register() == Register::RSP => {
                Value::Stack(state.depth)
            }
            OpKind::Register => state.get(instruction.op1_register()),
            OpKind::Memory => self.memory(instruction, state),
            _ => Value::Unknown,
        }
    }

    /// Returns the target of a call or jump.
    fn operand(&self, instruction: &Instruction, state: &State) -> Value {
        match instruction.op0_kind() {
            OpKind::Register => state.get(instruction.op0_register()),
            OpKind::Memory => self.memory(instruction, state),
            _ => Value::Unknown,
        }
    }

    /// Returns the value at the address of the memory operand.
    fn memory(&self, instruction: &Instruction, state: &State) -> Value {
        if is_frame(instruction) {
            let slot = state.depth - instruction.memory_displacement64() as i64;
            return state.frame.get(&slot).cloned().unwrap_or_default();
        }
        if !instruction.is_ip_rel_memory_operand() {
            return Value::Unknown;
        }
        let place = instruction.ip_rel_memory_address();
        self.built.pointers.get(&place).cloned().map_or(Value::Unknown, Value::Loaded)
    }

    /// Reports the result from the states.
    fn report(&mut self) {
        for (at, state) in std::mem::take(&mut self.states) {
            let instruction = self.code[&at];
            self.out.depth = self.out.depth.max(state.depth.max(0) as u64);
            self.out.taken.extend(taken(self.built, &instruction));
            if let Some(what) = trap(&instruction) {
                self.out.traps.push(format!("{what} in {} at {at:#x}", self.function.name));
            }
            match instruction.flow_control() {
                FlowControl::Call if trap(&instruction).is_none() => {
                    self.call(at, state.depth, instruction.near_branch_target())
                }
                FlowControl::UnconditionalBranch | FlowControl::ConditionalBranch => {
                    let to = instruction.near_branch_target();
                    if !self.is_inside(to) {
                        self.call(at, state.depth - 8, to);
                    }
                }
                FlowControl::IndirectCall => {
                    let value = self.operand(&instruction, &state);
                    self.indirect(at, state.depth, value);
                }
                FlowControl::IndirectBranch => {
                    let value = self.operand(&instruction, &state);
                    if !matches!(value, Value::Target(table) if !self.table(table).is_empty()) {
                        self.indirect(at, state.depth - 8, value);
                    }
                }
                _ => {}
            }
        }
    }

    fn call(&mut self, at: u64, depth: i64, to: u64) {
        let to = if self.built.function(to).is_some() {
            Pointer::Here(to)
        } else if let Some(pointer) = through_stub(self.built, to) {
            pointer
        } else {
            return self.complain(at, "calls what is no function");
        };
        self.out.calls.push(Call { depth: (depth + 8).max(0) as u64, to });
    }

    fn indirect(&mut self, at: u64, depth: i64, value: Value) {
        let to = match value {
            Value::Loaded(pointer) => pointer,
            Value::Address(address) => Pointer::Here(address),
            _ => return self.complain(at, "calls through a pointer"),
        };
        match to {
            Pointer::Here(address) => self.call(at, depth, address),
            Pointer::Import(_) => {
                self.out.calls.push(Call { depth: (depth + 8).max(0) as u64, to });
            }
        }
    }
}

/// Returns whether the memory operand is a fixed position in the frame.
fn is_frame(instruction: &Instruction) -> bool {
    instruction.memory_base() == Register::RSP && instruction.memory_index() == Register::None
}

/// Returns a register with a known value that is saved in the frame, and its position.
fn stored(instruction: &Instruction, state: &State) -> Option<(i64, Value)> {
    let is_store = instruction.code() == Code::Mov_rm64_r64
        && instruction.op0_kind() == OpKind::Memory
        && is_frame(instruction);
    if !is_store {
        return None;
    }
    let value = state.get(instruction.op1_register());
    let slot = state.depth - instruction.memory_displacement64() as i64;
    (value != Value::Unknown).then_some((slot, value))
}

/// Returns the depth after an instruction that moves the stack pointer; `None` if unknown.
fn moved(instruction: &Instruction, state: &State, pushed: i32) -> Option<i64> {
    let depth = state.depth;
    if instruction.is_stack_instruction() {
        return (instruction.mnemonic() != Mnemonic::Leave).then(|| depth - i64::from(pushed));
    }
    let by = || {
        let is_number = !matches!(instruction.op1_kind(), OpKind::Register | OpKind::Memory);
        is_number.then(|| instruction.immediate(1) as i64)
    };
    match instruction.mnemonic() {
        Mnemonic::Sub => Some(depth + by()?),
        Mnemonic::Add => Some(depth - by()?),
        // Rounded down to a power of two; everything on a stack is a multiple of eight.
        Mnemonic::And => {
            let size = by()?.wrapping_neg();
            (size >= 8 && size.count_ones() == 1).then_some(depth + size - 8)
        }
        Mnemonic::Lea if is_frame(instruction) => {
            Some(depth - instruction.memory_displacement64() as i64)
        }
        Mnemonic::Lea if instruction.memory_index() == Register::None => {
            match state.get(instruction.memory_base()) {
                Value::Stack(depth) => Some(depth - instruction.memory_displacement64() as i64),
                _ => None,
            }
        }
        Mnemonic::Mov => match state.get(instruction.op1_register()) {
            Value::Stack(depth) => Some(depth),
            _ => None,
        },
        _ => None,
    }
}

/// Returns a function whose address an instruction takes.
fn taken(built: &Built, instruction: &Instruction) -> Option<u64> {
    if !instruction.is_ip_rel_memory_operand() {
        return None;
    }
    let address = instruction.ip_rel_memory_address();
    let address = match (instruction.mnemonic(), built.pointers.get(&address)) {
        (Mnemonic::Lea, _) => address,
        (Mnemonic::Mov, Some(Pointer::Here(to))) => *to,
        _ => return None,
    };
    built.function(address).map(|_| address)
}

const SYSTEM_CALL: &str = "system call";

/// Returns the name of an instruction that stops the process or enters the system.
fn trap(instruction: &Instruction) -> Option<&'static str> {
    match instruction.mnemonic() {
        Mnemonic::Ud0 | Mnemonic::Ud1 | Mnemonic::Ud2 => Some("trap"),
        Mnemonic::Int | Mnemonic::Int1 | Mnemonic::Int3 | Mnemonic::Hlt => Some("interrupt"),
        Mnemonic::Syscall | Mnemonic::Sysenter => Some(SYSTEM_CALL),
        Mnemonic::INVALID => Some("no instruction"),
        _ => None,
    }
}

/// Returns the target of a linker's stub, which jumps through a pointer that the loader fills in.
fn through_stub(built: &Built, address: u64) -> Option<Pointer> {
    /// An end-of-branch instruction, the jump, and a reserve.
    const LONGEST: usize = 3;
    let decoder = Decoder::with_ip(64, built.bytes(address), address, DecoderOptions::NONE);
    let jump = decoder
        .into_iter()
        .take(LONGEST)
        .find(|i| i.flow_control() == FlowControl::IndirectBranch)?;
    let place = jump.is_ip_rel_memory_operand().then(|| jump.ip_rel_memory_address())?;
    built.pointers.get(&place).cloned()
}
