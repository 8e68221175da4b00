#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Runs the README's commands on the last commit, in a Debian that has make and git and nothing else.
#
#     tests/bare/run.sh [SUITE [COMMAND]]     bookworm, 'time make demo && time make test'
#
# debootstrap makes it in build/bare/SUITE, anew each time, from the archive that this computer's
# apt uses; certificates and settings of the network are this computer's. Needs root, debootstrap and
# 15 GB. What runs inside has memory, processes and mounts of its own, and ends with the command.
set -eu
cd "$(dirname "$0")/../.."

[ "$(id -u)" = 0 ] || { echo "bare: only root can make a Debian: run this with sudo" >&2; exit 2; }
command -v debootstrap >/dev/null || { echo "bare: debootstrap is missing: install it" >&2; exit 2; }
if [ -z "${PKMKINS_BARE:-}" ]; then
    exec env PKMKINS_BARE=1 unshare --ipc --pid --mount --propagation private --fork --kill-child \
        --mount-proc sh tests/bare/run.sh "$@"
fi

suite=${1:-bookworm}
command=${2:-time make demo && time make test}
root=$PWD/build/bare/$suite

# archive PATTERN: where apt has the first release from whose name matches.
archive() {
    apt-get indextargets --format '$(RELEASE) $(REPO_URI)' 'Created-By: Packages' |
        awk -v release="$1" '$1 ~ release { print $2; exit }'
}
main=$(archive '^[a-z]+$')

rm -rf "$root"
mkdir -p "$root"
debootstrap --variant=minbase --include=make,git "$suite" "$root" "$main"
cat > "$root/etc/apt/sources.list" <<END
deb $main $suite main
deb $main $suite-updates main
deb $(archive '-security$') $suite-security main
END
apt-config dump | grep -E '^Acquire::(https?|Check)' > "$root/etc/apt/apt.conf.d/99this-computer" || true
mkdir -p "$root/usr/local/share/ca-certificates"
find /usr/local/share/ca-certificates -name '*.crt' -exec cp {} "$root/usr/local/share/ca-certificates" \;
git clone --quiet --no-hardlinks . "$root/srv/pkmkins"

# A mount itself, or nothing inside could have mounts of its own.
mount --bind "$root" "$root"
mount -t proc proc "$root/proc"
mount --rbind /sys "$root/sys"
mount --rbind /dev "$root/dev"
mount -t tmpfs -o mode=1777 shm "$root/dev/shm"
env -i HOME=/root TERM=dumb PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
    chroot "$root" bash -c "cd /srv/pkmkins && { $command; }"
