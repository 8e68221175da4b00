# SPDX-License-Identifier: GPL-2.0-or-later
"""Checks every internal link of a built site: that the file and the anchor exist.

    links.py SITE

Sphinx checks only its own links. The manual pages are inserted as HTML, so their links can be checked only in the
finished site.
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """The anchors and link targets of a page."""

    def __init__(self, text):
        super().__init__()
        self.anchors = {"", "top"}
        self.links = set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        self.anchors.update(attrs[name] for name in ("id", "name") if attrs.get(name))
        self.links.update(attrs[name] for name in ("href", "src") if attrs.get(name))


def broken(page, links, pages):
    """Yields the broken links of a page."""
    for link in sorted(links):
        parts = urlsplit(link)
        if parts.scheme or parts.netloc:
            continue
        target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
        if not target.exists():
            yield f"{link}: no such file"
        elif target in pages and unquote(parts.fragment) not in pages[target].anchors:
            yield f"{link}: no such anchor"


def main(site):
    files = sorted(Path(site).resolve().rglob("*.html"))
    pages = {file: Page(file.read_text(encoding="utf-8")) for file in files}
    count, failures = 0, 0
    for file, page in pages.items():
        count += len(page.links)
        for failure in broken(file, page.links, pages):
            failures += 1
            print(f"{file.relative_to(Path(site).resolve())}: {failure}", file=sys.stderr)
    print(f"site: {len(pages)} pages, {count} links, {failures} of them broken")
    return 1 if failures or not pages else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
