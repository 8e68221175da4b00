#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Packs the built files as the Debian packages pkmkins and pkm, in target/debian; `make deb` builds and calls this.
#
#     packaging/build.sh TOOLS [LIBRARY...]     folder of cargo-deb and cargo-about; libraries for virtual time
#
# The packages contain the files of `make install` and `make install-pkm`, in the same places, and those that Debian
# requires. Two builds of one commit give the same files.
set -eu
cd "$(dirname "$0")/.."
tools=$(realpath "$1")
shift
stage=$PWD/target/packages
version=$(sed -n 's/^version = "\(.*\)"$/\1/p' Cargo.toml)
series=$(linuxcnc_var LINUXCNCVERSION | cut -d . -f 1,2)
# The package version names the LinuxCNC series that the module was built for.
revision=1+linuxcnc$series
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
export SOURCE_DATE_EPOCH

# documents PACKAGE CRATE REVISION [FILE...]: writes changelogs, and the licenses of CRATE's libraries and of FILEs.
documents() {
    folder=$stage/$1/usr/share/doc/$1
    package=$1 crate=$2 revision_of=$3
    mkdir -p "$folder"
    shift 3
    {
        cat packaging/copyright
        "$tools/cargo-about" generate --locked --offline --config packaging/licences.toml --manifest-path "$crate/Cargo.toml" \
            --output-file "$stage/licences" packaging/licences.hbs
        awk -f packaging/licences.awk "$stage/licences"
        [ $# = 0 ] || cat "$@"
    } > "$folder/copyright"
    gzip --no-name --best < CHANGELOG.md > "$folder/changelog.gz"
    gzip --no-name --best > "$folder/changelog.Debian.gz" <<END
$package ($version-$revision_of) unstable; urgency=medium

  * What changed is in changelog.gz.

 -- $maintainer  $(git log -1 --format=%aD)
END
    [ ! -e "packaging/lintian/$package" ] ||
        install -D -m 644 "packaging/lintian/$package" "$stage/$package/usr/share/lintian/overrides/$package"
}

# laid_out FOLDER PROGRAM: lists files with their modes, and checksums of all but PROGRAM, whose symbols are stripped.
laid_out() {
    (cd "$stage/$1" && find . -type f -printf '%m %P\n' | sort &&
        find . -type f ! -path "./$2" -exec md5sum {} + | sort -k 2)
}

# packed PACKAGE PROGRAM REVISION OPTION...: builds the package and a separate one with the debug symbols of PROGRAM,
# and checks that it contains every file laid out.
packed() {
    package=$1 program=$2 full=$version-$3
    shift 3
    laid_out "$package" "$program" > "$stage/$package.files"
    # cargo-deb takes the program from cargo's folder, and the copyright file by its name; otherwise it would write its
    # own.
    rm "$stage/$package/$program"
    mv "$stage/$package/usr/share/doc/$package/copyright" "$stage/$package.copyright"
    "$tools/cargo-deb" --quiet --no-build --dbgsym --locked -p "$package" --deb-version "$full" --output target/debian "$@"
    name=${full}_$(dpkg --print-architecture)
    file=target/debian/${package}_$name.deb
    # Debian names packages of debug symbols .deb, too.
    mv "target/debian/$package-dbgsym_$name.ddeb" "target/debian/$package-dbgsym_$name.deb"
    rm -rf "$stage/unpacked"
    dpkg-deb --extract "$file" "$stage/unpacked"
    find "$stage/unpacked" -path '*/man/*' -name '*.gz' -exec gunzip {} +
    if ! laid_out unpacked "$program" | diff "$stage/$package.files" -; then
        echo "pkmkins: $file does not have what \`make install\` lays out" >&2
        exit 1
    fi
    echo "pkmkins: $file, $(($(stat -c %s "$file") / 1024)) KiB, $(dpkg-deb --field "$file" Installed-Size) KiB installed"
}

maintainer=$(sed -n 's/^maintainer = "\(.*\)"$/\1/p' command/Cargo.toml)
rm -rf "$stage" target/debian
mkdir -p "$stage" target/debian
# cargo-about reads the licenses from the crates in the lock file, so all of them must be downloaded.
cargo fetch --locked --quiet
lay_out() { make --no-print-directory -s -o setup -o module -o virtual -o generated -o pkm-built "$@"; }

tools/generate.sh target/deb/pkm
lay_out install PINS=target/deb/pkmkins-pins DESTDIR="$stage/pkmkins" ${1:+VIRTUAL="$*"}
# cargo-deb strips only the module.
strip "$stage/pkmkins/usr/bin/pkmkins-pins"
# pkmkins-pins uses every library that the module uses.
documents pkmkins kinsmodule/pins "$revision"
set --
[ "$series" = "$(sed -n 's/^version = "\(.*\)"$/\1/p;T;q' workbench/linuxcnc/versions.toml)" ] || set -- --variant "$series"
CARGO_TARGET_DIR=target/module packed pkmkins usr/lib/linuxcnc/modules/pkmkins.so "$revision" "$@"

lay_out install-pkm PKM=target/deb/pkm DESTDIR="$stage/pkm" PREFIX=/usr
documents pkm command 1 page/built/LICENSES.txt
packed pkm usr/bin/pkm 1 --profile deb

# lintian skips the packages of debug symbols: cargo-deb gives them no documents.
command -v lintian >/dev/null || { echo "pkmkins: lintian is not installed: the packages are not looked at by it"; exit 0; }
lintian --allow-root --fail-on error,warning target/debian/pkm_*.deb target/debian/pkmkins_*.deb
