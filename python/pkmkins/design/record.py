# SPDX-License-Identifier: GPL-2.0-or-later
"""The file of a study's judgements: one line of JSON each, written as it comes, and read back by who goes on.

The first line says which study and which version they belong to. A line that was cut off when its writer was
killed is dropped; what is judged twice counts once. The same search asks the same questions in the same
order, so that a run goes on by asking again and finding the answers here.
"""

import fcntl
import json
import math
import os

from .._core import VERSION
from .candidate import Judgement


class RecordError(ValueError):
    """A file of judgements that cannot be used: of another study or version, in use, or no such file."""


class Record:
    """The judgements of a study, kept in a file that no one else may write to meanwhile."""

    def __init__(self, path, study):
        self.path = path
        self._judgements = {}
        try:
            # Also where it is not there yet.
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
        # What a killed run has left of its last line.
        self._file.truncate(whole)
        self._file.seek(0, os.SEEK_END)
        if whole == 0:
            self._write(expected)

    def get(self, values):
        """The judgement of these numbers, or None."""
        return self._judgements.get(key(values))

    def add(self, values, judgement):
        """Keeps a judgement, at once."""
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
        """Numbers and judgements, in the order in which they came."""
        return [(tuple(float.fromhex(x) for x in values), found) for values, found in self._judgements.items()]

    def close(self):
        """Lets others write."""
        self._file.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


def key(values):
    """Numbers to the last bit."""
    return tuple(float(value).hex() for value in values)


def header(study):
    """What the first line says."""
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
