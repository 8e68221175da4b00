#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Builds the core, the module and their tests for 64-bit ARM, runs the checks of the module that need no disassembly,
# runs the tests under qemu, and compares every result bit by bit with the module built for this processor.
#
#     tests/arm64/run.sh [answers]      only the comparison
#
# Needs gcc-aarch64-linux-gnu, libc6-dev-arm64-cross and qemu-user-static (`cargo xtask test-arm64` installs them), and
# Rust's library for aarch64, from rustup (the same compiler then builds both) or from Debian. LinuxCNC's own modules,
# with which ours is compared, come from Debian's package for arm64. Packages are unpacked into target/tools and not
# installed. qemu is about ten times slower. PKMKINS_CASES=0.1 runs a tenth of the cases; tests that require a number of
# events then fail.
set -eu
cd "$(dirname "$0")/../.."
target=aarch64-unknown-linux-gnu
arm=$PWD/target/tools/arm64
out=$PWD/build/arm64

# arm64 COMMAND...: runs apt as on an arm64 computer, with separate package lists.
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

# unpacked PACKAGE FOLDER: downloads and unpacks Debian's arm64 package, once.
unpacked() {
    [ ! -e "$arm/$1.done" ] || return 0
    [ -d "$arm/apt" ] || arm64 apt-get update -q
    mkdir -p "$arm/packages"
    (cd "$arm/packages" && arm64 apt-get download -q "$1")
    dpkg -x "$arm/packages/$1"_*_arm64.deb "$2"
    touch "$arm/$1.done"
}

# Build the programs that run here before rust-web.sh replaces the compiler.
cargo build --release --locked --quiet -p pkmkins --target-dir target/module
cargo build --profile host --locked --quiet -p abi-tests -p prove --bin answers --bin prove

unpacked linuxcnc-uspace "$arm/linuxcnc"
if [ ! -d "$(rustc --print target-libdir --target $target)" ]; then
    . tools/rust-web.sh
    unpacked libstd-rust-web-dev "$rust_web"
fi
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64-static -L /usr/aarch64-linux-gnu"
# In a separate folder: otherwise cargo would rebuild this processor's files with the other compiler.
for_arm() { cargo "$@" --locked --quiet --target $target --target-dir target/arm64; }

for_arm build --release -p pkmkins
for_arm build --profile host -p abi-tests --bin answers
module=$PWD/target/arm64/$target/release/libpkmkins.so

# Checks symbols, imports, panic code and memory permissions, which need no disassembly.
target/host/prove "$module"

mkdir -p "$out"
target/host/answers > "$out/here"
PKMKINS_SO=$module STRIP=aarch64-linux-gnu-strip $CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER \
    "target/arm64/$target/host/answers" > "$out/arm64"
if ! cmp "$out/here" "$out/arm64"; then
    echo "arm64: answers differ: diff $out/here $out/arm64" >&2
    exit 1
fi
echo "arm64: $(wc -l < "$out/here") answers, $(cut -d ';' -f 1 "$out/here" | uniq | wc -l) machines: every bit is the same"
[ "${1:-}" != answers ] || exit 0

PKMKINS_SO=$module STRIP=aarch64-linux-gnu-strip LINUXCNC_MODULES=$arm/linuxcnc/usr/lib/linuxcnc/modules \
    CC=aarch64-linux-gnu-gcc RUNNER=$CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER \
    for_arm test --profile host --no-fail-fast -p kinematics -p abi-tests
