#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Counts the instructions of LinuxCNC's servo cycle, alone and while ten browsers watch the machine through pkm-live.

    tests/live/instructions.py

Single-steps the servo thread of a machine that stands in the middle of its program, for some cycles.
Needs root, because LinuxCNC's real-time process belongs to root. Only 64-bit x86 processors are
supported.
"""

import ctypes
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from served import Served  # noqa: E402
from session import Session  # noqa: E402
from unprivileged import REPOSITORY, is_unprivileged, only_one, rerun_unprivileged  # noqa: E402

MODULE = Path("/usr/lib/linuxcnc/modules/pkmkins.so")
BROWSERS = 10
# Full periods in which the module updates the pins that only users read.
CYCLES = 16
# The path through the code depends on whether a drive's last digit has changed and on how long the last cycle took:
# even without a browser two counts differ by 0.1 %.
SLACK = 0.005
# Fewer instructions mean another thread: the kinematics alone need more.
LEAST = 10_000
SECONDS = 100

# Linux: numbers of requests and of a system call, positions of registers, and how to wait for threads.
SEIZE, INTERRUPT, STEP, REGISTERS, DETACH = 0x4206, 0x4207, 9, 12, 17
CLOCK_NANOSLEEP = "230"
INSTRUCTION_POINTER = 16
ALL_THREADS = 0x40000000


class Thread:
    """A thread that is single-stepped."""

    def __init__(self, number):
        self.number = number
        self.libc = ctypes.CDLL(None, use_errno=True)
        self.libc.ptrace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
        self.registers = (ctypes.c_ulonglong * 27)()

    def __enter__(self):
        self.ask(SEIZE)
        self.ask(INTERRUPT)
        os.waitpid(self.number, ALL_THREADS)
        return self

    def __exit__(self, *_):
        self.ask(DETACH)

    def ask(self, request, data=None):
        if self.libc.ptrace(request, self.number, None, data) < 0:
            number = ctypes.get_errno()
            raise OSError(number, f"ptrace {request}: {os.strerror(number)}")

    def step(self):
        """Executes an instruction; returns the address of the next one."""
        self.ask(STEP)
        os.waitpid(self.number, ALL_THREADS)
        self.ask(REGISTERS, ctypes.addressof(self.registers))
        return self.registers[INSTRUCTION_POINTER]

    def cycles(self, count, place):
        """Counts the instructions of some cycles, from one arrival at `place` to the next. A late cycle, as all are
        here, begins without a pause."""
        numbers = []
        for _ in range(count + 1):
            steps = 1
            while self.step() != place:
                steps += 1
            numbers.append(steps)
        return numbers[1:]


def servo_thread(home):
    """Returns the thread of the real-time process that has worked most; the process has this home folder."""
    for process in filter(str.isdigit, os.listdir("/proc")):
        folder = Path("/proc") / process
        try:
            if (folder / "comm").read_text() == "rtapi_app\n" and f"HOME={home}\0".encode() in (
                    folder / "environ").read_bytes():
                return asleep(max((folder / "task").iterdir(), key=worked))
        except OSError:
            continue
    raise AssertionError("LinuxCNC's servo thread is not there")


def worked(thread):
    """Returns its processor time in ticks."""
    return sum(map(int, (thread / "stat").read_text().rpartition(")")[2].split()[11:13]))


def asleep(thread):
    """Returns its number, once it waits for the next cycle."""
    while (thread / "syscall").read_text().split()[0] != CLOCK_NANOSLEEP:
        time.sleep(0.0002)
    return int(thread.name)


def forward_of(thread):
    """Returns the address of kinematicsForward in a thread, which LinuxCNC calls once a cycle."""
    maps = Path(f"/proc/{thread}/maps").read_text().splitlines()
    first = next(line for line in maps if line.endswith(f"/{MODULE.name}"))
    symbols = subprocess.run(["nm", "-D", MODULE], check=True, capture_output=True, text=True).stdout.split("\n")
    symbol = next(line for line in symbols if line.endswith(" kinematicsForward"))
    return int(first.split("-")[0], 16) + int(symbol.split()[0], 16)


def count(place):
    """Returns both counts, requested through files in `place` from the machine that runs elsewhere."""
    found = {}
    for what in ("alone", "watched"):
        wait_for(place / what)
        thread = servo_thread((place / "home").read_text())
        with Thread(thread) as servo:
            found[what] = servo.cycles(CYCLES, forward_of(thread))
        (place / f"{what}-counted").touch()
    return found


def wait_for(file):
    end = time.monotonic() + SECONDS
    while not file.exists():
        assert time.monotonic() < end, f"{file.name}: nothing after {SECONDS} s"
        time.sleep(0.05)


def run(place):
    """Runs the machine as a normal user."""
    out = REPOSITORY / "out"
    with Session(REPOSITORY / "configs/hexapod") as session, Served(session, out) as served:
        (place / "home").write_text(str(session.folder))
        path = session.copy / "programs/five-axis-surface.ngc"
        result = session.run("stands", out, SECONDS, path=str(path), place=str(place), port=served.port, count=BROWSERS)
    assert result["ok"], result


def main():
    if is_unprivileged():
        with only_one():
            run(Path(sys.argv[1]))
        return 0
    if os.getuid() != 0 or platform.machine() != "x86_64":
        print("SKIP instructions of the servo cycle: not counted without root, or on another processor")
        return 0
    with tempfile.TemporaryDirectory(prefix="pkmkins-count-", dir="/var/tmp") as place:
        os.chmod(place, 0o777)
        lane = threading.Thread(target=rerun_unprivileged, args=("tests/live/instructions.py", [place], SECONDS), daemon=True)
        lane.start()
        found = count(Path(place))
        lane.join()
    middle = {what: statistics.mean(numbers) for what, numbers in found.items()}
    text = ", ".join(f"{what} {middle[what]:.0f} ({min(numbers)} to {max(numbers)})" for what, numbers in found.items())
    assert middle["alone"] > LEAST, f"not the servo thread: {text}"
    assert abs(middle["watched"] - middle["alone"]) <= SLACK * middle["alone"], text
    print(f"PASS instructions of a servo cycle, {CYCLES} each: {text}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
