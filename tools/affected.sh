#!/bin/bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Tests the crates with files changed since a commit, and the crates that depend on them. Only `make test` runs tests
# outside crates, such as the live ones.
#
#     tools/affected.sh [COMMIT]     the commit at which this branch left its upstream
set -euo pipefail
shopt -s inherit_errexit
cd "$(dirname "$0")/.."
since=$(git merge-base HEAD "${1:-@{upstream\}}")
files=$(git diff --name-only "$since"; git ls-files --others --exclude-standard)

changed=$(for file in $files; do
    crate=$(dirname "$file")
    while [ "$crate" != . ] && [ ! -f "$crate/Cargo.toml" ]; do crate=$(dirname "$crate"); done
    if [ "$crate" = . ]; then
        echo "affected: $file belongs to no crate: make test has what reads it" >&2
    else
        sed -n '0,/^name = /s/^name = "\(.*\)"$/\1/p' "$crate/Cargo.toml"
    fi
done | sort -u)
affected=$(for crate in $changed; do
    cargo tree --locked --workspace --invert "$crate" --prefix none --format '{p}' | sed -n 's/ v[^ ]* (\/.*//p'
done)
# Two crates test the module's built file; cargo does not know that they depend on it.
! grep -qx pkmkins <<< "$affected" || affected+=$'\nabi-tests\nprove'
mapfile -t crates < <(sort -u <<< "$affected" | grep -vxE 'pkmkins|xtask|')
echo "affected: since $(git log -1 --format='%h, %s' "$since"): ${crates[*]}"
[ ${#crates[@]} = 0 ] || cargo test --profile host --locked --no-fail-fast "${crates[@]/#/--package=}"
