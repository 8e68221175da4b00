# SPDX-License-Identifier: GPL-2.0-or-later
"""Machines from dimensions, as in `pkm new`."""

from ._core import Machine


def machine_of(kind, **values):
    """Creates a machine of a kind from its dimensions, without files: `machine_of("hexapod", base_radius=400, ...)`.

    `kind` and `values` are the words of `pkm new` with _ for -, numbers or sequences of numbers:
    `machine_of("hexapod", base_radius=400, base_half_angle=12, platform_radius=180,
    platform_half_angle=15, strut=(550, 850), tool="up")`. Lengths are in the machine's unit (`unit="mm"` or
    "inch"), angles in degrees. Home is found as `pkm new` finds it; axis limits are not proved.

    Raises MachineError if no such machine can work, with the leg and a remedy; ValueError if a
    value is unknown.
    """
    return Machine.of_kind(kind, {name.replace("_", "-"): words(value) for name, value in values.items()})


def words(value):
    """Returns a value as the words of a command line; numbers as the shortest text that is the same number."""
    if isinstance(value, str):
        return [value]
    try:
        return [repr(float(part)) for part in value]
    except TypeError:
        return [repr(float(value))]
