#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Runs the README's commands on the last commit, in a minimal Debian with make and git.
#
#     tests/bare/run.sh [SUITE [COMMAND [FILE...]]]     bookworm, 'time make demo && time make test'
#
# Copies uncommitted FILEs of this tree to the same places. debootstrap recreates the system in build/bare/SUITE each
# time. Needs root, debootstrap and 15 GB. Shared memory, processes and mounts are separate, and end with the command.
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
