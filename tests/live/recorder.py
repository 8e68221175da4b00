# SPDX-License-Identifier: GPL-2.0-or-later
"""Samples HAL pins in every servo cycle and writes them as a CSV trace at full precision."""

import threading
import time

import hal

from machine import AXES, Failure, halcmd, link

DEPTH = 20000  # largest delay of the reader in cycles: 20 s
PIN_TYPE = {"float": "f", "s32": "s", "u32": "u", "bit": "b"}


def program_columns(layout):
    """Returns the columns of the trace with their pins and HAL types; README.md describes them."""
    columns = [("phase", "live.phase", "s32")]
    columns += [(letter, f"axis.{letter}.pos-cmd", "float") for letter in AXES]
    columns += [(f"j{n}", f"joint.{n}.coarse-pos-cmd", "float") for n in layout.joints]
    columns += [(f"m{n}", f"joint.{n}.motor-pos-fb", "float") for n in layout.joints]
    columns += [(f"f{letter}", f"pkmkins.{letter}", "float") for letter in AXES]
    columns += [(f"corr{n}", f"pkmkins.correction.{n}", "float") for n in layout.struts]
    columns += [(f"tool_{l}", f"pkmkins.tool-offset-eff-{l}", "float") for l in "xyz"]
    columns += [("iterations", "pkmkins.last-iterations", "u32"),
                ("residual", "pkmkins.residual", "float")]
    return columns


class Recorder:
    """FIFOs of at most 20 pins each, all filled in the same servo cycle."""

    FIFO_PINS = 20

    def __init__(self, component, columns, period_ns):
        self.columns = columns
        self.period = period_ns * 1e-9
        self.groups = [columns[n:n + self.FIFO_PINS] for n in range(0, len(columns), self.FIFO_PINS)]
        self.rows = [[] for _ in self.groups]
        self.numbers = [[] for _ in self.groups]
        self.finished = threading.Event()
        self._load()
        self.streams = [hal.stream(component, hal.sampler_base + n, self._types(group))
                        for n, group in enumerate(self.groups)]
        self.thread = threading.Thread(target=self._read, daemon=True)

    @staticmethod
    def _types(group):
        return "".join(PIN_TYPE[kind] for _, _, kind in group)

    def _load(self):
        halcmd("loadrt", "sampler", "cfg=" + ",".join(map(self._types, self.groups)),
               "depth=" + ",".join([str(DEPTH)] * len(self.groups)))
        for fifo, group in enumerate(self.groups):
            halcmd("setp", f"sampler.{fifo}.enable", "0")
            for place, (name, pin, _) in enumerate(group):
                halcmd("net", link(pin, f"live:{name}"), f"sampler.{fifo}.pin.{place}")
            halcmd("addf", f"sampler.{fifo}", "servo-thread")

    def start(self):
        # One signal, so that all FIFOs begin in the same cycle.
        halcmd("newsig", "live:record", "bit")
        for fifo in range(len(self.groups)):
            halcmd("net", "live:record", f"sampler.{fifo}.enable")
        halcmd("sets", "live:record", "1")
        self.thread.start()

    def _read(self):
        while not self.finished.is_set() or any(stream.readable for stream in self.streams):
            for fifo, stream in enumerate(self.streams):
                while stream.readable:
                    self.rows[fifo].append(stream.read())
                    self.numbers[fifo].append(stream.sampleno)
            time.sleep(0.005)

    def stop(self):
        """Ends the recording; Failure if a cycle was lost."""
        halcmd("sets", "live:record", "0")
        time.sleep(0.02)
        self.finished.set()
        self.thread.join(30)
        if self.overruns():
            raise Failure(f"{self.overruns()} servo cycles were not recorded")
        lengths = {len(rows) for rows in self.rows}
        if len(lengths) != 1 or any(not is_gapless(numbers) for numbers in self.numbers):
            raise Failure(f"the trace has gaps: {lengths} samples")

    def overruns(self):
        return sum(hal.get_value(f"sampler.{fifo}.overruns") for fifo in range(len(self.groups)))

    def samples(self):
        return len(self.rows[0])

    def column(self, name):
        for rows, group in zip(self.rows, self.groups):
            names = [column for column, _, _ in group]
            if name in names:
                return [row[names.index(name)] for row in rows]
        raise KeyError(name)

    def write(self, path, count):
        """Writes the first `count` columns. Python writes a float with the digits that restore the same
        bits."""
        with open(path, "w") as trace:
            trace.write(",".join(["t_s"] + [name for name, _, _ in self.columns[:count]]) + "\n")
            for cycle, parts in enumerate(zip(*self.rows)):
                row = [value for part in parts for value in part][:count]
                values = [cycle * self.period] + row
                trace.write(",".join(map(repr, values)) + "\n")


def is_gapless(numbers):
    return all(after - before == 1 for before, after in zip(numbers, numbers[1:]))
