#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Makes the packages pkmkins and pkm of what is built, into target/debian, with the tools of debhelper; `make deb` builds
# and calls this. For arm64 it also compiles.
#
#     [LINUXCNC=2.10] packaging/build.sh ARCHITECTURE     of this computer, or arm64
#
# LINUXCNC is the version that the module was built for, if it is not the installed one. Packages for another LinuxCNC
# stay in target/debian.
# They contain the files of `make install` and `make install-pkm`, in the same places, and the site of the documentation.
# Two builds of one commit give the same files.
set -eu
cd "$(dirname "$0")/.."
. packaging/publisher.sh
arch=$1
stage=$PWD/target/packages
version=$(sed -n 's/^version = "\(.*\)"$/\1/p' Cargo.toml)
series=${LINUXCNC:-$(linuxcnc_var LINUXCNCVERSION | cut -d . -f 1,2)}
# The version shows the LinuxCNC that the module was built for.
full=$version-1+linuxcnc$series
# Debian 12 has 2.9 without an epoch; later versions and those of linuxcnc.org have the epoch 1.
from=1:$series~
[ "$series" != 2.9 ] || from=2.9.0~
before=1:${series%.*}.$((${series#*.} + 1))~
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
export SOURCE_DATE_EPOCH
# The tools of debhelper read the architecture, and the names of its compilers, from the environment.
eval "$(dpkg-architecture --host-arch "$arch" --print-set)"

case $arch in
"$(dpkg --print-architecture)")
    built=target/deb module=target/module/release/libpkmkins.so virtual=target/virtual
    ;;
arm64)
    built=target/arm64/aarch64-unknown-linux-gnu/deb module=target/arm64/aarch64-unknown-linux-gnu/release/libpkmkins.so
    virtual=target/virtual/arm64
    # Its compiler must not serve what follows.
    (
        . tools/arm64.sh
        module_for_arm
        for_arm build --profile deb --bin pkm --bin pkmkins-pins
    )
    ;;
*)
    echo "deb: ARCH=$arch: expected $(dpkg --print-architecture) or arm64" >&2
    exit 2
    ;;
esac

# copyright CRATE [FILE...]: prints the licenses of the program, of CRATE's libraries and of FILEs.
copyright() {
    cat packaging/copyright
    target/tools/bin/cargo-about generate --locked --offline --config packaging/licences.toml --manifest-path "$1/Cargo.toml" \
        --output-file "$stage/licences" packaging/licences.hbs
    awk -f packaging/licences.awk "$stage/licences"
    shift
    [ $# = 0 ] || cat "$@"
}

# changelog VERSION: prints the one that Debian expects.
changelog() {
    cat <<END
pkmkins ($1) unstable; urgency=medium

  * What changed is in changelog.gz.

 -- $maintainer  $(git log -1 --format=%aD)
END
}

rm -rf "$stage"
mkdir -p "$stage/debian" target/debian
rm -f target/debian/pkm[_-]*_"$arch".deb target/debian/pkmkins[_-]*+linuxcnc"$series"_"$arch".deb
# cargo-about reads the licenses in the crates of the lock file, and needs all of them.
cargo fetch --locked
lay_out() { make --no-print-directory -s -o setup -o module -o virtual -o generated -o pkm-built "$@"; }
lay_out install SO="$module" PINS="$built/pkmkins-pins" DESTDIR="$stage/debian/pkmkins" \
    VIRTUAL="$virtual/libpkmkins-virtual.so"
lay_out install-pkm PKM=target/deb/pkm BUILT="$built/pkm" DESTDIR="$stage/debian/pkm" PREFIX=/usr
docs/site/build.sh target/deb/pkm target/tools/python/bin/python
documents=$stage/debian/pkm/usr/share/doc/pkm
cp -r build/site "$documents/html"
# The site has the pictures: the text refers to them.
for picture in "$documents"/html/_images/*; do
    [ ! -e "$documents/docs/pictures/${picture##*/}" ] || ln -sf "../../html/_images/${picture##*/}" "$documents/docs/pictures"
done

sed "s|@maintainer@|$maintainer|; s|@address@|$address|" packaging/control > "$stage/debian/control"
changelog "$version-1" > "$stage/debian/changelog"
changelog "$full" > "$stage/debian/pkmkins.changelog"
# The package has the libraries of the module as well.
copyright kinsmodule/pins > "$stage/debian/pkmkins.copyright"
copyright command page/built/LICENSES.txt > "$stage/debian/pkm.copyright"
for package in pkmkins pkm; do
    for script in packaging/"$package"/*; do cp "$script" "$stage/debian/$package.${script##*/}"; done
    [ ! -e "packaging/lintian/$package" ] || cp "packaging/lintian/$package" "$stage/debian/$package.lintian-overrides"
done
changes=$PWD/CHANGELOG.md out=$PWD/target/debian
(
    cd "$stage"
    dh_installdocs
    dh_installchangelogs "$changes"
    dh_lintian
    # `pkm help` and browsers read the pages as they are.
    dh_compress -Xdoc/pkm/docs -Xdoc/pkm/html
    dh_fixperms
    dh_strip
    dh_installdeb
    # The second folder has the libraries of cross compilers, whose packages are named with the architecture.
    dh_shlibdeps -ppkm "-l/usr/$DEB_HOST_GNU_TYPE/lib"
    sed -i "s/:$arch//g" debian/pkm.substvars
    dh_gencontrol -ppkm
    dh_gencontrol -ppkmkins -- -v"$full" -V"linuxcnc:Depends=linuxcnc-uspace (>= $from), linuxcnc-uspace (<< $before)"
    dh_md5sums
    dh_builddeb --destdir="$out"
)
set -- target/debian/pkm_*_"$arch".deb target/debian/pkmkins_*+linuxcnc"$series"_"$arch".deb
for file; do
    echo "pkmkins: $file, $(($(stat -c %s "$file") / 1024)) KiB, $(dpkg-deb --field "$file" Installed-Size) KiB installed"
done
lintian --allow-root --fail-on error,warning "$@"
