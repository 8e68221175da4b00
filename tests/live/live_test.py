#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""All live tests, one after another: PASS or FAIL a test, a closing line, exit code 1 on failure.

    tests/live/live_test.py [--only TEXT] [--out FOLDER] [--judge target/host/pkm-report] [--list]

With --judge every recorded trace is given to `pkm-report`: joints against the host library, speeds
and accelerations against the limits.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import ini_edit  # noqa: E402
import run_live  # noqa: E402
from session import Session  # noqa: E402
from unprivileged import (REPOSITORY, clear_hal, is_unprivileged, only_one,  # noqa: E402
                          rerun_unprivileged)

HEXAPOD = REPOSITORY / "configs/hexapod"
LAB_HEXAPOD = REPOSITORY / "configs/lab-hexapod"
SAMPLE = Path("/usr/share/doc/linuxcnc/examples/sample-configs/sim/axis/vismach/hexapod-sim")
TESTS = {}
RECORDING = set()


def test(function):
    TESTS[function.__name__] = function
    return function


def recording(function):
    """A test that leaves a trace to be judged."""
    RECORDING.add(function.__name__)
    return function


def check(result):
    """Turns a result that is not ok into a failure."""
    assert result["ok"], result["error"]
    return result


def scenario(config, name, out, limit=60, **arguments):
    with Session(config) as session:
        return check(session.run(name, out, limit, **arguments))


def program(config, name, out):
    result = check(run_live.run(config.relative_to(REPOSITORY), name, out, 120))
    return f"{result['moves']} moves, {result['seconds']} s, longest cycle {result['servo_tmax_ns']} ns"


def quiet_start(config, out):
    """Nothing to tell, and the pose that forward finds from HOME of the joints is [TRAJ]HOME."""
    text = (config / f"{config.name}.ini").read_text()
    home = [float(word) for word in ini_edit.value(text, "TRAJ", "HOME").split()]
    joint_home = [float(ini_edit.value(text, f"JOINT_{n}", "HOME")) for n in range(6)]
    scenario(config, "quiet_start", out, home=home, joint_home=joint_home)


@test
def hexapod_with_absolute_encoders_starts_quietly(out):
    quiet_start(HEXAPOD, out)


@test
def lab_hexapod_homes_by_a_search_and_starts_quietly(out):
    quiet_start(LAB_HEXAPOD, out)


@test
@recording
def hexapod_machines_the_five_axis_surface(out):
    return program(HEXAPOD, "five-axis-surface.ngc", out)


@test
@recording
def hexapod_changes_tools(out):
    return program(HEXAPOD, "tool-change.ngc", out)


@test
@recording
def lab_hexapod_faces_tilted_planes(out):
    return program(LAB_HEXAPOD, "facing-tilted.ngc", out)


@test
@recording
def lab_hexapod_changes_tools(out):
    return program(LAB_HEXAPOD, "tool-length.ngc", out)


# -------------------------------------------------------------------- drop-in for genhexkins

BLOCKS = ["G1 F200 X1 Y-2 Z21", "G1 F400 A5 B-4 C3", "G0 X-3 Y2 Z19 A-2 B6 C-5",
          "G1 F200 X0 Y0 Z20 A0 B0 C0", "G1 X2 Y2 Z23 A8"]
GUI_PINS = REPOSITORY / "tests/live/gui_pins.py"


def sample(kinematics):
    """LinuxCNC's hexapod-sim: display and tool change replaced, POSTGUI file loaded by HAL.

    The graphic model and the panel are replaced by a component with their pins.
    """
    session = Session(SAMPLE, "hexapod.ini", edits=[
        {"section": "HAL", "key": "HALFILE",
         "lines": ["HALFILE = LIB:basic_sim.tcl -no_use_hal_manualtoolchange",
                   "HALFILE = kinematics.hal"]},
        {"section": "HAL", "key": "HALCMD",
         "lines": [f"HALCMD = loadusr -Wn hexagui {GUI_PINS}",
                   "HALCMD = net :kinstype-select <= motion.analog-out-03 => motion.switchkins-type",
                   "HALCMD = source hexapod_postgui.hal"]},
        {"section": "DISPLAY", "key": "PYVCP", "lines": []},
    ])
    for file in ("hexapod.ini", "kinematics.hal", "hexapod_postgui.hal"):
        path = session.copy / file
        path.write_text(path.read_text().replace("genhexkins", kinematics))
    return session


def sample_moves(kinematics, out):
    with sample(kinematics) as session:
        return check(session.run("moves", out / kinematics, 60, blocks=BLOCKS))["settled"]


@test
def drop_in_for_genhexkins_moves_the_same_joints(out):
    ours, theirs = sample_moves("pkmkins", out), sample_moves("genhexkins", out)
    worst = 0.0
    for mine, other in zip(ours, theirs, strict=True):
        for kind in ("joints", "pose"):
            worst = max([worst] + [abs(a - b) for a, b in zip(mine[kind], other[kind])])
    assert worst <= 1e-9, f"joints or poses differ by {worst}: {ours} and {theirs}"
    return f"{len(ours)} moves, largest difference {worst:.3g} in"


@test
def drop_in_for_genhexkins_switches_kinematics(out):
    with sample("pkmkins") as session:
        check(session.run("sample_switch", out, 60, start="G1 F100 X1 Y-2 Z21 A3"))


# -------------------------------------------------------------------- ways out

@test
def joints_that_close_no_platform_end_safely(out):
    result = scenario(HEXAPOD, "escape", out, joint=0, distance=200, speed=60)
    return result["reason"]


@test
def operator_jogs_back_from_joints_that_close_no_platform(out):
    scenario(HEXAPOD, "way_back", out, joint=0, distance=200, speed=60)


@test
def kinematics_switch_moves_no_joint(out):
    scenario(HEXAPOD, "net_switch", out)


@test
def geometry_is_refused_while_the_machine_is_on(out):
    scenario(HEXAPOD, "refused_geometry", out)


@test
def geometry_is_taken_while_the_machine_is_off(out):
    scenario(HEXAPOD, "new_geometry", out)


@test
def no_iterations_is_refused(out):
    scenario(HEXAPOD, "no_iterations", out)


@test
def tool_offset_of_nan_moves_no_joint(out):
    scenario(HEXAPOD, "tool_pin_nan", out)


@test
def drive_that_cannot_follow_stops_the_machine(out):
    scenario(HEXAPOD, "weak_drive", out)


# -------------------------------------------------------------------- starts that are refused

@test
def bad_ini_stops_the_start(out):
    edit = {"section": "LEG_3", "key": "BASE", "lines": ["BASE = -395.98 39S.98 1250"]}
    with Session(HEXAPOD, edits=[edit]) as session:
        result = session.run("moves", out, 30, blocks=[])
        log = session.log_text()
    assert not result["ok"], "LinuxCNC started"
    assert "ended with code" in result["error"], result["error"]
    for name in ("LEG_3", "BASE", "39S.98"):
        assert name in log, f"the log lacks {name}: {log}"


def refused_load(out, parameters, words):
    file = out / "load.hal"
    file.write_text(f"loadrt pkmkins {parameters}\n")
    clear_hal()
    done = subprocess.run(["halrun", str(file)], stdin=subprocess.DEVNULL, text=True, timeout=30,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    clear_hal()
    assert done.returncode != 0, f"loadrt pkmkins {parameters} was accepted"
    for word in words:
        assert word in done.stdout, f"loadrt pkmkins {parameters}: no {word!r} in {done.stdout!r}"


@test
def bad_load_parameters_are_refused(out):
    refused_load(out, "feet=6", ["feet"])
    refused_load(out, "legs=wheel:6", ["legs=wheel:6", "strut"])
    refused_load(out, "legs=strut:5", ["legs=strut:5", "six"])
    refused_load(out, "legs=strut", ["legs=strut", "KIND:COUNT"])
    refused_load(out, "coordinates=XYZABX", ["XYZABX"])
    refused_load(out, "table=X", ["table=X"])


# -------------------------------------------------------------------- driver

def run_one(name, folder):
    """Whether the test passed; prints its line."""
    begin = time.monotonic()
    out = folder / name
    out.mkdir(parents=True, exist_ok=True)
    try:
        detail = TESTS[name](out)
    except (AssertionError, subprocess.SubprocessError, OSError) as reason:
        print(f"FAIL {name}: {reason}", flush=True)
        return False
    seconds = f"{time.monotonic() - begin:.0f} s"
    print(f"PASS {name} ({detail}; {seconds})" if detail else f"PASS {name} ({seconds})", flush=True)
    return True


def judge_one(judge, trace):
    """Whether pkm-report is content with a trace; prints its line, and its table if not."""
    folder = trace.parent
    config = json.loads((folder / "result.json").read_text())["config"]
    ini = REPOSITORY / "configs" / config / f"{config}.ini"
    done = subprocess.run([judge, ini, trace, folder / "result.json", folder / "report"], text=True,
                          stdin=subprocess.DEVNULL, capture_output=True, timeout=120)
    passed = done.returncode == 0
    print(f"{'PASS' if passed else 'FAIL'} trace of {folder.name}", flush=True)
    if not passed:
        print(done.stdout + done.stderr, flush=True)
    return passed


def run_and_judge(options, out):
    """Exit code of the tests as a normal user and of the judge on what they recorded."""
    for stale in out.glob("*/trace.csv"):
        stale.unlink()
    code = rerun_unprivileged("tests/live/live_test.py", ["--only", options.only], 900, out)
    if not options.judge:
        return code
    traces = sorted(out.glob("*/trace.csv"))
    results = [judge_one(options.judge, trace) for trace in traces]
    for name in sorted(name for name in RECORDING if options.only in name):
        if out / name / "trace.csv" not in traces:
            print(f"FAIL trace of {name}: none was recorded")
            results.append(False)
    print(f"traces: {sum(results)} passed, {len(results) - sum(results)} failed")
    return code or (0 if all(results) else 1)


def parsed():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--only", default="", help="tests whose name contains this text")
    arguments.add_argument("--out", help="folder that keeps traces, results and logs")
    arguments.add_argument("--judge", type=Path, help="pkm-report, to judge the recorded traces")
    arguments.add_argument("--list", action="store_true", help="names of the tests")
    return arguments.parse_args()


def main():
    options = parsed()
    names = [name for name in TESTS if options.only in name]
    if options.list or not names:
        print("\n".join(names) if names else f"no test has {options.only!r} in its name")
        return 0 if names else 2
    if not is_unprivileged():
        if options.out:
            return run_and_judge(options, Path(options.out).resolve())
        with tempfile.TemporaryDirectory(prefix="pkmkins-live-") as out:
            return run_and_judge(options, Path(out))
    with only_one():
        results = [run_one(name, REPOSITORY / "out") for name in names]
    print(f"{sum(results)} passed, {len(results) - sum(results)} failed")
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
