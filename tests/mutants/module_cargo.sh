#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Stands in for cargo: builds the mutant's module instead of tests, and runs tests that are built already.
set -e
case "$*" in
test*--no-run*)
    # Little optimization builds faster. Only full optimization removes two undefined symbols. A call of the panic
    # handler, which the released file does not contain, ends the test here.
    CARGO_PROFILE_RELEASE_LTO=off CARGO_PROFILE_RELEASE_OPT_LEVEL=1 CARGO_PROFILE_RELEASE_DEBUG=false \
        CARGO_PROFILE_RELEASE_CODEGEN_UNITS=16 CARGO_PROFILE_RELEASE_INCREMENTAL=true \
        exec cargo rustc --release --locked --lib -p pkmkins --target-dir "$MUTANTS_TARGET" -- -Crelro-level=partial \
        -Clink-arg=-Wl,--defsym=pkmkins_has_a_panic_path=0,--defsym=rust_eh_personality=0
    ;;
test*)
    run() {
        cases=$1
        shift
        PKMKINS_SO=$MUTANTS_TARGET/release/libpkmkins.so PKMKINS_CASES=$cases \
            "${0%/*}/first_failure.sh" "$MUTANTS_TESTS" "$@"
    }
    # Excluded are tests of the file itself, and tests that find nothing with so few cases. The others notice most
    # mutants within seconds.
    few="--skip=host_library:: --skip=released:: --skip=c_header:: --skip=singular::lines_of_random --skip=rods::of_random"
    long="--skip=sequences:: --skip=tool_interrupted:: --skip=singular:: --skip=peers:: --skip=genhexkins:: --skip=through::
        --skip=connected:: --skip=workspace:: --skip=start:: --skip=jog::jogs_end --skip=pair::a_move_alone"
    # shellcheck disable=SC2086
    run 0.01 $few $long
    # shellcheck disable=SC2086 # several words
    run 0.03 $few
    ;;
*) exec cargo "$@" ;;
esac
