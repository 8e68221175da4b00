#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
#
# Checks include/pkmkins.h with a C compiler and runs a C client of the module.
#   tests/module/c/run.sh
# Environment: LINUXCNC_HEADERS (default /usr/include/linuxcnc),
#   PKMKINS_SO (default target/module/release/libpkmkins.so), CC (default cc),
#   RUNNER (the emulator for another processor, for which CC compiles).
set -eu

here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../../.." && pwd)
headers=${LINUXCNC_HEADERS:-/usr/include/linuxcnc}
module=${PKMKINS_SO:-$root/target/module/release/libpkmkins.so}
cc=${CC:-cc}
runner=${RUNNER:-}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

say_and_fail() { echo "tests/module/c: $*" >&2; exit 1; }

[ -f "$root/include/pkmkins.h" ] || say_and_fail "include/pkmkins.h is missing: run 'cargo xtask header'"
[ -f "$headers/kinematics.h" ] || say_and_fail "$headers/kinematics.h is missing: install linuxcnc-uspace-dev"
[ -f "$module" ] || say_and_fail "$module is missing: run 'make module'"

# compile INCLUDE_FOLDER OUTPUT [FLAG...]: without warnings about LinuxCNC's headers.
compile() {
    include=$1 output=$2
    shift 2
    $cc -std=gnu11 -Wall -Wextra -Werror -g -isystem "$headers" -I "$include" "$@" \
        "$here/abi_check.c" -o "$output" -ldl -lm
}

# must_not_compile NAME INCLUDE_FOLDER [FLAG...]
must_not_compile() {
    name=$1 include=$2
    shift 2
    if compile "$include" "$work/planted" "$@" 2>"$work/errors"; then
        say_and_fail "a planted mismatch compiled: $name"
    fi
    grep -q 'conflicting types\|static assertion failed\|redefinition' "$work/errors" ||
        { cat "$work/errors" >&2; say_and_fail "refused for another reason: $name"; }
    echo "ok: refused by the compiler: $name"
}

# plant NAME SED_SCRIPT: a copy of the header with an error in it.
plant() {
    rm -rf "$work/include"
    mkdir "$work/include"
    sed "$2" "$root/include/pkmkins.h" >"$work/include/pkmkins.h"
    ! cmp -s "$root/include/pkmkins.h" "$work/include/pkmkins.h" ||
        say_and_fail "nothing to plant in include/pkmkins.h: $1"
    must_not_compile "$1" "$work/include"
}

compile "$root/include" "$work/abi_check"
echo "ok: pkmkins.h beside LinuxCNC's kinematics.h and emcpos.h"
compile "$root/include" "$work/alone" -DALONE
echo "ok: pkmkins.h alone, same sizes and offsets"

must_not_compile "forward without flags" "$root/include" \
    '-DPLANT=extern int kinematicsForward(const double *, EmcPose *)'
must_not_compile "inverse into float joints" "$root/include" \
    '-DPLANT=extern int kinematicsInverse(const EmcPose *, float *, const unsigned long *, unsigned long *)'
must_not_compile "type as void" "$root/include" '-DPLANT=extern void kinematicsType(void)'
must_not_compile "a wider jacobian" "$root/include" \
    '-DPLANT=extern int kinematicsJacobian(const double *, const EmcPose *, double (*)[10], const unsigned long *)'
plant "the header with float for double" 's/\bdouble\b/float/g'
plant "the header with a pose that inverse may write" '/kinematicsInverse/,/;/s/const struct EmcPose/struct EmcPose/;/kinematicsInverse/,/;/s/const EmcPose/EmcPose/'
plant "the header with a result of another type" 's/^\(extern \)\{0,1\}int \(kinematicsSwitch(\)/\1long \2/'

$cc -std=gnu11 -Wall -Wextra -Werror -fvisibility=hidden -shared -fPIC -DRTAPI -isystem "$headers" \
    "$root/tests/module/stub_hal/stub_hal.c" -o "$work/stub_hal.so"
$runner "$work/abi_check" "$work/stub_hal.so" "$module"

# Pins by the header's own accessors, if the module is built for the same HAL as the header.
constructor=hal_pin_float_new
grep -q 'hal_pin_new_real(' "$headers/hal.h" && constructor=hal_pin_new_real
if nm -D --undefined-only "$module" | grep -qw "$constructor"; then
    $cc -std=gnu11 -Wall -Wextra -Werror -g -DRTAPI -isystem "$headers" \
        "$here/hal_check.c" -o "$work/hal_check" -ldl -lm
    $runner "$work/hal_check" "$work/stub_hal.so" "$module"
else
    echo "not judged: pins beside $headers/hal.h, for which the module is not built"
fi

# The tools that watch a client support only this processor's instructions.
if [ -n "$runner" ]; then
    echo "not judged under sanitizers and valgrind: a program of another processor"
    exit 0
fi

# The same client under the sanitizers: it owns every byte that the module may write.
compile "$root/include" "$work/watched" -fsanitize=address,undefined -fno-sanitize-recover=all
ASAN_OPTIONS=detect_leaks=0 "$work/watched" "$work/stub_hal.so" "$module" >/dev/null
echo "ok: the same under address and undefined-behaviour sanitizers"

# And under valgrind, which watches the module itself too: no read of an uninitialized byte.
valgrind --quiet --error-exitcode=1 --leak-check=no \
    "$work/abi_check" "$work/stub_hal.so" "$module" >/dev/null
echo "ok: the same under valgrind's memcheck"
