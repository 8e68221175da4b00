#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Runs a command, as root, beside others that use LinuxCNC as well.
#
#     tests/live/lane.sh COMMAND [ARGUMENT...]
#
# HAL is a piece of shared memory, a socket and processes, and LinuxCNC holds a lock in /tmp and
# files at home: the command has all of these for itself, and the ports of 127.0.0.1. What is left running ends with it.
set -eu

exec unshare --ipc --net --pid --mount --propagation private --fork --kill-child --mount-proc sh -c '
    ip link set lo up
    mount -t tmpfs -o mode=1777 lane /tmp
    home=$(getent passwd pkmkins-run | cut -d: -f6)
    mount -t tmpfs -o "mode=755,uid=$(id -u pkmkins-run)" lane "$home"
    "$@"
    exit $?' lane "$@"
