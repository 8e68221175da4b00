# SPDX-License-Identifier: GPL-2.0-or-later
"""Kinematics and studies of parallel machines, on arrays of numpy.

A machine is defined by the INI file of a LinuxCNC configuration with pkmkins, by its legs, or by the
dimensions of `pkm new`. It computes any number of poses at once, on all cores, without the
interpreter's lock, with the same bits as the module that LinuxCNC loads::

    import numpy as np
    from pkmkins import Machine

    machine = Machine.from_ini("configs/hexapod/hexapod.ini")
    poses = np.tile(machine.home, (1000, 1))
    poses[:, 0] += np.linspace(-50, 50, 1000)
    found = machine.inverse(poses)
    found.values, found.ok

Poses are X Y Z A B C, lengths in the machine's unit, angles in degrees. A row without an answer is NaN
and has a code; a single pose raises `Refused`.
"""

from ._core import (
    VERSION as __version__,
    Answer,
    Machine,
    MachineError,
    Margins,
    Refused,
    Sensitivity,
    Stiffness,
    Workspace,
    cause,
)
from .command import CommandFailed, calibrate, preflight
from .kinds import machine_of

__all__ = [
    "Answer",
    "CommandFailed",
    "Machine",
    "MachineError",
    "Margins",
    "Refused",
    "Sensitivity",
    "Stiffness",
    "Workspace",
    "__version__",
    "calibrate",
    "cause",
    "machine_of",
    "preflight",
]
