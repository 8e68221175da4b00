#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Writes a repository for apt from packages: files that apt reads from any web server or folder.
#
#     packaging/repository.sh [FOLDER [OUT]]     build/release, build/repository
#
# Each series of LinuxCNC has a component, as in linuxcnc.org's repository, so that apt never selects a pkmkins for
# another series; every component contains pkm, which works with all. Signs nothing: the publisher signs
# dists/stable/Release as InRelease.
set -eu
cd "$(dirname "$0")/.."
folder=$(realpath "${1:-build/release}")
out=$(realpath -m "${2:-build/repository}")
ls "$folder"/*.deb >/dev/null || { echo "repository: no packages in $folder: make release" >&2; exit 2; }
command -v apt-ftparchive >/dev/null || { echo "repository: apt-ftparchive is missing: install apt-utils" >&2; exit 2; }

rm -rf "$out"
all=$(for deb in "$folder"/*.deb; do dpkg-deb --field "$deb" Version; done)
series=$(echo "$all" | sed -n 's/.*+linuxcnc//p' | sort -uV)
architectures=$(for deb in "$folder"/*.deb; do dpkg-deb --field "$deb" Architecture; done | sort -u)
for one in $series; do
    pool=$out/pool/$one
    mkdir -p "$pool"
    cp "$folder"/*+linuxcnc"$one"_*.deb "$folder"/pkm[_-]*.deb "$pool"
    for architecture in $architectures; do
        index=$out/dists/stable/$one/binary-$architecture
        mkdir -p "$index"
        (cd "$out" && apt-ftparchive --arch "$architecture" packages "pool/$one") > "$index/Packages"
        gzip --no-name --best --keep "$index/Packages"
    done
done
apt-ftparchive -o APT::FTPArchive::Release::Origin=pkmkins -o APT::FTPArchive::Release::Label=pkmkins \
    -o APT::FTPArchive::Release::Suite=stable -o APT::FTPArchive::Release::Components="$(printf %s "$series" | tr '\n' ' ')" \
    -o APT::FTPArchive::Release::Architectures="$(printf %s "$architectures" | tr '\n' ' ')" \
    release "$out/dists/stable" > "$out/Release.new"
mv "$out/Release.new" "$out/dists/stable/Release"
echo "repository: $out; in a computer's sources: deb [signed-by=KEY] URL stable $(printf %s "$series" | tr '\n' '|')"
