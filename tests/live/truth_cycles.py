# SPDX-License-Identifier: GPL-2.0-or-later
"""Compares verdicts of preflight with every servo cycle that LinuxCNC executed.

The limits are read from the INI file here, by code independent of pkm's. If LinuxCNC stops at one, or lines begin
with `/`, the program runs again with an INI file without limits, so that the later cycles are checked as well.
"""

import re
import subprocess
from math import inf
from typing import NamedTuple

import numpy

import ini_edit
import traces
import truth_judge
import truth_virtual

# A cycle that exceeds a limit by this, in machine units and degrees, violates it: rounding is below 1e-9.
BEYOND = 1e-6
# Largest amount by which preflight may exclude a cycle from a range: rounding, 1e-9 of a machine's size of up to 4 m.
ROUNDED = 5e-6
# Distance of a cycle from a limit, as a fraction of its range, at which a proof of the whole move may report a
# violation: a cycle is up to 0.2 mm from the next one.
NEAR = 2e-4
# Largest excess of a range over the cycles, in machine units: a move's chords of arcs and the motion of half a cycle.
CHORDS = 3e-4
# Cycles around a change of the tool offset in which the platform may still move.
AROUND = 20
# Fraction by which ranges of joints, which preflight computes to first order for a whole move, may exceed those of the
# cycles: 4.7 % were observed, for a compensated move that also rotates the platform.
COARSE = 0.05
# Largest distance, in machine units and degrees, of the last cycle from the end that LinuxCNC reports: its message
# has six decimals, of an inch at most.
ENDING = 3e-5
# Findings that these limits do not cover.
OTHERS = {"reach", "hold", "dead-point", "base-cone", "platform-cone", "base-pyramid", "platform-pyramid", "clearance",
          "mechanisms", "path", "linuxcnc", "following-error"}
OFF = "with block delete off: "


class Limit(NamedTuple):
    """A limit, and the values that it bounds in a run."""
    kind: str
    part: str
    low: float
    high: float
    values: numpy.ndarray


def opened(text):
    """Returns an INI file without limits of poses."""
    text = re.sub(r"(?m)^(TILT_LIMIT|ROD_CLEARANCE|MECHANISM_CLEARANCE|\w+_CONE|\w+_PYRAMID|CORRECTION_\w+)\s*=.*\n", "", text)
    far = 170 if "legs=crank" in text else 1e6
    return re.sub(r"(?m)^(MIN|MAX)_LIMIT\s*=.*", lambda found: f"{found[1]}_LIMIT = {'-' if found[1] == 'MIN' else ''}{far}", text)


class Run:
    """The servo cycles of a run."""

    def __init__(self, text, trace, names, errors=()):
        with open(trace) as file:
            columns = next(file).rstrip("\n").split(",")
            table = numpy.loadtxt(file, delimiter=",", ndmin=2)
        self.lines = table[:, 1].astype(int)
        self.end_pose = table[-1, 2:8]
        self.seconds = table[-1, 0]
        of = {name: table[:, n] for n, name in enumerate(columns)}
        extra = ini_edit.extra_letters(text)
        count = int(ini_edit.value(text, "KINS", "JOINTS"))
        period = 1e-9 * float(ini_edit.value(text, "EMCMOT", "SERVO_PERIOD"))

        def value(section, key, otherwise=0.0):
            return float(ini_edit.value(text, section, key, otherwise))
        self.limits = []
        ranges = [(value(f"JOINT_{n}", "MIN_LIMIT", -inf) + value(f"JOINT_{n}", "CORRECTION_LIMIT"),
                   value(f"JOINT_{n}", "MAX_LIMIT", inf) - value(f"JOINT_{n}", "CORRECTION_LIMIT")) for n in range(count)]
        for letter in ini_edit.value(text, "TRAJ", "COORDINATES").replace(" ", ""):
            low, high = (value(f"AXIS_{letter}", key) for key in ("MIN_LIMIT", "MAX_LIMIT"))
            if letter in extra:
                # An extra axis.
                joint = count - len(extra) + extra.index(letter)
                ranges[joint] = max(low, ranges[joint][0]), min(high, ranges[joint][1])
            else:
                self.limits.append(Limit("axis", f"axis {letter}", low, high, of[letter.lower()]))
        self.limits += [Limit("joint", names[n], *ranges[n], of[f"joint_{n}"]) for n in range(count)]
        if tilt := value("PKM", "TILT_LIMIT"):
            upright = numpy.cos(numpy.radians(of["a"])) * numpy.cos(numpy.radians(of["b"]))
            self.limits.append(Limit("tilt", "the tilt of the tool axis", -inf, tilt,
                                     numpy.degrees(numpy.arccos(numpy.clip(upright, -1, 1)))))
        self.find_speeds(of, names, count, period, value, errors)

    def find_speeds(self, of, names, count, period, value, errors):
        """Finds the peaks of the joints, until a following error switches the drives off: with and without the cycles
        around a change of the tool offset, because the trace does not contain in which of them the platform moves."""
        tools = numpy.array([column for name, column in of.items() if name.startswith("tool_")]).T
        busy = numpy.zeros(len(self.lines), bool)
        busy[1:] = (tools[1:] != tools[:-1]).any(axis=1)
        # The module is busy slightly longer than that.
        busy = numpy.convolve(busy, numpy.ones(2 * AROUND + 1), "same") > 0
        joints = numpy.array([of[f"joint_{n}"] for n in range(count)]).T
        # The command then jumps to the drive's position, farther than a joint moves in a cycle.
        late = [int(abs(numpy.diff(of[f"joint_{joint}"])).argmax()) + 1 for text in errors
                for joint in re.findall(r"joint (\d+) following error", text)]
        self.end = min(late, default=len(joints))
        places = numpy.hstack((numpy.zeros((len(joints), len(traces.AXES))), joints))[:self.end]
        self.peaks, self.most = (traces.figures(traces.Trace(self.lines[:self.end], places, None, column[:self.end]), period)
                                 for column in (busy, numpy.zeros_like(busy)))
        self.speeds = []
        for kind, key, less in (("speed", "MAX_VELOCITY", "CORRECTION_RATE"), ("acceleration", "MAX_ACCELERATION", None)):
            for n, (peak, line) in enumerate(self.peaks[kind]):
                limit = value(f"JOINT_{n}", key) - (value(f"JOINT_{n}", less) if less else 0.0)
                self.speeds.append((kind, f"the {kind} of {names[n]}", peak, limit, line))

    def violations(self):
        """Returns kind, part, lines of the first cycle beyond each limit with those around it, and the cycle."""
        found = []
        for limit in self.limits:
            beyond = numpy.flatnonzero((limit.values < limit.low - BEYOND) | (limit.values > limit.high + BEYOND))
            if len(beyond):
                found.append((limit.kind, limit.part, self.around(int(beyond[0])), int(beyond[0])))
        return found

    def around(self, cycle):
        """Returns the line of a cycle, of the motion before and of the next one."""
        line = self.lines[cycle]
        after = self.lines[cycle:][self.lines[cycle:] != line][:1]
        before = self.lines[:cycle][self.lines[:cycle] != line][-1:]
        # Joints lag two cycles behind the pose, so that a motion may continue after LinuxCNC reports line 0.
        return [int(n) for n in (*([] if line == 0 and len(before) else [line]), *before, *after)]

    def comes(self, line, cycle):
        """Returns whether a line moves before a cycle."""
        return line in self.lines[:cycle]

    def is_near(self, kind, part, slack):
        """Returns whether a cycle comes close to a limit."""
        for limit in self.limits:
            if (limit.kind, limit.part) == (kind, part):
                room = min(limit.high - limit.values.max(), limit.values.min() - limit.low)
                return room <= max(slack, NEAR * min(limit.high - limit.low, 1e3))
        return any((kind, part) == (speed[0], speed[1]) and speed[2] >= (1 - 1e-6) * speed[3] for speed in self.speeds)


def judged(pkm, ini, file, trace):
    """Returns outcome and prediction, as `truth_virtual.judged`, and the errors of the prediction."""
    found = truth_virtual.judged(pkm, ini, file, trace)
    flight, outcome = found["flight"], found["outcome"]
    if "refused" in flight or "judged" not in flight.get("time", {}):
        found["wrong"] = [] if outcome.get("errors") or "refused" in flight else [f"not judged: {flight['time']}"]
        return found
    names = [peak["joint"] for peak in flight["time"]["judged"]["speeds"]]
    text = ini.read_text()
    first = Run(text, trace, names, outcome["errors"])
    source = file.read_text()
    wide = ini.with_name(f"wide-{file.stem}.ini")
    seen = [first]
    is_whole = True
    for words, is_needed in ((source, bool(outcome["errors"])), (re.sub(r"(?m)^/", "", source), "\n/" in source)):
        if is_needed:
            wide.write_text(opened(text))
            again, path = trace.with_suffix(".again.csv"), file.with_name(f"again-{file.name}")
            path.write_text(words)
            done = subprocess.run([pkm, "run", wide, path, "--trace", again], stdin=subprocess.DEVNULL, capture_output=True, text=True)
            if not again.exists():
                found["wrong"] = [f"without limits: {done.stderr}"]
                return found
            seen.append(Run(text, again, names))
            again.unlink()
            is_whole &= done.returncode == 0
    is_inch = ini_edit.value(text, "TRAJ", "LINEAR_UNITS") == "inch"
    found["wrong"] = wrong(flight, outcome, first, seen, is_whole, source, is_inch)
    return found


def wrong(flight, outcome, first, seen, is_whole, source, is_inch):
    """Returns where preflight differs from the cycles."""
    found, timing = [], flight["time"]["judged"]
    is_exact = "G64" not in source and "g64" not in source
    # G64 may round corners by this much.
    slack = 0.0 if is_exact else inf if "G64\n" in source or "G64 G" in source else 5 * max(
        float(word) for word in re.findall(r"G64 P([\d.]+)", source))
    # LinuxCNC stops in advance for some errors, without a cycle.
    stop = ("axis", truth_judge.error_line(outcome)) if outcome["errors"] else None
    breaks = [(limit_left["limit"], limit_left["part"], limit_left["line"], limit_left["text"].startswith(OFF)) for limit_left in flight["breaks"]]
    expected = [(run, *limit_left) for run in seen for limit_left in run.violations()]
    for run, kind, part, lines, cycle in expected:
        same = [limit_left for limit_left in breaks if limit_left[:2] == (kind, part)]
        if not same:
            if not any(limit_left[0] == "reach" for limit_left in breaks):
                found.append(f"missed: {kind} {part} in line {lines[0]}, cycle {cycle}")
        elif not any(limit_left[2] in (lines[:1] if is_exact else lines) or not is_exact and run.comes(limit_left[2], cycle) for limit_left in same):
            found.append(f"line: {kind} {part} in line {lines}, {[limit_left[2] for limit_left in same]} predicted")
    for kind, part, peak, limit, line in first.speeds:
        if peak > (1 + 1e-6) * limit and not any(limit_left[:2] == (kind, part) for limit_left in breaks):
            found.append(f"missed: {kind} {part} {peak} beyond {limit} in line {line}")
    for kind, part, line, _ in breaks:
        if kind not in OTHERS and is_whole and not any(run.is_near(kind, part, slack) for run in seen) and (kind, line) != stop:
            found.append(f"false: {kind} {part} in line {line}")
    is_off = bool(expected) or bool(outcome["errors"])
    is_fast = any(peak > (1 + 1e-6) * limit for run in seen for _, _, peak, limit, _ in run.speeds)
    if flight["fits"] and (is_off or is_fast):
        found.append("fits, and does not")
    if not flight["fits"] and not is_off and not is_fast and not any(kind in OTHERS for kind, *_ in breaks):
        found.append(f"near: {breaks[:2]}") if is_exact and not found else None
    if outcome["errors"] and not any(kind in ("linuxcnc", "following-error") for kind, *_ in breaks):
        found.append("stop not predicted")
    found += unfinished(timing, first, is_inch, "(DEBUG,end" in source)
    if abs(timing["seconds"] - first.seconds) > 0.0015:
        found.append(f"seconds: {timing['seconds']}, {first.seconds} in the trace")
    for kind, key in (("speed", "speeds"), ("acceleration", "accelerations")):
        rounding = 1e-8 if kind == "speed" else 1e-4
        for n, (reported, (peak, line), (most, _)) in enumerate(zip(timing[key], first.peaks[kind], first.most[kind])):
            if not (1 - 1e-9) * peak - rounding <= reported["value"] <= (1 + 1e-9) * most + rounding:
                found.append(f"peak: {kind} of joint {n}: {reported['value']} reported, {peak} in line {line}, {most}")
    known = {limit.part: limit for limit in first.limits}
    for span in flight["ranges"]:
        values = [limit.values for run in seen[bool(outcome["errors"]):] for limit in run.limits if limit.part == span["part"]]
        low, high = min(map(numpy.min, values)), max(map(numpy.max, values))
        is_axis = known[span["part"]].kind == "axis"
        width = high - low
        tight = CHORDS if is_axis else CHORDS + COARSE * width
        if span["used"][0] > low + ROUNDED or span["used"][1] < high - ROUNDED:
            if is_whole:
                found.append(f"range: {span['part']} {span['used']}, cycles {low} to {high}")
        elif is_exact and is_whole and not outcome["errors"] and (span["used"][0] < low - tight or span["used"][1] > high + tight):
            found.append(f"wide range: {span['part']} {span['used']}, cycles {low} to {high}")
    return found


def unfinished(timing, run, is_inch, has_end):
    """Reports cycles that are missing at the end, by the messages that LinuxCNC gives in between and at the end."""
    found, messages = [], timing["messages"]
    late = max((message["seconds"] for message in messages), default=0.0)
    if run.seconds < late - 1e-6:
        found.append(f"end: cycles up to {run.seconds} s, a message at {late} s")
    ends = [message["text"].split()[1:] for message in messages if message["text"].startswith("end ")]
    if has_end and timing["ending"] == "finished" and not ends:
        found.append("end: no message of it")
    for metric, *pose in ends:
        unit = 1.0 if (float(metric) == 0) == is_inch else 25.4 if is_inch else 1 / 25.4
        there = numpy.array(pose, float) / [unit, unit, unit, 1, 1, 1]
        if not (abs(there - run.end_pose) < ENDING).all():
            found.append(f"end: the cycles end at {run.end_pose}, the program at {there}")
    return found


def row(program, outcome, flight, wrong):
    """Returns the row of one program; `right` is false if prediction and cycles disagree."""
    if "refused" in flight:
        wrong = ["refused: " + flight["refused"][:200]] if not outcome.get("errors") else []
    said = "not run" if "failed" in outcome else truth_judge.said(outcome)
    return {"machine": program.machine, "program": program.name, "kind": program.kind, "linuxcnc": said,
            "preflight": truth_judge.first_break(flight) if "breaks" in flight else "refused", "wrong": wrong, "right": not wrong}


def table(rows):
    lines = ["| machine | program | kind | LinuxCNC | preflight | |", "| --- | --- | --- | --- | --- | --- |"]
    lines += [f"| {row['machine']} | {row['program']} | {row['kind']} | {' '.join(row['linuxcnc'].split())[:60]} "
              f"| {row['preflight']} | {'; '.join(row['wrong'])} |" for row in rows if not row["right"]]
    return "\n".join(lines)


def summary(rows):
    return (f"truth: {len(rows)} random programs; {sum(row['linuxcnc'] != 'runs' for row in rows)} stopped by LinuxCNC, "
            f"{sum(row['preflight'] == 'fits' for row in rows)} fit; {sum(not row['right'] for row in rows)} not as their cycles")
