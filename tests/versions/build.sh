#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Builds LinuxCNC from source, to run in place, for tests/versions/run.sh.
#
#     tests/versions/build.sh SERIES REPOSITORY FOLDER     2.10, a clone or address, FOLDER/SERIES is created
#
# versions.toml has the commit. Needs the packages that LinuxCNC's configure names if one is missing.
set -eu
series=$1 repository=$2 folder=$3
commit=$(awk -v series="$series" '$1 == "version" { found = $3 == "\"" series "\"" } found && $1 == "commit" { gsub(/"/, "", $3); print $3 }' \
    workbench/linuxcnc/versions.toml)
[ -n "$commit" ] || { echo "build.sh: versions.toml has no commit for LinuxCNC $series" >&2; exit 1; }
mkdir -p "$folder"
git clone --quiet --no-checkout "$repository" "$folder/$series"
cd "$folder/$series"
# Partial clones lack large files of the documentation.
git checkout --quiet "$commit" || [ -x src/autogen.sh ]
cd src
# The Python of the system, which LinuxCNC is linked with.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin
./autogen.sh
./configure --with-realtime=uspace --disable-gtk --disable-nls --disable-manpages --disable-build-documentation \
    --disable-check-runtime-deps
make -j"$(nproc)"
