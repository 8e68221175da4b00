#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Tests the probing programs of `pkm measure` on several machines, in virtual time.

    make install
    tests/live/probing_test.py --pkm target/host/pkm --out build/probing

Each machine probes a plate, whose holes are touched by a machine built slightly differently (pkmkins_truth), is
calibrated with the log, and probes again. Exit code 1 if a hole is then off by more than the delay of a probe,
or if none was off before.
"""

import argparse
import random
import re
import shutil
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import ini_edit  # noqa: E402
from calibration_demo import PIN_VARIABLES, PLAYER, fact, worst  # noqa: E402
from unprivileged import REPOSITORY  # noqa: E402

TOLERANCE = 0.1  # mm, standard deviation of the built from the drawn dimensions
SEED = 11

# Machine, assumed position of the plate's face, its direction (A of the plate), length of the probe, mm.
# The last one is the hexapod with its tool pointing up, to a plate above it.
MACHINES = {
    "linear-delta": ((0, 0, 10), 0, 60),
    "triaglide": ((0, 0, 150), 0, 60),
    "hexaglide": ((0, 0, 200), 0, 40),
    "pyramid": ((0, 0, 220), 0, 30),
    "hexapod": ((0, 0, 380), 180, -60),
}
PLACES = [-30, 0, 32]  # of the holes, mm; no two are mirror images


def plate():
    """Returns a plate of nine bores as TOML."""
    places = [(x + (2 if y > 0 else 0), y) for y in PLACES for x in PLACES]
    holes = [f"    {{ number = {n}, place = [{x}.0, {y}.0], diameter = 12.0 }},"
             for n, (x, y) in enumerate(places, 1)]
    return "\n".join(['unit = "mm"', "ball = 6.0", "hole = [", *holes, "]", ""])


def gauge(place, looks, probe):
    """Returns the arguments for `pkm measure`."""
    return (f'unit = "mm"\ngauge = "probe"\nplate = "plate.toml"\nplace = {list(map(float, place))}\n'
            f"angles = [{looks}.0, 0.0, 0.0]\ntool = [0.0, 0.0, {probe}.0]\ndepth = 4.0\nclearance = 8.0\n"
            "tilt = 8.0\nfast = 900.0\nslow = 30.0\n")


def as_built(text, random_numbers):
    """Returns the drawing's text with every base anchor and length slightly off, without boxes, which belong to the
    geometry they were proved for."""
    kinematics = re.sub(r" boxes=\d+", "", ini_edit.value(text, "KINS", "KINEMATICS"))
    edits = [{"section": "KINS", "key": "KINEMATICS", "lines": [f"KINEMATICS = {kinematics}"]}]
    edits += [{"section": f"BOX_{n}", "remove": True} for n in range(9) if f"[BOX_{n}]" in text]
    for n in range(text.count("[LEG_")):
        for key in ("BASE", "ROD"):
            words = ini_edit.value(text, f"LEG_{n}", key)
            if words:
                off = [float(word) + random_numbers.gauss(0, TOLERANCE) for word in words.split()]
                line = f"{key} = " + " ".join(f"{number:.9f}" for number in off)
                edits.append({"section": f"LEG_{n}", "key": key, "lines": [line]})
    return ini_edit.edited(text, edits)


def wires(folder, joints, place, looks):
    """Returns HAL commands that replace the probe with the true machine and its probe; the plate is slightly off."""
    x, y, z = place
    pose = f"{x + 0.3},{y - 0.2},{z + 0.2},{looks + 0.1},-0.1,0.2"
    nets = "\n".join(f"net J{n}:motor-pos-fb pkmkins_truth.joint-{n}" for n in range(joints))
    return f"""loadrt pkmkins_truth machine={folder}/true.ini plate={folder}/plate.toml pose={pose}
addf pkmkins_truth servo-thread
{nets}
net truth-tool-x pkmkins.tool-offset-eff-x pkmkins_truth.tool-x
net truth-tool-y pkmkins.tool-offset-eff-y pkmkins_truth.tool-y
net truth-tool-z pkmkins.tool-offset-eff-z pkmkins_truth.tool-z
net latch-probe pkmkins_truth.touch
"""


def output_of(*command):
    """Returns the output of a command; exit code 2 means no result."""
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode == 2:
        sys.exit(f"probing_test: {' '.join(map(str, command))}: {(done.stdout + done.stderr).strip()}")
    return done.stdout


def probed(pkm, folder, name, machine, text):
    """Returns the report of a plate probed with this text of the machine's INI file."""
    place, looks, probe = MACHINES[machine]
    config = folder / name
    shutil.copytree(REPOSITORY / "configs" / machine, config)
    ini = config / f"{machine}.ini"
    ini.write_text(ini_edit.edited(text, [PIN_VARIABLES]))
    (config / "plate.toml").write_text(plate())
    (config / "probe.toml").write_text(gauge(place, looks, probe))
    shutil.copy(folder / "true.ini", config / "true.ini")
    joints = len(re.findall(r"^\[JOINT_\d+\]", text, re.MULTILINE))
    (config / "truth.hal").write_text(wires(config, joints, place, looks))
    shutil.copy(PLAYER, config / "pkmkins_truth.so")
    output_of(pkm, "measure", ini, config / "probe.toml", "--output", config / "plate")
    output_of(pkm, "run", ini, config / "plate.ngc", "--hal", config / "plate.hal", "--hal",
         config / "truth.hal", "--written", config)
    return output_of(pkm, "calibrate", ini, config / "plate.log", "--plate", config / "plate.toml",
                "--write", folder / f"{name}.ini")


def looped(pkm, out, machine):
    """Returns whether calibration corrects a machine."""
    folder = out / machine
    folder.mkdir(parents=True)
    drawn = (REPOSITORY / f"configs/{machine}/{machine}.ini").read_text()
    if MACHINES[machine][2] < 0:
        drawn = re.sub(r"^TOOL_DIRECTION = .*\n", "", drawn, flags=re.MULTILINE)
    (folder / "true.ini").write_text(as_built(drawn, random.Random(SEED)))
    before = probed(pkm, folder, "before", machine, drawn)
    after = probed(pkm, folder, "after", machine, (folder / "before.ini").read_text())
    (folder / "before.txt").write_text(before)
    (folder / "after.txt").write_text(after)
    late = 30 / 60 * float(ini_edit.value(drawn, "EMCMOT", "SERVO_PERIOD")) / 1e9
    is_good = worst(before) > late >= worst(after)
    print(f"{'ok  ' if is_good else 'FAIL'} {machine}: {fact(after, 'measured')}; holes off by {worst(before)} mm "
          f"before, {worst(after)} mm after", flush=True)
    return is_good


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--pkm", required=True, help="the command")
    arguments.add_argument("--out", default="build/probing", help="folder for the results")
    arguments.add_argument("--only", choices=MACHINES, help="one machine")
    options = arguments.parse_args()
    out = Path(options.out).resolve()
    shutil.rmtree(out, ignore_errors=True)
    machines = [options.only] if options.only else MACHINES
    # Test every machine, also after a failure.
    passed = [looped(Path(options.pkm).resolve(), out, machine) for machine in machines]
    return 0 if all(passed) else 1


if __name__ == "__main__":
    sys.exit(main())
