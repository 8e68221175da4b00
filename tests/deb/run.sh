#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Installs the packages of target/debian in a minimal Debian, uses them and removes them.
#
#     tests/deb/run.sh [SUITE [FOLDER [ARCHITECTURE]]]     bookworm, target/debian, that of this computer
#
# debootstrap makes it in build/deb/SUITE, anew each time. Needs root, debootstrap and 4 GB, for another architecture
# (arm64) qemu-user-static, which emulates the processor and neither Landlock nor seccomp: steps that need these, or a
# real clock, are skipped, and the output lists them. Neither Rust nor a
# compiler comes into it. What each step came to stands in the output, closed by the number of those that passed.
set -eu
cd "$(dirname "$0")/../.."
. tests/bare/debian.sh
alone deb tests/deb/run.sh "$@"

suite=${1:-bookworm}
folder=${2:-target/debian}
here=$(dpkg --print-architecture)
arch=${3:-$here}
root=$PWD/build/deb/$suite
# The package for the LinuxCNC that this Debian ships.
series=$(awk -v suite="\"$suite\"" '$1 == "version" { series = $3 } $1 == "debian" && index($0, suite) { print series }' \
    workbench/linuxcnc/versions.toml | tr -d '"')
set -- "$folder"/pkm_*_"$arch".deb "$folder"/pkmkins_*+linuxcnc"$series"_"$arch".deb
ls "$@" >/dev/null ||
    { echo "deb: no packages: make deb ARCH=$arch" >&2; exit 2; }

[ "$arch" = "$here" ] || emulated
debian "$suite" "$root"
mkdir -p "$root/srv/deb" "$root/srv/pkmkins"
cp "$@" "$root/srv/deb"
# What the live tests take along.
cp -a --parents configs tests/live tests/viewer tests/cases/ini tests/cases/reading tests/deb viewer docs/site/links.py "$root/srv/pkmkins"
# What `make install` puts there, by itself: the packages have to find it.
make --no-print-directory -s -o setup -o module -o virtual install DESTDIR="$root/srv/by-hand"
inside "$root" env EMULATED="$([ "$arch" = "$here" ] || echo yes)" sh /srv/pkmkins/tests/deb/inside.sh
