#!/bin/bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Runs the same tests, live and in virtual time, with every LinuxCNC of versions.toml.
#
#     tests/versions/run.sh [FOLDER]     FOLDER/2.10 is a LinuxCNC 2.10 built to run in place (build.sh); build/linuxcnc
#
# A version that is neither installed nor in FOLDER is reported and left out. Needs root for those in FOLDER.
set -euo pipefail
cd "$(dirname "$0")/../.."
folder=${1:-build/linuxcnc}
installed=$(linuxcnc_var LINUXCNCVERSION)

# tests SERIES: with the module for it.
tests() {
    make --no-print-directory install LINUXCNC="$1"
    # What is installed, not what an earlier build left.
    unset PKM_VIRTUAL_LIBRARY
    cargo test --profile host --locked --quiet -p linuxcnc
    for ini in configs/*/*.ini; do target/host/pkm --quiet check "$ini"; done
    tests/live/pins_test.py
    tests/live/live_test.py
    tests/live/truth.py --live short --out "build/versions/$1"
}
if [ "${1:-}" = --tests ]; then
    tests "$2"
    exit
fi

failed=
while read -r series; do
    case $installed in
    "$series".*) with=() ;;
    *)
        if [ ! -x "$folder/$series/bin/milltask" ]; then
            echo "versions: LinuxCNC $series: NOT TESTED: neither installed nor in $folder/$series (tests/versions/build.sh)"
            continue
        fi
        with=(tests/versions/with.sh "$folder/$series")
        ;;
    esac
    echo "versions: LinuxCNC $series"
    "${with[@]}" "$0" --tests "$series" < /dev/null || failed="$failed $series"
done < <(sed -n 's/^version = "\(.*\)"$/\1/p' workbench/linuxcnc/versions.toml)
[ -z "$failed" ] || { echo "versions: failed with LinuxCNC$failed" >&2; exit 1; }
