# SPDX-License-Identifier: GPL-2.0-or-later
"""The operator: switches the machine on, homes it, opens the program and runs it.

Runs in milltask's Python interpreter. start.cc calls `step()` regularly between two
cycles of milltask, and at once when there is a message for the operator. It waits by returning.
"""

import ctypes
import os

import linuxcnc

linuxcnc.nmlfile = os.environ["PKMKINS_VIRTUAL_FOLDER"] + "/buffers.nml"
PROGRAM = os.environ["PKMKINS_VIRTUAL_PROGRAM"]
# A block to run first.
BLOCK = os.environ["PKMKINS_VIRTUAL_BLOCK"]
# Whether lines that begin with / are skipped.
BLOCK_DELETE = os.environ["PKMKINS_VIRTUAL_BLOCK_DELETE"] == "1"
LIBRARY = ctypes.CDLL(None)
LIBRARY.virtual_error.restype = ctypes.c_char_p
COMMAND, STATUS = linuxcnc.command(), linuxcnc.stat()
FINISHED, STOPPED, NOT_JUDGED = range(3)
# Steps before the first command: milltask executes the commands queued by [RS274NGC]RS274NGC_STARTUP_CODE, one in
# each of its cycles, and leaving the estop would clear the rest.
STARTUP = 50
# Steps in which the interpreter only reads and nothing moves or waits: 10 s of the machine's time, in
# which it reads millions of lines.
MOST_READING = 500
# Steps allowed for a command without motion: far more than any of them takes.
PATIENCE = 2000
# Steps in which no joint homes, between two sequences.
BETWEEN = 200


class Operator:
    """The operator's actions, as a generator that continues with every step."""

    def __init__(self):
        self.errors = []

    def reached(self, condition, what):
        for _ in range(PATIENCE):
            if condition():
                return
            yield
        end(NOT_JUDGED, f"LinuxCNC does not get to {what}: {'; '.join(self.errors)}")

    def made_ready(self):
        for _ in range(STARTUP):
            yield
        COMMAND.state(linuxcnc.STATE_ESTOP_RESET)
        yield from self.reached(lambda: STATUS.task_state != linuxcnc.STATE_ESTOP, "the end of the estop")
        COMMAND.state(linuxcnc.STATE_ON)
        yield from self.reached(lambda: STATUS.task_state == linuxcnc.STATE_ON, "machine on")
        COMMAND.mode(linuxcnc.MODE_MANUAL)
        yield from self.reached(lambda: STATUS.task_mode == linuxcnc.MODE_MANUAL, "manual mode")
        yield from self.homed()
        COMMAND.teleop_enable(1)
        yield from self.reached(lambda: STATUS.motion_mode == linuxcnc.TRAJ_MODE_TELEOP, "world mode")
        if BLOCK:
            COMMAND.mode(linuxcnc.MODE_MDI)
            yield from self.reached(lambda: STATUS.task_mode == linuxcnc.MODE_MDI, "MDI")
            COMMAND.mdi(BLOCK)
            yield
            yield from self.reached(self.is_over, f"the end of {BLOCK}")
        COMMAND.mode(linuxcnc.MODE_AUTO)
        yield from self.reached(lambda: STATUS.task_mode == linuxcnc.MODE_AUTO, "automatic mode")

    def homed(self):
        """Homes all joints. Searches take minutes: there is no timeout while a joint homes."""
        COMMAND.home(-1)
        rests = 0
        while not (all(STATUS.homed[:STATUS.joints]) and STATUS.inpos):
            is_homing = any(joint["homing"] for joint in STATUS.joint[:STATUS.joints])
            rests = 0 if is_homing else rests + 1
            if self.errors or rests > BETWEEN:
                end(NOT_JUDGED, f"LinuxCNC does not get to home: {'; '.join(self.errors)}")
            yield

    def script(self):
        yield from self.made_ready()
        if self.errors:
            end(NOT_JUDGED, f"LinuxCNC refuses the machine: {'; '.join(self.errors)}")
        COMMAND.set_block_delete(BLOCK_DELETE)
        yield
        LIBRARY.virtual_record()
        COMMAND.program_open(PROGRAM)
        yield
        COMMAND.auto(linuxcnc.AUTO_RUN, 0)
        yield
        reading = 0
        while not self.is_over():
            reading = reading + 1 if self.only_reads() else 0
            if reading > MOST_READING:
                end(NOT_JUDGED, f"LinuxCNC reads on and on without a move, at line {STATUS.read_line}: is there a "
                    "loop without an end?")
            if STATUS.interp_state == linuxcnc.INTERP_PAUSED:
                # M0, M1, M60: the operator presses the button at once.
                COMMAND.auto(linuxcnc.AUTO_RESUME)
            yield
        end(STOPPED if self.errors else FINISHED, "")

    @staticmethod
    def is_over():
        is_idle = STATUS.interp_state == linuxcnc.INTERP_IDLE and STATUS.state != linuxcnc.RCS_EXEC
        return STATUS.task_state != linuxcnc.STATE_ON or (is_idle and STATUS.inpos)

    @staticmethod
    def only_reads():
        return (STATUS.interp_state == linuxcnc.INTERP_READING and STATUS.exec_state == linuxcnc.EXEC_DONE
                and STATUS.queue == 0 and STATUS.inpos)

    def listen(self):
        while (text := LIBRARY.virtual_error()) is not None:
            self.errors.append(text.decode("utf-8", "replace"))


def end(cause, text):
    LIBRARY.virtual_end(cause, text.encode())


OPERATOR = Operator()
SCRIPT = OPERATOR.script()


def step():
    STATUS.poll()
    OPERATOR.listen()
    next(SCRIPT)
