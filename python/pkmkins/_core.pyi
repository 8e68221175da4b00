# SPDX-License-Identifier: GPL-2.0-or-later
"""The compiled half of pkmkins: shapes, units and errors.

In every method poses are an array (n, 6) of float64, X Y Z in the machine's unit and A B C in degrees
(R = Rz(C) Ry(B) Rx(A)), in any memory order and without a copy, or one pose (6,). `tool` is the tool offset
X Y Z as G43 sets it, without the spindle offset of the INI file. n may be 0.

Arrays of another type of number or shape raise TypeError or ValueError. A row without an answer is NaN,
with a code; a single pose raises Refused. Arrays must not be written to while a call reads them.
"""

from os import PathLike
from typing import Any, Mapping, Sequence, TypedDict

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.float64] | Sequence[float] | Sequence[Sequence[float]]

VERSION: str

class MachineError(ValueError):
    """An INI file, a study or dimensions that describe no machine; the text has locations and remedies."""

class CommandFailed(RuntimeError):
    """A call equivalent to a subcommand of `pkm` ended without an answer (exit status 2); the text gives the reason."""

class Refused(ValueError):
    """A pose or joint values without an answer."""

    code: int
    """Fixed negative code, as on the module's pin `fault`; `pkm help reference/causes` lists all."""
    name: str
    part: int | None
    """Number of the leg or joint, if one can be named."""
    value: float
    """The offending value, in the unit that the text names."""
    remedy: str

class _Cause(TypedDict):
    code: int
    name: str
    text: str
    remedy: str

def cause(code: int) -> _Cause:
    """Describes a code. Raises KeyError for an unknown one; 0 is success."""

def preflight(
    machine: str | PathLike[str], program: str | PathLike[str], mechanism: int | None, trace: str | None, options: str
) -> str:
    """Returns the answer of `pkm preflight` as JSON. `options` is an object of JSON: hal, unconfined, most_moves,
    most_seconds, most_standstill and most_work (--patience).

    LinuxCNC runs in separate processes; other threads of Python run meanwhile. If the handler of a signal raises, as
    that of Ctrl-C does, the run ends within a second or two, its processes and its folder are removed, and the
    exception is raised."""

class Answer:
    """The answer of a batch."""

    values: NDArray[np.float64]
    """One row for each input row; NaN if there is no answer."""
    code: NDArray[np.int32]
    """0 if there is an answer, otherwise the code of the refusal."""
    part: NDArray[np.int32]
    """Number of the leg or joint that a refusal names, -1 if it names none."""
    @property
    def ok(self) -> NDArray[np.bool_]:
        """Returns which rows have an answer."""

class Margins:
    answer: Answer
    """(n, 2, columns): values and shares, with the codes."""
    low: NDArray[np.float64]
    """(columns,): smallest allowed values, -inf if there is none."""
    high: NDArray[np.float64]
    """(columns,): largest allowed values, inf if there is none."""
    names: list[str]
    """The limit and part of each column."""
    @property
    def value(self) -> NDArray[np.float64]:
        """Returns (n, columns): machine units, degrees or no dimension, by column."""
    @property
    def share(self) -> NDArray[np.float64]:
        """Returns (n, columns): room as a fraction of the range, 0 at the limit, negative beyond it, inf without a
        limit."""

class Stiffness:
    compliance: Answer
    """(n, 6, 6): displacement in mm and rotation in rad for force in N and moment in N mm, about the tool tip, machine
    axes; coordinates constrained by guides count as rigid."""
    translation: Answer
    """(n, 3): stiffness along the principal axes of displacements, smallest first, N/mm."""
    rotation: Answer
    """(n, 3): the same for rotations, N mm/rad."""

class Sensitivity:
    gain: Answer
    """(n, 6, joints): change of X Y Z (machine units) and A B C (degrees) per unit of a joint."""
    singular_values: Answer
    """(n, 2): largest and smallest singular value of the inverse Jacobian, angles times the length."""

class Workspace:
    volume: float
    """Within the boundary, machine units cubed; the area, machine units squared, if there are two dimensions."""
    dimensions: int
    """3, or 2 on a planar machine."""
    volume_by_grid: float
    """The same by counting cells of a grid; NaN without a grid."""
    limits: dict[str, float]
    """Share of the directions that each limit ends."""
    vertices: NDArray[np.float64]
    """(n, 3): points of the boundary."""
    triangles: NDArray[np.uint64]
    """(m, 3): numbers of vertices."""
    start: NDArray[np.float64]
    """(3,): the point from which the rays start."""

class Machine:
    """A machine with its limits. It is immutable, and any number of threads may use it.

    `legs` is one dictionary per leg: its kind ("strut", "slider", "crank", "ring"), the keys of [LEG_N] in the INI
    file in small letters (base, platform, rod, guide, side, axis, arm, lead, base_n, ...; pkmkins(9)), and limits =
    (smallest, largest joint value) if there are any::

        Machine([dict(kind="strut", base=(0, 0, 0), platform=(0, 0, 0), limits=(2, 9)), ...], "XYZ", home=(5, 2, 3))

    `coordinates` and `table` are letters as in [KINS]KINEMATICS, `home` is X Y Z of a level pose that the legs reach,
    `unit` "mm" or "inch", `pkm` keys of [PKM] such as {"spindle_offset": -100}.
    """

    def __init__(
        self,
        legs: Sequence[Mapping[str, Any]],
        coordinates: str = "XYZABC",
        *,
        table: str = "",
        home: Sequence[float] | None = None,
        unit: str = "mm",
        pkm: Mapping[str, Any] | None = None,
    ) -> None: ...
    @staticmethod
    def from_ini(path: str | PathLike[str]) -> Machine:
        """Reads an INI file. Raises MachineError with every error and its location, and NotImplementedError for two
        mechanisms, which only `pkm` supports."""
    @staticmethod
    def from_text(text: str, name: str = "machine.ini") -> Machine:
        """Reads the file's text; `name` appears in messages."""
    @staticmethod
    def of_kind(kind: str, given: Mapping[str, Sequence[str]]) -> Machine:
        """Creates a machine from the words of `pkm new`; see `pkmkins.machine_of`."""
    @property
    def text(self) -> str:
        """Returns its INI file."""
    @property
    def joints(self) -> list[str]:
        """Returns the names of the joints, legs then table."""
    @property
    def coordinates(self) -> str:
        """Returns the letters that joints move; the others must be 0, and are refused otherwise."""
    @property
    def dependent(self) -> str:
        """Returns the letters whose values follow from the others by constraints of the platform; in poses they are 0,
        unless a table compensates them."""
    @property
    def home(self) -> NDArray[np.float64]:
        """Returns (6,): the machine's own pose at [TRAJ]HOME."""
    @property
    def unit(self) -> str:
        """Returns the unit of length, mm or inch."""
    @property
    def scale(self) -> float:
        """Returns the largest length of the geometry, to which relative tolerances refer."""
    @property
    def size(self) -> float:
        """Deprecated: returns `scale`. The size of a machine in a design study is the longest side of its `space`."""
    @property
    def radius(self) -> float:
        """Returns the RMS distance of the platform anchors from their center: converts angles to lengths."""
    @property
    def geometry_hash(self) -> int:
        """Returns the same value as the module's pin `geometry-hash`."""
    def inverse(self, poses: Rows, *, tool: Sequence[float] | None = None) -> Answer:
        """Returns joint values (n, joints): lengths in the machine's unit, arms in degrees. Does not check limits."""
    def full_poses(self, poses: Rows, *, tool: Sequence[float] | None = None) -> Answer:
        """Returns the poses of the control point in the base frame (n, 6), with the dependent coordinates and without the
        motion of a table; the same poses without constraints."""
    def own_poses(self, positions: Rows, *, tool: Sequence[float] | None = None) -> Answer:
        """Returns the machine's own poses (n, 6) at positions X Y Z A B C U V W of LinuxCNC (n, 9). They differ if axes
        carry work, tool or legs; all other methods take own poses."""
    def forward(
        self,
        joints: Rows,
        *,
        seed: Rows | None = None,
        follow: bool = False,
        tool: Sequence[float] | None = None,
    ) -> Answer:
        """Returns poses (n, 6) of joint values (n, joints), each the one that the machine reaches if its joints move
        straight from the seed; if that is not certain there is no answer. `seed`: one pose for all rows (default: home),
        or (n, 6), one per row. With `follow` each row starts from the last pose found, on one core. Dependent
        coordinates are 0; `full_poses` adds them."""
    def jacobian(self, poses: Rows, *, tool: Sequence[float] | None = None) -> Answer:
        """Returns (n, joints, 6): derivatives of joint values by X Y Z (machine unit) and A B C (degree); dependent
        coordinates follow the others, and their own columns are 0."""
    def conditioning(self, poses: Rows, *, tool: Sequence[float] | None = None) -> Answer:
        """Returns (n,): smallest singular value of the legs' constraint rows, 0 at a singular pose."""
    def space(self, poses: Rows, *, tool: Sequence[float] | None = None) -> Answer:
        """Returns (n, 2, 3): the least and the largest X Y Z in base of the machine at each pose, machine units. Counts
        the control point, both ends of every leg, the whole travel of carriages and the pivots of arms."""
    def margins(self, poses: Rows, *, tool: Sequence[float] | None = None) -> Margins:
        """Returns the distances from every limit of the machine's file; for joint speeds see `preflight`."""
    def stiffness(self, poses: Rows, study: str, *, tool: Sequence[float] | None = None) -> Stiffness:
        """Returns the stiffness at the tool tip; `study` is the text of a study file, as for `pkm stiffness`."""
    def sensitivity(
        self, poses: Rows, *, length: float | None = None, tool: Sequence[float] | None = None
    ) -> Sensitivity:
        """Returns errors of poses by errors of joints; `length` converts angles to lengths (default: `radius`)."""
    def workspace(
        self,
        *,
        orientations: Sequence[tuple[float, float, float]] | None = None,
        tilt: float | None = None,
        start: Sequence[float] | None = None,
        study: str | None = None,
        bands: int = 60,
        grid: int = 0,
        tool: Sequence[float] | None = None,
    ) -> Workspace:
        """Returns the reach of the tool, along rays from home or `start`, as `pkm workspace`: level, in each of several
        orientations A B C, or at `tilt` degrees in twelve directions. `bands` rays from pole to pole (4 to 2000), `grid`
        cells along the longest side (0: none). MachineError if the start is not inside."""
