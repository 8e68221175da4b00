#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Runs one program of one machine under the real LinuxCNC and reports on it.
#
#     tests/live/demo.sh [MACHINE [PROGRAM]]
#
# MACHINE is a folder of configs/, or the INI file of the user's machine, in its own folder as `pkm new`
# creates it. PROGRAM is a file of its programs; the default is the one that its INI file opens. Trace, result and
# report with plots are left in build/demo/NAME.
set -eu
machine=${1:-hexapod}
# Relative to the folder of the make call, before the script changes to the root of the repository.
[ ! -f "$machine" ] || ini=$(realpath "$machine")
cd "$(dirname "$0")/../.."

ini=${ini:-configs/$machine/$machine.ini}
[ -f "$ini" ] || { echo "demo: no machine $machine: name an INI file, or one of: $(cd configs && echo *)" >&2; exit 2; }
folder=$(dirname "$ini")
name=$(basename "$ini" .ini)
program=${2:-$(sed -n 's|^OPEN_FILE = programs/||p' "$ini")}
if [ -z "$program" ] || [ ! -f "$folder/programs/$program" ]; then
    echo "demo: no program ${program:-named by OPEN_FILE = programs/...}; there are: $(cd "$folder/programs" && echo *)" >&2
    exit 2
fi
out=build/demo/$name

tools/progress.sh "building pkm and the judge" cargo build --profile host --locked --quiet --bin pkm --bin judge
rm -rf "$out"
mkdir -p "$out"
# LinuxCNC runs in real time: allow 1.5 times the duration in virtual time.
tools/progress.sh "preflight" target/host/pkm preflight "$ini" "$folder/programs/$program" --quiet --format json \
    > "$out/preflight.json" ||
    { echo "demo: preflight does not pass it: target/host/pkm preflight $ini $folder/programs/$program" >&2; exit 1; }
seconds=$(python3 -c '
import json, sys
time = json.load(open(sys.argv[1]))["time"]
if "judged" not in time: sys.exit("demo: how long it takes is not known: " + time["not_judged"])
print(round(60 + 1.5 * time["judged"]["seconds"]))' "$out/preflight.json")
echo "demo: LinuxCNC homes $name and runs $program, in real time; it gets $seconds s"
tools/progress.sh "$program" tests/live/run_live.py --config "$ini" --program "$program" --out "$out" \
    --seconds "$seconds" || failed=$?
tools/progress.sh "report and plots" target/host/judge "$ini" "$out/trace.csv" "$out/result.json" "$out"
exit "${failed:-0}"
