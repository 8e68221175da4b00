# SPDX-License-Identifier: GPL-2.0-or-later
"""Runs the notebooks to their end."""

import pytest
from conftest import ROOT

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("matplotlib")

NOTEBOOKS = sorted((ROOT / "python" / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_notebook_runs_to_its_end(file):
    book = nbformat.read(file, as_version=4)
    # The folder of the configurations, which a user's notebook would name.
    book.cells.insert(0, nbformat.v4.new_code_cell(f"CONFIGS = {str(ROOT / 'configs')!r}"))
    nbclient.NotebookClient(book, timeout=300, kernel_name="python3").execute()
