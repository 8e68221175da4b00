#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Finds changes of the module that the tests of the built file do not notice: cargo xtask mutants module [PART]
#
# The tests load a file, so a mutant builds only that file: cargo-mutants runs module_cargo.sh in place of cargo.
set -euo pipefail
cd "$(dirname "$0")/../.."
tool=$PWD/target/tools/bin/cargo-mutants part=${1:-0/1}
[ -x "$tool" ] || cargo install --quiet --locked --root target/tools cargo-mutants@27.1.0
out=$PWD/build/mutants/module
rm -rf "$out"
mkdir -p "$out"

# A copy, because the file may be rebuilt during the run.
built=$(cargo test --profile host --locked --no-run -p abi-tests --test abi --message-format=json |
    sed -n 's|.*"executable":"\([^"]*/abi-[^"]*\)".*|\1|p')
cp "$built" "$out/tests"
# Exit codes 2 and 3 report mutants that survived or timed out, which is a result.
MUTANTS_TESTS=$out/tests MUTANTS_TARGET=$PWD/target/mutants CARGO=$PWD/tests/mutants/module_cargo.sh \
    "$tool" mutants -p pkmkins --config tests/mutants/module.toml --shard "$part" --sharding round-robin \
    --output "$out" -- --locked || case $? in 2 | 3) ;; *) exit 1 ;; esac

of=$out/mutants.out
cat "$of"/{caught,timeout}.txt >"$out/caught.txt"
cp "$of"/{missed,unviable}.txt "$out"
tests/mutants/table.sh "$out" 85
