#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Finds changes of the HAL files that the tests in tests/hal do not notice: cargo xtask mutants tcl [PART]
set -euo pipefail
cd "$(dirname "$0")/../.."
part=${1:-0/1} out=build/mutants/tcl tool=target/tools/mutants
[ -x $tool/bin/mutate ] || {
    python3 -m venv $tool
    $tool/bin/pip install --quiet --require-hashes -r tools/mutants.txt
}
rm -rf "$out"
mkdir -p "$out"

# Tests one mutant, `FOLDER/NAME.mutant.N.tcl`, in a copy of all HAL files.
judge() {
    local mutant=$1 out=$2 name list folder
    name=$(basename "$mutant" | sed 's/\.mutant\.[0-9]*//')
    folder=$(mktemp -d)
    cp hal/*.tcl "$folder"
    cp "$mutant" "$folder/$name"
    if ! tclsh /dev/stdin "$mutant" <<< 'exit [expr {![info complete [read [open [lindex $argv 0]]]]}]'; then
        list=unviable
    elif timeout 60 tests/hal/hal_test.tcl "$folder" "$name" > /dev/null 2>&1; then
        list=missed
    else
        list=caught
    fi
    rm -r "$folder"
    # The first line that differs.
    { diff "hal/$name" "$mutant" || true; } | awk -v name="hal/$name" '
        NR == 1 { match($0, /^[0-9]+/); line = substr($0, 1, RLENGTH) }
        /^</ && !old { old = substr($0, 3) }
        /^>/ && !new { new = substr($0, 3) }
        END { gsub(/^ +/, "", old); gsub(/^ +/, "", new); print name ":" line ": " old "  ==>  " new }' >> "$out/$list.txt"
}
export -f judge

for file in hal/*.tcl; do
    mkdir -p "$out/changed/$(basename "$file")"
    $tool/bin/mutate "$file" --only tests/mutants/tcl.rules --noCheck --mutantDir "$out/changed/$(basename "$file")" \
        > "$out/log" || { cat "$out/log"; exit 1; }
done
find "$out/changed" -name '*.mutant.*' | sort -V | awk -v part="${part%/*}" -v of="${part#*/}" 'NR % of == part' |
    xargs -P 2 -I '{}' bash -euo pipefail -c 'judge "$1" "$2"' judge '{}' "$out"
tests/mutants/table.sh "$out" 85
