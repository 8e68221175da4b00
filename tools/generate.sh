#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Writes the files of the configurations that pkm generates and git does not contain: the panel of every machine, and a
# program for every file in `paths` with the words "Makes programs/NAME.ngc".
#
#     tools/generate.sh PKM
#
# Does not touch files that are up to date, so that a test that copies the folder meanwhile gets complete files.
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
    # git contains no folder whose programs are all generated.
    mkdir -p "$OLDPWD/$(dirname "$file")"
    cmp -s "$file" "$OLDPWD/$file" || mv "$file" "$OLDPWD/$file"
done
