#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
#
# fuzz/run.sh [MINUTES]: runs each fuzz target with libFuzzer, on the stable toolchain; core, module and its
# caller under AddressSanitizer. `src/short.rs` is the part of it that `make test` runs.
#
# New inputs go to target/fuzz/corpus, and crashing inputs to target/fuzz/artifacts.
set -eu
seconds=$((60 * ${1:-10}))

cd "$(dirname "$0")/.."
root=$(pwd)
target=x86_64-unknown-linux-gnu
out=target/fuzz
mkdir -p $out/artifacts $out/corpus/core $out/corpus/layouts $out/corpus/entry_points
export RUSTC_WORKSPACE_WRAPPER="$root/fuzz/rustc.sh"

# run TARGET
run() {
    echo "fuzz: $1"
    RUST_BACKTRACE=0 "target/watched/$target/host/$1" -max_len=600 -timeout=10 -max_total_time=$seconds \
        -artifact_prefix=$out/artifacts/ -verbosity=0 "$out/corpus/$1" "fuzz/corpus/$1"
}

# The sanitizer's flag is not stable; its runtime comes with the stable toolchain.
flags=-Zsanitizer=address
export RUSTC_BOOTSTRAP=1 ASAN_OPTIONS=detect_leaks=0
# With the checks of all libraries, and line numbers in reports.
export CARGO_PROFILE_HOST_DEBUG_ASSERTIONS=true CARGO_PROFILE_HOST_OVERFLOW_CHECKS=true \
    CARGO_PROFILE_HOST_DEBUG=line-tables-only
# The module has no unwinder.
RUSTFLAGS=$flags CARGO_PROFILE_HOST_PANIC=abort cargo build --profile host --locked --quiet -p pkmkins \
    --target $target --target-dir target/fuzz-module
# The program that loads the module provides the sanitizer's functions.
RUSTFLAGS="$flags -Clink-arg=-Wl,--export-dynamic" cargo build --profile host --locked --quiet \
    --features fuzz/libfuzzer --bin core --bin layouts --bin entry_points \
    --target $target --target-dir target/watched
export PKMKINS_SO="$root/target/fuzz-module/$target/host/libpkmkins.so"
run core
run layouts
run entry_points
