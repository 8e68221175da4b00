# SPDX-License-Identifier: GPL-2.0-or-later
"""Why something was refused, in words, for a panel of PyVCP: docs/guide/panel.md.

PyVCP has no widget that shows a text from HAL. The panel's label therefore has a variable of its own,
which this keeps up to date from pins that it reads by name.
"""

import os
import sys

sys.path.append(os.path.dirname(os.path.realpath(__file__)))
from pkmkins_refusal import count_legs, sentence  # noqa: E402

# Milliseconds between two looks.
PERIOD = 300


def words(value, legs):
    """What is ahead, and what was refused last."""
    told = []
    if value("pkmkins.limit-soon"):
        told.append("ahead: " + sentence(value("pkmkins.limit-reason"), value("pkmkins.limit-leg"), legs))
    if value("pkmkins.fault"):
        told.append("last: " + sentence(value("pkmkins.fault"), value("pkmkins.fault-leg"), legs))
    return "\n".join(told) or "nothing"


def reason(master):
    """A variable of Tk that always has the words."""
    import tkinter

    import hal

    text = tkinter.StringVar(master)
    # Tk forgets a variable that nobody holds.
    master.pkmkins_reason = text
    legs = []

    def look():
        try:
            if not legs:
                legs.append(count_legs(hal.get_value))
            text.set(words(hal.get_value, legs[0]))
        except (RuntimeError, TypeError, ValueError) as error:
            text.set(f"pins are missing: {error}")
        master.after(PERIOD, look)

    look()
    return text
