#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Runs a command, as root, in parallel to others that use LinuxCNC as well.
#
#     tests/live/lane.sh COMMAND [ARGUMENT...]
#
# HAL is shared memory, a socket and processes, and LinuxCNC holds a lock in /tmp and files in the
# home folder: the command gets private ones, and private ports of 127.0.0.1. Remaining processes end with it.
set -eu

exec unshare --ipc --net --pid --mount --propagation private --fork --kill-child --mount-proc sh -c '
    ip link set lo up
    mount -t tmpfs -o mode=1777 lane /tmp
    home=$(getent passwd pkmkins-run | cut -d: -f6)
    mount -t tmpfs -o "mode=755,uid=$(id -u pkmkins-run)" lane "$home"
    "$@"
    exit $?' lane "$@"
