#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Compares the model's leg ends with `pkm rods`, for every shipped machine; tests files with shapes.

    tests/viewer/scene_test.py PKM
"""

import csv
import io
import json
import pathlib
import random
import re
import struct
import subprocess
import sys
import tempfile

REPOSITORY = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(REPOSITORY / "viewer"))
from pkmkins_mesh import MeshError, read as read_mesh  # noqa: E402
from pkmkins_panel import words  # noqa: E402
from pkmkins_refusal import count_legs  # noqa: E402
from pkmkins_scene import Scene, SceneError, cross, norm, subtract  # noqa: E402

# Some roundings of lengths of 1e3.
LENGTH = 1e-9

POSES = 200


def pkm(*arguments, given=""):
    done = subprocess.run([sys.argv[1], *map(str, arguments)], input=given, capture_output=True, text=True)
    if done.returncode == 2:
        sys.exit(done.stderr)
    return done.stdout


def poses(scene, chance):
    """Returns poses within the limits of the axes, as CSV."""
    ranges = {axis["letter"]: (axis["min"], axis["max"]) for axis in scene.axes}
    home = dict(zip("XYZABC", scene.home["pose"]))
    text = io.StringIO()
    rows = csv.writer(text)
    rows.writerow("xyzabc")
    for _ in range(POSES):
        rows.writerow([chance.uniform(*ranges[letter]) if letter in ranges else home[letter] for letter in "XYZABC"])
    return text.getvalue()


def largest_difference(ini, chance):
    """Returns the largest difference of leg ends over random poses with a tool, and the number of poses."""
    scene = Scene(json.loads(pkm("scene", ini)))
    # If the pose is the platform's own, `pkm rods` has no tool.
    own = [chance.uniform(-20, 20) * scene.units_per_mm * scene.sees_tool for _ in range(3)]
    tool = (own[0], own[1], own[2] + scene.spindle_offset)
    table = pkm("rods", ini, "--tool", *own, given=poses(scene, chance))
    worst, count = 0, 0
    for row in csv.DictReader(io.StringIO(table)):
        numbers = {name: float(value) for name, value in row.items() if value}
        joints = [numbers[f"joint_{n}"] for n in range(len(scene.legs))]
        place = scene.place(joints, [numbers[letter] for letter in "xyzabc"], tool)
        for n, ends in enumerate(zip(place.lower, place.upper)):
            for name, end in zip(("base", "platform"), ends):
                worst = max(worst, norm(subtract(end, [numbers[f"{name}_{n}_{axis}"] for axis in "xyz"])))
        count += 1
    return worst, count


CORNERS = [(0, 0, 0), (2, 0, 0), (0, 3, 0)]


def shapes(folder):
    """Tests files of one triangle, and files without one, with a word of the message for each."""
    text = "solid a\nfacet normal 0 0 1\nouter loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in CORNERS)
    good = {
        "text.stl": (text + "endloop\nendfacet\nendsolid\n").encode(),
        "binary.stl": bytes(80) + struct.pack("<I12fH", 1, 0, 0, 1, *sum(CORNERS, ()), 0),
        "square.obj": b"# a\nv 0 0 0\nv 2 0 0\nv 2 3 0\nv 0 3 0\nvn 0 0 1\nf 1//1 2//1 3//1\nf -4 -2 -1\n",
    }
    bad = {
        "cut.stl": (good["binary.stl"][:-9], "neither"), "empty.stl": (b"", "neither"),
        "half.stl": (text.encode().rsplit(b"vertex", 1)[0], "is incomplete"), "words.stl": (b"solid a\nvertex 1 x 2\n", "could not"),
        "none.obj": (b"v 0 0 0\n", "no triangles"), "far.obj": (b"v 0 0 0\nf 1 2 3\n", "does not exist"),
        "nan.obj": (b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "NaN"),
    }
    for name, data in [*good.items(), *((name, data) for name, (data, _) in bad.items())]:
        (folder / name).write_bytes(data)
    with open(folder / "huge.stl", "wb") as huge:
        huge.truncate(100_000_000)
    return good, {**{name: word for name, (_, word) in bad.items()}, "huge.stl": "100 MB", "missing.stl": "No such file"}


def shapes_failed():
    failed = 0
    with tempfile.TemporaryDirectory() as place:
        good, bad = shapes(pathlib.Path(place))
        for name in good:
            triangles = read_mesh(f"{place}/{name}")
            area = sum(norm(cross(subtract(b, a), subtract(c, a))) / 2 for a, b, c in triangles)
            fits = abs(area - (6 if name == "square.obj" else 3)) < LENGTH
            failed += not fits
            print(f"{'PASS' if fits else 'FAIL'} {name}: {len(triangles)} triangles")
        for name, word in bad.items():
            try:
                read_mesh(f"{place}/{name}")
                said = "is taken for a shape"
            except MeshError as error:
                said = str(error)
            failed += word not in said
            print(f"{'PASS' if word in said else 'FAIL'} {name}: {said[-70:]}")
    return failed


def words_failed():
    """Checks that the panel's text of a refusal is the core's, without the value."""
    ini = REPOSITORY / "configs/linear-delta/linear-delta.ini"
    done = subprocess.run([sys.argv[1], "joints", ini, "--pose", "9999", *"00000"], capture_output=True, text=True)
    core = re.sub(r" \(value [^)]*\)", "", done.stderr.removeprefix("pkm: ")).strip()
    pins = {"pkmkins.limit-soon": False, "pkmkins.fault": -19, "pkmkins.fault-leg": 0}
    pins.update({f"pkmkins.base.{n}.x": 0.0 for n in range(3)})

    def value(name):
        if name not in pins:
            raise RuntimeError(name)
        return pins[name]

    said = [words(value, count_legs(value))]
    pins.update({"pkmkins.limit-soon": True, "pkmkins.limit-reason": -90, "pkmkins.limit-leg": 3})
    said.append(words(value, count_legs(value)))
    good = (said[0] == f"last: {core}" and said[1].endswith("\n" + said[0]) and
            said[1].startswith("ahead: joint 3: the joint reaches the end of its range"))
    print(f"{'PASS' if good else 'FAIL'} a refusal in words: {said[0]}")
    return not good


def main():
    wrong, failed, chance = shapes_failed() + words_failed(), 0, random.Random(20)
    inis = sorted(REPOSITORY.glob("configs/*/*.ini"))
    for ini in inis:
        worst, count = largest_difference(ini, chance)
        good = worst < LENGTH and count > POSES / 2
        failed += not good
        print(f"{'PASS' if good else 'FAIL'} {ini.stem}: ends of legs within {worst:.1e} over {count} poses")
    for text in ("[]", '{"version": 2}', "no JSON"):
        try:
            Scene(json.loads(text))
            print(f"FAIL {text} is taken for a scene")
            failed += 1
        except (SceneError, ValueError):
            pass
    print(f"scenes: {len(inis) - failed} passed, {failed} failed")
    return failed + wrong > 0


if __name__ == "__main__":
    sys.exit(main())
