#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Cargo for mutants of the module: builds the mutant's module in place of tests, and runs tests that are built already.
set -e
case "$*" in
test*--no-run*)
    # Quickly built. Only full optimization removes two names that nothing defines: a call of the panic handler, which
    # the released file must not have, ends the test here.
    CARGO_PROFILE_RELEASE_LTO=off CARGO_PROFILE_RELEASE_OPT_LEVEL=1 CARGO_PROFILE_RELEASE_DEBUG=false \
        CARGO_PROFILE_RELEASE_CODEGEN_UNITS=16 CARGO_PROFILE_RELEASE_INCREMENTAL=true \
        exec cargo rustc --release --locked --lib -p pkmkins --target-dir "$MUTANTS_TARGET" -- \
        -Clink-arg=-Wl,--defsym=pkmkins_has_a_panic_path=0,--defsym=rust_eh_personality=0
    ;;
test*)
    run() {
        cases=$1
        shift
        PKMKINS_SO=$MUTANTS_TARGET/release/libpkmkins.so PKMKINS_CASES=$cases \
            "${0%/*}/first_failure.sh" "$MUTANTS_TESTS" "$@"
    }
    # Left out are tests of the file itself, and those that with so few cases do not meet what they look for. Most mutants
    # are noticed by the others within seconds.
    few="--skip=host_library:: --skip=released:: --skip=c_header:: --skip=singular::lines_of_random --skip=rods::of_random"
    long="--skip=sequences:: --skip=tool_interrupted:: --skip=singular:: --skip=peers:: --skip=genhexkins:: --skip=through::
        --skip=connected:: --skip=workspace:: --skip=start:: --skip=jog::jogs_end --skip=pair::a_move_alone"
    # shellcheck disable=SC2086
    run 0.01 $few $long
    run 0.03 $few
    ;;
*) exec cargo "$@" ;;
esac
