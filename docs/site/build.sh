#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Builds a website of the documentation, and checks all its links and anchors.
#
#     docs/site/build.sh PKM PYTHON
#
# PKM writes the manual pages of its subcommands; PYTHON must have Sphinx; the output is build/site. Pages keep their
# paths in the repository, so that links work both on the site and on GitHub. Fails if a page, an anchor or a picture is
# missing, or if neither the README.md of its folder nor docs/site/index.md lists a page.
set -eu
cd "$(dirname "$0")/../.."
pkm=$1 python=$2
pages=build/site-pages out=build/site

rm -rf "$pages" "$out" build/man
mkdir -p "$pages/man"
find . \( -name target -o -name build -o -name node_modules -o -name '.?*' \) -prune -o -name '*.md' -print |
    while read -r page; do cp -p --parents "$page" "$pages"; done
mv "$pages/docs/site/index.md" "$pages/index.md"
# Other link targets: pictures, and the files that pages cite.
cp -rp --parents docs/pictures docs/studies/examples docs/reference/pkmkins.9 docs/reference/names.txt configs/*/*.ini configs/*/*.toml "$pages"

# The links in a folder's README.md determine the order of its pages.
for index in docs/*/README.md; do
    { printf '\n```{toctree}\n:hidden:\n\n'; sed -n 's/^[-0-9.]* \[[^]]*\](\([a-z-]*\)\.md).*/\1/p' "$index"; printf '```\n'; } \
        >> "$pages/$index"
done

# manual_page FILE: converts a manual page to a page of the site, with links to the other manual pages.
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
# redirect OLD NEW: keeps the address that a page had up to 1.0.0, when all pages were in docs.
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
redirect design-papers studies/papers
redirect sources studies/papers
redirect studies/sources papers

"$python" docs/site/links.py "$out"
