#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Finds changes of the Python package and the viewer's programs that tests do not notice: cargo xtask mutants python [PART]
set -euo pipefail
cd "$(dirname "$0")/../.."
make virtual
cargo build --profile host --locked --quiet --bin pkm --lib
environment=target/tools/mutants-python
[ -e "$environment/.installed" ] || {
    python3 -m venv --clear "$environment"
    "$environment/bin/pip" install --quiet --require-hashes -r tests/mutants/python/requirements.txt
    touch "$environment/.installed"
}
out=$PWD/build/mutants/python work=$PWD/build/mutants/python/copy
rm -rf "$out"
mkdir -p "$work/target" "$work/tests"
cp -r configs docs python subroutines viewer "$work"
cp -r tests/live tests/viewer "$work/tests"
cp target/host/lib_core.so "$work/python/pkmkins/_core.abi3.so"
PKM=$PWD/target/host/pkm
PKM_VIRTUAL_LIBRARY=$PWD/target/virtual/libpkmkins-virtual.so
PYTHONPATH=$work/python PYTHONDONTWRITEBYTECODE=1
export PKM PKM_VIRTUAL_LIBRARY PYTHONPATH PYTHONDONTWRITEBYTECODE
"$environment/bin/python" tests/mutants/python/mutants.py "$work" "${1:-0/1}"
tests/mutants/table.sh "$out" 85
