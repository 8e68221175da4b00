#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Compares the model's leg ends with `pkm rods`, and its tip with the pose, for every shipped machine and machines with
OFFSET; compares the text of a refusal with that of `pkm`.

    tests/viewer/scene_test.py PKM
"""

import csv
import io
import json
import pathlib
import random
import re
import subprocess
import sys
import tempfile

REPOSITORY = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(REPOSITORY / "viewer"))
from pkmkins_panel import words  # noqa: E402
from pkmkins_refusal import count_legs  # noqa: E402
from pkmkins_scene import Scene, add, norm, subtract  # noqa: E402

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
    """Returns the largest difference of leg ends and of the tool's ends over random poses with a tool, and the number of poses."""
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
        # The program's coordinates are those of the tip on the work, or of the platform if it does not see the tool.
        of_pose = add(place.work.into(place.tip), tool) if scene.sees_tool else place.nose
        holder = place.base.out(place.nose) if scene.holder is None else scene.holder
        worst = max(worst, norm(subtract(of_pose, [numbers[letter] for letter in "xyz"])), norm(subtract(place.tool[0], holder)))
        count += 1
    return worst, count


def with_offsets(ini, folder):
    """Writes a machine whose joint values are 3 less than at their legs, which no shipped machine has."""
    text = re.sub(r"^\[LEG_\d+\]$", r"\g<0>\nOFFSET = 3", ini.read_text(), flags=re.MULTILINE)
    joint = re.compile(r"^\[JOINT_\d+\][^[]*", re.MULTILINE)
    less = re.compile(r"^((?:MIN_LIMIT|MAX_LIMIT|HOME) = )(\S+)", re.MULTILINE)
    file = folder / f"{ini.stem}-offset.ini"
    file.write_text(joint.sub(lambda section: less.sub(lambda key: f"{key[1]}{float(key[2]) - 3}", section[0]), text))
    return file


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

    said = words(value, count_legs(value))
    good = said == f"last: {core}"
    print(f"{'PASS' if good else 'FAIL'} a refusal in words: {said}")
    return not good


def main():
    wrong, failed, chance = words_failed(), 0, random.Random(20)
    with tempfile.TemporaryDirectory() as folder:
        # Those with constraints: scripts_test.py.
        inis = sorted(ini for ini in REPOSITORY.glob("configs/*/*.ini") if not Scene(json.loads(pkm("scene", ini))).dependent)
        inis += [with_offsets(ini, pathlib.Path(folder)) for ini in inis if ini.stem in ("hexapod", "hexaglide", "rotary-delta")]
        for ini in inis:
            worst, count = largest_difference(ini, chance)
            good = worst < LENGTH and count > POSES / 2
            failed += not good
            print(f"{'PASS' if good else 'FAIL'} {ini.stem}: positions within {worst:.1e} over {count} poses")
    print(f"scenes: {len(inis) - failed} passed, {failed} failed")
    return failed + wrong > 0


if __name__ == "__main__":
    sys.exit(main())
