# SPDX-License-Identifier: GPL-2.0-or-later
"""What the live tests do with a running machine, and what they must see.

Each function gets the Machine, a folder for its files and its arguments; it returns what belongs
into result.json and raises Failure or AssertionError where the machine did not do as it must.
"""

import statistics
import time

import linuxcnc

from machine import Failure, Machine, Progress, halcmd
from recorder import Recorder, program_columns

SERVO_PERIOD_NS = 1_000_000

# mm or degrees: LinuxCNC's joint planner ends a move up to about 1e-7 mm before its end.
AT_REST = 1e-6


def program(machine: Machine, out, path, lines, seconds):
    """Homes the machine and runs a program, recording every servo cycle."""
    recorder = Recorder(machine.component, program_columns(machine.layout), SERVO_PERIOD_NS)
    machine.turn_on()
    recorder.start()
    machine.home()
    machine.component["phase"] = 1
    machine.pause(0.2)
    machine.world_mode()
    machine.component["phase"] = 2
    begin = time.monotonic()
    machine.run_program(path, Progress(out / "progress", lines), seconds)
    duration = time.monotonic() - begin
    recorder.stop()
    recorder.write(out / "trace.csv")
    found = {"samples": recorder.samples(), "overruns": recorder.overruns(),
             "seconds": round(duration, 3), **timing(machine), **module_state(machine)}
    expect_quiet(machine)
    if found["samples"] < duration / (SERVO_PERIOD_NS * 1e-9) * 0.9:
        raise Failure(f"only {found['samples']} servo cycles in {duration:.1f} s")
    return found


def module_state(machine):
    return {"fault_count": machine.get("pkmkins.fault-count"),
            "geometry_hash": machine.get("pkmkins.geometry-hash"),
            "max_iterations": machine.get("pkmkins.max-iterations")}


def timing(machine):
    """Longest runs in ns. HAL counts processor clocks; the thread's period tells their length."""
    clocks = []
    for _ in range(200):
        clocks.append(machine.get("motion.servo.last-period"))
        time.sleep(0.001)
    ns = SERVO_PERIOD_NS / statistics.median(clocks)
    return {"servo_tmax_ns": round(machine.get("servo-thread.tmax") * ns),
            "motion_tmax_ns": round(machine.get("motion-controller.tmax") * ns)}


def expect_quiet(machine):
    """No message to the operator and no fault of the module."""
    machine.poll()
    assert not machine.messages, f"messages: {machine.messages}"
    assert machine.get("pkmkins.fault-count") == 0, f"faults: {machine.get('pkmkins.fault-count')}"
    assert machine.get("pkmkins.geometry-ok"), "geometry-ok is false"
    assert not machine.get("pkmkins.geometry-changed"), "geometry-changed is true"


def quiet_start(machine: Machine, out, home, joint_home):
    """Start, machine on, homing, world mode: nothing to tell the operator, pose and joints at home."""
    machine.start()
    machine.pause(0.5)
    expect_quiet(machine)
    assert_close(machine.pose(), home, AT_REST, "pose after homing and [TRAJ]HOME")
    assert_close(machine.commanded_joints(), joint_home, AT_REST, "joints after homing and their HOME")
    return module_state(machine)


def moves(machine: Machine, out, blocks):
    """Joints and poses after each MDI block, at rest."""
    machine.start()
    settled = []
    for block in blocks:
        machine.mdi(block)
        machine.pause(0.1)
        settled.append({"block": block, "joints": machine.commanded_joints(), "pose": machine.pose()})
    machine.poll()
    assert not machine.messages, f"messages: {machine.messages}"
    return {"settled": settled}


def switched(machine, to_type_1, to_type_0):
    """Kinematics 0 -> 1 -> 0: the joints stay, the pose comes back, no message."""
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
    assert not machine.messages, f"messages: {machine.messages}"
    return {"moved": moved, "pose": pose}


def net_switch(machine: Machine, out, start):
    """Kinematics switch of a shipped configuration, by an analog output as LinuxCNC does it."""
    net_kinematics_type()
    machine.start()
    machine.mdi(start)
    return switched(machine, "M68 E3 Q1", "M68 E3 Q0")


def net_kinematics_type():
    halcmd("net", "live:kinstype", "motion.analog-out-03", "motion.switchkins-type")


def refused_switch(machine: Machine, out, start, code, after):
    """The identity kinematics refused with a reason: no joint moves, the machine goes on."""
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
    """The message that tells the operator this code."""
    texts = [text for text in machine.error_texts() if f"[code {code}]" in text]
    assert texts, f"code {code} is not told to the operator; messages: {machine.messages}"
    return texts[0].strip()


def goes_on(machine, block):
    """A good move is still made, without a further message."""
    if not machine.is_on():
        machine.turn_on()
    told = len(machine.messages)
    before = machine.pose()
    machine.mdi(block)
    assert machine.pose() != before, f"{block} did not move the machine"
    assert not machine.messages[told:], f"messages after {block}: {machine.messages[told:]}"


def refused_move(machine: Machine, out, block, code, after):
    """A move that the kinematics refuse: the reason is told, no joint moves, the machine goes on."""
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
    """A program with an end point beyond the limit of a joint stops before it and names the joint."""
    machine.start()
    watch = JointWatch(machine)
    machine.run_program(path, Progress(out / "progress", lines), 30)
    machine.pause(0.3)
    moved = watch.stop()
    assert moved > 1, f"the good moves before were not made: the farthest joint moved by {moved}"
    furthest = max(watch.way(joint))
    assert furthest <= most, f"joint {joint} went to {furthest}, beyond its limit {most}"
    reasons = [text for text in machine.error_texts() if f"joint {joint}" in text]
    assert reasons, f"no message names joint {joint}; messages: {machine.messages}"
    return {"reason": reasons[0].strip()}


def sample_switch(machine: Machine, out, start):
    """The same in LinuxCNC's sample configuration, by its own M428 and M429."""
    machine.start()
    machine.mdi(start)
    return switched(machine, "M429", "M428")


def escape(machine: Machine, out, joint, distance, speed):
    """One joint is jogged to where no platform closes; then world mode is asked for."""
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


def inconsistent_joint(machine: Machine, out, joint, distance, speed, code, after):
    """More legs than coordinates, one leg off: refused, that leg named; jogging back heals it."""
    machine.turn_on()
    machine.home()
    machine.joint_mode()
    machine.jog_joint(joint, distance, speed)
    assert machine.get("pkmkins.fwd-kins-fail"), "forward still succeeds"
    told = machine.get("pkmkins.fault"), machine.get("pkmkins.fault-leg")
    assert told == (code, joint), f"fault and fault-leg are {told}, expected {(code, joint)}"
    reason = reason_of(machine, code)
    assert f"leg {joint}:" in reason, f"leg {joint} is not named: {reason}"
    machine.jog_joint(joint, -distance, speed)
    assert not machine.get("pkmkins.fwd-kins-fail"), "forward still fails after jogging back"
    machine.world_mode()
    goes_on(machine, after)
    return {"reason": reason}


def way_back(machine: Machine, out, joint, distance, speed):
    """After the same jog the operator jogs back and goes on: world mode, right pose."""
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


def refused_geometry(machine: Machine, out):
    """New geometry on the pins while the machine is on: shown, refused, no joint moves."""
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
    assert machine.error_texts(), "no reason shown to the operator"
    machine.set("pkmkins.base.2.x", repr(old))
    machine.pause(0.1)
    assert not machine.get("pkmkins.geometry-changed"), "geometry-changed after restoring the pin"
    return {"moved": moved, "messages_seen": machine.error_texts()}


def new_geometry(machine: Machine, out):
    """With the machine off a good geometry is taken and a bad one refused; the old stays."""
    machine.start()
    machine.turn_off()
    old_hash = machine.get("pkmkins.geometry-hash")
    old = machine.get("pkmkins.base.2.x")
    apply(machine, "pkmkins.base.2.x", "nan")
    assert machine.get("pkmkins.geometry-hash") == old_hash, "a geometry with NaN was taken"
    assert any("leg 2" in text for text in machine.error_texts()), f"messages: {machine.messages}"
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
    """limit-iterations 0 in world mode: refused with a reason, no joint moves."""
    machine.start()
    watch = JointWatch(machine)
    machine.set("pkmkins.limit-iterations", 0)
    machine.pause(0.5)
    moved = watch.stop()
    assert machine.get("pkmkins.fault") < 0, "no fault with limit-iterations 0"
    assert any("iterations" in text for text in machine.error_texts()), f"messages: {machine.messages}"
    assert moved < 1e-9, f"a joint moved by {moved}"
    return {"moved": moved, "messages_seen": machine.error_texts(), "on": machine.is_on()}


def tool_pin_nan(machine: Machine, out):
    """NaN as tool offset: the machine stops, no joint moves."""
    machine.start()
    halcmd("unlinkp", "pkmkins.tool-offset")
    watch = JointWatch(machine)
    machine.set("pkmkins.tool-offset", "nan")
    machine.pause(0.5)
    moved = watch.stop()
    assert moved < 1e-9, f"a joint moved by {moved}"
    assert machine.get("pkmkins.fault") < 0, "no fault with a tool offset of NaN"
    assert machine.error_texts(), "no reason shown to the operator"
    return {"moved": moved, "messages_seen": machine.error_texts(), "on": machine.is_on()}


def weak_drive(machine: Machine, out):
    """A drive slower than its command: the simulated machine stops with a following error."""
    machine.start()
    machine.set("J0_drive.maxv", 2)
    machine.set_mode(linuxcnc.MODE_MDI)
    machine.command.mdi("G1 F3000 X60")
    machine.wait(lambda: not machine.is_on(), 10, "machine off by a following error")
    assert any("following error" in text for text in machine.error_texts()), machine.messages
    return {"messages_seen": machine.error_texts()}


def assert_close(found, wanted, tolerance, what):
    worst = max(abs(a - b) for a, b in zip(found, wanted, strict=True))
    assert worst <= tolerance, f"{what}: differ by {worst}: {found} and {wanted}"


class JointWatch:
    """Records the drives in every servo cycle and tells the largest way one has gone."""

    def __init__(self, machine):
        self.joints = machine.layout.joints
        columns = [(f"m{n}", f"joint.{n}.motor-pos-fb", "float") for n in self.joints]
        self.recorder = Recorder(machine.component, columns, SERVO_PERIOD_NS)
        self.recorder.start()
        machine.pause(0.05)

    def stop(self):
        self.recorder.stop()
        return max(max(way) - min(way) for way in map(self.way, self.joints))

    def way(self, joint):
        """Position of one drive in every cycle."""
        return self.recorder.column(f"m{joint}")
