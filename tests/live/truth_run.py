# SPDX-License-Identifier: GPL-2.0-or-later
"""What LinuxCNC makes of programs, for `truth.py`: where it stops, what it says, how fast joints get."""

import linuxcnc

from machine import AXES, Failure
from recorder import Recorder

PERIOD_NS = 1_000_000
START_SECONDS = 5
# Cycles left out about a tool change at a tilt, in which pkmkins moves the joints: the interpolator of
# LinuxCNC answers two cycles late and over three.
AROUND_TOOL_CHANGES = 5


def columns(layout):
    return [("line", "motion.program-line", "s32"), ("enabled", "motion.motion-enabled", "bit"),
            ("busy", "pkmkins.tool-busy", "bit"),
            *((letter, f"axis.{letter}.pos-cmd", "float") for letter in AXES),
            *((f"p{n}", f"joint.{n}.pos-cmd", "float") for n in layout.joints)]


def truth(machine, out, programs, before, keep=False):
    """Runs programs one after another from home, up to the first that LinuxCNC stops; `keep`: with what
    was recorded of each."""
    recorder = Recorder(machine.component, columns(machine.layout), PERIOD_NS)
    machine.start()
    recorder.start()
    home = " ".join(f"{letter.upper()}{value}" for letter, value in zip(AXES, machine.layout.home)
                    if letter in machine.layout.letters)
    outcomes = {}
    for name, path, seconds in programs:
        outcomes[name], rows = observed(machine, recorder, path, seconds)
        if keep:
            write(out / f"{name}.csv", machine.layout, rows)
        if outcomes[name]["errors"]:
            break
        for block in (*before, f"G53 G0 {home}"):
            machine.mdi(block)
        machine.pause(0.2)
    recorder.stop()
    return {"outcomes": outcomes}


def observed(machine, recorder, path, seconds):
    """One program to its end, or to where LinuxCNC stops it."""
    machine.pause(0.1)
    first = discard(recorder)
    del machine.messages[:]
    machine.set_mode(linuxcnc.MODE_AUTO)
    machine.command.program_open(path)
    machine.command.auto(linuxcnc.AUTO_RUN, 0)
    machine.wait(lambda: machine.stat.interp_state != linuxcnc.INTERP_IDLE or machine.error_texts(),
                 START_SECONDS, "start of the program")
    ended = True
    try:
        machine.wait(machine.is_idle, seconds, "end of the program")
    except Failure:
        ended = False
        machine.command.abort()
    machine.pause(0.3)
    rows = recorder.rows[0][:recorder.samples()]
    errors = machine.error_texts()
    if not ended:
        errors.append(f"not at its end after {seconds} s")
    found = {"errors": errors, "fault": machine.get("pkmkins.fault-count"), "first": first,
             **figures(rows, len(machine.layout.joints), recorder.period)}
    return found, rows


def write(path, layout, rows):
    with open(path, "w") as trace:
        trace.write(",".join(name for name, _, _ in columns(layout)) + "\n")
        trace.writelines(",".join(map(repr, row)) + "\n" for row in rows)


def discard(recorder):
    """Forgets what was recorded so far; the place where the machine stands is kept."""
    rows = recorder.rows[0]
    del rows[:max(0, len(rows) - 1)]
    return list(rows[0][3:9]) if rows else []


def figures(rows, joints, period):
    """Peaks of the joints while the machine was on, with their lines, and the line that moved last."""
    lines, enabled, busy = ([row[n] for row in rows] for n in range(3))
    last = enabled.index(False) if False in enabled else len(rows)
    quiet = [True] * last
    for n in (n for n in range(last) if busy[n]):
        for k in range(max(0, n - AROUND_TOOL_CHANGES), min(last, n + AROUND_TOOL_CHANGES)):
            quiet[k] = False
    moving = [n for n in range(1, last) if rows[n][3:9] != rows[n - 1][3:9]]
    found = {"stopped_line": lines[moving[-1]] if moving else 0, "switched_off": last < len(rows),
             "seconds": round(len(moving) * period, 3), "speed": [], "acceleration": [], "low": [], "high": []}
    for joint in range(joints):
        place = [row[9 + joint] for row in rows[:last]]
        speed = [(b - a) / period for a, b in zip(place, place[1:])]
        steps = [n for n in range(1, len(speed)) if quiet[n] and quiet[n + 1]]
        fastest = max(steps, key=lambda n: abs(speed[n]), default=None)
        hardest = max(steps, key=lambda n: abs(speed[n] - speed[n - 1]), default=None)
        found["speed"].append([abs(speed[fastest]), lines[fastest]] if steps else [0, 0])
        found["acceleration"].append(
            [abs(speed[hardest] - speed[hardest - 1]) / period, lines[hardest]] if steps else [0, 0])
        found["low"].append(min(place))
        found["high"].append(max(place))
    return found
