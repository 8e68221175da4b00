#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Runs a command that may be silent for minutes, and reports on standard error every eight seconds what is running and for how long.
#
#     tools/progress.sh WHAT COMMAND...
set -eu
what=$1
shift
start=$(date +%s)
# sleep outlives the loop, and must not keep a pipe behind standard output open.
(while sleep 8 >/dev/null 2>&1; do echo "pkmkins: $what: $(($(date +%s) - start)) s" >&2; done) &
trap 'kill $!' EXIT
"$@"
