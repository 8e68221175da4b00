#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Which changes of the core its tests do not notice: cargo xtask mutants core [PART]
#
# Most mutants take a second of one core, to be built and noticed; one that nothing notices a minute.
# Three stages, for a small part of the tests notices most mutants within a second: first the unit
# tests inside the core, then the quick tests from outside with few cases, then everything, each for
# the mutants that survived. Ends in a table and in the mutants not noticed.
set -euo pipefail
cd "$(dirname "$0")/../.."
tool=target/tools/bin/cargo-mutants part=${1:-0/1}
[ -x $tool ] || cargo install --quiet --locked --root target/tools cargo-mutants@27.1.0
out=build/mutants/core

host=$(rustc -vV | sed -n 's/^host: //p' | tr 'a-z-' 'A-Z_')
export "CARGO_TARGET_${host}_RUNNER=$PWD/tests/mutants/first_failure.sh"

# Mutants of one stage; 2 and 3 tell of mutants that survived or ran out of time: the result.
stage() {
    local name=$1
    shift
    "$tool" mutants --output "$out/$name" --jobs 2 "$@" || case $? in 2 | 3) ;; *) return 1 ;; esac
}

# Of the mutants in the files named, those that survived the first stage: a pattern brings a few
# others along.
survived() { cat "$@" 2>/dev/null | grep -Fxf "$out/units/mutants.out/missed.txt" || true; }

# A stage for the mutants that another one missed.
again() {
    local name=$1 before=$2
    shift 2
    mapfile -t survivors < <(survived "$out/$before/mutants.out/missed.txt" |
        sed 's/[][\\.|$(){}?+*^]/\\&/g; s/^/--re=^/; s/$/$/')
    [ "${#survivors[@]}" = 0 ] || stage "$name" "${survivors[@]}" "$@"
}

rm -rf "$out"
mkdir -p "$out"
# Unoptimised: building a mutant would take longer than the tests save. Nothing is built but the
# program that runs. Left out are tests that take long, and those that with so few cases do not meet
# what they look for; the unchanged core has to pass what is left, or everything would seem to be
# caught.
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
