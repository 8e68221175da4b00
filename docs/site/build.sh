#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Makes a site of the documentation, and checks every link and anchor of it.
#
#     docs/site/build.sh PKM PYTHON
#
# PKM writes the manual pages of its subcommands, PYTHON has Sphinx; the site comes into build/site. Sphinx gets
# the pages as they lie in the repository, so that a link holds here and in a forge; it fails where a page, an
# anchor or a picture is missing, and where a page stands neither in its folder's README.md nor in docs/site/index.md.
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
cp -rp --parents docs/pictures docs/studies/examples docs/reference/pkmkins.9 docs/reference/names.txt configs/*/*.ini configs/*/*.toml "$pages"

# The index of a folder is the order of its pages.
for index in docs/*/README.md; do
    { printf '\n```{toctree}\n:hidden:\n\n'; sed -n 's/^[-0-9.]* \[[^]]*\](\([a-z-]*\)\.md).*/\1/p' "$index"; printf '```\n'; } \
        >> "$pages/$index"
done

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
for page in docs/reference/pkmkins.9 build/man/*.1; do manual_page "$page"; done

"$python" -m sphinx --quiet --fail-on-warning --keep-going --fresh-env --jobs auto \
    --conf-dir docs/site --doctree-dir build/site-doctrees --builder html "$pages" "$out"
# redirect OLD NEW: the address that a page had up to 1.0.0, when all lay in docs.
redirect() {
    printf '<!doctype html><meta http-equiv="refresh" content="0; url=%s.html"><a href="%s.html">%s</a>\n' \
        "$2" "$2" "$2" > "$out/docs/$1.html"
}
for page in docs/guide/[!R]*.md docs/reference/[!R]*.md docs/studies/[!R]*.md docs/develop/[!R]*.md; do
    new=${page#docs/}
    new=${new%.md}
    redirect "${new#*/}" "$new"
done
redirect scene reference/view
redirect live reference/view
redirect upgrading guide/install
redirect design-study studies/design
redirect design-papers studies/sources

"$python" docs/site/links.py "$out"
