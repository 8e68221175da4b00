#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Runs a command as a normal user, because LinuxCNC refuses to run as root.
#
#     tests/live/as-user.sh COMMAND [ARGUMENT...]
#
# Users other than root run the command directly. As root, the system user pkmkins-run is created
# once (no password, no login, home folder /var/lib/pkmkins-run) and the command runs as that
# user; `userdel -r pkmkins-run` removes it again.
set -eu

user=pkmkins-run

if [ "$(id -u)" -ne 0 ]; then
    exec "$@"
fi

if ! id "$user" >/dev/null 2>&1; then
    echo "as-user.sh: making the system user $user: LinuxCNC does not run as root" >&2
    useradd --system --create-home --home-dir "/var/lib/$user" --shell /usr/sbin/nologin "$user"
fi

home=$(getent passwd "$user" | cut -d: -f6)
exec setpriv --reuid="$user" --regid="$user" --init-groups \
    env -u SUDO_USER HOME="$home" USER="$user" LOGNAME="$user" PATH=/usr/local/bin:/usr/bin:/bin:/usr/sbin "$@"
