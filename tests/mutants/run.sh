#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Which changes of the core its tests do not notice: tests/mutants/run.sh CARGO_MUTANTS PART
#
# Three stages, for a small part of the tests notices most mutants within seconds: first the quick
# tests with few cases, then the unit tests inside the core, then everything, each for the mutants that
# survived. Ends in a table; fails where fewer than LEAST of a hundred are noticed.
set -euo pipefail
cd "$(dirname "$0")/../.."
tool=$1 part=$2
out=build/mutants
LEAST=90

host=$(rustc -vV | sed -n 's/^host: //p' | tr 'a-z-' 'A-Z_')
export "CARGO_TARGET_${host}_RUNNER=$PWD/tests/mutants/first_failure.sh"

# Mutants of one stage; 2 and 3 tell of mutants that survived or ran out of time, which is the result.
stage() {
    local name=$1
    shift
    "$tool" mutants --output "$out/$name" --jobs 2 "$@" || case $? in 2 | 3) ;; *) return 1 ;; esac
}

lines() { cat "$@" 2>/dev/null | wc -l; }

# Of the mutants in the files named, those that survived the quick tests: a pattern brings a few
# others along.
survived() { cat "$@" 2>/dev/null | grep -Fxf "$out/quick/mutants.out/missed.txt" || true; }

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
# Unoptimised: building a mutant would take longer than the tests save. Left out are tests that take
# minutes, and those that with so few cases do not meet what they look for; the unchanged core has to
# pass what is left, or everything would seem to be caught.
quickly() {
    CARGO_PROFILE_DEV_OPT_LEVEL=0 CARGO_PROFILE_DEV_DEBUG=0 PKMKINS_CASES=0.01 "$@"
}
quickly stage quick --shard "$part" --sharding round-robin \
    -- --locked --test core -- --skip tracking:: --skip certified:: \
    --skip properties::a_machine --skip dead_points::a_platform \
    --skip ahead::the_speed_allowed --skip jacobian::both_jacobians --skip jacobian::the_nut_gradient
quickly again units quick -- --locked --lib -- --skip converge::tests::at_every_moment
PKMKINS_CASES=0.1 again all units -- --locked

caught=$(survived "$out"/{units,all}/mutants.out/{caught,timeout}.txt | sort -u | wc -l)
caught=$((caught + $(lines "$out"/quick/mutants.out/{caught,timeout}.txt)))
missed=$(survived "$out/all/mutants.out/missed.txt" | wc -l)
unviable=$(lines "$out/quick/mutants.out/unviable.txt")
echo "mutants of part $part: $caught caught, $missed missed, $unviable do not build"
survived "$out/all/mutants.out/missed.txt" | sed 's/^/  missed: /'
[ $((100 * caught)) -ge $((LEAST * (caught + missed))) ] || {
    echo "mutants: fewer than $LEAST of 100 caught" >&2
    exit 1
}
