#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Makes the files of a release of the last commit, into build/release; `make release` tests first.
#
#     packaging/release.sh
#
# One package serves every Debian that is named in SUITES: its programs are built in the oldest, and it has the
# library for virtual time of each. They are made, installed and used in Debians that debootstrap makes; needs root
# and 20 GB. Built is what this computer's processor runs. Nothing is signed: who publishes signs SHA256SUMS.
set -eu
cd "$(dirname "$0")/.."

# The oldest first.
SUITES="bookworm trixie"
version=$(sed -n 's/^version = "\(.*\)"$/\1/p' Cargo.toml | head -n 1)
out=$PWD/build/release

refuse() { echo "release: $*" >&2; exit 1; }
[ "$(id -u)" = 0 ] || refuse "only root can make a Debian: run this with sudo"
[ -z "$(git status --porcelain)" ] || refuse "there are changes that are not committed: git status"
grep -q "^## \[$version\] - [0-9-]*$" CHANGELOG.md ||
    refuse "CHANGELOG.md has no heading [$version] with a date: cut it, or set the version in Cargo.toml"
awk '/^## \[Unreleased\]/ { found = 1; next } /^## / { exit } found && NF { exit 1 }' CHANGELOG.md ||
    refuse "CHANGELOG.md has entries above [$version]: they are not in this release"
grep -q "\"pkmkins $version\"" docs/pkmkins.9 || refuse "docs/pkmkins.9 names another version than $version"
sed '/^#/d; s/ .*//' docs/names.txt | sort -u | while read -r of; do
    grep -q "^## \[$of\]" CHANGELOG.md || refuse "docs/names.txt has names of $of, which CHANGELOG.md does not have: cargo xtask names"
done
[ -f target/module/release/libpkmkins.so ] || refuse "the module is not built here: make release builds and tests first"
! tag=$(git rev-parse --quiet --verify "v$version^{commit}") || [ "$tag" = "$(git rev-parse HEAD)" ] ||
    refuse "v$version is already another commit: a released version never changes"

rm -rf "$out"
mkdir -p "$out"
libraries=target/libraries
rm -rf "$libraries"
mkdir -p "$libraries"
oldest=${SUITES%% *}
for suite in $SUITES; do
    tests/bare/run.sh "$suite" "make virtual"
    cp "build/bare/$suite/srv/pkmkins/target/virtual/"libpkmkins-virtual-*.so "$libraries"
done
tests/bare/run.sh "$oldest" "make deb VIRTUAL=\"\$(echo $libraries/*.so)\"" "$libraries"
cp "build/bare/$oldest/srv/pkmkins/target/debian/"* "$out"
for suite in $SUITES; do tests/deb/run.sh "$suite" "$out"; done
git archive --format=tar.gz --prefix="pkmkins-$version/" --output="$out/pkmkins-$version.tar.gz" HEAD
(cd "$out" && sha256sum -- * > SHA256SUMS.new && mv SHA256SUMS.new SHA256SUMS && cat SHA256SUMS)
echo "release: $version of $(git rev-parse --short HEAD) is in $out; next: sign SHA256SUMS, tag v$version, cargo xtask repository"
