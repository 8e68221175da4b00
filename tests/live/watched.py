# SPDX-License-Identifier: GPL-2.0-or-later
"""Scenarios of a machine that is watched through pkm-live."""

import os
import signal
import subprocess
import threading
import time
from bisect import bisect
from pathlib import Path

import hal
import linuxcnc

from browsers import Browser, deaf, is_dropped
from machine import AXES, Progress, halcmd

POSE = [f"pkmkins.{letter}" for letter in AXES]
# Updates per second that the page promises.
RATE = 20
# At a standstill, forward kinematics agrees to its convergence criterion.
FORWARD = 1e-9
# Largest age of a state that arrives: an update, and the delay of a busy computer. Every move that takes longer detects
# a state that no longer changes.
OLD_SECONDS = 1
# Single-stepping some servo cycles takes this long.
COUNTING_SECONDS = 60


class Sampler(threading.Thread):
    """The pose on the pins, sampled as often as a busy computer allows, with times."""

    def __init__(self):
        super().__init__(daemon=True)
        self.samples = []
        self.is_stopped = False
        self.start()

    def run(self):
        while not self.is_stopped:
            self.samples.append((time.monotonic(), [hal.get_value(pin) for pin in POSE]))
            time.sleep(0.002)

    def stop(self):
        self.is_stopped = True
        self.join(5)


def farthest(samples, events):
    """Returns the largest difference of the coordinates of events from the pins shortly before. Pins are read
    one after the other, and a busy computer delays them: each is compared separately. Between two samples
    of a pin it moves: a coordinate may be as far from both, and not farther."""
    times = [when for when, _ in samples]
    most = 0.0
    for at, state in events:
        # Include the sample after the event: it may have been read after the last one before.
        near = [pose for _, pose in samples[bisect(times, at - OLD_SECONDS):bisect(times, at) + 1]]
        for pin, shown, seen in zip(POSE, state["pose"] or [], zip(*near)):
            own = min(abs(shown - one) for one in seen)
            step = max((abs(a - b) for a, b in zip(seen, seen[1:])), default=0.0)
            assert own <= step + FORWARD, f"{pin}: {own} from all that it showed, which moved by {step} at most"
            most = max(most, own)
    return most


def distance(one, other):
    return max(abs(a - b) for a, b in zip(one, other))


def servo_functions():
    """Returns the functions of the servo thread, in order."""
    lines = map(str.split, halcmd("-s", "show", "thread").splitlines())
    return [words[1] for words in lines if words and words[0].isdigit()]


def watched(machine, out, port, path, lines, seconds, count, rounds):
    """Runs a program while `count` browsers watch, and one that never reads; then kills LinuxCNC."""
    machine.start()
    first = Browser(port)
    at_rest = first.wait(lambda state: state["pose"] is not None, 20, "a pose")
    assert at_rest["pose"] == [hal.get_value(pin) for pin in POSE], at_rest
    joints = [hal.get_value(f"joint.{n}.pos-fb") for n in machine.layout.joints]
    assert distance(at_rest["joints"], joints) < 1e-9, at_rest
    assert at_rest["geometry_hash"] == hal.get_value("pkmkins.geometry-hash") & 0xFFFFFFFF
    assert at_rest["task state"] == "on" and at_rest["fault"] is None, at_rest

    functions, pins = servo_functions(), halcmd("-s", "show", "pin").count("\n")
    others = [Browser(port) for _ in range(count - 1)]
    silent, sampler = deaf(port), Sampler()
    begin = time.monotonic()
    for _ in range(rounds):
        machine.run_program(path, Progress(out / "progress", lines), seconds)
    duration = time.monotonic() - begin
    sampler.stop()
    assert servo_functions() == functions, servo_functions()
    assert halcmd("-s", "show", "pin").count("\n") == pins, "pkm-live has made a pin"
    most = farthest(sampler.samples, [event for event in first.events if event[0] > begin + OLD_SECONDS])
    rates = []
    for browser in [first, *others]:
        numbers = [state["sequence"] for at, state in browser.events if begin <= at <= begin + duration]
        assert numbers == sorted(set(numbers)), "states out of order"
        rates.append(len(numbers) / duration)
    assert min(rates) >= RATE, f"{rates} updates a second"
    assert any(state["line"] and state["file"] == os.path.basename(path) and state["mode"] == "auto"
               for _, state in first.events), first.newest()
    limit = time.monotonic() + 30
    while not is_dropped(silent):
        assert time.monotonic() < limit, "one that never reads is kept"
        time.sleep(1)
    for browser in [first, *others]:
        browser.stop()
    kill("rtapi_app")
    return {"seconds": round(duration, 3), "cycles": round(duration * 1000), "rate": round(min(rates), 1),
            "distance": most}


def kill(name):
    for number in subprocess.run(["pgrep", "-x", name], capture_output=True, text=True).stdout.split():
        os.kill(int(number), signal.SIGKILL)


def watched_again(machine, out, port):
    """Checks that a LinuxCNC that starts after one that was killed is shown."""
    machine.start()
    browser = Browser(port)
    state = browser.wait(lambda state: state["pose"] is not None, 20, "a pose")
    assert state["pose"] == [hal.get_value(pin) for pin in POSE], state
    browser.stop()


def stands(machine, _out, path, place, port, count):
    """Keeps the machine at rest in the middle of its program, alone and watched, until its instructions are counted."""
    place = Path(place)
    machine.start()
    machine.set_mode(linuxcnc.MODE_AUTO)
    machine.command.program_open(path)
    machine.command.auto(linuxcnc.AUTO_RUN, 0)
    machine.pause(3)
    machine.command.auto(linuxcnc.AUTO_PAUSE)
    machine.wait(lambda: machine.get("motion.current-vel") == 0, 5, "standstill")
    machine.pause(1)
    until_counted(place, "alone")
    browsers = [Browser(port) for _ in range(count)]
    for browser in browsers:
        browser.wait(lambda state: state["pose"] is not None, 20, "a pose")
    until_counted(place, "watched")
    seen = [len(browser.events) for browser in browsers]
    for browser in browsers:
        browser.stop()
    machine.command.abort()
    return {"events": seen}


def until_counted(place, what):
    (place / what).touch()
    limit = time.monotonic() + COUNTING_SECONDS
    while not (place / f"{what}-counted").exists():
        assert time.monotonic() < limit, f"{what}: not counted"
        time.sleep(0.05)
