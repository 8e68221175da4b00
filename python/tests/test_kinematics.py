# SPDX-License-Identifier: GPL-2.0-or-later
"""Kinematics on arrays: the same bits as the command, masks for rows without an answer."""

import csv
import io
import subprocess

import numpy as np
import pkmkins
import pytest
from conftest import CASES, MACHINES, ini, poses
from pkmkins import Machine, Refused
from pkmkins.command import pkm


def asked(command, machine, names, rows):
    """Returns the results of `pkm` for rows, NaN if it has none."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(names)
    writer.writerows([[repr(float(x)) for x in row] for row in rows])
    run = subprocess.run([pkm(), command, machine], input=text.getvalue(), capture_output=True, text=True)
    assert run.returncode in (0, 1), run.stderr
    answers = list(csv.reader(io.StringIO(run.stdout)))[1:]
    return np.array([[float(x) if x else np.nan for x in row] for row in answers])


@pytest.mark.parametrize("name", MACHINES)
def test_inverse_and_forward_have_the_bits_of_pkm(name):
    machine = Machine.from_ini(ini(name))
    given = poses(machine, 7200 * CASES)
    found = machine.inverse(given)
    assert found.ok.any()
    printed = asked("joints", ini(name), "xyzabc", given)
    # pkm writes the shortest text of every number, which reads back to the same bits.
    np.testing.assert_array_equal(found.values, printed)
    joints = found.values[found.ok][:500]
    followed = machine.forward(joints, follow=True)
    names = [f"joint_{n}" for n in range(len(machine.joints))]
    np.testing.assert_array_equal(followed.values, asked("pose", ini(name), names, joints))


def test_forward_of_inverse_is_the_pose(machine):
    given = machine.home + 0.02 * (poses(machine, 2000) - machine.home)
    joints = machine.inverse(given)
    back = machine.forward(joints.values[joints.ok])
    assert joints.ok.all() and back.ok.all()
    # The module's guarantee: 1e-10 of the machine's size, angles times the platform's radius.
    apart = np.abs(back.values - given)
    apart[:, 3:] *= np.radians(machine.radius)
    assert apart.max() < 1e-10 * machine.scale


def test_a_seed_for_every_row_is_the_one_it_starts_from(hexapod):
    given = poses(hexapod, 300)
    joints = hexapod.inverse(given)
    near = given[joints.ok]
    found = hexapod.forward(joints.values[joints.ok], seed=near)
    assert found.ok.mean() > 0.9
    assert np.nanmax(np.abs(found.values - near)) < 1e-7
    with pytest.raises(ValueError, match="seed: 2 rows; expected one, or"):
        hexapod.forward(joints.values, seed=near[:2])


def test_jacobian_is_the_derivative_of_inverse(machine):
    given = machine.home + 0.01 * (poses(machine, 50) - machine.home)
    found = machine.jacobian(given)
    assert found.ok.all()
    step = 1e-5 * machine.scale
    for k, letter in enumerate("XYZABC"):
        if letter not in machine.coordinates:
            continue
        move = np.zeros(6)
        move[k] = step if k < 3 else 1e-3
        ahead, behind = machine.inverse(given + move).values, machine.inverse(given - move).values
        slope = (ahead - behind) / (2 * move[k])
        scale = np.abs(found.values[:, :, k]).max() + 1e-9
        # Central differences: the square of the step, and rounding over the step.
        assert np.abs(slope - found.values[:, :, k]).max() < 1e-5 * scale


def test_margins_name_their_columns_and_are_negative_beyond(hexapod):
    margins = hexapod.margins(np.vstack([hexapod.home, hexapod.home + [0, 0, 0, 24, 0, 0]]))
    assert margins.share.shape == (2, len(margins.names)) == margins.value.shape
    assert (margins.share[0] >= 0).all()
    tilted = [n for n, name in enumerate(margins.names) if "axis A" in name]
    assert margins.value[1, tilted] == 24 and margins.high[tilted] == 25
    beyond = hexapod.margins(hexapod.home + [0, 0, 0, 26, 0, 0])
    assert beyond.share.shape == (len(margins.names),) and beyond.share[tilted] < 0


def test_a_row_without_an_answer_is_masked_and_one_pose_raises(hexapod):
    given = np.tile(hexapod.home, (4, 1))
    given[1, 0] = np.nan
    given[3, 2] = 1e7
    found = hexapod.inverse(given)
    assert found.ok.tolist() == [True, False, True, True] or found.ok.tolist() == [True, False, True, False]
    assert found.code[1] == -10 and np.isnan(found.values[1]).all()
    with pytest.raises(Refused) as caught:
        hexapod.inverse(given[1])
    assert caught.value.code == -10 and caught.value.name == "PoseNotFinite" and caught.value.remedy
    assert pkmkins.cause(-10)["name"] == "PoseNotFinite"
    with pytest.raises(KeyError):
        pkmkins.cause(7)


def test_arrays_of_any_order_are_read_as_they_are(hexapod):
    given = poses(hexapod, 1000)
    expected = hexapod.inverse(given).values
    wide = np.zeros((1000, 12))
    wide[:, ::2] = given
    for array in [np.asfortranarray(given), wide[:, ::2], given[::-1][::-1]]:
        np.testing.assert_array_equal(hexapod.inverse(array).values, expected)
    backwards = hexapod.inverse(given[::-1])
    np.testing.assert_array_equal(backwards.values, expected[::-1])


@pytest.mark.parametrize(
    ("given", "error", "text"),
    [
        (np.zeros((3, 5)), ValueError, r"shape \[3, 5\]; expected \(n, 6\)"),
        (np.zeros((1, 2, 6)), ValueError, "shape"),
        (np.zeros((3, 6), dtype=np.float32), TypeError, "float32; expected float64"),
        (np.zeros((3, 6), dtype=">f8"), TypeError, "expected float64"),
        (np.zeros((3, 6), dtype=complex), TypeError, "complex128"),
        (np.float64(3), ValueError, "shape"),
        ("home", TypeError, "not an array of numbers"),
        ([[1, 2], [3]], TypeError, "not an array of numbers"),
        (None, (TypeError, ValueError), "poses"),
    ],
)
def test_wrong_arrays_are_refused_with_what_is_expected(hexapod, given, error, text):
    with pytest.raises(error, match=text):
        hexapod.inverse(given)


def test_no_poses_make_no_answers(machine):
    none = np.zeros((0, 6))
    joints = len(machine.joints)
    assert machine.inverse(none).values.shape == (0, joints)
    assert machine.jacobian(none).values.shape == (0, joints, 6)
    assert machine.forward(np.zeros((0, joints))).values.shape == (0, 6)
    assert machine.margins(none).value.shape[0] == 0


def test_a_tool_turns_with_the_platform_and_adds_to_the_spindle(hexapod):
    tilted = hexapod.home + [0, 0, 0, 10, 0, 0]
    plain, longer = hexapod.inverse(tilted).values, hexapod.inverse(tilted, tool=(0, 0, -50)).values
    assert np.abs(plain - longer).max() > 1
    level = hexapod.home
    np.testing.assert_allclose(hexapod.inverse(level).values, hexapod.inverse(level, tool=(0, 0, -50)).values, rtol=1e-12)
    with pytest.raises(ValueError, match="tool: 2 numbers"):
        hexapod.inverse(level, tool=(0, 0))
