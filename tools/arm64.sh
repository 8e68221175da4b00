# SPDX-License-Identifier: GPL-2.0-or-later
# shellcheck shell=sh
# Read with `.` at the root of the repository: compiles for 64-bit ARM, and unpacks Debian's packages for it.
#
# Needs gcc-aarch64-linux-gnu and libc6-dev-arm64-cross, and the library of Rust for aarch64: that of rustup, so that one
# compiler builds for both, or Debian's. Packages are unpacked into target/tools and not installed.

arm_target=aarch64-unknown-linux-gnu
arm=$PWD/target/tools/arm64

# arm64 COMMAND...: apt as on a computer with that processor, with lists of its own.
arm64() {
    mkdir -p "$arm/apt/state/lists/partial" "$arm/apt/cache/archives/partial"
    : >> "$arm/apt/status"
    cat > "$arm/apt/apt.conf" <<CONF
APT::Architecture "arm64";
APT::Architectures { "arm64"; };
Dir::State "$arm/apt/state";
Dir::State::status "$arm/apt/status";
Dir::Cache "$arm/apt/cache";
Acquire::Languages "none";
CONF
    APT_CONFIG=$arm/apt/apt.conf "$@"
}

# unpacked PACKAGE FOLDER: Debian's package for arm64, once.
unpacked() {
    [ ! -e "$arm/$1.done" ] || return 0
    # Every time: an update that failed leaves its folder behind.
    arm64 apt-get update -q
    mkdir -p "$arm/packages"
    (cd "$arm/packages" && arm64 apt-get download -q "$1")
    dpkg -x "$arm/packages/$1"_*_arm64.deb "$2"
    touch "$arm/$1.done"
}

if [ ! -d "$(rustc --print target-libdir --target $arm_target)" ]; then
    . tools/rust-web.sh
    unpacked libstd-rust-web-dev "$rust_web"
fi
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64-static -L /usr/aarch64-linux-gnu"
# Of an apart folder: cargo would build for this processor anew with the other compiler.
for_arm() { cargo "$@" --locked --target $arm_target --target-dir target/arm64; }

# module_for_arm: compiles the module, linked lazily as `make module` does.
module_for_arm() (
    export RUSTFLAGS="${RUSTFLAGS-} -C relro-level=partial"
    for_arm build --quiet --release -p pkmkins
)
