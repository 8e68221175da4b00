# SPDX-License-Identifier: GPL-2.0-or-later
"""Machines from files, texts, legs and dimensions; studies of them."""

import json
import subprocess

import numpy as np
import pkmkins
import pytest
from conftest import OTHERS, ROOT, ini, needs_linuxcnc
from pkmkins import Machine, MachineError, machine_of
from pkmkins.command import pkm

DRAWING = {
    "base_radius": 400, "base_half_angle": 12, "platform_radius": 180, "platform_half_angle": 15, "strut": (550, 850), "tool": "up"
}


def test_a_file_and_its_text_are_the_same_machine(hexapod):
    again = Machine.from_text(hexapod.text)
    assert again.geometry_hash == hexapod.geometry_hash
    assert "6 joints, XYZABC, mm" in repr(hexapod)


def test_a_machine_of_legs_is_that_of_its_file():
    tripod = Machine.from_ini(ini("tripod"))
    feet = [(0, 0, 0), (10, 0, 0), (5, 7.071, 0)]
    legs = [{"kind": "strut", "base": foot, "platform": (0, 0, 0), "limits": (2, 9)} for foot in feet]
    made = Machine(legs, "XYZ", home=tripod.home[:3], unit="inch")
    given = tripod.home + np.array([[0.5, 0.2, 0.1, 0, 0, 0], [0, 0, 0, 0, 0, 0]])
    np.testing.assert_array_equal(made.inverse(given).values, tripod.inverse(given).values)


@pytest.mark.parametrize(
    ("legs", "error", "text"),
    [
        ([{"base": (0, 0, 0)}], KeyError, "needs a kind"),
        ([{"kind": "strut", "base": (0, 0), "platform": (0, 0, 0)}] * 3, MachineError, "BASE"),
        ([{"kind": "strut", "base": (0, 0, 0), "platform": (0, 0, 0), "bass": 1}] * 3, MachineError, "BASS"),
        ([{"kind": "strut", "base": (0, 0, 0), "platform": (0, 0, 0), "limits": (9, 2)}] * 3, ValueError, "smaller one first"),
        ([{"kind": "strut", "base": (0, 0, 0), "platform": (0, 0, 0)}] * 3, MachineError, "."),
        ([], MachineError, "legs"),
    ],
)
def test_legs_that_make_no_machine_are_refused_by_name(legs, error, text):
    with pytest.raises(error, match=text):
        Machine(legs, "XYZ", home=(5, 2, 3))


def test_a_missing_file_and_machines_that_are_not_covered_are_named():
    with pytest.raises(MachineError, match="no-such.ini"):
        Machine.from_ini("no-such.ini")
    for name in OTHERS:
        with pytest.raises(NotImplementedError, match=name):
            Machine.from_ini(ini(name))


def test_dimensions_make_the_machine_that_pkm_new_makes(tmp_path):
    made = machine_of("hexapod", **DRAWING)
    words = []
    for name, value in DRAWING.items():
        words += ["--" + name.replace("_", "-"), *pkmkins.kinds.words(value)]
    subprocess.run([pkm(), "new", "hexapod", "mine", *words], cwd=tmp_path, check=True, capture_output=True)
    file = Machine.from_ini(tmp_path / "mine" / "mine.ini")
    assert made.geometry_hash == file.geometry_hash
    np.testing.assert_array_equal(made.home, file.home)


def test_wrong_dimensions_say_what_is_wrong():
    with pytest.raises(MachineError, match="strut"):
        machine_of("hexapod", **{**DRAWING, "strut": (50, 60)})
    with pytest.raises(ValueError, match="no kind of machine; expected one of hexapod"):
        machine_of("heptapod")
    with pytest.raises(ValueError, match="base-width: a hexapod has no such value"):
        machine_of("hexapod", base_width=3)


def test_workspace_is_that_of_pkm(hexapod):
    run = subprocess.run(
        [pkm(), "--format", "json", "workspace", ini("hexapod"), "--bands", "20", "--grid", "30"],
        capture_output=True,
        text=True,
        check=True,
    )
    told = json.loads(run.stdout)
    seen = hexapod.workspace(bands=20, grid=30)
    assert (seen.volume, seen.volume_by_grid) == (told["volume_by_boundary"], told["volume_by_grid"])
    assert sum(seen.limits.values()) == pytest.approx(1)
    assert seen.triangles.max() < len(seen.vertices)
    with pytest.raises(MachineError, match="is not in the workspace"):
        hexapod.workspace(start=(9999, 0, 0))


def test_stiffness_of_one_spring_a_leg_follows_from_the_jacobian(hexapod):
    study = "[legs]\nstiffness_n_per_um = 10\nscrew = \"self-locking\"\n"
    given = np.array([hexapod.home, hexapod.home + [5, -3, 8, 2, 1, 3]])
    found = hexapod.stiffness(given, study)
    least = 1 / np.linalg.eigvalsh(found.compliance.values[:, :3, :3])[:, -1]
    # Both by the same numbers: rounding of an eigenvalue.
    np.testing.assert_allclose(found.translation.values[:, 0], least, rtol=1e-9)
    with pytest.raises(MachineError, match="study"):
        hexapod.stiffness(given, "[leg]\n")


def test_sensitivity_is_the_inverse_of_the_jacobian(hexapod):
    found = hexapod.sensitivity(hexapod.home, length=hexapod.radius)
    jacobian = hexapod.jacobian(hexapod.home).values
    # Condition numbers of some hundred take that many units of the last place.
    np.testing.assert_allclose(found.gain.values @ jacobian, np.eye(6), atol=1e-10)


def test_preflight_needs_the_command(monkeypatch, hexapod):
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("PKM", raising=False)
    with pytest.raises(pkmkins.CommandFailed, match="not in PATH"):
        pkmkins.preflight(ini("hexapod"), ROOT / "configs/hexapod/programs/none.ngc")


@needs_linuxcnc
def test_preflight_answers_as_the_command_does():
    program = ROOT / "configs" / "tripod" / "programs" / "rosette.ngc"
    found = pkmkins.preflight(ini("tripod"), program)
    assert found["fits"] is True, found
    with pytest.raises(pkmkins.CommandFailed, match="no-such.ngc"):
        pkmkins.preflight(ini("tripod"), "no-such.ngc")
