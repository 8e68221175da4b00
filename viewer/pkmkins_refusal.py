# SPDX-License-Identifier: GPL-2.0-or-later
"""The reason of a refusal by the kinematics as text, from the values of pins."""

import os
import sys

sys.path.append(os.path.dirname(os.path.realpath(__file__)))
from pkmkins_causes import CAUSES  # noqa: E402


def count_legs(value):
    """Returns the number of legs of the module: later joints are called joints; `value` reads a pin."""
    count = 0
    try:
        while True:
            value(f"pkmkins.base.{count}.x")
            count += 1
    except (RuntimeError, TypeError, ValueError):
        return count


def sentence(code, number, legs):
    """Returns the refusal as the module reports it, without the value, which no pin has."""
    text, remedy = CAUSES.get(code, ("unknown cause", "see `pkm help reference/causes`"))
    part = "" if number < 0 else f"leg {number}: " if number < legs else f"joint {number}: "
    return f"{part}{text}; {remedy} [code {code}]"
