#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Every case of cases.toml through the real haltcl and the real module, in HAL alone.

    tests/ini/run.py [--only TEXT]

LinuxCNC itself is not started: `pkmkins` and `motmod` are loaded and pkmkins.tcl, as installed,
reads the INI file of the case. Prints one line a case and a closing line; exit code 1 if any fails.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "live"))
import ini_edit  # noqa: E402
from unprivileged import clear_hal, is_unprivileged, only_one, rerun_unprivileged  # noqa: E402

REPOSITORY = HERE.parents[1]
SCRIPT = "/usr/share/linuxcnc/hallib/pkmkins.tcl"
REALTIME = "/usr/lib/linuxcnc/realtime"
LOAD = """\
loadrt tpmod
loadrt homemod
loadrt pkmkins legs=strut:6
loadrt motmod servo_period_nsec=1000000 num_joints=6
addf motion-command-handler servo-thread
addf motion-controller servo-thread
"""


def run(*command, **options):
    return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          timeout=30, **options)


def halcmd(*arguments):
    return run("halcmd", *arguments, check=True).stdout


class Session:
    """A HAL with the module loaded and not yet set up; `log` collects what the module prints."""

    def __init__(self, folder):
        self.log = folder / "rtapi.log"
        self.folder = folder

    def __enter__(self):
        clear_hal()
        (self.folder / "load.hal").write_text(LOAD)
        # The process that runs the realtime modules inherits these files, hence no pipes here.
        with open(self.log, "w") as log:
            subprocess.run([REALTIME, "start"], stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                           check=True, timeout=30)
            subprocess.run(["halcmd", "-f", str(self.folder / "load.hal")], check=True,
                           stdin=subprocess.DEVNULL, stdout=log, stderr=log, timeout=30)
        return self

    def __exit__(self, *_):
        clear_hal()

    def read_ini(self, text):
        """Result of pkmkins.tcl for this INI text."""
        ini = self.folder / "case.ini"
        ini.write_text(text)
        environment = {**os.environ, "INI_FILE_NAME": str(ini)}
        return run("haltcl", "-i", str(ini), SCRIPT, env=environment)

    def frozen(self):
        """geometry-ok and geometry-hash after the module had time to freeze the geometry."""
        halcmd("start")
        time.sleep(0.05)
        return halcmd("getp", "pkmkins.geometry-ok").strip() == "TRUE", geometry_hash()


def geometry_hash():
    return halcmd("getp", "pkmkins.geometry-hash").strip()


def all_pins():
    """Text of all pins of the module, to see whether anything was set or connected."""
    return halcmd("-s", "show", "pin", "pkmkins.*")


def missing(names, text):
    return [name for name in names if name not in text]


def check_error(session, case, text):
    """Reason why a case that must be refused fails, or None."""
    before = all_pins()
    result = session.read_ini(text)
    if result.returncode == 0:
        return "was accepted"
    absent = missing(case["names"], result.stderr)
    if absent:
        return f"the message lacks {absent}: {result.stderr.strip()!r}"
    if all_pins() != before:
        return "refused, but pins have changed"
    return None


def check_frozen(session, case, text, shipped):
    """Reason why a case that reaches the module fails, or None."""
    result = session.read_ini(text)
    if result.returncode != 0:
        return f"was refused: {result.stderr.strip()!r}"
    good, found = session.frozen()
    if case["expect"] == "bad geometry":
        absent = missing(case["names"], session.log.read_text())
        return "geometry was accepted" if good else f"the message lacks {absent}" if absent else None
    if not good:
        return f"geometry was refused: {session.log.read_text().strip()!r}"
    if "same" in case and case["same"] != (found == shipped):
        return f"geometry-hash is {found}, that of the shipped file {shipped}"
    return None


def cases_with_text(only):
    listed = tomllib.loads((HERE / "cases.toml").read_text())
    base = (REPOSITORY / listed["base"]).read_text()
    for case in listed["case"]:
        if only in case["name"]:
            yield case, ini_edit.edited(base, case.get("edit", []))


def report(case, reason):
    print(f"FAIL {case['name']}: {reason}" if reason else f"PASS {case['name']}", flush=True)
    return reason is None


def shipped_hash(folder):
    listed = tomllib.loads((HERE / "cases.toml").read_text())
    with Session(folder) as session:
        result = session.read_ini((REPOSITORY / listed["base"]).read_text())
        if result.returncode != 0:
            sys.exit(f"tests/ini: the base file is refused: {result.stderr}")
        return session.frozen()[1]


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--only", default="", help="run the cases whose name contains this")
    only = arguments.parse_args().only
    if not is_unprivileged():
        return rerun_unprivileged("tests/ini/run.py", ["--only", only], timeout=300)
    with only_one(), tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        cases = list(cases_with_text(only))
        results = []
        # A refused file must leave the module as it was, so all of them share one session.
        with Session(folder) as session:
            for case, text in cases:
                if case["expect"] == "error":
                    results.append(report(case, check_error(session, case, text)))
        shipped = shipped_hash(folder)
        for case, text in cases:
            if case["expect"] != "error":
                with Session(folder) as session:
                    results.append(report(case, check_frozen(session, case, text, shipped)))
    print(f"{sum(results)} passed, {len(results) - sum(results)} failed")
    return 0 if results and all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
