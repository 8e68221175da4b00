#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# rustc for the crates of the workspace, as cargo's RUSTC_WORKSPACE_WRAPPER: with the coverage that guides libFuzzer.
# Libraries of others have the sanitizer alone. Cargo knows this file by its name alone: where its flags change, the
# crates have to be built anew by hand.
case " $* " in
# Runs while something is built, without libFuzzer.
*" --crate-name build_script_"*) exec "$@" ;;
esac
exec "$@" -Cpasses=sancov-module \
    -Cllvm-args=-sanitizer-coverage-level=4 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
    -Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares
