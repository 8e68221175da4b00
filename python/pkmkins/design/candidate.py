# SPDX-License-Identifier: GPL-2.0-or-later
"""The value of one machine: a pure function of a study and numbers, the same on every computer.

Cheap checks come first: whether such a machine exists, whether home satisfies its limits, whether the poses
of the required box do. The objectives are computed only for machines that pass them.
"""

import re
from dataclasses import dataclass
from itertools import product

import numpy as np

from .._core import MachineError
from ..kinds import machine_of

# Poses along each side of the required box: its corners, edges and middle.
SIDE = 3
# Directions in which the platform is tilted.
DIRECTIONS = 8
# The violation of machines that do not exist, larger than any fraction of a range.
NO_MACHINE = 1e3


@dataclass(frozen=True)
class Judgement:
    """Objectives (NaN if not computed), and by how much each constraint is violated, 0 if satisfied."""

    objectives: tuple
    violations: dict

    @property
    def fits(self):
        """Returns whether every constraint is satisfied."""
        return not self.violations


def judge(study, values):
    """Judges the machine with these numbers, in the order of `study.ranges`."""
    nothing = (float("nan"),) * len(study.objectives)
    try:
        machine = machine_of(study.kind, **study.dimensions(values))
    except MachineError as error:
        return Judgement(nothing, {"machine": NO_MACHINE + _by_how_much(str(error))})
    poses = required_poses(machine, study.required)
    violations = _violations(machine, poses, study.required)
    if violations:
        return Judgement(nothing, violations)
    objectives = []
    for name in study.objectives:
        objectives.append(float(MEASURES[name](study, machine, poses)))
    if not np.isfinite(objectives).all():
        bad = [name for name, value in zip(study.objectives, objectives) if not np.isfinite(value)]
        return Judgement(nothing, {f"objective {bad[0]}": 1.0})
    return Judgement(tuple(objectives), {})


def required_poses(machine, required):
    """Returns (n, 6): corners, edges and middle of the required box about home, level and tilted in all directions."""
    sides = [np.linspace(low, high, SIDE if low < high else 1) for low, high in required.box]
    places = np.array(list(product(*sides)))
    turns = [(0.0, 0.0, 0.0)]
    if required.tilt > 0:
        for azimuth in np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS):
            tilt = np.radians(required.tilt)
            axis = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
            a, b = -np.degrees(np.arcsin(axis[1])), np.degrees(np.arctan2(axis[0], axis[2]))
            turns.append((a if "A" in machine.coordinates else 0.0, b if "B" in machine.coordinates else 0.0, 0.0))
    turns = sorted(set(turns))
    poses = np.zeros((len(places) * len(turns), 6))
    poses[:, :3] = np.repeat(places, len(turns), axis=0)
    poses[:, 3:] = np.tile(np.array(turns), (len(places), 1))
    return poses + machine.home


def _violations(machine, poses, required):
    """Returns the sums of the violations of each kind of limit, as fractions of its range."""
    margins = machine.margins(poses)
    found = {}
    unreached = np.count_nonzero(~margins.answer.ok)
    if unreached:
        found["reach"] = 1.0 + unreached / len(poses)
    shares = np.where(np.isnan(margins.share), 0.0, np.minimum(margins.share, 0.0))
    for name, missing in zip(margins.names, -shares.min(axis=0)):
        kind = name.split(":")[0]
        # The axis limits are written only for the chosen machine.
        if missing > 0 and kind != "axis range":
            found[kind] = found.get(kind, 0.0) + float(min(missing, NO_MACHINE))
    if required.conditioning > 0:
        least = np.nan_to_num(machine.conditioning(poses).values, nan=required.conditioning).min()
        _add(found, "conditioning", 1 - least / required.conditioning)
    if required.feed > 0:
        rows = np.linalg.norm(machine.jacobian(poses).values[:, :, :3], axis=2)
        fastest = np.nan_to_num(rows, nan=0.0).max() * required.feed
        _add(found, "joint speed", fastest / required.joint_speed - 1 if required.joint_speed > 0 else NO_MACHINE)
    return found


def _add(found, name, missing):
    if missing > 0:
        found[name] = found.get(name, 0.0) + float(min(missing, NO_MACHINE))


def _by_how_much(text):
    """Returns the distance of a machine from existing, if its refusal states it, below 1: a gradient for the search."""
    found = re.search(r"would (?:be|stand at) (-?[\d.]+).*?; (-?[\d.]+) to (-?[\d.]+)", text)
    if not found:
        return 1.0
    value, low, high = (float(part) for part in found.groups())
    beyond = max(low - value, value - high, 0.0)
    return beyond / (beyond + abs(high - low) + 1e-300)


def _volume(study, machine, _poses):
    return machine.workspace(bands=study.bands).volume


def _stiffness(study, machine, poses):
    """Returns the least stiffness of the tool tip over the required poses, N/mm."""
    return machine.stiffness(poses, study.legs).translation.values[:, 0].min()


def _tool_error(study, machine, poses):
    """Returns the largest standard deviation of the tip's position over the required poses, machine units."""
    gain = machine.sensitivity(poses).gain.values[:, :3, :]
    return np.sqrt((gain**2).sum(axis=(1, 2))).max() * _sigma(study, machine)


def _sigma(study, machine):
    [sigma] = re.findall(r"^joint_sigma_um = ([\d.eE+-]+)$", study.legs, re.MULTILINE)
    return float(sigma) * 1e-3 / (25.4 if machine.unit == "inch" else 1.0)


def size(machine, poses):
    """Returns the sides X Y Z of the space that the machine occupies over the poses, machine units."""
    ends = machine.space(poses).values
    return ends[:, 1].max(axis=0) - ends[:, 0].min(axis=0)


def _size(_study, machine, poses):
    """Returns the longest side of the space that the machine occupies over the required poses, machine units."""
    return size(machine, poses).max()


def _stroke(_study, machine, poses):
    """Returns the largest travel of a joint over the required poses."""
    joints = machine.inverse(poses).values
    return (joints.max(axis=0) - joints.min(axis=0)).max()


MEASURES = {
    "volume": _volume,
    "stiffness": _stiffness,
    "tool_error": _tool_error,
    "size": _size,
    "stroke": _stroke,
}
