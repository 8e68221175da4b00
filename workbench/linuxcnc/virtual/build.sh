#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Compiles the library for virtual time for the installed LinuxCNC; its version is in the name.
#
#     build.sh [FOLDER]     /var/lib/pkmkins, where pkm looks after the folder of LinuxCNC's modules
#
# CXX names another compiler, such as aarch64-linux-gnu-g++ for 64-bit ARM.
#
# A package contains it for Debian's LinuxCNC. For another one run this once after each upgrade.
set -eu
sources=$(dirname "$(realpath "$0")")
folder=${1:-/var/lib/pkmkins}

lacking=
lacks() { lacking="$lacking $1"; }
[ -x /usr/bin/linuxcnc_var ] || lacks linuxcnc-uspace
[ -e /usr/include/linuxcnc/hal.h ] || lacks linuxcnc-uspace-dev
command -v "${CXX:-g++}" >/dev/null || lacks "${CXX:-g++}"
command -v nm >/dev/null || lacks binutils
[ -e /usr/include/boost/version.hpp ] || lacks libboost-dev
[ -z "$lacking" ] || { echo "pkmkins: to compile for this LinuxCNC, install:$lacking" >&2; exit 1; }
if ! mkdir -p "$folder" || [ ! -w "$folder" ]; then
    echo "pkmkins: $folder cannot be written: run this as root" >&2
    exit 1
fi

version=$(linuxcnc_var LINUXCNCVERSION)
# Without the headers of milltask's messages the library cannot be compiled.
[ -e /usr/include/linuxcnc/nml.hh ] || {
    echo "pkmkins: /usr/include/linuxcnc has no nml.hh: LinuxCNC $version does not run in virtual time, and pkm run" \
        "and pkm preflight judge nothing that depends on time"
    exit 0
}
library=$folder/libpkmkins-virtual-$version.so
made=$(mktemp -d)
trap 'rm -rf "$made" "$library.new"' EXIT
# Every function of HAL and RTAPI in LinuxCNC's library gets a substitute: those not implemented here
# end the run with their name, so that nothing reaches the HAL of this computer.
nm -D --defined-only /usr/lib/liblinuxcnchal.so.0 |
    sed -nE 's/^[0-9a-f]+ T ((hal|halpr|rtapi)_[a-z0-9_]+)$/UNCOVERED(\1)/p' > "$made/uncovered.inc"
"${CXX:-g++}" -std=c++17 -O2 -Wall -Wextra -Wno-ignored-qualifiers -shared -s -fPIC -fvisibility=hidden \
    -DULAPI -DBUILT_FOR="\"$version\"" -I/usr/include/linuxcnc -I"$made" -o "$library.new" "$sources"/*.cc
mv "$library.new" "$library"
