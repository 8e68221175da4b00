#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
#
# Runs the fuzz targets with libFuzzer on the stable toolchain.
#   fuzz/run.sh               the kept corpus and a fixed number of runs: what CI does
#   fuzz/run.sh --minutes N   each target for N minutes; core, module and its caller under
#                             AddressSanitizer
# New inputs go to target/fuzz/corpus, and what a target does not survive to target/fuzz/artifacts.
set -eu

cd "$(dirname "$0")/.."
root=$(pwd)
target=x86_64-unknown-linux-gnu
out=target/fuzz
mkdir -p $out/artifacts $out/corpus/core $out/corpus/layouts $out/corpus/entry_points fuzz/corpus/layouts
export RUSTC_WORKSPACE_WRAPPER="$root/fuzz/rustc.sh"

# build [OPTION...]
build() {
    cargo build --profile host --locked --quiet --features fuzz/libfuzzer --bin core --bin layouts --bin entry_points "$@"
}

# run TARGET FOLDER [OPTION...]
run() {
    name=$1 folder=$2
    shift 2
    echo "fuzz: $name"
    RUST_BACKTRACE=0 "$folder/host/$name" -max_len=600 -timeout=10 \
        -artifact_prefix=$out/artifacts/ -verbosity=0 "$@" "$out/corpus/$name" "fuzz/corpus/$name"
}

if [ "${1:-}" != --minutes ]; then
    rm -rf $out/corpus/core/* $out/corpus/layouts/* $out/corpus/entry_points/*
    build
    run core target -seed=1 -runs=20000
    run layouts target -seed=1 -runs=20000
    run entry_points target -seed=1 -runs=5000
    exit 0
fi

# The sanitizer's flag is not stable, its runtime comes with the stable toolchain.
seconds=$((60 * $2))
flags=-Zsanitizer=address
export RUSTC_BOOTSTRAP=1 ASAN_OPTIONS=detect_leaks=0
# Here there is time for the checks of the libraries, and for lines in what is told of a fault.
export CARGO_PROFILE_HOST_DEBUG_ASSERTIONS=true CARGO_PROFILE_HOST_OVERFLOW_CHECKS=true \
    CARGO_PROFILE_HOST_DEBUG=line-tables-only
# The module has no unwinder.
RUSTFLAGS=$flags CARGO_PROFILE_HOST_PANIC=abort cargo build --profile host --locked --quiet -p pkmkins \
    --target $target --target-dir target/fuzz-module
# What the module calls of the sanitizer is in the program that loads it.
(
    export RUSTFLAGS="$flags -Clink-arg=-Wl,--export-dynamic"
    build --target $target --target-dir target/watched
)
export PKMKINS_SO="$root/target/fuzz-module/$target/host/libpkmkins.so"
run core target/watched/$target -max_total_time=$seconds
run layouts target/watched/$target -max_total_time=$seconds
run entry_points target/watched/$target -max_total_time=$seconds
