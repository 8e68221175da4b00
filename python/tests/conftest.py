# SPDX-License-Identifier: GPL-2.0-or-later
"""The shipped machines, random poses of them, and the command pkm."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from pkmkins import Machine

ROOT = Path(__file__).resolve().parents[2]
# Machine refuses pairs of mechanisms. Poses of a machine whose axes carry something are its own, not those of programs.
PAIRS = {"lathe-mirrored"}
CARRIED = {"hexapod-rotary-table", "lathe-two-turrets", "lathe-work-on-platform"}
# Those with constraints of the platform are tested by themselves.
CONSTRAINED = {"exechon", "tricept", "z3-head"}
MACHINES = sorted(ini.stem for ini in ROOT.glob("configs/*/*.ini") if ini.stem not in PAIRS | CARRIED | CONSTRAINED)

# PKMKINS_CASES=10 is the long tier: 10^6 poses over all machines.
CASES = int(os.environ.get("PKMKINS_CASES", "1"))


# Programs run by LinuxCNC, which the package itself does not need, in virtual time: with the library that make install
# installs beside it, or the one that PKM_VIRTUAL_LIBRARY names.
needs_linuxcnc = pytest.mark.skipif(shutil.which("linuxcnc") is None, reason="LinuxCNC is not installed here")


def ini(name):
    return ROOT / "configs" / name / f"{name}.ini"


def poses(machine, count, seed=1):
    """Returns random poses about home, some of them out of reach."""
    rng = np.random.default_rng(seed)
    spread = np.array([machine.scale / 4] * 3 + [20.0] * 3)
    moved = np.array([letter in machine.coordinates for letter in "XYZABC"])
    return machine.home + rng.uniform(-1, 1, (count, 6)) * np.where(moved, spread, 0.0)


@pytest.fixture(params=MACHINES)
def machine(request):
    return Machine.from_ini(ini(request.param))


@pytest.fixture
def hexapod():
    return Machine.from_ini(ini("hexapod"))
