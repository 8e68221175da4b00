#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Compares verdicts of `pkm preflight` with every servo cycle of LinuxCNC in virtual time, for each kind of limit.

    tests/virtual/limits.py [--only EXPRESSION]

On every machine with constraints a program of straight moves runs once. Each limit then gets a value that its moves
violate for the first time in one of its lines, and all of them get values slightly beyond what the moves reach. The
values in every cycle are calculated here: the coordinates that follow by Newton's method from the constraints in the
INI file, then legs, angles, distances and singular values. Programs also pass through a pose that the machine cannot
reach. Ends with a table; exit code 1 if preflight reports another limit, another line, or a violation that is none.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

REPOSITORY = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(REPOSITORY / "tests/live"))
import ini_edit  # noqa: E402

PKM = REPOSITORY / "target/host/pkm"
AT_ONCE = 2
# Distance of a limit that is kept from the farthest value, as a share of the range that the moves use: preflight may
# report moves that come within the rounding of the limit, and LinuxCNC samples them every 0.05 mm.
BESIDE = 0.01
# Newton's method converges quadratically from home.
STEPS = 30

# Ends of moves about home, as shares of the axis limits. Each move reaches farther than those before in some direction.
MOVES = [(0.06, 0.02, 0.1), (0.06, -0.08, 0.1), (-0.1, -0.08, 0.3), (-0.1, 0.13, -0.2), (0.16, 0.13, 0.3),
         (0.16, -0.17, -0.3), (-0.19, -0.17, 0.4), (0.0, 0.0, 0.0)]
# The same of the angles of a head: with less tilt its conditioning exceeds 1, the largest limit.
TILTS = 4
# A move to a pose that the machine cannot reach, with all limits open: beyond the joint of a tricept's leg, through the
# plane of an exechon's base joints, and a tilt at which no carriage reaches.
UNREACHED = {"tricept": "Z60", "exechon": "Z60", "z3-head": "A80"}


def vector(text):
    return np.array([float(word) for word in text.split()])


def turned(matrices, vectors):
    return np.einsum("...ij,...j->...i", matrices, vectors)


def rotations(degrees):
    """Returns Rz(C) Ry(B) Rx(A) of rows A B C."""
    (sa, sb, sc), (ca, cb, cc) = np.sin(np.radians(degrees)).T, np.cos(np.radians(degrees)).T
    rows = [[cc * cb, cc * sb * sa - sc * ca, cc * sb * ca + sc * sa],
            [sc * cb, sc * sb * sa + cc * ca, sc * sb * ca - cc * sa],
            [-sb, cb * sa, cb * ca]]
    return np.moveaxis(np.array(rows), -1, 0)


class Machine:
    """A machine with three legs and constraints, from its INI file."""

    def __init__(self, name):
        self.name = name
        self.text = (REPOSITORY / "configs" / name / f"{name}.ini").read_text()
        kinematics = dict(re.findall(r"(\S+)=(\S*)", self.value("KINS", "KINEMATICS")))
        self.moved = kinematics["coordinates"]
        self.table = kinematics.get("table", "")
        self.home = vector(self.value("TRAJ", "HOME"))
        self.legs = [{key: vector(found) for key in ("BASE", "PLATFORM", "GUIDE", "ROD", "SIDE")
                      if (found := self.value(f"LEG_{n}", key))} for n in range(3)]
        self.anchors = np.array([leg["PLATFORM"] for leg in self.legs])
        self.centroid = self.anchors.mean(axis=0)
        self.radius = np.sqrt(((self.anchors - self.centroid) ** 2).sum(axis=1).mean())
        count = int(kinematics["constraints"])
        self.constraints = [(self.value(f"CONSTRAINT_{n}", "KIND"), {
            key: vector(found) for key in ("PLATFORM", "BASE", "NORMAL", "PLATFORM_AXIS", "BASE_AXIS")
            if (found := self.value(f"CONSTRAINT_{n}", key))}) for n in range(count)]
        self.follows = [k for k, letter in enumerate("XYZABC") if letter not in self.moved]
        level = self.home.copy()
        level[self.follows] = 0.0
        self.level = self.full(level[None])[0]
        self.used = self.independent()

    def value(self, section, key, default=None):
        return ini_edit.value(self.text, section, key, default)

    def values(self, full):
        """Returns the constraints' values at full poses: one column each."""
        rotation, at = rotations(full[:, 3:]), full[:, :3]
        columns = []
        for kind, given in self.constraints:
            if kind == "point-in-plane":
                normal = given["NORMAL"] / np.linalg.norm(given["NORMAL"])
                columns.append((at + rotation @ given["PLATFORM"] - given["BASE"]) @ normal)
            elif kind == "plane-through-point":
                normal = rotation @ (given["NORMAL"] / np.linalg.norm(given["NORMAL"]))
                columns.append((normal * (given["BASE"] - at - rotation @ given["PLATFORM"])).sum(axis=1))
            else:
                columns.append((rotation @ given["PLATFORM_AXIS"]) @ given["BASE_AXIS"] * self.radius)
        return np.array(columns).T

    def full(self, poses):
        """Returns poses with the coordinates that follow, by Newton's method from home."""
        full = poses.copy()
        full[:, self.follows] = getattr(self, "level", poses[0])[self.follows]
        for _ in range(STEPS):
            values = self.values(full)
            slopes = np.empty((*values.shape, len(self.follows)))
            for n, k in enumerate(self.follows):
                step = np.zeros(6)
                step[k] = 1e-4
                slopes[:, :, n] = (self.values(full + step) - self.values(full - step)) / 2e-4
            # An overconstrained machine has more equations than unknowns, which agree.
            change = -turned(np.linalg.pinv(slopes), values)
            full[:, self.follows] += change
            if np.abs(change).max() < 1e-10:
                break
        assert np.abs(self.values(full)).max() < 1e-6, f"{self.name}: the constraints do not hold"
        return full

    def constraint_rows(self, rotation, at):
        """Returns forces and moments of the constraints about the centroid, as directions and lengths."""
        center = at + rotation @ self.centroid
        for kind, given in self.constraints:
            if kind == "point-in-plane":
                normal = given["NORMAL"] / np.linalg.norm(given["NORMAL"])
                force = np.broadcast_to(normal, at.shape)
                yield force, np.cross(at + rotation @ given["PLATFORM"] - center, force), 1.0
            elif kind == "plane-through-point":
                normal = rotation @ (given["NORMAL"] / np.linalg.norm(given["NORMAL"]))
                # A length at home, comparable with those of legs.
                far = np.linalg.norm(given["BASE"] - self.level[:3] - rotations(self.level[None, 3:])[0] @ self.centroid)
                yield -normal, np.cross(normal, given["BASE"] - center), 1 / np.hypot(1, far / self.radius)
            else:
                axis = rotation @ given["PLATFORM_AXIS"] / np.linalg.norm(given["PLATFORM_AXIS"])
                yield np.zeros_like(at), np.cross(axis, given["BASE_AXIS"] / np.linalg.norm(given["BASE_AXIS"])) * self.radius, 1.0

    def rows(self, full, which):
        """Returns the rows of these constraints, with moments per radius."""
        found = self.constraint_rows(rotations(full[:, 3:]), full[:, :3])
        return [np.hstack((force, moment / self.radius)) * scale for n, (force, moment, scale) in enumerate(found) if n in which]

    def independent(self):
        """Returns the constraints that do not depend at home on those before."""
        used = []
        for n in range(len(self.constraints)):
            rows = np.vstack([row[0] / np.linalg.norm(row[0]) for row in self.rows(self.level[None], [*used, n])])
            if np.linalg.svd(rows)[1].min() > 1e-7:
                used.append(n)
        assert len(used) == 3
        return used

    def segments(self, full):
        """Returns the ends of the legs, one pair of arrays each, and the joint values."""
        rotation, at = rotations(full[:, 3:]), full[:, :3]
        found = []
        for leg in self.legs:
            end = at + rotation @ leg["PLATFORM"]
            if "GUIDE" not in leg:
                base = np.broadcast_to(leg["BASE"], end.shape)
                found.append((base, end, np.linalg.norm(end - base, axis=1)))
                continue
            guide = leg["GUIDE"] / np.linalg.norm(leg["GUIDE"])
            apart = end - leg["BASE"]
            along = apart @ guide
            joint = along + leg["SIDE"] * np.sqrt(leg["ROD"] ** 2 - (apart ** 2).sum(axis=1) + along ** 2)
            found.append((leg["BASE"] + joint[:, None] * guide, end, joint))
        return found

    def series(self, run):
        """Returns the limits that the INI file may have: kind, part, edits for a value, and values in every cycle, all of
        which must be at most the limit."""
        full = self.full(run.poses)
        rotation, level = rotations(full[:, 3:]), rotations(self.level[None, 3:])[0]
        legs, at_home = self.segments(full), self.segments(self.level[None])
        directions = [(end - base) / np.linalg.norm(end - base, axis=1)[:, None] for base, end, _ in legs]
        of_home = [((end - base) / np.linalg.norm(end - base))[0] for base, end, _ in at_home]
        for n, (direction, start) in enumerate(zip(directions, of_home)):
            # At rest; in motion the joints of a trace lag behind its poses.
            assert abs(legs[n][2][-1] - run.joints[-1, n]) < 1e-6, f"{self.name}: joint {n}"
            edit = lambda key, n=n: lambda value: [(f"LEG_{n}", key, value)]  # noqa: E731
            yield "base-cone", str(n), edit("BASE_CONE"), angles(direction, start)
            seen = np.einsum("nji,nj->ni", rotation, direction)
            yield "platform-cone", str(n), edit("PLATFORM_CONE"), angles(seen, level.T @ start)
            if "GUIDE" in self.legs[n]:
                continue
            # A cardan joint whose first axis is level and across the strut at home.
            level_axis = np.cross([0, 0, 1], start)
            level_axis /= np.linalg.norm(level_axis)
            for kind, key, axis, home, now in (
                    ("base-pyramid", "BASE", level_axis, start, direction),
                    ("platform-pyramid", "PLATFORM", level.T @ level_axis, level.T @ start, seen)):
                given = (f"LEG_{n}", f"{key}_N", " ".join(f"{x:.17g}" for x in axis))
                about = np.arctan2(np.cross(home, now) @ axis, now @ home - (now @ axis) * (axis @ home))
                for text, found in (("{} 180", about), ("180 {}", np.arcsin(now @ axis))):
                    def edits(value, n=n, key=key, given=given, text=text):
                        return [given, (f"LEG_{n}", f"{key}_PYRAMID", text.format(value))]
                    yield kind, str(n), edits, np.abs(np.degrees(found))
        # A table makes the part of the motion that the platform does not make.
        beside = run.poses - full
        for n, letter in enumerate(self.table, 3):
            assert abs(beside[-1, "XYZ".index(letter)] - run.joints[-1, n]) < 1e-6, f"{self.name}: joint {n}"
        for sign, key in ((1, "MAX_LIMIT"), (-1, "MIN_LIMIT")):
            for n in range(3 + len(self.table)):
                values = legs[n][2] if n < 3 else beside[:, "XYZ".index(self.table[n - 3])]
                yield ("joint", str(n) if n < 3 else self.table[n - 3],
                       lambda value, n=n, key=key, sign=sign: [(f"JOINT_{n}", key, sign * value)], sign * values)
            for letter in self.moved + self.table:
                yield ("axis", letter, lambda value, letter=letter, key=key, sign=sign: [(f"AXIS_{letter}", key, sign * value)],
                       sign * run.poses[:, "XYZABC".index(letter)])
        yield "tilt", "", lambda value: [("PKM", "TILT_LIMIT", value)], angles(rotation[:, :, 2], np.array([0, 0, 1]))
        apart = np.min([distances(legs[i][:2], legs[j][:2]) for i in range(3) for j in range(i)], axis=0)
        yield "clearance", "", lambda value: [("PKM", "ROD_CLEARANCE", -value)], -apart
        lines = []
        for (_, end, _), direction in zip(legs, directions):
            lever = end - full[:, :3] - rotation @ self.centroid
            lines.append(np.hstack((direction, np.cross(lever, direction) / self.radius)))
        matrices = np.stack([*lines, *self.rows(full, self.used)], axis=1)
        yield "hold", "", lambda value: [("PKM", "CONDITIONING_LIMIT", -value)], -np.linalg.svd(matrices)[1][:, -1]
        period = 1e-9 * float(self.value("EMCMOT", "SERVO_PERIOD"))
        speeds = np.diff(run.joints, axis=0, prepend=run.joints[:1]) / period
        for kind, key, found in (("speed", "MAX_VELOCITY", speeds),
                                 ("acceleration", "MAX_ACCELERATION", np.diff(speeds, axis=0, append=speeds[-1:]) / period)):
            for n in range(3):
                yield kind, str(n), lambda value, n=n, key=key: [(f"JOINT_{n}", key, value)], np.abs(found[:, n])


def angles(vectors, direction):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(vectors, direction), axis=1), vectors @ direction))


def distances(one, other):
    """Returns the distances of two segments that do not meet: the least of those of their lines, if both feet are
    inside, and of the four ends from the other segment."""
    (a, b), (c, d) = one, other
    u, v, w = b - a, d - c, a - c
    uu, uv, vv, uw, vw = ((x * y).sum(axis=1) for x, y in ((u, u), (u, v), (v, v), (u, w), (v, w)))
    over = uu * vv - uv * uv
    s, t = (uv * vw - vv * uw) / over, (uu * vw - uv * uw) / over
    inside = (0 <= s) & (s <= 1) & (0 <= t) & (t <= 1)
    lines = np.where(inside, np.linalg.norm(w + s[:, None] * u - t[:, None] * v, axis=1), np.inf)

    def of_end(point, start, way):
        share = np.clip(((point - start) * way).sum(axis=1) / (way * way).sum(axis=1), 0, 1)
        return np.linalg.norm(point - start - share[:, None] * way, axis=1)
    return np.min([lines, of_end(a, c, v), of_end(b, c, v), of_end(c, a, u), of_end(d, a, u)], axis=0)


class Run:
    """The servo cycles of a run."""

    def __init__(self, trace):
        with open(trace) as file:
            next(file)
            table = np.loadtxt(file, delimiter=",", ndmin=2)
        self.lines, self.poses = table[:, 1].astype(int), table[:, 2:8]
        self.joints = table[:, 8:8 + 5]


def written(folder, machine, edits, program):
    """Writes configuration and program, and returns their paths."""
    folder.mkdir()
    ini, file = folder / f"{machine.name}.ini", folder / "limits.ngc"
    # The drives may lag behind: otherwise a following error stops the program.
    far = [(f"JOINT_{n}", key, 1e4) for n in range(int(machine.value("KINS", "JOINTS"))) for key in ("FERROR", "MIN_FERROR")]
    ini.write_text(ini_edit.edited(machine.text, [
        {"section": section, "key": key, "lines": [f"{key} = {value}"]} for section, key, value in [*far, *edits]]))
    (folder / f"{machine.name}.tbl").write_text("T1 P1 Z0 D1\n")
    file.write_text(program)
    return ini, file


def judged(job):
    """Returns preflight's verdict on a program of a machine with these edits."""
    machine, edits, program = job
    with tempfile.TemporaryDirectory(prefix="pkmkins-limits-") as scratch:
        ini, file = written(Path(scratch) / "case", machine, edits, program)
        done = subprocess.run([PKM, "preflight", ini, file, "--format", "json"], stdin=subprocess.DEVNULL,
                              capture_output=True, text=True)
        found = json.loads(done.stdout) if done.stdout else {}
        return found if "breaks" in found else {"breaks": [], "fits": None, "refused": done.stdout + done.stderr}


def ran(machine, edits, program):
    with tempfile.TemporaryDirectory(prefix="pkmkins-limits-") as scratch:
        ini, file = written(Path(scratch) / "case", machine, edits, program)
        trace = Path(scratch) / "trace.csv"
        subprocess.run([PKM, "run", ini, file, "--trace", trace], stdin=subprocess.DEVNULL, capture_output=True, check=True)
        return Run(trace)


def program_of(machine):
    """Returns straight moves within the axis limits, with exact stops."""
    letters = [letter for letter in "XYZAB" if letter in machine.moved + machine.table]
    lines = ["G21 G17 G40 G49 G54 G80 G90 G94 G61"]
    for shares in MOVES:
        words = []
        for letter in letters:
            k = "XYZAB".index(letter)
            share = shares[k] if k < 3 else TILTS * shares[k - 3]
            low, high = (float(machine.value(f"AXIS_{letter}", key)) for key in ("MIN_LIMIT", "MAX_LIMIT"))
            home = machine.home[k]
            words.append(f"{letter}{home + share * ((high if share > 0 else low) - home) * np.sign(share):.4f}")
        lines.append(f"G1 {' '.join(words)} F3000")
    return "\n".join([*lines, "M2", ""])


def first_beyond(values, lines):
    """Returns the line in which the values rise most above all before, and a limit halfway."""
    best = None
    before = values[lines <= 1].max(initial=values[0])
    for line in sorted(set(lines[lines > 1])):
        most = values[lines == line].max()
        if best is None or most - before > best[0]:
            best = (most - before, int(line), (most + before) / 2)
        before = max(before, most)
    return best


def open_edits(machine):
    """Returns edits that open all limits of poses."""
    of = [(f"JOINT_{n}", "MIN_LIMIT", -1e4) for n in range(3)] + [(f"JOINT_{n}", "MAX_LIMIT", 1e4) for n in range(3)]
    of += [(f"AXIS_{letter}", key, sign * 1e4) for letter in machine.moved for key, sign in (("MIN_LIMIT", -1), ("MAX_LIMIT", 1))]
    return of + [(f"LEG_{n}", "BASE_CONE", 179.0) for n in range(3)] + [
        ("PKM", "ROD_CLEARANCE", 1e-3), ("PKM", "CONDITIONING_LIMIT", 1e-9)]


def cases(machine):
    """Returns the cases: name, edits, program, and the expected limit with its line, if any."""
    program = program_of(machine)
    run = ran(machine, [], program)
    kept, found = {}, {}
    for kind, part, edits, values in machine.series(run):
        span = values.max() - values.min()
        # What does not move has no limit to violate.
        if span < 1e-6:
            continue
        # The guard slows the machine from twice the conditioning limit.
        limit = values.max() / 2.1 if kind == "hold" else values.max() + BESIDE * span
        kept |= {(section, key): (section, key, value) for section, key, value in edits(limit)}
        rise, line, limit = first_beyond(values, run.lines)
        if rise / span > found.get(kind, (0.0,))[0]:
            found[kind] = (rise / span, part, edits(limit), line)
    yield "all kept", list(kept.values()), program, None
    for kind, (_, part, edits, line) in found.items():
        yield kind, edits, program, (kind, part, line)
    lines = program.splitlines()
    lines[2:-1] = [f"G1 {UNREACHED[machine.name]} F3000"]
    yield "reach", open_edits(machine), "\n".join([*lines, ""]), ("reach", "", 3)


def difference(verdict, expected):
    """Returns how a verdict differs from the expected one."""
    breaks = [(found["limit"], found["part"], found["line"]) for found in verdict["breaks"]]
    if "refused" in verdict:
        return verdict["refused"]
    if expected is None:
        texts = [found["text"] for found in verdict["breaks"]]
        return "" if verdict["fits"] is True and not breaks else f"{breaks} instead of none: {texts}"
    kind, part, line = expected
    # A stop by LinuxCNC belongs to the limit at which it stops; the approach to a singular pose may end at its limit.
    others = {"linuxcnc"}
    if kind == "reach":
        # A singular pose, before which joints become fast.
        others |= {"hold", "reach", "speed", "acceleration"}
        kind = "hold" if ("hold", "the conditioning", line) in breaks else kind
    same = [found for found in breaks if found[0] == kind and found[2] == line and part in found[1]]
    # The guard stops the machine on the way to a singular pose.
    is_early = kind == "hold"
    extra = [found for found in breaks if found[0] not in {kind, *others}
             or found[2] != line and not (is_early and found[0] == "linuxcnc" and found[2] < line)]
    if verdict["fits"] is not False or not same or extra:
        return f"{breaks} instead of {expected}"
    return ""


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--only", default="", help="machines and limits whose names match this expression")
    options = arguments.parse_args()
    listed = []
    for name in ("tricept", "exechon", "z3-head"):
        machine = Machine(name)
        listed += [(machine, *case) for case in cases(machine) if re.search(options.only, f"{name} {case[0]}")]
    with ProcessPoolExecutor(AT_ONCE) as pool:
        verdicts = list(pool.map(judged, [(machine, edits, program) for machine, _, edits, program, _ in listed]))
    wrong = 0
    print("| machine | limit | line | |\n| --- | --- | --: | --- |")
    for (machine, name, _, _, expected), verdict in zip(listed, verdicts):
        why = difference(verdict, expected)
        wrong += bool(why)
        print(f"| {machine.name} | {name} | {expected[2] if expected else ''} | {why or 'equal'} |")
    print(f"limits: {len(listed)} programs, {wrong} with another verdict than their servo cycles")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
