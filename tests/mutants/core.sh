#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Finds changes of the core that its tests do not notice: cargo xtask mutants core [PART]
#
# To build and notice a mutant usually takes a second of one processor core; a surviving mutant takes a minute.
# There are three stages, because few tests notice most mutants within a second: the unit tests of the
# core, then the quick outside tests with few cases, then all tests, each for the mutants that survived.
# Prints a table and the surviving mutants.
set -euo pipefail
cd "$(dirname "$0")/../.."
tool=target/tools/bin/cargo-mutants part=${1:-0/1}
[ -x $tool ] || cargo install --quiet --locked --root target/tools cargo-mutants@27.1.0
out=build/mutants/core

host=$(rustc -vV | sed -n 's/^host: //p' | tr 'a-z-' 'A-Z_')
export "CARGO_TARGET_${host}_RUNNER=$PWD/tests/mutants/first_failure.sh"

# Runs one stage. Exit codes 2 and 3 report mutants that survived or timed out, which is a result.
stage() {
    local name=$1
    shift
    "$tool" mutants --output "$out/$name" --jobs 2 "$@" || case $? in 2 | 3) ;; *) return 1 ;; esac
}

# Keeps the mutants of the named files that survived the first stage: a pattern also matches a few
# others.
survived() { cat "$@" 2>/dev/null | grep -Fxf "$out/units/mutants.out/missed.txt" || true; }

# Runs a stage for the mutants that an earlier one missed.
again() {
    local name=$1 before=$2
    shift 2
    mapfile -t survivors < <(survived "$out/$before/mutants.out/missed.txt" |
        sed 's/[][\\.|$(){}?+*^]/\\&/g; s/^/--re=^/; s/$/$/')
    [ "${#survivors[@]}" = 0 ] || stage "$name" "${survivors[@]}" "$@"
}

rm -rf "$out"
mkdir -p "$out"
# Unoptimized: optimizing a mutant would take longer than it saves in tests. Only the test program that
# runs is built. Excluded are slow tests, and tests that find nothing with so few cases. The unchanged
# core must pass the other tests; otherwise every mutant would seem noticed.
quickly() {
    CARGO_PROFILE_DEV_OPT_LEVEL=0 CARGO_PROFILE_DEV_DEBUG=0 PKMKINS_CASES=0.01 "$@"
}
quickly stage units --shard "$part" --sharding round-robin --cargo-arg=--lib -- --locked \
    -- --skip converge::tests::at_every_moment --skip watch::tests::the_distance_of \
    --skip certificate::tests::no_direction
quickly again quick units --cargo-arg=--test --cargo-arg=core -- --locked \
    -- --skip tracking:: --skip certified:: --skip dead_points::a_platform \
    --skip properties::a_machine_in --skip properties::a_machine_scaled \
    --skip ahead::the_speed_allowed --skip jacobian::both_jacobians \
    --skip jacobian::the_nut_gradient
CARGO_PROFILE_DEV_DEBUG=0 PKMKINS_CASES=0.1 again all quick -- --locked

{
    cat "$out"/units/mutants.out/{caught,timeout}.txt
    survived "$out"/{quick,all}/mutants.out/{caught,timeout}.txt | sort -u
} >"$out/caught.txt"
survived "$out/all/mutants.out/missed.txt" | grep -vFxf "$out/caught.txt" >"$out/missed.txt" || true
cp "$out/units/mutants.out/unviable.txt" "$out/unviable.txt"
tests/mutants/table.sh "$out" 90
