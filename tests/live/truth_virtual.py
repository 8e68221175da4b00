# SPDX-License-Identifier: GPL-2.0-or-later
"""Programs run by LinuxCNC in virtual time, for `truth.py`, told as truth_run.py tells live ones."""

import json
import re
import subprocess

import ini_edit
import traces

# Of a message in what `pkm run` prints, after the file's name.
MESSAGE = re.compile(r"(?:line (\d+), [\d.]+ s|reading line \d+, before the first move): (error: )?(.*)", re.DOTALL)


def run(pkm, ini, program, trace):
    """What LinuxCNC made of a program; `trace` gets every servo cycle."""
    command = [pkm, "run", ini, program, "--trace", trace]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        return {"failed": done.stderr.strip()}
    # A message may have several lines; each begins with the name of the program.
    told = [MESSAGE.match(text) for text in done.stdout.split(f"{program}: ")]
    errors = [(found[3].strip(), int(found[1] or 0)) for found in told if found and found[2]]
    text = ini.read_text()
    joints = int(ini_edit.value(text, "KINS", "JOINTS"))
    period = 1e-9 * float(ini_edit.value(text, "EMCMOT", "SERVO_PERIOD"))
    found = {"errors": [text for text, _ in errors], "ended": done.returncode == 0,
             **traces.figures(traces.virtual(trace, joints), period)}
    if errors:
        # Drives that are off make the command follow them: the message knows what moved before.
        found["stopped_line"] = errors[0][1]
    return found


def preflight(pkm, ini, program):
    """What preflight says of it."""
    done = subprocess.run([pkm, "preflight", ini, program, "--format", "json"], stdin=subprocess.DEVNULL,
                          capture_output=True, text=True)
    return json.loads(done.stdout) if done.stdout else {"refused": done.stderr.strip()}
