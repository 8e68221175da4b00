#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Homes the machine that AXIS shows, runs its program, and takes a picture of both: `screens.py` runs it.

    drive.py FOLDER home|program|refused|bare|touch-off|beside        with INI_FILE_NAME and DISPLAY set
    drive.py FOLDER outlived WINDOW PROCESS WORD     for another user interface, with INI_FILE_NAME set

`program` writes home.png and program.png, and HAL's values at the time, home.json and program.json.
"""

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

TESTS = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(TESTS / "live"), str(TESTS.parent / "viewer")]
import hal  # noqa: E402
import linuxcnc  # noqa: E402
from pkmkins_pins import HAL_KEY  # noqa: E402
from unprivileged import has_ended  # noqa: E402
from drawn import Picture, Scene, View, farthest, missing, parts  # noqa: E402

COMPONENTS = ("pyvcp", "pkmkins-panel", "pkmkins-vismach")
START_SECONDS = 120
# The model is redrawn ten times a second, on a computer that draws slowly.
SETTLE_SECONDS = 2.0
MOST_PICTURES = 10
# limit-iterations must be 1 to 288.
NO_ITERATIONS = -37
# Largest duration of a program before its picture is taken, and pixels that some part must have moved then: fewer
# after half of the time, for programs with short moves.
RUN_SECONDS = 24.0
MOTION, LESS_MOTION = 30, 8


def wait_for_axis(name):
    """Waits until AXIS has connected the panel, its last step, and both windows exist."""
    wait(lambda: windows(name), "windows of AXIS and of the model")
    # Not before LinuxCNC has created the shared memory of the component.
    kept = hal.component("screens")
    kept.ready()
    for part in COMPONENTS:
        wait(lambda part=part: hal.component_exists(part), part)
    return kept


def wait(condition, what):
    end = time.monotonic() + START_SECONDS
    while not condition():
        if time.monotonic() > end:
            sys.exit(f"{what}: not there after {START_SECONDS} s")
        time.sleep(0.5)


def tree():
    """Returns all windows of the screen as text."""
    return subprocess.run(["xwininfo", "-root", "-tree"], capture_output=True, text=True).stdout


def title(name):
    found = re.search(rf'"({re.escape(name)}: pkmkins.*?)": \(', tree())
    return found and found[1]


def windows(name):
    """Returns left, top, width and height of the model's window, once it has its position."""
    return rectangle(rf'"{re.escape(name)}: pkmkins') if re.search('"(AXIS|axis)', tree()) else None


def rectangle(title):
    """Returns left, top, width and height of a window by an expression for its title; `None` if it does not exist."""
    found = re.search(rf'{title}.*?\s(\d+)x(\d+)\+-?\d+\+-?\d+\s+\+(-?\d+)\+(-?\d+)', tree())
    return [int(found[k]) for k in (3, 4, 1, 2)] if found else None


def state(machine, scenes, name):
    values = {"window": windows(name), "title": title(name), "mechanisms": []}
    for scene in scenes:
        values["mechanisms"].append({key: [machine.get(pin) for pin in pins] for key, pins in (
            ("joints", [f"joint.{joint['number']}.pos-fb" for joint in scene.joints]),
            ("pose", [f"{scene.pins}{letter}" for letter in "xyzabc"]),
            ("tool", [f"{scene.pins}tool-offset-eff-{letter}" for letter in "xyz"]))})
    pins = ("pkmkins-panel.known", "pkmkins-panel.guard-on", "pyvcp.geometry-ok", "pyvcp.joint-0")
    values["pins"] = {pin: machine.get(pin) for pin in pins}
    return values


def picture(machine, scenes, out, stem, name):
    """Takes a picture once the model is drawn at its position and stays there, which takes time on a busy computer."""
    before = None
    for _ in range(MOST_PICTURES):
        time.sleep(SETTLE_SECONDS)
        values = state(machine, scenes, name)
        (out / f"{stem}.json").write_text(json.dumps(values))
        for ending in ("png", "ppm"):
            subprocess.run(["import", "-window", "root", str(out / f"{stem}.{ending}")], check=True, timeout=60)
        now = Picture(out / f"{stem}.ppm")
        if before and not missing(scenes, values, now) and not now.differs(before, values["window"]):
            break
        before = now
    return values


def described(ini):
    """Returns the scenes of the mechanisms."""
    def asked(number):
        done = subprocess.run(["pkm", "scene", ini, "--mechanism", number], capture_output=True, text=True, check=True)
        return Scene(json.loads(done.stdout))

    first = asked("1")
    return [first, asked("2")] if first.is_of_pair else [first]


def home(out, ini, name):
    """Homes the machine; returns the data for its picture."""
    scenes = described(ini)
    (out / "scenes.json").write_text(json.dumps([vars(scene) for scene in scenes]))
    kept = wait_for_axis(name)
    from machine import Machine
    machine = Machine()
    machine.start()
    machine.wait(lambda: machine.get("pkmkins-panel.known"), 20, "travel left")
    return kept, machine, scenes, picture(machine, scenes, out, "home", name)


def program(out, ini, name):
    """Homes the machine and runs its program."""
    kept, machine, scenes, at_home = home(out, ini, name)
    machine.set_mode(linuxcnc.MODE_AUTO)
    machine.command.auto(linuxcnc.AUTO_RUN, 0)
    machine.wait(lambda: machine.stat.interp_state != linuxcnc.INTERP_IDLE, 10, "start of the program")
    begin, gone, wanted = time.monotonic(), 0, MOTION
    view, before = View(scenes, at_home["window"]), parts(scenes, at_home)
    while gone < wanted and time.monotonic() < begin + RUN_SECONDS:
        machine.pause(0.3)
        gone = farthest(view, before, parts(scenes, state(machine, scenes, name)))
        wanted = MOTION if time.monotonic() < begin + RUN_SECONDS / 2 else LESS_MOTION
    machine.command.auto(linuxcnc.AUTO_PAUSE)
    machine.pause(0.5)
    picture(machine, scenes, out, "program", name)
    machine.command.abort()
    assert not machine.error_texts(), machine.error_texts()
    kept.exit()


def refused(out, _ini, _name):
    """Takes a picture of AXIS's message about a program that it opens at the start."""
    wait(lambda: '"Filter failed' in tree(), "what AXIS says of the program")
    time.sleep(SETTLE_SECONDS)
    subprocess.run(["import", "-window", "root", str(out / "refused.png")], check=True, timeout=60)


def beside(out, _ini, name):
    """Records the positions of both windows as LinuxCNC starts them."""
    kept = wait_for_axis(name)
    # The model looks for AXIS twice a second.
    before = None
    while (now := {"axis": rectangle(r'\("axis" "Axis"\)'), "model": windows(name)}) != before:
        before = now
        time.sleep(2 * SETTLE_SECONDS)
    (out / "beside.json").write_text(json.dumps(now))
    subprocess.run(["import", "-window", "root", str(out / "beside.png")], check=True, timeout=60)
    kept.exit()


def bare(out, _ini, _name):
    """Homes a machine whose panel has no data."""
    wait(lambda: '"AXIS ' in tree() or '"axis' in tree(), "window of AXIS")
    kept = hal.component("screens")
    kept.ready()
    for part in ("pyvcp", "pkmkins-panel"):
        wait(lambda part=part: hal.component_exists(part), part)
    from machine import Machine, halcmd
    machine = Machine()
    machine.start()
    # As long as the panel would need for its data.
    machine.pause(3)
    assert not machine.get("pkmkins-panel.known") and machine.get("pyvcp.geometry-ok")
    assert machine.get("pyvcp.x-plus") != machine.get("pyvcp.x-plus"), "unknown travel is not NaN"
    switch_kinematics(machine)
    # Causes a refusal for the picture.
    machine.command.abort()
    halcmd("setp", "pkmkins.limit-iterations", "0")
    machine.wait(lambda: machine.get("pkmkins.fault") == NO_ITERATIONS, 5, "a refusal")
    time.sleep(SETTLE_SECONDS)
    subprocess.run(["import", "-window", "root", str(out / "bare.png")], check=True, timeout=60)
    kept.exit()


def switch_kinematics(machine):
    """Switches the kinematics like the buttons of the panel, whose pins are disconnected for this: refused in world
    mode and in a move, both directions in MDI and in joint mode, and no joint moves."""
    from machine import halcmd
    for choice in ("machine", "joints"):
        halcmd("unlinkp", f"pyvcp.kinematics.{choice}")

    def press(joints):
        halcmd("sets", "panel:ask-joints", "TRUE" if joints else "FALSE")
        machine.pause(1)
        return machine.get("kinstype.is-1")

    before = machine.commanded_joints()
    assert not press(True) and not press(False), "switched in world mode"
    for go in (lambda: machine.set_mode(linuxcnc.MODE_MDI), machine.joint_mode):
        go()
        assert press(True) and not press(False), "not switched"
        assert all(abs(a - b) < 1e-9 for a, b in zip(before, machine.commanded_joints())), "a joint has moved"
    machine.set_mode(linuxcnc.MODE_MDI)
    machine.command.mdi("G1 F100 X20")
    machine.wait(lambda: not machine.stat.inpos, 5, "a move")
    assert not press(True) and not machine.stat.inpos, "switched in a move"


def touch_off(out, ini, name):
    """Makes AXIS touch off a tool that is 15 mm longer, at a tilt, and records the joints in every servo cycle."""
    kept = wait_for_axis(name)
    from machine import Machine
    from scenarios import SERVO_PERIOD_NS, peaks, tool_change_columns
    from recorder import Recorder
    machine = Machine()
    recorder = Recorder(machine.component, tool_change_columns(machine.layout), SERVO_PERIOD_NS)
    machine.start()
    for block in ("T1 M6 G43", "G1 F6000 X0 Y0 Z200 A15 B-15 C10"):
        machine.mdi(block)
    machine.set_mode(linuxcnc.MODE_MANUAL)
    machine.pause(1)
    before = machine.get("pkmkins.tool-offset-eff-z")
    recorder.start()
    machine.component["phase"] = 1
    asked, done = (Path(ini).with_name(name) for name in ("touch-off", "touched-off"))
    # Written elsewhere first: AXIS checks the file continuously.
    done.write_text("185")
    done.rename(asked)
    machine.wait(done.exists, 60, "AXIS's answer to its dialog")
    machine.pause(0.1)
    machine.wait(lambda: not machine.get("pkmkins.tool-busy"), 60, "end of the tool change")
    machine.pause(0.1)
    machine.component["phase"] = 0
    recorder.stop()
    assert not machine.error_texts() and machine.is_on(), machine.messages
    assert machine.stat.task_mode == linuxcnc.MODE_MANUAL, "AXIS is not in manual mode"
    found = peaks(machine, recorder, 1)
    assert abs(machine.get("pkmkins.tool-offset-eff-z") - before - 15) < 1e-6 and found["busy_s"] > 0, found
    (out / "touch-off.json").write_text(json.dumps(found))
    kept.exit()


# A user interface loads the panel's files 10 to 25 s after LinuxCNC's start; in the past LinuxCNC ended then.
LOADED_SECONDS = 30
PROGRAM = "G21 G90 M52 P1\nG91 F600\nG1 Z-5\nG1 Z5\nG90\nM2\n"


def outlived(out, ini, window, process, word):
    """Homes the machine under any user interface, once its log contains `word`, runs a program and waits
    until everything is loaded."""
    def age():
        # Clock ticks since the computer's start, in the field after the name in parentheses.
        return time.clock_gettime(time.CLOCK_BOOTTIME) - int(
            Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[19]) / os.sysconf("SC_CLK_TCK")

    def is_shown():
        said = (out / "linuxcnc.log").read_text(errors="replace")
        if has_ended(said):
            sys.exit("LinuxCNC has ended")
        return hal_is_there() and word in said and (not window or window.lower() in tree().lower())

    wait(is_shown, "LinuxCNC and its user interface")
    kept = hal.component("screens")
    kept.ready()
    wait(lambda: hal.component_exists("inihal"), "LinuxCNC's task")
    from machine import Machine, halcmd
    machine = Machine()
    insist(machine, lambda: turn_on(machine), machine.is_on, "machine on")
    insist(machine, lambda: home_joints(machine), machine.is_homed, "homing")
    program = Path(ini).with_name("programs") / "short.ngc"
    program.write_text(PROGRAM)
    insist(machine, lambda: machine.command.mode(linuxcnc.MODE_AUTO),
           lambda: machine.stat.task_mode == linuxcnc.MODE_AUTO, "automatic mode")
    machine.command.program_open(str(program))
    machine.command.auto(linuxcnc.AUTO_RUN, 0)
    machine.wait(lambda: machine.stat.interp_state != linuxcnc.INTERP_IDLE, 10, "start of the program")
    machine.wait(machine.is_idle, 60, "end of the program")
    machine.wait(lambda: age() > LOADED_SECONDS, LOADED_SECONDS, "everything is loaded")
    assert machine.is_on() and machine.is_homed(), "the machine is off"
    for letter in machine.layout.letters:
        wired = halcmd("-s", "show", "pin", f"ini.{letter}.max_velocity")
        assert f"pkmkins:jog-velocity-{letter}" in wired, f"jogs are not slowed: {wired}"
    if window:
        time.sleep(SETTLE_SECONDS)
        subprocess.run(["import", "-window", "root", str(out / "outlived.png")], check=True, timeout=60)
    print(f"{age():.0f}")
    kept.exit()


def insist(machine, act, is_so, what):
    """Repeats an action until its result has lasted for a while: gmoccapy repeats an earlier command, or resets the
    mode, when it detects a change by another program late."""
    end = time.monotonic() + START_SECONDS
    while time.monotonic() < end:
        machine.poll()
        act()
        machine.pause(SETTLE_SECONDS)
        if is_so():
            return
    sys.exit(f"{what}: not within {START_SECONDS} s; messages: {machine.messages}")


def turn_on(machine):
    is_stopped = machine.stat.task_state == linuxcnc.STATE_ESTOP
    machine.command.state(linuxcnc.STATE_ESTOP_RESET if is_stopped else linuxcnc.STATE_ON)


def home_joints(machine):
    if not machine.is_on():
        turn_on(machine)
    elif machine.stat.task_mode != linuxcnc.MODE_MANUAL:
        machine.command.mode(linuxcnc.MODE_MANUAL)
    else:
        machine.command.home(-1)


def hal_is_there():
    """Returns whether LinuxCNC has created the shared memory of components: otherwise the first component would."""
    return any(words[:1] == [HAL_KEY] for words in map(str.split, open("/proc/sysvipc/shm")))


def main():
    out, ini = Path(sys.argv[1]), os.environ["INI_FILE_NAME"]
    if sys.argv[2] == "outlived":
        return outlived(out, ini, *sys.argv[3:])
    {"home": home, "program": program, "refused": refused, "bare": bare, "touch-off": touch_off, "beside": beside}[sys.argv[2]](out, ini, Path(ini).stem)


if __name__ == "__main__":
    main()
