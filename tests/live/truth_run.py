# SPDX-License-Identifier: GPL-2.0-or-later
"""Programs run by LinuxCNC for `truth.py`, with every servo cycle recorded."""

import linuxcnc

from machine import AXES, Failure
from recorder import Recorder

PERIOD_NS = 1_000_000
START_SECONDS = 5
BESIDE = 0.05  # machine units and degrees


def columns(layout):
    return [("line", "motion.program-line", "s32"), ("enabled", "motion.motion-enabled", "bit"),
            ("busy", "pkmkins.tool-busy", "bit"),
            *((letter, f"axis.{letter}.pos-cmd", "float") for letter in AXES),
            *((f"p{n}", f"joint.{n}.pos-cmd", "float") for n in layout.joints)]


def truth(machine, out, programs, before, startup):
    """Runs programs one after another from home, until LinuxCNC stops one. Homing ends
    up to 1e-6 beside home, and LinuxCNC makes no move of that length: one leads away and back.

    LinuxCNC executes the startup code at home, and the code may use the position."""
    recorder = Recorder(machine.component, columns(machine.layout), PERIOD_NS)
    machine.start()
    recorder.start()
    away, home = (" ".join(f"{letter.upper()}{value + beside}" for letter, value in machine.layout.moved_home())
                  for beside in (-BESIDE, 0.0))
    outcomes = {}
    for name, path, seconds, deletes in programs:
        # Without a tool there is no change to T0, which would move to the tool change position.
        unload = ("T0 M6",) if machine.stat.tool_in_spindle else ()
        for block in (*unload, *before, f"G53 G0 {away}", f"G53 G0 {home}", startup):
            machine.mdi(block)
        machine.command.set_block_delete(deletes)
        machine.pause(0.2)
        outcomes[name], rows = observed(machine, recorder, path, seconds)
        write(out / f"{name}.csv", machine.layout, rows)
        if outcomes[name]["errors"] or not outcomes[name]["ended"]:
            break
    recorder.stop()
    return {"outcomes": outcomes}


def observed(machine, recorder, path, seconds):
    """Runs one program to its end, or until LinuxCNC stops it."""
    machine.pause(0.1)
    discard(recorder)
    del machine.messages[:]
    machine.set_mode(linuxcnc.MODE_AUTO)
    machine.command.program_open(path)
    machine.command.auto(linuxcnc.AUTO_RUN, 0)
    machine.wait(lambda: machine.stat.interp_state != linuxcnc.INTERP_IDLE or machine.error_texts(),
                 START_SECONDS, "start of the program")
    ended = True
    try:
        machine.wait(lambda: is_over(machine), seconds, "end of the program")
    except Failure:
        ended = False
        machine.command.abort()
    machine.pause(0.3)
    rows = recorder.rows[0][:recorder.samples()]
    errors = machine.error_texts()
    return {"errors": errors, "ended": ended}, rows


def is_over(machine):
    """Returns whether the program is at its end. At M0, M1 and M60 the operator presses the button at once."""
    if machine.stat.interp_state == linuxcnc.INTERP_PAUSED:
        machine.command.auto(linuxcnc.AUTO_RESUME)
    return machine.is_idle()


def write(path, layout, rows):
    with open(path, "w") as trace:
        trace.write(",".join(name for name, _, _ in columns(layout)) + "\n")
        trace.writelines(",".join(map(repr, row)) + "\n" for row in rows)


def discard(recorder):
    """Drops the recording so far; the machine's present position is kept."""
    rows = recorder.rows[0]
    del rows[:max(0, len(rows) - 1)]
