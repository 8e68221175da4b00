# SPDX-License-Identifier: GPL-2.0-or-later
# shellcheck shell=sh
# Functions for scripts that need a minimal Debian; sourced.

# alone NAME SCRIPT ARGUMENT...: restarts the script in separate namespaces, whose processes and mounts end with it.
alone() {
    [ "$(id -u)" = 0 ] || { echo "$1: only root can make a Debian: run this with sudo" >&2; exit 2; }
    command -v debootstrap >/dev/null || { echo "$1: debootstrap is missing: install it" >&2; exit 2; }
    [ -n "${PKMKINS_ALONE:-}" ] && return
    shift
    exec env PKMKINS_ALONE=1 unshare --ipc --pid --mount --propagation private --fork --kill-child \
        --mount-proc sh "$@"
}

# archive PATTERN: prints the address from which apt gets the first release whose name matches.
archive() {
    apt-get indextargets --format '$(RELEASE) $(REPO_URI)' 'Created-By: Packages' |
        awk -v release="$1" '$1 ~ release { print $2; exit }'
}

# emulated: lets the kernel start programs for 64-bit ARM under qemu, until the script ends.
emulated() {
    format=/usr/lib/binfmt.d/qemu-aarch64.conf kernel=/proc/sys/fs/binfmt_misc
    [ -e "$format" ] || { echo "arm64: qemu is missing: install qemu-user-static" >&2; exit 2; }
    [ -e $kernel/register ] || mount -t binfmt_misc binfmt_misc $kernel
    [ ! -e $kernel/qemu-aarch64 ] || return 0
    trap 'echo -1 > /proc/sys/fs/binfmt_misc/qemu-aarch64' EXIT
    cat "$format" > $kernel/register
}

# debian SUITE FOLDER [PACKAGE,...]: makes it anew, from the archive that this computer's apt uses, with this
# computer's certificates and settings of the network; for another processor where `arch` names one.
debian() {
    suite=$1 root=$2
    main=$(archive '^[a-z]+$')
    rm -rf "$root"
    mkdir -p "$root"
    debootstrap ${arch:+--arch="$arch"} --variant=minbase ${3:+--include="$3"} "$suite" "$root" "$main"
    cat > "$root/etc/apt/sources.list" <<END
deb $main $suite main
deb $main $suite-updates main
deb $(archive '-security$') $suite-security main
END
    apt-config dump | grep -E '^Acquire::(https?|Check)' > "$root/etc/apt/apt.conf.d/99this-computer" || true
    # Skip fsync: the system need not survive a power failure.
    echo force-unsafe-io > "$root/etc/dpkg/dpkg.cfg.d/99quick"
    mkdir -p "$root/usr/local/share/ca-certificates"
    find /usr/local/share/ca-certificates -name '*.crt' -exec cp {} "$root/usr/local/share/ca-certificates" \;
    # The root must be a mount point: otherwise nothing inside could mount.
    mount --bind "$root" "$root"
    mount -t proc proc "$root/proc"
    mount --rbind /sys "$root/sys"
    mount --rbind /dev "$root/dev"
    mount -t tmpfs -o mode=1777 shm "$root/dev/shm"
}

# inside FOLDER COMMAND...: runs a command in that system.
inside() {
    root=$1
    shift
    env -i HOME=/root TERM=dumb PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
        chroot "$root" "$@"
}
