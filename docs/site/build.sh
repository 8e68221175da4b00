#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Makes a site of the documentation, and checks every link and anchor of it.
#
#     docs/site/build.sh PKM PYTHON
#
# PKM writes the manual pages of its subcommands, PYTHON has Sphinx; the site comes into build/site. Sphinx gets
# the pages as they lie in the repository, so that a link holds here and in a forge; it fails where a page, an
# anchor or a picture is missing, and where a page stands in no list of docs/site/index.md.
set -eu
cd "$(dirname "$0")/../.."
pkm=$1 python=$2
pages=build/site-pages out=build/site

rm -rf "$pages" "$out" build/man
mkdir -p "$pages/man"
find . \( -name target -o -name build -o -name node_modules -o -name '.?*' \) -prune -o -name '*.md' -print |
    while read -r page; do cp -p --parents "$page" "$pages"; done
mv "$pages/docs/site/index.md" "$pages/index.md"
# Links of the pages that lead to no page lead to files: pictures, and what the text quotes.
cp -rp --parents docs/pictures docs/examples docs/pkmkins.9 docs/names.txt configs/*/*.ini configs/*/*.toml "$pages"

# manual_page FILE: one as a page of the site, which links to the others.
manual_page() {
    name=$(basename "$1")
    mandoc -T html -O fragment,man=%N.%S.html "$1" > "$pages/man/$name.fragment"
    title="${name%.*}(${name##*.})"
    printf '%s\n%s\n\n.. raw:: html\n   :file: %s.fragment\n' \
        "$title" "$(printf '%s' "$title" | tr -c = =)" "$name" > "$pages/man/$name.rst"
    printf '   %s\n' "$name" >> "$pages/man/index.rst"
}
printf 'Manual pages\n============\n\n.. toctree::\n\n' > "$pages/man/index.rst"
"$pkm" man build/man
for page in docs/pkmkins.9 build/man/*.1; do manual_page "$page"; done

"$python" -m sphinx --quiet --fail-on-warning --keep-going --fresh-env --jobs auto \
    --conf-dir docs/site --doctree-dir build/site-doctrees --builder html "$pages" "$out"
"$python" docs/site/links.py "$out"
