# SPDX-License-Identifier: GPL-2.0-or-later
"""Writes build/design-papers.md: results of the shipped studies for the questions of papers 001, 003 and 004.

docs/studies/papers.md compares them with the papers. No times: the results are the same on every computer.
"""

import json
import tempfile
from pathlib import Path

import numpy as np
from figures import ROOT, table, write
from pkmkins import machine_of
from pkmkins.design import Study
from pkmkins.design.engine import Processes
from pkmkins.design.search import design

EXAMPLES = ROOT / "docs/studies/examples"
NOTEBOOK = ROOT / "python" / "notebooks" / "stiffness-and-platform.ipynb"
# Machines of a front that a table shows.
ROWS = 8
# Inclination of the struts of paper 001, degrees: between its printed values.
PAPER_001 = (65.0, 67.0)
# Steps of a level move up and down, mm, and its largest length.
STEP, FAR = 0.5, 700.0
# Tips of paper 004's statement: their distance outside the plane of the platform joints, and its height, mm.
NOSES, HEIGHTS = (0.0, 100.0, 250.0, 400.0), (600.0, 800.0, 1000.0)


def found(name):
    """Returns the front of a shipped study."""
    study = Study.read(EXAMPLES / name)
    with tempfile.TemporaryDirectory() as folder:
        pool = Processes(2)
        front = design(study, Path(folder) / "r.jsonl", engine=pool)
        pool.close()
    return front


def some(front):
    """Returns machines from one end of a front to the other, evenly by their number."""
    last = len(front.machines) - 1
    return [front.machines[k] for k in sorted({round(k * last / (ROWS - 1)) for k in range(ROWS)})]


def machine(front, values):
    return machine_of(front.study.kind, **front.study.dimensions(values))


def inclination(hexapod):
    """Returns the angle of the struts to the base at home, degrees: all six of a symmetric hexapod have the same."""
    return np.degrees(np.arcsin(hexapod.jacobian(hexapod.home).values[0, 2]))


def level_travel(hexapod):
    """Returns the travel of the level platform up and down through home within its limits, mm."""
    def steps(way):
        poses = np.tile(hexapod.home, (int(FAR / STEP), 1))
        poses[:, 2] += way * STEP * np.arange(len(poses))
        margins = hexapod.margins(poses)
        fits = margins.answer.ok & (np.nan_to_num(margins.share, nan=0.0) >= 0).all(axis=1)
        return len(poses) if fits.all() else int(np.argmin(fits)) - 1

    return STEP * (steps(1.0) + steps(-1.0))


def said(front):
    return (
        f"{front.judged} candidates, of which {front.fitting} keep their limits at the poses looked at; {len(front.machines)} are on the front."
    )


def of_001(front):
    """Returns stroke, tilt and inclination."""
    asked = [(values, *objectives, inclination(machine(front, values))) for values, objectives in front.machines]
    largest = max(volume for _, volume, _, _ in asked)

    def row(one):
        values, volume, stroke, angle = one
        travel = level_travel(machine(front, values))
        return [*(f"{x:.4g}" for x in values), f"{volume / largest:.2f}", f"{stroke:.0f}", f"{travel:.0f}", f"{angle:.1f}"]

    shown = [asked[front.machines.index(one)] for one in some(front)]
    like = [one for one in asked if PAPER_001[0] <= one[3] <= PAPER_001[1]]
    nearest = min(asked, key=lambda one: abs(one[3] - sum(PAPER_001) / 2))
    head = ["base radius", "half angle", "platform radius", "half angle", "workspace, share of the largest", "stroke that the tilt takes", "level travel in Z", "struts to the base"]
    values, volume, stroke, angle = nearest
    smallest = front.study.ranges[0].low
    ends = sum(one[0][0] < 1.01 * smallest for one in asked)
    return [
        "## Paper 001: a stroke of 450 mm, a tilt of 40°",
        "",
        f"{said(front)} {ends} have the smallest base radius of the range.",
        "From one end of the front to the other, mm and degrees:",
        "",
        *table(head, [row(one) for one in shown]),
        "",
        f"Struts stand at {min(one[3] for one in asked):.0f}° to {max(one[3] for one in asked):.0f}° to the base on the front, {len(like)} of {len(asked)} machines between 65° and 67°. The one nearest to 66°,",
        f"with {angle:.1f}°, has {volume / largest:.0%} of the largest workspace, needs {stroke:.0f} mm of its stroke for the tilt, and travels {level_travel(machine(front, values)):.0f} mm level.",
    ]


def of_003(front):
    """Returns a lathe on four rods."""
    head = ["between the rails", "platform width", "platform length", "rod", "least stiffness, N/µm"]
    rows = [[*(f"{x:.4g}" for x in values), f"{objectives[0] * 1e-3:.1f}"] for values, objectives in some(front)]
    ruled = ", ".join(f"{name} ({count})" for name, count in front.killers)
    return [
        "## Paper 003: a lathe on four rods",
        "",
        said(front),
        f"Ruled out by: {ruled}. From the stiffest to the smallest, mm:",
        "",
        *table(head, rows),
    ]


def of_004():
    """Returns stiffness over the ratio of radii, by the notebook's own lines."""
    cell = next(cell for cell in json.loads(NOTEBOOK.read_text())["cells"] if cell["cell_type"] == "code")
    lines = {}
    exec("".join(cell["source"]), lines)
    ratios, least = lines["RATIOS"], lines["least"]
    stiffness = {
        (height, nose): np.array([least(ratio, nose, height) for ratio in ratios]).T for height in HEIGHTS for nose in NOSES
    }

    def change(values):
        return values.max() / values.min()

    inside = max(change(tip) for (_, nose), (tip, _) in stiffness.items() if nose == 0)
    outside = [change(tip) for (_, nose), (tip, _) in stiffness.items() if nose > 0]

    def row(height, nose):
        tip, turn = stiffness[height, nose]
        best = ratios[np.argmax(tip)]
        return [f"{height:.0f}", f"{nose:.0f}", f"{tip[0]:.2f}", f"{tip[-1]:.2f}", f"{best:.2f}", f"{change(tip):.2f}", f"{turn[-1] / turn[0]:.1f}"]

    low, high = ratios[0], ratios[-1]
    head = ["height of the platform", "tip outside by", f"least stiffness at {low:.1f}, N/µm", f"at {high:.1f}", "largest at", "largest / smallest", f"against turns, {high:.1f} / {low:.1f}"]
    return [
        "## Paper 004: stiffness and the size of the platform",
        "",
        f"Base radius 400 mm, struts of 10 N/µm, platform radius {low:.1f} to {high:.1f} times that of the base, least stiffness of the tip",
        "at home, mm:",
        "",
        *table(head, [row(height, nose) for height in HEIGHTS for nose in NOSES]),
        "",
        f"The stiffness of a tip in the plane of the platform joints changes by a factor of {inside:.2f} at the most, outside of it by",
        f"{min(outside):.2f} to {max(outside):.2f}.",
    ]


def main():
    lines = [
        "# What the papers ask",
        "",
        *of_001(found("design-paper-001.toml")),
        "",
        *of_003(found("design-lathe.toml")),
        "",
        *of_004(),
    ]
    write("design-papers.md", lines)


if __name__ == "__main__":
    main()
