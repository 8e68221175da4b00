# SPDX-License-Identifier: GPL-2.0-or-later
"""Machines side by side."""

import json

import numpy as np
import pytest
from conftest import ini
from pkmkins import CommandFailed, Machine, compare
from pkmkins.command import asked
from pkmkins.compare import main, page, table
from pkmkins.design.candidate import required_poses, size
from pkmkins.design.study import Required

STUDY = "[legs]\nstiffness_n_per_um = 10\njoint_sigma_um = 5\n"


def test_machines_stand_side_by_side_in_one_table_and_page(tmp_path, capsys):
    study, page = tmp_path / "study.toml", tmp_path / "layouts.html"
    study.write_text(STUDY)
    words = [str(ini("lab-hexapod")), str(ini("linapod")), "--box", "20", "20", "20", "--study", str(study)]
    assert main([*words, "--page", str(page), "--format", "json"]) == 0
    answered = json.loads(capsys.readouterr().out)
    rows = {row["name"]: row["values"] for row in answered["rows"]}
    assert rows["poses within every limit"] == ["27 of 27"] * 2
    assert all(value > 0 for value in rows["least stiffness at the tool"])
    assert "<h1>Machines compared</h1>" in page.read_text()
    assert main(words) == 0
    assert "linapod" in capsys.readouterr().out.splitlines()[0]


def test_lengths_are_millimeters_for_machines_of_any_unit(capsys):
    assert main([str(ini("tripod")), str(ini("tripod")), "--format", "json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    # Without --box and --tilt the only pose is home.
    assert rows[0] == {"name": "poses within every limit", "unit": "", "values": ["1 of 1"] * 2}
    assert main([str(ini("tripod")), str(ini("tripod")), "--box", "0", "0", "0", "--tilt", "0", "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"] == rows
    assert all(row["values"][0] == row["values"][1] for row in rows)
    sides = next(row["values"][0] for row in rows if row["name"] == "size X Y Z")
    machine = Machine.from_ini(ini("tripod"))
    assert sides == " x ".join(f"{side:.0f}" for side in size(machine, machine.home[None]) * 25.4)


def test_what_cannot_be_said_is_not_judged(capsys):
    assert main([str(ini("lab-hexapod")), str(ini("linear-delta")), "--box", "900", "0", "0"]) == 1
    assert "not judged" in capsys.readouterr().out


@pytest.mark.parametrize("words", [["none.ini"], [str(ini("tripod")), "--study", "none.toml"]])
def test_missing_files_are_named(words, capsys):
    assert main(words) == 2
    assert "none." in capsys.readouterr().err


@pytest.mark.parametrize(("name", "why"), [("lathe-mirrored", "two mechanisms")])
def test_machines_that_the_package_does_not_cover_are_refused_with_the_command_that_does(name, why, capsys):
    assert main([str(ini("hexapod")), str(ini(name))]) == 2
    said = capsys.readouterr().err
    assert f"{name}.ini" in said and why in said and "use the command pkm" in said


def answered(capsys, *words):
    status = main([*map(str, words), "--format", "json"])
    answer = json.loads(capsys.readouterr().out)
    assert (answer["version"], answer["command"]) == (1, "compare")
    return status, answer["machines"], {row["name"]: (row["unit"], row["values"]) for row in answer["rows"]}


def test_rows_are_what_the_machines_answer(tmp_path, capsys):
    study = tmp_path / "study.toml"
    study.write_text(STUDY)
    names = ["lab-hexapod", "tripod"]
    status, files, rows = answered(capsys, *map(ini, names), "--box", 12.7, 7.62, 10.16, "--tilt", 3, "--study", study)
    assert status == 0 and files == [str(ini(name)) for name in names]
    for k, name in enumerate(names):
        machine, mm = Machine.from_ini(ini(name)), 25.4 if name == "tripod" else 1.0
        given = required_poses(machine, Required(box=tuple((-half / mm, half / mm) for half in (12.7, 7.62, 10.16)), tilt=3.0))
        assert len(given) == (27 if name == "tripod" else 27 * 9)
        joints, margins = machine.inverse(given).values, machine.margins(given)
        kept = [n for n, margin in enumerate(margins.names) if not margin.startswith("axis range")]
        shares = margins.share[:, kept]
        expected = {
            "poses within every limit": ("", f"{(shares >= 0).all(axis=1).sum()} of {len(given)}"),
            "nearest limit": ("", margins.names[kept[shares.min(axis=0).argmin()]]),
            "workspace, level": ("dm³", machine.workspace(bands=24).volume * mm**3 / 1e6),
            "size X Y Z": ("mm", " x ".join(f"{side * mm:.0f}" for side in size(machine, given))),
            "largest travel of a joint": ("mm or degrees", np.ptp(joints, axis=0).max() * mm),
            "least conditioning": ("", machine.conditioning(given).values.min()),
            "fastest joint by tool speed": ("1 or degrees/mm", np.linalg.norm(machine.jacobian(given).values[:, :, :3], axis=2).max()),
            # N/mm of the machine are 1e-3 N/um.
            "least stiffness at the tool": ("N/um", machine.stiffness(given, STUDY).translation.values[:, 0].min() / 1e3),
            "largest deviation at the tool": ("um", np.linalg.norm(machine.sensitivity(given).gain.values[:, :3, :], axis=(1, 2)).max() * 5),
        }
        assert list(rows) == list(expected)
        for row, (unit, value) in expected.items():
            found = rows[row][1][k]
            assert rows[row][0] == unit and (found == value if isinstance(value, str) else found == pytest.approx(value, rel=1e-12)), row


def test_the_lowest_frequency_is_that_of_pkm_dynamics(tmp_path, capsys):
    study = tmp_path / "study.toml"
    study.write_text(STUDY.replace("[legs]\n", '[legs]\nscrew = "self-locking"\ndamping_ratio = 0.02\n') + "[platform]\nmass_kg = 20\ncentre_mm = [0, 0, 0]\ninertia_kg_m2 = [[0.3, 0, 0], [0, 0.3, 0], [0, 0, 0.5]]\n")
    hexapod = ini("hexapod")
    _, _, rows = answered(capsys, hexapod, "--study", study)
    modes = asked("dynamics", hexapod, "--study", study)["modes"]
    assert rows["lowest natural frequency at home"] == ("Hz", [min(mode["hz"] for mode in modes)])


def test_a_program_has_a_verdict_and_what_is_not_judged_is_no_success(monkeypatch, capsys):
    for fits, said in [(True, "fits"), (False, "does not fit"), (None, "not judged")]:
        monkeypatch.setattr(compare, "preflight", lambda *_, fits=fits: {"fits": fits})
        status, _, rows = answered(capsys, ini("tripod"), "--program", "p.ngc")
        assert rows["program"] == ("", [said]) and status == (fits is None)

    def failed(file, program):
        assert (file.name, str(program)) == ("tripod.ini", "p.ngc")
        raise CommandFailed("no LinuxCNC")

    monkeypatch.setattr(compare, "preflight", failed)
    status, _, rows = answered(capsys, ini("tripod"), "--program", "p.ngc")
    assert status == 1 and rows["program"][1] == ["not judged: no LinuxCNC"]


def test_a_table_has_the_columns_of_its_machines_and_a_page_escapes():
    rows = [("a", "mm", [1.0, 123456.0]), ("b <c>", "", ["x & y", float("nan")])]
    text = table(["x/one.ini", "two.ini"], rows).splitlines()
    assert text[0].split() == ["one", "two"] and text[1].split() == ["a", "mm", "1", "1.2346e+05"]
    assert text[2].rstrip() == text[2] and text[2].endswith("not judged") and text[0].index("two") == text[1].index("1.2346e+05")
    made = page(["x/<one>.ini", "two.ini"], rows)
    assert "<th>&lt;one&gt;</th><th>two</th>" in made and "<tr><th>b &lt;c&gt;</th><td></td><td>x &amp; y</td><td>not judged</td></tr>" in made
    made = page(["one.ini", "two.ini"], [("a", "mm", [1.0, 4.0])])
    assert [made.count(f"style='width:{share}%'") for share in ("25.0", "100.0")] == [1, 1]
    assert "<div class=bar" not in page(["one.ini", "two.ini"], [("a", "mm", [0.0, -1.0])])


@pytest.mark.parametrize("words", [["--box", "-1", "0", "0"], ["--tilt", "nan"], ["--tilt", "inf"], ["--tilt", "wide"]])
def test_wrong_lengths_are_named(words, capsys):
    with pytest.raises(SystemExit) as ended:
        main([str(ini("tripod")), *words])
    assert ended.value.code == 2 and "expected a number >= 0" in capsys.readouterr().err
