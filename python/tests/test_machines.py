# SPDX-License-Identifier: GPL-2.0-or-later
"""Machines from files, texts, legs and dimensions; studies of them."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pkmkins
import pytest
from conftest import CARRIED, PAIRS, ROOT, ini, needs_linuxcnc
from pkmkins import Machine, MachineError, machine_of
from pkmkins.command import asked, pkm

ROSETTE = ROOT / "configs" / "tripod" / "programs" / "rosette.ngc"
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
        ([{"kind": "strut", "base": (0, 0, 0), "platform": (0, 0, 0), "limits": (9, 2)}] * 3, ValueError, "smaller first"),
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
    for name in PAIRS:
        with pytest.raises(NotImplementedError, match=name):
            Machine.from_ini(ini(name))


def turned(degrees, axis):
    """Returns the rotation about Z (2) or Y (1)."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]] if axis == 2 else [[c, 0, s], [0, 1, 0], [-s, 0, c]])


def test_own_poses_follow_the_axis_that_carries_the_work():
    machine = Machine.from_ini(ini("hexapod-rotary-table"))
    for c in [0.0, 30.0, -200.0]:
        position = np.array([40.0, -20, 250, 3, -4, c, 0, 0, 0])
        own = machine.own_poses(position, tool=(0, 0, 60)).values
        expected = turned(c, 2) @ position[:3]
        np.testing.assert_allclose(own, [*expected, 3, -4, 0], atol=1e-9)
        assert machine.inverse(own, tool=(0, 0, 60)).ok


def test_own_poses_follow_the_axis_that_carries_the_tool():
    machine = Machine.from_ini(ini("lathe-two-turrets"))
    tool, pivot = np.array([190.0, -100, 0]), np.array([-60.0, 0, 0])
    for a in [0.0, -35.0, 90.0]:
        position = np.array([200.0, 450, 1010, a, 8, 20, 0, 0, 0])
        own = machine.own_poses(position, tool=tool).values
        tip = pivot + turned(a, 1) @ (-tool - pivot)
        expected = position[:3] - tool - turned(8, 1) @ tip
        np.testing.assert_allclose(own, [*expected, 0, 8, 0], atol=1e-9)


@pytest.mark.parametrize("name", sorted(CARRIED))
def test_forward_returns_the_own_pose_of_a_machine_whose_axes_carry_something(name):
    machine = Machine.from_ini(ini(name))
    joints = machine.inverse(machine.home, tool=(5, 6, 7))
    assert joints.ok
    np.testing.assert_allclose(machine.forward(joints.values, tool=(5, 6, 7)).values, machine.home, atol=1e-6)


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
    with pytest.raises(ValueError, match="unknown kind of machine; expected one of hexapod"):
        machine_of("heptapod")
    with pytest.raises(ValueError, match="base-width: unknown value of a hexapod"):
        machine_of("hexapod", base_width=3)


def test_workspace_is_that_of_pkm(hexapod):
    run = subprocess.run(
        [pkm(), "--format", "json", "workspace", ini("hexapod"), "--bands", "20", "--grid", "30"],
        capture_output=True,
        text=True,
        check=True,
    )
    printed = json.loads(run.stdout)
    seen = hexapod.workspace(bands=20, grid=30)
    assert (seen.volume, seen.volume_by_grid) == (printed["volume_by_boundary"], printed["volume_by_grid"])
    assert sum(seen.limits.values()) == pytest.approx(1)
    assert seen.triangles.max() < len(seen.vertices)
    with pytest.raises(MachineError, match="is not in the workspace"):
        hexapod.workspace(start=(9999, 0, 0))


def test_stiffness_of_one_spring_a_leg_follows_from_the_jacobian(hexapod):
    study = "[legs]\nstiffness_n_per_um = 10\nscrew = \"self-locking\"\n"
    given = np.array([hexapod.home, hexapod.home + [5, -3, 8, 2, 1, 3]])
    found = hexapod.stiffness(given, study)
    least = 1 / np.linalg.eigvalsh(found.compliance.values[:, :3, :3])[:, -1]
    # Both use the same numbers: rounding of an eigenvalue.
    np.testing.assert_allclose(found.translation.values[:, 0], least, rtol=1e-9)
    with pytest.raises(MachineError, match="study"):
        hexapod.stiffness(given, "[leg]\n")


def test_sensitivity_is_the_inverse_of_the_jacobian(hexapod):
    found = hexapod.sensitivity(hexapod.home, length=hexapod.radius)
    jacobian = hexapod.jacobian(hexapod.home).values
    # Condition numbers of some hundred lose that many units in the last place.
    np.testing.assert_allclose(found.gain.values @ jacobian, np.eye(6), atol=1e-10)


def test_what_starts_the_command_needs_it_and_preflight_does_not(monkeypatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("PKM", raising=False)
    with pytest.raises(pkmkins.CommandFailed, match="not in PATH"):
        pkmkins.calibrate(ini("hexapod"), "no-such.log")
    with pytest.raises(pkmkins.CommandFailed, match="no-such.ngc: No such file"):
        pkmkins.preflight(ini("hexapod"), "no-such.ngc")


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--most-moves", "-1"], "-1"),
        (["--mechanism", "2"], "tripod.ini has only one mechanism"),
        pytest.param(["--hal", "no-such.hal"], "no-such.hal", marks=needs_linuxcnc),
    ],
)
def test_options_of_preflight_that_are_wrong_are_named(words, text):
    with pytest.raises(pkmkins.CommandFailed, match=text):
        pkmkins.preflight(ini("tripod"), ROSETTE, *words)


@needs_linuxcnc
@pytest.mark.parametrize(("name", "program"), [("tripod", ROSETTE), ("hexapod", "far.ngc")])
def test_preflight_answers_as_the_command_does(name, program, tmp_path):
    far = tmp_path / "far.ngc"
    far.write_text("G21 G90 M52 P1\nG1 F6000 X5000\n/ G1 X0\nM2\n")
    program, trace = tmp_path / program, tmp_path / "trace.csv"
    words = ["--trace", trace, "--most-time", "3600"]
    assert pkmkins.preflight(ini(name), program, *words) == asked("preflight", ini(name), program, *words)
    # Twice: files written or read once are not an input of the next call.
    assert pkmkins.preflight(ini(name), program, *words)["fits"] is (name == "tripod")
    assert trace.exists()


ENDLESS = "G21 G90 M52 P1 F6000\nO1 while [1]\nG1 X1\nG1 X0\nO1 endwhile\nM2\n"
READING = "O1 while [1]\nO1 endwhile\nM2\n"


@needs_linuxcnc
@pytest.mark.parametrize("text", [ENDLESS, READING])
@pytest.mark.parametrize("is_whole_group", [False, True])
def test_ctrl_c_ends_preflight_and_leaves_no_process_and_no_folder(tmp_path, text, is_whole_group):
    program, folder = tmp_path / "endless.ngc", tmp_path / "tmp"
    program.write_text(text)
    folder.mkdir()
    # A shell starts background processes with SIGINT ignored.
    code = ("import signal, sys, pkmkins; signal.signal(signal.SIGINT, signal.default_int_handler); "
            "pkmkins.preflight(sys.argv[1], sys.argv[2], '--patience', '1000')")
    words = [sys.executable, "-c", code, ini("hexapod"), program]
    environment = os.environ | {"TMPDIR": str(folder)}
    run = subprocess.Popen(words, env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True)
    end = time.monotonic() + 60
    while not any("pkm-control" in process for process in processes_of(folder)):
        assert run.poll() is None and time.monotonic() < end
        time.sleep(0.05)
    time.sleep(0.5)
    (os.killpg if is_whole_group else os.kill)(run.pid, signal.SIGINT)
    said = run.communicate(timeout=20)[1]
    assert run.returncode == -signal.SIGINT and "KeyboardInterrupt" in said, said
    assert processes_of(folder) == [] and list(folder.iterdir()) == []


def processes_of(folder):
    """Returns the command lines that name a folder."""
    lines = []
    for file in Path("/proc").glob("[0-9]*/cmdline"):
        # Other processes end meanwhile.
        with contextlib.suppress(OSError):
            lines.append(file.read_text(errors="replace"))
    return [line for line in lines if str(folder) in line]


@needs_linuxcnc
def test_other_threads_run_during_preflight():
    counted, done = [0], threading.Event()

    def count():
        while not done.wait(0.001):
            counted[0] += 1

    thread = threading.Thread(target=count)
    thread.start()
    pkmkins.preflight(ini("tripod"), ROSETTE)
    done.set()
    thread.join()
    assert counted[0] > 20


def test_the_old_name_of_the_scale_names_the_new_ones(hexapod):
    with pytest.warns(DeprecationWarning, match="use scale.*space"):
        assert hexapod.size == hexapod.scale


def test_the_space_of_a_machine_has_its_feet_platform_and_rails():
    tripod = Machine.from_ini(ini("tripod"))
    feet = np.array([(0, 0, 0), (10, 0, 0), (5, 7.071, 0)])
    points = np.vstack([feet, tripod.home[None, :3]])
    [found] = tripod.space(tripod.home[None]).values
    np.testing.assert_allclose(found, [points.min(axis=0), points.max(axis=0)], atol=1e-12)
    glide = Machine.from_ini(ini("hexaglide"))
    [[low, high]] = glide.space(glide.home[None]).values
    # Rails along X from -1400, with carriages from 100 to 2700 mm.
    assert (low[0], high[0]) == (-1300, 1300)
