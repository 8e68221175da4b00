// SPDX-License-Identifier: GPL-2.0-or-later
//! Builds the stub HAL as a shared library: its constructors are variadic,
//! which stable Rust cannot define, and the modules find it as a global library.
//! Builds the rigid machine of the sequence tests as another library: Rust has no long double.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Default folder of the headers in LinuxCNC's development package.
const LINUXCNC_HEADERS: &str = "/usr/include/linuxcnc";

fn main() {
    let source = Path::new("../stub_hal/stub_hal.c");
    let output = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"))
        .join("libstub_hal.so");
    let headers =
        std::env::var("LINUXCNC_HEADERS").unwrap_or_else(|_| LINUXCNC_HEADERS.to_string());
    println!("cargo::rerun-if-changed={}", source.display());
    println!("cargo::rerun-if-env-changed=LINUXCNC_HEADERS");
    println!("cargo::rustc-env=STUB_HAL_SO={}", output.display());
    compile(source, &output, &headers);
    let source = Path::new("../truth/truth.c");
    let output = output.with_file_name("libtruth.so");
    println!("cargo::rerun-if-changed={}", source.display());
    println!("cargo::rustc-env=TRUTH_SO={}", output.display());
    compile(source, &output, &headers);
}

fn compile(source: &Path, output: &Path, headers: &str) {
    // Without the flags of the Rust side: a sanitizer among them would add a second runtime.
    let mut command = Command::new(cc::Build::new().get_compiler().path());
    command
        .args(["-std=gnu11", "-O3", "-Wall", "-Wextra", "-Werror", "-fvisibility=hidden"])
        .args(["-shared", "-fPIC", "-DRTAPI", "-isystem", headers])
        .arg(source)
        .arg("-o")
        .arg(output)
        .arg("-lm");
    let status = command.status().expect("the C compiler starts");
    assert!(
        status.success(),
        "{} does not compile; are LinuxCNC's headers (linuxcnc-uspace-dev) in {headers}?",
        source.display()
    );
}
