#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Installs the packages of target/debian in a Debian that has nothing else, uses them and takes them away again.
#
#     tests/deb/run.sh [SUITE [FOLDER]]     bookworm, target/debian
#
# debootstrap makes it in build/deb/SUITE, anew each time. Needs root, debootstrap and 4 GB. Neither Rust nor a
# compiler comes into it. What each step came to stands in the output, closed by the number of those that passed.
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
# What the live tests take along.
cp -a --parents configs tests/live tests/viewer tests/cases/ini tests/deb viewer "$root/srv/pkmkins"
# What `make install` puts there, by itself: the packages have to find it.
make --no-print-directory -s -o setup -o module -o virtual install DESTDIR="$root/srv/by-hand"
inside "$root" sh /srv/pkmkins/tests/deb/inside.sh
