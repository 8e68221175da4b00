#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Tests the files that a user interface executes, with parts that are missing, taken, slow or dead.

    tests/live/attach_test.py [--only TEXT]

A user interface ends LinuxCNC if a file of [HAL]POSTGUI_HALFILE fails. HAL alone runs, with the module and with
stand-ins for LinuxCNC's task, motion, PyVCP and pkmkins-panel. In every case the panel's file of a shipped machine
must end with code 0 within a time bound, and report each fault in one line. Prints a line for each case and a
closing line; exit code 1 if any fails. tests/hal/panel_test.tcl and jog_test.tcl have more cases, without HAL.
"""

import argparse
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from unprivileged import REPOSITORY, clear_hal, is_unprivileged, only_one, rerun_unprivileged  # noqa: E402

HALLIB = "/usr/share/linuxcnc/hallib"
PANEL = "hexapod-panel.tcl"
# Changes in the test: waits are shorter, and pkmkins-panel is a stand-in, because haltcl searches /usr/bin first.
CHANGES = {"pkmkins_jog.tcl": {"task_seconds 20": "task_seconds 2"},
           "pkmkins_panel.tcl": {"start_seconds 10": "start_seconds 5",
                                 "exec {*}$command": "exec $::env(STAND_INS)/[lindex $command 0]"}}
# All waits, and the time of haltcl on a busy computer.
WORST_SECONDS = 15

MODULE = ["loadrt pkmkins legs=strut:6", "loadrt threads name1=servo period1=1000000", "addf pkmkins.monitor servo"]
AXES = "xyzabc"
SPEED = 200.0

# One that has the pins, one that hangs before it is ready, one that ends, and one that becomes ready and dies.
PROGRAMS = {
    "stands": f"#!/bin/sh\nexec {sys.executable} {__file__} --stand-in pkmkins-panel $(dirname $0)/..\n",
    "hangs": "#!/bin/sh\nexec sleep 60\n",
    "ends": "#!/bin/sh\nexit 1\n",
    "dies": "#!/usr/bin/python3\nimport hal, os\nhal.component('pkmkins-panel').ready()\nos._exit(1)\n",
}


class Wrong(Exception):
    """A deviation from the expected behavior of a file."""


def stand_in(name, folder):
    """Runs as a component until it is ended."""
    import hal
    made = hal.component(name)
    for line in (folder / f"{name}.pins").read_text().splitlines():
        prefix, pin, kind, direction = line.split()
        made.setprefix(prefix)
        made.newpin(pin, getattr(hal, f"HAL_{kind}"), getattr(hal, f"HAL_{direction}"))
        if pin.endswith("max_velocity"):
            made[pin] = SPEED
    made.ready()
    try:
        signal.pause()
    except KeyboardInterrupt:
        # HAL ends a component in Python in this way.
        pass


def widgets():
    """Returns the pins of the panel's widgets, by its nets, with the kinds of the pins behind them."""
    kinds = {"joint": "FLOAT", "margin": "FLOAT", "geometry-hash": "U32"}
    bits = re.compile(r"travel-known|guard-on|limit-soon|feed-inhibit|tool-busy|is-|geometry-ok|geometry-changed")
    for line in (REPOSITORY / "configs/hexapod" / PANEL).read_text().splitlines():
        found = re.fullmatch(r"    (\S+) (\S+)", line)
        if found:
            name = found[2]
            yield name, "BIT" if bits.match(name) else kinds.get(name, "FLOAT")


def parts(without=()):
    """Returns the pins of the stand-ins by component, except those that are missing."""
    made = {
        "inihal": [("ini", "traj_max_velocity", "FLOAT", "IN"),
                   *(("ini", f"{axis}.max_velocity", "FLOAT", "IN") for axis in AXES)],
        "motion": [("motion", "switchkins-type", "FLOAT", "IN"),
                   *(("joint", f"{n}.pos-fb", "FLOAT", "OUT") for n in range(6))],
        "pyvcp": [*(("pyvcp", name, kind, "IN") for name, kind in widgets()),
                  *(("pyvcp", f"kinematics.{choice}", "BIT", "OUT") for choice in ("machine", "joints"))],
        "pkmkins-panel": [*(("pkmkins-panel", f"{axis}-{way}", "FLOAT", "OUT") for axis in AXES for way in ("minus", "plus")),
                          *(("pkmkins-panel", name, "BIT", "OUT") for name in ("known", "guard-on")),
                          *(("pkmkins-panel", f"ask-{choice}", "BIT", "IN") for choice in ("machine", "joints")),
                          ("pkmkins-panel", "kinematics", "FLOAT", "OUT")],
    }
    return {name: [pin for pin in pins if f"{pin[0]}.{pin[1]}" not in without]
            for name, pins in made.items() if name not in without}


class Hal:
    """HAL with the module and stand-ins, and a folder with the panel's file."""

    def __init__(self, folder, without=(), load=MODULE, start=True, program="stands"):
        self.folder, self.load = folder, list(load)
        for name, pins in parts(without).items():
            (folder / f"{name}.pins").write_text("".join(" ".join(pin) + "\n" for pin in pins))
            if name != "pkmkins-panel":
                self.load.append(f"loadusr -Wn {name} {sys.executable} {__file__} --stand-in {name} {folder}")
        if start and load:
            self.load.append("start")
        self.file = folder / PANEL
        self.file.write_text((REPOSITORY / "configs/hexapod" / PANEL).read_text())
        self.hallib = folder / "hallib"
        self.hallib.mkdir()
        for name, changes in CHANGES.items():
            text = Path(HALLIB, name).read_text()
            for before, after in changes.items():
                assert text.count(before) == 1, f"{name} has not {before}"
                text = text.replace(before, after)
            (self.hallib / name).write_text(text)
        found = folder / "bin"
        found.mkdir()
        if program:
            (found / "pkmkins-panel").write_text(PROGRAMS[program])
            (found / "pkmkins-panel").chmod(0o755)
        self.environment = {**os.environ, "HALLIB_DIR": str(self.hallib), "STAND_INS": str(found)}

    def __enter__(self):
        subprocess.run(["/usr/lib/linuxcnc/realtime", "start"], capture_output=True, timeout=60)
        for line in self.load:
            self.command(*line.split())
        return self

    def __exit__(self, *_):
        clear_hal()

    def command(self, *words):
        with open(self.folder / "out", "w+") as out:
            done = subprocess.run(["halcmd", *words], stdin=subprocess.DEVNULL, stdout=out, stderr=out, timeout=60)
            out.seek(0)
            text = out.read()
        if done.returncode != 0:
            raise Wrong(f"halcmd {' '.join(words)}: {text}")
        return text

    def reported(self, *expected, file=None, shell=""):
        """Executes the panel's file: expects code 0, and these lines of pkmkins, each once and in this order."""
        begin = time.monotonic()
        with open(self.folder / "printed", "w+") as out:
            done = subprocess.run(["sh", "-c", f"exec haltcl {file or self.file} {shell}"], stdin=subprocess.DEVNULL,
                                  stdout=out, stderr=out, env=self.environment, cwd=self.folder, timeout=100)
            out.seek(0)
            text = out.read()
        took = time.monotonic() - begin
        lines = [line for line in text.splitlines() if line.startswith("pkmkins: ")]
        if done.returncode != 0 or took > WORST_SECONDS:
            raise Wrong(f"code {done.returncode} after {took:.0f} s: {text}")
        if len(lines) != len(expected) or not all(word in line for word, line in zip(expected, lines)):
            raise Wrong(f"expected {expected}, found {lines}: {text}")

    def is_on(self, pin, name):
        """Checks the signal of a pin."""
        text = self.command("-s", "show", "pin", pin)
        if not text.split() or text.split()[-1] != name:
            raise Wrong(f"{pin} is not on {name}: {text}")


NO_PANEL = "panel: not shown: this user interface has not loaded [DISPLAY]PYVCP"
NOT_SLOWED = "jogs do not slow down near limits: "
NO_TRAVEL = "panel: pkmkins-panel does not start, so the travel left is not shown: "
NO_TRAVEL_PINS = "panel: not shown: missing pin pkmkins-panel.x-minus, "


def everything(folder):
    """Tests the complete set of parts, and executes the file again."""
    with Hal(folder) as hal:
        for _ in range(2):
            hal.reported()
            for axis in AXES:
                hal.is_on(f"ini.{axis}.max_velocity", f"pkmkins:jog-velocity-{axis}")
            hal.is_on("pyvcp.joint-5", "panel:joint-5")
            hal.is_on("pyvcp.x-plus", "panel:x-plus")
            hal.is_on("pyvcp.kinematics.joints", "panel:ask-joints")
            # The second time the selector is connected.
            hal.command("unlinkp", "motion.switchkins-type")
            hal.command("unlinkp", "pkmkins-panel.kinematics")


def no_panel(folder):
    """Tests the file as under gmoccapy, the present one and that of version 1.0."""
    with Hal(folder, ("pyvcp",)) as hal:
        hal.reported(NO_PANEL)
        hal.is_on("ini.x.max_velocity", "pkmkins:jog-velocity-x")
        old = folder / "old.tcl"
        today = hal.file.read_text()
        begin, end = today.index("if {"), today.index("pkmkins_panel::start")
        old.write_text(f"source [file join $::env(HALLIB_DIR) pkmkins_panel.tcl]\n{today[end:]}")
        assert begin < end
        hal.reported(NO_PANEL, file=old)


def own_window(folder):
    """Tests a panel in a separate window, which starts late."""
    with Hal(folder, ("pyvcp",)) as hal:
        pins = parts()["pyvcp"]
        (folder / "pyvcp.pins").write_text("".join(" ".join(pin) + "\n" for pin in pins))
        (folder / "machine.ini").write_text("[APPLICATIONS]\nAPP = pyvcp -c pyvcp hexapod-panel.xml\n")
        late = f"sleep 1; exec {sys.executable} {__file__} --stand-in pyvcp {folder}"
        with subprocess.Popen(["sh", "-c", late]) as process:
            try:
                hal.reported(file=f"-i machine.ini {hal.file}")
                hal.is_on("pyvcp.joint-5", "panel:joint-5")
            finally:
                process.terminate()


def late_task(folder):
    """Tests a busy task that has created its pins but not set them yet: a speed of 0 would stay in force."""
    with Hal(folder, ("pyvcp",)) as hal:
        for axis in AXES:
            hal.command("setp", f"ini.{axis}.max_velocity", "0")
        script = "; ".join(f"sleep 0.2; halcmd setp ini.{axis}.max_velocity 200" for axis in AXES)
        with subprocess.Popen(["sh", "-c", script]):
            hal.reported(NO_PANEL)
        for axis in AXES:
            hal.is_on(f"ini.{axis}.max_velocity", f"pkmkins:jog-velocity-{axis}")
            if float(hal.command("getp", f"pkmkins.axis-max-velocity.{axis}")) != SPEED:
                raise Wrong(f"the speed of {axis} is lost")


def pins_taken(folder):
    """Tests pins on other signals, and a signal of our name with another type."""
    with Hal(folder) as hal:
        for line in ("net theirs ini.x.max_velocity", "net limit pkmkins.axis-max-velocity.y", "newsig panel:joint-2 bit",
                     "net widget pyvcp.joint-1", "net selector motion.switchkins-type"):
            hal.command(*line.split())
        hal.reported(f"{NOT_SLOWED}ini.x.max_velocity already has signal theirs",
                 "panel: motion.switchkins-type already has signal selector", "panel: not shown: joint.1.pos-fb: ")
        hal.is_on("ini.z.max_velocity", "pkmkins:jog-velocity-z")
        hal.is_on("pyvcp.joint-5", "panel:joint-5")


def component(program, *reasons):
    """Checks a pkmkins-panel that is missing, or does not become ready."""
    def check(folder):
        with Hal(folder, program=program) as hal:
            hal.reported(f"{NO_TRAVEL}{reasons[0]}", NO_TRAVEL_PINS)
            hal.is_on("pyvcp.joint-5", "panel:joint-5")
            if hal.command("getp", "pyvcp.x-minus").strip().lower() not in ("nan", "-nan"):
                raise Wrong("travel left shows a number")
            if subprocess.run(["pgrep", "-f", f"{folder}/bin/pkmkins-panel"]).returncode == 0:
                raise Wrong("it still runs")
    return check


def no_files(folder):
    """Tests files of pkmkins that are missing, and a folder that is not named."""
    with Hal(folder) as hal:
        (hal.hallib / "pkmkins_jog.tcl").unlink()
        hal.reported("panel: not connected: ", "panel: not everything is shown: ", "panel: not everything is shown: ",
                 "panel: not everything is shown: ")
        (hal.hallib / "pkmkins_panel.tcl").unlink()
        hal.reported("panel: not connected: ")
        del hal.environment["HALLIB_DIR"]
        hal.reported("panel: not connected: ")


def no_reader(folder):
    """Tests a standard error that is closed, or not read."""
    with Hal(folder, ("pyvcp",), start=False) as hal:
        hal.reported(shell="2>&-")
        hal.reported(shell="2>/dev/full")


CASES = {
    "everything": everything, "no panel": no_panel, "a panel in a window of its own": own_window,
    "a late task": late_task, "pins that are taken": pins_taken,
    "a component that is missing": component(None, "couldn't execute"),
    "a component that ends": component("ends", "it has exited"),
    "a component that dies": component("dies", "it has exited"),
    "a component that hangs": component("hangs", "it was not ready within 5 s"),
    "files that are missing": no_files, "a report without a reader": no_reader,
}


def passes(name, case):
    begin = time.monotonic()
    try:
        with tempfile.TemporaryDirectory(prefix="pkmkins-attach-") as folder:
            case(Path(folder))
        print(f"PASS {name} ({time.monotonic() - begin:.1f} s)", flush=True)
        return True
    except (Wrong, subprocess.TimeoutExpired) as error:
        print(f"FAIL {name}: {error}", flush=True)
        return False


def main():
    if sys.argv[1:2] == ["--stand-in"]:
        return stand_in(sys.argv[2], Path(sys.argv[3]))
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--only", default="", help="the cases whose names contain this")
    only = arguments.parse_args().only
    if not is_unprivileged():
        return rerun_unprivileged("tests/live/attach_test.py", ["--only", only], timeout=300)
    with only_one():
        results = [passes(name, case) for name, case in CASES.items() if only in name]
    print(f"{sum(results)} passed, {len(results) - sum(results)} failed")
    return 0 if results and all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
