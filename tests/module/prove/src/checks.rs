// SPDX-License-Identifier: GPL-2.0-or-later
//! The checks: each reports its result, the bound, and the remedy for a difference.

use crate::built::{Built, Pointer, Symbol};
use crate::contract::{Contract, Entry, Provider, Version, When};
use crate::graph::{Graph, Reached};
use std::collections::BTreeSet;

#[derive(Clone, Debug)]
pub struct Check {
    /// What is checked.
    pub name: String,
    pub found: String,
    /// Allowed value.
    pub bound: String,
    /// Violations; empty if there are none.
    pub complaints: Vec<String>,
}

impl Check {
    fn new(name: &str, found: String, bound: impl Into<String>, complaints: Vec<String>) -> Self {
        Self { name: name.into(), found, bound: bound.into(), complaints }
    }
}

/// Parts of the names of functions that exist only to panic or to unwind.
const PANIC_MACHINERY: [&str; 6] = [
    "core::panicking",
    "core::result::unwrap_failed",
    "core::option::",
    "rust_begin_unwind",
    "rust_panic",
    "_Unwind_",
];

/// The undefined function that the module's panic handler calls, and functions that a handler that
/// stops the process would call.
const PANIC_IMPORTS: [&str; 3] = ["pkmkins_has_a_panic_path", "abort", "__stack_chk_fail"];

/// Parts of the names of allocators.
const ALLOCATORS: [&str; 5] =
    ["__rust_alloc", "__rust_realloc", "__rust_dealloc", "alloc::", "__rdl_"];

/// Functions of libc that allocate or free.
const ALLOCATING: [&str; 10] = [
    "malloc",
    "calloc",
    "realloc",
    "free",
    "posix_memalign",
    "aligned_alloc",
    "memalign",
    "mmap",
    "sbrk",
    "brk",
];

/// An entry point with everything that it reaches.
struct Proved<'a> {
    entry: &'a Entry,
    reached: Reached,
}

/// Runs all checks; if instructions cannot be followed, those that do not need it.
pub fn checks(built: &Built, contract: &Contract) -> Vec<Check> {
    let contract = &contract.of(&built.imports);
    let mut checks =
        vec![exports(built, contract), imports(built, contract), panics(built), allocators(built)];
    checks.extend(contract.linuxcnc.iter().map(|version| missing(built, contract, version)));
    if built.is_followed {
        checks.extend(followed(built, contract));
    }
    checks.extend([segments(built), executable_stack(built), relocations(built), binding(built)]);
    checks
}

/// Runs the checks that follow the instructions from the entry points on.
fn followed(built: &Built, contract: &Contract) -> Vec<Check> {
    let mut graph = Graph::new(built);
    let proved: Vec<Proved> = contract
        .entry
        .iter()
        .filter_map(|entry| {
            let function = built.function_named(&entry.name)?;
            Some(Proved { entry, reached: graph.reached(function.address) })
        })
        .collect();
    let mut checks = vec![
        entries(built, contract, &mut graph, &proved),
        imports_at_run(contract, &proved),
        traps(&mut graph, &proved),
        calls(&mut graph, &proved),
        recursion(&proved),
    ];
    checks.extend(proved.iter().map(stack));
    checks
}

fn quoted(names: impl IntoIterator<Item = impl AsRef<str>>) -> String {
    let names: Vec<String> = names.into_iter().map(|n| n.as_ref().to_string()).collect();
    names.join(", ")
}

fn exports(built: &Built, contract: &Contract) -> Check {
    let found: BTreeSet<&str> =
        built.symbols.iter().filter(|s| s.is_exported).map(|s| s.name.as_str()).collect();
    let functions = contract.entry.iter().filter(|e| e.exported).map(|e| e.name.as_str());
    let promised: BTreeSet<&str> =
        functions.chain(contract.data.iter().map(String::as_str)).collect();
    let extra = found.difference(&promised).map(|name| {
        format!("{name} is exported and not promised: hide it, or add it to the contract")
    });
    let missing = promised
        .difference(&found)
        .map(|name| format!("{name} is promised and not exported: LinuxCNC would not find it"));
    let complaints = extra.chain(missing).collect();
    let bound = format!("exactly {} of the contract", promised.len());
    Check::new("exported symbols", found.len().to_string(), bound, complaints)
}

/// Checks that every function reachable by other libraries is an entry point of the contract.
fn entries(
    built: &Built,
    contract: &Contract,
    graph: &mut Graph<'_>,
    proved: &[Proved<'_>],
) -> Check {
    let stated: BTreeSet<u64> = contract
        .entry
        .iter()
        .filter_map(|e| built.function_named(&e.name))
        .map(|f| f.address)
        .collect();
    let mut taken = built.taken.clone();
    for function in functions(proved) {
        taken.extend(&graph.walked(function).taken);
    }
    let mut complaints: Vec<String> = taken
        .difference(&stated)
        .filter_map(|address| built.function(*address))
        .map(|f| {
            format!("the address of {} is handed out: add it to the contract as an entry", f.name)
        })
        .collect();
    for entry in contract.entry.iter().filter(|e| built.function_named(&e.name).is_none()) {
        complaints.push(format!("there is no function {}: correct the contract", entry.name));
    }
    let found = format!("{} by name, {} by address", proved.len() - taken.len(), taken.len());
    Check::new("entry points", found, "those of the contract", complaints)
}

fn imports(built: &Built, contract: &Contract) -> Check {
    let allowed: BTreeSet<&str> = contract.import.iter().map(|i| i.name.as_str()).collect();
    let mut complaints: Vec<String> = built
        .imports
        .iter()
        .filter(|name| !allowed.contains(name.as_str()))
        .map(|name| {
            format!("{name} is imported: do without, or add it to the contract with a reason")
        })
        .collect();
    for import in &contract.import {
        if import.reason.trim().is_empty() {
            complaints.push(format!("{} is allowed without a reason", import.name));
        }
        if !built.imports.contains(&import.name) {
            complaints.push(format!("{} is no longer imported: strike it out", import.name));
        }
    }
    let bound = format!("the {} of the contract", allowed.len());
    Check::new("imported symbols", built.imports.len().to_string(), bound, complaints)
}

/// Checks the symbols of a version: LinuxCNC refuses a module with an unresolved symbol.
fn missing(built: &Built, contract: &Contract, version: &Version) -> Check {
    let Version { version, exports, .. } = version;
    let complaints: Vec<String> = contract
        .import
        .iter()
        .filter(|i| i.from == Provider::LinuxCnc && built.imports.contains(&i.name))
        .filter(|i| !exports.contains(&i.name))
        .map(|i| format!("LinuxCNC {version} has no {}: it would not load the module", i.name))
        .collect();
    let name = format!("symbols that LinuxCNC {version} lacks");
    Check::new(&name, complaints.len().to_string(), "none", complaints)
}

fn imports_at_run(contract: &Contract, proved: &[Proved<'_>]) -> Check {
    let allowed: BTreeSet<&str> =
        contract.import.iter().filter(|i| i.when == When::Run).map(|i| i.name.as_str()).collect();
    let mut found = BTreeSet::new();
    let mut complaints = Vec::new();
    for Proved { entry, reached } in proved.iter().filter(|p| p.entry.when == When::Run) {
        for name in &reached.imports {
            found.insert(name.clone());
            if !allowed.contains(name.as_str()) {
                complaints.push(format!(
                    "{} may call {name} in the servo thread: allowed there are {}",
                    entry.name,
                    quoted(&allowed),
                ));
            }
        }
    }
    Check::new("imports called in the servo thread", quoted(found), quoted(allowed), complaints)
}

/// Returns complaints about symbols with one of these parts in their names.
fn named<'a>(symbols: impl Iterator<Item = &'a Symbol>, parts: &[&str], say: &str) -> Vec<String> {
    symbols
        .filter(|s| parts.iter().any(|part| s.name.contains(part)))
        .map(|s| format!("{} {say}", s.name))
        .collect()
}

fn imported(built: &Built, names: &[&str], say: &str) -> Vec<String> {
    let wanted = names.iter().filter(|name| built.imports.contains(**name));
    wanted.map(|name| format!("{name} {say}")).collect()
}

fn panics(built: &Built) -> Check {
    let say = "is in the file: something can panic; look for an index, a slice, a division, an \
               unwrap or core::fmt that the compiler cannot see through";
    let mut complaints = named(built.symbols.iter(), &PANIC_MACHINERY, say);
    complaints.extend(imported(built, &PANIC_IMPORTS, "is called: something can panic"));
    Check::new("panic machinery", complaints.len().to_string(), "none", complaints)
}

fn allocators(built: &Built) -> Check {
    let mut complaints = named(built.symbols.iter(), &ALLOCATORS, "is in the file: it allocates");
    complaints.extend(imported(built, &ALLOCATING, "is called: it allocates"));
    Check::new("allocators", complaints.len().to_string(), "none", complaints)
}

/// Returns all functions that entry points reach.
fn functions(proved: &[Proved<'_>]) -> BTreeSet<u64> {
    proved.iter().flat_map(|p| p.reached.functions.iter().copied()).collect()
}

fn traps(graph: &mut Graph<'_>, proved: &[Proved<'_>]) -> Check {
    let mut complaints = Vec::new();
    for function in functions(proved) {
        complaints.extend(graph.walked(function).traps.clone());
    }
    Check::new("traps, system calls", complaints.len().to_string(), "none", complaints)
}

fn calls(graph: &mut Graph<'_>, proved: &[Proved<'_>]) -> Check {
    let reached = functions(proved);
    let (mut calls, mut complaints) = (0, Vec::new());
    for function in &reached {
        let walked = graph.walked(*function);
        calls += walked.calls.iter().filter(|c| matches!(c.to, Pointer::Here(_))).count();
        complaints.extend(walked.unknown.clone());
    }
    let found = format!("{} functions, {calls} calls, {} unclear", reached.len(), complaints.len());
    Check::new("paths and callees", found, "all known", complaints)
}

fn recursion(proved: &[Proved<'_>]) -> Check {
    let found: BTreeSet<&String> = proved.iter().flat_map(|p| &p.reached.recursive).collect();
    let complaints =
        found.iter().map(|name| format!("{name} calls itself: its stack has no bound")).collect();
    Check::new("recursive functions", found.len().to_string(), "none", complaints)
}

fn stack(proved: &Proved<'_>) -> Check {
    let Proved { entry, reached } = proved;
    let mut complaints = Vec::new();
    if reached.stack > entry.stack {
        complaints.push(format!(
            "{} takes {} bytes of stack, by way of {}: make the largest frame smaller, or raise \
             its bound in the contract",
            entry.name,
            reached.stack,
            reached.chain.join(" > "),
        ));
    }
    let name = format!("stack of {}", entry.name);
    Check::new(&name, format!("{} bytes", reached.stack), entry.stack.to_string(), complaints)
}

fn segments(built: &Built) -> Check {
    let both: Vec<String> = built
        .segments
        .iter()
        .filter(|s| s.is_writable && s.is_executable)
        .map(|s| format!("the memory at {:#x} can be written and executed", s.address))
        .collect();
    Check::new("writable and executable memory", both.len().to_string(), "none", both)
}

fn executable_stack(built: &Built) -> Check {
    let asked = built.stack.is_none_or(|s| s.is_executable);
    let complaints = match asked {
        true => vec!["the file asks for an executable stack: link with -z noexecstack".into()],
        false => Vec::new(),
    };
    Check::new("executable stack", if asked { "yes" } else { "no" }.into(), "no", complaints)
}

fn relocations(built: &Built) -> Check {
    let has = built.has_text_relocations;
    let complaints = match has {
        true => vec!["the loader changes code: compile position-independent".into()],
        false => Vec::new(),
    };
    Check::new("text relocations", if has { "yes" } else { "no" }.into(), "no", complaints)
}

fn binding(built: &Built) -> Check {
    let at_load = built.is_bound_at_load;
    // LinuxCNC's rtapi_app opens modules with RTLD_NOW, so nothing is looked up in the servo thread.
    let complaints = match at_load {
        true => {
            vec!["a program outside real time, without HAL, cannot open it: link lazily".into()]
        }
        false => Vec::new(),
    };
    let found = if at_load { "at load" } else { "as the opener asks" };
    Check::new("symbols looked up", found.into(), "as the opener asks", complaints)
}
