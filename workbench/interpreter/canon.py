# SPDX-License-Identifier: GPL-2.0-or-later
"""Run LinuxCNC's own interpreter over a program and write its moves to standard output.

The interpreter itself does everything that has to do with the language; this
file only receives the canonical calls that LinuxCNC's Python module `gcode`
makes, and writes them down. One request comes as JSON on standard input:

    program         path of the program
    length_units    machine units per millimetre (1 for mm, 1/25.4 for inch)
    axes            letters of the machine's axes; words of others are refused
    init_codes      blocks run before the program (units, offsets, start position)
    parameter_file  scratch copy of the machine's parameter file
    tool_table      the machine's tool table, "" for none
    random_tools    true for a random tool changer
    extra           letters of axes that move neither tool nor work in space, or another tool
    calls           true where blocks may call subroutines in files of their own
    spindle         true where the spindle is asked for, which takes half as long again
    chord_error     largest distance of an arc from its segments, millimetres
    most_moves      moves after which a program counts as endless
    most_seconds    seconds without a move after which it does

The process must own its HOME: LinuxCNC keeps its tool data in $HOME/.tool.mmap.

Output: records as they come, a byte of kind first, numbers with the little end first. Lengths in
millimetres, angles in degrees, rates per minute.

    r f p  rapid, feed, probe: line, x y z a b c u v w     uint32, 9 doubles
    F      feed, angular feed of the moves that follow     2 doubles
    X      in the next move an extra axis turns, or moves along with the tool
    T      tool offset x y z u v w from here on            6 doubles
    S      spindle from here on: ? not known, 0 stands,    1 byte, 1 double
           1 turns, 2 at a constant surface speed; its speed
    P      file that lines are in from here on             uint32 length, name
    R      the program is refused: a sentence              uint32 length, text
    E      the end of the program

A feed is infinite where the spindle sets the speed. Positions are commanded ones, as motion
receives them: they hold work offset, G92, rotation and tool length.
"""

import ctypes
import json
import linecache
import math
import os
import re
import struct
import signal
import sys

try:
    import gcode
    from rs274.interpret import ArcsToSegmentsMixin, Translated
except ImportError as error:
    raise SystemExit(f"LinuxCNC's interpreter is missing ({error}); install linuxcnc-uspace") from error

AXES = "XYZABCUVW"
ROTARY = {3, 4, 5}
# The module `gcode` hands over lengths in inches, whatever the program says.
MM = 25.4
# Codes in the interpreter's state: G21, M61, G95, and motion that follows the spindle.
UNITS_MM = 210
SURFACE_SPEED = 960
SET_TOOL = 61
PER_TURN = 950
SYNCHRONISED = (330, 331, 760)
FILES = "/proc/self/fd"
# Blocks that one line may have waiting: a loop has no new line where it moves in a single one.
WAITING = 1000

MOVE = struct.Struct("<BI9d").pack
RAPID, FEED, PROBE = b"rfp"
RATES = struct.Struct("<c2d").pack
TOOL = struct.Struct("<c6d").pack
SPINDLE = struct.Struct("<ccd").pack
TEXT = struct.Struct("<cI").pack


class Pose(ctypes.Structure):
    """EmcPose of emcpos.h."""

    _fields_ = [(name, ctypes.c_double) for name in "xyzabcuvw"]


class Tool(ctypes.Structure):
    """CANON_TOOL_TABLE of emctool.h."""

    _fields_ = [
        ("toolno", ctypes.c_int),
        ("pocketno", ctypes.c_int),
        ("offset", Pose),
        ("diameter", ctypes.c_double),
        ("frontangle", ctypes.c_double),
        ("backangle", ctypes.c_double),
        ("orientation", ctypes.c_int),
    ]


class CommentedTool(Tool):
    """The same of 2.10."""

    _fields_ = [("comment", ctypes.c_char * 40)]


class Refusal(Exception):
    """Why a program cannot be read."""


class ToolTable:
    """LinuxCNC's tool data, loaded by LinuxCNC's own reader."""

    # By their names in C++ (2.9), and in C (2.10).
    FUNCTIONS = {
        "get": ("_Z12tooldata_getP16CANON_TOOL_TABLEi", "tooldata_get"),
        "put": ("_Z12tooldata_put16CANON_TOOL_TABLEi", "tooldata_put"),
        "init": ("_Z13tooldata_initb", "tooldata_init"),
        "create": ("_Z17tool_mmap_creatorPK13EMC_TOOL_STATi", "tool_mmap_creator"),
        "reset": ("_Z14tooldata_resetv", "tooldata_reset"),
        "load": ("_Z13tooldata_loadPKcPPc", "tooldata_load"),
    }

    def __init__(self, path, random_tools):
        try:
            library = ctypes.CDLL("libtooldata.so.0")
        except OSError as error:
            raise Refusal(f"LinuxCNC's tool data cannot be read: {error}") from error
        calls = {name: self.function(library, *names) for name, names in self.FUNCTIONS.items()}
        is_commented = hasattr(library, "tooldata_get")
        self.entry_type = CommentedTool if is_commented else Tool
        self._get, self._put = calls["get"], calls["put"]
        self._put.argtypes = (self.entry_type, ctypes.c_int)
        calls["init"](ctypes.c_bool(random_tools))
        calls["create"](None, ctypes.c_int(random_tools))
        calls["reset"]()
        if path and calls["load"](path.encode(), None) != 0:
            raise Refusal(f"{path}: LinuxCNC cannot read this tool table")

    @staticmethod
    def function(library, *names):
        for name in names:
            if hasattr(library, name):
                return getattr(library, name)
        raise Refusal(f"this version of LinuxCNC has no {names[-1]} in its libtooldata: it is neither 2.9 nor 2.10")

    def entry(self, index):
        """Tool at this index; index 0 is the spindle."""
        tool = self.entry_type()
        self._get(ctypes.byref(tool), ctypes.c_int(index))
        return tool

    def put_in_spindle(self, index):
        """What the tool changer does: the tool becomes entry 0."""
        self._put(self.entry(index) if index else self.entry_type(toolno=0), 0)


class Spindle:
    """What the spindle does, from the interpreter's state: the module `gcode` tells no callback of it."""

    UNKNOWN = b"?", 0.0
    STARTED = 3, 4
    # Places in the interpreter's lists: codes in force, and modal groups of a block.
    SPEED, TURNING, MODE = 2, 2, 13
    TURNING_GROUP, MODE_GROUP = 7, 14

    def __init__(self):
        # It is there once the module runs the interpreter.
        from interpreter import this

        self.this, self.blocks = this, this.blocks
        self.settings, self.m_codes, self.g_codes = this.active_settings, this.active_m_codes, this.active_g_codes
        self.before = None

    def at(self, line):
        """What it does in the moves to come, which belong to `line`: what the blocks before left, and the
        words of the running one, which the interpreter carries out before it moves."""
        this = self.this
        before = self.settings[self.SPEED], self.m_codes[self.TURNING], self.g_codes[self.MODE]
        was, self.before = self.before, before
        if this.cutter_comp_side and line != this.sequence_number:
            # Cutter compensation keeps a move back until the next one is known.
            return self.told(*before) if before == was else self.UNKNOWN
        block = self.blocks[this.remap_level]
        speed, turning, mode = before
        if block.s_flag:
            speed = block.s_number
        if block.m_modes[self.TURNING_GROUP] >= 0:
            turning = block.m_modes[self.TURNING_GROUP]
        if block.g_modes[self.MODE_GROUP] >= 0:
            mode = block.g_modes[self.MODE_GROUP]
        return self.told(speed, turning, mode)

    def told(self, speed, turning, mode):
        if turning not in self.STARTED:
            return b"0", speed
        return b"2" if mode == SURFACE_SPEED else b"1", speed


class Canon(Translated, ArcsToSegmentsMixin):
    """Writes every move to `out`."""

    def __init__(self, request, out):
        self.program = request["program"]
        self.parameter_file = request["parameter_file"]
        self.length_units = request["length_units"]
        self.axis_mask = sum(1 << AXES.index(letter) for letter in request["axes"])
        self.chord_error = request["chord_error"] / MM
        self.tools = ToolTable(request["tool_table"], request["random_tools"])
        self.out = out
        # Records of the running block, whose feed is known for certain after it.
        self.waiting = []
        self.lo = (0.0,) * 9
        self.tool = (0.0,) * 9
        self.feed = self.angular_feed = 0.0
        self.rates = self.unfed = None
        self.asks_spindle = request["spindle"]
        self.extra = {AXES.index(letter) for letter in request["extra"]}
        self.spindle = self.turning = None
        self.rotation_cos, self.rotation_sin = 1.0, 0.0
        self.state = None
        self.line = 0
        self.refused = ""
        self.moves, self.most_moves = 0, request["most_moves"]
        self.idle, self.most_seconds = (0, None), request["most_seconds"]
        self.parent = os.getppid()
        self.asked = self.lo
        self.astray = {}
        self.calls = request["calls"]
        self.file, self.reading, self.identity = "", None, None
        # Without that of the listing itself, whose number comes again.
        self.others = {number for number in os.listdir(FILES) if os.path.exists(f"{FILES}/{number}")}

    def refuse(self, text):
        self.refused = text
        raise Refusal(text)

    def read_from(self):
        """The file that is read: the interpreter keeps that of the running subroutine open, and the
        module tells its name to nobody."""
        try:
            about = os.fstat(self.reading)
        except (OSError, TypeError):
            self.reading = self.opened()
            if self.reading is None:
                return
            about = os.fstat(self.reading)
        if (about.st_dev, about.st_ino) == self.identity:
            return
        self.identity = about.st_dev, about.st_ino
        path = os.readlink(f"{FILES}/{self.reading}")
        file = "" if path == self.program else path
        if file != self.file:
            self.file = file
            name = os.fsencode(file)
            self.waiting.append(TEXT(b"P", len(name)) + name)

    def opened(self):
        for number in set(os.listdir(FILES)) - self.others:
            if os.path.isfile(os.path.join(FILES, number)):
                return int(number)
        return None

    def move(self, kind, end):
        """One straight move from the last point to `end` (inches, degrees)."""
        if self.extra:
            self.see_extra(end)
        self.lo = end
        self.moves += 1
        if self.moves > self.most_moves:
            self.refuse(f"{self.program}:{self.line}: more than {self.most_moves} moves: "
                        "a loop without an end? --most-moves takes more")
        if self.calls:
            self.read_from()
        x, y, z, a, b, c, u, v, w = (place + offset for place, offset in zip(end, self.tool))
        self.waiting.append(MOVE(kind, self.line, x * MM, y * MM, z * MM, a, b, c, u * MM, v * MM, w * MM))
        if len(self.waiting) > WAITING:
            self.write(self.state)

    def see_extra(self, end):
        moved = {axis for axis, (there, here) in enumerate(zip(end, self.lo)) if there != here}
        if moved & ROTARY & self.extra or (moved & self.extra and moved - self.extra):
            self.waiting.append(b"X")

    def write(self, state):
        """Writes what waits; `state` is the one after its block."""
        if not self.waiting:
            return
        rates = self.feed, self.angular_feed
        if state is not None and state.feed_mode == PER_TURN:
            # Where nothing turns, the spindle decides, too.
            rates = tuple(rate * abs(state.speed) or math.inf for rate in rates)
        elif state is not None and state.motion_mode in SYNCHRONISED:
            rates = math.inf, math.inf
        elif self.unfed:
            # The module's interpreter starts with a feed of 1, the machine's with none.
            line, action = self.unfed
            self.refuse(f"{self.file or self.program}:{line}: Cannot {action} with zero feed rate: {self.block(line)}")
        self.unfed = None
        if rates != self.rates:
            self.rates = rates
            self.out.write(RATES(b"F", *rates))
        self.out.write(b"".join(self.waiting))
        self.waiting.clear()

    def straight_traverse(self, *end):
        self.go(RAPID, end)

    def straight_feed(self, *end):
        if not self.feed:
            self.unfed = self.line, "do g1"
        self.go(FEED, end)

    def straight_probe(self, *end):
        if not self.feed:
            self.unfed = self.line, "probe"
        self.go(PROBE, end)

    def see_spindle(self):
        if not self.asks_spindle:
            return
        if self.spindle is None:
            self.spindle = Spindle()
        turning = self.spindle.at(self.line)
        if turning != self.turning:
            self.turning = turning
            self.waiting.append(SPINDLE(b"S", *turning))

    def go(self, kind, end):
        self.see_spindle()
        self.asked = end
        if self.astray:
            end = self.brought_back(end)
        self.move(kind, self.rotate_and_translate(*end))

    def rigid_tap(self, x, y, z):
        self.see_spindle()
        start = self.lo
        end = self.rotate_and_translate(x, y, z, 0, 0, 0, 0, 0, 0)[:3] + start[3:]
        # The spindle sets the speed, which is not known here: the fastest is assumed.
        self.move(RAPID, end)
        self.move(RAPID, start)

    def arc_feed(self, x1, y1, cx, cy, rot, z1, a, b, c, u, v, w):
        if not self.feed:
            self.unfed = self.line, "make arc"
        radius = math.hypot(x1 - cx, y1 - cy)
        self.see_spindle()
        step = math.sqrt(8 * self.chord_error / max(radius, self.chord_error))
        self.arcdivision = max(16, math.ceil(math.pi / step))
        super().arc_feed(x1, y1, cx, cy, rot, z1, a, b, c, u, v, w)
        self.asked = self.named(self.lo)

    def straight_arcsegments(self, segments):
        for end in segments:
            self.move(FEED, tuple(end))

    def set_feed_rate(self, rate):
        self.write(self.state)
        # The module divided the F word by 25.4 under G21, for degrees as well.
        # The state is the one before this block, as it is when F is carried out.
        metric = self.state is not None and self.state.units == UNITS_MM
        self.feed = rate * MM
        self.angular_feed = rate * MM if metric else rate

    def tool_offset(self, *offset):
        # The commanded position stays where it is; only its meaning changes.
        self.lo = tuple(p + t - o for p, t, o in zip(self.lo, self.tool, offset))
        self.tool = offset
        self.waiting.append(TOOL(b"T", *(length * MM for length in offset[:3] + offset[6:])))

    def next_line(self, state):
        self.write(state)
        if state.toolchange == SET_TOOL:
            # The module tells nobody which tool M61 puts into the spindle, so that a
            # G43 after it would silently take a wrong length.
            self.refuse(f"{self.program}:{self.line}: M61 cannot be replayed; use T and M6")
        self.state = state
        # The lathe cycles G70 to G72 number their own blocks by -1: they belong to the block before.
        self.line = max(state.sequence_number, self.line if state.sequence_number < 0 else 0)

    def change_tool(self, index):
        """After a tool change the interpreter asks where the machine is. The module answers with the
        numbers of the last move, also where units or offsets have changed since then; what it is wrong
        by is kept until a block names the axis."""
        self.tools.put_in_spindle(index)
        here = self.named(self.lo)
        self.astray = {axis: [asked * unit - there for unit in (1.0, MM, 1.0 / MM)]
                       for axis, (asked, there) in enumerate(zip(self.asked, here))}

    def brought_back(self, end):
        """The end of a move without what the interpreter is wrong by."""
        here, end = self.named(self.lo), list(end)
        block = re.sub(r"\([^)]*\)|;.*", "", self.block(self.line)).upper()
        for axis, errors in list(self.astray.items()):
            off = end[axis] - here[axis]
            if AXES[axis] not in block and any(abs(off - error) < 1e-9 * (1.0 + abs(error)) for error in errors):
                end[axis] = here[axis]
            else:
                del self.astray[axis]
        return end

    def block(self, line):
        return linecache.getline(self.file or self.program, line).strip()

    def named(self, place):
        """The words that lead to a place: the inverse of `rotate_and_translate`."""
        names = [name.lower() for name in AXES]
        x, y, *others = (p - getattr(self, f"g5x_offset_{name}") for name, p in zip(names, place))
        if self.rotation_xy:
            x, y = (x * self.rotation_cos + y * self.rotation_sin, y * self.rotation_cos - x * self.rotation_sin)
        return tuple(p - getattr(self, f"g92_offset_{name}") for name, p in zip(names, (x, y, *others)))

    def get_tool(self, index):
        tool = self.tools.entry(index)
        offset = tuple(getattr(tool.offset, name) for name in "xyzabcuvw")
        return (tool.toolno, *offset, tool.diameter, tool.frontangle, tool.backangle, tool.orientation)

    def get_external_length_units(self):
        return self.length_units

    def get_external_angular_units(self):
        return 1.0

    def get_axis_mask(self):
        return self.axis_mask

    def get_block_delete(self):
        return 0

    def check_abort(self):
        """Called every other second."""
        if os.getppid() != self.parent:
            return True
        moves, seconds = self.idle
        if moves != self.moves or seconds is None:
            self.idle = self.moves, now()
        elif now() - seconds > self.most_seconds:
            self.refused = (f"{self.program}:{max(self.line, 1)}: no move within {self.most_seconds:g} s after this line: "
                            "a loop without an end? --patience takes more")
            return True
        return False

    def user_defined_function(self, number, p, q):
        """M100 to M199 are the machine's own programs; none of them moves it."""

    def dwell(self, seconds):
        pass

    def message(self, text):
        pass

    comment = set_traverse_rate = set_feed_mode = message


def now():
    return os.times().elapsed


def read(request, out):
    """Runs the interpreter; what it refuses is raised."""
    canon = Canon(request, out)
    program = canon.program
    try:
        result, line = gcode.parse(program, canon, request["init_codes"])
    except (RuntimeError, KeyboardInterrupt) as error:
        # The module drops the exceptions of its callbacks.
        raise Refusal(canon.refused or f"{program}: {error}") from error
    if result > gcode.MIN_ERROR:
        # The module counts a block that it cannot read twice; the last state names it.
        line = max(canon.state.sequence_number, 1) if canon.state else line
        raise Refusal(f"{canon.file or program}:{line}: {gcode.strerror(result)}: {canon.block(line)}")
    canon.write(canon.state)
    out.write(b"E")


# Of prctl(2): what this process gets when its parent is gone.
PARENT_DEATH_SIGNAL = 1


def main():
    ctypes.CDLL(None).prctl(PARENT_DEATH_SIGNAL, signal.SIGKILL)
    request = json.load(sys.stdin)
    # The interpreter prints of its own; only records go where they are read.
    out = os.fdopen(os.dup(1), "wb", 1 << 16)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    try:
        read(request, out)
    except Refusal as refusal:
        text = os.fsencode(str(refusal))
        out.write(TEXT(b"R", len(text)) + text)
    out.flush()


main()
