# SPDX-License-Identifier: GPL-2.0-or-later
"""Traces of every servo cycle: their motions, what two of the same program differ by, their peaks.

Plain calculation on recorded columns; nothing here talks to LinuxCNC.
"""

from typing import NamedTuple

AXES = "xyzabc"

# Machine units and degrees. Recorded and virtual commands are of the same arithmetic on the same
# numbers; what may differ is where homing ended, by the rounding of one forward kinematics.
SAME = 1e-9

# Cycles in which a machine comes to rest: the slowest of the shipped ones brakes for 0.2 s.
STOPPING = 250

# Cycles left out of peaks about a tool change at a tilt, in which pkmkins moves the joints: the
# interpolator of LinuxCNC answers two cycles late and over three.
AROUND_TOOL_CHANGES = 5


class Trace(NamedTuple):
    """A row of every list for each servo cycle; a place is the pose in X Y Z A B C, then the joints."""
    lines: list
    places: list
    on: list  # whether the drives are on
    busy: list  # whether a tool change moves the joints

    def until_off(self):
        """The cycles up to where the drives go off."""
        last = self.on.index(False) if False in self.on else len(self.on)
        return Trace(*(column[:last] for column in self))

    def was_switched_off(self):
        return False in self.on


def recorded(path):
    """What truth_run.py wrote."""
    with open(path) as trace:
        next(trace)
        rows = [line.rstrip("\n").split(",") for line in trace]
    return Trace([int(row[0]) for row in rows], [list(map(float, row[3:])) for row in rows],
                 [row[1] == "True" for row in rows], [row[2] == "True" for row in rows])


def virtual(path, joints):
    """What `pkm run --trace` wrote. While a tool change moves the joints, its offset changes."""
    with open(path) as trace:
        names = next(trace).rstrip("\n").split(",")
        tool, joint, behind = (names.index(name) for name in ("tool_x", "joint_0", "feed"))
        rows = [line.rstrip("\n").split(",") for line in trace]
    offsets = [row[tool:behind] for row in rows]
    places = [list(map(float, row[2:8] + row[joint:joint + joints])) for row in rows]
    return Trace([int(row[1]) for row in rows], places,
                 [True] * len(rows), [False, *(a != b for a, b in zip(offsets, offsets[1:]))])


def without(trace, letters):
    """The same without the letters of extra axes: in virtual time they are those of their joints, which are
    recorded in any case."""
    places = [[0.0 if n < len(AXES) and AXES[n] in letters else value for n, value in enumerate(place)]
              for place in trace.places]
    return trace._replace(places=places)


def is_apart(a, b):
    return a != b and any(abs(x - y) > SAME for x, y in zip(a, b))


def motions(places):
    """Longest stretches in which something moves, as first and last cycle: it stands in the first."""
    found, begin = [], None
    for n in range(1, len(places)):
        moves = is_apart(places[n], places[n - 1])
        if moves and begin is None:
            begin = n - 1
        elif not moves and begin is not None:
            found.append((begin, n - 1))
            begin = None
    return found if begin is None else [*found, (begin, len(places) - 1)]


def compared(live, offline, is_stopped=False):
    """What a recorded and a virtual run of a program differ by: `why` is empty where nothing does.

    Motions are compared cycle by cycle. A standstill lasts longer where the real clock goes on while
    LinuxCNC's interpreter reads: it is compared by its place alone, with which a motion begins and ends.
    Of a motion that LinuxCNC stops, what comes before is compared.
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


def before_stop(ours, theirs):
    """Both stretches up to where the machine begins to stop. LinuxCNC's task hears of an error in one of
    its next cycles and only then stops the motion; where it was switched off, the drives end it."""
    (begin, end), (other, last) = ours, theirs
    if end - begin == last - other:
        return ours, theirs
    length = max(0, min(end - begin, last - other) - STOPPING)
    return (begin, begin + length), (other, other + length)


def difference(one, other):
    """Largest, and the first cycle beyond what counts as the same, else the last."""
    apart = [max(abs(x - y) for x, y in zip(a, b)) if a != b else 0.0 for a, b in zip(one, other)]
    beyond = (n for n, value in enumerate(apart) if not value <= SAME)
    return max(apart, default=0.0), next(beyond, max(0, len(apart) - 1))


def ratio(live, ours, offline, theirs):
    """Largest speed of a joint in virtual time to the recorded one, of the joint with the worst."""
    ratios = [there / here for here, there in zip(peaks(live, ours), peaks(offline, theirs)) if here > 0]
    return max(ratios, key=lambda share: abs(share - 1), default=None)


def peaks(places, stretches):
    """Longest way of each joint in a cycle."""
    most = [0.0] * (len(places[0]) - len(AXES))
    for begin, end in stretches:
        for a, b in zip(places[begin:end], places[begin + 1:end + 1]):
            most = [max(m, abs(y - x)) for m, x, y in zip(most, a[6:], b[6:])]
    return most


def figures(trace, period):
    """Peaks of the joints with their lines, and the line that moved last."""
    lines, places, _, busy = trace
    last = len(lines)
    quiet = [True] * last
    for n in (n for n in range(last) if busy[n]):
        for k in range(max(0, n - AROUND_TOOL_CHANGES), min(last, n + AROUND_TOOL_CHANGES)):
            quiet[k] = False
    found = {"stopped_line": stopped_line(trace), "speed": [], "acceleration": []}
    for way in list(zip(*places))[6:]:
        speed = [(b - a) / period for a, b in zip(way, way[1:])]
        steps = [n for n in range(1, len(speed)) if quiet[n] and quiet[n + 1]]
        fastest = max(steps, key=lambda n: abs(speed[n]), default=None)
        changes = [n for n in steps if quiet[n - 1]]
        hardest = max(changes, key=lambda n: abs(speed[n] - speed[n - 1]), default=None)
        found["speed"].append([abs(speed[fastest]), lines[fastest]] if steps else [0, 0])
        found["acceleration"].append(
            [abs(speed[hardest] - speed[hardest - 1]) / period, lines[hardest]] if changes else [0, 0])
    return found


def stopped_line(trace):
    """The line that moved last."""
    places = trace.places
    moved = (n for n in range(len(places) - 1, 0, -1) if places[n][:6] != places[n - 1][:6])
    return trace.lines[next(moved, 0)]
