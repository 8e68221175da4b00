#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Finds changes of the page's code that its tests do not notice: cargo xtask mutants page [PART]
#
# Stryker makes the changes; tests/mutants/page/runner.mjs runs the tests of tests/page that reach a change until one
# fails. Strings are not changed: most of them are names of styles.
set -euo pipefail
cd "$(dirname "$0")/../.."
make setup-page virtual
PAGE_PART=${1:-0/1}
PKM=$PWD/target/host/pkm
PKM_VIRTUAL_LIBRARY=$PWD/target/virtual/libpkmkins-virtual.so
here=$PWD/tests/mutants/page out=$PWD/build/mutants/page
PAGE_PROGRESS=$out/progress.txt
export PAGE_PART PAGE_PROGRESS PKM PKM_VIRTUAL_LIBRARY
[ "$here/node_modules/.package-lock.json" -nt "$here/package-lock.json" ] ||
    npm ci --prefix "$here" --silent --no-audit --no-fund
rm -rf "$out"
mkdir -p "$out/run"
cp -r page/src "$out/run/src"
(cd "$out/run" && "$here/node_modules/.bin/stryker" run --plugins "$here/runner.mjs" "$here/stryker.config.json")
node "$here/results.mjs" "$out/run/report.json" "$out"
tests/mutants/table.sh "$out" 85
