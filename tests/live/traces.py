# SPDX-License-Identifier: GPL-2.0-or-later
"""Traces of every servo cycle: their motions, the differences between two of the same program, their peaks.

Pure calculation on recorded columns; nothing here communicates with LinuxCNC.
"""

from typing import NamedTuple

import numpy

AXES = "xyzabc"

# Machine units and degrees. Recorded and virtual commands use the same arithmetic on the same
# numbers; only the position after homing may differ, by the rounding of one forward kinematics.
SAME = 1e-9

# Cycles in which a machine comes to rest: the slowest shipped one brakes for 0.2 s.
STOPPING = 250

# Cycles left out of peaks about a tool change at a tilt, in which pkmkins moves the joints:
# LinuxCNC's interpolator lags by two cycles and smooths over three.
AROUND_TOOL_CHANGES = 5


class Trace(NamedTuple):
    """A row of every array for each servo cycle; a place is the pose in X Y Z A B C, then the joints."""
    lines: numpy.ndarray
    places: numpy.ndarray
    on: numpy.ndarray  # whether the drives are on
    busy: numpy.ndarray  # whether a tool change moves the joints

    def until_off(self):
        """Returns the cycles until the drives switch off."""
        last = first(~self.on, len(self.on))
        return Trace(*(column[:last] for column in self))

    def was_switched_off(self):
        return not self.on.all()


def first(is_it, otherwise):
    """Returns the index of the first true value."""
    found = numpy.flatnonzero(is_it)
    return int(found[0]) if len(found) else otherwise


def table(trace, columns, **options):
    """Reads columns of the rest of an open file."""
    return numpy.loadtxt(trace, delimiter=",", usecols=columns, ndmin=2, **options).reshape(-1, len(columns))


def recorded(path):
    """Reads a trace of truth_run.py."""
    with open(path) as trace:
        columns = range(next(trace).count(",") + 1)
        rows = table(trace, columns, converters={n: lambda text: text == "True" for n in (1, 2)}, encoding="utf-8")
    return Trace(rows[:, 0].astype(int), rows[:, 3:], rows[:, 1] == 1, rows[:, 2] == 1)


def virtual(path, joints, has_poses=True):
    """Reads a trace of `pkm run --trace`. While a tool change moves the joints, its offset changes. Without `has_poses`
    the poses are zeros: reading them takes a third of the time."""
    with open(path) as trace:
        names = next(trace).rstrip("\n").split(",")
        tool, joint, behind = (names.index(name) for name in ("tool_x", "joint_0", "feed"))
        poses = range(2, 2 + len(AXES)) if has_poses else ()
        rows = table(trace, [0, 1, *poses, *range(joint, joint + joints), *range(tool, behind)])
    times, lines, rows = rows[:, 0], rows[:, 1], rows[:, 2:]
    if (numpy.rint(times / times[:1]) != numpy.arange(1, len(times) + 1)).any():
        raise ValueError(f"{path}: not a row for every servo cycle")
    if not has_poses:
        rows = numpy.hstack((numpy.zeros((len(rows), len(AXES))), rows))
    places, offsets = numpy.split(rows, [len(AXES) + joints], axis=1)
    busy = numpy.zeros(len(rows), bool)
    busy[1:] = (offsets[1:] != offsets[:-1]).any(axis=1)
    return Trace(lines.astype(int), places, numpy.ones(len(rows), bool), busy)


def without(trace, letters):
    """Returns the trace without the letters of extra axes: in virtual time they equal their joints, which are
    recorded in any case."""
    places = trace.places.copy()
    places[:, [n for n, letter in enumerate(AXES) if letter in letters]] = 0.0
    return trace._replace(places=places)


def is_apart(a, b):
    """Returns whether two places differ, or which rows of two arrays of them."""
    return (abs(a - b) > SAME).any(axis=-1)


def motions(places):
    """Returns the longest stretches of motion as first and last cycle; in the first the machine is at rest."""
    moves = is_apart(places[1:], places[:-1]).astype(int)
    edges = numpy.diff(moves, prepend=0, append=0)
    return [(int(begin), int(end)) for begin, end in zip(*(numpy.flatnonzero(edges == turn) for turn in (1, -1)))]


def compared(live, offline, is_stopped=False):
    """Compares a recorded and a virtual run of a program: `why` is empty if they agree.

    Motions are compared cycle by cycle. A standstill lasts longer while the real clock advances and
    LinuxCNC's interpreter reads: only its place is compared, with which a motion begins and ends.
    Of a motion that LinuxCNC stops, the part before the stop is compared.
    """
    live = live.until_off()
    ours, theirs = motions(live.places), motions(offline.places)
    found = {"cycles": sum(end - begin for begin, end in ours), "motions": len(ours), "difference": 0.0,
             "ratio": None, "why": ""}
    if len(ours) != len(theirs):
        return {**found, "why": f"{len(theirs)} motions in virtual time"}
    if not ours:
        return {**found, "why": "stands elsewhere" if is_apart(live.places[-1], offline.places[-1]) else ""}
    if is_stopped:
        ours[-1], theirs[-1] = before_stop(ours[-1], theirs[-1])
    found["ratio"] = ratio(live.places, ours, offline.places, theirs)
    for number, ((begin, end), (other, last)) in enumerate(zip(ours, theirs), 1):
        length = min(end - begin, last - other)
        apart, worst = difference(live.places[begin:begin + length + 1], offline.places[other:other + length + 1])
        found["difference"] = max(found["difference"], apart)
        said = f"motion {number}, line {live.lines[begin + worst]}"
        if end - begin != last - other:
            return {**found, "why": f"{said}: {end - begin} cycles, {last - other} in virtual time"}
        if not apart <= SAME:
            return {**found, "why": f"{said}: differs by {apart:.1e}"}
    return found


def is_same_path(live, offline, is_stopped=False):
    """Returns whether the poses of all moving cycles are equal, wherever the machine stops between them. It stops
    when an operator presses a button or LinuxCNC's task waits for a real clock, and joints come to rest there.
    Of a motion that LinuxCNC stops, the part before is compared: all of it until the drives switch off, if they
    do so at once, otherwise until the machine begins to brake."""
    ours, theirs = (poses[1:][is_apart(poses[1:], poses[:-1])]
                    for poses in (trace.places[:, :len(AXES)] for trace in (live.until_off(), offline)))
    if live.was_switched_off():
        theirs = theirs[:len(ours)]
    elif is_stopped:
        (_, end), (_, last) = before_stop((0, len(ours)), (0, len(theirs)))
        ours, theirs = ours[:end], theirs[:last]
    return len(ours) == len(theirs) and not is_apart(ours, theirs).any()


def before_stop(ours, theirs):
    """Returns both stretches until the machine begins to stop. LinuxCNC's task receives an error in one of
    its next cycles and only then stops the motion; if the machine was switched off, the drives end it."""
    (begin, end), (other, last) = ours, theirs
    if end - begin == last - other:
        return ours, theirs
    length = max(0, min(end - begin, last - other) - STOPPING)
    return (begin, begin + length), (other, other + length)


def difference(one, other):
    """Returns the largest difference, and the first cycle beyond the tolerance, or the last cycle."""
    apart = numpy.max(abs(one - other), axis=1)
    return float(apart.max(initial=0.0)), first(~(apart <= SAME), max(0, len(apart) - 1))


def ratio(live, ours, offline, theirs):
    """Returns the ratio of the largest virtual to the largest recorded speed, of the worst joint."""
    ratios = [there / here for here, there in zip(peaks(live, ours), peaks(offline, theirs)) if here > 0]
    return max(ratios, key=lambda share: abs(share - 1), default=None)


def peaks(places, stretches):
    """Returns the largest step of each joint in a cycle."""
    joints = places[:, len(AXES):]
    ways = [abs(numpy.diff(joints[begin:end + 1], axis=0)).max(axis=0, initial=0.0) for begin, end in stretches]
    return numpy.max(ways, axis=0, initial=0.0).tolist() if ways else [0.0] * joints.shape[1]


def largest(values, cycles, lines):
    """Returns the largest absolute value of each column in some cycles, and the line of its first occurrence."""
    if not len(cycles):
        return [[0, 0] for _ in values.T]
    sizes = abs(values[cycles])
    places = sizes.argmax(axis=0)
    return [[float(sizes[place, n]), int(lines[cycles[place]])] for n, place in enumerate(places)]


def figures(trace, period):
    """Returns the peaks of the joints with their lines."""
    lines, places, _, busy = trace
    quiet = numpy.ones(len(lines), bool)
    around = numpy.flatnonzero(busy)[:, None] + numpy.arange(-AROUND_TOOL_CHANGES, AROUND_TOOL_CHANGES)
    quiet[around[(around >= 0) & (around < len(lines))]] = False
    speed = numpy.diff(places[:, len(AXES):], axis=0) / period
    change = numpy.zeros_like(speed)
    change[1:] = numpy.diff(speed, axis=0) / period
    # A speed needs two cycles, its change three.
    steps = 1 + numpy.flatnonzero(quiet[1:-1] & quiet[2:])
    return {"speed": largest(speed, steps, lines),
            "acceleration": largest(change, steps[quiet[steps - 1]], lines)}


def stopped_line(trace):
    """Returns the line of the last motion."""
    poses = trace.places[:, :len(AXES)]
    moved = numpy.flatnonzero((poses[1:] != poses[:-1]).any(axis=1))
    return int(trace.lines[moved[-1] + 1 if len(moved) else 0])
