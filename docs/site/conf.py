# SPDX-License-Identifier: GPL-2.0-or-later
"""Settings with which Sphinx builds the website of the documentation; used by docs/site/build.sh."""

project = "pkmkins"
html_title = "pkmkins"
root_doc = "index"
extensions = ["myst_parser"]
# Anchors for headings as on GitHub, so that links to them work in both places.
myst_heading_anchors = 4
html_theme = "furo"
html_theme_options = {"navigation_with_keys": False}
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
# No date, so that equal sources give an equal site.
html_last_updated_fmt = None
highlight_language = "none"
# Linked files, such as programs, are copied for download beside the page.
suppress_warnings = ["myst.xref_ambiguous"]
