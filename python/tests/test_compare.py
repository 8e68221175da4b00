# SPDX-License-Identifier: GPL-2.0-or-later
"""Machines side by side."""

import json

import numpy as np
import pytest
from conftest import ini
from pkmkins import CommandFailed, Machine, compare
from pkmkins.command import asked
from pkmkins.compare import main, page, table
from pkmkins.design.candidate import required_poses
from pkmkins.design.study import Required

STUDY = "[legs]\nstiffness_n_per_um = 10\njoint_sigma_um = 5\n"


def test_machines_stand_side_by_side_in_one_table_and_page(tmp_path, capsys):
    study, page = tmp_path / "study.toml", tmp_path / "layouts.html"
    study.write_text(STUDY)
    words = [str(ini("lab-hexapod")), str(ini("linapod")), "--box", "20", "20", "20", "--study", str(study)]
    assert main([*words, "--page", str(page), "--format", "json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    rows = {row["name"]: row["values"] for row in printed["rows"]}
    assert rows["poses within every limit"] == ["27 of 27"] * 2
    assert all(value > 0 for value in rows["least stiffness at the tool"])
    assert "<h1>Machines compared</h1>" in page.read_text()
    assert main(words) == 0
    assert "linapod" in capsys.readouterr().out.splitlines()[0]


def test_lengths_are_millimetres_whatever_the_unit_of_a_machine(capsys):
    assert main([str(ini("tripod")), str(ini("tripod")), "--format", "json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert all(row["values"][0] == row["values"][1] for row in rows)
    size = next(row["values"][0] for row in rows if row["name"] == "size")
    # Its longest length is 10 inches.
    assert size == pytest.approx(254)


def test_what_cannot_be_said_is_not_judged(capsys):
    assert main([str(ini("lab-hexapod")), str(ini("linear-delta")), "--box", "900", "0", "0"]) == 1
    assert "not judged" in capsys.readouterr().out


@pytest.mark.parametrize("words", [["none.ini"], [str(ini("tripod")), "--study", "none.toml"]])
def test_missing_files_are_named(words, capsys):
    assert main(words) == 2
    assert "none." in capsys.readouterr().err


@pytest.mark.parametrize(("name", "why"), [("lathe-mirrored", "two mechanisms"), ("hexapod-rotary-table", "carry work, tool or legs")])
def test_machines_that_the_package_does_not_cover_are_refused_with_the_command_that_does(name, why, capsys):
    assert main([str(ini("hexapod")), str(ini(name))]) == 2
    said = capsys.readouterr().err
    assert f"{name}.ini" in said and why in said and "use the command pkm" in said
