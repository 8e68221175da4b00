// SPDX-License-Identifier: GPL-2.0-or-later
//! Selects the HAL that the module is built for: that of the installed headers, or the one that `PKMKINS_HAL` names.

use std::path::Path;
use std::{env, fs};

/// Default folder of the headers of LinuxCNC's development package.
const LINUXCNC_HEADERS: &str = "/usr/include/linuxcnc";

/// Declared by a HAL whose pins are references with getters and setters.
const REFERENCES: &str = "hal_pin_new_real(";

fn main() {
    println!("cargo::rustc-check-cfg=cfg(hal_references)");
    println!("cargo::rerun-if-env-changed=PKMKINS_HAL");
    println!("cargo::rerun-if-env-changed=LINUXCNC_HEADERS");
    let has_references = match env::var("PKMKINS_HAL").as_deref() {
        Ok("references") => true,
        Ok("pointers") => false,
        Ok(other) => panic!(
            "PKMKINS_HAL={other}: expected pointers or references, as workbench/linuxcnc/versions.toml lists \
             for each LinuxCNC, or no PKMKINS_HAL: then {LINUXCNC_HEADERS}/hal.h says which"
        ),
        Err(_) => installed_has_references(),
    };
    if has_references {
        println!("cargo::rustc-cfg=hal_references");
    }
}

/// Returns false on a computer without LinuxCNC's headers: most users run a LinuxCNC with pointers.
fn installed_has_references() -> bool {
    let folder = env::var("LINUXCNC_HEADERS").unwrap_or_else(|_| LINUXCNC_HEADERS.into());
    let header = Path::new(&folder).join("hal.h");
    println!("cargo::rerun-if-changed={}", header.display());
    fs::read_to_string(header).is_ok_and(|text| text.contains(REFERENCES))
}
