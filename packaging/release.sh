#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Tests the last commit, which must have the tag of its version, and writes the release files to build/release: `make
# release`.
#
#     packaging/release.sh
#
# There is a package for each LinuxCNC of versions.toml; one serves every Debian with the same LinuxCNC, as its programs
# are built in the oldest of SUITES. They are made, installed and used in Debians that debootstrap makes; needs root
# and 30 GB. Built are the packages for this computer's processor and for arm64. Nothing is signed: who publishes signs
# SHA256SUMS.
set -eu
cd "$(dirname "$0")/.."

# Debian releases, oldest first.
SUITES=$(sed -n 's/^debian = \[\(.*\)\]$/\1/p;T;q' workbench/linuxcnc/versions.toml | tr -d '",')
version=$(sed -n 's/^version = "\(.*\)"$/\1/p' Cargo.toml | head -n 1)
out=$PWD/build/release

# missing TEXT: reports something that the release lacks; all such reports come before anything runs.
missing() { lacks=yes; echo "release: $*" >&2; }
tag=v$version
tagged() { git for-each-ref --format="%($1)" "refs/tags/$tag"; }
[ "$(id -u)" = 0 ] || missing "only root can make a Debian: run this with sudo"
[ -z "$(git status --porcelain)" ] || missing "there are changes that are not committed: git status"
case $(tagged objecttype) in
tag) [ "$(git rev-parse "$tag^{commit}")" = "$(git rev-parse HEAD)" ] ||
    missing "$tag is not the last commit, and a published version never changes: set the next one in Cargo.toml" ;;
commit) missing "the tag $tag is not annotated: git tag --delete $tag && git tag --annotate $tag" ;;
*) missing "the last commit has no tag $tag: git tag --annotate $tag, or set the version in Cargo.toml" ;;
esac
. packaging/publisher.sh
case "$maintainer $address" in
*.invalid*) missing "packaging/publisher.sh has a placeholder: set maintainer and address, then cargo xtask publisher" ;;
*) grep -qF "[published packages]($address)" README.md || missing "README.md has another address than packaging/publisher.sh: cargo xtask publisher" ;;
esac
date=$(tagged taggerdate:short)
grep -qFx "## [$version] - ${date:=$(date +%F)}" CHANGELOG.md ||
    missing "CHANGELOG.md has no section \"## [$version] - $date\", with the date of the tag, or today's for one to come"
awk '/^## \[Unreleased\]/ { found = 1; next } /^## / { exit } found && NF { exit 1 }' CHANGELOG.md ||
    missing "CHANGELOG.md has entries above [$version]: they are not in this release"
grep -q "\"pkmkins $version\"" docs/reference/pkmkins.9 || missing "docs/reference/pkmkins.9 names another version than $version"
while read -r of; do
    grep -q "^## \[$of\]" CHANGELOG.md || missing "docs/reference/names.txt has names of $of, which CHANGELOG.md does not have: cargo xtask names"
done <<END
$(sed '/^#/d; s/ .*//' docs/reference/names.txt | sort -u)
END
[ -z "${lacks:-}" ] || exit 1

make --no-print-directory test
rm -rf "$out"
mkdir -p "$out"
# The oldest Debian's C library decides where the packages run.
oldest=${SUITES%% *}
tests/bare/run.sh "$oldest" "$(sed -n 's/^version = "\(.*\)"$/make deb LINUXCNC=\1 \&\& make deb ARCH=arm64 LINUXCNC=\1 || exit 1/p' \
    workbench/linuxcnc/versions.toml)"
cp "build/bare/$oldest/srv/pkmkins/target/debian/"* "$out"
for suite in $SUITES; do tests/deb/run.sh "$suite" "$out"; done
git archive --format=tar.gz --prefix="pkmkins-$version/" --output="$out/pkmkins-$version.tar.gz" HEAD
(cd "$out" && sha256sum -- * > SHA256SUMS.new && mv SHA256SUMS.new SHA256SUMS && cat SHA256SUMS)
echo "release: $version of $(git rev-parse --short HEAD) is in $out; next: sign SHA256SUMS, push $tag, cargo xtask repository"
