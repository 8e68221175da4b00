#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Builds the core, the module and their tests for 64-bit ARM, runs the checks of the module that need no disassembly,
# runs the tests under qemu, and compares every result bit by bit with the module built for this processor.
#
#     tests/arm64/run.sh [answers]      only the comparison
#
# Needs what tools/arm64.sh needs, and qemu-user-static (`cargo xtask test-arm64` installs them). LinuxCNC's own modules,
# beside which ours is tested, come from Debian's package for arm64.
# qemu is some ten times as slow. PKMKINS_CASES=0.1 takes a tenth of the cases; tests that count what they met then fail.
set -eu
cd "$(dirname "$0")/../.."
out=$PWD/build/arm64

# What runs here is built before the compiler for the other processor takes the place of this one.
make --silent module
cargo build --profile host --locked --quiet -p abi-tests -p prove --bin answers --bin prove

. tools/arm64.sh
unpacked linuxcnc-uspace "$arm/linuxcnc"

module_for_arm
for_arm build --quiet --profile host -p abi-tests --bin answers
module=$PWD/target/arm64/$arm_target/release/libpkmkins.so

# Checks symbols, imports, panic code and memory permissions, which need no disassembly.
target/host/prove "$module"

mkdir -p "$out"
target/host/answers > "$out/here"
PKMKINS_SO=$module STRIP=aarch64-linux-gnu-strip $CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER \
    "target/arm64/$arm_target/host/answers" > "$out/arm64"
if ! cmp "$out/here" "$out/arm64"; then
    echo "arm64: answers differ: diff $out/here $out/arm64" >&2
    exit 1
fi
echo "arm64: $(wc -l < "$out/here") answers, $(cut -d ';' -f 1 "$out/here" | uniq | wc -l) machines: every bit is the same"
[ "${1:-}" != answers ] || exit 0

PKMKINS_SO=$module STRIP=aarch64-linux-gnu-strip LINUXCNC_MODULES=$arm/linuxcnc/usr/lib/linuxcnc/modules \
    CC=aarch64-linux-gnu-gcc RUNNER=$CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER \
    for_arm test --quiet --profile host --no-fail-fast -p kinematics -p abi-tests
