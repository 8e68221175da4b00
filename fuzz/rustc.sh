#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# rustc for the crates of the workspace, as cargo's RUSTC_WORKSPACE_WRAPPER: with the coverage that guides libFuzzer.
# Other libraries have only the sanitizer. Cargo detects no change of this file: after a change of flags, rebuild
# the crates manually.
case " $* " in
# Build scripts run during the build, without libFuzzer.
*" --crate-name build_script_"*) exec "$@" ;;
esac
exec "$@" -Cpasses=sancov-module \
    -Cllvm-args=-sanitizer-coverage-level=4 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
    -Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares
