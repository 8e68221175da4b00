#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Tests shipped configurations in AXIS, with panel and model, on a virtual screen.

    tests/viewer/screens.py [--only TEXT] [--out FOLDER] [--pkm target/host/pkm]

For every configuration: AXIS starts, the machine is homed and its program runs. A picture is taken at
home and one in the program. In both every part of the machine must be where the scene's formulas and
the window's projection place it, in its color; and the parts must have moved. More cases: a program that the
filter rejects, a computer without the command `pkm`, and shapes from files, good and bad; and every other user
interface with the shipped INI file. `--out` keeps the pictures.
Needs Xvfb, ImageMagick and Mesa's software GL, and PyQt5 for QtDragon.
"""

import argparse
import itertools
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "live")]
from unprivileged import (LANES, REPOSITORY, claimed, clear_hal, has_ended, is_unprivileged,  # noqa: E402
                          only_one, rerun_unprivileged)
import drawn  # noqa: E402

SCREEN = "1900x1000x24"
MODEL = "560x560+1330+10"
# For a computer that draws without a graphics card and runs two more machines.
START_SECONDS = 120
END_SECONDS = 20
SIGNAL_SECONDS = 4
PASSED = "passed"


class Screen:
    """A virtual screen."""

    def __enter__(self):
        read, write = os.pipe()
        self.process = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", SCREEN,
                                         "-nolisten", "tcp"], pass_fds=[write], stderr=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as numbers:
            self.name = f":{numbers.readline().strip()}"
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(10)


def copied(name, folder):
    """Copies a configuration; returns its INI file."""
    copy = folder / "config"
    shutil.copytree(REPOSITORY / "configs" / name, copy)
    ini = copy / f"{name}.ini"
    model = f"APP = pkmkins-vismach {name}.ini"
    text = ini.read_text()
    assert text.count(model) == 1, f"{name}.ini starts no model"
    # The windows must not overlap.
    text = text.replace(model, f"{model} --geometry {MODEL}")
    # Otherwise AXIS draws ten times a second, which without a graphics card takes more than a quarter of the time.
    ini.write_text(text.replace("[DISPLAY]\n", "[DISPLAY]\nCYCLE_TIME = 0.5\n"))
    return ini


def environment(folder, screen):
    path = f"{REPOSITORY / 'given'}:{os.environ['PATH']}"
    return {**os.environ, "HOME": str(folder), "RUNTESTS": "1", "DISPLAY": screen.name, "PATH": path,
            "LIBGL_ALWAYS_SOFTWARE": "1", "PYTHONDONTWRITEBYTECODE": "1"}


def started(ini, log, env):
    return subprocess.Popen(["linuxcnc", str(ini)], stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=env,
                            cwd=ini.parent, start_new_session=True)


def stop(process, display="bin/axis ", patience=END_SECONDS):
    """Ends the user interface (by force after `patience` seconds), thereby LinuxCNC, then the remaining processes."""
    end = time.monotonic() + patience + END_SECONDS
    while time.monotonic() < end:
        # A signal during AXIS's response to its window only ends that response. Some end with an error, for
        # which LinuxCNC opens a window.
        number = signal.SIGTERM if time.monotonic() < end - END_SECONDS else signal.SIGKILL
        group = ["pgrep", "-g", str(process.pid), "-f", f"{display}|show_errors"]
        for shown in subprocess.run(group, capture_output=True, text=True).stdout.split():
            with suppress(ProcessLookupError):
                os.kill(int(shown), number)
        try:
            process.wait(SIGNAL_SECONDS)
            return
        except subprocess.TimeoutExpired:
            pass
    Path("/tmp/linuxcnc.lock").unlink(missing_ok=True)
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
    process.wait(10)


def driven(name, out, task, edit=lambda ini: None, path=None):
    """Starts a configuration and runs a task of `drive.py`; returns LinuxCNC's output."""
    with tempfile.TemporaryDirectory(prefix="pkmkins-screen-") as temporary, Screen() as screen:
        folder = Path(temporary)
        ini = copied(name, folder)
        edit(ini)
        env = {**environment(folder, screen), "INI_FILE_NAME": str(ini)}
        if path:
            env["PATH"] = path
        with open(out / "linuxcnc.log", "w") as log:
            process = started(ini, log, env)
            try:
                driver = [sys.executable, str(HERE / "drive.py"), str(out), task]
                done = subprocess.run(driver, env=env, capture_output=True, text=True, timeout=START_SECONDS + 120)
            finally:
                try:
                    stop(process)
                finally:
                    clear_hal()
        assert done.returncode == 0, done.stdout + done.stderr
    return (out / "linuxcnc.log").read_text(errors="replace")


def shown(name, out):
    driven(name, out, "program")
    return drawn.judged(out)


def filter_holds_back(out):
    """Checks that AXIS runs the filter, which rejects the program that it opens at the start."""
    def edit(ini):
        text = re.sub("(?m)^OPEN_FILE = .*$", "OPEN_FILE = programs/far.ngc", ini.read_text())
        text += "\n[FILTER]\nPROGRAM_EXTENSION = .ngc G code that fits the machine\nngc = pkm filter\n"
        ini.write_text(text)
        ini.with_name("programs").joinpath("far.ngc").write_text("G21 G90 M52 P1\nG1 F600 X200\nM2\n")

    log = driven("hexapod", out, "refused", edit)
    for text in ("does not fit the machine", "line 2: axis range: axis X violates its limit of -150 to 150 mm"):
        assert text in log, f"not reported to AXIS: {text}"
    return "AXIS says that the filter failed"


def without_the_command(out):
    """Checks that a machine without `pkm` and without pins that the panel would show starts with
    the existing ones, and reports the reasons."""
    def edit(ini):
        wiring = ini.with_name("hexapod-panel.tcl")
        wiring.write_text(wiring.read_text().replace(" pkmkins.margin.5 ", " pkmkins.margin.6 "))

    log = driven("hexapod", out, "bare", edit, "/usr/bin:/bin")
    for text in ("panel: not shown: missing pin pkmkins.margin.6",
                 "pkmkins-vismach: pkm: No such file", "pkmkins-panel: pkm: No such file", "make install-pkm"):
        assert text in log, f"not reported: {text}"
    return "homed, kinematics switched, without model and travel left"


def model_beside_axis(out):
    """Checks that the windows do not overlap as the shipped INI file starts them."""
    driven("hexapod", out, "beside", lambda ini: ini.write_text(ini.read_text().replace(f" --geometry {MODEL}", "")))
    found = json.loads((out / "beside.json").read_text())
    (left, _, width, _), (model, top, wide, high) = found["axis"], found["model"]
    screen = [int(part) for part in SCREEN.split("x")]
    assert left == 0 and model >= width and model + wide <= screen[0] and top >= 0 and top + high <= screen[1], found
    assert wide >= 500, f"the model is too small: {found}"
    return f"AXIS {width} pixels wide, model {wide}"


# AXIS executes ~/.axisrc in its own namespace. When drive.py requests it, this presses the button of the tool touch-off
# and answers its dialog, which waits in its own loop.
AXISRC = """
import os
touch_off_asked, touch_off_done = (
    os.path.join(os.path.dirname(os.environ["INI_FILE_NAME"]), name) for name in ("touch-off", "touched-off"))

def answer_touch_off(value):
    dialog = next((w for w in root_window.winfo_children() if w.winfo_class() == "Toplevel" and "TouchOff" in w.title()), None)
    if dialog is None:
        return root_window.after(100, answer_touch_off, value)
    inside = [w for frame in (dialog, *dialog.winfo_children()) for w in frame.winfo_children()]
    entry = next(w for w in inside if w.winfo_class() == "Entry")
    entry.delete(0, "end")
    entry.insert(0, value)
    next(w for w in inside if w.winfo_class() == "Button" and w["text"] == _("OK")).invoke()

def touch_off_when_asked():
    if not os.path.exists(touch_off_asked):
        return root_window.after(100, touch_off_when_asked)
    vars.ja_rbutton.set("z")
    root_window.after(100, answer_touch_off, open(touch_off_asked).read())
    root_window.tk.eval("$::_tabs_manual.jogf.zerohome.tooltouch invoke")
    os.rename(touch_off_asked, touch_off_done)

root_window.after(100, touch_off_when_asked)
"""


def tool_touch_off_at_a_tilt(out):
    """Makes the tool 15 mm longer in AXIS's own dialog: no joint exceeds its acceleration."""
    driven("hexapod", out, "touch-off", lambda ini: ini.parent.with_name(".axisrc").write_text(AXISRC))
    found = json.loads((out / "touch-off.json").read_text())
    assert found["acceleration_share"] <= 1.02, found
    return f"{found['acceleration_share']} of the acceleration limit, {found['busy_s']} s"


# A plate of 20 cm with a height of 6 cm below it, in centimeters, and points of its front and its left side.
BOX = ((-10, -10, -6), (10, 10, 0))
PLACE = (0, 0, -60)
SEEN = ((0, -100, -90), (60, -100, -90), (-60, -100, -80))


def box():
    """Returns its twelve triangles, as text STL."""
    corners = [tuple(BOX[bit][k] for k, bit in enumerate(bits)) for bits in itertools.product((0, 1), repeat=3)]
    faces = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    lines = ["solid box"]
    for face in faces:
        for n in ((0, 1, 2), (0, 2, 3)):
            points = "".join("vertex {} {} {}\n".format(*corners[face[k]]) for k in n)
            lines.append(f"facet normal 0 0 0\nouter loop\n{points}endloop\nendfacet")
    return "\n".join([*lines, "endsolid", ""])


def shapes_from_files(out):
    """Tests a platform with a shape, a frame whose file is 100 MB, a table whose file is missing, a broken spindle."""
    def edit(ini):
        ini.with_name("box.stl").write_text(box())
        ini.with_name("broken.obj").write_text("v 0 0 0\nf 1 2 3\n")
        with open(ini.with_name("huge.stl"), "wb") as huge:
            huge.truncate(100_000_000)
        keys = ["PLATFORM_MODEL = box.stl cm {} {} {}".format(*PLACE), "BASE_MODEL = huge.stl mm",
                "TABLE_MODEL = missing.stl mm", "SPINDLE_MODEL = broken.obj mm"]
        ini.write_text(ini.read_text().replace("[PKM]\n", "\n".join(["[PKM]", *keys, ""]), 1))

    driven("hexapod", out, "home", edit)
    title = json.loads((out / "home.json").read_text())["title"]
    for text in ("base is drawn without its model", "100 MB", "table is drawn without", "No such file",
                 "spindle is drawn without", "does not exist"):
        assert text in title, f"the window does not say {text}: {title}"
    return drawn.has_shape(out, SEEN)


class Interface(NamedTuple):
    """A user interface of LinuxCNC other than AXIS."""
    display: str  # value of [DISPLAY]DISPLAY
    process: str  # part of its command line, and of no other
    window: str = ""  # part of the title of its window; empty without a window
    machine: str = "hexapod"
    # Whether it loads [HAL]POSTGUI_HALFILE.
    loads_panel: bool = False


INTERFACES = {
    "gmoccapy": Interface("gmoccapy", "bin/gmoccapy ", "gmoccapy", loads_panel=True),
    "qtdragon": Interface("qtvcp qtdragon", "bin/qtvcp ", "QtDragon", "tripod", loads_panel=True),
    "tklinuxcnc": Interface("tklinuxcnc", "tklinuxcnc.tcl ", "TkLinuxCNC"),
    "linuxcncrsh": Interface("linuxcncrsh", "linuxcncrsh "),
    "halui": Interface("halui", "^halui "),
    # Waits for a key.
    "dummy": Interface("dummy", "no process"),
}
NO_PANEL = "pkmkins: panel: not shown: this user interface has not loaded [DISPLAY]PYVCP"
NO_MODEL = "pkmkins-vismach: "


def survived(interface, out):
    """Runs a shipped INI file with only DISPLAY changed: the machine is homed, runs a program and is still on
    after the time at which LinuxCNC ended in the past."""
    with tempfile.TemporaryDirectory(prefix="pkmkins-screen-") as temporary, Screen() as screen:
        folder = Path(temporary)
        copy = folder / "config"
        shutil.copytree(REPOSITORY / "configs" / interface.machine, copy)
        ini = copy / f"{interface.machine}.ini"
        text, count = re.subn("(?m)^DISPLAY = axis$", f"DISPLAY = {interface.display}", ini.read_text())
        assert count == 1, f"{ini.name} does not name AXIS once"
        ini.write_text(text)
        env = {**environment(folder, screen), "INI_FILE_NAME": str(ini)}
        if not interface.window:
            del env["DISPLAY"]
        with open(out / "linuxcnc.log", "w") as log:
            process = subprocess.Popen(["linuxcnc", str(ini)], stdin=subprocess.PIPE, stdout=log, stderr=log, env=env,
                                       cwd=ini.parent, start_new_session=True)
            try:
                driver = [sys.executable, str(HERE / "drive.py"), str(out), "outlived", interface.window,
                          str(process.pid), NO_PANEL if interface.loads_panel else ""]
                done = subprocess.run(driver, env=env, capture_output=True, text=True, timeout=START_SECONDS + 120)
                ended = has_ended((out / "linuxcnc.log").read_text(errors="replace"))
            finally:
                try:
                    process.stdin.close()
                    # Those in Python treat a signal as a user interruption, and continue.
                    stop(process, interface.process, patience=0)
                finally:
                    clear_hal()
        log = (out / "linuxcnc.log").read_text(errors="replace")
        assert not ended, f"LinuxCNC has ended: {log[-1500:]}"
        assert done.returncode == 0, done.stdout + done.stderr
    # Missing pins are reported once, and the rest is connected silently.
    reports = [line for line in log.splitlines() if "pkmkins: " in line]
    assert len(reports) == interface.loads_panel and all(line.startswith(NO_PANEL) for line in reports), reports
    assert log.count(NO_MODEL) == (not interface.window), "the model is silent, or reports its fault more than once"
    return f"on after {done.stdout.strip()} s, jogs are guarded"


# Cases in addition to the configurations.
CASES = {**{f"under-{name}": partial(survived, interface) for name, interface in INTERFACES.items()},
         "a-filter-that-holds-back": filter_holds_back, "without-the-command": without_the_command,
         "model-beside-axis": model_beside_axis, "shapes-from-files": shapes_from_files, "tool-touch-off-at-a-tilt": tool_touch_off_at_a_tilt}


def run_one(name, out):
    begin = time.monotonic()
    try:
        detail = CASES[name](out) if name in CASES else shown(name, out)
    except (AssertionError, subprocess.SubprocessError, OSError, ValueError) as reason:
        print(f"FAIL screen of {name}: {reason}", flush=True)
        return False
    (out / PASSED).touch()
    print(f"PASS screen of {name} ({detail}; {time.monotonic() - begin:.0f} s)", flush=True)
    return True


def chosen(only):
    words = only.split(",")
    names = sorted(folder.name for folder in (REPOSITORY / "configs").iterdir())
    return [name for name in [*CASES, *names] if any(word in name for word in words)]


def parsed():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--only", default="",
                           help="configurations and cases whose names contain this text, or one of several with commas")
    arguments.add_argument("--out", type=Path, help="folder that keeps pictures and logs")
    arguments.add_argument("--pkm", type=Path, default=REPOSITORY / "target/host/pkm")
    return arguments.parse_args()


def outside(options, out):
    for stale in out.glob(f"*/{PASSED}"):
        stale.unlink()
    arguments = ["--only", options.only]
    code = rerun_unprivileged("tests/viewer/screens.py", arguments, 1800, out, [options.pkm.resolve()], LANES)
    names = chosen(options.only)
    failed = [name for name in names if not (out / name / PASSED).exists()]
    print(f"screens: {len(names) - len(failed)} passed, {len(failed)} failed {' '.join(failed)}".rstrip())
    return code or (1 if failed else 0)


def main():
    options = parsed()
    if not is_unprivileged():
        if options.out:
            options.out.mkdir(parents=True, exist_ok=True)
            return outside(options, options.out.resolve())
        with tempfile.TemporaryDirectory(prefix="pkmkins-screens-") as out:
            return outside(options, Path(out))
    with only_one():
        outs = [(name, REPOSITORY / "out" / name) for name in chosen(options.only)]
        results = [run_one(name, out) for name, out in outs if claimed(out)]
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
