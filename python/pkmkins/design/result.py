# SPDX-License-Identifier: GPL-2.0-or-later
"""The result of a study: the front as table, CSV and page, and the chosen machine as a configuration."""

import csv
import html
import io
import math
import subprocess
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from ..command import CommandFailed, pkm
from ..kinds import machine_of, words
from .study import OBJECTIVES

# Rows that a terminal shows.
MOST_ROWS = 20


@dataclass(frozen=True)
class Front:
    """Machines that no other one dominates."""

    study: object
    machines: tuple
    """Numbers and objectives of each, best of the first objective first."""
    judged: int
    fitting: int
    killers: tuple
    """Constraints with how many candidates they alone or among others have ruled out, most first."""

    @classmethod
    def of(cls, study, record):
        """Creates the front of all judgements of a record. Their order does not matter."""
        items = record.items()
        fitting = [(values, found.objectives) for values, found in items if found.fits]
        front = _undominated(study, fitting)
        killers = Counter(name for _, found in items for name in found.violations)
        most = tuple(sorted(killers.items(), key=lambda pair: (-pair[1], pair[0])))
        return cls(study, tuple(front), len(items), len(fitting), most)

    def chosen(self):
        """Returns the machine nearest to the best of every objective, each as a fraction of its range on the front."""
        if not self.machines:
            return None
        columns = list(zip(*(_costs(self.study, objectives) for _, objectives in self.machines)))
        spans = [(min(column), max(column) - min(column) or 1.0) for column in columns]

        def far(one):
            costs = _costs(self.study, one[1])
            return (sum(((cost - low) / span) ** 2 for cost, (low, span) in zip(costs, spans)), one[0])

        return min(self.machines, key=far)

    def names(self):
        """Returns the headings of a row."""
        ranges = [one.name if one.place is None else f"{one.name}[{one.place}]" for one in self.study.ranges]
        return [*ranges, *self.study.objectives]

    def units(self):
        """Returns the unit of each heading."""
        length = self.study.fixed.get("unit", "mm")
        lengths = {"volume": f"{length}³", "stiffness": "N/mm", "stroke": f"{length} or °"}
        dimensions = ["°" if "angle" in one.name else length for one in self.study.ranges]
        return [*dimensions, *(lengths.get(name, length) for name in self.study.objectives)]

    def csv(self):
        """Returns the front as CSV, full digits."""
        text = io.StringIO()
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(self.names())
        rows.writerows([repr(x) for x in (*values, *objectives)] for values, objectives in self.machines)
        return text.getvalue()

    def fields(self):
        """Returns the front for programs."""
        rows = [dict(zip(self.names(), (*values, *objectives))) for values, objectives in self.machines]
        chosen = self.chosen()
        return {
            "version": 1,
            "command": "design",
            "study": self.study.name,
            # Poses were sampled, nothing is proved: only `pkm check` proves that a machine fits.
            "fits": None if self.machines else False,
            "judged": self.judged,
            "fitting": self.fitting,
            "constraints": dict(self.killers),
            "front": rows,
            "chosen": dict(zip(self.names(), (*chosen[0], *chosen[1]))) if chosen else None,
        }

    def __str__(self):
        if not self.machines:
            return self.why_nothing()
        lines = [f"{self.study.name}: {self.fitting} of {self.judged} candidates keep their limits at the poses looked at, which proves nothing between them; {len(self.machines)} are on the front"]
        chosen = self.chosen()
        rows = [self.names(), *([f"{x:.6g}" for x in (*a, *b)] for a, b in self.machines)]
        widths = [max(map(len, column)) for column in zip(*rows)]
        marks = ["", *("  <- nearest to the best of all" if one == chosen else "" for one in self.machines)]
        shown = [number for number, mark in enumerate(marks) if number <= MOST_ROWS or mark]
        lines += ["  ".join(x.rjust(w) for x, w in zip(rows[n], widths)) + marks[n] for n in shown]
        if len(shown) < len(rows):
            lines.append(f"and {len(rows) - len(shown)} more: --csv FILE.csv or --page FILE.html has all")
        return "\n".join(lines)

    def why_nothing(self):
        """Returns the constraint that excludes most machines, if none fits."""
        if not self.killers:
            return f"{self.study.name}: nothing was judged"
        summary = ", ".join(f"{name} ({count})" for name, count in self.killers)
        return (
            f"{self.study.name}: none of {self.judged} candidates fits. Most are ruled out by: {summary}. "
            f"Ask less of {self.killers[0][0]}, or widen [range]"
        )

    def page(self):
        """Returns the front as an HTML page."""
        title = html.escape(self.study.name)
        head = "".join(f"<th>{html.escape(name)}<br><small>{unit}</small></th>" for name, unit in zip(self.names(), self.units()))
        chosen = self.chosen()
        body = "".join(
            f"<tr{' class=chosen' if one == chosen else ''}>" + "".join(f"<td>{x:.6g}</td>" for x in (*one[0], *one[1])) + "</tr>"
            for one in self.machines
        )
        summary = f"{self.fitting} of {self.judged} candidates keep their limits at the poses looked at, which proves nothing between them. Marked: nearest to the best of every objective."
        why = "" if self.machines else f"<p>{html.escape(self.why_nothing())}</p>"
        return (
            f"<!DOCTYPE html><html lang=en><meta charset=utf-8><meta name=viewport content='width=device-width'>"
            f"<title>{title}</title><style>{STYLE}</style><h1>{title}</h1><p>{summary}</p>{why}{_pictures(self)}"
            f"<div class=wide><table><tr>{head}</tr>{body}</table></div></html>\n"
        )


STYLE = (
    "body{font:15px/1.5 sans-serif;margin:2em auto;max-width:70em;padding:0 1em;color:#222}.wide{overflow-x:auto}"
    "table{border-collapse:collapse}td,th{border:1px solid #ccc;padding:.2em .6em;text-align:right}"
    ".chosen{background:#fde9c8}svg{max-width:100%;height:auto;margin:0 1em 1em 0}text{font-size:12px}"
)


def _costs(study, objectives):
    return tuple(x if OBJECTIVES[name] == "smallest" else -x for name, x in zip(study.objectives, objectives))


def _undominated(study, fitting):
    """Returns the machines that no other one dominates; sorting limits comparisons to possibly better machines."""
    ordered = sorted({(_costs(study, objectives), values, objectives) for values, objectives in fitting})
    front = []
    for costs, values, objectives in ordered:
        if not any(all(a <= b for a, b in zip(other, costs)) for other, _, _ in front):
            front.append((costs, values, objectives))
    return [(values, objectives) for _, values, objectives in front]


def _pictures(front):
    """Returns one plot for each pair of neighboring objectives."""
    pairs = zip(range(len(front.study.objectives)), range(1, len(front.study.objectives)))
    return "".join(_picture(front, across, up) for across, up in pairs) if front.machines else ""


def _picture(front, across, up):
    width, height, left, edge = 440, 320, 80, 50
    chosen, names, units = front.chosen(), front.study.objectives, front.units()[-len(front.study.objectives):]

    def scale(k, start, end):
        column = [objectives[k] for _, objectives in front.machines]
        low, span = min(column), (max(column) - min(column)) or 1.0
        return (lambda x: start + (x - low) / span * (end - start)), _round_between(low, low + span)

    x, along = scale(across, left, width - 30)
    y, upward = scale(up, height - edge, 30)
    grid = "".join(
        f'<path d="M{x(value):.1f} 20V{height - edge + 10}" stroke="#ddd"/>'
        f'<text x="{x(value):.1f}" y="{height - edge + 24}" text-anchor="middle">{value:.6g}</text>' for value in along
    ) + "".join(
        f'<path d="M{left - 10} {y(value):.1f}H{width - 20}" stroke="#ddd"/>'
        f'<text x="{left - 16}" y="{y(value) + 4:.1f}" text-anchor="end">{value:.6g}</text>' for value in upward
    )
    dots = "".join(
        f'<circle cx="{x(o[across]):.1f}" cy="{y(o[up]):.1f}" r="{6 if one == chosen else 3}" '
        f'fill="{"#d55e00" if one == chosen else "#0072b2"}"/>'
        for one in front.machines
        for o in [one[1]]
    )

    def title(k):
        return f"{names[k]}, {units[k]} ({OBJECTIVES[names[k]]} is best)"

    return (
        f'<svg width="{width}" height="{height}" viewBox="0 0 {width} {height}" role="img">'
        f"<title>{names[across]} and {names[up]} of the front</title>{grid}{dots}"
        f'<text x="{(left + width) / 2}" y="{height - 6}" text-anchor="middle">{title(across)}</text>'
        f'<text transform="rotate(-90)" x="{-height / 2}" y="14" text-anchor="middle">{title(up)}</text></svg>'
    )


def _round_between(low, high):
    """Returns up to five round numbers between two different ones."""
    exact = (high - low) / 4
    power = 10.0 ** math.floor(math.log10(exact))
    step = next(factor * power for factor in (1, 2, 2.5, 5, 10) if factor * power >= exact)
    return [k * step for k in range(math.ceil(low / step), math.floor(high / step) + 1)]


def write_machine(study, values, folder):
    """Writes the machine as a complete configuration by `pkm new`, which proves it for every pose of the required box.

    The axis limits are the required box about home, if the study has one. Returns the output of pkm check;
    raises CommandFailed if the machine does not fit, which the sampled poses cannot exclude: nothing is written then.
    `folder` must not exist.
    """
    folder = Path(folder)
    options = []
    for name, value in study.dimensions(values).items():
        options += ["--" + name.replace("_", "-"), *words(value)]
    machine = machine_of(study.kind, **study.dimensions(values))
    for letter, limits in _limits(study.required, machine).items():
        options += ["--limits", letter, *words(limits)]
    _run("new", study.kind, "--out", folder, *options)
    return _run("check", folder / f"{folder.name}.ini")


def _limits(required, machine):
    """Returns the limits of the letters of the required box, if it is one; tilting angles are limited by the tilt."""
    sides = zip("XYZ", machine.home, required.box)
    limits = {letter: (home + low, home + high) for letter, home, (low, high) in sides if low < high}
    if limits and required.tilt:
        limits |= {letter: (-required.tilt, required.tilt) for letter in "AB" if letter in machine.coordinates}
    return limits


def _run(*arguments):
    run = subprocess.run([pkm(), *map(str, arguments)], capture_output=True, text=True)
    if run.returncode != 0:
        raise CommandFailed((run.stderr or run.stdout).strip())
    return run.stdout

