#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Finds changes of the workbench's crates that the tests of the same crate do not notice:
#     cargo xtask mutants workbench [PART [CRATE...]]
#
# PART is a number of changes, drawn at random from all files, or a part of all changes, such as 0/500; default: 30.
# To build and test a change takes a minute, all 15,000 changes take days.
# Tests of programs run LinuxCNC in virtual time, with the library built here or PKM_VIRTUAL_LIBRARY.
set -euo pipefail
cd "$(dirname "$0")/../.."
tool=target/tools/bin/cargo-mutants part=${1:-30}
shift $(($# > 0))
[ $# -gt 0 ] || set -- machine linuxcnc check program new calibrate studies paths view draw export
[ -x $tool ] || cargo install --quiet --locked --root target/tools cargo-mutants@27.1.0
out=build/mutants/workbench

if [ -z "${PKM_VIRTUAL_LIBRARY-}" ]; then
    make virtual >&2
    PKM_VIRTUAL_LIBRARY=$PWD/target/virtual/libpkmkins-virtual.so
fi
host=$(rustc -vV | sed -n 's/^host: //p' | tr 'a-z-' 'A-Z_')
export PKM_VIRTUAL_LIBRARY "CARGO_TARGET_${host}_RUNNER=$PWD/tests/mutants/first_failure.sh"
# Crates are built fast, libraries optimized. The libraries are kept between runs.
export CARGO_PROFILE_DEV_DEBUG=0 CARGO_PROFILE_DEV_PANIC=unwind CARGO_TARGET_DIR=$PWD/target/mutants
fast=(--cargo-arg=--config='profile.dev.package."*".opt-level=2'
    --cargo-arg=--config='profile.dev.package.kinematics.opt-level=2')

rm -rf "$out"
mkdir -p "$out"
mutants() {
    # Generated programs and panels, which git ignores, are copied too.
    "$tool" mutants --no-config --gitignore=false --timeout-multiplier 4 --minimum-test-timeout 60 "$@"
}
packages=("${@/#/--package=}")
case $part in
    */*) ;;
    *)
        count=$(mutants --list "${packages[@]}" | wc -l)
        parts=$((count > part ? count / part : 1))
        part=$((SRANDOM % parts))/$parts
        ;;
esac
echo "part $part of $*" >&2
mutants --output "$out" --jobs 1 "${packages[@]}" --shard "$part" --sharding round-robin \
    "${fast[@]}" -- --locked --lib --test '*' || case $? in 2 | 3) ;; *) exit 1 ;; esac
cat "$out"/mutants.out/{caught,timeout}.txt > "$out/caught.txt"
cp "$out"/mutants.out/{missed,unviable}.txt "$out"
tests/mutants/table.sh "$out" 85
