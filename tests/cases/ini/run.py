#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Runs every case of cases.toml with the real haltcl and the real module, in HAL without LinuxCNC.

    tests/cases/ini/run.py --pkm target/host/pkm [--only TEXT]

Loads `pkmkins`, with the load parameters of the case, and `motmod`. Then the installed pkmkins.tcl sets
the module up from the INI file of the case. If it refuses the file, its message must be that of
`pkm check`. However pkmkins-pins fails, the pins must keep their values. Prints one line per case and a
closing line; the exit code is 1 if any case fails.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
import tomllib
from itertools import groupby
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[2]
sys.path.insert(0, str(REPOSITORY / "tests/live"))
import ini_edit  # noqa: E402
from unprivileged import (clear_hal, is_unprivileged, lost_its_start, only_one,  # noqa: E402
                          rerun_unprivileged)

SCRIPT = Path("/usr/share/linuxcnc/hallib/pkmkins.tcl")
PROGRAM = "/usr/bin/pkmkins-pins"
HEADING = "pkmkins: LinuxCNC does not start, because the machine could not be set up:\n"
# rerun_unprivileged copies pkm to this place, where the unprivileged user can run it.
PKM = REPOSITORY / "given/pkm"
REALTIME = "/usr/lib/linuxcnc/realtime"
LOAD = """\
loadrt tpmod
loadrt homemod
loadrt {kinematics}
loadrt motmod servo_period_nsec=1000000 num_joints={joints}
addf motion-command-handler servo-thread
addf motion-controller servo-thread
"""


def run(*command, **options):
    return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          timeout=30, **options)


def halcmd(*arguments):
    return run("halcmd", *arguments, check=True).stdout


class Setup(NamedTuple):
    """What is loaded before an INI file is read: [KINS]KINEMATICS and the number of joints."""
    kinematics: str
    joints: str


class Case(NamedTuple):
    """One case: its keys as listed, the base file's text and the INI text of the case."""
    keys: dict
    shipped: str
    text: str

    @property
    def name(self):
        return self.keys["name"]

    @property
    def setup(self):
        # JOINTS of the base file: if the case has another number, pkmkins.tcl must say so.
        return Setup(setup_of(self.text).kinematics, setup_of(self.shipped).joints)


def setup_of(text):
    return Setup(ini_edit.value(text, "KINS", "KINEMATICS"), ini_edit.value(text, "KINS", "JOINTS"))


class Session:
    """HAL with the module loaded but not set up; `log` collects what the module prints.

    `loaded` is false if the module refused its load parameters.
    """

    def __init__(self, folder, setup):
        self.log = folder / "rtapi.log"
        self.folder = folder
        self.setup = setup

    def __enter__(self):
        (self.folder / "load.hal").write_text(LOAD.format(**self.setup._asdict()))
        try:
            self.load()
            if lost_its_start(self.log.read_text()):
                clear_hal()
                self.load()
            if not self.loaded and "pkmkins" not in self.log.read_text():
                sys.exit(f"tests/cases/ini: HAL could not be loaded: {self.log.read_text()}")
        except BaseException:
            clear_hal()
            raise
        return self

    def load(self):
        # The process that runs the realtime modules inherits these files and would keep a pipe open.
        with open(self.log, "w") as log:
            started = subprocess.run([REALTIME, "start"], stdin=subprocess.DEVNULL, stdout=log, stderr=log, timeout=30)
            done = subprocess.run(["halcmd", "-f", str(self.folder / "load.hal")],
                                  stdin=subprocess.DEVNULL, stdout=log, stderr=log, timeout=30)
        self.loaded = started.returncode == done.returncode == 0

    def __exit__(self, *_):
        clear_hal()

    def read_ini(self, text, script=SCRIPT, name="case.ini"):
        """Runs pkmkins.tcl on a file with this name and INI text, and returns the result."""
        ini = self.folder / name
        ini.parent.mkdir(exist_ok=True)
        ini.write_text(text)
        environment = {**os.environ, "INI_FILE_NAME": str(ini)}
        return run("haltcl", "-i", str(ini), str(script), env=environment)

    def frozen(self):
        """Gives the module time to freeze the geometry, and returns geometry-ok and geometry-hash."""
        halcmd("start")
        time.sleep(0.05)
        return halcmd("getp", "pkmkins.geometry-ok").strip() == "TRUE", geometry_hash()


def geometry_hash():
    return halcmd("getp", "pkmkins.geometry-hash").strip()


def all_pins():
    """Lists all pins of the module, to compare whether anything was set or connected."""
    return halcmd("-s", "show", "pin", "pkmkins.*")


def lacking(names, message):
    """Returns a complaint if the message lacks one of these names, else None."""
    absent = [name for name in names if name not in message]
    return f"the message lacks {absent}: {message.strip()!r}" if absent else None


def differing(session, message):
    """Returns a complaint if the message differs from that of `pkm check`, else None."""
    printed = run(str(PKM), "check", "--no-start", str(session.folder / "case.ini"))
    shown = message.partition(HEADING)[2].strip()
    # If `pkm check` can read the machine, it prints its findings to standard output, among other text.
    is_same = shown and (shown == printed.stderr.strip() or shown in printed.stdout)
    return None if is_same else f"LinuxCNC shows {message!r}, and pkm check {printed.stderr!r}"


def check_refused(session, case):
    """Returns why a case that must be refused fails, or None."""
    if not session.loaded:
        return lacking(case.keys["names"], session.log.read_text())
    before = all_pins()
    result = session.read_ini(case.text)
    if result.returncode == 0:
        return "was accepted"
    if all_pins() != before:
        return "refused, but pins have changed"
    return lacking(case.keys["names"], result.stderr) or differing(session, result.stderr)


def check_frozen(session, case, shipped):
    """Returns why a case that must be accepted fails, or None."""
    if not session.loaded:
        return f"the load parameters were refused: {session.log.read_text().strip()!r}"
    result = session.read_ini(case.text)
    if result.returncode != 0:
        return f"was refused: {result.stderr.strip()!r}"
    good, found = session.frozen()
    if not good:
        return f"geometry was refused: {session.log.read_text().strip()!r}"
    if "same" not in case.keys:
        return None
    if shipped is None:
        return "the base file is refused"
    if case.keys["same"] != (found == shipped):
        return f"geometry-hash is {found}, that of the shipped file {shipped}"
    return None


def listed_cases(only):
    listed = tomllib.loads((HERE / "cases.toml").read_text())
    for keys in listed["case"]:
        if only in keys["name"]:
            base = (REPOSITORY / keys.get("base", listed["base"])).read_text()
            keys.setdefault("expect", "error" if "names" in keys else "ok")
            yield Case(keys, base, ini_edit.edited(base, keys.get("edit", [])))


def report(name, reason):
    print(f"FAIL {name}: {reason}" if reason else f"PASS {name}", flush=True)
    return reason is None


def shipped_hash(folder, text):
    """Returns the geometry-hash of a base file, or None if the file is refused."""
    with Session(folder, setup_of(text)) as session:
        if not session.loaded or session.read_ini(text).returncode != 0:
            return None
        return session.frozen()[1]


def run_refused(folder, cases):
    """Runs the refused cases, in one session per set-up: a refused file must not change the module."""
    for setup, group in groupby(sorted(cases, key=lambda c: c.setup), key=lambda c: c.setup):
        with Session(folder, setup) as session:
            for case in group:
                yield report(case.name, check_refused(session, case))


def run_frozen(folder, cases):
    compared = {case.shipped for case in cases if "same" in case.keys}
    hashes = {text: shipped_hash(folder, text) for text in compared}
    for case in cases:
        with Session(folder, case.setup) as session:
            yield report(case.name, check_frozen(session, case, hashes.get(case.shipped)))


class Broken(NamedTuple):
    """A failure of pkmkins-pins: the shell script that replaces it, if any, and what the message must name."""
    script: str
    names: tuple
    mode: int = 0o755


# The script gets the arguments of pkmkins-pins; {0} stands for the real program.
BROKEN = {
    "missing": Broken("", ("No such file",)),
    "not executable": Broken("exit 0", ("Permission denied",), 0o644),
    "killed": Broken("kill -9 $$", ("kill",)),
    "crashed": Broken("echo panicked >&2; exit 101", ("panicked",)),
    "silent": Broken("exit 0", ("is incomplete",)),
    "a refusal without a word": Broken("exit 1", ("could not read",)),
    "without an end": Broken('{0} "$1" | head -n 100', ("is incomplete",)),
    "a command for a value": Broken('{0} "$1" | sed "s/^pin home.x .*/pin home.x [exit 0]/"', ("[exit 0]",)),
    "too slow": Broken("sleep 20", ("sending signal TERM",)),
    "another value": Broken('{0} "$1" | sed "s/^ini TRAJ HOME=.*/ini TRAJ HOME=1 2 3/"', ("changed while", "HOME")),
}

# Characters that are special to Tcl, a shell or `exec`.
STRANGE = "a b $HOME [exit 3] {x \"q' \\n ~ ; |cat <x >y"


def check_broken(session, text, broken):
    """Returns what is wrong with the reaction to a failing pkmkins-pins, or None."""
    beside = session.folder / "beside"
    beside.mkdir(exist_ok=True)
    program, script = beside / "pkmkins-pins", beside / SCRIPT.name
    program.unlink(missing_ok=True)
    if broken.script:
        program.write_text(f"#!/bin/sh\n{broken.script.replace('{0}', PROGRAM)}\n")
        program.chmod(broken.mode)
    script.write_text(SCRIPT.read_text().replace(PROGRAM, str(beside / "nowhere"))
                      .replace("longest 10", "longest 1"))
    before = all_pins()
    result = session.read_ini(text, script)
    if result.returncode == 0:
        return "was accepted"
    if all_pins() != before:
        return "refused, but pins have changed"
    return lacking((HEADING, *broken.names), result.stderr)


def check_strange(session, text):
    """Returns why a file in a folder with a strange name is not read, or None."""
    result = session.read_ini(text, name=f"{STRANGE}/{STRANGE}.ini")
    return f"was refused: {result.stderr!r}" if result.returncode != 0 else None


def run_programs(folder, only):
    """Runs the failures of pkmkins-pins, then an INI file whose name must not be evaluated."""
    text = (REPOSITORY / "configs/hexapod/hexapod.ini").read_text()
    with Session(folder, setup_of(text)) as session:
        for name, broken in BROKEN.items():
            if only in name:
                yield report(f"pkmkins-pins: {name}", check_broken(session, text, broken))
        if only in STRANGE:
            yield report(f"a file {STRANGE}", check_strange(session, text))


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--only", default="", help="run the cases whose name contains this")
    arguments.add_argument("--pkm", required=True, help="the command, whose messages are compared")
    options = arguments.parse_args()
    only = options.only
    if not is_unprivileged():
        return rerun_unprivileged("tests/cases/ini/run.py", ["--only", only, "--pkm", options.pkm], timeout=300,
                                  given=(options.pkm,))
    with only_one(), tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        cases = list(listed_cases(only))
        refused = [case for case in cases if case.keys["expect"] != "ok"]
        others = [case for case in cases if case.keys["expect"] == "ok"]
        results = [*run_refused(folder, refused), *run_frozen(folder, others), *run_programs(folder, only)]
    print(f"{sum(results)} passed, {len(results) - sum(results)} failed")
    return 0 if results and all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
