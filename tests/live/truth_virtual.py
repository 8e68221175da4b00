# SPDX-License-Identifier: GPL-2.0-or-later
"""Programs run by LinuxCNC in virtual time, for `truth.py`, told as truth_run.py tells live ones."""

import json
import re
import subprocess

import ini_edit
import traces

# Of a message in what `pkm run` prints, after the file's name.
MESSAGE = re.compile(r"(?:line (\d+), [\d.]+ s|reading line \d+, before the first move): (error: )?(.*)", re.DOTALL)


def judged(pkm, ini, program, trace):
    """What LinuxCNC made of a program, and what preflight says of it; `trace` gets every servo cycle."""
    flight = preflight(pkm, ini, program, trace)
    timing = flight.get("time", {}).get("judged")
    if timing is None:
        # Not run by preflight, whose word is still to be judged.
        return {"outcome": run(pkm, ini, program, trace), "flight": flight}
    errors = [(told["text"].strip(), told["line"]) for told in timing["messages"] if told["kind"] == "error"]
    return {"outcome": outcome(ini, trace, errors, timing["ending"] == "finished"), "flight": flight}


def outcome(ini, trace, errors, is_ended):
    """Of a run with these messages and the lines that moved then."""
    text = ini.read_text()
    joints = int(ini_edit.value(text, "KINS", "JOINTS"))
    period = 1e-9 * float(ini_edit.value(text, "EMCMOT", "SERVO_PERIOD"))
    found = {"errors": [text for text, _ in errors], "ended": is_ended,
             **traces.figures(traces.virtual(trace, joints, has_poses=False), period)}
    if errors:
        # Drives that are off make the command follow them: the message knows what moved before.
        found["stopped_line"] = errors[0][1]
    return found


def run(pkm, ini, program, trace):
    """What LinuxCNC made of a program, by a run alone."""
    command = [pkm, "run", ini, program, "--trace", trace]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        return {"failed": done.stderr.strip()}
    # A message may have several lines; each begins with the name of the program.
    told = [MESSAGE.match(text) for text in done.stdout.split(f"{program}: ")]
    errors = [(found[3].strip(), int(found[1] or 0)) for found in told if found and found[2]]
    return outcome(ini, trace, errors, done.returncode == 0)


def preflight(pkm, ini, program, trace):
    """What preflight says of it."""
    done = subprocess.run([pkm, "preflight", ini, program, "--format", "json", "--trace", trace],
                          stdin=subprocess.DEVNULL, capture_output=True, text=True)
    return json.loads(done.stdout) if done.stdout else {"refused": done.stderr.strip()}
