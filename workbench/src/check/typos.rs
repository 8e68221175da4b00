// SPDX-License-Identifier: GPL-2.0-or-later
//! Names that are near to one that LinuxCNC reads, and that nothing reads.

use crate::read::ini::{Ini, IniError};
use crate::read::near;

/// Every such section and key; keys of the sections that describe the machine are refused by the reader.
pub(super) fn check(ini: &Ini) -> Vec<IniError> {
    let sections = ini.sections().filter_map(|name| {
        let meant = near::section(name)?;
        let text = format!("nothing reads this section: expected [{meant}], or another name");
        Some(ini.refuse_section(name, &text))
    });
    let keys = ini.entries().filter_map(|entry| {
        let meant = near::key(&entry.section, &entry.key)?;
        let text = format!("LinuxCNC does not read this key: expected {meant}, or another name");
        Some(ini.refuse_key(entry, &text))
    });
    sections.chain(keys).collect()
}
