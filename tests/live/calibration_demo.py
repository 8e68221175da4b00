#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Closes the loop of a calibration in the real LinuxCNC, and reports before and after.

    tests/live/calibration_demo.py --pkm target/host/pkm --out build/calibration

The hexapod as drawn probes a plate with holes; what touches is pkmkins_truth, which plays a machine
built a little differently. `pkm calibrate` makes a new INI file of LinuxCNC's log; LinuxCNC starts
with that one and probes again. Needs the component in LinuxCNC's module folder
(`make calibration-demo` puts it there).
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
from session import Session  # noqa: E402
from unprivileged import REPOSITORY, is_unprivileged, only_one, rerun_unprivileged  # noqa: E402

CONFIG = REPOSITORY / "configs/hexapod"
TOLERANCE = 0.3  # mm, standard deviation of what was built from what was drawn
PLATE = "0.9,-0.7,150.4,0.15,-0.2,0.4"  # where the plate lies
SEED = 7
PROBING_SECONDS = 1500

# On a busy computer LinuxCNC 2.9 at times takes a probe move for done before it is, and ends the
# program with "Queue is not empty after probing".
TRIES = 3


def as_built(text, random_numbers):
    """The drawing's text with every anchor and length a little off; no boxes, which belong to the
    geometry they were proved for."""
    edits = [{"section": "BOX_0", "remove": True},
             {"section": "KINS", "key": "KINEMATICS", "lines": ["KINEMATICS = pkmkins legs=strut:6"]}]
    for n in range(6):
        section = f"LEG_{n}"
        for key in ("BASE", "PLATFORM"):
            numbers = [float(word) for word in ini_edit.value(text, section, key).split()]
            off = [number + random_numbers.gauss(0, TOLERANCE) for number in numbers]
            line = f"{key} = " + " ".join(f"{number:.9f}" for number in off)
            edits.append({"section": section, "key": key, "lines": [line]})
        line = f"OFFSET = {random_numbers.gauss(0, TOLERANCE):.9f}"
        edits.append({"section": section, "key": "OFFSET", "lines": [line]})
    return ini_edit.edited(text, edits)


def probe(given, out):
    """One run of LinuxCNC with given/hexapod.ini on the machine of given/true.ini."""
    wiring = [
        "HALFILE = calibration/latch.hal",
        "HALFILE = calibration/truth.hal",
    ]
    edits = [{"section": "RS274NGC", "append": ["HAL_PIN_VARS = 1"]},
             {"section": "HAL", "append": wiring}]
    config = given / "hexapod"
    shutil.copytree(CONFIG, config)
    shutil.copy(given / "hexapod.ini", config / "hexapod.ini")
    with Session(config, edits=edits) as session:
        truth = session.copy / "calibration/true.ini"
        shutil.copy(given / "true.ini", truth)
        (session.copy / "calibration/truth.hal").write_text(wires(truth))
        program = session.copy / "calibration/calibration.ngc"
        lines = len(program.read_text().splitlines())
        result = session.run("probing", out, PROBING_SECONDS, path=str(program), lines=lines,
                             seconds=PROBING_SECONDS)
        log = session.copy / "calibration.log"
        if log.exists():
            shutil.copy(log, out / "calibration.log")
    return result


def wires(truth):
    """HAL commands that put the true machine and its probe in place of a probe."""
    plate = truth.parent / "plate.toml"
    joints = "\n".join(f"net J{n}:motor-pos-fb pkmkins_truth.joint-{n}" for n in range(6))
    return f"""loadrt pkmkins_truth machine={truth} plate={plate} pose={PLATE}
addf pkmkins_truth servo-thread
{joints}
net truth-tool-x pkmkins.tool-offset-eff-x pkmkins_truth.tool-x
net truth-tool-y pkmkins.tool-offset-eff-y pkmkins_truth.tool-y
net truth-tool-z pkmkins.tool-offset-eff-z pkmkins_truth.tool-z
net latch-probe pkmkins_truth.touch
"""


def calibrate(pkm, machine, log, *more):
    """What `pkm calibrate` says; 2 means no result."""
    plate = CONFIG / "calibration/plate.toml"
    command = [pkm, "calibrate", machine, log, "--plate", plate, *more]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode == 2:
        sys.exit(f"calibration_demo: {done.stderr.strip()}")
    return done.stdout


def fact(text, name):
    return re.search(rf"^  {name} +(.*)$", text, re.MULTILINE)[1]


def probed(machine, truth, out, name):
    """Log of one run of LinuxCNC, in a process of a user that LinuxCNC accepts."""
    folder = out / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    given = folder / "given"
    given.mkdir()
    shutil.copy(machine, given / "hexapod.ini")
    shutil.copy(truth, given / "true.ini")
    for _ in range(TRIES):
        print(f"calibration_demo: LinuxCNC probes the plate ({name}), some minutes", flush=True)
        code = rerun_unprivileged("tests/live/calibration_demo.py", ["--probe"],
                                  PROBING_SECONDS + 180, folder,
                                  [given / "hexapod.ini", given / "true.ini"])
        if code == 0:
            return folder / "calibration.log"
    sys.exit(f"calibration_demo: probing failed: {folder}/linuxcnc.log")


def demo(options):
    out = Path(options.out).resolve()
    out.mkdir(parents=True, exist_ok=True)
    drawn, truth, new = CONFIG / "hexapod.ini", out / "true.ini", out / "calibrated.ini"
    truth.write_text(as_built(drawn.read_text(), random.Random(SEED)))
    before = calibrate(options.pkm, drawn, probed(drawn, truth, out, "before"), "--write", new,
                       "--next", "5")
    (out / "before.txt").write_text(before)
    print(before)
    after = calibrate(options.pkm, new, probed(new, truth, out, "after"))
    (out / "after.txt").write_text(after)
    print(f"holes before: {fact(before, 'holes')}\nholes after:  {fact(after, 'holes')}")


def parsed():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--pkm", help="the command")
    arguments.add_argument("--out", default="build/calibration", help="folder for the results")
    arguments.add_argument("--probe", action="store_true", help=argparse.SUPPRESS)
    return arguments.parse_args()


def main():
    options = parsed()
    if not options.probe:
        return demo(options)
    assert is_unprivileged()
    with only_one():
        result = probe(REPOSITORY / "given", REPOSITORY / "out")
    if not result["ok"]:
        print(f"calibration_demo: {result['error']}", file=sys.stderr)
    return 0 if result["ok"] else 1


if __name__ == "__main__":
    sys.exit(main())
