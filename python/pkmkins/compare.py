# SPDX-License-Identifier: GPL-2.0-or-later
"""`pkm compare`: layouts side by side over the same poses about their homes, in one table."""

import argparse
import html
import json
import math
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ._core import VERSION, Machine, MachineError
from .command import CommandFailed, asked, preflight
from .design.candidate import required_poses, size
from .design.study import Required

MM_PER_INCH = 25.4

STYLE = (
    "body{font:15px/1.5 sans-serif;margin:2em auto;max-width:70em;padding:0 1em;color:#222}.wide{overflow-x:auto}"
    "table{border-collapse:collapse}td,th{border:1px solid #ccc;padding:.3em .6em;text-align:left}"
    ".bar{height:.4em;background:#0072b2;border-radius:.2em}"
)

TEXT = """Compare machines over the same poses: workspace, stiffness, errors, speeds, natural frequencies

Judges every machine over a box around its own home, level and tilted. A study file adds stiffness ([legs]
stiffness_n_per_um), errors ([legs] joint_sigma_um) and, if it has masses, the lowest natural frequency at home
(as `pkm dynamics`); a program adds its duration and verdict. All lengths are in mm. A value that cannot be computed for
a machine is "not judged".
"""

EPILOG = """exit status: 0 if the table is complete, 1 if a machine does not reach the poses, 2 if the input is invalid

examples:
  pkm compare hexapod.ini hexaglide.ini --box 60 60 40 --tilt 10
  pkm compare a.ini b.ini --study study.toml --page layouts.html
"""


@dataclass(frozen=True)
class Asked:
    """The parameters of the comparison."""

    box: tuple
    tilt: float
    study: str | None = None
    program: Path | None = None


def compare(files, asked):
    """Returns rows of (quantity, unit, one value for each machine); NaN or text if there is no number."""
    machines = [Machine.from_ini(file) for file in files]
    columns = [dict(_rows(file, machine, asked)) for file, machine in zip(files, machines)]
    names = list(dict.fromkeys(name for column in columns for name in column))
    return [(*name, [column.get(name, "not judged") for column in columns]) for name in names]


def _rows(file, machine, asked):
    mm = MM_PER_INCH if machine.unit == "inch" else 1.0
    box = tuple((-half / mm, half / mm) for half in asked.box)
    poses = required_poses(machine, Required(box=box, tilt=asked.tilt))
    joints = machine.inverse(poses)
    margins = machine.margins(poses)
    shares = np.where(np.isnan(margins.share), -np.inf, margins.share)
    limits = [k for k, name in enumerate(margins.names) if not name.startswith("axis range")]
    nearest = limits[int(shares[:, limits].min(axis=0).argmin())]
    yield ("poses within every limit", ""), f"{np.count_nonzero((shares[:, limits] >= 0).all(axis=1))} of {len(poses)}"
    yield ("nearest limit", ""), margins.names[nearest]
    yield _workspace(machine, mm)
    if not joints.ok.all():
        return
    yield ("size X Y Z", "mm"), " x ".join(f"{side * mm:.0f}" for side in size(machine, poses))
    strokes = joints.values.max(axis=0) - joints.values.min(axis=0)
    yield ("largest travel of a joint", "mm or degrees"), strokes.max() * mm
    yield ("least conditioning", ""), machine.conditioning(poses).values.min()
    rows = np.linalg.norm(machine.jacobian(poses).values[:, :, :3], axis=2)
    yield ("fastest joint by tool speed", "1 or degrees/mm"), rows.max()
    yield from _of_study(file, machine, poses, asked, mm)
    if asked.program:
        yield from _of_program(file, asked.program)


def _workspace(machine, mm):
    """Returns the row of the workspace: its volume, or its area on a planar machine."""
    try:
        found = machine.workspace(bands=24)
    except MachineError as error:
        return ("workspace, level", "dm³"), f"not judged: {error}"
    n = found.dimensions
    return ("workspace, level", {2: "dm²", 3: "dm³"}[n]), found.volume * mm**n / 100**n


def _of_study(file, machine, poses, given, mm):
    if given.study is None:
        return
    study = tomllib.loads(given.study)
    legs = study.get("legs", {})
    if "stiffness_n_per_um" in legs:
        least = machine.stiffness(poses, given.study).translation.values[:, 0].min()
        yield ("least stiffness at the tool", "N/um"), least * 1e-3
    sigma = legs.get("joint_sigma_um")
    if isinstance(sigma, (int, float)):
        gain = machine.sensitivity(poses).gain.values[:, :3, :]
        yield ("largest deviation at the tool", "um"), np.sqrt((gain**2).sum(axis=(1, 2))).max() * sigma
    if "platform" in study:
        yield ("lowest natural frequency at home", "Hz"), _frequency(file, given.study)


def _frequency(file, study):
    import tempfile

    with tempfile.NamedTemporaryFile("w", suffix=".toml") as kept:
        kept.write(study)
        kept.flush()
        try:
            modes = asked("dynamics", file, "--study", kept.name)["modes"]
        except CommandFailed as error:
            return f"not judged: {error}"
    return min(mode["hz"] for mode in modes)


def _of_program(file, program):
    try:
        found = preflight(file, program)
    except CommandFailed as error:
        yield ("program", ""), f"not judged: {error}"
        return
    yield ("program", ""), {True: "fits", False: "does not fit", None: "not judged"}[found["fits"]]


def table(files, rows):
    """Returns the rows as text."""
    cells = [["", "", *(Path(file).stem for file in files)]]
    cells += [[name, unit, *map(shown, values)] for name, unit, values in rows]
    widths = [max(map(len, column)) for column in zip(*cells)]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in cells)


def page(files, rows):
    """Returns the rows as an HTML page. Bars compare the numbers of a row; the longest one is its largest number."""
    head = "".join(f"<th>{html.escape(Path(file).stem)}</th>" for file in files)
    body = "".join(f"<tr><th>{html.escape(name)}</th><td>{html.escape(unit)}</td>{_cells(values)}</tr>" for name, unit, values in rows)
    return (
        f"<!DOCTYPE html><html lang=en><meta charset=utf-8><meta name=viewport content='width=device-width'>"
        f"<title>Machines compared</title><style>{STYLE}</style><h1>Machines compared</h1>"
        f"<p>Each machine is judged over the same poses around its home. Bars compare the numbers of a row.</p>"
        f"<div class=wide><table><tr><th>quantity</th><th>unit</th>{head}</tr>{body}</table></div></html>\n"
    )


def _cells(values):
    largest = max((value for value in values if not isinstance(value, str) and math.isfinite(value)), default=0.0)

    def bar(value):
        if isinstance(value, str) or not value >= 0 or not largest > 0:
            return ""
        return f"<div class=bar style='width:{100 * value / largest:.1f}%'></div>"

    return "".join(f"<td>{html.escape(shown(value))}{bar(value)}</td>" for value in values)


def shown(value):
    """Formats a value for users."""
    if isinstance(value, str):
        return value
    return "not judged" if math.isnan(value) else f"{value:.5g}"


def main(arguments=None):
    """Runs the command; returns its exit status."""
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser("pkm compare", description=TEXT, epilog=EPILOG, formatter_class=form)
    parser.add_argument("machines", metavar="MACHINE.ini", nargs="+", type=Path)
    parser.add_argument("--box", metavar=("X", "Y", "Z"), nargs=3, type=_length, default=(0.0, 0.0, 0.0), help="half sides of the box around home, mm [0 0 0]")
    parser.add_argument("--tilt", metavar="DEGREES", type=_length, default=0.0, help="also tilt by this angle in eight directions [0]")
    parser.add_argument("--study", metavar="STUDY.toml", type=Path, help="file with stiffnesses, errors and masses")
    parser.add_argument("--program", metavar="PROGRAM.ngc", type=Path, help="also run pkm preflight on this program")
    parser.add_argument("--page", metavar="FILE.html", type=Path, help="also write the table as a page")
    parser.add_argument("--format", choices=["text", "json"], default="text")
    parser.add_argument("--quiet", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--version", action="version", version=f"pkmkins {VERSION}")
    given = parser.parse_args(arguments)
    try:
        study = given.study.read_text() if given.study else None
        rows = compare(given.machines, Asked(tuple(given.box), given.tilt, study, given.program))
        if given.page:
            given.page.write_text(page(given.machines, rows))
    except (OSError, ValueError, NotImplementedError, CommandFailed) as error:
        print(f"pkm compare: {error}", file=sys.stderr)
        return 2
    if given.format == "json":
        listed = [{"name": name, "unit": unit, "values": [_number(value) for value in values]} for name, unit, values in rows]
        print(json.dumps({"version": 1, "command": "compare", "machines": [str(file) for file in given.machines], "rows": listed}, indent=2))
    else:
        print(table(given.machines, rows))
    return 1 if any(shown(value).startswith("not judged") for _, _, values in rows for value in values) else 0


def _number(value):
    return value if isinstance(value, str) or math.isfinite(value) else None


def _length(text):
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: expected a number >= 0")
    return value


if __name__ == "__main__":
    sys.exit(main())
