#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Runs the README's commands on the last commit, in a Debian that has make and git and nothing else.
#
#     tests/bare/run.sh [SUITE [COMMAND [FILE...]]]     bookworm, 'time make demo && time make test'
#
# FILEs of this tree that are not committed go along, into the same places.
# debootstrap makes it in build/bare/SUITE, anew each time. Needs root, debootstrap and 15 GB. What runs inside
# has memory, processes and mounts of its own, and ends with the command.
set -eu
cd "$(dirname "$0")/../.."
. tests/bare/debian.sh
alone bare tests/bare/run.sh "$@"

suite=${1:-bookworm}
command=${2:-time make demo && time make test}
if [ $# -lt 2 ]; then shift $#; else shift 2; fi
root=$PWD/build/bare/$suite

debian "$suite" "$root" make,git
git clone --quiet --no-hardlinks . "$root/srv/pkmkins"
[ $# = 0 ] || cp -a --parents "$@" "$root/srv/pkmkins"
inside "$root" bash -c "cd /srv/pkmkins && { $command; }"
