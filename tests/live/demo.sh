#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Runs one program of one machine under the real LinuxCNC and reports on it.
#
#     tests/live/demo.sh [MACHINE [PROGRAM]]
#
# MACHINE is a folder of configs/, PROGRAM a file of its programs; without it the one its INI file
# opens. Trace, result and report with plots are left in build/demo/MACHINE.
set -eu
cd "$(dirname "$0")/../.."

machine=${1:-hexapod}
ini=configs/$machine/$machine.ini
[ -f "$ini" ] || { echo "demo: no machine $machine; there are: $(ls configs | tr '\n' ' ')" >&2; exit 2; }
program=${2:-$(sed -n 's|^OPEN_FILE = programs/||p' "$ini")}
[ -f "configs/$machine/programs/$program" ] ||
    { echo "demo: no program $program; there are: $(ls "configs/$machine/programs" | tr '\n' ' ')" >&2; exit 2; }
out=build/demo/$machine

cargo build --profile host --locked --quiet -p judge
rm -rf "$out"
mkdir -p "$out"
echo "demo: LinuxCNC homes $machine and runs $program, in real time"
tests/live/run_live.py --config "configs/$machine" --program "$program" --out "$out" || failed=$?
target/host/judge "$ini" "$out/trace.csv" "$out/result.json" "$out"
exit "${failed:-0}"
