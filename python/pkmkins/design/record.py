# SPDX-License-Identifier: GPL-2.0-or-later
"""The file of a study's judgements: one line of JSON each, written as it completes, and read back to continue a run.

The first line contains the study and version. A line that was cut off when its writer was
killed is dropped; repeated judgements count once. The same search asks for the same judgements in the same
order, so that a run continues by repeating them and finding the results here.
"""

import fcntl
import json
import math
import os

from .._core import VERSION
from .candidate import Judgement


class RecordError(ValueError):
    """A file of judgements that cannot be used: of another study or version, in use, or missing."""


class Record:
    """The judgements of a study, in a file that no other process may write meanwhile."""

    def __init__(self, path, study):
        self.path = path
        self._judgements = {}
        try:
            # "a" also creates the file.
            self._file = open(path, "a+b")
        except OSError as error:
            raise RecordError(f"{path}: {error.strerror}") from None
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise RecordError(f"{path}: another run is writing to it; wait, or choose another file") from None
        self._read(header(study))

    def _read(self, expected):
        self._file.seek(0)
        whole = 0
        for number, line in enumerate(self._file, 1):
            if not line.endswith(b"\n"):
                break
            try:
                given = json.loads(line)
                if number == 1:
                    _same(self.path, given, expected)
                else:
                    self._judgements[key(given["x"])] = _of_line(given)
            except (ValueError, KeyError, TypeError) as error:
                if isinstance(error, RecordError):
                    raise
                raise RecordError(f"{self.path}: line {number} is not a judgment: {error}; choose another file") from None
            whole += len(line)
        # Remove the partial last line of a killed run.
        self._file.truncate(whole)
        self._file.seek(0, os.SEEK_END)
        if whole == 0:
            self._write(expected)

    def get(self, values):
        """Returns the judgement of these numbers, or None."""
        return self._judgements.get(key(values))

    def add(self, values, judgement):
        """Adds a judgement, and writes it at once."""
        if self.get(values) is not None:
            return
        self._judgements[key(values)] = judgement
        objectives = [value if math.isfinite(value) else None for value in judgement.objectives]
        line = {"x": [float(x) for x in values], "objectives": objectives, "violations": judgement.violations}
        self._write(line)

    def _write(self, line):
        self._file.write(json.dumps(line).encode() + b"\n")
        self._file.flush()

    def __len__(self):
        return len(self._judgements)

    def items(self):
        """Yields numbers and judgements, in the order in which they were added."""
        return [(tuple(float.fromhex(x) for x in values), found) for values, found in self._judgements.items()]

    def close(self):
        """Lets other processes write."""
        self._file.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def key(values):
    """Returns an exact key of numbers."""
    return tuple(float(value).hex() for value in values)


def header(study):
    """Returns the first line."""
    ranges = [[one.name, one.place, one.low, one.high] for one in study.ranges]
    return {"study": study.hash, "name": study.name, "version": VERSION, "ranges": ranges}


def _same(path, given, expected):
    for word, what in [("study", "another study, or an older version of this one"), ("version", "another version of pkmkins")]:
        if given.get(word) != expected[word]:
            text = f"{path}: judgments of {what} ({given.get(word)}; this is {expected[word]}): choose another file with --results"
            raise RecordError(text)


def _of_line(line):
    objectives = tuple(math.nan if value is None else float(value) for value in line["objectives"])
    return Judgement(objectives, {str(name): float(by) for name, by in line["violations"].items()})
