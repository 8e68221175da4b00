# SPDX-License-Identifier: GPL-2.0-or-later
"""Quantities by which the monitor's motion guard is judged: joint speeds, and the time it costs.

Pure calculation on recorded columns; nothing here communicates with LinuxCNC.
"""

from math import dist, inf, sqrt


def joint_speeds(joints, period):
    """Returns the largest speed of each joint, units per second; `joints` is one list per cycle."""
    pairs = list(zip(joints, joints[1:]))
    return [max(abs(b[n] - a[n]) for a, b in pairs) / period for n in range(len(joints[0]))]


def moving(places, least=1e-6):
    """Returns the indices of the cycles in which the tool has moved, so that rates along the path exist."""
    kept = [0]
    for n, place in enumerate(places):
        if dist(place, places[kept[-1]]) > least:
            kept.append(n)
    return kept


def least_seconds(places, joints, limits, feed, acceleration):
    """Returns the least time from standstill to standstill along the recorded path.

    Nowhere faster than `feed` or than `limits` allow for any joint, and with no more than
    `acceleration` along the path: swept forwards and backwards over the positions.
    """
    kept = moving(places)
    steps = [dist(places[a], places[b]) for a, b in zip(kept, kept[1:])]
    speeds = []
    for step, a, b in zip(steps, kept, kept[1:]):
        ways = [abs(joints[b][n] - joints[a][n]) / step for n in range(len(limits))]
        speeds.append(min([feed] + [limit / way if way else inf for limit, way in zip(limits, ways)]))
    for order in (range(len(steps)), reversed(range(len(steps)))):
        last = 0.0
        for n in order:
            speeds[n] = last = min(speeds[n], sqrt(last * last + 2 * acceleration * steps[n]))
    return sum(step / speed for step, speed in zip(steps, speeds))


def turns(values, least=1e-3):
    """Counts the changes of a sequence between rising and falling by more than `least`."""
    count, direction, extreme = 0, 0, values[0]
    for value in values:
        if (value - extreme) * direction >= 0 and direction:
            extreme = value
        elif abs(value - extreme) > least:
            count += direction != 0
            direction, extreme = (1 if value > extreme else -1), value
    return count
