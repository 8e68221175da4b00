#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Tests every pin of the module through halcmd, with the load parameters of every configuration.

    tests/live/pins_test.py [--only TEXT]

HAL alone runs, of the LinuxCNC that is first in PATH. Each input is set to several values with
`setp`, and again through a signal; an output cannot be set, and a signal shows its
value. Finally the module's reaction to signals is tested. Prints a line for each set of load
parameters and a closing line; exit code 1 if any fails.
"""

import argparse
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parent))
import ini_edit  # noqa: E402
from unprivileged import (REPOSITORY, clear_hal, is_unprivileged, lost_its_start, only_one,  # noqa: E402
                          rerun_unprivileged)

# Numbers that halcmd prints in full.
VALUES = {
    "float": ["-1234.5", "1.5e+20", "0.03125", "0"],
    "bit": ["TRUE", "FALSE"],
    "u32": ["4294967295", "305419896", "0"],
    "s32": ["-2147483648", "2147483647", "0"],
}
PATTERNS = ("pkmkins.*", "kinstype.*", "skgui.*")
# Direction words of pins, and of writable parameters.
INPUTS, OUTPUTS = ("IN", "I/O", "RW"), ("OUT", "RO")


class Pin(NamedTuple):
    """A pin or a parameter."""
    kind: str
    direction: str
    name: str


class Wrong(Exception):
    """A deviation from the expected behavior of a pin."""


class Hal:
    """HAL with the module loaded, and its monitor in a thread that does not run yet."""

    def __init__(self, folder, kinematics):
        self.folder = folder
        self.load = [f"loadrt {kinematics}", "loadrt threads name1=servo period1=1000000",
                     "addf pkmkins.monitor servo"]

    def __enter__(self):
        code, lines = self.tried(self.load)
        if code != 0 and lost_its_start("\n".join(lines)):
            clear_hal()
            code, lines = self.tried(self.load)
        if code != 0:
            clear_hal()
            raise Wrong(f"halcmd: {' | '.join(lines[-3:])}")
        return self

    def __exit__(self, *_):
        clear_hal()

    def tried(self, commands):
        """Returns the exit code of halcmd and its output lines."""
        script, out = self.folder / "script.hal", self.folder / "out"
        script.write_text("\n".join(commands) + "\n")
        # The process that runs the realtime modules inherits the file; a pipe would stay open.
        with open(out, "w") as written:
            done = subprocess.run(["halcmd", "-s", "-f", str(script)], stdin=subprocess.DEVNULL, stdout=written,
                                  stderr=written, timeout=60)
        return done.returncode, out.read_text().splitlines()

    def answers(self, commands):
        """Returns the output lines of commands, none of which may fail."""
        code, lines = self.tried(commands)
        if code != 0:
            raise Wrong(f"halcmd: {' | '.join(lines[-3:])}")
        return lines

    def listed(self, what, first):
        """Returns pins or parameters of the module, whose lines have `first` words before the type."""
        found = []
        for pattern in PATTERNS:
            for line in self.answers([f"show {what} {pattern}"]):
                words = line.split()
                if len(words) > first + 3:
                    found.append(Pin(words[first].lower(), words[first + 1], words[first + 3]))
        return found


def is_same(kind, one, other):
    return float(one) == float(other) if kind == "float" else one == other


def compared(pins, wanted, found, what):
    if len(found) != len(pins):
        raise Wrong(f"{what}: {len(found)} answers for {len(pins)} pins: {found[:3]}")
    for pin, value, answer in zip(pins, wanted, found):
        if not is_same(pin.kind, value, answer.strip()):
            raise Wrong(f"{what}: {pin.name} was given {value} and shows {answer.strip()}")


def values_of(pins, turn):
    return [VALUES[pin.kind][turn % len(VALUES[pin.kind])] for pin in pins]


def check_inputs(hal, pins, is_netted):
    """Checks every value, by setp or by signals that the pins are netted with."""
    set_, places = "setp", [pin.name for pin in pins]
    if is_netted:
        set_, places = "sets", [f"s{i}" for i in range(len(pins))]
        hal.answers([f"net {place} {pin.name}" for place, pin in zip(places, pins)])
    for turn in range(max(map(len, VALUES.values()))):
        wanted = values_of(pins, turn)
        hal.answers([f"{set_} {place} {value}" for place, value in zip(places, wanted)])
        compared(pins, wanted, hal.answers([f"getp {pin.name}" for pin in pins]), set_)


def check_outputs(hal, pins):
    """Checks that no output can be set, and that a signal shows the same value as the pin."""
    shown = hal.answers([f"getp {pin.name}" for pin in pins])
    for pin in pins:
        if hal.tried([f"setp {pin.name} {VALUES[pin.kind][0]}"])[0] == 0:
            raise Wrong(f"{pin.name} is an output and was set")
    places = [f"o{i}" for i in range(len(pins))]
    hal.answers([f"net {place} {pin.name}" for place, pin in zip(places, pins)])
    compared(pins, shown, hal.answers([f"gets {place}" for place in places]), "signals of outputs")


def check(folder, kinematics):
    """Checks a set of load parameters; returns a description."""
    with Hal(folder, kinematics) as hal:
        pins, parameters = hal.listed("pin", 1), hal.listed("param", 1)
        unknown = [pin for pin in pins + parameters
                   if pin.kind not in VALUES or pin.direction not in INPUTS + OUTPUTS]
        if unknown or not pins:
            raise Wrong(f"cannot be read: {unknown[:3]}")
        inputs = [pin for pin in pins if pin.direction in INPUTS]
        check_inputs(hal, inputs, False)
        writable = [pin for pin in parameters if pin.direction in INPUTS]
        if writable:
            check_inputs(hal, writable, False)
        check_inputs(hal, inputs, True)
        outputs = [pin for pin in pins if pin.direction in OUTPUTS and not pin.name.startswith("pkmkins.monitor.")]
        check_outputs(hal, outputs)
    return f"{len(inputs)} inputs, {len(outputs)} outputs, {len(writable)} parameters"


def check_answers(folder):
    """Checks the module's reaction to signals."""
    netted = {"apply": "pkmkins.apply", "length": "pkmkins.tool-offset-x"}
    with Hal(folder, "pkmkins") as hal:
        hal.answers([f"net {signal} {pin}" for signal, pin in netted.items()])
        hal.answers(["net good pkmkins.geometry-ok", "net effective pkmkins.tool-offset-eff-x"])
        hal.answers(["sets length 1.5", "sets apply TRUE", "start"])
        time.sleep(0.1)
        found = hal.answers(["gets good", "gets effective", "getp pkmkins.fault-leg", "getp pkmkins.limit-iterations"])
        if [line.strip() for line in found] != ["TRUE", "1.5", "-1", "120"]:
            raise Wrong(f"the module answered {found}")
    return "a bit and a float through signals, an s32 below 0, a u32"


def cases(only):
    """Returns the checks by name: each set of load parameters once."""
    found = {}
    for ini in sorted((REPOSITORY / "configs").glob("*/*.ini")):
        kinematics = ini_edit.value(ini.read_text(), "KINS", "KINEMATICS")
        if re.match(r"pkmkins\b", kinematics):
            found.setdefault(kinematics, lambda folder, given=kinematics: check(folder, given))
    found["signals and the module"] = check_answers
    return {name: case for name, case in found.items() if only in name}


def passes(folder, name, case):
    try:
        print(f"PASS {name}: {case(folder)}", flush=True)
        return True
    except (Wrong, subprocess.TimeoutExpired) as error:
        print(f"FAIL {name}: {error}", flush=True)
        return False


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--only", default="", help="the sets of load parameters that contain this")
    only = arguments.parse_args().only
    if not is_unprivileged():
        return rerun_unprivileged("tests/live/pins_test.py", ["--only", only], timeout=300)
    with only_one(), tempfile.TemporaryDirectory() as temporary:
        results = [passes(Path(temporary), name, case) for name, case in cases(only).items()]
    print(f"{sum(results)} passed, {len(results) - sum(results)} failed")
    return 0 if results and all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
