#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Installs the packages of target/debian in a minimal Debian, uses them and removes them.
#
#     tests/deb/run.sh [SUITE [FOLDER]]     bookworm, target/debian
#
# debootstrap recreates the system in build/deb/SUITE each time, without Rust or a compiler. Needs root, debootstrap and
# 4 GB. Prints the result of each step, and finally the number that passed.
set -eu
cd "$(dirname "$0")/../.."
. tests/bare/debian.sh
alone deb tests/deb/run.sh "$@"

suite=${1:-bookworm}
folder=${2:-target/debian}
root=$PWD/build/deb/$suite
ls "$folder"/pkm_*.deb "$folder"/pkmkins_*.deb >/dev/null || { echo "deb: no packages: make deb" >&2; exit 2; }

debian "$suite" "$root"
mkdir -p "$root/srv/deb" "$root/srv/pkmkins"
cp "$folder"/pkm_*.deb "$folder"/pkmkins_*.deb "$root/srv/deb"
# Files that the live tests need.
cp -a --parents configs tests/live tests/viewer tests/cases/ini tests/deb viewer "$root/srv/pkmkins"
# A separate copy of the files of `make install`, which the packages must detect.
make --no-print-directory -s -o setup -o module -o virtual install DESTDIR="$root/srv/by-hand"
inside "$root" sh /srv/pkmkins/tests/deb/inside.sh
