#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Writes the pins and status of a running LinuxCNC with pkmkins, as objects of JSON.

    pkmkins_pins.py MACHINE.ini

writes one object per line, 25 per second, to standard output, until LinuxCNC or the reader of that output
ends; `pkm help reference/view` lists the fields. Without a running LinuxCNC it ends at once. It has a HAL component
without pins, named pkm-live and the number of the process. LinuxCNC ends it like its other components, so that a
program that outlives LinuxCNC must start it as a separate process. It reads pins by name, writes nothing into HAL,
and takes no message from LinuxCNC's operator interface.
"""

import json
import math
import os
import signal
import sys
import time

sys.path.append(os.path.dirname(os.path.realpath(__file__)))
from pkmkins_refusal import count_legs, sentence  # noqa: E402

PERIOD = 0.04

LETTERS = "xyzabc"

# LinuxCNC's task, unless the INI file names another one, and the program of its real-time part.
TASK = "milltask"
REALTIME = "rtapi_app"

# Key of HAL's shared memory, which LinuxCNC in virtual time and in another container do not share.
HAL_KEY = str(0x48414C32)

# Linux truncates the names of processes to this length.
NAME = 15


class NotAMachine(Exception):
    """An INI file without a machine of pkmkins, with the reason."""


class Machine:
    """The joints, pins and LinuxCNC processes of an INI file."""

    def __init__(self, file):
        words, ini = read(file)
        given = dict(word.partition("=")[::2] for word in words[1:] if "=" in word)
        legs = given.get("legs", "strut:6").split(",")
        try:
            count = sum(int(group.split(":")[1]) for group in legs) + len(given.get("table", ""))
        except (IndexError, ValueError):
            raise NotAMachine(f"{file}: [KINS]KINEMATICS: legs={given.get('legs')}") from None
        self.joints = range(count)
        self.extra = {letter.lower(): count + k for k, letter in enumerate(given.get("axes", ""))}
        self.nml = ini.get(("EMC", "NML_FILE"))
        self.task = os.path.basename(ini.get(("TASK", "TASK"), TASK).split()[0])[:NAME]


def read(file):
    """Returns the words of [KINS]KINEMATICS, and the first value of each section and key."""
    values, section = {}, ""
    try:
        with open(file, encoding="utf-8", errors="replace") as lines:
            for line in map(str.strip, lines):
                if line.startswith("[") and "]" in line:
                    section = line[1:line.index("]")]
                elif "=" in line and line[0] not in "#;":
                    key, value = map(str.strip, line.split("=", 1))
                    values.setdefault((section, key), value)
    except OSError as error:
        raise NotAMachine(f"{file}: {error.strerror}") from error
    words = values.get(("KINS", "KINEMATICS"), "").split()
    if words[:1] != ["pkmkins"]:
        raise NotAMachine(f"{file}: [KINS]KINEMATICS: expected pkmkins; found {' '.join(words) or 'nothing'}")
    return words, values


def process_of(name):
    """Returns the number of a process with this name, or None."""
    for number in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{number}/comm", encoding="utf-8") as file:
                if file.read().strip() == name and not is_dead(number):
                    return number
        except OSError:
            pass
    return None


def is_dead(number):
    """Returns whether a process is gone, or waits for its parent to read its exit status."""
    try:
        with open(f"/proc/{number}/stat", encoding="utf-8") as file:
            return file.read().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True


def running(machine):
    """Returns the numbers of LinuxCNC's processes if it runs, or None."""
    try:
        with open("/proc/sysvipc/shm", encoding="utf-8") as segments:
            if not any(words[:1] == [HAL_KEY] for words in map(str.split, segments)):
                return None
    except OSError:
        return None
    processes = [process_of(name) for name in (REALTIME, machine.task)]
    return None if None in processes else processes


class Values:
    """The present values of HAL and LinuxCNC's status; None if unknown."""

    def __init__(self, machine, value, status):
        self.machine, self.value, self.status = machine, value, status

    def pin(self, name):
        try:
            value = self.value(name)
        except RuntimeError:
            return None
        return value if math.isfinite(value) else None

    def pins(self, names):
        """Returns all of them, or None if one is missing: half a pose is useless."""
        values = [self.pin(name) for name in names]
        return None if None in values else values

    def fault(self):
        code, leg = self.pin("pkmkins.fault"), self.pin("pkmkins.fault-leg")
        return sentence(code, -1 if leg is None else leg, count_legs(self.value)) if code else None

    def now(self):
        machine, code = self.machine, self.pin("pkmkins.geometry-hash")
        extra = {letter: self.pin(f"joint.{number}.pos-fb") for letter, number in machine.extra.items()}
        return {"state": "running",
                "pose": self.pins([f"pkmkins.{letter}" for letter in LETTERS]),
                "joints": self.pins([f"joint.{number}.pos-fb" for number in machine.joints]),
                "extra": extra,
                "tool": self.pins([f"pkmkins.tool-offset-eff-{letter}" for letter in "xyz"]),
                "geometry_hash": None if code is None else code & 0xFFFFFFFF,
                "fault": self.fault(), **self.status()}


def status_reader(linuxcnc):
    """Returns a function that reads LinuxCNC's status."""
    names = {"mode": ("MODE_MANUAL", "MODE_AUTO", "MODE_MDI"),
             "task state": ("STATE_ESTOP", "STATE_ESTOP_RESET", "STATE_OFF", "STATE_ON"),
             "interpreter": ("INTERP_IDLE", "INTERP_READING", "INTERP_PAUSED", "INTERP_WAITING")}
    texts = {field: {getattr(linuxcnc, name): name.partition("_")[2].lower().replace("_", " ") for name in own}
             for field, own in names.items()}
    nothing = dict.fromkeys(("line", "file", "feed", *texts))
    channel = []

    def read_status():
        try:
            if not channel:
                channel.append(linuxcnc.stat())
            stat = channel[0]
            stat.poll()
        # SystemError: LinuxCNC belongs to another user, whose tool table is not found.
        except (linuxcnc.error, SystemError):
            channel.clear()
            return nothing
        feed = stat.current_vel
        return {"line": stat.motion_line, "file": os.path.basename(stat.file) or None,
                "feed": feed if math.isfinite(feed) else None,
                "mode": texts["mode"].get(stat.task_mode),
                "task state": texts["task state"].get(stat.task_state),
                "interpreter": texts["interpreter"].get(stat.interp_state)}

    return read_status


def follow(machine, processes):
    """Writes the present values, until one of LinuxCNC's processes or the reader ends."""
    import hal
    import linuxcnc

    # LinuxCNC's library writes to standard output.
    out = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    component = hal.component(f"pkm-live-{os.getpid()}")
    # LinuxCNC ends its components with it; an interrupt is for the process that started both.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        component.ready()
        if machine.nml:
            linuxcnc.nmlfile = machine.nml
        values = Values(machine, hal.get_value, status_reader(linuxcnc))
        due = time.monotonic()
        while not any(map(is_dead, processes)):
            out.write(json.dumps(values.now(), allow_nan=False) + "\n")
            out.flush()
            due = max(due + PERIOD, time.monotonic())
            time.sleep(max(0, due - time.monotonic()))
    except BrokenPipeError:
        # Suppress the output at exit too.
        os.dup2(os.open(os.devnull, os.O_WRONLY), out.fileno())
    finally:
        component.exit()


def main():
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit(__doc__)
    try:
        machine = Machine(sys.argv[1])
    except NotAMachine as reason:
        sys.exit(f"pkmkins_pins: {reason}")
    processes = running(machine)
    # Without LinuxCNC a HAL component would create its own HAL, in which LinuxCNC would start.
    if processes is not None:
        follow(machine, processes)


if __name__ == "__main__":
    main()
