# SPDX-License-Identifier: GPL-2.0-or-later
"""Rows of the tables of `truth.py`: the verdict of preflight, the behavior of LinuxCNC in virtual time, and its
behavior live."""

import re

import ini_edit
import traces
from unprivileged import REPOSITORY

# Fraction by which limits or peaks of two runs may differ: they are from the same cycles, and one
# is read from the decimals of a trace.
AGREE = 1e-9

# A slower joint is at rest: rounding of a value of 1e4 gives this speed in one servo cycle.
STILL = 1e-8

# LinuxCNC's messages about the moves of G70, G71 and G72.
NO_LINE = " on line -1"

# Limits of preflight that correspond to an error of LinuxCNC with these words.
CAUSES = [
    (re.compile("following error"), {"speed", "acceleration", "following-error"}),
    (re.compile(r"would exceed|soft limit|limit on joint"), {"axis", "joint", "reach"}),
    (re.compile("kinematicsInverse"), {"reach", "joint"}),
    (re.compile("approaches a singularity"), {"hold"}),
]


def row(program, outcome, flight):
    """Returns the row of one program; `right` is false if prediction and outcome disagree."""
    ini = program_ini(program)
    entry = {"machine": program.machine, "program": program.name, "kind": program.kind, "linuxcnc": "",
            "preflight": "", "ratio": None, "joint": None, "alarm": False, "missed": False, "right": False}
    if "failed" in outcome:
        return {**entry, "linuxcnc": "not run: " + outcome["failed"][:60]}
    entry["linuxcnc"] = said(outcome)
    if "refused" in flight:
        entry["preflight"] = flight["refused"][:60]
        entry["missed"] = not outcome["errors"]
        return {**entry, "right": bool(outcome["errors"])}
    if "judged" not in flight["time"]:
        return {**entry, "preflight": "not judged", "missed": bool(outcome["errors"])}
    entry["preflight"] = first_break(flight)
    if program.lines is not None:
        found = {found["line"] for found in flight["breaks"]}
        return {**entry, "missed": bool(set(program.lines) - found), "right": found == set(program.lines)}
    if outcome["errors"]:
        entry["missed"] = not is_predicted(outcome, flight)
        return {**entry, "right": not entry["missed"]}
    unseen = [found for found in flight["breaks"] if not is_seen(found, ini, outcome)]
    entry["alarm"] = bool(unseen)
    entry["ratio"], entry["joint"] = worst_ratio(outcome, flight)
    near = entry["ratio"] is None or abs(entry["ratio"] - 1) <= AGREE
    return {**entry, "right": near and not unseen}


def program_ini(program):
    """Returns the INI file that a program runs with."""
    text = (REPOSITORY / "configs" / program.machine / f"{program.machine}.ini").read_text()
    return ini_edit.edited(text, program.edits)


def error_line(outcome):
    """Returns the line that LinuxCNC names, otherwise the line of the last motion."""
    for text in outcome["errors"]:
        if found := re.search(r"on line (\d+)", text):
            return int(found[1])
    return outcome["stopped_line"]


def said(outcome):
    if not outcome["errors"]:
        return "runs"
    return f"{error_line(outcome)}: {outcome['errors'][0]}"


def first_break(flight):
    if not flight["breaks"]:
        return "fits"
    found = flight["breaks"][0]
    return f"{found['line']}: {found['limit']}"


def timing(flight):
    """Returns preflight's results for the motion in time."""
    return flight["time"]["judged"]


def is_predicted(outcome, flight):
    """Returns whether the same is reported, and a limit that causes such an error is violated in its line."""
    said = [message["text"].strip() for message in timing(flight)["messages"] if message["kind"] == "error"]
    if said != outcome["errors"]:
        return False
    line, text = error_line(outcome), " ".join(outcome["errors"])
    limits = set().union(*(limits for words, limits in CAUSES if words.search(text)))
    return any((found["limit"], found["line"]) in {(limit, line) for limit in limits} for found in flight["breaks"])


def is_seen(found, ini, outcome):
    """Returns whether the recorded run violated the limit as well; limits that it cannot show count as violated."""
    limits = {"speed": "MAX_VELOCITY", "acceleration": "MAX_ACCELERATION"}
    if found["limit"] not in limits:
        return found["limit"] in ("base-cone", "platform-cone", "hold")
    peaks = outcome[found["limit"]]
    of = [float(ini_edit.value(ini, f"JOINT_{n}", limits[found["limit"]])) for n in range(len(peaks))]
    return any(peak >= (1 - AGREE) * limit for (peak, _), limit in zip(peaks, of))


def worst_ratio(outcome, flight):
    """Returns the ratio of predicted to recorded peak speed, of the joint with the largest difference."""
    ratios = []
    for joint, ((recorded, _), predicted) in enumerate(zip(outcome["speed"], timing(flight)["speeds"])):
        if max(recorded, predicted["value"]) > STILL:
            ratios.append((predicted["value"] / recorded if recorded else float("inf"), joint))
    return max(ratios, key=lambda ratio: abs(ratio[0] - 1), default=(None, None))


def table(rows):
    lines = ["| machine | program | kind | LinuxCNC | preflight | peak ratio | |",
             "| --- | --- | --- | --- | --- | --: | --- |"]
    for entry in rows:
        ratio = "" if entry["ratio"] is None else f"{entry['ratio']:.4f}"
        verdict = "" if entry["right"] else "missed" if entry["missed"] else "false alarm" if entry["alarm"] else "off"
        did = " ".join(entry["linuxcnc"].split())[:60]
        lines.append(f"| {entry['machine']} | {entry['program']} | {entry['kind']} | {did} "
                     f"| {entry['preflight']} | {ratio} | {verdict} |")
    return "\n".join(lines)


def summary(rows):
    compared = [entry["ratio"] for entry in rows if entry["ratio"] is not None]
    near = sum(abs(ratio - 1) <= AGREE for ratio in compared)
    stopped = [entry for entry in rows if entry["linuxcnc"] not in ("", "runs")]
    return (f"truth: {len(rows)} programs; {len(stopped)} stopped by LinuxCNC, "
            f"{sum(entry['missed'] for entry in rows)} of them not predicted with their line; "
            f"{sum(entry['alarm'] for entry in rows)} false alarms; peaks of {len(compared)} compared, "
            f"{near} of them equal")


def beside(job):
    """Compares a live and a virtual run of a program; `same` is false if they differ."""
    name, live, offline, recorded, trace, is_random = job
    entry = {"program": name, "cycles": 0, "motions": 0, "difference": None, "ratio": None, "why": "", "same": False}
    for kind, outcome in (("live", live), ("in virtual time", offline)):
        if outcome is None or "failed" in outcome:
            return {**entry, "why": f"not run {kind}: {(outcome or {}).get('failed', '')[:60]}"}
    machine = name.split(".")[0]
    extra = ini_edit.extra_letters((REPOSITORY / "configs" / machine / f"{machine}.ini").read_text()).lower()
    seen = traces.without(traces.recorded(recorded), extra)
    joints = len(seen.places[0]) - len(traces.AXES)
    offline_seen = traces.without(traces.virtual(trace, joints), extra)
    entry.update(traces.compared(seen, offline_seen, bool(live["errors"])))
    if entry["why"] and is_random and traces.is_same_path(seen, offline_seen, bool(live["errors"])):
        entry["why"] = ""
    if not entry["why"]:
        entry["why"] = other_end(live, offline, seen)
    return {**entry, "same": not entry["why"]}


def other_end(live, offline, seen):
    """Returns the messages of LinuxCNC that differ; empty if none."""
    said, repeated = ([" ".join(text.split()) for text in outcome["errors"]] for outcome in (live, offline))
    has_line = not any(NO_LINE in text for text in said)
    if not has_line:
        # In virtual time they have the line of the cycle.
        repeated = [re.sub(r" on line \d+", NO_LINE, text) for text in repeated]
    # LinuxCNC's task passes on one message per cycle; virtual time ends with the first.
    if said[:len(repeated) or None] != repeated:
        return f"{said} live, {repeated} in virtual time"
    if live["ended"] != offline["ended"] and not said:
        return "ended otherwise"
    line = error_line({**live, "stopped_line": traces.stopped_line(seen.until_off())})
    if said and has_line and line != error_line(offline):
        return f"stopped in line {line} live, {error_line(offline)} in virtual time"
    return ""


def table_beside(rows):
    lines = ["| program | cycles that move | motions | largest difference | peak ratio | |",
             "| --- | --: | --: | --: | --: | --- |"]
    for entry in rows:
        apart = "" if entry["difference"] is None else f"{entry['difference']:.1e}"
        ratio = "" if entry["ratio"] is None else f"{entry['ratio']:.9f}"
        lines.append(f"| {entry['program']} | {entry['cycles']} | {entry['motions']} | {apart} | {ratio} | {entry['why']} |")
    return "\n".join(lines)


def summary_beside(rows):
    same = [entry for entry in rows if entry["same"]]
    most = max((entry["difference"] for entry in same), default=0.0)
    return (f"truth: {len(rows)} programs live, {len(same)} of them the same in virtual time; "
            f"{sum(entry['motions'] for entry in same)} motions of {sum(entry['cycles'] for entry in same)} cycles, "
            f"largest difference {most:.1e}; {sum(not entry['difference'] for entry in same)} programs bit for bit")
