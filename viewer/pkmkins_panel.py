# SPDX-License-Identifier: GPL-2.0-or-later
"""The reason of a refusal as text, for a panel of PyVCP: `pkm help guide/panel`.

PyVCP has no widget that shows a text from HAL. The panel's label therefore has a variable,
which this module updates from pins that it reads by name.
"""

import os
import sys

sys.path.append(os.path.dirname(os.path.realpath(__file__)))
from pkmkins_refusal import count_legs, sentence  # noqa: E402

# Milliseconds between two updates.
PERIOD = 300


def words(value, legs):
    """Returns the limit ahead, and the last refusal."""
    lines = []
    if value("pkmkins.limit-soon"):
        lines.append("ahead: " + sentence(value("pkmkins.limit-reason"), value("pkmkins.limit-leg"), legs))
    if value("pkmkins.fault"):
        lines.append("last: " + sentence(value("pkmkins.fault"), value("pkmkins.fault-leg"), legs))
    return "\n".join(lines) or "nothing"


def reason(master):
    """Returns a Tk variable that always contains the text."""
    import tkinter

    import hal

    text = tkinter.StringVar(master)
    # Tk deletes a variable without a reference.
    master.pkmkins_reason = text
    legs = []

    def look():
        try:
            # Count again until the module is loaded.
            if not any(legs):
                legs[:] = [count_legs(hal.get_value)]
            text.set(words(hal.get_value, legs[0]))
        except (RuntimeError, TypeError, ValueError) as error:
            text.set(f"pins are missing: {error}")
        master.after(PERIOD, look)

    look()
    return text
