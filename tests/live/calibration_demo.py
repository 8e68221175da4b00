#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Runs a complete calibration in the real LinuxCNC, and reports before and after.

    tests/live/calibration_demo.py --pkm target/host/pkm --out build/calibration [--virtual]

The hexapod as drawn probes a plate with holes. pkmkins_truth closes the probe contact: it simulates a machine
built slightly differently. `pkm calibrate` makes a new INI file from LinuxCNC's log; LinuxCNC starts
with that one and probes again. Exit code 1 if the plate's holes are then still off.

A live run takes minutes and needs the component in LinuxCNC's module folder (`cargo xtask calibration-demo`
installs it there). In virtual time (`--virtual`) it takes seconds, with the component in cargo's build folder.
"""

import argparse
import random
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import ini_edit  # noqa: E402
from session import Session  # noqa: E402
from unprivileged import REPOSITORY, is_unprivileged, only_one, rerun_unprivileged  # noqa: E402

CONFIG = REPOSITORY / "configs/hexapod"
PLAYER = REPOSITORY / "target/host/libpkmkins_truth.so"
PROGRAM = "calibration/calibration.ngc"
TOLERANCE = 0.3  # mm, standard deviation of the built from the drawn dimensions
PLATE = "0.9,-0.7,150.4,0.15,-0.2,0.4"  # pose of the plate
SEED = 7
PROBING_SECONDS = 1500

# On a busy computer LinuxCNC 2.9 sometimes considers a probe move complete too early, and ends the
# program with "Queue is not empty after probing".
TRIES = 3
# calibration.ngc needs this to read pins.
PIN_VARIABLES = {"section": "RS274NGC", "append": ["HAL_PIN_VARS = 1"]}


def as_built(text, random_numbers):
    """Returns the drawing's text with every anchor and length slightly off, without boxes, which belong to the
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
    """Runs LinuxCNC once with given/hexapod.ini on the machine of given/true.ini."""
    wiring = [
        "HALFILE = calibration/latch.hal",
        "HALFILE = calibration/truth.hal",
    ]
    edits = [PIN_VARIABLES, {"section": "HAL", "append": wiring}]
    config = given / "hexapod"
    shutil.copytree(CONFIG, config)
    shutil.copy(given / "hexapod.ini", config / "hexapod.ini")
    with Session(config, edits=edits) as session:
        put_truth(session.copy / "calibration", given / "true.ini")
        program = session.copy / PROGRAM
        lines = len(program.read_text().splitlines())
        result = session.run("probing", out, PROBING_SECONDS, path=str(program), lines=lines,
                             seconds=PROBING_SECONDS)
        log = session.copy / "calibration.log"
        if log.exists():
            shutil.copy(log, out / "calibration.log")
    return result


def put_truth(folder, truth):
    """Writes the true machine, and its HAL file, beside the plate."""
    shutil.copy(truth, folder / "true.ini")
    (folder / "truth.hal").write_text(wires(folder / "true.ini"))


def wires(truth):
    """Returns HAL commands that replace the probe with the true machine and its probe."""
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
    """Runs `pkm calibrate` and returns its output; exit code 2 means no result."""
    plate = CONFIG / "calibration/plate.toml"
    command = [pkm, "calibrate", machine, log, "--plate", plate, *more]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode == 2:
        sys.exit(f"calibration_demo: {done.stderr.strip()}")
    return done.stdout


def fact(text, name):
    return re.search(rf"^  {name} +(.*)$", text, re.MULTILINE)[1]


def probed_live(machine, truth, folder):
    """Returns the log of one run of LinuxCNC, in a process of a user that LinuxCNC accepts."""
    given = folder / "given"
    given.mkdir()
    shutil.copy(machine, given / "hexapod.ini")
    shutil.copy(truth, given / "true.ini")
    for _ in range(TRIES):
        print(f"calibration_demo: LinuxCNC probes the plate ({folder.name}), some minutes", flush=True)
        code = rerun_unprivileged("tests/live/calibration_demo.py", ["--probe"],
                                  PROBING_SECONDS + 180, folder,
                                  [given / "hexapod.ini", given / "true.ini"])
        if code == 0:
            return folder / "calibration.log"
    sys.exit(f"calibration_demo: probing failed: {folder}/linuxcnc.log")


def probed_virtually(pkm, machine, truth, folder):
    """Returns the log of one run in virtual time."""
    config = folder / "hexapod"
    shutil.copytree(CONFIG, config)
    (config / "hexapod.ini").write_text(ini_edit.edited(machine.read_text(), [PIN_VARIABLES]))
    wiring = config / "calibration"
    put_truth(wiring, truth)
    # Modules are searched beside the HAL file first.
    shutil.copy(PLAYER, wiring / "pkmkins_truth.so")
    command = [pkm, "run", config / "hexapod.ini", config / PROGRAM, "--hal", wiring / "latch.hal",
               "--hal", wiring / "truth.hal", "--written", folder]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"calibration_demo: probing failed: {(done.stdout + done.stderr).strip()}")
    return folder / "calibration.log"


def probed(options, machine, truth, name):
    """Returns the log of the plate probed with a machine's INI file while another machine is the true one."""
    folder = Path(options.out).resolve() / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    if options.virtual:
        return probed_virtually(options.pkm, machine, truth, folder)
    return probed_live(machine, truth, folder)


def demo(options):
    begin = time.monotonic()
    out = Path(options.out).resolve()
    out.mkdir(parents=True, exist_ok=True)
    drawn, truth, new = CONFIG / "hexapod.ini", out / "true.ini", out / "calibrated.ini"
    truth.write_text(as_built(drawn.read_text(), random.Random(SEED)))
    before = calibrate(options.pkm, drawn, probed(options, drawn, truth, "before"), "--write", new,
                       "--next", "5")
    (out / "before.txt").write_text(before)
    if not options.virtual:
        print(before)
    after = calibrate(options.pkm, new, probed(options, new, truth, "after"))
    (out / "after.txt").write_text(after)
    print(f"holes before: {fact(before, 'holes')}\nholes after:  {fact(after, 'holes')}")
    wrong = [*misses(before, after, lateness(drawn.read_text()))]
    for text in wrong:
        print(f"FAIL {text}")
    print(f"calibration: {fact(after, 'measured')}, {len(wrong)} failed; "
          f"{time.monotonic() - begin:.0f} s")
    return 1 if wrong else 0


def lateness(ini):
    """Returns the travel in one servo cycle at the feed of the logged (slowest) touches, in mm."""
    feeds = re.findall(r"^ *G38\.2 .*F(\d+)$", (CONFIG / PROGRAM).read_text(), re.MULTILINE)
    return min(map(float, feeds)) / 60 * float(ini_edit.value(ini, "EMCMOT", "SERVO_PERIOD")) / 1e9


def misses(before, after, most):
    """Returns the expectations that the reports violate. A touch is detected late by between 0 and `most`. The mean is
    estimated with the rest: if nothing else remains, no hole is off by more than `most`."""
    if not worst(after) <= most:
        yield f"after calibration a hole is off by {worst(after)} mm, more than {most} mm"
    if not worst(before) > most:
        yield f"before calibration no hole is off by more than {most} mm: this shows nothing"


def worst(report):
    """Returns the largest deviation of a hole, in mm."""
    return float(re.search(r"off by up to ([\d.]+) mm", fact(report, "holes"))[1])


def parsed():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--pkm", help="the command")
    arguments.add_argument("--out", default="build/calibration", help="folder for the results")
    arguments.add_argument("--virtual", action="store_true", help="in virtual time, without hardware")
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
