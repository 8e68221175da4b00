# SPDX-License-Identifier: GPL-2.0-or-later
# shellcheck shell=sh
# For the scripts that need a Debian with nothing in it; sourced.

# alone NAME SCRIPT ARGUMENT...: goes on in namespaces of its own, whose processes and mounts end with the script.
alone() {
    [ "$(id -u)" = 0 ] || { echo "$1: only root can make a Debian: run this with sudo" >&2; exit 2; }
    command -v debootstrap >/dev/null || { echo "$1: debootstrap is missing: install it" >&2; exit 2; }
    [ -n "${PKMKINS_ALONE:-}" ] && return
    shift
    exec env PKMKINS_ALONE=1 unshare --ipc --pid --mount --propagation private --fork --kill-child \
        --mount-proc sh "$@"
}

# archive PATTERN: where apt has the first release from whose name matches.
archive() {
    apt-get indextargets --format '$(RELEASE) $(REPO_URI)' 'Created-By: Packages' |
        awk -v release="$1" '$1 ~ release { print $2; exit }'
}

# debian SUITE FOLDER [PACKAGE,...]: makes it anew, from the archive that this computer's apt uses, with this
# computer's certificates and settings of the network.
debian() {
    suite=$1 root=$2
    main=$(archive '^[a-z]+$')
    rm -rf "$root"
    mkdir -p "$root"
    debootstrap --variant=minbase ${3:+--include="$3"} "$suite" "$root" "$main"
    cat > "$root/etc/apt/sources.list" <<END
deb $main $suite main
deb $main $suite-updates main
deb $(archive '-security$') $suite-security main
END
    apt-config dump | grep -E '^Acquire::(https?|Check)' > "$root/etc/apt/apt.conf.d/99this-computer" || true
    # It need not outlive a power cut.
    echo force-unsafe-io > "$root/etc/dpkg/dpkg.cfg.d/99quick"
    mkdir -p "$root/usr/local/share/ca-certificates"
    find /usr/local/share/ca-certificates -name '*.crt' -exec cp {} "$root/usr/local/share/ca-certificates" \;
    # A mount itself, or nothing inside could have mounts of its own.
    mount --bind "$root" "$root"
    mount -t proc proc "$root/proc"
    mount --rbind /sys "$root/sys"
    mount --rbind /dev "$root/dev"
    mount -t tmpfs -o mode=1777 shm "$root/dev/shm"
}

# inside FOLDER COMMAND...: runs it there.
inside() {
    root=$1
    shift
    env -i HOME=/root TERM=dumb PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
        chroot "$root" "$@"
}
