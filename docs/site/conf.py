# SPDX-License-Identifier: GPL-2.0-or-later
"""How Sphinx makes a site of the documentation; docs/site/build.sh calls it."""

project = "pkmkins"
html_title = "pkmkins"
root_doc = "index"
extensions = ["myst_parser"]
# As forges number the headings of Markdown: links to them hold in both places.
myst_heading_anchors = 4
html_theme = "furo"
html_theme_options = {"navigation_with_keys": False}
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
# The same site from the same sources.
html_last_updated_fmt = None
highlight_language = "none"
# Files of programs that a page links to are offered whole, beside the page.
suppress_warnings = ["myst.xref_ambiguous"]
