# SPDX-License-Identifier: GPL-2.0-or-later
"""Controls LinuxCNC as one object: commands, status, messages, HAL. Runs inside a LinuxCNC session."""

import os
import subprocess
import time
from pathlib import Path
from typing import NamedTuple

import hal
import linuxcnc

import ini_edit

KINDS = {
    linuxcnc.NML_ERROR: "error", linuxcnc.OPERATOR_ERROR: "error",
    linuxcnc.NML_TEXT: "text", linuxcnc.OPERATOR_TEXT: "text",
    linuxcnc.NML_DISPLAY: "text", linuxcnc.OPERATOR_DISPLAY: "text",
}
POLL_SECONDS = 0.01
# Many of the task's cycles of 10 ms, for a busy computer.
MESSAGE_SECONDS = 5
AXES = "xyzabc"


class Failure(Exception):
    """Behavior of LinuxCNC that the scenario does not expect."""


def halcmd(*arguments):
    """Returns the output of one halcmd; a refused command is a failure of the scenario."""
    done = subprocess.run(["halcmd", *arguments], stdin=subprocess.DEVNULL, capture_output=True,
                          text=True, timeout=20)
    if done.returncode != 0:
        raise Failure(f"halcmd {' '.join(arguments)}: {done.stderr.strip()}")
    return done.stdout


def link(pin, signal):
    """Connects `pin` to its present signal, or to a new one; returns the signal's name."""
    for line in halcmd("-s", "show", "pin", pin).splitlines():
        words = line.split()  # owner type direction value name [arrow signal]
        if words[4:5] == [pin] and len(words) > 6:
            return words[6]
    halcmd("net", signal, pin)
    return signal


class Layout(NamedTuple):
    """The joints and letters of the INI file."""
    joints: range
    struts: list  # indices of the legs that are struts
    letters: str  # letters that the kinematics move, in the order of the identity kinematics
    second_home: list  # letters of a second mechanism with their values in [TRAJ]HOME
    home: list  # [TRAJ]HOME, a pose
    joint_home: list  # HOME of every joint
    acceleration: float  # the largest MAX_ACCELERATION of a joint

    @classmethod
    def of_running(cls):
        ini = linuxcnc.ini(os.environ["INI_FILE_NAME"])
        words = ini.find("KINS", "KINEMATICS").split()
        given = dict(word.split("=", 1) for word in words if "=" in word)
        groups = [group.split(":") for group in given.get("legs", "strut:6").split(",")]
        kinds = [kind for kind, count in groups for _ in range(int(count))]
        joints = range(int(ini.find("KINS", "JOINTS")))
        whole = [float(word) for word in ini.find("TRAJ", "HOME").split()]
        others = ini_edit.second_letters(Path(os.environ["INI_FILE_NAME"]).read_text()).lower()
        second_home = [(letter, value) for letter, value in zip("xyzabcuvw", whole) if letter in others]
        home = whole[:len(AXES)]
        return cls(joints=joints, second_home=second_home, home=home + [0.0] * (len(AXES) - len(home)),
                   joint_home=[float(ini.find(f"JOINT_{n}", "HOME")) for n in joints],
                   acceleration=max(float(ini.find(f"JOINT_{n}", "MAX_ACCELERATION")) for n in joints),
                   struts=[n for n, kind in enumerate(kinds) if kind == "strut"],
                   letters=(given.get("coordinates", AXES) + given.get("table", "")).lower())

    def moved_home(self):
        """Returns the letters that legs and tables move, of both mechanisms, with their values at home."""
        return [(letter, value) for letter, value in zip(AXES, self.home) if letter in self.letters] + self.second_home


class Machine:
    """The running LinuxCNC. Every wait has a timeout and collects messages meanwhile."""

    def __init__(self):
        self.layout = Layout.of_running()
        self.component = hal.component("live")
        self.component.newpin("phase", hal.HAL_S32, hal.HAL_OUT)
        self.component.ready()
        self.command = linuxcnc.command()
        self.stat = linuxcnc.stat()
        self.errors = linuxcnc.error_channel()
        self.messages = []
        self.poll()

    def poll(self):
        self.stat.poll()
        while found := self.errors.poll():
            kind, text = found
            self.messages.append([KINDS.get(kind, str(kind)), text])

    def wait(self, condition, seconds, what):
        """Waits until `condition()` is true; Failure after `seconds`."""
        limit = time.monotonic() + seconds
        self.poll()
        while not condition():
            if time.monotonic() > limit:
                raise Failure(f"{what}: not within {seconds} s; messages: {self.messages}")
            time.sleep(POLL_SECONDS)
            self.poll()

    def pause(self, seconds):
        """Waits, collecting messages."""
        limit = time.monotonic() + seconds
        while time.monotonic() < limit:
            time.sleep(POLL_SECONDS)
            self.poll()

    def is_on(self):
        return self.stat.task_state == linuxcnc.STATE_ON

    def is_homed(self):
        return all(self.stat.homed[n] for n in self.layout.joints)

    def is_world(self):
        return self.stat.motion_mode == linuxcnc.TRAJ_MODE_TELEOP

    def is_idle(self):
        return self.stat.interp_state == linuxcnc.INTERP_IDLE and self.stat.inpos

    def turn_on(self):
        self.command.state(linuxcnc.STATE_ESTOP_RESET)
        self.wait(lambda: self.stat.task_state != linuxcnc.STATE_ESTOP, 5, "estop reset")
        self.command.state(linuxcnc.STATE_ON)
        self.wait(self.is_on, 5, "machine on")

    def turn_off(self):
        self.command.state(linuxcnc.STATE_OFF)
        self.wait(lambda: not self.is_on(), 5, "machine off")

    def home(self):
        """Homes all joints in the order of HOME_SEQUENCE."""
        self.set_mode(linuxcnc.MODE_MANUAL)
        self.command.home(-1)
        self.wait(self.is_homed, 60, "homing")
        self.wait(lambda: self.stat.inpos, 5, "standstill after homing")

    def set_mode(self, mode):
        self.command.mode(mode)
        self.command.wait_complete()
        self.wait(lambda: self.stat.task_mode == mode, 5, f"mode {mode}")

    def joint_mode(self):
        """Enters joint mode. After homing LinuxCNC enters world mode automatically, as at any change to manual."""
        self.set_mode(linuxcnc.MODE_MANUAL)
        self.command.teleop_enable(0)
        self.wait(lambda: self.stat.motion_mode == linuxcnc.TRAJ_MODE_FREE, 5, "joint mode")

    def world_mode(self):
        self.set_mode(linuxcnc.MODE_MANUAL)
        self.command.teleop_enable(1)
        self.wait(self.is_world, 5, "world mode")

    def start(self):
        """Switches the machine on, homes it and enters world mode."""
        self.turn_on()
        self.home()
        self.world_mode()

    def mdi(self, text, seconds=60, enters=True):
        """Runs a block; `enters` MDI mode first, which gives the interpreter the position also if it is in that mode."""
        if enters:
            self.set_mode(linuxcnc.MODE_MDI)
        self.command.mdi(text)
        self.command.wait_complete(seconds)
        self.wait(self.is_idle, seconds, f"MDI {text}")

    def run_program(self, path, progress, seconds, begun=lambda: None):
        """Runs a program to its end; reports to `progress`, and calls `begun` when it runs."""
        self.set_mode(linuxcnc.MODE_AUTO)
        self.command.program_open(path)
        self.command.auto(linuxcnc.AUTO_RUN, 0)
        self.wait(lambda: self.stat.interp_state != linuxcnc.INTERP_IDLE, 10, "start of the program")
        begun()
        self.wait(lambda: progress.update(self.stat) or self.is_idle(), seconds, "end of the program")
        progress.finish()

    def jog_joint(self, joint, distance, speed):
        """Jogs one joint by a distance, in joint mode; returns when it is there."""
        target = self.get(f"joint.{joint}.pos-cmd") + distance
        self.command.jog(linuxcnc.JOG_INCREMENT, True, joint, speed, distance)
        self.wait(lambda: abs(self.get(f"joint.{joint}.pos-cmd") - target) < 1e-6, 60,
                  f"jog of joint {joint} by {distance}")

    @staticmethod
    def get(pin):
        return hal.get_value(pin)

    @staticmethod
    def set(pin, value):
        halcmd("setp", pin, str(value))

    def joints(self):
        return [self.get(f"joint.{n}.motor-pos-fb") for n in self.layout.joints]

    def commanded_joints(self):
        return [self.get(f"joint.{n}.pos-cmd") for n in self.layout.joints]

    def pose(self, letters=AXES):
        return [self.get(f"axis.{letter}.pos-cmd") for letter in letters]

    def error_texts(self):
        self.poll()
        return [text for kind, text in self.messages if kind == "error"]

    def errors_with(self, part):
        """Returns the operator's error messages that contain this part. Waits for them: LinuxCNC's task shows a text
        later than the servo cycle sets the pins of its cause."""
        def found():
            return [text.strip() for text in self.error_texts() if part in text]

        self.wait(found, MESSAGE_SECONDS, f"an error with {part!r}")
        return found()


class Progress:
    """The progress of a program, in a file for the process that started the run: the furthest line and
    the time, because loops repeat lines."""

    def __init__(self, path, lines):
        self.path = path
        self.lines = lines
        self.start = time.monotonic()
        self.furthest = 0
        self.reported_at = 0.0

    def update(self, stat):
        now = time.monotonic()
        self.furthest = max(self.furthest, min(stat.motion_line, self.lines))
        if now - self.reported_at < 0.3:
            return
        self.reported_at = now
        self._write(now)

    def finish(self):
        self.furthest = self.lines
        self._write(time.monotonic())

    def _write(self, now):
        percent = 100 * self.furthest // self.lines
        self.path.write_text(f"{self.path.parent.name}: {percent:3d} % of {self.lines} lines, "
                             f"{now - self.start:4.1f} s")
