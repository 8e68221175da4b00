# SPDX-License-Identifier: GPL-2.0-or-later
"""Programs run by LinuxCNC in virtual time, for `truth.py`, with results in the form of truth_run.py."""

import json
import re
import subprocess

import ini_edit
import traces

# A message in the output of `pkm run`, after the file's name.
MESSAGE = re.compile(r"(?:line (\d+), [\d.]+ s|reading line \d+, before the first move): (error: )?(.*)", re.DOTALL)


def judged(pkm, ini, program, trace):
    """Returns LinuxCNC's result for a program, and preflight's verdict; `trace` gets every servo cycle."""
    flight = preflight(pkm, ini, program, trace)
    timing = flight.get("time", {}).get("judged")
    if timing is None:
        # Preflight did not run it, but its verdict is still judged.
        return {"outcome": run(pkm, ini, program, trace), "flight": flight}
    errors = [(shown["text"].strip(), shown["line"]) for shown in timing["messages"] if shown["kind"] == "error"]
    return {"outcome": outcome(ini, trace, errors, timing["ending"] == "finished"), "flight": flight}


def outcome(ini, trace, errors, is_ended):
    """Returns the outcome of a run with these messages and the lines of the motion then."""
    text = ini.read_text()
    joints = int(ini_edit.value(text, "KINS", "JOINTS"))
    period = 1e-9 * float(ini_edit.value(text, "EMCMOT", "SERVO_PERIOD"))
    found = {"errors": [text for text, _ in errors], "ended": is_ended,
             **traces.figures(traces.virtual(trace, joints, has_poses=False), period)}
    if errors:
        # If the drives are off, the command follows them: the message has the line of the motion before.
        found["stopped_line"] = errors[0][1]
    return found


def run(pkm, ini, program, trace):
    """Returns LinuxCNC's result for a program, by a run alone."""
    command = [pkm, "run", ini, program, "--trace", trace]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        return {"failed": done.stderr.strip()}
    # A message may have several lines; each message begins with the name of the program.
    shown = [MESSAGE.match(text) for text in done.stdout.split(f"{program}: ")]
    errors = [(found[3].strip(), int(found[1] or 0)) for found in shown if found and found[2]]
    return outcome(ini, trace, errors, done.returncode == 0)


def preflight(pkm, ini, program, trace):
    """Returns preflight's verdict on it."""
    done = subprocess.run([pkm, "preflight", ini, program, "--format", "json", "--trace", trace],
                          stdin=subprocess.DEVNULL, capture_output=True, text=True)
    return json.loads(done.stdout) if done.stdout else {"refused": done.stderr.strip()}
