#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Writes the files beside the configurations that git does not have, because pkm makes them: the panel of every
# machine, and the programs that a file in `paths` names by "Makes programs/NAME.ngc."
#
#     tools/generate.sh PKM
#
# A file that is as it should be is left alone: a test that copies the folder meanwhile copies whole files.
set -eu
pkm=$(realpath "$1")
cd "$(dirname "$0")/.."
mkdir -p target
made=$(mktemp -d -p "$PWD/target")
trap 'rm -rf "$made"' EXIT

for ini in configs/*/*.ini; do
    "$pkm" panel --quiet "$ini" --output-dir "$made/$(dirname "$ini")" > "$made/said"
done
grep -l 'Makes programs/' configs/*/paths/*.toml | while read -r path; do
    machine=$(dirname "$(dirname "$path")")
    mkdir -p "$made/$machine/programs"
    "$pkm" path --quiet "$machine/$(basename "$machine").ini" "$path" \
        --output "$made/$machine/programs/$(basename "$path" .toml).ngc"
done
cd "$made"
find configs -type f | while read -r file; do
    # git does not have a folder of programs that are all made.
    mkdir -p "$OLDPWD/$(dirname "$file")"
    cmp -s "$file" "$OLDPWD/$file" || mv "$file" "$OLDPWD/$file"
done
