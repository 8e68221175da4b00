#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Summarizes a run of mutants: tests/mutants/table.sh FOLDER LEAST
#
# Reads caught.txt, missed.txt and optionally unviable.txt in FOLDER: one mutant per line, `FILE:LINE: CHANGE`.
# Prints a row for each file and the surviving mutants, and writes both to FOLDER/table.md. Fails if fewer than
# LEAST percent of the mutants are noticed.
set -euo pipefail
cd "$1"
touch caught.txt missed.txt unviable.txt
{
    echo "| file | mutants | do not build | noticed | not noticed |"
    echo "|---|--:|--:|--:|--:|"
    awk -F: '
        { sub(".*/src/", "", $1); files[$1]; count[FILENAME, $1]++; count[FILENAME, ""]++ }
        function row(name, file) {
            unviable = count["unviable.txt", file]
            caught = count["caught.txt", file]
            missed = count["missed.txt", file]
            sum = unviable + caught + missed
            return "| " name " | " sum " | " unviable + 0 " | " caught + 0 " | " missed + 0 " |"
        }
        END {
            for (file in files)
                print row(file, file) | "sort"
            close("sort")
            print row("all of them", "")
        }' caught.txt missed.txt unviable.txt
    sed 's/^/  not noticed: /' missed.txt
} | tee table.md
caught=$(wc -l < caught.txt) missed=$(wc -l < missed.txt)
if [ "$caught" -eq 0 ] || [ $((100 * caught)) -lt $(($2 * (caught + missed))) ]; then
    echo "mutants: fewer than $2 of 100 noticed" >&2
    exit 1
fi
