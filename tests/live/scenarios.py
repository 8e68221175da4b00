# SPDX-License-Identifier: GPL-2.0-or-later
"""The actions of the live tests on a running machine, and their expected results.

Each function gets the Machine, a folder for its files and its arguments; it returns the content
of result.json and raises Failure or AssertionError if the machine behaves differently.
"""

import math
import os
import re
import statistics
import subprocess
import time

import linuxcnc

import guard
from machine import AXES, Failure, Machine, Progress, halcmd, link
from recorder import Recorder, program_columns
from truth_run import truth  # noqa: F401
from watched import stands, watched, watched_again  # noqa: F401

SERVO_PERIOD_NS = 1_000_000

# mm or degrees: rounding of positions of 1000 mm, with room.
AT_REST = 1e-6
# How much more a pose may change than its joints: badly conditioned legs reach about this.
AMPLIFIED = 20

# Rounding of second differences of positions of 1000 mm, as a fraction of a joint's largest second difference per
# cycle: 0.0005 mm and more.
ROUNDED = 1e-9


def program(machine: Machine, out, path, lines, seconds):
    """Homes the machine and runs a program, recording every servo cycle."""
    return recorded_program(machine, out, path, lines, seconds)[0]


def probing(machine: Machine, out, path, lines, seconds):
    """Runs the calibration program; its log is the result."""
    machine.start()
    machine.run_program(path, Progress(out / "progress", lines), seconds)
    expect_quiet(machine)


def recorded_program(machine, out, path, lines, seconds, more_columns=()):
    """Returns the result, and the recorder with `more_columns` in addition to those of the trace."""
    columns = program_columns(machine.layout)
    recorder = Recorder(machine.component, [*columns, *more_columns], SERVO_PERIOD_NS)
    machine.turn_on()
    recorder.start()
    machine.home()
    machine.component["phase"] = 1
    # The judge reads the drives' zeros here: after 0.2 s one was 3e-6 mm off once.
    machine.pause(1)
    machine.world_mode()
    expect_home(machine)
    machine.component["phase"] = 2
    begin = time.monotonic()
    machine.run_program(path, Progress(out / "progress", lines), seconds)
    duration = time.monotonic() - begin
    recorder.stop()
    recorder.write(out / "trace.csv", len(columns))
    found = {"samples": recorder.samples(), "overruns": recorder.overruns(),
             "seconds": round(duration, 3), **timing(machine), **module_state(machine)}
    expect_quiet(machine)
    if found["samples"] < duration / (SERVO_PERIOD_NS * 1e-9) * 0.9:
        raise Failure(f"only {found['samples']} servo cycles in {duration:.1f} s")
    return found, recorder


def on_drives(machine: Machine, out, path, lines, seconds, counts, outputs):
    """Homes a machine and runs a program: returns the largest following error and the largest fraction of LinuxCNC's
    limit at that speed. With `counts` every encoder must be that far from its value at power-up. The
    `outputs` of a card are true while the machine is on."""
    columns = [(f"{name}{n}", f"joint.{n}.{pin}", "float") for n in machine.layout.joints
               for name, pin in (("error", "f-error"), ("limit", "f-error-lim"))]
    recorder = Recorder(machine.component, columns, SERVO_PERIOD_NS)
    if outputs:
        forget_test_card(machine)
    assert not any(map(machine.get, outputs)), "an output is true with the machine off"
    machine.turn_on()
    assert all(machine.get(pin) and machine.get(pin.replace(".out", ".is_output")) for pin in outputs)
    machine.home()
    machine.world_mode()
    machine.pause(0.5)
    expect_quiet(machine)
    assert_close(machine.commanded_joints(), machine.layout.joint_home, AT_REST, "joints after homing and their HOME")
    if counts is not None:
        stood = [machine.get(f"encoder.{n}.rawcounts") for n in machine.layout.joints]
        assert_close(stood, [counts] * len(stood), 5, "counts at HOME, from an index pulse")
    recorder.start()
    begin = time.monotonic()
    machine.run_program(path, Progress(out / "progress", lines), seconds)
    duration = time.monotonic() - begin
    recorder.stop()
    expect_quiet(machine)
    for way in {pin.split(".gpio.")[0] for pin in outputs}:
        expect_order([f"{way}.read", "motion-command-handler", "motion-controller", f"{way}.write"])
        assert machine.get(f"{way}.read.time") > 0 and machine.get(f"{way}.write.time") > 0, "the card was not read"
        assert not machine.get(f"{way}.io_error")
    errors = [(abs(error), abs(error) / limit) for n in machine.layout.joints
              for error, limit in zip(recorder.column(f"error{n}"), recorder.column(f"limit{n}"))]
    return {"seconds": round(duration, 1), "largest_error": max(error for error, _ in errors),
            "largest_share": max(share for _, share in errors)}


def expect_order(functions):
    """Checks that they run in this order in the servo thread, and the monitor after the motion controller."""
    shown = halcmd("-s", "show", "thread", "servo-thread").split()
    places = [shown.index(name) for name in functions]
    assert places == sorted(places), f"order of the servo thread: {shown}"
    assert shown.index("pkmkins.monitor") > shown.index("motion-controller"), shown


def forget_test_card(machine):
    """Drops hostmot2's messages at the start of its test card, which has no pins to switch."""
    said = re.compile(r"hm2_test: loading HostMot2|hm2/hm2_test\.0: hm2_set_pin_\w+: invalid pin number \d+$")
    machine.wait(machine.error_texts, 5, "the test card")
    machine.pause(0.2)
    machine.messages = [(kind, text) for kind, text in machine.messages if not said.match(text.strip())]


def spindle_and_pump(machine: Machine, out, speed, ramp, ok, pump, forward):
    """Checks that the spindle is up before a move with feed begins; a hot pump stops, holds feed and stays off."""
    def set_pin(pin, value):
        halcmd("setp", pin, str(value))

    set_pin(ok, 1)
    machine.start()
    begin = time.monotonic()
    machine.mdi(f"M3 S{speed}")
    # A mode that is entered again aborts, after which LinuxCNC 2.10 does not wait for the spindle.
    machine.mdi("G1 F6000 X1", enters=False)
    waited = time.monotonic() - begin
    assert waited >= ramp, f"the move began before the spindle was up: {waited:.2f} s"
    assert machine.get("pwmgen.0.value") == speed and machine.get(forward)
    machine.mdi("M8")
    machine.wait(lambda: machine.get(pump), 2, "the pump to run")
    set_pin(ok, 0)
    machine.wait(lambda: not machine.get(pump), 2, "the hot pump to stop")
    machine.wait(lambda: machine.messages, 2, "a message")
    assert machine.get("motion.feed-hold"), "feed is not held"
    set_pin(ok, 1)
    machine.pause(0.3)
    assert not machine.get(pump), "the pump has started by itself"
    machine.mdi("M9")
    machine.wait(lambda: not machine.get("motion.feed-hold"), 2, "feed to be free")
    machine.mdi("M8")
    machine.wait(lambda: machine.get(pump), 2, "the cold pump to run again")
    machine.mdi("M9")
    machine.mdi("M5")
    return {"reported": machine.messages[0][1]}


# Degrees: rounding leaves 1e-14 of a level platform, and at this tilt a tool 100 long moves the joints
# by 2e-6 of a millimeter.
LEVEL = 1e-6

TOOL_COLUMNS = [("busy", "pkmkins.tool-busy", "bit"),
                *((f"request_{l}", f"motion.tooloffset.{l}", "float") for l in "xyz")]


def tool_changes(machine: Machine, out, path, lines, seconds, changes, spindle):
    """Runs a program that changes tools at tilts and continues at once: while the offset in effect is
    not the requested one, only the change moves the machine."""
    found, recorder = recorded_program(machine, out, path, lines, seconds, TOOL_COLUMNS)
    pose = list(zip(*(recorder.column(letter) for letter in AXES)))
    tool = list(zip(*(recorder.column(f"tool_{l}") for l in "xyz")))
    request = list(zip(*(recorder.column(f"request_{l}") for l in "xyz")))
    busy = [False, *recorder.column("busy")]
    # LinuxCNC writes the request after forward and inverse: it takes effect in the next cycle.
    before = [request[0], *request]
    for cycle, (wanted, shown) in enumerate(zip(before, tool)):
        expected = (wanted[0], wanted[1], spindle + wanted[2])
        assert busy[cycle + 1] or shown == expected, f"cycle {cycle}: {shown} holds, not {expected}"
        # The cycle that changes the request is still part of the motion before it.
        assert not busy[cycle] or pose[cycle] == pose[cycle - 1], f"cycle {cycle}: motion in a change"
    requested = [cycle for cycle in range(1, len(request))
                 if request[cycle] != request[cycle - 1]
                and max(abs(angle) for angle in pose[cycle][3:]) > LEVEL]
    # LinuxCNC's task sometimes considers the move back to level complete too early: the last change,
    # meant for the level platform, is then at a tilt as well.
    assert len(requested) in (changes, changes + 1), \
        f"{len(requested)} changes at a tilt, expected {changes}"
    unanswered = [cycle for cycle in requested if not busy[cycle + 1]]
    assert not unanswered, f"in cycles {unanswered} a change at a tilt did not inhibit feed"
    return {**found, "tool_changes": changes, **use_of_limits(machine, recorder, busy)}


def use_of_limits(machine, recorder, busy):
    """Returns the longest tool change, the largest fractions of the joints' limits in tool changes, and the fraction
    of the speed limits that the whole change would need in one cycle."""
    dt = SERVO_PERIOD_NS * 1e-9
    flags = "".join("x" if flag else " " for flag in busy)
    runs = [match.span() for match in re.finditer("x+", flags)]
    speed = acceleration = at_once = 0.0
    for n in machine.layout.joints:
        way = recorder.column(f"j{n}")
        most_speed = machine.get(f"pkmkins.max-velocity.{n}")
        most_acceleration = machine.get(f"pkmkins.max-acceleration.{n}")
        for begin, end in runs:
            part = way[begin - 1:end - 1]  # busy is one cycle longer than way, at its front
            first = [b - a for a, b in zip(part, part[1:])]
            second = [b - a for a, b in zip(first, first[1:])]
            speed = max([speed, *(abs(v) / dt / most_speed for v in first)])
            acceleration = max([acceleration, *(abs(v) / dt ** 2 / most_acceleration for v in second)])
            at_once = max(at_once, abs(part[-1] - part[0]) / dt / most_speed)
    return {"longest_change_s": round(max(end - begin for begin, end in runs) * dt, 3),
            "speed_share": round(speed, 3), "acceleration_share": round(acceleration, 3),
            "speed_share_at_once": round(at_once, 1)}


def module_state(machine):
    return {"fault_count": machine.get("pkmkins.fault-count"),
            "geometry_hash": machine.get("pkmkins.geometry-hash"),
            "max_iterations": machine.get("pkmkins.max-iterations")}


def timing(machine):
    """Returns the longest runs in ns. HAL counts processor clocks; the thread's period gives their length."""
    clocks = []
    for _ in range(200):
        clocks.append(machine.get("motion.servo.last-period"))
        time.sleep(0.001)
    ns = SERVO_PERIOD_NS / statistics.median(clocks)
    return {"servo_tmax_ns": round(machine.get("servo-thread.tmax") * ns),
            "motion_tmax_ns": round(machine.get("motion-controller.tmax") * ns)}


def expect_quiet(machine):
    """Checks that there is no message to the operator and no fault of the module."""
    machine.poll()
    assert not machine.messages, f"messages: {machine.messages}"
    assert machine.get("pkmkins.fault-count") == 0, f"faults: {machine.get('pkmkins.fault-count')}"
    assert machine.get("pkmkins.geometry-ok"), "geometry-ok is false"
    assert not machine.get("pkmkins.geometry-changed"), "geometry-changed is true"


def expect_home(machine):
    """Checks after homing that there are no messages, that the joints are at HOME and the pose that forward found is
    [TRAJ]HOME."""
    machine.pause(0.2)
    expect_quiet(machine)
    # LinuxCNC's joint planner ends a move within a thousandth of the distance that the largest acceleration covers in
    # a cycle squared; a file may give HOME with six decimals.
    allowed = max(AT_REST, 1e-3 * machine.layout.acceleration * (SERVO_PERIOD_NS * 1e-9) ** 2)
    assert_close(machine.commanded_joints(), machine.layout.joint_home, allowed, "joints after homing and their HOME")
    assert_close(machine.pose(), machine.layout.home, AMPLIFIED * allowed, "pose after homing and [TRAJ]HOME")


def moves(machine: Machine, out, blocks):
    """Returns joints and poses after each MDI block, at rest."""
    machine.start()
    settled = []
    for block in blocks:
        machine.mdi(block)
        machine.pause(0.1)
        settled.append({"block": block, "joints": machine.commanded_joints(), "pose": machine.pose()})
    machine.poll()
    # LinuxCNC's sample shows its own text when it starts, at varying times.
    assert not machine.error_texts(), f"messages: {machine.messages}"
    return {"settled": settled}


def switched(machine, to_type_1, to_type_0):
    """Switches the kinematics 0 -> 1 -> 0: the joints stay, the pose comes back, no message."""
    machine.pause(0.3)
    joints, pose = machine.commanded_joints(), machine.pose()
    watch = JointWatch(machine)
    machine.mdi(to_type_1)
    machine.pause(0.5)
    assert machine.get("kinstype.is-1"), "kinstype.is-1 is false after the switch to 1"
    as_pose = machine.pose(machine.layout.letters)
    assert_close(as_pose, joints, 1e-9, "identity kinematics: pose and joints")
    machine.mdi(to_type_0)
    machine.pause(0.5)
    assert machine.get("kinstype.is-0"), "kinstype.is-0 is false after the switch to 0"
    moved = watch.stop()
    assert moved < 1e-9, f"a joint moved by {moved} in the switch"
    assert_close(machine.pose(), pose, 1e-8, "pose before and after the switch")
    machine.poll()
    # LinuxCNC's sample shows its own text when it starts, at varying times.
    shown = [text for _, text in machine.messages if "ini: set offsets" not in text]
    assert not shown, f"messages: {shown}"
    return {"moved": moved, "pose": pose}


def net_switch(machine: Machine, out, start):
    """Switches the kinematics of a shipped configuration, by an analog output as LinuxCNC does it."""
    net_kinematics_type()
    machine.start()
    machine.mdi(start)
    return switched(machine, "M68 E3 Q1", "M68 E3 Q0")


def net_kinematics_type():
    halcmd("net", "live:kinstype", "motion.analog-out-03", "motion.switchkins-type")


def refused_switch(machine: Machine, out, start, code, after):
    """Checks that the identity kinematics are refused with a reason, no joint moves, and the machine continues."""
    net_kinematics_type()
    machine.start()
    machine.mdi(start)
    machine.pause(0.3)
    pose = machine.pose()
    watch = JointWatch(machine)
    machine.mdi("M68 E3 Q1")
    machine.pause(0.5)
    assert machine.get("kinstype.is-0") and not machine.get("kinstype.is-1"), "the kinematics changed"
    reason = reason_of(machine, code)
    machine.mdi("M68 E3 Q0")
    machine.pause(0.5)
    moved = watch.stop()
    assert moved < 1e-9, f"a joint moved by {moved}"
    assert_close(machine.pose(), pose, 1e-8, "pose before and after")
    goes_on(machine, after)
    return {"reason": reason}


def reason_of(machine, code):
    """Returns the first message to the operator with this code."""
    return reasons_of(machine, code)[0]


def reasons_of(machine, code):
    """Returns all messages to the operator with this code."""
    return machine.errors_with(f"[code {code}]")


def goes_on(machine, block):
    """Checks that a good move is still made, without a further message."""
    if not machine.is_on():
        machine.turn_on()
    count = len(machine.messages)
    before = machine.pose()
    machine.mdi(block)
    assert machine.pose() != before, f"{block} did not move the machine"
    assert not machine.messages[count:], f"messages after {block}: {machine.messages[count:]}"


def refused_move(machine: Machine, out, block, code, after):
    """Makes a move that the kinematics refuse: the reason is reported, no joint moves, the machine continues."""
    machine.start()
    watch = JointWatch(machine)
    machine.mdi(block)
    machine.pause(0.3)
    moved = watch.stop()
    assert moved < 1e-9, f"a joint moved by {moved}"
    reason = reason_of(machine, code)
    goes_on(machine, after)
    return {"reason": reason}


def refused_program(machine: Machine, out, path, lines, joint, most):
    """Checks that a program with an end beyond the limit of a joint stops before it and names the joint."""
    machine.start()
    watch = JointWatch(machine)
    machine.run_program(path, Progress(out / "progress", lines), 30)
    machine.pause(0.3)
    moved = watch.stop()
    assert moved > 1, f"the good moves before were not made: the farthest joint moved by {moved}"
    furthest = max(watch.way(joint))
    assert furthest <= most, f"joint {joint} went to {furthest}, beyond its limit {most}"
    return {"reason": machine.errors_with(f"joint {joint}")[0]}


def refused_switch_back(machine: Machine, out, block):
    """Moves the joints in identity kinematics to where no pose exists: the switch back is refused and
    moves no joint; from the original position it is made."""
    net_kinematics_type()
    machine.start()
    pose = machine.pose()
    machine.mdi("M68 E3 Q1")
    machine.pause(0.5)
    start = machine.pose(machine.layout.letters)
    watch = JointWatch(machine)
    machine.mdi(block)
    machine.pause(0.3)
    joints = machine.commanded_joints()
    machine.mdi("M68 E3 Q0")
    machine.pause(0.5)
    assert machine.get("kinstype.is-1"), "the switch back was made"
    assert_close(machine.commanded_joints(), joints, 1e-9, "joints before and after the refused switch")
    reason = reason_of(machine, machine.get("pkmkins.fault"))
    if not machine.is_on():
        machine.turn_on()
    machine.mdi("M68 E3 Q1")
    machine.mdi("G1 F3000 " + " ".join(f"{l.upper()}{v:.9f}" for l, v in zip(machine.layout.letters, start)))
    machine.mdi("M68 E3 Q0")
    machine.pause(0.5)
    fastest = watch.fastest()
    assert machine.get("kinstype.is-0"), "the switch back from the first joints was refused"
    assert_close(machine.pose(), pose, 1e-6, "pose before and after")
    for n, speed in enumerate(fastest):
        most = machine.get(f"pkmkins.max-velocity.{n}")
        assert speed <= most * 1.01, f"joint {n} went at {speed}, its limit is {most}"
    return {"reason": reason, "fastest": max(fastest)}


def singular_passed(machine: Machine, out, letter, end, feed, code, is_reported=True):
    """Moves through a singular pose, unguarded: forward never shows the mirror image of the commanded
    pose, the reason is reported if the module has a monitor, and the motion back ends the refusal."""
    machine.start()
    guard_nothing(machine)
    start = machine.pose()
    machine.set_mode(linuxcnc.MODE_MDI)
    machine.command.mdi(f"G1 F{feed} {letter}{end}")
    apart = []

    def look():
        # The commanded pose first: it advances while the other is read.
        commanded = machine.get(f"axis.{letter.lower()}.pos-cmd")
        if not machine.get("pkmkins.fwd-kins-fail"):
            apart.append(abs(machine.get(f"pkmkins.{letter.lower()}") - commanded))
        return machine.get("pkmkins.fault") == code

    machine.wait(look, 60, f"code {code}")
    reason = reason_of(machine, code) if is_reported else ""
    # The lag of the drives, and the delay between reading two pins, are at most a fifth of a second.
    assert max(apart) < feed / 60 * 0.2, f"forward was {max(apart)} from the commanded pose"
    machine.wait(machine.is_idle, 60, "end of the move")
    assert machine.get("pkmkins.fwd-kins-fail"), "forward succeeds beyond the singular pose"
    if not machine.is_on():
        machine.turn_on()
    machine.mdi(f"G1 F{feed} {letter}0")
    assert not machine.get("pkmkins.fwd-kins-fail"), "forward fails after the way back"
    assert_close(machine.pose(), start, AT_REST, "pose after the way back")
    return {"reason": reason, "apart": max(apart)}


def guard_nothing(machine):
    """Switches off the limits that would stop a move through a singular pose."""
    for pin in ("conditioning-limit", "tilt-limit", "rod-clearance",
                *(f"base-cone.{n}" for n in machine.layout.joints)):
        machine.set(f"pkmkins.{pin}", 0)


def go_beyond_singular(machine, block, code, is_reported=True):
    """Moves through a singular pose; returns the message, which a drop-in leaves to its pins."""
    machine.mdi(block)
    assert_doubtful(machine, code, "beyond the singular pose")
    return reason_of(machine, code) if is_reported else ""


def assert_doubtful(machine, code, when):
    """Asserts that forward refuses the pose for 0.2 s, sampled every 10 ms."""
    for _ in range(20):
        machine.pause(0.01)
        assert machine.get("pkmkins.fwd-kins-fail"), f"{when}: the mirror image is reported as the pose"
    assert machine.get("pkmkins.fault") == code, f"{when}: fault is {machine.get('pkmkins.fault')}, not {code}"


def singular_switched(machine: Machine, out, block, code, back):
    """Switches the kinematics to 1 and back to 0 beyond a singular pose, with the machine on: no joint moves,
    the pose stays refused, and commanding the motion back ends it."""
    net_kinematics_type()
    machine.start()
    guard_nothing(machine)
    start = machine.pose()
    reason = go_beyond_singular(machine, block, code)
    watch = JointWatch(machine)
    machine.mdi("M68 E3 Q1")
    machine.pause(0.2)
    machine.mdi("M68 E3 Q0")
    machine.pause(0.2)
    assert_doubtful(machine, code, "after kinematics 0, 1, 0")
    moved = watch.stop()
    assert moved < AT_REST, f"a joint moved by {moved}"
    assert machine.is_on() and machine.get("kinstype.is-0"), "the machine is off, or in kinematics 1"
    machine.mdi(back)
    machine.pause(0.3)
    assert_found(machine, start)
    return {"reason": reason}


def assert_found(machine, pose):
    """Asserts that forward reports a pose, on its pins and in LinuxCNC's status."""
    assert not machine.get("pkmkins.fwd-kins-fail"), f"forward fails: {machine.messages}"
    assert_close([machine.get(f"pkmkins.{letter}") for letter in AXES], pose, AT_REST, "pose on the pins")
    machine.poll()
    assert_close(machine.stat.actual_position[:len(pose)], pose, AT_REST, "pose in LinuxCNC's status")


def singular_homed(machine: Machine, out, block, code, speed, after, is_reported=True):
    """Checks that machine off and on do not end a refusal beyond a singular pose. Jogging the joints to HOME, unhoming
    and homing do: LinuxCNC homes joints with absolute encoders only once."""
    machine.start()
    guard_nothing(machine)
    start = machine.pose()
    reason = go_beyond_singular(machine, block, code, is_reported)
    machine.turn_off()
    assert_doubtful(machine, code, "with the machine off")
    machine.joint_mode()
    machine.turn_on()
    assert_doubtful(machine, code, "with the machine on again")
    jog_home(machine, speed)
    machine.pause(0.3)
    machine.command.unhome(-1)
    machine.wait(lambda: not any(machine.stat.homed), 5, "unhoming")
    machine.home()
    machine.wait(machine.is_world, 5, "world mode after homing")
    machine.pause(0.3)
    assert machine.is_on(), f"the machine is off: {machine.messages}"
    assert_found(machine, start)
    goes_on(machine, after)
    return {"reason": reason}


def jog_home(machine, speed):
    """Jogs all joints to their HOME values at the same time."""
    ends = list(zip(machine.layout.joints, machine.layout.joint_home))
    for n, end in ends:
        machine.command.jog(linuxcnc.JOG_INCREMENT, True, n, speed, end - machine.get(f"joint.{n}.pos-cmd"))
        machine.command.wait_complete()
    machine.wait(lambda: all(abs(machine.get(f"joint.{n}.pos-cmd") - end) < AT_REST for n, end in ends), 60,
                 "joints at HOME")


def sample_switch(machine: Machine, out, start):
    """Does the same in LinuxCNC's sample configuration, by its own M428 and M429."""
    machine.start()
    machine.mdi(start)
    return switched(machine, "M429", "M428")


def escape(machine: Machine, out, joint, distance, speed):
    """Jogs one joint to where no pose exists; then requests world mode."""
    machine.turn_on()
    machine.home()
    machine.joint_mode()
    machine.jog_joint(joint, distance, speed)
    before = machine.commanded_joints()
    assert machine.get("pkmkins.fwd-kins-fail"), "forward still succeeds: nothing to escape from"
    fault = machine.get("pkmkins.fault")
    assert fault < 0, f"fault is {fault} while forward fails"
    watch = JointWatch(machine)
    machine.command.teleop_enable(1)
    machine.pause(1.5)
    moved = watch.stop()
    assert moved < 1e-6, f"a joint moved by {moved} after world mode was asked for"
    assert not machine.is_on() or not machine.is_world(), "the machine is on and in world mode"
    return {"fault": fault, "on": machine.is_on(), "joints": before,
            "reason": reason_of(machine, fault)}


def escape_to_mdi(machine: Machine, out, joint, distance, speed):
    """Does the same with MDI requested: LinuxCNC's planner keeps the pose before the jog, because it refuses NaN."""
    machine.turn_on()
    machine.home()
    machine.joint_mode()
    machine.jog_joint(joint, distance, speed)
    machine.pause(0.2)
    assert machine.get("pkmkins.fwd-kins-fail"), "forward still succeeds: nothing to escape from"
    columns = [(f"j{n}", f"joint.{n}.motor-pos-cmd", "float") for n in machine.layout.joints]
    recorder = Recorder(machine.component, columns, SERVO_PERIOD_NS)
    recorder.start()
    machine.command.mode(linuxcnc.MODE_MDI)
    machine.pause(1)
    recorder.stop()
    ways = [recorder.column(f"j{n}") for n in machine.layout.joints]
    moved = max(max(way) - min(way) for way in ways)
    assert moved < AT_REST, f"a joint was commanded {moved} away: {machine.messages}"
    assert not machine.is_on(), "the machine is on"
    return {"reason": reason_of(machine, machine.get("pkmkins.fault"))}


def jogs(machine: Machine, out, letter, speed, limits, slowest):
    """Jogs to where a joint would leave its range, and back. `limits` of every joint are largest speed and
    range; `slowest` is the fraction of the axis' speed below which the jog must be slowed."""
    done = subprocess.run(["haltcl", "-i", os.environ["INI_FILE_NAME"],
                           "/usr/share/linuxcnc/hallib/pkmkins_jog.tcl"], capture_output=True, text=True, timeout=30)
    assert done.returncode == 0 and not done.stderr, done.stderr
    wired = halcmd("-s", "show", "pin", f"ini.{letter}.max_velocity")
    assert "jog-velocity" in wired, f"the axis does not get the speed: {wired}, {done.stdout}"
    axis = AXES.index(letter)
    columns = [(f"j{n}", f"joint.{n}.pos-cmd", "float") for n in machine.layout.joints]
    columns += [("axis", f"axis.{letter}.pos-cmd", "float"), ("scale", "pkmkins.jog-scale", "float")]
    recorder = Recorder(machine.component, columns, SERVO_PERIOD_NS)
    machine.start()
    begin = machine.get(f"axis.{letter}.pos-cmd")
    recorder.start()
    machine.command.jog(linuxcnc.JOG_CONTINUOUS, False, axis, speed)
    try:
        machine.wait(lambda: any("jog-stop" in text for text in machine.error_texts()), 30, "the end of the jog")
        machine.pause(0.5)
    except Failure:
        recorder.stop()
        recorder.write(out / "jog.csv", len(columns))
        raise
    there = machine.get(f"axis.{letter}.pos-cmd")
    shown = machine.errors_with("pkmkins: ")
    assert machine.is_on() and machine.is_world(), "the machine is off, or not in world mode"
    assert machine.get(f"ini.{letter}.max_velocity") == abs(speed), "the axis' speed was not given back"
    machine.command.jog(linuxcnc.JOG_CONTINUOUS, False, axis, -speed)
    machine.wait(lambda: (machine.get(f"axis.{letter}.pos-cmd") - begin) * speed <= 0, 30, "the way back")
    assert not machine.get("pkmkins.jog-stop"), "the way back is stopped"
    machine.command.jog(linuxcnc.JOG_STOP, False, axis)
    machine.pause(0.5)
    recorder.stop()
    fastest, least = 0.0, math.inf
    for n, (most, low, high) in zip(machine.layout.joints, limits):
        places = recorder.column(f"j{n}")
        fastest = max(fastest, max(abs(b - a) for a, b in zip(places, places[1:])) * 1000 / most)
        least = min(least, min(places) - low, high - max(places))
    assert least >= 0, f"a joint went {-least} beyond its range"
    scales = recorder.column("scale")
    assert min(scales) < slowest, f"the jog was slowed to {min(scales)} only"
    way = recorder.column("axis")
    back = max(abs(b - a) for a, b in zip(way, way[1:])) * 1000
    return {"joints_to": fastest, "room": least, "slowest": min(scales), "there": there, "fastest": back,
            "reported": shown}


def correction(machine: Machine, out, path, lines, seconds, asked):
    """Requests corrections of the joints while a program runs, and records every cycle from before to its end."""
    columns = [*((letter, f"axis.{letter}.pos-cmd", "float") for letter in AXES),
               *((f"j{n}", f"joint.{n}.coarse-pos-cmd", "float") for n in machine.layout.joints),
               *((f"e{n}", f"pkmkins.joint-correction-eff.{n}", "float") for n in machine.layout.joints),
               *((f"d{n}", f"joint.{n}.pos-cmd", "float") for n in machine.layout.joints)]
    recorder = Recorder(machine.component, columns, SERVO_PERIOD_NS)
    machine.start()
    recorder.start()

    # Not before: when LinuxCNC changes its mode it drops the two cycles of its smoothing delay.
    def begun():
        for n, value in enumerate(asked):
            machine.set(f"pkmkins.joint-correction.{n}", value)

    machine.run_program(path, Progress(out / "progress", lines), seconds, begun)
    recorder.stop()
    recorder.write(out / "corrected.csv", len(columns))
    expect_quiet(machine)
    return {"cycles": recorder.samples(), "overruns": recorder.overruns()}


def refused_corrections(machine: Machine, out, joint, good, bad, code):
    """Requests corrections in a move: bad ones are reported, and the good one before stays in effect in every cycle."""
    machine.start()
    asked, effect = f"pkmkins.joint-correction.{joint}", f"pkmkins.joint-correction-eff.{joint}"
    machine.set(asked, good)
    machine.wait(lambda: machine.get(effect) == good, 5, "the good correction")
    columns = [(f"j{n}", f"joint.{n}.coarse-pos-cmd", "float") for n in machine.layout.joints]
    recorder = Recorder(machine.component, [*columns, ("effect", effect, "float")], SERVO_PERIOD_NS)
    recorder.start()
    machine.set_mode(linuxcnc.MODE_MDI)
    machine.command.mdi("G1 F1200 X60")
    machine.wait(lambda: not machine.stat.inpos, 5, "start of the move")
    for value in bad:
        count = machine.get("pkmkins.fault-count")
        machine.set(asked, value)
        machine.wait(lambda before=count: machine.get("pkmkins.fault-count") > before, 1, f"the refusal of {value}")
        assert machine.get("pkmkins.fault") == code and machine.get("pkmkins.fault-leg") == joint
        machine.set(asked, good)
    assert not machine.stat.inpos, "the move was over before the last refusal"
    machine.wait(machine.is_idle, 30, "end of the move")
    recorder.stop()
    assert machine.is_on() and machine.get("axis.x.pos-cmd") == 60
    assert set(recorder.column("effect")) == {good}, "what is in effect has changed"
    share = largest_acceleration_share(machine, recorder)
    assert share <= 1 + ROUNDED, f"a joint needed {share} of its acceleration"
    return {"reason": reason_of(machine, code)}


def inconsistent_joint(machine: Machine, out, joint, distance, speed, code, after):
    """Jogs one leg of a redundant machine off: refused, with the joint named; jogging back ends the refusal."""
    machine.turn_on()
    machine.home()
    machine.joint_mode()
    machine.jog_joint(joint, distance, speed)
    assert machine.get("pkmkins.fwd-kins-fail"), "forward still succeeds"
    shown = machine.get("pkmkins.fault"), machine.get("pkmkins.fault-leg")
    assert shown == (code, joint), f"fault and fault-leg are {shown}, expected {(code, joint)}"
    # At the limit no joint stands out yet: a joint that moves slowly away takes the last pose along.
    named = [text for text in reasons_of(machine, code) if text.startswith("pkmkins: joint ")]
    assert named, f"joint {joint} is not named: {machine.messages}"
    reason, others = named[0], [text for text in named if f"joint {joint}:" not in text]
    assert not others, f"another joint than {joint} is named: {others}"
    machine.jog_joint(joint, -distance, speed)
    assert not machine.get("pkmkins.fwd-kins-fail"), "forward still fails after jogging back"
    machine.world_mode()
    goes_on(machine, after)
    return {"reason": reason}


def way_back(machine: Machine, out, joint, distance, speed):
    """Jogs one joint off; the operator jogs back and continues: world mode, right pose."""
    machine.turn_on()
    machine.home()
    home = machine.pose()
    machine.joint_mode()
    machine.jog_joint(joint, distance, speed)
    machine.jog_joint(joint, -distance, speed)
    assert not machine.get("pkmkins.fwd-kins-fail"), "forward still fails after jogging back"
    machine.world_mode()
    machine.mdi("G1 F3000 X10")
    assert_close(machine.pose()[1:], home[1:], AT_REST, "pose after the way back")
    return {"pose": machine.pose()}


def power_down_at(machine: Machine, out, block):
    """Moves the machine and returns its position."""
    machine.start()
    machine.mdi(block)
    machine.pause(0.3)
    expect_quiet(machine)
    return {"joints": machine.commanded_joints(), "pose": machine.pose()}


def power_up_at(machine: Machine, out, pose, joint, distance, speed, after):
    """Homes the machine where it was switched off, and checks that it knows its pose and that no joint has moved.
    Then jogs a joint, switches the machine off and on, jogs the joint back, and checks the pose again."""
    machine.turn_on()
    watch = JointWatch(machine)
    machine.home()
    machine.wait(machine.is_world, 5, "world mode right after homing")
    machine.pause(0.3)
    moved = watch.stop()
    assert moved < AT_REST, f"a joint moved by {moved}"
    assert_close(machine.pose(), pose, AT_REST, "pose after homing and before the power went")
    assert not machine.get("pkmkins.searching"), "searching is true at rest"
    expect_quiet(machine)
    machine.joint_mode()
    machine.jog_joint(joint, distance, speed)
    machine.pause(0.2)
    machine.turn_off()
    machine.pause(0.1)
    machine.turn_on()
    machine.joint_mode()
    machine.jog_joint(joint, -distance, speed)
    machine.pause(0.2)  # near its end LinuxCNC still considers the jog active
    machine.world_mode()
    assert_close(machine.pose(), pose, AT_REST, "pose after the jog and back")
    expect_quiet(machine)
    goes_on(machine, after)
    return {"moved": moved, "pose": machine.pose()}


def start_outside(machine: Machine, out, joint, distance, speed, code, after):
    """Homes where no box has a pose of the joints: the machine goes off, and does not stay on in world mode. In
    joint mode, chosen while it is off, it stays on; after the joint is jogged into the workspace world mode works."""
    machine.turn_on()
    watch = JointWatch(machine)
    machine.set_mode(linuxcnc.MODE_MANUAL)
    machine.command.home(-1)
    machine.wait(machine.is_homed, 60, "homing")
    machine.wait(lambda: not machine.is_on(), 5, "machine off in world mode")
    reason = reason_of(machine, code)
    assert machine.is_world(), "LinuxCNC is not in world mode after homing"
    machine.command.state(linuxcnc.STATE_ON)
    machine.pause(1)
    assert not machine.is_on(), "the machine stays on in world mode"
    machine.joint_mode()
    machine.turn_on()
    machine.pause(1)
    assert machine.is_on(), "the machine goes off in joint mode"
    moved = watch.stop()
    assert moved < AT_REST, f"a joint moved by {moved}"
    assert machine.get("pkmkins.fault") == code and machine.get("pkmkins.fwd-kins-fail")
    machine.jog_joint(joint, distance, speed)
    machine.wait(lambda: not machine.get("pkmkins.fwd-kins-fail"), 2, "forward kinematics in the workspace")
    machine.pause(0.2)  # near its end LinuxCNC still considers the jog active
    machine.world_mode()
    machine.pause(0.5)
    assert machine.is_on() and machine.is_world(), "the machine is off, or not in world mode"
    goes_on(machine, after)
    return {"reason": reason, "pose": machine.pose()}


def refused_geometry(machine: Machine, out):
    """Sets a new geometry on the pins while the machine is on: shown, refused, no joint moves."""
    machine.start()
    machine.mdi("G1 F3000 X10 Y5 Z260 A5 B-5")
    old_hash = machine.get("pkmkins.geometry-hash")
    old = machine.get("pkmkins.base.2.x")
    watch = JointWatch(machine)
    for value, what in ((old + 5, "good"), ("nan", "bad")):
        machine.set("pkmkins.base.2.x", value)
        machine.pause(0.2)
        assert machine.get("pkmkins.geometry-changed"), f"{what} geometry: geometry-changed is false"
        count = machine.get("pkmkins.fault-count")
        machine.set("pkmkins.apply", 0)
        machine.pause(0.05)
        machine.set("pkmkins.apply", 1)
        machine.pause(0.2)
        assert machine.get("pkmkins.fault-count") > count, f"{what} geometry: apply was not refused"
        assert machine.get("pkmkins.geometry-hash") == old_hash, f"{what} geometry: was taken"
        assert machine.is_on(), f"{what} geometry: the machine went off"
    moved = watch.stop()
    assert moved < 1e-9, f"a joint moved by {moved}"
    texts = machine.errors_with("pkmkins")
    machine.set("pkmkins.base.2.x", repr(old))
    machine.pause(0.1)
    assert not machine.get("pkmkins.geometry-changed"), "geometry-changed after restoring the pin"
    return {"moved": moved, "messages_seen": texts}


def refused_geometry_in_a_move(machine: Machine, out):
    """Does the same while the machine moves: the motion continues unaffected, no joint jumps."""
    machine.start()
    machine.mdi("G1 F3000 X-60 Y5 Z260 A5 B-5")
    old = machine.get("pkmkins.base.2.x")
    columns = [(f"j{n}", f"joint.{n}.coarse-pos-cmd", "float") for n in machine.layout.joints]
    recorder = Recorder(machine.component, columns, SERVO_PERIOD_NS)
    recorder.start()
    machine.command.mdi("G1 F1200 X60")
    machine.wait(lambda: not machine.stat.inpos, 5, "start of the move")
    for value in (repr(old + 5), "nan", repr(old)):
        count = machine.get("pkmkins.fault-count")
        apply(machine, "pkmkins.base.2.x", value)
        assert machine.get("pkmkins.fault-count") > count, f"apply of {value} in a move was not refused"
    assert not machine.stat.inpos, "the move was over before the last apply"
    machine.wait(machine.is_idle, 30, "end of the move")
    recorder.stop()
    assert_close(machine.pose(), [60, 5, 260, 5, -5, 0], AT_REST, "end of the move")
    share = largest_acceleration_share(machine, recorder)
    assert share <= 1 + ROUNDED, f"a joint needed {share} of its acceleration"
    return {"acceleration_share": round(share, 3)}


def largest_acceleration_share(machine, recorder):
    """Returns the largest acceleration of all joints and cycles, as a fraction of the joint's limit."""
    largest = 0.0
    for n in machine.layout.joints:
        way = recorder.column(f"j{n}")
        most = machine.get(f"pkmkins.max-acceleration.{n}") * (SERVO_PERIOD_NS * 1e-9) ** 2
        largest = max([largest, *(abs(a - 2 * b + c) / most for a, b, c in zip(way, way[1:], way[2:]))])
    return largest


def feedback_jump(machine: Machine, out, joint, jump, after):
    """Makes the encoder of one joint jump in a move: the machine goes off, no drive runs away; with the
    encoder correct again it continues from its position."""
    machine.start()
    machine.command.mode(linuxcnc.MODE_MDI)
    machine.command.wait_complete()
    machine.command.mdi("G1 F600 X30")
    machine.wait(lambda: not machine.stat.inpos, 5, "start of the move")
    pin = f"joint.{joint}.motor-pos-fb"
    signal = f"J{joint}:motor-pos-fb"
    watch = JointWatch(machine)
    halcmd("unlinkp", pin)
    machine.set(pin, machine.get(pin) + jump)
    machine.wait(lambda: not machine.is_on(), 5, "machine off")
    machine.pause(0.5)
    moved = max(max(way) - min(way) for way in (watch.way(n) for n in watch.joints if n != joint))
    watch.recorder.stop()
    # At this feed a strut moves 10 mm/s at most, and a drive brakes within a millimeter.
    assert moved < 10, f"a drive ran {moved} on after the jump of joint {joint}"
    texts = machine.errors_with("following error")
    halcmd("net", signal, pin)
    machine.pause(0.2)
    machine.turn_on()
    machine.world_mode()
    assert not machine.get("pkmkins.fwd-kins-fail"), "forward still fails with the encoder right again"
    goes_on(machine, after)
    return {"moved": moved, "messages_seen": texts}


def feedback_without_a_number(machine: Machine, out, joint, code, after):
    """Makes the encoder of one joint return NaN in a move: LinuxCNC detects no following error. The module reports it
    and holds the feed until the move is aborted, also when the encoder is correct again; then motion continues."""
    machine.start()
    machine.command.mode(linuxcnc.MODE_MDI)
    machine.command.wait_complete()
    # Nine seconds of motion: a busy computer may need two of them until the encoder returns NaN, and a move that has
    # ended by then leaves no feed to hold.
    machine.command.mdi("G1 F200 X30")
    machine.wait(lambda: not machine.stat.inpos, 5, "start of the move")
    pin = f"joint.{joint}.motor-pos-fb"
    signal = f"J{joint}:motor-pos-fb"
    halcmd("unlinkp", pin)
    machine.set(pin, "nan")
    reason = reason_of(machine, code)
    assert machine.get("pkmkins.feed-inhibit"), "feed is not held"
    machine.pause(0.5)
    stood = machine.get("axis.x.pos-cmd")
    assert machine.is_on() and not [text for text in machine.error_texts() if "following error" in text]
    halcmd("net", signal, pin)
    machine.wait(lambda: not machine.get("pkmkins.fwd-kins-fail"), 2, "forward kinematics")
    machine.pause(0.5)
    assert machine.get("axis.x.pos-cmd") == stood < 30, f"the move goes on by itself from {stood}"
    machine.command.abort()
    machine.wait(machine.is_idle, 5, "end of the block")
    machine.wait(lambda: not machine.get("pkmkins.feed-inhibit"), 2, "feed")
    goes_on(machine, after)
    return {"reason": reason, "stood": stood}


def feedback_loses_a_number(machine: Machine, out, block, joint, code, after):
    """Makes the encoder of one joint return NaN for a moment while the machine stands away from home: the module finds
    the pose again without an operator."""
    machine.start()
    machine.mdi(block)
    machine.pause(0.5)
    pose = machine.pose()
    pin = f"joint.{joint}.motor-pos-fb"
    signal = link(pin, "live:feedback")
    halcmd("unlinkp", pin)
    machine.set(pin, "nan")
    machine.wait(lambda: machine.get("pkmkins.fwd-kins-fail"), 2, "the refusal")
    halcmd("net", signal, pin)
    assert machine.get("pkmkins.fault") == code, f"fault is {machine.get('pkmkins.fault')}"
    machine.pause(0.3)
    assert_found(machine, pose)
    assert machine.is_on(), "the machine is off"
    goes_on(machine, after)
    return {"pose": pose}


def contradiction_settles(machine: Machine, out, off, after):
    """Homes one joint slightly off: entering world mode, and leaving and entering it again, keep every
    motor's command within its acceleration, and the joints end consistent."""
    columns = [(f"j{n}", f"joint.{n}.motor-pos-cmd", "float") for n in machine.layout.joints]
    recorder = Recorder(machine.component, columns, SERVO_PERIOD_NS)
    machine.turn_on()
    recorder.start()
    machine.home()
    machine.wait(machine.is_world, 5, "world mode after homing")
    machine.pause(1)
    residual = machine.get("pkmkins.residual")
    machine.joint_mode()
    machine.world_mode()
    machine.pause(0.3)
    recorder.stop()
    ways = [recorder.column(f"j{n}") for n in machine.layout.joints]
    share = largest_acceleration_share(machine, recorder)
    step = max(abs(b - a) for way in ways for a, b in zip(way, way[1:]))
    moved = max(abs(way[-1] - way[0]) for way in ways)
    found = {"acceleration_share": share, "step": step, "moved": moved, "residual": residual}
    assert share <= 1.02, found
    assert off / 10 < moved < off and residual < AT_REST, found
    assert not machine.get("pkmkins.feed-inhibit"), "feed is still held"
    goes_on(machine, after)
    return found


def new_geometry(machine: Machine, out):
    """Offers geometries with the machine off: a good one takes effect and a bad one is refused; the old one stays."""
    machine.start()
    machine.turn_off()
    old_hash = machine.get("pkmkins.geometry-hash")
    old = machine.get("pkmkins.base.2.x")
    apply(machine, "pkmkins.base.2.x", "nan")
    assert machine.get("pkmkins.geometry-hash") == old_hash, "a geometry with NaN was taken"
    machine.errors_with("leg 2")
    apply(machine, "pkmkins.base.2.x", repr(old + 0.25))
    taken = machine.get("pkmkins.geometry-hash")
    assert taken != old_hash, "a good geometry was refused with the machine off"
    assert not machine.get("pkmkins.geometry-changed"), "geometry-changed after apply"
    return {"hashes": [old_hash, taken]}


def apply(machine, pin, value):
    machine.set(pin, value)
    machine.set("pkmkins.apply", 0)
    machine.pause(0.05)
    machine.set("pkmkins.apply", 1)
    machine.pause(0.2)


def no_iterations(machine: Machine, out):
    """Sets limit-iterations 0 in world mode: refused with a reason, no joint moves."""
    machine.start()
    watch = JointWatch(machine)
    machine.set("pkmkins.limit-iterations", 0)
    machine.pause(0.5)
    moved = watch.stop()
    assert machine.get("pkmkins.fault") < 0, "no fault with limit-iterations 0"
    assert moved < 1e-9, f"a joint moved by {moved}"
    return {"moved": moved, "messages_seen": machine.errors_with("iterations"), "on": machine.is_on()}


def tool_pin_nan(machine: Machine, out):
    """Sets NaN as tool offset: the machine stops, no joint moves."""
    machine.start()
    halcmd("unlinkp", "pkmkins.tool-offset")
    watch = JointWatch(machine)
    machine.set("pkmkins.tool-offset", "nan")
    machine.pause(0.5)
    moved = watch.stop()
    assert moved < 1e-9, f"a joint moved by {moved}"
    assert machine.get("pkmkins.fault") < 0, "no fault with a tool offset of NaN"
    return {"moved": moved, "messages_seen": machine.errors_with("pkmkins"), "on": machine.is_on()}


def tool_out_of_reach(machine: Machine, out, tilt, tool, code, after):
    """Requests a tool offset that moves a joint beyond its limits at a tilt: reported, no joint moves; the machine
    goes off, and the offset takes effect without motion."""
    machine.start()
    machine.mdi(tilt)
    machine.pause(0.2)
    watch = JointWatch(machine)
    machine.command.mdi(tool)
    machine.wait(lambda: not machine.is_on(), 5, "machine off")
    machine.pause(0.3)
    moved = watch.stop()
    assert moved < 1e-9, f"a joint moved by {moved}"
    assert not machine.get("pkmkins.tool-busy"), "tool-busy after a refusal"
    reason = reason_of(machine, code)
    machine.turn_on()
    machine.set_mode(linuxcnc.MODE_MDI)
    for block in ("G49", after):
        machine.mdi(block)
    assert abs(machine.get("pkmkins.tool-offset-eff-z")) == 0, "G49 with the machine level is not taken"
    return {"reason": reason}


def uninhibited_feed(machine: Machine, out, tilt, code):
    """Makes LinuxCNC ignore feed-inhibit with M49: the move after a tool change is stopped instead."""
    machine.start()
    machine.mdi(tilt)
    machine.mdi("M49")
    machine.command.mdi("G43 H1")
    machine.command.mdi("G1 F600 X-20")
    machine.wait(lambda: not machine.is_on(), 5, "machine off")
    return {"reason": reason_of(machine, code)}


def off_in_a_tool_change(machine: Machine, out, tilt, tool):
    """Switches off during a change of the offset: it takes effect, and nothing moves when the machine is on."""
    machine.start()
    machine.mdi(tilt)
    machine.set("pkmkins.max-velocity.0", 1)  # so slow that there is time
    machine.command.mdi(tool)
    machine.wait(lambda: machine.get("pkmkins.tool-busy"), 5, "tool-busy")
    machine.pause(0.5)
    assert machine.get("pkmkins.feed-inhibit") and machine.get("motion.feed-inhibit")
    machine.turn_off()
    machine.wait(lambda: not machine.get("pkmkins.tool-busy"), 5, "not busy with the machine off")
    wanted = machine.get("motion.tooloffset.z")
    assert wanted != 0
    machine.wait(lambda: machine.get("pkmkins.tool-offset-eff-z") == wanted, 1, "the offset in effect")
    machine.pause(0.3)
    watch = JointWatch(machine)
    machine.turn_on()
    machine.set_mode(linuxcnc.MODE_MDI)
    machine.pause(0.3)
    moved = watch.stop()
    assert moved < AT_REST, f"a joint moved by {moved}"
    goes_on(machine, "G1 F3000 X0 Y0")
    return {"moved": moved}


def axis_touch_off(machine):
    """Executes AXIS's tool touch-off (commands.touch_off_tool), at position 0: a tool 15 mm longer."""
    machine.set_mode(linuxcnc.MODE_MDI)
    machine.command.mdi("G10 L10 P1 Z[[-15]*1.000000000000]")
    machine.command.wait_complete()
    machine.command.mdi("G43")
    machine.command.wait_complete()
    machine.set_mode(linuxcnc.MODE_MANUAL)
    machine.command.teleop_enable(1)


def halui_command(machine):
    """Executes a command of halui, which returns to manual mode afterwards."""
    machine.set_mode(linuxcnc.MODE_MANUAL)
    machine.set("halui.mdi-command-00", 1)
    machine.pause(0.1)
    machine.set("halui.mdi-command-00", 0)


def interrupted(*actions):
    """Executes G43 in MDI; when the joints move, other actions of LinuxCNC, then manual mode."""
    def run(machine):
        machine.set_mode(linuxcnc.MODE_MDI)
        machine.command.mdi("G43.1 Z65")
        machine.wait(lambda: machine.get("pkmkins.tool-offset-eff-z") != 0, 5, "the tool change to begin")
        machine.pause(0.05)
        for action in actions:
            action(machine)
            machine.pause(0.05)
        if not machine.is_on():
            machine.turn_on()
        machine.command.mode(linuxcnc.MODE_MANUAL)
        machine.command.teleop_enable(1)
        machine.wait(machine.is_world, 5, "world mode")
    return run


def manual_mode(machine):
    machine.command.mode(linuxcnc.MODE_MANUAL)


def changed_in_manual_mode(machine):
    """Changes the tool offset externally in world mode, and enters MDI while the joints move."""
    machine.set_mode(linuxcnc.MODE_MANUAL)
    signal = link("pkmkins.tool-offset", "live:tool-offset")
    halcmd("unlinkp", "pkmkins.tool-offset")
    machine.set("pkmkins.tool-offset", 65)
    machine.wait(lambda: machine.get("pkmkins.tool-offset-eff-z") != 0, 5, "the tool change to begin")
    machine.pause(0.05)
    machine.set_mode(linuxcnc.MODE_MDI)
    machine.wait(lambda: not machine.get("pkmkins.tool-busy"), 60, "end of the tool change")
    machine.command.mdi("G43.1 Z65")
    machine.command.wait_complete()
    machine.pause(0.1)
    halcmd("net", signal, "pkmkins.tool-offset")


INTERRUPTED = {
    "AXIS's touch-off": axis_touch_off,
    "halui": halui_command,
    "manual mode": interrupted(manual_mode),
    "abort, manual mode": interrupted(lambda m: m.command.abort(), manual_mode),
    "joint mode": interrupted(manual_mode, lambda m: m.command.teleop_enable(0)),
    "AUTO": interrupted(lambda m: m.command.mode(linuxcnc.MODE_AUTO)),
    "E-stop": interrupted(lambda m: m.command.state(linuxcnc.STATE_ESTOP)),
    "unhomed": interrupted(manual_mode, lambda m: m.command.teleop_enable(0), lambda m: m.command.unhome(-1),
                           lambda m: m.home()),
    "another request": interrupted(lambda m: m.command.mdi("G43.1 Z20")),
    "MDI from manual mode": changed_in_manual_mode,
}


def tool_change_columns(layout):
    """Returns the columns that `peaks` needs of every servo cycle."""
    return [("phase", "live.phase", "s32"), *((f"p{n}", f"joint.{n}.motor-pos-cmd", "float") for n in layout.joints),
            ("busy", "pkmkins.tool-busy", "bit")]


def interrupted_tool_changes(machine: Machine, out, level, tilt):
    """Executes actions of LinuxCNC during a tool change at a tilt: no joint exceeds its acceleration, the
    machine stays on, and the offset in effect ends equal to the requested one."""
    recorder = Recorder(machine.component, tool_change_columns(machine.layout), SERVO_PERIOD_NS)
    machine.start()
    machine.mdi("T1 M6")
    recorder.start()
    for number, run in enumerate(INTERRUPTED.values(), 1):
        for block in (level, "G49", tilt):
            machine.mdi(block)
        machine.pause(0.2)
        machine.component["phase"] = number
        run(machine)
        machine.pause(0.1)
        machine.wait(lambda: not machine.get("pkmkins.tool-busy"), 60, "end of the tool change")
        machine.pause(0.1)
        machine.component["phase"] = 0
        assert machine.is_on(), f"{list(INTERRUPTED)[number - 1]}: off, {machine.messages}"
        wanted, found = machine.get("motion.tooloffset.z"), machine.get("pkmkins.tool-offset-eff-z")
        assert wanted == found != 0, f"{list(INTERRUPTED)[number - 1]}: {found} in effect, not {wanted}"
        machine.set_mode(linuxcnc.MODE_MDI)
    recorder.stop()
    expect_quiet(machine)
    return {name: peaks(machine, recorder, number) for number, name in enumerate(INTERRUPTED, 1)}


def peaks(machine, recorder, number):
    """Returns a phase's largest fraction of a joint's acceleration limit, and the duration of tool-busy."""
    cycles = [cycle for cycle, phase in enumerate(recorder.column("phase")) if phase == number]
    first, last = cycles[0], cycles[-1]
    largest = 0.0
    for n in machine.layout.joints:
        at = recorder.column(f"p{n}")[first:last + 1]
        limit = machine.get(f"pkmkins.max-acceleration.{n}") * (SERVO_PERIOD_NS * 1e-9) ** 2
        largest = max([largest, *(abs(c - 2 * b + a) / limit for a, b, c in zip(at, at[1:], at[2:]))])
    busy = sum(recorder.column("busy")[first:last + 1]) * SERVO_PERIOD_NS * 1e-9
    return {"acceleration_share": round(largest, 3), "busy_s": round(busy, 3)}


def watched_program(machine, out, start, path, lines, seconds, period_ns):
    """Runs a program from a start and returns the data of the motion guard, cycle by
    cycle."""
    columns = [(f"j{n}", f"joint.{n}.coarse-pos-cmd", "float") for n in machine.layout.joints]
    columns += [(letter, f"axis.{letter}.pos-cmd", "float") for letter in "xyz"]
    columns += [("scale", "pkmkins.feed-scale", "float"), ("soon", "pkmkins.limit-soon", "bit"),
                ("reason", "pkmkins.limit-reason", "s32"), ("clocks", "pkmkins.monitor.time", "s32"),
                ("period", "motion.servo.last-period", "u32")]
    machine.start()
    machine.mdi(start)
    recorder = Recorder(machine.component, columns, period_ns)
    begin = time.monotonic()
    recorder.start()
    machine.run_program(path, Progress(out / "progress", lines), seconds)
    recorder.stop()
    cycles = (time.monotonic() - begin) / (period_ns * 1e-9)
    assert recorder.samples() > 0.9 * cycles, f"{recorder.samples()} cycles where {cycles:.0f} were due"
    recorder.write(out / "guard.csv", len(columns))
    return recorder


def unguarded(machine: Machine, out, start, path, lines):
    """Checks that the program stops with a following error."""
    machine.start()
    machine.mdi(start)
    machine.set_mode(linuxcnc.MODE_AUTO)
    machine.command.program_open(path)
    machine.command.auto(linuxcnc.AUTO_RUN, 0)
    machine.wait(lambda: not machine.is_on(), 30, "machine off by a following error")
    return {"reason": machine.errors_with("following error")[0]}


def guarded(machine: Machine, out, start, path, lines, limits, feed, acceleration,
            period_ns=SERVO_PERIOD_NS):
    """Checks that the program ends, no joint exceeds its limit in any cycle, and little time is lost."""
    recorder = watched_program(machine, out, start, path, lines, 60, period_ns)
    expect_quiet(machine)
    assert machine.stat.adaptive_feed_enabled, "M52 P1 is not in force"
    joints = list(zip(*(recorder.column(f"j{n}") for n in machine.layout.joints)))
    places = list(zip(*(recorder.column(letter) for letter in "xyz")))
    period = period_ns * 1e-9
    shares = [speed / limit for speed, limit in zip(guard.joint_speeds(joints, period), limits)]
    kept = guard.moving(places)
    scales = recorder.column("scale")
    found = {"seconds": (kept[-1] - kept[0]) * period,
             "least": guard.least_seconds(places, joints, limits, feed, acceleration),
             "fastest": max(shares), "slowest_scale": min(scales), "turns": guard.turns(scales),
             "soon": any(recorder.column("soon")),
             "monitor_share": statistics.median(recorder.column("clocks"))
             / statistics.median(recorder.column("period"))}
    assert max(shares) <= 1, f"a joint ran at {max(shares):.4f} of its limit: {found}"
    assert found["soon"], "limit-soon was never on"
    assert min(scales) < 1 and max(scales) == 1, f"the feed was not scaled: {found}"
    return found


def stopped_by_guard(machine: Machine, out, far, code):
    """Checks that the feed is inhibited near a singularity, with a message, and that the machine stops
    instead of creeping. After an abort it moves back normally."""
    machine.start()
    machine.mdi("M52 P1")
    begin = machine.get("pkmkins.conditioning")
    machine.mdi(far)
    limit = (begin + machine.get("pkmkins.conditioning")) / 2
    machine.mdi("G0 X0 Y0 A0 B0 C0")
    machine.set("pkmkins.conditioning-limit", limit)
    machine.command.mdi(far)
    machine.wait(lambda: machine.get("pkmkins.feed-inhibit"), 60, "feed-inhibit")
    machine.wait(lambda: machine.get("motion.current-vel") == 0, 5, "standstill")
    hold, watch = machine.get("pkmkins.conditioning"), JointWatch(machine)
    machine.pause(1)
    moved = watch.stop()
    assert moved < AT_REST, f"a joint crept on by {moved}"
    assert machine.is_on() and machine.get("pkmkins.feed-inhibit") and not machine.is_idle()
    # The feed is stopped if its allowed fraction is the floor, which is the fraction by which the
    # conditioning exceeds its limit there; the guard's assumed feed override multiplies it.
    most = 1 + machine.get("pkmkins.feed-floor") * machine.get("pkmkins.max-override")
    assert limit < hold < limit * most * 1.001, f"stands at {hold}, limit {limit}"
    reasons = reasons_of(machine, code)
    assert len(reasons) == 1, f"reported more than once: {reasons}"
    machine.command.abort()
    machine.wait(lambda: not machine.get("pkmkins.feed-inhibit"), 2, "feed free again")
    goes_on(machine, "G0 C0")
    return {"reason": reasons[0], "hold": hold, "limit": limit}


def weak_drive(machine: Machine, out):
    """Checks that the simulated machine stops with a following error if a drive is slower than its command."""
    machine.start()
    machine.set("J0_drive.maxv", 2)
    machine.set_mode(linuxcnc.MODE_MDI)
    machine.command.mdi("G1 F3000 X60")
    machine.wait(lambda: not machine.is_on(), 10, "machine off by a following error")
    return {"messages_seen": machine.errors_with("following error")}


def assert_close(found, wanted, tolerance, what):
    worst = max(abs(a - b) for a, b in zip(found, wanted, strict=True))
    assert worst <= tolerance, f"{what}: differ by {worst}: {found} and {wanted}"


class JointWatch:
    """Records the drives in every servo cycle and returns the largest distance that one has moved."""

    def __init__(self, machine):
        self.joints = machine.layout.joints
        columns = [(f"m{n}", f"joint.{n}.motor-pos-fb", "float") for n in self.joints]
        self.recorder = Recorder(machine.component, columns, SERVO_PERIOD_NS)
        self.recorder.start()
        machine.pause(0.05)

    def stop(self):
        self.recorder.stop()
        return max(max(way) - min(way) for way in map(self.way, self.joints))

    def fastest(self):
        """Ends the record; returns the largest speed of each drive."""
        self.recorder.stop()
        ways = map(self.way, self.joints)
        return [max(abs(b - a) for a, b in zip(way, way[1:])) * 1e9 / SERVO_PERIOD_NS for way in ways]

    def way(self, joint):
        """Returns the position of one drive in every cycle."""
        return self.recorder.column(f"m{joint}")
