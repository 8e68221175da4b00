# SPDX-License-Identifier: GPL-2.0-or-later
"""Run LinuxCNC's own interpreter over a program and print its moves as CSV.

The interpreter itself does everything that has to do with the language; this
file only receives the canonical calls that LinuxCNC's Python module `gcode`
makes, and writes them down. One request comes as JSON on standard input:

    program         path of the program
    length_units    machine units per millimetre (1 for mm, 1/25.4 for inch)
    init_codes      blocks run before the program (units, offsets, start position)
    parameter_file  scratch copy of the machine's parameter file
    tool_table      the machine's tool table, "" for none
    random_tools    true for a random tool changer
    chord_error     largest distance of an arc from its segments, millimetres

The process must own its HOME: LinuxCNC keeps its tool data in $HOME/.tool.mmap.

Output: one line a move, lengths in millimetres, angles in degrees, rates per
minute, 17 digits. Positions are commanded ones, as motion receives them: they
hold work offset, G92, rotation and tool length. U V W move no leg and are left
out. Behind them stands what the planner makes of a move: path control mode (the
interpreter's 610, 611 or 640) with its two tolerances, number, least radius and
normal (0 to 2 for X to Z) of the arc that it is a piece of (number 0 for none), and
1 where motion has to stand still before it, and the file that its line belongs to, where
that is a subroutine's own. Exit status 1 and a sentence on standard error when the interpreter refuses
the program.
"""

import ctypes
import json
import linecache
import math
import os
import re
import sys

try:
    import gcode
    from rs274.interpret import ArcsToSegmentsMixin, Translated
except ImportError as error:
    raise SystemExit(f"LinuxCNC's interpreter is missing ({error}); install linuxcnc-uspace")

# The module `gcode` hands over lengths in inches, whatever the program says.
MM = 25.4
# Lengths among the nine coordinates X Y Z A B C U V W.
SCALE = (MM, MM, MM, 1.0, 1.0, 1.0, MM, MM, MM)
# Codes in the interpreter's state: G21, M61.
UNITS_MM = 210
SET_TOOL = 61
# Axis square to a plane, by LinuxCNC's numbers of planes.
NORMALS = {1: 2, 2: 0, 3: 1}
# What a state object holds before its settings, and which of them are tolerances; the module does not
# show them otherwise.
OBJECT_HEAD = 16
FILES = "/proc/self/fd"
# The interpreter leaves blending in canned cycles, and tells the module nothing of it.
EXACT_PATH = 610
CYCLE = re.compile(r"[Gg]\s*0*(73|8[1-9])(?![\d.])")
CYCLES = (730, *range(810, 900, 10))
FEED_RATE, TOLERANCE, MERGING = 1, 3, 4


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


class ToolTable:
    """LinuxCNC's tool data, loaded by LinuxCNC's own reader."""

    def __init__(self, path, random_tools):
        library = ctypes.CDLL("libtooldata.so.0")
        self._get = library._Z12tooldata_getP16CANON_TOOL_TABLEi
        self._put = library._Z12tooldata_put16CANON_TOOL_TABLEi
        self._put.argtypes = (Tool, ctypes.c_int)
        library._Z13tooldata_initb(ctypes.c_bool(random_tools))
        library._Z17tool_mmap_creatorPK13EMC_TOOL_STATi(None, ctypes.c_int(random_tools))
        library._Z14tooldata_resetv()
        load = library._Z13tooldata_loadPKcPPc
        if path and load(path.encode(), None) != 0:
            raise SystemExit(f"{path}: LinuxCNC cannot read this tool table")

    def entry(self, index):
        """Tool at this index; index 0 is the spindle."""
        tool = Tool()
        self._get(ctypes.byref(tool), ctypes.c_int(index))
        return tool

    def put_in_spindle(self, index):
        """What the tool changer does: the tool becomes entry 0."""
        self._put(self.entry(index) if index else Tool(toolno=0), 0)


class Canon(Translated, ArcsToSegmentsMixin):
    """Writes every move to `out`."""

    def __init__(self, request, out):
        self.program = request["program"]
        self.parameter_file = request["parameter_file"]
        self.length_units = request["length_units"]
        self.chord_error = request["chord_error"] / MM
        self.tools = ToolTable(request["tool_table"], request["random_tools"])
        self.out = out
        self.lo = (0.0,) * 9
        self.tool = (0.0,) * 9
        self.feed = self.angular_feed = 0.0
        self.rotation_cos, self.rotation_sin = 1.0, 0.0
        self.state = None
        self.refused = ""
        self.arc, self.arcs = (0, 0.0, 2), 0
        self.path = (640, 0.0, 0.0)
        self.stands = True
        self.turning = None
        self.file, self.reading = "", None
        self.others = set(os.listdir(FILES))

    def read_from(self):
        """The file that is read: the interpreter keeps that of the running subroutine open, and the
        module tells its name to nobody."""
        try:
            path = os.readlink(f"{FILES}/{self.reading}")
        except OSError:
            path = self.opened()
        self.file = "" if path == self.program else path

    def opened(self):
        for number in set(os.listdir(FILES)) - self.others:
            path = os.path.join(FILES, number)
            if os.path.isfile(path):
                self.reading = number
                return os.readlink(path)
        return self.program

    def move(self, kind, end):
        """One straight move from the last point to `end` (inches, degrees)."""
        self.lo = tuple(end)
        position = [(p + t) * s for p, t, s in zip(end, self.tool, SCALE)][:6]
        tool = [t * s for t, s in zip(self.tool, SCALE)][:3]
        values = position + [self.feed, self.angular_feed] + tool
        line = self.state.sequence_number if self.state else 0
        self.read_from()
        path = (EXACT_PATH, 0.0, 0.0) if kind != "probe" and self.is_in_cycle(line) else self.path
        values += [*path, *self.arc, int(self.stands)]
        self.stands = False
        file = self.file.replace('"', '""')
        self.out.write(f"{kind},{line}," + ",".join(repr(v) for v in values) + f',"{file}"\n')

    def is_in_cycle(self, line):
        """The state is that before the block, so that a cycle's first block has to be looked at."""
        if line == 0:
            return False
        block = linecache.getline(self.file or self.program, line)
        other = re.search(r"[Gg]\s*0*(?:[0-3]|80)(?![\d.])", block)
        return bool(CYCLE.search(block)) or (self.state.motion_mode in CYCLES and not other)

    def straight_traverse_translated(self, *end):
        self.move("rapid", end)

    def straight_feed_translated(self, *end):
        self.move("feed", end)

    def straight_probe(self, *end):
        self.move("probe", self.rotate_and_translate(*end))

    def rigid_tap(self, x, y, z):
        start = self.lo
        end = self.rotate_and_translate(x, y, z, 0, 0, 0, 0, 0, 0)[:3] + start[3:]
        # The spindle sets the speed, which is not known here: the fastest is assumed.
        self.move("rapid", end)
        self.move("rapid", start)

    def arc_feed(self, x1, y1, cx, cy, rot, z1, a, b, c, u, v, w):
        radius = math.hypot(x1 - cx, y1 - cy)
        step = math.sqrt(8 * self.chord_error / max(radius, self.chord_error))
        self.arcdivision = max(16, math.ceil(math.pi / step))
        self.arcs += 1
        self.arc = (self.arcs, radius * MM, NORMALS.get(self.plane, 2))
        super().arc_feed(x1, y1, cx, cy, rot, z1, a, b, c, u, v, w)
        self.arc = (0, 0.0, 2)

    def straight_arcsegments(self, segments):
        for end in segments:
            self.move("feed", end)

    def set_feed_rate(self, rate):
        # The module divided the F word by 25.4 under G21, for degrees as well.
        # The state is the one before this block, as it is when F is carried out.
        metric = self.state is not None and self.state.gcodes[5] == UNITS_MM
        self.feed = rate * MM
        self.angular_feed = rate * MM if metric else rate

    def tool_offset(self, *offset):
        # The commanded position stays where it is; only its meaning changes.
        self.lo = tuple(p + t - o for p, t, o in zip(self.lo, self.tool, offset))
        self.tool = tuple(offset)
        self.stands = True

    def next_line(self, state):
        if state.toolchange == SET_TOOL:
            # The module tells nobody which tool M61 puts into the spindle, so that a
            # G43 after it would silently take a wrong length.
            line = self.state.sequence_number
            self.refused = f"{self.program}:{line}: M61 cannot be replayed; use T and M6"
            raise ValueError(self.refused)
        self.state = state
        self.path = path_of(state)
        # Motion waits for a spindle that starts or changes its speed.
        turning = (state.spindle, state.speed)
        self.stands |= self.turning not in (None, turning)
        self.turning = turning

    def change_tool(self, index):
        self.stands = True
        self.tools.put_in_spindle(index)

    def get_tool(self, index):
        tool = self.tools.entry(index)
        offset = tuple(getattr(tool.offset, name) for name in "xyzabcuvw")
        return (tool.toolno, *offset, tool.diameter, tool.frontangle, tool.backangle, tool.orientation)

    def get_external_length_units(self):
        return self.length_units

    def get_external_angular_units(self):
        return 1.0

    def get_axis_mask(self):
        return 0x3F

    def get_block_delete(self):
        return 0

    def check_abort(self):
        return False

    def user_defined_function(self, number, p, q):
        """M100 to M199 are the machine's own programs; none of them moves it."""
        self.stands = True

    def dwell(self, seconds):
        self.stands = True

    def message(self, text):
        print(text, file=sys.stderr)

    def comment(self, text):
        pass

    set_traverse_rate = comment


def path_of(state):
    """Path control mode with its tolerance and that of merging, millimetres."""
    settings = (ctypes.c_double * 5).from_address(id(state) + OBJECT_HEAD)
    if settings[FEED_RATE] != state.feed_rate:
        raise ValueError("this version of LinuxCNC keeps its settings elsewhere")
    unit = 1.0 if state.gcodes[5] == UNITS_MM else MM
    return state.path_mode, max(settings[TOLERANCE], 0.0) * unit, max(settings[MERGING], 0.0) * unit


def main():
    request = json.load(sys.stdin)
    out = sys.stdout
    out.write("kind,line,x,y,z,a,b,c,feed,angular_feed,tool_x,tool_y,tool_z,"
              "mode,tolerance,merging,arc,radius,normal,stands,file\n")
    canon = Canon(request, out)
    program = canon.program
    try:
        result, line = gcode.parse(program, canon, request["init_codes"])
    except RuntimeError as error:
        # The module drops the exceptions of its callbacks.
        raise SystemExit(canon.refused or f"{program}: {error}")
    if result > gcode.MIN_ERROR:
        # The module counts a block that it cannot read twice; the last state names it.
        line = max(canon.state.sequence_number, 1) if canon.state else line
        file = canon.file or program
        block = linecache.getline(file, line).strip()
        raise SystemExit(f"{file}:{line}: {gcode.strerror(result)}: {block}")


main()
