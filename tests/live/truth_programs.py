# SPDX-License-Identifier: GPL-2.0-or-later
"""The programs of `truth.py`: shipped ones, those of LinuxCNC, generated ones and deliberately bad ones.

All programs are generated from a seed; the same seed gives the same programs.
"""

import csv
import io
import json
import random
import re
import shutil
import subprocess
import tempfile
import tomllib
from math import cos, hypot, pi, sin
from pathlib import Path
from typing import NamedTuple

import ini_edit

LETTERS = "XYZABC"
ALL_LETTERS = "XYZABCUVW"
NC_FILES = Path("/usr/share/linuxcnc/ncfiles")
# Read by workbench/program/tests/reading.rs as well.
READING = Path(__file__).resolve().parents[1] / "cases/reading/reading.toml"

# LinuxCNC's programs that are short enough, with their machine and work offset.
LINUXCNC = [
    ("polar", "hexapod", {"Z": 112.8}),
    ("hole-circle", "hexapod", {"Z": 150}),
    ("daisy", "hexapod", {"Z": 130}),
    ("3dtest", "hexapod", {"Z": 160}),
    ("b-index", "hexapod", {"Z": 160}),
    ("comp", "hexapod", {"Z": 160}),
    ("polar", "pyramid", {"Z": 170}),
    ("hole-circle", "four-rod-lathe", {"Y": 450, "Z": 1000}),
    ("daisy", "lab-hexapod", {"Z": 600}),
]

# Programs that every test run also runs live, some seconds each: every machine, moves of all kinds, tools,
# the spindle, the guard, and programs that LinuxCNC stops.
SHORT = {"hexapod": ("tilted-tools", "inverse-time", "spindle", "too-fast", "reading-moves-of-a-preview",
                     "reading-a-deleted-move", "reading-steps-after-a-tool", "reading-a-tap-that-runs-on"),
         "linear-delta": ("guarded",),
         "rotary-delta": ("short-rapids", "spindle", "bad-end"),
         "hexapod-rotary-table": ("carried-G64",),
         "lathe-mirrored": ("both",)}
SHORT_OF_OTHERS = ("short-rapids",)


class Program(NamedTuple):
    """A program, and the machine that it runs on."""
    name: str
    machine: str
    kind: str
    text: str
    edits: tuple = ()  # of the INI file
    offset: tuple = ()  # pairs of a letter and its value: the stored G54
    seconds: float = 120.0
    is_random: bool = False
    lines: tuple = None  # in which preflight finds limits, if the case specifies it
    deletes: bool = True  # whether lines that begin with / are skipped: block delete

    def run_text(self):
        """Returns the text with the same effect under block delete, which is always on in virtual time."""
        return self.text if self.deletes else re.sub(r"^/", "", self.text, flags=re.M)


def is_short(program):
    return program.name in SHORT.get(program.machine, SHORT_OF_OTHERS)


class Config:
    """The data of a shipped configuration."""

    def __init__(self, folder):
        self.name = folder.name
        self.file = folder / f"{folder.name}.ini"
        self.text = self.file.read_text()
        coordinates = self.value("TRAJ", "COORDINATES").replace(" ", "")
        # Without those of axes that move neither tool nor workpiece in space, and of a second mechanism.
        passed = self.passed = ini_edit.extra_letters(self.text)
        others = passed + ini_edit.second_letters(self.text)
        self.letters = [letter for letter in LETTERS if letter in coordinates and letter not in others]
        home = [float(word) for word in self.value("TRAJ", "HOME").split()]
        self.home = dict(zip(ALL_LETTERS, home + [0.0] * 9))
        # Letters of the second mechanism.
        self.others = ini_edit.second_letters(self.text)
        # Letters of axes that carry workpiece, tool or legs: the programmed pose then differs from the machine's own.
        self.carrying = re.findall(r"^\[CHAIN_(.)\]", self.text, re.M)
        self.is_carried = bool(self.carrying) or bool(re.search(r"^WORK_ON_PLATFORM", self.text, re.M))
        self.low, self.high, self.fastest = ({
            letter: float(self.value(f"AXIS_{letter}", key)) for letter in [*self.letters, *self.others, *passed]}
            for key in ("MIN_LIMIT", "MAX_LIMIT", "MAX_VELOCITY"))
        # Joints of legs and table.
        self.joints = int(self.value("KINS", "JOINTS")) - len(passed) - ini_edit.second_legs(self.text)
        self.speed = float(self.value("TRAJ", "MAX_LINEAR_VELOCITY"))
        self.acceleration = float(self.value("TRAJ", "MAX_LINEAR_ACCELERATION"))
        inch = self.value("TRAJ", "LINEAR_UNITS") == "inch"
        self.start = f"{'G20' if inch else 'G21'} G17 G40 G49 G54 G80 G90 G94"
        # Free space about the home pose in X Y Z, by which programs are scaled.
        self.room = min(min(self.high[l] - self.home[l], self.home[l] - self.low[l])
                        for l in self.letters if l in "XY")

    def value(self, section, key):
        return ini_edit.value(self.text, section, key)

    def joint_value(self, joint, key):
        return float(self.value(f"JOINT_{joint}", key))

    def joint_values(self, pkm, poses):
        """Returns the joint values of poses, one list each; None if there are none."""
        rows = io.StringIO()
        writer = csv.writer(rows)
        writer.writerow([letter.lower() for letter in LETTERS])
        writer.writerows([[pose.get(letter, 0.0) for letter in LETTERS] for pose in poses])
        done = subprocess.run([pkm, "joints", self.file], input=rows.getvalue(), text=True,
                              capture_output=True)
        found = list(csv.reader(io.StringIO(done.stdout)))[1:]
        if len(found) != len(poses):
            return None
        return [[float(value) for value in row] for row in found]

    def replayed(self, pkm, text):
        """Returns the joint values of a program at a constant period, as lists by its lines."""
        done = subprocess.run([pkm, "replay", self.file, "-", "--period", "0.01"], input=text, text=True,
                              capture_output=True)
        rows = {}
        for row in csv.DictReader(io.StringIO(done.stdout)):
            values = [float(row[f"joint_{n}"]) for n in range(self.joints)]
            rows.setdefault(int(row["line"]), []).append(values)
        return rows

    def between(self, share, letter):
        return self.low[letter] + share * (self.high[letter] - self.low[letter])


def words(place):
    return " ".join(f"{letter}{value:.4f}" for letter, value in place.items())


def all_programs(configs, pkm):
    """Returns all programs, in a fixed order."""
    machines = {config.name: config for config in configs}
    programs = []
    for config in configs:
        programs += shipped(config)
        # The second half searches for moves in the machine's own poses.
        for generated in (random_moves, short_rapids, circles, corners, far_rapids, bad_end,
                          *((carried, carried_too_fast, carried_middle) if config.is_carried
                            else (too_fast, broken_middle, narrow_cone))):
            programs += generated(config, pkm)
        if config.others:
            programs += both(config)
    for name in ("hexapod", "linear-delta"):
        programs += misplaced(machines[name], pkm) + suggested_limits(machines[name], pkm)
    programs += [from_linuxcnc(*entry, machines[entry[1]]) for entry in LINUXCNC]
    programs += singular(machines["hexapod"]) + singular(machines["lab-hexapod"])
    for config in configs:
        programs += modes(config)
    for name in ("hexapod", "pyramid", "tripod"):
        programs += cycles_and_words(machines[name])
    for name in ("hexapod", "four-rod-lathe"):
        programs += inverse_time(machines[name])
    for name in ("hexapod", "four-rod-lathe", "rotary-delta"):
        programs += spindle(machines[name])
    for name in ("hexapod", "lab-hexapod", "pyramid"):
        programs += tilted_tool_changes(machines[name])
    programs += guarded(machines["linear-delta"]) + reading()
    return programs


def reading():
    """Returns programs that a reader other than the control interprets differently; those with / in both versions."""
    programs = []
    for case in tomllib.loads(READING.read_text())["case"]:
        name = "reading-" + re.sub(r"\W+", "-", case["name"]).strip("-")
        lines, kept = case["lines"], case.get("kept", [])
        program = Program(name, case.get("machine", "hexapod"), "reading", case["program"] + "\nM2\n",
                          tuple(case.get("edit", ())), lines=tuple(sorted({*lines, *kept})))
        programs.append(program)
        if "kept" in case:
            programs.append(program._replace(name=f"{name}-kept", lines=tuple(kept), deletes=False))
    return programs


def shipped(config):
    """Returns the programs of the configuration, with the guard off: it would slow them down."""
    files = sorted((config.file.parent / "programs").glob("*.ngc"))
    return [Program(f"shipped-{file.stem}", config.name, "shipped",
                    file.read_text().replace("M52 P1", "M52 P0")) for file in files]


def from_linuxcnc(name, machine, offset, config):
    text = (NC_FILES / f"{name}.ngc").read_text(errors="replace")
    return Program(f"linuxcnc-{name}", machine, "linuxcnc", text, offset=tuple(offset.items()))


def random_moves(config, pkm):
    """Returns straight moves of `pkm random` with and without blending, without the guard."""
    made = []
    for seed, mode in ((11, "G64"), (12, "G61")):
        done = subprocess.run([pkm, "random", config.file, "--seed", str(seed), "--seconds", "6"], check=True, text=True,
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE)
        text = done.stdout.replace("M52 P1", "M52 P0").replace("G94 G64", f"G94 {mode}")
        made.append(Program(f"random-{mode}", config.name, "random", text))
    return made


def short_rapids(config, pkm):
    """Returns rapids that never reach their speed, of the length of a speed ramp and far below."""
    draw = random.Random(f"rapids {config.name}")
    ramp = config.speed ** 2 / config.acceleration
    lines = [f"{config.start} G61", "M52 P0"]
    for _ in range(24):
        length = min(ramp, config.room) * 10 ** draw.uniform(-2, 0)
        there = dict(config.home)
        for letter in config.letters:
            turn = letter in "ABC"
            there[letter] += length * draw.uniform(-0.5, 0.5) * (10 / config.room if turn else 1)
        place = {letter: there[letter] for letter in config.letters}
        lines += [f"G0 {words(place)}", f"G0 {words({l: config.home[l] for l in config.letters})}"]
    return [Program("short-rapids", config.name, "rapids", "\n".join(lines + ["M2", ""]))]


def circles(config, pkm):
    """Returns full circles and helices from small to large, at feeds that curvature limits and that it does not."""
    x, y, z = (config.home[l] for l in "XYZ")
    lines = [f"{config.start} G64", "M52 P0", f"G0 X{x:.4f} Y{y:.4f}"]
    for share in (0.02, 0.1, 0.3):
        radius = share * config.room
        for feed in (0.3, 1.0):
            lines.append(f"G2 I{radius:.4f} J0 F{60 * feed * config.speed:.2f}")
            lines.append(f"G3 X{x:.4f} Y{y:.4f} I{radius:.4f} J0 Z{z - 0.5 * radius:.4f} P2")
            lines.append(f"G1 Z{z:.4f}")
    return [Program("circles", config.name, "arcs", "\n".join(lines + ["M2", ""]))]


def corners(config, pkm):
    """Returns polygons with few and with many corners, blended with several tolerances and without blending."""
    x, y = config.home["X"], config.home["Y"]
    radius = 0.2 * config.room
    lines = [config.start, "M52 P0"]
    for mode in ("G61", "G64", f"G64 P{0.02 * radius:.5f}", f"G64 P{0.0005 * radius:.6f}"):
        for count in (3, 5, 24, 120):
            lines += [mode, f"G1 F{60 * 0.5 * config.speed:.3f} X{x + radius:.4f} Y{y:.4f}"]
            lines += [f"X{x + radius * cos(2 * pi * n / count):.4f} Y{y + radius * sin(2 * pi * n / count):.4f}"
                      for n in range(1, count + 1)]
    return [Program("corners", config.name, "corners", "\n".join(lines + ["M2", ""]))]


def far_rapids(config, pkm):
    """Returns long rapids in position and angles through the whole range, one after another and blended."""
    draw = random.Random(f"far {config.name}")
    lines = [f"{config.start} G64", "M52 P0"]
    for _ in range(6):
        place = {l: config.home[l] + 0.5 * (config.between(draw.random(), l) - config.home[l])
                 for l in config.letters}
        lines.append(f"G0 {words(place)}")
    return [Program("far-rapids", config.name, "rapids", "\n".join(lines + ["M2", ""]), seconds=240)]


def swept(config, pkm, wanted, tries=40, at_once=50):
    """Returns a move with its joint values at 33 positions: the first that `wanted` accepts. The path to it from
    home is a second list."""
    draw = random.Random(f"sweep {config.name} {wanted.__name__}")
    for _ in range(tries):
        moves = [random_ends(config, draw) for _ in range(at_once)]
        places = [place for ends in moves for way in (ends, (config.home, ends[0]))
                  for place in along(config, *way)]
        values = config.joint_values(pkm, places)
        for n, ends in enumerate(moves):
            first = 66 * n
            if values and (found := wanted(config, values[first:first + 33], values[first + 33:first + 66])):
                return ends, found
    raise RuntimeError(f"{config.name}: no move for {wanted.__name__}")


def random_ends(config, draw):
    """Returns ends far in some letters and near in others, so that joints reverse."""
    begin, end = ({l: config.home[l] + 0.8 * (config.between(draw.random(), l) - config.home[l])
                   for l in config.letters} for _ in range(2))
    for letter in config.letters:
        end[letter] = begin[letter] + draw.choice((0, 0.1, 0.3, 1)) * (end[letter] - begin[letter])
    return begin, end


def along(config, begin, end):
    return [{l: begin[l] + n / 32 * (end[l] - begin[l]) for l in config.letters} for n in range(33)]


def bulge(config, way, there):
    """Returns a joint farther out in the middle than at the ends, and a limit between."""
    for joint in range(config.joints):
        span = config.joint_value(joint, "MAX_LIMIT") - config.joint_value(joint, "MIN_LIMIT")
        for side, key in ((1, "MAX_LIMIT"), (-1, "MIN_LIMIT")):
            most = max(side * row[joint] for row in way)
            before = max(side * row[joint] for row in [way[0], way[-1], *there])
            if most - before > 0.001 * span:
                return joint, key, side * (most + before) / 2
    return None


def back_and_forth(config, ends):
    lines = [f"{config.start} G61", "M52 P0"]
    for place in (ends[0], ends[1], ends[0]):
        lines.append(f"G1 F{60 * 0.5 * config.speed:.3f} {words(place)}")
    return "\n".join(lines + ["M2", ""])


def broken_middle(config, pkm):
    """Returns a move with both ends legal and the middle beyond a joint's range: the INI file's limit is narrowed."""
    ends, (joint, key, value) = swept(config, pkm, bulge)
    edit = {"section": f"JOINT_{joint}", "key": key, "lines": [f"{key} = {value:.6f}"]}
    return [Program("broken-middle", config.name, "middle", back_and_forth(config, ends), (edit,))]


def too_fast(config, pkm):
    """Returns a joint slower than the feed requires, on one line of three."""
    def busy(config, way, there):
        joint = max(range(config.joints), key=lambda j: max(abs(a[j] - b[j]) for a, b in zip(way, way[1:])))
        return joint, max(abs(a[joint] - b[joint]) for a, b in zip(way, way[1:])) * 32
    ends, (joint, travel) = swept(config, pkm, busy)
    length = hypot(*(ends[1][l] - ends[0][l] for l in config.letters if l in "XYZ"))
    turn = max([abs(ends[1][l] - ends[0][l]) / config.fastest[l] for l in config.letters])
    seconds = max(length / (0.8 * config.speed), turn)
    limit = 0.7 * travel / seconds
    edit = {"section": f"JOINT_{joint}", "key": "MAX_VELOCITY", "lines": [f"MAX_VELOCITY = {limit:.6f}"]}
    slow, fast = 0.4 * 60 * length / seconds, 60 * length / seconds
    lines = [f"{config.start} G61", "M52 P0", f"G1 F{60 * 0.3 * config.speed:.3f} {words(ends[0])}",
             f"G1 F{slow:.3f} {words(ends[1])}", f"G1 F{fast:.3f} {words(ends[0])}"]
    return [Program("too-fast", config.name, "speed", "\n".join(lines + ["M2", ""]), (edit,))]


def turning(config):
    """Returns the letter of the rotation to test: an axis that carries something, otherwise a tilt of the workpiece."""
    return (config.carrying or ["B"])[0]


def some_turn(config, share):
    """Returns a value of that letter, as a fraction of an eighth of a turn, or of three quarters of its limits."""
    letter = turning(config)
    return share * min(45.0, 0.75 * min(config.high[letter], -config.low[letter]) / max(1.0, abs(share)))


def carried(config, pkm):
    """Returns straight moves and arcs during which a carrying axis rotates, in every mode of blending."""
    made = []
    for mode in ("G61", "G64", "G64 P0.05"):
        draw = random.Random(f"carried {config.name}")
        lines = [f"{config.start} {mode}", "M52 P0", f"F{60 * 0.1 * config.speed:.3f}"]
        for n in range(10):
            place = {l: config.home[l] + 0.15 * config.room * draw.uniform(-1, 1) for l in "XYZ"}
            turn = f"{turning(config)}{some_turn(config, draw.uniform(-1, 1)):.4f}"
            arc = f"G2 {words(place)} R{0.4 * config.room:.4f}"
            lines.append(f"{arc if n % 3 == 2 else 'G1 ' + words(place)} {turn}")
        home = words({l: config.home[l] for l in "XYZ"})
        lines += [f"G1 {home} {turning(config)}0", f"G0 {turning(config)}{some_turn(config, 1):.4f}",
                  f"G0 {turning(config)}0", "M2", ""]
        made.append(Program(f"carried-{mode.replace(' ', '-')}", config.name, "carried", "\n".join(lines)))
    return made


def beside_home(config, draw):
    """Returns a position off the letter's rotation axis, as a line."""
    place = {l: config.home[l] + 0.7 * config.room * draw.uniform(-1, 1) for l in "XYZ"}
    return f"G1 F{60 * 0.1 * config.speed:.3f} {words(place)}"


def carried_too_fast(config, pkm):
    """Returns a joint slower than following the rotation requires, on one line of three."""
    letter, turn = turning(config), some_turn(config, 1)
    fast = 60 * config.fastest[letter]
    lines = [f"{config.start} G61", "M52 P0", beside_home(config, random.Random(f"fast {config.name}")),
             f"G1 {letter}{turn:.4f} F{0.4 * fast:.3f}", f"G1 {letter}0 F{fast:.3f}", "M2", ""]
    way = config.replayed(pkm, "\n".join(lines))[5]
    speeds = [max(abs(b[j] - a[j]) for a, b in zip(way, way[1:])) / 0.01 for j in range(config.joints)]
    joint = max(range(config.joints), key=speeds.__getitem__)
    edit = {"section": f"JOINT_{joint}", "key": "MAX_VELOCITY", "lines": [f"MAX_VELOCITY = {0.7 * speeds[joint]:.6f}"]}
    return [Program("carried-too-fast", config.name, "speed", "\n".join(lines), (edit,))]


def carried_middle(config, pkm):
    """Returns a rotation with both ends legal and a joint beyond its range between."""
    draw, letter = random.Random(f"middle {config.name}"), turning(config)
    feed = f"F{0.5 * 60 * config.fastest[letter]:.3f}"
    for _ in range(30):
        begin = some_turn(config, draw.choice((-2, -1, 1, 2)))
        # The position comes after the first rotation: after it no pose of the second one was passed before.
        lines = [f"{config.start} G61", "M52 P0", f"G1 {letter}{begin:.4f} {feed}", beside_home(config, draw),
                 f"G1 {letter}{-begin:.4f} {feed}", f"G1 {letter}{begin:.4f}", "M2", ""]
        rows = config.replayed(pkm, "\n".join(lines))
        if 5 in rows and (found := bulge(config, rows[5], rows[3] + rows[4])):
            joint, key, value = found
            edit = {"section": f"JOINT_{joint}", "key": key, "lines": [f"{key} = {value:.6f}"]}
            return [Program("carried-middle", config.name, "middle", "\n".join(lines), (edit,))]
    raise RuntimeError(f"{config.name}: no turn with a joint farther out in its middle")


def both(config):
    """Returns moves in which both mechanisms move, one stands, and each has its own angle; then one too slow for it."""
    draw = random.Random(f"both {config.name}")
    letters = [*config.letters, *config.others]
    lines = [config.start, "M52 P0", f"F{60 * 0.2 * config.speed:.3f}"]
    for mode in ("G61", "G64", "G64 P0.05"):
        lines.append(mode)
        for n in range(6):
            moved = (letters, config.letters, config.others)[n % 3]
            place = {l: config.home[l] + 0.2 * (config.between(draw.random(), l) - config.home[l]) for l in moved}
            lines.append(f"{'G0' if n == 5 else 'G1'} {words(place)}")
    lines += [f"G1 {words({l: config.home[l] for l in letters})}", "M2", ""]
    text = "\n".join(lines)
    slow = {"section": f"JOINT_{config.joints}", "key": "MAX_VELOCITY",
            "lines": [f"MAX_VELOCITY = {0.02 * config.speed:.6f}"]}
    return [Program("both", config.name, "both", text), Program("second-too-fast", config.name, "speed", text, (slow,))]


def narrow_cone(config, pkm):
    """Returns a base joint whose cone is too narrow, which LinuxCNC does not detect."""
    sections = re.findall(r"^\[(LEG_\d+)\]", config.text, re.M)
    edit = {"section": sections[0], "key": "BASE_CONE", "lines": ["BASE_CONE = 2"]}
    place = {l: config.home[l] + 0.6 * (config.between(0.9, l) - config.home[l])
             for l in config.letters if l in "XYZ"}
    lines = [f"{config.start} G61", "M52 P0", f"G0 {words(place)}"]
    return [Program("narrow-cone", config.name, "cone", "\n".join(lines + ["M2", ""]), (edit,))]


def bad_end(config, pkm):
    """Returns an end beyond the axis limits, which LinuxCNC checks itself."""
    letter = config.letters[0]
    room = config.high[letter] - config.home[letter]
    lines = [f"{config.start} G61", "M52 P0",
             f"G1 F{60 * 0.5 * config.speed:.3f} {letter}{config.home[letter] + 0.2 * room:.4f}",
             f"{letter}{config.home[letter]:.4f}", f"{letter}{config.high[letter] + 0.1 * room:.4f}",
             f"{letter}{config.home[letter]:.4f}"]
    return [Program("bad-end", config.name, "end", "\n".join(lines + ["M2", ""]))]


def singular(config):
    """Returns a rotation about Z to a singularity, with wide axis and joint limits."""
    edits = [{"section": "AXIS_C", "key": "MAX_LIMIT", "lines": ["MAX_LIMIT = 180"]}]
    edits += [{"section": f"LEG_{n}", "key": "BASE_CONE", "lines": ["BASE_CONE = 89"]} for n in range(6)]
    edits += [{"section": f"JOINT_{n}", "key": key, "lines": [f"{key} = {value}"]}
              for n in range(6) for key, value in (("MIN_LIMIT", 10), ("MAX_LIMIT", 3000))]
    lines = [f"{config.start} G61", "M52 P0", "G1 F600 C10", "G1 F600 C130", "G1 F600 C0", "M2", ""]
    return [Program("singular", config.name, "singular", "\n".join(lines), tuple(edits), seconds=30)]


def misplaced(config, pkm):
    """Returns programs that fit only elsewhere, each with the work offset that preflight suggests for it."""
    side = config.high["X"] - config.low["X"]
    # Too long for the box along X, but not along its diagonal.
    turned = [{"X": 0.58 * side}, {"X": -0.58 * side}]
    shifted = [{"X": 0.7 * side, "Y": 0.2 * side}, {"X": 0.9 * side, "Y": 0.2 * side}]
    return [Program(name, config.name, name, suggested(config, pkm, places))
            for name, places in (("turned", turned), ("shifted", shifted))]


def suggested(config, pkm, places):
    # Without blending, which depends on the number of moves that the interpreter reads in the first cycle.
    begun = [f"{config.start} G61", "M52 P0"]
    moves = [f"G1 F{60 * 0.5 * config.speed:.3f} {words(place)}" for place in (*places, places[0])]
    with tempfile.NamedTemporaryFile("w", suffix=".ngc") as file:
        file.write("\n".join([*begun, *moves, "M2", ""]))
        file.flush()
        done = subprocess.run([pkm, "preflight", config.file, file.name, "--format", "json"], text=True,
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE)
    block = json.loads(done.stdout)["offset"]["block"]
    # The programs after this one get their old offset back.
    return "\n".join([*begun, block, *moves, "G10 L2 P1 X0 Y0 Z0 R0", "M2", ""])


def suggested_limits(config, pkm):
    """Returns moves between corners of the axis limits that check suggests if the file's are too wide."""
    wide = [axis_limits(letter, config.between(-0.3, letter), config.between(1.3, letter))
            for letter in config.letters]
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(shutil.copytree(config.file.parent, Path(scratch) / config.name))
        ini = folder / config.file.name
        ini.write_text(ini_edit.edited(config.text, sum(wide, [])))
        done = subprocess.run([pkm, "check", ini], text=True, stdin=subprocess.DEVNULL, capture_output=True)
    found = re.findall(r"^\[AXIS_(.)\]\nMIN_LIMIT = (\S+)\nMAX_LIMIT = (\S+)", done.stdout, re.M)
    limits = {letter: (float(low), float(high)) for letter, low, high in found}
    assert set(limits) == set(config.letters), f"{config.name}: no limits suggested: {done.stdout}{done.stderr}"
    edits = sum((axis_limits(letter, *ends) for letter, ends in limits.items()), [])
    corners = [{letter: ends[(n >> k % 3) & 1] for k, (letter, ends) in enumerate(limits.items())}
               for n in range(8)]
    moves = [f"G1 F{60 * 0.2 * config.speed:.3f} {words(corner)}" for corner in corners]
    text = "\n".join([f"{config.start} G61", "M52 P0", *moves, "M2", ""])
    return [Program("suggested-limits", config.name, "limits", text, tuple(edits))]


def axis_limits(letter, low, high):
    return [{"section": f"AXIS_{letter}", "key": key, "lines": [f"{key} = {value:.6f}"]}
            for key, value in (("MIN_LIMIT", low), ("MAX_LIMIT", high))]


def modes(config):
    """Returns lines, arcs in all planes, helices and short lines in every mode of blending."""
    x, y, z = (config.home[l] for l in "XYZ")
    radius = 0.08 * config.room
    wide, near = 0.05 * radius, 0.002 * radius
    lines = [config.start, "M52 P0", f"F{60 * 0.6 * config.speed:.3f}"]
    for mode in ("G61", "G61.1", "G64", f"G64 P{wide:.6f}", f"G64 P{wide:.6f} Q{near:.6f}", f"G64 P{near:.6f}"):
        lines += [mode, f"G1 X{x + radius:.6f} Y{y:.6f} Z{z:.6f}", f"Y{y + radius:.6f}",
                  f"G3 X{x:.6f} Y{y + 2 * radius:.6f} I{-radius:.6f}", f"G1 X{x - radius:.6f}",
                  f"G2 X{x - radius:.6f} Y{y:.6f} Z{z - radius:.6f} J{-radius:.6f}",
                  f"G18 G2 X{x - 2 * radius:.6f} Z{z:.6f} K{radius:.6f}",
                  f"G19 G3 Y{y - radius:.6f} Z{z - radius:.6f} K{-radius:.6f}", "G17 G1"]
        lines += [f"X{x - 2 * radius + n * radius / 10:.6f} Y{y - radius + radius / 5 * (n % 2):.6f}"
                  for n in range(1, 21)]
        lines.append(f"G0 X{x:.6f} Y{y:.6f} Z{z:.6f}")
    return [Program("modes", config.name, "modes", "\n".join(lines + ["M2", ""]))]


def cycles_and_words(config):
    """Returns canned cycles, dwells, offsets, outputs, inputs, subroutines and stops."""
    x, y, z = (config.home[l] for l in "XYZ")
    deep, side = 0.05 * config.room, 0.08 * config.room
    feed = f"F{60 * 0.3 * config.speed:.3f}"
    hole = f"X{side:.5f} Y{side:.5f} Z{-deep:.5f} R{0.2 * deep:.5f}"
    return [Program("cycles", config.name, "cycles", "\n".join([
        f"{config.start} G64", "M52 P0", f"G92 X0 Y0 Z{0.3 * deep:.5f}", feed,
        f"G98 G81 {hole}", f"G73 X0 Y{side:.5f} Z{-deep:.5f} R{0.2 * deep:.5f} Q{0.4 * deep:.5f}",
        f"G99 G83 X{-side:.5f} Y0 Z{-deep:.5f} R{0.2 * deep:.5f} Q{0.4 * deep:.5f}",
        f"G82 X0 Y0 Z{-deep:.5f} R{0.2 * deep:.5f} P0.25",
        f"G91 G81 X{0.2 * side:.5f} Y{0.1 * side:.5f} Z{-deep:.5f} R{0.2 * deep:.5f} L3", "G90 G80",
        f"G0 X0 Y0 Z{0.3 * deep:.5f}", "G4 P0.5", f"G1 X{side:.5f}", "G4 P0.01", f"Y{side:.5f}",
        "M62 P0", "G1 X0", "M63 P0", "Y0", "M66 P0 L0", f"G1 X{side:.5f}", "M68 E3 Q0", "M8", "G1 X0", "M9",
        f"G10 L2 P2 X{0.5 * side:.5f} Y0 Z0", "G55 G92.1", f"G0 X{x:.5f} Y{y:.5f} Z{z:.5f}",
        "o100 sub", f"G1 X[{x:.5f} + #1] Y[{y:.5f} - #1]", "o100 endsub",
        "o101 repeat [3]", f"o100 call [{0.3 * side:.5f}]", f"o100 call [{-0.3 * side:.5f}]", "o101 endrepeat",
        "M1", f"G2 X{x:.5f} Y{y:.5f} R{side:.5f}", "G10 L2 P2 X0 Y0 Z0", "G54",
        f"G0 X{x:.5f} Y{y:.5f} Z{z:.5f}", "M2", ""]))]


def inverse_time(config):
    """Returns feed as the time of a move, with and without angles."""
    x, y = config.home["X"], config.home["Y"]
    side = 0.1 * config.room
    turn = "A" if "A" in config.letters else "B"
    return [Program("inverse-time", config.name, "modes", "\n".join([
        f"{config.start} G64", "M52 P0", "G93", f"G1 X{x + side:.5f} F60", f"Y{y + side:.5f} {turn}3 F30",
        f"{turn}-2 F40", f"G3 X{x:.5f} Y{y + 2 * side:.5f} I{-side:.5f} F50", f"G1 X{x:.5f} Y{y:.5f} {turn}0 F45",
        "G94 F100", f"X{x + 0.1 * side:.5f}", "M2", ""]))]


def spindle(config):
    """Returns feed per revolution, spindle-synchronized moves, and moves that wait for the spindle's speed.

    Before a wait for a position of the spindle the machine stands long enough for the standstill to be detected.
    """
    x, z = config.home["X"], config.home["Z"]
    way = 0.05 * config.room
    pitch = 0.02 * config.speed  # at 10 revolutions a second a fifth of the machine's speed
    return [Program("spindle", config.name, "spindle", "\n".join([
        f"{config.start} G64", "M52 P0", f"G1 X{x + way:.5f} F{60 * 0.3 * config.speed:.3f}", "M3 S600",
        f"G1 X{x:.5f}", "G4 P1", f"G95 F{pitch:.6f}", f"G1 X{x + way:.5f}", f"Y{config.home['Y'] + way:.5f}",
        f"X{x:.5f}", "G4 P0.2", f"G33 Z{z - way:.5f} K{pitch:.6f}", f"G0 Z{z:.5f}",
        "G4 P0.2", f"G33 Z{z - way:.5f} K{pitch:.6f}", f"G0 Z{z:.5f}", "S300", f"G1 X{x + way:.5f}", "M5",
        f"G94 F{60 * 0.3 * config.speed:.3f}", f"X{x:.5f}", "M4 S200", f"G1 X{x + way:.5f}", "M5",
        f"G0 X{x:.5f}", "M2", ""]))]


def tilted_tool_changes(config):
    """Returns changes of the tool offset at a tilt, each followed by a move at once."""
    tilts = [letter for letter in "AB" if letter in config.letters]
    lines = [f"{config.start} G64", "M52 P0", f"F{60 * 0.4 * config.speed:.3f}"]
    for n, change in enumerate(("T1 M6", "G43", "G43.1 X4 Y-3 Z22", "T2 M6 G43", "G49", "G43.1 Z10", "T0 M6 G49")):
        angles = " ".join(f"{letter}{4 * cos(n + 2 * k):.4f}" for k, letter in enumerate(tilts))
        lines += [f"G1 X{0.02 * n * config.room:.4f} {angles}", change]
    level = " ".join(f"{letter}0" for letter in tilts)
    return [Program("tilted-tools", config.name, "tools", "\n".join([*lines, f"G1 X0 {level}", "M2", ""]))]


def guarded(config):
    """Returns faster axes on slower drives: the guard slows the machine down near the edge of the plate."""
    edits = [{"section": section, "key": key, "lines": [f"{key} = {value}"]} for section, key, value in (
        *((f"AXIS_{letter}", "MAX_VELOCITY", 200) for letter in "XYZ"),
        ("TRAJ", "MAX_LINEAR_VELOCITY", 200), ("DISPLAY", "MAX_LINEAR_VELOCITY", 200),
        *((f"JOINT_{n}", "MAX_VELOCITY", 120) for n in range(3)))]
    lines = [config.start, "M52 P1", "G1 F3000 X-40 Y-78 Z20", "G64 P0.01", "F12000"] + 2 * [
        "G1 X40", "G3 X78 Y-40 J38", "G1 Y40", "G3 X40 Y78 I-38", "G1 X-40", "G3 X-78 Y40 J-38",
        "G1 Y-40", "G3 X-40 Y-78 I38"]
    return [Program("guarded", config.name, "guard", "\n".join([*lines, "M2", ""]), tuple(edits))]
