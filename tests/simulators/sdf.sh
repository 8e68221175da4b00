#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Loads the SDF models of all shipped machines with sdformat's parser, where Debian has it.
#
#     tests/simulators/sdf.sh PKM FOLDER
set -eu

make --no-print-directory setup PACKAGES="libsdformat-dev pkg-config" || true
library=$(pkg-config --list-all 2>/dev/null | sed -n 's/^\(sdformat[0-9]*\) .*/\1/p' | head -n 1)
if [ -z "$library" ]; then
    echo "pkmkins: libsdformat-dev is missing, so SDF models are not judged"
    exit 0
fi
# shellcheck disable=SC2046  # options have no spaces
g++ -std=c++17 -o "$2/sdf" tests/simulators/sdf.cc $(pkg-config --cflags --libs "$library")
for ini in configs/*/*.ini; do
    name=$(basename "$ini" .ini)
    "$1" export "$ini" --sdf "$2/sdf-models/$name" > "$2/answer" || { cat "$2/answer" >&2; exit 1; }
done
# Warnings go to the same place as errors, and are none.
"$2/sdf" "$2"/sdf-models/*/*.sdf 2> "$2/sdf-errors" || { cat "$2/sdf-errors" >&2; exit 1; }
[ ! -s "$2/sdf-errors" ] || { cat "$2/sdf-errors" >&2; exit 1; }
