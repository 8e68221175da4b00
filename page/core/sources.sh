#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Prints a checksum of the sources of the page's kinematics. Comments, blank lines and unit tests do not count: they change no
# instruction.
set -eu
cd "$(dirname "$0")/../.."
export LC_ALL=C
{
    find kinsmodule/kinematics/src page/core/src -name '*.rs' | sort | while read -r file; do
        echo "$file"
        sed '/^#\[cfg(test)\]$/,$d; /^[[:space:]]*\/\//d; /^[[:space:]]*$/d' "$file"
    done
    cat kinsmodule/kinematics/Cargo.toml page/core/Cargo.toml page/core/build.sh
} | sha256sum | cut -d ' ' -f 1
