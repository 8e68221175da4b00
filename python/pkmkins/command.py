# SPDX-License-Identifier: GPL-2.0-or-later
"""Functions that need LinuxCNC or measurement files, like subcommands of `pkm`: `pkm help reference/json`."""

import argparse
import json
import os
import shutil
import subprocess

from ._core import CommandFailed
from ._core import preflight as preflight_json


def preflight(machine, program, *options):
    """Checks whether a program fits a machine: returns the answer of `pkm preflight --format json` as a dictionary.

    `machine` and `program` are files, `options` further words of the command line, except --report. `fits` is True,
    False, or None if that could not be judged.
    """
    parser = argparse.ArgumentParser(add_help=False, exit_on_error=False, argument_default=argparse.SUPPRESS)
    parser.add_argument("--mechanism", type=int, choices=(1, 2), default=None)
    parser.add_argument("--trace", default=None)
    parser.add_argument("--hal", action="append")
    parser.add_argument("--unconfined", action="store_true")
    parser.add_argument("--most-moves", type=int)
    parser.add_argument("--most-time", type=float, dest="most_seconds")
    parser.add_argument("--most-standstill", type=float)
    parser.add_argument("--patience", type=float, dest="most_work")
    try:
        given, unknown = parser.parse_known_args(list(map(str, options)))
    except argparse.ArgumentError as error:
        raise CommandFailed(str(error)) from None
    if unknown:
        raise CommandFailed(f"{unknown[0]}: not an option of preflight in Python; use the command pkm")
    given = vars(given)
    answer = preflight_json(machine, program, given.pop("mechanism"), given.pop("trace"), json.dumps(given))
    return {"version": 1, "command": "preflight", **json.loads(answer), "errors": []}


def calibrate(machine, *files):
    """Calibrates the geometry from measurements: returns the answer of `pkm calibrate --format json` as a dictionary.

    `files` are logs, tables of readings, and further words of the command line, such as
    `"--plate", "plate.toml", "--write", "new.ini"`.
    """
    return asked("calibrate", machine, *files)


def pkm():
    """Returns the path of `pkm`: from the environment variable PKM, or the one in PATH."""
    found = os.environ.get("PKM") or shutil.which("pkm")
    if not found:
        raise CommandFailed("the command pkm is not in PATH: install it, or set the variable PKM")
    return found


def asked(*words):
    """Returns the answer of a subcommand of `pkm` as a dictionary, as `pkm help reference/json` describes it."""
    run = subprocess.run([pkm(), "--format", "json", *map(str, words)], capture_output=True, text=True)
    try:
        answer = json.loads(run.stdout)
    except json.JSONDecodeError:
        answer = None
    # Exit status 1 is an answer as well: the machine or program does not fit. So is 2 if something was not judged.
    if answer is None or answer.get("errors"):
        said = "\n".join(answer["errors"]) if answer else run.stderr.strip()
        raise CommandFailed(said or f"pkm ended with {run.returncode}")
    return answer
