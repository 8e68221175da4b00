// SPDX-License-Identifier: GPL-2.0-or-later
//! Checks the contract's statements about LinuxCNC against the installed one.

use object::{Object, ObjectSymbol};
use prove::contract::{CONTRACT, Contract};
use std::collections::BTreeSet;
use std::process::Command;

/// The process that loads realtime modules, and the module that all others need.
const EXPORTING: [&str; 2] = ["/usr/bin/rtapi_app", "/usr/lib/linuxcnc/modules/hal_lib.so"];

fn exported() -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for path in EXPORTING {
        let data = std::fs::read(path).expect("LinuxCNC is installed");
        let file = object::File::parse(&*data).expect("a library or a program");
        let defined = file.dynamic_symbols().filter(|symbol| symbol.is_definition());
        names.extend(defined.filter_map(|symbol| symbol.name().ok().map(String::from)));
    }
    names
}

fn installed() -> String {
    let mut command = Command::new("linuxcnc_var");
    let output = command.arg("LINUXCNCVERSION").output().expect("LinuxCNC is installed");
    String::from_utf8(output.stdout).expect("a version")
}

/// Names of functions that virtual time does not implement, each with a substitute that ends the run.
const UNCOVERED: &str = include_str!("../../../../workbench/linuxcnc/virtual/uncovered.inc");
const LIBRARY: &str = "/usr/lib/liblinuxcnchal.so.0";

#[test]
fn virtual_time_has_a_substitute_for_every_function_of_the_installed_hal() {
    let data = std::fs::read(LIBRARY).expect("LinuxCNC is installed");
    let file = object::File::parse(&*data).expect("a library");
    let is_call = |name: &&str| ["hal_", "halpr_", "rtapi_"].iter().any(|p| name.starts_with(p));
    let symbols = file
        .dynamic_symbols()
        .filter(|symbol| symbol.is_definition() && symbol.kind() == object::SymbolKind::Text);
    let names: Vec<String> =
        symbols.filter_map(|symbol| symbol.name().ok().filter(is_call).map(String::from)).collect();
    assert!(!names.is_empty());
    for name in names {
        assert!(
            UNCOVERED.contains(&format!("UNCOVERED({name})")),
            "{name} is not in uncovered.inc"
        );
    }
}

#[test]
fn the_installed_linuxcnc_exports_what_the_contract_lists_for_its_version() {
    let contract = Contract::parse(CONTRACT).expect("a contract");
    let installed = installed();
    let is_installed = |version: &str| installed.starts_with(&format!("{version}."));
    let version = contract.linuxcnc.iter().find(|v| is_installed(&v.version));
    let version = version.unwrap_or_else(|| panic!("versions.toml has no LinuxCNC {installed}"));
    let exported = exported();
    let missing: Vec<&String> = version.exports.iter().filter(|e| !exported.contains(*e)).collect();
    assert!(missing.is_empty(), "LinuxCNC {installed} does not export {missing:?}");
}
