# SPDX-License-Identifier: GPL-2.0-or-later
"""Machines with constraints of the platform: golden poses, derivatives, dependent coordinates."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from pkmkins import Machine

REPOSITORY = Path(__file__).resolve().parents[2]
GOLDEN = tomllib.loads((REPOSITORY / "tests/cases/golden/constraints.toml").read_text())["row"]
NAMES = ["tricept", "exechon", "z3-head"]


def machine(name):
    return Machine.from_ini(REPOSITORY / f"configs/{name}/{name}.ini")


@pytest.mark.parametrize("row", GOLDEN, ids=lambda row: row["machine"])
def test_golden_poses_have_their_joints_and_dependent_coordinates(row):
    own = machine(row["machine"])
    # The file of the head has a table, which moves by the rest of X and Y.
    letters = [own.dependent.find(letter) < 0 for letter in "XYZABC"]
    tool = -np.array(row["tip"])
    full = np.array(row["pose"]) + [*tool, 0, 0, 0]
    pose = np.where(letters, full, 0.0)
    joints = own.inverse(pose, tool=tool)
    np.testing.assert_allclose(joints.values[:3], row["joints"], atol=1e-9 * own.scale, rtol=0)
    found = own.full_poses(pose, tool=tool).values
    # The precision that is required of all machines: 1e-9 of the size, also over a radius of 200.
    np.testing.assert_allclose(found, full, atol=1e-9 * own.scale, rtol=0)
    np.testing.assert_allclose(own.forward(joints.values, tool=tool).values, pose, atol=1e-9 * own.scale, rtol=0)


def test_letters_are_commanded_or_follow():
    assert [(machine(name).coordinates, machine(name).dependent) for name in NAMES] == [
        ("XYZ", "ABC"), ("XYZ", "ABC"), ("XYZAB", "XYC")]


@pytest.mark.parametrize("name", NAMES)
def test_the_jacobian_is_the_slope_of_the_inverse(name):
    own = machine(name)
    chance, step = np.random.default_rng(60), 1e-3
    half = {"X": 100, "Y": 100, "Z": 50, "A": 15, "B": 15}
    ranges = np.array([half[letter] if letter in own.coordinates else 0.0 for letter in "XYZABC"])
    poses = own.home + chance.uniform(-1, 1, (50, 6)) * ranges
    tool = [10.0, -20.0, 80.0]
    found = own.jacobian(poses, tool=tool)
    assert found.ok.all()
    for k, letter in enumerate("XYZABC"):
        if letter not in own.coordinates:
            assert not found.values[:, :, k].any()
            continue
        more, less = (own.inverse(poses + sign * step * np.eye(6)[k], tool=tool).values for sign in (1, -1))
        # Central differences: truncation and rounding are both below 1e-7.
        np.testing.assert_allclose(found.values[:, :, k], (more - less) / (2 * step), atol=1e-6, rtol=0)
