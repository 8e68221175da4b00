// SPDX-License-Identifier: GPL-2.0-or-later
//! Names similar to one that LinuxCNC reads, and that nothing reads; sections that overwrite Tcl's variables.

use machine::read::ini::{Ini, IniError};
use machine::read::near;
use machine::read::places::{OF_TCL, is_of_tcl};

/// Returns every such section and key; the reader refuses unknown keys of the sections that describe the machine.
pub(super) fn check(ini: &Ini) -> Vec<IniError> {
    let sections = ini.sections().filter_map(|name| {
        let meant = near::section(name)?;
        let text = format!(
            "nothing reads this section: did you mean [{meant}]? If not, choose another name"
        );
        Some(ini.refuse_section(name, &text))
    });
    let of_tcl = ini.sections().filter(|name| is_of_tcl(name));
    let of_tcl = of_tcl.map(|name| ini.refuse_section(name, OF_TCL));
    let keys = ini.entries().filter_map(|entry| {
        let meant = near::key(&entry.section, &entry.key)?;
        let text = format!(
            "LinuxCNC does not read this key: did you mean {meant}? If not, choose another name"
        );
        Some(ini.refuse_key(entry, &text))
    });
    sections.chain(of_tcl).chain(keys).collect()
}
