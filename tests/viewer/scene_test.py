#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Where the model puts the ends of legs, against `pkm rods`, for every shipped machine.

    tests/viewer/scene_test.py PKM
"""

import csv
import io
import json
import pathlib
import random
import subprocess
import sys

REPOSITORY = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(REPOSITORY / "viewer"))
from pkmkins_scene import Scene, SceneError, norm, subtract

# Some roundings of lengths of 1e3.
LENGTH = 1e-9

POSES = 200


def pkm(*arguments, given=""):
    done = subprocess.run([sys.argv[1], *map(str, arguments)], input=given, capture_output=True, text=True)
    if done.returncode == 2:
        sys.exit(done.stderr)
    return done.stdout


def poses(scene, chance):
    """Poses within the limits of the axes, as CSV."""
    ranges = {axis["letter"]: (axis["min"], axis["max"]) for axis in scene.axes}
    home = dict(zip("XYZABC", scene.home["pose"]))
    text = io.StringIO()
    rows = csv.writer(text)
    rows.writerow("xyzabc")
    for _ in range(POSES):
        rows.writerow([chance.uniform(*ranges[letter]) if letter in ranges else home[letter] for letter in "XYZABC"])
    return text.getvalue()


def largest_difference(ini, chance):
    """Of the ends of legs over random poses with a tool, and how many poses there were."""
    scene = Scene(json.loads(pkm("scene", ini)))
    # Where the pose is the platform's own, rods know no tool.
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


def main():
    failed, chance = 0, random.Random(20)
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
    return failed > 0


if __name__ == "__main__":
    sys.exit(main())
