# SPDX-License-Identifier: GPL-2.0-or-later
"""What needs LinuxCNC or files of measurements: the command `pkm`, whose answers docs/json.md describes."""

import json
import os
import shutil
import subprocess
from pathlib import Path


class CommandFailed(RuntimeError):
    """`pkm` is missing, or ended without an answer (exit status 2); the text is what it said."""


def preflight(machine, program, *options):
    """Whether a program fits a machine: the answer of `pkm preflight --format json` as a dictionary.

    `machine` and `program` are files, `options` further words of the command line. `fits` is True, False,
    or None where that could not be judged.
    """
    return asked("preflight", machine, program, *options)


def calibrate(machine, *files):
    """The geometry that measurements tell: the answer of `pkm calibrate --format json` as a dictionary.

    `files` are logs, tables of readings, and further words of the command line, such as
    `"--plate", "plate.toml", "--write", "new.ini"`.
    """
    return asked("calibrate", machine, *files)


def pkm():
    """The command `pkm`: that of the environment variable PKM, or the one in PATH."""
    found = os.environ.get("PKM") or shutil.which("pkm")
    if not found:
        raise CommandFailed("the command pkm is not in PATH: install it, or name it in the variable PKM")
    return found


def asked(*words):
    """The answer of a subcommand of `pkm` as a dictionary, as docs/json.md describes it."""
    words = [os.fspath(word) if isinstance(word, Path) else str(word) for word in words]
    run = subprocess.run([pkm(), "--format", "json", *words], capture_output=True, text=True)
    try:
        answer = json.loads(run.stdout)
    except json.JSONDecodeError:
        answer = None
    # 1 is an answer as well: what was asked about does not fit. So is 2 where something was not judged.
    if answer is None or answer.get("errors"):
        said = "\n".join(answer["errors"]) if answer else run.stderr.strip()
        raise CommandFailed(said or f"pkm ended with {run.returncode}")
    return answer
