#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
#
# Runs the fuzz targets with libFuzzer on the stable toolchain.
#   fuzz/run.sh               the kept corpus and a fixed number of runs: what CI does
#   fuzz/run.sh --minutes N   each target for N minutes; core, module and its caller under
#                             AddressSanitizer; new inputs go to fuzz/target/corpus
# What a target does not survive is left in fuzz/artifacts.
set -eu

cd "$(dirname "$0")"
root=$(cd .. && pwd)
target=x86_64-unknown-linux-gnu
coverage="-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4
-Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table
-Cllvm-args=-sanitizer-coverage-trace-compares"
# cargo splits its flags at blanks only.
coverage=$(printf %s "$coverage" | tr '\n' ' ')
mkdir -p artifacts target/corpus/core target/corpus/layouts target/corpus/entry_points corpus/layouts

# run TARGET FOLDER [OPTION...]
run() {
    name=$1 folder=$2
    shift 2
    echo "fuzz: $name"
    RUST_BACKTRACE=0 "$folder/$target/release/$name" -max_len=600 -timeout=10 \
        -artifact_prefix=artifacts/ -verbosity=0 "$@" "target/corpus/$name" "corpus/$name"
}

if [ "${1:-}" != --minutes ]; then
    rm -rf target/corpus/core/* target/corpus/layouts/* target/corpus/entry_points/*
    # A few seconds of runs do not pay for more; checks of overflow stay.
    export CARGO_PROFILE_RELEASE_OPT_LEVEL=1 CARGO_PROFILE_RELEASE_DEBUG=false CARGO_PROFILE_RELEASE_LTO=off
    RUSTFLAGS=$coverage cargo build --release --locked --quiet --target $target
    run core target -seed=1 -runs=20000
    run layouts target -seed=1 -runs=20000
    run entry_points target -seed=1 -runs=5000
    exit 0
fi

# The sanitizer's flag is not stable, its runtime comes with the stable toolchain.
seconds=$((60 * $2))
flags="$coverage -Zsanitizer=address"
export RUSTC_BOOTSTRAP=1 ASAN_OPTIONS=detect_leaks=0
# The module has no unwinder.
(cd "$root" && RUSTFLAGS=$flags CARGO_PROFILE_HOST_PANIC=abort cargo build --profile host --locked --quiet -p pkmkins \
    --target $target --target-dir target/fuzz-module)
# What the module calls of the sanitizer is in the program that loads it.
RUSTFLAGS="$flags -Clink-arg=-Wl,--export-dynamic" cargo build --release --locked --quiet \
    --target $target --target-dir target/watched
export PKMKINS_SO="$root/target/fuzz-module/$target/host/libpkmkins.so"
run core target/watched -max_total_time=$seconds
run layouts target/watched -max_total_time=$seconds
run entry_points target/watched -max_total_time=$seconds
